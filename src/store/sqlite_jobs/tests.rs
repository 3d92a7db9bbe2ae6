#![allow(clippy::unwrap_used, clippy::panic)]

use std::time::Duration;

use sqlx::sqlite::{SqliteConnectOptions, SqlitePool};
use tempfile::TempDir;

use super::*;
use crate::store::jobs::{JobShelf as _, JobState};
use crate::store::sqlite::Keep;
use crate::store::suite::{Place, job, keep, key, result, suite};
use crate::store::{ResultStore, Store};

/// A store in a folder of its own.
struct InFile {
    store: SqliteStore,
    folder: TempDir,
}

impl InFile {
    const fn is_there() -> bool {
        true
    }

    async fn pool(&self) -> SqlitePool {
        let options = SqliteConnectOptions::new().filename(self.folder.path().join("precut.db"));
        SqlitePool::connect_with(options).await.unwrap()
    }
}

impl Place for InFile {
    async fn with(keep: Keep) -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self { store: SqliteStore::open(folder.path(), keep).await.unwrap(), folder }
    }

    fn store(&self) -> &dyn Store {
        &self.store
    }

    async fn again_with(self, keep: Keep) -> Self {
        let Self { store, folder } = self;
        store.close().await;
        drop(store);
        Self { store: SqliteStore::open(folder.path(), keep).await.unwrap(), folder }
    }

    async fn line(&self) -> Vec<JobId> {
        let line: Vec<String> =
            sqlx::query_scalar("SELECT id FROM jobs WHERE state = 'queued' ORDER BY priority DESC, turn, id")
                .fetch_all(&self.store.readers)
                .await
                .unwrap();
        line.iter().map(|id| id.parse().unwrap()).collect()
    }

    /// One process: it knows what it runs.
    async fn silence(&self) {}

    async fn later(&self, ms: i64) {
        let pool = self.pool().await;
        for earlier in [
            "UPDATE jobs SET started_ms = started_ms - ?1, finished_ms = finished_ms - ?1, expires_ms = expires_ms - ?1",
            "UPDATE work SET minute = (minute * 60000 - ?1) / 60000",
        ] {
            sqlx::query(earlier).bind(ms).execute(&pool).await.unwrap();
        }
    }

    async fn damage(&self) {
        let pool = self.pool().await;
        for damage in
            ["UPDATE results SET version = 4", "UPDATE jobs SET content = substr(content, 1, length(content) - 1)"]
        {
            sqlx::query(damage).execute(&pool).await.unwrap();
        }
    }

    async fn abandon(&self, key: Key) {
        let gone = sqlx::query("DELETE FROM jobs WHERE key = ?1").bind(key.as_bytes().as_slice());
        gone.execute(&self.pool().await).await.unwrap();
    }

    async fn shards(&self) -> i64 {
        let shards = sqlx::query_scalar("SELECT count(*) FROM jobs WHERE parent IS NOT NULL");
        shards.fetch_one(&self.pool().await).await.unwrap()
    }
}

suite!(InFile);

#[tokio::test]
async fn a_full_disk_refuses_a_job_as_a_whole_and_later_takes_it() {
    let place = InFile::new().await;
    let before = place.accept(job(1)).await.id;
    // The database may not grow: what SQLite says then is what it says when the disk is full.
    let pages: i64 = sqlx::query_scalar("PRAGMA page_count").fetch_one(&place.store.writing).await.unwrap();
    let bound = format!("PRAGMA max_page_count = {pages}");
    sqlx::query(sqlx::AssertSqlSafe(bound)).execute(&place.store.writing).await.unwrap();
    let mut noise = vec![0_u8; 1 << 20];
    blake3::Hasher::new().finalize_xof().fill(&mut noise);
    let large = NewJob { input: noise.into(), ..job(2) };
    let id = large.id;
    assert!(matches!(place.store.submit(large.clone(), 100).await, Err(StoreError::Full(_))));
    assert_eq!(place.store.job(id).await.unwrap(), None);
    assert_eq!(place.line().await, [before]);
    assert_eq!(place.record(before).await.state, JobState::Queued);
    // There is room again: a new connection has no bound.
    place.accept(large).await;
    assert_eq!(place.line().await.len(), 2);
}

#[tokio::test]
async fn a_locked_database_refuses_a_job_and_later_takes_it() {
    let place = InFile::new().await;
    // Not the five seconds of service: the test waits for it.
    sqlx::query("PRAGMA busy_timeout = 50").execute(&place.store.writing).await.unwrap();
    let other = place.pool().await;
    let locked = other.begin_with("BEGIN EXCLUSIVE").await.unwrap();
    let refused = futures_util::future::join_all((0..5).map(|number| place.store.submit(job(number), 100))).await;
    assert!(refused.iter().all(|outcome| matches!(outcome, Err(StoreError::Failed(_)))), "{refused:?}");
    drop(locked);
    other.close().await;
    let id = place.accept(job(9)).await.id;
    assert_eq!(place.line().await, [id]);
}

#[tokio::test]
async fn the_database_of_the_version_before_is_taken_over_with_its_results() {
    let folder = tempfile::tempdir().unwrap();
    let options = SqliteConnectOptions::new().filename(folder.path().join("precut.db")).create_if_missing(true);
    let pool = SqlitePool::connect_with(options).await.unwrap();
    let mut before = crate::store::sqlite::migrations();
    before.migrations = before.migrations.iter().filter(|migration| migration.version == 1).cloned().collect();
    before.run(&pool).await.unwrap();
    let mut packer = crate::store::row::Packer::new().unwrap();
    let row = packer.row(&result(1)).unwrap();
    sqlx::query(
        "INSERT INTO results (key, calculator, version, engine, input, body, checksum, bytes, created_ms, used_ms)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, 1, 1)",
    )
    .bind(&row.key)
    .bind(&row.calculator)
    .bind(row.version)
    .bind(&row.engine)
    .bind(&row.input)
    .bind(&row.body)
    .bind(&row.checksum)
    .bind(row.bytes())
    .execute(&pool)
    .await
    .unwrap();
    pool.close().await;
    let place = InFile {
        store: SqliteStore::open(folder.path(), Keep { age: Duration::MAX, ..keep(Duration::from_hours(1)) })
            .await
            .unwrap(),
        folder,
    };
    assert_eq!(place.store.get(key(1)).await.unwrap(), Some(result(1)));
    place.accept(job(2)).await;
}

#[tokio::test]
async fn jobs_that_waited_in_the_queue_of_earlier_programs_are_lost_nowhere() {
    let folder = tempfile::tempdir().unwrap();
    let options = SqliteConnectOptions::new().filename(folder.path().join("precut.db")).create_if_missing(true);
    let pool = SqlitePool::connect_with(options).await.unwrap();
    let mut before = crate::store::sqlite::migrations();
    before.migrations = before.migrations.iter().filter(|migration| migration.version <= 12).cloned().collect();
    before.run(&pool).await.unwrap();
    // As that queue made them, and its list of migrations in ours.
    sqlx::raw_sql(
        "CREATE TABLE Workers (id TEXT NOT NULL UNIQUE, worker_type TEXT NOT NULL);
         CREATE TABLE Jobs (job BLOB NOT NULL, id TEXT NOT NULL UNIQUE, job_type TEXT NOT NULL, status TEXT NOT NULL,
             lock_by TEXT, idempotency_key TEXT, PRIMARY KEY (id), FOREIGN KEY (lock_by) REFERENCES Workers (id));
         CREATE UNIQUE INDEX idx_jobs_idempotency_key ON Jobs (job_type, idempotency_key);
         INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
             VALUES (20220530084123, 'jobs workers', 1, x'00', 0), (20260804103122, 'drop', 1, x'00', 0);
         INSERT INTO Workers VALUES ('precut-1', 'precut');
         INSERT INTO studies VALUES (zeroblob(32), 0, x'00', zeroblob(32), 1)",
    )
    .execute(&pool)
    .await
    .unwrap();
    // One waits, the task of another was lost, a third was running when the process ended.
    let jobs = [job(1), job(2), job(3)];
    for (turn, (job, (task, lease))) in
        jobs.iter().zip([(Some("Pending"), None), (None, None), (Some("Running"), Some(Lease::new()))]).enumerate()
    {
        let lease = lease.map(|lease| lease.to_string());
        sqlx::query(
            "INSERT INTO precut_jobs (id, kind, calculator, version, key, input, state, attempt, lease, priority, turn, pushed,
                 owner, estimate_ms, created_ms)
             VALUES (?1, 'calculation', 'a', 1, ?2, ?3, iif(?4 IS NULL, 'queued', 'running'), ?4 IS NOT NULL, ?4, 1, ?5, 1,
                 'one', 10.0, 1)",
        )
        .bind(job.id.to_string())
        .bind(job.key.as_bytes().as_slice())
        .bind(zstd::encode_all(&*job.input, 1).unwrap())
        .bind(lease)
        .bind(i64::try_from(turn).unwrap())
        .execute(&pool)
        .await
        .unwrap();
        if let Some(status) = task {
            sqlx::query(
                "INSERT INTO Jobs VALUES (?1, ?1, 'precut', ?2, iif(?2 = 'Running', 'precut-1', NULL), ?1 || ':1')",
            )
            .bind(job.id.to_string())
            .bind(status)
            .execute(&pool)
            .await
            .unwrap();
        }
    }
    pool.close().await;
    let place =
        InFile { store: SqliteStore::open(folder.path(), keep(Duration::from_hours(1))).await.unwrap(), folder };
    assert_eq!(place.line().await, jobs.each_ref().map(|job| job.id));
    let left: Vec<String> = sqlx::query_scalar(
        "SELECT name FROM sqlite_master WHERE tbl_name IN ('Jobs', 'Workers', 'studies')
         UNION ALL SELECT CAST(version AS TEXT) FROM _sqlx_migrations WHERE version > 1000000",
    )
    .fetch_all(&place.store.readers)
    .await
    .unwrap();
    assert_eq!(left, [""; 0]);
    for job in &jobs {
        let Next::Run(claim) = place.next(None).await else { panic!("it waits") };
        assert_eq!((claim.jobs.as_slice(), &claim.input), (&[job.id][..], &job.input));
    }
    // And at every start from now on.
    let place = place.again().await;
    assert_eq!(place.line().await.len(), 3);
}
