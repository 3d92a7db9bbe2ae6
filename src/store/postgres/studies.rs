//! Parts of studies: taken by whoever has a core, put down once, fenced by who holds them.

use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use sqlx::postgres::{PgConnection, PgPool};
use tokio::task::JoinHandle;

use super::PostgresStore;
use super::column;
use crate::key::Key;
use crate::store::common::jobs::count;
use crate::store::jobs::{Lease, MOST_ATTEMPTS};
use crate::store::sql::Outcome;
use crate::store::{StoreError, Taken};

/// Fast: what is put down is hardly ever read again.
const LEVEL: i32 = 1;
/// How often a holder says that he lives.
const BEAT: Duration = Duration::from_secs(1);

/// The parts that this process holds.
pub(super) struct Held {
    holder: Lease,
    parts: Arc<Mutex<HashSet<(Key, u32)>>>,
    task: JoinHandle<()>,
}

impl Held {
    pub(super) fn start(pool: PgPool) -> Self {
        let (holder, parts) = (Lease::new(), Arc::default());
        let task = tokio::spawn(say_alive(pool, holder, Arc::clone(&parts)));
        Self { holder, parts, task }
    }

    /// What this process is called.
    pub(super) fn name(&self) -> String {
        self.holder.to_string()
    }

    fn parts(&self) -> MutexGuard<'_, HashSet<(Key, u32)>> {
        locked(&self.parts)
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        self.task.abort();
    }
}

fn locked(parts: &Mutex<HashSet<(Key, u32)>>) -> MutexGuard<'_, HashSet<(Key, u32)>> {
    parts.lock().unwrap_or_else(PoisonError::into_inner)
}

async fn say_alive(pool: PgPool, holder: Lease, parts: Arc<Mutex<HashSet<(Key, u32)>>>) {
    let mut beat = tokio::time::interval(BEAT);
    beat.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        beat.tick().await;
        let held: Vec<(Key, u32)> = locked(&parts).iter().copied().collect();
        if held.is_empty() {
            continue;
        }
        let said = sqlx::query(
            "UPDATE studies AS part SET beat_ms = now_ms()
             FROM unnest($1::bytea[], $2::integer[]) AS held (study, shard)
             WHERE part.study = held.study AND part.shard = held.shard AND part.holder = $3 AND part.points IS NULL",
        )
        .bind(held.iter().map(|(study, _)| study.as_bytes().to_vec()).collect::<Vec<_>>())
        .bind(held.iter().map(|(_, shard)| column(*shard)).collect::<Vec<_>>())
        .bind(holder.to_string())
        .execute(&pool)
        .await;
        if let Err(error) = said {
            tracing::debug!(%error, "parts of studies that are held could not be held on to");
        }
    }
}

impl PostgresStore {
    pub(super) async fn take(&self, study: Key, of: u32) -> Result<Taken, StoreError> {
        let silent_ms = i64::try_from(self.patience.lease.as_millis()).unwrap_or(i64::MAX);
        let holder = self.held.holder.to_string();
        let taken = self.write(|connection| Box::pin(take(connection, study, column(of), holder, silent_ms))).await?;
        Ok(match taken {
            Some(shard) => {
                self.held.parts().insert((study, shard));
                Taken::Shard(shard)
            }
            None => Taken::NoneLeft,
        })
    }

    /// The parts that are said to be held.
    #[cfg(test)]
    pub(super) fn held_parts(&self) -> MutexGuard<'_, HashSet<(Key, u32)>> {
        self.held.parts()
    }

    pub(super) fn give_back(&self, study: Key, shard: u32) {
        if !self.held.parts().remove(&(study, shard)) {
            return;
        }
        // Where this does not arrive, nobody says of the part any more that it is held, and so it is free soon as well.
        let (pool, holder) = (self.pool.clone(), self.held.holder.to_string());
        tokio::spawn(async move {
            let _ = sqlx::query(
                "UPDATE studies SET beat_ms = 0 WHERE study = $1 AND shard = $2 AND holder = $3 AND points IS NULL",
            )
            .bind(study.as_bytes().as_slice())
            .bind(column(shard))
            .bind(holder)
            .execute(&pool)
            .await;
        });
    }

    /// Puts a part down, unless it was given to somebody else meanwhile. The results of its points are written before: a
    /// part that is down is not computed again, and so its points would have no answers.
    pub(super) async fn put_down(&self, study: Key, shard: u32, content: Bytes) -> Result<(), StoreError> {
        let packed = zstd::bulk::compress(&content, LEVEL).map_err(|error| StoreError::Failed(error.to_string()))?;
        let checksum = blake3::hash(&packed);
        if !self.writer.flush(self.patience.points).await {
            return Err(StoreError::Failed("the results of its points are not written yet".to_owned()));
        }
        sqlx::query(
            "INSERT INTO studies AS part (study, shard, holder, beat_ms, points, checksum, created_ms)
             VALUES ($1, $2, $3, now_ms(), $4, $5, now_ms())
             ON CONFLICT (study, shard) DO UPDATE SET points = excluded.points, checksum = excluded.checksum
             WHERE part.holder = excluded.holder AND part.points IS NULL",
        )
        .bind(study.as_bytes().as_slice())
        .bind(column(shard))
        .bind(self.held.holder.to_string())
        .bind(packed)
        .bind(checksum.as_bytes().as_slice())
        .execute(&self.pool)
        .await?;
        self.held.parts().remove(&(study, shard));
        // Whoever gets on is not to blame for the end of its processes: what is put down is not computed again, so that
        // this cannot go on for ever.
        sqlx::query("UPDATE jobs SET attempt = $2 WHERE key = $1 AND state = 'running' AND attempt > $2")
            .bind(study.as_bytes().as_slice())
            .bind(column(MOST_ATTEMPTS - 1))
            .execute(&self.pool)
            .await?;
        Ok(())
    }

    /// The parts of a study that are done, of those asked for. One that is damaged is none, and to be done again.
    pub(super) async fn done(&self, study: Key, wanted: Option<Vec<u32>>) -> Result<Vec<(u32, Bytes)>, StoreError> {
        let wanted = wanted.map(|wanted| wanted.into_iter().map(column).collect::<Vec<i32>>());
        let rows: Vec<(i32, Vec<u8>, Vec<u8>)> = sqlx::query_as(
            "SELECT shard, points, checksum FROM studies
             WHERE study = $1 AND points IS NOT NULL AND ($2::integer[] IS NULL OR shard = ANY($2)) ORDER BY shard",
        )
        .bind(study.as_bytes().as_slice())
        .bind(wanted)
        .fetch_all(&self.pool)
        .await?;
        let mut sound = Vec::with_capacity(rows.len());
        for (shard, packed, checksum) in rows {
            let content = (blake3::hash(&packed).as_bytes() == checksum.as_slice())
                .then(|| zstd::decode_all(&*packed).ok())
                .flatten();
            if let Some(content) = content {
                sound.push((count(shard), content.into()));
                continue;
            }
            tracing::warn!(%study, shard, "a part of a study is damaged; it is computed again");
            sqlx::query(
                "UPDATE studies SET points = NULL, checksum = NULL, beat_ms = 0
                 WHERE study = $1 AND shard = $2 AND checksum = $3",
            )
            .bind(study.as_bytes().as_slice())
            .bind(shard)
            .bind(checksum)
            .execute(&self.pool)
            .await?;
        }
        Ok(sound)
    }

    pub(super) async fn forget_study(&self, study: Key) -> Result<(), StoreError> {
        self.held.parts().retain(|(held, _)| *held != study);
        for table in ["DELETE FROM shared_studies WHERE study = $1", "DELETE FROM studies WHERE study = $1"] {
            sqlx::query(table).bind(study.as_bytes().as_slice()).execute(&self.pool).await?;
        }
        Ok(())
    }
}

/// The next part that nobody has had, or one whose holder is silent.
async fn take(
    connection: &mut PgConnection,
    study: Key,
    of: i32,
    holder: String,
    silent_ms: i64,
) -> Outcome<Option<u32>> {
    let study = study.as_bytes().as_slice();
    sqlx::query("INSERT INTO shared_studies (study, created_ms) VALUES ($1, now_ms()) ON CONFLICT DO NOTHING")
        .bind(study)
        .execute(&mut *connection)
        .await?;
    loop {
        let next: Option<i32> = sqlx::query_scalar(
            "UPDATE shared_studies SET next = next + 1 WHERE study = $1 AND next < $2 RETURNING next - 1",
        )
        .bind(study)
        .bind(of)
        .fetch_optional(&mut *connection)
        .await?;
        let Some(next) = next else { break };
        let is_new: Option<i32> = sqlx::query_scalar(
            "INSERT INTO studies (study, shard, holder, beat_ms, created_ms)
             VALUES ($1, $2, $3, now_ms(), now_ms()) ON CONFLICT DO NOTHING RETURNING shard",
        )
        .bind(study)
        .bind(next)
        .bind(&holder)
        .fetch_optional(&mut *connection)
        .await?;
        if is_new.is_some() {
            return Ok(Some(count(next)));
        }
    }
    let silent: Option<i32> = sqlx::query_scalar(
        "UPDATE studies AS part SET holder = $2, beat_ms = now_ms()
         FROM (SELECT shard FROM studies
               WHERE study = $1 AND points IS NULL AND beat_ms <= now_ms() - $3
               ORDER BY shard LIMIT 1 FOR UPDATE SKIP LOCKED) AS free
         WHERE part.study = $1 AND part.shard = free.shard RETURNING part.shard",
    )
    .bind(study)
    .bind(holder)
    .bind(silent_ms)
    .fetch_optional(connection)
    .await?;
    Ok(silent.map(count))
}
