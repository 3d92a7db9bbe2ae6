//! How callbacks are taken up in PostgreSQL. Any process that may call delivers them; each try is one process's.

use sqlx::postgres::PgConnection;

use crate::store::callbacks::{DueCallback, TakeUp};
use crate::store::common::callbacks::Taken;
use crate::store::jobs::Lease;
use crate::store::sql::Outcome;

pub(super) async fn take_up(connection: &mut PgConnection, wanted: TakeUp) -> Outcome<Vec<DueCallback>> {
    let lease = Lease::new();
    // Who has come first has the row; who comes second passes it over, or finds that it is not due any more.
    let taken: Vec<Taken> = sqlx::query_as(
        "WITH clock AS MATERIALIZED (SELECT now_ms() AS now),
              line AS (
                  SELECT id, next_ms, row_number() OVER (PARTITION BY host ORDER BY next_ms, id) AS place
                  FROM callbacks, clock
                  WHERE state = 'pending' AND next_ms <= now AND NOT host = ANY($3)),
              mine AS (
                  SELECT id FROM callbacks, clock
                  WHERE id IN (SELECT id FROM line WHERE place <= $4 ORDER BY next_ms, id LIMIT $5)
                      AND state = 'pending' AND callbacks.next_ms <= now
                  FOR UPDATE OF callbacks SKIP LOCKED)
         UPDATE callbacks AS callback SET lease = $1, attempts = attempts + 1, next_ms = now + $2
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
    taken.into_iter().map(|taken| taken.due(lease)).collect()
}
