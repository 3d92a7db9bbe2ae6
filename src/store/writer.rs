//! What the SQLite store writes behind the answers, over one connection, with rests so that under load the cores are there
//! for answers.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use sqlx::Connection;
use sqlx::sqlite::{SqliteConnection, SqlitePool};

use super::behind::{Clerk, Desk, Group, ROWS_AT_ONCE};
use super::common::results;
use super::now_ms;
use super::row::ResultRow;
use super::sqlite::Keys;

/// For so many times the time that a group took no other is written, unless another group waits already: answers go
/// before what is kept of them, but an address once given is to last.
const REST_PER_WORK: u32 = 4;
/// A group gathers at least so long, and no rest is longer than the other.
const REST: (Duration, Duration) = (Duration::from_millis(20), Duration::from_millis(250));
/// Rows deleted in one transaction.
const EVICTED_AT_ONCE: i64 = 256;
/// Eviction goes down to this share of the limit, so that it does not run for every result.
const EVICT_TO: f64 = 0.9;

/// How much is kept and how long.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub(super) bytes: i64,
    pub(super) age: Duration,
}

pub(super) struct SqliteClerk {
    pool: SqlitePool,
    keys: Keys,
    limits: Limits,
    /// Above so many bytes something is deleted: the limit, or more where the rest may not go.
    enough: i64,
    /// Size of the results that are written, here and beside.
    total: Arc<AtomicI64>,
}

impl Clerk for SqliteClerk {
    async fn write(&mut self, group: &Group, rows: &[ResultRow], _desk: &Desk) -> bool {
        let written = self.write_rows(rows, group).await;
        if let Err(error) = &written {
            metrics::counter!("precut_store_failures_total", "operation" => "write").increment(1);
            tracing::warn!(rows = rows.len(), %error, "results are not kept");
        }
        written.is_ok()
    }

    async fn tidy(&mut self, is_time: bool) {
        if is_time {
            self.report("sweep", Self::sweep).await;
        }
        if self.total.load(Ordering::Relaxed) > self.enough {
            self.report("evict", Self::evict).await;
        }
    }

    fn rest(&self, took: Duration) -> Duration {
        (REST_PER_WORK * took).clamp(REST.0, REST.1)
    }

    async fn close(self) {
        self.pool.close().await;
    }
}

impl SqliteClerk {
    pub(super) async fn new(
        pool: SqlitePool,
        keys: Keys,
        limits: Limits,
        total: Arc<AtomicI64>,
    ) -> Result<Self, sqlx::Error> {
        total.store(total_bytes(&pool).await?, Ordering::Relaxed);
        Ok(Self { pool, keys, limits, enough: limits.bytes, total })
    }

    async fn write_rows(&mut self, rows: &[ResultRow], group: &Group) -> Result<(), sqlx::Error> {
        let now = now_ms();
        let mut connection = self.pool.acquire().await?;
        let outcome = insert(&mut connection, rows, group, now).await;
        if outcome.is_err() {
            // Where SQLite has rolled back by itself (a full disk), the driver still counts a transaction that nothing
            // can end, and would refuse every later one.
            connection.close_on_drop();
        }
        let added = outcome?;
        for key in &group.forgotten {
            self.keys.remove(key.as_bytes());
        }
        for row in rows {
            self.keys.add(&row.key);
        }
        self.total.fetch_add(added, Ordering::Relaxed);
        Ok(())
    }

    /// Deletes what has not been used for longest until the total is below the limit again.
    async fn evict(&mut self) -> Result<(), sqlx::Error> {
        // The running total does not know of rows that were forgotten.
        self.total.store(total_bytes(&self.pool).await?, Ordering::Relaxed);
        // Sizes of files are far below 2^53.
        #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
        let goal = (self.limits.bytes as f64 * EVICT_TO) as i64;
        let running = Arc::clone(&self.total);
        let total = || running.load(Ordering::Relaxed);
        let mut gone = 1;
        while total() > goal && gone > 0 {
            let surplus = total() - goal;
            let deleted: Vec<(Vec<u8>, i64)> = sqlx::query_as(
                "DELETE FROM results WHERE key IN (
                     SELECT key FROM (
                         SELECT key, sum(bytes) OVER (ORDER BY used_ms, key) - bytes AS before
                         FROM (SELECT key, used_ms, bytes FROM results INDEXED BY results_by_use
                               WHERE NOT EXISTS (SELECT 1 FROM jobs WHERE jobs.key = results.key
                                                 AND state = 'succeeded' AND expires_ms > ?3)
                               ORDER BY used_ms, key LIMIT ?2))
                     WHERE before < ?1)
                 RETURNING key, bytes",
            )
            .bind(surplus)
            .bind(EVICTED_AT_ONCE)
            .bind(now_ms())
            .fetch_all(&self.pool)
            .await?;
            gone = deleted.len();
            self.gone(&deleted);
        }
        // What is left belongs to kept jobs: it is not looked through again before there is something more.
        self.enough = self.limits.bytes.max(total() + self.limits.bytes / 16);
        if total() > self.limits.bytes {
            tracing::warn!(
                bytes = total(),
                limit = self.limits.bytes,
                "results of kept jobs alone are beyond the limit"
            );
        }
        Ok(())
    }

    /// Deletes what has not been used for longer than the age allowed.
    async fn sweep(&mut self) -> Result<(), sqlx::Error> {
        let before = now_ms().saturating_sub(i64::try_from(self.limits.age.as_millis()).unwrap_or(i64::MAX));
        loop {
            let deleted: Vec<(Vec<u8>, i64)> = sqlx::query_as(
                "DELETE FROM results WHERE key IN (
                     SELECT key FROM results INDEXED BY results_by_use WHERE used_ms < ?1
                         AND NOT EXISTS (SELECT 1 FROM jobs WHERE jobs.key = results.key
                                         AND state = 'succeeded' AND expires_ms > ?3) LIMIT ?2)
                 RETURNING key, bytes",
            )
            .bind(before)
            .bind(EVICTED_AT_ONCE)
            .bind(now_ms())
            .fetch_all(&self.pool)
            .await?;
            self.gone(&deleted);
            if deleted.is_empty() {
                return Ok(());
            }
        }
    }

    fn gone(&mut self, deleted: &[(Vec<u8>, i64)]) {
        for (key, bytes) in deleted {
            self.keys.remove(key);
            self.total.fetch_sub(*bytes, Ordering::Relaxed);
        }
        metrics::counter!("precut_results_evicted_total").increment(deleted.len() as u64);
    }

    async fn report(&mut self, operation: &'static str, work: impl AsyncFnOnce(&mut Self) -> Result<(), sqlx::Error>) {
        if let Err(error) = work(self).await {
            metrics::counter!("precut_store_failures_total", "operation" => operation).increment(1);
            tracing::warn!(%error, operation, "the store could not be tidied");
        }
    }
}

/// Writes rows in one transaction; how many bytes they add.
async fn insert(
    connection: &mut SqliteConnection,
    rows: &[ResultRow],
    group: &Group,
    now: i64,
) -> Result<i64, sqlx::Error> {
    let mut transaction = connection.begin_with("BEGIN IMMEDIATE").await?;
    for key in &group.forgotten {
        sqlx::query("DELETE FROM results WHERE key = ?1")
            .bind(key.as_bytes().as_slice())
            .execute(&mut *transaction)
            .await?;
    }
    let mut added = 0;
    let (many, few) = rows.as_chunks::<ROWS_AT_ONCE>();
    for rows in many {
        added += results::insert(&mut *transaction, rows, now).await?;
    }
    for one in few {
        added += results::insert(&mut *transaction, std::slice::from_ref(one), now).await?;
    }
    for key in &group.touched {
        sqlx::query("UPDATE results SET used_ms = ?2 WHERE key = ?1")
            .bind(key.as_bytes().as_slice())
            .bind(now)
            .execute(&mut *transaction)
            .await?;
    }
    transaction.commit().await?;
    Ok(added)
}

async fn total_bytes(pool: &SqlitePool) -> Result<i64, sqlx::Error> {
    sqlx::query_scalar("SELECT coalesce(sum(bytes), 0) FROM results INDEXED BY results_by_use").fetch_one(pool).await
}
