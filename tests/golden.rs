//! The numbers of every example, per version of its calculator: if they change, the version must rise.
//!
//! `PRECUT_WRITE_GOLDEN=1 cargo test --test golden` writes them down anew; the diff belongs to the review.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::collections::BTreeMap;
use std::path::Path;

use precut::engine::{Body, solve_now};
use precut::registry::Registry;
use precut_calc::calculator::Unwatched;
use serde_json::{Value, json};

/// Elementary functions differ in their last digit from machine to machine, and conditions amplify it; a change of
/// physics or numerics that anybody would notice is far above.
const TOLERANCE: f64 = 1e-8;

/// Every number by its place; of a list the sum and the sum of squares, and how many there are.
fn digest(value: &Value, at: &str, into: &mut BTreeMap<String, f64>) {
    match value {
        Value::Number(number) => {
            into.insert(at.to_owned(), number.as_f64().unwrap());
        }
        Value::Array(items) if items.iter().all(|item| item.is_number() || item.is_null()) => {
            let numbers = || items.iter().filter_map(Value::as_f64);
            into.insert(format!("{at}/count"), f64::from(u32::try_from(numbers().count()).unwrap()));
            into.insert(format!("{at}/sum"), numbers().sum());
            into.insert(format!("{at}/squares"), numbers().map(|x| x * x).sum());
        }
        Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                digest(item, &format!("{at}/{i}"), into);
            }
        }
        Value::Object(fields) => {
            for (name, field) in fields {
                digest(field, &format!("{at}/{name}"), into);
            }
        }
        _ => {}
    }
}

#[test]
fn numbers_change_only_with_the_version() {
    let registry = Registry::standard().unwrap();
    for entry in registry.entries() {
        let meta = entry.meta();
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{}.json", meta.id));
        let mut found = BTreeMap::new();
        for example in meta.examples {
            let stored = solve_now(&registry, meta.id, Body::Json(example.job.into()), &Unwatched).unwrap();
            let answer: Value = serde_json::from_slice(&stored.body).unwrap();
            digest(&answer["result"], example.id, &mut found);
        }
        if std::env::var_os("PRECUT_WRITE_GOLDEN").is_some() {
            let text = serde_json::to_string_pretty(&json!({ "version": meta.version, "numbers": found })).unwrap();
            std::fs::write(&file, text + "\n").unwrap();
        }
        let golden: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        assert_eq!(golden["version"], meta.version, "{}: write the golden numbers of the new version", meta.id);
        let golden = golden["numbers"].as_object().unwrap();
        assert_eq!(golden.len(), found.len(), "{}: other numbers than version {} has", meta.id, meta.version);
        for (place, number) in &found {
            let before = golden.get(place).and_then(Value::as_f64).unwrap_or_else(|| panic!("{place} is new"));
            // What is nothing but rounding (residuals, sums that cancel) has no digits to keep.
            let scale = before.abs().max(1e-6);
            let rounding = place.ends_with("numerical_error_um") || place.ends_with("gap_um");
            assert!(
                rounding || (number - before).abs() <= TOLERANCE * scale,
                "{}: {place} was {before}, is {number}: raise the version",
                meta.id
            );
        }
    }
}
