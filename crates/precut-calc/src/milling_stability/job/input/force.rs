//! The force of an edge, and the rubbing of its flank.

use serde::{Deserialize, Serialize};
use utoipa::openapi::schema::OneOfBuilder;
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::force::choice;

/// Force per millimetre of edge over the chip (`milling/2.3`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum EdgeForce {
    /// An edge force and a share of the chip.
    Mechanistic(MechanisticForce),
    /// A power of the chip for each direction (Kienzle).
    Kienzle(KienzleForce),
    /// One power of the chip, with radial and axial ratios: the law of the calculator of fixture stability.
    PowerLaw(PowerForce),
}

impl PartialSchema for EdgeForce {
    fn schema() -> RefOr<Schema> {
        RefOr::T(Schema::OneOf(
            OneOfBuilder::new()
                .description(Some("How the force of an edge follows from the thickness of its chip."))
                .item(choice("mechanistic", MechanisticForce::schema()))
                .item(choice("kienzle", KienzleForce::schema()))
                .item(choice("power_law", PowerForce::schema()))
                .build(),
        ))
    }
}

impl ToSchema for EdgeForce {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        MechanisticForce::schemas(schemas);
        KienzleForce::schemas(schemas);
        PowerForce::schemas(schemas);
    }
}

/// An edge force and a share of the chip, each tangential, radial and axial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = MillMechanisticForce)]
pub struct MechanisticForce {
    /// Tangential force per area of the chip.
    #[schema(minimum = 0.001, maximum = 1e6, example = 1319.4, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("K_tc"))))]
    pub tangential_n_per_mm2: f64,
    /// Radial force per area of the chip, away from the work.
    #[serde(default)]
    #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 788.8, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("K_rc"))))]
    pub radial_n_per_mm2: f64,
    /// Axial force per area of the chip; positive lifts the workpiece.
    #[serde(default)]
    #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 150.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("K_ac"))))]
    pub axial_n_per_mm2: f64,
    /// Tangential force of the edge itself.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1e5, default = 0.0, example = 25.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_te"))))]
    pub tangential_edge_n_per_mm: f64,
    /// Radial force of the edge itself.
    #[serde(default)]
    #[schema(minimum = -1e5, maximum = 1e5, default = 0.0, example = 30.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_re"))))]
    pub radial_edge_n_per_mm: f64,
    /// Axial force of the edge itself.
    #[serde(default)]
    #[schema(minimum = -1e5, maximum = 1e5, default = 0.0, example = 5.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_ae"))))]
    pub axial_edge_n_per_mm: f64,
}

/// A power of the chip for each direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = MillKienzleForce)]
pub struct KienzleForce {
    /// Tangential force at a chip of 1 mm by 1 mm.
    #[schema(minimum = 0.001, maximum = 1e6, example = 1800.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_c1.1"))))]
    pub tangential_n_per_mm2: f64,
    /// Tangential force goes with the power 1-m of the chip.
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, example = 0.25, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_c"))))]
    pub tangential_exponent: f64,
    /// Radial force at a chip of 1 mm by 1 mm, away from the work.
    #[serde(default)]
    #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 600.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_r1.1"))))]
    pub radial_n_per_mm2: f64,
    /// Radial force goes with the power 1-m of the chip.
    #[serde(default)]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, default = 0.0, example = 0.4, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_r"))))]
    pub radial_exponent: f64,
    /// Axial force at a chip of 1 mm by 1 mm; positive lifts the workpiece.
    #[serde(default)]
    #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 300.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_a1.1"))))]
    pub axial_n_per_mm2: f64,
    /// Axial force goes with the power 1-m of the chip.
    #[serde(default)]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, default = 0.0, example = 0.4, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_a"))))]
    pub axial_exponent: f64,
    /// Below this chip the power is a straight line: no law is measured there.
    #[serde(default = "chip_floor")]
    #[schema(minimum = 0.0, maximum = 1.0, default = 0.005, example = 0.005, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("h_c"))))]
    pub chip_floor_mm: f64,
}

fn chip_floor() -> f64 {
    0.005
}

/// Tangential force C_p h^(1-k) H^(1-mu), radial and axial shares of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = MillPowerForce)]
pub struct PowerForce {
    /// Tangential force at 1 mm of chip thickness and 1 mm of depth.
    #[schema(minimum = 0.001, maximum = 1e6, example = 3000.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("C_p"))))]
    pub coefficient: f64,
    /// The force goes with the power 1-k of the chip thickness.
    #[serde(default)]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, default = 0.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k"))))]
    pub chip_thickness_exponent: f64,
    /// The force goes with the power 1-mu of the depth.
    #[serde(default)]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("mu"))))]
    pub depth_exponent: f64,
    /// Radial over tangential force.
    #[serde(default = "radial_ratio")]
    #[schema(minimum = 0.0, maximum = 10.0, default = 0.6, example = 0.6, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho"))))]
    pub radial_ratio: f64,
    /// Axial over tangential force; positive lifts the workpiece.
    #[serde(default)]
    #[schema(minimum = -10.0, maximum = 10.0, default = 0.0, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho_a"))))]
    pub axial_ratio: f64,
    /// Below this chip the power is a straight line: no law is measured there.
    #[serde(default = "chip_floor")]
    #[schema(minimum = 0.0, maximum = 1.0, default = 0.005, example = 0.005, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("h_c"))))]
    pub chip_floor_mm: f64,
}

fn radial_ratio() -> f64 {
    0.6
}

/// Rubbing of the flank (`milling/2.8`): the coefficient, or indentation and wear.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FlankRubbing {
    /// K_w itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e9, example = 800.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_w"))))]
    pub coefficient_n_per_mm: Option<f64>,
    /// Force per volume that the flank presses in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e9, example = 40_000.0, extensions(("x-unit" = json!("N/mm3")), ("x-symbol" = json!("K_sp"))))]
    pub indentation_n_per_mm3: Option<f64>,
    /// Width of the worn flank.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 5.0, example = 0.08, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("w"))))]
    pub wear_land_mm: Option<f64>,
    /// Tangential over radial force of the flank.
    #[serde(default = "flank_friction")]
    #[schema(minimum = 0.0, maximum = 2.0, default = 0.3, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("mu_w"))))]
    pub friction: f64,
    /// Where the coefficient comes from. Unless it was measured the limit without it is told, too.
    pub source: RubbingSource,
}

fn flank_friction() -> f64 {
    0.3
}

/// Where a coefficient comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RubbingSource {
    /// From cuts with this tool in this material.
    Measured,
    /// From a book.
    Handbook,
    /// A guess.
    Assumed,
}
