//! Schemas of the sourced numbers: each with the unit of its field.

use super::Sourced;
use utoipa::PartialSchema;
use utoipa::openapi::{RefOr, Schema};

fn sourced(description: &'static str, unit: &'static str, symbol: &'static str, example: f64) -> RefOr<Schema> {
    let RefOr::T(Schema::Object(mut object)) = Sourced::schema() else { return Sourced::schema() };
    object.description = Some(description.to_owned());
    if let Some(RefOr::T(Schema::Object(value))) = object.properties.get_mut("value") {
        value.example = Some(example.into());
        let extensions = value.extensions.get_or_insert_default();
        extensions.insert("x-unit".to_owned(), unit.into());
        extensions.insert("x-symbol".to_owned(), symbol.into());
    }
    RefOr::T(Schema::Object(object))
}

pub(super) fn youngs_modulus() -> RefOr<Schema> {
    sourced("Modulus of elasticity.", "N/mm2", "E", 210_000.0)
}

pub(super) fn poisson_ratio() -> RefOr<Schema> {
    sourced("Poisson's ratio.", "1", "nu", 0.3)
}

pub(super) fn density() -> RefOr<Schema> {
    sourced("Density.", "kg/m3", "rho", 7850.0)
}

pub(super) fn yield_strength() -> RefOr<Schema> {
    sourced(
        "Yield strength, or 0.2 % proof stress; absent where it depends on a treatment that the name does not tell.",
        "N/mm2",
        "sigma_y",
        355.0,
    )
}

pub(super) fn tensile_strength() -> RefOr<Schema> {
    sourced(
        "Tensile strength; absent where it depends on a treatment that the name does not tell.",
        "N/mm2",
        "sigma_B",
        600.0,
    )
}

pub(super) fn brinell_hardness() -> RefOr<Schema> {
    sourced("Brinell hardness.", "1", "HB", 190.0)
}
