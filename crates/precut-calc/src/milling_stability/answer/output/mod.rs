//! The answer: the verdict, the depths that are unstable, forces, motion, and what limits.

mod clamping;
mod growth;
mod intervals;
mod lobes;
mod motion;
mod sides;
mod speeds;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::super::model;
use super::conformance::MillingConformance;

pub use clamping::{
    ClampCriterion, ClampDeciding, ClampLift, ClampRemedy, ClampRemedyKind, ClampStation, ClampTurn, ClampingStatus,
    ContactUse, MillingClamping,
};
pub use growth::{FrequencyShare, InstabilityKind, LeadingMultiplier};
pub use intervals::{CrossingMethod, DepthLine, OtherAssumptions, UnstableInterval};
pub use lobes::{LobeIntervals, MillingBoundary, MillingClampMap, MillingLobes, MillingMap, SpeedStatus};
pub use motion::{MillingMotion, WallSide, WallSurface};
pub use sides::{MeasuredSide, ModeShare, ReceptanceLimit, RigidLimits, YieldingSide};
pub use speeds::{CutterProposal, PocketLimit, ProposalKind, SpeedCurve, SpeedPocket};

/// Whether the cut holds still, and what it does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "MillingStabilityResult")]
pub struct Outcome {
    /// What happens; null where no verdict is asked for.
    pub verdict: Option<MillingVerdict>,
    /// The cutter in its cut.
    pub engagement: MillingEngagement,
    /// Force, torque and power with undisturbed chips.
    pub force: MillingForces,
    /// The leading Floquet multiplier; null where no verdict is asked for, and of a slow cut whose teeth or speed are uneven.
    pub multiplier: Option<LeadingMultiplier>,
    /// Modes of both sides in the axes of the cut, with their share in the disturbance.
    pub modes: Vec<ModeShare>,
    /// Depth at which this speed first becomes unstable; null where it does not up to `examined_to_mm`, or intervals are not asked for.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub first_limit_mm: Option<f64>,
    /// Depths at which this speed is unstable; only with the analysis `intervals`.
    pub unstable_intervals: Vec<UnstableInterval>,
    /// How deep was looked.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub examined_to_mm: f64,
    /// Depth up to which islands were looked for between the steps: a test of the slope, no proof. Null where intervals are not asked for.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub islands_checked_to_mm: Option<f64>,
    /// Growth over the depth at this speed; only with the analysis `intervals`.
    pub depth_line: Option<DepthLine>,
    /// Limits with one side or direction held rigid, each solved; only with the analysis `intervals`.
    pub limited_by: Option<RigidLimits>,
    /// Sides of which frequency responses were measured: how well their modes are known. The modes themselves stand in `modes`.
    pub measured: Vec<MeasuredSide>,
    /// First limit by the measured lines themselves in place of the modes that were made of them, to half a percent; only with the
    /// analysis `intervals`.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub limit_by_receptance_mm: Option<f64>,
    /// Whether there is such a limit, and why not; null where nothing was measured, or intervals are not asked for.
    pub receptance_limit: Option<ReceptanceLimit>,
    /// Limits with another floor of the chip, or without process damping; only with the analysis `intervals`.
    pub other_assumptions: OtherAssumptions,
    /// The least limit over all speeds by the mean cutting stiffness. No bound: the true limit may lie below. Null where nothing yields.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub zeroth_order_min_mm: Option<f64>,
    /// Its frequency.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub zeroth_order_frequency_hz: Option<f64>,
    /// The motion that the chips force; only with the analysis `motion`, and null where it goes beyond the model.
    pub motion: Option<MillingMotion>,
    /// How hard the workpiece must be clamped; only with the analysis `clamping`.
    pub clamping: Option<MillingClamping>,
    /// Limits over the spindle speed; only with the analysis `lobes`.
    pub lobes: Option<MillingLobes>,
    /// The best speeds by removal rate within all limits, each solved as it is printed; only with the analysis `speeds`.
    pub speeds: Vec<SpeedPocket>,
    /// What every speed allows; only with the analysis `speeds`.
    pub speed_curve: Option<SpeedCurve>,
    /// Other cutters and a varying speed that would remove at least 5 % more at this speed, each solved; only with the analysis `proposals`.
    pub proposals: Vec<CutterProposal>,
    /// How probable it is that the cut stays quiet and every limit is kept; only with the analysis `certainty`, and null where nothing
    /// is uncertain.
    pub conformance: Option<MillingConformance>,
    /// How much there was to compute.
    pub cost: MillingCost,
}

/// What happens at the working point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingVerdict {
    /// The worst of what happens.
    pub state: MillingState,
    /// First limit over working depth, where there is one.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub depth_margin: Option<f64>,
    /// What the spindle gives over what the cut asks, the lesser of power and torque, where a limit is known at this speed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub drive_margin: Option<f64>,
}

/// The worst of what happens, what hurts first before the rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum MillingState {
    /// A disturbance dies away, and every limit is kept.
    Stable,
    /// A disturbance grows.
    Chatter,
    /// A disturbance dies out from tooth to tooth, after growing fifty times and more between two: it marks the surface.
    GrowsWithin,
    /// The multiplier differs from 1 by less than its error.
    Undecided,
    /// The clamp force at hand lets the workpiece slip at the lowest friction, as a whole or at single contacts.
    Slips,
    /// The clamp force at hand lets a contact open.
    Opens,
    /// The cutter lifts the workpiece off all that it rests on; friction alone holds it down.
    Lifts,
    /// The spindle has not the power or the torque.
    Overloaded,
    /// Motion, surface error or roughness pass what is allowed.
    SurfaceOut,
}

/// The cutter in its cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingEngagement {
    /// Angle at which a tooth enters, from across the feed.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub entry_angle_deg: f64,
    /// Angle at which it leaves.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub exit_angle_deg: f64,
    /// Width of the milled strip.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub width_mm: f64,
    /// Teeth in the arc on average.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub teeth_in_cut_mean: f64,
    /// Depth after which a helical edge looks the same; null for straight or unequal ones.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub helix_pitch_mm: Option<f64>,
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: f64,
    /// Cutting speed.
    #[schema(extensions(("x-unit" = json!("m/min"))))]
    pub speed_m_per_min: f64,
    /// Feed per tooth.
    #[schema(extensions(("x-unit" = json!("mm/tooth"))))]
    pub feed_mm_per_tooth: f64,
    /// Table feed.
    #[schema(extensions(("x-unit" = json!("mm/min"))))]
    pub feed_mm_per_min: f64,
    /// Teeth per second.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub tooth_frequency_hz: f64,
    /// Material removal rate at the working depth.
    #[schema(extensions(("x-unit" = json!("cm3/min"))))]
    pub removal_rate_cm3_per_min: f64,
}

/// Force, torque and power with undisturbed chips, and what the spindle gives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingForces {
    /// On the tool: x along the feed, y across it, z away from the work.
    pub tool: ForceOfSide,
    /// On the workpiece; a positive force along z lifts it.
    pub work: ForceOfSide,
    /// Mean torque on the cutter.
    #[schema(extensions(("x-unit" = json!("N m"))))]
    pub torque_mean_n_m: f64,
    /// Its largest value.
    #[schema(extensions(("x-unit" = json!("N m"))))]
    pub torque_max_n_m: f64,
    /// Mean power at the cutter.
    #[schema(extensions(("x-unit" = json!("kW"))))]
    pub power_kw: f64,
    /// Mean power of the motor, with the efficiency of the spindle; that at the cutter where no spindle is given.
    #[schema(extensions(("x-unit" = json!("kW"))))]
    pub motor_power_kw: f64,
    /// Power that the motor has at this speed; null where nothing is said of it.
    #[schema(extensions(("x-unit" = json!("kW"))))]
    pub power_limit_kw: Option<f64>,
    /// Torque that the spindle has at this speed; null where nothing is said of it.
    #[schema(extensions(("x-unit" = json!("N m"))))]
    pub torque_limit_n_m: Option<f64>,
    /// Depth at which the power gives out at this speed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub power_depth_mm: Option<f64>,
    /// Depth at which the torque gives out at this speed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub torque_depth_mm: Option<f64>,
}

/// Mean and extremes of a force by direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ForceOfSide {
    /// Along the feed, mean.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub x_mean_n: f64,
    /// Along the feed, least.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub x_min_n: f64,
    /// Along the feed, largest.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub x_max_n: f64,
    /// Across the feed, mean.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub y_mean_n: f64,
    /// Across the feed, least.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub y_min_n: f64,
    /// Across the feed, largest.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub y_max_n: f64,
    /// Along the spindle, mean.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub z_mean_n: f64,
    /// Along the spindle, least.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub z_min_n: f64,
    /// Along the spindle, largest.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub z_max_n: f64,
}

impl ForceOfSide {
    pub(super) fn of(mean: model::Vector, min: model::Vector, max: model::Vector) -> Self {
        // What is nothing but rounding is nothing.
        let most = min.iter().chain(&max).fold(0.0_f64, |most, force| most.max(force.abs()));
        let clean = |of: model::Vector| of.map(|force| if force.abs() <= 1e-12 * most { 0.0 } else { force });
        let (mean, min, max) = (clean(mean), clean(min), clean(max));
        Self {
            x_mean_n: mean[0],
            x_min_n: min[0],
            x_max_n: max[0],
            y_mean_n: mean[1],
            y_min_n: min[1],
            y_max_n: max[1],
            z_mean_n: mean[2],
            z_min_n: min[2],
            z_max_n: max[2],
        }
    }
}

/// How much there was to compute.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingCost {
    /// Oscillations of the fastest mode in a period of the cut.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub oscillations_per_period: f64,
    /// What was estimated before.
    #[schema(extensions(("x-unit" = json!("ms"))))]
    pub estimate_ms: f64,
}
