//! What the service costs on top of HTTP, against a bare axum handler that answers the same bytes, in turns, from the
//! same client, in the same run. Prints a Markdown table of ratios; asserts nothing, as a noisy machine would.
//!
//!     cargo bench --bench http
//!
//! Two ratios, as they say different things. *Wall time* is what a client sees over one connection, its own work and
//! the kernel's included, and with four connections at once, where every core is busy and the work of the service
//! after its answer counts, too. *Server CPU* is the time on a core of all threads but the client's, per request:
//! what is left of the wall time when the client costs nothing.

#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::cast_precision_loss, missing_docs)]

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

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

const CALCULATOR: &str = "deflection-compensation";
const ROUTE: &str = "/v1/deflection-compensation";
/// The number that makes every job another one, without making the work another.
const VARIED: &str = "/carriage/compliance_um_per_n";
const ROUNDS: usize = 9;
/// Connections at once.
const CONNECTIONS: usize = 4;
/// As `precut serve` has.
const IO_THREADS: usize = 2;

fn main() {
    // `cargo test` runs benches, too; a look is enough there.
    let count = if std::env::args().any(|argument| argument == "--bench") { 1200 } else { 20 };
    // A log as it is by default, to nowhere.
    tracing_subscriber::fmt().with_env_filter("info").with_writer(std::io::sink).init();
    let folder = tempfile::tempdir().unwrap();
    let address = service(folder.path().to_owned());
    for (name, detail) in [("profile", "profile"), ("full answer", "full")] {
        measure(name, &Jobs::new(detail), address, count);
    }
}

/// Compares one kind of job in turns: bare, cached, fresh.
fn measure(name: &str, jobs: &Jobs, address: SocketAddr, count: usize) {
    let mut service = Client::new(address);
    let answer = service.post(&jobs.nth(0));
    let bare_address = bare_handler(answer.clone());
    let mut bare = Client::new(bare_address);
    assert_eq!(bare.post(&jobs.nth(0)), answer);
    let size = (jobs.nth(0).len(), answer.len());

    let mut sent = 0;
    let mut next = || {
        sent += 1;
        jobs.nth(sent)
    };
    for _ in 0..count / 4 {
        service.post(&next());
        bare.post(&next());
    }
    let (mut one, mut four) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        one.push([
            one_connection(count, &mut bare, &mut next),
            one_connection(count, &mut service, &mut || jobs.nth(0)),
            one_connection(count, &mut service, &mut next),
        ]);
        four.push([
            connections(count, bare_address, &mut next),
            connections(count, address, &mut || jobs.nth(0)),
            connections(count, address, &mut next),
        ]);
    }
    service.post(&next());
    println!("\n{name}: job {} bytes, answer {} bytes; one fresh answer: {}\n", size.0, size.1, service.timing);
    println!("| per request | bare axum | cached answer | fresh answer |");
    println!("|---|---|---|---|");
    print("one connection, wall time", &one, |cost| cost.wall_us);
    print("one connection, server CPU", &one, |cost| cost.server_us);
    print("four connections, wall time", &four, |cost| cost.wall_us);
    print("four connections, server CPU", &four, |cost| cost.server_us);
    // Under such a load the store turns away what it cannot write at its leisure.
    let turned_away = service.metric("precut_store_failures_total{operation=\"queue\"}");
    let computed = service.metric("precut_calculations_total");
    println!("\nSo far {turned_away} of {computed} results were too many to be kept.");
}

/// Per request, µs.
#[derive(Clone, Copy)]
struct Cost {
    wall_us: f64,
    server_us: f64,
}

/// The median of the rounds, and the median of the ratios within each round.
fn print(what: &str, rounds: &[[Cost; 3]], part: fn(&Cost) -> f64) {
    let column = |index: usize| median(rounds.iter().map(|round| part(&round[index])).collect());
    let ratio = |index: usize| median(rounds.iter().map(|round| part(&round[index]) / part(&round[0])).collect());
    println!(
        "| {what} | {:.1} µs | {:.1} µs, {:.2} x | {:.1} µs, {:.2} x |",
        column(0),
        column(1),
        ratio(1),
        column(2),
        ratio(2)
    );
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// One request after the other.
fn one_connection(count: usize, client: &mut Client, next: &mut dyn FnMut() -> String) -> Cost {
    let jobs: Vec<String> = (0..count).map(|_| next()).collect();
    let (process, thread, wall) = (ProcessTime::now(), ThreadTime::now(), Instant::now());
    for job in &jobs {
        client.exchange(job);
    }
    cost(count, wall.elapsed(), process.elapsed().saturating_sub(thread.elapsed()))
}

/// As many requests over several connections at once, each with a client thread of its own.
fn connections(count: usize, address: SocketAddr, next: &mut dyn FnMut() -> String) -> Cost {
    let jobs: Vec<String> = (0..count).map(|_| next()).collect();
    let clients: Vec<Client> = (0..CONNECTIONS).map(|_| Client::new(address)).collect();
    let (process, wall) = (ProcessTime::now(), Instant::now());
    let of_clients: Duration = std::thread::scope(|scope| {
        let threads: Vec<_> = clients
            .into_iter()
            .zip(jobs.chunks(count.div_ceil(CONNECTIONS)))
            .map(|(mut client, jobs)| {
                scope.spawn(move || {
                    let thread = ThreadTime::now();
                    for job in jobs {
                        client.exchange(job);
                    }
                    thread.elapsed()
                })
            })
            .collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).sum()
    });
    cost(count, wall.elapsed(), process.elapsed().saturating_sub(of_clients))
}

fn cost(count: usize, wall: Duration, server: Duration) -> Cost {
    let us = |time: Duration| time.as_secs_f64() * 1e6 / count as f64;
    Cost { wall_us: us(wall), server_us: us(server) }
}

/// The example job, each time with another digit in one number.
struct Jobs(serde_json::Value);

impl Jobs {
    fn new(detail: &str) -> Self {
        let registry = Registry::standard().unwrap();
        let example = registry.entry(CALCULATOR).unwrap().meta().examples[0].job;
        let mut job: serde_json::Value = serde_json::from_str(example).unwrap();
        job["detail"] = detail.into();
        job["stations"] = serde_json::json!({ "kind": "per_zone", "count": 201 });
        assert!(job.pointer(VARIED).is_some(), "the example has no {VARIED}");
        Self(job)
    }

    fn nth(&self, count: u32) -> String {
        let mut job = self.0.clone();
        let number = job.pointer_mut(VARIED).unwrap();
        *number = (number.as_f64().unwrap() * (1.0 + 1e-8 * f64::from(count))).into();
        job.to_string()
    }
}

/// Runs a server on threads of its own.
fn in_threads<F: Future<Output = ()>>(server: impl FnOnce(TcpListener) -> F + Send + 'static) -> SocketAddr {
    let (send, receive) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(IO_THREADS).enable_all().build();
        runtime.unwrap().block_on(async {
            let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
            send.send(listener.local_addr().unwrap()).unwrap();
            server(listener).await;
        });
    });
    receive.recv().unwrap()
}

fn service(folder: std::path::PathBuf) -> SocketAddr {
    in_threads(move |listener| async move {
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
    in_threads(|listener| async move {
        axum::serve(listener, Router::new().route(ROUTE, post(handler))).await.unwrap();
    })
}

/// A client with one connection, as lean as can be.
struct Client {
    stream: TcpStream,
    request: Vec<u8>,
    buffer: Vec<u8>,
    /// `Server-Timing` of the last answer.
    timing: String,
}

impl Client {
    fn new(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_nodelay(true).unwrap();
        Self { stream, request: Vec::new(), buffer: vec![0; 1 << 20], timing: String::new() }
    }

    fn post(&mut self, job: &str) -> Vec<u8> {
        let (begin, end) = self.exchange(job);
        self.buffer[begin..end].to_vec()
    }

    /// Where in the buffer the answer's body stands.
    fn exchange(&mut self, job: &str) -> (usize, usize) {
        self.request.clear();
        write!(
            self.request,
            "POST {ROUTE} HTTP/1.1\r\nHost: bench\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n{job}",
            job.len()
        )
        .unwrap();
        self.send()
    }

    /// The sum of the lines of `/metrics` that begin so.
    fn metric(&mut self, name: &str) -> f64 {
        self.request = b"GET /metrics HTTP/1.1\r\nHost: bench\r\n\r\n".to_vec();
        let (begin, end) = self.send();
        let text = String::from_utf8_lossy(&self.buffer[begin..end]);
        let lines = text.lines().filter(|line| line.starts_with(name));
        lines.filter_map(|line| line.rsplit(' ').next()?.parse::<f64>().ok()).sum()
    }

    /// Sends the request and reads the answer.
    fn send(&mut self) -> (usize, usize) {
        self.stream.write_all(&self.request).unwrap();
        let mut filled = 0;
        let head = loop {
            filled += self.stream.read(&mut self.buffer[filled..]).unwrap();
            if let Some(end) = self.buffer[..filled].windows(4).position(|bytes| bytes == b"\r\n\r\n") {
                break end + 4;
            }
        };
        let text = String::from_utf8_lossy(&self.buffer[..head]).to_lowercase();
        assert!(text.starts_with("http/1.1 200"), "{}", String::from_utf8_lossy(&self.buffer[..filled]));
        let field = |name| text.split(name).nth(1).and_then(|rest| rest.lines().next()).unwrap_or_default().trim();
        let length: usize = field("content-length: ").parse().unwrap();
        field("server-timing: ").clone_into(&mut self.timing);
        self.stream.read_exact(&mut self.buffer[filled..head + length]).unwrap();
        (head, head + length)
    }
}
