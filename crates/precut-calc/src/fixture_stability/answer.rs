//! The answer, put together.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use crate::calculator::{Failure, Message, Monitor, checkpoint};

use super::acting::Case;
use super::drive::{self, DriveDepths};
use super::floquet::{Multiplier, Working};
use super::holding::Closed;
use super::input::{Analysis, FixtureJob, SimulationSettings};
use super::lobes::{ChatterLimit, Plane, Point, Rules, boundary, by_states, critical_depth, map, point};
use super::march::{Marched, Plan, Step};
use super::output::{
    AmplitudeCurve, ArcProfile, ChatterKind, ClampForce, CuttingDrive, DepthLimits, Engagement, FirstLimit,
    FixtureOutcome, FixtureState, FixtureVerdict, FloquetMultiplier, ForcedMotion, Histories, LobeBoundary,
    LobeDiagram, LobeMap, OpenJoint, Oscillogram, QuasiStatic, Simulated, SpeedLimit, TextbookForce, VibrationMode,
    ZerothOrder,
};
use super::parts::plane_of;
use super::picture::lobes_so_far;
use super::response::{Response, response, span_mm, unbroken};
use super::simulate::{Observed, Steady, count, observed, plan, run, scatter, small};
use super::zeroth::{at_speed, depth_mm, zeroth};

pub(super) const UM_PER_MM: f64 = 1e3;
/// Sampling error of the exact forced motion, relative.
const SAMPLING: f64 = 1e-6;
/// Safety factors that textbooks use.
const TEXTBOOK_FACTORS: [f64; 4] = [1.5, 2.0, 2.5, 6.0];
/// Entries of an oscillogram at most.
const OSCILLOGRAM: usize = 1200;
/// Steps of the bracketing of a limit that only simulation gives: to 1/256 of a step of the curve.
const BRACKETING: u32 = 8;
/// The same of one that the forced motion of a vise that is not linear gives: to a 16 000 000th of the depth.
const HALVINGS: u32 = 24;
/// A limit of what grows with the depth is taken up to this share of it: what is advised is within, whatever is rounded.
const WITHIN: f64 = 0.995;
/// A depth above this share of the limit of chatter, or of the opening of a joint, is near it.
pub(super) const NEAR_LIMIT: f64 = 0.9;
/// Better speeds that are listed.
const BETTER_SPEEDS: usize = 5;

/// What the parts of an answer share.
pub(super) struct Study<'a> {
    pub job: &'a FixtureJob,
    pub case: Case,
    pub rules: Rules,
    pub monitor: &'a dyn Monitor,
    pub point: Point,
    pub forced: Response,
    /// How deep limits were to be looked for, and how deep they could be.
    pub asked_mm: f64,
    pub examined_mm: f64,
    pub chatter_mm: Option<f64>,
}

/// What the advice asks beside the answer.
pub(super) struct Aside {
    /// What the cut as it was run shows, and what it does with joints that stay closed.
    pub cut: Steady,
    pub bonded: Option<Steady>,
    /// Errors of the moduli with the joint at the movable and at the fixed jaw open.
    pub open_errors: [f64; 2],
    pub better: Option<Better>,
}

/// A speed with a depth that was tried there.
pub(super) struct Better {
    pub spindle_rpm: f64,
    pub depth_mm: f64,
    /// What gives out first at this speed, and at which depth.
    pub first: Option<(FirstLimit, f64)>,
}

impl<'a> Study<'a> {
    pub(super) fn new(job: &'a FixtureJob, case: Case, monitor: &'a dyn Monitor) -> Result<Self, Failure> {
        let rules = Rules::new();
        let point = point(&rules, &case.holding, &case.cutting, case.working, Closed::BOTH)?;
        let forced = forced(&case, case.working)?;
        let asked_mm = examined_mm(job, &case);
        let limit = critical_depth(&rules, &case.holding, &case.cutting, case.working, asked_mm)?;
        let ChatterLimit { depth_mm: chatter_mm, examined_mm } = limit;
        Ok(Self { job, case, rules, monitor, point, forced, asked_mm, examined_mm, chatter_mm })
    }

    /// Where chatter begins at the working speed.
    fn chatter(&self) -> ChatterLimit {
        ChatterLimit { depth_mm: self.chatter_mm, examined_mm: self.examined_mm }
    }

    fn stable(&self) -> bool {
        self.point.multiplier.modulus < 1.0
    }

    /// Depths at which the spindle of the job gives out at a speed; none without one.
    fn drive_depths(&self, spindle_rpm: f64) -> DriveDepths {
        let working = Working { spindle_rpm, ..self.case.working };
        self.job.spindle.as_ref().map_or_else(DriveDepths::default, |of| drive::depths(&self.case, of, working))
    }

    /// Runs the cut in time at the working point.
    fn simulated(&self, unilateral: bool, keep: bool) -> Result<Observed, Failure> {
        let mut plan = plan(&self.case, &self.job.simulation, self.case.working, self.point.multiplier.modulus);
        plan.unilateral = unilateral;
        if keep {
            let revolution = self.case.cutting.teeth.clamp(4, 40);
            plan.keep_first = revolution.min(plan.tooth_periods / 2);
            plan.keep_last = revolution.min(plan.tooth_periods / 2);
        }
        observed(&self.case, &plan, self.monitor)
    }

    /// What limits the depth at a speed where chatter does so.
    fn speed_limit(&self, spindle_rpm: f64, chatter: ChatterLimit) -> Result<SpeedLimit, Failure> {
        let [amplitude_mm, movable_opens_mm, fixed_opens_mm] =
            forced_limits(&self.case, spindle_rpm, chatter.depth_mm.unwrap_or(chatter.examined_mm))?;
        Ok(SpeedLimit {
            spindle_speed_rpm: spindle_rpm,
            depth_examined_mm: chatter.examined_mm,
            chatter_mm: chatter.depth_mm,
            amplitude_mm,
            movable_opens_mm,
            fixed_opens_mm,
            drive_mm: self.drive_depths(spindle_rpm).least_mm(),
        })
    }
}

pub(super) fn forced(case: &Case, working: Working) -> Result<Response, Failure> {
    by_states!(case.holding, response(&case.holding, &case.cutting, working))
}

/// Whether there is a motion about which to ask: away from the working point there may be none where joints harden.
fn has_motion(case: &Case, working: Working) -> bool {
    let found = || by_states!(case.holding, unbroken(&case.holding, &case.cutting, working));
    case.holding.hardening_per_mm2 <= 0.0 || found().is_some()
}

/// Peak-to-peak displacement of the forced motion, mm.
pub(super) fn forced_span_mm(case: &Case, working: Working) -> Result<f64, Failure> {
    by_states!(case.holding, span_mm(&case.holding, &case.cutting, working))
}

/// How deep limits are looked for: as the job says, else well above the zeroth-order limit and the working depth.
fn examined_mm(job: &FixtureJob, case: &Case) -> f64 {
    if let Some(depth) = job.limits.depth_max_mm.or(job.lobes.depth_max_mm) {
        return depth;
    }
    let zeroth = zeroth(&case.holding, &case.cutting);
    let feed = case.working.feed_mm;
    let by_zeroth = at_speed(&case.holding, &case.cutting, case.working.spindle_rpm)
        .or(zeroth.least.map(|(kappa, _)| kappa))
        .map(|kappa| 2.5 * depth_mm(&case.cutting, zeroth.mean_factor, kappa, feed));
    by_zeroth.unwrap_or(10.0).max(2.0 * case.working.depth_mm).clamp(0.001, 1000.0)
}

/// Depths up to `limit_mm` at which the forced motion at a speed exceeds the feed per tooth and opens the joint at the movable
/// and that at the fixed jaw.
fn forced_limits(case: &Case, spindle_rpm: f64, limit_mm: f64) -> Result<[Option<f64>; 3], Failure> {
    let force = case.holding.clamp_force_n;
    let most = [Some(case.working.feed_mm), force, force];
    let at = |depth_mm: f64| -> Result<[f64; 3], Failure> {
        let working = Working { spindle_rpm, depth_mm, ..case.working };
        if !has_motion(case, working) {
            return Ok([f64::INFINITY; 3]);
        }
        match forced(case, working) {
            Ok(of) => Ok([of.x_mm.span(), of.left_elastic_n.high, of.right_elastic_n.high]),
            // No motion that repeats itself: it grows without end.
            Err(Failure::OutOfModel(_) | Failure::NotConverged { .. }) => Ok([f64::INFINITY; 3]),
            Err(why) => Err(why),
        }
    };
    let mut reached = [None; 3];
    if case.is_linear() {
        // At 1 mm; the forced motion goes with H^(1-mu).
        let (power, at_1_mm) = (1.0 / (1.0 - case.cutting.depth_exponent), at(1.0)?);
        for (depth, (most, value)) in reached.iter_mut().zip(most.into_iter().zip(at_1_mm)) {
            *depth = most.filter(|_| value > 0.0).map(|most| (most / value).powf(power)).filter(|d| *d <= limit_mm);
        }
        return Ok(reached);
    }
    let deepest = at(limit_mm)?;
    for (which, depth) in reached.iter_mut().enumerate() {
        let Some(most) = most[which].filter(|most| deepest[which] > *most) else { continue };
        let (mut low, mut high) = (0.0, limit_mm);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if at(middle)?[which] > most { high = middle } else { low = middle }
        }
        *depth = Some(low);
    }
    Ok(reached)
}

/// Computes everything that the job asks.
pub(super) fn outcome(study: &Study<'_>) -> Result<(FixtureOutcome, Aside), Failure> {
    let Study { job, case, monitor, .. } = study;
    checkpoint(*monitor)?;
    monitor.progress(0.05, Message::new("stage_simulation"));
    let keep = job.asks(Analysis::History);
    let cut = study.simulated(case.holding.clamp_force_n.is_some(), keep)?;
    let mut simulation = simulation(study, &cut);
    if job.simulation.verified {
        let finer = Plan { steps_per_tooth: 2 * cut.plan.steps_per_tooth, keep_first: 0, keep_last: 0, ..cut.plan };
        let again = run(case, &finer, *monitor)?;
        simulation.halved_step_change_um = Some((again.x_mm.span() - cut.run.x_mm.span()).abs() * UM_PER_MM);
    }
    checkpoint(*monitor)?;
    let mut aside = Aside { cut: cut.steady, bonded: None, open_errors: [0.0; 2], better: None };
    let clamp = if job.asks(Analysis::ClampForce) {
        monitor.progress(0.15, Message::new("stage_clamp_force"));
        Some(clamp_force(study, &mut aside)?)
    } else {
        None
    };
    let limits = if job.asks(Analysis::Limits) {
        monitor.progress(0.2, Message::new("stage_limits"));
        Some(limits(study)?)
    } else {
        None
    };
    let lobes = if job.asks(Analysis::Lobes) { Some(lobes(study, &mut aside)?) } else { None };
    let history = keep.then(|| histories(study, &cut.run));
    let zeroth_order = zeroth_order(study);
    let drive = cutting_drive(study);
    let outcome = FixtureOutcome {
        verdict: verdict(study, &simulation, &cut.run, drive.margin()),
        engagement: engagement(study),
        quasi_static: quasi_static(case),
        drive,
        modes: case
            .holding
            .modes()
            .into_iter()
            .map(|mode| VibrationMode {
                natural_frequency_hz: mode.natural_hz,
                damped_frequency_hz: mode.damped_hz,
                damping_ratio: mode.damping_ratio,
            })
            .collect(),
        multiplier: multiplier(study),
        chatter_depth_mm: study.chatter_mm,
        depth_examined_mm: study.examined_mm,
        zeroth_order,
        forced: forced_motion(study),
        simulation,
        clamp,
        limits,
        lobes,
        history,
    };
    Ok((outcome, aside))
}

fn engagement(study: &Study<'_>) -> Engagement {
    let case = &study.case;
    let (cutting, working) = (&case.cutting, case.working);
    let stretches = cutting.stretches();
    let z = cutting.teeth as f64;
    let table = working.feed_mm * working.spindle_rpm * z;
    Engagement {
        entry_angle_deg: cutting.entry_rad.to_degrees(),
        exit_angle_deg: cutting.exit_rad.to_degrees(),
        arc_deg: cutting.arc_rad().to_degrees(),
        teeth_in_cut_mean: cutting.arc_rad() * z / TAU,
        teeth_in_cut_max: small(stretches.iter().map(|s| s.teeth).max().unwrap_or(0)),
        teeth_in_cut_min: small(stretches.iter().map(|s| s.teeth).min().unwrap_or(0)),
        spindle_speed_rpm: working.spindle_rpm,
        speed_m_per_min: TAU * cutting.radius_mm * working.spindle_rpm / 1000.0,
        feed_mm_per_tooth: working.feed_mm,
        feed_mm_per_min: table,
        tooth_frequency_hz: working.spindle_rpm * z / 60.0,
        removal_rate_cm3_per_min: removal_rate(case, working.depth_mm),
    }
}

/// Width of the strip within the cutter times depth times table feed, cm3/min.
pub(super) fn removal_rate(case: &Case, depth_mm: f64) -> f64 {
    let width = case.cutting.radius_mm * (case.cutting.entry_rad.cos() - case.cutting.exit_rad.cos());
    width * depth_mm * case.working.feed_mm * case.working.spindle_rpm * case.cutting.teeth as f64 / 1000.0
}

fn quasi_static(case: &Case) -> QuasiStatic {
    let (high, low) = case.cutting.static_extremes_n(case.working.feed_mm, case.working.depth_mm);
    let stiffness = case.holding.static_stiffness_n_per_mm();
    QuasiStatic {
        force_max_n: high,
        force_min_n: low,
        stiffness_n_per_mm: stiffness,
        displacement_max_um: high / stiffness * UM_PER_MM,
        displacement_min_um: low / stiffness * UM_PER_MM,
    }
}

/// What the cut asks of the spindle (`fixture/5.8`).
fn cutting_drive(study: &Study<'_>) -> CuttingDrive {
    let Study { case, job, .. } = study;
    let working = case.working;
    let torque = drive::mean_torque_n_m(&case.cutting, working.feed_mm, working.depth_mm);
    let power_kw = drive::power_kw(torque, working.spindle_rpm);
    let available = job.spindle.as_ref().map(|spindle| spindle.available(working.spindle_rpm));
    let depths = study.drive_depths(working.spindle_rpm);
    CuttingDrive {
        torque_mean_n_m: torque,
        torque_max_n_m: case.cutting.tangential_max_n(working.feed_mm, working.depth_mm) * case.cutting.radius_mm
            / 1000.0,
        power_kw,
        motor_power_kw: power_kw / job.spindle.as_ref().map_or(1.0, |spindle| spindle.efficiency),
        power_limit_kw: available.and_then(|of| of.power_kw),
        torque_limit_n_m: available.and_then(|of| of.torque_n_m),
        power_depth_mm: depths.power_mm,
        torque_depth_mm: depths.torque_mm,
    }
}

impl CuttingDrive {
    /// What the spindle gives over what the cut asks, the lesser of power and torque.
    fn margin(&self) -> Option<f64> {
        let of = |limit: Option<f64>, asked: f64| limit.filter(|_| asked > 0.0).map(|limit| limit / asked);
        let both = [of(self.power_limit_kw, self.motor_power_kw), of(self.torque_limit_n_m, self.torque_mean_n_m)];
        both.into_iter().flatten().reduce(f64::min)
    }
}

/// Frequency at which a multiplier vibrates: of all aliases the one nearest to a mode, Hz.
fn chatter_frequency_hz(case: &Case, found: &Multiplier) -> f64 {
    let period = case.cutting.tooth_period_s(case.working.spindle_rpm) * found.phases as f64;
    let angle = found.im.atan2(found.re);
    let mut best = (f64::INFINITY, 0.0);
    for mode in case.holding.modes() {
        for sign in [1.0, -1.0] {
            let turns = (mode.damped_hz * period - sign * angle / TAU).round();
            let frequency = (sign * angle / TAU + turns) / period;
            let distance = (frequency - mode.damped_hz).abs();
            if frequency >= 0.0 && distance < best.0 {
                best = (distance, frequency);
            }
        }
    }
    best.1
}

fn multiplier(study: &Study<'_>) -> FloquetMultiplier {
    let found = study.point.multiplier;
    let kind = if found.im > 1e-9 * found.modulus {
        ChatterKind::Hopf
    } else if found.re < 0.0 {
        ChatterKind::Flip
    } else {
        ChatterKind::Fold
    };
    let tau = study.case.cutting.tooth_period_s(study.case.working.spindle_rpm);
    FloquetMultiplier {
        modulus: found.modulus,
        real: found.re,
        imaginary: found.im.abs(),
        tooth_periods: small(found.phases),
        kind,
        chatter_frequency_hz: chatter_frequency_hz(&study.case, &found),
        // A disturbance that vanishes within a tooth period decays at no finite rate: 1e-300 stands for it.
        growth_per_s: found.modulus.max(1e-300).ln() / tau,
        modulus_error: study.point.error,
    }
}

fn zeroth_order(study: &Study<'_>) -> ZerothOrder {
    let case = &study.case;
    let found = zeroth(&case.holding, &case.cutting);
    let feed = case.working.feed_mm;
    let depth = |kappa: f64| depth_mm(&case.cutting, found.mean_factor, kappa, feed);
    ZerothOrder {
        mean_directional_factor: found.mean_factor,
        depth_min_mm: found.least.map(|(kappa, _)| depth(kappa)),
        frequency_hz: found.least.map(|(_, hz)| hz),
        depth_at_speed_mm: at_speed(&case.holding, &case.cutting, case.working.spindle_rpm).map(depth),
    }
}

fn forced_motion(study: &Study<'_>) -> ForcedMotion {
    let forced = &study.forced;
    let (high, low) = study.case.cutting.static_extremes_n(study.case.working.feed_mm, study.case.working.depth_mm);
    let quasi = (high - low) / study.case.holding.static_stiffness_n_per_mm();
    ForcedMotion {
        displacement_max_um: forced.x_mm.high * UM_PER_MM,
        displacement_min_um: forced.x_mm.low * UM_PER_MM,
        peak_to_peak_um: forced.x_mm.span() * UM_PER_MM,
        displacement_at_entry_um: forced.x_at_entry_mm * UM_PER_MM,
        displacement_at_exit_um: forced.x_at_exit_mm * UM_PER_MM,
        dynamic_factor: (quasi > 0.0).then(|| forced.x_mm.span() / quasi),
        clamp_movable_n: forced.left_n.high.max(0.0),
        clamp_fixed_n: forced.right_n.high.max(0.0),
    }
}

fn simulation(study: &Study<'_>, Observed { plan, run, .. }: &Observed) -> Simulated {
    let (sample_scatter, settled) = scatter(&study.case, plan, run);
    Simulated {
        steps_per_tooth: small(plan.steps_per_tooth),
        tooth_periods: small(plan.tooth_periods),
        steady_tooth_periods: small(plan.steady_periods),
        diverged: run.diverged,
        settled: settled && !run.diverged,
        sample_scatter,
        displacement_max_um: run.x_mm.high * UM_PER_MM,
        displacement_min_um: run.x_mm.low * UM_PER_MM,
        peak_to_peak_um: run.x_mm.span() * UM_PER_MM,
        force_max_n: run.force_n.high,
        force_min_n: run.force_n.low,
        effective_feed_max_mm: run.feed_mm.high,
        effective_feed_min_mm: run.feed_mm.low,
        lost_cut_share: run.lost_cut,
        first_lost_cut_s: run.first_lost_s,
        clamp_movable_n: run.left_n.high.max(0.0),
        clamp_fixed_n: run.right_n.high.max(0.0),
        clamp_movable_entry_n: run.left_entry_n.max(0.0),
        clamp_fixed_entry_n: run.right_entry_n.max(0.0),
        unilateral: plan.unilateral,
        open_movable_share: run.open.left,
        open_fixed_share: run.open.right,
        open_both_share: run.open.both,
        halved_step_change_um: None,
    }
}

fn verdict(study: &Study<'_>, simulated: &Simulated, run: &Marched, drive_margin: Option<f64>) -> FixtureVerdict {
    let case = &study.case;
    let opened = (run.first_open_left_s, run.first_open_right_s);
    let joint = match opened {
        (Some(_), Some(_)) => Some(OpenJoint::Both),
        (Some(_), None) => Some(OpenJoint::Movable),
        (None, Some(_)) => Some(OpenJoint::Fixed),
        (None, None) => None,
    };
    let state = if joint.is_some() {
        FixtureState::JointOpen
    } else if !study.stable() || !simulated.settled {
        FixtureState::Chatter
    } else if drive_margin.is_some_and(|margin| margin < 1.0) {
        FixtureState::SpindleOverloaded
    } else if run.lost_cut > 0.0 {
        FixtureState::ChipLost
    } else {
        FixtureState::Stable
    };
    // The spindle does not shake the workpiece: what it could not drive would still move as the forced motion does.
    let exact = matches!(state, FixtureState::Stable | FixtureState::SpindleOverloaded) && run.lost_cut <= 0.0;
    let range = if exact { study.forced.x_mm } else { run.x_mm };
    let span_um = range.span() * UM_PER_MM;
    let asked = case.above_round_off_n(study.forced.left_n.high.max(study.forced.right_n.high));
    FixtureVerdict {
        state,
        joint,
        first_opening_s: [opened.0, opened.1].into_iter().flatten().reduce(f64::min),
        open_share: run.open.left + run.open.right - run.open.both,
        lost_cut_share: run.lost_cut,
        peak_to_peak_um: span_um,
        peak_to_peak_over_feed: range.span() / case.working.feed_mm,
        peak_to_peak_error_um: if exact { Some(SAMPLING * span_um) } else { simulated.halved_step_change_um },
        displacement_max_um: range.high.abs().max(range.low.abs()) * UM_PER_MM,
        depth_margin: study.chatter_mm.filter(|_| case.working.depth_mm > 0.0).map(|h| h / case.working.depth_mm),
        clamp_margin: case.holding.clamp_force_n.filter(|_| exact && asked > 0.0).map(|force| force / asked),
        drive_margin,
    }
}

/// Static force on the joints at the movable and the fixed jaw (`fixture/5.7`).
pub(super) fn static_clamp_n(case: &Case, high_n: f64, low_n: f64) -> (f64, f64) {
    let (left, right) = (case.holding.left.stiffness_n_per_mm, case.holding.right.stiffness_n_per_mm);
    let (toward_movable, toward_fixed) = (case.above_round_off_n(high_n), case.above_round_off_n(-low_n));
    if case.holding.jaw.is_some() {
        (0.0, toward_movable)
    } else {
        (toward_fixed * left / (left + right), toward_movable * right / (left + right))
    }
}

fn clamp_force(study: &Study<'_>, aside: &mut Aside) -> Result<ClampForce, Failure> {
    let case = &study.case;
    let stable = study.stable();
    let Observed { run, steady, .. } = study.simulated(false, false)?;
    aside.bonded = Some(steady);
    let is_seen = steady == Steady::Reached;
    let asked = if stable {
        let forced = &study.forced;
        Some([forced.left_n, forced.right_n, forced.left_elastic_n, forced.right_elastic_n])
    } else {
        // A run that shows no steady state says of no clamp force that it is enough.
        is_seen.then_some([run.left_n, run.right_n, run.left_elastic_n, run.right_elastic_n])
    };
    let asked = asked.map(|ranges| ranges.map(|range| case.above_round_off_n(range.high)));
    let least_n = asked.map(|[movable, fixed, ..]| movable.max(fixed));
    let with_entry = |least: f64| {
        [run.left_entry_n, run.right_entry_n].map(|n| case.above_round_off_n(n)).into_iter().fold(least, f64::max)
    };
    let least_with_entry_n = least_n.filter(|_| is_seen).map(with_entry);
    let (high, low) = case.cutting.static_extremes_n(case.working.feed_mm, case.working.depth_mm);
    let (static_movable_n, static_fixed_n) = static_clamp_n(case, high, low);
    let static_n = static_movable_n.max(static_fixed_n);
    let over_static = |force: Option<f64>| force.filter(|_| static_n > 0.0).map(|force| force / static_n);
    let power = 1.0 / (1.0 - case.cutting.depth_exponent);
    let depth_for = |(force, least): (f64, f64)| case.working.depth_mm * (force / least).powf(power);
    let depth_for_given = case
        .holding
        .clamp_force_n
        .zip(least_n.filter(|least| stable && *least > 0.0 && case.is_linear()))
        .map(depth_for)
        .filter(|depth| *depth <= study.chatter_mm.unwrap_or(study.examined_mm));
    let open = |closed: Closed| point(&study.rules, &case.holding, &case.cutting, case.working, closed);
    let movable_open = open(Closed { left: false, right: true })?;
    let fixed_open = open(Closed { left: true, right: false })?;
    aside.open_errors = [movable_open.error, fixed_open.error];
    let of = |which: usize| asked.map(|asked| asked[which]);
    Ok(ClampForce {
        least_n,
        least_with_entry_n,
        binding_joint: asked
            .filter(|[movable, fixed, ..]| movable.max(*fixed) > 0.0)
            .map(|[movable, fixed, ..]| if movable > fixed { OpenJoint::Movable } else { OpenJoint::Fixed }),
        movable_n: of(0),
        fixed_n: of(1),
        movable_elastic_n: of(2),
        fixed_elastic_n: of(3),
        static_movable_n,
        static_fixed_n,
        factor_needed: over_static(least_n),
        factor_needed_with_entry: over_static(least_with_entry_n),
        stable,
        depth_for_given_force_mm: depth_for_given,
        modulus_movable_open: movable_open.multiplier.modulus,
        modulus_fixed_open: fixed_open.multiplier.modulus,
        textbook: TEXTBOOK_FACTORS
            .iter()
            .map(|&factor| TextbookForce {
                factor,
                clamp_force_n: factor * static_n,
                enough: least_n.is_some_and(|least| factor * static_n >= least),
            })
            .collect(),
    })
}

/// What one depth gives with joints that stay closed.
#[derive(Clone, Copy)]
struct AtDepth {
    modulus: f64,
    span_mm: f64,
    left_n: f64,
    right_n: f64,
    lost: f64,
}

/// `None` where joints harden and no forced motion is found.
fn at_depth(study: &Study<'_>, depth: f64) -> Result<Option<AtDepth>, Failure> {
    let case = &study.case;
    let working = case.at_depth(depth);
    if !has_motion(case, working) {
        return Ok(None);
    }
    let modulus = point(&study.rules, &case.holding, &case.cutting, working, Closed::BOTH)?.multiplier.modulus;
    if modulus < 1.0 {
        let forced = forced(case, working)?;
        return Ok(Some(AtDepth {
            modulus,
            span_mm: forced.x_mm.span(),
            left_n: forced.left_elastic_n.high.max(0.0),
            right_n: forced.right_elastic_n.high.max(0.0),
            lost: 0.0,
        }));
    }
    let plan = plan(case, &study.job.simulation, working, modulus);
    let run = observed(case, &plan, &crate::calculator::Unwatched)?.run;
    Ok(Some(AtDepth {
        modulus,
        span_mm: run.x_mm.span(),
        left_n: run.left_elastic_n.high.max(0.0),
        right_n: run.right_elastic_n.high.max(0.0),
        lost: run.lost_cut,
    }))
}

fn limits(study: &Study<'_>) -> Result<DepthLimits, Failure> {
    let case = &study.case;
    let wanted = study.job.limits.depths;
    let mut depths: Vec<f64> = (1..=wanted).map(|i| study.examined_mm * f64::from(i) / f64::from(wanted)).collect();
    let mut found: Vec<AtDepth> = Vec::with_capacity(depths.len());
    let mut looked_at = 0;
    for chunk in depths.chunks(8) {
        checkpoint(study.monitor)?;
        let part: Result<Vec<_>, Failure> = chunk.par_iter().map(|&depth| at_depth(study, depth)).collect();
        found.extend(part?.into_iter().map_while(std::convert::identity));
        looked_at += chunk.len();
        if found.len() < looked_at {
            // What lies beyond a depth without a motion is no part of the curve.
            break;
        }
        let done = found.len() as f64 / depths.len() as f64;
        study.monitor.progress(0.2 + 0.2 * done, Message::new("stage_limits"));
    }
    depths.truncate(found.len());
    let force = case.holding.clamp_force_n;
    let reach = |of: &(dyn Fn(&AtDepth) -> f64 + Sync), limit: f64| first_reached(study, &depths, &found, of, limit);
    let amplitude_mm = reach(&|at| at.span_mm, case.working.feed_mm)?;
    let movable_opens_mm = force.map(|force| reach(&|at| at.left_n, force)).transpose()?.flatten();
    let fixed_opens_mm = force.map(|force| reach(&|at| at.right_n, force)).transpose()?.flatten();
    let drive = study.drive_depths(case.working.spindle_rpm);
    let first = first_of([
        (FirstLimit::Chatter, study.chatter_mm),
        (FirstLimit::MovableOpens, movable_opens_mm),
        (FirstLimit::FixedOpens, fixed_opens_mm),
        (FirstLimit::Amplitude, amplitude_mm),
        (FirstLimit::Power, drive.power_mm),
        (FirstLimit::Torque, drive.torque_mm),
    ]);
    let mut at_speeds = Vec::with_capacity(study.job.limits.speeds_rpm.len());
    for speed in &study.job.limits.speeds_rpm {
        checkpoint(study.monitor)?;
        let working = Working { spindle_rpm: speed.0, ..case.working };
        let chatter = critical_depth(&study.rules, &case.holding, &case.cutting, working, study.asked_mm)?;
        at_speeds.push(study.speed_limit(speed.0, chatter)?);
    }
    let column = |of: &dyn Fn(&AtDepth) -> f64| found.iter().map(of).collect::<Vec<f64>>();
    Ok(DepthLimits {
        chatter_mm: study.chatter_mm,
        amplitude_mm,
        movable_opens_mm,
        fixed_opens_mm,
        power_mm: drive.power_mm,
        torque_mm: drive.torque_mm,
        first: first.map(|(what, _)| what),
        first_mm: first.map(|(_, depth)| depth),
        removal_rate_cm3_per_min: first.map(|(_, depth)| removal_rate(case, depth)),
        at_speeds,
        curve: AmplitudeCurve {
            modulus: column(&|at| at.modulus),
            peak_to_peak_um: column(&|at| at.span_mm * UM_PER_MM),
            clamp_movable_n: column(&|at| at.left_n),
            clamp_fixed_n: column(&|at| at.right_n),
            lost_cut_share: column(&|at| at.lost),
            depth_mm: depths,
        },
    })
}

/// What gives out first: at one depth the earlier of the list is the cause of the later.
fn first_of(limits: [(FirstLimit, Option<f64>); 6]) -> Option<(FirstLimit, f64)> {
    let known = limits.into_iter().filter_map(|(what, depth)| depth.map(|depth| (what, depth)));
    known.reduce(|best, next| if next.1 < best.1 * (1.0 - 1e-6) { next } else { best })
}

/// Smallest depth at which a quantity exceeds its limit: bracketed on the curve, split at the chatter limit where the
/// quantity jumps, then bisected.
fn first_reached(
    study: &Study<'_>,
    depths: &[f64],
    found: &[AtDepth],
    of: &(dyn Fn(&AtDepth) -> f64 + Sync),
    limit: f64,
) -> Result<Option<f64>, Failure> {
    let Some(above) = found.iter().position(|at| of(at) > limit) else { return Ok(None) };
    let (mut low, mut high) = (if above == 0 { 0.0 } else { depths[above - 1] }, depths[above]);
    let exceeds =
        |depth: f64| Ok::<_, Failure>(at_depth(study, depth)?.as_ref().is_none_or(|reached| of(reached) > limit));
    if let Some(chatter) = study.chatter_mm.filter(|chatter| *chatter > low && *chatter < high) {
        if exceeds(chatter * (1.0 - 1e-7))? { high = chatter } else { low = chatter }
    }
    // Proportional to H^(1-mu) where the motion is the forced one.
    if study.case.is_linear() && study.chatter_mm.is_none_or(|chatter| high <= chatter) {
        let value = at_depth(study, high * (1.0 - 1e-7))?.as_ref().map_or(0.0, of);
        let power = 1.0 / (1.0 - study.case.cutting.depth_exponent);
        return Ok((value > 0.0).then(|| high * (limit / value).powf(power)));
    }
    for _ in 0..BRACKETING {
        checkpoint(study.monitor)?;
        let middle = 0.5 * (low + high);
        if exceeds(middle)? { high = middle } else { low = middle }
    }
    // A jump at the onset of chatter is at the onset.
    let onset =
        study.chatter_mm.filter(|chatter| (high - chatter) < (depths[above] - chatter) / 200.0 && high >= *chatter);
    Ok(Some(onset.unwrap_or(high)))
}

fn lobes(study: &Study<'_>, aside: &mut Aside) -> Result<LobeDiagram, Failure> {
    let case = &study.case;
    let settings = &study.job.lobes;
    let working = case.working;
    let plane = plane_of(study.job, case, study.asked_mm);
    let monitor = study.monitor;
    let (from, share) = (0.4, if settings.map { 0.2 } else { 0.5 });
    let points = boundary(&study.rules, &case.holding, &case.cutting, &plane, monitor, &mut |part, points| {
        monitor.progress(from + share * part, Message::new("stage_boundary"));
        let known: Vec<_> = points.iter().map(|p| (p.spindle_rpm, p.crossings_mm.first().copied())).collect();
        monitor.interim(lobes_so_far(&known, None, working));
    })?;
    let known: Vec<_> = points.iter().map(|p| (p.spindle_rpm, p.crossings_mm.first().copied())).collect();
    let map = if settings.map {
        let full = map(
            &study.rules,
            &case.holding,
            &case.cutting,
            &plane,
            settings.refinement,
            monitor,
            &mut |part, so_far| {
                monitor.progress(0.6 + 0.3 * part, Message::new("stage_map"));
                monitor.interim(lobes_so_far(&known, Some(so_far), working));
            },
        )?;
        Some(LobeMap::of(full))
    } else {
        None
    };
    let boundary = beside(study, &plane, &points)?;
    let limits: Vec<SpeedLimit> = boundary
        .spindle_speed_rpm
        .iter()
        .enumerate()
        .map(|(i, &spindle_speed_rpm)| SpeedLimit {
            spindle_speed_rpm,
            depth_examined_mm: boundary.depth_examined_mm[i],
            chatter_mm: boundary.chatter_mm[i],
            amplitude_mm: boundary.amplitude_mm[i],
            movable_opens_mm: boundary.movable_opens_mm[i],
            fixed_opens_mm: boundary.fixed_opens_mm[i],
            drive_mm: study.drive_depths(spindle_speed_rpm).least_mm(),
        })
        .collect();
    let lowest = limits
        .iter()
        .filter_map(|limit| limit.chatter_mm.map(|depth| (depth, *limit)))
        .reduce(|best, next| if next.0 < best.0 { next } else { best })
        .map(|(_, limit)| whole_limit(study, limit))
        .transpose()?;
    let better_speeds = better_speeds(study, &limits, plane.most_mm)?;
    for limit in &better_speeds {
        checkpoint(monitor)?;
        aside.better = tried(study, limit, plane.most_mm)?;
        if aside.better.is_some() {
            break;
        }
    }
    Ok(LobeDiagram { boundary, lowest, better_speeds, map })
}

/// The boundary with the other limits over the same speeds.
fn beside(study: &Study<'_>, plane: &Plane, points: &[super::lobes::BoundaryPoint]) -> Result<LobeBoundary, Failure> {
    let case = &study.case;
    let factor = case.cutting.mean_factor();
    let one = |point: &super::lobes::BoundaryPoint| -> Result<[Option<f64>; 4], Failure> {
        let kappa = at_speed(&case.holding, &case.cutting, point.spindle_rpm);
        let zeroth = kappa.map(|k| depth_mm(&case.cutting, factor, k, plane.feed_mm)).filter(|h| *h <= plane.most_mm);
        if !case.is_linear() {
            return Ok([None, None, None, zeroth]);
        }
        let limit_mm = point.crossings_mm.first().copied().unwrap_or(point.examined_mm);
        let [amplitude, movable, fixed] = forced_limits(case, point.spindle_rpm, limit_mm)?;
        Ok([amplitude, movable, fixed, zeroth])
    };
    let mut rows = Vec::with_capacity(points.len());
    for (number, chunk) in points.chunks(32).enumerate() {
        checkpoint(study.monitor)?;
        let part: Result<Vec<_>, Failure> = chunk.par_iter().map(one).collect();
        rows.extend(part?);
        let done = ((number + 1) * 32).min(points.len()) as f64 / points.len().max(1) as f64;
        study.monitor.progress(0.9 + 0.09 * done, Message::new("stage_boundary"));
    }
    let column = |which: usize| rows.iter().map(|row| row[which]).collect::<Vec<_>>();
    let drive: Vec<DriveDepths> = points.iter().map(|p| study.drive_depths(p.spindle_rpm)).collect();
    let shown = |depth: Option<f64>| depth.filter(|depth| *depth <= plane.most_mm);
    Ok(LobeBoundary {
        spindle_speed_rpm: points.iter().map(|p| p.spindle_rpm).collect(),
        depth_examined_mm: points.iter().map(|p| p.examined_mm).collect(),
        chatter_mm: points.iter().map(|p| p.limit().depth_mm).collect(),
        stable_again_mm: points.iter().map(|p| p.crossings_mm.get(1).copied()).collect(),
        amplitude_mm: column(0),
        movable_opens_mm: column(1),
        fixed_opens_mm: column(2),
        power_mm: drive.iter().map(|of| shown(of.power_mm)).collect(),
        torque_mm: drive.iter().map(|of| shown(of.torque_mm)).collect(),
        zeroth_order_mm: column(3),
    })
}

/// With the limits that the diagram does not trace where the forced motion does not go with H^(1-mu).
fn whole_limit(study: &Study<'_>, limit: SpeedLimit) -> Result<SpeedLimit, Failure> {
    if study.case.is_linear() {
        return Ok(limit);
    }
    let chatter = ChatterLimit { depth_mm: limit.chatter_mm, examined_mm: limit.depth_examined_mm };
    study.speed_limit(limit.spindle_speed_rpm, chatter)
}

/// What one may cut at a speed: the least of its limits, and no deeper than was looked.
fn allowed_mm(limit: &SpeedLimit) -> f64 {
    let SpeedLimit { chatter_mm, amplitude_mm, movable_opens_mm, fixed_opens_mm, drive_mm, .. } = *limit;
    let limits = [chatter_mm, amplitude_mm, movable_opens_mm, fixed_opens_mm, drive_mm];
    limits.into_iter().flatten().fold(limit.depth_examined_mm, f64::min)
}

/// Peaks of what the limits allow that lie deeper than at the working speed, nearest first. `limits` were looked for up to
/// `most_mm`.
fn better_speeds(study: &Study<'_>, limits: &[SpeedLimit], most_mm: f64) -> Result<Vec<SpeedLimit>, Failure> {
    let Study { case, rules, .. } = study;
    let working = case.working.spindle_rpm;
    // Elsewhere was looked no deeper than here.
    let chatter = match study.chatter() {
        known if known.depth_mm.is_some() || known.examined_mm >= most_mm => known,
        _ => critical_depth(rules, &case.holding, &case.cutting, case.working, most_mm)?,
    };
    let here = allowed_mm(&study.speed_limit(working, chatter)?);
    let depth = |i: usize| allowed_mm(&limits[i]);
    let mut peaks = Vec::new();
    for (i, limit) in limits.iter().enumerate() {
        checkpoint(study.monitor)?;
        let at = depth(i);
        let left = i.checked_sub(1).is_none_or(|before| depth(before) < at);
        let right = i + 1 == limits.len() || depth(i + 1) <= at;
        if left && right && at > 1.02 * here {
            let limit = whole_limit(study, *limit)?;
            peaks.extend((allowed_mm(&limit) > 1.02 * here).then_some(limit));
        }
    }
    peaks.sort_by(|a, b| {
        (a.spindle_speed_rpm / working).ln().abs().total_cmp(&(b.spindle_speed_rpm / working).ln().abs())
    });
    peaks.truncate(BETTER_SPEEDS);
    Ok(peaks)
}

/// What is to be said of a better speed, tried before it is said: not near chatter or an opening joint, within the other
/// limits, as it is read. `None` where the cut then does not hold still after all (a large motion may stand beside the
/// stable one, and the entry asks more of a joint than the steady cut).
fn tried(study: &Study<'_>, better: &SpeedLimit, most_mm: f64) -> Result<Option<Better>, Failure> {
    let case = &study.case;
    // The peaks of lobes are sharp: the limits are those of the speed that is read.
    let spindle_rpm = said(better.spindle_speed_rpm, 4, f64::round);
    let there = Working { spindle_rpm, ..case.working };
    let chatter = critical_depth(&study.rules, &case.holding, &case.cutting, there, most_mm)?;
    let limit = study.speed_limit(spindle_rpm, chatter)?;
    let short_of = [limit.chatter_mm, limit.movable_opens_mm, limit.fixed_opens_mm];
    let depths = short_of.into_iter().flatten().map(|depth| NEAR_LIMIT * depth);
    let within = [limit.amplitude_mm, limit.drive_mm].into_iter().flatten().map(|depth| WITHIN * depth);
    let allowed_mm = depths.chain(within).fold(limit.depth_examined_mm, f64::min);
    if allowed_mm <= 0.0 {
        return Ok(None);
    }
    let depth_mm = said(allowed_mm, 3, f64::floor);
    let working = Working { depth_mm, ..there };
    if !has_motion(case, working) {
        return Ok(None);
    }
    let modulus = point(&study.rules, &case.holding, &case.cutting, working, Closed::BOTH)?.multiplier.modulus;
    if modulus >= 1.0 || forced_span_mm(case, working).map_or(true, |span_mm| span_mm > working.feed_mm) {
        return Ok(None);
    }
    let SimulationSettings { regeneration, entry, .. } = study.job.simulation;
    let settings = SimulationSettings { regeneration, entry, ..SimulationSettings::default() };
    let plan = Plan { unilateral: case.holding.clamp_force_n.is_some(), ..plan(case, &settings, working, modulus) };
    let run = run(case, &plan, study.monitor)?;
    let opened = run.first_open_left_s.or(run.first_open_right_s).is_some();
    if run.diverged || opened || run.lost_cut > 0.0 || !scatter(case, &plan, &run).1 {
        return Ok(None);
    }
    let drive = study.drive_depths(spindle_rpm);
    let first = first_of([
        (FirstLimit::Chatter, limit.chatter_mm),
        (FirstLimit::MovableOpens, limit.movable_opens_mm),
        (FirstLimit::FixedOpens, limit.fixed_opens_mm),
        (FirstLimit::Amplitude, limit.amplitude_mm),
        (FirstLimit::Power, drive.power_mm),
        (FirstLimit::Torque, drive.torque_mm),
    ]);
    Ok(Some(Better { spindle_rpm, depth_mm, first }))
}

/// A positive number with as many digits as a sentence says of it.
fn said(value: f64, digits: i32, rounded: fn(f64) -> f64) -> f64 {
    let scale = 10.0_f64.powf(f64::from(digits) - 1.0 - value.log10().floor());
    rounded(value * scale) / scale
}

fn histories(study: &Study<'_>, run: &Marched) -> Histories {
    let feed = study.case.working.feed_mm;
    // The arc is drawn with as many places as it has degrees and more.
    let stride = (run.arc.len() / OSCILLOGRAM).max(1);
    let arc: Vec<(f64, f64)> = run.arc.iter().step_by(stride).copied().collect();
    let sine = |angle: f64| angle.min(PI).sin().max(0.0);
    Histories {
        entry: oscillogram(&run.first),
        steady: oscillogram(&run.last),
        arc: ArcProfile {
            angle_deg: arc.iter().map(|(angle, _)| angle.to_degrees()).collect(),
            effective_feed_mm: arc.iter().map(|(_, f)| *f).collect(),
            chip_thickness_mm: arc.iter().map(|(angle, f)| f * sine(*angle)).collect(),
            smooth_chip_mm: arc.iter().map(|(angle, _)| feed * sine(*angle)).collect(),
        },
    }
}

fn oscillogram(steps: &[Step]) -> Oscillogram {
    let stride = count((steps.len() as f64 / OSCILLOGRAM as f64).ceil().max(1.0));
    let kept: Vec<&Step> = steps.iter().step_by(stride).collect();
    let jaw = kept.first().is_some_and(|step| step.jaw_mm.is_some());
    Oscillogram {
        time_s: kept.iter().map(|s| s.time_s).collect(),
        displacement_um: kept.iter().map(|s| s.x_mm * UM_PER_MM).collect(),
        jaw_um: jaw.then(|| kept.iter().map(|s| s.jaw_mm.unwrap_or(0.0) * UM_PER_MM).collect()),
        force_n: kept.iter().map(|s| s.force_n).collect(),
        effective_feed_mm: kept.iter().map(|s| s.feed_mm).collect(),
        clamp_movable_n: kept.iter().map(|s| s.left_demand_n).collect(),
        clamp_fixed_n: kept.iter().map(|s| s.right_demand_n).collect(),
    }
}
