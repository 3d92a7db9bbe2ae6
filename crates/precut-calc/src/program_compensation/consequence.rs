//! What comes of a program that was corrected with a model, where other effects act (`diagnosis/3.9`).

use rayon::prelude::*;

use crate::calculator::{Allowed, Consequence, Failure, Monitor, Quiet};
use crate::diameters::Tolerance;
use crate::effects::DeflectionEffect;

use super::conformance::Leaves;
use super::forward::ProgramRun;
use super::given_back;
use super::job::{Job, ModeKind};

/// Form and size of the parts of the program that is given back with `believed`, for each of `acting`: outside its transitions, against
/// what the given program means. Empty where none is given back.
pub(super) fn consequences(
    job: &Job,
    runs: &[ProgramRun],
    believed: &[DeflectionEffect],
    acting: &[Vec<DeflectionEffect>],
    monitor: &dyn Monitor,
) -> Result<Vec<Consequence>, Failure> {
    let Some(parts) = made_with(job, runs, believed, monitor)? else { return Ok(Vec::new()) };
    let left: Vec<Option<[f64; 2]>> = acting
        .par_iter()
        .map(|effects| match parts.extremes_um(effects) {
            Ok(extremes) => Ok(Some(extremes)),
            Err(Failure::OutOfModel(_)) => Ok(None),
            Err(failure) => Err(failure),
        })
        .collect::<Result<_, Failure>>()?;
    let judged = |name, allowed: Option<f64>, of: fn([f64; 2]) -> f64| Consequence {
        name,
        unit: "um",
        allowed: allowed.map(Allowed::AtMost),
        values: left.iter().map(|extremes| extremes.map(of)).collect(),
    };
    Ok(vec![
        judged("form_error_um", job.tolerance.form_um, |[high, low]| high - low),
        judged("largest_error_um", job.tolerance.diameter_um.map(|whole| whole / 2.0), |[high, low]| {
            high.abs().max(low.abs())
        }),
    ])
}

/// The parts of the program that a job gives back with these effects beside its own, under the conditions of its first run, made without
/// them; `None` where it gives none back. A program that is only read is corrected.
fn made_with<'m>(
    job: &Job,
    runs: &[ProgramRun],
    believed: &[DeflectionEffect],
    monitor: &'m dyn Monitor,
) -> Result<Option<Leaves<'m>>, Failure> {
    let mut own = job.clone();
    if let Some(first) = runs.first() {
        first.act_on(&mut own.conditions);
    }
    let mut planned = Job { tolerance: Tolerance::default(), ..own.clone() };
    planned.effects.extend_from_slice(believed);
    if planned.mode.kind == ModeKind::Read {
        planned.mode.kind = ModeKind::Compensate;
    }
    let found = given_back(&planned, &Quiet(monitor)).and_then(|found| {
        found.map(|(corrected, meant)| Leaves::of(&own, Some(&corrected), &meant, monitor)).transpose()
    });
    match found {
        Ok(parts) => Ok(parts),
        Err(Failure::OutOfModel(_)) => Ok(None),
        Err(failure) => Err(failure),
    }
}
