//! The contract of one question that is asked of several calculators: which one, stands in the job.

use serde::Deserialize;
use serde_json::{Value, json};

use super::schema::Components;

/// The field that tells the members of a family apart.
pub(super) const CALCULATOR: &str = "calculator";

/// What is read of a kept job to know whose it is.
#[derive(Deserialize)]
pub(super) struct Named {
    pub(super) calculator: String,
}

/// The field `calculator` of a job takes this name only.
pub(super) fn name_calculator(job: &mut Value, calculator: &str) {
    job["properties"][CALCULATOR]["enum"] = json!([calculator]);
    job["properties"][CALCULATOR]["example"] = json!(calculator);
}

/// Lets a job name a stored model.
pub(super) fn offer_model(job: &mut Value) {
    job["properties"]["model"] = json!({
        "type": ["string", "null"],
        "pattern": "^[a-z0-9][a-z0-9_-]{0,63}(@[1-9][0-9]{0,8})?$",
        "description": "A stored model of this calculator, `name` or `name@revision`: its effects act beside those of the job. Null turns off that of the machine.",
        "examples": ["lathe-7-winter"],
        "x-group": "effects",
    });
}

/// Name of a calculator's own type in the contract: `deflection-compensation` gives `DeflectionCompensation...`.
pub(super) fn type_name(calculator: &str, suffix: &str) -> String {
    let capital = |word: &str| {
        let mut letters = word.chars();
        letters.next().map(|first| first.to_ascii_uppercase()).into_iter().chain(letters).collect::<String>()
    };
    calculator.split('-').map(capital).chain([suffix.to_owned()]).collect()
}

/// What a job is held against that names none of these calculators: the tag of a tagged union.
pub(super) fn told_apart(calculators: impl Iterator<Item = &'static str>) -> Value {
    let names: Vec<&str> = calculators.collect();
    json!({
        "type": "object",
        "x-tag": CALCULATOR,
        "required": [CALCULATOR],
        "properties": { CALCULATOR: { "type": "string", "enum": names } },
    })
}

/// The schema that takes one of the named components; with the discriminator where their jobs name a calculator.
pub(super) fn one_of(names: &[String], components: &Components, told_apart: bool) -> Value {
    let place = |name: &str| format!("#/components/schemas/{name}");
    let forms: Vec<Value> = names.iter().map(|name| json!({ "$ref": place(name) })).collect();
    let mut schema = json!({ "oneOf": forms });
    if told_apart {
        let word = |name: &String| components[name]["properties"][CALCULATOR]["enum"][0].as_str().unwrap_or_default();
        let mapping: serde_json::Map<String, Value> =
            names.iter().map(|name| (word(name).to_owned(), place(name).into())).collect();
        schema["discriminator"] = json!({ "propertyName": CALCULATOR, "mapping": mapping });
    } else {
        schema = json!({ "anyOf": forms });
    }
    schema
}
