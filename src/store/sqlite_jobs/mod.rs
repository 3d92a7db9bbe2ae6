//! Jobs in the SQLite file. The functions below work inside a transaction of the ledger.

mod callbacks;
mod care;
pub(super) mod pack;
mod run;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use futures_util::future::BoxFuture;

use super::common::line::{Terms, submit};
use super::common::run::finish;
use super::common::usage::forget_work;
use super::jobs::{
    Accepted, Beat, Changed, DueCallback, Ending, JobCounts, JobId, JobStore, Lease, Live, NewJob, Next, TakeUp,
    Timing, Wanted,
};
use super::sqlite::SqliteStore;
use super::{StoreError, now_ms};
use crate::key::Key;
pub(super) use care::recover;
use care::{expire_deadlines, forget_expired, note_timing, sweep};
use pack::{PackedEnding, packed, packed_ending};
use run::{beat, take, waits};

/// How long a shard of a study waits for the results of its points.
const POINTS_PATIENCE: Duration = Duration::from_secs(5);

impl SqliteStore {
    async fn finish_job(&self, lease: Lease, ending: Ending) -> Result<Vec<JobId>, StoreError> {
        let keep_ms = self.keep_ms;
        // What is done is not computed again: without this its points would have no answers.
        if matches!(ending, Ending::Shard(_)) && !self.writer.flush(POINTS_PATIENCE).await {
            return Err(StoreError::Failed("the results of a shard's points are not written yet".to_owned()));
        }
        let ending = Arc::new(packed_ending(ending).await?);
        let written = Arc::clone(&ending);
        let jobs = self
            .ledger
            .write(move |connection| {
                let ending = Arc::clone(&ending);
                Box::pin(async move { finish(connection, lease, &ending, keep_ms).await })
            })
            .await?;
        if let PackedEnding::Succeeded(row) = &*written
            && !jobs.is_empty()
        {
            self.kept(&row.key, row.bytes());
        }
        Ok(jobs)
    }

    async fn submit_job(&self, job: NewJob, queue_limit: u64) -> Result<Accepted, StoreError> {
        let keep_ms = self.keep_ms;
        let packed = Arc::new(packed(job).await?);
        let written = Arc::clone(&packed);
        let accepted = self
            .ledger
            .write(move |connection| {
                let packed = Arc::clone(&packed);
                let terms = Terms { queue_limit, now: now_ms(), keep_ms, engine: None };
                Box::pin(async move { submit(connection, &packed, terms).await })
            })
            .await?;
        if let (Accepted::New(_), Some(row)) = (&accepted, &written.result) {
            self.kept(&row.key, row.bytes());
        }
        Ok(accepted)
    }

    async fn count_jobs(&self) -> Result<JobCounts, StoreError> {
        let (queued, running, callbacks, oldest_ms, store_bytes): (i64, i64, i64, Option<i64>, i64) = sqlx::query_as(
            "SELECT (SELECT count(*) FROM jobs WHERE state = 'queued' AND parent IS NULL),
                 (SELECT count(*) FROM jobs WHERE state = 'running' AND parent IS NULL),
                 (SELECT count(*) FROM callbacks INDEXED BY callbacks_due WHERE state = 'pending'),
                 (SELECT created_ms FROM jobs WHERE state = 'queued' AND parent IS NULL ORDER BY id LIMIT 1),
                 (SELECT page_count FROM pragma_page_count) * (SELECT page_size FROM pragma_page_size)",
        )
        .fetch_one(&self.readers)
        .await?;
        let count = |number: i64| u64::try_from(number).unwrap_or(0);
        let (queued, running, store_bytes) = (count(queued), count(running), count(store_bytes));
        Ok(JobCounts { queued, running, callbacks: count(callbacks), oldest_ms, store_bytes })
    }
}

impl JobStore for SqliteStore {
    fn submit(&self, job: NewJob, queue_limit: u64) -> BoxFuture<'_, Result<Accepted, StoreError>> {
        Box::pin(self.submit_job(job, queue_limit))
    }
    fn counts(&self) -> BoxFuture<'_, Result<JobCounts, StoreError>> {
        Box::pin(self.count_jobs())
    }
    fn waits(&self, short_ms: Option<f64>) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(async move {
            let mut reader = self.readers.acquire().await?;
            Ok(waits(&mut reader, short_ms, now_ms()).await?)
        })
    }
    fn take(&self, wanted: Wanted) -> BoxFuture<'_, Result<Next, StoreError>> {
        let keep_ms = self.keep_ms;
        Box::pin(
            self.ledger
                .write(move |connection| Box::pin(async move { take(connection, wanted, keep_ms, now_ms()).await })),
        )
    }
    fn finish(&self, lease: Lease, ending: Ending) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        Box::pin(self.finish_job(lease, ending))
    }
    fn beat(&self, beats: Vec<Beat>) -> BoxFuture<'_, Result<Vec<Lease>, StoreError>> {
        Box::pin(self.ledger.write(move |connection| {
            let beats = beats.clone();
            Box::pin(async move { beat(connection, &beats, now_ms()).await })
        }))
    }
    fn expire_deadlines(&self, problem: String) -> BoxFuture<'_, Result<(Changed, Option<i64>), StoreError>> {
        let keep_ms = self.keep_ms;
        Box::pin(self.ledger.write(move |connection| {
            let problem = problem.clone();
            Box::pin(async move { expire_deadlines(connection, &problem, keep_ms, now_ms()).await })
        }))
    }
    fn sweep(&self, live: Live) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        Box::pin(self.ledger.write(move |connection| {
            let live = Arc::clone(&live);
            // Asked here, where no claim can come between asking and looking.
            Box::pin(async move { sweep(connection, &live()).await })
        }))
    }
    fn take_up_callbacks(&self, wanted: TakeUp) -> BoxFuture<'_, Result<Vec<DueCallback>, StoreError>> {
        Box::pin(async move {
            let due = "SELECT EXISTS (SELECT 1 FROM callbacks INDEXED BY callbacks_due
                                      WHERE state = 'pending' AND next_ms <= ?1)";
            // Hardly ever is there one: that is no reason to write.
            if !sqlx::query_scalar::<_, bool>(due).bind(now_ms()).fetch_one(&self.readers).await? {
                return Ok(Vec::new());
            }
            let take_up = self.ledger.write(move |connection| {
                let wanted = wanted.clone();
                Box::pin(async move { callbacks::take_up(connection, &wanted, now_ms()).await })
            });
            take_up.await
        })
    }
    fn forget_expired(&self) -> BoxFuture<'_, Result<u64, StoreError>> {
        let keep_ms = self.keep_ms;
        Box::pin(async move {
            let mut records = 0;
            loop {
                // One transaction after the other, so that jobs get in between.
                let round = self.ledger.write(move |connection| {
                    Box::pin(async move {
                        forget_work(connection).await?;
                        forget_expired(connection, keep_ms, now_ms()).await
                    })
                });
                let round = round.await?;
                records += round.records;
                if !round.is_more {
                    return Ok(records);
                }
            }
        })
    }
    fn note_timing(&self, timing: Timing) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.ledger.write(move |connection| {
            let timing = timing.clone();
            Box::pin(async move { note_timing(connection, &timing).await })
        }))
    }
}

impl SqliteStore {
    /// A result was written with its job: what is written behind the answers leaves it out.
    fn kept(&self, key: &[u8], bytes: i64) {
        self.keys.add(key);
        self.result_bytes.fetch_add(bytes, Ordering::Relaxed);
        if let Some(key) = Key::from_bytes(key) {
            self.writer.written(&key);
        }
    }
}
