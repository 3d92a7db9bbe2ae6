//! Readings that stand off all around them: dirt, a scratch, a jump of the probe, the dip of the probe into a keyway.
//!
//! What the readings on one side lead to is their running median, carried on in a straight line. A spike stands off what
//! both sides lead to, the same way; a step stands off one of them, and form off both by what it bends, everywhere. It is
//! looked for in three widths (`roundness/2.2`).

use super::output::RoundnessSpike;
use crate::num::roundness::RoundnessError;

const UM_PER_MM: f64 = 1e3;
/// Widths of the spikes that are looked for: readings at least, and shares of all readings.
const LEAST_WIDTH: usize = 3;
const WIDTHS: [f64; 3] = [0.0, 0.012, 0.06];
/// Medians are taken of so many readings at most.
const MOST_IN_MEDIAN: usize = 400;
/// Fewest readings whose neighbours on both sides are not the same.
const FEWEST: usize = 24;
/// A reading this many standard deviations off what both sides lead to is no roughness.
const LIMIT: f64 = 8.0;
/// Standard deviations of a normal deviate at the quantiles that it is estimated from, which spikes do not move.
const QUANTILES: [(f64, f64); 2] = [(0.5, 0.674_49), (0.9, 1.644_85)];
/// A spike is this many times as high as readings usually step, one place of a rounded record among them.
const STEPS: f64 = 4.0;
/// What instruments resolve, mm.
const FINEST_MM: f64 = 2e-5;
/// Times that spikes are looked for beside those known.
const ROUNDS: usize = 4;
/// Largest share of the readings that can be spikes.
const MOST: f64 = 0.1;

/// Spikes among readings in order round the section: which readings make each.
///
/// A large one shadows those beside it. Once it is found a line takes its place, and what comes out then is found, too.
pub(super) fn spikes(distances_mm: &[f64], goes_on: &dyn Fn() -> bool) -> Result<Vec<Vec<usize>>, RoundnessError> {
    let n = distances_mm.len();
    if n < FEWEST {
        return Ok(Vec::new());
    }
    let mut off = vec![false; n];
    let mut bridged = distances_mm.to_vec();
    for _ in 0..ROUNDS {
        let found = of_round(&bridged, goes_on)?;
        if found.iter().flatten().all(|at| off[*at]) {
            break;
        }
        found.into_iter().flatten().for_each(|at| off[at] = true);
        // So many are no exception but the surface.
        if off.iter().filter(|off| **off).count() as f64 > MOST * n as f64 {
            return Ok(Vec::new());
        }
        bridged.copy_from_slice(distances_mm);
        for run in &runs(&off) {
            bridge(run, &mut bridged);
        }
    }
    Ok(runs(&off))
}

/// What stands off in readings in which the spikes known are bridged.
fn of_round(distances_mm: &[f64], goes_on: &dyn Fn() -> bool) -> Result<Vec<Vec<usize>>, RoundnessError> {
    let n = distances_mm.len();
    let mut off = vec![false; n];
    let mut widths: Vec<usize> = WIDTHS.iter().map(|share| at_share(*share, n).max(LEAST_WIDTH)).collect();
    widths.dedup();
    let step_mm = usual_step_mm(distances_mm);
    for width in widths {
        if !goes_on() {
            return Err(RoundnessError::Stopped);
        }
        let residuals = residuals_mm(distances_mm, width);
        let limit_mm = (LIMIT * deviation_mm(&residuals)).max(STEPS * step_mm).max(FINEST_MM);
        residuals.iter().zip(&mut off).filter(|(r, _)| r.abs() > limit_mm).for_each(|(_, off)| *off = true);
    }
    // Beside a large spike what a side leads to is off, too: what does not stand over its own neighbours is none.
    let least_mm = LIMIT * roughness_mm(distances_mm);
    let stands_out = |run: &Vec<usize>| peak(run, distances_mm).1.abs() > least_mm;
    Ok(runs(&off).into_iter().filter(stands_out).collect())
}

/// A straight line between the readings beside a run.
fn bridge(run: &[usize], distances_mm: &mut [f64]) {
    let n = distances_mm.len();
    let (before, after) = (distances_mm[(run[0] + n - 1) % n], distances_mm[(run[run.len() - 1] + 1) % n]);
    for (k, &at) in run.iter().enumerate() {
        let share = (k + 1) as f64 / (run.len() + 1) as f64;
        distances_mm[at] = before + share * (after - before);
    }
}

/// Standard deviation of the roughness from reading to reading, mm: by the median of second differences, which spikes do not
/// move.
fn roughness_mm(distances_mm: &[f64]) -> f64 {
    let n = distances_mm.len();
    let at = |i: usize| distances_mm[i % n];
    let mut bends: Vec<f64> = (0..n).map(|i| (at(i) - 2.0 * at(i + 1) + at(i + 2)).abs()).collect();
    bends.sort_by(f64::total_cmp);
    // A second difference of independent readings varies by sqrt(6) of one.
    bends[n / 2] / QUANTILES[0].1 / 6.0_f64.sqrt()
}

/// By how much each reading stands off what both sides lead to, mm; 0 where it lies between the two.
fn residuals_mm(distances_mm: &[f64], width: usize) -> Vec<f64> {
    let n = distances_mm.len();
    // Of many readings every so-manieth is taken.
    let stride = width.div_ceil(MOST_IN_MEDIAN);
    let taken: Vec<f64> = distances_mm.iter().copied().step_by(stride).collect();
    let medians = medians(&taken, width / (2 * stride));
    let turn = taken.len() as f64;
    let median = |at: f64| {
        let at = (at / stride as f64).rem_euclid(turn);
        let (below, share) = (floor(at).min(taken.len() - 1), at.fract());
        medians[below] * (1.0 - share) + medians[(below + 1) % medians.len()] * share
    };
    let (near, far) = (1.5 * width as f64, 3.0 * width as f64);
    (0..n)
        .map(|i| {
            let led_to = |side: f64| 2.0 * median(i as f64 + side * near) - median(i as f64 + side * far);
            let (left, right) = (distances_mm[i] - led_to(-1.0), distances_mm[i] - led_to(1.0));
            match left * right > 0.0 {
                true if left.abs() < right.abs() => left,
                true => right,
                false => 0.0,
            }
        })
        .collect()
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place from 0 to n")]
fn floor(at: f64) -> usize {
    at as usize
}

/// Running median of a closed row, `half` values on either side.
fn medians(values: &[f64], half: usize) -> Vec<f64> {
    let n = values.len();
    let half = half.min((n - 1) / 2);
    let mut window: Vec<f64> = (0..=2 * half).map(|i| values[(i + n - half) % n]).collect();
    window.sort_by(f64::total_cmp);
    (0..n)
        .map(|at| {
            let median = window[half];
            let (out, into) = (values[(at + n - half) % n], values[(at + half + 1) % n]);
            // Sorted by the same order, the one that leaves is found where it stands.
            window.remove(window.partition_point(|value| value.total_cmp(&out).is_lt()));
            window.insert(window.partition_point(|value| value.total_cmp(&into).is_lt()), into);
            median
        })
        .collect()
}

/// Standard deviation of what is no spike, mm.
fn deviation_mm(residuals_mm: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = residuals_mm.iter().map(|r| r.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    QUANTILES.iter().map(|(share, deviations)| sizes[at_share(*share, sizes.len())] / deviations).fold(0.0, f64::max)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of n")]
fn at_share(share: f64, n: usize) -> usize {
    ((share * n as f64) as usize).min(n - 1)
}

/// Median of the steps from reading to reading that are any, mm.
fn usual_step_mm(distances_mm: &[f64]) -> f64 {
    let n = distances_mm.len();
    let steps = (0..n).map(|i| (distances_mm[(i + 1) % n] - distances_mm[i]).abs());
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// Runs of marked readings, round the end too.
fn runs(off: &[bool]) -> Vec<Vec<usize>> {
    let n = off.len();
    let Some(start) = off.iter().position(|off| !off) else { return Vec::new() };
    let mut runs: Vec<Vec<usize>> = Vec::new();
    let mut open = false;
    for at in (start..start + n).map(|at| at % n) {
        match (off[at], open) {
            (true, true) => runs.last_mut().into_iter().for_each(|run| run.push(at)),
            (true, false) => runs.push(vec![at]),
            (false, _) => {}
        }
        open = off[at];
    }
    runs
}

/// The highest reading of a run over a line between the readings beside it, and how high it is, mm.
fn peak(run: &[usize], distances_mm: &[f64]) -> (usize, f64) {
    let n = distances_mm.len();
    let (first, last) = (run[0], run[run.len() - 1]);
    let (before, after) = (distances_mm[(first + n - 1) % n], distances_mm[(last + 1) % n]);
    let height = |(k, &at): (usize, &usize)| {
        let share = (k + 1) as f64 / (run.len() + 1) as f64;
        (at, distances_mm[at] - (before + share * (after - before)))
    };
    run.iter().enumerate().map(height).max_by(|p, q| p.1.abs().total_cmp(&q.1.abs())).unwrap_or((first, 0.0))
}

/// A spike as the contract has it.
pub(super) fn told(run: &[usize], angles_deg: &[f64], distances_mm: &[f64], rows: &[usize]) -> RoundnessSpike {
    let n = distances_mm.len();
    let (first, last) = (run[0], run[run.len() - 1]);
    let (peak, height_mm) = peak(run, distances_mm);
    RoundnessSpike {
        row: rows[peak],
        angle_deg: angles_deg[peak],
        width_deg: (angles_deg[(last + 1) % n] - angles_deg[(first + n - 1) % n]).rem_euclid(360.0),
        points: run.len(),
        height_um: UM_PER_MM * height_mm,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use std::f64::consts::TAU;

    /// Readings with four lobes, and a noise of 0.1 um that is always the same.
    fn readings(n: u32) -> Vec<f64> {
        let noise =
            |i: u32| 1e-4 * ((f64::from(i) * 0.754_877_666).fract() + (f64::from(i) * 0.569_840_291).fract() - 1.0);
        (0..n).map(|i| 20.0 + 0.003 * (4.0 * TAU * f64::from(i) / f64::from(n)).cos() + noise(i)).collect()
    }

    #[test]
    fn form_noise_and_a_step_are_no_spikes() {
        for n in [36, 120, 720, 3600] {
            assert!(spikes(&readings(n), &|| true).unwrap().is_empty(), "{n}");
            // Wider than any spike on both sides: a closed record that steps up steps down again.
            let half = n as usize / 2;
            let stepped: Vec<f64> =
                readings(n).iter().enumerate().map(|(i, r)| if i > half { r + 0.002 } else { *r }).collect();
            assert!(spikes(&stepped, &|| true).unwrap().is_empty(), "{n}");
            let rounded: Vec<f64> = readings(n).iter().map(|r| (r * 1e4).round() / 1e4).collect();
            assert!(spikes(&rounded, &|| true).unwrap().is_empty(), "{n}");
        }
    }

    #[test]
    fn grains_scratches_and_a_keyway_are_found_where_they_are() {
        for n in [120_usize, 720, 3600] {
            let mut readings = readings(u32::try_from(n).unwrap_or(0));
            readings[0] += 0.012;
            readings[n / 3] -= 0.01;
            readings[n / 3 + 1] -= 0.01;
            let keyway: Vec<usize> = (n / 2..n / 2 + n / 20).collect();
            for at in &keyway {
                readings[*at] -= 2.0;
            }
            let found = spikes(&readings, &|| true).unwrap();
            assert_eq!(found, [vec![n / 3, n / 3 + 1], keyway, vec![0]], "{n}");
        }
    }
}
