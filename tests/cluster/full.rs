//! A database whose disk is full.

use std::time::Duration;

use reqwest::Client;
use serde_json::{Value, json};

use crate::database::{Database, Member, until};
use crate::small_disk::SmallDisk;
use crate::support::header;

const BAR: &str = "/v1/sagging-bar";
/// Jobs sent while there is no room; each is refused or, where the database still has room inside its files, done.
const SENT: u32 = 200;

fn job(number: u32) -> Value {
    json!({"length_mm": 100 + number, "load_n": 10, "stations": 2000, "duration_ms": 5})
}

/// What came of a job sent behind: its address, or status and code of the refusal.
async fn send(client: &Client, url: String, job: &Value) -> Result<String, (u16, String)> {
    let request = client.post(url).header("content-type", "application/json").header("prefer", "respond-async");
    let response = request.body(job.to_string()).send().await.unwrap();
    let status = response.status().as_u16();
    if status == 202 {
        return Ok(header(&response, "location").to_owned());
    }
    let retry = response.headers().contains_key("retry-after");
    let problem: Value = response.json().await.unwrap();
    assert!(retry || status == 507, "whoever is refused is told to come again: {problem}");
    Err((status, problem["code"].as_str().unwrap().to_owned()))
}

#[tokio::test]
async fn with_a_full_database_jobs_are_refused_and_what_was_accepted_is_done_once_there_is_room() {
    let Some(disk) = SmallDisk::new("220m") else {
        println!("no small disk can be mounted here");
        return;
    };
    // Its log of changes is small, too: else it would have room there for longer than the test runs.
    let settings = ["min_wal_size=32MB", "max_wal_size=32MB", "wal_recycle=off"];
    let Some(mut database) = Database::start_in(&disk.path().join("server"), &settings) else { return };
    let api = Member::start(&database, "api", &[]).await;
    let worker = Member::start(&database, "worker", &[]).await;
    let before = api.accepted(BAR, &job(0)).await;
    api.job_in(&before, "succeeded").await;

    disk.fill();
    let (mut accepted, mut refused) = (Vec::new(), std::collections::BTreeMap::new());
    for number in 1..=SENT {
        match send(&api.client, api.url(BAR), &job(number)).await {
            Ok(address) => accepted.push(address),
            Err(why) => *refused.entry(why).or_insert(0_u32) += 1,
        }
    }
    assert!(!refused.is_empty(), "the disk is full");
    for (status, code) in refused.keys() {
        let expected = [(507, "disk_full"), (503, "store_failed")];
        assert!(expected.contains(&(*status, code.as_str())), "{status} {code}");
    }
    // What needs no database goes on.
    assert_eq!(api.get("/health/live").await.status(), 200);
    assert_eq!(api.post(&json!({"length_mm": 77, "load_n": 10})).send().await.unwrap().status(), 200);

    disk.make_room();
    // A database that could not write its log of changes has ended itself: whoever runs it starts it again.
    tokio::time::sleep(Duration::from_millis(300)).await;
    let gave_up = !database.is_running();
    if gave_up {
        database.run_again();
    }
    until("readiness", async || (api.get("/health/ready").await.status() == 200).then_some(())).await;
    for address in &accepted {
        api.job_in(address, "succeeded").await;
    }
    let after = api.accepted(BAR, &job(SENT + 1)).await;
    api.job_in(&after, "succeeded").await;
    println!(
        "full database: {SENT} jobs sent, {} accepted and all done, refused {refused:?}; the database {}",
        accepted.len(),
        if gave_up { "gave up and was started again" } else { "went on" }
    );
    worker.stop();
    api.stop();
}
