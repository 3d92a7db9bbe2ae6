//! Rules between fields. What one field alone may hold stands in its schema.

use crate::calculator::{Check, Finding, Violations};
use crate::diameters::{self, Aim};
use crate::effects::DeflectionEffect as Effect;

use crate::deflection_compensation::job::formula;
use crate::deflection_compensation::job::grid::{interpolate, station_count};
use crate::deflection_compensation::job::input::{Job, MAX_STATIONS, Segment, Stations, StockRow, Support};
use crate::force::ForceModel;
use crate::shaft::{self, DIAMETER_MM, elastic::clamping, elastic::ends, places};

/// Largest change of a compliance that the schemas of the effects allow, to either side of what a support has, um/N.
const COMPLIANCE_CHANGE_UM_PER_N: std::ops::RangeInclusive<f64> = -1.0..=10.0;
/// Largest change of the depth exponent that the schema of its effect allows.
const LARGEST_EXPONENT_CHANGE: f64 = 3.0;
/// Stations of a measured blank that the schema allows, mm.
const PROFILE_STATION_MM: std::ops::RangeInclusive<f64> = -100_000.0..=100_000.0;

/// Codes of the faults found here.
pub(in crate::deflection_compensation) const CODES: &[&str] = &[
    "speed_or_rpm",
    "passes_not_descending",
    "passes_incomplete",
    "station_outside_shaft",
    "nothing_to_turn",
    "too_many_stations",
    "stock_profile_empty",
    "stock_profile_not_ascending",
    "bad_diameter",
    "aim_without_size_limits",
    "formula_unreadable",
];

/// Codes of the faults of effects and of what they depend on alone.
pub(crate) const EFFECT_CODES: &[&str] = &[
    "stations_not_ascending",
    "duplicate_effect",
    "condition_missing",
    "effect_beyond_base",
    "force_falls_with_depth",
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
        diameters::check(&self.asked(), violations);
        let aims = !matches!(self.aim, Aim::Nominal {});
        violations.require(!aims || self.tolerance.size().middle_um().is_some(), || {
            Finding::new("aim_without_size_limits", "/aim")
        });
    }
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
        // A diameter that cannot be says nothing of the next one.
        if !DIAMETER_MM.contains(&pass.diameter_mm) {
            continue;
        }
        violations.require(pass.diameter_mm < before, || {
            Finding::new("passes_not_descending", format!("/passes/{i}/diameter_mm"))
                .measured(pass.diameter_mm, before, "mm")
                .with("minimum", *DIAMETER_MM.start())
                .with("below", before)
        });
        before = pass.diameter_mm;
    }
    let turned = job.shaft.segments.iter().filter(|s| s.has_stock() && s.stock_mm() > s.diameter_mm);
    let least = turned.map(|s| s.diameter_mm).fold(f64::INFINITY, f64::min);
    if let Some(last) = job.passes.last().filter(|last| DIAMETER_MM.contains(&last.diameter_mm)) {
        violations.require(last.diameter_mm <= least || least.is_infinite(), || {
            Finding::new("passes_incomplete", format!("/passes/{}/diameter_mm", job.passes.len() - 1))
                .measured(last.diameter_mm, least, "mm")
                .within(*DIAMETER_MM.start(), least)
        });
    }
}

fn check_stations(job: &Job, violations: &mut Violations) {
    match &job.stations {
        Stations::List { z_mm } => check_station_list(job, z_mm, violations),
        Stations::PerZone { .. } => {
            let count = station_count(job);
            // Diameters that cannot be may be what keeps a segment from being turned.
            let judged = !job.shaft.segments.is_empty() && job.shaft.segments.iter().all(Segment::has_stock);
            violations.require(count > 0 || !judged, || Finding::new("nothing_to_turn", "/shaft/segments"));
            violations.require(count <= MAX_STATIONS, || {
                let (count, most) =
                    (crate::calculator::Value::from(count), crate::calculator::Value::from(MAX_STATIONS));
                Finding::new("too_many_stations", "/stations/count").with("count", count).with("most", most)
            });
        }
    }
}

fn check_station_list(job: &Job, z_mm: &[f64], violations: &mut Violations) {
    let length = job.shaft.known_length_mm();
    let ends_mm = job.shaft.ends_mm();
    let mut before: Option<f64> = None;
    for (i, &z) in z_mm.iter().enumerate() {
        let at = || format!("/stations/z_mm/{i}");
        let z = places::settled(z, &ends_mm);
        // What stands beside the shaft is told that, and says nothing of the order of the others.
        if let Some(length) = length.filter(|length| !places::within(z, [0.0, *length])) {
            violations.add(outside_shaft(at(), z, length));
            continue;
        }
        if let Some(before) = before {
            violations.require(z > before, || {
                let finding = Finding::new("stations_not_ascending", at()).measured(z, before, "mm");
                let finding = finding.with("above", before);
                length.into_iter().fold(finding, |finding, length| finding.with("maximum", length))
            });
        }
        before = Some(z);
    }
}

/// A station beside the shaft, with the end that it lies beyond as the limit.
pub(in crate::deflection_compensation) fn outside_shaft(pointer: String, z_mm: f64, length_mm: f64) -> Finding {
    shaft::check::beside("station_outside_shaft", pointer, z_mm, length_mm).with("length_mm", length_mm)
}

fn check_stock_profile(job: &Job, violations: &mut Violations) {
    let Some(profile) = &job.stock_profile else { return };
    violations.require(!profile.is_empty(), || Finding::new("stock_profile_empty", "/stock_profile"));
    for (i, pair) in profile.rows().windows(2).enumerate() {
        let possible = pair.iter().all(|row| PROFILE_STATION_MM.contains(&row.z_mm));
        violations.require(pair[1].z_mm > pair[0].z_mm || !possible, || {
            Finding::new("stock_profile_not_ascending", format!("/stock_profile/{}/z_mm", i + 1))
                .measured(pair[1].z_mm, pair[0].z_mm, "mm")
                .with("above", pair[0].z_mm)
                .with("maximum", *PROFILE_STATION_MM.end())
        });
    }
    check_bore(job, profile.rows(), violations);
}

/// A measured blank is thicker than the bore at that place: at every row, and where its straight line from row to row
/// comes to the end of a segment.
fn check_bore(job: &Job, rows: &[StockRow], violations: &mut Violations) {
    let ends_mm = job.shaft.ends_mm();
    let bore_mm = |segment: &Segment| if segment.has_bore() { segment.bore_diameter_mm } else { 0.0 };
    let mut is_told = vec![false; rows.len()];
    let mut require = |i: usize, diameter_mm: f64, bore_mm: f64| {
        if diameter_mm > bore_mm || std::mem::replace(&mut is_told[i], true) {
            return;
        }
        let finding = Finding::new("bad_diameter", format!("/stock_profile/{i}/diameter_mm"));
        let finding = finding.measured(diameter_mm, bore_mm, "mm").with("maximum", *DIAMETER_MM.end());
        let least = if bore_mm < *DIAMETER_MM.start() { ("minimum", *DIAMETER_MM.start()) } else { ("above", bore_mm) };
        violations.add(finding.with(least.0, least.1));
    };
    for (i, row) in rows.iter().enumerate() {
        let here = &job.shaft.segments[places::pieces_at(row.z_mm, &ends_mm)];
        require(i, row.diameter_mm, here.iter().map(bore_mm).fold(0.0, f64::max));
    }
    if rows.is_empty() || rows.windows(2).any(|pair| pair[1].z_mm <= pair[0].z_mm) {
        return;
    }
    let (z, d): (Vec<f64>, Vec<f64>) = rows.iter().map(|row| (row.z_mm, row.diameter_mm)).unzip();
    for (segment, ends) in job.shaft.segments.iter().zip(ends_mm.windows(2)) {
        for (end, diameter_mm) in ends.iter().zip(interpolate(&z, &d, ends)) {
            let next = z.partition_point(|row| row < end).min(z.len() - 1);
            require(next, diameter_mm, bore_mm(segment));
        }
    }
}

pub(in crate::deflection_compensation) fn check_effects(job: &Job, violations: &mut Violations) {
    for (i, effect) in job.effects.iter().enumerate() {
        let kind = effect.kind();
        let at = |field: &str| format!("/effects/{i}{field}");
        // Formulas may recur by other names.
        let label = |effect: &Effect| effect.formula().map(|own| own.label().to_owned());
        let is_same = |before: &Effect| before.kind() == kind && label(before) == label(effect);
        violations.require(!job.effects[..i].iter().any(is_same), || {
            Finding::new("duplicate_effect", at("/kind")).with("kind", kind)
        });
        if let Some(own) = effect.formula() {
            formula::check(job, &own, &at(""), violations);
        }
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
        check_effect_on_force(job, effect, &at, violations);
    }
}

/// A force that falls with depth has no chip to begin with: it grows beyond all bounds as the depth goes to 0.
fn check_effect_on_force(job: &Job, effect: &Effect, at: &dyn Fn(&str) -> String, violations: &mut Violations) {
    if let Effect::DepthExponent { delta, .. } = *effect
        && let Some(exponent) = passive_exponent(&job.force)
    {
        violations.require(exponent + delta >= 0.0, || {
            // Not `-exponent`: that of nothing is -0.
            Finding::new("force_falls_with_depth", at("/delta"))
                .measured(delta, 0.0 - exponent, "1")
                .within(0.0 - exponent, LARGEST_EXPONENT_CHANGE)
                .with("exponent", exponent)
        });
    }
}

/// Exponent of the depth in the part of the passive force that depends on it, where that is a power.
pub(in crate::deflection_compensation) fn passive_exponent(force: &ForceModel) -> Option<f64> {
    match force {
        ForceModel::PowerLaw(model) => Some(model.passive.depth_exponent),
        // A model that is refused has no force.
        other => other.at(1.0, 100.0).passive_power().filter(|(factor, _)| *factor > 0.0).map(|(_, exponent)| exponent),
    }
}

fn check_effect_on_structure(job: &Job, effect: &Effect, at: &dyn Fn(&str) -> String, violations: &mut Violations) {
    let (head, tail) = ends(&job.supports);
    let kind = effect.kind();
    let mut softens = |base_um_per_n: f64, delta: f64| {
        violations.require(base_um_per_n + delta >= 0.0, || {
            let (least, most) = COMPLIANCE_CHANGE_UM_PER_N.into_inner();
            // Not `-base`: that of nothing is -0.
            let least = (0.0 - base_um_per_n).max(least);
            Finding::new("effect_beyond_base", at("/delta_um_per_n"))
                .measured(delta, least, "um/N")
                .within(least, most)
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
        Effect::Remainder { ref profile, .. } => {
            for (k, pair) in profile.windows(2).enumerate().filter(|(_, pair)| pair[1].z_mm <= pair[0].z_mm) {
                let place = at(&format!("/profile/{}/z_mm", k + 1));
                violations.add(Finding::new("stations_not_ascending", place).measured(
                    pair[1].z_mm,
                    pair[0].z_mm,
                    "mm",
                ));
            }
        }
        _ => {}
    }
}

/// Whether the shaft is held when one of its supports is taken away.
fn held_without(job: &Job, left_out: usize) -> bool {
    let others = || job.supports.iter().enumerate().filter(|(i, _)| *i != left_out).map(|(_, support)| support);
    others().any(|s| matches!(s, Support::Chuck { .. })) || others().filter(|s| s.carries()).count() >= 2
}

/// Index of the steady rest that stands at a station.
pub(in crate::deflection_compensation) fn steady_at(job: &Job, station_mm: f64) -> Option<usize> {
    let stands = |s: &Support| matches!(s, Support::SteadyRest { z_mm, .. } if places::same(*z_mm, station_mm));
    job.supports.iter().position(stands)
}
