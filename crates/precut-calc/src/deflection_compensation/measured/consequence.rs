//! What comes of a path that was compensated with a model, where other effects act (`diagnosis/3.9`).

use rayon::prelude::*;

use crate::calculator::{Allowed, Calculator, Consequence, Failure, ForwardModel, Monitor, Quiet, Rows, ToldEffects};
use crate::diameters::{self, Asked, Uncertainty};
use crate::effects::DeflectionEffect;

use crate::deflection_compensation::DeflectionCompensation;
use crate::deflection_compensation::answer::aimed::rehearsed_at_aim;
use crate::deflection_compensation::answer::output::Path;
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{Detail, IncludeMode, Job};
use crate::deflection_compensation::measured::run::{CommandedPoint, DeflectionPoint, DeflectionRun};

/// Places along every diameter at which the turned shaft is looked at, beside the corners of the path: a half-wave between
/// them is missed by less than 0.03 % of its height, (pi/128)^2/2.
const PLACES: u32 = 65;
/// A shoulder's second place, beyond the first by this share of the length: places of a path ascend.
const BESIDE: f64 = 1e-6;

/// Form and size of the shaft that is cut along the path compensated with `believed`, for each of `acting`. The path is
/// the one that the calculator puts out for one cut from the stock: straight moves within its tolerance, corners rounded to the
/// control's increment. Empty where that path has gaps.
pub(in crate::deflection_compensation) fn consequences(
    job: &Job,
    runs: &[DeflectionRun],
    believed: &[DeflectionEffect],
    acting: &[Vec<DeflectionEffect>],
    monitor: &dyn Monitor,
) -> Result<Vec<Consequence>, Failure> {
    let conditions = runs.first().cloned().unwrap_or_default();
    let Some(path) = compensated(job, &conditions, believed, monitor)? else { return Ok(Vec::new()) };
    let points = looked_at(&path).into_iter().map(|z_mm| (0, DeflectionPoint { z_mm })).collect();
    let run = DeflectionRun {
        tool_path_at_start_m: conditions.tool_path_at_start_m,
        warm_time_at_start_min: conditions.warm_time_at_start_min,
        commanded_path: path,
        ..DeflectionRun::default()
    };
    let rows = Rows { runs: vec![run], points };
    let Ok(prepared) = DeflectionCompensation::prepare(job, &rows, "diameter_deviation_um", monitor) else {
        return Ok(Vec::new());
    };
    let turned: Vec<Option<(f64, f64)>> = acting
        .par_iter()
        .map(|effects| {
            let deviations = DeflectionCompensation::predict(&prepared, effects, monitor)?;
            let deviations: Option<Vec<f64>> = deviations.into_iter().map(Result::ok).collect();
            Ok(deviations.and_then(|d| d.into_iter().map(|d| (d, d)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))))
        })
        .collect::<Result<_, Failure>>()?;
    let judged = |name, allowed: Option<f64>, of: &dyn Fn((f64, f64)) -> f64| Consequence {
        name,
        unit: "um",
        allowed: allowed.map(Allowed::AtMost),
        values: turned.iter().map(|ends| ends.map(of)).collect(),
    };
    Ok(vec![
        judged("form_error_um", job.tolerance.form_um, &|(low, high)| high - low),
        judged("largest_error_um", job.tolerance.diameter_um.map(|whole| whole / 2.0), &|(low, high)| {
            low.abs().max(high.abs())
        }),
    ])
}

/// Whether the shafts that are cut along that path keep all limits, each with its own effects and with what else is uncertain.
pub(super) fn parts_kept(
    job: &Job,
    runs: &[DeflectionRun],
    believed: &[DeflectionEffect],
    acting: &[Vec<DeflectionEffect>],
    told: &ToldEffects<'_, DeflectionEffect>,
    monitor: &dyn Monitor,
) -> Result<Option<Vec<bool>>, Failure> {
    if job.tolerance.is_none() {
        return Ok(None);
    }
    let planned = believing(job, &runs.first().cloned().unwrap_or_default(), believed);
    let grid = Grid::of(&planned);
    let of_path = Acting::of(&planned.effects, &planned.conditions, planned.cut.feed_direction);
    let rehearsal = match rehearsed_at_aim(&planned, &grid, &of_path, &Quiet(monitor)) {
        Ok(Some(rehearsal)) => rehearsal,
        Ok(None) | Err(Failure::OutOfModel(_)) => return Ok(None),
        Err(failure) => return Err(failure),
    };
    // What is told comes first, as its uncertainty counts; of the others what scatters is asked for.
    let is_other = |effect: &&DeflectionEffect| told.effects.iter().all(|own| own.kind() != effect.kind());
    let others = acting.first().into_iter().flatten().filter(is_other);
    let effects: Vec<DeflectionEffect> = told.effects.iter().chain(others).cloned().collect();
    let uncertainty = Uncertainty { effects: told.open.to_vec(), ..job.uncertainty.clone() };
    let asked = Asked { uncertainty: &uncertainty, effects: &effects, ..planned.asked() };
    diameters::kept(&rehearsal, &asked, acting, monitor)
}

/// The job of one cut from the stock with these effects beside its own: it takes the switches as they stand, as the model that
/// predicts does.
fn believing(job: &Job, conditions: &DeflectionRun, believed: &[DeflectionEffect]) -> Job {
    let mut job = job.clone();
    job.passes.clear();
    job.detail = Detail::Full;
    job.include.mode = IncludeMode::AsStated;
    job.effects.extend_from_slice(believed);
    let own = &mut job.conditions;
    own.tool_path_at_start_m = own.tool_path_at_start_m.or(conditions.tool_path_at_start_m);
    own.warm_time_at_start_min = own.warm_time_at_start_min.or(conditions.warm_time_at_start_min);
    job
}

/// The corners of the path driven with these effects beside the job's own; `None` where it is not complete.
pub(in crate::deflection_compensation) fn compensated(
    job: &Job,
    conditions: &DeflectionRun,
    believed: &[DeflectionEffect],
    monitor: &dyn Monitor,
) -> Result<Option<Vec<CommandedPoint>>, Failure> {
    let job = believing(job, conditions, believed);
    let path = match DeflectionCompensation::run(&job, &Quiet(monitor)) {
        Ok(answer) => answer.output.path,
        Err(Failure::OutOfModel(_)) => return Ok(None),
        Err(failure) => return Err(failure),
    };
    Ok(path.as_ref().and_then(corners))
}

/// The corners of a path, ascending; `None` of one that is not complete.
pub(in crate::deflection_compensation) fn corners(path: &Path) -> Option<Vec<CommandedPoint>> {
    let mut corners: Vec<CommandedPoint> = Vec::new();
    let length_mm: f64 = path.zones.iter().filter_map(|zone| zone.z_mm.last()).fold(0.0, |most, z| z.max(most));
    for zone in &path.zones {
        for (&z_mm, &diameter_mm) in zone.z_mm.iter().zip(&zone.commanded_diameter_mm) {
            let after = corners.last().map_or(z_mm, |before| before.z_mm + BESIDE * length_mm);
            corners.push(CommandedPoint { z_mm: z_mm.max(after), diameter_mm });
        }
    }
    path.complete.then_some(corners)
}

/// The corners of a path and places between them, ascending.
fn looked_at(path: &[CommandedPoint]) -> Vec<f64> {
    let (Some(first), Some(last)) = (path.first(), path.last()) else { return Vec::new() };
    let share = |k: u32| f64::from(k) / f64::from(PLACES - 1);
    let mut places: Vec<f64> = path.iter().map(|corner| corner.z_mm).collect();
    places.extend((0..PLACES).map(|k| first.z_mm + share(k) * (last.z_mm - first.z_mm)));
    places.sort_by(f64::total_cmp);
    places.dedup();
    places
}
