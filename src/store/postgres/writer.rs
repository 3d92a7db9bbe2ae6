//! What is written behind the answers: in groups, by one task. What waits is read from here. Where the database does
//! not answer, it waits for it, as far as there is room.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex as StdMutex, MutexGuard, PoisonError};
use std::time::Duration;

use sqlx::postgres::PgPool;
use tokio::sync::{Mutex, mpsc, oneshot};
use tokio::task::JoinHandle;

use super::clock::Clock;
use super::results;
use crate::key::Key;
use crate::store::KeptResult;
use crate::store::common;
use crate::store::row::{Packer, ResultRow};
use crate::store::sql::Outcome;
use crate::store::sqlite::Keep;

/// Orders that may wait.
const WAITING_ORDERS: usize = 4096;
/// Bytes of results that may wait; further results are not kept.
const WAITING_BYTES: usize = 64 << 20;
/// Orders in one transaction.
const GROUP: usize = 256;
/// Rows in one statement.
const ROWS_AT_ONCE: usize = 32;
/// A group gathers so long. Other processes know of a result only when it is written.
const REST: Duration = Duration::from_millis(10);
/// Between two attempts to write a group, and how many there are.
const PAUSE: Duration = Duration::from_millis(500);
const ATTEMPTS: u32 = 120;
/// How long a list waits for what is just being written.
pub(super) const LIST_PATIENCE: Duration = Duration::from_secs(1);
/// How often there is a look at age and size, and after so many bytes of new results.
const SWEEP_EVERY: Duration = Duration::from_mins(10);

/// Takes orders and has them carried out.
pub(super) struct Writer {
    orders: mpsc::Sender<Order>,
    desk: Arc<Desk>,
    task: Mutex<Option<JoinHandle<()>>>,
}

/// What those who order and the one who carries out have in common.
#[derive(Default)]
struct Desk {
    waiting: StdMutex<Waiting>,
    /// Whether results were turned away since the last group was written.
    full: AtomicBool,
    closing: AtomicBool,
}

impl Desk {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Results that are not written yet, and their size.
#[derive(Default)]
struct Waiting {
    results: HashMap<Key, Arc<KeptResult>>,
    bytes: usize,
}

impl Waiting {
    fn remove(&mut self, key: &Key) {
        if let Some(gone) = self.results.remove(key) {
            self.bytes -= size(&gone);
        }
    }
}

enum Order {
    Put(Arc<KeptResult>),
    Touch(Key),
    Forget(Key),
    Flush(oneshot::Sender<bool>),
    Close,
}

fn size(result: &KeptResult) -> usize {
    result.input.len() + result.body.len()
}

impl Writer {
    pub(super) fn start(pool: PgPool, clock: Arc<Clock>, keep: Keep) -> Self {
        let (orders, receiver) = mpsc::channel(WAITING_ORDERS);
        let desk: Arc<Desk> = Arc::default();
        let clerk = Clerk { pool, clock, keep, desk: Arc::clone(&desk), unlooked_bytes: 0 };
        Self { orders, desk, task: Mutex::new(Some(tokio::spawn(clerk.work(receiver)))) }
    }

    pub(super) fn put(&self, result: KeptResult) {
        let desk = &self.desk;
        let (key, size, result) = (result.key, size(&result), Arc::new(result));
        let mut waiting = desk.waiting();
        if waiting.results.contains_key(&key) {
            return;
        }
        let has_room = waiting.bytes + size <= WAITING_BYTES;
        if has_room && self.orders.try_send(Order::Put(Arc::clone(&result))).is_ok() {
            waiting.bytes += size;
            waiting.results.insert(key, result);
            return;
        }
        drop(waiting);
        metrics::counter!("precut_store_failures_total", "operation" => "queue").increment(1);
        // Once for a crowd: under overload there are thousands of them.
        if !desk.full.swap(true, Ordering::Relaxed) {
            tracing::warn!("results are not kept: too many wait to be written");
        }
    }

    /// A result was written with the end of its job: it waits no more.
    pub(super) fn written(&self, key: &Key) {
        self.desk.waiting().remove(key);
    }

    /// A result that is not written yet.
    pub(super) fn waiting(&self, key: &Key) -> Option<Arc<KeptResult>> {
        self.desk.waiting().results.get(key).cloned()
    }

    /// Notes a use. One that is lost does no harm.
    pub(super) fn touch(&self, key: Key) {
        let _ = self.orders.try_send(Order::Touch(key));
    }

    pub(super) fn forget(&self, key: Key) {
        let _ = self.orders.try_send(Order::Forget(key));
    }

    /// Waits until everything ordered so far is written, but no longer than that: the database may not get on. Whether
    /// it is written.
    pub(super) async fn flush(&self, most: Duration) -> bool {
        let (sender, done) = oneshot::channel();
        let written = async { self.orders.send(Order::Flush(sender)).await.is_ok() && done.await.unwrap_or(false) };
        tokio::time::timeout(most, written).await.unwrap_or(false)
    }

    pub(super) async fn close(&self) {
        self.desk.closing.store(true, Ordering::Relaxed);
        let _ = self.orders.send(Order::Close).await;
        if let Some(task) = self.task.lock().await.take() {
            let _ = task.await;
        }
    }
}

struct Clerk {
    pool: PgPool,
    clock: Arc<Clock>,
    keep: Keep,
    desk: Arc<Desk>,
    /// Bytes written since the last look at the total.
    unlooked_bytes: u64,
}

#[derive(Default)]
struct Group {
    put: Vec<Arc<KeptResult>>,
    touched: HashSet<Key>,
    forgotten: Vec<Key>,
    flushed: Vec<oneshot::Sender<bool>>,
    close: bool,
}

impl Clerk {
    async fn work(mut self, mut orders: mpsc::Receiver<Order>) {
        let mut sweep = tokio::time::interval(SWEEP_EVERY);
        let mut waiting = Vec::new();
        loop {
            tokio::select! {
                received = orders.recv_many(&mut waiting, GROUP) => {
                    if !waiting.iter().any(|order| matches!(order, Order::Flush(_) | Order::Close)) {
                        tokio::time::sleep(REST).await;
                        while waiting.len() < GROUP && let Ok(order) = orders.try_recv() {
                            waiting.push(order);
                        }
                    }
                    let group = group(&mut waiting);
                    let close = group.close || received == 0;
                    self.carry_out(group).await;
                    if close {
                        return;
                    }
                }
                _ = sweep.tick() => self.evict().await,
            }
        }
    }

    async fn carry_out(&mut self, mut group: Group) {
        // What was written meanwhile waits no more.
        let waiting = |result: &Arc<KeptResult>| self.desk.waiting().results.contains_key(&result.key);
        group.put.retain(waiting);
        let orders = group.put.len() + group.touched.len() + group.forgotten.len();
        let mut written = orders == 0;
        if !written {
            match compressed(group.put.clone()).await {
                Ok(rows) => written = self.write(&rows, &group).await,
                Err(reason) => tracing::warn!(reason, "results are not kept"),
            }
        }
        for result in &group.put {
            self.desk.waiting().remove(&result.key);
        }
        self.desk.full.store(false, Ordering::Relaxed);
        if self.unlooked_bytes > self.keep.bytes / 16 {
            self.evict().await;
        }
        for flushed in group.flushed {
            let _ = flushed.send(written);
        }
    }

    /// Writes a group, again and again while the database is away; whether it is written.
    async fn write(&mut self, rows: &[ResultRow], group: &Group) -> bool {
        for attempt in 1..=ATTEMPTS {
            match write(&self.pool, rows, group, self.clock.now_ms()).await {
                Ok(()) => {
                    let bytes: i64 = rows.iter().map(ResultRow::bytes).sum();
                    self.unlooked_bytes += u64::try_from(bytes).unwrap_or(0);
                    return true;
                }
                Err(error) => {
                    metrics::counter!("precut_store_failures_total", "operation" => "write").increment(1);
                    let is_last = attempt == ATTEMPTS || self.desk.closing.load(Ordering::Relaxed);
                    if attempt == 1 || is_last {
                        tracing::warn!(rows = rows.len(), %error, is_last, "results cannot be written");
                    }
                    if is_last {
                        return false;
                    }
                }
            }
            tokio::time::sleep(PAUSE).await;
        }
        false
    }

    async fn evict(&mut self) {
        self.unlooked_bytes = 0;
        if let Err(error) = results::evict(&self.pool, self.keep.bytes, self.keep.age).await {
            metrics::counter!("precut_store_failures_total", "operation" => "evict").increment(1);
            tracing::warn!(%error, "old results could not be thrown away");
        }
    }
}

async fn write(pool: &PgPool, rows: &[ResultRow], group: &Group, now: i64) -> Outcome<()> {
    if group.forgotten.is_empty() && group.touched.is_empty() && rows.len() <= ROWS_AT_ONCE {
        // One statement is a transaction of its own.
        return common::results::insert(&mut *pool.acquire().await?, rows, now).await.map(drop);
    }
    let mut transaction = pool.begin().await?;
    let bytes = |keys: &mut dyn Iterator<Item = &Key>| -> Vec<Vec<u8>> {
        let mut keys: Vec<Vec<u8>> = keys.map(|key| key.as_bytes().to_vec()).collect();
        keys.sort_unstable();
        keys
    };
    if !group.forgotten.is_empty() {
        sqlx::query("DELETE FROM results WHERE key = ANY($1)")
            .bind(bytes(&mut group.forgotten.iter()))
            .execute(&mut *transaction)
            .await?;
    }
    let mut sorted: Vec<ResultRow> = rows.to_vec();
    sorted.sort_by(|one, other| one.key.cmp(&other.key));
    for some in sorted.chunks(ROWS_AT_ONCE) {
        common::results::insert(&mut *transaction, some, now).await?;
    }
    if !group.touched.is_empty() {
        // A use within the last minute is as good as one now, and a row that another process holds is left alone.
        sqlx::query(
            "UPDATE results SET used_ms = $2 WHERE key IN (
                 SELECT key FROM results WHERE key = ANY($1) AND used_ms < $2 - 60000 FOR UPDATE SKIP LOCKED)",
        )
        .bind(bytes(&mut group.touched.iter()))
        .bind(now)
        .execute(&mut *transaction)
        .await?;
    }
    transaction.commit().await
}

fn group(waiting: &mut Vec<Order>) -> Group {
    let mut group = Group::default();
    for order in waiting.drain(..) {
        match order {
            Order::Put(result) => group.put.push(result),
            Order::Touch(key) => drop(group.touched.insert(key)),
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
        results.iter().map(|result| packer.row(result)).collect::<Result<Vec<_>, std::io::Error>>()
    };
    tokio::task::spawn_blocking(work).await.map_err(|error| error.to_string())?.map_err(|error| error.to_string())
}
