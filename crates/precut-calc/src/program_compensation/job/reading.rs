//! How a control reads what a program does not say.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::ProgramEncoding;

/// How a control reads what a program does not say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = ProgramReading)]
pub struct Reading {
    /// Which bytes its characters are, for the bytes that are given back; of a file that is not UTF-8 it is Latin-1.
    #[serde(default)]
    #[schema(default = "utf_8", example = "utf_8")]
    pub encoding: ProgramEncoding,
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
            encoding: ProgramEncoding::default(),
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
