//! Why a job has no answer.

use std::time::Duration;

use precut_calc::calculator::{Cost, Failure, Finding};

use crate::registry::Registry;
use crate::store::StoreError;
use crate::store::jobs::{JobId, JobState};

/// Why a job has no answer. Knows no status codes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// The bytes are no acceptable JSON: a client's fault (400).
    #[error("{0}")]
    Syntax(SyntaxFault),
    /// The job breaks rules: all of them, sorted by pointer, at most [`Error::MOST_FAULTS`] listed.
    #[error("{total} faults in the job")]
    Invalid {
        /// The first of them.
        findings: Vec<Finding>,
        /// How many there are.
        total: usize,
    },
    /// No calculator has that name.
    #[error("no calculator is called {name:?}")]
    UnknownCalculator {
        /// The name asked for.
        name: String,
        /// The one most like it.
        nearest: Option<&'static str>,
    },
    /// The job's estimate is above the limit.
    #[error("estimated {} ms, allowed {} ms", .cost.ms, .limit.as_millis())]
    TooExpensive {
        /// The estimate, with the field that drives it.
        cost: Cost,
        /// Most time allowed.
        limit: Duration,
        /// Most memory allowed.
        limit_bytes: u64,
    },
    /// Every core is taken and the line is full.
    #[error("all calculation slots are taken")]
    Busy {
        /// When to come again.
        retry_after: Duration,
    },
    /// Too many jobs wait.
    #[error("{queued} jobs wait")]
    QueueFull {
        /// How many.
        queued: u64,
        /// When to come again.
        retry_after: Duration,
    },
    /// Its owner has spent the work of an hour.
    #[error("estimated {estimate_s} s, {left_s} s are left of the hour's {quota_s} s")]
    WorkQuota {
        /// What the job is estimated at, s.
        estimate_s: f64,
        /// What is left, s.
        left_s: f64,
        /// All of it, s.
        quota_s: f64,
        /// When there is so much, if nothing else is asked.
        retry_after: Duration,
    },
    /// As much is kept for its owner as may be.
    #[error("{kept_bytes} bytes are kept, allowed {quota_bytes} bytes")]
    KeptQuota {
        /// What is kept.
        kept_bytes: u64,
        /// What may be.
        quota_bytes: u64,
        /// When there is room again, ms UTC.
        room_ms: i64,
        /// The same from now, for who just asks.
        retry_after: Option<Duration>,
    },
    /// Something else was asked under the same idempotency key.
    #[error("the idempotency key belongs to job {0}, which asked something else")]
    IdempotencyKeyReused(JobId),
    /// No job has that name.
    #[error("there is no job {0}")]
    UnknownJob(JobId),
    /// The job has not come to its end yet.
    #[error("the job is {}", .state.word())]
    JobNotFinished {
        /// How far it is.
        state: JobState,
        /// When to come again.
        retry_after: Duration,
    },
    /// The job was cancelled.
    #[error("the job was cancelled")]
    JobCancelled,
    /// The job's result is kept no longer.
    #[error("the job's result is kept no longer")]
    JobExpired,
    /// The job was not done before its deadline.
    #[error("the deadline passed")]
    DeadlineExceeded,
    /// The job took its process along at every attempt.
    #[error("the process ended at each of {attempts} attempts")]
    CrashedRepeatedly {
        /// How many attempts.
        attempts: u32,
    },
    /// The physics has no answer.
    #[error(transparent)]
    Calculation(Failure),
    /// The store did not serve.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Nobody waited for it any more.
    #[error("cancelled")]
    Cancelled,
    /// The calculation panicked; the log has the reason.
    #[error("the calculation crashed")]
    Crashed,
    /// The service stops.
    #[error("the service is shutting down")]
    ShuttingDown,
}

impl Error {
    /// So many faults are listed at most.
    pub const MOST_FAULTS: usize = 100;

    /// Our own fault.
    pub(crate) fn internal(cause: String) -> Self {
        Self::Calculation(Failure::Internal(cause))
    }

    /// No calculator has that name.
    pub fn unknown(registry: &Registry, name: &str) -> Self {
        Self::UnknownCalculator { name: name.to_owned(), nearest: registry.nearest(name) }
    }
}

/// Where and why bytes are no acceptable JSON.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{code} at line {line}, column {column}")]
pub struct SyntaxFault {
    /// `bad_syntax`, `duplicate_key`, `trailing_bytes`, `nested_too_deeply`, `number_out_of_range`, `number_too_long`, `integer_too_large`,
    /// `unexpected_end`, `empty_body`.
    pub code: &'static str,
    /// JSON Pointer to the value in which reading stopped.
    pub pointer: String,
    /// From 1.
    pub line: usize,
    /// From 1; 0 at the very end of a line.
    pub column: usize,
    /// What the parser says, without the place.
    pub message: String,
}
