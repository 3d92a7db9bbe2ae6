//! Who is told that a job is over, or what is said of a process, and what came of it.
//!
//! A callback is a row beside its job or beside an entry of a process. The end of the job, however it comes about, makes it due
//! in the same transaction; that of an entry is due as soon as the entry is there.
//! Who tries it holds it for a time, as a computation is held under a lease: who dies meanwhile loses it, and it is tried
//! again. So it is delivered at least once.

use super::jobs::{JobId, Lease};

/// What is told.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// That a job is over.
    Job(JobId),
    /// An entry of the record of a process.
    Entry {
        /// Name of the process.
        process: String,
        /// Number of the entry.
        sequence: i64,
    },
}

impl Subject {
    /// As a store keeps it.
    pub(super) fn read(
        job: Option<JobId>,
        process: Option<String>,
        sequence: Option<i64>,
    ) -> Result<Self, sqlx::Error> {
        match (job, process, sequence) {
            (Some(job), None, None) => Ok(Self::Job(job)),
            (None, Some(process), Some(sequence)) => Ok(Self::Entry { process, sequence }),
            _ => Err(sqlx::Error::Decode("a callback is of a job or of an entry".into())),
        }
    }
}

/// Whom to tell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewCallback {
    /// Where.
    pub url: String,
    /// Host and port of it.
    pub host: String,
}

/// What has become of a callback.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Callback {
    /// Where.
    pub url: String,
    /// How far it is.
    pub state: CallbackState,
    /// Tries begun.
    pub attempts: u32,
    /// When it is tried next, ms UTC.
    pub next_ms: Option<i64>,
    /// Why the last try came to nothing: a code.
    pub fault: Option<String>,
    /// When it was delivered or given up, ms UTC.
    pub settled_ms: Option<i64>,
}

/// How far a callback is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CallbackState {
    /// Its job is not over.
    Waiting,
    /// It is to be told.
    Pending,
    /// Somebody has taken it.
    Delivered,
    /// Nobody has, however often it was tried.
    GivenUp,
}

impl CallbackState {
    /// From what is kept.
    pub(super) fn of_word(word: &str) -> Option<Self> {
        match word {
            "waiting" => Some(Self::Waiting),
            "pending" => Some(Self::Pending),
            "delivered" => Some(Self::Delivered),
            "given_up" => Some(Self::GivenUp),
            _ => None,
        }
    }
}

/// How callbacks are taken up.
#[derive(Debug, Clone)]
pub struct TakeUp {
    /// At most so many.
    pub most: u32,
    /// At most so many of one host.
    pub most_of_one: u32,
    /// None of these hosts.
    pub not_of: Vec<String>,
    /// Who takes them up is taken for dead after so long, ms.
    pub hold_ms: i64,
}

/// A callback that is to be tried now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DueCallback {
    /// Its number.
    pub id: i64,
    /// What is told.
    pub subject: Subject,
    /// Where.
    pub url: String,
    /// Host and port of it.
    pub host: String,
    /// The right to try it.
    pub lease: Lease,
    /// Which try this is, from 1.
    pub attempt: u32,
}

/// What came of a try.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Tried {
    /// It was taken.
    Delivered,
    /// It is to be tried again.
    Again {
        /// After so long, ms.
        after_ms: i64,
        /// Why it came to nothing: a code.
        fault: String,
    },
    /// It was the last try.
    GivenUp {
        /// Why it came to nothing: a code.
        fault: String,
    },
}

impl Tried {
    /// State, time until the next try and fault, as they are written.
    pub(super) fn written(&self) -> (&'static str, Option<i64>, Option<&str>) {
        match self {
            Self::Delivered => ("delivered", None, None),
            Self::Again { after_ms, fault } => ("pending", Some(*after_ms), Some(fault)),
            Self::GivenUp { fault } => ("given_up", None, Some(fault)),
        }
    }
}
