//! Reading records.

use serde_json::Value;

use super::{Field, Form, Kind};

/// How certain a number is, from the best to the worst.
pub(super) const CERTAINTIES: &[&str] = &[
    "measured",
    "confirmed",
    "published_table",
    "likely",
    "user",
    "to_be_checked",
    "textbook_unverified",
    "judgement",
];

/// A number of a record with where it comes from, in the unit that the field's name says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number<'a> {
    /// The number.
    pub value: f64,
    /// Key of a source, or the text of an own one.
    pub source: &'a str,
    /// How certain it is.
    pub certainty: &'a str,
    /// Relative standard uncertainty, percent.
    pub relative_standard_uncertainty_percent: Option<f64>,
}

impl<'a> Number<'a> {
    /// The number that an object of a record is.
    pub fn of(value: &'a Value) -> Option<Self> {
        Some(Self {
            value: value.get("value")?.as_f64()?,
            source: value.get("source").and_then(Value::as_str).unwrap_or_default(),
            certainty: value.get("certainty").and_then(Value::as_str).unwrap_or_default(),
            relative_standard_uncertainty_percent: value
                .get("relative_standard_uncertainty_percent")
                .and_then(Value::as_f64),
        })
    }
}

/// The names of a JSON Pointer's parts, without its escapes.
pub fn pointer_parts(pointer: &str) -> impl Iterator<Item = String> {
    pointer.split('/').skip(1).map(|part| part.replace("~1", "/").replace("~0", "~"))
}

/// Every field of a record that holds an object with source and certainty, or a row of them, with its pointer.
pub fn numbers(kind: Kind, record: &Value) -> Vec<(String, &Value)> {
    let mut found = Vec::new();
    walk(kind.fields(), record, "", &mut found);
    found
}

fn walk<'a>(fields: &[Field], value: &'a Value, pointer: &str, found: &mut Vec<(String, &'a Value)>) {
    for field in fields {
        let Some(there) = value.get(field.name) else { continue };
        let at = format!("{pointer}/{}", field.name);
        match field.form {
            Form::Number(_) | Form::SourcedWord(_) => found.push((at, there)),
            Form::Group(inner) => walk(inner, there, &at, found),
            Form::Rows(..) => {
                let rows = there.as_array().into_iter().flatten().enumerate();
                found.extend(rows.map(|(index, row)| (format!("{at}/{index}"), row)));
            }
            Form::Named(_) => {
                let named = there.as_object().into_iter().flatten();
                found
                    .extend(named.map(|(name, number)| {
                        (format!("{at}/{}", name.replace('~', "~0").replace('/', "~1")), number)
                    }));
            }
            _ => {}
        }
    }
}
