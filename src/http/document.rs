//! Documents that never change while the service runs: the contract, the list of calculators, pages.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use axum::body::Body;
use axum::extract::State;
use axum::http::header::{CACHE_CONTROL, CONTENT_LANGUAGE, CONTENT_TYPE, ETAG, VARY};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::Response;
use bytes::Bytes;

use precut_calc::material;

use super::{App, calculators, materials, negotiate, openapi};
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

/// The documents that are made once.
pub(super) struct Documents {
    openapi: Document,
    calculators: Vec<(Language, Document)>,
    /// Made when they are first asked for: most languages of most calculators never are.
    calculator: BTreeMap<&'static str, [OnceLock<Document>; Language::ALL.len()]>,
    registry: Registry,
    materials: Vec<(Language, Document)>,
    material: BTreeMap<&'static str, Vec<(Language, Document)>>,
}

impl Documents {
    pub(super) fn new(registry: &Registry) -> Self {
        let each_language = |make: &dyn Fn(Language) -> Document| Language::ALL.map(|tag| (tag, make(tag))).into();
        let calculators =
            each_language(&|language| Document::json(&calculators::listed(registry, language), Some(language)));
        let calculator =
            registry.entries().iter().map(|entry| (entry.meta().id, Language::ALL.map(|_| OnceLock::new()))).collect();
        Self {
            openapi: Document::new(openapi::json(registry), "application/json", None),
            calculators,
            calculator,
            registry: registry.clone(),
            materials: each_language(&|language| Document::json(&materials::listed(language), Some(language))),
            material: material::library()
                .iter()
                .map(|material| {
                    let make = |language| Document::json(&materials::said(material, language), Some(language));
                    (material.id, each_language(&make))
                })
                .collect(),
        }
    }

    pub(super) fn calculators(&self, language: Language) -> Option<&Document> {
        in_language(&self.calculators, language)
    }

    pub(super) fn calculator(&self, id: &str, language: Language) -> Option<&Document> {
        let (entry, made) = (self.registry.entry(id)?, self.calculator.get(id)?);
        let make = || Document::json(&calculators::described(entry, language), Some(language));
        Some(made[language.index()].get_or_init(make))
    }
}

impl Documents {
    pub(super) fn materials(&self, language: Language) -> Option<&Document> {
        in_language(&self.materials, language)
    }

    pub(super) fn material(&self, id: &str, language: Language) -> Option<&Document> {
        in_language(self.material.get(id)?, language)
    }
}

fn in_language(documents: &[(Language, Document)], language: Language) -> Option<&Document> {
    documents.iter().find(|(tag, _)| *tag == language).map(|(_, document)| document)
}

/// `GET /openapi.json`
pub(super) async fn openapi(State(app): State<App>, headers: HeaderMap) -> Response {
    app.documents.openapi.respond(&headers)
}
