//! Any process answers for any job.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::database::{Database, Member, PATIENCE, until};
use crate::support::{header, toy};

const BAR: &str = "/v1/sagging-bar";

#[tokio::test]
async fn any_api_answers_for_any_job_and_a_cancel_reaches_its_worker() {
    let Some(database) = Database::start() else { return };
    let one = Member::start(&database, "api", &[]).await;
    let other = Member::start(&database, "api", &[]).await;
    assert_eq!(toy::BAR, "sagging-bar");

    // Accepted by one, and while nobody works, it waits.
    let short = json!({"length_mm": 321, "load_n": 10, "duration_ms": 300});
    let request = one.post(&short).header("idempotency-key", "the-same").header("prefer", "respond-async");
    let response = request.send().await.unwrap();
    let address = header(&response, "location").to_owned();
    assert_eq!(response.status(), 202);
    assert_eq!(other.job(&address).await["state"], "queued");
    let worker = Member::start(&database, "worker", &[("PRECUT_JOBS_SLOTS", "2")]).await;
    assert_eq!(worker.get(BAR).await.status(), 404, "a worker is asked how it is and nothing else");
    other.job_in(&address, "succeeded").await;
    let results = [one.get(&format!("{address}/result")).await, other.get(&format!("{address}/result")).await];
    let mut bodies = Vec::new();
    for result in results {
        assert_eq!(result.status(), 200);
        bodies.push(result.bytes().await.unwrap());
    }
    assert_eq!(bodies[0], bodies[1]);

    // The same name is the same job, whoever is asked; another body under it is a fault.
    let again = other.post(&short).header("idempotency-key", "the-same").header("prefer", "respond-async");
    let again = again.send().await.unwrap();
    assert_eq!((again.status().as_u16(), again.bytes().await.unwrap()), (200, bodies.remove(0)));
    let another = json!({"length_mm": 322, "load_n": 10, "duration_ms": 300});
    let reused = other.post(&another).header("idempotency-key", "the-same").send().await.unwrap();
    assert_eq!(reused.status(), 422);

    // What one has answered is a hit for the other.
    let direct = json!({"length_mm": 400, "load_n": 10});
    let miss = one.post(&direct).send().await.unwrap();
    assert_eq!((miss.status().as_u16(), header(&miss, "precut-cache")), (200, "miss"));
    until("the other to know the answer", async || {
        let place = header(&miss, "content-location").to_owned();
        (other.get(&place).await.status() == 200).then_some(())
    })
    .await;
    assert_eq!(header(&other.post(&direct).send().await.unwrap(), "precut-cache"), "hit");

    // A long one is watched at one process, computed by another and cancelled by a third.
    let long = json!({"length_mm": 500, "load_n": 10, "duration_ms": 120_000});
    let address = one.accepted(BAR, &long).await;
    one.job_in(&address, "running").await;
    let mut events = one.get(&format!("{address}/events")).await;
    let (mut text, mut seen, begun) = (String::new(), 0, Instant::now());
    while seen < 2 {
        text += &String::from_utf8_lossy(&events.chunk().await.unwrap().unwrap());
        seen = text.matches("event: progress").count();
        assert!(begun.elapsed() < PATIENCE, "{text}");
    }
    let cancelled = Instant::now();
    let response = other.client.delete(other.url(&address)).send().await.unwrap();
    assert_eq!(response.status(), 202);
    while !text.contains("event: done") {
        text += &String::from_utf8_lossy(&events.chunk().await.unwrap().unwrap());
    }
    let told = cancelled.elapsed();
    assert!(text.contains("\"state\":\"cancelled\""), "{text}");
    // The worker has its place again as soon as it has given the job up.
    let next = one.accepted(BAR, &json!({"length_mm": 501, "load_n": 10, "duration_ms": 1})).await;
    one.job_in(&next, "succeeded").await;
    until("the worker to give the job up", async || (worker.figure("precut_jobs_total{").await >= 3.0).then_some(()))
        .await;
    println!(
        "cancel across processes: told after {told:.1?}, given up by its worker after {:.1?}",
        cancelled.elapsed()
    );
    for member in [one, other, worker] {
        member.stop();
    }
}

#[tokio::test]
async fn a_short_job_has_a_place_where_long_ones_have_taken_all_others() {
    let Some(database) = Database::start() else { return };
    let api = Member::start(&database, "api", &[]).await;
    let mut workers = Vec::new();
    for _ in 0..2 {
        workers.push(Member::start(&database, "worker", &[("PRECUT_JOBS_SLOTS", "1")]).await);
    }
    let mut long = Vec::new();
    for length in [700, 701, 702] {
        long.push(api.accepted(BAR, &json!({"length_mm": length, "load_n": 10, "duration_ms": 120_000})).await);
    }
    for address in &long[..2] {
        api.job_in(address, "running").await;
    }
    for length in 710..714 {
        let short = api.accepted(BAR, &json!({"length_mm": length, "load_n": 10, "duration_ms": 20})).await;
        assert_eq!(api.job_in(&short, "succeeded").await["attempt"], 1);
    }
    let states = [api.job(&long[0]).await, api.job(&long[1]).await, api.job(&long[2]).await];
    assert_eq!(states.map(|job| job["state"].clone()), [json!("running"), json!("running"), json!("queued")]);
    for member in workers {
        member.stop();
    }
    api.stop();
}

#[tokio::test]
async fn the_database_restarts_under_load_and_nothing_is_lost() {
    let Some(mut database) = Database::start() else { return };
    let api = Member::start(&database, "api", &[]).await;
    let worker = Member::start(&database, "worker", &[("PRECUT_JOBS_SLOTS", "2")]).await;
    let mut addresses = Vec::new();
    for number in 0..20 {
        addresses.push(api.accepted(BAR, &json!({"length_mm": 100 + number, "load_n": 10, "duration_ms": 300})).await);
    }
    api.job_in(&addresses[1], "succeeded").await;
    database.stop("immediate");
    // Clients are told to come again, and nothing of what is ours has crashed.
    let job = json!({"length_mm": 900, "load_n": 10, "duration_ms": 300});
    let refused = api.post(&job).header("prefer", "respond-async").send().await.unwrap();
    assert_eq!(refused.status(), 503);
    assert!(!header(&refused, "retry-after").is_empty());
    let problem: Value = refused.json().await.unwrap();
    assert_eq!(problem["code"], "store_failed");
    let refused = api.get(&addresses[5]).await;
    assert_eq!((refused.status().as_u16(), header(&refused, "retry-after").is_empty()), (503, false));
    assert_eq!(api.get("/health/live").await.status(), 200);
    assert_eq!(api.get("/health/ready").await.status(), 503);
    // What needs no database goes on.
    assert_eq!(api.post(&json!({"length_mm": 77, "load_n": 10})).send().await.unwrap().status(), 200);
    tokio::time::sleep(Duration::from_secs(1)).await;
    let down = Instant::now();
    database.run_again();
    until("readiness", async || (api.get("/health/ready").await.status() == 200).then_some(())).await;
    let ready = down.elapsed();
    for address in &addresses {
        let job = api.job_in(address, "succeeded").await;
        assert_eq!(job["attempt"], 1, "nobody was taken for dead: {job}");
    }
    println!("after a restart of the database: ready after {ready:.1?}, all jobs done after {:.1?}", down.elapsed());
    worker.stop();
    api.stop();
}

#[tokio::test]
async fn what_is_computed_says_that_it_lives_whoever_is_waited_for() {
    let Some(database) = Database::start() else { return };
    let api = Member::start(&database, "api", &[]).await;
    let worker = Member::start(&database, "worker", &[("PRECUT_JOBS_SLOTS", "2")]).await;
    let mut addresses = Vec::new();
    for length in [600, 601] {
        let long = json!({"length_mm": length, "load_n": 10, "duration_ms": 120_000});
        addresses.push(api.accepted(BAR, &long).await);
    }
    for address in &addresses {
        api.job_in(address, "running").await;
    }
    // Somebody holds the lock of the first and does not get on, and its deadline passes: everyone waits for him.
    let pool = database.pool().await;
    let mut hold = pool.begin().await.unwrap();
    let id = addresses[0].rsplit('/').next().unwrap();
    sqlx::query("SELECT pg_advisory_xact_lock(precut.lock_of(key)) FROM precut.jobs WHERE id = $1")
        .bind(id)
        .execute(&mut *hold)
        .await
        .unwrap();
    let passed = "UPDATE precut.jobs SET deadline_ms = precut.now_ms() WHERE id = $1";
    sqlx::query(passed).bind(id).execute(&pool).await.unwrap();
    until("both to wait", async || {
        let waiting =
            "SELECT count(*) FROM pg_stat_activity WHERE wait_event_type = 'Lock' AND wait_event = 'advisory'";
        let waiting: i64 = sqlx::query_scalar(waiting).fetch_one(&pool).await.unwrap();
        (waiting >= 2).then_some(())
    })
    .await;
    let (begun, mut most_ms) = (Instant::now(), 0_i64);
    // Longer than a lease.
    while begun.elapsed() < Duration::from_secs(6) {
        let silent = "SELECT max(precut.now_ms() - heartbeat_ms) FROM precut.jobs WHERE state = 'running'";
        let silent: Option<i64> = sqlx::query_scalar(silent).fetch_one(&pool).await.unwrap();
        most_ms = most_ms.max(silent.unwrap());
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    println!("beats while everything else waits for a lock: silent for {most_ms} ms at most");
    assert!(most_ms < 3500, "silent for {most_ms} ms");
    hold.rollback().await.unwrap();
    assert_eq!(api.job_in(&addresses[0], "failed").await["problem"]["code"], "deadline_exceeded");
    let other = api.job(&addresses[1]).await;
    assert_eq!((&other["state"], &other["attempt"]), (&json!("running"), &json!(1)));
    // What is computed when its process is stopped is in line again at once, and not charged.
    worker.stop();
    let other = api.job(&addresses[1]).await;
    assert_eq!((&other["state"], &other["attempt"]), (&json!("queued"), &json!(0)));
    api.stop();
}
