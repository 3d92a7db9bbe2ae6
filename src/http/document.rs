//! Documents that never change while the service runs: the contract, the list of calculators, pages.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use axum::body::Body;
use axum::extract::State;
use axum::http::header::{CACHE_CONTROL, CONTENT_LANGUAGE, CONTENT_TYPE, ETAG, VARY};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::Response;
use bytes::Bytes;

use super::problem::Problem;
use super::{App, calculators, negotiate, openapi};
use crate::registry::Registry;
use crate::text::Language;

/// Bytes with their type and entity tag.
pub(super) struct Document {
    bytes: Bytes,
    content_type: &'static str,
    etag: HeaderValue,
    language: Option<Language>,
}

impl Document {
    pub(super) fn new(bytes: impl Into<Bytes>, content_type: &'static str, language: Option<Language>) -> Self {
        let bytes = bytes.into();
        let hash = blake3::hash(&bytes).to_hex();
        // Also where the same bytes serve several languages: a tag is that of one representation.
        let tag = language.map_or_else(String::new, |language| format!("-{}", language.tag()));
        let etag = HeaderValue::from_str(&format!("\"{}{tag}\"", &hash[..32])).expect("digits and letters in quotes");
        Self { bytes, content_type, etag, language }
    }

    pub(super) fn json(value: &impl serde::Serialize, language: Option<Language>) -> Self {
        let bytes = serde_json::to_vec(value).expect("documents of the service have only words and numbers");
        Self::new(bytes, "application/json", language)
    }

    /// The document, or `304` if the client has it.
    pub(super) fn respond(&self, request: &HeaderMap) -> Response {
        let is_known = negotiate::has_already(request, self.etag.to_str().unwrap_or_default());
        let mut response = Response::new(if is_known { Body::empty() } else { Body::from(self.bytes.clone()) });
        if is_known {
            *response.status_mut() = StatusCode::NOT_MODIFIED;
        }
        let headers = response.headers_mut();
        headers.insert(ETAG, self.etag.clone());
        headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
        headers.insert(VARY, HeaderValue::from_static("Accept, Accept-Language, Accept-Encoding"));
        if !is_known {
            headers.insert(CONTENT_TYPE, HeaderValue::from_static(self.content_type));
            if let Some(language) = self.language {
                headers.insert(CONTENT_LANGUAGE, HeaderValue::from_static(language.tag()));
            }
        }
        response
    }
}

/// A document in every language.
type InLanguages = [OnceLock<Document>; Language::ALL.len()];

/// The documents that are made once, when they are first asked for: most of them never are.
pub(super) struct Documents {
    openapi: OnceLock<Document>,
    calculators: InLanguages,
    calculator: BTreeMap<&'static str, InLanguages>,
    registry: Registry,
}

impl Documents {
    pub(super) fn new(registry: &Registry) -> Self {
        Self {
            openapi: OnceLock::new(),
            calculators: InLanguages::default(),
            calculator: registry.entries().iter().map(|entry| (entry.meta().id, InLanguages::default())).collect(),
            registry: registry.clone(),
        }
    }

    fn openapi(&self) -> &Document {
        let make = || Document::new(openapi::json(&self.registry), "application/json", None);
        self.openapi.get_or_init(make)
    }

    pub(super) fn calculators(&self, language: Language) -> &Document {
        let make = || Document::json(&calculators::listed(&self.registry, language), Some(language));
        self.calculators[language.index()].get_or_init(make)
    }

    pub(super) fn calculator(&self, id: &str, language: Language) -> Option<&Document> {
        let (entry, made) = (self.registry.entry(id)?, self.calculator.get(id)?);
        let make = || Document::json(&calculators::described(entry, language), Some(language));
        Some(made[language.index()].get_or_init(make))
    }
}

/// `GET /openapi.json`
pub(super) async fn openapi(State(app): State<App>, headers: HeaderMap) -> Result<Response, Problem> {
    // Away from the threads that move bytes: the first time it is made.
    let respond = move || app.documents.openapi().respond(&headers);
    tokio::task::spawn_blocking(respond).await.map_err(|_| Problem::internal())
}
