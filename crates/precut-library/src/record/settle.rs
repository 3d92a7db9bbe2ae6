//! What short and foreign spellings stand for.

use serde_json::{Map, Value, json};

use super::{Field, Form, ISO_13399, Kind};

/// Writes a record out: bare numbers become `{value, source: "user", certainty: "user"}`, names of ISO 13399 ours, and
/// rows get what they leave out. What has the wrong shape stays for the schema to refuse.
pub fn settle(kind: Kind, record: &mut Value) {
    let Some(fields) = record.as_object_mut() else { return };
    if kind == Kind::Tool {
        for (symbol, name) in ISO_13399 {
            if !fields.contains_key(*name)
                && let Some(value) = fields.remove(*symbol)
            {
                fields.insert((*name).to_owned(), value);
            }
        }
    }
    settle_fields(kind.fields(), fields);
    if kind == Kind::Material {
        settle_kienzle(fields);
    }
}

/// Members of a number beside its value.
const OF_NUMBERS: &[&str] = &[
    "value",
    "source",
    "certainty",
    "low",
    "high",
    "relative_standard_uncertainty_percent",
    "holds_for",
    "determined_by",
    "note",
];

fn settle_fields(declared: &[Field], there: &mut Map<String, Value>) {
    // Null is as if it were absent, where there is such a field; another one stays for the schema to refuse.
    let is_known =
        |name: &String| OF_NUMBERS.contains(&name.as_str()) || declared.iter().any(|field| field.name == name);
    there.retain(|name, value| !value.is_null() || !is_known(name));
    for field in declared {
        let Some(value) = there.get_mut(field.name) else { continue };
        match field.form {
            Form::Number(_) | Form::SourcedWord(_) => settle_sourced(value),
            Form::Named(_) => {
                value.as_object_mut().into_iter().flatten().for_each(|(_, number)| settle_sourced(number));
            }
            Form::Group(inner) => {
                if let Some(part) = value.as_object_mut() {
                    settle_fields(inner, part);
                }
            }
            Form::Rows(inner, _) | Form::List(inner, _) => {
                for row in value.as_array_mut().into_iter().flatten().filter_map(Value::as_object_mut) {
                    settle_fields(inner, row);
                    if matches!(field.form, Form::Rows(..)) {
                        settle_origin(row);
                    }
                }
            }
            _ => {}
        }
    }
}

fn settle_sourced(value: &mut Value) {
    match value {
        Value::Number(_) | Value::String(_) => {
            *value = json!({"value": value.take(), "source": "user", "certainty": "user"});
        }
        Value::Object(fields) => {
            fields.retain(|name, value| !value.is_null() || !OF_NUMBERS.contains(&name.as_str()));
            settle_origin(fields);
        }
        _ => {}
    }
}

fn settle_origin(fields: &mut Map<String, Value>) {
    for name in ["source", "certainty"] {
        fields.entry(name).or_insert_with(|| "user".into());
    }
}

/// Rows of Kienzle's law that do not say it hold for the material, are a family of their own, and the first complete
/// one is preferred where none is.
fn settle_kienzle(fields: &mut Map<String, Value>) {
    let Some(rows) = fields.get_mut("kienzle").and_then(Value::as_array_mut) else { return };
    let preferred = |row: &Value| row.get("use").is_some_and(|word| word == "preferred");
    let mut has_preferred = rows.iter().any(preferred);
    for row in rows.iter_mut().filter_map(Value::as_object_mut) {
        row.entry("holds_for").or_insert_with(|| "material".into());
        let complete = row.contains_key("cutting_exponent");
        let word = match (complete, has_preferred) {
            (false, _) => "incomplete",
            (true, true) => "alternative",
            (true, false) => "preferred",
        };
        has_preferred |= complete && !row.contains_key("use");
        row.entry("use").or_insert_with(|| word.into());
        if complete {
            let family = row.get("source").cloned().unwrap_or_default();
            row.entry("family").or_insert(family);
        }
    }
}
