//! What is written behind the answers: in groups, by one task, which rests between groups. What waits is read from here.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex as StdMutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::{Mutex, Notify, mpsc, oneshot};
use tokio::task::JoinHandle;

use super::KeptResult;
use super::row::{Packer, ResultRow};
use crate::key::Key;

/// Orders that may wait.
const WAITING_ORDERS: usize = 4096;
/// Bytes of results that may wait; further results are not kept.
const WAITING_BYTES: usize = 64 << 20;
/// Orders in one transaction.
const GROUP: usize = 256;
/// Rows in one statement.
pub(super) const ROWS_AT_ONCE: usize = 32;
/// How often age is looked at.
const SWEEP_EVERY: Duration = Duration::from_mins(10);

/// Carries orders out.
pub(super) trait Clerk: Send + 'static {
    /// Writes a group; whether it is written.
    fn write(&mut self, group: &Group, rows: &[ResultRow], desk: &Desk) -> impl Future<Output = bool> + Send;
    /// Throws away what is too much, and with `is_time` what is too old.
    fn tidy(&mut self, is_time: bool) -> impl Future<Output = ()> + Send;
    /// How long a group gathers after one that took so long.
    fn rest(&self, took: Duration) -> Duration;
    /// After the last group.
    fn close(self) -> impl Future<Output = ()> + Send;
}

/// Takes orders and has them carried out.
pub(super) struct Writer {
    orders: mpsc::Sender<Order>,
    desk: Arc<Desk>,
    task: Mutex<Option<JoinHandle<()>>>,
}

/// What those who order and the one who carries out have in common.
#[derive(Default)]
pub(super) struct Desk {
    waiting: StdMutex<Waiting>,
    /// Whether results were turned away since the last group was written.
    full: AtomicBool,
    closing: AtomicBool,
    /// Ends a rest.
    hurry: Notify,
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

impl Desk {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the service stops.
    pub(super) fn is_closing(&self) -> bool {
        self.closing.load(Ordering::Relaxed)
    }

    /// Rests while orders come in, unless somebody waits for one of them.
    async fn gather(&self, orders: &mut mpsc::Receiver<Order>, waiting: &mut Vec<Order>, rest: Duration) {
        if !waiting.iter().any(Order::is_urgent) {
            tokio::select! {
                () = tokio::time::sleep(rest) => {}
                () = self.hurry.notified() => {}
            }
        }
        while waiting.len() < GROUP
            && let Ok(order) = orders.try_recv()
        {
            waiting.push(order);
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

impl Order {
    /// Whether somebody waits for it.
    const fn is_urgent(&self) -> bool {
        matches!(self, Self::Flush(_) | Self::Close)
    }
}

/// The orders of one group.
#[derive(Default)]
pub(super) struct Group {
    put: Vec<Arc<KeptResult>>,
    pub(super) touched: HashSet<Key>,
    pub(super) forgotten: Vec<Key>,
    flushed: Vec<oneshot::Sender<bool>>,
    close: bool,
}

impl Group {
    fn of(orders: &mut Vec<Order>) -> Self {
        let mut group = Self::default();
        for order in orders.drain(..) {
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

    fn is_empty(&self) -> bool {
        self.put.is_empty() && self.touched.is_empty() && self.forgotten.is_empty()
    }
}

impl Writer {
    pub(super) fn start(clerk: impl Clerk) -> Self {
        let (orders, receiver) = mpsc::channel(WAITING_ORDERS);
        let desk: Arc<Desk> = Arc::default();
        let task = tokio::spawn(work(clerk, Arc::clone(&desk), receiver));
        Self { orders, desk, task: Mutex::new(Some(task)) }
    }

    pub(super) fn put(&self, result: KeptResult) {
        let desk = &self.desk;
        let (key, size, result) = (result.key, size(&result), Arc::new(result));
        // Held until it waits: once it is ordered it may be written, and then it waits no more.
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
        self.desk.closing.store(true, Ordering::Relaxed);
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

async fn work<C: Clerk>(mut clerk: C, desk: Arc<Desk>, mut orders: mpsc::Receiver<Order>) {
    let mut sweep = tokio::time::interval(SWEEP_EVERY);
    let mut waiting = Vec::new();
    let mut rest = clerk.rest(Duration::ZERO);
    loop {
        tokio::select! {
            received = orders.recv_many(&mut waiting, GROUP) => {
                desk.gather(&mut orders, &mut waiting, rest).await;
                let group = Group::of(&mut waiting);
                let close = group.close || received == 0;
                let begun = Instant::now();
                carry_out(&mut clerk, &desk, group).await;
                if close {
                    break;
                }
                rest = if orders.len() >= GROUP { Duration::ZERO } else { clerk.rest(begun.elapsed()) };
            }
            _ = sweep.tick() => clerk.tidy(true).await,
        }
    }
    clerk.close().await;
}

async fn carry_out<C: Clerk>(clerk: &mut C, desk: &Desk, mut group: Group) {
    // What was written meanwhile waits no more.
    group.put.retain(|result| desk.waiting().results.contains_key(&result.key));
    let mut written = true;
    if !group.is_empty() {
        written = match packed(group.put.clone()).await {
            Ok(rows) => clerk.write(&group, &rows, desk).await,
            Err(reason) => {
                tracing::warn!(reason, "results are not kept");
                false
            }
        };
    }
    for result in &group.put {
        desk.waiting().remove(&result.key);
    }
    desk.full.store(false, Ordering::Relaxed);
    clerk.tidy(false).await;
    for flushed in group.flushed {
        let _ = flushed.send(written);
    }
}

/// Compressed away from the threads that move bytes.
async fn packed(results: Vec<Arc<KeptResult>>) -> Result<Vec<ResultRow>, String> {
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
