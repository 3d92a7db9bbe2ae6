//! The reference's impossible feed schedules: each is refused at its field, among whatever else is wrong.

#[path = "../../crates/precut-calc/tests/feed_support/mod.rs"]
mod feed_support;

use feed_support::{reference, renamed, translate};
use precut::engine::{Body, Error, Given, check_now};
use precut::registry::Registry;
use serde_json::{Value, json};

/// Code and pointer of every fault, each with a text.
fn faults(registry: &Registry, job: &Value) -> Vec<(String, String)> {
    match check_now(registry, "feed-schedule", Body::Json(job.to_string().into()), &Given::default()) {
        Err(Error::Invalid { findings, .. }) => findings.into_iter().map(|f| (f.code.to_owned(), f.pointer)).collect(),
        Err(error) => panic!("{error:?}"),
        Ok(_) => panic!("accepted: {job}"),
    }
}

/// `zones[1].z_end_mm` of the sketch as a pointer of the contract.
fn pointer(path: &str) -> String {
    path.split('.')
        .map(|part| match part.split_once('[') {
            Some((name, index)) => format!("/{}/{}", renamed(name), index.trim_end_matches(']')),
            None => format!("/{}", renamed(part)),
        })
        .collect()
}

fn patched(job: &Value, changes: &Value) -> Value {
    let mut job = job.clone();
    for (path, value) in changes.as_object().unwrap() {
        let at = pointer(path);
        *job.pointer_mut(&at).unwrap_or_else(|| panic!("{at}")) = value.clone();
    }
    job
}

#[test]
fn every_impossible_job_is_refused_at_its_field() {
    let registry = Registry::standard().unwrap();
    let file = reference("invalid.json");
    let mut base = translate(&reference(file["base"].as_str().unwrap())["input"]);
    base["limits"]["feed_step_ratio_max"] = json!(1.2);
    base["limits"]["deflection_residual_fraction"] = json!(1.0);
    assert!(check_now(&registry, "feed-schedule", Body::Json(base.to_string().into()), &Given::default()).is_ok());
    for case in file["cases"].as_array().unwrap() {
        let (name, at) = (case["name"].as_str().unwrap(), pointer(case["field"].as_str().unwrap()));
        let found = faults(&registry, &patched(&base, &case["patch"]));
        assert!(
            found.iter().any(|(_, p)| *p == at || p.starts_with(&format!("{at}/"))),
            "{name}: nothing at {at} among {found:?}"
        );
    }
}

/// What the reference does not list: each with its code, where it belongs.
#[test]
fn other_impossible_jobs() {
    let registry = Registry::standard().unwrap();
    let base = translate(&reference("multi-zone-time.json")["input"]);
    let set = |at: &str, value: Value| {
        let (parent, key) = at.rsplit_once('/').unwrap();
        let mut job = base.clone();
        let parent = job.pointer_mut(parent).unwrap();
        match parent {
            Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
            other => other[key] = value,
        }
        job
    };
    let without = |at: &str| {
        let (parent, key) = at.rsplit_once('/').unwrap();
        let mut job = base.clone();
        job.pointer_mut(parent).unwrap().as_object_mut().unwrap().remove(key);
        job
    };
    let custom = |fields: Value| set("/custom", json!([fields]));
    for (job, code, at) in [
        (set("/zones/2/z_start_mm", json!(300.0)), "zones_overlap", "/zones/2"),
        (set("/zones/3/id", json!("z1")), "duplicate_zone", "/zones/3/id"),
        (without("/models/force_y"), "model_missing", "/models/force_y"),
        (without("/models/tool_life"), "model_missing", "/models/tool_life"),
        (without("/models/force_z"), "model_missing", "/models/force_z"),
        (without("/cutting_edge_angle_deg"), "edge_angle_missing", "/cutting_edge_angle_deg"),
        (without("/limits"), "limits_missing", "/limits"),
        (without("/shaft"), "compliance_missing", "/shaft"),
        (set("/models/force_y/form", json!("semi_log")), "model_not_convex", "/models/force_y"),
        (set("/models/force_y/feed_exponent", json!(1e4)), "absurd_exponent", "/models/force_y/feed_exponent"),
        (
            set("/machine/spindle_speed_min_rpm", json!(3000.0)),
            "contradictory_limits",
            "/machine/spindle_speed_min_rpm",
        ),
        (set("/limits/speed_min_m_per_min", json!(90.0)), "contradictory_limits", "/limits/speed_min_m_per_min"),
        (custom(json!({ "name": "a", "zone": "z9", "max": 1.0 })), "unknown_zone", "/custom/0/zone"),
        (custom(json!({ "name": "a" })), "limit_without_bound", "/custom/0"),
        (custom(json!({ "name": "a", "max": 1.0, "min": 2.0 })), "contradictory_limits", "/custom/0/min"),
        (
            custom(json!({ "name": "a", "max": 1.0, "speed_exponent": 1e6 })),
            "absurd_exponent",
            "/custom/0/speed_exponent",
        ),
        (set("/models/library", json!("vt99")), "unknown_model_set", "/models/library"),
        (set("/variables", json!({ "speed": "fixed" })), "fixed_value_missing", "/variables/fixed_speed_m_per_min"),
        (
            set(
                "/supports",
                json!([{ "kind": "centre", "z_mm": 0.0 }, { "kind": "steady_rest", "z_mm": 600.0, "one_sided": true }, { "kind": "centre", "z_mm": 1200.0 }]),
            ),
            "one_sided_rest",
            "/supports/1",
        ),
        (
            set(
                "/passes",
                json!({ "total_depth_mm": 9.0, "depth_min_mm": 0.5, "depth_max_mm": 1.0, "roughing_passes_max": 2 }),
            ),
            "bad_pass_depths",
            "/passes/total_depth_mm",
        ),
    ] {
        let found = faults(&registry, &job);
        assert!(found.iter().any(|(c, p)| c == code && p == at), "{code} at {at} is not among {found:?}");
    }
}
