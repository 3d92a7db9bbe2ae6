//! The job: a table of amplitude against depth, what is known of cut and vise, and what is to be found.

use serde::{Deserialize, Serialize};
use utoipa::openapi::extensions::Extensions;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::calculator::{Measured, MeasuredRow};

use crate::fixture_stability::job::input::{FeedToward, MillingForce, Regeneration, Vise};

/// Most rows of a table.
pub const MAX_ROWS: usize = 400;

/// A measured table of amplitude against depth, and the parameters wanted of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "FixtureIdentificationJob")]
pub struct IdentificationJob {
    /// The face mill.
    #[schema(extensions(("x-group" = json!("tool"))))]
    pub cutter: CutterOfTable,
    /// How the cutting force follows from chip thickness and depth. What is unknown of it begins at what is stated.
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub force: MillingForce,
    /// A force that was measured with the fixture held still: it fixes the coefficient of the force, whatever the exponents.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub peak_force: Option<PeakForce>,
    /// The cut, as far as rows do not state it.
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub cut: CutOfTable,
    /// The vise with the workpiece. What is unknown of it begins at what is stated; a stated clamp force is held against the
    /// rows in which a joint opened.
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub fixture: Vise,
    /// One row per cut.
    #[schema(schema_with = Measured::<AmplitudeRow>::schema)]
    pub measurements: Measured<AmplitudeRow>,
    /// What is to be found, each with the range in which it is looked for. Without any the table is predicted as it stands.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics"))))]
    pub unknowns: Unknowns,
    /// What the amplitude of the table may be; each is tried.
    #[serde(default = "default_amplitudes")]
    #[schema(min_items = 1, max_items = 3, default = json!(["peak_to_peak"]), example = json!(["peak_to_peak"]))]
    pub amplitudes: Vec<AmplitudeMeaning>,
    /// What may become of a surface that a tooth leaves uncut; each is tried.
    #[serde(default = "default_regenerations")]
    #[schema(min_items = 1, max_items = 2, default = json!(["multiple", "single"]), example = json!(["multiple", "single"]))]
    pub regenerations: Vec<Regeneration>,
    /// Smallest step of the reading.
    #[serde(default = "default_resolution")]
    #[schema(minimum = 0.0, maximum = 10_000.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("r"))))]
    pub resolution_um: f64,
    /// Scatter of an amplitude beside the resolution, as a share of it.
    #[serde(default = "default_scatter")]
    #[schema(minimum = 0.001, maximum = 1.0, default = 0.06, example = 0.06, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s"))))]
    pub relative_scatter: f64,
    /// The runs in time of rows that chatter.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub simulation: RowRuns,
    /// How long is searched.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub search: SearchSettings,
}

fn default_amplitudes() -> Vec<AmplitudeMeaning> {
    vec![AmplitudeMeaning::PeakToPeak]
}
fn default_regenerations() -> Vec<Regeneration> {
    vec![Regeneration::Multiple, Regeneration::Single]
}
fn default_resolution() -> f64 {
    1.0
}
fn default_scatter() -> f64 {
    0.06
}

/// A face mill with equal pitch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CutterOfTable {
    /// Diameter over the tips.
    #[schema(minimum = 0.1, maximum = 5000.0, example = 100.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("D"))))]
    pub diameter_mm: f64,
    /// Number of teeth, where rows do not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 200, example = 8, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("z"))))]
    pub teeth: Option<u32>,
}

/// A measured force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PeakForce {
    /// Largest force along the feed, either way.
    #[schema(minimum = 0.001, maximum = 1e7, example = 500.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_x"))))]
    pub force_n: f64,
    /// Axial depth at which it was measured.
    #[schema(minimum = 0.001, maximum = 1000.0, example = 3.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: f64,
    /// Number of teeth.
    #[schema(minimum = 1, maximum = 200, example = 8, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("z"))))]
    pub teeth: u32,
    /// Feed per tooth.
    #[schema(minimum = 0.000_01, maximum = 10.0, example = 0.039, extensions(("x-unit" = json!("mm/tooth")), ("x-symbol" = json!("S_z")), ("x-code" = json!("bad_feed_per_tooth"))))]
    pub feed_mm_per_tooth: f64,
}

/// The cut, as far as rows do not state it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CutOfTable {
    /// Width of the milled strip.
    #[schema(minimum = 0.001, maximum = 5000.0, example = 50.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("B"))))]
    pub width_mm: f64,
    /// Centre line of the strip from the cutter's axis, positive toward the side where teeth enter.
    #[serde(default)]
    #[schema(minimum = -5000.0, maximum = 5000.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("e"))))]
    pub offset_mm: f64,
    /// Spindle speed of rows that state none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 190.2, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n")), ("x-code" = json!("bad_spindle_speed"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Feed per tooth of rows that state none; or give the table feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_01, maximum = 10.0, example = 0.039, extensions(("x-unit" = json!("mm/tooth")), ("x-symbol" = json!("S_z")), ("x-code" = json!("bad_feed_per_tooth"))))]
    pub feed_mm_per_tooth: Option<f64>,
    /// Table feed of rows that state no feed per tooth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_1, maximum = 1e6, example = 59.34, extensions(("x-unit" = json!("mm/min")), ("x-symbol" = json!("S"))))]
    pub feed_mm_per_min: Option<f64>,
    /// Which jaw the tool is fed toward.
    #[serde(default)]
    #[schema(default = "movable_jaw", example = "movable_jaw")]
    pub feed_toward: FeedToward,
}

/// A row: one cut with what was seen in it. An amplitude, or a joint that opened, or both.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AmplitudeRow {
    /// Number of teeth, where it is not that of the cutter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 200, example = 8, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("z"))))]
    pub teeth: Option<u32>,
    /// Spindle speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 190.2, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n")), ("x-code" = json!("bad_spindle_speed"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Feed per tooth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_01, maximum = 10.0, example = 0.039, extensions(("x-unit" = json!("mm/tooth")), ("x-symbol" = json!("S_z")), ("x-code" = json!("bad_feed_per_tooth"))))]
    pub feed_mm_per_tooth: Option<f64>,
    /// Axial depth of cut.
    #[schema(minimum = 0.001, maximum = 1000.0, example = 3.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: f64,
    /// Amplitude of the workpiece along the feed, as `amplitudes` means it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1e4, example = 14.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("A"))))]
    pub amplitude_um: Option<f64>,
    /// Which joint opened; left out: none did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(inline, example = "fixed")]
    pub opened: Option<OpenedJoint>,
    /// Left out of the search, predicted all the same.
    #[serde(default, skip_serializing_if = "is_false")]
    #[schema(default = false, example = false)]
    pub excluded: bool,
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_false(flag: &bool) -> bool {
    !*flag
}

impl MeasuredRow for AmplitudeRow {
    const MAX_ROWS: usize = MAX_ROWS;
    const MEASURED: &'static [&'static str] = &["amplitude_um", "opened"];
}

/// Which joint opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum OpenedJoint {
    /// At the movable jaw.
    Movable,
    /// At the fixed jaw.
    Fixed,
    /// One of them.
    Either,
}

/// What an amplitude is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AmplitudeMeaning {
    /// Largest less smallest displacement.
    PeakToPeak,
    /// Half of it.
    HalfPeakToPeak,
    /// Largest displacement from the clamped equilibrium, either way.
    LargestDisplacement,
}

impl AmplitudeMeaning {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::PeakToPeak => "peak_to_peak",
            Self::HalfPeakToPeak => "half_peak_to_peak",
            Self::LargestDisplacement => "largest_displacement",
        }
    }
}

/// Parameters to be found: for each its least and largest value.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Unknowns {
    /// C1 + C2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = stiffness_range)]
    pub stiffness_n_per_mm: Option<[f64; 2]>,
    /// Mass of the workpiece.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = mass_range)]
    pub mass_kg: Option<[f64; 2]>,
    /// Natural frequency of the workpiece on both joints with the jaw held, in place of its mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = frequency_range)]
    pub natural_frequency_hz: Option<[f64; 2]>,
    /// lambda1 + lambda2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = damping_range)]
    pub damping_n_s_per_mm: Option<[f64; 2]>,
    /// Damping ratio of the workpiece on both joints with the jaw held, in place of the damping.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = ratio_range)]
    pub damping_ratio: Option<[f64; 2]>,
    /// C1/(C1 + C2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = stiffness_share_range)]
    pub movable_stiffness_share: Option<[f64; 2]>,
    /// lambda1/(lambda1 + lambda2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = damping_share_range)]
    pub movable_damping_share: Option<[f64; 2]>,
    /// Mass of the movable jaw.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = jaw_range)]
    pub jaw_mass_kg: Option<[f64; 2]>,
    /// Coefficient of the force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = coefficient_range)]
    pub force_coefficient: Option<[f64; 2]>,
    /// k of the force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = chip_exponent_range)]
    pub chip_thickness_exponent: Option<[f64; 2]>,
    /// mu of the force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = depth_exponent_range)]
    pub depth_exponent: Option<[f64; 2]>,
    /// Spindle speed of the rows that state none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = speed_range)]
    pub spindle_speed_rpm: Option<[f64; 2]>,
}

/// Least and largest value of a parameter.
struct RangeOf {
    text: &'static str,
    unit: &'static str,
    symbol: &'static str,
    bounds: (f64, f64),
    example: [f64; 2],
}

impl RangeOf {
    fn schema(&self) -> RefOr<Schema> {
        let mut extensions = Extensions::default();
        extensions.insert("x-unit".to_owned(), self.unit.into());
        extensions.insert("x-symbol".to_owned(), self.symbol.into());
        let number = ObjectBuilder::new()
            .schema_type(SchemaType::new(Type::Number))
            .description(Some("Least, then largest value."))
            .minimum(Some(self.bounds.0))
            .maximum(Some(self.bounds.1))
            .examples([self.example[0]])
            .extensions(Some(extensions));
        let array = ArrayBuilder::new()
            .items(number)
            .min_items(Some(2))
            .max_items(Some(2))
            .description(Some(self.text))
            .examples([self.example]);
        RefOr::T(Schema::Array(array.build()))
    }
}

macro_rules! range_schema {
    ($name:ident, $text:literal, $unit:literal, $symbol:literal, $low:literal..$high:literal, $example:expr) => {
        fn $name() -> RefOr<Schema> {
            RangeOf { text: $text, unit: $unit, symbol: $symbol, bounds: ($low, $high), example: $example }.schema()
        }
    };
}

range_schema!(stiffness_range, "Both joints together, C1 + C2.", "N/mm", "C", 0.001..1e9, [10_000.0, 100_000.0]);
range_schema!(mass_range, "Mass of the workpiece.", "kg", "m", 0.0001..1e6, [1.0, 10.0]);
range_schema!(
    frequency_range,
    "Natural frequency of the workpiece on both joints with the jaw held; the mass follows from it.",
    "Hz",
    "f_n",
    0.1..1e6,
    [200.0, 1500.0]
);
range_schema!(
    damping_range,
    "Damping of both joints together, lambda1 + lambda2.",
    "N s/mm",
    "lambda",
    0.000_000_001..1e6,
    [0.3, 5.0]
);
range_schema!(
    ratio_range,
    "Damping ratio of the workpiece on both joints with the jaw held; the damping follows from it.",
    "1",
    "zeta",
    0.000_001..10.0,
    [0.01, 0.3]
);
range_schema!(
    stiffness_share_range,
    "Share of the joint at the movable jaw in the stiffness.",
    "1",
    "C_1/C",
    0.001..0.999,
    [0.05, 0.95]
);
range_schema!(
    damping_share_range,
    "Share of the joint at the movable jaw in the damping.",
    "1",
    "lambda_1/lambda",
    0.0..1.0,
    [0.05, 0.98]
);
range_schema!(jaw_range, "Mass of the movable jaw.", "kg", "m_3", 0.0001..1e6, [0.3, 10.0]);
range_schema!(coefficient_range, "Coefficient of the force.", "N/mm2", "C_p", 0.001..1e6, [500.0, 5000.0]);
range_schema!(
    chip_exponent_range,
    "The force goes with the power 1-k of the chip thickness.",
    "1",
    "k",
    0.0..0.99,
    [0.0, 0.5]
);
range_schema!(
    depth_exponent_range,
    "The force goes with the power 1-mu of the depth.",
    "1",
    "mu",
    0.0..0.99,
    [0.0, 0.3]
);
range_schema!(
    speed_range,
    "Spindle speed of the rows that state none.",
    "rev/min",
    "n",
    0.1..200_000.0,
    [100.0, 1000.0]
);

/// The runs in time of rows that chatter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RowRuns {
    /// Tooth periods of a run.
    #[schema(minimum = 40, maximum = 2000, default = 160, example = 160, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("M"))))]
    pub tooth_periods: u32,
    /// Tooth periods at its end over which amplitudes are taken.
    #[schema(minimum = 1, maximum = 2000, default = 50, example = 50, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("M_s"))))]
    pub steady_tooth_periods: u32,
    /// Steps per oscillation of the highest natural frequency while searching; the answer is computed with half the step.
    #[schema(minimum = 16, maximum = 400, default = 40, example = 40, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N"))))]
    pub steps_per_oscillation: u32,
}

impl Default for RowRuns {
    fn default() -> Self {
        Self { tooth_periods: 160, steady_tooth_periods: 50, steps_per_oscillation: 40 }
    }
}

/// How long is searched.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SearchSettings {
    /// Parameter sets that are bettered together.
    #[schema(minimum = 8, maximum = 400, default = 48, example = 48, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("M"))))]
    pub members: u32,
    /// Generations of them at most, for every law that is tried.
    #[schema(minimum = 1, maximum = 1000, default = 50, example = 50, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("G"))))]
    pub generations: u32,
    /// Seed of the search: with the same one the same answer.
    #[schema(minimum = 0, maximum = 4_294_967_295_u32, default = 1, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("seed"))))]
    pub seed: u32,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self { members: 48, generations: 50, seed: 1 }
    }
}
