//! Who may see what: keys with owners and scopes.

use precut::registry::Registry;
use reqwest::Method;

use crate::isolation::{self, As, with_keys};
use crate::support::{Server, problem, toy};

#[tokio::test]
async fn jobs_are_their_owners_alone() {
    let server = Server::start_with(with_keys).await;
    isolation::jobs_are_their_owners_alone(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn results_are_shared_by_content_and_shown_to_who_asked() {
    let server = Server::start_with(with_keys).await;
    isolation::results_are_shared_by_content_and_shown_to_who_asked(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn models_are_their_owners_alone() {
    let server = Server::start_of(Registry::standard().unwrap(), with_keys).await;
    isolation::models_are_their_owners_alone(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn an_answer_is_traced_to_what_made_it() {
    let server = Server::start_with(with_keys).await;
    isolation::an_answer_is_traced_to_what_made_it(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn an_answer_is_traced_to_its_model() {
    let server = Server::start_of(Registry::standard().unwrap(), with_keys).await;
    isolation::an_answer_is_traced_to_its_model(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn a_key_may_what_its_scopes_say() {
    let server = Server::start_with(with_keys).await;
    let (mine, reader, root) = (As(&server, "a-one"), As(&server, "reader"), As(&server, "root"));
    let refused = problem(reader.post(toy::JOB).send().await.unwrap(), 403, "forbidden").await;
    assert!(refused["detail"].as_str().unwrap().contains("solve"), "{refused:#}");
    let put = reader.request(Method::PUT, "/v1/models/x").json(&serde_json::json!({})).send().await.unwrap();
    problem(put, 403, "forbidden").await;
    for caller in [&mine, &reader] {
        problem(caller.get("/metrics").await, 403, "forbidden").await;
        assert_eq!(caller.get("/v1/jobs").await.status(), 200);
    }
    assert_eq!(root.get("/metrics").await.status(), 200);
    assert_eq!(root.post(toy::JOB).send().await.unwrap().status(), 200);
    server.stop().await;
}
