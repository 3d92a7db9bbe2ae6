//! What hostile bodies cost: the memory of the process while it reads them, as the system counts it.

use std::time::Duration;

use reqwest::Client;

use crate::watch::Service;

/// Just below the largest body that is read.
const BYTES: usize = 7_800_000;
const MB: f64 = 1e6;
/// What a request takes beside its body: what is refused at the first byte takes 0.5 to 1.0 MB, whatever its size, and more on
/// a busy machine.
const BESIDE: f64 = 1.5 * MB;

/// A body of about [`BYTES`]: a piece again and again between a beginning and an end.
fn body(begin: &str, piece: &str, end: &str) -> String {
    let count = (BYTES - begin.len() - end.len()) / piece.len();
    format!("{begin}{}{end}", piece.repeat(count))
}

fn numbered(begin: &str, end: &str) -> String {
    let mut body = begin.to_owned();
    for number in 0.. {
        if body.len() > BYTES - 20 {
            return body + end;
        }
        body.extend(["\"n", &number.to_string(), "\":0,"]);
    }
    body
}

/// A table as text with so many lines, as many as there may be.
fn table(lines: usize, line: &str, end: &str) -> String {
    format!("{{\"measurements\":{{\"csv\":\"z_mm,sag_um\\n{}{end}", line.repeat(lines))
}

/// So many rows, as many as there may be, and one more that is wrong.
fn rows(rows: usize) -> String {
    format!("{{\"measurements\":[{}{{}}]}}", "{\"z_mm\":1,\"sag_um\":1},".repeat(rows))
}

/// A study of a job.
fn study_of(job: &str) -> String {
    let vary = "[{\"pointer\":\"/length_mm\",\"values\":[100,200]}]";
    format!("{{\"calculator\":\"sagging-bar\",\"job\":{job},\"vary\":{vary}}}")
}

/// The worst bodies that are known, by name, with what each may take beside what the process takes at rest, by its size.
fn worst() -> Vec<(&'static str, &'static str, String, f64)> {
    let bar = "/v1/sagging-bar";
    let studies = "/v1/studies";
    let study = |rest: &str| format!("{{\"calculator\":\"sagging-bar\",{rest}");
    vec![
        ("a list in an unknown field", bar, body("{\"supports\":[", "{},", "{}]}"), 3.0),
        ("a list that is too long", bar, body("{\"measurements\":[", "{},", "{}]}"), 3.0),
        ("rows of unknown fields", bar, body("{\"measurements\":[", "{\"a\":[0]},", "{}]}"), 3.0),
        ("a list in place of a number", bar, body("{\"length_mm\":[", "[],", "[]]}"), 3.0),
        ("unknown fields", bar, numbered("{", "\"a\":0}"), 3.0),
        ("unknown fields of a row", bar, numbered("{\"measurements\":[{", "\"a\":0}]}"), 3.0),
        ("a word in place of a number", bar, body("{\"length_mm\":\"", "a", "\"}"), 3.0),
        ("a word that is none of the choices", bar, body("{\"behaviour\":\"", "a", "\"}"), 3.0),
        ("a word of escapes", bar, body("{\"behaviour\":\"", "\\u0041", "\"}"), 3.0),
        ("a long name", bar, body("{\"", "a", "\":0}"), 3.0),
        ("a long number", bar, body("{\"length_mm\":0.", "1", "}"), 3.0),
        ("a list of numbers", bar, body("[", "1,", "1]"), 3.0),
        ("nothing but brackets", bar, body("", "[", ""), 3.0),
        (
            "too many lines of a table",
            bar,
            body("{\"measurements\":{\"csv\":\"z_mm,sag_um\\n", "1,1\\n", "1,1\"}}"),
            3.0,
        ),
        // Its bytes, the text without escapes, and the text that is kept.
        ("nothing but separators", bar, body("{\"measurements\":{\"csv\":\"", ",", "\\n1\"}}"), 3.0),
        ("columns of a table", bar, body("{\"measurements\":{\"csv\":\"", "z_mm,", "z_mm\\n1\"}}"), 3.0),
        ("a study of a list in an unknown field", studies, body(&study("\"job\":{\"x\":["), "{},", "{}]}}"), 3.0),
        ("a study of too many rows", studies, body(&study("\"job\":{\"measurements\":["), "{},", "{}]}}"), 3.0),
        ("a study of too many values", studies, body(&study("\"vary\":[{\"values\":["), "[],", "[]]}]}"), 3.0),
        ("rows without a field", bar, body("{\"measurements\":[", "{\"z_mm\":0},", "{}]}"), 3.0),
        (
            "a study of rows without a field",
            studies,
            study_of(&format!("{{\"measurements\":[{}{{}}]}}", "{\"z_mm\":0},".repeat(99_000))),
            3.0,
        ),
    ]
}

/// Bodies that are in order but for their end.
fn nearly_right() -> Vec<(&'static str, &'static str, String, f64)> {
    let bar = "/v1/sagging-bar";
    vec![
        ("a table with a bad cell at its end", bar, table(99_000, "1,1\\n", "1,x\"}}"), 3.0),
        ("rows with a bad one at their end", bar, rows(99_000), 3.0),
        ("a study of rows with a bad one at their end", "/v1/studies", study_of(&rows(99_000)), 3.0),
        (
            "a study of a table with a bad cell at its end",
            "/v1/studies",
            study_of(&table(99_000, "1,1\\n", "1,x\"}}")),
            3.0,
        ),
    ]
}

/// Memory of a process, bytes: `VmRSS` now, `VmHWM` at its highest.
fn memory(process: u32, what: &str) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find(|line| line.starts_with(what)).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() * 1024.0
}

async fn sent(client: &Client, url: String, body: String) -> (u16, usize) {
    let request =
        client.post(url).header("content-type", "application/json").timeout(Duration::from_mins(5)).body(body);
    let response = request.send().await.unwrap();
    (response.status().as_u16(), response.bytes().await.unwrap().len())
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn no_body_takes_much_more_memory_than_its_bytes() {
    for (name, path, body, most) in worst().into_iter().chain(nearly_right()) {
        // Each has a process of its own: what the allocator keeps of one body is not counted to the next.
        let folder = tempfile::tempdir().unwrap();
        let service = Service::start(folder.path(), &[("PRECUT_CPU", "2")]).await;
        let process = service.process.child.id();
        // What is made for the first job of each kind is no matter of its body.
        for small in [table(1, "", "1,x\"}}"), study_of(&table(1, "", "1,x\"}}")), "{}".to_owned()] {
            assert_eq!(sent(&service.client, service.url(path), small).await.0, 422);
        }
        std::fs::write(format!("/proc/{process}/clear_refs"), "5").unwrap();
        let at_rest = memory(process, "VmRSS");
        let bytes = body.len() as f64;
        let (status, answer) = sent(&service.client, service.url(path), body).await;
        let took = memory(process, "VmHWM") - at_rest;
        println!("{name}: {status}, {answer} bytes back, {:.1} MB, {:.2} of the body", took / MB, took / bytes);
        assert!((400..=499).contains(&status), "{name}: {status}");
        assert!(answer < 200_000, "{name}: an answer of {answer} bytes");
        assert!(took <= most * bytes + BESIDE, "{name}: {:.2} times its size", took / bytes);
        service.stop();
    }
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn all_bodies_together_stay_within_their_budget() {
    const BUDGET: f64 = 64.0 * 1024.0 * 1024.0;
    let folder = tempfile::tempdir().unwrap();
    let settings = [("PRECUT_CPU", "2"), ("PRECUT_LIMITS_BODIES_BYTES", "67108864")];
    let service = Service::start(folder.path(), &settings).await;
    let process = service.process.child.id();
    // What is made for the first job of each kind is no matter of its body.
    for path in ["/v1/sagging-bar", "/v1/studies"] {
        assert_eq!(sent(&service.client, service.url(path), "{}".to_owned()).await.0, 422);
    }
    let at_rest = memory(process, "VmRSS");
    let mut seen = std::collections::BTreeMap::<u16, u32>::new();
    let all = worst();
    for round in 0..4 {
        let at_once = all
            .iter()
            .skip(round)
            .step_by(2)
            .map(|(_, path, body, _)| sent(&service.client, service.url(path), body.clone()));
        for (status, _) in futures_util::future::join_all(at_once).await {
            assert!((400..=499).contains(&status) || status == 503, "{status}");
            *seen.entry(status).or_default() += 1;
        }
    }
    let took = memory(process, "VmHWM") - at_rest;
    println!("{seen:?}, {:.1} MB of {:.1} MB, {:.1} MB in all", took / MB, BUDGET / MB, (took + at_rest) / MB);
    // Beside the bodies stand the buffers of ten connections, one megabyte each, and what the allocator of every thread has not
    // given back: 51 to 91 MB were seen, the more the busier the machine. Whole, the bodies at once would take 230 MB.
    assert!(took <= 1.5 * BUDGET, "{:.1} MB of {:.1} MB", took / MB, BUDGET / MB);
    // What was taken is given back: a large body is read again.
    let (name, path, body, _) = &all[1];
    assert_eq!(sent(&service.client, service.url(path), body.clone()).await.0, 422, "{name}");
    service.stop();
}
