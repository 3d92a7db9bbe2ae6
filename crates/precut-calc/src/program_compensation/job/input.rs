//! Fields of the job.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::Dialect;

/// A program for a lathe, and what is asked of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "ProgramCompensationJob")]
pub struct Job {
    /// The program as it is, with its line ends.
    #[schema(min_length = 1, max_length = 8_000_000, example = "%\nO0042\nN10 G21 G18 G40 G99\n", extensions(("x-lines" = json!(true))))]
    pub nc_program: String,
    /// The control that the program is for. It is never guessed.
    #[schema(example = "fanuc_a")]
    pub dialect: Dialect,
    /// How the control reads what the program does not say.
    #[serde(default)]
    pub reading: Reading,
    /// What is asked.
    pub mode: Mode,
    /// Where program zero is on the work, from its headstock end. Needed with `stock`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 400.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("Z_0")), ("x-group" = json!("workpiece"))))]
    pub program_zero_z_mm: Option<f64>,
    /// The blank. With it the answer says which surface the program leaves on work and machine that do not yield, which line makes
    /// which part of it, and whether a rapid move goes through the stock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("workpiece"))))]
    pub stock: Option<ProgramStock>,
    /// The tools that cut. Needed with `stock`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100, extensions(("x-group" = json!("cut"))))]
    pub tools: Vec<ProgramTool>,
}

/// The blank.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProgramStock {
    /// Its outline from the headstock end; a place twice is a step.
    #[schema(min_items = 2, max_items = 1000, extensions(("x-code" = json!("stock_without_length"))))]
    pub profile: Vec<StockRow>,
}

/// A point of the outline of a blank.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StockRow {
    /// Station from the headstock end.
    #[schema(minimum = 0.0, maximum = 100_000.0, example = 400.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("x"))))]
    pub z_mm: f64,
    /// Diameter.
    #[schema(minimum = 0.01, maximum = 10_000.0, example = 30.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("2 R"))))]
    pub diameter_mm: f64,
}

/// A tool as it stands in the turret.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = ProgramTool)]
pub struct ProgramTool {
    /// What the program calls it: its number, or its name where the control has names.
    #[schema(min_length = 1, max_length = 64, example = "1")]
    pub number: String,
    /// Radius of the nose; 0 for a corner.
    #[schema(minimum = 0.0, maximum = 100.0, example = 0.8, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r_e"))))]
    pub nose_radius_mm: f64,
    /// Angle of the leading edge, from the axis.
    #[schema(minimum = 5.0, maximum = 135.0, example = 95.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("kappa"))))]
    pub cutting_edge_angle_deg: f64,
    /// Angle of the trailing edge, from the axis.
    #[schema(minimum = 1.0, maximum = 120.0, example = 5.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("kappa'"))))]
    pub minor_edge_angle_deg: f64,
    /// Which point of the tool the program moves: 3 the corner toward headstock and axis (a right-hand tool), 4 that toward
    /// tailstock and axis (a left-hand tool), 8 the lowest point, 0 and 9 the centre of the nose.
    #[schema(minimum = 0, maximum = 9, example = 3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("T"))))]
    pub tip_direction: u8,
}

/// How a control reads what a program does not say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = ProgramReading)]
pub struct Reading {
    /// What a word of Fanuc without a decimal point means. Needed where the program has such words: nothing is guessed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(inline, example = "as_increments")]
    pub decimal_point: Option<DecimalPoint>,
    /// Increment of words without a decimal point: of X as it is written and of Z.
    #[serde(default = "one")]
    #[schema(minimum = 0.01, maximum = 100.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("i"))))]
    pub increment_um: f64,
    /// Whether the control skips blocks that begin with a stroke.
    #[serde(default)]
    #[schema(default = false, example = false)]
    pub block_delete: bool,
    /// What X means until the program says it; by default what the control has as its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(inline, example = "diameter")]
    pub x_words: Option<WordsOfX>,
    /// Unit of length until the program says it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(inline, example = "mm")]
    pub units: Option<ProgramUnits>,
    /// What a feed means until the program says it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(inline, example = "per_rev")]
    pub feed_mode: Option<ProgramFeed>,
    /// Tool in the spindle before the program calls one, by the name that the program has for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "1", max_length = 64)]
    pub tool: Option<String>,
    /// Where the tool stands before the first move, of a program that begins in the middle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<ProgramStart>,
}

impl Default for Reading {
    fn default() -> Self {
        Self {
            decimal_point: None,
            increment_um: one(),
            block_delete: false,
            x_words: None,
            units: None,
            feed_mode: None,
            tool: None,
            start: None,
        }
    }
}

fn one() -> f64 {
    1.0
}

/// Where the tool stands before the first move.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProgramStart {
    /// Diameter.
    #[schema(minimum = -10_000.0, maximum = 10_000.0, example = 100.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("X"))))]
    pub x_diameter_mm: f64,
    /// Place along the axis from program zero.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 50.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("Z"))))]
    pub z_mm: f64,
}

/// What a word without a decimal point means to a Fanuc.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DecimalPoint {
    /// X100 is 0.1 mm, F20 per revolution is 0.2 mm.
    AsIncrements,
    /// X100 is 100 mm, F20 is 20 mm.
    AsUnits,
}

/// What X means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WordsOfX {
    /// A diameter.
    Diameter,
    /// A radius.
    Radius,
}

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProgramUnits {
    /// Millimetres.
    Mm,
    /// Inches.
    Inch,
}

/// What a feed means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProgramFeed {
    /// Length per revolution.
    PerRev,
    /// Length per minute.
    PerMin,
}

/// What is asked of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = ProgramMode)]
pub struct Mode {
    /// What is done with it.
    #[schema(example = "read")]
    pub kind: ModeKind,
}

/// What is done with a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = ProgramModeKind)]
pub enum ModeKind {
    /// It is read: its moves and what is wrong with it.
    Read,
}
