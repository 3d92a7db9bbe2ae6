//! Rules between fields. What one field alone may hold stands in its schema.

use crate::calculator::{Check, Finding, Violations};
use crate::effects::DeflectionEffect as Effect;

use super::grid::station_count;
use super::input::{Job, MAX_STATIONS, Stations, Support};
use crate::shaft::{self, elastic::clamping, elastic::ends};

/// Codes of the faults found here.
pub(super) const CODES: &[&str] = &[
    "speed_or_rpm",
    "passes_not_descending",
    "passes_incomplete",
    "station_outside_shaft",
    "stations_not_ascending",
    "nothing_to_turn",
    "too_many_stations",
    "stock_profile_empty",
    "stock_profile_not_ascending",
    "bad_diameter",
    "duplicate_effect",
    "condition_missing",
    "effect_beyond_base",
    "effect_without_headstock",
    "effect_without_tailstock",
    "effect_without_rest",
    "effect_of_carrying_rest",
    "effect_not_with_passes",
];

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        shaft::check::shaft(&self.shaft, violations);
        shaft::check::supports(&self.shaft, &self.supports, violations);
        check_cut(self, violations);
        check_passes(self, violations);
        check_stations(self, violations);
        check_stock_profile(self, violations);
        self.force.check("/force", violations);
        check_effects(self, violations);
    }
}

fn length_mm(job: &Job) -> f64 {
    job.shaft.segments.iter().map(|s| s.length_mm).sum()
}

fn check_cut(job: &Job, violations: &mut Violations) {
    let cut = &job.cut;
    violations.require(cut.speed_m_per_min.is_some() != cut.spindle_speed_rpm.is_some(), || {
        let given = if cut.speed_m_per_min.is_some() { "both" } else { "neither" };
        Finding::new("speed_or_rpm", "/cut").with("given", given)
    });
}

fn check_passes(job: &Job, violations: &mut Violations) {
    let mut before = f64::INFINITY;
    for (i, pass) in job.passes.iter().enumerate() {
        violations.require(pass.speed_m_per_min.is_none() || pass.spindle_speed_rpm.is_none(), || {
            Finding::new("speed_or_rpm", format!("/passes/{i}")).with("given", "both")
        });
        violations.require(pass.diameter_mm < before, || {
            Finding::new("passes_not_descending", format!("/passes/{i}/diameter_mm")).measured(
                pass.diameter_mm,
                before,
                "mm",
            )
        });
        before = pass.diameter_mm;
    }
    let turned = job.shaft.segments.iter().filter(|s| s.stock_mm() > s.diameter_mm).map(|s| s.diameter_mm);
    let least = turned.fold(f64::INFINITY, f64::min);
    if let Some(last) = job.passes.last() {
        violations.require(last.diameter_mm <= least || least.is_infinite(), || {
            Finding::new("passes_incomplete", format!("/passes/{}/diameter_mm", job.passes.len() - 1)).measured(
                last.diameter_mm,
                least,
                "mm",
            )
        });
    }
}

fn check_stations(job: &Job, violations: &mut Violations) {
    let length = length_mm(job);
    match &job.stations {
        Stations::List { z_mm } => {
            for (i, z) in z_mm.iter().enumerate() {
                violations
                    .require((0.0..=length).contains(z), || outside_shaft(format!("/stations/z_mm/{i}"), *z, length));
                violations.require(i == 0 || *z > z_mm[i - 1], || {
                    Finding::new("stations_not_ascending", format!("/stations/z_mm/{i}")).measured(
                        *z,
                        z_mm[i.saturating_sub(1)],
                        "mm",
                    )
                });
            }
        }
        Stations::PerZone { .. } => {
            let count = station_count(job);
            violations.require(count > 0 || job.shaft.segments.is_empty(), || {
                Finding::new("nothing_to_turn", "/shaft/segments")
            });
            violations.require(count <= MAX_STATIONS, || {
                let (count, most) =
                    (crate::calculator::Value::from(count), crate::calculator::Value::from(MAX_STATIONS));
                Finding::new("too_many_stations", "/stations/count").with("count", count).with("most", most)
            });
        }
    }
}

/// A station beside the shaft, with the end that it lies beyond as the limit.
pub(super) fn outside_shaft(pointer: String, z_mm: f64, length_mm: f64) -> Finding {
    let end = if z_mm < 0.0 { 0.0 } else { length_mm };
    Finding::new("station_outside_shaft", pointer).measured(z_mm, end, "mm").with("length_mm", length_mm)
}

fn check_stock_profile(job: &Job, violations: &mut Violations) {
    let Some(profile) = &job.stock_profile else { return };
    violations.require(!profile.is_empty(), || Finding::new("stock_profile_empty", "/stock_profile"));
    for (i, pair) in profile.rows().windows(2).enumerate() {
        violations.require(pair[1].z_mm > pair[0].z_mm, || {
            Finding::new("stock_profile_not_ascending", format!("/stock_profile/{}/z_mm", i + 1)).measured(
                pair[1].z_mm,
                pair[0].z_mm,
                "mm",
            )
        });
    }
    let bore = job.shaft.segments.iter().map(|s| s.bore_diameter_mm).fold(0.0, f64::max);
    for (i, row) in profile.rows().iter().enumerate() {
        violations.require(row.diameter_mm > bore, || {
            Finding::new("bad_diameter", format!("/stock_profile/{i}/diameter_mm")).measured(
                row.diameter_mm,
                bore,
                "mm",
            )
        });
    }
}

fn check_effects(job: &Job, violations: &mut Violations) {
    for (i, effect) in job.effects.iter().enumerate() {
        let kind = effect.kind();
        let at = |field: &str| format!("/effects/{i}{field}");
        violations.require(job.effects[..i].iter().all(|before| before.kind() != kind), || {
            Finding::new("duplicate_effect", at("/kind")).with("kind", kind)
        });
        for condition in effect.cause().conditions {
            let given = match *condition {
                "tool_path_at_start_m" => job.conditions.tool_path_at_start_m.is_some(),
                "warm_time_at_start_min" => job.conditions.warm_time_at_start_min.is_some(),
                _ => false,
            };
            violations.require(given, || {
                Finding::new("condition_missing", format!("/conditions/{condition}"))
                    .with("kind", kind)
                    .with("condition", *condition)
            });
        }
        check_effect_on_structure(job, effect, &at, violations);
    }
}

fn check_effect_on_structure(job: &Job, effect: &Effect, at: &dyn Fn(&str) -> String, violations: &mut Violations) {
    let (head, tail) = ends(&job.supports);
    let kind = effect.kind();
    let mut softens = |base_um_per_n: f64, delta: f64| {
        violations.require(base_um_per_n + delta >= 0.0, || {
            Finding::new("effect_beyond_base", at("/delta_um_per_n"))
                .measured(delta, -base_um_per_n, "um/N")
                .with("kind", kind)
        });
    };
    let compliance = |support: Option<usize>| support.map_or(0.0, |i| job.supports[i].compliance_um_per_n());
    match *effect {
        Effect::HeadstockCompliance { delta_um_per_n } => softens(compliance(head), delta_um_per_n),
        Effect::TailstockCompliance { delta_um_per_n } if tail.is_some() => softens(compliance(tail), delta_um_per_n),
        Effect::CarriageCompliance { delta_um_per_n } => softens(job.carriage.compliance_um_per_n, delta_um_per_n),
        Effect::TailstockCompliance { .. } | Effect::TailstockOffset { .. } if tail.is_none() => {
            violations.add(Finding::new("effect_without_tailstock", at("")).with("kind", kind));
        }
        Effect::ChuckRotationalStiffness { .. } if clamping(&job.supports).is_none() => {
            violations.add(Finding::new("effect_without_headstock", at("")).with("kind", kind));
        }
        Effect::SteadyRestOffset { station_mm, .. } => match steady_at(job, station_mm) {
            None => violations.add(Finding::new("effect_without_rest", at("/station_mm")).value(station_mm, "mm")),
            Some(rest) => violations.require(held_without(job, rest), || {
                Finding::new("effect_of_carrying_rest", at("/station_mm")).value(station_mm, "mm")
            }),
        },
        Effect::UncutSideStiffness {} => violations
            .require(job.passes.is_empty(), || Finding::new("effect_not_with_passes", at("")).with("kind", kind)),
        _ => {}
    }
}

/// Whether the shaft is held when one of its supports is taken away.
fn held_without(job: &Job, left_out: usize) -> bool {
    let others = || job.supports.iter().enumerate().filter(|(i, _)| *i != left_out).map(|(_, support)| support);
    others().any(|s| matches!(s, Support::Chuck { .. })) || others().filter(|s| s.carries()).count() >= 2
}

/// Index of the steady rest that stands at a station.
pub(super) fn steady_at(job: &Job, station_mm: f64) -> Option<usize> {
    let tolerance = shaft::check::SAME_STATION * length_mm(job).max(1.0);
    job.supports
        .iter()
        .position(|s| matches!(s, Support::SteadyRest { z_mm, .. } if (z_mm - station_mm).abs() <= tolerance))
}
