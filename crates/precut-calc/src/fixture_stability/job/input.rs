//! The job: a cutter, a cut, a workpiece in a vise, and what is asked.

use serde::{Deserialize, Serialize};
use utoipa::openapi::schema::OneOfBuilder;
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::certainty::normal_quantile;
use crate::effects::{FixtureConditions, FixtureEffect};
use crate::force::choice;

use crate::fixture_stability::job::uncertain::FixtureUncertainty;

/// Most points of a lobe map.
pub const MAX_MAP_POINTS: u64 = 1_000_000;

/// A face mill cutting a workpiece held in a vise, and what is to be known before the cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "FixtureStabilityJob")]
pub struct FixtureJob {
    /// The face mill.
    #[schema(extensions(("x-group" = json!("tool"))))]
    pub cutter: FaceMill,
    /// How the cutting force follows from chip thickness and depth.
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub force: MillingForce,
    /// The working point.
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub cut: MillingCut,
    /// The vise with the workpiece.
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub fixture: Vise,
    /// What the spindle can give; without it power and torque limit nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub spindle: Option<Spindle>,
    /// What is asked beside the verdict.
    #[serde(default = "only_verdict")]
    #[schema(max_items = 6, default = json!(["verdict"]), example = json!(["verdict", "clamp_force", "lobes"]), extensions(("x-group" = json!("numerics"))))]
    pub analyses: Vec<Analysis>,
    /// The plane of the lobe diagram; what it leaves out is chosen around the working point.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics"))))]
    pub lobes: LobeSettings,
    /// What is uncertain in it, and which probability is wanted.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub uncertainty: FixtureUncertainty,
    /// How far depths are looked at for limits.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub limits: LimitSettings,
    /// The time simulation.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub simulation: SimulationSettings,
    /// Named physical effects that act beside the base model; a kind occurs once.
    #[serde(default)]
    #[schema(max_items = 12, extensions(("x-group" = json!("effects"))))]
    pub effects: Vec<FixtureEffect>,
    /// The state that effects depend on.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("effects"))))]
    pub conditions: FixtureConditions,
}

fn only_verdict() -> Vec<Analysis> {
    vec![Analysis::Verdict]
}

/// A face mill with equal pitch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FaceMill {
    /// Diameter over the tips.
    #[schema(minimum = 0.1, maximum = 5000.0, example = 100.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("D"))))]
    pub diameter_mm: f64,
    /// Number of teeth.
    #[schema(minimum = 1, maximum = 200, example = 8, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("z"))))]
    pub teeth: u32,
}

/// Force of a tooth (`fixture/2.1`): tangential Cp h^(1-k) H^(1-mu), radial a share of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MillingForce {
    /// Tangential force at 1 mm of chip thickness and 1 mm of depth.
    #[schema(minimum = 0.001, maximum = 1e6, example = 3000.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("C_p"))))]
    pub coefficient: f64,
    /// The force goes with the power 1-k of the chip thickness.
    #[serde(default)]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, default = 0.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k"))))]
    pub chip_thickness_exponent: f64,
    /// The force goes with the power 1-mu of the depth.
    #[serde(default)]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("mu"))))]
    pub depth_exponent: f64,
    /// Radial over tangential force.
    #[serde(default = "radial_ratio")]
    #[schema(minimum = 0.0, maximum = 10.0, default = 0.6, example = 0.6, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho"))))]
    pub radial_ratio: f64,
    /// Axial over tangential force; positive lifts the workpiece.
    #[serde(default)]
    #[schema(minimum = -10.0, maximum = 10.0, default = 0.0, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho_a"))))]
    pub axial_ratio: f64,
}

fn radial_ratio() -> f64 {
    0.6
}

/// The working point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MillingCut {
    /// Width of the milled strip.
    #[schema(minimum = 0.001, maximum = 5000.0, example = 50.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("B"))))]
    pub width_mm: f64,
    /// Centre line of the strip from the cutter's axis, positive toward the side where teeth enter.
    #[serde(default)]
    #[schema(minimum = -5000.0, maximum = 5000.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("e"))))]
    pub offset_mm: f64,
    /// Axial depth of cut.
    #[schema(minimum = 0.0, maximum = 1000.0, example = 3.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: f64,
    /// Spindle speed; or give the cutting speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 318.31, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n")), ("x-code" = json!("bad_spindle_speed"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Cutting speed; or give the spindle speed. The echoed job has the spindle speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 20_000.0, example = 100.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V"))))]
    pub speed_m_per_min: Option<f64>,
    /// Feed per tooth; or give the table feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_01, maximum = 10.0, example = 0.0393, extensions(("x-unit" = json!("mm/tooth")), ("x-symbol" = json!("S_z")), ("x-code" = json!("bad_feed_per_tooth"))))]
    pub feed_mm_per_tooth: Option<f64>,
    /// Table feed; or give the feed per tooth. Where both are given they must agree to 1 %. The echoed job has the feed per tooth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_1, maximum = 1e6, example = 100.0, extensions(("x-unit" = json!("mm/min")), ("x-symbol" = json!("S"))))]
    pub feed_mm_per_min: Option<f64>,
    /// Which jaw the tool is fed toward.
    #[serde(default)]
    #[schema(default = "movable_jaw", example = "movable_jaw")]
    pub feed_toward: FeedToward,
}

/// Which jaw the tool is fed toward.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeedToward {
    /// The movable jaw: the mean force unloads the joint at the fixed jaw.
    #[default]
    MovableJaw,
    /// The fixed jaw.
    FixedJaw,
}

/// A vise with its workpiece.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Vise {
    /// The screw locks itself: both jaws are springs, preloaded when it was tightened (type 1).
    SelfLocking(SelfLocking),
    /// A cylinder presses the movable jaw with a constant force; the jaw moves as a second mass (type 2).
    ConstantForce(ConstantForce),
}

impl PartialSchema for Vise {
    fn schema() -> RefOr<Schema> {
        RefOr::T(Schema::OneOf(
            OneOfBuilder::new()
                .description(Some("How the workpiece is clamped."))
                .item(choice("self_locking", SelfLocking::schema()))
                .item(choice("constant_force", ConstantForce::schema()))
                .build(),
        ))
    }
}

impl ToSchema for Vise {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        SelfLocking::schemas(schemas);
        ConstantForce::schemas(schemas);
    }
}

/// A joint between workpiece and jaw.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ViseJoint {
    /// Stiffness along the feed.
    #[schema(minimum = 0.001, maximum = 1e9, example = 6000.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("C"))))]
    pub stiffness_n_per_mm: f64,
    /// Damping along the feed.
    #[schema(minimum = 0.0, maximum = 1e6, example = 0.5, extensions(("x-unit" = json!("N s/mm")), ("x-symbol" = json!("lambda")), ("x-code" = json!("negative_damping"))))]
    pub damping_n_s_per_mm: f64,
}

/// How the jaws hold what pushes along them: across the feed and upward, where nothing but friction does.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JawGrip {
    /// Friction between jaw and workpiece.
    #[serde(default)]
    pub friction: Friction,
    /// Height of the cutting force over the middle of the jaws; it needs the face of a jaw.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 10_000.0, default = 0.0, example = 15.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("h"))))]
    pub force_height_mm: f64,
    /// Length of the face of a jaw that grips.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 10_000.0, example = 150.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("a"))))]
    pub jaw_length_mm: Option<f64>,
    /// Its height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 10_000.0, example = 30.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("b"))))]
    pub jaw_height_mm: Option<f64>,
}

/// What is known of a friction: the likely one, with the lowest and highest that may be met or its standard deviation. Forces are told
/// for all three; the one that counts is that of the lowest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// The lowest that may be met; left out, it follows from the standard deviation, and without one it is the likely one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 2.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("mu_low"))))]
    pub low: Option<f64>,
    /// The likely one.
    #[schema(minimum = 0.001, maximum = 2.0, example = 0.15, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("mu"))))]
    pub value: f64,
    /// The highest; left out, as the lowest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 2.0, example = 0.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("mu_high"))))]
    pub high: Option<f64>,
    /// Standard deviation, in place of lowest and highest: these are then the ends between which nine of ten lie, lognormal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1.0, example = 0.03, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_mu"))))]
    pub sd: Option<f64>,
}

/// Lowest, likely and highest friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FrictionRange {
    pub low: f64,
    pub value: f64,
    pub high: f64,
}

/// Share of the frictions that lies below the lowest, and as much above the highest.
const BEYOND: f64 = 0.05;

impl Friction {
    /// Ground steel jaws, dry: a judgement, and warned of.
    pub(crate) const ASSUMED: Self = Self { low: Some(0.1), value: 0.15, high: Some(0.2), sd: None };

    /// As stated, or by the standard deviation. Of a job that states both the range counts; it is refused.
    pub(crate) fn range(&self) -> FrictionRange {
        // Standard deviation of the logarithm that makes this one.
        let scatter = self.sd.map_or(0.0, |sd| (sd / self.value).powi(2).ln_1p().sqrt());
        let off = (-scatter * normal_quantile(BEYOND)).exp();
        FrictionRange {
            low: self.low.unwrap_or(self.value / off),
            value: self.value,
            high: self.high.unwrap_or(self.value * off),
        }
    }
}

impl FrictionRange {
    /// Standard deviation of the logarithm; `None` of one that is known exactly.
    pub(crate) fn scatter(&self) -> Option<f64> {
        (self.high > self.low).then(|| (self.high / self.low).ln() / (-2.0 * normal_quantile(BEYOND)))
    }
}

impl Default for Friction {
    fn default() -> Self {
        Self::ASSUMED
    }
}

/// The screw locks itself: both jaws are springs, preloaded when it was tightened (type 1).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SelfLocking {
    /// Workpiece with what moves with it.
    #[schema(minimum = 0.000_1, maximum = 1e6, example = 5.0, extensions(("x-unit" = json!("kg")), ("x-symbol" = json!("m"))))]
    pub workpiece_mass_kg: f64,
    /// Joint at the movable jaw.
    pub movable_joint: ViseJoint,
    /// Joint at the fixed jaw.
    pub fixed_joint: ViseJoint,
    /// Clamp force when the screw is tight; without it nothing is said about whether the given force suffices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e8, example = 2000.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F_0")), ("x-code" = json!("bad_clamp_force"))))]
    pub clamp_force_n: Option<f64>,
    /// How the jaws hold what pushes along them; without it nothing is said about whether the workpiece slips.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clamp: Option<JawGrip>,
}

/// A cylinder presses the movable jaw with a constant force; the jaw moves as a second mass (type 2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstantForce {
    /// Workpiece with what moves with it.
    #[schema(minimum = 0.000_1, maximum = 1e6, example = 5.0, extensions(("x-unit" = json!("kg")), ("x-symbol" = json!("m"))))]
    pub workpiece_mass_kg: f64,
    /// Movable jaw with its piston.
    #[schema(minimum = 0.000_1, maximum = 1e6, example = 1.0, extensions(("x-unit" = json!("kg")), ("x-symbol" = json!("m_3"))))]
    pub jaw_mass_kg: f64,
    /// Friction of the piston.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1e6, default = 0.0, example = 0.0, extensions(("x-unit" = json!("N s/mm")), ("x-symbol" = json!("lambda_3")), ("x-code" = json!("negative_damping"))))]
    pub jaw_damping_n_s_per_mm: f64,
    /// Joint at the movable jaw.
    pub movable_joint: ViseJoint,
    /// Joint at the fixed jaw.
    pub fixed_joint: ViseJoint,
    /// Force of the cylinder; without it nothing is said about whether the given force suffices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e8, example = 2000.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F_3")), ("x-code" = json!("bad_clamp_force"))))]
    pub clamp_force_n: Option<f64>,
    /// How the jaws hold what pushes along them; without it nothing is said about whether the workpiece slips.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clamp: Option<JawGrip>,
}

/// What the spindle can give. What is stated for all speeds and what the table says both hold: the least counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Spindle {
    /// Power of the motor, at every speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 10_000.0, example = 7.5, extensions(("x-unit" = json!("kW")), ("x-symbol" = json!("P_max"))))]
    pub power_kw: Option<f64>,
    /// Torque at the spindle, at every speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e7, example = 120.0, extensions(("x-unit" = json!("N m")), ("x-symbol" = json!("M_max"))))]
    pub torque_n_m: Option<f64>,
    /// Share of the motor's power that reaches the cutter.
    #[serde(default = "whole_power")]
    #[schema(exclusive_minimum = 0.0, maximum = 1.0, default = 1.0, example = 0.85, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("eta"))))]
    pub efficiency: f64,
    /// Power and torque over the spindle speed, by rising speed, straight lines between; nothing is known of speeds outside.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 200)]
    pub characteristic: Vec<SpindlePoint>,
}

fn whole_power() -> f64 {
    1.0
}

/// What the spindle can give at a speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SpindlePoint {
    /// Spindle speed.
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 1500.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n"))))]
    pub spindle_speed_rpm: f64,
    /// Power of the motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 10_000.0, example = 7.5, extensions(("x-unit" = json!("kW")), ("x-symbol" = json!("P_max"))))]
    pub power_kw: Option<f64>,
    /// Torque at the spindle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e7, example = 48.0, extensions(("x-unit" = json!("N m")), ("x-symbol" = json!("M_max"))))]
    pub torque_n_m: Option<f64>,
}

/// A question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Analysis {
    /// Stable, chattering, losing the cut, or a joint open; always answered.
    Verdict,
    /// Least clamp force without a joint opening and, where friction is given, without the workpiece slipping.
    ClampForce,
    /// Limiting depth over spindle speed.
    Lobes,
    /// Force, displacement and chip over time.
    History,
    /// Depths at which something gives out, and the amplitude over the depth.
    Limits,
    /// How deep one may cut with the wanted probability, at this speed and at others.
    Certainty,
}

/// The plane of the lobe diagram.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LobeSettings {
    /// Lowest spindle speed; half the working speed where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 200.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_1"))))]
    pub from_rpm: Option<f64>,
    /// Highest spindle speed; twice the working speed where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 1200.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_2"))))]
    pub to_rpm: Option<f64>,
    /// Spindle speeds of boundary and map.
    #[schema(minimum = 2, maximum = 100_000, default = 200, example = 200, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_n"))))]
    pub speeds: u32,
    /// Greatest depth; chosen from the zeroth-order limit where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1000.0, example = 12.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H_2"))))]
    pub depth_max_mm: Option<f64>,
    /// Depths of the map.
    #[schema(minimum = 2, maximum = 100_000, default = 100, example = 100, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_H"))))]
    pub depths: u32,
    /// Whether the modulus of the multiplier is computed over the whole plane, not the boundary alone.
    #[schema(default = false, example = true)]
    pub map: bool,
    /// How often cells of the map that the boundary passes are halved, both ways.
    #[schema(minimum = 0, maximum = 5, default = 0, example = 2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("L"))))]
    pub refinement: u32,
}

impl Default for LobeSettings {
    fn default() -> Self {
        Self { from_rpm: None, to_rpm: None, speeds: 200, depth_max_mm: None, depths: 100, map: false, refinement: 0 }
    }
}

/// How far depths are looked at for limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LimitSettings {
    /// Greatest depth; chosen from the zeroth-order limit where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1000.0, example = 12.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H_max"))))]
    pub depth_max_mm: Option<f64>,
    /// Depths of the curve amplitude over depth.
    #[schema(minimum = 2, maximum = 400, default = 24, example = 24, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_H"))))]
    pub depths: u32,
    /// Spindle speeds beside the working one at which the limiting depth is wanted.
    #[schema(max_items = 100, min_items = 0, example = json!([400.0, 900.0]))]
    pub speeds_rpm: Vec<LimitSpeed>,
}

/// A spindle speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct LimitSpeed(pub f64);

impl PartialSchema for LimitSpeed {
    fn schema() -> RefOr<Schema> {
        let mut extensions = utoipa::openapi::extensions::Extensions::default();
        extensions.insert("x-unit".to_owned(), "rev/min".into());
        extensions.insert("x-symbol".to_owned(), "n".into());
        utoipa::openapi::schema::ObjectBuilder::new()
            .schema_type(utoipa::openapi::schema::SchemaType::new(utoipa::openapi::schema::Type::Number))
            .description(Some("A spindle speed."))
            .minimum(Some(0.1))
            .maximum(Some(200_000.0))
            .examples([400.0])
            .extensions(Some(extensions))
            .into()
    }
}

impl ToSchema for LimitSpeed {}

impl Default for LimitSettings {
    fn default() -> Self {
        Self { depth_max_mm: None, depths: 24, speeds_rpm: Vec::new() }
    }
}

/// The time simulation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SimulationSettings {
    /// Steps per tooth pitch; chosen from the natural frequencies where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 32, maximum = 20_000, example = 800, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N"))))]
    pub steps_per_tooth: Option<u32>,
    /// Tooth periods; chosen from the decay of the transient where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 20, maximum = 100_000, example = 200, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("M"))))]
    pub tooth_periods: Option<u32>,
    /// Tooth periods at the end over which steady values are taken; a quarter of all where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 100_000, example = 50, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("M_s"))))]
    pub steady_tooth_periods: Option<u32>,
    /// What becomes of a surface that a tooth leaves uncut.
    #[schema(default = "multiple", example = "multiple")]
    pub regeneration: Regeneration,
    /// How the cut begins.
    #[schema(default = "hard", example = "hard")]
    pub entry: Entry,
    /// Whether the run is repeated with half the step and the change given as its error.
    #[schema(default = false, example = false)]
    pub verified: bool,
}

impl Default for SimulationSettings {
    fn default() -> Self {
        Self {
            steps_per_tooth: None,
            tooth_periods: None,
            steady_tooth_periods: None,
            regeneration: Regeneration::Multiple,
            entry: Entry::Hard,
            verified: false,
        }
    }
}

/// What becomes of a surface that a tooth leaves uncut.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Regeneration {
    /// The next tooth meets it: a thicker chip.
    #[default]
    Multiple,
    /// It is forgotten: the law of the source paper, for comparison.
    Single,
}

impl Regeneration {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Multiple => "multiple",
            Self::Single => "single",
        }
    }
}

/// How the cut begins.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Entry {
    /// All teeth that stand in the arc cut at once.
    #[default]
    Hard,
    /// The engaged arc grows over the first revolution.
    Gradual,
}

impl Vise {
    /// Workpiece mass, joints at the movable and the fixed jaw, clamp force.
    pub(in crate::fixture_stability) fn common(&self) -> (f64, ViseJoint, ViseJoint, Option<f64>) {
        match self {
            Self::SelfLocking(v) => (v.workpiece_mass_kg, v.movable_joint, v.fixed_joint, v.clamp_force_n),
            Self::ConstantForce(v) => (v.workpiece_mass_kg, v.movable_joint, v.fixed_joint, v.clamp_force_n),
        }
    }

    /// How the jaws hold what pushes along them.
    pub(in crate::fixture_stability) fn grip(&self) -> Option<&JawGrip> {
        match self {
            Self::SelfLocking(v) => v.clamp.as_ref(),
            Self::ConstantForce(v) => v.clamp.as_ref(),
        }
    }
}

impl FixtureJob {
    /// Spindle speed of a job that states one of both speeds.
    pub(in crate::fixture_stability) fn spindle_rpm(&self) -> Option<f64> {
        let by_speed = |v: f64| 1000.0 * v / (std::f64::consts::PI * self.cutter.diameter_mm);
        self.cut.spindle_speed_rpm.or_else(|| self.cut.speed_m_per_min.map(by_speed))
    }

    /// Feed per tooth of a job that states a feed.
    pub(in crate::fixture_stability) fn feed_mm(&self) -> Option<f64> {
        self.cut.feed_mm_per_tooth.or_else(|| Some(self.feed_of_table_mm()?.0))
    }

    /// Feed per tooth by the table feed, and the table feed.
    pub(in crate::fixture_stability) fn feed_of_table_mm(&self) -> Option<(f64, f64)> {
        let table = self.cut.feed_mm_per_min?;
        Some((table / (self.spindle_rpm()? * f64::from(self.cutter.teeth)), table))
    }

    pub(in crate::fixture_stability) fn asks(&self, analysis: Analysis) -> bool {
        self.analyses.contains(&analysis)
    }
}
