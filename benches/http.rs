//! What the service costs on top of HTTP: CPU time per request against a bare axum handler that answers the same
//! bytes, in the same run. Prints ratios; asserts nothing, as a noisy machine would.
//!
//!     cargo bench --bench http

#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::cast_precision_loss, missing_docs)]

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use axum::Router;
use axum::http::header::CONTENT_TYPE;
use axum::routing::post;
use bytes::Bytes;
use cpu_time::{ProcessTime, ThreadTime};
use precut::config::Config;
use precut::engine::{Engine, EngineSettings};
use precut::http::{App, serve};
use precut::registry::Registry;
use tokio::net::TcpListener;
use tokio::sync::watch;

const ROUTE: &str = "/v1/deflection-compensation";
const ROUNDS: usize = 7;

fn main() {
    // `cargo test` runs benches, too; a look is enough there.
    let count = if std::env::args().any(|argument| argument == "--bench") { 4000 } else { 20 };
    // A log as it is by default, to nowhere.
    tracing_subscriber::fmt().with_env_filter("info").with_writer(std::io::sink).init();
    let folder = tempfile::tempdir().unwrap();
    let address = service(folder.path().to_owned());
    let job = example();
    let mut client = Client::new(address);
    let answer = client.post(&job);
    let bare = bare_handler(answer.clone());
    let mut bare = Client::new(bare);
    assert_eq!(bare.post(&job), answer);
    println!("job {} bytes, answer {} bytes", job.len(), answer.len());

    let mut fresh = Fresh { job, count: 0 };
    for _ in 0..count / 10 {
        client.post(&fresh.next());
        bare.post(&fresh.job);
    }
    let (mut cached_us, mut bare_us, mut fresh_us) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let same = fresh.job.clone();
        bare_us.push(cost_us(count, || drop(bare.post(&same))));
        cached_us.push(cost_us(count, || drop(client.post(&same))));
        fresh_us.push(cost_us(count / 4, || drop(client.post(&fresh.next()))));
    }
    let (bare_us, cached_us, fresh_us) = (median(bare_us), median(cached_us), median(fresh_us));
    client.post(&fresh.next());
    println!("fresh answer, one: {}", client.timing);
    println!("bare handler  {bare_us:8.1} us");
    println!("cached answer {cached_us:8.1} us  {:6.2} x", cached_us / bare_us);
    println!("fresh answer  {fresh_us:8.1} us  {:6.2} x", fresh_us / bare_us);
}

/// CPU time of everything but this thread, per request.
fn cost_us(count: usize, mut request: impl FnMut()) -> f64 {
    let (process, client) = (ProcessTime::now(), ThreadTime::now());
    for _ in 0..count {
        request();
    }
    process.elapsed().saturating_sub(client.elapsed()).as_secs_f64() * 1e6 / count as f64
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn example() -> String {
    let registry = Registry::standard().unwrap();
    let job = registry.entry("deflection-compensation").unwrap().meta().examples[0].job;
    serde_json::from_str::<serde_json::Value>(job).unwrap().to_string()
}

/// Jobs that were never asked before.
struct Fresh {
    job: String,
    count: u32,
}

impl Fresh {
    fn next(&mut self) -> String {
        let mut job: serde_json::Value = serde_json::from_str(&self.job).unwrap();
        self.count += 1;
        job["cut"]["feed_mm_per_rev"] = (0.3 + 1e-6 * f64::from(self.count)).into();
        job.to_string()
    }
}

/// Runs a server in a thread of its own.
fn in_thread<F: Future<Output = ()>>(server: impl FnOnce(TcpListener) -> F + Send + 'static) -> SocketAddr {
    let (send, receive) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
            send.send(listener.local_addr().unwrap()).unwrap();
            server(listener).await;
        });
    });
    receive.recv().unwrap()
}

fn service(folder: std::path::PathBuf) -> SocketAddr {
    in_thread(move |listener| async move {
        let engine = Engine::open(Registry::standard().unwrap(), EngineSettings::in_folder(folder)).await.unwrap();
        let (_stop, stopped) = watch::channel(false);
        serve(listener, App::new(engine, &Config::default()), stopped, Duration::ZERO).await;
    })
}

fn bare_handler(answer: Vec<u8>) -> SocketAddr {
    let answer = Bytes::from(answer);
    let handler = move |_job: Bytes| {
        let answer = answer.clone();
        async move { ([(CONTENT_TYPE, "application/json")], answer) }
    };
    in_thread(|listener| async move {
        axum::serve(listener, Router::new().route(ROUTE, post(handler))).await.unwrap();
    })
}

/// A client with one connection, as lean as can be.
struct Client {
    stream: TcpStream,
    buffer: Vec<u8>,
    /// `Server-Timing` of the last answer.
    timing: String,
}

impl Client {
    fn new(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_nodelay(true).unwrap();
        Self { stream, buffer: vec![0; 1 << 20], timing: String::new() }
    }

    fn post(&mut self, job: &str) -> Vec<u8> {
        let request = format!(
            "POST {ROUTE} HTTP/1.1\r\nHost: bench\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n{job}",
            job.len()
        );
        self.stream.write_all(request.as_bytes()).unwrap();
        let mut filled = 0;
        loop {
            filled += self.stream.read(&mut self.buffer[filled..]).unwrap();
            let got = &self.buffer[..filled];
            let Some(end) = got.windows(4).position(|bytes| bytes == b"\r\n\r\n") else { continue };
            let head = String::from_utf8_lossy(&got[..end]).to_lowercase();
            assert!(head.starts_with("http/1.1 200"), "{}", String::from_utf8_lossy(got));
            let timing = head.split("server-timing: ").nth(1).and_then(|rest| rest.lines().next());
            timing.unwrap_or_default().clone_into(&mut self.timing);
            let length: usize =
                head.split("content-length: ").nth(1).unwrap().lines().next().unwrap().trim().parse().unwrap();
            if filled == end + 4 + length {
                return got[end + 4..].to_vec();
            }
        }
    }
}
