//! Cores: one named pool for all physics, and who may use it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore, TryAcquireError, oneshot};

use super::error::Error;

/// When a client that found no slot should come again.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// The pool of calculation threads with its slots.
pub(crate) struct Cores {
    pool: rayon::ThreadPool,
    slots: Arc<Semaphore>,
    slot_count: u32,
    in_line: AtomicUsize,
    patience: Duration,
}

/// The right to use the pool for one job.
pub(crate) struct Slot(#[allow(dead_code)] OwnedSemaphorePermit); // held, never looked at

impl Cores {
    /// Twice as many slots as cores: while one job ends, the next is there.
    pub(crate) fn new(cores: usize, patience: Duration) -> Result<Self, rayon::ThreadPoolBuildError> {
        let cores = cores.clamp(1, 1024);
        let pool =
            rayon::ThreadPoolBuilder::new().num_threads(cores).thread_name(|index| format!("calc-{index}")).build()?;
        let slot_count = u32::try_from(2 * cores).unwrap_or(u32::MAX);
        let slots = Arc::new(Semaphore::new(2 * cores));
        Ok(Self { pool, slots, slot_count, in_line: AtomicUsize::new(0), patience })
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
        let all = tokio::time::timeout(most, self.slots.acquire_many(self.slot_count)).await;
        let back = matches!(all, Ok(Ok(_)));
        self.slots.close();
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
