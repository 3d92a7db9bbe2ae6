//! Cores: the named pools for all physics, and who may use them.
//!
//! Direct answers have a thread per core. Jobs have a pool of their own with one thread less: whatever a long
//! calculation does in parallel, it cannot take all threads from the short ones, which would otherwise stand behind
//! every piece of its work.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore, TryAcquireError, oneshot};

use super::error::Error;

/// When a client that found no slot should come again.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// The pools of calculation threads with their slots.
pub(crate) struct Cores {
    pool: rayon::ThreadPool,
    job_pool: rayon::ThreadPool,
    job_slots: Arc<Semaphore>,
    job_slot_count: u32,
    slots: Arc<Semaphore>,
    slot_count: u32,
    in_line: AtomicUsize,
    patience: Duration,
}

/// The right to use the pool for one job.
pub(crate) struct Slot(#[allow(dead_code)] OwnedSemaphorePermit); // held, never looked at

impl Cores {
    /// Twice as many slots as cores: while one job ends, the next is there.
    pub(crate) fn new(cores: usize, job_slots: usize, patience: Duration) -> Result<Self, rayon::ThreadPoolBuildError> {
        let pool = |name: &'static str, threads: usize| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .thread_name(move |index| format!("{name}-{index}"))
                .build()
        };
        let (cores, job_slots) = (cores.clamp(1, 1024), job_slots.clamp(1, 1024));
        let (job_slot_count, job_pool) = (u32::try_from(job_slots).unwrap_or(1), pool("job", job_slots)?);
        let pool = pool("calc", cores)?;
        let job_slots = Arc::new(Semaphore::new(job_slots));
        let slot_count = u32::try_from(2 * cores).unwrap_or(u32::MAX);
        let slots = Arc::new(Semaphore::new(2 * cores));
        let in_line = AtomicUsize::new(0);
        Ok(Self { pool, job_pool, job_slots, job_slot_count, slots, slot_count, in_line, patience })
    }

    /// A slot if one is free.
    pub(crate) fn slot_now(&self) -> Result<Option<Slot>, Error> {
        match Arc::clone(&self.slots).try_acquire_owned() {
            Ok(permit) => Ok(Some(Slot(permit))),
            Err(TryAcquireError::NoPermits) => Ok(None),
            Err(TryAcquireError::Closed) => Err(Error::ShuttingDown),
        }
    }

    /// A slot, waiting for one in a line that is no longer than there are slots, and not for long.
    pub(crate) async fn slot(&self) -> Result<Slot, Error> {
        let before = self.in_line.fetch_add(1, Ordering::Relaxed);
        let _place = Place(&self.in_line);
        let busy = || {
            metrics::counter!("precut_busy_total").increment(1);
            Error::Busy { retry_after: RETRY_AFTER }
        };
        if before >= self.slot_count as usize {
            return self.slot_now()?.ok_or_else(busy);
        }
        match tokio::time::timeout(self.patience, Arc::clone(&self.slots).acquire_owned()).await {
            Ok(Ok(permit)) => Ok(Slot(permit)),
            Ok(Err(_closed)) => Err(Error::ShuttingDown),
            Err(_elapsed) => Err(busy()),
        }
    }

    /// How many jobs may run at the same time.
    pub(crate) fn job_places(&self) -> usize {
        self.job_slot_count as usize
    }

    /// The right to run a job: alone, or beside others. Waits for it.
    pub(crate) async fn job_slot(&self, alone: bool) -> Result<Slot, Error> {
        let permits = if alone { self.job_slot_count } else { 1 };
        let permit = Arc::clone(&self.job_slots).acquire_many_owned(permits).await;
        permit.map(Slot).map_err(|_closed| Error::ShuttingDown)
    }

    /// The right to use one more core for a job, if nobody waits for it.
    pub(crate) fn spare_job_slot(&self) -> Option<Slot> {
        Arc::clone(&self.job_slots).try_acquire_owned().ok().map(Slot)
    }

    /// Runs `work` on the jobs' pool.
    pub(crate) fn spawn_job(&self, work: impl FnOnce() + Send + 'static) {
        self.job_pool.spawn(work);
    }

    /// Runs `work` on the pool.
    pub(crate) fn spawn(&self, work: impl FnOnce() + Send + 'static) {
        self.pool.spawn(work);
    }

    /// Runs `work` on the pool and waits for it.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        slot: Slot,
        work: impl FnOnce() -> Result<T, Error> + Send + 'static,
    ) -> Result<T, Error> {
        let (sender, receiver) = oneshot::channel();
        self.pool.spawn(move || {
            let outcome = guarded(work);
            drop(slot);
            // Nobody listens if the client has gone.
            let _ = sender.send(outcome);
        });
        receiver.await.unwrap_or(Err(Error::Crashed))
    }

    /// Gives no more slots and waits until those given are back, at most so long; whether they are.
    pub(crate) async fn drain(&self, most: Duration) -> bool {
        let all = async {
            let _jobs = self.job_slots.acquire_many(self.job_slot_count).await?;
            self.slots.acquire_many(self.slot_count).await.map(drop)
        };
        let back = matches!(tokio::time::timeout(most, all).await, Ok(Ok(())));
        self.slots.close();
        self.job_slots.close();
        back
    }
}

/// A place in the line.
struct Place<'a>(&'a AtomicUsize);

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
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
