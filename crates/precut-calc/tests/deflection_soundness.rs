//! Whirl, thin walls, shoulders, thrust, doubt wider than the tolerance, a machine that was not given, cuts far beyond the
//! force law: each at both sides of its condition.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::f64::consts::PI;

use crate::cases::{answer, case};
use precut_calc::calculator::{Answer, Failure, Finding, Value as Said};
use precut_calc::deflection_compensation::{DeflectionCompensation, Outcome};
use serde_json::{Value, json};

fn solved(job: &Value) -> Answer<Outcome> {
    answer::<DeflectionCompensation>(job).unwrap()
}

fn warned(job: &Value, code: &str) -> Option<Finding> {
    solved(job).warnings.into_iter().find(|warning| warning.code == code)
}

fn said(job: &Value, code: &str) -> bool {
    solved(job).explanation.iter().any(|message| message.code == code)
}

fn number(finding: &Finding, name: &str) -> f64 {
    match finding.values.get(name) {
        Some(Said::Number(number)) => *number,
        other => panic!("{name} is {other:?}"),
    }
}

fn job(supports: Value) -> Value {
    json!({
        "shaft": { "segments": [{ "length_mm": 1000.0, "diameter_mm": 40.0, "stock_diameter_mm": 41.0 }],
                   "youngs_modulus_n_per_mm2": 210_000.0, "density_kg_per_m3": 7850.0 },
        "supports": supports,
        "force": { "kind": "constant", "passive_n": 100.0 },
        "cut": { "feed_mm_per_rev": 0.2, "spindle_speed_rpm": 500.0 }
    })
}

fn centres() -> Value {
    json!([{ "kind": "centre", "z_mm": 0.0 }, { "kind": "centre", "z_mm": 1000.0 }])
}

/// (beta l)² sqrt(E J/(rho A))/l² of a uniform shaft.
fn closed_form_rpm(beta_l: f64) -> f64 {
    let speed_of_sound_m_per_s = (2.1e11_f64 / 7850.0).sqrt();
    beta_l.powi(2) * speed_of_sound_m_per_s * 0.010 / 1.0 * 60.0 / (2.0 * PI)
}

#[test]
fn the_first_critical_speed_is_that_of_the_closed_forms() {
    let chuck = json!({ "kind": "chuck", "z_mm": 0.0 });
    for (supports, beta_l) in [
        (centres(), PI),
        (json!([chuck]), 1.875_104),
        (json!([chuck, { "kind": "centre", "z_mm": 1000.0 }]), 3.926_602),
        (json!([chuck, { "kind": "chuck", "z_mm": 1000.0 }]), 4.730_041),
    ] {
        let found = solved(&job(supports.clone())).output.critical_speed_rpm.unwrap();
        let expected = closed_form_rpm(beta_l);
        assert!((found / expected - 1.0).abs() < 0.01, "{supports}: {found} {expected}");
    }
    // Springs under a shaft that is stiff beside them: sqrt(k/m), both centres alike.
    let mut soft = job(centres());
    for i in 0..2 {
        soft["supports"][i]["compliance_um_per_n"] = json!(1000.0);
    }
    let mass_kg = 7850.0 * PI / 4.0 * 0.04_f64.powi(2);
    let expected = (2.0 * 1e3 / mass_kg).sqrt() * 60.0 / (2.0 * PI);
    let found = solved(&soft).output.critical_speed_rpm.unwrap();
    assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
}

#[test]
fn a_shaft_near_its_critical_speed_is_warned_of() {
    let whirl = case("deflection-compensation/whirl.json");
    let finding = warned(&whirl, "near_critical_speed").unwrap();
    assert!((number(&finding, "critical_rpm") / 840.0 - 1.0).abs() < 0.02, "{finding:?}");
    let critical = closed_form_rpm(PI);
    for (share, expected) in [(0.69, false), (0.73, true)] {
        let mut job = job(centres());
        job["cut"]["spindle_speed_rpm"] = json!(share * critical);
        assert_eq!(warned(&job, "near_critical_speed").is_some(), expected, "{share}");
        // At constant cutting speed the thinnest place turns fastest, the limit of the spindle kept.
        job["cut"] = json!({ "feed_mm_per_rev": 0.2, "speed_m_per_min": share * critical * PI * 0.040 });
        job["program"] = json!({ "spindle_limit_rpm": 100_000.0 });
        assert_eq!(warned(&job, "near_critical_speed").is_some(), expected, "{share}");
    }
}

#[test]
fn a_wall_that_yields_as_a_shell_is_warned_of() {
    let bored = |diameter: f64, bore: f64| {
        let mut job = job(centres());
        job["shaft"]["segments"] = json!([{ "length_mm": 1000.0, "diameter_mm": diameter,
            "stock_diameter_mm": diameter + 1.0, "bore_diameter_mm": bore }]);
        job
    };
    for (diameter, bore) in [(40.0, 39.9), (100.0, 97.0)] {
        let finding = warned(&bored(diameter, bore), "thin_wall").unwrap();
        let enough = finding.limit.unwrap();
        assert!(enough > finding.value.unwrap());
        // The remedy works.
        assert_eq!(warned(&bored(diameter, diameter - 2.02 * enough), "thin_wall"), None, "{enough}");
    }
    assert_eq!(warned(&bored(100.0, 60.0), "thin_wall"), None);
    assert_eq!(warned(&bored(100.0, 0.0), "thin_wall"), None);
}

#[test]
fn a_square_shoulder_needs_an_edge_of_90_degrees() {
    let edge = |angle: f64, thick: bool| {
        let mut job = job(centres());
        job["shaft"]["segments"] = json!([
            { "length_mm": 500.0, "diameter_mm": if thick { 44.0 } else { 36.0 }, "stock_diameter_mm": 46.0 },
            { "length_mm": 500.0, "diameter_mm": 40.0, "stock_diameter_mm": 46.0 }]);
        job["force"] = json!({ "kind": "handbook", "material": "steel_45", "tool_material": "carbide",
            "cutting_edge_angle_deg": angle });
        job
    };
    let finding = warned(&edge(60.0, true), "edge_meets_shoulder").unwrap();
    assert!((number(&finding, "reach_mm") - 2.0 / 60.0_f64.to_radians().tan()).abs() < 1e-9);
    assert!((number(&finding, "z_mm") - 500.0).abs() < 1e-9);
    assert_eq!(warned(&edge(90.0, true), "edge_meets_shoulder"), None);
    assert_eq!(warned(&edge(95.0, true), "edge_meets_shoulder"), None);
    // Down a step the edge meets nothing.
    assert_eq!(warned(&edge(60.0, false), "edge_meets_shoulder"), None);
}

#[test]
fn thrust_of_the_tailstock_counts_towards_buckling() {
    let thrust = |n: f64| {
        let mut job = job(centres());
        job["tailstock_thrust_n"] = json!(n);
        job
    };
    let critical_n = PI * PI * 210_000.0 * PI * 40.0_f64.powi(4) / 64.0 / 1e6;
    assert_eq!(warned(&thrust(0.049 * critical_n), "thrust_near_buckling"), None);
    let finding = warned(&thrust(0.051 * critical_n), "thrust_near_buckling").unwrap();
    assert!((number(&finding, "margin") - 1.0 / 0.051).abs() < 1e-6);
}

#[test]
fn doubt_wider_than_the_tolerance_is_warned_of() {
    let mut soft = job(centres());
    soft["include"] = json!({ "mode": "as_stated" });
    let most = {
        let answer = solved(&soft);
        answer.output.stations.diameter_uncertainty_um.unwrap().into_iter().fold(0.0, f64::max)
    };
    for (allowed, expected) in [(1.99, true), (2.01, false)] {
        soft["tolerance"] = json!({ "diameter_um": 2.0 * allowed * most });
        assert_eq!(warned(&soft, "uncertainty_exceeds_tolerance").is_some(), expected, "{allowed}");
    }
    // Ends on rigid centres are certain, so the form is as uncertain as the middle.
    for (allowed, expected) in [(1.99, true), (2.01, false)] {
        soft["tolerance"] = json!({ "form_um": allowed * most });
        assert_eq!(warned(&soft, "uncertainty_exceeds_tolerance").is_some(), expected, "{allowed}");
    }
}

#[test]
fn a_machine_that_was_not_given_is_not_judged() {
    let mut job = case("deflection-compensation/rigid-machine.json");
    assert!(said(&job, "machine_taken_as_rigid") && !said(&job, "work_dominates"));
    job["carriage"] = json!({ "compliance_um_per_n": 0.001 });
    assert!(!said(&job, "machine_taken_as_rigid") && said(&job, "work_dominates"));
}

#[test]
fn a_cut_beyond_the_source_of_the_force_law_is_warned_of_and_far_beyond_refused() {
    let absurd = case("deflection-compensation/absurd-stock410.json");
    let deep = |stock_mm: f64| {
        let mut job = absurd.clone();
        job["shaft"]["segments"][0]["stock_diameter_mm"] = json!(stock_mm);
        job
    };
    let Err(Failure::OutOfModel(finding)) = answer::<DeflectionCompensation>(&absurd) else { panic!() };
    assert_eq!((finding.code, finding.value, finding.limit), ("far_beyond_force_model", Some(185.0), Some(48.0)));
    // The remedy: passes of a depth that the law knows.
    assert!(answer::<DeflectionCompensation>(&deep(40.0 + 2.0 * 47.9)).is_ok());
    assert!(matches!(answer::<DeflectionCompensation>(&deep(40.0 + 2.0 * 48.1)), Err(Failure::OutOfModel(_))));
    assert_eq!(warned(&deep(40.0 + 2.0 * 11.9), "extrapolated_force_model"), None);
    let finding = warned(&deep(40.0 + 2.0 * 12.1), "extrapolated_force_model").unwrap();
    assert_eq!(finding.limit, Some(12.0));
    // Kienzle's law: the same of its own source.
    let mut kienzle = deep(40.0 + 2.0 * 19.9);
    kienzle["force"] = json!({ "kind": "kienzle", "cutting_edge_angle_deg": 75.0, "nose_radius_mm": 0.8,
        "specific_cutting_force_n_per_mm2": 2085.0, "cutting_exponent": 0.173,
        "specific_normal_force_n_per_mm2": 900.0, "normal_exponent": 0.35 });
    assert_eq!(warned(&kienzle, "extrapolated_force_model"), None);
    kienzle["shaft"]["segments"][0]["stock_diameter_mm"] = json!(40.0 + 2.0 * 20.1);
    assert!(warned(&kienzle, "extrapolated_force_model").is_some());
    kienzle["shaft"]["segments"][0]["stock_diameter_mm"] = json!(40.0 + 2.0 * 80.1);
    assert!(matches!(answer::<DeflectionCompensation>(&kienzle), Err(Failure::OutOfModel(_))));
}

#[test]
fn remarks_that_hold_of_everything_stand_in_no_answer() {
    let mut job = job(centres());
    job["force"] = json!({ "kind": "handbook", "material": "steel_45", "tool_material": "carbide", "cutting_edge_angle_deg": 60.0 });
    assert!(!said(&job, "one_step_overcuts") && solved(&job).output.one_step.is_none());
    job["compare_one_step"] = json!(true);
    assert!(said(&job, "one_step_overcuts") && solved(&job).output.one_step.is_some());
}
