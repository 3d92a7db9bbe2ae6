//! What the next measurement that a diagnosis advises is worth: it is made, by a generator that shares no code with the
//! calculator, and held against another run at the same cost.
//!
//! `PRECUT_TRIALS=300 PRECUT_TRIAL_SEED=9800 cargo test -p precut-calc-tests diagnosis_next -- --nocapture`
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

use precut_calc::calculator::{Answer, Calculator, Diagnosable, ForwardModel, Rows, Unwatched};
use precut_calc::deflection_compensation::{DeflectionCompensation, DeflectionPoint, Job};
use precut_calc::diagnosis::{Diagnosis, JobOf, ResultOf, VerdictClass};
use precut_calc::effects::DeflectionEffect;
use precut_calc::num::stats::Resampler;
use precut_trials::score::Share;
use precut_trials::{Class, Random, Trial, deflection};
use serde_json::{Value, json};

use crate::blind_trials::{job, number, seed_of};

type Model = DeflectionCompensation;

/// Weak enough that many answers are lists.
const SNR: f64 = 1.5;

/// Runs that are planned together.
const PLANNED: usize = 3;

fn diagnosed(request: &Value) -> ResultOf<Model> {
    let options = json!({ "held_out": false, "next_runs": PLANNED });
    Diagnosis::<Model>::run(&job::<Model>(request, options), &Unwatched).unwrap().output
}

/// Whether the hidden cause is named, and nothing else, once more runs were measured.
fn settled(trial: &Trial, seed: u64, runs: &[Option<&Value>]) -> bool {
    let mut request = trial.request.clone();
    for run in runs {
        let count = request["runs"].as_array().unwrap().len();
        let (run, rows) = deflection::measured_next(Class::One, SNR, seed, *run, count + 1);
        request["runs"].as_array_mut().unwrap().push(run);
        request["measurements"].as_array_mut().unwrap().extend(rows);
    }
    let found = diagnosed(&request);
    let named: Vec<&str> = found.named.iter().map(|cause| cause.kind.as_str()).collect();
    found.verdict == VerdictClass::Named && named == [trial.truth.causes[0].kind]
}

/// Where several causes may stand for each other, the run that is advised names the right one more often than one of the same
/// cost that a shift would make anyway, or another of those that were looked at; and several that are planned together more
/// often than one. The first of them as many times is told beside them.
#[test]
fn the_run_that_is_advised_settles_more_than_another() {
    let (seed, count) = (number("PRECUT_TRIAL_SEED", 96), number("PRECUT_TRIALS", 40));
    let [mut advised, mut of_shift, mut of_candidates, mut planned, mut repeated] = [Share::default(); 5];
    for own in (0..count).map(|k| seed_of(seed, k)) {
        let trial = deflection::draw(Class::One, SNR, own);
        let found = diagnosed(&trial.request);
        let Some(next) = found.next_measurement.filter(|_| found.verdict == VerdictClass::Confounded) else { continue };
        let other = &next.candidates[Random::new(own).whole(0, next.candidates.len() - 1)];
        let asked = [&next.run, &other.run].map(|run| serde_json::to_value(run).unwrap());
        let is_settled = [Some(&asked[0]), None, Some(&asked[1])].map(|run| settled(&trial, own, &[run]));
        let further: Vec<Value> = next.further_runs.iter().map(|own| serde_json::to_value(&own.run).unwrap()).collect();
        let together: Vec<Option<&Value>> = asked[..1].iter().chain(&further).map(Some).collect();
        planned.add(settled(&trial, own, &together));
        repeated.add(settled(&trial, own, &vec![Some(&asked[0]); together.len()]));
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
        "named right after the run advised {advised}, one of the shift {of_shift}, another candidate {of_candidates}; \
         after {PLANNED} planned together {planned}, the first of them as often {repeated}"
    );
    assert!(advised.of >= 4, "{advised}");
    assert!(advised.hits >= of_shift.hits.max(of_candidates.hits), "{advised} {of_shift} {of_candidates}");
    assert!(planned.hits >= advised.hits, "{planned} {advised}");
}

/// Rows of one run of a shaft that is too large by the same all along, so often repeated.
fn repeated(times: usize) -> Value {
    let run = json!({ "depth_mm": 0.8, "feed_mm_per_rev": 0.3, "speed_m_per_min": 100.0 });
    let mut request: Value = serde_json::from_str(DeflectionCompensation::DIAGNOSES[0].job).unwrap();
    let mut base: Job = serde_json::from_value(request["job"].clone()).unwrap();
    DeflectionCompensation::fill(&mut base);
    let z_mm: Vec<f64> = (0..24).map(|k| 20.0 + 22.0 * f64::from(k)).collect();
    let points = z_mm.iter().map(|&z_mm| (0, DeflectionPoint { z_mm })).collect();
    let rows = Rows { runs: vec![serde_json::from_value(run.clone()).unwrap()], points };
    let prepared = Model::prepare(&base, &rows, "diameter_deviation_um", &Unwatched).unwrap();
    let truth = Model::predict(&prepared, &[DeflectionEffect::SizeOffset { offset_um: 3.0 }], &Unwatched).unwrap();
    let mut random = Resampler::new(7, 0);
    let mut measured = Vec::new();
    for number in 1..=times {
        for (z_mm, um) in z_mm.iter().zip(&truth) {
            let um = um.as_ref().unwrap() + 0.5 * random.normal();
            measured.push(json!({ "run": number, "trace": number, "z_mm": z_mm, "diameter_deviation_um": um }));
        }
    }
    request["runs"] = json!(vec![run; times]);
    request["measurements"] = json!(measured);
    request["options"] = json!({ "causes": ["carriage_compliance", "size_offset"], "held_out": false });
    request
}

fn answered(request: &Value) -> Answer<ResultOf<Model>> {
    let mut job: JobOf<Model> = serde_json::from_value(request.clone()).unwrap();
    Diagnosis::<Model>::fill(&mut job);
    Diagnosis::<Model>::run(&job, &Unwatched).unwrap()
}

fn says_that_nothing_helps(answer: &Answer<ResultOf<Model>>) -> bool {
    answer.explanation.iter().any(|message| message.code == "diagnosis_next_none")
}

/// Where the force stays as it is, a softer carriage and a part that is off by the same all along are nearly the same: no run tells
/// them apart, the answer says so, and it is so. Where it may differ, the run that is advised would.
#[test]
fn where_no_run_would_tell_the_causes_apart_the_answer_says_so() {
    let mut request = repeated(2);
    let pinned =
        |condition: &str, value: f64| json!({ "condition": condition, "from": value, "to": value * (1.0 + 1e-9) });
    let pinned = json!([pinned("depth_mm", 0.8), pinned("feed_mm_per_rev", 0.3), pinned("speed_m_per_min", 100.0)]);
    request["options"]["ranges"] = pinned.clone();
    let answer = answered(&request);
    assert_eq!(answer.output.verdict, VerdictClass::Confounded, "{:?}", answer.output.sets);
    assert!(says_that_nothing_helps(&answer), "{:?}", answer.explanation);
    let mut more = repeated(12);
    more["options"]["ranges"] = pinned;
    assert_eq!(answered(&more).output.verdict, VerdictClass::Confounded, "ten times as many rows settle nothing");
    let free = answered(&repeated(2));
    assert!(!says_that_nothing_helps(&free));
    let next = free.output.next_measurement.unwrap();
    assert!(next.rows_needed.is_some() && next.changes.contains("depth_mm"), "{next:?}");
}
