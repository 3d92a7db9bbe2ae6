//! Who may ask, how often, and how much at once.

use std::time::{Duration, Instant};

use precut::config::ApiKey;
use precut::http::auth;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};

use crate::support::{Server, header, problem, toy};

const KEY: &str = "0123456789abcdef0123456789abcdef";

async fn guarded() -> Server {
    Server::start_with(|config| {
        config.auth.keys = vec![
            ApiKey {
                name: "mes".to_owned(),
                hash: auth::hash("another key, never sent").to_string(),
                ..ApiKey::default()
            },
            ApiKey { name: "cam".to_owned(), hash: auth::hash(KEY).to_string(), ..ApiKey::default() },
        ];
    })
    .await
}

#[tokio::test]
async fn with_keys_configured_only_their_owners_may_ask() {
    let server = guarded().await;
    for value in [None, Some("Bearer wrong"), Some("Basic 0123"), Some(KEY), Some("Bearer"), Some("Bearer ")] {
        for request in
            [server.post(toy::JOB), server.get("/v1/calculators"), server.get("/v1/nothing"), server.get("/metrics")]
        {
            let request = value.map_or(request.try_clone().unwrap(), |value| request.header("authorization", value));
            let response = request.send().await.unwrap();
            assert!(header(&response, "www-authenticate").starts_with("Bearer"));
            problem(response, 401, "unauthorized").await;
        }
    }
    for value in [format!("Bearer {KEY}"), format!("bearer {KEY}")] {
        let response = server.post(toy::JOB).header("authorization", value).send().await.unwrap();
        assert_eq!(response.status(), 200);
    }
}

#[tokio::test]
async fn health_and_documentation_need_no_key() {
    let server = guarded().await;
    for path in [
        "/",
        "/docs",
        "/docs/rapidoc-min.js",
        "/openapi.json",
        "/health/live",
        "/health/ready",
        "/problems/unauthorized",
    ] {
        assert_eq!(server.get(path).send().await.unwrap().status(), 200, "{path}");
    }
}

#[tokio::test]
async fn a_client_that_asks_too_often_is_told_when_to_come_again() {
    let server = Server::start_with(|config| {
        config.limits.requests_per_s = 0.01;
        config.limits.burst = 3.0;
    })
    .await;
    for _ in 0..3 {
        assert_eq!(server.get("/v1/calculators").send().await.unwrap().status(), 200);
    }
    let refused = server.get("/v1/calculators").send().await.unwrap();
    let wait_s: u32 = header(&refused, "retry-after").parse().unwrap();
    assert!((1..=100).contains(&wait_s), "one request in 100 s: {wait_s}");
    problem(refused, 429, "too_many_requests").await;
    assert_eq!(server.get("/health/live").send().await.unwrap().status(), 200, "probes are not counted");
}

#[tokio::test]
async fn with_too_many_requests_in_work_more_are_refused_at_once_and_health_answers() {
    let server = Server::start_with(|config| config.limits.concurrent_requests = 2).await;
    // Requests whose bodies stand in the middle are in work.
    let mut held = Vec::new();
    for _ in 0..2 {
        let mut stream = TcpStream::connect(server.address).await.unwrap();
        let head =
            "POST /v1/sagging-bar HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: 36\r\n\r\n{";
        stream.write_all(head.as_bytes()).await.unwrap();
        held.push(stream);
    }
    // As soon as both are in work: nobody waits for them.
    let refused = loop {
        let response = server.post(toy::JOB).send().await.unwrap();
        if response.status() != 200 {
            break response;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    assert!(!header(&refused, "retry-after").is_empty());
    problem(refused, 503, "overloaded").await;
    assert_eq!(server.get("/health/ready").send().await.unwrap().status(), 200);
    assert_eq!(server.get("/metrics").send().await.unwrap().status(), 200);
    drop(held);
    let start = Instant::now();
    while server.post(toy::JOB).send().await.unwrap().status() != 200 {
        assert!(start.elapsed() < Duration::from_mins(1), "the places become free again");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn a_header_that_never_ends_costs_its_connection() {
    let server = Server::start_with(|config| config.limits.header_timeout_s = 0.2).await;
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    stream.write_all(b"GET / HTTP/1.1\r\nHost:").await.unwrap();
    let mut rest = Vec::new();
    let read = tokio::time::timeout(Duration::from_mins(1), stream.read_to_end(&mut rest)).await;
    assert!(read.is_ok(), "the connection is closed");
}

#[tokio::test]
async fn connections_beyond_the_limit_wait_for_their_turn() {
    let server = Server::start_with(|config| config.limits.connections = 1).await;
    let first = TcpStream::connect(server.address).await.unwrap();
    let mut second = TcpStream::connect(server.address).await.unwrap();
    second.write_all(b"GET /health/live HTTP/1.1\r\nHost: x\r\n\r\n").await.unwrap();
    let mut answer = vec![0; 1024];
    let waiting = tokio::time::timeout(Duration::from_millis(200), second.read(&mut answer)).await;
    assert!(waiting.is_err(), "there is one place");
    drop(first);
    let count = tokio::time::timeout(Duration::from_mins(1), second.read(&mut answer)).await.unwrap().unwrap();
    assert!(answer[..count].starts_with(b"HTTP/1.1 200 "));
}

#[tokio::test]
async fn one_client_cannot_take_all_connections() {
    let server = Server::start_with(|config| {
        config.limits.connections = 4;
        config.limits.connections_per_client = 2;
    })
    .await;
    let from = async |ip: [u8; 4]| {
        let socket = TcpSocket::new_v4().unwrap();
        socket.bind((ip, 0).into()).unwrap();
        socket.connect(server.address).await.unwrap()
    };
    let is_answered = async |stream: &mut TcpStream| {
        let mut answer = [0; 13];
        // One that is closed may be so before, while or after it is written.
        let _ = stream.write_all(b"GET /health/live HTTP/1.1\r\nHost: x\r\n\r\n").await;
        let read = tokio::time::timeout(Duration::from_mins(1), stream.read_exact(&mut answer)).await;
        read.expect("an answer, or its end").is_ok() && answer.starts_with(b"HTTP/1.1 200 ")
    };
    let greedy = [127, 0, 0, 2];
    let mut held = [from(greedy).await, from(greedy).await];
    for stream in &mut held {
        assert!(is_answered(stream).await);
    }
    assert!(!is_answered(&mut from(greedy).await).await, "two are as many as one client may have");
    assert!(is_answered(&mut from([127, 0, 0, 3]).await).await, "others find a place");
    let [first, _second] = held;
    drop(first);
    let begun = Instant::now();
    while !is_answered(&mut from(greedy).await).await {
        assert!(begun.elapsed() < Duration::from_mins(1), "the place is free again");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn health_and_metrics_answer_at_their_own_address_when_all_connections_are_taken() {
    let server = Server::start_with(|config| {
        config.limits.connections = 3;
        config.admin_listen = Some(([127, 0, 0, 1], 0).into());
    })
    .await;
    let admin = server.admin.unwrap();
    let mut idle = Vec::new();
    for _ in 0..3 {
        idle.push(TcpStream::connect(server.address).await.unwrap());
    }
    let at_the_other = server.get("/health/ready").timeout(Duration::from_millis(300)).send().await;
    assert!(at_the_other.unwrap_err().is_timeout(), "there is no place");
    let ask = |path: &str| server.client.get(format!("http://{admin}{path}")).send();
    // More often than there are places: none is kept.
    for _ in 0..100 {
        assert_eq!(ask("/health/ready").await.unwrap().status(), 200);
    }
    assert_eq!(ask("/health/live").await.unwrap().status(), 200);
    assert!(ask("/metrics").await.unwrap().text().await.unwrap().contains("http_requests_in_flight"));
    for path in ["/", "/v1/calculators", "/openapi.json"] {
        problem(ask(path).await.unwrap(), 404, "not_found").await;
    }
    drop(idle);
    server.stop().await;
}

#[tokio::test]
async fn metrics_at_their_own_address_need_the_same_key() {
    let server = Server::start_with(|config| {
        config.admin_listen = Some(([127, 0, 0, 1], 0).into());
        config.auth.keys =
            vec![ApiKey { name: "cam".to_owned(), hash: auth::hash(KEY).to_string(), ..ApiKey::default() }];
    })
    .await;
    let at = |path: &str| format!("http://{}{path}", server.admin.unwrap());
    problem(server.client.get(at("/metrics")).send().await.unwrap(), 401, "unauthorized").await;
    let known = server.client.get(at("/metrics")).header("authorization", format!("Bearer {KEY}"));
    problem(known.send().await.unwrap(), 403, "forbidden").await;
    assert_eq!(server.client.get(at("/health/ready")).send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn without_configured_origins_no_web_page_may_call() {
    let server = Server::start().await;
    let response = server.post(toy::JOB).header("origin", "https://cam.example").send().await.unwrap();
    assert_eq!(header(&response, "access-control-allow-origin"), "");
    let preflight = server
        .client
        .request(reqwest::Method::OPTIONS, server.url("/v1/sagging-bar"))
        .header("origin", "https://cam.example")
        .header("access-control-request-method", "POST");
    problem(preflight.send().await.unwrap(), 405, "method_not_allowed").await;
}

#[tokio::test]
async fn configured_origins_may_call_and_read_the_headers() {
    let server = Server::start_with(|config| config.cors.origins = vec!["https://cam.example".to_owned()]).await;
    let ask = |origin: &'static str| server.post(toy::JOB).header("origin", origin).send();
    let response = ask("https://cam.example").await.unwrap();
    assert_eq!(header(&response, "access-control-allow-origin"), "https://cam.example");
    assert!(header(&response, "access-control-expose-headers").contains("content-location"));
    assert_eq!(header(&ask("https://evil.example").await.unwrap(), "access-control-allow-origin"), "");
    let preflight = server
        .client
        .request(reqwest::Method::OPTIONS, server.url("/v1/sagging-bar"))
        .header("origin", "https://cam.example")
        .header("access-control-request-method", "POST")
        .send()
        .await
        .unwrap();
    assert_eq!(preflight.status(), 200);
    assert!(header(&preflight, "access-control-allow-headers").contains("authorization"));
}

#[tokio::test]
async fn a_burst_of_small_jobs_waits_for_its_turn() {
    // Many times as many as there are slots; that they wait is up to `queue_ms`, not to how many wait.
    let server = Server::start_with(|config| {
        config.cpu = 1;
        config.limits.queue_ms = 60_000;
    })
    .await;
    let at_once = (0..40).map(|number| {
        let job = format!("{{\"length_mm\": {}, \"load_n\": 1, \"duration_ms\": 20}}", 800 + number);
        server.post(job).send()
    });
    for response in futures_util::future::join_all(at_once).await {
        assert_eq!(response.unwrap().status(), 200);
    }
    server.stop().await;
}

#[tokio::test]
async fn a_request_says_to_which_host_it_goes() {
    let server = Server::start().await;
    for (head, status) in [
        ("GET /health/live HTTP/1.1\r\n\r\n", "HTTP/1.1 400 "),
        ("GET /health/live HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", "HTTP/1.1 400 "),
        ("GET /health/live HTTP/1.1\r\nHost: a\r\n\r\n", "HTTP/1.1 200 "),
        ("GET /health/live HTTP/1.0\r\n\r\n", "HTTP/1.0 200 "),
    ] {
        let mut stream = TcpStream::connect(server.address).await.unwrap();
        stream.write_all(head.as_bytes()).await.unwrap();
        let mut said = vec![0; 13];
        stream.read_exact(&mut said).await.unwrap();
        assert_eq!(String::from_utf8(said).unwrap(), status, "{head}");
    }
    server.stop().await;
}
