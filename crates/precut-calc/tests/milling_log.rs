//! Logs of cuts: what the model says of a cut, which effects act, and what a diagnosis makes of them.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Calculator, Check, Diagnosable, ForwardModel, Rows, Unwatched, Violations};
use precut_calc::diagnosis::{Diagnosis, DiagnosisResult, VerdictClass};
use precut_calc::effects::{MILLING_CAUSES, MillingEffect};
use precut_calc::milling_stability::{CutMargin, Job, MillingPoint, MillingRun, MillingStability, Outcome};
use precut_trials::{Class, milling};
use serde_json::{Value, json};

type Logs = Diagnosis<MillingStability>;

fn example() -> Value {
    serde_json::from_str(MillingStability::DIAGNOSES[0].job).unwrap()
}

fn parsed(job: &Value) -> Job {
    let mut job: Job = serde_json::from_value(job.clone()).unwrap();
    MillingStability::fill(&mut job);
    job
}

fn faults(request: &Value) -> Vec<(String, String)> {
    let job: <Logs as Calculator>::Input = serde_json::from_value(request.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec().into_iter().map(|fault| (fault.code.to_owned(), fault.pointer)).collect()
}

fn diagnosed(request: &Value) -> DiagnosisResult<MillingEffect, MillingRun> {
    assert_eq!(faults(request), []);
    let mut job: <Logs as Calculator>::Input = serde_json::from_value(request.clone()).unwrap();
    Logs::fill(&mut job);
    Logs::run(&job, &Unwatched).unwrap().output
}

fn solved(job: &Value, analyses: &[&str]) -> Outcome {
    let mut job = job.clone();
    job["analyses"] = json!(analyses);
    MillingStability::run(&parsed(&job), &Unwatched).unwrap().output
}

fn predicted(job: &Value, points: &[MillingPoint], effects: &[MillingEffect]) -> Vec<f64> {
    let rows =
        Rows { runs: vec![MillingRun::default()], points: points.iter().map(|point| (0, *point)).collect::<Vec<_>>() };
    let prepared = MillingStability::prepare(&parsed(job), &rows, "class", &Unwatched);
    let Ok(prepared) = prepared else { panic!("not prepared") };
    let found = MillingStability::predict(&prepared, effects, &Unwatched).unwrap();
    found.into_iter().map(Result::unwrap).collect()
}

fn at(spindle_speed_rpm: f64, depth_mm: f64) -> MillingPoint {
    MillingPoint { spindle_speed_rpm: Some(spindle_speed_rpm), depth_mm: Some(depth_mm), ..MillingPoint::default() }
}

fn limit_mm(job: &Value, spindle_speed_rpm: f64) -> f64 {
    let mut job = job.clone();
    job["cut"]["spindle_speed_rpm"] = json!(spindle_speed_rpm);
    solved(&job, &["intervals"]).first_limit_mm.unwrap()
}

/// Speeds of the example.
fn speeds(request: &Value) -> Vec<f64> {
    let rows = request["measurements"].as_array().unwrap();
    let mut speeds: Vec<f64> = rows.iter().map(|row| row["spindle_speed_rpm"].as_f64().unwrap()).collect();
    speeds.dedup();
    speeds
}

/// At the limit the margin is 0; near it ln of the limit over the depth, up to a term that falls with the square.
#[test]
fn near_the_limit_the_margin_of_a_cut_is_a_share_of_the_depth() {
    let request = example();
    let job = &request["job"];
    for speed in speeds(&request).into_iter().take(3) {
        let limit = limit_mm(job, speed);
        let margins = |shift: f64| predicted(job, &[at(speed, limit * f64::exp(-shift))], &[])[0];
        // The multiplier is that of maps: 2e-5 of the modulus, over a growth of 0.03 and more by the logarithm of the depth.
        assert!(margins(0.0).abs() < 2e-3, "{speed}: {}", margins(0.0));
        for shift in [-0.04, 0.04] {
            assert!((margins(shift) / shift - 1.0).abs() < 0.2, "{speed}: {} for {shift}", margins(shift));
        }
    }
}

/// What an independent cut in time does, the model foresees but for cuts near the limit, and the frequency that it hears is
/// that of a loud line of the model but where two modes chatter nearly alike.
#[test]
fn cuts_in_time_go_as_the_model_says() {
    let (mut clear, mut right, mut heard, mut near) = (0, 0, 0, 0);
    for seed in 0..6 {
        let request = milling::draw_log(Class::Nothing, 0.0, seed).request;
        let rows = request["measurements"].as_array().unwrap();
        let point = |row: &Value, margin: CutMargin| MillingPoint {
            margin,
            frequency_hz: row["frequency_hz"].as_f64(),
            ..at(row["spindle_speed_rpm"].as_f64().unwrap(), row["depth_mm"].as_f64().unwrap())
        };
        let all: Vec<MillingPoint> = rows.iter().map(|row| point(row, CutMargin::Chatter)).collect();
        for (row, margin) in rows.iter().zip(predicted(&request["job"], &all, &[])) {
            // Three times the largest scatter of a draw.
            if margin.abs() > 0.18 {
                clear += 1;
                right += i32::from((margin > 0.0) == (row["class"] == "stable"));
            }
        }
        let of_sound: Vec<MillingPoint> = rows
            .iter()
            .filter(|row| row["frequency_hz"].is_number())
            .map(|row| point(row, CutMargin::Frequency))
            .collect();
        let off = predicted(&request["job"], &of_sound, &[]);
        heard += off.len();
        // Scatter of 0.6 %, lines 2.3 Hz apart, and growth that moves the frequency between two depths.
        near += off.iter().filter(|off| off.abs() < 0.03).count();
    }
    assert!(clear > 40 && right * 100 >= clear * 97, "{right} of {clear}");
    assert!(heard > 20 && near * 100 >= heard * 90, "{near} of {heard}");
}

#[test]
fn an_effect_is_the_job_with_another_number() {
    let mut base = example()["job"].clone();
    base["cutter"]["radial_offset_um"] = json!([0.0, 0.0, 0.0]);
    let mode = base["tool"]["modes"][1].clone();
    let number = |pointer: &str| base.pointer(pointer).unwrap().as_f64().unwrap();
    let (hz, kg) = (mode["frequency_hz"].as_f64().unwrap(), mode["mass_kg"].as_f64().unwrap());
    let ratio = mode["damping_ratio"].as_f64().unwrap();
    let cases: Vec<(Value, Vec<(&str, Value)>)> = vec![
        (
            json!({ "kind": "mode_frequency", "mode": 2, "factor": 1.25 }),
            vec![("/tool/modes/1/frequency_hz", json!(1.25 * hz)), ("/tool/modes/1/mass_kg", json!(kg / 1.5625))],
        ),
        (
            json!({ "kind": "mode_damping", "mode": 2, "factor": 1.25 }),
            vec![("/tool/modes/1/damping_ratio", json!(1.25 * ratio))],
        ),
        (
            json!({ "kind": "mode_stiffness", "mode": 2, "factor": 1.25 }),
            vec![("/tool/modes/1/mass_kg", json!(1.25 * kg))],
        ),
        (
            json!({ "kind": "force_coefficient", "factor": 1.25 }),
            vec![
                ("/force/tangential_n_per_mm2", json!(1.25 * number("/force/tangential_n_per_mm2"))),
                ("/force/radial_n_per_mm2", json!(1.25 * number("/force/radial_n_per_mm2"))),
            ],
        ),
        (
            json!({ "kind": "radial_ratio", "factor": 1.25 }),
            vec![("/force/radial_n_per_mm2", json!(1.25 * number("/force/radial_n_per_mm2")))],
        ),
        (
            json!({ "kind": "tooth_runout", "runout_mm": 0.0625 }),
            vec![("/cutter/radial_offset_um", json!([62.5, 0.0, 0.0]))],
        ),
        (
            json!({ "kind": "process_damping", "coefficient_n_per_mm": 64.0 }),
            vec![("/process_damping", json!({ "coefficient_n_per_mm": 64.0, "source": "measured" }))],
        ),
    ];
    let without = solved(&base, &["verdict"]).multiplier.unwrap().modulus;
    for (effect, pointers) in cases {
        let mut under = base.clone();
        under["effects"] = json!([effect]);
        let mut stated = base.clone();
        for (pointer, value) in pointers {
            match stated.pointer_mut(pointer) {
                Some(field) => *field = value,
                None => stated[pointer.trim_start_matches('/')] = value,
            }
        }
        let [by_effect, by_number] = [&under, &stated].map(|job| solved(job, &["verdict"]).multiplier.unwrap().modulus);
        // The same arithmetic but for the last digits of a product.
        assert!((by_effect / by_number - 1.0).abs() < 1e-9, "{effect}: {by_effect} {by_number}");
        assert!((by_effect / without - 1.0).abs() > 1e-6, "{effect} changes nothing");
    }
}

#[test]
fn every_cause_of_the_catalogue_stands_where_its_effect_says() {
    for cause in MILLING_CAUSES {
        let values: Vec<f64> = cause.parameters.iter().map(|parameter| parameter.upper.min(2.0)).collect();
        let effect = MillingEffect::from_parameters(cause, &values).unwrap();
        assert_eq!((effect.kind(), effect.cause().equation), (cause.kind, cause.equation));
    }
}

#[test]
fn faults_of_effects_and_rows_are_named_at_their_places() {
    let mut request = example();
    request["job"]["effects"] = json!([
        { "kind": "mode_damping", "mode": 3, "factor": 1.2 }, { "kind": "mode_damping", "mode": 2, "factor": 1.2 },
        { "kind": "mode_damping", "mode": 3, "factor": 1.1 }
    ]);
    let found =
        |request: &Value| faults(request).into_iter().map(|(code, at)| format!("{code} {at}")).collect::<Vec<_>>();
    assert_eq!(found(&request), ["duplicate_effect /job/effects/2/kind"]);
    request["job"]["effects"] = json!([{ "kind": "mode_stiffness", "mode": 4, "factor": 1.2 }]);
    assert_eq!(found(&request), ["effect_without_mode /job/effects/0/mode"]);
    request["job"]["effects"] = json!([]);
    let rows = request["measurements"].as_array().unwrap();
    let stable = rows.iter().position(|row| row["class"] == "stable").unwrap();
    request["measurements"][stable]["frequency_hz"] = json!(900.0);
    assert_eq!(found(&request), [format!("frequency_of_stable_cut /measurements/{stable}/frequency_hz")]);
    request["measurements"][stable].as_object_mut().unwrap().remove("frequency_hz");
    request["measurements"][stable]["width_mm"] = json!(2.0);
    assert_eq!(found(&request), [] as [&str; 0]);
    let cut = request["job"]["cut"].as_object_mut().unwrap();
    cut.remove("width_mm");
    cut.remove("milling");
    cut.insert("entry_deg".to_owned(), json!(120.0));
    cut.insert("exit_deg".to_owned(), json!(180.0));
    assert_eq!(found(&request), [format!("width_beside_angles /measurements/{stable}/width_mm")]);
}

/// Where teeth are in cut half as long a cut chatters deeper.
#[test]
fn a_row_may_have_a_width_of_its_own() {
    let request = example();
    let (job, speed) = (&request["job"], speeds(&request)[2]);
    let own = job["cut"]["width_mm"].as_f64().unwrap();
    let of_width = |width_mm: f64| MillingPoint { width_mm: Some(width_mm), ..at(speed, 2.0) };
    let margins = predicted(job, &[at(speed, 2.0), of_width(own), of_width(0.4 * own)], &[]);
    assert!((margins[0] - margins[1]).abs() < 1e-12, "{margins:?}");
    let mut narrow = job.clone();
    narrow["cut"]["width_mm"] = json!(0.4 * own);
    let stated = predicted(&narrow, &[at(speed, 2.0)], &[])[0];
    assert!((margins[2] - stated).abs() < 1e-12 && (margins[2] - margins[0]).abs() > 0.05, "{margins:?} {stated}");
}

/// ln of the factor that the example hides in the frequency of the first mode.
const HIDDEN: f64 = -0.1209;

#[test]
fn the_slow_mode_of_the_example_is_named_and_the_limit_runs_within_its_band() {
    let request = example();
    let result = diagnosed(&request);
    assert_eq!(result.verdict, VerdictClass::Named, "{:?}", result.named);
    let [named] = result.named.as_slice() else { panic!("{:?}", result.named) };
    assert_eq!((named.kind.as_str(), named.label.as_str()), ("mode_frequency", "mode 1"));
    let [low, high] = named.parameters[1].interval_95.unwrap();
    assert!(low < HIDDEN && HIDDEN < high && high - low < 0.05, "{low} to {high}");
    let classes = result.classes.unwrap();
    assert!(classes.share_right_extended > 0.85 && classes.share_right_base < 0.75);
    let held_out = classes.held_out.unwrap();
    assert_eq!(held_out.folds, 4);
    assert!(held_out.gain_interval_95[0] > 0.0, "{held_out:?}");
    // One entry for a class, one more for a frequency.
    let sounds = classes.margin.iter().filter(|margin| *margin == "frequency").count();
    assert_eq!(classes.margin.len(), request["measurements"].as_array().unwrap().len() + sounds);
    let noted = request["measurements"].as_array().unwrap().iter().filter(|row| row["frequency_hz"].is_number());
    assert!(sounds > 0 && sounds == noted.count());
    // The true limit lies within the 95 % band at nine speeds of ten.
    let mut truth = request["job"].clone();
    truth["effects"] = json!([{ "kind": "mode_frequency", "mode": 1, "factor": HIDDEN.exp() }]);
    let band = &classes.limit_band[0];
    let told = (0..band.spindle_speed_rpm.len()).step_by(4).filter_map(|k| {
        let (low, high) = (band.low_mm[k]?, band.high_mm[k]?);
        let limit = limit_mm(&truth, band.spindle_speed_rpm[k]);
        // Limits of the band are those of maps, found to a share of 1e-4 between coarse steps.
        Some(0.99 * low < limit && limit < 1.01 * high)
    });
    let (inside, all) = told.fold((0, 0), |(inside, all), within| (inside + i32::from(within), all + 1));
    assert!(all >= 7 && 10 * inside >= 8 * all, "{inside} of {all}");
    // With what was found the log is foreseen.
    let mut known = request.clone();
    known["job"]["effects"] = serde_json::to_value(&result.effects).unwrap();
    known["options"] = json!({ "held_out": false });
    assert_eq!(diagnosed(&known).verdict, VerdictClass::Adequate);
}

/// The cut that is advised, made as the model of the truth makes it, makes the truth more probable than it was, and than cuts anywhere in
/// the range of the log make it on average.
#[test]
fn the_next_cut_that_is_advised_speaks_for_the_truth() {
    let mut request = example();
    // A few cuts of the log without their frequencies, and some causes: what is wrong is not clear yet.
    let rows: Vec<Value> = request["measurements"].as_array().unwrap().iter().skip(1).step_by(3).cloned().collect();
    let without = |row: &Value| {
        let mut row = row.clone();
        row.as_object_mut().unwrap().remove("frequency_hz");
        row
    };
    let rows: Vec<Value> = rows.iter().map(without).collect();
    request["measurements"] = json!(rows);
    let causes = ["mode_frequency", "force_coefficient", "mode_damping"];
    request["options"] = json!({ "held_out": false, "most_causes": 1, "causes": causes });
    let before = diagnosed(&request);
    let Some(next) = &before.next_measurement else { panic!("{:?} {:?}", before.verdict, before.sets) };
    let mut truth = request["job"].clone();
    truth["effects"] = json!([{ "kind": "mode_frequency", "mode": 1, "factor": HIDDEN.exp() }]);
    let probability = |result: &DiagnosisResult<MillingEffect, MillingRun>| {
        let is_truth = |causes: &[precut_calc::diagnosis::NamedCause]| {
            causes.len() == 1 && causes[0].kind == "mode_frequency" && causes[0].label == "mode 1"
        };
        result.sets.iter().filter(|set| is_truth(&set.causes)).map(|set| set.posterior).sum::<f64>()
    };
    // Four cuts, as the model of the truth makes them.
    let cut = |speed: f64, depth: f64| {
        let class = if predicted(&truth, &[at(speed, depth)], &[])[0] > 0.0 { "stable" } else { "chatter" };
        let row = json!({ "spindle_speed_rpm": speed, "depth_mm": depth, "class": class });
        let mut with = request.clone();
        with["measurements"].as_array_mut().unwrap().extend(vec![row; 4]);
        probability(&diagnosed(&with))
    };
    let (run, before) = (&next.run, probability(&before));
    let advised = cut(run.spindle_speed_rpm.unwrap(), run.depth_mm.unwrap());
    assert!(next.candidates.len() >= 6 && advised > before + 0.05, "{advised} {before}");
    let numbers = |field: &str| rows.iter().map(|row| row[field].as_f64().unwrap()).collect::<Vec<f64>>();
    let place = |field: &str, share: f64| {
        let (low, high) =
            numbers(field).into_iter().fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
        low * (high / low).powf(share)
    };
    let anywhere = [(0.13, 0.6), (0.37, 0.2), (0.61, 0.8), (0.87, 0.4)];
    let on_average =
        anywhere.map(|(n, h)| cut(place("spindle_speed_rpm", n), place("depth_mm", h))).iter().sum::<f64>() / 4.0;
    assert!(advised > on_average, "{advised} {on_average}");
}
