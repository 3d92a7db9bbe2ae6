//! What jobs are called, by whom they are held, and the words of their states.

use std::fmt;
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};

use uuid::{ContextV7, Timestamp, Uuid};

use crate::key::Key;
use crate::store::now_ms;

/// This is not the name of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a job's id is a UUID in lower case with hyphens")]
pub struct BadJobId;

/// A job's name, in the order of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JobId(Uuid);

impl JobId {
    /// A new one, after all before.
    pub fn new() -> Self {
        Self::at(now_ms())
    }

    /// A new one at some time, ms UTC, after all before of that time.
    pub fn at(now_ms: i64) -> Self {
        /// Counts within a millisecond.
        static CONTEXT: Mutex<ContextV7> = Mutex::new(ContextV7::new());
        let now_ms = now_ms.max(0).unsigned_abs();
        let nanos = u32::try_from(now_ms % 1000).unwrap_or(0) * 1_000_000;
        let context = CONTEXT.lock().unwrap_or_else(PoisonError::into_inner);
        Self(Uuid::new_v7(Timestamp::from_unix(&*context, now_ms / 1000, nanos)))
    }
}

impl JobId {
    /// The name of a shard: in the order of its number, and before all other jobs of whatever time.
    fn of_shard(shard: &ShardId) -> Self {
        let mut bytes = [0; 16];
        bytes[1..12].copy_from_slice(&shard.parent.as_bytes()[..11]);
        bytes[12..].copy_from_slice(&shard.number.to_be_bytes());
        // Version 8, of the variant of all others.
        bytes[6] = 0x80 | (bytes[6] & 0x0f);
        bytes[8] = 0x80 | (bytes[8] & 0x3f);
        Self(Uuid::from_bytes(bytes))
    }

    /// Of a shard the name by which there is news of all shards of its parent.
    pub(crate) fn of_siblings(self) -> Option<Self> {
        let mut bytes = self.0.into_bytes();
        let is_shard = bytes[0] == 0 && bytes[6] >> 4 == 8;
        bytes[12..].fill(0xff);
        is_shard.then_some(Self(Uuid::from_bytes(bytes)))
    }
}

impl Default for JobId {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0.hyphenated(), f)
    }
}

impl FromStr for JobId {
    type Err = BadJobId;
    fn from_str(text: &str) -> Result<Self, BadJobId> {
        // As it is written here: braces, capitals and the form without hyphens would be other addresses of one job.
        let read = Uuid::try_parse(text).map(Self).map_err(|_| BadJobId)?;
        if read.to_string() == text { Ok(read) } else { Err(BadJobId) }
    }
}

/// The right to run a computation: whoever has lost it cannot write any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Lease(Uuid);

impl Lease {
    /// A new one.
    pub fn new() -> Self {
        Self(Uuid::now_v7())
    }
}

impl Default for Lease {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Display for Lease {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0.simple(), f)
    }
}

impl FromStr for Lease {
    type Err = uuid::Error;
    fn from_str(text: &str) -> Result<Self, uuid::Error> {
        Uuid::try_parse(text).map(Self)
    }
}

macro_rules! words {
    ($(#[$about:meta])* $name:ident { $($(#[$each:meta])* $variant:ident = $word:literal),+ $(,)? }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $name { $($(#[$each])* $variant),+ }

        impl $name {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// As it is written.
            pub const fn word(self) -> &'static str {
                match self { $(Self::$variant => $word),+ }
            }

            /// The one that is written so.
            pub fn of_word(word: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|known| known.word() == word)
            }
        }
    };
}

words! {
    /// How far a job is.
    JobState {
        /// It waits.
        Queued = "queued",
        /// It is computed.
        Running = "running",
        /// It has its result.
        Succeeded = "succeeded",
        /// It has none and says why.
        Failed = "failed",
        /// Nobody wants it any more.
        Cancelled = "cancelled",
    }
}

impl JobState {
    /// Whether nothing more will happen to it.
    pub const fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

words! {
    /// Which jobs go first.
    Priority {
        /// When nothing else waits.
        Low = "low",
        /// As all others.
        Normal = "normal",
        /// Before all others.
        High = "high",
    }
}

/// So many jobs of its priority that came later go before a job of that length, as a rule: the shorter goes first, and who
/// waits for long comes up, whatever else comes.
pub(crate) fn yields_to(estimate_ms: f64) -> i64 {
    /// The longest give way to no more than those of an hour.
    const LONGEST_S: f64 = 3600.0;
    #[allow(clippy::cast_possible_truncation)] // 0 to 11
    let doublings = (1.0 + (estimate_ms / 1e3).clamp(0.0, LONGEST_S)).log2() as i64;
    doublings
}

/// Which shard of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShardId {
    /// The key of the job.
    pub parent: Key,
    /// The number of the shard, from 0.
    pub number: u32,
}

impl ShardId {
    /// The name that it has as a job.
    pub(crate) fn job(&self) -> JobId {
        JobId::of_shard(self)
    }

    /// The key that it has as a job.
    pub(crate) fn key(&self) -> Key {
        Key::of_shard(&self.parent, self.number)
    }
}
