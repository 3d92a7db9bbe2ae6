//! Path and time behind a tool that passes the shaft more than once.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::f64::consts::PI;

use crate::support::solved;
use serde_json::{Value, json};

/// As in the tests of single cuts; the force, 1e-9 N, moves this shaft by 1e-9 um at most.
const TOLERANCE_UM: f64 = 1e-7;

fn segment(length: f64, diameter: f64) -> Value {
    json!({ "length_mm": length, "diameter_mm": diameter, "stock_diameter_mm": 44.0 })
}

/// A chucked shaft under next to no force, fed to the headstock at 0.2 mm/rev and 500 rev/min unless a pass says more.
fn job(segments: &[Value], passes: &[Value], effects: &[Value]) -> Value {
    json!({
        "shaft": { "segments": segments, "youngs_modulus_n_per_mm2": 210_000.0 },
        "supports": [{ "kind": "chuck", "z_mm": 0.0 }],
        "force": { "kind": "constant", "passive_n": 1e-9 },
        "cut": { "feed_mm_per_rev": 0.2, "spindle_speed_rpm": 500 },
        "stations": { "kind": "list", "z_mm": [100.0, 300.0] },
        "passes": passes,
        "effects": effects,
        "conditions": { "tool_path_at_start_m": 50.0, "warm_time_at_start_min": 2.0 }
    })
}

fn wear() -> Value {
    json!({ "kind": "tool_wear", "rate_um_per_km": 100.0 })
}

fn growth() -> Value {
    json!({ "kind": "thermal_growth", "growth_um": 20.0, "time_constant_min": 5.0 })
}

fn heating() -> Value {
    json!({ "kind": "workpiece_heating", "temperature_rise_k": 10.0, "time_constant_min": 5.0, "expansion_um_per_m_k": 12.0 })
}

/// Errors of the passes, um on the diameter, against e(pass, station) on the radius.
fn assert_passes(job: Value, error_um: impl Fn(usize, f64) -> f64) {
    let passes = solved(job).passes;
    for (k, pass) in passes.iter().enumerate() {
        for (z, found) in [100.0, 300.0].into_iter().zip(&pass.diameter_error_um) {
            let expected = 2.0 * error_um(k, z);
            assert!((found - expected).abs() < TOLERANCE_UM, "pass {k}, z {z}: {found} instead of {expected}");
        }
    }
}

/// Path over a length, m.
fn path_m(diameter: f64, length: f64, feed: f64) -> f64 {
    PI * diameter * length / (1000.0 * feed)
}

#[test]
fn an_edge_wears_on_and_a_machine_stays_warm_from_pass_to_pass() {
    let shaft = [segment(400.0, 30.0)];
    let passes = [json!({ "diameter_mm": 36.0 }), json!({ "diameter_mm": 32.0 }), json!({ "diameter_mm": 30.0 })];
    let diameters = [36.0, 32.0, 30.0];
    let before = |k: usize| diameters[..k].iter().map(|d| path_m(*d, 400.0, 0.2)).sum::<f64>();
    assert_passes(job(&shaft, &passes, &[wear()]), |k, z| {
        0.1 * (50.0 + before(k) + path_m(diameters[k], 400.0 - z, 0.2))
    });
    // 100 mm/min: four minutes a pass.
    let minutes = |k: usize, z: f64| 4.0 * k as f64 + (400.0 - z) / 100.0;
    assert_passes(job(&shaft, &passes, &[growth()]), |k, z| 20.0 * (-(2.0 + minutes(k, z)) / 5.0).exp_m1());
    // One blank: it was cold when the first pass began, whatever the machine was.
    assert_passes(job(&shaft, &passes, &[heating()]), |k, z| {
        1e3 * diameters[k] / 2.0 * 12e-6 * 10.0 * (-minutes(k, z) / 5.0).exp_m1()
    });
}

#[test]
fn every_pass_has_its_own_feed_and_speed() {
    let shaft = [segment(400.0, 30.0)];
    let rough = json!({ "diameter_mm": 32.0, "feed_mm_per_rev": 0.4, "speed_m_per_min": 80.0 });
    let passes = [rough, json!({ "diameter_mm": 30.0 })];
    let rough_m = |length: f64| path_m(32.0, length, 0.4);
    assert_passes(job(&shaft, &passes, &[wear()]), |k, z| {
        let cut = if k == 0 { rough_m(400.0 - z) } else { rough_m(400.0) + path_m(30.0, 400.0 - z, 0.2) };
        0.1 * (50.0 + cut)
    });
    assert_passes(job(&shaft, &passes, &[growth()]), |k, z| {
        let minutes = if k == 0 { rough_m(400.0 - z) / 80.0 } else { rough_m(400.0) / 80.0 + (400.0 - z) / 100.0 };
        20.0 * (-(2.0 + minutes) / 5.0).exp_m1()
    });
    let found = solved(job(&shaft, &passes, &[])).cutting_time_min;
    assert!((found - rough_m(400.0) / 80.0 - 4.0).abs() < 1e-12, "{found}");
}

#[test]
fn a_pass_counts_what_it_cuts() {
    // The first pass reaches the drawing of the thick end; the second cuts the thin end alone, and passes the other
    // at its drawing diameter without cutting: what the first pass left there stays.
    let shaft = [segment(200.0, 40.0), segment(200.0, 30.0)];
    let passes = [json!({ "diameter_mm": 36.0 }), json!({ "diameter_mm": 30.0 })];
    let first_m = path_m(40.0, 200.0, 0.2) + path_m(36.0, 200.0, 0.2);
    let mut stepped = job(&shaft, &passes, &[wear()]);
    stepped["cut"]["feed_direction"] = json!("to_tailstock");
    assert_passes(stepped, |k, z| {
        let cut = match (k, z > 200.0) {
            (_, false) => path_m(40.0, z, 0.2),
            (0, true) => path_m(40.0, 200.0, 0.2) + path_m(36.0, z - 200.0, 0.2),
            (_, true) => first_m + path_m(30.0, z - 200.0, 0.2),
        };
        0.1 * (50.0 + cut)
    });
    let found = solved(job(&shaft, &passes, &[])).cutting_time_min;
    assert!((found - 6.0).abs() < 1e-12, "{found}: four minutes of roughing, two of the thin end");
}
