//! The memory tier: answers by key, and keys by the bytes that asked for them.

use std::sync::Arc;

use precut_calc::calculator::Failure;
use quick_cache::Weighter;
use quick_cache::sync::Cache;

use super::{Body, Shelf, Stored};
use crate::key::Key;

/// What a job of some key comes to: always the same.
#[derive(Debug, Clone)]
pub(crate) enum Kept {
    Answer(Arc<Stored>),
    Failure(Failure),
}

#[derive(Debug, Clone)]
struct Bytes;

impl Weighter<Key, Kept> for Bytes {
    fn weight(&self, _key: &Key, kept: &Kept) -> u64 {
        /// Key, handles and the cache's own bookkeeping, about.
        const ENTRY: u64 = 256;
        match kept {
            Kept::Answer(stored) => ENTRY + stored.body.len() as u64 + stored.input.len() as u64,
            Kept::Failure(_) => 2 * ENTRY,
        }
    }
}

/// What a body meant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known {
    pub(crate) key: Key,
    /// Where it names what may be revised: since which change that was so.
    pub(crate) generation: Option<u64>,
}

/// So many bodies are recognised without being read; 80 bytes each.
const RECOGNISED: usize = 16_384;

/// The memory tier.
pub(crate) struct Memory {
    kept: Cache<Key, Kept, Bytes>,
    recognised: Cache<[u8; 32], Known>,
}

impl Memory {
    pub(crate) fn new(bytes: u64) -> Self {
        /// What an answer weighs, about: for the cache's first table only.
        const TYPICAL: u64 = 16 << 10;
        let items = usize::try_from(bytes / TYPICAL).unwrap_or(usize::MAX).clamp(16, 1 << 16);
        Self { kept: Cache::with_weighter(items, bytes, Bytes), recognised: Cache::new(RECOGNISED) }
    }

    pub(crate) fn get(&self, key: &Key) -> Option<Kept> {
        self.kept.get(key)
    }
    pub(crate) fn keep(&self, key: Key, kept: Kept) {
        self.kept.insert(key, kept);
    }
    /// What a body that was read before meant, by its fingerprint.
    pub(crate) fn recognise(&self, fingerprint: &[u8; 32]) -> Option<Known> {
        self.recognised.get(fingerprint)
    }
    pub(crate) fn remember(&self, fingerprint: [u8; 32], known: Known) {
        self.recognised.insert(fingerprint, known);
    }
}

/// Hash of a body as it came, for one calculator, from whoever has these names: equal bytes mean an equal job, as long as no
/// name comes to mean something else.
pub(crate) fn fingerprint_on(calculator: &str, body: &Body, shelf: &Shelf) -> [u8; 32] {
    fingerprint_with(calculator, body, Some(&shelf.prefix()))
}

/// The same of a request that says something beside its body: who is told of its end.
pub(crate) fn fingerprint_with(calculator: &str, body: &Body, told: Option<&str>) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    let mut part = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes()).update(bytes);
    };
    part(calculator.as_bytes());
    match body {
        Body::Json(job) => part(job),
        Body::Parts { job, files } => {
            part(job);
            for file in files {
                part(file.name.as_bytes());
                part(&file.bytes);
            }
        }
    }
    if let Some(told) = told {
        part(told.as_bytes());
    }
    *hasher.finalize().as_bytes()
}
