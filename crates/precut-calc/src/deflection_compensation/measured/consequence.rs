//! What comes of a path that was compensated with a model, where other effects act (`diagnosis/3.9`).

use rayon::prelude::*;

use crate::calculator::{Allowed, Calculator, Consequence, Failure, ForwardModel, Monitor, Quiet, Rows};
use crate::effects::DeflectionEffect;

use crate::deflection_compensation::DeflectionCompensation;
use crate::deflection_compensation::answer::output::Path;
use crate::deflection_compensation::job::input::{Detail, IncludeMode, Job};
use crate::deflection_compensation::measured::forward::{CommandedPoint, DeflectionPoint, DeflectionRun};

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

/// The corners of the path driven with these effects beside the job's own; `None` where it is not complete.
pub(in crate::deflection_compensation) fn compensated(
    job: &Job,
    conditions: &DeflectionRun,
    believed: &[DeflectionEffect],
    monitor: &dyn Monitor,
) -> Result<Option<Vec<CommandedPoint>>, Failure> {
    let mut job = job.clone();
    job.passes.clear();
    job.detail = Detail::Full;
    // The path of the model that predicts: it takes the switches as they stand.
    job.include.mode = IncludeMode::AsStated;
    job.effects.extend_from_slice(believed);
    job.conditions.tool_path_at_start_m = job.conditions.tool_path_at_start_m.or(conditions.tool_path_at_start_m);
    job.conditions.warm_time_at_start_min = job.conditions.warm_time_at_start_min.or(conditions.warm_time_at_start_min);
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
