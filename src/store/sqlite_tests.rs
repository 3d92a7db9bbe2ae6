#![allow(clippy::unwrap_used, clippy::panic)]

use super::*;
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
    }
}

fn keep(bytes: u64) -> Keep {
    Keep { bytes, age: AGE, jobs: AGE }
}

async fn store(folder: &TempDir, bytes: u64) -> SqliteStore {
    SqliteStore::open(folder.path(), keep(bytes)).await.unwrap()
}

async fn list(store: &SqliteStore, calculator: Option<&str>, limit: u32, after: Option<Cursor>) -> ResultPage {
    let query = ResultQuery { calculator: calculator.map(str::to_owned), limit: Some(limit), after };
    store.list(query).await.unwrap()
}

#[tokio::test]
async fn what_is_put_is_got_after_the_store_was_closed() {
    let folder = tempfile::tempdir().unwrap();
    let kept = result(1, "a");
    let first = store(&folder, 1 << 30).await;
    assert_eq!(first.get(kept.key).await.unwrap(), None);
    first.put(kept.clone());
    first.close().await;
    drop(first);
    let second = store(&folder, 1 << 30).await;
    second.ping().await.unwrap();
    assert_eq!(second.get(kept.key).await.unwrap(), Some(kept));
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
async fn what_is_too_much_to_wait_is_not_kept_and_does_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(&folder, 1 << 30).await;
    let large = |number: u32| KeptResult { body: vec![b' '; 20 << 20].into(), ..result(number, "a") };
    for number in 0..5 {
        store.put(large(number));
    }
    assert_eq!(store.get(large(4).key).await.unwrap(), None);
    assert_eq!(list(&store, None, 10, None).await.items.len(), 3);
    store.put(large(4));
    assert_eq!(list(&store, None, 10, None).await.items.len(), 4);
    assert_eq!(store.get(large(4).key).await.unwrap(), Some(large(4)));
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
async fn a_damaged_row_is_not_served_and_goes_away() {
    let folder = tempfile::tempdir().unwrap();
    let kept = result(1, "a");
    let first = store(&folder, 1 << 30).await;
    first.put(kept.clone());
    first.close().await;
    drop(first);
    let options = SqliteConnectOptions::new().filename(folder.path().join(DATABASE));
    let pool = SqlitePool::connect_with(options).await.unwrap();
    sqlx::query("UPDATE results SET version = 4").execute(&pool).await.unwrap();
    pool.close().await;
    let second = store(&folder, 1 << 30).await;
    assert_eq!(second.get(kept.key).await.unwrap(), None);
    assert_eq!(list(&second, None, 10, None).await.items, []);
    // It can be kept again.
    second.put(kept.clone());
    assert_eq!(list(&second, None, 10, None).await.items.len(), 1);
    assert_eq!(second.get(kept.key).await.unwrap(), Some(kept));
}

#[tokio::test]
async fn the_list_is_paged_newest_first_and_filtered() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(&folder, 1 << 30).await;
    for number in 0..7 {
        store.put(result(number, if number % 2 == 0 { "even" } else { "odd" }));
        if number == 3 {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }
    let whole = list(&store, None, 100, None).await;
    assert_eq!((whole.items.len(), whole.next), (7, None));
    assert!(whole.items.is_sorted_by(|a, b| (a.created_ms, a.key) > (b.created_ms, b.key)));
    let mut paged = Vec::new();
    let mut after = None;
    loop {
        let page = list(&store, None, 3, after).await;
        paged.extend(page.items);
        after = page.next;
        // A cursor goes through the text of an address.
        let Some(cursor) = after else { break };
        assert_eq!(cursor.to_string().parse(), Ok(cursor));
    }
    assert_eq!(paged, whole.items);
    let odd = list(&store, Some("odd"), 2, None).await;
    let rest = list(&store, Some("odd"), 2, odd.next).await;
    assert_eq!((odd.items.len(), rest.items.len(), rest.next), (2, 1, None));
    assert!(odd.items.iter().chain(&rest.items).all(|item| item.calculator == "odd"));
    assert_eq!(list(&store, Some("none"), 2, None).await, ResultPage::default());
}

#[tokio::test]
async fn the_total_stays_below_the_limit_and_the_last_used_stay() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(&folder, 200_000).await;
    let favourite = result(1000, "a");
    store.put(favourite.clone());
    for number in 0..40 {
        store.put(result(number, "a"));
        tokio::time::sleep(Duration::from_millis(2)).await;
        assert!(store.get(favourite.key).await.unwrap().is_some() || number == 0, "evicted after {number}");
        store.writer.flush().await;
    }
    let items = list(&store, None, 500, None).await.items;
    let total: u64 = items.iter().map(|item| item.bytes).sum();
    assert!(total <= 200_000 && items.len() > 5, "{total} bytes in {}", items.len());
    assert_eq!(store.get(result(0, "a").key).await.unwrap(), None);
    assert_eq!(store.get(result(39, "a").key).await.unwrap(), Some(result(39, "a")));
}

#[tokio::test]
async fn what_is_old_is_forgotten_at_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let first = store(&folder, 1 << 30).await;
    first.put(result(1, "a"));
    first.close().await;
    drop(first);
    tokio::time::sleep(Duration::from_millis(20)).await;
    let second =
        SqliteStore::open(folder.path(), Keep { age: Duration::from_millis(1), ..keep(1 << 30) }).await.unwrap();
    tokio::time::sleep(Duration::from_millis(50)).await;
    assert_eq!(list(&second, None, 10, None).await.items, []);
    assert_eq!(second.get(result(1, "a").key).await.unwrap(), None);
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
    store.writer.flush().await;
    let options = SqliteConnectOptions::new().filename(folder.path().join(DATABASE));
    let other = SqlitePool::connect_with(options).await.unwrap();
    let locked = other.begin_with("BEGIN EXCLUSIVE").await.unwrap();
    store.put(result(2, "a"));
    // Write-ahead logging: who reads is not held up by who writes.
    assert_eq!(store.get(result(1, "a").key).await.unwrap(), Some(result(1, "a")));
    drop(locked);
    other.close().await;
    store.writer.flush().await;
    assert_eq!(store.get(result(2, "a").key).await.unwrap(), Some(result(2, "a")));
}
