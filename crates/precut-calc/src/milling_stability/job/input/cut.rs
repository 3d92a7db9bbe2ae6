//! The working point.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::CutWidth;

/// The working point: how wide by `width_mm`, or by the angles at which teeth enter and leave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = MillCut)]
pub struct Cut {
    /// Axial depth of cut.
    #[schema(minimum = 0.0, maximum = 1000.0, example = 1.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: f64,
    /// Width of the milled strip; or give both angles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 5000.0, example = 15.875, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("a_e"))))]
    pub width_mm: Option<f64>,
    /// Other widths that may be cut, in the same way: the analysis `speeds` looks for the best of all of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 11, example = json!([8.0, 12.0]))]
    pub widths_mm: Vec<CutWidth>,
    /// Where the strip lies: at the side at which teeth begin with no chip (up), end with none (down), or about the centre line.
    #[serde(default)]
    #[schema(default = "centred", example = "down")]
    pub milling: Milling,
    /// Centre line of a centred strip from the cutter's axis, positive toward the side where teeth enter.
    #[serde(default)]
    #[schema(minimum = -5000.0, maximum = 5000.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("e"))))]
    pub offset_mm: f64,
    /// Angle at which a tooth enters, from across the feed, growing with rotation; or give the width.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 180.0, example = 90.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi_st"))))]
    pub entry_deg: Option<f64>,
    /// Angle at which it leaves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 180.0, example = 180.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi_ex"))))]
    pub exit_deg: Option<f64>,
    /// Spindle speed; or give the cutting speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 9500.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n")), ("x-code" = json!("bad_spindle_speed"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Cutting speed; or give the spindle speed. The echoed job has the spindle speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 20_000.0, example = 950.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V"))))]
    pub speed_m_per_min: Option<f64>,
    /// Mean feed per tooth; or give the table feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_01, maximum = 10.0, example = 0.1, extensions(("x-unit" = json!("mm/tooth")), ("x-symbol" = json!("S_z")), ("x-code" = json!("bad_feed_per_tooth"))))]
    pub feed_mm_per_tooth: Option<f64>,
    /// Table feed; or give the feed per tooth. Where both are given they must agree to 1 %. The echoed job has the feed per tooth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_1, maximum = 1e6, example = 1900.0, extensions(("x-unit" = json!("mm/min")), ("x-symbol" = json!("S"))))]
    pub feed_mm_per_min: Option<f64>,
    /// Direction of feed about the spindle, against the X of the fixture, in which modes are given.
    #[serde(default)]
    #[schema(minimum = -360.0, maximum = 360.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("alpha"))))]
    pub feed_direction_deg: f64,
}

/// Where the milled strip lies against the cutter.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = MillingSense)]
pub enum Milling {
    /// Teeth begin with no chip.
    Up,
    /// Teeth end with no chip.
    Down,
    /// About the line of feed, moved by `offset_mm`.
    #[default]
    Centred,
}

impl Milling {
    /// Whether the strip lies at a side of the cutter, so that an offset says nothing.
    pub(in crate::milling_stability) fn is_at_a_side(self) -> bool {
        self != Self::Centred
    }
}

/// What chips are taken about.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChipsAbout {
    /// The motion that the chips force: which surface a tooth meets depends on it.
    #[default]
    ForcedMotion,
    /// Undisturbed chips.
    SmoothChips,
}
