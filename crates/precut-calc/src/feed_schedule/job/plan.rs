//! How the schedule is found, and what else the call is to give.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How the schedule is found.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Method {
    /// The optimum over the given zones, solved to a certificate.
    #[default]
    Optimal,
    /// The source paper's rule: feed in every zone so that the deflection is the same, then cut off at the feed bounds.
    EqualDeflection {
        /// The deflection aimed at.
        #[serde(default)]
        #[schema(default = "minimum", example = "tolerance")]
        target: EqualTarget,
        /// The deflection aimed at, in place of `target`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-6, maximum = 1e6, example = 8.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("delta_0"))))]
        target_um: Option<f64>,
        /// Feed that the rule starts from.
        #[schema(minimum = 1e-4, maximum = 20.0, example = 0.15, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_0"))))]
        reference_feed_mm_per_rev: f64,
        /// Cutting speed of all zones.
        #[schema(minimum = 1e-2, maximum = 20_000.0, example = 60.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V"))))]
        speed_m_per_min: f64,
    },
    /// Zones are found: the continuous schedule along the given ones, cut into the fewest with a stated loss of time.
    /// The given zones are the surfaces; their borders and the steps of the shaft stay.
    Continuous {
        /// Points of the grid along all zones.
        #[serde(default = "grid_points")]
        #[schema(minimum = 10, maximum = 2000, default = 601, example = 601, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
        grid_points: u32,
        /// Time that the fewest zones may cost over the continuous schedule.
        #[serde(default = "one_percent")]
        #[schema(minimum = 0.01, maximum = 100.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("loss"))))]
        loss_percent: f64,
        /// Most zones.
        #[serde(default = "most_segments")]
        #[schema(minimum = 1, maximum = 60, default = 24, example = 24, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("K"))))]
        segments_max: u32,
        /// Largest change of ln(feed) along the shaft, for the surface's sake: zones are steps below the schedule that
        /// keeps it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-9, maximum = 100.0, example = 0.004, extensions(("x-unit" = json!("1/mm")), ("x-symbol" = json!("g"))))]
        feed_gradient_per_mm: Option<f64>,
    },
}

fn grid_points() -> u32 {
    601
}

fn one_percent() -> f64 {
    1.0
}

fn most_segments() -> u32 {
    24
}

/// The deflection that the equal-deflection rule aims at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum EqualTarget {
    /// The least over all zones at the reference feed: the source paper's.
    #[default]
    Minimum,
    /// Every zone's own limit.
    Tolerance,
}

/// Several passes over every zone: equal roughing passes and a finishing pass, each with feed and speed of its own.
/// The limits on deflection, roughness and hardening hold for the finishing pass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PassPlan {
    /// Depth to be removed by all passes, on the radius; replaces the zones' own.
    #[schema(minimum = 1e-3, maximum = 1000.0, example = 6.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_all"))))]
    pub total_depth_mm: f64,
    /// Most roughing passes.
    #[serde(default = "four")]
    #[schema(minimum = 0, maximum = 20, default = 4, example = 4, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k_max"))))]
    pub roughing_passes_max: u32,
    /// Least depth of a pass.
    #[schema(minimum = 1e-3, maximum = 1000.0, example = 1.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_min"))))]
    pub depth_min_mm: f64,
    /// Largest depth of a pass.
    #[schema(minimum = 1e-3, maximum = 1000.0, example = 3.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_max"))))]
    pub depth_max_mm: f64,
    /// Least depth of the finishing pass, where it is another than that of a roughing pass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 1000.0, example = 0.2, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_f,min"))))]
    pub finishing_depth_min_mm: Option<f64>,
    /// Largest depth of the finishing pass, where it is another than that of a roughing pass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 1000.0, example = 1.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_f,max"))))]
    pub finishing_depth_max_mm: Option<f64>,
    /// Whether the finishing pass may not be deeper than a roughing pass.
    #[serde(default = "yes")]
    #[schema(default = true, example = true)]
    pub finishing_not_deeper: bool,
    /// Time that every pass costs beside the cut (return of the tool, setting).
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1e6, default = 0.0, example = 0.51, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("t_p"))))]
    pub time_per_pass_min: f64,
}

impl PassPlan {
    /// Least and largest depth of the finishing pass.
    pub(in crate::feed_schedule) fn finishing_mm(&self) -> (f64, f64) {
        (
            self.finishing_depth_min_mm.unwrap_or(self.depth_min_mm),
            self.finishing_depth_max_mm.unwrap_or(self.depth_max_mm),
        )
    }
}

fn four() -> u32 {
    4
}

fn yes() -> bool {
    true
}

/// A curve of the objective over a tolerance: all limits of one kind are multiplied by a factor that runs over a range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TradeOff {
    /// Which limits.
    #[serde(default)]
    #[schema(default = "deflection", example = "deflection")]
    pub limit: TradedLimit,
    /// Smallest factor.
    #[serde(default = "half")]
    #[schema(minimum = 1e-3, maximum = 1e3, default = 0.5, example = 0.5, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f_1"))))]
    pub factor_from: f64,
    /// Largest factor.
    #[serde(default = "two")]
    #[schema(minimum = 1e-3, maximum = 1e3, default = 2.0, example = 2.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f_2"))))]
    pub factor_to: f64,
    /// Points, evenly in the logarithm.
    #[serde(default = "thirteen")]
    #[schema(minimum = 2, maximum = 201, default = 13, example = 13, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
    pub count: u32,
}

fn half() -> f64 {
    0.5
}

fn two() -> f64 {
    2.0
}

fn thirteen() -> u32 {
    13
}

/// Limits that a trade-off runs over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum TradedLimit {
    /// `deflection_max_um` of every zone.
    #[default]
    Deflection,
    /// `roughness_max_um` of every zone.
    Roughness,
    /// `limits.tool_usage_max`.
    ToolUsage,
    /// `limits.time_max_min`.
    Time,
}

/// The compensated path that goes with the schedule. Needs the shaft and the passive force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Compensation {
    /// Largest radial deviation of the straight moves from the computed path.
    #[serde(default = "one_um")]
    #[schema(minimum = 0.0, maximum = 1000.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("tol"))))]
    pub chord_tolerance_um: f64,
    /// Smallest step of the control on the diameter.
    #[serde(default = "one_um")]
    #[schema(minimum = 0.001, maximum = 100.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("increment"))))]
    pub increment_um: f64,
    /// Stations in every zone.
    #[serde(default = "stations")]
    #[schema(minimum = 2, maximum = 5000, default = 51, example = 51, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
    pub stations_per_zone: u32,
}

fn one_um() -> f64 {
    1.0
}

fn stations() -> u32 {
    51
}
