//! Runs that could be cut and measured next to tell causes apart.

use crate::calculator::{NextRun, Ranges, Rows};
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::FixtureJob;
use crate::fixture_stability::measured::forward::{FixturePoint, FixtureRun};

/// Speeds at which a tooth passes once in so many oscillations of a mode, that are tried.
const LOBES: usize = 4;
/// Minutes after which a clamped workpiece has settled.
const SETTLED_MIN: f64 = 60.0;

/// One more run at either end of the range of speed, feed and depth, at the speeds near a lobe within that of the
/// speed, and long after clamping; the other conditions as in the run in the middle.
pub(in crate::fixture_stability) fn next_runs(
    job: &FixtureJob,
    rows: &Rows<FixtureRun, FixturePoint>,
    ranges: Ranges<'_>,
) -> Vec<NextRun<FixtureRun, FixturePoint>> {
    let (Some(typical), Some(base)) = (rows.runs.get(rows.runs.len() / 2), Case::of(job)) else { return Vec::new() };
    let points = longest_run(rows);
    let mut next = Vec::new();
    let mut add = |changes, run, points: &[FixturePoint]| next.push(NextRun { changes, run, points: points.to_vec() });
    let speeds = rows.runs.iter().map(|run| run.spindle_speed_rpm.unwrap_or(base.working.spindle_rpm));
    if let Some([slowest, fastest]) = ranges.ends("spindle_speed_rpm", speeds) {
        for speed in [slowest, fastest].into_iter().chain(near_lobes(&base, slowest, fastest)) {
            add("spindle_speed_rpm", FixtureRun { spindle_speed_rpm: Some(speed), ..typical.clone() }, &points);
        }
    }
    let feeds = rows.runs.iter().map(|run| run.feed_mm_per_tooth.unwrap_or(base.working.feed_mm));
    for feed in ranges.ends("feed_mm_per_tooth", feeds).into_iter().flatten() {
        add("feed_mm_per_tooth", FixtureRun { feed_mm_per_tooth: Some(feed), ..typical.clone() }, &points);
    }
    let depths = rows.points.iter().filter_map(|(run, point)| point.depth_mm.or(rows.runs.get(*run)?.depth_mm));
    let depths = depths.chain([typical.depth_mm.unwrap_or(base.working.depth_mm)]);
    for depth in ranges.ends("depth_mm", depths).into_iter().flatten() {
        // The points of the new run are all at its depth.
        let there: Vec<FixturePoint> = points.iter().map(|point| FixturePoint { depth_mm: None, ..*point }).collect();
        add("depth_mm", FixtureRun { depth_mm: Some(depth), ..typical.clone() }, &there);
    }
    if base.holding.clamp_force_n.is_some() {
        let run = FixtureRun { time_since_clamping_min: Some(SETTLED_MIN), ..typical.clone() };
        add("time_since_clamping_min", run, &points);
    }
    next
}

/// Speeds at which a mode swings a whole number of times from tooth to tooth: there amplitudes depend on stiffness, mass and
/// damping each in its own way.
fn near_lobes(base: &Case, slowest: f64, fastest: f64) -> Vec<f64> {
    let of_mode = base.holding.modes().into_iter().flat_map(|mode| {
        let one = 60.0 * mode.damped_hz / base.cutting.teeth as f64;
        (1..=100_u32).map(move |swings| one / f64::from(swings))
    });
    of_mode.filter(|speed| (slowest..=fastest).contains(speed)).take(LOBES).collect()
}

/// Places of the run with the most rows.
fn longest_run(rows: &Rows<FixtureRun, FixturePoint>) -> Vec<FixturePoint> {
    let of = |k: usize| rows.points.iter().filter(move |(run, _)| *run == k).map(|(_, point)| *point);
    (0..rows.runs.len()).max_by_key(|&k| of(k).count()).map_or_else(Vec::new, |k| of(k).collect())
}
