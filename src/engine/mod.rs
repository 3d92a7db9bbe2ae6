//! From the bytes of a job to the bytes of its answer. Knows calculators by name, nothing of HTTP.
//!
//! A job is answered at once ([`Engine::solve`]) or put on record and run behind ([`Engine::submit`], `jobs`). Both
//! ways share the cache, the calculations under way and the calculation itself.

mod answer;
mod asked;
pub(crate) mod budget;
mod compare;
mod csv_table;
mod envelope;
mod error;
mod exec;
mod generation;
mod headings;
pub(crate) mod jobs;
mod json;
pub(crate) mod library;
mod memory;
mod model;
mod models;
mod names;
mod process;
mod progress;
mod quota;
mod read;
mod settings;
mod single_flight;
mod study;
mod summary;
mod table;
#[cfg(test)]
mod tests;
mod text_file;
mod watch;

pub use crate::key::{BadKey, ENGINE_VERSION, Key};
pub use crate::store::OpenError;
pub use crate::store::callbacks::{Callback, CallbackState, DueCallback, NewCallback, Subject, TakeUp, Tried};
pub use crate::store::jobs::{JobId, JobQuery, JobRecord, JobState, Priority};
pub use answer::{Body, CacheState, Checked, FilePart, Solved, Stored, Timings};
pub use compare::{ModelComparison, Sides};
pub use error::{Error, SyntaxFault};
pub use jobs::{Answered, Ask, Feed, Isolation, Job};
pub(crate) use json::top_level_field;
pub use library::{
    FieldComparison, Form, ImportReport, Imported, RecordAnswer, RecordComparison, RecordError, RecordHead, RecordPage,
    RecordQuery, StoredRecord,
};
pub use model::ModelContent;
pub use models::{ModelAnswer, ModelError, ModelFile, ModelSource, Shelf, StoredModel};
pub use names::{Given, Library, NotGiven};
pub(crate) use process::in_language;
pub use process::{KeptProcess, NextAsked, NextPart, PartAnswer, PartOutcome, Precondition, ProcessError, WhichPath};
pub use progress::Interim;
pub use quota::{Share, Standing};
pub use settings::EngineSettings;
pub use study::STUDIES;
pub(crate) use summary::Summary;
pub(crate) use watch::replay;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

pub(crate) use precut_calc::calculator::Quiet;
use precut_calc::calculator::{Cost, Failure, Monitor};
use tokio::runtime::Handle;

use crate::registry::{Entry, Registry};
use crate::store::documents::DocumentStore;
use crate::store::jobs::JobStore;
use crate::store::processes::ProcessStore;
use crate::store::{Origin, ResultPage, ResultQuery, ResultStore, Store};
use asked::Asked;
use budget::{Budget, Room, paid_beside};
use exec::{Cores, Left, Slot, guarded};
use generation::Generation;
use jobs::Jobs;
use memory::{Kept, Known as Recognised, Memory, fingerprint_on};
use names::{Asks, Names, Remembered};
use quota::Unwritten;
use read::{Draft, Ready};
use single_flight::{Ended, Joined, Leader, SingleFlight};
use summary::Summaries;

/// Bodies up to this size are read where they arrive, larger ones on the pool: about 1 ms of reading.
const READ_AT_ONCE: usize = 32 << 10;
/// Jobs estimated up to this are computed where they arrive, larger ones on the pool: waking a thread of the pool and
/// being woken by it costs as much as such a job. They need no slot: they are answered while every core computes.
const COMPUTE_AT_ONCE_MS: f64 = 0.5;

/// The calculators behind their cache and their pool of cores. Cheap to clone.
#[derive(Clone)]
pub struct Engine {
    inner: Arc<Inner>,
}

pub(crate) struct Inner {
    registry: Registry,
    settings: EngineSettings,
    memory: Memory,
    single_flight: Arc<SingleFlight>,
    cores: Cores,
    store: Arc<dyn ResultStore>,
    documents: Arc<dyn DocumentStore>,
    processes: Arc<dyn ProcessStore>,
    live_processes: process::Processes,
    /// Counts changes of documents.
    generation: Arc<Generation>,
    /// Records and indices that were looked up lately.
    remembered: Remembered,
    jobs: Jobs,
    /// Parameter studies: asked like a calculator, made of the registry's.
    studies: Arc<Entry>,
    summaries: Summaries,
    /// Memory for bodies and what is made of them.
    bodies: Budget,
    asked: Asked,
    unwritten: Unwritten,
    closed: AtomicBool,
}

/// A job that was read.
enum Known {
    /// What it comes to is known.
    Kept(Kept, Duration),
    /// It is to be computed.
    New(Box<Ready>, Duration),
}

impl Engine {
    /// Opens the store in the settings' folder and starts the threads.
    pub async fn open(registry: Registry, settings: EngineSettings) -> Result<Self, OpenError> {
        let store = crate::store::open(&settings.store_settings()).await?;
        let (results, documents) = (Arc::<dyn Store>::clone(&store), Arc::<dyn Store>::clone(&store));
        let processes = Arc::<dyn Store>::clone(&store);
        Self::with_stores(registry, settings, (results, documents, processes), store).await
    }

    async fn with_stores(
        registry: Registry,
        settings: EngineSettings,
        (store, documents, processes): (Arc<dyn ResultStore>, Arc<dyn DocumentStore>, Arc<dyn ProcessStore>),
        jobs: Arc<dyn JobStore>,
    ) -> Result<Self, OpenError> {
        let cores = Cores::new(settings.cores, settings.job_slots, settings.patience)
            .map_err(|error| OpenError::Threads(error.to_string()))?;
        let memory = Memory::new(settings.memory_cache_bytes);
        let closed = AtomicBool::new(false);
        let single_flight = Arc::default();
        let jobs = Jobs::new(jobs);
        let host = Arc::new(study::InEngine::default());
        let studies = Arc::new(study::entry(&registry, settings.study_points, Arc::<study::InEngine>::clone(&host)));
        let (summaries, bodies) = (Summaries::default(), Budget::new(settings.bodies_bytes));
        let inner = Arc::new(Inner {
            registry,
            settings,
            memory,
            single_flight,
            cores,
            store,
            documents,
            processes,
            live_processes: process::Processes::default(),
            generation: Arc::default(),
            remembered: Remembered::default(),
            jobs,
            studies,
            summaries,
            bodies,
            asked: Asked::default(),
            unwritten: Unwritten::default(),
            closed,
        });
        host.move_in(&inner);
        Jobs::start(&inner).await;
        Ok(Self { inner })
    }

    /// The calculators.
    pub fn registry(&self) -> &Registry {
        &self.inner.registry
    }

    /// Memory for bodies and what is made of them.
    pub(crate) fn bodies(&self) -> &Budget {
        &self.inner.bodies
    }

    /// Parameter studies, which are asked like a calculator.
    pub fn studies(&self) -> &Arc<Entry> {
        &self.inner.studies
    }

    /// What is asked under a name: a calculator, or parameter studies.
    pub fn entry(&self, name: &str) -> Option<&Arc<Entry>> {
        self.inner.entry(name)
    }

    /// The answer to a job, from the cache or computed. Dropping the future cancels the calculation unless another
    /// request waits for the same one.
    pub async fn solve(&self, calculator: &str, body: Body) -> Result<Solved, Error> {
        match self.know(calculator, &body, &Shelf::default()).await? {
            Known::Kept(kept, parse) => hit(kept, parse),
            Known::New(ready, parse) => {
                self.inner.afford(ready.prepared.cost)?;
                self.solve_directly(*ready, parse).await
            }
        }
    }

    /// Reads a job, and what is known of it.
    async fn know(&self, calculator: &str, body: &Body, shelf: &Shelf) -> Result<Known, Error> {
        let inner = &self.inner;
        if inner.closed.load(Ordering::Relaxed) {
            return Err(Error::ShuttingDown);
        }
        let entry = inner.known(calculator)?;
        let begun = Instant::now();
        let fingerprint = fingerprint_on(entry.meta().id, body, shelf);
        if let Some(known) = inner.memory.recognise(&fingerprint)
            && inner.still_means(known.generation).await
            && let Some(kept) = inner.look_up(&known.key).await
        {
            return Ok(Known::Kept(kept, begun.elapsed()));
        }
        let generation = inner.generation.number();
        let ready = inner.read(&entry, body.clone(), shelf).await?;
        let generation = ready.names_any.then_some(generation);
        inner.memory.remember(fingerprint, Recognised { key: ready.key, generation });
        let parse = begun.elapsed();
        Ok(match inner.look_up(&ready.key).await {
            Some(kept) => Known::Kept(kept, parse),
            None => Known::New(Box::new(ready), parse),
        })
    }

    /// Computes the answer to a job while somebody waits for it.
    async fn solve_directly(&self, ready: Ready, parse: Duration) -> Result<Solved, Error> {
        let Joined { waiter, leader } = self.inner.single_flight.join(ready.key);
        if let Some(leader) = leader {
            self.begin(leader, ready);
        }
        let Ended { outcome, timings } = waiter.ended().await;
        Ok(Solved { stored: outcome?, cache: CacheState::Miss, timings: Timings { parse, ..timings } })
    }

    /// Sees to it that the calculation runs: here and now if it is short, else on the pool, when there is a slot.
    fn begin(&self, leader: Leader, ready: Ready) {
        let inner = &self.inner;
        let queued = Instant::now();
        let not_run =
            move |outcome| Ended { outcome, timings: Timings { queue: queued.elapsed(), ..Timings::default() } };
        if let Some(kept) = inner.memory.get(&ready.key) {
            // The calculation before this one ended between the look into the cache and joining.
            return leader.end(not_run(outcome(kept)));
        }
        if ready.prepared.cost.ms <= COMPUTE_AT_ONCE_MS && !ready.entry.is_composed() {
            return inner.run(leader, &ready, None, queued);
        }
        match inner.cores.slot_now() {
            Ok(Some(slot)) => Inner::enqueue(inner, leader, ready, slot, queued),
            Err(error) => leader.end(not_run(Err(error))),
            Ok(None) => {
                let inner = Arc::clone(inner);
                tokio::spawn(async move {
                    match inner.cores.slot().await {
                        Ok(slot) => Inner::enqueue(&inner, leader, ready, slot, queued),
                        Err(error) => leader.end(not_run(Err(error))),
                    }
                });
            }
        }
    }

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

    /// Whether it serves: the store answers and nobody has closed it.
    pub async fn ready(&self) -> Result<(), Error> {
        if self.inner.closed.load(Ordering::Relaxed) {
            return Err(Error::ShuttingDown);
        }
        Ok(self.inner.store.ping().await?)
    }

    /// From now on jobs are refused and [`Engine::ready`] fails; direct calculations under way go on, jobs go back in
    /// line.
    pub fn refuse_jobs(&self) {
        self.inner.closed.store(true, Ordering::Relaxed);
        self.inner.jobs.stop();
    }

    /// Takes no more jobs, lets running calculations end within the grace or cancels them, writes what waits to be
    /// written, closes the store.
    pub async fn close(&self, grace: Duration) {
        self.refuse_jobs();
        let inner = &self.inner;
        inner.jobs.close().await;
        if !inner.cores.drain(grace).await {
            inner.single_flight.cancel_all();
        }
        if let Err(error) = inner.unwritten.write(&*inner.jobs.store).await {
            tracing::warn!(%error, "the work of the last answers is not on record");
        }
        inner.store.close().await;
    }
}

impl Inner {
    fn entry(&self, name: &str) -> Option<&Arc<Entry>> {
        if name == STUDIES { Some(&self.studies) } else { self.registry.entry(name) }
    }

    /// What is asked under a name.
    fn known(&self, name: &str) -> Result<Arc<Entry>, Error> {
        self.entry(name).cloned().ok_or_else(|| Error::unknown(&self.registry, name))
    }

    /// For what is made of a body, which was charged as it came.
    fn room_for(&self, body: &Body) -> Room {
        let paid = match body {
            Body::Json(job) => paid_beside(job.len()),
            Body::Parts { job, files } => {
                paid_beside(job.len()) + files.iter().map(|file| paid_beside(file.bytes.len())).sum::<usize>()
            }
        };
        Room::of(&self.bodies, paid)
    }

    /// Reads a job where that does no harm.
    async fn read(self: &Arc<Self>, entry: &Arc<Entry>, body: Body, shelf: &Shelf) -> Result<Ready, Error> {
        let room = self.room_for(&body);
        if body.len() <= READ_AT_ONCE && !entry.is_composed() {
            let mut draft = guarded(|| Draft::of(entry, &body, (&self.registry, &room)))?;
            let found = self.find(shelf, &draft.asks(&self.registry, entry)).await?;
            return guarded(|| draft.read(entry, &body, &Names { registry: &self.registry, found, room }));
        }
        let slot = match self.cores.slot_now()? {
            Some(slot) => slot,
            None => self.cores.slot().await?,
        };
        let (this, entry, shelf, runtime) = (Arc::clone(self), Arc::clone(entry), shelf.clone(), Handle::current());
        let work = move |_: &Left<'_>| {
            let mut draft = Draft::of(&entry, &body, (&this.registry, &room))?;
            // Names stand anywhere in the job. A thread of the pool may wait for the store.
            let found = runtime.block_on(this.find(&shelf, &draft.asks(&this.registry, &entry)))?;
            draft.read(&entry, &body, &Names { registry: &this.registry, found, room })
        };
        slot.run(work).await
    }

    /// What is known of the names of a job.
    async fn find(&self, shelf: &Shelf, asks: &Asks) -> Result<names::Found, Error> {
        if asks.is_empty() { Ok(names::Found::default()) } else { self.finder(shelf).await?.all(asks).await }
    }

    /// What is kept under a key, in memory or in the store. A store that fails is as good as an empty one here.
    async fn look_up(&self, key: &Key) -> Option<Kept> {
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
    async fn fetch(&self, key: &Key) -> Result<Option<Arc<Stored>>, crate::store::StoreError> {
        let Some(kept) = self.store.get(*key).await? else { return Ok(None) };
        // A calculator that is no more has no results either.
        let Some(entry) = self.entry(&kept.calculator) else { return Ok(None) };
        let stored = Arc::new(Stored { key: *key, body: kept.body, input: kept.input, entry: Arc::clone(entry) });
        self.memory.keep(*key, Kept::Answer(Arc::clone(&stored)));
        Ok(Some(stored))
    }

    fn afford(&self, cost: Cost) -> Result<(), Error> {
        affordable(cost, self.settings.cost_limit, self.settings.cost_limit_bytes)
    }

    /// Whether an owner may ask for so much work in an hour at all.
    fn afford_at_all(&self, cost: &Cost, estimate_ms: f64) -> Result<(), Error> {
        let (most_ms, limit_bytes) = (self.settings.quota.work_ms, self.settings.cost_limit_bytes);
        match most_ms.filter(|most_ms| estimate_ms > *most_ms) {
            Some(most_ms) => Err(Error::TooExpensive {
                cost: Cost { ms: estimate_ms, ..*cost },
                limit: Duration::from_secs_f64(most_ms / 1e3),
                limit_bytes,
            }),
            None => Ok(()),
        }
    }

    /// Runs the calculation on the pool.
    fn enqueue(inner: &Arc<Self>, leader: Leader, ready: Ready, slot: Slot, queued: Instant) {
        let this = Arc::clone(inner);
        slot.line().push(move || this.run(leader, &ready, Some(slot), queued));
    }

    /// Runs the calculation, keeps its answer and tells it.
    fn run(&self, leader: Leader, ready: &Ready, slot: Option<Slot>, queued: Instant) {
        let (queue, begun) = (queued.elapsed(), Instant::now());
        let watch = leader.watch();
        let outcome = guarded(|| compute(ready, &watch));
        drop(slot);
        let run = begun.elapsed();
        let outcome = self.keep(ready, outcome, run);
        leader.end(Ended { outcome, timings: Timings { parse: Duration::ZERO, queue, run } });
    }

    /// Keeps what would come out again: answers, and failures that follow from the job alone.
    fn keep(&self, ready: &Ready, outcome: Result<Stored, Error>, run: Duration) -> Result<Arc<Stored>, Error> {
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

/// Whether a job may cost so much.
fn affordable(cost: Cost, limit: Duration, limit_bytes: u64) -> Result<(), Error> {
    // An estimate that is no number is not below the limit.
    let is_affordable = cost.ms <= limit.as_secs_f64() * 1e3 && cost.bytes <= limit_bytes;
    if is_affordable { Ok(()) } else { Err(Error::TooExpensive { cost, limit, limit_bytes }) }
}

fn outcome(kept: Kept) -> Result<Arc<Stored>, Error> {
    match kept {
        Kept::Answer(stored) => Ok(stored),
        Kept::Failure(failure) => Err(Error::Calculation(failure)),
    }
}

fn hit(kept: Kept, parse: Duration) -> Result<Solved, Error> {
    let timings = Timings { parse, ..Timings::default() };
    Ok(Solved { stored: outcome(kept)?, cache: CacheState::Hit, timings })
}

/// A body as JSON, whatever it is.
pub(crate) fn parsed(body: &[u8]) -> Result<serde_json::Value, Error> {
    json::parse(body)
}

/// What is asked under a name, without an engine.
fn entry(registry: &Registry, calculator: &str) -> Result<Arc<Entry>, Error> {
    if calculator == STUDIES {
        return Ok(studies_of(registry));
    }
    registry.entry(calculator).cloned().ok_or_else(|| Error::unknown(registry, calculator))
}

/// Parameter studies over the calculators of a registry, without an engine: nothing is kept.
pub fn studies_of(registry: &Registry) -> Arc<Entry> {
    Arc::new(study::entry(registry, study::MOST_POINTS, Arc::new(study::Alone)))
}

/// Runs a job and writes its answer.
fn compute(ready: &Ready, monitor: &dyn Monitor) -> Result<Stored, Error> {
    if monitor.cancelled() {
        return Err(Error::Cancelled);
    }
    match envelope::write(ready, monitor) {
        Ok(body) => Ok(Stored {
            key: ready.key,
            body: body.into(),
            input: ready.canonical.clone(),
            entry: Arc::clone(&ready.entry),
        }),
        Err(Failure::Cancelled) => Err(Error::Cancelled),
        Err(failure) => Err(Error::Calculation(failure)),
    }
}

/// Everything but the calculation, without an engine.
#[allow(clippy::needless_pass_by_value)] // a body is handed over, here as to an engine
pub fn check_now(registry: &Registry, calculator: &str, body: Body) -> Result<Checked, Error> {
    check_with(registry, calculator, body, &Given::default())
}

/// The same with what its names mean.
#[allow(clippy::needless_pass_by_value)]
pub fn check_with(registry: &Registry, calculator: &str, body: Body, given: &Given) -> Result<Checked, Error> {
    let entry = entry(registry, calculator)?;
    guarded(|| given.read(registry, &entry, &body)?.into_checked())
}

/// The answer to a job in this thread, without cache or store: for the command line. A job is refused for its cost as by a service
/// with the usual limits.
#[allow(clippy::needless_pass_by_value)]
pub fn solve_now(registry: &Registry, calculator: &str, body: Body, monitor: &dyn Monitor) -> Result<Stored, Error> {
    solve_with(registry, calculator, body, &Given::default(), monitor)
}

/// The same with what its names mean.
#[allow(clippy::needless_pass_by_value)]
pub fn solve_with(
    registry: &Registry,
    calculator: &str,
    body: Body,
    given: &Given,
    monitor: &dyn Monitor,
) -> Result<Stored, Error> {
    let entry = entry(registry, calculator)?;
    guarded(|| {
        let ready = given.read(registry, &entry, &body)?;
        affordable(ready.prepared.cost, settings::COST_LIMIT, settings::COST_LIMIT_BYTES)?;
        compute(&ready, monitor)
    })
}
