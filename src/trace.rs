//! Where a request belongs in a trace (W3C Trace Context), and the export of what is done for it (OpenTelemetry).
//!
//! A client's `traceparent` goes with the job into the store and from there to whoever computes it and to whoever is told of
//! its end. Where spans are exported, each of these is a span of its own and the next one's parent; where they are not,
//! the client's own is passed on as it came.

use std::fmt;
use std::str::FromStr;
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

/// This is no `traceparent`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a traceparent is 00-<32 hexadecimal digits>-<16 hexadecimal digits>-<2 hexadecimal digits>")]
pub(crate) struct BadTraceparent;

/// A place in a trace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Traceparent {
    trace: u128,
    parent: u64,
    flags: u8,
}

impl Traceparent {
    /// The trace that it belongs to.
    pub(crate) fn trace(self) -> impl fmt::Display {
        TraceId::from(self.trace)
    }

    fn of_context(context: &SpanContext) -> Option<Self> {
        context.is_valid().then(|| Self {
            trace: u128::from_be_bytes(context.trace_id().to_bytes()),
            parent: u64::from_be_bytes(context.span_id().to_bytes()),
            flags: context.trace_flags().to_u8(),
        })
    }

    fn context(self) -> SpanContext {
        let (trace, parent) = (TraceId::from(self.trace), SpanId::from(self.parent));
        SpanContext::new(trace, parent, TraceFlags::new(self.flags), true, TraceState::NONE)
    }
}

impl FromStr for Traceparent {
    type Err = BadTraceparent;
    fn from_str(text: &str) -> Result<Self, BadTraceparent> {
        let parts: Vec<&str> = text.splitn(5, '-').collect();
        let [version, trace, parent, flags, ref more @ ..] = parts[..] else { return Err(BadTraceparent) };
        let is_hex = |part: &str, digits| {
            part.len() == digits && part.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
        };
        let is_whole = is_hex(version, 2) && is_hex(trace, 32) && is_hex(parent, 16) && is_hex(flags, 2);
        // Later versions may have more behind it.
        if !is_whole || version == "ff" || (version == "00" && !more.is_empty()) {
            return Err(BadTraceparent);
        }
        let read = Self {
            trace: u128::from_str_radix(trace, 16).map_err(|_| BadTraceparent)?,
            parent: u64::from_str_radix(parent, 16).map_err(|_| BadTraceparent)?,
            flags: u8::from_str_radix(flags, 16).map_err(|_| BadTraceparent)?,
        };
        if read.trace == 0 || read.parent == 0 { Err(BadTraceparent) } else { Ok(read) }
    }
}

impl fmt::Display for Traceparent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "00-{:032x}-{:016x}-{:02x}", self.trace, self.parent, self.flags)
    }
}

/// From now on a span belongs there.
pub(crate) fn follow(span: &Span, parent: Traceparent) {
    // Fails only where spans are not exported.
    let _ = span.set_parent(Context::new().with_remote_span_context(parent.context()));
}

/// The place of a span whose parent was given: its own where spans are exported, else the parent's.
pub(crate) fn place_of(span: &Span, given: Option<Traceparent>) -> Option<Traceparent> {
    Traceparent::of_context(span.context().span().span_context()).or(given)
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

    #[test]
    fn a_traceparent_is_read_as_the_standard_has_it() {
        let text = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
        let read: Traceparent = text.parse().unwrap();
        assert_eq!(read.to_string(), text);
        assert_eq!(read.trace().to_string(), "4bf92f3577b34da6a3ce929d0e0e4736");
        // A later version may say more; what is known of it is taken.
        let later: Traceparent = "cc-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01-what".parse().unwrap();
        assert_eq!(later, read);
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
            assert_eq!(bad.parse::<Traceparent>(), Err(BadTraceparent), "{bad}");
        }
    }
}
