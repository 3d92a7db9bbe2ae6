//! Milling in three directions over HTTP: answers, tables, pictures, refusals.

use precut::registry::Registry;
use serde_json::{Value, json};

use crate::support::{Server, problem};

const ROOM: &str = "/v1/milling-stability";

fn example(id: &str) -> Value {
    let registry = Registry::standard().unwrap();
    let meta = registry.entry("milling-stability").unwrap().meta();
    serde_json::from_str(meta.examples.iter().find(|example| example.id == id).unwrap().job).unwrap()
}

#[tokio::test]
async fn an_island_is_answered_in_words_rows_and_a_picture() {
    let server = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    let job = example("island").to_string();
    for (language, said) in [
        ("en", "Between 6.87 mm and 17.8 mm this cutter chatters at this speed"),
        ("ru", "эта фреза при этой частоте вращения колеблется"),
    ] {
        let response = server.post_to(ROOM, job.clone()).header("accept-language", language).send().await.unwrap();
        assert_eq!(response.status(), 200);
        let answer: Value = response.json().await.unwrap();
        let text = answer["explanation"].to_string();
        assert!(text.contains(said), "{text}");
        assert_eq!(answer["result"]["verdict"]["state"], "chatter");
        assert_eq!(answer["result"]["unstable_intervals"].as_array().unwrap().len(), 2);
    }
    let request = server.post_to(&format!("{ROOM}?table=intervals"), job.clone()).header("accept", "text/csv");
    let table = request.send().await.unwrap().text().await.unwrap();
    assert!(table.starts_with("from [mm],to [mm],kind,from_low [mm]") && table.lines().count() == 3, "{table}");
    let request = server.post_to(&format!("{ROOM}?figure=depth_line"), job).header("accept", "image/svg+xml");
    let picture = request.send().await.unwrap().text().await.unwrap();
    assert!(picture.starts_with("<svg") && picture.contains("unstable depths"), "{picture}");
}

#[tokio::test]
async fn a_slow_cut_is_refused_in_words_that_help() {
    let server = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    let mut job = example("island");
    job["cut"]["spindle_speed_rpm"] = json!(0.1);
    job["analyses"] = json!(["proposals"]);
    for (language, said) in [("en", "ask from 9 rev/min on"), ("ru", "задайте не меньше 9 об/мин")]
    {
        let request = server.post_to(ROOM, job.to_string()).header("accept-language", language);
        let document = problem(request.send().await.unwrap(), 422, "invalid_job").await;
        let error = &document["errors"][0];
        assert_eq!((&error["code"], &error["pointer"]), (&json!("too_expensive"), &json!("/cut/spindle_speed_rpm")));
        assert!(error["detail"].as_str().unwrap().contains(said), "{error}");
    }
    // What it advises is answered.
    job["analyses"] = json!(["verdict", "intervals", "motion"]);
    assert_eq!(server.post_to(ROOM, job.to_string()).send().await.unwrap().status(), 200);
    job["analyses"] = json!(["verdict"]);
    job["cut"]["spindle_speed_rpm"] = json!(30);
    let response = server.post_to(ROOM, job.to_string()).header("prefer", "wait=60").send().await.unwrap();
    assert!(response.status().is_success(), "{}", response.status());
}
