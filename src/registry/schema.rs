//! Schemas as `utoipa` writes them, into the forms that the service uses.
//!
//! `utoipa` leaves the variants of a tagged enum open and writes flattened and newtype parts as `allOf`, which a
//! closed part makes unsatisfiable. [`tidy`] joins such parts and [`close`] closes objects, so that an unknown field
//! is a fault everywhere. [`strict`] makes of it the form that is compiled for validation: no references, and unions
//! told apart by their `kind` or their JSON type, so that a fault points at its field and not at the union.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::RegistryError;

const REFERENCE: &str = "#/components/schemas/";
/// Deeper nesting of references than any job needs: a type that contains itself.
const DEEPEST: usize = 64;

/// Component schemas by name.
pub(super) type Components = BTreeMap<String, Value>;

/// The schema with `allOf` parts joined, extensions in alphabetical order (`utoipa` holds them in a hash map), and a
/// description where `utoipa` leaves none or puts it out of sight.
pub(super) fn tidy(schema: &Value, components: &Components) -> Value {
    match schema {
        Value::Object(map) => {
            let joined = joined(map, components);
            let map = joined.as_ref().unwrap_or(map);
            let (own, extensions): (Vec<_>, Vec<_>) = map.iter().partition(|(name, _)| !name.starts_with("x-"));
            let mut tidied: Map<String, Value> =
                own.into_iter().map(|(name, part)| (name.clone(), tidy(part, components))).collect();
            let sorted: BTreeMap<_, _> = extensions.into_iter().collect();
            tidied.extend(sorted.into_iter().map(|(name, part)| (name.clone(), part.clone())));
            describe(&mut tidied);
            Value::Object(tidied)
        }
        Value::Array(items) => items.iter().map(|item| tidy(item, components)).collect(),
        other => other.clone(),
    }
}

/// Says what a tag is for, and lifts the description of an optional field from its one form to the field.
fn describe(schema: &mut Map<String, Value>) {
    if let Some(Value::Object(kind)) = schema.get_mut("properties").and_then(|fields| fields.get_mut("kind")) {
        kind.entry("description").or_insert_with(|| json!("Which of the choices this is."));
    }
    if schema.contains_key("description") {
        return;
    }
    if let Some(Value::Array(forms)) = schema.get_mut("oneOf")
        && forms.iter().any(|form| *form == json!({ "type": "null" }))
        && let Some(description) = forms.iter_mut().find_map(|form| form.as_object_mut()?.remove("description"))
    {
        schema.insert("description".to_owned(), description);
    }
}

/// One object in place of an `allOf` of objects; `None` where a part is something else.
fn joined(map: &Map<String, Value>, components: &Components) -> Option<Map<String, Value>> {
    let parts = map.get("allOf")?.as_array()?;
    let mut properties = Map::new();
    let mut required: Vec<Value> = Vec::new();
    let mut whole = Map::new();
    let mut said = None;
    for part in parts {
        if let Some(description) = remark(part) {
            said = Some(description.clone());
            continue;
        }
        let part = object_part(part, components, 0)?;
        let remark = is_remark(&part);
        for (name, value) in part {
            match (name.as_str(), value) {
                // What is said of the field itself comes before what is said of its type.
                ("description", value) if remark => {
                    whole.insert(name, value);
                }
                ("properties", Value::Object(own)) => properties.extend(own),
                ("required", Value::Array(own)) => required.extend(own),
                ("type" | "additionalProperties", _) => {}
                (_, value) => {
                    whole.entry(name).or_insert(value);
                }
            }
        }
    }
    for (name, value) in map {
        if name != "allOf" {
            whole.insert(name.clone(), value.clone());
        }
    }
    if let Some(description) = said {
        // What a field says of its type says more than the type.
        whole.insert("description".to_owned(), description);
    }
    whole.insert("type".to_owned(), json!("object"));
    if !required.is_empty() {
        let mut seen = Vec::new();
        required.retain(|name| {
            let new = !seen.contains(name);
            seen.push(name.clone());
            new
        });
        whole.insert("required".to_owned(), required.into());
    }
    whole.insert("properties".to_owned(), properties.into());
    Some(whole)
}

/// What a part of an `allOf` says that says nothing else: the field's own description beside its type in place.
fn remark(part: &Value) -> Option<&Value> {
    let map = part.as_object()?;
    let says_nothing_else = map.keys().all(|name| name == "type" || name == "description");
    map.get("description").filter(|_| says_nothing_else && map.get("type").is_none_or(|kind| kind == "object"))
}

/// A part of an `allOf` with its reference followed, if it is a plain object.
fn object_part(part: &Value, components: &Components, depth: usize) -> Option<Map<String, Value>> {
    let map = part.as_object()?;
    if depth > DEEPEST {
        return None;
    }
    if let Some(name) = reference(map) {
        let mut target = object_part(components.get(name)?, components, depth + 1)?;
        target.extend(map.iter().filter(|(key, _)| *key != "$ref").map(|(key, value)| (key.clone(), value.clone())));
        return Some(target);
    }
    if map.contains_key("allOf") {
        return joined(map, components);
    }
    let is_object = map.get("type") == Some(&json!("object"));
    (is_object && (map.contains_key("properties") || is_remark(map))).then(|| map.clone())
}

/// Whether a part only says something of an object, as `utoipa` does beside a type that is written in place.
fn is_remark(map: &Map<String, Value>) -> bool {
    map.contains_key("description") && map.keys().all(|name| matches!(name.as_str(), "type" | "description"))
}

/// Adds `additionalProperties: false` to every object with named fields that says nothing about others.
pub(super) fn close(schema: &mut Value) {
    match schema {
        Value::Object(map) => {
            for (name, part) in map.iter_mut() {
                // What stays as `allOf` cannot be closed part by part.
                if name != "allOf" {
                    close(part);
                }
            }
            let named = map.get("properties").is_some_and(Value::is_object);
            if named && map.get("type") == Some(&json!("object")) && !map.contains_key("additionalProperties") {
                map.insert("additionalProperties".to_owned(), Value::Bool(false));
            }
        }
        Value::Array(items) => items.iter_mut().for_each(close),
        _ => {}
    }
}

/// The schema with its components under `$defs`: it stands alone.
pub(super) fn standing_alone(root: &Value, components: &Components) -> Value {
    let mut needed = Components::new();
    collect(root, components, &mut needed);
    let mut document = Map::new();
    document.insert("$schema".to_owned(), json!("https://json-schema.org/draft/2020-12/schema"));
    if let Value::Object(map) = local(root) {
        document.extend(map);
    }
    if !needed.is_empty() {
        let definitions: Map<String, Value> = needed.iter().map(|(name, part)| (name.clone(), local(part))).collect();
        document.insert("$defs".to_owned(), definitions.into());
    }
    document.into()
}

/// Every component that `schema` refers to, directly or not.
pub(super) fn collect(schema: &Value, components: &Components, needed: &mut Components) {
    match schema {
        Value::Object(map) => {
            if let Some(name) = reference(map)
                && let Some(target) = components.get(name)
                && !needed.contains_key(name)
            {
                needed.insert(name.to_owned(), target.clone());
                collect(target, components, needed);
            }
            map.values().for_each(|part| collect(part, components, needed));
        }
        Value::Array(items) => items.iter().for_each(|item| collect(item, components, needed)),
        _ => {}
    }
}

fn local(schema: &Value) -> Value {
    match schema {
        Value::Object(map) => map
            .iter()
            .map(|(name, part)| match (name.as_str(), part) {
                ("$ref", Value::String(target)) => (name.clone(), target.replace(REFERENCE, "#/$defs/").into()),
                _ => (name.clone(), local(part)),
            })
            .collect::<Map<_, _>>()
            .into(),
        Value::Array(items) => items.iter().map(local).collect(),
        other => other.clone(),
    }
}

fn reference(map: &Map<String, Value>) -> Option<&str> {
    map.get("$ref")?.as_str()?.strip_prefix(REFERENCE)
}

/// The form for validation; see the module's text.
pub(super) fn strict(schema: &Value, components: &Components) -> Result<Value, RegistryError> {
    strict_at(schema, components, 0)
}

fn strict_at(schema: &Value, components: &Components, depth: usize) -> Result<Value, RegistryError> {
    let Value::Object(map) = schema else { return Ok(schema.clone()) };
    if depth > DEEPEST {
        return Err(RegistryError::Recursive);
    }
    if let Some(name) = reference(map) {
        let target = components.get(name).ok_or_else(|| RegistryError::UnknownComponent(name.to_owned()))?;
        let mut inlined = strict_at(target, components, depth + 1)?;
        if let Value::Object(own) = &mut inlined {
            own.extend(map.iter().filter(|(key, _)| *key != "$ref").map(|(key, value)| (key.clone(), value.clone())));
        }
        return Ok(inlined);
    }
    if map.contains_key("x-table") {
        return strict_table(map, components, depth);
    }
    if let Some([only]) = map.get("allOf").and_then(Value::as_array).map(Vec::as_slice) {
        // A reference that something is said of beside it.
        let mut inlined = strict_at(only, components, depth + 1)?;
        if let Value::Object(own) = &mut inlined {
            own.extend(map.iter().filter(|(key, _)| *key != "allOf").map(|(key, value)| (key.clone(), value.clone())));
        }
        return Ok(inlined);
    }
    let mut node = Map::new();
    for (keyword, part) in map {
        let part = match keyword.as_str() {
            "properties" | "patternProperties" => strict_each(part, components, depth)?,
            "items" | "additionalProperties" | "not" | "propertyNames" => strict_at(part, components, depth + 1)?,
            "oneOf" | "anyOf" | "allOf" | "prefixItems" => strict_list(part, components, depth)?,
            _ => part.clone(),
        };
        node.insert(keyword.clone(), part);
    }
    Ok(Value::Object(union(node)))
}

fn strict_each(part: &Value, components: &Components, depth: usize) -> Result<Value, RegistryError> {
    let Value::Object(map) = part else { return Ok(part.clone()) };
    let parts: Result<Map<String, Value>, RegistryError> =
        map.iter().map(|(name, part)| Ok((name.clone(), strict_at(part, components, depth + 1)?))).collect();
    Ok(parts?.into())
}

fn strict_list(part: &Value, components: &Components, depth: usize) -> Result<Value, RegistryError> {
    let Value::Array(parts) = part else { return Ok(part.clone()) };
    parts.iter().map(|part| strict_at(part, components, depth + 1)).collect()
}

/// A measured table: CSV has become rows by the time of validation, so only the rows remain.
fn strict_table(map: &Map<String, Value>, components: &Components, depth: usize) -> Result<Value, RegistryError> {
    let variants = map.get("oneOf").and_then(Value::as_array);
    let rows = variants.and_then(|variants| variants.iter().find(|variant| variant["type"] == "array"));
    let mut rows = strict_at(rows.ok_or(RegistryError::TableWithoutRows)?, components, depth + 1)?;
    if let Value::Object(own) = &mut rows {
        own.extend(map.iter().filter(|(key, _)| *key != "oneOf").map(|(key, value)| (key.clone(), value.clone())));
    }
    Ok(rows)
}

/// A `oneOf` whose variants can be told apart, as a schema that says which one is meant.
fn union(mut node: Map<String, Value>) -> Map<String, Value> {
    let Some(Value::Array(variants)) = node.get("oneOf").cloned() else { return node };
    let (nulls, variants): (Vec<_>, Vec<_>) = variants.into_iter().partition(|variant| variant["type"] == "null");
    let told_apart = match variants.as_slice() {
        [only] => only.as_object().cloned(),
        many => words(many).or_else(|| tagged(many)).or_else(|| by_type(many)),
    };
    let Some(mut merged) = told_apart else { return node };
    node.remove("oneOf");
    merged.extend(node);
    if !nulls.is_empty() {
        allow_null(&mut merged);
    }
    merged
}

fn allow_null(node: &mut Map<String, Value>) {
    let types = match node.get("type") {
        Some(Value::String(one)) => vec![json!(one), json!("null")],
        Some(Value::Array(many)) => many.iter().cloned().chain([json!("null")]).collect(),
        _ => return,
    };
    node.insert("type".to_owned(), types.into());
    if let Some(Value::Array(options)) = node.get_mut("enum") {
        options.push(Value::Null);
    }
}

/// Variants that are words: one list of words.
fn words(variants: &[Value]) -> Option<Map<String, Value>> {
    let mut all = Vec::new();
    for variant in variants {
        match (&variant["type"], &variant["enum"], &variant["const"]) {
            (Value::String(kind), Value::Array(options), _) if kind == "string" => all.extend(options.iter().cloned()),
            (_, _, word @ Value::String(_)) => all.push(word.clone()),
            _ => return None,
        }
    }
    Some(Map::from_iter([("type".to_owned(), json!("string")), ("enum".to_owned(), all.into())]))
}

/// Variants that a word in a common field tells apart.
fn tagged(variants: &[Value]) -> Option<Map<String, Value>> {
    let first = variants.first()?["properties"].as_object()?;
    let tag = first.keys().find(|name| variants.iter().all(|variant| tag_word(variant, name).is_some()))?;
    let mut options = Vec::new();
    let mut branches = Vec::new();
    for variant in variants {
        let word = tag_word(variant, tag)?;
        branches.push(json!({
            "if": { "type": "object", "required": [tag], "properties": { tag: { "const": word } } },
            "then": variant,
        }));
        options.push(word.clone());
    }
    let node = json!({
        "type": "object",
        "x-tag": tag,
        "required": [tag],
        "properties": { tag: { "type": "string", "enum": options } },
        "allOf": branches,
    });
    node.as_object().cloned()
}

fn tag_word<'a>(variant: &'a Value, tag: &str) -> Option<&'a Value> {
    let field = variant.get("properties")?.get(tag)?;
    let required = variant.get("required")?.as_array()?.iter().any(|name| name == tag);
    let word = match (field.get("enum"), field.get("const")) {
        (Some(Value::Array(words)), _) if words.len() == 1 => &words[0],
        (_, Some(word)) => word,
        _ => return None,
    };
    (required && word.is_string()).then_some(word)
}

/// Variants of different JSON types: their keywords stand side by side, for each keyword concerns one type only.
fn by_type(variants: &[Value]) -> Option<Map<String, Value>> {
    let mut types: Vec<Value> = Vec::new();
    let mut whole = Map::new();
    for variant in variants {
        let map = variant.as_object()?;
        if ["enum", "const", "oneOf", "anyOf", "allOf"].iter().any(|keyword| map.contains_key(*keyword)) {
            return None;
        }
        for (keyword, part) in map {
            match keyword.as_str() {
                "type" => {}
                "description" | "title" | "format" | "example" | "examples" | "default" => {
                    whole.entry(keyword.clone()).or_insert_with(|| part.clone());
                }
                _ if whole.get(keyword).is_some_and(|there| there != part) => return None,
                _ => {
                    whole.insert(keyword.clone(), part.clone());
                }
            }
        }
        let own = match map.get("type")? {
            Value::Array(many) => many.clone(),
            one => vec![one.clone()],
        };
        let numeric = |kind: &Value| kind == "integer" || kind == "number";
        if own.iter().any(|kind| types.contains(kind) || (numeric(kind) && types.iter().any(numeric))) {
            return None;
        }
        types.extend(own);
    }
    whole.insert("type".to_owned(), types.into());
    Some(whole)
}
