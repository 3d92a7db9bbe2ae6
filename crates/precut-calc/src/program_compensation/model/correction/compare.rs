//! Two outlines of the work against each other.

use super::super::stock::Part;

/// Nothing is compared nearer to a step, mm.
const FROM_STEP_MM: f64 = 0.02;
/// Nor where the outline is a shoulder: slope.
const STEEPEST: f64 = 3.0;
/// A jump of the radius by more is a step, mm.
const STEP_MM: f64 = 1e-3;
/// Places that are no two, mm.
const SAME_MM: f64 = 1e-6;

/// By how much an outline is off the one that it should be, at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Off {
    pub(crate) z_mm: f64,
    /// On the radius: above 0 the work is thick.
    pub(crate) by_mm: f64,
    /// Line that makes the outline there, in the program whose it should be.
    pub(crate) line: Option<usize>,
}

/// Differences at both ends and in the middle of every stretch on which both outlines are smooth.
pub(super) fn differences(wanted: &[Part], real: &[Part]) -> Vec<Off> {
    let ends = |parts: &[Part]| parts.iter().flat_map(|part| [part.piece.x0, part.piece.x1]).collect::<Vec<f64>>();
    let steps = steps(wanted);
    let mut cuts = ends(wanted);
    cuts.extend(ends(real));
    cuts.extend(steps.iter().flat_map(|x| [x - FROM_STEP_MM, x + FROM_STEP_MM]));
    cuts.sort_by(f64::total_cmp);
    cuts.dedup_by(|later, kept| *later - *kept <= SAME_MM);
    let (mut i, mut j, mut step) = (0, 0, 0);
    let mut found = Vec::new();
    for pair in cuts.windows(2) {
        let middle = 0.5 * (pair[0] + pair[1]);
        while i + 1 < wanted.len() && wanted[i].piece.x1 < middle {
            i += 1;
        }
        while j + 1 < real.len() && real[j].piece.x1 < middle {
            j += 1;
        }
        while step < steps.len() && steps[step] + FROM_STEP_MM < middle {
            step += 1;
        }
        let (Some(should), Some(is)) = (wanted.get(i), real.get(j)) else { break };
        let inside = |part: &Part| part.piece.x0 <= middle && middle <= part.piece.x1;
        let is_at_step = steps.get(step).is_some_and(|x| (x - middle).abs() < FROM_STEP_MM);
        if is_at_step || !inside(should) || !inside(is) {
            continue;
        }
        for z_mm in [pair[0] + 0.5 * SAME_MM, middle, pair[1] - 0.5 * SAME_MM] {
            let slope =
                (should.piece.curve.at(z_mm + SAME_MM) - should.piece.curve.at(z_mm - SAME_MM)) / (2.0 * SAME_MM);
            if slope.abs() <= STEEPEST {
                found.push(Off {
                    z_mm,
                    by_mm: is.piece.curve.at(z_mm) - should.piece.curve.at(z_mm),
                    line: should.owner,
                });
            }
        }
    }
    found
}

/// Places of steps, from left to right.
fn steps(parts: &[Part]) -> Vec<f64> {
    let is_step = |pair: &&[Part]| {
        let x = pair[1].piece.x0;
        (pair[0].piece.curve.at(x) - pair[1].piece.curve.at(x)).abs() > STEP_MM
    };
    parts.windows(2).filter(is_step).map(|pair| pair[1].piece.x0).collect()
}
