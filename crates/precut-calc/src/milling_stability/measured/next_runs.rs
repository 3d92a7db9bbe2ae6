//! Cuts that could be made next to tell causes apart.

use rayon::prelude::*;

use crate::calculator::{Failure, Monitor, NextRun, NextRuns, Ranges, Rows};
use crate::effects::MillingEffect;

use super::super::job::{Case, Job, fits};
use super::super::model::{Mode, Orders};
use super::forward::{MillingPoint, MillingRun};
use super::limits::{first_limit_mm, limit_near_mm};

/// Speeds that are tried, at most.
const MOST_SPEEDS: usize = 8;
/// Depths that are tried at each, as shares of the limit of what leads: a cut tells most where it is not known how it goes.
const SHARES: [f64; 3] = [0.92, 1.08, 1.3];
/// Beyond all limits, of the largest: there every set is heard.
const BEYOND_ALL: f64 = 1.3;
/// Between two limits of what may be right lies a depth, of the widest gaps so many.
const MOST_GAPS: usize = 3;
/// Two depths, or limits, nearer than this share are one: a cut scatters by as much.
const ONE_DEPTH: f64 = 0.04;
/// Limits are looked for up to so many times the largest depth of the log.
const LOOKED_FOR: f64 = 3.0;
/// Two speeds nearer than this share are one.
const ONE_SPEED: f64 = 0.01;

/// One more cut at the ends of the range of speeds and at those at which a mode of what may be right swings a whole number of times, or
/// one half more, from tooth to tooth: on both sides of the limit of what leads, between the limits of what may be right, and beyond them
/// all. `likely` are the effects of what may be right, the leading ones first; without any the base leads. The width as in the middle of
/// the log.
pub(super) fn next_runs(
    job: &Job,
    rows: &Rows<MillingRun, MillingPoint>,
    ranges: Ranges<'_>,
    likely: &[Vec<MillingEffect>],
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
    let cases = match likely {
        [] => vec![base],
        _ => likely.iter().map(|effects| base.clone().with_effects(effects)).collect(),
    };
    let tried = telling_speeds(&cases, slowest, fastest);
    let orders = Orders::default();
    // A speed at which none is found is no candidate.
    let limits = |speed: &f64| limits_mm(&orders, &cases, *speed, LOOKED_FOR * deepest, monitor);
    let limits: Vec<Vec<f64>> = tried.par_iter().map(limits).collect::<Result<_, _>>()?;
    let typical = rows.runs.get(rows.runs.len() / 2).cloned().unwrap_or_default();
    let width_mm = rows.points.get(rows.points.len() / 2).and_then(|(_, point)| point.width_mm);
    let at = |speed: f64, depth_mm: f64| {
        let run = MillingRun {
            spindle_speed_rpm: Some(rounded(speed)),
            depth_mm: Some(rounded(depth_mm)),
            width_mm: width_mm.or(typical.width_mm),
            ..typical.clone()
        };
        NextRun { changes: "spindle_speed_rpm", run, points: vec![MillingPoint::default()] }
    };
    let of_speed = |(speed, limits): (&f64, &Vec<f64>)| {
        let depths = telling_depths(limits, [shallowest, deepest]);
        depths.into_iter().map(|depth_mm| at(*speed, depth_mm)).collect::<Vec<_>>()
    };
    Ok(tried.iter().zip(&limits).flat_map(of_speed).collect())
}

/// Limits at a speed, that of what leads first and those of the others next to it; empty where what leads has none.
fn limits_mm(
    orders: &Orders,
    cases: &[Case],
    spindle_rpm: f64,
    most_mm: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, Failure> {
    let [leading, others @ ..] = cases else { return Ok(Vec::new()) };
    let Some(first) = first_limit_mm(orders, leading, spindle_rpm, most_mm, monitor)? else { return Ok(Vec::new()) };
    let mut limits = vec![first];
    for case in others {
        limits.extend(limit_near_mm(orders, case, spindle_rpm, first, monitor)?);
    }
    Ok(limits)
}

/// Depths at which a cut tells most, the limit of what leads being the first of `limits`.
fn telling_depths(limits: &[f64], [shallowest, deepest]: [f64; 2]) -> Vec<f64> {
    let Some(leading) = limits.first() else { return Vec::new() };
    let mut rising = limits.to_vec();
    rising.sort_by(f64::total_cmp);
    let mut gaps: Vec<(f64, f64)> =
        rising.windows(2).map(|pair| (pair[1] / pair[0], (pair[0] * pair[1]).sqrt())).collect();
    gaps.retain(|(ratio, _)| *ratio > 1.0 + ONE_DEPTH);
    gaps.sort_by(|a, b| b.0.total_cmp(&a.0));
    let beyond = rising.last().map(|largest| BEYOND_ALL * largest);
    let between = gaps.into_iter().take(MOST_GAPS).map(|(_, middle)| middle);
    let mut depths: Vec<f64> = Vec::new();
    for depth in between.chain(SHARES.map(|share| share * leading)).chain(beyond) {
        let depth = depth.clamp(shallowest, deepest);
        if depths.iter().all(|known| (known / depth - 1.0).abs() > ONE_DEPTH) {
            depths.push(depth);
        }
    }
    depths
}

/// Three digits are what is set at a machine.
fn rounded(value: f64) -> f64 {
    let scale = 10.0_f64.powf(2.0 - value.abs().max(f64::MIN_POSITIVE).log10().floor());
    if scale > 1.0 { (value * scale).round() / scale } else { (value * scale).round() * scale.recip().round() }
}

/// The ends of a range, and within it where lobes of the modes meet and where they are highest, modes by turns, fastest first, those of what
/// leads before those of what else may be right.
fn telling_speeds(cases: &[Case], slowest: f64, fastest: f64) -> Vec<f64> {
    let of_mode = |(case, mode): (&Case, &Mode)| {
        let one = 60.0 * mode.frequency_hz / case.milling.teeth.len() as f64;
        (2..=200_u32).map(|half| 2.0 * one / f64::from(half)).filter(|n| (slowest..=fastest).contains(n)).collect()
    };
    let modes = cases.iter().flat_map(|case| case.structure.modes.iter().map(move |mode| (case, mode)));
    let of_modes: Vec<Vec<f64>> = modes.map(of_mode).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_lie_between_the_limits_of_what_may_be_right() {
        let range = [0.1, 10.0];
        // One limit: on both sides of it.
        assert_eq!(telling_depths(&[2.0], range), [1.84, 2.16, 2.6]);
        assert!(telling_depths(&[], range).is_empty());
        // The leading one at 2, others at 1 and 4: between each two, about the leading one, beyond all.
        let depths = telling_depths(&[2.0, 4.0, 1.0], range);
        for wanted in [2.0_f64.sqrt(), 8.0_f64.sqrt(), 1.84, 2.16, 5.2] {
            assert!(depths.iter().any(|depth| (depth / wanted - 1.0).abs() < 1e-9), "{wanted}: {depths:?}");
        }
        // Limits within the scatter of a cut are one; what lies outside the range is at its end.
        assert_eq!(telling_depths(&[2.0, 2.02], range), telling_depths(&[2.0, 2.02, 1.99], range));
        assert_eq!(telling_depths(&[2.0], [0.1, 1.0]), [1.0]);
    }
}
