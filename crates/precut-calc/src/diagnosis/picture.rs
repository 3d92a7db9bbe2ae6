//! Pictures and tables of a diagnosis.

use std::borrow::Cow;

use super::output::DiagnosisResult;
use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Role, Table};

pub(super) const FIGURE_IDS: &[&str] = &["residuals", "evidence"];
pub(super) const TABLE_IDS: &[&str] = &["rows", "sets", "causes"];
pub(super) const LABEL_CODES: &[&str] = &[
    "diagnosis_residuals",
    "diagnosis_evidence",
    "diagnosis_row",
    "diagnosis_residual",
    "diagnosis_base_residual",
    "diagnosis_extended_residual",
    "diagnosis_scatter",
    "diagnosis_cause_rank",
    "diagnosis_probability",
];

pub(super) fn figures<E: utoipa::ToSchema, R: utoipa::ToSchema>(
    quantity: &str,
    output: &DiagnosisResult<E, R>,
) -> Vec<Figure> {
    let unit = unit_of(quantity);
    vec![
        Figure {
            id: "residuals",
            title: Message::new("diagnosis_residuals"),
            frame: Frame::Stacked,
            x: Axis::linear("diagnosis_row", "1"),
            panels: vec![residuals(output, unit)],
        },
        Figure {
            id: "evidence",
            title: Message::new("diagnosis_evidence"),
            frame: Frame::Stacked,
            x: Axis::linear("diagnosis_cause_rank", "1"),
            panels: vec![evidence(output)],
        },
    ]
}

fn unit_of(quantity: &str) -> &'static str {
    match quantity.rsplit_once('_').map(|(_, suffix)| suffix) {
        Some("um") => "um",
        Some("mm") => "mm",
        Some("n") => "N",
        _ => "1",
    }
}

fn residuals<E: utoipa::ToSchema, R: utoipa::ToSchema>(output: &DiagnosisResult<E, R>, unit: &'static str) -> Panel {
    let rows = &output.rows;
    let x: Vec<f64> = rows.row.iter().map(|row| f64::from(*row)).collect();
    let (mut at, mut before, mut after) = (Vec::new(), Vec::new(), Vec::new());
    for (index, &row) in x.iter().enumerate() {
        if let (Some(base), Some(extended)) = (rows.base[index], rows.extended[index]) {
            at.push(row);
            before.push(rows.measured[index] - base);
            after.push(rows.measured[index] - extended);
        }
    }
    let sigma = output.noise.standard_deviation;
    let ends: Vec<f64> = x.first().copied().into_iter().chain(x.last().copied()).collect();
    let band = |value: f64| vec![value; ends.len()];
    let items = vec![
        Item::Band {
            name: "diagnosis_scatter",
            lower: band(-2.0 * sigma),
            upper: band(2.0 * sigma),
            x: ends.clone(),
            role: Role::Uncertainty,
        },
        Item::Points { name: "diagnosis_base_residual", x: at.clone(), y: before, role: Role::Before },
        Item::Points { name: "diagnosis_extended_residual", x: at, y: after, role: Role::After },
    ];
    Panel { y: Axis::linear("diagnosis_residual", unit), height: 1.0, items }
}

fn evidence<E: utoipa::ToSchema, R: utoipa::ToSchema>(output: &DiagnosisResult<E, R>) -> Panel {
    let x: Vec<f64> = (1..=output.causes.len()).map(|rank| rank as f64).collect();
    let y = output.causes.iter().map(|cause| Some(cause.probability)).collect();
    let bars = Item::Bars { name: "diagnosis_probability", x, y, role: Role::After };
    Panel { y: Axis::linear("diagnosis_probability", "1"), height: 1.0, items: vec![bars] }
}

pub(super) fn tables<E: utoipa::ToSchema, R: utoipa::ToSchema>(output: &DiagnosisResult<E, R>) -> Vec<Table> {
    let rows = &output.rows;
    let whole = |values: &[u32]| values.iter().map(|v| f64::from(*v)).collect::<Vec<f64>>();
    let words = |values: Vec<String>| values.into_iter().map(Cow::Owned).collect::<Vec<_>>();
    let set_name = |set: &super::output::SetReport| {
        let kinds: Vec<&str> = set.causes.iter().map(|cause| cause.kind.as_str()).collect();
        kinds.join(" + ")
    };
    let truth = |value: &bool| f64::from(u8::from(*value));
    vec![
        Table {
            id: "rows",
            columns: vec![
                Column::numbers("row", "1", &whole(&rows.row)),
                Column::numbers("run", "1", &whole(&rows.run)),
                Column::optional("place", "1", &rows.place),
                Column::numbers("measured", "1", &rows.measured),
                Column::optional("base", "1", &rows.base),
                Column::optional("extended", "1", &rows.extended),
                Column::numbers("used", "1", &rows.used.iter().map(truth).collect::<Vec<_>>()),
            ],
        },
        Table {
            id: "sets",
            columns: vec![
                Column::words("causes", words(output.sets.iter().map(set_name).collect())),
                Column::numbers("posterior", "1", &output.sets.iter().map(|set| set.posterior).collect::<Vec<_>>()),
                Column::numbers(
                    "with_remainder",
                    "1",
                    &output.sets.iter().map(|set| truth(&set.with_remainder)).collect::<Vec<_>>(),
                ),
            ],
        },
        Table {
            id: "causes",
            columns: vec![
                Column::words("kind", words(output.causes.iter().map(|cause| cause.kind.clone()).collect())),
                Column::numbers(
                    "probability",
                    "1",
                    &output.causes.iter().map(|cause| cause.probability).collect::<Vec<_>>(),
                ),
            ],
        },
    ]
}
