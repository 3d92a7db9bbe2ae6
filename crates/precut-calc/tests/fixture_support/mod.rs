//! Shared by the tests of fixture stability: the reference's cases as jobs of the contract.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used, clippy::panic, missing_docs)]

pub(crate) mod semi;

use std::path::Path;

use precut_calc::calculator::{Answer, Calculator, Check, Message, Unwatched, Violations};
use precut_calc::fixture_stability::{FixtureJob, FixtureOutcome, FixtureStability};
use serde_json::{Value, json};

pub fn reference(file: &str) -> Value {
    let path =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("tests/reference/fixture-stability").join(file);
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// A job of the contract from the `input` of a reference case.
pub fn translate(input: &Value) -> Value {
    let (cutter, cutting, regime, fixture) = (&input["cutter"], &input["cutting"], &input["regime"], &input["fixture"]);
    let joint = |n: u8| {
        json!({
            "stiffness_n_per_mm": fixture[format!("C{n}_N_mm")],
            "damping_n_s_per_mm": fixture[format!("lambda{n}_N_s_mm")],
        })
    };
    let mut vise = json!({
        "kind": if fixture["type"] == 1 { "self_locking" } else { "constant_force" },
        "workpiece_mass_kg": fixture["m_kg"],
        "movable_joint": joint(1),
        "fixed_joint": joint(2),
    });
    if !fixture["m3_kg"].is_null() {
        vise["jaw_mass_kg"] = fixture["m3_kg"].clone();
    }
    if !fixture["clamp_force_N"].is_null() {
        vise["clamp_force_n"] = fixture["clamp_force_N"].clone();
    }
    let toward = if regime["feed_toward"] == "fixed" { "fixed_jaw" } else { "movable_jaw" };
    json!({
        "cutter": { "diameter_mm": cutter["diameter_mm"], "teeth": cutter["teeth"] },
        "force": {
            "coefficient": cutting["Cp"], "chip_thickness_exponent": cutting["k"], "depth_exponent": cutting["mu"],
            "radial_ratio": cutter["radial_ratio"],
        },
        "cut": {
            "width_mm": regime["width_mm"], "offset_mm": regime.get("offset_mm").unwrap_or(&json!(0)),
            "depth_mm": regime["depth_mm"], "spindle_speed_rpm": regime["spindle_rpm"],
            "feed_mm_per_tooth": regime["feed_per_tooth_mm"], "feed_toward": toward,
        },
        "fixture": vise,
    })
}

/// The job of an example.
pub fn example(id: &str) -> Value {
    let example = FixtureStability::META.examples.iter().find(|example| example.id == id).unwrap();
    serde_json::from_str(example.job).unwrap()
}

/// The explanation of that code, where it is given.
pub fn said<'a, O>(answer: &'a Answer<O>, code: &str) -> Option<&'a Message> {
    answer.explanation.iter().find(|said| said.code == code)
}

/// Teeth, speed, depth and the rest of the reference fixture, type 1 or 2.
pub fn reference_job(kind: u8) -> Value {
    let case = reference("cases.json")
        .as_array()
        .unwrap()
        .iter()
        .find(|c| c["id"] == format!("S0{}", 7 + kind))
        .unwrap()
        .clone();
    translate(&case["input"])
}

pub fn checked(job: &Value) -> Result<FixtureJob, Vec<(String, String)>> {
    let mut job: FixtureJob = serde_json::from_value(job.clone()).unwrap_or_else(|e| panic!("{e}: {job}"));
    let mut violations = Violations::default();
    job.check(&mut violations);
    let faults = violations.into_vec();
    if faults.is_empty() {
        FixtureStability::fill(&mut job);
        Ok(job)
    } else {
        Err(faults.into_iter().map(|f| (f.code.to_owned(), f.pointer)).collect())
    }
}

pub fn solve(job: &Value) -> Answer<FixtureOutcome> {
    let checked = checked(job).unwrap_or_else(|faults| panic!("{faults:?}: {job}"));
    FixtureStability::run(&checked, &Unwatched).unwrap_or_else(|e| panic!("{e}: {job}"))
}

pub fn outcome(job: &Value) -> FixtureOutcome {
    solve(job).output
}

/// The same job with one more field, by pointer; missing objects are made.
pub fn with(job: &Value, pointer: &str, value: Value) -> Value {
    let mut job = job.clone();
    let mut at = &mut job;
    for part in pointer.trim_start_matches('/').split('/') {
        at = if let Ok(index) = part.parse::<usize>() {
            &mut at[index]
        } else {
            if at.is_null() {
                *at = json!({});
            }
            &mut at[part]
        };
    }
    *at = value;
    job
}
