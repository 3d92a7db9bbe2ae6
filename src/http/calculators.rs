//! The rooms: each calculator's own route, and what the service says of it.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::extract::{Path, Request, State};
use axum::http::HeaderMap;
use axum::http::header::{ACCEPT, IF_NONE_MATCH};
use axum::response::{IntoResponse, Response};
use precut_calc::calculator::{CalculatorKind, Meta};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::answer::{self, Parts, View};
use super::auth::Caller;
use super::jobs;
use super::metrics::CacheCounters;
use super::negotiate::{self, Media};
use super::prefer::{self, Preference};
use super::problem::Problem;
use super::query::Query;
use super::{App, body, gate, quota};
use crate::engine::{Answered, Ask, CacheState, Error, Priority};
use crate::registry::{Entry, Registry, takes_names};
use crate::text::{self, Glossary, Language};
use crate::trace::TraceContext;

/// A calculator with what its route needs on every request.
pub(super) struct Room {
    entry: Arc<Entry>,
    offered: Vec<Media>,
    counters: CacheCounters,
}

impl Room {
    pub(super) fn new(entry: &Arc<Entry>) -> Self {
        let meta = entry.meta();
        Self { entry: entry.clone(), offered: answer::offered(meta), counters: CacheCounters::new(meta.id) }
    }

    pub(super) fn id(&self) -> &'static str {
        self.entry.meta().id
    }
}

/// Longest deadline, s: a year.
pub(super) const MOST_DEADLINE_S: f64 = 31_536_000.0;
/// Shortest deadline, s.
pub(super) const LEAST_DEADLINE_S: f64 = 0.001;

/// Of a request for an answer: which part of it, and how it is to be computed.
const PARAMETERS: &[&str] = &["table", "figure", "include", "priority", "deadline_s", "callback"];

/// `POST /v1/{calculator}`
pub(super) async fn solve(app: App, room: Arc<Room>, request: Request) -> Response {
    let caller = request.extensions().get::<Caller>().cloned().unwrap_or(Caller::Stranger);
    let owner = gate::owner(&caller, &request);
    let outcome = answered(&app, &room, request, (&caller, owner.clone())).await;
    match app.engine.standing(&owner).await {
        Ok(None) => outcome.into_response(),
        Ok(Some(standing)) => quota::told(outcome, &standing),
        Err(error) => {
            tracing::debug!(%error, "it is not told how an owner stands with his quotas");
            outcome.into_response()
        }
    }
}

async fn answered(
    app: &App,
    room: &Room,
    request: Request,
    (caller, owner): (&Caller, String),
) -> Result<Response, Problem> {
    let mut query = Query::of(request.uri(), PARAMETERS)?;
    let priority = query.one_of("priority", Priority::ALL, Priority::word)?;
    let deadline_s = query.number("deadline_s", &(LEAST_DEADLINE_S..=MOST_DEADLINE_S))?;
    let callback = query.text("callback").map(|url| app.callbacks.checked(url)).transpose()?;
    let trace = request.extensions().get::<TraceContext>();
    let (traceparent, tracestate) = (trace.map(TraceContext::traceparent), trace.and_then(TraceContext::tracestate));
    let headers = request.headers();
    let view = View::of_parts(Parts::of(&mut query)?, headers, room.entry.meta(), &room.offered)?;
    let mut preference = Preference::of(headers);
    // Those who wait are requests in work: they leave room for those who do not.
    let waiting = preference.wait_s.map(|_| Waiting::new(app));
    if waiting.as_ref().is_some_and(|waiting| waiting.is_too_many) {
        preference.wait_s = Some(0);
    }
    let ask = Ask {
        priority: priority.unwrap_or(Priority::Normal),
        deadline: deadline_s.map(Duration::from_secs_f64),
        idempotency_key: prefer::idempotency_key(headers)?,
        wait: preference.wait(),
        shelf: caller.shelf(),
        callback,
        traceparent,
        tracestate,
        ..Ask::plain(owner)
    };
    let language = negotiate::language(headers);
    let mut condition = HeaderMap::new();
    for tag in headers.get_all(IF_NONE_MATCH) {
        condition.append(IF_NONE_MATCH, tag.clone());
    }
    let job = body::job(request, || room.entry.takes_files(), &app.limits, app.engine.bodies()).await?;
    let solved = match app.engine.submit(room.id(), job, ask).await? {
        Answered::Solved(solved) => solved,
        Answered::Job(job) => return Ok(jobs::accepted(&job, preference, language)),
    };
    if let Some(owner) = caller.owner() {
        // The answer is there, whether or not there is room to note whose it is.
        let noted = app.engine.note_asked(&solved.stored.key, &owner, solved.cache).await;
        noted.unwrap_or_else(|error| tracing::warn!(%error, "it is not noted who asked for an answer"));
    }
    match solved.cache {
        CacheState::Hit => room.counters.hit.increment(1),
        CacheState::Miss => room.counters.miss.increment(1),
    }
    let mut response = answer::respond(solved.stored.clone(), view, &condition).await?;
    answer::describe(&mut response, &solved.stored, solved.cache, &solved.timings);
    if preference.wait_s.is_some() && solved.cache == CacheState::Miss {
        jobs::apply(&mut response, Preference { respond_async: false, ..preference });
    }
    Ok(response)
}

/// Counts a request that may wait for a job while it lives.
struct Waiting<'a> {
    app: &'a App,
    is_too_many: bool,
}

impl<'a> Waiting<'a> {
    fn new(app: &'a App) -> Self {
        let before = app.waiting.fetch_add(1, Ordering::Relaxed);
        Self { app, is_too_many: before >= app.limits.concurrent_requests.div_ceil(2) }
    }
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.app.waiting.fetch_sub(1, Ordering::Relaxed);
    }
}

/// `GET /v1/calculators`
pub(super) async fn list(State(app): State<App>, headers: HeaderMap) -> Response {
    app.documents.calculators(negotiate::language(&headers)).respond(&headers)
}

/// `GET /v1/calculators/{id}`
pub(super) async fn describe(
    State(app): State<App>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    match app.documents.calculator(&id, negotiate::language(&headers)) {
        Some(document) => Ok(document.respond(&headers)),
        None => Err(Error::unknown(app.engine.registry(), &id).into()),
    }
}

/// What jobs of a calculator may name.
fn record_kinds(calculator: &str) -> Vec<&'static str> {
    use precut_library::Kind;
    Kind::NAMED.into_iter().filter(|kind| takes_names(calculator, *kind)).map(Kind::name).collect()
}

/// Every calculator of the service.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct CalculatorList {
    /// The calculators, in the order in which they are offered.
    items: Vec<CalculatorSummary>,
    /// Address of the next page; always null: the list is complete.
    next: Option<String>,
    /// Version of the engine's own records of machines, tools and materials; grows with every changed number.
    #[schema(minimum = 1, example = 1)]
    data_version: u32,
}

/// A calculator in a list.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct CalculatorSummary {
    /// Name in routes and job files.
    #[schema(example = "deflection-compensation")]
    id: &'static str,
    /// A full calculator, or an evaluation of data.
    kind: Kind,
    /// Rises whenever the numbers of an unchanged job may change.
    #[schema(minimum = 0, example = 1)]
    version: u32,
    /// A few words.
    #[schema(example = "Deflection compensation")]
    title: &'static str,
    /// The question that it answers.
    question: &'static str,
    /// What comes in, what comes out, by which physics.
    summary: &'static str,
    /// Its example jobs.
    examples: Vec<ExampleSummary>,
    /// Where to go from here.
    links: CalculatorLinks,
}

/// What kind of question a calculator answers.
#[derive(Debug, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = CalculatorKind)]
enum Kind {
    /// Predicts and decides from a model.
    Calculator,
    /// Evaluates data that the user brings.
    Evaluation,
}

/// An example job by name.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ExampleSummary {
    /// Name of the example.
    id: &'static str,
    /// What it shows.
    title: &'static str,
}

/// Addresses of a calculator.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct CalculatorLinks {
    /// Its description with the schema.
    #[serde(rename = "self")]
    #[schema(example = "/v1/calculators/deflection-compensation")]
    this: String,
    /// Where its jobs are posted.
    #[schema(example = "/v1/deflection-compensation")]
    solve: String,
}

/// A calculator with everything that a form or a client needs.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct CalculatorDescription {
    #[serde(flatten)]
    summary: CalculatorSummary,
    /// Where the formulas come from.
    references: &'static [&'static str],
    /// Media types of its answers, to be named in `Accept`.
    media_types: Vec<&'static str>,
    /// Values of `?table=`; the first is the default.
    tables: &'static [&'static str],
    /// Values of `?figure=`; the first is the default.
    figures: &'static [&'static str],
    /// Whether measured tables may come as files in `multipart/form-data`.
    takes_tables: bool,
    /// What its jobs may name: `machine`, `tool`, `material`; `GET /v1/machines` and the like list them.
    records: Vec<&'static str>,
    /// Pointers into the result that a parameter study shows unless asked for others.
    study_outputs: &'static [&'static str],
    /// Codes of its messages, warnings and faults.
    codes: Vec<&'static str>,
    /// What its figures and tables are called, by their names.
    #[schema(value_type = Object)]
    labels: Value,
    /// JSON Schema (2020-12) of the job in the language asked for: `title` is the label of a field, `description` its
    /// help, `x-labels` what the words of an `enum` are called, `x-unit-label` and `x-group-label` the printed unit and
    /// the part of the form.
    #[schema(value_type = Object)]
    input_schema: Value,
    /// JSON Schema (2020-12) of the result, with the same labels.
    #[schema(value_type = Object)]
    output_schema: Value,
    /// The examples' jobs, ready to be posted, by name.
    #[schema(value_type = Object)]
    jobs: Value,
}

/// The list of calculators.
pub(super) fn listed(registry: &Registry, language: Language) -> CalculatorList {
    CalculatorList {
        items: registry.entries().iter().map(|entry| summary(entry.meta(), language)).collect(),
        next: None,
        data_version: precut_library::built_in::DATA_VERSION,
    }
}

/// A calculator's description.
pub(super) fn described(entry: &Entry, language: Language) -> CalculatorDescription {
    let meta = entry.meta();
    let jobs = meta
        .examples
        .iter()
        .map(|example| (example.id.to_owned(), serde_json::from_str(example.job).expect("a test runs every example")));
    CalculatorDescription {
        summary: summary(meta, language),
        references: meta.references,
        media_types: answer::offered(meta).into_iter().map(Media::essence).collect(),
        tables: meta.tables,
        figures: meta.figures,
        takes_tables: entry.takes_tables(),
        records: record_kinds(meta.id),
        study_outputs: meta.study_outputs,
        codes: meta.codes.all().collect(),
        labels: labels(meta, language),
        input_schema: text::described(&entry.input_document(), meta.id, language),
        output_schema: text::described(&entry.output_document(), meta.id, language),
        jobs: Value::Object(jobs.collect()),
    }
}

fn labels(meta: &Meta, language: Language) -> Value {
    let glossary = Glossary::of(language);
    let ids = meta.figures.iter().chain(meta.tables);
    Value::Object(ids.map(|id| ((*id).to_owned(), glossary.word(id).into())).collect())
}

fn summary(meta: &Meta, language: Language) -> CalculatorSummary {
    let said = |english| Glossary::of(language).help(english);
    CalculatorSummary {
        id: meta.id,
        kind: match meta.kind {
            CalculatorKind::Calculator => Kind::Calculator,
            CalculatorKind::Evaluation => Kind::Evaluation,
        },
        version: meta.version,
        title: said(meta.title),
        question: said(meta.question),
        summary: said(meta.summary),
        examples: meta
            .examples
            .iter()
            .map(|example| ExampleSummary { id: example.id, title: said(example.title) })
            .collect(),
        links: CalculatorLinks { this: format!("/v1/calculators/{}", meta.id), solve: format!("/v1/{}", meta.id) },
    }
}

/// Whether the client would rather have a page than JSON.
pub(super) fn wants_page(headers: &HeaderMap) -> bool {
    headers
        .get_all(ACCEPT)
        .iter()
        .filter_map(|line| line.to_str().ok())
        .any(|line| line.to_ascii_lowercase().contains("text/html"))
}
