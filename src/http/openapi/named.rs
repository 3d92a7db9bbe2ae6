//! Choices of the contract as components of their own, each with a name, so that programs made from it can name them.
//!
//! A job's schema holds the variants of a union in place. Generators of clients number such variants, and stumble over
//! some; as components they are classes with names, and the field that tells them apart is the discriminator.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

const SCHEMAS: &str = "#/components/schemas/";

/// Component schemas by name.
type Components = BTreeMap<String, Value>;

/// Takes every variant that stands in place out of the document's schemas.
pub(super) fn choices(document: &mut Value) {
    let Some(Value::Object(schemas)) = document.pointer_mut("/components/schemas") else { return };
    let known: Components = std::mem::take(schemas).into_iter().collect();
    let mut named = Components::new();
    for (name, schema) in &known {
        let own = Names { known: &known }.named(schema, name, &mut named);
        named.insert(name.clone(), own);
    }
    schemas.extend(named);
}

struct Names<'a> {
    known: &'a Components,
}

impl Names<'_> {
    /// The schema with references in place of its variants; `name` is what it would be called as a component.
    fn named(&self, schema: &Value, name: &str, into: &mut Components) -> Value {
        let Value::Object(map) = schema else { return schema.clone() };
        if let Some(present) = present(map) {
            let description = map.get("description").map(|text| ("description".to_owned(), text.clone()));
            let either = json!([{ "type": "null" }, self.component(&present, name.to_owned(), into)]);
            return description.into_iter().chain([("oneOf".to_owned(), either)]).collect::<Map<_, _>>().into();
        }
        let mut own = Map::new();
        for (keyword, part) in map {
            let part = match (keyword.as_str(), part) {
                ("properties", Value::Object(fields)) => fields
                    .iter()
                    .map(|(field, part)| (field.clone(), self.named(part, &format!("{name}{}", pascal(field)), into)))
                    .collect::<Map<_, _>>()
                    .into(),
                ("items", part) => self.named(part, &format!("{name}Item"), into),
                ("oneOf" | "anyOf", Value::Array(variants)) => {
                    let tag = self.tag(variants);
                    let variants: Vec<Value> =
                        variants.iter().map(|variant| self.variant(variant, tag.as_deref(), name, into)).collect();
                    if let Some(tag) = tag {
                        own.insert("discriminator".to_owned(), self.discriminator(&tag, &variants, into));
                    }
                    variants.into()
                }
                _ => part.clone(),
            };
            own.insert(keyword.clone(), part);
        }
        own.into()
    }

    /// A variant by reference, where it is an object that stands in place; rows of a table likewise.
    fn variant(&self, variant: &Value, tag: Option<&str>, name: &str, into: &mut Components) -> Value {
        match variant["type"].as_str() {
            Some("object") => {
                let word = tag.and_then(|tag| word(variant, tag));
                let name = match word {
                    Some(word) => format!("{name}{}", pascal(word)),
                    // One form beside none, or a table as text.
                    None if variant["properties"].get("csv").is_some() => format!("{name}Csv"),
                    None => name.to_owned(),
                };
                self.component(variant, name, into)
            }
            Some("string") if variant.get("enum").is_some() => self.component(variant, name.to_owned(), into),
            Some("array") if variant["items"]["type"] == "object" => {
                let mut rows = variant.clone();
                rows["items"] = self.component(&variant["items"], format!("{name}Row"), into);
                rows
            }
            _ => variant.clone(),
        }
    }

    fn component(&self, schema: &Value, name: String, into: &mut Components) -> Value {
        let own = self.named(schema, &name, into);
        let reference = json!({ "$ref": format!("{SCHEMAS}{name}") });
        debug_assert!(!self.known.contains_key(&name), "{name} is a component already");
        into.insert(name, own);
        reference
    }

    /// The field whose one word tells all variants apart.
    fn tag(&self, variants: &[Value]) -> Option<String> {
        let mut targets = variants.iter().map(|variant| self.target(variant));
        let first = targets.next()??;
        let rest: Vec<&Value> = targets.collect::<Option<_>>()?;
        let fields = first["properties"].as_object()?;
        let is_tag = |field: &&String| {
            !rest.is_empty()
                && word(first, field).is_some()
                && rest.iter().all(|variant| word(variant, field).is_some())
        };
        fields.keys().find(is_tag).cloned()
    }

    /// A variant itself, or what it refers to.
    fn target<'v>(&'v self, variant: &'v Value) -> Option<&'v Value> {
        match variant["$ref"].as_str() {
            Some(reference) => self.known.get(reference.strip_prefix(SCHEMAS)?),
            None => Some(variant),
        }
    }

    fn discriminator(&self, tag: &str, variants: &[Value], named: &Components) -> Value {
        let mapped = |variant: &Value| {
            let reference = variant["$ref"].as_str()?;
            let name = reference.strip_prefix(SCHEMAS)?;
            let target = named.get(name).or_else(|| self.known.get(name))?;
            Some((word(target, tag)?.to_owned(), json!(reference)))
        };
        let mapping: Map<String, Value> = variants.iter().filter_map(mapped).collect();
        json!({ "propertyName": tag, "mapping": mapping })
    }
}

/// What an object is that may also be null, where it is there.
fn present(map: &Map<String, Value>) -> Option<Value> {
    let is_either = *map.get("type")? == json!(["object", "null"]);
    let mut present = map.clone();
    present.insert("type".to_owned(), json!("object"));
    is_either.then(|| present.into())
}

/// The one word that a required field of an object may have.
fn word<'v>(object: &'v Value, field: &str) -> Option<&'v str> {
    let is_required = object["required"].as_array()?.iter().any(|name| name == field);
    let words = object["properties"][field]["enum"].as_array()?;
    match words.as_slice() {
        [Value::String(only)] if is_required => Some(only),
        _ => None,
    }
}

/// `snake_case` or `kebab-case` as `PascalCase`.
fn pascal(name: &str) -> String {
    let part = |part: &str| {
        let mut letters = part.chars();
        letters.next().map(|first| first.to_uppercase().chain(letters).collect::<String>()).unwrap_or_default()
    };
    name.split(['_', '-']).map(part).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn variants_become_components_told_apart_by_their_word() {
        let variant = |word: &str| {
            json!({ "type": "object", "required": ["kind"],
                    "properties": { "kind": { "type": "string", "enum": [word] } } })
        };
        let row = json!({ "type": "object", "properties": { "z_mm": { "type": "number" } } });
        let mut document = json!({ "components": { "schemas": {
            "Job": { "type": "object", "properties": {
                "support": { "oneOf": [variant("steady_rest"), variant("centre")] },
                "rows": { "oneOf": [
                    { "type": "array", "items": row },
                    { "type": "object", "properties": { "csv": { "type": "string" } } },
                ] },
            } },
        } } });
        choices(&mut document);
        let schemas = &document["components"]["schemas"];
        let names: Vec<&String> = schemas.as_object().unwrap().keys().collect();
        assert_eq!(names, ["Job", "JobRowsCsv", "JobRowsRow", "JobSupportCentre", "JobSupportSteadyRest"]);
        let reference = |name: &str| json!({ "$ref": format!("{SCHEMAS}{name}") });
        let support = &schemas["Job"]["properties"]["support"];
        assert_eq!(support["oneOf"][0], reference("JobSupportSteadyRest"));
        assert_eq!(
            support["discriminator"],
            json!({ "propertyName": "kind", "mapping": {
                "steady_rest": format!("{SCHEMAS}JobSupportSteadyRest"),
                "centre": format!("{SCHEMAS}JobSupportCentre"),
            } })
        );
        assert_eq!(schemas["Job"]["properties"]["rows"]["oneOf"][0]["items"], reference("JobRowsRow"));
        assert_eq!(schemas["JobRowsRow"], row);
    }
}
