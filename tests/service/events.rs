//! Server-sent events of a job.

use std::time::Duration;

use reqwest::Response;
use serde_json::Value;

use crate::jobs::{job, lasting, sent, until};
use crate::support::{Server, header, problem, toy};

/// An event as it came.
#[derive(Debug)]
struct Event {
    name: String,
    number: u64,
    data: Value,
}

/// The events of a stream until it ends.
async fn events(response: Response) -> Vec<Event> {
    events_after(String::new(), response).await
}

/// The same with what was read of it already.
async fn events_after(mut text: String, mut response: Response) -> Vec<Event> {
    let whole = async {
        while let Ok(Some(chunk)) = response.chunk().await {
            text.push_str(std::str::from_utf8(&chunk).unwrap());
        }
    };
    tokio::time::timeout(Duration::from_mins(1), whole).await.expect("a stream ends with its job");
    let field = |block: &str, name: &str| {
        block.lines().find_map(|line| line.strip_prefix(name)).map(|value| value.trim().to_owned())
    };
    text.split("\n\n")
        .filter_map(|block| {
            Some(Event {
                name: field(block, "event:")?,
                number: field(block, "id:")?.parse().unwrap(),
                data: serde_json::from_str(&field(block, "data:")?).unwrap(),
            })
        })
        .collect()
}

#[tokio::test]
async fn a_stream_tells_a_jobs_life_from_its_state_to_its_end() {
    let server = Server::start().await;
    let held = toy::hold(1109);
    let address = sent(&server, lasting(1109, 1)).await;
    let mut response = server.get(&format!("{address}/events")).send().await.unwrap();
    assert_eq!(response.status(), 200);
    assert_eq!(header(&response, "content-type"), "text/event-stream");
    assert_eq!((header(&response, "x-accel-buffering"), header(&response, "cache-control")), ("no", "no-store"));
    let mut begun = String::new();
    while begun.matches("event: progress").count() < 3 || !begun.contains("event: interim") {
        let chunk = tokio::time::timeout(Duration::from_mins(1), response.chunk()).await.expect("it goes on");
        begun.push_str(std::str::from_utf8(&chunk.unwrap().expect("it goes on")).unwrap());
    }
    drop(held);
    let events = events_after(begun, response).await;
    assert!(events.is_sorted_by(|a, b| a.number < b.number), "{events:#?}");
    let named = |name: &str| events.iter().filter(|event| event.name == name).collect::<Vec<_>>();
    let states: Vec<&str> = named("state").iter().map(|event| event.data["state"].as_str().unwrap()).collect();
    assert!(states.ends_with(&["running", "succeeded"]), "{states:?}");
    let progress: Vec<f64> = named("progress").iter().map(|event| event.data["progress"].as_f64().unwrap()).collect();
    assert!(progress.is_sorted() && progress.len() >= 3, "{progress:?}");
    // Five a second, and one more where the first came at once.
    let done = job(&server, &address).await;
    let at = |name: &str| done[name].as_str().unwrap().parse::<jiff::Timestamp>().unwrap();
    let lasted = at("finished_at").duration_since(at("started_at"));
    assert!(progress.len() as u128 <= 2 + lasted.unsigned_abs().as_millis() / 200, "{progress:?} in {lasted:?}");
    let told = named("progress")[1].data.clone();
    assert!(told["stage"].is_string() && told["remaining_ms"].is_number(), "{told}");
    let interim = named("interim");
    assert!(interim.len() as u128 <= 2 + lasted.unsigned_abs().as_millis() / 300, "{interim:?}");
    assert_eq!(interim[0].data["id"], "sag");
    assert!(interim[0].data["title"]["text"].as_str().is_some_and(|title| !title.is_empty()));
    let last = events.last().unwrap();
    assert_eq!(last.name, "done");
    assert_eq!(last.data, done);
}

#[tokio::test]
async fn a_client_that_comes_back_gets_what_it_has_not_had() {
    let server = Server::start().await;
    let address = sent(&server, lasting(110, 1)).await;
    until(&server, &address, &["succeeded"]).await;
    let follow = |last: Option<u64>| {
        let request = server.get(&format!("{address}/events"));
        last.map_or(request.try_clone().unwrap(), |last| request.header("last-event-id", last.to_string())).send()
    };
    let whole = events(follow(None).await.unwrap()).await;
    let names: Vec<&str> = whole.iter().map(|event| event.name.as_str()).collect();
    assert_eq!(names, ["state", "done"]);
    let rest = events(follow(Some(whole[0].number)).await.unwrap()).await;
    assert!(rest.iter().all(|event| event.number > whole[0].number) && rest.last().unwrap().name == "done");
    let nothing = follow(Some(whole[1].number)).await.unwrap();
    assert_eq!(nothing.status(), 204, "the browser need not come back");
}

#[tokio::test]
async fn a_client_that_claims_to_have_seen_nearly_all_numbers_is_told_the_end() {
    let server = Server::start().await;
    let address = sent(&server, lasting(111, 60_000)).await;
    let request = server.get(&format!("{address}/events")).header("last-event-id", (u64::MAX - 1).to_string());
    let response = request.send().await.unwrap();
    server.client.delete(server.url(&address)).send().await.unwrap();
    let events = events(response).await;
    assert_eq!(events.last().unwrap().name, "done");
}

#[tokio::test]
async fn a_cancel_ends_the_stream() {
    let server = Server::start().await;
    let address = sent(&server, lasting(120, 60_000)).await;
    until(&server, &address, &["running"]).await;
    let response = server.get(&format!("{address}/events")).send().await.unwrap();
    server.client.delete(server.url(&address)).send().await.unwrap();
    let events = events(response).await;
    let last = events.last().unwrap();
    assert_eq!((last.name.as_str(), &last.data["state"]), ("done", &Value::from("cancelled")));
}

#[tokio::test]
async fn a_client_has_so_many_streams_and_no_more() {
    let server = Server::start_with(|config| config.jobs.streams = 3).await;
    let address = sent(&server, lasting(130, 60_000)).await;
    let follow = || server.get(&format!("{address}/events")).send();
    let mut open = Vec::new();
    for _ in 0..3 {
        let response = follow().await.unwrap();
        assert_eq!(response.status(), 200);
        open.push(response);
    }
    for _ in 0..20 {
        let refused = follow().await.unwrap();
        assert!(!header(&refused, "retry-after").is_empty());
        problem(refused, 429, "too_many_streams").await;
    }
    // Closing one makes room, as soon as the service has noticed.
    open.pop();
    let room = async {
        while follow().await.unwrap().status() != 200 {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    tokio::time::timeout(Duration::from_mins(1), room).await.expect("room for one more");
}

#[tokio::test]
async fn streams_end_with_the_service_and_do_not_hold_it_up() {
    let server = Server::start().await;
    let address = sent(&server, lasting(140, 60_000)).await;
    until(&server, &address, &["running"]).await;
    let response = server.get(&format!("{address}/events")).send().await.unwrap();
    let reading = tokio::spawn(events(response));
    tokio::time::timeout(Duration::from_secs(30), server.stop()).await.expect("it stops");
    let events = reading.await.unwrap();
    assert!(events.iter().all(|event| event.name != "done"), "{events:#?}");
}
