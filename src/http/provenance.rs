//! Where an answer comes from: which versions made it, of which model, for which jobs of whom. A line of a program
//! (`result b3:...`) is traced back with it.

use std::collections::BTreeMap;

use axum::Extension;
use axum::extract::{Path, State};
use axum::http::HeaderMap;
use axum::response::Response;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::App;
use super::auth::Caller;
use super::document::Document;
use super::parts::private;
use super::problem::Problem;
use super::results::{absent, visible};
use crate::engine::{Job, JobQuery, JobState, Key, Stored};
use crate::store::Origin;

/// Most jobs that are told of one answer.
const MOST_JOBS: u32 = 100;

/// Where an answer comes from.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Provenance {
    /// The address of its content, as it stands in programs.
    #[schema(pattern = "^b3:[0-9a-f]{64}$")]
    key: String,
    /// Which calculator made it.
    #[schema(example = "deflection-compensation")]
    calculator: String,
    /// Which version of the calculator; null where the answer is kept no longer.
    #[schema(minimum = 0, example = 7)]
    version: Option<u32>,
    /// Which version of the engine; null where the answer is kept no longer.
    #[schema(example = "0.1.0")]
    engine: Option<String>,
    /// When it was computed, UTC; null where the answer is kept no longer, or not on the disk yet.
    #[schema(format = DateTime, example = "2026-02-03T10:15:00.123Z")]
    computed_at: Option<String>,
    /// The stored model that took part; null where none did.
    model: Option<ModelOrigin>,
    /// The machine, tool and material that took part, by what they are; none where none was named.
    resources: BTreeMap<String, RecordOrigin>,
    /// The jobs that came to it and may be seen by who asks, newest first, at most 100.
    #[schema(max_items = 100)]
    jobs: Vec<JobOrigin>,
    /// The owners of keys who had it as a direct answer, as far as who asks may see them; at most 100.
    #[schema(max_items = 100)]
    asked_by: Vec<String>,
    /// Where to go from here.
    links: ProvenanceLinks,
}

/// A model that took part in an answer.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
pub(super) struct ModelOrigin {
    /// Its name on the shelf of who asked first.
    #[schema(example = "lathe-7-winter")]
    name: String,
    /// Its revision, which never changes.
    #[schema(minimum = 1)]
    revision: u32,
    /// Hash of its content.
    sha256: String,
}

/// A machine, tool or material that took part in an answer.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
pub(super) struct RecordOrigin {
    /// Its name; of an own one, on the shelf of who asked first.
    #[schema(example = "lathe-3")]
    name: String,
    /// Its revision, which never changes; absent of the engine's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    revision: Option<u32>,
    /// True of the engine's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    built_in: Option<bool>,
    /// Version of the engine's data; absent of an own one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    data_version: Option<u32>,
    /// Hash of what it says.
    sha256: String,
    /// What the job called it, where that is another of its names.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "4140")]
    asked_as: Option<String>,
}

/// A job that came to an answer.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct JobOrigin {
    /// Its name.
    #[schema(example = "0198c5f1-8a3e-7c40-b0a1-5e2d9f4c6b7a")]
    id: String,
    /// The owner of the key that sent it; null where the service asked for no key.
    #[schema(example = "cam")]
    owner: Option<String>,
    /// When it was accepted, UTC.
    #[schema(format = DateTime)]
    created_at: String,
    /// When it was done, UTC.
    #[schema(format = DateTime)]
    finished_at: Option<String>,
    /// Address of the job.
    #[schema(example = "/v1/jobs/0198c5f1-8a3e-7c40-b0a1-5e2d9f4c6b7a")]
    job: String,
}

/// Addresses of an answer and of what made it.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ProvenanceLinks {
    /// The answer itself; null where it is kept no longer.
    result: Option<String>,
    /// The job with every default filled in; null where the answer is kept no longer.
    job: Option<String>,
    /// The revision of the model, on the shelf of who asks.
    model: Option<String>,
    /// What the calculator is.
    calculator: String,
}

/// `GET /v1/results/{key}/provenance`
pub(super) async fn read(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let key = visible(&app, &caller, &name).await?;
    let stored = app.engine.result(&key).await?;
    let origin = app.engine.origin(&key, caller.shown()).await?;
    let query = JobQuery {
        state: Some(JobState::Succeeded),
        key: Some(key),
        owner: caller.shown(),
        limit: MOST_JOBS,
        ..JobQuery::default()
    };
    let (jobs, _) = app.engine.jobs(query).await?;
    let calculator = match (&stored, jobs.first()) {
        (Some(stored), _) => stored.entry().meta().id.to_owned(),
        (None, Some(job)) => job.record.calculator.clone(),
        (None, None) => return Err(absent(&name)),
    };
    let document = told(key, calculator, stored.as_deref(), &origin, &jobs);
    Ok(private(Document::json(&document, None).respond(&headers)))
}

fn told(key: Key, calculator: String, stored: Option<&Stored>, origin: &Origin, jobs: &[Job]) -> Provenance {
    let time = |ms: i64| format!("{:.3}", jiff::Timestamp::from_millisecond(ms).unwrap_or_default());
    let said = |name| stored.and_then(|stored| stored.said(name));
    let model: Option<ModelOrigin> = said("model").and_then(|model| serde_json::from_str(&model).ok());
    let resources = said("resources").and_then(|resources| serde_json::from_str(&resources).ok()).unwrap_or_default();
    let job = |Job { record, .. }: &Job| JobOrigin {
        id: record.id.to_string(),
        owner: holder(&record.owner),
        created_at: time(record.created_ms),
        finished_at: record.finished_ms.map(time),
        job: format!("/v1/jobs/{}", record.id),
    };
    let address = stored.map(|_| format!("/v1/results/{key}"));
    Provenance {
        key: key.to_string(),
        version: said("version").and_then(|version| version.parse().ok()),
        engine: said("engine"),
        computed_at: origin.created_ms.map(time),
        jobs: jobs.iter().map(job).collect(),
        asked_by: origin.asked_by.iter().filter_map(|owner| holder(owner)).collect(),
        links: ProvenanceLinks {
            job: address.as_ref().map(|address| format!("{address}/job")),
            result: address,
            model: model.as_ref().map(|model| format!("/v1/models/{}@{}", model.name, model.revision)),
            calculator: format!("/v1/calculators/{calculator}"),
        },
        model,
        resources,
        calculator,
    }
}

/// The owner of keys that records name so.
fn holder(owner: &str) -> Option<String> {
    owner.strip_prefix("key:").map(ToOwned::to_owned)
}
