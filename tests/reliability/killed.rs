//! kill -9 at random moments: nothing lost, nothing done twice, nothing half-written.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::dice::{Dice, scale};
use crate::support::{header, precut_command};
use crate::watch::{Service, assert_intact, database, until};

const JOBS: u32 = 100;
const KILLS: usize = 10;

/// A job of its own for each number, and what must come out of it.
fn job(number: u32) -> (Value, f64) {
    let length = f64::from(100 + number);
    // Ten stations: the largest sag is at the two in the middle, 4/9 of the length from one end.
    let z = 4.0 / 9.0 * length;
    let sag = 1e-3 * 10.0 * z * (length - z) / length;
    (json!({"length_mm": length, "load_n": 10, "duration_ms": 150}), sag)
}

/// What a result says, which must be whole wherever there is one.
async fn served(service: &Service, address: &str) -> Option<f64> {
    let response = service.get(&format!("{address}/result")).await;
    let (status, text) = (response.status().as_u16(), response.text().await.unwrap());
    if status == 409 {
        return None;
    }
    assert_eq!(status, 200, "{text}");
    let answer: Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("half a result: {error}: {text}"));
    assert!(answer["basis"].is_array(), "the envelope has its end");
    Some(answer["result"]["max_sag_um"].as_f64().unwrap())
}

#[tokio::test]
async fn killed_at_random_moments_no_job_is_lost_or_done_twice() {
    let folder = tempfile::tempdir().unwrap();
    let settings = [("PRECUT_JOBS_SLOTS", "2")];
    let mut dice = Dice::new(20_260_203);
    let mut addresses: Vec<String> = Vec::new();
    let mut finished: BTreeMap<String, String> = BTreeMap::new();
    let (mut slowest_start, mut slowest_orphan) = (Duration::ZERO, Duration::ZERO);
    let (most_kills, mut kills) = (KILLS * scale(), 0);
    let jobs = JOBS * u32::try_from(scale()).unwrap();
    for round in 0..=most_kills {
        let begun = Instant::now();
        let service = Service::start(folder.path(), &settings).await;
        slowest_start = slowest_start.max(begun.elapsed());
        if round == 0 {
            for number in 0..jobs {
                let (job, _) = job(number);
                let request = service.post(&job).header("idempotency-key", format!("kill-{number}"));
                let response = request.header("prefer", "respond-async").send().await.unwrap();
                assert_eq!(response.status(), 202);
                addresses.push(header(&response, "location").to_owned());
            }
        }
        // Some must wait when the last kill comes, which on a very slow machine is earlier.
        let queued: Value = service.get("/v1/jobs?state=queued").await.json().await.unwrap();
        let few = queued["items"].as_array().unwrap().len() < 15;
        if round == most_kills || few {
            assert!(kills >= 1, "the jobs are too short for this machine");
            wait_for_all(folder.path()).await;
            finish(&service, &addresses).await;
            check(&service, &addresses, &finished).await;
            println!(
                "killed {kills} times with {jobs} jobs: {} results seen on the way; slowest start until ready \
                 {slowest_start:.2?}, until an orphan runs again {slowest_orphan:.2?}",
                finished.len()
            );
            service.stop();
            break;
        }
        if round > 0 {
            let begun = Instant::now();
            until("the first job to be taken up", async || {
                let running: Value = service.get("/v1/jobs?state=running").await.json().await.unwrap();
                (!running["items"].as_array().unwrap().is_empty()).then_some(())
            })
            .await;
            slowest_orphan = slowest_orphan.max(begun.elapsed());
        }
        let moment = Instant::now() + dice.time(20, 250);
        while Instant::now() < moment {
            let address = &addresses[usize::try_from(dice.below(u64::from(jobs))).unwrap()];
            if let Some(sag) = served(&service, address).await {
                let number = u32::try_from(addresses.iter().position(|one| one == address).unwrap()).unwrap();
                assert!((sag - job(number).1).abs() < 1e-9 * sag, "the answer is that of the job");
                let at = service.job(address).await["finished_at"].as_str().unwrap().to_owned();
                let before = finished.entry(address.clone()).or_insert_with(|| at.clone());
                assert_eq!(*before, at, "what has ended does not end again");
            }
        }
        service.kill();
        kills += 1;
    }
    assert_intact(folder.path()).await;
    let mut database = database(folder.path()).await;
    let ended: i64 = sqlx::query_scalar("SELECT count(*) FROM jobs WHERE state = 'succeeded'")
        .fetch_one(&mut database)
        .await
        .unwrap();
    let all: i64 = sqlx::query_scalar("SELECT count(*) FROM jobs").fetch_one(&mut database).await.unwrap();
    let keys: i64 = sqlx::query_scalar("SELECT count(DISTINCT key) FROM jobs").fetch_one(&mut database).await.unwrap();
    let results: i64 = sqlx::query_scalar("SELECT count(*) FROM results").fetch_one(&mut database).await.unwrap();
    println!("on record: {all} jobs, {ended} succeeded, {keys} keys, {results} results");
    let jobs = i64::from(jobs);
    assert_eq!((all, ended, keys, results), (jobs, jobs, jobs, jobs));
}

/// Jobs that are killed three times each, one after the other.
const VICTIMS: u32 = 2;

#[tokio::test]
async fn a_job_that_is_killed_three_times_is_done_all_the_same_and_once() {
    let folder = tempfile::tempdir().unwrap();
    let settings = [("PRECUT_JOBS_SLOTS", "2")];
    let mut dice = Dice::new(3);
    let (mut kills, mut attempts) = (0, BTreeMap::<u64, u32>::new());
    let mut service = Service::start(folder.path(), &settings).await;
    let victims = VICTIMS * u32::try_from(scale()).unwrap();
    for number in 0..victims {
        let (mut victim, sag) = job(10_000 + number);
        // Long enough to be seen while it runs.
        victim["duration_ms"] = json!(1500);
        let address = service.accepted(&victim).await;
        for kill in 1..=3 {
            until("the job to run again", async || {
                let job = service.job(&address).await;
                assert_eq!(job["problem"], Value::Null, "{job:#}");
                (job["state"] == "running" && job["attempt"].as_u64() >= Some(kill)).then_some(())
            })
            .await;
            tokio::time::sleep(dice.time(0, 40)).await;
            service.kill();
            kills += 1;
            service = Service::start(folder.path(), &settings).await;
        }
        let done = service.over(&address).await;
        assert_eq!(done["state"], "succeeded", "{done:#}");
        *attempts.entry(done["attempt"].as_u64().unwrap()).or_default() += 1;
        let got = served(&service, &address).await.unwrap();
        assert!((got - sag).abs() < 1e-9 * sag, "the answer is that of the job");
    }
    service.stop();
    assert_intact(folder.path()).await;
    let mut database = database(folder.path()).await;
    let count = |what: &'static str| sqlx::query_scalar::<_, i64>(what);
    let ended = count("SELECT count(*) FROM jobs WHERE state = 'succeeded'").fetch_one(&mut database).await;
    let results = count("SELECT count(*) FROM results").fetch_one(&mut database).await;
    println!("{victims} jobs killed three times each ({kills} kills): all succeeded; starts of each: {attempts:?}");
    assert_eq!((ended.unwrap(), results.unwrap()), (i64::from(victims), i64::from(victims)));
}

/// Waits until every job is over. A long line takes its time: what counts is that it gets on.
async fn wait_for_all(folder: &Path) {
    let mut database = database(folder).await;
    let mut left = i64::MAX;
    while left > 0 {
        left = until("the line to get on", async || {
            let open = sqlx::query_scalar("SELECT count(*) FROM jobs WHERE finished_ms IS NULL");
            let open: i64 = open.fetch_one(&mut database).await.unwrap();
            (open < left).then_some(open)
        })
        .await;
    }
}

async fn finish(service: &Service, addresses: &[String]) {
    for address in addresses {
        let job = service.over(address).await;
        assert_eq!(job["state"], "succeeded", "{job:#}");
    }
}

async fn check(service: &Service, addresses: &[String], finished: &BTreeMap<String, String>) {
    for (number, address) in (0..).zip(addresses) {
        let (job, sag) = job(number);
        let served = served(service, address).await.unwrap();
        assert!((served - sag).abs() < 1e-9 * sag);
        let record = service.job(address).await;
        if let Some(before) = finished.get(address) {
            assert_eq!(record["finished_at"], json!(before), "what has ended does not end again");
        }
        // The same request again is the same job.
        let again = service.post(&job).header("idempotency-key", format!("kill-{number}"));
        let again = again.header("prefer", "respond-async").send().await.unwrap();
        assert_eq!(again.status(), 200);
    }
}

const POINTS: usize = 200;

/// So many points of 20 ms each, every one of them a shard of its own: it is estimated at half a second.
fn study() -> Value {
    json!({
        "calculator": "sagging-bar", "job": {"load_n": 10, "duration_ms": 20, "work_ms": 500},
        "vary": [{"pointer": "/length_mm", "from": 100, "to": 99 + POINTS, "count": POINTS}],
    })
}

/// The number of shards that are done.
async fn done(folder: &Path) -> i64 {
    let mut database = database(folder).await;
    let done = sqlx::query_scalar("SELECT count(*) FROM jobs WHERE parent IS NOT NULL AND state = 'succeeded'");
    done.fetch_one(&mut database).await.unwrap()
}

#[tokio::test]
async fn a_study_that_gets_on_is_finished_however_often_its_process_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    let settings = [("PRECUT_JOBS_SLOTS", "2")];
    let mut dice = Dice::new(11);
    let mut service = Service::start(folder.path(), &settings).await;
    let response = service.post_to("/v1/studies", &study()).send().await.unwrap();
    assert_eq!(response.status(), 202);
    let address = header(&response, "location").to_owned();
    let mut stood = Vec::new();
    for _ in 0..KILLS {
        let before = done(folder.path()).await;
        let is_over = until("the study to get on", async || {
            if done(folder.path()).await > before {
                return Some(false);
            }
            // Its shards are forgotten with its end.
            service.job(&address).await["finished_at"].is_string().then_some(true)
        })
        .await;
        if is_over {
            break;
        }
        tokio::time::sleep(dice.time(0, 60)).await;
        service.kill();
        stood.push(done(folder.path()).await);
        service = Service::start(folder.path(), &settings).await;
    }
    assert!(!stood.is_empty(), "it was over before the first kill");
    let over = service.over(&address).await;
    assert_eq!(over["state"], "succeeded", "{over:#}");
    let result = service.get(&format!("{address}/result")).await.json::<Value>().await.unwrap();
    assert_eq!((&result["result"]["points"], &result["result"]["succeeded"]), (&json!(POINTS), &json!(POINTS)));
    service.stop();
    assert_intact(folder.path()).await;
    let mut database = database(folder.path()).await;
    let count = async |database: &mut sqlx::SqliteConnection, what: &'static str| -> i64 {
        sqlx::query_scalar(what).fetch_one(database).await.unwrap()
    };
    let jobs = count(&mut database, "SELECT count(*) FROM jobs WHERE state = 'succeeded'").await;
    let results = count(&mut database, "SELECT count(*) FROM results").await;
    let left = count(&mut database, "SELECT count(*) FROM jobs WHERE parent IS NOT NULL").await;
    println!(
        "a study killed {} times, with {stood:?} of {POINTS} shards done: {jobs} job with {results} results, its \
         own among them",
        stood.len()
    );
    assert_eq!((jobs, results, left), (1, i64::try_from(POINTS).unwrap() + 1, 0));
}

#[tokio::test]
async fn a_study_that_ends_its_process_at_the_same_point_each_time_is_given_up() {
    let folder = tempfile::tempdir().unwrap();
    let settings = [("PRECUT_JOBS_SLOTS", "2")];
    let mut service = Service::start(folder.path(), &settings).await;
    let behaviours: Vec<&str> = (0..10).map(|point| if point == 6 { "abort" } else { "quick" }).collect();
    let study = json!({
        "calculator": "sagging-bar", "job": {"load_n": 10, "duration_ms": 20, "work_ms": 500},
        "vary": [
            {"pointer": "/length_mm", "from": 100, "to": 109, "count": 10},
            {"pointer": "/behaviour", "values": behaviours},
        ],
        "combine": "zip",
    });
    let response = service.post_to("/v1/studies", &study).send().await.unwrap();
    assert_eq!(response.status(), 202);
    let address = header(&response, "location").to_owned();
    let mut deaths = 0;
    let job = loop {
        let asked = service.request(reqwest::Method::GET, &address).send().await;
        let job: Option<Value> = match asked {
            Ok(response) => response.json().await.ok(),
            Err(_) => None,
        };
        match job {
            Some(job) if job["finished_at"].is_string() => break job,
            Some(_) => tokio::time::sleep(Duration::from_millis(10)).await,
            None => {
                service.kill();
                service = loop {
                    deaths += 1;
                    // Three starts, and one more for what it got on in the last of them.
                    assert!(deaths <= 4, "it is given up");
                    if let Some(service) = Service::try_start(folder.path(), &settings) {
                        break service;
                    }
                };
            }
        }
    };
    assert_eq!((&job["state"], &job["problem"]["code"]), (&json!("failed"), &json!("crashed_repeatedly")), "{job:#}");
    // What it came to before that point is there.
    let point = service.post(&json!({"length_mm": 100, "load_n": 10, "duration_ms": 20, "work_ms": 500}));
    assert_eq!(header(&point.send().await.unwrap(), "precut-cache"), "hit");
    println!("a study with a deadly point: given up after {deaths} deaths of its process");
    service.stop();
}

/// The program itself, with its own calculators: studies and single jobs, killed in between.
#[tokio::test]
async fn the_program_itself_finishes_what_it_was_killed_in() {
    let folder = tempfile::tempdir().unwrap();
    let client = reqwest::Client::new();
    let start = || {
        let data = folder.path().to_str().unwrap();
        let mut child = precut_command(&["serve", "--listen", "127.0.0.1:0", "--data", data]).spawn().unwrap();
        let address = crate::support::address_of(&mut child);
        (child, address)
    };
    let example: Value =
        serde_json::from_str(precut::registry::Registry::standard().unwrap().entries()[0].meta().examples[0].job)
            .unwrap();
    let study = |number: u32| {
        json!({
            "calculator": "deflection-compensation", "job": example,
            "vary": [
                {"pointer": "/cut/feed_mm_per_rev", "from": 0.1, "to": 0.5 + f64::from(number) * 1e-3, "count": 10},
                {"pointer": "/supports/1/compliance_um_per_n", "from": 0.01, "to": 0.1, "count": 10, "spacing": "log"},
            ],
        })
    };
    let mut dice = Dice::new(7);
    let mut addresses: Vec<String> = Vec::new();
    let kills = 2;
    for round in 0..=kills {
        let (mut child, address) = start();
        if round < 2 {
            let response = client
                .post(format!("http://{address}/v1/studies"))
                .header("content-type", "application/json")
                .header("prefer", "respond-async")
                .body(study(u32::try_from(round).unwrap()).to_string())
                .send()
                .await
                .unwrap();
            assert_eq!(response.status(), 202);
            addresses.push(header(&response, "location").to_owned());
        }
        if round == kills {
            for job in &addresses {
                let done = until("a study", async || {
                    let url = format!("http://{address}{job}");
                    let job: Value = client.get(url).send().await.unwrap().json().await.unwrap();
                    job["finished_at"].is_string().then_some(job)
                })
                .await;
                assert_eq!(done["state"], "succeeded", "{done:#}");
                let url = format!("http://{address}{job}/result");
                let result: Value = client.get(url).send().await.unwrap().json().await.unwrap();
                assert_eq!(result["result"]["rows"].as_array().unwrap().len(), 100);
                assert_eq!(result["result"]["succeeded"], 100);
            }
            println!("killed {kills} times with {} studies of 100 points each: all complete", addresses.len());
        } else {
            tokio::time::sleep(dice.time(20, 150)).await;
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert_intact(folder.path()).await;
}
