//! Jobs in PostgreSQL.

use futures_util::future::BoxFuture;

use super::run::{beat, finish_shard, take, waits};
use super::{PostgresStore, callbacks, lock};
use crate::store::StoreError;
use crate::store::common::jobs;
use crate::store::common::line::{Terms, submit};
use crate::store::common::run::finish;
use crate::store::jobs::{
    Accepted, Beat, Changed, DueCallback, Ending, Hear, JobCounts, JobId, JobStore, Lease, Live, NewJob, Next, TakeUp,
    Timing, Wanted,
};
use crate::store::sql::Reads as _;
use crate::store::sqlite_jobs::pack::{PackedEnding, packed, packed_ending};

impl PostgresStore {
    async fn submit_job(&self, job: NewJob, queue_limit: u64) -> Result<Accepted, StoreError> {
        let packed = packed(job).await?;
        let (keep_ms, engine) = (self.keep_ms, self.engine.clone());
        let submit = self.write(move |connection| {
            Box::pin(async move {
                let now = lock(connection, &packed.job.key).await?;
                let terms = Terms { queue_limit, now, keep_ms, engine: Some(&engine) };
                submit(connection, &packed, terms).await
            })
        });
        submit.await
    }

    async fn finish_job(&self, lease: Lease, ending: Ending) -> Result<Vec<JobId>, StoreError> {
        // What is done is not computed again: without this its points would have no answers.
        if matches!(ending, Ending::Shard(_)) && !self.writer.flush(self.patience.points).await {
            return Err(StoreError::Failed("the results of a shard's points are not written yet".to_owned()));
        }
        let ending = packed_ending(ending).await?;
        let (keep_ms, key) = (self.keep_ms, ending.key());
        if matches!(ending, PackedEnding::Shard(_)) {
            let mut connection = self.pool.acquire().await?;
            return Ok(finish_shard(&mut connection, lease, &ending, (self.clock.now_ms(), keep_ms)).await?);
        }
        let ended = self
            .write(move |connection| Box::pin(async move { finish(connection, lease, &ending, keep_ms).await }))
            .await?;
        if let Some(key) = key.filter(|_| !ended.is_empty()) {
            self.writer.written(&key);
        }
        Ok(ended)
    }
}

impl JobStore for PostgresStore {
    fn submit(&self, job: NewJob, queue_limit: u64) -> BoxFuture<'_, Result<Accepted, StoreError>> {
        Box::pin(self.submit_job(job, queue_limit))
    }
    fn counts(&self) -> BoxFuture<'_, Result<JobCounts, StoreError>> {
        Box::pin(async {
            let (queued, running, callbacks, oldest_ms, store_bytes): (i64, i64, i64, Option<i64>, i64) =
                sqlx::query_as(
                    "SELECT (SELECT count(*) FROM jobs WHERE state = 'queued' AND parent IS NULL),
                     (SELECT count(*) FROM jobs WHERE state = 'running' AND parent IS NULL),
                     (SELECT count(*) FROM callbacks WHERE state = 'pending'),
                     (SELECT created_ms FROM jobs WHERE state = 'queued' AND parent IS NULL ORDER BY id LIMIT 1),
                     (SELECT sum(pg_total_relation_size(oid))::bigint FROM pg_class WHERE relkind = 'r'
                          AND relnamespace = 'precut'::regnamespace)",
                )
                .fetch_one(&self.pool)
                .await?;
            let count = |number: i64| u64::try_from(number).unwrap_or(0);
            let (queued, running, store_bytes) = (count(queued), count(running), count(store_bytes));
            Ok(JobCounts { queued, running, callbacks: count(callbacks), oldest_ms, store_bytes })
        })
    }
    fn waits(&self, short_ms: Option<f64>) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(async move { Ok(waits(&self.pool, &self.taker(), short_ms).await?) })
    }
    fn take(&self, wanted: Wanted) -> BoxFuture<'_, Result<Next, StoreError>> {
        let (taker, keep_ms) = (self.taker(), self.keep_ms);
        Box::pin(self.write(move |connection| Box::pin(take(connection, taker, wanted, keep_ms))))
    }
    fn finish(&self, lease: Lease, ending: Ending) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        Box::pin(self.finish_job(lease, ending))
    }
    fn beat(&self, beats: Vec<Beat>) -> BoxFuture<'_, Result<Vec<Lease>, StoreError>> {
        Box::pin(async move {
            let mut connection = self.pool.acquire().await?;
            Ok(beat(&mut connection, &beats).await?)
        })
    }
    fn expire_deadlines(&self, problem: String) -> BoxFuture<'_, Result<(Changed, Option<i64>), StoreError>> {
        Box::pin(async move { self.expire(&problem).await })
    }
    fn sweep(&self, live: Live) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        Box::pin(self.sweep_jobs(live))
    }
    fn take_up_callbacks(&self, wanted: TakeUp) -> BoxFuture<'_, Result<Vec<DueCallback>, StoreError>> {
        Box::pin(async move {
            let due = "SELECT EXISTS (SELECT FROM callbacks WHERE state = 'pending' AND next_ms <= now_ms())";
            // Hardly ever is there one: that is no reason to write.
            if !sqlx::query_scalar::<_, bool>(due).fetch_one(&self.pool).await? {
                return Ok(Vec::new());
            }
            self.write(move |connection| Box::pin(callbacks::take_up(connection, wanted))).await
        })
    }
    fn forget_expired(&self) -> BoxFuture<'_, Result<u64, StoreError>> {
        Box::pin(self.forget())
    }
    fn note_timing(&self, timing: Timing) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async move { Ok(jobs::note_timing(&mut *self.reader().await?, &timing).await?) })
    }
    fn is_shared(&self) -> bool {
        true
    }
    fn now_ms(&self) -> i64 {
        self.clock.now_ms()
    }
    fn tell(&self, hear: Hear) {
        self.newsroom.to(hear);
    }
}
