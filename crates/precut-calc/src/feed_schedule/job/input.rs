//! The job: zones of a shaft, models of what comes out of a cut, limits, and what is to be least.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::deflection_compensation::ProgramSettings;
use crate::effects::{MachinabilityConditions, MachinabilityEffect};
use crate::feed_schedule::job::models::Models;
use crate::feed_schedule::job::open::ScheduleUncertainty;
use crate::feed_schedule::job::plan::{Compensation, Method, PassPlan, TradeOff};
use crate::feed_schedule::model::risk::Risk;
use crate::force::ForceModel;
use crate::shaft::{Carriage, FeedDirection, Shaft, Support};

/// Most zones of a job.
pub const MAX_ZONES: usize = 2000;
/// Places of a zone's ends that the schema allows, mm.
const ZONE_MM: RangeInclusive<f64> = 0.0..=1e6;

/// Zones to be turned, and what is to be known of them before feed and speed are chosen.
///
/// `zones` and `limits` may be left out only where the models alone are wanted, as a base for a diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "FeedScheduleJob")]
pub struct Job {
    /// The workpiece; not needed where no deflection is limited or every zone states its compliance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("workpiece"))))]
    pub shaft: Option<Shaft>,
    /// What holds the shaft, from the headstock on; one-sided rests are refused here.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 8, extensions(("x-group" = json!("machine")), ("x-code" = json!("unstable_support"))))]
    pub supports: Vec<Support>,
    /// Compliance of carriage and tool.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub carriage: Carriage,
    /// Zones in order of z, without overlap; gaps are allowed and cut the chain of feed steps.
    #[serde(default)]
    #[schema(max_items = 2000, extensions(("x-group" = json!("workpiece"))))]
    pub zones: Vec<Zone>,
    /// What comes out of a cut, as functions of speed, feed, depth and edge angle.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub models: Models,
    /// Force model of the deflection calculator; its power law, without constant forces, stands in for `models.force_y`
    /// and `models.force_z` where they are absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub force: Option<ForceModel>,
    /// Major cutting edge angle, which models may depend on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1.0, maximum = 179.0, example = 75.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi"))))]
    pub cutting_edge_angle_deg: Option<f64>,
    /// What the machine can do.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub machine: Machine,
    /// What must hold beside the limits of the zones; needed to find a schedule.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("limits"))))]
    pub limits: Option<Limits>,
    /// With which probability results may pass their limits.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("limits"))))]
    pub risk: Risk,
    /// What may vary from zone to zone.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub variables: Variables,
    /// Further limits on power laws of speed, feed and depth.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 40, extensions(("x-group" = json!("limits")), ("x-advanced" = json!(true))))]
    pub custom: Vec<CustomLimit>,
    /// Limits on products of powers over several zones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 40, extensions(("x-group" = json!("limits")), ("x-advanced" = json!(true))))]
    pub couplings: Vec<Coupling>,
    /// What is to be least.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub objective: Goal,
    /// How the schedule is found.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics"))))]
    pub method: Method,
    /// Several passes over every zone; their number and the depth of the last are found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub passes: Option<PassPlan>,
    /// A curve of the objective over a tolerance, from the same call.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub trade_off: Option<TradeOff>,
    /// The compensated path that goes with the schedule, from the same call.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub compensation: Option<Compensation>,
    /// Which way the tool travels in the program.
    #[serde(default)]
    #[schema(default = "to_headstock", example = "to_headstock")]
    pub feed_direction: FeedDirection,
    /// How the program is spelled.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub program: ProgramSettings,
    /// Where exponent, curvature and interaction effects turn about; they state it themselves otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("effects")), ("x-advanced" = json!(true))))]
    pub reference: Option<Reference>,
    /// Named physical effects that act on the models.
    #[serde(default)]
    #[schema(max_items = 60, extensions(("x-group" = json!("effects"))))]
    pub effects: Vec<MachinabilityEffect>,
    /// What is not known of the effects.
    #[serde(default, skip_serializing_if = "ScheduleUncertainty::is_empty")]
    #[schema(extensions(("x-group" = json!("effects")), ("x-advanced" = json!(true))))]
    pub uncertainty: ScheduleUncertainty,
    /// The state that effects depend on.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("effects"))))]
    pub conditions: MachinabilityConditions,
}

/// A stretch of the shaft with one depth of cut and its own limits.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Zone {
    /// Its name in the answer; each occurs once.
    #[schema(min_length = 1, max_length = 64, example = "z1")]
    pub id: String,
    /// Where it begins, from the headstock end.
    #[schema(minimum = 0.0, maximum = 1e6, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z_1")), ("x-code" = json!("bad_zone"))))]
    pub z_start_mm: f64,
    /// Where it ends.
    #[schema(minimum = 0.0, maximum = 1e6, example = 150.0, extensions(("x-unit" = json!("mm")), ("x-ends-with" = json!("/shaft/segments/*/length_mm")), ("x-symbol" = json!("z_2")), ("x-code" = json!("bad_zone"))))]
    pub z_end_mm: f64,
    /// Diameter that it is turned to; speed, time and torque are counted at it.
    #[schema(minimum = 0.01, maximum = 10_000.0, example = 80.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("D")), ("x-code" = json!("bad_diameter"))))]
    pub diameter_mm: f64,
    /// Depth of cut on the radius, of every pass.
    #[schema(minimum = 1e-4, maximum = 1000.0, example = 0.3, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t"))))]
    pub depth_mm: f64,
    /// Passes over the zone, each by the depth of cut; the last one ends at the diameter.
    #[serde(default = "one_u32")]
    #[schema(minimum = 1, maximum = 1000, default = 1, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("r"))))]
    pub repeat: u32,
    /// Surface that it is part of: the tool is not changed inside one that an edge can cut. Zones without one stand each
    /// by itself; with `tool_usage_scope` `surface` they form one, `part`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_length = 1, max_length = 64, example = "A")]
    pub surface: Option<String>,
    /// Radial compliance to use instead of the beam's: thin walls, measured values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 0.25, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("C")), ("x-code" = json!("negative_compliance"))))]
    pub compliance_um_per_n: Option<f64>,
    /// Largest radial deflection; the diameter error is twice that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 1e6, example = 10.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("delta_max"))))]
    pub deflection_max_um: Option<f64>,
    /// Largest roughness, in the measure of the model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-4, maximum = 1e6, example = 1.6, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("Ra_max"))))]
    pub roughness_max_um: Option<f64>,
    /// Largest degree of hardening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e6, example = 6.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("N_max"))))]
    pub hardening_max_percent: Option<f64>,
    /// Largest depth of hardening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e6, example = 74.6, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("h_max"))))]
    pub hardening_depth_max_um: Option<f64>,
    /// Largest feed here; it only tightens the general one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-4, maximum = 20.0, example = 0.12, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_max"))))]
    pub feed_max_mm_per_rev: Option<f64>,
    /// Risk of every limit here in place of that of all zones, where each limit has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, exclusive_maximum = 50.0, example = 0.1, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("alpha_i")), ("x-advanced" = json!(true))))]
    pub risk_percent: Option<f64>,
}

impl Zone {
    /// Whether it lies where a zone may lie, so that something follows from its place.
    pub(in crate::feed_schedule) fn has_place(&self) -> bool {
        ZONE_MM.contains(&self.z_start_mm) && ZONE_MM.contains(&self.z_end_mm)
    }
}

fn one_u32() -> u32 {
    1
}

fn one() -> f64 {
    1.0
}

/// What the machine can do; what is left out does not limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Power of the motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 10_000.0, example = 10.0, extensions(("x-unit" = json!("kW")), ("x-symbol" = json!("P_max"))))]
    pub power_kw: Option<f64>,
    /// Share of the motor's power that reaches the cut.
    #[serde(default = "one")]
    #[schema(exclusive_minimum = 0.0, maximum = 1.0, default = 1.0, example = 0.8, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("eta"))))]
    pub efficiency: f64,
    /// Torque at the spindle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 1e7, example = 400.0, extensions(("x-unit" = json!("N m")), ("x-symbol" = json!("M_max"))))]
    pub torque_n_m: Option<f64>,
    /// Least spindle speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 200_000.0, example = 20.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_min"))))]
    pub spindle_speed_min_rpm: Option<f64>,
    /// Largest spindle speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 200_000.0, example = 2000.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_max"))))]
    pub spindle_speed_max_rpm: Option<f64>,
    /// Largest speed of the carriage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 1e6, example = 2000.0, extensions(("x-unit" = json!("mm/min")), ("x-symbol" = json!("v_f"))))]
    pub feed_rate_max_mm_per_min: Option<f64>,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            power_kw: None,
            efficiency: 1.0,
            torque_n_m: None,
            spindle_speed_min_rpm: None,
            spindle_speed_max_rpm: None,
            feed_rate_max_mm_per_min: None,
        }
    }
}

/// What must hold beside the limits of the zones; what is left out does not limit.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = ScheduleLimits)]
pub struct Limits {
    /// Least feed.
    #[schema(minimum = 1e-4, maximum = 20.0, example = 0.05, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_min"))))]
    pub feed_min_mm_per_rev: f64,
    /// Largest feed.
    #[schema(minimum = 1e-4, maximum = 20.0, example = 0.4, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_max"))))]
    pub feed_max_mm_per_rev: f64,
    /// Least cutting speed.
    #[schema(minimum = 1e-2, maximum = 20_000.0, example = 10.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_min"))))]
    pub speed_min_m_per_min: f64,
    /// Largest cutting speed.
    #[schema(minimum = 1e-2, maximum = 20_000.0, example = 80.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_max"))))]
    pub speed_max_m_per_min: f64,
    /// Share of a cutting edge that may be used, per part or per surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e6, example = 1.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("U_max"))))]
    pub tool_usage_max: Option<f64>,
    /// Whether a fresh edge begins with the part or with every surface.
    #[serde(default)]
    #[schema(default = "part", example = "part")]
    pub tool_usage_scope: UsageScope,
    /// An edge serves a whole number of parts, found with the schedule.
    #[serde(default)]
    #[schema(default = false, example = true)]
    pub whole_parts_per_edge: bool,
    /// Edges are paid whole and changed between surfaces, or after a whole number of parts: where the changes fall is
    /// found with the schedule. `tool_usage_max` is then the share of each edge that may be used, at most 1.
    #[serde(default)]
    #[schema(default = false, example = true)]
    pub whole_edges: bool,
    /// Parts of the batch: where an edge serves several, the last one of the batch is paid whole as well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 1_000_000, example = 50, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N"))))]
    pub batch_parts: Option<u32>,
    /// Least tool life at the conditions of any zone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e6, example = 15.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("T_min"))))]
    pub tool_life_min_min: Option<f64>,
    /// Most time in the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e9, example = 45.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("t_max"))))]
    pub time_max_min: Option<f64>,
    /// Largest main force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e9, example = 1500.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_z"))))]
    pub force_z_max_n: Option<f64>,
    /// Largest passive force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e9, example = 600.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_y"))))]
    pub force_y_max_n: Option<f64>,
    /// Largest ratio of the feeds of touching zones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 1.0, maximum = 1e6, example = 1.25, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho_S"))))]
    pub feed_step_ratio_max: Option<f64>,
    /// Largest ratio of the deflections of any two zones. Rarely wise: stiff zones must be cut harder to meet it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 1.0, maximum = 1e6, example = 1.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho"))))]
    pub deflection_spread_ratio_max: Option<f64>,
    /// Share of the deflection that a compensated path leaves, and feed has to limit: 1 without compensation, 0.2 to 0.3 with.
    #[serde(default = "one")]
    #[schema(exclusive_minimum = 0.0, maximum = 1.0, default = 1.0, example = 0.25, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("kappa"))))]
    pub deflection_residual_fraction: f64,
}

/// Where a fresh edge begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum UsageScope {
    /// With the part.
    #[default]
    Part,
    /// With every surface.
    Surface,
}

/// What may vary from zone to zone.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Variables {
    /// Feed.
    #[serde(default)]
    #[schema(default = "per_zone", example = "per_zone")]
    pub feed: FeedMode,
    /// Speed.
    #[serde(default)]
    #[schema(default = "per_zone", example = "constant_rpm")]
    pub speed: SpeedMode,
    /// The feed, with `feed` fixed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-4, maximum = 20.0, example = 0.15, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S"))))]
    pub fixed_feed_mm_per_rev: Option<f64>,
    /// The cutting speed, with `speed` fixed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-2, maximum = 20_000.0, example = 60.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V"))))]
    pub fixed_speed_m_per_min: Option<f64>,
}

/// How the feed may vary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeedMode {
    /// Every zone has its own.
    #[default]
    PerZone,
    /// One for all zones.
    Constant,
    /// Given.
    Fixed,
}

/// How the speed may vary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SpeedMode {
    /// Every zone has its own.
    #[default]
    PerZone,
    /// One cutting speed for all zones (G96).
    ConstantSpeed,
    /// One spindle speed for all zones (G97).
    ConstantRpm,
    /// A given cutting speed.
    Fixed,
}

/// A limit on exp(c_0) V^v S^s t^t, or on an output of `models`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CustomLimit {
    /// Its name in the answer.
    #[schema(min_length = 1, max_length = 64, example = "chip_temperature")]
    pub name: String,
    /// The zone it holds in, or `all`; with `passes` also `z1:rough` and `z1:finish`.
    #[serde(default = "all")]
    #[schema(min_length = 1, max_length = 80, default = "all", example = "all")]
    pub zone: String,
    /// An output among `models.further` that the power law multiplies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_length = 1, max_length = 64, example = "flank_wear_mm")]
    pub output: Option<String>,
    /// Logarithm of the coefficient.
    #[serde(default)]
    #[schema(minimum = -1000.0, maximum = 1000.0, default = 0.0, example = 4.883, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("c_0")), ("x-code" = json!("absurd_exponent"))))]
    pub constant: f64,
    /// Exponent of the cutting speed.
    #[serde(default)]
    #[schema(minimum = -100.0, maximum = 100.0, default = 0.0, example = 0.4, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("v")), ("x-code" = json!("absurd_exponent"))))]
    pub speed_exponent: f64,
    /// Exponent of the feed.
    #[serde(default)]
    #[schema(minimum = -100.0, maximum = 100.0, default = 0.0, example = 0.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s")), ("x-code" = json!("absurd_exponent"))))]
    pub feed_exponent: f64,
    /// Exponent of the depth of cut.
    #[serde(default)]
    #[schema(minimum = -100.0, maximum = 100.0, default = 0.0, example = 0.105, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("t")), ("x-code" = json!("absurd_exponent"))))]
    pub depth_exponent: f64,
    /// Largest value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1e12, example = 1000.0, extensions(("x-unit" = json!("as the name says")), ("x-symbol" = json!("max"))))]
    pub max: Option<f64>,
    /// Least value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1e12, example = 140.0, extensions(("x-unit" = json!("as the name says")), ("x-symbol" = json!("min"))))]
    pub min: Option<f64>,
}

fn all() -> String {
    "all".to_owned()
}

/// A limit on exp(c_0) times a product of powers of feeds and speeds of several zones.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Coupling {
    /// Its name in the answer.
    #[schema(min_length = 1, max_length = 64, example = "rough_feed_ratio")]
    pub name: String,
    /// The factors.
    #[schema(min_items = 1, max_items = 8)]
    pub terms: Vec<CouplingTerm>,
    /// Logarithm of the coefficient.
    #[serde(default)]
    #[schema(minimum = -1000.0, maximum = 1000.0, default = 0.0, example = 0.9163, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("c_0")), ("x-code" = json!("absurd_exponent"))))]
    pub constant: f64,
    /// Largest value.
    #[schema(exclusive_minimum = 0.0, maximum = 1e12, example = 1.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("max"))))]
    pub max: f64,
}

/// A factor of a coupling.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CouplingTerm {
    /// The zone; with `passes` also `z1:rough` and `z1:finish`.
    #[schema(min_length = 1, max_length = 80, example = "z1")]
    pub zone: String,
    /// Exponent of its cutting speed.
    #[serde(default)]
    #[schema(minimum = -100.0, maximum = 100.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("v")), ("x-code" = json!("absurd_exponent"))))]
    pub speed_exponent: f64,
    /// Exponent of its feed.
    #[serde(default)]
    #[schema(minimum = -100.0, maximum = 100.0, default = 0.0, example = 1.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s")), ("x-code" = json!("absurd_exponent"))))]
    pub feed_exponent: f64,
}

/// What is to be least.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Goal {
    /// Time: in the cut, for changing the tool in proportion to its use, and fixed.
    Time {
        /// Time to change an edge.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1e6, default = 0.0, example = 2.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("t_c"))))]
        tool_change_time_min: f64,
        /// Time that no schedule changes.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1e9, default = 0.0, example = 1.5, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("t_fix"))))]
        fixed_time_min: f64,
    },
    /// Cost: of machine time, tool changes and edges, and fixed.
    Cost {
        /// Money per minute of the machine.
        #[schema(minimum = 1e-9, maximum = 1e9, example = 1.0, extensions(("x-unit" = json!("money")), ("x-symbol" = json!("k_m"))))]
        machine_rate_per_min: f64,
        /// Time to change an edge.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1e6, default = 0.0, example = 2.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("t_c"))))]
        tool_change_time_min: f64,
        /// Money per cutting edge.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1e9, default = 0.0, example = 6.0, extensions(("x-unit" = json!("money")), ("x-symbol" = json!("k_e"))))]
        edge_cost: f64,
        /// Time that no schedule changes.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1e9, default = 0.0, example = 1.5, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("t_fix"))))]
        fixed_time_min: f64,
        /// Money that no schedule changes.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1e12, default = 0.0, example = 0.885, extensions(("x-unit" = json!("money")), ("x-symbol" = json!("k_fix"))))]
        fixed_cost: f64,
    },
    /// The largest deflection relative to its limit, over the zones that have one.
    Deflection {},
    /// The largest roughness relative to its limit, over the zones that have one.
    Roughness {},
    /// The largest degree of hardening.
    Hardening {},
}

impl Default for Goal {
    fn default() -> Self {
        Self::Time { tool_change_time_min: 0.0, fixed_time_min: 0.0 }
    }
}

impl Goal {
    /// Its name in the contract.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Time { .. } => "time",
            Self::Cost { .. } => "cost",
            Self::Deflection {} => "deflection",
            Self::Roughness {} => "roughness",
            Self::Hardening {} => "hardening",
        }
    }

    /// Unit of its value.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Time { .. } => "min",
            Self::Cost { .. } => "money",
            Self::Deflection {} | Self::Roughness {} => "1",
            Self::Hardening {} => "percent",
        }
    }
}

/// Conditions about which exponent, curvature and interaction effects turn.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Cutting speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-2, maximum = 20_000.0, example = 60.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_r"))))]
    pub speed_m_per_min: Option<f64>,
    /// Feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-4, maximum = 20.0, example = 0.2, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_r"))))]
    pub feed_mm_per_rev: Option<f64>,
    /// Depth of cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-4, maximum = 1000.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_r"))))]
    pub depth_mm: Option<f64>,
    /// Major cutting edge angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1.0, maximum = 179.0, example = 75.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi_r"))))]
    pub cutting_edge_angle_deg: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use utoipa::PartialSchema;

    #[test]
    fn ranges_are_those_of_the_schema() {
        let schema = serde_json::to_value(Zone::schema()).unwrap_or_default();
        for field in ["z_start_mm", "z_end_mm"] {
            let end = |name: &str| schema["properties"][field][name].as_f64();
            assert_eq!((end("minimum"), end("maximum")), (Some(*ZONE_MM.start()), Some(*ZONE_MM.end())), "{field}");
        }
    }
}
