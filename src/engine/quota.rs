//! What owners may take of the service: told, kept to, and work that is no job counted.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::{Engine, Error, Inner};
use crate::store::StoreError;
use crate::store::jobs::{JobStore, Quota, Usage};
use crate::store::quota::Beyond;

/// An owner's part of a quota.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share {
    /// All of it.
    pub quota: f64,
    /// What is left of it.
    pub left: f64,
    /// When some of what is taken comes back; none where nothing is.
    pub more_in: Option<Duration>,
}

/// How an owner stands with the quotas that there are.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Standing {
    /// Of work within an hour, s.
    pub work_s: Option<Share>,
    /// Of what is kept, bytes.
    pub kept_bytes: Option<Share>,
}

/// Who an owner is in the metrics: keys are few, addresses are not told apart.
pub(crate) fn label(owner: &str) -> String {
    owner.strip_prefix("key:").unwrap_or("(no key)").to_owned()
}

/// Counts work that was done for an owner.
pub(crate) fn worked(owner: &str, ms: f64) {
    // A counter counts whole numbers.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below 2^53, and positive
    metrics::counter!("precut_owner_work_milliseconds_total", "owner" => label(owner))
        .increment(ms.max(0.0).ceil() as u64);
}

/// Work of answers that are no jobs, until it is on record.
#[derive(Default)]
pub(crate) struct Unwritten {
    ms_by_owner: Mutex<HashMap<String, f64>>,
    /// Held by who puts it there: nothing is written twice.
    writing: tokio::sync::Mutex<()>,
}

impl Unwritten {
    fn add(&self, owner: &str, ms: f64) {
        let mut all = self.lock();
        *all.entry(owner.to_owned()).or_default() += ms;
    }

    fn of(&self, owner: &str) -> f64 {
        self.lock().get(owner).copied().unwrap_or(0.0)
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, f64>> {
        self.ms_by_owner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts it on record. It counts here until it is.
    pub(crate) async fn write(&self, store: &dyn JobStore) -> Result<(), StoreError> {
        let _alone = self.writing.lock().await;
        let work: Vec<(String, f64)> = self.lock().iter().map(|(owner, ms)| (owner.clone(), *ms)).collect();
        if work.is_empty() {
            return Ok(());
        }
        store.note_work(work.clone()).await?;
        let mut all = self.lock();
        for (owner, written) in work {
            if let Some(ms) = all.get_mut(&owner) {
                *ms -= written;
            }
        }
        all.retain(|_, ms| *ms > 0.0);
        Ok(())
    }
}

impl Inner {
    /// What an owner takes, work that is not on record yet among it.
    async fn usage(&self, owner: &str) -> Result<Usage, Error> {
        let usage = self.jobs.store.usage(owner.to_owned()).await?;
        Ok(Usage { open_ms: usage.open_ms + self.unwritten.of(owner), ..usage })
    }

    /// Charges an owner with an answer that is no job, if he has so much work left.
    pub(super) async fn charge(&self, owner: &str, work_ms: f64) -> Result<(), Error> {
        let quota = Quota { kept_bytes: None, ..self.settings.quota };
        if !quota.is_none() {
            let usage = self.usage(owner).await?;
            self.refused(&usage, &quota, work_ms).map_or(Ok(()), Err)?;
            self.unwritten.add(owner, work_ms);
        }
        worked(owner, work_ms);
        Ok(())
    }

    /// Whether a job that was taken may begin: not where as much is kept for its owner by now as may be.
    pub(super) async fn may_begin(&self, owner: &str) -> Result<(), Error> {
        let quota = Quota { work_ms: None, ..self.settings.quota };
        if quota.is_none() {
            return Ok(());
        }
        self.refused(&self.usage(owner).await?, &quota, 0.0).map_or(Ok(()), Err)
    }

    /// Why somebody who takes so much of the service gets no more of it; none where he does.
    pub(super) fn refused(&self, usage: &Usage, quota: &Quota, work_ms: f64) -> Option<Error> {
        Some(match usage.beyond(quota, work_ms)? {
            Beyond::Work { most_ms } => Error::WorkQuota {
                estimate_s: work_ms / 1e3,
                left_s: (most_ms - usage.work_ms()).max(0.0) / 1e3,
                quota_s: most_ms / 1e3,
                retry_after: usage.room_for_work(most_ms, work_ms),
            },
            Beyond::Kept { most_bytes } => self.full(usage, most_bytes, most_bytes),
        })
    }

    /// Why a model of so many bytes is not kept for its owner.
    pub(super) fn no_room(&self, usage: &Usage, bytes: u64) -> Error {
        let most_bytes = self.settings.quota.kept_bytes.unwrap_or(u64::MAX);
        // There is room for it once no more than the rest is kept.
        self.full(usage, most_bytes, most_bytes.saturating_sub(bytes).saturating_add(1))
    }

    /// There is room again once less than so much is kept.
    fn full(&self, usage: &Usage, quota_bytes: u64, below_bytes: u64) -> Error {
        let wait = usage.room_to_keep(below_bytes, self.settings.job_age);
        let wait_ms = i64::try_from(wait.as_millis()).unwrap_or(i64::MAX);
        Error::KeptQuota {
            kept_bytes: usage.kept_bytes(),
            quota_bytes,
            room_ms: self.jobs.store.now_ms().saturating_add(wait_ms),
            retry_after: Some(wait),
        }
    }
}

impl Engine {
    /// How an owner stands with the quotas; none where there are none.
    pub async fn standing(&self, owner: &str) -> Result<Option<Standing>, Error> {
        let quota = self.inner.settings.quota;
        if quota.is_none() {
            return Ok(None);
        }
        let usage = self.inner.usage(owner).await?;
        let after = |ms: i64| Duration::from_millis(ms.max(0).unsigned_abs());
        let work_s = quota.work_ms.map(|most_ms| Share {
            quota: most_ms / 1e3,
            left: (most_ms - usage.work_ms()).max(0.0) / 1e3,
            more_in: usage.done.iter().map(|(goes, _)| *goes).min().map(after),
        });
        #[allow(clippy::cast_precision_loss)] // bytes of a disk, below 2^53
        let kept_bytes = quota.kept_bytes.map(|most| Share {
            quota: most as f64,
            left: most.saturating_sub(usage.kept_bytes()) as f64,
            more_in: usage.kept.iter().filter_map(|(goes, _)| *goes).min().map(after),
        });
        Ok(Some(Standing { work_s, kept_bytes }))
    }
}
