//! The leading multiplier.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::super::super::model;

/// What a disturbance is multiplied by over a period of the cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LeadingMultiplier {
    /// Modulus over `period_s`; below 1 is stable.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus: f64,
    /// Real part.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub real: f64,
    /// Modulus of the imaginary part.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub imaginary: f64,
    /// What a loss of stability looks like.
    pub kind: InstabilityKind,
    /// Period of the cut: a tooth pitch where all teeth are alike, else a turn, or whole modulations of the speed.
    #[schema(extensions(("x-unit" = json!("s"))))]
    pub period_s: f64,
    /// The same modulus from tooth to tooth.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub per_tooth: f64,
    /// Growth of a disturbance, negative where it decays.
    #[schema(extensions(("x-unit" = json!("1/s"))))]
    pub growth_per_s: f64,
    /// Time in which a disturbance falls to a thousandth; null where none decays.
    #[schema(extensions(("x-unit" = json!("s"))))]
    pub settling_time_s: Option<f64>,
    /// Estimated error of the modulus: two orders compared, and what the eigenpair leaves.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus_error: f64,
    /// The modulus about undisturbed chips, where teeth stand out and that above is about the motion that the chips force; else null.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub smooth_chips_modulus: Option<f64>,
    /// Frequency of the largest share; null where so many oscillations fit into a period that they lie side by side.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub chatter_frequency_hz: Option<f64>,
    /// Frequencies at which the disturbance swings, by falling share.
    pub aliases: Vec<FrequencyShare>,
    /// How many times a disturbance grows at most on its way, although it may die out from period to period; at most 1e300 is told. Of
    /// a slow cut: a steady ripple between two teeth. With a varying speed: the leading disturbance from one tooth to a later one. From
    /// fifty on it marks the surface. Null for other cuts.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub transient_growth: Option<f64>,
}

/// A frequency with its share of the mean square of the disturbance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FrequencyShare {
    /// Frequency.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub frequency_hz: f64,
    /// Share.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub share: f64,
}

/// What a loss of stability looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum InstabilityKind {
    /// A complex pair: a frequency of its own.
    Hopf,
    /// Negative: every second period.
    Flip,
    /// Positive: it grows without swinging.
    Fold,
}

impl From<model::Kind> for InstabilityKind {
    fn from(kind: model::Kind) -> Self {
        match kind {
            model::Kind::Hopf => Self::Hopf,
            model::Kind::Flip => Self::Flip,
            model::Kind::Fold => Self::Fold,
        }
    }
}

impl InstabilityKind {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hopf => "hopf",
            Self::Flip => "flip",
            Self::Fold => "fold",
        }
    }
}
