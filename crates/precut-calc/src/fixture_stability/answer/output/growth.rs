//! What becomes of a disturbance.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The largest Floquet multiplier: what a disturbance is multiplied by from tooth to tooth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FloquetMultiplier {
    /// Modulus per tooth period; below 1 is stable.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus: f64,
    /// Real part, over a period of the force.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub real: f64,
    /// Modulus of the imaginary part.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub imaginary: f64,
    /// Tooth periods in a period of the force: 1, or all teeth where they are uneven.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub tooth_periods: u32,
    /// What a loss of stability looks like.
    pub kind: ChatterKind,
    /// Frequency at which it vibrates.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub chatter_frequency_hz: f64,
    /// Growth of a disturbance, negative where it decays.
    #[schema(extensions(("x-unit" = json!("1/s"))))]
    pub growth_per_s: f64,
    /// Time in which a disturbance falls to a thousandth; null where none decays.
    #[schema(extensions(("x-unit" = json!("s"))))]
    pub settling_time_s: Option<f64>,
    /// Estimated error of the modulus: two orders compared, and the residual of the eigenvalue; of a slow cut that of its closed form.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus_error: f64,
    /// Of a slow cut: how many times a steady ripple grows at most between two teeth; from fifty on the cut counts as chattering.
    /// At most 1e300 is told.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub growth_within: Option<f64>,
}

/// What a loss of stability looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChatterKind {
    /// A complex pair: quasi-periodic vibration.
    Hopf,
    /// A negative real multiplier: every other tooth cuts the same (period doubling).
    Flip,
    /// A positive real multiplier.
    Fold,
}

impl ChatterKind {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hopf => "hopf",
            Self::Flip => "flip",
            Self::Fold => "fold",
        }
    }
}

/// The zeroth-order approximation: mean cutting stiffness.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ZerothOrder {
    /// Mean directional factor a0; its sign says which way the cutting stiffness acts.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub mean_directional_factor: f64,
    /// Lowest chatter limit over all speeds.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_min_mm: Option<f64>,
    /// Frequency there.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub frequency_hz: Option<f64>,
    /// Lowest of all lobes at this speed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_at_speed_mm: Option<f64>,
}
