//! The answer, put together.

mod limits;
mod lobes;
mod told;
mod verdict;

use crate::calculator::{Failure, Message, Monitor, checkpoint};
use crate::fixture_stability::answer::clamp::clamp_force;
use crate::fixture_stability::answer::conformance::{FixtureConformance, Judged};
use crate::fixture_stability::answer::output::{FixtureOutcome, SpeedLimit, VibrationMode};
use crate::fixture_stability::answer::probable_depths::{ProbableDepths, probable_depths};
use crate::fixture_stability::answer::speeds::{ForcedLimits, forced_limits};
use crate::fixture_stability::cost::without_analysis;
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::{Analysis, FixtureJob};
use crate::fixture_stability::model::drive::{self, DriveDepths};
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::holding::Closed;
use crate::fixture_stability::model::lobes::{ChatterLimit, Point, Rules, by_states, critical_depth, point};
use crate::fixture_stability::model::march::Plan;
use crate::fixture_stability::model::response::{Response, response, span_mm, unbroken};
use crate::fixture_stability::model::simulate::{Observed, Steady, observed, plan, run, scatter};
use crate::fixture_stability::model::slow::is_slow;
use crate::fixture_stability::model::zeroth::{at_speed, depth_mm, zeroth};

use limits::limits;
use lobes::lobes;
use told::{
    SAMPLING, cutting_drive, engagement, forced_motion, histories, multiplier, quasi_static, simulation, zeroth_order,
};
use verdict::{slow_verdict, verdict};

pub(in crate::fixture_stability) const UM_PER_MM: f64 = 1e3;
/// How often a run that may yet come to rest is made longer, and by which factor.
const LONGER_RUNS: u32 = 2;
const LONGER: usize = 4;
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
    let begins = || monitor.progress(0.995, Message::new("stage_certainty"));
    if job.asks(Analysis::Certainty) {
        begins();
        let conformance = judged.asked_for(study.examined_mm)?;
        return Ok((Some(conformance), probable_depths(study, &judged)?));
    }
    let Some(check) = without_analysis(case, job.uncertainty.check) else { return Ok((None, None)) };
    begins();
    Ok((Some(judged.conformance(check)?), None))
}

/// Width of the strip within the cutter times depth times table feed, cm3/min.
pub(in crate::fixture_stability) fn removal_rate(case: &Case, working: Working) -> f64 {
    let width = case.cutting.radius_mm * (case.cutting.entry_rad.cos() - case.cutting.exit_rad.cos());
    width * working.depth_mm * working.feed_mm * working.spindle_rpm * case.cutting.teeth as f64 / 1000.0
}
