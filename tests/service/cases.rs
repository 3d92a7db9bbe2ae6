//! Jobs that came from use, over real HTTP: what went wrong with each, and what is right.

use std::time::Duration;

use futures_util::future::join_all;
use precut::config::Config;
use precut::registry::Registry;
use serde_json::Value;

use crate::support::{Server, address_of, header, precut_command, problem};

const BURST: &str = include_str!("../cases/http/burst.json");
const THREE_KILLS: &str = include_str!("../cases/http/three-kills.json");
const CSV_FORMULA: &str = include_str!("../cases/http/csv-formula.json");
const LARGE_ANSWER: &str = include_str!("../cases/http/answer-of-10-mb.json");

/// Seven or eight of them were refused with `503 busy`.
#[tokio::test]
async fn sixteen_small_jobs_at_once_wait_for_two_cores() {
    let two_cores = |config: &mut Config| {
        config.cpu = 2;
        config.limits.queue_ms = 60_000;
    };
    let server = Server::start_of(Registry::standard().unwrap(), two_cores).await;
    // Jobs of their own: one result for all would need no second core.
    let jobs = (0..16).map(|number| {
        let mut job: Value = serde_json::from_str(BURST).unwrap();
        job["trials"][0]["roughness_um"] = (2.6 + 0.01 * f64::from(number)).into();
        server.post_to("/v1/machinability-fit", job.to_string()).send()
    });
    for answer in join_all(jobs).await {
        assert_eq!(answer.unwrap().status(), 200);
    }
    server.stop().await;
}

/// It was given up as `crashed_repeatedly`.
#[cfg(unix)]
#[tokio::test]
async fn an_innocent_job_outlives_three_kills() {
    let folder = tempfile::tempdir().unwrap();
    let client = reqwest::Client::new();
    let start = || {
        let data = folder.path().to_str().unwrap();
        let mut child = precut_command(&["serve", "--listen", "127.0.0.1:0", "--data", data]).spawn().unwrap();
        let address = address_of(&mut child);
        (child, address)
    };
    let mut accepted = None;
    for kill in 0..=3_u64 {
        let (mut child, address) = start();
        let job = if let Some(job) = &accepted {
            String::clone(job)
        } else {
            let url = format!("http://{address}/v1/ring-roundness");
            let request = client.post(url).header("content-type", "application/json");
            let answer = request.header("prefer", "respond-async").body(THREE_KILLS).send().await.unwrap();
            assert_eq!(answer.status(), 202);
            accepted.insert(header(&answer, "location").to_owned()).clone()
        };
        let seen = loop {
            let job: Value = client.get(format!("http://{address}{job}")).send().await.unwrap().json().await.unwrap();
            let is_over = job["finished_at"].is_string();
            if is_over || (kill < 3 && job["state"] == "running" && job["attempt"].as_u64() > Some(kill)) {
                break job;
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        };
        assert_eq!(seen["problem"], Value::Null, "{seen:#}");
        assert_eq!(seen["state"] == "succeeded", kill == 3, "it runs whenever it is killed: {seen:#}");
        child.kill().unwrap();
        child.wait().unwrap();
    }
}

/// A spreadsheet would have run its first cell, `=cmd|'/C calc'!A1`.
#[tokio::test]
async fn no_cell_of_a_table_is_a_formula() {
    let server = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    let answer = server.post_to("/v1/feed-schedule", CSV_FORMULA).header("accept", "text/csv").send().await.unwrap();
    let status = answer.status();
    let table = answer.text().await.unwrap();
    assert_eq!(status, 200, "{table}");
    assert!(table.contains("'=cmd|'/C calc'!A1"), "{table}");
    let cells = table.lines().flat_map(|line| line.split(','));
    let is_run = |cell: &str| {
        let text = cell.trim_start_matches('"');
        text.starts_with(['=', '@', '\t', '\r']) || (text.starts_with(['+', '-']) && text.parse::<f64>().is_err())
    };
    assert_eq!(cells.filter(|cell| is_run(cell)).collect::<Vec<_>>(), [""; 0]);
    server.stop().await;
}

/// Sixty like it took 207 MB for thirty days, and nothing said no.
#[tokio::test]
async fn large_answers_are_kept_up_to_a_quota_that_is_said_in_words() {
    let server = Server::start_of(Registry::standard().unwrap(), |config| config.quota.kept_bytes = 2_000_000).await;
    let mut kept = 0;
    let refused = loop {
        let mut job: Value = serde_json::from_str(LARGE_ANSWER).unwrap();
        job["shaft"]["segments"][0]["stock_diameter_mm"] = (62.0 + 0.01 * f64::from(kept)).into();
        let request = server.post_to("/v1/deflection-compensation", job.to_string());
        let answer = request.header("prefer", "respond-async, wait=60").send().await.unwrap();
        match answer.status().as_u16() {
            200 | 202 => kept += 1,
            _ => break answer,
        }
        assert!(kept < 60, "nothing says no");
    };
    assert!(kept >= 1);
    assert!(header(&refused, "ratelimit").contains("kept"), "{:?}", refused.headers());
    let said = problem(refused, 429, "kept_quota").await;
    assert!(said["detail"].as_str().unwrap().contains("MB"), "{said:#}");
    server.stop().await;
}
