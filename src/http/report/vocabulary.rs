//! What codes are called that stand in cells and values without a schema of their own: by the names and choices of
//! their calculator's contract.

use std::collections::HashMap;

use serde_json::Value;

use super::own;
use crate::text::{Glossary, Language, capitalised};
use crate::units;

/// Columns and fields in which names stand that the user gave: they are nobody's words.
const OWN_NAMES: [&str; 6] = ["zone", "id", "label", "batch", "level", "of_level"];

/// The words of a calculator.
pub(super) struct Vocabulary {
    language: Language,
    glossary: &'static Glossary,
    /// Fields by their names and choices by their codes.
    names: HashMap<String, String>,
    /// Fields by their names without the unit.
    stems: HashMap<String, String>,
}

impl Vocabulary {
    /// That of some schemas.
    pub(super) fn of(documents: [&Value; 2], root: &str, language: Language) -> Self {
        let glossary = Glossary::of(language);
        let mut own = Self { language, glossary, names: HashMap::new(), stems: HashMap::new() };
        for document in documents {
            own.walk(document, root);
        }
        own
    }

    fn walk(&mut self, schema: &Value, component: &str) {
        let Value::Object(map) = schema else {
            schema.as_array().into_iter().flatten().for_each(|part| self.walk(part, component));
            return;
        };
        for (name, part) in map {
            match (name.as_str(), part) {
                ("default" | "example" | "examples", _) => {}
                ("enum", Value::Array(words)) => {
                    for word in words.iter().filter_map(Value::as_str) {
                        self.names.entry(word.to_owned()).or_insert_with(|| self.glossary.word(word));
                    }
                }
                ("properties", Value::Object(fields)) => {
                    for (name, field) in fields {
                        self.field(component, name, field);
                        self.walk(field, component);
                    }
                }
                ("$defs", Value::Object(types)) => types.iter().for_each(|(name, part)| self.walk(part, name)),
                (_, part) => self.walk(part, component),
            }
        }
    }

    fn field(&mut self, component: &str, name: &str, field: &Value) {
        let unit = field["x-unit"].as_str();
        let label = self.glossary.label(component, name, unit);
        let suffix = unit.map(units::suffix).filter(|suffix| !suffix.is_empty());
        if let Some(stem) = suffix.and_then(|suffix| name.strip_suffix(suffix.as_str())) {
            self.stems.entry(stem.to_owned()).or_insert_with(|| label.clone());
        }
        self.names.entry(name.to_owned()).or_insert(label);
    }

    /// What stands under a name, in the reader's language; nothing where it stays as it is.
    pub(super) fn under(&self, name: &str, text: &str) -> Option<String> {
        if name == "unit" || name.ends_with("_unit") {
            return Some(self.glossary.unit(text));
        }
        if OWN_NAMES.contains(&name) {
            return None;
        }
        match text {
            "true" | "yes" => Some(own(self.language, "yes")),
            "false" | "no" => Some(own(self.language, "no")),
            text => self.code(text).map(capitalised).or_else(|| self.codes(text)),
        }
    }

    fn code(&self, text: &str) -> Option<&str> {
        let named = self.names.get(text).map(String::as_str);
        named.or_else(|| self.glossary.known(text)).or_else(|| self.stems.get(text).map(String::as_str))
    }

    /// Several codes with something between them.
    fn codes(&self, text: &str) -> Option<String> {
        const JOINTS: [(&str, &str); 4] = [(" + ", " + "), (", ", ", "), ("|", ", "), (" ", ", ")];
        JOINTS.iter().find_map(|(joint, said)| {
            let parts: Vec<&str> = text.split(joint).collect();
            // Between the words of a sentence there are spaces, too.
            let is_list = parts.len() > 1 && (*joint != " " || parts.iter().any(|part| part.contains('_')));
            let parts: Option<Vec<&str>> =
                is_list.then(|| parts.iter().map(|part| self.code(part)).collect()).flatten();
            parts.map(|parts| capitalised(&parts.join(said)))
        })
    }
}
