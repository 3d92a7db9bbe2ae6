//! The service as a process: settings, start, signals, end.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::sync::watch;

use super::{Failed, ServeArgs, print};
use crate::config::{Config, Flags, seconds};
use crate::engine::{Engine, EngineSettings, Isolation};
use crate::http::{self, App};
use crate::log;
use crate::registry::Registry;
use crate::trace::Export;

/// Threads that move bytes; all physics is on the engine's own.
const IO_THREADS: usize = 2;

/// `precut serve`
pub(super) fn run(arguments: &ServeArgs, registry: Registry, isolation: Option<Isolation>) -> Result<(), Failed> {
    let config = Config::load(arguments.config.as_deref(), &arguments.flags)
        .map_err(|error| Failed::Machine(format!("settings: {error}")))?;
    if arguments.print_config {
        config.strays.iter().for_each(|stray| eprintln!("precut: {stray}"));
        return print(config.to_toml().as_bytes());
    }
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(IO_THREADS)
        .enable_all()
        .build()
        .map_err(|error| Failed::Machine(format!("the threads cannot be started: {error}")))?;
    let export = Export::start(&config.traces, runtime.handle())
        .map_err(|error| Failed::Machine(format!("settings: {error}")))?;
    log::start(&config.log, export.as_ref());
    config.strays.iter().for_each(|stray| tracing::warn!("{stray}"));
    let outcome = runtime.block_on(serve(&config, arguments, registry, isolation));
    if let Some(export) = export {
        export.end();
    }
    outcome
}

async fn serve(
    config: &Config,
    arguments: &ServeArgs,
    registry: Registry,
    isolation: Option<Isolation>,
) -> Result<(), Failed> {
    http::callbacks::are_ready(&config.callbacks).map_err(|error| Failed::Machine(format!("settings: {error}")))?;
    let settings = EngineSettings { isolation, ..EngineSettings::of(config) };
    let engine = Engine::open(registry, settings).await.map_err(|error| Failed::Machine(error.to_string()))?;
    let (listener, address) = listen(config.listen).await?;
    let admin = match config.admin_listen {
        Some(address) => Some(listen(address).await?),
        None => None,
    };
    if !config.is_loopback() && config.auth.keys.is_empty() {
        tracing::warn!(%address, "reachable from other machines without keys: see auth.keys");
    }
    let app = App::new(engine.clone(), config);
    let (admin, admin_address) = admin.unzip();
    greet(&engine, address, admin_address)?;
    tracing::info!(%address, data = %config.data.display(), store = %config.store, role = ?config.role, "serving");
    let (stop, stopped) = watch::channel(false);
    tokio::spawn(watch_signals(stop));
    tokio::spawn(watch_keys(app.clone(), arguments.config.clone(), arguments.flags.clone()));
    let left = http::serve(listener, admin, app, stopped, seconds(config.shutdown.grace_s)).await;
    engine.close(left).await;
    tracing::info!("stopped");
    Ok(())
}

async fn listen(address: SocketAddr) -> Result<(TcpListener, SocketAddr), Failed> {
    let listener = TcpListener::bind(address)
        .await
        .map_err(|error| Failed::Machine(format!("cannot listen on {address}: {error}")))?;
    let address = listener.local_addr().unwrap_or(address);
    Ok((listener, address))
}

/// How often it is looked whether the file of the settings is another one.
const LOOK: Duration = Duration::from_secs(2);

/// Takes over the keys of the settings when they change and when it is told to (SIGHUP). Whatever else is changed there
/// waits for a restart.
async fn watch_keys(app: App, file: Option<PathBuf>, flags: Flags) {
    let state = || {
        let about = file.as_ref().and_then(|file| std::fs::metadata(file).ok())?;
        Some((about.modified().ok()?, about.len()))
    };
    let Some(mut told) = Hangups::new() else { return };
    let mut before = state();
    loop {
        let is_told = tokio::select! {
            () = told.next() => true,
            () = tokio::time::sleep(LOOK) => false,
        };
        let now = state();
        if !is_told && now == before {
            continue;
        }
        before = now;
        match Config::load(file.as_deref(), &flags) {
            Ok(config) if app.replace_keys(&config.auth) => {
                tracing::info!(keys = config.auth.keys.len(), "the keys are read again");
            }
            Ok(_) => tracing::error!(
                "the settings name no key any more, which would open the service to everybody: the keys before stay in \
                 force until a restart"
            ),
            Err(error) => tracing::error!(%error, "the settings cannot be read: the keys before stay in force"),
        }
    }
}

#[cfg(unix)]
struct Hangups(tokio::signal::unix::Signal);

#[cfg(unix)]
impl Hangups {
    fn new() -> Option<Self> {
        let signal = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::hangup());
        signal.map(Self).inspect_err(|error| tracing::error!(%error, "signals cannot be watched")).ok()
    }
    async fn next(&mut self) {
        self.0.recv().await;
    }
}

#[cfg(not(unix))]
struct Hangups;

#[cfg(not(unix))]
impl Hangups {
    #[allow(clippy::unnecessary_wraps)]
    fn new() -> Option<Self> {
        Some(Self)
    }
    async fn next(&mut self) {
        std::future::pending().await
    }
}

/// The address, the workbench first, and what else to try.
fn greet(engine: &Engine, address: SocketAddr, admin: Option<SocketAddr>) -> Result<(), Failed> {
    let post = engine.registry().entries().first().map_or(String::new(), |entry| {
        let id = entry.meta().id;
        format!("  precut example {id} --job | curl --json @- http://{address}/v1/{id}\n")
    });
    let admin = admin.map_or(String::new(), |admin| format!("Health and metrics:\n  http://{admin}/health/ready\n\n"));
    let greeting = format!(
        "precut {} listens on http://{address}\n\nThe workbench, in a browser:\n  http://{address}/\n\nFor programs:\n  \
         curl http://{address}/v1/calculators\n{post}  http://{address}/docs\n\n{admin}",
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
