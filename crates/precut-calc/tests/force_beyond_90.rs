//! Edges beyond 90 degrees, 93 and 95 above all: forces, their slopes, and where such an edge ends.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Calculator, Unwatched, Violations};
use precut_calc::deflection_compensation::{DeflectionCompensation, StatusCompensated};
use precut_calc::force::ForceModel;
use serde_json::{Value, json};

use crate::support::prepared;

fn reference() -> Value {
    let path = format!("{}/tests/reference/library/kienzle-beyond-90.json", concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn edge(angle_deg: f64, nose_mm: f64) -> Value {
    json!({
        "kind": "kienzle", "cutting_edge_angle_deg": angle_deg, "nose_radius_mm": nose_mm,
        "specific_cutting_force_n_per_mm2": 2085.0, "cutting_exponent": 0.173,
        "specific_normal_force_n_per_mm2": 900.0, "normal_exponent": 0.35
    })
}

fn model(force: Value) -> ForceModel {
    serde_json::from_value(force).unwrap()
}

fn faults(force: Value) -> Vec<&'static str> {
    let mut violations = Violations::default();
    model(force).check("/force", &mut violations);
    violations.into_vec().into_iter().map(|fault| fault.code).collect()
}

#[test]
fn every_force_and_slope_of_the_reference_is_met() {
    let reference = reference();
    let cases = reference["cases"].as_array().unwrap();
    assert!(cases.len() > 20);
    for case in cases {
        let number = |key: &str| case[key].as_f64().unwrap();
        let law = model(edge(number("cutting_edge_angle_deg"), number("nose_radius_mm")))
            .at(number("feed_mm_per_rev"), 100.0);
        let depth = number("depth_mm");
        let forces = law.forces(depth);
        let (_, slope) = law.passive_and_slope(depth);
        for (what, found, expected) in [
            ("passive", forces.passive_n, number("passive_n")),
            ("main", forces.main_n, number("main_n")),
            ("feed", forces.feed_n, number("feed_n")),
            ("slope", slope, number("passive_slope_n_per_mm")),
        ] {
            assert!((found - expected).abs() <= 1e-11 * expected.abs() + 1e-12, "{what} {found}: {case}");
        }
    }
}

#[test]
fn on_the_nose_an_edge_beyond_90_degrees_is_one_of_90_and_deeper_its_force_falls() {
    for angle in [93.0, 95.0, 107.5] {
        let (square, beyond) = (model(edge(90.0, 0.8)).at(0.25, 100.0), model(edge(angle, 0.8)).at(0.25, 100.0));
        for depth in [0.01, 0.3, 0.79] {
            assert!((square.passive(depth) - beyond.passive(depth)).abs() < 1e-9);
        }
        let mut before = beyond.passive(0.81);
        for depth in [1.0, 2.0, 3.0] {
            let (force, slope) = beyond.passive_and_slope(depth);
            let step = 1e-6;
            let difference = (beyond.passive(depth + step) - beyond.passive(depth - step)) / (2.0 * step);
            assert!(force < before && slope < 0.0 && (slope - difference).abs() < 1e-4, "{angle} {depth}");
            assert!(beyond.forces(depth).feed_n > 0.0);
            before = force;
        }
    }
}

#[test]
fn an_edge_ends_below_120_degrees_and_the_handbook_at_100() {
    assert!(faults(edge(119.9, 0.8)).is_empty());
    assert_eq!(faults(edge(120.0, 0.8)), ["bad_lead_angle"]);
    let handbook = |angle: f64| json!({ "kind": "handbook", "material": "steel_45", "tool_material": "carbide", "cutting_edge_angle_deg": angle });
    let passive = |angle: f64| model(handbook(angle)).at(0.3, 120.0).passive(2.0);
    let cautions = |angle: f64| {
        let mut model = model(handbook(angle));
        model.fill();
        model.cautions("/force").into_iter().map(|caution| caution.code).collect::<Vec<_>>()
    };
    assert!(faults(handbook(100.0)).is_empty() && (passive(100.0) - passive(90.0)).abs() < 1e-12);
    assert_eq!(faults(handbook(100.1)), ["bad_lead_angle"]);
    assert_eq!((cautions(90.0), cautions(93.0)), (vec![], vec!["edge_angle_beyond_table"]));
}

fn job(force: Value, carriage_um_per_n: f64) -> Value {
    json!({
        "shaft": { "segments": [{ "length_mm": 400.0, "diameter_mm": 40.0, "stock_diameter_mm": 46.0 }],
                   "youngs_modulus_n_per_mm2": 210_000.0 },
        "supports": [{ "kind": "centre", "z_mm": 0.0 }, { "kind": "centre", "z_mm": 400.0 }],
        "carriage": { "compliance_um_per_n": carriage_um_per_n },
        "force": force,
        "cut": { "feed_mm_per_rev": 0.25, "speed_m_per_min": 120.0 }
    })
}

#[test]
fn a_command_holds_the_drawing_with_such_an_edge_and_copies_the_blank_inverted() {
    let answer = DeflectionCompensation::run(&prepared(job(edge(95.0, 0.8), 0.05)), &Unwatched).unwrap();
    let outcome = &answer.output;
    assert!(outcome.largest_error_after_um.unwrap().abs() < 2.5);
    assert!(outcome.stations.copying_factor.as_ref().unwrap().iter().flatten().all(|eps| *eps < 0.0));
    let said = |code: &str| answer.explanation.iter().any(|message| message.code == code);
    assert!(said("stock_is_inverted") && !said("stock_is_copied"));
    let square = DeflectionCompensation::run(&prepared(job(edge(75.0, 0.8), 0.05)), &Unwatched).unwrap();
    assert!(square.explanation.iter().all(|message| message.code != "stock_is_inverted"));
}

/// Where the machine yields more per depth than the depth itself the tool is drawn in: no command holds.
#[test]
fn an_edge_that_draws_itself_in_has_no_command() {
    let slope = model(edge(95.0, 0.8)).at(0.25, 100.0).passive_and_slope(3.0).1;
    for (share, status) in [(0.9, StatusCompensated::Ok), (1.1, StatusCompensated::NoSolution)] {
        // At a rigid centre the carriage alone yields.
        let um_per_n = share * 1e3 / -slope;
        let mut job = job(edge(95.0, 0.8), um_per_n);
        job["detail"] = json!("profile");
        let found = DeflectionCompensation::run(&prepared(job), &Unwatched).unwrap().output.stations;
        assert_eq!(found.status_compensated[0], status, "{share}");
        assert_eq!(found.commanded_diameter_mm[0].is_some(), status == StatusCompensated::Ok);
    }
}
