//! The state of a process: as JSON, as a table, as a picture.

use std::fmt::Write as _;

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
    let text = match table {
        Some("changes") => changes(state),
        Some("model") => model(state),
        Some("gain") => by_part(&app, &caller.shelf(), &name, (GAIN_HEADER, gained)).await?,
        _ => by_part(&app, &caller.shelf(), &name, (HEADER, row)).await?,
    };
    let mut response = Response::new(text.into());
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("text/csv; charset=utf-8"));
    Ok(response)
}

/// A line for each part.
async fn by_part(
    app: &App,
    shelf: &Shelf,
    process: &str,
    (header, row): (&str, fn(&KeptPart) -> String),
) -> Result<String, Problem> {
    let (mut text, mut from) = (header.to_owned(), 0);
    loop {
        let page = app.engine.process_parts(shelf, process, (from, i64::MAX), PAGE).await?;
        let Some(last) = page.last().and_then(|part| part.number) else { return Ok(text) };
        from = last + 1;
        text.extend(page.iter().map(row));
    }
}

const GAIN_HEADER: &str = "number,part,parts,parts_cut_with_new_path,form_gain_um,form_gain_lower_um,form_gain_upper_um,\
    parts_saved,parts_saved_lower,parts_saved_upper,parts_spoilt,parts_spoilt_lower,parts_spoilt_upper\n";

/// The account as it was told after a part.
fn gained(part: &KeptPart) -> String {
    let Some(told) = Said::after(part).gain else { return String::new() };
    let with_ends = |value: f64, [lower, upper]: [f64; 2]| format!("{value},{lower},{upper}");
    let cells = [
        told.parts.to_string(),
        told.parts_cut_with_new_path.to_string(),
        with_ends(told.form_gain_um, told.form_gain_interval_95),
        with_ends(told.parts_saved, told.parts_saved_interval_95),
        with_ends(told.parts_spoilt, told.parts_spoilt_interval_95),
    ];
    format!("{},{},{}\n", part.number.unwrap_or_default(), part.part, cells.join(","))
}

/// What the process is taken to be.
fn model(state: Option<&Value>) -> String {
    let mut text = "cause,label,parameter,unit,since_part,form,delta,lower,upper\n".to_owned();
    let sizes = state.and_then(|state| state.pointer("/model/sizes")?.as_array());
    for size in sizes.into_iter().flatten() {
        let cells = [
            "/kind",
            "/label",
            "/parameter",
            "/unit",
            "/since_part",
            "/form",
            "/delta",
            "/interval_95/0",
            "/interval_95/1",
        ]
        .map(|pointer| size.pointer(pointer).map(plain).unwrap_or_default());
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}

const HEADER: &str = "number,part,state,unused,evidence,chi2,p,change\n";

fn plain(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

fn row(part: &KeptPart) -> String {
    let now: Value = serde_json::from_str(&part.now).unwrap_or_default();
    let number = part.number.unwrap_or_default();
    let of = |pointer: &str| now.pointer(pointer).map(plain).unwrap_or_default();
    let cells = ["/state", "/unused", "/evidence", "/score/chi2", "/score/p", "/change"].map(of);
    format!("{number},{},{}\n", part.part, cells.join(","))
}

fn changes(state: Option<&Value>) -> String {
    let mut text =
        "id,since_part,from_part,to_part,reported_at_part,verdict,accepted,decided,cause,share,parameter,delta,lower,upper,unit\n"
            .to_owned();
    let all = state.and_then(|state| state["changes"].as_array()).into_iter().flatten();
    for change in all {
        for cause in change["causes"].as_array().into_iter().flatten() {
            let of_change = [
                "/id",
                "/since_part",
                "/since_parts_90/0",
                "/since_parts_90/1",
                "/reported_at_part",
                "/verdict",
                "/accepted",
                "/decided",
            ]
            .map(|pointer| change.pointer(pointer).map(plain).unwrap_or_default());
            let of_cause = ["/kind", "/share", "/parameter", "/delta", "/interval_95/0", "/interval_95/1", "/unit"]
                .map(|pointer| cause.pointer(pointer).map(plain).unwrap_or_default());
            let _ = writeln!(text, "{},{}", of_change.join(","), of_cause.join(","));
        }
    }
    text
}
