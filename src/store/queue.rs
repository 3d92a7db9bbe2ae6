//! The queue: apalis in the same file. A task names a job and nothing else.
//!
//! What is used of it: tasks in an order (priority first), workers that take them, so many at a time. What is not:
//! its counting of attempts (a task whose process dies is handed out without end) and its retries (at once); a
//! handler therefore answers `Ok` whatever came of the job, and the records say what is to be done again.

use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use apalis::prelude::{
    PollSnapshot, PollStrategy, PollWith, TaskBuilder, WorkerBuilder, WorkerBuilderExt, WorkerContext, WorkerError,
};
use apalis_sqlite::{Config, SqliteStorage};
use futures_util::future::BoxFuture;
use futures_util::task::AtomicWaker;
use sqlx::migrate::Migrator;
use sqlx::sqlite::{SqliteConnection, SqlitePool};
use tokio::sync::watch;
use uuid::Uuid;

use super::jobs::{JobId, RunTask};
use super::now_ms;

/// Name of the queue.
const QUEUE: &str = "precut";
/// How often the worker says that it lives. One process serves a folder, and at its start the queue is made anew: the
/// sign of life is for those who look at the table, and each costs a flush of the disk.
const HEARTBEAT: Duration = Duration::from_secs(10);
const MISSED_HEARTBEATS: usize = 3;
/// Never reached: the records count.
const ATTEMPTS: usize = 1_000_000;
/// How long a task that is done is kept.
const DONE_FOR_S: i64 = 60;
/// Pause after the queue failed.
const PAUSE: Duration = Duration::from_secs(1);
/// When a task may run: long ago. The queue would count seconds by the clock as it is when a task is pushed, and hold it
/// back for as long as the clock is set back after that.
const AT_ONCE_S: u64 = 1;
/// Places in the order of one priority.
const TURNS: i64 = 1 << 40;

/// The queue's own tables.
pub(super) fn migrations() -> Migrator {
    SqliteStorage::migrations()
}

fn failed(error: apalis_sqlite::Error) -> sqlx::Error {
    match error {
        apalis_sqlite::Error::Database(error) => error,
        other => sqlx::Error::Decode(other.into()),
    }
}

/// Gives each of these waiting jobs a task.
pub(super) async fn push(connection: &mut SqliteConnection, jobs: &[String]) -> Result<(), sqlx::Error> {
    for job in jobs {
        let pushed: Option<(i64, i64, i64)> =
            sqlx::query_as("UPDATE precut_jobs SET pushed = pushed + 1 WHERE id = ?1 RETURNING pushed, priority, turn")
                .bind(job)
                .fetch_optional(&mut *connection)
                .await?;
        let Some((pushed, priority, turn)) = pushed else { continue };
        // The queue takes the highest number first.
        let rank = priority * TURNS + (TURNS - 1 - turn.clamp(0, TURNS - 1));
        let message = serde_json::to_vec(job).map_err(|error| sqlx::Error::Encode(error.into()))?;
        let task = TaskBuilder::new(message)
            .priority(usize::try_from(rank).unwrap_or(0))
            .max_attempts(ATTEMPTS)
            .run_at_timestamp(AT_ONCE_S)
            .idempotency_key(format!("{job}:{pushed}"))
            .build();
        apalis_sqlite::queries::push_tasks(&mut *connection, QUEUE, &[task]).await.map_err(failed)?;
    }
    Ok(())
}

/// Gives a task to every job that waits and has none; which these are.
pub(super) async fn push_lost(connection: &mut SqliteConnection) -> Result<Vec<String>, sqlx::Error> {
    let lost: Vec<String> = sqlx::query_scalar(
        "SELECT id FROM precut_jobs WHERE state = 'queued' AND NOT EXISTS (
             SELECT 1 FROM Jobs WHERE job_type = ?1 AND idempotency_key = precut_jobs.id || ':' || precut_jobs.pushed
             AND status IN ('Pending', 'Queued', 'Running'))
         ORDER BY priority DESC, turn, id",
    )
    .bind(QUEUE)
    .fetch_all(&mut *connection)
    .await?;
    push(connection, &lost).await?;
    Ok(lost)
}

/// Forgets every task and worker: nobody works.
pub(super) async fn empty(connection: &mut SqliteConnection) -> Result<(), sqlx::Error> {
    sqlx::query("DELETE FROM Jobs WHERE job_type = ?1").bind(QUEUE).execute(&mut *connection).await?;
    sqlx::query("DELETE FROM Workers WHERE worker_type = ?1").bind(QUEUE).execute(connection).await?;
    Ok(())
}

/// Forgets tasks that are done.
pub(super) async fn forget_done(connection: &mut SqliteConnection) -> Result<(), sqlx::Error> {
    sqlx::query("DELETE FROM Jobs WHERE job_type = ?1 AND status IN ('Done', 'Killed', 'Failed') AND done_at < ?2")
        .bind(QUEUE)
        .bind(now_ms() / 1000 - DONE_FOR_S)
        .execute(connection)
        .await?;
    Ok(())
}

/// The tasks of a file.
#[derive(Clone)]
pub(super) struct Tasks {
    pool: SqlitePool,
    bell: Arc<AtomicWaker>,
}

impl Tasks {
    pub(super) fn new(pool: SqlitePool) -> Self {
        Self { pool, bell: Arc::default() }
    }

    /// The connection that writes.
    #[cfg(test)]
    pub(super) fn pool(&self) -> SqlitePool {
        self.pool.clone()
    }

    /// There may be new tasks.
    pub(super) fn wake(&self) {
        self.bell.wake();
    }

    /// Takes tasks until told to stop; a worker that failed, as it does where the database does not answer, is
    /// followed by another.
    pub(super) async fn work(self, places: usize, run: RunTask, stop: watch::Receiver<bool>) {
        while !*stop.borrow() {
            let context = WorkerContext::new(&format!("precut-{}", Uuid::now_v7().simple()));
            let mut working = self.worker(&context, places, Arc::clone(&run));
            let ended = tokio::select! {
                ended = &mut working => Some(ended),
                () = stopped(stop.clone()) => {
                    // A worker that has not begun yet cannot be stopped, and need not.
                    if context.stop().is_ok() { Some(working.await) } else { None }
                }
            };
            if let Some(Err(error)) = ended {
                tracing::warn!(%error, "the queue failed; it is taken up again");
                metrics::counter!("precut_store_failures_total", "operation" => "queue").increment(1);
            }
            if *stop.borrow() {
                break;
            }
            let _ = tokio::time::timeout(PAUSE, stopped(stop.clone())).await;
        }
    }

    fn worker(
        &self,
        context: &WorkerContext,
        places: usize,
        run: RunTask,
    ) -> BoxFuture<'static, Result<(), WorkerError>> {
        let config = Config::default()
            .queue(QUEUE)
            .batch_size(1)
            .heartbeat_interval(HEARTBEAT)
            .missed_heartbeats(MISSED_HEARTBEATS);
        let storage = SqliteStorage::<String>::new(&self.pool).with_config(config);
        let backend = PollWith::new(storage, Bell(Arc::clone(&self.bell)));
        let worker = WorkerBuilder::new(context).backend(backend).concurrency(places).build(move |job: String| {
            let run = Arc::clone(&run);
            async move {
                match job.parse::<JobId>() {
                    // A task of its own: it goes on where the worker fails.
                    Ok(job) => drop(tokio::spawn(run(job)).await),
                    Err(error) => tracing::error!(job, %error, "a task names no job"),
                }
            }
        });
        Box::pin(worker.run())
    }
}

/// Boxed, as the compiler cannot see through both futures at once that they may be sent.
pub(super) fn stopped(mut stop: watch::Receiver<bool>) -> BoxFuture<'static, ()> {
    // A sender that is gone means stop as well.
    Box::pin(async move { drop(stop.wait_for(|stop| *stop).await) })
}

/// Wakes the worker when a task was pushed.
struct Bell(Arc<AtomicWaker>);

impl PollStrategy for Bell {
    fn poll_drive(&mut self, context: &mut Context<'_>, _snapshot: &PollSnapshot) -> Poll<Option<()>> {
        // Before the queue is looked at: what is pushed afterwards rings.
        self.0.register(context.waker());
        Poll::Pending
    }
}
