//! A violation of the schema as a finding: code, pointer to the field itself, value, limit, unit, what was meant.

use std::collections::BTreeSet;
use std::sync::Mutex;

use jsonschema::{ValidationError, error::ValidationErrorKind as Kind};
use precut_calc::calculator::Finding;
use serde_json::{Map, Value};

use super::checker::{Faults, child};
use super::nearest::nearest;
use crate::units;

/// Longest piece of a received value that is shown.
const SHOWN_CHARS: usize = 60;

/// Adds what is wrong, one fault for every field concerned. `schema` is the schema that was compiled, `prefix` the
/// pointer to the value that was checked.
pub(super) fn report(error: &ValidationError<'_>, schema: &Value, prefix: &str, faults: &mut Faults) {
    let place = || {
        let path = error.schema_path().as_str();
        let parent = path.rsplit_once('/').map_or("", |(parent, _)| parent);
        (format!("{prefix}{}", error.instance_path().as_str()), parent, schema.pointer(parent).unwrap_or(&Value::Null))
    };
    if let Kind::AdditionalProperties { unexpected } = error.kind() {
        let (pointer, _, node) = place();
        for name in unexpected {
            faults.add_with(|| unknown_field(&pointer, name, node, error.instance().as_ref()));
        }
    } else {
        faults.add_with(|| {
            let (pointer, parent, node) = place();
            finding(error, &pointer, node, union_of(schema, parent))
        });
    }
}

/// What is wrong at `pointer`, where `node` has the keyword that is broken; `union` is the union whose tag this is.
fn finding(error: &ValidationError<'_>, pointer: &str, node: &Value, union: Option<&Value>) -> Finding {
    let received = error.instance().as_ref();
    match error.kind() {
        Kind::Required { property } => missing_field(pointer, property.as_str().unwrap_or_default(), node),
        Kind::Enum { options } => not_one_of(pointer, received, options, union),
        Kind::Constant { expected_value } => {
            not_one_of(pointer, received, &Value::Array(vec![expected_value.as_ref().clone()]), None)
        }
        Kind::Type { .. } => wrong_type(pointer, received, node),
        Kind::Minimum { limit }
        | Kind::Maximum { limit }
        | Kind::ExclusiveMinimum { limit }
        | Kind::ExclusiveMaximum { limit } => out_of_range(pointer, received, limit, node),
        Kind::MinItems { limit } => count(pointer, "too_few_items", received, *limit, node),
        Kind::MaxItems { limit } => count(pointer, "too_many_items", received, *limit, node),
        Kind::MinLength { limit } => count(pointer, "text_too_short", received, *limit, node),
        Kind::MaxLength { limit } => count(pointer, "text_too_long", received, *limit, node),
        Kind::MinProperties { limit } => count(pointer, "too_few_fields", received, *limit, node),
        Kind::MaxProperties { limit } => count(pointer, "too_many_fields", received, *limit, node),
        Kind::Pattern { pattern } => {
            coded("bad_pattern", pointer, node).with("pattern", pattern.clone()).with("received", shown(received))
        }
        Kind::UniqueItems => coded("duplicate_items", pointer, node),
        Kind::MultipleOf { multiple_of } => {
            let step = *multiple_of;
            numeric(coded("not_a_multiple", pointer, node), received, node).with("step", step)
        }
        Kind::OneOfNotValid { .. } | Kind::OneOfMultipleValid { .. } | Kind::AnyOf { .. } => {
            coded("no_variant", pointer, node).with("received", shown(received))
        }
        other => coded("not_allowed", pointer, node).with("keyword", other.keyword().to_owned()),
    }
}

/// A finding under the field's own code, if its schema has one; `rule` then says which rule is broken.
fn coded(rule: &'static str, pointer: &str, node: &Value) -> Finding {
    match own_code(node) {
        Some(code) => Finding::new(code, pointer).with("rule", rule),
        None => Finding::new(rule, pointer),
    }
}

fn own_code(node: &Value) -> Option<&'static str> {
    node.get("x-code").and_then(Value::as_str).map(intern)
}

fn unknown_field(pointer: &str, name: &str, node: &Value, received: &Value) -> Finding {
    let known: Vec<&str> =
        node.get("properties").and_then(Value::as_object).into_iter().flat_map(Map::keys).map(String::as_str).collect();
    let absent = known.iter().copied().filter(|known| received.get(known).is_none());
    let finding = Finding::new("unknown_field", child(pointer, name));
    match nearest(name, absent).or_else(|| nearest(name, known.iter().copied())) {
        Some(nearest) => finding.with("nearest", nearest.to_owned()),
        None => finding.with("allowed", known.into_iter().map(str::to_owned).collect::<Vec<_>>()),
    }
}

fn missing_field(pointer: &str, name: &str, node: &Value) -> Finding {
    let field = node.get("properties").and_then(|properties| properties.get(name)).unwrap_or(&Value::Null);
    let tag = node.get("x-tag").and_then(Value::as_str) == Some(name);
    let mut finding = Finding::new(if tag { "missing_kind" } else { "missing_field" }, child(pointer, name));
    finding.unit = unit_of(field);
    with_kinds(with_options(with_range(finding, field), field.get("enum")), field)
}

/// Of an object that is of one of several kinds: which there are, and the field that says it.
fn with_kinds(finding: Finding, union: &Value) -> Finding {
    let Some(tag) = union.get("x-tag").and_then(Value::as_str) else { return finding };
    let kinds = union.get("properties").and_then(|properties| properties.get(tag)?.get("enum"));
    with_options(finding.with("tag", tag.to_owned()), kinds)
}

/// The schema of the tagged union whose tag stands at `place`, if it is one.
fn union_of<'a>(schema: &'a Value, place: &str) -> Option<&'a Value> {
    let (properties, tag) = place.rsplit_once('/')?;
    let node = schema.pointer(properties.strip_suffix("/properties")?)?;
    (node.get("x-tag")?.as_str()? == tag).then_some(node)
}

fn not_one_of(pointer: &str, received: &Value, options: &Value, union: Option<&Value>) -> Finding {
    let finding = match union {
        Some(union) => coded("unknown_kind", pointer, union),
        None => Finding::new("not_one_of", pointer),
    };
    let finding = with_options(finding.with("received", shown(received)), Some(options));
    let words = options.as_array().into_iter().flatten().filter_map(Value::as_str);
    match received.as_str().and_then(|word| nearest(word, words)) {
        Some(nearest) => finding.with("nearest", nearest.to_owned()),
        None => finding,
    }
}

fn with_options(finding: Finding, options: Option<&Value>) -> Finding {
    match options.and_then(Value::as_array) {
        Some(options) => {
            let words: Vec<String> = options.iter().filter_map(Value::as_str).map(str::to_owned).collect();
            finding.with("allowed", words)
        }
        None => finding,
    }
}

fn wrong_type(pointer: &str, received: &Value, node: &Value) -> Finding {
    let expected: Vec<String> = match node.get("type") {
        Some(Value::String(one)) => vec![one.clone()],
        Some(Value::Array(many)) => many.iter().filter_map(Value::as_str).map(str::to_owned).collect(),
        _ => Vec::new(),
    };
    let numeric_expected = expected.iter().any(|kind| kind == "number" || kind == "integer");
    let text_expected = expected.iter().any(|kind| kind == "string");
    // Of several kinds of objects it is told which there are, not that none will do as well.
    let has_kinds = node.get("x-tag").is_some();
    let expected = expected.into_iter().filter(|kind| !has_kinds || kind != "null").collect::<Vec<_>>();
    let mut finding = coded("wrong_type", pointer, node)
        .with("expected", expected)
        .with("received_type", type_name(received))
        .with("received", shown(received));
    finding.unit = unit_of(node);
    finding.value = received.as_f64();
    let quoted = received.as_str().is_some_and(|text| text.trim().replace(',', ".").parse::<f64>().is_ok());
    if numeric_expected && quoted {
        finding = finding.with("quoted_number", "yes");
    }
    if text_expected && received.is_number() {
        finding = finding.with("in_quotes", received.to_string());
    }
    with_kinds(with_range(finding, node), node)
}

fn out_of_range(pointer: &str, received: &Value, limit: &Value, node: &Value) -> Finding {
    let mut finding = numeric(coded("out_of_range", pointer, node), received, node);
    finding.limit = limit.as_f64();
    let (Some(value), Some(unit)) = (finding.value, finding.unit) else { return finding };
    let bound = |inclusive: &str, exclusive: &str| number(node, inclusive).or_else(|| number(node, exclusive));
    let low = bound("minimum", "exclusiveMinimum").unwrap_or(f64::NEG_INFINITY);
    let high = bound("maximum", "exclusiveMaximum").unwrap_or(f64::INFINITY);
    let typical = number(node, "default").or_else(|| number(node, "example"));
    match units::probably_meant(value, unit, (low, high), typical) {
        Some(meant) => finding.with("looks_like", meant.unit).with("converted", meant.converted),
        None => finding,
    }
}

fn count(pointer: &str, code: &'static str, received: &Value, limit: u64, node: &Value) -> Finding {
    let size = match received {
        Value::Array(items) => items.last().and_then(cut_short).unwrap_or(items.len()),
        Value::Object(fields) => fields.len(),
        Value::String(text) => text.chars().count(),
        _ => 0,
    };
    beyond(coded(code, pointer, node), size, limit)
}

/// The fault of a list at `pointer`, whose schema is `node`, that has so many items.
pub(super) fn too_many_items(pointer: &str, items: usize, node: &Value) -> Finding {
    beyond(coded("too_many_items", pointer, node), items, node["maxItems"].as_u64().unwrap_or_default())
}

fn beyond(finding: Finding, size: usize, limit: u64) -> Finding {
    // Lengths are far below 2^53.
    #[allow(clippy::cast_precision_loss)]
    finding.measured(size as f64, limit as f64, "1")
}

/// Name of the one field of the object that stands in the place of all items beyond the most that a list may have.
const CUT_SHORT: &str = "\u{0}items";

/// The last item of a list that had more items than are kept.
pub(crate) fn cut_short_at(items: usize) -> Value {
    Value::Object(Map::from_iter([(CUT_SHORT.to_owned(), items.into())]))
}

/// How many items the list had that this one ends.
fn cut_short(last: &Value) -> Option<usize> {
    usize::try_from(last.get(CUT_SHORT)?.as_u64()?).ok()
}

fn numeric(mut finding: Finding, received: &Value, node: &Value) -> Finding {
    finding.value = received.as_f64();
    finding.unit = unit_of(node);
    with_range(finding, node)
}

/// Both ends of what is allowed: `minimum`, `maximum`, or `above`, `below` where the end itself is not.
fn with_range(mut finding: Finding, node: &Value) -> Finding {
    let ends =
        [("minimum", "minimum"), ("maximum", "maximum"), ("exclusiveMinimum", "above"), ("exclusiveMaximum", "below")];
    for (keyword, name) in ends {
        if let Some(limit) = number(node, keyword) {
            finding = finding.with(name, limit);
        }
    }
    finding
}

fn number(node: &Value, keyword: &str) -> Option<f64> {
    node.get(keyword)?.as_f64()
}

fn unit_of(node: &Value) -> Option<&'static str> {
    node.get("x-unit").and_then(Value::as_str).map(intern)
}

fn type_name(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(_) => "number",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    }
}

/// A value as text, cut to what fits in a sentence.
fn shown(value: &Value) -> String {
    match value {
        Value::Array(_) | Value::Object(_) => type_name(value).to_owned(),
        Value::String(text) if text.chars().count() > SHOWN_CHARS => {
            text.chars().take(SHOWN_CHARS).chain(['…']).collect()
        }
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// A text for as long as the process lives. Only ever given texts of schemas and of declarations, of which there are
/// few.
pub(crate) fn intern(text: &str) -> &'static str {
    static TEXTS: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut texts = TEXTS.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(known) = texts.get(text) {
        return known;
    }
    let kept: &'static str = Box::leak(text.to_owned().into_boxed_str());
    texts.insert(kept);
    kept
}
