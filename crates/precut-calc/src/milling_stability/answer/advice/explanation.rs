//! What is said of an answer.

use crate::calculator::Message;

use super::super::super::job::{Asked, way};
use super::super::super::model::GROWN;
use super::super::output::{
    ClampCriterion, ClampRemedyKind, ClampStation, CutterProposal, ForceOfSide, InstabilityKind, LeadingMultiplier,
    MillingClamping, MillingState, Outcome, ProposalKind, RigidLimits, SpeedPocket, UnstableInterval,
};
use super::super::{Aside, Study, conformance, measured};

/// One side limits where a rigid other one changes the limit by less than this share.
const SAME: f64 = 0.02;
/// A disturbance that takes longer than this decays slowly, s.
const SLOW_S: f64 = 1.0;
/// Forces below this are none, N.
const NO_FORCE_N: f64 = 1e-6;
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

/// A force as it is printed, four digits, never less than it was.
pub(super) fn rounded_up(force_n: f64) -> f64 {
    if force_n <= 0.0 {
        return 0.0;
    }
    let step = 10_f64.powf(force_n.log10().floor() - 3.0);
    (force_n / step * (1.0 - 1e-12)).ceil() * step
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
