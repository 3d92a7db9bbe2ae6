//! The suite over a real PostgreSQL, and what only such a store has. `PRECUT_TEST_POSTGRES` names a server on which
//! databases may be made; without it these tests say so and pass, where nothing may be left out they fail.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use sqlx::postgres::{PgConnectOptions, PgPool};
use tokio::sync::{OnceCell, mpsc};

use super::*;
use crate::store::address::StoreAddress;
use crate::store::jobs::{
    Accepted, Beat, Changed, Claimed, Ending, JobId, JobShelf as _, JobState, JobStore, Lease, NewJob, News, Next,
    Wanted,
};
use crate::store::suite::{MOST, PROBLEM, Place, job, keep, key, result, suite};
use crate::store::{ResultStore, Store};

const SERVER: &str = "PRECUT_TEST_POSTGRES";
/// Tests that do not look at waiting do not wait.
const AT_ONCE: Patience = Patience {
    start: Duration::from_secs(5),
    lease: Duration::from_mins(1),
    grace: Duration::ZERO,
    adoption: Duration::ZERO,
    points: Duration::from_secs(5),
};

fn server() -> Option<String> {
    std::env::var(SERVER).ok()
}

/// A database of its own on the server.
struct InDatabase {
    store: PostgresStore,
    name: String,
    keep: Keep,
    runtime_pool: PgPool,
}

fn secret(database: &str) -> Secret {
    let server = server().unwrap();
    let (address, query) = server.split_once('?').map_or((server.as_str(), ""), |(address, query)| (address, query));
    let start = address.rsplit_once('/').unwrap().0;
    match format!("{start}/{database}?{query}").parse().unwrap() {
        StoreAddress::Postgres(secret) => secret,
        StoreAddress::Sqlite => panic!("{SERVER} is no PostgreSQL"),
    }
}

async fn pool(database: &str) -> PgPool {
    PgPool::connect_with(PgConnectOptions::from_str(secret(database).reveal()).unwrap()).await.unwrap()
}

/// A database whose tables are made once: a copy of it is quicker than making them again.
async fn template() -> &'static str {
    static TEMPLATE: OnceCell<String> = OnceCell::const_new();
    TEMPLATE
        .get_or_init(|| async {
            let name = format!("precut_template_{}", std::process::id());
            create(&name, "template0").await;
            let pool = start::connected(&secret(&name), &usage(keep(Duration::from_hours(1)))).await.unwrap();
            pool.close().await;
            name
        })
        .await
}

async fn create(name: &str, template: &str) {
    let server = pool("postgres").await;
    let statement = format!("CREATE DATABASE {name} TEMPLATE {template}");
    // Two copies of one template at once are refused.
    for _ in 0..2400 {
        match sqlx::query(sqlx::AssertSqlSafe(statement.clone())).execute(&server).await {
            Ok(_) => return server.close().await,
            Err(_) => tokio::time::sleep(Duration::from_millis(25)).await,
        }
    }
    panic!("{statement}");
}

fn usage(keep: Keep) -> Use {
    Use { keep, connections: 4, patience: AT_ONCE, engine: "0.1.0".to_owned(), works: false }
}

impl InDatabase {
    fn is_there() -> bool {
        if server().is_some() {
            return true;
        }
        assert!(std::env::var("CI").as_deref() != Ok("true"), "{SERVER} names no PostgreSQL");
        eprintln!("NOT TESTED: no PostgreSQL ({SERVER}); ./test.sh starts one");
        false
    }

    async fn open(name: String, keep: Keep, usage: Use) -> Self {
        let store = PostgresStore::open(&secret(&name), usage).await.unwrap();
        let runtime_pool = pool(&name).await;
        Self { store, name, keep, runtime_pool }
    }

    /// Another process with the same database.
    async fn other(&self) -> PostgresStore {
        PostgresStore::open(&secret(&self.name), usage(self.keep)).await.unwrap()
    }

    async fn execute(&self, statement: &'static str) {
        sqlx::query(statement).execute(&self.runtime_pool).await.unwrap();
    }
}

/// A database as the programs left it that had a queue beside the jobs, with three of them: one waits, the task of another was
/// lost, the third is run by somebody who has been silent for long. The queue may be shared with a program of others.
async fn before_one_queue(jobs: &[NewJob; 3], is_shared: bool) -> String {
    let name = format!("precut_test_{}", uuid::Uuid::now_v7().simple());
    create(&name, "template0").await;
    let pool = pool(&name).await;
    let mut before = start::migrations();
    before.migrations = before.migrations.iter().filter(|migration| migration.version <= 7).cloned().collect();
    before.run(&pool).await.unwrap();
    sqlx::raw_sql(
        "CREATE SCHEMA apalis;
         CREATE TABLE apalis._sqlx_migrations (version bigint PRIMARY KEY);
         CREATE TABLE apalis.workers (id text PRIMARY KEY, worker_type text NOT NULL);
         CREATE TABLE apalis.jobs (job bytea NOT NULL, id text PRIMARY KEY, job_type text NOT NULL, status text NOT NULL,
             lock_by text REFERENCES apalis.workers (id), idempotency_key text);
         CREATE FUNCTION apalis.get_jobs(worker text) RETURNS SETOF apalis.jobs LANGUAGE sql AS $$ SELECT * FROM apalis.jobs $$;
         INSERT INTO apalis.workers VALUES ('precut-1', 'precut/0.1.0');
         INSERT INTO precut.studies (study, shard, created_ms) VALUES (decode(repeat('00', 32), 'hex'), 0, 1);
         INSERT INTO precut.shared_studies (study, created_ms) VALUES (decode(repeat('00', 32), 'hex'), 1)",
    )
    .execute(&pool)
    .await
    .unwrap();
    for (turn, (job, (task, lease))) in
        jobs.iter().zip([(Some("Pending"), None), (None, None), (Some("Queued"), Some(Lease::new()))]).enumerate()
    {
        let lease = lease.map(|lease| lease.to_string());
        sqlx::query(
            "INSERT INTO precut.jobs (id, kind, calculator, version, engine, key, input, state, attempt, lease, heartbeat_ms,
                 priority, turn, pushed, owner, estimate_ms, created_ms)
             VALUES ($1, 'calculation', 'a', 1, '0.1.0', $2, $3, CASE WHEN $4 IS NULL THEN 'queued' ELSE 'running' END,
                 CASE WHEN $4 IS NULL THEN 0 ELSE 1 END, $4, CASE WHEN $4 IS NOT NULL THEN 1 END, 1, $5, 1, 'one', 10, 1)",
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
                "INSERT INTO apalis.jobs VALUES ('', $1, 'precut/0.1.0', $2, CASE WHEN $2 = 'Queued' THEN 'precut-1' END, $1 || ':1')",
            )
            .bind(job.id.to_string())
            .bind(status)
            .execute(&pool)
            .await
            .unwrap();
        }
    }
    if is_shared {
        sqlx::raw_sql(
            "INSERT INTO apalis.workers VALUES ('other', 'mail');
             INSERT INTO apalis.jobs VALUES ('', 'other', 'mail', 'Queued', 'other', NULL)",
        )
        .execute(&pool)
        .await
        .unwrap();
    }
    pool.close().await;
    name
}

/// The next job for one of its processes.
async fn take(store: &PostgresStore) -> Next {
    JobStore::take(store, Wanted { lease: Lease::new(), short_ms: None, again: false }).await.unwrap()
}

impl Place for InDatabase {
    async fn with(keep: Keep) -> Self {
        let name = format!("precut_test_{}", uuid::Uuid::now_v7().simple());
        create(&name, template().await).await;
        Self::open(name, keep, usage(keep)).await
    }

    fn store(&self) -> &dyn Store {
        &self.store
    }

    async fn again_with(self, keep: Keep) -> Self {
        let Self { store, name, runtime_pool, .. } = self;
        store.close().await;
        runtime_pool.close().await;
        drop(store);
        let place = Self::open(name, keep, usage(keep)).await;
        // What is done at the start of the only process is done here when its leases have run out.
        place.silence().await;
        place.store.sweep(Arc::new(Vec::new)).await.unwrap();
        place
    }

    async fn line(&self) -> Vec<JobId> {
        let line: Vec<String> =
            sqlx::query_scalar("SELECT id FROM precut.jobs WHERE state = 'queued' ORDER BY priority DESC, turn, id")
                .fetch_all(&self.runtime_pool)
                .await
                .unwrap();
        line.iter().map(|id| id.parse().unwrap()).collect()
    }

    async fn silence(&self) {
        self.execute("UPDATE precut.jobs SET heartbeat_ms = heartbeat_ms - 100000").await;
    }

    async fn later(&self, ms: i64) {
        for earlier in [
            "UPDATE precut.jobs SET started_ms = started_ms - $1, finished_ms = finished_ms - $1, expires_ms = expires_ms - $1",
            "UPDATE precut.work SET minute = (minute * 60000 - $1) / 60000",
        ] {
            sqlx::query(earlier).bind(ms).execute(&self.runtime_pool).await.unwrap();
        }
    }

    async fn damage(&self) {
        self.execute("UPDATE precut.results SET version = 4").await;
        self.execute("UPDATE precut.jobs SET content = substring(content FROM 1 FOR octet_length(content) - 1)").await;
    }

    async fn abandon(&self, key: Key) {
        let gone = sqlx::query("DELETE FROM precut.jobs WHERE key = $1").bind(key.as_bytes().as_slice());
        gone.execute(&self.runtime_pool).await.unwrap();
    }

    async fn shards(&self) -> i64 {
        let shards = sqlx::query_scalar("SELECT count(*) FROM precut.jobs WHERE parent IS NOT NULL");
        shards.fetch_one(&self.runtime_pool).await.unwrap()
    }
}

suite!(InDatabase);

/// What only several processes meet.
macro_rules! shared {
    ($($(#[$about:meta])* async fn $test:ident() $body:block)+) => {
        $(
            $(#[$about])*
            #[tokio::test]
            async fn $test() {
                if InDatabase::is_there() $body
            }
        )+
    };
}

shared! {
    async fn a_computation_that_says_it_lives_is_left_to_its_process() {
        let place = InDatabase::new().await;
        let other = place.other().await;
        let id = place.accept(job(1)).await.id;
        let claim = place.run(id).await;
        // The other process knows nothing of the lease but what stands in the record.
        assert_eq!(other.sweep(Arc::new(Vec::new)).await.unwrap(), []);
        place.silence().await;
        let beat = Beat { lease: claim.lease, progress: 0.5, stage: None };
        assert_eq!(place.store.beat(vec![beat]).await.unwrap(), []);
        assert_eq!(other.sweep(Arc::new(Vec::new)).await.unwrap(), []);
        assert_eq!(other.job(id).await.unwrap().unwrap().progress.to_bits(), 0.5_f64.to_bits());
        place.silence().await;
        assert_eq!(other.sweep(Arc::new(Vec::new)).await.unwrap(), [id]);
    }

    async fn nobody_is_taken_for_dead_just_after_the_database_has_started() {
        let place = InDatabase::new().await;
        let patience = Patience { grace: Duration::from_hours(1_000_000), ..AT_ONCE };
        let usage = Use { patience, ..usage(place.keep) };
        let other = PostgresStore::open(&secret(&place.name), usage).await.unwrap();
        let id = place.accept(job(1)).await.id;
        place.run(id).await;
        place.silence().await;
        assert_eq!(other.sweep(Arc::new(Vec::new)).await.unwrap(), []);
        assert_eq!(place.store.sweep(Arc::new(Vec::new)).await.unwrap(), [id]);
    }

    async fn a_claim_whose_answer_was_lost_is_answered_again() {
        let place = InDatabase::new().await;
        let id = place.accept(job(1)).await.id;
        let lease = Lease::new();
        for _ in 0..2 {
            let Claimed::Run(claim) = place.store.claim(id, lease, MOST, PROBLEM.to_owned()).await.unwrap() else {
                panic!("it is ours")
            };
            assert_eq!((claim.jobs.as_slice(), claim.attempt), (&[id][..], 1));
            assert_eq!(claim.input, "{\"number\":1}");
        }
    }

    async fn what_happens_in_one_process_is_told_to_the_other() {
        let place = InDatabase::new().await;
        let other = place.other().await;
        let (sender, mut heard) = mpsc::unbounded_channel();
        other.tell(Arc::new(move |news| drop(sender.send(news))));
        // It listens from some moment on.
        let mut next = async |wanted: &dyn Fn(&Changed) -> bool| loop {
            let news = tokio::time::timeout(Duration::from_secs(10), heard.recv()).await;
            match news.expect("news within ten seconds").expect("the store lives") {
                News::Changed(changed) if wanted(&changed) => return changed,
                _ => {}
            }
        };
        let mut told = 0;
        while told == 0 {
            let id = place.accept(job(100)).await.id;
            let cancelled = place.store.cancel(id).await.unwrap().unwrap();
            assert_eq!(cancelled.job.state, JobState::Cancelled);
            tokio::time::sleep(Duration::from_millis(20)).await;
            told += usize::from(tokio::time::timeout(Duration::from_millis(200), next(&|_| true)).await.is_ok());
        }
        let id = place.accept(job(1)).await.id;
        let claim = place.run(id).await;
        next(&|changed| changed.jobs == [id]).await;
        place.store.cancel(id).await.unwrap();
        next(&|changed| changed.unwanted == [claim.lease]).await;
    }

    async fn equal_jobs_that_come_and_end_at_once_are_lost_nowhere() {
        let place = InDatabase::new().await;
        let other = place.other().await;
        for round in 0..20 {
            let first = place.accept(job(round)).await.id;
            let claim = place.run(first).await;
            let ending = Ending::Succeeded(result(round));
            let late = job(round);
            let id = late.id;
            let (ended, accepted) = tokio::join!(place.store.finish(claim.lease, ending), other.submit(late, 100));
            let (ended, Accepted::New(_)) = (ended.unwrap(), accepted.unwrap()) else { panic!("accepted") };
            let state = place.record(id).await.state;
            // It ended with the other, or it waits by itself: nothing between.
            assert_eq!(state == JobState::Succeeded, ended.contains(&id), "round {round}: {state:?}");
            assert!(matches!(state, JobState::Succeeded | JobState::Queued), "round {round}: {state:?}");
        }
    }

    async fn times_are_those_of_the_database_whatever_this_machine_says() {
        let place = InDatabase::new().await;
        let before = place.store.now_ms();
        for skew_ms in [-600_000, 600_000] {
            place.store.clock.skew(skew_ms);
            place.store.sweep(Arc::new(Vec::new)).await.unwrap();
            assert!((place.store.now_ms() - before).abs() < 60_000, "{}", place.store.now_ms() - before);
            let due = NewJob { useful_for_ms: Some(60_000), ..job(1) };
            let accepted = place.accept(due).await;
            assert!((accepted.created_ms - before).abs() < 60_000);
            assert!(place.store.waits(None).await.unwrap(), "nobody's clock holds a job back");
            let (changed, next) = place.store.expire_deadlines(PROBLEM.to_owned()).await.unwrap();
            assert_eq!(changed, Changed::default());
            assert!(next.is_some_and(|next| (next - before - 60_000).abs() < 60_000));
            let claim = place.run(accepted.id).await;
            assert_eq!(place.store.sweep(Arc::new(Vec::new)).await.unwrap(), [], "nor is a lease shorter for it");
            place.store.finish(claim.lease, Ending::Failed("{}".to_owned())).await.unwrap();
        }
    }

    async fn jobs_of_an_earlier_version_are_taken_over_when_it_has_no_workers() {
        let place = InDatabase::new().await;
        let newer = Use { engine: "0.2.0".to_owned(), ..usage(place.keep) };
        let newer = PostgresStore::open(&secret(&place.name), newer).await.unwrap();
        let old = place.accept(job(1)).await.id;
        let Accepted::New(new) = newer.submit(job(2), 100).await.unwrap() else { panic!("accepted") };
        let next = async |store: &PostgresStore| match take(store).await {
            Next::Run(claim) => {
                store.release(claim.lease).await.unwrap();
                Some(claim.jobs[0])
            }
            Next::Nothing => None,
            other @ Next::Suspect { .. } => panic!("{other:?}"),
        };
        let both = (next(&place.store).await, next(&newer).await);
        assert_eq!(both, (Some(old), Some(new.id)), "each has a line of its own");
        // Nobody works yet: everything stays where it is, whoever looks.
        newer.sweep(Arc::new(Vec::new)).await.unwrap();
        place.store.sweep(Arc::new(Vec::new)).await.unwrap();
        assert_eq!(next(&place.store).await, Some(old));
        let working = async |engine: &str| {
            let usage = Use { engine: engine.to_owned(), works: true, ..usage(place.keep) };
            PostgresStore::open(&secret(&place.name), usage).await.unwrap()
        };
        let old_worker = working("0.1.0").await;
        old_worker.sweep(Arc::new(Vec::new)).await.unwrap();
        assert_eq!(next(&newer).await, Some(new.id), "an old version takes no job of a new one");
        let new_worker = working("0.2.0").await;
        new_worker.sweep(Arc::new(Vec::new)).await.unwrap();
        assert_eq!(next(&place.store).await, Some(old), "its own workers are there");
        place.execute("UPDATE precut.workers SET seen_ms = seen_ms - 60000 WHERE engine = '0.1.0'").await;
        assert_eq!(newer.sweep(Arc::new(Vec::new)).await.unwrap(), [old]);
        assert_eq!(next(&place.store).await, None);
        let Next::Run(claim) = take(&new_worker).await else { panic!("both wait") };
        assert!([old, new.id].contains(&claim.jobs[0]));
    }

    async fn nobody_waits_for_who_is_about_to_take_another_job() {
        let place = InDatabase::new().await;
        let (first, second) = (place.accept(job(1)).await.id, place.accept(job(2)).await.id);
        let mut hold = place.runtime_pool.begin().await.unwrap();
        lock(&mut hold, &key(1)).await.unwrap();
        let Next::Run(claim) = take(&place.store).await else { panic!("the other waits") };
        assert_eq!(claim.jobs, [second]);
        assert!(matches!(take(&place.store).await, Next::Nothing));
        hold.rollback().await.unwrap();
        let Next::Run(claim) = take(&place.store).await else { panic!("it waits") };
        assert_eq!(claim.jobs, [first]);
    }

    async fn jobs_that_waited_in_the_queue_of_earlier_programs_are_lost_nowhere() {
        for is_shared in [false, true] {
            let jobs = [job(1), job(2), job(3)];
            let name = before_one_queue(&jobs, is_shared).await;
            let keep = keep(Duration::from_hours(1));
            let place = InDatabase::open(name, keep, usage(keep)).await;
            assert_eq!(place.line().await, [jobs[0].id, jobs[1].id]);
            // Who ran the third is silent.
            assert_eq!(place.store.sweep(Arc::new(Vec::new)).await.unwrap(), [jobs[2].id]);
            for job in &jobs {
                let Next::Run(claim) = take(&place.store).await else { panic!("it waits") };
                assert_eq!((claim.jobs.as_slice(), &claim.input), (&[job.id][..], &job.input));
            }
            // What others have in the schema of that queue is left to them.
            let schema: bool = sqlx::query_scalar("SELECT to_regnamespace('apalis') IS NOT NULL")
                .fetch_one(&place.runtime_pool)
                .await
                .unwrap();
            assert_eq!(schema, is_shared);
            if is_shared {
                let left: Vec<String> =
                    sqlx::query_scalar("SELECT job_type FROM apalis.jobs UNION ALL SELECT worker_type FROM apalis.workers")
                        .fetch_all(&place.runtime_pool)
                        .await
                        .unwrap();
                assert_eq!(left, ["mail", "mail"]);
            }
        }
    }

    async fn a_newer_schema_is_refused_unless_it_says_that_it_serves_this_program() {
        let place = InDatabase::new().await;
        place.execute("ALTER TABLE precut.jobs ADD COLUMN future text NOT NULL DEFAULT 'later'").await;
        place.execute("INSERT INTO precut.versions VALUES (1000, 1)").await;
        let beside = place.other().await;
        let id = place.accept(job(1)).await.id;
        assert_eq!(beside.job(id).await.unwrap().unwrap().id, id);
        place.execute("INSERT INTO precut.versions VALUES (1001, 1000)").await;
        let Err(refused) = PostgresStore::open(&secret(&place.name), usage(place.keep)).await else { panic!("opened") };
        assert!(refused.to_string().contains("newer precut"), "{refused}");
    }

    async fn a_database_that_cannot_be_used_is_refused_without_a_word_of_its_credentials() {
        let place = InDatabase::new().await;
        let open = async |address: String, start_s: u64| {
            let StoreAddress::Postgres(secret) = address.parse().unwrap() else { panic!("{address}") };
            let patience = Patience { start: Duration::from_secs(start_s), ..AT_ONCE };
            let begun = std::time::Instant::now();
            let outcome = PostgresStore::open(&secret, Use { patience, ..usage(place.keep) }).await;
            let Err(refused) = outcome else { panic!("opened") };
            (refused.to_string(), begun.elapsed())
        };
        // Nobody listens on port 1.
        let (refused, took) = open("postgres://anna:pa55w0rd@127.0.0.1:1/precut".to_owned(), 1).await;
        assert!(refused.contains("does not answer") && took > Duration::from_secs(1), "{refused} {took:?}");
        assert!(!refused.contains("anna") && !refused.contains("pa55w0rd"), "{refused}");
        let there = secret("postgres").reveal().to_owned();
        let host = there.rsplit('@').next().unwrap().split('/').next().unwrap().to_owned();
        let (refused, _) = open(format!("postgres://anna:pa55w0rd@{host}/precut"), 60).await;
        assert!(refused.contains("user name or the password"), "{refused}");
        assert!(!refused.contains("anna") && !refused.contains("pa55w0rd"), "{refused}");
        let (refused, _) = open(there.replace("/postgres?", "/no_such_database?"), 1).await;
        assert!(refused.contains("no database of that name"), "{refused}");
        let read_only = format!("{}&options[default_transaction_read_only]=on", secret(&place.name).reveal());
        let (refused, _) = open(read_only, 60).await;
        assert!(refused.contains("read-only"), "{refused}");
        let (refused, _) = open("postgres://anna:pa55w0rd@host:port/x".to_owned(), 1).await;
        assert!(refused.contains("not understood") && !refused.contains("pa55w0rd"), "{refused}");
    }
}
