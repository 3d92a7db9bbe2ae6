//! Sentences as they stand in documents, with their codes and numbers.

use precut_calc::calculator::Values;
use serde::Serialize;
use utoipa::ToSchema;

/// Something wrong with a job, or a warning, in words.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Notice {
    /// JSON Pointer to the field; empty for the whole job.
    #[schema(example = "/shaft/segments/0/diameter_mm")]
    pub pointer: String,
    /// Stable code, `snake_case`.
    #[schema(value_type = String, example = "out_of_range")]
    pub code: &'static str,
    /// What it means, in the language asked for.
    pub detail: String,
    /// The value received or reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// The limit that it passed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
    /// Unit of both.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>, example = "mm")]
    pub unit: Option<&'static str>,
    /// What else the sentence says: `minimum`, `maximum` (or `above`, `below`), `allowed`, `nearest`, `received`,
    /// `looks_like` ...
    #[serde(skip_serializing_if = "Values::is_empty")]
    #[schema(value_type = Object)]
    pub values: Values,
}

/// A sentence of an answer's explanation.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Remark {
    /// Stable code, `snake_case`.
    #[schema(value_type = String, example = "work_dominates")]
    pub code: &'static str,
    /// What it means.
    pub text: String,
    /// Its numbers by name.
    #[schema(value_type = Object)]
    pub values: Values,
}
