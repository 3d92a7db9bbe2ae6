//! Stored models in the SQLite file.

use std::path::Path;

use futures_util::future::BoxFuture;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqlitePool, SqlitePoolOptions};

use super::models::{KeptModel, ModelRow, ModelShelf, ModelStore, NewModel, PutModel, column};
use super::sqlite::{BUSY_TIMEOUT, DATABASE, SqliteStore};
use super::sqlite_jobs::usage::usage;
use super::{OpenError, StoreError, now_ms};

impl ModelShelf for SqliteStore {
    fn model(&self, name: String, revision: Option<u32>) -> BoxFuture<'_, Result<Option<KeptModel>, StoreError>> {
        Box::pin(model_in(&self.readers, name, revision))
    }

    fn models(&self, shelf: String, after: String, limit: u32) -> BoxFuture<'_, Result<Vec<KeptModel>, StoreError>> {
        Box::pin(models_in(&self.readers, shelf, after, limit))
    }

    fn model_names(&self, shelf: String, limit: u32) -> BoxFuture<'_, Result<Vec<String>, StoreError>> {
        Box::pin(names_in(&self.readers, shelf, limit))
    }
}

/// The models in the database of a data folder, for reading: whoever serves from the folder is not disturbed.
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

impl ModelShelf for SqliteShelf {
    fn model(&self, name: String, revision: Option<u32>) -> BoxFuture<'_, Result<Option<KeptModel>, StoreError>> {
        Box::pin(model_in(&self.0, name, revision))
    }

    fn models(&self, shelf: String, after: String, limit: u32) -> BoxFuture<'_, Result<Vec<KeptModel>, StoreError>> {
        Box::pin(models_in(&self.0, shelf, after, limit))
    }

    fn model_names(&self, shelf: String, limit: u32) -> BoxFuture<'_, Result<Vec<String>, StoreError>> {
        Box::pin(names_in(&self.0, shelf, limit))
    }
}

async fn model_in(pool: &SqlitePool, name: String, revision: Option<u32>) -> Result<Option<KeptModel>, StoreError> {
    let row: Option<ModelRow> = sqlx::query_as(
        "SELECT name, revision, calculator, content, sha256, created_ms FROM models
         WHERE name = ?1 AND content IS NOT NULL AND (?2 IS NULL OR revision = ?2)
         ORDER BY revision DESC LIMIT 1",
    )
    .bind(name)
    .bind(column(revision))
    .fetch_optional(pool)
    .await?;
    Ok(row.and_then(ModelRow::model))
}

async fn models_in(pool: &SqlitePool, shelf: String, after: String, limit: u32) -> Result<Vec<KeptModel>, StoreError> {
    let rows: Vec<ModelRow> = sqlx::query_as(
        "SELECT name, revision, calculator, content, sha256, created_ms FROM models AS one
         WHERE name > ?1 AND content IS NOT NULL
           AND substr(name, 1, length(?3)) = ?3 AND instr(substr(name, length(?3) + 1), '/') = 0
           AND revision = (SELECT max(revision) FROM models WHERE name = one.name AND content IS NOT NULL)
         ORDER BY name LIMIT ?2",
    )
    .bind(shelf.clone() + &after)
    .bind(limit)
    .bind(shelf)
    .fetch_all(pool)
    .await?;
    Ok(rows.into_iter().filter_map(ModelRow::model).collect())
}

async fn names_in(pool: &SqlitePool, shelf: String, limit: u32) -> Result<Vec<String>, StoreError> {
    let names = sqlx::query_scalar(
        "SELECT DISTINCT substr(name, length(?2) + 1) FROM models WHERE content IS NOT NULL
           AND substr(name, 1, length(?2)) = ?2 AND instr(substr(name, length(?2) + 1), '/') = 0
         ORDER BY 1 LIMIT ?1",
    );
    Ok(names.bind(limit).bind(shelf).fetch_all(pool).await?)
}

impl ModelStore for SqliteStore {
    fn put_model(&self, model: NewModel) -> BoxFuture<'_, Result<PutModel, StoreError>> {
        Box::pin(self.ledger.write(move |connection| {
            let model = model.clone();
            Box::pin(async move { put(connection, &model, now_ms()).await })
        }))
    }

    fn delete_model(&self, name: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(async move {
            self.ledger
                .write(move |connection| {
                    let name = name.clone();
                    Box::pin(async move {
                        let done = sqlx::query(
                            "UPDATE models SET content = NULL, bytes = 0 WHERE name = ?1 AND content IS NOT NULL",
                        )
                        .bind(name)
                        .execute(connection)
                        .await?;
                        Ok(done.rows_affected() > 0)
                    })
                })
                .await
        })
    }
}

async fn put(connection: &mut SqliteConnection, model: &NewModel, now: i64) -> Result<PutModel, sqlx::Error> {
    if model.quota.kept_bytes.is_some() {
        let usage = usage(connection, &model.owner, now).await?;
        if !usage.has_room(&model.quota, model.content.len() as u64) {
            return Ok(PutModel::OverQuota(usage));
        }
    }
    let row = sqlx::query_as(
        "INSERT INTO models (name, revision, calculator, content, sha256, created_ms, owner, bytes)
         SELECT ?1, 1 + coalesce(max(revision), 0), ?2, ?3, ?4, ?5, ?7, octet_length(?3) FROM models WHERE name = ?1
         HAVING NOT ?6 OR count(content) = 0
         RETURNING name, revision, calculator, content, sha256, created_ms",
    )
    .bind(&model.name)
    .bind(&model.calculator)
    .bind(&model.content)
    .bind(&model.sha256)
    .bind(now)
    .bind(model.only_new)
    .bind(&model.owner)
    .fetch_optional(connection)
    .await?;
    Ok(ModelRow::put(row))
}
