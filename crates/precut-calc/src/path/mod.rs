//! Tool paths as polylines: fewest chords, rounding to the machine's increment, what is lost by both.
//!
//! Pure geometry over stations z and radii r; the words of a machine are made elsewhere. Equations
//! `deflection/7`.

mod blocks;
mod chords;

pub use chords::{fewest_chords, fewest_chords_watched};

use crate::calculator::{Failure, Monitor};

/// A profile as few straight motions, in the machine's increments.
#[derive(Debug, Clone, PartialEq)]
pub struct Polyline {
    /// Stations that became vertices, ascending; the first and the last are among them.
    pub vertices: Vec<usize>,
    /// Diameter at each vertex, mm, a multiple of the increment.
    pub diameters_mm: Vec<f64>,
    /// Largest radial distance from the exact profile at any station, mm, rounding included; at most
    /// [`deviation_budget`].
    pub deviation_mm: f64,
}

/// Up to so many stations the chords are balanced; beyond, the search costs more than it gives.
const BALANCED_STATIONS: usize = 2000;
/// Halvings of the tolerance's interval when chords are balanced: the deviation is least to a 32nd of the tolerance.
const BALANCING_STEPS: u32 = 5;

/// The fewest chords that follow the radii `r_mm` over the ascending stations `z_mm` within
/// `tolerance_mm`, and of paths with so few chords (up to 2000 stations) nearly the one with the least
/// deviation; their ends rounded to `increment_mm` on the diameter. Fails only by cancellation.
pub fn simplified(
    z_mm: &[f64],
    r_mm: &[f64],
    tolerance_mm: f64,
    increment_mm: f64,
    monitor: &dyn Monitor,
) -> Result<Polyline, Failure> {
    let vertices = balanced(z_mm, r_mm, tolerance_mm, monitor)?;
    let diameters_mm: Vec<f64> =
        vertices.iter().map(|&vertex| round_to_increment(2.0 * r_mm[vertex], increment_mm)).collect();
    let deviation_mm = achieved_deviation(z_mm, r_mm, &vertices, &diameters_mm);
    Ok(Polyline { vertices, diameters_mm, deviation_mm })
}

/// Fewest chords, by bisection at the smallest tolerance that needs no more of them.
fn balanced(z_mm: &[f64], r_mm: &[f64], tolerance_mm: f64, monitor: &dyn Monitor) -> Result<Vec<usize>, Failure> {
    let mut vertices = fewest_chords_watched(z_mm, r_mm, tolerance_mm, monitor)?;
    if z_mm.len() > BALANCED_STATIONS || vertices.len() <= 2 {
        return Ok(vertices);
    }
    let (mut too_fine, mut fine) = (0.0, tolerance_mm);
    for _ in 0..BALANCING_STEPS {
        let middle = f64::midpoint(too_fine, fine);
        let tried = fewest_chords_watched(z_mm, r_mm, middle, monitor)?;
        if tried.len() > vertices.len() {
            too_fine = middle;
        } else {
            fine = middle;
            vertices = tried;
        }
    }
    Ok(vertices)
}

/// Largest radial deviation, mm, that chords within `tolerance_mm` have after their ends were rounded
/// to `increment_mm` on the diameter: the tolerance and a quarter of the increment.
pub fn deviation_budget(tolerance_mm: f64, increment_mm: f64) -> f64 {
    tolerance_mm + 0.25 * increment_mm
}

/// `value` as the nearest multiple of `increment`, ties away from zero.
///
/// A value within rounding of a tie is one: 0.0005 is no tie in binary, but means one. The result is
/// the double nearest to the decimal number. An increment that is not positive changes nothing.
pub fn round_to_increment(value: f64, increment: f64) -> f64 {
    let valid = increment.is_finite() && increment > 0.0 && value.is_finite();
    let count = value / increment;
    if !valid || !count.is_finite() {
        return value;
    }
    let count = (count * (1.0 + 2.0 * f64::EPSILON)).round();
    let per_unit = (1.0 / increment).round();
    // 89885/1000 is the double nearest to 89.885; 89885 times 0.001 need not be.
    let decimal = per_unit >= 1.0 && (per_unit * increment - 1.0).abs() <= 2.0 * f64::EPSILON;
    if decimal { count / per_unit } else { count * increment }
}

/// Largest radial distance, mm, of the polyline through `vertices` with `diameters_mm` from the radii
/// `r_mm`, over all stations between its ends; 0 without vertices.
pub fn achieved_deviation(z_mm: &[f64], r_mm: &[f64], vertices: &[usize], diameters_mm: &[f64]) -> f64 {
    let at_vertices =
        vertices.iter().zip(diameters_mm).map(|(&vertex, diameter)| (0.5 * diameter - r_mm[vertex]).abs());
    let worst = at_vertices.fold(0.0, f64::max);
    vertices.windows(2).zip(diameters_mm.windows(2)).fold(worst, |worst, (ends, diameters)| {
        let (from, to) = (ends[0], ends[1]);
        let slope = 0.5 * (diameters[1] - diameters[0]) / (z_mm[to] - z_mm[from]);
        (from + 1..to)
            .map(|k| (0.5 * diameters[0] + slope * (z_mm[k] - z_mm[from]) - r_mm[k]).abs())
            .fold(worst, f64::max)
    })
}
