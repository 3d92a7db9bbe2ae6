//! How a job is taken, ended and put back. Whoever does it holds the lock of the job's key.

use sqlx::FromRow;
use sqlx::postgres::PgConnection;

use super::record::{Outcome, column, count, ids, record, texts};
use super::{lock_job, lock_lease, news, queue, results};
use crate::store::jobs::{Beat, Cancelled, Claim, Claimed, JobId, JobKind, JobState, Lease};
use crate::store::row::ResultRow;
use crate::store::sqlite_jobs::pack::PackedEnding;
use crate::store::sqlite_jobs::record::{parsed, unreadable};

/// A job that was taken, or given up.
#[derive(FromRow)]
struct TakenRow {
    id: String,
    state: String,
    attempt: i32,
    kind: String,
    calculator: String,
    priority: i32,
    turn: i64,
    /// Of one of them only: they are equal.
    input: Option<Vec<u8>>,
}

pub(super) async fn claim(
    connection: &mut PgConnection,
    id: JobId,
    lease: Lease,
    (most, problem): (u32, &str),
    keep_ms: i64,
) -> Outcome<Claimed> {
    let id = id.to_string();
    let Some((key, now)) = lock_job(connection, &id).await? else { return Ok(Claimed::Nothing) };
    let mut taken: Vec<TakenRow> = sqlx::query_as(
        "WITH line AS (SELECT id, attempt FROM precut.jobs WHERE key = $1 AND state = 'queued'),
              charged AS (SELECT max(attempt) AS starts FROM line HAVING bool_or(id = $2))
         UPDATE precut.jobs AS job
         SET state = CASE WHEN starts < $3 THEN 'running' ELSE 'failed' END,
             attempt = CASE WHEN starts < $3 THEN starts + 1 ELSE job.attempt END,
             lease = CASE WHEN starts < $3 THEN $4 END,
             heartbeat_ms = CASE WHEN starts < $3 THEN $5::bigint END,
             started_ms = CASE WHEN starts < $3 THEN $5::bigint ELSE started_ms END,
             problem = CASE WHEN starts < $3 THEN NULL ELSE $6 END,
             finished_ms = CASE WHEN starts < $3 THEN NULL ELSE $5::bigint END,
             expires_ms = CASE WHEN starts < $3 THEN NULL ELSE $5::bigint + $7 END,
             progress = 0, stage = NULL
         FROM line, charged WHERE job.id = line.id AND job.state = 'queued'
         RETURNING job.id, job.state, job.attempt, job.kind, job.calculator, job.priority, job.turn,
             CASE WHEN job.id = $2 THEN job.input END AS input",
    )
    .bind(key.as_bytes().as_slice())
    .bind(&id)
    .bind(column(most))
    .bind(lease.to_string())
    .bind(now)
    .bind(problem)
    .bind(keep_ms)
    .fetch_all(&mut *connection)
    .await?;
    if taken.is_empty() {
        // The answer to a claim may be lost on its way: who asks again has it already.
        taken = sqlx::query_as(
            "SELECT id, state, attempt, kind, calculator, priority, turn, CASE WHEN id = $2 THEN input END AS input
             FROM precut.jobs WHERE lease = $1 AND state = 'running'",
        )
        .bind(lease.to_string())
        .bind(&id)
        .fetch_all(&mut *connection)
        .await?;
    }
    let jobs = taken.iter().map(|job| parsed(&job.id)).collect::<Outcome<Vec<JobId>>>()?;
    news::tell(connection, &jobs, &[]).await?;
    let Some(job) = taken.into_iter().find(|job| job.id == id) else { return Ok(Claimed::Nothing) };
    if job.state != JobState::Running.word() {
        return Ok(Claimed::Poisonous(jobs));
    }
    // The line has come to this place, however long others run that were taken before: who comes now begins behind it.
    // Rows that somebody else is about to write are left alone; nobody waits here.
    sqlx::query(
        "UPDATE precut.jobs SET turn = $1 WHERE id IN (
             SELECT id FROM precut.jobs WHERE state = 'running' AND priority = $2 AND turn < $1 FOR UPDATE SKIP LOCKED)",
    )
    .bind(job.turn)
    .bind(job.priority)
    .execute(connection)
    .await?;
    Ok(Claimed::Run(Claim {
        lease,
        jobs,
        kind: JobKind::of_word(&job.kind).ok_or_else(|| unreadable("kind"))?,
        calculator: job.calculator,
        // A damaged input is nothing that can be run: who claims it finds that out and says so on the record.
        input: zstd::decode_all(job.input.unwrap_or_default().as_slice()).unwrap_or_default().into(),
        attempt: count(job.attempt),
    }))
}

pub(super) async fn finish(
    connection: &mut PgConnection,
    lease: Lease,
    ending: &PackedEnding,
    keep_ms: i64,
) -> Outcome<Vec<JobId>> {
    let Some((_, now)) = lock_lease(connection, lease).await? else { return Ok(Vec::new()) };
    let (state, problem, result) = match ending {
        PackedEnding::Succeeded(result) => (JobState::Succeeded, None, Some(result)),
        PackedEnding::Failed(problem) => (JobState::Failed, Some(problem), None),
    };
    let ended: Vec<String> = sqlx::query_scalar(
        "UPDATE precut.jobs
         SET state = $2, problem = $3, progress = CASE WHEN $2 = 'succeeded' THEN 1.0 ELSE progress END, stage = NULL,
             lease = NULL, heartbeat_ms = NULL, finished_ms = $4, expires_ms = $4::bigint + $5, key = coalesce($6, key),
             result_bytes = $7
         WHERE lease = $1 AND state = 'running' RETURNING id",
    )
    .bind(lease.to_string())
    .bind(state.word())
    .bind(problem)
    .bind(now)
    .bind(keep_ms)
    .bind(result.map(|result| result.key.clone()))
    .bind(result.map_or(0, ResultRow::bytes))
    .fetch_all(&mut *connection)
    .await?;
    if let Some(result) = result
        && !ended.is_empty()
    {
        results::insert(connection, std::slice::from_ref(result), now).await?;
    }
    let ended = ids(&ended)?;
    news::tell(connection, &ended, &[]).await?;
    Ok(ended)
}

/// Puts the running jobs of a lease back in line: `charged` says whether the start counts, `silent_for_ms` that it has
/// to have been silent for so long. One that was charged twice goes behind all others.
pub(super) async fn requeue(
    connection: &mut PgConnection,
    lease: Lease,
    charged: bool,
    silent_for_ms: Option<i64>,
) -> Outcome<Vec<JobId>> {
    let Some((_, now)) = lock_lease(connection, lease).await? else { return Ok(Vec::new()) };
    let back: Vec<String> = sqlx::query_scalar(
        "UPDATE precut.jobs AS job
         SET state = 'queued', lease = NULL, heartbeat_ms = NULL, started_ms = NULL, progress = 0, stage = NULL,
             attempt = greatest(0, attempt - $2),
             turn = CASE WHEN $2 = 0 AND attempt > 1
                    THEN 1 + (SELECT max(turn) FROM precut.jobs AS other WHERE other.priority = job.priority
                              AND other.state IN ('queued', 'running'))
                    ELSE turn END
         WHERE lease = $1 AND state = 'running' AND heartbeat_ms <= $3 RETURNING id",
    )
    .bind(lease.to_string())
    .bind(i32::from(!charged))
    .bind(silent_for_ms.map_or(i64::MAX, |ms| now.saturating_sub(ms)))
    .fetch_all(&mut *connection)
    .await?;
    queue::push(connection, &back).await?;
    let back = ids(&back)?;
    news::tell(connection, &back, &[]).await?;
    Ok(back)
}

/// Of these leases the ones that no running job has.
pub(super) async fn unwanted(connection: &mut PgConnection, leases: &[String]) -> Outcome<Vec<Lease>> {
    if leases.is_empty() {
        return Ok(Vec::new());
    }
    let gone: Vec<String> = sqlx::query_scalar(
        "SELECT DISTINCT lease FROM unnest($1::text[]) AS asked (lease)
         WHERE NOT EXISTS (SELECT FROM precut.jobs WHERE jobs.lease = asked.lease AND state = 'running')",
    )
    .bind(leases)
    .fetch_all(connection)
    .await?;
    gone.iter().map(|lease| parsed(lease)).collect()
}

pub(super) async fn cancel(connection: &mut PgConnection, id: JobId, keep_ms: i64) -> Outcome<Option<Cancelled>> {
    let Some((_, now)) = lock_job(connection, &id.to_string()).await? else { return Ok(None) };
    let Some(job) = record(connection, id).await? else { return Ok(None) };
    let before = job.state;
    if before.is_final() {
        return Ok(Some(Cancelled { job, before, unwanted: None }));
    }
    sqlx::query(
        "UPDATE precut.jobs SET state = 'cancelled', lease = NULL, heartbeat_ms = NULL, stage = NULL, finished_ms = $2,
             expires_ms = $2::bigint + $3 WHERE id = $1 AND state IN ('queued', 'running')",
    )
    .bind(id.to_string())
    .bind(now)
    .bind(keep_ms)
    .execute(&mut *connection)
    .await?;
    let unwanted = match job.lease {
        Some(lease) => unwanted(connection, &[lease.to_string()]).await?.pop(),
        None => None,
    };
    news::tell(connection, &[id], unwanted.as_slice()).await?;
    let job = record(connection, id).await?.ok_or(sqlx::Error::RowNotFound)?;
    Ok(Some(Cancelled { job, before, unwanted }))
}

pub(super) async fn refuse(connection: &mut PgConnection, id: JobId, problem: &str, keep_ms: i64) -> Outcome<bool> {
    let Some((_, now)) = lock_job(connection, &id.to_string()).await? else { return Ok(false) };
    let refused = sqlx::query(
        "UPDATE precut.jobs SET state = 'failed', problem = $2, finished_ms = $3, expires_ms = $3::bigint + $4
         WHERE id = $1 AND state = 'queued'",
    )
    .bind(id.to_string())
    .bind(problem)
    .bind(now)
    .bind(keep_ms)
    .execute(&mut *connection)
    .await?;
    let is_refused = refused.rows_affected() > 0;
    if is_refused {
        news::tell(connection, &[id], &[]).await?;
    }
    Ok(is_refused)
}

pub(super) async fn redo(connection: &mut PgConnection, id: JobId) -> Outcome<()> {
    let id = id.to_string();
    let Some((key, _)) = lock_job(connection, &id).await? else { return Ok(()) };
    let back: Vec<String> = sqlx::query_scalar(
        "UPDATE precut.jobs SET state = 'queued', attempt = 0, progress = 0, started_ms = NULL, finished_ms = NULL,
             expires_ms = NULL, deadline_ms = NULL, result_bytes = 0
         WHERE id = $1 AND state = 'succeeded' RETURNING id",
    )
    .bind(&id)
    .fetch_all(&mut *connection)
    .await?;
    if back.is_empty() {
        return Ok(());
    }
    sqlx::query("DELETE FROM precut.results WHERE key = $1")
        .bind(key.as_bytes().as_slice())
        .execute(&mut *connection)
        .await?;
    queue::push(connection, &back).await?;
    news::tell(connection, &ids(&back)?, &[]).await
}

/// Notes how far computations are; which of them nobody wants any more.
pub(super) async fn beat(connection: &mut PgConnection, beats: &[Beat]) -> Outcome<Vec<Lease>> {
    let leases: Vec<Lease> = beats.iter().map(|beat| beat.lease).collect();
    let wanted: Vec<String> = sqlx::query_scalar(
        "UPDATE precut.jobs AS job SET heartbeat_ms = precut.now_ms(), progress = beat.progress, stage = beat.stage
         FROM unnest($1::text[], $2::float8[], $3::text[]) AS beat (lease, progress, stage)
         WHERE job.lease = beat.lease AND job.state = 'running' RETURNING job.lease",
    )
    .bind(texts(&leases))
    .bind(beats.iter().map(|beat| beat.progress).collect::<Vec<f64>>())
    .bind(beats.iter().map(|beat| beat.stage.clone()).collect::<Vec<Option<String>>>())
    .fetch_all(connection)
    .await?;
    let mut gone = leases;
    gone.retain(|lease| !wanted.contains(&lease.to_string()));
    Ok(gone)
}
