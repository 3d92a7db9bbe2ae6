//! A job's record as a row.

use sqlx::postgres::{PgConnection, PgRow};

use crate::key::Key;
use crate::store::callbacks::Callback;
use crate::store::jobs::{JobId, JobKind, JobRecord, JobState};
use crate::store::sqlite_jobs::record::{of_rank, parsed, unreadable};

/// The columns of a [`JobRecord`].
macro_rules! columns {
    () => {
        "id, kind, calculator, key, state, stage, progress, attempt, lease, priority, problem, estimate_ms, \
         created_ms, started_ms, finished_ms, deadline_ms, expires_ms, owner, traceparent, tracestate, \
         (SELECT json_build_object('url', url, 'state', callbacks.state, 'attempts', attempts, 'next_ms', next_ms, 'fault', fault, \
             'settled_ms', settled_ms)::text FROM precut.callbacks WHERE job = jobs.id) AS callback"
    };
}

pub(super) use columns;

pub(super) type Outcome<T> = Result<T, sqlx::Error>;

pub(super) struct RecordRow {
    id: String,
    kind: String,
    calculator: String,
    key: Vec<u8>,
    state: String,
    stage: Option<String>,
    progress: f64,
    attempt: i32,
    lease: Option<String>,
    priority: i32,
    problem: Option<String>,
    estimate_ms: f64,
    created_ms: i64,
    started_ms: Option<i64>,
    finished_ms: Option<i64>,
    deadline_ms: Option<i64>,
    expires_ms: Option<i64>,
    owner: String,
    traceparent: Option<String>,
    tracestate: Option<String>,
    callback: Option<String>,
}

from_row!(PgRow => RecordRow {
    id, kind, calculator, key, state, stage, progress, attempt, lease, priority, problem, estimate_ms, created_ms,
    started_ms, finished_ms, deadline_ms, expires_ms, owner, traceparent, tracestate, callback
});

impl RecordRow {
    pub(super) fn record(self) -> Outcome<JobRecord> {
        Ok(JobRecord {
            id: parsed(&self.id)?,
            kind: JobKind::of_word(&self.kind).ok_or_else(|| unreadable("kind"))?,
            calculator: self.calculator,
            key: Key::from_bytes(&self.key).ok_or_else(|| unreadable("key"))?,
            state: JobState::of_word(&self.state).ok_or_else(|| unreadable("state"))?,
            stage: self.stage,
            progress: self.progress,
            attempt: count(self.attempt),
            lease: self.lease.map(|lease| parsed(&lease)).transpose()?,
            priority: of_rank(i64::from(self.priority)).ok_or_else(|| unreadable("priority"))?,
            problem: self.problem,
            estimate_ms: self.estimate_ms,
            created_ms: self.created_ms,
            started_ms: self.started_ms,
            finished_ms: self.finished_ms,
            deadline_ms: self.deadline_ms,
            expires_ms: self.expires_ms,
            owner: self.owner,
            traceparent: self.traceparent,
            tracestate: self.tracestate,
            callback: self.callback.as_deref().map(Callback::read).transpose()?,
        })
    }
}

/// A count or a version out of a column, which is never negative.
pub(super) fn count(number: i32) -> u32 {
    u32::try_from(number).unwrap_or(0)
}

/// The same into a column.
pub(super) fn column(number: u32) -> i32 {
    i32::try_from(number).unwrap_or(i32::MAX)
}

pub(super) async fn record(connection: &mut PgConnection, id: JobId) -> Outcome<Option<JobRecord>> {
    let row: Option<RecordRow> = sqlx::query_as(concat!("SELECT ", columns!(), " FROM precut.jobs WHERE id = $1"))
        .bind(id.to_string())
        .fetch_optional(connection)
        .await?;
    row.map(RecordRow::record).transpose()
}

pub(super) fn ids(texts: &[String]) -> Outcome<Vec<JobId>> {
    texts.iter().map(|text| parsed(text)).collect()
}

/// Leases and ids as they stand in columns.
pub(super) fn texts<T: std::fmt::Display>(items: &[T]) -> Vec<String> {
    items.iter().map(ToString::to_string).collect()
}
