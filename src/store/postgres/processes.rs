//! Records of processes in PostgreSQL.

use futures_util::future::BoxFuture;
use sqlx::postgres::PgConnection;

use super::PostgresStore;
use super::callbacks::note_entry;
use super::documents::put;
use super::usage::{lock_owner, usage};
use crate::store::StoreError;
use crate::store::documents::{Kind, NewDocuments, PutDocuments};
use crate::store::processes::{Added, Addition, Entry, EntryKind, Head, KeptPart, ProcessStore};
use crate::store::quota::Quota;

impl ProcessStore for PostgresStore {
    fn process(&self, name: String) -> BoxFuture<'_, Result<Option<Head>, StoreError>> {
        Box::pin(async move {
            let head = sqlx::query_as("SELECT sequence, state FROM precut.processes WHERE name = $1").bind(name);
            Ok(head.fetch_optional(&self.pool).await?)
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
                "SELECT sequence, kind, part, revision, number, content, said, created_ms FROM precut.process_entries
                 WHERE process = $1 AND sequence > $2 AND (part IS NULL OR NOT $4) ORDER BY sequence LIMIT $3",
            );
            Ok(entries.bind(name).bind(after).bind(i64::from(limit)).bind(without_parts).fetch_all(&self.pool).await?)
        })
    }

    fn part_entries(&self, name: String, part: String) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        Box::pin(async move {
            let entries = sqlx::query_as(
                "SELECT sequence, kind, part, revision, number, content, said, created_ms FROM precut.process_entries
                 WHERE process = $1 AND part = $2 ORDER BY sequence",
            );
            Ok(entries.bind(name).bind(part).fetch_all(&self.pool).await?)
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
                 FROM precut.process_parts AS parts JOIN precut.process_entries USING (process, sequence)
                 WHERE process = $1 AND parts.number BETWEEN $2 AND $3 ORDER BY parts.number LIMIT $4",
            );
            Ok(parts.bind(name).bind(from).bind(to).bind(i64::from(limit)).fetch_all(&self.pool).await?)
        })
    }

    fn process_part(&self, name: String, part: String) -> BoxFuture<'_, Result<Option<KeptPart>, StoreError>> {
        Box::pin(async move {
            let part_now = sqlx::query_as(
                "SELECT parts.part, parts.number, sequence, revision, content, said, now, created_ms
                 FROM precut.process_parts AS parts JOIN precut.process_entries USING (process, sequence)
                 WHERE process = $1 AND parts.part = $2",
            );
            Ok(part_now.bind(name).bind(part).fetch_optional(&self.pool).await?)
        })
    }

    fn add_to_process(&self, addition: Addition) -> BoxFuture<'_, Result<Added, StoreError>> {
        Box::pin(self.write(|connection| Box::pin(add(connection, addition))))
    }

    fn delete_process(&self, name: String, at: i64) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(self.write(move |connection| Box::pin(delete(connection, name, at))))
    }
}

async fn add(connection: &mut PgConnection, new: Addition) -> Result<Added, sqlx::Error> {
    let now: i64 = sqlx::query_scalar("SELECT precut.now_ms()").fetch_one(&mut *connection).await?;
    let there: Option<i64> = sqlx::query_scalar("SELECT sequence FROM precut.processes WHERE name = $1 FOR UPDATE")
        .bind(&new.process)
        .fetch_optional(&mut *connection)
        .await?;
    if there != new.after {
        return Ok(Added::Stale);
    }
    if new.quota.kept_bytes.is_some() {
        lock_owner(connection, &new.owner).await?;
        let usage = usage(connection, &new.owner).await?;
        if !usage.has_room(&new.quota, new.bytes()) {
            return Ok(Added::OverQuota(usage));
        }
    }
    if there.is_none() {
        // Of two who make it at once the second sees that it is there.
        let made = sqlx::query("INSERT INTO precut.processes (name, sequence) VALUES ($1, 0) ON CONFLICT DO NOTHING");
        if made.bind(&new.process).execute(&mut *connection).await?.rows_affected() == 0 {
            return Ok(Added::Stale);
        }
    }
    let mut kept_as = None;
    if let Some(document) = &new.document {
        let documents = vec![document.clone()];
        let (owner, quota) = (new.owner.clone(), Quota::default());
        let kept = NewDocuments { documents, only_new: false, unless_equal: false, owner, quota, most: u64::MAX };
        if let PutDocuments::Kept(placed) = put(connection, kept).await? {
            kept_as = placed.first().map(|placed| placed.revision);
        }
    }
    let first = there.unwrap_or(0) + 1;
    for (sequence, entry) in (first..).zip(&new.entries) {
        let revision = kept_as.filter(|_| entry.kind == EntryKind::Document);
        sqlx::query(
            "INSERT INTO precut.process_entries (process, sequence, kind, part, revision, number, created_ms, owner, bytes, content, said)
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11)",
        )
        .bind(&new.process)
        .bind(sequence)
        .bind(entry.kind.word())
        .bind(&entry.part)
        .bind(i32::try_from(revision.unwrap_or(entry.revision)).unwrap_or(i32::MAX))
        .bind(entry.number.map(i64::from))
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
            Some((number, at)) => sqlx::query(
                "INSERT INTO precut.process_parts (process, part, number, sequence, now) VALUES ($1, $2, $3, $4, $5)
                     ON CONFLICT (process, part) DO UPDATE SET number = $3, sequence = $4, now = $5",
            )
            .bind(&new.process)
            .bind(&part.part)
            .bind(number.map(i64::from))
            .bind(place(at))
            .bind(&part.now)
            .execute(&mut *connection)
            .await?,
            None => {
                sqlx::query("UPDATE precut.process_parts SET now = $3 WHERE process = $1 AND part = $2")
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
    sqlx::query("UPDATE precut.processes SET sequence = $2, state = $3 WHERE name = $1")
        .bind(&new.process)
        .bind(sequence)
        .bind(&new.state)
        .execute(connection)
        .await?;
    Ok(Added::Done { sequence, created_ms: now })
}

async fn delete(connection: &mut PgConnection, name: String, at: i64) -> Result<bool, sqlx::Error> {
    let gone = sqlx::query("DELETE FROM precut.processes WHERE name = $1 AND sequence = $2").bind(&name).bind(at);
    if gone.execute(&mut *connection).await?.rows_affected() == 0 {
        return Ok(false);
    }
    sqlx::query("DELETE FROM precut.process_entries WHERE process = $1").bind(&name).execute(&mut *connection).await?;
    sqlx::query("DELETE FROM precut.process_parts WHERE process = $1").bind(&name).execute(&mut *connection).await?;
    sqlx::query("DELETE FROM precut.callbacks WHERE process = $1").bind(&name).execute(&mut *connection).await?;
    sqlx::query("UPDATE precut.documents SET content = NULL, words = '', bytes = 0 WHERE kind = $1 AND name = $2")
        .bind(Kind::Process.word())
        .bind(name)
        .execute(connection)
        .await?;
    Ok(true)
}
