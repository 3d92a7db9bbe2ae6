//! Pages for people: what to try, the interactive contract, what a problem means. All of them in the binary.

use axum::extract::{Path, State};
use axum::http::header::CONTENT_SECURITY_POLICY;
use axum::http::{HeaderMap, HeaderValue};
use axum::response::Response;
use precut_calc::calculator::Values;
use serde::Serialize;
use utoipa::ToSchema;

use super::calculators::wants_page;
use super::document::Document;
use super::problem::Problem;
use super::{App, codes, negotiate, workbench};
use crate::text::{Glossary, Language, Texts};

const HTML: &str = "text/html; charset=utf-8";
const DOCS: &str = include_str!("../../ui/docs/index.html");
const DOCS_STYLE: &str = include_str!("../../ui/docs/page.css");
const RAPIDOC: &str = include_str!("../../ui/vendor/rapidoc/rapidoc-min.js");

/// The interactive contract styles itself from within its script; nothing else may, and nothing comes from outside.
const DOCS_POLICY: &str = "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
                           object-src 'none'; base-uri 'none'; frame-ancestors 'none'";

/// What the service is and where to go.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Landing {
    /// Name of the service.
    #[schema(example = "precut")]
    name: &'static str,
    /// Version of the engine.
    #[schema(example = "0.1.0")]
    engine: &'static str,
    /// What it is for.
    description: &'static str,
    /// Addresses by name.
    links: LandingLinks,
    /// Addresses to post jobs to.
    calculators: Vec<String>,
}

/// Where to go.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct LandingLinks {
    /// The calculators.
    calculators: &'static str,
    /// The kept results.
    results: &'static str,
    /// The jobs.
    jobs: &'static str,
    /// The stored models.
    models: &'static str,
    /// The library of materials.
    materials: &'static str,
    /// The contract (OpenAPI 3.1).
    openapi: &'static str,
    /// The contract to try out in a browser.
    docs: &'static str,
}

/// What a problem means.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ProblemPage {
    /// Stable name of the problem.
    #[schema(example = "invalid_job")]
    code: String,
    /// What is wrong.
    title: String,
    /// Status that comes with it.
    #[schema(minimum = 400, maximum = 599, example = 422)]
    status: u16,
    /// What it means, and what to do.
    help: String,
}

pub(crate) const DESCRIPTION: &str =
    "What to know before the cut: how accurate it will be, and what to change so that it is accurate.";

/// `GET /`
pub(super) async fn landing(State(app): State<App>, headers: HeaderMap) -> Result<Response, Problem> {
    let rooms: Vec<_> = app.engine.registry().entries().iter().map(|entry| *entry.meta()).collect();
    if !wants_page(&headers) {
        let language = negotiate::language(&headers);
        let landing = Landing {
            name: "precut",
            engine: env!("CARGO_PKG_VERSION"),
            description: Glossary::of(language).help(DESCRIPTION),
            links: LandingLinks {
                calculators: "/v1/calculators",
                results: "/v1/results",
                jobs: "/v1/jobs",
                models: "/v1/models",
                materials: "/v1/materials",
                openapi: "/openapi.json",
                docs: "/docs",
            },
            calculators: rooms.iter().map(|meta| format!("/v1/{}", meta.id)).collect(),
        };
        return Ok(Document::json(&landing, Some(language)).respond(&headers));
    }
    workbench::index(&headers)
}

/// `GET /docs`
pub(super) async fn docs(headers: HeaderMap) -> Response {
    let mut response = Document::new(DOCS, HTML, Some(Language::En)).respond(&headers);
    response.headers_mut().insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(DOCS_POLICY));
    response
}

/// `GET /docs/{file}`
pub(super) async fn docs_file(Path(file): Path<String>, headers: HeaderMap) -> Result<Response, Problem> {
    let document = match file.as_str() {
        "rapidoc-min.js" => Document::new(RAPIDOC, "text/javascript; charset=utf-8", None),
        "page.css" => Document::new(DOCS_STYLE, "text/css; charset=utf-8", None),
        _ => return Err(Problem::not_found(&format!("/docs/{file}"))),
    };
    Ok(document.respond(&headers))
}

/// `GET /problems/{code}`
pub(super) async fn problem(
    State(app): State<App>,
    Path(code): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let language = negotiate::language(&headers);
    let explained = explain(&app, &code, language).ok_or_else(|| Problem::missing("unknown_problem", &code))?;
    if !wants_page(&headers) {
        return Ok(Document::json(&explained, Some(language)).respond(&headers));
    }
    let title = escaped(&explained.title);
    let label = |code| escaped(&Texts::shared().word(language, "label", code, &Values::new()));
    let body = format!(
        "<h1>{title}</h1><p><code>{}</code>, {} {}</p><p>{}</p><p><a href=\"/docs\">{}</a></p>",
        escaped(&explained.code),
        label("page_status"),
        explained.status,
        escaped(&explained.help),
        label("page_documentation"),
    );
    Ok(Document::new(page(&title, &body, language), HTML, Some(language)).respond(&headers))
}

/// The service's own problems, and those by which a calculator says that a job has no answer.
fn explain(app: &App, code: &str, language: Language) -> Option<ProblemPage> {
    let texts = Texts::shared();
    let none = Values::new();
    let help = |code: &str| texts.word(language, "help", code, &none);
    if let Some(status) = codes::status(code) {
        return Some(ProblemPage {
            code: code.to_owned(),
            title: texts.problem(language, code, &none).0,
            status,
            help: help(code),
        });
    }
    let owner = app.engine.registry().entries().iter().find(|entry| entry.meta().codes.contains(code))?;
    Some(ProblemPage {
        code: code.to_owned(),
        title: texts.problem(language, "infeasible", &none).0,
        status: 422,
        help: format!("{}: {}", Glossary::of(language).help(owner.meta().title), help("infeasible")),
    })
}

fn page(title: &str, body: &str, language: Language) -> String {
    format!(
        "<!doctype html>\n<html lang=\"{tag}\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>{title}</title>\
         <link rel=\"stylesheet\" href=\"/docs/page.css\"></head><body><main>{body}</main></body></html>\n",
        tag = language.tag(),
    )
}

/// Text inside HTML.
fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            _ => safe.push(character),
        }
    }
    safe
}
