//! The store's two faces: results and jobs.

use bytes::Bytes;
use futures_util::future::BoxFuture;
use sqlx::QueryBuilder;
use sqlx::postgres::{PgConnection, Postgres};
use tokio::sync::watch;
use uuid::Uuid;

use super::PostgresStore;
use super::callbacks;
use super::care::{note_timing, timings};
use super::line::submit;
use super::queue::{self, Task, Tasks};
use super::record::{Outcome, RecordRow, columns, count, record};
use super::run::{beat, cancel, claim, finish, redo, refuse, requeue};
use super::usage::{kept_by_owner, note_work, usage};
use crate::key::Key;
use crate::store::jobs::{
    Accepted, Beat, Cancelled, Changed, Claimed, DueCallback, Ending, Hear, JobCounts, JobId, JobPage, JobQuery,
    JobRecord, JobStore, Lease, Live, NewJob, RunTask, Shared, TakeUp, Timing, Tried, Usage, Waiting,
};
use crate::store::sqlite_jobs::pack::{packed, packed_ending};
use crate::store::sqlite_jobs::record::parsed;
use crate::store::{KeptResult, Origin, ResultPage, ResultQuery, ResultStore, StoreError, Taken};

/// Tasks that one call for help makes at most.
const MOST_HELP: u32 = 256;
/// Tasks for each worker that is there.
const HELP_PER_WORKER: u32 = 4;

impl ResultStore for PostgresStore {
    fn get(&self, key: Key) -> BoxFuture<'_, Result<Option<KeptResult>, StoreError>> {
        Box::pin(self.read(key))
    }
    fn put(&self, result: KeptResult) {
        self.writer.put(result);
    }
    fn list(&self, query: ResultQuery) -> BoxFuture<'_, Result<ResultPage, StoreError>> {
        Box::pin(self.page(query))
    }
    fn note_asked(&self, key: Key, owner: String) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.note_asked_in(key, owner))
    }
    fn has_asked(&self, key: Key, owner: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(self.has_asked_in(key, owner))
    }
    fn origin(&self, key: Key, owner: Option<String>) -> BoxFuture<'_, Result<Origin, StoreError>> {
        Box::pin(self.origin_of(key, owner))
    }
    fn inputs(&self, keys: Vec<Key>, most: usize) -> BoxFuture<'_, Result<Vec<(Key, Bytes)>, StoreError>> {
        Box::pin(self.some_inputs(keys, most))
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
        self.tasks.wake();
        Ok(accepted)
    }

    async fn finish_job(&self, lease: Lease, ending: Ending) -> Result<Vec<JobId>, StoreError> {
        let ending = packed_ending(ending).await?;
        let keep_ms = self.keep_ms;
        self.write(move |connection| Box::pin(async move { finish(connection, lease, &ending, keep_ms).await })).await
    }

    async fn list_jobs(&self, query: JobQuery) -> Result<JobPage, StoreError> {
        let mut statement =
            QueryBuilder::<Postgres>::new(concat!("SELECT ", columns!(), " FROM precut.jobs WHERE true"));
        if let Some(state) = query.state {
            statement.push(" AND state = ").push_bind(state.word());
        }
        if let Some(calculator) = query.calculator {
            statement.push(" AND calculator = ").push_bind(calculator);
        }
        if let Some(owner) = query.owner {
            statement.push(" AND owner = ").push_bind(owner);
        }
        if let Some(key) = query.key {
            statement.push(" AND key = ").push_bind(key.as_bytes().to_vec());
        }
        if let Some(before) = query.before {
            statement.push(" AND id < ").push_bind(before.to_string());
        }
        // One more than asked for tells whether there is another page.
        statement.push(" ORDER BY id DESC LIMIT ").push_bind(i64::from(query.limit) + 1);
        let rows: Vec<RecordRow> = statement.build_query_as().fetch_all(&self.pool).await?;
        let mut items = rows.into_iter().map(RecordRow::record).collect::<Outcome<Vec<_>>>()?;
        let more = items.len() > query.limit as usize;
        items.truncate(query.limit as usize);
        let next = items.last().filter(|_| more).map(|last| last.id);
        Ok(JobPage { items, next })
    }

    async fn help(&self, key: Key, most: u32) -> Result<(), StoreError> {
        let engine = self.engine.clone();
        self.write(|connection| Box::pin(call(connection, key, most, engine))).await?;
        self.tasks.wake();
        Ok(())
    }
}

/// Pushes further tasks for the job that is computed under a key.
async fn call(connection: &mut PgConnection, key: Key, most: u32, engine: String) -> Outcome<()> {
    let job: Option<(String, i32)> =
        sqlx::query_as("SELECT id, priority FROM precut.jobs WHERE key = $1 AND state = 'running' ORDER BY id LIMIT 1")
            .bind(key.as_bytes().as_slice())
            .fetch_optional(&mut *connection)
            .await?;
    let Some((job, priority)) = job else { return Ok(()) };
    let workers: i64 = sqlx::query_scalar(
        "SELECT count(*) FROM apalis.workers WHERE worker_type = $1 AND last_seen > now() - interval '10 seconds'",
    )
    .bind(queue::name(&engine))
    .fetch_one(&mut *connection)
    .await?;
    let tasks = most.min(MOST_HELP).min(u32::try_from(workers).unwrap_or(0).saturating_mul(HELP_PER_WORKER));
    let tasks: Vec<Task<'_>> = (0..tasks)
        .map(|_| Task { job: &job, name: format!("{job}:help:{}", Uuid::now_v7().simple()), priority, turn: None })
        .collect();
    queue::add(connection, &engine, &tasks).await
}

/// A job that waits: tries, calculator, owner, when it came, and its place in a trace.
type WaitingRow = (i32, String, String, i64, Option<String>, Option<String>);

impl JobStore for PostgresStore {
    fn submit(&self, job: NewJob, queue_limit: u64) -> BoxFuture<'_, Result<Accepted, StoreError>> {
        Box::pin(self.submit_job(job, queue_limit))
    }
    fn job(&self, id: JobId) -> BoxFuture<'_, Result<Option<JobRecord>, StoreError>> {
        Box::pin(async move {
            let mut connection = self.pool.acquire().await?;
            Ok(record(&mut connection, id).await?)
        })
    }
    fn jobs(&self, query: JobQuery) -> BoxFuture<'_, Result<JobPage, StoreError>> {
        Box::pin(self.list_jobs(query))
    }
    fn job_inputs(&self, ids: Vec<JobId>, most: usize) -> BoxFuture<'_, Result<Vec<(JobId, Bytes)>, StoreError>> {
        Box::pin(async move {
            let ids: Vec<String> = ids.iter().map(JobId::to_string).collect();
            let rows: Vec<(String, Vec<u8>)> = sqlx::query_as(
                "SELECT id, input FROM precut.jobs WHERE id = ANY($1) AND octet_length(input) BETWEEN 1 AND $2",
            )
            .bind(ids)
            .bind(i32::try_from(most).unwrap_or(i32::MAX))
            .fetch_all(&self.pool)
            .await?;
            Ok(rows.into_iter().filter_map(|(id, input)| Some((id.parse().ok()?, input.into()))).collect())
        })
    }
    fn counts(&self) -> BoxFuture<'_, Result<JobCounts, StoreError>> {
        Box::pin(async {
            let (queued, running, callbacks, oldest_ms, store_bytes): (i64, i64, i64, Option<i64>, i64) =
                sqlx::query_as(
                    "SELECT (SELECT count(*) FROM precut.jobs WHERE state = 'queued'),
                     (SELECT count(*) FROM precut.jobs WHERE state = 'running'),
                     (SELECT count(*) FROM precut.callbacks WHERE state = 'pending'),
                     (SELECT created_ms FROM precut.jobs WHERE state = 'queued' ORDER BY id LIMIT 1),
                     (SELECT sum(pg_total_relation_size(oid))::bigint FROM pg_class WHERE relkind = 'r'
                          AND relnamespace IN ('precut'::regnamespace, 'apalis'::regnamespace))",
                )
                .fetch_one(&self.pool)
                .await?;
            let count = |number: i64| u64::try_from(number).unwrap_or(0);
            let (queued, running, store_bytes) = (count(queued), count(running), count(store_bytes));
            Ok(JobCounts { queued, running, callbacks: count(callbacks), oldest_ms, store_bytes })
        })
    }
    fn waiting(&self, id: JobId) -> BoxFuture<'_, Result<Option<Waiting>, StoreError>> {
        Box::pin(async move {
            let waiting: Option<WaitingRow> = sqlx::query_as(
                "SELECT max(other.attempt), one.calculator, one.owner, one.created_ms, one.traceparent, one.tracestate
                 FROM precut.jobs AS one JOIN precut.jobs AS other USING (key)
                 WHERE one.id = $1 AND one.state = 'queued' AND other.state = 'queued'
                 GROUP BY one.id",
            )
            .bind(id.to_string())
            .fetch_optional(&self.pool)
            .await?;
            Ok(waiting.map(|(charged, calculator, owner, created_ms, traceparent, tracestate)| Waiting {
                charged: count(charged),
                calculator,
                owner,
                created_ms,
                traceparent,
                tracestate,
            }))
        })
    }
    fn next_short(&self, most_ms: f64) -> BoxFuture<'_, Result<Option<JobId>, StoreError>> {
        Box::pin(async move {
            let next: Option<String> = sqlx::query_scalar(
                "SELECT id FROM precut.jobs WHERE state = 'queued' AND estimate_ms <= $1 AND attempt = 0 AND engine = $2
                 ORDER BY priority DESC, turn, id LIMIT 1",
            )
            .bind(most_ms)
            .bind(&self.engine)
            .fetch_optional(&self.pool)
            .await?;
            Ok(next.map(|id| parsed(&id)).transpose()?)
        })
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
        Box::pin(async move {
            let mut connection = self.pool.acquire().await?;
            Ok(usage(&mut connection, &owner).await?)
        })
    }
    fn kept_by_owner(&self) -> BoxFuture<'_, Result<Vec<(String, u64)>, StoreError>> {
        Box::pin(async move { Ok(kept_by_owner(&self.pool).await?) })
    }
    fn note_work(&self, work: Vec<(String, f64)>) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.write(move |connection| Box::pin(note_work(connection, work))))
    }
    fn refuse(&self, id: JobId, problem: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        let keep_ms = self.keep_ms;
        Box::pin(self.write(move |connection| Box::pin(async move { refuse(connection, id, &problem, keep_ms).await })))
    }
    fn cancel(&self, id: JobId) -> BoxFuture<'_, Result<Option<Cancelled>, StoreError>> {
        let keep_ms = self.keep_ms;
        Box::pin(self.write(move |connection| Box::pin(cancel(connection, id, keep_ms))))
    }
    fn redo(&self, id: JobId) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async move {
            self.write(|connection| Box::pin(redo(connection, id))).await?;
            self.tasks.wake();
            Ok(())
        })
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
            let due =
                "SELECT EXISTS (SELECT FROM precut.callbacks WHERE state = 'pending' AND next_ms <= precut.now_ms())";
            // Hardly ever is there one: that is no reason to write.
            if !sqlx::query_scalar::<_, bool>(due).fetch_one(&self.pool).await? {
                return Ok(Vec::new());
            }
            self.write(move |connection| Box::pin(callbacks::take_up(connection, wanted))).await
        })
    }
    fn settle_callback(&self, due: DueCallback, tried: Tried) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(self.write(move |connection| Box::pin(callbacks::settle(connection, due, tried))))
    }
    fn forget_expired(&self) -> BoxFuture<'_, Result<u64, StoreError>> {
        Box::pin(self.forget())
    }
    fn note_timing(&self, timing: Timing) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async move { Ok(note_timing(&self.pool, &timing).await?) })
    }
    fn timings(&self, limit: u32) -> BoxFuture<'_, Result<Vec<Timing>, StoreError>> {
        Box::pin(async move { Ok(timings(&self.pool, limit).await?) })
    }
    fn work(&self, places: usize, run: RunTask, stop: watch::Receiver<bool>) -> BoxFuture<'static, ()> {
        Box::pin(Tasks::work(self.tasks.clone(), places, run, stop))
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
    fn shared(&self, id: JobId) -> BoxFuture<'_, Result<Option<Shared>, StoreError>> {
        Box::pin(async move {
            let row: Option<(Vec<u8>, String, Vec<u8>)> = sqlx::query_as(
                "SELECT key, calculator, input FROM precut.jobs WHERE id = $1 AND state = 'running'
                     AND EXISTS (SELECT FROM precut.shared_studies WHERE study = key)",
            )
            .bind(id.to_string())
            .fetch_optional(&self.pool)
            .await?;
            let Some((key, calculator, input)) = row else { return Ok(None) };
            let Some(key) = Key::from_bytes(&key) else { return Ok(None) };
            let input = zstd::decode_all(input.as_slice()).map_err(|error| StoreError::Failed(error.to_string()))?;
            Ok(Some(Shared { key, calculator, input: input.into() }))
        })
    }
}
