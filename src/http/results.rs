//! Kept results: listed, and read again without computing.

use std::str::FromStr;
use std::sync::Arc;

use axum::extract::{Path, Query, State};
use axum::http::header::{CACHE_CONTROL, HeaderValue};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::{IntoResponse, Json, Response};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::answer::{self, View};
use super::problem::Problem;
use super::{App, CACHE_STATE};
use crate::engine::{Error, Key, Stored};
use crate::store::{Cursor, ResultPage, ResultQuery, ResultSummary};

/// Most results of one page.
pub(super) const MOST_ITEMS: u32 = 500;
/// Results of one page unless asked for more or fewer.
pub(super) const DEFAULT_ITEMS: u32 = 50;

/// The query of the list.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ListQuery {
    calculator: Option<String>,
    limit: Option<u32>,
    after: Option<String>,
}

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
pub(super) async fn list(State(app): State<App>, uri: Uri) -> Result<Response, Problem> {
    let Query(query) = Query::<ListQuery>::try_from_uri(&uri).map_err(|error| Problem::query(error.body_text()))?;
    let limit = query.limit.unwrap_or(DEFAULT_ITEMS);
    if !(1..=MOST_ITEMS).contains(&limit) {
        return Err(Problem::query(format!("limit {limit} is not between 1 and {MOST_ITEMS}")));
    }
    if let Some(id) = &query.calculator
        && app.engine.entry(id).is_none()
    {
        return Err(Error::unknown(app.engine.registry(), id).into());
    }
    let after = query.after.as_deref().map(|text| {
        text.parse::<Cursor>().map_err(|_| Problem::query("after: take it from `next` of the page before".to_owned()))
    });
    let after = after.transpose()?;
    let page =
        app.engine.results(ResultQuery { calculator: query.calculator.clone(), limit: Some(limit), after }).await?;
    let list = page_of(page, limit, query.calculator.as_deref());
    Ok(([(CACHE_CONTROL, "no-store")], Json(list)).into_response())
}

/// `GET /v1/results/{key}`
pub(super) async fn read(
    State(app): State<App>,
    Path(name): Path<String>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let key = Key::from_str(&name).map_err(|_| Problem::new(StatusCode::BAD_REQUEST, "bad_key"))?;
    let absent = || Problem::new(StatusCode::NOT_FOUND, "unknown_result").with("key", name.clone());
    let stored: Arc<Stored> = app.engine.result(&key).await?.ok_or_else(absent)?;
    let meta = stored.entry().meta();
    let view = View::of(&uri, &headers, meta, &answer::offered(meta))?;
    let mut response = answer::respond(stored, view, &headers).await?;
    response.headers_mut().insert(CACHE_STATE, HeaderValue::from_static("hit"));
    Ok(response)
}

fn page_of(page: ResultPage, limit: u32, calculator: Option<&str>) -> ResultList {
    let filter = calculator.map(|id| format!("&calculator={id}")).unwrap_or_default();
    ResultList {
        next: page.next.map(|next| format!("/v1/results?limit={limit}{filter}&after={next}")),
        items: page.items.into_iter().map(item).collect(),
    }
}

fn item(summary: ResultSummary) -> ResultItem {
    let created_at = jiff::Timestamp::from_millisecond(summary.created_ms).unwrap_or_default();
    ResultItem {
        key: summary.key.to_string(),
        links: ResultLinks { this: format!("/v1/results/{}", summary.key) },
        calculator: summary.calculator,
        version: summary.version,
        engine: summary.engine,
        bytes: summary.bytes,
        created_at: format!("{created_at:.3}"),
    }
}
