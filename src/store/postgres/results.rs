//! Kept results that are thrown away.

use std::time::Duration;

use sqlx::postgres::PgPool;

use crate::store::sql::Outcome;

/// Rows deleted in one transaction.
const EVICTED_AT_ONCE: i64 = 1000;
/// Eviction goes down to this share of the limit, in percent, so that it does not run for every result.
const EVICT_TO_PERCENT: i64 = 90;
/// The lock of whoever evicts.
const EVICTION: (i32, i32) = (0x7072_6563, 3);

/// Deletes what has not been used for longer than the age allowed, and what has not been used for longest until the
/// total is below the limit again; what a kept job points to stays. One process at a time.
pub(super) async fn evict(pool: &PgPool, limit: u64, age: Duration) -> Outcome<u64> {
    let limit = i64::try_from(limit).unwrap_or(i64::MAX);
    let age_ms = i64::try_from(age.as_millis()).unwrap_or(i64::MAX / 4);
    let mut gone = delete_while_some(pool, Some(age_ms), 0).await?;
    let total: i64 = sqlx::query_scalar("SELECT coalesce(sum(bytes), 0)::bigint FROM results").fetch_one(pool).await?;
    if total > limit {
        gone += delete_while_some(pool, None, total - limit / 100 * EVICT_TO_PERCENT).await?;
    }
    metrics::counter!("precut_results_evicted_total").increment(gone);
    Ok(gone)
}

/// Deletes in small transactions: what is older than an age, or as many bytes as are too many.
async fn delete_while_some(pool: &PgPool, age_ms: Option<i64>, mut surplus: i64) -> Outcome<u64> {
    let mut gone = 0;
    loop {
        if age_ms.is_none() && surplus <= 0 {
            return Ok(gone);
        }
        let mut transaction = pool.begin().await?;
        let is_first: bool = sqlx::query_scalar("SELECT pg_try_advisory_xact_lock($1, $2)")
            .bind(EVICTION.0)
            .bind(EVICTION.1)
            .fetch_one(&mut *transaction)
            .await?;
        if !is_first {
            return Ok(gone);
        }
        let deleted: Vec<i64> = sqlx::query_scalar(
            "DELETE FROM results WHERE key IN (
                 SELECT key FROM (
                     SELECT key, coalesce(sum(bytes) OVER (ORDER BY used_ms, key) - bytes, 0) AS before
                     FROM (SELECT key, used_ms, bytes FROM results
                           WHERE used_ms < now_ms() - $1
                               AND NOT EXISTS (SELECT FROM jobs WHERE jobs.key = results.key
                                               AND state = 'succeeded' AND expires_ms > now_ms())
                           ORDER BY used_ms, key LIMIT $2) AS oldest) AS summed
                 WHERE before < $3)
             RETURNING bytes",
        )
        .bind(age_ms.unwrap_or(-1_000_000))
        .bind(EVICTED_AT_ONCE)
        .bind(if age_ms.is_some() { i64::MAX } else { surplus })
        .fetch_all(&mut *transaction)
        .await?;
        transaction.commit().await?;
        if deleted.is_empty() {
            return Ok(gone);
        }
        gone += deleted.len() as u64;
        surplus -= deleted.iter().sum::<i64>();
    }
}
