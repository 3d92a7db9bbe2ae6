//! Results and jobs in an SQLite file: one connection writes, four read.

use std::collections::HashSet;
use std::fs::{self, File, TryLockError};
use std::path::Path;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use bytes::Bytes;
use futures_util::future::BoxFuture;
use sqlx::migrate::{MigrateError, Migrator};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteRow, SqliteSynchronous,
};
use sqlx::{Connection, QueryBuilder, Sqlite};

use super::OpenError;
use super::ledger::Ledger;
use super::row::ResultRow;
use super::sqlite_jobs;
use super::writer::{LIST_PATIENCE, Limits, Writer};
use super::{Cursor, KeptResult, Origin, ResultPage, ResultQuery, ResultStore, ResultSummary, StoreError};
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
        let writer = Writer::start(writing.clone(), keys.clone(), limits).await.map_err(failed)?;
        let keep_ms = i64::try_from(keep.jobs.as_millis()).unwrap_or(i64::MAX);
        Ok(Self {
            readers,
            writer,
            ledger,
            #[cfg(test)]
            writing,
            keys,
            keep_ms,
            _lock: lock,
        })
    }

    async fn read(&self, key: Key) -> Result<Option<KeptResult>, StoreError> {
        if let Some(waiting) = self.writer.waiting(&key) {
            return Ok(Some(KeptResult::clone(&waiting)));
        }
        if !self.keys.may_have(&key) {
            return Ok(None);
        }
        let row: Option<ResultRow> = sqlx::query_as(
            "SELECT key, calculator, version, engine, input, body, checksum, records FROM results WHERE key = ?1",
        )
        .bind(key.as_bytes().as_slice())
        .fetch_optional(&self.readers)
        .await
        .inspect_err(|error| {
            tracing::warn!(%key, %error, "a kept result cannot be read");
            metrics::counter!("precut_store_failures_total", "operation" => "read").increment(1);
        })?;
        let Some(row) = row else { return Ok(None) };
        let result = row.result();
        if result.is_some() {
            self.writer.touch(key);
        } else {
            tracing::warn!(%key, "a kept result is damaged; it will be computed again");
            metrics::counter!("precut_store_failures_total", "operation" => "checksum").increment(1);
            self.writer.forget(key);
        }
        Ok(result)
    }

    async fn page(&self, query: ResultQuery) -> Result<ResultPage, StoreError> {
        self.writer.flush(LIST_PATIENCE).await;
        let limit = query.limit.unwrap_or(ResultQuery::LIMIT).clamp(1, ResultQuery::MOST);
        let after = query.after.map(|cursor| (cursor.created_ms, cursor.key.as_bytes().to_vec()));
        let (created_ms, key) = after.unwrap_or((i64::MAX, vec![0xff; 32]));
        let index = match (&query.record, &query.calculator) {
            (Some(_), _) => "results_with_records",
            (None, Some(_)) => "results_by_calculator",
            (None, None) => "results_by_time",
        };
        let mut statement = QueryBuilder::<Sqlite>::new(
            "SELECT key, calculator, version, engine, bytes, created_ms FROM results INDEXED BY ",
        );
        statement.push(index).push(" WHERE (created_ms, key) < (").push_bind(created_ms);
        statement.push(", ").push_bind(key).push(")");
        if let Some(calculator) = query.calculator {
            statement.push(" AND calculator = ").push_bind(calculator);
        }
        narrow(&mut statement, query.owner, query.record);
        // One more than asked for tells whether there is another page.
        statement.push(" ORDER BY created_ms DESC, key DESC LIMIT ").push_bind(limit + 1);
        let rows: Vec<SummaryRow> = statement.build_query_as().fetch_all(&self.readers).await?;
        let mut items: Vec<ResultSummary> = rows.into_iter().filter_map(SummaryRow::summary).collect();
        let more = items.len() > limit as usize;
        items.truncate(limit as usize);
        let next = items.last().filter(|_| more).map(|last| Cursor { created_ms: last.created_ms, key: last.key });
        Ok(ResultPage { items, next })
    }

    async fn count(&self, record: String, owner: Option<String>) -> Result<u64, StoreError> {
        self.writer.flush(LIST_PATIENCE).await;
        let mut statement =
            QueryBuilder::<Sqlite>::new("SELECT count(*) FROM results INDEXED BY results_with_records WHERE true");
        narrow(&mut statement, owner, Some(record));
        let count: i64 = statement.build_query_scalar().fetch_one(&self.readers).await?;
        Ok(u64::try_from(count).unwrap_or(0))
    }

    async fn some_inputs(&self, keys: Vec<Key>, most: usize) -> Result<Vec<(Key, Bytes)>, StoreError> {
        let mut statement = QueryBuilder::<Sqlite>::new("SELECT key, input FROM results WHERE length(input) <= ");
        statement.push_bind(i64::try_from(most).unwrap_or(i64::MAX)).push(" AND key IN (");
        let mut places = statement.separated(", ");
        for key in keys {
            places.push_bind(key.as_bytes().to_vec());
        }
        statement.push(")");
        let rows: Vec<(Vec<u8>, Vec<u8>)> = statement.build_query_as().fetch_all(&self.readers).await?;
        Ok(rows.into_iter().filter_map(|(key, input)| Some((Key::from_bytes(&key)?, input.into()))).collect())
    }
}

/// Only results that an owner has asked for, and whose jobs got a record.
fn narrow(statement: &mut QueryBuilder<Sqlite>, owner: Option<String>, record: Option<String>) {
    if let Some(owner) = owner {
        let of = "EXISTS (SELECT 1 FROM asked WHERE asked.key = results.key AND asked.owner = ";
        statement.push(" AND (").push(of).push_bind(owner.clone());
        let of = ") OR EXISTS (SELECT 1 FROM precut_jobs AS job WHERE job.key = results.key AND job.owner = ";
        statement.push(of).push_bind(owner).push("))");
    }
    if let Some(record) = record {
        statement.push(" AND records <> '' AND instr(records, ").push_bind(ResultQuery::mark(&record)).push(") > 0");
    }
}

impl ResultStore for SqliteStore {
    fn get(&self, key: Key) -> BoxFuture<'_, Result<Option<KeptResult>, StoreError>> {
        Box::pin(self.read(key))
    }
    fn put(&self, result: KeptResult) {
        self.writer.put(result);
    }
    fn list(&self, query: ResultQuery) -> BoxFuture<'_, Result<ResultPage, StoreError>> {
        Box::pin(self.page(query))
    }
    fn uses(&self, record: String, owner: Option<String>) -> BoxFuture<'_, Result<u64, StoreError>> {
        Box::pin(self.count(record, owner))
    }
    fn note_asked(&self, key: Key, owner: String) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.ledger.write(move |connection| {
            let owner = owner.clone();
            Box::pin(async move {
                sqlx::query("INSERT OR IGNORE INTO asked (key, owner) VALUES (?1, ?2)")
                    .bind(key.as_bytes().as_slice())
                    .bind(owner)
                    .execute(connection)
                    .await?;
                Ok(())
            })
        }))
    }
    fn has_asked(&self, key: Key, owner: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(async move {
            let asked = sqlx::query_scalar(
                "SELECT EXISTS (SELECT 1 FROM asked WHERE key = ?1 AND owner = ?2)
                     OR EXISTS (SELECT 1 FROM precut_jobs WHERE key = ?1 AND owner = ?2)",
            );
            Ok(asked.bind(key.as_bytes().as_slice()).bind(owner).fetch_one(&self.readers).await?)
        })
    }
    fn origin(&self, key: Key, owner: Option<String>) -> BoxFuture<'_, Result<Origin, StoreError>> {
        Box::pin(async move {
            self.writer.flush(LIST_PATIENCE).await;
            let created_ms = sqlx::query_scalar("SELECT created_ms FROM results WHERE key = ?1")
                .bind(key.as_bytes().as_slice())
                .fetch_optional(&self.readers)
                .await?;
            let asked_by = sqlx::query_scalar(
                "SELECT owner FROM asked WHERE key = ?1 AND (?3 IS NULL OR owner = ?3) ORDER BY owner LIMIT ?2",
            )
            .bind(key.as_bytes().as_slice())
            .bind(Origin::MOST)
            .bind(owner)
            .fetch_all(&self.readers)
            .await?;
            Ok(Origin { created_ms, asked_by })
        })
    }
    fn inputs(&self, keys: Vec<Key>, most: usize) -> BoxFuture<'_, Result<Vec<(Key, Bytes)>, StoreError>> {
        Box::pin(self.some_inputs(keys, most))
    }
    fn ping(&self) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async {
            sqlx::query("SELECT 1").execute(&self.readers).await?;
            Ok(())
        })
    }
    fn put_shard(&self, study: Key, shard: u32, content: Bytes) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.put_down_shard(study, shard, content))
    }
    fn shards(&self, study: Key) -> BoxFuture<'_, Result<Vec<(u32, Bytes)>, StoreError>> {
        Box::pin(self.shards_of(study))
    }
    fn forget_shards(&self, study: Key) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(self.forget_shards_of(study))
    }
    fn close(&self) -> BoxFuture<'_, ()> {
        Box::pin(async {
            // What was ordered is written.
            let _ = self.ledger.write(|_| Box::pin(async { Ok(()) })).await;
            // Readers first: the last connection, which writes, then brings the log into the file.
            self.readers.close().await;
            self.writer.close().await;
        })
    }
}

struct SummaryRow {
    key: Vec<u8>,
    calculator: String,
    version: u32,
    engine: String,
    bytes: i64,
    created_ms: i64,
}

from_row!(SqliteRow => SummaryRow { key, calculator, version, engine, bytes, created_ms });

impl SummaryRow {
    fn summary(self) -> Option<ResultSummary> {
        Some(ResultSummary {
            key: Key::from_bytes(&self.key)?,
            calculator: self.calculator,
            version: self.version,
            engine: self.engine,
            bytes: u64::try_from(self.bytes).unwrap_or(0),
            created_ms: self.created_ms,
        })
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
