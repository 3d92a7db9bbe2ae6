//! Who asked for it is told when a job is over, by real calls to a real receiver.

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use precut::config::{ApiKey, Config, OwnerSecret};
use precut::http::auth;
use serde_json::{Value, json};
use tempfile::NamedTempFile;

use crate::certificates::{certificate, signed};
use crate::jobs::lasting;
use crate::receiver::{Call, Receiver, SECRET, secret_file};
use crate::stream::process_file;
use crate::support::{Process, Server, header, problem, toy};

const OTHER_SECRET: &str = "whsec_AAECAwQFBgcICQoLDA0ODxAREhMUFRYXGBkaGxwdHh8=";

/// Calls that receiver and hardly waits between tries.
fn calling(config: &mut Config, receiver: &Receiver, secret: &NamedTempFile) {
    config.callbacks.hosts = vec![receiver.host()];
    config.callbacks.private = true;
    secret.path().to_str().unwrap().clone_into(&mut config.callbacks.secret_file);
    config.callbacks.pauses_s = vec![0.01, 0.02, 0.03];
}

async fn server(receiver: &Receiver, secret: &NamedTempFile) -> Server {
    Server::start_with(|config| calling(config, receiver, secret)).await
}

/// Where the toy takes a job that is told to an address.
fn told_to(url: &str) -> String {
    let url: String = url::form_urlencoded::byte_serialize(url.as_bytes()).collect();
    format!("/v1/{}?callback={url}", toy::BAR)
}

async fn job(server: &Server, address: &str) -> Value {
    server.get(address).send().await.unwrap().json().await.unwrap()
}

/// Waits until a callback is in a state.
async fn callback_in(server: &Server, address: &str, state: &str) -> Value {
    callback_at(server, address, "/callback", state).await
}

/// The same of what stands at a pointer of an answer.
async fn callback_at(server: &Server, address: &str, pointer: &str, state: &str) -> Value {
    loop {
        let callback = job(server, address).await.pointer(pointer).cloned().unwrap_or_default();
        if callback["state"] == state {
            return callback;
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

#[tokio::test]
async fn whoever_asked_for_it_is_told_in_a_signed_call() {
    let (receiver, secret) = (Receiver::start(), secret_file(SECRET));
    let server = server(&receiver, &secret).await;
    let held = toy::hold(2201);
    let accepted = server.post_to(&told_to(&receiver.url("/hooks?line=7")), lasting(2201, 600)).send().await.unwrap();
    assert_eq!(accepted.status(), 202);
    let address = header(&accepted, "location").to_owned();
    let waiting: Value = accepted.json().await.unwrap();
    let expected = json!({
        "url": receiver.url("/hooks?line=7"), "state": "waiting", "attempts": 0, "next_at": null, "fault": null,
        "settled_at": null
    });
    assert_eq!(waiting["callback"], expected);
    drop(held);
    let call = receiver.after(1).await.remove(0);
    assert_eq!(call.path, "/hooks?line=7");
    assert!(call.is_signed_with(SECRET) && !call.is_signed_with(OTHER_SECRET), "{call:?}");
    assert_eq!(call.header("content-type"), "application/json");
    let id = waiting["id"].as_str().unwrap();
    assert_eq!(call.header("webhook-id"), id);
    let sent_s: i64 = call.header("webhook-timestamp").parse().unwrap();
    assert!((jiff::Timestamp::now().as_second() - sent_s).abs() < 300);
    let done = callback_in(&server, &address, "delivered").await;
    assert_eq!((&done["attempts"], &done["fault"], &done["next_at"]), (&json!(1), &json!(null), &json!(null)));
    assert!(done["settled_at"].is_string());
    let job = job(&server, &address).await;
    let event = json!({
        "type": "job.succeeded", "timestamp": job["finished_at"],
        "data": {
            "id": id, "calculator": toy::BAR, "key": job["key"], "created_at": job["created_at"], "problem": null,
            "links": { "self": address, "result": format!("{address}/result") }
        }
    });
    assert_eq!(call.json(), event);
    // Told once.
    assert_eq!(receiver.calls().len(), 1);
    server.stop().await;
}

/// The tailstock that softened at part 37: of all parts the change alone is told, in a signed call.
#[tokio::test]
async fn whom_a_process_names_is_told_of_a_change() {
    let (receiver, secret) = (Receiver::start(), secret_file(SECRET));
    let registry = precut::registry::Registry::standard().unwrap();
    let server = Server::start_of(registry, |config| calling(config, &receiver, &secret)).await;
    let mut process = process_file("r01-tailstock-softer.json");
    let Value::Array(parts) = process["parts"].take() else { panic!("a stream without parts") };
    process.as_object_mut().unwrap().remove("parts");
    let put = async |path: &str, body: &Value| {
        let request = server.client.put(server.url(path)).header("content-type", "application/json");
        request.body(body.to_string()).send().await.unwrap()
    };
    let at = "/v1/processes/shaft-560";
    process["callback"] = json!({ "url": "http://elsewhere.example/", "events": ["change"] });
    problem(put(at, &process).await, 422, "bad_callback").await;
    process["callback"] = json!({ "url": receiver.url("/said"), "events": ["chnage"] });
    let refused = problem(put(at, &process).await, 422, "invalid_process").await;
    assert_eq!(refused["errors"][0]["pointer"], "/callback/events/0");
    process["callback"]["events"] = json!(["change"]);
    assert_eq!(put(at, &process).await.status(), 201);
    let mut since = None;
    for (number, part) in (1..).zip(&parts) {
        let taken = put(&format!("{at}/parts/p-{number}"), part).await;
        assert_eq!(taken.status(), 201);
        let said: Value = taken.json().await.unwrap();
        if said["news"].as_array().unwrap().contains(&json!("change")) {
            since = Some((number, said));
            break;
        }
    }
    let (number, said) = since.unwrap();
    let call = receiver.after(1).await.remove(0);
    assert_eq!((call.path.as_str(), call.is_signed_with(SECRET)), ("/said", true));
    let event = call.json();
    assert_eq!(event["type"], "process.change");
    assert_eq!(event["data"]["sequence"], said["sequence"]);
    assert_eq!(event["data"]["said"], said["explanation"][0]["text"]);
    let part = format!("{at}/parts/p-{number}");
    assert_eq!(event["data"]["links"], json!({ "self": at, "part": part }));
    let before = said["sequence"].as_u64().unwrap() - 1;
    let entry = format!("{at}/history?after={before}&limit=1");
    let done = callback_at(&server, &entry, "/items/0/callback", "delivered").await;
    assert_eq!((&done["url"], &done["attempts"]), (&json!(receiver.url("/said")), &json!(1)));
    let declared = job(&server, &format!("{at}/history?limit=1")).await;
    assert_eq!(declared["items"][0]["callback"], json!(null));
    assert_eq!(receiver.calls().len(), 1, "nothing else was wanted");
    server.stop().await;
}

#[tokio::test]
async fn jobs_that_fail_or_are_cancelled_are_told_too() {
    let (receiver, secret) = (Receiver::start(), secret_file(SECRET));
    let server = server(&receiver, &secret).await;
    let send = async |path: &str, job: String| {
        let path = told_to(&receiver.url(path));
        let sent = server.post_to(&path, job).header("prefer", "respond-async").send().await.unwrap();
        assert_eq!(sent.status(), 202);
        header(&sent, "location").to_owned()
    };
    let infeasible = json!({"length_mm": 2211, "load_n": 1, "behaviour": "infeasible"}).to_string();
    send("/failed", infeasible).await;
    let held = toy::hold(2212);
    let cancelled = send("/cancelled", lasting(2212, 600)).await;
    server.client.delete(server.url(&cancelled)).send().await.unwrap();
    drop(held);
    // One that is late is failed by nobody who computes.
    let held = toy::hold(2213);
    let path = format!("{}&deadline_s=0.05", told_to(&receiver.url("/late")));
    assert_eq!(server.post_to(&path, lasting(2213, 600)).send().await.unwrap().status(), 202);
    let calls = receiver.after(3).await;
    drop(held);
    let told = |path: &str| calls.iter().find(|call| call.path == path).unwrap().json();
    let failed = told("/failed");
    assert_eq!(
        (failed["type"].as_str(), failed["data"]["problem"].is_string()),
        (Some("job.failed"), true),
        "{failed}"
    );
    assert_eq!(told("/cancelled")["type"], "job.cancelled");
    assert_eq!(told("/late")["data"]["problem"], "deadline_exceeded");
    server.stop().await;
}

#[tokio::test]
async fn what_is_there_already_is_told_at_once_and_the_same_request_once() {
    let (receiver, secret) = (Receiver::start(), secret_file(SECRET));
    let server = server(&receiver, &secret).await;
    let job = json!({"length_mm": 2221, "load_n": 1}).to_string();
    assert_eq!(server.post(job.clone()).send().await.unwrap().status(), 200);
    // The answer is in the cache; who asks to be told is answered and told.
    let path = told_to(&receiver.url("/there"));
    let answer = server.post_to(&path, job.clone()).send().await.unwrap();
    assert_eq!((answer.status().as_u16(), header(&answer, "precut-cache")), (200, "hit"));
    assert_eq!(receiver.after(1).await[0].json()["type"], "job.succeeded");
    // A request with a name is one job and is told once.
    let named = async |path: &str| {
        let request = server.post_to(path, job.clone()).header("idempotency-key", "told-once");
        request.send().await.unwrap()
    };
    for _ in 0..3 {
        assert_eq!(named(&path).await.status(), 200);
    }
    receiver.after(2).await;
    // Under the same name somebody else is to be told: that is another request.
    problem(named(&told_to(&receiver.url("/other"))).await, 422, "idempotency_key_reused").await;
    problem(named(&format!("/v1/{}", toy::BAR)).await, 422, "idempotency_key_reused").await;
    // A short job that is new: answered in place, and told.
    let short = json!({"length_mm": 2222, "load_n": 1}).to_string();
    assert_eq!(server.post_to(&path, short).send().await.unwrap().status(), 200);
    let calls = receiver.after(3).await;
    let ids: std::collections::BTreeSet<&str> = calls.iter().map(|call| call.header("webhook-id")).collect();
    assert_eq!((calls.len(), ids.len()), (3, 3));
    server.stop().await;
}

#[tokio::test]
async fn it_is_tried_again_with_the_same_id_until_it_is_taken() {
    let tries = AtomicU32::new(0);
    let receiver = Receiver::answering(move |_| if tries.fetch_add(1, Ordering::Relaxed) < 2 { 503 } else { 200 });
    let secret = secret_file(SECRET);
    let server = server(&receiver, &secret).await;
    let sent = server.post_to(&told_to(&receiver.url("/")), lasting(2231, 1)).header("prefer", "respond-async");
    let sent = sent.send().await.unwrap();
    let address = header(&sent, "location").to_owned();
    let done = callback_in(&server, &address, "delivered").await;
    assert_eq!((&done["attempts"], &done["fault"]), (&json!(3), &json!(null)));
    let calls = receiver.calls();
    assert_eq!(calls.len(), 3);
    for call in &calls {
        assert_eq!((call.header("webhook-id"), &call.body), (calls[0].header("webhook-id"), &calls[0].body));
        assert!(call.is_signed_with(SECRET));
    }
    server.stop().await;
}

#[tokio::test]
async fn what_nobody_takes_is_given_up_for_all_to_see() {
    let receiver = Receiver::answering(|call| if call.path == "/gone" { 410 } else { 500 });
    let secret = secret_file(SECRET);
    let server = server(&receiver, &secret).await;
    let send = async |path: &str, length: u32| {
        let request = server.post_to(&told_to(&receiver.url(path)), lasting(length, 1));
        let sent = request.header("prefer", "respond-async").send().await.unwrap();
        header(&sent, "location").to_owned()
    };
    let (broken, gone) = (send("/broken", 2241).await, send("/gone", 2242).await);
    let given_up = callback_in(&server, &broken, "given_up").await;
    assert_eq!(
        (&given_up["attempts"], &given_up["fault"]),
        (&json!(4), &json!("http_500")),
        "three pauses, four tries"
    );
    let given_up = callback_in(&server, &gone, "given_up").await;
    assert_eq!(
        (&given_up["attempts"], &given_up["fault"]),
        (&json!(1), &json!("http_410")),
        "it says not to come again"
    );
    let metrics = server.get("/metrics").send().await.unwrap().text().await.unwrap();
    let given_up = metrics.lines().find(|line| line.starts_with("precut_callbacks_total{outcome=\"given_up\"}"));
    // Other tests of this program count beside this one.
    assert!(given_up.unwrap().rsplit(' ').next().unwrap().parse::<f64>().unwrap() >= 2.0, "{given_up:?}");
    // The job itself is as it was.
    assert_eq!(job(&server, &broken).await["state"], "succeeded");
    server.stop().await;
}

#[tokio::test]
async fn a_receiver_that_asks_for_time_gets_it_within_a_day() {
    let receiver = Receiver::saying(|call| {
        let asked = match call.path.as_str() {
            "/hour" => "3600",
            "/century" => "Tue, 31 Dec 2199 23:59:59 GMT",
            _ => "0",
        };
        Some(format!("HTTP/1.1 429 x\r\nRetry-After: {asked}\r\nContent-Length: 0\r\n\r\n"))
    });
    let secret = secret_file(SECRET);
    let server = server(&receiver, &secret).await;
    let minute = 60;
    for (length, path, wait_s) in [(2245, "/hour", 3600), (2246, "/century", 86_400)] {
        let request = server.post_to(&told_to(&receiver.url(path)), lasting(length, 1));
        let sent = request.header("prefer", "respond-async").send().await.unwrap();
        let address = header(&sent, "location").to_owned();
        let told = loop {
            let job = job(&server, &address).await;
            if job["callback"]["fault"] == "http_429" {
                break job;
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        };
        let at = |text: &Value| -> jiff::Timestamp { text.as_str().unwrap().parse().unwrap() };
        let waits = at(&told["callback"]["next_at"]).duration_since(at(&told["finished_at"])).as_secs();
        assert!((wait_s - 1..wait_s + minute).contains(&waits), "{path}: {waits} s");
        assert_eq!(told["callback"]["attempts"], 1);
    }
    // One that asks to be called at once is given the pauses all the same, and no more tries.
    let request = server.post_to(&told_to(&receiver.url("/now")), lasting(2247, 1));
    let sent = request.header("prefer", "respond-async").send().await.unwrap();
    let given_up = callback_in(&server, header(&sent, "location"), "given_up").await;
    assert_eq!((&given_up["attempts"], &given_up["fault"]), (&json!(4), &json!("http_429")));
    server.stop().await;
}

#[tokio::test]
async fn an_answer_cannot_lead_it_elsewhere_or_hold_it_up() {
    let elsewhere = Receiver::start();
    let (to, secret) = (elsewhere.url("/stolen"), secret_file(SECRET));
    let receiver = Receiver::saying(move |call| match call.path.as_str() {
        "/redirect" => Some(format!("HTTP/1.1 307 x\r\nLocation: {to}\r\nContent-Length: 0\r\n\r\n")),
        "/silent" => None,
        "/nonsense" => Some("SSH-2.0-OpenSSH\r\n".to_owned()),
        "/endless-header" => Some(format!("HTTP/1.1 200 x\r\nX: {}\r\n\r\n", "x".repeat(100_000))),
        // A body that is promised and never comes is not waited for.
        "/endless-body" => Some("HTTP/1.1 200 x\r\nContent-Length: 1000000000\r\n\r\nx".to_owned()),
        _ => Some("HTTP/1.1 204 x\r\n\r\n".to_owned()),
    });
    let server = Server::start_with(|config| {
        calling(config, &receiver, &secret);
        config.callbacks.hosts.push(elsewhere.host());
        config.callbacks.pauses_s.clear();
        config.callbacks.timeout_s = 1.0;
    })
    .await;
    let mut sent = Vec::new();
    let cases = [
        ("/redirect", "given_up", Some("http_307")),
        ("/silent", "given_up", Some("no_answer")),
        ("/nonsense", "given_up", Some("no_answer")),
        ("/endless-header", "given_up", Some("no_answer")),
        ("/endless-body", "delivered", None),
        ("/good", "delivered", None),
    ];
    for (number, (path, _, _)) in (2251..).zip(cases) {
        let request = server.post_to(&told_to(&receiver.url(path)), lasting(number, 1));
        let accepted = request.header("prefer", "respond-async").send().await.unwrap();
        sent.push(header(&accepted, "location").to_owned());
    }
    for (address, (path, state, fault)) in sent.iter().zip(cases) {
        let callback = callback_in(&server, address, state).await;
        assert_eq!(callback["fault"], json!(fault), "{path}");
    }
    assert!(elsewhere.calls().is_empty(), "a redirect is not followed, not even to a host that is allowed");
    server.stop().await;
}

#[tokio::test]
async fn nobody_is_called_whom_the_settings_do_not_name() {
    let (receiver, secret) = (Receiver::start(), secret_file(SECRET));
    let refused = async |server: &Server, url: &str, words: &str| {
        let sent = server.post_to(&told_to(url), toy::JOB).send().await.unwrap();
        let refused = problem(sent, 422, "bad_callback").await;
        assert!(refused["detail"].as_str().unwrap().contains(words), "{refused:#}");
    };
    let off = Server::start().await;
    refused(&off, &receiver.url("/"), "callbacks.hosts").await;
    let russian = off.post_to(&told_to("https://mes/"), toy::JOB).header("accept-language", "ru").send().await.unwrap();
    assert!(problem(russian, 422, "bad_callback").await["detail"].as_str().unwrap().contains("настройке"));
    off.stop().await;
    let server = server(&receiver, &secret).await;
    for (url, words) in [
        ("https://evil.example/", "evil.example:443"),
        ("ftp://127.0.0.1/", "ftp"),
        ("mes", "https://mes.plant.example"),
        ("http://user:word@127.0.0.1/", "a user, a password"),
        (&format!("http://127.0.0.1:{}/", receiver.address.port().wrapping_add(1).max(1)), "does not allow"),
    ] {
        refused(&server, url, words).await;
    }
    // A job that is refused is no job.
    let jobs: Value = server.get("/v1/jobs").send().await.unwrap().json().await.unwrap();
    assert_eq!(jobs["items"], json!([]));
    server.stop().await;
    // A name that is allowed and stands for this machine, where that is not allowed.
    let server = Server::start_with(|config| {
        calling(config, &receiver, &secret);
        config.callbacks.hosts = vec![format!("localhost:{}", receiver.address.port())];
        config.callbacks.private = false;
        config.callbacks.pauses_s.clear();
    })
    .await;
    let url = format!("http://localhost:{}/", receiver.address.port());
    let sent = server.post_to(&told_to(&url), lasting(2261, 1)).header("prefer", "respond-async").send().await.unwrap();
    let given_up = callback_in(&server, header(&sent, "location"), "given_up").await;
    assert_eq!(given_up["fault"], "private_address");
    server.stop().await;
    assert!(receiver.calls().is_empty());
}

#[tokio::test]
async fn each_owner_has_his_secret_and_a_secret_is_replaced_without_a_restart() {
    let receiver = Receiver::start();
    let (all, own) = (secret_file(SECRET), secret_file(OTHER_SECRET));
    let (one, other) = ("the secret key of one owner", "the secret key of the other");
    let server = Server::start_with(|config| {
        calling(config, &receiver, &all);
        let owner = OwnerSecret { owner: "one".to_owned(), secret_file: own.path().to_str().unwrap().to_owned() };
        config.callbacks.owners = vec![owner];
        let key = |name: &str, key: &str| ApiKey {
            name: name.to_owned(),
            hash: auth::hash(key).to_string(),
            ..ApiKey::default()
        };
        config.auth.keys = vec![key("one", one), key("other", other)];
    })
    .await;
    let send = async |key: &str, path: &str, length: u32| {
        let request = server.post_to(&told_to(&receiver.url(path)), lasting(length, 1)).bearer_auth(key);
        assert_eq!(request.send().await.unwrap().status(), 200);
    };
    send(one, "/one", 2271).await;
    send(other, "/other", 2272).await;
    let calls = receiver.after(2).await;
    let call = |path: &str| calls.iter().find(|call| call.path == path).unwrap();
    assert!(call("/one").is_signed_with(OTHER_SECRET) && !call("/one").is_signed_with(SECRET));
    assert!(call("/other").is_signed_with(SECRET) && !call("/other").is_signed_with(OTHER_SECRET));
    // Both secrets sign while one is replaced by the other.
    let new = "whsec_AQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQE=";
    std::fs::write(own.path(), format!("{new}\n{OTHER_SECRET}\n")).unwrap();
    send(one, "/two", 2273).await;
    let calls = receiver.after(3).await;
    let call = calls.iter().find(|call| call.path == "/two").unwrap();
    assert!(call.is_signed_with(new) && call.is_signed_with(OTHER_SECRET));
    // Without a secret nothing is sent, and it is tried again.
    std::fs::write(own.path(), "").unwrap();
    send(one, "/three", 2274).await;
    let list: Value = server.get("/v1/jobs?limit=1").bearer_auth(one).send().await.unwrap().json().await.unwrap();
    let address = list["items"][0]["links"]["self"].as_str().unwrap().to_owned();
    loop {
        let job: Value = server.get(&address).bearer_auth(one).send().await.unwrap().json().await.unwrap();
        if job["callback"]["state"] == "given_up" {
            assert_eq!(job["callback"]["fault"], "no_secret");
            break;
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    assert_eq!(receiver.calls().len(), 3);
    server.stop().await;
}

#[tokio::test]
async fn one_host_that_hangs_does_not_keep_others_waiting() {
    let (silent, good, secret) = (Receiver::saying(|_| None), Receiver::start(), secret_file(SECRET));
    let server = Server::start_with(|config| {
        calling(config, &silent, &secret);
        config.callbacks.hosts.push(good.host());
        config.callbacks.timeout_s = 60.0;
    })
    .await;
    for number in 2281..2321 {
        let job = json!({"length_mm": number, "load_n": 1}).to_string();
        assert_eq!(server.post_to(&told_to(&silent.url("/")), job).send().await.unwrap().status(), 200);
    }
    // Those that are tried take a minute each.
    silent.after(4).await;
    let job = json!({"length_mm": 2321, "load_n": 1}).to_string();
    assert_eq!(server.post_to(&told_to(&good.url("/")), job).send().await.unwrap().status(), 200);
    good.after(1).await;
    assert!(silent.calls().len() < 16, "{} tries of one host at the same time", silent.calls().len());
    server.stop().await;
}

#[tokio::test]
async fn a_place_in_a_trace_is_kept_with_the_job_and_passed_on() {
    let (receiver, secret) = (Receiver::start(), secret_file(SECRET));
    let server = server(&receiver, &secret).await;
    let place = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
    let states = ["rojo=00f067aa0ba902b7", "congo=t61rcWkgMzE"];
    let send = async |given: &[&str], length: u32| -> Value {
        let mut request = server.post_to(&told_to(&receiver.url("/")), lasting(length, 600));
        for one in given {
            request = request.header("traceparent", *one);
        }
        for one in states {
            request = request.header("tracestate", one);
        }
        request.send().await.unwrap().json().await.unwrap()
    };
    // Nothing is exported here: it goes on as it came.
    assert_eq!(send(&[place], 2331).await["traceparent"], place);
    let told = receiver.after(1).await.remove(0);
    assert_eq!((told.header("traceparent"), told.header("tracestate")), (place, states.join(",").as_str()));
    // What is none counts as not given.
    for (number, given) in (2332..).zip([&[][..], &["00-nonsense"], &[place, place]]) {
        assert_eq!(send(given, number).await["traceparent"], json!(null), "{given:?}");
    }
    let has_none = |call: &Call| call.header("traceparent").is_empty() && call.header("tracestate").is_empty();
    assert!(receiver.after(4).await[1..].iter().all(has_none));
    server.stop().await;
}

/// What a receiver with a certificate for `localhost` needs.
fn tls(folder: &std::path::Path) -> std::sync::Arc<rustls::ServerConfig> {
    use rustls::pki_types::pem::PemObject;
    use rustls::pki_types::{CertificateDer, PrivateKeyDer};
    let certificate = CertificateDer::from_pem_file(folder.join("server.pem")).unwrap();
    let key = PrivateKeyDer::from_pem_file(folder.join("server.key")).unwrap();
    let provider = std::sync::Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ServerConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
    std::sync::Arc::new(config.with_no_client_auth().with_single_cert(vec![certificate], key).unwrap())
}

#[cfg(unix)]
#[tokio::test]
async fn over_tls_only_who_is_who_he_says_is_told() {
    let folder = tempfile::tempdir().unwrap();
    if certificate(folder.path(), "plant", &["-subj", "/CN=plant"]).is_none() {
        return;
    }
    signed(folder.path(), "server", &["-subj", "/CN=mes", "-addext", "subjectAltName=DNS:localhost"]).unwrap();
    let (receiver, secret) = (Receiver::secured(tls(folder.path())), secret_file(SECRET));
    let port = receiver.address.port();
    let (hosts, authority) = (format!("[\"localhost:{port}\", \"127.0.0.1:{port}\"]"), folder.path().join("plant.pem"));
    let settings = [
        ("PRECUT_CALLBACKS_HOSTS", hosts.as_str()),
        ("PRECUT_CALLBACKS_PRIVATE", "true"),
        ("PRECUT_CALLBACKS_SECRET_FILE", secret.path().to_str().unwrap()),
        ("PRECUT_CALLBACKS_PAUSES_S", "[]"),
    ];
    let told = async |process: &Process, host: &str, length: u32| -> Value {
        let client = reqwest::Client::new();
        let at = |path: &str| format!("http://{}{path}", process.address);
        let path = told_to(&format!("https://{host}:{port}/"));
        let request = client.post(at(&path)).header("content-type", "application/json").body(lasting(length, 1));
        let sent = request.header("prefer", "respond-async").send().await.unwrap();
        let address = header(&sent, "location").to_owned();
        loop {
            let mut job: Value = client.get(at(&address)).send().await.unwrap().json().await.unwrap();
            if matches!(job["callback"]["state"].as_str(), Some("delivered" | "given_up")) {
                return job["callback"].take();
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    let trusting = [&settings[..], &[("SSL_CERT_FILE", authority.to_str().unwrap())]].concat();
    let process = Process::start_with(&folder.path().join("trusting"), &trusting);
    assert_eq!(told(&process, "localhost", 2341).await["state"], "delivered");
    let other_host = told(&process, "127.0.0.1", 2342).await;
    assert_eq!((&other_host["state"], &other_host["fault"]), (&json!("given_up"), &json!("no_tls")));
    drop(process);
    // The authorities of the system do not know this one.
    let process = Process::start_with(&folder.path().join("other"), &settings);
    assert_eq!(told(&process, "localhost", 2343).await["fault"], "no_tls");
    let calls = receiver.calls();
    assert_eq!(calls.len(), 1);
    assert!(calls[0].is_signed_with(SECRET));
}

#[cfg(unix)]
#[test]
fn a_service_that_cannot_sign_does_not_start() {
    let folder = tempfile::tempdir().unwrap();
    let secret = secret_file("whsec_short");
    for (file, words) in [("/nowhere/secret", "/nowhere/secret"), (secret.path().to_str().unwrap(), "base64")] {
        let data = folder.path().to_str().unwrap();
        let output = crate::support::toy_command(&["serve", "--listen", "127.0.0.1:0", "--data", data])
            .envs([("PRECUT_CALLBACKS_HOSTS", "[\"mes\"]"), ("PRECUT_CALLBACKS_SECRET_FILE", file)])
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains(words), "{said}");
        assert!(!said.contains("whsec_short"), "{said}");
    }
}
