//! The answer, put together.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use crate::calculator::{Failure, Message, Monitor, checkpoint};

use crate::fixture_stability::answer::clamp::clamp_force;
use crate::fixture_stability::answer::conformance::{FixtureConformance, Judged};
use crate::fixture_stability::answer::output::{
    AmplitudeCurve, ArcProfile, ChatterKind, CuttingDrive, DepthLimits, Engagement, FirstLimit, FixtureOutcome,
    FixtureState, FixtureVerdict, FloquetMultiplier, ForcedMotion, Histories, LobeBoundary, LobeDiagram, LobeMap,
    OpenJoint, Oscillogram, QuasiStatic, Simulated, SpeedLimit, VibrationMode, ZerothOrder,
};
use crate::fixture_stability::answer::parts::plane_of;
use crate::fixture_stability::answer::picture::lobes_so_far;
use crate::fixture_stability::answer::probable_depths::{ProbableDepths, probable_depths};
use crate::fixture_stability::answer::speeds::{ForcedLimits, better_speeds, first_of, forced_limits};
use crate::fixture_stability::cost::without_analysis;
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::{Analysis, FixtureJob};
use crate::fixture_stability::model::drive::{self, DriveDepths};
use crate::fixture_stability::model::floquet::{Multiplier, Working};
use crate::fixture_stability::model::holding::Closed;
use crate::fixture_stability::model::lobes::{
    ChatterLimit, Plane, Point, Rules, boundary, by_states, critical_depth, map, point,
};
use crate::fixture_stability::model::march::{Marched, Plan, Step};
use crate::fixture_stability::model::response::{Range, Response, response, span_mm, unbroken};
use crate::fixture_stability::model::simulate::{Observed, Steady, count, observed, plan, run, scatter, small};
use crate::fixture_stability::model::slow::is_slow;
use crate::fixture_stability::model::zeroth::{at_speed, depth_mm, zeroth};

pub(in crate::fixture_stability) const UM_PER_MM: f64 = 1e3;
/// Sampling error of the exact forced motion, relative.
const SAMPLING: f64 = 1e-6;
/// Share of a disturbance that is left when it has settled.
const DECAYED: f64 = 1e-3;
/// Entries of an oscillogram at most.
const OSCILLOGRAM: usize = 1200;
/// How often a run that may yet come to rest is made longer, and by which factor.
const LONGER_RUNS: u32 = 2;
const LONGER: usize = 4;
/// Steps of the bracketing of a limit that only simulation gives: to 1/256 of a step of the curve.
const BRACKETING: u32 = 8;
/// A limit of what grows with the depth is taken up to this share of it: what is advised is within, whatever is rounded.
pub(in crate::fixture_stability) const WITHIN: f64 = 0.995;
/// A depth above this share of the limit of chatter, or of the opening of a joint, is near it.
pub(in crate::fixture_stability) const NEAR_LIMIT: f64 = 0.9;

/// What the parts of an answer share.
pub(in crate::fixture_stability) struct Study<'a> {
    pub job: &'a FixtureJob,
    pub case: Case,
    pub rules: Rules,
    pub monitor: &'a dyn Monitor,
    /// Hundreds of oscillations from tooth to tooth: closed forms in place of runs in time.
    pub is_slow: bool,
    pub point: Point,
    pub forced: Response,
    /// How deep limits were to be looked for, and how deep they could be.
    pub asked_mm: f64,
    pub examined_mm: f64,
    pub chatter_mm: Option<f64>,
}

/// What becomes of a disturbance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::fixture_stability) enum Settling {
    /// It is gone within the run.
    AtRest,
    /// It decays, no tooth leaves the cut, but the run ends before it is gone.
    Slowly,
    /// A small one decays; that of the entry does not.
    VibratesOn,
    /// The multiplier says that it grows.
    Grows,
}

/// What the advice asks beside the answer.
pub(in crate::fixture_stability) struct Aside {
    /// What the cut as it was run shows, where it was, and what it does with joints that stay closed.
    pub cut: Option<Steady>,
    pub bonded: Option<Steady>,
    /// Errors of the moduli with the joint at the movable and at the fixed jaw open.
    pub open_errors: [f64; 2],
    /// What the simulation shows of a disturbance.
    pub settling: Settling,
}

impl<'a> Study<'a> {
    pub(in crate::fixture_stability) fn new(
        job: &'a FixtureJob,
        case: Case,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, Failure> {
        let rules = Rules::new();
        let point = point(&rules, &case.holding, &case.cutting, case.working, Closed::BOTH, monitor)?;
        let forced = forced(&case, case.working, monitor)?;
        let asked_mm = examined_mm(job, &case);
        let limit = critical_depth(&rules, &case.holding, &case.cutting, case.working, asked_mm, monitor)?;
        let ChatterLimit { depth_mm: chatter_mm, examined_mm } = limit;
        let is_slow = is_slow(&case.holding, &case.cutting, case.working.spindle_rpm);
        Ok(Self { job, case, rules, monitor, is_slow, point, forced, asked_mm, examined_mm, chatter_mm })
    }

    /// Where chatter begins at the working speed.
    pub(in crate::fixture_stability) fn chatter(&self) -> ChatterLimit {
        ChatterLimit { depth_mm: self.chatter_mm, examined_mm: self.examined_mm }
    }

    pub(in crate::fixture_stability) fn stable(&self) -> bool {
        !self.point.multiplier.grows()
    }

    /// Depths at which the spindle of the job gives out at a speed; none without one.
    pub(in crate::fixture_stability) fn drive_depths(&self, spindle_rpm: f64) -> DriveDepths {
        let working = Working { spindle_rpm, ..self.case.working };
        self.job.spindle.as_ref().map_or_else(DriveDepths::default, |of| drive::depths(&self.case, of, working))
    }

    /// Runs the cut in time at the working point; `None` of a slow cut.
    pub(in crate::fixture_stability) fn simulated(
        &self,
        unilateral: bool,
        keep: bool,
    ) -> Result<Option<Observed>, Failure> {
        if self.is_slow {
            return Ok(None);
        }
        let mut plan = plan(&self.case, &self.job.simulation, self.case.working, self.point.multiplier.modulus);
        plan.unilateral = unilateral;
        if keep {
            let revolution = self.case.cutting.teeth.clamp(4, 40);
            plan.keep_first = revolution.min(plan.tooth_periods / 2);
            plan.keep_last = revolution.min(plan.tooth_periods / 2);
        }
        let mut seen = observed(&self.case, &plan, self.monitor)?;
        // Where small disturbances decay, a vibration that loses the cut may yet come to rest: only a longer run tells.
        let decays = self.stable() && self.job.simulation.tooth_periods.is_none();
        for _ in 0..LONGER_RUNS {
            let may_rest = seen.steady == Steady::Reached && seen.run.lost_cut > 0.0;
            if !(decays && may_rest) || scatter(&self.case, &seen.plan, &seen.run).settled {
                break;
            }
            plan.tooth_periods *= LONGER;
            plan.steady_periods *= LONGER;
            seen = observed(&self.case, &plan, self.monitor)?;
        }
        Ok(Some(seen))
    }

    /// What the cut as it was run shows of a disturbance; without a run, what the multiplier says.
    fn settling(&self, seen: Option<&Observed>) -> Settling {
        let Some(seen) = seen else { return if self.stable() { Settling::AtRest } else { Settling::Grows } };
        let scatter = scatter(&self.case, &seen.plan, &seen.run);
        if !self.stable() {
            Settling::Grows
        } else if seen.steady == Steady::Diverged {
            Settling::VibratesOn
        } else if scatter.settled {
            Settling::AtRest
        } else if seen.run.lost_cut <= 0.0 && scatter.late_over_early < 1.0 {
            Settling::Slowly
        } else {
            Settling::VibratesOn
        }
    }

    /// What limits the depth at a speed where chatter does so.
    pub(in crate::fixture_stability) fn speed_limit(
        &self,
        spindle_rpm: f64,
        chatter: ChatterLimit,
    ) -> Result<SpeedLimit, Failure> {
        let ForcedLimits { amplitude_mm, movable_opens_mm, fixed_opens_mm, slips_mm } =
            forced_limits(&self.case, spindle_rpm, chatter.depth_mm.unwrap_or(chatter.examined_mm), self.monitor)?;
        Ok(SpeedLimit {
            spindle_speed_rpm: spindle_rpm,
            depth_examined_mm: chatter.examined_mm,
            chatter_mm: chatter.depth_mm,
            amplitude_mm,
            movable_opens_mm,
            fixed_opens_mm,
            slips_mm,
            drive_mm: self.drive_depths(spindle_rpm).least_mm(),
        })
    }
}

pub(in crate::fixture_stability) fn forced(
    case: &Case,
    working: Working,
    monitor: &dyn Monitor,
) -> Result<Response, Failure> {
    by_states!(case.holding, response(&case.holding, &case.cutting, working, monitor))
}

/// Whether there is a motion about which to ask: away from the working point there may be none where joints harden.
pub(in crate::fixture_stability) fn has_motion(
    case: &Case,
    working: Working,
    monitor: &dyn Monitor,
) -> Result<bool, Failure> {
    let found = || by_states!(case.holding, unbroken(&case.holding, &case.cutting, working, monitor));
    Ok(case.holding.hardening_per_mm2 <= 0.0 || found()?.is_some())
}

/// Peak-to-peak displacement of the forced motion, mm.
pub(in crate::fixture_stability) fn forced_span_mm(
    case: &Case,
    working: Working,
    monitor: &dyn Monitor,
) -> Result<f64, Failure> {
    by_states!(case.holding, span_mm(&case.holding, &case.cutting, working, monitor))
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

/// Computes everything that the job asks.
pub(in crate::fixture_stability) fn outcome(study: &Study<'_>) -> Result<(FixtureOutcome, Aside), Failure> {
    let Study { job, case, monitor, .. } = study;
    checkpoint(*monitor)?;
    monitor.progress(0.05, Message::new("stage_simulation"));
    let keep = job.asks(Analysis::History);
    let cut = study.simulated(case.holding.clamp_force_n.is_some(), keep)?;
    let mut simulation = cut.as_ref().map(|cut| simulation(study, cut));
    if let (Some(cut), Some(simulation)) = (&cut, simulation.as_mut().filter(|_| job.simulation.verified)) {
        let finer = Plan { steps_per_tooth: 2 * cut.plan.steps_per_tooth, keep_first: 0, keep_last: 0, ..cut.plan };
        let again = run(case, &finer, *monitor)?;
        simulation.halved_step_change_um = Some((again.x_mm.span() - cut.run.x_mm.span()).abs() * UM_PER_MM);
    }
    checkpoint(*monitor)?;
    let settling = study.settling(cut.as_ref());
    let mut aside = Aside { cut: cut.as_ref().map(|cut| cut.steady), bonded: None, open_errors: [0.0; 2], settling };
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
    let lobes = if job.asks(Analysis::Lobes) { Some(lobes(study)?) } else { None };
    let (conformance, probable_depths) = certainty(study)?;
    let history = cut.as_ref().filter(|_| keep).map(|cut| histories(study, &cut.run));
    let zeroth_order = zeroth_order(study);
    let drive = cutting_drive(study);
    let outcome = FixtureOutcome {
        verdict: match simulation.as_ref().zip(cut.as_ref()) {
            Some((simulation, cut)) => verdict(study, simulation, &cut.run, settling, drive.margin()),
            None => slow_verdict(study, drive.margin()),
        },
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
        conformance,
        probable_depths,
    };
    Ok((outcome, aside))
}

/// How probable it is that the cut stays quiet, and how deep one may cut with the wanted probability where that is asked.
fn certainty(study: &Study<'_>) -> Result<(Option<FixtureConformance>, Option<ProbableDepths>), Failure> {
    let Study { job, case, monitor, .. } = study;
    let Some(judged) = Judged::of(job, case, &study.rules, *monitor)? else { return Ok((None, None)) };
    monitor.progress(0.995, Message::new("stage_certainty"));
    if job.asks(Analysis::Certainty) {
        let conformance = judged.asked_for(study.examined_mm)?;
        return Ok((Some(conformance), probable_depths(study, &judged)?));
    }
    let conformance =
        without_analysis(case, job.uncertainty.check).map(|check| judged.conformance(check)).transpose()?;
    Ok((conformance, None))
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
        removal_rate_cm3_per_min: removal_rate(case, working),
    }
}

/// Width of the strip within the cutter times depth times table feed, cm3/min.
pub(in crate::fixture_stability) fn removal_rate(case: &Case, working: Working) -> f64 {
    let width = case.cutting.radius_mm * (case.cutting.entry_rad.cos() - case.cutting.exit_rad.cos());
    width * working.depth_mm * working.feed_mm * working.spindle_rpm * case.cutting.teeth as f64 / 1000.0
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
        chatter_frequency_hz: match found.slow {
            Some(slow) => slow.frequency_hz,
            None => chatter_frequency_hz(&study.case, &found),
        },
        // A disturbance that vanishes within a tooth period decays at no finite rate: 1e-300 stands for it.
        growth_per_s: found.modulus.max(1e-300).ln() / tau,
        settling_time_s: (found.modulus < 1.0).then(|| DECAYED.ln() / found.modulus.max(1e-300).ln() * tau),
        modulus_error: study.point.error,
        growth_within: found.slow.map(|slow| slow.within),
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
    let scatter = scatter(&study.case, plan, run);
    Simulated {
        steps_per_tooth: small(plan.steps_per_tooth),
        tooth_periods: small(plan.tooth_periods),
        steady_tooth_periods: small(plan.steady_periods),
        diverged: run.diverged,
        settled: scatter.settled && !run.diverged,
        sample_scatter: scatter.of_feed,
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

fn verdict(
    study: &Study<'_>,
    simulated: &Simulated,
    run: &Marched,
    settling: Settling,
    drive_margin: Option<f64>,
) -> FixtureVerdict {
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
    } else if matches!(settling, Settling::Grows | Settling::VibratesOn) {
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

/// Of a slow cut: the forced motion, which is the motion about which it chatters where it does.
fn slow_verdict(study: &Study<'_>, drive_margin: Option<f64>) -> FixtureVerdict {
    let (case, forced) = (&study.case, &study.forced);
    let span_um = forced.x_mm.span() * UM_PER_MM;
    let opens = |of: Range| case.holding.clamp_force_n.is_some_and(|force| case.above_round_off_n(of.high) > force);
    let joint = match (opens(forced.left_elastic_n), opens(forced.right_elastic_n)) {
        (true, true) => Some(OpenJoint::Both),
        (true, false) => Some(OpenJoint::Movable),
        (false, true) => Some(OpenJoint::Fixed),
        (false, false) => None,
    };
    let state = if joint.is_some() {
        FixtureState::JointOpen
    } else if !study.stable() {
        FixtureState::Chatter
    } else if drive_margin.is_some_and(|margin| margin < 1.0) {
        FixtureState::SpindleOverloaded
    } else {
        FixtureState::Stable
    };
    let asked = case.above_round_off_n(forced.left_n.high.max(forced.right_n.high));
    FixtureVerdict {
        state,
        joint,
        first_opening_s: None,
        open_share: 0.0,
        lost_cut_share: 0.0,
        peak_to_peak_um: span_um,
        peak_to_peak_over_feed: forced.x_mm.span() / case.working.feed_mm,
        peak_to_peak_error_um: study.stable().then_some(SAMPLING * span_um),
        displacement_max_um: forced.x_mm.high.abs().max(forced.x_mm.low.abs()) * UM_PER_MM,
        depth_margin: study.chatter_mm.filter(|_| case.working.depth_mm > 0.0).map(|h| h / case.working.depth_mm),
        clamp_margin: case
            .holding
            .clamp_force_n
            .filter(|_| study.stable() && joint.is_none() && asked > 0.0)
            .map(|force| force / asked),
        drive_margin,
    }
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
    if !has_motion(case, working, study.monitor)? {
        return Ok(None);
    }
    let found = point(&study.rules, &case.holding, &case.cutting, working, Closed::BOTH, study.monitor)?;
    let modulus = found.multiplier.modulus;
    if study.is_slow || modulus < 1.0 {
        let forced = forced(case, working, study.monitor)?;
        return Ok(Some(AtDepth {
            modulus,
            span_mm: forced.x_mm.span(),
            left_n: forced.left_elastic_n.high.max(0.0),
            right_n: forced.right_elastic_n.high.max(0.0),
            lost: 0.0,
        }));
    }
    let plan = plan(case, &study.job.simulation, working, modulus);
    let run = observed(case, &plan, study.monitor)?.run;
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
    let stable_to_mm = study.chatter_mm.unwrap_or(study.examined_mm);
    let slips_mm = forced_limits(case, case.working.spindle_rpm, stable_to_mm, study.monitor)?.slips_mm;
    let drive = study.drive_depths(case.working.spindle_rpm);
    let first = first_of([
        (FirstLimit::Chatter, study.chatter_mm),
        (FirstLimit::MovableOpens, movable_opens_mm),
        (FirstLimit::FixedOpens, fixed_opens_mm),
        (FirstLimit::Slips, slips_mm),
        (FirstLimit::Amplitude, amplitude_mm),
        (FirstLimit::Power, drive.power_mm),
        (FirstLimit::Torque, drive.torque_mm),
    ]);
    let mut at_speeds = Vec::with_capacity(study.job.limits.speeds_rpm.len());
    for speed in &study.job.limits.speeds_rpm {
        checkpoint(study.monitor)?;
        let working = Working { spindle_rpm: speed.0, ..case.working };
        let chatter =
            critical_depth(&study.rules, &case.holding, &case.cutting, working, study.asked_mm, study.monitor)?;
        at_speeds.push(study.speed_limit(speed.0, chatter)?);
    }
    let column = |of: &dyn Fn(&AtDepth) -> f64| found.iter().map(of).collect::<Vec<f64>>();
    Ok(DepthLimits {
        chatter_mm: study.chatter_mm,
        amplitude_mm,
        movable_opens_mm,
        fixed_opens_mm,
        slips_mm,
        power_mm: drive.power_mm,
        torque_mm: drive.torque_mm,
        first: first.map(|(what, _)| what),
        first_mm: first.map(|(_, depth)| depth),
        removal_rate_cm3_per_min: first.map(|(_, depth)| removal_rate(case, case.at_depth(depth))),
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

fn lobes(study: &Study<'_>) -> Result<LobeDiagram, Failure> {
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
            slips_mm: boundary.slips_mm[i],
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
    Ok(LobeDiagram { boundary, lowest, better_speeds, map })
}

/// The boundary with the other limits over the same speeds.
fn beside(
    study: &Study<'_>,
    plane: &Plane,
    points: &[crate::fixture_stability::model::lobes::BoundaryPoint],
) -> Result<LobeBoundary, Failure> {
    let case = &study.case;
    let factor = case.cutting.mean_factor();
    let one = |point: &crate::fixture_stability::model::lobes::BoundaryPoint| -> Result<(ForcedLimits, Option<f64>), Failure> {
        let kappa = at_speed(&case.holding, &case.cutting, point.spindle_rpm);
        let zeroth = kappa.map(|k| depth_mm(&case.cutting, factor, k, plane.feed_mm)).filter(|h| *h <= plane.most_mm);
        if !case.is_linear() {
            return Ok((ForcedLimits::default(), zeroth));
        }
        let limit_mm = point.crossings_mm.first().copied().unwrap_or(point.examined_mm);
        Ok((forced_limits(case, point.spindle_rpm, limit_mm, study.monitor)?, zeroth))
    };
    let mut rows = Vec::with_capacity(points.len());
    for (number, chunk) in points.chunks(32).enumerate() {
        checkpoint(study.monitor)?;
        let part: Result<Vec<_>, Failure> = chunk.par_iter().map(one).collect();
        rows.extend(part?);
        let done = ((number + 1) * 32).min(points.len()) as f64 / points.len().max(1) as f64;
        study.monitor.progress(0.9 + 0.09 * done, Message::new("stage_boundary"));
    }
    let column = |of: fn(&ForcedLimits) -> Option<f64>| rows.iter().map(|row| of(&row.0)).collect::<Vec<_>>();
    let drive: Vec<DriveDepths> = points.iter().map(|p| study.drive_depths(p.spindle_rpm)).collect();
    let shown = |depth: Option<f64>| depth.filter(|depth| *depth <= plane.most_mm);
    Ok(LobeBoundary {
        spindle_speed_rpm: points.iter().map(|p| p.spindle_rpm).collect(),
        depth_examined_mm: points.iter().map(|p| p.examined_mm).collect(),
        chatter_mm: points.iter().map(|p| p.limit().depth_mm).collect(),
        stable_again_mm: points.iter().map(|p| p.crossings_mm.get(1).copied()).collect(),
        amplitude_mm: column(|of| of.amplitude_mm),
        movable_opens_mm: column(|of| of.movable_opens_mm),
        fixed_opens_mm: column(|of| of.fixed_opens_mm),
        slips_mm: column(|of| of.slips_mm),
        power_mm: drive.iter().map(|of| shown(of.power_mm)).collect(),
        torque_mm: drive.iter().map(|of| shown(of.torque_mm)).collect(),
        zeroth_order_mm: rows.iter().map(|row| row.1).collect(),
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
