//! Records of processes under watch.

use std::sync::Arc;

use futures_util::future::BoxFuture;

use super::callbacks::{WithCallback, note_entry, told};
use super::documents::{delete as delete_document, put};
use super::usage::usage_of;
use crate::store::StoreError;
use crate::store::documents::{Kind, NewDocument, NewDocuments, PutDocuments};
use crate::store::processes::{
    Added, Addition, Entry, EntryKind, Head, KeptPart, MOST_SNAPSHOTS, NewEntry, PartNow, ProcessStore, Snapshot,
};
use crate::store::quota::Quota;
use crate::store::sql::{Lock, Outcome, Session, Writes, sql};

macro_rules! entries {
    ($rest:literal) => {
        concat!(
            "SELECT entry.sequence, kind, part, revision, number, content, said, created_ms, ",
            told!(),
            " FROM process_entries AS entry LEFT JOIN callbacks
                 ON callbacks.process = entry.process AND callbacks.sequence = entry.sequence
             WHERE entry.process = $1 ",
            $rest
        )
    };
}

macro_rules! parts {
    ($rest:literal) => {
        concat!(
            "SELECT parts.part, parts.number, sequence, revision, content, said, now, created_ms
             FROM process_parts AS parts JOIN process_entries USING (process, sequence) WHERE process = $1 ",
            $rest
        )
    };
}

struct EntryRow {
    sequence: i64,
    kind: String,
    part: Option<String>,
    revision: u32,
    number: Option<i64>,
    content: String,
    said: String,
    created_ms: i64,
}

from_row!(EntryRow { sequence, kind, part, revision as i32, number, content, said, created_ms });

fn read(rows: Vec<WithCallback<EntryRow>>) -> Outcome<Vec<Entry>> {
    let entry = |WithCallback { row, told }: WithCallback<EntryRow>| {
        let EntryRow { sequence, kind, part, revision, number, content, said, created_ms } = row;
        Ok(Entry { sequence, kind, part, revision, number, content, said, created_ms, callback: told.callback()? })
    };
    rows.into_iter().map(entry).collect()
}

impl<W: Writes> ProcessStore for W {
    fn process(&self, name: String) -> BoxFuture<'_, Result<Option<Head>, StoreError>> {
        Box::pin(async move {
            let head = sql("SELECT sequence, state FROM processes WHERE name = $1").bind(name);
            Ok(self.reader().await?.first(head).await?)
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
            let entries =
                sql(entries!("AND entry.sequence > $2 AND (part IS NULL OR NOT $4) ORDER BY entry.sequence LIMIT $3"));
            let entries = entries.bind(name).bind(after).bind(limit).bind(without_parts);
            Ok(read(self.reader().await?.all(entries).await?)?)
        })
    }

    fn part_entries(&self, name: String, part: String) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        Box::pin(async move {
            let entries = sql(entries!("AND part = $2 ORDER BY entry.sequence")).bind(name).bind(part);
            Ok(read(self.reader().await?.all(entries).await?)?)
        })
    }

    fn process_parts(
        &self,
        name: String,
        (from, to): (i64, i64),
        limit: u32,
    ) -> BoxFuture<'_, Result<Vec<KeptPart>, StoreError>> {
        Box::pin(async move {
            let parts = sql(parts!("AND parts.number BETWEEN $2 AND $3 ORDER BY parts.number LIMIT $4"));
            Ok(self.reader().await?.all(parts.bind(name).bind(from).bind(to).bind(limit)).await?)
        })
    }

    fn process_part(&self, name: String, part: String) -> BoxFuture<'_, Result<Option<KeptPart>, StoreError>> {
        Box::pin(async move {
            Ok(self.reader().await?.first(sql(parts!("AND parts.part = $2")).bind(name).bind(part)).await?)
        })
    }

    fn process_snapshot(
        &self,
        name: String,
        before: Option<i64>,
    ) -> BoxFuture<'_, Result<Option<Snapshot>, StoreError>> {
        Box::pin(async move {
            // It says nothing of parts that came late, or were corrected or withdrawn since, nor of another document.
            let snapshot = sql("SELECT number, content FROM process_snapshots AS own
                 WHERE process = $1
                   AND number < coalesce($2, (SELECT max(number) FROM process_parts WHERE process = $1))
                   AND NOT EXISTS (
                     SELECT 1 FROM process_entries AS later
                     WHERE later.process = $1 AND later.sequence > own.sequence AND later.kind = 'document')
                   AND NOT EXISTS (
                     SELECT 1 FROM process_entries AS later JOIN process_entries AS of_part USING (process, part)
                     WHERE process = $1 AND later.sequence > own.sequence AND of_part.number <= own.number)
                 ORDER BY number DESC LIMIT 1");
            Ok(self.reader().await?.first(snapshot.bind(name).bind(before)).await?)
        })
    }

    fn add_to_process(&self, addition: Addition) -> BoxFuture<'_, Result<Added, StoreError>> {
        let addition = Arc::new(addition);
        self.write(move |connection| {
            let addition = Arc::clone(&addition);
            Box::pin(async move { add(connection, &addition).await })
        })
    }

    fn delete_process(&self, name: String, at: i64) -> BoxFuture<'_, Result<bool, StoreError>> {
        self.write(move |connection| {
            let name = name.clone();
            Box::pin(async move { delete(connection, &name, at).await })
        })
    }
}

async fn add<S: Session>(connection: &mut S, new: &Addition) -> Outcome<Added> {
    connection.lock(Lock::Process(&new.process)).await?;
    let now = connection.now_ms().await?;
    let there = sql("SELECT sequence FROM processes WHERE name = $1").bind(&new.process);
    let there = connection.first::<(i64,)>(there).await?.map(|row| row.0);
    if there != new.after {
        return Ok(Added::Stale);
    }
    if new.quota.kept_bytes.is_some() {
        let usage = usage_of(connection, &new.owner).await?;
        if !usage.has_room(&new.quota, new.bytes()) {
            return Ok(Added::OverQuota(usage));
        }
    }
    if there.is_none() {
        // Of two who make it at once the second sees that it is there.
        let made = sql("INSERT INTO processes (name, sequence) VALUES ($1, 0) ON CONFLICT DO NOTHING");
        if connection.run(made.bind(&new.process)).await? == 0 {
            return Ok(Added::Stale);
        }
    }
    let kept_as = match &new.document {
        Some(document) => keep(connection, new, document).await?,
        None => None,
    };
    if let Some(model) = &new.model {
        keep(connection, new, model).await?;
    }
    let before = there.unwrap_or(0);
    let sequence_of = |place: usize| before.saturating_add(1).saturating_add(i64::try_from(place).unwrap_or(i64::MAX));
    for (place, entry) in new.entries.iter().enumerate() {
        let revision = kept_as.filter(|_| entry.kind == EntryKind::Document).unwrap_or(entry.revision);
        add_entry(connection, new, (sequence_of(place), revision, now), entry).await?;
    }
    for part in &new.parts {
        set_part(connection, &new.process, part, sequence_of).await?;
    }
    for (place, callback) in &new.tells {
        note_entry(connection, (&new.process, sequence_of(*place)), callback, now).await?;
    }
    let sequence = sequence_of(new.entries.len()) - 1;
    keep_snapshots(connection, new, sequence).await?;
    let head = sql("UPDATE processes SET sequence = $2, state = $3 WHERE name = $1");
    connection.run(head.bind(&new.process).bind(sequence).bind(&new.state)).await?;
    Ok(Added::Done { sequence, created_ms: now })
}

/// Keeps a process as it is after some of its parts.
async fn keep_snapshots<S: Session>(connection: &mut S, new: &Addition, sequence: i64) -> Outcome<()> {
    for snapshot in &new.snapshots {
        let kept = sql("INSERT INTO process_snapshots (process, number, sequence, content) VALUES ($1, $2, $3, $4)
             ON CONFLICT (process, number) DO UPDATE SET sequence = $3, content = $4");
        let kept = kept.bind(&new.process).bind(snapshot.number).bind(sequence).bind(&snapshot.content);
        connection.run(kept).await?;
    }
    if !new.snapshots.is_empty() {
        let old = sql("DELETE FROM process_snapshots WHERE process = $1 AND (sequence, number) <= (
                 SELECT sequence, number FROM process_snapshots WHERE process = $1
                 ORDER BY sequence DESC, number DESC LIMIT 1 OFFSET $2)");
        connection.run(old.bind(&new.process).bind(MOST_SNAPSHOTS)).await?;
    }
    Ok(())
}

/// Keeps a document of a process, for which there is room; its revision.
async fn keep<S: Session>(connection: &mut S, new: &Addition, document: &NewDocument) -> Outcome<Option<u32>> {
    let documents = vec![document.clone()];
    let (owner, quota) = (new.owner.clone(), Quota::default());
    let kept = NewDocuments { documents, only_new: false, unless_equal: false, owner, quota, most: u64::MAX };
    Ok(match put(connection, &kept).await? {
        PutDocuments::Kept(placed) => placed.first().map(|placed| placed.revision),
        _ => None,
    })
}

async fn add_entry<S: Session>(
    connection: &mut S,
    new: &Addition,
    (sequence, revision, now): (i64, u32, i64),
    entry: &NewEntry,
) -> Outcome<()> {
    let added = sql("INSERT INTO process_entries
             (process, sequence, kind, part, revision, number, created_ms, owner, bytes, content, said)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11)");
    let added = added.bind(&new.process).bind(sequence).bind(entry.kind.word()).bind(&entry.part).bind(revision);
    let added = added.bind(entry.number).bind(entry.created_ms.unwrap_or(now)).bind(&new.owner);
    let added = added.bind(i64::try_from(entry.bytes()).unwrap_or(i64::MAX)).bind(&entry.content).bind(&entry.said);
    connection.run(added).await.map(drop)
}

async fn set_part<S: Session>(
    connection: &mut S,
    process: &str,
    part: &PartNow,
    sequence_of: impl Fn(usize) -> i64,
) -> Outcome<()> {
    let set = match part.entry {
        Some((number, place)) => sql("INSERT INTO process_parts (process, part, now, number, sequence)
                 VALUES ($1, $2, $3, $4, $5)
                 ON CONFLICT (process, part) DO UPDATE SET now = $3, number = $4, sequence = $5")
        .bind(process)
        .bind(&part.part)
        .bind(&part.now)
        .bind(number)
        .bind(sequence_of(place)),
        None => sql("UPDATE process_parts SET now = $3 WHERE process = $1 AND part = $2")
            .bind(process)
            .bind(&part.part)
            .bind(&part.now),
    };
    connection.run(set).await.map(drop)
}

async fn delete<S: Session>(connection: &mut S, name: &str, at: i64) -> Outcome<bool> {
    let gone = sql("DELETE FROM processes WHERE name = $1 AND sequence = $2").bind(name).bind(at);
    if connection.run(gone).await? == 0 {
        return Ok(false);
    }
    for of_it in [
        "DELETE FROM process_entries WHERE process = $1",
        "DELETE FROM process_parts WHERE process = $1",
        "DELETE FROM process_snapshots WHERE process = $1",
        "DELETE FROM callbacks WHERE process = $1",
    ] {
        connection.run(sql(of_it).bind(name)).await?;
    }
    delete_document(connection, Kind::Process, name).await?;
    Ok(true)
}
