//! Whether single parts keep their limits, each cut with effects of its own (`diagnosis/3.9`).

use rayon::prelude::*;

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::certainty::lines::points;
use crate::certainty::{OpenEffects, Uncertainties};
use crate::effects::DeflectionEffect;

use super::quantities::{draw_of, uncertainties};
use super::{Asked, Parts};

/// Of parts with these effects, each with a draw of what is uncertain beside them. One that cannot be cut keeps no limit.
pub(crate) fn kept(
    parts: &(dyn Parts + Sync),
    asked: &Asked<'_>,
    effects: &[Vec<DeflectionEffect>],
    monitor: &dyn Monitor,
) -> Result<Vec<bool>, Failure> {
    let of = uncertainties(asked)
        .map_err(|_| Failure::Internal("correlations of a checked job contradict each other".to_owned()))?;
    // What is not known of the effects is in the effects.
    let of = Uncertainties { effects: OpenEffects::default(), ..of };
    let scores: Vec<Vec<f64>> = points(effects.len(), of.dimensions(), asked.uncertainty.seed).collect();
    effects
        .par_iter()
        .zip(scores)
        .map(|(effects, scores)| {
            checkpoint(monitor)?;
            let mut draw = draw_of(&of, &[], &of.values(&scores))?;
            draw.effects = Some(effects.clone());
            match parts.errors_um(&draw, 0.0) {
                Ok(errors_um) => Ok(asked.tolerance.holds(parts.places().extremes_um(&errors_um))),
                Err(Failure::OutOfModel(_)) => Ok(false),
                Err(failure) => Err(failure),
            }
        })
        .collect()
}
