//! What is asked of a program, and the limits of its feeds.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::machinability::MachinabilityModel;

/// What is asked of a program.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = ProgramMode)]
pub struct Mode {
    /// What is done with it.
    #[schema(example = "read")]
    pub kind: ModeKind,
    /// How far the corrected path may come off the exact one, on the radius.
    #[serde(default = "half")]
    #[schema(minimum = 0.05, maximum = 100.0, default = 0.5, example = 0.5, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("e_c")), ("x-advanced" = json!(true))))]
    pub chord_tolerance_um: f64,
    /// Least step of X that the control takes, as X is written; of a program in inches it is 0.0001 inch.
    #[serde(default = "one")]
    #[schema(minimum = 0.01, maximum = 100.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("i_X")), ("x-advanced" = json!(true))))]
    pub increment_um: f64,
    /// Least length of a block.
    #[serde(default = "tenth")]
    #[schema(minimum = 0.01, maximum = 10.0, default = 0.1, example = 0.1, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("l_b")), ("x-advanced" = json!(true))))]
    pub min_block_length_mm: f64,
    /// Least time of a block at its feed, for the control to come after.
    #[serde(default = "eight")]
    #[schema(minimum = 0.0, maximum = 1000.0, default = 8.0, example = 8.0, extensions(("x-unit" = json!("ms")), ("x-symbol" = json!("t_b")), ("x-advanced" = json!(true))))]
    pub min_block_time_ms: f64,
    /// Cuts on a smaller diameter stay as they are.
    #[serde(default = "three")]
    #[schema(minimum = 2.0, maximum = 10_000.0, default = 3.0, example = 3.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("d_min")), ("x-advanced" = json!(true))))]
    pub minimum_diameter_mm: f64,
    /// Whether a comment at the head of the program that is given back as a file says which answer changed it, and by how much.
    #[serde(default)]
    #[schema(default = false, example = false, extensions(("x-advanced" = json!(true))))]
    pub stamp: bool,
    /// What the work is corrected to.
    #[serde(default)]
    #[schema(default = "program", example = "program", extensions(("x-advanced" = json!(true))))]
    pub correct_to: CorrectTo,
}

/// What the work is corrected to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CorrectTo {
    /// What the program leaves on work and machine that do not yield.
    #[default]
    Program,
    /// The part of `drawing`, where it says a diameter and the program comes within 0.5 mm of it; elsewhere what the program leaves.
    Drawing,
}

fn one() -> f64 {
    1.0
}

fn eight() -> f64 {
    8.0
}

fn three() -> f64 {
    3.0
}

fn half() -> f64 {
    0.5
}

fn tenth() -> f64 {
    0.1
}

/// What is done with a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = ProgramModeKind)]
pub enum ModeKind {
    /// It is read: its moves and what is wrong with it.
    Read,
    /// X of its finishing cuts is shifted so that the error is gone; nothing else changes.
    Compensate,
    /// Its feeds become the fastest within `refeed`; nothing else changes.
    Refeed,
    /// First the feeds, then X at the new feeds.
    Both,
}

impl ModeKind {
    /// Whether X is shifted.
    pub(crate) fn compensates(self) -> bool {
        matches!(self, Self::Compensate | Self::Both)
    }

    /// Whether feeds change.
    pub(crate) fn refeeds(self) -> bool {
        matches!(self, Self::Refeed | Self::Both)
    }
}

/// Limits of the feeds of a program. What is left out does not limit. Speeds stay as they are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = ProgramRefeed)]
pub struct Refeed {
    /// Least feed.
    #[schema(minimum = 1e-3, maximum = 20.0, example = 0.05, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_min"))))]
    pub feed_min_mm_per_rev: f64,
    /// Largest feed.
    #[schema(minimum = 1e-3, maximum = 20.0, example = 0.4, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_max"))))]
    pub feed_max_mm_per_rev: f64,
    /// Largest ratio of the feeds of lines that follow each other in the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 1.0, maximum = 1e6, example = 1.25, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho_S")), ("x-advanced" = json!(true))))]
    pub feed_step_ratio_max: Option<f64>,
    /// By how much the tool may come to stand off its path along the axis, on lines that finish; the diameter is off by twice that.
    /// In mode `both` that is before X is shifted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 1e6, example = 10.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("delta_max"))))]
    pub deflection_max_um: Option<f64>,
    /// Largest roughness of lines that finish, in the measure of `roughness`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-4, maximum = 1e6, example = 3.2, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("Ra_max"))))]
    pub roughness_max_um: Option<f64>,
    /// Model of the roughness, um; needed with its limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-advanced" = json!(true))))]
    pub roughness: Option<MachinabilityModel>,
    /// Largest passive force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e9, example = 600.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_y"))))]
    pub force_y_max_n: Option<f64>,
    /// Largest main force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e9, example = 1500.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_z"))))]
    pub force_z_max_n: Option<f64>,
    /// Power of the motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 10_000.0, example = 10.0, extensions(("x-unit" = json!("kW")), ("x-symbol" = json!("P_max"))))]
    pub power_kw: Option<f64>,
    /// Share of the motor's power that reaches the cut.
    #[serde(default = "one")]
    #[schema(exclusive_minimum = 0.0, maximum = 1.0, default = 1.0, example = 0.8, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("eta"))))]
    pub efficiency: f64,
    /// Torque at the spindle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 1e7, example = 400.0, extensions(("x-unit" = json!("N m")), ("x-symbol" = json!("M_max"))))]
    pub torque_n_m: Option<f64>,
    /// Share of an edge that the lines of one tool may use per part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e6, example = 1.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("U_max"))))]
    pub tool_usage_max: Option<f64>,
    /// Model of the tool life, min, a power law; needed with the limit of its usage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-advanced" = json!(true))))]
    pub tool_life: Option<MachinabilityModel>,
}
