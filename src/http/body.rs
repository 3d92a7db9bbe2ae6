//! Bodies: read within limits of size and time, as the type that they say they are.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::body::Body as HttpBody;
use axum::extract::multipart::MultipartError;
use axum::extract::{DefaultBodyLimit, FromRequest, Multipart, Request};
use axum::http::header::{CONTENT_ENCODING, CONTENT_LENGTH, CONTENT_TYPE};
use axum::http::{HeaderMap, StatusCode};
use bytes::{Bytes, BytesMut};
use http_body_util::BodyExt;

use super::Peer;
use super::problem::Problem;
use crate::config::{Limits, seconds};
use crate::engine::budget::{Budget, Held, Spent, charge_of};
use crate::engine::{Body, FilePart};

/// Parts of a multipart body beside `job`; a job takes fewer files.
const MOST_FILES: usize = 16;

/// The job in the body of a request; whether anything of it may come as files is asked where that matters.
pub(super) async fn job(
    request: Request,
    takes_files: impl Fn() -> bool,
    limits: &Limits,
    budget: &Budget,
) -> Result<Body, Problem> {
    let kind = Kind::of(request.headers(), &takes_files)?;
    let limit = match kind {
        Kind::Json => limits.json_bytes,
        Kind::Multipart => limits.multipart_bytes,
    };
    let unread = request.extensions().get::<Peer>().map(|peer| peer.unread.clone());
    let declared = declared_length(request.headers());
    let read = async {
        if declared.is_some_and(|length| length > limit as u64) {
            return Err(Problem::too_large(limit));
        }
        match kind {
            Kind::Json => whole(request.into_body(), declared, limit, budget.hold()).await.map(Body::Json),
            Kind::Multipart => parts(request, limit, budget).await,
        }
    };
    let time = seconds(limits.body_timeout_s);
    let body = tokio::time::timeout(time, read).await.unwrap_or_else(|_| Err(Problem::too_slow(time)))?;
    if let Some(unread) = unread {
        unread.store(false, Ordering::Relaxed);
    }
    Ok(body)
}

/// The bytes of a body that is one of these types, and which.
pub(super) async fn plain(
    request: Request,
    types: &[&'static str],
    limits: &Limits,
    budget: &Budget,
) -> Result<(&'static str, Bytes), Problem> {
    let headers = request.headers();
    let sent = headers.get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default().to_owned();
    let essence = sent.split(';').next().unwrap_or_default().trim();
    let Some(kind) = types.iter().find(|kind| kind.eq_ignore_ascii_case(essence)) else {
        return Err(Problem::other_type(&sent, types));
    };
    if headers.get(CONTENT_ENCODING).is_some_and(|encoding| !encoding.as_bytes().eq_ignore_ascii_case(b"identity")) {
        return Err(Problem::other_type(&sent, types));
    }
    let (limit, declared) = (limits.json_bytes, declared_length(headers));
    if declared.is_some_and(|length| length > limit as u64) {
        return Err(Problem::too_large(limit));
    }
    let unread = request.extensions().get::<Peer>().map(|peer| peer.unread.clone());
    let time = seconds(limits.body_timeout_s);
    let read = whole(request.into_body(), declared, limit, budget.hold());
    let bytes = tokio::time::timeout(time, read).await.unwrap_or_else(|_| Err(Problem::too_slow(time)))?;
    if let Some(unread) = unread {
        unread.store(false, Ordering::Relaxed);
    }
    Ok((kind, bytes))
}

#[derive(Clone, Copy)]
enum Kind {
    Json,
    Multipart,
}

impl Kind {
    fn of(headers: &HeaderMap, takes_files: &impl Fn() -> bool) -> Result<Self, Problem> {
        let refused = |received: &str| Err(Problem::media_type(received, takes_files()));
        if let Some(encoding) = headers.get(CONTENT_ENCODING)
            && !encoding.as_bytes().eq_ignore_ascii_case(b"identity")
        {
            return Err(Problem::encoded(encoding.to_str().unwrap_or("?"), takes_files()));
        }
        let Some(sent) = headers.get(CONTENT_TYPE) else { return refused("") };
        if sent == "application/json" {
            return Ok(Self::Json);
        }
        let Ok(sent) = sent.to_str() else { return refused("?") };
        let mut parameters = sent.split(';').map(str::trim);
        let essence = parameters.next().unwrap_or_default();
        if essence.eq_ignore_ascii_case("multipart/form-data") && takes_files() {
            return Ok(Self::Multipart);
        }
        let other_charset = parameters.filter_map(|parameter| parameter.split_once('=')).any(|(name, value)| {
            name.trim().eq_ignore_ascii_case("charset") && !value.trim().trim_matches('"').eq_ignore_ascii_case("utf-8")
        });
        if essence.eq_ignore_ascii_case("application/json") && !other_charset {
            return Ok(Self::Json);
        }
        refused(sent)
    }
}

fn declared_length(headers: &HeaderMap) -> Option<u64> {
    headers.get(CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

/// Takes what a body that grows to `bytes` needs; `held` is what it has.
fn charge(held: &mut Held, bytes: usize) -> Result<(), Problem> {
    held.grow(charge_of(bytes).saturating_sub(held.bytes())).map_err(|Spent| Problem::no_memory())
}

/// The bytes of a body. One that came in one piece is not copied.
async fn whole(mut body: HttpBody, declared: Option<u64>, limit: usize, mut held: Held) -> Result<Bytes, Problem> {
    let mut first = Bytes::new();
    let mut rest = BytesMut::new();
    while let Some(frame) = body.frame().await {
        let Ok(data) = frame.map_err(|_| Problem::cut_off())?.into_data() else { continue };
        if first.len() + rest.len() + data.len() > limit {
            return Err(Problem::too_large(limit));
        }
        charge(&mut held, first.len() + rest.len() + data.len())?;
        if first.is_empty() && rest.is_empty() {
            first = data;
            continue;
        }
        if rest.is_empty() {
            // The limit was held against the declared length already.
            let length = declared.and_then(|length| usize::try_from(length).ok()).unwrap_or(2 * first.len());
            rest.reserve(length);
            rest.extend_from_slice(&std::mem::take(&mut first));
        }
        rest.extend_from_slice(&data);
    }
    Ok(held.with(if rest.is_empty() { first } else { rest.freeze() }))
}

async fn parts(mut request: Request, limit: usize, budget: &Budget) -> Result<Body, Problem> {
    DefaultBodyLimit::max(limit).apply(&mut request);
    let mut multipart =
        Multipart::from_request(request, &()).await.map_err(|error| Problem::multipart(error.body_text()))?;
    let fault = |error: &MultipartError| {
        let is_over_limit = error.status() == StatusCode::PAYLOAD_TOO_LARGE;
        if is_over_limit { Problem::too_large(limit) } else { Problem::multipart(error.body_text()) }
    };
    let mut job = None;
    let mut files: Vec<FilePart> = Vec::new();
    while let Some(mut field) = multipart.next_field().await.map_err(|error| fault(&error))? {
        let Some(name) = field.name().map(ToOwned::to_owned) else {
            return Err(Problem::multipart("a part has no name".to_owned()));
        };
        let (mut held, mut bytes) = (budget.hold(), BytesMut::new());
        while let Some(data) = field.chunk().await.map_err(|error| fault(&error))? {
            charge(&mut held, bytes.len() + data.len())?;
            bytes.extend_from_slice(&data);
        }
        let bytes = held.with(bytes.freeze());
        if name == "job" {
            if job.replace(bytes).is_some() {
                return Err(Problem::multipart("there are two parts `job`".to_owned()));
            }
        } else if files.iter().any(|file| file.name == name) {
            return Err(Problem::multipart(format!("there are two parts `{name}`")));
        } else if files.len() == MOST_FILES {
            return Err(Problem::multipart(format!("there are more than {MOST_FILES} files")));
        } else {
            files.push(FilePart { name, bytes });
        }
    }
    let job = job.ok_or_else(|| Problem::new(StatusCode::BAD_REQUEST, "missing_job_part"))?;
    Ok(Body::Parts { job, files })
}

/// Reads and forgets what a client still sends after it was refused, so that closing the connection does not reset
/// it before the client has read why: until it pauses for so long, and at most for so long in all.
pub(super) async fn linger(io: &mut tokio::net::TcpStream, pause: Duration, most: Duration) {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let drain = async {
        let mut sink = vec![0_u8; 16 * 1024];
        if io.shutdown().await.is_ok() {
            while matches!(tokio::time::timeout(pause, io.read(&mut sink)).await, Ok(Ok(count)) if count > 0) {}
        }
    };
    let _ = tokio::time::timeout(most, drain).await;
}

/// Whether a client may still be sending a body that nobody reads: so from the arrival of a request with a body until it is
/// read; shared by a connection's requests.
pub(super) type Unread = Arc<AtomicBool>;
