//! The diagnosis of rings: the open case of the reference, whose hidden cause is known, and what a ring brings to it.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::f64::consts::TAU;

use precut_calc::calculator::{
    Answer, Calculator, Check, Diagnosable, Failure, ForwardModel, Inapplicability, PrepareError, Ranges, Rows, Smooth,
    Treatment, Unwatched, Violations,
};
use precut_calc::diagnosis::{Diagnosis, DiagnosisResult, VerdictClass};
use precut_calc::effects::{RING_CAUSES, RingEffect};
use precut_calc::ring_roundness::{Job, RingPoint, RingRoundness, RingRun};
use serde_json::{Value, json};

type Rings = Diagnosis<RingRoundness>;

fn answered(job: &Value) -> Result<Answer<DiagnosisResult<RingEffect, RingRun>>, Failure> {
    let mut job: <Rings as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert_eq!(violations.into_vec(), []);
    Rings::fill(&mut job);
    Rings::run(&job, &Unwatched)
}

/// A small ring, turned in six revolutions and one without feed.
fn short() -> Value {
    json!({
        "ring": { "radius_mm": 60.0, "harmonics": [{ "order": 2, "amplitude_um": 40.0 }] },
        "supports": { "distance_mm": 80.0, "depth_mm": 44.72 },
        "tool": {
            "x_mm": 40.06, "y_mm": 44.78, "feed_direction_deg": 228.18, "feed_mm_per_rev": 0.04,
            "revolutions": 6, "spark_out_revolutions": 1
        }
    })
}

fn job(value: &Value) -> Job {
    serde_json::from_value(value.clone()).unwrap()
}

fn all_round(count: u32, ring: usize) -> impl Iterator<Item = (usize, RingPoint)> {
    (0..count).map(move |i| (ring, RingPoint { angle_deg: 360.0 * f64::from(i) / f64::from(count) }))
}

fn prepared(job: &Job, runs: Vec<RingRun>, quantity: &str) -> <RingRoundness as ForwardModel>::Prepared {
    let points = (0..runs.len()).flat_map(|ring| all_round(72, ring)).collect();
    match RingRoundness::prepare(job, &Rows { runs, points }, quantity, &Unwatched) {
        Ok(prepared) => prepared,
        Err(PrepareError::Invalid(faults)) => panic!("{faults:?}"),
        Err(PrepareError::Failed(failure)) => panic!("{failure}"),
    }
}

/// The short job of the reference in the terms of the contract.
fn reference() -> (Value, Value) {
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .join("tests/reference/diagnosis/example-roundness-roller_runout.json");
    let case: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let short = &case["job"];
    let at = |name: &str, i: usize| short[name][i].as_f64().unwrap();
    let (x, y) = (at("tool_start_mm", 0), at("tool_start_mm", 1));
    let request = json!({
        "calculator": "ring-roundness",
        "job": {
            "ring": {
                "radius_mm": short["radius_mm"],
                "harmonics": [{ "order": 2, "amplitude_um": short["initial_ovality_mm"].as_f64().unwrap() * 500.0 }]
            },
            "supports": { "distance_mm": 2.0 * at("support_b_mm", 0), "depth_mm": -at("support_b_mm", 1) },
            "tool": {
                "x_mm": x, "y_mm": y, "feed_direction_deg": y.atan2(x).to_degrees() + 180.0,
                "feed_mm_per_rev": short["feed_mm_per_rev"], "revolutions": short["infeed_revolutions"],
                "spark_out_revolutions": short["spark_out_revolutions"]
            }
        },
        "quantity": "radial_deviation_um",
        "measurements": case["measurements"],
        // Every prediction is a simulation of 98 revolutions: no folds, no triples.
        "options": { "held_out": false, "most_causes": 2 }
    });
    (request, case["answer"].clone())
}

#[test]
fn the_hidden_cause_of_the_open_case_is_named() {
    let (request, truth) = reference();
    let result = answered(&request).unwrap().output;
    assert_eq!(result.verdict, VerdictClass::Named);
    let [RingEffect::RollerRunout { amplitude_mm, ratio, phase_rad }] = result.effects[..] else {
        panic!("{:?}", result.effects)
    };
    let hidden = &truth["effects"][0]["params"];
    let of = |name: &str| hidden[name].as_f64().unwrap();
    // The ratio is fitted: a standard deviation of 6e-5, three of them.
    assert!((ratio - of("ratio")).abs() < 2e-4, "{ratio}");
    // Where the turning ends, after 98 revolutions, is what shows: A cos ph and A sin ph there have standard deviations of
    // 1.3 % of the amplitude each: within three of them.
    let tool = &request["job"]["tool"];
    let turned = TAU * (tool["revolutions"].as_f64().unwrap() + tool["spark_out_revolutions"].as_f64().unwrap());
    let at_end = |size: f64, ratio: f64, phase: f64| {
        let (sin, cos) = (ratio * turned + phase).sin_cos();
        (size * cos, size * sin)
    };
    let size = of("amplitude_mm");
    let (found, hidden) = (at_end(amplitude_mm, ratio, phase_rad), at_end(size, of("ratio"), of("phase_rad")));
    let off = (found.0 - hidden.0).hypot(found.1 - hidden.1);
    assert!(off < 0.04 * size, "{found:?}, hidden {hidden:?}");
}

#[test]
fn the_example_names_its_cause_and_predicts_what_was_held_back() {
    let example: Value = serde_json::from_str(RingRoundness::DIAGNOSES[0].job).unwrap();
    let result = answered(&example).unwrap().output;
    assert_eq!(result.verdict, VerdictClass::Named, "{:?}", result.sets);
    assert_eq!(result.named.iter().map(|cause| cause.kind.as_str()).collect::<Vec<_>>(), ["roller_runout"]);
    let gain = result.gain.unwrap();
    assert_eq!(gain.folds, 4);
    assert!(gain.rmse_extended < 0.5 * gain.rmse_base, "{gain:?}");
    // What was fitted is what the ring's own job takes.
    let mut extended = example["job"].clone();
    extended["effects"] = serde_json::to_value(&result.effects).unwrap();
    let extended = job(&extended);
    let mut violations = Violations::default();
    extended.check(&mut violations);
    assert!(violations.is_empty());
}

#[test]
fn every_cause_is_a_hypothesis_or_says_why_not() {
    let rigid = prepared(&job(&short()), vec![RingRun::default()], "radial_deviation_um");
    let found = RingRoundness::hypotheses(&rigid, &[], &Unwatched).unwrap();
    assert_eq!(found.inapplicable, []);
    for cause in RING_CAUSES {
        assert!(found.applicable.iter().any(|h| h.cause.kind == cause.kind), "{}", cause.kind);
    }
    for hypothesis in &found.applicable {
        let values: Vec<f64> = hypothesis
            .variables
            .iter()
            .map(|v| match &v.treatment {
                Treatment::Amplitude { prior_sd } => 0.3 * prior_sd,
                Treatment::Shape { grid, .. } => grid[0],
                Treatment::Stated { value } => *value,
            })
            .collect();
        let effects = RingRoundness::effects(&rigid, hypothesis, &values).unwrap();
        assert_eq!(effects.iter().map(RingEffect::kind).collect::<Vec<_>>(), [hypothesis.cause.kind]);
    }
    // Waves of the blank share the weight of one cause.
    let waves = found.applicable.iter().filter(|h| h.cause.kind == "initial_harmonic");
    assert!((waves.map(|h| h.prior_weight).sum::<f64>() - 1.0).abs() < 1e-12);

    let mut held = short();
    held["tool"]["spark_out_revolutions"] = json!(0);
    held["tool"]["wheel_radius_mm"] = json!(100.0);
    held["supports"]["roller_radius_mm"] = json!(12.0);
    held["supports"]["distance_mm"] = json!(96.0);
    held["supports"]["depth_mm"] = json!(53.67);
    held["effects"] = json!([
        { "kind": "initial_harmonic", "order": 3, "amplitude_mm": 0.01, "phase_rad": 0.0 },
        { "kind": "work_slip", "slip_deg_per_rev": 0.1 }
    ]);
    let found = RingRoundness::hypotheses(
        &prepared(&job(&held), vec![RingRun::default()], "radial_deviation_um"),
        &[],
        &Unwatched,
    )
    .unwrap();
    let why = |kind: &str| found.inapplicable.iter().find(|h| h.cause.kind == kind).map(|h| h.reason);
    assert_eq!(why("spark_out_missing"), Some(Inapplicability::NothingToActOn));
    assert_eq!(why("tool_push_off"), Some(Inapplicability::NothingToActOn));
    // Of kinds that may recur what acts already is there beside the others.
    let harmonic = |order: u32| RingEffect::InitialHarmonic { order, amplitude_mm: 0.01, phase_rad: 0.0 };
    let chatter = RingEffect::ChatterHarmonic { amplitude_mm: 0.001, waves_per_revolution: 23 };
    let prepared = prepared(&job(&held), vec![RingRun::default()], "radial_deviation_um");
    let acting = [harmonic(3), harmonic(7), chatter];
    let with = RingRoundness::hypotheses(&prepared, &acting, &Unwatched).unwrap();
    let orders = |kind: &str| -> Vec<String> {
        with.applicable.iter().filter(|h| h.cause.kind == kind).map(|h| h.label.clone()).collect()
    };
    assert_eq!(orders("initial_harmonic"), ["order 2", "order 3", "order 4", "order 5", "order 6", "order 7"]);
    assert_eq!(orders("chatter_harmonic"), ["order 23", ""]);
    // Each is what one of them is about, and no other.
    for effect in acting {
        let about = with.applicable.iter().filter_map(|h| Some((h, RingRoundness::values(&prepared, h, &effect)?)));
        let about: Vec<_> = about.collect();
        assert_eq!(about.len(), 1, "{effect:?}");
        let again = RingRoundness::effects(&prepared, about[0].0, &about[0].1).unwrap();
        assert_eq!(again, [effect]);
    }
    // Of a stated roller the ratio is known: about 60 mm over 12 mm, less what is cut off.
    let runout = found.applicable.iter().find(|h| h.cause.kind == "roller_runout").unwrap();
    let Treatment::Shape { grid, .. } = &runout.variables[2].treatment else { panic!("{runout:?}") };
    assert!(grid.len() == 1 && (4.9..5.0).contains(&grid[0]), "{grid:?}");
}

#[test]
fn repeats_share_a_cell_and_blocks_a_fold() {
    let points = all_round(72, 0).chain(all_round(72, 0)).chain([(0, RingPoint { angle_deg: -355.0 })]).collect();
    let rows = Rows { runs: vec![RingRun::default()], points };
    let prepared = RingRoundness::prepare(&job(&short()), &rows, "radial_deviation_um", &Unwatched);
    let Ok(prepared) = prepared else { panic!("refused") };
    let design = RingRoundness::design(&prepared);
    assert_eq!(design.cell[..72], design.cell[72..144]);
    assert_eq!(design.cell[144], design.cell[1]);
    assert_eq!(design.fold[..72], design.fold[72..144]);
    // 30 degrees are six rows; the fifth block is in the first fold again.
    assert_eq!(design.fold[..36].iter().step_by(6).copied().collect::<Vec<_>>(), [0, 1, 2, 3, 0, 1]);
    let Smooth::Around(angles) = design.smooth else { panic!("not round") };
    assert!(angles.iter().all(|angle| (0.0..std::f64::consts::TAU).contains(angle)));
}

/// A run is a ring with settings of its own: the same as a job with those settings.
#[test]
fn a_run_is_a_ring_with_its_own_settings() {
    let longer = RingRun { spark_out_revolutions: Some(2.5), feed_mm_per_rev: Some(0.03), ..RingRun::default() };
    let both = prepared(&job(&short()), vec![RingRun::default(), longer], "radial_deviation_um");
    let mut other = short();
    other["tool"]["spark_out_revolutions"] = json!(2.5);
    other["tool"]["feed_mm_per_rev"] = json!(0.03);
    let effects = [RingEffect::ToolPushOff { push_off_ratio: 0.2 }];
    let together = RingRoundness::predict(&both, &effects, &Unwatched).unwrap();
    let mut apart = Vec::new();
    for alone in [short(), other] {
        let ring = prepared(&job(&alone), vec![RingRun::default()], "radial_deviation_um");
        apart.extend(RingRoundness::predict(&ring, &effects, &Unwatched).unwrap());
    }
    assert_eq!(together, apart);
    let wrong = RingRun { tool_y_mm: Some(-80.0), ..RingRun::default() };
    let rows = Rows { runs: vec![wrong], points: all_round(72, 0).collect() };
    match RingRoundness::prepare(&job(&short()), &rows, "radial_deviation_um", &Unwatched) {
        Err(PrepareError::Invalid(faults)) => assert!(faults.iter().all(|fault| fault.pointer == "/runs/0")),
        _ => panic!("a tool below the ring was accepted"),
    }
}

#[test]
fn next_rings_can_be_turned() {
    let job = job(&short());
    let rows = Rows { runs: vec![RingRun::default()], points: all_round(72, 0).collect() };
    let next = RingRoundness::next_runs(&job, &rows, Ranges(&[]), &Unwatched).unwrap();
    let changes: Vec<&str> = next.iter().map(|run| run.changes).collect();
    assert_eq!(
        changes,
        ["spark_out_revolutions", "spark_out_revolutions", "feed_mm_per_rev", "tool_x_mm", "tool_x_mm"]
    );
    for run in next {
        let points = run.points.into_iter().map(|point| (0, point)).collect();
        let rows = Rows { runs: vec![run.run], points };
        let Ok(ring) = RingRoundness::prepare(&job, &rows, "radial_deviation_um", &Unwatched) else {
            panic!("{} is refused", run.changes)
        };
        let predicted = RingRoundness::predict(&ring, &[], &Unwatched).unwrap();
        assert!(predicted.iter().all(Result::is_ok), "{}", run.changes);
    }
}

/// Radii about an axis that the ring does not share, of a tool set a little deep: no finding.
#[test]
fn size_and_eccentricity_of_measured_radii_are_no_finding() {
    let base = job(&short());
    let ring = prepared(&base, vec![RingRun::default()], "radius_mm");
    let radii = RingRoundness::predict(&ring, &[], &Unwatched).unwrap();
    let mut state = 7_u64;
    let rows: Vec<Value> = (0_u32..72)
        .zip(radii)
        .map(|(i, radius)| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let noise_um = f64::from(u32::try_from(state >> 32).unwrap()) / f64::from(u32::MAX) - 0.5;
            let angle = 5.0 * f64::from(i);
            let axis_mm = 0.03 * angle.to_radians().cos() - 0.02 * angle.to_radians().sin();
            json!({ "angle_deg": angle, "radius_mm": radius.unwrap() + axis_mm - 0.004 + 1e-3 * noise_um })
        })
        .collect();
    let request = json!({
        "calculator": "ring-roundness", "job": short(), "quantity": "radius_mm", "measurements": rows,
        "options": { "held_out": false, "most_causes": 1 }
    });
    let result = answered(&request).unwrap().output;
    assert_eq!(result.verdict, VerdictClass::Adequate, "{:?}", result.sets);
}

#[test]
fn the_papers_algorithm_is_no_model_to_diagnose() {
    let mut sampled = short();
    sampled["method"] = json!("nearest_samples");
    let rows: Vec<Value> =
        (0..36).map(|i| json!({ "angle_deg": 10 * i, "radial_deviation_um": f64::from(i % 3) })).collect();
    let request = json!({
        "calculator": "ring-roundness", "job": sampled, "quantity": "radial_deviation_um", "measurements": rows
    });
    match answered(&request) {
        Err(Failure::OutOfModel(finding)) => assert_eq!(finding.code, "not_with_nearest_samples"),
        other => panic!("{:?}", other.map(|answer| answer.output.verdict)),
    }
}
