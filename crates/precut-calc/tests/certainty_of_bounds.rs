//! Quantities of which bounds alone are known: the least and the largest probability within them, against closed forms and against
//! jobs that state what lies at the ends.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use precut_calc::certainty::{IntervalSearch, JointlyKept};
use serde_json::{Value, json};

use crate::deflection_certainty::{below, job as shaft, number};
use crate::draw::Draw;
use crate::fixture_certainty::{drawn, is_quiet, meant, reference, told};
use crate::fixture_support::{checked, outcome, with};
use crate::milling_answers::{faults as faults_of_cut, merged, solve};
use crate::milling_certainty::{conformance as of_cut, how_sure};
use crate::ring_certainty::{certain, conformance as of_ring};
use crate::ring_support::faults as faults_of_ring;

fn um(quantity: &str, kind: &str, width: &str, um: f64) -> Value {
    json!({ "quantity": quantity, "distribution": { "kind": kind, width: um } })
}

fn percent(quantity: &str, percent: f64) -> Value {
    json!({ "quantity": quantity, "distribution": { "kind": "interval", "half_width_percent": percent } })
}

fn of_shaft(quantities: &Value, tolerance: &Value, aim: &str) -> Value {
    let mut job = shaft(quantities, tolerance);
    job["aim"] = json!({ "kind": aim });
    serde_json::to_value(crate::support::solved(job)).unwrap()
}

/// A normal error between two limits, shifted by anything within bounds: least at the far end, most where it is shifted to the middle.
#[test]
fn a_shift_within_bounds_has_the_closed_form() {
    let (own_um, bound_um) = (5.0, 6.0);
    let normal = um("tool_setting", "normal", "standard_uncertainty_um", own_um);
    // The tool's setting moves this shaft by a little less than itself: what it comes to is read off one limit far from the other.
    let alone = of_shaft(&json!([normal]), &json!({ "diameter_upper_um": own_um }), "nominal");
    let really_um = own_um / quantile(number(&alone, "/conformance/joint/probability"));
    assert!(alone["conformance"]["joint"]["probability_most"].is_null());
    let both = json!([normal, um("spindle_scatter", "interval", "half_width_um", bound_um)]);
    for (lower, upper, search) in
        [(Some(-10.0), 10.0, "multi_start"), (Some(-7.0), 16.0, "multi_start"), (None, 8.0, "ends")]
    {
        let tolerance = json!({ "diameter_upper_um": upper, "diameter_lower_um": lower });
        let answer = of_shaft(&both, &tolerance, "nominal");
        let exact = |shift: f64| {
            let above = below((upper - shift) / really_um);
            above - lower.map_or(0.0, |lower| below((lower - shift) / really_um))
        };
        let shifts = || (-600..=600).map(|step| bound_um * f64::from(step) / 600.0);
        let (least, most) = (shifts().map(exact).fold(1.0, f64::min), shifts().map(exact).fold(0.0, f64::max));
        let joint = &answer["conformance"]["joint"];
        eprintln!("{joint} {least} {most}");
        // By how much the setting moves it differs along the shaft by a few percent of itself; a place within bounds is found to a fortieth.
        assert!((number(joint, "/probability") - least).abs() < 0.006, "{joint}, least {least}");
        assert!((number(joint, "/probability_most") - most).abs() < 0.006, "{joint}, most {most}");
        assert_eq!(joint["interval_search"], search);
        assert_eq!(joint["met"], json!(false));
        let of = answer["conformance"]["contributions"].as_array().unwrap();
        let bounds = of.iter().find(|one| one["quantity"] == "spindle_scatter").unwrap();
        assert!(bounds["share_of_variance"].is_null());
        // Half of the bounds: the end comes as near.
        let halved = exact(0.5 * bound_um).min(exact(-0.5 * bound_um));
        assert!((number(bounds, "/joint_probability_if_halved") - halved).abs() < 0.01, "{bounds}, {halved}");
    }
}

/// Nothing is scattered: a part at the bounds is good or it is not.
#[test]
fn bounds_alone_are_all_or_nothing() {
    let bounds = json!([um("spindle_scatter", "interval", "half_width_um", 8.0)]);
    for (half, least) in [(10.0, 1.0 - 1e-6), (5.0, 1e-6)] {
        let answer = of_shaft(&bounds, &json!({ "diameter_um": 2.0 * half }), "nominal");
        let joint = &answer["conformance"]["joint"];
        assert!((number(joint, "/probability") - least).abs() < 1e-9, "{joint}");
        assert!((number(joint, "/probability_most") - (1.0 - 1e-6)).abs() < 1e-9, "{joint}");
    }
}

/// The best aim within bounds is the one whose worst is best: of bounds as wide to both sides the middle of the limits.
#[test]
fn the_best_aim_is_that_of_the_worst_case() {
    let own = um("tool_setting", "normal", "standard_uncertainty_um", 4.0);
    let both = json!([own, um("spindle_scatter", "interval", "half_width_um", 6.0)]);
    let tolerance = json!({ "diameter_upper_um": 10.0, "diameter_lower_um": -20.0 });
    let answer = of_shaft(&both, &tolerance, "most_probable");
    let aim_um = number(&answer, "/aim_shift_um");
    assert!((aim_um + 5.0).abs() < 0.5, "{aim_um}");
    // Advised where nothing is aimed at, and so when it is done.
    let plain = of_shaft(&both, &tolerance, "nominal");
    let advised = plain["conformance"]["advice"].as_array().unwrap();
    assert!(advised.iter().all(|one| one["action"]["kind"] == "shift_aim"), "{advised:?}");
    let joint = &answer["conformance"]["joint"];
    let told = number(&advised[0], "/joint_probability");
    assert!(
        (number(joint, "/probability") - told).abs() < 0.006 + number(joint, "/numerical_error"),
        "{told}, {joint}"
    );
}

/// The probability of a vise whose joints are damped by anything within bounds is that of the vises at the ends.
#[test]
fn a_vise_within_bounds_is_between_those_at_the_ends() {
    let mut job = meant(&reference("x2-joints-and-slip"));
    job["uncertainty"]["quantities"].as_array_mut().unwrap().retain(|one| one["quantity"] != "damping");
    let at = |factor: f64| {
        let mut there = job.clone();
        for joint in ["movable_joint", "fixed_joint"] {
            let damping = there["fixture"][joint]["damping_n_s_per_mm"].as_f64().unwrap();
            there["fixture"][joint]["damping_n_s_per_mm"] = json!(factor * damping);
        }
        told(&outcome(&there), "all")
    };
    let mut bounds = job.clone();
    bounds["uncertainty"]["quantities"].as_array_mut().unwrap().push(percent("damping", 25.0));
    let joint = outcome(&bounds).conformance.unwrap().joint;
    between(&joint, at(0.75), at(1.25));
    bounds["uncertainty"]["correlations"] = json!([{ "between": ["damping", "cutting_force"], "coefficient": 0.5 }]);
    let faults = checked(&with(&bounds, "/analyses", json!(["certainty"]))).unwrap_err();
    assert!(faults.iter().any(|(code, _)| code == "interval_correlated"), "{faults:?}");
}

/// The depth that is told of a vise within bounds is cut at their worst end, by vises that are drawn there one by one: as many of
/// them stay quiet as was wanted.
#[test]
fn the_depth_within_bounds_is_as_sure_as_wanted_at_the_worst_end() {
    let vises = std::env::var("PRECUT_CERTAINTY_VISES").map_or(60, |count| count.parse().unwrap());
    let (wanted, percent_off) = (0.8, 25.0);
    let mut job = meant(&reference("x2-joints-and-slip"));
    job["uncertainty"]["quantities"].as_array_mut().unwrap().retain(|one| one["quantity"] != "damping");
    let mut bounds = with(&job, "/analyses", json!(["certainty"]));
    bounds["uncertainty"]["wanted_probability"] = json!(wanted);
    bounds["uncertainty"]["quantities"].as_array_mut().unwrap().push(percent("damping", percent_off));
    let deep = outcome(&bounds).conformance.unwrap().depth_at_wanted_mm.unwrap();
    let at = |factor: f64| {
        let mut there = with(&job, "/cut/depth_mm", json!(deep));
        for joint in ["movable_joint", "fixed_joint"] {
            let damping = there["fixture"][joint]["damping_n_s_per_mm"].as_f64().unwrap();
            there["fixture"][joint]["damping_n_s_per_mm"] = json!(factor * damping);
        }
        there
    };
    // Found to 0.01 of a standard normal score, and to the error of every depth that was tried.
    let (worst, error) = told(&outcome(&at(1.0 - percent_off / 100.0)), "all");
    let (best, _) = told(&outcome(&at(1.0 + percent_off / 100.0)), "all");
    eprintln!("{deep} mm: {worst} +- {error} at the worst end, {best} at the best");
    assert!((worst - wanted).abs() < error + 0.003, "{deep} mm: {worst} +- {error}");
    assert!(best > wanted + 0.05, "{best}");
    let mut draw = Draw::new(23);
    let quiet = (0..vises).filter(|_| is_quiet(&drawn(&at(1.0 - percent_off / 100.0), &mut draw))).count();
    let (share, deviation) = (quiet as f64 / f64::from(vises), (wanted * (1.0 - wanted) / f64::from(vises)).sqrt());
    eprintln!("quiet {share} of {vises}");
    assert!((share - wanted).abs() < 2.5 * deviation + error, "{share}");
}

#[test]
fn a_cut_within_bounds_is_between_those_at_the_ends() {
    let scatter =
        json!({ "quantity": "mode_damping", "distribution": { "kind": "lognormal", "log_standard_deviation": 0.3 } });
    let job = |more: &[Value]| {
        let quantities: Vec<&Value> = std::iter::once(&scatter).chain(more).collect();
        how_sure(&json!({ "cutter": { "helix_angle_deg": 0 }, "spindle": null, "analyses": ["certainty", "intervals"],
            "uncertainty": { "quantities": quantities, "defaults": false } }))
    };
    let near_mm = 0.95 * solve(&job(&[])).outcome.first_limit_mm.unwrap();
    let job = |more: &[Value]| merged(job(more), &json!({ "cut": { "depth_mm": near_mm }, "analyses": ["certainty"] }));
    let joint = of_cut(&job(&[percent("cutting_force", 15.0)])).joint;
    let at = |factor: f64| {
        let mut there = job(&[]);
        for coefficient in ["tangential_n_per_mm2", "radial_n_per_mm2"] {
            if let Some(value) = there["force"].get(coefficient).and_then(Value::as_f64) {
                there["force"][coefficient] = json!(factor * value);
            }
        }
        let found = of_cut(&there).joint;
        (found.probability, found.numerical_error)
    };
    between(&joint, at(1.15), at(0.85));
    let deep = of_cut(&job(&[percent("cutting_force", 15.0)])).depth_at_wanted_mm.unwrap();
    let there = of_cut(&merged(job(&[percent("cutting_force", 15.0)]), &json!({ "cut": { "depth_mm": deep } }))).joint;
    assert!((there.probability - 0.95).abs() < 0.01 + there.numerical_error, "{deep}: {there:?}");
    let wrong =
        job(&[json!({ "quantity": "cutting_force", "distribution": { "kind": "interval", "half_width_um": 3.0 } })]);
    assert!(faults_of_cut(&wrong).iter().any(|fault| fault.code == "unit_of_quantity"));
}

#[test]
fn a_ring_within_bounds_is_between_those_at_the_ends() {
    let bounded = |more: Vec<Value>, factor: f64| {
        let mut job = certain(0.75);
        let ratio = job["compliance_ratio"].as_f64().unwrap();
        job["compliance_ratio"] = json!(factor * ratio);
        job["uncertainty"]["quantities"].as_array_mut().unwrap().retain(|one| one["quantity"] != "compliance_ratio");
        job["uncertainty"]["quantities"].as_array_mut().unwrap().extend(more);
        job
    };
    let joint = of_ring(&bounded(vec![percent("compliance_ratio", 30.0)], 1.0)).joint;
    let known = json!({ "quantity": "compliance_ratio", "distribution": { "kind": "lognormal", "log_standard_deviation": 0.0 } });
    let at = |factor: f64| {
        let found = of_ring(&bounded(vec![known.clone()], factor)).joint;
        (found.probability, found.numerical_error)
    };
    between(&joint, at(0.7), at(1.3));
    let wrong = json!({ "quantity": "tool_angle", "distribution": { "kind": "interval", "half_width_percent": 3.0 } });
    assert!(faults_of_ring(&bounded(vec![wrong], 1.0)).iter().any(|fault| fault.code == "unit_of_quantity"));
}

/// Least and most are those of the ends, with the errors of both.
fn between(joint: &JointlyKept, least: (f64, f64), most: (f64, f64)) {
    eprintln!("{joint:?} {least:?} {most:?}");
    let within = |told: f64, (exact, error): (f64, f64)| (told - exact).abs() < 0.002 + error + joint.numerical_error;
    assert!(within(joint.probability, least), "{joint:?}, least {least:?}");
    assert!(within(joint.probability_most.unwrap(), most), "{joint:?}, most {most:?}");
    assert_eq!(joint.interval_search, Some(IntervalSearch::Ends));
    assert!(least.0 < most.0 - 0.05, "{least:?} {most:?}");
}

/// The standard normal score of a probability, by halving.
fn quantile(probability: f64) -> f64 {
    let (mut low, mut high) = (-8.0, 8.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        (low, high) = if below(middle) < probability { (middle, high) } else { (low, middle) };
    }
    f64::midpoint(low, high)
}
