//! The answer: the compliances of the machine, how well they are known, and what of a record they fill.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::input::GaugedAt;

/// What the readings say of the machine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "ComplianceFit")]
pub struct Outcome {
    /// What was found, in the order of the supports, the carriage after them.
    pub compliances: Vec<FoundCompliance>,
    /// How well the readings are met.
    pub fit: GaugeFit,
    /// The further load that narrows the least known compliance most; null where the readings know all of them to 10 %.
    pub next_load: Option<NextLoad>,
    /// What `PUT /v1/machines/{name}` takes as `set`, by place in the record.
    pub set: BTreeMap<String, MeasuredNumber>,
    /// Row by row.
    pub rows: Vec<FittedRow>,
}

/// What a number is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = MachinePart)]
pub enum Part {
    /// The support at the headstock, radially.
    Headstock,
    /// The chuck against rotation.
    HeadstockRotation,
    /// The support at the tailstock.
    Tailstock,
    /// A steady rest.
    SteadyRest,
    /// Carriage and tool post.
    Carriage,
    /// The play at the bar.
    PlayAtWork,
    /// The play at the tool post.
    PlayAtTool,
}

impl Part {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Headstock => "headstock",
            Self::HeadstockRotation => "headstock_rotation",
            Self::Tailstock => "tailstock",
            Self::SteadyRest => "steady_rest",
            Self::Carriage => "carriage",
            Self::PlayAtWork => "play_at_work",
            Self::PlayAtTool => "play_at_tool",
        }
    }

    /// Its unit, as in the contract.
    pub fn unit(self) -> &'static str {
        match self {
            Self::HeadstockRotation => "rad/(N mm)",
            Self::PlayAtWork | Self::PlayAtTool => "um",
            Self::Headstock | Self::Tailstock | Self::SteadyRest | Self::Carriage => "um/N",
        }
    }
}

/// A number that was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FoundCompliance {
    /// What it is of.
    pub of: Part,
    /// Place of its support in `supports`, counted from 0; null for carriage and play.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub support: Option<usize>,
    /// Its unit.
    pub unit: String,
    /// Value, never below 0.
    #[schema(extensions(("x-unit" = json!("as unit says"))))]
    pub value: f64,
    /// Standard uncertainty by the gauge's error, widened where the readings scatter more.
    #[schema(extensions(("x-unit" = json!("as unit says"))))]
    pub standard_uncertainty: f64,
    /// Lower end of the 95 % interval, 0 at least.
    #[schema(extensions(("x-unit" = json!("as unit says"))))]
    pub lower: f64,
    /// Upper end.
    #[schema(extensions(("x-unit" = json!("as unit says"))))]
    pub upper: f64,
}

/// How well the readings are met.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GaugeFit {
    /// Rows.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rows: usize,
    /// Rows less what was found.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub spare_rows: usize,
    /// Root mean square of what is left of the readings.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub rms_um: f64,
    /// Scatter of readings that were repeated under the same load; null where none was.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub repeat_um: Option<f64>,
    /// Probability of so much being left, or more, where the model is right and the gauge errs as stated; null without spare rows.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub p_value: Option<f64>,
    /// Factor by which the uncertainties are widened, 1 where the readings fit.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub widened: f64,
}

/// A load that is worth measuring.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NextLoad {
    /// Where the gauge stands.
    pub at: GaugedAt,
    /// Station of load and gauge; null at the tool.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_load_mm: Option<f64>,
    /// Load.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub force_n: f64,
    /// The number that it narrows.
    pub narrows: Part,
    /// Its relative standard uncertainty now.
    #[schema(extensions(("x-unit" = json!("percent"))))]
    pub now_percent: f64,
    /// The same with one reading under that load.
    #[schema(extensions(("x-unit" = json!("percent"))))]
    pub then_percent: f64,
}

/// A number as a machine's record keeps it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MeasuredNumber {
    /// Value in the unit of its place.
    #[schema(extensions(("x-unit" = json!("as place says"))))]
    pub value: f64,
    /// Where it comes from.
    pub source: String,
    /// How certain that is.
    pub certainty: String,
    /// How it was found.
    pub determined_by: String,
    /// Relative standard uncertainty, 200 at most.
    #[schema(extensions(("x-unit" = json!("percent"))))]
    pub relative_standard_uncertainty_percent: f64,
}

/// A row and what is predicted of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FittedRow {
    /// Row of the table, counted from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub row: usize,
    /// Reading.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub reading_um: f64,
    /// Reading predicted.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub predicted_um: f64,
    /// What of it is the bending of the bar.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub bending_um: f64,
    /// Reading less prediction, in standard errors of the gauge.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub residual: f64,
}
