//! What both databases understand is written once: a statement with its values, and the connections that carry it out.
//!
//! Statements are in the SQL that SQLite and PostgreSQL have in common; tables have the same names and columns in both. What
//! only one of them can do (claims that pass locked rows over, advisory locks) stays with its store.

use std::borrow::Cow;
use std::fmt::Write as _;

use futures_util::future::BoxFuture;
use sqlx::pool::PoolConnection;
use sqlx::postgres::{PgConnection, PgRow, Postgres};
use sqlx::query::Query;
use sqlx::sqlite::{Sqlite, SqliteConnection, SqliteRow};
use sqlx::{AssertSqlSafe, Database, Executor, FromRow, Pool};

use super::StoreError;
use super::jobs::{JobId, Lease};
use crate::key::Key;

pub(super) type Outcome<T> = Result<T, sqlx::Error>;

/// A value of a statement.
#[derive(Debug, Clone)]
pub(super) enum Value {
    Bool(bool),
    Integer(Option<i64>),
    Real(f64),
    Text(Option<String>),
    Bytes(Option<Vec<u8>>),
}

macro_rules! values {
    ($($from:ty => |$it:ident| $value:expr;)+) => {
        $(impl From<$from> for Value {
            fn from($it: $from) -> Self {
                $value
            }
        })+
    };
}

values! {
    bool => |it| Self::Bool(it);
    i64 => |it| Self::Integer(Some(it));
    u32 => |it| Self::Integer(Some(i64::from(it)));
    Option<i64> => |it| Self::Integer(it);
    Option<u32> => |it| Self::Integer(it.map(i64::from));
    f64 => |it| Self::Real(it);
    &str => |it| Self::Text(Some(it.to_owned()));
    String => |it| Self::Text(Some(it));
    &String => |it| Self::Text(Some(it.clone()));
    Option<&str> => |it| Self::Text(it.map(str::to_owned));
    Option<String> => |it| Self::Text(it);
    &Option<String> => |it| Self::Text(it.clone());
    &[u8] => |it| Self::Bytes(Some(it.to_owned()));
    Vec<u8> => |it| Self::Bytes(Some(it));
    Option<Vec<u8>> => |it| Self::Bytes(it);
    Key => |it| Self::Bytes(Some(it.as_bytes().to_vec()));
    JobId => |it| Self::Text(Some(it.to_string()));
    Lease => |it| Self::Text(Some(it.to_string()));
}

/// A statement with its values, which it names `$1`, `$2` and so on. Its text is only ever put together from texts of this
/// program.
#[derive(Debug, Clone)]
pub(super) struct Statement {
    text: Cow<'static, str>,
    values: Vec<Value>,
}

/// A statement to which its values are bound one after the other.
pub(super) fn sql(text: &'static str) -> Statement {
    Statement { text: text.into(), values: Vec::new() }
}

impl Statement {
    /// Its next value.
    pub(super) fn bind(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// Goes on with that text.
    pub(super) fn push(&mut self, text: &'static str) -> &mut Self {
        self.text.to_mut().push_str(text);
        self
    }

    /// Goes on with that value.
    pub(super) fn push_bind(&mut self, value: impl Into<Value>) -> &mut Self {
        self.values.push(value.into());
        // Nothing can fail that writes into a text.
        let _ = write!(self.text.to_mut(), "${}", self.values.len());
        self
    }

    /// Goes on with those values in brackets, of which there is one at least.
    pub(super) fn push_list<T: Into<Value>>(&mut self, values: impl IntoIterator<Item = T>) -> &mut Self {
        for (index, value) in values.into_iter().enumerate() {
            self.push(if index == 0 { "(" } else { ", " }).push_bind(value);
        }
        self.push(")")
    }

    fn bound<'q, D>(self) -> Query<'q, D, <D as Database>::Arguments>
    where
        D: Database,
        bool: sqlx::Encode<'q, D> + sqlx::Type<D>,
        f64: sqlx::Encode<'q, D> + sqlx::Type<D>,
        Option<Vec<u8>>: sqlx::Encode<'q, D> + sqlx::Type<D>,
        Option<i64>: sqlx::Encode<'q, D> + sqlx::Type<D>,
        Option<String>: sqlx::Encode<'q, D> + sqlx::Type<D>,
    {
        let query = sqlx::query(AssertSqlSafe(self.text));
        self.values.into_iter().fold(query, |query, value| match value {
            Value::Bool(value) => query.bind(value),
            Value::Integer(value) => query.bind(value),
            Value::Real(value) => query.bind(value),
            Value::Text(value) => query.bind(value),
            Value::Bytes(value) => query.bind(value),
        })
    }
}

/// What is read from the rows of both.
pub(super) trait Record: Send + for<'r> FromRow<'r, SqliteRow> + for<'r> FromRow<'r, PgRow> {}
impl<T: Send + for<'r> FromRow<'r, SqliteRow> + for<'r> FromRow<'r, PgRow>> Record for T {}

/// What is done by one after the other, where several processes write.
#[derive(Debug, Clone, Copy)]
pub(super) enum Lock<'a> {
    /// Documents get their numbers.
    Library,
    /// What is kept for somebody is counted, and more is kept.
    Owner(&'a str),
    /// A process is added to.
    Process(&'a str),
}

/// Whose key is locked.
#[derive(Debug, Clone, Copy)]
pub(super) enum KeyOf {
    /// That of a job.
    Job(JobId),
    /// That which is computed under a lease.
    Lease(Lease),
}

/// A connection of either database.
pub(super) trait Session: Send {
    /// Passes over rows that somebody else is about to write, where that can be.
    const SKIP_LOCKED: &'static str;
    /// The column of the version whose job it is, where versions share the jobs.
    const ENGINE: &'static str;
    /// Waits until nobody else changes who computes that key, until the transaction ends: the key, and the time. Nothing where
    /// there is none.
    fn lock_key(&mut self, of: KeyOf) -> BoxFuture<'_, Outcome<Option<(Key, i64)>>>;
    /// Tells other processes that jobs changed and computations are not wanted, once the transaction is committed.
    fn tell<'a>(&'a mut self, jobs: &'a [JobId], unwanted: &'a [Lease]) -> BoxFuture<'a, Outcome<()>>;
    /// The time by the clock that this store goes by, ms since 1970, UTC.
    fn now_ms(&mut self) -> BoxFuture<'_, Outcome<i64>>;
    /// Waits until nobody else has the lock, and keeps it until the transaction ends.
    fn lock<'a>(&'a mut self, lock: Lock<'a>) -> BoxFuture<'a, Outcome<()>>;
    /// See [`super::documents::DocumentStore::generation`].
    fn generation(&mut self) -> BoxFuture<'_, Outcome<Option<i64>>>;
    /// Carries a statement out: so many rows it has changed.
    fn run(&mut self, statement: Statement) -> BoxFuture<'_, Outcome<u64>>;
    /// All rows of a statement.
    fn all<T: Record>(&mut self, statement: Statement) -> BoxFuture<'_, Outcome<Vec<T>>>;
    /// The first row of a statement, if there is one.
    fn first<T: Record>(&mut self, statement: Statement) -> BoxFuture<'_, Outcome<Option<T>>>;
    /// The one row of a statement.
    fn one<T: Record>(&mut self, statement: Statement) -> BoxFuture<'_, Outcome<T>> {
        Box::pin(async move { self.first(statement).await?.ok_or(sqlx::Error::RowNotFound) })
    }
}

macro_rules! statements {
    ($database:ty, $row:ty) => {
        fn run(&mut self, statement: Statement) -> BoxFuture<'_, Outcome<u64>> {
            Box::pin(async move { Ok(self.execute(statement.bound::<$database>()).await?.rows_affected()) })
        }
        fn all<T: Record>(&mut self, statement: Statement) -> BoxFuture<'_, Outcome<Vec<T>>> {
            Box::pin(async move {
                let rows = self.fetch_all(statement.bound::<$database>()).await?;
                rows.iter().map(|row| <T as FromRow<'_, $row>>::from_row(row)).collect()
            })
        }
        fn first<T: Record>(&mut self, statement: Statement) -> BoxFuture<'_, Outcome<Option<T>>> {
            Box::pin(async move {
                let row = self.fetch_optional(statement.bound::<$database>()).await?;
                row.as_ref().map(|row| <T as FromRow<'_, $row>>::from_row(row)).transpose()
            })
        }
    };
}

impl Session for SqliteConnection {
    const SKIP_LOCKED: &'static str = "";
    const ENGINE: &'static str = "";
    fn lock_key(&mut self, of: KeyOf) -> BoxFuture<'_, Outcome<Option<(Key, i64)>>> {
        let key = match of {
            KeyOf::Job(id) => sql("SELECT key FROM jobs WHERE id = $1").bind(id),
            KeyOf::Lease(lease) => sql("SELECT key FROM jobs WHERE lease = $1 LIMIT 1").bind(lease),
        };
        Box::pin(async move {
            let key = self.first::<(Vec<u8>,)>(key).await?;
            Ok(key.and_then(|(key,)| Some((Key::from_bytes(&key)?, super::now_ms()))))
        })
    }
    fn tell<'a>(&'a mut self, _: &'a [JobId], _: &'a [Lease]) -> BoxFuture<'a, Outcome<()>> {
        Box::pin(async { Ok(()) })
    }
    fn now_ms(&mut self) -> BoxFuture<'_, Outcome<i64>> {
        Box::pin(async { Ok(super::now_ms()) })
    }
    fn lock<'a>(&'a mut self, _lock: Lock<'a>) -> BoxFuture<'a, Outcome<()>> {
        // One connection writes, and holds all of the file while it does.
        Box::pin(async { Ok(()) })
    }
    fn generation(&mut self) -> BoxFuture<'_, Outcome<Option<i64>>> {
        Box::pin(async { Ok(None) })
    }
    statements!(Sqlite, SqliteRow);
}

impl Session for PgConnection {
    const SKIP_LOCKED: &'static str = " FOR UPDATE SKIP LOCKED";
    const ENGINE: &'static str = ", engine";
    fn lock_key(&mut self, of: KeyOf) -> BoxFuture<'_, Outcome<Option<(Key, i64)>>> {
        let key = match of {
            KeyOf::Job(id) => sql("SELECT key, now_ms() FROM (SELECT key FROM jobs WHERE id = $1) AS job,
                 LATERAL pg_advisory_xact_lock(lock_of(key))")
            .bind(id),
            KeyOf::Lease(lease) => {
                sql("SELECT key, now_ms() FROM (SELECT key FROM jobs WHERE lease = $1 LIMIT 1) AS job,
                 LATERAL pg_advisory_xact_lock(lock_of(key))")
                .bind(lease)
            }
        };
        Box::pin(async move {
            let locked = self.first::<(Vec<u8>, i64)>(key).await?;
            Ok(locked.and_then(|(key, now)| Some((Key::from_bytes(&key)?, now))))
        })
    }
    fn tell<'a>(&'a mut self, jobs: &'a [JobId], unwanted: &'a [Lease]) -> BoxFuture<'a, Outcome<()>> {
        Box::pin(super::postgres::tell(self, jobs, unwanted))
    }
    fn now_ms(&mut self) -> BoxFuture<'_, Outcome<i64>> {
        Box::pin(async move { Ok(self.one::<(i64,)>(sql("SELECT now_ms()")).await?.0) })
    }
    fn lock<'a>(&'a mut self, lock: Lock<'a>) -> BoxFuture<'a, Outcome<()>> {
        let statement = match lock {
            Lock::Library => sql("SELECT generation FROM library FOR UPDATE"),
            Lock::Owner(owner) => {
                sql("SELECT pg_advisory_xact_lock(hashtextextended('precut.owner ' || $1, 0))").bind(owner)
            }
            Lock::Process(name) => sql("SELECT sequence FROM processes WHERE name = $1 FOR UPDATE").bind(name),
        };
        Box::pin(async move { self.run(statement).await.map(drop) })
    }
    fn generation(&mut self) -> BoxFuture<'_, Outcome<Option<i64>>> {
        Box::pin(async move { Ok(self.first::<(i64,)>(sql("SELECT generation FROM library")).await?.map(|row| row.0)) })
    }
    statements!(Postgres, PgRow);
}

/// The connection of a database.
pub(super) type ConnectionOf<D> = <D as Database>::Connection;

/// A store that can be read.
pub(super) trait Reads: Send + Sync + 'static {
    type Database: Database<Connection: Session>;
    fn readers(&self) -> &Pool<Self::Database>;
    /// A connection for reading.
    fn reader(&self) -> BoxFuture<'_, Result<PoolConnection<Self::Database>, StoreError>> {
        Box::pin(async { Ok(self.readers().acquire().await?) })
    }
}

/// A store that can be written.
pub(super) trait Writes: Reads {
    /// Does `work` in a transaction, which is on the disk on return; it may be done again where its transaction fails.
    fn write<T: Send + 'static>(
        &self,
        work: impl for<'c> Fn(&'c mut ConnectionOf<Self::Database>) -> BoxFuture<'c, Outcome<T>> + Send + Sync + 'static,
    ) -> BoxFuture<'_, Result<T, StoreError>>;
    /// How long finished jobs are kept, ms.
    fn keep_ms(&self) -> i64;
    /// Carries one statement out, which is a transaction of its own.
    fn run(&self, statement: Statement) -> BoxFuture<'_, Result<u64, StoreError>>;
}
