//! Rules between fields. What one field alone may hold stands in its schema.

use crate::calculator::{Check, Finding, Violations};
use crate::num::cylinder::{Point, least_squares};
use crate::ring_roundness::evaluation::instrument::Unknown;

use super::input::Job;
use super::sections::{NoSections, Table, as_job, points, section_job, sections};

/// Codes of the faults found here.
pub(super) const CODES: &[&str] = &[
    "sections_missing",
    "sections_given_twice",
    "layout_unknown",
    "section_heights_missing",
    "too_few_sections",
    "datum_sections_wrong",
    "datum_sections_missing",
    "cylinder_undetermined",
];

/// Codes of the faults that a section has as a section.
pub(super) const SECTION_CODES: &[&str] = &[
    "nominal_radius_missing",
    "too_few_points",
    "angles_look_like_radians",
    "points_on_a_line",
    "deviation_below_centre",
    "not_round",
    "band_inside_out",
];

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        let [table] = Table::of(self)[..] else {
            let code = if Table::of(self).is_empty() { "sections_missing" } else { "sections_given_twice" };
            let given: Vec<&'static str> = Table::of(self).into_iter().map(Table::name).collect();
            violations.add(Finding::new(code, "").with("given", given));
            return;
        };
        let sections = match sections(self) {
            Ok(sections) => sections,
            Err(NoSections::File(Unknown::NoNumbers)) => {
                return violations.add(Finding::new("layout_unknown", "/file/text"));
            }
            Err(NoSections::File(Unknown::Columns(columns))) => {
                return violations.add(Finding::new("layout_unknown", "/file/columns").with("columns", columns));
            }
            Err(NoSections::Heights { given, sections }) => {
                let finding = Finding::new("section_heights_missing", "/file/section_heights_mm");
                return violations.add(finding.with("given", given).with("sections", sections));
            }
        };
        let at = format!("/{}", table.name());
        if sections.len() < 2 {
            return violations.add(Finding::new("too_few_sections", at).with("sections", sections.len()));
        }
        check_datum(self, sections.len(), violations);
        let mut filter = Violations::default();
        section_job(self, None).check(&mut filter);
        let faults = filter.into_vec().into_iter().filter(|fault| fault.pointer.starts_with("/filter"));
        faults.for_each(|fault| violations.add(fault));
        for (index, section) in sections.iter().enumerate() {
            let mut found = Violations::default();
            as_job(self, section).check(&mut found);
            // The first section that has one tells of it: the others mostly have the same.
            if let Some(fault) = found.into_vec().into_iter().next() {
                let pointer = if fault.pointer.starts_with("/nominal") { fault.pointer.clone() } else { at };
                return violations.add(Finding { pointer, ..fault }.with("section", index + 1));
            }
        }
        let all: Vec<Point> =
            sections.iter().filter_map(|section| points(self, section).ok()).flat_map(|(p, _)| p).collect();
        violations.require(least_squares(&all).is_ok(), || Finding::new("cylinder_undetermined", at));
    }
}

/// A datum axis needs two sections, and leaves one.
fn check_datum(job: &Job, sections: usize, violations: &mut Violations) {
    let mut datum: Vec<u32> = job.datum_sections.iter().map(|section| section.0).collect();
    if datum.is_empty() {
        violations.require(job.coaxiality_tolerance_um.is_none(), || {
            Finding::new("datum_sections_missing", "/datum_sections").with("sections", sections)
        });
        return;
    }
    datum.sort_unstable();
    datum.dedup();
    let are_there = datum.iter().all(|&section| section as usize <= sections);
    violations.require(are_there && datum.len() >= 2 && datum.len() < sections, || {
        Finding::new("datum_sections_wrong", "/datum_sections").with("sections", sections)
    });
}
