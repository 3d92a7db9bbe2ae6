//! The engine as a whole, with the toy.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::collections::BTreeMap;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use bytes::Bytes;
use futures_util::future::BoxFuture;
use precut_calc::calculator::{Example, Failure, Finding, Message, Unwatched};
use rayon::prelude::*;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::*;
use crate::registry::toy;
use crate::store::sqlite::{Keep, SqliteStore};
use crate::store::{KeptResult, Origin, ResultPage, ResultQuery, StoreError};
use crate::text::{Language, Texts, complete, kept};

mod golden;

const TOY: &str = "toy-bar";
/// Longer than what the tests compute.
const GRACE: Duration = Duration::from_secs(20);

async fn engine_with(change: impl FnOnce(&mut EngineSettings)) -> (Engine, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = EngineSettings { cores: 2, ..EngineSettings::in_folder(folder.path()) };
    change(&mut settings);
    (Engine::open(toy::registry(), settings).await.unwrap(), folder)
}

async fn engine() -> (Engine, TempDir) {
    engine_with(|_| {}).await
}

fn job(change: impl FnOnce(&mut Value)) -> Body {
    let mut job = json!({"length_mm": 500, "segments": [{"diameter_mm": 20}]});
    change(&mut job);
    Body::Json(job.to_string().into())
}

fn mode(mode: &str) -> Body {
    job(|job| job["mode"] = mode.into())
}

fn envelope(stored: &Stored) -> Value {
    serde_json::from_slice(&stored.body).unwrap()
}

#[tokio::test]
async fn the_envelope_has_what_every_answer_has_and_nothing_volatile() {
    let (engine, _folder) = engine().await;
    let body = || {
        job(|job| {
            job["effects"] = json!([{"kind": "elastic", "compliance_um_per_n": 0.5}]);
            job["measurements"] = json!({"csv": "z_mm,deviation_um\n1,2\n"});
        })
    };
    let solved = engine.solve(TOY, body()).await.unwrap();
    let answer = envelope(&solved.stored);
    let fields: Vec<&str> = answer.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(
        fields,
        [
            "calculator",
            "version",
            "engine",
            "key",
            "input",
            "model",
            "effects",
            "result",
            "explanation",
            "warnings",
            "basis"
        ]
    );
    assert_eq!(answer["key"], solved.stored.key.to_string());
    assert_eq!(answer["input"]["measurements"]["rows"], 1);
    assert_eq!(answer["input"]["youngs_modulus_n_per_mm2"], 210_000.0);
    assert_eq!(answer["effects"], json!([{"kind": "elastic", "compliance_um_per_n": 0.5}]));
    assert_eq!(answer["result"]["rows"], 1);
    assert_eq!(
        answer["explanation"],
        json!([{"code": "toy_bends", "text": "The toy gives 83 %.", "values": {"share": 0.83}}])
    );
    assert_eq!(
        answer["warnings"],
        json!([{"pointer": "/length_mm", "code": "toy_is_slender", "detail": "500 mm is above 100 mm", "value": 500.0,
                "limit": 100.0, "unit": "mm"}])
    );
    let alone = solve_now(engine.registry(), TOY, body(), &Given::default(), &Unwatched).unwrap();
    assert_eq!(alone.body, solved.stored.body);
    assert_eq!(alone.key, solved.stored.key);
}

#[tokio::test]
async fn the_same_job_is_computed_once_however_it_is_spelled() {
    let (engine, _folder) = engine().await;
    let first = engine.solve(TOY, job(|_| {})).await.unwrap();
    let again = engine.solve(TOY, job(|_| {})).await.unwrap();
    let spelled = engine.solve(TOY, job(|job| job["stations"] = json!(3.0))).await.unwrap();
    assert_eq!([first.cache, again.cache, spelled.cache], [CacheState::Miss, CacheState::Hit, CacheState::Hit]);
    assert!(Arc::ptr_eq(&first.stored, &again.stored) && Arc::ptr_eq(&first.stored, &spelled.stored));
    assert!(Arc::ptr_eq(&engine.result(&first.stored.key).await.unwrap().unwrap(), &first.stored));
}

#[tokio::test]
async fn answers_outlive_the_engine() {
    let (engine, folder) = engine().await;
    let first = engine.solve(TOY, job(|_| {})).await.unwrap();
    engine.close(GRACE).await;
    assert_eq!(engine.solve(TOY, job(|_| {})).await.unwrap_err(), Error::ShuttingDown);
    assert_eq!(engine.ready().await, Err(Error::ShuttingDown));
    drop(engine);
    let engine = Engine::open(toy::registry(), EngineSettings::in_folder(folder.path())).await.unwrap();
    engine.ready().await.unwrap();
    let again = engine.solve(TOY, job(|_| {})).await.unwrap();
    assert_eq!((again.cache, &again.stored.body), (CacheState::Hit, &first.stored.body));
    assert_eq!(again.stored.figures().unwrap(), first.stored.figures().unwrap());
    assert_eq!(again.stored.tables().unwrap(), first.stored.tables().unwrap());
    assert_eq!(again.stored.program().unwrap(), None);
    assert_eq!(engine.results(ResultQuery::default()).await.unwrap().items.len(), 1);
}

#[tokio::test]
async fn equal_requests_at_the_same_time_share_one_calculation() {
    let (engine, _folder) = engine().await;
    let both = futures_util::future::join(engine.solve(TOY, mode("slow")), engine.solve(TOY, mode("slow"))).await;
    let (a, b) = (both.0.unwrap(), both.1.unwrap());
    assert!(Arc::ptr_eq(&a.stored, &b.stored));
    assert_eq!((a.cache, b.cache), (CacheState::Miss, CacheState::Miss));
}

#[tokio::test]
async fn a_calculation_ends_when_the_last_who_waits_has_gone() {
    let (engine, _folder) = engine_with(|settings| settings.cores = 1).await;
    let spawn = || {
        let engine = engine.clone();
        tokio::spawn(async move { engine.solve(TOY, mode("endless")).await })
    };
    let (first, second) = (spawn(), spawn());
    tokio::time::sleep(Duration::from_millis(50)).await;
    first.abort();
    tokio::time::sleep(Duration::from_millis(50)).await;
    assert!(!second.is_finished(), "the other still waits");
    let begun = Instant::now();
    second.abort();
    // The only core is free again for the next job.
    engine.solve(TOY, job(|_| {})).await.unwrap();
    assert!(begun.elapsed() < Duration::from_secs(30), "cancelled after {:?}", begun.elapsed());
}

#[tokio::test]
async fn a_panic_a_nan_and_an_impossible_job_are_told_apart() {
    let (engine, _folder) = engine().await;
    assert_eq!(engine.solve(TOY, mode("panic")).await.unwrap_err(), Error::Crashed);
    let Error::Calculation(Failure::Internal(reason)) = engine.solve(TOY, mode("not_finite")).await.unwrap_err() else {
        panic!("a NaN is our own fault")
    };
    assert!(reason.contains("/deflections_um/0"), "{reason}");
    let infeasible = engine.solve(TOY, mode("infeasible")).await.unwrap_err();
    let Error::Calculation(Failure::Infeasible(finding)) = &infeasible else { panic!("{infeasible:?}") };
    assert!(Texts::shared().try_finding(Language::En, "fault", finding).is_ok());
    assert_eq!(engine.solve(TOY, mode("infeasible")).await.unwrap_err(), infeasible);
    engine.solve(TOY, job(|_| {})).await.unwrap();
}

#[tokio::test]
async fn a_job_above_the_limit_is_refused_with_the_field_that_drives_it() {
    let (engine, _folder) = engine_with(|settings| settings.cost_limit = Duration::from_secs(10)).await;
    let work = |ms: f64| job(move |job| job["work_ms"] = json!(ms));
    let Error::TooExpensive { cost, limit, .. } = engine.solve(TOY, work(10_001.0)).await.unwrap_err() else {
        panic!("accepted")
    };
    assert_eq!((cost.driver, limit), ("/work_ms", Duration::from_secs(10)));
    let finding = Finding::new("too_expensive", cost.driver).measured(cost.ms, 1e4, "ms");
    Texts::shared().try_finding(Language::En, "fault", &finding).unwrap();
    engine.solve(TOY, work(10_000.0)).await.unwrap();
    // Without an engine, on the command line, the usual limit holds.
    let hour_ms = super::settings::COST_LIMIT.as_secs_f64() * 1e3;
    let refused = solve_now(engine.registry(), TOY, work(1.01 * hour_ms), &Given::default(), &Unwatched).unwrap_err();
    assert!(
        matches!(refused, Error::TooExpensive { limit, .. } if limit == super::settings::COST_LIMIT),
        "{refused:?}"
    );
}

/// A calculation that does not end.
fn endless_on(engine: &Engine, index: usize) -> tokio::task::JoinHandle<Result<Solved, Error>> {
    let engine = engine.clone();
    let body = job(|job| {
        job["mode"] = "endless".into();
        job["length_mm"] = json!(500 + index);
    });
    tokio::spawn(async move { engine.solve(TOY, body).await })
}

#[tokio::test]
async fn who_waits_too_long_for_a_core_is_sent_away() {
    let patience = Duration::from_millis(50);
    let (engine, _folder) = engine_with(|settings| (settings.cores, settings.patience) = (1, patience)).await;
    let running: Vec<_> = (0..2).map(|index| endless_on(&engine, index)).collect();
    tokio::time::sleep(Duration::from_millis(50)).await;
    let begun = Instant::now();
    let refused = endless_on(&engine, 2).await.unwrap().unwrap_err();
    assert!(matches!(refused, Error::Busy { retry_after } if retry_after > Duration::ZERO), "{refused:?}");
    assert!(begun.elapsed() >= patience);
    for task in running {
        task.abort();
    }
}

#[tokio::test]
async fn a_line_waits_for_its_turn_however_long_it_is() {
    let patience = Duration::from_hours(1);
    let (engine, _folder) = engine_with(|settings| (settings.cores, settings.patience) = (1, patience)).await;
    // Two run; of those that stand in line none is turned away before its time, however many they are.
    let held: Vec<_> = (0..20).map(|index| endless_on(&engine, index)).collect();
    tokio::time::sleep(Duration::from_millis(50)).await;
    assert!(held.iter().all(|task| !task.is_finished()));
    for task in held {
        task.abort();
    }
}

#[tokio::test]
async fn closing_waits_for_what_runs_and_cancels_what_runs_too_long() {
    for (name, grace, ends) in [("slow", GRACE, true), ("endless", Duration::ZERO, false)] {
        let (engine, _folder) = engine().await;
        let running = tokio::spawn({
            let engine = engine.clone();
            async move { engine.solve(TOY, mode(name)).await }
        });
        tokio::time::sleep(Duration::from_millis(20)).await;
        engine.close(grace).await;
        match running.await.unwrap() {
            Ok(_) => assert!(ends, "{name}"),
            Err(error) => assert_eq!((error, ends), (Error::Cancelled, false), "{name}"),
        }
    }
}

#[tokio::test]
async fn a_large_body_is_read_like_a_small_one() {
    let (engine, _folder) = engine().await;
    let rows: Vec<Value> = (0..1500).map(|i| json!({"z_mm": i, "deviation_um": 0.5})).collect();
    let large = job(|job| job["measurements"] = rows.into());
    assert!(large.len() > READ_AT_ONCE);
    let solved = engine.solve(TOY, large.clone()).await.unwrap();
    assert_eq!(envelope(&solved.stored)["result"]["rows"], 1500);
    assert_eq!(engine.solve(TOY, large).await.unwrap().cache, CacheState::Hit);
    let broken = Body::Json(format!("{{\"a\": \"{}\"", "x".repeat(READ_AT_ONCE)).into());
    assert!(matches!(engine.solve(TOY, broken).await, Err(Error::Syntax(_))));
}

#[tokio::test]
async fn unknown_names_come_with_the_nearest() {
    let (engine, _folder) = engine().await;
    let error = engine.solve("toy-baar", job(|_| {})).await.unwrap_err();
    assert_eq!(error, Error::UnknownCalculator { name: "toy-baar".to_owned(), nearest: Some(TOY) });
    assert_eq!(
        check_now(&toy::registry(), TOY, job(|_| {}), &Given::default()).unwrap().key,
        engine.solve(TOY, job(|_| {})).await.unwrap().stored.key
    );
}

fn asynchronously() -> Ask {
    Ask { wait: Some(Duration::ZERO), ..Ask::plain("a client") }
}

async fn accepted(engine: &Engine, body: Body) -> JobId {
    match engine.submit(TOY, body, asynchronously()).await.unwrap() {
        Answered::Job(job) => job.record.id,
        Answered::Solved(_) => panic!("answered at once"),
    }
}

async fn over(engine: &Engine, id: JobId) -> Job {
    let record = engine.job(id).await.unwrap().record;
    engine.inner.jobs.wait(record, Duration::from_mins(1)).await.unwrap()
}

#[tokio::test]
async fn a_job_and_a_direct_answer_come_to_the_same_and_share_the_calculation() {
    let (engine, _folder) = engine().await;
    let id = accepted(&engine, mode("slow")).await;
    let direct = engine.solve(TOY, mode("slow")).await.unwrap();
    assert_eq!(over(&engine, id).await.record.state, JobState::Succeeded);
    let of_job = engine.job_result(id).await.unwrap();
    assert_eq!((of_job.key, &of_job.body), (direct.stored.key, &direct.stored.body));
}

#[tokio::test]
async fn a_job_computes_what_a_direct_request_found_no_core_for() {
    let (engine, _folder) = engine_with(|settings| {
        settings.cores = 1;
        settings.patience = Duration::from_millis(300);
    })
    .await;
    // Both slots of the one core are taken by others.
    let inner = &engine.inner;
    let taken = [inner.cores.slot_now().unwrap(), inner.cores.slot_now().unwrap()];
    let direct = tokio::spawn({
        let engine = engine.clone();
        async move { engine.solve(TOY, mode("slow")).await }
    });
    tokio::time::sleep(Duration::from_millis(50)).await;
    let id = accepted(&engine, mode("slow")).await;
    assert!(matches!(direct.await.unwrap(), Err(Error::Busy { .. })));
    let job = over(&engine, id).await;
    assert_eq!((job.record.state, job.problem), (JobState::Succeeded, None));
    drop(taken);
}

#[tokio::test]
async fn the_result_of_a_job_goes_when_its_time_is_over() {
    let life = Duration::from_secs(4);
    let (engine, _folder) = engine_with(|settings| settings.job_age = life).await;
    let id = accepted(&engine, job(|_| {})).await;
    assert_eq!(over(&engine, id).await.record.state, JobState::Succeeded);
    engine.job_result(id).await.unwrap();
    tokio::time::sleep(life).await;
    assert_eq!(engine.job_result(id).await.unwrap_err(), Error::JobExpired);
    assert_eq!(engine.job(id).await.unwrap().record.state, JobState::Succeeded, "that it was is still known");
}

#[tokio::test]
async fn a_damaged_result_of_a_job_is_computed_again() {
    let folder = tempfile::tempdir().unwrap();
    let settings = EngineSettings { cores: 1, ..EngineSettings::in_folder(folder.path()) };
    let engine = Engine::open(toy::registry(), settings.clone()).await.unwrap();
    let id = accepted(&engine, job(|_| {})).await;
    over(&engine, id).await;
    let before = engine.job_result(id).await.unwrap();
    engine.close(GRACE).await;
    drop(engine);
    // A bit falls over in everything that is compressed.
    let file = folder.path().join("precut.db");
    let mut bytes = std::fs::read(&file).unwrap();
    let marks: Vec<usize> = (0..bytes.len() - 4).filter(|&at| bytes[at..at + 4] == [0x28, 0xb5, 0x2f, 0xfd]).collect();
    assert!(marks.len() >= 3, "zstd's mark stands before the job, and the result's job and body");
    for mark in marks {
        bytes[mark + 12] ^= 1;
    }
    std::fs::write(&file, bytes).unwrap();
    let engine = Engine::open(toy::registry(), settings).await.unwrap();
    let outcome = engine.job_result(id).await;
    let again = matches!(outcome, Err(Error::JobNotFinished { state: JobState::Queued, .. }));
    assert!(again, "{outcome:?}");
    let job = over(&engine, id).await;
    // The input of the job is damaged as well: that is said, and nothing wrong is served.
    assert!(job.record.state.is_final());
    match job.record.state {
        JobState::Succeeded => assert_eq!(engine.job_result(id).await.unwrap().body, before.body),
        _ => assert!(job.problem.is_some()),
    }
}

/// A store on a disk that died.
struct BrokenStore;

impl ResultStore for BrokenStore {
    fn get(&self, _key: Key) -> BoxFuture<'_, Result<Option<KeptResult>, StoreError>> {
        Box::pin(async { Err(StoreError::Failed("disk I/O error".to_owned())) })
    }
    fn put(&self, _result: KeptResult) {}
    fn list(&self, _query: ResultQuery) -> BoxFuture<'_, Result<ResultPage, StoreError>> {
        Box::pin(async { Err(StoreError::Failed("disk I/O error".to_owned())) })
    }
    fn uses(&self, _record: String, _owner: Option<String>) -> BoxFuture<'_, Result<u64, StoreError>> {
        Box::pin(async { Err(StoreError::Failed("disk I/O error".to_owned())) })
    }
    fn note_asked(&self, _key: Key, _owner: String) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async { Err(StoreError::Failed("broken".to_owned())) })
    }
    fn origin(&self, _key: Key, _owner: Option<String>) -> BoxFuture<'_, Result<Origin, StoreError>> {
        Box::pin(async { Err(StoreError::Failed("gone".to_owned())) })
    }
    fn has_asked(&self, _key: Key, _owner: String) -> BoxFuture<'_, Result<bool, StoreError>> {
        Box::pin(async { Err(StoreError::Failed("broken".to_owned())) })
    }
    fn inputs(&self, _keys: Vec<Key>, _most: usize) -> BoxFuture<'_, Result<Vec<(Key, Bytes)>, StoreError>> {
        Box::pin(async { Err(StoreError::Failed("disk I/O error".to_owned())) })
    }
    fn ping(&self) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async { Err(StoreError::Failed("disk I/O error".to_owned())) })
    }
    fn close(&self) -> BoxFuture<'_, ()> {
        Box::pin(async {})
    }
}

#[tokio::test]
async fn a_store_that_fails_fails_no_answer() {
    let folder = tempfile::tempdir().unwrap();
    let settings = EngineSettings { cores: 1, ..EngineSettings::in_folder(folder.path()) };
    let keep = Keep { bytes: 1, age: settings.store_age, jobs: settings.job_age };
    let jobs = Arc::new(SqliteStore::open(folder.path(), keep).await.unwrap());
    let engine =
        Engine::with_stores(toy::registry(), settings, (Arc::new(BrokenStore), jobs.clone(), jobs.clone()), jobs)
            .await
            .unwrap();
    let solved = engine.solve(TOY, job(|_| {})).await.unwrap();
    assert_eq!(engine.solve(TOY, job(|_| {})).await.unwrap().cache, CacheState::Hit);
    assert!(engine.result(&solved.stored.key).await.unwrap().is_some());
    let other =
        check_now(&toy::registry(), TOY, job(|job| job["length_mm"] = json!(700)), &Given::default()).unwrap().key;
    assert!(matches!(engine.result(&other).await, Err(Error::Store(StoreError::Failed(_)))));
    assert!(matches!(engine.ready().await, Err(Error::Store(StoreError::Failed(_)))));
}

/// An example of the calculators as it is answered; all are computed once for all tests, side by side, since some take seconds. No thread of
/// the pool may be the first to ask: it would wait for the others.
fn answered(calculator: &str, example: &str) -> Option<&'static Stored> {
    static ALL: OnceLock<BTreeMap<String, Stored>> = OnceLock::new();
    let all = ALL.get_or_init(|| {
        let registry = Registry::standard().unwrap();
        let of_entry = |entry: &'static str, examples: &'static [Example]| examples.iter().map(move |one| (entry, one));
        let examples: Vec<_> =
            registry.entries().iter().flat_map(|entry| of_entry(entry.meta().id, entry.meta().examples)).collect();
        let answered = |(id, example): &(&'static str, &'static Example)| {
            let body = Body::Json(example.job.into());
            let stored = solve_now(&registry, id, body, &Given::default(), &Unwatched);
            (format!("{id}/{}", example.id), stored.unwrap_or_else(|error| panic!("{} of {id}: {error:?}", example.id)))
        };
        examples.par_iter().map(answered).collect()
    });
    all.get(&format!("{calculator}/{example}"))
}

#[test]
fn what_the_calculators_utter_has_a_text_and_their_examples_run() {
    assert!(answered(SHAFT, "paper").is_some());
    for registry in [Registry::standard().unwrap(), toy::registry()] {
        for entry in registry.entries() {
            conforms(&registry, entry);
        }
    }
}

#[test]
fn records_fill_in_fields_that_the_job_has() {
    let registry = Registry::standard().unwrap();
    let faults = |calculator: &str, job: &Value| match check_now(
        &registry,
        calculator,
        Body::Json(job.to_string().into()),
        &Given::default(),
    ) {
        Err(Error::Invalid { findings, .. }) => findings,
        other => panic!("a job with a shaft alone: {other:?}"),
    };
    let beside =
        json!({ "shaft": { "segments": [{ "length_mm": 100, "diameter_mm": 40 }] }, "force": { "kind": "kienzle" } });
    for calculator in ["deflection-compensation", "feed-schedule", "program-compensation", "milling-stability"] {
        let before: Vec<String> = faults(calculator, &beside).into_iter().map(|fault| fault.pointer).collect();
        for kind in
            precut_library::Kind::NAMED.into_iter().filter(|kind| crate::registry::takes_names(calculator, *kind))
        {
            for record in precut_library::built_in::records(kind).iter().step_by(5) {
                let mut job = beside.clone();
                job[kind.name()] = json!(record.name);
                let of_schema = |fault: &Finding| matches!(fault.code, "unknown_field" | "wrong_type" | "out_of_range");
                let new =
                    faults(calculator, &job).into_iter().find(|own| of_schema(own) && !before.contains(&own.pointer));
                assert!(new.is_none(), "{calculator} with {} {}: {new:?}", kind.name(), record.name);
            }
        }
    }
}

/// Names that the job or the library gives (`names`) stay as they are.
fn in_its_language(language: Language, said: &str, names: &str) {
    if language != Language::En {
        let mut english = complete::english_in(said);
        // Products of powers of fields are formulas.
        let is_power = |word: &str| ["^", "^-"].iter().any(|sign| said.contains(&format!("{sign}{word}")));
        english.retain(|word| !names.contains(word) && !is_power(word));
        assert!(english.is_empty(), "{english:?} in {said:?}");
    }
}

fn conforms(registry: &Registry, entry: &Entry) {
    let texts = Texts::shared();
    let meta = entry.meta();
    for language in Language::ALL {
        for code in entry.codes() {
            let worded = Texts::SECTIONS.iter().any(|section| {
                texts.has(language, section, &code) || texts.has(language, section, &format!("{code}.detail"))
            });
            assert!(worded, "{} utters {code}, which has no {} text", meta.id, language.tag());
        }
    }
    let shown: Vec<&str> =
        meta.examples.par_iter().flat_map_iter(|example| example_conforms(registry, entry, example)).collect();
    for id in meta.figures.iter().chain(meta.tables) {
        assert!(shown.contains(id), "{} declares {id}, which no example has", meta.id);
    }
}

/// Returns the names of the figures and tables that its answer has.
fn example_conforms(registry: &Registry, entry: &Entry, example: &Example) -> Vec<&'static str> {
    let (texts, meta) = (Texts::shared(), entry.meta());
    let body = || Body::Json(example.job.into());
    let ready =
        read::read(&registry.entry(meta.id).unwrap().clone(), &body(), &Names::new(registry, names::Found::default()))
            .unwrap_or_else(|error| panic!("{} of {}: {error:?}", example.id, meta.id));
    let input = ready.prepared.input().unwrap();
    assert_eq!(ready.canonical, serde_json_canonicalizer::to_vec(&input).unwrap());
    let names = input.to_string();
    let of_toy;
    let stored = if let Some(stored) = answered(meta.id, example.id) {
        stored
    } else {
        of_toy = compute(&ready, &Unwatched).unwrap();
        &of_toy
    };
    let answer = envelope(stored);
    for message in answer["explanation"].as_array().unwrap().iter().map(|item| kept::message(item).unwrap()) {
        for language in Language::ALL {
            let said = texts.try_word(language, "explanation", message.code, &message.values).unwrap();
            in_its_language(language, &said, &names);
        }
        assert!(meta.codes.contains(message.code), "{} utters the undeclared {}", meta.id, message.code);
    }
    for warning in answer["warnings"].as_array().unwrap().iter().map(|item| kept::finding(item).unwrap()) {
        for language in Language::ALL {
            let said = texts.try_finding(language, "warning", &warning).unwrap();
            in_its_language(language, &said, &names);
        }
        assert!(meta.codes.contains(warning.code), "{} utters the undeclared {}", meta.id, warning.code);
    }
    let figures: Vec<&str> = stored.figures().unwrap().iter().map(|figure| figure.id).collect();
    let declared: Vec<&str> = meta.figures.iter().copied().filter(|id| figures.contains(id)).collect();
    assert_eq!(figures, declared, "{}: declared, in their order", meta.id);
    let tables: Vec<&str> = stored.tables().unwrap().iter().map(|table| table.id).collect();
    let declared: Vec<&str> = meta.tables.iter().copied().filter(|id| tables.contains(id)).collect();
    assert_eq!(tables, declared, "{}: declared, in their order", meta.id);
    let shown = [figures, tables].concat();
    for column in stored.tables().unwrap().iter().flat_map(|table| &table.columns) {
        for language in Language::ALL {
            in_its_language(language, &texts.column(language, &column.name, column.unit), &names);
        }
    }
    let output = jsonschema::draft202012::new(&entry.output_document()).unwrap();
    assert!(output.is_valid(&answer["result"]), "{}: {:?}", meta.id, output.validate(&answer["result"]));
    let again = read::read(
        &registry.entry(meta.id).unwrap().clone(),
        &Body::Json(ready.canonical.clone()),
        &Names::new(registry, names::Found::default()),
    )
    .unwrap();
    assert_eq!(again.key, ready.key, "the filled job of {} has another key", meta.id);
    shown
}

/// A calculator whose jobs may name a model, its first example with more in it, and a model for it.
const SHAFT: &str = "deflection-compensation";

fn shaft(change: impl FnOnce(&mut Value)) -> Value {
    let registry = Registry::standard().unwrap();
    let mut job = serde_json::from_str(registry.entry(SHAFT).unwrap().meta().examples[0].job).unwrap();
    change(&mut job);
    job
}

fn soft_headstock() -> Value {
    json!({"kind": "headstock_compliance", "delta_um_per_n": 0.022})
}

/// Cancels after it was asked so many times.
struct Impatient {
    looks: std::sync::atomic::AtomicUsize,
    most: usize,
    told: std::sync::atomic::AtomicUsize,
}

impl Monitor for Impatient {
    fn cancelled(&self) -> bool {
        self.looks.fetch_add(1, Ordering::Relaxed) >= self.most
    }
    fn progress(&self, _fraction: f64, _stage: Message) {
        self.told.fetch_add(1, Ordering::Relaxed);
    }
}

#[test]
fn a_cancel_is_heard_while_a_job_is_computed_without_its_model() {
    let registry = Registry::standard().unwrap();
    let model = json!({"name": "lathe", "calculator": SHAFT, "effects": [soft_headstock()]});
    let model =
        Given { model: Some(ModelFile::read(&registry, model.to_string().as_bytes()).unwrap()), ..Given::default() };
    let solve = |job: &Value, model: &Given, most: usize| {
        let monitor = Impatient { looks: 0.into(), most, told: 0.into() };
        let outcome = solve_now(&registry, SHAFT, Body::Json(job.to_string().into()), model, &monitor);
        (outcome, monitor.looks.into_inner(), monitor.told.into_inner())
    };
    let own = shaft(|job| job["effects"] = json!([soft_headstock()]));
    let (outcome, looks, told) = solve(&own, &Given::default(), usize::MAX);
    outcome.unwrap();
    let extended = shaft(|job| job["effects"] = json!([]));
    let (outcome, more_looks, as_told) = solve(&extended, &model, usize::MAX);
    outcome.unwrap();
    assert!(more_looks > looks && as_told == told, "{more_looks} of {looks} looks, {as_told} of {told} told");
    assert_eq!(solve(&extended, &model, looks).0.unwrap_err(), Error::Cancelled);
}

#[tokio::test]
async fn a_large_body_that_names_a_model_is_read_when_there_is_a_core() {
    let folder = tempfile::tempdir().unwrap();
    let patience = Duration::from_millis(50);
    let settings = EngineSettings { cores: 1, patience, ..EngineSettings::in_folder(folder.path()) };
    let engine = Engine::open(Registry::standard().unwrap(), settings).await.unwrap();
    let content = ModelContent { calculator: SHAFT.to_owned(), effects: vec![soft_headstock()], provenance: json!({}) };
    engine
        .put_model(&Shelf::default(), "lathe", ModelSource::Exported { content, sha256: None }, (true, String::new()))
        .await
        .unwrap();
    let padded = |text: String| Body::Json((text + &" ".repeat(READ_AT_ONCE)).into());
    let job = |name: &str| shaft(|job| job["model"] = name.into()).to_string();
    let solved = engine.solve(SHAFT, padded(job("lathe"))).await.unwrap();
    assert_eq!(envelope(&solved.stored)["model"]["name"], "lathe");
    let small = engine.solve(SHAFT, Body::Json(job("lathe").into())).await.unwrap();
    assert_eq!((small.cache, small.stored.key), (CacheState::Hit, solved.stored.key));
    let Error::Invalid { findings, .. } = engine.solve(SHAFT, padded(job("lathes"))).await.unwrap_err() else {
        panic!("a model that is not there")
    };
    assert_eq!((findings[0].code, findings[0].values.get("nearest")), ("unknown_model", Some(&"lathe".into())));
    let broken = || padded(job("lathe") + "}");
    assert!(matches!(engine.solve(SHAFT, broken()).await, Err(Error::Syntax(_))));
    let inner = &engine.inner;
    let _taken = [inner.cores.slot_now().unwrap(), inner.cores.slot_now().unwrap()];
    let busy = engine.solve(SHAFT, broken()).await;
    assert!(matches!(busy, Err(Error::Busy { .. })), "{busy:?}");
}
