//! Jobs in the SQLite file. Every function here works inside a transaction of the ledger.

use std::sync::Arc;

use futures_util::future::BoxFuture;
use sqlx::sqlite::{Sqlite, SqliteConnection, SqlitePool};
use sqlx::{FromRow, QueryBuilder};
use tokio::sync::watch;

use super::jobs::{
    Accepted, Beat, Cancelled, Changed, Claim, Claimed, Ending, JobCounts, JobId, JobKind, JobPage, JobQuery,
    JobRecord, JobState, JobStore, Lease, Live, NewJob, Priority, RunTask, Timing,
};
use super::queue::{self, Tasks};
use super::row::{self, Packer, ResultRow};
use super::sqlite::SqliteStore;
use super::{StoreError, now_ms};
use crate::key::Key;

/// Inputs and results up to this size are packed where they are, larger ones on a thread that may block.
const PACK_AT_ONCE: usize = 64 << 10;
/// Fast: a job's input is read once or never.
const LEVEL: i32 = 1;
/// Timings kept of each calculator.
const TIMINGS: i64 = 1000;
/// A finished job's record outlives its result by this share of the time that the result is kept.
const TOMBSTONE: i64 = 1;
/// Jobs forgotten in one transaction.
const FORGOTTEN_AT_ONCE: i64 = 500;

/// The columns of a [`JobRecord`].
macro_rules! columns {
    () => {
        "id, kind, calculator, key, state, stage, progress, attempt, lease, priority, problem, estimate_ms, \
         created_ms, started_ms, finished_ms, deadline_ms, expires_ms"
    };
}

#[derive(FromRow)]
struct RecordRow {
    id: String,
    kind: String,
    calculator: String,
    key: Vec<u8>,
    state: String,
    stage: Option<String>,
    progress: f64,
    attempt: u32,
    lease: Option<String>,
    priority: i64,
    problem: Option<String>,
    estimate_ms: f64,
    created_ms: i64,
    started_ms: Option<i64>,
    finished_ms: Option<i64>,
    deadline_ms: Option<i64>,
    expires_ms: Option<i64>,
}

impl RecordRow {
    fn record(self) -> Result<JobRecord, sqlx::Error> {
        Ok(JobRecord {
            id: parsed(&self.id)?,
            kind: JobKind::of_word(&self.kind).ok_or_else(|| unreadable("kind"))?,
            calculator: self.calculator,
            key: Key::from_bytes(&self.key).ok_or_else(|| unreadable("key"))?,
            state: JobState::of_word(&self.state).ok_or_else(|| unreadable("state"))?,
            stage: self.stage,
            progress: self.progress,
            attempt: self.attempt,
            lease: self.lease.map(|lease| parsed(&lease)).transpose()?,
            priority: of_rank(self.priority).ok_or_else(|| unreadable("priority"))?,
            problem: self.problem,
            estimate_ms: self.estimate_ms,
            created_ms: self.created_ms,
            started_ms: self.started_ms,
            finished_ms: self.finished_ms,
            deadline_ms: self.deadline_ms,
            expires_ms: self.expires_ms,
        })
    }
}

fn parsed<T: std::str::FromStr<Err = uuid::Error>>(text: &str) -> Result<T, sqlx::Error> {
    text.parse().map_err(|error: uuid::Error| sqlx::Error::Decode(error.into()))
}

fn unreadable(column: &str) -> sqlx::Error {
    sqlx::Error::Decode(format!("the column {column} of a job").into())
}

const fn rank(priority: Priority) -> i64 {
    match priority {
        Priority::Low => 0,
        Priority::Normal => 1,
        Priority::High => 2,
    }
}

fn of_rank(rank_: i64) -> Option<Priority> {
    Priority::ALL.iter().copied().find(|priority| rank(*priority) == rank_)
}

type Outcome<T> = Result<T, sqlx::Error>;

/// A job with its input packed, to be written.
struct Packed {
    job: NewJob,
    input: Vec<u8>,
    result: Option<ResultRow>,
}

async fn packed(job: NewJob) -> Result<Packed, StoreError> {
    let size = job.input.len() + job.result.as_ref().map_or(0, |result| result.body.len() + result.input.len());
    let pack = move || -> std::io::Result<Packed> {
        let input = zstd::bulk::compress(&job.input, LEVEL)?;
        let result = job.result.as_ref().map(|result| Packer::new()?.row(result)).transpose()?;
        Ok(Packed { job, input, result })
    };
    blocking(size, pack).await
}

async fn packed_ending(ending: Ending) -> Result<PackedEnding, StoreError> {
    match ending {
        Ending::Failed(problem) => Ok(PackedEnding::Failed(problem)),
        Ending::Succeeded(result) => {
            let size = result.body.len() + result.input.len();
            blocking(size, move || Packer::new()?.row(&result)).await.map(PackedEnding::Succeeded)
        }
    }
}

enum PackedEnding {
    Succeeded(ResultRow),
    Failed(String),
}

async fn blocking<T: Send + 'static>(
    size: usize,
    work: impl FnOnce() -> std::io::Result<T> + Send + 'static,
) -> Result<T, StoreError> {
    let failed = |error: String| StoreError::Failed(error);
    if size <= PACK_AT_ONCE {
        return work().map_err(|error| failed(error.to_string()));
    }
    let done = tokio::task::spawn_blocking(work).await.map_err(|error| failed(error.to_string()))?;
    done.map_err(|error| failed(error.to_string()))
}

async fn record(connection: &mut SqliteConnection, id: JobId) -> Outcome<Option<JobRecord>> {
    let row: Option<RecordRow> = sqlx::query_as(concat!("SELECT ", columns!(), " FROM precut_jobs WHERE id = ?1"))
        .bind(id.to_string())
        .fetch_optional(connection)
        .await?;
    row.map(RecordRow::record).transpose()
}

/// The place of a new job in the order of its priority.
///
/// Start-time fair queueing: a client's jobs follow one another, and a client that has none waiting begins where the
/// line now is. So two clients take turns, however many jobs one of them has sent before the other came.
async fn turn(connection: &mut SqliteConnection, owner: &str, priority: i64) -> Outcome<i64> {
    let own: Option<i64> =
        sqlx::query_scalar("SELECT max(turn) FROM precut_jobs WHERE state = 'queued' AND owner = ?1 AND priority = ?2")
            .bind(owner)
            .bind(priority)
            .fetch_one(&mut *connection)
            .await?;
    let first: Option<i64> =
        sqlx::query_scalar("SELECT min(turn) FROM precut_jobs WHERE state = 'queued' AND priority = ?1")
            .bind(priority)
            .fetch_one(&mut *connection)
            .await?;
    Ok(own.map_or(0, |turn| turn + 1).max(first.unwrap_or(0)))
}

async fn submit(
    connection: &mut SqliteConnection,
    packed: &Packed,
    queue_limit: u64,
    keep_ms: i64,
    now: i64,
) -> Outcome<Accepted> {
    let Packed { job, input, result } = packed;
    if let Some(idempotency) = &job.idempotency {
        let known: Option<(String, Vec<u8>)> =
            sqlx::query_as("SELECT id, body_hash FROM precut_jobs WHERE owner = ?1 AND idempotency = ?2")
                .bind(&job.owner)
                .bind(&idempotency.key)
                .fetch_optional(&mut *connection)
                .await?;
        if let Some((id, body_hash)) = known {
            let id = parsed(&id)?;
            if body_hash != idempotency.body_hash {
                return Ok(Accepted::OtherBody(id));
            }
            return Ok(record(connection, id).await?.map_or(Accepted::OtherBody(id), Accepted::Known));
        }
    }
    // An equal job that is being computed takes this one along.
    let running: Option<(String, u32, Option<i64>)> = sqlx::query_as(
        "SELECT lease, attempt, started_ms FROM precut_jobs WHERE key = ?1 AND state = 'running' LIMIT 1",
    )
    .bind(job.key.as_bytes().as_slice())
    .fetch_optional(&mut *connection)
    .await?;
    let (state, lease, attempt, started_ms) = match (result, running) {
        (Some(_), _) => (JobState::Succeeded, None, 0, None),
        (None, Some((lease, attempt, started_ms))) => (JobState::Running, Some(lease), attempt, started_ms),
        (None, None) => (JobState::Queued, None, 0, None),
    };
    if state == JobState::Queued {
        let queued: i64 = sqlx::query_scalar("SELECT count(*) FROM precut_jobs WHERE state = 'queued'")
            .fetch_one(&mut *connection)
            .await?;
        let queued = u64::try_from(queued).unwrap_or(0);
        if queued >= queue_limit {
            return Ok(Accepted::QueueFull { queued });
        }
    }
    if let Some(result) = result {
        row::insert(std::slice::from_ref(result), now, connection).await?;
    }
    let finished = (state == JobState::Succeeded).then_some(now);
    let priority = rank(job.priority);
    let turn = turn(connection, &job.owner, priority).await?;
    sqlx::query(
        "INSERT INTO precut_jobs (id, kind, calculator, version, key, input, state, progress, attempt, lease,
             heartbeat_ms, priority, turn, owner, idempotency, body_hash, estimate_ms, created_ms, started_ms,
             finished_ms, deadline_ms, expires_ms)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20, ?21, ?22)",
    )
    .bind(job.id.to_string())
    .bind(job.kind.word())
    .bind(&job.calculator)
    .bind(job.version)
    .bind(job.key.as_bytes().as_slice())
    .bind(input)
    .bind(state.word())
    .bind(if finished.is_some() { 1.0 } else { 0.0 })
    .bind(attempt)
    .bind(&lease)
    .bind(lease.as_ref().map(|_| now))
    .bind(priority)
    .bind(turn)
    .bind(&job.owner)
    .bind(job.idempotency.as_ref().map(|idempotency| &idempotency.key))
    .bind(job.idempotency.as_ref().map(|idempotency| idempotency.body_hash.to_vec()))
    .bind(job.estimate_ms)
    .bind(now)
    .bind(started_ms.or(finished))
    .bind(finished)
    .bind(job.deadline_ms)
    .bind(finished.map(|at| at.saturating_add(keep_ms)))
    .execute(&mut *connection)
    .await?;
    if state == JobState::Queued {
        queue::push(connection, &[job.id.to_string()]).await?;
    }
    let written = record(connection, job.id).await?.ok_or(sqlx::Error::RowNotFound)?;
    Ok(Accepted::New(written))
}

async fn claim(
    connection: &mut SqliteConnection,
    id: JobId,
    lease: Lease,
    (most, problem): (u32, &str),
    keep_ms: i64,
    now: i64,
) -> Outcome<Claimed> {
    let waiting: Option<(Vec<u8>, String, String, Vec<u8>, f64)> = sqlx::query_as(
        "SELECT key, kind, calculator, input, estimate_ms FROM precut_jobs WHERE id = ?1 AND state = 'queued'",
    )
    .bind(id.to_string())
    .fetch_optional(&mut *connection)
    .await?;
    let Some((key, kind, calculator, input, estimate_ms)) = waiting else { return Ok(Claimed::Nothing) };
    let charged: u32 = sqlx::query_scalar("SELECT max(attempt) FROM precut_jobs WHERE key = ?1 AND state = 'queued'")
        .bind(&key)
        .fetch_one(&mut *connection)
        .await?;
    if charged >= most {
        let failed: Vec<String> = sqlx::query_scalar(
            "UPDATE precut_jobs SET state = 'failed', problem = ?2, finished_ms = ?3, expires_ms = ?4
             WHERE key = ?1 AND state = 'queued' RETURNING id",
        )
        .bind(&key)
        .bind(problem)
        .bind(now)
        .bind(now.saturating_add(keep_ms))
        .fetch_all(connection)
        .await?;
        return Ok(Claimed::Poisonous(ids(&failed)?));
    }
    let jobs: Vec<String> = sqlx::query_scalar(
        "UPDATE precut_jobs
         SET state = 'running', attempt = ?2, lease = ?3, heartbeat_ms = ?4, started_ms = ?4, progress = 0.0, stage = NULL
         WHERE key = ?1 AND state = 'queued' RETURNING id",
    )
    .bind(&key)
    .bind(charged + 1)
    .bind(lease.to_string())
    .bind(now)
    .fetch_all(connection)
    .await?;
    let input = zstd::decode_all(&*input).map_err(|error| sqlx::Error::Decode(error.into()))?;
    let kind = JobKind::of_word(&kind).ok_or_else(|| unreadable("kind"))?;
    let jobs = ids(&jobs)?;
    Ok(Claimed::Run(Claim { lease, jobs, kind, calculator, input: input.into(), attempt: charged + 1, estimate_ms }))
}

fn ids(texts: &[String]) -> Outcome<Vec<JobId>> {
    texts.iter().map(|text| parsed(text)).collect()
}

async fn finish(
    connection: &mut SqliteConnection,
    lease: Lease,
    ending: &PackedEnding,
    keep_ms: i64,
    now: i64,
) -> Outcome<Vec<JobId>> {
    let (state, problem, result) = match ending {
        PackedEnding::Succeeded(result) => (JobState::Succeeded, None, Some(result)),
        PackedEnding::Failed(problem) => (JobState::Failed, Some(problem), None),
    };
    let ended: Vec<String> = sqlx::query_scalar(
        "UPDATE precut_jobs
         SET state = ?2, problem = ?3, progress = iif(?2 = 'succeeded', 1.0, progress), stage = NULL, lease = NULL,
             heartbeat_ms = NULL, finished_ms = ?4, expires_ms = ?5, key = coalesce(?6, key)
         WHERE lease = ?1 AND state = 'running' RETURNING id",
    )
    .bind(lease.to_string())
    .bind(state.word())
    .bind(problem)
    .bind(now)
    .bind(now.saturating_add(keep_ms))
    .bind(result.map(|result| result.key.clone()))
    .fetch_all(&mut *connection)
    .await?;
    if let Some(result) = result
        && !ended.is_empty()
    {
        row::insert(std::slice::from_ref(result), now, connection).await?;
    }
    ids(&ended)
}

/// Puts running jobs of some leases (JSON array) back in line: `charged` says whether the start counts. One that was
/// charged twice goes behind all others: whatever took its process along twice shall take nobody along any more.
async fn requeue(connection: &mut SqliteConnection, leases: &str, charged: bool) -> Outcome<Vec<JobId>> {
    let back: Vec<String> = sqlx::query_scalar(
        "UPDATE precut_jobs
         SET state = 'queued', lease = NULL, heartbeat_ms = NULL, started_ms = NULL, progress = 0.0, stage = NULL,
             attempt = max(0, attempt - ?2),
             turn = iif(?2 = 0 AND attempt > 1,
                        1 + (SELECT max(turn) FROM precut_jobs AS other WHERE other.priority = precut_jobs.priority
                             AND other.state IN ('queued', 'running')),
                        turn)
         WHERE state = 'running' AND lease IN (SELECT value FROM json_each(?1)) RETURNING id",
    )
    .bind(leases)
    .bind(i64::from(!charged))
    .fetch_all(&mut *connection)
    .await?;
    queue::push(connection, &back).await?;
    ids(&back)
}

fn json_list<T: std::fmt::Display>(items: &[T]) -> String {
    // Leases and ids are hexadecimal digits and hyphens.
    let items: Vec<String> = items.iter().map(|item| format!("\"{item}\"")).collect();
    format!("[{}]", items.join(","))
}

/// Of these leases (JSON array) the ones that no running job has.
async fn unwanted(connection: &mut SqliteConnection, leases: &[String]) -> Outcome<Vec<Lease>> {
    let gone: Vec<String> = sqlx::query_scalar(
        "SELECT DISTINCT value FROM json_each(?1)
         WHERE NOT EXISTS (SELECT 1 FROM precut_jobs WHERE lease = value AND state = 'running')",
    )
    .bind(json_list(leases))
    .fetch_all(connection)
    .await?;
    gone.iter().map(|lease| parsed(lease)).collect()
}

async fn cancel(connection: &mut SqliteConnection, id: JobId, keep_ms: i64, now: i64) -> Outcome<Option<Cancelled>> {
    let Some(job) = record(connection, id).await? else { return Ok(None) };
    let before = job.state;
    if before.is_final() {
        return Ok(Some(Cancelled { job, before, unwanted: None }));
    }
    sqlx::query(
        "UPDATE precut_jobs SET state = 'cancelled', lease = NULL, heartbeat_ms = NULL, stage = NULL, finished_ms = ?2,
             expires_ms = ?3 WHERE id = ?1",
    )
    .bind(id.to_string())
    .bind(now)
    .bind(now.saturating_add(keep_ms))
    .execute(&mut *connection)
    .await?;
    let unwanted = match job.lease {
        Some(lease) => unwanted(connection, &[lease.to_string()]).await?.pop(),
        None => None,
    };
    let job = record(connection, id).await?.ok_or(sqlx::Error::RowNotFound)?;
    Ok(Some(Cancelled { job, before, unwanted }))
}

async fn redo(connection: &mut SqliteConnection, id: JobId) -> Outcome<()> {
    let back: Vec<String> = sqlx::query_scalar(
        "UPDATE precut_jobs SET state = 'queued', attempt = 0, progress = 0.0, started_ms = NULL, finished_ms = NULL,
             expires_ms = NULL, deadline_ms = NULL
         WHERE id = ?1 AND state = 'succeeded'
             AND NOT EXISTS (SELECT 1 FROM results WHERE results.key = precut_jobs.key) RETURNING id",
    )
    .bind(id.to_string())
    .fetch_all(&mut *connection)
    .await?;
    queue::push(connection, &back).await
}

async fn beat(connection: &mut SqliteConnection, beats: &[Beat], now: i64) -> Outcome<Vec<Lease>> {
    for beat in beats {
        sqlx::query(
            "UPDATE precut_jobs SET heartbeat_ms = ?2, progress = ?3, stage = ?4 WHERE lease = ?1 AND state = 'running'",
        )
        .bind(beat.lease.to_string())
        .bind(now)
        .bind(beat.progress)
        .bind(&beat.stage)
        .execute(&mut *connection)
        .await?;
    }
    let leases: Vec<String> = beats.iter().map(|beat| beat.lease.to_string()).collect();
    unwanted(connection, &leases).await
}

async fn expire_deadlines(
    connection: &mut SqliteConnection,
    problem: &str,
    keep_ms: i64,
    now: i64,
) -> Outcome<(Changed, Option<i64>)> {
    let late: Vec<(String, Option<String>)> = sqlx::query_as(
        "SELECT id, lease FROM precut_jobs INDEXED BY precut_jobs_by_deadline
         WHERE deadline_ms IS NOT NULL AND deadline_ms <= ?1 AND state IN ('queued', 'running')",
    )
    .bind(now)
    .fetch_all(&mut *connection)
    .await?;
    for (id, _) in &late {
        sqlx::query(
            "UPDATE precut_jobs SET state = 'failed', problem = ?2, lease = NULL, heartbeat_ms = NULL, stage = NULL,
                 finished_ms = ?3, expires_ms = ?4 WHERE id = ?1",
        )
        .bind(id)
        .bind(problem)
        .bind(now)
        .bind(now.saturating_add(keep_ms))
        .execute(&mut *connection)
        .await?;
    }
    let jobs = late.iter().map(|(id, _)| parsed(id)).collect::<Outcome<Vec<JobId>>>()?;
    let leases: Vec<String> = late.into_iter().filter_map(|(_, lease)| lease).collect();
    let unwanted = if leases.is_empty() { Vec::new() } else { unwanted(connection, &leases).await? };
    let next = sqlx::query_scalar(
        "SELECT min(deadline_ms) FROM precut_jobs INDEXED BY precut_jobs_by_deadline
         WHERE deadline_ms IS NOT NULL AND state IN ('queued', 'running')",
    )
    .fetch_one(connection)
    .await?;
    Ok((Changed { jobs, unwanted }, next))
}

async fn sweep(connection: &mut SqliteConnection, live: &[Lease]) -> Outcome<Vec<JobId>> {
    let stale: Vec<String> = sqlx::query_scalar(
        "SELECT DISTINCT lease FROM precut_jobs
         WHERE state = 'running' AND lease NOT IN (SELECT value FROM json_each(?1))",
    )
    .bind(json_list(live))
    .fetch_all(&mut *connection)
    .await?;
    let mut back = if stale.is_empty() { Vec::new() } else { requeue(connection, &json_list(&stale), true).await? };
    back.extend(ids(&queue::push_lost(connection).await?)?);
    Ok(back)
}

async fn forget_expired(connection: &mut SqliteConnection, keep_ms: i64, now: i64) -> Outcome<u64> {
    // First the input, then, much later, the record: that a job was there is known longer than what it gave.
    sqlx::query(
        "UPDATE precut_jobs SET input = x'', idempotency = NULL, body_hash = NULL
         WHERE id IN (SELECT id FROM precut_jobs WHERE expires_ms <= ?1 AND length(input) > 0 LIMIT ?2)",
    )
    .bind(now)
    .bind(FORGOTTEN_AT_ONCE)
    .execute(&mut *connection)
    .await?;
    let gone =
        sqlx::query("DELETE FROM precut_jobs WHERE id IN (SELECT id FROM precut_jobs WHERE expires_ms <= ?1 LIMIT ?2)")
            .bind(now.saturating_sub(keep_ms.saturating_mul(TOMBSTONE)))
            .bind(FORGOTTEN_AT_ONCE)
            .execute(connection)
            .await?;
    Ok(gone.rows_affected())
}

async fn note_timing(connection: &mut SqliteConnection, timing: &Timing, now: i64) -> Outcome<()> {
    sqlx::query(
        "INSERT INTO timings (calculator, version, predicted_ms, actual_ms, at_ms) VALUES (?1, ?2, ?3, ?4, ?5)",
    )
    .bind(&timing.calculator)
    .bind(timing.version)
    .bind(timing.predicted_ms)
    .bind(timing.actual_ms)
    .bind(now)
    .execute(&mut *connection)
    .await?;
    sqlx::query(
        "DELETE FROM timings WHERE calculator = ?1 AND at_ms < (
             SELECT at_ms FROM timings WHERE calculator = ?1 ORDER BY at_ms DESC LIMIT 1 OFFSET ?2)",
    )
    .bind(&timing.calculator)
    .bind(TIMINGS)
    .execute(connection)
    .await?;
    Ok(())
}

/// What the process before left behind: its running jobs go back in line, and the queue is made anew from the records.
pub(super) async fn recover(pool: &SqlitePool) -> Outcome<u64> {
    let mut transaction = pool.begin_with("BEGIN IMMEDIATE").await?;
    let orphans: Vec<String> = sqlx::query_scalar("SELECT DISTINCT lease FROM precut_jobs WHERE state = 'running'")
        .fetch_all(&mut *transaction)
        .await?;
    queue::empty(&mut transaction).await?;
    let mut count = 0;
    if !orphans.is_empty() {
        count = requeue(&mut transaction, &json_list(&orphans), true).await?.len();
    }
    queue::push_lost(&mut transaction).await?;
    transaction.commit().await?;
    Ok(count as u64)
}

impl SqliteStore {
    async fn finish_job(&self, lease: Lease, ending: Ending) -> Result<Vec<JobId>, StoreError> {
        let keep_ms = self.keep_ms;
        let ending = Arc::new(packed_ending(ending).await?);
        let written = Arc::clone(&ending);
        let jobs = self
            .ledger
            .write(move |connection| {
                let ending = Arc::clone(&ending);
                Box::pin(async move { finish(connection, lease, &ending, keep_ms, now_ms()).await })
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
                Box::pin(async move { submit(connection, &packed, queue_limit, keep_ms, now_ms()).await })
            })
            .await?;
        if let (Accepted::New(_), Some(row)) = (&accepted, &written.result) {
            self.kept(&row.key, row.bytes());
        }
        self.tasks.wake();
        Ok(accepted)
    }

    async fn list_jobs(&self, query: JobQuery) -> Result<JobPage, StoreError> {
        let mut statement = QueryBuilder::<Sqlite>::new(concat!("SELECT ", columns!(), " FROM precut_jobs WHERE true"));
        if let Some(state) = query.state {
            statement.push(" AND state = ").push_bind(state.word());
        }
        if let Some(calculator) = query.calculator {
            statement.push(" AND calculator = ").push_bind(calculator);
        }
        if let Some(before) = query.before {
            statement.push(" AND id < ").push_bind(before.to_string());
        }
        // One more than asked for tells whether there is another page.
        statement.push(" ORDER BY id DESC LIMIT ").push_bind(i64::from(query.limit) + 1);
        let rows: Vec<RecordRow> = statement.build_query_as().fetch_all(&self.readers).await?;
        let mut items = rows.into_iter().map(RecordRow::record).collect::<Outcome<Vec<_>>>()?;
        let more = items.len() > query.limit as usize;
        items.truncate(query.limit as usize);
        let next = items.last().filter(|_| more).map(|last| last.id);
        Ok(JobPage { items, next })
    }

    async fn count_jobs(&self) -> Result<JobCounts, StoreError> {
        let count = |state: &'static str| async move {
            let count: i64 = sqlx::query_scalar("SELECT count(*) FROM precut_jobs WHERE state = ?1")
                .bind(state)
                .fetch_one(&self.readers)
                .await?;
            Ok::<_, StoreError>(u64::try_from(count).unwrap_or(0))
        };
        Ok(JobCounts { queued: count("queued").await?, running: count("running").await? })
    }
}

impl JobStore for SqliteStore {
    fn submit(&self, job: NewJob, queue_limit: u64) -> BoxFuture<'_, Result<Accepted, StoreError>> {
        Box::pin(self.submit_job(job, queue_limit))
    }
    fn job(&self, id: JobId) -> BoxFuture<'_, Result<Option<JobRecord>, StoreError>> {
        Box::pin(async move {
            let mut reader = self.readers.acquire().await?;
            Ok(record(&mut reader, id).await?)
        })
    }
    fn jobs(&self, query: JobQuery) -> BoxFuture<'_, Result<JobPage, StoreError>> {
        Box::pin(self.list_jobs(query))
    }
    fn counts(&self) -> BoxFuture<'_, Result<JobCounts, StoreError>> {
        Box::pin(self.count_jobs())
    }
    fn waiting_attempts(&self, id: JobId) -> BoxFuture<'_, Result<Option<u32>, StoreError>> {
        Box::pin(async move {
            let attempts = sqlx::query_scalar(
                "SELECT max(other.attempt) FROM precut_jobs AS one JOIN precut_jobs AS other USING (key)
                 WHERE one.id = ?1 AND one.state = 'queued' AND other.state = 'queued'",
            )
            .bind(id.to_string())
            .fetch_one(&self.readers)
            .await?;
            Ok(attempts)
        })
    }
    fn claim(&self, id: JobId, lease: Lease, most: u32, problem: String) -> BoxFuture<'_, Result<Claimed, StoreError>> {
        let keep_ms = self.keep_ms;
        Box::pin(self.ledger.write(move |connection| {
            let problem = problem.clone();
            Box::pin(async move { claim(connection, id, lease, (most, &problem), keep_ms, now_ms()).await })
        }))
    }
    fn finish(&self, lease: Lease, ending: Ending) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        Box::pin(self.finish_job(lease, ending))
    }
    fn release(&self, lease: Lease) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        Box::pin(
            self.ledger.write(move |connection| {
                Box::pin(async move { requeue(connection, &json_list(&[lease]), false).await })
            }),
        )
    }
    fn cancel(&self, id: JobId) -> BoxFuture<'_, Result<Option<Cancelled>, StoreError>> {
        let keep_ms = self.keep_ms;
        Box::pin(
            self.ledger
                .write(move |connection| Box::pin(async move { cancel(connection, id, keep_ms, now_ms()).await })),
        )
    }
    fn redo(&self, id: JobId) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async move {
            self.ledger.write(move |connection| Box::pin(redo(connection, id))).await?;
            self.tasks.wake();
            Ok(())
        })
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
        Box::pin(async move {
            let back = self
                .ledger
                .write(move |connection| {
                    let live = Arc::clone(&live);
                    // Asked here, where no claim can come between asking and looking.
                    Box::pin(async move { sweep(connection, &live()).await })
                })
                .await?;
            if !back.is_empty() {
                self.tasks.wake();
            }
            Ok(back)
        })
    }
    fn forget_expired(&self) -> BoxFuture<'_, Result<u64, StoreError>> {
        let keep_ms = self.keep_ms;
        Box::pin(self.ledger.write(move |connection| {
            Box::pin(async move {
                queue::forget_done(connection).await?;
                forget_expired(connection, keep_ms, now_ms()).await
            })
        }))
    }
    fn note_timing(&self, timing: Timing) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.ledger.write(move |connection| {
            let timing = timing.clone();
            Box::pin(async move { note_timing(connection, &timing, now_ms()).await })
        }))
    }
    fn timings(&self, limit: u32) -> BoxFuture<'_, Result<Vec<Timing>, StoreError>> {
        Box::pin(async move {
            let rows: Vec<(String, u32, f64, f64)> = sqlx::query_as(
                "SELECT calculator, version, predicted_ms, actual_ms FROM timings ORDER BY at_ms DESC LIMIT ?1",
            )
            .bind(limit)
            .fetch_all(&self.readers)
            .await?;
            let timing = |(calculator, version, predicted_ms, actual_ms)| Timing {
                calculator,
                version,
                predicted_ms,
                actual_ms,
            };
            Ok(rows.into_iter().map(timing).collect())
        })
    }
    fn work(&self, places: usize, run: RunTask, stop: watch::Receiver<bool>) -> BoxFuture<'static, ()> {
        Box::pin(Tasks::work(self.tasks.clone(), places, run, stop))
    }
}

impl SqliteStore {
    /// A result was written beside the group writer.
    fn kept(&self, key: &[u8], bytes: i64) {
        self.keys.add(key);
        self.writer.added(bytes);
    }
}
