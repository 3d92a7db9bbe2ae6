//! Limits of the depth, and better speeds.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::AmplitudeCurve;

/// Depths at which something gives out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DepthLimits {
    /// Chatter begins.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub chatter_mm: Option<f64>,
    /// The peak-to-peak displacement exceeds the feed per tooth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub amplitude_mm: Option<f64>,
    /// The joint at the movable jaw opens at the given clamp force.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub movable_opens_mm: Option<f64>,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub fixed_opens_mm: Option<f64>,
    /// Depth at which the workpiece slips along the jaws at the given clamp force and the lowest friction; null where none of both is given, too.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub slips_mm: Option<f64>,
    /// The power of the spindle gives out.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub power_mm: Option<f64>,
    /// The torque of the spindle gives out.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub torque_mm: Option<f64>,
    /// Which comes first; null where nothing gives out up to the depth examined.
    pub first: Option<FirstLimit>,
    /// Its depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub first_mm: Option<f64>,
    /// Material removal rate there.
    #[schema(extensions(("x-unit" = json!("cm3/min"))))]
    pub removal_rate_cm3_per_min: Option<f64>,
    /// Limits at the speeds that were asked for.
    pub at_speeds: Vec<SpeedLimit>,
    /// Amplitude and clamp force over the depth.
    pub curve: AmplitudeCurve,
}

/// What gives out first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FirstLimit {
    /// Chatter begins.
    Chatter,
    /// The amplitude exceeds the feed per tooth.
    Amplitude,
    /// The joint at the movable jaw opens.
    MovableOpens,
    /// The joint at the fixed jaw opens.
    FixedOpens,
    /// The workpiece slips along the jaws.
    Slips,
    /// The power of the spindle gives out.
    Power,
    /// The torque of the spindle gives out.
    Torque,
}

impl FirstLimit {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Chatter => "chatter",
            Self::Amplitude => "amplitude",
            Self::MovableOpens => "movable_opens",
            Self::FixedOpens => "fixed_opens",
            Self::Slips => "slips",
            Self::Power => "power",
            Self::Torque => "torque",
        }
    }
}

/// Limits at a speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SpeedLimit {
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: f64,
    /// Depth up to which limits are looked for at this speed; less than at others where joints harden and no forced motion
    /// is found in a deeper cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_examined_mm: f64,
    /// Depth at which chatter begins; null where none begins up to the depth examined.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub chatter_mm: Option<f64>,
    /// Depth at which the forced peak-to-peak displacement exceeds the feed per tooth, without chatter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub amplitude_mm: Option<f64>,
    /// Depth at which the joint at the movable jaw opens at the given clamp force, without chatter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub movable_opens_mm: Option<f64>,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub fixed_opens_mm: Option<f64>,
    /// Depth at which the workpiece slips along the jaws at the given clamp force and the lowest friction, without chatter; null where none of both is given, too.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub slips_mm: Option<f64>,
    /// Depth at which the power or the torque of the spindle gives out; null where nothing is said of them.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub drive_mm: Option<f64>,
}

/// A speed at which more can be removed, with a cut that was tried there: stable, closed, within the other limits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BetterSpeed {
    /// Spindle speed.
    #[schema(extensions(
        ("x-unit" = json!("rev/min")),
        ("x-choices" = json!({
            "sets": {
                "/cut/spindle_speed_rpm": "spindle_speed_rpm",
                "/cut/depth_mm": "depth_mm",
                "/cut/feed_mm_per_tooth": "/engagement/feed_mm_per_tooth",
            },
            "clears": ["/cut/speed_m_per_min", "/cut/feed_mm_per_min"],
            "against": { "removal_rate_cm3_per_min": "/engagement/removal_rate_cm3_per_min" },
        }))
    ))]
    pub spindle_speed_rpm: f64,
    /// Depth to cut: a tenth short of chatter, of an opening joint and of slip, and within the other limits.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: f64,
    /// Material removal rate of that cut.
    #[schema(extensions(("x-unit" = json!("cm3/min"))))]
    pub removal_rate_cm3_per_min: f64,
    /// Least clamp force of that cut: against opening and, where friction is given, against slip.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_n: f64,
    /// What gives out first at this speed; null where nothing does up to the depth examined.
    pub first: Option<FirstLimit>,
    /// Its depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub first_mm: Option<f64>,
}
