//! Work materials: elastic constants, strength, and the force laws of the tables.
//!
//! Read-only data of the engine. Every number has its source and says how certain it is.

mod library;
mod schema;

pub use library::library;

use crate::force::handbook::{HandbookRow, WorkMaterial};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How certain a number of the library is, from the most certain on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// Measured, with its uncertainty.
    Measured,
    /// Two independent sources agree, or it is so by definition.
    Confirmed,
    /// Read in a table that a maker or a handbook published.
    PublishedTable,
    /// One source, from knowledge of it; agrees with what surrounds it.
    Likely,
    /// Said by the user.
    User,
    /// To be checked against its source before it is relied on.
    ToBeChecked,
    /// A typical value of textbooks, not verified against one.
    TextbookUnverified,
    /// Judged by whoever wrote the record, without a source.
    Judgement,
}

impl Certainty {
    /// Whether an answer that rests on such a number has to say so.
    pub fn needs_check(self) -> bool {
        matches!(self, Self::ToBeChecked | Self::TextbookUnverified | Self::Judgement)
    }

    /// Its name in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Confirmed => "confirmed",
            Self::PublishedTable => "published_table",
            Self::Likely => "likely",
            Self::User => "user",
            Self::ToBeChecked => "to_be_checked",
            Self::TextbookUnverified => "textbook_unverified",
            Self::Judgement => "judgement",
        }
    }
}

/// A number with its source, in the unit of the field that holds it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Sourced {
    /// The number, in the unit that the name of the field says.
    #[schema(example = 210_000.0, extensions(("x-unit" = json!("as the field's name says"))))]
    pub value: f64,
    /// Where it comes from.
    pub source: &'static str,
    /// How certain it is.
    pub certainty: Certainty,
}

/// Kienzle's constants of a work material: k_c = k_c1.1 h^(-m_c), h in mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct KienzleRow {
    /// Specific cutting force at 1 mm chip thickness, k_c1.1.
    #[schema(minimum = 0, example = 2526.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_c1.1"))))]
    pub specific_cutting_force_n_per_mm2: f64,
    /// Exponent of the chip thickness, m_c.
    #[schema(minimum = 0, exclusive_maximum = 1, example = 0.25, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_c"))))]
    pub cutting_exponent: f64,
    /// Where both come from.
    pub source: &'static str,
    /// How certain both are.
    pub certainty: Certainty,
}

/// A work material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Material {
    /// Name in a job; `snake_case`, never changes its meaning.
    #[schema(example = "steel_45")]
    pub id: &'static str,
    /// A few words for a list.
    pub title: &'static str,
    /// Modulus of elasticity E.
    #[schema(schema_with = schema::youngs_modulus)]
    pub youngs_modulus_n_per_mm2: Sourced,
    /// Poisson's ratio nu.
    #[schema(schema_with = schema::poisson_ratio)]
    pub poisson_ratio: Sourced,
    /// Density rho.
    #[schema(schema_with = schema::density)]
    pub density_kg_per_m3: Sourced,
    /// Yield strength, or 0.2 % proof stress; absent where it depends on a treatment that the name does not tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = schema::yield_strength)]
    pub yield_strength_n_per_mm2: Option<Sourced>,
    /// Tensile strength; absent where it depends on a treatment that the name does not tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = schema::tensile_strength)]
    pub tensile_strength_n_per_mm2: Option<Sourced>,
    /// Brinell hardness.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = schema::brinell_hardness)]
    pub brinell_hardness: Option<Sourced>,
    /// Class in the handbook of the power law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub work_material: Option<WorkMaterial>,
    /// The handbook's power laws of that class, before the correction for strength or hardness.
    pub power_laws: &'static [HandbookRow],
    /// Kienzle's constants for uncoated carbide.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kienzle: Option<KienzleRow>,
}

/// The material of that id.
pub fn find(id: &str) -> Option<&'static Material> {
    library().iter().find(|material| material.id == id)
}
