//! The catalogue of the ring and its forward model, against a trace of an independent generator.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{ForwardModel, PrepareError, Rows, Unwatched};
use precut_calc::effects::{RING_CAUSES, RingEffect};
use precut_calc::ring_roundness::{Job, RingAllowances, RingPoint, RingRoundness, RingRun};
use serde_json::{Value, json};

fn trace() -> Value {
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .join("tests/reference/diagnosis/example-roundness-roller_runout.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The short job of the trace in the terms of the contract.
fn translated(short: &Value) -> Job {
    let at = |name: &str, i: usize| short[name][i].as_f64().unwrap();
    let (x, y) = (at("tool_start_mm", 0), at("tool_start_mm", 1));
    serde_json::from_value(json!({
        "ring": {
            "radius_mm": short["radius_mm"],
            "harmonics": [{ "order": 2, "amplitude_um": short["initial_ovality_mm"].as_f64().unwrap() * 500.0 }]
        },
        "supports": { "distance_mm": 2.0 * at("support_b_mm", 0), "depth_mm": -at("support_b_mm", 1) },
        "tool": {
            "x_mm": x, "y_mm": y,
            "feed_direction_deg": y.atan2(x).to_degrees() + 180.0,
            "feed_mm_per_rev": short["feed_mm_per_rev"],
            "revolutions": short["infeed_revolutions"],
            "spark_out_revolutions": short["spark_out_revolutions"]
        }
    }))
    .unwrap()
}

fn rows(measurements: &Value) -> (Rows<RingRun, RingPoint>, Vec<f64>) {
    let measured = measurements.as_array().unwrap();
    let points = measured.iter().map(|m| (0, RingPoint { angle_deg: m["angle_deg"].as_f64().unwrap() })).collect();
    let values = measured.iter().map(|m| m["radial_deviation_um"].as_f64().unwrap()).collect();
    (Rows { runs: vec![RingRun::default()], points }, values)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|v| v * v).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn the_true_cause_explains_the_trace_of_another_model() {
    let case = trace();
    let job = translated(&case["job"]);
    let (rows, values) = rows(&case["measurements"]);
    let prepared = RingRoundness::prepare(&job, &rows, "radial_deviation_um", &Unwatched).unwrap();
    let left = |effects: &[RingEffect]| {
        let predicted = RingRoundness::predict(&prepared, effects, &Unwatched).unwrap();
        rms(values.iter().zip(&predicted).map(|(y, p)| y - p.unwrap()))
    };
    let truth: Vec<RingEffect> = case["answer"]["effects"]
        .as_array()
        .unwrap()
        .iter()
        .map(|effect| {
            let mut object = effect["params"].clone();
            object["kind"] = effect["cause"].clone();
            serde_json::from_value(object).unwrap()
        })
        .collect();
    let sigma = case["answer"]["sigma_um"].as_f64().unwrap();
    // 720 points: the scatter of the rms is sigma/sqrt(1440), 3 %; the trace's own numerics add some tenths of a um.
    let (base, with) = (left(&[]), left(&truth));
    assert!(with < 1.12 * sigma, "with the cause {with} um are left, the noise is {sigma}");
    assert!(base > 3.0 * sigma, "without it {base}");
}

#[test]
fn nuisances_and_jacobian_are_derivatives() {
    let case = trace();
    let mut job = translated(&case["job"]);
    (job.tool.revolutions, job.tool.spark_out_revolutions) = (12.0, 1.0);
    let points = (0..36).map(|i| (0, RingPoint { angle_deg: 10.0 * f64::from(i) })).collect();
    let rows = Rows { runs: vec![RingRun::default()], points };
    let prepared = RingRoundness::prepare(&job, &rows, "radial_deviation_um", &Unwatched).unwrap();
    let columns = RingRoundness::nuisances(&prepared, &[], &RingAllowances::default(), &Unwatched).unwrap();
    assert_eq!(columns.len(), 5);
    assert!(columns.iter().all(|column| column.len() == 36 && column.iter().all(|v| v.is_finite())));
    // A wave of the blank where nothing has been cut yet comes through as it is: derivative cos(3θ) per mm, in um.
    job.tool.y_mm += 0.5;
    job.tool.revolutions = 1.0;
    let prepared = RingRoundness::prepare(&job, &rows, "radial_deviation_um", &Unwatched).unwrap();
    let cause = RING_CAUSES.iter().find(|cause| cause.kind == "initial_harmonic").unwrap();
    let jacobian = RingRoundness::jacobian(&prepared, &[(cause, vec![0.0, 0.0, 3.0])], &[(0, 0)]).unwrap();
    for (i, slope) in (0_u32..).zip(&jacobian[0]) {
        let expected = 1e3 * (3.0 * (10.0 * f64::from(i)).to_radians()).cos();
        assert!((slope - expected).abs() < 1e-3 * 1e3, "{i}: {slope} {expected}");
    }
}

#[test]
fn every_kind_stands_in_the_catalogue_and_comes_from_its_parameters() {
    for cause in RING_CAUSES {
        let values: Vec<f64> = cause.parameters.iter().map(|p| (0.5 * p.prior_sd).clamp(p.lower, p.upper)).collect();
        let effect = RingEffect::from_parameters(cause, &values).unwrap_or_else(|| panic!("{}", cause.kind));
        assert_eq!(effect.kind(), cause.kind);
        let object = serde_json::to_value(&effect).unwrap();
        assert_eq!(object["kind"], cause.kind);
        for parameter in cause.parameters {
            assert!(!object[parameter.name].is_null(), "{}: {}", cause.kind, parameter.name);
        }
    }
}

#[test]
fn rows_of_no_run_and_unknown_quantities_are_refused() {
    let job = translated(&trace()["job"]);
    let rows = Rows { runs: vec![], points: vec![(0, RingPoint { angle_deg: 0.0 })] };
    match RingRoundness::prepare(&job, &rows, "wobble", &Unwatched) {
        Err(PrepareError::Invalid(faults)) => {
            assert_eq!(faults.iter().map(|f| f.code).collect::<Vec<_>>(), ["unknown_quantity", "unknown_run"]);
        }
        _ => panic!("accepted"),
    }
}

/// Objects as the contract prints them.
#[test]
fn effect_objects_are_those_of_the_contract() {
    for text in [
        r#"{"kind": "initial_harmonic", "order": 3, "amplitude_mm": 0.02, "phase_rad": 1.0}"#,
        r#"{"kind": "tool_off_line", "tangential_offset_mm": 0.5}"#,
        r#"{"kind": "support_position", "support_b_shift_mm": 0.3}"#,
        r#"{"kind": "support_wear", "recession_um_per_rev": 0.1}"#,
        r#"{"kind": "roller_runout", "amplitude_mm": 0.005, "ratio": 5.0, "phase_rad": 0.3}"#,
        r#"{"kind": "tool_push_off", "push_off_ratio": 0.4}"#,
        r#"{"kind": "spark_out_missing", "spark_out_revolutions": 0}"#,
        r#"{"kind": "chatter_harmonic", "amplitude_mm": 0.001, "waves_per_revolution": 23}"#,
        r#"{"kind": "work_slip", "slip_deg_per_rev": 0.5}"#,
    ] {
        serde_json::from_str::<RingEffect>(text).unwrap_or_else(|e| panic!("{text}: {e}"));
    }
}

/// Opposite to A a slow wave of the support comes out with the size that the geometry gives: the tool makes the
/// diameter, so a support that moves in by s lets the tool cut s deeper, shared by the two ends.
#[test]
fn wear_makes_the_ring_larger() {
    let case = trace();
    let mut job = translated(&case["job"]);
    job.tool.spark_out_revolutions = 0.0;
    let rows = Rows {
        runs: vec![RingRun::default()],
        points: (0..360).map(|i| (0, RingPoint { angle_deg: f64::from(i) })).collect(),
    };
    let prepared = RingRoundness::prepare(&job, &rows, "radius_mm", &Unwatched).unwrap();
    let mean = |effects: &[RingEffect]| {
        RingRoundness::predict(&prepared, effects, &Unwatched).unwrap().iter().map(|p| p.unwrap()).sum::<f64>() / 360.0
    };
    let (base, worn) = (mean(&[]), mean(&[RingEffect::SupportWear { recession_um_per_rev: 1.0 }]));
    // A recedes 96 um along the line to the tip by the end, the ring being cut all round: half of it on the radius, at
    // most half a revolution earlier.
    assert!((worn - base - 0.048).abs() < 0.001, "{base} {worn}");
}
