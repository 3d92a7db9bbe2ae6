//! Blind trials of the diagnosis of any calculator: effects hidden by a generator that shares no code with it.
//!
//! The tests of a calculator state how many are drawn from which seed and what the score must reach, two binomial standard
//! deviations below the goal. Every one of them takes other numbers from the environment:
//!
//! - `PRECUT_TRIALS`: how many;
//! - `PRECUT_TRIAL_SEED`: from which seed;
//! - `PRECUT_TRIAL_GAIN=1`: the gain on data held back, too, which takes many times as long;
//! - `PRECUT_TRIAL_TALK=1`: what every answer says.
//!
//! The draws that stand in the tests are kept with their confusion matrices in `tests/trials`: a change that moves an answer is
//! seen there. `PRECUT_WRITE_TRIALS=1` writes them anew.
//!
//! `PRECUT_TRIALS=300 PRECUT_TRIAL_SEED=12345 cargo test --release -p precut-calc diagnosis_trials -- --nocapture`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::path::Path;

use precut_calc::calculator::{Calculator, Check, Diagnosable, Unwatched, Violations};
use precut_calc::diagnosis::{Diagnosis, NamedCause, ResultOf};
use precut_trials::score::{Said, Score};
use precut_trials::{Class, Trial};
use serde_json::json;

/// Draws trial number `seed` of a class at a ratio of signal to noise.
pub(crate) type Draw = fn(Class, f64, u64) -> Trial;

/// What is hidden: how, how strongly, from which seed, and how many times.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Trials {
    /// Name of the file that keeps the score.
    pub(crate) name: &'static str,
    pub(crate) draw: Draw,
    pub(crate) class: Class,
    pub(crate) snr: f64,
    pub(crate) seed: u64,
    pub(crate) count: u64,
}

/// The score of the diagnosis of `M` on so many draws; printed with its confusion matrix.
pub(crate) fn score<M: Diagnosable>(trials: Trials) -> Score {
    let Trials { name, draw, class, snr, .. } = trials;
    let (seed, count) = (number("PRECUT_TRIAL_SEED", trials.seed), number("PRECUT_TRIALS", trials.count));
    let mut score = Score::default();
    for k in 0..count {
        let trial = draw(class, snr, seed.wrapping_mul(1_000_003).wrapping_add(k));
        score.add(&trial.truth, &answer::<M>(&trial));
    }
    let text = format!("{}: {class:?}, signal to noise {snr}, {count} draws from seed {seed}\n{score}", M::META.id);
    println!("{text}");
    if (seed, count) == (trials.seed, trials.count) && std::env::var("PRECUT_TRIAL_GAIN").is_err() {
        keep(name, &text);
    }
    score
}

/// Compares with the score that is kept under a name, or keeps this one.
fn keep(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/trials").join(name).with_extension("txt");
    if std::env::var_os("PRECUT_WRITE_TRIALS").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(kept, text, "{} is another: see what moved, then PRECUT_WRITE_TRIALS=1", path.display());
}

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

fn answer<M: Diagnosable>(trial: &Trial) -> Said {
    let mut request = trial.request.clone();
    request["options"] = json!({ "held_out": std::env::var("PRECUT_TRIAL_GAIN").is_ok() });
    let mut job: <Diagnosis<M> as Calculator>::Input = serde_json::from_value(request).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert!(violations.is_empty(), "{:?}", violations.into_vec());
    Diagnosis::<M>::fill(&mut job);
    let result = Diagnosis::<M>::run(&job, &Unwatched).unwrap().output;
    if std::env::var("PRECUT_TRIAL_TALK").is_ok() {
        talk::<M>(trial, &result);
    }
    let first = result.sets.iter().find(|set| !set.causes.is_empty() && !set.with_remainder);
    Said {
        verdict: result.verdict.name().to_owned(),
        named: kinds(&result.named),
        likely: result.likely_sets.iter().map(|set| kinds(&set.causes)).collect(),
        first: first.map_or_else(Vec::new, |set| kinds(&set.causes)),
        covered: covered(trial, &result.named),
        explained_share: result.gain.and_then(|gain| gain.explained_share),
    }
}

/// Whether the 95 % interval of the first parameter of a named cause holds what was hidden, for every cause named right.
fn covered(trial: &Trial, named: &[NamedCause]) -> Vec<bool> {
    let of = |hidden: &precut_trials::Hidden| {
        let named = named.iter().find(|cause| cause.kind == hidden.kind)?;
        let [low, high] = named.parameters[0].interval_95?;
        Some((low..=high).contains(&hidden.size))
    };
    trial.truth.causes.iter().filter_map(of).collect()
}

fn kinds(causes: &[NamedCause]) -> Vec<String> {
    causes.iter().map(|cause| cause.kind.clone()).collect()
}

fn talk<M: Diagnosable>(trial: &Trial, result: &ResultOf<M>) {
    let each = |cause: &NamedCause| {
        let values: Vec<String> = cause.parameters.iter().map(|p| format!("{:.4}", p.value)).collect();
        format!("{} {} [{}]", cause.kind, cause.label, values.join(" "))
    };
    println!(
        "truth {:?} sigma {:.4} found {:.4} -> {}",
        trial.truth.causes,
        trial.sigma,
        result.noise.standard_deviation,
        result.verdict.name()
    );
    for hidden in &trial.truth.causes {
        let Some(named) = result.named.iter().find(|cause| cause.kind == hidden.kind) else { continue };
        let first = &named.parameters[0];
        println!("     {} hidden {:.5} fitted {:.5} in {:?}", hidden.kind, hidden.size, first.value, first.interval_95);
    }
    for set in result.sets.iter().take(4) {
        let rest = if set.with_remainder { "+rest" } else { "" };
        let names: Vec<String> = set.causes.iter().map(each).collect();
        println!("     {:.2e} {rest} {}", set.posterior, names.join(" + "));
    }
}
