//! Parts of a process: taken, read, corrected, withdrawn, and whole histories.

use std::sync::OnceLock;

use axum::Extension;
use axum::extract::{Path, Request, State};
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::Response;
use serde_json::{Map, Value, json};

use super::super::auth::Caller;
use super::super::problem::Problem;
use super::super::query::{Query, page};
use super::super::{App, body, callbacks, gate, negotiate};
use super::{MOST_NUMBER, answered, located, precondition, tagged, time};
use crate::engine::{Body, PartAnswer, PartOutcome, ProcessError, in_language, parsed};
use crate::store::processes::{Entry, KeptPart};
use crate::text::Language;

/// What is said of a part that comes as a bare table.
const OF_PART: [&str; 5] = ["number", "part_type", "edge", "batch", "path_revision"];

fn value(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_default()
}

fn said_in(text: &str, language: Language) -> Value {
    in_language(value(text), language)
}

/// A part as it is answered.
fn document(process: &str, kept: &KeptPart, language: Language) -> Value {
    json!({
        "process": process,
        "part": kept.part,
        "number": kept.number,
        "revision": kept.revision,
        "sequence": kept.sequence,
        "created_at": time(kept.created_ms),
        "withdrawn": kept.number.is_none(),
        "sent": value(&kept.content),
        "said": said_in(&kept.said, language),
        "now": value(&kept.now),
        "links": { "self": format!("/v1/processes/{process}/parts/{}", kept.part) },
    })
}

fn entry(entry: &Entry, language: Language) -> Value {
    json!({
        "sequence": entry.sequence,
        "kind": entry.kind,
        "part": entry.part,
        "number": entry.number,
        "revision": entry.revision,
        "created_at": time(entry.created_ms),
        "sent": value(&entry.content),
        "said": said_in(&entry.said, language),
        "callback": entry.callback.as_ref().map(|callback| callbacks::document(callback, time)),
    })
}

/// `GET /v1/processes/{name}/parts`
pub(super) async fn list(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    const STATES: &[&str] = &["learning", "in_control", "warning", "changed"];
    let mut query = Query::of(&uri, &["from", "to", "state", "limit"])?;
    let numbers = &(0..=MOST_NUMBER);
    let (from, to) = (query.number("from", numbers)?.unwrap_or(0), query.number("to", numbers)?);
    let state = query.one_of("state", STATES, |state| state)?;
    let limit = query.limit()?;
    let range = (i64::from(from), to.map_or(i64::MAX, i64::from));
    let (parts, more) = page(app.engine.process_parts(&caller.shelf(), &name, range, limit + 1).await?, limit);
    let next = parts.last().filter(|_| more).and_then(|last| last.number).map(|last| {
        let to = to.map(|to| format!("&to={to}")).unwrap_or_default();
        let state = state.map(|state| format!("&state={state}")).unwrap_or_default();
        format!("/v1/processes/{name}/parts?limit={limit}&from={}{to}{state}", last + 1)
    });
    let language = negotiate::language(&headers);
    let items: Vec<Value> = parts
        .iter()
        .map(|kept| document(&name, kept, language))
        .filter(|part| state.is_none_or(|state| part["now"]["state"] == state))
        .collect();
    Ok(answered(&json!({ "items": items, "next": next }), language))
}

/// `GET /v1/processes/{name}/history`
pub(super) async fn history(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let mut query = Query::of(&uri, &["after", "limit"])?;
    let after = query.number("after", &(0..=MOST_NUMBER))?.unwrap_or(0);
    let limit = query.limit()?;
    let entries = app.engine.process_entries(&caller.shelf(), &name, after.into(), limit + 1).await?;
    let (entries, more) = page(entries, limit);
    let next = entries.last().filter(|_| more);
    let next = next.map(|last| format!("/v1/processes/{name}/history?limit={limit}&after={}", last.sequence));
    let language = negotiate::language(&headers);
    let items: Vec<Value> = entries.iter().map(|own| entry(own, language)).collect();
    Ok(answered(&json!({ "items": items, "next": next }), language))
}

/// `GET /v1/processes/{name}/parts/{part}`
pub(super) async fn read(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path((name, part)): Path<(String, String)>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (kept, entries) = app.engine.process_part(&caller.shelf(), &name, &part).await?;
    let language = negotiate::language(&headers);
    let mut said = document(&name, &kept, language);
    said["history"] = entries.iter().map(|own| entry(own, language)).collect();
    // What is said of it now changes with what comes after it: the tag is that of what was sent.
    Ok(tagged(&said, Some(&kept.revision.to_string()), language, &HeaderMap::new(), StatusCode::OK))
}

fn said(name: &str, part: &str, answer: &PartAnswer, language: Language) -> Response {
    let status = if answer.outcome == PartOutcome::Taken { StatusCode::CREATED } else { StatusCode::OK };
    let said = in_language(answer.said.clone(), language);
    let response = tagged(&said, Some(&answer.revision.to_string()), language, &HeaderMap::new(), status);
    located(response, &format!("/v1/processes/{name}/parts/{part}"))
}

/// `PUT /v1/processes/{name}/parts/{part}`
pub(super) async fn take(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path((name, part)): Path<(String, String)>,
    request: Request,
) -> Result<Response, Problem> {
    let headers = request.headers().clone();
    let owner = gate::owner(&caller, &request);
    let (sent, tables) = if is_csv(&headers) {
        let fields = of_query(&app, request.uri())?;
        let (_, text) = body::plain(request, &["text/csv"], &app.limits, app.engine.bodies()).await?;
        (with_table(fields, &text)?, Vec::new())
    } else {
        match body::job(request, || true, &app.limits, app.engine.bodies()).await? {
            Body::Json(sent) => (parsed(&sent)?, Vec::new()),
            Body::Parts { job, files } => (parsed(&job)?, files),
        }
    };
    let condition = (precondition(&headers), owner);
    let answer = app.engine.put_part(&caller.shelf(), (&name, &part), (sent, &tables), condition).await?;
    Ok(said(&name, &part, &answer, negotiate::language(&headers)))
}

/// `DELETE /v1/processes/{name}/parts/{part}`
pub(super) async fn withdraw(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path((name, part)): Path<(String, String)>,
    request: Request,
) -> Result<Response, Problem> {
    let owner = gate::owner(&caller, &request);
    let condition = (precondition(request.headers()), owner);
    let answer = app.engine.withdraw_part(&caller.shelf(), (&name, &part), condition).await?;
    Ok(said(&name, &part, &answer, negotiate::language(request.headers())))
}

/// `POST /v1/processes/{name}/parts`
pub(super) async fn import(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    request: Request,
) -> Result<Response, Problem> {
    let language = negotiate::language(request.headers());
    let owner = gate::owner(&caller, &request);
    let shelf = caller.shelf();
    let types = &["text/csv", "application/json"];
    let (kind, bytes) = body::plain(request, types, &app.limits, app.engine.bodies()).await?;
    let mut told = if kind == "text/csv" {
        app.engine.put_history(&shelf, &name, &text_of(&bytes)?, owner).await?
    } else {
        app.engine.put_parts(&shelf, &name, named_parts(parsed(&bytes)?)?, owner).await?
    };
    told["state"] = in_language(told["state"].take(), language);
    Ok(answered(&told, language))
}

/// `{"parts": [{"part": NAME, ...}]}`
fn named_parts(mut sent: Value) -> Result<Vec<(String, Value)>, ProcessError> {
    let Some(Value::Array(parts)) = sent.get_mut("parts").map(Value::take) else {
        return Err(ProcessError::missing("/parts"));
    };
    let named = |(index, mut part): (usize, Value)| {
        let name = part.as_object_mut().and_then(|fields| fields.remove("part"));
        match name {
            Some(Value::String(name)) => Ok((name, part)),
            _ => Err(ProcessError::missing(&format!("/parts/{index}/part"))),
        }
    };
    parts.into_iter().enumerate().map(named).collect()
}

fn is_csv(headers: &HeaderMap) -> bool {
    let kind = headers.get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    kind.split(';').next().is_some_and(|essence| essence.trim().eq_ignore_ascii_case("text/csv"))
}

fn text_of(bytes: &[u8]) -> Result<String, ProcessError> {
    String::from_utf8(bytes.to_vec()).map_err(|_| ProcessError::not_utf8())
}

fn with_table(mut fields: Map<String, Value>, text: &[u8]) -> Result<Value, ProcessError> {
    fields.insert("measurements".to_owned(), json!({ "csv": text_of(text)? }));
    Ok(fields.into())
}

/// What the query says of a part that comes as a bare table: its number, its type, its conditions.
fn of_query(app: &App, uri: &Uri) -> Result<Map<String, Value>, Problem> {
    static KNOWN: OnceLock<Vec<&'static str>> = OnceLock::new();
    let known = KNOWN.get_or_init(|| {
        let observed = app.engine.registry().entries().iter().filter_map(|entry| entry.observed());
        OF_PART.into_iter().chain(observed.flat_map(|observed| observed.conditions.iter().copied())).collect()
    });
    let mut query = Query::of(uri, known)?;
    let (mut fields, mut conditions) = (Map::new(), Map::new());
    for name in known {
        let Some(text) = query.text(name) else { continue };
        let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
        let told = match (*name, number) {
            ("part_type" | "batch", _) | (_, None) => json!(text),
            #[allow(clippy::cast_possible_truncation)] // a whole number of a query, below 1e9
            (_, Some(number)) if number.fract() == 0.0 && number.abs() < 1e9 => json!(number as i64),
            (_, Some(number)) => json!(number),
        };
        match *name {
            "number" | "part_type" => drop(fields.insert((*name).to_owned(), told)),
            "path_revision" => {
                fields.insert("path".to_owned(), json!({ "kind": "process", "revision": told }));
            }
            _ => drop(conditions.insert((*name).to_owned(), told)),
        }
    }
    fields.insert("conditions".to_owned(), conditions.into());
    Ok(fields)
}
