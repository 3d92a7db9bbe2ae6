//! What an owner takes of the service.

use sqlx::sqlite::SqliteConnection;

use super::record::Outcome;
use crate::store::quota::{HOUR_MS, MINUTE_MS, Usage};

pub(in crate::store) async fn usage(connection: &mut SqliteConnection, owner: &str, now: i64) -> Outcome<Usage> {
    // Equal jobs share a result. By the hour, so that it is told in few numbers. Models and the like go when they are deleted.
    let kept: Vec<(Option<i64>, i64)> = sqlx::query_as(
        "SELECT max(until) - ?2, sum(bytes) FROM (
             SELECT max(expires_ms) AS until, sum(input_bytes) + max(result_bytes) AS bytes FROM precut_jobs
             WHERE owner = ?1 AND (expires_ms IS NULL OR expires_ms > ?2) GROUP BY key)
         GROUP BY until / ?3
         UNION ALL
         SELECT NULL, sum(bytes) FROM documents WHERE owner = ?1 AND content IS NOT NULL HAVING count(*) > 0
         UNION ALL
         SELECT NULL, sum(bytes) FROM process_entries WHERE owner = ?1 HAVING count(*) > 0",
    )
    .bind(owner)
    .bind(now)
    .bind(HOUR_MS)
    .fetch_all(&mut *connection)
    .await?;
    let open_ms: f64 = sqlx::query_scalar(
        "SELECT total(estimate_ms) FROM precut_jobs WHERE owner = ?1 AND expires_ms IS NULL AND finished_ms IS NULL",
    )
    .bind(owner)
    .fetch_one(&mut *connection)
    .await?;
    let done: Vec<(i64, f64)> = sqlx::query_as(
        "SELECT max(finished_ms) + ?3 - ?2, total(finished_ms - started_ms) FROM precut_jobs
         WHERE owner = ?1 AND finished_ms > ?2 - ?3 AND started_ms IS NOT NULL GROUP BY finished_ms / ?4
         UNION ALL
         SELECT (minute + 1) * ?4 + ?3 - ?2, ms FROM work WHERE owner = ?1 AND (minute + 1) * ?4 > ?2 - ?3",
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

pub(super) async fn kept_by_owner(connection: &mut SqliteConnection, now: i64) -> Outcome<Vec<(String, u64)>> {
    let kept: Vec<(String, i64)> = sqlx::query_as(
        "SELECT owner, sum(bytes) FROM (
             SELECT owner, sum(input_bytes) + max(result_bytes) AS bytes FROM precut_jobs
             WHERE owner > 'key:' AND owner < 'key;' AND (expires_ms IS NULL OR expires_ms > ?1) GROUP BY owner, key
             UNION ALL
             SELECT owner, bytes FROM documents WHERE owner > 'key:' AND owner < 'key;' AND content IS NOT NULL
             UNION ALL
             SELECT owner, bytes FROM process_entries WHERE owner > 'key:' AND owner < 'key;')
         GROUP BY owner",
    )
    .bind(now)
    .fetch_all(connection)
    .await?;
    Ok(kept.into_iter().map(|(owner, bytes)| (owner, u64::try_from(bytes).unwrap_or(0))).collect())
}

pub(super) async fn note_work(connection: &mut SqliteConnection, work: &[(String, f64)], now: i64) -> Outcome<()> {
    for (owner, ms) in work {
        sqlx::query(
            "INSERT INTO work (owner, minute, ms) VALUES (?1, ?2, ?3)
             ON CONFLICT (owner, minute) DO UPDATE SET ms = ms + excluded.ms",
        )
        .bind(owner)
        .bind(now / MINUTE_MS)
        .bind(ms)
        .execute(&mut *connection)
        .await?;
    }
    Ok(())
}

/// Forgets work that counts no longer.
pub(super) async fn forget_work(connection: &mut SqliteConnection, now: i64) -> Outcome<()> {
    let forgotten = sqlx::query("DELETE FROM work WHERE (minute + 1) * ?1 <= ?2");
    forgotten.bind(MINUTE_MS).bind(now - HOUR_MS).execute(connection).await.map(drop)
}
