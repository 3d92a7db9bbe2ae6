//! Streams of parts with a known truth.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::Calculator;
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::process::{DocumentOf, PartOf};
use serde_json::{Value, json};

pub(crate) type Document = DocumentOf<DeflectionCompensation>;
pub(crate) type Part = PartOf<DeflectionCompensation>;

/// A stream of the reference, as its file has it.
pub(crate) fn stream(name: &str) -> Value {
    let path =
        std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("tests/reference/process").join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// As a process and its parts; allowances stated are those of the file but for the sigma, which is learned.
pub(crate) fn process(stream: &Value) -> (Document, Vec<Part>) {
    let types: serde_json::Map<String, Value> =
        stream["jobs"].as_object().unwrap().iter().map(|(name, job)| (name.clone(), json!({ "job": job }))).collect();
    let allowances = &stream["allowances"];
    let document = json!({
        "calculator": stream["calculator"], "part_types": types, "quantity": "diameter_deviation_um",
        "allowances": {
            "setup_diameter_um": allowances["setup_diameter_um"], "force_per_run_rel": allowances["force_per_run_rel"]
        },
        "options": stream["options"]
    });
    let mut document: Document = serde_json::from_value(document).unwrap();
    document.part_types.values_mut().for_each(|of| DeflectionCompensation::fill(&mut of.job));
    let parts = stream["parts"].as_array().unwrap().iter().map(|part| {
        let stations = stream["stations_mm"][part["type"].as_str().unwrap()].as_array().unwrap();
        let rows: Vec<Value> = stations
            .iter()
            .zip(part["rows_um"].as_array().unwrap())
            .map(|(z, um)| json!({ "z_mm": z, "diameter_deviation_um": um }))
            .collect();
        let checks = part.get("gauge_checks").cloned().unwrap_or_else(|| json!([]));
        serde_json::from_value(json!({
            "number": part["number"], "part_type": part["type"], "edge": part["edge"],
            "batch": part["batch"].to_string(), "gauge_checks": checks,
            "conditions": {
                "tool_path_at_start_m": part["tool_path_at_start_m"],
                "warm_time_at_start_min": part["warm_time_at_start_min"]
            },
            "measurements": rows
        }))
        .unwrap()
    });
    (document, parts.collect())
}
