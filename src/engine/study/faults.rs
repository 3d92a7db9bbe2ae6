//! The faults of a study, each with what would be right.

use precut_calc::calculator::Finding;
use serde_json::Value;

use super::place::{Field, Lost};
use crate::registry::{Registry, nearest};

/// Codes of the faults that only a study has.
pub(crate) const FAULTS: &[&str] = &[
    "bad_pointer",
    "repeated_output",
    "duplicate_value",
    "duplicate_variable",
    "empty_range",
    "log_not_positive",
    "model_not_variable",
    "no_outputs",
    "no_such_field",
    "no_such_item",
    "no_values",
    "not_a_number",
    "not_variable",
    "range_not_whole",
    "range_of_words",
    "range_too_fine",
    "too_many_points",
    "unequal_lengths",
    "unknown_study_calculator",
    "values_and_range",
];

pub(super) fn unknown_calculator(registry: &Registry, name: &str) -> Finding {
    let finding = Finding::new("unknown_study_calculator", "/calculator").with("received", name.to_owned());
    match registry.nearest(name) {
        Some(nearest) => finding.with("nearest", nearest),
        None => finding.with("allowed", registry.entries().iter().map(|entry| entry.meta().id).collect::<Vec<_>>()),
    }
}

/// A fault of the job, seen from the study.
pub(super) fn in_job(mut finding: Finding) -> Finding {
    finding.pointer = format!("/job{}", finding.pointer);
    finding
}

pub(super) fn bad_pointer(place: String, received: &str) -> Finding {
    Finding::new("bad_pointer", place).with("received", received.to_owned())
}

pub(super) fn lost(place: String, received: &str, lost: Lost) -> Finding {
    match lost {
        Lost::NoItem { index, at, length } => Finding::new("no_such_item", place)
            .with("received", received.to_owned())
            .with("index", index)
            .with("at", at)
            .with("length", length),
        Lost::NoField { name, at, known } => {
            let finding = Finding::new("no_such_field", place)
                .with("received", received.to_owned())
                .with("name", name.clone())
                .with("at", at);
            match nearest(&name, known.iter().map(String::as_str)) {
                Some(nearest) => finding.with("nearest", nearest.to_owned()),
                None => finding.with("allowed", known.clone()),
            }
        }
    }
}

pub(super) fn wrong_type(place: String, received: &Value, field: &Field) -> Finding {
    let kind = match received {
        Value::Bool(_) => "boolean",
        Value::Number(_) => "number",
        Value::String(_) => "string",
        Value::Null => "null",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let quoted = received.as_str().is_some_and(|text| text.trim().replace(',', ".").parse::<f64>().is_ok());
    let finding = Finding::new("wrong_type", place).with("expected", field.types()).with("received_type", kind);
    if quoted && field.is_number() { finding.with("quoted_number", "yes") } else { finding }
}

pub(super) fn not_one_of(place: String, received: &str, options: &[String]) -> Finding {
    let finding =
        Finding::new("not_one_of", place).with("received", received.to_owned()).with("allowed", options.to_vec());
    match nearest(received, options.iter().map(String::as_str)) {
        Some(nearest) => finding.with("nearest", nearest.to_owned()),
        None => finding,
    }
}
