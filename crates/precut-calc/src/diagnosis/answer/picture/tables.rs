//! Tables of a diagnosis.

use std::borrow::Cow;

use crate::calculator::{Column, Table};
use crate::diagnosis::answer::classes::ClassReport;
use crate::diagnosis::answer::output::{DiagnosisResult, NamedCause, ParameterReport, SetReport};

pub(in crate::diagnosis) const TABLE_IDS: &[&str] = &["rows", "sets", "causes", "parameters", "next_runs", "classes"];

pub(in crate::diagnosis) fn tables<E: utoipa::ToSchema, R: utoipa::ToSchema>(
    output: &DiagnosisResult<E, R>,
) -> Vec<Table> {
    let rows = &output.rows;
    let whole = |values: &[u32]| values.iter().map(|v| f64::from(*v)).collect::<Vec<f64>>();
    let words = |values: Vec<String>| values.into_iter().map(Cow::Owned).collect::<Vec<_>>();
    let set_name = |set: &SetReport| {
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
                Column::optional("extended_deviation", "1", &rows.extended_deviation),
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
        parameters(output),
        next_runs(output),
        classes(output),
    ]
}

/// Rows that are classes: what each model says of them.
fn classes<E: utoipa::ToSchema, R: utoipa::ToSchema>(output: &DiagnosisResult<E, R>) -> Table {
    let none = ClassReport::default();
    let (classes, count) = output.classes.as_ref().map_or((&none, 0), |classes| (classes, output.rows.row.len()));
    let words = |of: &[String]| of.iter().map(|word| Cow::Owned(word.clone())).collect::<Vec<_>>();
    let numbers = |of: &[u32]| of.iter().take(count).map(|v| f64::from(*v)).collect::<Vec<f64>>();
    let margins = |of: &[Option<f64>]| of.iter().take(count).copied().collect::<Vec<_>>();
    Table {
        id: "classes",
        columns: vec![
            Column::numbers("row", "1", &numbers(&output.rows.row)),
            Column::numbers("run", "1", &numbers(&output.rows.run)),
            Column::words("class", words(&classes.class)),
            Column::words("margin", words(&classes.margin)),
            Column::numbers("spindle_speed_rpm", "rev/min", &classes.spindle_speed_rpm),
            Column::numbers("depth_mm", "mm", &classes.depth_mm),
            Column::optional("margin_base", "1", &margins(&output.rows.base)),
            Column::optional("margin_extended", "1", &margins(&output.rows.extended)),
            Column::optional("probability_base", "1", &classes.probability_base),
            Column::optional("probability_extended", "1", &classes.probability_extended),
        ],
    }
}

/// Fitted and stated values of the causes named, or of the sets that cannot be told apart.
fn parameters<E: utoipa::ToSchema, R: utoipa::ToSchema>(output: &DiagnosisResult<E, R>) -> Table {
    let of_set = |rank: usize, causes: &[NamedCause]| -> Vec<(f64, NamedCause, ParameterReport)> {
        let each = causes.iter().flat_map(|cause| cause.parameters.iter().map(move |own| (cause, own)));
        each.map(|(cause, own)| (rank as f64, cause.clone(), own.clone())).collect()
    };
    let mut all = of_set(1, &output.named);
    for (index, set) in output.likely_sets.iter().enumerate() {
        all.extend(of_set(index + 1, &set.causes));
    }
    let words = |of: &dyn Fn(&NamedCause, &ParameterReport) -> String| -> Vec<Cow<'static, str>> {
        all.iter().map(|(_, cause, own)| Cow::Owned(of(cause, own))).collect()
    };
    let end = |which: usize| -> Vec<Option<f64>> {
        all.iter().map(|(_, _, own)| own.interval_95.map(|ends| ends[which])).collect()
    };
    Table {
        id: "parameters",
        columns: vec![
            Column::numbers("set", "1", &all.iter().map(|(rank, ..)| *rank).collect::<Vec<_>>()),
            Column::words("kind", words(&|cause, _| cause.kind.clone())),
            Column::words("label", words(&|cause, _| cause.label.clone())),
            Column::words("parameter", words(&|_, own| own.name.clone())),
            Column::words("unit", words(&|_, own| own.unit.clone())),
            Column::numbers("value", "1", &all.iter().map(|(_, _, own)| own.value).collect::<Vec<_>>()),
            Column::optional(
                "standard_deviation",
                "1",
                &all.iter().map(|(_, _, own)| own.standard_deviation).collect::<Vec<_>>(),
            ),
            Column::optional("lower_95", "1", &end(0)),
            Column::optional("upper_95", "1", &end(1)),
            Column::words("interval_from", words(&|_, own| own.interval_from.clone().unwrap_or_default())),
        ],
    }
}

/// Every run that could be measured next.
fn next_runs<E: utoipa::ToSchema, R: utoipa::ToSchema>(output: &DiagnosisResult<E, R>) -> Table {
    let candidates = output.next_measurement.as_ref().map_or(&[][..], |next| &next.candidates);
    let numbers = |of: &dyn Fn(usize) -> f64| (0..candidates.len()).map(of).collect::<Vec<f64>>();
    let changes = candidates.iter().map(|candidate| Cow::Owned(candidate.changes.clone()));
    Table {
        id: "next_runs",
        columns: vec![
            Column::numbers("number", "1", &numbers(&|index| index as f64 + 1.0)),
            Column::words("changes", changes.collect()),
            Column::numbers("separation_sigmas", "1", &numbers(&|index| candidates[index].separation_sigmas)),
            Column::numbers("bayes_factor", "1", &numbers(&|index| candidates[index].bayes_factor)),
        ],
    }
}
