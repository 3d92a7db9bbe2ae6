//! A place for short jobs while long ones have taken all others.
//!
//! The queue hands out jobs for places that are free: with all of them taken by jobs of minutes, one of a second would wait
//! for minutes. So one more place, with a thread of its own, takes jobs that are estimated short straight from their
//! records, and only while no other place is free. Their tasks come up later and find nothing to do. The line and the other
//! places stay as they are for who is long: nothing waits for ever.

use std::sync::{Arc, Weak};
use std::time::Duration;

use super::worker;
use crate::engine::Inner;

/// How often there is a look for what came unheard: to another process, or while there was a place.
const LOOK: Duration = Duration::from_secs(1);

pub(super) async fn run(engine: Weak<Inner>) {
    loop {
        let Some(engine) = engine.upgrade() else { return };
        let jobs = &engine.jobs;
        if jobs.is_stopped() {
            return;
        }
        if !run_next(&engine).await {
            tokio::select! {
                () = jobs.came.notified() => {}
                () = tokio::time::sleep(LOOK) => {}
                () = jobs.stopped() => return,
            }
        }
    }
}

/// Runs the next short job if there is no other place for it; whether there was one.
async fn run_next(engine: &Arc<Inner>) -> bool {
    let jobs = &engine.jobs;
    if engine.cores.has_job_place() {
        return false;
    }
    let slot = tokio::select! {
        Ok(slot) = engine.cores.short_job_slot() => slot,
        () = jobs.stopped() => return false,
    };
    match jobs.store.next_short(engine.settings.short_limit.as_secs_f64() * 1e3).await {
        Ok(Some(id)) => {
            // A task of its own: it goes on where the job fails.
            let _ = tokio::spawn(worker::run_task(Arc::clone(engine), id, Some(slot))).await;
            true
        }
        Ok(None) => false,
        Err(error) => {
            metrics::counter!("precut_store_failures_total", "operation" => "short").increment(1);
            tracing::warn!(%error, "no short job can be taken at the moment");
            false
        }
    }
}
