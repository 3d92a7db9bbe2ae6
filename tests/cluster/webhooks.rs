//! Callbacks where several processes share a database: each is delivered by one of them.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::json;

use crate::database::{Database, Member, until};
use crate::receiver::{Receiver, SECRET, secret_file};
use crate::support::header;

const BAR: &str = "/v1/sagging-bar";

#[tokio::test]
async fn each_callback_is_delivered_once_whoever_computed_the_job() {
    let Some(database) = Database::start() else { return };
    let (receiver, secret) = (Receiver::start(), secret_file(SECRET));
    let hosts = format!("[\"{}\"]", receiver.host());
    let settings = [
        ("PRECUT_CALLBACKS_HOSTS", hosts.as_str()),
        ("PRECUT_CALLBACKS_PRIVATE", "true"),
        ("PRECUT_CALLBACKS_SECRET_FILE", secret.path().to_str().unwrap()),
    ];
    let one = Member::start(&database, "all", &settings).await;
    let other = Member::start(&database, "all", &settings).await;
    // It may call nobody, and leaves that to those that may.
    let silent = Member::start(&database, "worker", &[]).await;
    let path = format!("{BAR}?callback={}", receiver.url("/"));
    let mut addresses = Vec::new();
    for number in 0..30 {
        let job = json!({"length_mm": 4000 + number, "load_n": 1, "duration_ms": 30});
        let member = if number % 2 == 0 { &one } else { &other };
        let sent = member.post_to(&path, &job).header("prefer", "respond-async").send().await.unwrap();
        assert_eq!(sent.status(), 202);
        addresses.push(header(&sent, "location").to_owned());
    }
    for address in &addresses {
        until("the callback", async || (other.job(address).await["callback"]["state"] == "delivered").then_some(()))
            .await;
    }
    // Whoever would tell once more has had the time to.
    tokio::time::sleep(Duration::from_secs(2)).await;
    let mut told = BTreeMap::<String, u32>::new();
    for call in receiver.calls() {
        assert!(call.is_signed_with(SECRET));
        *told.entry(call.header("webhook-id").to_owned()).or_default() += 1;
    }
    let (by_one, by_other) = (
        one.figure("precut_callbacks_total{outcome=\"delivered\"}").await,
        other.figure("precut_callbacks_total{outcome=\"delivered\"}").await,
    );
    println!("30 callbacks, {by_one} by one process and {by_other} by the other");
    assert_eq!((told.len(), told.values().max()), (30, Some(&1)));
    assert_eq!(by_one + by_other, 30.0);
    assert_eq!(silent.figure("precut_callbacks_total").await, 0.0);
    for member in [one, other, silent] {
        member.stop();
    }
}

#[tokio::test]
async fn a_callback_that_a_killed_process_held_is_tried_by_another() {
    let Some(database) = Database::start() else { return };
    // The first call is never answered.
    let mut first = true;
    let receiver =
        Receiver::saying(move |_| (!std::mem::replace(&mut first, false)).then(|| "HTTP/1.1 204 x\r\n\r\n".to_owned()));
    let secret = secret_file(SECRET);
    let hosts = format!("[\"{}\"]", receiver.host());
    let settings = [
        ("PRECUT_CALLBACKS_HOSTS", hosts.as_str()),
        ("PRECUT_CALLBACKS_PRIVATE", "true"),
        ("PRECUT_CALLBACKS_SECRET_FILE", secret.path().to_str().unwrap()),
        ("PRECUT_CALLBACKS_TIMEOUT_S", "5.0"),
    ];
    let one = Member::start(&database, "all", &settings).await;
    let job = json!({"length_mm": 4100, "load_n": 1});
    let path = format!("{BAR}?callback={}", receiver.url("/"));
    let sent = one.post_to(&path, &job).header("prefer", "respond-async").send().await.unwrap();
    let address = header(&sent, "location").to_owned();
    receiver.after(1).await;
    one.kill();
    let other = Member::start(&database, "all", &settings).await;
    // By the database's clock, twenty seconds after it was taken up.
    let job = until("the callback", async || {
        let job = other.job(&address).await;
        (job["callback"]["state"] == "delivered").then_some(job)
    })
    .await;
    assert_eq!(job["callback"]["attempts"], 2);
    let calls = receiver.calls();
    assert_eq!(calls.len(), 2);
    assert_eq!(calls[0].header("webhook-id"), calls[1].header("webhook-id"));
    other.stop();
}
