//! What every store has to do with callbacks.

use super::{PROBLEM, Place, job, result};
use crate::store::Store;
use crate::store::callbacks::{CallbackState, DueCallback, NewCallback, Subject, TakeUp, Tried};
use crate::store::jobs::{Ending, JobId, NewJob};

fn told(number: u32, host: &str) -> NewJob {
    let callback = NewCallback { url: format!("https://{host}/{number}"), host: host.to_owned() };
    let (parent, state) = (format!("place {number}"), format!("state {number}"));
    NewJob { callback: Some(callback), traceparent: Some(parent), tracestate: Some(state), ..job(number) }
}

fn all() -> TakeUp {
    TakeUp { most: 100, most_of_one: 100, not_of: Vec::new(), hold_ms: 60_000 }
}

async fn due(store: &dyn Store, wanted: TakeUp) -> Vec<DueCallback> {
    let mut due = store.take_up_callbacks(wanted).await.unwrap();
    due.sort_by(|a, b| a.subject.cmp(&b.subject));
    due
}

fn job_of(due: &DueCallback) -> JobId {
    let Subject::Job(job) = due.subject else { panic!("no job: {due:?}") };
    job
}

fn jobs(due: &[DueCallback]) -> Vec<JobId> {
    due.iter().map(job_of).collect()
}

pub(in crate::store) async fn a_callback_is_due_when_its_job_is_over_however_it_ends<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    let mut ids = Vec::new();
    for number in 0..5 {
        let record = place.accept(told(number, "mes:443")).await;
        let callback = record.callback.unwrap();
        assert_eq!((callback.state, callback.attempts, callback.next_ms), (CallbackState::Waiting, 0, None));
        let (parent, state) = (record.traceparent.unwrap(), record.tracestate.unwrap());
        assert_eq!((parent, state), (format!("place {number}"), format!("state {number}")));
        ids.push(record.id);
    }
    // Nobody asked for it.
    let silent = place.accept(job(6)).await;
    assert_eq!((silent.callback, silent.traceparent, silent.tracestate), (None, None, None));
    assert_eq!(due(store, all()).await, []);
    let claim = place.run(ids[0]).await;
    assert_eq!((claim.traceparent.as_deref(), claim.tracestate.as_deref()), (Some("place 0"), Some("state 0")));
    assert_eq!(due(store, all()).await, [], "it has only begun");
    store.finish(claim.lease, Ending::Succeeded(result(0))).await.unwrap();
    let claim = place.run(ids[1]).await;
    store.finish(claim.lease, Ending::Failed(PROBLEM.to_owned())).await.unwrap();
    store.cancel(ids[2]).await.unwrap();
    let claim = place.run(ids[3]).await;
    store.refuse(claim.lease, claim.owner, PROBLEM.to_owned()).await.unwrap();
    store.cancel(silent.id).await.unwrap();
    // One whose result is there is over where it begins.
    let there = place.accept(NewJob { result: Some(result(0)), ..told(0, "mes:443") }).await;
    assert_eq!(there.callback.unwrap().state, CallbackState::Pending);
    assert_eq!(store.counts().await.unwrap().callbacks, 5);
    let taken = due(store, all()).await;
    assert_eq!(jobs(&taken), [ids[0], ids[1], ids[2], ids[3], there.id]);
    assert_eq!((taken[0].url.as_str(), taken[0].host.as_str(), taken[0].attempt), ("https://mes:443/0", "mes:443", 1));
    let late = NewJob { useful_for_ms: Some(0), ..told(7, "mes:443") };
    let late = place.accept(late).await.id;
    store.expire_deadlines(PROBLEM.to_owned()).await.unwrap();
    assert_eq!(jobs(&due(store, all()).await), [late]);
}

pub(in crate::store) async fn a_callback_is_one_process_at_a_time_and_over_once_it_is_settled<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    let id = place.accept(NewJob { result: Some(result(1)), ..told(1, "mes:443") }).await.id;
    let first = due(store, all()).await.remove(0);
    assert_eq!(due(store, all()).await, [], "somebody tries it");
    let again = Tried::Again { after_ms: 0, fault: "http_503".to_owned() };
    assert!(store.settle_callback(first.clone(), again).await.unwrap());
    let callback = place.record(id).await.callback.unwrap();
    assert_eq!(
        (callback.state, callback.attempts, callback.fault.as_deref()),
        (CallbackState::Pending, 1, Some("http_503"))
    );
    let second = due(store, all()).await.remove(0);
    assert_eq!(second.attempt, 2);
    // Who held it before cannot say any more what came of it.
    assert!(!store.settle_callback(first, Tried::Delivered).await.unwrap());
    assert!(store.settle_callback(second.clone(), Tried::Delivered).await.unwrap());
    let callback = place.record(id).await.callback.unwrap();
    assert_eq!((callback.state, callback.attempts, callback.fault), (CallbackState::Delivered, 2, None));
    assert!(callback.settled_ms.is_some() && callback.next_ms.is_none());
    assert!(!store.settle_callback(second, Tried::Delivered).await.unwrap());
    // Its result is computed again: whoever was told is not told again.
    store.redo(id).await.unwrap();
    let claim = place.run(id).await;
    store.finish(claim.lease, Ending::Succeeded(result(1))).await.unwrap();
    assert_eq!(due(store, all()).await, []);
    // One that waits for its pause is not due; one that is given up never is.
    let other = place.accept(NewJob { result: Some(result(2)), ..told(2, "mes:443") }).await.id;
    let tried = due(store, all()).await.remove(0);
    let again = Tried::Again { after_ms: 3_600_000, fault: "no_answer".to_owned() };
    assert!(store.settle_callback(tried, again).await.unwrap());
    assert_eq!(due(store, all()).await, []);
    let callback = place.record(other).await.callback.unwrap();
    assert!(callback.next_ms.unwrap() > store.now_ms() + 3_000_000);
    let third = place.accept(NewJob { result: Some(result(3)), ..told(3, "mes:443") }).await.id;
    let tried = due(store, all()).await.remove(0);
    assert!(store.settle_callback(tried, Tried::GivenUp { fault: "http_410".to_owned() }).await.unwrap());
    let callback = place.record(third).await.callback.unwrap();
    assert_eq!((callback.state, callback.fault.as_deref()), (CallbackState::GivenUp, Some("http_410")));
    assert_eq!(store.counts().await.unwrap().callbacks, 1);
}

pub(in crate::store) async fn who_has_died_loses_a_callback_and_nobody_takes_all_places<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    for (number, host) in [(1, "a:443"), (2, "a:443"), (3, "a:443"), (4, "b:443"), (5, "b:443")] {
        place.accept(NewJob { result: Some(result(number)), ..told(number, host) }).await;
    }
    let some = TakeUp { most: 3, most_of_one: 2, ..all() };
    let taken = due(store, some).await;
    assert_eq!(taken.iter().filter(|due| due.host == "a:443").count(), 2, "{taken:?}");
    assert_eq!(taken.len(), 3);
    let others = due(store, TakeUp { not_of: vec!["a:443".to_owned()], hold_ms: 0, ..all() }).await;
    assert_eq!(others.iter().map(|due| due.host.as_str()).collect::<Vec<_>>(), ["b:443"]);
    // Who took that one up has been silent for longer than he said.
    assert_eq!(jobs(&due(store, TakeUp { not_of: vec!["a:443".to_owned()], ..all() }).await), jobs(&others));
    // Of two that come at the same time each has his own.
    for number in 10..40 {
        place.accept(NewJob { result: Some(result(number)), ..told(number, "c:443") }).await;
    }
    let both =
        futures_util::future::join_all((0..4).map(|_| store.take_up_callbacks(TakeUp { most: 10, ..all() }))).await;
    let mut all_taken: Vec<JobId> = both.into_iter().flat_map(|taken| jobs(&taken.unwrap())).collect();
    let count = all_taken.len();
    all_taken.sort_unstable();
    all_taken.dedup();
    assert_eq!(all_taken.len(), count, "none is taken twice");
}
