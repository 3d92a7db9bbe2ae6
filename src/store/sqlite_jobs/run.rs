//! What SQLite does in its own way: the next job is found in the one line that there is.

use sqlx::sqlite::SqliteConnection;

use crate::store::common::jobs::unwanted;
use crate::store::common::run::{self, First};
use crate::store::jobs::{Beat, Lease, Next, SILENCE, Wanted};
use crate::store::sql::Outcome;

/// What waits and may be taken: `?1` is now, `?2` how long others keep away from what is held (a clock that was set back
/// holds nothing for longer), `?3` the longest job, which is no shard.
macro_rules! in_line {
    () => {
        "state = 'queued' AND (heartbeat_ms IS NULL OR abs(?1 - heartbeat_ms) >= ?2) \
         AND (?3 IS NULL OR (estimate_ms <= ?3 AND attempt = 0 AND parent IS NULL)) \
         AND (parent IS NULL OR EXISTS ( \
             SELECT 1 FROM jobs AS whole WHERE whole.key = jobs.parent AND whole.state = 'running'))"
    };
}

fn silence_ms() -> i64 {
    i64::try_from(SILENCE.as_millis()).unwrap_or(i64::MAX)
}

pub(super) async fn waits(connection: &mut SqliteConnection, short_ms: Option<f64>, now: i64) -> Outcome<bool> {
    let waits = concat!("SELECT EXISTS (SELECT 1 FROM jobs INDEXED BY precut_jobs_in_line WHERE ", in_line!(), ")");
    sqlx::query_scalar(waits).bind(now).bind(silence_ms()).bind(short_ms).fetch_one(connection).await
}

pub(super) async fn take(connection: &mut SqliteConnection, wanted: Wanted, keep_ms: i64, now: i64) -> Outcome<Next> {
    if let Some(before) = run::taken_before(connection, wanted).await? {
        return Ok(before);
    }
    let first = concat!(
        "SELECT id, key FROM jobs INDEXED BY precut_jobs_in_line WHERE ",
        in_line!(),
        " ORDER BY priority DESC, turn, id LIMIT 1"
    );
    let first: Option<(String, Vec<u8>)> = sqlx::query_as(first)
        .bind(now)
        .bind(silence_ms())
        .bind(wanted.short_ms)
        .fetch_optional(&mut *connection)
        .await?;
    match first {
        Some((id, key)) => run::take(connection, First { id, key, now, begun: None }, wanted.lease, keep_ms).await,
        None => Ok(Next::Nothing),
    }
}

pub(super) async fn beat(connection: &mut SqliteConnection, beats: &[Beat], now: i64) -> Outcome<Vec<Lease>> {
    for beat in beats {
        sqlx::query(
            "UPDATE jobs SET heartbeat_ms = ?2, progress = ?3, stage = ?4 WHERE lease = ?1 AND state = 'running'",
        )
        .bind(beat.lease.to_string())
        .bind(now)
        .bind(beat.progress)
        .bind(&beat.stage)
        .execute(&mut *connection)
        .await?;
    }
    let leases: Vec<Lease> = beats.iter().map(|beat| beat.lease).collect();
    unwanted(connection, &leases).await
}
