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

const DONE: &str = "state = 'succeeded'";

/// How many shards are on record of which that is true.
async fn shards(pool: &sqlx::PgPool, what: &'static str) -> i64 {
    let counted = format!("SELECT count(*) FROM precut.jobs WHERE parent IS NOT NULL AND {what}");
    sqlx::query_scalar(sqlx::AssertSqlSafe(counted)).fetch_one(pool).await.unwrap()
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
    assert_eq!(shards(&pool, "true").await, 0, "what is done leaves no shards behind");
    for statement in ["DELETE FROM precut.results", "DELETE FROM precut.jobs"] {
        sqlx::query(statement).execute(&pool).await.unwrap();
    }
    api.stop();
    first.stop();
    let api = Member::start(&database, "api", &[]).await;
    let workers = [Member::start(&database, "worker", &slots).await, Member::start(&database, "worker", &slots).await];
    let (together, together_s) = run(&api, &study).await;
    assert_eq!(alone, together);
    for worker in &workers {
        assert!(worker.figure("precut_jobs_shards_total").await > 0.0, "each has a part in it");
    }

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
async fn a_study_survives_whoever_runs_it_and_whoever_computes_its_shards() {
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
    until("some shards", async || (shards(&pool, DONE).await >= 3).then_some(())).await;
    // Two of three are killed: whoever runs it is among them, or else both others.
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
    until("some shards", async || (shards(&pool, DONE).await >= 2).then_some(())).await;
    assert_eq!(api.client.delete(api.url(&address)).send().await.unwrap().status(), 202);
    let begun = Instant::now();
    // One that is just being written may stay for a minute, but nobody computes it.
    assert_eq!(shards(&pool, "state = 'queued'").await, 0);
    until("its end", async || (shards(&pool, "state = 'running'").await == 0).then_some(())).await;
    let computed = async || {
        let mut computed = 0.0;
        for worker in &workers {
            computed += worker.figure("precut_jobs_shards_total").await;
        }
        computed
    };
    let at_end = computed().await;
    tokio::time::sleep(Duration::from_secs(1)).await;
    assert_eq!(computed().await.to_bits(), at_end.to_bits(), "none of them is begun any more");
    println!("a study that was cancelled: nobody computes a shard of it {:.1?} later", begun.elapsed());
}

#[tokio::test]
async fn a_study_goes_on_after_the_database_was_away_for_longer_than_its_shards_wait() {
    let Some(mut database) = Database::start() else { return };
    let api = Member::start(&database, "api", &[]).await;
    // One worker: nobody else takes what it could not write.
    let worker = Member::start(&database, "worker", &[("PRECUT_JOBS_SLOTS", "1")]).await;
    let address = api.accepted(STUDIES, &study(60, 100)).await;
    api.job_in(&address, "running").await;
    let pool = database.pool().await;
    until("some shards", async || (shards(&pool, DONE).await >= 2).then_some(())).await;
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
    assert_eq!(shards(&pool, "true").await, 0, "what is done leaves no shards behind");
    worker.stop();
    api.stop();
}
