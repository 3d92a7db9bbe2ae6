//! What comes out of a study.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::input::{Combine, Spacing};

/// The result of a parameter study: one row per point, and where the outputs are least and largest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct StudyResult {
    /// Whose job was varied.
    pub(crate) calculator: String,
    /// Version of that calculator.
    #[schema(minimum = 0, example = 1, extensions(("x-unit" = json!("1"))))]
    pub(crate) calculator_version: u32,
    /// How many points there are.
    #[schema(minimum = 1, example = 25, extensions(("x-unit" = json!("1"))))]
    pub(crate) points: usize,
    /// How many of them have an answer.
    #[schema(minimum = 0, example = 24, extensions(("x-unit" = json!("1"))))]
    pub(crate) succeeded: usize,
    /// How many have none.
    #[schema(minimum = 0, example = 1, extensions(("x-unit" = json!("1"))))]
    pub(crate) failed: usize,
    /// How the values were put together.
    pub(crate) combine: Combine,
    /// What was varied, in the order of `values` in a row.
    pub(crate) variables: Vec<VariedField>,
    /// What was read off, in the order of `outputs` in a row.
    pub(crate) outputs: Vec<OutputField>,
    /// Why points have no answer, most frequent first.
    pub(crate) failures: Vec<FailureCount>,
    /// One row per point; the last variable changes fastest.
    pub(crate) rows: Vec<Row>,
}

/// A field that was varied.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = StudyVariedField)]
pub(crate) struct VariedField {
    /// JSON Pointer into the job.
    #[schema(example = "/cut/feed_mm_per_rev")]
    pub(crate) pointer: String,
    /// Its unit; absent for words and truth values.
    #[schema(example = "mm/rev")]
    pub(crate) unit: Option<String>,
    /// How the values of its range are spaced; absent for a list.
    pub(crate) spacing: Option<Spacing>,
    /// Its values, in the order of the rows.
    pub(crate) values: Vec<Setting>,
}

/// A value of a varied field: a number, a word, or true or false.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum Setting {
    /// A number in the field's unit.
    Number(f64),
    /// true or false.
    Truth(bool),
    /// A word.
    Word(String),
}

/// A number of the result that was read off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = StudyOutputField)]
pub(crate) struct OutputField {
    /// JSON Pointer into the result.
    #[schema(example = "/form_error_um")]
    pub(crate) pointer: String,
    /// Its unit.
    #[schema(example = "um")]
    pub(crate) unit: Option<String>,
    /// Where it is least; null where no point has it.
    pub(crate) least: Option<Extreme>,
    /// Where it is largest; null where no point has it.
    pub(crate) largest: Option<Extreme>,
}

/// Where an output is least or largest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = StudyExtreme)]
pub(crate) struct Extreme {
    /// The output there, in its unit.
    #[schema(example = 3.1, extensions(("x-unit" = json!("the output's"))))]
    pub(crate) value: f64,
    /// Number of the row, from 0; the first of equals.
    #[schema(minimum = 0, example = 7, extensions(("x-unit" = json!("1"))))]
    pub(crate) row: usize,
    /// What the variables are there.
    pub(crate) at: Vec<Setting>,
    /// Pointers of the variables that stand there at an end of their values: beyond it may lie more.
    pub(crate) at_end_of: Vec<String>,
}

/// How many points have no answer for one reason.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = StudyFailureCount)]
pub(crate) struct FailureCount {
    /// What kind of reason it is.
    pub(crate) status: Status,
    /// The reason: the code of a problem or of the first fault.
    #[schema(example = "steady_outside_shaft")]
    pub(crate) code: String,
    /// How many points.
    #[schema(minimum = 1, example = 2, extensions(("x-unit" = json!("1"))))]
    pub(crate) points: usize,
    /// Number of the first row of them, from 0.
    #[schema(minimum = 0, example = 20, extensions(("x-unit" = json!("1"))))]
    pub(crate) first_row: usize,
}

/// One point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = StudyRow)]
pub(crate) struct Row {
    /// What the variables are, in the order of `variables`.
    pub(crate) values: Vec<Setting>,
    /// Whether the point has an answer, or why not.
    pub(crate) status: Status,
    /// Why not: the code of a problem or of the first fault; null where there is an answer.
    pub(crate) code: Option<String>,
    /// The same in a sentence.
    pub(crate) detail: Option<String>,
    /// What the sentence says: `pointer`, `value`, `limit`, `unit` and further `values`; only where there is no answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub(crate) detail_values: Option<serde_json::Value>,
    /// The outputs, in the order of `outputs`; null where the answer has none.
    #[schema(schema_with = numbers)]
    pub(crate) outputs: Vec<Option<f64>>,
    /// Address of the point's own answer: `GET /v1/results/{key}`; null where its job breaks rules.
    pub(crate) key: Option<String>,
}

/// Whether a point has an answer, or what kind of reason there is for none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = StudyStatus)]
pub(crate) enum Status {
    /// It has an answer.
    Succeeded,
    /// Its job breaks rules.
    Invalid,
    /// Its job has no solution.
    Infeasible,
    /// The physics of the model does not cover its job.
    OutOfModel,
    /// An iteration did not reach its tolerance.
    NotConverged,
    /// A fault of ours.
    Failed,
}

impl Status {
    /// As in the contract.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Succeeded => "succeeded",
            Self::Invalid => "invalid",
            Self::Infeasible => "infeasible",
            Self::OutOfModel => "out_of_model",
            Self::NotConverged => "not_converged",
            Self::Failed => "failed",
        }
    }
}

impl Setting {
    /// A value of a job; `None` for what is neither number, word nor truth value.
    pub(crate) fn of(value: &serde_json::Value) -> Option<Self> {
        use serde_json::Value;
        match value {
            Value::Number(number) => number.as_f64().map(Self::Number),
            Value::Bool(truth) => Some(Self::Truth(*truth)),
            Value::String(word) => Some(Self::Word(word.clone())),
            Value::Null | Value::Array(_) | Value::Object(_) => None,
        }
    }

    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Truth(_) | Self::Word(_) => None,
        }
    }
}

impl utoipa::PartialSchema for Setting {
    fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::Schema> {
        super::input::scalar().into()
    }
}

impl ToSchema for Setting {
    fn name() -> std::borrow::Cow<'static, str> {
        "StudySetting".into()
    }
}

impl std::fmt::Display for Setting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => f.write_str(&crate::text::significant(*number, 6)),
            Self::Truth(truth) => write!(f, "{truth}"),
            Self::Word(word) => f.write_str(word),
        }
    }
}

fn numbers() -> utoipa::openapi::Array {
    use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, SchemaType, Type};
    let number = ObjectBuilder::new()
        .schema_type(SchemaType::from_iter([Type::Number, Type::Null]))
        .description(Some("A number in the output's unit."))
        .extensions(Some([("x-unit", serde_json::json!("the output's"))].into_iter().collect()));
    ArrayBuilder::new()
        .items(number)
        .description(Some("The outputs, in the order of `outputs`; null where the answer has none."))
        .build()
}
