//! The compensated path that goes with a schedule: the deflection calculator, zone by zone at its feed and speed
//! (`feed/9.1`).

use crate::calculator::{Calculator, Failure, Message, Monitor, checkpoint};
use crate::deflection_compensation::{
    self as deflection, Cut, DeflectionCompensation, Detail, Gravity, Include, IncludeMode, PathSettings,
    SpeedDiameter, Stations, Tolerance, Uncertainty,
};
use crate::effects::DeflectionConditions;
use crate::force::{CoefficientOrigin, ForceModel, PowerLaw, PowerTerm, ToolMaterial};

use crate::feed_schedule::answer::output::{CompensatedPath, PathOfZone};
use crate::feed_schedule::job::case::{Case, ZoneCase};
use crate::feed_schedule::job::input::Job;
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::plan::Compensation;

/// Stations keep this far from the ends of a zone, so that none stands on a shoulder of its neighbour, mm: farther than a
/// place that still counts as the end of a segment, much less than a step of a control.
const INSIDE_MM: f64 = 1e-5;

/// A zone's view of the schedule's monitor: it may be cancelled, its own progress is not the schedule's.
struct OfZone<'m>(&'m dyn Monitor);

impl Monitor for OfZone<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}

/// The path of every zone.
pub(in crate::feed_schedule) fn path(
    job: &Job,
    case: &Case,
    at: &[(f64, f64)],
    wanted: &Compensation,
    monitor: &dyn Monitor,
) -> Result<Option<CompensatedPath>, Failure> {
    let mut zones = Vec::with_capacity(case.zones.len());
    let (mut before, mut after, mut moves) = (0.0_f64, 0.0_f64, 0);
    for (zone, &(u, x)) in case.zones.iter().zip(at) {
        checkpoint(monitor)?;
        let Some(mut own) = deflection_job(job, zone, u, x, wanted) else { return Ok(None) };
        DeflectionCompensation::fill(&mut own);
        let answer = DeflectionCompensation::run(&own, &OfZone(monitor))?.output;
        let (Some(path), Some(uncompensated), Some(compensated)) =
            (&answer.path, answer.largest_error_um, answer.largest_error_after_um)
        else {
            return Ok(None);
        };
        before = before.max(uncompensated.abs());
        after = after.max(compensated.abs());
        moves += path.moves;
        let (mut z_mm, mut commanded_diameter_mm) = (Vec::new(), Vec::new());
        for piece in &path.zones {
            z_mm.extend_from_slice(&piece.z_mm);
            commanded_diameter_mm.extend_from_slice(&piece.commanded_diameter_mm);
        }
        // The stations stood a hair inside; the moves reach the zone's own ends.
        if let Some(first) = z_mm.first_mut() {
            *first = zone.from_mm;
        }
        if let Some(last) = z_mm.last_mut() {
            *last = zone.to_mm;
        }
        zones.push(PathOfZone { id: zone.id.clone(), z_mm, commanded_diameter_mm });
    }
    Ok(Some(CompensatedPath { zones, largest_uncompensated_um: before, largest_compensated_um: after, moves }))
}

/// The deflection calculator's job of one zone.
fn deflection_job(job: &Job, zone: &ZoneCase, u: f64, x: f64, wanted: &Compensation) -> Option<deflection::Job> {
    let mut shaft = job.shaft.clone()?;
    let mut left = 0.0;
    for segment in &mut shaft.segments {
        let right = left + segment.length_mm;
        let cut = right > zone.from_mm + INSIDE_MM && left < zone.to_mm - INSIDE_MM;
        segment.stock_diameter_mm =
            Some(if cut { segment.diameter_mm + 2.0 * zone.depth_mm } else { segment.diameter_mm });
        left = right;
    }
    let count = wanted.stations_per_zone as usize;
    let (from, to) = (zone.from_mm + INSIDE_MM, zone.to_mm - INSIDE_MM);
    let step = (to - from) / (count - 1) as f64;
    let z_mm = (0..count).map(|k| if k + 1 == count { to } else { from + step * k as f64 }).collect();
    Some(deflection::Job {
        shaft,
        supports: job.supports.clone(),
        carriage: job.carriage.clone(),
        force: force(zone, u, x)?,
        cut: Cut {
            feed_mm_per_rev: x.exp(),
            speed_m_per_min: Some(u.exp()),
            spindle_speed_rpm: None,
            speed_diameter: SpeedDiameter::Finish,
            feed_direction: job.feed_direction,
        },
        include: Include { mode: IncludeMode::AsStated, ..Include::default() },
        gravity: Gravity::default(),
        stations: Stations::List { z_mm },
        stock_profile: None,
        passes: Vec::new(),
        detail: Detail::Full,
        tolerance: Tolerance::default(),
        aim: deflection::Aim::default(),
        uncertainty: Uncertainty::default(),
        path: PathSettings { chord_tolerance_um: Some(wanted.chord_tolerance_um), increment_um: wanted.increment_um },
        program: job.program.clone(),
        limits: deflection::Limits::default(),
        tailstock_thrust_n: None,
        compare_one_step: false,
        effects: Vec::new(),
        conditions: DeflectionConditions::default(),
    })
}

/// The acting passive force at the zone's feed and speed as a power law of the depth, which is all that the equilibrium
/// varies.
fn force(zone: &ZoneCase, u: f64, x: f64) -> Option<ForceModel> {
    let model = zone.model(Output::ForceY)?;
    let at_depth = model.output(u, x);
    let exponent = zone.force_depth_exponent.max(0.0);
    let term = PowerTerm {
        coefficient: at_depth / zone.depth_mm.powf(exponent),
        depth_exponent: exponent,
        feed_exponent: 0.0,
        speed_exponent: 0.0,
        correction_factor: 1.0,
        constant_n: 0.0,
        certainty: None,
    };
    Some(ForceModel::PowerLaw(PowerLaw {
        passive: term,
        main: None,
        feed: None,
        wear_factor: 1.0,
        tool_material: ToolMaterial::Carbide,
        cutting_edge_angle_deg: None,
        measured_range: None,
        origin: CoefficientOrigin::Given,
    }))
}
