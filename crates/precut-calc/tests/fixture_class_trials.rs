//! Blind trials of the diagnosis on vises of which only classes are known: stable, chatter, a joint opened.
//!
//! A diagnosis takes several seconds, so few are drawn here.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::fixture_stability::FixtureStability;
use precut_trials::score::Score;
use precut_trials::{Class, fixture};

use crate::blind_trials::{self, Trials};

fn score(name: &'static str, class: Class, shift: f64, seed: u64, count: u64) -> Score {
    blind_trials::score::<FixtureStability>(Trials {
        name,
        draw: fixture::draw_classes,
        ideal: None,
        class,
        snr: shift,
        seed,
        count,
    })
}

#[test]
fn nothing_hidden_raises_no_alarm() {
    let score = score("fixture-classes-nothing", Class::Nothing, 0.0, 1, 1);
    assert!(score.quiet.reaches(0.97), "{}", score.quiet);
}

#[test]
fn one_hidden_cause_is_named_right_or_not_at_all() {
    let score = score("fixture-classes-one", Class::One, 5.0, 2, 1);
    assert!(score.named_right.reaches(0.96), "{}", score.named_right);
    assert!(score.truth_listed.reaches(0.90), "{}", score.truth_listed);
}

#[test]
fn what_the_catalogue_lacks_is_not_named() {
    let score = score("fixture-classes-outside", Class::Outside, 5.0, 4, 1);
    assert!(score.unknown.reaches(0.93), "{}", score.unknown);
}
