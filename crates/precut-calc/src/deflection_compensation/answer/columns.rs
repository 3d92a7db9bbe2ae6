//! From a computed cut to the columns of the answer: moved where they are the same numbers, rescaled in place where
//! only the unit differs. At ten thousand stations fresh arrays cost as much as the physics.

use crate::calculator::Failure;
use crate::deflection_compensation::UM_PER_MM;
use crate::deflection_compensation::answer::output::StationColumns;
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{Detail, Job};
use crate::deflection_compensation::model::laws::Loads;
use crate::deflection_compensation::model::stage::{Stage, line_of};
use crate::deflection_compensation::model::yielding::{Line, Radii, at};
use crate::effects::DeflectionEffect;

/// Diameter errors at the stations, um.
pub(in crate::deflection_compensation) struct Errors {
    pub uncompensated_um: Vec<Option<f64>>,
    pub compensated_um: Option<Vec<Option<f64>>>,
}

impl Errors {
    /// Of the cut along the nominal line, and of what the programmed path produces where that was computed.
    pub(in crate::deflection_compensation) fn of(stage: &Stage, produced_mm: Option<&[Option<f64>]>) -> Self {
        Self {
            uncompensated_um: stage.cut.uncompensated_errors_um(&stage.radii),
            compensated_um: produced_mm.map(|produced| errors_um(produced, &stage.radii)),
        }
    }
}

/// Diameter errors of produced radii, um.
pub(in crate::deflection_compensation) fn errors_um(produced_mm: &[Option<f64>], radii: &Radii) -> Vec<Option<f64>> {
    let error = |(r, target): (&Option<f64>, &f64)| r.map(|r| 2.0 * (r - target) * UM_PER_MM);
    produced_mm.iter().zip(&radii.target).map(error).collect()
}

/// The columns of the answer; `z_mm` are the stations.
pub(in crate::deflection_compensation) fn columns(
    job: &Job,
    z_mm: Vec<f64>,
    stage: Stage,
    errors: Errors,
    diameter_uncertainty_um: Vec<f64>,
) -> StationColumns {
    let Stage { line, radii, cut, .. } = stage;
    let force = |given: bool, component: fn(&Loads) -> f64| given.then(|| cut.loads.column(component));
    let moves_aside = line.moves_aside();
    let carriage = line.carriage_mm_per_n;
    let full = job.detail == Detail::Full;
    let Radii { target, stock, .. } = radii;
    let (commanded_diameter_mm, diameter_mm) = (doubled(cut.command_mm), scaled(target, 2.0));
    StationColumns {
        z_mm,
        passive_force_n: cut.loads.column(|loads| loads.passive_n),
        main_force_n: force(job.force.has_main(), |loads| loads.main_n),
        feed_force_n: force(job.force.has_feed(), |loads| loads.feed_n),
        offset_um: full.then(|| offsets_um(&commanded_diameter_mm, &diameter_mm)),
        commanded_diameter_mm,
        diameter_mm,
        stock_diameter_mm: scaled(stock, 2.0),
        compliance_um_per_n: line.work_mm_per_n.iter().map(|w| (w + carriage) * UM_PER_MM).collect(),
        work_compliance_um_per_n: full.then(|| scaled(line.work_mm_per_n, UM_PER_MM)),
        depth_mm: cut.nominal_depth_mm,
        deflection_um: scaled(cut.y_mm, UM_PER_MM),
        tangential_deflection_um: moves_aside.then(|| scaled(cut.z_mm, UM_PER_MM)),
        depth_uncompensated_mm: full.then_some(cut.uncompensated_depth_mm),
        diameter_error_uncompensated_um: errors.uncompensated_um,
        diameter_error_compensated_um: errors.compensated_um,
        diameter_uncertainty_um: full.then_some(diameter_uncertainty_um),
        copying_factor: full.then_some(cut.copying),
        status_uncompensated: cut.status_uncompensated,
        status_compensated: cut.status_compensated,
    }
}

/// Radial offset of the commanded path from the nominal line, um.
pub(in crate::deflection_compensation) fn offsets_um(
    commanded_diameter_mm: &[Option<f64>],
    diameter_mm: &[f64],
) -> Vec<Option<f64>> {
    let offset = |(c, d): (&Option<f64>, &f64)| c.map(|c| (c - d) / 2.0 * UM_PER_MM);
    commanded_diameter_mm.iter().zip(diameter_mm).map(offset).collect()
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

/// Standard uncertainty of the diameter, um (`deflection/7`): to first order about the compensated cut, what force and
/// compliances each make of the radius, what is not known of the effects, and the scatter from trace to trace.
pub(in crate::deflection_compensation) fn uncertainty_um(
    job: &Job,
    grid: &Grid,
    acting: &Acting,
    stage: &Stage,
) -> Result<Vec<f64>, Failure> {
    let Stage { line, radii, cut, .. } = stage;
    let relative = Relative::of(job);
    let scatter = 2.0 * acting.scatter_mm * UM_PER_MM;
    let mut of_stations = Vec::with_capacity(radii.target.len());
    for (loads, run) in cut.loads.runs() {
        let copying = &cut.planned_copying[run.clone()];
        if line.only_radial() {
            // All that scales is W P_y, with force and compliance alike.
            let per_compliance = loads.passive_n * relative.both;
            let work = &line.work_mm_per_n[run];
            let radius_mm = work.iter().map(|work| (work + line.carriage_mm_per_n) * per_compliance);
            of_stations.extend(radius_mm.zip(copying).map(|(radius, copying)| diameter_um(radius, *copying)));
        } else {
            let radius_mm = run.map(|i| relative.radius_mm(line, i, loads, at(&cut.z_mm, i), radii.target[i]));
            of_stations.extend(radius_mm.zip(copying).map(|(radius, copying)| diameter_um(radius, *copying)));
        }
    }
    if scatter > 0.0 {
        for um in &mut of_stations {
            *um = um.hypot(scatter);
        }
    }
    for [up, down] in job.asked().off_effects()? {
        let [up, down] = [radii_mm(job, grid, stage, &up)?, radii_mm(job, grid, stage, &down)?];
        for (((um, up), down), copying) in of_stations.iter_mut().zip(up).zip(down).zip(&cut.planned_copying) {
            *um = um.hypot(diameter_um(0.5 * (up - down), *copying));
        }
    }
    Ok(of_stations)
}

/// What other effects make of the radius that an unchanged command gives at an unchanged depth, mm.
fn radii_mm(job: &Job, grid: &Grid, stage: &Stage, effects: &[DeflectionEffect]) -> Result<Vec<f64>, Failure> {
    let acting = Acting::of(effects, &job.conditions, job.cut.feed_direction);
    let Stage { radii, cut, regime, step, .. } = stage;
    let (_, line) = line_of(job, grid, &acting, regime, step, radii)?;
    let radius_mm = |(i, depth_mm): (usize, &f64)| {
        let opening = line.opening(i, &line.nominal_loads(i, *depth_mm));
        let [sine, cosine] = aside(at(&cut.z_mm, i), radii.target[i]);
        cosine * opening.y_mm + sine * opening.z_mm
    };
    Ok(cut.nominal_depth_mm.iter().enumerate().map(radius_mm).collect())
}

/// Sine and cosine of the direction in which the axis lies aside; without a command it lies aside by more than the radius.
fn aside(z_mm: f64, target_mm: f64) -> [f64; 2] {
    let sine = (z_mm / target_mm).clamp(-1.0, 1.0);
    [sine, ((1.0 - sine) * (1.0 + sine)).sqrt()]
}

/// Of the diameter, where the copying factor answers a change of the radius.
fn diameter_um(radius_mm: f64, copying: f64) -> f64 {
    (2.0 * radius_mm * (1.0 - copying) * UM_PER_MM).abs()
}

/// Relative standard uncertainties.
struct Relative {
    force: f64,
    stiffness: f64,
    both: f64,
}

impl Relative {
    fn of(job: &Job) -> Self {
        let [force, stiffness] = job.asked().of_force_and_stiffness().map(Option::unwrap_or_default);
        Self { force, stiffness, both: force.hypot(stiffness) }
    }

    /// What both make of the radius that an unchanged command gives at an unchanged depth, mm: with r = r_t,
    /// dr = (cos dY + sin dZ) where the axis lies aside by sin = Z/r_t.
    fn radius_mm(&self, line: &Line, i: usize, loads: &Loads, z_mm: f64, target_mm: f64) -> f64 {
        let parts = line.parts(i, loads);
        let [sine, cosine] = aside(z_mm, target_mm);
        let by_force = parts.force_mm + parts.couple_mm;
        let force = cosine * by_force + sine * line.tangential_by_force_mm(i, loads);
        let stiffness = cosine * (by_force + parts.sag_mm) + sine * z_mm;
        (self.force * force).hypot(self.stiffness * stiffness)
    }
}
