//! The answer: the verdict, the depths that are unstable, forces, motion, and what limits.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::receptance_fit::{Direction, FittedFunction, FittedGroup, ModeCertainty};

use super::super::model;
use super::conformance::MillingConformance;

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

/// A stretch of depths at which a speed is unstable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct UnstableInterval {
    /// Where it begins; null at the least depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub from_mm: Option<f64>,
    /// Where it ends; null where it goes on beyond `examined_to_mm`.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub to_mm: Option<f64>,
    /// How it begins, or ends where no beginning is known.
    pub kind: InstabilityKind,
    /// Below its beginning: there the modulus with its error is below 1.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub from_low_mm: Option<f64>,
    /// Above its beginning: there the modulus less its error is above 1.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub from_high_mm: Option<f64>,
    /// Below its end: unstable there.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub to_low_mm: Option<f64>,
    /// Above its end: stable there.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub to_high_mm: Option<f64>,
    /// By what it was found.
    pub found_by: CrossingMethod,
    /// Whether all of these brackets hold for the error of the modulus; never of a closed form, which has none.
    pub certified: bool,
}

/// By what the ends of an unstable stretch were found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CrossingMethod {
    /// By the Floquet multiplier, with a bracket.
    Multiplier,
    /// By the closed form of a slow cut.
    ClosedForm,
}

/// Growth over the depth at one speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DepthLine {
    /// Depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Modulus from tooth to tooth.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub per_tooth: Vec<f64>,
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

/// First limits under other assumptions; null where the assumption plays no part, or no limit was found up to `examined_to_mm`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OtherAssumptions {
    /// With half the floor of the chip.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub floor_halved_limit_mm: Option<f64>,
    /// With twice the floor.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub floor_doubled_limit_mm: Option<f64>,
    /// Without process damping, where its coefficient was not measured.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub without_process_damping_limit_mm: Option<f64>,
}

/// The motion of the tool against the work that the chips force, and the surface that it leaves. It is what is seen while the cut is stable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingMotion {
    /// Along the feed, least.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub x_min_um: f64,
    /// Along the feed, largest.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub x_max_um: f64,
    /// Across the feed, least.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub y_min_um: f64,
    /// Across the feed, largest.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub y_max_um: f64,
    /// Along the spindle, least.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub z_min_um: f64,
    /// Along the spindle, largest.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub z_max_um: f64,
    /// Largest peak-to-peak motion of a direction.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_to_peak_um: f64,
    /// Walls that the cutter leaves; none where teeth begin and end inside the work.
    pub walls: Vec<WallSurface>,
}

/// A wall that the cutter leaves. Errors are positive where too much is removed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WallSurface {
    /// At which side of the cutter it stands.
    pub wall: WallSide,
    /// Height above the tip.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub height_mm: Vec<f64>,
    /// Error at that height.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub surface_error_um: Vec<f64>,
    /// Least error.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub error_min_um: f64,
    /// Largest error.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub error_max_um: f64,
    /// Roughness along the feed at half the depth, peak to valley.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roughness_rz_um: f64,
    /// Its mean deviation.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roughness_ra_um: f64,
}

/// At which side of the cutter a wall stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WallSide {
    /// Where teeth begin with no chip.
    Up,
    /// Where teeth end with none.
    Down,
}

/// How hard the workpiece must be clamped. Forces are those by which it holds at the lowest friction, with the safety on the loads.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingClamping {
    /// How the clamp force at hand holds.
    pub status: ClampingStatus,
    /// Least clamp force at which no contact slips or opens at any instant; null where none holds.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_min_n: Option<f64>,
    /// The same at the likely friction.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub at_likely_friction_n: Option<f64>,
    /// The same at the highest friction.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub at_high_friction_n: Option<f64>,
    /// The same by the mean force of the cut.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub against_mean_n: Option<f64>,
    /// Below this the workpiece slips for certain, whatever friction does; null where that is not known.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub certain_slip_below_n: Option<f64>,
    /// The same by the mean force of the cut.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub certain_slip_by_mean_n: Option<f64>,
    /// Places of the cut, in the order in which they are numbered, and what each asks for.
    pub stations: Vec<ClampStation>,
    /// Whether the job states no place but the first, so that the ends of the way along the feed were taken.
    pub stations_assumed: bool,
    /// What asks for the least clamp force; null where none holds, or nothing asks for any.
    pub decides: Option<ClampDeciding>,
    /// Factor on the loads at which a contact slips or opens; null without a clamp force at hand.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub clamp_safety: Option<f64>,
    /// Factor on the loads beyond which slip is certain; null without a clamp force at hand.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub certain_slip_safety: Option<f64>,
    /// Least friction, the same everywhere, by which the clamp force at hand holds; null without one, or where a contact opens.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub friction_needed: Option<f64>,
    /// Largest upward force of the cut on the workpiece.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub upward_n: f64,
    /// Contacts without clamp force that come off; no failure by itself.
    pub lifts: Vec<ClampLift>,
    /// Largest force that takes the workpiece off all such contacts at once; null where one of them always stays.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub comes_off_n: Option<f64>,
    /// Peak of what the springs of the work carry over that of the static force; 1 where the work is rigid, null where the motion is not known.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub dynamic_factor: Option<f64>,
    /// Contacts, at the clamp force at hand, else at the least that holds.
    pub contacts: Vec<ContactUse>,
    /// Clamp force that is asked for over a period of the cut.
    pub over_turn: ClampTurn,
    /// What would hold where no clamp force does; it was solved.
    pub remedy: Option<ClampRemedy>,
}

/// A place of the cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampStation {
    /// Where, along X of the fixture.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub x_mm: f64,
    /// Along Y.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub y_mm: f64,
    /// Along Z.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Least clamp force that holds while the cut acts there; null where none holds.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_min_n: Option<f64>,
}

/// How a clamp force holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClampingStatus {
    /// No contact slips or opens.
    Holds,
    /// Single contacts slip; the workpiece may stay.
    Creeps,
    /// The workpiece slips for certain.
    Slips,
    /// A contact opens.
    Opens,
    /// None is at hand.
    NoForceGiven,
    /// None would do.
    CannotHold,
}

impl ClampingStatus {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Creeps => "creeps",
            Self::Slips => "slips",
            Self::Opens => "opens",
            Self::NoForceGiven => "no_force_given",
            Self::CannotHold => "cannot_hold",
        }
    }
}

/// What asks for the least clamp force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampDeciding {
    /// Number of the contact, from 1.
    #[schema(minimum = 1, extensions(("x-unit" = json!("1"))))]
    pub contact: u32,
    /// Number of the place of the cut, from 1.
    #[schema(minimum = 1, extensions(("x-unit" = json!("1"))))]
    pub station: u32,
    /// Rotation of the cutter in its period.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub rotation_deg: f64,
    /// What fails first.
    pub criterion: ClampCriterion,
}

/// What fails at a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClampCriterion {
    /// Its friction is used up.
    Slip,
    /// Its normal force is gone.
    Opening,
}

/// A contact that comes off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampLift {
    /// Number of the contact, from 1.
    #[schema(minimum = 1, extensions(("x-unit" = json!("1"))))]
    pub contact: u32,
    /// Force of the cut off it; below 0 where the workpiece rocks off it.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub off_n: f64,
}

/// What a contact carries.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ContactUse {
    /// Where, along X of the fixture.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub x_mm: f64,
    /// Along Y.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub y_mm: f64,
    /// Along Z.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Normal force at rest.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub rest_n: f64,
    /// Least normal force under the cut.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub least_normal_n: f64,
    /// Largest force across the normal.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub tangential_n: f64,
    /// Share of its lowest friction that is used; null where it opens or comes off.
    #[schema(extensions(("x-unit" = json!("percent"))))]
    pub friction_used_percent: Option<f64>,
}

/// Clamp force that is asked for over a period of the cut, the largest of all places of the cut.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampTurn {
    /// Rotation.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub rotation_deg: Vec<f64>,
    /// Clamp force at which no contact slips or opens.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_n: Vec<f64>,
}

/// What would hold, as one more contact or two.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampRemedy {
    /// What is added.
    pub kind: ClampRemedyKind,
    /// Where, along X of the fixture; of a pair the clamp, the locator lies opposite about the middle of the contacts.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub x_mm: f64,
    /// Along Y.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub y_mm: f64,
    /// Along Z.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Direction into the workpiece, along X.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub normal_x: f64,
    /// Along Y.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub normal_y: f64,
    /// Along Z.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub normal_z: f64,
    /// How far from the clamp of a pair its locator lies, along the normal; null for a stop.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub apart_mm: Option<f64>,
    /// Clamp force that holds then.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_min_n: f64,
}

/// What is added to a fixture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClampRemedyKind {
    /// A locator.
    Stop,
    /// A clamp and a locator opposite to it.
    SecondPair,
}

/// Limits over the spindle speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingLobes {
    /// The boundary, speed by speed.
    pub boundary: MillingBoundary,
    /// Unstable stretches of all speeds, islands included.
    pub intervals: LobeIntervals,
    /// The multiplier over the plane, where it is asked for.
    pub map: Option<MillingMap>,
    /// The clamp force over the plane, where it is asked for with the map and the analysis `clamping`.
    pub clamp_map: Option<MillingClampMap>,
    /// How deep was looked.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub examined_to_mm: f64,
}

/// Limits at the speeds that were looked at, rising.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingBoundary {
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Depth at which it first becomes unstable; null where it does not, or the speed is not answered.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub chatter_mm: Vec<Option<f64>>,
    /// Depth at which the power of the spindle gives out.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub power_mm: Vec<Option<f64>>,
    /// Depth at which its torque gives out.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub torque_mm: Vec<Option<f64>>,
    /// Whether a speed is answered.
    pub status: Vec<SpeedStatus>,
}

/// Whether a speed is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SpeedStatus {
    /// It is.
    Answered,
    /// So slow that thousands of oscillations go into a period.
    TooSlow,
    /// The modulation of the speed fits into no period there.
    Incommensurate,
}

impl SpeedStatus {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Answered => "answered",
            Self::TooSlow => "too_slow",
            Self::Incommensurate => "incommensurate",
        }
    }
}

/// Unstable stretches, row by row.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LobeIntervals {
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Where the stretch begins.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub from_mm: Vec<f64>,
    /// Where it ends; null where it goes on beyond what was looked at.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub to_mm: Vec<Option<f64>>,
    /// How it begins.
    pub kind: Vec<InstabilityKind>,
}

/// The multiplier over speed and depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingMap {
    /// Columns.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Rows.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Modulus from tooth to tooth, row by row; null where a speed is not answered.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub per_tooth: Vec<Option<f64>>,
}

/// The least clamp force by which no contact slips or opens at the lowest friction, over speed and depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingClampMap {
    /// Columns.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Rows.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// In the forced motion, row by row; null where the cut chatters, the speed is not answered or no clamp force holds.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_n: Vec<Option<f64>>,
    /// Against the largest static force of each row, at any speed; null where no clamp force holds.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub static_n: Vec<Option<f64>>,
    /// Against the mean force of each row, at any speed; null where no clamp force holds.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub mean_n: Vec<Option<f64>>,
}

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
