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
pub(crate) struct Landed {
    pub(crate) outcome: Result<Arc<Stored>, Error>,
    pub(crate) timings: Timings,
}

/// The calculations under way.
#[derive(Default)]
pub(crate) struct Flights {
    under_way: Mutex<HashMap<Key, Arc<Flight>>>,
}

struct Flight {
    cancelled: Arc<AtomicBool>,
    progress: Arc<Progress>,
    waiting: AtomicUsize,
    landed: watch::Receiver<Option<Landed>>,
}

/// What came of boarding.
pub(crate) struct Boarded {
    pub(crate) seat: Seat,
    /// For the first on board: who must see to it that the calculation runs.
    pub(crate) pilot: Option<Pilot>,
}

impl Flights {
    /// Joins the calculation of that key, or begins one.
    pub(crate) fn board(self: &Arc<Self>, key: Key) -> Boarded {
        let mut under_way = self.lock();
        if let Some(flight) = under_way.get(&key) {
            flight.waiting.fetch_add(1, Ordering::Relaxed);
            let seat = Seat { flights: Arc::clone(self), flight: Arc::clone(flight), key };
            return Boarded { seat, pilot: None };
        }
        let (sender, landed) = watch::channel(None);
        let cancelled = Arc::default();
        let progress = Arc::default();
        let flight = Arc::new(Flight { cancelled, progress, waiting: AtomicUsize::new(1), landed });
        under_way.insert(key, Arc::clone(&flight));
        let pilot = Pilot { flights: Arc::clone(self), flight: Arc::clone(&flight), key, sender, landed: false };
        Boarded { seat: Seat { flights: Arc::clone(self), flight, key }, pilot: Some(pilot) }
    }

    /// Raises every flag: the service stops and will wait no longer.
    pub(crate) fn cancel_all(&self) {
        self.lock().values().for_each(|flight| flight.cancelled.store(true, Ordering::Relaxed));
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Key, Arc<Flight>>> {
        self.under_way.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn remove(&self, key: Key, flight: &Arc<Flight>) {
        let mut under_way = self.lock();
        if under_way.get(&key).is_some_and(|current| Arc::ptr_eq(current, flight)) {
            under_way.remove(&key);
        }
    }
}

/// Someone who waits. Leaving the last seat cancels the calculation.
pub(crate) struct Seat {
    flights: Arc<Flights>,
    flight: Arc<Flight>,
    key: Key,
}

impl Seat {
    /// How far the calculation is.
    pub(crate) fn progress(&self) -> Arc<Progress> {
        Arc::clone(&self.flight.progress)
    }

    pub(crate) async fn landed(self) -> Landed {
        let mut receiver = self.flight.landed.clone();
        let landed = receiver.wait_for(Option::is_some).await.ok().and_then(|landed| landed.clone());
        landed.unwrap_or_else(|| Landed { outcome: Err(Error::Crashed), timings: Timings::default() })
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        let mut under_way = self.flights.lock();
        if self.flight.waiting.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.flight.cancelled.store(true, Ordering::Relaxed);
            // A request that comes now begins afresh instead of joining what is being cancelled.
            if under_way.get(&self.key).is_some_and(|current| Arc::ptr_eq(current, &self.flight)) {
                under_way.remove(&self.key);
            }
        }
    }
}

/// Who sees to it that the calculation runs and that its end is told, whatever happens.
pub(crate) struct Pilot {
    flights: Arc<Flights>,
    flight: Arc<Flight>,
    key: Key,
    sender: watch::Sender<Option<Landed>>,
    landed: bool,
}

impl Pilot {
    /// What the calculation asks whether to go on.
    pub(crate) fn watch(&self) -> Watch {
        Watch { cancelled: Arc::clone(&self.flight.cancelled), progress: Arc::clone(&self.flight.progress) }
    }

    pub(crate) fn land(mut self, landed: Landed) {
        self.tell(landed);
    }

    fn tell(&mut self, landed: Landed) {
        self.landed = true;
        self.sender.send_replace(Some(landed));
        self.flights.remove(self.key, &self.flight);
    }
}

impl Drop for Pilot {
    fn drop(&mut self) {
        if !self.landed {
            self.tell(Landed { outcome: Err(Error::Crashed), timings: Timings::default() });
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
