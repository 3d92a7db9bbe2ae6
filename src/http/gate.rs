//! What every request passes, in and out, as one layer: request id, log, metrics, keys, rate and load limits, panics,
//! problem documents, compression, headers for safety.
//!
//! One layer and not ten: each layer of a stack costs an allocation and an indirection per request, and an answer
//! from the cache is not much more work than that.

use std::convert::Infallible;
use std::net::IpAddr;
use std::panic::AssertUnwindSafe;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use axum::body::{Body, HttpBody as _};
use axum::extract::{Request, State};
use axum::http::header::{
    ACCEPT_ENCODING, CACHE_CONTROL, CONTENT_ENCODING, CONTENT_LANGUAGE, CONTENT_LENGTH, CONTENT_LOCATION,
    CONTENT_SECURITY_POLICY, CONTENT_TYPE, ETAG, HOST, REFERRER_POLICY, VARY, WWW_AUTHENTICATE, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Version};
use axum::middleware::Next;
use axum::response::Response;
use futures_util::FutureExt;
use tower::{Layer, ServiceExt, service_fn};
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::SizeAbove;
use tracing::Instrument;

use super::auth::Caller;
use super::problem::Problem;
use super::{App, CACHE_STATE, Peer, auth, negotiate, processes};
use crate::text::Language;
use crate::trace::{self, TraceContext};

/// Comes in and goes out with every request.
pub(super) const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Where a request belongs in a trace (W3C Trace Context).
pub(super) const TRACEPARENT: HeaderName = HeaderName::from_static("traceparent");
/// What the systems on the trace's way say of it.
pub(super) const TRACESTATE: HeaderName = HeaderName::from_static("tracestate");

/// Longest target of a request, bytes.
const MOST_TARGET_BYTES: usize = 8 * 1024;
/// Most bytes of header of a request; jobs and keys are far shorter.
const MOST_HEADER_BYTES: usize = 32 * 1024;
/// Smaller bodies are not worth compressing: they fit one packet.
const LEAST_COMPRESSED_BYTES: u64 = 1024;
/// Longest request id taken over from a client.
const MOST_ID_BYTES: usize = 128;

pub(super) async fn gate(State(app): State<App>, mut request: Request, next: Next) -> Response {
    let start = Instant::now();
    let id = request_id(request.headers());
    let method = request.method().clone();
    let route = app.metrics.route(request.uri().path());
    let allowed = allowed(&app, request.uri().path());
    let language = negotiate::language(request.headers());
    let encodings = request.headers_mut().remove(ACCEPT_ENCODING);
    let caller = app.keys.caller(request.headers());
    request.extensions_mut().insert(caller.clone());
    let span = tracing::info_span!(
        "request",
        id = id.to_str().unwrap_or_default(),
        method = method.as_str(),
        path = request.uri().path(),
        key = match &caller {
            Caller::Holder(holder) => Some(holder.name.as_str()),
            Caller::Anyone | Caller::Stranger => None,
        },
        trace = tracing::field::Empty
    );
    let given = trace_context(request.headers());
    if let Some(given) = &given {
        trace::follow(&span, given);
    }
    if let Some(place) = trace::place_of(&span, given) {
        span.record("trace", tracing::field::display(place.trace()));
        request.extensions_mut().insert(place);
    }

    let _in_flight = InFlight::new(&app);
    let response = async {
        let response = match admit(&app, &request, &caller) {
            Ok(()) => AssertUnwindSafe(next.run(request)).catch_unwind().await.unwrap_or_else(|_| {
                // The panic hook has logged why.
                Problem::new(StatusCode::INTERNAL_SERVER_ERROR, "internal").into_bare_response()
            }),
            Err(problem) => problem.into_bare_response(),
        };
        let response = compressed(worded(response, &method, allowed, language, &id), encodings).await;
        log(&response, start.elapsed());
        response
    }
    .instrument(span)
    .await;

    app.metrics.answered(route, &method, response.status(), start.elapsed());
    with_standing_headers(response, id)
}

/// Whether the request may be worked on at all.
fn admit(app: &App, request: &Request, caller: &Caller) -> Result<(), Problem> {
    let hosts = request.headers().get_all(HOST).iter().count();
    if request.version() == Version::HTTP_11 && hosts != 1 {
        return Err(Problem::of_status(StatusCode::BAD_REQUEST));
    }
    if request.uri().path_and_query().is_some_and(|target| target.as_str().len() > MOST_TARGET_BYTES) {
        return Err(Problem::of_status(StatusCode::URI_TOO_LONG));
    }
    let header_bytes: usize = request.headers().iter().map(|(name, value)| name.as_str().len() + value.len() + 4).sum();
    if header_bytes > MOST_HEADER_BYTES {
        return Err(Problem::of_status(StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE));
    }
    let path = request.uri().path();
    let is_guarded = path.starts_with("/v1/") || path == "/metrics";
    if is_guarded {
        if let Some(rate) = &app.rate {
            let client = match caller {
                Caller::Holder(holder) => Client::Key(&holder.owner),
                Caller::Anyone | Caller::Stranger => Client::of(request),
            };
            rate.take(client, Instant::now())
                .map_err(|wait| Problem::new(StatusCode::TOO_MANY_REQUESTS, "too_many_requests").retry_after(wait))?;
        }
        if matches!(caller, Caller::Stranger) {
            return Err(Problem::new(StatusCode::UNAUTHORIZED, "unauthorized")
                .header(WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"precut\"")));
        }
        let scope = auth::needed(request.method(), path);
        if !caller.may(&scope) {
            return Err(Problem::new(StatusCode::FORBIDDEN, "forbidden").with("scope", scope.word()));
        }
    }
    let is_probe = path.starts_with("/health/") || path == "/metrics";
    if app.is_stopping() && !is_probe {
        return Err(Problem::shutting_down());
    }
    if !is_probe && app.in_flight.load(Ordering::Relaxed) > app.limits.concurrent_requests {
        return Err(Problem::new(StatusCode::SERVICE_UNAVAILABLE, "overloaded").retry_after(Duration::from_secs(1)));
    }
    Ok(())
}

/// Who asks, where no key says so. A whole IPv6 network counts as one: it belongs to one customer.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Client<'a> {
    Key(&'a str),
    V4([u8; 4]),
    V6Network([u8; 8]),
    Unknown,
}

impl Client<'_> {
    fn of(request: &Request) -> Self {
        request.extensions().get::<Peer>().map_or(Self::Unknown, |peer| Self::at(peer.ip))
    }

    /// Whoever has this address.
    pub(super) fn at(ip: IpAddr) -> Self {
        match ip.to_canonical() {
            IpAddr::V4(ip) => Self::V4(ip.octets()),
            IpAddr::V6(ip) => {
                let [a, b, c, d, e, f, g, h, ..] = ip.octets();
                Self::V6Network([a, b, c, d, e, f, g, h])
            }
        }
    }
}

/// Who asks, as a name for the fair order of jobs and the like.
pub(super) fn owner(caller: &Caller, request: &Request) -> String {
    use std::net::{Ipv4Addr, Ipv6Addr};
    if let Some(owner) = caller.owner() {
        return owner;
    }
    match Client::of(request) {
        Client::V4(octets) => format!("ip:{}", Ipv4Addr::from(octets)),
        Client::V6Network(network) => {
            let mut octets = [0; 16];
            octets[..8].copy_from_slice(&network);
            format!("ip:{}/64", Ipv6Addr::from(octets))
        }
        Client::Key(_) | Client::Unknown => "unknown".to_owned(),
    }
}

/// Counts a request as in work while it lives.
struct InFlight<'a>(&'a App);

impl<'a> InFlight<'a> {
    fn new(app: &'a App) -> Self {
        app.in_flight.fetch_add(1, Ordering::Relaxed);
        Self(app)
    }
}

impl Drop for InFlight<'_> {
    fn drop(&mut self) {
        self.0.in_flight.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The client's place in a trace; one that is none counts as not given (W3C Trace Context, section 3.3).
fn trace_context(headers: &HeaderMap) -> Option<TraceContext> {
    let mut given = headers.get_all(TRACEPARENT).iter();
    let only = given.next().filter(|_| given.next().is_none());
    // Of these several are one list.
    let state: Result<Vec<&str>, _> = headers.get_all(TRACESTATE).iter().map(HeaderValue::to_str).collect();
    TraceContext::read(only?.to_str().ok()?, &state.unwrap_or_default().join(","))
}

/// The client's id if it is a decent one, a new one otherwise.
fn request_id(headers: &HeaderMap) -> HeaderValue {
    if let Some(id) = headers.get(REQUEST_ID) {
        let is_decent = |byte: &u8| byte.is_ascii_alphanumeric() || b"-_.:/+=".contains(byte);
        if (1..=MOST_ID_BYTES).contains(&id.len()) && id.as_bytes().iter().all(is_decent) {
            return id.clone();
        }
    }
    let mut text = uuid::Uuid::encode_buffer();
    let id = uuid::Uuid::now_v7().hyphenated().encode_lower(&mut text);
    HeaderValue::from_str(id).unwrap_or(HeaderValue::from_static("0"))
}

/// Methods of an address. The router says them in `Allow`, too, but writes that header outside of this layer, when the
/// problem is in words already.
fn allowed(app: &App, path: &str) -> &'static str {
    let Some((folder, name)) = path.strip_prefix("/v1/").map(|path| path.split_once('/').unwrap_or(("", path))) else {
        return "GET, HEAD";
    };
    match folder {
        "" if app.rooms.iter().any(|room| room.id() == name) => "POST",
        "jobs" if !name.contains('/') => "GET, HEAD, DELETE",
        "library" if name == "import" => "POST",
        "tools" if name == "parse" => "POST",
        "processes" => processes::allowed(name),
        "models" | "machines" | "tools" | "materials" | "parts" if !name.contains('/') => "GET, HEAD, PUT, DELETE",
        _ => "GET, HEAD",
    }
}

/// Puts a problem into words, the framework's own errors included.
fn worded(mut response: Response, method: &Method, allowed: &str, language: Language, id: &HeaderValue) -> Response {
    let status = response.status();
    let problem = response.extensions_mut().remove::<Problem>();
    let problem = match problem {
        Some(problem) => problem,
        None if status == StatusCode::METHOD_NOT_ALLOWED => Problem::method(method.as_str(), allowed),
        None if status.is_client_error() || status.is_server_error() => Problem::of_status(status),
        None => return response,
    };
    if let Some(cause) = problem.cause() {
        tracing::error!(cause, "a fault of ours");
    }
    let document = problem.document(language, id.to_str().ok().map(ToOwned::to_owned));
    let body = serde_json::to_vec(&document).expect("a document has only finite numbers and words");
    let (mut head, _) = response.into_parts();
    if let Some((name, value)) = problem.extra_header() {
        head.headers.insert(name, value.clone());
    }
    head.headers.remove(CONTENT_LENGTH);
    head.headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
    head.headers.insert(CONTENT_LANGUAGE, HeaderValue::from_static(language.tag()));
    head.headers.insert(VARY, HeaderValue::from_static("Accept-Language, Accept-Encoding"));
    head.headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    tracing::debug!(code = problem.code(), detail = document.detail, "problem");
    Response::from_parts(head, Body::from(body))
}

/// Compresses a body that is worth it in an encoding that the client takes.
async fn compressed(response: Response, encodings: Option<HeaderValue>) -> Response {
    let Some(encodings) = encodings else { return response };
    let is_worth_it = response.body().size_hint().exact().is_some_and(|bytes| bytes >= LEAST_COMPRESSED_BYTES)
        && !response.headers().contains_key(CONTENT_ENCODING);
    if !is_worth_it {
        return response;
    }
    let mut request = Request::new(Body::empty());
    request.headers_mut().insert(ACCEPT_ENCODING, encodings);
    let mut held = Some(response);
    let service = CompressionLayer::new().compress_when(SizeAbove::new(0)).layer(service_fn(move |_: Request| {
        let response = held.take().unwrap_or_default();
        async move { Ok::<_, Infallible>(response) }
    }));
    let Ok(response) = service.oneshot(request).await;
    let mut response = response.map(Body::new);
    if response.headers().contains_key(CONTENT_ENCODING)
        && let Some(tag) = response.headers().get(ETAG)
        && !tag.as_bytes().starts_with(b"W/")
    {
        // The bytes are others than those that the strong tag stands for.
        let weak = [b"W/", tag.as_bytes()].concat();
        if let Ok(weak) = HeaderValue::from_bytes(&weak) {
            response.headers_mut().insert(ETAG, weak);
        }
    }
    response
}

/// One line per request; what was only read from memory is not worth one unless somebody is looking.
fn log(response: &Response, took: Duration) {
    let status = response.status();
    let text = |name: HeaderName| response.headers().get(name).and_then(|value| value.to_str().ok());
    let cache = text(CACHE_STATE);
    let key = text(CONTENT_LOCATION).and_then(|location| location.rsplit('/').next());
    let ms = took.as_secs_f64() * 1e3;
    let status_code = status.as_u16();
    if status.is_server_error() && status != StatusCode::SERVICE_UNAVAILABLE {
        tracing::error!(status = status_code, ms, "failed");
    } else if status.is_client_error() || status.is_server_error() {
        tracing::info!(status = status_code, ms, "refused");
    } else if cache == Some("miss") {
        tracing::info!(status = status_code, ms, cache, key, "answered");
    } else {
        tracing::debug!(status = status_code, ms, cache, key, "answered");
    }
}

fn with_standing_headers(mut response: Response, id: HeaderValue) -> Response {
    let headers = response.headers_mut();
    headers.insert(REQUEST_ID, id);
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.entry(CONTENT_SECURITY_POLICY).or_insert(HeaderValue::from_static(
        "default-src 'self'; object-src 'none'; base-uri 'none'; frame-ancestors 'none'",
    ));
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    response
}

impl Problem {
    fn into_bare_response(self) -> Response {
        axum::response::IntoResponse::into_response(self)
    }
}

/// Label of a method in the metrics; a client cannot invent new ones.
pub(super) fn method_label(method: &Method) -> &'static str {
    match method.as_str() {
        "GET" => "GET",
        "HEAD" => "HEAD",
        "POST" => "POST",
        "PUT" => "PUT",
        "DELETE" => "DELETE",
        "OPTIONS" => "OPTIONS",
        _ => "other",
    }
}
