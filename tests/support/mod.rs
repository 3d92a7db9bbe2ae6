//! Starts the service for a test: in this process on a free port, or as a process of its own.

pub mod toy;

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use precut::config::Config;
use precut::engine::{Engine, EngineSettings};
use precut::http::{self, App};
use precut::registry::Registry;
use reqwest::{Client, RequestBuilder, Response};
use serde_json::Value;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio::task::JoinHandle;

/// A running service with the toy calculator and a database of its own.
pub struct Server {
    pub address: SocketAddr,
    /// Where it answers for health and metrics alone, if it was set.
    pub admin: Option<SocketAddr>,
    pub client: Client,
    stop: watch::Sender<bool>,
    task: JoinHandle<()>,
    _data: TempDir,
}

impl Server {
    /// With the default settings.
    pub async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    /// With settings of the test's own.
    pub async fn start_with(adjust: impl FnOnce(&mut Config)) -> Self {
        Self::start_of(toy::registry(), adjust).await
    }

    /// With the calculators of a registry.
    pub async fn start_of(registry: Registry, adjust: impl FnOnce(&mut Config)) -> Self {
        let data = tempfile::tempdir().expect("a folder for temporary files");
        let mut config = Config::default();
        adjust(&mut config);
        config.data = data.path().to_owned();
        let settings = EngineSettings::of(&config);
        let engine = Engine::open(registry, settings).await.expect("an empty folder");
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        let admin = match config.admin_listen {
            Some(address) => Some(TcpListener::bind(address).await.expect("a free port")),
            None => None,
        };
        let admin_address = admin.as_ref().map(|admin| admin.local_addr().expect("it is bound"));
        let app = App::new(engine.clone(), &config);
        let (stop, stopped) = watch::channel(false);
        let task = tokio::spawn(async move {
            let left = http::serve(listener, admin, app, stopped, Duration::from_mins(1)).await;
            engine.close(left).await;
        });
        Self {
            address,
            admin: admin_address,
            client: Client::builder().no_gzip().no_brotli().build().expect("a plain client"),
            stop,
            task,
            _data: data,
        }
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    pub fn get(&self, path: &str) -> RequestBuilder {
        self.client.get(self.url(path))
    }

    /// A job for the toy.
    pub fn post(&self, job: impl Into<reqwest::Body>) -> RequestBuilder {
        self.post_to(&format!("/v1/{}", toy::BAR), job)
    }

    pub fn post_to(&self, path: &str, job: impl Into<reqwest::Body>) -> RequestBuilder {
        self.client.post(self.url(path)).header("content-type", "application/json").body(job)
    }

    /// Asks it to stop, and waits until it has.
    pub async fn stop(self) {
        self.stop.send_replace(true);
        self.task.await.expect("the server ends in good order");
    }
}

/// A header of an answer, empty if it is absent.
pub fn header<'r>(response: &'r Response, name: &str) -> &'r str {
    response.headers().get(name).map_or("", |value| value.to_str().expect("headers are text"))
}

/// The problem document in an answer, after checking what holds for all of them.
pub async fn problem(response: Response, status: u16, code: &str) -> Value {
    let id = header(&response, "x-request-id").to_owned();
    let (got, kind) = (response.status().as_u16(), header(&response, "content-type").to_owned());
    let text = response.text().await.expect("a body");
    assert_eq!(got, status, "{text}");
    assert_eq!(kind, "application/problem+json", "{text}");
    let document: Value = serde_json::from_str(&text).expect("a problem document");
    assert_eq!(document["code"], code, "{text}");
    assert_eq!(document["type"], format!("/problems/{code}"));
    assert_eq!(document["status"], status);
    assert_eq!(document["instance"], id.as_str());
    for part in ["title", "detail"] {
        assert!(document[part].as_str().is_some_and(|words| !words.is_empty()), "{part} in {text}");
    }
    let listed = document["errors"].as_array().expect("faults").len();
    assert!(document["errors_total"].as_u64().expect("a number") >= listed as u64);
    document
}

/// Name of the test that is the service with the toy, when it is asked for by [`toy_command`].
const CHILD: &str = "process::child_process";

/// `precut` with the toy calculator, as a process: this test binary run again.
pub fn toy_command(arguments: &[&str]) -> Command {
    let mut command = piped(&std::env::current_exe().expect("a running test has a file"));
    command.args(["--exact", CHILD, "--ignored", "--nocapture", "--quiet"]);
    command.env("TOY_ARGUMENTS", arguments.join("\n"));
    command
}

/// The shipped program.
#[allow(dead_code)] // not every program of tests runs it
pub fn precut_command(arguments: &[&str]) -> Command {
    let mut command = piped(Path::new(env!("CARGO_BIN_EXE_precut")));
    command.args(arguments);
    command
}

/// A program that the settings of whoever runs the tests do not reach, with nothing to read and its outputs piped.
fn piped(program: &Path) -> Command {
    let mut command = Command::new(program);
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("PRECUT_")) {
        command.env_remove(name);
    }
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// What [`toy_command`] runs.
pub fn be_child() {
    let Ok(arguments) = std::env::var("TOY_ARGUMENTS") else { return };
    let arguments = std::iter::once("precut").chain(arguments.lines()).map(Into::into);
    // What it starts for a job is this test of this binary again.
    let again = toy_command(&[precut::cli::COMPUTE]);
    let isolation = precut::engine::Isolation {
        program: again.get_program().into(),
        arguments: again.get_args().map(Into::into).collect(),
        environment: vec![("TOY_ARGUMENTS".into(), precut::cli::COMPUTE.into())],
    };
    let code = precut::cli::main_as(arguments, || Ok(toy::registry()), Some(isolation));
    // `ExitCode` does not tell its number; it is 0 or not.
    std::process::exit(i32::from(code != std::process::ExitCode::SUCCESS));
}

/// A service as a process.
pub struct Process {
    pub child: Child,
    pub address: SocketAddr,
    pub folder: PathBuf,
    data: Option<TempDir>,
}

impl Process {
    /// Starts it with a database of its own.
    pub fn start() -> Self {
        let data = tempfile::tempdir().expect("a folder for temporary files");
        let mut process = Self::start_in(data.path());
        process.data = Some(data);
        process
    }

    /// Starts it and waits until it says where it listens.
    pub fn start_in(data: &Path) -> Self {
        Self::start_with(data, &[])
    }

    /// The same with settings in its environment.
    pub fn start_with(data: &Path, settings: &[(&str, &str)]) -> Self {
        Self::try_start_with(data, settings).expect("it says where it listens")
    }

    /// The same for a service that may die of its jobs before it says anything.
    pub fn try_start_with(data: &Path, settings: &[(&str, &str)]) -> Option<Self> {
        let folder = data.to_str().expect("a plain name");
        let mut child = toy_command(&["serve", "--listen", "127.0.0.1:0", "--data", folder])
            .envs(settings.iter().copied())
            .spawn()
            .expect("this binary runs");
        let address = said_address(&mut child).ok()?;
        Some(Self { child, address, folder: data.to_owned(), data: None })
    }

    /// Sends a signal by its name.
    pub fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        let status = Command::new("kill").args(["-s", name, &id]).status().expect("kill is there");
        assert!(status.success());
    }

    /// Waits for its end, at most for so long; its exit code.
    pub fn wait(&mut self, at_most: Duration) -> Option<i32> {
        let start = std::time::Instant::now();
        while start.elapsed() < at_most {
            if let Some(status) = self.child.try_wait().expect("it is a child") {
                return status.code();
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        None
    }
}

/// Where a service that was just started, its output piped, listens, by its own word.
#[allow(dead_code)] // not every program of tests starts one by itself
pub fn address_of(child: &mut Child) -> SocketAddr {
    said_address(child).expect("it says where it listens")
}

/// The same, or how the service ended and what it complained of.
fn said_address(child: &mut Child) -> Result<SocketAddr, String> {
    use std::io::{BufRead, BufReader, Read};
    let complaints = child.stderr.take().map(|mut pipe| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            let _ = pipe.read_to_end(&mut bytes);
            String::from_utf8_lossy(&bytes).into_owned()
        })
    });
    let mut lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
    let address = lines
        .by_ref()
        .map_while(Result::ok)
        .find_map(|line| line.split_once("listens on http://").map(|(_, address)| address.trim().to_owned()));
    let Some(address) = address else {
        let status = child.wait().expect("it is a child");
        let said = complaints.and_then(|thread| thread.join().ok()).unwrap_or_default();
        return Err(format!("{status}: {said}"));
    };
    // Whatever else it prints has to go somewhere.
    std::thread::spawn(move || lines.for_each(drop));
    Ok(address.parse().expect("an address"))
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
