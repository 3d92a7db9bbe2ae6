//! Callbacks in the SQLite file.

use sqlx::sqlite::SqliteConnection;

use super::record::{Outcome, parsed};
use crate::store::callbacks::{DueCallback, NewCallback, Subject, TakeUp, Tried};
use crate::store::jobs::{JobId, Lease};

/// Puts down who is told of a job: now, where it is over already.
pub(super) async fn note(
    connection: &mut SqliteConnection,
    job: JobId,
    callback: &NewCallback,
    over_ms: Option<i64>,
) -> Outcome<()> {
    sqlx::query("INSERT INTO callbacks (job, url, host, state, next_ms) VALUES (?1, ?2, ?3, ?4, ?5)")
        .bind(job.to_string())
        .bind(&callback.url)
        .bind(&callback.host)
        .bind(if over_ms.is_some() { "pending" } else { "waiting" })
        .bind(over_ms)
        .execute(connection)
        .await
        .map(drop)
}

/// Puts down who is told of an entry of a process.
pub(in crate::store) async fn note_entry(
    connection: &mut SqliteConnection,
    (process, sequence): (&str, i64),
    callback: &NewCallback,
    now: i64,
) -> Outcome<()> {
    sqlx::query(
        "INSERT INTO callbacks (process, sequence, url, host, state, next_ms) VALUES (?1, ?2, ?3, ?4, 'pending', ?5)",
    )
    .bind(process)
    .bind(sequence)
    .bind(&callback.url)
    .bind(&callback.host)
    .bind(now)
    .execute(connection)
    .await
    .map(drop)
}

type Taken = (i64, Option<String>, Option<String>, Option<i64>, String, String, u32);

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
    let due = |(id, job, process, sequence, url, host, attempt): Taken| {
        let job = job.map(|job| parsed(&job)).transpose()?;
        Ok(DueCallback { id, subject: Subject::read(job, process, sequence)?, url, host, lease, attempt })
    };
    taken.into_iter().map(due).collect()
}

pub(super) async fn settle(
    connection: &mut SqliteConnection,
    due: &DueCallback,
    tried: &Tried,
    now: i64,
) -> Outcome<bool> {
    let (state, after_ms, fault) = tried.written();
    let settled = sqlx::query(
        "UPDATE callbacks SET state = ?3, next_ms = ?4, fault = ?5, lease = NULL, settled_ms = ?6
         WHERE id = ?1 AND lease = ?2",
    )
    .bind(due.id)
    .bind(due.lease.to_string())
    .bind(state)
    .bind(after_ms.map(|after| now.saturating_add(after)))
    .bind(fault)
    .bind(after_ms.is_none().then_some(now))
    .execute(connection)
    .await?;
    Ok(settled.rows_affected() > 0)
}

/// What the process before was trying is tried again at once.
pub(super) async fn recover(connection: &mut SqliteConnection, now: i64) -> Outcome<()> {
    let held = sqlx::query("UPDATE callbacks SET next_ms = ?1, lease = NULL WHERE lease IS NOT NULL");
    held.bind(now).execute(connection).await.map(drop)
}
