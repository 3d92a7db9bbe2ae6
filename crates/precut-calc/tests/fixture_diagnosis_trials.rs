//! Blind trials of the diagnosis on vises: effects hidden by a generator that shares no code with the calculator.
//!
//! Every prediction is a simulation, so few are drawn here.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::fixture_stability::FixtureStability;
use precut_trials::score::Score;
use precut_trials::{Class, fixture};

use crate::blind_trials;

fn score(class: Class, snr: f64, seed: u64, count: u64) -> Score {
    blind_trials::score::<FixtureStability>(fixture::draw, class, snr, seed, count)
}

#[test]
fn nothing_hidden_raises_no_alarm() {
    let score = score(Class::Nothing, 0.0, 1, 1);
    assert!(score.quiet.reaches(0.97), "{}", score.quiet);
}

#[test]
fn one_hidden_cause_is_named_right_or_not_at_all() {
    let score = score(Class::One, 5.0, 2, 2);
    assert!(score.named_right.reaches(0.96), "{}", score.named_right);
    assert!(score.truth_listed.reaches(0.90), "{}", score.truth_listed);
}

#[test]
fn what_the_catalogue_lacks_is_unknown() {
    let score = score(Class::Outside, 5.0, 4, 1);
    assert!(score.unknown.reaches(0.93), "{}", score.unknown);
}

/// A joint that gives way from some swing on.
#[test]
fn a_jaw_that_slips_is_unknown() {
    let draw = |_, snr, seed| fixture::draw_hiding("jaw_slip", snr, seed);
    let score = blind_trials::score::<FixtureStability>(draw, Class::Outside, 5.0, 6, 1);
    assert!(score.unknown.reaches(0.93), "{}", score.unknown);
}

/// A mass that swings on the workpiece is named right or not at all.
#[test]
fn a_second_mode_is_named_right_or_not_at_all() {
    let draw = |_, snr, seed| fixture::draw_hiding("second_mode", snr, seed);
    let score = blind_trials::score::<FixtureStability>(draw, Class::One, 5.0, 7, 1);
    assert!(score.named_right.reaches(0.96), "{}", score.named_right);
    assert!(score.truth_listed.reaches(0.90), "{}", score.truth_listed);
}
