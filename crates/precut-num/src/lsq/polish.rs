//! The last digits.

use super::bounds::{free, held, project};
use super::descent::Descended;
use super::system::{Point, Quality, System, Tangent};
use super::{Ending, Fit};
use crate::dense::{Qr, length};

/// Most steps.
const STEPS: u32 = 60;
/// Steps in a row that may be longer than the shortest before.
const LONGER: u32 = 2;
/// The objective may rise by its own rounding.
const ROUNDING: f64 = 1e-10;
/// Relative offset at which a fit has converged.
const CONVERGED_OFFSET: f64 = 1e-6;
/// Step, as a share of the parameters, at which it has converged as well (fits without residual).
const CONVERGED_STEP: f64 = 1e-9;
/// A standard error of so many times the parameter's size: the data do not determine it.
const UNDETERMINED: f64 = 1e6;

/// Undamped steps as long as they get shorter, then the verdict.
pub(super) fn polish(system: &mut System<'_>, from: Descended) -> Fit {
    system.forget_steps();
    let Descended { mut point, stopped, exhausted, .. } = from;
    let Some(mut tangent) = system.tangent(&point, Quality::Best) else {
        return undefined(system, point, if stopped { Ending::Stopped } else { Ending::Stalled });
    };
    let mut newton = Newton::new(system, &point, &tangent);
    if !stopped {
        // Where steps shrink slowly one may be longer than the last for once; the shortest counts.
        let mut ahead = (point.clone(), tangent.clone(), newton.clone());
        let mut longer = 0;
        for _ in 0..STEPS {
            let next = ahead.2.next(system, &ahead.0);
            let worse = system.fall(&point, &next) < -ROUNDING * point.objective;
            if worse || !next.objective.is_finite() {
                break;
            }
            let Some(slopes) = system.tangent(&next, Quality::Best) else { break };
            let following = Newton::new(system, &next, &slopes);
            if following.held != newton.held {
                break;
            }
            ahead = (next, slopes, following);
            if ahead.2.size < newton.size {
                (point, tangent, newton) = ahead.clone();
                longer = 0;
            } else {
                longer += 1;
            }
            if longer > LONGER || newton.size == 0.0 {
                break;
            }
        }
    }
    let ending = if stopped {
        Ending::Stopped
    } else if !newton.undetermined.is_empty() {
        Ending::Undetermined
    } else if newton.offset <= CONVERGED_OFFSET || newton.share <= CONVERGED_STEP {
        Ending::Converged
    } else if exhausted {
        Ending::IterationLimit
    } else {
        Ending::Stalled
    };
    verdict(system, point, tangent, newton, ending)
}

/// Nothing was done.
pub(super) fn at_start(system: &mut System<'_>) -> Fit {
    let point = system.start();
    undefined(system, point, Ending::Stalled)
}

fn undefined(system: &System<'_>, point: Point, ending: Ending) -> Fit {
    let count = point.at.len();
    let tangent =
        Tangent { residuals: point.raw.clone(), columns: crate::dense::Columns::zeros(point.raw.len(), count) };
    let newton = Newton {
        step: Vec::new(),
        free: Vec::new(),
        held: vec![false; count],
        size: f64::INFINITY,
        share: f64::INFINITY,
        offset: f64::INFINITY,
        undetermined: (0..count).collect(),
    };
    verdict(system, point, tangent, newton, ending)
}

fn verdict(system: &System<'_>, point: Point, tangent: Tangent, newton: Newton, ending: Ending) -> Fit {
    let data_count = system.data_count();
    let mut residuals = point.raw;
    residuals.truncate(data_count);
    Fit {
        objective: point.objective,
        sum_of_squares: residuals.iter().map(|r| r * r).sum(),
        parameters: point.at,
        residuals,
        ending,
        relative_offset: newton.offset,
        at_bound: newton.held,
        undetermined: newton.undetermined,
        iterations: 0,
        evaluations: 0,
        jacobian: tangent.columns,
        weighted: tangent.residuals,
        data_count,
    }
}

/// The undamped step from a point and what it says of the point.
#[derive(Clone)]
struct Newton {
    step: Vec<f64>,
    free: Vec<usize>,
    held: Vec<bool>,
    /// Length of the step, in residuals.
    size: f64,
    /// The step as a share of the parameters, the largest.
    share: f64,
    /// Relative offset.
    offset: f64,
    undetermined: Vec<usize>,
}

/// Columns that others of the same matrix can replace; none at full rank.
fn dependent(qr: &Qr) -> Vec<usize> {
    let rank = qr.rank(f64::EPSILON);
    let mut lost = Vec::new();
    for k in rank..qr.count() {
        lost.push(qr.order()[k]);
        let mut shares: Vec<f64> = (0..rank).map(|i| qr.r(i, k)).collect();
        qr.solve_upper(&mut shares);
        // Columns have unit length or none; a share below this is rounding.
        lost.extend(shares.iter().enumerate().filter(|(_, share)| share.abs() > 1e-6).map(|(i, _)| qr.order()[i]));
    }
    lost
}

impl Newton {
    fn new(system: &System<'_>, point: &Point, tangent: &Tangent) -> Self {
        let slope = tangent.columns.transposed_times(&tangent.residuals);
        let held = held(&point.at, &slope, system.parameters);
        let free = free(&held);
        let mut columns = tangent.columns.take_columns(&free);
        let lengths = columns.lengths();
        for (j, size) in lengths.iter().enumerate() {
            for entry in columns.column_mut(j) {
                *entry /= if *size > 0.0 { *size } else { 1.0 };
            }
        }
        let rows = columns.rows();
        let qr = Qr::pivoted(columns);
        let mut rotated: Vec<f64> = tangent.residuals.iter().map(|r| -r).collect();
        qr.to_factors(&mut rotated);
        let count = free.len();
        let (inside, outside) = rotated.split_at(count.min(rows));
        let (tangential, normal) = (length(inside), length(outside));
        let noise = normal / ((rows - inside.len()).max(1) as f64).sqrt();
        let scaled = qr.solve(&tangent.residuals.iter().map(|r| -r).collect::<Vec<_>>());
        let step: Vec<f64> = scaled.iter().zip(&lengths).map(|(s, l)| if *l > 0.0 { s / l } else { 0.0 }).collect();
        let inverse = qr.inverse_gram();
        let lost = dependent(&qr);
        let mut undetermined = Vec::new();
        for (k, &j) in free.iter().enumerate() {
            let sd = noise * inverse.at(k, k).max(0.0).sqrt() / lengths[k];
            let size = point.at[j].abs().max(system.parameters[j].scale());
            let unknown = if lost.is_empty() { sd.is_nan() || sd > UNDETERMINED * size } else { lost.contains(&k) };
            if lengths[k] == 0.0 || unknown {
                undetermined.push(j);
            }
        }
        let share = step.iter().zip(&free).map(|(s, &j)| s.abs() / system.scale(&point.at, j)).fold(0.0, f64::max);
        let offset = if tangential == 0.0 { 0.0 } else { tangential / (count.max(1) as f64).sqrt() / noise };
        // With as many equations as parameters there is no noise to measure by.
        let offset = if offset.is_finite() { offset } else { f64::MAX };
        Self { step, free, held, size: length(&scaled), share, offset, undetermined }
    }

    fn next(&self, system: &mut System<'_>, point: &Point) -> Point {
        let mut at = point.at.clone();
        for (&j, step) in self.free.iter().zip(&self.step) {
            at[j] += step;
        }
        project(&mut at, system.parameters);
        system.point(at)
    }
}
