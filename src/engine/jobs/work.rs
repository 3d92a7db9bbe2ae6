//! What a job does when it runs.

use std::sync::Arc;
use std::time::Instant;

use bytes::Bytes;
use serde_json::Value;

use super::MOST_ATTEMPTS;
use super::isolated::Isolated;
use super::running::Running;
use super::shards::{self, OneShard};
use crate::engine::exec::Slot;
use crate::engine::read::Ready;
use crate::engine::single_flight::Joined;
use crate::engine::{Error, Inner, Stored, read};
use crate::key::Key;
use crate::registry::Entry;
use crate::store::jobs::{Claim, Ending};

/// Something to run for jobs.
pub(super) enum Work {
    /// One answer of one calculator.
    Calculation(Ready),
    /// The same in a process of its own.
    Isolated(Isolated),
    /// An answer made of many.
    Composed(Composed),
    /// One shard of such an answer.
    Shard(OneShard),
}

impl Work {
    /// The work of a claimed job, read back from its record.
    pub(super) fn of(engine: &Inner, claim: &Claim) -> Result<Self, Error> {
        let entry = engine.known(&claim.calculator)?;
        if let Some(shard) = claim.shard {
            return Ok(Self::Shard(OneShard { shard, entry, apart: claim.attempt >= MOST_ATTEMPTS }));
        }
        if entry.is_composed() {
            return Ok(Self::Composed(Composed { entry, input: claim.input.clone(), key: claim.key }));
        }
        let ready = ready(&entry, &claim.input)?;
        Ok(match &engine.settings.isolation {
            Some(isolation) if claim.attempt >= MOST_ATTEMPTS => {
                Self::Isolated(Isolated { ready, isolation: isolation.clone() })
            }
            _ => Self::Calculation(ready),
        })
    }

    /// Runs it. `slot` is the right to a pool of jobs, to be held as long as cores are used. To be given up soon after
    /// [`Running::cancelled`]; its own progress is to be told by [`Running::follow`].
    pub(super) async fn run(self, engine: &Arc<Inner>, running: &Arc<Running>, slot: Slot) -> Result<Ending, Error> {
        let stored = match self {
            Self::Calculation(ready) => Inner::calculate(engine, ready, running, slot).await,
            Self::Isolated(isolated) => isolated.run(engine, running, slot).await,
            Self::Composed(composed) => composed.run(engine, running, slot).await,
            Self::Shard(shard) => return shard.run(engine, running, slot).await,
        };
        stored.map(|stored| Ending::Succeeded(stored.kept()))
    }
}

/// A kept job, ready to run.
pub(super) fn ready(entry: &Arc<Entry>, input: &[u8]) -> Result<Ready, Error> {
    let job: Value = serde_json::from_slice(input)
        .map_err(|error| Error::internal(format!("a kept job is not readable: {error}")))?;
    read::prepared(entry, &job)
}

/// The same as work, which it is where the job is large.
pub(super) async fn prepared(entry: &Arc<Entry>, input: Bytes, slot: &Slot) -> Result<Ready, Error> {
    let entry = Arc::clone(entry);
    slot.line().run(move |_| ready(&entry, &input)).await
}

/// An answer made of many: in shards, where that is worth it. A short job was let past the others, and its shards would wait
/// behind them; a job that an earlier version accepted has another key by now, by which nobody would know its shards.
pub(super) struct Composed {
    entry: Arc<Entry>,
    input: Bytes,
    key: Key,
}

impl Composed {
    async fn run(self, engine: &Arc<Inner>, running: &Running, slot: Slot) -> Result<Arc<Stored>, Error> {
        let ready = prepared(&self.entry, self.input, &slot).await?;
        let in_shards = !slot.is_short() && ready.key == self.key;
        match ready.prepared.sharded().filter(|_| in_shards) {
            Some(sharded) => shards::gathered(engine, (ready, sharded), running, slot).await,
            None => Inner::calculate(engine, ready, running, slot).await,
        }
    }
}

impl Inner {
    /// An ordinary cached calculation as a job: from the cache, from whoever computes it already, or computed on the
    /// pool of the job's `slot`, and then kept for whoever asks next.
    pub(crate) async fn calculate(
        engine: &Arc<Self>,
        ready: Ready,
        running: &Running,
        slot: Slot,
    ) -> Result<Arc<Stored>, Error> {
        let mut mine = Some((ready, slot));
        loop {
            let Some((ready, _)) = &mine else { return Err(Error::Crashed) };
            if running.is_cancelled() {
                return Err(Error::Cancelled);
            }
            if let Some(kept) = engine.look_up(&ready.key).await {
                return crate::engine::outcome(kept);
            }
            // A study whose points were there already says nothing of what points take.
            let teaches = !ready.entry.is_composed();
            let (id, version, cost_ms) = (ready.entry.meta().id, ready.entry.meta().version, ready.prepared.cost.ms);
            let Joined { waiter, leader } = engine.single_flight.join(ready.key);
            running.follow(waiter.progress());
            let is_mine = leader.is_some();
            if let Some(leader) = leader
                && let Some((ready, slot)) = mine.take()
            {
                Self::enqueue(engine, leader, ready, slot, Instant::now());
            }
            let ended = tokio::select! {
                ended = waiter.ended() => ended,
                // The waiter is dropped with the future, and the calculation ends when nobody else waits for it.
                () = running.cancelled() => return Err(Error::Cancelled),
            };
            match ended.outcome {
                // A direct answer found no core. A job has one: it computes what was not computed there.
                Err(Error::Busy { .. } | Error::ShuttingDown) if !is_mine => {}
                outcome => {
                    if is_mine && teaches && outcome.is_ok() {
                        engine.jobs.learn(id, version, cost_ms, ended.timings.run).await;
                    }
                    return outcome;
                }
            }
        }
    }
}
