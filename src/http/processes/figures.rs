//! Pictures of a process: the control chart, what its paths brought, its model over the parts, and what is expected of the next part.

use std::collections::BTreeMap;

use axum::Extension;
use axum::extract::{Path, State};
use axum::http::HeaderMap;
use axum::response::Response;
use precut_calc::calculator::{Axis, Figure, Frame, Item, Message, Panel, Role};
use serde::Deserialize;
use serde_json::{Value, json};

use super::super::App;
use super::super::auth::Caller;
use super::super::negotiate;
use super::super::parts::worded;
use super::super::problem::Problem;
use super::answered;
use crate::engine::{KeptProcess, Shelf};
use crate::store::processes::KeptPart;

/// Their names.
pub(in crate::http) const FIGURES: &[&str] = &["chart", "gain", "model", "next"];
/// Parts that are read at once.
const PAGE: u32 = 1000;
/// A chart shows no more of the last parts.
const MOST_SHOWN: usize = 2000;
/// A normal number lies within so many standard deviations in 95 %.
const NORMAL_95: f64 = 1.96;

/// `GET /v1/processes/{name}/figures`
pub(super) async fn list(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let language = negotiate::language(&headers);
    let process = app.engine.process(&caller.shelf(), &name).await?;
    let figures = all(&app, &caller.shelf(), &process).await?;
    let items: Vec<Value> = figures.iter().map(|figure| worded(figure, language)).collect();
    Ok(answered(&json!({ "items": items }), language))
}

/// All that there is to draw of a process.
pub(super) async fn all(app: &App, shelf: &Shelf, process: &KeptProcess) -> Result<Vec<Figure>, Problem> {
    let (mut parts, mut from) = (Vec::new(), 0);
    loop {
        let page = app.engine.process_parts(shelf, &process.name, (from, i64::MAX), PAGE).await?;
        let Some(last) = page.last().and_then(|part| part.number) else { break };
        from = last + 1;
        parts.extend(page);
        let excess = parts.len().saturating_sub(MOST_SHOWN);
        parts.drain(..excess);
    }
    let state = process.state.clone().unwrap_or_default();
    let next = parts.last().and_then(|last| next(&state, last, &process.document));
    let sizes = app.engine.process_sizes(&process.document);
    let model = model(&parts, &sizes);
    Ok([chart(&state, &parts)].into_iter().chain(gain(&parts)).chain(model).chain(next).collect())
}

/// What was said after a part, as far as it is told over the parts.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Said {
    pub(super) gain: Option<Gained>,
    model: Option<SaidModel>,
}

/// The model after a part.
#[derive(Debug, Deserialize)]
struct SaidModel {
    sizes: Vec<SaidSize>,
}

/// A size of the model after a part.
#[derive(Debug, Deserialize)]
struct SaidSize {
    kind: String,
    #[serde(default)]
    label: String,
    #[serde(default)]
    shape: Value,
    parameter: String,
    delta: f64,
    interval_95: [f64; 2],
}

/// The account after a part.
#[derive(Debug, Deserialize)]
pub(super) struct Gained {
    pub(super) parts: u32,
    pub(super) parts_cut_with_new_path: u32,
    pub(super) form_gain_um: f64,
    pub(super) form_gain_interval_95: [f64; 2],
    pub(super) parts_saved: f64,
    pub(super) parts_saved_interval_95: [f64; 2],
    pub(super) parts_spoilt: f64,
    pub(super) parts_spoilt_interval_95: [f64; 2],
}

impl Said {
    pub(super) fn after(part: &KeptPart) -> Self {
        serde_json::from_str(&part.said).unwrap_or_default()
    }
}

/// What paths brought, as it was told after each part; nothing where all parts were cut on the path of the base job.
fn gain(parts: &[KeptPart]) -> Option<Figure> {
    let told = parts.iter().filter_map(|part| Some((number_of(part), Said::after(part).gain?)));
    let (x, told): (Vec<f64>, Vec<Gained>) = told.unzip();
    told.last().filter(|last| last.parts_cut_with_new_path > 0)?;
    let panel = |axis, items| Panel { y: axis, height: 1.0, items };
    let band = |name, of: fn(&Gained) -> [f64; 2]| Item::Band {
        name,
        x: x.clone(),
        lower: told.iter().map(|own| of(own)[0]).collect(),
        upper: told.iter().map(|own| of(own)[1]).collect(),
        role: Role::Uncertainty,
    };
    let line = |name, of: fn(&Gained) -> f64, role| Item::Line {
        name,
        x: x.clone(),
        y: told.iter().map(|own| Some(of(own))).collect(),
        role,
    };
    let form = vec![
        band("process_gain_band", |own| own.form_gain_interval_95),
        line("process_form_gain", |own| own.form_gain_um, Role::After),
    ];
    let count = vec![
        line("process_parts_saved", |own| own.parts_saved, Role::Stable),
        line("process_parts_spoilt", |own| own.parts_spoilt, Role::Unstable),
    ];
    Some(Figure {
        id: "gain",
        title: Message::new("process_gain"),
        frame: Frame::Stacked,
        x: Axis::linear("process_part_number", "1"),
        panels: vec![
            panel(Axis::linear("process_form_gain", "um"), form),
            panel(Axis::linear("process_count", "1"), count),
        ],
    })
}

/// Of which kind, which of them, and of which form: what tells a size of the model from the others.
type WhichSize<'a> = (usize, &'a str, String);

/// The sizes of the model over the parts, as they were told after each: a panel for each field of a cause. Nothing where nothing
/// was told.
fn model(parts: &[KeptPart], known: &[(&'static str, &'static str, &'static str)]) -> Option<Figure> {
    let told: Vec<(f64, Vec<SaidSize>)> =
        parts.iter().filter_map(|part| Some((number_of(part), Said::after(part).model?.sizes))).collect();
    let mut over: BTreeMap<WhichSize<'_>, Vec<(f64, &SaidSize)>> = BTreeMap::new();
    for (number, sizes) in &told {
        for size in sizes {
            let is_it = |own: &(&str, &str, &str)| own.0 == size.kind && own.1 == size.parameter;
            let Some(which) = known.iter().position(is_it) else { continue };
            over.entry((which, &size.label, size.shape.to_string())).or_default().push((*number, size));
        }
    }
    let mut panels: Vec<(usize, Panel)> = Vec::new();
    for ((which, ..), told) in over {
        let (kind, parameter, unit) = known[which];
        let x: Vec<f64> = told.iter().map(|(number, _)| *number).collect();
        let end = |which: usize| told.iter().map(|(_, size)| size.interval_95[which]).collect();
        let items = [
            Item::Band {
                name: "process_size_band",
                x: x.clone(),
                lower: end(0),
                upper: end(1),
                role: Role::Uncertainty,
            },
            Item::Line { name: kind, x, y: told.iter().map(|(_, size)| Some(size.delta)).collect(), role: Role::After },
        ];
        if let Some((_, panel)) = panels.last_mut().filter(|(last, _)| *last == which) {
            panel.items.extend(items);
        } else {
            panels.push((which, Panel { y: Axis::linear(parameter, unit), height: 1.0, items: items.to_vec() }));
        }
    }
    let panels: Vec<Panel> = panels.into_iter().map(|(_, panel)| panel).collect();
    (!panels.is_empty()).then(|| Figure {
        id: "model",
        title: Message::new("process_model"),
        frame: Frame::Stacked,
        x: Axis::linear("process_part_number", "1"),
        panels,
    })
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

#[allow(clippy::cast_precision_loss)] // numbers of parts
fn number_of(part: &KeptPart) -> f64 {
    part.number.unwrap_or_default() as f64
}

/// The statistic over the parts beside its alarm, changes with the parts in which they may have begun, parts that stand
/// alone; below it how far each part is from what was expected of it.
fn chart(state: &Value, parts: &[KeptPart]) -> Figure {
    let x: Vec<f64> = parts.iter().map(number_of).collect();
    let nows: Vec<Value> = parts.iter().map(|part| serde_json::from_str(&part.now).unwrap_or_default()).collect();
    let of = |pointer: &str| -> Vec<Option<f64>> {
        nows.iter().map(|now| now.pointer(pointer).and_then(Value::as_f64)).collect()
    };
    let evidence = of("/evidence");
    let ends = match (x.first(), x.last()) {
        (Some(first), Some(last)) => vec![*first, *last],
        _ => Vec::new(),
    };
    let mut items = vec![
        Item::Line { name: "process_alarm", y: vec![Some(0.0); ends.len()], x: ends, role: Role::Limit },
        Item::Line { name: "process_evidence", x: x.clone(), y: evidence.clone(), role: Role::Plain },
    ];
    let changes: Vec<&Value> = state["changes"].as_array().into_iter().flatten().collect();
    let (mut since_x, mut since_y) = (Vec::new(), Vec::new());
    for change in &changes {
        let range = numbers(&change["since_parts_90"]);
        if let [from, to] = range[..] {
            since_x.extend([from, to, to]);
            since_y.extend([Some(0.0), Some(0.0), None]);
        }
    }
    if !changes.is_empty() {
        let began: Vec<f64> = changes.iter().filter_map(|change| change["since_part"].as_f64()).collect();
        items.push(Item::Line { name: "process_since", x: since_x, y: since_y, role: Role::Uncertainty });
        items.push(Item::Points { name: "process_began", y: vec![0.0; began.len()], x: began, role: Role::Unstable });
    }
    let odd: Vec<f64> =
        state["odd_parts"].as_array().into_iter().flatten().filter_map(|own| own["number"].as_f64()).collect();
    let odd: Vec<(f64, f64)> = x
        .iter()
        .zip(&evidence)
        .filter(|(number, _)| odd.contains(number))
        .map(|(number, evidence)| (*number, evidence.unwrap_or(0.0)))
        .collect();
    if !odd.is_empty() {
        let (x, y) = odd.into_iter().unzip();
        items.push(Item::Points { name: "process_odd", x, y, role: Role::Comparison });
    }
    let per_row = of("/score/chi2").into_iter().zip(of("/score/degrees"));
    let per_row = per_row.map(|(chi2, rows)| Some(chi2? / rows.filter(|rows| *rows > 0.0)?)).collect();
    Figure {
        id: "chart",
        title: Message::new("process_chart"),
        frame: Frame::Stacked,
        x: Axis::linear("process_part_number", "1"),
        panels: vec![
            Panel { y: Axis::linear("process_evidence", "1"), height: 2.0, items },
            Panel {
                y: Axis::linear("process_chi2_per_row", "1"),
                height: 1.0,
                items: vec![Item::Line { name: "process_chi2_per_row", x, y: per_row, role: Role::Plain }],
            },
        ],
    }
}

/// What was measured of the last part, and what is expected of the next: with the path as it is, and with a new one.
fn next(state: &Value, last: &KeptPart, document: &Value) -> Option<Figure> {
    let of = |which: &str, what: &str| numbers(&state["forecast"][which][what]);
    let (mean, deviation, new_path) = (of("as_now", "mean"), of("as_now", "deviation"), of("new_path", "mean"));
    let sent: Value = serde_json::from_str(&last.content).ok()?;
    let quantity = document["quantity"].as_str()?;
    let rows: Vec<&Value> = sent["measurements"].as_array()?.iter().filter(|row| row["excluded"] != true).collect();
    // Where a row was measured is the field of it that is a length.
    let fields = rows.first()?.as_object()?;
    let place = fields.keys().find(|name| name.ends_with("_mm") && *name != quantity)?.clone();
    let x: Vec<f64> = rows.iter().filter_map(|row| row[&place].as_f64()).collect();
    let measured: Vec<f64> = rows.iter().filter_map(|row| row[quantity].as_f64()).collect();
    if x.len() != mean.len() || measured.len() != x.len() {
        return None;
    }
    let at = |sign: f64| mean.iter().zip(&deviation).map(|(mean, own)| mean + sign * NORMAL_95 * own).collect();
    let line = |name, y: Vec<f64>, role| Item::Line { name, x: x.clone(), y: y.into_iter().map(Some).collect(), role };
    let items = vec![
        Item::Band {
            name: "process_expected_band",
            x: x.clone(),
            lower: at(-1.0),
            upper: at(1.0),
            role: Role::Uncertainty,
        },
        line("process_expected", mean.clone(), Role::Before),
        line("process_new_path", new_path, Role::After),
        Item::Points { name: "process_measured", x: x.clone(), y: measured, role: Role::Plain },
    ];
    Some(Figure {
        id: "next",
        title: Message::new("process_next"),
        frame: Frame::Stacked,
        x: Axis::linear("process_place", "mm"),
        panels: vec![Panel { y: Axis::linear("process_deviation", "um"), height: 1.0, items }],
    })
}
