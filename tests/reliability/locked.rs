//! A database that another process holds, and a folder that another process serves.

use std::time::Instant;

use serde_json::json;
use sqlx::Connection;

use crate::dice::scale;
use crate::support::{header, problem};
use crate::watch::{Service, assert_intact, database, until};

#[tokio::test]
async fn while_the_database_is_locked_answers_go_on_and_jobs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]).await;
    let before = service.accepted(&json!({"length_mm": 100, "load_n": 1, "duration_ms": 50})).await;
    service.over(&before).await;
    let mut rounds = 0;
    let mut refusals = 0;
    for round in 0..scale() {
        let running = json!({"length_mm": 300 + round, "load_n": 1, "duration_ms": 700});
        let running = service.accepted(&running).await;
        let mut other = database(folder.path()).await;
        sqlx::query("BEGIN EXCLUSIVE").execute(&mut other).await.unwrap();
        let locked = Instant::now();
        // What needs no record is answered.
        let direct = service.post(&json!({"length_mm": 400 + round, "load_n": 1})).send().await.unwrap();
        assert_eq!(direct.status(), 200);
        let read = service.get(&before).await;
        assert_eq!(read.status(), 200, "what is on record can be read");
        let live = service.get("/health/live").await;
        assert_eq!(live.status(), 200);
        // What needs one is refused, after the time that is waited for a lock, and can be sent again.
        let job = json!({"length_mm": 500 + round, "load_n": 1, "duration_ms": 20});
        let refused = service.post(&job).header("prefer", "respond-async").send().await.unwrap();
        assert!(header(&refused, "retry-after").parse::<u32>().unwrap() >= 1);
        problem(refused, 503, "store_failed").await;
        refusals += 1;
        let took = locked.elapsed();
        sqlx::query("COMMIT").execute(&mut other).await.unwrap();
        other.close().await.unwrap();
        // Nobody lays a hand on it: the job that ran meanwhile is recorded, and new ones are taken.
        assert_eq!(service.over(&running).await["state"], "succeeded");
        let again = service.accepted(&job).await;
        assert_eq!(service.over(&again).await["state"], "succeeded");
        until("the answer given meanwhile to be kept", async || {
            let results = service.get("/v1/results").await;
            (results.status() == 200).then_some(())
        })
        .await;
        rounds += 1;
        println!("locked for {took:.1?}");
    }
    println!("locked {rounds} times, {refusals} jobs refused with 503, none lost");
    service.stop();
    assert_intact(folder.path()).await;
}
