//! Runs that could be cut and measured next to tell causes apart.

use crate::calculator::{NextRun, Ranges, Rows};
use crate::deflection_compensation::job::input::{FeedDirection, Job};
use crate::deflection_compensation::measured::run::{DeflectionPoint, DeflectionRun};

/// One more run for every condition at either end of its range, the other conditions as in the run
/// in the middle; depth and feed both at an end, where the force lies farthest off; the other feed direction; a fresh edge; a
/// cold machine.
pub(in crate::deflection_compensation) fn next_runs(
    job: &Job,
    rows: &Rows<DeflectionRun, DeflectionPoint>,
    ranges: Ranges<'_>,
) -> Vec<NextRun<DeflectionRun, DeflectionPoint>> {
    let Some(typical) = rows.runs.get(rows.runs.len() / 2) else { return Vec::new() };
    let points = longest_run(rows);
    let depth = |run: &DeflectionRun| run.depth_mm;
    let feed = |run: &DeflectionRun| Some(run.feed_mm_per_rev.unwrap_or(job.cut.feed_mm_per_rev));
    let speed = |run: &DeflectionRun| run.speed_m_per_min.or(job.cut.speed_m_per_min);
    let ends = |condition: &str, of: &dyn Fn(&DeflectionRun) -> Option<f64>| {
        ranges.ends(condition, rows.runs.iter().filter_map(of)).into_iter().flatten()
    };
    let mut next = Vec::new();
    let mut add = |changes, run| next.push(NextRun { changes, run, points: points.clone() });
    for value in ends("depth_mm", &depth) {
        add("depth_mm", DeflectionRun { depth_mm: Some(value), ..typical.clone() });
    }
    for value in ends("feed_mm_per_rev", &feed) {
        add("feed_mm_per_rev", DeflectionRun { feed_mm_per_rev: Some(value), ..typical.clone() });
    }
    for depth in ends("depth_mm", &depth) {
        for feed in ends("feed_mm_per_rev", &feed) {
            let run = DeflectionRun { depth_mm: Some(depth), feed_mm_per_rev: Some(feed), ..typical.clone() };
            add("depth_mm, feed_mm_per_rev", run);
        }
    }
    if typical.spindle_speed_rpm.is_none() {
        for value in ends("speed_m_per_min", &speed) {
            add("speed_m_per_min", DeflectionRun { speed_m_per_min: Some(value), ..typical.clone() });
        }
    }
    let direction = match typical.feed_direction.unwrap_or(job.cut.feed_direction) {
        FeedDirection::ToHeadstock => FeedDirection::ToTailstock,
        FeedDirection::ToTailstock => FeedDirection::ToHeadstock,
    };
    add("feed_direction", DeflectionRun { feed_direction: Some(direction), ..typical.clone() });
    add("tool_path_at_start_m", DeflectionRun { tool_path_at_start_m: Some(0.0), ..typical.clone() });
    add("warm_time_at_start_min", DeflectionRun { warm_time_at_start_min: Some(0.0), ..typical.clone() });
    next
}

/// Places of the run with the most rows.
pub(crate) fn longest_run<R>(rows: &Rows<R, DeflectionPoint>) -> Vec<DeflectionPoint> {
    let of = |k: usize| rows.points.iter().filter(move |(run, _)| *run == k).map(|(_, point)| *point);
    (0..rows.runs.len()).max_by_key(|&k| of(k).count()).map_or_else(Vec::new, |k| of(k).collect())
}
