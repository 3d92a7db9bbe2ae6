//! From the line of jobs to a finished one.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

use futures_util::future::BoxFuture;
use precut_calc::calculator::Failure;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinSet;
use tracing::Instrument;

use super::running::{Begun, Running};
use super::work::Work;
use super::{Jobs, MOST_ATTEMPTS, fault};
use crate::engine::exec::Slot;
use crate::engine::quota::worked;
use crate::engine::{Error, Inner};
use crate::store::StoreError;
use crate::store::jobs::{Claim, Claimed, Ending, JobId, Next, Wanted};
use crate::trace::{self, TraceContext};

/// How often there is a look at the line, and a word of what is held, where nobody tells of anything.
const LOOK: Duration = Duration::from_secs(1);
/// Pause where something waits that others are about to take.
const PAUSE: Duration = Duration::from_millis(10);

/// Takes jobs for all places until the service stops; returns when the last of them has ended.
pub(super) async fn run(engine: Weak<Inner>) {
    let mut running = JoinSet::new();
    let mut places = None;
    // After one job there may be another: that is found out by taking it.
    let mut may_wait = false;
    // Weak: who works for an engine does not keep it alive.
    while let Some(engine) = engine.upgrade().filter(|engine| !engine.jobs.is_stopped()) {
        while running.try_join_next().is_some() {}
        // The end of a job is on record before the next begins in its place.
        let places = places.get_or_insert_with(|| Arc::new(Semaphore::new(engine.cores.job_places())));
        let place = tokio::select! {
            Ok(place) = Arc::clone(places).acquire_owned() => place,
            () = engine.jobs.stopped() => break,
        };
        let mut came = engine.jobs.came();
        if !may_wait && !waits(&engine, None).await {
            idle(&engine.jobs, &mut came).await;
            continue;
        }
        // Only with something to do: whoever runs alone waits until no place is taken.
        let slot = tokio::select! {
            Ok(slot) = engine.cores.job_slot(false) => slot,
            () = engine.jobs.stopped() => break,
        };
        let next = next(&engine, slot, Some(place), None).await;
        may_wait = next.is_some();
        match next {
            Some(work) => drop(running.spawn(work)),
            None => tokio::time::sleep(PAUSE).await,
        }
    }
    while running.join_next().await.is_some() {}
}

/// Waits until somebody tells of something to do, but not for long.
pub(super) async fn idle(jobs: &Jobs, came: &mut watch::Receiver<()>) {
    tokio::select! {
        // The sender lives as long as the jobs do.
        _ = came.changed() => {}
        () = tokio::time::sleep(LOOK) => {}
        () = jobs.stopped() => {}
    }
}

/// Whether there is something to do, as far as that can be said.
pub(super) async fn waits(engine: &Inner, short_ms: Option<f64>) -> bool {
    engine.jobs.store.waits(short_ms).await.unwrap_or_else(|error| {
        metrics::counter!("precut_store_failures_total", "operation" => "queue").increment(1);
        tracing::warn!(%error, "no job can be taken at the moment");
        false
    })
}

/// Takes what is to be done next; what does it, in that place.
pub(super) async fn next(
    engine: &Arc<Inner>,
    slot: Slot,
    place: Option<OwnedSemaphorePermit>,
    short_ms: Option<f64>,
) -> Option<BoxFuture<'static, ()>> {
    let begun = engine.jobs.computations.begin();
    let asked = AtomicBool::new(false);
    let take = || {
        let again = asked.swap(true, Ordering::Relaxed);
        engine.jobs.store.take(Wanted { lease: begun.running.lease(), short_ms, again })
    };
    let next = stubbornly(engine, take).await?;
    let engine = Arc::clone(engine);
    match next {
        Next::Run(claim) => {
            begun.running.take_place(place);
            Some(Box::pin(begin(engine, begun, claim, slot)))
        }
        Next::Suspect { id, calculator, is_shard } => {
            // A study has no process of its own; the points of a shard have.
            let is_whole = engine.known(&calculator).is_ok_and(|entry| !entry.is_composed());
            let is_isolated = engine.settings.isolation.is_some() && (is_shard || is_whole);
            Some(Box::pin(run_alone(engine, id, place, is_isolated)))
        }
        Next::Nothing => None,
    }
}

/// Runs a job with nothing beside it: a start that takes the process along is charged to all that run, and before a job is
/// given up as the one to blame, it is tried alone.
async fn run_alone(engine: Arc<Inner>, id: JobId, place: Option<OwnedSemaphorePermit>, is_isolated: bool) {
    let jobs = &engine.jobs;
    let waiting = engine.cores.job_slot(true);
    tokio::pin!(waiting);
    let slot = loop {
        tokio::select! {
            Ok(slot) = &mut waiting => break slot,
            () = tokio::time::sleep(LOOK) => {
                if let Err(error) = jobs.store.hold(id).await {
                    tracing::debug!(job = %id, %error, "a job is not kept from others");
                }
            }
            () = jobs.stopped() => return,
        }
    };
    // In a process of its own it may be tried as often as somebody kills this one.
    let most = if is_isolated { u32::MAX } else { MOST_ATTEMPTS };
    let begun = jobs.computations.begin();
    begun.running.take_place(place);
    let poison = fault::written(&Error::CrashedRepeatedly { attempts: MOST_ATTEMPTS });
    let claim = || jobs.store.claim(id, begun.running.lease(), most, poison.clone());
    match stubbornly(&engine, claim).await {
        Some(Claimed::Run(claim)) => begin(Arc::clone(&engine), begun, claim, slot).await,
        Some(Claimed::Poisonous(failed)) => {
            for id in &failed {
                tracing::error!(job = %id, attempts = MOST_ATTEMPTS, "a job ended its process at every attempt");
            }
            metrics::counter!("precut_jobs_poisonous_total").increment(failed.len() as u64);
            jobs.feeds.touch(&failed);
        }
        Some(Claimed::Nothing) | None => {}
    }
}

/// Runs what was claimed, if its owner may have it. Returns when its record says how it ended, or that it waits again.
async fn begin(engine: Arc<Inner>, begun: Begun, claim: Box<Claim>, slot: Slot) {
    let jobs = &engine.jobs;
    begun.running.claimed();
    if claim.shard.is_some() {
        return run_claimed(&engine, &claim, &begun.running, slot).await;
    }
    if let Err(error @ Error::KeptQuota { .. }) = engine.may_begin(&claim.owner).await {
        return refuse(&engine, &claim, &error).await;
    }
    let waited = Duration::from_millis(jobs.store.now_ms().saturating_sub(claim.created_ms).max(0).unsigned_abs());
    metrics::histogram!("precut_job_wait_seconds", "calculator" => claim.calculator.clone())
        .record(waited.as_secs_f64());
    jobs.feeds.touch(&claim.jobs);
    let span =
        tracing::info_span!("job", id = %claim.jobs[0], calculator = claim.calculator, trace = tracing::field::Empty);
    if let Some(place) = TraceContext::of_record(claim.traceparent.as_deref(), claim.tracestate.as_deref()) {
        span.record("trace", tracing::field::display(place.trace()));
        trace::follow(&span, &place);
    }
    run_claimed(&engine, &claim, &begun.running, slot).instrument(span).await;
}

/// Does not begin an owner's jobs; equal ones of others wait again.
async fn refuse(engine: &Arc<Inner>, claim: &Claim, error: &Error) {
    let jobs = &engine.jobs;
    let problem = fault::written(error);
    let refuse = || jobs.store.refuse(claim.lease, claim.owner.clone(), problem.clone());
    let Some(refused) = stubbornly(engine, refuse).await else { return };
    metrics::counter!("precut_jobs_total", "calculator" => claim.calculator.clone(), "outcome" => "refused")
        .increment(refused.len() as u64);
    tracing::info!(job = %claim.jobs[0], %error, "a job is not begun");
    jobs.feeds.touch(&claim.jobs);
    jobs.ended.notify_one();
    jobs.call();
}

/// Runs what was claimed in its place.
async fn run_claimed(engine: &Arc<Inner>, claim: &Claim, running: &Arc<Running>, slot: Slot) {
    let jobs = &engine.jobs;
    if claim.shard.is_none() {
        tracing::info!(job = %claim.jobs[0], calculator = claim.calculator, attempt = claim.attempt, "a job begins");
    }
    let started = Instant::now();
    let outcome = match Work::of(engine, claim) {
        Ok(work) => {
            let working = work.run(engine, running, slot);
            tokio::select! {
                outcome = working => outcome,
                () = jobs.stopped() => Err(Error::ShuttingDown),
            }
        }
        Err(error) => Err(error),
    };
    let (took, unwanted) = (started.elapsed(), running.is_cancelled());
    if claim.shard.is_none() {
        worked(&claim.owner, took.as_secs_f64() * 1e3);
        count(claim, &outcome, took, unwanted);
    }
    settle(engine, claim, outcome, unwanted).await;
}

/// Counts how a job ended; one that waits again has not.
fn count(claim: &Claim, outcome: &Result<Ending, Error>, took: Duration, unwanted: bool) {
    let label = match outcome {
        Ok(_) => "succeeded",
        Err(Error::Cancelled) if unwanted => "cancelled",
        Err(error) if waits_again(error) => return,
        Err(error) => {
            if let Error::CrashedRepeatedly { attempts } = error {
                tracing::error!(job = %claim.jobs[0], attempts, "a job ended its process, the last time one of its own");
                metrics::counter!("precut_jobs_poisonous_total").increment(claim.jobs.len() as u64);
            }
            "failed"
        }
    };
    metrics::counter!("precut_jobs_total", "calculator" => claim.calculator.clone(), "outcome" => label).increment(1);
    if label != "cancelled" {
        metrics::histogram!("precut_job_seconds", "calculator" => claim.calculator.clone()).record(took.as_secs_f64());
    }
    let ms = took.as_secs_f64() * 1e3;
    tracing::info!(job = %claim.jobs[0], ms, outcome = label, "a job ends");
}

/// The service stops: the job waits for the next one, and its start does not count.
fn waits_again(error: &Error) -> bool {
    matches!(error, Error::Cancelled | Error::ShuttingDown | Error::Calculation(Failure::Cancelled))
}

/// Writes how a computation ended.
async fn settle(engine: &Arc<Inner>, claim: &Claim, outcome: Result<Ending, Error>, unwanted: bool) {
    let jobs = &engine.jobs;
    let ending = match outcome {
        Ok(ending) => ending,
        // Its jobs ended before it did.
        Err(Error::Cancelled) if unwanted => return,
        Err(error) if waits_again(&error) => {
            match jobs.store.release(claim.lease).await {
                Ok(back) => {
                    jobs.feeds.touch(&back);
                    jobs.call();
                }
                Err(error) => tracing::warn!(%error, "a job could not be put back; it is taken up at the next start"),
            }
            return;
        }
        Err(error) => Ending::Failed(fault::written(&error)),
    };
    if let Some(ended) = stubbornly(engine, || jobs.store.finish(claim.lease, ending.clone())).await {
        jobs.feeds.touch(&ended);
        if claim.shard.is_none() {
            jobs.ended.notify_one();
        }
    }
}

/// Tries until the store answers or the service stops: a place must not be left while its job is open.
pub(super) async fn stubbornly<T, F>(engine: &Arc<Inner>, attempt: impl Fn() -> F) -> Option<T>
where
    F: Future<Output = Result<T, StoreError>>,
{
    let mut count = 0;
    loop {
        match attempt().await {
            Ok(value) => return Some(value),
            Err(error) => {
                metrics::counter!("precut_store_failures_total", "operation" => "job").increment(1);
                tracing::warn!(%error, "the store does not take word of a job; trying again");
            }
        }
        tokio::select! {
            () = tokio::time::sleep(fault::pause(count)) => count += 1,
            () = engine.jobs.stopped() => return None,
        }
    }
}
