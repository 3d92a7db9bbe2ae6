//! Whatever is sent, the answer is a problem document that says what is wrong and where.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use bytes::Bytes;
use http_body_util::StreamBody;
use hyper::body::Frame;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::{Server, header, problem, toy};

#[tokio::test]
async fn a_body_that_is_no_json_is_refused_with_line_and_column() {
    let server = Server::start().await;
    let deep = format!("{}1{}", "[".repeat(10_000), "]".repeat(10_000));
    let deep_in_field = format!("{{\"length_mm\": {}1{}}}", "{\"a\":".repeat(10_000), "}".repeat(10_000));
    for (body, code) in [
        ("", "empty_body"),
        ("  \n ", "empty_body"),
        ("{", "unexpected_end"),
        ("{\"length_mm\": 500", "unexpected_end"),
        ("{\"length_mm\" 500}", "bad_syntax"),
        ("{'length_mm': 500}", "bad_syntax"),
        ("{\"length_mm\": 500,}", "bad_syntax"),
        ("{\"length_mm\": NaN}", "bad_syntax"),
        ("{\"length_mm\": Infinity}", "bad_syntax"),
        ("{\"length_mm\": -Infinity}", "bad_syntax"),
        ("{\"length_mm\": 0x10}", "bad_syntax"),
        ("{\"length_mm\": 1e400}", "number_out_of_range"),
        ("{\"length_mm\": -1e400}", "number_out_of_range"),
        ("{\"length_mm\": 500, \"load_n\": 1} garbage", "trailing_bytes"),
        ("{\"length_mm\": 500, \"load_n\": 1}{}", "trailing_bytes"),
        ("{\"length_mm\": 500, \"load_n\": 1, \"length_mm\": 600}", "duplicate_key"),
        (deep.as_str(), "nested_too_deeply"),
        (deep_in_field.as_str(), "nested_too_deeply"),
    ] {
        let document = problem(server.post(body.to_owned()).send().await.unwrap(), 400, code).await;
        assert_eq!(document["errors_total"], 1);
    }
    for body in [&b"{\"length_mm\": \"\xff\"}"[..], b"\xff\xfe{\0}\0", b"\0\0\0", b"\x1f\x8b\x08\x00"] {
        let response = server.post(body.to_vec()).send().await.unwrap();
        problem(response, 400, "bad_syntax").await;
    }
}

#[tokio::test]
async fn every_fault_of_a_job_is_listed_at_once_with_its_place() {
    let server = Server::start().await;
    let job = json!({"lenght_mm": 500, "load_n": 1e9, "stations": "many", "behaviour": "lazy"});
    let document = problem(server.post(job.to_string()).send().await.unwrap(), 422, "invalid_job").await;
    let faults = document["errors"].as_array().unwrap();
    let at = |pointer: &str| faults.iter().find(|fault| fault["pointer"] == pointer).unwrap_or(&Value::Null);
    assert_eq!(faults.len(), 5, "{document:#}");
    assert_eq!(document["errors_total"], 5);
    assert!(at("/lenght_mm")["detail"].as_str().unwrap().contains("length_mm"), "the nearest known name: {document:#}");
    assert_eq!(at("/length_mm")["code"], "missing_field");
    assert_eq!(at("/load_n")["value"], 1e9);
    assert_eq!(at("/load_n")["limit"], 10_000.0);
    assert_eq!(at("/load_n")["unit"], "N");
    assert_eq!(at("/stations")["code"], "wrong_type");
    assert!(at("/behaviour")["detail"].as_str().unwrap().contains("quick"));
    let pointers: Vec<_> = faults.iter().map(|fault| fault["pointer"].as_str().unwrap()).collect();
    assert!(pointers.is_sorted(), "{pointers:?}");
}

#[tokio::test]
async fn jobs_of_the_wrong_shape_are_refused() {
    let server = Server::start().await;
    for job in [
        "null",
        "[]",
        "1",
        "\"job\"",
        "true",
        "{}",
        "{\"length_mm\": null, \"load_n\": 1}",
        "{\"length_mm\": \"500\", \"load_n\": 1}",
        "{\"length_mm\": [500], \"load_n\": 1}",
        "{\"length_mm\": {\"value\": 500}, \"load_n\": 1}",
        "{\"length_mm\": true, \"load_n\": 1}",
        "{\"length_mm\": -1, \"load_n\": 1}",
        "{\"length_mm\": 0, \"load_n\": 1}",
        "{\"length_mm\": 5e-324, \"load_n\": 1}",
        "{\"length_mm\": 1e308, \"load_n\": 1}",
        "{\"length_mm\": 500, \"load_n\": 1, \"stations\": 2.5}",
        "{\"length_mm\": 500, \"load_n\": 1, \"stations\": -3}",
        "{\"length_mm\": 500, \"load_n\": 1, \"stations\": 4294967299}",
        "{\"length_mm\": 500, \"load_n\": 1, \"unknown\": 1}",
        "{\"length_mm\": 500, \"load_n\": 1, \"measurements\": {\"csv\": 5}}",
        "{\"length_mm\": 500, \"load_n\": 1, \"measurements\": [{\"z_mm\": 1}]}",
    ] {
        let response = server.post(job).send().await.unwrap();
        let document = problem(response, 422, "invalid_job").await;
        assert!(document["errors_total"].as_u64().unwrap() >= 1, "{job}");
    }
    // Smaller than a double tells apart from nothing, but a number in range.
    let response = server.post("{\"length_mm\": 500, \"load_n\": 5e-324}").send().await.unwrap();
    assert_eq!(response.status(), 200);
}

#[tokio::test]
async fn rules_between_fields_are_checked_too() {
    let server = Server::start().await;
    let response = server.post("{\"length_mm\": 1.0, \"load_n\": 11.0}").send().await.unwrap();
    let document = problem(response, 422, "invalid_job").await;
    assert_eq!(document["errors"][0]["code"], "load_too_large");
    assert_eq!(document["errors"][0]["limit"], 10.0);
}

#[tokio::test]
async fn at_most_a_hundred_faults_are_listed() {
    let server = Server::start().await;
    let rows: Vec<Value> = (0..300).map(|_| json!({"z_mm": -1.0, "sag_um": "x"})).collect();
    let job = json!({"length_mm": 500, "load_n": 1, "measurements": rows});
    let document = problem(server.post(job.to_string()).send().await.unwrap(), 422, "invalid_job").await;
    assert_eq!(document["errors"].as_array().unwrap().len(), 100);
    assert_eq!(document["errors_total"], 600);
}

#[tokio::test]
async fn a_job_without_an_answer_says_why() {
    let server = Server::start().await;
    let job = json!({"length_mm": 500, "load_n": 7.0, "behaviour": "infeasible"});
    let document = problem(server.post(job.to_string()).send().await.unwrap(), 422, "bar_would_break").await;
    assert_eq!(document["errors"][0]["pointer"], "/load_n");
    assert_eq!(document["errors"][0]["value"], 7.0);
    assert_eq!(document["detail"], document["errors"][0]["detail"]);
}

#[tokio::test]
async fn a_job_that_is_too_large_is_refused_before_it_runs() {
    let server = Server::start().await;
    let job = json!({"length_mm": 500, "load_n": 1, "work_ms": 1e8});
    let document = problem(server.post(job.to_string()).send().await.unwrap(), 422, "too_expensive").await;
    assert_eq!(document["errors"][0]["pointer"], "/stations");
}

#[tokio::test]
async fn a_calculation_that_crashes_is_a_500_without_its_cause_and_the_service_lives() {
    let server = Server::start().await;
    let job = json!({"length_mm": 500, "load_n": 1, "behaviour": "panic"});
    let document = problem(server.post(job.to_string()).send().await.unwrap(), 500, "crashed").await;
    assert!(!document.to_string().contains("asked to"), "{document:#}");
    assert_eq!(server.post(toy::JOB).send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn addresses_and_methods_that_do_not_exist_are_problems_too() {
    let server = Server::start().await;
    let document =
        problem(server.post_to("/v1/saging-bar", toy::JOB).send().await.unwrap(), 404, "unknown_calculator").await;
    assert!(document["detail"].as_str().unwrap().contains(toy::BAR), "{document:#}");
    problem(server.get("/v1/saging-bar").send().await.unwrap(), 404, "unknown_calculator").await;
    for path in
        ["/nothing", "/v1", "/v1/", "/v1/results/a/b", "//", "/v1/sagging-bar/", "/%ff", "/docs/../../etc/passwd"]
    {
        problem(server.get(path).send().await.unwrap(), 404, "not_found").await;
    }
    for (path, allowed) in [("/v1/sagging-bar", "POST"), ("/v1/results", "GET,HEAD"), ("/health/live", "GET,HEAD")] {
        for method in ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"] {
            let request = server.client.request(method.parse().unwrap(), server.url(path));
            let response = request.send().await.unwrap();
            assert_eq!(header(&response, "allow"), allowed, "{method} {path}");
            let document = problem(response, 405, "method_not_allowed").await;
            assert!(document["detail"].as_str().unwrap().contains(method), "{document:#}");
        }
    }
    problem(server.get("/v1/sagging-bar").send().await.unwrap(), 405, "method_not_allowed").await;
    problem(server.post_to("/v1/results", "{}").send().await.unwrap(), 405, "method_not_allowed").await;
}

#[tokio::test]
async fn a_wrong_method_is_told_the_right_ones_at_every_address() {
    let server = Server::start().await;
    let contract: Value = server.get("/openapi.json").send().await.unwrap().json().await.unwrap();
    let paths = contract["paths"].as_object().unwrap();
    assert!(paths.len() > 20, "{} addresses", paths.len());
    for (path, methods) in paths {
        let place = path.replace(['{', '}'], "");
        let request = server.client.request("PATCH".parse().unwrap(), server.url(&place));
        let response = request.send().await.unwrap();
        let allowed = header(&response, "allow").replace(',', ", ");
        let document = problem(response, 405, "method_not_allowed").await;
        assert_eq!(document["detail"], format!("PATCH is not allowed here; allowed: {allowed}"), "{path}");
        for method in ["get", "put", "post", "delete"] {
            let declared = methods.get(method).is_some();
            assert_eq!(allowed.split(", ").any(|one| one.eq_ignore_ascii_case(method)), declared, "{method} {path}");
        }
    }
}

#[tokio::test]
async fn a_head_request_has_the_headers_and_no_body() {
    let server = Server::start().await;
    let response = server.client.head(server.url("/v1/calculators")).send().await.unwrap();
    assert_eq!(response.status(), 200);
    assert!(!header(&response, "etag").is_empty());
    assert_eq!(response.text().await.unwrap(), "");
}

#[tokio::test]
async fn other_media_types_are_refused() {
    let server = Server::start().await;
    let url = server.url("/v1/sagging-bar");
    for kind in [
        "text/plain",
        "application/xml",
        "application/x-www-form-urlencoded",
        "application/json; charset=latin1",
        "json",
        "/",
    ] {
        let request = server.client.post(&url).header("content-type", kind).body(toy::JOB);
        problem(request.send().await.unwrap(), 415, "unsupported_media_type").await;
    }
    let without = server.client.post(&url).body(toy::JOB);
    problem(without.send().await.unwrap(), 415, "unsupported_media_type").await;
    let zipped = server.post(toy::JOB).header("content-encoding", "gzip");
    let document = problem(zipped.send().await.unwrap(), 415, "unsupported_media_type").await;
    assert!(document["detail"].as_str().unwrap().contains("Content-Encoding gzip"), "{document}");
    for kind in ["application/json; charset=utf-8", "Application/JSON", "application/json;charset=\"UTF-8\""] {
        let request = server.client.post(&url).header("content-type", kind).body(toy::JOB);
        assert_eq!(request.send().await.unwrap().status(), 200, "{kind}");
    }
}

#[tokio::test]
async fn queries_that_are_not_understood_are_refused() {
    let server = Server::start().await;
    for query in
        ["?limit=0", "?limit=501", "?limit=-1", "?limit=x", "?limit=1&limit=2", "?unknown=1", "?after=x", "?after="]
    {
        problem(server.get(&format!("/v1/results{query}")).send().await.unwrap(), 400, "bad_query").await;
    }
    for (query, said) in [
        ("limit=501", "limit is 501, allowed are numbers from 1 to 500"),
        ("limit=1&limit=2", "the parameter limit stands there twice"),
        ("limits=1", "there is no parameter limits here; did you mean limit?"),
        ("colour=red", "there is no parameter colour here; there are state, calculator, limit, after"),
        ("state=done", "state is done, allowed are queued, running, succeeded, failed, cancelled"),
    ] {
        let document = problem(server.get(&format!("/v1/jobs?{query}")).send().await.unwrap(), 400, "bad_query").await;
        assert_eq!(document["detail"], said);
    }
    let russian = server.get("/v1/jobs?limit=x").header("accept-language", "ru").send().await.unwrap();
    let document = problem(russian, 400, "bad_query").await;
    assert_eq!(document["detail"], "limit = x, допускаются числа от 1 до 500");
    problem(server.get("/v1/results?calculator=none").send().await.unwrap(), 404, "unknown_calculator").await;
    for query in ["?unknown=1", "?table=stations&table=stations"] {
        let path = format!("/v1/sagging-bar{query}");
        problem(server.post_to(&path, toy::JOB).send().await.unwrap(), 400, "bad_query").await;
    }
    for (query, code) in
        [("?table=none", "unknown_table"), ("?figure=none", "unknown_figure"), ("?table=", "unknown_table")]
    {
        let path = format!("/v1/sagging-bar{query}");
        problem(server.post_to(&path, toy::JOB).send().await.unwrap(), 404, code).await;
    }
    problem(server.get("/v1/results/b3:12").send().await.unwrap(), 400, "bad_key").await;
    let absent = format!("/v1/results/b3:{}", "0".repeat(64));
    problem(server.get(&absent).send().await.unwrap(), 404, "unknown_result").await;
    problem(server.get("/v1/materials/cheese").send().await.unwrap(), 404, "unknown_material").await;
    problem(server.get("/v1/calculators/cheese").send().await.unwrap(), 404, "unknown_calculator").await;
}

#[tokio::test]
async fn a_form_without_a_proper_job_is_refused() {
    let server = Server::start().await;
    let url = server.url("/v1/sagging-bar");
    let send = |form: Form| server.client.post(&url).multipart(form).send();
    let job = || Part::text(toy::JOB);
    problem(send(Form::new().text("measurements", "z_mm\n1")).await.unwrap(), 400, "missing_job_part").await;
    problem(send(Form::new().part("job", job()).part("job", job())).await.unwrap(), 400, "bad_multipart").await;
    let twice = Form::new().part("job", job()).text("measurements", "a").text("measurements", "b");
    problem(send(twice).await.unwrap(), 400, "bad_multipart").await;
    problem(send(Form::new().part("job", Part::text("{"))).await.unwrap(), 400, "unexpected_end").await;
    let unknown = Form::new().part("job", job()).text("readings", "z_mm,sag_um\n1,2\n");
    problem(send(unknown).await.unwrap(), 422, "invalid_job").await;
    for (kind, body) in [
        ("multipart/form-data", "--x\r\n"),
        ("multipart/form-data; boundary=x", ""),
        ("multipart/form-data; boundary=x", "--x\r\nContent-Disposition: form-data; name=\"job\"\r\n\r\n{}"),
        ("multipart/form-data; boundary=x", "--x\r\nContent-Disposition: form-data\r\n\r\n{}\r\n--x--\r\n"),
    ] {
        let response = server.client.post(&url).header("content-type", kind).body(body).send().await.unwrap();
        problem(response, 400, "bad_multipart").await;
    }
}

#[tokio::test]
async fn a_body_of_100_mb_is_refused_at_once() {
    let server = Server::start().await;
    let response = server.post(vec![b' '; 100_000_000]).send().await.unwrap();
    let document = problem(response, 413, "body_too_large").await;
    assert_eq!(document["detail"], "at most 33554432 bytes are read here");
    // Without its length given, as it streams in.
    let chunk = Bytes::from(vec![b' '; 1_000_000]);
    let taken = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&taken);
    let chunks = futures_util::stream::iter((0..100).map(move |_| {
        counted.fetch_add(1, Ordering::Relaxed);
        Ok::<_, Infallible>(Frame::data(chunk.clone()))
    }));
    let response = server.post(reqwest::Body::wrap(StreamBody::new(chunks))).send().await.unwrap();
    problem(response, 413, "body_too_large").await;
    let sent_mb = taken.load(Ordering::Relaxed);
    assert!(sent_mb < 60, "{sent_mb} MB were sent before it was refused");
    let form = Form::new().part("job", Part::bytes(vec![b' '; 100_000_000]));
    let response = server.client.post(server.url("/v1/sagging-bar")).multipart(form).send().await.unwrap();
    problem(response, 413, "body_too_large").await;
    assert_eq!(server.post(toy::JOB).send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn a_client_that_only_announces_too_much_is_answered_before_it_sends() {
    let server = Server::start().await;
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    let head = "POST /v1/sagging-bar HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n\
                Content-Length: 100000000\r\nExpect: 100-continue\r\n\r\n";
    stream.write_all(head.as_bytes()).await.unwrap();
    let answer = read_some(&mut stream).await;
    assert!(answer.starts_with("HTTP/1.1 413 "), "{answer}");
}

#[tokio::test]
async fn who_is_refused_at_the_door_can_send_the_rest_and_read_why() {
    let server = Server::start().await;
    // More than the buffers of both ends hold.
    let body = vec![b' '; 32 << 20];
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    let head = format!(
        "POST /v1/sagging-bar HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: {}\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    stream.write_all(&body).await.expect("the connection is not reset");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.expect("the connection is not reset");
    assert!(answer.starts_with("HTTP/1.1 415 ") && answer.contains("unsupported_media_type"), "{answer}");
}

#[tokio::test]
async fn a_body_that_never_ends_times_out_or_grows_too_large() {
    let server = Server::start_with(|config| config.limits.body_timeout_s = 0.3).await;
    // It stops in the middle and waits.
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    let head =
        "POST /v1/sagging-bar HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: 100\r\n\r\n{";
    stream.write_all(head.as_bytes()).await.unwrap();
    let answer = read_some(&mut stream).await;
    assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
    assert!(answer.contains("\"code\":\"timeout\""), "{answer}");

    // It goes on for ever, a little at a time.
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    let head = "POST /v1/sagging-bar HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n\
                Transfer-Encoding: chunked\r\n\r\n";
    stream.write_all(head.as_bytes()).await.unwrap();
    let (mut reader, mut writer) = stream.into_split();
    let dripping = tokio::spawn(async move {
        while writer.write_all(b"1\r\n \r\n").await.is_ok() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    });
    let mut answer = vec![0; 4096];
    let count = tokio::time::timeout(Duration::from_mins(1), reader.read(&mut answer)).await.unwrap().unwrap();
    let answer = String::from_utf8_lossy(&answer[..count]).into_owned();
    assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
    dripping.abort();
}

#[tokio::test]
async fn a_body_that_breaks_off_harms_nobody() {
    let server = Server::start().await;
    for rest in ["{\"len", "zz\r\n"] {
        let mut stream = TcpStream::connect(server.address).await.unwrap();
        let framing = if rest.starts_with('z') { "Transfer-Encoding: chunked" } else { "Content-Length: 100" };
        let text = format!(
            "POST /v1/sagging-bar HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n{framing}\r\n\r\n{rest}"
        );
        stream.write_all(text.as_bytes()).await.unwrap();
        stream.shutdown().await.unwrap();
        let answer = read_some(&mut stream).await;
        assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 400 "), "{answer}");
    }
    assert_eq!(server.post(toy::JOB).send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn requests_that_are_no_http_or_too_long_are_refused() {
    let server = Server::start().await;
    for text in
        ["\r\n\r\nnonsense\r\n\r\n", "GET / HTTP/9.9\r\n\r\n", "\x16\x03\x01\x02\0\x01", "GET  /  HTTP/1.1\r\n\r\n"]
    {
        let mut stream = TcpStream::connect(server.address).await.unwrap();
        stream.write_all(text.as_bytes()).await.unwrap();
        let _ = stream.shutdown().await;
        let answer = read_some(&mut stream).await;
        assert!(
            answer.is_empty() || answer.starts_with("HTTP/1.1 400 ") || answer.starts_with("HTTP/1.1 505 "),
            "{answer}"
        );
    }
    let long = server.get(&format!("/{}", "a".repeat(9_000)));
    problem(long.send().await.unwrap(), 414, "uri_too_long").await;
    let fat = server.get("/health/live").header("x-fat", "a".repeat(40_000));
    problem(fat.send().await.unwrap(), 431, "header_too_large").await;
    assert_eq!(server.post(toy::JOB).send().await.unwrap().status(), 200);
}

/// What arrives first, at most for a minute; empty at the end of the connection.
async fn read_some(stream: &mut TcpStream) -> String {
    let mut answer = vec![0; 8192];
    let read =
        tokio::time::timeout(Duration::from_mins(1), stream.read(&mut answer)).await.expect("an answer or an end");
    let count = read.unwrap_or(0);
    String::from_utf8_lossy(&answer[..count]).into_owned()
}
