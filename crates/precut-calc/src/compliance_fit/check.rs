//! Rules between fields. What one field alone may hold stands in its schema.

use crate::calculator::{Check, Finding, Violations};
use crate::material;
use crate::shaft::places;

use super::input::{GaugedAt, Job, TestSupport};
use super::model::unknowns;

/// Codes of the faults found here.
pub(super) const CODES: &[&str] = &[
    "bad_bore",
    "unknown_material",
    "elastic_constants_missing",
    "support_outside_shaft",
    "duplicate_support",
    "unstable_support",
    "several_chucks",
    "load_without_place",
    "place_outside_bar",
    "gauge_at_tool",
    "load_of_nothing",
    "nothing_to_find",
    "too_few_readings",
];

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        self.check_bar(violations);
        let length_mm = self.length_mm();
        self.check_supports(length_mm, violations);
        self.check_rows(length_mm, violations);
        let (rows, wanted) = (self.measurements.rows().len(), unknowns(self).len());
        violations.require(rows == 0 || wanted > 0, || Finding::new("nothing_to_find", "/supports"));
        // A count of rows is far below 2^53.
        #[allow(clippy::cast_precision_loss)]
        violations.require(rows > 0 && rows >= wanted, || {
            Finding::new("too_few_readings", "/measurements").measured(rows as f64, wanted.max(1) as f64, "1")
        });
    }
}

impl Job {
    /// Length of the bar, where each piece has one that it may have.
    pub(super) fn length_mm(&self) -> f64 {
        places::ends_mm(self.bar.segments.iter().map(|segment| segment.length_mm)).last().copied().unwrap_or(0.0)
    }

    fn check_bar(&self, violations: &mut Violations) {
        for (i, segment) in self.bar.segments.iter().enumerate() {
            violations.require(segment.bore_diameter_mm < segment.diameter_mm, || {
                Finding::new("bad_bore", format!("/bar/segments/{i}/bore_diameter_mm"))
                    .measured(segment.bore_diameter_mm, segment.diameter_mm, "mm")
                    .with("minimum", 0.0)
                    .with("below", segment.diameter_mm)
            });
        }
        match &self.bar.material {
            Some(id) => violations.require(material::find(id).is_some(), || {
                Finding::new("unknown_material", "/bar/material")
                    .with("id", id.clone())
                    .with("known", material::library().iter().map(|m| m.id).collect::<Vec<_>>())
            }),
            None => violations.require(self.bar.youngs_modulus_n_per_mm2.is_some(), || {
                Finding::new("elastic_constants_missing", "/bar/youngs_modulus_n_per_mm2")
            }),
        }
    }

    fn check_supports(&self, length_mm: f64, violations: &mut Violations) {
        let mut seen: Vec<f64> = Vec::new();
        for (i, support) in self.supports.iter().enumerate() {
            let z = support.z_mm();
            violations.require(places::within(z, [0.0, length_mm]), || {
                let end = if z < 0.0 { 0.0 } else { length_mm };
                Finding::new("support_outside_shaft", format!("/supports/{i}/z_mm"))
                    .measured(z, end, "mm")
                    .within(0.0, length_mm)
            });
            violations.require(!seen.iter().any(|other| places::same(*other, z)), || {
                Finding::new("duplicate_support", format!("/supports/{i}/z_mm")).value(z, "mm")
            });
            seen.push(z);
        }
        let chucks = self.supports.iter().filter(|support| matches!(support, TestSupport::Chuck { .. })).count();
        violations.require(chucks <= 1, || Finding::new("several_chucks", "/supports"));
        let stands = chucks > 0 || self.supports.len() >= 2;
        violations
            .require(stands, || Finding::new("unstable_support", "/supports").with("carrying", self.supports.len()));
    }

    fn check_rows(&self, length_mm: f64, violations: &mut Violations) {
        for (i, row) in self.measurements.rows().iter().enumerate() {
            let at = |field: &str| format!("/measurements/{i}/{field}");
            violations.require(row.force_n != 0.0, || Finding::new("load_of_nothing", at("force_n")).with("row", i));
            if row.gauged_at() == GaugedAt::Tool {
                // It reads between tool post and bed: a station would be taken for one at the bar.
                violations.require(row.z_reading_mm.is_none(), || {
                    Finding::new("gauge_at_tool", at("z_reading_mm")).with("row", i)
                });
                continue;
            }
            violations.require(row.z_load_mm.is_some(), || {
                Finding::new("load_without_place", at("z_load_mm")).with("row", i)
            });
            for (field, place) in [("z_load_mm", row.z_load_mm), ("z_reading_mm", row.z_reading_mm)] {
                let Some(z) = place else { continue };
                violations.require(places::within(z, [0.0, length_mm]), || {
                    Finding::new("place_outside_bar", at(field)).measured(z, length_mm, "mm").within(0.0, length_mm)
                });
            }
        }
    }
}
