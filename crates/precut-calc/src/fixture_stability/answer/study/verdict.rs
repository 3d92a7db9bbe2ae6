//! What happens at the working point.

use crate::fixture_stability::answer::output::{FixtureState, FixtureVerdict, OpenJoint, Simulated};
use crate::fixture_stability::model::march::Marched;
use crate::fixture_stability::model::response::Range;

use super::{SAMPLING, Settling, Study, UM_PER_MM};

pub(super) fn verdict(
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
pub(super) fn slow_verdict(study: &Study<'_>, drive_margin: Option<f64>) -> FixtureVerdict {
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
