//! Results and jobs in an SQLite file: one connection writes, four read.

use std::collections::HashSet;
use std::fs::{self, File, TryLockError};
use std::path::Path;
use std::sync::atomic::AtomicI64;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use futures_util::future::BoxFuture;
use sqlx::migrate::{MigrateError, Migrator};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteConnection, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{Connection, Sqlite};

use super::OpenError;
use super::StoreError;
use super::behind::Writer;
use super::common::results::WritesBehind;
use super::ledger::Ledger;
use super::sql::{Outcome, Reads, Session as _, Statement, Writes};
use super::sqlite_jobs;
use super::writer::{Limits, SqliteClerk};
use crate::key::Key;

#[derive(rust_embed::RustEmbed)]
#[folder = "migrations"]
struct Migrations;

pub(super) fn migrations() -> Migrator {
    super::migrations::embedded::<Migrations>()
}

pub(super) const DATABASE: &str = "precut.db";
const LOCK: &str = "precut.lock";
const READERS: u32 = 4;
pub(super) const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// How much is kept, and how long.
#[derive(Debug, Clone, Copy)]
pub struct Keep {
    /// Results, bytes, about.
    pub bytes: u64,
    /// Results that nobody asks for.
    pub age: Duration,
    /// Finished jobs with what they gave.
    pub jobs: Duration,
}

/// Results and jobs in an SQLite file in a folder that no other process uses.
pub struct SqliteStore {
    pub(super) readers: SqlitePool,
    pub(super) writer: Writer,
    pub(super) ledger: Ledger,
    #[cfg(test)]
    pub(super) writing: SqlitePool,
    pub(super) keys: Keys,
    /// Size of the results that are written.
    pub(super) result_bytes: Arc<AtomicI64>,
    pub(super) keep_ms: i64,
    _lock: File,
}

/// Which results there are, by eight bytes of their keys: a job that is new does not ask the disk.
#[derive(Clone, Default)]
pub(super) struct Keys(Arc<RwLock<HashSet<u64>>>);

impl Keys {
    fn short(key: &[u8]) -> u64 {
        key.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes))
    }
    /// Whether the key may be there; `false` is certain.
    fn may_have(&self, key: &Key) -> bool {
        self.0.read().unwrap_or_else(PoisonError::into_inner).contains(&Self::short(key.as_bytes()))
    }
    pub(super) fn add(&self, key: &[u8]) {
        self.0.write().unwrap_or_else(PoisonError::into_inner).insert(Self::short(key));
    }
    pub(super) fn remove(&self, key: &[u8]) {
        self.0.write().unwrap_or_else(PoisonError::into_inner).remove(&Self::short(key));
    }
}

impl SqliteStore {
    /// Opens the database in `folder`, which is made if absent. What a process before left running is back in line.
    pub async fn open(folder: &Path, keep: Keep) -> Result<Self, OpenError> {
        let unusable = |reason: String| OpenError::Unusable { folder: folder.to_owned(), reason };
        fs::create_dir_all(folder).map_err(|error| unusable(error.to_string()))?;
        let lock = lock(folder)?;
        let options = SqliteConnectOptions::new()
            .filename(folder.join(DATABASE))
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            // With NORMAL a power cut would lose what was acknowledged.
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(BUSY_TIMEOUT)
            .foreign_keys(true);
        let failed = |error: sqlx::Error| unusable(error.to_string());
        let writing = SqlitePoolOptions::new()
            .max_connections(1)
            .acquire_timeout(2 * BUSY_TIMEOUT)
            // On a full disk SQLite rolls back by itself, and the driver, which wants to as well, takes the
            // transaction for open ever after: such a connection is replaced.
            .before_acquire(|connection, _| Box::pin(async move { Ok(!connection.is_in_transaction()) }))
            .connect_with(writing(&options))
            .await
            .map_err(failed)?;
        migrate(&writing).await.map_err(unusable)?;
        let orphans = sqlite_jobs::recover(&writing).await.map_err(failed)?;
        if orphans > 0 {
            tracing::warn!(jobs = orphans, "jobs were running when the process before ended; they run again");
        }
        let readers = SqlitePoolOptions::new()
            .max_connections(READERS)
            .acquire_timeout(BUSY_TIMEOUT)
            .connect_with(options.create_if_missing(false).pragma("query_only", "ON"))
            .await
            .map_err(failed)?;
        let keys = Keys::default();
        let all: Vec<Vec<u8>> = sqlx::query_scalar("SELECT key FROM results INDEXED BY results_by_use")
            .fetch_all(&readers)
            .await
            .map_err(failed)?;
        for key in &all {
            keys.add(key);
        }
        let limits = Limits { bytes: i64::try_from(keep.bytes).unwrap_or(i64::MAX), age: keep.age };
        let ledger = Ledger::start(writing.clone());
        let result_bytes = Arc::default();
        let clerk = SqliteClerk::new(writing.clone(), keys.clone(), limits, Arc::clone(&result_bytes)).await;
        let writer = Writer::start(clerk.map_err(failed)?);
        let keep_ms = i64::try_from(keep.jobs.as_millis()).unwrap_or(i64::MAX);
        Ok(Self {
            readers,
            writer,
            ledger,
            #[cfg(test)]
            writing,
            keys,
            result_bytes,
            keep_ms,
            _lock: lock,
        })
    }
}

impl WritesBehind for SqliteStore {
    fn writer(&self) -> &Writer {
        &self.writer
    }
    fn may_have(&self, key: &Key) -> bool {
        self.keys.may_have(key)
    }
    fn shut(&self) -> BoxFuture<'_, ()> {
        Box::pin(async {
            // What was ordered is written.
            let _ = self.ledger.write(|_| Box::pin(async { Ok(()) })).await;
            // Readers first: the last connection, which writes, then brings the log into the file.
            self.readers.close().await;
            self.writer.close().await;
        })
    }
}

impl Reads for SqliteStore {
    type Database = Sqlite;
    fn readers(&self) -> &SqlitePool {
        &self.readers
    }
}

impl Writes for SqliteStore {
    fn write<T: Send + 'static>(
        &self,
        work: impl for<'c> Fn(&'c mut SqliteConnection) -> BoxFuture<'c, Outcome<T>> + Send + Sync + 'static,
    ) -> BoxFuture<'_, Result<T, StoreError>> {
        Box::pin(self.ledger.write(work))
    }
    fn keep_ms(&self) -> i64 {
        self.keep_ms
    }
    fn run(&self, statement: Statement) -> BoxFuture<'_, Result<u64, StoreError>> {
        self.write(move |connection| connection.run(statement.clone()))
    }
}

/// The documents in the database of a data folder, for reading: whoever serves from the folder is not disturbed.
pub(crate) struct SqliteShelf(SqlitePool);

impl SqliteShelf {
    pub(crate) async fn open(folder: &Path) -> Result<Self, OpenError> {
        let options = SqliteConnectOptions::new()
            .filename(folder.join(DATABASE))
            .create_if_missing(false)
            .busy_timeout(BUSY_TIMEOUT)
            .pragma("query_only", "ON");
        let opened = SqlitePoolOptions::new().max_connections(1).acquire_timeout(BUSY_TIMEOUT).connect_with(options);
        let unusable =
            |error: sqlx::Error| OpenError::Unusable { folder: folder.to_owned(), reason: error.to_string() };
        opened.await.map(Self).map_err(unusable)
    }

    pub(crate) async fn close(self) {
        self.0.close().await;
    }
}

impl Reads for SqliteShelf {
    type Database = Sqlite;
    fn readers(&self) -> &SqlitePool {
        &self.0
    }
}

/// Size of a page of a new database, bytes: a result lies on two or three, each of which is written twice and read once
/// on its way through the log. One that is there keeps the size it has.
const PAGE: u32 = 8192;

/// How the connection that writes is set up: with room for the pages of a group, and a log that takes several groups
/// before its pages are copied into the database.
fn writing(options: &SqliteConnectOptions) -> SqliteConnectOptions {
    options.clone().page_size(PAGE).pragma("cache_size", "-8000").pragma("wal_autocheckpoint", "2000")
}

pub(super) fn lock(folder: &Path) -> Result<File, OpenError> {
    let unusable = |error: std::io::Error| OpenError::Unusable { folder: folder.to_owned(), reason: error.to_string() };
    let file = File::options().create(true).truncate(false).write(true).open(folder.join(LOCK)).map_err(unusable)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(OpenError::InUse(folder.to_owned())),
        Err(TryLockError::Error(error)) => Err(unusable(error)),
    }
}

/// Brings the tables up to date.
async fn migrate(pool: &SqlitePool) -> Result<(), String> {
    /// Ours are 1, 2, 3 ...; those of the queue that earlier programs had beside it stand in the same list, by time.
    const OURS_BELOW: i64 = 1_000_000;
    let is_new: bool =
        sqlx::query_scalar("SELECT NOT EXISTS (SELECT 1 FROM sqlite_master WHERE name = '_sqlx_migrations')")
            .fetch_one(pool)
            .await
            .map_err(|error| error.to_string())?;
    if !is_new {
        let latest: Option<i64> = sqlx::query_scalar("SELECT max(version) FROM _sqlx_migrations WHERE version < ?1")
            .bind(OURS_BELOW)
            .fetch_one(pool)
            .await
            .map_err(|error| error.to_string())?;
        let known = migrations().iter().map(|migration| migration.version).max();
        if latest > known {
            return Err(format!(
                "its database was written by a newer precut (migration {})",
                latest.unwrap_or_default()
            ));
        }
    }
    let mut ours = migrations();
    ours.set_ignore_missing(true);
    ours.run(pool).await.map_err(|error| migration_fault(&error))
}

fn migration_fault(error: &MigrateError) -> String {
    match error {
        MigrateError::VersionMismatch(version) => {
            format!("its database was not made by this program (migration {version} differs)")
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
#[path = "sqlite_tests.rs"]
mod tests;
