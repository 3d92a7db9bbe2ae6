//! Jobs on record: read, listed, ended and put back. How one is taken is each store's own; so is the lock under which all of
//! this is done where several processes write.

use std::str::FromStr;

use bytes::Bytes;

use super::callbacks::{WithCallback, told};
use super::results::insert;
use super::shards;
use crate::key::Key;
use crate::store::callbacks::Callback;
use crate::store::jobs::{JobId, JobPage, JobQuery, JobRecord, JobState, Lease, Priority, Timing};
use crate::store::row::ResultRow;
use crate::store::sql::{Outcome, Session, Statement, sql};
use crate::store::sqlite_jobs::pack::PackedEnding;

/// Which columns a [`RecordRow`] is read from. A shard has no record that anybody reads.
macro_rules! records {
    ($rest:literal) => {
        concat!(
            "SELECT jobs.id, calculator, key, jobs.state, stage, progress, attempt, jobs.lease, priority, problem,
                 estimate_ms, created_ms, started_ms, finished_ms, deadline_ms, expires_ms, owner, traceparent, tracestate, ",
            told!(),
            " FROM jobs LEFT JOIN callbacks ON callbacks.job = jobs.id WHERE parent IS NULL",
            $rest
        )
    };
}

struct RecordRow {
    id: String,
    calculator: String,
    key: Vec<u8>,
    state: String,
    stage: Option<String>,
    progress: f64,
    attempt: u32,
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
}

from_row!(RecordRow {
    id, calculator, key, state, stage, progress, attempt as i32, lease, priority, problem, estimate_ms, created_ms,
    started_ms, finished_ms, deadline_ms, expires_ms, owner, traceparent, tracestate
});

impl RecordRow {
    fn record(self, callback: Option<Callback>) -> Outcome<JobRecord> {
        Ok(JobRecord {
            callback,
            id: parsed(&self.id)?,
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
        })
    }
}

/// What was written as a text.
pub(in crate::store) fn parsed<T>(text: &str) -> Outcome<T>
where
    T: FromStr<Err: std::error::Error + Send + Sync + 'static>,
{
    text.parse().map_err(|error: T::Err| sqlx::Error::Decode(error.into()))
}

pub(in crate::store) fn unreadable(column: &str) -> sqlx::Error {
    sqlx::Error::Decode(format!("the column {column} of a job").into())
}

/// A count or a version out of a column, which is never negative.
pub(in crate::store) fn count(number: i32) -> u32 {
    u32::try_from(number).unwrap_or(0)
}

pub(in crate::store) const fn rank(priority: Priority) -> i32 {
    match priority {
        Priority::Low => 0,
        Priority::Normal => 1,
        Priority::High => 2,
    }
}

fn of_rank(rank_: i32) -> Option<Priority> {
    Priority::ALL.iter().copied().find(|priority| rank(*priority) == rank_)
}

pub(in crate::store) fn ids(texts: &[String]) -> Outcome<Vec<JobId>> {
    texts.iter().map(|text| parsed(text)).collect()
}

/// The jobs whose ids are returned.
async fn changed<S: Session>(connection: &mut S, statement: Statement) -> Outcome<Vec<JobId>> {
    let rows: Vec<(String,)> = connection.all(statement).await?;
    rows.iter().map(|(id,)| parsed(id)).collect()
}

fn read(read: WithCallback<RecordRow>) -> Outcome<JobRecord> {
    read.row.record(read.told.callback()?)
}

pub(in crate::store) async fn record<S: Session>(connection: &mut S, id: JobId) -> Outcome<Option<JobRecord>> {
    let row = connection.first(sql(records!(" AND jobs.id = $1")).bind(id)).await?;
    row.map(read).transpose()
}

pub(super) async fn list<S: Session>(connection: &mut S, query: JobQuery) -> Outcome<JobPage> {
    let mut statement = sql(records!(""));
    if let Some(state) = query.state {
        statement.push(" AND jobs.state = ").push_bind(state.word());
    }
    if let Some(calculator) = query.calculator {
        statement.push(" AND calculator = ").push_bind(calculator);
    }
    if let Some(owner) = query.owner {
        statement.push(" AND owner = ").push_bind(owner);
    }
    if let Some(key) = query.key {
        statement.push(" AND key = ").push_bind(key);
    }
    if let Some(before) = query.before {
        statement.push(" AND jobs.id < ").push_bind(before);
    }
    // One more than asked for tells whether there is another page.
    statement.push(" ORDER BY jobs.id DESC LIMIT ").push_bind(i64::from(query.limit) + 1);
    let rows = connection.all(statement).await?;
    let mut items = rows.into_iter().map(read).collect::<Outcome<Vec<_>>>()?;
    let more = items.len() > query.limit as usize;
    items.truncate(query.limit as usize);
    let next = items.last().filter(|_| more).map(|last| last.id);
    Ok(JobPage { items, next })
}

/// The inputs of some jobs, as far as they are kept and take no more than `most` bytes.
pub(super) async fn inputs<S: Session>(connection: &mut S, ids: &[JobId], most: usize) -> Outcome<Vec<(JobId, Bytes)>> {
    if ids.is_empty() {
        return Ok(Vec::new());
    }
    let mut statement = sql("SELECT id, input FROM jobs WHERE octet_length(input) BETWEEN 1 AND ");
    statement.push_bind(i64::try_from(most).unwrap_or(i64::MAX)).push(" AND id IN ").push_list(ids.iter().copied());
    let rows: Vec<(String, Vec<u8>)> = connection.all(statement).await?;
    Ok(rows.into_iter().filter_map(|(id, input)| Some((id.parse().ok()?, input.into()))).collect())
}

/// The result of an ending.
fn result_of(ending: &PackedEnding) -> Option<&ResultRow> {
    match ending {
        PackedEnding::Succeeded(result) => Some(result),
        PackedEnding::Shard(_) | PackedEnding::Failed(_) => None,
    }
}

/// Ends what is computed under a lease.
macro_rules! end_job {
    () => {
        "UPDATE jobs
         SET state = $2, problem = $3, progress = CASE WHEN $2 = 'succeeded' THEN 1.0 ELSE progress END, stage = NULL,
             lease = NULL, heartbeat_ms = NULL, finished_ms = $4, expires_ms = CASE WHEN parent IS NULL THEN $5 END,
             key = coalesce($6, key), result_bytes = $7, content = $8
         WHERE lease = $1 AND state = 'running' RETURNING id, parent, turn"
    };
}
pub(in crate::store) use end_job;

/// Ends what is computed under a lease, and keeps what it came to.
pub(super) async fn end_leased<S: Session>(
    connection: &mut S,
    lease: Lease,
    ending: &PackedEnding,
    (now, keep_ms): (i64, i64),
) -> Outcome<Vec<JobId>> {
    let ended = end(connection, lease, ending, (now, keep_ms)).await?;
    match (ending, ended.first()) {
        (PackedEnding::Succeeded(result), Some(_)) => {
            insert(connection, std::slice::from_ref(result), now).await?;
        }
        (PackedEnding::Shard(_), Some((_, Some(parent), turn))) => {
            shards::go_on(connection, parent.clone(), *turn).await?;
        }
        _ => {}
    }
    ended.iter().map(|(id, ..)| parsed(id)).collect()
}

/// The ids of those that ended, with the key of the parent, of a shard, and the turn.
async fn end<S: Session>(
    connection: &mut S,
    lease: Lease,
    ending: &PackedEnding,
    at: (i64, i64),
) -> Outcome<Vec<(String, Option<Vec<u8>>, i64)>> {
    connection.all(ended(sql(end_job!()), lease, ending, at)).await
}

/// A statement that begins with [`end_job!`], with its values.
pub(in crate::store) fn ended(
    statement: Statement,
    lease: Lease,
    ending: &PackedEnding,
    (now, keep_ms): (i64, i64),
) -> Statement {
    let (state, content, problem) = match ending {
        PackedEnding::Succeeded(_) => (JobState::Succeeded, None, None),
        PackedEnding::Shard(content) => (JobState::Succeeded, Some(content.clone()), None),
        PackedEnding::Failed(problem) => (JobState::Failed, None, Some(problem.as_str())),
    };
    let result = result_of(ending);
    let statement = statement.bind(lease).bind(state.word()).bind(problem).bind(now).bind(now.saturating_add(keep_ms));
    let statement = statement.bind(result.map(|result| result.key.clone()));
    statement.bind(result.map_or(0, ResultRow::bytes)).bind(content)
}

/// Puts the running jobs of a lease back in line that were last heard of at `heard_ms` or before: `charged` says whether the
/// start counts. One that was charged twice goes behind all others: whatever took its process along twice shall take nobody
/// along any more. A shard keeps its turn, its parent's or the one behind all others.
pub(in crate::store) async fn put_back<S: Session>(
    connection: &mut S,
    lease: Lease,
    charged: bool,
    heard_ms: i64,
) -> Outcome<Vec<JobId>> {
    let back = sql("UPDATE jobs
         SET state = 'queued', lease = NULL, heartbeat_ms = NULL, started_ms = NULL, progress = 0.0, stage = NULL,
             attempt = CASE WHEN attempt > $2 THEN attempt - $2 ELSE 0 END,
             turn = CASE WHEN $2 = 0 AND attempt > 1 AND parent IS NULL
                    THEN 1 + (SELECT max(turn) FROM jobs AS other WHERE other.priority = jobs.priority
                              AND other.state IN ('queued', 'running') AND other.parent IS NULL)
                    ELSE turn END
         WHERE lease = $1 AND state = 'running' AND coalesce(heartbeat_ms, 0) <= $3 RETURNING id");
    changed(connection, back.bind(lease).bind(i64::from(!charged)).bind(heard_ms)).await
}

/// Fails the jobs of an owner that are computed under a lease; the start is not charged.
pub(in crate::store) async fn fail_of_owner<S: Session>(
    connection: &mut S,
    lease: Lease,
    (owner, problem): (&str, &str),
    (now, keep_ms): (i64, i64),
) -> Outcome<Vec<JobId>> {
    let refused = sql("UPDATE jobs
         SET state = 'failed', problem = $3, lease = NULL, heartbeat_ms = NULL, started_ms = NULL,
             attempt = CASE WHEN attempt > 1 THEN attempt - 1 ELSE 0 END, finished_ms = $4, expires_ms = $5
         WHERE lease = $1 AND owner = $2 AND state = 'running' RETURNING id");
    let refused = refused.bind(lease).bind(owner).bind(problem).bind(now).bind(now.saturating_add(keep_ms));
    changed(connection, refused).await
}

/// Cancels a job that is not over.
pub(in crate::store) async fn set_cancelled<S: Session>(
    connection: &mut S,
    id: JobId,
    (now, keep_ms): (i64, i64),
) -> Outcome<()> {
    let cancelled = sql("UPDATE jobs SET state = 'cancelled', lease = NULL, heartbeat_ms = NULL, stage = NULL,
             finished_ms = $2, expires_ms = $3
         WHERE id = $1 AND state IN ('queued', 'running')");
    connection.run(cancelled.bind(id).bind(now).bind(now.saturating_add(keep_ms))).await.map(drop)
}

/// Puts a job that has succeeded back in line, as if it had never run; its result is forgotten. Whether it was one.
pub(in crate::store) async fn set_back<S: Session>(connection: &mut S, id: JobId) -> Outcome<bool> {
    let gone = sql("DELETE FROM results WHERE key = (SELECT key FROM jobs WHERE id = $1 AND state = 'succeeded')");
    connection.run(gone.bind(id)).await?;
    let back =
        sql("UPDATE jobs SET state = 'queued', attempt = 0, progress = 0.0, started_ms = NULL, finished_ms = NULL,
             expires_ms = NULL, deadline_ms = NULL, result_bytes = 0
         WHERE id = $1 AND state = 'succeeded'");
    Ok(connection.run(back.bind(id)).await? > 0)
}

/// Of these leases the ones that no running job has.
pub(in crate::store) async fn unwanted<S: Session>(connection: &mut S, leases: &[Lease]) -> Outcome<Vec<Lease>> {
    if leases.is_empty() {
        return Ok(Vec::new());
    }
    let mut running = sql("SELECT lease FROM jobs WHERE state = 'running' AND lease IN ");
    running.push_list(leases.iter().copied());
    let running: Vec<(String,)> = connection.all(running).await?;
    let is_gone = |lease: &&Lease| !running.iter().any(|(there,)| *there == lease.to_string());
    Ok(leases.iter().filter(is_gone).copied().collect())
}

pub(in crate::store) async fn note_timing<S: Session>(connection: &mut S, timing: &Timing) -> Outcome<()> {
    let now = connection.now_ms().await?;
    let noted =
        sql("INSERT INTO timings (calculator, version, predicted_ms, actual_ms, at_ms) VALUES ($1, $2, $3, $4, $5)");
    let noted = noted.bind(&timing.calculator).bind(timing.version).bind(timing.predicted_ms).bind(timing.actual_ms);
    connection.run(noted.bind(now)).await.map(drop)
}

pub(super) async fn timings<S: Session>(connection: &mut S, limit: u32) -> Outcome<Vec<Timing>> {
    let timings = sql("SELECT calculator, version, predicted_ms, actual_ms FROM timings ORDER BY at_ms DESC LIMIT $1")
        .bind(limit);
    let rows: Vec<(String, i32, f64, f64)> = connection.all(timings).await?;
    let timing = |(calculator, version, predicted_ms, actual_ms)| Timing {
        calculator,
        version: count(version),
        predicted_ms,
        actual_ms,
    };
    Ok(rows.into_iter().map(timing).collect())
}
