//! A process under watch whose parts come over two services at once.

use precut::config::Config;
use precut::registry::Registry;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use crate::database::{Database, until};
use crate::stream::process_file;
use crate::support::Server;

const SHAFT: &str = "/v1/processes/shaft-560";

async fn server(database: &Database) -> Server {
    let store = database.address.parse().unwrap();
    Server::start_of(Registry::standard().unwrap(), |config: &mut Config| config.store = store).await
}

async fn got(server: &Server, path: &str) -> Value {
    server.get(path).send().await.unwrap().json().await.unwrap()
}

/// Reports a part, again while the answer is that others were first too often.
async fn report(server: &Server, part: &Value) -> Value {
    until("the part to be taken", async || {
        let path = format!("{SHAFT}/parts/p-{}", part["number"]);
        let sent = server.client.request(Method::PUT, server.url(&path)).json(part).send().await.unwrap();
        let (status, text) = (sent.status(), sent.text().await.unwrap());
        assert!([StatusCode::CREATED, StatusCode::SERVICE_UNAVAILABLE].contains(&status), "{status}: {text}");
        (status == StatusCode::CREATED).then(|| serde_json::from_str(&text).unwrap())
    })
    .await
}

/// What is said of it, without how often something happened.
async fn state(server: &Server) -> Value {
    let mut state = got(server, &format!("{SHAFT}/state")).await;
    state.as_object_mut().unwrap().remove("sequence");
    state
}

#[tokio::test]
async fn parts_that_come_over_two_services_at_once_leave_one_record_without_a_gap() {
    let Some(database) = Database::start() else { return };
    let (one, other) = (server(&database).await, server(&database).await);
    let mut stream = process_file("r01-tailstock-softer.json");
    let parts: Vec<Value> = stream["parts"].as_array().unwrap()[..24].to_vec();
    stream.as_object_mut().unwrap().remove("parts");
    let declared = one.client.request(Method::PUT, one.url(SHAFT)).json(&stream).send().await.unwrap();
    assert_eq!(declared.status(), 201);
    let over = async |server: &Server, odd: usize| {
        let mut said = Vec::new();
        for part in parts.iter().skip(odd).step_by(2) {
            said.push(report(server, part).await["sequence"].as_u64().unwrap());
        }
        said
    };
    let (mut said, by_other) = tokio::join!(over(&one, 0), over(&other, 1));
    said.extend(by_other);
    said.sort_unstable();
    // The document is the first entry.
    assert_eq!(said, (2..=25).collect::<Vec<u64>>());
    let history = got(&other, &format!("{SHAFT}/history?limit=100")).await;
    let sequence: Vec<&Value> = history["items"].as_array().unwrap().iter().map(|entry| &entry["sequence"]).collect();
    assert_eq!(sequence, (1..=25).map(|number| json!(number)).collect::<Vec<_>>().iter().collect::<Vec<_>>());
    let both = state(&one).await;
    assert_eq!(state(&other).await, both);
    one.stop().await;
    other.stop().await;
    // The same parts one after the other, over one service with a file.
    let alone = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    assert_eq!(alone.client.request(Method::PUT, alone.url(SHAFT)).json(&stream).send().await.unwrap().status(), 201);
    for part in &parts {
        report(&alone, part).await;
    }
    assert_eq!(state(&alone).await, both);
    alone.stop().await;
}
