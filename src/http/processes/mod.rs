//! Processes under watch: declared, fed part by part, asked what to do next, followed.

mod events;
mod figures;
mod next;
mod parts;
mod tables;

pub(super) use figures::FIGURES;
pub(super) use tables::TABLES;

use axum::body::Body as HttpBody;
use axum::extract::{Path, Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_LANGUAGE, CONTENT_TYPE, ETAG, HeaderName, IF_MATCH, IF_NONE_MATCH, LOCATION, VARY,
};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri};
use axum::response::Response;
use axum::routing::{get, post};
use axum::{Extension, Router};
use precut_calc::process::Decision;
use serde::Deserialize;
use serde_json::{Value, json};

use super::auth::Caller;
use super::problem::Problem;
use super::query::{Query, page};
use super::{App, body, gate, negotiate};
use crate::engine::{Body, KeptProcess, Precondition, ProcessError, in_language, parsed};
use crate::text::Language;

/// Largest number of a part or an entry, and largest condition of the next part, that can be asked for.
pub(super) const MOST_NUMBER: u32 = 1_000_000_000;

/// Their addresses.
pub(super) fn routes() -> Router<App> {
    let one = "/v1/processes/{name}";
    let under = |part: &str| format!("{one}/{part}");
    Router::new()
        .route("/v1/processes", get(list))
        .route(one, get(read).put(store).delete(delete))
        .route(&under("parts"), get(parts::list).post(parts::import))
        .route(&under("parts/{part}"), get(parts::read).put(parts::take).delete(parts::withdraw))
        .route(&under("state"), get(tables::state))
        .route(&under("figures"), get(figures::list))
        .route(&under("history"), get(parts::history))
        .route(&under("changes"), get(changes))
        .route(&under("changes/{id}"), post(decide))
        .route(&under("next"), get(next::next))
        .route(&under("gain"), get(gain))
        .route(&under("events"), get(events::follow))
        .route(&under("export"), get(export))
}

/// Methods of an address behind `/v1/processes/`.
pub(super) fn allowed(rest: &str) -> &'static str {
    match rest.split('/').collect::<Vec<_>>()[..] {
        [_] | [_, "parts", _] => "GET, HEAD, PUT, DELETE",
        [_, "parts"] => "GET, HEAD, POST",
        [_, "changes", _] => "POST",
        _ => "GET, HEAD",
    }
}

/// JSON in a language, with the tag by which it is changed; `304` where the client has it.
fn tagged(value: &Value, tag: Option<&str>, language: Language, request: &HeaderMap, status: StatusCode) -> Response {
    let etag = tag.map(|tag| format!("\"{tag}\""));
    let is_known = etag.as_deref().is_some_and(|etag| negotiate::has_already(request, etag));
    let body = if is_known { HttpBody::empty() } else { HttpBody::from(value.to_string()) };
    let mut response = Response::new(body);
    *response.status_mut() = if is_known { StatusCode::NOT_MODIFIED } else { status };
    let headers = response.headers_mut();
    if let Some(etag) = etag.and_then(|etag| HeaderValue::try_from(etag).ok()) {
        headers.insert(ETAG, etag);
    }
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    headers.insert(VARY, HeaderValue::from_static("Accept, Accept-Language, Accept-Encoding"));
    if !is_known {
        headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/json"));
        headers.insert(CONTENT_LANGUAGE, HeaderValue::from_static(language.tag()));
    }
    response
}

/// What is answered once and never again.
fn answered(value: &Value, language: Language) -> Response {
    tagged(value, None, language, &HeaderMap::new(), StatusCode::OK)
}

fn located(mut response: Response, address: &str) -> Response {
    if let Ok(address) = HeaderValue::try_from(address) {
        response.headers_mut().insert(LOCATION, address);
    }
    response
}

/// What the headers of a request say of what is there.
fn precondition(headers: &HeaderMap) -> Precondition {
    let tags = |name: HeaderName| -> Vec<String> {
        let lines = headers.get_all(name).iter().filter_map(|line| line.to_str().ok());
        let tags = lines.flat_map(|line| line.split(','));
        tags.map(|tag| tag.trim().trim_start_matches("W/").trim_matches('"').to_owned()).collect()
    };
    let wanted = headers.contains_key(IF_MATCH).then(|| tags(IF_MATCH));
    Precondition { tags: wanted, only_new: tags(IF_NONE_MATCH).iter().any(|tag| tag == "*") }
}

fn time(ms: i64) -> String {
    format!("{:.3}", jiff::Timestamp::from_millisecond(ms).unwrap_or_default())
}

/// A process as it is answered.
fn document(process: &KeptProcess, language: Language) -> Value {
    let address = format!("/v1/processes/{}", process.name);
    let under = |part: &str| format!("{address}/{part}");
    let with_model = |state: &Value| state["model"]["revision"].as_u64().is_some_and(|revision| revision > 1);
    let model = process.state.as_ref().is_some_and(with_model).then(|| format!("/v1/models/{}", process.name));
    json!({
        "name": process.name,
        "revision": process.revision,
        "sequence": process.sequence,
        "created_at": time(process.created_ms),
        "document": process.document,
        "state": process.state.clone().map(|state| in_language(state, language)),
        "links": {
            "self": address, "parts": under("parts"), "state": under("state"), "changes": under("changes"),
            "next": under("next"), "events": under("events"), "export": under("export"), "model": model,
        },
    })
}

/// `GET /v1/processes`
async fn list(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let mut query = Query::of(&uri, &["limit", "after"])?;
    let limit = query.limit()?;
    let after = query.text("after").unwrap_or_default();
    let (items, more) = page(app.engine.processes(&caller.shelf(), after, limit + 1).await?, limit);
    let next = items.last().filter(|_| more).map(|last| format!("/v1/processes?limit={limit}&after={}", last.name));
    let language = negotiate::language(&headers);
    let items: Vec<Value> = items.iter().map(|process| document(process, language)).collect();
    Ok(answered(&json!({ "items": items, "next": next }), language))
}

/// `GET /v1/processes/{name}`
async fn read(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let process = app.engine.process(&caller.shelf(), &name).await?;
    let language = negotiate::language(&headers);
    Ok(tagged(&document(&process, language), Some(&process.tag()), language, &headers, StatusCode::OK))
}

/// The JSON of a body.
async fn json_of(app: &App, request: Request) -> Result<Value, Problem> {
    let sent = body::job(request, || false, &app.limits, app.engine.bodies()).await?;
    let Body::Json(sent) = sent else { return Err(Problem::internal()) };
    Ok(parsed(&sent)?)
}

/// `PUT /v1/processes/{name}`
async fn store(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    request: Request,
) -> Result<Response, Problem> {
    let headers = request.headers().clone();
    let owner = gate::owner(&caller, &request);
    let sent = json_of(&app, request).await?;
    if let Some(url) = sent.pointer("/callback/url").and_then(Value::as_str) {
        app.callbacks.checked(url.to_owned())?;
    }
    let condition = (precondition(&headers), owner);
    let (process, is_new) = app.engine.put_process(&caller.shelf(), &name, sent, condition).await?;
    let language = negotiate::language(&headers);
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    let said = document(&process, language);
    // A condition on what was there before says nothing of what is answered now.
    let response = tagged(&said, Some(&process.tag()), language, &HeaderMap::new(), status);
    Ok(located(response, &format!("/v1/processes/{name}")))
}

/// `DELETE /v1/processes/{name}`
async fn delete(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.engine.delete_process(&caller.shelf(), &name, &precondition(&headers)).await?;
    let mut response = Response::new(HttpBody::empty());
    *response.status_mut() = StatusCode::NO_CONTENT;
    Ok(response)
}

/// `GET /v1/processes/{name}/changes`
async fn changes(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let process = app.engine.process(&caller.shelf(), &name).await?;
    let language = negotiate::language(&headers);
    let changes = process.state.map_or_else(|| json!([]), |state| in_language(state, language)["changes"].take());
    Ok(answered(&json!({ "items": changes, "next": null }), language))
}

/// What a person says of a change.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Said {
    decision: Word,
    #[serde(default)]
    cause: Option<String>,
    #[serde(default)]
    note: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Word {
    Confirm,
    Reject,
    Name,
}

/// `POST /v1/processes/{name}/changes/{id}`
async fn decide(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path((name, id)): Path<(String, String)>,
    request: Request,
) -> Result<Response, Problem> {
    let language = negotiate::language(request.headers());
    let owner = gate::owner(&caller, &request);
    let sent = json_of(&app, request).await?;
    let said: Said = serde_path_to_error::deserialize(&sent)
        .map_err(|error| ProcessError::one(crate::registry::second_line(&error)))?;
    let decision = match (said.decision, said.cause) {
        (Word::Confirm, _) => Decision::Confirm,
        (Word::Reject, _) => Decision::Reject,
        (Word::Name, Some(cause)) => Decision::Name(cause),
        (Word::Name, None) => return Err(ProcessError::missing("/cause").into()),
    };
    let process = app.engine.decide(&caller.shelf(), &name, &id, (decision, said.note, owner)).await?;
    let state = process.state.clone().map(|state| in_language(state, language)).unwrap_or_default();
    Ok(tagged(&state, Some(&process.tag()), language, &HeaderMap::new(), StatusCode::OK))
}

/// `GET /v1/processes/{name}/gain`
async fn gain(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let process = app.engine.process(&caller.shelf(), &name).await?;
    let gain = process.state.as_ref().map_or(Value::Null, |state| state["gain"].clone());
    Ok(answered(&json!({ "process": name, "gain": gain }), negotiate::language(&headers)))
}

/// `GET /v1/processes/{name}/export`
async fn export(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let record = app.engine.export_process(&caller.shelf(), &name).await?;
    Ok(answered(&record, negotiate::language(&headers)))
}

impl From<ProcessError> for Problem {
    fn from(error: ProcessError) -> Self {
        match error {
            ProcessError::Unknown { name, nearest } => {
                let problem = Self::missing("unknown_process", &name);
                match nearest {
                    Some(nearest) => problem.with("nearest", nearest),
                    None => problem,
                }
            }
            ProcessError::UnknownPart(part) => Self::missing("unknown_process_part", &part),
            ProcessError::UnknownChange(change) => Self::missing("unknown_change", &change),
            ProcessError::Exists(name) => Self::new(StatusCode::CONFLICT, "process_exists").with("name", name),
            ProcessError::ModelTaken(name) => Self::new(StatusCode::CONFLICT, "model_name_taken").with("name", name),
            ProcessError::NumberTaken { number, part } => Self::new(StatusCode::CONFLICT, "part_number_taken")
                .with("number", f64::from(number))
                .with("part", part),
            ProcessError::PreconditionRequired { tag } => {
                Self::new(StatusCode::PRECONDITION_REQUIRED, "precondition_required").with("tag", tag)
            }
            ProcessError::PreconditionFailed { tag } => {
                Self::new(StatusCode::PRECONDITION_FAILED, "precondition_failed").with("tag", tag)
            }
            ProcessError::Invalid { findings, total } => Self::invalid_process(findings, total),
            ProcessError::CallPerson => Self::new(StatusCode::CONFLICT, "action_is_call_person"),
            ProcessError::Other(error) => error.into(),
        }
    }
}
