//! Blind trials of the diagnosis on logs of cuts with end mills: stable or chattering, some with the frequency heard.
//!
//! A diagnosis takes ten seconds, so one of each is drawn here; with `PRECUT_TRIALS` as many as it says.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Calculator, Unwatched};
use precut_calc::diagnosis::{Diagnosis, VerdictClass};
use precut_calc::milling_stability::MillingStability;
use precut_trials::score::Score;
use precut_trials::{Class, milling};

use crate::blind_trials::{self, Trials};

fn score(name: &'static str, class: Class, shift: f64, seed: u64, count: u64) -> Score {
    let draw = milling::draw_log;
    blind_trials::score::<MillingStability>(Trials { name, draw, ideal: None, class, snr: shift, seed, count })
}

#[test]
fn a_quiet_log_raises_no_alarm() {
    let score = score("milling-log-nothing", Class::Nothing, 0.0, 1, 1);
    assert!(score.quiet.reaches(0.97), "{}", score.quiet);
}

#[test]
fn one_hidden_cause_of_a_log_is_named_right_or_not_at_all() {
    let score = score("milling-log-one", Class::One, 5.0, 2, 1);
    assert!(score.named_right.reaches(0.96), "{}", score.named_right);
    assert!(score.truth_listed.reaches(0.90), "{}", score.truth_listed);
}

/// The limit is off at one speed of eight by more than half, and the frequencies are right: as long as a remainder moved both alike, and all
/// rows were tested as one sum, eight of 22 such logs were called adequate, this one among them.
#[test]
fn a_log_whose_limit_is_off_at_one_speed_is_not_called_adequate() {
    let trial = milling::draw_log(Class::Outside, 5.0, blind_trials::seed_of(9, 18));
    assert_eq!(trial.truth.causes[0].kind, "odd_speed");
    let job = blind_trials::job::<MillingStability>(&trial.request, serde_json::json!({ "held_out": false }));
    let result = Diagnosis::<MillingStability>::run(&job, &Unwatched).unwrap().output;
    assert_eq!(result.verdict, VerdictClass::Unknown, "{:?}", result.tests);
    assert!(result.tests.iter().any(|test| test.test == "levels" && test.rejects), "{:?}", result.tests);
}
