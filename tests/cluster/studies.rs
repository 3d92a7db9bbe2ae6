//! Studies over all workers: the same bytes as on one machine, in less time.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::database::{Database, Member, client, until};
use crate::support::{Process, toy};

const STUDIES: &str = "/v1/studies";

fn study(points: u32, each_ms: u32) -> Value {
    json!({
        "calculator": toy::BAR,
        "job": {"length_mm": 500.0, "load_n": 100.0, "duration_ms": each_ms},
        "vary": [{"pointer": "/length_mm", "from": 100, "to": 100 + points, "count": points}],
    })
}

/// Runs a study; its bytes and how long it took from its start to its end, by the service's own clock.
async fn run(api: &Member, study: &Value) -> (Vec<u8>, f64) {
    let address = api.accepted(STUDIES, study).await;
    let job = api.job_in(&address, "succeeded").await;
    let at = |name: &str| job[name].as_str().unwrap().parse::<jiff::Timestamp>().unwrap();
    let took = at("finished_at").duration_since(at("started_at")).as_secs_f64();
    (api.get(&format!("{address}/result")).await.bytes().await.unwrap().to_vec(), took)
}

#[tokio::test]
async fn a_study_is_spread_over_the_workers_and_has_the_same_bytes_as_on_one_machine() {
    let Some(database) = Database::start() else { return };
    let slots = [("PRECUT_JOBS_SLOTS", "1")];
    let api = Member::start(&database, "api", &[]).await;
    let first = Member::start(&database, "worker", &slots).await;
    let study = study(60, 100);
    let (alone, alone_s) = run(&api, &study).await;
    // Its points are forgotten, so that they are computed again.
    let pool = database.pool().await;
    for statement in ["DELETE FROM precut.results", "DELETE FROM precut.jobs"] {
        sqlx::query(statement).execute(&pool).await.unwrap();
    }
    let left: i64 = sqlx::query_scalar("SELECT count(*) FROM precut.studies").fetch_one(&pool).await.unwrap();
    assert_eq!(left, 0, "what is done leaves no parts behind");
    api.stop();
    first.stop();
    let api = Member::start(&database, "api", &[]).await;
    let workers = [Member::start(&database, "worker", &slots).await, Member::start(&database, "worker", &slots).await];
    let (together, together_s) = run(&api, &study).await;
    assert_eq!(alone, together);
    let helped: f64 =
        workers[0].figure("precut_jobs_helped_total").await + workers[1].figure("precut_jobs_helped_total").await;
    assert!(helped > 0.0, "the other worker has helped");

    // And as with the embedded store.
    let data = tempfile::tempdir().unwrap();
    let mut single = Process::start_with(data.path(), &[]);
    let client = client();
    let url = |path: &str| format!("http://{}{path}", single.address);
    let posted = client.post(url(STUDIES)).header("prefer", "respond-async").header("content-type", "application/json");
    let job: Value = posted.body(study.to_string()).send().await.unwrap().json().await.unwrap();
    let address = job["links"]["self"].as_str().unwrap().to_owned();
    let embedded = until("the study", async || {
        let result = client.get(url(&format!("{address}/result"))).send().await.unwrap();
        if result.status() == 200 { Some(result.bytes().await.unwrap()) } else { None }
    })
    .await;
    assert_eq!(alone, embedded);
    single.signal("TERM");
    single.wait(Duration::from_secs(30));
    println!(
        "a study of 60 points of 100 ms: one worker {alone_s:.2} s, two workers {together_s:.2} s, ratio {:.2}",
        alone_s / together_s
    );
}

#[tokio::test]
async fn a_study_survives_whoever_runs_it_and_whoever_helps() {
    let Some(database) = Database::start() else { return };
    let slots = [("PRECUT_JOBS_SLOTS", "1")];
    let api = Member::start(&database, "api", &[]).await;
    let mut workers = Vec::new();
    for _ in 0..3 {
        workers.push(Member::start(&database, "worker", &slots).await);
    }
    let address = api.accepted(STUDIES, &study(150, 100)).await;
    api.job_in(&address, "running").await;
    let pool = database.pool().await;
    let done = async || -> i64 {
        sqlx::query_scalar("SELECT count(*) FROM precut.studies WHERE points IS NOT NULL")
            .fetch_one(&pool)
            .await
            .unwrap()
    };
    until("some parts", async || (done().await >= 3).then_some(())).await;
    // Two of three are killed: whoever runs it is among them, or else both who help.
    workers.remove(0).kill();
    workers.remove(0).kill();
    let begun = Instant::now();
    let job = api.job_in(&address, "succeeded").await;
    println!("a study whose workers were killed: done {:.1?} later, at attempt {}", begun.elapsed(), job["attempt"]);
    let result: Value = api.get(&format!("{address}/result")).await.json().await.unwrap();
    assert_eq!((&result["result"]["succeeded"], &result["result"]["failed"]), (&json!(150), &json!(0)));

    // A cancel ends it for all.
    workers.push(Member::start(&database, "worker", &slots).await);
    let address = api.accepted(STUDIES, &study(400, 110)).await;
    api.job_in(&address, "running").await;
    until("some parts", async || (done().await >= 2).then_some(())).await;
    assert_eq!(api.client.delete(api.url(&address)).send().await.unwrap().status(), 202);
    let begun = Instant::now();
    let mut last = (done().await, Instant::now());
    // Parts that were just being put down may still arrive; then nothing more does.
    while last.1.elapsed() < Duration::from_secs(2) {
        tokio::time::sleep(Duration::from_millis(50)).await;
        let now = done().await;
        if now != last.0 {
            last = (now, Instant::now());
        }
    }
    println!("a study that was cancelled: no part of it is put down later than {:.1?}", last.1.duration_since(begun));
}

#[tokio::test]
async fn a_study_goes_on_after_the_database_was_away_for_longer_than_its_parts_wait() {
    let Some(mut database) = Database::start() else { return };
    let api = Member::start(&database, "api", &[]).await;
    // One worker: nobody else takes what it could not put down.
    let worker = Member::start(&database, "worker", &[("PRECUT_JOBS_SLOTS", "1")]).await;
    let address = api.accepted(STUDIES, &study(60, 100)).await;
    api.job_in(&address, "running").await;
    let pool = database.pool().await;
    until("some parts", async || {
        let done = "SELECT count(*) FROM precut.studies WHERE points IS NOT NULL";
        let done: i64 = sqlx::query_scalar(done).fetch_one(&pool).await.unwrap();
        (done >= 2).then_some(())
    })
    .await;
    pool.close().await;
    database.stop("immediate");
    tokio::time::sleep(Duration::from_secs(12)).await;
    database.run_again();
    let begun = Instant::now();
    let job = api.job_in(&address, "succeeded").await;
    println!("a study whose database was away: done {:.1?} after its return", begun.elapsed());
    assert_eq!(job["attempt"], 1, "nobody was taken for dead: {job}");
    let result: Value = api.get(&format!("{address}/result")).await.json().await.unwrap();
    assert_eq!((&result["result"]["succeeded"], &result["result"]["failed"]), (&json!(60), &json!(0)));
    let pool = database.pool().await;
    let left: i64 = sqlx::query_scalar("SELECT count(*) FROM precut.studies").fetch_one(&pool).await.unwrap();
    assert_eq!(left, 0, "what is done leaves no parts behind");
    worker.stop();
    api.stop();
}
