//! Depths that are unstable, and what other assumptions make of the first.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::InstabilityKind;

/// A stretch of depths at which a speed is unstable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct UnstableInterval {
    /// Where it begins; null at the least depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub from_mm: Option<f64>,
    /// Where it ends; null where it goes on beyond `examined_to_mm`.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub to_mm: Option<f64>,
    /// How it begins, or ends where no beginning is known.
    pub kind: InstabilityKind,
    /// Below its beginning: there the modulus with its error is below 1.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub from_low_mm: Option<f64>,
    /// Above its beginning: there the modulus less its error is above 1.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub from_high_mm: Option<f64>,
    /// Below its end: unstable there.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub to_low_mm: Option<f64>,
    /// Above its end: stable there.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub to_high_mm: Option<f64>,
    /// By what it was found.
    pub found_by: CrossingMethod,
    /// Whether all of these brackets hold for the error of the modulus; never of a closed form, which has none.
    pub certified: bool,
}

/// By what the ends of an unstable stretch were found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CrossingMethod {
    /// By the Floquet multiplier, with a bracket.
    Multiplier,
    /// By the closed form of a slow cut.
    ClosedForm,
}

/// Growth over the depth at one speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DepthLine {
    /// Depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Modulus from tooth to tooth.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub per_tooth: Vec<f64>,
}

/// First limits under other assumptions; null where the assumption plays no part, or no limit was found up to `examined_to_mm`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OtherAssumptions {
    /// With half the floor of the chip.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub floor_halved_limit_mm: Option<f64>,
    /// With twice the floor.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub floor_doubled_limit_mm: Option<f64>,
    /// Without process damping, where its coefficient was not measured.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub without_process_damping_limit_mm: Option<f64>,
}
