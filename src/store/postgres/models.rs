//! Stored models in PostgreSQL.

use futures_util::future::BoxFuture;
use sqlx::postgres::PgConnection;

use super::PostgresStore;
use super::usage::{lock_owner, usage};
use crate::store::StoreError;
use crate::store::models::{KeptModel, ModelRow, ModelShelf, ModelStore, NewModel, PutModel, column};

impl ModelShelf for PostgresStore {
    fn model(&self, name: String, revision: Option<u32>) -> BoxFuture<'_, Result<Option<KeptModel>, StoreError>> {
        Box::pin(async move {
            let row: Option<ModelRow> = sqlx::query_as(
                "SELECT name, revision, calculator, content, sha256, created_ms FROM precut.models
                 WHERE name = $1 AND content IS NOT NULL AND ($2::integer IS NULL OR revision = $2)
                 ORDER BY revision DESC LIMIT 1",
            )
            .bind(name)
            .bind(column(revision))
            .fetch_optional(&self.pool)
            .await?;
            Ok(row.and_then(ModelRow::model))
        })
    }

    fn models(&self, shelf: String, after: String, limit: u32) -> BoxFuture<'_, Result<Vec<KeptModel>, StoreError>> {
        Box::pin(async move {
            let rows: Vec<ModelRow> = sqlx::query_as(
                "SELECT DISTINCT ON (name COLLATE \"C\") name, revision, calculator, content, sha256, created_ms FROM precut.models
                 WHERE name COLLATE \"C\" > $1 AND content IS NOT NULL
                   AND left(name, length($3)) = $3 AND position('/' IN substr(name, length($3) + 1)) = 0
                 ORDER BY name COLLATE \"C\", revision DESC LIMIT $2",
            )
            .bind(shelf.clone() + &after)
            .bind(i64::from(limit))
            .bind(shelf)
            .fetch_all(&self.pool)
            .await?;
            Ok(rows.into_iter().filter_map(ModelRow::model).collect())
        })
    }

    fn model_names(&self, shelf: String, limit: u32) -> BoxFuture<'_, Result<Vec<String>, StoreError>> {
        Box::pin(async move {
            let names = sqlx::query_scalar(
                "SELECT DISTINCT substr(name, length($2) + 1) COLLATE \"C\" AS plain FROM precut.models
                 WHERE content IS NOT NULL
                   AND left(name, length($2)) = $2 AND position('/' IN substr(name, length($2) + 1)) = 0
                 ORDER BY plain LIMIT $1",
            );
            Ok(names.bind(i64::from(limit)).bind(shelf).fetch_all(&self.pool).await?)
        })
    }
}

impl ModelStore for PostgresStore {
    fn put_model(&self, model: NewModel) -> BoxFuture<'_, Result<PutModel, StoreError>> {
        Box::pin(self.write(|connection| Box::pin(put(connection, model))))
    }

    fn delete_model(&self, name: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(async move {
            let done = sqlx::query(
                "UPDATE precut.models SET content = NULL, bytes = 0 WHERE name = $1 AND content IS NOT NULL",
            )
            .bind(name)
            .execute(&self.pool)
            .await?;
            Ok(done.rows_affected() > 0)
        })
    }
}

async fn put(connection: &mut PgConnection, model: NewModel) -> Result<PutModel, sqlx::Error> {
    // One after the other, so that no two take the same number.
    sqlx::query("SELECT pg_advisory_xact_lock(hashtextextended('precut.models ' || $1, 0))")
        .bind(&model.name)
        .execute(&mut *connection)
        .await?;
    if model.quota.kept_bytes.is_some() {
        lock_owner(connection, &model.owner).await?;
        let usage = usage(connection, &model.owner).await?;
        if !usage.has_room(&model.quota, model.content.len() as u64) {
            return Ok(PutModel::OverQuota(usage));
        }
    }
    let row = sqlx::query_as(
        "INSERT INTO precut.models (name, revision, calculator, content, sha256, created_ms, owner, bytes)
         SELECT $1, 1 + coalesce(max(revision), 0), $2, $3, $4, precut.now_ms(), $6, octet_length($3)
         FROM precut.models WHERE name = $1
         HAVING NOT $5 OR count(content) = 0
         RETURNING name, revision, calculator, content, sha256, created_ms",
    )
    .bind(model.name)
    .bind(model.calculator)
    .bind(model.content)
    .bind(model.sha256)
    .bind(model.only_new)
    .bind(model.owner)
    .fetch_optional(connection)
    .await?;
    Ok(ModelRow::put(row))
}
