//! The next part of a process: its job, its answer, its program.

use std::sync::OnceLock;

use axum::Extension;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode};
use axum::response::Response;
use serde_json::json;

use super::super::answer::{self, Parts, View};
use super::super::auth::Caller;
use super::super::negotiate::{self, Media};
use super::super::problem::Problem;
use super::super::query::Query;
use super::super::{App, gate};
use super::{MOST_NUMBER, tagged};
use crate::engine::{NextAsked, NextPart, WhichPath, in_language};
use crate::text::Language;

/// Number of the path that a program drives.
const PATH: HeaderName = HeaderName::from_static("precut-path");
/// What is asked of the next part beside its conditions.
const KNOWN: [&str; 4] = ["part_type", "path", "table", "figure"];

/// `GET /v1/processes/{name}/next`
pub(super) async fn next(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    request: Request,
) -> Result<Response, Problem> {
    static ALL: OnceLock<Vec<&'static str>> = OnceLock::new();
    let known = ALL.get_or_init(|| {
        let observed = app.engine.registry().entries().iter().filter_map(|entry| entry.observed());
        KNOWN.into_iter().chain(observed.flat_map(|observed| observed.conditions.iter().copied())).collect()
    });
    let (owner, headers) = (gate::owner(&caller, &request), request.headers());
    let mut query = Query::of(request.uri(), known)?;
    let mut asked = NextAsked {
        part_type: query.text("part_type"),
        path: query.one_of("path", WhichPath::ALL, WhichPath::word)?,
        ..NextAsked::default()
    };
    for name in known.iter().skip(KNOWN.len()) {
        if let Some(value) = query.number(name, &(0.0..=f64::from(MOST_NUMBER)))? {
            asked.conditions.push(((*name).to_owned(), value));
        }
    }
    let process = app.engine.process(&caller.shelf(), &name).await?;
    let calculator = process.document["calculator"].as_str().unwrap_or_default();
    let entry = app.engine.entry(calculator).ok_or_else(Problem::internal)?;
    let view = View::of_parts(Parts::of(&mut query)?, headers, entry.meta(), &answer::offered(entry.meta()))?;
    // Who takes a program along cuts on its path, and the process has to know of it.
    asked.issue = negotiate::media(headers, &answer::offered(entry.meta())).is_some_and(|media| media != Media::Json);
    let is_json = !asked.issue;
    let next = app.engine.next_part(&caller.shelf(), &name, asked, &owner).await?;
    if let Some(owner) = caller.owner() {
        let noted = app.engine.note_asked(&next.solved.stored.key, &owner, next.solved.cache).await;
        noted.unwrap_or_else(|error| tracing::warn!(%error, "it is not noted who asked for an answer"));
    }
    if is_json {
        let language = negotiate::language(headers);
        return Ok(document(&name, calculator, &next, language));
    }
    let mut response = answer::respond(next.solved.stored.clone(), view, &HeaderMap::new()).await?;
    answer::describe(&mut response, &next.solved.stored, next.solved.cache, &next.solved.timings);
    response.headers_mut().insert(PATH, HeaderValue::from(next.revision));
    Ok(response)
}

fn document(name: &str, calculator: &str, next: &NextPart, language: Language) -> Response {
    let address = format!("/v1/results/{}", next.solved.stored.key);
    let state = next.state.clone().map(|state| in_language(state, language)).unwrap_or_default();
    let said = json!({
        "process": name,
        "number": next.number,
        "part_type": next.part_type,
        "path": { "kind": "process", "revision": next.revision },
        "which": next.path.word(),
        "calculator": calculator,
        "job": next.job,
        "answer": address,
        "forecast": state["forecast"],
        "action": state["action"],
        "explanation": state["explanation"],
        "links": {
            "answer": address,
            "program": format!("/v1/processes/{name}/next?path={}&part_type={}", next.path.word(), next.part_type),
        },
    });
    tagged(&said, None, language, &HeaderMap::new(), StatusCode::OK)
}
