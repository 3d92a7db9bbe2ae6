//! The answer: the parameters, what they predict row by row, and how far the table fixes them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::input::{AmplitudeMeaning, OpenedJoint};
use crate::fixture_stability::job::input::{MillingForce, Regeneration, Vise};

/// Parameters found, and what they are worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "FixtureIdentification")]
pub struct IdentificationOutcome {
    /// Cut and vise with the parameters found, as a job of fixture stability takes them.
    pub identified: IdentifiedFixture,
    /// The law of regeneration that fits best.
    pub regeneration: Regeneration,
    /// The meaning of the amplitude that fits best.
    pub amplitude: AmplitudeMeaning,
    /// The parameters that were looked for.
    pub parameters: Vec<IdentifiedParameter>,
    /// How well the table is met.
    pub fit: TableFit,
    /// Row by row.
    pub rows: Vec<IdentifiedRow>,
    /// Where chatter begins, by cutter, speed and feed.
    pub onsets: Vec<OnsetFit>,
    /// What rows with open and with closed joints say of the clamp force; null where none is asked or seen.
    pub clamp_force: Option<ClampBounds>,
    /// Every law that was tried, the best first.
    pub hypotheses: Vec<HypothesisFit>,
    /// How parameters lean on one another.
    pub correlations: Vec<ParameterPair>,
    /// Combinations of parameters that the table knows independently of one another, the best known first.
    pub combinations: Vec<Combination>,
    /// Parameter sets that were tried.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub evaluations: u64,
    /// Generator of the search.
    pub generator: String,
}

/// Cut and vise with the parameters found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct IdentifiedFixture {
    /// Spindle speed of the rows that state none.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Force.
    pub force: MillingForce,
    /// Vise with the workpiece.
    pub fixture: Vise,
}

/// A parameter that was looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct IdentifiedParameter {
    /// Its field in `unknowns`.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Value found.
    #[schema(extensions(("x-unit" = json!("as unit says"))))]
    pub value: f64,
    /// Standard error; null where the table does not fix it.
    #[schema(extensions(("x-unit" = json!("as unit says"))))]
    pub standard_error: Option<f64>,
    /// Lower end of the 95 % interval, within the range searched.
    #[schema(extensions(("x-unit" = json!("as unit says"))))]
    pub lower: f64,
    /// Upper end.
    #[schema(extensions(("x-unit" = json!("as unit says"))))]
    pub upper: f64,
    /// Whether it lies at an end of the range searched.
    pub at_bound: bool,
}

/// How well the table is met.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TableFit {
    /// Rows with an amplitude that took part.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rows: usize,
    /// Sum of squared residuals, in units of their scatter; beyond 3 by their size.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub objective: f64,
    /// Root mean square of ln(simulated/measured).
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rms_log: f64,
    /// Median of its size.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub median_log: f64,
    /// Largest of it.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub worst_log: f64,
    /// Row of the largest, counted from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub worst_row: Option<usize>,
}

/// A row of the table and what is predicted of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct IdentifiedRow {
    /// Row of the table, counted from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub row: usize,
    /// Number of teeth.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub teeth: u32,
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: f64,
    /// Feed per tooth.
    #[schema(extensions(("x-unit" = json!("mm/tooth"))))]
    pub feed_mm_per_tooth: f64,
    /// Axial depth of cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: f64,
    /// Amplitude measured.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub measured_um: Option<f64>,
    /// Joint that was seen to open.
    pub opened: Option<OpenedJoint>,
    /// Whether the row took part.
    pub used: bool,
    /// Amplitude predicted.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub simulated_um: f64,
    /// Change of it with half the step: its numerical error, 0 where it is exact. A large one says that the run has two
    /// motions to choose from.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub simulated_error_um: f64,
    /// Predicted over measured.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub ratio: Option<f64>,
    /// ln of the ratio over its scatter.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub residual: Option<f64>,
    /// Modulus of the multiplier: the cut chatters from 1 on.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus: f64,
    /// Clamp force that the joint at the movable jaw asks for (elastic part).
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_movable_n: f64,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_fixed_n: f64,
}

/// Onset of chatter of one cutter, speed and feed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OnsetFit {
    /// Number of teeth.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub teeth: u32,
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: f64,
    /// Feed per tooth.
    #[schema(extensions(("x-unit" = json!("mm/tooth"))))]
    pub feed_mm_per_tooth: f64,
    /// Deepest cut of the table without a jump of the amplitude.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub table_stable_mm: Option<f64>,
    /// First cut after the jump.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub table_chatter_mm: Option<f64>,
    /// Limit predicted; null where there is none up to twice the deepest row.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub predicted_mm: Option<f64>,
    /// Whether it lies between both.
    pub within: bool,
}

/// What rows with open and with closed joints say of the clamp force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampBounds {
    /// Rows in which no joint opened ask for at least so much.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub least_n: f64,
    /// Rows in which one opened allow at most so much; null where none opened.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub most_n: Option<f64>,
    /// Whether one clamp force serves all rows.
    pub consistent: bool,
    /// The force that contradicts the fewest rows: the middle of the range where there is one.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub best_n: f64,
    /// Rows that it contradicts, counted from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub contradicted_rows: Vec<usize>,
    /// Rows that the stated clamp force contradicts; null where none is stated.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub contradicted_by_stated: Option<Vec<usize>>,
}

/// One law with its own best parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct HypothesisFit {
    /// Law of regeneration.
    pub regeneration: Regeneration,
    /// Meaning of the amplitude.
    pub amplitude: AmplitudeMeaning,
    /// How well the table is met.
    pub fit: TableFit,
    /// How much worse than the best; from 6 on the table decides (odds of 20 to 1).
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub worse_by: f64,
    /// Values of the parameters, in the order of `parameters`.
    #[schema(extensions(("x-unit" = json!("as parameters say"))))]
    pub values: Vec<f64>,
    /// Amplitudes predicted, in the order of the table.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub simulated_um: Vec<f64>,
}

/// Two parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ParameterPair {
    /// One.
    pub first: String,
    /// The other.
    pub second: String,
    /// Correlation of their errors.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub correlation: f64,
}

/// A combination of parameters: the product of their powers (of shares and exponents the sum).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Combination {
    /// Standard deviation of its logarithm; null where the table does not see it at all.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub standard_deviation: Option<f64>,
    /// Powers, in the order of `parameters`; their squares add to 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub powers: Vec<f64>,
}
