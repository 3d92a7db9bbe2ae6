//! The answer.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::turning::Proof;
use utoipa::openapi::Schema;
use utoipa::openapi::extensions::Extensions;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, SchemaType, Type};

use crate::feed_schedule::job::input::{Job, Zone};

/// Feed and speed of every zone, what they give, which limits bind, and how sure it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// What was to be least, in the unit of `objective_unit`.
    #[schema(example = 39.4, extensions(("x-unit" = json!("as objective_unit says"))))]
    pub objective: f64,
    /// Which quantity that is: `time`, `cost`, `deflection`, `roughness`, `hardening`.
    #[schema(example = "time")]
    pub objective_kind: String,
    /// Its unit: `min`, `money`, `1` (relative to the limit), `percent`.
    #[schema(example = "min")]
    pub objective_unit: String,
    /// Time in the cut.
    #[schema(example = 39.4, extensions(("x-unit" = json!("min"))))]
    pub cutting_time_min: f64,
    /// Share of a cutting edge that the part uses, Σ time/tool life.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.62, extensions(("x-unit" = json!("1"))))]
    pub tool_usage: Option<f64>,
    /// The same by surface.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tool_usage_by_surface: Vec<SurfaceUsage>,
    /// Parts that one edge serves, where a whole number was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 2, extensions(("x-unit" = json!("1"))))]
    pub parts_per_edge: Option<u32>,
    /// The edges of one part in the order in which they cut; at most the first 1000. Empty without a tool life.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<EdgeUse>,
    /// Edges that one part takes: below 1 where an edge serves several whole parts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 2.0, extensions(("x-unit" = json!("1"))))]
    pub edges_per_part: Option<f64>,
    /// Where the tool is changed, in the order of the cut, the change between parts last; at most the first 1000.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tool_changes: Vec<ToolChange>,
    /// What this very plan comes to with whole edges in place of shares of them, in the unit of `objective_unit`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 41.79, extensions(("x-unit" = json!("as objective_unit says"))))]
    pub whole_edge_objective: Option<f64>,
    /// Largest radial deflection; the diameter error is twice that. Not reduced by compensation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 10.0, extensions(("x-unit" = json!("um"))))]
    pub largest_deflection_um: Option<f64>,
    /// Largest deflection over least.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 4.7, extensions(("x-unit" = json!("1"))))]
    pub deflection_spread: Option<f64>,
    /// Largest roughness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 1.6, extensions(("x-unit" = json!("um"))))]
    pub largest_roughness_um: Option<f64>,
    /// Largest roughness over least.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 1.1, extensions(("x-unit" = json!("1"))))]
    pub roughness_spread: Option<f64>,
    /// The zones in order; with several passes the roughing of a zone before its finish.
    pub zones: Vec<ZoneOutcome>,
    /// Limits that bind, the most costly first.
    pub binding: Vec<Binding>,
    /// What every number of the job that binds costs, one price for one number, the most costly first; whole numbers last.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub prices: Vec<Price>,
    /// With which probability limits on outputs that scatter are kept; absent where no model of a limited output states how
    /// much it scatters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub conformance: Option<ScheduleConformance>,
    /// How near to the optimum the answer provably is.
    pub certificate: Certificate,
    /// The same part with one feed, and by the source paper's rule.
    pub comparison: Comparison,
    /// The equal-deflection rule, where it is the method.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equal_deflection: Option<EqualDeflection>,
    /// The continuous schedule and how it was cut into zones, where zones were found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub continuous: Option<Continuous>,
    /// The splits into passes that were tried, where passes were asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub passes: Option<PassesOutcome>,
    /// The curve of the objective over a tolerance, where one was asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trade_off: Vec<TradePoint>,
    /// The program, driven over the blank before it is given out; absent where its zones do not fit the shaft.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proof: Option<Proof>,
    /// The compensated path, where one was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensated_path: Option<CompensatedPath>,
}

/// With which probability limits on outputs that scatter are kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ScheduleConformance {
    /// Every limit in the zone where it is passed most often, the worst first; `edge` is an edge that lasts until it is changed.
    pub limits: Vec<ScheduledLimitKept>,
    /// That a part keeps all limits in all zones, edges aside, as if they scattered independently of each other: results that go
    /// together keep them more often. Told from 1e-6 to 1 - 1e-6.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.97, extensions(("x-unit" = json!("1"))))]
    pub joint_probability: Option<f64>,
    /// What one percent more of the risk that is asked for takes off the objective.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.028, extensions(("x-unit" = json!("percent"))))]
    pub gain_percent_per_percent_of_risk: Option<f64>,
    /// The joint risk that was found to cost least, where that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.4, extensions(("x-unit" = json!("percent"))))]
    pub risk_percent: Option<f64>,
}

/// A limit and how probably it is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ScheduledLimitKept {
    /// The limit: `roughness`, `deflection`, ..., or `edge`.
    #[schema(example = "roughness")]
    pub limit: String,
    /// The zone where it is passed most often; of an edge the one after which it is changed.
    #[schema(example = "z1")]
    pub zone: String,
    /// That it is kept there, from 1e-6 to 1 - 1e-6.
    #[schema(example = 0.99, extensions(("x-unit" = json!("1"))))]
    pub probability: f64,
}

/// A zone's feed and speed and what they give.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ZoneOutcome {
    /// The zone.
    #[schema(example = "z1")]
    pub id: String,
    /// Where it begins.
    #[schema(example = 0.0, extensions(("x-unit" = json!("mm"))))]
    pub z_start_mm: f64,
    /// Where it ends.
    #[schema(example = 150.0, extensions(("x-unit" = json!("mm"))))]
    pub z_end_mm: f64,
    /// Its diameter.
    #[schema(example = 80.0, extensions(("x-unit" = json!("mm"))))]
    pub diameter_mm: f64,
    /// Depth of cut.
    #[schema(example = 0.3, extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: f64,
    /// How often it is cut.
    #[schema(example = 1, extensions(("x-unit" = json!("1"))))]
    pub passes: u32,
    /// Feed.
    #[schema(example = 0.15, extensions(("x-unit" = json!("mm/rev"))))]
    pub feed_mm_per_rev: f64,
    /// Cutting speed.
    #[schema(example = 60.0, extensions(("x-unit" = json!("m/min"))))]
    pub speed_m_per_min: f64,
    /// Spindle speed.
    #[schema(example = 238.7, extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: f64,
    /// Time in the cut, all passes.
    #[schema(example = 4.2, extensions(("x-unit" = json!("min"))))]
    pub cutting_time_min: f64,
    /// Largest radial compliance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.21, extensions(("x-unit" = json!("um/N"))))]
    pub compliance_um_per_n: Option<f64>,
    /// Passive force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 66.0, extensions(("x-unit" = json!("N"))))]
    pub force_y_n: Option<f64>,
    /// Main force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 96.0, extensions(("x-unit" = json!("N"))))]
    pub force_z_n: Option<f64>,
    /// Power of the motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.13, extensions(("x-unit" = json!("kW"))))]
    pub power_kw: Option<f64>,
    /// Torque at the spindle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 4.8, extensions(("x-unit" = json!("N m"))))]
    pub torque_n_m: Option<f64>,
    /// Largest radial deflection, not reduced by compensation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 10.0, extensions(("x-unit" = json!("um"))))]
    pub deflection_um: Option<f64>,
    /// Error of the diameter by it, twice the deflection.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 20.0, extensions(("x-unit" = json!("um"))))]
    pub diameter_error_um: Option<f64>,
    /// Roughness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 1.6, extensions(("x-unit" = json!("um"))))]
    pub roughness_um: Option<f64>,
    /// Degree of hardening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 6.2, extensions(("x-unit" = json!("percent"))))]
    pub hardening_percent: Option<f64>,
    /// Depth of hardening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 71.2, extensions(("x-unit" = json!("um"))))]
    pub hardening_depth_um: Option<f64>,
    /// Tool life at these conditions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 60.0, extensions(("x-unit" = json!("min"))))]
    pub tool_life_min: Option<f64>,
    /// Share of a cutting edge used here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.07, extensions(("x-unit" = json!("1"))))]
    pub tool_usage: Option<f64>,
    /// Further outputs of the models.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further: Vec<NamedValue>,
    /// Limits that bind here, the most costly first.
    #[schema(example = json!(["deflection"]))]
    pub active: Vec<String>,
}

/// A further output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NamedValue {
    /// Its name.
    #[schema(example = "cost")]
    pub name: String,
    /// Its value, in `unit`.
    #[schema(example = 46.6, extensions(("x-unit" = json!("as unit says"))))]
    pub value: f64,
    /// Its unit.
    #[schema(example = "rub")]
    pub unit: String,
}

/// Use of a cutting edge on one surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SurfaceUsage {
    /// The surface.
    #[schema(example = "A")]
    pub surface: String,
    /// Share of a cutting edge.
    #[schema(example = 0.4, extensions(("x-unit" = json!("1"))))]
    pub tool_usage: f64,
}

impl ZoneOutcome {
    /// The zone of the job that it lies in: passes and zones that were found have names of their own.
    pub(in crate::feed_schedule) fn zone_of<'j>(&self, job: &'j Job) -> Option<&'j Zone> {
        job.zones.iter().find(|zone| zone.z_start_mm <= self.z_start_mm && zone.z_end_mm >= self.z_end_mm)
    }

    /// Whether it is a zone's roughing pass, whose surface is cut off again.
    pub(in crate::feed_schedule) fn is_rough(&self, zone: &Zone) -> bool {
        self.id.strip_suffix(":rough") == Some(zone.id.as_str())
    }
}

/// What one cutting edge cuts.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EdgeUse {
    /// The surfaces, in the order of the cut.
    #[schema(example = json!(["A", "B"]))]
    pub surfaces: Vec<String>,
    /// The zones, in the order of the cut; one that wears out an edge goes on with the next.
    #[schema(example = json!(["z1", "z2"]))]
    pub zones: Vec<String>,
    /// Share of the edge that one part uses.
    #[schema(example = 0.9, extensions(("x-unit" = json!("1"))))]
    pub tool_usage: f64,
}

/// A change of the tool.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolChange {
    /// Where it falls.
    #[schema(example = "between_zones")]
    pub place: ChangePlace,
    /// Which edge of the part begins here, from 1 in the order of the cut.
    #[schema(example = 2, extensions(("x-unit" = json!("1"))))]
    pub edge: u32,
    /// The zone that the worn edge cut last.
    #[schema(example = "z2")]
    pub after_zone: String,
    /// The zone that the fresh edge cuts first.
    #[schema(example = "z3")]
    pub before_zone: String,
    /// The pass over that zone with which it begins, from 1.
    #[schema(example = 1, extensions(("x-unit" = json!("1"))))]
    pub pass: u32,
    /// Where along the shaft it begins.
    #[schema(example = 320.0, extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Share used of the edge that is taken out.
    #[schema(example = 0.93, extensions(("x-unit" = json!("1"))))]
    pub tool_usage: f64,
    /// It falls on every so many parts.
    #[schema(example = 1, extensions(("x-unit" = json!("1"))))]
    pub every_parts: u32,
}

/// Where a change of the tool falls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChangePlace {
    /// Before the first cut of a zone.
    BetweenZones,
    /// Inside a zone whose surface alone takes more than an edge: the cut is interrupted.
    InsideZone,
    /// After the part, before the next one.
    BetweenParts,
}

/// A limit that binds and what it costs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Binding {
    /// The limit.
    #[schema(example = "deflection")]
    pub constraint: String,
    /// Where it holds.
    #[schema(example = "z5")]
    pub zone: String,
    /// The limit, in `unit`.
    #[schema(example = 10.0, extensions(("x-unit" = json!("as unit says"))))]
    pub limit: f64,
    /// Its unit.
    #[schema(example = "um")]
    pub unit: String,
    /// Shadow price: -d ln(objective)/d ln(limit), with the objective `hardening` its fall in percentage points; for limits on semi-log models per unit of the limit.
    #[schema(example = 0.34, extensions(("x-unit" = json!("1"))))]
    pub multiplier: f64,
    /// Whether the multiplier is per unit of the limit.
    #[schema(example = false)]
    pub per_unit: bool,
    /// What one percent more of the limit takes off the objective, in percent of it; with the objective `hardening` in percentage points.
    #[schema(example = 0.34, extensions(("x-unit" = json!("percent"))))]
    pub gain_percent: f64,
    /// Other limits hold at the optimum beside it, so that its multiplier is one of several: alone it may buy nothing. `prices` has what numbers of the job buy.
    #[schema(example = false)]
    pub degenerate: bool,
}

/// What a number of the job costs, over all limits that it enters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Price {
    /// The number's place in the job.
    #[schema(example = "/machine/power_kw")]
    pub pointer: String,
    /// The limit that it is called by.
    #[schema(example = "power")]
    pub constraint: String,
    /// Where it holds: a zone, or `part`.
    #[schema(example = "part")]
    pub zone: String,
    /// The number, in `unit`.
    #[schema(example = 7.5, extensions(("x-unit" = json!("as unit says"))))]
    pub limit: f64,
    /// Its unit.
    #[schema(example = "kW")]
    pub unit: String,
    /// Whether more or less of it is looser.
    #[schema(example = "more")]
    pub looser: Looser,
    /// What one percent looser takes off the objective, in percent of it; with the objective `hardening` in percentage points. Absent for whole numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.893, extensions(
        ("x-unit" = json!("percent")),
        ("x-knobs" = json!({ "pointer": "pointer", "looser": "looser", "gain": "gain_percent", "of": "/objective" }))
    ))]
    pub gain_percent: Option<f64>,
    /// What one percent tighter adds to it, where that is something else. Absent with `solved_anew`: tighter leaves no schedule with as many edges, one part per edge more or less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 1.2, extensions(("x-unit" = json!("percent"))))]
    pub loss_percent: Option<f64>,
    /// What the price rests on.
    #[schema(example = "multipliers")]
    pub basis: PriceBasis,
    /// What the next whole number comes to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<NextWhole>,
}

/// Which way a number gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Looser {
    /// More of it is looser.
    More,
    /// Less of it is looser.
    Less,
}

/// What a price rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PriceBasis {
    /// The multipliers of the optimum, which settle it: the same both ways.
    Multipliers,
    /// A schedule solved anew with the number changed by a thousandth of a percent either way, or a hundredth where that is not solved closely enough: looser and tighter differ.
    SolvedAnew,
    /// The multipliers of the optimum, which are one of several sets: not solved anew.
    OneOfSeveral,
    /// A whole number: it has a neighbour and no price.
    Whole,
}

/// The next whole number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NextWhole {
    /// Parts per edge.
    #[schema(example = 13, extensions(("x-unit" = json!("1"))))]
    pub parts_per_edge: u32,
    /// The objective with it.
    #[schema(example = 39.1, extensions(("x-unit" = json!("as objective_unit says"))))]
    pub objective: f64,
}

/// How near to the optimum the answer provably is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// Complementarity gap: ln(objective), or with the objective `hardening` the objective, is at most so much above the least possible.
    #[schema(example = 4e-11, extensions(("x-unit" = json!("1"))))]
    pub duality_gap: f64,
    /// Largest component of the gradient of the Lagrangian.
    #[schema(example = 3e-10, extensions(("x-unit" = json!("1"))))]
    pub kkt_residual: f64,
    /// Largest violation of a limit, in logarithms, or in the unit of a semi-log limit.
    #[schema(example = 1e-12, extensions(("x-unit" = json!("1"))))]
    pub primal_residual: f64,
    /// With whole edges: no plan of them comes below, in the unit of `objective_unit`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 34.876, extensions(("x-unit" = json!("as objective_unit says"))))]
    pub lower_bound: Option<f64>,
    /// Newton steps.
    #[schema(example = 9, extensions(("x-unit" = json!("1"))))]
    pub iterations: u32,
    /// Who found it.
    #[schema(example = "interior_point")]
    pub solver: Solver,
    /// Programs solved in turn because a model bends; 0 where every model is exact in the program.
    #[schema(example = 0, extensions(("x-unit" = json!("1"))))]
    pub linearisations: u32,
    /// Whether only a local optimum is claimed: an effect makes the problem not convex.
    #[schema(example = false)]
    pub local: bool,
    /// Whether several schedules share the optimum and the best of them by a second objective was taken.
    #[schema(example = false)]
    pub tie_broken: bool,
}

/// Who found the optimum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// The product's own interior-point method.
    InteriorPoint,
    /// The general conic solver, where the other stalled.
    Conic,
    /// No optimum is claimed: a rule was applied.
    Rule,
}

/// Other schedules of the same part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// The best single feed that meets all limits, speed as in the job; absent where none does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub constant_feed: Option<ConstantFeed>,
    /// The source paper's rule from that feed; absent where nothing bends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equal_deflection: Option<EqualDeflection>,
}

/// The best single feed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstantFeed {
    /// The feed.
    #[schema(example = 0.07, extensions(("x-unit" = json!("mm/rev"))))]
    pub feed_mm_per_rev: f64,
    /// Time in the cut.
    #[schema(example = 55.9, extensions(("x-unit" = json!("min"))))]
    pub cutting_time_min: f64,
    /// The objective.
    #[schema(example = 55.9, extensions(("x-unit" = json!("as objective_unit says"))))]
    pub objective: f64,
    /// What the schedule saves of that time; negative where another objective takes longer.
    #[schema(example = 29.5, extensions(("x-unit" = json!("percent"))))]
    pub time_saved_percent: f64,
}

/// Feeds by the equal-deflection rule S_i = S_0 (delta_0/delta_i)^(1/s_y).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EqualDeflection {
    /// Feed that the rule starts from.
    #[schema(example = 0.15, extensions(("x-unit" = json!("mm/rev"))))]
    pub reference_feed_mm_per_rev: f64,
    /// Deflection aimed at; absent where it is every zone's limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 3.5, extensions(("x-unit" = json!("um"))))]
    pub target_um: Option<f64>,
    /// Largest deflection at the reference feed.
    #[schema(example = 16.4, extensions(("x-unit" = json!("um"))))]
    pub largest_before_um: f64,
    /// Time in the cut at the reference feed.
    #[schema(example = 37.8, extensions(("x-unit" = json!("min"))))]
    pub cutting_time_before_min: f64,
    /// Time in the cut by the rule.
    #[schema(example = 120.0, extensions(("x-unit" = json!("min"))))]
    pub cutting_time_min: f64,
    /// Largest deflection by the rule.
    #[schema(example = 5.0, extensions(("x-unit" = json!("um"))))]
    pub largest_deflection_um: f64,
    /// Feed that the rule asks for, by zone, before it is cut off.
    #[schema(schema_with = feeds)]
    pub rule_feed_mm_per_rev: Vec<f64>,
    /// Zones whose feed was cut off at a bound.
    #[schema(example = json!(["z2"]))]
    pub clamped: Vec<String>,
}

/// The continuous schedule and how it was cut into zones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Continuous {
    /// Time in the cut with a feed that varies freely.
    #[schema(example = 28.8, extensions(("x-unit" = json!("min"))))]
    pub cutting_time_min: f64,
    /// Zones found.
    #[schema(example = 18, extensions(("x-unit" = json!("1"))))]
    pub segments: u32,
    /// Time that the zones found cost over the continuous schedule.
    #[schema(example = 0.96, extensions(("x-unit" = json!("percent"))))]
    pub loss_percent: f64,
    /// Whether the loss asked for was reached.
    #[schema(example = true)]
    pub loss_reached: bool,
    /// Cutting speed, where it is one for all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 60.0, extensions(("x-unit" = json!("m/min"))))]
    pub speed_m_per_min: Option<f64>,
    /// Grid of the continuous schedule.
    #[schema(schema_with = stations)]
    pub z_mm: Vec<f64>,
    /// The feed on it.
    #[schema(schema_with = feeds)]
    pub feed_mm_per_rev: Vec<f64>,
    /// Time over the number of zones.
    pub by_segments: Vec<SegmentTime>,
}

/// Time with so many zones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SegmentTime {
    /// Zones.
    #[schema(example = 3, extensions(("x-unit" = json!("1"))))]
    pub segments: u32,
    /// Least time in the cut.
    #[schema(example = 30.8, extensions(("x-unit" = json!("min"))))]
    pub cutting_time_min: f64,
    /// Over the continuous schedule.
    #[schema(example = 6.7, extensions(("x-unit" = json!("percent"))))]
    pub loss_percent: f64,
    /// Borders of the zones.
    #[schema(schema_with = stations)]
    pub boundaries_mm: Vec<f64>,
}

/// The split into passes and those that were tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PassesOutcome {
    /// Roughing passes.
    #[schema(example = 1, extensions(("x-unit" = json!("1"))))]
    pub roughing_passes: u32,
    /// Depth of each; absent without roughing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 3.0, extensions(("x-unit" = json!("mm"))))]
    pub roughing_depth_mm: Option<f64>,
    /// Depth of the finishing pass.
    #[schema(example = 3.0, extensions(("x-unit" = json!("mm"))))]
    pub finishing_depth_mm: f64,
    /// The best of every number of passes.
    pub tried: Vec<PassTrial>,
}

/// The best split with so many passes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PassTrial {
    /// Roughing passes.
    #[schema(example = 1, extensions(("x-unit" = json!("1"))))]
    pub roughing_passes: u32,
    /// Depth of the finishing pass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 3.0, extensions(("x-unit" = json!("mm"))))]
    pub finishing_depth_mm: Option<f64>,
    /// The objective; absent where no depth is feasible.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 2.08, extensions(("x-unit" = json!("as objective_unit says"))))]
    pub objective: Option<f64>,
}

/// A point of the trade-off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TradePoint {
    /// Factor on the limits.
    #[schema(example = 0.5, extensions(("x-unit" = json!("1"))))]
    pub factor: f64,
    /// The objective; absent where no schedule exists.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 61.2, extensions(("x-unit" = json!("as objective_unit says"))))]
    pub objective: Option<f64>,
    /// Time in the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 61.2, extensions(("x-unit" = json!("min"))))]
    pub cutting_time_min: Option<f64>,
    /// Share of a cutting edge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.4, extensions(("x-unit" = json!("1"))))]
    pub tool_usage: Option<f64>,
}

/// The path that takes the predicted deflection out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CompensatedPath {
    /// Moves of every zone.
    pub zones: Vec<PathOfZone>,
    /// Largest deviation of the diameter on the nominal path.
    #[schema(example = 20.0, extensions(("x-unit" = json!("um"))))]
    pub largest_uncompensated_um: f64,
    /// Largest deviation of the diameter on this path, as predicted.
    #[schema(example = 1.1, extensions(("x-unit" = json!("um"))))]
    pub largest_compensated_um: f64,
    /// Straight moves.
    #[schema(example = 14, extensions(("x-unit" = json!("1"))))]
    pub moves: u32,
}

/// Straight moves along a zone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PathOfZone {
    /// The zone.
    #[schema(example = "z1")]
    pub id: String,
    /// Ends of the moves.
    #[schema(schema_with = stations)]
    pub z_mm: Vec<f64>,
    /// Diameter to command there.
    #[schema(schema_with = diameters)]
    pub commanded_diameter_mm: Vec<f64>,
}

fn list(unit: &'static str, description: &'static str, example: f64) -> Schema {
    let extensions = Extensions::builder().add("x-unit", unit).build();
    let item = ObjectBuilder::new().schema_type(SchemaType::new(Type::Number)).extensions(Some(extensions));
    ArrayBuilder::new().items(item).description(Some(description)).examples([[example]]).into()
}

fn feeds() -> Schema {
    list("mm/rev", "Feeds.", 0.15)
}

fn stations() -> Schema {
    list("mm", "Stations from the headstock end.", 320.8)
}

fn diameters() -> Schema {
    list("mm", "Diameters.", 79.98)
}
