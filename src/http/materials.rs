//! The library of work materials: read-only data of the engine.

use axum::extract::{Path, State};
use axum::http::HeaderMap;
use axum::response::Response;
use precut_calc::material::{self, Material};
use serde::Serialize;
use utoipa::ToSchema;

use super::problem::Problem;
use super::{App, negotiate};
use crate::text::{Glossary, Language};

/// Every material of the library.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct MaterialList {
    /// The materials.
    items: Vec<MaterialItem>,
    /// Address of the next page; always null: the list is complete.
    next: Option<String>,
}

/// A material with its address.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct MaterialItem {
    #[serde(flatten)]
    material: Material,
    /// Where to go from here.
    links: MaterialLinks,
}

/// Addresses of a material.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct MaterialLinks {
    /// The material itself.
    #[serde(rename = "self")]
    #[schema(example = "/v1/materials/steel_45")]
    this: String,
}

/// A material with its title in a language. Sources are cited as they are written.
pub(super) fn said(material: &Material, language: Language) -> Material {
    Material { title: Glossary::of(language).help(material.title), ..*material }
}

/// The list as it is answered.
pub(super) fn listed(language: Language) -> MaterialList {
    let item = |material: &Material| MaterialItem {
        material: said(material, language),
        links: MaterialLinks { this: format!("/v1/materials/{}", material.id) },
    };
    MaterialList { items: material::library().iter().map(item).collect(), next: None }
}

/// `GET /v1/materials`
pub(super) async fn list(State(app): State<App>, headers: HeaderMap) -> Response {
    app.documents.materials(negotiate::language(&headers)).respond(&headers)
}

/// `GET /v1/materials/{id}`
pub(super) async fn read(
    State(app): State<App>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    match app.documents.material(&id, negotiate::language(&headers)) {
        Some(document) => Ok(document.respond(&headers)),
        None => Err(Problem::missing("unknown_material", &id)),
    }
}
