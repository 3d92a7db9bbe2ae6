//! What has to be looked after from time to time: progress on record, deadlines, what nobody runs, what is to be forgotten.

use std::collections::HashSet;
use std::sync::{Arc, Weak};
use std::time::Duration;

use tokio::time::Instant;

use super::fault;
use crate::engine::quota::label;
use crate::engine::{Error, Inner};

/// How often progress is written.
const BEAT: Duration = Duration::from_secs(1);
/// At the end, how often there is a look whether anything is still computed.
const LOOK: Duration = Duration::from_millis(20);
/// Beats between two looks for jobs that nobody runs. Where processes share a store every beat: one of them may have died.
const SWEEP: u64 = 5;
/// Beats between two counts.
const COUNT: u64 = 5;
/// Beats between two rounds of forgetting.
const FORGET: u64 = 60;
/// A deadline is looked for at least so often, whatever the clock does meanwhile.
const LONGEST_SLEEP: Duration = Duration::from_mins(1);
/// The same where another process may have accepted the job and died since.
const LONGEST_SLEEP_SHARED: Duration = Duration::from_secs(5);

pub(super) async fn run(engine: Weak<Inner>) {
    let beating = tokio::spawn(keep_beating(Weak::clone(&engine)));
    look_after(engine).await;
    let _ = beating.await;
}

/// Says of what is computed here that it lives, until the last of it is back in line. A task of its own: a lease lasts
/// for a few beats, and the rest may wait for longer than that, for a lock that somebody holds who was stopped.
async fn keep_beating(engine: Weak<Inner>) {
    let mut beat = beat();
    loop {
        let Some(engine) = engine.upgrade() else { return };
        tokio::select! {
            () = ended(&engine) => return,
            _ = beat.tick() => beats(&engine).await,
            () = engine.jobs.computations.doubt() => beats(&engine).await,
        }
    }
}

/// Waits until no more is taken up and nothing is computed any more.
async fn ended(engine: &Arc<Inner>) {
    engine.jobs.stopped().await;
    while !engine.jobs.computations.leases().is_empty() {
        tokio::time::sleep(LOOK).await;
    }
}

fn beat() -> tokio::time::Interval {
    let mut beat = tokio::time::interval(BEAT);
    beat.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    beat
}

async fn look_after(engine: Weak<Inner>) {
    let (mut beat, mut count, mut due) = (beat(), 0_u64, Instant::now());
    let mut owners = HashSet::new();
    loop {
        let Some(engine) = engine.upgrade() else { return };
        let jobs = &engine.jobs;
        tokio::select! {
            () = jobs.stopped() => return,
            _ = beat.tick() => {
                count += 1;
                report("work", engine.unwritten.write(&*jobs.store).await);
                if jobs.store.is_shared() || count.is_multiple_of(SWEEP) {
                    sweep(&engine).await;
                }
                if count.is_multiple_of(COUNT) {
                    tally(&engine).await;
                }
                if count % FORGET == COUNT {
                    tally_owners(&engine, &mut owners).await;
                }
                if count.is_multiple_of(FORGET) {
                    report("forget", jobs.store.forget_expired().await);
                }
            }
            () = jobs.new_deadline.notified() => due = Instant::now() + deadlines(&engine).await,
            () = tokio::time::sleep_until(due) => due = Instant::now() + deadlines(&engine).await,
        }
    }
}

async fn beats(engine: &Arc<Inner>) {
    let jobs = &engine.jobs;
    let beats = jobs.computations.beats();
    if beats.is_empty() {
        return;
    }
    if let Some(unwanted) = report("beat", jobs.store.beat(beats).await) {
        jobs.computations.cancel(&unwanted);
    }
}

async fn sweep(engine: &Arc<Inner>) {
    let jobs = &engine.jobs;
    let computations = Arc::clone(&jobs.computations);
    if let Some(back) = report("sweep", jobs.store.sweep(Arc::new(move || computations.leases())).await)
        && !back.is_empty()
    {
        tracing::warn!(jobs = back.len(), "jobs that nobody ran are in line again");
        jobs.feeds.touch(&back);
        jobs.call();
    }
}

#[allow(clippy::cast_precision_loss)] // counts of jobs, bytes of a disk: below 2^53
async fn tally(engine: &Arc<Inner>) {
    if let Some(counts) = report("count", engine.jobs.store.counts().await) {
        let gauge =
            |state: &'static str, count: u64| metrics::gauge!("precut_jobs", "state" => state).set(count as f64);
        gauge("queued", counts.queued);
        gauge("running", counts.running);
        metrics::gauge!("precut_callbacks_pending").set(counts.callbacks as f64);
        let waited_ms = counts.oldest_ms.map_or(0, |came| engine.jobs.store.now_ms().saturating_sub(came).max(0));
        metrics::gauge!("precut_job_oldest_seconds").set(waited_ms as f64 / 1e3);
        metrics::gauge!("precut_store_bytes").set(counts.store_bytes as f64);
    }
}

/// Tells what is kept for each owner of keys; of those told before nothing any more where nothing is kept.
async fn tally_owners(engine: &Arc<Inner>, told: &mut HashSet<String>) {
    let Some(kept) = report("count", engine.jobs.store.kept_by_owner().await) else { return };
    #[allow(clippy::cast_precision_loss)] // bytes of a disk, below 2^53
    let gauge = |owner: &str, bytes: u64| {
        metrics::gauge!("precut_owner_kept_bytes", "owner" => label(owner)).set(bytes as f64);
    };
    for owner in told.drain() {
        gauge(&owner, 0);
    }
    for (owner, bytes) in kept {
        gauge(&owner, bytes);
        told.insert(owner);
    }
}

/// Ends what is late; how long until the next deadline.
async fn deadlines(engine: &Arc<Inner>) -> Duration {
    let jobs = &engine.jobs;
    let outcome = jobs.store.expire_deadlines(fault::written(&Error::DeadlineExceeded)).await;
    let Some((late, next)) = report("deadline", outcome) else { return BEAT };
    let longest = if jobs.store.is_shared() { LONGEST_SLEEP_SHARED } else { LONGEST_SLEEP };
    jobs.computations.give_up(&late.unwanted);
    jobs.feeds.touch(&late.jobs);
    let wait = next.map(|at| u64::try_from(at.saturating_sub(jobs.store.now_ms())).unwrap_or(0));
    // At least a millisecond later: the clock counts whole ones.
    wait.map_or(longest, |ms| Duration::from_millis(ms + 1)).min(longest)
}

fn report<T>(operation: &'static str, outcome: Result<T, crate::store::StoreError>) -> Option<T> {
    outcome
        .inspect_err(|error| {
            metrics::counter!("precut_store_failures_total", "operation" => operation).increment(1);
            tracing::warn!(%error, operation, "the jobs could not be looked after");
        })
        .ok()
}
