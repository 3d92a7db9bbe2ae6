//! Records of processes in the SQLite file.

use std::sync::Arc;

use futures_util::future::BoxFuture;
use sqlx::sqlite::SqliteConnection;

use super::documents::{Kind, NewDocuments, PutDocuments};
use super::processes::{Added, Addition, Entry, Head, KeptPart, ProcessStore};
use super::quota::Quota;
use super::sqlite::SqliteStore;
use super::sqlite_documents::put;
use super::sqlite_jobs::callbacks::note_entry;
use super::sqlite_jobs::usage::usage;
use super::{StoreError, now_ms};

impl ProcessStore for SqliteStore {
    fn process(&self, name: String) -> BoxFuture<'_, Result<Option<Head>, StoreError>> {
        Box::pin(async move {
            let head = sqlx::query_as("SELECT sequence, state FROM processes WHERE name = ?1").bind(name);
            Ok(head.fetch_optional(&self.readers).await?)
        })
    }

    fn process_entries(
        &self,
        name: String,
        after: i64,
        limit: u32,
        without_parts: bool,
    ) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        Box::pin(async move {
            let entries = sqlx::query_as(
                "SELECT sequence, kind, part, revision, number, content, said, created_ms FROM process_entries
                 WHERE process = ?1 AND sequence > ?2 AND (part IS NULL OR NOT ?4) ORDER BY sequence LIMIT ?3",
            );
            Ok(entries.bind(name).bind(after).bind(limit).bind(without_parts).fetch_all(&self.readers).await?)
        })
    }

    fn part_entries(&self, name: String, part: String) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        Box::pin(async move {
            let entries = sqlx::query_as(
                "SELECT sequence, kind, part, revision, number, content, said, created_ms FROM process_entries
                 WHERE process = ?1 AND part = ?2 ORDER BY sequence",
            );
            Ok(entries.bind(name).bind(part).fetch_all(&self.readers).await?)
        })
    }

    fn process_parts(
        &self,
        name: String,
        (from, to): (i64, i64),
        limit: u32,
    ) -> BoxFuture<'_, Result<Vec<KeptPart>, StoreError>> {
        Box::pin(async move {
            let parts = sqlx::query_as(
                "SELECT parts.part, parts.number, sequence, revision, content, said, now, created_ms
                 FROM process_parts AS parts JOIN process_entries USING (process, sequence)
                 WHERE process = ?1 AND parts.number BETWEEN ?2 AND ?3 ORDER BY parts.number LIMIT ?4",
            );
            Ok(parts.bind(name).bind(from).bind(to).bind(limit).fetch_all(&self.readers).await?)
        })
    }

    fn process_part(&self, name: String, part: String) -> BoxFuture<'_, Result<Option<KeptPart>, StoreError>> {
        Box::pin(async move {
            let part_now = sqlx::query_as(
                "SELECT parts.part, parts.number, sequence, revision, content, said, now, created_ms
                 FROM process_parts AS parts JOIN process_entries USING (process, sequence)
                 WHERE process = ?1 AND parts.part = ?2",
            );
            Ok(part_now.bind(name).bind(part).fetch_optional(&self.readers).await?)
        })
    }

    fn add_to_process(&self, addition: Addition) -> BoxFuture<'_, Result<Added, StoreError>> {
        let addition = Arc::new(addition);
        Box::pin(self.ledger.write(move |connection| {
            let addition = Arc::clone(&addition);
            Box::pin(async move { add(connection, &addition, now_ms()).await })
        }))
    }

    fn delete_process(&self, name: String, at: i64) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(self.ledger.write(move |connection| {
            let name = name.clone();
            Box::pin(async move { delete(connection, &name, at).await })
        }))
    }
}

async fn add(connection: &mut SqliteConnection, new: &Addition, now: i64) -> Result<Added, sqlx::Error> {
    let there: Option<i64> = sqlx::query_scalar("SELECT sequence FROM processes WHERE name = ?1")
        .bind(&new.process)
        .fetch_optional(&mut *connection)
        .await?;
    if there != new.after {
        return Ok(Added::Stale);
    }
    if new.quota.kept_bytes.is_some() {
        let usage = usage(connection, &new.owner, now).await?;
        if !usage.has_room(&new.quota, new.bytes()) {
            return Ok(Added::OverQuota(usage));
        }
    }
    let mut kept_as = None;
    if let Some(document) = &new.document {
        let documents = vec![document.clone()];
        let (owner, quota) = (new.owner.clone(), Quota::default());
        let kept = NewDocuments { documents, only_new: false, unless_equal: false, owner, quota, most: u64::MAX };
        if let PutDocuments::Kept(placed) = put(connection, &kept, now).await? {
            kept_as = placed.first().map(|placed| placed.revision);
        }
    }
    let first = there.unwrap_or(0) + 1;
    for (sequence, entry) in (first..).zip(&new.entries) {
        let revision = kept_as.filter(|_| entry.kind == super::processes::EntryKind::Document);
        sqlx::query(
            "INSERT INTO process_entries (process, sequence, kind, part, revision, number, created_ms, owner, bytes, content, said)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)",
        )
        .bind(&new.process)
        .bind(sequence)
        .bind(entry.kind.word())
        .bind(&entry.part)
        .bind(revision.unwrap_or(entry.revision))
        .bind(entry.number)
        .bind(entry.created_ms.unwrap_or(now))
        .bind(&new.owner)
        .bind(i64::try_from(entry.bytes()).unwrap_or(i64::MAX))
        .bind(&entry.content)
        .bind(&entry.said)
        .execute(&mut *connection)
        .await?;
    }
    for part in &new.parts {
        let place = |place: usize| first.saturating_add(i64::try_from(place).unwrap_or(i64::MAX));
        match part.entry {
            Some((number, at)) => {
                sqlx::query(
                    "INSERT INTO process_parts (process, part, number, sequence, now) VALUES (?1, ?2, ?3, ?4, ?5)
                     ON CONFLICT (process, part) DO UPDATE SET number = ?3, sequence = ?4, now = ?5",
                )
                .bind(&new.process)
                .bind(&part.part)
                .bind(number)
                .bind(place(at))
                .bind(&part.now)
                .execute(&mut *connection)
                .await?
            }
            None => {
                sqlx::query("UPDATE process_parts SET now = ?3 WHERE process = ?1 AND part = ?2")
                    .bind(&new.process)
                    .bind(&part.part)
                    .bind(&part.now)
                    .execute(&mut *connection)
                    .await?
            }
        };
    }
    for (place, callback) in &new.tells {
        let sequence = first.saturating_add(i64::try_from(*place).unwrap_or(i64::MAX));
        note_entry(connection, (&new.process, sequence), callback, now).await?;
    }
    let sequence = first - 1 + i64::try_from(new.entries.len()).unwrap_or(0);
    sqlx::query(
        "INSERT INTO processes (name, sequence, state) VALUES (?1, ?2, ?3)
         ON CONFLICT (name) DO UPDATE SET sequence = ?2, state = ?3",
    )
    .bind(&new.process)
    .bind(sequence)
    .bind(&new.state)
    .execute(connection)
    .await?;
    Ok(Added::Done { sequence, created_ms: now })
}

async fn delete(connection: &mut SqliteConnection, name: &str, at: i64) -> Result<bool, sqlx::Error> {
    let gone = sqlx::query("DELETE FROM processes WHERE name = ?1 AND sequence = ?2").bind(name).bind(at);
    if gone.execute(&mut *connection).await?.rows_affected() == 0 {
        return Ok(false);
    }
    sqlx::query("DELETE FROM process_entries WHERE process = ?1").bind(name).execute(&mut *connection).await?;
    sqlx::query("DELETE FROM process_parts WHERE process = ?1").bind(name).execute(&mut *connection).await?;
    sqlx::query("DELETE FROM callbacks WHERE process = ?1").bind(name).execute(&mut *connection).await?;
    sqlx::query("UPDATE documents SET content = NULL, words = '', bytes = 0 WHERE kind = ?1 AND name = ?2")
        .bind(Kind::Process.word())
        .bind(name)
        .execute(connection)
        .await?;
    Ok(true)
}
