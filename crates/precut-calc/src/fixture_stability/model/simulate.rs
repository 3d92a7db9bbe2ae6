//! How the time simulation is run for a job, and what of it counts as settled.

use crate::calculator::{Failure, Monitor};

use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::{Entry, Regeneration, SimulationSettings};
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::lobes::by_states;
use crate::fixture_stability::model::march::{Marched, Plan, Surface, march};

/// Steps per oscillation of the highest natural frequency, least and most steps per tooth pitch.
const PER_OSCILLATION: f64 = 80.0;
const LEAST_STEPS: f64 = 200.0;
const MOST_STEPS: f64 = 20_000.0;
/// A transient is awaited until it has decayed (or grown) by this factor.
const DECAY: f64 = 1e-4;
const LEAST_PERIODS: f64 = 120.0;
const MOST_PERIODS: f64 = 1500.0;
/// Steps of a run that chooses its own length, at most.
const MOST_RUN: f64 = 1.2e7;
/// Scatter of once-per-tooth samples, over the feed per tooth, below which a motion is periodic.
const PERIODIC: f64 = 1e-3;

/// A whole number of at most some 1e9 as a count.
pub(in crate::fixture_stability) fn count(value: f64) -> usize {
    // Checked by the callers to lie in 0..1e9.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let whole = value.clamp(0.0, 1e9) as usize;
    whole
}

/// A count as it stands in an answer.
pub(in crate::fixture_stability) fn small(value: usize) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}

/// Steps per tooth pitch that resolve the highest natural frequency.
pub(in crate::fixture_stability) fn steps_per_tooth(case: &Case, spindle_rpm: f64) -> usize {
    let highest = case.holding.modes().last().map_or(0.0, |mode| mode.natural_hz);
    let oscillations = highest * case.cutting.tooth_period_s(spindle_rpm);
    count((PER_OSCILLATION * oscillations).ceil().clamp(LEAST_STEPS, MOST_STEPS))
}

/// Tooth periods until a transient of that multiplier is over.
fn periods(modulus: f64, steps: usize) -> usize {
    let rate = modulus.ln().abs().max(1e-9);
    let wanted = (DECAY.ln().abs() / rate).clamp(LEAST_PERIODS, MOST_PERIODS);
    count(wanted.min((MOST_RUN / steps as f64).max(40.0)))
}

/// How a run of a job is made: settings first, else by the multiplier.
pub(in crate::fixture_stability) fn plan(
    case: &Case,
    settings: &SimulationSettings,
    working: Working,
    modulus: f64,
) -> Plan {
    let steps = settings.steps_per_tooth.map_or_else(|| steps_per_tooth(case, working.spindle_rpm), |n| n as usize);
    let whole = case.cutting.phases();
    let wanted = settings.tooth_periods.map_or_else(|| periods(modulus, steps), |n| n as usize);
    // Whole periods of the force.
    let tooth_periods = wanted.div_ceil(whole) * whole;
    let steady = settings.steady_tooth_periods.map_or(tooth_periods / 4, |n| n as usize).clamp(1, tooth_periods);
    Plan {
        working,
        steps_per_tooth: steps,
        tooth_periods,
        steady_periods: steady.max(whole).min(tooth_periods),
        surface: match settings.regeneration {
            Regeneration::Multiple => Surface::Multiple,
            Regeneration::Single => Surface::Single,
        },
        gradual: settings.entry == Entry::Gradual,
        unilateral: false,
        keep_first: 0,
        keep_last: 0,
    }
}

pub(in crate::fixture_stability) fn run(case: &Case, plan: &Plan, monitor: &dyn Monitor) -> Result<Marched, Failure> {
    by_states!(case.holding, march(&case.holding, &case.cutting, plan, monitor))
}

/// What the steady part of a run is worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) enum Steady {
    /// It shows how the cut goes on.
    Reached,
    /// The displacement left everything real: there is none.
    Diverged,
    /// The workpiece was thrown further than the teeth are fed meanwhile: what it shows may be the pause until they meet.
    Thrown { farthest_mm: f64, fed_mm: f64 },
}

/// A run with numbers that can be believed: of its steady part or, where that is worth nothing, of all of it.
pub(in crate::fixture_stability) struct Observed {
    /// As it counts: with the tooth periods that the numbers are taken over.
    pub plan: Plan,
    pub run: Marched,
    pub steady: Steady,
}

pub(in crate::fixture_stability) fn observed(
    case: &Case,
    plan: &Plan,
    monitor: &dyn Monitor,
) -> Result<Observed, Failure> {
    let first = run(case, plan, monitor)?;
    let steady = steady(case, plan, &first);
    if steady == Steady::Reached {
        return Ok(Observed { plan: *plan, run: first, steady });
    }
    // Once more with every tooth period counted: a run does not keep as much of those before the steady ones.
    let periods = first.samples_mm.len();
    let kept = |wanted: usize| wanted.min(periods / 2);
    let whole = Plan {
        tooth_periods: periods,
        steady_periods: periods,
        keep_first: kept(plan.keep_first),
        keep_last: kept(plan.keep_last),
        ..*plan
    };
    Ok(Observed { plan: whole, run: run(case, &whole, monitor)?, steady })
}

fn steady(case: &Case, plan: &Plan, run: &Marched) -> Steady {
    if run.diverged {
        return Steady::Diverged;
    }
    let (farthest_mm, fed_mm) = (run.farthest_mm, plan.steady_periods as f64 * plan.working.feed_mm);
    // A forced motion loses no cut however large it is.
    let thrown = farthest_mm > fed_mm && run.first_lost_s.is_some() && !scatter(case, plan, run).settled;
    if thrown { Steady::Thrown { farthest_mm, fed_mm } } else { Steady::Reached }
}

/// How the once-per-tooth samples scatter over the steady periods.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Scatter {
    /// Over the feed per tooth.
    pub of_feed: f64,
    /// Scatter of the second half over that of the first.
    pub late_over_early: f64,
    /// Small, or still falling fast.
    pub settled: bool,
}

pub(in crate::fixture_stability) fn scatter(case: &Case, plan: &Plan, run: &Marched) -> Scatter {
    let whole = case.cutting.phases();
    let samples = &run.samples_mm[run.samples_mm.len().saturating_sub(plan.steady_periods.max(2 * whole))..];
    let feed = plan.working.feed_mm;
    let of = |part: &[f64]| -> f64 {
        (0..whole)
            .map(|phase| {
                let of_phase: Vec<f64> = part.iter().skip(phase).step_by(whole).copied().collect();
                let mean = of_phase.iter().sum::<f64>() / of_phase.len().max(1) as f64;
                let square = of_phase.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
                (square / of_phase.len().max(1) as f64).sqrt()
            })
            .fold(0.0, f64::max)
            / feed
    };
    let half = (samples.len() / 2) / whole * whole;
    let all = of(samples);
    let (early, late) = samples.split_at(half);
    let (late, early) = (of(late), of(early));
    let falling = half > 0 && late < 0.7 * early;
    Scatter {
        of_feed: all,
        late_over_early: if half > 0 && early > 0.0 { late / early } else { 1.0 },
        settled: all < PERIODIC || (falling && all < 30.0 * PERIODIC),
    }
}
