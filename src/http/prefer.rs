//! How a client wants its job done: preferences (RFC 7240), priority, deadline, and its own name for the request.

use std::time::Duration;

use axum::http::{HeaderMap, HeaderName, StatusCode};

use super::problem::Problem;

pub(super) const PREFER: HeaderName = HeaderName::from_static("prefer");
pub(super) const PREFERENCE_APPLIED: HeaderName = HeaderName::from_static("preference-applied");
pub(super) const IDEMPOTENCY_KEY: HeaderName = HeaderName::from_static("idempotency-key");

/// Nobody waits longer, whatever was asked.
const MOST_WAIT_S: u64 = 60;
/// Longest name of a request.
const MOST_KEY_BYTES: usize = 255;

/// What a client prefers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Preference {
    /// Rather a job at once than a result later.
    pub(super) respond_async: bool,
    /// Rather wait so long, s.
    pub(super) wait_s: Option<u64>,
}

impl Preference {
    /// Preferences that are unknown or malformed count as not given (RFC 7240, section 2).
    pub(super) fn of(headers: &HeaderMap) -> Self {
        let mut preference = Self::default();
        let lines = headers.get_all(PREFER).iter().filter_map(|line| line.to_str().ok());
        for token in lines.flat_map(|line| line.split(',')) {
            let token = token.split(';').next().unwrap_or_default().trim();
            let (name, value) = token.split_once('=').unwrap_or((token, ""));
            let (name, value) = (name.trim(), value.trim().trim_matches('"'));
            if name.eq_ignore_ascii_case("respond-async") {
                preference.respond_async = true;
            } else if name.eq_ignore_ascii_case("wait") && preference.wait_s.is_none() {
                preference.wait_s = value.parse().ok().map(|seconds: u64| seconds.min(MOST_WAIT_S));
            }
        }
        preference
    }

    /// How long to wait for a result; `None`: as the service thinks best.
    pub(super) fn wait(self) -> Option<Duration> {
        self.wait_s.or(self.respond_async.then_some(0)).map(Duration::from_secs)
    }

    /// The preferences that were followed, where there was a job.
    pub(super) fn applied(self) -> Option<String> {
        let wait = self.wait_s.map(|seconds| format!("wait={seconds}"));
        let both = [self.respond_async.then(|| "respond-async".to_owned()), wait];
        let applied: Vec<String> = both.into_iter().flatten().collect();
        (!applied.is_empty()).then(|| applied.join(", "))
    }
}

/// The client's own name for the request.
pub(super) fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let malformed = || Problem::new(StatusCode::BAD_REQUEST, "bad_idempotency_key");
    let mut keys = headers.get_all(IDEMPOTENCY_KEY).iter();
    let Some(key) = keys.next() else { return Ok(None) };
    let key = key.to_str().map_err(|_| malformed())?;
    let is_decent = (1..=MOST_KEY_BYTES).contains(&key.len()) && key.bytes().all(|byte| byte.is_ascii_graphic());
    if is_decent && keys.next().is_none() { Ok(Some(key.to_owned())) } else { Err(malformed()) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn headers(name: &HeaderName, lines: &[&str]) -> HeaderMap {
        lines.iter().map(|line| (name.clone(), line.parse().unwrap())).collect()
    }

    #[test]
    fn preferences_are_read_as_rfc_7240_has_them() {
        for (lines, respond_async, wait_s) in [
            (&[][..], false, None),
            (&["respond-async"], true, None),
            (&["wait=10"], false, Some(10)),
            (&["respond-async, wait=10"], true, Some(10)),
            (&["Respond-Async", "WAIT = \"7\" ; x=1"], true, Some(7)),
            (&["wait=9999999"], false, Some(60)),
            (&["wait=1, wait=2"], false, Some(1)),
            (&["wait=-1"], false, None),
            (&["wait"], false, None),
            (&["handling=lenient"], false, None),
        ] {
            assert_eq!(Preference::of(&headers(&PREFER, lines)), Preference { respond_async, wait_s }, "{lines:?}");
        }
        let both = Preference { respond_async: true, wait_s: Some(3) };
        assert_eq!(both.applied().as_deref(), Some("respond-async, wait=3"));
        assert_eq!(both.wait(), Some(Duration::from_secs(3)));
        assert_eq!(Preference { respond_async: true, wait_s: None }.wait(), Some(Duration::ZERO));
        assert_eq!((Preference::default().applied(), Preference::default().wait()), (None, None));
    }

    #[test]
    fn an_idempotency_key_is_visible_ascii() {
        let key = |lines: &[&str]| idempotency_key(&headers(&IDEMPOTENCY_KEY, lines));
        assert_eq!(key(&[]).unwrap(), None);
        assert_eq!(key(&["a-1"]).unwrap().as_deref(), Some("a-1"));
        let long = "x".repeat(256);
        for bad in [&[""][..], &["a b"], &["a", "b"], &[long.as_str()]] {
            assert_eq!(key(bad).unwrap_err().code(), "bad_idempotency_key", "{bad:?}");
        }
    }
}
