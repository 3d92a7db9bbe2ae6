//! What every answer has, and what the service says of itself.

use std::time::{Duration, Instant};

use precut::http::auth;
use serde_json::Value;

use crate::support::{Process, Server, header, problem, toy};

#[tokio::test]
async fn every_answer_carries_a_request_id() {
    let server = Server::start().await;
    let own = server.get("/health/live").header("x-request-id", "cam-17/4711").send().await.unwrap();
    assert_eq!(header(&own, "x-request-id"), "cam-17/4711");
    let mut seen = Vec::new();
    for bad in ["", "with space", "tab\there", &"x".repeat(200)] {
        let response = server.get("/nothing").header("x-request-id", bad).send().await.unwrap();
        let id = header(&response, "x-request-id").to_owned();
        assert_eq!(id.len(), 36, "a new id in place of {bad:?}: {id}");
        assert!(!seen.contains(&id));
        seen.push(id);
    }
    for path in ["/", "/docs", "/openapi.json", "/v1/results", "/metrics"] {
        let response = server.get(path).send().await.unwrap();
        assert!(!header(&response, "x-request-id").is_empty(), "{path}");
        assert_eq!(header(&response, "x-content-type-options"), "nosniff", "{path}");
        assert!(header(&response, "content-security-policy").contains("default-src 'self'"), "{path}");
    }
}

#[tokio::test]
async fn health_tells_living_from_ready() {
    let server = Server::start().await;
    let live: Value = server.get("/health/live").send().await.unwrap().json().await.unwrap();
    assert_eq!(live["status"], "live");
    let ready: Value = server.get("/health/ready").send().await.unwrap().json().await.unwrap();
    assert_eq!(ready["status"], "ready");
    server.stop().await;
}

#[tokio::test]
async fn metrics_count_requests_by_route_and_status_and_answers_by_cache() {
    let server = Server::start().await;
    let at = |text: &str, name: &str| -> f64 {
        text.lines().find_map(|line| line.strip_prefix(name)).map_or(0.0, |value| value.trim().parse().unwrap())
    };
    let read = || async { server.get("/metrics").send().await.unwrap().text().await.unwrap() };
    let names = [
        "http_requests_total{route=\"/v1/sagging-bar\",method=\"POST\",status=\"200\"}",
        "http_requests_total{route=\"/v1/sagging-bar\",method=\"POST\",status=\"422\"}",
        "http_requests_total{route=\"/v1/{calculator}\",method=\"POST\",status=\"404\"}",
        "http_requests_total{route=\"other\",method=\"GET\",status=\"404\"}",
        "precut_answers_total{calculator=\"sagging-bar\",cache=\"hit\"}",
        "precut_answers_total{calculator=\"sagging-bar\",cache=\"miss\"}",
        "http_request_duration_seconds_count{route=\"/v1/sagging-bar\"}",
    ];
    let before = read().await;
    let job = r#"{"length_mm": 777.125, "load_n": 3}"#;
    for body in [job, job, "{}"] {
        server.post(body).send().await.unwrap();
    }
    server.post_to("/v1/none-such", "{}").send().await.unwrap();
    server.get("/none/such").send().await.unwrap();
    let after = read().await;
    for name in names {
        // Other tests of this process count, too.
        assert!(at(&after, name) > at(&before, name), "{name}\n{after}");
    }
    assert!(after.contains("http_request_duration_seconds_bucket{route=\"/v1/sagging-bar\",le=\"0.01\"}"), "{after}");
    assert!(after.contains("precut_build_info{version="), "{after}");
    assert!(!after.contains("none-such"), "a client cannot make up labels");
    for line in after.lines().filter_map(|line| line.strip_prefix("# TYPE ")) {
        let name = line.split(' ').next().unwrap();
        assert!(after.contains(&format!("# HELP {name} ")), "{name} is not explained");
    }
    let mut series: Vec<_> =
        after.lines().filter(|line| !line.starts_with('#')).filter_map(|line| line.rsplit_once(' ')).collect();
    let lines = series.len();
    series.sort_unstable();
    series.dedup_by_key(|(name, _)| *name);
    assert_eq!(series.len(), lines, "a series stands there twice");
}

#[tokio::test]
async fn calculators_are_listed_and_described() {
    let server = Server::start().await;
    let list: Value = server.get("/v1/calculators").send().await.unwrap().json().await.unwrap();
    assert_eq!(list["items"][0]["id"], toy::BAR);
    assert_eq!(list["items"][0]["examples"][0]["id"], "plain");
    assert_eq!(list["next"], Value::Null);
    let path = list["items"][0]["links"]["self"].as_str().unwrap().to_owned();
    let response = server.get(&path).send().await.unwrap();
    let tag = header(&response, "etag").to_owned();
    let described: Value = response.json().await.unwrap();
    assert_eq!(described["input_schema"]["properties"]["length_mm"]["x-unit"], "mm");
    assert_eq!(described["takes_tables"], true);
    let job = described["jobs"]["plain"].to_string();
    let solve = described["links"]["solve"].as_str().unwrap();
    assert_eq!(server.post_to(solve, job).send().await.unwrap().status(), 200);
    assert_eq!(server.get(&path).header("if-none-match", tag).send().await.unwrap().status(), 304);
}

#[tokio::test]
async fn materials_are_listed_with_their_sources() {
    let server = Server::start().await;
    let list: Value = server.get("/v1/materials").send().await.unwrap().json().await.unwrap();
    let items = list["items"].as_array().unwrap();
    assert!(items.len() > 5);
    for item in items {
        let path = item["links"]["self"].as_str().unwrap();
        let material: Value = server.get(path).send().await.unwrap().json().await.unwrap();
        assert_eq!(material["id"], item["id"]);
        assert!(material["youngs_modulus_n_per_mm2"]["source"].as_str().is_some_and(|source| !source.is_empty()));
    }
}

#[tokio::test]
async fn the_landing_page_speaks_to_people_and_to_programs() {
    let server = Server::start().await;
    let landing: Value = server.get("/").send().await.unwrap().json().await.unwrap();
    for (_, path) in landing["links"].as_object().unwrap() {
        assert_eq!(server.get(path.as_str().unwrap()).send().await.unwrap().status(), 200, "{path}");
    }
    let page = server.get("/").header("accept", "text/html,*/*;q=0.8").send().await.unwrap();
    assert_eq!(header(&page, "content-type"), "text/html; charset=utf-8");
    let text = page.text().await.unwrap();
    assert!(text.contains("/main.js\"></script>") && text.contains("/docs"), "{text}");
}

#[tokio::test]
async fn every_problem_has_a_page_in_words() {
    let server = Server::start().await;
    let own = ["bar_would_break", "path_incomplete"].into_iter();
    for code in precut::http::CODES.iter().map(|(code, _)| *code).chain(own) {
        let explained: Value = server.get(&format!("/problems/{code}")).send().await.unwrap().json().await.unwrap();
        assert_eq!(explained["code"], code);
        assert!(explained["help"].as_str().unwrap().len() > 20, "{explained}");
        let page = server.get(&format!("/problems/{code}")).header("accept", "text/html").send().await.unwrap();
        assert_eq!(page.status(), 200);
        assert!(page.text().await.unwrap().contains(code));
    }
    problem(server.get("/problems/none_such").send().await.unwrap(), 404, "unknown_problem").await;
}

/// A process of its own: figures are those of a process, and other tests move them.
#[tokio::test]
async fn metrics_tell_how_long_jobs_wait_how_large_the_store_is_and_who_asks_for_how_much() {
    let folder = tempfile::tempdir().unwrap();
    let keys = ["alpha", "beta", "watch"].map(|name| {
        let scopes = if name == "watch" { ", scopes = [\"admin\"]" } else { "" };
        format!("{{ name = \"{name}\", hash = \"{}\"{scopes} }}", auth::hash(name))
    });
    let config = folder.path().join("precut.toml");
    std::fs::write(&config, format!("auth.keys = [{}]\njobs.slots = 1\n", keys.join(", "))).unwrap();
    let gate = folder.path().join("gate");
    let settings =
        [("PRECUT_CONFIG", config.to_str().unwrap()), (toy::HELD_MM, "2201"), (toy::GATE, gate.to_str().unwrap())];
    let process = Process::start_with(&folder.path().join("data"), &settings);
    let client = reqwest::Client::new();
    let url = |path: &str| format!("http://{}{path}", process.address);
    let send = async |key: &str, length: u32| {
        let job = serde_json::json!({"length_mm": length, "load_n": 1, "work_ms": 60_000});
        let request = client.post(url(&format!("/v1/{}", toy::BAR))).bearer_auth(key).json(&job);
        let response = request.header("prefer", "respond-async").send().await.unwrap();
        assert_eq!(response.status(), 202);
    };
    let figure = async |name: &str| -> Option<f64> {
        let text = client.get(url("/metrics")).bearer_auth("watch").send().await.unwrap().text().await.unwrap();
        text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' ')?.parse().ok())
    };
    let until = async |name: &str, is_so: fn(f64) -> bool| {
        let begun = Instant::now();
        while !figure(name).await.is_some_and(is_so) {
            assert!(begun.elapsed() < Duration::from_mins(1), "{name}: {:?}", figure(name).await);
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    send("alpha", 2201).await;
    send("beta", 2202).await;
    until("precut_jobs{state=\"queued\"}", |count| count == 1.0).await;
    until("precut_job_oldest_seconds", |seconds| seconds > 0.0).await;
    until("precut_store_bytes", |bytes| bytes > 10_000.0).await;
    until("precut_owner_kept_bytes{owner=\"alpha\"}", |bytes| bytes > 0.0).await;
    std::fs::write(&gate, "").unwrap();
    let waits = format!("precut_job_wait_seconds_count{{calculator=\"{}\"}}", toy::BAR);
    until(&waits, |count| count == 2.0).await;
    until("precut_job_oldest_seconds", |seconds| seconds == 0.0).await;
    for owner in ["alpha", "beta"] {
        assert_eq!(figure(&format!("precut_owner_jobs_total{{owner=\"{owner}\"}}")).await, Some(1.0));
        until(&format!("precut_owner_work_milliseconds_total{{owner=\"{owner}\"}}"), |ms| ms > 0.0).await;
    }
    for name in ["process_resident_memory_bytes", "process_open_fds"] {
        assert!(figure(name).await.unwrap() > 1.0, "{name}");
    }
    // Addresses are no labels: there may be any number of them.
    let text = client.get(url("/metrics")).bearer_auth("watch").send().await.unwrap().text().await.unwrap();
    assert!(!text.contains("127.0.0.1"), "{text}");
}
