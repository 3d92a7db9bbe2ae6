//! A study as it is posted.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{Array, Object};

/// Most variables of a study, as its schema has them.
pub(crate) const MOST_VARIABLES: usize = 3;
/// Most outputs of a study.
pub(crate) const MOST_OUTPUTS: usize = 16;

/// A parameter study: the job of one calculator, computed again and again while one to three of its fields are varied.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct StudyInput {
    /// Whose job it is: any calculator or evaluation; `GET /v1/calculators` lists them.
    #[schema(max_length = 100, example = "deflection-compensation")]
    pub(crate) calculator: String,
    /// The job, as it would be posted on its own; a field that is varied may be left out.
    #[schema(value_type = Object)]
    pub(crate) job: Map<String, Value>,
    /// What is varied, one to three fields; the first changes slowest.
    #[schema(min_items = 1, max_items = 3)]
    pub(crate) vary: Vec<Variable>,
    /// How the values of several variables are put together.
    #[serde(default)]
    pub(crate) combine: Combine,
    /// JSON Pointers to numbers of the calculator's result (`/form_error_um`); those that its description names
    /// (`study_outputs`) if none are given.
    #[serde(default)]
    #[schema(schema_with = pointers)]
    pub(crate) outputs: Vec<String>,
    /// The records that its points name, as they were when it was accepted. Nobody may send it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(ignore)]
    pub(crate) records: Option<Value>,
}

/// A field of the job and the values that it takes: `values`, or `from`, `to` and `count`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = StudyVariable)]
pub(crate) struct Variable {
    /// JSON Pointer into the job, to a number, a truth value or a word.
    #[schema(max_length = 400, example = "/cut/feed_mm_per_rev")]
    pub(crate) pointer: String,
    /// The values, in the order of the rows: numbers in the field's unit, words, or truth values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = settings)]
    pub(crate) values: Option<Vec<Value>>,
    /// First value of a range, in the field's unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.1, extensions(("x-unit" = json!("the field's")), ("x-symbol" = json!("a"))))]
    pub(crate) from: Option<f64>,
    /// Last value of the range, in the field's unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.5, extensions(("x-unit" = json!("the field's")), ("x-symbol" = json!("b"))))]
    pub(crate) to: Option<f64>,
    /// How many values the range has, both ends among them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 2, maximum = 9_007_199_254_740_992_u64, example = 5,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
    pub(crate) count: Option<u64>,
    /// How the values of the range are spaced; `linear` if it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) spacing: Option<Spacing>,
}

impl Variable {
    /// The first of its values, if it says so.
    pub(crate) fn first(&self) -> Option<Value> {
        let given = self.values.as_ref().and_then(|values| values.first().cloned());
        given.or_else(|| self.from.map(super::expand::number))
    }
}

/// How the values of a range are spaced.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = StudySpacing)]
pub(crate) enum Spacing {
    /// Equal steps.
    #[default]
    Linear,
    /// Equal ratios.
    Log,
}

/// How the values of several variables are put together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = StudyCombine)]
pub(crate) enum Combine {
    /// Every value with every other: the counts multiply.
    #[default]
    Grid,
    /// The first with the first, the second with the second: all variables have as many values.
    Zip,
}

fn pointers() -> Array {
    let pointer = ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::String))
        .max_length(Some(400))
        .examples([serde_json::json!("/form_error_um")]);
    ArrayBuilder::new()
        .items(pointer)
        .max_items(Some(MOST_OUTPUTS))
        .description(Some(
            "JSON Pointers to numbers of the calculator's result; those that its description names (`study_outputs`) \
             if none are given.",
        ))
        .build()
}

/// Most values that are listed one by one; a range may have more.
const MOST_VALUES: usize = 100_000;

fn settings() -> Array {
    ArrayBuilder::new()
        .items(scalar())
        .min_items(Some(1))
        .max_items(Some(MOST_VALUES))
        .description(Some("The values, in the order of the rows: numbers in the field's unit, words, or truth values."))
        .build()
}

pub(super) fn scalar() -> Object {
    let types = SchemaType::from_iter([Type::Number, Type::String, Type::Boolean]);
    ObjectBuilder::new()
        .schema_type(types)
        .description(Some("A number, a word or a truth value."))
        .examples([serde_json::json!(0.2)])
        .extensions(Some([("x-unit", serde_json::json!("the field's"))].into_iter().collect()))
        .build()
}
