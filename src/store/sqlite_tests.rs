#![allow(clippy::unwrap_used, clippy::panic)]

use super::*;
use crate::store::{Cursor, KeptResult, ResultPage, ResultQuery, ResultStore as _};
use tempfile::TempDir;

const AGE: Duration = Duration::from_hours(1);

fn result(number: u32, calculator: &str) -> KeptResult {
    let body: Vec<u8> =
        (0..4000_u32).flat_map(|i| i.wrapping_mul(number).wrapping_mul(2_654_435_761).to_le_bytes()).collect();
    KeptResult {
        key: Key::from_bytes(blake3::hash(&number.to_le_bytes()).as_bytes()).unwrap(),
        calculator: calculator.to_owned(),
        version: 3,
        engine: "0.0.0".to_owned(),
        input: vec![b' '; 100].into(),
        body: body.into(),
        records: String::new(),
    }
}

fn keep(bytes: u64) -> Keep {
    Keep { bytes, age: AGE, jobs: AGE }
}

async fn store(folder: &TempDir, bytes: u64) -> SqliteStore {
    SqliteStore::open(folder.path(), keep(bytes)).await.unwrap()
}

async fn list(store: &SqliteStore, calculator: Option<&str>, limit: u32, after: Option<Cursor>) -> ResultPage {
    let query =
        ResultQuery { calculator: calculator.map(str::to_owned), limit: Some(limit), after, ..ResultQuery::default() };
    store.list(query).await.unwrap()
}

#[tokio::test]
async fn what_is_put_is_got_before_it_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(&folder, 1 << 30).await;
    let all: Vec<KeptResult> = (0..100).map(|number| result(number, "a")).collect();
    for kept in &all {
        store.put(kept.clone());
        assert_eq!(store.get(kept.key).await.unwrap().as_ref(), Some(kept));
        assert!(!store.keys.may_have(&kept.key), "the writer gathers first");
    }
    // The same twice is kept once, and a list does not wait for the writer's rest.
    store.put(all[0].clone());
    assert_eq!(list(&store, None, 500, None).await.items.len(), all.len());
    for kept in &all {
        assert!(store.keys.may_have(&kept.key) && store.writer.waiting(&kept.key).is_none());
        assert_eq!(store.get(kept.key).await.unwrap().as_ref(), Some(kept));
    }
}

#[tokio::test]
async fn a_folder_serves_one_store() {
    let folder = tempfile::tempdir().unwrap();
    let first = store(&folder, 1 << 30).await;
    let refused = SqliteStore::open(folder.path(), keep(1 << 30)).await;
    assert!(matches!(refused, Err(OpenError::InUse(_))));
    first.close().await;
    drop(first);
    store(&folder, 1 << 30).await;
}

#[tokio::test]
async fn a_file_that_is_no_database_is_refused_with_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(DATABASE), "this is no database, whatever its name says ".repeat(100)).unwrap();
    let Err(OpenError::Unusable { folder: named, reason }) = SqliteStore::open(folder.path(), keep(1 << 30)).await
    else {
        panic!("opened")
    };
    assert_eq!(named, folder.path());
    assert!(reason.contains("not a database"), "{reason}");
}

#[tokio::test]
async fn a_database_of_a_newer_program_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let first = store(&folder, 1 << 30).await;
    first.close().await;
    drop(first);
    let options = SqliteConnectOptions::new().filename(folder.path().join(DATABASE));
    let pool = SqlitePool::connect_with(options).await.unwrap();
    sqlx::query("INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time) VALUES (9999, 'x', 1, x'00', 0)")
        .execute(&pool)
        .await
        .unwrap();
    pool.close().await;
    let Err(OpenError::Unusable { reason, .. }) = SqliteStore::open(folder.path(), keep(1 << 30)).await else {
        panic!("opened")
    };
    assert!(reason.contains("newer"), "{reason}");
}

#[tokio::test]
async fn a_locked_database_fails_no_put_and_no_get() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(&folder, 1 << 30).await;
    store.put(result(1, "a"));
    assert!(store.writer.flush(Duration::from_mins(1)).await);
    let options = SqliteConnectOptions::new().filename(folder.path().join(DATABASE));
    let other = SqlitePool::connect_with(options).await.unwrap();
    let locked = other.begin_with("BEGIN EXCLUSIVE").await.unwrap();
    store.put(result(2, "a"));
    // Write-ahead logging: who reads is not held up by who writes.
    assert_eq!(store.get(result(1, "a").key).await.unwrap(), Some(result(1, "a")));
    drop(locked);
    other.close().await;
    assert!(store.writer.flush(Duration::from_mins(1)).await);
    assert_eq!(store.get(result(2, "a").key).await.unwrap(), Some(result(2, "a")));
}
