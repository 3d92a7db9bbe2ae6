//! What the next measurement that a diagnosis advises is worth: it is made, by a generator that shares no code with the
//! calculator, and held against another run at the same cost.
//!
//! `PRECUT_TRIALS=300 PRECUT_TRIAL_SEED=9800 cargo test -p precut-calc-tests diagnosis_next -- --nocapture`
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

use precut_calc::calculator::{Calculator, Unwatched};
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::diagnosis::{Diagnosis, ResultOf, VerdictClass};
use precut_trials::score::Share;
use precut_trials::{Class, Random, Trial, deflection};
use serde_json::{Value, json};

use crate::blind_trials::{job, number, seed_of};

type Model = DeflectionCompensation;

/// Weak enough that many answers are lists.
const SNR: f64 = 1.5;

fn diagnosed(request: &Value) -> ResultOf<Model> {
    Diagnosis::<Model>::run(&job::<Model>(request, json!({ "held_out": false })), &Unwatched).unwrap().output
}

/// Whether the hidden cause is named, and nothing else, once one more run was measured.
fn settled(trial: &Trial, seed: u64, run: Option<&Value>) -> bool {
    let mut request = trial.request.clone();
    let count = request["runs"].as_array().unwrap().len();
    let (run, rows) = deflection::measured_next(Class::One, SNR, seed, run, count + 1);
    request["runs"].as_array_mut().unwrap().push(run);
    request["measurements"].as_array_mut().unwrap().extend(rows);
    let found = diagnosed(&request);
    let named: Vec<&str> = found.named.iter().map(|cause| cause.kind.as_str()).collect();
    found.verdict == VerdictClass::Named && named == [trial.truth.causes[0].kind]
}

/// Where several causes may stand for each other, the run that is advised names the right one more often than one of the same
/// cost that a shift would make anyway, or another of those that were looked at.
#[test]
fn the_run_that_is_advised_settles_more_than_another() {
    let (seed, count) = (number("PRECUT_TRIAL_SEED", 96), number("PRECUT_TRIALS", 40));
    let [mut advised, mut of_shift, mut of_candidates] = [Share::default(); 3];
    for own in (0..count).map(|k| seed_of(seed, k)) {
        let trial = deflection::draw(Class::One, SNR, own);
        let found = diagnosed(&trial.request);
        let Some(next) = found.next_measurement.filter(|_| found.verdict == VerdictClass::Confounded) else { continue };
        let other = &next.candidates[Random::new(own).whole(0, next.candidates.len() - 1)];
        let asked = [&next.run, &other.run].map(|run| serde_json::to_value(run).unwrap());
        let is_settled = [Some(&asked[0]), None, Some(&asked[1])].map(|run| settled(&trial, own, run));
        println!(
            "{}: {} against {} {:.1} -> {:.1}, by {}: {is_settled:?}",
            trial.truth.causes[0].kind,
            next.leader.join(" + "),
            next.rival.join(" + "),
            next.separation_now_sigmas,
            next.separation_then_sigmas,
            next.changes
        );
        advised.add(is_settled[0]);
        of_shift.add(is_settled[1]);
        of_candidates.add(is_settled[2]);
    }
    println!(
        "named right after the run advised {advised}, one of the shift {of_shift}, another candidate {of_candidates}"
    );
    assert!(advised.of >= 4, "{advised}");
    assert!(advised.hits >= of_shift.hits.max(of_candidates.hits), "{advised} {of_shift} {of_candidates}");
}
