//! Cores: the named pools for all physics, and who may use them.
//!
//! Direct answers have a thread per core. Jobs have a pool of their own with one thread less: whatever a long
//! calculation does in parallel, it cannot take all threads from the short ones, which would otherwise stand behind
//! every piece of its work. Short jobs have one more thread for the time when long ones have taken all of theirs.
//!
//! A calculation begins where nothing else is under way. A thread that waits for pieces of its own calculation takes
//! up whatever rayon has for it meanwhile, and returns when that is done: if it were another calculation, a short one
//! would end with a long one. So calculations stand in a line of their own, and rayon has nothing but pieces.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore, TryAcquireError, oneshot};

use super::error::Error;

/// When a client that found no slot should come again.
const RETRY_AFTER: Duration = Duration::from_secs(1);
/// So long after a thread was called for a calculation that nobody has begun yet the next one is called: the first may
/// be at a piece of another.
const CALL_AGAIN: Duration = Duration::from_micros(200);

/// The pools of calculation threads with their slots.
pub(crate) struct Cores {
    pool: Pool,
    job_pool: Pool,
    job_slots: Arc<Semaphore>,
    job_slot_count: u32,
    short_pool: Pool,
    short_slot: Arc<Semaphore>,
    slots: Arc<Semaphore>,
    slot_count: u32,
    patience: Duration,
}

/// The right to use a pool for one calculation.
pub(crate) struct Slot {
    line: Arc<Line>,
    #[allow(dead_code)] // held, never looked at
    permit: OwnedSemaphorePermit,
    /// Of who runs alone: short jobs keep away, too.
    #[allow(dead_code)]
    keeps_away: Option<OwnedSemaphorePermit>,
    is_short: bool,
}

impl Slot {
    /// Where its calculation is to stand in line.
    pub(crate) fn line(&self) -> Arc<Line> {
        Arc::clone(&self.line)
    }

    /// Whether it is the one for short jobs.
    pub(crate) const fn is_short(&self) -> bool {
        self.is_short
    }

    /// Runs `work`, see [`Line::run`], and is given back with its end.
    pub(crate) async fn run<T: Send + 'static>(
        self,
        work: impl FnOnce(&Left<'_>) -> Result<T, Error> + Send + 'static,
    ) -> Result<T, Error> {
        self.line()
            .run(move |left| {
                let _held = self;
                work(left)
            })
            .await
    }
}

impl Cores {
    /// Twice as many slots as cores: while one job ends, the next is there.
    pub(crate) fn new(cores: usize, job_slots: usize, patience: Duration) -> Result<Self, rayon::ThreadPoolBuildError> {
        let (cores, job_slots) = (cores.clamp(1, 1024), job_slots.clamp(1, 1024));
        let (job_slot_count, job_pool) = (u32::try_from(job_slots).unwrap_or(1), Pool::new("job", job_slots)?);
        let (pool, short_pool) = (Pool::new("calc", cores)?, Pool::new("short", 1)?);
        let job_slots = Arc::new(Semaphore::new(job_slots));
        let slot_count = u32::try_from(2 * cores).unwrap_or(u32::MAX);
        let slots = Arc::new(Semaphore::new(2 * cores));
        let short_slot = Arc::new(Semaphore::new(1));
        Ok(Self { pool, job_pool, job_slots, job_slot_count, short_pool, short_slot, slots, slot_count, patience })
    }

    /// A slot if one is free.
    pub(crate) fn slot_now(&self) -> Result<Option<Slot>, Error> {
        match Arc::clone(&self.slots).try_acquire_owned() {
            Ok(permit) => Ok(Some(self.pool.slot(permit))),
            Err(TryAcquireError::NoPermits) => Ok(None),
            Err(TryAcquireError::Closed) => Err(Error::ShuttingDown),
        }
    }

    /// A slot, waiting for one, but not for long. How many may wait is bounded by how many requests are in work.
    pub(crate) async fn slot(&self) -> Result<Slot, Error> {
        let busy = || {
            metrics::counter!("precut_busy_total").increment(1);
            Error::Busy { retry_after: RETRY_AFTER }
        };
        match tokio::time::timeout(self.patience, Arc::clone(&self.slots).acquire_owned()).await {
            Ok(Ok(permit)) => Ok(self.pool.slot(permit)),
            Ok(Err(_closed)) => Err(Error::ShuttingDown),
            Err(_elapsed) => Err(busy()),
        }
    }

    /// How many jobs may run at the same time.
    pub(crate) const fn job_places(&self) -> usize {
        self.job_slot_count as usize
    }

    /// The right to run a job: alone, or beside others. Waits for it.
    pub(crate) async fn job_slot(&self, alone: bool) -> Result<Slot, Error> {
        let closed = |_| Error::ShuttingDown;
        let permits = if alone { self.job_slot_count } else { 1 };
        let permit = Arc::clone(&self.job_slots).acquire_many_owned(permits).await.map_err(closed)?;
        let mut slot = self.job_pool.slot(permit);
        if alone {
            slot.keeps_away = Some(Arc::clone(&self.short_slot).acquire_owned().await.map_err(closed)?);
        }
        Ok(slot)
    }

    /// The right to run a short job while others have taken all places.
    pub(crate) async fn short_job_slot(&self) -> Result<Slot, Error> {
        let permit = Arc::clone(&self.short_slot).acquire_owned().await;
        permit
            .map(|permit| Slot { is_short: true, ..self.short_pool.slot(permit) })
            .map_err(|_closed| Error::ShuttingDown)
    }

    /// Whether a job that comes now finds a place.
    pub(crate) fn has_job_place(&self) -> bool {
        self.job_slots.available_permits() > 0
    }

    /// Gives no more slots and waits until those given are back, at most so long; whether they are.
    pub(crate) async fn drain(&self, most: Duration) -> bool {
        let all = async {
            let _jobs = self.job_slots.acquire_many(self.job_slot_count).await?;
            let _short = self.short_slot.acquire().await?;
            self.slots.acquire_many(self.slot_count).await.map(drop)
        };
        let back = matches!(tokio::time::timeout(most, all).await, Ok(Ok(())));
        self.slots.close();
        self.job_slots.close();
        self.short_slot.close();
        back
    }
}

/// Threads that calculate, and the line of what they are to begin.
struct Pool {
    line: Arc<Line>,
    _threads: rayon::ThreadPool,
}

impl Pool {
    fn new(name: &'static str, threads: usize) -> Result<Self, rayon::ThreadPoolBuildError> {
        let line = Arc::new(Line::default());
        let bell =
            rayon::ThreadPoolBuilder::new().num_threads(1).thread_name(move |_| format!("{name}-bell")).build()?;
        let attended = Arc::clone(&line);
        let threads = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(move |index| format!("{name}-{index}"))
            .start_handler(move |_| attended.attend(&bell))
            .build()
            .inspect_err(|_| line.close())?;
        Ok(Self { line, _threads: threads })
    }

    fn slot(&self, permit: OwnedSemaphorePermit) -> Slot {
        Slot { line: Arc::clone(&self.line), permit, keeps_away: None, is_short: false }
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.line.close();
    }
}

/// Calculations that nobody has begun, the oldest first.
#[derive(Default)]
pub(crate) struct Line {
    standing: Mutex<Standing>,
    came: Condvar,
}

#[derive(Default)]
struct Standing {
    work: VecDeque<Box<dyn FnOnce() + Send>>,
    /// So many of them no thread was called for.
    uncalled: usize,
    closed: bool,
}

/// Whether nobody waits any more for what is computed.
pub(crate) type Left<'l> = dyn Fn() -> bool + Sync + 'l;

impl Line {
    /// Runs `work` and waits for it. A future that is dropped waits no more; the work is not interrupted, but may ask.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Left<'_>) -> Result<T, Error> + Send + 'static,
    ) -> Result<T, Error> {
        let (sender, receiver) = oneshot::channel();
        self.push(move || {
            let outcome = guarded(|| work(&|| sender.is_closed()));
            let _ = sender.send(outcome);
        });
        receiver.await.unwrap_or(Err(Error::Crashed))
    }

    pub(crate) fn push(&self, work: impl FnOnce() + Send + 'static) {
        let mut standing = self.lock();
        standing.work.push_back(Box::new(work));
        standing.uncalled += 1;
        drop(standing);
        self.came.notify_one();
    }

    /// What stands in line is still begun, and then no more.
    fn close(&self) {
        self.lock().closed = true;
        self.came.notify_one();
    }

    /// What a thread of the pool does all its life: the next calculation, and while there is none, pieces of those of
    /// others. These rayon finds for a thread of one pool that waits for another pool, here that of the bell.
    fn attend(&self, bell: &rayon::ThreadPool) {
        loop {
            let mut standing = self.lock();
            let (next, closed) = (standing.work.pop_front(), standing.closed);
            standing.uncalled = standing.uncalled.min(standing.work.len());
            drop(standing);
            match next {
                Some(work) => work(),
                None if closed => return,
                None => bell.install(|| self.call()),
            }
        }
    }

    /// Returns when the thread that waits for it is to look at the line. The bell has one thread: it calls one after
    /// the other, and no more than there is work for.
    fn call(&self) {
        let mut standing = self.lock();
        loop {
            if standing.closed {
                return;
            }
            if standing.uncalled > 0 {
                standing.uncalled -= 1;
                return;
            }
            if standing.work.is_empty() {
                standing = self.came.wait(standing).unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            let (again, waited) = self.came.wait_timeout(standing, CALL_AGAIN).unwrap_or_else(PoisonError::into_inner);
            standing = again;
            if waited.timed_out() && !standing.work.is_empty() {
                return;
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, Standing> {
        self.standing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The outcome of `work`, a panic as [`Error::Crashed`]: on the pool a panic would end the process.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let said = panic.downcast_ref::<&str>().copied().map(str::to_owned);
        let said = said.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default();
        tracing::error!(panic = said, "a calculation panicked");
        metrics::counter!("precut_panics_total").increment(1);
        Err(Error::Crashed)
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::mpsc::channel;
    use std::thread::sleep;
    use std::time::Instant;

    use futures_util::FutureExt;

    use super::*;

    const LONG: Duration = Duration::from_secs(10);

    fn cores(threads: usize) -> Arc<Cores> {
        Arc::new(Cores::new(threads, threads, Duration::ZERO).unwrap())
    }

    fn becomes(is_so: impl Fn() -> bool) -> bool {
        let begun = Instant::now();
        while !is_so() && begun.elapsed() < LONG {
            sleep(Duration::from_millis(1));
        }
        is_so()
    }

    #[test]
    fn a_calculation_that_waits_for_a_piece_takes_up_no_other() {
        let cores = cores(2);
        let ((over, is_over), (seen, sees)) = (channel(), channel());
        let inside = Arc::clone(&cores);
        cores.job_pool.line.push(move || {
            let begun = &Barrier::new(2);
            // The other one comes while this one waits for its last piece, and goes on until this one is over.
            let other = move || seen.send(is_over.recv_timeout(LONG).is_ok()).unwrap();
            let last_piece = move || {
                begun.wait();
                inside.job_pool.line.push(other);
                sleep(Duration::from_millis(100));
            };
            rayon::join(|| begun.wait(), last_piece);
            // Nobody listens if the other one is over.
            let _ = over.send(());
        });
        assert!(sees.recv().unwrap(), "the first was over only after the other");
    }

    #[test]
    fn a_calculation_begins_while_others_are_at_long_pieces() {
        for _ in 0..20 {
            let cores = cores(3);
            let came = Arc::new(AtomicBool::new(false));
            let (begin, begun) = channel();
            let (seen, sees) = channel();
            let awaited = Arc::clone(&came);
            cores.job_pool.line.push(move || {
                let both = &Barrier::new(2);
                let piece = || {
                    both.wait();
                    becomes(|| awaited.load(Ordering::Relaxed))
                };
                let first = || {
                    both.wait();
                    begin.send(()).unwrap();
                    becomes(|| awaited.load(Ordering::Relaxed))
                };
                seen.send(rayon::join(first, piece)).unwrap();
            });
            begun.recv().unwrap();
            cores.job_pool.line.push(move || came.store(true, Ordering::Relaxed));
            assert_eq!(sees.recv().unwrap(), (true, true));
        }
    }

    #[tokio::test]
    async fn who_runs_alone_has_no_short_job_beside_him() {
        let cores = cores(2);
        let short = cores.short_job_slot().await.unwrap();
        assert!(cores.has_job_place());
        let mut alone = Box::pin(cores.job_slot(true));
        assert!(alone.as_mut().now_or_never().is_none());
        drop(short);
        let alone = alone.await.unwrap();
        assert!(!cores.has_job_place());
        assert!(cores.short_job_slot().now_or_never().is_none());
        drop(alone);
        cores.short_job_slot().await.unwrap();
    }

    #[test]
    fn threads_end_when_what_stands_in_line_is_done() {
        let cores = cores(1);
        let lines = [&cores.pool, &cores.job_pool, &cores.short_pool].map(|pool| &pool.line).map(Arc::downgrade);
        let (done, all) = channel();
        for index in 0..3 {
            let done = done.clone();
            cores.pool.line.push(move || {
                sleep(Duration::from_millis(20));
                done.send(index).unwrap();
            });
        }
        drop((cores, done));
        assert_eq!(all.iter().collect::<Vec<_>>(), [0, 1, 2]);
        assert!(becomes(|| lines.iter().all(|line| line.strong_count() == 0)));
    }
}
