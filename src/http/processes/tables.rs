//! The state of a process: as JSON, as a table, as a picture.

use axum::Extension;
use axum::extract::{Path, State};
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri};
use axum::response::Response;
use serde_json::Value;

use super::super::auth::Caller;
use super::super::negotiate::{self, Media};
use super::super::problem::Problem;
use super::super::query::Query;
use super::super::{App, answer};
use super::figures::{self, FIGURES, Said};
use super::tagged;
use crate::engine::{Shelf, in_language};
use crate::render::{csv_lines, defused};
use crate::store::processes::KeptPart;

/// Tables of a process.
pub(in crate::http) const TABLES: &[&str] = &["parts", "changes", "gain", "model"];
/// Parts that are read at once.
const PAGE: u32 = 1000;

/// `GET /v1/processes/{name}/state`
pub(super) async fn state(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let mut query = Query::of(&uri, &["table", "figure"])?;
    let table = query.one_of("table", TABLES, |table| table)?;
    let figure = query.one_of("figure", FIGURES, |figure| figure)?;
    let offered = [Media::Json, Media::Csv, Media::Svg];
    let media = negotiate::media(&headers, &offered).ok_or_else(|| answer::not_acceptable(&offered))?;
    let process = app.engine.process(&caller.shelf(), &name).await?;
    let language = negotiate::language(&headers);
    if media == Media::Json {
        let state = process.state.clone().map_or(Value::Null, |state| in_language(state, language));
        return Ok(tagged(&state, Some(&process.tag()), language, &headers, StatusCode::OK));
    }
    if media == Media::Svg {
        let id = figure.unwrap_or("chart");
        let figures = figures::all(&app, &caller.shelf(), &process).await?;
        let figure = figures.iter().find(|figure| figure.id == id);
        let figure = figure.ok_or_else(|| {
            Problem::missing("unknown_figure", id)
                .with("available", figures.iter().map(|figure| figure.id).collect::<Vec<_>>().join(", "))
        })?;
        let mut response = Response::new(answer::drawn(figure, language).into());
        response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(Media::Svg.content_type()));
        return Ok(response);
    }
    let state = process.state.as_ref();
    let lines = match table {
        Some("changes") => changes(state),
        Some("model") => model(state),
        Some("gain") => by_part(&app, &caller.shelf(), &name, (GAIN, gained)).await?,
        _ => by_part(&app, &caller.shelf(), &name, (PARTS, |part| Some(row(part)))).await?,
    };
    let mut response = Response::new(csv_lines(lines).into());
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("text/csv; charset=utf-8"));
    Ok(response)
}

/// A line of a table, cell by cell.
type Line = Vec<String>;

/// A line for each part of which there is something to tell.
async fn by_part(
    app: &App,
    shelf: &Shelf,
    process: &str,
    (names, line): (&str, fn(&KeptPart) -> Option<Line>),
) -> Result<Vec<Line>, Problem> {
    let (mut lines, mut from) = (vec![names.split(' ').map(str::to_owned).collect()], 0);
    loop {
        let page = app.engine.process_parts(shelf, process, (from, i64::MAX), PAGE).await?;
        let Some(last) = page.last().and_then(|part| part.number) else { return Ok(lines) };
        from = last + 1;
        lines.extend(page.iter().filter_map(line));
    }
}

const GAIN: &str = "number part parts parts_cut_with_new_path form_gain_um form_gain_lower_um form_gain_upper_um \
                    parts_saved parts_saved_lower parts_saved_upper parts_spoilt parts_spoilt_lower parts_spoilt_upper";

/// The account as it was told after a part.
fn gained(part: &KeptPart) -> Option<Line> {
    let told = Said::after(part).gain?;
    let sizes = [
        (told.form_gain_um, told.form_gain_interval_95),
        (told.parts_saved, told.parts_saved_interval_95),
        (told.parts_spoilt, told.parts_spoilt_interval_95),
    ];
    let mut line = beginning(part);
    line.extend([told.parts.to_string(), told.parts_cut_with_new_path.to_string()]);
    line.extend(sizes.iter().flat_map(|(value, [lower, upper])| [value, lower, upper]).map(f64::to_string));
    Some(line)
}

fn beginning(part: &KeptPart) -> Line {
    vec![part.number.unwrap_or_default().to_string(), part.part.clone()]
}

/// Columns of a table, each with the place of its cell in what is told.
type Columns = &'static [(&'static str, &'static str)];

fn names(columns: Columns) -> impl Iterator<Item = &'static str> {
    columns.iter().map(|(name, _)| *name)
}

fn cells(columns: Columns, told: &Value) -> impl Iterator<Item = String> {
    columns.iter().map(|(_, pointer)| told.pointer(pointer).map(cell).unwrap_or_default())
}

fn cell(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(word) => defused(word),
        other => other.to_string(),
    }
}

const SIZE: Columns = &[
    ("cause", "/kind"),
    ("label", "/label"),
    ("parameter", "/parameter"),
    ("unit", "/unit"),
    ("since_part", "/since_part"),
    ("form", "/form"),
    ("delta", "/delta"),
    ("lower", "/interval_95/0"),
    ("upper", "/interval_95/1"),
];

/// What the process is taken to be.
fn model(state: Option<&Value>) -> Vec<Line> {
    let sizes = state.and_then(|state| state.pointer("/model/sizes")?.as_array()).into_iter().flatten();
    let header = names(SIZE).map(str::to_owned).collect();
    std::iter::once(header).chain(sizes.map(|size| cells(SIZE, size).collect())).collect()
}

const PARTS: &str = "number part state unused evidence chi2 p change";

fn row(part: &KeptPart) -> Line {
    let now: Value = serde_json::from_str(&part.now).unwrap_or_default();
    let of = |pointer: &str| now.pointer(pointer).map(cell).unwrap_or_default();
    let mut line = beginning(part);
    line.extend(["/state", "/unused", "/evidence", "/score/chi2", "/score/p", "/change"].map(of));
    line
}

const CHANGE: Columns = &[
    ("id", "/id"),
    ("since_part", "/since_part"),
    ("from_part", "/since_parts_90/0"),
    ("to_part", "/since_parts_90/1"),
    ("reported_at_part", "/reported_at_part"),
    ("verdict", "/verdict"),
    ("accepted", "/accepted"),
    ("decided", "/decided"),
];
const CAUSE: Columns = &[
    ("cause", "/kind"),
    ("share", "/share"),
    ("parameter", "/parameter"),
    ("delta", "/delta"),
    ("lower", "/interval_95/0"),
    ("upper", "/interval_95/1"),
    ("unit", "/unit"),
];

/// A line for every cause of every change.
fn changes(state: Option<&Value>) -> Vec<Line> {
    let mut lines = vec![names(CHANGE).chain(names(CAUSE)).map(str::to_owned).collect()];
    let all = state.and_then(|state| state["changes"].as_array()).into_iter().flatten();
    for change in all {
        let causes = change["causes"].as_array().into_iter().flatten();
        lines.extend(causes.map(|cause| cells(CHANGE, change).chain(cells(CAUSE, cause)).collect()));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_label_with_a_comma_stays_one_cell_and_runs_nowhere() {
        let size =
            |label: &str| json!({ "kind": "batch_level", "label": label, "delta": 0.5, "interval_95": [0.25, 1] });
        let state = json!({ "model": { "sizes": [size("bar = A, insert = 2"), size("=cmd|'/C calc'!A1")] } });
        let text = csv_lines(model(Some(&state)));
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("cause,label,parameter,unit,since_part,form,delta,lower,upper"));
        assert_eq!(lines.next(), Some("batch_level,\"bar = A, insert = 2\",,,,,0.5,0.25,1"));
        assert_eq!(lines.next(), Some("batch_level,'=cmd|'/C calc'!A1,,,,,0.5,0.25,1"));
        assert_eq!(lines.next(), None);
    }
}
