//! Documents under names in PostgreSQL.

use futures_util::future::BoxFuture;
use sqlx::postgres::PgConnection;

use super::PostgresStore;
use super::usage::{lock_owner, usage};
use crate::store::StoreError;
use crate::store::documents::{
    DocumentShelf, DocumentStore, KeptDocument, Kind, NewDocuments, Newest, Placed, PutDocuments, Revisions, Title,
    column,
};

impl DocumentShelf for PostgresStore {
    fn document(
        &self,
        kind: Kind,
        name: String,
        revision: Option<u32>,
    ) -> BoxFuture<'_, Result<Option<KeptDocument>, StoreError>> {
        Box::pin(async move {
            let document = sqlx::query_as(
                "SELECT name, revision, class, content, sha256, created_ms FROM precut.documents
                 WHERE kind = $1 AND name = $2 AND content IS NOT NULL AND ($3::integer IS NULL OR revision = $3)
                 ORDER BY revision DESC LIMIT 1",
            );
            Ok(document.bind(kind.word()).bind(name).bind(column(revision)).fetch_optional(&self.pool).await?)
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
                "SELECT DISTINCT ON (name COLLATE \"C\") name, revision, class, content, sha256, created_ms
                 FROM precut.documents
                 WHERE kind = $4 AND name COLLATE \"C\" > $1 AND content IS NOT NULL
                   AND left(name, length($3)) = $3 AND position('/' IN substr(name, length($3) + 1)) = 0
                 ORDER BY name COLLATE \"C\", revision DESC LIMIT $2",
            );
            let documents = documents.bind(shelf.clone() + &after).bind(i64::from(limit)).bind(shelf).bind(kind.word());
            Ok(documents.fetch_all(&self.pool).await?)
        })
    }

    fn titles(&self, kind: Kind, shelf: String, limit: u32) -> BoxFuture<'_, Result<Vec<Title>, StoreError>> {
        Box::pin(async move {
            let titles = sqlx::query_as(
                "SELECT DISTINCT ON (documents.name COLLATE \"C\") substr(name, length($2) + 1) AS name, class, words
                 FROM precut.documents
                 WHERE kind = $3 AND content IS NOT NULL
                   AND left(name, length($2)) = $2 AND position('/' IN substr(name, length($2) + 1)) = 0
                 ORDER BY documents.name COLLATE \"C\", revision DESC LIMIT $1",
            );
            Ok(titles.bind(i64::from(limit)).bind(shelf).bind(kind.word()).fetch_all(&self.pool).await?)
        })
    }

    fn revisions(&self, kind: Kind, name: String) -> BoxFuture<'_, Result<Revisions, StoreError>> {
        Box::pin(async move {
            let rows = sqlx::query_as(
                "SELECT revision, content IS NOT NULL FROM precut.documents WHERE kind = $1 AND name = $2 ORDER BY revision",
            );
            Ok(Revisions::of(&rows.bind(kind.word()).bind(name).fetch_all(&self.pool).await?))
        })
    }
}

impl DocumentStore for PostgresStore {
    fn put_documents(&self, new: NewDocuments) -> BoxFuture<'_, Result<PutDocuments, StoreError>> {
        Box::pin(self.write(|connection| Box::pin(put(connection, new))))
    }

    fn delete_document(&self, kind: Kind, name: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(async move {
            let deleted = sqlx::query(
                "UPDATE precut.documents SET content = NULL, words = '', bytes = 0
                 WHERE kind = $1 AND name = $2 AND content IS NOT NULL",
            );
            let deleted = deleted.bind(kind.word()).bind(name).execute(&self.pool).await?;
            Ok(deleted.rows_affected() > 0)
        })
    }

    fn generation(&self) -> BoxFuture<'_, Result<Option<i64>, StoreError>> {
        Box::pin(async move {
            Ok(sqlx::query_scalar("SELECT generation FROM precut.library").fetch_optional(&self.pool).await?)
        })
    }
}

pub(super) async fn put(connection: &mut PgConnection, new: NewDocuments) -> Result<PutDocuments, sqlx::Error> {
    // One after the other, so that no two take the same number.
    sqlx::query("SELECT generation FROM precut.library FOR UPDATE").execute(&mut *connection).await?;
    let mut beside = Vec::with_capacity(new.documents.len());
    for document in &new.documents {
        let newest: Option<Newest> = sqlx::query_as(
            "SELECT revision, sha256, created_ms FROM precut.documents
             WHERE kind = $1 AND name = $2 AND content IS NOT NULL ORDER BY revision DESC LIMIT 1",
        )
        .bind(document.kind.word())
        .bind(&document.name)
        .fetch_optional(&mut *connection)
        .await?;
        beside.push(new.beside(document, newest.as_ref()));
    }
    let (now, kept): (i64, i64) = sqlx::query_as(
        "SELECT precut.now_ms(), count(*) FROM precut.documents WHERE kind NOT IN ('model', 'process') AND content IS NOT NULL",
    )
    .fetch_one(&mut *connection)
    .await?;
    let usage = match new.quota.kept_bytes {
        Some(_) => {
            lock_owner(connection, &new.owner).await?;
            Some(usage(connection, &new.owner).await?)
        }
        None => None,
    };
    if let Some(refused) = new.refused(&beside, u64::try_from(kept).unwrap_or(0), usage) {
        return Ok(refused);
    }
    let mut placed = Vec::with_capacity(beside.len());
    for (document, beside) in new.documents.into_iter().zip(beside) {
        let before = match beside {
            Ok(there) => {
                placed.push(there);
                continue;
            }
            Err(before) => before,
        };
        let revision: i32 = sqlx::query_scalar(
            "INSERT INTO precut.documents (kind, name, revision, class, words, content, sha256, created_ms, owner, bytes)
             SELECT $1, $2, 1 + coalesce(max(revision), 0), $3, $4, $5, $6, $7, $8, octet_length($5)
             FROM precut.documents WHERE kind = $1 AND name = $2
             RETURNING revision",
        )
        .bind(document.kind.word())
        .bind(document.name)
        .bind(document.class)
        .bind(document.words)
        .bind(document.content)
        .bind(document.sha256)
        .bind(now)
        .bind(&new.owner)
        .fetch_one(&mut *connection)
        .await?;
        placed.push(Placed { revision: u32::try_from(revision).unwrap_or(0), created_ms: now, before });
    }
    Ok(PutDocuments::Kept(placed))
}
