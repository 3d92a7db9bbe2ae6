#![allow(clippy::unwrap_used, clippy::panic)]

use std::time::Duration;

use sqlx::sqlite::{SqliteConnectOptions, SqlitePool};
use tempfile::TempDir;

use super::*;
use crate::key::Key;
use crate::store::jobs::{Idempotency, JobKind, JobState, Priority};
use crate::store::sqlite::Keep;
use crate::store::{KeptResult, ResultStore};

const MOST: u32 = 3;
const PROBLEM: &str = r#"{"kind":"deadline_exceeded"}"#;

struct Place {
    store: SqliteStore,
    folder: TempDir,
}

fn keep(jobs: Duration) -> Keep {
    Keep { bytes: 1 << 30, age: Duration::from_hours(1), jobs }
}

async fn place() -> Place {
    let folder = tempfile::tempdir().unwrap();
    Place { store: SqliteStore::open(folder.path(), keep(Duration::from_hours(1))).await.unwrap(), folder }
}

impl Place {
    /// As after the end of the process.
    async fn again(self) -> Self {
        let Self { store, folder } = self;
        store.close().await;
        drop(store);
        Self { store: SqliteStore::open(folder.path(), keep(Duration::from_hours(1))).await.unwrap(), folder }
    }

    async fn accept(&self, job: NewJob) -> JobRecord {
        match self.store.submit(job, 100).await.unwrap() {
            Accepted::New(record) => record,
            other => panic!("{other:?}"),
        }
    }

    async fn record(&self, id: JobId) -> JobRecord {
        self.store.job(id).await.unwrap().unwrap()
    }

    async fn claim(&self, id: JobId) -> Claimed {
        self.store.claim(id, Lease::new(), MOST, PROBLEM.to_owned()).await.unwrap()
    }

    async fn run(&self, id: JobId) -> crate::store::jobs::Claim {
        match self.claim(id).await {
            Claimed::Run(claim) => claim,
            other => panic!("{other:?}"),
        }
    }

    /// The jobs that the queue would hand out, in its order.
    async fn line(&self) -> Vec<JobId> {
        let messages: Vec<Vec<u8>> = sqlx::query_scalar(
            "SELECT job FROM Jobs WHERE status = 'Pending' ORDER BY priority DESC, run_at ASC, id ASC",
        )
        .fetch_all(&self.store.readers)
        .await
        .unwrap();
        messages.iter().map(|message| serde_json::from_slice::<String>(message).unwrap().parse().unwrap()).collect()
    }

    async fn pool(&self) -> SqlitePool {
        let options = SqliteConnectOptions::new().filename(self.folder.path().join("precut.db"));
        SqlitePool::connect_with(options).await.unwrap()
    }
}

fn key(number: u32) -> Key {
    Key::from_bytes(blake3::hash(&number.to_le_bytes()).as_bytes()).unwrap()
}

fn job(number: u32) -> NewJob {
    NewJob {
        id: JobId::new(),
        kind: JobKind::Calculation,
        calculator: "a".to_owned(),
        version: 1,
        key: key(number),
        input: format!("{{\"number\":{number}}}").into(),
        priority: Priority::Normal,
        owner: "one".to_owned(),
        idempotency: None,
        estimate_ms: 10.0,
        deadline_ms: None,
        result: None,
    }
}

fn result(number: u32) -> KeptResult {
    KeptResult {
        key: key(number),
        calculator: "a".to_owned(),
        version: 1,
        engine: "0".to_owned(),
        input: "{}".into(),
        body: format!("{{\"answer\":{number}}}").into(),
    }
}

#[tokio::test]
async fn a_job_goes_from_the_line_to_its_result() {
    let place = place().await;
    let accepted = place.accept(job(1)).await;
    assert_eq!((accepted.state, accepted.attempt), (JobState::Queued, 0));
    assert_eq!(place.line().await, [accepted.id]);
    let claim = place.run(accepted.id).await;
    assert_eq!((claim.jobs.as_slice(), claim.attempt), (&[accepted.id][..], 1));
    assert_eq!(claim.input, "{\"number\":1}");
    assert!(matches!(place.claim(accepted.id).await, Claimed::Nothing), "once taken, it waits no more");
    assert_eq!(place.record(accepted.id).await.state, JobState::Running);
    let ended = place.store.finish(claim.lease, Ending::Succeeded(result(1))).await.unwrap();
    assert_eq!(ended, [accepted.id]);
    let done = place.record(accepted.id).await;
    assert_eq!((done.state, done.lease, done.key), (JobState::Succeeded, None, key(1)));
    assert!(done.expires_ms > done.finished_ms);
    assert_eq!(place.store.get(key(1)).await.unwrap(), Some(result(1)));
}

#[tokio::test]
async fn who_has_lost_the_lease_cannot_write() {
    let place = place().await;
    let id = place.accept(job(1)).await.id;
    let first = place.run(id).await;
    // Nobody lives: the job is in line again and taken by somebody else.
    assert_eq!(place.store.sweep(Arc::new(Vec::new)).await.unwrap(), [id]);
    let second = place.run(id).await;
    assert_eq!(second.attempt, 2);
    let other = KeptResult { body: "{\"late\":true}".into(), ..result(1) };
    assert_eq!(place.store.finish(first.lease, Ending::Succeeded(other)).await.unwrap(), []);
    assert_eq!(place.store.get(key(1)).await.unwrap(), None, "nor its result");
    assert_eq!(place.store.release(first.lease).await.unwrap(), []);
    let beat = Beat { lease: first.lease, progress: 0.9, stage: None };
    assert_eq!(place.store.beat(vec![beat]).await.unwrap(), [first.lease], "it is told so");
    let now = place.record(id).await;
    assert_eq!((now.state, now.progress, now.lease), (JobState::Running, 0.0, Some(second.lease)));
    assert_eq!(place.store.finish(second.lease, Ending::Succeeded(result(1))).await.unwrap(), [id]);
    assert_eq!(place.store.finish(second.lease, Ending::Failed("{}".to_owned())).await.unwrap(), [], "nor twice");
    assert_eq!(place.record(id).await.state, JobState::Succeeded);
}

#[tokio::test]
async fn a_live_lease_is_left_alone() {
    let place = place().await;
    let id = place.accept(job(1)).await.id;
    let lease = Lease::new();
    let Claimed::Run(_) = place.store.claim(id, lease, MOST, PROBLEM.to_owned()).await.unwrap() else { panic!() };
    assert_eq!(place.store.sweep(Arc::new(move || vec![lease])).await.unwrap(), []);
    assert_eq!(place.record(id).await.state, JobState::Running);
}

#[tokio::test]
async fn what_a_process_left_running_is_in_line_again_at_the_next_start() {
    let mut place = place().await;
    let (running, waiting) = (place.accept(job(1)).await.id, place.accept(job(2)).await.id);
    place.run(running).await;
    for attempt in 1..=MOST {
        place = place.again().await;
        let record = place.record(running).await;
        assert_eq!((record.state, record.attempt, record.progress), (JobState::Queued, attempt, 0.0));
        // Twice charged, it lets the others go first.
        let expected = if attempt < 2 { [running, waiting] } else { [waiting, running] };
        assert_eq!(place.line().await, expected, "after {attempt}");
        assert_eq!(place.store.waiting_attempts(running).await.unwrap(), Some(attempt));
        match place.claim(running).await {
            Claimed::Run(claim) => assert_eq!(claim.attempt, attempt + 1),
            Claimed::Poisonous(jobs) => assert_eq!((jobs, attempt), (vec![running], MOST)),
            Claimed::Nothing => panic!("it waits"),
        }
    }
    let record = place.record(running).await;
    assert_eq!((record.state, record.problem.as_deref()), (JobState::Failed, Some(PROBLEM)));
    assert_eq!(place.record(waiting).await.state, JobState::Queued);
}

#[tokio::test]
async fn a_start_that_was_given_back_is_not_charged() {
    let place = place().await;
    let id = place.accept(job(1)).await.id;
    for _ in 0..2 * MOST {
        let claim = place.run(id).await;
        assert_eq!(claim.attempt, 1);
        assert_eq!(place.store.release(claim.lease).await.unwrap(), [id]);
        assert_eq!(place.record(id).await.attempt, 0);
        assert!(place.line().await.contains(&id));
    }
}

#[tokio::test]
async fn equal_jobs_are_taken_together_and_end_together() {
    let place = place().await;
    let mut ids = Vec::new();
    for _ in 0..3 {
        ids.push(place.accept(job(1)).await.id);
    }
    let claim = place.run(ids[1]).await;
    let mut taken = claim.jobs.clone();
    taken.sort();
    assert_eq!(taken, ids);
    // One that comes later joins.
    let late = place.accept(job(1)).await;
    assert_eq!((late.state, late.lease, late.attempt), (JobState::Running, Some(claim.lease), 1));
    assert!(!place.line().await.contains(&late.id));
    // A cancel takes one off; the last one ends the computation.
    let first = place.store.cancel(ids[0]).await.unwrap().unwrap();
    assert_eq!((first.before, first.job.state, first.unwanted), (JobState::Running, JobState::Cancelled, None));
    let ended = place.store.finish(claim.lease, Ending::Succeeded(result(1))).await.unwrap();
    assert_eq!(ended.len(), 3);
    assert_eq!(place.record(ids[0]).await.state, JobState::Cancelled);
    let again = place.accept(job(2)).await.id;
    let claim = place.run(again).await;
    let last = place.store.cancel(again).await.unwrap().unwrap();
    assert_eq!(last.unwanted, Some(claim.lease));
    assert_eq!(place.store.finish(claim.lease, Ending::Succeeded(result(2))).await.unwrap(), []);
    assert_eq!(place.store.get(key(2)).await.unwrap(), None);
}

#[tokio::test]
async fn a_job_whose_result_is_there_ends_where_it_begins() {
    let place = place().await;
    let record = place.accept(NewJob { result: Some(result(1)), ..job(1) }).await;
    assert_eq!((record.state, record.progress), (JobState::Succeeded, 1.0));
    assert_eq!(place.line().await, []);
    assert_eq!(place.store.get(key(1)).await.unwrap(), Some(result(1)));
}

#[tokio::test]
async fn a_name_is_one_job_for_its_owner() {
    let place = place().await;
    let named = |number: u32, owner: &str, hash: u8| NewJob {
        owner: owner.to_owned(),
        idempotency: Some(Idempotency { key: "n".to_owned(), body_hash: [hash; 32] }),
        ..job(number)
    };
    let first = place.accept(named(1, "one", 1)).await;
    let submit = |job| place.store.submit(job, 100);
    assert_eq!(submit(named(1, "one", 1)).await.unwrap(), Accepted::Known(first.clone()));
    assert_eq!(submit(named(2, "one", 2)).await.unwrap(), Accepted::OtherBody(first.id));
    assert!(matches!(submit(named(2, "two", 2)).await.unwrap(), Accepted::New(_)));
    // However many come at once.
    let many = (0..20).map(|_| submit(named(3, "three", 3)));
    let outcomes = futures_util::future::join_all(many).await;
    let new = outcomes.iter().filter(|outcome| matches!(outcome, Ok(Accepted::New(_)))).count();
    let known = outcomes.iter().filter(|outcome| matches!(outcome, Ok(Accepted::Known(_)))).count();
    assert_eq!((new, known), (1, 19));
}

#[tokio::test]
async fn a_full_queue_takes_no_more() {
    let place = place().await;
    for number in 0..3 {
        place.accept(job(number)).await;
    }
    let refused = place.store.submit(job(3), 3).await.unwrap();
    assert_eq!(refused, Accepted::QueueFull { queued: 3 });
    assert_eq!(place.store.counts().await.unwrap(), JobCounts { queued: 3, running: 0 });
    assert_eq!(place.line().await.len(), 3);
}

#[tokio::test]
async fn the_line_is_fair_between_owners_and_keeps_priorities() {
    let place = place().await;
    let from = |owner: &str, number: u32, priority| NewJob { owner: owner.to_owned(), priority, ..job(number) };
    let mut ids = Vec::new();
    for number in 0..4 {
        ids.push(place.accept(from("one", number, Priority::Normal)).await.id);
    }
    let low = place.accept(from("one", 10, Priority::Low)).await.id;
    let other = [
        place.accept(from("two", 20, Priority::Normal)).await.id,
        place.accept(from("two", 21, Priority::Normal)).await.id,
    ];
    let high = place.accept(from("three", 30, Priority::High)).await.id;
    // Each owner's first job stands beside the others' first, and so on; within a turn, who came first. Two tasks of
    // the same millisecond may stand either way round, as the queue names them at random.
    let line = place.line().await;
    assert_eq!(line[0], high);
    assert_eq!(*line.last().unwrap(), low);
    let at = |id: JobId| line.iter().position(|other| *other == id).unwrap();
    assert!(at(ids[0]) < at(ids[1]) && at(ids[1]) < at(ids[2]) && at(ids[2]) < at(ids[3]));
    assert!(at(other[0]) < at(ids[1]) && at(other[1]) < at(ids[2]) && at(other[0]) < at(other[1]), "{line:?}");
    // A newcomer begins where the line is now, not before it.
    place.run(ids[0]).await;
    sqlx::query("DELETE FROM Jobs WHERE idempotency_key LIKE ?1")
        .bind(format!("{}:%", ids[0]))
        .execute(&place.pool().await)
        .await
        .unwrap();
    place.run(other[0]).await;
    let third = place.accept(from("four", 40, Priority::Normal)).await.id;
    let line = place.line().await;
    let at = |id: JobId| line.iter().position(|other| *other == id).unwrap();
    assert!(at(third) < at(ids[2]));
}

#[tokio::test]
async fn deadlines_end_what_is_late_and_nothing_else() {
    let place = place().await;
    let now = now_ms();
    let due = |number: u32, ms: i64| NewJob { deadline_ms: Some(now + ms), ..job(number) };
    let late = place.accept(due(1, -10)).await.id;
    let running = place.accept(due(2, -5)).await.id;
    let later = place.accept(due(3, 60_000)).await.id;
    let claim = place.run(running).await;
    let (changed, next) = place.store.expire_deadlines(PROBLEM.to_owned()).await.unwrap();
    let mut jobs = changed.jobs;
    jobs.sort();
    assert_eq!((jobs, changed.unwanted, next), (vec![late, running], vec![claim.lease], Some(now + 60_000)));
    for id in [late, running] {
        let record = place.record(id).await;
        assert_eq!((record.state, record.problem.as_deref()), (JobState::Failed, Some(PROBLEM)));
    }
    assert_eq!(place.record(later).await.state, JobState::Queued);
    assert_eq!(place.store.finish(claim.lease, Ending::Succeeded(result(2))).await.unwrap(), []);
}

#[tokio::test]
async fn a_lost_task_is_given_again_and_no_other() {
    let place = place().await;
    let (lost, kept) = (place.accept(job(1)).await.id, place.accept(job(2)).await.id);
    assert_eq!(place.store.sweep(Arc::new(Vec::new)).await.unwrap(), []);
    let pool = place.pool().await;
    sqlx::query("DELETE FROM Jobs WHERE idempotency_key LIKE ?1")
        .bind(format!("{lost}:%"))
        .execute(&pool)
        .await
        .unwrap();
    assert_eq!(place.store.sweep(Arc::new(Vec::new)).await.unwrap(), [lost]);
    let mut line = place.line().await;
    line.sort();
    assert_eq!(line, [lost, kept]);
}

#[tokio::test]
async fn what_a_kept_job_points_to_stays_and_what_is_expired_goes() {
    let folder = tempfile::tempdir().unwrap();
    let small = Keep { bytes: 1, age: Duration::ZERO, jobs: Duration::from_millis(400) };
    let store = SqliteStore::open(folder.path(), small).await.unwrap();
    let place = Place { store, folder };
    let id = place.accept(NewJob { result: Some(result(1)), ..job(1) }).await.id;
    place.store.put(KeptResult { body: vec![b' '; 4000].into(), ..result(2) });
    place.store.list(crate::store::ResultQuery::default()).await.unwrap();
    place.store.put(result(3));
    place.store.list(crate::store::ResultQuery::default()).await.unwrap();
    assert_eq!(place.store.get(key(2)).await.unwrap(), None, "what no job points to is evicted");
    assert_eq!(place.store.get(key(1)).await.unwrap(), Some(result(1)));
    assert_eq!(place.store.forget_expired().await.unwrap(), 0);
    tokio::time::sleep(Duration::from_millis(450)).await;
    assert_eq!(place.store.forget_expired().await.unwrap(), 0, "its record is known for as long again");
    assert!(place.record(id).await.expires_ms.unwrap() <= now_ms());
    place.store.put(KeptResult { body: vec![b' '; 4000].into(), ..result(4) });
    place.store.list(crate::store::ResultQuery::default()).await.unwrap();
    assert_eq!(place.store.get(key(1)).await.unwrap(), None);
    tokio::time::sleep(Duration::from_millis(400)).await;
    assert_eq!(place.store.forget_expired().await.unwrap(), 1);
    assert_eq!(place.store.job(id).await.unwrap(), None);
}

#[tokio::test]
async fn a_full_disk_refuses_a_job_as_a_whole_and_later_takes_it() {
    let place = place().await;
    let before = place.accept(job(1)).await.id;
    // The database may not grow: what SQLite says then is what it says when the disk is full.
    let pages: i64 = sqlx::query_scalar("PRAGMA page_count").fetch_one(&place.store.tasks.pool()).await.unwrap();
    let bound = format!("PRAGMA max_page_count = {pages}");
    sqlx::query(sqlx::AssertSqlSafe(bound)).execute(&place.store.tasks.pool()).await.unwrap();
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
    let place = place().await;
    // Not the five seconds of service: the test waits for it.
    sqlx::query("PRAGMA busy_timeout = 50").execute(&place.store.tasks.pool()).await.unwrap();
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
async fn timings_are_kept_newest_first() {
    let place = place().await;
    for ms in [1.0, 2.0, 3.0] {
        let timing = Timing { calculator: "a".to_owned(), version: 1, predicted_ms: 10.0, actual_ms: ms };
        place.store.note_timing(timing).await.unwrap();
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    let timings = place.store.timings(2).await.unwrap();
    assert_eq!(
        timings.iter().map(|timing| timing.actual_ms.to_bits()).collect::<Vec<_>>(),
        [3.0_f64, 2.0].map(f64::to_bits)
    );
}

#[tokio::test]
async fn the_queue_hands_out_each_task_once_and_no_more_than_there_are_places() {
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};
    let place = place().await;
    let (seen, now, most) =
        (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
    let run: RunTask = {
        let (seen, now, most) = (Arc::clone(&seen), Arc::clone(&now), Arc::clone(&most));
        Arc::new(move |id| {
            let (seen, now, most) = (Arc::clone(&seen), Arc::clone(&now), Arc::clone(&most));
            Box::pin(async move {
                most.fetch_max(now.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                tokio::time::sleep(Duration::from_millis(5)).await;
                now.fetch_sub(1, Ordering::SeqCst);
                seen.lock().unwrap().push(id);
            })
        })
    };
    let (stop, stopped) = watch::channel(false);
    let working = tokio::spawn(place.store.work(2, run, stopped));
    let mut expected = Vec::new();
    for number in 0..20 {
        expected.push(place.accept(job(number)).await.id);
    }
    for _ in 0..500 {
        if seen.lock().unwrap().len() == expected.len() {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    stop.send_replace(true);
    working.await.unwrap();
    let mut seen = seen.lock().unwrap().clone();
    seen.sort();
    assert_eq!(seen, expected);
    assert_eq!(most.load(Ordering::SeqCst), 2);
}

#[tokio::test]
async fn the_database_of_the_version_before_is_taken_over_with_its_results() {
    let folder = tempfile::tempdir().unwrap();
    let options = SqliteConnectOptions::new().filename(folder.path().join("precut.db")).create_if_missing(true);
    let pool = SqlitePool::connect_with(options).await.unwrap();
    let mut before = sqlx::migrate!("./migrations");
    before.migrations = before.migrations.iter().filter(|migration| migration.version == 1).cloned().collect();
    before.run(&pool).await.unwrap();
    let mut packer = crate::store::row::Packer::new().unwrap();
    let row = packer.row(&result(1)).unwrap();
    crate::store::row::insert(&[row], 1, &mut pool.acquire().await.unwrap()).await.unwrap();
    pool.close().await;
    let place = Place {
        store: SqliteStore::open(folder.path(), Keep { age: Duration::MAX, ..keep(Duration::from_hours(1)) })
            .await
            .unwrap(),
        folder,
    };
    assert_eq!(place.store.get(key(1)).await.unwrap(), Some(result(1)));
    place.accept(job(2)).await;
}
