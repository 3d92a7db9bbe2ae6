//! What comes of a depth that was chosen with a model, where other effects act (`diagnosis/3.9`).

use rayon::prelude::*;

use crate::calculator::{Allowed, Consequence, Failure, ForwardModel, Monitor, Rows};
use crate::effects::FixtureEffect;

use crate::fixture_stability::FixtureStability;
use crate::fixture_stability::job::input::FixtureJob;
use crate::fixture_stability::measured::forward::{FixturePoint, FixtureRun};

/// The limit of depth of each of `acting` above the one that `believed` promises at the job's speed, in percent of the
/// latter: below 0 a cut at the promised depth chatters. Empty where the model has no limit there.
pub(in crate::fixture_stability) fn consequences(
    job: &FixtureJob,
    runs: &[FixtureRun],
    believed: &[FixtureEffect],
    acting: &[Vec<FixtureEffect>],
    monitor: &dyn Monitor,
) -> Result<Vec<Consequence>, Failure> {
    let conditions = runs.first().cloned().unwrap_or_default();
    let run = FixtureRun { time_since_clamping_min: conditions.time_since_clamping_min, ..FixtureRun::default() };
    let rows = Rows { runs: vec![run], points: vec![(0, FixturePoint::default())] };
    let Ok(prepared) = FixtureStability::prepare(job, &rows, "depth_limit_mm", monitor) else {
        return Ok(Vec::new());
    };
    let limit_mm = |effects: &[FixtureEffect]| -> Result<Option<f64>, Failure> {
        let limits = FixtureStability::predict(&prepared, effects, monitor)?;
        Ok(limits.into_iter().next().and_then(Result::ok).filter(|depth| *depth > 0.0))
    };
    let Some(chosen_mm) = limit_mm(believed)? else { return Ok(Vec::new()) };
    let limits: Vec<Option<f64>> =
        acting.par_iter().map(|effects| limit_mm(effects)).collect::<Result<_, Failure>>()?;
    Ok(vec![depth_margin(chosen_mm, &limits)])
}

/// How far limits of depth lie above one that was promised, in percent of it: below 0 a cut at the promised depth chatters.
pub(crate) fn depth_margin(promised_mm: f64, limits_mm: &[Option<f64>]) -> Consequence {
    let of = |limit: &Option<f64>| limit.map(|limit_mm| 100.0 * (limit_mm / promised_mm - 1.0));
    let allowed = Some(Allowed::AtLeast(0.0));
    Consequence { name: "depth_margin_percent", unit: "percent", allowed, values: limits_mm.iter().map(of).collect() }
}
