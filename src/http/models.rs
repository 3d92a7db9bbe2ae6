//! Stored models: what a diagnosis found, under a name that later jobs ask for.

use axum::Extension;
use axum::body::Body as HttpBody;
use axum::extract::{Path, Request, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE, IF_NONE_MATCH, LOCATION};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri};
use axum::response::Response;
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::auth::Caller;
use super::problem::Problem;
use super::query::{Query, page};
use super::{App, body, gate, jobs, results};
use crate::config::Limits;
use crate::engine::{Body, ModelAnswer, ModelError, ModelSource, StoredModel};

/// Largest model that is read, bytes: four times what is kept of one, for who writes it with white space.
const MOST_BYTES: usize = 1 << 20;

/// A stored model. What `GET` gives, `PUT` takes again, here or elsewhere.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Model)]
pub(super) struct ModelDocument {
    /// Its name.
    #[schema(example = "lathe-7-winter", pattern = "^[a-z0-9][a-z0-9_-]{0,63}$")]
    name: String,
    /// Rises with each `PUT`; a revision never changes.
    #[schema(minimum = 1, example = 3)]
    revision: u32,
    /// Whose jobs it extends.
    #[schema(example = "deflection-compensation")]
    calculator: String,
    /// SHA-256 of `{calculator, effects, provenance}` in canonical JSON (RFC 8785).
    #[schema(pattern = "^[0-9a-f]{64}$")]
    sha256: String,
    /// When it was stored, UTC.
    #[schema(format = DateTime, example = "2026-02-03T10:15:00.123Z")]
    created_at: String,
    /// The effects that it adds to a job, each with its `kind` and parameters.
    #[schema(value_type = Vec<Object>)]
    effects: Vec<Value>,
    /// Where it comes from: the diagnosis, the hash of its data, the causes with their intervals, the gain.
    #[schema(value_type = Object)]
    provenance: Value,
    /// Where to go from here.
    links: ModelLinks,
}

/// Addresses of a model.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct ModelLinks {
    /// This revision.
    #[serde(rename = "self")]
    #[schema(example = "/v1/models/lathe-7-winter@3")]
    this: String,
    /// The newest revision.
    #[schema(example = "/v1/models/lathe-7-winter")]
    newest: String,
    /// How it differs from another: put the other's name behind it.
    #[schema(example = "/v1/models/lathe-7-winter@3/comparison?with=")]
    comparison: String,
    /// The diagnosis that it comes from, while its result is kept; null where it comes from none.
    #[schema(example = "/v1/results/b3:5d41402abc4b2a76b9719d911017c5925d41402abc4b2a76b9719d911017c592")]
    diagnosis: Option<String>,
}

/// A page of models.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ModelList {
    /// The newest revision of each, by name.
    items: Vec<ModelDocument>,
    /// Address of the next page; null on the last.
    #[schema(example = "/v1/models?limit=50&after=lathe-7-winter")]
    next: Option<String>,
}

/// What may be stored under a name: a diagnosis by its result or its job, or an exported model.
#[derive(Debug, ToSchema)]
#[allow(dead_code)] // the contract of a body that the engine reads
#[schema(as = ModelSource)]
pub(super) struct SourceDocument {
    /// Address of the kept result of a diagnosis.
    #[schema(pattern = "^b3:[0-9a-f]{64}$", nullable = false)]
    from_result: Option<String>,
    /// Id of a job that was a diagnosis.
    #[schema(nullable = false)]
    from_job: Option<String>,
    /// Of an exported model: whose jobs it extends.
    #[schema(example = "deflection-compensation", nullable = false)]
    calculator: Option<String>,
    /// Of an exported model: its effects.
    #[schema(value_type = Option<Vec<Object>>, nullable = false)]
    effects: Option<Vec<Value>>,
    /// Of an exported model: where it comes from.
    #[schema(value_type = Option<Object>)]
    provenance: Option<Value>,
    /// Of an exported model: its hash, which must fit.
    #[schema(nullable = false)]
    sha256: Option<String>,
    /// Of an exported model; not used.
    #[schema(nullable = false)]
    name: Option<String>,
    /// Of an exported model; not used.
    #[schema(nullable = false)]
    revision: Option<u32>,
    /// Of an exported model; not used.
    #[schema(nullable = false)]
    created_at: Option<String>,
    /// Of an exported model; not used.
    #[schema(value_type = Option<Object>, nullable = false)]
    links: Option<Value>,
}

fn document(model: StoredModel) -> ModelDocument {
    let created_at = jiff::Timestamp::from_millisecond(model.created_ms).unwrap_or_default();
    let diagnosis = model.content.provenance.get("diagnosis").and_then(Value::as_str);
    ModelDocument {
        links: ModelLinks {
            this: format!("/v1/models/{}@{}", model.name, model.revision),
            newest: format!("/v1/models/{}", model.name),
            comparison: format!("/v1/models/{}@{}/comparison?with=", model.name, model.revision),
            diagnosis: diagnosis.map(|key| format!("/v1/results/{key}")),
        },
        name: model.name,
        revision: model.revision,
        calculator: model.content.calculator,
        sha256: model.sha256,
        created_at: format!("{created_at:.3}"),
        effects: model.content.effects,
        provenance: model.content.provenance,
    }
}

fn answered(status: StatusCode, value: &impl Serialize) -> Response {
    let body = serde_json::to_vec(value).expect("models have only finite numbers and words");
    let mut response = Response::new(body.into());
    *response.status_mut() = status;
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("application/json"));
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

/// `GET /v1/models`
pub(super) async fn list(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    uri: Uri,
) -> Result<Response, Problem> {
    let mut query = Query::of(&uri, &["limit", "after"])?;
    let limit = query.limit()?;
    let shelf = caller.shelf();
    let models = app.engine.models(&shelf, query.text("after").unwrap_or_default(), limit + 1).await?;
    let (models, more) = page(models, limit);
    let next = models.last().filter(|_| more).map(|last| format!("/v1/models?limit={limit}&after={}", last.name));
    Ok(answered(StatusCode::OK, &ModelList { items: models.into_iter().map(document).collect(), next }))
}

/// `GET /v1/models/{name}`
pub(super) async fn read(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
) -> Result<Response, Problem> {
    Ok(answered(StatusCode::OK, &document(app.engine.model(&caller.shelf(), &name).await?)))
}

/// `GET /v1/models/{name}/comparison`
pub(super) async fn compare(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    uri: Uri,
) -> Result<Response, Problem> {
    let with = Query::of(&uri, &["with"])?.needed("with")?;
    Ok(answered(StatusCode::OK, &app.engine.compare_models(&caller.shelf(), &name, &with).await?))
}

/// `PUT /v1/models/{name}`
pub(super) async fn store(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    request: Request,
) -> Result<Response, Problem> {
    let only_new = wants_new(request.headers());
    let owner = gate::owner(&caller, &request);
    let limits = Limits { json_bytes: app.limits.json_bytes.min(MOST_BYTES), ..app.limits.clone() };
    let sent = body::job(request, || false, &limits, app.engine.bodies()).await?;
    let Body::Json(sent) = sent else { return Err(Problem::internal()) };
    let source = ModelSource::read(&sent)?;
    match &source {
        ModelSource::Result(key) => drop(results::named(&app, &caller, &key.to_string()).await?),
        ModelSource::Job(id) => drop(jobs::named(&app, &caller, &id.to_string()).await?),
        ModelSource::Exported { .. } => {}
    }
    let ModelAnswer { model, is_new } = app.engine.put_model(&caller.shelf(), &name, source, (only_new, owner)).await?;
    let location = format!("/v1/models/{}@{}", model.name, model.revision);
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    let mut response = answered(status, &document(model));
    let location = HeaderValue::try_from(location).expect("a name is visible ASCII");
    response.headers_mut().insert(LOCATION, location);
    Ok(response)
}

/// `If-None-Match: *`
fn wants_new(headers: &HeaderMap) -> bool {
    headers.get_all(IF_NONE_MATCH).iter().any(|tag| tag.as_bytes() == b"*")
}

/// `DELETE /v1/models/{name}`
pub(super) async fn delete(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
) -> Result<Response, Problem> {
    app.engine.delete_model(&caller.shelf(), &name).await?;
    let mut response = Response::new(HttpBody::empty());
    *response.status_mut() = StatusCode::NO_CONTENT;
    Ok(response)
}

impl From<ModelError> for Problem {
    fn from(error: ModelError) -> Self {
        match error {
            ModelError::Unknown { name, nearest } => {
                let problem = Self::missing("unknown_model", &name);
                match nearest {
                    Some(nearest) => problem.with("nearest", nearest),
                    None => problem,
                }
            }
            ModelError::Exists(name) => Self::new(StatusCode::PRECONDITION_FAILED, "model_exists").with("name", name),
            ModelError::OfProcess(name) => Self::new(StatusCode::CONFLICT, "model_of_process").with("name", name),
            ModelError::Invalid(findings) => Self::invalid_model(findings),
            ModelError::UnknownResult(key) => {
                Self::new(StatusCode::NOT_FOUND, "unknown_result").with("key", key.to_string())
            }
            ModelError::Other(error) => error.into(),
        }
    }
}
