//! Jobs: calculations that outlive their request and their process.
//!
//! A job is a record in the [`JobStore`]: who asked what, how far it is, how it ended. The records that wait are the queue.
//! They are the truth; what is in memory here (progress between two writes, who waits for news, which computations
//! this process runs) may be lost at any moment without harm.
//!
//! # Life of a job
//!
//! 1. [`Engine::submit`](crate::engine::Engine::submit) writes the record: after it has answered, the job survives whatever
//!    happens. A job equal to one that is being computed joins it at once.
//! 2. Where a place is free, [`worker`] takes the first in line with all equal ones that wait under one **lease**, and
//!    charges them a start, in one transaction. Every later write names the lease and finds no record once it is lost: a
//!    computation that was given to somebody else cannot write any more.
//!    While long jobs have taken all places, short ones have one more ([`short`]).
//! 3. It runs on the jobs' own pool. How far it is stands in memory and is written once a second.
//! 4. Its end, with its result, is written in one transaction for all jobs that still hold the lease. A cancel or a
//!    deadline takes one job off the lease; when the last has gone, the computation is told to stop.
//!
//! What a dead process left running is in line again when the next one opens the store; where several share a store,
//! when nobody has heard of the computation for some seconds. Who runs a job and who is asked about it may be two
//! processes: [`JobStore::tell`] brings news from one to the other, and every request reads the record.
//!
//! Each start is charged, and a charge says nothing of who ended the process. At the last of [`MOST_ATTEMPTS`] a job runs
//! alone and in a process of its own ([`isolated`]): one that ends even that is failed as `crashed_repeatedly`, and one whose
//! service is killed meanwhile is taken up again, however often. A start that a shutdown interrupts is not charged. A panic
//! is no such start: it is caught, and the job fails at once, as it would panic again.
//!
//! A large study is one job whose [`shards`] are jobs of their own in the same line, which nobody sees. The study holds no
//! place while others compute them. It runs in the service's own process at its last attempt, too, and that attempt is not
//! charged while it gets on in it (a shard ends, which is not computed again): however often its process is killed, it is
//! finished. A shard that may have ended its processes runs alone, with each of its points in a process of its own; if one of
//! these ends that, the study fails with the shard.
//!
//! Everything here but [`work`] knows a job only as a [`NewJob`]: calculator, key, input as bytes. [`work::Work::of`]
//! makes work of that again.

mod estimate;
mod fault;
mod feeds;
mod isolated;
mod requests;
mod running;
mod shards;
mod short;
mod sweeper;
pub(crate) mod work;
mod worker;

pub(crate) use fault::{finding_of, message, message_of, note};
pub use feeds::Feed;
pub use isolated::Isolation;
pub(crate) use isolated::compute_apart;
pub use requests::Answered;

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use precut_calc::calculator::Message;
use tokio::sync::{Notify, watch};
use tokio::task::JoinHandle;

use super::progress::Reported;
use super::quota::label;
use super::{Error, Inner, Key, Shelf, Stored};
use crate::store::jobs::{
    Accepted, Changed, Idempotency, JobId, JobPage, JobQuery, JobRecord, JobState, JobStore, MOST_ATTEMPTS,
    NewCallback, NewJob, News, Priority, Timing,
};
use estimate::Estimates;
use feeds::Feeds;
use running::Computations;

/// When a client that found the queue full should come again.
const RETRY_QUEUE: Duration = Duration::from_secs(5);
/// Bounds of the advice when to look at a job again.
const RETRY_JOB: (Duration, Duration) = (Duration::from_secs(1), Duration::from_mins(1));
/// Timings read at the start.
const TIMINGS: u32 = 5000;

/// Who asks for a job, and how.
#[derive(Debug, Clone)]
pub struct Ask {
    /// Whose job it is: clients take turns.
    pub owner: String,
    /// Where the model is that the job names.
    pub shelf: Shelf,
    /// How soon.
    pub priority: Priority,
    /// After so long it is of no use any more.
    pub deadline: Option<Duration>,
    /// The client's own name for the request.
    pub idempotency_key: Option<String>,
    /// Wait at most so long for the result of a job; `None`: as the service thinks best.
    pub wait: Option<Duration>,
    /// Who is told when it is over.
    pub callback: Option<NewCallback>,
    /// Where the request belongs in a trace.
    pub traceparent: Option<String>,
    /// What the systems on the trace's way say of it.
    pub tracestate: Option<String>,
}

impl Ask {
    /// A request without wishes.
    pub fn plain(owner: impl Into<String>) -> Self {
        Self {
            owner: owner.into(),
            shelf: Shelf::default(),
            priority: Priority::Normal,
            deadline: None,
            idempotency_key: None,
            wait: None,
            callback: None,
            traceparent: None,
            tracestate: None,
        }
    }
}

/// A job to be accepted.
pub(crate) struct Request {
    /// By which calculator.
    pub(crate) calculator: &'static str,
    /// Which version of it.
    pub(crate) version: u32,
    /// Address of its result.
    pub(crate) key: Key,
    /// All that [`work::Work::of`] needs.
    pub(crate) input: Bytes,
    /// Estimated work, ms.
    pub(crate) estimate_ms: f64,
    /// Hash of the request as it came, for [`Ask::idempotency_key`].
    pub(crate) body_hash: [u8; 32],
    /// Its result, where it is there already.
    pub(crate) result: Option<Arc<Stored>>,
}

/// A job as it is now.
#[derive(Debug, Clone)]
pub struct Job {
    /// Its record.
    pub record: JobRecord,
    /// How far it is, 0 to 1.
    pub progress: f64,
    /// What it is doing.
    pub stage: Option<Message>,
    /// The picture so far.
    pub interim: Option<super::Interim>,
    /// Time left, ms, as far as that can be said.
    pub remaining_ms: Option<f64>,
    /// Why it failed.
    pub problem: Option<Error>,
}

/// The jobs of an engine.
pub(crate) struct Jobs {
    pub(crate) store: Arc<dyn JobStore>,
    pub(crate) estimates: Estimates,
    feeds: Arc<Feeds>,
    computations: Arc<Computations>,
    plans: shards::Plans,
    new_deadline: Notify,
    /// There is something to do.
    came: watch::Sender<()>,
    /// A job ended here: somebody may have to be told.
    ended: Notify,
    stop: watch::Sender<bool>,
    tasks: Mutex<Vec<JoinHandle<()>>>,
}

impl Jobs {
    pub(crate) fn new(store: Arc<dyn JobStore>) -> Self {
        Self {
            store,
            estimates: Estimates::default(),
            feeds: Arc::default(),
            computations: Arc::default(),
            plans: shards::Plans::default(),
            new_deadline: Notify::new(),
            came: watch::channel(()).0,
            ended: Notify::new(),
            stop: watch::channel(false).0,
            tasks: Mutex::default(),
        }
    }

    /// Begins to work.
    pub(crate) async fn start(engine: &Arc<Inner>) {
        let jobs = &engine.jobs;
        match jobs.store.timings(TIMINGS).await {
            Ok(timings) => timings.iter().rev().for_each(|timing| jobs.estimates.learn(timing)),
            Err(error) => tracing::warn!(%error, "earlier timings cannot be read"),
        }
        let mut tasks = vec![tokio::spawn(sweeper::run(Arc::downgrade(engine)))];
        if engine.settings.role.works() {
            tasks.push(tokio::spawn(worker::run(Arc::downgrade(engine))));
            if !engine.settings.short_limit.is_zero() {
                tasks.push(tokio::spawn(short::run(Arc::downgrade(engine))));
            }
        }
        let (feeds, computations) = (Arc::clone(&jobs.feeds), Arc::clone(&jobs.computations));
        let (generation, came) = (Arc::clone(&engine.generation), jobs.came.clone());
        jobs.store.tell(Arc::new(move |news| match news {
            News::Waiting => came.send_replace(()),
            News::Changed(Changed { jobs, unwanted }) => {
                computations.give_up(&unwanted);
                feeds.touch(&jobs);
            }
            News::Library => generation.changed(),
            // Computations that are not wanted any more are told so by the next word of their progress.
            News::Missed => {
                generation.changed();
                feeds.touch_all();
                came.send_replace(());
            }
        }));
        jobs.tasks.lock().unwrap_or_else(PoisonError::into_inner).extend(tasks);
    }

    /// Takes up no more jobs and puts those that run back in line.
    pub(crate) fn stop(&self) {
        self.stop.send_replace(true);
    }

    /// Waits until that is done.
    pub(crate) async fn close(&self) {
        self.stop();
        let tasks = std::mem::take(&mut *self.tasks.lock().unwrap_or_else(PoisonError::into_inner));
        for task in tasks {
            let _ = task.await;
        }
    }

    /// Tells whoever has a place that there is something to do.
    fn call(&self) {
        self.came.send_replace(());
    }

    /// Told from now on that there is something to do.
    fn came(&self) -> watch::Receiver<()> {
        self.came.subscribe()
    }

    fn is_stopped(&self) -> bool {
        *self.stop.borrow()
    }

    /// Waits until [`Jobs::stop`].
    pub(crate) async fn stopped(&self) {
        // The sender lives as long as this does.
        let _ = self.stop.subscribe().wait_for(|stop| *stop).await;
    }

    /// What a calculation took corrects what the next ones are estimated at.
    async fn learn(&self, calculator: &str, version: u32, predicted_ms: f64, took: Duration) {
        let actual_ms = took.as_secs_f64() * 1e3;
        let timing = Timing { calculator: calculator.to_owned(), version, predicted_ms, actual_ms };
        self.estimates.learn(&timing);
        if let Err(error) = self.store.note_timing(timing).await {
            tracing::debug!(%error, "a timing is not kept");
        }
    }

    /// Puts a job on record; whether it is a new one.
    pub(crate) async fn accept(&self, engine: &Inner, request: Request, ask: &Ask) -> Result<(JobRecord, bool), Error> {
        let idempotency = ask.idempotency_key.clone().map(|key| Idempotency { key, body_hash: request.body_hash });
        let useful_for_ms = ask.deadline.map(|after| i64::try_from(after.as_millis()).unwrap_or(i64::MAX));
        let job = NewJob {
            id: JobId::at(self.store.now_ms()),
            calculator: request.calculator.to_owned(),
            version: request.version,
            key: request.key,
            input: request.input,
            priority: ask.priority,
            owner: ask.owner.clone(),
            idempotency,
            estimate_ms: request.estimate_ms,
            useful_for_ms,
            quota: engine.settings.quota,
            result: request.result.map(|stored| stored.kept()),
            callback: ask.callback.clone(),
            traceparent: ask.traceparent.clone(),
            tracestate: ask.tracestate.clone(),
        };
        let work_ms = if job.result.is_some() { 0.0 } else { job.estimate_ms };
        match self.store.submit(job, engine.settings.queue_limit).await? {
            Accepted::New(record) => {
                metrics::counter!("precut_jobs_accepted_total", "calculator" => request.calculator).increment(1);
                metrics::counter!("precut_owner_jobs_total", "owner" => label(&ask.owner)).increment(1);
                if useful_for_ms.is_some() {
                    self.new_deadline.notify_one();
                }
                self.call();
                if record.state.is_final() {
                    self.ended.notify_one();
                }
                Ok((record, true))
            }
            Accepted::Known(record) => Ok((record, false)),
            Accepted::OtherBody(id) => Err(Error::IdempotencyKeyReused(id)),
            Accepted::OverQuota(usage) => {
                let refused = engine.refused(&usage, &engine.settings.quota, work_ms);
                Err(refused.unwrap_or_else(|| Error::internal("a job was refused for no reason".to_owned())))
            }
            Accepted::QueueFull { queued } => {
                metrics::counter!("precut_queue_full_total").increment(1);
                Err(Error::QueueFull { queued, retry_after: RETRY_QUEUE })
            }
        }
    }

    /// The job as it is now.
    pub(crate) async fn job(&self, id: JobId) -> Result<Job, Error> {
        let record = self.store.job(id).await?.ok_or(Error::UnknownJob(id))?;
        Ok(self.now(record))
    }

    /// The jobs, newest first; where the next page begins.
    pub(crate) async fn list(&self, query: JobQuery) -> Result<(Vec<Job>, Option<JobId>), Error> {
        let JobPage { items, next } = self.store.jobs(query).await?;
        Ok((items.into_iter().map(|record| self.now(record)).collect(), next))
    }

    /// Ends a job; with its state before.
    pub(crate) async fn cancel(&self, id: JobId) -> Result<(Job, JobState), Error> {
        let cancelled = self.store.cancel(id).await?.ok_or(Error::UnknownJob(id))?;
        if let Some(lease) = cancelled.unwanted {
            self.computations.give_up(&[lease]);
        }
        if !cancelled.before.is_final() {
            self.feeds.touch(&[id]);
            self.ended.notify_one();
        }
        Ok((self.now(cancelled.job), cancelled.before))
    }

    /// News of a job.
    pub(crate) fn feed(&self, id: JobId) -> Feed {
        self.feeds.subscribe(id)
    }

    /// Waits until a job is over, at most so long and not beyond the end of the service; the job then.
    pub(crate) async fn wait(&self, record: JobRecord, most: Duration) -> Result<Job, Error> {
        if most.is_zero() || record.state.is_final() {
            return Ok(self.now(record));
        }
        let id = record.id;
        let mut feed = self.feed(id);
        let over = async {
            loop {
                let job = self.job(id).await?;
                if job.record.state.is_final() {
                    return Ok(job);
                }
                feed.changed().await;
            }
        };
        tokio::select! {
            job = over => return job,
            () = tokio::time::sleep(most) => {}
            () = self.stopped() => {}
        }
        self.job(id).await
    }

    /// A record together with what is known in memory.
    pub(crate) fn now(&self, record: JobRecord) -> Job {
        let live = record.lease.and_then(|lease| self.computations.reported(lease));
        let Reported { fraction, stage, interim } = live.unwrap_or_else(|| Reported {
            fraction: record.progress,
            stage: record.stage.as_deref().and_then(fault::read_stage),
            interim: None,
        });
        let is_running = record.state == JobState::Running;
        let progress = if record.state == JobState::Succeeded { 1.0 } else { fraction };
        Job {
            progress,
            stage: stage.filter(|_| is_running),
            interim: interim.filter(|_| is_running),
            remaining_ms: remaining_ms(&record, progress, self.store.now_ms()),
            problem: record.problem.as_deref().map(fault::read),
            record,
        }
    }
}

/// Time left of a running job, ms: from what it has done so far, or from its estimate where it has done too little.
fn remaining_ms(record: &JobRecord, progress: f64, now_ms: i64) -> Option<f64> {
    /// Below this share the speed so far says little.
    const ENOUGH: f64 = 0.02;
    let started = record.started_ms.filter(|_| record.state == JobState::Running)?;
    #[allow(clippy::cast_precision_loss)] // times of jobs, far below 2^53 ms
    let elapsed = (now_ms - started).max(0) as f64;
    let left = if progress >= ENOUGH { elapsed * (1.0 - progress) / progress } else { record.estimate_ms - elapsed };
    Some(left.max(0.0))
}

impl Job {
    /// When it is worth looking at it again.
    pub fn retry_after(&self) -> Duration {
        let left = self.remaining_ms.unwrap_or(self.record.estimate_ms);
        let left = Duration::try_from_secs_f64(left / 1e3).unwrap_or(RETRY_JOB.1);
        left.clamp(RETRY_JOB.0, RETRY_JOB.1)
    }

    /// Whether its result is kept no longer, by the store's clock: processes may disagree by minutes.
    pub fn is_expired(&self, now_ms: i64) -> bool {
        self.record.expires_ms.is_some_and(|at| at <= now_ms)
    }
}
