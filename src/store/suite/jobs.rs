//! What every store has to do with jobs.

use std::sync::Arc;
use std::time::Duration;

use super::{MOST, PROBLEM, Place, job, key, result};
use crate::store::jobs::{
    Accepted, Beat, Claimed, Ending, Idempotency, JobId, JobState, Lease, NewJob, Next, Priority, Quota, Timing, Usage,
    Wanted,
};
use crate::store::sqlite::Keep;
use crate::store::{KeptResult, now_ms};

pub(in crate::store) async fn a_job_goes_from_the_line_to_its_result<P: Place>() {
    let place = P::new().await;
    let accepted = place.accept(job(1)).await;
    assert_eq!((accepted.state, accepted.attempt), (JobState::Queued, 0));
    assert_eq!(place.line().await, [accepted.id]);
    let claim = place.run(accepted.id).await;
    assert_eq!((claim.jobs.as_slice(), claim.attempt), (&[accepted.id][..], 1));
    assert_eq!(claim.input, "{\"number\":1}");
    assert!(matches!(place.claim(accepted.id).await, Claimed::Nothing), "once taken, it waits no more");
    assert_eq!(place.record(accepted.id).await.state, JobState::Running);
    let ended = place.store().finish(claim.lease, Ending::Succeeded(result(1))).await.unwrap();
    assert_eq!(ended, [accepted.id]);
    let done = place.record(accepted.id).await;
    assert_eq!((done.state, done.lease, done.key), (JobState::Succeeded, None, key(1)));
    assert!(done.expires_ms > done.finished_ms);
    assert_eq!(place.store().get(key(1)).await.unwrap(), Some(result(1)));
}

pub(in crate::store) async fn who_has_lost_the_lease_cannot_write<P: Place>() {
    let place = P::new().await;
    let id = place.accept(job(1)).await.id;
    let first = place.run(id).await;
    // Nobody lives: the job is in line again and taken by somebody else.
    place.silence().await;
    assert_eq!(place.store().sweep(Arc::new(Vec::new)).await.unwrap(), [id]);
    let second = place.run(id).await;
    assert_eq!(second.attempt, 2);
    let other = KeptResult { body: "{\"late\":true}".into(), ..result(1) };
    assert_eq!(place.store().finish(first.lease, Ending::Succeeded(other)).await.unwrap(), []);
    assert_eq!(place.store().get(key(1)).await.unwrap(), None, "nor its result");
    assert_eq!(place.store().release(first.lease).await.unwrap(), []);
    let beat = Beat { lease: first.lease, progress: 0.9, stage: None };
    assert_eq!(place.store().beat(vec![beat]).await.unwrap(), [first.lease], "it is told so");
    let now = place.record(id).await;
    assert_eq!((now.state, now.progress, now.lease), (JobState::Running, 0.0, Some(second.lease)));
    assert_eq!(place.store().finish(second.lease, Ending::Succeeded(result(1))).await.unwrap(), [id]);
    assert_eq!(place.store().finish(second.lease, Ending::Failed("{}".to_owned())).await.unwrap(), [], "nor twice");
    assert_eq!(place.record(id).await.state, JobState::Succeeded);
}

pub(in crate::store) async fn a_live_lease_is_left_alone<P: Place>() {
    let place = P::new().await;
    let id = place.accept(job(1)).await.id;
    let lease = Lease::new();
    let Claimed::Run(_) = place.store().claim(id, lease, MOST, PROBLEM.to_owned()).await.unwrap() else { panic!() };
    place.silence().await;
    assert_eq!(place.store().sweep(Arc::new(move || vec![lease])).await.unwrap(), []);
    assert_eq!(place.record(id).await.state, JobState::Running);
}

pub(in crate::store) async fn what_a_process_left_running_is_in_line_again_at_the_next_start<P: Place>() {
    let mut place = P::new().await;
    let (running, waiting) = (place.accept(job(1)).await.id, place.accept(job(2)).await.id);
    place.run(running).await;
    for attempt in 1..=MOST {
        place = place.again().await;
        let record = place.record(running).await;
        assert_eq!((record.state, record.attempt, record.progress), (JobState::Queued, attempt, 0.0));
        // Twice charged, it lets the others go first.
        let expected = if attempt < 2 { [running, waiting] } else { [waiting, running] };
        assert_eq!(place.line().await, expected, "after {attempt}");
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

pub(in crate::store) async fn a_start_that_was_given_back_is_not_charged<P: Place>() {
    let place = P::new().await;
    let id = place.accept(job(1)).await.id;
    for _ in 0..2 * MOST {
        let claim = place.run(id).await;
        assert_eq!(claim.attempt, 1);
        assert_eq!(place.store().release(claim.lease).await.unwrap(), [id]);
        assert_eq!(place.record(id).await.attempt, 0);
        assert!(place.line().await.contains(&id));
    }
}

pub(in crate::store) async fn equal_jobs_are_taken_together_and_end_together<P: Place>() {
    let place = P::new().await;
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
    let first = place.store().cancel(ids[0]).await.unwrap().unwrap();
    assert_eq!((first.before, first.job.state, first.unwanted), (JobState::Running, JobState::Cancelled, None));
    let ended = place.store().finish(claim.lease, Ending::Succeeded(result(1))).await.unwrap();
    assert_eq!(ended.len(), 3);
    assert_eq!(place.record(ids[0]).await.state, JobState::Cancelled);
    let again = place.accept(job(2)).await.id;
    let claim = place.run(again).await;
    let last = place.store().cancel(again).await.unwrap().unwrap();
    assert_eq!(last.unwanted, Some(claim.lease));
    assert_eq!(place.store().finish(claim.lease, Ending::Succeeded(result(2))).await.unwrap(), []);
    assert_eq!(place.store().get(key(2)).await.unwrap(), None);
}

pub(in crate::store) async fn a_job_whose_result_is_there_ends_where_it_begins<P: Place>() {
    let place = P::new().await;
    let record = place.accept(NewJob { result: Some(result(1)), ..job(1) }).await;
    assert_eq!((record.state, record.progress), (JobState::Succeeded, 1.0));
    assert_eq!(place.line().await, []);
    assert_eq!(place.store().get(key(1)).await.unwrap(), Some(result(1)));
}

pub(in crate::store) async fn a_name_is_one_job_for_its_owner<P: Place>() {
    let place = P::new().await;
    let named = |number: u32, owner: &str, hash: u8| NewJob {
        owner: owner.to_owned(),
        idempotency: Some(Idempotency { key: "n".to_owned(), body_hash: [hash; 32] }),
        ..job(number)
    };
    let first = place.accept(named(1, "one", 1)).await;
    let submit = |job| place.store().submit(job, 100);
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

pub(in crate::store) async fn a_full_queue_takes_no_more<P: Place>() {
    let place = P::new().await;
    for number in 0..3 {
        place.accept(job(number)).await;
    }
    let refused = place.store().submit(job(3), 3).await.unwrap();
    assert_eq!(refused, Accepted::QueueFull { queued: 3 });
    let counts = place.store().counts().await.unwrap();
    assert_eq!((counts.queued, counts.running), (3, 0));
    assert_eq!(place.line().await.len(), 3);
}

pub(in crate::store) async fn the_line_is_fair_between_owners_and_keeps_priorities<P: Place>() {
    let place = P::new().await;
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
    // Each owner's first job stands beside the others' first, and so on; within a turn, who came first.
    let line = place.line().await;
    assert_eq!(line[0], high);
    assert_eq!(*line.last().unwrap(), low);
    let at = |id: JobId| line.iter().position(|other| *other == id).unwrap();
    assert!(at(ids[0]) < at(ids[1]) && at(ids[1]) < at(ids[2]) && at(ids[2]) < at(ids[3]));
    assert!(at(other[0]) < at(ids[1]) && at(other[1]) < at(ids[2]) && at(other[0]) < at(other[1]), "{line:?}");
    // A newcomer begins where the line is now, not before it.
    place.run(ids[0]).await;
    place.run(other[0]).await;
    let third = place.accept(from("four", 40, Priority::Normal)).await.id;
    let line = place.line().await;
    let at = |id: JobId| line.iter().position(|other| *other == id).unwrap();
    assert!(at(third) < at(ids[2]));
}

pub(in crate::store) async fn a_long_job_lets_some_short_ones_pass_and_no_more<P: Place>() {
    let place = P::new().await;
    let long = |number: u32| NewJob { estimate_ms: 3_600_000.0, ..job(number) };
    // One runs all the time. Another one waits, for the other place, and short ones of many clients keep coming.
    let running = place.accept(long(1)).await.id;
    place.run(running).await;
    let waiting = place.accept(long(2)).await.id;
    let mut passed = 0;
    for number in 10..60 {
        let owner = format!("client {number}");
        place.accept(NewJob { owner, ..job(number) }).await;
        let first = place.line().await[0];
        if first == waiting {
            break;
        }
        passed += 1;
        let claim = place.run(first).await;
        place.store().finish(claim.lease, Ending::Succeeded(result(number))).await.unwrap();
    }
    assert!((1..=12).contains(&passed), "{passed} have passed");
    assert_eq!(place.line().await[0], waiting);
}

pub(in crate::store) async fn the_next_short_job_is_the_first_of_them_in_line<P: Place>() {
    let place = P::new().await;
    let lasting = |number: u32, estimate_ms: f64| NewJob { estimate_ms, ..job(number) };
    let next = async || match place.next(Some(5000.0)).await {
        Next::Run(claim) => Some(claim.jobs[0]),
        Next::Nothing => None,
        other @ Next::Suspect { .. } => panic!("{other:?}"),
    };
    let waits = async || place.store().waits(Some(5000.0)).await.unwrap();
    place.accept(lasting(1, 60_000.0)).await;
    assert_eq!((waits().await, next().await), (false, None));
    let first = place.accept(lasting(2, 5000.0)).await.id;
    let second = place.accept(lasting(3, 10.0)).await.id;
    let high = place.accept(NewJob { priority: Priority::High, ..lasting(4, 100.0) }).await.id;
    let mut taken = Vec::new();
    while waits().await {
        taken.extend(next().await);
    }
    // A client's jobs follow one another, the shorter before the longer where both are short enough to differ.
    assert_eq!(taken[0], high);
    taken.sort();
    assert_eq!(taken, [first, second, high]);
    // What has been charged a start waits for a place with the others.
    place.silence().await;
    place.store().sweep(Arc::new(Vec::new)).await.unwrap();
    assert_eq!(place.record(second).await.state, JobState::Queued);
    assert_eq!((waits().await, next().await), (false, None));
}

pub(in crate::store) async fn the_state_of_jobs_and_store_is_told_in_figures<P: Place>() {
    let place = P::new().await;
    let empty = place.store().counts().await.unwrap();
    assert_eq!((empty.queued, empty.running, empty.oldest_ms), (0, 0, None));
    assert!(empty.store_bytes > 10_000, "{empty:?}");
    let from = |owner: &str, number: u32| NewJob { owner: owner.to_owned(), ..job(number) };
    let first = place.accept(from("key:a", 1)).await;
    tokio::time::sleep(Duration::from_millis(2)).await;
    let second = place.accept(from("key:b", 2)).await;
    place.accept(from("ip:127.0.0.1", 3)).await;
    assert_eq!(place.store().counts().await.unwrap().oldest_ms, Some(first.created_ms));
    let claim = place.run(first.id).await;
    assert_eq!((claim.created_ms, claim.owner.as_str()), (first.created_ms, "key:a"));
    let counts = place.store().counts().await.unwrap();
    assert_eq!((counts.queued, counts.running, counts.oldest_ms), (2, 1, Some(second.created_ms)));
    place.store().finish(claim.lease, Ending::Succeeded(result(1))).await.unwrap();
    // Of owners of keys only: addresses are many.
    let mut kept = place.store().kept_by_owner().await.unwrap();
    kept.sort();
    let told: Vec<&str> = kept.iter().map(|(owner, _)| owner.as_str()).collect();
    assert_eq!(told, ["key:a", "key:b"]);
    let alone = place.store().usage("key:a".to_owned()).await.unwrap().kept_bytes();
    assert!(kept[0].1 == alone && kept[0].1 > kept[1].1 && kept[1].1 > 0, "{kept:?}");
}

/// How an owner stands who is refused a job.
async fn refused<P: Place>(place: &P, job: NewJob) -> Usage {
    match place.store().submit(job, 100).await.unwrap() {
        Accepted::OverQuota(usage) => usage,
        other => panic!("{other:?}"),
    }
}

fn ms(time: Duration) -> i64 {
    i64::try_from(time.as_millis()).unwrap()
}

pub(in crate::store) async fn an_owner_gets_so_much_work_in_an_hour<P: Place>() {
    const MOST_MS: f64 = 100_000.0;
    let place = P::new().await;
    let ask = |number: u32, estimate_ms: f64| NewJob {
        estimate_ms,
        quota: Quota { work_ms: Some(MOST_MS), ..Quota::default() },
        ..job(number)
    };
    let first = place.accept(ask(1, 60_000.0)).await.id;
    assert!((refused(&place, ask(2, 60_000.0)).await.open_ms - 60_000.0).abs() < 1e-9);
    assert_eq!(place.store().job(ask(2, 1.0).id).await.unwrap(), None);
    place.accept(NewJob { owner: "two".to_owned(), ..ask(3, 60_000.0) }).await;
    // What is there already costs nothing, and what was not done was not used.
    place.accept(NewJob { result: Some(result(4)), ..ask(4, 60_000.0) }).await;
    place.store().cancel(first).await.unwrap();
    let second = place.accept(ask(5, 60_000.0)).await.id;
    // What is over counts by what it took.
    let claim = place.run(second).await;
    place.store().finish(claim.lease, Ending::Succeeded(result(5))).await.unwrap();
    let took = place.store().usage("one".to_owned()).await.unwrap();
    assert!(took.open_ms == 0.0 && took.work_ms() < 30_000.0, "{took:?}");
    // So does work that was no job; and there is room when it is told that there is.
    let work = |owner: &str, ms: f64| (owner.to_owned(), ms);
    place.store().note_work(vec![work("one", 30_000.0), work("two", 5.0)]).await.unwrap();
    place.store().note_work(vec![work("one", 40_000.0)]).await.unwrap();
    let usage = refused(&place, ask(6, 60_000.0)).await;
    assert!((70_000.0..100_000.0).contains(&usage.work_ms()), "{usage:?}");
    let wait = usage.room_for_work(MOST_MS, 60_000.0);
    assert!(wait > Duration::from_mins(58) && wait <= Duration::from_mins(61), "{wait:?}");
    place.later(ms(wait) - 120_000).await;
    refused(&place, ask(6, 60_000.0)).await;
    place.later(120_000).await;
    place.accept(ask(6, 60_000.0)).await;
    place.store().forget_expired().await.unwrap();
    assert_eq!(place.store().usage("two".to_owned()).await.unwrap().done, []);
}

pub(in crate::store) async fn what_is_kept_for_an_owner_has_a_bound<P: Place>() {
    const MOST: u64 = 50_000;
    let place = P::new().await;
    let mut noise = vec![0_u8; 30_000];
    blake3::Hasher::new().finalize_xof().fill(&mut noise);
    let large = |number: u32| KeptResult { body: noise.clone().into(), ..result(number) };
    let ask = |number: u32, result: Option<KeptResult>| NewJob {
        quota: Quota { kept_bytes: Some(MOST), ..Quota::default() },
        result,
        ..job(number)
    };
    // Equal jobs share a result: it counts once.
    for _ in 0..3 {
        place.accept(ask(1, Some(large(1)))).await;
    }
    let kept = place.store().usage("one".to_owned()).await.unwrap().kept_bytes();
    assert!((30_000..40_000).contains(&kept), "{kept}");
    // So does the result of a job that was computed, and what is asked of one that waits.
    let claim = place.run(place.accept(ask(2, None)).await.id).await;
    place.store().finish(claim.lease, Ending::Succeeded(large(2))).await.unwrap();
    let usage = refused(&place, ask(3, None)).await;
    assert!((60_000..80_000).contains(&usage.kept_bytes()), "{usage:?}");
    place.accept(NewJob { owner: "two".to_owned(), ..ask(3, None) }).await;
    // There is room when it is told that there is.
    let wait = usage.room_to_keep(MOST, Duration::from_hours(1));
    assert!(wait > Duration::from_mins(58) && wait <= Duration::from_hours(1), "{wait:?}");
    place.later(ms(wait) - 60_000).await;
    refused(&place, ask(4, None)).await;
    place.later(60_000).await;
    place.accept(ask(4, None)).await;
}

pub(in crate::store) async fn a_job_that_may_not_begin_fails_and_its_equals_wait_again<P: Place>() {
    let place = P::new().await;
    let of = |owner: &str| NewJob { owner: owner.to_owned(), ..job(1) };
    let [one, again, two] =
        [place.accept(of("one")).await.id, place.accept(of("one")).await.id, place.accept(of("two")).await.id];
    let claim = place.run(one).await;
    let refuse = async || place.store().refuse(claim.lease, "one".to_owned(), PROBLEM.to_owned()).await.unwrap();
    let mut refused = refuse().await;
    refused.sort();
    assert_eq!(refused, [one, again]);
    let record = place.record(one).await;
    assert_eq!((record.state, record.problem.as_deref(), record.attempt), (JobState::Failed, Some(PROBLEM), 0));
    assert!(record.expires_ms > record.finished_ms && record.started_ms.is_none());
    assert_eq!((place.line().await, place.record(two).await.attempt), (vec![two], 0));
    assert_eq!(refuse().await, [], "once");
    assert_eq!(place.line().await, [two]);
}

pub(in crate::store) async fn deadlines_end_what_is_late_and_nothing_else<P: Place>() {
    let place = P::new().await;
    let due = |number: u32, ms: i64| NewJob { useful_for_ms: Some(ms), ..job(number) };
    let late = place.accept(due(1, 0)).await.id;
    let running = place.accept(due(2, 0)).await.id;
    let later = place.accept(due(3, 60_000)).await;
    let (later, due_at) = (later.id, later.created_ms + 60_000);
    assert_eq!(place.record(later).await.deadline_ms, Some(due_at), "it counts from when the job was accepted");
    let claim = place.run(running).await;
    let (changed, next) = place.store().expire_deadlines(PROBLEM.to_owned()).await.unwrap();
    let mut jobs = changed.jobs;
    jobs.sort();
    assert_eq!((jobs, changed.unwanted, next), (vec![late, running], vec![claim.lease], Some(due_at)));
    for id in [late, running] {
        let record = place.record(id).await;
        assert_eq!((record.state, record.problem.as_deref()), (JobState::Failed, Some(PROBLEM)));
    }
    assert_eq!(place.record(later).await.state, JobState::Queued);
    assert_eq!(place.store().finish(claim.lease, Ending::Succeeded(result(2))).await.unwrap(), []);
}

/// How long a job's result lives in the next test: long beside what the test does meanwhile.
const LIFE: Duration = Duration::from_secs(5);

pub(in crate::store) async fn what_a_kept_job_points_to_stays_and_what_is_expired_goes<P: Place>() {
    let place = P::with(Keep { bytes: 1, age: Duration::ZERO, jobs: LIFE }).await;
    let id = place.accept(NewJob { result: Some(result(1)), ..job(1) }).await.id;
    place.store().put(KeptResult { body: vec![b' '; 4000].into(), ..result(2) });
    place.store().list(crate::store::ResultQuery::default()).await.unwrap();
    place.store().put(result(3));
    place.store().list(crate::store::ResultQuery::default()).await.unwrap();
    assert_eq!(place.store().get(key(2)).await.unwrap(), None, "what no job points to is evicted");
    assert_eq!(place.store().get(key(1)).await.unwrap(), Some(result(1)));
    assert_eq!(place.store().forget_expired().await.unwrap(), 0);
    tokio::time::sleep(LIFE + Duration::from_millis(50)).await;
    assert_eq!(place.store().forget_expired().await.unwrap(), 0, "its record is known for as long again");
    assert!(place.record(id).await.expires_ms.unwrap() <= now_ms());
    place.store().put(KeptResult { body: vec![b' '; 4000].into(), ..result(4) });
    place.store().list(crate::store::ResultQuery::default()).await.unwrap();
    assert_eq!(place.store().get(key(1)).await.unwrap(), None);
    tokio::time::sleep(LIFE).await;
    assert_eq!(place.store().forget_expired().await.unwrap(), 1);
    assert_eq!(place.store().job(id).await.unwrap(), None);
}

pub(in crate::store) async fn what_some_jobs_need_is_read_at_once<P: Place>() {
    let place = P::new().await;
    let [first, second] = [place.accept(job(1)).await.id, place.accept(job(2)).await.id];
    let read = place.store().job_inputs(vec![second, JobId::new()], 1000).await.unwrap();
    assert_eq!(read.len(), 1);
    assert_eq!((read[0].0, zstd::decode_all(&*read[0].1).unwrap()), (second, br#"{"number":2}"#.to_vec()));
    assert_eq!(place.store().job_inputs(vec![first, second], 1000).await.unwrap().len(), 2);
    assert_eq!(place.store().job_inputs(vec![first, second], 5).await.unwrap(), [], "larger ones are left out");
}

pub(in crate::store) async fn timings_are_kept_newest_first<P: Place>() {
    let place = P::new().await;
    for ms in [1.0, 2.0, 3.0] {
        let timing = Timing { calculator: "a".to_owned(), version: 1, predicted_ms: 10.0, actual_ms: ms };
        place.store().note_timing(timing).await.unwrap();
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    let timings = place.store().timings(2).await.unwrap();
    assert_eq!(
        timings.iter().map(|timing| timing.actual_ms.to_bits()).collect::<Vec<_>>(),
        [3.0_f64, 2.0].map(f64::to_bits)
    );
}

pub(in crate::store) async fn the_line_is_handed_out_in_order_and_each_job_once<P: Place>() {
    let place = P::new().await;
    assert!(!place.store().waits(None).await.unwrap());
    for number in 0..40 {
        let priority = if number % 4 == 0 { Priority::High } else { Priority::Normal };
        place.accept(NewJob { priority, owner: format!("client {}", number % 3), ..job(number) }).await;
    }
    let line = place.line().await;
    for id in &line[..3] {
        assert!(place.store().waits(None).await.unwrap());
        match place.next(None).await {
            Next::Run(claim) => assert_eq!((claim.jobs.as_slice(), claim.attempt), (&[*id][..], 1)),
            other => panic!("{other:?}"),
        }
    }
    // However many ask at once. Who finds nothing while others are about to take it asks again.
    let place = &place;
    let takers = (0..8).map(|_| async move {
        let mut taken = Vec::new();
        while place.store().waits(None).await.unwrap() {
            match place.next(None).await {
                Next::Run(claim) => taken.extend(claim.jobs),
                Next::Nothing => {}
                other @ Next::Suspect { .. } => panic!("{other:?}"),
            }
        }
        taken
    });
    let mut taken = futures_util::future::join_all(takers).await.concat();
    taken.extend_from_slice(&line[..3]);
    taken.sort();
    let mut all = line;
    all.sort();
    assert_eq!(taken, all);
    assert!(matches!(place.next(None).await, Next::Nothing));
    // The answer may be lost on its way: who asks again has it already, and nothing else.
    let id = place.accept(job(50)).await.id;
    place.accept(job(51)).await;
    let lease = Lease::new();
    for again in [false, true, true] {
        match place.store().take(Wanted { lease, short_ms: None, again }).await.unwrap() {
            Next::Run(claim) => {
                assert_eq!((claim.jobs.as_slice(), claim.attempt, claim.lease), (&[id][..], 1, lease));
                assert_eq!(claim.input, "{\"number\":50}");
            }
            other => panic!("{other:?}"),
        }
    }
}

pub(in crate::store) async fn equal_jobs_are_handed_out_together<P: Place>() {
    let place = P::new().await;
    let mut ids = Vec::new();
    for owner in ["one", "two", "three"] {
        ids.push(place.accept(NewJob { owner: owner.to_owned(), ..job(1) }).await.id);
    }
    let Next::Run(claim) = place.next(None).await else { panic!("they wait") };
    let mut taken = claim.jobs;
    taken.sort();
    assert_eq!(taken, ids);
    assert!(matches!(place.next(None).await, Next::Nothing));
}

pub(in crate::store) async fn what_was_charged_too_often_is_kept_for_who_runs_it_alone<P: Place>() {
    let place = P::new().await;
    let id = place.accept(job(1)).await.id;
    for attempt in 1..MOST {
        let Next::Run(claim) = place.next(None).await else { panic!("it waits") };
        assert_eq!(claim.attempt, attempt);
        place.silence().await;
        assert_eq!(place.store().sweep(Arc::new(Vec::new)).await.unwrap(), [id]);
    }
    // An equal job that comes anew does not make it a harmless one, and nobody else is told of them while they are held.
    let equal = place.accept(NewJob { owner: "two".to_owned(), ..job(1) }).await.id;
    match place.next(None).await {
        Next::Suspect { id: suspect, calculator, is_shard: false } => {
            assert!([id, equal].contains(&suspect));
            assert_eq!(calculator, "a");
        }
        other => panic!("{other:?}"),
    }
    assert!(!place.store().waits(None).await.unwrap());
    assert!(matches!(place.next(None).await, Next::Nothing));
    place.store().hold(id).await.unwrap();
    let other = place.accept(job(2)).await.id;
    let Next::Run(beside) = place.next(None).await else { panic!("others go on") };
    assert_eq!(beside.jobs, [other]);
    for waiting in [id, equal] {
        assert_eq!(place.record(waiting).await.state, JobState::Queued);
    }
    place.store().finish(beside.lease, Ending::Succeeded(result(2))).await.unwrap();
    // Who held it is gone: it is there for others.
    let place = place.again().await;
    assert!(place.store().waits(None).await.unwrap());
    let Next::Suspect { id: suspect, .. } = place.next(None).await else { panic!("it waits") };
    let claim = place.run(suspect).await;
    assert_eq!((claim.jobs.len(), claim.attempt), (2, MOST));
}
