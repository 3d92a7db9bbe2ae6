//! Pictures and tables of the answer.

use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Role, Table};

use super::input::Job;
use super::output::Outcome;

pub(super) const FIGURE_IDS: &[&str] = &["readings"];
pub(super) const TABLE_IDS: &[&str] = &["compliances", "rows"];

/// Codes of titles, axes and legends.
pub(super) const LABEL_CODES: &[&str] = &[
    "gauge_row",
    "gauge_reading",
    "reading_measured",
    "reading_predicted",
    "reading_left",
    "two_gauge_errors",
    "gauge_readings",
];

/// Limits of what a gauge leaves in most rows, in its standard errors.
const TWO: f64 = 2.0;

pub(super) fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
    // Rows are far fewer than 2^53.
    #[allow(clippy::cast_precision_loss)]
    let x: Vec<f64> = outcome.rows.iter().map(|row| row.row as f64).collect();
    let points = |name, y: Vec<f64>, role| Item::Points { name, x: x.clone(), y, role };
    let readings = vec![
        points("reading_predicted", outcome.rows.iter().map(|row| row.predicted_um).collect(), Role::Comparison),
        points("reading_measured", outcome.rows.iter().map(|row| row.reading_um).collect(), Role::After),
    ];
    let ends = [x.first(), x.last()].into_iter().flatten().copied().collect::<Vec<f64>>();
    let limit = TWO * job.gauge_error_um;
    let left = vec![
        Item::Band {
            name: "two_gauge_errors",
            lower: vec![-limit; ends.len()],
            upper: vec![limit; ends.len()],
            x: ends,
            role: Role::Tolerance,
        },
        points("reading_left", outcome.rows.iter().map(|row| row.reading_um - row.predicted_um).collect(), Role::After),
    ];
    let panel = |height, items| Panel { y: Axis::linear("gauge_reading", "um"), height, items };
    vec![Figure {
        id: "readings",
        title: Message::new("gauge_readings"),
        frame: Frame::Stacked,
        x: Axis::linear("gauge_row", "1"),
        panels: vec![panel(2.0, readings), panel(1.0, left)],
    }]
}

pub(super) fn tables(outcome: &Outcome) -> Vec<Table> {
    let found = &outcome.compliances;
    let numbers = |name, unit, of: &dyn Fn(usize) -> f64| {
        Column::numbers(name, unit, &(0..found.len()).map(of).collect::<Vec<_>>())
    };
    let rows = |name, unit, of: &dyn Fn(usize) -> f64| {
        Column::numbers(name, unit, &(0..outcome.rows.len()).map(of).collect::<Vec<_>>())
    };
    vec![
        Table {
            id: "compliances",
            columns: vec![
                Column::words("of", found.iter().map(|one| one.of.name().into()).collect()),
                Column::words("unit", found.iter().map(|one| one.of.unit().into()).collect()),
                numbers("value", "1", &|i| found[i].value),
                numbers("standard_uncertainty", "1", &|i| found[i].standard_uncertainty),
                numbers("lower", "1", &|i| found[i].lower),
                numbers("upper", "1", &|i| found[i].upper),
            ],
        },
        Table {
            id: "rows",
            columns: vec![
                // Rows are far fewer than 2^53.
                #[allow(clippy::cast_precision_loss)]
                rows("row", "1", &|i| outcome.rows[i].row as f64),
                rows("reading", "um", &|i| outcome.rows[i].reading_um),
                rows("predicted", "um", &|i| outcome.rows[i].predicted_um),
                rows("bending", "um", &|i| outcome.rows[i].bending_um),
                rows("residual", "1", &|i| outcome.rows[i].residual),
            ],
        },
    ]
}
