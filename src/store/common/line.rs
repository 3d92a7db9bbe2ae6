//! How a job gets into line.

use super::callbacks::note;
use super::jobs::{parsed, rank, record};
use super::results::insert;
use super::usage::usage_of;
use crate::store::jobs::{Accepted, JobState, NewJob, yields_to};
use crate::store::row::ResultRow;
use crate::store::sql::{Outcome, Session, Value, sql};
use crate::store::sqlite_jobs::pack::Packed;

/// What a store goes by where it accepts a job.
#[derive(Debug, Clone, Copy)]
pub(in crate::store) struct Terms<'a> {
    /// So many may wait.
    pub(in crate::store) queue_limit: u64,
    pub(in crate::store) now: i64,
    pub(in crate::store) keep_ms: i64,
    /// Version of the program, where several share the jobs.
    pub(in crate::store) engine: Option<&'a str>,
}

/// What a new job's place depends on.
struct Facts {
    lease: Option<String>,
    attempt: Option<i32>,
    started_ms: Option<i64>,
    /// Jobs of the owner that wait.
    own: i64,
    /// The first place of all.
    first: Option<i64>,
    queued: i64,
}

from_row!(Facts { lease, attempt, started_ms, own, first, queued });

impl Facts {
    /// The place of a new job in the order of its priority.
    ///
    /// A client's jobs follow one another, and a client that has none waiting begins behind the first of the line. So two
    /// clients take turns, however many jobs one of them has sent before the other came. A long job lets some later ones
    /// pass, see [`yields_to`].
    fn turn(&self, estimate_ms: f64) -> i64 {
        self.first.map_or(0, |first| first + 1) + self.own + yields_to(estimate_ms)
    }
}

async fn facts<S: Session>(connection: &mut S, job: &NewJob, queue_limit: u64) -> Outcome<Facts> {
    let facts = sql("SELECT running.lease, running.attempt, running.started_ms,
             (SELECT count(*) FROM jobs WHERE state = 'queued' AND owner = $2 AND priority = $3) AS own,
             (SELECT min(turn) FROM (
                 SELECT min(turn) AS turn FROM jobs WHERE state = 'queued' AND priority = $3 AND parent IS NULL
                 UNION ALL SELECT min(turn) FROM jobs WHERE state = 'running' AND priority = $3) AS turns) AS first,
             (SELECT count(*) FROM (
                 SELECT 1 FROM jobs WHERE state = 'queued' AND parent IS NULL LIMIT $4) AS waiting) AS queued
         FROM (SELECT 1) AS one
         LEFT JOIN (SELECT lease, attempt, started_ms FROM jobs WHERE key = $1 AND state = 'running' LIMIT 1) AS running
             ON true");
    let facts = facts.bind(job.key).bind(&job.owner).bind(i64::from(rank(job.priority)));
    connection.one(facts.bind(i64::try_from(queue_limit).unwrap_or(i64::MAX))).await
}

/// The job that the client asked for before by the same name.
async fn known<S: Session>(connection: &mut S, job: &NewJob) -> Outcome<Option<Accepted>> {
    let Some(idempotency) = &job.idempotency else { return Ok(None) };
    let known = sql("SELECT id, body_hash FROM jobs WHERE owner = $1 AND idempotency = $2");
    let known: Option<(String, Vec<u8>)> = connection.first(known.bind(&job.owner).bind(&idempotency.key)).await?;
    let Some((id, body_hash)) = known else { return Ok(None) };
    let id = parsed(&id)?;
    if body_hash != idempotency.body_hash {
        return Ok(Some(Accepted::OtherBody(id)));
    }
    Ok(Some(record(connection, id).await?.map_or(Accepted::OtherBody(id), Accepted::Known)))
}

/// Accepts a job. Where several processes do, whoever does it has the lock of its key.
pub(in crate::store) async fn submit<S: Session>(
    connection: &mut S,
    packed: &Packed,
    terms: Terms<'_>,
) -> Outcome<Accepted> {
    let Packed { job, result, .. } = packed;
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
    let facts = facts(connection, job, terms.queue_limit).await?;
    let queued = u64::try_from(facts.queued).unwrap_or(0);
    if result.is_none() && facts.lease.is_none() && queued >= terms.queue_limit {
        return Ok(Accepted::QueueFull { queued });
    }
    if let Some(result) = result {
        insert(connection, std::slice::from_ref(result), terms.now).await?;
    }
    if !write(connection, packed, &facts, terms).await? {
        // Somebody else was faster: his is the job.
        return known(connection, job).await?.ok_or(sqlx::Error::RowNotFound);
    }
    if let Some(callback) = &job.callback {
        note(connection, job.id, callback, result.as_ref().map(|_| terms.now)).await?;
    }
    let written = record(connection, job.id).await?.ok_or(sqlx::Error::RowNotFound)?;
    Ok(Accepted::New(written))
}

/// Puts a job on record; whether none has its name with the client.
async fn write<S: Session>(connection: &mut S, packed: &Packed, facts: &Facts, terms: Terms<'_>) -> Outcome<bool> {
    let Packed { job, input, result } = packed;
    let Terms { now, keep_ms, engine, .. } = terms;
    // An equal job that is being computed takes this one along.
    let (state, lease, attempt, started_ms) = match (result, &facts.lease) {
        (Some(_), _) => (JobState::Succeeded, None, None, None),
        (None, Some(lease)) => (JobState::Running, Some(lease), facts.attempt, facts.started_ms),
        (None, None) => (JobState::Queued, None, None, None),
    };
    let finished = result.as_ref().map(|_| now);
    let idempotency = job.idempotency.as_ref();
    let mut written =
        sql("INSERT INTO jobs (id, kind, calculator, version, key, input, state, progress, attempt, lease,
             heartbeat_ms, priority, turn, owner, idempotency, body_hash, estimate_ms, created_ms, started_ms,
             finished_ms, deadline_ms, expires_ms, input_bytes, result_bytes, traceparent, tracestate");
    written.push(if engine.is_some() { ", engine" } else { "" }).push(") VALUES ");
    let values: [Value; 26] = [
        job.id.into(),
        // The one kind there is. Programs before this read it, and may run beside it.
        "calculation".into(),
        (&job.calculator).into(),
        job.version.into(),
        job.key.into(),
        input.clone().into(),
        state.word().into(),
        Value::Real(if finished.is_some() { 1.0 } else { 0.0 }),
        i64::from(attempt.unwrap_or(0)).into(),
        lease.cloned().into(),
        lease.map(|_| now).into(),
        i64::from(rank(job.priority)).into(),
        facts.turn(job.estimate_ms).into(),
        (&job.owner).into(),
        idempotency.map(|idempotency| idempotency.key.as_str()).into(),
        idempotency.map(|idempotency| idempotency.body_hash.to_vec()).into(),
        job.estimate_ms.into(),
        now.into(),
        started_ms.or(finished).into(),
        finished.into(),
        job.useful_for_ms.map(|after| now.saturating_add(after)).into(),
        finished.map(|at| at.saturating_add(keep_ms)).into(),
        i64::try_from(input.len()).unwrap_or(i64::MAX).into(),
        result.as_ref().map_or(0, ResultRow::bytes).into(),
        (&job.traceparent).into(),
        (&job.tracestate).into(),
    ];
    written.push_list(values.into_iter().chain(engine.map(Value::from)));
    written.push(" ON CONFLICT (owner, idempotency) DO NOTHING");
    Ok(connection.run(written).await? > 0)
}
