//! The force models against the reference cases.
#![allow(clippy::unwrap_used, missing_docs)]

use precut_calc::calculator::Violations;
use precut_calc::force::{ForceModel, Forces};
use serde_json::{Value, json};

fn read(name: &str) -> Value {
    let path = format!("{}/tests/reference/deflection-compensation/{name}", concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// A term of the reference files in the words of the contract.
fn term(of: &Value) -> Value {
    if of.is_null() {
        return Value::Null;
    }
    json!({
        "coefficient": 10.0 * of["C"].as_f64().unwrap(),
        "depth_exponent": of["x"], "feed_exponent": of["y"], "speed_exponent": of["n"],
        "correction_factor": of["K"].as_f64().unwrap_or(1.0), "constant_n": of["P0"].as_f64().unwrap_or(0.0),
    })
}

/// A force of the reference files in the words of the contract.
fn translated(force: &Value) -> ForceModel {
    let job = match force["model"].as_str().unwrap() {
        "power" => json!({
            "kind": "power_law", "passive": term(&force["Py"]), "main": term(&force["Pz"]), "feed": term(&force["Px"]),
        }),
        "kienzle" => json!({
            "kind": "kienzle", "cutting_edge_angle_deg": force["kappa_deg"], "nose_radius_mm": force["r_eps"],
            "specific_cutting_force_n_per_mm2": force["kc11"], "cutting_exponent": force["mc"],
            "specific_normal_force_n_per_mm2": force["kn11"], "normal_exponent": force["mn"],
        }),
        "constant" => json!({
            "kind": "constant", "passive_n": force["Py"], "main_n": force["Pz"], "feed_n": force["Px"],
        }),
        other => unreachable!("{other}"),
    };
    serde_json::from_value(job).unwrap()
}

#[test]
fn every_reference_force_is_met() {
    let cases = read("forces.json");
    let cases = cases["cases"].as_array().unwrap();
    assert!(cases.len() > 20);
    let mut worst = 0.0_f64;
    for case in cases {
        let model = translated(&case["force"]);
        let mut violations = Violations::default();
        model.check("/force", &mut violations);
        assert!(violations.is_empty(), "{violations:?}");
        let number = |name: &str| case[name].as_f64().unwrap();
        let law = model.at(number("s"), number("v"));
        let Forces { passive_n, main_n, feed_n } = law.forces(number("t"));
        for (got, name) in [(passive_n, "Py"), (main_n, "Pz"), (feed_n, "Px")] {
            let expected = number(name);
            // At 90 degrees without a nose P_y is 0; the file holds the rounding of a cosine.
            let error = (got - expected).abs() / expected.abs().max(1e-3 * number("Pz"));
            assert!(error < 1e-9, "{name} of {case}: {got}");
            worst = worst.max(error);
        }
    }
    // What is left is rounding, and the quadrature of the file.
    assert!(worst < 1e-13, "{worst:e}");
}

#[test]
fn the_papers_example_gives_194_newton() {
    let term = json!({"coefficient": 2430.0, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.3});
    let model: ForceModel = serde_json::from_value(json!({"kind": "power_law", "passive": term})).unwrap();
    let speed = std::f64::consts::PI * 90.0 * 500.0 / 1000.0;
    let passive = model.at(0.5, speed).passive(0.5);
    assert!((passive - 194.514_761_116_527).abs() < 1e-10, "{passive}");
    assert!((model.depth_exponent().unwrap() - 0.9).abs() < 1e-15);
}
