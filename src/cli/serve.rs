//! The service as a process: settings, start, signals, end.

use tokio::net::TcpListener;
use tokio::sync::watch;

use super::{Failed, ServeArgs, print};
use crate::config::{Config, seconds};
use crate::engine::{Engine, EngineSettings};
use crate::http::{self, App};
use crate::log;
use crate::registry::Registry;

/// Threads that move bytes; all physics is on the engine's own.
const IO_THREADS: usize = 2;

/// `precut serve`
pub(super) fn run(arguments: &ServeArgs, registry: Registry) -> Result<(), Failed> {
    let config = Config::load(arguments.config.as_deref(), &arguments.flags)
        .map_err(|error| Failed::Machine(format!("settings: {error}")))?;
    if arguments.print_config {
        return print(config.to_toml().as_bytes());
    }
    log::start(&config.log);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(IO_THREADS)
        .enable_all()
        .build()
        .map_err(|error| Failed::Machine(format!("the threads cannot be started: {error}")))?;
    runtime.block_on(serve(&config, registry))
}

async fn serve(config: &Config, registry: Registry) -> Result<(), Failed> {
    let engine =
        Engine::open(registry, EngineSettings::of(config)).await.map_err(|error| Failed::Machine(error.to_string()))?;
    let listener = TcpListener::bind(config.listen)
        .await
        .map_err(|error| Failed::Machine(format!("cannot listen on {}: {error}", config.listen)))?;
    let address = listener.local_addr().unwrap_or(config.listen);
    if !config.is_loopback() && config.auth.keys.is_empty() {
        tracing::warn!(%address, "reachable from other machines without keys: see auth.keys");
    }
    let app = App::new(engine.clone(), config);
    greet(&engine, address)?;
    tracing::info!(%address, data = %config.data.display(), store = %config.store, role = ?config.role, "serving");
    let (stop, stopped) = watch::channel(false);
    tokio::spawn(watch_signals(stop));
    let left = http::serve(listener, app, stopped, seconds(config.shutdown.grace_s)).await;
    engine.close(left).await;
    tracing::info!("stopped");
    Ok(())
}

/// The address, and three things to try.
fn greet(engine: &Engine, address: std::net::SocketAddr) -> Result<(), Failed> {
    let post = engine.registry().entries().first().map_or(String::new(), |entry| {
        let id = entry.meta().id;
        format!("  precut example {id} --job | curl --json @- http://{address}/v1/{id}\n")
    });
    let greeting = format!(
        "precut {} listens on http://{address}\n\nTry:\n  curl http://{address}/v1/calculators\n{post}  \
         open http://{address}/docs in a browser\n\n",
        env!("CARGO_PKG_VERSION")
    );
    match print(greeting.as_bytes()) {
        // A service goes on without a reader.
        Ok(()) | Err(Failed::NobodyListens) => Ok(()),
        Err(failed) => Err(failed),
    }
}

/// The first signal stops in good order, the second at once.
async fn watch_signals(stop: watch::Sender<bool>) {
    let Some(mut signals) = Signals::new() else { return };
    let name = signals.next().await;
    tracing::info!(signal = name, "stopping; once more to stop at once");
    stop.send_replace(true);
    let name = signals.next().await;
    tracing::warn!(signal = name, "stopping at once");
    std::process::exit(130);
}

#[cfg(unix)]
struct Signals {
    interrupt: tokio::signal::unix::Signal,
    terminate: tokio::signal::unix::Signal,
}

#[cfg(unix)]
impl Signals {
    fn new() -> Option<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        let listen = || {
            Ok::<_, std::io::Error>(Self {
                interrupt: signal(SignalKind::interrupt())?,
                terminate: signal(SignalKind::terminate())?,
            })
        };
        listen().inspect_err(|error| tracing::error!(%error, "signals cannot be watched")).ok()
    }

    async fn next(&mut self) -> &'static str {
        tokio::select! {
            _ = self.interrupt.recv() => "SIGINT",
            _ = self.terminate.recv() => "SIGTERM",
        }
    }
}

#[cfg(not(unix))]
struct Signals;

#[cfg(not(unix))]
impl Signals {
    #[allow(clippy::unnecessary_wraps)]
    fn new() -> Option<Self> {
        Some(Self)
    }

    async fn next(&mut self) -> &'static str {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
        "Ctrl-C"
    }
}
