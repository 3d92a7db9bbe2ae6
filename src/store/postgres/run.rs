//! How a job is taken, ended and put back. Whoever does it holds the lock of the job's key.

use sqlx::postgres::{PgConnection, PgPool, PgRow};
use sqlx::{FromRow, Row as _};

use super::news::told;
use super::{column, lock_job, lock_lease, news, texts};
use crate::store::common::jobs::{
    self, Runnable, end_job, fail_of_owner, parsed, put_back, record, set_back, set_cancelled, unwanted,
};
use crate::store::common::shards::{self, BEHIND, MOST_OF_PARENT, get_on, give_turn};
use crate::store::jobs::{Beat, Cancelled, Claimed, JobId, JobState, Lease, MOST_ATTEMPTS, Next, Wanted};
use crate::store::sql::{Outcome, Session as _, sql};
use crate::store::sqlite_jobs::pack::PackedEnding;

/// Of what waits so many are looked at for one that nobody else is about to take.
const LOOKED_AT: i64 = 64;

/// The columns of a [`Runnable`]; `$1` is the job whose input is wanted.
macro_rules! taken {
    () => {
        "id, key, state, attempt, calculator, priority, turn, owner, created_ms, traceparent, tracestate, \
         parent, shard, CASE WHEN id = $1 THEN input END AS input"
    };
}

/// What waits and may be taken: `$1` is the version, `$2` how long others keep away from what is held, `$3` the longest job,
/// which is no shard.
macro_rules! in_line {
    () => {
        "state = 'queued' AND engine = $1 AND (heartbeat_ms IS NULL OR heartbeat_ms <= now_ms() - $2) \
         AND ($3::float8 IS NULL OR (estimate_ms <= $3 AND attempt = 0 AND parent IS NULL)) \
         AND (parent IS NULL OR EXISTS ( \
             SELECT FROM jobs AS whole WHERE whole.key = jobs.parent AND whole.state = 'running'))"
    };
}

/// Who asks for the next job: of which version, and how long others keep away from what somebody holds.
#[derive(Clone)]
pub(super) struct Taker {
    pub(super) engine: String,
    pub(super) silence_ms: i64,
}

pub(super) async fn waits(pool: &PgPool, taker: &Taker, short_ms: Option<f64>) -> Outcome<bool> {
    sqlx::query_scalar(concat!("SELECT EXISTS (SELECT FROM jobs WHERE ", in_line!(), ")"))
        .bind(&taker.engine)
        .bind(taker.silence_ms)
        .bind(short_ms)
        .fetch_one(pool)
        .await
}

pub(super) async fn take(connection: &mut PgConnection, taker: Taker, wanted: Wanted, keep_ms: i64) -> Outcome<Next> {
    if wanted.again {
        let id: Option<String> =
            sqlx::query_scalar("SELECT id FROM jobs WHERE lease = $1 AND state = 'running' ORDER BY id LIMIT 1")
                .bind(wanted.lease.to_string())
                .fetch_optional(&mut *connection)
                .await?;
        if let Some(id) = id
            && let Claimed::Run(claim) = held(connection, &id, wanted.lease).await?
        {
            return Ok(Next::Run(claim));
        }
    }
    let First { id, key, now, .. } = match first(connection, &taker, wanted).await? {
        None => return Ok(Next::Nothing),
        Some(First { id, begun: Some(shard), .. }) => {
            return Ok(Next::Run(shard.claim(wanted.lease, vec![parsed(&id)?])?));
        }
        Some(first) => first,
    };
    let start = Start { lease: wanted.lease, most: MOST_ATTEMPTS - 1, problem: None };
    let taken = start.taken(connection, (&id, &key, now), keep_ms).await?;
    if let Claimed::Run(claim) = claimed(connection, &id, wanted.lease, taken).await? {
        return Ok(Next::Run(claim));
    }
    // It waits no more, or it has been charged too often to run beside others.
    let suspects: Vec<(Option<String>, bool)> = sqlx::query_as(
        "UPDATE jobs SET heartbeat_ms = $3 WHERE key = $2 AND state = 'queued'
         RETURNING CASE WHEN id = $1 THEN calculator END, shard IS NOT NULL",
    )
    .bind(&id)
    .bind(&key)
    .bind(now)
    .fetch_all(connection)
    .await?;
    let suspect = suspects.into_iter().find_map(|(calculator, is_shard)| Some((calculator?, is_shard)));
    Ok(match suspect {
        Some((calculator, is_shard)) => Next::Suspect { id: parsed(&id)?, calculator, is_shard },
        None => Next::Nothing,
    })
}

/// What is first in line, at which time.
struct First {
    id: String,
    key: Vec<u8>,
    now: i64,
    /// A shard runs already.
    begun: Option<Runnable>,
}

impl FromRow<'_, PgRow> for First {
    fn from_row(row: &PgRow) -> Outcome<Self> {
        let is_begun = row.try_get::<Option<String>, _>("state")?.is_some();
        let begun = if is_begun { Some(Runnable::from_row(row)?) } else { None };
        Ok(Self { id: row.try_get("id")?, key: row.try_get("key")?, now: row.try_get("now")?, begun })
    }
}

/// The first in line whose key nobody else has, with the lock of its key. Who is about to take another is passed over, not
/// waited for. A shard is taken at once: there are many of them, and none has an equal one.
async fn first(connection: &mut PgConnection, taker: &Taker, wanted: Wanted) -> Outcome<Option<First>> {
    // The rows are materialised in order, and looked at one after the other until a lock is there: no other is taken.
    sqlx::query_as(concat!(
        "WITH line AS MATERIALIZED (SELECT id, key FROM jobs WHERE ",
        in_line!(),
        " ORDER BY priority DESC, turn, id LIMIT $4),
         first AS MATERIALIZED (
             SELECT id, key, now_ms() AS now FROM line WHERE pg_try_advisory_xact_lock(lock_of(key)) LIMIT 1),
         begun AS (
             UPDATE jobs SET state = 'running', attempt = attempt + 1, lease = $5, heartbeat_ms = first.now,
                 started_ms = first.now, progress = 0, stage = NULL
             FROM first WHERE jobs.id = first.id AND shard IS NOT NULL AND state = 'queued' AND attempt < $6
             RETURNING state, attempt, calculator, priority, turn, owner, created_ms, traceparent, tracestate, parent, shard)
         SELECT first.*, begun.*, NULL::bytea AS input FROM first LEFT JOIN begun ON true"
    ))
    .bind(&taker.engine)
    .bind(taker.silence_ms)
    .bind(wanted.short_ms)
    .bind(LOOKED_AT)
    .bind(wanted.lease.to_string())
    .bind(column(MOST_ATTEMPTS - 1))
    .fetch_optional(connection)
    .await
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
    async fn taken(
        &self,
        connection: &mut PgConnection,
        (id, key, now): (&str, &[u8], i64),
        keep_ms: i64,
    ) -> Outcome<Vec<Runnable>> {
        sqlx::query_as(concat!(
            "UPDATE jobs
             SET state = CASE WHEN starts < $3 THEN 'running' ELSE 'failed' END,
                 attempt = CASE WHEN starts < $3 THEN starts + 1 ELSE attempt END,
                 lease = CASE WHEN starts < $3 THEN $4 END,
                 heartbeat_ms = CASE WHEN starts < $3 THEN $5::bigint END,
                 started_ms = CASE WHEN starts < $3 THEN $5::bigint ELSE started_ms END,
                 problem = CASE WHEN starts < $3 THEN NULL ELSE $6 END,
                 finished_ms = CASE WHEN starts < $3 THEN NULL ELSE $5::bigint END,
                 expires_ms = CASE WHEN starts < $3 THEN NULL ELSE $5::bigint + $7 END,
                 progress = 0, stage = NULL
             FROM (SELECT max(attempt) AS starts FROM jobs WHERE key = $2 AND state = 'queued'
                   HAVING bool_or(id = $1) AND ($6::text IS NOT NULL OR max(attempt) < $3)) AS charged
             WHERE key = $2 AND state = 'queued' RETURNING ",
            taken!()
        ))
        .bind(id)
        .bind(key)
        .bind(column(self.most))
        .bind(self.lease.to_string())
        .bind(now)
        .bind(self.problem)
        .bind(keep_ms)
        .fetch_all(connection)
        .await
    }
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
    let start = Start { lease, most, problem: Some(problem) };
    let taken = start.taken(connection, (&id, key.as_bytes(), now), keep_ms).await?;
    if taken.is_empty() {
        // The answer to a claim may be lost on its way: who asks again has it already.
        return held(connection, &id, lease).await;
    }
    claimed(connection, &id, lease, taken).await
}

/// What is computed under a lease.
async fn held(connection: &mut PgConnection, id: &str, lease: Lease) -> Outcome<Claimed> {
    let taken: Vec<Runnable> =
        sqlx::query_as(concat!("SELECT ", taken!(), " FROM jobs WHERE lease = $2 AND state = 'running'"))
            .bind(id)
            .bind(lease.to_string())
            .fetch_all(&mut *connection)
            .await?;
    claimed(connection, id, lease, taken).await
}

async fn claimed(connection: &mut PgConnection, id: &str, lease: Lease, taken: Vec<Runnable>) -> Outcome<Claimed> {
    let jobs = taken.iter().map(|job| parsed(&job.id)).collect::<Outcome<Vec<JobId>>>()?;
    // Nobody watches a shard begin.
    if !taken.iter().any(Runnable::is_shard) {
        news::tell(connection, &jobs, &[]).await?;
    }
    let Some(job) = taken.into_iter().find(|job| job.id == id) else { return Ok(Claimed::Nothing) };
    if job.state != JobState::Running.word() {
        return Ok(Claimed::Poisonous(jobs));
    }
    if job.is_shard() {
        return Ok(Claimed::Run(job.claim(lease, jobs)?));
    }
    // The line has come to this place, however long others run that were taken before: who comes now begins behind it.
    // Rows that somebody else is about to write are left alone; nobody waits here.
    sqlx::query(
        "UPDATE jobs SET turn = $1 WHERE id IN (
             SELECT id FROM jobs WHERE state = 'running' AND priority = $2 AND turn < $1 FOR UPDATE SKIP LOCKED)",
    )
    .bind(job.turn)
    .bind(job.priority)
    .execute(connection)
    .await?;
    Ok(Claimed::Run(job.claim(lease, jobs)?))
}

pub(super) async fn hold(pool: &PgPool, id: JobId) -> Outcome<()> {
    sqlx::query(
        "UPDATE jobs SET heartbeat_ms = now_ms()
         WHERE id IN (SELECT other.id FROM jobs AS one JOIN jobs AS other USING (key)
                      WHERE one.id = $1 AND other.state = 'queued' FOR UPDATE OF other SKIP LOCKED)
             AND state = 'queued'",
    )
    .bind(id.to_string())
    .execute(pool)
    .await
    .map(drop)
}

/// Ends a shard, with all that [`shards::go_on`] does, in one statement. No job can join it meanwhile, so that its key is not
/// locked: that the lease holds is seen when the row is written.
pub(super) async fn finish_shard(
    connection: &mut PgConnection,
    lease: Lease,
    ending: &PackedEnding,
    at: (i64, i64),
) -> Outcome<Vec<JobId>> {
    let statement = sql(concat!(
        "WITH ended AS (",
        end_job!(),
        "), gets_on AS (",
        get_on!("(SELECT parent FROM ended)", "$9"),
        "), given AS (",
        give_turn!("(SELECT parent FROM ended WHERE turn < $10)", "$10"),
        ") SELECT id, ",
        told!("id"),
        " FROM ended"
    ));
    let statement = jobs::ended(statement, lease, ending, at).bind(MOST_OF_PARENT).bind(BEHIND);
    let ended: Vec<(String,)> = connection.all(statement).await?;
    ended.iter().map(|(id,)| parsed(id)).collect()
}

pub(super) async fn finish(
    connection: &mut PgConnection,
    lease: Lease,
    ending: &PackedEnding,
    keep_ms: i64,
) -> Outcome<Vec<JobId>> {
    let Some((_, now)) = lock_lease(connection, lease).await? else { return Ok(Vec::new()) };
    let ended = jobs::finish(connection, lease, ending, (now, keep_ms)).await?;
    news::tell(connection, &ended, &[]).await?;
    Ok(ended)
}

pub(super) async fn add_shards(connection: &mut PgConnection, lease: Lease, numbers: &[u32]) -> Outcome<bool> {
    if lock_lease(connection, lease).await?.is_none() {
        return Ok(false);
    }
    shards::add(connection, lease, numbers, ", engine").await
}

/// Puts the running jobs of a lease back in line, see [`put_back`]: `silent_for_ms` says that it has to have been silent for
/// so long.
pub(super) async fn requeue(
    connection: &mut PgConnection,
    lease: Lease,
    charged: bool,
    silent_for_ms: Option<i64>,
) -> Outcome<Vec<JobId>> {
    let Some((_, now)) = lock_lease(connection, lease).await? else { return Ok(Vec::new()) };
    let heard_ms = silent_for_ms.map_or(i64::MAX, |ms| now.saturating_sub(ms));
    let back = put_back(connection, &lease.to_string(), charged, heard_ms).await?;
    news::tell(connection, &back, &[]).await?;
    Ok(back)
}

pub(super) async fn cancel(connection: &mut PgConnection, id: JobId, keep_ms: i64) -> Outcome<Option<Cancelled>> {
    let Some((_, now)) = lock_job(connection, &id.to_string()).await? else { return Ok(None) };
    let Some(job) = record(connection, id).await? else { return Ok(None) };
    let before = job.state;
    if before.is_final() {
        return Ok(Some(Cancelled { job, before, unwanted: None }));
    }
    set_cancelled(connection, id, (now, keep_ms)).await?;
    let unwanted = unwanted(connection, job.lease.as_slice()).await?.pop();
    news::tell(connection, &[id], unwanted.as_slice()).await?;
    let job = record(connection, id).await?.ok_or(sqlx::Error::RowNotFound)?;
    Ok(Some(Cancelled { job, before, unwanted }))
}

pub(super) async fn refuse(
    connection: &mut PgConnection,
    lease: Lease,
    of_whom_and_why: (&str, &str),
    keep_ms: i64,
) -> Outcome<Vec<JobId>> {
    let Some((_, now)) = lock_lease(connection, lease).await? else { return Ok(Vec::new()) };
    let refused = fail_of_owner(connection, lease, of_whom_and_why, (now, keep_ms)).await?;
    news::tell(connection, &refused, &[]).await?;
    requeue(connection, lease, false, None).await?;
    Ok(refused)
}

pub(super) async fn redo(connection: &mut PgConnection, id: JobId) -> Outcome<()> {
    if lock_job(connection, &id.to_string()).await?.is_some() && set_back(connection, id).await? {
        news::tell(connection, &[id], &[]).await?;
    }
    Ok(())
}

/// Notes how far computations are; which of them nobody wants any more.
pub(super) async fn beat(connection: &mut PgConnection, beats: &[Beat]) -> Outcome<Vec<Lease>> {
    let leases: Vec<Lease> = beats.iter().map(|beat| beat.lease).collect();
    let wanted: Vec<String> = sqlx::query_scalar(
        "UPDATE jobs AS job SET heartbeat_ms = now_ms(), progress = beat.progress, stage = beat.stage
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
