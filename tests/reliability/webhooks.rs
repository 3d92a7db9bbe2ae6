//! kill -9 between the end of a job and the call that tells of it: it is made after the next start.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::{Value, json};

use crate::dice::{Dice, scale};
use crate::receiver::{Receiver, SECRET, secret_file};
use crate::support::toy;
use crate::watch::{Service, assert_intact, until};

const JOBS: u32 = 20;
const KILLS: usize = 5;

#[tokio::test]
async fn whoever_asked_for_it_is_told_however_often_the_process_is_killed() {
    let open = Arc::new(AtomicBool::new(false));
    let is_open = Arc::clone(&open);
    // Nobody takes anything at first: jobs end, and nobody is told.
    let receiver = Receiver::answering(move |_| if is_open.load(Ordering::Relaxed) { 204 } else { 503 });
    let (folder, secret) = (tempfile::tempdir().unwrap(), secret_file(SECRET));
    let hosts = format!("[\"{}\"]", receiver.host());
    // As many tries as there may be: a slow machine takes its time between two kills.
    let pauses = format!("[0.05{}]", ", 2.0".repeat(29));
    let settings = [
        ("PRECUT_CALLBACKS_HOSTS", hosts.as_str()),
        ("PRECUT_CALLBACKS_PRIVATE", "true"),
        ("PRECUT_CALLBACKS_SECRET_FILE", secret.path().to_str().unwrap()),
        ("PRECUT_CALLBACKS_PAUSES_S", pauses.as_str()),
        ("PRECUT_JOBS_SLOTS", "2"),
    ];
    let mut dice = Dice::new(5);
    let mut service = Service::start(folder.path(), &settings).await;
    let mut addresses = Vec::new();
    for number in 0..JOBS {
        let job = json!({"length_mm": 3000 + number, "load_n": 1, "duration_ms": 20});
        let path = format!("/v1/{}?callback={}", toy::BAR, receiver.url("/"));
        let sent = service.post_to(&path, &job).header("prefer", "respond-async").send().await.unwrap();
        assert_eq!(sent.status(), 202);
        addresses.push(crate::support::header(&sent, "location").to_owned());
    }
    let kills = KILLS * scale().min(3);
    for _ in 0..kills {
        let before = receiver.calls().len();
        receiver.after(before + 1).await;
        tokio::time::sleep(dice.time(0, 60)).await;
        service.kill();
        service = Service::start(folder.path(), &settings).await;
    }
    for address in &addresses {
        assert_eq!(service.over(address).await["state"], "succeeded");
    }
    let refused = receiver.calls().len();
    // The last kill comes while all of them are over and none is delivered.
    service.kill();
    open.store(true, Ordering::Relaxed);
    let service = Service::start(folder.path(), &settings).await;
    for address in &addresses {
        let job = until("the callback", async || {
            let job = service.job(address).await;
            (job["callback"]["state"] != "pending").then_some(job)
        })
        .await;
        assert_eq!(job["callback"]["state"], "delivered", "{job:#}");
        // Each try has the same id and says the same, before and after the kills.
        let id = job["id"].as_str().unwrap();
        let calls: Vec<_> = receiver.calls().into_iter().filter(|call| call.header("webhook-id") == id).collect();
        let said: Value = calls[0].json();
        assert_eq!((&said["type"], &said["data"]["id"]), (&json!("job.succeeded"), &json!(id)));
        assert!(calls.iter().all(|call| call.json() == said && call.is_signed_with(SECRET)));
    }
    println!(
        "killed {} times: {JOBS} jobs told in {} calls, {refused} of them before anybody took one",
        kills + 1,
        receiver.calls().len()
    );
    service.stop();
    assert_intact(folder.path()).await;
}
