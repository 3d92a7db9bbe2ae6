//! Pictures and tables of the answer.

use std::borrow::Cow;

use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Role, Table};
use crate::ring_roundness::evaluation::ContactKind;

use super::output::{CylinderVerdict, Outcome, ReferenceCylinder};

pub(super) const FIGURE_IDS: &[&str] = &["sections", "surface"];
pub(super) const TABLE_IDS: &[&str] = &["sections", "cylinders", "contacts", "requirements", "parts"];

/// Codes of titles, axes and legends.
pub(super) const LABEL_CODES: &[&str] = &[
    "height",
    "angle",
    "centre_offset",
    "radius_change",
    "roundness_of_section",
    "deviation_from_cylinder",
    "centres_x",
    "centres_y",
    "section_radii",
    "section_roundness",
    "cylinder_sections",
    "cylinder_surface",
];

const UM_PER_MM: f64 = 1e3;

pub(super) fn figures(outcome: &Outcome) -> Vec<Figure> {
    let mut figures = vec![sections(outcome)];
    if outcome.surface.height_mm.len() > 1 {
        figures.push(surface(outcome));
    }
    figures
}

/// Centres, radii and roundness along the axis.
fn sections(outcome: &Outcome) -> Figure {
    let sections = &outcome.sections;
    let heights: Vec<f64> = sections.iter().map(|section| section.height_mm).collect();
    let line =
        |name, y: Vec<f64>, role| Item::Line { name, x: heights.clone(), y: y.into_iter().map(Some).collect(), role };
    let mean_mm = sections.iter().map(|section| section.radius_mm).sum::<f64>() / sections.len() as f64;
    let offs = vec![
        line("centres_x", sections.iter().map(|section| section.off_x_um).collect(), Role::Series(0)),
        line("centres_y", sections.iter().map(|section| section.off_y_um).collect(), Role::Series(1)),
    ];
    let radii = sections.iter().map(|section| UM_PER_MM * (section.radius_mm - mean_mm)).collect();
    let ront = sections.iter().map(|section| Some(section.ront_um)).collect();
    let panel = |label, items| Panel { y: Axis::linear(label, "um"), height: 1.0, items };
    Figure {
        id: "sections",
        title: Message::new("cylinder_sections"),
        frame: Frame::Stacked,
        x: Axis::linear("height", "mm"),
        panels: vec![
            panel("radius_change", vec![line("section_radii", radii, Role::After)]),
            panel("centre_offset", offs),
            panel(
                "roundness_of_section",
                vec![Item::Bars { name: "section_roundness", x: heights.clone(), y: ront, role: Role::Plain }],
            ),
        ],
    }
}

/// The unrolled surface.
fn surface(outcome: &Outcome) -> Figure {
    let surface = &outcome.surface;
    let map = Item::HeatMap {
        value: Axis::linear("deviation_from_cylinder", "um"),
        x: surface.angle_deg.clone(),
        y: surface.height_mm.clone(),
        values: surface.deviation_um.iter().copied().map(Some).collect(),
        diverging: true,
    };
    Figure {
        id: "surface",
        title: Message::new("cylinder_surface"),
        frame: Frame::Stacked,
        x: Axis::linear("angle", "deg"),
        panels: vec![Panel { y: Axis::linear("height", "mm"), height: 1.0, items: vec![map] }],
    }
}

pub(super) fn tables(outcome: &Outcome) -> Vec<Table> {
    vec![
        sections_table(outcome),
        cylinders_table(outcome),
        contacts_table(outcome),
        requirements_table(outcome),
        Table {
            id: "parts",
            columns: vec![
                Column::words("part", outcome.parts.iter().map(|part| Cow::Borrowed(part.part.name())).collect()),
                Column::numbers("without", "um", &outcome.parts.iter().map(|part| part.without_um).collect::<Vec<_>>()),
            ],
        },
    ]
}

fn sections_table(outcome: &Outcome) -> Table {
    let sections = &outcome.sections;
    let numbers = |name, unit, of: &dyn Fn(&super::output::CylinderSection) -> f64| {
        Column::numbers(name, unit, &sections.iter().map(of).collect::<Vec<_>>())
    };
    Table {
        id: "sections",
        columns: vec![
            numbers("height", "mm", &|section| section.height_mm),
            numbers("points", "1", &|section| section.points as f64),
            numbers("radius", "mm", &|section| section.radius_mm),
            numbers("off_x", "um", &|section| section.off_x_um),
            numbers("off_y", "um", &|section| section.off_y_um),
            numbers("ront", "um", &|section| section.ront_um),
            numbers("error", "um", &|section| section.error_um),
            Column::optional(
                "off_datum",
                "um",
                &sections.iter().map(|section| section.off_datum_um).collect::<Vec<_>>(),
            ),
        ],
    }
}

fn named(outcome: &Outcome) -> [(&'static str, &ReferenceCylinder); 4] {
    let cylinders = &outcome.cylinders;
    [
        ("least_squares", &cylinders.least_squares),
        ("minimum_zone", &cylinders.minimum_zone),
        ("maximum_inscribed", &cylinders.maximum_inscribed),
        ("minimum_circumscribed", &cylinders.minimum_circumscribed),
    ]
}

fn cylinders_table(outcome: &Outcome) -> Table {
    let rows = named(outcome);
    let numbers = |name, unit, of: &dyn Fn(&ReferenceCylinder) -> Option<f64>| {
        Column::optional(name, unit, &rows.iter().map(|(_, cylinder)| of(cylinder)).collect::<Vec<_>>())
    };
    Table {
        id: "cylinders",
        columns: vec![
            Column::words("cylinder", rows.iter().map(|row| Cow::Borrowed(row.0)).collect()),
            numbers("centre_x", "mm", &|cylinder| Some(cylinder.centre_x_mm)),
            numbers("centre_y", "mm", &|cylinder| Some(cylinder.centre_y_mm)),
            numbers("slope_x", "um/mm", &|cylinder| Some(cylinder.slope_x_um_per_mm)),
            numbers("slope_y", "um/mm", &|cylinder| Some(cylinder.slope_y_um_per_mm)),
            numbers("radius", "mm", &|cylinder| Some(cylinder.radius_mm)),
            numbers("inner_radius", "mm", &|cylinder| Some(cylinder.inner_radius_mm)),
            numbers("outer_radius", "mm", &|cylinder| Some(cylinder.outer_radius_mm)),
            numbers("cylt", "um", &|cylinder| Some(cylinder.cylt_um)),
            numbers("cylp", "um", &|cylinder| cylinder.cylp_um),
            numbers("cylv", "um", &|cylinder| cylinder.cylv_um),
            numbers("cylq", "um", &|cylinder| cylinder.cylq_um),
            numbers("gap", "um", &|cylinder| cylinder.proof.map(|proof| proof.gap_um)),
            numbers("within", "mm", &|cylinder| cylinder.proof.map(|proof| proof.within_mm)),
        ],
    }
}

fn contacts_table(outcome: &Outcome) -> Table {
    let (mut names, mut kinds): (Vec<Cow<'static, str>>, Vec<Cow<'static, str>>) = (Vec::new(), Vec::new());
    let (mut sections, mut angles) = (Vec::new(), Vec::new());
    for (name, cylinder) in named(outcome) {
        for contact in &cylinder.contacts {
            names.push(name.into());
            kinds.push(
                match contact.kind {
                    ContactKind::Outer => "outer",
                    ContactKind::Inner => "inner",
                    ContactKind::Peak => "peak",
                    ContactKind::Valley => "valley",
                }
                .into(),
            );
            sections.push(contact.section as f64);
            angles.push(contact.angle_deg);
        }
    }
    Table {
        id: "contacts",
        columns: vec![
            Column::words("cylinder", names),
            Column::words("contact", kinds),
            Column::numbers("section", "1", &sections),
            Column::numbers("angle", "deg", &angles),
        ],
    }
}

fn requirements_table(outcome: &Outcome) -> Table {
    let rows = &outcome.requirements;
    let numbers = |name, of: &dyn Fn(&super::output::CylinderRequirement) -> f64| {
        Column::numbers(name, "um", &rows.iter().map(of).collect::<Vec<_>>())
    };
    let verdict = |verdict: CylinderVerdict| match verdict {
        CylinderVerdict::Kept => "kept",
        CylinderVerdict::Exceeded => "exceeded",
        CylinderVerdict::Undecided => "undecided",
    };
    Table {
        id: "requirements",
        columns: vec![
            Column::words("requirement", rows.iter().map(|row| Cow::Borrowed(row.of.name())).collect()),
            Column::optional(
                "section",
                "1",
                &rows.iter().map(|row| row.section.map(|at| at as f64)).collect::<Vec<_>>(),
            ),
            numbers("value", &|row| row.value_um),
            numbers("error", &|row| row.error_um),
            numbers("tolerance", &|row| row.tolerance_um),
            Column::words("verdict", rows.iter().map(|row| Cow::Borrowed(verdict(row.verdict))).collect()),
        ],
    }
}
