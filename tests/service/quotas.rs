//! What one owner may take of the service: work in an hour, and what is kept for him.

use precut::config::{ApiKey, Config};
use precut::http::auth;
use precut::registry::Registry;
use reqwest::{RequestBuilder, Response};
use serde_json::{Value, json};

use crate::jobs::lasting;
use crate::support::{Server, header, problem, toy};

const ONE: &str = "the secret key of one owner";
const OTHER: &str = "the secret key of the other";

fn with_keys(config: &mut Config) {
    let key = |name: &str, key: &str| ApiKey {
        name: name.to_owned(),
        hash: auth::hash(key).to_string(),
        ..ApiKey::default()
    };
    config.auth.keys = vec![key("one", ONE), key("other", OTHER)];
}

async fn with_work(work_s_per_hour: f64) -> Server {
    Server::start_with(|config| {
        with_keys(config);
        config.quota.work_s_per_hour = work_s_per_hour;
    })
    .await
}

fn ask(server: &Server, key: &str, job: String) -> RequestBuilder {
    server.post(job).bearer_auth(key)
}

async fn behind(server: &Server, key: &str, job: String) -> Response {
    ask(server, key, job).header("prefer", "respond-async").send().await.unwrap()
}

/// Estimated at so many seconds, and done at once.
fn estimated(length_mm: u32, seconds: u32) -> String {
    json!({"length_mm": length_mm, "load_n": 1, "work_ms": 1000 * seconds}).to_string()
}

/// What is left of a quota, by the header of an answer, and after how many seconds there is more.
fn left(response: &Response, quota: &str) -> (f64, Option<u64>) {
    let told =
        header(response, "ratelimit").split(", ").find(|told| told.starts_with(&format!("\"{quota}\";"))).unwrap();
    let parameter = |name: &str| told.split(';').find_map(|part| part.strip_prefix(&format!("{name}=")));
    (parameter("r").unwrap().parse().unwrap(), parameter("t").map(|seconds| seconds.parse().unwrap()))
}

async fn until_over(server: &Server, key: &str, address: &str) -> Value {
    loop {
        let job: Value = server.get(address).bearer_auth(key).send().await.unwrap().json().await.unwrap();
        if matches!(job["state"].as_str(), Some("succeeded" | "failed" | "cancelled")) {
            return job;
        }
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
}

#[tokio::test]
async fn an_owner_gets_so_much_work_in_an_hour_and_is_told_what_is_left() {
    let server = with_work(100.0).await;
    let held = toy::hold(2101);
    let first = behind(&server, ONE, estimated(2101, 60)).await;
    assert_eq!(first.status(), 202);
    assert_eq!(header(&first, "ratelimit-policy"), "\"work\";q=100;qu=\"compute-seconds\";w=3600");
    assert_eq!(left(&first, "work").0, 39.0, "rounded down");
    let address = header(&first, "location").to_owned();
    let refused = behind(&server, ONE, estimated(2102, 60)).await;
    // It is told when it is worth coming again, in both fields the same.
    let wait_s: u64 = header(&refused, "retry-after").parse().unwrap();
    assert_eq!((left(&refused, "work"), wait_s), ((39.0, Some(3600)), 3600));
    let refused = problem(refused, 429, "work_quota").await;
    for number in ["60 s", "100 s", "40 s"] {
        assert!(refused["detail"].as_str().unwrap().contains(number), "{refused:#}");
    }
    // What fits is taken, others have a quota of their own, and what more than an hour has is never.
    assert_eq!(behind(&server, ONE, estimated(2103, 20)).await.status(), 202);
    assert_eq!(behind(&server, OTHER, estimated(2104, 60)).await.status(), 202);
    let too_much = problem(behind(&server, ONE, estimated(2105, 101)).await, 422, "too_expensive").await;
    assert_eq!(too_much["errors"][0]["limit"], 100_000.0);
    // As the explanation says: a job that is cancelled gives back what it has not used.
    server.client.delete(server.url(&address)).bearer_auth(ONE).send().await.unwrap();
    until_over(&server, ONE, &address).await;
    assert_eq!(behind(&server, ONE, estimated(2106, 60)).await.status(), 202);
    drop(held);
    server.stop().await;
}

#[tokio::test]
async fn direct_answers_count_and_kept_ones_do_not() {
    let server = with_work(1.0).await;
    let direct = |length: u32| json!({"length_mm": length, "load_n": 1, "work_ms": 400}).to_string();
    for length in [2111, 2112] {
        let answer = ask(&server, ONE, direct(length)).send().await.unwrap();
        assert_eq!((answer.status().as_u16(), header(&answer, "precut-cache")), (200, "miss"));
    }
    let refused = ask(&server, ONE, direct(2113)).send().await.unwrap();
    let (left_s, more_in_s) = left(&refused, "work");
    assert_eq!(left_s, 0.0);
    // The work of a minute leaves the hour together.
    assert!((3600..=3660).contains(&more_in_s.unwrap()), "{more_in_s:?}");
    problem(refused, 429, "work_quota").await;
    for _ in 0..5 {
        let again = ask(&server, ONE, direct(2111)).send().await.unwrap();
        assert_eq!((again.status().as_u16(), header(&again, "precut-cache")), (200, "hit"));
    }
    assert_eq!(ask(&server, OTHER, direct(2113)).send().await.unwrap().status(), 200);
    server.stop().await;
}

#[tokio::test]
async fn what_is_kept_for_an_owner_has_a_bound() {
    let server = Server::start_with(|config| {
        with_keys(config);
        config.quota.kept_bytes = 10_000;
    })
    .await;
    let large = |length: u32| json!({"length_mm": length, "load_n": 1, "stations": 3000}).to_string();
    let named = |key: &'static str, length: u32, name: &str| {
        let request = ask(&server, key, large(length)).header("idempotency-key", name.to_owned());
        request.header("prefer", "wait=60").send()
    };
    let first = named(ONE, 2121, "first").await.unwrap();
    assert_eq!(first.status(), 200);
    assert_eq!(header(&first, "ratelimit-policy"), "\"kept\";q=10000;qu=\"kept-bytes\"");
    assert_eq!(left(&first, "kept").0, 0.0);
    let refused = named(ONE, 2122, "second").await.unwrap();
    let wait_s: u64 = header(&refused, "retry-after").parse().unwrap();
    assert!((29 * 86_400..=30 * 86_400).contains(&wait_s), "as long as jobs are kept: {wait_s} s");
    assert_eq!(left(&refused, "kept"), (0.0, Some(wait_s)));
    let refused = problem(refused, 429, "kept_quota").await;
    assert!(refused["detail"].as_str().unwrap().contains("0.01 MB is the most"), "{refused:#}");
    // The request that made the job still finds it; and what the explanation advises is possible.
    assert_eq!(named(ONE, 2121, "first").await.unwrap().status(), 200);
    assert_eq!(ask(&server, ONE, large(2123)).send().await.unwrap().status(), 200);
    assert_eq!(named(OTHER, 2122, "second").await.unwrap().status(), 200);
    server.stop().await;
}

/// A shaft of 200 sections, whose answer has 10 MB, and several megabytes compressed.
fn with_a_large_answer(passive_n: u32) -> String {
    let segment = |index: u32| json!({"length_mm": 7.5, "diameter_mm": 60 - index % 2, "stock_diameter_mm": 62});
    let segments: Vec<Value> = (0..200).map(segment).collect();
    json!({
        "shaft": {"material": "steel_45", "segments": segments},
        "supports": [{"kind": "centre", "z_mm": 0}, {"kind": "centre", "z_mm": 1500}],
        "force": {"kind": "constant", "passive_n": passive_n},
        "cut": {"feed_mm_per_rev": 0.3, "spindle_speed_rpm": 500},
    })
    .to_string()
}

#[tokio::test]
async fn jobs_that_were_taken_before_the_quota_was_full_are_not_begun_after_that() {
    let server = Server::start_of(Registry::standard().unwrap(), |config| {
        (config.jobs.slots, config.jobs.short_ms) = (1, 0.0);
        config.quota.kept_bytes = 2_000_000;
    })
    .await;
    let mut addresses = Vec::new();
    for passive_n in 201..207 {
        let request = server.post_to("/v1/deflection-compensation", with_a_large_answer(passive_n));
        let response = request.header("prefer", "respond-async").send().await.unwrap();
        if response.status() == 429 {
            problem(response, 429, "kept_quota").await;
            continue;
        }
        assert_eq!(response.status(), 202);
        addresses.push(header(&response, "location").to_owned());
    }
    let (mut kept, mut refused) = (0, 0);
    for address in &addresses {
        let job = until_over(&server, "", address).await;
        if job["state"] == "succeeded" {
            kept += 1;
        } else {
            assert_eq!((&job["problem"]["code"], &job["attempt"]), (&json!("kept_quota"), &json!(0)), "{job:#}");
            problem(server.get(&format!("{address}/result")).send().await.unwrap(), 429, "kept_quota").await;
            refused += 1;
        }
    }
    assert!(kept == 1 && refused >= 1, "{kept} kept, {refused} refused");
    // A short one is answered all the same.
    let short = json!({
        "shaft": {"segments": [{"length_mm": 500, "diameter_mm": 60, "stock_diameter_mm": 62}], "material": "steel_45"},
        "supports": [{"kind": "centre", "z_mm": 0}, {"kind": "centre", "z_mm": 500}],
        "force": {"kind": "constant", "passive_n": 200},
        "cut": {"feed_mm_per_rev": 0.3, "spindle_speed_rpm": 500},
    });
    let answer = server.post_to("/v1/deflection-compensation", short.to_string()).send().await.unwrap();
    assert_eq!(answer.status(), 200);
    assert!(left(&answer, "kept").0 < 1.0, "{}", header(&answer, "ratelimit"));
    server.stop().await;
}

#[tokio::test]
async fn without_quotas_nothing_is_said_of_them() {
    let server = Server::start().await;
    let answer = server.post(lasting(2131, 1)).send().await.unwrap();
    assert_eq!((header(&answer, "ratelimit"), header(&answer, "ratelimit-policy")), ("", ""));
}

#[tokio::test]
async fn stored_models_count_for_what_is_kept() {
    let server = Server::start_of(Registry::standard().unwrap(), |config| {
        with_keys(config);
        config.quota.kept_bytes = 1000;
    })
    .await;
    let model = json!({
        "calculator": "deflection-compensation",
        "effects": [{"kind": "headstock_compliance", "delta_um_per_n": 0.022}],
        "provenance": {"note": "x".repeat(300)},
    });
    let put = |key: &'static str, name: &str| {
        let request = server.client.put(server.url(&format!("/v1/models/{name}"))).bearer_auth(key);
        request.header("content-type", "application/json").body(model.to_string()).send()
    };
    assert_eq!(put(ONE, "winter").await.unwrap().status(), 201);
    assert_eq!(put(ONE, "winter").await.unwrap().status(), 200, "a second revision fits");
    let refused = put(ONE, "summer").await.unwrap();
    let wait_s: u64 = header(&refused, "retry-after").parse().unwrap();
    assert!(wait_s >= 29 * 86_400, "nothing goes by itself: {wait_s} s");
    let refused = problem(refused, 429, "kept_quota").await;
    assert!(refused["detail"].as_str().unwrap().contains("models"), "{refused:#}");
    // What is left is told with answers, and another owner has his own.
    let short = json!({
        "shaft": {"segments": [{"length_mm": 500, "diameter_mm": 60, "stock_diameter_mm": 62}], "material": "steel_45"},
        "supports": [{"kind": "centre", "z_mm": 0}, {"kind": "centre", "z_mm": 500}],
        "force": {"kind": "constant", "passive_n": 200},
        "cut": {"feed_mm_per_rev": 0.3, "spindle_speed_rpm": 500},
    });
    let ask = async |key: &str| {
        let request = server.post_to("/v1/deflection-compensation", short.to_string()).bearer_auth(key);
        request.send().await.unwrap()
    };
    let left_of_one = left(&ask(ONE).await, "kept").0;
    assert!((1.0..450.0).contains(&left_of_one), "{left_of_one}");
    assert_eq!(left(&ask(OTHER).await, "kept").0, 1000.0);
    assert_eq!(put(OTHER, "summer").await.unwrap().status(), 201);
    // Whoever deletes one has room again.
    let delete = server.client.delete(server.url("/v1/models/winter")).bearer_auth(ONE);
    assert_eq!(delete.send().await.unwrap().status(), 204);
    assert_eq!(left(&ask(ONE).await, "kept").0, 1000.0);
    assert_eq!(put(ONE, "summer").await.unwrap().status(), 201);
    server.stop().await;
}
