//! Parts of an answer by themselves, with the code that the whole answer uses: for identification and for measuring.

use crate::calculator::{Failure, Monitor, Unwatched};

use crate::fixture_stability::answer::output::{LobeMap, SpeedLimit};
use crate::fixture_stability::answer::study::forced;
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::FixtureJob;
use crate::fixture_stability::model::drive::depths;
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::holding::Closed;
use crate::fixture_stability::model::lobes::{Plane, Rules, boundary, map, point};
use crate::fixture_stability::model::simulate::{plan, run};

fn case(job: &FixtureJob) -> Result<Case, Failure> {
    Case::of(job).ok_or_else(|| Failure::Internal("a job that the check refuses".to_owned()))
}

fn plane(job: &FixtureJob, working: Working, most_mm: f64) -> Plane {
    Plane {
        from_rpm: job.lobes.from_rpm.unwrap_or(0.5 * working.spindle_rpm),
        to_rpm: job.lobes.to_rpm.unwrap_or(2.0 * working.spindle_rpm),
        speeds: job.lobes.speeds as usize,
        most_mm,
        depths: job.lobes.depths as usize,
        feed_mm: working.feed_mm,
    }
}

/// The plane of the lobe diagram of a job.
pub(in crate::fixture_stability) fn plane_of(job: &FixtureJob, case: &Case, examined_mm: f64) -> Plane {
    plane(job, case.working, job.lobes.depth_max_mm.unwrap_or(examined_mm))
}

/// Modulus of the largest multiplier at the working point of a checked and filled job, and its estimated error.
pub fn multiplier_modulus(job: &FixtureJob) -> Result<(f64, f64), Failure> {
    let case = case(job)?;
    let found = point(&Rules::new(), &case.holding, &case.cutting, case.working, Closed::BOTH, &Unwatched)?;
    Ok((found.multiplier.modulus, found.error))
}

/// The map of the lobe diagram alone. `lobes.depth_max_mm` is to be given; 10 mm otherwise.
pub fn lobe_map(job: &FixtureJob, monitor: &dyn Monitor) -> Result<LobeMap, Failure> {
    let case = case(job)?;
    let plane = plane_of(job, &case, 10.0);
    let full = map(&Rules::new(), &case.holding, &case.cutting, &plane, job.lobes.refinement, monitor, &mut |_, _| {})?;
    Ok(LobeMap::of(full))
}

/// The traced boundary alone.
pub fn lobe_boundary(job: &FixtureJob, monitor: &dyn Monitor) -> Result<Vec<SpeedLimit>, Failure> {
    let case = case(job)?;
    let plane = plane_of(job, &case, 10.0);
    let points = boundary(&Rules::new(), &case.holding, &case.cutting, &plane, monitor, &mut |_, _| {})?;
    Ok(points
        .into_iter()
        .map(|p| {
            let working = Working { spindle_rpm: p.spindle_rpm, ..case.working };
            let drive = job.spindle.as_ref().map(|spindle| depths(&case, spindle, working));
            SpeedLimit {
                spindle_speed_rpm: p.spindle_rpm,
                depth_examined_mm: p.examined_mm,
                chatter_mm: p.limit().depth_mm,
                // The forced motion is no part of it.
                amplitude_mm: None,
                movable_opens_mm: None,
                fixed_opens_mm: None,
                slips_mm: None,
                drive_mm: drive.and_then(|of| of.least_mm()),
            }
        })
        .collect())
}

/// Peak-to-peak displacement and least clamp force of the forced motion, um and N.
pub fn forced_motion(job: &FixtureJob) -> Result<(f64, f64), Failure> {
    let case = case(job)?;
    let motion = forced(&case, case.working, &Unwatched)?;
    Ok((1e3 * motion.x_mm.span(), motion.left_n.high.max(motion.right_n.high).max(0.0)))
}

/// A run in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeRun {
    /// Peak-to-peak displacement over the steady tooth periods, um.
    pub peak_to_peak_um: f64,
    /// Largest displacement either way, um.
    pub displacement_max_um: f64,
    /// Elastic force that the joint at the movable jaw asks of the clamp, N.
    pub clamp_movable_n: f64,
    /// The same at the fixed jaw, N.
    pub clamp_fixed_n: f64,
    /// Steps taken.
    pub steps: usize,
}

/// Runs the cut of a checked and filled job in time, joints bonded, the length chosen for a multiplier of that modulus where
/// the job states none.
pub fn run_in_time(job: &FixtureJob, modulus: f64, monitor: &dyn Monitor) -> Result<TimeRun, Failure> {
    let case = case(job)?;
    let run = run(&case, &plan(&case, &job.simulation, case.working, modulus), monitor)?;
    Ok(TimeRun {
        peak_to_peak_um: 1e3 * run.x_mm.span(),
        displacement_max_um: 1e3 * run.x_mm.high.abs().max(run.x_mm.low.abs()),
        clamp_movable_n: run.left_elastic_n.high.max(0.0),
        clamp_fixed_n: run.right_elastic_n.high.max(0.0),
        steps: run.steps,
    })
}
