//! How a job gets into line.

use sqlx::sqlite::SqliteConnection;

use super::pack::Packed;
use crate::store::common::callbacks::note;
use crate::store::common::jobs::{parsed, rank, record};
use crate::store::common::results::insert;
use crate::store::common::usage::usage;
use crate::store::jobs::{Accepted, JobState, yields_to};
use crate::store::row::ResultRow;
use crate::store::sql::Outcome;

/// The place of a new job in the order of its priority.
///
/// A client's jobs follow one another, and a client that has none waiting begins behind the first of the line. So two
/// clients take turns, however many jobs one of them has sent before the other came. A long job lets some later ones
/// pass, see [`yields_to`].
async fn turn(connection: &mut SqliteConnection, owner: &str, priority: i32, estimate_ms: f64) -> Outcome<i64> {
    let own: i64 =
        sqlx::query_scalar("SELECT count(*) FROM jobs WHERE state = 'queued' AND owner = ?1 AND priority = ?2")
            .bind(owner)
            .bind(priority)
            .fetch_one(&mut *connection)
            .await?;
    let first: Option<i64> = sqlx::query_scalar(
        "SELECT min(turn) FROM jobs WHERE state IN ('queued', 'running') AND priority = ?1 AND parent IS NULL",
    )
    .bind(priority)
    .fetch_one(&mut *connection)
    .await?;
    Ok(first.map_or(0, |first| first + 1) + own + yields_to(estimate_ms))
}

pub(super) async fn submit(
    connection: &mut SqliteConnection,
    packed: &Packed,
    queue_limit: u64,
    keep_ms: i64,
    now: i64,
) -> Outcome<Accepted> {
    let Packed { job, input, result } = packed;
    if let Some(idempotency) = &job.idempotency {
        let known: Option<(String, Vec<u8>)> =
            sqlx::query_as("SELECT id, body_hash FROM jobs WHERE owner = ?1 AND idempotency = ?2")
                .bind(&job.owner)
                .bind(&idempotency.key)
                .fetch_optional(&mut *connection)
                .await?;
        if let Some((id, body_hash)) = known {
            let id = parsed(&id)?;
            if body_hash != idempotency.body_hash {
                return Ok(Accepted::OtherBody(id));
            }
            return Ok(record(connection, id).await?.map_or(Accepted::OtherBody(id), Accepted::Known));
        }
    }
    if !job.quota.is_none() {
        let usage = usage(connection, &job.owner).await?;
        let work_ms = if result.is_some() { 0.0 } else { job.estimate_ms };
        if usage.beyond(&job.quota, work_ms).is_some() {
            return Ok(Accepted::OverQuota(usage));
        }
    }
    // An equal job that is being computed takes this one along.
    let running: Option<(String, u32, Option<i64>)> =
        sqlx::query_as("SELECT lease, attempt, started_ms FROM jobs WHERE key = ?1 AND state = 'running' LIMIT 1")
            .bind(job.key.as_bytes().as_slice())
            .fetch_optional(&mut *connection)
            .await?;
    let (state, lease, attempt, started_ms) = match (result, running) {
        (Some(_), _) => (JobState::Succeeded, None, 0, None),
        (None, Some((lease, attempt, started_ms))) => (JobState::Running, Some(lease), attempt, started_ms),
        (None, None) => (JobState::Queued, None, 0, None),
    };
    if state == JobState::Queued {
        let queued: i64 = sqlx::query_scalar("SELECT count(*) FROM jobs WHERE state = 'queued' AND parent IS NULL")
            .fetch_one(&mut *connection)
            .await?;
        let queued = u64::try_from(queued).unwrap_or(0);
        if queued >= queue_limit {
            return Ok(Accepted::QueueFull { queued });
        }
    }
    if let Some(result) = result {
        insert(connection, std::slice::from_ref(result), now).await?;
    }
    let finished = (state == JobState::Succeeded).then_some(now);
    let priority = rank(job.priority);
    let turn = turn(connection, &job.owner, priority, job.estimate_ms).await?;
    sqlx::query(
        // The one `kind` there is: to drop the column would write every job with its input anew.
        "INSERT INTO jobs (id, kind, calculator, version, key, input, state, progress, attempt, lease,
             heartbeat_ms, priority, turn, owner, idempotency, body_hash, estimate_ms, created_ms, started_ms,
             finished_ms, deadline_ms, expires_ms, input_bytes, result_bytes, traceparent, tracestate)
         VALUES (?1, 'calculation', ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20,
             ?21, length(?5), ?22, ?23, ?24)",
    )
    .bind(job.id.to_string())
    .bind(&job.calculator)
    .bind(job.version)
    .bind(job.key.as_bytes().as_slice())
    .bind(input)
    .bind(state.word())
    .bind(if finished.is_some() { 1.0 } else { 0.0 })
    .bind(attempt)
    .bind(&lease)
    .bind(lease.as_ref().map(|_| now))
    .bind(priority)
    .bind(turn)
    .bind(&job.owner)
    .bind(job.idempotency.as_ref().map(|idempotency| &idempotency.key))
    .bind(job.idempotency.as_ref().map(|idempotency| idempotency.body_hash.to_vec()))
    .bind(job.estimate_ms)
    .bind(now)
    .bind(started_ms.or(finished))
    .bind(finished)
    .bind(job.useful_for_ms.map(|after| now.saturating_add(after)))
    .bind(finished.map(|at| at.saturating_add(keep_ms)))
    .bind(result.as_ref().map_or(0, ResultRow::bytes))
    .bind(&job.traceparent)
    .bind(&job.tracestate)
    .execute(&mut *connection)
    .await?;
    if let Some(callback) = &job.callback {
        note(connection, job.id, callback, finished).await?;
    }
    let written = record(connection, job.id).await?.ok_or(sqlx::Error::RowNotFound)?;
    Ok(Accepted::New(written))
}
