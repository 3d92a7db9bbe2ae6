//! Results and jobs in a PostgreSQL database that any number of processes share.
//!
//! What one connection that writes does for the SQLite file, locks do here: whoever changes who computes a key holds the
//! lock of that key ([`lock`]) until the transaction ends. All times are the database's ([`clock::Clock`]), so that the clocks
//! of the processes need not agree. What a process does is told to the others by notifications ([`news`]); one that is
//! lost costs at most a second, as everything is looked at again.

mod callbacks;
mod care;
mod clock;
mod jobs;
mod news;
mod results;
mod run;
mod start;
#[cfg(test)]
mod tests;
mod tls;
mod writer;

use std::sync::Arc;
use std::time::Duration;

use futures_util::future::BoxFuture;
use sqlx::postgres::{PgConnection, PgPool, Postgres};

use super::address::Secret;
use super::behind::Writer;
use super::common::results::WritesBehind;
use super::jobs::{Lease, SILENCE};
use super::sql::{Outcome, Reads, Session as _, Statement, Writes};
use super::sqlite::Keep;
use super::{OpenError, StoreError};
use crate::key::Key;
use clock::Clock;
use news::Newsroom;
pub(super) use news::tell;
use run::Taker;
use writer::PostgresClerk;

/// How long to wait for what.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patience {
    /// For a database that does not answer at the start.
    pub(crate) start: Duration,
    /// A computation that says nothing for so long has lost its lease.
    pub(crate) lease: Duration,
    /// So long after a start of the database nobody is taken for dead: nobody could say that he lives before.
    pub(crate) grace: Duration,
    /// Between two looks for jobs of versions that nobody runs any more; so often a worker says that it lives.
    pub(crate) adoption: Duration,
    /// A shard of a study waits so long for the results of its points to be written.
    pub(crate) points: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self {
            start: Duration::from_secs(10),
            lease: SILENCE,
            grace: Duration::from_secs(8),
            adoption: Duration::from_secs(5),
            points: Duration::from_secs(5),
        }
    }
}

/// How a process uses the database.
#[derive(Debug, Clone)]
pub(crate) struct Use {
    /// How much is kept, and how long.
    pub(crate) keep: Keep,
    /// Connections at most, the one that listens for news not counted.
    pub(crate) connections: u32,
    /// How long to wait for what.
    pub(crate) patience: Patience,
    /// Version of the program: whose jobs it runs.
    pub(crate) engine: String,
    /// Whether it runs any.
    pub(crate) works: bool,
}

/// Results and jobs in a PostgreSQL database.
pub(crate) struct PostgresStore {
    pool: PgPool,
    writer: Writer,
    newsroom: Newsroom,
    clock: Arc<Clock>,
    /// What this process is called among those that run jobs.
    worker: Lease,
    keep_ms: i64,
    engine: String,
    works: bool,
    patience: Patience,
    looked: std::sync::Mutex<Option<tokio::time::Instant>>,
}

impl PostgresStore {
    /// Connects, brings the tables up to date and looks after what this process takes on.
    pub(crate) async fn open(address: &Secret, usage: Use) -> Result<Self, OpenError> {
        let pool = start::connected(address, &usage).await?;
        let clock = Arc::new(Clock::new());
        clock.read(&pool).await.map_err(|error| start::refused(&error))?;
        let keep_ms = i64::try_from(usage.keep.jobs.as_millis()).unwrap_or(i64::MAX / 4);
        Ok(Self {
            writer: Writer::start(PostgresClerk {
                pool: pool.clone(),
                clock: Arc::clone(&clock),
                keep: usage.keep,
                unlooked_bytes: 0,
            }),
            newsroom: Newsroom::open(pool.clone()),
            worker: Lease::new(),
            clock,
            keep_ms,
            engine: usage.engine,
            patience: usage.patience,
            works: usage.works,
            looked: std::sync::Mutex::default(),
            pool,
        })
    }

    fn taker(&self) -> Taker {
        let silence_ms = i64::try_from(self.patience.lease.as_millis()).unwrap_or(i64::MAX);
        Taker { engine: self.engine.clone(), silence_ms }
    }

    /// Does `work` in a transaction.
    async fn write<T: Send>(
        &self,
        work: impl for<'c> FnOnce(&'c mut PgConnection) -> BoxFuture<'c, Outcome<T>> + Send,
    ) -> Result<T, StoreError> {
        let mut transaction = self.pool.begin().await?;
        let value = work(&mut transaction).await?;
        transaction.commit().await?;
        Ok(value)
    }
}

impl Reads for PostgresStore {
    type Database = Postgres;
    fn readers(&self) -> &PgPool {
        &self.pool
    }
}

impl Writes for PostgresStore {
    fn write<T: Send + 'static>(
        &self,
        work: impl for<'c> Fn(&'c mut PgConnection) -> BoxFuture<'c, Outcome<T>> + Send + Sync + 'static,
    ) -> BoxFuture<'_, Result<T, StoreError>> {
        Box::pin(self.write(move |connection| work(connection)))
    }
    fn keep_ms(&self) -> i64 {
        self.keep_ms
    }
    fn run(&self, statement: Statement) -> BoxFuture<'_, Result<u64, StoreError>> {
        Box::pin(async move { Ok(self.reader().await?.run(statement).await?) })
    }
}

impl WritesBehind for PostgresStore {
    fn writer(&self) -> &Writer {
        &self.writer
    }
    fn shut(&self) -> BoxFuture<'_, ()> {
        Box::pin(async {
            self.writer.close().await;
            self.newsroom.close();
            self.pool.close().await;
        })
    }
}

/// The lock of a key, as the function `lock_of` makes it.
fn lock_of(key: &Key) -> i64 {
    key.as_bytes().first_chunk().map_or(0, |bytes| i64::from_be_bytes(*bytes))
}

/// Leases and ids as they stand in columns.
fn texts<T: std::fmt::Display>(items: &[T]) -> Vec<String> {
    items.iter().map(ToString::to_string).collect()
}

/// Takes the lock of a key until the transaction ends. What is read afterwards is as whoever had it before left it.
async fn lock(connection: &mut PgConnection, key: &Key) -> Outcome<i64> {
    let (now,): (i64,) = sqlx::query_as("SELECT now_ms() FROM pg_advisory_xact_lock($1)")
        .bind(lock_of(key))
        .fetch_one(connection)
        .await?;
    Ok(now)
}
