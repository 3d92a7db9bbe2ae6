//! What a lobe diagram shows while it is computed, and how soon it stops when nobody waits.
#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, missing_docs)]

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::fixture_support::{checked, reference_job, with};
use precut_calc::calculator::{Calculator, Failure, Figure, Item, Message, Monitor};
use precut_calc::fixture_stability::{FixtureJob, FixtureStability};
use serde_json::json;

/// Hears a job, and cancels it after so many looks.
#[derive(Default)]
struct Watch {
    heard: Mutex<Vec<(f64, &'static str)>>,
    /// Filled points of the map, points of the boundary, refined points.
    seen: Mutex<Vec<(usize, usize, usize)>>,
    looks: AtomicUsize,
    cancel_after: Option<usize>,
}

impl Monitor for Watch {
    fn cancelled(&self) -> bool {
        self.cancel_after.is_some_and(|most| self.looks.fetch_add(1, Ordering::Relaxed) >= most)
    }
    fn progress(&self, fraction: f64, stage: Message) {
        self.heard.lock().unwrap().push((fraction, stage.code));
    }
    fn interim(&self, figure: Figure) {
        let mut seen = (0, 0, 0);
        for item in &figure.panels[0].items {
            match item {
                Item::HeatMap { values, .. } => seen.0 = values.iter().flatten().count(),
                Item::Line { y, .. } => seen.1 = y.len(),
                Item::Points { name: "refined_boundary", x, .. } => seen.2 = x.len(),
                _ => {}
            }
        }
        self.seen.lock().unwrap().push(seen);
    }
}

fn diagram() -> FixtureJob {
    let mut job = with(&reference_job(2), "/analyses", json!(["lobes"]));
    job["simulation"] = json!({ "tooth_periods": 20, "steps_per_tooth": 64 });
    job["lobes"] = json!({
        "from_rpm": 400, "to_rpm": 1200, "speeds": 40, "depth_max_mm": 10, "depths": 20, "map": true, "refinement": 2,
    });
    checked(&job).unwrap()
}

#[test]
fn the_diagram_grows_while_it_is_computed() {
    let watch = Watch::default();
    let answer = FixtureStability::run(&diagram(), &watch).unwrap().output;
    let seen = watch.seen.into_inner().unwrap();
    assert!(seen.is_sorted_by(|a, b| a.0 <= b.0 && a.1 <= b.1 && a.2 <= b.2), "{seen:?}");
    let lobes = answer.lobes.unwrap();
    let map = lobes.map.unwrap();
    let whole = (map.modulus.len(), lobes.boundary.spindle_speed_rpm.len(), map.refined_depth_mm.len());
    assert_eq!(*seen.last().unwrap(), whole);
    assert!(whole.0 == 800 && whole.2 > 40 && seen.iter().any(|s| s.0 > 0 && s.0 < 800), "{seen:?}");
    let heard = watch.heard.into_inner().unwrap();
    assert!(heard.is_sorted_by(|a, b| a.0 <= b.0) && heard.last().unwrap().0 == 1.0, "{heard:?}");
    for stage in ["stage_boundary", "stage_map"] {
        assert!(heard.iter().any(|(_, code)| *code == stage), "{stage}");
    }
}

/// The refined points are on the boundary that was traced: cells are halved twice, and the crossing on their edges is
/// linear in ln |mu|. Neighbours on the boundary that are compared differ by less than a tenth, and in a valley their chord
/// misses the curve by less than half of that.
#[test]
fn a_refined_map_has_the_traced_boundary() {
    let lobes = FixtureStability::run(&diagram(), &Watch::default()).unwrap().output.lobes.unwrap();
    let (map, of) = (lobes.map.unwrap(), lobes.boundary);
    let mut compared = 0;
    for (rpm, depth) in map.refined_speed_rpm.iter().zip(&map.refined_depth_mm) {
        let after = of.spindle_speed_rpm.partition_point(|n| n < rpm).clamp(1, of.spindle_speed_rpm.len() - 1);
        let (n0, n1) = (of.spindle_speed_rpm[after - 1], of.spindle_speed_rpm[after]);
        let (Some(h0), Some(h1)) = (of.chatter_mm[after - 1], of.chatter_mm[after]) else { continue };
        // Islands have an upper end, and steep flanks no depth of their own.
        if of.stable_again_mm[after - 1].is_some() || of.stable_again_mm[after].is_some() || (h0 - h1).abs() > 0.1 * h0
        {
            continue;
        }
        let traced = h0 + (rpm - n0) / (n1 - n0) * (h1 - h0);
        assert!((depth - traced).abs() < 0.05 * traced, "{rpm}: {depth}, traced {traced}");
        compared += 1;
    }
    assert!(compared > 30, "{compared}");
}

#[test]
fn a_cancelled_diagram_stops_wherever_it_is() {
    for looks in [0, 1, 3, 10, 20] {
        let watch = Watch { cancel_after: Some(looks), ..Watch::default() };
        assert_eq!(FixtureStability::run(&diagram(), &watch), Err(Failure::Cancelled), "{looks}");
    }
}

#[test]
fn the_answer_does_not_depend_on_the_number_of_threads() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| FixtureStability::run(&diagram(), &Watch::default())).unwrap()
    };
    assert_eq!(run(1), run(2));
}
