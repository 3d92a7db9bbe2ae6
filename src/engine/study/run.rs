//! The points of a study in shards: runs of points that whoever has a place computes, or all of them one after the other.
//!
//! What a shard comes to does not depend on who computes it, so that the rows are the same on one core and on many, and after
//! any number of restarts.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use precut_calc::calculator::{Failure, Message, Monitor};

use super::figure;
use super::host::Host;
use super::plan::Plan;
use super::point::Shard;
use super::result::Row;
use crate::registry::{Sharded, Unfinished};

/// A study whose cost is below is not worth a second core, nor a record of its shards, ms.
const LARGE_MS: f64 = 200.0;
/// How often the picture so far is drawn.
const INTERIM: Duration = Duration::from_millis(500);

/// A study and what is done of it.
pub(super) struct Shards {
    plan: Arc<Plan>,
    host: Arc<dyn Host>,
    progress: Mutex<Progress>,
}

struct Progress {
    shards: Vec<Option<Shard>>,
    points: usize,
    drawn: Instant,
}

impl Shards {
    pub(super) fn new(plan: &Arc<Plan>, host: &Arc<dyn Host>) -> Self {
        let progress = Progress { shards: vec![None; plan.shards()], points: 0, drawn: Instant::now() };
        Self { plan: Arc::clone(plan), host: Arc::clone(host), progress: Mutex::new(progress) }
    }

    /// Whether they are worth to be computed apart.
    pub(super) fn are_many(&self) -> bool {
        self.plan.cost.ms >= LARGE_MS && self.plan.shards() > 1
    }

    /// All of them: those that were not taken up are computed here.
    pub(super) fn all(&self, monitor: &dyn Monitor) -> Result<Vec<Shard>, Failure> {
        for index in 0..self.plan.shards() {
            if self.progress().shards[index].is_some() {
                continue;
            }
            let computed = Shard::compute(&self.plan, self.plan.shard(index), &*self.host, (monitor, false), || {
                self.progress().points += 1;
                self.tell(monitor);
            });
            let shard = computed.map_err(|unfinished| match unfinished {
                Unfinished::Cancelled => Failure::Cancelled,
                Unfinished::Deadly => Failure::Internal("a point of a study ended its process".to_owned()),
                Unfinished::Failed(failure) => failure,
            })?;
            self.progress().shards[index] = Some(shard);
        }
        Ok(std::mem::take(&mut self.progress().shards).into_iter().flatten().collect())
    }

    fn progress(&self) -> MutexGuard<'_, Progress> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What a shard came to, if that is what it says.
    fn read(&self, index: usize, content: &[u8]) -> Option<Shard> {
        let points = self.plan.shard(index);
        let shard: Shard = serde_json::from_slice(content).ok()?;
        let fits = shard.rows.len() == points.len()
            && shard.rows.iter().zip(points).all(|(row, point)| row.values == self.plan.settings(point));
        fits.then_some(shard)
    }
}

impl Sharded for Shards {
    fn count(&self) -> usize {
        self.plan.shards()
    }

    fn compute(&self, index: usize, monitor: &dyn Monitor, apart: bool) -> Result<Vec<u8>, Unfinished> {
        let shard = Shard::compute(&self.plan, self.plan.shard(index), &*self.host, (monitor, apart), || {})?;
        let unwritten = |error: serde_json::Error| Unfinished::Failed(Failure::Internal(format!("a shard: {error}")));
        serde_json::to_vec(&shard).map_err(unwritten)
    }

    fn take_up(&self, index: usize, content: &[u8]) -> bool {
        let Some(shard) = self.read(index, content) else { return false };
        let mut progress = self.progress();
        if progress.shards[index].is_none() {
            progress.points += shard.rows.len();
            progress.shards[index] = Some(shard);
        }
        true
    }

    fn tell(&self, monitor: &dyn Monitor) {
        let mut progress = self.progress();
        let (done, of) = (progress.points, self.plan.points);
        let is_drawn = progress.drawn.elapsed() >= INTERIM;
        let figure = is_drawn.then(|| interim(&self.plan, &progress.shards)).flatten();
        if is_drawn {
            progress.drawn = Instant::now();
        }
        drop(progress);
        monitor.progress(done as f64 / of as f64, Message::new("study_point").with("done", done).with("of", of));
        if let Some(figure) = figure {
            monitor.interim(figure);
        }
    }
}

/// The picture of the rows that are there.
fn interim(plan: &Plan, shards: &[Option<Shard>]) -> Option<precut_calc::calculator::Figure> {
    let row = |point: usize| shards[point / plan.shard_points].as_ref()?.rows.get(point % plan.shard_points);
    let rows: Vec<Option<&Row>> = (0..plan.points).map(row).collect();
    figure::of_plan(plan, &rows)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use precut_calc::calculator::Unwatched;
    use serde_json::json;

    use super::*;
    use crate::engine::study::Alone;
    use crate::registry::toy;

    /// A study of three shards, each a point.
    fn shards() -> Shards {
        let study = json!({
            "calculator": "toy-bar",
            "job": {"segments": [{"diameter_mm": 20}], "work_ms": 300},
            "vary": [{"pointer": "/length_mm", "values": [100, 200, 300]}],
        });
        let plan = Plan::new(&toy::registry(), 100, serde_json::from_value(study).unwrap()).unwrap();
        let host: Arc<dyn Host> = Arc::new(Alone);
        let shards = Shards::new(&Arc::new(plan), &host);
        assert!(shards.count() == 3 && shards.are_many());
        shards
    }

    #[test]
    fn shards_that_others_computed_give_the_rows_of_one_place() {
        let here = shards().all(&Unwatched).unwrap();
        let gathered = shards();
        for index in [2, 0, 1] {
            let content = shards().compute(index, &Unwatched, false).unwrap();
            assert!(gathered.take_up(index, &content));
        }
        assert_eq!(gathered.all(&Unwatched).unwrap(), here);
        // Those that are not there are computed.
        let some = shards();
        assert!(some.take_up(1, &shards().compute(1, &Unwatched, false).unwrap()));
        assert_eq!(some.all(&Unwatched).unwrap(), here);
    }

    #[test]
    fn what_is_no_content_of_a_shard_is_not_taken_up() {
        let first = shards().compute(0, &Unwatched, false).unwrap();
        let shards = shards();
        assert!(!shards.take_up(1, &first), "the rows are of other points");
        assert!(!shards.take_up(0, b"") && !shards.take_up(0, &first[..first.len() - 1]));
        assert!(shards.take_up(0, &first));
    }
}
