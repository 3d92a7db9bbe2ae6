//! Blind trials of the diagnosis on rings: effects hidden by a generator that shares no code with the calculator.
//!
//! Every prediction is a simulation, so few are drawn here.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::ring_roundness::RingRoundness;
use precut_trials::score::Score;
use precut_trials::{Class, ring};

use crate::blind_trials::{self, Trials};

fn score(name: &'static str, class: Class, snr: f64, seed: u64, count: u64) -> Score {
    blind_trials::score::<RingRoundness>(Trials { name, draw: ring::draw, ideal: None, class, snr, seed, count })
}

#[test]
fn nothing_hidden_raises_no_alarm() {
    let score = score("ring-nothing", Class::Nothing, 0.0, 1, 1);
    assert!(score.quiet.reaches(0.97), "{}", score.quiet);
}

#[test]
fn one_hidden_cause_is_named_right_or_not_at_all() {
    let score = score("ring-one", Class::One, 5.0, 2, 1);
    assert!(score.named_right.reaches(0.96), "{}", score.named_right);
    assert!(score.truth_listed.reaches(0.90), "{}", score.truth_listed);
}

#[test]
fn what_the_catalogue_lacks_is_unknown() {
    let score = score("ring-outside", Class::Outside, 5.0, 4, 1);
    assert!(score.unknown.reaches(0.93), "{}", score.unknown);
}
