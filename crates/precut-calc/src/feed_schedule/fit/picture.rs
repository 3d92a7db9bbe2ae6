//! Figures and tables of an answer.

use std::borrow::Cow;

use super::input::FitJob;
use super::output::{FitOutcome, OutputFit};
use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Role, Table};
use crate::num::stats::t_quantile;

pub(super) const FIGURE_IDS: &[&str] = &["predicted_against_measured", "residuals"];
pub(super) const TABLE_IDS: &[&str] = &["trials", "coefficients", "predictions"];

/// Codes that the figures utter.
pub(super) const LABEL_CODES: &[&str] = &[
    "fit_predicted_against_measured",
    "fit_residuals",
    "fit_measured",
    "fit_measured_over_mean",
    "fit_trial_number",
    "fit_perfect",
    "fit_of_all",
    "fit_held_out",
    "fit_outlier_limit",
    "fit_zero",
    "fit_residual_points",
    "fit_predicted_force_z",
    "fit_over_mean_force_z",
    "fit_studentised_force_z",
    "fit_predicted_force_y",
    "fit_over_mean_force_y",
    "fit_studentised_force_y",
    "fit_predicted_tool_life",
    "fit_over_mean_tool_life",
    "fit_studentised_tool_life",
    "fit_predicted_roughness",
    "fit_over_mean_roughness",
    "fit_studentised_roughness",
    "fit_predicted_hardening",
    "fit_over_mean_hardening",
    "fit_studentised_hardening",
    "fit_predicted_hardening_depth",
    "fit_over_mean_hardening_depth",
    "fit_studentised_hardening_depth",
    "fit_predicted_further",
    "fit_over_mean_further",
    "fit_studentised_further",
];

pub(super) fn figures(job: &FitJob, outcome: &FitOutcome) -> Vec<Figure> {
    vec![
        Figure {
            id: "predicted_against_measured",
            title: Message::new("fit_predicted_against_measured"),
            frame: Frame::Stacked,
            x: axis(outcome, "fit_measured", "fit_measured_over_mean"),
            panels: outcome.outputs.iter().map(|output| comparison(outcome, output)).collect(),
        },
        Figure {
            id: "residuals",
            title: Message::new("fit_residuals"),
            frame: Frame::Stacked,
            x: Axis::linear("fit_trial_number", "1"),
            panels: outcome.outputs.iter().map(|output| residuals(job, output)).collect(),
        },
    ]
}

/// One output in its own unit; several relative to their means, since they share the abscissa.
fn axis(outcome: &FitOutcome, own: &'static str, relative: &'static str) -> Axis {
    match outcome.outputs.as_slice() {
        [output] => Axis::linear(own, static_unit(&output.unit)),
        _ => Axis::linear(relative, "1"),
    }
}

/// The unit, of those that the contract has.
fn static_unit(unit: &str) -> &'static str {
    const UNITS: [&str; 14] =
        ["um", "min", "N", "percent", "mm", "um/N", "m/min", "mm/rev", "N/mm2", "N m", "deg", "kW", "Hz", "K"];
    UNITS.into_iter().find(|known| *known == unit).unwrap_or("1")
}

/// Labels that name an output.
struct Labels {
    predicted: &'static str,
    over_mean: &'static str,
    studentised: &'static str,
}

fn labels(output: &OutputFit) -> Labels {
    macro_rules! labels {
        ($name:literal) => {
            Labels {
                predicted: concat!("fit_predicted_", $name),
                over_mean: concat!("fit_over_mean_", $name),
                studentised: concat!("fit_studentised_", $name),
            }
        };
    }
    match output.name.as_str() {
        "force_z" => labels!("force_z"),
        "force_y" => labels!("force_y"),
        "tool_life" => labels!("tool_life"),
        "roughness" => labels!("roughness"),
        "hardening" => labels!("hardening"),
        "hardening_depth" => labels!("hardening_depth"),
        _ => labels!("further"),
    }
}

fn comparison(outcome: &FitOutcome, output: &OutputFit) -> Panel {
    let rows = &output.rows;
    let mean = rows.measured.iter().map(|v| v.abs()).sum::<f64>() / rows.measured.len().max(1) as f64;
    let scale = if outcome.outputs.len() == 1 || mean <= 0.0 { 1.0 } else { 1.0 / mean };
    let scaled = |values: &[f64]| values.iter().map(|v| v * scale).collect::<Vec<f64>>();
    let measured = scaled(&rows.measured);
    let (low, high) = measured.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let seen: Vec<(f64, f64)> =
        measured.iter().zip(&rows.held_out).filter_map(|(m, h)| h.map(|h| (*m, h * scale))).collect();
    Panel {
        y: axis(outcome, labels(output).predicted, labels(output).over_mean),
        height: 1.0,
        items: vec![
            Item::Line { name: "fit_perfect", x: vec![low, high], y: vec![Some(low), Some(high)], role: Role::Nominal },
            Item::Points { name: "fit_of_all", x: measured, y: scaled(&rows.fitted), role: Role::Before },
            Item::Points {
                name: "fit_held_out",
                x: seen.iter().map(|p| p.0).collect(),
                y: seen.iter().map(|p| p.1).collect(),
                role: Role::After,
            },
        ],
    }
}

fn residuals(job: &FitJob, output: &OutputFit) -> Panel {
    let rows = &output.rows;
    let points: Vec<(f64, f64)> =
        rows.row.iter().zip(&rows.studentised).filter_map(|(row, t)| t.map(|t| (*row as f64 + 1.0, t))).collect();
    let ends = vec![1.0, job.trials.rows().len() as f64];
    // The limit that a trial passes once in twenty such tables.
    let degrees = output.degrees_of_freedom as f64 - 1.0;
    let limit = t_quantile(1.0 - 0.025 / rows.row.len().max(1) as f64, degrees);
    let flat = |value: f64, name: &'static str, role: Role| Item::Line {
        name,
        x: ends.clone(),
        y: vec![Some(value); 2],
        role,
    };
    let mut items = vec![flat(0.0, "fit_zero", Role::Nominal)];
    if limit.is_finite() {
        items.push(flat(limit, "fit_outlier_limit", Role::Limit));
        items.push(flat(-limit, "fit_outlier_limit", Role::Limit));
    }
    items.push(Item::Points {
        name: "fit_residual_points",
        x: points.iter().map(|p| p.0).collect(),
        y: points.iter().map(|p| p.1).collect(),
        role: Role::Plain,
    });
    Panel { y: Axis::linear(labels(output).studentised, "1"), height: 1.0, items }
}

pub(super) fn tables(job: &FitJob, outcome: &FitOutcome) -> Vec<Table> {
    vec![trials(job, outcome), coefficients(outcome), predictions(outcome)]
}

fn words(items: impl Iterator<Item = String>) -> Vec<Cow<'static, str>> {
    items.map(Cow::Owned).collect()
}

fn trials(job: &FitJob, outcome: &FitOutcome) -> Table {
    let all = || outcome.outputs.iter().flat_map(|output| (0..output.rows.row.len()).map(move |k| (output, k)));
    let number = |value: fn(&OutputFit, usize) -> Option<f64>| -> Vec<Option<f64>> {
        all().map(|(output, k)| value(output, k)).collect()
    };
    let id = |(output, k): (&OutputFit, usize)| job.trials.rows()[output.rows.row[k]].id.clone().unwrap_or_default();
    Table {
        id: "trials",
        columns: vec![
            Column::words("output", words(all().map(|(output, _)| output.name.clone()))),
            Column::optional("row", "1", &number(|o, k| Some(o.rows.row[k] as f64 + 1.0))),
            Column::words("id", words(all().map(id))),
            Column::words("unit", words(all().map(|(output, _)| output.unit.clone()))),
            Column::optional("measured", "1", &number(|o, k| Some(o.rows.measured[k]))),
            Column::optional("fitted", "1", &number(|o, k| Some(o.rows.fitted[k]))),
            Column::optional("held_out", "1", &number(|o, k| o.rows.held_out[k])),
            Column::optional("studentised", "1", &number(|o, k| o.rows.studentised[k])),
            Column::optional("leverage", "1", &number(|o, k| Some(o.rows.leverage[k]))),
            Column::optional("cooks_distance", "1", &number(|o, k| o.rows.cooks_distance[k])),
            Column::words(
                "outlier",
                words(all().map(|(o, k)| if o.rows.outlier[k] { "yes" } else { "no" }.to_owned())),
            ),
        ],
    }
}

fn coefficients(outcome: &FitOutcome) -> Table {
    let all = || outcome.outputs.iter().flat_map(|output| output.coefficients.iter().map(move |c| (output, c)));
    let column = |value: fn(&super::output::Coefficient) -> Option<f64>| -> Vec<Option<f64>> {
        all().map(|(_, c)| value(c)).collect()
    };
    Table {
        id: "coefficients",
        columns: vec![
            Column::words("output", words(all().map(|(output, _)| output.name.clone()))),
            Column::words("name", words(all().map(|(_, c)| c.name.clone()))),
            Column::optional("value", "1", &column(|c| Some(c.value))),
            Column::optional("standard_error", "1", &column(|c| Some(c.standard_error))),
            Column::optional("lower", "1", &column(|c| Some(c.lower))),
            Column::optional("upper", "1", &column(|c| Some(c.upper))),
            Column::optional("resampled_lower", "1", &column(|c| c.resampled_lower)),
            Column::optional("resampled_upper", "1", &column(|c| c.resampled_upper)),
            Column::optional("p_value", "1", &column(|c| c.p_value)),
            Column::optional("inflation", "1", &column(|c| c.inflation)),
        ],
    }
}

fn predictions(outcome: &FitOutcome) -> Table {
    let all = &outcome.predictions;
    let column = |value: fn(&super::output::Prediction) -> f64| all.iter().map(value).collect::<Vec<f64>>();
    Table {
        id: "predictions",
        columns: vec![
            Column::numbers("place", "1", &column(|p| p.place as f64 + 1.0)),
            Column::words("output", words(all.iter().map(|p| p.output.clone()))),
            Column::numbers("value", "1", &column(|p| p.value)),
            Column::numbers("lower", "1", &column(|p| p.lower)),
            Column::numbers("upper", "1", &column(|p| p.upper)),
            Column::numbers("trial_lower", "1", &column(|p| p.trial_lower)),
            Column::numbers("trial_upper", "1", &column(|p| p.trial_upper)),
            Column::numbers("hull_distance", "1", &column(|p| p.hull_distance)),
        ],
    }
}
