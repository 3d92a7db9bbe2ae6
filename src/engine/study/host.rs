//! What a study needs of the engine in which it runs.

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;

use crate::engine::answer::Stored;
use crate::engine::error::Error;
use crate::engine::memory::Kept;
use crate::engine::read::Ready;
use crate::key::Key;

/// What a helper does. It asks from time to time whether it may go on, or whether somebody else waits for its core.
pub(crate) type Help = dyn Fn(&mut dyn FnMut() -> bool) + Send + Sync;

/// What a study needs of the engine in which it runs. Called from threads that calculate: calls may block.
pub(crate) trait Host: Send + Sync {
    /// What is kept under a key.
    fn kept(&self, key: &Key) -> Option<Kept>;
    /// Keeps what would come out again.
    fn keep(&self, ready: &Ready, outcome: Result<Stored, Error>, took: Duration) -> Result<Arc<Stored>, Error>;
    /// Runs `work` on further cores that nobody else has a right to, on at most so many.
    fn help(&self, most: usize, work: &Arc<Help>);
    /// What was put down of a study before, by the number of the shard.
    fn put_down(&self, study: &Key) -> Vec<(usize, Bytes)>;
    /// Puts a part of a study down; where it says yes, it and the answers of its points outlast the process.
    fn put(&self, study: &Key, shard: usize, content: Bytes) -> bool;
    /// Whether other processes may compute parts of a study.
    fn is_shared(&self) -> bool {
        false
    }
    /// Asks them to, by at most so many tasks.
    fn call(&self, _study: &Key, _most: usize) {}
    /// Takes the next part of a study of so many that are shared out; `None` where all are done or in somebody's hands,
    /// an error where that cannot be said at the moment.
    fn take(&self, _study: &Key, _of: usize) -> Result<Option<usize>, ()> {
        Ok(None)
    }
    /// Gives a part back that was taken and is not put down.
    fn give_back(&self, _study: &Key, _shard: usize) {}
    /// What others have put down of these parts.
    fn collect(&self, _study: &Key, _wanted: Vec<usize>) -> Vec<(usize, Bytes)> {
        Vec::new()
    }
    /// The study is complete: what was put down of it is needed no more.
    fn forget(&self, study: &Key);
}

/// No engine: every point is computed, nothing is kept.
pub(crate) struct Alone;

impl Host for Alone {
    fn kept(&self, _key: &Key) -> Option<Kept> {
        None
    }
    fn keep(&self, _ready: &Ready, outcome: Result<Stored, Error>, _took: Duration) -> Result<Arc<Stored>, Error> {
        outcome.map(Arc::new)
    }
    fn help(&self, _most: usize, _work: &Arc<Help>) {}
    fn put_down(&self, _study: &Key) -> Vec<(usize, Bytes)> {
        Vec::new()
    }
    fn put(&self, _study: &Key, _shard: usize, _content: Bytes) -> bool {
        false
    }
    fn forget(&self, _study: &Key) {}
}
