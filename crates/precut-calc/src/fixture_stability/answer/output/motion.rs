//! The motion: forced, in time, and over the depth.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The forced motion with both joints closed: exact but for its sampling, whose error is below 1e-6.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ForcedMotion {
    /// Largest displacement, positive toward the movable jaw.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_max_um: f64,
    /// Smallest displacement.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_min_um: f64,
    /// Their difference.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_um: f64,
    /// Displacement where a tooth enters.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_at_entry_um: f64,
    /// Displacement where a tooth leaves.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_at_exit_um: f64,
    /// Peak-to-peak over the quasi-static difference.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub dynamic_factor: Option<f64>,
    /// Clamp force that the joint at the movable jaw asks for.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_n: f64,
    /// Clamp force that the joint at the fixed jaw asks for.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_n: f64,
}

/// The cut in time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Simulated {
    /// Steps per tooth pitch.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub steps_per_tooth: u32,
    /// Tooth periods.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub tooth_periods: u32,
    /// Tooth periods at the end over which the steady values were taken.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub steady_tooth_periods: u32,
    /// Whether the displacement grew beyond all bounds.
    pub diverged: bool,
    /// Whether once-per-tooth samples of the displacement settled.
    pub settled: bool,
    /// Scatter of the once-per-tooth samples in the steady state, over the feed per tooth.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub sample_scatter: f64,
    /// Largest displacement in the steady state.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_max_um: f64,
    /// Smallest.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_min_um: f64,
    /// Their difference.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_um: f64,
    /// Largest force along the feed.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_max_n: f64,
    /// Smallest.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_min_n: f64,
    /// Largest effective feed of any tooth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub effective_feed_max_mm: f64,
    /// Smallest; 0 where a tooth leaves the cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub effective_feed_min_mm: f64,
    /// Share of tooth-steps in the arc without a chip.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lost_cut_share: f64,
    /// When a tooth first lost the cut.
    #[schema(extensions(("x-unit" = json!("s"))))]
    pub first_lost_cut_s: Option<f64>,
    /// Clamp force that the joint at the movable jaw asks for in the steady state.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_n: f64,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_n: f64,
    /// The same from the entry on: joint at the movable jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_entry_n: f64,
    /// Joint at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_entry_n: f64,
    /// Whether joints could open: a clamp force was given.
    pub unilateral: bool,
    /// Share of the steady time in which the joint at the movable jaw is open.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub open_movable_share: f64,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub open_fixed_share: f64,
    /// Both at once.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub open_both_share: f64,
    /// Change of the peak-to-peak displacement with half the step; only with `verified`.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub halved_step_change_um: Option<f64>,
}

/// One entry per depth.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct AmplitudeCurve {
    /// Depth of cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Modulus of the multiplier.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus: Vec<f64>,
    /// Peak-to-peak displacement with joints that stay closed: exact where stable, simulated where not.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_um: Vec<f64>,
    /// Clamp force that the joint at the movable jaw asks for (elastic part).
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_n: Vec<f64>,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_n: Vec<f64>,
    /// Share of tooth-steps in the arc without a chip.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lost_cut_share: Vec<f64>,
}

/// Oscillograms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Histories {
    /// From the entry on.
    pub entry: Oscillogram,
    /// The last revolution.
    pub steady: Oscillogram,
    /// The last pass over every place of the arc.
    pub arc: ArcProfile,
}

/// One entry per moment.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Oscillogram {
    /// Time since the entry.
    #[schema(extensions(("x-unit" = json!("s"))))]
    pub time_s: Vec<f64>,
    /// Displacement of the workpiece, positive toward the movable jaw.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_um: Vec<f64>,
    /// Displacement of the movable jaw, where it moves by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub jaw_um: Option<Vec<f64>>,
    /// Force along the feed.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_n: Vec<f64>,
    /// Effective feed of the tooth that entered last.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub effective_feed_mm: Vec<Option<f64>>,
    /// Clamp force that the joint at the movable jaw asks for.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_n: Vec<f64>,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_n: Vec<f64>,
}

/// Chip along the arc.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ArcProfile {
    /// Angle of the tooth.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: Vec<f64>,
    /// Effective feed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub effective_feed_mm: Vec<f64>,
    /// Chip thickness.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub chip_thickness_mm: Vec<f64>,
    /// Chip thickness with a smooth feed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub smooth_chip_mm: Vec<f64>,
}
