//! What a study needs of the engine in which it runs.

use std::sync::Arc;
use std::time::Duration;

use precut_calc::calculator::Monitor;

use crate::engine::answer::Stored;
use crate::engine::error::Error;
use crate::engine::memory::Kept;
use crate::engine::read::Ready;
use crate::engine::{Quiet, compute};
use crate::key::Key;

/// What a study needs of the engine in which it runs. Called from threads that calculate: calls may block.
pub(crate) trait Host: Send + Sync {
    /// What is kept under a key.
    fn kept(&self, key: &Key) -> Option<Kept>;
    /// Computes a point; `apart`: in a process of its own, where that can be.
    fn compute(&self, ready: &Ready, monitor: &dyn Monitor, apart: bool) -> Result<Stored, Error>;
    /// Keeps what would come out again.
    fn keep(&self, ready: &Ready, outcome: Result<Stored, Error>, took: Duration) -> Result<Arc<Stored>, Error>;
}

/// No engine: every point is computed, nothing is kept.
pub(crate) struct Alone;

impl Host for Alone {
    fn kept(&self, _key: &Key) -> Option<Kept> {
        None
    }
    fn compute(&self, ready: &Ready, monitor: &dyn Monitor, _apart: bool) -> Result<Stored, Error> {
        compute(ready, &Quiet(monitor))
    }
    fn keep(&self, _ready: &Ready, outcome: Result<Stored, Error>, _took: Duration) -> Result<Arc<Stored>, Error> {
        outcome.map(Arc::new)
    }
}
