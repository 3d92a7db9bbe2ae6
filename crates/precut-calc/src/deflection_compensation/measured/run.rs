//! A run that was measured, its places, and how wrong the base may be.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::deflection_compensation::job::input::FeedDirection;

/// How wrong the base may be without that being a finding: standard deviations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DeflectionAllowances {
    /// Force level common to all runs, as a share.
    #[schema(minimum = 0.0, maximum = 1.0, example = 0.01, extensions(("x-symbol" = json!("u_F")), ("x-unit" = json!("1"))))]
    pub force_level_rel: f64,
    /// Force level of every run by itself, as a share.
    #[schema(minimum = 0.0, maximum = 1.0, example = 0.007, extensions(("x-symbol" = json!("u_Fi")), ("x-unit" = json!("1"))))]
    pub force_per_run_rel: f64,
    /// Bending compliance, as a share; 0.0035 is a diameter known to 0.1 %.
    #[schema(minimum = 0.0, maximum = 1.0, example = 0.0035, extensions(("x-symbol" = json!("u_b")), ("x-unit" = json!("1"))))]
    pub bending_rel: f64,
    /// Setting of the diameter in every run, on the diameter.
    #[schema(minimum = 0.0, maximum = 1000.0, example = 1.0, extensions(("x-symbol" = json!("u_0")), ("x-unit" = json!("um"))))]
    pub setup_diameter_um: f64,
    /// Position of the gauge along the shaft in every run.
    #[schema(minimum = 0.0, maximum = 100.0, example = 0.2, extensions(("x-symbol" = json!("u_z")), ("x-unit" = json!("mm"))))]
    pub gauge_position_mm: f64,
}

impl Default for DeflectionAllowances {
    fn default() -> Self {
        Self {
            force_level_rel: 0.01,
            force_per_run_rel: 0.007,
            bending_rel: 0.003_5,
            setup_diameter_um: 1.0,
            gauge_position_mm: 0.2,
        }
    }
}

/// Conditions of one run; what it leaves out is as in the job.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeflectionRun {
    /// Nominal depth of cut: sets the stock of every turned segment to d + 2 depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 100.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("a"))))]
    pub depth_mm: Option<f64>,
    /// Feed per revolution.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_1, maximum = 20.0, example = 0.2, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S"))))]
    pub feed_mm_per_rev: Option<f64>,
    /// Cutting speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 20_000.0, example = 120.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V"))))]
    pub speed_m_per_min: Option<f64>,
    /// Spindle speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 200_000.0, example = 800.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Which way the tool travelled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feed_direction: Option<FeedDirection>,
    /// Path that the edge had cut when the run began.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 120.0, extensions(("x-unit" = json!("m")), ("x-symbol" = json!("s"))))]
    pub tool_path_at_start_m: Option<f64>,
    /// Time since the machine was cold when the run began.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e5, example = 15.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("tau"))))]
    pub warm_time_at_start_min: Option<f64>,
    /// Path that the tool was told to follow, where it was not the nominal line.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 10_000)]
    pub commanded_path: Vec<CommandedPoint>,
}

/// A vertex of the path that the tool was told to follow; straight between vertices.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CommandedPoint {
    /// Station from the headstock end.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 500.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
    pub z_mm: f64,
    /// Commanded diameter.
    #[schema(minimum = 0.0, maximum = 10_000.0, example = 89.93, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("X"))))]
    pub diameter_mm: f64,
}

/// Where a diameter was measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeflectionPoint {
    /// Station from the headstock end.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 500.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
    pub z_mm: f64,
}
