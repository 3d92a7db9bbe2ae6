//! The reference cases of the deflection calculator, in full.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::support::{Tolerance, cases, expected, reference, scaled, scaled_gaps, solved, translate};
use precut_calc::deflection_compensation::Outcome;
use serde_json::{Value, json};

const UM: f64 = 1e-3;

/// Every list that a case may expect, and where it stands in the answer.
fn lists(outcome: &Outcome) -> Vec<(&'static str, Vec<Option<f64>>)> {
    let s = &outcome.stations;
    // Without a formula (one-sided rests) there is nothing to compare, and no case expects it.
    let one = outcome.one_step.clone().unwrap_or_default();
    let zeros = || vec![0.0; s.z_mm.len()];
    let depth_commanded: Vec<Option<f64>> = s
        .commanded_diameter_mm
        .iter()
        .zip(&s.stock_diameter_mm)
        .map(|(x, stock)| x.map(|x| (stock - x) / 2.0))
        .collect();
    vec![
        ("compliance_work", scaled(s.work_compliance_um_per_n.as_ref().unwrap(), UM)),
        ("compliance", scaled(&s.compliance_um_per_n, UM)),
        ("depth_nominal", scaled(&s.depth_mm, 1.0)),
        ("Py_nominal", scaled(&s.passive_force_n, 1.0)),
        ("Pz_nominal", scaled(&s.main_force_n.clone().unwrap_or_else(zeros), 1.0)),
        ("Px_nominal", scaled(&s.feed_force_n.clone().unwrap_or_else(zeros), 1.0)),
        ("y_nominal", scaled(&s.deflection_um, UM)),
        ("z_nominal", scaled(&s.tangential_deflection_um.clone().unwrap_or_else(zeros), UM)),
        ("depth_uncompensated", s.depth_uncompensated_mm.clone().unwrap()),
        ("diameter_error_uncompensated", scaled_gaps(&s.diameter_error_uncompensated_um, UM)),
        ("depth_commanded", depth_commanded),
        ("diameter_commanded", s.commanded_diameter_mm.clone()),
        ("offset_radial", scaled_gaps(s.offset_um.as_ref().unwrap(), UM)),
        ("paper_i", one.factor.clone()),
        ("paper_depth", one.depth_mm.clone()),
        ("paper_diameter_error_engaged", scaled_gaps(&one.diameter_error_um, UM)),
        ("paper_residual_commanded_model", scaled_gaps(&one.residual_commanded_model_um, UM)),
        ("depth_commanded_commanded_model", one.depth_commanded_model_mm.clone()),
    ]
}

fn names(list: &Value) -> Vec<String> {
    list.as_array().unwrap().iter().map(|s| s.as_str().unwrap().to_owned()).collect()
}

fn check_case(case: &Value) {
    let id = case["id"].as_str().unwrap();
    let outcome = solved(translate(&case["input"]));
    let tolerance = Tolerance::of(case);
    let mut compared = 0;
    for (key, found) in lists(&outcome) {
        if let Some(expected) = expected(case, key) {
            tolerance.assert(&format!("{id}: {key}"), &found, &expected);
            compared += 1;
        }
    }
    if let Some(expected) = expected(case, "copying_factor")
        && case["expected"].get("passes").is_none()
    {
        // A central difference made the reference: 1e-6.
        Tolerance { rel: 0.0, abs: 1e-6 }.assert(
            &format!("{id}: copying"),
            outcome.stations.copying_factor.as_ref().unwrap(),
            &expected,
        );
        compared += 1;
    }
    if let Some(form_error) = case["expected"]["form_error"].as_f64() {
        tolerance.assert(&format!("{id}: form error"), &[outcome.form_error_um.map(|f| f * UM)], &[Some(form_error)]);
    }
    let class = case["form"]["form"].as_str().or(case["expected"]["form"].as_str());
    if let Some(class) = class {
        assert_eq!(serde_json::to_value(outcome.before.class).unwrap(), json!(class), "{id}: class");
    }
    if let Some(extrema) = case["form"]["extrema"].as_array() {
        let found: Vec<Value> = outcome
            .before
            .extrema
            .iter()
            .map(|e| json!([if json!(e.kind) == "maximum" { "max" } else { "min" }, e.z_mm]))
            .collect();
        assert_eq!(&found, extrema, "{id}: extrema");
        let threshold = case["form"]["threshold"].as_f64();
        tolerance.assert(&format!("{id}: threshold"), &[outcome.before.hysteresis_um.map(|h| h * UM)], &[threshold]);
    }
    for (key, found) in [
        ("status_uncompensated", json!(outcome.stations.status_uncompensated)),
        ("status_compensated", json!(outcome.stations.status_compensated)),
    ] {
        if let Some(expected) = case["expected"].get(key) {
            assert_eq!(names(&found), names(expected), "{id}: {key}");
        }
    }
    assert!(compared > 0 || case["expected"].get("passes").is_some(), "{id}: nothing was compared");
}

#[test]
fn the_papers_example_with_all_five_splits() {
    for case in cases("paper-example.json") {
        check_case(&case);
    }
}

#[test]
fn complete_cases_agree_with_multiprecision() {
    for case in cases("full-cases.json") {
        check_case(&case);
    }
}

#[test]
fn impossible_cases_are_named() {
    for case in cases("no-solution.json") {
        check_case(&case);
    }
}

#[test]
fn closed_forms_through_the_whole_calculator() {
    for case in cases("closed-forms.json") {
        let id = case["id"].as_str().unwrap();
        let quantity = case["quantity"].as_str().unwrap();
        let outcome = solved(translate(&case["input"]));
        let expected = expected(&case, quantity).unwrap();
        let most = expected.iter().flatten().fold(0.0_f64, |m, e| m.max(e.abs()));
        let mut tolerance = Tolerance::of(&case);
        tolerance.abs = tolerance.abs.max(case["tolerance"]["abs_fraction_of_max"].as_f64().unwrap_or(0.0) * most);
        let (_, found) = lists(&outcome).into_iter().find(|(key, _)| *key == quantity).unwrap();
        tolerance.assert(&format!("{id}: {quantity}"), &found, &expected);
    }
}

#[test]
fn passes_copy_what_the_pass_before_left() {
    for case in cases("two-pass.json") {
        let id = case["id"].as_str().unwrap();
        // Every pass meets what the moves of the one before have left: as fine as they get here.
        let mut job = translate(&case["input"]);
        job["path"] = json!({ "chord_tolerance_um": 0.0, "increment_um": 0.001 });
        let outcome = solved(job);
        // A command is off by half of the control's step, 0.5e-6 mm on the diameter, and so may the pass before be.
        let exact = Tolerance::of(&case);
        let tolerance = Tolerance { abs: exact.abs.max(1e-6), ..exact };
        let passes = case["expected"]["passes"].as_array().unwrap();
        assert_eq!(outcome.passes.len(), passes.len(), "{id}");
        for (k, (found, expected)) in outcome.passes.iter().zip(passes).enumerate() {
            let list = |key: &str| -> Vec<Option<f64>> {
                expected[key].as_array().unwrap().iter().map(Value::as_f64).collect()
            };
            let at = |key: &str| format!("{id}: pass {k}: {key}");
            tolerance.assert(&at("diameter"), &scaled(&found.produced_diameter_mm, 1.0), &list("diameter"));
            tolerance.assert(&at("error"), &scaled(&found.diameter_error_um, UM), &list("diameter_error"));
            tolerance.assert(&at("command"), &found.commanded_diameter_mm, &list("diameter_commanded"));
            Tolerance { rel: 0.0, abs: 1e-6 }.assert(&at("copying"), &found.copying_factor, &list("copying_factor"));
            // At the stations of the case as there; along the whole path there may be more between them.
            let errors = || found.diameter_error_um.iter().copied();
            let at_stations = errors().fold(f64::NEG_INFINITY, f64::max) - errors().fold(f64::INFINITY, f64::min);
            tolerance.assert(&at("form"), &[Some(at_stations * UM)], &[expected["form_error"].as_f64()]);
            assert!(found.form_error_um >= at_stations * (1.0 - 1e-12), "{}", at("form"));
        }
        // The case's own copying factor is that of one uncompensated cut from the blank to the drawing.
        let copying = expected(&case, "copying_factor").unwrap();
        let mut input = case["input"].clone();
        input.as_object_mut().unwrap().remove("passes");
        let outcome = solved(translate(&input));
        let found = outcome.stations.copying_factor.unwrap();
        Tolerance { rel: 0.0, abs: 1e-6 }.assert(&format!("{id}: copying"), &found, &copying);
    }
}

/// One station on a uniform shaft whose deflection is k t^z: a chuck alone, tool at the free end.
#[test]
fn scalar_equation_in_both_models() {
    for case in cases("fixed-point.json") {
        let z = case["z"].as_f64().unwrap();
        let k = case["k_mm_per_mm^z"].as_f64().unwrap();
        let a = case["depth_nominal"].as_f64().unwrap();
        // The carriage alone yields: 1 um/N against k N/mm^z gives k mm.
        let outcome = solved(json!({
            "shaft": { "segments": [{ "length_mm": 100.0, "diameter_mm": 100.0, "stock_diameter_mm": 100.0 + 2.0 * a }],
                       "youngs_modulus_n_per_mm2": 2e6 },
            "supports": [{ "kind": "centre", "z_mm": 0.0 }, { "kind": "centre", "z_mm": 100.0 }],
            "carriage": { "compliance_um_per_n": 1.0 },
            "force": { "kind": "power_law", "passive": { "coefficient": 1000.0 * k, "depth_exponent": z, "feed_exponent": 0.0, "speed_exponent": 0.0 } },
            "cut": { "feed_mm_per_rev": 1.0, "speed_m_per_min": 100.0 },
            "stations": { "kind": "list", "z_mm": [0.0] },
            "compare_one_step": true
        }));
        let tolerance = Tolerance { rel: 1e-9, abs: 1e-12 };
        let one = |v: &[Option<f64>]| v[0];
        let s = &outcome.stations;
        let commanded = s.commanded_diameter_mm[0].map(|x| 50.0 + a - x / 2.0);
        for (key, found) in [
            ("y_nominal", Some(s.deflection_um[0] * UM)),
            ("command_exact", commanded),
            ("engaged_depth_uncompensated", one(s.depth_uncompensated_mm.as_ref().unwrap())),
            ("paper_i", one(&outcome.one_step.as_ref().unwrap().factor)),
            ("paper_depth", one(&outcome.one_step.as_ref().unwrap().depth_mm)),
            ("paper_overcut_radial", one(&outcome.one_step.as_ref().unwrap().diameter_error_um).map(|e| -e * UM / 2.0)),
            ("command_commanded_model", one(&outcome.one_step.as_ref().unwrap().depth_commanded_model_mm)),
            ("copying_factor_at_uncompensated", one(s.copying_factor.as_ref().unwrap())),
        ] {
            assert!(case.get(key).is_some(), "the case has no {key}");
            // Round-off of radii of 50 mm against depths of 0.5 mm: 1e-14 absolute.
            tolerance.assert(&format!("z {z} k {k}: {key}"), &[found], &[case[key].as_f64()]);
        }
    }
}

#[test]
fn forms_and_their_sizes_on_symmetric_centres() {
    for case in cases("form-classes.json") {
        let n = |key: &str| case[key].as_f64().unwrap();
        let (l, d) = (n("l"), n("d"));
        let outcome = solved(json!({
            "shaft": { "segments": [{ "length_mm": l, "diameter_mm": d, "stock_diameter_mm": 2.0 * d }], "youngs_modulus_n_per_mm2": 210_000.0 },
            "supports": [
                { "kind": "centre", "z_mm": 0.0, "compliance_um_per_n": 1e3 * n("w_h") },
                { "kind": "centre", "z_mm": l, "compliance_um_per_n": 1e3 * n("w_t") }
            ],
            "force": { "kind": "constant", "passive_n": n("Py_constant") },
            "cut": { "feed_mm_per_rev": 0.1, "speed_m_per_min": 100.0 },
            "stations": { "kind": "per_zone", "count": case["stations"] }
        }));
        let beta = n("beta");
        assert_eq!(json!(outcome.before.class), case["form"], "beta {beta}");
        let form_error = outcome.form_error_um.map(|f| f * UM);
        Tolerance { rel: 1e-9, abs: 0.0 }.assert(
            &format!("beta {beta}"),
            &[form_error],
            &[case["form_error_diameter_201_stations"].as_f64()],
        );
        Tolerance { rel: 2e-4, abs: 0.0 }.assert(
            &format!("beta {beta}"),
            &[form_error],
            &[case["form_error_diameter_exact"].as_f64()],
        );
    }
}

#[test]
fn ten_and_a_hundred_thousand_stations_keep_their_digits() {
    let scale = reference("scale.json");
    for count in scale["stations"].as_array().unwrap() {
        let outcome = solved(json!({
            "shaft": { "segments": [{ "length_mm": 2000.0, "diameter_mm": 90.0, "stock_diameter_mm": 91.0 }], "youngs_modulus_n_per_mm2": 210_000.0 },
            "supports": [
                { "kind": "centre", "z_mm": 0.0, "compliance_um_per_n": 0.03 },
                { "kind": "centre", "z_mm": 2000.0, "compliance_um_per_n": 0.06 }
            ],
            "force": { "kind": "power_law", "passive": { "coefficient": 2430.0, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.3 } },
            "cut": { "feed_mm_per_rev": 0.5, "spindle_speed_rpm": 500.0 },
            "stations": { "kind": "per_zone", "count": count }
        }));
        let (l, e) = (2000.0_f64, 210_000.0);
        let j = std::f64::consts::PI * 90.0_f64.powi(4) / 64.0;
        let work = outcome.stations.work_compliance_um_per_n.unwrap();
        for (x, w) in outcome.stations.z_mm.iter().zip(&work) {
            let exact =
                x * x * (l - x).powi(2) / (3.0 * e * j * l) + (1.0 - x / l).powi(2) * 3e-5 + (x / l).powi(2) * 6e-5;
            assert!((w * UM - exact).abs() <= 1e-9 * exact, "{count} stations, x {x}: {w} instead of {exact}");
        }
    }
}
