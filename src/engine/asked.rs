//! Who asked for which answer, as far as it was written lately: the same need not be written again.

use std::collections::HashSet;
use std::hash::{BuildHasher, RandomState};
use std::sync::{Mutex, PoisonError};

use super::Key;

/// So many are remembered; what is forgotten is written again.
const MOST: usize = 65_536;

/// Pairs of owners and answers.
#[derive(Default)]
pub(super) struct Asked {
    hasher: RandomState,
    written: Mutex<HashSet<u64>>,
}

impl Asked {
    pub(super) fn is_new(&self, key: &Key, owner: &str) -> bool {
        let pair = self.hasher.hash_one((key, owner));
        !self.written.lock().unwrap_or_else(PoisonError::into_inner).contains(&pair)
    }

    pub(super) fn add(&self, key: &Key, owner: &str) {
        let pair = self.hasher.hash_one((key, owner));
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        if written.len() >= MOST {
            written.clear();
        }
        written.insert(pair);
    }
}
