//! Rules that several force models share.

use super::Forces;
use crate::calculator::{Finding, Violations};

/// Largest force that the schemas allow, N.
pub(super) const MOST_FORCE_N: f64 = 1_000_000.0;
/// Largest factor of wear, or ratio of two forces, that the schemas allow.
pub(super) const MOST_FACTOR: f64 = 10.0;
/// Largest nose radius that the schemas allow, mm.
const MOST_NOSE_RADIUS_MM: f64 = 50.0;

/// Finite and not negative.
pub(super) fn not_negative(value: f64) -> bool {
    value.is_finite() && value >= 0.0
}

/// Finite and positive.
pub(super) fn positive(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

/// The factor of wear must be positive.
pub(super) fn check_wear(factor: f64, pointer: &str, violations: &mut Violations) {
    violations.require(positive(factor), || {
        Finding::new("bad_wear_factor", format!("{pointer}/wear_factor"))
            .measured(factor, 0.0, "1")
            .with("above", 0.0)
            .with("maximum", MOST_FACTOR)
    });
}

/// A lead angle that is none; `most` says how far they go, and whether that one is allowed (`maximum`) or not (`below`).
pub(super) fn bad_lead_angle(angle_deg: f64, most: (&'static str, f64), pointer: String) -> Finding {
    let limit = if angle_deg >= most.1 { most.1 } else { 0.0 };
    Finding::new("bad_lead_angle", pointer).measured(angle_deg, limit, "deg").with("above", 0.0).with(most.0, most.1)
}

/// A nose radius that is none; `least` says whether 0 is one (`minimum`) or not (`above`).
pub(super) fn bad_nose_radius(radius_mm: f64, least: &'static str, pointer: String) -> Finding {
    let finding = Finding::new("bad_nose_radius", pointer).measured(radius_mm, 0.0, "mm");
    finding.with(least, 0.0).with("maximum", MOST_NOSE_RADIUS_MM)
}

/// The constant part must not be negative.
pub(super) fn check_rubbing(rubbing: Option<&Forces>, pointer: &str, violations: &mut Violations) {
    if let Some(forces) = rubbing {
        check_forces(forces, "bad_rubbing_force", &format!("{pointer}/rubbing"), violations);
    }
}

/// None of the components may be negative.
pub(super) fn check_forces(forces: &Forces, code: &'static str, pointer: &str, violations: &mut Violations) {
    for (name, value) in [("passive_n", forces.passive_n), ("main_n", forces.main_n), ("feed_n", forces.feed_n)] {
        violations.require(not_negative(value), || {
            Finding::new(code, format!("{pointer}/{name}")).measured(value, 0.0, "N").within(0.0, MOST_FORCE_N)
        });
    }
}

/// 1: what a factor is where nobody says otherwise.
pub(super) const fn one() -> f64 {
    1.0
}
