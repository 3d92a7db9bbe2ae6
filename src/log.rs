//! The log: one line per event to standard error, as text or JSON.

use std::panic::PanicHookInfo;

use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, Registry};

use crate::config::{Log, LogFormat};
use crate::trace::Export;

/// Starts the log of this process, and what exports spans beside it; a second start is ignored. Panics are logged as well.
pub(crate) fn start(settings: &Log, export: Option<&Export>) {
    let filter = EnvFilter::builder().parse_lossy(&settings.level);
    let started = match export {
        // What is exported does not depend on what is logged.
        Some(export) => Registry::default().with(export.layer()).with(lines(settings).with_filter(filter)).try_init(),
        None => Registry::default().with(filter).with(lines(settings)).try_init(),
    };
    if started.is_ok() {
        std::panic::set_hook(Box::new(panicked));
    }
}

fn lines<S>(settings: &Log) -> Box<dyn Layer<S> + Send + Sync>
where
    S: tracing::Subscriber + for<'span> LookupSpan<'span>,
{
    let layer = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    match settings.format {
        LogFormat::Text => layer.with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr())).boxed(),
        LogFormat::Json => layer.json().flatten_event(true).with_current_span(true).with_span_list(false).boxed(),
    }
}

fn panicked(info: &PanicHookInfo<'_>) {
    let place = info.location().map(ToString::to_string).unwrap_or_default();
    let cause = info.payload_as_str().unwrap_or("no message");
    tracing::error!(place, cause, "panic");
}
