//! The quotas of an owner in the header of an answer: `RateLimit` and `RateLimit-Policy` of
//! draft-ietf-httpapi-ratelimit-headers.

use std::fmt::Write as _;

use axum::http::{HeaderName, HeaderValue};
use axum::response::{IntoResponse, Response};

use super::problem::{Problem, whole_s};
use crate::engine::{Share, Standing};

/// What is left of each quota.
pub(super) const RATE_LIMIT: HeaderName = HeaderName::from_static("ratelimit");
/// Which quotas there are.
pub(super) const RATE_LIMIT_POLICY: HeaderName = HeaderName::from_static("ratelimit-policy");

/// Work: seconds of computation within an hour.
const WORK: &str = "work";
/// What is kept of jobs, bytes.
const KEPT: &str = "kept";

/// An answer that says how its owner stands.
pub(super) fn told(outcome: Result<Response, Problem>, standing: &Standing) -> Response {
    let refused = outcome.as_ref().err();
    let (mut policy, mut limit) = (String::new(), String::new());
    let quotas = [
        (WORK, ";qu=\"compute-seconds\";w=3600", standing.work_s, "work_quota"),
        (KEPT, ";qu=\"kept-bytes\"", standing.kept_bytes, "kept_quota"),
    ];
    for (name, terms, share, code) in quotas {
        let Some(Share { quota, left, more_in }) = share else { continue };
        let comma = if policy.is_empty() { "" } else { ", " };
        let _ = write!(policy, "{comma}\"{name}\";q={}{terms}", quota.floor());
        let _ = write!(limit, "{comma}\"{name}\";r={}", left.floor());
        // Both say the same time where both are there.
        let wait = refused.filter(|problem| problem.code() == code).and_then(Problem::retry_after_s);
        if let Some(seconds) = wait.or_else(|| more_in.map(whole_s)) {
            let _ = write!(limit, ";t={seconds}");
        }
    }
    let mut response = outcome.into_response();
    for (name, text) in [(RATE_LIMIT_POLICY, policy), (RATE_LIMIT, limit)] {
        if let Ok(text) = HeaderValue::try_from(text) {
            response.headers_mut().insert(name, text);
        }
    }
    response
}
