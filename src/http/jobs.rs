//! Jobs: listed, watched, cancelled, and their results.

use axum::Extension;
use axum::extract::{Path, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_LANGUAGE, CONTENT_TYPE, HeaderValue, LOCATION, RETRY_AFTER, VARY};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::Response;
use serde::Serialize;
use utoipa::ToSchema;

use super::App;
use super::answer::{self, View};
use super::auth::Caller;
use super::callbacks::{self, CallbackDocument};
use super::document::Document;
use super::negotiate;
use super::parts::{JobFile, private};
use super::prefer::{PREFERENCE_APPLIED, Preference};
use super::problem::{Problem, ProblemDocument};
use super::query::Query;
use crate::engine::{CacheState, Job, JobQuery, JobState, Priority, Timings};
use crate::text::{Language, Texts, told};

/// A job: what became of a request that is not answered at once.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Job)]
pub(super) struct JobDocument {
    /// Its name.
    #[schema(
        pattern = "^[0-9a-f]{8}-[0-9a-f]{4}-7[0-9a-f]{3}-[0-9a-f]{4}-[0-9a-f]{12}$",
        example = "0198c5f1-8a3e-7c40-b0a1-5e2d9f4c6b7a"
    )]
    id: String,
    /// Which calculator computes it.
    #[schema(example = "deflection-compensation")]
    calculator: String,
    /// How far it is.
    state: Progression,
    /// What it is doing; null unless it runs.
    #[schema(example = "revolution 31 of 96")]
    stage: Option<String>,
    /// How far the computation is.
    #[schema(minimum = 0, maximum = 1, example = 0.32)]
    progress: f64,
    /// Times it was started; more than 1 if a start was cut short. Of a study that gets on, no more than 2 are counted.
    #[schema(minimum = 0, example = 1)]
    attempt: u32,
    /// Which jobs go first.
    priority: Precedence,
    /// Address of its result: equal jobs have equal keys.
    #[schema(pattern = "^b3:[0-9a-f]{64}$")]
    key: String,
    /// When it was accepted, UTC.
    #[schema(format = DateTime, example = "2026-02-03T10:15:00.123Z")]
    created_at: String,
    /// When it was started last.
    #[schema(format = DateTime, example = "2026-02-03T10:15:00.142Z")]
    started_at: Option<String>,
    /// When it ended.
    #[schema(format = DateTime)]
    finished_at: Option<String>,
    /// When it is of no use any more: `deadline_s` after it was accepted.
    #[schema(format = DateTime)]
    deadline_at: Option<String>,
    /// Until when its result is kept.
    #[schema(format = DateTime)]
    expires_at: Option<String>,
    /// Work expected when it was accepted, ms.
    #[schema(minimum = 0, example = 4200.0, extensions(("x-unit" = json!("ms"))))]
    estimate_ms: f64,
    /// Time left, ms; null unless it runs.
    #[schema(minimum = 0, example = 2900.0, extensions(("x-unit" = json!("ms"))))]
    remaining_ms: Option<f64>,
    /// Where to go from here.
    links: JobLinks,
    /// Why it failed.
    problem: Option<ProblemDocument>,
    /// Who is told when it is over, as `callback` asked for it; null where nobody is.
    callback: Option<CallbackDocument>,
    /// Where it belongs in a trace (W3C Trace Context), if the request that made it did.
    #[schema(example = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01")]
    traceparent: Option<String>,
}

/// How far a job is.
#[derive(Debug, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = JobState)]
enum Progression {
    /// It waits.
    Queued,
    /// It is computed.
    Running,
    /// It has its result.
    Succeeded,
    /// It has none, and `problem` says why.
    Failed,
    /// Nobody wants it any more.
    Cancelled,
}

/// Which jobs go first.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = Priority)]
pub(super) enum Precedence {
    /// When nothing else waits.
    Low,
    /// As all others.
    Normal,
    /// Before all others.
    High,
}

/// Addresses of a job.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct JobLinks {
    /// The job itself.
    #[serde(rename = "self")]
    #[schema(example = "/v1/jobs/0198c5f1-8a3e-7c40-b0a1-5e2d9f4c6b7a")]
    this: String,
    /// What was asked, as a job file.
    input: String,
    /// Its result.
    result: String,
    /// Its server-sent events.
    events: String,
    /// Where a `DELETE` cancels it.
    cancel: String,
}

/// A page of jobs.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct JobList {
    /// The jobs, newest first.
    items: Vec<ListedJob>,
    /// Address of the next page; null on the last.
    #[schema(example = "/v1/jobs?limit=50&after=0198c5f1-8a3e-7c40-b0a1-5e2d9f4c6b7a")]
    next: Option<String>,
}

/// A job in a list.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ListedJob {
    #[serde(flatten)]
    job: JobDocument,
    /// What is computed: whose job it is and its main numbers, in the language asked for; null where the job has
    /// expired or is too large to be read for a list.
    #[schema(example = "Diameter 90 mm · length 2000 mm · feed 0.5 mm/rev")]
    summary: Option<String>,
}

/// The job in words.
pub(super) fn document(job: &Job, language: Language) -> JobDocument {
    let record = &job.record;
    let id = record.id;
    let time = |ms: i64| format!("{:.3}", jiff::Timestamp::from_millisecond(ms).unwrap_or_default());
    let finite = |number: f64| if number.is_finite() { number } else { 0.0 };
    JobDocument {
        id: id.to_string(),
        calculator: record.calculator.clone(),
        state: match record.state {
            JobState::Queued => Progression::Queued,
            JobState::Running => Progression::Running,
            JobState::Succeeded => Progression::Succeeded,
            JobState::Failed => Progression::Failed,
            JobState::Cancelled => Progression::Cancelled,
        },
        stage: job.stage.as_ref().map(|stage| Texts::shared().message(language, "stage", stage)),
        progress: finite(job.progress),
        attempt: record.attempt,
        priority: match record.priority {
            Priority::Low => Precedence::Low,
            Priority::Normal => Precedence::Normal,
            Priority::High => Precedence::High,
        },
        key: record.key.to_string(),
        created_at: time(record.created_ms),
        started_at: record.started_ms.map(time),
        finished_at: record.finished_ms.map(time),
        deadline_at: record.deadline_ms.map(time),
        expires_at: record.expires_ms.map(time),
        estimate_ms: finite(record.estimate_ms),
        remaining_ms: job.remaining_ms.filter(|ms| ms.is_finite()),
        links: JobLinks {
            this: format!("/v1/jobs/{id}"),
            input: format!("/v1/jobs/{id}/job"),
            result: format!("/v1/jobs/{id}/result"),
            events: format!("/v1/jobs/{id}/events"),
            cancel: format!("/v1/jobs/{id}"),
        },
        problem: job.problem.clone().map(|problem| Problem::from(problem).document(language, None)),
        callback: record.callback.as_ref().map(|callback| callbacks::document(callback, time)),
        traceparent: record.traceparent.clone(),
    }
}

/// A job as a response.
fn answered(job: &Job, status: StatusCode, language: Language) -> Response {
    let body = serde_json::to_vec(&document(job, language)).expect("a job has only finite numbers and words");
    let mut response = Response::new(body.into());
    *response.status_mut() = status;
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/json"));
    headers.insert(CONTENT_LANGUAGE, HeaderValue::from_static(language.tag()));
    headers.insert(VARY, HeaderValue::from_static("Accept-Language, Accept-Encoding"));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    if !job.record.state.is_final() {
        headers.insert(RETRY_AFTER, HeaderValue::from(job.retry_after().as_secs().max(1)));
    }
    response
}

/// The answer to a request that became a job.
pub(super) fn accepted(job: &Job, preference: Preference, language: Language) -> Response {
    let mut response = answered(job, StatusCode::ACCEPTED, language);
    let location = HeaderValue::try_from(format!("/v1/jobs/{}", job.record.id)).expect("an id is visible ASCII");
    response.headers_mut().insert(LOCATION, location);
    apply(&mut response, preference);
    response
}

/// Says which preferences were followed.
pub(super) fn apply(response: &mut Response, preference: Preference) {
    if let Some(applied) = preference.applied() {
        let applied = HeaderValue::try_from(applied).expect("preferences are words and numbers");
        response.headers_mut().insert(PREFERENCE_APPLIED, applied);
    }
}

/// `GET /v1/jobs`
pub(super) async fn list(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let mut query = Query::of(&uri, &["state", "calculator", "limit", "after"])?;
    let limit = query.limit()?;
    let state = query.one_of("state", JobState::ALL, JobState::word)?;
    let before = query.after()?;
    let calculator = query.calculator(&app.engine)?;
    let (jobs, next) = app
        .engine
        .jobs(JobQuery { state, calculator: calculator.clone(), owner: caller.shown(), key: None, limit, before })
        .await?;
    let filter = state.map(|state| format!("&state={}", state.word())).unwrap_or_default()
        + &calculator.map(|id| format!("&calculator={id}")).unwrap_or_default();
    let language = negotiate::language(&headers);
    let asked: Vec<_> =
        jobs.iter().map(|Job { record, .. }| (record.id, record.key, record.calculator.clone())).collect();
    let summaries = app.engine.job_summaries(&asked).await;
    let listed = |job: &Job| ListedJob {
        job: document(job, language),
        summary: summaries.get(&job.record.key).map(|marks| told(language, marks)),
    };
    let list = JobList {
        items: jobs.iter().map(listed).collect(),
        next: next.map(|next| format!("/v1/jobs?limit={limit}{filter}&after={next}")),
    };
    let body = serde_json::to_vec(&list).expect("jobs have only finite numbers and words");
    let mut response = Response::new(body.into());
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/json"));
    headers.insert(CONTENT_LANGUAGE, HeaderValue::from_static(language.tag()));
    headers.insert(VARY, HeaderValue::from_static("Accept-Language, Accept-Encoding"));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok(response)
}

/// The job that an address names, if the caller may see it: one of another owner is as good as none.
pub(super) async fn named(app: &App, caller: &Caller, id: &str) -> Result<Job, Problem> {
    let absent = || Problem::missing("unknown_job", id);
    let job = app.engine.job(id.parse().map_err(|_| absent())?).await?;
    if caller.sees(&job.record.owner) { Ok(job) } else { Err(absent()) }
}

/// `GET /v1/jobs/{id}`
pub(super) async fn read(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let job = named(&app, &caller, &id).await?;
    Ok(answered(&job, StatusCode::OK, negotiate::language(&headers)))
}

/// `GET /v1/jobs/{id}/job`
pub(super) async fn input(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (record, input) = app.engine.job_input(named(&app, &caller, &id).await?.record.id).await?;
    let job = serde_json::from_slice(&input).map_err(|_| Problem::internal())?;
    let document = Document::json(&JobFile { calculator: record.calculator, job }, None);
    Ok(private(document.respond(&headers)))
}

/// `DELETE /v1/jobs/{id}`
pub(super) async fn cancel(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (job, before) = app.engine.cancel(named(&app, &caller, &id).await?.record.id).await?;
    let status = if before == JobState::Running { StatusCode::ACCEPTED } else { StatusCode::OK };
    Ok(answered(&job, status, negotiate::language(&headers)))
}

/// `GET /v1/jobs/{id}/result`
pub(super) async fn result(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(id): Path<String>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let stored = app.engine.job_result(named(&app, &caller, &id).await?.record.id).await?;
    let meta = stored.entry().meta();
    let view = View::of(&uri, &headers, meta, &answer::offered(meta))?;
    let mut response = answer::respond(stored.clone(), view, &headers).await?;
    answer::describe(&mut response, &stored, CacheState::Hit, &Timings::default());
    Ok(response)
}
