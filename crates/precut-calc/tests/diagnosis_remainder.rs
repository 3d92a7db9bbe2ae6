//! What has no name as a term of the extended model: stored, known again, and taken out of the next path.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use precut_calc::calculator::{Calculator, Check, ForwardModel, Rows, Unwatched, Violations};
use precut_calc::deflection_compensation::{DeflectionCompensation, DeflectionPoint, DeflectionRun, Job};
use precut_calc::diagnosis::{Diagnosis, ExtensionKind, ResultOf, VerdictClass, residuals_with};
use precut_calc::effects::DeflectionEffect;
use precut_trials::score::Share;
use precut_trials::{Class, deflection};
use serde_json::{Value, json};

use crate::blind_trials::{job, number, seed_of};
use crate::diagnosis_worth::measured;
use crate::support::prepared;

type Model = DeflectionCompensation;

const SNR: f64 = 5.0;

fn diagnosed(request: &Value, options: Value) -> ResultOf<Model> {
    Diagnosis::<Model>::run(&job::<Model>(request, options), &Unwatched).unwrap().output
}

/// The request under a model that was stored: its effects, and what is not known of them.
fn under(request: &Value, found: &ResultOf<Model>) -> Value {
    let mut request = request.clone();
    request["job"]["effects"] = serde_json::to_value(&found.effects).unwrap();
    request["effects_uncertainty"] = serde_json::to_value(&found.effects_uncertainty).unwrap();
    // A job that holds wear or warmth states where they begin; every run has its own.
    request["job"]["conditions"] = json!({ "tool_path_at_start_m": 0.0, "warm_time_at_start_min": 0.0 });
    request
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Largest less smallest deviation of the shaft that the machine of the draw turns along the path of the calculator.
fn form_error_um(seed: u64, request: &Value, effects: &[DeflectionEffect]) -> f64 {
    let mut wanted = request["job"].clone();
    wanted["path"] = json!({ "chord_tolerance_um": 0.1, "increment_um": 0.1 });
    wanted["stations"] = json!({ "kind": "per_zone", "count": 129 });
    wanted["detail"] = json!("full");
    wanted["effects"] = serde_json::to_value(effects).unwrap();
    wanted["conditions"] = json!({ "tool_path_at_start_m": 0.0, "warm_time_at_start_min": 0.0 });
    let job: Job = prepared(wanted);
    let path = Model::run(&job, &Unwatched).unwrap().output.path.unwrap();
    let corners: Vec<(f64, f64)> = path
        .zones
        .iter()
        .flat_map(|zone| zone.z_mm.iter().copied().zip(zone.commanded_diameter_mm.iter().copied()))
        .collect();
    // Also between the corners.
    let share = |k: u32| f64::from(k) / 8.0;
    let along = corners.windows(2).flat_map(|pair| {
        let [(z, d), (next_z, next_d)] = [pair[0], pair[1]];
        (0..8).map(move |k| (z + share(k) * (next_z - z), d + share(k) * (next_d - d)))
    });
    // Where nothing was measured nothing is known.
    let [from, to] = [0.03, 0.97].map(|share| share * job.shaft.length_mm());
    let looked_at: Vec<(f64, f64)> = along.filter(|(z, _)| (from..=to).contains(z)).collect();
    let turned = deflection::turned_um(Class::Outside, SNR, seed, &looked_at);
    let ends = turned.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), d| (low.min(*d), high.max(*d)));
    ends.1 - ends.0
}

/// What no catalogue holds is hidden by a generator that shares no code with the calculators. Where the answer leaves a term for
/// it, the term is tried: on rows of a later shift, which know it again under the stored model, and on a shaft that is turned
/// along the path that takes it out.
#[test]
fn a_remainder_is_stored_known_again_and_compensated() {
    let (seed, count) = (number("PRECUT_TRIAL_SEED", 40), number("PRECUT_TRIALS", 10));
    let [mut predicts, mut recognised, mut quiet, mut straighter] = [Share::default(); 4];
    let (mut unknown, mut of_form, mut covered) = (0, Vec::new(), Share::default());
    for own in (0..count).map(|k| seed_of(seed, k)) {
        let trial = deflection::draw(Class::Outside, SNR, own);
        let found = diagnosed(&trial.request, json!({}));
        unknown += u64::from(found.verdict == VerdictClass::Unknown);
        if found.extension != ExtensionKind::Remainder {
            continue;
        }
        let last = found.effects.last().unwrap();
        let DeflectionEffect::Remainder { scale, profile, .. } = last else { panic!("{last:?}") };
        assert!((scale - 1.0).abs() < 1e-12 && profile.len() >= 9);
        assert!(profile.windows(2).all(|pair| pair[1].z_mm > pair[0].z_mm));
        assert!(found.gain.as_ref().unwrap().gain_interval_95[0] > 0.0);
        let later = trial.later.as_ref().unwrap();
        let plain = job::<Model>(&later.request, json!({ "held_out": false }));
        let [before, after] =
            [&[][..], &found.effects].map(|effects| rms(&residuals_with::<Model>(&plain, effects).unwrap()));
        predicts.add(after < before);
        let again = diagnosed(&under(&later.request, &found), json!({ "held_out": false }));
        // A soft spot goes with the force: an error of the machine is only the nearest term to it.
        let is_error = trial.truth.causes[0].kind != "soft_spot";
        if is_error {
            recognised.add(again.recognised.is_some());
            quiet.add(again.verdict == VerdictClass::Adequate);
        }
        let [before, after] = [&[][..], &found.effects].map(|effects| form_error_um(own, &trial.request, effects));
        straighter.add(after < before);
        of_form.push(after / before);
        // What was promised of the next shaft, against what came.
        if let Some(told) = found.downstream.iter().find(|told| told.outcome == "form_error_um") {
            covered.add(told.extended.mean < told.base.mean);
        }
        println!(
            "{:<12} later {:?} recognised {:?} form {before:.1} to {after:.1} um",
            trial.truth.causes[0].kind,
            again.verdict,
            again.recognised.as_ref().map(|own| (own.error_without, own.error_with))
        );
    }
    of_form.sort_by(f64::total_cmp);
    println!(
        "{count} draws from seed {seed}: {unknown} unknown, {} with a term; later rows predicted better {predicts}, recognised \
         {recognised}, adequate {quiet}, straighter {straighter} (median {:?} of the form), promised so {covered}",
        of_form.len(),
        of_form.get(of_form.len() / 2)
    );
    // Waves, steps and curves that are the same in all runs are four of the five that are hidden; soft spots go with the force.
    assert!(2 * of_form.len() as u64 >= count, "{}", of_form.len());
    assert!(predicts.reaches(0.97) && recognised.reaches(0.95), "{predicts} {recognised}");
    assert!(quiet.reaches(0.80) && straighter.reaches(0.95), "{quiet} {straighter}");
}

/// The example's shaft on a guideway with one and a half waves, in two sweeps of every run.
fn guideway() -> Value {
    measured(2, 7, |_, place, _, _| 9.0 * (1.5 * std::f64::consts::TAU * place).sin())
}

#[test]
fn a_term_says_where_it_is_known_and_how_surely() {
    let found = diagnosed(&guideway(), json!({}));
    assert_eq!((found.verdict, found.extension), (VerdictClass::Unknown, ExtensionKind::Remainder));
    let remainder = found.remainder.as_ref().unwrap();
    let [between] = &remainder.known_between[..] else { panic!("{:?}", remainder.known_between) };
    let Some(DeflectionEffect::Remainder { profile, .. }) = found.effects.last() else { panic!("{:?}", found.effects) };
    assert_eq!((between.field.as_str(), between.unit.as_str()), ("z_mm", "mm"));
    assert!((profile[0].z_mm - between.from).abs() < 1e-9 && (profile.last().unwrap().z_mm - between.to).abs() < 1e-9);
    // What is open of a place of the profile is what is open of the rows there, on the radius.
    let place = profile.len() / 2;
    let name = format!("profile/{place}/error_um");
    let open = found.effects_uncertainty.iter().flat_map(|entry| &entry.moves).filter(|own| own.parameter == name);
    let deviation = open.map(|own| own.by * own.by).sum::<f64>().sqrt();
    let rows: Vec<Value> = serde_json::from_value(guideway()["measurements"].clone()).unwrap();
    let nearest = (0..rows.len())
        .min_by(|&a, &b| {
            let gap = |row: usize| (rows[row]["z_mm"].as_f64().unwrap() - profile[place].z_mm).abs();
            gap(a).total_cmp(&gap(b))
        })
        .unwrap();
    let of_row = remainder.standard_deviation[nearest];
    assert!((0.35..0.8).contains(&(deviation / of_row)), "{deviation} {of_row}");
    // The extended model predicts the rows within its band.
    let rows = &found.rows;
    let left = rows.measured.iter().zip(&rows.extended).zip(&rows.extended_deviation);
    let far = left.filter(|((y, f), sd)| (*y - f.unwrap()).abs() > 3.0 * sd.unwrap()).count();
    assert!(far <= rows.row.len() / 50, "{far}");
}

#[test]
fn a_stored_term_is_known_again_and_told_where_it_changed() {
    let found = diagnosed(&guideway(), json!({}));
    let request = under(&guideway(), &found);
    let again = diagnosed(&request, json!({ "held_out": false }));
    assert_eq!(again.verdict, VerdictClass::Adequate, "{:?}", again.named);
    let recognised = again.recognised.as_ref().unwrap();
    assert!(recognised.error_with < 0.6 * recognised.error_without && recognised.sigmas > 10.0, "{recognised:?}");
    // Held with half its size it is named as what it was, and takes its own place.
    let mut half = request.clone();
    let index = found.effects.len() - 1;
    half["job"]["effects"][index]["scale"] = json!(0.5);
    half["job"]["effects"][index]["name"] = json!("guideway of lathe 7");
    let changed = diagnosed(&half, json!({ "held_out": false }));
    assert_eq!(changed.verdict, VerdictClass::Named, "{:?}", changed.likely_sets);
    let [named] = &changed.named[..] else { panic!("{:?}", changed.named) };
    let scale = &named.parameters[0];
    assert_eq!((named.kind.as_str(), named.label.as_str()), ("remainder", "guideway of lathe 7"));
    assert_eq!(scale.was, Some(0.5));
    assert!((scale.value - 1.0).abs() < 0.15, "{scale:?}");
    let Some(DeflectionEffect::Remainder { name, scale, profile }) = changed.effects.last() else { panic!() };
    let Some(DeflectionEffect::Remainder { profile: before, .. }) = found.effects.last() else { panic!() };
    assert!((scale - named.parameters[0].value).abs() < 1e-12);
    assert_eq!((profile, name.as_str()), (before, "guideway of lathe 7"));
    // Where it is not held there is nothing by which to know it.
    let fresh = diagnosed(&guideway(), json!({ "held_out": false }));
    assert!(fresh.recognised.is_none() && fresh.not_applicable.iter().any(|own| own.kind == "remainder"));
}

/// A remainder that is the straight line of a taper is a tailstock off the axis.
#[test]
fn a_remainder_acts_as_the_error_that_it_describes() {
    let base: Job = prepared(guideway()["job"].clone());
    let length_mm = base.shaft.length_mm();
    let points = (0..=40).map(|k| (0, DeflectionPoint { z_mm: length_mm * f64::from(k) / 40.0 })).collect();
    let rows = Rows { runs: vec![DeflectionRun::default()], points };
    let model = Model::prepare(&base, &rows, "diameter_deviation_um", &Unwatched).ok().unwrap();
    let with = |effect: Value| -> Vec<f64> {
        let effect: DeflectionEffect = serde_json::from_value(effect).unwrap();
        Model::predict(&model, &[effect], &Unwatched).unwrap().into_iter().map(Result::unwrap).collect()
    };
    let point = |share: f64, error_um: f64| json!({ "z_mm": share * length_mm, "error_um": error_um });
    let taper = with(json!({ "kind": "tailstock_offset", "offset_um": 12.0 }));
    let line = with(json!({ "kind": "remainder", "profile": [point(0.0, 0.0), point(0.25, 3.0), point(1.0, 12.0)] }));
    let twice = with(json!({ "kind": "remainder", "scale": 2.0, "profile": [point(0.0, 0.0), point(1.0, 6.0)] }));
    // Beyond its ends it stays as it is there.
    let short = with(json!({ "kind": "remainder", "profile": [point(0.5, 6.0), point(0.75, 9.0)] }));
    for (row, taper) in taper.iter().enumerate() {
        assert!((line[row] - taper).abs() < 1e-9 && (twice[row] - taper).abs() < 1e-9, "{row}");
    }
    assert!((20..=30).all(|row| (short[row] - taper[row]).abs() < 1e-9));
    let offset = |size: f64| with(json!({ "kind": "size_offset", "offset_um": size }));
    assert!((short[0] - offset(6.0)[0]).abs() < 1e-9 && (short[40] - offset(9.0)[40]).abs() < 1e-9);
}

#[test]
fn places_of_a_remainder_ascend() {
    let mut wanted = guideway()["job"].clone();
    wanted["effects"] = json!([{ "kind": "remainder", "profile": [
        { "z_mm": 10.0, "error_um": 0.0 }, { "z_mm": 10.0, "error_um": 4.0 }] }]);
    let job: Job = serde_json::from_value(wanted).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    let found: Vec<(&str, String)> = violations.into_vec().into_iter().map(|one| (one.code, one.pointer)).collect();
    assert_eq!(found, [("stations_not_ascending", "/effects/0/profile/1/z_mm".to_owned())]);
}

/// The wave of the guideway written down by its user: its height is found as any size is, stored, known again, and taken out
/// of the path of a later job as the same wave by a profile of places would be.
#[test]
fn a_formula_of_the_user_is_fitted_stored_and_taken_out() {
    let mut request = guideway();
    // One and a half waves over 570 mm.
    request["job"]["effects"] = json!([{ "kind": "formula", "name": "ways of lathe 7", "k1_deviation": 8.0,
        "expression": "k1*1[um]*sin(z_mm/60.479[mm])" }]);
    let found = diagnosed(&request, json!({}));
    assert_eq!(found.verdict, VerdictClass::Named, "{:?}", found.likely_sets);
    let [named] = &found.named[..] else { panic!("{:?}", found.named) };
    assert_eq!((named.kind.as_str(), named.label.as_str()), ("formula", "ways of lathe 7"));
    let size = &named.parameters[0];
    assert_eq!((size.name.as_str(), size.was), ("k1", Some(0.0)));
    // 9 um on the diameter; a gap that opens by e lightens the cut, which closes it by some hundredths of e.
    assert!((4.4..4.9).contains(&size.value), "{size:?}");
    assert!(found.gain.as_ref().unwrap().gain_interval_95[0] > 0.0);
    let Some(DeflectionEffect::Formula { k1, .. }) = found.effects.last() else { panic!("{:?}", found.effects) };
    assert!((k1 - size.value).abs() < 1e-12);
    let open = found.effects_uncertainty.iter().flat_map(|entry| &entry.moves);
    assert!(open.map(|own| own.parameter.as_str()).eq(["k1"]));
    let again = diagnosed(&under(&request, &found), json!({ "held_out": false }));
    assert_eq!(again.verdict, VerdictClass::Adequate, "{:?}", again.named);
    // Without a number to be fitted there is nothing to be found of it.
    let mut fixed = request.clone();
    fixed["job"]["effects"][0]["k1_deviation"] = json!(0.0);
    let fixed = diagnosed(&fixed, json!({ "held_out": false }));
    assert!(fixed.not_applicable.iter().any(|own| own.kind == "formula"));
    // The path that is driven with it leaves what was promised of it.
    let promised = found.downstream.iter().find(|told| told.outcome == "form_error_um").unwrap();
    assert!(promised.extended.interval_95[1] < promised.base.interval_95[0], "{promised:?}");
}
