//! Reads the reference cases of the ring and translates their sketch of an input into jobs of the contract.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    dead_code,
    unreachable_pub,
    reason = "test support, shared by several test files"
)]

use precut_calc::calculator::{Answer, Calculator, Check, Failure, Finding, Unwatched, Violations};
use precut_calc::ring_roundness::{Job, Outcome, RingRoundness, SearchSetting};
use serde_json::{Value, json};

/// A reference file.
pub fn reference(name: &str) -> Value {
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .join("tests/reference/ring-roundness")
        .join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap()
}

/// The job of a reference input.
pub fn translate(input: &Value) -> Value {
    let profile = &input["profile"];
    let waves: Vec<Value> = profile["harmonics"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|wave| {
            json!({ "order": wave["k"], "amplitude_um": wave["amplitude_um"], "angle_of_max_deg": wave["angle_of_max_deg"] })
        })
        .collect();
    json!({
        "ring": {
            "radius_mm": profile["R_mm"],
            "ellipticity_mm": profile.get("ellipse_e_mm").cloned().unwrap_or(json!(0.0)),
            "major_axis_deg": profile.get("ellipse_major_axis_deg").cloned().unwrap_or(json!(0.0)),
            "harmonics": waves
        },
        "supports": {
            "distance_mm": input["support_distance_L_mm"],
            "depth_mm": input["support_depth_H_mm"],
            "roller_radius_mm": input["support_roller_radius_mm"]
        },
        "tool": {
            "x_mm": input["tool_x_mm"],
            "y_mm": input["tool_y_start_mm"],
            "feed_direction_deg": input["feed_direction_deg"],
            "feed_mm_per_rev": input["feed_per_rev_mm"],
            "revolutions": input["revolutions"],
            "spark_out_revolutions": input["spark_out_revolutions"]
        },
        "compliance_ratio": input["compliance_ratio_K"],
        "samples": input["samples"]
    })
}

/// How many random set-ups a property is tried on: `PRECUT_RING_TRIALS`, or so many.
pub fn trials(in_the_suite: u64) -> u64 {
    std::env::var("PRECUT_RING_TRIALS").ok().and_then(|text| text.parse().ok()).unwrap_or(in_the_suite)
}

/// The same of properties that are tried on many.
pub fn cases(in_the_suite: u32) -> u32 {
    u32::try_from(trials(u64::from(in_the_suite))).unwrap_or(u32::MAX)
}

/// Faults of a job.
pub fn faults(job: &Value) -> Vec<Finding> {
    let job: Job = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec()
}

/// Codes of the faults of a job.
pub fn codes(job: &Value) -> Vec<&'static str> {
    faults(job).iter().map(|fault| fault.code).collect()
}

/// Checks, fills and runs a job.
pub fn try_run(job: &Value) -> Result<Answer<Outcome>, Failure> {
    let found = faults(job);
    assert!(found.is_empty(), "{found:?}");
    let mut job: Job = serde_json::from_value(job.clone()).unwrap();
    RingRoundness::fill(&mut job);
    RingRoundness::run(&job, &Unwatched)
}

/// The same where it must succeed.
pub fn run(job: &Value) -> Answer<Outcome> {
    try_run(job).unwrap_or_else(|e| panic!("{e}"))
}

/// Tip at the start and at the end of the feed, and half the distance of the supports: a round ring of the radius `first`
/// rests on them, and the tip stands at the angle `tool` on it; so it does after `travel`, when the supports stand at the half
/// angle `beta` below its centre.
pub fn ends_of_the_feed(first: f64, travel: f64, beta: f64, tool: f64, depth: f64) -> ([f64; 2], [f64; 2], f64) {
    let tip = |radius: f64, half: f64| {
        let centre = (radius * radius - half * half).sqrt() - depth;
        [radius * tool.cos(), centre + radius * tool.sin()]
    };
    let ends = |last: f64| {
        let half = last * beta.sin();
        (tip(first, half), tip(last, half), half)
    };
    let (mut low, mut high) = (1.0, first);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        let (start, end, _) = ends(middle);
        if f64::hypot(end[0] - start[0], end[1] - start[1]) > travel { low = middle } else { high = middle }
    }
    ends(low)
}

/// The setting advised as a job.
pub fn as_job(job: &Value, best: &SearchSetting) -> Value {
    let mut advised = job.clone();
    advised["analyses"] = json!(["simulation"]);
    advised["supports"]["distance_mm"] = json!(best.support_distance_mm);
    advised["supports"]["depth_mm"] = json!(best.support_depth_mm);
    advised["compliance_ratio"] = json!(best.compliance_ratio);
    advised["tool"] = json!({
        "x_mm": best.tool_x_mm, "y_mm": best.tool_y_mm, "feed_direction_deg": best.feed_direction_deg,
        "feed_mm_per_rev": best.feed_mm_per_rev, "revolutions": best.revolutions,
        "spark_out_revolutions": best.spark_out_revolutions
    });
    advised
}
