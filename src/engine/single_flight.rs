//! Single flight: requests for one key share one calculation, which is cancelled when the last of them has gone.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use precut_calc::calculator::{Figure, Message, Monitor};
use tokio::sync::watch;

use super::error::Error;
use super::progress::Progress;
use super::{Stored, Timings};
use crate::key::Key;

/// How a calculation ended, for everyone who waits.
#[derive(Debug, Clone)]
pub(crate) struct Ended {
    pub(crate) outcome: Result<Arc<Stored>, Error>,
    pub(crate) timings: Timings,
}

/// The calculations under way, one for each key.
#[derive(Default)]
pub(crate) struct SingleFlight {
    under_way: Mutex<HashMap<Key, Arc<Shared>>>,
}

struct Shared {
    cancelled: Arc<AtomicBool>,
    progress: Arc<Progress>,
    waiting: AtomicUsize,
    ended: watch::Receiver<Option<Ended>>,
}

/// What came of joining.
pub(crate) struct Joined {
    pub(crate) waiter: Waiter,
    /// For the first: who must see to it that the calculation runs.
    pub(crate) leader: Option<Leader>,
}

impl SingleFlight {
    /// Joins the calculation of that key, or begins one.
    pub(crate) fn join(self: &Arc<Self>, key: Key) -> Joined {
        let mut under_way = self.lock();
        if let Some(shared) = under_way.get(&key) {
            shared.waiting.fetch_add(1, Ordering::Relaxed);
            let waiter = Waiter { single_flight: Arc::clone(self), shared: Arc::clone(shared), key };
            return Joined { waiter, leader: None };
        }
        let (sender, ended) = watch::channel(None);
        let cancelled = Arc::default();
        let progress = Arc::default();
        let shared = Arc::new(Shared { cancelled, progress, waiting: AtomicUsize::new(1), ended });
        under_way.insert(key, Arc::clone(&shared));
        let leader = Leader { single_flight: Arc::clone(self), shared: Arc::clone(&shared), key, sender, ended: false };
        Joined { waiter: Waiter { single_flight: Arc::clone(self), shared, key }, leader: Some(leader) }
    }

    /// Raises every flag: the service stops and will wait no longer.
    pub(crate) fn cancel_all(&self) {
        self.lock().values().for_each(|shared| shared.cancelled.store(true, Ordering::Relaxed));
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Key, Arc<Shared>>> {
        self.under_way.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn remove(&self, key: Key, shared: &Arc<Shared>) {
        let mut under_way = self.lock();
        if under_way.get(&key).is_some_and(|current| Arc::ptr_eq(current, shared)) {
            under_way.remove(&key);
        }
    }
}

/// Someone who waits. The calculation is cancelled when the last one is dropped.
pub(crate) struct Waiter {
    single_flight: Arc<SingleFlight>,
    shared: Arc<Shared>,
    key: Key,
}

impl Waiter {
    /// How far the calculation is.
    pub(crate) fn progress(&self) -> Arc<Progress> {
        Arc::clone(&self.shared.progress)
    }

    pub(crate) async fn ended(self) -> Ended {
        let mut receiver = self.shared.ended.clone();
        let ended = receiver.wait_for(Option::is_some).await.ok().and_then(|ended| ended.clone());
        ended.unwrap_or_else(|| Ended { outcome: Err(Error::Crashed), timings: Timings::default() })
    }
}

impl Drop for Waiter {
    fn drop(&mut self) {
        let mut under_way = self.single_flight.lock();
        if self.shared.waiting.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.shared.cancelled.store(true, Ordering::Relaxed);
            // A request that comes now begins afresh instead of joining what is being cancelled.
            if under_way.get(&self.key).is_some_and(|current| Arc::ptr_eq(current, &self.shared)) {
                under_way.remove(&self.key);
            }
        }
    }
}

/// Who sees to it that the calculation runs and that its end is told, whatever happens.
pub(crate) struct Leader {
    single_flight: Arc<SingleFlight>,
    shared: Arc<Shared>,
    key: Key,
    sender: watch::Sender<Option<Ended>>,
    ended: bool,
}

impl Leader {
    /// What the calculation asks whether to go on.
    pub(crate) fn watch(&self) -> Watch {
        Watch { cancelled: Arc::clone(&self.shared.cancelled), progress: Arc::clone(&self.shared.progress) }
    }

    pub(crate) fn end(mut self, ended: Ended) {
        self.tell(ended);
    }

    fn tell(&mut self, ended: Ended) {
        self.ended = true;
        self.sender.send_replace(Some(ended));
        self.single_flight.remove(self.key, &self.shared);
    }
}

impl Drop for Leader {
    fn drop(&mut self) {
        if !self.ended {
            self.tell(Ended { outcome: Err(Error::Crashed), timings: Timings::default() });
        }
    }
}

/// A calculation's view of those who wait for it.
pub(crate) struct Watch {
    cancelled: Arc<AtomicBool>,
    progress: Arc<Progress>,
}

impl Monitor for Watch {
    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
    fn progress(&self, fraction: f64, stage: Message) {
        self.progress.report(fraction, stage);
    }
    fn interim(&self, figure: Figure) {
        self.progress.show(figure);
    }
}
