//! The clamp force that a cut asks for: against joints that open, and against a workpiece that slips along the jaws.

use crate::calculator::Failure;

use crate::fixture_stability::answer::output::{ClampForce, OpenJoint, PushedAlong, SlipForce, TextbookForce};
use crate::fixture_stability::answer::study::{Aside, Study};
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::model::holding::Closed;
use crate::fixture_stability::model::lobes::point;
use crate::fixture_stability::model::march::Marched;
use crate::fixture_stability::model::simulate::Steady;
use crate::fixture_stability::model::slip::{Pushing, along, steady_n};

/// Safety factors that textbooks use.
const TEXTBOOK_FACTORS: [f64; 4] = [1.5, 2.0, 2.5, 6.0];

/// Static force on the joints at the movable and the fixed jaw (`fixture/5.7`).
fn static_clamp_n(case: &Case, high_n: f64, low_n: f64) -> (f64, f64) {
    let (left, right) = (case.holding.left.stiffness_n_per_mm, case.holding.right.stiffness_n_per_mm);
    let (toward_movable, toward_fixed) = (case.above_round_off_n(high_n), case.above_round_off_n(-low_n));
    if case.holding.jaw.is_some() {
        (0.0, toward_movable)
    } else {
        (toward_fixed * left / (left + right), toward_movable * right / (left + right))
    }
}

pub(in crate::fixture_stability) fn clamp_force(study: &Study<'_>, aside: &mut Aside) -> Result<ClampForce, Failure> {
    let case = &study.case;
    let stable = study.stable();
    let seen = study.simulated(false, false)?;
    aside.bonded = seen.as_ref().map(|seen| seen.steady);
    let run = seen.as_ref().filter(|seen| seen.steady == Steady::Reached).map(|seen| &seen.run);
    let asked = if stable {
        let forced = &study.forced;
        Some([forced.left_n, forced.right_n, forced.left_elastic_n, forced.right_elastic_n])
    } else {
        // A run that shows no steady state says of no clamp force that it is enough.
        run.map(|run| [run.left_n, run.right_n, run.left_elastic_n, run.right_elastic_n])
    };
    let asked = asked.map(|ranges| ranges.map(|range| case.above_round_off_n(range.high)));
    let least_n = asked.map(|[movable, fixed, ..]| movable.max(fixed));
    let with_entry = |(least, run): (f64, &Marched)| {
        [run.left_entry_n, run.right_entry_n].map(|n| case.above_round_off_n(n)).into_iter().fold(least, f64::max)
    };
    let least_with_entry_n = least_n.zip(run).map(with_entry);
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
    let open = |closed: Closed| point(&study.rules, &case.holding, &case.cutting, case.working, closed, study.monitor);
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
        along: pushed_along(study),
        slip: stable.then(|| slip_force(study)).flatten(),
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

/// What pushes the workpiece along the jaws.
fn pushed_along(study: &Study<'_>) -> PushedAlong {
    let loads = along(&study.case, study.case.working);
    PushedAlong {
        across_mean_n: loads.across.mean_n,
        across_peak_n: loads.across.peak_n,
        upward_mean_n: loads.upward.mean_n,
        upward_peak_n: loads.upward.peak_n,
    }
}

/// The clamp force by which friction holds that in the forced motion, where the job says how the jaws grip.
fn slip_force(study: &Study<'_>) -> Option<SlipForce> {
    let case = &study.case;
    let grip = case.grip.as_ref()?;
    let pushing = Pushing::new(case, case.working, &study.forced, grip);
    let clamp_force_min_n = pushing.least_n(grip.friction.low);
    Some(SlipForce {
        clamp_force_min_n,
        at_likely_friction_n: pushing.least_n(grip.friction.value),
        at_high_friction_n: pushing.least_n(grip.friction.high),
        against_mean_n: steady_n(&along(case, case.working), grip, grip.friction.low),
        friction_needed: case.holding.clamp_force_n.and_then(|force| pushing.friction_needed(force)),
        holds: case.holding.clamp_force_n.map(|force| force >= clamp_force_min_n),
    })
}
