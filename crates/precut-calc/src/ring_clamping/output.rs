//! The answer: the ring let go, and how hard it may be held.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The ring let go.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "RingClampingResult")]
pub struct Outcome {
    /// `RONt` of the ring let go, about the least-squares circle: what was cut round springs back by this.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_um: f64,
    /// Largest diameter less the smallest: what a gauge between two points shows.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub two_point_um: f64,
    /// How much larger the mean radius is after the release.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub radius_change_um: f64,
    /// Waves of the ring let go.
    pub lobes: ReleasedLobes,
    /// The ring let go, about its mean radius.
    pub profile: ReleasedProfile,
    /// Largest bending stress while it is held.
    #[schema(extensions(("x-unit" = json!("N/mm2"))))]
    pub bending_stress_n_per_mm2: f64,
    /// How hard the jaws may and must press; absent for contacts one by one.
    pub limits: Option<GripLimits>,
    /// The same sum of forces by other jaws; empty for contacts one by one.
    pub alternatives: Vec<OtherJaws>,
}

/// Waves of the ring let go, by order.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ReleasedLobes {
    /// Undulations per revolution.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub order: Vec<f64>,
    /// Amplitude, half of peak to valley.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub amplitude_um: Vec<f64>,
    /// First maximum.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_of_max_deg: Vec<f64>,
}

/// The ring let go, by angle.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ReleasedProfile {
    /// Angle.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: Vec<f64>,
    /// Deviation from the mean radius, outward positive.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub radial_deviation_um: Vec<f64>,
}

/// How hard jaws may and must press.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GripLimits {
    /// Force per jaw at which the roundness is the tolerance; absent without a tolerance or without lobes.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_per_jaw_max_n: Option<f64>,
    /// Force per jaw that the cut asks for; absent without one.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_per_jaw_min_n: Option<f64>,
}

/// Other jaws with the same sum of forces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OtherJaws {
    /// Number of jaws.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub jaws: u32,
    /// Angle over which each presses.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub contact_angle_deg: f64,
    /// Force of each.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_per_jaw_n: f64,
    /// `RONt` of the ring let go.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_um: f64,
    /// Force per jaw at which the roundness is the tolerance; absent without a tolerance or without lobes.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_per_jaw_max_n: Option<f64>,
}
