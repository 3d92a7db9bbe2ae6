//! What bends: the section ahead of the tool as it was before the move, behind it as it is after it (`program/4.6`).

use crate::deflection_compensation::Slice;

use super::super::stock::{Chain, Part, Piece, SAME_MM, Sums};

/// A slice that tapers becomes thinner by no more than this share.
const TAPER_OF_SLICE: f64 = 0.01;
/// Most slices of a part.
const MOST_SLICES: f64 = 400.0;
/// Stretches with no more parts stay as they are, and others are halved so often until they can be lumped.
const FEW_PARTS: usize = 4;
const MOST_HALVINGS: u32 = 6;
/// What is left of work that is turned away bends as a wire of this diameter, mm: no tool pushes there.
const LEAST_MM: f64 = 0.2;

/// Where slices need not be those of the outline: elsewhere than near the tool the work bends as a few slices of the same
/// flexibility do, and the same first and second moments of it. That is exact where bending is linear between two of these places.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Lumps {
    /// The tool stands between these, and there alone the outlines differ, mm.
    pub(crate) near_mm: [f64; 2],
    /// Places of supports, in any order, mm.
    pub(crate) supports_mm: Vec<f64>,
}

/// Slices from the headstock end.
pub(crate) fn slices(before: &Chain, after: &Chain, bore_mm: f64, lumps: Option<&Lumps>) -> Vec<Slice> {
    let ends = before.ends();
    let mut slices: Vec<Slice> = Vec::new();
    // A blank that begins behind the headstock end is as thick before.
    if let Some(part) =
        before.parts_between(ends[0] - SAME_MM, ends[0] + 2.0 * SAME_MM).next().filter(|_| ends[0] > 0.0)
    {
        let diameter_mm = diameter(part, [ends[0]; 2], bore_mm);
        slices.push(Slice { length_mm: ends[0], ahead_mm: diameter_mm, behind_mm: diameter_mm, bore_mm });
    }
    let Some(Lumps { near_mm, supports_mm }) = lumps else {
        fine([before, after], ends, bore_mm, &mut slices);
        return slices;
    };
    let near = near_mm.map(|at| at.clamp(ends[0], ends[1]));
    let mut cuts: Vec<f64> = supports_mm.iter().copied().filter(|&at| at > ends[0] && at < ends[1]).collect();
    cuts.retain(|&at| at < near[0] || at > near[1]);
    cuts.extend([ends[0], near[0], near[1], ends[1]]);
    cuts.sort_by(f64::total_cmp);
    for pair in cuts.windows(2).filter(|pair| pair[1] > pair[0]) {
        let is_near = near[0] <= pair[0] && pair[1] <= near[1];
        if is_near {
            fine([before, after], [pair[0], pair[1]], bore_mm, &mut slices);
        } else {
            lump(before, [pair[0], pair[1]], bore_mm, MOST_HALVINGS, &mut slices);
        }
    }
    slices
}

/// A few slices that bend as a stretch does.
fn lump(chain: &Chain, [from, to]: [f64; 2], bore_mm: f64, halvings: u32, into: &mut Vec<Slice>) {
    if chain.parts_between(from, to).nth(FEW_PARTS).is_none() {
        return fine([chain, chain], [from, to], bore_mm, into);
    }
    let [whole, first, second] = chain.sums([from, to], |piece| sums(piece, bore_mm));
    let length = to - from;
    // Moments over the stretch, from 0 to 1, and the flexibilities of three thirds that have them.
    let of = [
        whole / length,
        (first - from * whole) / length.powi(2),
        (second - 2.0 * from * first + from * from * whole) / length.powi(3),
    ];
    let [a, b, c] = [3.0 * of[0], 18.0 * of[1], 81.0 * of[2]];
    let (p, q) = (0.5 * (b - a), (c - a) / 6.0);
    let last = q - p;
    let middle = p - 2.0 * last;
    let thirds = [a - middle - last, middle, last];
    let least = 1e-3 * of[0];
    if thirds.iter().all(|flexibility| *flexibility > least) {
        into.extend(thirds.map(|flexibility| {
            let diameter_mm = (flexibility.recip() + bore_mm.powi(4)).powf(0.25);
            Slice { length_mm: length / 3.0, ahead_mm: diameter_mm, behind_mm: diameter_mm, bore_mm }
        }));
    } else if halvings == 0 {
        fine([chain, chain], [from, to], bore_mm, into);
    } else {
        let middle = 0.5 * (from + to);
        lump(chain, [from, middle], bore_mm, halvings - 1, into);
        lump(chain, [middle, to], bore_mm, halvings - 1, into);
    }
}

/// Flexibility of a piece and its first and second moment about the headstock end.
fn sums(piece: Piece, bore_mm: f64) -> Sums {
    let part = Part { piece, owner: None, step_owner: None };
    let ends = [piece.x0, piece.x1];
    let count = count(&part, &ends);
    let mut all = [0.0; 3];
    // At most MOST_SLICES.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    for k in 0..count as usize {
        let place = |k: f64| ends[0] + (ends[1] - ends[0]) * (k / count);
        let [from, to] = [place(k as f64), place((k + 1) as f64)];
        let flexibility = (diameter(&part, [from, to], bore_mm).powi(4) - bore_mm.powi(4)).recip();
        all[0] += flexibility * (to - from);
        all[1] += flexibility * (to * to - from * from) / 2.0;
        all[2] += flexibility * (to.powi(3) - from.powi(3)) / 3.0;
    }
    all
}

/// The slices of both outlines over a stretch.
fn fine([before, after]: [&Chain; 2], [low, high]: [f64; 2], bore_mm: f64, slices: &mut Vec<Slice>) {
    let parts = |chain: &Chain| chain.parts_between(low, high).copied().collect::<Vec<Part>>();
    let (before, after) = (parts(before), parts(after));
    let mut cuts: Vec<f64> = before.iter().chain(&after).flat_map(|part| [part.piece.x0, part.piece.x1]).collect();
    cuts.retain(|&at| at > low && at < high);
    cuts.extend([low, high]);
    cuts.sort_by(f64::total_cmp);
    cuts.dedup_by(|later, kept| *later - *kept <= 1e3 * SAME_MM);
    // The stretch ends where it ends, however near to it an outline has a corner: a support may stand there.
    if let Some(last) = cuts.last_mut() {
        *last = high;
    }
    let (mut i, mut j) = (0, 0);
    for ends in cuts.windows(2) {
        let middle = 0.5 * (ends[0] + ends[1]);
        let at = |parts: &[Part], at: &mut usize| {
            while *at + 1 < parts.len() && parts[*at].piece.x1 < middle {
                *at += 1;
            }
            parts.get(*at).copied()
        };
        let (Some(ahead), Some(behind)) = (at(&before, &mut i), at(&after, &mut j)) else { continue };
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Flexibility of slices and its first and second moment about the headstock end.
    fn moments(slices: &[Slice]) -> Sums {
        let (mut all, mut from) = ([0.0; 3], 0.0_f64);
        for slice in slices {
            let (to, flexibility) = (from + slice.length_mm, (slice.ahead_mm.powi(4) - slice.bore_mm.powi(4)).recip());
            all[0] += flexibility * (to - from);
            all[1] += flexibility * (to.powi(2) - from.powi(2)) / 2.0;
            all[2] += flexibility * (to.powi(3) - from.powi(3)) / 3.0;
            from = to;
        }
        all
    }

    #[test]
    fn slices_fill_the_work_to_its_end() {
        // A corner of the outline just before the end.
        let corner = 400.0 - 500.0 * SAME_MM;
        let chain = Chain::of(&[[0.0, 15.0], [corner, 15.0], [corner, 11.0], [400.0, 11.0]]);
        let length: f64 = slices(&chain, &chain, 0.0, None).iter().map(|slice| slice.length_mm).sum();
        assert!((length - 400.0).abs() < SAME_MM, "{length}");
    }

    #[test]
    fn lumps_bend_as_what_they_stand_for() {
        let rows = |big: f64| (0..400).map(move |i| [f64::from(i), if i % 40 < 20 { 11.0 } else { big }]).collect();
        // Shallow and deep steps: those are halved until they can be lumped.
        for big in [11.5, 14.0, 40.0] {
            let rows: Vec<[f64; 2]> = rows(big);
            let chain = Chain::of(&rows);
            let lumps = Lumps { near_mm: [200.0, 203.0], supports_mm: vec![120.0] };
            let (all, few) = (slices(&chain, &chain, 8.0, None), slices(&chain, &chain, 8.0, Some(&lumps)));
            assert!(few.len() < 20 || big > 20.0, "{}", few.len());
            assert!(few.len() < all.len());
            for (a, b) in moments(&all).into_iter().zip(moments(&few)) {
                assert!((a / b - 1.0).abs() < 1e-9, "{big}: {a}, {b}");
            }
        }
    }
}
