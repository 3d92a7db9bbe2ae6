//! Kept results: found, listed, and who has asked for them.

use bytes::Bytes;

use super::jobs::count;
use crate::key::Key;
use crate::store::row::ResultRow;
use crate::store::sql::{Outcome, Session, Statement, Value, sql};
use crate::store::{Cursor, Origin, ResultPage, ResultQuery, ResultSummary};

pub(in crate::store) async fn row<S: Session>(connection: &mut S, key: Key) -> Outcome<Option<ResultRow>> {
    let row =
        sql("SELECT key, calculator, version, engine, input, body, checksum, records FROM results WHERE key = $1");
    connection.first(row.bind(key)).await
}

pub(in crate::store) async fn page<S: Session>(connection: &mut S, query: ResultQuery) -> Outcome<ResultPage> {
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

pub(in crate::store) async fn uses<S: Session>(
    connection: &mut S,
    record: String,
    owner: Option<String>,
) -> Outcome<u64> {
    let mut statement = sql("SELECT count(*) FROM results WHERE true");
    narrow(&mut statement, owner, Some(record));
    let (uses,): (i64,) = connection.one(statement).await?;
    Ok(u64::try_from(uses).unwrap_or(0))
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

pub(in crate::store) async fn note_asked<S: Session>(connection: &mut S, key: Key, owner: &str) -> Outcome<()> {
    let asked = sql("INSERT INTO asked (key, owner) VALUES ($1, $2) ON CONFLICT DO NOTHING").bind(key).bind(owner);
    connection.run(asked).await.map(drop)
}

pub(in crate::store) async fn has_asked<S: Session>(connection: &mut S, key: Key, owner: &str) -> Outcome<bool> {
    let asked = sql("SELECT EXISTS (SELECT 1 FROM asked WHERE key = $1 AND owner = $2)
             OR EXISTS (SELECT 1 FROM jobs WHERE key = $1 AND owner = $2)");
    let (asked,): (bool,) = connection.one(asked.bind(key).bind(owner)).await?;
    Ok(asked)
}

pub(in crate::store) async fn origin<S: Session>(
    connection: &mut S,
    key: Key,
    owner: Option<String>,
) -> Outcome<Origin> {
    let created = sql("SELECT created_ms FROM results WHERE key = $1").bind(key);
    let created_ms = connection.first::<(i64,)>(created).await?.map(|row| row.0);
    let asked_by = sql("SELECT owner FROM asked WHERE key = $1 AND ($3 IS NULL OR owner = $3) ORDER BY owner LIMIT $2");
    let asked_by: Vec<(String,)> = connection.all(asked_by.bind(key).bind(Origin::MOST).bind(owner)).await?;
    Ok(Origin { created_ms, asked_by: asked_by.into_iter().map(|(owner,)| owner).collect() })
}

/// The inputs of some results, compressed, as far as they take no more than `most` bytes.
pub(in crate::store) async fn inputs<S: Session>(
    connection: &mut S,
    keys: &[Key],
    most: usize,
) -> Outcome<Vec<(Key, Bytes)>> {
    if keys.is_empty() {
        return Ok(Vec::new());
    }
    let mut statement = sql("SELECT key, input FROM results WHERE octet_length(input) <= ");
    statement.push_bind(i64::try_from(most).unwrap_or(i64::MAX)).push(" AND key IN ").push_list(keys.iter().copied());
    let rows: Vec<(Vec<u8>, Vec<u8>)> = connection.all(statement).await?;
    Ok(rows.into_iter().filter_map(|(key, input)| Some((Key::from_bytes(&key)?, input.into()))).collect())
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
