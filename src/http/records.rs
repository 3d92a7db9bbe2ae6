//! Machines, tools, materials and parts: listed, read, stored, compared, deleted.

use axum::body::Body as HttpBody;
use axum::extract::{Path, Request, State};
use axum::http::header::{IF_NONE_MATCH, LOCATION};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri};
use axum::response::Response;
use axum::routing::get;
use axum::{Extension, Router};
use precut_library::Kind;
use precut_library::record::MAX_BYTES;
use serde_json::{Value, json};

use super::auth::Caller;
use super::document::Document;
use super::library::{Around, said};
use super::problem::Problem;
use super::query::{MOST_ITEMS, Query};
use super::{App, body, gate, negotiate};
use crate::config::Limits;
use crate::engine::{Body, RecordAnswer, RecordError, RecordQuery, StoredRecord};
use crate::text::Language;

/// Largest body that is read, bytes: four times what is kept of a record, for who writes it with white space.
const MOST_BYTES: usize = 4 * MAX_BYTES;

/// The addresses of a kind.
pub(super) fn routes(kind: Kind) -> Router<App> {
    let folder = kind.plural();
    Router::new()
        .route(&format!("/v1/{folder}"), get(list))
        .route(&format!("/v1/{folder}/{{name}}"), get(read).put(store).delete(delete))
        .route(&format!("/v1/{folder}/{{name}}/comparison"), get(compare))
        .layer(Extension(kind))
}

/// The parameter that filters a list.
pub(super) const fn class_parameter(kind: Kind) -> &'static str {
    match kind {
        Kind::Machine | Kind::Tool => "kind",
        Kind::Material => "group",
        Kind::Part => "field",
    }
}

/// `GET /v1/machines` and the like.
async fn list(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Extension(kind): Extension<Kind>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let mut query = Query::of(&uri, &["q", "group", "kind", "field", "own", "limit", "after"])?;
    let limit = query.number("limit", &(1..=MOST_ITEMS))?.unwrap_or(MOST_ITEMS);
    let own = query.one_of("own", &[true, false], |own| if own { "true" } else { "false" })?.unwrap_or(false);
    let class = class_parameter(kind);
    let text = query.text("q").filter(|text| !text.trim().is_empty());
    let asked = RecordQuery { text, class: query.text(class), own, after: query.text("after"), limit: limit as usize };
    let (asked_text, asked_class) = (asked.text.clone(), asked.class.clone());
    let page = app.engine.records(&caller.shelf(), kind, asked).await?;
    let next = page.items.last().filter(|_| page.more && asked_text.is_none()).map(|last| {
        let class = asked_class.map(|word| format!("&{class}={word}")).unwrap_or_default();
        let own = if own { "&own=true" } else { "" };
        format!("/v1/{}?limit={limit}{class}{own}&after={}", kind.plural(), last.record.name)
    });
    let language = negotiate::language(&headers);
    let items: Vec<Value> = page.items.iter().map(|record| said(record, &Around::default(), language)).collect();
    Ok(Document::json(&json!({ "items": items, "next": next }), Some(language)).respond(&headers))
}

/// `GET /v1/machines/{name}`
async fn read(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Extension(kind): Extension<Kind>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let language = negotiate::language(&headers);
    let record = app.engine.record(&caller.shelf(), kind, &name).await?;
    Ok(document(&app, &caller, &record, language).await?.respond(&headers))
}

async fn document(app: &App, caller: &Caller, record: &StoredRecord, language: Language) -> Result<Document, Problem> {
    let (kind, name) = (record.record.kind, &record.record.name);
    let revisions = app.engine.record_revisions(&caller.shelf(), kind, name).await?;
    let uses =
        if Kind::NAMED.contains(&kind) { Some(app.engine.uses(record.address(), caller.shown()).await?) } else { None };
    Ok(Document::json(&said(record, &Around { revisions, uses }, language), Some(language)))
}

/// `GET /v1/machines/{name}/comparison`
async fn compare(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Extension(kind): Extension<Kind>,
    Path(name): Path<String>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let with = Query::of(&uri, &["with"])?.needed("with")?;
    let both = app.engine.compare_records(&caller.shelf(), kind, (&name, &with)).await?;
    Ok(Document::json(&both, None).respond(&headers))
}

/// `PUT /v1/machines/{name}`
async fn store(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Extension(kind): Extension<Kind>,
    Path(name): Path<String>,
    request: Request,
) -> Result<Response, Problem> {
    let headers = request.headers().clone();
    let only_new = headers.get_all(IF_NONE_MATCH).iter().any(|tag| tag.as_bytes() == b"*");
    let owner = gate::owner(&caller, &request);
    let limits = Limits { json_bytes: app.limits.json_bytes.min(MOST_BYTES), ..app.limits.clone() };
    let sent = body::job(request, || false, &limits, app.engine.bodies()).await?;
    let Body::Json(sent) = sent else { return Err(Problem::internal()) };
    let shelf = caller.shelf();
    let RecordAnswer { record, is_new } =
        app.engine.put_record(&shelf, (kind, &name), &sent, (only_new, owner)).await?;
    let language = negotiate::language(&headers);
    // A condition on what was there before says nothing of what is answered now.
    let mut response = document(&app, &caller, &record, language).await?.respond(&HeaderMap::new());
    *response.status_mut() = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    let location = HeaderValue::try_from(format!("/v1/{}", record.address()));
    response.headers_mut().insert(LOCATION, location.expect("a name is visible ASCII"));
    Ok(response)
}

/// `DELETE /v1/machines/{name}`
async fn delete(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Extension(kind): Extension<Kind>,
    Path(name): Path<String>,
) -> Result<Response, Problem> {
    app.engine.delete_record(&caller.shelf(), kind, &name).await?;
    let mut response = Response::new(HttpBody::empty());
    *response.status_mut() = StatusCode::NO_CONTENT;
    Ok(response)
}

impl From<RecordError> for Problem {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Unknown { kind, name, nearest } => Self::unknown_record(kind, &name, nearest),
            RecordError::BuiltInName(name) => Self::new(StatusCode::CONFLICT, "name_is_built_in").with("name", name),
            RecordError::Exists(name) => Self::new(StatusCode::PRECONDITION_FAILED, "record_exists").with("name", name),
            RecordError::Invalid { findings, total } => Self::invalid_record(findings, total),
            RecordError::TooLarge { bytes, most } => {
                Self::new(StatusCode::PAYLOAD_TOO_LARGE, "record_too_large").with("bytes", bytes).with("most", most)
            }
            RecordError::Full { most } => {
                #[allow(clippy::cast_precision_loss)] // a count of records
                Self::new(StatusCode::INSUFFICIENT_STORAGE, "library_full").with("most", most as f64)
            }
            RecordError::Other(error) => error.into(),
        }
    }
}
