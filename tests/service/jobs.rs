//! Jobs over HTTP: accepted, watched, cancelled, answered.

use std::time::{Duration, Instant};

use precut::config::ApiKey;
use precut::http::auth;
use precut::registry::Registry;
use reqwest::{RequestBuilder, Response};
use serde_json::{Value, json};

use crate::support::{Server, header, problem, toy};

/// A job that is computed for so long, another one for each length.
pub fn lasting(length_mm: u32, duration_ms: u32) -> String {
    json!({"length_mm": length_mm, "load_n": 1, "duration_ms": duration_ms}).to_string()
}

/// Long enough to become a job by itself.
fn slow(length_mm: u32) -> String {
    lasting(length_mm, 600)
}

/// The job's document, now.
pub async fn job(server: &Server, address: &str) -> Value {
    let response = server.get(address).send().await.unwrap();
    assert_eq!(response.status(), 200);
    response.json().await.unwrap()
}

/// Waits until a job is in one of these states.
pub async fn until(server: &Server, address: &str, states: &[&str]) -> Value {
    let start = Instant::now();
    loop {
        let job = job(server, address).await;
        if states.contains(&job["state"].as_str().unwrap()) {
            return job;
        }
        assert!(start.elapsed() < Duration::from_mins(1), "{job:#}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// Sends a job that shall be done behind; its address.
pub async fn sent(server: &Server, body: String) -> String {
    let response = server.post(body).header("prefer", "respond-async").send().await.unwrap();
    assert_eq!(response.status(), 202);
    header(&response, "location").to_owned()
}

#[tokio::test]
async fn a_long_job_is_accepted_computed_and_read() {
    let server = Server::start().await;
    let held = toy::hold(1100);
    let response = server.post(slow(1100)).send().await.unwrap();
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
    // What it computes is there before its result, and the same as the result's own.
    let asked: Value = server.get(&format!("{address}/job")).send().await.unwrap().json().await.unwrap();
    assert_eq!(asked["calculator"], toy::BAR);
    drop(held);
    let done = until(&server, &address, &["succeeded"]).await;
    assert_eq!(done["progress"], 1.0);
    assert!(done["expires_at"].is_string() && done["problem"].is_null());
    let result: Response = server.get(&format!("{address}/result")).send().await.unwrap();
    assert_eq!(result.status(), 200);
    let place = header(&result, "content-location").to_owned();
    let result = result.bytes().await.unwrap();
    assert_eq!(place, format!("/v1/results/{}", done["key"].as_str().unwrap()));
    // The same bytes as the direct answer, and as the kept result.
    let again = server.post(slow(1100)).send().await.unwrap();
    assert_eq!((again.status().as_u16(), header(&again, "precut-cache")), (200, "hit"));
    assert_eq!(again.bytes().await.unwrap(), result);
    assert_eq!(server.get(&place).send().await.unwrap().bytes().await.unwrap(), result);
    let made: Value = server.get(&format!("{place}/job")).send().await.unwrap().json().await.unwrap();
    assert_eq!(made, asked);
}

#[tokio::test]
async fn a_preference_makes_a_job_of_anything_that_is_not_there_already() {
    let server = Server::start().await;
    let ask = || server.post(toy::JOB).header("prefer", "respond-async").send();
    let response = ask().await.unwrap();
    assert_eq!((response.status().as_u16(), header(&response, "preference-applied")), (202, "respond-async"));
    let address = header(&response, "location").to_owned();
    until(&server, &address, &["succeeded"]).await;
    let response = ask().await.unwrap();
    assert_eq!((response.status().as_u16(), header(&response, "precut-cache")), (200, "hit"));
    assert_eq!(header(&response, "preference-applied"), "");
}

#[tokio::test]
async fn a_client_may_wait_for_a_job() {
    let server = Server::start().await;
    let ask = |body: String, wait: &str| server.post(body).header("prefer", wait.to_owned()).send();
    let response = ask(slow(200), "wait=20").await.unwrap();
    assert_eq!((response.status().as_u16(), header(&response, "preference-applied")), (200, "wait=20"));
    assert_eq!(header(&response, "precut-cache"), "miss");
    assert!(response.json::<Value>().await.unwrap()["result"]["max_sag_um"].is_number());
    // A failed job is told at once, with the status of its problem.
    let body = json!({"length_mm": 202, "load_n": 1, "behaviour": "infeasible"}).to_string();
    problem(ask(body, "wait=20").await.unwrap(), 422, "bar_would_break").await;
    let response = ask(lasting(201, 60_000), "wait=1").await.unwrap();
    assert_eq!((response.status().as_u16(), header(&response, "preference-applied")), (202, "wait=1"));
}

#[tokio::test]
async fn a_cancel_stops_the_work_and_is_final() {
    let server = Server::start_with(|config| config.jobs.slots = 1).await;
    let cancel = |address: &str| server.client.delete(server.url(address)).send();
    let running = sent(&server, lasting(300, 60_000)).await;
    let waiting = sent(&server, lasting(301, 60_000)).await;
    until(&server, &running, &["running"]).await;
    // There is one place: the other one waits.
    let response = cancel(&waiting).await.unwrap();
    assert_eq!(response.status(), 200);
    assert_eq!(response.json::<Value>().await.unwrap()["state"], "cancelled");
    let response = cancel(&running).await.unwrap();
    assert_eq!(response.status(), 202);
    let cancelled: Value = response.json().await.unwrap();
    assert_eq!((cancelled["state"].as_str(), cancelled["stage"].as_str()), (Some("cancelled"), None));
    // The core is free for the next long before the minute is over.
    let next = sent(&server, lasting(302, 1)).await;
    let done = until(&server, &next, &["succeeded"]).await;
    for address in [&running, &waiting] {
        problem(server.get(&format!("{address}/result")).send().await.unwrap(), 409, "job_cancelled").await;
        let again = cancel(address).await.unwrap();
        assert_eq!(again.status(), 200);
        assert_eq!(again.json::<Value>().await.unwrap()["state"], "cancelled");
    }
    // What is over cannot be cancelled any more.
    let late = cancel(&next).await.unwrap();
    assert_eq!(late.status(), 200);
    assert_eq!(late.json::<Value>().await.unwrap(), done);
}

#[tokio::test]
async fn equal_jobs_share_one_computation_until_the_last_is_cancelled() {
    let server = Server::start().await;
    let held = toy::hold(1400);
    let mut addresses = Vec::new();
    for _ in 0..4 {
        addresses.push(sent(&server, lasting(1400, 1)).await);
    }
    let mut distinct = addresses.clone();
    distinct.sort();
    distinct.dedup();
    assert_eq!(distinct.len(), 4, "each has a name of its own");
    for address in &addresses {
        until(&server, address, &["running"]).await;
    }
    // One that comes while the others are computed joins them.
    addresses.push(sent(&server, lasting(1400, 1)).await);
    assert_eq!(job(&server, &addresses[4]).await["state"], "running");
    server.client.delete(server.url(&addresses[0])).send().await.unwrap();
    drop(held);
    let mut ends = Vec::new();
    for address in &addresses[1..] {
        let done = until(&server, address, &["succeeded"]).await;
        assert_eq!(done["attempt"], 1);
        ends.push((done["started_at"].clone(), done["finished_at"].clone(), done["key"].clone()));
    }
    ends.dedup();
    assert_eq!(ends.len(), 1, "one computation: {ends:?}");
    assert_eq!(job(&server, &addresses[0]).await["state"], "cancelled");
    // All cancelled: the core is free again.
    let both = [sent(&server, lasting(401, 60_000)).await, sent(&server, lasting(401, 60_000)).await];
    for address in &both {
        until(&server, address, &["running"]).await;
    }
    for address in &both {
        server.client.delete(server.url(address)).send().await.unwrap();
    }
    let next = sent(&server, lasting(402, 1)).await;
    until(&server, &next, &["succeeded"]).await;
}

#[tokio::test]
async fn a_request_by_name_is_one_job_however_often_it_is_sent() {
    // A short one waits for its job as long as it may wait for a core.
    let server = Server::start_with(|config| config.limits.queue_ms = 60_000).await;
    let held = toy::hold(1510);
    let ask = |body: String, key: &str| server.post(body).header("idempotency-key", key.to_owned()).send();
    let first = ask(slow(1510), "a").await.unwrap();
    assert_eq!(first.status(), 202);
    let address = header(&first, "location").to_owned();
    let second = ask(slow(1510), "a").await.unwrap();
    assert_eq!((second.status().as_u16(), header(&second, "location")), (202, address.as_str()));
    let other = problem(ask(slow(1511), "a").await.unwrap(), 422, "idempotency_key_reused").await;
    assert!(other["detail"].as_str().unwrap().contains(address.rsplit('/').next().unwrap()));
    assert_ne!(header(&ask(slow(1510), "b").await.unwrap(), "location"), address, "another name, another job");
    drop(held);
    until(&server, &address, &["succeeded"]).await;
    let third = ask(slow(1510), "a").await.unwrap();
    assert_eq!(third.status(), 200);
    let jobs: Value = server.get("/v1/jobs").send().await.unwrap().json().await.unwrap();
    assert_eq!(jobs["items"].as_array().unwrap().len(), 2);
    // A short one is answered, and is on record all the same.
    let short = ask(toy::JOB.to_owned(), "c").await.unwrap();
    assert_eq!((short.status().as_u16(), header(&short, "precut-cache")), (200, "miss"));
    let again = ask(toy::JOB.to_owned(), "c").await.unwrap();
    assert_eq!((again.status().as_u16(), header(&again, "precut-cache")), (200, "hit"));
    let jobs: Value = server.get("/v1/jobs?state=succeeded").send().await.unwrap().json().await.unwrap();
    assert!(jobs["items"].as_array().unwrap().len() >= 2);
    for bad in ["a b", ""] {
        problem(ask(slow(1510), bad).await.unwrap(), 400, "bad_idempotency_key").await;
    }
}

#[tokio::test]
async fn a_full_queue_and_a_job_beyond_the_limit_are_refused() {
    let server = Server::start_with(|config| {
        config.jobs.slots = 1;
        config.jobs.queue = 2;
        config.limits.job_ms = 100_000.0;
    })
    .await;
    let running = sent(&server, lasting(600, 60_000)).await;
    until(&server, &running, &["running"]).await;
    let ask = |body: String| server.post(body).header("prefer", "respond-async").send();
    for length in [601, 602] {
        assert_eq!(ask(lasting(length, 60_000)).await.unwrap().status(), 202);
    }
    let refused = ask(lasting(603, 60_000)).await.unwrap();
    assert!(header(&refused, "retry-after").parse::<u32>().unwrap() >= 1);
    problem(refused, 503, "queue_full").await;
    // What is being computed takes further ones along without a place in the queue.
    assert_eq!(ask(lasting(600, 60_000)).await.unwrap().status(), 202);
    let body = json!({"length_mm": 604, "load_n": 1, "work_ms": 200_000}).to_string();
    let refused = problem(ask(body).await.unwrap(), 422, "too_expensive").await;
    assert_eq!(refused["errors"][0]["pointer"], "/stations");
    assert_eq!(refused["errors"][0]["limit"], 100_000.0);
    // Direct answers go on.
    assert_eq!(server.post(toy::JOB).send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn what_is_not_done_before_its_deadline_fails() {
    let server = Server::start().await;
    let ask = |path: &str, body: String| server.post_to(&format!("/v1/{}{path}", toy::BAR), body).send();
    let first = ask("?deadline_s=0.3", lasting(700, 60_000)).await.unwrap();
    assert_eq!(first.status(), 202);
    let running = header(&first, "location").to_owned();
    let second = ask("?deadline_s=0.4&priority=low", lasting(701, 60_000)).await.unwrap();
    let waiting = header(&second, "location").to_owned();
    for address in [&running, &waiting] {
        let failed = until(&server, address, &["failed"]).await;
        assert!(failed["deadline_at"].is_string());
        assert_eq!(failed["problem"]["code"], "deadline_exceeded");
        problem(server.get(&format!("{address}/result")).send().await.unwrap(), 422, "deadline_exceeded").await;
    }
    let next = sent(&server, lasting(702, 1)).await;
    until(&server, &next, &["succeeded"]).await;
    // A direct answer has no more time either.
    let _held = toy::hold(1703);
    let body = json!({"length_mm": 1703, "load_n": 1, "work_ms": 100}).to_string();
    problem(ask("?deadline_s=0.05", body).await.unwrap(), 422, "deadline_exceeded").await;
    for bad in ["?deadline_s=0", "?deadline_s=-1", "?deadline_s=1e99", "?deadline_s=soon", "?priority=urgent"] {
        problem(ask(bad, toy::JOB.to_owned()).await.unwrap(), 400, "bad_query").await;
    }
}

#[tokio::test]
async fn jobs_are_listed_newest_first_by_pages_and_filtered() {
    let server = Server::start().await;
    let mut addresses = Vec::new();
    for length in 800..805 {
        addresses.push(sent(&server, lasting(length, 1)).await);
    }
    for address in &addresses {
        until(&server, address, &["succeeded"]).await;
    }
    let held = sent(&server, lasting(805, 60_000)).await;
    until(&server, &held, &["running"]).await;
    let list = async |path: &str| -> Value { server.get(path).send().await.unwrap().json().await.unwrap() };
    let whole = list("/v1/jobs").await;
    let ids = |list: &Value| -> Vec<String> {
        list["items"].as_array().unwrap().iter().map(|job| job["links"]["self"].as_str().unwrap().to_owned()).collect()
    };
    let expected: Vec<String> = addresses.iter().chain([&held]).rev().cloned().collect();
    assert_eq!((ids(&whole), &whole["next"]), (expected.clone(), &Value::Null));
    let mut paged = Vec::new();
    let mut next = "/v1/jobs?limit=4".to_owned();
    loop {
        let page = list(&next).await;
        paged.extend(ids(&page));
        let Some(more) = page["next"].as_str() else { break };
        more.clone_into(&mut next);
    }
    assert_eq!(paged, expected);
    assert_eq!(ids(&list("/v1/jobs?state=running").await), [held]);
    assert_eq!(ids(&list("/v1/jobs?state=succeeded&calculator=sagging-bar&limit=2").await), expected[1..3]);
    assert_eq!(ids(&list("/v1/jobs?state=failed").await), [""; 0]);
    for bad in ["limit=0", "limit=501", "state=done", "after=x", "after=", "colour=red"] {
        problem(server.get(&format!("/v1/jobs?{bad}")).send().await.unwrap(), 400, "bad_query").await;
    }
    problem(server.get("/v1/jobs?calculator=none").send().await.unwrap(), 404, "unknown_calculator").await;
}

#[tokio::test]
async fn an_unknown_job_is_404_whatever_is_asked_of_it() {
    let server = Server::start().await;
    for id in ["0198c5f1-8a3e-7c40-b0a1-5e2d9f4c6b7a", "17", "%20"] {
        for request in [
            server.get(&format!("/v1/jobs/{id}")),
            server.get(&format!("/v1/jobs/{id}/result")),
            server.get(&format!("/v1/jobs/{id}/job")),
            server.get(&format!("/v1/jobs/{id}/events")),
            server.client.delete(server.url(&format!("/v1/jobs/{id}"))),
        ] {
            problem(request.send().await.unwrap(), 404, "unknown_job").await;
        }
    }
    problem(server.client.delete(server.url("/v1/jobs")).send().await.unwrap(), 405, "method_not_allowed").await;
}

/// When each of these jobs was finished, as text that sorts by time.
async fn ends(server: &Server, addresses: &[String]) -> Vec<String> {
    let mut ends = Vec::new();
    for address in addresses {
        ends.push(until(server, address, &["succeeded"]).await["finished_at"].as_str().unwrap().to_owned());
    }
    ends
}

#[tokio::test]
async fn jobs_of_higher_priority_go_first() {
    let server = Server::start_with(|config| (config.jobs.slots, config.jobs.short_ms) = (1, 0.0)).await;
    let held = toy::hold(1900);
    let first = sent(&server, lasting(1900, 1)).await;
    until(&server, &first, &["running"]).await;
    let mut addresses = Vec::new();
    for (priority, length) in [("low", 901), ("normal", 902), ("high", 903)] {
        let path = format!("/v1/{}?priority={priority}", toy::BAR);
        let response =
            server.post_to(&path, lasting(length, 30)).header("prefer", "respond-async").send().await.unwrap();
        assert_eq!(response.status(), 202);
        addresses.push(header(&response, "location").to_owned());
        assert_eq!(response.json::<Value>().await.unwrap()["priority"], priority);
    }
    drop(held);
    let ends = ends(&server, &addresses).await;
    assert!(ends[2] < ends[1] && ends[1] < ends[0], "{ends:?}");
}

#[tokio::test]
async fn clients_take_turns() {
    let keys = ["one client's key, 0123456789", "another client's key, 98765432"];
    let server = Server::start_with(|config| {
        (config.jobs.slots, config.jobs.short_ms) = (1, 0.0);
        config.auth.keys = keys
            .map(|key| ApiKey { name: key[..3].to_owned(), hash: auth::hash(key).to_string(), ..ApiKey::default() })
            .to_vec();
    })
    .await;
    let client = |who: usize, request: RequestBuilder| request.bearer_auth(keys[who]);
    let send = async |who: usize, body: String| -> String {
        let response = client(who, server.post(body)).header("prefer", "respond-async").send().await.unwrap();
        assert_eq!(response.status(), 202);
        header(&response, "location").to_owned()
    };
    // While it is being computed the others come.
    let held = toy::hold(1910);
    let mut first = Vec::new();
    for length in 1910..1915 {
        first.push(send(0, lasting(length, 20)).await);
    }
    let second = send(1, lasting(1920, 20)).await;
    drop(held);
    let mut ends = Vec::new();
    let of_all = first.iter().map(|address| (0, address)).chain([(1, &second)]);
    for (who, address) in of_all {
        let start = Instant::now();
        ends.push(loop {
            let job: Value = client(who, server.get(address)).send().await.unwrap().json().await.unwrap();
            if job["state"] == "succeeded" {
                break job["finished_at"].as_str().unwrap().to_owned();
            }
            assert!(start.elapsed() < Duration::from_mins(1), "{job:#}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        });
    }
    // The one that came last waits for the first client's running job and one more at most.
    assert!(ends[5] < ends[3], "{ends:?}");
}

#[tokio::test]
async fn a_job_without_a_result_says_why() {
    let server = Server::start().await;
    for (behaviour, status, code) in [("panic", 500, "crashed"), ("infeasible", 422, "bar_would_break")] {
        let body = json!({"length_mm": 950, "load_n": 2, "behaviour": behaviour, "duration_ms": 1}).to_string();
        let address = sent(&server, body).await;
        let failed = until(&server, &address, &["failed"]).await;
        assert_eq!((failed["problem"]["code"].as_str(), failed["attempt"].as_u64()), (Some(code), Some(1)));
        assert_eq!(failed["problem"]["status"], status);
        let document = problem(server.get(&format!("{address}/result")).send().await.unwrap(), status, code).await;
        for part in ["title", "detail", "errors"] {
            assert_eq!(document[part], failed["problem"][part]);
        }
    }
}

/// A schedule whose limits conflict, asked directly and as a job: the same refusal, with the numbers of the conflict.
#[tokio::test]
async fn limits_that_conflict_are_told_of_a_job_as_they_are_directly() {
    let server = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    let entry = Registry::standard().unwrap().entry("feed-schedule").unwrap().clone();
    let mut ask: Value = serde_json::from_str(entry.meta().examples[0].job).unwrap();
    for zone in ask["zones"].as_array_mut().unwrap() {
        zone["roughness_max_um"] = json!(0.05);
    }
    let post = || server.post_to("/v1/feed-schedule", ask.to_string());
    let accepted = post().header("prefer", "respond-async").send().await.unwrap();
    assert_eq!(accepted.status(), 202);
    let address = header(&accepted, "location").to_owned();
    until(&server, &address, &["failed"]).await;
    let result = server.get(&format!("{address}/result")).send().await.unwrap();
    let of_job = problem(result, 422, "infeasible_schedule").await;
    let direct = problem(post().send().await.unwrap(), 422, "infeasible_schedule").await;
    assert!(direct["infeasible"]["elastic_total"].as_f64().unwrap() > 0.0);
    for part in ["title", "detail", "errors", "infeasible"] {
        assert_eq!(of_job[part], direct[part], "{part}");
    }
}

#[tokio::test]
async fn a_result_has_every_form_that_the_direct_answer_has() {
    let server = Server::start().await;
    let address = sent(&server, toy::JOB.to_owned()).await;
    until(&server, &address, &["succeeded"]).await;
    let result = format!("{address}/result");
    for (accept, query, kind) in [
        ("text/csv", "?table=summary", "text/csv"),
        ("image/svg+xml", "?figure=load", "image/svg+xml"),
        ("text/x-gcode", "", "text/x-gcode"),
    ] {
        let direct = server.post_to(&format!("/v1/{}{query}", toy::BAR), toy::JOB).header("accept", accept);
        let direct = direct.send().await.unwrap().bytes().await.unwrap();
        let response = server.get(&format!("{result}{query}")).header("accept", accept).send().await.unwrap();
        assert!(header(&response, "content-type").starts_with(kind));
        let tag = header(&response, "etag").to_owned();
        assert_eq!(response.bytes().await.unwrap(), direct);
        let known = server.get(&format!("{result}{query}")).header("accept", accept).header("if-none-match", tag);
        assert_eq!(known.send().await.unwrap().status(), 304);
    }
    problem(server.get(&result).header("accept", "text/html").send().await.unwrap(), 406, "not_acceptable").await;
    problem(server.get(&format!("{result}?table=none")).send().await.unwrap(), 404, "unknown_table").await;
    problem(server.get(&format!("{result}?priority=low")).send().await.unwrap(), 400, "bad_query").await;
}

#[tokio::test]
async fn long_jobs_leave_the_short_answers_their_place() {
    let server = Server::start_with(|config| config.cpu = 1).await;
    for length in 960..964 {
        sent(&server, lasting(length, 60_000)).await;
    }
    for length in 970..980 {
        // Too long to be computed where it arrives.
        let body = json!({"length_mm": length, "load_n": 1, "work_ms": 5}).to_string();
        assert_eq!(server.post(body).send().await.unwrap().status(), 200);
    }
}

/// Estimated at a minute, and done as soon as nobody holds it.
fn estimated_long(length_mm: u32) -> String {
    json!({"length_mm": length_mm, "load_n": 1, "work_ms": 60_000}).to_string()
}

#[tokio::test]
async fn a_short_job_does_not_wait_for_long_ones_and_long_ones_are_not_kept_waiting_by_short_ones() {
    let server = Server::start_with(|config| config.jobs.slots = 1).await;
    let held = toy::hold(1930);
    let first = sent(&server, estimated_long(1930)).await;
    let second = sent(&server, estimated_long(1931)).await;
    until(&server, &first, &["running"]).await;
    for length in 1940..1945 {
        let short = sent(&server, lasting(length, 20)).await;
        until(&server, &short, &["succeeded"]).await;
    }
    assert_eq!(
        (&job(&server, &first).await["state"], &job(&server, &second).await["state"]),
        (&json!("running"), &json!("queued"))
    );
    // Only one of them at a time.
    let short_held = toy::hold(1945);
    let one = sent(&server, lasting(1945, 1)).await;
    until(&server, &one, &["running"]).await;
    let other = sent(&server, lasting(1946, 1)).await;
    assert_eq!(job(&server, &other).await["state"], "queued");
    drop(short_held);
    until(&server, &other, &["succeeded"]).await;
    // The long one that waits gets its place, although there is always a short one that waits, too.
    drop(held);
    let mut waiting = Vec::new();
    for length in 1950..2050 {
        waiting.push(sent(&server, lasting(length, 20)).await);
        if job(&server, &second).await["state"] == "succeeded" {
            break;
        }
        if waiting.len() > 3 {
            until(&server, &waiting.remove(0), &["succeeded"]).await;
        }
    }
    assert_eq!(job(&server, &second).await["state"], "succeeded");
    server.stop().await;
}

#[tokio::test]
async fn a_cancelled_or_failed_job_is_computed_when_it_is_asked_for_again_as_its_message_says() {
    let server = Server::start().await;
    let ask = |body: String, key: &str| {
        let request = server.post(body).header("idempotency-key", key.to_owned());
        request.header("prefer", "respond-async").send()
    };
    let held = toy::hold(1520);
    let first = ask(slow(1520), "a").await.unwrap();
    let address = header(&first, "location").to_owned();
    server.client.delete(server.url(&address)).send().await.unwrap();
    // Under its name it is the job that was cancelled, and says what to do.
    let again = problem(ask(slow(1520), "a").await.unwrap(), 409, "job_cancelled").await;
    assert!(again["detail"].as_str().unwrap().contains("another Idempotency-Key"), "{again:#}");
    let next = ask(slow(1520), "b").await.unwrap();
    assert_eq!(next.status(), 202);
    let next = header(&next, "location").to_owned();
    assert_ne!(next, address);
    drop(held);
    until(&server, &next, &["succeeded"]).await;
    // So it is with one that failed.
    let held = toy::hold(1521);
    let late = server.post_to("/v1/sagging-bar?deadline_s=0.001", slow(1521)).header("idempotency-key", "c");
    let late = late.header("prefer", "respond-async").send().await.unwrap();
    if late.status() == 202 {
        until(&server, header(&late, "location"), &["failed"]).await;
    }
    problem(ask(slow(1521), "c").await.unwrap(), 422, "deadline_exceeded").await;
    let next = ask(slow(1521), "d").await.unwrap();
    assert_eq!(next.status(), 202);
    drop(held);
    until(&server, header(&next, "location"), &["succeeded"]).await;
    server.stop().await;
}
