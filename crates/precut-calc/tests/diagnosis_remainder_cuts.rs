//! What has no name in measured cuts as a term of the extended model, stored and known again, or as a formula of the user.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use precut_calc::calculator::{Calculator, Unwatched};
use precut_calc::diagnosis::{Diagnosis, ExtensionKind, ResultOf, VerdictClass, residuals_with};
use precut_calc::effects::{MACHINABILITY_CAUSES, MachinabilityEffect};
use precut_calc::feed_schedule::FeedSchedule;
use precut_trials::score::Share;
use precut_trials::{Class, Trial, machinability};
use serde_json::{Value, json};

use crate::blind_trials::{job, number, seed_of};

type Model = FeedSchedule;

const SNR: f64 = 5.0;

fn diagnosed(request: &Value, options: Value) -> ResultOf<Model> {
    Diagnosis::<Model>::run(&job::<Model>(request, options), &Unwatched).unwrap().output
}

/// The request under a model that was stored: its effects, and what is not known of them.
fn under(request: &Value, found: &ResultOf<Model>) -> Value {
    let mut request = request.clone();
    request["job"]["effects"] = serde_json::to_value(&found.effects).unwrap();
    request["effects_uncertainty"] = serde_json::to_value(&found.effects_uncertainty).unwrap();
    // What a held effect goes with stands in the job; every row states its own.
    request["job"]["conditions"] =
        json!({ "flank_wear_mm": 0.1, "time_min": 1.0, "nose_radius_mm": 0.8, "batch": "A" });
    request
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Draws a trial of a class at a signal to noise, of a seed.
type Drawn = fn(Class, f64, u64) -> Trial;

/// What no catalogue holds is hidden in cuts on levels and in cuts of any values. Where the answer leaves a term for it, the term
/// is tried on cuts of another day, which know it again under the stored model.
#[test]
fn a_remainder_of_cuts_is_stored_and_known_again() {
    let (seed, count) = (number("PRECUT_TRIAL_SEED", 40), number("PRECUT_TRIALS", 8));
    let plans: [(&str, Drawn); 2] = [("levels", machinability::draw), ("any values", machinability::draw_continuous)];
    let [mut predicts, mut recognised, mut quiet] = [Share::default(); 3];
    let (mut unknown, mut of_error) = (0, Vec::new());
    for (plan, draw) in plans {
        for own in (0..count).map(|k| seed_of(seed, k)) {
            let trial = draw(Class::Outside, SNR, own);
            // What drifts with the order of testing says nothing of another day.
            let kind = trial.truth.causes[0].kind;
            let found = diagnosed(&trial.request, json!({}));
            unknown += u64::from(found.verdict == VerdictClass::Unknown);
            let remainder = found.remainder.as_ref();
            let over = remainder.map(|own| (own.kind.clone(), own.over.clone()));
            if found.extension != ExtensionKind::Remainder || kind == "drift" {
                println!("{plan:<10} {kind:<20} {:?} {over:?} {:?}", found.verdict, found.extension);
                continue;
            }
            let MachinabilityEffect::Remainder { scale, profile, .. } = found.effects.last().unwrap() else { panic!() };
            assert!((scale - 1.0).abs() < 1e-12 && profile.len() >= 2);
            let later = trial.later.as_ref().unwrap();
            let plain = job::<Model>(&later.request, json!({ "held_out": false }));
            let [before, after] =
                [&[][..], &found.effects].map(|effects| rms(&residuals_with::<Model>(&plain, effects).unwrap()));
            predicts.add(after < before);
            of_error.push(after / before);
            let again = diagnosed(&under(&later.request, &found), json!({ "held_out": false }));
            recognised.add(again.recognised.is_some());
            quiet.add(again.verdict == VerdictClass::Adequate);
            println!(
                "{plan:<10} {kind:<20} {over:?} {} places, later {before:.3} to {after:.3} ({:.3}), {:?} recognised {:?}",
                profile.len(),
                trial.sigma,
                again.verdict,
                again.recognised.as_ref().map(|own| own.sigmas)
            );
        }
    }
    of_error.sort_by(f64::total_cmp);
    println!(
        "{count} draws each from seed {seed}: {unknown} unknown, {} with a term; later cuts predicted better {predicts} (median \
         {:?} of the error), recognised {recognised}, adequate {quiet}",
        of_error.len(),
        of_error.get(of_error.len() / 2)
    );
    assert!(2 * of_error.len() as u64 >= count, "{}", of_error.len());
    assert!(predicts.reaches(0.95) && recognised.reaches(0.95), "{predicts} {recognised}");
    assert!(of_error[of_error.len() / 2] < 0.6, "{of_error:?}");
}

/// A cause of the catalogue that is left out of it, written down by the user, is found with the same size as by its own name.
#[test]
fn a_formula_is_fitted_as_a_named_cause_is() {
    let mut tried = Share::default();
    for own in (0..40).map(|k| seed_of(7, k)) {
        let trial = machinability::draw(Class::One, 3.0, own);
        if trial.truth.causes[0].kind != "speed_curvature" {
            continue;
        }
        let named = diagnosed(&trial.request, json!({ "held_out": false }));
        let mut request = trial.request.clone();
        let output = request["job"]["models"].as_object().unwrap().keys().next().unwrap().clone();
        request["job"]["effects"] = json!([{ "kind": "formula", "name": "bend", "output": output, "k1_deviation": 0.1,
            "expression": "k1*ln(speed_m_per_min/60[m/min])^2" }]);
        let others: Vec<&str> =
            MACHINABILITY_CAUSES.iter().map(|cause| cause.kind).filter(|kind| *kind != "speed_curvature").collect();
        let found = diagnosed(&request, json!({ "held_out": false, "causes": others }));
        let [by_name, by_formula] =
            [&named, &found].map(|own| own.named.iter().map(|cause| cause.kind.clone()).collect::<Vec<_>>());
        if by_name != ["speed_curvature"] {
            continue;
        }
        assert_eq!(by_formula, ["formula"], "{:?}", found.likely_sets);
        let [bend, own] = [&named, &found].map(|own| own.named[0].parameters[0].clone());
        assert_eq!((own.name.as_str(), own.was, found.named[0].label.as_str()), ("k1", Some(0.0), "bend"));
        assert!((own.value - bend.value).abs() < 0.02 * bend.value.abs(), "{own:?} {bend:?}");
        // The model that is left holds it with its number.
        let Some(MachinabilityEffect::Formula { k1, expression, .. }) = found.effects.last() else { panic!() };
        assert!((k1 - own.value).abs() < 1e-12 && expression.text().contains("ln("));
        tried.add(true);
    }
    assert!(tried.of >= 1, "{tried}");
}
