//! What a job says to choose a row of the handbook and its corrections.

use super::WorkMaterial;
use crate::force::{Forces, PowerTerm, ToolMaterial, rules};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The handbook's power law for external turning with its correction factors. Equation `deflection/6.1`.
///
/// Exactly one of `material` and `work_material`. Where the handbook gives no passive force
/// (stainless steel, copper and aluminium alloys), `passive` or `passive_to_main_ratio` is needed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Handbook {
    /// Material of the library; gives the class and its strength or hardness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "steel_45", extensions(("x-group" = json!("cut")), ("x-library" = json!("materials"))))]
    pub material: Option<String>,
    /// Class of work material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub work_material: Option<WorkMaterial>,
    /// Tool material.
    #[serde(default)]
    pub tool_material: ToolMaterial,
    /// Tensile strength of steel; in place of the library's where `material` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 3000, example = 600.0,
        extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("sigma_B")), ("x-group" = json!("cut"))))]
    pub tensile_strength_n_per_mm2: Option<f64>,
    /// Brinell hardness of cast iron; in place of the library's where `material` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 700, example = 190.0,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("HB")), ("x-group" = json!("cut"))))]
    pub brinell_hardness: Option<f64>,
    /// Factor K_m of a copper alloy for which the handbook gives a range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 10, example = 0.68,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("K_m")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub material_factor: Option<f64>,
    /// Lead angle (cutting edge angle) of the straight edge; the table covers 30 to 90 degrees, and up to 100 degrees its
    /// factors of 90 are taken.
    #[schema(exclusive_minimum = 0, maximum = 100, example = 45.0,
        extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi")), ("x-group" = json!("cut"))))]
    pub cutting_edge_angle_deg: f64,
    /// Rake angle. The table covers -15 to 10 degrees for carbide (10 if left out), 12 to 25 for high-speed steel (20 if left out).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -45, maximum = 45, example = 10.0,
        extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("gamma")), ("x-group" = json!("cut"))))]
    pub rake_angle_deg: Option<f64>,
    /// Inclination of the edge, for carbide only; the table covers -5 to 15 degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -45, maximum = 45, example = 0.0,
        extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("lambda")), ("x-group" = json!("cut"))))]
    pub inclination_deg: Option<f64>,
    /// Nose radius, for high-speed steel only (2 if left out); the table covers 0.5 to 4 mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 50, example = 2.0,
        extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r")), ("x-group" = json!("cut"))))]
    pub nose_radius_mm: Option<f64>,
    /// Whether the tool has a wiper edge (end cutting edge angle 0); for steel and carbide only.
    #[serde(default)]
    #[schema(default = false, example = false)]
    pub wiper_edge: bool,
    /// Passive force of one's own in place of the handbook's; the correction factors do not act on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub passive: Option<PowerTerm>,
    /// Passive force as a multiple of the main force, in place of the handbook's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 10, example = 0.45,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("P_y/P_z")), ("x-group" = json!("cut"))))]
    pub passive_to_main_ratio: Option<f64>,
    /// Feed force of one's own in place of the handbook's; the correction factors do not act on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feed: Option<PowerTerm>,
    /// Feed force as a multiple of the main force, in place of the handbook's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 10, example = 0.3,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("P_x/P_z")), ("x-group" = json!("cut"))))]
    pub feed_to_main_ratio: Option<f64>,
    /// Constant part P_0 by rubbing of the worn flank, added to the law wherever something is cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rubbing: Option<Forces>,
    /// Factor on the law for a worn edge; 1 for a sharp one. Does not act on `rubbing`.
    #[serde(default = "rules::one")]
    #[schema(exclusive_minimum = 0, maximum = 10, default = 1.0, example = 1.2,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("K_w")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub wear_factor: f64,
}
