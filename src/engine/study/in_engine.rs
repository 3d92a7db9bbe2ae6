//! A study inside an engine: its points come out of the engine's cache and go into it.

use std::sync::{Arc, OnceLock, Weak};
use std::time::Duration;

use bytes::Bytes;
use tokio::runtime::Handle;

use super::host::{Alone, Help, Host};
use crate::engine::Inner;
use crate::engine::answer::Stored;
use crate::engine::error::Error;
use crate::engine::memory::Kept;
use crate::engine::read::Ready;
use crate::key::Key;
use crate::store::Taken;

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

    fn keep(&self, ready: &Ready, outcome: Result<Stored, Error>, took: Duration) -> Result<Arc<Stored>, Error> {
        match self.engine() {
            Some((engine, _)) => engine.keep(ready, outcome, took),
            None => Alone.keep(ready, outcome, took),
        }
    }

    fn help(&self, most: usize, work: &Arc<Help>) {
        let Some((engine, _)) = self.engine() else { return };
        for _ in 0..most {
            let Some(slot) = engine.cores.spare_job_slot() else { return };
            let (cores, work) = (Arc::clone(&engine), Arc::clone(work));
            slot.line().push(move || {
                let mut slot = Some(slot);
                // Whoever waits for a core gets this one.
                work(&mut || {
                    slot = None;
                    slot = cores.cores.spare_job_slot();
                    slot.is_some()
                });
            });
        }
    }

    fn put_down(&self, study: &Key) -> Vec<(usize, Bytes)> {
        let Some((engine, Some(runtime))) = self.engine() else { return Vec::new() };
        match runtime.block_on(engine.store.shards(*study)) {
            Ok(shards) => shards.into_iter().map(|(shard, content)| (shard as usize, content)).collect(),
            Err(error) => {
                tracing::warn!(%study, %error, "what was put down of a study cannot be read; it begins anew");
                Vec::new()
            }
        }
    }

    fn put(&self, study: &Key, shard: usize, content: Bytes) -> bool {
        let (Some((engine, Some(runtime))), Ok(number)) = (self.engine(), u32::try_from(shard)) else { return false };
        let outcome = runtime.block_on(engine.store.put_shard(*study, number, content));
        if let Err(error) = &outcome {
            tracing::warn!(%study, shard, %error, "a part of a study is not put down");
        }
        outcome.is_ok()
    }

    fn is_shared(&self) -> bool {
        self.engine().is_some_and(|(engine, runtime)| runtime.is_some() && engine.jobs.store.is_shared())
    }

    fn call(&self, study: &Key, most: usize) {
        let (Some((engine, Some(runtime))), Ok(most)) = (self.engine(), u32::try_from(most)) else { return };
        if let Err(error) = runtime.block_on(engine.jobs.store.call_for_help(*study, most)) {
            tracing::warn!(%study, %error, "nobody else is asked to compute parts of a study");
        }
    }

    fn take(&self, study: &Key, of: usize) -> Result<Option<usize>, ()> {
        let (Some((engine, Some(runtime))), Ok(of)) = (self.engine(), u32::try_from(of)) else { return Err(()) };
        match runtime.block_on(engine.store.take_shard(*study, of)) {
            Ok(Taken::Shard(shard)) => Ok(Some(shard as usize)),
            Ok(Taken::NoneLeft | Taken::NotShared) => Ok(None),
            Err(error) => {
                tracing::warn!(%study, %error, "no part of a study can be taken at the moment");
                Err(())
            }
        }
    }

    fn give_back(&self, study: &Key, shard: usize) {
        let (Some((engine, Some(runtime))), Ok(shard)) = (self.engine(), u32::try_from(shard)) else { return };
        let _runtime = runtime.enter();
        engine.store.give_shard_back(*study, shard);
    }

    fn collect(&self, study: &Key, wanted: Vec<usize>) -> Vec<(usize, Bytes)> {
        let Some((engine, Some(runtime))) = self.engine() else { return Vec::new() };
        let wanted = wanted.into_iter().filter_map(|shard| u32::try_from(shard).ok()).collect();
        match runtime.block_on(engine.store.some_shards(*study, wanted)) {
            Ok(shards) => shards.into_iter().map(|(shard, content)| (shard as usize, content)).collect(),
            Err(error) => {
                tracing::debug!(%study, %error, "parts of a study cannot be collected at the moment");
                Vec::new()
            }
        }
    }

    fn forget(&self, study: &Key) {
        let Some((engine, Some(runtime))) = self.engine() else { return };
        if let Err(error) = runtime.block_on(engine.store.forget_shards(*study)) {
            tracing::warn!(%study, %error, "the parts of a study are not forgotten");
        }
    }
}
