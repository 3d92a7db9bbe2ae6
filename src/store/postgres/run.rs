//! What PostgreSQL does in its own way: the next job is found without waiting, and what is done often is one statement.

use sqlx::postgres::{PgConnection, PgPool, PgRow};
use sqlx::{FromRow, Row as _};

use super::news::told;
use super::texts;
use crate::store::common::jobs::{end_job, ended, parsed};
use crate::store::common::run::{self, First};
use crate::store::common::runnable::Runnable;
use crate::store::common::shards::{BEHIND, MOST_OF_PARENT, get_on, give_turn};
use crate::store::jobs::{Beat, JobId, Lease, MOST_ATTEMPTS, Next, Wanted};
use crate::store::sql::{Outcome, Session as _, sql};
use crate::store::sqlite_jobs::pack::PackedEnding;

/// Of what waits so many are looked at for one that nobody else is about to take.
const LOOKED_AT: i64 = 64;

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
    if let Some(before) = run::taken_before(connection, wanted).await? {
        return Ok(before);
    }
    match first(connection, &taker, wanted).await? {
        Some(first) => run::take(connection, first, wanted.lease, keep_ms).await,
        None => Ok(Next::Nothing),
    }
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
    .bind(MOST_ATTEMPTS.cast_signed() - 1)
    .fetch_optional(connection)
    .await
}

/// Ends a shard, with all that comes with its end, in one statement. No job can join it meanwhile, so that its key is not
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
    let statement = ended(statement, lease, ending, at).bind(MOST_OF_PARENT).bind(BEHIND);
    let over: Vec<(String,)> = connection.all(statement).await?;
    over.iter().map(|(id,)| parsed(id)).collect()
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
