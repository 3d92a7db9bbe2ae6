//! Cuts that could be made and measured next to tell causes apart.

use crate::calculator::{NextRun, Ranges};

use crate::feed_schedule::measured::forward::{MachinabilityPoint, MachinabilityRun, Row};
use crate::feed_schedule::measured::hypotheses::condition;

/// Repeats of a next cut.
const REPEATS: usize = 4;

/// A regime in the middle with one or two conditions at an end of their ranges, and a fresh or a worn edge in a
/// light or a heavy cut.
pub(in crate::feed_schedule) fn next_runs(
    rows: &[Row],
    ranges: Ranges<'_>,
) -> Vec<NextRun<MachinabilityRun, MachinabilityPoint>> {
    let Some(typical) = typical(rows) else { return Vec::new() };
    let mut next = Vec::new();
    let mut add = |changes: &'static str, moved: &[(&str, f64)]| {
        let mut run = typical.clone();
        for (field, value) in moved {
            set(&mut run, field, *value);
        }
        next.push(NextRun { changes, run, points: vec![MachinabilityPoint::default(); REPEATS] });
    };
    let ends = |field: &str| ranges.ends(field, rows.iter().filter_map(|row| condition(row, field)));
    for field in ["speed_m_per_min", "feed_mm_per_rev", "depth_mm", "time_min"] {
        for end in ends(field).into_iter().flatten() {
            add(field, &[(field, end)]);
        }
    }
    for (both, one, other) in [
        ("speed_m_per_min, feed_mm_per_rev", "speed_m_per_min", "feed_mm_per_rev"),
        ("feed_mm_per_rev, depth_mm", "feed_mm_per_rev", "depth_mm"),
        ("speed_m_per_min, depth_mm", "speed_m_per_min", "depth_mm"),
    ] {
        let (Some(first), Some(second)) = (ends(one), ends(other)) else { continue };
        for a in first {
            for b in second {
                add(both, &[(one, a), (other, b)]);
            }
        }
    }
    if let (Some([_, worn]), Some(depths)) = (ends("flank_wear_mm"), ends("depth_mm")) {
        for wear in [0.0, worn] {
            for depth in depths {
                add("flank_wear_mm, depth_mm", &[("flank_wear_mm", wear), ("depth_mm", depth)]);
            }
        }
    }
    next
}

/// The conditions in the middle of the rows; batch and levels of the first row.
fn typical(rows: &[Row]) -> Option<MachinabilityRun> {
    let first = rows.first()?;
    let middle = |field: &str| {
        let mut values: Vec<f64> = rows.iter().filter_map(|row| condition(row, field)).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    Some(MachinabilityRun {
        speed_m_per_min: middle("speed_m_per_min"),
        feed_mm_per_rev: middle("feed_mm_per_rev"),
        depth_mm: middle("depth_mm"),
        cutting_edge_angle_deg: middle("cutting_edge_angle_deg"),
        nose_radius_mm: middle("nose_radius_mm"),
        flank_wear_mm: middle("flank_wear_mm"),
        batch: first.conditions.batch.clone(),
        factors: first.conditions.factors.clone(),
        // After all others.
        test: rows.iter().map(|row| row.test).try_fold(0.0, |most: f64, test| Some(most.max(test?))).map(|t| t + 1.0),
        time_min: middle("time_min"),
    })
}

fn set(run: &mut MachinabilityRun, field: &str, value: f64) {
    let place = match field {
        "speed_m_per_min" => &mut run.speed_m_per_min,
        "feed_mm_per_rev" => &mut run.feed_mm_per_rev,
        "depth_mm" => &mut run.depth_mm,
        "flank_wear_mm" => &mut run.flank_wear_mm,
        _ => &mut run.time_min,
    };
    *place = Some(value);
}
