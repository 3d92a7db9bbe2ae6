//! Limits, multiplier and clamp force over the spindle speed.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::InstabilityKind;

/// Limits over the spindle speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingLobes {
    /// The boundary, speed by speed.
    pub boundary: MillingBoundary,
    /// Unstable stretches of all speeds, islands included.
    pub intervals: LobeIntervals,
    /// The multiplier over the plane, where it is asked for.
    pub map: Option<MillingMap>,
    /// The clamp force over the plane, where it is asked for with the map and the analysis `clamping`.
    pub clamp_map: Option<MillingClampMap>,
    /// How deep was looked.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub examined_to_mm: f64,
}

/// Limits at the speeds that were looked at, rising.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingBoundary {
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Depth at which it first becomes unstable; null where it does not, or the speed is not answered.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub chatter_mm: Vec<Option<f64>>,
    /// Depth at which the power of the spindle gives out.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub power_mm: Vec<Option<f64>>,
    /// Depth at which its torque gives out.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub torque_mm: Vec<Option<f64>>,
    /// Whether a speed is answered.
    pub status: Vec<SpeedStatus>,
}

/// Whether a speed is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SpeedStatus {
    /// It is.
    Answered,
    /// So slow that thousands of oscillations go into a period.
    TooSlow,
    /// The modulation of the speed fits into no period there.
    Incommensurate,
}

impl SpeedStatus {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Answered => "answered",
            Self::TooSlow => "too_slow",
            Self::Incommensurate => "incommensurate",
        }
    }
}

/// Unstable stretches, row by row.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LobeIntervals {
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Where the stretch begins.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub from_mm: Vec<f64>,
    /// Where it ends; null where it goes on beyond what was looked at.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub to_mm: Vec<Option<f64>>,
    /// How it begins.
    pub kind: Vec<InstabilityKind>,
}

/// The multiplier over speed and depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingMap {
    /// Columns.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Rows.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Modulus from tooth to tooth, row by row; null where a speed is not answered.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub per_tooth: Vec<Option<f64>>,
}

/// The least clamp force by which no contact slips or opens at the lowest friction, over speed and depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingClampMap {
    /// Columns.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Rows.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// In the forced motion, row by row; null where the cut chatters, the speed is not answered or no clamp force holds.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_n: Vec<Option<f64>>,
    /// Against the largest static force of each row, at any speed; null where no clamp force holds.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub static_n: Vec<Option<f64>>,
    /// Against the mean force of each row, at any speed; null where no clamp force holds.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub mean_n: Vec<Option<f64>>,
}
