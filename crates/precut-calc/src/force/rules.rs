//! Rules that several force models share.

use super::Forces;
use crate::calculator::{Finding, Violations};

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
        Finding::new("bad_wear_factor", format!("{pointer}/wear_factor")).measured(factor, 0.0, "1")
    });
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
        violations
            .require(not_negative(value), || Finding::new(code, format!("{pointer}/{name}")).measured(value, 0.0, "N"));
    }
}

/// 1: what a factor is where nobody says otherwise.
pub(super) const fn one() -> f64 {
    1.0
}
