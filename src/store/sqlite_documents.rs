//! Documents under names in the SQLite file.

use std::path::Path;
use std::sync::Arc;

use futures_util::future::BoxFuture;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqlitePool, SqlitePoolOptions};

use super::documents::{
    DocumentShelf, DocumentStore, KeptDocument, Kind, NewDocuments, Newest, Placed, PutDocuments, Revisions, Title,
    column,
};
use super::sqlite::{BUSY_TIMEOUT, DATABASE, SqliteStore};
use super::sqlite_jobs::usage::usage;
use super::{OpenError, StoreError, now_ms};

/// The documents in the database of a data folder, for reading: whoever serves from the folder is not disturbed.
pub(crate) struct SqliteShelf(SqlitePool);

impl SqliteShelf {
    pub(crate) async fn open(folder: &Path) -> Result<Self, OpenError> {
        let options = SqliteConnectOptions::new()
            .filename(folder.join(DATABASE))
            .create_if_missing(false)
            .busy_timeout(BUSY_TIMEOUT)
            .pragma("query_only", "ON");
        let opened = SqlitePoolOptions::new().max_connections(1).acquire_timeout(BUSY_TIMEOUT).connect_with(options);
        let unusable =
            |error: sqlx::Error| OpenError::Unusable { folder: folder.to_owned(), reason: error.to_string() };
        opened.await.map(Self).map_err(unusable)
    }

    pub(crate) async fn close(self) {
        self.0.close().await;
    }
}

/// What reads documents.
trait Readers: Send + Sync + 'static {
    fn readers(&self) -> &SqlitePool;
}

impl Readers for SqliteStore {
    fn readers(&self) -> &SqlitePool {
        &self.readers
    }
}

impl Readers for SqliteShelf {
    fn readers(&self) -> &SqlitePool {
        &self.0
    }
}

impl<R: Readers> DocumentShelf for R {
    fn document(
        &self,
        kind: Kind,
        name: String,
        revision: Option<u32>,
    ) -> BoxFuture<'_, Result<Option<KeptDocument>, StoreError>> {
        Box::pin(async move {
            let document = sqlx::query_as(
                "SELECT name, revision, class, content, sha256, created_ms FROM documents
                 WHERE kind = ?1 AND name = ?2 AND content IS NOT NULL AND (?3 IS NULL OR revision = ?3)
                 ORDER BY revision DESC LIMIT 1",
            );
            let document = document.bind(kind.word()).bind(name).bind(column(revision));
            Ok(document.fetch_optional(self.readers()).await?)
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
            let documents = sqlx::query_as(
                "SELECT name, revision, class, content, sha256, created_ms FROM documents AS one
                 WHERE kind = ?4 AND name > ?1 AND content IS NOT NULL
                   AND substr(name, 1, length(?3)) = ?3 AND instr(substr(name, length(?3) + 1), '/') = 0
                   AND revision = (SELECT max(revision) FROM documents WHERE kind = ?4 AND name = one.name AND content IS NOT NULL)
                 ORDER BY name LIMIT ?2",
            );
            let documents = documents.bind(shelf.clone() + &after).bind(limit).bind(shelf).bind(kind.word());
            Ok(documents.fetch_all(self.readers()).await?)
        })
    }

    fn titles(&self, kind: Kind, shelf: String, limit: u32) -> BoxFuture<'_, Result<Vec<Title>, StoreError>> {
        Box::pin(async move {
            let titles = sqlx::query_as(
                "SELECT substr(name, length(?2) + 1) AS name, class, words, max(revision) FROM documents
                 WHERE kind = ?3 AND content IS NOT NULL
                   AND substr(name, 1, length(?2)) = ?2 AND instr(substr(name, length(?2) + 1), '/') = 0
                 GROUP BY documents.name ORDER BY documents.name LIMIT ?1",
            );
            Ok(titles.bind(limit).bind(shelf).bind(kind.word()).fetch_all(self.readers()).await?)
        })
    }

    fn revisions(&self, kind: Kind, name: String) -> BoxFuture<'_, Result<Revisions, StoreError>> {
        Box::pin(async move {
            let rows = sqlx::query_as(
                "SELECT revision, content IS NOT NULL FROM documents WHERE kind = ?1 AND name = ?2 ORDER BY revision",
            );
            Ok(Revisions::of(&rows.bind(kind.word()).bind(name).fetch_all(self.readers()).await?))
        })
    }
}

impl DocumentStore for SqliteStore {
    fn put_documents(&self, new: NewDocuments) -> BoxFuture<'_, Result<PutDocuments, StoreError>> {
        let new = Arc::new(new);
        Box::pin(self.ledger.write(move |connection| {
            let new = Arc::clone(&new);
            Box::pin(async move { put(connection, &new, now_ms()).await })
        }))
    }

    fn delete_document(&self, kind: Kind, name: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(self.ledger.write(move |connection| {
            let deleted = sqlx::query(
                "UPDATE documents SET content = NULL, words = '', bytes = 0
                 WHERE kind = ?1 AND name = ?2 AND content IS NOT NULL",
            );
            let deleted = deleted.bind(kind.word()).bind(name.clone()).execute(connection);
            Box::pin(async { Ok(deleted.await?.rows_affected() > 0) })
        }))
    }
}

pub(super) async fn put(
    connection: &mut SqliteConnection,
    new: &NewDocuments,
    now: i64,
) -> Result<PutDocuments, sqlx::Error> {
    let mut beside = Vec::with_capacity(new.documents.len());
    for document in &new.documents {
        let newest: Option<Newest> = sqlx::query_as(
            "SELECT revision, sha256, created_ms FROM documents
             WHERE kind = ?1 AND name = ?2 AND content IS NOT NULL ORDER BY revision DESC LIMIT 1",
        )
        .bind(document.kind.word())
        .bind(&document.name)
        .fetch_optional(&mut *connection)
        .await?;
        beside.push(new.beside(document, newest.as_ref()));
    }
    let kept: i64 = sqlx::query_scalar(
        "SELECT count(*) FROM documents WHERE kind NOT IN ('model', 'process') AND content IS NOT NULL",
    )
    .fetch_one(&mut *connection)
    .await?;
    let usage = match new.quota.kept_bytes {
        Some(_) => Some(usage(connection, &new.owner, now).await?),
        None => None,
    };
    if let Some(refused) = new.refused(&beside, u64::try_from(kept).unwrap_or(0), usage) {
        return Ok(refused);
    }
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
        let revision: u32 = sqlx::query_scalar(
            "INSERT INTO documents (kind, name, revision, class, words, content, sha256, created_ms, owner, bytes)
             SELECT ?1, ?2, 1 + coalesce(max(revision), 0), ?3, ?4, ?5, ?6, ?7, ?8, octet_length(?5)
             FROM documents WHERE kind = ?1 AND name = ?2
             RETURNING revision",
        )
        .bind(document.kind.word())
        .bind(&document.name)
        .bind(&document.class)
        .bind(&document.words)
        .bind(&document.content)
        .bind(&document.sha256)
        .bind(now)
        .bind(&new.owner)
        .fetch_one(&mut *connection)
        .await?;
        placed.push(Placed { revision, created_ms: now, before });
    }
    Ok(PutDocuments::Kept(placed))
}
