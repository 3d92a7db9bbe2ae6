//! From a task of the queue to a finished job.

use std::sync::Arc;
use std::time::{Duration, Instant};

use precut_calc::calculator::Failure;
use tracing::Instrument;

use super::running::Running;
use super::{MOST_ATTEMPTS, fault, help, work};
use crate::engine::exec::Slot;
use crate::engine::quota::worked;
use crate::engine::{Error, Inner, Stored};
use crate::store::StoreError;
use crate::store::jobs::{Claim, Claimed, Ending, JobId, Waiting};
use crate::trace::{self, TraceContext};

/// Runs a job, if it still waits: in a place of those for short ones, if it was given one. Returns when its record says how
/// it ended, or that it waits again.
pub(super) async fn run_task(engine: Arc<Inner>, id: JobId, place: Option<Slot>) {
    let jobs = &engine.jobs;
    let Waiting { charged, calculator, owner, created_ms, traceparent, tracestate } =
        match stubbornly(&engine, || jobs.store.waiting(id)).await {
            Some(Some(waiting)) => waiting,
            Some(None) if place.is_some() => return,
            // Nobody waits for it to begin; perhaps somebody has asked for help with it.
            Some(None) => return help::run(&engine, id).await,
            None => return,
        };
    // A start that takes the process along is charged to all that ran beside it. Before a job is given up as the one
    // to blame, it is tried alone.
    let alone = charged + 1 >= MOST_ATTEMPTS;
    // In a process of its own it may be tried as often as somebody kills this one.
    let is_isolated =
        engine.settings.isolation.is_some() && engine.known(&calculator).is_ok_and(|entry| !entry.is_composed());
    let most = if is_isolated { u32::MAX } else { MOST_ATTEMPTS };
    let slot = if let Some(place) = place.filter(|_| !alone) {
        place
    } else {
        tokio::select! {
            Ok(slot) = engine.cores.job_slot(alone) => slot,
            () = jobs.stopped() => return,
        }
    };
    if let Err(error @ Error::KeptQuota { .. }) = engine.may_begin(&owner).await {
        let problem = fault::written(&error);
        if stubbornly(&engine, || jobs.store.refuse(id, problem.clone())).await == Some(true) {
            metrics::counter!("precut_jobs_total", "calculator" => calculator, "outcome" => "refused").increment(1);
            tracing::info!(job = %id, %error, "a job is not begun");
            jobs.feeds.touch(&[id]);
        }
        return;
    }
    let begun = jobs.computations.begin();
    let running = Arc::clone(&begun.running);
    let poison = fault::written(&Error::CrashedRepeatedly { attempts: MOST_ATTEMPTS });
    let claim = || jobs.store.claim(id, running.lease(), most, poison.clone());
    let claim = match stubbornly(&engine, claim).await {
        Some(Claimed::Run(claim)) => claim,
        Some(Claimed::Poisonous(failed)) => {
            for id in &failed {
                tracing::error!(job = %id, attempts = MOST_ATTEMPTS, "a job ended its process at every attempt");
            }
            metrics::counter!("precut_jobs_poisonous_total").increment(failed.len() as u64);
            return jobs.feeds.touch(&failed);
        }
        Some(Claimed::Nothing) | None => return,
    };
    running.claimed();
    let waited = Duration::from_millis(jobs.store.now_ms().saturating_sub(created_ms).max(0).unsigned_abs());
    metrics::histogram!("precut_job_wait_seconds", "calculator" => calculator).record(waited.as_secs_f64());
    jobs.feeds.touch(&claim.jobs);
    let span = tracing::info_span!("job", id = %id, calculator = claim.calculator, trace = tracing::field::Empty);
    if let Some(place) = TraceContext::of_record(traceparent.as_deref(), tracestate.as_deref()) {
        span.record("trace", tracing::field::display(place.trace()));
        trace::follow(&span, &place);
    }
    run_claimed(&engine, &claim, (&running, slot, &owner)).instrument(span).await;
}

/// Runs what was claimed in its place, for its owner.
async fn run_claimed(engine: &Arc<Inner>, claim: &Claim, (running, slot, owner): (&Arc<Running>, Slot, &str)) {
    let jobs = &engine.jobs;
    tracing::info!(job = %claim.jobs[0], calculator = claim.calculator, attempt = claim.attempt, "a job begins");
    let started = Instant::now();
    let outcome = match work::of(engine, claim) {
        Ok(work) => {
            let working = work.run(Arc::clone(engine), Arc::clone(running), slot);
            tokio::select! {
                outcome = working => outcome,
                () = jobs.stopped() => Err(Error::ShuttingDown),
            }
        }
        Err(error) => Err(error),
    };
    worked(owner, started.elapsed().as_secs_f64() * 1e3);
    settle(engine, claim, outcome, started.elapsed(), running.is_cancelled()).await;
}

/// Writes how a computation ended.
async fn settle(
    engine: &Arc<Inner>,
    claim: &Claim,
    outcome: Result<Arc<Stored>, Error>,
    took: Duration,
    unwanted: bool,
) {
    let jobs = &engine.jobs;
    let ms = took.as_secs_f64() * 1e3;
    let (ending, label) = match outcome {
        Ok(stored) => (Ending::Succeeded(stored.kept()), "succeeded"),
        // Its jobs ended before it did.
        Err(Error::Cancelled) if unwanted => {
            metrics::counter!("precut_jobs_total", "calculator" => claim.calculator.clone(), "outcome" => "cancelled")
                .increment(1);
            tracing::info!(job = %claim.jobs[0], ms, "a job was given up: nobody wants it any more");
            return;
        }
        // The service stops: the job waits for the next one, and this start does not count.
        Err(Error::Cancelled | Error::ShuttingDown | Error::Calculation(Failure::Cancelled)) => {
            match jobs.store.release(claim.lease).await {
                Ok(back) => jobs.feeds.touch(&back),
                Err(error) => tracing::warn!(%error, "a job could not be put back; it is taken up at the next start"),
            }
            return;
        }
        Err(error) => {
            if let Error::CrashedRepeatedly { attempts } = error {
                tracing::error!(job = %claim.jobs[0], attempts, "a job ended its process, the last time one of its own");
                metrics::counter!("precut_jobs_poisonous_total").increment(claim.jobs.len() as u64);
            }
            (Ending::Failed(fault::written(&error)), "failed")
        }
    };
    metrics::counter!("precut_jobs_total", "calculator" => claim.calculator.clone(), "outcome" => label).increment(1);
    metrics::histogram!("precut_job_seconds", "calculator" => claim.calculator.clone()).record(took.as_secs_f64());
    if let Some(ended) = stubbornly(engine, || jobs.store.finish(claim.lease, ending.clone())).await {
        tracing::info!(job = %claim.jobs[0], ms, outcome = label, "a job ends");
        jobs.feeds.touch(&ended);
        jobs.ended.notify_one();
    }
}

/// Tries until the store answers or the service stops: a task must not end while its job is open.
async fn stubbornly<T, F>(engine: &Arc<Inner>, attempt: impl Fn() -> F) -> Option<T>
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
