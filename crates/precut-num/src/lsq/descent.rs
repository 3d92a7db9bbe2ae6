//! Levenberg-Marquardt with geodesic acceleration.

use super::Settings;
use super::bounds::{free, held, project};
use super::system::{Point, Quality, System, Tangent};
use crate::dense::{Columns, Qr, length};

/// Damping at the start, in units of the columns' squared lengths.
pub(super) const FIRST_DAMPING: f64 = 1e-3;
/// Damping of the second try: short steps down the slope at first.
pub(super) const SECOND_DAMPING: f64 = 10.0;
const LEAST_DAMPING: f64 = 1e-16;
const MOST_DAMPING: f64 = 1e30;
/// A column's scale follows its length down at most by this factor per step: following at once runs away along
/// parameters that lose influence, not following at all crawls after a start far outside.
const SCALE_MEMORY: f64 = 0.5;
/// Second-order correction over first-order step, twice: above it the path bends too much for the step.
const MOST_BEND: f64 = 0.75;
/// Share of the step at which the bending is measured.
const BEND_STEP: f64 = 0.1;

/// Where the descent ended.
pub(super) struct Descended {
    pub(super) point: Point,
    pub(super) iterations: u32,
    pub(super) stopped: bool,
    /// The steps allowed were used up.
    pub(super) exhausted: bool,
}

/// Goes down until a step promises less than the rounding of the objective.
pub(super) fn descend(system: &mut System<'_>, settings: &Settings<'_>, damping: f64) -> Descended {
    let mut point = system.start();
    let ended = |point: Point, iterations, stopped, exhausted| Descended { point, iterations, stopped, exhausted };
    let Some(mut tangent) = system.tangent(&point, Quality::Plain) else { return ended(point, 0, false, false) };
    let mut scales = positive(tangent.columns.lengths());
    let (mut damping, mut raise) = (damping, 2.0);
    for iteration in 0..settings.max_iterations {
        if settings.stop.is_some_and(|stop| stop()) {
            return ended(point, iteration, true, false);
        }
        let trial = Trial::new(system, &point, &tangent, &scales, damping);
        let Some(trial) = trial else { return ended(point, iteration, false, false) };
        let taken = trial.next(system, &point, &tangent);
        let negligible = trial.promise <= f64::EPSILON * point.objective && damping < 1.0;
        let tiny = trial.is_tiny(&point, &scales);
        let accepted = taken.and_then(|next| {
            let gain = system.fall(&point, &next) / trial.promised(&point, &next, &tangent);
            let finite = next.objective.is_finite();
            let slopes = (finite && gain > 0.0).then(|| system.tangent(&next, Quality::Plain))??;
            Some((next, slopes, gain))
        });
        if let Some((next, slopes, gain)) = accepted {
            (point, tangent) = (next, slopes);
            for (scale, now) in scales.iter_mut().zip(tangent.columns.lengths()) {
                *scale = (*scale * SCALE_MEMORY).max(now);
            }
            scales = positive(scales);
            let bend = 2.0 * gain - 1.0;
            damping = (damping * (1.0 - bend * bend * bend).max(1.0 / 3.0)).max(LEAST_DAMPING);
            raise = 2.0;
        } else {
            damping *= raise;
            raise *= 2.0;
        }
        if negligible || tiny || damping > MOST_DAMPING {
            return ended(point, iteration + 1, false, false);
        }
    }
    ended(point, settings.max_iterations, false, true)
}

fn positive(mut scales: Vec<f64>) -> Vec<f64> {
    for scale in &mut scales {
        if *scale <= 0.0 || !scale.is_finite() {
            *scale = 1.0;
        }
    }
    scales
}

/// A damped step from a point.
struct Trial {
    free: Vec<usize>,
    /// Factors of the free columns over their scales, and of these with the damping below.
    plain: Qr,
    damped: Qr,
    /// Step in scaled coordinates.
    step: Vec<f64>,
    scales: Vec<f64>,
    /// Fall of the objective that the tangent promises for the whole step.
    promise: f64,
}

impl Trial {
    /// `None` where every parameter is held.
    fn new(system: &System<'_>, point: &Point, tangent: &Tangent, scales: &[f64], damping: f64) -> Option<Self> {
        let slope = tangent.columns.transposed_times(&tangent.residuals);
        let free = free(&held(&point.at, &slope, system.parameters));
        if free.is_empty() {
            return None;
        }
        let scales: Vec<f64> = free.iter().map(|&j| scales[j]).collect();
        let mut columns = tangent.columns.take_columns(&free);
        for (j, scale) in scales.iter().enumerate() {
            for entry in columns.column_mut(j) {
                *entry /= scale;
            }
        }
        let plain = Qr::new(columns);
        let mut rotated = tangent.residuals.clone();
        plain.to_factors(&mut rotated);
        rotated.truncate(free.len());
        let damped = Qr::new(stacked(&plain, damping.sqrt()));
        let step: Vec<f64> = solve(&damped, &rotated);
        let moved = plain.times_upper(&step);
        // |r|^2 - |r + J p|^2 of the damped solution, without the difference.
        let promise =
            moved.iter().map(|m| m * m).sum::<f64>() + 2.0 * damping * step.iter().map(|s| s * s).sum::<f64>();
        Some(Self { free, plain, damped, step, scales, promise })
    }

    /// The point after the step with its second-order correction; `None` where the path bends too much.
    fn next(&self, system: &mut System<'_>, point: &Point, tangent: &Tangent) -> Option<Point> {
        let first = self.spread(point, &self.step, 1.0);
        let probe = self.spread(point, &self.step, BEND_STEP);
        let mut to = first.clone();
        let inside = !project(&mut to, system.parameters) && {
            let mut probe = probe.clone();
            !project(&mut probe, system.parameters)
        };
        if inside {
            let mut ahead = system.raw(&probe);
            if ahead.iter().any(|r| !r.is_finite()) {
                return None;
            }
            // r'' = 2/h ((r(b + h p) - r)/h - J p)
            system.weigh(point, &mut ahead);
            let moved: Vec<f64> = first.iter().zip(&point.at).map(|(to, from)| to - from).collect();
            let linear = tangent.columns.times(&moved);
            let mut bend: Vec<f64> = ahead
                .iter()
                .zip(&tangent.residuals)
                .zip(&linear)
                .map(|((ahead, now), linear)| 2.0 / BEND_STEP * ((ahead - now) / BEND_STEP - linear))
                .collect();
            self.plain.to_factors(&mut bend);
            bend.truncate(self.free.len());
            let correction: Vec<f64> = solve(&self.damped, &bend).iter().map(|a| 0.5 * a).collect();
            if 2.0 * length(&correction) > MOST_BEND * length(&self.step) {
                return None;
            }
            for ((&j, a), scale) in self.free.iter().zip(&correction).zip(&self.scales) {
                to[j] += a / scale;
            }
            project(&mut to, system.parameters);
        }
        Some(system.point(to))
    }

    /// Fall that the tangent promises: of the whole step, or of what the bounds left of it.
    fn promised(&self, from: &Point, to: &Point, tangent: &Tangent) -> f64 {
        let whole = self.spread(from, &self.step, 1.0);
        let cut = self.free.iter().any(|&j| (whole[j] - to.at[j]).abs() > 0.5 * (whole[j] - from.at[j]).abs());
        if !cut {
            return self.promise;
        }
        let moved: Vec<f64> = to.at.iter().zip(&from.at).map(|(to, from)| to - from).collect();
        let linear = tangent.columns.times(&moved);
        let fall: f64 = linear.iter().zip(&tangent.residuals).map(|(l, r)| -l * (2.0 * r + l)).sum();
        // What promises nothing is refused by a gain below any bound.
        if fall > 0.0 { fall } else { -f64::MIN_POSITIVE }
    }

    fn spread(&self, point: &Point, step: &[f64], share: f64) -> Vec<f64> {
        let mut at = point.at.clone();
        for ((&j, step), scale) in self.free.iter().zip(step).zip(&self.scales) {
            at[j] += share * step / scale;
        }
        at
    }

    /// Whether the step is lost in the digits of the parameters.
    fn is_tiny(&self, point: &Point, scales: &[f64]) -> bool {
        let sizes: Vec<f64> = self.free.iter().map(|&j| point.at[j] * scales[j]).collect();
        length(&self.step) <= 1e-12 * length(&sizes)
    }
}

/// R over the damping.
fn stacked(plain: &Qr, root: f64) -> Columns {
    let count = plain.count();
    let height = count.min(plain.rows());
    let mut stack = Columns::zeros(height + count, count);
    for j in 0..count {
        for i in 0..=j.min(height.saturating_sub(1)) {
            stack.set(i, j, plain.r(i, j));
        }
        stack.set(height + j, j, root);
    }
    stack
}

/// Step against `rotated` in the damped system.
fn solve(damped: &Qr, rotated: &[f64]) -> Vec<f64> {
    let mut side: Vec<f64> = rotated.iter().map(|r| -r).collect();
    side.resize(damped.rows(), 0.0);
    damped.solve(&side)
}
