//! Blind trials of the diagnosis on vises: effects hidden by a generator that shares no code with the calculator.
//!
//! A diagnosis of a vise takes a second or so: some tens are drawn here.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::fixture_stability::FixtureStability;
use precut_trials::score::Score;
use precut_trials::{Class, fixture};

use crate::blind_trials::{self, Trials};

fn score(name: &'static str, class: Class, snr: f64, seed: u64, count: u64) -> Score {
    blind_trials::score::<FixtureStability>(Trials { name, draw: fixture::draw, ideal: None, class, snr, seed, count })
}

#[test]
fn nothing_hidden_raises_no_alarm() {
    let score = score("fixture-nothing", Class::Nothing, 0.0, 1, 4);
    assert!(score.quiet.reaches(0.97), "{}", score.quiet);
}

#[test]
fn one_hidden_cause_is_named_right_or_not_at_all() {
    let score = score("fixture-one", Class::One, 5.0, 2, 6);
    assert!(score.named_right.reaches(0.96), "{}", score.named_right);
    assert!(score.truth_listed.reaches(0.90), "{}", score.truth_listed);
}

#[test]
fn what_the_catalogue_lacks_is_unknown() {
    let score = score("fixture-outside", Class::Outside, 5.0, 4, 3);
    assert!(score.unknown.reaches(0.93), "{}", score.unknown);
}

/// A joint that gives way from some swing on.
#[test]
fn a_jaw_that_slips_is_unknown() {
    let draw: blind_trials::Draw = |_, snr, seed| fixture::draw_hiding("jaw_slip", snr, seed);
    let score = blind_trials::score::<FixtureStability>(Trials {
        name: "fixture-jaw-slip",
        draw,
        ideal: None,
        class: Class::Outside,
        snr: 5.0,
        seed: 6,
        count: 4,
    });
    assert!(score.unknown.reaches(0.93), "{}", score.unknown);
}

/// A mass that swings on the workpiece is named right or not at all.
#[test]
fn a_second_mode_is_named_right_or_not_at_all() {
    let draw: blind_trials::Draw = |_, snr, seed| fixture::draw_hiding("second_mode", snr, seed);
    let score = blind_trials::score::<FixtureStability>(Trials {
        name: "fixture-second-mode",
        draw,
        ideal: None,
        class: Class::One,
        snr: 5.0,
        seed: 7,
        count: 6,
    });
    assert!(score.named_right.reaches(0.96), "{}", score.named_right);
    assert!(score.truth_listed.reaches(0.90), "{}", score.truth_listed);
}
