//! Callbacks in PostgreSQL. Any process that may call delivers them; each try is one process's.

use sqlx::postgres::PgConnection;

use super::record::{Outcome, count};
use crate::store::callbacks::{DueCallback, NewCallback, Subject, TakeUp, Tried};
use crate::store::jobs::{JobId, Lease};
use crate::store::sqlite_jobs::record::parsed;

/// See the SQLite store.
pub(super) async fn note(
    connection: &mut PgConnection,
    job: JobId,
    callback: &NewCallback,
    over_ms: Option<i64>,
) -> Outcome<()> {
    sqlx::query("INSERT INTO precut.callbacks (job, url, host, state, next_ms) VALUES ($1, $2, $3, $4, $5)")
        .bind(job.to_string())
        .bind(&callback.url)
        .bind(&callback.host)
        .bind(if over_ms.is_some() { "pending" } else { "waiting" })
        .bind(over_ms)
        .execute(connection)
        .await
        .map(drop)
}

/// See the SQLite store.
pub(super) async fn note_entry(
    connection: &mut PgConnection,
    (process, sequence): (&str, i64),
    callback: &NewCallback,
    now: i64,
) -> Outcome<()> {
    sqlx::query(
        "INSERT INTO precut.callbacks (process, sequence, url, host, state, next_ms) VALUES ($1, $2, $3, $4, 'pending', $5)",
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

type Taken = (i64, Option<String>, Option<String>, Option<i64>, String, String, i32);

pub(super) async fn take_up(connection: &mut PgConnection, wanted: TakeUp) -> Outcome<Vec<DueCallback>> {
    let lease = Lease::new();
    // Who has come first has the row; who comes second passes it over, or finds that it is not due any more.
    let taken: Vec<Taken> = sqlx::query_as(
        "WITH clock AS MATERIALIZED (SELECT precut.now_ms() AS now),
              line AS (
                  SELECT id, next_ms, row_number() OVER (PARTITION BY host ORDER BY next_ms, id) AS place
                  FROM precut.callbacks, clock
                  WHERE state = 'pending' AND next_ms <= now AND NOT host = ANY($3)),
              mine AS (
                  SELECT id FROM precut.callbacks, clock
                  WHERE id IN (SELECT id FROM line WHERE place <= $4 ORDER BY next_ms, id LIMIT $5)
                      AND state = 'pending' AND callbacks.next_ms <= now
                  FOR UPDATE OF callbacks SKIP LOCKED)
         UPDATE precut.callbacks AS callback SET lease = $1, attempts = attempts + 1, next_ms = now + $2
         FROM mine, clock WHERE callback.id = mine.id
         RETURNING callback.id, callback.job, callback.process, callback.sequence, callback.url, callback.host, callback.attempts",
    )
    .bind(lease.to_string())
    .bind(wanted.hold_ms)
    .bind(wanted.not_of)
    .bind(i64::from(wanted.most_of_one))
    .bind(i64::from(wanted.most))
    .fetch_all(connection)
    .await?;
    let due = |(id, job, process, sequence, url, host, attempt): Taken| {
        let job = job.map(|job| parsed(&job)).transpose()?;
        let subject = Subject::read(job, process, sequence)?;
        Ok(DueCallback { id, subject, url, host, lease, attempt: count(attempt) })
    };
    taken.into_iter().map(due).collect()
}

pub(super) async fn settle(connection: &mut PgConnection, due: DueCallback, tried: Tried) -> Outcome<bool> {
    let (state, after_ms, fault) = tried.written();
    let settled = sqlx::query(
        "UPDATE precut.callbacks SET state = $3, next_ms = precut.now_ms() + $4::bigint, fault = $5, lease = NULL,
             settled_ms = CASE WHEN $4::bigint IS NULL THEN precut.now_ms() END
         WHERE id = $1 AND lease = $2",
    )
    .bind(due.id)
    .bind(due.lease.to_string())
    .bind(state)
    .bind(after_ms)
    .bind(fault)
    .execute(connection)
    .await?;
    Ok(settled.rows_affected() > 0)
}
