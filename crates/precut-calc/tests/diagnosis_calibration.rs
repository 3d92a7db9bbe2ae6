//! How often what a diagnosis claims comes true: intervals of sizes, of gains and of what decisions lead to, and
//! probabilities. Every draw is held against rows that were measured afterwards, and against the truth.
//!
//! `PRECUT_TRIALS=100 PRECUT_TRIAL_SEED=9800 cargo test -p precut-calc-tests diagnosis_calibration -- --nocapture`
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use std::fmt;

use precut_calc::calculator::Calculator;
use precut_calc::calculator::{Diagnosable, Unwatched};
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::diagnosis::{Diagnosis, JobOf, ResultOf, VerdictClass, residuals_with};
use precut_calc::feed_schedule::FeedSchedule;
use precut_trials::score::Share;
use precut_trials::{Class, Random, Trial};
use serde_json::json;

use crate::blind_trials::{self, Draw, seed_of};

/// Bins of probabilities.
const BINS: usize = 5;

/// Claims, and how many of them came true.
#[derive(Debug, Clone, Default)]
struct Calibration {
    /// 95 % intervals of the share by which the error falls, over rows of a next shift.
    gain: Share,
    /// 95 % intervals of what comes of deciding with the extended model, where that is right.
    decided: Share,
    /// 95 % intervals of sizes.
    sizes: Share,
    /// Probabilities that a cause takes part: their sum, and the truth.
    causes: [(f64, Share); BINS],
    /// Probabilities of the set that is named.
    named: [(f64, Share); BINS],
    /// Probabilities that nothing is wrong.
    nothing: [(f64, Share); BINS],
}

fn add(bins: &mut [(f64, Share); BINS], probability: f64, is_true: bool) {
    let bin = &mut bins[((probability * BINS as f64) as usize).min(BINS - 1)];
    bin.0 += probability;
    bin.1.add(is_true);
}

impl fmt::Display for Calibration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "95 % intervals of gains       {}", self.gain)?;
        writeln!(f, "95 % intervals of decisions   {}", self.decided)?;
        writeln!(f, "95 % intervals of sizes       {}", self.sizes)?;
        for (name, bins) in [("cause", &self.causes), ("named", &self.named), ("nothing", &self.nothing)] {
            for (sum, share) in bins.iter().filter(|(_, share)| share.of > 0) {
                writeln!(f, "{name:<8} said {:.3}, true {share}", sum / share.of as f64)?;
            }
        }
        Ok(())
    }
}

/// Causes at the ratio of signal to noise that they have each.
const HIDDEN: [(Class, f64); 5] =
    [(Class::One, 3.0), (Class::One, 1.5), (Class::Two, 3.0), (Class::Nothing, 0.0), (Class::One, 1.0)];

fn calibration<M: Diagnosable>(draw: Draw, seed: u64, count: u64) -> Calibration {
    let (seed, count) = (blind_trials::number("PRECUT_TRIAL_SEED", seed), blind_trials::number("PRECUT_TRIALS", count));
    let mut all = Calibration::default();
    for k in 0..count {
        let (class, snr) = HIDDEN[(k % HIDDEN.len() as u64) as usize];
        let trial = draw(class, snr, seed_of(seed, k));
        let job = blind_trials::job::<M>(&trial.request, json!({}));
        let result = Diagnosis::<M>::run(&job, &Unwatched).unwrap().output;
        probabilities::<M>(&mut all, &trial, &result);
        for held in blind_trials::covered(&trial, &result.named) {
            all.sizes.add(held);
        }
        if let Some(held) = gain_holds::<M>(&trial, &result) {
            all.gain.add(held);
        }
        for held in decisions_hold::<M>(&trial, &job, &result, seed_of(seed, k)) {
            all.decided.add(held);
        }
    }
    println!("{}: {count} draws from seed {seed}\n{all}", M::META.id);
    all
}

fn probabilities<M: Diagnosable>(all: &mut Calibration, trial: &Trial, result: &ResultOf<M>) {
    let hidden: Vec<&str> = trial.truth.causes.iter().map(|cause| cause.kind).collect();
    for cause in result.causes.iter().filter(|cause| cause.probability > 0.01) {
        add(&mut all.causes, cause.probability, hidden.contains(&cause.kind.as_str()));
    }
    if result.verdict == VerdictClass::Named {
        let named: Vec<&str> = result.named.iter().map(|cause| cause.kind.as_str()).collect();
        let is_right = named.len() == hidden.len() && hidden.iter().all(|kind| named.contains(kind));
        add(&mut all.named, result.sets[0].posterior, is_right);
    }
    add(&mut all.nothing, result.none_probability, hidden.is_empty());
}

/// Whether the interval of the gain holds what the extended model gains on the rows of a next shift; `None` where it is the
/// base.
fn gain_holds<M: Diagnosable>(trial: &Trial, result: &ResultOf<M>) -> Option<bool> {
    let (gain, later) = (result.gain.as_ref()?, trial.later.as_ref()?);
    if result.effects.is_empty() {
        return None;
    }
    let job = blind_trials::job::<M>(&later.request, json!({ "held_out": false }));
    let square = |effects: &[M::Effect]| residuals_with::<M>(&job, effects).unwrap().iter().map(|r| r * r).sum::<f64>();
    let gained = 1.0 - (square(result.effects.as_slice()) / square(&[])).sqrt();
    let [low, high] = gain.gain_interval_95;
    if std::env::var_os("PRECUT_TRIAL_TALK").is_some() {
        println!("LATER {} gained {gained} in {low} {high}", trial.truth.causes.first().map_or("", |own| own.kind));
    }
    Some((low..=high).contains(&gained))
}

/// Whether what is promised of decisions holds what comes of them where the truth acts with one draw of the allowances, for
/// one cause that is named right and has a number of its own for what was hidden.
fn decisions_hold<M: Diagnosable>(trial: &Trial, job: &JobOf<M>, result: &ResultOf<M>, seed: u64) -> Vec<bool> {
    let ([hidden], [named]) = (trial.truth.causes.as_slice(), result.named.as_slice()) else { return Vec::new() };
    let [effect] = result.effects.as_slice() else { return Vec::new() };
    if named.kind != hidden.kind || hidden.kind == "tool_wear" {
        return Vec::new();
    }
    let mut truth = serde_json::to_value(effect).unwrap();
    let numbers = [(named.parameters[0].name.as_str(), hidden.size)];
    for (name, value) in numbers.iter().copied().chain(hidden.shapes.iter().copied()) {
        let Some(field) = truth.get_mut(name) else { return Vec::new() };
        *field = json!(value);
    }
    let mut random = Random::new(seed);
    let mut acting: Vec<M::Effect> = vec![serde_json::from_value(truth).unwrap()];
    acting.extend(M::allowed(&job.allowances, &mut || random.normal()));
    let came = M::consequences(&job.job, &job.quantity, &job.runs, &result.effects, &[acting], &Unwatched).unwrap();
    let holds = |promised: &precut_calc::diagnosis::DownstreamReport| {
        let value = came.iter().find(|of| of.name == promised.outcome)?.values[0]?;
        let [low, high] = promised.extended.interval_95;
        Some((low..=high).contains(&value))
    };
    result.downstream.iter().filter_map(holds).collect()
}

#[test]
fn what_is_claimed_of_shafts_comes_true_as_often() {
    let all = calibration::<DeflectionCompensation>(blind_trials::shaft, 91, 10);
    assert!(all.gain.reaches(0.92), "{}", all.gain);
}

#[test]
fn what_is_claimed_of_cuts_comes_true_as_often() {
    let all = calibration::<FeedSchedule>(blind_trials::cuts, 92, 10);
    assert!(all.gain.reaches(0.92), "{}", all.gain);
}

#[test]
fn what_is_claimed_of_records_comes_true_as_often() {
    let all = calibration::<FeedSchedule>(blind_trials::records, 93, 10);
    assert!(all.gain.reaches(0.92), "{}", all.gain);
}
