//! Rings that could be turned and measured next to tell causes apart.

use crate::calculator::{NextRun, Ranges, Rows};
use crate::ring_roundness::job::input::Job;
use crate::ring_roundness::measured::forward::{RingPoint, RingRun};

/// Revolutions that a longer spark-out has more.
const LONGER_SPARK_OUT: f64 = 3.0;
/// Share of the radius by which the tool is moved across.
const TOOL_MOVED: f64 = 0.01;
/// Angles at which the next ring is measured: enough for waves up to 60.
const ANGLES: u32 = 180;

/// Another ring with one setting of the machine changed: no spark-out and a longer one, half the feed over twice the
/// revolutions, the tool moved across its own direction to either side.
pub(in crate::ring_roundness) fn next_runs(
    job: &Job,
    rows: &Rows<RingRun, RingPoint>,
    ranges: Ranges<'_>,
) -> Vec<NextRun<RingRun, RingPoint>> {
    let typical = rows.runs.first().cloned().unwrap_or_default();
    let points: Vec<RingPoint> =
        (0..ANGLES).map(|k| RingPoint { angle_deg: 360.0 * f64::from(k) / f64::from(ANGLES) }).collect();
    let tool = &crate::ring_roundness::measured::forward::job_of_run(job, &typical).tool;
    let mut next = Vec::new();
    let mut add = |changes, run| next.push(NextRun { changes, run, points: points.clone() });
    let spark_out = |revolutions| RingRun { spark_out_revolutions: Some(revolutions), ..typical.clone() };
    let other = [0.0, tool.spark_out_revolutions + LONGER_SPARK_OUT];
    for revolutions in ranges.stated("spark_out_revolutions").unwrap_or(other) {
        if (revolutions - tool.spark_out_revolutions).abs() > 0.0 {
            add("spark_out_revolutions", spark_out(revolutions));
        }
    }
    add(
        "feed_mm_per_rev",
        RingRun {
            feed_mm_per_rev: Some(0.5 * tool.feed_mm_per_rev),
            revolutions: Some(2.0 * tool.revolutions),
            ..typical.clone()
        },
    );
    let aside = TOOL_MOVED * crate::ring_roundness::job::check::mean_radius_mm(job).unwrap_or(0.0);
    let reach = tool.x_mm.hypot(tool.y_mm).max(f64::MIN_POSITIVE);
    for share in [-aside / reach, aside / reach] {
        let (x_mm, y_mm) = (tool.x_mm - share * tool.y_mm, tool.y_mm + share * tool.x_mm);
        add("tool_x_mm", RingRun { tool_x_mm: Some(x_mm), tool_y_mm: Some(y_mm), ..typical.clone() });
    }
    next
}
