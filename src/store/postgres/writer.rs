//! What is written behind the answers into PostgreSQL. Where the database does not answer, it is waited for, as far as there
//! is room.

use std::sync::Arc;
use std::time::Duration;

use sqlx::postgres::PgPool;

use super::clock::Clock;
use super::results;
use crate::key::Key;
use crate::store::behind::{Clerk, Desk, Group, ROWS_AT_ONCE};
use crate::store::common;
use crate::store::row::ResultRow;
use crate::store::sql::Outcome;
use crate::store::sqlite::Keep;

/// A group gathers so long. Other processes know of a result only when it is written.
const REST: Duration = Duration::from_millis(10);
/// Between two attempts to write a group, and how many there are.
const PAUSE: Duration = Duration::from_millis(500);
const ATTEMPTS: u32 = 120;

pub(super) struct PostgresClerk {
    pub(super) pool: PgPool,
    pub(super) clock: Arc<Clock>,
    pub(super) keep: Keep,
    /// Bytes written since the last look at the total.
    pub(super) unlooked_bytes: u64,
}

impl Clerk for PostgresClerk {
    /// Again and again while the database is away.
    async fn write(&mut self, group: &Group, rows: &[ResultRow], desk: &Desk) -> bool {
        for attempt in 1..=ATTEMPTS {
            match write(&self.pool, rows, group, self.clock.now_ms()).await {
                Ok(()) => {
                    let bytes: i64 = rows.iter().map(ResultRow::bytes).sum();
                    self.unlooked_bytes += u64::try_from(bytes).unwrap_or(0);
                    return true;
                }
                Err(error) => {
                    metrics::counter!("precut_store_failures_total", "operation" => "write").increment(1);
                    let is_last = attempt == ATTEMPTS || desk.is_closing();
                    if attempt == 1 || is_last {
                        tracing::warn!(rows = rows.len(), %error, is_last, "results cannot be written");
                    }
                    if is_last {
                        return false;
                    }
                }
            }
            tokio::time::sleep(PAUSE).await;
        }
        false
    }

    async fn tidy(&mut self, is_time: bool) {
        if is_time || self.unlooked_bytes > self.keep.bytes / 16 {
            self.evict().await;
        }
    }

    fn rest(&self, _took: Duration) -> Duration {
        REST
    }

    async fn close(self) {}
}

impl PostgresClerk {
    async fn evict(&mut self) {
        self.unlooked_bytes = 0;
        if let Err(error) = results::evict(&self.pool, self.keep.bytes, self.keep.age).await {
            metrics::counter!("precut_store_failures_total", "operation" => "evict").increment(1);
            tracing::warn!(%error, "old results could not be thrown away");
        }
    }
}

async fn write(pool: &PgPool, rows: &[ResultRow], group: &Group, now: i64) -> Outcome<()> {
    if group.forgotten.is_empty() && group.touched.is_empty() && rows.len() <= ROWS_AT_ONCE {
        // One statement is a transaction of its own.
        return common::results::insert(&mut *pool.acquire().await?, rows, now).await.map(drop);
    }
    let mut transaction = pool.begin().await?;
    let bytes = |keys: &mut dyn Iterator<Item = &Key>| -> Vec<Vec<u8>> {
        let mut keys: Vec<Vec<u8>> = keys.map(|key| key.as_bytes().to_vec()).collect();
        keys.sort_unstable();
        keys
    };
    if !group.forgotten.is_empty() {
        sqlx::query("DELETE FROM results WHERE key = ANY($1)")
            .bind(bytes(&mut group.forgotten.iter()))
            .execute(&mut *transaction)
            .await?;
    }
    let mut sorted: Vec<ResultRow> = rows.to_vec();
    sorted.sort_by(|one, other| one.key.cmp(&other.key));
    for some in sorted.chunks(ROWS_AT_ONCE) {
        common::results::insert(&mut *transaction, some, now).await?;
    }
    if !group.touched.is_empty() {
        // A use within the last minute is as good as one now, and a row that another process holds is left alone.
        sqlx::query(
            "UPDATE results SET used_ms = $2 WHERE key IN (
                 SELECT key FROM results WHERE key = ANY($1) AND used_ms < $2 - 60000 FOR UPDATE SKIP LOCKED)",
        )
        .bind(bytes(&mut group.touched.iter()))
        .bind(now)
        .execute(&mut *transaction)
        .await?;
    }
    transaction.commit().await
}
