//! Data that say nothing, or not what they seem to say: what a diagnosis answers.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Answer, Calculator, Check, Diagnosable, Unwatched, Violations};
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::diagnosis::{Diagnosis, ResultOf, VerdictClass};
use precut_calc::feed_schedule::FeedSchedule;
use serde_json::{Value, json};

fn example<M: Diagnosable>() -> Value {
    serde_json::from_str(M::DIAGNOSES[0].job).unwrap()
}

fn answered<M: Diagnosable>(job: &Value) -> Answer<ResultOf<M>> {
    let mut job: <Diagnosis<M> as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert_eq!(violations.into_vec(), []);
    Diagnosis::<M>::fill(&mut job);
    Diagnosis::<M>::run(&job, &Unwatched).unwrap()
}

fn shaft(change: impl Fn(usize, &mut Value)) -> Value {
    let mut job = example::<DeflectionCompensation>();
    job["options"] = json!({ "held_out": false });
    for (index, row) in job["measurements"].as_array_mut().unwrap().iter_mut().enumerate() {
        change(index, row);
    }
    job
}

/// The reason, and what the first sentence is.
fn refused<M: Diagnosable>(job: &Value) -> (String, &'static str) {
    let answer = answered::<M>(job);
    let result = &answer.output;
    assert_eq!(result.verdict, VerdictClass::Refused);
    assert!(result.named.is_empty() && result.likely_sets.is_empty() && result.effects.is_empty());
    assert!(result.profiles.is_empty() && result.gain.is_none() && result.next_measurement.is_none());
    (result.refusal.as_ref().unwrap().reason.clone(), answer.explanation[0].code)
}

fn warned<M: Diagnosable>(job: &Value) -> Vec<&'static str> {
    answered::<M>(job).warnings.iter().map(|warning| warning.code).collect()
}

#[test]
fn values_that_are_all_the_same_are_no_measurement() {
    let stuck = shaft(|_, row| row["diameter_deviation_um"] = json!(12.5));
    assert_eq!(refused::<DeflectionCompensation>(&stuck), ("constant_values".to_owned(), "diagnosis_constant_values"));
    let zero = shaft(|_, row| row["diameter_deviation_um"] = json!(0.0));
    assert_eq!(refused::<DeflectionCompensation>(&zero).0, "constant_values");
}

#[test]
fn diameters_in_the_place_of_deviations_are_told() {
    let absolute = shaft(|_, row| {
        let deviation = row["diameter_deviation_um"].as_f64().unwrap();
        row["diameter_deviation_um"] = json!(32_000.0 + deviation);
    });
    let expected = ("absolute_values".to_owned(), "diagnosis_absolute_values");
    assert_eq!(refused::<DeflectionCompensation>(&absolute), expected);
}

#[test]
fn a_few_rows_are_tested_and_not_named() {
    let mut job = shaft(|_, _| ());
    let few: Vec<Value> = job["measurements"].as_array().unwrap().iter().step_by(12).take(9).cloned().collect();
    job["measurements"] = few.into();
    let answer = answered::<DeflectionCompensation>(&job);
    assert_eq!(answer.output.refusal.as_ref().unwrap().reason, "too_few_rows");
    assert_eq!(answer.output.refusal.as_ref().unwrap().rows_needed, Some(12));
    assert!(!answer.output.tests.is_empty());
    let warned = |answer: &Answer<ResultOf<DeflectionCompensation>>| {
        let of_rows = answer.warnings.iter().find(|warning| warning.code == "rows_for_causes");
        of_rows.map(|warning| (warning.value.unwrap(), warning.limit.unwrap()))
    };
    assert_eq!(warned(&answer), None);
    // Three times three causes and two.
    let mut job = shaft(|_, _| ());
    let few: Vec<Value> = job["measurements"].as_array().unwrap().iter().step_by(8).take(13).cloned().collect();
    job["measurements"] = few.into();
    assert_eq!(warned(&answered::<DeflectionCompensation>(&job)), Some((13.0, 15.0)));
}

#[test]
fn swapped_columns_are_told() {
    let swapped = shaft(|_, row| {
        let (z, deviation) = (row["z_mm"].clone(), row["diameter_deviation_um"].clone());
        row["z_mm"] = json!(deviation.as_f64().unwrap().max(0.0));
        row["diameter_deviation_um"] = z;
    });
    assert!(warned::<DeflectionCompensation>(&swapped).contains(&"swapped_columns"));
    assert!(!warned::<DeflectionCompensation>(&shaft(|_, _| ())).contains(&"swapped_columns"));
}

/// Which set extends another is no news to the reader: the sentence names the smallest ones, and not more than a few.
#[test]
fn the_sentence_of_a_confounded_answer_is_short() {
    let answer = answered::<DeflectionCompensation>(&shaft(|_, row| row["z_mm"] = json!(300.0)));
    assert_eq!(answer.output.verdict, VerdictClass::Confounded);
    let text = serde_json::to_value(&answer.explanation[0]).unwrap();
    let sets = text["values"]["sets"].as_array().unwrap();
    assert!(sets.len() <= 6 && sets.len() <= answer.output.likely_sets.len());
    for set in sets {
        let extends = |other: &&Value| {
            let kinds = other.as_array().unwrap();
            kinds.len() < set.as_array().unwrap().len()
                && kinds.iter().all(|kind| set.as_array().unwrap().contains(kind))
        };
        assert_eq!(sets.iter().find(extends), None);
    }
}

#[test]
fn rows_at_one_place_show_nothing_that_changes_along_the_part() {
    assert!(warned::<DeflectionCompensation>(&shaft(|_, row| row["z_mm"] = json!(300.0))).contains(&"one_place"));
    assert!(!warned::<DeflectionCompensation>(&shaft(|_, _| ())).contains(&"one_place"));
}

#[test]
fn a_row_written_twice_is_told() {
    let mut job = shaft(|_, _| ());
    let rows = job["measurements"].as_array_mut().unwrap();
    let third = rows[2].clone();
    rows.insert(3, third);
    let answer = answered::<DeflectionCompensation>(&job);
    let warning = answer.warnings.iter().find(|warning| warning.code == "repeated_rows").unwrap();
    assert_eq!(warning.pointer, "/measurements/3");
    assert!(!warned::<DeflectionCompensation>(&shaft(|_, _| ())).contains(&"repeated_rows"));
}

#[test]
fn one_run_cannot_be_held_back() {
    let mut job = example::<DeflectionCompensation>();
    let first: Vec<Value> =
        job["measurements"].as_array().unwrap().iter().filter(|row| row["run"] == 1).cloned().collect();
    job["measurements"] = first.into();
    assert!(warned::<DeflectionCompensation>(&job).contains(&"nothing_held_back"));
    job["options"] = json!({ "held_out": false });
    assert!(!warned::<DeflectionCompensation>(&job).contains(&"nothing_held_back"));
}

fn cuts(factor: f64) -> Value {
    let mut job = example::<FeedSchedule>();
    job["options"] = json!({ "held_out": false });
    for row in job["measurements"].as_array_mut().unwrap() {
        row["roughness_um"] = json!(row["roughness_um"].as_f64().unwrap() * factor);
    }
    job
}

/// A wrong unit shifts logarithms; the exponents stay.
#[test]
fn roughness_in_another_unit_is_refused_with_the_factor() {
    for (factor, named) in [(0.001, 0.001), (39.370_1, 39.37), (1.0 / 25.4, 1.0 / 25.4)] {
        let job = cuts(factor);
        assert_eq!(refused::<FeedSchedule>(&job), ("unit_suspected".to_owned(), "diagnosis_unit_suspected"));
        assert_eq!(answered::<FeedSchedule>(&job).output.refusal.unwrap().factor, Some(named));
        let mut insisted = job;
        insisted["options"]["accept_suspected_unit"] = json!(true);
        assert_ne!(answered::<FeedSchedule>(&insisted).output.verdict, VerdictClass::Refused);
    }
}

/// Twice as rough as expected is a rough surface, no wrong unit.
#[test]
fn twice_the_roughness_is_judged() {
    assert_eq!(answered::<FeedSchedule>(&cuts(1.0)).output.verdict, VerdictClass::Named);
    assert_ne!(answered::<FeedSchedule>(&cuts(2.0)).output.verdict, VerdictClass::Refused);
}

#[test]
fn rows_and_runs_that_cannot_be_are_told_all_at_once_before_anything_runs() {
    let mut job = shaft(|index, row| match index {
        2 => row["z_mm"] = json!(-3.0),
        5 => row["z_mm"] = json!(5000.0),
        // Set aside, so nobody asks where it lies.
        7 => (row["z_mm"], row["excluded"]) = (json!(6000.0), json!(true)),
        _ => {}
    });
    let point = |z: f64| json!({ "z_mm": z, "diameter_mm": 40.0 });
    job["runs"][0]["commanded_path"] = json!([point(0.0), point(200.0), point(100.0)]);
    let job: <Diagnosis<DeflectionCompensation> as Calculator>::Input = serde_json::from_value(job).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    let found: Vec<(&str, String)> = violations.into_vec().into_iter().map(|f| (f.code, f.pointer)).collect();
    let expected = [
        ("station_outside_shaft", "/measurements/2/z_mm"),
        ("station_outside_shaft", "/measurements/5/z_mm"),
        ("stations_not_ascending", "/runs/0/commanded_path/2/z_mm"),
    ];
    assert_eq!(found, expected.map(|(code, pointer)| (code, pointer.to_owned())));
}
