//! Parts of a job that another process runs.
//!
//! A job that is made of parts is run by one process, which puts them together, and asks for help
//! ([`JobStore::call_for_help`](crate::store::jobs::JobStore::call_for_help)). Whoever has a place and no job for it
//! computes parts until none is left or nobody wants the job any more, but not for long: other jobs may wait for the place.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use precut_calc::calculator::{Message, Monitor};
use tokio::sync::oneshot;

use super::work;
use crate::engine::exec::{Slot, guarded};
use crate::engine::{Error, Inner};
use crate::store::jobs::Shared;

/// After so long a helper lets others go first; if parts are left, another one comes.
const SHIFT: Duration = Duration::from_secs(5);
/// How often a helper looks whether the job is still wanted, if nobody tells him.
const LOOK: Duration = Duration::from_secs(1);

pub(super) async fn run(engine: Arc<Inner>, shared: Shared, slot: Slot) {
    let (jobs, id) = (&engine.jobs, shared.id);
    let Ok(entry) = engine.known(&shared.calculator) else { return };
    if !entry.is_composed() {
        return;
    }
    tracing::debug!(job = %id, "helping with a job");
    metrics::counter!("precut_jobs_helped_total").increment(1);
    let unwanted = Arc::new(AtomicBool::new(false));
    let (sender, mut receiver) = oneshot::channel();
    let (watch, key) = (Unwanted(Arc::clone(&unwanted)), shared.key);
    slot.line().push(move || {
        let begun = Instant::now();
        let outcome = guarded(|| {
            let ready = work::ready(&entry, &shared.input)?;
            // Another version's job would be another one here.
            Ok(ready.key == key && ready.prepared.help(&watch, &mut || begun.elapsed() < SHIFT))
        });
        drop(slot);
        // Nobody listens if the service stops.
        let _ = sender.send(outcome);
    });
    let mut feed = jobs.feed(id);
    let outcome = loop {
        tokio::select! {
            outcome = &mut receiver => break outcome.unwrap_or(Err(Error::Crashed)),
            () = feed.changed() => {}
            () = tokio::time::sleep(LOOK) => {}
            () = jobs.stopped() => unwanted.store(true, Ordering::Relaxed),
        }
        let is_open = jobs.store.job(id).await.map(|record| record.is_some_and(|record| !record.state.is_final()));
        if is_open == Ok(false) {
            unwanted.store(true, Ordering::Relaxed);
        }
        if unwanted.load(Ordering::Relaxed) {
            break receiver.await.unwrap_or(Err(Error::Crashed));
        }
    };
    let parts_left = matches!(outcome, Ok(true)) && !unwanted.load(Ordering::Relaxed);
    if parts_left && let Err(error) = jobs.store.call_for_help(key, 1).await {
        tracing::debug!(job = %id, %error, "no further help is asked for");
    }
}

/// Whether nobody wants the job any more.
struct Unwanted(Arc<AtomicBool>);

impl Monitor for Unwanted {
    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}
