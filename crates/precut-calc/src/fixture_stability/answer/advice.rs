//! What binds, what would help, where not to trust: codes with numbers.

use crate::calculator::{Finding, Message};

use crate::fixture_stability::answer::conformance;
use crate::fixture_stability::answer::output::{
    ChatterKind, ClampForce, FirstLimit, FixtureOutcome, FixtureState, OpenJoint,
};
use crate::fixture_stability::answer::plausible::implausible;
use crate::fixture_stability::answer::probable_depths;
use crate::fixture_stability::answer::study::{Aside, NEAR_LIMIT, Settling, Study};
use crate::fixture_stability::job::input::{Analysis, Friction, FrictionRange, Spindle};
use crate::fixture_stability::model::simulate::Steady;
use crate::fixture_stability::model::slow::in_a_period;

/// Distance of the tooth frequency (or a harmonic) from a natural frequency that is worth a warning.
const NEAR_RESONANCE: f64 = 0.1;
/// Oscillations per tooth period above which lobes merge.
const MERGED_LOBES: f64 = 50.0;
/// Difference of the zeroth-order limit that is worth saying.
const ZEROTH_OFF: f64 = 0.05;
/// Steps per oscillation below which a run is not even a screening (`fixture/5.5`).
const COARSEST_STEPS: f64 = 24.0;
/// Damping ratio below which a limit hangs on its damping alone.
const UNDAMPED: f64 = 1e-6;
/// Share of the cutter's radius beyond which the workpiece swings further than the engagement is the same.
const MODEL_ENDS: f64 = 0.2;
/// A multiplier beyond 1 by no more than this is 1 to round-off: of what has no damping.
const ROUND_OFF: f64 = 1e-9;

/// Codes of the warnings made here.
pub(in crate::fixture_stability) const WARNING_CODES: &[&str] = &[
    "full_slot",
    "no_damping",
    "resonance_of_teeth",
    "near_chatter_limit",
    "lobes_merge",
    "zeroth_order_off",
    "directional_factor_reversed",
    "no_clamp_force",
    "simulation_diverged",
    "simulation_thrown",
    "multiplier_not_converged",
    "depth_not_examined",
    "no_forced_motion_beyond",
    "verdict_by_simulation",
    "spindle_power_exceeded",
    "spindle_torque_exceeded",
    "spindle_speed_outside_table",
    "simulation_too_coarse",
    "implausible_unit",
    "motion_beyond_model",
    "friction_assumed",
    "clamp_slips",
];

/// Codes of the explanations made here.
pub(in crate::fixture_stability) const EXPLANATION_CODES: &[&str] = &[
    "fixture_stable",
    "fixture_settles_slowly",
    "fixture_chatters",
    "fixture_vibrates_on",
    "fixture_grows_within",
    "fixture_slow_cut",
    "fixture_chip_lost",
    "fixture_joint_opens",
    "fixture_spindle_overloaded",
    "chatter_limit_is",
    "no_chatter_limit",
    "better_speed_is",
    "lowest_limit_is",
    "first_limit_is",
    "spindle_suffices",
    "spindle_limits_depth",
    "clamp_force_needed",
    "clamp_force_only_inertia",
    "clamp_force_in_chatter",
    "clamp_force_unknown",
    "clamp_force_against_slip",
    "clamp_force_slip_unknown",
    "opening_is_unstable",
    "opening_stays_stable",
    "amplitude_over_feed",
    "no_surface_location_error",
    "fixture_not_modelled",
];

pub(in crate::fixture_stability) fn warnings(
    study: &Study<'_>,
    outcome: &FixtureOutcome,
    aside: &Aside,
) -> Vec<Finding> {
    let (job, case) = (study.job, &study.case);
    let mut found = Vec::new();
    let diameter = job.cutter.diameter_mm;
    let half_width = 0.5 * job.cut.width_mm;
    if half_width + job.cut.offset_mm.abs() > 0.5 * diameter && half_width >= 0.5 * diameter {
        found.push(Finding::new("full_slot", "/cut/width_mm").measured(job.cut.width_mm, diameter, "mm"));
    }
    if outcome.modes.iter().any(|mode| mode.damping_ratio < UNDAMPED) {
        found.push(Finding::new("no_damping", "/fixture/fixed_joint/damping_n_s_per_mm"));
    }
    let tooth = outcome.engagement.tooth_frequency_hz;
    for mode in &outcome.modes {
        for harmonic in 1..=3_u8 {
            let ratio = f64::from(harmonic) * tooth / mode.natural_frequency_hz;
            if (ratio - 1.0).abs() < NEAR_RESONANCE {
                found.push(
                    Finding::new("resonance_of_teeth", "/cut/spindle_speed_rpm")
                        .measured(f64::from(harmonic) * tooth, mode.natural_frequency_hz, "Hz")
                        .with("harmonic", f64::from(harmonic)),
                );
            }
        }
        let oscillations = mode.natural_frequency_hz / tooth;
        if oscillations > MERGED_LOBES {
            found.push(Finding::new("lobes_merge", "/cut/spindle_speed_rpm").measured(oscillations, MERGED_LOBES, "1"));
        }
    }
    let depth = case.working.depth_mm;
    if let Some(limit) = study.chatter_mm
        && depth >= NEAR_LIMIT * limit
        && depth < limit
    {
        found.push(Finding::new("near_chatter_limit", "/cut/depth_mm").measured(depth, limit, "mm"));
    }
    if let (Some(limit), Some(zeroth)) = (study.chatter_mm, outcome.zeroth_order.depth_at_speed_mm)
        && (zeroth / limit - 1.0).abs() > ZEROTH_OFF
    {
        found.push(Finding::new("zeroth_order_off", "/cut").measured(zeroth, limit, "mm"));
    }
    if outcome.zeroth_order.mean_directional_factor <= 0.0 {
        let factor = outcome.zeroth_order.mean_directional_factor;
        found.push(Finding::new("directional_factor_reversed", "/cut/offset_mm").measured(factor, 0.0, "1"));
    }
    if case.holding.clamp_force_n.is_some_and(|force| force <= 0.0) {
        found.push(Finding::new("no_clamp_force", "/fixture/clamp_force_n").measured(0.0, 0.0, "N"));
    }
    found.extend(implausible(study, outcome));
    let swing_mm = 1e-3 * outcome.verdict.peak_to_peak_um;
    let model_mm = MODEL_ENDS * study.case.cutting.radius_mm;
    if swing_mm > model_mm {
        found.push(Finding::new("motion_beyond_model", "/fixture").measured(swing_mm, model_mm, "mm"));
    }
    if job.fixture.grip().is_some_and(|grip| grip.friction == Friction::ASSUMED) {
        let FrictionRange { low, high, .. } = Friction::ASSUMED.range();
        found.push(Finding::new("friction_assumed", "/fixture/clamp/friction").with("low", low).with("high", high));
    }
    if let Some(slip) = outcome.clamp.as_ref().and_then(|clamp| clamp.slip.as_ref())
        && let (Some(false), Some(given)) = (slip.holds, case.holding.clamp_force_n)
    {
        let needed = slip.clamp_force_min_n;
        found.push(Finding::new("clamp_slips", "/fixture/clamp_force_n").measured(given, needed, "N"));
    }
    found.extend(of_runs(outcome, aside));
    spindle_warnings(study, outcome, &mut found);
    let multiplier = &outcome.multiplier;
    if (multiplier.modulus - 1.0).abs() < multiplier.modulus_error {
        found.push(Finding::new("multiplier_not_converged", "/cut").measured(
            multiplier.modulus,
            multiplier.modulus_error,
            "1",
        ));
    }
    if study.chatter_mm.is_none() && study.examined_mm < study.asked_mm {
        let (reached, asked) = (study.examined_mm, study.asked_mm);
        found.push(Finding::new("no_forced_motion_beyond", "/effects").measured(reached, asked, "mm"));
    } else if depth > study.examined_mm {
        found.push(Finding::new("depth_not_examined", "/limits/depth_max_mm").measured(depth, study.examined_mm, "mm"));
    }
    if let Some(run) = &outcome.simulation
        && outcome.verdict.state == FixtureState::Chatter
        && multiplier.modulus < 1.0
    {
        found.push(Finding::new("verdict_by_simulation", "/simulation").measured(run.sample_scatter, 1e-3, "1"));
    }
    found.extend(outcome.conformance.as_ref().and_then(conformance::warnings));
    found
}

/// What the runs in time are worth; nothing where there were none.
fn of_runs(outcome: &FixtureOutcome, aside: &Aside) -> Vec<Finding> {
    let Some(run) = &outcome.simulation else { return Vec::new() };
    let mut found: Vec<Finding> = aside.cut.and_then(|cut| unsteady(cut, "as_given")).into_iter().collect();
    // Of a cut without a clamp force both are one run.
    if run.unilateral || aside.cut == Some(Steady::Reached) {
        found.extend(aside.bonded.and_then(|bonded| unsteady(bonded, "closed")));
    }
    let highest = outcome.modes.last().map_or(0.0, |mode| mode.natural_frequency_hz);
    let per_oscillation = f64::from(run.steps_per_tooth) * outcome.engagement.tooth_frequency_hz / highest;
    if per_oscillation < COARSEST_STEPS {
        let at = "/simulation/steps_per_tooth";
        found.push(Finding::new("simulation_too_coarse", at).measured(per_oscillation, COARSEST_STEPS, "1"));
    }
    found
}

/// A run without a steady state: of joints as the job has them, or closed in any case.
fn unsteady(steady: Steady, joints: &'static str) -> Option<Finding> {
    match steady {
        Steady::Reached => None,
        Steady::Diverged => Some(Finding::new("simulation_diverged", "/simulation").with("joints", joints)),
        Steady::Thrown { farthest_mm, fed_mm } => Some(
            Finding::new("simulation_thrown", "/simulation/tooth_periods")
                .measured(farthest_mm, fed_mm, "mm")
                .with("joints", joints),
        ),
    }
}

fn spindle_warnings(study: &Study<'_>, outcome: &FixtureOutcome, found: &mut Vec<Finding>) {
    let (job, drive) = (study.job, &outcome.drive);
    if let Some(limit) = drive.power_limit_kw
        && drive.motor_power_kw > limit
    {
        found.push(Finding::new("spindle_power_exceeded", "/cut/depth_mm").measured(drive.motor_power_kw, limit, "kW"));
    }
    if let Some(limit) = drive.torque_limit_n_m
        && drive.torque_mean_n_m > limit
    {
        let asked = drive.torque_mean_n_m;
        found.push(Finding::new("spindle_torque_exceeded", "/cut/depth_mm").measured(asked, limit, "N m"));
    }
    if let Some((from, to)) = job.spindle.as_ref().and_then(Spindle::tabled_rpm) {
        let speed = study.case.working.spindle_rpm;
        if speed < from || speed > to {
            let end = if speed < from { from } else { to };
            found.push(
                Finding::new("spindle_speed_outside_table", "/cut/spindle_speed_rpm").measured(speed, end, "rev/min"),
            );
        }
    }
}

fn joint_name(joint: Option<OpenJoint>) -> &'static str {
    match joint {
        Some(OpenJoint::Movable) => "movable",
        Some(OpenJoint::Fixed) => "fixed",
        Some(OpenJoint::Both) => "both",
        None => "none",
    }
}

pub(in crate::fixture_stability) fn explanation(
    study: &Study<'_>,
    outcome: &FixtureOutcome,
    aside: &Aside,
) -> Vec<Message> {
    let verdict = &outcome.verdict;
    let multiplier = &outcome.multiplier;
    let feed_um = 1e3 * study.case.working.feed_mm;
    // A motion beyond the model is no fact, nor is that about which a slow cut chatters.
    let known = !study.is_slow || study.stable();
    let within = known && verdict.peak_to_peak_um <= 1e3 * MODEL_ENDS * study.case.cutting.radius_mm;
    let moving =
        |message: Message| if within { message.with("peak_to_peak_um", verdict.peak_to_peak_um) } else { message };
    let mut said = vec![match verdict.state {
        FixtureState::Stable => moving(Message::new("fixture_stable").with("modulus", multiplier.modulus)),
        FixtureState::Chatter => moving(of_chatter(outcome, aside)),
        FixtureState::ChipLost => Message::new("fixture_chip_lost").with("share", verdict.lost_cut_share),
        FixtureState::JointOpen => moving(
            Message::new("fixture_joint_opens")
                .with("joint", joint_name(verdict.joint))
                .with("time_s", verdict.first_opening_s.unwrap_or(0.0))
                .with("share", verdict.open_share),
        ),
        FixtureState::SpindleOverloaded => {
            moving(Message::new("fixture_spindle_overloaded").with("margin", verdict.drive_margin.unwrap_or(0.0)))
        }
    }];
    if study.is_slow {
        let (oscillations, _) = in_a_period(&study.case.holding, &study.case.cutting, study.case.working.spindle_rpm);
        said.push(Message::new("fixture_slow_cut").with("oscillations", oscillations));
    }
    if let Some(time_s) = multiplier.settling_time_s.filter(|_| aside.settling == Settling::Slowly) {
        said.push(
            Message::new("fixture_settles_slowly")
                .with("time_s", time_s)
                .with("teeth", (time_s * outcome.engagement.tooth_frequency_hz).ceil()),
        );
    }
    said.push(match study.chatter_mm {
        Some(limit) => Message::new("chatter_limit_is")
            .with("depth_mm", limit)
            .with("spindle_speed_rpm", study.case.working.spindle_rpm),
        None => Message::new("no_chatter_limit").with("depth_mm", study.examined_mm),
    });
    if let Some(conformance) = &outcome.conformance {
        said.extend(conformance::said(conformance));
        let asked = study.job.asks(Analysis::Certainty);
        let depths = outcome.probable_depths.as_ref();
        said.extend(asked.then(|| probable_depths::said_of(depths, conformance.joint.wanted)).flatten());
    }
    said.extend(of_spindle(outcome));
    if let Some(lobes) = &outcome.lobes {
        if let Some(better) = lobes.better_speeds.first() {
            said.push(
                Message::new("better_speed_is")
                    .with("spindle_speed_rpm", better.spindle_speed_rpm)
                    .with("depth_mm", better.depth_mm)
                    .with("removal_rate_cm3_per_min", better.removal_rate_cm3_per_min)
                    .with("clamp_force_n", better.clamp_force_n)
                    .with("what", better.first.map_or("none", FirstLimit::name))
                    .with("limit_mm", better.first_mm.unwrap_or(better.depth_mm)),
            );
        }
        if let Some(lowest) = &lobes.lowest {
            said.push(
                Message::new("lowest_limit_is")
                    .with("spindle_speed_rpm", lowest.spindle_speed_rpm)
                    .with("depth_mm", lowest.chatter_mm.unwrap_or(study.examined_mm)),
            );
        }
    }
    if let Some(limits) = &outcome.limits
        && let (Some(first), Some(depth)) = (limits.first, limits.first_mm)
    {
        said.push(
            Message::new("first_limit_is")
                .with("what", FirstLimit::name(first))
                .with("depth_mm", depth)
                .with("removal_rate_cm3_per_min", limits.removal_rate_cm3_per_min.unwrap_or(0.0)),
        );
    }
    if let Some(clamp) = &outcome.clamp {
        said.push(of_clamp(clamp, aside));
        said.extend(of_slip(study, clamp));
        // What chatters already does not begin to.
        said.extend(clamp.binding_joint.filter(|_| clamp.stable).map(|joint| of_opening(clamp, joint, aside)));
    }
    if within && verdict.peak_to_peak_over_feed > 1.0 {
        said.push(
            Message::new("amplitude_over_feed")
                .with("peak_to_peak_um", verdict.peak_to_peak_um)
                .with("feed_um", feed_um),
        );
    }
    said.push(Message::new("no_surface_location_error"));
    said.push(Message::new("fixture_not_modelled"));
    said
}

/// How the cut chatters.
fn of_chatter(outcome: &FixtureOutcome, aside: &Aside) -> Message {
    let multiplier = &outcome.multiplier;
    let (code, is_small) = if aside.settling == Settling::VibratesOn {
        ("fixture_vibrates_on", true)
    } else {
        ("fixture_grows_within", multiplier.modulus < 1.0)
    };
    if !is_small {
        return Message::new("fixture_chatters")
            .with("modulus", multiplier.modulus)
            .with("frequency_hz", multiplier.chatter_frequency_hz)
            .with("kind", if multiplier.kind == ChatterKind::Flip { "flip" } else { "hopf" });
    }
    let message = Message::new(code).with("modulus", multiplier.modulus);
    match multiplier.growth_within {
        Some(growth) => message.with("growth", growth).with("frequency_hz", multiplier.chatter_frequency_hz),
        None => message,
    }
}

/// What the clamp has to give.
fn of_clamp(clamp: &ClampForce, aside: &Aside) -> Message {
    let Some(least) = clamp.least_n else {
        let why = match aside.bonded {
            None => "slow",
            Some(Steady::Diverged) => "diverged",
            Some(_) => "thrown",
        };
        return Message::new("clamp_force_unknown").with("why", why);
    };
    // Nothing is asked: of no force either, so there is neither factor nor inertia to speak of.
    let code = if least <= 0.0 {
        "clamp_force_needed"
    } else if !clamp.stable {
        "clamp_force_in_chatter"
    } else if clamp.factor_needed.is_some() {
        "clamp_force_needed"
    } else {
        "clamp_force_only_inertia"
    };
    let mut message = Message::new(code).with("least_n", least).with("joint", joint_name(clamp.binding_joint));
    for (name, value) in [("entry_n", clamp.least_with_entry_n), ("factor", clamp.factor_needed)] {
        if let Some(value) = value {
            message = message.with(name, value);
        }
    }
    message
}

/// What friction has to hold along the jaws, and from which clamp force on it does.
fn of_slip(study: &Study<'_>, clamp: &ClampForce) -> Option<Message> {
    let along = &clamp.along;
    let pushed =
        |code| Message::new(code).with("across_mean_n", along.across_mean_n).with("across_peak_n", along.across_peak_n);
    let Some(grip) = &study.case.grip else { return Some(pushed("clamp_force_slip_unknown")) };
    let slip = clamp.slip.as_ref()?;
    let set_n = clamp.least_n.map_or(slip.clamp_force_min_n, |opens| opens.max(slip.clamp_force_min_n));
    Some(
        pushed("clamp_force_against_slip")
            .with("upward_peak_n", along.upward_peak_n)
            .with("friction_low", grip.friction.low)
            .with("friction", grip.friction.value)
            .with("least_n", slip.clamp_force_min_n)
            .with("likely_n", slip.at_likely_friction_n)
            .with("set_n", set_n),
    )
}

/// What becomes of the cut when the joint that gives first opens.
fn of_opening(clamp: &ClampForce, joint: OpenJoint, aside: &Aside) -> Message {
    let (modulus, error) = match joint {
        OpenJoint::Movable => (clamp.modulus_movable_open, aside.open_errors[0]),
        _ => (clamp.modulus_fixed_open, aside.open_errors[1]),
    };
    let code = if modulus - 1.0 > error.max(ROUND_OFF) { "opening_is_unstable" } else { "opening_stays_stable" };
    Message::new(code).with("joint", joint_name(Some(joint))).with("modulus", modulus)
}

/// What the spindle allows at this speed, where something is known of it.
fn of_spindle(outcome: &FixtureOutcome) -> Option<Message> {
    let drive = &outcome.drive;
    let margin = outcome.verdict.drive_margin?;
    let (power, torque) = (drive.power_depth_mm, drive.torque_depth_mm);
    let depth = [power, torque].into_iter().flatten().reduce(f64::min)?;
    let what = if power.is_some_and(|power| power <= depth) { "power" } else { "torque" };
    let code = match outcome.chatter_depth_mm {
        Some(chatter) if chatter < depth => "spindle_suffices",
        _ => "spindle_limits_depth",
    };
    Some(
        Message::new(code)
            .with("what", what)
            .with("depth_mm", depth)
            .with("power_kw", drive.motor_power_kw)
            .with("torque_n_m", drive.torque_mean_n_m)
            .with("margin", margin),
    )
}
