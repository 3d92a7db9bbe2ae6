//! Jobs over HTTP: accepted, watched, cancelled, answered.

use std::time::{Duration, Instant};

use reqwest::Response;
use serde_json::{Value, json};

use crate::support::{Server, header, problem, toy};

/// A job that is computed for a second, another one for each length.
fn slow(length_mm: u32) -> String {
    json!({"length_mm": length_mm, "load_n": 1, "duration_ms": 1000}).to_string()
}

/// The job's document, now.
async fn job(server: &Server, address: &str) -> Value {
    let response = server.get(address).send().await.unwrap();
    assert_eq!(response.status(), 200);
    response.json().await.unwrap()
}

/// Waits until a job is in one of these states.
async fn until(server: &Server, address: &str, states: &[&str]) -> Value {
    let start = Instant::now();
    loop {
        let job = job(server, address).await;
        if states.contains(&job["state"].as_str().unwrap()) {
            return job;
        }
        assert!(start.elapsed() < Duration::from_secs(20), "{job:#}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// Sends a job that shall be done behind; its address.
async fn sent(server: &Server, body: String) -> String {
    let response = server.post(body).header("prefer", "respond-async").send().await.unwrap();
    assert_eq!(response.status(), 202);
    header(&response, "location").to_owned()
}

#[tokio::test]
async fn a_long_job_is_accepted_computed_and_read() {
    let server = Server::start().await;
    let response = server.post(slow(100)).send().await.unwrap();
    assert_eq!(response.status(), 202);
    let address = header(&response, "location").to_owned();
    assert!(header(&response, "retry-after").parse::<u32>().unwrap() >= 1);
    assert_eq!(header(&response, "cache-control"), "no-store");
    let accepted: Value = response.json().await.unwrap();
    assert_eq!(accepted["links"]["self"], address.as_str());
    assert_eq!(accepted["calculator"], toy::BAR);
    assert_eq!(accepted["finished_at"], Value::Null);
    let early = server.get(&format!("{address}/result")).send().await.unwrap();
    assert!(!header(&early, "retry-after").is_empty());
    problem(early, 409, "job_not_finished").await;
    let running = until(&server, &address, &["running"]).await;
    assert_eq!(running["attempt"], 1);
    let done = until(&server, &address, &["succeeded"]).await;
    assert_eq!(done["progress"], 1.0);
    assert!(done["expires_at"].is_string() && done["problem"].is_null());
    let result: Response = server.get(&format!("{address}/result")).send().await.unwrap();
    assert_eq!(result.status(), 200);
    let place = header(&result, "content-location").to_owned();
    let result = result.bytes().await.unwrap();
    assert_eq!(place, format!("/v1/results/{}", done["key"].as_str().unwrap()));
    // The same bytes as the direct answer, and as the kept result.
    let again = server.post(slow(100)).send().await.unwrap();
    assert_eq!((again.status().as_u16(), header(&again, "precut-cache")), (200, "hit"));
    assert_eq!(again.bytes().await.unwrap(), result);
    assert_eq!(server.get(&place).send().await.unwrap().bytes().await.unwrap(), result);
}
