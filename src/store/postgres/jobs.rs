//! The store's two faces: results and jobs.

use bytes::Bytes;
use futures_util::future::BoxFuture;

use super::line::submit;
use super::run::{add_shards, beat, cancel, claim, finish, finish_shard, hold, redo, refuse, requeue, take, waits};
use super::writer::LIST_PATIENCE;
use super::{PostgresStore, callbacks};
use crate::key::Key;
use crate::store::common::callbacks::settle;
use crate::store::common::jobs::{self, record};
use crate::store::common::usage::{kept_by_owner, note_work, usage};
use crate::store::common::{results, shards};
use crate::store::jobs::{
    Accepted, Beat, Cancelled, Changed, Claimed, DueCallback, Ending, Hear, JobCounts, JobId, JobPage, JobQuery,
    JobRecord, JobStore, Lease, Live, NewJob, Next, Shard, TakeUp, Timing, Tried, Usage, Wanted,
};
use crate::store::sql::Reads as _;
use crate::store::sqlite_jobs::pack::{PackedEnding, packed, packed_ending};
use crate::store::{KeptResult, Origin, ResultPage, ResultQuery, ResultStore, StoreError};

impl ResultStore for PostgresStore {
    fn get(&self, key: Key) -> BoxFuture<'_, Result<Option<KeptResult>, StoreError>> {
        Box::pin(self.read(key))
    }
    fn put(&self, result: KeptResult) {
        self.writer.put(result);
    }
    fn list(&self, query: ResultQuery) -> BoxFuture<'_, Result<ResultPage, StoreError>> {
        Box::pin(async move {
            self.writer.flush(LIST_PATIENCE).await;
            Ok(results::page(&mut *self.reader().await?, query).await?)
        })
    }
    fn uses(&self, record: String, owner: Option<String>) -> BoxFuture<'_, Result<u64, StoreError>> {
        Box::pin(async move {
            self.writer.flush(LIST_PATIENCE).await;
            Ok(results::uses(&mut *self.reader().await?, record, owner).await?)
        })
    }
    fn note_asked(&self, key: Key, owner: String) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async move { Ok(results::note_asked(&mut *self.reader().await?, key, &owner).await?) })
    }
    fn has_asked(&self, key: Key, owner: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(async move { Ok(results::has_asked(&mut *self.reader().await?, key, &owner).await?) })
    }
    fn origin(&self, key: Key, owner: Option<String>) -> BoxFuture<'_, Result<Origin, StoreError>> {
        Box::pin(async move {
            self.writer.flush(LIST_PATIENCE).await;
            Ok(results::origin(&mut *self.reader().await?, key, owner).await?)
        })
    }
    fn inputs(&self, keys: Vec<Key>, most: usize) -> BoxFuture<'_, Result<Vec<(Key, Bytes)>, StoreError>> {
        Box::pin(async move { Ok(results::inputs(&mut *self.reader().await?, &keys, most).await?) })
    }
    fn ping(&self) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async {
            sqlx::query("SELECT 1").execute(&self.pool).await?;
            Ok(())
        })
    }
    fn close(&self) -> BoxFuture<'_, ()> {
        Box::pin(async {
            self.writer.close().await;
            self.newsroom.close();
            self.pool.close().await;
        })
    }
}

impl PostgresStore {
    async fn submit_job(&self, job: NewJob, queue_limit: u64) -> Result<Accepted, StoreError> {
        let packed = packed(job).await?;
        let (keep_ms, engine) = (self.keep_ms, self.engine.clone());
        let accepted = self
            .write(move |connection| {
                Box::pin(async move { submit(connection, &packed, (queue_limit, keep_ms, &engine)).await })
            })
            .await?;
        Ok(accepted)
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
    fn job(&self, id: JobId) -> BoxFuture<'_, Result<Option<JobRecord>, StoreError>> {
        Box::pin(async move { Ok(record(&mut *self.reader().await?, id).await?) })
    }
    fn jobs(&self, query: JobQuery) -> BoxFuture<'_, Result<JobPage, StoreError>> {
        Box::pin(async move { Ok(jobs::list(&mut *self.reader().await?, query).await?) })
    }
    fn job_inputs(&self, ids: Vec<JobId>, most: usize) -> BoxFuture<'_, Result<Vec<(JobId, Bytes)>, StoreError>> {
        Box::pin(async move { Ok(jobs::inputs(&mut *self.reader().await?, &ids, most).await?) })
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
    fn hold(&self, id: JobId) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async move { Ok(hold(&self.pool, id).await?) })
    }
    fn claim(&self, id: JobId, lease: Lease, most: u32, problem: String) -> BoxFuture<'_, Result<Claimed, StoreError>> {
        Box::pin(async move {
            let keep_ms = self.keep_ms;
            self.write(move |connection| {
                Box::pin(async move { claim(connection, id, lease, (most, &problem), keep_ms).await })
            })
            .await
        })
    }
    fn finish(&self, lease: Lease, ending: Ending) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        Box::pin(self.finish_job(lease, ending))
    }
    fn add_shards(&self, lease: Lease, numbers: Vec<u32>) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(self.write(move |connection| Box::pin(async move { add_shards(connection, lease, &numbers).await })))
    }
    fn shards(&self, parent: Key, numbers: Vec<u32>) -> BoxFuture<'_, Result<Vec<Shard>, StoreError>> {
        Box::pin(async move { Ok(shards::over(&mut *self.reader().await?, parent, &numbers).await?) })
    }
    fn input_of(&self, key: Key) -> BoxFuture<'_, Result<Option<Bytes>, StoreError>> {
        Box::pin(async move { Ok(shards::input_of(&mut *self.reader().await?, key).await?) })
    }
    fn release(&self, lease: Lease) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        Box::pin(self.write(move |connection| Box::pin(requeue(connection, lease, false, None))))
    }
    fn usage(&self, owner: String) -> BoxFuture<'_, Result<Usage, StoreError>> {
        Box::pin(async move { Ok(usage(&mut *self.reader().await?, &owner).await?) })
    }
    fn kept_by_owner(&self) -> BoxFuture<'_, Result<Vec<(String, u64)>, StoreError>> {
        Box::pin(async move { Ok(kept_by_owner(&mut *self.reader().await?).await?) })
    }
    fn note_work(&self, work: Vec<(String, f64)>) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.write(move |connection| Box::pin(async move { note_work(connection, &work).await })))
    }
    fn refuse(&self, lease: Lease, owner: String, problem: String) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        let keep_ms = self.keep_ms;
        Box::pin(self.write(move |connection| {
            Box::pin(async move { refuse(connection, lease, (&owner, &problem), keep_ms).await })
        }))
    }
    fn cancel(&self, id: JobId) -> BoxFuture<'_, Result<Option<Cancelled>, StoreError>> {
        let keep_ms = self.keep_ms;
        Box::pin(self.write(move |connection| Box::pin(cancel(connection, id, keep_ms))))
    }
    fn redo(&self, id: JobId) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.write(move |connection| Box::pin(redo(connection, id))))
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
    fn settle_callback(&self, due: DueCallback, tried: Tried) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(self.write(move |connection| Box::pin(async move { settle(connection, &due, &tried).await })))
    }
    fn forget_expired(&self) -> BoxFuture<'_, Result<u64, StoreError>> {
        Box::pin(self.forget())
    }
    fn note_timing(&self, timing: Timing) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async move { Ok(jobs::note_timing(&mut *self.reader().await?, &timing).await?) })
    }
    fn timings(&self, limit: u32) -> BoxFuture<'_, Result<Vec<Timing>, StoreError>> {
        Box::pin(async move { Ok(jobs::timings(&mut *self.reader().await?, limit).await?) })
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
