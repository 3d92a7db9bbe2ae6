//! The cutter.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{ToothHelix, ToothOffset, ToothPitch};

/// A cutter whose teeth may be uneven.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = MillCutter)]
pub struct Cutter {
    /// Diameter over the tips.
    #[schema(minimum = 0.1, maximum = 5000.0, example = 31.75, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("D"))))]
    pub diameter_mm: f64,
    /// Number of teeth.
    #[schema(minimum = 1, maximum = 100, example = 2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("z"))))]
    pub teeth: u32,
    /// Helix angle of all teeth; positive is a right hand helix on a right hand cutter.
    #[serde(default)]
    #[schema(minimum = -80.0, maximum = 80.0, default = 0.0, example = 30.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("eta"))))]
    pub helix_angle_deg: f64,
    /// Angle between edge and feed: 90 for a shoulder mill, 45 for a common face mill.
    #[serde(default = "right_angle")]
    #[schema(minimum = 1.0, maximum = 90.0, default = 90.0, example = 90.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("kappa"))))]
    pub cutting_edge_angle_deg: f64,
    /// Angle from each tooth to the tooth before it at the tip, one for each tooth; even where it is left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100, example = json!([70.0, 110.0, 70.0, 110.0]))]
    pub pitch_deg: Vec<ToothPitch>,
    /// Helix angle of each tooth, in place of that of all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100, example = json!([35.0, 38.0]))]
    pub tooth_helix_angle_deg: Vec<ToothHelix>,
    /// How far each tooth stands out: run-out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100, example = json!([0.0, 10.0]))]
    pub radial_offset_um: Vec<ToothOffset>,
    /// How far each tooth stands down; it matters where the cutting edge angle is not 90.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100, example = json!([0.0, 5.0]))]
    pub axial_offset_um: Vec<ToothOffset>,
}

fn right_angle() -> f64 {
    90.0
}
