//! Better speeds and other cutters.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A speed and depth that keep all limits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SpeedPocket {
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: f64,
    /// Depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: f64,
    /// Width.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub width_mm: f64,
    /// Material removal rate.
    #[schema(extensions(("x-unit" = json!("cm3/min"))))]
    pub removal_rate_cm3_per_min: f64,
    /// What keeps it from cutting deeper.
    pub binds: PocketLimit,
    /// Depth at which it would chatter; null where it would not up to `examined_to_mm`.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub chatter_depth_mm: Option<f64>,
    /// Modulus of the multiplier from tooth to tooth.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub per_tooth: f64,
    /// Mean power of the motor.
    #[schema(extensions(("x-unit" = json!("kW"))))]
    pub motor_power_kw: f64,
    /// Mean torque.
    #[schema(extensions(("x-unit" = json!("N m"))))]
    pub torque_n_m: f64,
    /// Largest forced motion of a direction, peak to peak; null where it goes beyond the model.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_um: Option<f64>,
    /// Largest error of a wall, without its sign; null where no wall is left.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub surface_error_um: Option<f64>,
}

/// What keeps a speed from cutting deeper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PocketLimit {
    /// Chatter, with the margin.
    Chatter,
    /// Chatter where the speed is off by 1 % and the natural frequencies by 2 %.
    Robustness,
    /// The power of the spindle.
    Power,
    /// Its torque.
    Torque,
    /// The clamp force at hand.
    ClampForce,
    /// The forced motion.
    Amplitude,
    /// The error of the wall.
    SurfaceError,
    /// The roughness of the wall.
    Roughness,
    /// Nothing: it was not looked deeper.
    Examined,
}

impl PocketLimit {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Chatter => "chatter",
            Self::Robustness => "robustness",
            Self::Power => "power",
            Self::Torque => "torque",
            Self::ClampForce => "clamp_force",
            Self::Amplitude => "amplitude",
            Self::SurfaceError => "surface_error",
            Self::Roughness => "roughness",
            Self::Examined => "examined",
        }
    }
}

/// What every speed allows, to the accuracy of maps.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SpeedCurve {
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Depth under all limits; null where a speed is not answered.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<Option<f64>>,
    /// Which limit binds.
    pub binds: Vec<Option<PocketLimit>>,
    /// Material removal rate at that depth.
    #[schema(extensions(("x-unit" = json!("cm3/min"))))]
    pub removal_rate_cm3_per_min: Vec<Option<f64>>,
}

/// Something else to cut with at the working speed. It was solved as it stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CutterProposal {
    /// What is changed.
    pub kind: ProposalKind,
    /// Pitches of the proposed cutter.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub pitch_deg: Vec<f64>,
    /// Its helix angle.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub helix_angle_deg: Option<f64>,
    /// Largest change of the speed over its mean.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub amplitude: Option<f64>,
    /// How often the speed goes up and down.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub frequency_hz: Option<f64>,
    /// Where it first chatters; null where it does not up to `examined_to_mm`.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub first_limit_mm: Option<f64>,
    /// Where the job as it is does.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub first_limit_now_mm: Option<f64>,
    /// Depth within chatter with its margin, power and torque.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: f64,
    /// The same of the job as it is.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_now_mm: f64,
    /// Material removal rate at that depth.
    #[schema(extensions(("x-unit" = json!("cm3/min"))))]
    pub removal_rate_cm3_per_min: f64,
    /// How much more that is.
    #[schema(extensions(("x-unit" = json!("percent"))))]
    pub gain_percent: f64,
}

/// What a proposal changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProposalKind {
    /// Uneven pitches.
    Pitch,
    /// Another helix.
    Helix,
    /// A speed that goes up and down.
    SpeedVariation,
}

impl ProposalKind {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pitch => "pitch",
            Self::Helix => "helix",
            Self::SpeedVariation => "speed_variation",
        }
    }
}
