//! A service as a process, and what can be asked of it from outside.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use reqwest::{Client, Method, RequestBuilder, Response};
use serde_json::Value;
use sqlx::Connection;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};

use crate::support::{Process, header, toy, toy_command};

/// Longer than anything takes on a busy machine; whoever waits so long has found a fault.
pub const PATIENCE: Duration = Duration::from_mins(10);

/// A service with the toy calculator.
pub struct Service {
    pub process: Process,
    pub client: Client,
}

impl Service {
    /// Starts it in a folder, with settings from the environment, and waits until it is ready.
    pub async fn start(folder: &Path, settings: &[(&str, &str)]) -> Self {
        let process = Process::start_with(folder, settings);
        let client = Client::builder().no_gzip().no_brotli().pool_max_idle_per_host(0).build().unwrap();
        let service = Self { process, client };
        until("readiness", async || {
            let response = service.client.get(service.url("/health/ready")).send().await.ok()?;
            (response.status() == 200).then_some(())
        })
        .await;
        service
    }

    /// The same for a service that may die of what it takes up first.
    pub fn try_start(folder: &Path, settings: &[(&str, &str)]) -> Option<Self> {
        let process = Process::try_start_with(folder, settings)?;
        let client = Client::builder().no_gzip().no_brotli().pool_max_idle_per_host(0).build().unwrap();
        Some(Self { process, client })
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.process.address)
    }

    pub fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.client.request(method, self.url(path)).timeout(PATIENCE)
    }

    pub async fn get(&self, path: &str) -> Response {
        self.request(Method::GET, path).send().await.unwrap()
    }

    /// A job for the toy.
    pub fn post(&self, job: &Value) -> RequestBuilder {
        self.post_to(&format!("/v1/{}", toy::BAR), job)
    }

    pub fn post_to(&self, path: &str, job: &Value) -> RequestBuilder {
        self.request(Method::POST, path).header("content-type", "application/json").body(job.to_string())
    }

    /// Sends a job that shall be done behind; its address.
    pub async fn accepted(&self, job: &Value) -> String {
        let response = self.post(job).header("prefer", "respond-async").send().await.unwrap();
        assert_eq!(response.status(), 202, "{}", response.text().await.unwrap());
        header(&response, "location").to_owned()
    }

    pub async fn job(&self, address: &str) -> Value {
        self.get(address).await.json().await.unwrap()
    }

    /// Waits until a job is over.
    pub async fn over(&self, address: &str) -> Value {
        until("the end of a job", async || {
            let job = self.job(address).await;
            job["finished_at"].is_string().then_some(job)
        })
        .await
    }

    /// One figure of /metrics: the sum over all lines that begin so and contain the words.
    pub async fn figure(&self, name: &str, words: &str) -> f64 {
        let text = self.get("/metrics").await.text().await.unwrap();
        let lines = text.lines().filter(|line| line.starts_with(name) && line.contains(words));
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

/// What a start that does not come about says.
pub fn refused_start(folder: &Path) -> (Option<i32>, String) {
    let folder = folder.to_str().unwrap();
    let mut command = toy_command(&["serve", "--listen", "127.0.0.1:0", "--data", folder]);
    let output = command.stdout(Stdio::null()).output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Waits until there is something.
pub async fn until<T>(what: &str, mut look: impl AsyncFnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = look().await {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "waited for {what} in vain");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// A connection of a process of its own to the database of a service.
pub async fn database(folder: &Path) -> SqliteConnection {
    let options = SqliteConnectOptions::new().filename(folder.join("precut.db"));
    SqliteConnection::connect_with(&options.busy_timeout(PATIENCE)).await.unwrap()
}

/// `PRAGMA integrity_check` of a database that nobody uses.
pub async fn assert_intact(folder: &Path) {
    let mut database = database(folder).await;
    let said: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check").fetch_all(&mut database).await.unwrap();
    assert_eq!(said, ["ok"]);
    database.close().await.unwrap();
}
