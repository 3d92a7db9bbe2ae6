//! A job with what it takes to run it, as it stands in line.

use bytes::Bytes;

use super::jobs::{count, unreadable};
use crate::key::Key;
use crate::store::jobs::{Claim, JobId, Lease, ShardId};
use crate::store::sql::Outcome;

/// The input of a job as it is kept. A damaged one is nothing that can be run: who claims it finds that out and says so on
/// the record.
pub(in crate::store) fn unpacked(input: &[u8]) -> Bytes {
    zstd::decode_all(input).unwrap_or_default().into()
}

/// A job with what it takes to run it.
pub(in crate::store) struct Runnable {
    pub(in crate::store) id: String,
    pub(in crate::store) key: Vec<u8>,
    pub(in crate::store) state: String,
    pub(in crate::store) calculator: String,
    pub(in crate::store) attempt: u32,
    /// None where another one has the same.
    input: Option<Vec<u8>>,
    pub(in crate::store) priority: i32,
    pub(in crate::store) turn: i64,
    owner: String,
    created_ms: i64,
    traceparent: Option<String>,
    tracestate: Option<String>,
    parent: Option<Vec<u8>>,
    shard: Option<i32>,
}

from_row!(Runnable {
    id, key, state, calculator, attempt as i32, input, priority, turn, owner, created_ms, traceparent, tracestate,
    parent, shard
});

impl Runnable {
    pub(in crate::store) const fn is_shard(&self) -> bool {
        self.shard.is_some()
    }

    fn shard(&self) -> Outcome<Option<ShardId>> {
        let Some((parent, number)) = self.parent.as_ref().zip(self.shard) else { return Ok(None) };
        let parent = Key::from_bytes(parent).ok_or_else(|| unreadable("parent"))?;
        Ok(Some(ShardId { parent, number: count(number) }))
    }

    pub(in crate::store) fn claim(self, lease: Lease, jobs: Vec<JobId>) -> Outcome<Box<Claim>> {
        Ok(Box::new(Claim {
            lease,
            jobs,
            key: Key::from_bytes(&self.key).ok_or_else(|| unreadable("key"))?,
            shard: self.shard()?,
            calculator: self.calculator,
            input: unpacked(&self.input.unwrap_or_default()),
            attempt: self.attempt,
            owner: self.owner,
            created_ms: self.created_ms,
            traceparent: self.traceparent,
            tracestate: self.tracestate,
        }))
    }
}
