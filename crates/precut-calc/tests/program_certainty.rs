//! How probable it is that parts of a program are good: against parts that are driven one by one with forces, compliances, blanks and
//! tools drawn as the job states, each as a job of its own.
//!
//! `PRECUT_CERTAINTY` sets how many parts are drawn.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stderr, clippy::cast_precision_loss, missing_docs)]

use precut_calc::calculator::{Answer, Calculator as _, Check as _, Violations};
use precut_calc::program_compensation::{ErrorAlong, Outcome, ProgramCompensation};
use serde_json::{Value, json};

use crate::draw::Draw;
use crate::program_yielding::solve;

const EXAMPLE: &str = include_str!("../src/program_compensation/examples/slender_shaft.json");

/// The slender shaft, corrected, with a tolerance and what is uncertain about it.
fn job(tolerance: &Value) -> Value {
    let mut job: Value = serde_json::from_str(EXAMPLE).unwrap();
    // Two cylinders, so that a diameter between two places is known.
    let chamfer = "N150 G0 X18. Z2.\nN160 G1 Z0. F0.15\nN170 X22. Z-2.\nN180 Z-200.\n";
    let text = job["nc_program"].as_str().unwrap().to_owned();
    assert!(text.contains(chamfer));
    job["nc_program"] = json!(text.replace(chamfer, "N150 G0 X22. Z2.\nN180 G1 Z-200. F0.15\n"));
    job["tolerance"] = tolerance.clone();
    job["uncertainty"] = json!({ "defaults": false, "force_percent": 0, "stiffness_percent": 0, "quantities": [
        { "quantity": "force", "distribution": { "kind": "lognormal", "log_standard_deviation": 0.15 } },
        { "quantity": "stiffness", "distribution": { "kind": "normal", "standard_uncertainty_percent": 10 } },
        { "quantity": "tool_setting", "distribution": { "kind": "normal", "standard_uncertainty_um": 2 } },
        { "quantity": "stock_diameter", "distribution": { "kind": "normal", "standard_uncertainty_um": 100 } }] });
    job
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {value}"))
}

fn conformance(answer: &Answer<Outcome>) -> Value {
    serde_json::to_value(answer.output.conformance.as_ref().unwrap()).unwrap()
}

fn drawn_parts(in_the_suite: usize) -> usize {
    std::env::var("PRECUT_CERTAINTY").ok().and_then(|text| text.parse().ok()).unwrap_or(in_the_suite)
}

fn normal(draw: &mut Draw) -> f64 {
    (-2.0 * draw.share().max(1e-12).ln()).sqrt() * (2.0 * std::f64::consts::PI * draw.share()).cos()
}

/// The same with parts of the stiffness that are uncertain each by itself, and a spindle that scatters.
fn job_of_parts(tolerance: &Value) -> Value {
    let mut job = job(tolerance);
    job["effects"] = json!([{ "kind": "spindle_scatter", "sd_um": 0.8 }]);
    let normal = |quantity: &str, percent: f64| json!({ "quantity": quantity, "distribution": { "kind": "normal", "standard_uncertainty_percent": percent } });
    job["uncertainty"]["quantities"] = json!([
        normal("youngs_modulus", 12.0),
        normal("headstock_compliance", 20.0),
        normal("tailstock_compliance", 20.0),
        normal("carriage_compliance", 20.0)
    ]);
    job
}

/// Forces, compliances and parts of them times these; added to diameters that are set and left, and to the blank, um.
#[derive(Clone, Copy)]
struct Truth {
    force: f64,
    stiffness: f64,
    youngs_modulus: f64,
    headstock: f64,
    tailstock: f64,
    carriage: f64,
    setting_um: f64,
    stock_um: f64,
    scatter_um: f64,
}

const STATED: Truth = Truth {
    force: 1.0,
    stiffness: 1.0,
    youngs_modulus: 1.0,
    headstock: 1.0,
    tailstock: 1.0,
    carriage: 1.0,
    setting_um: 0.0,
    stock_um: 0.0,
    scatter_um: 0.0,
};

impl Truth {
    fn of(draw: &mut Draw) -> Self {
        Self {
            force: (0.15 * normal(draw)).exp(),
            stiffness: 1.0 + 0.1 * normal(draw),
            setting_um: 2.0 * normal(draw),
            stock_um: 100.0 * normal(draw),
            ..STATED
        }
    }

    fn of_parts(draw: &mut Draw) -> Self {
        Self {
            youngs_modulus: 1.0 + 0.12 * normal(draw),
            headstock: 1.0 + 0.2 * normal(draw),
            tailstock: 1.0 + 0.2 * normal(draw),
            carriage: 1.0 + 0.2 * normal(draw),
            // Of the radius it has 0.8 um.
            scatter_um: 1.6 * normal(draw),
            ..STATED
        }
    }
}

fn times(value: &mut Value, factor: f64) {
    if let Some(number) = value.as_f64() {
        *value = json!(number * factor);
    }
}

/// A program with all X so much larger.
fn set_out(text: &str, by_mm: f64) -> String {
    let word = |word: &str| match word.strip_prefix('X').and_then(|number| number.parse::<f64>().ok()) {
        Some(x) => format!("X{:.5}", x + by_mm),
        None => word.to_owned(),
    };
    let line = |line: &str| line.split(' ').map(word).collect::<Vec<_>>().join(" ");
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// What a program leaves of a part as it really is.
fn cut(job: &Value, text: &str, truth: Truth) -> ErrorAlong {
    let mut real = job.clone();
    real["mode"] = json!({ "kind": "read" });
    real["nc_program"] = json!(set_out(text, truth.setting_um / 1e3));
    real.as_object_mut().unwrap().retain(|field, _| field != "tolerance" && field != "uncertainty");
    for field in ["specific_normal_force_n_per_mm2", "specific_cutting_force_n_per_mm2"] {
        times(&mut real["force"][field], truth.force);
    }
    for row in real["stock"]["profile"].as_array_mut().unwrap() {
        row["diameter_mm"] = json!(row["diameter_mm"].as_f64().unwrap() + truth.stock_um / 1e3);
    }
    let stock = real["stock"].as_object_mut().unwrap();
    stock.retain(|field, _| field != "material");
    stock.insert("youngs_modulus_n_per_mm2".to_owned(), json!(210_000.0 * truth.stiffness * truth.youngs_modulus));
    for (support, own) in real["supports"].as_array_mut().unwrap().iter_mut().zip([truth.headstock, truth.tailstock]) {
        times(&mut support["compliance_um_per_n"], own / truth.stiffness);
        if support["kind"] == "chuck" {
            times(&mut support["rotational_compliance_rad_per_n_mm"], 1.0 / truth.stiffness);
        }
    }
    times(&mut real["carriage"]["compliance_um_per_n"], truth.carriage / truth.stiffness);
    let mut contour = solve(&real).output.yielding.unwrap().contour;
    contour.diameter_error_um.iter_mut().for_each(|error| *error += truth.scatter_um);
    contour
}

/// A place of the contour that is judged: where, and the diameter that is meant.
type Place = (f64, f64);

/// The places of both corrected cylinders outside transitions.
fn judged(answer: &Answer<Outcome>) -> Vec<Place> {
    let compensation = answer.output.compensation.as_ref().unwrap();
    let contour = &compensation.contour;
    let is_judged =
        |z: f64| !compensation.transitions.iter().any(|one| (one.z_mm..=one.z_mm + one.length_mm).contains(&z));
    let is_cylinder = |wanted: f64| [22.0, 26.0].iter().any(|diameter| (wanted - diameter).abs() < 1e-6);
    let all =
        (0..contour.z_mm.len()).filter(|&i| is_judged(contour.z_mm[i]) && is_cylinder(contour.wanted_diameter_mm[i]));
    all.map(|i| (contour.z_mm[i], contour.wanted_diameter_mm[i])).collect()
}

/// Largest and smallest error of a part at these places.
fn ends_um(contour: &ErrorAlong, places: &[Place]) -> [f64; 2] {
    let diameter = |i: usize| contour.wanted_diameter_mm[i] + contour.diameter_error_um[i] / 1e3;
    let error = |&(z, wanted): &Place| {
        let behind = contour.z_mm.partition_point(|place| *place < z).min(contour.z_mm.len() - 1);
        let before = behind.checked_sub(1)?;
        // Beside a step the nose leaves it round.
        if [before, behind].iter().any(|&i| (contour.wanted_diameter_mm[i] - wanted).abs() > 0.1) {
            return None;
        }
        let share = (z - contour.z_mm[before]) / (contour.z_mm[behind] - contour.z_mm[before]);
        Some((diameter(before) + share * (diameter(behind) - diameter(before)) - wanted) * 1e3)
    };
    let all: Vec<f64> = places.iter().filter_map(error).collect();
    assert!(all.len() + 20 > places.len(), "{} of {}", all.len(), places.len());
    [all.iter().copied().fold(f64::NEG_INFINITY, f64::max), all.iter().copied().fold(f64::INFINITY, f64::min)]
}

fn returned(answer: &Answer<Outcome>) -> String {
    answer.output.compensation.as_ref().unwrap().nc_program.clone()
}

#[test]
fn parts_are_good_as_often_as_said() {
    type Case = (u64, Value, fn(&Value) -> Value, fn(&mut Draw) -> Truth);
    let cases: [Case; 3] = [
        (1, json!({ "diameter_um": 16 }), job, Truth::of),
        (2, json!({ "form_um": 7, "diameter_upper_um": 8 }), job, Truth::of),
        (3, json!({ "diameter_um": 9 }), job_of_parts, Truth::of_parts),
    ];
    for (seed, tolerance, job, truth) in cases {
        let job = job(&tolerance);
        let answer = solve(&job);
        let told = conformance(&answer);
        let (probability, error) = (number(&told, "/joint/probability"), number(&told, "/joint/numerical_error"));
        eprintln!("{told}");
        assert!(error <= 0.01, "{error}");
        let (text, places) = (returned(&answer), judged(&answer));
        let mut draw = Draw::new(seed);
        let count = drawn_parts(150);
        let is_good = |[largest, smallest]: [f64; 2]| {
            let form = tolerance.get("form_um").and_then(Value::as_f64);
            let whole = tolerance.get("diameter_um").and_then(Value::as_f64);
            let upper = tolerance.get("diameter_upper_um").and_then(Value::as_f64);
            form.is_none_or(|form| largest - smallest <= form)
                && whole.is_none_or(|whole| largest <= 0.5 * whole && smallest >= -0.5 * whole)
                && upper.is_none_or(|upper| largest <= upper)
        };
        let good = (0..count).filter(|_| is_good(ends_um(&cut(&job, &text, truth(&mut draw)), &places))).count() as f64;
        let share = good / count as f64;
        let scatter = (probability * (1.0 - probability) / count as f64).sqrt();
        eprintln!("{share} of {count}, told {probability}");
        // Three deviations of the draws, and 0.01 for what lies beside the places at which both are asked.
        assert!((share - probability).abs() <= 3.0 * scatter + error + 0.01, "{share} {probability}");
    }
}

#[test]
fn what_is_halved_gives_the_probability_that_is_told() {
    let whole = job(&json!({ "diameter_um": 16 }));
    let told = conformance(&solve(&whole));
    let first = &told["contributions"][0];
    assert!(number(&told, "/contributions/0/share_of_variance") >= number(&told, "/contributions/1/share_of_variance"));
    assert_eq!(first["quantity"], "force");
    let mut half = whole.clone();
    half["uncertainty"]["quantities"][0]["distribution"]["log_standard_deviation"] = json!(0.075);
    let then = conformance(&solve(&half));
    let (told_half, real_half) = (number(first, "/joint_probability_if_halved"), number(&then, "/joint/probability"));
    // Both have their error, and what is told moves by the surface alone.
    let slack = 2.0 * (number(&told, "/joint/numerical_error") + number(&then, "/joint/numerical_error")) + 0.005;
    assert!((told_half - real_half).abs() <= slack, "{told_half} {real_half}");
    assert!(real_half > number(&told, "/joint/probability") + 0.02);
}

#[test]
fn a_program_that_is_not_corrected_is_judged_as_it_is() {
    let mut job = job(&json!({ "diameter_um": 40 }));
    let corrected = conformance(&solve(&job));
    job["mode"] = json!({ "kind": "read" });
    let as_it_is = conformance(&solve(&job));
    assert!(number(&corrected, "/joint/probability") > 0.99, "{corrected}");
    assert!(number(&as_it_is, "/joint/probability") < 0.1, "{as_it_is}");
}

/// What is driven more often, longer or through more moves is expected to take longer.
#[test]
fn what_takes_longer_is_expected_to() {
    let ms = |job: &Value| ProgramCompensation::cost(&serde_json::from_value(job.clone()).unwrap()).ms;
    let mut plain = job(&json!({}));
    plain.as_object_mut().unwrap().retain(|field, _| field != "tolerance" && field != "uncertainty");
    let mut read = plain.clone();
    read["mode"] = json!({ "kind": "read" });
    let mut short = plain.clone();
    short["nc_program"] = json!(plain["nc_program"].as_str().unwrap().replace("Z-380.", "Z-210."));
    // As many lines; a cycle over them makes twenty passes.
    let head = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X36. Z2.\n";
    let of = |depth: &str| {
        let mut rough = read.clone();
        let contour = "N10 G0 X16.\nG1 Z-200. F0.1\nX26.\nZ-380.\nN20 X36.\n";
        rough["nc_program"] =
            json!(format!("{head}G71 U{depth} R0.5\nG71 P10 Q20 U0.6 W0.1 F0.25\n{contour}G0 X100.\nM30\n"));
        rough
    };
    for (less, more, times) in [
        (&read, &plain, 1.5),
        (&short, &plain, 1.05),
        (&plain, &job(&json!({ "diameter_um": 16 })), 10.0),
        (&of("5."), &of("0.5"), 3.0),
    ] {
        assert!(ms(more) > times * ms(less), "{} {}: {less}\n{more}", ms(less), ms(more));
    }
    assert!(ms(&read) < 10.0);
}

/// The least and the most that are told while the force is anything within bounds are those of parts that are driven one by one at the
/// ends: the program is that of the stated force, and more force leaves the part thicker.
#[test]
fn parts_within_bounds_are_good_as_often_as_said_at_the_ends() {
    let (upper_um, percent) = (3.0, 20.0);
    let mut job = job(&json!({ "diameter_upper_um": upper_um }));
    job["uncertainty"]["quantities"][0]["distribution"] = json!({ "kind": "interval", "half_width_percent": percent });
    let answer = solve(&job);
    let told = conformance(&answer);
    eprintln!("{told}");
    assert_eq!(told["joint"]["interval_search"], "ends");
    let (text, places, count) = (returned(&answer), judged(&answer), drawn_parts(120));
    let mut draw = Draw::new(4);
    let mut shares = Vec::new();
    for (pointer, force) in
        [("/joint/probability", 1.0 + percent / 100.0), ("/joint/probability_most", 1.0 - percent / 100.0)]
    {
        let is_good = |[largest, _]: [f64; 2]| largest <= upper_um;
        let mut part = || cut(&job, &text, Truth { force, ..Truth::of(&mut draw) });
        let good = (0..count).filter(|_| is_good(ends_um(&part(), &places))).count() as f64;
        let (probability, share) = (number(&told, pointer), good / count as f64);
        let scatter = (probability * (1.0 - probability) / count as f64).sqrt();
        eprintln!("force times {force}: {share} of {count}, told {probability}");
        // As where the force is drawn.
        let slack = 3.0 * scatter + number(&told, "/joint/numerical_error") + 0.01;
        assert!((share - probability).abs() <= slack, "{force}: {share} {probability}");
        shares.push(probability);
    }
    assert!(shares[0] > 0.02 && shares[0] + 0.2 < shares[1], "{shares:?}");
}

#[test]
fn the_stamp_says_how_probably_the_limits_are_kept() {
    let interval = json!({ "kind": "interval", "half_width_percent": 10 });
    for (bounds, at_least) in [(None, ""), (Some(interval), "at least ")] {
        let mut job = job(&json!({ "diameter_um": 16 }));
        job["mode"]["stamp"] = json!(true);
        if let Some(bounds) = bounds {
            job["uncertainty"]["quantities"][0]["distribution"] = bounds;
        }
        let answer = solve(&job);
        let parsed = serde_json::from_value(job).unwrap();
        let file = ProgramCompensation::returned(&parsed, &answer.output, "precut").unwrap().unwrap();
        let probability = number(&conformance(&answer), "/joint/probability");
        let said = format!("lines, within all limits with probability {at_least}{probability:.3})");
        let is_said = |line: &str| line.starts_with("(precut shifts X") && line.ends_with(&said);
        assert!(file.text.lines().any(is_said), "{said}: {}", file.text);
    }
}

#[test]
fn limits_without_force_and_doubts_without_limits_are_refused() {
    let faults = |job: Value| {
        let job: <ProgramCompensation as precut_calc::calculator::Calculator>::Input =
            serde_json::from_value(job).unwrap();
        let mut violations = Violations::default();
        job.check(&mut violations);
        violations.into_vec().into_iter().map(|fault| fault.code).collect::<Vec<_>>()
    };
    let mut without_force = job(&json!({ "diameter_um": 16 }));
    without_force["mode"] = json!({ "kind": "read" });
    without_force.as_object_mut().unwrap().retain(|field, _| field != "force");
    assert_eq!(faults(without_force), ["tolerance_without_force"]);
    assert_eq!(faults(job(&json!({}))), ["uncertainty_without_tolerance"]);
    let mut twice = job(&json!({ "diameter_um": 16 }));
    let quantities = twice["uncertainty"]["quantities"].as_array_mut().unwrap();
    quantities.push(quantities[0].clone());
    assert_eq!(faults(twice), ["duplicate_quantity"]);
}
