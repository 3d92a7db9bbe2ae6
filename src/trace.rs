//! Where a request belongs in a trace (W3C Trace Context), and the export of what is done for it (OpenTelemetry).
//!
//! A client's `traceparent` and `tracestate` go with the job into the store and from there to whoever computes it and to
//! whoever is told of its end. Where spans are exported, each of these is a span of its own and the next one's parent; where
//! they are not, the client's own is passed on as it came.

use std::fmt;
use std::time::Duration;

use futures_util::future::BoxFuture;
use opentelemetry::trace::{
    SpanContext, SpanId, TraceContextExt, TraceFlags, TraceId, TraceState, TracerProvider as _,
};
use opentelemetry::{Context, KeyValue};
use opentelemetry_http::{Bytes, HttpClient, HttpError, Request, Response};
use opentelemetry_otlp::{Protocol, SpanExporter, WithExportConfig, WithHttpConfig};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::{Sampler, SdkTracerProvider};
use tokio::runtime::Handle;
use tracing::Span;
use tracing_opentelemetry::OpenTelemetrySpanExt;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::filter_fn;
use tracing_subscriber::registry::LookupSpan;
use url::Url;

use crate::config::Traces;
use crate::outward::{Fault, Outward, Reach};

/// A batch of spans has to be taken within this time.
const TIMEOUT: Duration = Duration::from_secs(10);

/// Most that is kept of a `tracestate`, bytes: so much has to be passed on (W3C Trace Context, section 3.3.1.5).
const MOST_STATE: usize = 512;
/// Where it has more, entries longer than this go first.
const LONG_ENTRY: usize = 128;

/// Where something belongs in a trace, and what the systems on the trace's way say of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TraceContext(SpanContext);

impl TraceContext {
    /// What two headers say. Without a `traceparent` that is one there is nothing; a `tracestate` that is none counts as
    /// not given, and so does an empty one.
    pub(crate) fn read(traceparent: &str, tracestate: &str) -> Option<Self> {
        let parts: Vec<&str> = traceparent.splitn(5, '-').collect();
        let [version, trace, parent, flags, ref more @ ..] = parts[..] else { return None };
        let is_hex = |part: &str, digits| {
            part.len() == digits && part.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
        };
        let is_whole = is_hex(version, 2) && is_hex(trace, 32) && is_hex(parent, 16) && is_hex(flags, 2);
        // Later versions may have more behind it.
        if !is_whole || version == "ff" || (version == "00" && !more.is_empty()) {
            return None;
        }
        let (trace, parent) = (TraceId::from_hex(trace).ok()?, SpanId::from_hex(parent).ok()?);
        let flags = TraceFlags::new(u8::from_str_radix(flags, 16).ok()?);
        let context = SpanContext::new(trace, parent, flags, true, state(tracestate));
        context.is_valid().then_some(Self(context))
    }

    /// What is on record of a job.
    pub(crate) fn of_record(traceparent: Option<&str>, tracestate: Option<&str>) -> Option<Self> {
        Self::read(traceparent?, tracestate.unwrap_or_default())
    }

    /// The trace that it belongs to.
    pub(crate) fn trace(&self) -> TraceId {
        self.0.trace_id()
    }

    /// As a header.
    pub(crate) fn traceparent(&self) -> String {
        format!("00-{}-{}-{:02x}", self.0.trace_id(), self.0.span_id(), self.0.trace_flags())
    }

    /// As a header, if there is anything to say.
    pub(crate) fn tracestate(&self) -> Option<String> {
        Some(self.0.trace_state().header()).filter(|text| !text.is_empty())
    }
}

/// A `tracestate` of 32 entries and [`MOST_STATE`] bytes at most.
fn state(text: &str) -> TraceState {
    let text = text.parse().map(|state: TraceState| state.header()).unwrap_or_default();
    let mut entries: Vec<&str> = text.split(',').collect();
    while entries.iter().map(|entry| entry.len() + 1).sum::<usize>() > MOST_STATE + 1 {
        let last_long = entries.iter().rposition(|entry| entry.len() > LONG_ENTRY);
        entries.remove(last_long.unwrap_or(entries.len() - 1));
    }
    entries.join(",").parse().unwrap_or_default()
}

/// From now on a span belongs there.
pub(crate) fn follow(span: &Span, parent: &TraceContext) {
    // Fails only where spans are not exported.
    let _ = span.set_parent(Context::new().with_remote_span_context(parent.0.clone()));
}

/// The place of a span whose parent was given: its own where spans are exported, else the parent's.
pub(crate) fn place_of(span: &Span, given: Option<TraceContext>) -> Option<TraceContext> {
    let own = span.context().span().span_context().clone();
    if own.is_valid() { Some(TraceContext(own)) } else { given }
}

/// Exports spans; what is left is sent when it is ended.
pub(crate) struct Export {
    provider: SdkTracerProvider,
}

impl Export {
    /// Begins to; `None` where no collector is named.
    pub(crate) fn start(settings: &Traces, runtime: &Handle) -> Result<Option<Self>, String> {
        if settings.endpoint.is_empty() {
            return Ok(None);
        }
        let said = |error: &dyn fmt::Display| format!("traces.endpoint = \"{}\": {error}", settings.endpoint);
        let outward = Outward::new(Reach::Anywhere, TIMEOUT).map_err(|error| said(&error))?;
        let exporter = SpanExporter::builder()
            .with_http()
            .with_http_client(Client { outward, runtime: runtime.clone() })
            .with_protocol(Protocol::HttpJson)
            .with_endpoint(&settings.endpoint)
            .with_timeout(TIMEOUT)
            .build()
            .map_err(|error| said(&error))?;
        let version = KeyValue::new("service.version", env!("CARGO_PKG_VERSION"));
        let provider = SdkTracerProvider::builder()
            .with_batch_exporter(exporter)
            .with_resource(Resource::builder().with_service_name("precut").with_attribute(version).build())
            .with_sampler(Sampler::ParentBased(Box::new(Sampler::TraceIdRatioBased(settings.share))))
            .build();
        Ok(Some(Self { provider }))
    }

    /// What makes spans of the service's own.
    pub(crate) fn layer<S>(&self) -> impl Layer<S> + Send + Sync + use<S>
    where
        S: tracing::Subscriber + for<'span> LookupSpan<'span> + Send + Sync,
    {
        let ours = filter_fn(|about| about.is_span() && about.target().starts_with("precut"));
        tracing_opentelemetry::layer().with_tracer(self.provider.tracer("precut")).with_filter(ours)
    }

    /// Sends what is left.
    pub(crate) fn end(self) {
        if let Err(error) = self.provider.shutdown_with_timeout(TIMEOUT) {
            eprintln!("precut: the last spans are not exported: {error}");
        }
    }
}

/// What posts batches. They come from a thread of the exporter's own, which is no thread of the runtime.
#[derive(Clone)]
struct Client {
    outward: Outward,
    runtime: Handle,
}

impl fmt::Debug for Client {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Client")
    }
}

impl HttpClient for Client {
    fn send_bytes<'this, 'sending>(
        &'this self,
        request: Request<Bytes>,
    ) -> BoxFuture<'sending, Result<Response<Bytes>, HttpError>>
    where
        'this: 'sending,
    {
        Box::pin(async move {
            let (head, body) = request.into_parts();
            let url = Url::parse(&head.uri.to_string())?;
            let outward = self.outward.clone();
            let posted = self.runtime.spawn(async move { outward.post(&url, head.headers, body).await }).await?;
            posted.map_err(Fault::code)?;
            Ok(Response::new(Bytes::new()))
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const PARENT: &str = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";

    #[test]
    fn a_traceparent_is_read_as_the_standard_has_it() {
        let read = TraceContext::read(PARENT, "").unwrap();
        assert_eq!((read.traceparent().as_str(), read.tracestate()), (PARENT, None));
        assert_eq!(read.trace().to_string(), "4bf92f3577b34da6a3ce929d0e0e4736");
        // A later version may say more; what is known of it is taken.
        let later = "cc-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01-what";
        assert_eq!(TraceContext::read(later, ""), Some(read));
        for bad in [
            "",
            "00",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01-what",
            "00-4BF92F3577B34DA6A3CE929D0E0E4736-00f067aa0ba902b7-01",
            "00-00000000000000000000000000000000-00f067aa0ba902b7-01",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-0000000000000000-01",
            "00-4bf92f3577b34da6a3ce929d0e0e473-00f067aa0ba902b7-01",
            "ff-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
            "00-+bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
        ] {
            assert_eq!(TraceContext::read(bad, "a=1"), None, "{bad}");
        }
    }

    #[test]
    fn a_tracestate_is_kept_within_its_bounds() {
        let kept = |text: &str| TraceContext::read(PARENT, text).unwrap().tracestate();
        assert_eq!(
            kept(" rojo=00f067aa0ba902b7,\tcongo@x=t61 ,,").as_deref(),
            Some("rojo=00f067aa0ba902b7,congo@x=t61")
        );
        for none in ["", ",", "nothing", "A=1", "a=b=c", "a=1,b"] {
            assert_eq!(kept(none), None, "{none}");
        }
        // Of more than 32 entries the first are kept: those who say something last stand first.
        let entries: Vec<String> = (0..40).map(|number| format!("k{number}={number}")).collect();
        assert_eq!(kept(&entries.join(",")), Some(entries[..32].join(",")));
        // Of too many bytes the long entries go first, the last of them before the others; then the last of all.
        let entry = |name: &str, bytes: usize| format!("{name}={}", "x".repeat(bytes - name.len() - 1));
        let (long, short) = (|name| entry(name, 200), |name| entry(name, 100));
        let all = [long("a"), short("b"), long("c"), short("d"), long("e")];
        assert_eq!(kept(&all.join(",")), Some([long("a"), short("b"), short("d")].join(",")));
        let all: Vec<String> = ["a", "b", "c", "d", "e", "f"].map(short).to_vec();
        assert_eq!(kept(&all.join(",")), Some(all[..5].join(",")));
        let full = [entry("a", 100), entry("b", 100), entry("c", 100), entry("d", 100), entry("e", 108)].join(",");
        assert_eq!((full.len(), kept(&full)), (MOST_STATE, Some(full.clone())));
    }
}
