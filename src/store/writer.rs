//! What is written behind the answers: in groups, by one task over one connection, which rests between groups so that
//! under load the cores are there for answers. What waits is read from here.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex as StdMutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use sqlx::Connection;
use sqlx::sqlite::{SqliteConnection, SqlitePool};
use tokio::sync::{Mutex, Notify, mpsc, oneshot};
use tokio::task::JoinHandle;

use super::common::results;
use super::row::{Packer, ResultRow};
use super::sqlite::Keys;
use super::{KeptResult, now_ms};
use crate::key::Key;

/// Orders that may wait.
const WAITING_ORDERS: usize = 4096;
/// Bytes of results that may wait; further results are not kept.
const WAITING_BYTES: usize = 64 << 20;
/// Orders in one transaction.
const GROUP: usize = 256;
/// Rows in one statement.
const ROWS_AT_ONCE: usize = 32;
/// For so many times the time that a group took no other is written, unless another group waits already: answers go
/// before what is kept of them, but an address once given is to last.
const REST_PER_WORK: u32 = 4;
/// A group gathers at least so long, and no rest is longer than the other.
const REST: (Duration, Duration) = (Duration::from_millis(20), Duration::from_millis(250));
/// How often age is looked at.
const SWEEP_EVERY: Duration = Duration::from_mins(10);
/// How long a list waits for what is just being written, and a shard of a study for the results of its points.
pub(super) const LIST_PATIENCE: Duration = Duration::from_secs(1);
pub(super) const POINTS_PATIENCE: Duration = Duration::from_secs(5);
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
    desk: Arc<Desk>,
    task: Mutex<Option<JoinHandle<()>>>,
}

/// What those who order and the one who carries out have in common.
#[derive(Default)]
struct Desk {
    /// Results that are not written yet, by key.
    waiting: StdMutex<HashMap<Key, Arc<KeptResult>>>,
    /// Their size.
    waiting_bytes: AtomicUsize,
    /// Size of the results that are written.
    total: AtomicI64,
    /// Whether results were turned away since the last group was written.
    full: AtomicBool,
    /// Ends a rest.
    hurry: Notify,
}

impl Desk {
    fn waiting(&self) -> MutexGuard<'_, HashMap<Key, Arc<KeptResult>>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn done(&self, results: &[Arc<KeptResult>]) {
        let mut waiting = self.waiting();
        for result in results {
            waiting.remove(&result.key);
        }
        drop(waiting);
        self.waiting_bytes.fetch_sub(results.iter().map(|result| size(result)).sum(), Ordering::Relaxed);
        self.full.store(false, Ordering::Relaxed);
    }
}

enum Order {
    Put(Arc<KeptResult>),
    Touch(Key),
    Forget(Key),
    Flush(oneshot::Sender<bool>),
    Close,
}

impl Order {
    /// Whether somebody waits for it.
    fn is_urgent(&self) -> bool {
        matches!(self, Self::Flush(_) | Self::Close)
    }
}

impl Writer {
    pub(super) async fn start(pool: SqlitePool, keys: Keys, limits: Limits) -> Result<Self, sqlx::Error> {
        let total = total_bytes(&pool).await?;
        let (orders, receiver) = mpsc::channel(WAITING_ORDERS);
        let desk = Arc::new(Desk { total: AtomicI64::new(total), ..Desk::default() });
        let clerk = Clerk { pool, keys, limits, enough: limits.bytes, desk: Arc::clone(&desk) };
        let task = Mutex::new(Some(tokio::spawn(clerk.work(receiver))));
        Ok(Self { orders, desk, task })
    }

    pub(super) fn put(&self, result: KeptResult) {
        let desk = &self.desk;
        let (key, size, result) = (result.key, size(&result), Arc::new(result));
        // In this order: once it is ordered it may be written, and then it waits no more.
        if desk.waiting().insert(key, Arc::clone(&result)).is_some() {
            // The same result already waits.
            return;
        }
        let waiting = desk.waiting_bytes.fetch_add(size, Ordering::Relaxed);
        if waiting + size > WAITING_BYTES || self.orders.try_send(Order::Put(result)).is_err() {
            desk.waiting().remove(&key);
            desk.waiting_bytes.fetch_sub(size, Ordering::Relaxed);
            metrics::counter!("precut_store_failures_total", "operation" => "queue").increment(1);
            // Once for a crowd: under overload there are thousands of them.
            if !desk.full.swap(true, Ordering::Relaxed) {
                tracing::warn!("results are not kept: too many wait to be written");
            }
        }
    }

    /// A result that is not written yet.
    pub(super) fn waiting(&self, key: &Key) -> Option<Arc<KeptResult>> {
        self.desk.waiting().get(key).cloned()
    }

    /// A result was written by somebody else.
    pub(super) fn added(&self, bytes: i64) {
        self.desk.total.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Notes a use. One that is lost does no harm.
    pub(super) fn touch(&self, key: Key) {
        let _ = self.orders.try_send(Order::Touch(key));
    }

    pub(super) fn forget(&self, key: Key) {
        let _ = self.orders.try_send(Order::Forget(key));
    }

    /// Waits until everything ordered so far is written, but no longer than that: the disk may not get on. Whether it
    /// is written.
    pub(super) async fn flush(&self, most: Duration) -> bool {
        let (sender, done) = oneshot::channel();
        let written = async {
            if self.orders.send(Order::Flush(sender)).await.is_err() {
                return false;
            }
            self.desk.hurry.notify_one();
            done.await.unwrap_or(false)
        };
        tokio::time::timeout(most, written).await.unwrap_or(false)
    }

    pub(super) async fn close(&self) {
        self.desk.hurry.notify_one();
        let _ = self.orders.send(Order::Close).await;
        self.desk.hurry.notify_one();
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
    /// Above so many bytes something is deleted: the limit, or more where the rest may not go.
    enough: i64,
    desk: Arc<Desk>,
}

/// The orders of one group.
#[derive(Default)]
struct Group {
    put: Vec<Arc<KeptResult>>,
    touched: Vec<Key>,
    forgotten: Vec<Key>,
    flushed: Vec<oneshot::Sender<bool>>,
    close: bool,
}

impl Clerk {
    async fn work(mut self, mut orders: mpsc::Receiver<Order>) {
        let mut sweep = tokio::time::interval(SWEEP_EVERY);
        let mut waiting = Vec::new();
        let mut rest = REST.0;
        loop {
            tokio::select! {
                received = orders.recv_many(&mut waiting, GROUP) => {
                    self.gather(&mut orders, &mut waiting, rest).await;
                    let group = group(&mut waiting);
                    let close = group.close || received == 0;
                    let begun = Instant::now();
                    self.carry_out(group).await;
                    rest = if orders.len() >= GROUP {
                        Duration::ZERO
                    } else {
                        (REST_PER_WORK * begun.elapsed()).clamp(REST.0, REST.1)
                    };
                    if close {
                        break;
                    }
                }
                _ = sweep.tick() => self.forget_old().await,
            }
        }
        self.pool.close().await;
    }

    /// Rests while orders come in, unless somebody waits for one of them.
    async fn gather(&self, orders: &mut mpsc::Receiver<Order>, waiting: &mut Vec<Order>, rest: Duration) {
        if !waiting.iter().any(Order::is_urgent) {
            tokio::select! {
                () = tokio::time::sleep(rest) => {}
                () = self.desk.hurry.notified() => {}
            }
        }
        while waiting.len() < GROUP
            && let Ok(order) = orders.try_recv()
        {
            waiting.push(order);
        }
    }

    async fn carry_out(&mut self, group: Group) {
        let orders = group.put.len() + group.touched.len() + group.forgotten.len();
        let mut written = true;
        if orders > 0
            && let Err(reason) = self.write(&group.put, &group.touched, &group.forgotten).await
        {
            written = false;
            metrics::counter!("precut_store_failures_total", "operation" => "write").increment(1);
            tracing::warn!(orders, reason, "results are not kept");
        }
        self.desk.done(&group.put);
        if self.desk.total.load(Ordering::Relaxed) > self.enough {
            self.report("evict", Self::evict).await;
        }
        for flushed in group.flushed {
            let _ = flushed.send(written);
        }
    }

    async fn write(&mut self, put: &[Arc<KeptResult>], touched: &[Key], forgotten: &[Key]) -> Result<(), String> {
        let rows = compressed(put.to_vec()).await?;
        self.write_rows(&rows, touched, forgotten).await.map_err(|error| error.to_string())
    }

    async fn write_rows(&mut self, rows: &[ResultRow], touched: &[Key], forgotten: &[Key]) -> Result<(), sqlx::Error> {
        let now = now_ms();
        let mut connection = self.pool.acquire().await?;
        let outcome = insert(&mut connection, rows, touched, forgotten, now).await;
        if outcome.is_err() {
            // Where SQLite has rolled back by itself (a full disk), the driver still counts a transaction that nothing
            // can end, and would refuse every later one.
            connection.close_on_drop();
        }
        let added = outcome?;
        for key in forgotten {
            self.keys.remove(key.as_bytes());
        }
        for row in rows {
            self.keys.add(&row.key);
        }
        self.desk.total.fetch_add(added, Ordering::Relaxed);
        Ok(())
    }

    /// Deletes what has not been used for longest until the total is below the limit again.
    async fn evict(&mut self) -> Result<(), sqlx::Error> {
        // The running total does not know of rows that were forgotten.
        self.desk.total.store(total_bytes(&self.pool).await?, Ordering::Relaxed);
        // Sizes of files are far below 2^53.
        #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
        let goal = (self.limits.bytes as f64 * EVICT_TO) as i64;
        let desk = Arc::clone(&self.desk);
        let total = || desk.total.load(Ordering::Relaxed);
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
    async fn forget_old(&mut self) {
        self.report("sweep", Self::sweep).await;
    }

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
            self.desk.total.fetch_sub(*bytes, Ordering::Relaxed);
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
    touched: &[Key],
    forgotten: &[Key],
    now: i64,
) -> Result<i64, sqlx::Error> {
    let mut transaction = connection.begin_with("BEGIN IMMEDIATE").await?;
    for key in forgotten {
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
    for key in touched {
        sqlx::query("UPDATE results SET used_ms = ?2 WHERE key = ?1")
            .bind(key.as_bytes().as_slice())
            .bind(now)
            .execute(&mut *transaction)
            .await?;
    }
    transaction.commit().await?;
    Ok(added)
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
async fn compressed(results: Vec<Arc<KeptResult>>) -> Result<Vec<ResultRow>, String> {
    if results.is_empty() {
        return Ok(Vec::new());
    }
    let work = move || {
        let mut packer = Packer::new()?;
        let row = |result: &Arc<KeptResult>| {
            // An answer that waits for this core does not wait for the whole group.
            std::thread::yield_now();
            packer.row(result)
        };
        results.iter().map(row).collect::<Result<Vec<_>, std::io::Error>>()
    };
    tokio::task::spawn_blocking(work).await.map_err(|error| error.to_string())?.map_err(|error| error.to_string())
}

async fn total_bytes(pool: &SqlitePool) -> Result<i64, sqlx::Error> {
    sqlx::query_scalar("SELECT coalesce(sum(bytes), 0) FROM results INDEXED BY results_by_use").fetch_one(pool).await
}
