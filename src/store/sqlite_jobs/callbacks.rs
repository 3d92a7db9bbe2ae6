//! How callbacks are taken up in the SQLite file.

use sqlx::sqlite::SqliteConnection;

use crate::store::callbacks::{DueCallback, TakeUp};
use crate::store::common::callbacks::Taken;
use crate::store::jobs::Lease;
use crate::store::sql::Outcome;

pub(super) async fn take_up(connection: &mut SqliteConnection, wanted: &TakeUp, now: i64) -> Outcome<Vec<DueCallback>> {
    let lease = Lease::new();
    let taken: Vec<Taken> = sqlx::query_as(
        "UPDATE callbacks SET lease = ?1, attempts = attempts + 1, next_ms = ?2 + ?3 WHERE id IN (
             SELECT id FROM (
                 SELECT id, next_ms, row_number() OVER (PARTITION BY host ORDER BY next_ms, id) AS place
                 FROM callbacks INDEXED BY callbacks_due
                 WHERE state = 'pending' AND next_ms <= ?2 AND host NOT IN (SELECT value FROM json_each(?4)))
             WHERE place <= ?5 ORDER BY next_ms, id LIMIT ?6)
         RETURNING id, job, process, sequence, url, host, attempts",
    )
    .bind(lease.to_string())
    .bind(now)
    .bind(wanted.hold_ms)
    .bind(serde_json::to_string(&wanted.not_of).map_err(|error| sqlx::Error::Encode(error.into()))?)
    .bind(wanted.most_of_one)
    .bind(wanted.most)
    .fetch_all(connection)
    .await?;
    taken.into_iter().map(|taken| taken.due(lease)).collect()
}

/// What the process before was trying is tried again at once.
pub(super) async fn recover(connection: &mut SqliteConnection, now: i64) -> Outcome<()> {
    let held = sqlx::query("UPDATE callbacks SET next_ms = ?1, lease = NULL WHERE lease IS NOT NULL");
    held.bind(now).execute(connection).await.map(drop)
}
