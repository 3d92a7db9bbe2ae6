//! Figures and tables of an answer.

use std::borrow::Cow;
use std::collections::BTreeSet;

use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Role, Table, Value};

use super::input::{IdentificationJob, OpenedJoint};
use super::output::{HypothesisFit, IdentificationOutcome, IdentifiedRow};
use super::report::Tried;

pub(super) const FIGURE_IDS: &[&str] = &["amplitude", "ratio"];
pub(super) const TABLE_IDS: &[&str] = &["rows", "parameters", "onsets", "laws"];

/// Codes that the figures utter.
pub(super) const LABEL_CODES: &[&str] = &[
    "depth_of_cut",
    "amplitude_of_table",
    "simulated_over_measured",
    "table_measured",
    "table_simulated",
    "table_other_law",
    "table_opened",
    "table_exact",
    "identification_amplitude",
    "identification_ratio",
    "table_measured_1",
    "table_measured_2",
    "table_measured_3",
    "table_measured_4",
    "table_measured_5",
    "table_measured_6",
    "table_measured_7",
    "table_measured_8",
    "table_simulated_1",
    "table_simulated_2",
    "table_simulated_3",
    "table_simulated_4",
    "table_simulated_5",
    "table_simulated_6",
    "table_simulated_7",
    "table_simulated_8",
    "table_other_law_1",
    "table_other_law_2",
    "table_other_law_3",
    "table_other_law_4",
    "table_other_law_5",
    "table_other_law_6",
    "table_other_law_7",
    "table_other_law_8",
];

/// What curves and points of a family of rows are called: by number, what the number means stands in the title's values.
/// Families beyond these share one name.
const MEASURED: [&str; FAMILIES] = [
    "table_measured_1",
    "table_measured_2",
    "table_measured_3",
    "table_measured_4",
    "table_measured_5",
    "table_measured_6",
    "table_measured_7",
    "table_measured_8",
];
const SIMULATED: [&str; FAMILIES] = [
    "table_simulated_1",
    "table_simulated_2",
    "table_simulated_3",
    "table_simulated_4",
    "table_simulated_5",
    "table_simulated_6",
    "table_simulated_7",
    "table_simulated_8",
];
const OTHER_LAW: [&str; FAMILIES] = [
    "table_other_law_1",
    "table_other_law_2",
    "table_other_law_3",
    "table_other_law_4",
    "table_other_law_5",
    "table_other_law_6",
    "table_other_law_7",
    "table_other_law_8",
];
const FAMILIES: usize = 8;

const DEPTH: Axis = Axis::linear("depth_of_cut", "mm");

/// Rows by number of teeth, speed and feed, each by depth.
fn families(rows: &[IdentifiedRow]) -> Vec<Vec<&IdentifiedRow>> {
    let mut families: Vec<Vec<&IdentifiedRow>> = Vec::new();
    for row in rows {
        let same = |other: &IdentifiedRow| {
            other.teeth == row.teeth
                && other.spindle_speed_rpm.to_bits() == row.spindle_speed_rpm.to_bits()
                && other.feed_mm_per_tooth.to_bits() == row.feed_mm_per_tooth.to_bits()
        };
        match families.iter_mut().find(|family| family.first().is_some_and(|first| same(first))) {
            Some(family) => family.push(row),
            None => families.push(vec![row]),
        }
    }
    for family in &mut families {
        family.sort_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm));
    }
    families
}

fn series(number: usize) -> Role {
    Role::Series(u8::try_from(number % 8).unwrap_or(0))
}

/// A field of the contract that is set, as names in pictures are given: the reader's language has its label.
fn set(field: &'static str, value: impl Into<Value>, unit: &'static str) -> Value {
    Value::List(vec![field.into(), value.into(), unit.into()])
}

type Field = (&'static str, fn(&IdentifiedRow) -> f64, &'static str);

/// What tells every family from the others: of teeth, speed and feed as many as it takes; nothing of a single family.
fn told_by(families: &[Vec<&IdentifiedRow>]) -> Vec<Vec<Value>> {
    let fields: [Field; 3] = [
        ("teeth", |row| f64::from(row.teeth), "1"),
        ("spindle_speed_rpm", |row| row.spindle_speed_rpm, "rev/min"),
        ("feed_mm_per_tooth", |row| row.feed_mm_per_tooth, "mm/tooth"),
    ];
    let firsts: Vec<&IdentifiedRow> = families.iter().filter_map(|family| family.first().copied()).collect();
    let kinds = |of: &[Field]| -> usize {
        let bits = |row: &&IdentifiedRow| of.iter().map(|(_, of, _)| of(row).to_bits()).collect::<Vec<u64>>();
        firsts.iter().map(bits).collect::<BTreeSet<_>>().len()
    };
    let mut telling: Vec<Field> = Vec::new();
    for field in fields {
        if kinds(&telling) < firsts.len() && kinds(&[field]) > 1 {
            telling.push(field);
        }
    }
    let told = |row: &IdentifiedRow| telling.iter().map(|&(field, of, unit)| set(field, of(row), unit)).collect();
    firsts.into_iter().map(told).collect()
}

/// What tells a law from the one that fits best.
fn law_told_by(outcome: &IdentificationOutcome, other: &HypothesisFit) -> Vec<Value> {
    let regeneration =
        (other.regeneration != outcome.regeneration).then(|| set("regeneration", other.regeneration.name(), "1"));
    let amplitude = (other.amplitude != outcome.amplitude).then(|| set("amplitude", other.amplitude.name(), "1"));
    regeneration.into_iter().chain(amplitude).collect()
}

/// The name of a family's item, and what it means put into the title.
fn named(
    title: &mut Message,
    (alone, names): (&'static str, &[&'static str; FAMILIES]),
    number: usize,
    what: Vec<Value>,
    told: &[Value],
) -> &'static str {
    let Some(name) = names.get(number).copied().filter(|_| !told.is_empty()) else { return alone };
    title.values = std::mem::take(&mut title.values).with(name, [what, told.to_vec()].concat());
    name
}

/// The amplitudes, and of rows that were measured the ratios.
pub(super) fn figures(_job: &IdentificationJob, outcome: &IdentificationOutcome) -> Vec<Figure> {
    let families = families(&outcome.rows);
    let told = told_by(&families);
    let (mut amplitude, mut ratio) = (Message::new("identification_amplitude"), Message::new("identification_ratio"));
    let (mut amplitudes, mut ratios) = (Vec::new(), Vec::new());
    let other = outcome.hypotheses.get(1);
    for (number, (family, told)) in families.iter().zip(&told).enumerate() {
        let x: Vec<f64> = family.iter().map(|row| row.depth_mm).collect();
        if let Some(other) = other {
            let law = law_told_by(outcome, other);
            let name = named(&mut amplitude, ("table_other_law", &OTHER_LAW), number, law, told);
            let y = family.iter().map(|row| other.simulated_um.get(row.row - 1).copied()).collect();
            amplitudes.push(Item::Line { name, x: x.clone(), y, role: Role::Comparison });
        }
        let what = vec!["simulated_um".into()];
        let name = named(&mut amplitude, ("table_simulated", &SIMULATED), number, what, told);
        let y = family.iter().map(|row| Some(row.simulated_um)).collect();
        amplitudes.push(Item::Line { name, x, y, role: series(number) });
        let measured: Vec<&&IdentifiedRow> = family.iter().filter(|row| row.measured_um.is_some()).collect();
        if measured.is_empty() {
            continue;
        }
        let depths: Vec<f64> = measured.iter().map(|row| row.depth_mm).collect();
        let what = vec!["measured_um".into()];
        amplitudes.push(Item::Points {
            name: named(&mut amplitude, ("table_measured", &MEASURED), number, what, told),
            x: depths.clone(),
            y: measured.iter().map(|row| row.measured_um.unwrap_or(0.0)).collect(),
            role: series(number),
        });
        ratios.push(Item::Points {
            name: named(&mut ratio, ("simulated_over_measured", &SIMULATED), number, Vec::new(), told),
            x: depths,
            y: measured.iter().map(|row| row.ratio.unwrap_or(1.0)).collect(),
            role: series(number),
        });
    }
    let opened: Vec<&IdentifiedRow> = outcome.rows.iter().filter(|row| row.opened.is_some()).collect();
    if !opened.is_empty() {
        amplitudes.push(Item::Points {
            name: "table_opened",
            x: opened.iter().map(|row| row.depth_mm).collect(),
            y: opened.iter().map(|row| row.simulated_um).collect(),
            role: Role::Unstable,
        });
    }
    let mut figures = vec![figure("amplitude", amplitude, Axis::logarithmic("amplitude_of_table", "um"), amplitudes)];
    if !ratios.is_empty() {
        let depths = || outcome.rows.iter().map(|row| row.depth_mm);
        let ends = vec![depths().fold(f64::INFINITY, f64::min), depths().fold(0.0, f64::max)];
        ratios.push(Item::Line { name: "table_exact", y: vec![Some(1.0); 2], x: ends, role: Role::Nominal });
        figures.push(figure("ratio", ratio, Axis::logarithmic("simulated_over_measured", "1"), ratios));
    }
    figures
}

fn figure(id: &'static str, title: Message, y: Axis, items: Vec<Item>) -> Figure {
    Figure { id, title, frame: Frame::Stacked, x: DEPTH, panels: vec![Panel { y, height: 1.0, items }] }
}

/// Measured amplitudes and those of the laws searched so far.
pub(super) fn so_far(job: &IdentificationJob, tried: &[Tried]) -> Figure {
    let rows = job.measurements.rows();
    let mut items: Vec<Item> = tried
        .iter()
        .enumerate()
        .map(|(number, one)| Item::Points {
            name: "table_simulated",
            x: rows.iter().map(|row| row.depth_mm).collect(),
            y: one.fine.iter().map(|row| 1e3 * row.amplitude_mm).collect(),
            role: series(number),
        })
        .collect();
    let measured = || rows.iter().filter_map(|row| row.amplitude_um.map(|amplitude| (row.depth_mm, amplitude)));
    items.push(Item::Points {
        name: "table_measured",
        x: measured().map(|(depth, _)| depth).collect(),
        y: measured().map(|(_, amplitude)| amplitude).collect(),
        role: Role::Plain,
    });
    figure("amplitude", Message::new("identification_amplitude"), Axis::logarithmic("amplitude_of_table", "um"), items)
}

pub(super) fn tables(outcome: &IdentificationOutcome) -> Vec<Table> {
    vec![rows(outcome), parameters(outcome), onsets(outcome), laws(outcome)]
}

fn words(items: impl Iterator<Item = String>) -> Vec<Cow<'static, str>> {
    items.map(Cow::Owned).collect()
}

fn rows(outcome: &IdentificationOutcome) -> Table {
    let all = &outcome.rows;
    let numbers = |of: fn(&IdentifiedRow) -> f64| all.iter().map(of).collect::<Vec<f64>>();
    let optional = |of: fn(&IdentifiedRow) -> Option<f64>| all.iter().map(of).collect::<Vec<Option<f64>>>();
    let opened = |row: &IdentifiedRow| {
        match row.opened {
            Some(OpenedJoint::Movable) => "movable",
            Some(OpenedJoint::Fixed) => "fixed",
            Some(OpenedJoint::Either) => "either",
            None => "",
        }
        .to_owned()
    };
    Table {
        id: "rows",
        columns: vec![
            Column::numbers("row", "1", &numbers(|row| row.row as f64)),
            Column::numbers("teeth", "1", &numbers(|row| f64::from(row.teeth))),
            Column::numbers("spindle_speed", "rev/min", &numbers(|row| row.spindle_speed_rpm)),
            Column::numbers("feed_per_tooth", "mm/tooth", &numbers(|row| row.feed_mm_per_tooth)),
            Column::numbers("depth", "mm", &numbers(|row| row.depth_mm)),
            Column::optional("measured", "um", &optional(|row| row.measured_um)),
            Column::words("opened", words(all.iter().map(opened))),
            Column::words("used", words(all.iter().map(|row| if row.used { "yes" } else { "no" }.to_owned()))),
            Column::numbers("simulated", "um", &numbers(|row| row.simulated_um)),
            Column::numbers("simulated_error", "um", &numbers(|row| row.simulated_error_um)),
            Column::optional("ratio", "1", &optional(|row| row.ratio)),
            Column::optional("residual", "1", &optional(|row| row.residual)),
            Column::numbers("modulus", "1", &numbers(|row| row.modulus)),
            Column::numbers("clamp_movable", "N", &numbers(|row| row.clamp_movable_n)),
            Column::numbers("clamp_fixed", "N", &numbers(|row| row.clamp_fixed_n)),
        ],
    }
}

fn parameters(outcome: &IdentificationOutcome) -> Table {
    let all = &outcome.parameters;
    Table {
        id: "parameters",
        columns: vec![
            Column::words("name", words(all.iter().map(|p| p.name.clone()))),
            Column::words("unit", words(all.iter().map(|p| p.unit.clone()))),
            Column::numbers("value", "1", &all.iter().map(|p| p.value).collect::<Vec<_>>()),
            Column::optional("standard_error", "1", &all.iter().map(|p| p.standard_error).collect::<Vec<_>>()),
            Column::numbers("lower", "1", &all.iter().map(|p| p.lower).collect::<Vec<_>>()),
            Column::numbers("upper", "1", &all.iter().map(|p| p.upper).collect::<Vec<_>>()),
        ],
    }
}

fn onsets(outcome: &IdentificationOutcome) -> Table {
    let all = &outcome.onsets;
    Table {
        id: "onsets",
        columns: vec![
            Column::numbers("teeth", "1", &all.iter().map(|o| f64::from(o.teeth)).collect::<Vec<_>>()),
            Column::numbers("spindle_speed", "rev/min", &all.iter().map(|o| o.spindle_speed_rpm).collect::<Vec<_>>()),
            Column::numbers("feed_per_tooth", "mm/tooth", &all.iter().map(|o| o.feed_mm_per_tooth).collect::<Vec<_>>()),
            Column::optional("table_stable", "mm", &all.iter().map(|o| o.table_stable_mm).collect::<Vec<_>>()),
            Column::optional("table_chatter", "mm", &all.iter().map(|o| o.table_chatter_mm).collect::<Vec<_>>()),
            Column::optional("predicted", "mm", &all.iter().map(|o| o.predicted_mm).collect::<Vec<_>>()),
        ],
    }
}

fn laws(outcome: &IdentificationOutcome) -> Table {
    let all = &outcome.hypotheses;
    Table {
        id: "laws",
        columns: vec![
            Column::words("regeneration", words(all.iter().map(|h| h.regeneration.name().to_owned()))),
            Column::words("amplitude", words(all.iter().map(|h| h.amplitude.name().to_owned()))),
            Column::numbers("objective", "1", &all.iter().map(|h| h.fit.objective).collect::<Vec<_>>()),
            Column::numbers("worse_by", "1", &all.iter().map(|h| h.worse_by).collect::<Vec<_>>()),
            Column::numbers("rms_log", "1", &all.iter().map(|h| h.fit.rms_log).collect::<Vec<_>>()),
            Column::numbers("median_log", "1", &all.iter().map(|h| h.fit.median_log).collect::<Vec<_>>()),
            Column::numbers("worst_log", "1", &all.iter().map(|h| h.fit.worst_log).collect::<Vec<_>>()),
        ],
    }
}
