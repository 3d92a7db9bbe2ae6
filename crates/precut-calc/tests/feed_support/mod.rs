//! Reads the feed-scheduling reference cases and translates their sketch of an input into jobs of the contract.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    dead_code,
    unreachable_pub,
    reason = "test support, shared by several test files"
)]

use precut_calc::calculator::{Calculator, Check, Failure, Infeasible, Unwatched, Violations};
use precut_calc::feed_schedule::{FeedSchedule, Job, Outcome};
use serde_json::{Map, Value, json};

/// A reference file.
pub fn reference(name: &str) -> Value {
    // Used by the tests of the whole workspace, too, which are compiled one folder up.
    let package = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = package.ancestors().find(|folder| folder.join("Cargo.lock").is_file()).unwrap_or(package);
    let path = root.join("crates/precut-calc").join("tests/reference/feed-scheduling").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap()
}

const NAMES: &[(&str, &str)] = &[
    ("form", "form"),
    ("c0", "constant"),
    ("v", "speed_exponent"),
    ("s", "feed_exponent"),
    ("t", "depth_exponent"),
    ("phi", "angle_exponent"),
    ("outer_diameter_mm", "diameter_mm"),
    ("inner_diameter_mm", "bore_diameter_mm"),
    ("compliance_um_per_N", "compliance_um_per_n"),
    ("rpm_min", "spindle_speed_min_rpm"),
    ("rpm_max", "spindle_speed_max_rpm"),
    ("torque_Nm", "torque_n_m"),
    ("force_z_max_N", "force_z_max_n"),
    ("force_y_max_N", "force_y_max_n"),
];

/// The contract's name of a field of the sketch.
pub fn renamed(name: &str) -> &str {
    NAMES.iter().find(|(old, _)| *old == name).map_or(name, |(_, new)| new)
}

fn deep(value: &Value) -> Value {
    match value {
        Value::Object(fields) => {
            Value::Object(fields.iter().map(|(name, value)| (renamed(name).to_owned(), deep(value))).collect())
        }
        Value::Array(items) => Value::Array(items.iter().map(deep).collect()),
        other => other.clone(),
    }
}

fn supports(shaft: &Value) -> Value {
    let length: f64 = shaft["segments"].as_array().unwrap().iter().map(|s| s["length_mm"].as_f64().unwrap()).sum();
    let of = |name: &str| shaft.get(name).and_then(Value::as_f64).unwrap_or(0.0);
    let (head, tail) = (of("headstock_compliance_um_per_N"), of("tailstock_compliance_um_per_N"));
    let centre = |z: f64, c: f64| json!({ "kind": "centre", "z_mm": z, "compliance_um_per_n": c });
    let chuck = json!({ "kind": "chuck", "z_mm": 0.0, "compliance_um_per_n": head });
    match shaft["support"].as_str().unwrap() {
        "between_centres" => json!([centre(0.0, head), centre(length, tail)]),
        "chuck_tailstock" => json!([chuck, centre(length, tail)]),
        "chuck" => json!([chuck]),
        other => panic!("{other}"),
    }
}

/// A reference input as a job.
pub fn translate(input: &Value) -> Value {
    let mut job = Map::new();
    for (name, value) in input.as_object().unwrap() {
        match name.as_str() {
            "shaft" => {
                job.insert(
                    "shaft".to_owned(),
                    json!({ "youngs_modulus_n_per_mm2": value["E_N_per_mm2"], "segments": deep(&value["segments"]) }),
                );
                job.insert("supports".to_owned(), supports(value));
                if let Some(c) = value.get("carriage_compliance_um_per_N") {
                    job.insert("carriage".to_owned(), json!({ "compliance_um_per_n": c }));
                }
            }
            "phi_deg" => {
                job.insert("cutting_edge_angle_deg".to_owned(), value.clone());
            }
            other => {
                job.insert(renamed(other).to_owned(), deep(value));
            }
        }
    }
    // A reference case names its limits per zone; `repeat` is a whole number there, too.
    Value::Object(job)
}

/// The job, checked and filled.
pub fn job(value: Value) -> Job {
    let mut job: Job = serde_json::from_value(value).unwrap_or_else(|e| panic!("{e}"));
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert!(violations.is_empty(), "{:?}", violations.into_vec());
    FeedSchedule::fill(&mut job);
    job
}

/// Solves a job of the contract.
pub fn solve(value: Value) -> Result<Outcome, Failure> {
    FeedSchedule::run(&job(value), &Unwatched).map(|answer| answer.output)
}

/// Solves a job that has an answer.
pub fn solved(value: Value) -> Outcome {
    solve(value).unwrap_or_else(|failure| panic!("{failure:?}"))
}

/// The conflict of a job that has none.
pub fn conflict(value: Value) -> Infeasible {
    match solve(value) {
        Err(Failure::Conflicting(conflict)) => conflict.infeasible,
        other => panic!("{other:?}"),
    }
}

/// Multipliers by `constraint@zone`, those of one name added.
pub fn multipliers(outcome: &Outcome) -> std::collections::BTreeMap<String, f64> {
    let mut sums = std::collections::BTreeMap::new();
    for b in &outcome.binding {
        *sums.entry(format!("{}@{}", b.constraint, b.zone)).or_insert(0.0) += b.multiplier;
    }
    sums
}

/// A number of a zone of the answer by its name in the reference.
pub fn of_zone(outcome: &Outcome, id: &str, name: &str) -> f64 {
    let zone = outcome.zones.iter().find(|zone| zone.id == id).unwrap_or_else(|| panic!("{id}"));
    let value = match name {
        "feed_mm_per_rev" => Some(zone.feed_mm_per_rev),
        "speed_m_per_min" => Some(zone.speed_m_per_min),
        "rpm" => Some(zone.spindle_speed_rpm),
        "time_min" => Some(zone.cutting_time_min),
        "compliance_um_per_N" => zone.compliance_um_per_n,
        "force_y_N" => zone.force_y_n,
        "force_z_N" => zone.force_z_n,
        "power_kw" => zone.power_kw,
        "deflection_um" => zone.deflection_um,
        "roughness_um" => zone.roughness_um,
        "hardening_percent" => zone.hardening_percent,
        "hardening_depth_um" => zone.hardening_depth_um,
        "tool_life_min" => zone.tool_life_min,
        "tool_usage" => zone.tool_usage,
        other => panic!("{other}"),
    };
    value.unwrap_or_else(|| panic!("{id} has no {name}"))
}

/// Within `relative` of the expected value, or `absolute`.
pub fn near(what: &str, found: f64, expected: f64, relative: f64, absolute: f64) {
    let allowed = (relative * expected.abs()).max(absolute);
    assert!((found - expected).abs() <= allowed, "{what}: {found}, expected {expected}, allowed {allowed:e}");
}
