//! A job's record as a row.

use sqlx::sqlite::{SqliteConnection, SqliteRow};

use crate::key::Key;
use crate::store::callbacks::Callback;
use crate::store::jobs::{JobId, JobKind, JobRecord, JobState, Priority};

/// The columns of a [`JobRecord`].
macro_rules! columns {
    () => {
        "id, kind, calculator, key, state, stage, progress, attempt, lease, priority, problem, estimate_ms, \
         created_ms, started_ms, finished_ms, deadline_ms, expires_ms, owner, traceparent, tracestate, \
         (SELECT json_object('url', url, 'state', callbacks.state, 'attempts', attempts, 'next_ms', next_ms, 'fault', fault, \
             'settled_ms', settled_ms) FROM callbacks WHERE job = precut_jobs.id) AS callback"
    };
}

pub(super) use columns;

pub(super) struct RecordRow {
    id: String,
    kind: String,
    calculator: String,
    key: Vec<u8>,
    state: String,
    stage: Option<String>,
    progress: f64,
    attempt: u32,
    lease: Option<String>,
    priority: i64,
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

from_row!(SqliteRow => RecordRow { id, kind, calculator, key, state, stage, progress, attempt, lease, priority, problem, estimate_ms, created_ms, started_ms, finished_ms, deadline_ms, expires_ms, owner, traceparent, tracestate, callback });

impl RecordRow {
    pub(super) fn record(self) -> Result<JobRecord, sqlx::Error> {
        Ok(JobRecord {
            id: parsed(&self.id)?,
            kind: JobKind::of_word(&self.kind).ok_or_else(|| unreadable("kind"))?,
            calculator: self.calculator,
            key: Key::from_bytes(&self.key).ok_or_else(|| unreadable("key"))?,
            state: JobState::of_word(&self.state).ok_or_else(|| unreadable("state"))?,
            stage: self.stage,
            progress: self.progress,
            attempt: self.attempt,
            lease: self.lease.map(|lease| parsed(&lease)).transpose()?,
            priority: of_rank(self.priority).ok_or_else(|| unreadable("priority"))?,
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

pub(in crate::store) fn parsed<T>(text: &str) -> Result<T, sqlx::Error>
where
    T: std::str::FromStr<Err: std::error::Error + Send + Sync + 'static>,
{
    text.parse().map_err(|error: T::Err| sqlx::Error::Decode(error.into()))
}

pub(in crate::store) fn unreadable(column: &str) -> sqlx::Error {
    sqlx::Error::Decode(format!("the column {column} of a job").into())
}

pub(in crate::store) const fn rank(priority: Priority) -> i64 {
    match priority {
        Priority::Low => 0,
        Priority::Normal => 1,
        Priority::High => 2,
    }
}

pub(in crate::store) fn of_rank(rank_: i64) -> Option<Priority> {
    Priority::ALL.iter().copied().find(|priority| rank(*priority) == rank_)
}

pub(super) type Outcome<T> = Result<T, sqlx::Error>;

pub(super) async fn record(connection: &mut SqliteConnection, id: JobId) -> Outcome<Option<JobRecord>> {
    let row: Option<RecordRow> = sqlx::query_as(concat!("SELECT ", columns!(), " FROM precut_jobs WHERE id = ?1"))
        .bind(id.to_string())
        .fetch_optional(connection)
        .await?;
    row.map(RecordRow::record).transpose()
}

pub(super) fn ids(texts: &[String]) -> Outcome<Vec<JobId>> {
    texts.iter().map(|text| parsed(text)).collect()
}

pub(super) fn json_list<T: std::fmt::Display>(items: &[T]) -> String {
    // Leases and ids are hexadecimal digits and hyphens.
    let items: Vec<String> = items.iter().map(|item| format!("\"{item}\"")).collect();
    format!("[{}]", items.join(","))
}
