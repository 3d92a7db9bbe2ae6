//! Blind trials of the diagnosis on vises: effects hidden by a generator that shares no code with the calculator.
//!
//! Few are drawn here; more and others:
//! `PRECUT_TRIALS=100 PRECUT_TRIAL_SEED=12345 cargo test --release -p precut-calc fixture_diagnosis_trials:: -- --nocapture`.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use precut_calc::calculator::{Calculator, Check, Unwatched, Violations};
use precut_calc::diagnosis::{Diagnosis, NamedCause, VerdictClass};
use precut_calc::fixture_stability::FixtureStability;
use precut_trials::score::{Said, Score};
use precut_trials::{Class, Trial, fixture};
use serde_json::json;

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

fn kinds(causes: &[NamedCause]) -> Vec<String> {
    causes.iter().map(|cause| cause.kind.clone()).collect()
}

fn answer(trial: &Trial) -> Said {
    let mut request = trial.request.clone();
    request["options"] = json!({ "held_out": false });
    let mut job: <Diagnosis<FixtureStability> as Calculator>::Input = serde_json::from_value(request).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert!(violations.is_empty(), "{:?}", violations.into_vec());
    Diagnosis::<FixtureStability>::fill(&mut job);
    let result = Diagnosis::<FixtureStability>::run(&job, &Unwatched).unwrap().output;
    let covered = trial
        .truth
        .causes
        .iter()
        .filter_map(|hidden| {
            let named = result.named.iter().find(|cause| cause.kind == hidden.kind)?;
            let [low, high] = named.parameters[0].interval_95?;
            Some((low..=high).contains(&hidden.size))
        })
        .collect();
    let verdict = match result.verdict {
        VerdictClass::Adequate => "adequate",
        VerdictClass::Named => "named",
        VerdictClass::Confounded => "confounded",
        VerdictClass::Unknown => "unknown",
        VerdictClass::Refused => "refused",
    };
    if std::env::var("PRECUT_TRIAL_TALK").is_ok() {
        let names = |causes: &[NamedCause]| {
            let each = |c: &NamedCause| {
                let values: Vec<String> = c.parameters.iter().map(|p| format!("{:.4}", p.value)).collect();
                format!("{} {} [{}]", c.kind, c.label, values.join(" "))
            };
            causes.iter().map(each).collect::<Vec<_>>().join(" + ")
        };
        println!(
            "truth {:?} sigma {:.4} found {:.4} -> {verdict}",
            trial.truth.causes, trial.sigma, result.noise.standard_deviation
        );
        for set in result.sets.iter().take(4) {
            let rest = if set.with_remainder { "+rest" } else { "" };
            println!("     {:.2e} {rest} {}", set.posterior, names(&set.causes));
        }
    }
    let first = result.sets.iter().find(|set| !set.causes.is_empty() && !set.with_remainder);
    Said {
        verdict: verdict.to_owned(),
        named: kinds(&result.named),
        likely: result.likely_sets.iter().map(|set| kinds(&set.causes)).collect(),
        first: first.map_or_else(Vec::new, |set| kinds(&set.causes)),
        covered,
    }
}

fn score(class: Class, snr: f64, seed: u64, count: u64) -> Score {
    let mut score = Score::default();
    for k in 0..count {
        let trial = fixture::draw(class, snr, seed.wrapping_mul(1_000_003).wrapping_add(k));
        score.add(&trial.truth, &answer(&trial));
    }
    println!("{class:?}, signal to noise {snr}, {count} draws from seed {seed}\n{score}");
    score
}

#[test]
fn nothing_hidden_raises_no_alarm() {
    let score = score(Class::Nothing, 0.0, number("PRECUT_TRIAL_SEED", 1), number("PRECUT_TRIALS", 1));
    assert!(score.quiet.reaches(0.97), "{}", score.quiet);
}

#[test]
fn one_hidden_cause_is_named_right_or_not_at_all() {
    let score = score(Class::One, 5.0, number("PRECUT_TRIAL_SEED", 2), number("PRECUT_TRIALS", 2));
    assert!(score.named_right.reaches(0.96), "{}", score.named_right);
    assert!(score.truth_listed.reaches(0.90), "{}", score.truth_listed);
}

#[test]
fn what_the_catalogue_lacks_is_unknown() {
    let score = score(Class::Outside, 5.0, number("PRECUT_TRIAL_SEED", 4), number("PRECUT_TRIALS", 1));
    assert!(score.unknown.reaches(0.93), "{}", score.unknown);
}
