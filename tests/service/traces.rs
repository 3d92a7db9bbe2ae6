//! Spans that are exported, to a real collector's address: one trace from the client's call to the one that tells of its end.

use std::time::Duration;

use serde_json::{Value, json};

use crate::receiver::{Call, Receiver, SECRET, secret_file};
use crate::support::{Process, header, toy};

/// All spans of some batches.
fn spans(batches: &[Call]) -> Vec<Value> {
    let lists = |value: &Value, name: &str| value[name].as_array().unwrap().clone();
    let scopes = |batch: &Call| -> Vec<Value> {
        lists(&batch.json(), "resourceSpans").iter().flat_map(|of| lists(of, "scopeSpans")).collect()
    };
    batches.iter().flat_map(scopes).flat_map(|scope| lists(&scope, "spans")).collect()
}

#[cfg(unix)]
#[tokio::test]
async fn a_job_is_one_trace_from_its_request_to_its_callback() {
    let (collector, receiver, secret) = (Receiver::answering(|_| 200), Receiver::start(), secret_file(SECRET));
    let folder = tempfile::tempdir().unwrap();
    let (endpoint, hosts) = (collector.url("/v1/traces"), format!("[\"{}\"]", receiver.host()));
    let settings = [
        ("PRECUT_TRACES_ENDPOINT", endpoint.as_str()),
        ("PRECUT_CALLBACKS_HOSTS", &hosts),
        ("PRECUT_CALLBACKS_PRIVATE", "true"),
        ("PRECUT_CALLBACKS_SECRET_FILE", secret.path().to_str().unwrap()),
        // What is exported does not hang on what is logged.
        ("PRECUT_LOG_LEVEL", "error"),
    ];
    let mut process = Process::start_with(folder.path(), &settings);
    let client = reqwest::Client::new();
    let (trace, parent) = ("4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7");
    let send = async |length: u32, place: Option<String>| -> Value {
        let job = json!({"length_mm": length, "load_n": 1, "duration_ms": 1}).to_string();
        let url = format!("http://{}/v1/{}?callback={}", process.address, toy::BAR, receiver.url("/"));
        let mut request = client.post(url).body(job);
        request = request.header("content-type", "application/json").header("prefer", "respond-async");
        if let Some(place) = place {
            request = request.header("traceparent", place).header("tracestate", "plant=mes");
        }
        let accepted = request.send().await.unwrap();
        assert_eq!((accepted.status().as_u16(), header(&accepted, "retry-after")), (202, "1"));
        accepted.json().await.unwrap()
    };
    let accepted = send(2401, Some(format!("00-{trace}-{parent}-01"))).await;
    let told = receiver.after(1).await.remove(0);
    // One that its client has chosen not to follow is not exported, and one without a place begins a trace of its own.
    send(2402, Some(format!("00-{}-{parent}-00", "a".repeat(32)))).await;
    let own = send(2403, None).await["traceparent"].as_str().unwrap().to_owned();
    receiver.after(3).await;
    process.signal("TERM");
    assert_eq!(process.wait(Duration::from_mins(1)), Some(0));

    let batches = collector.calls();
    assert!(!batches.is_empty(), "what is left is sent at the end");
    for batch in &batches {
        assert_eq!((batch.path.as_str(), batch.header("content-type")), ("/v1/traces", "application/json"));
    }
    let about = batches[0].json()["resourceSpans"][0]["resource"].to_string();
    assert!(about.contains("service.name") && about.contains("precut") && about.contains("service.version"), "{about}");
    let spans = spans(&batches);
    let of = |trace: &str| -> Vec<&Value> { spans.iter().filter(|span| span["traceId"] == trace).collect() };
    let named = |name: &str| {
        let found = of(trace).into_iter().find(|span| span["name"] == name);
        found.unwrap_or_else(|| panic!("no span {name} in {spans:#?}"))
    };
    let (request, job, callback) = (named("request"), named("job"), named("callback"));
    assert_eq!(request["parentSpanId"], parent);
    assert_eq!(job["parentSpanId"], request["spanId"]);
    assert_eq!(callback["parentSpanId"], request["spanId"]);
    let place = |span: &Value| format!("00-{trace}-{}-01", span["spanId"].as_str().unwrap());
    assert_eq!(accepted["traceparent"], place(request));
    assert_eq!(told.header("traceparent"), place(callback), "who is told can go on with it");
    assert_eq!(told.header("tracestate"), "plant=mes");
    assert_eq!((&job["traceState"], &callback["traceState"]), (&json!("plant=mes"), &json!("plant=mes")));
    assert!(of(&"a".repeat(32)).is_empty());
    assert_eq!(of(own.split('-').nth(1).unwrap()).len(), 3);
}

#[cfg(unix)]
#[tokio::test]
async fn a_collector_that_is_not_there_stops_nothing() {
    let folder = tempfile::tempdir().unwrap();
    // Port 9 of this machine: nobody.
    let settings = [("PRECUT_TRACES_ENDPOINT", "http://127.0.0.1:9/v1/traces")];
    let mut process = Process::start_with(folder.path(), &settings);
    let client = reqwest::Client::new();
    let url = format!("http://{}/v1/{}", process.address, toy::BAR);
    for _ in 0..20 {
        let request = client.post(&url).header("content-type", "application/json").body(toy::JOB);
        assert_eq!(request.send().await.unwrap().status(), 200);
    }
    process.signal("TERM");
    assert_eq!(process.wait(Duration::from_mins(1)), Some(0));
}
