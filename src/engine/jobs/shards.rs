//! Jobs in shards: a large study is one job, and what it takes is done by many.
//!
//! Who runs such a job makes its plan, puts its shards in line as jobs of their own, a window of them at a time, and gives its
//! place back. Then it holds none: it waits for news, takes up what the shards came to, and puts all of it together. A shard is
//! claimed, kept alive, taken up again and guarded against poison as any job, by whichever process has a place for it. What
//! is done of them is on record, so that a job whose process has died goes on from there.

use std::collections::{BTreeSet, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use precut_calc::calculator::{Message, Monitor};
use tokio::sync::OnceCell;
use tokio::task::spawn_blocking;

use super::running::Running;
use super::work::prepared;
use super::worker::stubbornly;
use super::{MOST_ATTEMPTS, fault};
use crate::engine::exec::{Left, Slot, guarded};
use crate::engine::progress::Progress;
use crate::engine::read::Ready;
use crate::engine::{Error, Inner, Stored, compute, outcome};
use crate::key::Key;
use crate::registry::{Entry, Sharded, Unfinished};
use crate::store::jobs::{Ending, Shard, ShardId};

/// So many shards of a job are in line or computed at a time; more than there are places.
const WINDOW: usize = 256;
/// How often there is a look at shards that are over where nobody tells of any, and whether one has the job's turn.
const LOOK: Duration = Duration::from_secs(1);
/// So long after a look there is no other, however many shards end.
const REST: Duration = Duration::from_millis(100);
/// After so many shards that came to nothing readable it is not the disk that is to blame.
const MOST_DAMAGED: u32 = 100;
/// Plans that are kept.
const PLANS: usize = 4;

type Plan = Arc<OnceCell<Arc<dyn Sharded>>>;

/// Plans of jobs whose shards were computed here lately, by key.
#[derive(Default)]
pub(crate) struct Plans(Mutex<VecDeque<(Key, Plan)>>);

impl Plans {
    /// Where the plan of a job is, or is to be put.
    fn of(&self, key: &Key) -> Plan {
        let mut plans = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = plans.iter().position(|(known, _)| known == key).and_then(|place| plans.remove(place));
        let (key, plan) = known.unwrap_or_else(|| (*key, Plan::default()));
        plans.push_back((key, Arc::clone(&plan)));
        if plans.len() > PLANS {
            plans.pop_front();
        }
        plan
    }

    fn forget(&self, key: &Key) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).retain(|(known, _)| known != key);
    }
}

/// The answer of a job in shards. The place is held until the first of them are in line.
pub(super) async fn gathered(
    engine: &Arc<Inner>,
    (ready, sharded): (Ready, Arc<dyn Sharded>),
    running: &Running,
    slot: Slot,
) -> Result<Arc<Stored>, Error> {
    if let Some(kept) = engine.look_up(&ready.key).await {
        return outcome(kept);
    }
    let begun = Instant::now();
    let key = ready.key;
    // Shards that this process computes need not read the plan again.
    let _ = engine.jobs.plans.of(&key).set(Arc::clone(&sharded));
    let answer = async {
        let progress = running.progress();
        Gathering::new(engine, key, sharded, &progress).run(running, slot).await?;
        let this = Arc::clone(engine);
        let together = move || {
            let answer = guarded(|| compute(&ready, &*progress));
            this.keep(&ready, answer, begun.elapsed())
        };
        spawn_blocking(together).await.unwrap_or(Err(Error::Crashed))
    };
    let answer = answer.await;
    engine.jobs.plans.forget(&key);
    answer
}

/// A job whose shards are computed.
struct Gathering<'e> {
    engine: &'e Arc<Inner>,
    key: Key,
    sharded: Arc<dyn Sharded>,
    progress: &'e Arc<Progress>,
    /// Shards that were not taken up yet.
    missing: BTreeSet<u32>,
    /// Those of them that are in line or computed.
    open: BTreeSet<u32>,
    looked: Instant,
    damaged: u32,
}

impl<'e> Gathering<'e> {
    fn new(engine: &'e Arc<Inner>, key: Key, sharded: Arc<dyn Sharded>, progress: &'e Arc<Progress>) -> Self {
        let missing: BTreeSet<u32> = (0..u32::try_from(sharded.count()).unwrap_or(u32::MAX)).collect();
        // What is on record from before.
        let open = missing.clone();
        Self { engine, key, sharded, progress, missing, open, looked: Instant::now(), damaged: 0 }
    }

    async fn run(mut self, running: &Running, slot: Slot) -> Result<(), Error> {
        let mut slot = Some(slot);
        // Before the first look: news that come in between are not lost.
        let mut feed = self.engine.jobs.feed(ShardId { parent: self.key, number: u32::MAX }.job());
        self.collect().await?;
        self.open.clear();
        self.sharded.tell(&**self.progress);
        while !self.missing.is_empty() {
            self.fill(running).await?;
            drop(slot.take());
            running.give_place_back();
            let news = async {
                tokio::time::sleep(REST).await;
                let _ = tokio::time::timeout(LOOK, feed.changed()).await;
            };
            tokio::select! {
                () = news => {}
                () = running.cancelled() => return Err(Error::Cancelled),
            }
            self.collect().await?;
        }
        Ok(())
    }

    /// Puts further shards in line where there is room.
    async fn fill(&mut self, running: &Running) -> Result<(), Error> {
        let room = if self.open.len() <= WINDOW / 2 { WINDOW - self.open.len() } else { 0 };
        let next: Vec<u32> = self.missing.difference(&self.open).copied().take(room).collect();
        if next.is_empty() && self.looked.elapsed() < LOOK {
            return Ok(());
        }
        let jobs = &self.engine.jobs;
        let add = || jobs.store.add_shards(running.lease(), next.clone());
        if !stubbornly(self.engine, add).await.ok_or(Error::ShuttingDown)? {
            return Err(Error::Cancelled);
        }
        if !next.is_empty() {
            jobs.call();
        }
        self.open.extend(next);
        self.looked = Instant::now();
        Ok(())
    }

    /// Takes up what is over of those that are open.
    async fn collect(&mut self) -> Result<(), Error> {
        let open: Vec<u32> = self.open.iter().copied().collect();
        for some in open.chunks(WINDOW) {
            let over = || self.engine.jobs.store.shards(self.key, some.to_vec());
            let over = stubbornly(self.engine, over).await.ok_or(Error::ShuttingDown)?;
            if !over.is_empty() {
                self.take_up(over).await?;
            }
        }
        Ok(())
    }

    async fn take_up(&mut self, over: Vec<Shard>) -> Result<(), Error> {
        let (sharded, progress) = (Arc::clone(&self.sharded), Arc::clone(self.progress));
        let take_up = move || {
            let taken = over.into_iter().map(|Shard { number, outcome }| match outcome {
                Ok(content) => Ok((number, sharded.take_up(number as usize, &content))),
                Err(problem) => Err(fault::read(&problem)),
            });
            let taken: Result<Vec<(u32, bool)>, Error> = taken.collect();
            sharded.tell(&*progress);
            taken
        };
        for (number, is_taken) in spawn_blocking(take_up).await.unwrap_or(Err(Error::Crashed))? {
            self.open.remove(&number);
            if is_taken {
                self.missing.remove(&number);
                continue;
            }
            tracing::warn!(study = %self.key, shard = number, "a shard on record is damaged; it is computed again");
            self.damaged += 1;
            if self.damaged > MOST_DAMAGED {
                return Err(Error::internal("what the shards of a job come to cannot be read".to_owned()));
            }
        }
        Ok(())
    }
}

/// One shard of a job.
pub(super) struct OneShard {
    /// Which.
    pub(super) shard: ShardId,
    /// Of what the job is.
    pub(super) entry: Arc<Entry>,
    /// It may be what ended its processes: what may do that is computed in one of its own.
    pub(super) apart: bool,
}

impl OneShard {
    pub(super) async fn run(self, engine: &Arc<Inner>, running: &Arc<Running>, slot: Slot) -> Result<Ending, Error> {
        let Self { shard, entry, apart } = self;
        metrics::counter!("precut_jobs_shards_total").increment(1);
        let plan = engine.jobs.plans.of(&shard.parent);
        let sharded = plan.get_or_try_init(|| planned(engine, &entry, shard.parent, &slot)).await?;
        let (sharded, running) = (Arc::clone(sharded), Arc::clone(running));
        let computed = move |left: &Left<'_>| {
            let wanted = Wanted { running: &running, left };
            sharded.compute(shard.number as usize, &wanted, apart).map_err(unfinished)
        };
        slot.run(computed).await.map(|content| Ending::Shard(content.into()))
    }
}

/// The plan of a job that runs.
async fn planned(engine: &Arc<Inner>, entry: &Arc<Entry>, parent: Key, slot: &Slot) -> Result<Arc<dyn Sharded>, Error> {
    let input = stubbornly(engine, || engine.jobs.store.input_of(parent)).await.ok_or(Error::ShuttingDown)?;
    // It waits for its parent to run again.
    let input = input.ok_or(Error::Cancelled)?;
    let ready = prepared(entry, input, slot).await?;
    let sharded = ready.prepared.sharded().filter(|_| ready.key == parent);
    sharded.ok_or_else(|| Error::internal("a shard of another version's job".to_owned()))
}

fn unfinished(unfinished: Unfinished) -> Error {
    match unfinished {
        Unfinished::Cancelled => Error::Cancelled,
        Unfinished::Deadly => Error::CrashedRepeatedly { attempts: MOST_ATTEMPTS },
        Unfinished::Failed(failure) => Error::Calculation(failure),
    }
}

/// Whether a shard is wanted: by its job, and by who has begun it here.
struct Wanted<'r> {
    running: &'r Running,
    left: &'r Left<'r>,
}

impl Monitor for Wanted<'_> {
    fn cancelled(&self) -> bool {
        self.running.is_cancelled() || (self.left)()
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}
