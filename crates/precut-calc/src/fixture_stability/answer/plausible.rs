//! Numbers that are allowed, but that no vise has: most likely given in another unit (`milling`, section 10).

use std::f64::consts::TAU;

use crate::calculator::Finding;

use crate::fixture_stability::answer::output::FixtureOutcome;
use crate::fixture_stability::answer::study::Study;

/// What a job states or implies, where it is usual, and what was likely meant.
pub(crate) struct Guard {
    what: &'static str,
    unit: &'static str,
    usual: (f64, f64),
    /// Factor on the number that another unit makes, and that unit. The first that brings the number home is named.
    meant: &'static [(f64, &'static str)],
}

/// sqrt(1000): what a factor of 1000 on a stiffness or a mass does to a natural frequency.
const ROOT: f64 = 31.622_776_601_683_793;

pub(crate) const FREQUENCY: Guard = Guard {
    what: "natural_frequency",
    unit: "Hz",
    usual: (20.0, 20_000.0),
    meant: &[
        (ROOT, "stiffness_n_per_um_or_mass_g"),
        (1.0 / ROOT, "stiffness_n_per_m"),
        (1000.0, "stiffness_n_per_um_and_mass_g"),
    ],
};
pub(crate) const DAMPING: Guard = Guard {
    what: "damping_ratio",
    unit: "1",
    usual: (1e-4, 0.5),
    meant: &[(1e-3, "damping_n_s_per_m"), (1e3, "damping_kn_s_per_m")],
};
pub(crate) const COEFFICIENT: Guard = Guard {
    what: "force_coefficient",
    unit: "N/mm2",
    usual: (100.0, 10_000.0),
    meant: &[(1e3, "coefficient_gpa"), (0.1, "coefficient_tenths_mpa"), (1e-6, "coefficient_n_per_m2")],
};
pub(crate) const FEED: Guard =
    Guard { what: "feed_per_tooth", unit: "mm/tooth", usual: (0.005, 1.0), meant: &[(1e-3, "feed_um")] };
/// Of a frequency or a damping ratio that is stated as such.
pub(crate) const STATED_FREQUENCY: Guard = Guard {
    what: "natural_frequency",
    unit: "Hz",
    usual: (20.0, 20_000.0),
    meant: &[(1000.0, "frequency_khz"), (1.0 / TAU, "frequency_rad_per_s")],
};
pub(crate) const STATED_RATIO: Guard =
    Guard { what: "damping_ratio", unit: "1", usual: (1e-4, 0.5), meant: &[(0.01, "ratio_percent")] };
/// Of an edge.
pub(crate) const EDGE: Guard =
    Guard { what: "edge_coefficient", unit: "N/mm", usual: (1.0, 200.0), meant: &[(1e-3, "edge_n_per_m")] };
pub(crate) const CLAMP: Guard =
    Guard { what: "clamp_force", unit: "N", usual: (50.0, 200_000.0), meant: &[(1e3, "force_kn")] };
const DEFLECTION: Guard =
    Guard { what: "static_deflection", unit: "mm", usual: (0.0, 1.0), meant: &[(1e-3, "stiffness_n_per_um")] };

impl Guard {
    /// Of a number at a field.
    pub(crate) fn on(&self, value: f64, pointer: impl Into<String>) -> Option<Finding> {
        let (low, high) = self.usual;
        if value <= 0.0 || (low..=high).contains(&value) {
            return None;
        }
        let home = |(factor, _): &&(f64, &'static str)| (low..=high).contains(&(factor * value));
        let likely = self.meant.iter().find(home).map_or("unknown", |(_, meant)| meant);
        let limit = if value < low { low } else { high };
        Some(
            Finding::new("implausible_unit", pointer)
                .measured(value, limit, self.unit)
                .with("what", self.what)
                .with("likely", likely),
        )
    }
}

/// Warnings of numbers that were likely given in another unit. No number is changed.
pub(in crate::fixture_stability) fn implausible(study: &Study<'_>, outcome: &FixtureOutcome) -> Vec<Finding> {
    let case = &study.case;
    // A mode that has no damping is warned of as that; a mode that is an effect was fitted or thought of.
    let modes = || outcome.modes.iter();
    let lowest = modes().map(|mode| mode.natural_frequency_hz).fold(f64::INFINITY, f64::min);
    let highest = modes().map(|mode| mode.natural_frequency_hz).fold(0.0, f64::max);
    let most_damped = modes().map(|mode| mode.damping_ratio).fold(0.0, f64::max);
    let quasi = &outcome.quasi_static;
    let deflection_mm = 1e-3 * quasi.displacement_max_um.abs().max(quasi.displacement_min_um.abs());
    let mut found: Vec<Finding> = [
        FREQUENCY.on(lowest, "/fixture").or_else(|| FREQUENCY.on(highest, "/fixture")),
        DAMPING.on(most_damped, "/fixture"),
        COEFFICIENT.on(case.cutting.coefficient, "/force/coefficient"),
        FEED.on(case.working.feed_mm, "/cut/feed_mm_per_tooth"),
        case.holding.clamp_force_n.and_then(|force| CLAMP.on(force, "/fixture/clamp_force_n")),
    ]
    .into_iter()
    .flatten()
    .collect();
    if found.is_empty() {
        found.extend(DEFLECTION.on(deflection_mm, "/fixture"));
    }
    found
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn each_guard_speaks_beyond_its_range_alone_and_names_what_brings_the_number_home() {
        for guard in [FREQUENCY, DAMPING, COEFFICIENT, FEED, CLAMP, DEFLECTION, STATED_FREQUENCY, STATED_RATIO, EDGE] {
            let (low, high) = guard.usual;
            assert!(guard.on(high, "").is_none() && guard.on(low, "").is_none() && guard.on(0.0, "").is_none());
            for (value, limit) in [(0.999 * low, low), (1.001 * high, high)] {
                if value > 0.0 {
                    assert_eq!(guard.on(value, "").unwrap().limit, Some(limit), "{}", guard.what);
                }
            }
            // Over twelve decades either way every unit is named somewhere, and only where it brings the number home.
            let mut named = std::collections::BTreeSet::new();
            for k in -240..=240 {
                let value = (0.5 * high) * 10_f64.powf(f64::from(k) / 20.0);
                let Some(found) = guard.on(value, "") else { continue };
                let likely = format!("{:?}", found.values.get("likely"));
                let is_home = |(factor, meant): &&(f64, &str)| {
                    (low..=high).contains(&(factor * value)) && likely.contains(&format!("\"{meant}\""))
                };
                match guard.meant.iter().find(is_home) {
                    Some((_, meant)) => drop(named.insert(*meant)),
                    None => assert!(likely.contains("unknown"), "{}: {value}: {likely}", guard.what),
                }
            }
            assert_eq!(named.len(), guard.meant.len(), "{}: {named:?}", guard.what);
        }
    }
}
