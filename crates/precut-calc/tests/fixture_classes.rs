//! Classes of cuts in a vise: their margins, what a row may say, and what a diagnosis makes of them.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Calculator, Check, Diagnosable, Failure, ForwardModel, Rows, Unwatched, Violations};
use precut_calc::diagnosis::{Diagnosis, DiagnosisResult, VerdictClass};
use precut_calc::effects::FixtureEffect;
use precut_calc::fixture_stability::{FixtureJob, FixturePoint, FixtureRun, FixtureStability, RegimeMargin};
use serde_json::{Value, json};

type Vises = Diagnosis<FixtureStability>;

fn example() -> Value {
    let example = FixtureStability::DIAGNOSES.iter().find(|example| example.id == "fixture_classes").unwrap();
    serde_json::from_str(example.job).unwrap()
}

fn job() -> FixtureJob {
    let mut job: FixtureJob = serde_json::from_value(example()["job"].clone()).unwrap();
    FixtureStability::fill(&mut job);
    job
}

fn answer(request: &Value) -> Result<DiagnosisResult<FixtureEffect, FixtureRun>, Failure> {
    let mut job: <Vises as Calculator>::Input = serde_json::from_value(request.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert_eq!(violations.into_vec(), []);
    Vises::fill(&mut job);
    Vises::run(&job, &Unwatched).map(|answer| answer.output)
}

fn margins(job: &FixtureJob, speed: f64, depths: &[f64], margin: RegimeMargin, effects: &[FixtureEffect]) -> Vec<f64> {
    let run = FixtureRun { spindle_speed_rpm: Some(speed), ..FixtureRun::default() };
    let points = depths.iter().map(|&h| (0, FixturePoint { depth_mm: Some(h), margin, ..FixturePoint::default() }));
    let rows = Rows { runs: vec![run], points: points.collect() };
    let Ok(prepared) = FixtureStability::prepare(job, &rows, "regime", &Unwatched) else { panic!("not prepared") };
    FixtureStability::predict(&prepared, effects, &Unwatched).unwrap().into_iter().map(Result::unwrap).collect()
}

fn limit(job: &FixtureJob, speed: f64) -> f64 {
    let run = FixtureRun { spindle_speed_rpm: Some(speed), ..FixtureRun::default() };
    let rows =
        Rows { runs: vec![run], points: vec![(0, FixturePoint { depth_mm: Some(10.0), ..FixturePoint::default() })] };
    let Ok(prepared) = FixtureStability::prepare(job, &rows, "depth_limit_mm", &Unwatched) else { panic!() };
    FixtureStability::predict(&prepared, &[], &Unwatched).unwrap()[0].unwrap()
}

fn speeds() -> Vec<f64> {
    example()["runs"].as_array().unwrap().iter().map(|run| run["spindle_speed_rpm"].as_f64().unwrap()).collect()
}

/// At the limit the margin is 0; near it, ln of the limit over the depth, up to a term that falls with the square.
#[test]
fn near_the_limit_the_margin_is_a_share_of_the_depth() {
    let job = job();
    for speed in speeds() {
        let limit = limit(&job, speed);
        let at = |shift: f64| margins(&job, speed, &[limit * (-shift).exp()], RegimeMargin::Chatter, &[])[0];
        // The limit is found to 1e-8 of the depth.
        assert!(at(0.0).abs() < 1e-6, "{speed}: {}", at(0.0));
        let gap = |shift: f64| (at(shift) - shift).abs() + (at(-shift) + shift).abs();
        let (wide, narrow) = (gap(0.1), gap(0.05));
        // Second order: a quarter at half the distance; the third order leaves it within a half.
        assert!(wide < 0.1 && (narrow < 0.5 * wide || wide < 1e-4), "{speed}: {wide} {narrow}");
    }
}

/// Along the depth and along the stiffness, through several changes of the mode that chatters first, the margin has no jump:
/// from one fine step to the next it moves in proportion to the step.
#[test]
fn the_margin_has_no_jumps() {
    let job = job();
    let limit = limit(&job, speeds()[0]);
    let largest_step = |count: u32| {
        let share = |k: u32| f64::from(k) / f64::from(count);
        let depths: Vec<f64> = (0..=count).map(|k| limit * (0.3 + 2.2 * share(k))).collect();
        let along_depth = margins(&job, speeds()[0], &depths, RegimeMargin::Chatter, &[]);
        let along_stiffness: Vec<f64> = (0..=count)
            .map(|k| {
                let effect = FixtureEffect::Stiffness { factor: 0.5 + 1.2 * share(k) };
                margins(&job, speeds()[0], &[limit], RegimeMargin::Chatter, &[effect])[0]
            })
            .collect();
        [along_depth, along_stiffness].map(|m| m.windows(2).map(|p| (p[1] - p[0]).abs()).fold(0.0, f64::max))
    };
    let (coarse, fine) = (largest_step(60), largest_step(240));
    for (coarse, fine) in coarse.iter().zip(fine) {
        // A quarter of the step: a quarter of the way, and at a kink at most as steep as either side.
        assert!(fine < 0.4 * coarse, "{coarse} {fine}");
    }
}

/// The forced motion goes with H^(1-mu), and so does what it asks of the joints: a closed form.
#[test]
fn the_margin_of_opening_falls_with_the_power_of_the_depth() {
    let job = job();
    let depths = [0.2, 0.4, 0.8];
    let found = margins(&job, speeds()[1], &depths, RegimeMargin::Opening, &[]);
    let power = 1.0 - job.force.depth_exponent;
    for k in 1..3 {
        assert!((found[0] - found[k] - power * (depths[k] / depths[0]).ln()).abs() < 1e-9, "{found:?}");
    }
    // Half the clamp force: less by ln 2.
    let mut loose: Value = example()["job"].clone();
    let force = loose["fixture"]["clamp_force_n"].as_f64().unwrap();
    loose["fixture"]["clamp_force_n"] = json!(0.5 * force);
    let mut loose: FixtureJob = serde_json::from_value(loose).unwrap();
    FixtureStability::fill(&mut loose);
    let half = margins(&loose, speeds()[1], &depths, RegimeMargin::Opening, &[]);
    assert!((found[0] - half[0] - 2.0_f64.ln()).abs() < 1e-9);
}

#[test]
fn the_example_is_told() {
    let result = answer(&example()).unwrap();
    // Hidden is a vise stiffer by 5.5 % (ln 0.0533).
    let told = result.likely_sets.iter().map(|set| &set.causes).chain([&result.named]);
    let mut kinds = told.flatten().map(|cause| cause.kind.as_str());
    assert!(kinds.any(|kind| kind == "stiffness"), "{:?} {:?}", result.verdict, result.sets);
    assert_ne!(result.verdict, VerdictClass::Adequate);
    let classes = result.classes.unwrap();
    // A stable or opened cut speaks about two margins, a chattering one about one.
    let rows = example()["measurements"].as_array().unwrap().len();
    let chattering = classes.class.iter().filter(|class| *class == "chatter").count();
    assert_eq!(classes.class.len(), 2 * (rows - chattering) + chattering);
    assert!(classes.margin.iter().zip(&classes.class).all(|(m, c)| m == "chatter" || c != "chatter"));
    assert!(!classes.limits_base.is_empty() && result.gain.is_none());
    let held_out = classes.held_out.unwrap();
    assert_eq!(held_out.folds, 5);
    // Both are logarithms of probabilities.
    assert!(held_out.log_score_base < 0.0 && held_out.log_score_extended < 0.0);
    assert_eq!(result.noise.source, "spread");
    assert_eq!(result.tests.iter().map(|test| test.test.as_str()).collect::<Vec<_>>(), ["deviance", "levels"]);
    assert!(result.outliers.is_empty());
}

#[test]
fn classes_that_the_base_foresees_are_no_finding() {
    let mut request = example();
    // Causes whose forced motion goes with the depth: of the others it is simulated until it settles, which near the limit takes
    // long.
    let causes = ["stiffness", "damping", "mass", "force_coefficient", "chip_thickness_exponent"];
    request["options"] = json!({ "most_causes": 1, "causes": causes });
    let job = job();
    let speeds = speeds();
    for row in request["measurements"].as_array_mut().unwrap() {
        let run = usize::try_from(row["run"].as_u64().unwrap()).unwrap() - 1;
        let depth = row["depth_mm"].as_f64().unwrap();
        let quiet = margins(&job, speeds[run], &[depth], RegimeMargin::Chatter, &[])[0] > 0.0;
        let closed = margins(&job, speeds[run], &[depth], RegimeMargin::Opening, &[])[0] > 0.0;
        row["regime"] = json!(if !quiet {
            "chatter"
        } else if closed {
            "stable"
        } else {
            "opened"
        });
    }
    let result = answer(&request).unwrap();
    assert_eq!(result.verdict, VerdictClass::Adequate, "{:?}", result.sets);
    // The base predicts what is held back as well as whatever was chosen without it.
    let held_out = result.classes.unwrap().held_out.unwrap();
    assert!((held_out.log_score_base - held_out.log_score_extended).abs() < 0.05);
    // One wrong label far inside: it is pointed at.
    request["options"]["held_out"] = json!(false);
    let stable = request["measurements"].as_array().unwrap().iter().position(|row| row["regime"] != "chatter").unwrap();
    request["measurements"][stable]["regime"] = json!("chatter");
    let mut job: <Vises as Calculator>::Input = serde_json::from_value(request).unwrap();
    Vises::fill(&mut job);
    let warnings = Vises::run(&job, &Unwatched).unwrap().warnings;
    let against = warnings.iter().find(|warning| warning.code == "classes_against_all").unwrap();
    assert_eq!(against.pointer, format!("/measurements/{stable}"));
}

#[test]
fn cuts_of_one_class_are_said_to_be_so() {
    let mut request = example();
    request["options"] = json!({ "held_out": false, "most_causes": 1 });
    for row in request["measurements"].as_array_mut().unwrap() {
        row["regime"] = json!("stable");
        // Well inside the limit.
        row["depth_mm"] = json!(0.1);
    }
    let mut job: <Vises as Calculator>::Input = serde_json::from_value(request).unwrap();
    Vises::fill(&mut job);
    let answer = Vises::run(&job, &Unwatched).unwrap();
    assert_eq!(answer.output.verdict, VerdictClass::Adequate);
    assert!(answer.warnings.iter().any(|warning| warning.code == "one_class"), "{:?}", answer.warnings);
}

#[test]
fn an_opened_joint_takes_a_clamp_force_to_be_judged() {
    let mut request = example();
    request["job"]["fixture"].as_object_mut().unwrap().remove("clamp_force_n");
    let opened = request["measurements"].as_array().unwrap().iter().position(|row| row["regime"] == "opened").unwrap();
    let Err(Failure::OutOfModel(fault)) = answer(&request) else { panic!("judged without a clamp force") };
    assert_eq!(fault.code, "opened_without_clamp_force");
    assert_eq!(fault.pointer, format!("/measurements/{opened}/regime"));
    // A class that there is not is no row at all.
    request["measurements"][0]["regime"] = json!("noisy");
    let read: Result<<Vises as Calculator>::Input, _> = serde_json::from_value(request);
    assert!(read.unwrap_err().to_string().contains("noisy"));
}
