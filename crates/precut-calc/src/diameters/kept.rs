//! Whether single parts keep their limits, each cut with effects of its own (`diagnosis/3.9`).

use rayon::prelude::*;

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::certainty::lines::points;
use crate::certainty::{OpenEffects, Uncertainties};
use crate::effects::DeflectionEffect;

use super::quantities::{Modes, OneQuantity, draw_of, uncertainties};
use super::{Asked, Parts};

/// Most quantities of which bounds alone are known: all their ends are tried.
const MOST_WITHIN: usize = 3;

/// Of parts with these effects, each with a draw of what is uncertain beside them. One that cannot be cut keeps no limit. Where bounds
/// alone are known it is those ends at which fewest are good; `None` where there are too many of them to try.
pub(crate) fn kept(
    parts: &(dyn Parts + Sync),
    asked: &Asked<'_>,
    effects: &[Vec<DeflectionEffect>],
    monitor: &dyn Monitor,
) -> Result<Option<Vec<bool>>, Failure> {
    let (of, modes) = uncertainties(asked, &parts.places().z_mm)
        .map_err(|_| Failure::Internal("correlations of a checked job contradict each other".to_owned()))?;
    // What is not known of the effects is in the effects.
    let of = Uncertainties { effects: OpenEffects::default(), ..of };
    let count = of.within.len();
    if count > MOST_WITHIN {
        return Ok(None);
    }
    let end = |corner: usize, index: usize| if corner >> index & 1 == 0 { -1.0 } else { 1.0 };
    let mut least: Option<Vec<bool>> = None;
    for corner in 0..1_usize << count {
        let held = of.held(&(0..count).map(|index| end(corner, index)).collect::<Vec<_>>());
        let kept = kept_of(parts, asked, (&held, &modes), effects, monitor)?;
        let good = |kept: &[bool]| kept.iter().filter(|good| **good).count();
        if least.as_ref().is_none_or(|least| good(&kept) < good(least)) {
            least = Some(kept);
        }
    }
    Ok(least)
}

fn kept_of(
    parts: &(dyn Parts + Sync),
    asked: &Asked<'_>,
    (of, modes): (&Uncertainties<OneQuantity>, &Modes),
    effects: &[Vec<DeflectionEffect>],
    monitor: &dyn Monitor,
) -> Result<Vec<bool>, Failure> {
    let scores: Vec<Vec<f64>> = points(effects.len(), of.dimensions(), asked.uncertainty.seed).collect();
    effects
        .par_iter()
        .zip(scores)
        .map(|(effects, scores)| {
            checkpoint(monitor)?;
            let mut draw = draw_of((of, modes), &[], &of.values(&scores))?;
            draw.effects = Some(effects.clone());
            match parts.errors_um(&draw, 0.0) {
                Ok(errors_um) => Ok(asked.tolerance.holds(parts.places().extremes_um(&errors_um))),
                Err(Failure::OutOfModel(_)) => Ok(false),
                Err(failure) => Err(failure),
            }
        })
        .collect()
}
