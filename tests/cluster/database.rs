//! A PostgreSQL of a test's own, and processes over it.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use reqwest::{Client, Method, RequestBuilder, Response, StatusCode};
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Process, header, toy};

/// Longer than anything takes on a busy machine; whoever waits so long has found a fault.
pub const PATIENCE: Duration = Duration::from_mins(3);

/// A database server of its own, gone with the test.
pub struct Database {
    folder: PathBuf,
    /// Removes the folder at the end, where it is the database's own.
    #[allow(dead_code)] // held, never looked at
    own: Option<TempDir>,
    port: u16,
    pub address: String,
}

fn script(arguments: &[&str]) -> Output {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tools/postgres.sh");
    let mut command = Command::new(script);
    // Its own output goes to its log: what it inherits it would hold open.
    command.args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn is_installed() -> bool {
    std::fs::read_dir("/usr/lib/postgresql").is_ok_and(|mut found| found.next().is_some())
        || Command::new("initdb").arg("--version").output().is_ok_and(|output| output.status.success())
}

impl Database {
    /// `None`, with a word, where no PostgreSQL is installed.
    pub fn start() -> Option<Self> {
        Self::start_with(&[])
    }

    /// With settings of its own.
    pub fn start_with(settings: &[&str]) -> Option<Self> {
        let folder = tempfile::Builder::new().prefix("precut-postgres-").tempdir().unwrap();
        let mut database = Self::start_in(folder.path(), settings)?;
        database.own = Some(folder);
        Some(database)
    }

    /// In a folder of the test's.
    pub fn start_in(folder: &Path, settings: &[&str]) -> Option<Self> {
        if !is_installed() {
            assert!(std::env::var("CI").as_deref() != Ok("true"), "no PostgreSQL is installed");
            println!("NOT TESTED: no PostgreSQL is installed; ./test.sh installs one");
            return None;
        }
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let mut database = Self { folder: folder.to_owned(), own: None, port, address: String::new() };
        database.run(settings);
        Some(database)
    }

    fn place(&self) -> &str {
        self.folder.to_str().unwrap()
    }

    fn run(&mut self, settings: &[&str]) {
        let port = self.port.to_string();
        let output = script(&[&["start", self.place(), &port], settings].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().clone_into(&mut self.address);
    }

    pub fn run_again(&mut self) {
        self.run(&[]);
    }

    /// Whether it runs; it may have given up by itself.
    pub fn is_running(&self) -> bool {
        script(&["running", self.place()]).status.success()
    }

    /// `fast`, or `immediate`: as if it were killed.
    pub fn stop(&self, mode: &str) {
        let output = script(&["stop", self.place(), mode]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }

    /// The same with another name, password or database.
    pub fn address_with(&self, from: &str, to: &str) -> String {
        let changed = self.address.replace(from, to);
        assert_ne!(changed, self.address);
        changed
    }

    pub async fn pool(&self) -> sqlx::PgPool {
        sqlx::PgPool::connect(&self.address).await.unwrap()
    }
}

impl Drop for Database {
    fn drop(&mut self) {
        script(&["remove", self.place()]);
    }
}

/// A process of a role.
pub struct Member {
    pub process: Process,
    pub client: Client,
    _data: TempDir,
}

pub fn client() -> Client {
    Client::builder().no_gzip().no_brotli().pool_max_idle_per_host(0).timeout(PATIENCE).build().unwrap()
}

impl Member {
    /// Starts a process and waits until it is ready.
    pub async fn start(database: &Database, role: &str, settings: &[(&str, &str)]) -> Self {
        let data = tempfile::tempdir().unwrap();
        let mut all = vec![("PRECUT_STORE", database.address.as_str()), ("PRECUT_ROLE", role)];
        all.extend_from_slice(settings);
        let process = Process::start_with(data.path(), &all);
        let member = Self { process, client: client(), _data: data };
        until("readiness", async || {
            let response = member.client.get(member.url("/health/ready")).send().await.ok()?;
            (response.status() == 200).then_some(())
        })
        .await;
        member
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.process.address)
    }

    pub async fn get(&self, path: &str) -> Response {
        self.client.get(self.url(path)).send().await.unwrap()
    }

    pub fn post_to(&self, path: &str, job: &Value) -> RequestBuilder {
        let request = self.client.request(Method::POST, self.url(path));
        request.header("content-type", "application/json").body(job.to_string())
    }

    /// A job for the toy.
    pub fn post(&self, job: &Value) -> RequestBuilder {
        self.post_to(&format!("/v1/{}", toy::BAR), job)
    }

    /// Sends something that shall be done behind, and again while the answer is that the database was too busy for it, as
    /// 503 asks of a client; its address.
    pub async fn accepted(&self, path: &str, job: &Value) -> String {
        until("acceptance", async || {
            let response = self.post_to(path, job).header("prefer", "respond-async").send().await.unwrap();
            if response.status() == StatusCode::SERVICE_UNAVAILABLE {
                tokio::time::sleep(Duration::from_secs(header(&response, "retry-after").parse().unwrap())).await;
                return None;
            }
            let address = header(&response, "location").to_owned();
            assert_eq!(response.status(), StatusCode::ACCEPTED, "{}", response.text().await.unwrap());
            Some(address)
        })
        .await
    }

    pub async fn job(&self, address: &str) -> Value {
        self.get(address).await.json().await.unwrap()
    }

    /// Waits until a job is in a state.
    pub async fn job_in(&self, address: &str, state: &str) -> Value {
        until(state, async || {
            let job = self.job(address).await;
            (job["state"] == state).then_some(job)
        })
        .await
    }

    /// One figure of /metrics: the sum over all lines that begin so.
    pub async fn figure(&self, name: &str) -> f64 {
        let text = self.get("/metrics").await.text().await.unwrap();
        let lines = text.lines().filter(|line| line.starts_with(name));
        lines.filter_map(|line| line.rsplit(' ').next()?.parse::<f64>().ok()).sum()
    }

    /// Ends it at once, as a power cut would.
    pub fn kill(mut self) {
        self.process.child.kill().unwrap();
        self.process.child.wait().unwrap();
    }

    /// Ends it in good order.
    pub fn stop(mut self) {
        self.process.signal("TERM");
        assert_eq!(self.process.wait(PATIENCE), Some(0));
    }
}

/// Waits until there is something.
pub async fn until<T>(what: &str, mut look: impl AsyncFnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = look().await {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "waited for {what} in vain");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
