//! Parts that a program made: what is hidden in what they measure is found, and nothing where nothing is hidden.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{
    Answer, Calculator, Check, Diagnosable, Failure, ForwardModel, PrepareError, Rows, Unwatched, Violations,
};
use precut_calc::deflection_compensation::DeflectionPoint;
use precut_calc::diagnosis::{Diagnosis, DiagnosisResult, VerdictClass};
use precut_calc::effects::DeflectionEffect;
use precut_calc::program_compensation::{Job, ProgramCompensation, ProgramRun, Transition};
use serde_json::{Value, json};

use crate::draw::Draw;
use crate::program_yielding::solve;

type OfPrograms = Diagnosis<ProgramCompensation>;

/// Standard deviation of a measured diameter, um.
const SCATTER_UM: f64 = 0.4;

fn example(id: &str) -> Value {
    let found = ProgramCompensation::META.examples.iter().find(|example| example.id == id).unwrap();
    let mut job: Value = serde_json::from_str(found.job).unwrap();
    job["mode"] = json!({ "kind": "read" });
    job
}

fn parsed(job: &Value) -> Job {
    let mut job: Job = serde_json::from_value(job.clone()).unwrap();
    ProgramCompensation::fill(&mut job);
    job
}

fn answered(job: &Value) -> Answer<DiagnosisResult<DeflectionEffect, ProgramRun>> {
    let mut job: <OfPrograms as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert!(violations.is_empty());
    OfPrograms::fill(&mut job);
    OfPrograms::run(&job, &Unwatched).unwrap()
}

/// Places along the turned part, each of the first run.
fn rows_along(runs: Vec<ProgramRun>) -> Rows<ProgramRun, DeflectionPoint> {
    Rows { runs, points: (3..38).map(|i| (0, DeflectionPoint { z_mm: 10.0 * f64::from(i) - 4.0 })).collect() }
}

/// Nearly normal: twelve even numbers have a variance of one.
fn normal(draw: &mut Draw) -> f64 {
    (0..12).map(|_| draw.share()).sum::<f64>() - 6.0
}

/// What comes out along the contour, less what is meant: measured on so many parts that the answer of the calculator itself gives.
fn measured(job: &Value, parts: u32, draw: &mut Draw) -> Vec<Value> {
    let answer = solve(job);
    let contour = &answer.output.yielding.as_ref().unwrap().contour;
    let step = contour.z_mm.len() / 24;
    let mut rows = Vec::new();
    for run in 1..=parts {
        for i in (0..contour.z_mm.len()).step_by(step.max(1)) {
            let deviation = contour.diameter_error_um[i] + SCATTER_UM * normal(draw);
            rows.push(json!({ "run": run, "z_mm": contour.z_mm[i], "diameter_deviation_um": deviation }));
        }
    }
    rows
}

fn diagnosis(job: &Value, rows: Vec<Value>, parts: usize) -> Value {
    json!({
        "calculator": "program-compensation", "job": job, "runs": vec![json!({}); parts],
        "quantity": "diameter_deviation_um", "measurements": rows, "options": { "held_out": false },
    })
}

#[test]
fn what_is_predicted_is_what_the_calculator_answers() {
    let mut job = example("slender_shaft");
    job["effects"] = json!([{ "kind": "tailstock_compliance", "delta_um_per_n": 0.02 }]);
    let answer = solve(&job);
    let contour = &answer.output.yielding.as_ref().unwrap().contour;
    job["effects"] = json!([]);
    let points = contour.z_mm.iter().map(|&z_mm| (0, DeflectionPoint { z_mm })).collect();
    let rows = Rows { runs: vec![ProgramRun::default()], points };
    let prepared = ProgramCompensation::prepare(&parsed(&job), &rows, "diameter_deviation_um", &Unwatched).unwrap();
    let effects = [DeflectionEffect::TailstockCompliance { delta_um_per_n: 0.02 }];
    let predicted = ProgramCompensation::predict(&prepared, &effects, &Unwatched).unwrap();
    for ((found, told), z) in predicted.into_iter().zip(&contour.diameter_error_um).zip(&contour.z_mm) {
        // Both are straight between places within 0.03 um on the radius, at places of their own.
        assert!((found.unwrap() - told).abs() < 0.12, "{z}");
    }
}

#[test]
fn a_small_change_of_an_effect_changes_the_prediction_smoothly() {
    let rows = rows_along(vec![ProgramRun::default()]);
    let job = parsed(&example("slender_shaft"));
    let prepared = ProgramCompensation::prepare(&job, &rows, "diameter_deviation_um", &Unwatched).unwrap();
    let at = |delta_um_per_n: f64| -> Vec<f64> {
        let effects = [DeflectionEffect::TailstockCompliance { delta_um_per_n }];
        let found = ProgramCompensation::predict(&prepared, &effects, &Unwatched).unwrap();
        found.into_iter().map(Result::unwrap).collect()
    };
    // Of steps of 1e-4 and 1e-3 um/N the slopes are the same: the lift is solved to 1e-5 um, which is 0.2 um per um/N of the small step on
    // the diameter; 2 % are left to the curvature.
    let (small, large) = (1e-4, 1e-3);
    let base = at(0.0);
    for ((base, small_to), large_to) in base.iter().zip(at(small)).zip(at(large)) {
        let slopes = [(small_to - base) / small, (large_to - base) / large];
        assert!((slopes[0] - slopes[1]).abs() < 0.02 * slopes[1].abs() + 0.5, "{slopes:?}");
    }
}

#[test]
fn a_soft_tailstock_is_named_and_nothing_where_nothing_is_hidden() {
    let job = example("slender_shaft");
    let mut draw = Draw::new(33);
    let answer = answered(&diagnosis(&job, measured(&job, 2, &mut draw), 2));
    assert_eq!(answer.output.verdict, VerdictClass::Adequate);

    let mut hidden = job.clone();
    hidden["effects"] = json!([{ "kind": "tailstock_compliance", "delta_um_per_n": 0.03 }]);
    let answer = answered(&diagnosis(&job, measured(&hidden, 2, &mut draw), 2));
    let result = &answer.output;
    assert_eq!(result.verdict, VerdictClass::Named, "{:?}", result.named);
    assert_eq!(result.named.iter().map(|cause| cause.kind.as_str()).collect::<Vec<_>>(), ["tailstock_compliance"]);
    let [low, high] = result.named[0].parameters[0].interval_95.unwrap();
    assert!(low < 0.03 && 0.03 < high && high - low < 0.02, "{low} to {high}");
    let [form, largest] = &result.downstream[..] else { panic!("{:?}", result.downstream) };
    assert_eq!((form.outcome.as_str(), largest.outcome.as_str()), ("form_error_um", "largest_error_um"));
    for of in [form, largest] {
        // Chords and increments leave up to 3 um by themselves.
        assert!(of.extended.mean < 0.7 * of.base.mean, "{of:?}");
    }
    // What was found is what a job takes: with it the program is corrected for this machine.
    let mut known = job.clone();
    known["effects"] = serde_json::to_value(&result.effects).unwrap();
    known["mode"] = json!({ "kind": "compensate" });
    let given_back = solve(&known).output.compensation.unwrap().nc_program;
    let ranges = [None, Some(given_back)].map(|nc_program| {
        let runs = vec![ProgramRun { nc_program, ..ProgramRun::default() }];
        let prepared =
            ProgramCompensation::prepare(&parsed(&hidden), &rows_along(runs), "diameter_deviation_um", &Unwatched);
        let found = ProgramCompensation::predict(&prepared.unwrap(), &[], &Unwatched).unwrap();
        let errors: Vec<f64> = found.into_iter().map(Result::unwrap).collect();
        errors.iter().fold(0.0_f64, |most, error| most.max(error.abs()))
    });
    assert!(ranges[1] < 0.3 * ranges[0], "{ranges:?}");
}

/// What the diagnosis says of a program that is corrected with what it found, against parts of such programs as the calculator itself gives
/// them back and drives them.
#[test]
fn what_a_better_model_gains_comes_so() {
    let mut job = example("slender_shaft");
    // As fine as may be: the default leaves more by chords and increments than the better model.
    job["mode"] = json!({ "kind": "read", "chord_tolerance_um": 0.1, "increment_um": 0.1 });
    let found = DeflectionEffect::TailstockCompliance { delta_um_per_n: 0.03 };
    let acting = vec![vec![found.clone()]];
    let mut tried = Vec::new();
    for believed in [&[][..], std::slice::from_ref(&found)] {
        let told = ProgramCompensation::consequences(
            &parsed(&job),
            "diameter_deviation_um",
            &[],
            believed,
            &acting,
            &Unwatched,
        );
        let told: Vec<f64> = told.unwrap().iter().map(|of| of.values[0].unwrap()).collect();
        let mut planned = job.clone();
        planned["mode"]["kind"] = json!("compensate");
        planned["effects"] = serde_json::to_value(believed).unwrap();
        let answer = solve(&planned);
        let given_back = answer.output.compensation.unwrap();
        let is_inside = |z: f64| move |one: &Transition| one.z_mm <= z && z <= one.z_mm + one.length_mm;
        let is_judged = |z: &f64| !given_back.transitions.iter().any(is_inside(*z));
        let points = given_back
            .contour
            .z_mm
            .iter()
            .copied()
            .filter(is_judged)
            .map(|z_mm| (0, DeflectionPoint { z_mm }))
            .collect();
        let runs = vec![ProgramRun { nc_program: Some(given_back.nc_program), ..ProgramRun::default() }];
        let prepared =
            ProgramCompensation::prepare(&parsed(&job), &Rows { runs, points }, "diameter_deviation_um", &Unwatched);
        let errors = ProgramCompensation::predict(&prepared.unwrap(), &acting[0], &Unwatched).unwrap();
        let errors: Vec<f64> = errors.into_iter().map(Result::unwrap).collect();
        let ends = errors.iter().fold([0.0_f64; 2], |[low, high], error| [low.min(*error), high.max(*error)]);
        // Both are looked at where the path is straight within 0.03 um on the radius, at places of their own.
        assert!((told[0] - (ends[1] - ends[0])).abs() < 0.25, "{told:?} {ends:?}");
        assert!((told[1] - ends[1].max(-ends[0])).abs() < 0.12, "{told:?} {ends:?}");
        tried.push(told[1]);
    }
    assert!(tried[1] < 0.3 * tried[0], "{tried:?}");
}

#[test]
fn a_part_of_the_program_that_was_given_back_is_held_against_what_the_given_one_means() {
    let mut job = example("slender_shaft");
    job["mode"] = json!({ "kind": "compensate" });
    let given_back = solve(&job).output.compensation.unwrap().nc_program;
    job["mode"] = json!({ "kind": "read" });
    let rows = rows_along(vec![ProgramRun { nc_program: Some(given_back), ..ProgramRun::default() }]);
    let prepared = ProgramCompensation::prepare(&parsed(&job), &rows, "diameter_deviation_um", &Unwatched).unwrap();
    for found in ProgramCompensation::predict(&prepared, &[], &Unwatched).unwrap() {
        // Chord tolerance and increment of the correction, 0.5 and 1 um on the radius.
        assert!(found.unwrap().abs() < 3.0, "{found:?}");
    }
}

#[test]
fn without_forces_nothing_is_predicted() {
    let mut job = example("slender_shaft");
    job["force"] = Value::Null;
    job["supports"] = json!([]);
    let rows = (0..12).map(|i| json!({ "z_mm": 20 + i, "diameter_deviation_um": i })).collect();
    let mut job: <OfPrograms as Calculator>::Input = serde_json::from_value(diagnosis(&job, rows, 1)).unwrap();
    OfPrograms::fill(&mut job);
    let failure = OfPrograms::run(&job, &Unwatched).unwrap_err();
    assert!(format!("{failure:?}").contains("prediction_without_force"), "{failure:?}");
}

/// A program that is not read is told where it stands: that of a part, or that of the job.
#[test]
fn a_program_that_is_not_read_is_told_where_it_stands() {
    let job = example("slender_shaft");
    let pointers = |base: &Value, run: ProgramRun| {
        let rows = rows_along(vec![run]);
        match ProgramCompensation::prepare(&parsed(base), &rows, "diameter_deviation_um", &Unwatched) {
            Err(PrepareError::Failed(Failure::NotRead { findings, .. })) => {
                findings.into_iter().map(|finding| finding.pointer).collect::<Vec<String>>()
            }
            _ => panic!("a program was read that has none"),
        }
    };
    let wrong = "O1\nQQ 7\nM30\n".to_owned();
    let run = ProgramRun { nc_program: Some(wrong.clone()), ..ProgramRun::default() };
    assert_eq!(pointers(&job, run), ["/runs/0/nc_program"]);
    let mut base = job;
    base["nc_program"] = json!(wrong);
    assert_eq!(pointers(&base, ProgramRun::default()), ["/job/nc_program"]);
}
