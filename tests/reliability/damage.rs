//! Damaged files, and calculations that panic.

use serde_json::{Value, json};
use sqlx::Connection;

use crate::support::{header, problem};
use crate::watch::{Service, assert_intact, database, refused_start};

#[tokio::test]
async fn a_damaged_result_is_computed_again_and_never_served() {
    let folder = tempfile::tempdir().unwrap();
    let job = json!({"length_mm": 100, "load_n": 1, "duration_ms": 20});
    let direct = json!({"length_mm": 101, "load_n": 1});
    let service = Service::start(folder.path(), &[]).await;
    let address = service.accepted(&job).await;
    assert_eq!(service.over(&address).await["state"], "succeeded");
    let whole = service.get(&format!("{address}/result")).await.bytes().await.unwrap();
    let other = service.post(&direct).send().await.unwrap().bytes().await.unwrap();
    // The list is complete once what waits is written.
    service.get("/v1/results").await;
    service.stop();
    let mut connection = database(folder.path()).await;
    let damaged =
        sqlx::query("UPDATE results SET body = CAST(substr(body, 1, length(body) - 4) || x'00000000' AS BLOB)")
            .execute(&mut connection)
            .await
            .unwrap()
            .rows_affected();
    connection.close().await.unwrap();
    assert_eq!(damaged, 2);

    let service = Service::start(folder.path(), &[]).await;
    let again = service.post(&direct).send().await.unwrap();
    assert_eq!(header(&again, "precut-cache"), "miss");
    assert_eq!(again.bytes().await.unwrap(), other);
    let result = service.get(&format!("{address}/result")).await;
    if result.status() != 200 {
        problem(result, 409, "job_not_finished").await;
        crate::watch::until("the result to be there again", async || {
            let result = service.get(&format!("{address}/result")).await;
            (result.status() == 200).then_some(())
        })
        .await;
    }
    let result = service.get(&format!("{address}/result")).await.bytes().await.unwrap();
    assert_eq!(result, whole);
    println!("{damaged} damaged results: computed again, the same bytes");
    service.stop();
    assert_intact(folder.path()).await;
}

#[tokio::test]
async fn a_database_that_is_none_is_said_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("precut.db");
    let garbage = "this is no database, but somebody's notes\n".repeat(500);
    std::fs::write(&file, &garbage).unwrap();
    let (code, said) = refused_start(folder.path());
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("cannot be used"), "{said}");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), garbage, "somebody else's file is left as it is");
    println!("no database: {}", said.trim());
}

#[tokio::test]
async fn a_panic_fails_its_job_alone() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[("PRECUT_JOBS_SLOTS", "2")]).await;
    let mut addresses = Vec::new();
    for length in 0..20 {
        let behaviour = if length % 2 == 0 { "panic" } else { "quick" };
        let job = json!({"length_mm": 100 + length, "load_n": 1, "behaviour": behaviour, "duration_ms": 10});
        addresses.push((behaviour, service.accepted(&job).await));
    }
    let (mut failed, mut succeeded) = (0, 0);
    for (behaviour, address) in &addresses {
        let job: Value = service.over(address).await;
        if *behaviour == "panic" {
            assert_eq!((&job["state"], &job["problem"]["code"]), (&json!("failed"), &json!("crashed")), "{job:#}");
            assert_eq!(job["attempt"], 1, "it would panic again");
            problem(service.get(&format!("{address}/result")).await, 500, "crashed").await;
            failed += 1;
        } else {
            assert_eq!(job["state"], "succeeded");
            succeeded += 1;
        }
    }
    assert_eq!(service.figure("precut_panics_total", "").await, 10.0);
    println!("{failed} jobs panicked and failed, {succeeded} beside them succeeded, the process lives");
    service.stop();
}
