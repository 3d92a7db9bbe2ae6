//! Every field of every calculator says what it is, in which unit, and in which range.

use precut::registry::Registry;
use serde_json::Value;

/// Walks a schema with its `$defs` and calls `look` at every field with its path.
fn walk<'a>(root: &'a Value, node: &'a Value, path: &str, seen: &mut Vec<&'a str>, look: &mut dyn FnMut(&str, &Value)) {
    if let Some(reference) = node["$ref"].as_str() {
        if !seen.contains(&reference) {
            seen.push(reference);
            let target = root.pointer(reference.trim_start_matches('#')).unwrap_or_else(|| panic!("{reference}"));
            walk(root, target, path, seen, look);
            seen.pop();
        }
        return;
    }
    if let Some(fields) = node["properties"].as_object() {
        for (name, field) in fields {
            let path = format!("{path}/{name}");
            let target = field["$ref"].as_str().and_then(|r| root.pointer(r.trim_start_matches('#')));
            let described = field["description"].is_string() || target.is_some_and(|t| t["description"].is_string());
            assert!(described, "{path} has no description");
            walk(root, field, &path, seen, look);
        }
    }
    look(path, node);
    for part in ["items", "additionalProperties"] {
        if node[part].is_object() {
            walk(root, &node[part], path, seen, look);
        }
    }
    for part in ["oneOf", "anyOf", "allOf"] {
        for form in node[part].as_array().into_iter().flatten() {
            walk(root, form, path, seen, look);
        }
    }
}

fn is_number(node: &Value) -> bool {
    let number = |t: &Value| t == "number" || t == "integer";
    match &node["type"] {
        Value::Array(types) => types.iter().any(number),
        one => number(one),
    }
}

#[test]
fn every_number_of_a_job_has_unit_symbol_range_and_example() {
    for entry in Registry::standard().unwrap().entries() {
        let document = entry.input_document();
        let mut numbers = 0;
        walk(&document, &document, entry.meta().id, &mut Vec::new(), &mut |path, node| {
            if !is_number(node) {
                return;
            }
            numbers += 1;
            let has = |names: &[&str]| names.iter().any(|name| !node[*name].is_null());
            assert!(has(&["x-unit"]), "{path} has no unit");
            assert!(has(&["x-symbol"]), "{path} has no symbol");
            assert!(has(&["minimum", "exclusiveMinimum"]), "{path} has no least value");
            assert!(has(&["maximum", "exclusiveMaximum"]), "{path} has no largest value");
            assert!(has(&["example", "examples", "default"]), "{path} has no example");
        });
        assert!(numbers > 2, "{}: the walk sees {numbers} numbers only", entry.meta().id);
    }
}

#[test]
fn every_number_of_a_result_has_its_unit() {
    for entry in Registry::standard().unwrap().entries() {
        let document = entry.output_document();
        walk(&document, &document, entry.meta().id, &mut Vec::new(), &mut |path, node| {
            assert!(!is_number(node) || node["x-unit"].is_string(), "{path} has no unit");
        });
    }
}

/// The defaults that the contract prints are those that an absent field gets.
#[test]
fn printed_defaults_are_the_real_ones() {
    for entry in Registry::standard().unwrap().entries() {
        let id = entry.meta().id;
        let body = precut::engine::Body::Json(entry.meta().examples[0].job.into());
        let filled =
            precut::engine::check_now(&Registry::standard().unwrap(), id, body, &precut::engine::Given::default())
                .unwrap()
                .input;
        let example: Value = serde_json::from_str(entry.meta().examples[0].job).unwrap();
        let document = entry.input_document();
        compare_defaults(&document, &document, &filled, Some(&example), id);
    }
}

/// Where the example leaves a field out and the schema prints a default, the filled job has it.
fn compare_defaults(root: &Value, node: &Value, filled: &Value, example: Option<&Value>, path: &str) {
    let node = node["$ref"].as_str().map_or(node, |r| root.pointer(r.trim_start_matches('#')).unwrap());
    for (name, field) in node["properties"].as_object().into_iter().flatten() {
        let path = format!("{path}/{name}");
        let given = example.and_then(|example| example.get(name));
        if given.is_none()
            && let Some(default) = field.get("default")
        {
            let equal = match (default.as_f64(), filled[name].as_f64()) {
                (Some(printed), Some(real)) => (printed - real).abs() <= 1e-12 * printed.abs(),
                _ => *default == filled[name],
            };
            assert!(equal, "{path}: the contract says {default}, an absent field gets {}", filled[name]);
        }
        if filled[name].is_object() {
            compare_defaults(root, field, &filled[name], given, &path);
        }
    }
}
