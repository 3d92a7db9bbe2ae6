//! A backup that is taken while everything runs, and what comes of it when it is restored.

use std::path::PathBuf;
use std::process::Command;

use serde_json::json;

use crate::database::{Database, Member};
use crate::support::header;

const BAR: &str = "/v1/sagging-bar";

/// A program of PostgreSQL's, the newest that is installed.
fn program(name: &str) -> Command {
    let mut found: Vec<PathBuf> = std::fs::read_dir("/usr/lib/postgresql")
        .into_iter()
        .flatten()
        .flatten()
        .map(|version| version.path().join("bin").join(name))
        .filter(|path| path.exists())
        .collect();
    found.sort();
    Command::new(found.pop().unwrap_or_else(|| PathBuf::from(name)))
}

fn succeeds(mut command: Command) {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
}

#[tokio::test]
async fn a_backup_taken_under_load_holds_every_job_accepted_before_it_and_finishes_each_once() {
    let Some(database) = Database::start() else { return };
    let api = Member::start(&database, "api", &[]).await;
    let worker = Member::start(&database, "worker", &[("PRECUT_JOBS_SLOTS", "2")]).await;
    let job = |number: u32| json!({"length_mm": 100 + number, "load_n": 10, "duration_ms": 400});
    let mut addresses = Vec::new();
    for number in 0..20 {
        addresses.push(api.accepted(BAR, &job(number)).await);
    }
    api.job_in(&addresses[1], "succeeded").await;
    let before = api.get(&format!("{}/result", addresses[1])).await.bytes().await.unwrap();

    let folder = tempfile::tempdir().unwrap();
    let dump = folder.path().join("precut.dump");
    let mut backup = program("pg_dump");
    backup.args(["--format", "custom", "--file"]).arg(&dump).arg(&database.address);
    succeeds(backup);
    let unfinished = {
        let mut count = 0;
        for address in &addresses {
            count += u32::from(api.job(address).await["state"] != "succeeded");
        }
        count
    };
    // The old machine burns down: what it finishes after the backup nobody sees.
    worker.kill();
    api.kill();

    let again = Database::start().unwrap();
    let mut restore = program("pg_restore");
    restore.args(["--exit-on-error", "--dbname", &again.address]).arg(&dump);
    succeeds(restore);
    drop(database);
    let api = Member::start(&again, "api", &[]).await;
    let worker = Member::start(&again, "worker", &[("PRECUT_JOBS_SLOTS", "4")]).await;
    for address in &addresses {
        let job = api.job_in(address, "succeeded").await;
        assert!(job["attempt"].as_u64().unwrap() <= 2, "{job}");
        let result = api.get(&format!("{address}/result")).await;
        assert_eq!(result.status(), 200);
    }
    let after = api.get(&format!("{}/result", addresses[1])).await.bytes().await.unwrap();
    assert_eq!(before, after, "a result is the same after the restore");
    // And it goes on from there.
    let response = api.post(&json!({"length_mm": 900, "load_n": 10})).send().await.unwrap();
    assert_eq!((response.status().as_u16(), header(&response, "precut-cache")), (200, "miss"));
    println!(
        "backup under load: 20 jobs accepted, {unfinished} unfinished soon after it, all 20 done after the restore"
    );
    worker.stop();
    api.stop();
}
