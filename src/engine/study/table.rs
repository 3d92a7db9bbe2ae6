//! A study as tables.

use std::borrow::Cow;

use precut_calc::calculator::{Cells, Column, Table};

use super::label::column;
use super::result::{Extreme, Setting, StudyResult};
use crate::registry::interned;

/// `id`s of the tables.
pub(crate) const TABLES: &[&str] = &["points", "extremes"];

/// The tables of a study; the first has a line for each point.
pub(super) fn tables(result: &StudyResult) -> Vec<Table> {
    vec![points(result), extremes(result)]
}

fn points(result: &StudyResult) -> Table {
    let rows = &result.rows;
    let mut columns = Vec::new();
    for (index, variable) in result.variables.iter().enumerate() {
        let values = rows.iter().map(|row| row.values.get(index));
        let name = column(&variable.pointer, variable.unit.as_deref());
        let is_number = variable.values.iter().all(|value| value.number().is_some());
        columns.push(if is_number {
            numbers(name, variable.unit.as_deref(), values.map(|value| value.and_then(Setting::number)).collect())
        } else {
            words(name, values.map(|value| value.map(ToString::to_string).unwrap_or_default()).collect())
        });
    }
    columns.push(words("status", rows.iter().map(|row| row.status.name().to_owned()).collect()));
    columns.push(words("code", rows.iter().map(|row| row.code.clone().unwrap_or_default()).collect()));
    columns.push(words("detail", rows.iter().map(|row| row.detail.clone().unwrap_or_default()).collect()));
    for (index, output) in result.outputs.iter().enumerate() {
        let values = rows.iter().map(|row| row.outputs.get(index).copied().flatten()).collect();
        columns.push(numbers(column(&output.pointer, output.unit.as_deref()), output.unit.as_deref(), values));
    }
    columns.push(words("key", rows.iter().map(|row| row.key.clone().unwrap_or_default()).collect()));
    Table { id: "points", columns }
}

fn extremes(result: &StudyResult) -> Table {
    let each = |take: fn(&Extreme) -> f64, which: fn(&super::result::OutputField) -> &Option<Extreme>| {
        result.outputs.iter().map(|output| which(output).as_ref().map(take)).collect::<Vec<_>>()
    };
    let row = |extreme: &Extreme| extreme.row as f64;
    let mut columns = vec![
        words("output", result.outputs.iter().map(|output| output.pointer.clone()).collect()),
        words("unit", result.outputs.iter().map(|output| output.unit.clone().unwrap_or_default()).collect()),
        numbers("least", None, each(|extreme| extreme.value, |output| &output.least)),
        numbers("least_row", None, each(row, |output| &output.least)),
        numbers("largest", None, each(|extreme| extreme.value, |output| &output.largest)),
        numbers("largest_row", None, each(row, |output| &output.largest)),
    ];
    for (index, variable) in result.variables.iter().enumerate() {
        let unit = variable.unit.as_deref();
        for which in ["least", "largest"] {
            let at: Vec<Option<&Setting>> = result
                .outputs
                .iter()
                .map(|output| if which == "least" { &output.least } else { &output.largest })
                .map(|extreme| extreme.as_ref()?.at.get(index))
                .collect();
            let name = format!("{which}_at.{}", column(&variable.pointer, unit));
            columns.push(if variable.values.iter().all(|value| value.number().is_some()) {
                numbers(name, unit, at.into_iter().map(|setting| setting?.number()).collect())
            } else {
                words(
                    name,
                    at.into_iter().map(|setting| setting.map(ToString::to_string).unwrap_or_default()).collect(),
                )
            });
        }
    }
    Table { id: "extremes", columns }
}

fn numbers(name: impl Into<Cow<'static, str>>, unit: Option<&str>, cells: Vec<Option<f64>>) -> Column {
    Column { name: name.into(), unit: unit.map_or("", interned), cells: Cells::Numbers(cells) }
}

fn words(name: impl Into<Cow<'static, str>>, cells: Vec<String>) -> Column {
    Column { name: name.into(), unit: "", cells: Cells::Words(cells.into_iter().map(Cow::Owned).collect()) }
}
