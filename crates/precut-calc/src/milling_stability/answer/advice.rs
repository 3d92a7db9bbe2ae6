//! What is to be said of an answer, as codes with numbers.

use crate::calculator::{Finding, Message};
use crate::fixture_stability::{
    CLAMP, COEFFICIENT, DAMPING, EDGE, FEED, FREQUENCY, Friction, FrictionRange, STATED_FREQUENCY, STATED_RATIO,
};
use crate::receptance_fit::warnings as fit_warnings;

use super::super::job::{Asked, EdgeForce, Job, YieldingMode, modes, way};
use super::super::model::{GROWN, Law};
use super::clamping::is_enough;
use super::growth::Growth;
use super::output::{
    ClampCriterion, ClampRemedyKind, ClampStation, CrossingMethod, CutterProposal, ForceOfSide, InstabilityKind,
    LeadingMultiplier, MillingClamping, MillingState, Outcome, ProposalKind, RigidLimits, SpeedPocket,
    UnstableInterval,
};
use super::proposals::effort;
use super::{Aside, MODEL_ENDS, Study, UM_PER_MM, conformance, measured};

/// Above this share of the limit a cut is near to it.
const NEAR_LIMIT: f64 = 0.9;
/// A floor of the chip matters where half or twice of it moves the limit by more than this share.
const FLOOR_MATTERS: f64 = 0.05;
/// Which surface a tooth meets depends on a motion that is larger than this share of the run-out.
const PAIRING_MATTERS: f64 = 0.5;
/// The zeroth order misleads where it lies above the true limit by more than this share.
const ABOVE: f64 = 0.02;
/// One side limits where a rigid other one changes the limit by less than this share.
const SAME: f64 = 0.02;
/// Of a mode that has none.
const UNDAMPED: f64 = 1e-9;
/// A disturbance that takes longer than this decays slowly, s.
const SLOW_S: f64 = 1.0;
/// Forces below this are none, N.
const NO_FORCE_N: f64 = 1e-6;

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

pub(in crate::milling_stability) const EXPLANATION_CODES: &[&str] = &[
    "milling_stable",
    "milling_settles_slowly",
    "milling_slow_cut",
    "milling_grows_within",
    "milling_grows_in_modulation",
    "milling_chatters",
    "milling_undecided",
    "milling_overloaded",
    "milling_surface_out",
    "milling_slips",
    "milling_opens",
    "milling_comes_off",
    "clamping_holds_from",
    "clamping_certain_slip",
    "clamping_along_the_feed",
    "clamping_at_hand",
    "clamping_cannot_hold",
    "clamping_dynamic",
    "chatter_limit_is",
    "no_chatter_limit",
    "milling_island",
    "milling_unstable_throughout",
    "side_is_measured",
    "measured_side_is_rigid",
    "limit_by_receptance",
    "receptance_not_solved",
    "side_limits",
    "both_sides_limit",
    "direction_limits",
    "milling_pushes",
    "milling_lifts",
    "spindle_suffices",
    "spindle_limits_depth",
    "milling_moves",
    "wall_is_left",
    "pocket_is",
    "no_better_pocket",
    "proposal_pitch",
    "proposal_helix",
    "proposal_speed_variation",
    "no_proposal",
    "zeroth_order_is",
    "milling_not_modelled",
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
fn floor(study: &Study<'_>, outcome: &Outcome) -> Option<Finding> {
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

/// A force as it is printed, four digits, never less than it was.
fn rounded_up(force_n: f64) -> f64 {
    if force_n <= 0.0 {
        return 0.0;
    }
    let step = 10_f64.powf(force_n.log10().floor() - 3.0);
    (force_n / step * (1.0 - 1e-12)).ceil() * step
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

pub(in crate::milling_stability) fn explanation(study: &Study<'_>, outcome: &Outcome, aside: &Aside) -> Vec<Message> {
    let mut said: Vec<Message> = of_verdict(study, outcome, aside).into_iter().collect();
    said.extend(outcome.conformance.iter().flat_map(conformance::said));
    if outcome.islands_checked_to_mm.is_some() {
        said.push(match outcome.first_limit_mm {
            Some(limit) if limit > 0.0 => Message::new("chatter_limit_is")
                .with("depth_mm", limit)
                .with("spindle_speed_rpm", study.case.rotation.spindle_rpm),
            Some(_) => Message::new("milling_unstable_throughout"),
            None => Message::new("no_chatter_limit").with("depth_mm", outcome.examined_to_mm),
        });
        said.extend(outcome.unstable_intervals.iter().filter_map(island));
    }
    said.extend(measured::said(study, outcome));
    said.extend(outcome.limited_by.iter().flat_map(|limited| of_sides(limited, outcome)));
    said.extend(of_drive(outcome));
    let work = &outcome.force.work;
    said.push(
        Message::new("milling_pushes")
            .with("x_mean_n", work.x_mean_n)
            .with("y_mean_n", work.y_mean_n)
            .with("x_peak_n", work.x_max_n.abs().max(work.x_min_n.abs()))
            .with("y_peak_n", work.y_max_n.abs().max(work.y_min_n.abs())),
    );
    if work.z_max_n > NO_FORCE_N {
        said.push(Message::new("milling_lifts").with("peak_n", work.z_max_n).with("mean_n", work.z_mean_n));
    }
    if let Some(motion) = &outcome.motion {
        said.push(Message::new("milling_moves").with("peak_to_peak_um", motion.peak_to_peak_um));
        said.extend(motion.walls.iter().map(|wall| {
            Message::new("wall_is_left")
                .with("error_min_um", wall.error_min_um)
                .with("error_max_um", wall.error_max_um)
                .with("rz_um", wall.roughness_rz_um)
        }));
    }
    said.extend(outcome.clamping.iter().flat_map(|clamping| holding(study, clamping, work, aside)));
    if outcome.speed_curve.is_some() {
        said.extend(of_speeds(study, outcome));
    }
    if study.job.asks(Asked::Proposals) {
        said.extend(of_proposals(outcome));
    }
    if let (Some(depth), Some(hz)) = (outcome.zeroth_order_min_mm, outcome.zeroth_order_frequency_hz) {
        said.push(Message::new("zeroth_order_is").with("depth_mm", depth).with("frequency_hz", hz));
    }
    said.push(Message::new("milling_not_modelled"));
    said
}

/// What becomes of a disturbance.
fn of_multiplier(state: MillingState, multiplier: &LeadingMultiplier) -> Message {
    match state {
        MillingState::Stable => Message::new("milling_stable").with("per_tooth", multiplier.per_tooth),
        MillingState::Chatter => {
            let message = Message::new("milling_chatters")
                .with("per_tooth", multiplier.per_tooth)
                .with("kind", multiplier.kind.name());
            match multiplier.chatter_frequency_hz.filter(|_| multiplier.kind != InstabilityKind::Fold) {
                Some(hz) => message.with("frequency_hz", hz),
                None => message,
            }
        }
        MillingState::GrowsWithin => Message::new("milling_grows_within")
            .with("per_tooth", multiplier.per_tooth)
            .with("growth", multiplier.transient_growth.unwrap_or(0.0))
            .with("frequency_hz", multiplier.chatter_frequency_hz.unwrap_or(0.0)),
        _ => Message::new("milling_undecided").with("modulus", multiplier.modulus),
    }
}

/// The same of a slow cut.
fn of_slow(study: &Study<'_>, outcome: &Outcome, aside: &Aside) -> Message {
    let message = Message::new("milling_slow_cut")
        .with("oscillations", outcome.cost.oscillations_per_period)
        .with("of", if study.cut().repeats() { "tooth" } else { "arc" });
    match outcome.first_limit_mm.zip(aside.slow_hz) {
        Some((depth_mm, hz)) => message.with("depth_mm", depth_mm).with("frequency_hz", hz),
        None => message.with("examined_mm", outcome.examined_to_mm),
    }
}

fn of_verdict(study: &Study<'_>, outcome: &Outcome, aside: &Aside) -> Vec<Message> {
    let Some(verdict) = &outcome.verdict else { return Vec::new() };
    let of_growth = outcome
        .multiplier
        .as_ref()
        .map_or_else(|| of_slow(study, outcome, aside), |of| of_multiplier(verdict.state, of));
    let mut said = vec![match verdict.state {
        MillingState::Stable | MillingState::Chatter | MillingState::GrowsWithin | MillingState::Undecided => of_growth,
        MillingState::Overloaded => {
            Message::new("milling_overloaded").with("margin", verdict.drive_margin.unwrap_or(0.0))
        }
        MillingState::SurfaceOut => Message::new("milling_surface_out"),
        MillingState::Slips => Message::new("milling_slips")
            .with("status", outcome.clamping.as_ref().map_or("slips", |clamping| clamping.status.name())),
        MillingState::Opens => Message::new("milling_opens"),
        MillingState::Lifts => Message::new("milling_comes_off")
            .with("off_n", outcome.clamping.as_ref().and_then(|clamping| clamping.comes_off_n).unwrap_or(0.0)),
    }];
    let is_told = matches!(verdict.state, MillingState::Stable | MillingState::Chatter);
    if study.is_slow && (!is_told || outcome.multiplier.is_some()) {
        said.push(of_slow(study, outcome, aside));
    }
    if let Some(multiplier) = outcome.multiplier.as_ref().filter(|of| study.case.rotation.varies() && of.modulus < 1.0)
        && let Some(growth) = multiplier.transient_growth.filter(|growth| *growth >= GROWN)
    {
        said.push(Message::new("milling_grows_in_modulation").with("growth", growth));
    }
    if let Some(multiplier) = &outcome.multiplier
        && let Some(time_s) = multiplier.settling_time_s.filter(|time| *time > SLOW_S)
    {
        said.push(
            Message::new("milling_settles_slowly")
                .with("time_s", time_s)
                .with("teeth", (time_s / study.case.tooth_period_s()).ceil())
                .with("per_tooth", multiplier.per_tooth),
        );
    }
    said
}

/// How hard the workpiece must be clamped, and how the force at hand holds.
fn holding(study: &Study<'_>, clamping: &MillingClamping, force: &ForceOfSide, aside: &Aside) -> Vec<Message> {
    let told = |message: Message, name: &'static str, value: Option<f64>| match value {
        Some(value) => message.with(name, value),
        None => message,
    };
    let mut said = Vec::new();
    let largest = |low: f64, high: f64| high.abs().max(low.abs());
    let is_vise = study.job.clamping.as_ref().is_some_and(|clamping| clamping.vise.is_some());
    let friction = |which: usize| {
        study.held.iter().flat_map(|held| held.friction[which].iter().copied()).reduce(f64::min).unwrap_or(0.0)
    };
    if let (Some(least), Some(likely), Some(by_mean)) =
        (clamping.clamp_force_min_n, clamping.at_likely_friction_n, clamping.against_mean_n)
    {
        let message = Message::new("clamping_holds_from")
            .with("least_n", rounded_up(least))
            .with("likely_n", rounded_up(likely))
            .with("by_mean_n", rounded_up(by_mean))
            .with("along_n", largest(force.x_min_n, force.x_max_n))
            .with("across_n", largest(force.y_min_n, force.y_max_n))
            .with("of", if is_vise { "vise" } else { "contacts" })
            .with("friction_low", friction(0))
            .with("friction", friction(1));
        said.push(match clamping.decides {
            Some(decides) => message
                .with("contact", f64::from(decides.contact))
                .with("criterion", if decides.criterion == ClampCriterion::Slip { "slip" } else { "opening" }),
            None => message,
        });
        if let Some(certain) = clamping.certain_slip_below_n.filter(|certain| *certain < (1.0 - SAME) * least) {
            said.push(
                Message::new("clamping_certain_slip").with("certain_n", certain).with("least_n", rounded_up(least)),
            );
        }
    } else {
        let message = Message::new("clamping_cannot_hold").with("way", aside.free.unwrap_or("unknown"));
        said.push(match clamping.remedy {
            Some(remedy) => told(message, "apart_mm", remedy.apart_mm)
                .with("remedy", if remedy.kind == ClampRemedyKind::Stop { "stop" } else { "second_pair" })
                .with("presses", way(&[remedy.normal_x, remedy.normal_y, remedy.normal_z, 0.0, 0.0, 0.0]))
                .with("x_mm", remedy.x_mm)
                .with("y_mm", remedy.y_mm)
                .with("z_mm", remedy.z_mm)
                .with("least_n", rounded_up(remedy.clamp_force_min_n)),
            None => message,
        });
    }
    said.extend(along_the_feed(clamping));
    let at_hand = study.held.as_ref().and_then(|held| held.clamp_force_n);
    if let Some((force, safety)) = at_hand.zip(clamping.clamp_safety) {
        let message = Message::new("clamping_at_hand").with("force_n", force).with("safety", safety);
        said.push(told(message, "friction_needed", clamping.friction_needed).with("status", clamping.status.name()));
    }
    if let Some(factor) = clamping.dynamic_factor.filter(|factor| (factor - 1.0).abs() > SAME) {
        said.push(Message::new("clamping_dynamic").with("factor", factor));
    }
    said
}

/// Over which way the cut was taken to go where the job does not say it, and where on it most is asked.
fn along_the_feed(clamping: &MillingClamping) -> Option<Message> {
    if !clamping.stations_assumed {
        return None;
    }
    let message = Message::new("clamping_along_the_feed");
    let apart = |a: &ClampStation, b: &ClampStation| (a.x_mm - b.x_mm).hypot(a.y_mm - b.y_mm);
    let all = &clamping.stations;
    let pairs = all.iter().enumerate().flat_map(|(i, from)| all[i + 1..].iter().map(move |to| (from, to)));
    let Some((from, to)) = pairs.max_by(|(a, b), (c, d)| apart(a, b).total_cmp(&apart(c, d))) else {
        return Some(message);
    };
    let message =
        message.with("x1_mm", from.x_mm).with("y1_mm", from.y_mm).with("x2_mm", to.x_mm).with("y2_mm", to.y_mm);
    let force = |of: &ClampStation| of.clamp_force_min_n.unwrap_or(f64::INFINITY);
    let most = all.iter().max_by(|a, b| force(a).total_cmp(&force(b)))?;
    Some(match most.clamp_force_min_n {
        Some(asked) => message.with("x_mm", most.x_mm).with("y_mm", most.y_mm).with("asked_n", rounded_up(asked)),
        None => message,
    })
}

/// A stretch with an end is an island: below and above it the cut is stable.
fn island(interval: &UnstableInterval) -> Option<Message> {
    let (from, to) = (interval.from_mm?, interval.to_mm?);
    Some(Message::new("milling_island").with("from_mm", from).with("to_mm", to).with("kind", interval.kind.name()))
}

/// Which side and which direction limits: by limits with the other one rigid.
fn of_sides(limited: &RigidLimits, outcome: &Outcome) -> Vec<Message> {
    let Some(limit) = outcome.first_limit_mm else { return Vec::new() };
    let has = |name: &str| limited.tried.iter().any(|tried| tried == name);
    let told = |message: Message, name: &'static str, value: Option<f64>| match value {
        Some(value) => message.with(name, value),
        None => message,
    };
    let changes = |other: Option<f64>| other.is_none_or(|other| (other / limit - 1.0).abs() > SAME);
    let mut said = Vec::new();
    if has("tool") && has("work") {
        let (tool, work) = (limited.tool_rigid_limit_mm, limited.work_rigid_limit_mm);
        // The side limits whose stiffening changes the limit while that of the other does not.
        let message = match (changes(tool), changes(work)) {
            (true, false) => Message::new("side_limits").with("side", "tool"),
            (false, true) => Message::new("side_limits").with("side", "work"),
            _ => Message::new("both_sides_limit"),
        };
        let message = message.with("limit_mm", limit).with("examined_mm", limited.examined_to_mm);
        said.push(told(told(message, "tool_rigid_mm", tool), "work_rigid_mm", work));
    }
    let axes = [("x", limited.x_rigid_limit_mm), ("y", limited.y_rigid_limit_mm), ("z", limited.z_rigid_limit_mm)];
    let tried: Vec<_> = axes.into_iter().filter(|(name, _)| has(name)).collect();
    // Of several directions the one whose stiffening gains most.
    let gained = |value: Option<f64>| value.unwrap_or(f64::INFINITY);
    if let Some((axis, value)) =
        tried.iter().max_by(|a, b| gained(a.1).total_cmp(&gained(b.1))).filter(|_| tried.len() > 1)
        && gained(*value) > (1.0 + SAME) * limit
    {
        let message = Message::new("direction_limits")
            .with("axis", *axis)
            .with("limit_mm", limit)
            .with("examined_mm", limited.examined_to_mm);
        said.push(told(message, "rigid_mm", *value));
    }
    said
}

/// The best speeds, or that there is none.
fn of_speeds(study: &Study<'_>, outcome: &Outcome) -> Vec<Message> {
    let now = outcome.engagement.removal_rate_cm3_per_min;
    if outcome.speeds.is_empty() {
        return vec![Message::new("no_better_pocket").with("removal_rate_cm3_per_min", now)];
    }
    let of = |pocket: &SpeedPocket| {
        Message::new("pocket_is")
            .with("spindle_speed_rpm", pocket.spindle_speed_rpm)
            .with("depth_mm", pocket.depth_mm)
            .with("width_mm", pocket.width_mm)
            .with("of_widths", if study.job.cut.widths_mm.is_empty() { "no" } else { "yes" })
            .with("removal_rate_cm3_per_min", pocket.removal_rate_cm3_per_min)
            .with("now_cm3_per_min", now)
            .with("binds", pocket.binds.name())
            .with("margin_percent", study.job.limits.margin_percent)
    };
    outcome.speeds.iter().map(of).collect()
}

/// `70-110-70-110`.
fn pitches(pitch_deg: &[f64]) -> String {
    let of = |pitch: &f64| format!("{}", (pitch * 100.0).round() / 100.0);
    pitch_deg.iter().map(of).collect::<Vec<_>>().join("-")
}

/// What else was tried and gains.
fn of_proposals(outcome: &Outcome) -> Vec<Message> {
    if outcome.proposals.is_empty() {
        return vec![Message::new("no_proposal")];
    }
    let of = |proposal: &CutterProposal| {
        let message = match proposal.kind {
            ProposalKind::Pitch => Message::new("proposal_pitch").with("pitches", pitches(&proposal.pitch_deg)),
            ProposalKind::Helix => {
                Message::new("proposal_helix").with("helix_angle_deg", proposal.helix_angle_deg.unwrap_or(0.0))
            }
            ProposalKind::SpeedVariation => Message::new("proposal_speed_variation")
                .with("amplitude", proposal.amplitude.unwrap_or(0.0))
                .with("frequency_hz", proposal.frequency_hz.unwrap_or(0.0)),
        };
        let limit = |message: Message, name: &'static str, limit: Option<f64>| match limit {
            Some(limit) => message.with(name, limit),
            None => message,
        };
        let message = message.with("gain_percent", proposal.gain_percent).with("examined_mm", outcome.examined_to_mm);
        limit(limit(message, "limit_mm", proposal.first_limit_mm), "now_mm", proposal.first_limit_now_mm)
    };
    outcome.proposals.iter().map(of).collect()
}

/// What the spindle allows at this speed, where something is known of it.
fn of_drive(outcome: &Outcome) -> Option<Message> {
    let force = &outcome.force;
    let (power, torque) = (force.power_depth_mm, force.torque_depth_mm);
    let depth = [power, torque].into_iter().flatten().reduce(f64::min)?;
    let what = if power.is_some_and(|power| power <= depth) { "power" } else { "torque" };
    // Before or beyond chatter is said where it was looked for.
    outcome.islands_checked_to_mm?;
    let code = match outcome.first_limit_mm {
        Some(chatter) if chatter < depth => "spindle_suffices",
        Some(_) => "spindle_limits_depth",
        None if depth <= outcome.examined_to_mm => "spindle_limits_depth",
        None => return None,
    };
    Some(
        Message::new(code)
            .with("what", what)
            .with("depth_mm", depth)
            .with("power_kw", force.motor_power_kw)
            .with("torque_n_m", force.torque_mean_n_m),
    )
}
