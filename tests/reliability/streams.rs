//! A client that opens a thousand event streams.

use serde_json::json;

use crate::dice::scale;
use crate::support::problem;
use crate::watch::{Service, until};

#[tokio::test]
async fn a_thousand_streams_are_bounded_and_where_they_are_allowed_all_hear_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]).await;
    let address = service.accepted(&json!({"length_mm": 100, "load_n": 1, "duration_ms": 600_000})).await;
    let events = format!("{address}/events");
    let (mut open, mut refused) = (Vec::new(), 0);
    for _ in 0..1000 {
        let response = service.get(&events).await;
        if response.status() == 200 {
            open.push(response);
        } else {
            refused += 1;
            if refused == 1 {
                problem(response, 429, "too_many_streams").await;
            }
        }
    }
    assert_eq!((open.len(), refused), (16, 984));
    assert_eq!(service.get("/health/live").await.status(), 200);
    // The places of those who leave are free again.
    drop(open);
    until("a place", async || (service.get(&events).await.status() == 200).then_some(())).await;
    let cancelled = service.request(reqwest::Method::DELETE, &address).send().await.unwrap();
    assert!(cancelled.status().is_success());
    service.stop();
    println!("1000 streams of one client: 16 open, 984 refused with 429");

    let most = 200 * scale();
    let settings = [("PRECUT_JOBS_STREAMS", "2000"), ("PRECUT_LIMITS_CONNECTIONS", "2500")];
    let settings = [settings[0], settings[1], ("PRECUT_LIMITS_CONCURRENT_REQUESTS", "2500")];
    let service = Service::start(folder.path(), &settings).await;
    let address = service.accepted(&json!({"length_mm": 101, "load_n": 1, "duration_ms": 3000})).await;
    let mut streams = Vec::new();
    for _ in 0..most {
        let response = service.get(&format!("{address}/events")).await;
        assert_eq!(response.status(), 200);
        streams.push(tokio::spawn(response.text()));
    }
    let mut heard = 0;
    for stream in streams {
        let said = stream.await.unwrap().unwrap();
        assert!(said.contains("event: done") && said.contains("succeeded"), "{said}");
        heard += 1;
    }
    assert_eq!(service.get("/health/ready").await.status(), 200);
    println!("{heard} streams allowed: all heard the end");
    service.stop();
}
