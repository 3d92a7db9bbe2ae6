//! A study inside an engine: its points come out of the engine's cache and go into it.

use std::sync::{Arc, OnceLock, Weak};
use std::time::Duration;

use precut_calc::calculator::Monitor;
use tokio::runtime::Handle;

use super::host::{Alone, Host};
use crate::engine::Inner;
use crate::engine::answer::Stored;
use crate::engine::error::Error;
use crate::engine::jobs::compute_apart;
use crate::engine::memory::Kept;
use crate::engine::read::Ready;
use crate::key::Key;

/// The engine that a study runs in. The engine holds the entry of studies, and that this: hence the weak link.
#[derive(Default)]
pub(crate) struct InEngine(OnceLock<Place>);

struct Place {
    engine: Weak<Inner>,
    /// The runtime that the store needs; studies run on threads of their own, which may wait for it.
    runtime: Option<Handle>,
}

impl InEngine {
    /// From now on this is the engine, and the runtime is that of the caller.
    pub(crate) fn move_in(&self, engine: &Arc<Inner>) {
        let place = Place { engine: Arc::downgrade(engine), runtime: Handle::try_current().ok() };
        // An engine is made once.
        let _ = self.0.set(place);
    }

    fn engine(&self) -> Option<(Arc<Inner>, Option<&Handle>)> {
        let place = self.0.get()?;
        Some((place.engine.upgrade()?, place.runtime.as_ref()))
    }
}

impl Host for InEngine {
    fn kept(&self, key: &Key) -> Option<Kept> {
        let (engine, runtime) = self.engine()?;
        engine.memory.get(key).or_else(|| runtime?.block_on(engine.look_up(key)))
    }

    fn compute(&self, ready: &Ready, monitor: &dyn Monitor, apart: bool) -> Result<Stored, Error> {
        let isolation = self.engine().filter(|_| apart).and_then(|(engine, _)| engine.settings.isolation.clone());
        match isolation {
            Some(isolation) => compute_apart(ready, &isolation, &|| monitor.cancelled()),
            None => Alone.compute(ready, monitor, apart),
        }
    }

    fn keep(&self, ready: &Ready, outcome: Result<Stored, Error>, took: Duration) -> Result<Arc<Stored>, Error> {
        match self.engine() {
            Some((engine, _)) => engine.keep(ready, outcome, took),
            None => Alone.keep(ready, outcome, took),
        }
    }
}
