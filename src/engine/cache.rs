//! Answers that are kept, in memory and in the store.

use std::sync::Arc;
use std::time::Duration;

use precut_calc::calculator::Failure;

use super::memory::Kept;
use super::read::Ready;
use super::{CacheState, Engine, Error, Inner, Solved, Stored, Timings};
use crate::key::Key;
use crate::store::{Origin, ResultPage, ResultQuery, StoreError};

impl Engine {
    /// A kept answer.
    pub async fn result(&self, key: &Key) -> Result<Option<Arc<Stored>>, Error> {
        match self.inner.memory.get(key) {
            Some(Kept::Answer(stored)) => Ok(Some(stored)),
            Some(Kept::Failure(_)) => Ok(None),
            None => Ok(self.inner.fetch(key).await?),
        }
    }

    /// Notes that an owner has asked for an answer: it is one of his from now on.
    pub async fn note_asked(&self, key: &Key, owner: &str, cache: CacheState) -> Result<(), Error> {
        if self.inner.asked.is_new(key, owner) || cache == CacheState::Miss {
            self.inner.store.note_asked(*key, owner.to_owned()).await?;
            self.inner.asked.add(key, owner);
        }
        Ok(())
    }

    /// Whether an owner has asked for an answer.
    pub async fn has_asked(&self, key: &Key, owner: &str) -> Result<bool, Error> {
        Ok(self.inner.store.has_asked(*key, owner.to_owned()).await?)
    }

    /// Since when an answer is kept, and who has asked for it: of all, or of one owner.
    pub async fn origin(&self, key: &Key, owner: Option<String>) -> Result<Origin, Error> {
        Ok(self.inner.store.origin(*key, owner).await?)
    }

    /// The list of kept answers, newest first.
    pub async fn results(&self, query: ResultQuery) -> Result<ResultPage, Error> {
        Ok(self.inner.store.list(query).await?)
    }

    /// How many kept answers got a record of that address (`machines/lathe-3@4`): of all, or of one owner.
    pub async fn uses(&self, record: String, owner: Option<String>) -> Result<u64, Error> {
        Ok(self.inner.store.uses(record, owner).await?)
    }
}

impl Inner {
    /// What is kept under a key, in memory or in the store. A store that fails is as good as an empty one here.
    pub(super) async fn look_up(&self, key: &Key) -> Option<Kept> {
        if let Some(kept) = self.memory.get(key) {
            metrics::counter!("precut_cache_hits_total", "tier" => "memory").increment(1);
            return Some(kept);
        }
        match self.fetch(key).await {
            Ok(stored) => stored.map(|stored| {
                metrics::counter!("precut_cache_hits_total", "tier" => "store").increment(1);
                Kept::Answer(stored)
            }),
            Err(error) => {
                tracing::warn!(%error, "the store is passed over");
                None
            }
        }
    }

    /// A kept answer from the store, kept in memory from now on.
    pub(super) async fn fetch(&self, key: &Key) -> Result<Option<Arc<Stored>>, StoreError> {
        let Some(kept) = self.store.get(*key).await? else { return Ok(None) };
        // A calculator that is no more has no results either.
        let Some(entry) = self.entry(&kept.calculator) else { return Ok(None) };
        let stored = Arc::new(Stored { key: *key, body: kept.body, input: kept.input, entry: Arc::clone(entry) });
        self.memory.keep(*key, Kept::Answer(Arc::clone(&stored)));
        Ok(Some(stored))
    }

    /// Keeps what would come out again: answers, and failures that follow from the job alone.
    pub(super) fn keep(
        &self,
        ready: &Ready,
        outcome: Result<Stored, Error>,
        run: Duration,
    ) -> Result<Arc<Stored>, Error> {
        let meta = ready.entry.meta();
        let label = match &outcome {
            Ok(_) => "ok",
            Err(Error::Cancelled) => "cancelled",
            Err(Error::Crashed | Error::Calculation(Failure::Internal(_))) => "error",
            Err(_) => "no_answer",
        };
        metrics::counter!("precut_calculations_total", "calculator" => meta.id, "outcome" => label).increment(1);
        metrics::histogram!("precut_calculation_seconds", "calculator" => meta.id).record(run.as_secs_f64());
        match outcome {
            Ok(stored) => {
                let stored = Arc::new(stored);
                self.memory.keep(ready.key, Kept::Answer(Arc::clone(&stored)));
                self.store.put(stored.kept());
                Ok(stored)
            }
            Err(Error::Calculation(failure)) => {
                match &failure {
                    Failure::Infeasible(_)
                    | Failure::Conflicting(_)
                    | Failure::OutOfModel(_)
                    | Failure::NotRead { .. }
                    | Failure::NotConverged { .. } => {
                        self.memory.keep(ready.key, Kept::Failure(failure.clone()));
                    }
                    Failure::Internal(reason) => {
                        tracing::error!(calculator = meta.id, key = %ready.key, reason, "a calculation failed");
                    }
                    Failure::Cancelled => {}
                }
                Err(Error::Calculation(failure))
            }
            Err(error) => {
                if error == Error::Crashed {
                    tracing::error!(calculator = meta.id, key = %ready.key, "a calculation crashed");
                }
                Err(error)
            }
        }
    }
}

pub(super) fn outcome(kept: Kept) -> Result<Arc<Stored>, Error> {
    match kept {
        Kept::Answer(stored) => Ok(stored),
        Kept::Failure(failure) => Err(Error::Calculation(failure)),
    }
}

pub(super) fn hit(kept: Kept, parse: Duration) -> Result<Solved, Error> {
    let timings = Timings { parse, ..Timings::default() };
    Ok(Solved { stored: outcome(kept)?, cache: CacheState::Hit, timings })
}
