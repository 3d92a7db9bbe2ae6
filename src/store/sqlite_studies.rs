//! Parts of studies in the SQLite file.

use bytes::Bytes;

use super::jobs::MOST_ATTEMPTS;
use super::sqlite::SqliteStore;
use super::writer::PART_PATIENCE;
use super::{StoreError, now_ms};
use crate::key::Key;

/// Fast: what is put down is hardly ever read again.
const LEVEL: i32 = 1;

impl SqliteStore {
    /// Puts a part of a study down. What was put before, the results of its points, is on the disk by then.
    pub(super) async fn put_down_shard(&self, study: Key, shard: u32, content: Bytes) -> Result<(), StoreError> {
        let packed = zstd::bulk::compress(&content, LEVEL).map_err(|error| StoreError::Failed(error.to_string()))?;
        let checksum = blake3::hash(&packed);
        if !self.writer.flush(PART_PATIENCE).await {
            return Err(StoreError::Failed("the results of its points are not written yet".to_owned()));
        }
        self.ledger
            .write(move |connection| {
                let packed = packed.clone();
                Box::pin(async move {
                    sqlx::query(
                        "INSERT INTO studies (study, shard, points, checksum, created_ms) VALUES (?1, ?2, ?3, ?4, ?5)
                         ON CONFLICT DO UPDATE SET points = excluded.points, checksum = excluded.checksum",
                    )
                    .bind(study.as_bytes().as_slice())
                    .bind(shard)
                    .bind(packed)
                    .bind(checksum.as_bytes().as_slice())
                    .bind(now_ms())
                    .execute(&mut *connection)
                    .await?;
                    // Whoever gets on is not to blame for the end of its processes: what is put down is not computed
                    // again, so that this cannot go on for ever.
                    sqlx::query("UPDATE jobs SET attempt = ?2 WHERE key = ?1 AND state = 'running' AND attempt > ?2")
                        .bind(study.as_bytes().as_slice())
                        .bind(MOST_ATTEMPTS - 1)
                        .execute(connection)
                        .await?;
                    Ok(())
                })
            })
            .await
    }

    /// The parts of a study that are done. One that is damaged is none.
    pub(super) async fn shards_of(&self, study: Key) -> Result<Vec<(u32, Bytes)>, StoreError> {
        let rows: Vec<(u32, Vec<u8>, Vec<u8>)> =
            sqlx::query_as("SELECT shard, points, checksum FROM studies WHERE study = ?1 ORDER BY shard")
                .bind(study.as_bytes().as_slice())
                .fetch_all(&self.readers)
                .await?;
        let sound =
            rows.into_iter().filter(|(_, packed, checksum)| blake3::hash(packed).as_bytes() == checksum.as_slice());
        Ok(sound.filter_map(|(shard, packed, _)| Some((shard, zstd::decode_all(&*packed).ok()?.into()))).collect())
    }

    /// Forgets the parts of a study.
    pub(super) async fn forget_shards_of(&self, study: Key) -> Result<(), StoreError> {
        self.ledger
            .write(move |connection| {
                Box::pin(async move {
                    sqlx::query("DELETE FROM studies WHERE study = ?1")
                        .bind(study.as_bytes().as_slice())
                        .execute(connection)
                        .await?;
                    Ok(())
                })
            })
            .await
    }
}
