//! Kept results, and jobs. Nothing outside this module speaks SQL.

#[macro_use]
mod migrations;

pub mod address;
pub mod backup;
mod behind;
pub mod callbacks;
mod common;
pub mod documents;
pub mod jobs;
mod ledger;
mod postgres;
pub mod processes;
pub(crate) mod quota;
mod row;
mod sql;
pub mod sqlite;
mod sqlite_jobs;
#[cfg(test)]
mod suite;
mod writer;

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use bytes::Bytes;
use futures_util::future::BoxFuture;

use crate::key::{BadKey, Key};
use address::StoreAddress;
use sqlite::Keep;

/// Why an engine does not start.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Another process serves this folder.
    #[error("the data folder {0} is in use by another precut; stop that one or give another folder")]
    InUse(PathBuf),
    /// The folder or the database cannot be used.
    #[error("the data folder {folder} cannot be used: {reason}")]
    Unusable {
        /// Which folder.
        folder: PathBuf,
        /// Why.
        reason: String,
    },
    /// The database cannot be used.
    #[error("the database cannot be used: {0}")]
    Database(String),
    /// The pool of threads cannot be made.
    #[error("the calculation threads cannot be started: {0}")]
    Threads(String),
}

/// Everything that outlasts a process.
pub trait Store: ResultStore + jobs::JobStore + documents::DocumentStore + processes::ProcessStore {}
impl<S: ResultStore + jobs::JobStore + documents::DocumentStore + processes::ProcessStore> Store for S {}

/// Which store, and how it is used.
#[derive(Debug, Clone)]
pub(crate) struct StoreSettings {
    pub(crate) address: StoreAddress,
    /// Folder of the SQLite file.
    pub(crate) data: PathBuf,
    pub(crate) keep: Keep,
    /// Connections to PostgreSQL at most.
    pub(crate) connections: u32,
    /// How long to wait at the start for a PostgreSQL that does not answer.
    pub(crate) wait: Duration,
    /// Whether this process runs jobs.
    pub(crate) works: bool,
}

/// Opens the store.
pub(crate) async fn open(settings: &StoreSettings) -> Result<Arc<dyn Store>, OpenError> {
    match &settings.address {
        StoreAddress::Sqlite => Ok(Arc::new(sqlite::SqliteStore::open(&settings.data, settings.keep).await?)),
        StoreAddress::Postgres(address) => {
            let usage = postgres::Use {
                keep: settings.keep,
                connections: settings.connections,
                patience: postgres::Patience { start: settings.wait, ..postgres::Patience::default() },
                engine: crate::key::ENGINE_VERSION.to_owned(),
                works: settings.works,
            };
            Ok(Arc::new(postgres::PostgresStore::open(address, usage).await?))
        }
    }
}

/// Where results are kept. What is kept can always be computed again: no failure of a store fails an answer.
pub trait ResultStore: Send + Sync + 'static {
    /// The result of that key.
    fn get(&self, key: Key) -> BoxFuture<'_, Result<Option<KeptResult>, StoreError>>;
    /// Keeps a result, soon, in a group with others. Where that fails, a warning and a metric say so.
    fn put(&self, result: KeptResult);
    /// The results, newest first, those just put among them.
    fn list(&self, query: ResultQuery) -> BoxFuture<'_, Result<ResultPage, StoreError>>;
    /// How many results got a record ([`ResultQuery::record`]): of all, or of those that this owner has asked for.
    fn uses(&self, record: String, owner: Option<String>) -> BoxFuture<'_, Result<u64, StoreError>>;
    /// Notes that an owner has asked for a result.
    fn note_asked(&self, key: Key, owner: String) -> BoxFuture<'_, Result<(), StoreError>>;
    /// Whether an owner has asked for a result, by a request or a job.
    fn has_asked(&self, key: Key, owner: String) -> BoxFuture<'_, Result<bool, StoreError>>;
    /// Since when a result is kept, and who has asked for it: of all, or of one owner.
    fn origin(&self, key: Key, owner: Option<String>) -> BoxFuture<'_, Result<Origin, StoreError>>;
    /// The filled jobs of kept results, compressed, as far as they take no more than so many bytes; those that are not
    /// there are left out.
    fn inputs(&self, keys: Vec<Key>, most: usize) -> BoxFuture<'_, Result<Vec<(Key, Bytes)>, StoreError>>;
    /// Whether it answers.
    fn ping(&self) -> BoxFuture<'_, Result<(), StoreError>>;
    /// Writes what waits and closes.
    fn close(&self) -> BoxFuture<'_, ()>;
}

/// A result as it is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptResult {
    /// Its address.
    pub key: Key,
    /// Which calculator made it.
    pub calculator: String,
    /// Which version of the calculator.
    pub version: u32,
    /// Which engine.
    pub engine: String,
    /// The filled job, canonical JSON.
    pub input: Bytes,
    /// The envelope, JSON.
    pub body: Bytes,
    /// The records that its job got, as `|machines/lathe-3@4|tools/bar-25@1|`; empty where it named none.
    pub records: String,
}

/// Where a kept result comes from, beside what it says itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Origin {
    /// When it was computed, ms UTC; none where it is not kept.
    pub created_ms: Option<i64>,
    /// The owners who had it as a direct answer, at most [`Origin::MOST`].
    pub asked_by: Vec<String>,
}

impl Origin {
    /// Never more owners than so many.
    pub const MOST: u32 = 100;
}

/// What a list of results asks for.
#[derive(Debug, Clone, Default)]
pub struct ResultQuery {
    /// Only those of this calculator.
    pub calculator: Option<String>,
    /// Only those that this owner has asked for.
    pub owner: Option<String>,
    /// Only those whose jobs got this record: `machines/lathe-3@4`, or `machines/lathe-3` of any revision.
    pub record: Option<String>,
    /// At most so many; [`ResultQuery::LIMIT`] unless told, never above [`ResultQuery::MOST`].
    pub limit: Option<u32>,
    /// Where the page before ended.
    pub after: Option<Cursor>,
}

impl ResultQuery {
    /// So many results are listed unless told otherwise.
    pub const LIMIT: u32 = 50;
    /// Never more than so many.
    pub const MOST: u32 = 500;

    /// What stands in [`KeptResult::records`] of those whose jobs got the record.
    pub(crate) fn mark(record: &str) -> String {
        let end = if record.contains('@') { '|' } else { '@' };
        format!("|{record}{end}")
    }
}

/// A place in the list of results; opaque in the contract, and written in one way only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cursor {
    /// Time of the last result of the page before, ms UTC.
    pub created_ms: i64,
    /// Its key.
    pub key: Key,
}

impl fmt::Display for Cursor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.created_ms, self.key.to_string().trim_start_matches("b3:"))
    }
}

impl FromStr for Cursor {
    type Err = BadKey;
    fn from_str(text: &str) -> Result<Self, BadKey> {
        let (created_ms, digits) = text.split_once('-').ok_or(BadKey)?;
        let read = Self { created_ms: created_ms.parse().map_err(|_| BadKey)?, key: format!("b3:{digits}").parse()? };
        // Signs, zeros in front and capitals would be other addresses of the same page.
        if read.to_string() == text { Ok(read) } else { Err(BadKey) }
    }
}

/// A page of the list, newest first.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ResultPage {
    /// The results.
    pub items: Vec<ResultSummary>,
    /// Where the next page begins, if there is one.
    pub next: Option<Cursor>,
}

/// A line of the list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ResultSummary {
    /// Its address.
    pub key: Key,
    /// Which calculator made it.
    pub calculator: String,
    /// Which version of the calculator.
    pub version: u32,
    /// Which engine.
    pub engine: String,
    /// What it takes of the disk, bytes.
    pub bytes: u64,
    /// When it was computed, ms UTC.
    pub created_ms: i64,
}

/// Why the store did not serve.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// The database did not answer.
    #[error("the store failed: {0}")]
    Failed(String),
    /// The disk is full.
    #[error("the disk is full: {0}")]
    Full(String),
    /// The kept result was made by a version whose contract differs.
    #[error("the result was made by another version of its calculator: {0}")]
    Outdated(String),
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        /// `SQLITE_FULL`.
        const FULL: i32 = 13;
        if sqlite_code(&error) == Some(FULL) || is_disk_full(&error) {
            return Self::Full(error.to_string());
        }
        Self::Failed(error.to_string())
    }
}

/// `disk_full` of PostgreSQL.
fn is_disk_full(error: &sqlx::Error) -> bool {
    let error = error.as_database_error().and_then(|error| error.try_downcast_ref::<sqlx::postgres::PgDatabaseError>());
    error.is_some_and(|error| error.code() == "53100")
}

/// Kind of an error of SQLite: the lowest byte of its code, the rest of which says more of it.
fn sqlite_code(error: &sqlx::Error) -> Option<i32> {
    let error = error.as_database_error()?.try_downcast_ref::<sqlx::sqlite::SqliteError>()?;
    let code: i32 = sqlx::error::DatabaseError::code(error)?.parse().ok()?;
    Some(code & 0xff)
}

/// The time, ms UTC.
pub(crate) fn now_ms() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}
