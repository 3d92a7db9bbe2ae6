//! A profile as a roundness tester sees it.

use crate::calculator::{Failure, Finding, Monitor, checkpoint};
use crate::num::roundness::{
    Circles, Evaluation, Filter, Grid, Harmonic, RoundnessError, Section, evaluate, least_squares,
};

use crate::ring_roundness::answer::output::{CircleValues, Evaluated};
use crate::ring_roundness::job::input::LongWave;

pub(in crate::ring_roundness) const UM_PER_MM: f64 = 1e3;

/// The filter of a job.
pub(in crate::ring_roundness) fn filter_of(filter: LongWave) -> Filter {
    match filter.cutoff_upr() {
        None => Filter::None,
        Some(cutoff) => Filter::LowPass { cutoff_upr: f64::from(cutoff) },
    }
}

/// A profile on uniform angles with everything evaluated of it.
#[derive(Debug, Clone)]
pub(in crate::ring_roundness) struct Surface {
    pub evaluation: Evaluation,
    pub evaluated: Evaluated,
}

/// Of radii at uniform angles.
pub(in crate::ring_roundness) fn of_radii(
    radii_mm: &[f64],
    filter: LongWave,
    highest: u32,
    monitor: &dyn Monitor,
) -> Result<Surface, Failure> {
    let grid = Grid::new(radii_mm.len()).map_err(unevaluable)?;
    let section = grid.section(radii_mm).map_err(unevaluable)?;
    of_section(&section, &grid, filter, highest, monitor)
}

/// Of points that follow each other counter-clockwise.
pub(in crate::ring_roundness) fn of_section(
    section: &Section,
    grid: &Grid,
    filter: LongWave,
    highest: u32,
    monitor: &dyn Monitor,
) -> Result<Surface, Failure> {
    let goes_on = || !monitor.cancelled();
    let evaluation = evaluate(section, grid, filter_of(filter), highest as usize, &goes_on).map_err(unevaluable)?;
    let evaluated = Evaluated {
        mean_radius_mm: evaluation.unfiltered.least_squares.circle.radius_mm,
        unfiltered: values(&evaluation.unfiltered),
        filtered: values(&evaluation.filtered),
    };
    Ok(Surface { evaluation, evaluated })
}

impl Surface {
    /// Deviations of the referred profile from the least-squares circle, um.
    pub(in crate::ring_roundness) fn deviations_um(&self) -> Vec<f64> {
        about_mean(&self.evaluation.referred_mm)
    }
    /// The same after the filter.
    pub(in crate::ring_roundness) fn filtered_um(&self) -> Vec<f64> {
        about_mean(&self.evaluation.filtered_profile_mm)
    }
    /// The harmonic of an order from 2.
    pub(in crate::ring_roundness) fn harmonic(&self, order: u32) -> Option<Harmonic> {
        self.evaluation.spectrum.iter().find(|harmonic| harmonic.order == order as usize).copied()
    }
}

fn about_mean(radii_mm: &[f64]) -> Vec<f64> {
    let mean = radii_mm.iter().sum::<f64>() / radii_mm.len().max(1) as f64;
    radii_mm.iter().map(|radius| (radius - mean) * UM_PER_MM).collect()
}

fn values(circles: &Circles) -> CircleValues {
    let least = &circles.least_squares;
    let um = |mm: f64| mm * UM_PER_MM;
    CircleValues {
        least_squares_um: um(least.span.width_mm()),
        minimum_zone_um: um(circles.minimum_zone.width_mm()),
        inscribed_um: um(circles.inscribed.span.width_mm()),
        circumscribed_um: um(circles.circumscribed.span.width_mm()),
        peak_um: um(least.peak_mm),
        valley_um: um(least.valley_mm),
        rms_um: um(least.rms_mm),
    }
}

/// |p - q| times its factor, value by value: the largest over all q.
pub(in crate::ring_roundness) fn difference(p: &Evaluated, others: &[(&Evaluated, f64)]) -> Evaluated {
    let by = |of: &dyn Fn(&Evaluated) -> f64| {
        others.iter().map(|(q, factor)| factor * (of(p) - of(q)).abs()).fold(0.0, f64::max)
    };
    let circles = |of: &dyn Fn(&Evaluated) -> &CircleValues| CircleValues {
        least_squares_um: by(&|e| of(e).least_squares_um),
        minimum_zone_um: by(&|e| of(e).minimum_zone_um),
        inscribed_um: by(&|e| of(e).inscribed_um),
        circumscribed_um: by(&|e| of(e).circumscribed_um),
        peak_um: by(&|e| of(e).peak_um),
        valley_um: by(&|e| of(e).valley_um),
        rms_um: by(&|e| of(e).rms_um),
    };
    Evaluated {
        mean_radius_mm: by(&|e| e.mean_radius_mm),
        unfiltered: circles(&|e| &e.unfiltered),
        filtered: circles(&|e| &e.filtered),
    }
}

/// Peak to valley about the least-squares circle after the filter, um, of radii at uniform angles: what the search asks.
pub(in crate::ring_roundness) fn roundness_um(
    radii_mm: &[f64],
    filter: LongWave,
    monitor: &dyn Monitor,
) -> Result<(f64, f64), Failure> {
    let goes_on = || !monitor.cancelled();
    let grid = Grid::new(radii_mm.len()).map_err(unevaluable)?;
    let section = grid.section(radii_mm).map_err(unevaluable)?;
    let circle = least_squares(&section, &goes_on).map_err(unevaluable)?;
    let Filter::LowPass { .. } = filter_of(filter) else {
        return Ok((circle.span.width_mm() * UM_PER_MM, circle.circle.radius_mm));
    };
    let referred =
        crate::num::roundness::refer(&section, circle.circle.centre_mm, radii_mm.len()).map_err(unevaluable)?;
    checkpoint(monitor)?;
    let filtered = grid.filtered(&referred, filter_of(filter)).map_err(unevaluable)?;
    let found = least_squares(&grid.section(&filtered).map_err(unevaluable)?, &goes_on).map_err(unevaluable)?;
    Ok((found.span.width_mm() * UM_PER_MM, circle.circle.radius_mm))
}

/// The mean radius with the odd waves from 3 on, of radii at an even number of uniform angles: what a tool opposite to a
/// support does not see (`ring/5.4`).
pub(in crate::ring_roundness) fn odd_waves_mm(radii_mm: &[f64]) -> Vec<f64> {
    let n = radii_mm.len();
    let mean = radii_mm.iter().sum::<f64>() / n as f64;
    let mut odd: Vec<f64> = (0..n).map(|i| 0.5 * (radii_mm[i] - radii_mm[(i + n / 2) % n])).collect();
    let direction = |i: usize| (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
    let (mut x, mut y) = (0.0, 0.0);
    for (i, value) in odd.iter().enumerate() {
        let (sin, cos) = direction(i);
        x += value * cos * 2.0 / n as f64;
        y += value * sin * 2.0 / n as f64;
    }
    for (i, value) in odd.iter_mut().enumerate() {
        let (sin, cos) = direction(i);
        *value += mean - x * cos - y * sin;
    }
    odd
}

/// A profile that has no reference circles: torn, or the origin is not inside.
pub(in crate::ring_roundness) fn unevaluable(error: RoundnessError) -> Failure {
    if error == RoundnessError::Stopped {
        return Failure::Cancelled;
    }
    Failure::OutOfModel(Finding::new("profile_not_evaluable", "").with("reason", error.to_string()))
}
