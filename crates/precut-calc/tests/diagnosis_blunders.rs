//! Rows that were written down wrongly are called that, and no others are (`diagnosis/8`).
//!
//! `PRECUT_TRIALS=60 PRECUT_TRIAL_SEED=9800 cargo test -p precut-calc-tests diagnosis_blunders -- --nocapture`
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use precut_calc::calculator::{Calculator, Diagnosable, Unwatched};
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::diagnosis::{Diagnosis, ResultOf, VerdictClass};
use precut_calc::feed_schedule::FeedSchedule;
use precut_trials::score::Share;
use precut_trials::{Class, Random, deflection, machinability};
use serde_json::{Value, json};

use crate::blind_trials::{self, Draw, number, seed_of};

fn answered<M: Diagnosable>(request: &Value) -> ResultOf<M> {
    Diagnosis::<M>::run(&blind_trials::job::<M>(request, json!({ "held_out": false })), &Unwatched).unwrap().output
}

/// The values of a column of the rows that are chosen, changed.
fn change(request: &mut Value, column: &str, is_chosen: impl Fn(&Value) -> bool, to: impl Fn(f64) -> f64) {
    for row in request["measurements"].as_array_mut().unwrap() {
        if is_chosen(row) {
            row[column] = json!(to(row[column].as_f64().unwrap()));
        }
    }
}

/// What was done, by its kind, and the runs that it was done to.
struct Done {
    kind: &'static str,
    runs: Vec<u32>,
}

/// A blunder in the table of a shaft; `None` where it would change next to nothing.
fn blunder_of_shaft(number: u64, request: &mut Value, random: &mut Random) -> Option<Done> {
    let runs = request["runs"].as_array().unwrap().clone();
    let chosen = random.whole(0, runs.len() - 1);
    let is_of = |row: &Value| row["run"] == json!(chosen + 1);
    let depth = |run: usize| runs[run]["depth_mm"].as_f64().unwrap();
    let one = |kind| Some(Done { kind, runs: vec![u32::try_from(chosen + 1).unwrap()] });
    match number % 6 {
        0 => {
            let other = (0..runs.len()).find(|&other| !(0.7..1.4).contains(&(depth(other) / depth(chosen))))?;
            request["runs"].as_array_mut().unwrap().swap(chosen, other);
            let mut both = vec![u32::try_from(chosen + 1).unwrap(), u32::try_from(other + 1).unwrap()];
            both.sort_unstable();
            Some(Done { kind: "runs_exchanged", runs: both })
        }
        1 => {
            change(request, "diameter_deviation_um", is_of, |value| 0.5 * value);
            one("run_in_unit")
        }
        2 => {
            change(request, "diameter_deviation_um", is_of, |value| value + 60.0);
            one("zero_shifted")
        }
        3 => {
            let length = request["job"]["shaft"]["segments"][0]["length_mm"].as_f64().unwrap();
            change(request, "z_mm", |_| true, |z| length - z);
            Some(Done { kind: "from_other_end", runs: Vec::new() })
        }
        4 => {
            for run in request["runs"].as_array_mut().unwrap() {
                run["depth_mm"] = json!(2.0 * run["depth_mm"].as_f64().unwrap());
            }
            Some(Done { kind: "condition_in_unit", runs: Vec::new() })
        }
        _ => {
            let own = &mut request["runs"][chosen]["depth_mm"];
            *own = json!(2.0 * own.as_f64().unwrap());
            one("condition_in_unit")
        }
    }
}

/// A column of a table of cuts in another unit.
#[allow(clippy::unnecessary_wraps, reason = "as blunders of shafts are made, of which some cannot be")]
fn blunder_of_cuts(number: u64, request: &mut Value, _random: &mut Random) -> Option<Done> {
    let (column, factor) = [
        ("depth_mm", 2.0),
        ("feed_mm_per_rev", 1.0 / 25.4),
        ("speed_m_per_min", 1.0 / 0.3048),
        ("depth_mm", 1.0 / 25.4),
    ][(number % 4) as usize];
    change(request, column, |_| true, |value| factor * value);
    Some(Done { kind: "condition_in_unit", runs: Vec::new() })
}

#[derive(Debug, Default)]
struct Found {
    /// Blunders that are the likeliest, and that nothing is said about physics beside.
    named: Share,
    /// Of blunders that are told, those that were made.
    right: Share,
    /// Of blunders made, those beside which a cause is named all the same.
    blamed: Share,
    /// Tables without a blunder: nothing told, nothing refused.
    quiet: Share,
}

fn tried<M: Diagnosable>(
    draw: Draw,
    of: fn(u64, &mut Value, &mut Random) -> Option<Done>,
    (seed, count): (u64, u64),
) -> Found {
    let (seed, count) = (number("PRECUT_TRIAL_SEED", seed), number("PRECUT_TRIALS", count));
    let mut found = Found::default();
    for k in 0..count {
        let (class, snr) = [(Class::Nothing, 0.0), (Class::One, 3.0)][(k % 2) as usize];
        let mut request = draw(class, snr, seed_of(seed, k)).request;
        let mut random = Random::new(seed_of(seed, k));
        let Some(done) = of(k / 2, &mut request, &mut random) else { continue };
        let result = answered::<M>(&request);
        let first = result.blunders.first();
        let is_it = first.is_some_and(|first| first.kind == done.kind && first.runs == done.runs);
        let refusal = result.refusal.as_ref().map_or("", |refusal| refusal.reason.as_str());
        found.named.add((is_it && refusal == "blunder_suspected") || refusal == "unit_suspected");
        if first.is_some() {
            found.right.add(is_it);
        }
        found.blamed.add(result.verdict == VerdictClass::Named);
        println!(
            "{class:?} {} {:?}: {} {refusal} {:?}",
            done.kind,
            done.runs,
            result.verdict.name(),
            result
                .blunders
                .iter()
                .map(|own| format!("{} {:?} {:.3}", own.kind, own.runs, own.probability))
                .collect::<Vec<_>>()
        );
    }
    let classes =
        [(Class::Nothing, 0.0), (Class::One, 3.0), (Class::Two, 3.0), (Class::Outside, 3.0), (Class::One, 7.0)];
    for k in 0..count {
        let (class, snr) = classes[(k % 5) as usize];
        let trial = draw(class, snr, seed_of(seed + 1, k));
        let result = answered::<M>(&trial.request);
        found.quiet.add(result.blunders.is_empty());
        if !result.blunders.is_empty() {
            println!("without: {class:?} {:?} {:?}", trial.truth.causes.first().map(|own| own.kind), result.blunders);
        }
    }
    println!("{}: {count} draws from seed {seed}\n{found:?}", M::META.id);
    found
}

#[test]
fn blunders_in_tables_of_shafts_are_named_and_others_are_not() {
    let found = tried::<DeflectionCompensation>(deflection::draw, blunder_of_shaft, (101, 24));
    assert!(found.right.reaches(0.95) && found.quiet.reaches(0.97) && found.blamed.hits <= 2, "{found:?}");
    assert!(found.named.reaches(0.8), "{found:?}");
}

#[test]
fn columns_of_cuts_in_another_unit_are_named_and_others_are_not() {
    let found = tried::<FeedSchedule>(machinability::draw, blunder_of_cuts, (102, 24));
    assert!(found.right.reaches(0.95) && found.quiet.reaches(0.97), "{found:?}");
}
