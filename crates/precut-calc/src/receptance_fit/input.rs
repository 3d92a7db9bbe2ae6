//! The job: measured frequency responses and what is asked of them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Most modes.
pub const MAX_MODES: usize = 20;
/// Most files.
pub const MAX_FILES: usize = 16;

/// Frequency responses of tool or workpiece, measured at the cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "ReceptanceFitJob")]
pub struct Job {
    /// What was measured: CSV, or universal files with datasets 58 and 58b.
    #[schema(min_items = 1, max_items = 16)]
    pub files: Vec<ReceptanceFile>,
    /// How many modes there are; as many as the lines ask for where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 20, example = 2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N")), ("x-group" = json!("numerics"))))]
    pub modes: Option<u32>,
    /// Lines below it are left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1_000_000.0, example = 100.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_1")), ("x-group" = json!("numerics"))))]
    pub from_hz: Option<f64>,
    /// Lines above it are left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1_000_000.0, example = 2500.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_2")), ("x-group" = json!("numerics"))))]
    pub to_hz: Option<f64>,
    /// What modes beside the band leave in it.
    #[serde(default)]
    #[schema(default = "mass_and_stiffness", extensions(("x-group" = json!("numerics"))))]
    pub residuals: Residuals,
}

/// A file with one function or several.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ReceptanceFile {
    /// A file of text as it is: CSV, or a universal file in ASCII. The CSV's header says the units: `frequency [Hz]`,
    /// then `real [um/N]`, `imaginary [um/N]`, or `amplitude [um/N]`, `phase [deg]`; a column `coherence` weighs the lines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_length = 1, max_length = 8_000_000, example = "frequency [Hz],real [um/N],imaginary [um/N]\n100,0.31,-0.02\n", extensions(("x-lines" = json!(true))))]
    pub text: Option<String>,
    /// A file with binary sets, its bytes as base64. Any other file may come so as well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_length = 1, max_length = 8_000_000, example = "ICAgIC0xCg==", extensions(("x-lines" = json!(true)), ("x-advanced" = json!(true))))]
    pub base64: Option<String>,
    /// Direction in which the motion was measured, where the file does not say it; x where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response: Option<Direction>,
    /// Direction in which it was struck or shaken, where the file does not say it; x where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excitation: Option<Direction>,
    /// Unit of the numbers, where the file does not say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-advanced" = json!(true))))]
    pub unit: Option<Unit>,
}

/// A direction along an axis of the cut, or against it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = ReceptanceDirection)]
pub enum Direction {
    /// Along the feed.
    X,
    /// Across the feed.
    Y,
    /// Along the spindle.
    Z,
    /// Against x.
    MinusX,
    /// Against y.
    MinusY,
    /// Against z.
    MinusZ,
}

impl Direction {
    /// Which axis, from 0.
    pub fn axis(self) -> usize {
        match self {
            Self::X | Self::MinusX => 0,
            Self::Y | Self::MinusY => 1,
            Self::Z | Self::MinusZ => 2,
        }
    }

    /// 1 along the axis, -1 against it.
    pub fn sign(self) -> f64 {
        match self {
            Self::X | Self::Y | Self::Z => 1.0,
            Self::MinusX | Self::MinusY | Self::MinusZ => -1.0,
        }
    }

    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
            Self::MinusX => "minus_x",
            Self::MinusY => "minus_y",
            Self::MinusZ => "minus_z",
        }
    }
}

/// A unit of motion over force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = ReceptanceUnit)]
pub enum Unit {
    /// Displacement, m/N.
    MPerN,
    /// Displacement, mm/N.
    MmPerN,
    /// Displacement, um/N.
    UmPerN,
    /// Velocity, m/s/N.
    MPerSPerN,
    /// Velocity, mm/s/N.
    MmPerSPerN,
    /// Acceleration, m/s2/N.
    MPerS2PerN,
    /// Acceleration, mm/s2/N.
    MmPerS2PerN,
    /// Acceleration, g/N.
    GPerN,
}

/// Standard acceleration of free fall, m/s2.
const G: f64 = 9.806_65;

/// Every unit with its spelling and its size in SI units.
const UNITS: &[(Unit, &str, f64)] = &[
    (Unit::MPerN, "m/N", 1.0),
    (Unit::MmPerN, "mm/N", 1e-3),
    (Unit::UmPerN, "um/N", 1e-6),
    (Unit::MPerSPerN, "m/s/N", 1.0),
    (Unit::MmPerSPerN, "mm/s/N", 1e-3),
    (Unit::MPerS2PerN, "m/s2/N", 1.0),
    (Unit::MmPerS2PerN, "mm/s2/N", 1e-3),
    (Unit::GPerN, "g/N", G),
];

impl Unit {
    /// The unit of a spelling.
    pub fn of(text: &str) -> Option<Self> {
        let plain: String = text
            .chars()
            .filter_map(|c| match c {
                '²' => Some('2'),
                'µ' | 'μ' => Some('u'),
                '^' | ' ' | '(' | ')' => None,
                other => Some(other),
            })
            .collect();
        UNITS.iter().find(|(_, spelling, _)| *spelling == plain).map(|(unit, ..)| *unit)
    }

    fn row(self) -> (&'static str, f64) {
        UNITS.iter().find(|(unit, ..)| *unit == self).map_or(("", 1.0), |(_, spelling, size)| (*spelling, *size))
    }

    /// Its spelling.
    pub fn spelling(self) -> &'static str {
        self.row().0
    }

    /// How many SI units it is.
    pub fn si(self) -> f64 {
        self.row().1
    }

    /// How often the displacement is differentiated in time: 0, 1 or 2.
    pub fn derivative(self) -> i32 {
        match self {
            Self::MPerN | Self::MmPerN | Self::UmPerN => 0,
            Self::MPerSPerN | Self::MmPerSPerN => 1,
            Self::MPerS2PerN | Self::MmPerS2PerN | Self::GPerN => 2,
        }
    }
}

/// What stands for modes beside the band.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = ReceptanceResiduals)]
pub enum Residuals {
    /// -A/w^2 of those below it and a constant B of those above it, each function its own.
    #[default]
    MassAndStiffness,
    /// Nothing: all modes lie in the band.
    None,
}
