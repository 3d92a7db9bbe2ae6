//! A machine's compliances from gauge readings: made by closed forms of the bar, found again, and the advice done.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use std::f64::consts::PI;

use precut_calc::calculator::{Answer, Calculator, Check, Failure, Finding, Unwatched, Value as Said, Violations};
use precut_calc::compliance_fit::{ComplianceFit, Job, Outcome, Part};
use precut_calc::num::stats::Resampler;
use serde_json::{Value, json};

const MODULUS: f64 = 210_000.0;
const POISSON: f64 = 0.3;
const LENGTH_MM: f64 = 600.0;
const DIAMETER_MM: f64 = 80.0;

fn faults(text: &Value) -> Vec<&'static str> {
    let job: Job = serde_json::from_value(text.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec().into_iter().map(|finding| finding.code).collect()
}

fn try_solve(text: &Value) -> Result<Answer<Outcome>, Failure> {
    assert_eq!(faults(text), Vec::<&str>::new());
    let mut job: Job = serde_json::from_value(text.clone()).unwrap();
    ComplianceFit::fill(&mut job);
    ComplianceFit::run(&job, &Unwatched)
}

fn solve(text: &Value) -> Answer<Outcome> {
    try_solve(text).unwrap()
}

fn refused(text: &Value) -> Finding {
    match try_solve(text) {
        Err(Failure::OutOfModel(finding)) => finding,
        other => panic!("{other:?}"),
    }
}

fn warned(answer: &Answer<Outcome>) -> Vec<&'static str> {
    answer.warnings.iter().map(|finding| finding.code).collect()
}

fn value(outcome: &Outcome, part: Part) -> f64 {
    outcome.compliances.iter().find(|one| one.of == part).unwrap().value
}

fn inertia() -> f64 {
    PI * DIAMETER_MM.powi(4) / 64.0
}

/// 1/(k G A) of the solid bar, Cowper's k.
fn shear_per_n() -> f64 {
    let k = 6.0 * (1.0 + POISSON) / (7.0 + 6.0 * POISSON);
    2.0 * (1.0 + POISSON) / (MODULUS * k * 0.25 * PI * DIAMETER_MM * DIAMETER_MM)
}

/// Displacement at `x` by a unit force at `a`, bar on two rigid supports at its ends, mm/N.
fn between_supports(a: f64, x: f64) -> f64 {
    let (near, far) = (a.min(x), LENGTH_MM - a.max(x));
    let (l, ei) = (LENGTH_MM, MODULUS * inertia());
    near * far * (l * l - near * near - far * far) / (6.0 * ei * l) + near * far / l * shear_per_n()
}

/// The same, bar clamped at its left end.
fn clamped(a: f64, x: f64) -> f64 {
    let (near, far) = (a.min(x), a.max(x));
    near * near * (3.0 * far - near) / (6.0 * MODULUS * inertia()) + near * shear_per_n()
}

fn bar(supports: Value, rows: Vec<Value>) -> Value {
    json!({
        "bar": {
            "segments": [{"length_mm": LENGTH_MM, "diameter_mm": DIAMETER_MM}],
            "youngs_modulus_n_per_mm2": MODULUS, "poisson_ratio": POISSON,
        },
        "supports": supports, "measurements": rows,
    })
}

fn centres() -> Value {
    json!([{"kind": "centre", "z_mm": 0}, {"kind": "centre", "z_mm": LENGTH_MM}])
}

/// Reading between centres of these compliances, um.
fn centred_um([head, tail]: [f64; 2], force: f64, a: f64, x: f64) -> f64 {
    let share = |z: f64| z / LENGTH_MM;
    let sprung = head * (1.0 - share(a)) * (1.0 - share(x)) + tail * share(a) * share(x);
    force * (1e3 * between_supports(a, x) + sprung)
}

fn row(force: f64, a: f64, x: f64, reading: f64) -> Value {
    json!({"z_load_mm": a, "z_reading_mm": x, "force_n": force, "reading_um": reading})
}

fn near(got: f64, wanted: f64, relative: f64) {
    assert!((got - wanted).abs() <= relative * wanted.abs(), "{got} instead of {wanted}");
}

#[test]
fn two_loads_give_both_centres_and_a_reading_at_the_tool_the_carriage() {
    let machine = [0.021, 0.034];
    let mut rows: Vec<Value> = [(60.0, 60.0), (500.0, 500.0)]
        .iter()
        .map(|&(a, x)| row(800.0, a, x, centred_um(machine, 800.0, a, x)))
        .collect();
    rows.push(json!({"at": "tool", "force_n": 800.0, "reading_um": 800.0 * 0.018}));
    let answer = solve(&bar(centres(), rows));
    let outcome = &answer.output;
    near(value(outcome, Part::Headstock), machine[0], 1e-9);
    near(value(outcome, Part::Tailstock), machine[1], 1e-9);
    near(value(outcome, Part::Carriage), 0.018, 1e-9);
    assert_eq!((outcome.fit.spare_rows, outcome.fit.p_value), (0, None));
    assert!(warned(&answer).contains(&"no_spare_readings"));
    // What bends is the bar alone.
    near(outcome.rows[0].bending_um, 800.0 * 1e3 * between_supports(60.0, 60.0), 1e-9);
    let places: Vec<&str> = outcome.set.keys().map(String::as_str).collect();
    let compliance = |name: &str| format!("/compliance/{name}_um_per_n");
    assert_eq!(places, ["carriage", "headstock_centre", "tailstock_centre"].map(compliance));
}

#[test]
fn a_chuck_gives_its_radial_and_its_rotational_compliance() {
    let (radial, rotation) = (0.006, 2.5e-9);
    let reading = |a: f64, x: f64| 400.0 * (1e3 * clamped(a, x) + radial + 1e3 * rotation * a * x);
    let rows = [(80.0, 80.0), (200.0, 200.0), (400.0, 400.0), (400.0, 100.0)];
    let rows = rows.iter().map(|&(a, x)| row(400.0, a, x, reading(a, x))).collect();
    let outcome = solve(&bar(json!([{"kind": "chuck", "z_mm": 0}]), rows)).output;
    near(value(&outcome, Part::Headstock), radial, 1e-9);
    near(value(&outcome, Part::HeadstockRotation), rotation, 1e-9);
    assert!(outcome.set.contains_key("/compliance/headstock_chuck_rotation_rad_per_n_mm"));
}

/// Where the shares themselves depend on the compliances: readings by the answer's own prediction of known ones, which
/// the closed forms above hold.
#[test]
fn a_bar_held_thrice_gives_what_it_was_made_with() {
    let held = |known: bool| {
        let mut supports = json!([
            {"kind": "chuck", "z_mm": 0}, {"kind": "steady_rest", "z_mm": 250}, {"kind": "centre", "z_mm": LENGTH_MM},
        ]);
        if known {
            supports[0]["compliance_um_per_n"] = json!(0.008);
            supports[0]["rotational_compliance_rad_per_n_mm"] = json!(3e-9);
            supports[1]["compliance_um_per_n"] = json!(0.05);
            supports[2]["compliance_um_per_n"] = json!(0.04);
        }
        supports
    };
    let stations = [40.0, 130.0, 250.0, 330.0, 420.0, 510.0, 590.0];
    let blank: Vec<Value> =
        stations.iter().flat_map(|&a| stations.iter().map(move |&x| row(900.0, a, x, 0.0))).collect();
    // The carriage is left to be found, so that there is something to find.
    let mut known = blank.clone();
    known.push(json!({"at": "tool", "force_n": 1.0, "reading_um": 0.0}));
    let made = solve(&bar(held(true), known)).output;
    let rows: Vec<Value> = blank
        .iter()
        .zip(&made.rows)
        .map(|(row, made)| {
            let mut row = row.clone();
            row["reading_um"] = json!(made.predicted_um);
            row
        })
        .collect();
    let outcome = solve(&bar(held(false), rows)).output;
    let wanted =
        [(Part::Headstock, 0.008), (Part::HeadstockRotation, 3e-9), (Part::SteadyRest, 0.05), (Part::Tailstock, 0.04)];
    for (part, wanted) in wanted {
        near(value(&outcome, part), wanted, 1e-7);
    }
}

#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    const DRAWS: u64 = 1000;
    let machine = [0.02, 0.035];
    let (mut inside, mut of) = (0, 0);
    for draw in 0..DRAWS {
        let mut noise = Resampler::new(41, draw);
        let rows = [60.0, 200.0, 400.0, 540.0]
            .iter()
            .map(|&z| row(1000.0, z, z, centred_um(machine, 1000.0, z, z) + noise.normal()))
            .collect();
        let outcome = solve(&bar(centres(), rows)).output;
        for (one, truth) in outcome.compliances.iter().zip(machine) {
            inside += u32::from(one.lower <= truth && truth <= one.upper);
            of += 1;
        }
    }
    // 2000 draws at 95 %: a standard error of 0.5 %; intervals that are widened for readings that do not fit hold a little more.
    let share = f64::from(inside) / f64::from(of);
    assert!((0.93..=0.97).contains(&share), "{share}");
}

#[test]
fn play_is_told_from_compliance_by_loads_both_ways() {
    let machine = [0.02, 0.03];
    let rows = [-1000.0, -500.0, 500.0, 1000.0]
        .iter()
        .flat_map(|&force: &f64| {
            [60.0, 540.0].map(|z| row(force, z, z, centred_um(machine, force, z, z) + 12.0 * force.signum()))
        })
        .collect();
    let mut job = bar(centres(), rows);
    let without = solve(&job);
    assert!(warned(&without).contains(&"readings_do_not_fit"), "{:?}", warned(&without));
    assert!(without.output.fit.widened > 1.0);
    job["play"] = json!(true);
    let outcome = solve(&job).output;
    near(value(&outcome, Part::PlayAtWork), 12.0, 1e-9);
    near(value(&outcome, Part::Headstock), machine[0], 1e-9);
    assert!(!outcome.set.keys().any(|place| place.contains("play")));
}

fn number(finding: &Finding, name: &str) -> f64 {
    match finding.values.get(name) {
        Some(Said::Number(number)) => *number,
        other => panic!("{name}: {other:?}"),
    }
}

/// The load that is advised where readings tell nothing is put, and they tell.
#[test]
fn what_cannot_be_told_apart_is_named_and_the_load_that_would_tell_tells() {
    let machine = [0.021, 0.034];
    let reading = |a: f64| row(800.0, a, a, centred_um(machine, 800.0, a, a));
    let mut rows = vec![reading(300.0), reading(300.0), reading(300.0)];
    let finding = refused(&bar(centres(), rows.clone()));
    assert_eq!(finding.code, "not_identifiable");
    assert_eq!(finding.values.get("names"), Some(&vec!["headstock", "tailstock"].into()));
    let (z, force) = (number(&finding, "z_load_mm"), number(&finding, "force_n"));
    rows.push(row(force, z, z, centred_um(machine, force, z, z)));
    let outcome = solve(&bar(centres(), rows)).output;
    near(value(&outcome, Part::Headstock), machine[0], 1e-8);

    // A load at a support says nothing of the other one.
    let rows = vec![reading(0.0), reading(0.0)];
    assert_eq!(refused(&bar(centres(), rows)).values.get("names"), Some(&vec!["tailstock"].into()));
}

/// What one more reading is said to narrow, it narrows so far.
#[test]
fn the_next_load_narrows_as_it_says() {
    let machine = [0.02, 0.035];
    let reading = |force: f64, z: f64| row(force, z, z, centred_um(machine, force, z, z));
    let mut rows: Vec<Value> = [250.0, 300.0, 350.0].iter().map(|&z| reading(300.0, z)).collect();
    let outcome = solve(&bar(centres(), rows.clone())).output;
    let next = outcome.next_load.unwrap();
    rows.push(reading(next.force_n, next.z_load_mm.unwrap()));
    let then = solve(&bar(centres(), rows)).output;
    let narrowed = then.compliances.iter().find(|one| one.of == next.narrows).unwrap();
    near(100.0 * narrowed.standard_uncertainty / narrowed.value, next.then_percent, 1e-6);
    assert!(next.then_percent < 0.7 * next.now_percent);
    // Readings that know all to a tenth need none.
    let many = [30.0, 570.0].iter().flat_map(|&z| vec![reading(5000.0, z); 3]).collect();
    assert_eq!(solve(&bar(centres(), many)).output.next_load, None);
}

#[test]
fn what_readings_do_not_show_stays_out_of_the_record() {
    let rows =
        [60.0, 200.0, 400.0, 540.0].iter().map(|&z| row(200.0, z, z, centred_um([0.0, 0.035], 200.0, z, z))).collect();
    let answer = solve(&bar(centres(), rows));
    assert!(warned(&answer).contains(&"compliance_not_seen"));
    assert!(!answer.output.set.contains_key("/compliance/headstock_centre_um_per_n"));
}

#[test]
fn what_cannot_be_a_test_is_refused() {
    let plain = || bar(centres(), vec![row(800.0, 60.0, 60.0, 9.0), row(800.0, 500.0, 500.0, 20.0)]);
    assert_eq!(faults(&plain()), Vec::<&str>::new());
    let changed = |pointer: &str, value: Value| {
        let mut job = plain();
        *job.pointer_mut(pointer).unwrap() = value;
        faults(&job)
    };
    assert_eq!(changed("/supports", json!([{"kind": "centre", "z_mm": 0}])), ["unstable_support"]);
    assert_eq!(
        changed("/supports", json!([{"kind": "chuck", "z_mm": 0}, {"kind": "chuck", "z_mm": 600}])),
        ["several_chucks", "too_few_readings"]
    );
    assert_eq!(changed("/supports/1/z_mm", json!(700)), ["support_outside_shaft"]);
    assert_eq!(changed("/measurements/0/z_load_mm", json!(700)), ["place_outside_bar"]);
    assert_eq!(changed("/measurements/0/z_load_mm", json!(null)), ["load_without_place"]);
    let at_tool = json!({"at": "tool", "z_reading_mm": 60, "force_n": 800, "reading_um": 9});
    assert_eq!(changed("/measurements/0", at_tool), ["gauge_at_tool", "too_few_readings"]);
    assert_eq!(changed("/measurements/0/force_n", json!(0)), ["load_of_nothing"]);
    assert_eq!(changed("/measurements", json!([row(800.0, 60.0, 60.0, 9.0)])), ["too_few_readings"]);
    assert_eq!(changed("/bar/youngs_modulus_n_per_mm2", json!(null)), ["elastic_constants_missing"]);
    let known = json!([
        {"kind": "centre", "z_mm": 0, "compliance_um_per_n": 0.1},
        {"kind": "centre", "z_mm": 600, "compliance_um_per_n": 0.1},
    ]);
    assert_eq!(changed("/supports", known), ["nothing_to_find"]);
}
