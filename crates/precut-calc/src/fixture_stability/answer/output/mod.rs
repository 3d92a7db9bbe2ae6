//! The answer: the verdict, how the cut forces the workpiece, and what limits depth and clamp force.

mod clamp;
mod growth;
mod limits;
mod lobes;
mod motion;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::fixture_stability::answer::conformance::FixtureConformance;
use crate::fixture_stability::answer::probable_depths::ProbableDepths;

pub use clamp::{ClampForce, PushedAlong, SlipForce, TextbookForce};
pub use growth::{ChatterKind, FloquetMultiplier, ZerothOrder};
pub use limits::{BetterSpeed, DepthLimits, FirstLimit, SpeedLimit};
pub use lobes::{LobeBoundary, LobeDiagram, LobeMap};
pub use motion::{AmplitudeCurve, ArcProfile, ForcedMotion, Histories, Oscillogram, Simulated};

/// Whether the workpiece holds still enough in its vise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "FixtureStabilityResult")]
pub struct FixtureOutcome {
    /// What happens.
    pub verdict: FixtureVerdict,
    /// Teeth in cut.
    pub engagement: Engagement,
    /// Force and displacement if nothing moved fast.
    pub quasi_static: QuasiStatic,
    /// What the cut asks of the spindle, and what that gives.
    pub drive: CuttingDrive,
    /// Modes of the closed vise without cutting, rising.
    pub modes: Vec<VibrationMode>,
    /// The largest Floquet multiplier of the motion with both joints closed.
    pub multiplier: FloquetMultiplier,
    /// Depth at which chatter begins at this speed, of a slow cut also by growth between two teeth; null where none begins up to
    /// `depth_examined_mm`.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub chatter_depth_mm: Option<f64>,
    /// Depth up to which limits were looked for.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_examined_mm: f64,
    /// The zeroth-order approximation beside it.
    pub zeroth_order: ZerothOrder,
    /// The exact forced motion with both joints closed. It is what is seen while the motion is stable.
    pub forced: ForcedMotion,
    /// The cut in time, from the entry on; null of a slow cut, hundreds of oscillations from tooth to tooth, which closed forms describe.
    pub simulation: Option<Simulated>,
    /// Least clamp force; only with the analysis `clamp_force`.
    pub clamp: Option<ClampForce>,
    /// Limits of the depth; only with the analysis `limits`.
    pub limits: Option<DepthLimits>,
    /// The lobe diagram; only with the analysis `lobes`.
    pub lobes: Option<LobeDiagram>,
    /// Oscillograms; only with the analysis `history`.
    pub history: Option<Histories>,
    /// How probable it is that the cut stays quiet; null where nothing is uncertain, and where it would take long and the analysis
    /// `certainty` is not asked.
    pub conformance: Option<FixtureConformance>,
    /// Depths that are stable with a probability over the spindle speed; only with the analysis `certainty`, and of a vise with one
    /// mode, even teeth and linear joints.
    pub probable_depths: Option<ProbableDepths>,
}

/// What happens at the working point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FixtureVerdict {
    /// The worst of what happens.
    pub state: FixtureState,
    /// Which joint opens, where one does.
    pub joint: Option<OpenJoint>,
    /// When a joint first opens, from the entry.
    #[schema(extensions(("x-unit" = json!("s"))))]
    pub first_opening_s: Option<f64>,
    /// Share of the steady time in which any joint is open.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub open_share: f64,
    /// Share of the steps of teeth in the arc that cut nothing.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lost_cut_share: f64,
    /// Peak-to-peak displacement of the workpiece in the steady state.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_um: f64,
    /// The same over the feed per tooth: above 1 the source paper calls the process unusable.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub peak_to_peak_over_feed: f64,
    /// Estimated error of the peak-to-peak displacement; null where chatter was simulated without `verified`.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_error_um: Option<f64>,
    /// Largest displacement from the clamped equilibrium, either way.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_max_um: f64,
    /// Chatter limit over working depth, where there is a limit.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub depth_margin: Option<f64>,
    /// Clamp force over what the steady motion asks, where a force is given and some is asked.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub clamp_margin: Option<f64>,
    /// What the spindle gives over what smooth chips ask of it, the lesser of power and torque, where a limit is known at this speed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub drive_margin: Option<f64>,
}

/// The worst of what happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FixtureState {
    /// The workpiece follows the cut, nothing grows.
    Stable,
    /// Teeth leave the cut although the closed vise is stable.
    ChipLost,
    /// Vibration grows until teeth leave the cut.
    Chatter,
    /// A joint opens.
    JointOpen,
    /// The workpiece would hold still, but the spindle has not the power or the torque for the cut.
    SpindleOverloaded,
}

impl FixtureState {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::ChipLost => "chip_lost",
            Self::Chatter => "chatter",
            Self::JointOpen => "joint_open",
            Self::SpindleOverloaded => "spindle_overloaded",
        }
    }
}

/// Which joint opens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum OpenJoint {
    /// At the movable jaw.
    Movable,
    /// At the fixed jaw.
    Fixed,
    /// Each in its turn.
    Both,
}

/// Teeth in cut and what follows from the regime.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Engagement {
    /// Angle at which a tooth enters, from the normal to the feed on the entry side.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub entry_angle_deg: f64,
    /// Angle at which it leaves.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub exit_angle_deg: f64,
    /// The arc between.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub arc_deg: f64,
    /// Teeth in cut on average.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub teeth_in_cut_mean: f64,
    /// Most teeth in cut.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub teeth_in_cut_max: u32,
    /// Fewest teeth in cut.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub teeth_in_cut_min: u32,
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

/// Force along the feed with smooth chips, and what it would do slowly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct QuasiStatic {
    /// Largest force, positive toward the movable jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_max_n: f64,
    /// Smallest force.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_min_n: f64,
    /// Stiffness along the feed: both joints, or the fixed one where the movable jaw follows.
    #[schema(extensions(("x-unit" = json!("N/mm"))))]
    pub stiffness_n_per_mm: f64,
    /// Displacement by the largest force.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_max_um: f64,
    /// Displacement by the smallest force.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_min_um: f64,
}

/// What the cut asks of the spindle with smooth chips, as every stable cut leaves them, and what that gives at this speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CuttingDrive {
    /// Mean torque on the cutter.
    #[schema(extensions(("x-unit" = json!("N m"))))]
    pub torque_mean_n_m: f64,
    /// Its largest value from tooth to tooth, which the inertia of the spindle carries.
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

/// A mode of the closed vise without cutting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct VibrationMode {
    /// Undamped.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub natural_frequency_hz: f64,
    /// Damped.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub damped_frequency_hz: f64,
    /// Damping ratio.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub damping_ratio: f64,
}
