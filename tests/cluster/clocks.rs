//! Machines whose clocks differ by minutes.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::database::{Database, Member, until};
use crate::support::header;

const BAR: &str = "/v1/sagging-bar";

/// The library that gives a process another time of day; `None`, with a word, where it is not installed.
fn other_clock() -> Option<PathBuf> {
    let found = std::fs::read_dir("/usr/lib").into_iter().flatten().flatten().find_map(|folder| {
        let library = folder.path().join("faketime/libfaketimeMT.so.1");
        library.exists().then_some(library)
    });
    if found.is_none() {
        assert!(std::env::var("CI").as_deref() != Ok("true"), "faketime is not installed");
        println!("NOT TESTED: faketime is not installed; ./test.sh installs it");
    }
    found
}

fn at(job: &Value, field: &str) -> jiff::Timestamp {
    job[field].as_str().unwrap().parse().unwrap()
}

#[tokio::test]
async fn clocks_that_differ_by_minutes_lose_nothing_double_nothing_and_end_no_job_early() {
    let Some(library) = other_clock() else { return };
    let Some(database) = Database::start() else { return };
    let library = library.to_str().unwrap();
    // Only the time of day is wrong: how long something takes every machine measures right.
    let clock = |offset: &'static str| [("LD_PRELOAD", library), ("FAKETIME", offset), ("DONT_FAKE_MONOTONIC", "1")];
    let early = Member::start(&database, "api", &clock("-7m")).await;
    let late = Member::start(&database, "api", &clock("+7m")).await;
    let mut workers = Vec::new();
    for offset in ["-11m", "+11m"] {
        let mut settings = clock(offset).to_vec();
        settings.push(("PRECUT_JOBS_SLOTS", "2"));
        workers.push(Member::start(&database, "worker", &settings).await);
    }
    // It is the wrong time there, indeed.
    let date = |api: &Member| {
        let url = api.url("/health/live");
        let client = api.client.clone();
        async move {
            let response = client.get(url).send().await.unwrap();
            jiff::fmt::rfc2822::parse(header(&response, "date")).unwrap().timestamp()
        }
    };
    let apart = date(&late).await.duration_since(date(&early).await);
    assert!((13 * 60..=15 * 60).contains(&apart.as_secs()), "{apart}");

    let mut addresses = Vec::new();
    for number in 0..24 {
        let api = if number % 2 == 0 { &early } else { &late };
        let job = json!({"length_mm": 600 + number, "load_n": 10, "duration_ms": 200});
        // A minute is time enough: by any machine's own clock it was over before it began, or lasts for ever.
        addresses.push(api.accepted(&format!("{BAR}?deadline_s=60"), &job).await);
    }
    for (number, address) in addresses.iter().enumerate() {
        let asked = if number % 3 == 0 { &early } else { &late };
        let job = asked.job_in(address, "succeeded").await;
        // One clock for all: the database's, which here is this test's own.
        let (created, finished) = (at(&job, "created_at"), at(&job, "finished_at"));
        assert!(created <= at(&job, "started_at") && at(&job, "started_at") <= finished, "{job}");
        assert!(jiff::Timestamp::now().duration_since(created).as_secs().abs() < 150, "{job}");
        assert_eq!(job["attempt"], 1, "a lease that still ran was taken over: {job}");
        assert_eq!(asked.get(&format!("{address}/result")).await.status(), 200);
    }

    // A deadline passes when it passes, whoever looks.
    let long = json!({"length_mm": 700, "load_n": 10, "duration_ms": 60_000});
    let address = late.accepted(&format!("{BAR}?deadline_s=1"), &long).await;
    let job = early.job_in(&address, "failed").await;
    assert_eq!(job["problem"]["code"], "deadline_exceeded");
    let lasted = at(&job, "finished_at").duration_since(at(&job, "created_at"));
    assert!((1..=10).contains(&lasted.as_secs()), "{lasted}");

    // A worker that dies is missed after its lease, not eleven minutes later or at once.
    let slow = json!({"length_mm": 701, "load_n": 10, "duration_ms": 1500});
    let address = early.accepted(BAR, &slow).await;
    early.job_in(&address, "running").await;
    workers.remove(0).kill();
    let job = late.job_in(&address, "succeeded").await;
    assert!(job["attempt"].as_u64().unwrap() <= 2, "{job}");
    let job_of_new_worker = late.accepted(BAR, &json!({"length_mm": 702, "load_n": 10})).await;
    until("the other worker", async || (late.job(&job_of_new_worker).await["state"] == "succeeded").then_some(()))
        .await;
    println!("clocks 22 minutes apart: 24 jobs done once each, deadline kept, a dead worker's job taken over");
}
