//! From the bytes of a job to the bytes of its answer. Knows calculators by name, nothing of HTTP.
//!
//! A job is answered at once ([`Engine::solve`]) or put on record and run behind ([`Engine::submit`], `jobs`). Both
//! ways share the cache, the calculations under way and the calculation itself.

mod alone;
mod answer;
mod asked;
pub(crate) mod budget;
mod cache;
mod compare;
mod cost;
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
pub use alone::{check_now, solve_now, studies_of};
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
use precut_calc::calculator::{Failure, Monitor};
use tokio::runtime::Handle;

use crate::registry::{Entry, Registry};
use crate::store::documents::DocumentStore;
use crate::store::jobs::JobStore;
use crate::store::processes::ProcessStore;
use crate::store::{ResultStore, Store};
use asked::Asked;
use budget::{Budget, Room, paid_beside};
use cache::{hit, outcome};
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
}

/// A body as JSON, whatever it is.
pub(crate) fn parsed(body: &[u8]) -> Result<serde_json::Value, Error> {
    json::parse(body)
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
