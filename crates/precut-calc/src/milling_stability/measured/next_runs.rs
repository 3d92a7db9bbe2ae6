//! Cuts that could be made next to tell causes apart.

use rayon::prelude::*;

use crate::calculator::{Failure, Monitor, NextRun, NextRuns, Ranges, Rows};

use super::super::job::{Case, Job, fits};
use super::super::model::{Mode, Orders};
use super::forward::{MillingPoint, MillingRun};
use super::limits::first_limit_mm;

/// Speeds at which a tooth passes once in so many oscillations of a mode, that are tried.
const MOST_SPEEDS: usize = 8;
/// Depths that are tried at each, as shares of the limit of the base: a cut tells most where it is not known how it goes.
const SHARES: [f64; 4] = [0.75, 0.92, 1.08, 1.3];
/// Limits are looked for up to so many times the largest depth of the log.
const LOOKED_FOR: f64 = 3.0;
/// Two speeds nearer than this share are one.
const ONE_SPEED: f64 = 0.01;

/// One more cut on either side of the limit of the base, at the ends of the range of speeds and at those at which a mode swings a whole
/// number of times, or one half more, from tooth to tooth; the width as in the middle of the log.
pub(super) fn next_runs(
    job: &Job,
    rows: &Rows<MillingRun, MillingPoint>,
    ranges: Ranges<'_>,
    monitor: &dyn Monitor,
) -> Result<NextRuns<MillingRun, MillingPoint>, Failure> {
    let (_, fitted) = fits(job, monitor)?;
    let Some(base) = Case::of(&fitted) else { return Ok(Vec::new()) };
    let run_of = |run: usize| rows.runs.get(run).cloned().unwrap_or_default();
    let speed = |(run, point): &(usize, MillingPoint)| point.spindle_speed_rpm.or(run_of(*run).spindle_speed_rpm);
    let depth = |(run, point): &(usize, MillingPoint)| point.depth_mm.or(run_of(*run).depth_mm);
    let speeds = rows.points.iter().map(|row| speed(row).unwrap_or(base.rotation.spindle_rpm));
    let Some([slowest, fastest]) = ranges.ends("spindle_speed_rpm", speeds) else { return Ok(Vec::new()) };
    let depths = rows.points.iter().map(|row| depth(row).unwrap_or(base.depth_mm));
    let Some([shallowest, deepest]) = ranges.ends("depth_mm", depths) else { return Ok(Vec::new()) };
    // No faster or slower than the spindle turns.
    let spindle = job.spindle.as_ref();
    let slowest = slowest.max(spindle.and_then(|of| of.speed_min_rpm).unwrap_or(0.0));
    let fastest = fastest.min(spindle.and_then(|of| of.speed_max_rpm).unwrap_or(f64::INFINITY));
    let tried = telling_speeds(&base, slowest, fastest);
    let orders = Orders::default();
    // A speed at which none is found is no candidate.
    let limit = |speed: &f64| first_limit_mm(&orders, &base, *speed, LOOKED_FOR * deepest, monitor);
    let limits: Vec<Option<f64>> = tried.par_iter().map(limit).collect::<Result<_, _>>()?;
    let typical = rows.runs.get(rows.runs.len() / 2).cloned().unwrap_or_default();
    let width_mm = rows.points.get(rows.points.len() / 2).and_then(|(_, point)| point.width_mm);
    let at = |(speed, limit): (&f64, &Option<f64>)| {
        limit.map(|limit| {
            SHARES.map(|share| {
                let run = MillingRun {
                    spindle_speed_rpm: Some(rounded(*speed)),
                    depth_mm: Some(rounded((share * limit).clamp(shallowest, deepest))),
                    width_mm: width_mm.or(typical.width_mm),
                    ..typical.clone()
                };
                NextRun { changes: "spindle_speed_rpm", run, points: vec![MillingPoint::default()] }
            })
        })
    };
    Ok(tried.iter().zip(&limits).filter_map(at).flatten().collect())
}

/// Three digits are what is set at a machine.
fn rounded(value: f64) -> f64 {
    let scale = 10.0_f64.powf(2.0 - value.abs().max(f64::MIN_POSITIVE).log10().floor());
    if scale > 1.0 { (value * scale).round() / scale } else { (value * scale).round() * scale.recip().round() }
}

/// The ends of a range, and within it where lobes of the modes meet and where they are highest, modes by turns, fastest first.
fn telling_speeds(base: &Case, slowest: f64, fastest: f64) -> Vec<f64> {
    let of_mode = |mode: &Mode| {
        let one = 60.0 * mode.frequency_hz / base.milling.teeth.len() as f64;
        (2..=200_u32).map(|half| 2.0 * one / f64::from(half)).filter(|n| (slowest..=fastest).contains(n)).collect()
    };
    let of_modes: Vec<Vec<f64>> = base.structure.modes.iter().map(of_mode).collect();
    let longest = of_modes.iter().map(Vec::len).max().unwrap_or(0);
    let by_turns = (0..longest).flat_map(|k| of_modes.iter().filter_map(move |speeds| speeds.get(k).copied()));
    let mut tried = vec![slowest, fastest];
    for speed in by_turns {
        if tried.len() < MOST_SPEEDS && tried.iter().all(|known| (known / speed - 1.0).abs() > ONE_SPEED) {
            tried.push(speed);
        }
    }
    tried
}
