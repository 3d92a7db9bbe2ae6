//! Two APIs and three workers under load, killed and stopped at random, and the database with them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::sync::Mutex;

use crate::database::{Database, Member, client, until};
use crate::dice::{Dice, scale};
use crate::support::{header, toy};

const JOBS: u32 = 120;
const BLOWS: usize = 8;
/// Longer than a lease.
const PAUSE: Duration = Duration::from_secs(6);
const SLOTS: [(&str, &str); 1] = [("PRECUT_JOBS_SLOTS", "2")];

/// A job of its own for each number, and what must come out of it.
fn job(number: u32) -> (Value, f64) {
    let length = f64::from(100 + number);
    // Ten stations: the largest sag is at the two in the middle, 4/9 of the length from one end.
    let z = 4.0 / 9.0 * length;
    let sag = 1e-3 * 10.0 * z * (length - z) / length;
    (json!({"length_mm": length, "load_n": 10, "duration_ms": 250}), sag)
}

/// Sends a job until somebody has accepted it; its address, and how often it was refused on the way.
async fn send(apis: &Mutex<Vec<String>>, number: u32) -> (String, u32) {
    let client = client();
    let (job, _) = job(number);
    let (begun, mut refused) = (Instant::now(), 0);
    loop {
        let base = apis.lock().await[(number + refused) as usize % 2].clone();
        let request = client.post(format!("{base}/v1/{}", toy::BAR)).body(job.to_string());
        let request = request.header("content-type", "application/json").header("prefer", "respond-async");
        let request = request.header("idempotency-key", format!("chaos-{number}")).timeout(Duration::from_secs(5));
        if let Ok(response) = request.send().await {
            let (status, location) = (response.status().as_u16(), header(&response, "location").to_owned());
            let wait = header(&response, "retry-after").to_owned();
            let text = response.text().await.unwrap_or_default();
            match status {
                202 => return (location, refused),
                // It was accepted before, and the word of it was lost.
                200 => return (find(&client, &base, number).await, refused),
                503 => assert!(!wait.is_empty(), "when to come again: {text}"),
                other => panic!("{other}: {text}"),
            }
        }
        refused += 1;
        assert!(begun.elapsed() < Duration::from_mins(3), "job {number} is not accepted");
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
}

/// The address of a job that is over already when it is asked for again.
async fn find(client: &reqwest::Client, base: &str, number: u32) -> String {
    let (job, _) = job(number);
    let answer: Value = client
        .post(format!("{base}/v1/{}", toy::BAR))
        .header("content-type", "application/json")
        .body(job.to_string())
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let all: Value = client.get(format!("{base}/v1/jobs?limit=500")).send().await.unwrap().json().await.unwrap();
    let found = all["items"].as_array().unwrap().iter().find(|item| item["key"] == answer["key"]);
    found.expect("a job that was accepted is in the list")["links"]["self"].as_str().unwrap().to_owned()
}

#[tokio::test]
#[allow(clippy::too_many_lines)] // one story from the first blow to the count
async fn kills_and_pauses_lose_no_job_and_double_none() {
    let Some(mut database) = Database::start() else { return };
    let mut dice = Dice::new(20_261_121);
    let mut apis = Vec::new();
    for _ in 0..2 {
        apis.push(Member::start(&database, "api", &[]).await);
    }
    let mut workers = Vec::new();
    for _ in 0..3 {
        workers.push(Member::start(&database, "worker", &SLOTS).await);
    }
    let bases = |apis: &[Member]| apis.iter().map(|api| api.url("")).collect::<Vec<_>>();
    let known = Arc::new(Mutex::new(bases(&apis)));
    let jobs = JOBS * u32::try_from(scale()).unwrap();
    let load = {
        let known = Arc::clone(&known);
        tokio::spawn(async move {
            let mut accepted = BTreeMap::new();
            let mut refused = 0;
            for number in 0..jobs {
                let (address, times) = send(&known, number).await;
                accepted.insert(number, address);
                refused += times;
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
            (accepted, refused)
        })
    };
    let (mut kills, mut pauses, mut restarts) = (0, 0, 0);
    for blow in 0..BLOWS * scale() {
        tokio::time::sleep(dice.time(300, 1500)).await;
        match (blow % 4, dice.below(3)) {
            (0 | 2, which) => {
                let which = usize::try_from(which).unwrap();
                workers.remove(which).kill();
                kills += 1;
                workers.insert(which, Member::start(&database, "worker", &SLOTS).await);
            }
            (1, which) => {
                let worker = &workers[usize::try_from(which).unwrap()];
                worker.process.signal("STOP");
                tokio::time::sleep(PAUSE).await;
                worker.process.signal("CONT");
                pauses += 1;
            }
            (_, 0) => {
                database.stop("immediate");
                database.run_again();
                restarts += 1;
            }
            (_, which) => {
                let which = usize::try_from(which - 1).unwrap();
                apis.remove(which).kill();
                kills += 1;
                apis.insert(which, Member::start(&database, "api", &[]).await);
                *known.lock().await = bases(&apis);
            }
        }
    }
    if restarts == 0 {
        database.stop("immediate");
        database.run_again();
        restarts += 1;
    }
    let (accepted, refused) = load.await.unwrap();
    let begun = Instant::now();
    let mut ended = BTreeMap::new();
    for (number, address) in &accepted {
        let record = until("the end of a job", async || {
            let record: Value = apis[0].client.get(apis[0].url(address)).send().await.ok()?.json().await.ok()?;
            record["finished_at"].is_string().then_some(record)
        })
        .await;
        assert_eq!(record["state"], "succeeded", "{record:#}");
        ended.insert(*number, record["finished_at"].clone());
    }
    let settled = begun.elapsed();
    // Whoever was stopped has gone on long since and had his chance to overwrite something.
    for (number, address) in &accepted {
        // The other process may find that its connections broke with the database, and then asks to come again.
        let record = until("the record at the other process", async || {
            let record = apis[1].job(address).await;
            record["id"].is_string().then_some(record)
        })
        .await;
        assert_eq!(record["finished_at"], ended[number], "what has ended does not end again");
        let answer: Value = apis[1].get(&format!("{address}/result")).await.json().await.unwrap();
        let (served, sag) = (answer["result"]["max_sag_um"].as_f64().unwrap(), job(*number).1);
        assert!((served - sag).abs() < 1e-9 * sag, "the answer is that of the job");
    }
    let pool = database.pool().await;
    let count = async |what: &'static str| -> i64 { sqlx::query_scalar(what).fetch_one(&pool).await.unwrap() };
    let on_record = count("SELECT count(*) FROM precut.jobs").await;
    let finished = count("SELECT count(*) FROM precut.jobs WHERE state = 'succeeded'").await;
    let keys = count("SELECT count(DISTINCT key) FROM precut.jobs").await;
    let results = count("SELECT count(*) FROM precut.results").await;
    let restarted = count("SELECT count(*) FROM precut.jobs WHERE attempt > 1").await;
    let accepted = i64::try_from(accepted.len()).unwrap();
    let (lost, doubled) = (accepted - finished.min(accepted), on_record - keys);
    println!(
        "{kills} kills, {pauses} pauses beyond the lease, {restarts} restarts of the database; {refused} requests told to come \
         again\naccepted {accepted}, finished {finished}, lost {lost}, doubled {doubled} ({restarted} begun again, \
         {results} results); settled {settled:.1?} after the last was accepted"
    );
    assert_eq!((finished, lost, doubled), (accepted, 0, 0));
    assert_eq!((on_record, keys, results), (accepted, accepted, accepted));
}
