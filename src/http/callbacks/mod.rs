//! Webhooks: whoever sent a job with `?callback=URL` is told when it is over, and whom a process names is told what is said of it.
//!
//! What is sent is small, signed (Standard Webhooks), and says the same at every try. It goes to hosts alone that whoever
//! runs the service has named, and of their addresses to none of a private network unless he said so.

mod deliver;
mod event;
mod sign;

use std::time::Duration;

use axum::http::StatusCode;
use serde::Serialize;
use url::Url;
use utoipa::ToSchema;

use super::problem::Problem;
use crate::config::{self, allowed_host, seconds};
use crate::engine::{Callback, CallbackState, NewCallback};
use crate::outward::{Reach, host_of, place_of, port_of};
pub(super) use deliver::deliver;
pub(super) use event::{JobEvent, ProcessEvent};
use sign::Secrets;

/// The setting that names who may be called.
const SETTING: &str = "callbacks.hosts";
/// An address that may be called somewhere.
const EXAMPLE: &str = "https://mes.plant.example/precut";
/// Longest address that is called.
const MOST_URL_BYTES: usize = 2048;

/// Whom the service may call, and how.
pub(super) struct Callbacks {
    hosts: Vec<(String, Option<u16>)>,
    reach: Reach,
    secrets: Secrets,
    timeout: Duration,
    pauses: Vec<Duration>,
}

impl Callbacks {
    /// Those of a configuration that was checked.
    pub(super) fn new(settings: &config::Callbacks) -> Self {
        Self {
            hosts: settings.hosts.iter().filter_map(|host| allowed_host(host)).collect(),
            reach: if settings.private { Reach::Private } else { Reach::Public },
            secrets: Secrets::new(settings),
            timeout: seconds(settings.timeout_s),
            pauses: settings.pauses_s.iter().map(|pause| seconds(*pause)).collect(),
        }
    }

    fn are_off(&self) -> bool {
        self.hosts.is_empty()
    }

    /// The address that a client gave, if it may be called.
    pub(super) fn checked(&self, text: String) -> Result<NewCallback, Problem> {
        let refused = |fault: &'static str| {
            Problem::new(StatusCode::UNPROCESSABLE_ENTITY, "bad_callback").with("fault", fault).with("name", "callback")
        };
        if self.are_off() {
            return Err(refused("off").with("setting", SETTING));
        }
        if text.len() > MOST_URL_BYTES {
            return Err(refused("too_long").with("most", MOST_URL_BYTES));
        }
        let url: Url = match text.parse() {
            Ok(url) => url,
            Err(_) => return Err(refused("unreadable").with("received", text).with("example", EXAMPLE)),
        };
        if !matches!(url.scheme(), "http" | "https") {
            return Err(refused("scheme").with("received", url.scheme().to_owned()).with("expected", "https, http"));
        }
        if !url.username().is_empty() || url.password().is_some() || url.fragment().is_some() {
            return Err(refused("more_than_an_address"));
        }
        if !self.may_be_called(&url) {
            return Err(refused("host").with("received", place_of(&url)).with("setting", SETTING));
        }
        Ok(NewCallback { host: place_of(&url), url: url.into() })
    }

    fn may_be_called(&self, url: &Url) -> bool {
        let (host, port) = (host_of(url), url.port());
        // An address without a port has that of its scheme; so may have one that was named without.
        let is_it = |(name, named): &(String, Option<u16>)| {
            host == Some(name) && (*named == port || *named == Some(port_of(url)))
        };
        self.hosts.iter().any(is_it)
    }
}

/// Whether everything is there that signing needs; if not, what is missing.
pub fn are_ready(settings: &config::Callbacks) -> Result<(), String> {
    if settings.hosts.is_empty() { Ok(()) } else { Secrets::new(settings).check() }
}

/// Who is told that the job is over, and what has become of it.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Callback)]
pub(super) struct CallbackDocument {
    /// Where.
    #[schema(example = "https://mes.plant.example/precut")]
    url: String,
    /// How far it is.
    state: Telling,
    /// Tries begun.
    #[schema(minimum = 0, example = 1)]
    attempts: u32,
    /// When it is tried next; null unless it is `pending`.
    #[schema(format = DateTime)]
    next_at: Option<String>,
    /// Why the last try came to nothing: `http_` with the status of the answer, `no_address`, `private_address`,
    /// `no_connection`, `no_tls`, `no_answer`, `no_secret`, `host_not_allowed`, `internal`; null where none did, or it was taken.
    #[schema(example = "http_503")]
    fault: Option<String>,
    /// When it was delivered or given up.
    #[schema(format = DateTime)]
    settled_at: Option<String>,
}

/// How far a callback is.
#[derive(Debug, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = CallbackState)]
enum Telling {
    /// The job is not over.
    Waiting,
    /// It is to be told.
    Pending,
    /// It was taken.
    Delivered,
    /// It was not, however often it was tried.
    GivenUp,
}

/// A callback in words.
pub(super) fn document(callback: &Callback, time: impl Fn(i64) -> String) -> CallbackDocument {
    CallbackDocument {
        url: callback.url.clone(),
        state: match callback.state {
            CallbackState::Waiting => Telling::Waiting,
            CallbackState::Pending => Telling::Pending,
            CallbackState::Delivered => Telling::Delivered,
            CallbackState::GivenUp => Telling::GivenUp,
        },
        attempts: callback.attempts,
        next_at: callback.next_ms.map(&time),
        fault: callback.fault.clone(),
        settled_at: callback.settled_ms.map(&time),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn callbacks(hosts: &[&str]) -> Callbacks {
        let hosts = hosts.iter().map(|host| (*host).to_owned()).collect();
        Callbacks::new(&config::Callbacks { hosts, ..config::Config::default().callbacks })
    }

    #[test]
    fn only_hosts_that_are_named_are_called_at_ports_that_are_named() {
        let some = callbacks(&["mes.plant.example", "Cam.plant.example:8443", "10.1.2.3:80", "[fd12::1]"]);
        for good in [
            "https://mes.plant.example/a?b=c",
            "http://mes.plant.example",
            "https://MES.plant.example:443/",
            "https://mes.plant.example./",
            "https://cam.plant.example:8443/x",
            "http://10.1.2.3/x",
            "http://0xa.66051:80/x",
            "https://[fd12::1]/",
        ] {
            some.checked(good.to_owned()).unwrap();
        }
        for bad in [
            "https://mes.plant.example:8443/",
            "https://cam.plant.example/",
            "https://mes.plant.example.evil.example/",
            "https://evil.example/mes.plant.example",
            "https://evil.example\\@mes.plant.example/",
            "https://mes.plant.example@evil.example/",
            "https://user:word@mes.plant.example/",
            "https://10.1.2.3/",
            "https://mes.plant.example/#part",
            "ftp://mes.plant.example/",
            "file:///etc/passwd",
            "mes.plant.example",
            "//mes.plant.example/",
            "",
        ] {
            assert_eq!(some.checked(bad.to_owned()).unwrap_err().code(), "bad_callback", "{bad}");
        }
        let long = format!("https://mes.plant.example/{}", "x".repeat(MOST_URL_BYTES));
        assert!(some.checked(long).is_err());
        assert!(callbacks(&[]).checked("https://mes.plant.example/".to_owned()).is_err());
        let url = some.checked("https://mes.plant.example/a?b=c".to_owned()).unwrap();
        assert_eq!(url.host, "mes.plant.example:443");
    }
}
