//! The job's parts about settings: what the maps cover, and what the search may set.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Work speeds and orders of the map over the work speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[schema(as = RingSpeedRange)]
pub struct SpeedRange {
    /// First work speed; half of the job's where it is not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 100_000.0, example = 30.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_1"))))]
    pub from_rpm: Option<f64>,
    /// Last work speed; twice the job's where it is not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 100_000.0, example = 120.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_2"))))]
    pub to_rpm: Option<f64>,
    /// Work speeds.
    #[schema(minimum = 2, maximum = 400, default = 61, example = 61, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_n"))))]
    pub speeds: u32,
    /// Highest order looked at. Left out: as high as the modes make waves grow at the slowest of the speeds.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 3, maximum = 5000, example = 300, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k_max"))))]
    pub highest_order: Option<u32>,
}

impl Default for SpeedRange {
    fn default() -> Self {
        Self { from_rpm: None, to_rpm: None, speeds: 61, highest_order: None }
    }
}

/// Tool angles and support angles of the map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[schema(as = RingMapRange)]
pub struct MapRange {
    /// First tool angle, counter-clockwise from the right, seen from the ring's centre.
    #[schema(minimum = -60.0, maximum = 240.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("alpha_T"))))]
    pub tool_angle_from_deg: f64,
    /// Last tool angle.
    #[schema(minimum = -60.0, maximum = 240.0, default = 180.0, example = 180.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("alpha_T"))))]
    pub tool_angle_to_deg: f64,
    /// Tool angles.
    #[schema(minimum = 2, maximum = 721, default = 91, example = 91, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_T"))))]
    pub tool_angles: u32,
    /// First support half angle, from the downward vertical.
    #[schema(minimum = 15.0, maximum = 75.0, default = 15.0, example = 15.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("beta"))))]
    pub support_angle_from_deg: f64,
    /// Last support half angle.
    #[schema(minimum = 15.0, maximum = 75.0, default = 75.0, example = 75.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("beta"))))]
    pub support_angle_to_deg: f64,
    /// Support half angles.
    #[schema(minimum = 2, maximum = 361, default = 61, example = 61, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_beta"))))]
    pub support_angles: u32,
    /// Highest order looked at.
    #[schema(minimum = 3, maximum = 60, default = 20, example = 20, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k_max"))))]
    pub highest_order: u32,
    /// How many cells are simulated, those that the theory says need the fewest revolutions: only they can have a number
    /// of revolutions to the target.
    #[schema(minimum = 0, maximum = 10_000, default = 200, example = 200, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_c")), ("x-advanced" = json!(true))))]
    pub simulated_cells: u32,
    /// Whether every cell is cut, too: the roundness that the job's feed, revolutions and spark-out give there from just
    /// clear of the blank. Takes a simulation per cell, and so usually becomes a job.
    #[schema(default = false, example = false, extensions(("x-advanced" = json!(true))))]
    pub cut_everywhere: bool,
    /// Roundness to which the ring is to come; by the theory every wave of the start profile.
    #[schema(minimum = 0.001, maximum = 10_000.0, default = 5.0, example = 5.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("RONt"))))]
    pub target_um: f64,
}

impl Default for MapRange {
    fn default() -> Self {
        Self {
            tool_angle_from_deg: 0.0,
            tool_angle_to_deg: 180.0,
            tool_angles: 91,
            support_angle_from_deg: 15.0,
            support_angle_to_deg: 75.0,
            support_angles: 61,
            highest_order: 20,
            simulated_cells: 200,
            cut_everywhere: false,
            target_um: 5.0,
        }
    }
}

/// Target and machine limits of the search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingSearchRange)]
pub struct SearchRange {
    /// Roundness deviation to reach: RONt about the least-squares circle, after the job's filter.
    #[schema(minimum = 0.01, maximum = 10_000.0, example = 5.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("RONt"))))]
    pub target_um: f64,
    /// Smallest feed of the machine.
    #[serde(default = "least_feed")]
    #[schema(minimum = 1e-6, maximum = 10.0, default = 0.001, example = 0.001, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_min"))))]
    pub feed_min_mm_per_rev: f64,
    /// Largest feed of the machine.
    #[serde(default = "largest_feed")]
    #[schema(minimum = 1e-6, maximum = 10.0, default = 0.5, example = 0.5, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_max"))))]
    pub feed_max_mm_per_rev: f64,
    /// Most revolutions with feed.
    #[serde(default = "most_revolutions")]
    #[schema(minimum = 1.0, maximum = 100_000.0, default = 1000.0, example = 1000.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_max"))))]
    pub revolutions_max: f64,
    /// Distance of the tip from the largest diameter at the start, so that the first bite is small.
    #[serde(default = "clearance")]
    #[schema(minimum = 0.0, maximum = 10.0, default = 0.05, example = 0.05, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("c"))))]
    pub clearance_mm: f64,
    /// How far below the smallest radius the finished one shall lie at least.
    #[serde(default = "allowance")]
    #[schema(minimum = 0.0, maximum = 100.0, default = 0.05, example = 0.05, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
    pub allowance_mm: f64,
    /// How far off the angles of tool and supports may be: over this the robustness of a setting is told.
    #[serde(default = "half")]
    #[schema(minimum = 0.0, maximum = 10.0, default = 0.5, example = 0.5, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("u_alpha"))))]
    pub angle_error_deg: f64,
    /// Run-out that the rollers may have, peak to valley; point supports have none. Counts in the robustness.
    #[serde(default = "runout")]
    #[schema(minimum = 0.0, maximum = 1000.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("u_r"))))]
    pub roller_runout_um: f64,
    /// By how much the blank's waves may be larger or smaller than stated. Counts in the robustness.
    #[serde(default = "fifth")]
    #[schema(minimum = 0.0, maximum = 100.0, default = 20.0, example = 20.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("u_A"))))]
    pub blank_waves_error_percent: f64,
    /// First tool angle that the machine allows, counter-clockwise from the right, seen from the ring's centre.
    #[serde(default = "low_tool")]
    #[schema(minimum = -60.0, maximum = 240.0, default = 20.0, example = 20.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("alpha_T")), ("x-advanced" = json!(true))))]
    pub tool_angle_from_deg: f64,
    /// Last tool angle that the machine allows.
    #[serde(default = "high_tool")]
    #[schema(minimum = -60.0, maximum = 240.0, default = 160.0, example = 160.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("alpha_T")), ("x-advanced" = json!(true))))]
    pub tool_angle_to_deg: f64,
    /// Smallest support half angle that the machine allows, from the downward vertical.
    #[serde(default = "low_support")]
    #[schema(minimum = 15.0, maximum = 75.0, default = 17.0, example = 17.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("beta")), ("x-advanced" = json!(true))))]
    pub support_angle_from_deg: f64,
    /// Largest support half angle that the machine allows.
    #[serde(default = "high_support")]
    #[schema(minimum = 15.0, maximum = 75.0, default = 60.0, example = 60.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("beta")), ("x-advanced" = json!(true))))]
    pub support_angle_to_deg: f64,
    /// Up to which compliance ratio the machine can be made softer; left out, it stays as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 2.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("K")), ("x-advanced" = json!(true))))]
    pub compliance_ratio_max: Option<f64>,
    /// Revolutions without feed at the end.
    #[serde(default = "one")]
    #[schema(minimum = 0.0, maximum = 100.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_s"))))]
    pub spark_out_revolutions: f64,
}

fn least_feed() -> f64 {
    0.001
}
fn largest_feed() -> f64 {
    0.5
}
fn most_revolutions() -> f64 {
    1000.0
}
fn clearance() -> f64 {
    0.05
}
fn allowance() -> f64 {
    0.05
}
fn half() -> f64 {
    0.5
}
fn runout() -> f64 {
    1.0
}
fn fifth() -> f64 {
    20.0
}
fn low_tool() -> f64 {
    20.0
}
fn high_tool() -> f64 {
    160.0
}
fn low_support() -> f64 {
    17.0
}
fn high_support() -> f64 {
    60.0
}
fn one() -> f64 {
    1.0
}
