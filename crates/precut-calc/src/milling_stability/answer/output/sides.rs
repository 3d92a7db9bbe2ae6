//! Which side limits, and what was measured of each.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::receptance_fit::{Direction, FittedFunction, FittedGroup, ModeCertainty};

/// Tool or workpiece.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum YieldingSide {
    /// The tool in its spindle.
    Tool,
    /// The workpiece in its fixture.
    Work,
}

impl YieldingSide {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tool => "tool",
            Self::Work => "work",
        }
    }
}

/// A mode, and how much of the disturbance it is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ModeShare {
    /// Whose mode it is.
    pub side: YieldingSide,
    /// Its direction along the feed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub x: f64,
    /// Across the feed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub y: f64,
    /// Along the spindle.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub z: f64,
    /// Natural frequency.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub frequency_hz: f64,
    /// Modal mass at the cut.
    #[schema(extensions(("x-unit" = json!("kg"))))]
    pub mass_kg: f64,
    /// Modal stiffness at the cut.
    #[schema(extensions(("x-unit" = json!("N/mm"))))]
    pub stiffness_n_per_mm: f64,
    /// Share of critical damping.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub damping_ratio: f64,
    /// Share in the mean elastic energy of the leading disturbance; null where that is not known.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub energy_share: Option<f64>,
}

/// Limits with one side or direction held rigid. Null where there is none up to `examined_to_mm`, or what is not in `tried`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RigidLimits {
    /// What was held rigid: `tool`, `work`, `x`, `y`, `z`.
    pub tried: Vec<String>,
    /// With a rigid tool.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub tool_rigid_limit_mm: Option<f64>,
    /// With a rigid workpiece.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub work_rigid_limit_mm: Option<f64>,
    /// With nothing that yields along the feed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub x_rigid_limit_mm: Option<f64>,
    /// With nothing that yields across the feed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub y_rigid_limit_mm: Option<f64>,
    /// With nothing that yields along the spindle.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_rigid_limit_mm: Option<f64>,
    /// How deep was looked.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub examined_to_mm: f64,
}

/// A side of which frequency responses were measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MeasuredSide {
    /// Which.
    pub side: YieldingSide,
    /// How well each of its modes is known, in the order of `modes`.
    pub certainty: Vec<ModeCertainty>,
    /// Largest share that the modes leave of a function.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub largest_residual_share: f64,
    /// Directions that were fitted together, and how many modes they ask for.
    pub groups: Vec<FittedGroup>,
    /// How well each function is met.
    pub functions: Vec<FittedFunction>,
    /// Directions, along the axes of the fixture, of which nothing was measured: there this side counts as rigid.
    pub rigid_directions: Vec<Direction>,
}

/// Whether there is a limit by measured lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReceptanceLimit {
    /// There is.
    Found,
    /// None up to `examined_to_mm`.
    NoneExamined,
    /// Not solved: teeth differ.
    UnevenTeeth,
    /// Not solved: the speed varies.
    VaryingSpeed,
    /// Not solved: the modes reach beyond the twelfth multiple of the tooth frequency.
    TooSlow,
}

impl ReceptanceLimit {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Found => "found",
            Self::NoneExamined => "none_examined",
            Self::UnevenTeeth => "uneven_teeth",
            Self::VaryingSpeed => "varying_speed",
            Self::TooSlow => "too_slow",
        }
    }
}
