//! How a job is taken, ended and put back.

use sqlx::FromRow;
use sqlx::sqlite::SqliteConnection;

use super::pack::PackedEnding;
use super::record::{Outcome, ids, json_list, parsed, record, unreadable};
use crate::store::jobs::{Beat, Cancelled, Claim, Claimed, JobId, JobKind, JobState, Lease};
use crate::store::{queue, row};

/// A waiting job with what it takes to run it.
#[derive(FromRow)]
struct Waiting {
    key: Vec<u8>,
    kind: String,
    calculator: String,
    input: Vec<u8>,
    priority: i64,
    turn: i64,
}

pub(super) async fn claim(
    connection: &mut SqliteConnection,
    id: JobId,
    lease: Lease,
    (most, problem): (u32, &str),
    keep_ms: i64,
    now: i64,
) -> Outcome<Claimed> {
    let waiting: Option<Waiting> = sqlx::query_as(
        "SELECT key, kind, calculator, input, priority, turn FROM precut_jobs WHERE id = ?1 AND state = 'queued'",
    )
    .bind(id.to_string())
    .fetch_optional(&mut *connection)
    .await?;
    let Some(Waiting { key, kind, calculator, input, priority, turn }) = waiting else { return Ok(Claimed::Nothing) };
    let charged: u32 = sqlx::query_scalar("SELECT max(attempt) FROM precut_jobs WHERE key = ?1 AND state = 'queued'")
        .bind(&key)
        .fetch_one(&mut *connection)
        .await?;
    if charged >= most {
        let failed: Vec<String> = sqlx::query_scalar(
            "UPDATE precut_jobs SET state = 'failed', problem = ?2, finished_ms = ?3, expires_ms = ?4
             WHERE key = ?1 AND state = 'queued' RETURNING id",
        )
        .bind(&key)
        .bind(problem)
        .bind(now)
        .bind(now.saturating_add(keep_ms))
        .fetch_all(connection)
        .await?;
        return Ok(Claimed::Poisonous(ids(&failed)?));
    }
    let jobs: Vec<String> = sqlx::query_scalar(
        "UPDATE precut_jobs
         SET state = 'running', attempt = ?2, lease = ?3, heartbeat_ms = ?4, started_ms = ?4, progress = 0.0, stage = NULL
         WHERE key = ?1 AND state = 'queued' RETURNING id",
    )
    .bind(&key)
    .bind(charged + 1)
    .bind(lease.to_string())
    .bind(now)
    .fetch_all(&mut *connection)
    .await?;
    // The line has come to this place, however long others run that were taken before: who comes now begins behind it.
    sqlx::query("UPDATE precut_jobs SET turn = ?1 WHERE state = 'running' AND priority = ?2 AND turn < ?1")
        .bind(turn)
        .bind(priority)
        .execute(connection)
        .await?;
    // A damaged input is nothing that can be run: who claims it finds that out and says so on the record.
    let input = zstd::decode_all(&*input).unwrap_or_default();
    let kind = JobKind::of_word(&kind).ok_or_else(|| unreadable("kind"))?;
    let jobs = ids(&jobs)?;
    Ok(Claimed::Run(Claim { lease, jobs, kind, calculator, input: input.into(), attempt: charged + 1 }))
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
    .fetch_all(&mut *connection)
    .await?;
    queue::push(connection, &back).await?;
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
    id: JobId,
    problem: &str,
    keep_ms: i64,
    now: i64,
) -> Outcome<bool> {
    let refused = sqlx::query(
        "UPDATE precut_jobs SET state = 'failed', problem = ?2, finished_ms = ?3, expires_ms = ?4
         WHERE id = ?1 AND state = 'queued'",
    )
    .bind(id.to_string())
    .bind(problem)
    .bind(now)
    .bind(now.saturating_add(keep_ms))
    .execute(connection)
    .await?;
    Ok(refused.rows_affected() > 0)
}

pub(super) async fn redo(connection: &mut SqliteConnection, id: JobId) -> Outcome<()> {
    sqlx::query("DELETE FROM results WHERE key = (SELECT key FROM precut_jobs WHERE id = ?1 AND state = 'succeeded')")
        .bind(id.to_string())
        .execute(&mut *connection)
        .await?;
    let back: Vec<String> = sqlx::query_scalar(
        "UPDATE precut_jobs SET state = 'queued', attempt = 0, progress = 0.0, started_ms = NULL, finished_ms = NULL,
             expires_ms = NULL, deadline_ms = NULL, result_bytes = 0
         WHERE id = ?1 AND state = 'succeeded' RETURNING id",
    )
    .bind(id.to_string())
    .fetch_all(&mut *connection)
    .await?;
    queue::push(connection, &back).await
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
