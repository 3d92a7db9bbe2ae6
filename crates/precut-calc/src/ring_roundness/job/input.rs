//! The job: a ring, its supports, the tool, and what is asked.

use serde::{Deserialize, Serialize};
use utoipa::{PartialSchema, ToSchema};

use crate::calculator::{Measured, MeasuredRow};
use crate::effects::{RingConditions, RingEffect};

use crate::ring_roundness::job::cut_force::ForceLaw;
use crate::ring_roundness::job::input_ranges::{MapRange, SearchRange, SpeedRange};
use crate::ring_roundness::job::uncertain::RingUncertainty;

/// Most steps of a run, revolutions times samples.
pub(in crate::ring_roundness) const MAX_STEPS: f64 = 2e9;
/// Nodes of a job that states none.
pub(in crate::ring_roundness) const DEFAULT_SAMPLES: u32 = 3600;

/// A ring that is turned while it rests with the surface being turned on two supports.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "RingRoundnessJob")]
pub struct Job {
    /// The ring before the cut, by its form; left out where `measured_profile` gives it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("workpiece"))))]
    pub ring: Option<Ring>,
    /// The ring before the cut as measured: radius over body angle, by rising angle; a periodic cubic spline runs through
    /// the points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = Measured::<ProfileRow>::schema, extensions(("x-group" = json!("workpiece"))))]
    pub measured_profile: Option<Measured<ProfileRow>>,
    /// What the ring rests on.
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub supports: Supports,
    /// Where the tool stands and how it is fed.
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub tool: Tool,
    /// Sense in which the ring turns, seen with x to the right and y up.
    #[serde(default)]
    #[schema(default = "counter_clockwise", example = "counter_clockwise", extensions(("x-group" = json!("machine"))))]
    pub rotation: Rotation,
    /// Thrust-force stiffness of the cut over the static stiffness seen by the tool; 0 is rigid.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1000.0, default = 0.0, example = 0.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("K")), ("x-group" = json!("machine"))))]
    pub compliance_ratio: f64,
    /// Stiffness of cut, tool and supports, from which the compliance ratio follows; in place of `compliance_ratio`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub stiffness: Option<Stiffness>,
    /// Modes of machine and tool with the work speed: chatter that feeds itself. What they give at rest is added to the
    /// compliance ratio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub dynamics: Option<Dynamics>,
    /// Force law of the ring: it gives the stiffness of the cut and the forces that `stiffness`, `dynamics` and `forces` leave
    /// open, at the job's own feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub force: Option<ForceLaw>,
    /// Forces on the ring, to learn whether it stays on its supports.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub forces: Option<Forces>,
    /// What the drawing allows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("workpiece"))))]
    pub tolerance: Option<RingTolerance>,
    /// What is uncertain in the setting, and which probability is wanted; acts with the analysis `certainty`.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub uncertainty: RingUncertainty,
    /// Filter before the circles are fitted.
    #[serde(default)]
    #[schema(default = "upr_50", example = "upr_50", extensions(("x-group" = json!("evaluation"))))]
    pub filter: LongWave,
    /// How the cut is computed.
    #[serde(default)]
    #[schema(default = "exact_contact", example = "exact_contact", extensions(("x-group" = json!("numerics"))))]
    pub method: Method,
    /// Nodes on the circumference, a multiple of 4 from 360. Left out: 3600, with `filter: none` as many as the teeth of the surface need.
    /// With `method: nearest_samples` the points of the paper's algorithm, at most 1000, 500 where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 36, maximum = 200_000, example = 3600, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N")), ("x-group" = json!("numerics")), ("x-code" = json!("bad_samples"))))]
    pub samples: Option<u32>,
    /// With which other numbers of nodes the run is repeated, for the error of every result.
    #[serde(default)]
    #[schema(default = "half_samples", example = "half_samples", extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub error_estimate: ErrorEstimate,
    /// Points of the profiles in the answer.
    #[serde(default = "profile_points")]
    #[schema(minimum = 36, maximum = 20_000, default = 720, example = 720, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m")), ("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub profile_points: u32,
    /// Surfaces on the way that the answer keeps at most, evenly over the revolutions, for a replay; 0 keeps none. Exact contact only.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 200, default = 0, example = 120, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_f")), ("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub replay_frames: u32,
    /// Highest order of waves in spectrum and linear theory.
    #[serde(default = "highest_order")]
    #[schema(minimum = 3, maximum = 100, default = 50, example = 50, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k_max")), ("x-group" = json!("evaluation")), ("x-advanced" = json!(true))))]
    pub highest_order: u32,
    /// What is to be found out.
    #[serde(default = "analyses")]
    #[schema(min_items = 1, max_items = 6, default = json!(["simulation"]), example = json!(["simulation", "linear_theory"]), extensions(("x-group" = json!("evaluation"))))]
    pub analyses: Vec<Analysis>,
    /// Work speeds of the map; acts with the analysis `speed_map`.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("map")), ("x-advanced" = json!(true))))]
    pub speed_map: SpeedRange,
    /// Tool angles and support angles of the map; acts with the analysis `setup_map`.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("map")), ("x-advanced" = json!(true))))]
    pub setup_map: MapRange,
    /// Target and machine limits of the search; needed by the analysis `settings_search`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("search"))))]
    pub settings_search: Option<SearchRange>,
    /// Named physical effects that act beside the base model; only `initial_harmonic`, `roller_runout` and
    /// `chatter_harmonic` may recur, with another order or ratio.
    #[serde(default)]
    #[schema(max_items = 40, extensions(("x-group" = json!("effects"))))]
    pub effects: Vec<RingEffect>,
    /// The state that effects depend on: none of the ring's effects depends on any.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("effects")), ("x-advanced" = json!(true))))]
    pub conditions: RingConditions,
}

fn profile_points() -> u32 {
    720
}
fn highest_order() -> u32 {
    50
}
fn analyses() -> Vec<Analysis> {
    vec![Analysis::Simulation]
}

/// What the drawing allows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RingTolerance {
    /// Roundness deviation about the least-squares circle, after the filter.
    #[schema(exclusive_minimum = 0.0, maximum = 10_000.0, example = 5.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("t"))))]
    pub roundness_um: f64,
}

/// A ring by its form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingForm)]
pub struct Ring {
    /// Mean radius.
    #[schema(minimum = 0.1, maximum = 100_000.0, example = 150.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("R")), ("x-code" = json!("bad_ring_radius"))))]
    pub radius_mm: f64,
    /// Ellipticity: semi-axes R + e/2 and R - e/2, so that the diameters differ by 2e and the roundness deviation is e.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 10_000.0, default = 0.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("e"))))]
    pub ellipticity_mm: f64,
    /// Body angle of the major axis.
    #[serde(default)]
    #[schema(minimum = -360.0, maximum = 360.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("theta_e"))))]
    pub major_axis_deg: f64,
    /// Waves on top.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 200)]
    pub harmonics: Vec<Wave>,
}

/// A wave of the radius: amplitude·cos(order·(θ - angle of maximum)).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingWave)]
pub struct Wave {
    /// Waves per revolution.
    #[schema(minimum = 1, maximum = 2000, example = 3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k"))))]
    pub order: u32,
    /// Amplitude, half of peak to valley.
    #[schema(minimum = 0.0, maximum = 1e7, example = 50.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("A_k"))))]
    pub amplitude_um: f64,
    /// Body angle of a maximum.
    #[serde(default)]
    #[schema(minimum = -360.0, maximum = 360.0, default = 0.0, example = 20.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("theta_k"))))]
    pub angle_of_max_deg: f64,
}

/// A measured point of the profile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingProfileRow)]
pub struct ProfileRow {
    /// Body angle.
    #[schema(minimum = -360.0, maximum = 720.0, example = 12.5, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("theta"))))]
    pub angle_deg: f64,
    /// Radius from the origin of the body.
    #[schema(minimum = 1e-6, maximum = 1e9, example = 150.012, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r")), ("x-code" = json!("bad_ring_radius"))))]
    pub radius_mm: f64,
}

impl MeasuredRow for ProfileRow {
    const MAX_ROWS: usize = 100_000;
}

/// Two supports at equal height.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingSupports)]
pub struct Supports {
    /// Distance between the supports; of rollers between their centres.
    #[schema(minimum = 0.01, maximum = 100_000.0, example = 200.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("L")), ("x-code" = json!("bad_distance"))))]
    pub distance_mm: f64,
    /// How far they lie below the origin of the machine.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 111.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: f64,
    /// Radius of the rollers; 0 for points.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 100_000.0, default = 0.0, example = 20.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r_s"))))]
    pub roller_radius_mm: f64,
}

/// A wide-edge tool: in the cross-section a point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingTool)]
pub struct Tool {
    /// Tip at the start, to the right of the origin of the machine, which lies midway between the supports.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 100.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("L_t"))))]
    pub x_mm: f64,
    /// Tip at the start, above the origin.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 112.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H_t"))))]
    pub y_mm: f64,
    /// Direction of the feed, counter-clockwise from the x axis; 270 is down.
    #[serde(default = "down")]
    #[schema(minimum = -360.0, maximum = 360.0, default = 270.0, example = 270.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("f"))))]
    pub feed_direction_deg: f64,
    /// Feed per revolution of the ring.
    #[schema(minimum = 1e-7, maximum = 10.0, example = 0.005_859_375, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S")), ("x-code" = json!("bad_ring_feed"))))]
    pub feed_mm_per_rev: f64,
    /// Revolutions with feed; need not be whole.
    #[schema(minimum = 0.01, maximum = 1e7, example = 256.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n")), ("x-code" = json!("bad_revolutions"))))]
    pub revolutions: f64,
    /// Revolutions without feed at the end.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1e6, default = 0.0, example = 1.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_s")), ("x-code" = json!("bad_revolutions"))))]
    pub spark_out_revolutions: f64,
    /// Radius of a grinding wheel or cutter in place of the tip, which is then its point nearest to the ring's centre.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 100_000.0, example = 200.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r_w")), ("x-advanced" = json!(true))))]
    pub wheel_radius_mm: Option<f64>,
}

fn down() -> f64 {
    270.0
}

/// Sense of rotation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingRotation)]
pub enum Rotation {
    /// Over the top from right to left.
    #[default]
    CounterClockwise,
    /// Over the top from left to right.
    Clockwise,
}

/// Stiffness of cut, tool and supports.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingStiffness)]
pub struct Stiffness {
    /// Thrust force per mm of depth, specific force times width; left out where `force` gives it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e9, example = 20_000.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("k_c w"))))]
    pub cut_n_per_mm: Option<f64>,
    /// Tool with its holder and slide.
    #[schema(minimum = 1.0, maximum = 1e12, example = 50_000.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("k_T"))))]
    pub tool_n_per_mm: f64,
    /// Left support along its contact normal.
    #[schema(minimum = 1.0, maximum = 1e12, example = 100_000.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("k_A"))))]
    pub support_a_n_per_mm: f64,
    /// Right support along its contact normal.
    #[schema(minimum = 1.0, maximum = 1e12, example = 100_000.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("k_B"))))]
    pub support_b_n_per_mm: f64,
}

/// Modes of machine and tool in the thrust direction, and how fast the ring turns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingDynamics)]
pub struct Dynamics {
    /// Thrust force per mm of depth, specific force times width; left out where `force` gives it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e9, example = 20_000.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("k_c w"))))]
    pub cut_n_per_mm: Option<f64>,
    /// Revolutions of the ring per minute.
    #[schema(minimum = 0.01, maximum = 100_000.0, example = 60.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_w"))))]
    pub work_speed_rpm: f64,
    /// The modes, beside what `compliance_ratio` or `stiffness` state.
    #[schema(min_items = 1, max_items = 8)]
    pub modes: Vec<Mode>,
}

/// A mode, as a hammer test beside the cut finds it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingMode)]
pub struct Mode {
    /// What swings.
    #[serde(default)]
    #[schema(default = "tool", example = "tool")]
    pub at: ModePlace,
    /// Natural frequency.
    #[schema(minimum = 1.0, maximum = 20_000.0, example = 180.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_n"))))]
    pub frequency_hz: f64,
    /// Stiffness of the mode: of the tool in the thrust direction, of a support along its contact normal.
    #[schema(minimum = 1.0, maximum = 1e15, example = 80_000.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("k"))))]
    pub stiffness_n_per_mm: f64,
    /// Share of the critical damping.
    #[schema(minimum = 1e-4, maximum = 0.99, example = 0.04, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("zeta"))))]
    pub damping_ratio: f64,
}

/// What swings.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingModePlace)]
pub enum ModePlace {
    /// Tool or wheel with its post.
    #[default]
    Tool,
    /// Left support.
    SupportA,
    /// Right support.
    SupportB,
}

/// Forces on the ring.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingForces)]
pub struct Forces {
    /// Thrust toward the centre; left out where `force` gives it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e8, example = 400.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F_p"))))]
    pub thrust_n: Option<f64>,
    /// Main cutting force, against the surface; left out where `force` gives it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e8, example = 800.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F_c"))))]
    pub cutting_n: Option<f64>,
    /// Weight of the ring.
    #[schema(minimum = 0.0, maximum = 1e9, example = 100.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("W"))))]
    pub weight_n: f64,
    /// Coefficient of friction between rollers and ring that can be relied on; acts with `drive: rollers`.
    #[serde(default = "friction")]
    #[schema(minimum = 0.01, maximum = 2.0, default = 0.2, example = 0.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("mu")), ("x-advanced" = json!(true))))]
    pub friction_available: f64,
    /// What turns the ring.
    #[serde(default)]
    #[schema(default = "torque", example = "torque")]
    pub drive: Drive,
}

fn friction() -> f64 {
    0.2
}

/// What turns the ring.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingDrive)]
pub enum Drive {
    /// A pure torque, as by a floating driver.
    #[default]
    Torque,
    /// Friction of both rollers.
    Rollers,
}

/// Long-wave pass filter (Gaussian, 50 % at its cut-off).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingLongWave)]
pub enum LongWave {
    /// No filter.
    None,
    /// 15 undulations per revolution.
    #[serde(rename = "upr_15")]
    Upr15,
    /// 50 undulations per revolution.
    #[default]
    #[serde(rename = "upr_50")]
    Upr50,
    /// 150 undulations per revolution.
    #[serde(rename = "upr_150")]
    Upr150,
    /// 500 undulations per revolution.
    #[serde(rename = "upr_500")]
    Upr500,
}

impl LongWave {
    /// Cut-off, undulations per revolution.
    pub fn cutoff_upr(self) -> Option<u32> {
        match self {
            Self::None => None,
            Self::Upr15 => Some(15),
            Self::Upr50 => Some(50),
            Self::Upr150 => Some(150),
            Self::Upr500 => Some(500),
        }
    }
}

/// How the cut is computed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingMethod)]
pub enum Method {
    /// Exact location on both supports, every body angle cut.
    #[default]
    ExactContact,
    /// The source paper's algorithm: nearest sampled points. For comparison only, its answer depends on `samples`.
    NearestSamples,
}

/// With which other numbers of nodes the run is repeated.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingErrorEstimate)]
pub enum ErrorEstimate {
    /// Half and a third as many: the error is twice the larger difference, and at least four times that of the surfaces.
    #[default]
    HalfSamples,
    /// Twice and half as many: costs two and a half times as much again; more to be trusted.
    DoubleSamples,
}

/// A question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingAnalysis)]
pub enum Analysis {
    /// The cut, step by step.
    Simulation,
    /// Which waves grow, stay or decay.
    LinearTheory,
    /// Which waves grow over the work speed, with a machine that swings.
    SpeedMap,
    /// Which waves grow, stay or decay over tool angle and support angle.
    SetupMap,
    /// Fewest revolutions to a target roundness within machine limits.
    SettingsSearch,
    /// How probably the ring comes out within its tolerance when the setting is not exact.
    Certainty,
}

impl Job {
    /// Whether a question is asked.
    pub fn asks(&self, analysis: Analysis) -> bool {
        self.analyses.contains(&analysis)
    }
}
