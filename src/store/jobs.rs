//! Jobs as they are kept: what was asked, how far it is, how it ended.
//!
//! The records are the queue: those that wait, in the order of priority and turn. Who takes one holds it under a lease.

mod names;

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use futures_util::future::BoxFuture;

pub use super::callbacks::{Callback, CallbackState, DueCallback, NewCallback, Subject, TakeUp, Tried};
pub use super::quota::{Quota, Usage};
use super::{KeptResult, StoreError};
use crate::key::Key;
pub(crate) use names::yields_to;
pub use names::{BadJobId, JobId, JobState, Lease, Priority, ShardId};

/// Starts after which a job that takes its process along is given up.
pub(crate) const MOST_ATTEMPTS: u32 = 3;
/// A computation that says nothing for so long has lost its lease, and so has who waits to run a job alone.
pub(crate) const SILENCE: Duration = Duration::from_secs(4);

/// A shard that is over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shard {
    /// Its number.
    pub number: u32,
    /// What it came to (nothing where that is damaged), or why it failed, as JSON.
    pub outcome: Result<Bytes, String>,
}

/// A job to be accepted.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// Its name.
    pub id: JobId,
    /// By which calculator.
    pub calculator: String,
    /// Which version of it.
    pub version: u32,
    /// Address of its result.
    pub key: Key,
    /// All that is needed to run it.
    pub input: Bytes,
    /// How soon.
    pub priority: Priority,
    /// Who asks.
    pub owner: String,
    /// The client's own name for the request.
    pub idempotency: Option<Idempotency>,
    /// Estimated work, ms.
    pub estimate_ms: f64,
    /// For how long after it is accepted it is of use, ms. Its deadline is set where it is accepted, by the same reading
    /// of the same clock: whoever asks may have another.
    pub useful_for_ms: Option<i64>,
    /// What its owner may take.
    pub quota: Quota,
    /// Its result, where it is there already.
    pub result: Option<KeptResult>,
    /// Who is told when it is over.
    pub callback: Option<NewCallback>,
    /// Where the request belongs in a trace (W3C Trace Context).
    pub traceparent: Option<String>,
    /// What the systems on the trace's way say of it.
    pub tracestate: Option<String>,
}

/// A client's own name for a request, with the hash of what it asked.
#[derive(Debug, Clone)]
pub struct Idempotency {
    /// The name.
    pub key: String,
    /// The hash.
    pub body_hash: [u8; 32],
}

/// A job's record, without its input.
#[derive(Debug, Clone, PartialEq)]
pub struct JobRecord {
    /// Its name.
    pub id: JobId,
    /// By which calculator.
    pub calculator: String,
    /// Address of its result.
    pub key: Key,
    /// How far it is.
    pub state: JobState,
    /// What it was doing when that was last written, as JSON.
    pub stage: Option<String>,
    /// How far it was then, 0 to 1.
    pub progress: f64,
    /// Starts charged.
    pub attempt: u32,
    /// Who runs it.
    pub lease: Option<Lease>,
    /// How soon.
    pub priority: Priority,
    /// Why it failed, as JSON.
    pub problem: Option<String>,
    /// Estimated work, ms.
    pub estimate_ms: f64,
    /// Times, ms UTC.
    pub created_ms: i64,
    /// When it was started last.
    pub started_ms: Option<i64>,
    /// When it ended.
    pub finished_ms: Option<i64>,
    /// When it is of no use any more.
    pub deadline_ms: Option<i64>,
    /// When its result may go.
    pub expires_ms: Option<i64>,
    /// Whose it is.
    pub owner: String,
    /// Where the request belongs in a trace.
    pub traceparent: Option<String>,
    /// What the systems on the trace's way say of it.
    pub tracestate: Option<String>,
    /// Who is told when it is over.
    pub callback: Option<Callback>,
}

/// What came of a new job.
#[derive(Debug, Clone, PartialEq)]
pub enum Accepted {
    /// It is on record.
    New(JobRecord),
    /// The client asked the same before, by the same name.
    Known(JobRecord),
    /// The client asked something else by the same name.
    OtherBody(JobId),
    /// Too many wait.
    QueueFull {
        /// How many.
        queued: u64,
    },
    /// Its owner takes as much as he may.
    OverQuota(Usage),
}

/// A computation to run.
#[derive(Debug, Clone)]
pub struct Claim {
    /// The right to.
    pub lease: Lease,
    /// All jobs that it serves.
    pub jobs: Vec<JobId>,
    /// Their key.
    pub key: Key,
    /// Which shard it is, if it is one: then there is no input but that of its parent.
    pub shard: Option<ShardId>,
    /// By which calculator.
    pub calculator: String,
    /// All that is needed.
    pub input: Bytes,
    /// Starts charged, this one among them.
    pub attempt: u32,
    /// Whose the job is that was next in line.
    pub owner: String,
    /// When that was accepted, ms UTC.
    pub created_ms: i64,
    /// Where its request belongs in a trace.
    pub traceparent: Option<String>,
    /// What the systems on the trace's way say of it.
    pub tracestate: Option<String>,
}

/// Who asks for the next job.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// Under which lease it is to run.
    pub lease: Lease,
    /// Only one that was not charged a start yet, of at most so long, estimated.
    pub short_ms: Option<f64>,
    /// The same was asked before, and the answer did not arrive.
    pub again: bool,
}

/// What is to be done next.
#[derive(Debug, Clone)]
pub enum Next {
    /// Run this.
    Run(Box<Claim>),
    /// This is to be claimed as the only one that runs: it may be to blame for the end of its processes. Nobody else is
    /// told of it while it is held.
    Suspect {
        /// The job.
        id: JobId,
        /// By which calculator.
        calculator: String,
        /// Whether it is a shard.
        is_shard: bool,
    },
    /// Nothing.
    Nothing,
}

/// What came of a claim.
#[derive(Debug, Clone)]
pub enum Claimed {
    /// Run this.
    Run(Box<Claim>),
    /// It has taken its last process with it: these jobs failed.
    Poisonous(Vec<JobId>),
    /// Nothing waits there.
    Nothing,
}

/// How a computation ended.
#[derive(Debug, Clone)]
pub enum Ending {
    /// With a result.
    Succeeded(KeptResult),
    /// A shard, with what it came to.
    Shard(Bytes),
    /// Without; why, as JSON.
    Failed(String),
}

/// Jobs that changed, and computations that nobody wants any more.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Changed {
    /// The jobs.
    pub jobs: Vec<JobId>,
    /// The computations.
    pub unwanted: Vec<Lease>,
}

/// What came of a cancel.
#[derive(Debug, Clone, PartialEq)]
pub struct Cancelled {
    /// The job now.
    pub job: JobRecord,
    /// Its state before.
    pub before: JobState,
    /// The computation that nobody wants any more.
    pub unwanted: Option<Lease>,
}

/// How far a computation is.
#[derive(Debug, Clone, PartialEq)]
pub struct Beat {
    /// Which.
    pub lease: Lease,
    /// How far, 0 to 1.
    pub progress: f64,
    /// What it is doing, as JSON.
    pub stage: Option<String>,
}

/// What a list of jobs asks for.
#[derive(Debug, Clone, Default)]
pub struct JobQuery {
    /// Only those in this state.
    pub state: Option<JobState>,
    /// Only those of this calculator.
    pub calculator: Option<String>,
    /// Only those of this owner.
    pub owner: Option<String>,
    /// Only those that come to this result.
    pub key: Option<Key>,
    /// At most so many.
    pub limit: u32,
    /// Only those before this one.
    pub before: Option<JobId>,
}

/// A page of the list, newest first.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JobPage {
    /// The jobs.
    pub items: Vec<JobRecord>,
    /// Where the next page begins, if there is one.
    pub next: Option<JobId>,
}

/// How the jobs and their store are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct JobCounts {
    /// Waiting.
    pub queued: u64,
    /// Being computed.
    pub running: u64,
    /// Callbacks that are to be delivered.
    pub callbacks: u64,
    /// When the one came that has waited longest, ms UTC.
    pub oldest_ms: Option<i64>,
    /// What the database takes of the disk.
    pub store_bytes: u64,
}

/// What a job took.
#[derive(Debug, Clone, PartialEq)]
pub struct Timing {
    /// By which calculator.
    pub calculator: String,
    /// Which version.
    pub version: u32,
    /// What was estimated, ms.
    pub predicted_ms: f64,
    /// What it took, ms.
    pub actual_ms: f64,
}

/// Tells which computations this process runs, at the moment of asking.
pub type Live = Arc<dyn Fn() -> Vec<Lease> + Send + Sync>;

/// What happened in another process.
#[derive(Debug, Clone, PartialEq)]
pub enum News {
    /// There is something to do.
    Waiting,
    /// These jobs changed, and nobody wants these computations any more.
    Changed(Changed),
    /// Documents changed.
    Library,
    /// Something was said that could not be heard: anything may have changed.
    Missed,
}

/// Who hears of news.
pub type Hear = Arc<dyn Fn(News) + Send + Sync>;

/// What becomes of jobs once they are there: the same in every store.
pub trait JobShelf: Send + Sync + 'static {
    /// A job's record.
    fn job(&self, id: JobId) -> BoxFuture<'_, Result<Option<JobRecord>, StoreError>>;
    /// The jobs, newest first.
    fn jobs(&self, query: JobQuery) -> BoxFuture<'_, Result<JobPage, StoreError>>;
    /// What jobs need to run, compressed, as far as it takes no more than so many bytes; those that have none any more
    /// are left out.
    fn job_inputs(&self, ids: Vec<JobId>, most: usize) -> BoxFuture<'_, Result<Vec<(JobId, Bytes)>, StoreError>>;
    /// Of these shards those that are over.
    fn shards(&self, parent: Key, numbers: Vec<u32>) -> BoxFuture<'_, Result<Vec<Shard>, StoreError>>;
    /// What is needed to run the job of a key that runs.
    fn input_of(&self, key: Key) -> BoxFuture<'_, Result<Option<Bytes>, StoreError>>;
    /// What an owner takes of the service.
    fn usage(&self, owner: String) -> BoxFuture<'_, Result<Usage, StoreError>>;
    /// What is kept of jobs and their results for each owner of keys, bytes.
    fn kept_by_owner(&self) -> BoxFuture<'_, Result<Vec<(String, u64)>, StoreError>>;
    /// Notes the work of answers that were no jobs: whose it was, and how much, ms.
    fn note_work(&self, work: Vec<(String, f64)>) -> BoxFuture<'_, Result<(), StoreError>>;
    /// Writes what came of a try; whether it was still who tried that holds it.
    fn settle_callback(&self, due: DueCallback, tried: Tried) -> BoxFuture<'_, Result<bool, StoreError>>;
    /// The latest timings, newest first, at most `limit`.
    fn timings(&self, limit: u32) -> BoxFuture<'_, Result<Vec<Timing>, StoreError>>;
    /// Keeps a suspect from others for `SILENCE`.
    fn hold(&self, id: JobId) -> BoxFuture<'_, Result<(), StoreError>>;
    /// Takes this job and all equal ones that wait under a lease, and charges them one start; fails them, with
    /// `problem`, if they have been charged `most` already.
    fn claim(&self, id: JobId, lease: Lease, most: u32, problem: String) -> BoxFuture<'_, Result<Claimed, StoreError>>;
    /// Puts shards of what runs under a lease in line, also such as are over; those that wait or run stay as they are. One
    /// of them has the parent's turn, the others go behind all jobs of its priority. Whether the lease holds.
    fn add_shards(&self, lease: Lease, numbers: Vec<u32>) -> BoxFuture<'_, Result<bool, StoreError>>;
    /// Puts a computation back in line without a charge.
    fn release(&self, lease: Lease) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>>;
    /// Fails an owner's jobs of a computation that has not begun, with `problem`, and puts the others back in line, without
    /// a charge; which have failed.
    fn refuse(&self, lease: Lease, owner: String, problem: String) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>>;
    /// Ends one job without a result.
    fn cancel(&self, id: JobId) -> BoxFuture<'_, Result<Option<Cancelled>, StoreError>>;
    /// Puts a job whose result is damaged back in line.
    fn redo(&self, id: JobId) -> BoxFuture<'_, Result<(), StoreError>>;
}

/// Where jobs are kept and queued. What it has said yes to survives the process.
pub trait JobStore: JobShelf {
    /// Puts a job on record and in line, both or neither; refused with more than `queue_limit` waiting.
    fn submit(&self, job: NewJob, queue_limit: u64) -> BoxFuture<'_, Result<Accepted, StoreError>>;
    /// How many wait and run, since when, and how large the database is.
    fn counts(&self) -> BoxFuture<'_, Result<JobCounts, StoreError>>;
    /// Whether there is something to do, for [`Wanted::short_ms`].
    fn waits(&self, short_ms: Option<f64>) -> BoxFuture<'_, Result<bool, StoreError>>;
    /// Takes the next job in line and all equal ones that wait under a lease, and charges them one start. A shard is taken
    /// only while its parent runs.
    fn take(&self, wanted: Wanted) -> BoxFuture<'_, Result<Next, StoreError>>;
    /// Ends a computation and all jobs that still want it; which these are. A shard ends only once the results of its points
    /// are written, and is forgotten with the end of its parent.
    fn finish(&self, lease: Lease, ending: Ending) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>>;
    /// Notes how far computations are; which of them nobody wants any more.
    fn beat(&self, beats: Vec<Beat>) -> BoxFuture<'_, Result<Vec<Lease>, StoreError>>;
    /// Fails, with `problem`, what is past its deadline; and when the next deadline is, ms UTC.
    fn expire_deadlines(&self, problem: String) -> BoxFuture<'_, Result<(Changed, Option<i64>), StoreError>>;
    /// Puts back in line what nobody runs (`live` tells the computations of this process, those about to be claimed
    /// among them).
    fn sweep(&self, live: Live) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>>;
    /// Takes up callbacks that are due.
    fn take_up_callbacks(&self, wanted: TakeUp) -> BoxFuture<'_, Result<Vec<DueCallback>, StoreError>>;
    /// Forgets jobs whose time is over.
    fn forget_expired(&self) -> BoxFuture<'_, Result<u64, StoreError>>;
    /// Notes what a job took.
    fn note_timing(&self, timing: Timing) -> BoxFuture<'_, Result<(), StoreError>>;

    /// Whether other processes work with the same jobs.
    fn is_shared(&self) -> bool {
        false
    }
    /// The time by which jobs live, ms UTC: the same for all processes.
    fn now_ms(&self) -> i64 {
        super::now_ms()
    }
    /// From now on tells what happens in other processes.
    fn tell(&self, _hear: Hear) {}
}
