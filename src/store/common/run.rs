//! How a job is taken, ended and put back. Where several processes do it, whoever does it holds the lock of the job's key.

use super::jobs::{end_leased, fail_of_owner, parsed, put_back, record, set_back, set_cancelled, unwanted};
use super::runnable::Runnable;
use super::shards;
use crate::store::jobs::{Cancelled, Claimed, JobId, JobState, Lease, MOST_ATTEMPTS, Next, Wanted};
use crate::store::sql::{KeyOf, Outcome, Session, sql};
use crate::store::sqlite_jobs::pack::PackedEnding;

/// The columns of a [`Runnable`]; `$1` is the job whose input is wanted.
macro_rules! taken {
    () => {
        "id, key, state, attempt, calculator, priority, turn, owner, created_ms, traceparent, tracestate,
         parent, shard, CASE WHEN id = $1 THEN input END AS input"
    };
}

/// What is first in line, at which time.
pub(in crate::store) struct First {
    pub(in crate::store) id: String,
    pub(in crate::store) key: Vec<u8>,
    pub(in crate::store) now: i64,
    /// It runs already.
    pub(in crate::store) begun: Option<Runnable>,
}

/// What was taken when the same was asked before.
pub(in crate::store) async fn taken_before<S: Session>(connection: &mut S, wanted: Wanted) -> Outcome<Option<Next>> {
    if !wanted.again {
        return Ok(None);
    }
    let taken =
        sql("SELECT id FROM jobs WHERE lease = $1 AND state = 'running' ORDER BY id LIMIT 1").bind(wanted.lease);
    let Some((id,)) = connection.first::<(String,)>(taken).await? else { return Ok(None) };
    Ok(match held(connection, &id, wanted.lease).await? {
        Claimed::Run(claim) => Some(Next::Run(claim)),
        _ => None,
    })
}

/// Takes what is first, and all equal ones.
pub(in crate::store) async fn take<S: Session>(
    connection: &mut S,
    first: First,
    lease: Lease,
    keep_ms: i64,
) -> Outcome<Next> {
    let First { id, key, now, begun } = first;
    if let Some(begun) = begun {
        return Ok(Next::Run(begun.claim(lease, vec![parsed(&id)?])?));
    }
    let start = Start { lease, most: MOST_ATTEMPTS - 1, problem: None };
    let taken = start.taken(connection, (&id, &key, now), keep_ms).await?;
    if let Claimed::Run(claim) = claimed(connection, &id, lease, taken).await? {
        return Ok(Next::Run(claim));
    }
    // It waits no more, or it has been charged too often to run beside others.
    let held = sql("UPDATE jobs SET heartbeat_ms = $3 WHERE key = $2 AND state = 'queued'
         RETURNING CASE WHEN id = $1 THEN calculator END, shard IS NOT NULL");
    let suspects: Vec<(Option<String>, bool)> = connection.all(held.bind(&id).bind(key).bind(now)).await?;
    let suspect = suspects.into_iter().find_map(|(calculator, is_shard)| Some((calculator?, is_shard)));
    Ok(match suspect {
        Some((calculator, is_shard)) => Next::Suspect { id: parsed(&id)?, calculator, is_shard },
        None => Next::Nothing,
    })
}

/// Under which lease jobs are taken. What was charged `most` starts already is failed with `problem`; without one it is
/// left where it is.
struct Start<'p> {
    lease: Lease,
    most: u32,
    problem: Option<&'p str>,
}

impl Start<'_> {
    /// Takes a job whose key is locked, and all equal ones.
    async fn taken<S: Session>(
        &self,
        connection: &mut S,
        (id, key, now): (&str, &[u8], i64),
        keep_ms: i64,
    ) -> Outcome<Vec<Runnable>> {
        let taken = sql(concat!(
            "UPDATE jobs
             SET state = CASE WHEN starts < $3 THEN 'running' ELSE 'failed' END,
                 attempt = CASE WHEN starts < $3 THEN starts + 1 ELSE attempt END,
                 lease = CASE WHEN starts < $3 THEN $4 END,
                 heartbeat_ms = CASE WHEN starts < $3 THEN CAST($5 AS bigint) END,
                 started_ms = CASE WHEN starts < $3 THEN CAST($5 AS bigint) ELSE started_ms END,
                 problem = CASE WHEN starts < $3 THEN NULL ELSE $6 END,
                 finished_ms = CASE WHEN starts < $3 THEN NULL ELSE CAST($5 AS bigint) END,
                 expires_ms = CASE WHEN starts < $3 THEN NULL ELSE CAST($5 AS bigint) + $7 END,
                 progress = 0.0, stage = NULL
             FROM (SELECT max(attempt) AS starts FROM jobs WHERE key = $2 AND state = 'queued'
                   HAVING max(CASE WHEN id = $1 THEN 1 ELSE 0 END) = 1
                       AND (CAST($6 AS text) IS NOT NULL OR max(attempt) < $3)) AS charged
             WHERE key = $2 AND state = 'queued' RETURNING ",
            taken!()
        ));
        let taken = taken.bind(id).bind(key).bind(self.most).bind(self.lease).bind(now).bind(self.problem);
        connection.all(taken.bind(keep_ms)).await
    }
}

pub(in crate::store) async fn claim<S: Session>(
    connection: &mut S,
    id: JobId,
    lease: Lease,
    (most, problem): (u32, &str),
    keep_ms: i64,
) -> Outcome<Claimed> {
    let Some((key, now)) = connection.lock_key(KeyOf::Job(id)).await? else { return Ok(Claimed::Nothing) };
    let id = id.to_string();
    let start = Start { lease, most, problem: Some(problem) };
    let taken = start.taken(connection, (&id, key.as_bytes(), now), keep_ms).await?;
    if taken.is_empty() {
        // The answer to a claim may be lost on its way: who asks again has it already.
        return held(connection, &id, lease).await;
    }
    claimed(connection, &id, lease, taken).await
}

/// What is computed under a lease.
async fn held<S: Session>(connection: &mut S, id: &str, lease: Lease) -> Outcome<Claimed> {
    let held = sql(concat!("SELECT ", taken!(), " FROM jobs WHERE lease = $2 AND state = 'running'"));
    let taken = connection.all(held.bind(id).bind(lease)).await?;
    claimed(connection, id, lease, taken).await
}

async fn claimed<S: Session>(connection: &mut S, id: &str, lease: Lease, taken: Vec<Runnable>) -> Outcome<Claimed> {
    let jobs = taken.iter().map(|job| parsed(&job.id)).collect::<Outcome<Vec<JobId>>>()?;
    // Nobody watches a shard begin.
    if !taken.iter().any(Runnable::is_shard) {
        connection.tell(&jobs, &[]).await?;
    }
    let Some(job) = taken.into_iter().find(|job| job.id == id) else { return Ok(Claimed::Nothing) };
    if job.state != JobState::Running.word() {
        return Ok(Claimed::Poisonous(jobs));
    }
    if !job.is_shard() {
        // The line has come to this place, however long others run that were taken before: who comes now begins behind it.
        // Rows that somebody else is about to write are left alone; nobody waits here.
        let mut come = sql("UPDATE jobs SET turn = $1 WHERE id IN (
             SELECT id FROM jobs WHERE state = 'running' AND priority = $2 AND turn < $1");
        come.push(S::SKIP_LOCKED).push(")");
        connection.run(come.bind(job.turn).bind(i64::from(job.priority))).await?;
    }
    Ok(Claimed::Run(job.claim(lease, jobs)?))
}

pub(in crate::store) async fn hold<S: Session>(connection: &mut S, id: JobId) -> Outcome<()> {
    let now = connection.now_ms().await?;
    let mut held = sql("UPDATE jobs SET heartbeat_ms = $2 WHERE id IN (
             SELECT id FROM jobs WHERE key = (SELECT key FROM jobs WHERE id = $1) AND state = 'queued'");
    held.push(S::SKIP_LOCKED).push(") AND state = 'queued'");
    connection.run(held.bind(id).bind(now)).await.map(drop)
}

pub(in crate::store) async fn finish<S: Session>(
    connection: &mut S,
    lease: Lease,
    ending: &PackedEnding,
    keep_ms: i64,
) -> Outcome<Vec<JobId>> {
    let Some((_, now)) = connection.lock_key(KeyOf::Lease(lease)).await? else { return Ok(Vec::new()) };
    let ended = end_leased(connection, lease, ending, (now, keep_ms)).await?;
    connection.tell(&ended, &[]).await?;
    Ok(ended)
}

pub(in crate::store) async fn add_shards<S: Session>(
    connection: &mut S,
    lease: Lease,
    numbers: &[u32],
) -> Outcome<bool> {
    if connection.lock_key(KeyOf::Lease(lease)).await?.is_none() {
        return Ok(false);
    }
    shards::add(connection, lease, numbers).await
}

/// Puts the running jobs of a lease back in line, see [`put_back`]: `silent_for_ms` says that it has to have been silent for
/// so long.
pub(in crate::store) async fn requeue<S: Session>(
    connection: &mut S,
    lease: Lease,
    charged: bool,
    silent_for_ms: Option<i64>,
) -> Outcome<Vec<JobId>> {
    let Some((_, now)) = connection.lock_key(KeyOf::Lease(lease)).await? else { return Ok(Vec::new()) };
    let heard_ms = silent_for_ms.map_or(i64::MAX, |ms| now.saturating_sub(ms));
    let back = put_back(connection, lease, charged, heard_ms).await?;
    connection.tell(&back, &[]).await?;
    Ok(back)
}

pub(in crate::store) async fn cancel<S: Session>(
    connection: &mut S,
    id: JobId,
    keep_ms: i64,
) -> Outcome<Option<Cancelled>> {
    let Some((_, now)) = connection.lock_key(KeyOf::Job(id)).await? else { return Ok(None) };
    let Some(job) = record(connection, id).await? else { return Ok(None) };
    let before = job.state;
    if before.is_final() {
        return Ok(Some(Cancelled { job, before, unwanted: None }));
    }
    set_cancelled(connection, id, (now, keep_ms)).await?;
    let unwanted = unwanted(connection, job.lease.as_slice()).await?.pop();
    connection.tell(&[id], unwanted.as_slice()).await?;
    let job = record(connection, id).await?.ok_or(sqlx::Error::RowNotFound)?;
    Ok(Some(Cancelled { job, before, unwanted }))
}

pub(in crate::store) async fn refuse<S: Session>(
    connection: &mut S,
    lease: Lease,
    of_whom_and_why: (&str, &str),
    keep_ms: i64,
) -> Outcome<Vec<JobId>> {
    let Some((_, now)) = connection.lock_key(KeyOf::Lease(lease)).await? else { return Ok(Vec::new()) };
    let refused = fail_of_owner(connection, lease, of_whom_and_why, (now, keep_ms)).await?;
    connection.tell(&refused, &[]).await?;
    requeue(connection, lease, false, None).await?;
    Ok(refused)
}

pub(in crate::store) async fn redo<S: Session>(connection: &mut S, id: JobId) -> Outcome<()> {
    if connection.lock_key(KeyOf::Job(id)).await?.is_some() && set_back(connection, id).await? {
        connection.tell(&[id], &[]).await?;
    }
    Ok(())
}
