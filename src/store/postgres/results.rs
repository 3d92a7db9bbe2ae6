//! Kept results: read, listed, written, thrown away.

use std::time::Duration;

use bytes::Bytes;
use sqlx::QueryBuilder;
use sqlx::postgres::{PgConnection, PgPool, Postgres};

use super::PostgresStore;
use super::record::{Outcome, column, count};
use super::writer::LIST_PATIENCE;
use crate::key::Key;
use crate::store::row::ResultRow;
use crate::store::{Cursor, KeptResult, Origin, ResultPage, ResultQuery, ResultSummary, StoreError};

/// Rows deleted in one transaction.
const EVICTED_AT_ONCE: i64 = 1000;
/// Eviction goes down to this share of the limit, in percent, so that it does not run for every result.
const EVICT_TO_PERCENT: i64 = 90;
/// The lock of whoever evicts.
const EVICTION: (i32, i32) = (0x7072_6563, 3);

type Columns = (Vec<u8>, String, i32, String, Vec<u8>, Vec<u8>, Vec<u8>, String);

impl PostgresStore {
    pub(super) async fn read(&self, key: Key) -> Result<Option<KeptResult>, StoreError> {
        if let Some(waiting) = self.writer.waiting(&key) {
            return Ok(Some(KeptResult::clone(&waiting)));
        }
        let row: Option<Columns> = sqlx::query_as(
            "SELECT key, calculator, version, engine, input, body, checksum, records FROM precut.results WHERE key = $1",
        )
        .bind(key.as_bytes().as_slice())
        .fetch_optional(&self.pool)
        .await
        .inspect_err(|error| {
            tracing::warn!(%key, %error, "a kept result cannot be read");
            metrics::counter!("precut_store_failures_total", "operation" => "read").increment(1);
        })?;
        let Some((key_bytes, calculator, version, engine, input, body, checksum, records)) = row else {
            return Ok(None);
        };
        let version = count(version);
        let row = ResultRow { key: key_bytes, calculator, version, engine, input, body, checksum, records };
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

    pub(super) async fn page(&self, query: ResultQuery) -> Result<ResultPage, StoreError> {
        self.writer.flush(LIST_PATIENCE).await;
        let limit = query.limit.unwrap_or(ResultQuery::LIMIT).clamp(1, ResultQuery::MOST);
        let mut statement = QueryBuilder::<Postgres>::new(
            "SELECT key, calculator, version, engine, bytes, created_ms FROM precut.results WHERE true",
        );
        if let Some(calculator) = query.calculator {
            statement.push(" AND calculator = ").push_bind(calculator);
        }
        if let Some(after) = query.after {
            statement.push(" AND (created_ms, key) < (").push_bind(after.created_ms);
            statement.push(", ").push_bind(after.key.as_bytes().to_vec()).push(")");
        }
        narrow(&mut statement, query.owner, query.record);
        // One more than asked for tells whether there is another page.
        statement.push(" ORDER BY created_ms DESC, key DESC LIMIT ").push_bind(i64::from(limit) + 1);
        let rows: Vec<(Vec<u8>, String, i32, String, i64, i64)> =
            statement.build_query_as().fetch_all(&self.pool).await?;
        let summary = |(key, calculator, version, engine, bytes, created_ms): (Vec<u8>, _, _, _, i64, _)| {
            Some(ResultSummary {
                key: Key::from_bytes(&key)?,
                calculator,
                version: count(version),
                engine,
                bytes: u64::try_from(bytes).unwrap_or(0),
                created_ms,
            })
        };
        let mut items: Vec<ResultSummary> = rows.into_iter().filter_map(summary).collect();
        let more = items.len() > limit as usize;
        items.truncate(limit as usize);
        let next = items.last().filter(|_| more).map(|last| Cursor { created_ms: last.created_ms, key: last.key });
        Ok(ResultPage { items, next })
    }

    pub(super) async fn uses_of(&self, record: String, owner: Option<String>) -> Result<u64, StoreError> {
        self.writer.flush(LIST_PATIENCE).await;
        let mut statement = QueryBuilder::<Postgres>::new("SELECT count(*) FROM precut.results WHERE true");
        narrow(&mut statement, owner, Some(record));
        let uses: i64 = statement.build_query_scalar().fetch_one(&self.pool).await?;
        Ok(u64::try_from(uses).unwrap_or(0))
    }

    pub(super) async fn note_asked_in(&self, key: Key, owner: String) -> Result<(), StoreError> {
        sqlx::query("INSERT INTO precut.asked (key, owner) VALUES ($1, $2) ON CONFLICT DO NOTHING")
            .bind(key.as_bytes().as_slice())
            .bind(owner)
            .execute(&self.pool)
            .await?;
        Ok(())
    }

    pub(super) async fn has_asked_in(&self, key: Key, owner: String) -> Result<bool, StoreError> {
        let asked = sqlx::query_scalar(
            "SELECT EXISTS (SELECT FROM precut.asked WHERE key = $1 AND owner = $2)
                 OR EXISTS (SELECT FROM precut.jobs WHERE key = $1 AND owner = $2)",
        );
        Ok(asked.bind(key.as_bytes().as_slice()).bind(owner).fetch_one(&self.pool).await?)
    }

    pub(super) async fn origin_of(&self, key: Key, owner: Option<String>) -> Result<Origin, StoreError> {
        self.writer.flush(LIST_PATIENCE).await;
        let created_ms = sqlx::query_scalar("SELECT created_ms FROM precut.results WHERE key = $1")
            .bind(key.as_bytes().as_slice())
            .fetch_optional(&self.pool)
            .await?;
        let asked_by = sqlx::query_scalar(
            "SELECT owner FROM precut.asked WHERE key = $1 AND ($3::text IS NULL OR owner = $3) ORDER BY owner LIMIT $2",
        )
        .bind(key.as_bytes().as_slice())
        .bind(i64::from(Origin::MOST))
        .bind(owner)
        .fetch_all(&self.pool)
        .await?;
        Ok(Origin { created_ms, asked_by })
    }

    pub(super) async fn some_inputs(&self, keys: Vec<Key>, most: usize) -> Result<Vec<(Key, Bytes)>, StoreError> {
        let keys: Vec<Vec<u8>> = keys.iter().map(|key| key.as_bytes().to_vec()).collect();
        let rows: Vec<(Vec<u8>, Vec<u8>)> =
            sqlx::query_as("SELECT key, input FROM precut.results WHERE key = ANY($1) AND octet_length(input) <= $2")
                .bind(keys)
                .bind(i32::try_from(most).unwrap_or(i32::MAX))
                .fetch_all(&self.pool)
                .await?;
        Ok(rows.into_iter().filter_map(|(key, input)| Some((Key::from_bytes(&key)?, input.into()))).collect())
    }
}

/// Only results that an owner has asked for, and whose jobs got a record.
fn narrow(statement: &mut QueryBuilder<Postgres>, owner: Option<String>, record: Option<String>) {
    if let Some(owner) = owner {
        let of = "EXISTS (SELECT FROM precut.asked WHERE asked.key = results.key AND asked.owner = ";
        statement.push(" AND (").push(of).push_bind(owner.clone());
        let of = ") OR EXISTS (SELECT FROM precut.jobs AS job WHERE job.key = results.key AND job.owner = ";
        statement.push(of).push_bind(owner).push("))");
    }
    if let Some(record) = record {
        statement.push(" AND records <> '' AND strpos(records, ").push_bind(ResultQuery::mark(&record)).push(") > 0");
    }
}

/// Adds rows in one statement, those that are there already excepted.
pub(super) async fn insert(connection: &mut PgConnection, rows: &[ResultRow], now: i64) -> Outcome<()> {
    if rows.is_empty() {
        return Ok(());
    }
    let mut rows: Vec<&ResultRow> = rows.iter().collect();
    // In one order for all: whoever waits for another's row is not waited for by him.
    rows.sort_by(|one, other| one.key.cmp(&other.key));
    let mut statement = QueryBuilder::<Postgres>::new(
        "INSERT INTO precut.results (key, calculator, version, engine, input, body, checksum, bytes, created_ms, used_ms, records) ",
    );
    statement.push_values(rows, |mut values, row| {
        values.push_bind(&row.key).push_bind(&row.calculator).push_bind(column(row.version)).push_bind(&row.engine);
        values.push_bind(&row.input).push_bind(&row.body).push_bind(&row.checksum);
        values.push_bind(row.bytes()).push_bind(now).push_bind(now).push_bind(&row.records);
    });
    statement.push(" ON CONFLICT (key) DO NOTHING");
    statement.build().execute(connection).await?;
    Ok(())
}

/// Deletes what has not been used for longer than the age allowed, and what has not been used for longest until the
/// total is below the limit again; what a kept job points to stays. One process at a time.
pub(super) async fn evict(pool: &PgPool, limit: u64, age: Duration) -> Outcome<u64> {
    let limit = i64::try_from(limit).unwrap_or(i64::MAX);
    let age_ms = i64::try_from(age.as_millis()).unwrap_or(i64::MAX / 4);
    let mut gone = delete_while_some(pool, Some(age_ms), 0).await?;
    let total: i64 =
        sqlx::query_scalar("SELECT coalesce(sum(bytes), 0)::bigint FROM precut.results").fetch_one(pool).await?;
    if total > limit {
        gone += delete_while_some(pool, None, total - limit / 100 * EVICT_TO_PERCENT).await?;
    }
    metrics::counter!("precut_results_evicted_total").increment(gone);
    Ok(gone)
}

/// Deletes in small transactions: what is older than an age, or as many bytes as are too many.
async fn delete_while_some(pool: &PgPool, age_ms: Option<i64>, mut surplus: i64) -> Outcome<u64> {
    let mut gone = 0;
    loop {
        if age_ms.is_none() && surplus <= 0 {
            return Ok(gone);
        }
        let mut transaction = pool.begin().await?;
        let is_first: bool = sqlx::query_scalar("SELECT pg_try_advisory_xact_lock($1, $2)")
            .bind(EVICTION.0)
            .bind(EVICTION.1)
            .fetch_one(&mut *transaction)
            .await?;
        if !is_first {
            return Ok(gone);
        }
        let deleted: Vec<i64> = sqlx::query_scalar(
            "DELETE FROM precut.results WHERE key IN (
                 SELECT key FROM (
                     SELECT key, coalesce(sum(bytes) OVER (ORDER BY used_ms, key) - bytes, 0) AS before
                     FROM (SELECT key, used_ms, bytes FROM precut.results
                           WHERE used_ms < precut.now_ms() - $1
                               AND NOT EXISTS (SELECT FROM precut.jobs WHERE jobs.key = results.key
                                               AND state = 'succeeded' AND expires_ms > precut.now_ms())
                           ORDER BY used_ms, key LIMIT $2) AS oldest) AS summed
                 WHERE before < $3)
             RETURNING bytes",
        )
        .bind(age_ms.unwrap_or(-1_000_000))
        .bind(EVICTED_AT_ONCE)
        .bind(if age_ms.is_some() { i64::MAX } else { surplus })
        .fetch_all(&mut *transaction)
        .await?;
        transaction.commit().await?;
        if deleted.is_empty() {
            return Ok(gone);
        }
        gone += deleted.len() as u64;
        surplus -= deleted.iter().sum::<i64>();
    }
}
