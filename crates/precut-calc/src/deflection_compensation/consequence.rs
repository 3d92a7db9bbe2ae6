//! What comes of a path that was compensated with a model, where other effects act (`diagnosis/3.9`).

use rayon::prelude::*;

use crate::calculator::{Allowed, Calculator, Consequence, Failure, ForwardModel, Rows, Unwatched};
use crate::effects::DeflectionEffect;

use super::DeflectionCompensation;
use super::forward::{CommandedPoint, DeflectionPoint, DeflectionRun};
use super::grid::Grid;
use super::input::{Detail, Job, Stations};

/// Stations along every diameter: a half-wave between them is missed by less than 0.03 % of its height,
/// (pi/128)^2/2.
const STATIONS: u32 = 65;
/// A shoulder's second station, beyond the first by this share of the length: places of a path ascend.
const BESIDE: f64 = 1e-6;

/// Form and size of the shaft that is cut along the path compensated with `believed`, for each of `acting`. The path is
/// that of one cut from the stock, as the diagnosis predicts it. Empty where that path has gaps.
pub(super) fn consequences(
    job: &Job,
    runs: &[DeflectionRun],
    believed: &[DeflectionEffect],
    acting: &[Vec<DeflectionEffect>],
) -> Result<Vec<Consequence>, Failure> {
    let conditions = runs.first().cloned().unwrap_or_default();
    let Some(path) = compensated(job, &conditions, believed)? else { return Ok(Vec::new()) };
    let points = path.iter().map(|point| (0, DeflectionPoint { z_mm: point.z_mm })).collect();
    let run = DeflectionRun {
        tool_path_at_start_m: conditions.tool_path_at_start_m,
        warm_time_at_start_min: conditions.warm_time_at_start_min,
        commanded_path: path,
        ..DeflectionRun::default()
    };
    let rows = Rows { runs: vec![run], points };
    let Ok(prepared) = DeflectionCompensation::prepare(job, &rows, "diameter_deviation_um", &Unwatched) else {
        return Ok(Vec::new());
    };
    let turned: Vec<Option<(f64, f64)>> = acting
        .par_iter()
        .map(|effects| {
            let deviations = DeflectionCompensation::predict(&prepared, effects)?;
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

/// The path compensated with these effects beside the job's own; `None` where a station has no command.
fn compensated(
    job: &Job,
    conditions: &DeflectionRun,
    believed: &[DeflectionEffect],
) -> Result<Option<Vec<CommandedPoint>>, Failure> {
    let mut job = job.clone();
    job.passes.clear();
    job.detail = Detail::Profile;
    job.stations = Stations::PerZone { count: STATIONS };
    let grid = Grid::of(&job);
    let mut z_mm = grid.z_mm.clone();
    for zone in &grid.zones {
        z_mm[zone.first] += BESIDE * grid.length_mm;
    }
    job.stations = Stations::List { z_mm };
    job.effects.extend_from_slice(believed);
    job.conditions.tool_path_at_start_m = job.conditions.tool_path_at_start_m.or(conditions.tool_path_at_start_m);
    job.conditions.warm_time_at_start_min = job.conditions.warm_time_at_start_min.or(conditions.warm_time_at_start_min);
    let stations = match DeflectionCompensation::run(&job, &Unwatched) {
        Ok(answer) => answer.output.stations,
        Err(Failure::OutOfModel(_)) => return Ok(None),
        Err(failure) => return Err(failure),
    };
    let each = stations.z_mm.iter().zip(&stations.commanded_diameter_mm);
    Ok(each.map(|(&z_mm, diameter)| diameter.map(|diameter_mm| CommandedPoint { z_mm, diameter_mm })).collect())
}
