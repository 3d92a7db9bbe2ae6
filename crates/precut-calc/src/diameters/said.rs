//! What is said of the probability that diameters keep their limits.

use crate::calculator::{Finding, Message};
use crate::certainty::{Conformance, ImprovingAction, improbable, with_largest, with_most};

use super::{Asked, acceptance};

/// Codes of what is said here.
pub(crate) const EXPLANATION_CODES: &[&str] = &["probably_good", "first_part_tells", "aim_tells", "accept_between"];
/// Codes of what is said of other cuts, where these are tried.
pub(crate) const OTHER_CUTS_CODES: &[&str] =
    &["lower_feed_tells", "shallower_last_pass_tells", "steady_rest_tells", "centre_tells"];
/// Codes of the warnings made here.
pub(crate) const WARNING_CODES: &[&str] = &["improbable", "gauge_too_uncertain"];

/// What is said of it, most important first.
pub(crate) fn said(conformance: &Conformance) -> Vec<Message> {
    let joint = &conformance.joint;
    let first = Message::new("probably_good")
        .with("percent", 100.0 * joint.probability)
        .with("wanted_percent", 100.0 * joint.wanted)
        .with("met", if joint.met { "yes" } else { "no" })
        .with("common_percent", 100.0 * conformance.setup.share_common_to_all);
    let first = with_largest(with_most(first, joint), &conformance.contributions);
    let advised = conformance.advice.iter().map(|advice| {
        let told = match advice.action {
            ImprovingAction::ShiftAim { shift_um } => Message::new("aim_tells").with("shift_um", shift_um),
            ImprovingAction::MeasureFirstPart {
                z_mm,
                expected_um,
                shift_as_expected_um,
                shift_um_per_um,
                gauge_um: _,
            } => Message::new("first_part_tells")
                .with("z_mm", z_mm)
                .with("expected_um", expected_um)
                .with("shift_um", shift_as_expected_um)
                .with("shift_um_per_um", shift_um_per_um),
            ImprovingAction::LowerFeed { feed_mm_per_rev } => {
                Message::new("lower_feed_tells").with("feed_mm_per_rev", feed_mm_per_rev)
            }
            ImprovingAction::ShallowerLastPass { diameter_mm } => {
                Message::new("shallower_last_pass_tells").with("diameter_mm", diameter_mm)
            }
            ImprovingAction::AddSteadyRest { z_mm, compliance_um_per_n } => {
                Message::new("steady_rest_tells").with("z_mm", z_mm).with("compliance_um_per_n", compliance_um_per_n)
            }
            ImprovingAction::AddCentre { z_mm, compliance_um_per_n } => {
                Message::new("centre_tells").with("z_mm", z_mm).with("compliance_um_per_n", compliance_um_per_n)
            }
        };
        told.with("percent", 100.0 * advice.joint_probability)
    });
    let accepted = conformance.acceptance.as_ref().map(acceptance::said);
    std::iter::once(first).chain(advised).chain(accepted).collect()
}

/// What is warned of.
pub(crate) fn warnings(asked: &Asked<'_>, conformance: &Conformance) -> Vec<Finding> {
    let joint = &conformance.joint;
    let mut found = Vec::new();
    let width_um = asked.tolerance.size().half_width_um().map(|half| 2.0 * half);
    if let (Some(gauge), Some(width_um), None) = (&asked.uncertainty.measurement, width_um, &conformance.acceptance) {
        found.push(acceptance::none_left(gauge.standard_uncertainty_um, width_um));
    }
    found.extend(improbable("improbable", joint));
    found
}
