//! From a computed cut to the columns of the answer: moved where they are the same numbers, rescaled in place where
//! only the unit differs. At ten thousand stations fresh arrays cost as much as the physics.

use super::UM_PER_MM;
use super::acting::Acting;
use super::cut::CutLine;
use super::input::Job;
use super::laws::Loads;
use super::model::{Line, Radii};
use super::output::StationColumns;
use super::stage::Stage;

/// Diameter errors at the stations, um.
pub(super) struct Errors {
    pub uncompensated_um: Vec<Option<f64>>,
    pub compensated_um: Option<Vec<Option<f64>>>,
}

impl Errors {
    /// Of the cut along the nominal line, and of what the programmed path produces where that was computed.
    pub(super) fn of(stage: &Stage, produced_mm: Option<&[Option<f64>]>) -> Self {
        let error = |(r, target): (&Option<f64>, &f64)| r.map(|r| 2.0 * (r - target) * UM_PER_MM);
        Self {
            uncompensated_um: stage.cut.uncompensated_errors_um(&stage.radii),
            compensated_um: produced_mm.map(|r| r.iter().zip(&stage.radii.target).map(error).collect()),
        }
    }
}

/// The columns of the answer; `z_mm` are the stations.
pub(super) fn columns(job: &Job, acting: &Acting, z_mm: Vec<f64>, stage: Stage, errors: Errors) -> StationColumns {
    let Stage { line, radii, cut, .. } = stage;
    let diameter_uncertainty_um = uncertainty_um(job, acting, &line, &cut);
    let force = |given: bool, component: fn(&Loads) -> f64| given.then(|| cut.loads.column(component));
    let moves_aside = line.moves_aside();
    let carriage = line.carriage_mm_per_n;
    let Radii { target, stock, .. } = radii;
    StationColumns {
        z_mm,
        passive_force_n: cut.loads.column(|loads| loads.passive_n),
        main_force_n: force(job.force.has_main(), |loads| loads.main_n),
        feed_force_n: force(job.force.has_feed(), |loads| loads.feed_n),
        offset_um: cut.command_mm.iter().zip(&target).map(|(r, t)| r.map(|r| (r - t) * UM_PER_MM)).collect(),
        commanded_diameter_mm: doubled(cut.command_mm),
        diameter_mm: scaled(target, 2.0),
        stock_diameter_mm: scaled(stock, 2.0),
        compliance_um_per_n: line.work_mm_per_n.iter().map(|w| (w + carriage) * UM_PER_MM).collect(),
        work_compliance_um_per_n: scaled(line.work_mm_per_n, UM_PER_MM),
        depth_mm: cut.nominal_depth_mm,
        deflection_um: scaled(cut.y_mm, UM_PER_MM),
        tangential_deflection_um: moves_aside.then(|| scaled(cut.z_mm, UM_PER_MM)),
        depth_uncompensated_mm: cut.uncompensated_depth_mm,
        diameter_error_uncompensated_um: errors.uncompensated_um,
        diameter_error_compensated_um: errors.compensated_um,
        diameter_uncertainty_um,
        copying_factor: cut.copying,
        status_uncompensated: cut.status_uncompensated,
        status_compensated: cut.status_compensated,
    }
}

fn scaled(mut column: Vec<f64>, by: f64) -> Vec<f64> {
    for value in &mut column {
        *value *= by;
    }
    column
}

fn doubled(mut column: Vec<Option<f64>>) -> Vec<Option<f64>> {
    for value in column.iter_mut().flatten() {
        *value *= 2.0;
    }
    column
}

/// Standard uncertainty of the diameter, um (`deflection/7`): to first order about the compensated cut
/// dr = Y_el sqrt(u_F² + u_W²)/(1 + S'), and the scatter from trace to trace.
fn uncertainty_um(job: &Job, acting: &Acting, line: &Line, cut: &CutLine) -> Vec<f64> {
    let relative = job.uncertainty.force_percent.hypot(job.uncertainty.stiffness_percent) / 100.0;
    let scatter = 2.0 * acting.scatter_mm * UM_PER_MM;
    let elastic = cut.y_mm.iter().enumerate().map(|(i, y)| line.elastic_mm(i, *y));
    let systematic =
        elastic.zip(&cut.planned_copying).map(|(y, copying)| 2.0 * y * relative * (1.0 - copying) * UM_PER_MM);
    if scatter > 0.0 { systematic.map(|um| um.hypot(scatter)).collect() } else { systematic.map(f64::abs).collect() }
}
