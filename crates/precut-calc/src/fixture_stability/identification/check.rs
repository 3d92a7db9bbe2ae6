//! Rules between fields. What one field alone may hold stands in its schema.

use crate::calculator::{Check, Finding, Violations};

use super::input::IdentificationJob;
use super::unknowns::{Parameter, Unknown};
use crate::fixture_stability::job::input::Vise;
use crate::fixture_stability::model::cutting::engagement_rad;

/// Codes of the faults found here, and those that fields name for their range.
pub(super) const CODES: &[&str] = &[
    "strip_misses_cutter",
    "bad_spindle_speed",
    "bad_feed_per_tooth",
    "negative_damping",
    "bad_clamp_force",
    "steady_beyond_run",
    "feed_given_twice",
    "teeth_missing",
    "row_speed_missing",
    "row_feed_missing",
    "row_without_value",
    "range_reversed",
    "unknowns_exclude_each_other",
    "unknown_without_influence",
    "unknown_stated_elsewhere",
    "too_few_rows",
    "listed_twice",
];

impl Check for IdentificationJob {
    fn check(&self, violations: &mut Violations) {
        check_cut(self, violations);
        check_rows(self, violations);
        check_unknowns(self, violations);
        for (i, meaning) in self.amplitudes.iter().enumerate() {
            violations.require(!self.amplitudes[..i].contains(meaning), || {
                Finding::new("listed_twice", format!("/amplitudes/{i}")).with("name", meaning.name())
            });
        }
        for (i, law) in self.regenerations.iter().enumerate() {
            violations.require(!self.regenerations[..i].contains(law), || {
                Finding::new("listed_twice", format!("/regenerations/{i}")).with("name", law.name())
            });
        }
        let runs = &self.simulation;
        violations.require(runs.steady_tooth_periods <= runs.tooth_periods, || {
            Finding::new("steady_beyond_run", "/simulation/steady_tooth_periods").measured(
                f64::from(runs.steady_tooth_periods),
                f64::from(runs.tooth_periods),
                "1",
            )
        });
    }
}

fn check_cut(job: &IdentificationJob, violations: &mut Violations) {
    let cut = &job.cut;
    let radius = 0.5 * job.cutter.diameter_mm;
    violations.require(engagement_rad(radius, cut.width_mm, cut.offset_mm).is_some(), || {
        Finding::new("strip_misses_cutter", "/cut/offset_mm").measured(
            cut.offset_mm.abs(),
            radius + 0.5 * cut.width_mm,
            "mm",
        )
    });
    violations.require(cut.feed_mm_per_tooth.is_none() || cut.feed_mm_per_min.is_none(), || {
        Finding::new("feed_given_twice", "/cut/feed_mm_per_min")
    });
}

fn check_rows(job: &IdentificationJob, violations: &mut Violations) {
    let speed_known = job.cut.spindle_speed_rpm.is_some() || job.unknowns.spindle_speed_rpm.is_some();
    let feed_known = job.cut.feed_mm_per_tooth.is_some() || job.cut.feed_mm_per_min.is_some();
    for (i, row) in job.measurements.rows().iter().enumerate() {
        let mut require = |holds: bool, code: &'static str, field: &str| {
            violations.require(holds, || Finding::new(code, format!("/measurements/{i}/{field}")).with("row", i));
        };
        require(row.teeth.is_some() || job.cutter.teeth.is_some(), "teeth_missing", "teeth");
        require(row.spindle_speed_rpm.is_some() || speed_known, "row_speed_missing", "spindle_speed_rpm");
        require(row.feed_mm_per_tooth.is_some() || feed_known, "row_feed_missing", "feed_mm_per_tooth");
        require(row.amplitude_um.is_some() || row.opened.is_some(), "row_without_value", "amplitude_um");
    }
}

fn check_unknowns(job: &IdentificationJob, violations: &mut Violations) {
    let unknowns = Unknown::all(job);
    let pointer = |parameter: Parameter| format!("/unknowns/{}", parameter.name());
    for unknown in &unknowns {
        violations.require(unknown.from < unknown.to, || {
            Finding::new("range_reversed", pointer(unknown.parameter))
                .measured(unknown.to, unknown.from, unknown.parameter.unit())
                .with("name", unknown.parameter.name())
        });
    }
    let has = |parameter: Parameter| unknowns.iter().any(|unknown| unknown.parameter == parameter);
    for (one, other) in [(Parameter::NaturalFrequency, Parameter::Mass), (Parameter::DampingRatio, Parameter::Damping)]
    {
        violations.require(!(has(one) && has(other)), || {
            Finding::new("unknowns_exclude_each_other", pointer(one))
                .with("name", one.name())
                .with("other", other.name())
        });
    }
    // Both joints of a screw vise act together, and it has no jaw that moves by itself.
    if matches!(job.fixture, Vise::SelfLocking(_)) {
        for parameter in [Parameter::StiffnessShare, Parameter::DampingShare, Parameter::JawMass] {
            violations.require(!has(parameter), || {
                Finding::new("unknown_without_influence", pointer(parameter)).with("name", parameter.name())
            });
        }
    }
    violations.require(!(has(Parameter::ForceCoefficient) && job.peak_force.is_some()), || {
        Finding::new("unknown_stated_elsewhere", pointer(Parameter::ForceCoefficient))
            .with("name", Parameter::ForceCoefficient.name())
            .with("by", "peak_force")
    });
    let rows = job.measurements.rows();
    violations.require(
        !has(Parameter::SpindleSpeed) || rows.is_empty() || rows.iter().any(|row| row.spindle_speed_rpm.is_none()),
        || {
            Finding::new("unknown_stated_elsewhere", pointer(Parameter::SpindleSpeed))
                .with("name", Parameter::SpindleSpeed.name())
                .with("by", "measurements")
        },
    );
    let used = rows.iter().filter(|row| !row.excluded && row.amplitude_um.is_some()).count();
    let needed = if unknowns.is_empty() { 1 } else { unknowns.len() + 2 };
    violations.require(used >= needed, || {
        Finding::new("too_few_rows", "/measurements")
            .measured(used as f64, needed as f64, "1")
            .with("unknowns", unknowns.len())
    });
}
