//! What this process computes for jobs at the moment.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::{Notify, OwnedSemaphorePermit, watch};

use super::fault;
use crate::engine::progress::{Progress, Reported};
use crate::store::jobs::{Beat, Lease};

/// The computations of this process.
#[derive(Default)]
pub(crate) struct Computations {
    all: Mutex<HashMap<Lease, Arc<Running>>>,
    /// Some of them may not be wanted any more.
    doubt: Notify,
}

/// A computation for one or more equal jobs.
pub(crate) struct Running {
    lease: Lease,
    progress: Mutex<Arc<Progress>>,
    cancel: watch::Sender<bool>,
    /// The right to be one of those that run at the same time.
    place: Mutex<Option<OwnedSemaphorePermit>>,
    /// Whether jobs are on record as served by it.
    claimed: AtomicBool,
}

impl Computations {
    /// A computation that is about to be claimed: from now on it counts as alive.
    pub(super) fn begin(self: &Arc<Self>) -> Begun {
        let running = Arc::new(Running {
            lease: Lease::new(),
            progress: Mutex::default(),
            cancel: watch::channel(false).0,
            place: Mutex::default(),
            claimed: AtomicBool::new(false),
        });
        self.lock().insert(running.lease, Arc::clone(&running));
        Begun { computations: Arc::clone(self), running }
    }

    /// What is known of a computation beyond its record.
    pub(super) fn reported(&self, lease: Lease) -> Option<Reported> {
        let running = self.lock().get(&lease).cloned()?;
        Some(running.reported())
    }

    /// Jobs were given up: nobody wants these any more, and where one of them had shards, nor these.
    pub(super) fn give_up(&self, leases: &[Lease]) {
        if !leases.is_empty() {
            self.cancel(leases);
            self.doubt.notify_one();
        }
    }

    /// Waits until some may not be wanted any more.
    pub(super) async fn doubt(&self) {
        self.doubt.notified().await;
    }

    /// Nobody wants these any more.
    pub(super) fn cancel(&self, leases: &[Lease]) {
        let running = self.lock();
        for unwanted in leases.iter().filter_map(|lease| running.get(lease)) {
            unwanted.cancel.send_replace(true);
        }
    }

    /// All of them.
    pub(super) fn leases(&self) -> Vec<Lease> {
        self.lock().keys().copied().collect()
    }

    /// How far each is that serves jobs.
    pub(super) fn beats(&self) -> Vec<Beat> {
        let all: Vec<Arc<Running>> = self.lock().values().cloned().collect();
        all.iter()
            .filter(|running| running.claimed.load(Ordering::Acquire))
            .map(|running| {
                let Reported { fraction, stage, .. } = running.reported();
                Beat { lease: running.lease, progress: fraction, stage: stage.as_ref().map(fault::written_stage) }
            })
            .collect()
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Lease, Arc<Running>>> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Running {
    /// Its right to write.
    pub(super) fn lease(&self) -> Lease {
        self.lease
    }

    /// It runs in that place until its end is on record.
    pub(super) fn take_place(&self, place: Option<OwnedSemaphorePermit>) {
        *self.place.lock().unwrap_or_else(PoisonError::into_inner) = place;
    }

    /// It runs on without a place: others do what there is to be done.
    pub(super) fn give_place_back(&self) {
        self.take_place(None);
    }

    /// Jobs are served by it.
    pub(super) fn claimed(&self) {
        self.claimed.store(true, Ordering::Release);
    }

    /// From now on it is as far as that is.
    pub(crate) fn follow(&self, progress: Arc<Progress>) {
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner) = progress;
    }

    /// Where it leaves word of itself.
    pub(crate) fn progress(&self) -> Arc<Progress> {
        Arc::clone(&self.progress.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Whether nobody wants it any more.
    pub(crate) fn is_cancelled(&self) -> bool {
        *self.cancel.borrow()
    }

    /// Waits until nobody wants it any more.
    pub(crate) async fn cancelled(&self) {
        // The sender lives as long as this does.
        let _ = self.cancel.subscribe().wait_for(|cancelled| *cancelled).await;
    }

    fn reported(&self) -> Reported {
        self.progress().read()
    }
}

/// A computation while it is alive, from before it is claimed.
pub(super) struct Begun {
    computations: Arc<Computations>,
    pub(super) running: Arc<Running>,
}

impl Drop for Begun {
    fn drop(&mut self) {
        self.computations.lock().remove(&self.running.lease);
    }
}
