//! How a job is taken, ended and put back.

use sqlx::sqlite::{SqliteConnection, SqliteRow};

use super::pack::PackedEnding;
use super::record::{Outcome, ids, json_list, parsed, record, unreadable};
use crate::store::jobs::{
    Beat, Cancelled, Claim, Claimed, JobId, JobKind, JobState, Lease, MOST_ATTEMPTS, Next, SILENCE, Wanted,
};
use crate::store::row;

/// A job with what it takes to run it.
struct Runnable {
    id: String,
    key: Vec<u8>,
    kind: String,
    calculator: String,
    attempt: u32,
    input: Vec<u8>,
    priority: i64,
    turn: i64,
    owner: String,
    created_ms: i64,
    traceparent: Option<String>,
    tracestate: Option<String>,
}

from_row!(SqliteRow => Runnable { id, key, kind, calculator, attempt, input, priority, turn, owner, created_ms, traceparent, tracestate });

/// The job of a condition.
macro_rules! runnable {
    ($condition:expr) => {
        concat!(
            "SELECT id, key, kind, calculator, attempt, input, priority, turn, owner, created_ms, traceparent, tracestate \
             FROM precut_jobs WHERE ",
            $condition
        )
    };
}

impl Runnable {
    fn claim(self, lease: Lease, jobs: Vec<JobId>) -> Outcome<Claim> {
        Ok(Claim {
            lease,
            jobs,
            kind: JobKind::of_word(&self.kind).ok_or_else(|| unreadable("kind"))?,
            calculator: self.calculator,
            // A damaged input is nothing that can be run: who claims it finds that out and says so on the record.
            input: zstd::decode_all(&*self.input).unwrap_or_default().into(),
            attempt: self.attempt,
            owner: self.owner,
            created_ms: self.created_ms,
            traceparent: self.traceparent,
            tracestate: self.tracestate,
        })
    }
}

/// What waits and may be taken: `?1` is now, `?2` how long others keep away from what is held (a clock that was set back
/// holds nothing for longer), `?3` the longest job.
macro_rules! in_line {
    () => {
        "state = 'queued' AND (heartbeat_ms IS NULL OR abs(?1 - heartbeat_ms) >= ?2) \
         AND (?3 IS NULL OR (estimate_ms <= ?3 AND attempt = 0))"
    };
}

fn silence_ms() -> i64 {
    i64::try_from(SILENCE.as_millis()).unwrap_or(i64::MAX)
}

pub(super) async fn waits(connection: &mut SqliteConnection, short_ms: Option<f64>, now: i64) -> Outcome<bool> {
    let waits =
        concat!("SELECT EXISTS (SELECT 1 FROM precut_jobs INDEXED BY precut_jobs_in_line WHERE ", in_line!(), ")");
    sqlx::query_scalar(waits).bind(now).bind(silence_ms()).bind(short_ms).fetch_one(connection).await
}

pub(super) async fn take(connection: &mut SqliteConnection, wanted: Wanted, now: i64) -> Outcome<Next> {
    if wanted.again {
        let lease = wanted.lease.to_string();
        let taken = runnable!("lease = ?1 AND state = 'running' ORDER BY id LIMIT 1");
        let taken: Option<Runnable> = sqlx::query_as(taken).bind(&lease).fetch_optional(&mut *connection).await?;
        if let Some(taken) = taken {
            let jobs: Vec<String> =
                sqlx::query_scalar("SELECT id FROM precut_jobs WHERE lease = ?1 AND state = 'running'")
                    .bind(lease)
                    .fetch_all(connection)
                    .await?;
            return Ok(Next::Run(taken.claim(wanted.lease, ids(&jobs)?)?));
        }
    }
    let next = runnable!(concat!(
        "id = (SELECT id FROM precut_jobs INDEXED BY precut_jobs_in_line WHERE ",
        in_line!(),
        " ORDER BY priority DESC, turn, id LIMIT 1)"
    ));
    let next: Option<Runnable> = sqlx::query_as(next)
        .bind(now)
        .bind(silence_ms())
        .bind(wanted.short_ms)
        .fetch_optional(&mut *connection)
        .await?;
    let Some(next) = next else { return Ok(Next::Nothing) };
    let charged = charged(connection, &next.key).await?;
    if charged + 1 >= MOST_ATTEMPTS {
        let id = parsed(&next.id)?;
        hold(connection, id, now).await?;
        return Ok(Next::Suspect { id, calculator: next.calculator });
    }
    start(connection, next, wanted.lease, charged, now).await.map(Next::Run)
}

/// The most starts charged to equal jobs that wait.
async fn charged(connection: &mut SqliteConnection, key: &[u8]) -> Outcome<u32> {
    sqlx::query_scalar("SELECT max(attempt) FROM precut_jobs WHERE key = ?1 AND state = 'queued'")
        .bind(key)
        .fetch_one(connection)
        .await
}

pub(super) async fn hold(connection: &mut SqliteConnection, id: JobId, now: i64) -> Outcome<()> {
    sqlx::query(
        "UPDATE precut_jobs SET heartbeat_ms = ?2
         WHERE key = (SELECT key FROM precut_jobs WHERE id = ?1) AND state = 'queued'",
    )
    .bind(id.to_string())
    .bind(now)
    .execute(connection)
    .await
    .map(drop)
}

pub(super) async fn claim(
    connection: &mut SqliteConnection,
    id: JobId,
    lease: Lease,
    (most, problem): (u32, &str),
    keep_ms: i64,
    now: i64,
) -> Outcome<Claimed> {
    let waiting: Option<Runnable> = sqlx::query_as(runnable!("id = ?1 AND state = 'queued'"))
        .bind(id.to_string())
        .fetch_optional(&mut *connection)
        .await?;
    let Some(waiting) = waiting else { return Ok(Claimed::Nothing) };
    let charged = charged(connection, &waiting.key).await?;
    if charged >= most {
        let failed: Vec<String> = sqlx::query_scalar(
            "UPDATE precut_jobs SET state = 'failed', problem = ?2, heartbeat_ms = NULL, finished_ms = ?3, expires_ms = ?4
             WHERE key = ?1 AND state = 'queued' RETURNING id",
        )
        .bind(&waiting.key)
        .bind(problem)
        .bind(now)
        .bind(now.saturating_add(keep_ms))
        .fetch_all(connection)
        .await?;
        return Ok(Claimed::Poisonous(ids(&failed)?));
    }
    start(connection, waiting, lease, charged, now).await.map(Claimed::Run)
}

/// Takes a job that waits and all equal ones.
async fn start(
    connection: &mut SqliteConnection,
    next: Runnable,
    lease: Lease,
    charged: u32,
    now: i64,
) -> Outcome<Claim> {
    let jobs: Vec<String> = sqlx::query_scalar(
        "UPDATE precut_jobs
         SET state = 'running', attempt = ?2, lease = ?3, heartbeat_ms = ?4, started_ms = ?4, progress = 0.0, stage = NULL
         WHERE key = ?1 AND state = 'queued' RETURNING id",
    )
    .bind(&next.key)
    .bind(charged + 1)
    .bind(lease.to_string())
    .bind(now)
    .fetch_all(&mut *connection)
    .await?;
    // The line has come to this place, however long others run that were taken before: who comes now begins behind it.
    sqlx::query("UPDATE precut_jobs SET turn = ?1 WHERE state = 'running' AND priority = ?2 AND turn < ?1")
        .bind(next.turn)
        .bind(next.priority)
        .execute(connection)
        .await?;
    Runnable { attempt: charged + 1, ..next }.claim(lease, ids(&jobs)?)
}

pub(super) async fn finish(
    connection: &mut SqliteConnection,
    lease: Lease,
    ending: &PackedEnding,
    keep_ms: i64,
    now: i64,
) -> Outcome<Vec<JobId>> {
    let (state, problem, result) = match ending {
        PackedEnding::Succeeded(result) => (JobState::Succeeded, None, Some(result)),
        PackedEnding::Failed(problem) => (JobState::Failed, Some(problem), None),
    };
    let ended: Vec<String> = sqlx::query_scalar(
        "UPDATE precut_jobs
         SET state = ?2, problem = ?3, progress = iif(?2 = 'succeeded', 1.0, progress), stage = NULL, lease = NULL,
             heartbeat_ms = NULL, finished_ms = ?4, expires_ms = ?5, key = coalesce(?6, key), result_bytes = ?7
         WHERE lease = ?1 AND state = 'running' RETURNING id",
    )
    .bind(lease.to_string())
    .bind(state.word())
    .bind(problem)
    .bind(now)
    .bind(now.saturating_add(keep_ms))
    .bind(result.map(|result| result.key.clone()))
    .bind(result.map_or(0, row::ResultRow::bytes))
    .fetch_all(&mut *connection)
    .await?;
    if let Some(result) = result
        && !ended.is_empty()
    {
        row::insert(std::slice::from_ref(result), now, connection).await?;
    }
    ids(&ended)
}

/// Puts running jobs of some leases (JSON array) back in line: `charged` says whether the start counts. One that was
/// charged twice goes behind all others: whatever took its process along twice shall take nobody along any more.
pub(super) async fn requeue(connection: &mut SqliteConnection, leases: &str, charged: bool) -> Outcome<Vec<JobId>> {
    let back: Vec<String> = sqlx::query_scalar(
        "UPDATE precut_jobs
         SET state = 'queued', lease = NULL, heartbeat_ms = NULL, started_ms = NULL, progress = 0.0, stage = NULL,
             attempt = max(0, attempt - ?2),
             turn = iif(?2 = 0 AND attempt > 1,
                        1 + (SELECT max(turn) FROM precut_jobs AS other WHERE other.priority = precut_jobs.priority
                             AND other.state IN ('queued', 'running')),
                        turn)
         WHERE state = 'running' AND lease IN (SELECT value FROM json_each(?1)) RETURNING id",
    )
    .bind(leases)
    .bind(i64::from(!charged))
    .fetch_all(connection)
    .await?;
    ids(&back)
}

/// Of these leases (JSON array) the ones that no running job has.
pub(super) async fn unwanted(connection: &mut SqliteConnection, leases: &[String]) -> Outcome<Vec<Lease>> {
    let gone: Vec<String> = sqlx::query_scalar(
        "SELECT DISTINCT value FROM json_each(?1)
         WHERE NOT EXISTS (SELECT 1 FROM precut_jobs WHERE lease = value AND state = 'running')",
    )
    .bind(json_list(leases))
    .fetch_all(connection)
    .await?;
    gone.iter().map(|lease| parsed(lease)).collect()
}

pub(super) async fn cancel(
    connection: &mut SqliteConnection,
    id: JobId,
    keep_ms: i64,
    now: i64,
) -> Outcome<Option<Cancelled>> {
    let Some(job) = record(connection, id).await? else { return Ok(None) };
    let before = job.state;
    if before.is_final() {
        return Ok(Some(Cancelled { job, before, unwanted: None }));
    }
    sqlx::query(
        "UPDATE precut_jobs SET state = 'cancelled', lease = NULL, heartbeat_ms = NULL, stage = NULL, finished_ms = ?2,
             expires_ms = ?3 WHERE id = ?1",
    )
    .bind(id.to_string())
    .bind(now)
    .bind(now.saturating_add(keep_ms))
    .execute(&mut *connection)
    .await?;
    let unwanted = match job.lease {
        Some(lease) => unwanted(connection, &[lease.to_string()]).await?.pop(),
        None => None,
    };
    let job = record(connection, id).await?.ok_or(sqlx::Error::RowNotFound)?;
    Ok(Some(Cancelled { job, before, unwanted }))
}

pub(super) async fn refuse(
    connection: &mut SqliteConnection,
    lease: Lease,
    (owner, problem): (&str, &str),
    keep_ms: i64,
    now: i64,
) -> Outcome<Vec<JobId>> {
    let refused: Vec<String> = sqlx::query_scalar(
        "UPDATE precut_jobs
         SET state = 'failed', problem = ?3, lease = NULL, heartbeat_ms = NULL, started_ms = NULL,
             attempt = max(0, attempt - 1), finished_ms = ?4, expires_ms = ?5
         WHERE lease = ?1 AND owner = ?2 AND state = 'running' RETURNING id",
    )
    .bind(lease.to_string())
    .bind(owner)
    .bind(problem)
    .bind(now)
    .bind(now.saturating_add(keep_ms))
    .fetch_all(&mut *connection)
    .await?;
    requeue(connection, &json_list(&[lease]), false).await?;
    ids(&refused)
}

pub(super) async fn redo(connection: &mut SqliteConnection, id: JobId) -> Outcome<()> {
    sqlx::query("DELETE FROM results WHERE key = (SELECT key FROM precut_jobs WHERE id = ?1 AND state = 'succeeded')")
        .bind(id.to_string())
        .execute(&mut *connection)
        .await?;
    sqlx::query(
        "UPDATE precut_jobs SET state = 'queued', attempt = 0, progress = 0.0, started_ms = NULL, finished_ms = NULL,
             expires_ms = NULL, deadline_ms = NULL, result_bytes = 0
         WHERE id = ?1 AND state = 'succeeded'",
    )
    .bind(id.to_string())
    .execute(connection)
    .await
    .map(drop)
}

pub(super) async fn beat(connection: &mut SqliteConnection, beats: &[Beat], now: i64) -> Outcome<Vec<Lease>> {
    for beat in beats {
        sqlx::query(
            "UPDATE precut_jobs SET heartbeat_ms = ?2, progress = ?3, stage = ?4 WHERE lease = ?1 AND state = 'running'",
        )
        .bind(beat.lease.to_string())
        .bind(now)
        .bind(beat.progress)
        .bind(&beat.stage)
        .execute(&mut *connection)
        .await?;
    }
    let leases: Vec<String> = beats.iter().map(|beat| beat.lease.to_string()).collect();
    unwanted(connection, &leases).await
}
