//! The service as a process of its own, beside a bare axum handler that answers with the same bytes.
//!
//! Both get the same requests from the same client over one kept connection, in turns. Compared is the CPU time that
//! each server's threads take, from the system's own count, with all that goes on behind the answers; or the time that
//! the client waits. Client and servers share the machine, so what the client itself takes is in the latter for both.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Bytes;
use axum::http::header::CONTENT_TYPE;
use serde_json::Value;

use crate::measure::Measured;

const PRECUT: &str = env!("CARGO_BIN_EXE_precut");
/// Names the file whose bytes the bare server answers with; tells this program that it is that server.
const BARE: &str = "PRECUT_BENCH_BARE";
/// What the bare server does for its answer.
const WORK: &str = "PRECUT_BENCH_WORK";
const ROUNDS: usize = 15;
/// After the requests of a turn both servers rest so long: what goes on behind the answers of the one neither takes a
/// core from the other nor lets it and its client share one, and counts where it belongs.
const REST: Duration = Duration::from_millis(400);

/// What is asked, and whether each time the same.
pub(crate) struct Exchange {
    pub(crate) path: String,
    /// The body of the n-th request; the first is asked once before, so that equal ones are cached.
    pub(crate) body: Box<dyn Fn(usize) -> Vec<u8> + Sync>,
}

/// What a bare handler does between a request and its answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bare {
    /// Takes the body in and sends bytes from memory.
    Sends,
    /// Parses the body as JSON and sends bytes from memory.
    Parses,
    /// Parses the body as JSON and writes the answer as JSON, number by number.
    Writes,
}

impl Bare {
    const ALL: [(Self, &str); 3] = [(Self::Sends, "sends"), (Self::Parses, "parses"), (Self::Writes, "writes")];

    fn word(self) -> &'static str {
        Self::ALL.iter().find(|(bare, _)| *bare == self).map_or("", |(_, word)| word)
    }
}

/// What is compared.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Clock {
    /// Time on a core of all threads of the server.
    ServerCpu,
    /// From the first byte of a request to the last of its answer.
    Wait,
    /// The same in turns so long that what is kept behind the first answers is written while the later ones are waited
    /// for.
    SustainedWait,
}

impl Clock {
    /// Requests in one turn.
    fn requests(self) -> usize {
        match self {
            Self::ServerCpu | Self::Wait => 300,
            Self::SustainedWait => 1500,
        }
    }
}

/// What a request costs, as a multiple of what it costs with the bare handler.
pub(crate) fn ratio(exchange: &Exchange, bare: Bare, clock: Clock) -> Result<Measured, String> {
    let folder = tempfile::tempdir().map_err(fault)?;
    let service = Server::precut(folder.path())?;
    let mut to_service = Client::connect(&service.address)?;
    let answer = to_service.post(&exchange.path, &(exchange.body)(0))?;
    let file = folder.path().join("answer");
    std::fs::write(&file, &answer).map_err(fault)?;
    let bare = Server::bare(&file, bare)?;
    let mut to_bare = Client::connect(&bare.address)?;

    let mut sent = 0;
    let mut block = |client: &mut Client, server: &Server| -> Result<f64, String> {
        // The client makes its requests before the clock runs.
        let bodies: Vec<Vec<u8>> = (0..clock.requests()).map(|number| (exchange.body)(sent + number + 1)).collect();
        sent += bodies.len();
        let (before, begun) = (server.cpu_time()?, Instant::now());
        for body in &bodies {
            client.post(&exchange.path, body)?;
        }
        let waited = begun.elapsed().as_secs_f64();
        std::thread::sleep(REST);
        Ok(match clock {
            Clock::ServerCpu => server.cpu_time()? - before,
            Clock::Wait | Clock::SustainedWait => waited,
        })
    };
    block(&mut to_service, &service)?;
    block(&mut to_bare, &bare)?;
    let mut ratios = Vec::new();
    for _ in 0..ROUNDS {
        ratios.push(block(&mut to_service, &service)? / block(&mut to_bare, &bare)?);
    }
    Measured::of(ratios)
}

/// Wall time from the start of the process to its first computed answer.
pub(crate) fn start(path: &str, body: &[u8]) -> Result<Measured, String> {
    let times: Result<Vec<f64>, String> = (0..7)
        .map(|_| {
            let folder = tempfile::tempdir().map_err(fault)?;
            let start = Instant::now();
            let service = Server::precut(folder.path())?;
            Client::connect(&service.address)?.post(path, body)?;
            Ok(start.elapsed().as_secs_f64())
        })
        .collect();
    Measured::of(times?)
}

/// Requests timed under load.
const PROBES: usize = 300;
/// Pause between them: the load is not to be theirs.
const PAUSE: Duration = Duration::from_millis(10);

/// Wall time of one request after another while every core computes for others: the slowest one of a hundred, with the
/// median and the slowest of all as its spread. `load` are jobs that keep a core for some hundred milliseconds each.
pub(crate) fn latency_under_load(probe: &Exchange, load: &Exchange) -> Result<Measured, String> {
    let folder = tempfile::tempdir().map_err(fault)?;
    let service = Server::precut(folder.path())?;
    let done = AtomicBool::new(false);
    let (computed, times) = std::thread::scope(|scope| {
        // Twice as many as there are cores, each with the next job as soon as it has the answer to the last.
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let bodies: Vec<Vec<Vec<u8>>> = (0..2 * cores)
            .map(|lane| (0..LOAD).map(|count| (load.body)(1 + lane + 2 * cores * count)).collect())
            .collect();
        let (service, done, path) = (&service, &done, &load.path);
        let lanes: Vec<_> = bodies
            .into_iter()
            .map(|bodies| {
                scope.spawn(move || -> Result<usize, String> {
                    let mut client = Client::connect(&service.address)?;
                    let mut count = 0;
                    for body in bodies.iter().cycle() {
                        if done.load(Ordering::Relaxed) {
                            break;
                        }
                        let (status, _) = client.send("POST", path, body)?;
                        count += usize::from(status.contains(" 200 "));
                    }
                    Ok(count)
                })
            })
            .collect();
        let times = probes(service, probe);
        done.store(true, Ordering::Relaxed);
        let computed: Result<Vec<usize>, String> =
            lanes.into_iter().map(|lane| lane.join().map_err(|_| "a client ended".to_owned())?).collect();
        (computed, times)
    });
    let (computed, mut times) = (computed?.iter().sum::<usize>(), times?);
    if computed < 4 {
        return Err(format!("only {computed} jobs were computed meanwhile"));
    }
    times.sort_by(f64::total_cmp);
    let at = |share: usize| times[(times.len() - 1) * share / 100];
    Ok(Measured { median: at(99), low: at(50), high: at(100) })
}

/// Different jobs of the load; more of them would be prepared than asked for.
const LOAD: usize = 200;

fn probes(service: &Server, probe: &Exchange) -> Result<Vec<f64>, String> {
    // The load has to be there first.
    std::thread::sleep(Duration::from_millis(500));
    let mut client = Client::connect(&service.address)?;
    (0..PROBES)
        .map(|count| {
            std::thread::sleep(PAUSE);
            let body = (probe.body)(count);
            let start = Instant::now();
            let (status, _) = client.send(if body.is_empty() { "GET" } else { "POST" }, &probe.path, &body)?;
            let took = start.elapsed().as_secs_f64();
            if status.contains(" 200 ") { Ok(took) } else { Err(format!("{}: {status}", probe.path)) }
        })
        .collect()
}

/// Resident memory after the start, before any request.
pub(crate) fn idle_memory() -> Result<Measured, String> {
    let folder = tempfile::tempdir().map_err(fault)?;
    let service = Server::precut(folder.path())?;
    std::thread::sleep(Duration::from_millis(300));
    let status = std::fs::read_to_string(format!("/proc/{}/status", service.child.id())).map_err(fault)?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).ok_or("no VmRSS")?;
    let kib: f64 = line.trim().trim_end_matches(" kB").parse().map_err(fault)?;
    Measured::of(vec![kib * 1024.0])
}

/// Of the program that this run was built with.
pub(crate) fn binary_size() -> Result<Measured, String> {
    let bytes = std::fs::metadata(PRECUT).map_err(fault)?.len();
    Measured::of(vec![u32::try_from(bytes).map_or(f64::INFINITY, f64::from)])
}

/// The first example job of a calculator.
pub(crate) fn example(calculator: &str) -> Result<Value, String> {
    let run = Command::new(PRECUT).args(["example", calculator, "--job"]).output().map_err(fault)?;
    if !run.status.success() {
        return Err(format!("there is no example of {calculator}"));
    }
    serde_json::from_slice(&run.stdout).map_err(fault)
}

/// The job with one number a little larger each time: never the same job twice, never another size.
pub(crate) fn varied(job: &Value, pointer: &str, count: usize) -> Vec<u8> {
    let mut job = job.clone();
    if let Some(number) = job.pointer_mut(pointer) {
        let step = u32::try_from(count).map_or(0.0, f64::from);
        *number = (number.as_f64().unwrap_or(1.0) * (1.0 + 1e-9 * step)).into();
    }
    job.to_string().into_bytes()
}

/// A server process; ends with this value.
struct Server {
    child: Child,
    address: String,
}

impl Server {
    fn precut(data: &Path) -> Result<Self, String> {
        let mut command = Command::new(PRECUT);
        command.args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(data.join("data"));
        Self::spawn(command)
    }

    fn bare(answer: &Path, bare: Bare) -> Result<Self, String> {
        let mut command = Command::new(std::env::current_exe().map_err(fault)?);
        command.env(BARE, answer).env(WORK, bare.word());
        Self::spawn(command)
    }

    fn spawn(mut command: Command) -> Result<Self, String> {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().map_err(fault)?;
        let mut said = BufReader::new(child.stdout.take().ok_or("no output")?).lines();
        let address =
            said.find_map(|line| line.ok()?.split_once("listens on http://").map(|(_, rest)| rest.to_owned()));
        let server = Self { child, address: address.unwrap_or_default() };
        // The rest of what it says goes nowhere, but must not block it.
        std::thread::spawn(move || said.for_each(drop));
        if server.address.is_empty() { Err("a server did not start".to_owned()) } else { Ok(server) }
    }

    /// Seconds on a core so far, of all threads.
    fn cpu_time(&self) -> Result<f64, String> {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.child.id())).map_err(fault)?;
        let mut seconds = 0.0;
        for task in tasks {
            let text = std::fs::read_to_string(task.map_err(fault)?.path().join("schedstat")).map_err(fault)?;
            let ns: f64 = text.split(' ').next().unwrap_or_default().parse().map_err(fault)?;
            seconds += ns * 1e-9;
        }
        Ok(seconds)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// One kept connection.
struct Client {
    stream: BufReader<TcpStream>,
    host: String,
}

impl Client {
    fn connect(address: &str) -> Result<Self, String> {
        let stream = TcpStream::connect(address).map_err(fault)?;
        stream.set_nodelay(true).map_err(fault)?;
        Ok(Self { stream: BufReader::new(stream), host: address.to_owned() })
    }

    /// The body of the answer, which must be 200.
    fn post(&mut self, path: &str, body: &[u8]) -> Result<Vec<u8>, String> {
        let (status, answer) = self.send("POST", path, body)?;
        if status.contains(" 200 ") { Ok(answer) } else { Err(format!("{path}: {status}")) }
    }

    /// The first line of the answer, and its body.
    fn send(&mut self, method: &str, path: &str, body: &[u8]) -> Result<(String, Vec<u8>), String> {
        let head = format!(
            "{method} {path} HTTP/1.1\r\nhost: {}\r\ncontent-type: application/json\r\naccept: application/json\r\n\
             content-length: {}\r\n\r\n",
            self.host,
            body.len()
        );
        let request = [head.as_bytes(), body].concat();
        self.stream.get_mut().write_all(&request).map_err(fault)?;
        let mut line = String::new();
        self.stream.read_line(&mut line).map_err(fault)?;
        let status = line.trim_end().to_owned();
        let mut length = None;
        loop {
            line.clear();
            self.stream.read_line(&mut line).map_err(fault)?;
            if line.trim_end().is_empty() {
                break;
            }
            let header = line.to_ascii_lowercase();
            length = header.strip_prefix("content-length:").map_or(length, |number| number.trim().parse().ok());
        }
        let mut answer = vec![0; length.ok_or("an answer without a length")?];
        self.stream.read_exact(&mut answer).map_err(fault)?;
        Ok((status, answer))
    }
}

fn fault(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// Whether this process was started to be the bare server.
pub(crate) fn is_bare_server() -> bool {
    std::env::var_os(BARE).is_some()
}

/// Answers every request with the bytes of the file, after the work that is asked for.
pub(crate) fn serve_bare() -> io::Result<()> {
    let answer = Bytes::from(std::fs::read(std::env::var_os(BARE).unwrap_or_default())?);
    let numbers: Value = serde_json::from_slice(&answer).unwrap_or_default();
    let work = std::env::var(WORK).unwrap_or_default();
    let work = Bare::ALL.iter().find(|(_, word)| *word == work).map_or(Bare::Sends, |(bare, _)| *bare);
    let handler = move |body: Bytes| {
        let is_job = work == Bare::Sends || serde_json::from_slice::<Value>(&body).is_ok_and(|job| job.is_object());
        let body = match work {
            _ if !is_job => Bytes::new(),
            Bare::Writes => serde_json::to_vec(&numbers).unwrap_or_default().into(),
            Bare::Sends | Bare::Parses => answer.clone(),
        };
        std::future::ready(([(CONTENT_TYPE, "application/json")], body))
    };
    // As many threads as the service has for its connections.
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?.block_on(async {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await?;
        writeln!(io::stdout(), "listens on http://{}", listener.local_addr()?)?;
        axum::serve(listener, Router::new().fallback(handler)).await
    })
}
