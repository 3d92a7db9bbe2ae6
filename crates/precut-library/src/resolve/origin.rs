//! Where a number of a filled job comes from.

use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use crate::built_in;
use crate::record::Number;

/// Who said a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = OriginGiver)]
pub enum From {
    /// The job itself.
    Job,
    /// The record of its tool.
    Tool,
    /// The record of its machine.
    Machine,
    /// The record of its material.
    Material,
}

/// A number or a word of the filled job in which a record had a say.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[schema(as = NumberOrigin)]
pub struct Origin {
    /// Where it stands in the filled job.
    #[schema(example = "/carriage/compliance_um_per_n")]
    pub pointer: String,
    /// What stands there.
    #[schema(value_type = Value, example = 0.1008)]
    pub value: Value,
    /// What it is made of; the values of springs in one chain add, of limits the tightest counts.
    pub parts: Vec<Part>,
}

/// What one record, or the job, contributes.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[schema(as = OriginPart)]
pub struct Part {
    /// Who says it.
    pub from: From,
    /// Where it stands in the record.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "/compliance/carriage_um_per_n")]
    pub path: Option<String>,
    /// The equation by which it follows from the record, by its number in the documentation.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "library/4")]
    pub equation: Option<&'static str>,
    /// What is contributed, in the unit of the field.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Value, required = false, example = 0.018)]
    pub value: Option<Value>,
    /// Its relative standard uncertainty.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 50.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("u"))))]
    pub relative_standard_uncertainty_percent: Option<f64>,
    /// How certain it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "judgement")]
    pub certainty: Option<String>,
    /// Title, publisher, year and place of its source.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "Roehm norm RN 1391, table 2")]
    pub source: Option<String>,
    /// Where the source can be read.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "https://example.org/table.pdf")]
    pub address: Option<String>,
}

impl Part {
    /// What somebody says without more.
    pub(super) fn new(from: From) -> Self {
        Self {
            from,
            path: None,
            equation: None,
            value: None,
            relative_standard_uncertainty_percent: None,
            certainty: None,
            source: None,
            address: None,
        }
    }

    /// A number of a record.
    pub(super) fn of(from: From, path: &str, number: &Number<'_>) -> Self {
        Self {
            path: Some(path.to_owned()),
            value: Some(number.value.into()),
            relative_standard_uncertainty_percent: number.relative_standard_uncertainty_percent,
            ..Self::sourced(from, number.source, number.certainty)
        }
    }

    /// What comes of a source.
    pub(super) fn sourced(from: From, source: &str, certainty: &str) -> Self {
        let known = built_in::source(source);
        let said = known.map_or_else(|| source.to_owned(), built_in::Source::text);
        Self {
            certainty: (!certainty.is_empty()).then(|| certainty.to_owned()),
            source: (!said.is_empty()).then_some(said),
            address: known.and_then(|source| source.address.clone()),
            ..Self::new(from)
        }
    }

    /// The same by an equation.
    pub(super) fn by(self, equation: &'static str) -> Self {
        Self { equation: Some(equation), ..self }
    }

    /// The same from a place in the record.
    pub(super) fn at(self, path: impl Into<String>) -> Self {
        Self { path: Some(path.into()), ..self }
    }

    /// The same with another contribution.
    pub(super) fn worth(self, value: impl Into<Value>) -> Self {
        Self { value: Some(value.into()), ..self }
    }
}
