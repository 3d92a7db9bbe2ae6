//! A calculator's schema as a form shows it: with labels, help and words in the language asked for.

use serde_json::{Map, Value};

use super::{Glossary, Language};

/// Members whose content is data, not schema.
const DATA: [&str; 4] = ["default", "example", "examples", "x-code"];

/// A JSON Schema that stands alone, with every description in `language`, and with these members besides:
///
/// - `title` of every field: its label;
/// - `x-labels` beside every `enum`: what each of its words is called, by the word;
/// - `x-unit-label` beside every `x-unit`: the unit as it is printed;
/// - `x-group-label` beside every `x-group`.
///
/// Names, words and units themselves stay as they are sent.
pub(crate) fn described(document: &Value, root: &str, language: Language) -> Value {
    Describing { glossary: Glossary::of(language) }.schema(document, root)
}

struct Describing {
    glossary: &'static Glossary,
}

impl Describing {
    fn schema(&self, schema: &Value, component: &str) -> Value {
        match schema {
            Value::Object(map) => self.object(map, component).into(),
            Value::Array(items) => items.iter().map(|item| self.schema(item, component)).collect(),
            other => other.clone(),
        }
    }

    fn object(&self, map: &Map<String, Value>, component: &str) -> Map<String, Value> {
        let mut said = Map::new();
        for (name, part) in map {
            let part = match (name.as_str(), part) {
                (name, part) if DATA.contains(&name) => part.clone(),
                ("description", Value::String(english)) => self.glossary.help(english).into(),
                ("properties", Value::Object(fields)) => self.fields(fields, component).into(),
                ("$defs", Value::Object(types)) => {
                    types.iter().map(|(name, part)| (name.clone(), self.schema(part, name))).collect()
                }
                (_, part) => self.schema(part, component),
            };
            said.insert(name.clone(), part);
        }
        if let Some(Value::Array(words)) = map.get("enum") {
            let labels = words.iter().filter_map(|word| Some((word.as_str()?, self.glossary.word(word.as_str()?))));
            let labels: Map<String, Value> = labels.map(|(word, label)| (word.to_owned(), label.into())).collect();
            if !labels.is_empty() {
                said.insert("x-labels".to_owned(), labels.into());
            }
        }
        if let Some(Value::String(unit)) = map.get("x-unit") {
            said.insert("x-unit-label".to_owned(), self.glossary.unit(unit).into());
        }
        if let Some(Value::String(group)) = map.get("x-group") {
            said.insert("x-group-label".to_owned(), self.glossary.group(group).into());
        }
        said
    }

    fn fields(&self, fields: &Map<String, Value>, component: &str) -> Map<String, Value> {
        let mut said = Map::new();
        for (name, field) in fields {
            let mut field_said = self.schema(field, component);
            let unit = field["x-unit"].as_str().or_else(|| field["items"]["x-unit"].as_str());
            if let Value::Object(members) = &mut field_said {
                members.insert("title".to_owned(), self.glossary.label(component, name, unit).into());
            }
            said.insert(name.clone(), field_said);
        }
        said
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn fields_words_and_units_are_labelled_and_names_stay() {
        let schema = json!({
            "type": "object",
            "description": "A cylindrical piece of the shaft.",
            "properties": {
                "length_mm": {"type": "number", "x-unit": "mm", "x-group": "workpiece", "default": {"enum": ["x"]}},
                "kind": {"type": "string", "enum": ["centre"]},
            },
            "$defs": {"Other": {"properties": {"feed_mm_per_rev": {"$ref": "#/$defs/Feed"}}}},
        });
        let said = described(&schema, "Segment", Language::Ru);
        assert_eq!(said["description"], "Цилиндрический участок вала.");
        assert_eq!(said["properties"]["length_mm"]["title"], "Длина");
        assert_eq!(said["properties"]["length_mm"]["x-unit"], "mm");
        assert_eq!(said["properties"]["length_mm"]["x-unit-label"], "мм");
        assert_eq!(said["properties"]["length_mm"]["x-group-label"], "Заготовка");
        assert_eq!(said["properties"]["length_mm"]["default"], json!({"enum": ["x"]}));
        assert_eq!(said["properties"]["kind"]["enum"], json!(["centre"]));
        assert_eq!(said["properties"]["kind"]["x-labels"], json!({"centre": "центр"}));
        assert_eq!(said["$defs"]["Other"]["properties"]["feed_mm_per_rev"]["title"], "Подача");
        let english = described(&schema, "Segment", Language::En);
        assert_eq!(english["description"], schema["description"]);
        assert_eq!(english["properties"]["length_mm"]["title"], "Length");
    }
}
