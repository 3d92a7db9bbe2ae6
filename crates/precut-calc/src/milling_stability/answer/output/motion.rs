//! The forced motion and the surface that it leaves.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The motion of the tool against the work that the chips force, and the surface that it leaves. It is what is seen while the cut is stable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingMotion {
    /// Along the feed, least.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub x_min_um: f64,
    /// Along the feed, largest.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub x_max_um: f64,
    /// Across the feed, least.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub y_min_um: f64,
    /// Across the feed, largest.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub y_max_um: f64,
    /// Along the spindle, least.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub z_min_um: f64,
    /// Along the spindle, largest.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub z_max_um: f64,
    /// Largest peak-to-peak motion of a direction.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_um: f64,
    /// Walls that the cutter leaves; none where teeth begin and end inside the work.
    pub walls: Vec<WallSurface>,
}

/// A wall that the cutter leaves. Errors are positive where too much is removed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WallSurface {
    /// At which side of the cutter it stands.
    pub wall: WallSide,
    /// Height above the tip.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub height_mm: Vec<f64>,
    /// Error at that height.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub surface_error_um: Vec<f64>,
    /// Least error.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub error_min_um: f64,
    /// Largest error.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub error_max_um: f64,
    /// Roughness along the feed at half the depth, peak to valley.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roughness_rz_um: f64,
    /// Its mean deviation.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roughness_ra_um: f64,
}

/// At which side of the cutter a wall stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WallSide {
    /// Where teeth begin with no chip.
    Up,
    /// Where teeth end with none.
    Down,
}
