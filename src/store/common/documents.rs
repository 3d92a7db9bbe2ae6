//! Documents under names.

use std::sync::Arc;

use futures_util::future::BoxFuture;

use super::usage::usage_of;
use crate::store::StoreError;
use crate::store::documents::{
    DocumentShelf, DocumentStore, KeptDocument, Kind, NewDocuments, Newest, Placed, PutDocuments, Revisions, Title,
};
use crate::store::sql::{Lock, Outcome, Reads, Session, Writes, sql};

/// Of a shelf `$2` the newest revisions that are there of kind `$1`, as `one`. Nothing behind a shelf has a slash.
macro_rules! on_shelf {
    ($columns:literal, $rest:literal) => {
        concat!(
            "SELECT ",
            $columns,
            " FROM documents AS one WHERE kind = $1 AND content IS NOT NULL
                 AND substr(name, 1, length($2)) = $2 AND substr(name, length($2) + 1) NOT LIKE '%/%'
                 AND revision = (SELECT max(revision) FROM documents
                                 WHERE kind = $1 AND name = one.name AND content IS NOT NULL) ",
            $rest
        )
    };
}

impl<R: Reads> DocumentShelf for R {
    fn document(
        &self,
        kind: Kind,
        name: String,
        revision: Option<u32>,
    ) -> BoxFuture<'_, Result<Option<KeptDocument>, StoreError>> {
        Box::pin(async move {
            let document = sql("SELECT name, revision, class, content, sha256, created_ms FROM documents
                 WHERE kind = $1 AND name = $2 AND content IS NOT NULL AND ($3 IS NULL OR revision = $3)
                 ORDER BY revision DESC LIMIT 1");
            Ok(self.reader().await?.first(document.bind(kind.word()).bind(name).bind(revision)).await?)
        })
    }

    fn documents(
        &self,
        kind: Kind,
        shelf: String,
        after: String,
        limit: u32,
    ) -> BoxFuture<'_, Result<Vec<KeptDocument>, StoreError>> {
        Box::pin(async move {
            let documents = sql(on_shelf!(
                "name, revision, class, content, sha256, created_ms",
                "AND name > $3 ORDER BY name LIMIT $4"
            ));
            let documents = documents.bind(kind.word()).bind(&shelf).bind(shelf.clone() + &after).bind(limit);
            Ok(self.reader().await?.all(documents).await?)
        })
    }

    fn titles(&self, kind: Kind, shelf: String, limit: u32) -> BoxFuture<'_, Result<Vec<Title>, StoreError>> {
        Box::pin(async move {
            let titles =
                sql(on_shelf!("substr(name, length($2) + 1) AS name, class, words", "ORDER BY one.name LIMIT $3"));
            Ok(self.reader().await?.all(titles.bind(kind.word()).bind(shelf).bind(limit)).await?)
        })
    }

    fn revisions(&self, kind: Kind, name: String) -> BoxFuture<'_, Result<Revisions, StoreError>> {
        Box::pin(async move {
            let revisions = sql(
                "SELECT revision, content IS NOT NULL FROM documents WHERE kind = $1 AND name = $2 ORDER BY revision",
            );
            let rows: Vec<(i32, bool)> = self.reader().await?.all(revisions.bind(kind.word()).bind(name)).await?;
            Ok(Revisions::of(&rows))
        })
    }
}

impl<W: Writes> DocumentStore for W {
    fn put_documents(&self, new: NewDocuments) -> BoxFuture<'_, Result<PutDocuments, StoreError>> {
        let new = Arc::new(new);
        self.write(move |connection| {
            let new = Arc::clone(&new);
            Box::pin(async move { put(connection, &new).await })
        })
    }

    fn delete_document(&self, kind: Kind, name: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        self.write(move |connection| {
            let name = name.clone();
            Box::pin(async move { delete(connection, kind, &name).await })
        })
    }

    fn generation(&self) -> BoxFuture<'_, Result<Option<i64>, StoreError>> {
        Box::pin(async move { Ok(self.reader().await?.generation().await?) })
    }
}

/// Empties every revision of a document; numbers go on after them. Whether there was one.
pub(super) async fn delete<S: Session>(connection: &mut S, kind: Kind, name: &str) -> Outcome<bool> {
    let deleted = sql("UPDATE documents SET content = NULL, words = '', bytes = 0
         WHERE kind = $1 AND name = $2 AND content IS NOT NULL");
    Ok(connection.run(deleted.bind(kind.word()).bind(name)).await? > 0)
}

pub(super) async fn put<S: Session>(connection: &mut S, new: &NewDocuments) -> Outcome<PutDocuments> {
    // One after the other, so that no two take the same number.
    connection.lock(Lock::Library).await?;
    let mut beside = Vec::with_capacity(new.documents.len());
    for document in &new.documents {
        let newest = sql("SELECT revision, sha256, created_ms FROM documents
             WHERE kind = $1 AND name = $2 AND content IS NOT NULL ORDER BY revision DESC LIMIT 1");
        let newest: Option<Newest> = connection.first(newest.bind(document.kind.word()).bind(&document.name)).await?;
        beside.push(new.beside(document, newest.as_ref()));
    }
    let kept = sql("SELECT count(*) FROM documents WHERE kind NOT IN ('model', 'process') AND content IS NOT NULL");
    let (kept,): (i64,) = connection.one(kept).await?;
    let usage = match new.quota.kept_bytes {
        Some(_) => Some(usage_of(connection, &new.owner).await?),
        None => None,
    };
    if let Some(refused) = new.refused(&beside, u64::try_from(kept).unwrap_or(0), usage) {
        return Ok(refused);
    }
    let now = connection.now_ms().await?;
    let mut placed = Vec::with_capacity(beside.len());
    for (document, beside) in new.documents.iter().zip(beside) {
        let before = match beside {
            Ok(there) => {
                placed.push(there);
                continue;
            }
            Err(before) => before,
        };
        // Numbers go on after what was deleted.
        let kept =
            sql("INSERT INTO documents (kind, name, revision, class, words, content, sha256, created_ms, owner, bytes)
             SELECT $1, $2, 1 + coalesce(max(revision), 0), $3, $4, $5, $6, $7, $8, octet_length($5)
             FROM documents WHERE kind = $1 AND name = $2
             RETURNING revision");
        let kept = kept.bind(document.kind.word()).bind(&document.name).bind(&document.class).bind(&document.words);
        let kept = kept.bind(&document.content).bind(&document.sha256).bind(now).bind(&new.owner);
        let (revision,): (i32,) = connection.one(kept).await?;
        placed.push(Placed { revision: u32::try_from(revision).unwrap_or(0), created_ms: now, before });
    }
    Ok(PutDocuments::Kept(placed))
}
