//! The reference streams of processes under watch.

use serde_json::{Map, Value, json};

/// A stream of the compute crate's tests as a process file.
pub(crate) fn process_file(name: &str) -> Value {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/crates/precut-calc/tests/reference/process/");
    let stream: Value = serde_json::from_str(&std::fs::read_to_string(format!("{folder}{name}")).unwrap()).unwrap();
    let jobs = stream["jobs"].as_object().unwrap();
    let types: Map<String, Value> = jobs.iter().map(|(name, job)| (name.clone(), json!({ "job": job }))).collect();
    let parts = stream["parts"].as_array().unwrap().iter().map(|part| {
        let stations = stream["stations_mm"][part["type"].as_str().unwrap()].as_array().unwrap();
        let rows = stations.iter().zip(part["rows_um"].as_array().unwrap());
        json!({
            "number": part["number"], "part_type": part["type"],
            "conditions": {
                "edge": part["edge"], "batch": part["batch"].to_string(),
                "tool_path_at_start_m": part["tool_path_at_start_m"],
                "warm_time_at_start_min": part["warm_time_at_start_min"]
            },
            "gauge_checks": part.get("gauge_checks").cloned().unwrap_or_else(|| json!([])),
            "measurements": rows.map(|(z, um)| json!({ "z_mm": z, "diameter_deviation_um": um })).collect::<Vec<_>>()
        })
    });
    json!({
        "calculator": stream["calculator"], "part_types": types, "quantity": "diameter_deviation_um",
        "options": stream["options"], "parts": parts.collect::<Vec<_>>()
    })
}
