//! The answer: the verdict, how the cut forces the workpiece, and what limits depth and clamp force.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::fixture_stability::answer::conformance::FixtureConformance;
use crate::fixture_stability::answer::probable_depths::ProbableDepths;

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

/// The forced motion with both joints closed: exact but for its sampling, whose error is below 1e-6.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ForcedMotion {
    /// Largest displacement, positive toward the movable jaw.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_max_um: f64,
    /// Smallest displacement.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_min_um: f64,
    /// Their difference.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_um: f64,
    /// Displacement where a tooth enters.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_at_entry_um: f64,
    /// Displacement where a tooth leaves.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_at_exit_um: f64,
    /// Peak-to-peak over the quasi-static difference.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub dynamic_factor: Option<f64>,
    /// Clamp force that the joint at the movable jaw asks for.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_n: f64,
    /// Clamp force that the joint at the fixed jaw asks for.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_n: f64,
}

/// The cut in time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Simulated {
    /// Steps per tooth pitch.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub steps_per_tooth: u32,
    /// Tooth periods.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub tooth_periods: u32,
    /// Tooth periods at the end over which the steady values were taken.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub steady_tooth_periods: u32,
    /// Whether the displacement grew beyond all bounds.
    pub diverged: bool,
    /// Whether once-per-tooth samples of the displacement settled.
    pub settled: bool,
    /// Scatter of the once-per-tooth samples in the steady state, over the feed per tooth.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub sample_scatter: f64,
    /// Largest displacement in the steady state.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_max_um: f64,
    /// Smallest.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_min_um: f64,
    /// Their difference.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_um: f64,
    /// Largest force along the feed.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_max_n: f64,
    /// Smallest.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_min_n: f64,
    /// Largest effective feed of any tooth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub effective_feed_max_mm: f64,
    /// Smallest; 0 where a tooth leaves the cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub effective_feed_min_mm: f64,
    /// Share of tooth-steps in the arc without a chip.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lost_cut_share: f64,
    /// When a tooth first lost the cut.
    #[schema(extensions(("x-unit" = json!("s"))))]
    pub first_lost_cut_s: Option<f64>,
    /// Clamp force that the joint at the movable jaw asks for in the steady state.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_n: f64,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_n: f64,
    /// The same from the entry on: joint at the movable jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_entry_n: f64,
    /// Joint at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_entry_n: f64,
    /// Whether joints could open: a clamp force was given.
    pub unilateral: bool,
    /// Share of the steady time in which the joint at the movable jaw is open.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub open_movable_share: f64,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub open_fixed_share: f64,
    /// Both at once.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub open_both_share: f64,
    /// Change of the peak-to-peak displacement with half the step; only with `verified`.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub halved_step_change_um: Option<f64>,
}

/// Least clamp force for a regime in which no joint opens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampForce {
    /// Clamp force below which a joint opens in the steady state; null where the cut chatters and its simulation shows no steady state.
    #[schema(extensions(
        ("x-unit" = json!("N")),
        ("x-bars" = json!({
            "asks": [["static_movable_n", "static_fixed_n"], ["least_n"], ["least_with_entry_n"]],
            "needs": ["least_n", "least_with_entry_n"],
            "set": "/fixture/clamp_force_n",
        }))
    ))]
    pub least_n: Option<f64>,
    /// The same with the hard entry.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub least_with_entry_n: Option<f64>,
    /// Which joint asks for it; null where none asks for any.
    pub binding_joint: Option<OpenJoint>,
    /// Steady state: joint at the movable jaw, with its damping.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub movable_n: Option<f64>,
    /// Joint at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub fixed_n: Option<f64>,
    /// Elastic part alone: joint at the movable jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub movable_elastic_n: Option<f64>,
    /// Joint at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub fixed_elastic_n: Option<f64>,
    /// What a textbook asks: the static force on the joint at the movable jaw, factor 1.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub static_movable_n: f64,
    /// On the joint at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub static_fixed_n: f64,
    /// The safety factor that opening asks on the static force; null where the static force is 0, or what is needed is not known.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor_needed: Option<f64>,
    /// The same with the hard entry.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor_needed_with_entry: Option<f64>,
    /// Whether it comes from the exact forced motion (stable) or from a simulated chatter that should not be run.
    pub stable: bool,
    /// What pushes the workpiece along the jaws, where only friction holds it.
    pub along: PushedAlong,
    /// Clamp force by which friction holds that; null where the job does not say how the jaws grip, and in chatter.
    pub slip: Option<SlipForce>,
    /// Deepest cut that the given clamp force holds, where it is reached before chatter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_for_given_force_mm: Option<f64>,
    /// What happens if the joint at the movable jaw opens: modulus of the multiplier of what is left in the cut, a drift as one body left out.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus_movable_open: f64,
    /// If that at the fixed jaw opens.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus_fixed_open: f64,
    /// Textbook safety factors beside it.
    pub textbook: Vec<TextbookForce>,
}

/// Force of smooth chips on the workpiece along the jaws, where only friction holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PushedAlong {
    /// Across the feed, mean.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub across_mean_n: f64,
    /// Across the feed, largest either way.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub across_peak_n: f64,
    /// Upward, mean; 0 where the cut presses down.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub upward_mean_n: f64,
    /// Upward, largest.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub upward_peak_n: f64,
}

/// Clamp force by which friction holds the workpiece at every instant of the forced motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SlipForce {
    /// With the lowest friction: the force to set where it is above that against opening.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_min_n: f64,
    /// With the likely friction.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub at_likely_friction_n: f64,
    /// With the highest friction.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub at_high_friction_n: f64,
    /// Against the mean forces alone, without vibration, with the lowest friction.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub against_mean_n: f64,
    /// Friction with which the given clamp force holds; null where none is given, or some moment leaves no normal force.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub friction_needed: Option<f64>,
    /// Whether the given clamp force holds with the lowest friction; null where none is given.
    pub holds: Option<bool>,
}

/// Static clamp force times a safety factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TextbookForce {
    /// Safety factor.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor: f64,
    /// Clamp force with it.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_n: f64,
    /// Whether it is enough in the steady state.
    pub enough: bool,
}

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

/// One entry per depth.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct AmplitudeCurve {
    /// Depth of cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Modulus of the multiplier.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus: Vec<f64>,
    /// Peak-to-peak displacement with joints that stay closed: exact where stable, simulated where not.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_um: Vec<f64>,
    /// Clamp force that the joint at the movable jaw asks for (elastic part).
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_n: Vec<f64>,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_n: Vec<f64>,
    /// Share of tooth-steps in the arc without a chip.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lost_cut_share: Vec<f64>,
}

/// The lobe diagram.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LobeDiagram {
    /// The traced boundary, by spindle speed.
    pub boundary: LobeBoundary,
    /// Lowest limit on it.
    pub lowest: Option<SpeedLimit>,
    /// Speeds at which more can be removed than at the working speed, each tried, the highest removal rate first.
    pub better_speeds: Vec<BetterSpeed>,
    /// |multiplier| over the plane, where it was asked for.
    pub map: Option<LobeMap>,
}

/// The traced boundary: one entry per spindle speed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LobeBoundary {
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Depth up to which limits are looked for: the greatest of the diagram; less where joints harden and no forced motion
    /// is found in a deeper cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_examined_mm: Vec<f64>,
    /// Depth at which chatter begins; null where none begins up to the depth examined.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub chatter_mm: Vec<Option<f64>>,
    /// Depth at which it ends again (above an island), where it does.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub stable_again_mm: Vec<Option<f64>>,
    /// Depth at which the forced peak-to-peak displacement exceeds the feed per tooth, without chatter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub amplitude_mm: Vec<Option<f64>>,
    /// Depth at which the joint at the movable jaw opens at the given clamp force, without chatter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub movable_opens_mm: Vec<Option<f64>>,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub fixed_opens_mm: Vec<Option<f64>>,
    /// Depth at which the workpiece slips along the jaws at the given clamp force and the lowest friction, without chatter; null where none of both is given, too.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub slips_mm: Vec<Option<f64>>,
    /// Depth at which the power of the spindle gives out, up to the greatest depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub power_mm: Vec<Option<f64>>,
    /// Depth at which the torque of the spindle gives out, up to the greatest depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub torque_mm: Vec<Option<f64>>,
    /// The zeroth-order approximation.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub zeroth_order_mm: Vec<Option<f64>>,
}

impl LobeBoundary {
    /// How deep was looked where no chatter begins; `None` where that is the same at every speed.
    pub(in crate::fixture_stability) fn examined_without_chatter_mm(&self) -> Option<Vec<Option<f64>>> {
        /// Of the depth; beyond the round-off of a depth, which is a share of the greatest.
        const SAME: f64 = 1e-9;
        let greatest = self.depth_examined_mm.iter().copied().fold(0.0, f64::max);
        let without = self.depth_examined_mm.iter().zip(&self.chatter_mm);
        let depths: Vec<Option<f64>> = without.map(|(depth, chatter)| chatter.is_none().then_some(*depth)).collect();
        depths.iter().flatten().any(|depth| *depth < (1.0 - SAME) * greatest).then_some(depths)
    }

    /// How deep one may cut at each speed: the least of all limits, no deeper than was looked.
    pub(in crate::fixture_stability) fn safe_mm(&self) -> Vec<f64> {
        let limits = [
            &self.chatter_mm,
            &self.amplitude_mm,
            &self.movable_opens_mm,
            &self.fixed_opens_mm,
            &self.power_mm,
            &self.torque_mm,
        ];
        let least = |at: usize| {
            limits.iter().filter_map(|limit| limit.get(at).copied().flatten()).fold(f64::INFINITY, f64::min)
        };
        self.depth_examined_mm.iter().enumerate().map(|(at, depth)| depth.min(least(at))).collect()
    }
}

/// |multiplier| over speed and depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LobeMap {
    /// Spindle speeds of the columns.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Depths of the rows.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Modulus per tooth period, row by row; null where joints harden and no forced motion is found about which to ask.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus: Vec<Option<f64>>,
    /// Points of the boundary found by halving cells, spindle speeds.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub refined_speed_rpm: Vec<f64>,
    /// The same, depths.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub refined_depth_mm: Vec<f64>,
}

impl LobeMap {
    pub(in crate::fixture_stability) fn of(map: crate::fixture_stability::model::lobes::Map) -> Self {
        let (refined_speed_rpm, refined_depth_mm) = map.refined.into_iter().unzip();
        Self {
            spindle_speed_rpm: map.speeds_rpm,
            depth_mm: map.depths_mm,
            modulus: map.modulus.into_iter().map(|modulus| Some(modulus).filter(|m| m.is_finite())).collect(),
            refined_speed_rpm,
            refined_depth_mm,
        }
    }
}

/// Oscillograms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Histories {
    /// From the entry on.
    pub entry: Oscillogram,
    /// The last revolution.
    pub steady: Oscillogram,
    /// The last pass over every place of the arc.
    pub arc: ArcProfile,
}

/// One entry per moment.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Oscillogram {
    /// Time since the entry.
    #[schema(extensions(("x-unit" = json!("s"))))]
    pub time_s: Vec<f64>,
    /// Displacement of the workpiece, positive toward the movable jaw.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub displacement_um: Vec<f64>,
    /// Displacement of the movable jaw, where it moves by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub jaw_um: Option<Vec<f64>>,
    /// Force along the feed.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_n: Vec<f64>,
    /// Effective feed of the tooth that entered last.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub effective_feed_mm: Vec<Option<f64>>,
    /// Clamp force that the joint at the movable jaw asks for.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_n: Vec<f64>,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_n: Vec<f64>,
}

/// Chip along the arc.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ArcProfile {
    /// Angle of the tooth.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: Vec<f64>,
    /// Effective feed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub effective_feed_mm: Vec<f64>,
    /// Chip thickness.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub chip_thickness_mm: Vec<f64>,
    /// Chip thickness with a smooth feed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub smooth_chip_mm: Vec<f64>,
}
