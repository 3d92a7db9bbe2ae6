//! The diagnosis as a calculator: its examples, its refusals, its rules between fields.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Answer, Calculator, Check, Diagnosable, Unwatched, Violations};
use precut_calc::deflection_compensation::{DeflectionCompensation, DeflectionRun};
use precut_calc::diagnosis::{Diagnosis, DiagnosisResult, VerdictClass};
use precut_calc::effects::DeflectionEffect;
use serde_json::{Value, json};

type Deflection = Diagnosis<DeflectionCompensation>;

fn example() -> Value {
    serde_json::from_str(DeflectionCompensation::DIAGNOSES[0].job).unwrap()
}

fn faults(job: &Value) -> Vec<(&'static str, String)> {
    let job: <Deflection as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec().into_iter().map(|finding| (finding.code, finding.pointer)).collect()
}

fn answered(job: &Value) -> Answer<DiagnosisResult<DeflectionEffect, DeflectionRun>> {
    assert_eq!(faults(job), []);
    let mut job: <Deflection as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    Deflection::fill(&mut job);
    Deflection::run(&job, &Unwatched).unwrap()
}

#[test]
fn the_example_names_its_cause_and_gives_the_effect_that_a_job_takes() {
    let answer = answered(&example());
    let result = &answer.output;
    assert_eq!(result.verdict, VerdictClass::Named);
    assert_eq!(result.named[0].kind, "headstock_compliance");
    assert_eq!(answer.explanation[0].code, "diagnosis_named");
    assert!(matches!(result.effects[..], [DeflectionEffect::HeadstockCompliance { .. }]));
    let gain = result.gain.as_ref().unwrap();
    assert!(gain.rmse_extended < gain.rmse_base && gain.explained_share.unwrap() > 0.9);
    // The extended model in the ordinary calculator: what the diagnosis fitted is what a job can hold.
    let mut job = example()["job"].clone();
    job["effects"] = serde_json::to_value(&result.effects).unwrap();
    let mut job: <DeflectionCompensation as Calculator>::Input = serde_json::from_value(job).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert!(violations.is_empty());
    DeflectionCompensation::fill(&mut job);
    DeflectionCompensation::run(&job, &Unwatched).unwrap();
}

#[test]
fn radii_given_as_diameters_are_refused_with_the_factor_and_judged_when_the_user_insists() {
    let mut job = example();
    for row in job["measurements"].as_array_mut().unwrap() {
        row["diameter_deviation_um"] = json!(row["diameter_deviation_um"].as_f64().unwrap() / 2.0);
    }
    let answer = answered(&job);
    assert_eq!(answer.output.verdict, VerdictClass::Refused);
    assert_eq!(answer.output.refusal.as_ref().unwrap().factor, Some(0.5));
    assert!(answer.output.effects.is_empty() && answer.output.named.is_empty());
    job["options"] = json!({ "accept_suspected_unit": true });
    assert_ne!(answered(&job).output.verdict, VerdictClass::Refused);
}

#[test]
fn causes_that_nobody_asked_for_are_not_named() {
    let mut job = example();
    job["options"] = json!({ "causes": ["tool_wear", "guideway_bow"], "held_out": false });
    let result = answered(&job).output;
    assert!(result.named.iter().all(|cause| cause.kind == "tool_wear" || cause.kind == "guideway_bow"));
    assert_ne!(result.verdict, VerdictClass::Adequate);
    assert!(result.gain.is_none());
    let left: Vec<&str> =
        result.not_applicable.iter().filter(|n| n.reason == "not_asked_for").map(|n| n.kind.as_str()).collect();
    assert!(left.contains(&"headstock_compliance"));
}

#[test]
fn all_faults_are_told_at_once() {
    let mut job = example();
    job["quantity"] = json!("roundness_um");
    job["measurements"][3]["run"] = json!(77);
    job["options"] = json!({ "causes": ["gravity"] });
    job["job"]["supports"] = json!([{ "kind": "centre", "z_mm": 0.0 }]);
    let found = faults(&job);
    for expected in [
        ("unknown_quantity", "/quantity"),
        ("unknown_run", "/measurements/3/run"),
        ("unknown_cause", "/options/causes/0"),
        ("too_few_measurements", "/measurements"),
    ] {
        assert!(found.contains(&(expected.0, expected.1.to_owned())), "{expected:?} not in {found:?}");
    }
    assert!(found.iter().any(|(_, pointer)| pointer.starts_with("/job/")), "{found:?}");
}

#[test]
fn figures_and_tables_hold_every_row() {
    let job: <Deflection as Calculator>::Input = serde_json::from_value(example()).unwrap();
    let result = answered(&example()).output;
    let tables = Deflection::tables(&job, &result);
    assert_eq!(tables.iter().map(|t| t.id).collect::<Vec<_>>(), Deflection::META.tables);
    let ids = |job: &Value| -> Vec<&'static str> {
        let result = answered(job).output;
        let job: <Deflection as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
        Deflection::figures(&job, &result).iter().map(|figure| figure.id).collect()
    };
    // What has a name has profiles and is decided with, what has none leaves a remainder.
    let declared = |left: &[&str]| -> Vec<&'static str> {
        Deflection::META.figures.iter().copied().filter(|id| !left.contains(id)).collect()
    };
    assert_eq!(ids(&example()), declared(&["classes", "remainder", "remainder_spectrum"]));
    let unknown = serde_json::from_str(DeflectionCompensation::DIAGNOSES[1].job).unwrap();
    assert_eq!(ids(&unknown), declared(&["classes", "profiles", "downstream"]));
    assert_eq!(result.rows.row.len(), example()["measurements"].as_array().unwrap().len());
}

#[test]
fn a_shape_without_a_name_is_drawn_with_its_band_and_its_waves() {
    let result = answered(&serde_json::from_str(DeflectionCompensation::DIAGNOSES[1].job).unwrap()).output;
    assert_eq!(result.verdict, VerdictClass::Unknown);
    let remainder = result.remainder.unwrap();
    assert_eq!(
        (remainder.value.len(), remainder.standard_deviation.len()),
        (result.rows.row.len(), remainder.value.len())
    );
    // The guideway is S-shaped over the length of the part: its longest waves carry it.
    let energy = |orders: std::ops::RangeInclusive<f64>| -> f64 {
        let of = remainder.orders.iter().zip(&remainder.amplitudes);
        of.filter(|(order, _)| orders.contains(*order)).map(|(_, a)| a * a).sum()
    };
    assert!(energy(1.0..=4.0) > 0.8 * energy(0.0..=24.0));
    // Known better than a single row is measured, almost everywhere.
    assert!(remainder.standard_deviation.iter().all(|sd| *sd > 0.0 && *sd < result.noise.standard_deviation * 2.0));
}

#[test]
fn parameters_have_profiles_that_agree_with_their_intervals() {
    let result = answered(&example()).output;
    assert_eq!(result.profiles.len(), 1);
    let (profile, parameter) = (&result.profiles[0], &result.named[0].parameters[0]);
    assert_eq!((&profile.kind, &profile.parameter), (&result.named[0].kind, &parameter.name));
    // A compliance acts almost in proportion: the profile is the parabola.
    assert_eq!(parameter.interval_from.as_deref(), Some("quadratic"));
    for (x, rise) in profile.deviations.iter().zip(&profile.rise) {
        assert!((rise - x * x).abs() < 0.2 * x * x + 0.05, "{x} {rise}");
    }
    // Measured rows lie in the band about their prediction as often as 95 % promise.
    let rows = &result.rows;
    let inside = (0..rows.row.len())
        .filter(|&i| (rows.measured[i] - rows.extended[i].unwrap()).abs() < 1.96 * rows.extended_deviation[i].unwrap())
        .count() as f64;
    // Two binomial standard deviations of the number of rows.
    let n = rows.row.len() as f64;
    assert!(inside / n > 0.95 - 2.0 * (0.95 * 0.05 / n).sqrt(), "{inside} of {n}");
}

/// A set lies as near as one likes to what it extends: only rivals are held against each other.
#[test]
fn rivals_are_held_against_each_other_and_not_against_what_extends_them() {
    let result = answered(&example()).output;
    let sets: Vec<&Vec<String>> = result.signatures.iter().map(|signature| &signature.causes).collect();
    assert_eq!(sets[0], &["headstock_compliance"]);
    for (index, set) in sets.iter().enumerate() {
        assert!(sets[..index].iter().all(|other| !other.iter().all(|kind| set.contains(kind))), "{set:?}");
    }
    assert_eq!(result.separations.len(), sets.len() * (sets.len() - 1) / 2);
    // Its change is what the extended model does to the prediction.
    for (change, (base, extended)) in
        result.signatures[0].change.iter().zip(result.rows.base.iter().zip(&result.rows.extended))
    {
        assert!((change - (extended.unwrap() - base.unwrap())).abs() < 1e-9);
    }
}

#[test]
fn the_next_run_parts_the_leader_from_its_rival() {
    let result = answered(&example()).output;
    let next = result.next_measurement.unwrap();
    assert_eq!(next.leader, ["headstock_compliance"]);
    assert!(!next.rival.contains(&"headstock_compliance".to_owned()));
    // More rows never part less.
    assert!(next.separation_then_sigmas >= next.separation_now_sigmas);
}
