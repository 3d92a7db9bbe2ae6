//! What an answer warns of.

use crate::calculator::Finding;
use crate::fixture_stability::{
    CLAMP, COEFFICIENT, DAMPING, EDGE, FEED, FREQUENCY, Friction, FrictionRange, STATED_FREQUENCY, STATED_RATIO,
};
use crate::receptance_fit::warnings as fit_warnings;

use super::super::super::job::{EdgeForce, Job, YieldingMode, modes};
use super::super::super::model::Law;
use super::super::clamping::is_enough;
use super::super::growth::Growth;
use super::super::output::{CrossingMethod, LeadingMultiplier, Outcome, UnstableInterval};
use super::super::proposals::effort;
use super::super::{Aside, MODEL_ENDS, Study, UM_PER_MM, conformance, measured};
use super::rounded_up;

/// Above this share of the limit a cut is near to it.
const NEAR_LIMIT: f64 = 0.9;
/// A floor of the chip matters where half or twice of it moves the limit by more than this share.
const FLOOR_MATTERS: f64 = 0.05;
/// Which surface a tooth meets depends on a motion that is larger than this share of the run-out.
const PAIRING_MATTERS: f64 = 0.5;
/// The zeroth order misleads where it lies above the true limit by more than this share.
const ABOVE: f64 = 0.02;
/// Of a mode that has none.
const UNDAMPED: f64 = 1e-9;
pub(in crate::milling_stability) const WARNING_CODES: &[&str] = &[
    "no_damping",
    "fit_changes_limit",
    "pairing_of_undisturbed_chips",
    "about_changes_verdict",
    "near_chatter_limit",
    "depth_not_examined",
    "multiplier_not_converged",
    "crossing_not_certified",
    "zeroth_order_above",
    "chip_floor_matters",
    "process_damping_not_measured",
    "modulation_moved",
    "strip_offset_idle",
    "spindle_power_exceeded",
    "spindle_torque_exceeded",
    "spindle_speed_outside_table",
    "implausible_unit",
    "motion_beyond_model",
    "no_forced_motion",
    "spindle_acceleration",
    "jaw_friction_assumed",
    "clamp_force_short",
];

pub(in crate::milling_stability) fn warnings(study: &Study<'_>, outcome: &Outcome, aside: &Aside) -> Vec<Finding> {
    let (job, case) = (study.job, &study.case);
    let mut found = Vec::new();
    for (at, _) in stated(study).filter(|(_, mode)| mode.ratio().is_some_and(|ratio| ratio < UNDAMPED)) {
        found.push(Finding::new("no_damping", format!("{at}/damping_ratio")));
    }
    for fit in &study.fits {
        found.extend(fit_warnings(&fit.job, &fit.fitted, fit.at));
    }
    found.extend(measured::doubts(study, outcome));
    let depth = case.depth_mm;
    if let Some(limit) = outcome.first_limit_mm
        && depth >= NEAR_LIMIT * limit
        && depth < limit
    {
        found.push(Finding::new("near_chatter_limit", "/cut/depth_mm").measured(depth, limit, "mm"));
    }
    if outcome.islands_checked_to_mm.is_some_and(|to| depth > to) {
        let to = outcome.examined_to_mm;
        found.push(Finding::new("depth_not_examined", "/limits/depth_max_mm").measured(depth, to, "mm"));
    }
    if let Some(multiplier) = &outcome.multiplier
        && Growth::of(multiplier, study.is_slow) == Growth::Unknown
    {
        found.push(Finding::new("multiplier_not_converged", "/cut").measured(
            multiplier.modulus,
            multiplier.modulus_error,
            "1",
        ));
    }
    let is_doubtful = |of: &&UnstableInterval| of.found_by == CrossingMethod::Multiplier && !of.certified;
    if let Some(doubtful) = outcome.unstable_intervals.iter().find(is_doubtful) {
        let at = doubtful.from_mm.or(doubtful.to_mm).unwrap_or(0.0);
        found.push(Finding::new("crossing_not_certified", "/limits/depths").value(at, "mm"));
    }
    if let (Some(zeroth), Some(limit)) = (outcome.zeroth_order_min_mm, outcome.first_limit_mm)
        && zeroth > (1.0 + ABOVE) * limit
        && !study.is_slow
    {
        found.push(Finding::new("zeroth_order_above", "/cut").measured(zeroth, limit, "mm"));
    }
    found.extend(floor(study, outcome));
    if let Some(without) = outcome.other_assumptions.without_process_damping_limit_mm {
        let finding = Finding::new("process_damping_not_measured", "/process_damping/source");
        found.push(match outcome.first_limit_mm {
            Some(with) => finding.measured(without, with, "mm"),
            None => finding.value(without, "mm"),
        });
    }
    if let Some(of) = job.speed_variation
        && (case.rotation.frequency_hz / of.frequency_hz - 1.0).abs() > 1e-9
    {
        found.push(Finding::new("modulation_moved", "/speed_variation/frequency_hz").measured(
            of.frequency_hz,
            case.rotation.frequency_hz,
            "Hz",
        ));
    }
    let most = job.spindle.as_ref().and_then(|spindle| spindle.acceleration_max_rad_per_s2);
    if let Some(most) = most.filter(|_| case.rotation.varies()) {
        let (asked, _) = effort(&case.rotation, 0.0);
        if asked > most {
            found.push(
                Finding::new("spindle_acceleration", "/speed_variation/amplitude").measured(asked, most, "rad/s2"),
            );
        }
    }
    if job.cut.width_mm.is_some() && job.cut.milling.is_at_a_side() && job.cut.offset_mm.abs() > 0.0 {
        found.push(Finding::new("strip_offset_idle", "/cut/offset_mm").value(job.cut.offset_mm, "mm"));
    }
    of_spindle(study, outcome, &mut found);
    found.extend(implausible(study));
    found.extend(of_clamping(job, outcome));
    found.extend(outcome.conformance.as_ref().and_then(conformance::warning));
    if let Some(swing) = aside.beyond_mm {
        let limit = MODEL_ENDS * case.milling.radius_mm;
        found.push(Finding::new("motion_beyond_model", "/cut/depth_mm").measured(swing, limit, "mm"));
    }
    let run_out_mm = case.milling.run_out_mm();
    if let Some(swing) = aside.beside_run_out_mm.filter(|swing| *swing > PAIRING_MATTERS * run_out_mm) {
        found.push(Finding::new("pairing_of_undisturbed_chips", "/cutter").measured(
            UM_PER_MM * swing,
            UM_PER_MM * run_out_mm,
            "um",
        ));
    }
    found.extend(outcome.multiplier.as_ref().and_then(about_motion));
    if aside.no_motion {
        found.push(Finding::new("no_forced_motion", "/cut/spindle_speed_rpm"));
    }
    found
}

/// A cut that is stable about undisturbed chips and not about the motion that they force, or the other way round.
fn about_motion(multiplier: &LeadingMultiplier) -> Option<Finding> {
    let smooth = multiplier.smooth_chips_modulus?;
    let differ = (multiplier.modulus < 1.0) != (smooth < 1.0);
    differ.then(|| Finding::new("about_changes_verdict", "/about").measured(multiplier.modulus, smooth, "1"))
}

/// Modes that the job itself states, with where they stand.
fn stated<'a>(study: &'a Study<'_>) -> impl Iterator<Item = (String, &'a YieldingMode)> {
    modes(study.job).filter(|(at, _)| !study.fits.iter().any(|fit| at.starts_with(fit.at)))
}

/// Where another floor of the chip moves the limit.
pub(super) fn floor(study: &Study<'_>, outcome: &Outcome) -> Option<Finding> {
    let other = &outcome.other_assumptions;
    let (halved, doubled) = (other.floor_halved_limit_mm?, other.floor_doubled_limit_mm?);
    let limit = outcome.first_limit_mm?;
    let moved = (halved / limit - 1.0).abs().max((doubled / limit - 1.0).abs());
    let Law::Power { floor_mm, .. } = study.case.milling.law else { return None };
    (moved > FLOOR_MATTERS).then(|| {
        Finding::new("chip_floor_matters", "/force/chip_floor_mm")
            .measured(floor_mm, 0.0, "mm")
            .with("halved_mm", halved)
            .with("doubled_mm", doubled)
            .with("limit_mm", limit)
    })
}

fn of_spindle(study: &Study<'_>, outcome: &Outcome, found: &mut Vec<Finding>) {
    let force = &outcome.force;
    if let Some(limit) = force.power_limit_kw.filter(|limit| force.motor_power_kw > *limit) {
        found.push(Finding::new("spindle_power_exceeded", "/cut/depth_mm").measured(force.motor_power_kw, limit, "kW"));
    }
    if let Some(limit) = force.torque_limit_n_m.filter(|limit| force.torque_mean_n_m > *limit) {
        let asked = force.torque_mean_n_m;
        found.push(Finding::new("spindle_torque_exceeded", "/cut/depth_mm").measured(asked, limit, "N m"));
    }
    let tabled = study.job.spindle.as_ref().and_then(|spindle| spindle.drive().tabled_rpm());
    if let Some((from, to)) = tabled {
        let speed = study.case.rotation.spindle_rpm;
        if speed < from || speed > to {
            let end = if speed < from { from } else { to };
            found.push(
                Finding::new("spindle_speed_outside_table", "/cut/spindle_speed_rpm").measured(speed, end, "rev/min"),
            );
        }
    }
}

fn of_clamping(job: &Job, outcome: &Outcome) -> Vec<Finding> {
    let (Some(clamping), Some(told)) = (&job.clamping, &outcome.clamping) else { return Vec::new() };
    let FrictionRange { low, high, .. } = Friction::ASSUMED.range();
    let assumed = clamping.frictions().into_iter().filter(|(_, friction)| *friction == Friction::ASSUMED);
    let mut found: Vec<Finding> = assumed
        .take(1)
        .map(|(at, _)| Finding::new("jaw_friction_assumed", at).with("low", low).with("high", high))
        .collect();
    if let Some((force, at)) = clamping.clamp_force() {
        found.extend(CLAMP.on(force, at));
        if let Some(asked) = told.clamp_force_min_n.filter(|asked| !is_enough(force, *asked)) {
            found.push(Finding::new("clamp_force_short", at).measured(force, rounded_up(asked), "N"));
        }
    }
    found
}

/// Numbers that were likely given in another unit. None is changed.
fn implausible(study: &Study<'_>) -> Vec<Finding> {
    let (job, mut found) = (study.job, Vec::new());
    for (at, mode) in stated(study) {
        match (mode.frequency_hz, mode.natural_hz()) {
            (Some(stated), _) => found.extend(STATED_FREQUENCY.on(stated, format!("{at}/frequency_hz"))),
            (None, Some(implied)) => found.extend(FREQUENCY.on(implied, format!("{at}/stiffness_n_per_mm"))),
            _ => {}
        }
        match (mode.damping_ratio, mode.ratio()) {
            (Some(stated), _) => found.extend(STATED_RATIO.on(stated, format!("{at}/damping_ratio"))),
            (None, Some(implied)) => found.extend(DAMPING.on(implied, format!("{at}/damping_n_s_per_mm"))),
            _ => {}
        }
    }
    match &job.force {
        EdgeForce::Mechanistic(of) => {
            found.extend(COEFFICIENT.on(of.tangential_n_per_mm2, "/force/tangential_n_per_mm2"));
            found.extend(EDGE.on(of.tangential_edge_n_per_mm, "/force/tangential_edge_n_per_mm"));
        }
        EdgeForce::Kienzle(of) => {
            found.extend(COEFFICIENT.on(of.tangential_n_per_mm2, "/force/tangential_n_per_mm2"));
        }
        EdgeForce::PowerLaw(of) => found.extend(COEFFICIENT.on(of.coefficient, "/force/coefficient")),
    }
    found.extend(job.feed_mm().and_then(|feed| FEED.on(feed, "/cut/feed_mm_per_tooth")));
    found
}
