//! How sure a diameter is, against jobs solved with other forces and other compliances at the same command.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::support::{prepared, solved};
use precut_calc::calculator::{ForwardModel, Rows, Unwatched};
use precut_calc::deflection_compensation::{DeflectionCompensation, DeflectionPoint, DeflectionRun};
use serde_json::{Value, json};

/// Relative change of forces and compliances on either side.
const STEP: f64 = 1e-4;

/// A shaft between centres with everything that bends it, and what `more` adds or replaces.
fn job(length_mm: f64, diameter_mm: f64, more: &Value) -> Value {
    let term = |coefficient: f64| json!({ "coefficient": coefficient, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.3 });
    let centre = |z: f64| json!({ "kind": "centre", "z_mm": z, "compliance_um_per_n": 0.02 });
    let mut job = json!({
        "shaft": {
            "segments": [{ "length_mm": length_mm, "diameter_mm": diameter_mm, "stock_diameter_mm": diameter_mm + 1.0 }],
            "youngs_modulus_n_per_mm2": 210_000.0
        },
        "supports": [centre(0.0), centre(length_mm)],
        "carriage": { "compliance_um_per_n": 0.01, "tangential_compliance_um_per_n": 0.01 },
        "force": { "kind": "power_law", "passive": term(2430.0), "main": term(3000.0), "feed": term(2000.0) },
        "cut": { "feed_mm_per_rev": 0.2, "speed_m_per_min": 120.0 },
        "stations": { "kind": "list", "z_mm": [0.0, 0.25 * length_mm, 0.45 * length_mm, 0.6 * length_mm, length_mm] }
    });
    for (name, value) in more.as_object().unwrap() {
        match (name.as_str(), value.as_array()) {
            ("supports", Some(more)) => job["supports"].as_array_mut().unwrap().extend(more.iter().cloned()),
            _ => job[name] = value.clone(),
        }
    }
    job
}

/// The job with all forces multiplied.
pub(crate) fn with_force(job: &Value, factor: f64) -> Value {
    let mut job = job.clone();
    for component in ["passive", "main", "feed"] {
        if let Some(coefficient) = job.pointer_mut(&format!("/force/{component}/coefficient")) {
            *coefficient = json!(coefficient.as_f64().unwrap() * factor);
        }
    }
    job
}

/// The job with all compliances multiplied: of the shaft, of what holds it and of the carriage.
pub(crate) fn with_compliance(job: &Value, factor: f64) -> Value {
    let mut job = job.clone();
    let modulus = &mut job["shaft"]["youngs_modulus_n_per_mm2"];
    *modulus = json!(modulus.as_f64().unwrap() / factor);
    let multiply = |object: &mut Value, name: &str| {
        if let Some(value) = object[name].as_f64() {
            object[name] = json!(value * factor);
        }
    };
    for support in job["supports"].as_array_mut().unwrap() {
        multiply(support, "compliance_um_per_n");
    }
    multiply(&mut job["carriage"], "compliance_um_per_n");
    multiply(&mut job["carriage"], "tangential_compliance_um_per_n");
    job
}

/// Diameter deviations, um, with given commands.
pub(crate) fn cut_with(job: &Value, z: &[f64], commands: &[Option<f64>]) -> Vec<f64> {
    let row = |(z, d): (&f64, &Option<f64>)| json!({ "z_mm": z, "diameter_mm": d.unwrap() });
    let path: Vec<Value> = z.iter().zip(commands).map(row).collect();
    let run: DeflectionRun = serde_json::from_value(json!({ "commanded_path": path })).unwrap();
    let points = z.iter().map(|&z_mm| (0, DeflectionPoint { z_mm })).collect();
    let rows = Rows { runs: vec![run], points };
    let model =
        DeflectionCompensation::prepare(&prepared(job.clone()), &rows, "diameter_deviation_um", &Unwatched).unwrap();
    DeflectionCompensation::predict(&model, &[], &Unwatched).unwrap().into_iter().map(Result::unwrap).collect()
}

/// The uncertainty that the answer gives is the root of the squares of what 10 % of force and 10 % of compliance do.
fn assert_uncertainty(name: &str, job: &Value) {
    let stations = solved(job.clone()).stations;
    let slope = |with: fn(&Value, f64) -> Value| -> Vec<f64> {
        let at = |step: f64| cut_with(&with(job, 1.0 + step), &stations.z_mm, &stations.commanded_diameter_mm);
        at(STEP).into_iter().zip(at(-STEP)).map(|(more, less)| (more - less) / (2.0 * STEP)).collect()
    };
    let both = slope(with_force).into_iter().zip(slope(with_compliance));
    let found = stations.diameter_uncertainty_um.unwrap();
    for ((force, compliance), (z, found)) in both.zip(stations.z_mm.iter().zip(&found)) {
        let expected = 0.1 * force.hypot(compliance);
        let near = (found - expected).abs() <= 1e-4 * expected + 1e-6;
        assert!(near, "{name}, {z} mm: {found} instead of {expected} ({force} {compliance})");
    }
}

#[test]
fn force_and_stiffness_change_the_diameter_by_what_the_answer_says() {
    let rest = |z: f64, gap_um: f64| json!({ "kind": "steady_rest", "z_mm": z, "compliance_um_per_n": 0.01, "one_sided": true, "gap_um": gap_um });
    let gravity = |angle: f64| json!({ "include": { "weight": true }, "gravity": { "angle_deg": angle } });
    let mut held = gravity(-45.0);
    held["supports"] = json!([rest(675.0, 30.0), rest(1100.0, 5.0)]);
    held["include"]["axial_moment"] = json!(true);
    for (name, job) in [
        ("plain", job(1000.0, 40.0, &json!({}))),
        ("gravity toward the tool", job(1500.0, 40.0, &gravity(180.0))),
        ("slant bed", job(1500.0, 40.0, &gravity(-45.0))),
        ("a rest that touches", job(1000.0, 30.0, &json!({ "supports": [rest(450.0, 100.0)] }))),
        ("main force", job(200.0, 6.0, &json!({ "include": { "tangential": true } }))),
        ("feed force", job(300.0, 20.0, &json!({ "include": { "axial_moment": true } }))),
        ("everything", job(1500.0, 40.0, &held)),
    ] {
        assert_uncertainty(name, &job);
    }
}

/// Stated errors are no yielding: they make no difference.
#[test]
fn stated_errors_are_as_sure_as_they_are_stated() {
    let errors =
        json!([{ "kind": "tailstock_offset", "offset_um": 60.0 }, { "kind": "size_offset", "offset_um": 25.0 }]);
    assert_uncertainty("set off", &job(1000.0, 40.0, &json!({ "effects": errors })));
}
