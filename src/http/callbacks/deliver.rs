//! Callbacks on their way: taken up when they are due, tried, and tried again.

use std::collections::HashMap;
use std::time::Duration;

use axum::http::{HeaderMap, HeaderName, HeaderValue};
use bytes::Bytes;
use tokio::sync::watch;
use tokio::task::JoinSet;
use tracing::Instrument;
use url::Url;

use super::Callbacks;
use super::event::{JobEvent, ProcessEvent};
use super::sign::signatures;
use crate::engine::{DueCallback, Engine, Subject, TakeUp, Tried};
use crate::http::App;
use crate::http::gate::{TRACEPARENT, TRACESTATE};
use crate::outward::{Fault, Outward};
use crate::trace::{self, TraceContext};

/// Tries at the same time.
const MOST: usize = 16;
/// After so many of one host no more of it are taken up.
const MOST_OF_ONE: u32 = 4;
/// How often it is looked for what is due.
const LOOK: Duration = Duration::from_secs(1);
/// Who has taken a callback up is taken for dead so long after he should have been done.
const SPARE: Duration = Duration::from_secs(15);
/// For so long at most a receiver is left alone because it asks for that (`Retry-After`).
const MOST_LEAVE: Duration = Duration::from_hours(24);
/// Fault of a receiver that is gone for good.
const GONE: &str = "http_410";
/// A fault of the service's own.
const INTERNAL: &str = "internal";
/// How long tries may take to end when the service does.
const LAST: Duration = Duration::from_secs(5);

const ID: HeaderName = HeaderName::from_static("webhook-id");
const TIMESTAMP: HeaderName = HeaderName::from_static("webhook-timestamp");
const SIGNATURE: HeaderName = HeaderName::from_static("webhook-signature");

/// Delivers what is due until `stop` says so. Who may call nobody leaves it to those that may.
pub(in crate::http) async fn deliver(app: App, mut stop: watch::Receiver<bool>) {
    let callbacks = &app.callbacks;
    if callbacks.are_off() {
        return;
    }
    let outward = match Outward::new(callbacks.reach, callbacks.timeout) {
        Ok(outward) => outward,
        Err(error) => return tracing::error!(%error, "nobody can be told of jobs and processes"),
    };
    let (mut tries, mut busy) = (JoinSet::new(), HashMap::<String, u32>::new());
    loop {
        for due in due(&app.engine, callbacks, MOST - tries.len(), &busy).await {
            *busy.entry(due.host.clone()).or_default() += 1;
            tries.spawn(tell(app.clone(), outward.clone(), due));
        }
        tokio::select! {
            Some(host) = tries.join_next() => ended(&mut busy, host.ok()),
            () = app.engine.ended(LOOK) => {}
            _ = stop.wait_for(|stop| *stop) => break,
        }
    }
    // What is cut off is tried again by whoever comes next.
    let _ = tokio::time::timeout(LAST, async { while tries.join_next().await.is_some() {} }).await;
}

/// A try of a host has ended; without its name it panicked, and nobody knows whose it was.
fn ended(busy: &mut HashMap<String, u32>, host: Option<String>) {
    let Some(host) = host else { return busy.clear() };
    if let Some(tries) = busy.get_mut(&host) {
        *tries -= 1;
        if *tries == 0 {
            busy.remove(&host);
        }
    }
}

async fn due(engine: &Engine, callbacks: &Callbacks, free: usize, busy: &HashMap<String, u32>) -> Vec<DueCallback> {
    if free == 0 {
        return Vec::new();
    }
    let hold = callbacks.timeout + SPARE;
    let wanted = TakeUp {
        most: u32::try_from(free).unwrap_or(0),
        most_of_one: MOST_OF_ONE,
        not_of: busy.iter().filter(|(_, tries)| **tries >= MOST_OF_ONE).map(|(host, _)| host.clone()).collect(),
        hold_ms: i64::try_from(hold.as_millis()).unwrap_or(i64::MAX),
    };
    engine.take_up_callbacks(wanted).await.unwrap_or_else(|error| {
        metrics::counter!("precut_store_failures_total", "operation" => "callbacks").increment(1);
        tracing::warn!(%error, "it is not known who is to be told");
        Vec::new()
    })
}

/// Tries once, and puts down what came of it; the host that was called.
async fn tell(app: App, outward: Outward, due: DueCallback) -> String {
    let host = due.host.clone();
    let told = Told::of(&app, &due.subject).await;
    let given = told.as_ref().ok().and_then(|told| told.trace.clone());
    let span = tracing::info_span!(
        "callback",
        subject = name_of(&due.subject),
        host = due.host,
        attempt = due.attempt,
        trace = given.as_ref().map(|given| tracing::field::display(given.trace()))
    );
    if let Some(given) = &given {
        trace::follow(&span, given);
    }
    let place = trace::place_of(&span, given);
    let told = async {
        let outcome = tried(&app, &outward, (&due, told), place).await;
        let (tried, label) = match outcome {
            Ok(()) => (Tried::Delivered, "delivered"),
            Err(miss) => what_now(&app.callbacks.pauses, due.attempt, miss),
        };
        metrics::counter!("precut_callbacks_total", "outcome" => label).increment(1);
        match &tried {
            Tried::Delivered => tracing::info!("told"),
            Tried::Again { fault, .. } => tracing::info!(fault, "not told; it is tried again"),
            Tried::GivenUp { fault } => tracing::warn!(fault, "not told; it is given up"),
        }
        if let Err(error) = app.engine.settle_callback(due, tried).await {
            // It is held for a while, and then tried again.
            metrics::counter!("precut_store_failures_total", "operation" => "callbacks").increment(1);
            tracing::warn!(%error, "what came of telling is not on record");
        }
    };
    told.instrument(span).await;
    host
}

/// Why a try came to nothing.
#[derive(Debug, PartialEq, Eq)]
struct Miss {
    /// As a code.
    fault: String,
    /// For how long the receiver asks to be left alone.
    leave: Option<Duration>,
}

impl From<Fault> for Miss {
    fn from(fault: Fault) -> Self {
        let leave = if let Fault::Status { retry_after, .. } = fault { retry_after } else { None };
        Self { fault: fault.code(), leave }
    }
}

impl From<&str> for Miss {
    fn from(fault: &str) -> Self {
        Self { fault: fault.to_owned(), leave: None }
    }
}

/// What is done after a try that came to nothing, and what it is called in the metrics.
fn what_now(pauses: &[Duration], attempt: u32, miss: Miss) -> (Tried, &'static str) {
    let Miss { fault, leave } = miss;
    // The receiver says that it is gone for good.
    let is_gone = fault == GONE;
    let pause = pauses.get(attempt.saturating_sub(1) as usize).filter(|_| !is_gone);
    match pause {
        Some(pause) => {
            // A shorter one would use the tries up.
            let after = leave.map_or(*pause, |leave| leave.min(MOST_LEAVE).max(*pause));
            let after_ms = i64::try_from(after.as_millis()).unwrap_or(i64::MAX);
            (Tried::Again { after_ms, fault }, "failed")
        }
        None => (Tried::GivenUp { fault }, "given_up"),
    }
}

/// What is told, in a log.
fn name_of(subject: &Subject) -> String {
    match subject {
        Subject::Job(job) => job.to_string(),
        Subject::Entry { process, sequence } => format!("{process} {sequence}"),
    }
}

/// What is told.
struct Told {
    /// What the call is known by: the same at every try, and of nothing else.
    id: String,
    /// Whose secrets sign it.
    owner: String,
    trace: Option<TraceContext>,
    body: Bytes,
}

impl Told {
    async fn of(app: &App, subject: &Subject) -> Result<Self, &'static str> {
        let unreadable = |error: &dyn std::fmt::Display| {
            tracing::warn!(%error, "what is to be told cannot be read");
            INTERNAL
        };
        let written = |event: serde_json::Result<Vec<u8>>| event.map(Bytes::from).map_err(|_| INTERNAL);
        match subject {
            Subject::Job(id) => {
                let job = app.engine.job(*id).await.map_err(|error| unreadable(&error))?;
                let event = JobEvent::of(&job).ok_or(INTERNAL)?;
                let record = job.record;
                let trace = TraceContext::of_record(record.traceparent.as_deref(), record.tracestate.as_deref());
                let body = written(serde_json::to_vec(&event))?;
                Ok(Self { id: id.to_string(), owner: record.owner, trace, body })
            }
            Subject::Entry { process, sequence } => {
                let entry = app.engine.told_entry(process, *sequence).await.map_err(|error| unreadable(&error))?;
                let (owner, name, entry) = entry.ok_or(INTERNAL)?;
                // A process may be deleted and declared anew, and its record begins with 1 again.
                let id = format!("{name}.{sequence}.{}", entry.created_ms);
                let body = written(serde_json::to_vec(&ProcessEvent::of(name, &entry)))?;
                Ok(Self { id, owner, trace: None, body })
            }
        }
    }
}

/// One try; why it came to nothing.
async fn tried(
    app: &App,
    outward: &Outward,
    (due, told): (&DueCallback, Result<Told, &'static str>),
    place: Option<TraceContext>,
) -> Result<(), Miss> {
    let url: Url = due.url.parse().map_err(|_| INTERNAL)?;
    // The settings may have changed since it was asked for.
    if !app.callbacks.may_be_called(&url) {
        return Err("host_not_allowed".into());
    }
    let Told { id, owner, body, .. } = told?;
    let secrets = app.callbacks.secrets.of(&owner).await.map_err(|error| {
        tracing::error!("{error}");
        "no_secret"
    })?;
    let now_s = jiff::Timestamp::now().as_second();
    let mut headers = HeaderMap::new();
    let texts = [
        (SIGNATURE, Some(signatures(&secrets, &id, now_s, &body))),
        (ID, Some(id)),
        (TIMESTAMP, Some(now_s.to_string())),
        (TRACEPARENT, place.as_ref().map(TraceContext::traceparent)),
        (TRACESTATE, place.as_ref().and_then(TraceContext::tracestate)),
    ];
    for (name, text) in texts {
        if let Some(text) = text {
            headers.insert(name, HeaderValue::try_from(text).map_err(|_| INTERNAL)?);
        }
    }
    Ok(outward.post(&url, headers, body).await?)
}

#[cfg(test)]
mod tests {
    use axum::http::StatusCode;

    use super::*;
    use crate::config::Config;

    #[test]
    fn pauses_grow_until_it_is_given_up_after_seven_hours() {
        let pauses = Callbacks::new(&Config::default().callbacks).pauses;
        let mut waited = Duration::ZERO;
        let mut attempt = 1;
        while let (Tried::Again { after_ms, .. }, _) = what_now(&pauses, attempt, "http_503".into()) {
            let pause = Duration::from_millis(after_ms.unsigned_abs());
            assert!(attempt == 1 || pause > pauses[attempt as usize - 2], "they grow");
            (waited, attempt) = (waited + pause, attempt + 1);
        }
        assert_eq!(attempt, 8);
        assert!((Duration::from_hours(7)..Duration::from_hours(8)).contains(&waited), "{waited:?}");
        let gone = what_now(&pauses, 1, "http_410".into());
        assert_eq!(gone, (Tried::GivenUp { fault: "http_410".to_owned() }, "given_up"));
    }

    #[test]
    fn a_receiver_is_left_alone_for_as_long_as_it_asks_within_a_day() {
        let pauses = [Duration::from_secs(30)];
        for (asked_s, left_s) in [(None, 30), (Some(1), 30), (Some(600), 600), (Some(u64::MAX), 86_400)] {
            let retry_after = asked_s.map(Duration::from_secs);
            let miss = || Miss::from(Fault::Status { status: StatusCode::SERVICE_UNAVAILABLE, retry_after });
            let again = Tried::Again { after_ms: left_s * 1000, fault: "http_503".to_owned() };
            assert_eq!(what_now(&pauses, 1, miss()), (again, "failed"));
            // It does not get a try more for that.
            assert_eq!(what_now(&pauses, 2, miss()).1, "given_up");
        }
    }
}
