//! What an owner takes of the service.

use crate::store::quota::{HOUR_MS, MINUTE_MS, Usage};
use crate::store::sql::{Lock, Outcome, Session, sql};

/// What an owner takes, as it stays until the transaction ends.
pub(in crate::store) async fn usage_of<S: Session>(connection: &mut S, owner: &str) -> Outcome<Usage> {
    connection.lock(Lock::Owner(owner)).await?;
    usage(connection, owner).await
}

pub(in crate::store) async fn usage<S: Session>(connection: &mut S, owner: &str) -> Outcome<Usage> {
    let now = connection.now_ms().await?;
    // Equal jobs share a result. By the hour, so that it is told in few numbers. Models and the like go when they are deleted.
    let kept = sql("SELECT max(until) - $2, CAST(sum(bytes) AS bigint) FROM (
             SELECT max(expires_ms) AS until, sum(input_bytes) + max(result_bytes) AS bytes FROM jobs
             WHERE owner = $1 AND (expires_ms IS NULL OR expires_ms > $2) GROUP BY key) AS results
         GROUP BY until / $3
         UNION ALL
         SELECT NULL, CAST(sum(bytes) AS bigint) FROM documents
         WHERE owner = $1 AND content IS NOT NULL HAVING count(*) > 0
         UNION ALL
         SELECT NULL, CAST(sum(bytes) AS bigint) FROM process_entries WHERE owner = $1 HAVING count(*) > 0");
    let kept: Vec<(Option<i64>, i64)> = connection.all(kept.bind(owner).bind(now).bind(HOUR_MS)).await?;
    let open = sql("SELECT CAST(coalesce(sum(estimate_ms), 0) AS double precision) FROM jobs
         WHERE owner = $1 AND expires_ms IS NULL AND finished_ms IS NULL");
    let (open_ms,): (f64,) = connection.one(open.bind(owner)).await?;
    let done =
        sql("SELECT max(finished_ms) + $3 - $2, CAST(sum(finished_ms - started_ms) AS double precision) FROM jobs
         WHERE owner = $1 AND finished_ms > $2 - $3 AND started_ms IS NOT NULL GROUP BY finished_ms / $4
         UNION ALL
         SELECT (minute + 1) * $4 + $3 - $2, ms FROM work WHERE owner = $1 AND (minute + 1) * $4 > $2 - $3");
    let done = connection.all(done.bind(owner).bind(now).bind(HOUR_MS).bind(MINUTE_MS)).await?;
    let kept = kept.into_iter().map(|(goes, bytes)| (goes, u64::try_from(bytes).unwrap_or(0))).collect();
    Ok(Usage { kept, open_ms, done })
}

pub(in crate::store) async fn kept_by_owner<S: Session>(connection: &mut S) -> Outcome<Vec<(String, u64)>> {
    let now = connection.now_ms().await?;
    let kept = sql("SELECT owner, CAST(sum(bytes) AS bigint) FROM (
             SELECT owner, sum(input_bytes) + max(result_bytes) AS bytes FROM jobs
             WHERE substr(owner, 1, 4) = 'key:' AND (expires_ms IS NULL OR expires_ms > $1) GROUP BY owner, key
             UNION ALL
             SELECT owner, bytes FROM documents WHERE substr(owner, 1, 4) = 'key:' AND content IS NOT NULL
             UNION ALL
             SELECT owner, bytes FROM process_entries WHERE substr(owner, 1, 4) = 'key:') AS results
         GROUP BY owner");
    let kept: Vec<(String, i64)> = connection.all(kept.bind(now)).await?;
    Ok(kept.into_iter().map(|(owner, bytes)| (owner, u64::try_from(bytes).unwrap_or(0))).collect())
}

pub(in crate::store) async fn note_work<S: Session>(connection: &mut S, work: &[(String, f64)]) -> Outcome<()> {
    let now = connection.now_ms().await?;
    // In one order, so that two processes do not wait for each other.
    let mut work: Vec<&(String, f64)> = work.iter().collect();
    work.sort_by(|one, other| one.0.cmp(&other.0));
    for (owner, ms) in work {
        let noted = sql("INSERT INTO work (owner, minute, ms) VALUES ($1, $2, $3)
             ON CONFLICT (owner, minute) DO UPDATE SET ms = work.ms + excluded.ms");
        connection.run(noted.bind(owner).bind(now / MINUTE_MS).bind(*ms)).await?;
    }
    Ok(())
}

/// Forgets work that counts no longer.
pub(in crate::store) async fn forget_work<S: Session>(connection: &mut S) -> Outcome<()> {
    let now = connection.now_ms().await?;
    let forgotten = sql("DELETE FROM work WHERE (minute + 1) * $1 <= $2");
    connection.run(forgotten.bind(MINUTE_MS).bind(now - HOUR_MS)).await.map(drop)
}
