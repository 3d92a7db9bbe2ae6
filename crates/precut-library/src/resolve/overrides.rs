//! What a job says over the fields of a record.

use precut_calc::calculator::Finding;
use serde_json::{Map, Value};

use super::writer::Writer;
use crate::record::{self, Field, Form, ISO_13399, Kind};
use crate::search::nearest;

/// Whether a record of the kind has such a field.
pub(super) fn is_field(kind: Kind, name: &str) -> bool {
    let alias = kind == Kind::Tool && (name == "overhang_mm" || ISO_13399.iter().any(|(symbol, _)| *symbol == name));
    alias || kind.fields().iter().any(|field| field.name == name)
}

/// The fields in the form of a record; what is no such field, or out of its range, is a fault.
pub(super) fn settle(kind: Kind, mut said: Map<String, Value>, writer: &mut Writer<'_>) -> Value {
    if kind == Kind::Tool
        && let Some(overhang) = said.shift_remove("overhang_mm")
        && let Some(bar) = said.entry("bar").or_insert_with(|| Value::Object(Map::new())).as_object_mut()
    {
        bar.insert("overhang_mm".to_owned(), overhang);
    }
    let mut value = Value::Object(said);
    record::settle(kind, &mut value);
    let pointer = format!("/{}", kind.name());
    if let Value::Object(fields) = &mut value {
        check(kind.fields(), fields, &pointer, writer);
    }
    value
}

/// Faults of the fields; what is faulty is taken out.
fn check(declared: &[Field], fields: &mut Map<String, Value>, pointer: &str, writer: &mut Writer<'_>) {
    fields.retain(|name, value| {
        let at = format!("{pointer}/{name}");
        let Some(field) = declared.iter().find(|field| field.name == name) else {
            let known: Vec<&str> = declared.iter().map(|field| field.name).collect();
            let finding = Finding::new("unknown_field", at);
            writer.fault(match nearest(name, known.iter().copied()).into_iter().next() {
                Some(nearest) => finding.with("nearest", nearest),
                None => finding.with("allowed", known),
            });
            return false;
        };
        let fault = match (&field.form, &mut *value) {
            (Form::Number(quantity), Value::Object(number)) => match number.get("value").and_then(Value::as_f64) {
                Some(value) if (quantity.least..=quantity.largest).contains(&value) => None,
                Some(value) => {
                    let limit = if value < quantity.least { quantity.least } else { quantity.largest };
                    Some(
                        Finding::new("out_of_range", at)
                            .measured(value, limit, quantity.unit)
                            .within(quantity.least, quantity.largest),
                    )
                }
                None => Some(wrong_type(at, "number")),
            },
            (Form::Group(inner), Value::Object(part)) => {
                check(inner, part, &at, writer);
                None
            }
            (Form::Text(_) | Form::Word(_), Value::String(_))
            | (Form::Rows(..) | Form::List(..) | Form::Texts(_), Value::Array(_))
            | (Form::SourcedWord(_) | Form::Named(_) | Form::NamedTexts | Form::Model, Value::Object(_)) => None,
            (Form::Text(_) | Form::Word(_) | Form::SourcedWord(_), _) => Some(wrong_type(at, "string")),
            (Form::Rows(..) | Form::List(..) | Form::Texts(_), _) => Some(wrong_type(at, "array")),
            (Form::Number(_) | Form::Plain(_), _) => Some(wrong_type(at, "number")),
            _ => Some(wrong_type(at, "object")),
        };
        let holds = fault.is_none();
        if let Some(fault) = fault {
            writer.fault(fault);
        }
        holds
    });
}

fn wrong_type(at: String, expected: &'static str) -> Finding {
    Finding::new("wrong_type", at).with("expected", vec![expected])
}
