//! What the numbers say, where they come from, and what of the drawing is kept: codes with numbers.

use crate::calculator::{Finding, Message};
use crate::ring_roundness::evaluation::RoundnessFilter;
use crate::ring_roundness::evaluation::advice::unlike_nominal;

use super::input::Job;
use super::output::{CylinderRequirement, CylinderVerdict, Outcome, PartKind, RequirementKind};
use super::sections::Table;

/// Codes of the explanations made here.
pub(super) const EXPLANATION_CODES: &[&str] = &[
    "cylindricity_is",
    "cylindricity_from",
    "taper_is",
    "axis_is",
    "coaxiality_is",
    "requirement_kept",
    "between_sections_unknown",
    "repaired_in_reading",
];

/// Codes of the warnings made here.
pub(super) const WARNING_CODES: &[&str] = &[
    "requirement_exceeded",
    "requirement_undecided",
    "cylinder_not_proven",
    "section_filter_not_applied",
    "two_sections_only",
    "radius_unlike_nominal",
];

/// A part that takes less than this of the cylindricity with it explains nothing.
const WORTH_SAYING: f64 = 0.1;
/// A cylinder is proven where no other can be better by more than this share of its deviation.
const PROVEN: f64 = 0.01;

pub(super) fn warnings(job: &Job, outcome: &Outcome) -> Vec<Finding> {
    let mut found: Vec<Finding> = outcome
        .requirements
        .iter()
        .filter_map(|asked| {
            let code = match asked.verdict {
                CylinderVerdict::Kept => return None,
                CylinderVerdict::Exceeded => "requirement_exceeded",
                CylinderVerdict::Undecided => "requirement_undecided",
            };
            let finding = Finding::new(code, pointer(asked.of))
                .measured(asked.value_um, asked.tolerance_um, "um")
                .with("of", asked.of.name())
                .with("error_um", asked.error_um);
            Some(match asked.section {
                Some(section) => finding.with("section", section),
                None => finding,
            })
        })
        .collect();
    let cylinders = [
        ("minimum_zone", &outcome.cylinders.minimum_zone),
        ("maximum_inscribed", &outcome.cylinders.maximum_inscribed),
        ("minimum_circumscribed", &outcome.cylinders.minimum_circumscribed),
    ];
    for (reference, cylinder) in cylinders {
        // Of what was not asked for nobody has to be warned.
        if let Some(proof) = cylinder.proof.filter(|proof| proof.gap_um > PROVEN * cylinder.cylt_um)
            && reference == job.reference.name()
            && proof.gap_um > 1e-3
        {
            found.push(
                Finding::new("cylinder_not_proven", "/reference")
                    .value(proof.gap_um, "um")
                    .with("cylt_um", cylinder.cylt_um)
                    .with("within_mm", proof.within_mm),
            );
        }
    }
    if job.filter != (RoundnessFilter::None {}) && !outcome.data.filter_applied {
        found.push(Finding::new("section_filter_not_applied", "/filter"));
    }
    let table = Table::of(job).first().map_or("", |table| table.name());
    found.extend(unlike_nominal(job.nominal_radius_mm, outcome.cylinders.least_squares.radius_mm, table));
    if outcome.data.sections == 2 {
        found.push(Finding::new("two_sections_only", ""));
    }
    found
}

fn pointer(of: RequirementKind) -> &'static str {
    match of {
        RequirementKind::Cylindricity => "/cylindricity_tolerance_um",
        RequirementKind::Roundness => "/roundness_tolerance_um",
        RequirementKind::Straightness => "/straightness_tolerance_um",
        RequirementKind::Coaxiality => "/coaxiality_tolerance_um",
    }
}

pub(super) fn explanation(job: &Job, outcome: &Outcome) -> Vec<Message> {
    let mut said = vec![
        Message::new("cylindricity_is")
            .with("cylindricity_um", outcome.cylindricity_um)
            .with("reference", job.reference.name())
            .with("length_mm", outcome.data.length_mm)
            .with("sections", outcome.data.sections)
            .with("roundness_um", outcome.roundness_um),
    ];
    said.extend(cylindricity_from(outcome));
    let taper = &outcome.taper;
    said.push(
        Message::new("taper_is")
            .with("diameter_change_um", taper.diameter_change_um)
            .with("barrel_um", taper.barrel_um.unwrap_or(0.0)),
    );
    if outcome.data.sections > 2 {
        said.push(Message::new("axis_is").with("straightness_um", outcome.axis.straightness_um));
    }
    said.extend(outcome.axis.coaxiality_um.map(|um| Message::new("coaxiality_is").with("coaxiality_um", um)));
    said.extend(outcome.requirements.iter().filter_map(kept));
    said.push(Message::new("between_sections_unknown").with("sections", outcome.data.sections));
    said.extend(outcome.data.repairs.iter().map(|repair| {
        Message::new("repaired_in_reading")
            .with("kind", repair.kind.name())
            .with("count", repair.count)
            .with("change_um", repair.change_um)
    }));
    said
}

fn kept(asked: &CylinderRequirement) -> Option<Message> {
    (asked.verdict == CylinderVerdict::Kept).then(|| {
        Message::new("requirement_kept")
            .with("of", asked.of.name())
            .with("value_um", asked.value_um)
            .with("error_um", asked.error_um)
            .with("tolerance_um", asked.tolerance_um)
    })
}

/// The part without which least is left.
fn cylindricity_from(outcome: &Outcome) -> Option<Message> {
    let part = outcome.parts.iter().min_by(|a, b| a.without_um.total_cmp(&b.without_um))?;
    let share = 1.0 - part.without_um / outcome.cylindricity_um;
    // Beside the round-off there is nothing to explain.
    let is_told = outcome.cylindricity_um > 1e-6 && share > WORTH_SAYING;
    let part_name = match part.part {
        PartKind::Barrel if outcome.taper.barrel_um.is_some_and(|um| um < 0.0) => "waist",
        other => other.name(),
    };
    is_told.then(|| {
        Message::new("cylindricity_from")
            .with("part", part_name)
            .with("without_um", part.without_um)
            .with("share", share)
            .with("cylindricity_um", outcome.cylindricity_um)
    })
}
