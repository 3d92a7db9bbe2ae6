//! What bends: the section ahead of the tool as it was before the move, behind it as it is after it (`program/4.6`).

use crate::deflection_compensation::Slice;

use super::super::stock::{Chain, Part, SAME_MM};

/// A slice that tapers becomes thinner by no more than this share.
const TAPER_OF_SLICE: f64 = 0.01;
/// Most slices of a part.
const MOST_SLICES: f64 = 400.0;
/// What is left of work that is turned away bends as a wire of this diameter, mm: no tool pushes there.
const LEAST_MM: f64 = 0.2;

/// Slices from the headstock end.
pub(crate) fn slices(before: &Chain, after: &Chain, bore_mm: f64) -> Vec<Slice> {
    let (before, after) = (before.parts(), after.parts());
    let mut cuts: Vec<f64> = before.iter().chain(&after).flat_map(|part| [part.piece.x0, part.piece.x1]).collect();
    cuts.sort_by(f64::total_cmp);
    cuts.dedup_by(|later, kept| *later - *kept <= 1e3 * SAME_MM);
    let (mut i, mut j) = (0, 0);
    let mut slices: Vec<Slice> = Vec::with_capacity(cuts.len() + 1);
    // A blank that begins behind the headstock end is as thick before.
    if let (Some(&first), Some(ahead), Some(behind)) = (cuts.first(), before.first(), after.first())
        && first > 0.0
    {
        let within = [first, first];
        let (ahead_mm, behind_mm) = (diameter(ahead, within, bore_mm), diameter(behind, within, bore_mm));
        slices.push(Slice { length_mm: first, ahead_mm, behind_mm, bore_mm });
    }
    for ends in cuts.windows(2) {
        let middle = 0.5 * (ends[0] + ends[1]);
        let at = |parts: &[Part], at: &mut usize| {
            while *at + 1 < parts.len() && parts[*at].piece.x1 < middle {
                *at += 1;
            }
            parts[*at]
        };
        let (ahead, behind) = (at(&before, &mut i), at(&after, &mut j));
        let count = count(&ahead, ends).max(count(&behind, ends));
        // At most MOST_SLICES.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let whole = count as usize;
        for k in 0..whole {
            let place = |k: f64| ends[0] + (ends[1] - ends[0]) * (k / count);
            let within = [place(k as f64), place((k + 1) as f64)];
            slices.push(Slice {
                length_mm: within[1] - within[0],
                ahead_mm: diameter(&ahead, within, bore_mm),
                behind_mm: diameter(&behind, within, bore_mm),
                bore_mm,
            });
        }
    }
    slices
}

/// How many slices a part is cut into between two places.
fn count(part: &Part, ends: &[f64]) -> f64 {
    let middle = 0.5 * (ends[0] + ends[1]);
    let radii = [ends[0], middle, ends[1]].map(|x| part.piece.curve.at(x).max(0.5 * LEAST_MM));
    let change = (radii[0] - radii[1]).abs() + (radii[1] - radii[2]).abs();
    let least = radii.into_iter().fold(f64::INFINITY, f64::min);
    (change / least / TAPER_OF_SLICE).ceil().clamp(1.0, MOST_SLICES)
}

/// The diameter of a cylinder that bends as far, mm: the mean of the flexibilities by Simpson's rule.
fn diameter(part: &Part, [from, to]: [f64; 2], bore_mm: f64) -> f64 {
    let of_bore = bore_mm.powi(4);
    let least = bore_mm + LEAST_MM;
    let flexibility = |x: f64| ((2.0 * part.piece.curve.at(x)).max(least).powi(4) - of_bore).recip();
    let mean = (flexibility(from) + 4.0 * flexibility(0.5 * (from + to)) + flexibility(to)) / 6.0;
    (mean.recip() + of_bore).powf(0.25)
}
