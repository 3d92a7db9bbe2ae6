//! Kept results: listed, and read again without computing.

use std::collections::HashMap;
use std::str::FromStr;
use std::sync::Arc;

use axum::Extension;
use axum::extract::{Path, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_LANGUAGE, HeaderValue, VARY};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::{IntoResponse, Json, Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::answer::{self, View};
use super::auth::Caller;
use super::problem::Problem;
use super::query::Query;
use super::{App, CACHE_STATE, negotiate};
use crate::engine::{Key, Stored, Summary};
use crate::store::{Cursor, ResultPage, ResultQuery, ResultSummary};
use crate::text::{Language, told};

/// A page of kept results.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ResultList {
    /// The results, newest first.
    items: Vec<ResultItem>,
    /// Address of the next page; null on the last.
    #[schema(example = "/v1/results?limit=50&after=1769941200123-8f14e45fceea167a5a36dedd4bea2543")]
    next: Option<String>,
}

/// A kept result in a list.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ResultItem {
    /// The address of its content.
    #[schema(pattern = "^b3:[0-9a-f]{64}$")]
    key: String,
    /// Which calculator made it.
    #[schema(example = "deflection-compensation")]
    calculator: String,
    /// Which version of the calculator.
    #[schema(minimum = 0, example = 1)]
    version: u32,
    /// Which version of the engine.
    #[schema(example = "0.1.0")]
    engine: String,
    /// What was computed: whose job it was and its main numbers, in the language asked for; null where the job is not
    /// readable or too large to be read for a list.
    #[schema(example = "Diameter 90 mm · length 2000 mm · feed 0.5 mm/rev")]
    summary: Option<String>,
    /// What it takes in the database, bytes.
    #[schema(minimum = 0, example = 18230)]
    bytes: u64,
    /// When it was computed, UTC.
    #[schema(format = DateTime, example = "2026-02-03T10:15:00.123Z")]
    created_at: String,
    /// Where to go from here.
    links: ResultLinks,
}

/// Addresses of a kept result.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ResultLinks {
    /// The answer itself.
    #[serde(rename = "self")]
    this: String,
}

/// `GET /v1/results`
pub(super) async fn list(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let mut query = Query::of(&uri, &["calculator", "record", "limit", "after"])?;
    let limit = query.limit()?;
    let after = query.after::<Cursor>()?;
    let calculator = query.calculator(&app.engine)?;
    let record = query.record()?;
    let filter = [("calculator", &calculator), ("record", &record)]
        .into_iter()
        .filter_map(|(name, value)| Some(format!("&{name}={}", value.as_ref()?)))
        .collect::<String>();
    let query = ResultQuery { calculator, owner: caller.shown(), record, limit: Some(limit), after };
    let page = app.engine.results(query).await?;
    let asked: Vec<_> = page.items.iter().map(|item| (item.key, item.calculator.clone())).collect();
    let summaries = app.engine.summaries(&asked).await;
    let language = negotiate::language(&headers);
    let list = page_of(page, &summaries, language, &format!("limit={limit}{filter}"));
    let headers =
        [(CACHE_CONTROL, "no-store"), (CONTENT_LANGUAGE, language.tag()), (VARY, "Accept-Language, Accept-Encoding")];
    Ok((headers, Json(list)).into_response())
}

/// `GET /v1/results/{key}`
pub(super) async fn read(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let stored = named(&app, &caller, &name).await?;
    let meta = stored.entry().meta();
    let view = View::of(&uri, &headers, meta, &answer::offered(meta))?;
    let mut response = answer::respond(stored, view, &headers).await?;
    response.headers_mut().insert(CACHE_STATE, HeaderValue::from_static("hit"));
    Ok(response)
}

/// The result that an address names, if the caller has asked for it: another is as good as none.
pub(super) async fn named(app: &App, caller: &Caller, name: &str) -> Result<Arc<Stored>, Problem> {
    let key = visible(app, caller, name).await?;
    app.engine.result(&key).await?.ok_or_else(|| absent(name))
}

/// The key that an address names, if the caller has asked for its result.
pub(super) async fn visible(app: &App, caller: &Caller, name: &str) -> Result<Key, Problem> {
    let key = Key::from_str(name).map_err(|_| Problem::new(StatusCode::BAD_REQUEST, "bad_key"))?;
    match caller.shown() {
        Some(owner) if !app.engine.has_asked(&key, &owner).await? => Err(absent(name)),
        _ => Ok(key),
    }
}

pub(super) fn absent(name: &str) -> Problem {
    Problem::new(StatusCode::NOT_FOUND, "unknown_result").with("key", name.to_owned())
}

fn page_of(page: ResultPage, summaries: &HashMap<Key, Summary>, language: Language, asked: &str) -> ResultList {
    let said = |item: &ResultSummary| summaries.get(&item.key).map(|marks| told(language, marks));
    ResultList {
        next: page.next.map(|next| format!("/v1/results?{asked}&after={next}")),
        items: page.items.into_iter().map(|one| item(said(&one), one)).collect(),
    }
}

fn item(summary: Option<String>, result: ResultSummary) -> ResultItem {
    let created_at = jiff::Timestamp::from_millisecond(result.created_ms).unwrap_or_default();
    ResultItem {
        key: result.key.to_string(),
        links: ResultLinks { this: format!("/v1/results/{}", result.key) },
        calculator: result.calculator,
        version: result.version,
        engine: result.engine,
        summary,
        bytes: result.bytes,
        created_at: format!("{created_at:.3}"),
    }
}
