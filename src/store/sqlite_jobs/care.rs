//! What is done from time to time, and at the start.

use sqlx::sqlite::{SqliteConnection, SqlitePool};

use super::callbacks;
use crate::store::common::jobs::{self, parsed, unwanted};
use crate::store::common::run;
use crate::store::common::shards::forget_orphans;
use crate::store::jobs::{Changed, JobId, Lease, Timing};
use crate::store::now_ms;
use crate::store::sql::Outcome;

/// Timings kept of each calculator.
const TIMINGS: i64 = 1000;
/// A finished job's record outlives its result by this share of the time that the result is kept.
const TOMBSTONE: i64 = 1;
/// Jobs forgotten in one transaction.
const FORGOTTEN_AT_ONCE: u32 = 500;

pub(super) async fn expire_deadlines(
    connection: &mut SqliteConnection,
    problem: &str,
    keep_ms: i64,
    now: i64,
) -> Outcome<(Changed, Option<i64>)> {
    let late: Vec<(String, Option<String>)> = sqlx::query_as(
        "SELECT id, lease FROM jobs INDEXED BY precut_jobs_by_deadline
         WHERE deadline_ms IS NOT NULL AND deadline_ms <= ?1 AND state IN ('queued', 'running')",
    )
    .bind(now)
    .fetch_all(&mut *connection)
    .await?;
    for (id, _) in &late {
        sqlx::query(
            "UPDATE jobs SET state = 'failed', problem = ?2, lease = NULL, heartbeat_ms = NULL, stage = NULL,
                 finished_ms = ?3, expires_ms = ?4 WHERE id = ?1",
        )
        .bind(id)
        .bind(problem)
        .bind(now)
        .bind(now.saturating_add(keep_ms))
        .execute(&mut *connection)
        .await?;
    }
    let jobs = late.iter().map(|(id, _)| parsed(id)).collect::<Outcome<Vec<JobId>>>()?;
    let leases = late.iter().filter_map(|(_, lease)| lease.as_ref());
    let leases = leases.map(|lease| parsed(lease)).collect::<Outcome<Vec<Lease>>>()?;
    let unwanted = unwanted(connection, &leases).await?;
    let next = sqlx::query_scalar(
        "SELECT min(deadline_ms) FROM jobs INDEXED BY precut_jobs_by_deadline
         WHERE deadline_ms IS NOT NULL AND state IN ('queued', 'running')",
    )
    .fetch_one(connection)
    .await?;
    Ok((Changed { jobs, unwanted }, next))
}

/// Puts what is computed under these leases back in line.
async fn requeue(connection: &mut SqliteConnection, leases: &[String]) -> Outcome<Vec<JobId>> {
    let mut back = Vec::new();
    for lease in leases {
        back.extend(run::requeue(connection, parsed(lease)?, true, None).await?);
    }
    Ok(back)
}

pub(super) async fn sweep(connection: &mut SqliteConnection, live: &[Lease]) -> Outcome<Vec<JobId>> {
    let running = sqlx::query_scalar("SELECT DISTINCT lease FROM jobs WHERE state = 'running'");
    let mut stale: Vec<String> = running.fetch_all(&mut *connection).await?;
    let live: Vec<String> = live.iter().map(Lease::to_string).collect();
    stale.retain(|lease| !live.contains(lease));
    requeue(connection, &stale).await
}

/// What one round of forgetting did.
#[derive(Debug, Clone, Copy)]
pub(super) struct Forgotten {
    /// Records that are gone.
    pub(super) records: u64,
    /// Whether there may be more of what it looked for.
    pub(super) is_more: bool,
}

pub(super) async fn forget_expired(connection: &mut SqliteConnection, keep_ms: i64, now: i64) -> Outcome<Forgotten> {
    // First the input, then, much later, the record: that a job was there is known longer than what it gave.
    let emptied = sqlx::query(
        "UPDATE jobs SET input = x'', idempotency = NULL, body_hash = NULL
         WHERE id IN (SELECT id FROM jobs INDEXED BY precut_jobs_by_expiry_of_input
                      WHERE expires_ms <= ?1 AND length(input) > 0 LIMIT ?2)",
    )
    .bind(now)
    .bind(FORGOTTEN_AT_ONCE)
    .execute(&mut *connection)
    .await?
    .rows_affected();
    let records = sqlx::query("DELETE FROM jobs WHERE id IN (SELECT id FROM jobs WHERE expires_ms <= ?1 LIMIT ?2)")
        .bind(now.saturating_sub(keep_ms.saturating_mul(TOMBSTONE)))
        .bind(FORGOTTEN_AT_ONCE)
        .execute(&mut *connection)
        .await?
        .rows_affected();
    forget_orphans(connection).await?;
    let most = emptied.max(records);
    Ok(Forgotten { records, is_more: most >= u64::from(FORGOTTEN_AT_ONCE) })
}

pub(super) async fn note_timing(connection: &mut SqliteConnection, timing: &Timing) -> Outcome<()> {
    jobs::note_timing(connection, timing).await?;
    sqlx::query(
        "DELETE FROM timings WHERE calculator = ?1 AND at_ms < (
             SELECT at_ms FROM timings WHERE calculator = ?1 ORDER BY at_ms DESC LIMIT 1 OFFSET ?2)",
    )
    .bind(&timing.calculator)
    .bind(TIMINGS)
    .execute(connection)
    .await?;
    Ok(())
}

/// What the process before left behind: its running jobs go back in line, and what it held is free.
pub(in crate::store) async fn recover(pool: &SqlitePool) -> Outcome<u64> {
    let mut transaction = pool.begin_with("BEGIN IMMEDIATE").await?;
    let orphans: Vec<String> = sqlx::query_scalar("SELECT DISTINCT lease FROM jobs WHERE state = 'running'")
        .fetch_all(&mut *transaction)
        .await?;
    let count = requeue(&mut transaction, &orphans).await?.len();
    sqlx::query("UPDATE jobs SET heartbeat_ms = NULL WHERE state = 'queued' AND heartbeat_ms IS NOT NULL")
        .execute(&mut *transaction)
        .await?;
    callbacks::recover(&mut transaction, now_ms()).await?;
    transaction.commit().await?;
    Ok(count as u64)
}
