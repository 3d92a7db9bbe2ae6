//! The queue: apalis in the same database, in its schema `apalis`. A task names a job and nothing else.
//!
//! What is used of it: tasks in an order (priority first), workers on all machines that take them (`SKIP LOCKED`), so
//! many at a time each. What is not: its counting of attempts, its retries, and its listener, which ends at the first
//! loss of its connection; the [`Newsroom`](super::news::Newsroom) rings the bell instead, and every second in any case.
//!
//! Every version of the program has a queue of its own: in the middle of an upgrade an old worker does not take a job
//! that it cannot read. What an old version left behind is taken over ([`adopt`](super::care)).

use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use apalis::prelude::{
    PollSnapshot, PollStrategy, PollWith, TaskBuilder, WorkerBuilder, WorkerBuilderExt, WorkerContext, WorkerError,
};
use apalis_postgres::{Config, PostgresStorage};
use futures_util::future::BoxFuture;
use futures_util::task::AtomicWaker;
use sqlx::migrate::Migrator;
use sqlx::postgres::{PgConnection, PgPool};
use tokio::sync::watch;
use uuid::Uuid;

use crate::store::jobs::{JobId, RunTask};
use crate::store::queue::stopped;

/// Queues are called so, with the version behind it.
pub(super) const QUEUES: &str = "precut/";
/// How often a worker says that it lives, and how often it may fail to before its tasks are given to others.
const HEARTBEAT: Duration = Duration::from_secs(2);
const MISSED_HEARTBEATS: usize = 3;
/// Never reached: the records count.
const ATTEMPTS: usize = 1_000_000;
/// Pause after the queue failed.
const PAUSE: Duration = Duration::from_secs(1);
/// Places in the order of one priority: three priorities have to fit into the 31 bits that the queue has.
const TURNS: i64 = 1 << 29;
/// When a task may run: long ago. The queue would count seconds by the clock of whoever pushes it, and hold a task back
/// for as long as that is ahead of the database's.
const AT_ONCE_S: u64 = 1;

/// The queue of a version.
pub(super) fn name(engine: &str) -> String {
    format!("{QUEUES}{engine}")
}

/// The queue's own tables.
pub(super) fn migrations() -> Migrator {
    PostgresStorage::<()>::migrations()
}

fn failed(error: apalis_postgres::Error) -> sqlx::Error {
    match error {
        apalis_postgres::Error::Database(error) => error,
        other => sqlx::Error::Decode(other.into()),
    }
}

/// The place of a task in the queue, which takes the highest number first. The last place of a priority is behind all
/// turns.
fn rank(priority: i32, turn: Option<i64>) -> usize {
    let turn = turn.map_or(TURNS - 1, |turn| turn.clamp(0, TURNS - 2));
    usize::try_from(i64::from(priority) * TURNS + (TURNS - 1 - turn)).unwrap_or(0)
}

/// A job's task under a name that was not used before.
pub(super) struct Task<'j> {
    pub(super) job: &'j str,
    pub(super) name: String,
    pub(super) priority: i32,
    /// `None`: behind all others of its priority.
    pub(super) turn: Option<i64>,
}

/// Adds tasks.
pub(super) async fn add(connection: &mut PgConnection, engine: &str, tasks: &[Task<'_>]) -> Result<(), sqlx::Error> {
    if tasks.is_empty() {
        return Ok(());
    }
    let mut built = Vec::with_capacity(tasks.len());
    for task in tasks {
        let message = serde_json::to_vec(task.job).map_err(|error| sqlx::Error::Encode(error.into()))?;
        built.push(
            TaskBuilder::new(message)
                .priority(rank(task.priority, task.turn))
                .max_attempts(ATTEMPTS)
                .run_at_timestamp(AT_ONCE_S)
                .idempotency_key(task.name.clone())
                .build(),
        );
    }
    apalis_postgres::queries::push_tasks(connection, &name(engine), built).await.map_err(failed)
}

/// The name of a job's task.
pub(super) fn task_name(job: &str, pushed: i32) -> String {
    format!("{job}:{pushed}")
}

/// Gives each of these waiting jobs a task.
pub(super) async fn push(connection: &mut PgConnection, jobs: &[String]) -> Result<(), sqlx::Error> {
    if jobs.is_empty() {
        return Ok(());
    }
    let pushed: Vec<(String, i32, i32, i64, String)> = sqlx::query_as(
        "UPDATE precut.jobs SET pushed = pushed + 1 WHERE id = ANY($1) AND state = 'queued'
         RETURNING id, pushed, priority, turn, engine",
    )
    .bind(jobs)
    .fetch_all(&mut *connection)
    .await?;
    let mut engines: Vec<&str> = pushed.iter().map(|(.., engine)| engine.as_str()).collect();
    engines.sort_unstable();
    engines.dedup();
    for engine in engines {
        let tasks: Vec<Task<'_>> = pushed
            .iter()
            .filter(|(.., of)| of == engine)
            .map(|(job, pushed, priority, turn, _)| Task {
                job,
                name: task_name(job, *pushed),
                priority: *priority,
                turn: Some(*turn),
            })
            .collect();
        add(connection, engine, &tasks).await?;
    }
    Ok(())
}

/// The tasks of one version.
#[derive(Clone)]
pub(super) struct Tasks {
    pool: PgPool,
    queue: String,
    bell: Arc<AtomicWaker>,
}

impl Tasks {
    pub(super) fn new(pool: PgPool, engine: &str) -> Self {
        Self { pool, queue: name(engine), bell: Arc::default() }
    }

    /// Rung when there may be new tasks.
    pub(super) fn bell(&self) -> Arc<AtomicWaker> {
        Arc::clone(&self.bell)
    }

    /// There may be new tasks.
    pub(super) fn wake(&self) {
        self.bell.wake();
    }

    /// Takes tasks until told to stop; a worker that failed, as it does where the database does not answer, is followed
    /// by another.
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
            .queue(&self.queue)
            .batch_size(1)
            .heartbeat_interval(HEARTBEAT)
            .missed_heartbeats(MISSED_HEARTBEATS)
            // Taking it is enough: this would only write down that its handler has begun.
            .lock_tasks(false);
        let storage = PostgresStorage::<String>::new(&self.pool).with_config(config);
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

/// Wakes the worker when a task was pushed.
struct Bell(Arc<AtomicWaker>);

impl PollStrategy for Bell {
    fn poll_drive(&mut self, context: &mut Context<'_>, _snapshot: &PollSnapshot) -> Poll<Option<()>> {
        // Before the queue is looked at: what is pushed afterwards rings.
        self.0.register(context.waker());
        Poll::Pending
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_fit_and_keep_their_order() {
        let line = [
            rank(2, Some(0)),
            rank(2, Some(1)),
            rank(2, Some(i64::MAX)),
            rank(2, None),
            rank(1, Some(0)),
            rank(0, Some(7)),
            rank(0, None),
        ];
        assert!(line.is_sorted_by(|before, after| before > after), "{line:?}");
        assert!(i32::try_from(line[0]).is_ok());
    }
}
