//! What is asked, and within which limits.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = MillingQuestion)]
pub enum Asked {
    /// Stable, chattering, overloaded, or out of the limits of the surface.
    Verdict,
    /// Depths at which this speed is unstable, and which side limits.
    Intervals,
    /// Limiting depth over spindle speed.
    Lobes,
    /// The motion that the chips force, and the surface that it leaves.
    Motion,
    /// How hard the workpiece must be clamped so that it neither slips, opens nor lifts.
    Clamping,
    /// Better speeds, ranked by removal rate within all limits.
    Speeds,
    /// Other pitches, another helix, a varying speed, each tried at the working speed.
    Proposals,
    /// How probable it is that the cut stays quiet and every limit is kept, what makes that uncertain, and how deep one may cut with the
    /// wanted probability.
    Certainty,
}

/// What must be kept, and how deep is looked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[schema(as = MillingLimits)]
pub struct CutLimits {
    /// Greatest depth that is looked at; chosen from the zeroth-order limit where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1000.0, example = 6.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H_max"))))]
    pub depth_max_mm: Option<f64>,
    /// Even steps in which depths are looked at.
    #[schema(minimum = 8, maximum = 400, default = 24, example = 24, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_H"))))]
    pub depths: u32,
    /// How far a cut is to stay below chatter.
    #[schema(minimum = 0.0, maximum = 90.0, default = 10.0, example = 10.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("q"))))]
    pub margin_percent: f64,
    /// Largest peak-to-peak motion in any direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1e6, example = 40.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("A_max"))))]
    pub amplitude_max_um: Option<f64>,
    /// Largest error of a wall, either way.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1e6, example = 20.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("e_max"))))]
    pub surface_error_max_um: Option<f64>,
    /// Largest roughness Rz of a wall.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1e5, example = 6.3, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("Rz_max"))))]
    pub roughness_max_um: Option<f64>,
}

impl Default for CutLimits {
    fn default() -> Self {
        Self {
            depth_max_mm: None,
            depths: 24,
            margin_percent: 10.0,
            amplitude_max_um: None,
            surface_error_max_um: None,
            roughness_max_um: None,
        }
    }
}

/// The plane of the lobe diagram.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LobePlane {
    /// Lowest spindle speed; that of the spindle or half the working speed where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 3000.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_1"))))]
    pub from_rpm: Option<f64>,
    /// Highest spindle speed; that of the spindle or twice the working speed where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 16_000.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_2"))))]
    pub to_rpm: Option<f64>,
    /// Spindle speeds of boundary and map.
    #[schema(minimum = 2, maximum = 2000, default = 200, example = 200, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_n"))))]
    pub speeds: u32,
    /// Depths of the map.
    #[schema(minimum = 2, maximum = 1000, default = 60, example = 60, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_H"))))]
    pub depths: u32,
    /// Whether the multiplier is computed over the whole plane, not the boundary alone.
    #[schema(default = false, example = true)]
    pub map: bool,
}

impl Default for LobePlane {
    fn default() -> Self {
        Self { from_rpm: None, to_rpm: None, speeds: 200, depths: 60, map: false }
    }
}
