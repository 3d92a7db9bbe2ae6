//! What comes of a depth that was chosen with a model, where other effects act (`diagnosis/3.9`).

use rayon::prelude::*;

use crate::calculator::{Consequence, Failure, Monitor};
use crate::effects::MillingEffect;
use crate::fixture_stability::depth_margin;

use super::super::job::{Case, Job, fits};
use super::super::model::{Orders, zeroth};
use super::limits::{first_limit_mm, limit_near_mm};

/// The limit is looked for up to so many times the working depth, and the least limit of the zeroth order.
const LOOKED_FOR: f64 = 4.0;

/// The limit of depth of each of `acting` next to the one that `believed` promises at the job's speed. Empty where there is none.
pub(super) fn consequences(
    job: &Job,
    believed: &[MillingEffect],
    acting: &[Vec<MillingEffect>],
    monitor: &dyn Monitor,
) -> Result<Vec<Consequence>, Failure> {
    let (_, job) = fits(job, monitor)?;
    let Some(base) = Case::of(&job) else { return Ok(Vec::new()) };
    let orders = Orders::default();
    let least_mm = zeroth(&base.milling, &base.structure).map_or(0.0, |zeroth| zeroth.depth_mm);
    let most_mm = LOOKED_FOR * base.depth_mm.max(least_mm).max(1e-3);
    let speed = base.rotation.spindle_rpm;
    let with = |effects: &[MillingEffect]| base.clone().with_effects(effects);
    let promised = first_limit_mm(&orders, &with(believed), speed, most_mm, monitor)?;
    let Some(promised_mm) = promised else { return Ok(Vec::new()) };
    // Hundreds of models: next to the promised depth a few cuts tell the limit of each.
    let limit_mm = |effects: &Vec<MillingEffect>| limit_near_mm(&orders, &with(effects), speed, promised_mm, monitor);
    let limits: Vec<Option<f64>> = acting.par_iter().map(limit_mm).collect::<Result<_, Failure>>()?;
    Ok(vec![depth_margin(promised_mm, &limits)])
}
