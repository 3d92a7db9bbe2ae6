//! Stored models in the SQLite file.

use futures_util::future::BoxFuture;

use super::models::{KeptModel, ModelRow, ModelStore, NewModel, column};
use super::sqlite::SqliteStore;
use super::{StoreError, now_ms};

impl ModelStore for SqliteStore {
    fn put_model(&self, model: NewModel) -> BoxFuture<'_, Result<Option<KeptModel>, StoreError>> {
        Box::pin(async move {
            let created_ms = now_ms();
            let row: Option<ModelRow> = self
                .ledger
                .write(move |connection| {
                    let model = model.clone();
                    Box::pin(async move {
                        sqlx::query_as(
                            "INSERT INTO models (name, revision, calculator, content, sha256, created_ms)
                             SELECT ?1, 1 + coalesce(max(revision), 0), ?2, ?3, ?4, ?5 FROM models WHERE name = ?1
                             HAVING NOT ?6 OR count(content) = 0
                             RETURNING name, revision, calculator, content, sha256, created_ms",
                        )
                        .bind(model.name)
                        .bind(model.calculator)
                        .bind(model.content)
                        .bind(model.sha256)
                        .bind(created_ms)
                        .bind(model.only_new)
                        .fetch_optional(connection)
                        .await
                    })
                })
                .await?;
            Ok(row.and_then(ModelRow::model))
        })
    }

    fn model(&self, name: String, revision: Option<u32>) -> BoxFuture<'_, Result<Option<KeptModel>, StoreError>> {
        Box::pin(async move {
            let row: Option<ModelRow> = sqlx::query_as(
                "SELECT name, revision, calculator, content, sha256, created_ms FROM models
                 WHERE name = ?1 AND content IS NOT NULL AND (?2 IS NULL OR revision = ?2)
                 ORDER BY revision DESC LIMIT 1",
            )
            .bind(name)
            .bind(column(revision))
            .fetch_optional(&self.readers)
            .await?;
            Ok(row.and_then(ModelRow::model))
        })
    }

    fn models(&self, after: String, limit: u32) -> BoxFuture<'_, Result<Vec<KeptModel>, StoreError>> {
        Box::pin(async move {
            let rows: Vec<ModelRow> = sqlx::query_as(
                "SELECT name, revision, calculator, content, sha256, created_ms FROM models AS one
                 WHERE name > ?1 AND content IS NOT NULL
                   AND revision = (SELECT max(revision) FROM models WHERE name = one.name AND content IS NOT NULL)
                 ORDER BY name LIMIT ?2",
            )
            .bind(after)
            .bind(limit)
            .fetch_all(&self.readers)
            .await?;
            Ok(rows.into_iter().filter_map(ModelRow::model).collect())
        })
    }

    fn delete_model(&self, name: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(async move {
            self.ledger
                .write(move |connection| {
                    let name = name.clone();
                    Box::pin(async move {
                        let done =
                            sqlx::query("UPDATE models SET content = NULL WHERE name = ?1 AND content IS NOT NULL")
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
