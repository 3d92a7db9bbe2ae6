//! The store's two faces: results and jobs.

use bytes::Bytes;
use futures_util::future::BoxFuture;
use sqlx::postgres::PgConnection;

use super::line::submit;
use super::run::{beat, cancel, claim, finish, hold, redo, refuse, requeue, take, waits};
use super::writer::LIST_PATIENCE;
use super::{PostgresStore, callbacks, column, news};
use crate::key::Key;
use crate::store::common::callbacks::settle;
use crate::store::common::jobs::{self, record};
use crate::store::common::results;
use crate::store::common::usage::{kept_by_owner, note_work, usage};
use crate::store::jobs::{
    Accepted, Beat, Cancelled, Changed, Claimed, DueCallback, Ending, Hear, JobCounts, JobId, JobPage, JobQuery,
    JobRecord, JobStore, Lease, Live, NewJob, Next, TakeUp, Timing, Tried, Usage, Wanted,
};
use crate::store::sql::{Outcome, Reads as _};
use crate::store::sqlite_jobs::pack::{packed, packed_ending};
use crate::store::{KeptResult, Origin, ResultPage, ResultQuery, ResultStore, StoreError, Taken};

/// So many are asked for help at most.
const MOST_HELP: i32 = 256;
/// The same for each worker that is there.
const HELP_PER_WORKER: i32 = 4;
/// A worker that was heard of within this time is there.
const HERE_MS: i64 = 15_000;

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
    fn put_shard(&self, study: Key, shard: u32, content: Bytes) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.put_down(study, shard, content))
    }
    fn shards(&self, study: Key) -> BoxFuture<'_, Result<Vec<(u32, Bytes)>, StoreError>> {
        Box::pin(self.done(study, None))
    }
    fn some_shards(&self, study: Key, wanted: Vec<u32>) -> BoxFuture<'_, Result<Vec<(u32, Bytes)>, StoreError>> {
        Box::pin(self.done(study, Some(wanted)))
    }
    fn forget_shards(&self, study: Key) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.forget_study(study))
    }
    fn take_shard(&self, study: Key, of: u32) -> BoxFuture<'_, Result<Taken, StoreError>> {
        Box::pin(self.take(study, of))
    }
    fn give_shard_back(&self, study: Key, shard: u32) {
        self.give_back(study, shard);
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
        let ending = packed_ending(ending).await?;
        let (keep_ms, key) = (self.keep_ms, ending.key());
        let ended = self
            .write(move |connection| Box::pin(async move { finish(connection, lease, &ending, keep_ms).await }))
            .await?;
        if let Some(key) = key.filter(|_| !ended.is_empty()) {
            self.writer.written(&key);
        }
        Ok(ended)
    }

    async fn help(&self, key: Key, most: u32) -> Result<(), StoreError> {
        let engine = self.engine.clone();
        self.write(|connection| Box::pin(call(connection, key, most, engine))).await
    }
}

/// Asks for help with the job that is computed under a key.
async fn call(connection: &mut PgConnection, key: Key, most: u32, engine: String) -> Outcome<()> {
    sqlx::query(
        "UPDATE jobs SET help = least(help + $2, $3, $4 * (
             SELECT count(*) FROM workers WHERE engine = $5 AND seen_ms > now_ms() - $6))
         WHERE id = (SELECT id FROM jobs WHERE key = $1 AND state = 'running' ORDER BY id LIMIT 1)",
    )
    .bind(key.as_bytes().as_slice())
    .bind(column(most))
    .bind(MOST_HELP)
    .bind(HELP_PER_WORKER)
    .bind(engine)
    .bind(HERE_MS)
    .execute(&mut *connection)
    .await?;
    news::call(connection).await
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
                    "SELECT (SELECT count(*) FROM jobs WHERE state = 'queued'),
                     (SELECT count(*) FROM jobs WHERE state = 'running'),
                     (SELECT count(*) FROM callbacks WHERE state = 'pending'),
                     (SELECT created_ms FROM jobs WHERE state = 'queued' ORDER BY id LIMIT 1),
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
    fn call_for_help(&self, key: Key, most: u32) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.help(key, most))
    }
}
