//! How probable a quiet cut is: against cases that an independent program drew, against closed forms, and against vises that are
//! drawn as the job states and asked one by one.
//!
//! `PRECUT_CERTAINTY_VISES` sets how many are drawn.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::draw::Draw;
use crate::fixture_support::{checked, outcome, said, solve, with};
use precut_calc::fixture_stability::{FixtureOutcome, multiplier_modulus};
use serde_json::{Value, json};

pub(crate) fn reference(name: &str) -> Value {
    let path = format!("{}/reference/certainty/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The job of a case as it is meant: what it states alone is uncertain, its friction is one number. The vise itself is asked.
pub(crate) fn meant(case: &Value) -> Value {
    let mut job = case["job"].clone();
    job["uncertainty"]["defaults"] = json!(false);
    job["uncertainty"]["check"] = json!("always");
    if let Some(friction) = job.pointer("/fixture/clamp/friction").cloned() {
        job["fixture"]["clamp"]["friction"] = json!({ "low": friction, "value": friction, "high": friction });
    }
    job
}

/// Over these speeds, too.
fn over(job: &Value, [from, to]: [f64; 2], speeds: usize) -> Value {
    let lobes = json!({ "from_rpm": from, "to_rpm": to, "speeds": speeds, "depth_max_mm": 8.0 });
    with(&with(job, "/analyses", json!(["certainty"])), "/lobes", lobes)
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {value}"))
}

/// The probability of a limit, and of all, with their errors.
pub(crate) fn told(of: &FixtureOutcome, limit: &str) -> (f64, f64) {
    let conformance = of.conformance.as_ref().unwrap();
    if limit == "all" {
        return (conformance.joint.probability, conformance.joint.numerical_error);
    }
    let one = conformance.limits.iter().find(|one| one.limit == limit).unwrap_or_else(|| panic!("{limit}"));
    (one.probability, one.numerical_error)
}

#[test]
fn references_are_met() {
    for name in ["x1-stable", "x2-joints-and-slip", "x3-speeds"] {
        let case = reference(name);
        let got = outcome(&meant(&case));
        let within = number(&case, "/tolerance/default/absolute");
        let pairs = [
            ("stable", "/expected/probability_stable"),
            ("closed", "/expected/probability_joints_closed"),
            ("held", "/expected/probability_no_slip"),
            ("all", "/expected/probability_joint"),
        ];
        for (limit, pointer) in pairs {
            let Some(expected) = case.pointer(pointer).and_then(Value::as_f64) else { continue };
            let (probability, error) = told(&got, limit);
            eprintln!("{name} {limit}: {probability} +- {error}, expected {expected}");
            assert!((probability - expected).abs() <= within + error, "{name} {limit}: {probability}, {expected}");
        }
    }
}

#[test]
fn depths_of_a_probability_are_those_of_the_reference() {
    let case = reference("x3-speeds");
    let got = outcome(&over(&meant(&case), [1700.0, 2100.0], 3));
    let depths = got.probable_depths.as_ref().unwrap();
    let near = |what: &str, depth: f64, expected: f64, within: f64| {
        eprintln!("{what}: {depth}, expected {expected}");
        assert!((depth / expected - 1.0).abs() <= within, "{what}: {depth}, expected {expected}");
    };
    let relative = |field: &str| number(&case, &format!("/tolerance/{field}/relative"));
    for (index, expected) in case["expected"]["speeds"].as_array().unwrap().iter().enumerate() {
        let at = |field: &str| number(expected, &format!("/{field}"));
        assert!((depths.spindle_speed_rpm[index] - at("spindle_speed_rpm")).abs() < 1e-9);
        let (wanted, even) = (depths.stable_wanted_mm[index].unwrap(), depths.stable_50_percent_mm[index].unwrap());
        near("95 %", wanted, at("depth_at_95_percent_mm"), relative("depth_at_95_percent_mm"));
        // At 1700 rev/min the reference itself is some percent off: it says so of its deepest limits.
        near("50 %", even, at("depth_at_50_percent_mm"), 0.03);
    }
    near("10 %", depths.stable_10_percent_mm[1].unwrap(), number(&case, "/expected/depth_at_10_percent_mm"), 0.03);
    let robust = depths.robust_speed.as_ref().unwrap();
    assert!((robust.spindle_speed_rpm - number(&case, "/expected/best_speed_rpm")).abs() < 1e-9, "{robust:?}");
}

/// A quantity that scales the depth alone: the probability is that of the logarithm of the margin.
#[test]
fn a_force_alone_has_a_closed_form() {
    let mut job = meant(&reference("x1-stable"));
    let scatter = 0.25;
    let distribution = json!({ "kind": "lognormal", "log_standard_deviation": scatter });
    job["uncertainty"]["quantities"] = json!([{ "quantity": "cutting_force", "distribution": distribution }]);
    let job = with(&job, "/limits", json!({ "depth_max_mm": 12.0 }));
    let got = outcome(&job);
    let limit = got.chatter_depth_mm.unwrap();
    // What the job states in percent, as a material by name brings it, is the same.
    let mut in_percent = job.clone();
    in_percent["uncertainty"].as_object_mut().unwrap().remove("quantities");
    in_percent["uncertainty"]["force_percent"] = json!(100.0 * scatter);
    assert_eq!(outcome(&in_percent).conformance, got.conformance);
    // A quantity of that name takes its place.
    let mut both = job.clone();
    both["uncertainty"]["force_percent"] = json!(3.0);
    assert_eq!(outcome(&both).conformance, got.conformance);
    let score = (limit / number(&job, "/cut/depth_mm")).ln() / scatter;
    let exact = 0.5 * (1.0 + erf(score / std::f64::consts::SQRT_2));
    let (probability, _) = told(&got, "stable");
    // The place along the line is found to 1e-4 of a standard deviation, the multiplier to that of a map.
    assert!((probability - exact).abs() < 1e-3, "{probability}, {exact}");
}

/// The error function by its series about 0, for arguments below 4.
fn erf(x: f64) -> f64 {
    let (mut term, mut sum) = (x, x);
    for n in 1..200 {
        term *= -x * x / f64::from(n);
        sum += term / f64::from(2 * n + 1);
    }
    sum * 2.0 / std::f64::consts::PI.sqrt()
}

#[test]
fn nothing_uncertain_says_nothing() {
    let mut job = meant(&reference("x1-stable"));
    job["uncertainty"] = json!({ "defaults": false });
    assert!(outcome(&job).conformance.is_none());
}

/// What a response surface tells at once is said to be unchecked, and is off by no more than it says wherever it is checked as it advises.
#[test]
fn a_surface_tells_that_nobody_checked_it() {
    for depth in [2.4, 3.11, 3.55, 3.9] {
        let always = with(&meant(&reference("x2-joints-and-slip")), "/cut/depth_mm", json!(depth));
        let never = with(&always, "/uncertainty/check", json!("never"));
        let is_unchecked = |job: &Value| said(&solve(job), "probability_unchecked").is_some();
        assert!(is_unchecked(&never) && !is_unchecked(&always));
        let [(real, of_real), (told, of_told)] = [&always, &never].map(|job| told(&outcome(job), "all"));
        eprintln!("{depth} mm: {told} +- {of_told}, checked {real} +- {of_real}");
        assert!((real - told).abs() <= of_real + of_told, "{depth}: {told} +- {of_told}, {real} +- {of_real}");
    }
}

/// Vises drawn as the job states, each asked for its own multiplier, forced motion and slip.
#[test]
fn drawn_vises_stay_quiet_as_often_as_told() {
    let vises: usize = std::env::var("PRECUT_CERTAINTY_VISES").map_or(40, |count| count.parse().unwrap());
    let case = reference("x2-joints-and-slip");
    let job = meant(&case);
    let mut draw = Draw::new(7);
    for depth in [2.4, 3.11, 3.55, 3.9, 4.7] {
        let job = with(&job, "/cut/depth_mm", json!(depth));
        let (probability, error) = told(&outcome(&job), "all");
        let quiet = (0..vises).filter(|_| is_quiet(&drawn(&job, &mut draw))).count();
        let share = quiet as f64 / vises as f64;
        let deviation = (probability * (1.0 - probability) / vises as f64).sqrt();
        eprintln!("{depth} mm: told {probability} +- {error}, quiet {share} of {vises}");
        // Lines across the lobes told up to 0.031, those along them 0.003 to 0.011.
        assert!(error < 0.016, "{depth}: {error}");
        assert!((share - probability).abs() < 2.5 * deviation + error, "{depth}: {share}, told {probability}");
    }
}

/// The same job with numbers as a draw has them, and nothing uncertain.
pub(crate) fn drawn(job: &Value, draw: &mut Draw) -> Value {
    let mut drawn = job.clone();
    let scale = |job: &mut Value, pointer: &str, factor: f64| {
        let value = number(job, pointer) * factor;
        *job.pointer_mut(pointer).unwrap() = json!(value);
    };
    for one in job["uncertainty"]["quantities"].as_array().unwrap() {
        let factor = (number(one, "/distribution/log_standard_deviation") * normal(draw)).exp();
        let fields: &[&str] = match one["quantity"].as_str().unwrap() {
            "joint_stiffness" => {
                &["/fixture/movable_joint/stiffness_n_per_mm", "/fixture/fixed_joint/stiffness_n_per_mm"]
            }
            "damping" => &["/fixture/movable_joint/damping_n_s_per_mm", "/fixture/fixed_joint/damping_n_s_per_mm"],
            "cutting_force" => &["/force/coefficient"],
            "clamp_force" => &["/fixture/clamp_force_n"],
            "friction" => {
                &["/fixture/clamp/friction/low", "/fixture/clamp/friction/value", "/fixture/clamp/friction/high"]
            }
            other => panic!("{other}"),
        };
        for pointer in fields {
            scale(&mut drawn, pointer, factor);
        }
    }
    drawn["uncertainty"] = json!({ "defaults": false });
    with(&drawn, "/analyses", json!(["clamp_force"]))
}

/// By Box and Muller.
fn normal(draw: &mut Draw) -> f64 {
    (-2.0 * draw.between(1e-12, 1.0).ln()).sqrt() * (std::f64::consts::TAU * draw.share()).cos()
}

pub(crate) fn is_quiet(job: &Value) -> bool {
    let (modulus, _) = multiplier_modulus(&checked(job).unwrap()).unwrap();
    if modulus >= 1.0 {
        return false;
    }
    let clamp = outcome(job).clamp.unwrap();
    let given = number(job, "/fixture/clamp_force_n");
    given >= clamp.least_n.unwrap() && clamp.slip.unwrap().holds.unwrap()
}

/// What is advised is done: the depth of the wanted probability has it, a half of each of the three widths that matter most makes
/// of it what was told, the robust speed removes and holds what it says.
#[test]
fn what_is_told_is_so_when_it_is_done() {
    let job = meant(&reference("x2-joints-and-slip"));
    let got = outcome(&over(&job, [1050.0, 1300.0], 40));
    let conformance = got.conformance.as_ref().unwrap();
    let deep = conformance.depth_at_wanted_mm.unwrap();
    let (there, error) = told(&outcome(&with(&job, "/cut/depth_mm", json!(deep))), "all");
    assert!((there - 0.95).abs() < error + 0.003, "{deep} mm: {there} +- {error}");
    for one in conformance.contributions.iter().take(3) {
        let mut halved = job.clone();
        for stated in halved["uncertainty"]["quantities"].as_array_mut().unwrap() {
            if stated["quantity"] == json!(one.quantity) {
                let half = 0.5 * number(stated, "/distribution/log_standard_deviation");
                stated["distribution"]["log_standard_deviation"] = json!(half);
            }
        }
        let (then, of_then) = told(&outcome(&halved), "all");
        let told = one.joint_probability_if_halved.unwrap();
        eprintln!("{} halved: {then} +- {of_then}, told {told}", one.quantity);
        assert!((then - told).abs() < 0.02 + of_then, "{}: {then}, told {told}", one.quantity);
    }
    let robust = got.probable_depths.unwrap().robust_speed.unwrap();
    let mut done = with(&job, "/cut/depth_mm", json!(robust.depth_mm));
    done["cut"]["spindle_speed_rpm"] = json!(robust.spindle_speed_rpm);
    let then = outcome(&done);
    let (probability, error) = told(&then, "all");
    assert!(probability > 0.95 - error, "{robust:?}: {probability}");
    let removed = then.engagement.removal_rate_cm3_per_min;
    assert!((removed / robust.removal_rate_cm3_per_min - 1.0).abs() < 1e-9, "{removed}, {robust:?}");
}

#[test]
fn what_cannot_be_is_told_at_once() {
    let mut job = meant(&reference("x1-stable"));
    let log = |s: f64| json!({ "kind": "lognormal", "log_standard_deviation": s });
    job["uncertainty"]["quantities"] = json!([
        { "quantity": "friction", "distribution": log(0.2) },
        { "quantity": "damping", "distribution": log(0.3) },
        { "quantity": "damping", "distribution": { "kind": "normal", "standard_uncertainty_um": 3.0 } }
    ]);
    job["uncertainty"]["correlations"] = json!([{ "between": ["damping", "damping"], "coefficient": 0.5 }]);
    let faults = checked(&job).unwrap_err();
    for code in ["quantity_of_nothing", "duplicate_quantity", "unit_of_quantity", "bad_correlation"] {
        assert!(faults.iter().any(|(fault, _)| fault == code), "{code} in {faults:?}");
    }
}
