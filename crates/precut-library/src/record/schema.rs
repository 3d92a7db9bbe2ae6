//! The schema of a kind of records, from the declarations of its fields.

use serde_json::{Map, Value, json};

use super::field::{DETERMINED_BY, HOLDS_FOR};
use super::view::CERTAINTIES;
use super::{Field, Form, Kind, Quantity};

/// Most names that a user may choose in one field.
const MOST_NAMED: usize = 50;
/// Most texts in a list.
const MOST_TEXTS: usize = 50;
/// Letters of a name.
const NAME: &str = "^[a-z0-9][a-z0-9_-]{0,63}$";

/// JSON Schema (2020-12) of a settled record, without references: every object closed, every number with its unit.
pub fn schema(kind: Kind) -> Value {
    object(kind.fields(), false)
}

fn object(fields: &[Field], sourced: bool) -> Value {
    let mut properties = Map::new();
    for field in fields {
        let mut value = form(&field.form);
        value["description"] = field.about.into();
        properties.insert(field.name.to_owned(), value);
    }
    let mut required: Vec<&str> = fields.iter().filter(|field| field.required).map(|field| field.name).collect();
    if sourced {
        properties.insert("source".to_owned(), source());
        properties.insert("certainty".to_owned(), certainty());
        required.extend(["source", "certainty"]);
    }
    json!({"type": "object", "additionalProperties": false, "required": required, "properties": properties})
}

fn form(form: &Form) -> Value {
    match form {
        Form::Number(quantity) => sourced(&plain(quantity), Some(quantity)),
        Form::Plain(quantity) => plain(quantity),
        Form::Word(words) => json!({"type": "string", "enum": words, "example": words.first()}),
        Form::SourcedWord([]) => sourced(&json!({"type": "string", "maxLength": 64, "example": "P25"}), None),
        Form::SourcedWord(words) => sourced(&json!({"type": "string", "enum": words, "example": words.first()}), None),
        Form::Text(most) => json!({"type": "string", "maxLength": most}),
        Form::Texts(each) => {
            json!({"type": "array", "maxItems": MOST_TEXTS, "items": {"type": "string", "minLength": 1, "maxLength": each}})
        }
        Form::Group(fields) => object(fields, false),
        Form::Rows(fields, most) => json!({"type": "array", "maxItems": most, "items": object(fields, true)}),
        Form::List(fields, most) => json!({"type": "array", "maxItems": most, "items": object(fields, false)}),
        Form::Named(quantity) => named(&sourced(&plain(quantity), Some(quantity))),
        Form::NamedTexts => named(&json!({"type": "string", "maxLength": 80})),
        Form::Model => json!({"type": "object"}),
        Form::OfJob => json!({"type": ["object", "array"]}),
    }
}

fn named(each: &Value) -> Value {
    json!({
        "type": "object", "maxProperties": MOST_NAMED, "propertyNames": {"pattern": NAME}, "additionalProperties": each,
    })
}

fn plain(quantity: &Quantity) -> Value {
    json!({
        "type": if quantity.whole { "integer" } else { "number" },
        "minimum": quantity.least, "maximum": quantity.largest, "example": quantity.example,
        "x-unit": quantity.unit, "x-symbol": quantity.symbol,
    })
}

/// A number, or a word, with where it comes from.
fn sourced(value: &Value, quantity: Option<&Quantity>) -> Value {
    let mut properties = Map::new();
    let mut value = value.clone();
    value["description"] = "The value, in the unit that the field's name says.".into();
    properties.insert("value".to_owned(), value);
    properties.insert("source".to_owned(), source());
    properties.insert("certainty".to_owned(), certainty());
    if let Some(quantity) = quantity {
        for (name, about) in [("low", "Least likely value."), ("high", "Largest likely value.")] {
            let mut end = plain(quantity);
            end["description"] = about.into();
            properties.insert(name.to_owned(), end);
        }
        properties.insert(
            "relative_standard_uncertainty_percent".to_owned(),
            json!({"type": "number", "minimum": 0.0, "maximum": 1000.0, "example": 50.0, "x-unit": "percent",
                "x-symbol": "u", "description": "Relative standard uncertainty."}),
        );
    }
    let word = |words: &[&str], about: &str| json!({"type": "string", "enum": words, "description": about});
    properties.insert("holds_for".to_owned(), word(HOLDS_FOR, "For what it was stated."));
    properties.insert("determined_by".to_owned(), word(DETERMINED_BY, "How it was found."));
    properties.insert(
        "note".to_owned(),
        json!({"type": "string", "maxLength": 1000, "description": "What is to be known of it."}),
    );
    json!({
        "type": "object", "additionalProperties": false, "required": ["value", "source", "certainty"],
        "properties": properties,
    })
}

fn source() -> Value {
    json!({"type": "string", "maxLength": 500, "example": "user", "description": "Where it comes from."})
}

fn certainty() -> Value {
    json!({"type": "string", "enum": CERTAINTIES, "example": "user", "description": "How certain it is, from the best to the worst word."})
}
