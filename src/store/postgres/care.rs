//! What is done from time to time. Every process does it; where one is enough, the first to come does it.

use sqlx::postgres::{PgConnection, PgPool};

use super::{PostgresStore, lock, news, texts};
use crate::key::Key;
use crate::store::StoreError;
use crate::store::common::jobs::{ids, parsed, unwanted};
use crate::store::common::run::requeue;
use crate::store::common::shards::forget_orphans;
use crate::store::common::usage::forget_work;
use crate::store::jobs::{Changed, JobId, Lease, Live};
use crate::store::sql::Outcome;

/// Timings kept.
const TIMINGS: i64 = 20_000;
/// Jobs forgotten in one transaction; a minute's worth at a million a day is 700.
const FORGOTTEN_AT_ONCE: i64 = 5_000;
/// Leases looked after in one round.
const AT_ONCE: i64 = 500;
/// How long a worker that is gone is known.
const GONE_FOR_MS: i64 = 600_000;
/// A version whose workers have all been silent for so long has none.
const DESERTED_MS: i64 = 30_000;
/// Locks of which one process at a time has each.
const CARE: i32 = 0x7072_6563;

#[derive(Clone, Copy)]
enum Duty {
    Sweep = 1,
    Forget = 2,
}

/// Whether this process is the first to do that now.
async fn is_first(connection: &mut PgConnection, duty: Duty) -> Outcome<bool> {
    sqlx::query_scalar("SELECT pg_try_advisory_xact_lock($1, $2)")
        .bind(CARE)
        .bind(duty as i32)
        .fetch_one(connection)
        .await
}

impl PostgresStore {
    pub(super) async fn expire(&self, problem: &str) -> Result<(Changed, Option<i64>), StoreError> {
        let keys: Vec<Vec<u8>> = sqlx::query_scalar(
            "SELECT DISTINCT key FROM jobs
             WHERE deadline_ms IS NOT NULL AND state IN ('queued', 'running') AND deadline_ms <= now_ms()",
        )
        .fetch_all(&self.pool)
        .await?;
        let mut all = Changed::default();
        for key in keys.iter().filter_map(|key| Key::from_bytes(key)) {
            let keep_ms = self.keep_ms;
            let problem = problem.to_owned();
            let changed = self
                .write(move |connection| Box::pin(async move { expire_key(connection, key, &problem, keep_ms).await }))
                .await?;
            all.jobs.extend(changed.jobs);
            all.unwanted.extend(changed.unwanted);
        }
        let next = sqlx::query_scalar(
            "SELECT min(deadline_ms) FROM jobs WHERE deadline_ms IS NOT NULL AND state IN ('queued', 'running')",
        )
        .fetch_one(&self.pool)
        .await?;
        Ok((all, next))
    }

    pub(super) async fn sweep_jobs(&self, live: Live) -> Result<Vec<JobId>, StoreError> {
        let _ = self.clock.read(&self.pool).await;
        let silent_ms = i64::try_from(self.patience.lease.as_millis()).unwrap_or(i64::MAX);
        let grace_s = self.patience.grace.as_secs_f64();
        let live = texts(&live());
        let stale = self.write(|connection| Box::pin(stale(connection, live, silent_ms, grace_s))).await?;
        let mut back = Vec::new();
        for lease in stale.unwrap_or_default() {
            let again = self.write(|connection| Box::pin(requeue(connection, lease, true, Some(silent_ms)))).await?;
            back.extend(again);
        }
        if self.is_time_to_adopt() {
            if self.works {
                self.say_alive().await?;
            }
            back.extend(adopt(&self.pool, &self.engine).await?);
        }
        Ok(back)
    }

    /// Says that this process runs jobs of its version.
    async fn say_alive(&self) -> Result<(), StoreError> {
        sqlx::query(
            "INSERT INTO workers (id, engine, seen_ms) VALUES ($1, $2, now_ms())
             ON CONFLICT (id) DO UPDATE SET seen_ms = excluded.seen_ms",
        )
        .bind(self.worker.to_string())
        .bind(&self.engine)
        .execute(&self.pool)
        .await?;
        Ok(())
    }

    fn is_time_to_adopt(&self) -> bool {
        let now = tokio::time::Instant::now();
        let mut last = self.looked.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let is_time = last.is_none_or(|last| now.duration_since(last) >= self.patience.adoption);
        if is_time {
            *last = Some(now);
        }
        is_time
    }

    pub(super) async fn forget(&self) -> Result<u64, StoreError> {
        let keep_ms = self.keep_ms;
        self.write(|connection| Box::pin(forget(connection, keep_ms))).await
    }
}

async fn expire_key(connection: &mut PgConnection, key: Key, problem: &str, keep_ms: i64) -> Outcome<Changed> {
    let now = lock(connection, &key).await?;
    let late: Vec<(String, Option<String>)> = sqlx::query_as(
        "WITH late AS (SELECT id, lease FROM jobs
                       WHERE key = $1 AND deadline_ms <= $2 AND state IN ('queued', 'running'))
         UPDATE jobs AS job SET state = 'failed', problem = $3, lease = NULL, heartbeat_ms = NULL, stage = NULL,
             finished_ms = $2, expires_ms = $2 + $4
         FROM late WHERE job.id = late.id RETURNING job.id, late.lease",
    )
    .bind(key.as_bytes().as_slice())
    .bind(now)
    .bind(problem)
    .bind(keep_ms)
    .fetch_all(&mut *connection)
    .await?;
    let jobs = late.iter().map(|(id, _)| parsed(id)).collect::<Outcome<Vec<JobId>>>()?;
    let leases = late.iter().filter_map(|(_, lease)| lease.as_ref());
    let leases = leases.map(|lease| parsed(lease)).collect::<Outcome<Vec<Lease>>>()?;
    let unwanted = unwanted(connection, &leases).await?;
    news::tell(connection, &jobs, &unwanted).await?;
    Ok(Changed { jobs, unwanted })
}

/// Leases of computations that have been silent for too long; `None` where another process looks just now.
async fn stale(
    connection: &mut PgConnection,
    live: Vec<String>,
    silent_ms: i64,
    grace_s: f64,
) -> Outcome<Option<Vec<Lease>>> {
    if !is_first(connection, Duty::Sweep).await? {
        return Ok(None);
    }
    let stale: Vec<String> = sqlx::query_scalar(
        "SELECT DISTINCT lease FROM jobs
         WHERE state = 'running' AND heartbeat_ms <= now_ms() - $1 AND NOT lease = ANY($2)
             AND clock_timestamp() - pg_postmaster_start_time() > make_interval(secs => $3)
         LIMIT $4",
    )
    .bind(silent_ms)
    .bind(live)
    .bind(grace_s)
    .bind(AT_ONCE)
    .fetch_all(connection)
    .await?;
    stale.iter().map(|lease| parsed(lease)).collect::<Outcome<_>>().map(Some)
}

/// Takes over jobs of earlier versions that have no workers any more, where ours has; which these are. A later version's
/// jobs wait for its workers: there may be something in them that this one cannot read.
async fn adopt(pool: &PgPool, mine: &str) -> Outcome<Vec<JobId>> {
    let engines: Vec<String> =
        sqlx::query_scalar("SELECT DISTINCT engine FROM jobs WHERE state = 'queued' AND engine <> $1")
            .bind(mine)
            .fetch_all(pool)
            .await?;
    let older: Vec<String> = engines.into_iter().filter(|engine| is_older(engine, mine)).collect();
    if older.is_empty() {
        return Ok(Vec::new());
    }
    let served: Vec<String> = sqlx::query_scalar("SELECT DISTINCT engine FROM workers WHERE seen_ms > now_ms() - $1")
        .bind(DESERTED_MS)
        .fetch_all(pool)
        .await?;
    if !served.iter().any(|engine| engine == mine) {
        return Ok(Vec::new());
    }
    let deserted: Vec<String> = older.into_iter().filter(|engine| !served.contains(engine)).collect();
    let taken_over: Vec<String> = sqlx::query_scalar(
        "UPDATE jobs SET engine = $1 WHERE id IN (
             SELECT id FROM jobs WHERE state = 'queued' AND engine = ANY($2) FOR UPDATE SKIP LOCKED)
         RETURNING id",
    )
    .bind(mine)
    .bind(&deserted)
    .fetch_all(pool)
    .await?;
    if !taken_over.is_empty() {
        tracing::info!(jobs = taken_over.len(), of = ?deserted, "jobs of earlier versions are taken over");
    }
    ids(&taken_over)
}

/// Whether a version comes before another, number by number.
fn is_older(version: &str, than: &str) -> bool {
    let numbers =
        |version: &str| -> Vec<u64> { version.split(['.', '-', '+']).map_while(|part| part.parse().ok()).collect() };
    numbers(version) < numbers(than)
}

async fn forget(connection: &mut PgConnection, keep_ms: i64) -> Outcome<u64> {
    if !is_first(connection, Duty::Forget).await? {
        return Ok(0);
    }
    forget_work(connection).await?;
    // First the input, then, much later, the record: that a job was there is known longer than what it gave.
    sqlx::query(
        "UPDATE jobs SET input = '', idempotency = NULL, body_hash = NULL
         WHERE id IN (SELECT id FROM jobs WHERE expires_ms <= now_ms() AND length(input) > 0 LIMIT $1)",
    )
    .bind(FORGOTTEN_AT_ONCE)
    .execute(&mut *connection)
    .await?;
    let gone = sqlx::query(
        "DELETE FROM jobs
         WHERE id IN (SELECT id FROM jobs WHERE expires_ms <= now_ms() - $1 LIMIT $2)",
    )
    .bind(keep_ms)
    .bind(FORGOTTEN_AT_ONCE)
    .execute(&mut *connection)
    .await?;
    sqlx::query("DELETE FROM workers WHERE seen_ms < now_ms() - $1")
        .bind(GONE_FOR_MS)
        .execute(&mut *connection)
        .await?;
    sqlx::query("DELETE FROM timings WHERE at_ms < (SELECT at_ms FROM timings ORDER BY at_ms DESC LIMIT 1 OFFSET $1)")
        .bind(TIMINGS)
        .execute(&mut *connection)
        .await?;
    forget_orphans(connection).await?;
    Ok(gone.rows_affected())
}

#[cfg(test)]
mod tests {
    use super::is_older;

    #[test]
    fn versions_are_compared_number_by_number() {
        assert!(is_older("0.9.1", "0.10.0") && is_older("0.1.0", "0.1.1") && is_older("1.0", "1.0.1"));
        assert!(!is_older("0.10.0", "0.9.1") && !is_older("0.1.0", "0.1.0"));
    }
}
