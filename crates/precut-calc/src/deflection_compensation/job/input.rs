//! The job: a shaft, how it is held, and the cut.

use serde::{Deserialize, Serialize};
use utoipa::openapi::Schema;
use utoipa::openapi::extensions::Extensions;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, SchemaType, Type};
use utoipa::{PartialSchema, ToSchema};

use crate::calculator::{Dialect, Measured, MeasuredRow, ProgramEnd};
use crate::diameters::{Aim, Asked, Tolerance, Uncertainty};
use crate::effects::{DeflectionConditions, DeflectionEffect};
use crate::force::ForceModel;
pub use crate::shaft::{Carriage, FeedDirection, Section, Segment, Shaft, Support, Theory};

/// Most stations of a job, however they are given.
pub const MAX_STATIONS: usize = 200_000;

/// A slender shaft to be turned, and what is to be known before the cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "DeflectionCompensationJob")]
pub struct Job {
    /// The workpiece.
    #[schema(extensions(("x-group" = json!("workpiece"))))]
    pub shaft: Shaft,
    /// What holds it, from the headstock on: two centres, a chuck, rests.
    #[schema(min_items = 1, max_items = 8, extensions(("x-group" = json!("machine")), ("x-code" = json!("unstable_support"))))]
    pub supports: Vec<Support>,
    /// Compliance of carriage and tool.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub carriage: Carriage,
    /// How cutting forces follow from depth, feed and speed.
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub force: ForceModel,
    /// Feed, speed and direction.
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub cut: Cut,
    /// Which parts of the base physics act.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics"))))]
    pub include: Include,
    /// Direction and size of gravity, for `include.weight`.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub gravity: Gravity,
    /// Where along the shaft the answer is given.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics"))))]
    pub stations: Stations,
    /// Measured or predicted diameter of the blank along the shaft; linear between rows, constant beyond
    /// them. Replaces the segments' stock diameters in the depth of cut (not in the stiffness).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = Measured::<StockRow>::schema, required = false)]
    pub stock_profile: Option<Measured<StockRow>>,
    /// Several passes instead of one; each turns down to its diameter, no segment below its drawing diameter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 20, extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub passes: Vec<Pass>,
    /// How far the answer goes.
    #[serde(default)]
    #[schema(default = "full", example = "full")]
    pub detail: Detail,
    /// What the drawing allows.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("workpiece"))))]
    pub tolerance: Tolerance,
    /// Where within its limits the diameter is aimed at; by a shift of the commanded diameter, the same all along.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub aim: Aim,
    /// How well force and stiffness are known.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub uncertainty: Uncertainty,
    /// How the commanded path is cut into straight moves.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub path: PathSettings,
    /// How the program is spelled.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub program: ProgramSettings,
    /// Limits of insert and shop; a warning is given beyond them.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub limits: Limits,
    /// Axial force with which the tailstock presses; it adds to the feed force in the margin to buckling.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1_000_000.0, example = 1500.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F_t")), ("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub tailstock_thrust_n: Option<f64>,
    /// Whether the one-step formula of the source paper is shown beside the exact command, with what it would leave.
    #[serde(default)]
    #[schema(default = false, example = true, extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub compare_one_step: bool,
    /// Named physical effects that act beside the base model; a kind occurs once.
    #[serde(default)]
    #[schema(max_items = 22, extensions(("x-group" = json!("effects"))))]
    pub effects: Vec<DeflectionEffect>,
    /// The state that effects depend on.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("effects"))))]
    pub conditions: DeflectionConditions,
}

/// Feed, speed and direction of the cut. Exactly one of cutting speed and spindle speed is given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// Feed per revolution.
    #[schema(minimum = 0.000_1, maximum = 20.0, example = 0.5, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("s")), ("x-group" = json!("cut")), ("x-code" = json!("bad_feed"))))]
    pub feed_mm_per_rev: f64,
    /// Cutting speed, held constant (G96).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 20_000.0, example = 140.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("v")), ("x-group" = json!("cut")), ("x-code" = json!("bad_speed"))))]
    pub speed_m_per_min: Option<f64>,
    /// Spindle speed, held constant (G97); the cutting speed then follows the diameter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 200_000.0, example = 500.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n")), ("x-group" = json!("cut")), ("x-code" = json!("bad_speed"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Diameter at which the cutting speed counts.
    #[serde(default)]
    #[schema(default = "stock", example = "stock")]
    pub speed_diameter: SpeedDiameter,
    /// Which way the tool travels.
    #[serde(default)]
    #[schema(default = "to_headstock", example = "to_headstock")]
    pub feed_direction: FeedDirection,
}

/// Diameter at which the cutting speed counts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SpeedDiameter {
    /// The largest diameter in the cut (ISO 3002).
    #[default]
    Stock,
    /// The diameter produced.
    Finish,
}

/// Which parts of the base physics act beside the passive force.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Include {
    /// What becomes of the switches that are not said: these two, the shaft's section and its theory.
    #[serde(default)]
    #[schema(default = "auto", example = "auto")]
    pub mode: IncludeMode,
    /// The main force bends the shaft across the radial direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = true)]
    pub tangential: Option<bool>,
    /// The feed force bends the shaft by its moment about the axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = true)]
    pub axial_moment: Option<bool>,
    /// The shaft sags under its own weight.
    #[serde(default)]
    #[schema(default = false, example = true)]
    pub weight: bool,
}

impl Include {
    /// Whether the main force's bending acts.
    pub(in crate::deflection_compensation) fn tangential(&self) -> bool {
        self.tangential == Some(true)
    }

    /// Whether the feed force's moment acts.
    pub(in crate::deflection_compensation) fn axial_moment(&self) -> bool {
        self.axial_moment == Some(true)
    }
}

/// What becomes of switches that a job does not say.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum IncludeMode {
    /// On where the effect changes the diameter by more than a tenth of the tolerance, without one of the uncertainty.
    #[default]
    Auto,
    /// Off.
    AsStated,
}

/// Gravity as the lathe stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Gravity {
    /// Acceleration.
    #[serde(default = "standard_gravity")]
    #[schema(minimum = 0.0, maximum = 100.0, default = 9.81, example = 9.81, extensions(("x-unit" = json!("m/s2")), ("x-symbol" = json!("g"))))]
    pub acceleration_m_per_s2: f64,
    /// Angle from the radial direction away from the tool toward the direction in which the main force
    /// pushes the work: -90 on a flat bed with the tool in front, -45 on a slant bed.
    #[serde(default = "flat_bed")]
    #[schema(minimum = -180.0, maximum = 180.0, default = -90.0, example = -45.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("angle"))))]
    pub angle_deg: f64,
}

fn standard_gravity() -> f64 {
    9.81
}

fn flat_bed() -> f64 {
    -90.0
}

impl Default for Gravity {
    fn default() -> Self {
        Self { acceleration_m_per_s2: standard_gravity(), angle_deg: flat_bed() }
    }
}

/// Where along the shaft the answer is given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Stations {
    /// So many in every turned zone (neighbouring segments of one diameter), evenly, with both its ends.
    PerZone {
        /// Stations per zone.
        #[schema(minimum = 2, maximum = 200_000, example = 201, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
        count: u32,
    },
    /// These, ascending. On a shoulder the segment that ends there counts.
    List {
        /// Stations from the headstock end.
        #[schema(schema_with = station_list)]
        z_mm: Vec<f64>,
    },
}

/// Ranges of the list's items, which utoipa's attributes do not reach.
fn station_list() -> Schema {
    let extensions = Extensions::builder().add("x-unit", "mm").add("x-symbol", "z").build();
    let station = ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::Number))
        .minimum(Some(0.0))
        .maximum(Some(20_000_000.0))
        .examples([500.0])
        .extensions(Some(extensions));
    ArrayBuilder::new()
        .items(station)
        .min_items(Some(1))
        .max_items(Some(MAX_STATIONS))
        .description(Some("Stations from the headstock end."))
        .examples([[0.0, 500.0, 1000.0, 1500.0, 2000.0]])
        .into()
}

impl Default for Stations {
    fn default() -> Self {
        Self::PerZone { count: 201 }
    }
}

/// One measured diameter of the blank.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StockRow {
    /// Station from the headstock end, ascending from row to row.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 200.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
    pub z_mm: f64,
    /// Diameter of the blank there.
    #[schema(minimum = 0.01, maximum = 10_000.0, example = 44.6, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("D_0"))))]
    pub diameter_mm: f64,
}

impl MeasuredRow for StockRow {
    const MAX_ROWS: usize = MAX_STATIONS;
}

/// One pass of several. Feed and speed not given are those of `cut`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Pass {
    /// Diameter that the pass turns down to.
    #[schema(minimum = 0.01, maximum = 10_000.0, example = 41.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("d")), ("x-code" = json!("bad_diameter"))))]
    pub diameter_mm: f64,
    /// Feed per revolution of the pass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_1, maximum = 20.0, example = 0.4, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("s")), ("x-code" = json!("bad_feed"))))]
    pub feed_mm_per_rev: Option<f64>,
    /// Cutting speed of the pass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 20_000.0, example = 100.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("v")), ("x-code" = json!("bad_speed"))))]
    pub speed_m_per_min: Option<f64>,
    /// Spindle speed of the pass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 200_000.0, example = 800.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n")), ("x-code" = json!("bad_speed"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Whether the pass is cut along a compensated path, planned on the nominal stock.
    #[serde(default)]
    #[schema(default = false, example = true)]
    pub compensated: bool,
}

/// How far the answer goes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Detail {
    /// Everything: profile, command, path in straight moves with its prediction, comparison, advice.
    #[default]
    Full,
    /// The profile along the shaft, the exact command and the form alone, for studies and live pictures; of
    /// uncertainty and copying only the largest, in words: several times faster, two fifths of the size.
    Profile,
}

impl Job {
    /// What it asks of the diameters that it makes.
    pub(in crate::deflection_compensation) fn asked(&self) -> Asked<'_> {
        let is_open = matches!(self.aim, Aim::Nominal {} | Aim::Middle {});
        Asked {
            tolerance: &self.tolerance,
            uncertainty: &self.uncertainty,
            effects: &self.effects,
            open_aim_um: is_open.then_some(self.path.increment_um),
            places_over_mm: Some(self.shaft.known_length_mm().unwrap_or(0.0)),
        }
    }
}

/// How the commanded path is cut into straight moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PathSettings {
    /// Largest radial deviation of the moves from the computed path, before rounding. Default: a tenth of
    /// the form tolerance (a twentieth on the radius), at least one increment; without a tolerance 1 um.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("tol"))))]
    pub chord_tolerance_um: Option<f64>,
    /// Smallest step of the control: of X on the diameter, and of Z.
    #[serde(default = "one_um")]
    #[schema(minimum = 0.001, maximum = 100.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("increment"))))]
    pub increment_um: f64,
}

fn one_um() -> f64 {
    1.0
}

impl Default for PathSettings {
    fn default() -> Self {
        Self { chord_tolerance_um: None, increment_um: one_um() }
    }
}

/// How the program is spelled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProgramSettings {
    /// The control: `fanuc` is a lathe with G-code system B, `fanuc_a` one with system A, `fanuc_c` one with system C.
    #[serde(default)]
    #[schema(default = "fanuc", example = "linuxcnc")]
    pub dialect: Dialect,
    /// Where Z is zero.
    #[serde(default)]
    #[schema(default = "right_face", example = "right_face")]
    pub zero: ProgramZero,
    /// Distance of approach and retract from the blank, on the diameter.
    #[serde(default = "five_mm")]
    #[schema(minimum = 0.0, maximum = 1000.0, default = 5.0, example = 5.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("clearance_x"))))]
    pub clearance_x_mm: f64,
    /// Distance of the approach before the cut along Z.
    #[serde(default = "two_mm")]
    #[schema(minimum = 0.0, maximum = 1000.0, default = 2.0, example = 2.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("clearance_z"))))]
    pub clearance_z_mm: f64,
    /// Limit of the spindle with constant cutting speed.
    #[serde(default = "limit_rpm")]
    #[schema(minimum = 1.0, maximum = 200_000.0, default = 3000.0, example = 3000.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_max"))))]
    pub spindle_limit_rpm: f64,
    /// Number of the tool and of its offset, called at the head of the program. Without it the program calls none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 99, example = 3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("T"))))]
    pub tool_number: Option<u32>,
    /// Whether the program switches the coolant.
    #[serde(default)]
    #[schema(default = false, example = true)]
    pub coolant: bool,
    /// Where the tool goes at the begin, for stops and at the end. Without it the tool stays beside the work.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safe_position: Option<SafePosition>,
    /// How the program ends. Default: what the control expects, `M30`, for LinuxCNC `M2`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "m30")]
    pub end: Option<ProgramEnd>,
}

/// A place clear of work, chuck and tailstock, in the program's coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SafePosition {
    /// X, a diameter.
    #[schema(minimum = 0.0, maximum = 20_000.0, example = 250.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("X"))))]
    pub x_diameter_mm: f64,
    /// Z from the program's zero.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 150.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("Z"))))]
    pub z_mm: f64,
}

fn five_mm() -> f64 {
    5.0
}

fn two_mm() -> f64 {
    2.0
}

fn limit_rpm() -> f64 {
    3000.0
}

impl Default for ProgramSettings {
    fn default() -> Self {
        Self {
            dialect: Dialect::default(),
            zero: ProgramZero::default(),
            clearance_x_mm: five_mm(),
            clearance_z_mm: two_mm(),
            spindle_limit_rpm: limit_rpm(),
            tool_number: None,
            coolant: false,
            safe_position: None,
            end: None,
        }
    }
}

/// Where Z is zero.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProgramZero {
    /// At the face of the tailstock end: Z = z - l.
    #[default]
    RightFace,
    /// At the face of the headstock end: Z = z.
    LeftFace,
}

/// Limits of insert and shop; a warning is given beyond them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Deepest cut that the insert's edge takes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1000.0, example = 6.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_max"))))]
    pub depth_mm: Option<f64>,
    /// Steepest commanded path, radius per length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-9, maximum = 10.0, example = 0.01, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("slope"))))]
    pub slope: Option<f64>,
}
