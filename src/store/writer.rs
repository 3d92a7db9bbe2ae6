//! What is written behind the answers: in groups, by one task over one connection.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use sqlx::sqlite::SqlitePool;
use tokio::sync::{Mutex, mpsc, oneshot};
use tokio::task::JoinHandle;

use super::KeptResult;
use super::row::ResultRow;
use super::sqlite::Keys;
use crate::engine::Key;

/// Orders that may wait.
const WAITING_ORDERS: usize = 4096;
/// Bytes of results that may wait; further results are not kept.
const WAITING_BYTES: usize = 64 << 20;
/// Orders in one transaction.
const GROUP: usize = 64;
/// How often age is looked at.
const SWEEP_EVERY: Duration = Duration::from_mins(10);
/// How long a list waits for what is just being written.
const FLUSH_TIMEOUT: Duration = Duration::from_secs(1);
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

/// Takes orders and has them carried out.
pub(super) struct Writer {
    orders: mpsc::Sender<Order>,
    waiting_bytes: Arc<AtomicUsize>,
    task: Mutex<Option<JoinHandle<()>>>,
}

enum Order {
    Put(KeptResult),
    Touch(Key),
    Forget(Key),
    Flush(oneshot::Sender<()>),
    Close,
}

impl Writer {
    pub(super) async fn start(pool: SqlitePool, keys: Keys, limits: Limits) -> Result<Self, sqlx::Error> {
        let total = total_bytes(&pool).await?;
        let (orders, receiver) = mpsc::channel(WAITING_ORDERS);
        let waiting_bytes = Arc::new(AtomicUsize::new(0));
        let clerk = Clerk { pool, keys, limits, total, waiting_bytes: Arc::clone(&waiting_bytes) };
        let task = Mutex::new(Some(tokio::spawn(clerk.work(receiver))));
        Ok(Self { orders, waiting_bytes, task })
    }

    pub(super) fn put(&self, result: KeptResult) {
        let size = size(&result);
        let waiting = self.waiting_bytes.fetch_add(size, Ordering::Relaxed);
        if waiting + size > WAITING_BYTES || self.orders.try_send(Order::Put(result)).is_err() {
            self.waiting_bytes.fetch_sub(size, Ordering::Relaxed);
            metrics::counter!("precut_store_failures_total", "operation" => "queue").increment(1);
            tracing::warn!("a result is not kept: too many wait to be written");
        }
    }

    /// Notes a use. One that is lost does no harm.
    pub(super) fn touch(&self, key: Key) {
        let _ = self.orders.try_send(Order::Touch(key));
    }

    pub(super) fn forget(&self, key: Key) {
        let _ = self.orders.try_send(Order::Forget(key));
    }

    /// Waits until everything ordered so far is written, but not for a disk that does not get on.
    pub(super) async fn flush(&self) {
        let (sender, done) = oneshot::channel();
        let written = async {
            if self.orders.send(Order::Flush(sender)).await.is_ok() {
                let _ = done.await;
            }
        };
        let _ = tokio::time::timeout(FLUSH_TIMEOUT, written).await;
    }

    pub(super) async fn close(&self) {
        let _ = self.orders.send(Order::Close).await;
        if let Some(task) = self.task.lock().await.take() {
            let _ = task.await;
        }
    }
}

fn size(result: &KeptResult) -> usize {
    result.input.len() + result.body.len()
}

/// Carries orders out.
struct Clerk {
    pool: SqlitePool,
    keys: Keys,
    limits: Limits,
    total: i64,
    waiting_bytes: Arc<AtomicUsize>,
}

/// The orders of one group.
#[derive(Default)]
struct Group {
    put: Vec<KeptResult>,
    touched: Vec<Key>,
    forgotten: Vec<Key>,
    flushed: Vec<oneshot::Sender<()>>,
    close: bool,
}

impl Clerk {
    async fn work(mut self, mut orders: mpsc::Receiver<Order>) {
        let mut sweep = tokio::time::interval(SWEEP_EVERY);
        let mut waiting = Vec::with_capacity(GROUP);
        loop {
            tokio::select! {
                received = orders.recv_many(&mut waiting, GROUP) => {
                    let group = group(&mut waiting);
                    let close = group.close || received == 0;
                    self.carry_out(group).await;
                    if close {
                        break;
                    }
                }
                _ = sweep.tick() => self.forget_old().await,
            }
        }
        self.pool.close().await;
    }

    async fn carry_out(&mut self, group: Group) {
        let bytes: usize = group.put.iter().map(size).sum();
        let orders = group.put.len() + group.touched.len() + group.forgotten.len();
        if orders > 0
            && let Err(reason) = self.write(group.put, &group.touched, &group.forgotten).await
        {
            metrics::counter!("precut_store_failures_total", "operation" => "write").increment(1);
            tracing::warn!(orders, reason, "results are not kept");
        }
        self.waiting_bytes.fetch_sub(bytes, Ordering::Relaxed);
        if self.total > self.limits.bytes {
            self.report("evict", Self::evict).await;
        }
        for flushed in group.flushed {
            let _ = flushed.send(());
        }
    }

    async fn write(&mut self, put: Vec<KeptResult>, touched: &[Key], forgotten: &[Key]) -> Result<(), String> {
        let rows = compressed(put).await?;
        self.write_rows(&rows, touched, forgotten).await.map_err(|error| error.to_string())
    }

    async fn write_rows(&mut self, rows: &[ResultRow], touched: &[Key], forgotten: &[Key]) -> Result<(), sqlx::Error> {
        let now = now_ms();
        let mut transaction = self.pool.begin_with("BEGIN IMMEDIATE").await?;
        for key in forgotten {
            sqlx::query("DELETE FROM results WHERE key = ?1")
                .bind(key.as_bytes().as_slice())
                .execute(&mut *transaction)
                .await?;
        }
        let mut added = 0;
        for row in rows {
            let done = sqlx::query(
                "INSERT INTO results
                     (key, calculator, version, engine, input, body, checksum, bytes, created_ms, used_ms)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?9) ON CONFLICT (key) DO NOTHING",
            )
            .bind(&row.key)
            .bind(&row.calculator)
            .bind(row.version)
            .bind(&row.engine)
            .bind(&row.input)
            .bind(&row.body)
            .bind(&row.checksum)
            .bind(row.bytes())
            .bind(now)
            .execute(&mut *transaction)
            .await?;
            if done.rows_affected() > 0 {
                added += row.bytes();
            }
        }
        for key in touched {
            sqlx::query("UPDATE results SET used_ms = ?2 WHERE key = ?1")
                .bind(key.as_bytes().as_slice())
                .bind(now)
                .execute(&mut *transaction)
                .await?;
        }
        transaction.commit().await?;
        for key in forgotten {
            self.keys.remove(key.as_bytes());
        }
        for row in rows {
            self.keys.add(&row.key);
        }
        self.total += added;
        Ok(())
    }

    /// Deletes what has not been used for longest until the total is below the limit again.
    async fn evict(&mut self) -> Result<(), sqlx::Error> {
        // The running total does not know of rows that were forgotten.
        self.total = total_bytes(&self.pool).await?;
        // Sizes of files are far below 2^53.
        #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
        let goal = (self.limits.bytes as f64 * EVICT_TO) as i64;
        let mut gone = 1;
        while self.total > goal && gone > 0 {
            let surplus = self.total - goal;
            let deleted: Vec<(Vec<u8>, i64)> = sqlx::query_as(
                "DELETE FROM results WHERE key IN (
                     SELECT key FROM (
                         SELECT key, sum(bytes) OVER (ORDER BY used_ms, key) - bytes AS before
                         FROM (SELECT key, used_ms, bytes FROM results INDEXED BY results_by_use
                               ORDER BY used_ms, key LIMIT ?2))
                     WHERE before < ?1)
                 RETURNING key, bytes",
            )
            .bind(surplus)
            .bind(EVICTED_AT_ONCE)
            .fetch_all(&self.pool)
            .await?;
            gone = deleted.len();
            self.gone(&deleted);
        }
        Ok(())
    }

    /// Deletes what has not been used for longer than the age allowed.
    async fn forget_old(&mut self) {
        self.report("sweep", Self::sweep).await;
    }

    async fn sweep(&mut self) -> Result<(), sqlx::Error> {
        let before = now_ms().saturating_sub(i64::try_from(self.limits.age.as_millis()).unwrap_or(i64::MAX));
        loop {
            let deleted: Vec<(Vec<u8>, i64)> = sqlx::query_as(
                "DELETE FROM results WHERE key IN (
                     SELECT key FROM results INDEXED BY results_by_use WHERE used_ms < ?1 LIMIT ?2)
                 RETURNING key, bytes",
            )
            .bind(before)
            .bind(EVICTED_AT_ONCE)
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
            self.total -= bytes;
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

fn group(waiting: &mut Vec<Order>) -> Group {
    let mut group = Group::default();
    for order in waiting.drain(..) {
        match order {
            Order::Put(result) => group.put.push(result),
            Order::Touch(key) => group.touched.push(key),
            Order::Forget(key) => group.forgotten.push(key),
            Order::Flush(done) => group.flushed.push(done),
            Order::Close => group.close = true,
        }
    }
    group
}

/// Compressed away from the threads that move bytes.
async fn compressed(results: Vec<KeptResult>) -> Result<Vec<ResultRow>, String> {
    if results.is_empty() {
        return Ok(Vec::new());
    }
    let work = move || results.iter().map(ResultRow::of).collect::<Result<Vec<_>, _>>();
    tokio::task::spawn_blocking(work).await.map_err(|error| error.to_string())?.map_err(|error| error.to_string())
}

async fn total_bytes(pool: &SqlitePool) -> Result<i64, sqlx::Error> {
    sqlx::query_scalar("SELECT coalesce(sum(bytes), 0) FROM results INDEXED BY results_by_use").fetch_one(pool).await
}

fn now_ms() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}
