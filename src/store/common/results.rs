//! Kept results: found, listed, and who has asked for them.

use std::time::Duration;

use bytes::Bytes;
use futures_util::future::BoxFuture;

use super::jobs::count;
use crate::key::Key;
use crate::store::behind::Writer;
use crate::store::row::ResultRow;
use crate::store::sql::{Outcome, Session, Statement, Value, Writes, sql};
use crate::store::{Cursor, KeptResult, Origin, ResultPage, ResultQuery, ResultStore, ResultSummary, StoreError};

/// How long a list waits for what is just being written.
const LIST_PATIENCE: Duration = Duration::from_secs(1);

/// A store that writes results behind the answers.
pub(in crate::store) trait WritesBehind: Writes {
    fn writer(&self) -> &Writer;
    /// Whether a result may be there; `false` is certain.
    fn may_have(&self, _key: &Key) -> bool {
        true
    }
    /// Writes what waits and closes.
    fn shut(&self) -> BoxFuture<'_, ()>;
}

impl<W: WritesBehind> ResultStore for W {
    fn get(&self, key: Key) -> BoxFuture<'_, Result<Option<KeptResult>, StoreError>> {
        Box::pin(async move {
            if let Some(waiting) = self.writer().waiting(&key) {
                return Ok(Some(KeptResult::clone(&waiting)));
            }
            if !self.may_have(&key) {
                return Ok(None);
            }
            let row = sql("SELECT key, calculator, version, engine, input, body, checksum, records FROM results
                 WHERE key = $1");
            let row = self.reader().await?.first::<ResultRow>(row.bind(key)).await.inspect_err(|error| {
                tracing::warn!(%key, %error, "a kept result cannot be read");
                metrics::counter!("precut_store_failures_total", "operation" => "read").increment(1);
            })?;
            let Some(row) = row else { return Ok(None) };
            let result = row.result();
            if result.is_some() {
                self.writer().touch(key);
            } else {
                tracing::warn!(%key, "a kept result is damaged; it will be computed again");
                metrics::counter!("precut_store_failures_total", "operation" => "checksum").increment(1);
                self.writer().forget(key);
            }
            Ok(result)
        })
    }
    fn put(&self, result: KeptResult) {
        self.writer().put(result);
    }
    fn list(&self, query: ResultQuery) -> BoxFuture<'_, Result<ResultPage, StoreError>> {
        Box::pin(async move {
            self.writer().flush(LIST_PATIENCE).await;
            Ok(page(&mut *self.reader().await?, query).await?)
        })
    }
    fn uses(&self, record: String, owner: Option<String>) -> BoxFuture<'_, Result<u64, StoreError>> {
        Box::pin(async move {
            self.writer().flush(LIST_PATIENCE).await;
            let mut statement = sql("SELECT count(*) FROM results WHERE true");
            narrow(&mut statement, owner, Some(record));
            let (uses,): (i64,) = self.reader().await?.one(statement).await?;
            Ok(u64::try_from(uses).unwrap_or(0))
        })
    }
    fn note_asked(&self, key: Key, owner: String) -> BoxFuture<'_, Result<(), StoreError>> {
        let asked = sql("INSERT INTO asked (key, owner) VALUES ($1, $2) ON CONFLICT DO NOTHING").bind(key).bind(owner);
        Box::pin(async move { self.run(asked).await.map(drop) })
    }
    fn has_asked(&self, key: Key, owner: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(async move {
            let asked = sql("SELECT EXISTS (SELECT 1 FROM asked WHERE key = $1 AND owner = $2)
                 OR EXISTS (SELECT 1 FROM jobs WHERE key = $1 AND owner = $2)");
            let (asked,): (bool,) = self.reader().await?.one(asked.bind(key).bind(owner)).await?;
            Ok(asked)
        })
    }
    fn origin(&self, key: Key, owner: Option<String>) -> BoxFuture<'_, Result<Origin, StoreError>> {
        Box::pin(async move {
            self.writer().flush(LIST_PATIENCE).await;
            let mut reader = self.reader().await?;
            let created = sql("SELECT created_ms FROM results WHERE key = $1").bind(key);
            let created_ms = reader.first::<(i64,)>(created).await?.map(|row| row.0);
            let asked_by =
                sql("SELECT owner FROM asked WHERE key = $1 AND ($3 IS NULL OR owner = $3) ORDER BY owner LIMIT $2");
            let asked_by: Vec<(String,)> = reader.all(asked_by.bind(key).bind(Origin::MOST).bind(owner)).await?;
            Ok(Origin { created_ms, asked_by: asked_by.into_iter().map(|(owner,)| owner).collect() })
        })
    }
    fn inputs(&self, keys: Vec<Key>, most: usize) -> BoxFuture<'_, Result<Vec<(Key, Bytes)>, StoreError>> {
        Box::pin(async move {
            if keys.is_empty() {
                return Ok(Vec::new());
            }
            let mut statement = sql("SELECT key, input FROM results WHERE octet_length(input) <= ");
            statement.push_bind(i64::try_from(most).unwrap_or(i64::MAX)).push(" AND key IN ").push_list(keys);
            let rows: Vec<(Vec<u8>, Vec<u8>)> = self.reader().await?.all(statement).await?;
            Ok(rows.into_iter().filter_map(|(key, input)| Some((Key::from_bytes(&key)?, input.into()))).collect())
        })
    }
    fn ping(&self) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async move { Ok(self.reader().await?.run(sql("SELECT 1")).await.map(drop)?) })
    }
    fn close(&self) -> BoxFuture<'_, ()> {
        self.shut()
    }
}

async fn page<S: Session>(connection: &mut S, query: ResultQuery) -> Outcome<ResultPage> {
    let limit = query.limit.unwrap_or(ResultQuery::LIMIT).clamp(1, ResultQuery::MOST);
    let mut statement = sql("SELECT key, calculator, version, engine, bytes, created_ms FROM results WHERE true");
    if let Some(calculator) = query.calculator {
        statement.push(" AND calculator = ").push_bind(calculator);
    }
    if let Some(after) = query.after {
        statement.push(" AND (created_ms, key) < (").push_bind(after.created_ms);
        statement.push(", ").push_bind(after.key).push(")");
    }
    narrow(&mut statement, query.owner, query.record);
    // One more than asked for tells whether there is another page.
    statement.push(" ORDER BY created_ms DESC, key DESC LIMIT ").push_bind(limit + 1);
    let rows: Vec<SummaryRow> = connection.all(statement).await?;
    let mut items: Vec<ResultSummary> = rows.into_iter().filter_map(SummaryRow::summary).collect();
    let more = items.len() > limit as usize;
    items.truncate(limit as usize);
    let next = items.last().filter(|_| more).map(|last| Cursor { created_ms: last.created_ms, key: last.key });
    Ok(ResultPage { items, next })
}

/// Only results that an owner has asked for, and whose jobs got a record.
fn narrow(statement: &mut Statement, owner: Option<String>, record: Option<String>) {
    if let Some(owner) = owner {
        statement.push(" AND (EXISTS (SELECT 1 FROM asked WHERE asked.key = results.key AND asked.owner = ");
        statement.push_bind(owner.clone());
        statement.push(") OR EXISTS (SELECT 1 FROM jobs WHERE jobs.key = results.key AND jobs.owner = ");
        statement.push_bind(owner).push("))");
    }
    if let Some(record) = record {
        // It stands there where taking it away changes something.
        statement.push(" AND records <> '' AND replace(records, ").push_bind(ResultQuery::mark(&record));
        statement.push(", '') <> records");
    }
}

struct SummaryRow {
    key: Vec<u8>,
    calculator: String,
    version: i32,
    engine: String,
    bytes: i64,
    created_ms: i64,
}

from_row!(SummaryRow { key, calculator, version, engine, bytes, created_ms });

impl SummaryRow {
    fn summary(self) -> Option<ResultSummary> {
        Some(ResultSummary {
            key: Key::from_bytes(&self.key)?,
            calculator: self.calculator,
            version: count(self.version),
            engine: self.engine,
            bytes: u64::try_from(self.bytes).unwrap_or(0),
            created_ms: self.created_ms,
        })
    }
}

/// Adds rows in one statement, those that are there already excepted; what the others take, bytes.
pub(in crate::store) async fn insert<S: Session>(connection: &mut S, rows: &[ResultRow], now: i64) -> Outcome<i64> {
    if rows.is_empty() {
        return Ok(0);
    }
    let mut rows: Vec<&ResultRow> = rows.iter().collect();
    // In one order for all: whoever waits for another's row is not waited for by him.
    rows.sort_by(|one, other| one.key.cmp(&other.key));
    let mut statement = sql("INSERT INTO results
             (key, calculator, version, engine, input, body, checksum, bytes, created_ms, used_ms, records)
         VALUES ");
    for (index, row) in rows.iter().enumerate() {
        statement.push(if index == 0 { "" } else { ", " }).push_list(columns(row, now));
    }
    statement.push(" ON CONFLICT (key) DO NOTHING");
    let bytes: i64 = rows.iter().map(|row| row.bytes()).sum();
    // Where some were there already, the total is a little too large until eviction counts anew.
    Ok(if connection.run(statement).await? == 0 { 0 } else { bytes })
}

fn columns(row: &ResultRow, now: i64) -> [Value; 11] {
    [
        row.key.clone().into(),
        (&row.calculator).into(),
        row.version.into(),
        (&row.engine).into(),
        row.input.clone().into(),
        row.body.clone().into(),
        row.checksum.clone().into(),
        row.bytes().into(),
        now.into(),
        now.into(),
        (&row.records).into(),
    ]
}
