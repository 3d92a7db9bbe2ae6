//! What an owner takes of the service.

use sqlx::postgres::{PgConnection, PgPool};

use super::record::Outcome;
use crate::store::quota::{HOUR_MS, MINUTE_MS, Usage};

/// One after the other: what one has put on record the next one counts.
pub(super) async fn lock_owner(connection: &mut PgConnection, owner: &str) -> Outcome<()> {
    let locked = sqlx::query("SELECT pg_advisory_xact_lock(hashtextextended('precut.owner ' || $1, 0))");
    locked.bind(owner).execute(connection).await.map(drop)
}

/// See the SQLite store.
pub(super) async fn usage(connection: &mut PgConnection, owner: &str) -> Outcome<Usage> {
    let now: i64 = sqlx::query_scalar("SELECT precut.now_ms()").fetch_one(&mut *connection).await?;
    let kept: Vec<(Option<i64>, i64)> = sqlx::query_as(
        "SELECT max(until) - $2, sum(bytes)::bigint FROM (
             SELECT max(expires_ms) AS until, sum(input_bytes) + max(result_bytes) AS bytes FROM precut.jobs
             WHERE owner = $1 AND (expires_ms IS NULL OR expires_ms > $2) GROUP BY key) AS results
         GROUP BY until / $3
         UNION ALL
         SELECT NULL, sum(bytes)::bigint FROM precut.documents WHERE owner = $1 AND content IS NOT NULL HAVING count(*) > 0
         UNION ALL
         SELECT NULL, sum(bytes)::bigint FROM precut.process_entries WHERE owner = $1 HAVING count(*) > 0",
    )
    .bind(owner)
    .bind(now)
    .bind(HOUR_MS)
    .fetch_all(&mut *connection)
    .await?;
    let open_ms: f64 = sqlx::query_scalar(
        "SELECT coalesce(sum(estimate_ms), 0) FROM precut.jobs
         WHERE owner = $1 AND expires_ms IS NULL AND finished_ms IS NULL",
    )
    .bind(owner)
    .fetch_one(&mut *connection)
    .await?;
    let done: Vec<(i64, f64)> = sqlx::query_as(
        "SELECT max(finished_ms) + $3 - $2, sum(finished_ms - started_ms)::float8 FROM precut.jobs
         WHERE owner = $1 AND finished_ms > $2 - $3 AND started_ms IS NOT NULL GROUP BY finished_ms / $4
         UNION ALL
         SELECT (minute + 1) * $4 + $3 - $2, ms FROM precut.work WHERE owner = $1 AND (minute + 1) * $4 > $2 - $3",
    )
    .bind(owner)
    .bind(now)
    .bind(HOUR_MS)
    .bind(MINUTE_MS)
    .fetch_all(connection)
    .await?;
    let kept = kept.into_iter().map(|(goes, bytes)| (goes, u64::try_from(bytes).unwrap_or(0))).collect();
    Ok(Usage { kept, open_ms, done })
}

pub(super) async fn kept_by_owner(pool: &PgPool) -> Outcome<Vec<(String, u64)>> {
    let kept: Vec<(String, i64)> = sqlx::query_as(
        "SELECT owner, sum(bytes)::bigint FROM (
             SELECT owner, sum(input_bytes) + max(result_bytes) AS bytes FROM precut.jobs
             WHERE starts_with(owner, 'key:') AND (expires_ms IS NULL OR expires_ms > precut.now_ms())
             GROUP BY owner, key
             UNION ALL
             SELECT owner, bytes FROM precut.documents WHERE starts_with(owner, 'key:') AND content IS NOT NULL
             UNION ALL
             SELECT owner, bytes FROM precut.process_entries WHERE starts_with(owner, 'key:')) AS results
         GROUP BY owner",
    )
    .fetch_all(pool)
    .await?;
    Ok(kept.into_iter().map(|(owner, bytes)| (owner, u64::try_from(bytes).unwrap_or(0))).collect())
}

pub(super) async fn note_work(connection: &mut PgConnection, mut work: Vec<(String, f64)>) -> Outcome<()> {
    // In one order, so that two processes do not wait for each other.
    work.sort_by(|one, other| one.0.cmp(&other.0));
    for (owner, ms) in work {
        sqlx::query(
            "INSERT INTO precut.work AS work (owner, minute, ms) VALUES ($1, precut.now_ms() / $3, $2)
             ON CONFLICT (owner, minute) DO UPDATE SET ms = work.ms + excluded.ms",
        )
        .bind(owner)
        .bind(ms)
        .bind(MINUTE_MS)
        .execute(&mut *connection)
        .await?;
    }
    Ok(())
}

/// Forgets work that counts no longer.
pub(super) async fn forget_work(connection: &mut PgConnection) -> Outcome<()> {
    let forgotten = sqlx::query("DELETE FROM precut.work WHERE (minute + 1) * $1 <= precut.now_ms() - $2");
    forgotten.bind(MINUTE_MS).bind(HOUR_MS).execute(connection).await.map(drop)
}
