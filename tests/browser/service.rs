//! The whole service with its own calculators, on a free port of this machine, while a test lives.

use std::net::SocketAddr;
use std::sync::LazyLock;
use std::thread::JoinHandle;
use std::time::Duration;

use precut::config::Config;
use precut::engine::{Engine, EngineSettings};
use precut::http::{self, App};
use precut::registry::Registry;
use tokio::net::TcpListener;
use tokio::sync::watch;

/// Contracts are made on demand, which takes most of a second here: once for all tests.
static REGISTRY: LazyLock<Registry> = LazyLock::new(|| Registry::standard().unwrap());

/// A running service.
pub struct Service {
    address: SocketAddr,
    stop: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

impl Service {
    pub fn start() -> Self {
        Self::start_with(|_| {})
    }

    /// With settings of its own.
    pub fn start_with(set: impl FnOnce(&mut Config) + Send + 'static) -> Self {
        let (tell, told) = std::sync::mpsc::channel();
        let (stop, stopped) = watch::channel(false);
        let thread = std::thread::spawn(move || {
            // Of a service that lasts as long as the tests nobody takes it away: it lies among what is built.
            let data = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
            let mut config = Config { data: data.path().to_owned(), ..Config::default() };
            set(&mut config);
            let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
            runtime.block_on(async move {
                let settings = EngineSettings::of(&config);
                let engine = Engine::open(REGISTRY.clone(), settings).await.unwrap();
                let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
                tell.send(listener.local_addr().unwrap()).unwrap();
                let app = App::new(engine.clone(), &config);
                let left = http::serve(listener, None, app, stopped, Duration::from_millis(200)).await;
                engine.close(left).await;
            });
        });
        Self { address: told.recv().unwrap(), stop, thread: Some(thread) }
    }

    /// The address of a place in the workbench: what stands behind `#/`.
    pub fn page(&self, place: &str) -> String {
        format!("http://{}/#/{place}", self.address)
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.stop.send_replace(true);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
