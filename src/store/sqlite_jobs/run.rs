//! How a job is taken, ended and put back.

use sqlx::sqlite::SqliteConnection;

use crate::store::common::jobs::{Runnable, fail_of_owner, ids, parsed, put_back, record, set_cancelled, unwanted};
use crate::store::jobs::{Beat, Cancelled, Claim, Claimed, JobId, Lease, MOST_ATTEMPTS, Next, SILENCE, Wanted};
use crate::store::sql::Outcome;

/// The job of a condition.
macro_rules! runnable {
    ($condition:expr) => {
        concat!(
            "SELECT id, key, state, calculator, attempt, input, priority, turn, owner, created_ms, traceparent, tracestate, \
                 parent, shard FROM jobs WHERE ",
            $condition
        )
    };
}

/// What waits and may be taken: `?1` is now, `?2` how long others keep away from what is held (a clock that was set back
/// holds nothing for longer), `?3` the longest job, which is no shard.
macro_rules! in_line {
    () => {
        "state = 'queued' AND (heartbeat_ms IS NULL OR abs(?1 - heartbeat_ms) >= ?2) \
         AND (?3 IS NULL OR (estimate_ms <= ?3 AND attempt = 0 AND parent IS NULL)) \
         AND (parent IS NULL OR EXISTS ( \
             SELECT 1 FROM jobs AS whole WHERE whole.key = jobs.parent AND whole.state = 'running'))"
    };
}

fn silence_ms() -> i64 {
    i64::try_from(SILENCE.as_millis()).unwrap_or(i64::MAX)
}

pub(super) async fn waits(connection: &mut SqliteConnection, short_ms: Option<f64>, now: i64) -> Outcome<bool> {
    let waits = concat!("SELECT EXISTS (SELECT 1 FROM jobs INDEXED BY precut_jobs_in_line WHERE ", in_line!(), ")");
    sqlx::query_scalar(waits).bind(now).bind(silence_ms()).bind(short_ms).fetch_one(connection).await
}

pub(super) async fn take(connection: &mut SqliteConnection, wanted: Wanted, now: i64) -> Outcome<Next> {
    if wanted.again {
        let lease = wanted.lease.to_string();
        let taken = runnable!("lease = ?1 AND state = 'running' ORDER BY id LIMIT 1");
        let taken: Option<Runnable> = sqlx::query_as(taken).bind(&lease).fetch_optional(&mut *connection).await?;
        if let Some(taken) = taken {
            let jobs: Vec<String> = sqlx::query_scalar("SELECT id FROM jobs WHERE lease = ?1 AND state = 'running'")
                .bind(lease)
                .fetch_all(connection)
                .await?;
            return Ok(Next::Run(taken.claim(wanted.lease, ids(&jobs)?)?));
        }
    }
    let next = runnable!(concat!(
        "id = (SELECT id FROM jobs INDEXED BY precut_jobs_in_line WHERE ",
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
        return Ok(Next::Suspect { id, is_shard: next.is_shard(), calculator: next.calculator });
    }
    start(connection, next, wanted.lease, charged, now).await.map(Next::Run)
}

/// The most starts charged to equal jobs that wait.
async fn charged(connection: &mut SqliteConnection, key: &[u8]) -> Outcome<u32> {
    sqlx::query_scalar("SELECT max(attempt) FROM jobs WHERE key = ?1 AND state = 'queued'")
        .bind(key)
        .fetch_one(connection)
        .await
}

pub(super) async fn hold(connection: &mut SqliteConnection, id: JobId, now: i64) -> Outcome<()> {
    sqlx::query(
        "UPDATE jobs SET heartbeat_ms = ?2
         WHERE key = (SELECT key FROM jobs WHERE id = ?1) AND state = 'queued'",
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
            "UPDATE jobs SET state = 'failed', problem = ?2, heartbeat_ms = NULL, finished_ms = ?3, expires_ms = ?4
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
    mut next: Runnable,
    lease: Lease,
    charged: u32,
    now: i64,
) -> Outcome<Box<Claim>> {
    let jobs: Vec<String> = sqlx::query_scalar(
        "UPDATE jobs
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
    if !next.is_shard() {
        sqlx::query("UPDATE jobs SET turn = ?1 WHERE state = 'running' AND priority = ?2 AND turn < ?1")
            .bind(next.turn)
            .bind(next.priority)
            .execute(connection)
            .await?;
    }
    next.attempt = charged + 1;
    next.claim(lease, ids(&jobs)?)
}

/// Puts the running jobs of some leases back in line, see [`put_back`].
pub(super) async fn requeue<L: std::fmt::Display>(
    connection: &mut SqliteConnection,
    leases: &[L],
    charged: bool,
) -> Outcome<Vec<JobId>> {
    let mut back = Vec::new();
    for lease in leases {
        back.extend(put_back(connection, &lease.to_string(), charged, i64::MAX).await?);
    }
    Ok(back)
}

pub(super) async fn cancel(connection: &mut SqliteConnection, id: JobId, at: (i64, i64)) -> Outcome<Option<Cancelled>> {
    let Some(job) = record(connection, id).await? else { return Ok(None) };
    let before = job.state;
    if before.is_final() {
        return Ok(Some(Cancelled { job, before, unwanted: None }));
    }
    set_cancelled(connection, id, at).await?;
    let unwanted = unwanted(connection, job.lease.as_slice()).await?.pop();
    let job = record(connection, id).await?.ok_or(sqlx::Error::RowNotFound)?;
    Ok(Some(Cancelled { job, before, unwanted }))
}

pub(super) async fn refuse(
    connection: &mut SqliteConnection,
    lease: Lease,
    of_whom_and_why: (&str, &str),
    at: (i64, i64),
) -> Outcome<Vec<JobId>> {
    let refused = fail_of_owner(connection, lease, of_whom_and_why, at).await?;
    requeue(connection, &[lease], false).await?;
    Ok(refused)
}

pub(super) async fn beat(connection: &mut SqliteConnection, beats: &[Beat], now: i64) -> Outcome<Vec<Lease>> {
    for beat in beats {
        sqlx::query(
            "UPDATE jobs SET heartbeat_ms = ?2, progress = ?3, stage = ?4 WHERE lease = ?1 AND state = 'running'",
        )
        .bind(beat.lease.to_string())
        .bind(now)
        .bind(beat.progress)
        .bind(&beat.stage)
        .execute(&mut *connection)
        .await?;
    }
    let leases: Vec<Lease> = beats.iter().map(|beat| beat.lease).collect();
    unwanted(connection, &leases).await
}
