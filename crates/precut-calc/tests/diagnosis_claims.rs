//! What a diagnosis says is held against what the same answer says beside it, and against what comes of doing it.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::collections::BTreeSet;
use std::path::Path;

use precut_calc::calculator::{Answer, Calculator, Check, Diagnosable, Unwatched, Value as Said, Violations};
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::diagnosis::{Diagnosis, ResultOf, VerdictClass, best_evidence};
use precut_calc::feed_schedule::FeedSchedule;
use precut_calc::fixture_stability::FixtureStability;
use precut_calc::ring_roundness::RingRoundness;
use precut_trials::{Class, Random, deflection, fixture, machinability, ring};
use serde_json::{Value, json};

use crate::blind_trials::{self, Draw, seed_of};

/// How many draws: a tenth of what is asked for, all of it where `PRECUT_CLAIMS` says how many.
fn draws(in_the_suite: u64) -> u64 {
    blind_trials::number("PRECUT_CLAIMS", in_the_suite)
}

fn case(name: &str) -> Value {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("tests/reference/diagnosis");
    let text = std::fs::read_to_string(folder.join(format!("case-{name}.json"))).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// A table that others measured; `None` where it is not there, which CI does not accept.
fn measured_case(name: &str) -> Option<Value> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .join("../../../shared/cases/diagnosis")
        .join(format!("{name}.json"));
    let text = std::fs::read_to_string(path);
    assert!(text.is_ok() || std::env::var("CI").is_err(), "{name} must be there");
    serde_json::from_str(&text.ok()?).unwrap()
}

fn answered<M: Diagnosable>(request: &Value, options: Value) -> Answer<ResultOf<M>> {
    Diagnosis::<M>::run(&blind_trials::job::<M>(request, options), &Unwatched).unwrap()
}

/// An answer does not speak against its own tests; the base is held against them at a level of its own.
fn fits_its_tests<M: Diagnosable>(answer: &Answer<ResultOf<M>>, level_of_base: f64, of: &str) {
    let result = &answer.output;
    let fits = |p: Option<f64>| p.is_none_or(|p| p >= 0.01);
    match result.verdict {
        VerdictClass::Adequate => {
            let base = result.sets.iter().find(|set| set.causes.is_empty() && !set.with_remainder);
            let p = base.and_then(|base| base.lack_of_fit_p);
            assert!(p.is_none_or(|p| p >= level_of_base), "{of}: {base:?}");
            // Whether neighbours scatter independently is asked of the scatter, not of the base.
            let of_scatter = |test: &str| ["ljung_box", "runs"].contains(&test);
            let stands = result.tests.iter().all(|test| of_scatter(&test.test) || test.p_holm >= level_of_base);
            assert!(stands, "{of}: {:?}", result.tests);
        }
        VerdictClass::Named => assert!(fits(result.sets[0].lack_of_fit_p), "{of}: {:?}", result.sets[0]),
        VerdictClass::Confounded => {
            for likely in &result.likely_sets {
                let own = result.sets.iter().find(|set| !set.with_remainder && set.causes == likely.causes);
                assert!(fits(own.and_then(|set| set.lack_of_fit_p)), "{of}: {own:?}");
            }
        }
        _ => {}
    }
    for probability in [result.none_probability, result.unnamed_probability] {
        assert!((0.0..=1.0).contains(&probability) && probability.is_sign_positive(), "{of}: {probability}");
    }
}

#[test]
fn nothing_is_called_adequate_that_the_tests_beside_it_reject() {
    let drawn = ["linear-in-time-60-rows", "wear-lowers-it-60-rows"].map(|name| (name, Some(case(name))));
    let wear = "adequate-but-ten-sigma";
    for (name, request) in drawn.into_iter().chain([(wear, measured_case(wear))]) {
        let Some(request) = request else { continue };
        let answer = answered::<FeedSchedule>(&request, json!({}));
        assert_eq!(answer.output.verdict, VerdictClass::Unknown, "{name}");
        fits_its_tests::<FeedSchedule>(&answer, 0.01, name);
    }
    // What it goes with is told.
    let answer = answered::<FeedSchedule>(&case("linear-in-time-60-rows"), json!({ "held_out": false }));
    let remainder = answer.output.remainder.unwrap();
    assert!(remainder.over.iter().any(|over| over == "time"), "{} {:?}", remainder.kind, remainder.over);
}

#[test]
fn verdicts_fit_the_tests_beside_them() {
    let rooms: [(&str, Draw); 2] = [("levels", machinability::draw), ("continuous", machinability::draw_continuous)];
    for (room, draw) in rooms {
        for k in 0..draws(8) {
            for (class, snr) in [
                (Class::Nothing, 0.0),
                (Class::One, 1.0),
                (Class::Two, 1.5),
                (Class::Outside, 1.0),
                (Class::Outside, 3.0),
            ] {
                let trial = draw(class, snr, seed_of(71, k));
                let answer = answered::<FeedSchedule>(&trial.request, json!({ "held_out": false }));
                fits_its_tests::<FeedSchedule>(&answer, 0.01, &format!("{room} {class:?} {snr} {k}"));
            }
        }
    }
    for k in 0..draws(3) {
        for (class, snr) in [(Class::Nothing, 0.0), (Class::One, 1.0), (Class::Outside, 1.0)] {
            let trial = deflection::draw(class, snr, seed_of(72, k));
            let answer = answered::<DeflectionCompensation>(&trial.request, json!({ "held_out": false }));
            fits_its_tests::<DeflectionCompensation>(&answer, 1e-5, &format!("shaft {class:?} {snr} {k}"));
        }
    }
}

/// The verdict and the weights of all sets, to the last bit.
fn weights<M: Diagnosable>(answer: &Answer<ResultOf<M>>) -> (VerdictClass, Vec<u64>) {
    let result = &answer.output;
    (result.verdict, result.sets.iter().map(|set| set.posterior.to_bits()).collect())
}

fn warned<M: Diagnosable>(answer: &Answer<ResultOf<M>>) -> Option<Said> {
    let warning = answer.warnings.iter().find(|warning| warning.code == "repeated_rows")?;
    warning.values.get("count").cloned()
}

/// Rows with other rows of the same table put behind them.
fn with_copies(request: &Value, copied: impl Fn(&[Value]) -> Vec<Value>) -> Value {
    let mut request = request.clone();
    let rows = request["measurements"].as_array().unwrap().clone();
    request["measurements"] = [rows.clone(), copied(&rows)].concat().into();
    request
}

/// The table with every row once.
fn without_ties(request: &Value) -> Value {
    let mut request = request.clone();
    let mut rows: Vec<Value> = Vec::new();
    for row in request["measurements"].as_array().unwrap() {
        if !rows.contains(row) {
            rows.push(row.clone());
        }
    }
    request["measurements"] = rows.into();
    request
}

#[test]
fn copies_of_rows_change_nothing_and_are_told() {
    let options = || json!({ "held_out": false });
    for name in ["each-row-three-times", "every-row-twice"] {
        let whole = case(name);
        let once = without_ties(&whole);
        if name == "each-row-three-times" {
            let (whole, once) =
                (answered::<FeedSchedule>(&whole, options()), answered::<FeedSchedule>(&once, options()));
            assert_eq!(weights::<FeedSchedule>(&whole), weights::<FeedSchedule>(&once), "{name}");
            assert!(warned::<FeedSchedule>(&whole).is_some() && warned::<FeedSchedule>(&once).is_none());
        } else {
            type Shaft = DeflectionCompensation;
            let (whole, once) = (answered::<Shaft>(&whole, options()), answered::<Shaft>(&once, options()));
            assert_eq!(weights::<Shaft>(&whole), weights::<Shaft>(&once), "{name}");
            assert!(warned::<Shaft>(&whole).is_some() && warned::<Shaft>(&once).is_none());
        }
    }
    for k in 0..draws(3) {
        let mut random = Random::new(seed_of(73, k));
        let trial = machinability::draw(Class::Nothing, 0.0, seed_of(74, k)).request;
        let clean = answered::<FeedSchedule>(&trial, options());
        let doubled = answered::<FeedSchedule>(&with_copies(&trial, <[Value]>::to_vec), options());
        let tripled = answered::<FeedSchedule>(&with_copies(&trial, |rows| [rows, rows].concat()), options());
        let start = random.whole(0, 20);
        let pasted = answered::<FeedSchedule>(&with_copies(&trial, |rows| rows[start..start + 12].to_vec()), options());
        // Where the table has repeats that agree by rounding, they go with the copies: nothing tells them apart.
        let once = without_ties(&trial);
        let rows = |request: &Value| request["measurements"].as_array().unwrap().len() as f64;
        let ties = rows(&trial) - rows(&once);
        let distinct = answered::<FeedSchedule>(&once, options());
        for (copied, count) in [(doubled, None), (tripled, None), (pasted, Some(12.0))] {
            let found = weights::<FeedSchedule>(&copied);
            let is_clean = found == weights::<FeedSchedule>(&clean);
            assert!(is_clean || found == weights::<FeedSchedule>(&distinct), "{k}");
            let said = warned::<FeedSchedule>(&copied).unwrap();
            let Said::Number(rows) = said else { panic!("{said:?}") };
            assert!(count.is_none_or(|count: f64| (count..=count + ties).contains(&rows)), "{rows} {ties}");
        }
        let shaft = deflection::draw(Class::Nothing, 0.0, seed_of(75, k)).request;
        let clean = answered::<DeflectionCompensation>(&shaft, options());
        let doubled = answered::<DeflectionCompensation>(&with_copies(&shaft, <[Value]>::to_vec), options());
        assert_eq!(weights::<DeflectionCompensation>(&doubled), weights::<DeflectionCompensation>(&clean), "{k}");
    }
}

/// Rounded so far that repeats often agree, rows are no copies.
#[test]
fn repeats_that_agree_by_rounding_are_no_copies() {
    for k in 0..draws(6) {
        let mut trial = machinability::draw(Class::Nothing, 0.0, seed_of(76, k)).request;
        let quantity = trial["quantity"].as_str().unwrap().to_owned();
        for row in trial["measurements"].as_array_mut().unwrap() {
            let value = row[&quantity].as_f64().unwrap();
            let unit = 10.0_f64.powf(value.log10().floor() - 1.0);
            row[&quantity] = json!((value / unit).round() * unit);
        }
        let answer = answered::<FeedSchedule>(&trial, json!({ "held_out": false }));
        assert!(warned::<FeedSchedule>(&answer).is_none(), "{k}");
    }
}

#[test]
fn a_hint_names_no_cause_that_is_less_likely_than_what_has_no_name() {
    let answer = answered::<DeflectionCompensation>(&case("hint-names-a-cause-of-one-percent"), json!({}));
    let hint = answer.explanation.iter().find(|said| said.code == "diagnosis_adequate_with_hint");
    let result = &answer.output;
    if let Some(hint) = hint {
        let likeliest = &result.causes[0];
        assert!(likeliest.probability < result.unnamed_probability, "the case is another: {likeliest:?}");
        assert_eq!(hint.values.get("cause"), Some(&Said::from(String::new())));
        assert_eq!(hint.values.get("probability"), Some(&Said::from(result.unnamed_probability)));
    } else {
        // Or nothing is likely enough to need no hint.
        assert!(result.verdict != VerdictClass::Adequate || result.none_probability >= 0.5);
    }
}

/// No set of causes has more evidence alone than the best of the full search.
fn search_keeps_what_is_there<M: Diagnosable>(draw: Draw, series: u64, in_the_suite: u64) {
    let count = draws(in_the_suite);
    let mut lost = Vec::new();
    for k in 0..count {
        let class = if k % 2 == 0 { Class::One } else { Class::Two };
        let trial = draw(class, 3.0, seed_of(series, k));
        let hidden: Vec<&str> = trial.truth.causes.iter().map(|cause| cause.kind).collect();
        let other = |shift: usize| M::CAUSES[(k as usize + 7 * shift) % M::CAUSES.len()].kind;
        let mut whole = blind_trials::job::<M>(&trial.request, json!({}));
        // Where every prediction is a simulation, only what is hidden is looked for alone; where it is a long one, among three
        // others unless draws are asked for.
        let ms = M::predict_ms(&whole.job);
        let (is_dear, is_long) = (ms > 0.0, ms > 10.0);
        if is_long && count == in_the_suite {
            let causes: BTreeSet<&str> = hidden.iter().copied().chain((0..3).map(other)).collect();
            whole = blind_trials::job::<M>(&trial.request, json!({ "causes": causes }));
        }
        let best = best_evidence::<M>(&whole).unwrap();
        let others = (0..if is_dear { 0 } else { 2 }).map(|shift| vec![other(shift)]);
        for causes in others.chain([hidden]) {
            let job = blind_trials::job::<M>(&trial.request, json!({ "causes": causes }));
            let alone = best_evidence::<M>(&job).unwrap();
            if alone > best + 1e-6 * best.abs().max(1.0) {
                lost.push(format!("{class:?} {k}: {causes:?} {alone}, all {best}"));
            }
        }
    }
    assert!(lost.is_empty(), "{} of {count} draws: {lost:#?}", lost.len());
}

#[test]
fn the_search_over_cuts_loses_no_set() {
    search_keeps_what_is_there::<FeedSchedule>(machinability::draw, 77, 30);
}

#[test]
fn the_search_over_shafts_loses_no_set() {
    search_keeps_what_is_there::<DeflectionCompensation>(deflection::draw, 78, 10);
}

#[test]
fn the_search_over_rings_loses_no_set() {
    search_keeps_what_is_there::<RingRoundness>(ring::draw, 79, 1);
}

#[test]
fn the_search_over_vises_loses_no_set() {
    search_keeps_what_is_there::<FixtureStability>(fixture::draw, 80, 4);
}

/// A mass that swings on the workpiece shows near its own frequency alone: from another one it is not found.
#[test]
fn the_search_over_vises_loses_no_second_mode() {
    let draw: Draw = |_, snr, seed| fixture::draw_hiding("second_mode", snr, seed);
    search_keeps_what_is_there::<FixtureStability>(draw, 81, 3);
}

/// What is promised of a compensated shaft is what the path leaves that the calculator puts out.
#[test]
fn a_promise_of_form_is_kept_by_the_path_that_is_driven() {
    let request = case("round-trip-diagnosis");
    let result = answered::<DeflectionCompensation>(&request, json!({ "held_out": false })).output;
    let promised = result.downstream.iter().find(|of| of.outcome == "form_error_um").unwrap();
    let mut job = case("round-trip-compensation");
    job.as_object_mut().unwrap().remove("model");
    job["effects"] = serde_json::to_value(&result.effects).unwrap();
    let mut job: <DeflectionCompensation as Calculator>::Input = serde_json::from_value(job).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert_eq!(violations.into_vec(), []);
    DeflectionCompensation::fill(&mut job);
    let driven = DeflectionCompensation::run(&job, &Unwatched).unwrap().output.form_error_after_um.unwrap();
    let [low, high] = promised.extended.interval_95;
    assert!((0.9 * low..=1.1 * high).contains(&driven), "{driven} driven, {low} to {high} promised");
    assert!(driven < 2.0 * promised.extended.mean && promised.extended.mean < 2.0 * driven, "{driven} {promised:?}");
}
