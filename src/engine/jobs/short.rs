//! A place for short jobs while long ones have taken all others.
//!
//! With all places taken by jobs of minutes, one of a second would wait for minutes. So one more place, with a thread of its
//! own, takes jobs that are estimated short, past the longer ones, and only while no other place is free. The line and the
//! other places stay as they are for who is long: nothing waits for ever.

use std::sync::{Arc, Weak};

use super::worker;
use crate::engine::Inner;

pub(super) async fn run(engine: Weak<Inner>) {
    while let Some(engine) = engine.upgrade().filter(|engine| !engine.jobs.is_stopped()) {
        let mut came = engine.jobs.came();
        if !run_next(&engine).await {
            worker::idle(&engine.jobs, &mut came).await;
        }
    }
}

/// Runs the next short job if there is no other place for it; whether there was one.
async fn run_next(engine: &Arc<Inner>) -> bool {
    let most_ms = Some(engine.settings.short_limit.as_secs_f64() * 1e3);
    if engine.cores.has_job_place() || !worker::waits(engine, most_ms).await {
        return false;
    }
    let slot = tokio::select! {
        Ok(slot) = engine.cores.short_job_slot() => slot,
        () = engine.jobs.stopped() => return false,
    };
    let Some(work) = worker::next(engine, slot, None, most_ms).await else { return false };
    // A task of its own: it goes on where the job fails.
    let _ = tokio::spawn(work).await;
    true
}
