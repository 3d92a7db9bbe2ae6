//! How probable a good shaft is: against cases that two independent programs computed, against closed forms, and against
//! shafts that are really cut with forces, compliances, blanks and tools drawn as the job states.
//!
//! `PRECUT_CERTAINTY` sets how many shafts are drawn.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::deflection_uncertainty::{cut_with, with_compliance, with_force};
use crate::draw::Draw;
use crate::support::prepared;
use precut_calc::calculator::{Calculator as _, Unwatched};
use precut_calc::deflection_compensation::DeflectionCompensation;
use serde_json::{Value, json};

pub(crate) fn solved(job: &Value) -> Value {
    serde_json::to_value(crate::support::solved(job.clone())).unwrap()
}

fn reference(name: &str) -> Value {
    let path = format!("{}/reference/certainty/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The job of a case as it is meant: what it states alone is uncertain, and its path is the exact command.
fn meant(case: &Value, aim: &str) -> Value {
    let mut job = case["job"].clone();
    job["uncertainty"]["defaults"] = json!(false);
    job["uncertainty"]["force_percent"] = json!(0);
    job["uncertainty"]["stiffness_percent"] = json!(0);
    job["include"] = json!({ "mode": "as_stated" });
    job["aim"] = json!({ "kind": aim });
    job["path"] = json!({ "chord_tolerance_um": 0.0, "increment_um": 0.001 });
    job
}

pub(crate) fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {value}"))
}

fn limit<'a>(answer: &'a Value, name: &str) -> Option<&'a Value> {
    answer["conformance"]["limits"].as_array().unwrap().iter().find(|one| one["limit"] == name)
}

#[test]
fn references_are_met() {
    for name in ["d1-centres-size-and-form", "d2-one-sided-most-probable", "d3-rest-gap", "d4-chuck-centre-correlated"]
    {
        let case = reference(name);
        let expected = &case["expected"];
        let within = number(&case, "/tolerance/default/absolute");
        let answer = solved(&meant(&case, "nominal"));
        let joint = &answer["conformance"]["joint"];
        eprintln!("{name}: {joint} {} {}", answer["conformance"]["limits"], answer["conformance"]["method"]);
        // Both have errors: that of the draws stands in the tolerance, ours beside it.
        let near = |what: &str, value: f64, of: &str| {
            let slack = within + number(joint, "/numerical_error");
            assert!((value - number(expected, of)).abs() <= slack, "{name}: {what} {value}, expected {}", expected[of]);
        };
        near("joint", number(joint, "/probability"), "/probability_joint");
        if let Some(size) = limit(&answer, "size") {
            near("size", number(size, "/probability"), "/probability_size");
            if size["probability_above"].is_number() {
                near("above", number(size, "/probability_above"), "/oversize");
            }
            if size["probability_below"].is_number() {
                near("below", number(size, "/probability_below"), "/undersize");
            }
        }
        if let Some(form) = limit(&answer, "form") {
            near("form", number(form, "/probability"), "/probability_form");
        }
    }
}

#[test]
fn the_best_aim_is_that_of_the_reference() {
    let case = reference("d2-one-sided-most-probable");
    let answer = solved(&meant(&case, "most_probable"));
    let (shift, joint) = (number(&answer, "/aim_shift_um"), number(&answer, "/conformance/joint/probability"));
    eprintln!("{shift} um, {joint}");
    let expected = &case["expected"];
    assert!((joint - number(expected, "/best_probability_joint")).abs() <= 0.003, "{joint}");
    assert!((shift - number(expected, "/best_shift_um")).abs() <= 1.0, "{shift}");
}

/// A shaft between centres of which size and form matter, and what is uncertain.
pub(crate) fn job(quantities: &Value, tolerance: &Value) -> Value {
    json!({
        "shaft": { "segments": [{ "length_mm": 600, "diameter_mm": 40, "stock_diameter_mm": 41 }],
                   "youngs_modulus_n_per_mm2": 210_000.0 },
        "supports": [{ "kind": "centre", "z_mm": 0, "compliance_um_per_n": 0.03 },
                     { "kind": "centre", "z_mm": 600, "compliance_um_per_n": 0.06 }],
        "carriage": { "compliance_um_per_n": 0.02 },
        "force": { "kind": "power_law", "passive": { "coefficient": 1500, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": 0.0 } },
        "cut": { "feed_mm_per_rev": 0.2, "speed_m_per_min": 120 },
        "include": { "mode": "as_stated" },
        "stations": { "kind": "per_zone", "count": 21 },
        "path": { "chord_tolerance_um": 0.0, "increment_um": 0.001 },
        "tolerance": tolerance,
        "uncertainty": { "force_percent": 0, "stiffness_percent": 0, "defaults": false, "quantities": quantities }
    })
}

#[test]
fn one_normal_quantity_has_the_closed_form() {
    // The tool's setting moves the diameter by 1/(1 + Y'): along this shaft by nearly one number.
    let u_um = 5.0;
    let quantities = json!([{ "quantity": "spindle_scatter", "distribution": { "kind": "normal", "standard_uncertainty_um": u_um } }]);
    for half in [4.0, 10.0, 20.0] {
        let answer = solved(&job(&quantities, &json!({ "diameter_um": 2.0 * half })));
        let probability = number(&answer, "/conformance/joint/probability");
        let exact = 1.0 - 2.0 * below(-half / u_um);
        // What rounding of the path leaves, 0.002 um, and the place of a limit on a line.
        assert!((probability - exact).abs() < 2e-3 * (half / u_um).min(1.0) + 1e-5, "{probability} {exact}");
    }
}

pub(crate) fn below(x: f64) -> f64 {
    0.5 * statrs::function::erf::erfc(-x / std::f64::consts::SQRT_2)
}

/// Normal errors, read with a normal error: what is accepted within limits that lie by 1.65 standard uncertainties inside, by
/// summing over the true error.
#[test]
fn what_is_accepted_has_the_closed_form() {
    let (own_um, gauge_um, half_um) = (5.0, 2.0, 10.0);
    let quantities = json!([{ "quantity": "spindle_scatter", "distribution": { "kind": "normal", "standard_uncertainty_um": own_um } }]);
    let mut job = job(&quantities, &json!({ "diameter_um": 2.0 * half_um }));
    job["uncertainty"]["measurement"] = json!({ "standard_uncertainty_um": gauge_um });
    let answer = solved(&job);
    let limit_um = half_um - 1.65 * gauge_um;
    assert!((number(&answer, "/conformance/acceptance/upper_um") - limit_um).abs() < 1e-12);
    assert!((number(&answer, "/conformance/acceptance/lower_um") + limit_um).abs() < 1e-12);
    let (steps, reach) = (20_000, 8.0);
    let (mut accepted, mut good_and_accepted) = (0.0, 0.0);
    for step in 0..steps {
        let score = reach * (2.0 * (f64::from(step) + 0.5) / f64::from(steps) - 1.0);
        let weight =
            (-0.5 * score * score).exp() / (2.0 * std::f64::consts::PI).sqrt() * 2.0 * reach / f64::from(steps);
        let error_um = own_um * score;
        let read = below((limit_um - error_um) / gauge_um) - below((-limit_um - error_um) / gauge_um);
        accepted += weight * read;
        good_and_accepted += if error_um.abs() <= half_um { weight * read } else { 0.0 };
    }
    let good = 1.0 - 2.0 * below(-half_um / own_um);
    let error = number(&answer, "/conformance/acceptance/numerical_error");
    for (name, exact, relative) in [
        ("accepted", accepted, 0.0),
        ("bad_among_accepted", 1.0 - good_and_accepted / accepted, 0.1),
        ("good_and_rejected", good - good_and_accepted, 0.0),
    ] {
        let found = number(&answer, &format!("/conformance/acceptance/{name}"));
        assert!((found - exact).abs() < error.max(1e-3) + relative * exact, "{name}: {found} {exact}");
        assert!(relative <= 0.0 || (found - exact).abs() < 2e-4, "{name}: {found} {exact}");
    }
    // A gauge that leaves nothing to accept.
    job["uncertainty"]["measurement"] = json!({ "standard_uncertainty_um": half_um });
    let answer = DeflectionCompensation::run(&prepared(job), &Unwatched).unwrap();
    assert!(answer.output.conformance.unwrap().acceptance.is_none());
    assert!(answer.warnings.iter().any(|warning| warning.code == "gauge_too_uncertain"));
}

#[test]
fn a_wider_tolerance_and_a_smaller_width_never_lower_the_probability() {
    let quantities = |percent: f64| {
        json!([{ "quantity": "force", "distribution": { "kind": "normal", "standard_uncertainty_percent": percent } },
               { "quantity": "tool_setting", "distribution": { "kind": "normal", "standard_uncertainty_um": 3 } }])
    };
    let probability = |percent: f64, width: f64| {
        number(&solved(&job(&quantities(percent), &json!({ "diameter_um": width }))), "/conformance/joint/probability")
    };
    let wider: Vec<f64> = [10.0, 20.0, 40.0, 80.0].map(|width| probability(10.0, width)).to_vec();
    assert!(wider.windows(2).all(|pair| pair[1] > pair[0]), "{wider:?}");
    let smaller: Vec<f64> = [20.0, 10.0, 5.0, 1.0].map(|percent| probability(percent, 20.0)).to_vec();
    assert!(smaller.windows(2).all(|pair| pair[1] >= pair[0] - 1e-6), "{smaller:?}");
}

#[test]
fn what_is_halved_gives_the_probability_that_is_told() {
    let quantity = |percent: f64, um: f64| {
        json!([{ "quantity": "force", "distribution": { "kind": "lognormal", "log_standard_deviation": percent / 100.0 } },
               { "quantity": "tool_setting", "distribution": { "kind": "normal", "standard_uncertainty_um": um } }])
    };
    let tolerance = json!({ "diameter_um": 30 });
    let whole = solved(&job(&quantity(12.0, 4.0), &tolerance));
    for (name, halved) in [("force", quantity(6.0, 4.0)), ("tool_setting", quantity(12.0, 2.0))] {
        let told = whole["conformance"]["contributions"].as_array().unwrap();
        let told = told.iter().find(|one| one["quantity"] == name).unwrap();
        let then = solved(&job(&halved, &tolerance));
        let joint = &then["conformance"]["joint"];
        let difference = number(told, "/joint_probability_if_halved") - number(joint, "/probability");
        assert!(difference.abs() < 0.005 + number(joint, "/numerical_error"), "{name}: {difference}");
    }
}

/// Diameter errors of a shaft that is cut along commands with forces, compliances and a tool that are not quite the stated
/// ones: by the forward model, which shares no code with what is judged but the cut itself.
fn cut(job: &Value, z_mm: &[f64], commands_mm: &[f64], [force, stiffness, setting_um]: [f64; 3]) -> Vec<f64> {
    let mut job = with_compliance(&with_force(job, force), 1.0 / stiffness);
    for object in ["tolerance", "uncertainty", "aim"] {
        job.as_object_mut().unwrap().remove(object);
    }
    let commands: Vec<Option<f64>> = commands_mm.iter().map(|command| Some(command + setting_um / 1000.0)).collect();
    cut_with(&job, z_mm, &commands)
}

/// How many shafts are drawn.
fn shafts(in_the_suite: usize) -> usize {
    std::env::var("PRECUT_CERTAINTY").ok().and_then(|text| text.parse().ok()).unwrap_or(in_the_suite)
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|one| one.as_f64().unwrap()).collect()
}

fn is_good(errors: &[f64], lower: f64, upper: f64) -> bool {
    errors.iter().all(|error| (lower..=upper).contains(error))
}

/// Standard deviations of force, stiffness (relative) and of the tool's setting, um.
const WIDTHS: [f64; 3] = [0.12, 0.1, 3.0];

pub(crate) fn uncertain_job(tolerance: &Value) -> Value {
    let normal = |name: &str, width: Value| json!({ "quantity": name, "distribution": width });
    job(
        &json!([
            normal("force", json!({ "kind": "lognormal", "log_standard_deviation": WIDTHS[0] })),
            normal("stiffness", json!({ "kind": "lognormal", "log_standard_deviation": WIDTHS[1] })),
            normal("tool_setting", json!({ "kind": "normal", "standard_uncertainty_um": WIDTHS[2] }))
        ]),
        tolerance,
    )
}

/// A standard normal number.
fn normal(draw: &mut Draw) -> f64 {
    let share = draw.share().clamp(1e-10, 1.0 - 1e-10);
    -std::f64::consts::SQRT_2 * statrs::function::erf::erfc_inv(2.0 * share)
}

/// What a set-up really is.
fn truth(draw: &mut Draw) -> [f64; 3] {
    [(WIDTHS[0] * normal(draw)).exp(), (WIDTHS[1] * normal(draw)).exp(), WIDTHS[2] * normal(draw)]
}

/// Commands of the last cut at the stations of the answer.
fn commands(answer: &Value) -> (Vec<f64>, Vec<f64>) {
    let stations = &answer["stations"];
    (numbers(&stations["z_mm"]), numbers(&stations["commanded_diameter_mm"]))
}

#[test]
fn shafts_are_good_as_often_as_said() {
    let count = shafts(400);
    let mut draw = Draw::new(7);
    for (lower, upper) in [(-12.0, 12.0), (-20.0, 20.0), (-30.0, 30.0), (-8.0, 25.0)] {
        let job = uncertain_job(&json!({ "diameter_upper_um": upper, "diameter_lower_um": lower }));
        let answer = solved(&job);
        let told = number(&answer, "/conformance/joint/probability");
        let (z, commands) = commands(&answer);
        let good = (0..count).filter(|_| is_good(&cut(&job, &z, &commands, truth(&mut draw)), lower, upper)).count();
        let share = good as f64 / count as f64;
        let deviation = (told * (1.0 - told) / count as f64).sqrt();
        eprintln!("{lower} to {upper}: told {told:.4}, {good} of {count} good, {share:.4}");
        assert!((share - told).abs() < 3.0 * deviation + 0.005, "{lower} to {upper}: told {told}, {share} of {count}");
    }
}

#[test]
fn an_aim_that_is_advised_is_as_good_as_told() {
    let tolerance = json!({ "diameter_upper_um": 0.0, "diameter_lower_um": -40.0 });
    let job = uncertain_job(&tolerance);
    let answer = solved(&job);
    let advice = answer["conformance"]["advice"].as_array().unwrap();
    let aim = advice.iter().find(|one| one["action"]["kind"] == "shift_aim").unwrap();
    let mut aimed = job.clone();
    aimed["aim"] = json!({ "kind": "most_probable" });
    let then = solved(&aimed);
    let joint = number(&then, "/conformance/joint/probability");
    assert!((joint - number(aim, "/joint_probability")).abs() < 0.004, "{joint} {aim}");
    assert!(joint > number(&answer, "/conformance/joint/probability"));
    // The aim is what the command is shifted by.
    let shift_um = number(&then, "/aim_shift_um");
    let (before, after) = (commands(&answer).1, commands(&then).1);
    assert!(before.iter().zip(&after).all(|(b, a)| ((a - b) * 1000.0 - shift_um).abs() < 1e-6));
    // And shafts that are cut like that are good as often as said.
    let count = shafts(300);
    let (mut draw, (z, commands)) = (Draw::new(11), commands(&then));
    let good = (0..count).filter(|_| is_good(&cut(&job, &z, &commands, truth(&mut draw)), -40.0, 0.0)).count() as f64;
    let share = good / count as f64;
    assert!((share - joint).abs() < 3.0 * (joint * (1.0 - joint) / count as f64).sqrt() + 0.005, "{share} {joint}");
}

#[test]
fn a_first_part_that_is_measured_as_advised_helps_as_told() {
    let (lower, upper) = (-15.0, 15.0);
    let job = uncertain_job(&json!({ "diameter_um": upper - lower }));
    let answer = solved(&job);
    let advice = answer["conformance"]["advice"].as_array().unwrap();
    let first = advice.iter().find(|one| one["action"]["kind"] == "measure_first_part").unwrap();
    let of = |name: &str| number(&first["action"], &format!("/{name}"));
    let (z, commands) = commands(&answer);
    let station = z.iter().position(|z| (z - of("z_mm")).abs() < 1e-6).unwrap_or_else(|| {
        // Between two stations of the answer the nearer one.
        z.iter().position(|z| (z - of("z_mm")).abs() <= 15.0).unwrap()
    });
    let count = shafts(400);
    let mut draw = Draw::new(13);
    let good = (0..count)
        .filter(|_| {
            let truth = truth(&mut draw);
            let reading = cut(&job, &z, &commands, truth)[station] + of("gauge_um") * normal(&mut draw);
            let shift = of("shift_as_expected_um") + of("shift_um_per_um") * (reading - of("expected_um"));
            let shifted: Vec<f64> = commands.iter().map(|command| command + shift / 1000.0).collect();
            is_good(&cut(&job, &z, &shifted, truth), lower, upper)
        })
        .count() as f64;
    let (share, told) = (good / count as f64, number(first, "/joint_probability"));
    eprintln!("measured: told {told}, {share} of {count}; before {}", answer["conformance"]["joint"]);
    assert!((share - told).abs() < 3.0 * (told * (1.0 - told) / count as f64).sqrt() + 0.015, "{share} {told}");
}

#[test]
fn what_cannot_be_is_refused_with_what_can() {
    let refused = |quantities: Value, more: Value| {
        let mut job = job(&quantities, &json!({ "diameter_um": 30 }));
        for (name, value) in more.as_object().unwrap() {
            match value.as_object() {
                Some(fields) => fields.iter().for_each(|(field, value)| job[name][field] = value.clone()),
                None => job[name] = value.clone(),
            }
        }
        crate::deflection_faults::faults(job)
    };
    let force = |distribution: Value| json!({ "quantity": "force", "distribution": distribution });
    let percent = |percent: f64| force(json!({ "kind": "normal", "standard_uncertainty_percent": percent }));
    let setting = |distribution: Value| json!({ "quantity": "tool_setting", "distribution": distribution });
    let um = json!({ "kind": "normal", "standard_uncertainty_um": 3 });
    for (code, quantities, more) in [
        ("normal_reaches_zero", json!([percent(30.0)]), json!({})),
        ("unit_of_quantity", json!([force(um.clone())]), json!({})),
        (
            "unit_of_quantity",
            json!([setting(json!({ "kind": "lognormal", "log_standard_deviation": 0.1 }))]),
            json!({}),
        ),
        ("duplicate_quantity", json!([percent(10.0), percent(5.0)]), json!({})),
        (
            "bad_correlation",
            json!([percent(10.0)]),
            json!({ "uncertainty": { "correlations": [{ "between": ["force", "force"], "coefficient": 0.5 }] } }),
        ),
        (
            "correlations_contradict",
            json!([percent(10.0), setting(um.clone()), { "quantity": "stiffness", "distribution": { "kind": "lognormal", "log_standard_deviation": 0.1 } }]),
            json!({ "uncertainty": { "correlations": [
                { "between": ["force", "tool_setting"], "coefficient": 0.9 },
                { "between": ["tool_setting", "stiffness"], "coefficient": 0.9 },
                { "between": ["force", "stiffness"], "coefficient": -0.9 }] } }),
        ),
        ("tolerance_given_twice", json!([]), json!({ "tolerance": { "diameter_upper_um": 3 } })),
        (
            "limits_crossed",
            json!([]),
            json!({ "tolerance": { "diameter_um": null, "diameter_upper_um": -3, "diameter_lower_um": 2 } }),
        ),
        (
            "aim_without_size_limits",
            json!([]),
            json!({ "tolerance": { "diameter_um": null, "diameter_upper_um": 3 }, "aim": { "kind": "middle" } }),
        ),
    ] {
        let codes: Vec<&str> = refused(quantities, more).iter().map(|fault| fault.code).collect();
        assert_eq!(codes, [code]);
    }
}

#[test]
fn the_uncertainty_along_the_shaft_is_that_of_the_stated_quantities() {
    let tolerance = json!({ "diameter_um": 40 });
    let mut percent = job(&json!([]), &tolerance);
    percent["uncertainty"]["force_percent"] = json!(20);
    let stated = job(
        &json!([{ "quantity": "force", "distribution": { "kind": "normal", "standard_uncertainty_percent": 20 } }]),
        &tolerance,
    );
    let [by_percent, by_quantity] =
        [percent, stated].map(|job| numbers(&solved(&job)["stations"]["diameter_uncertainty_um"]));
    assert!(by_percent[10] > 1.0);
    assert_eq!(by_percent, by_quantity);
}

#[test]
fn correlated_quantities_have_no_shares_and_none_is_said_to_have_most() {
    let normal = json!({ "kind": "normal", "standard_uncertainty_percent": 10 });
    let mut together = job(
        &json!([{ "quantity": "force", "distribution": normal }, { "quantity": "stiffness", "distribution": normal }]),
        &json!({ "diameter_um": 40 }),
    );
    together["uncertainty"]["correlations"] = json!([{ "between": ["force", "stiffness"], "coefficient": -0.5 }]);
    let answer = DeflectionCompensation::run(&prepared(together), &Unwatched).unwrap();
    let told = answer.explanation.iter().find(|message| message.code == "probably_good").unwrap();
    assert!(told.values.get("quantity").is_none());
    let contributions = answer.output.conformance.unwrap().contributions;
    assert!(contributions.iter().all(|one| one.share_of_variance.is_none()));
}
