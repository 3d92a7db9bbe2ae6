//! How a job gets into line.

use sqlx::postgres::PgConnection;

use super::{column, lock};
use crate::store::common::callbacks::note;
use crate::store::common::jobs::{parsed, rank, record};
use crate::store::common::results::insert;
use crate::store::common::usage::usage_of;
use crate::store::jobs::{Accepted, JobState, NewJob, yields_to};
use crate::store::row::ResultRow;
use crate::store::sql::Outcome;
use crate::store::sqlite_jobs::pack::Packed;

/// What a new job's place depends on.
struct Facts {
    lease: Option<String>,
    attempt: Option<i32>,
    started_ms: Option<i64>,
    /// Jobs of the owner, first place of all.
    own: i64,
    first: Option<i64>,
    queued: i64,
}

from_row!(Facts { lease, attempt, started_ms, own, first, queued });

/// See the SQLite store for the order of turns.
async fn facts(connection: &mut PgConnection, job: &NewJob, queue_limit: u64) -> Outcome<Facts> {
    sqlx::query_as(
        "SELECT running.lease, running.attempt, running.started_ms,
             (SELECT count(*) FROM jobs WHERE state = 'queued' AND owner = $2 AND priority = $3) AS own,
             (SELECT min(turn) FROM (SELECT min(turn) AS turn FROM jobs WHERE state = 'queued' AND priority = $3 AND parent IS NULL
                 UNION ALL SELECT min(turn) FROM jobs WHERE state = 'running' AND priority = $3) AS turns) AS first,
             (SELECT count(*) FROM (SELECT FROM jobs WHERE state = 'queued' AND parent IS NULL LIMIT $4) AS waiting) AS queued
         FROM (VALUES (1)) AS one
         LEFT JOIN LATERAL (SELECT lease, attempt, started_ms FROM jobs WHERE key = $1 AND state = 'running' LIMIT 1)
             AS running ON true",
    )
    .bind(job.key.as_bytes().as_slice())
    .bind(&job.owner)
    .bind(rank(job.priority))
    .bind(i64::try_from(queue_limit).unwrap_or(i64::MAX))
    .fetch_one(connection)
    .await
}

/// The job that the client asked for before by the same name.
async fn known(connection: &mut PgConnection, job: &NewJob) -> Outcome<Option<Accepted>> {
    let Some(idempotency) = &job.idempotency else { return Ok(None) };
    let known: Option<(String, Vec<u8>)> =
        sqlx::query_as("SELECT id, body_hash FROM jobs WHERE owner = $1 AND idempotency = $2")
            .bind(&job.owner)
            .bind(&idempotency.key)
            .fetch_optional(&mut *connection)
            .await?;
    let Some((id, body_hash)) = known else { return Ok(None) };
    let id = parsed(&id)?;
    if body_hash != idempotency.body_hash {
        return Ok(Some(Accepted::OtherBody(id)));
    }
    Ok(Some(record(connection, id).await?.map_or(Accepted::OtherBody(id), Accepted::Known)))
}

pub(super) async fn submit(
    connection: &mut PgConnection,
    packed: &Packed,
    (queue_limit, keep_ms, engine): (u64, i64, &str),
) -> Outcome<Accepted> {
    let Packed { job, input, result } = packed;
    let now = lock(connection, &job.key).await?;
    if let Some(known) = known(connection, job).await? {
        return Ok(known);
    }
    if !job.quota.is_none() {
        let usage = usage_of(connection, &job.owner).await?;
        let work_ms = if result.is_some() { 0.0 } else { job.estimate_ms };
        if usage.beyond(&job.quota, work_ms).is_some() {
            return Ok(Accepted::OverQuota(usage));
        }
    }
    let facts = facts(connection, job, queue_limit).await?;
    // An equal job that is being computed takes this one along.
    let (state, lease, attempt, started_ms) = match (result, facts.lease) {
        (Some(_), _) => (JobState::Succeeded, None, 0, None),
        (None, Some(lease)) => (JobState::Running, Some(lease), facts.attempt.unwrap_or(0), facts.started_ms),
        (None, None) => (JobState::Queued, None, 0, None),
    };
    if state == JobState::Queued {
        let queued = u64::try_from(facts.queued).unwrap_or(0);
        if queued >= queue_limit {
            return Ok(Accepted::QueueFull { queued });
        }
    }
    if let Some(result) = result {
        insert(connection, std::slice::from_ref(result), now).await?;
    }
    let finished = (state == JobState::Succeeded).then_some(now);
    let priority = rank(job.priority);
    let turn = facts.first.map_or(0, |first| first + 1) + facts.own + yields_to(job.estimate_ms);
    let written = sqlx::query(
        // The one `kind` there is: programs before this read it, and may run beside it.
        "INSERT INTO jobs (id, kind, calculator, version, engine, key, input, state, progress, attempt, lease,
             heartbeat_ms, priority, turn, owner, idempotency, body_hash, estimate_ms, created_ms, started_ms,
             finished_ms, deadline_ms, expires_ms, input_bytes, result_bytes, traceparent, tracestate)
         VALUES ($1, 'calculation', $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16, $17, $18, $19, $20,
             $21, $22, octet_length($6::bytea), $23, $24, $25)
         ON CONFLICT (owner, idempotency) DO NOTHING",
    )
    .bind(job.id.to_string())
    .bind(&job.calculator)
    .bind(column(job.version))
    .bind(engine)
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
    if written.rows_affected() == 0 {
        // Somebody else was faster: his is the job.
        return known(connection, job).await?.ok_or(sqlx::Error::RowNotFound);
    }
    if let Some(callback) = &job.callback {
        note(connection, job.id, callback, finished).await?;
    }
    let written = record(connection, job.id).await?.ok_or(sqlx::Error::RowNotFound)?;
    Ok(Accepted::New(written))
}
