//! What comes out against what was meant, along the contour.

use super::super::stock::{Part, SAME_MM};
use super::yielded::Yielded;

/// Places stand no farther apart than this, mm.
const APART_MM: f64 = 2.0;
/// Most places of a part.
const MOST_PLACES: f64 = 400.0;
/// Nothing is said nearer to a step, mm.
const FROM_STEP_MM: f64 = 0.02;
/// A surface that is steeper is a shoulder.
const STEEPEST: f64 = 3.0;
/// What comes off a straight line between places by more gets one of its own, um.
const STRAIGHT_UM: f64 = 0.05;
const UM_PER_MM: f64 = 1e3;

/// The error of the diameter at a place of the contour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContourError {
    pub(crate) line: usize,
    pub(crate) z_mm: f64,
    /// Diameter that the program means, mm.
    pub(crate) diameter_mm: f64,
    pub(crate) error_um: f64,
}

/// The error along what the program makes of the contour.
pub(crate) fn contour(yielded: &Yielded) -> Vec<ContourError> {
    between(&yielded.nominal, &yielded.real)
}

/// The error of an outline along what a program makes of another one.
pub(crate) fn between(nominal: &[Part], real: &[Part]) -> Vec<ContourError> {
    let mut found = Vec::new();
    for part in nominal {
        if let Some(line) = part.owner {
            along_part(part, line, real, &mut found);
        }
    }
    found
}

fn along_part(part: &Part, line: usize, real: &[Part], into: &mut Vec<ContourError>) {
    let [from, to] = [part.piece.x0 + FROM_STEP_MM, part.piece.x1 - FROM_STEP_MM];
    let length = to - from;
    let middle = part.piece.curve.at(0.5 * (from + to));
    if length <= 0.0 || middle <= SAME_MM {
        return;
    }
    let error = |z_mm: f64| {
        let radius = part.piece.curve.at(z_mm);
        ContourError {
            line,
            z_mm,
            diameter_mm: 2.0 * radius,
            error_um: 2.0 * UM_PER_MM * (radius_at(real, z_mm) - radius),
        }
    };
    let is_steep = |z: f64| {
        let step = 1e-4 * length.min(1.0);
        (part.piece.curve.at(z + step) - part.piece.curve.at(z - step)).abs() > 2.0 * step * STEEPEST
    };
    let count = (length / APART_MM).ceil().clamp(2.0, MOST_PLACES);
    // At most MOST_PLACES.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let places: Vec<ContourError> = (0..=count as usize).map(|i| error(from + length * (i as f64 / count))).collect();
    let first = real.partition_point(|part| part.piece.x1 <= from);
    let mut breaks = real[first..].iter().map(|part| part.piece.x1).take_while(|x| *x < to).peekable();
    for (i, place) in places.iter().enumerate() {
        if let Some(before) = i.checked_sub(1).map(|i| places[i]) {
            let bent = |at: &ContourError| {
                let share = (at.z_mm - before.z_mm) / (place.z_mm - before.z_mm);
                (at.error_um - before.error_um - share * (place.error_um - before.error_um)).abs() > STRAIGHT_UM
            };
            while let Some(x) = breaks.next_if(|x| *x < place.z_mm) {
                let beside = [x - 1e-6, x + 1e-6].map(error);
                into.extend(beside.into_iter().filter(|at| at.z_mm > before.z_mm && bent(at) && !is_steep(at.z_mm)));
            }
        }
        if !is_steep(place.z_mm) {
            into.push(*place);
        }
    }
}

/// Radius of an outline at a place, mm.
pub(crate) fn radius_at(parts: &[Part], x: f64) -> f64 {
    let at = parts.partition_point(|part| part.piece.x1 < x).min(parts.len().saturating_sub(1));
    parts.get(at).map_or(0.0, |part| part.piece.curve.at(x))
}
