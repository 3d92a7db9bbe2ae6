//! Effects on machinability models: the exact terms, what a schedule makes of them, and measured examples.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::feed_support;
use crate::feed_support::{near, solve, solved};
use precut_calc::calculator::{Check, ForwardModel, Rows, Unwatched, Violations};
use precut_calc::effects::{MACHINABILITY_CAUSES, MachinabilityEffect};
use precut_calc::feed_schedule::{FeedSchedule, Job, MachinabilityPoint, MachinabilityRun};
use serde_json::{Value, json};

/// 3 V^-0.2 S^0.8 t^0.1 phi^0.3 um, 2000 t S^0.7 N, and wear.
#[allow(clippy::needless_pass_by_value)] // called with `json!`
fn base(effects: Value) -> Value {
    let model = |constant: f64, v: f64, s: f64, t: f64| json!({ "form": "log_log", "constant": constant, "speed_exponent": v, "feed_exponent": s, "depth_exponent": t });
    json!({
        "models": {
            "roughness": { "form": "log_log", "constant": 3.0_f64.ln(), "speed_exponent": -0.2, "feed_exponent": 0.8, "depth_exponent": 0.1, "angle_exponent": 0.3 },
            "force_y": model(2000.0_f64.ln(), 0.0, 0.7, 1.0),
            "hardening": { "form": "semi_log", "constant": 9.0, "speed_exponent": -0.1, "feed_exponent": 0.6 },
            "further": [{ "name": "flank_wear", "unit": "mm", "model": model(0.1_f64.ln(), 0.5, 0.2, 0.1) }],
        },
        "cutting_edge_angle_deg": 75.0,
        "reference": { "speed_m_per_min": 60.0, "feed_mm_per_rev": 0.2, "depth_mm": 0.5, "cutting_edge_angle_deg": 60.0 },
        "conditions": { "flank_wear_mm": 0.3, "batch": "B", "factors": [{ "factor": "coolant", "level": "off" }, { "factor": "shaft", "level": "slender" }], "time_min": 5.0 },
        "effects": effects,
    })
}

fn predicted(job: Value, quantity: &str) -> f64 {
    let job = feed_support::job(job);
    let point: MachinabilityPoint =
        serde_json::from_value(json!({ "speed_m_per_min": 35.0, "feed_mm_per_rev": 0.1, "depth_mm": 1.5 })).unwrap();
    let rows = Rows { runs: vec![MachinabilityRun::default()], points: vec![(0, point)] };
    let prepared = FeedSchedule::prepare(&job, &rows, quantity, &Unwatched).unwrap();
    FeedSchedule::predict(&prepared, &[], &Unwatched).unwrap()[0].unwrap()
}

/// Every effect of the catalogue as its own formula, written out once more.
#[test]
fn every_effect_is_its_formula() {
    let (v, s, t) = ((35.0_f64 / 60.0).ln(), (0.1_f64 / 0.2).ln(), (1.5_f64 / 0.5).ln());
    let phi = (75.0_f64 / 60.0).ln();
    let roughness = predicted(base(json!([])), "roughness_um");
    let force = predicted(base(json!([])), "force_y_n");
    let hardening = predicted(base(json!([])), "hardening_percent");
    near(
        "roughness",
        roughness,
        3.0 * 35.0_f64.powf(-0.2) * 0.1_f64.powf(0.8) * 1.5_f64.powf(0.1) * 75.0_f64.powf(0.3),
        1e-12,
        0.0,
    );
    let ln = |kind: Value, expected: f64| {
        let mut effect = kind;
        effect["output"] = json!("roughness");
        let found = predicted(base(json!([effect])), "roughness_um");
        near(&effect["kind"].to_string(), (found / roughness).ln(), expected, 1e-10, 1e-12);
    };
    ln(json!({ "kind": "level_shift", "delta_ln": 0.1 }), 0.1);
    ln(json!({ "kind": "batch_shift", "batch": "B", "delta_ln": 0.1 }), 0.1);
    ln(json!({ "kind": "batch_shift", "batch": "A", "delta_ln": 0.1 }), 0.0);
    ln(json!({ "kind": "factor_shift", "factor": "coolant", "level": "off", "delta_ln": 0.4 }), 0.4);
    ln(json!({ "kind": "factor_shift", "factor": "coolant", "level": "on", "delta_ln": 0.4 }), 0.0);
    ln(json!({ "kind": "speed_exponent", "delta": 0.1 }), 0.1 * v);
    ln(json!({ "kind": "feed_exponent", "delta": 0.1 }), 0.1 * s);
    ln(json!({ "kind": "depth_exponent", "delta": 0.1 }), 0.1 * t);
    ln(json!({ "kind": "angle_exponent", "delta": 0.1 }), 0.1 * phi);
    ln(json!({ "kind": "speed_exponent", "delta": 0.1, "reference_speed_m_per_min": 35.0 }), 0.0);
    ln(json!({ "kind": "speed_curvature", "coef": 0.1 }), 0.1 * v * v);
    ln(json!({ "kind": "feed_curvature", "coef": 0.1 }), 0.1 * s * s);
    ln(json!({ "kind": "depth_curvature", "coef": 0.1 }), 0.1 * t * t);
    ln(json!({ "kind": "speed_feed_interaction", "coef": 0.1 }), 0.1 * v * s);
    ln(json!({ "kind": "feed_depth_interaction", "coef": 0.1 }), 0.1 * s * t);
    ln(json!({ "kind": "speed_depth_interaction", "coef": 0.1 }), 0.1 * v * t);
    let pair = |level: &str| json!({ "kind": "factor_interaction", "factor_1": "shaft", "level_1": level, "factor_2": "coolant", "level_2": "off", "delta_ln": 0.3 });
    ln(pair("slender"), 0.3);
    ln(pair("stout"), 0.0);
    let hump = 0.3 * (-((35.0_f64 - 30.0) / 18.0).powi(2)).exp();
    ln(json!({ "kind": "built_up_edge", "hump_ln": 0.3, "centre_m_per_min": 30.0, "width_m_per_min": 18.0 }), hump);
    let marks = 1000.0 * 0.1_f64 * 0.1 / (32.0 * 0.8);
    let joined = (roughness.powi(8) + marks.powi(8)).powf(0.125);
    ln(json!({ "kind": "nose_radius_floor", "k": 1.0, "nose_radius_mm": 0.8 }), (joined / roughness).ln());
    ln(json!({ "kind": "wear_multiplicative", "per_mm": 1.0 }), 0.3);
    let added = |kind: Value| predicted(base(json!([kind])), "force_y_n") - force;
    near("offset", added(json!({ "kind": "edge_force_offset", "offset_n": 40.0 })), 40.0, 1e-9, 0.0);
    let worn = json!({ "kind": "wear_force_additive", "n_per_mm": 480.0, "depth_power": 0.25 });
    near("worn", added(worn), 480.0 * 0.3 * 3.0_f64.powf(0.25), 1e-9, 0.0);
    let wear = json!([{ "kind": "wear_in", "wear_in_mm": 0.07, "time_constant_min": 4.0, "rate_mm_per_min": 0.01 }]);
    let expected = 0.07 * (1.0 - (-5.0_f64 / 4.0).exp()) + 0.01 * 5.0;
    near("wear in", predicted(base(wear), "flank_wear"), expected, 1e-10, 0.0);
    // Straight in the logarithms, as an exponent is; twice the half; of two conditions as their interaction is.
    let speeds = [20.0_f64, 35.0, 60.0].map(|at| json!({ "speed_m_per_min": at, "delta_ln": 0.05 * (at / 60.0).ln() }));
    ln(json!({ "kind": "remainder", "scale": 2.0, "profile": speeds }), 0.1 * v);
    let pairs = [0.05_f64, 0.3].map(|feed| {
        [0.5_f64, 2.0].map(|depth| {
            let added = 0.1 * (feed / 0.2).ln() * (depth / 0.5).ln();
            json!({ "feed_mm_per_rev": feed, "depth_mm": depth, "delta_ln": added })
        })
    });
    ln(json!({ "kind": "remainder", "profile": pairs.concat() }), 0.1 * s * t);
    // A formula is its arithmetic, in whatever units.
    let formula = |expression: &str| json!({ "kind": "formula", "expression": expression, "k1": 0.1, "k2": -2.0 });
    ln(formula("k1*ln(speed_m_per_min/60[m/min])*ln(feed_mm_per_rev/200[um])"), 0.1 * v * s);
    ln(formula("k1*(depth_mm/1[mm])^k2 + flank_wear_mm/time_min*1[min/mm]"), 0.1 * 1.5_f64.powi(-2) + 0.3 / 5.0);
    ln(formula("k1*cos(cutting_edge_angle_deg)"), 0.1 * 75.0_f64.to_radians().cos());
    // Beyond its places as at the ends; between places of what is no regime straight in it.
    let shallow = [0.2, 0.5].map(|depth| json!({ "depth_mm": depth, "delta_ln": depth }));
    ln(json!({ "kind": "remainder", "profile": shallow }), 0.5);
    let worn = [0.0, 0.4].map(|wear| json!({ "flank_wear_mm": wear, "delta_ln": 0.2 - wear }));
    ln(json!({ "kind": "remainder", "profile": worn }), -0.1);
    // A semi-log output takes the same terms in its own unit.
    let plain = json!([{ "kind": "speed_exponent", "delta": 0.1, "output": "hardening" }]);
    near("semi-log", predicted(base(plain), "hardening_percent") - hardening, 0.1 * v, 1e-9, 0.0);
}

/// Every cause of the catalogue that has numbers can be made from them.
#[test]
fn every_cause_has_an_effect() {
    for cause in MACHINABILITY_CAUSES {
        let values: Vec<f64> = cause.parameters.iter().map(|p| 0.5 * (p.lower + p.upper)).collect();
        let named = ["batch_shift", "factor_shift", "factor_interaction", "remainder", "formula"].contains(&cause.kind);
        match MachinabilityEffect::from_parameters(cause, &values) {
            Some(effect) => assert_eq!(effect.kind(), cause.kind),
            None => assert!(named, "{}", cause.kind),
        }
    }
}

fn faults(value: Value) -> Vec<(String, String)> {
    let job: Job = serde_json::from_value(value).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec().into_iter().map(|f| (f.code.to_owned(), f.pointer)).collect()
}

#[test]
fn what_an_effect_lacks_is_a_fault() {
    let without = |field: &str, effect: Value| {
        let mut job = base(json!([effect]));
        job.as_object_mut().unwrap().remove(field);
        faults(job)
    };
    let fault = |code: &str, at: &str| vec![(code.to_owned(), at.to_owned())];
    let of = |kind: Value| {
        let mut effect = kind;
        effect["output"] = json!("roughness");
        effect
    };
    for (field, effect, expected) in [
        (
            "conditions",
            of(json!({ "kind": "batch_shift", "batch": "B", "delta_ln": 0.1 })),
            fault("condition_missing", "/conditions/batch"),
        ),
        (
            "conditions",
            of(json!({ "kind": "factor_shift", "factor": "coolant", "level": "off", "delta_ln": 0.4 })),
            fault("condition_missing", "/conditions/factors"),
        ),
        (
            "conditions",
            of(json!({ "kind": "wear_multiplicative", "per_mm": 1.0 })),
            fault("condition_missing", "/conditions/flank_wear_mm"),
        ),
        (
            "conditions",
            json!({ "kind": "wear_in", "wear_in_mm": 0.07, "time_constant_min": 4.0, "rate_mm_per_min": 0.01 }),
            fault("condition_missing", "/conditions/time_min"),
        ),
        (
            "reference",
            of(json!({ "kind": "speed_curvature", "coef": 0.1 })),
            fault("effect_reference_missing", "/effects/0/reference_speed_m_per_min"),
        ),
    ] {
        assert_eq!(without(field, effect.clone()), expected, "{effect}");
        assert_eq!(faults(base(json!([effect]))), vec![]);
    }
    let remainder = |points: Value| of(json!({ "kind": "remainder", "profile": points }));
    let timely = remainder(json!([{ "time_min": 1.0, "delta_ln": 0.1 }, { "time_min": 9.0, "delta_ln": 0.0 }]));
    assert_eq!(without("conditions", timely.clone()), fault("effect_condition_missing", "/conditions/time_min"));
    assert_eq!(faults(base(json!([timely]))), vec![]);
    let at = |speed: f64, depth: f64| json!({ "speed_m_per_min": speed, "depth_mm": depth, "delta_ln": 0.1 });
    for (points, out) in [
        (json!([at(20.0, 0.5), at(20.0, 1.0), at(40.0, 0.5), at(40.0, 1.0)]), None),
        (json!([at(20.0, 0.5), at(20.0, 1.0), at(40.0, 0.5)]), Some(2)),
        (json!([at(20.0, 0.5), at(20.0, 1.0), at(40.0, 0.5), at(40.0, 2.0)]), Some(3)),
        (json!([at(20.0, 0.5), at(20.0, 1.0), at(10.0, 0.5), at(10.0, 1.0)]), Some(2)),
        (json!([at(20.0, 1.0), at(20.0, 0.5)]), Some(1)),
        (json!([{ "speed_m_per_min": 20.0, "delta_ln": 0.1 }, at(40.0, 1.0)]), Some(1)),
        (json!([{ "delta_ln": 0.1 }, { "delta_ln": 0.2 }]), Some(0)),
    ] {
        let expected = out.map(|index| ("remainder_not_a_table".to_owned(), format!("/effects/0/profile/{index}")));
        assert_eq!(faults(base(json!([remainder(points.clone())]))), Vec::from_iter(expected), "{points}");
    }
    let formula = |expression: &str| of(json!({ "kind": "formula", "expression": expression, "k1": 0.1 }));
    let timely = formula("k1*time_min/1[min]");
    assert_eq!(without("conditions", timely.clone()), fault("effect_condition_missing", "/conditions/time_min"));
    assert_eq!(faults(base(json!([timely]))), vec![]);
    for wrong in ["k1*time_min", "k1*ln(depth_mm)", "k1*", "k4", "k1*1[inch]", "k1*force_y"] {
        assert_eq!(
            faults(base(json!([formula(wrong)]))),
            fault("formula_unreadable", "/effects/0/expression"),
            "{wrong}"
        );
    }
    // On which output: said where more than one may be meant.
    assert_eq!(
        faults(base(json!([{ "kind": "level_shift", "delta_ln": 0.1 }]))),
        fault("effect_output_missing", "/effects/0/output")
    );
    assert_eq!(
        faults(base(json!([{ "kind": "edge_force_offset", "offset_n": 40.0, "output": "roughness" }]))),
        fault("effect_output_missing", "/effects/0/output")
    );
    let twice = of(json!({ "kind": "level_shift", "delta_ln": 0.1 }));
    assert_eq!(faults(base(json!([twice, twice]))), fault("duplicate_effect", "/effects/1"));
}

/// One zone with limits on roughness and passive force, speed and feed free.
fn zone(effects: Value) -> Value {
    let mut job = base(effects);
    job["models"].as_object_mut().unwrap().remove("hardening");
    job["zones"] = json!([{ "id": "z1", "z_start_mm": 0.0, "z_end_mm": 100.0, "diameter_mm": 50.0, "depth_mm": 0.5, "roughness_max_um": 1.9 }]);
    job["limits"] = json!({ "feed_min_mm_per_rev": 0.05, "feed_max_mm_per_rev": 0.5, "speed_min_m_per_min": 10.0, "speed_max_m_per_min": 120.0, "force_y_max_n": 330.0 });
    // Fast cutting is limited by a product, so that the speed matters.
    job["custom"] = json!([{ "name": "edge", "speed_exponent": 2.0, "feed_exponent": 1.0, "max": 900.0 }]);
    job
}

/// The best of a fine grid over speed and feed, with the limits written out here.
fn by_grid(roughness: impl Fn(f64, f64) -> f64, force: impl Fn(f64, f64) -> f64) -> f64 {
    let n = 1500;
    let mut best = f64::INFINITY;
    for i in 0..=n {
        let v = 10.0 * 12.0_f64.powf(f64::from(i) / f64::from(n));
        for k in 0..=n {
            let s = 0.05 * 10.0_f64.powf(f64::from(k) / f64::from(n));
            if roughness(v, s) <= 1.9 && force(v, s) <= 330.0 && v * v * s <= 900.0 {
                best = best.min(std::f64::consts::PI * 50.0 * 100.0 / 1000.0 / (v * s));
            }
        }
    }
    best
}

/// Straight, convex and local effects: the answer is the best point of a grid to the grid's step, and says which it is.
type Law = Box<dyn Fn(f64, f64) -> f64>;

#[test]
fn schedules_with_effects_are_the_best_of_a_grid() {
    let own = |v: f64, s: f64| 3.0 * v.powf(-0.2) * s.powf(0.8) * 0.5_f64.powf(0.1) * 75.0_f64.powf(0.3);
    let pull = |_: f64, s: f64| 2000.0 * 0.5 * s.powf(0.7);
    let effect = |kind: &str, rest: Value| {
        let mut effect = rest;
        effect["kind"] = json!(kind);
        effect
    };
    let cases: Vec<(Value, Law, Law, u32, bool)> = vec![
        (
            effect("speed_exponent", json!({ "delta": -0.2, "output": "roughness" })),
            Box::new(move |v, s| own(v, s) * (v / 60.0).powf(-0.2)),
            Box::new(pull),
            0,
            false,
        ),
        (
            effect("feed_curvature", json!({ "coef": 0.3, "output": "roughness" })),
            Box::new(move |v, s| own(v, s) * (0.3 * (s / 0.2_f64).ln().powi(2)).exp()),
            Box::new(pull),
            1,
            false,
        ),
        (
            effect("edge_force_offset", json!({ "offset_n": 60.0 })),
            Box::new(own),
            Box::new(move |v, s| pull(v, s) + 60.0),
            1,
            false,
        ),
        (
            effect("nose_radius_floor", json!({ "k": 1.0, "nose_radius_mm": 0.4 })),
            Box::new(move |v, s| (own(v, s).powi(8) + (1000.0 * s * s / 12.8).powi(8)).powf(0.125)),
            Box::new(pull),
            1,
            false,
        ),
        (
            effect(
                "built_up_edge",
                json!({ "hump_ln": 0.5, "centre_m_per_min": 35.0, "width_m_per_min": 18.0, "output": "roughness" }),
            ),
            Box::new(move |v, s| own(v, s) * (0.5 * (-((v - 35.0) / 18.0).powi(2)).exp()).exp()),
            Box::new(pull),
            1,
            true,
        ),
        // A ridge with an edge, over speed alone.
        (
            effect(
                "remainder",
                json!({ "output": "roughness", "profile": [
                    { "speed_m_per_min": 20.0, "delta_ln": 0.0 }, { "speed_m_per_min": 40.0, "delta_ln": 0.3 },
                    { "speed_m_per_min": 80.0, "delta_ln": 0.0 }] }),
            ),
            Box::new(move |v, s| own(v, s) * (0.3 * (1.0 - (v / 40.0).ln().abs() / 2.0_f64.ln()).max(0.0)).exp()),
            Box::new(pull),
            1,
            true,
        ),
        // The hump above as its user would write it.
        (
            effect(
                "formula",
                json!({ "output": "roughness", "k1": 0.5,
                        "expression": "k1*exp(-((speed_m_per_min - 35[m/min])/18[m/min])^2)" }),
            ),
            Box::new(move |v, s| own(v, s) * (0.5 * (-((v - 35.0) / 18.0).powi(2)).exp()).exp()),
            Box::new(pull),
            1,
            true,
        ),
    ];
    for (effect, roughness, force, linearisations, local) in cases {
        let outcome = solved(zone(json!([effect])));
        let best = by_grid(&roughness, &force);
        // The grid's steps are 0.17 % in speed and 0.15 % in feed: it cannot come closer than their sum, and the schedule
        // may not be worse than it.
        assert!(outcome.objective <= best * (1.0 + 1e-7), "{effect}: {} against {best}", outcome.objective);
        assert!(outcome.objective >= best * (1.0 - 0.0035), "{effect}: {} against {best}", outcome.objective);
        let (v, s) = (outcome.zones[0].speed_m_per_min, outcome.zones[0].feed_mm_per_rev);
        assert!(roughness(v, s) <= 1.9 * (1.0 + 1e-6) && force(v, s) <= 330.0 * (1.0 + 1e-6), "{effect}");
        assert!(outcome.certificate.linearisations >= linearisations, "{effect}: {:?}", outcome.certificate);
        assert_eq!(outcome.certificate.local, local, "{effect}");
    }
}

/// Where a formula has no value there is no schedule, and none is told.
#[test]
fn a_formula_without_a_value_is_no_schedule() {
    let nowhere = json!([{ "kind": "formula", "output": "roughness", "expression": "ln(-feed_mm_per_rev/1[mm])" }]);
    assert!(solve(zone(nowhere)).is_err());
}

/// A hump that leaves no feasible speed is a conflict, not a best effort.
#[test]
fn an_effect_may_make_it_impossible() {
    let mut job = zone(json!([{ "kind": "level_shift", "delta_ln": 2.5, "output": "roughness" }]));
    assert!(matches!(solve(job.clone()), Err(precut_calc::calculator::Failure::Conflicting(_))));
    job["effects"] = json!([]);
    assert!(solve(job).is_ok());
}

fn example(name: &str) -> Value {
    let path =
        std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("tests/reference/diagnosis").join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Residuals ln(measured/predicted) of an example with and without its hidden effects: mean taken out, root mean square.
fn scatter(name: &str, effects: &[MachinabilityEffect]) -> f64 {
    let file = example(name);
    let (model, response) = (&file["job"]["model"], file["job"]["response"].as_str().unwrap());
    let number = |v: &Value| v.as_f64().unwrap();
    let (exponents, at) = (["speed_exponent", "feed_exponent", "depth_exponent"], &model["reference"]);
    let at = ["speed_m_per_min", "feed_mm_per_rev", "depth_mm"].map(|key| number(&at[key]).ln());
    let constant = number(&model["ln_value_at_reference"])
        - exponents.iter().zip(at).map(|(key, ln)| number(&model[*key]) * ln).sum::<f64>();
    let (output, quantity) = match response {
        "Ra" => ("roughness", "roughness_um"),
        "F" => ("force_z", "force_z_n"),
        other => panic!("{other}"),
    };
    let mut record = json!({ "form": "log_log", "constant": constant });
    for key in exponents {
        record[key] = model[key].clone();
    }
    let mut job = json!({ "models": {} });
    job["models"][output] = record;
    let job = feed_support::job(job);
    let rows: Vec<&Value> = file["measurements"].as_array().unwrap().iter().collect();
    let points = rows
        .iter()
        .map(|row| {
            let keys = ["speed_m_per_min", "feed_mm_per_rev", "depth_mm", "flank_wear_mm", "batch"];
            let fields: serde_json::Map<_, _> = keys.iter().map(|key| ((*key).to_owned(), row[key].clone())).collect();
            (0, serde_json::from_value(Value::Object(fields)).unwrap())
        })
        .collect();
    let rows_of = Rows { runs: vec![MachinabilityRun::default()], points };
    let prepared = FeedSchedule::prepare(&job, &rows_of, quantity, &Unwatched).unwrap();
    let predicted = FeedSchedule::predict(&prepared, effects, &Unwatched).unwrap();
    let residuals: Vec<f64> =
        rows.iter().zip(predicted).map(|(row, p)| (number(&row["value"]) / p.unwrap()).ln()).collect();
    let n = residuals.len() as f64;
    let mean = residuals.iter().sum::<f64>() / n;
    (residuals.iter().map(|r| (r - mean) * (r - mean)).sum::<f64>() / (n - 1.0)).sqrt()
}

/// Measured roughness and force against the model: with the hidden effect the scatter is that of the measurement, to the
/// standard error of a standard deviation, 1/sqrt(2 n), thrice.
#[test]
fn measured_examples_scatter_as_they_were_made() {
    for (name, is_enough) in [
        ("example-machinability-adequate.json", true),
        ("example-machinability-built_up_edge.json", true),
        ("example-machinability-chatter_island.json", false),
    ] {
        let file = example(name);
        let sigma = file["answer"]["sigma_ln"].as_f64().unwrap();
        let hidden: Vec<MachinabilityEffect> = file["answer"]["effects"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(|effect| {
                let cause = MACHINABILITY_CAUSES.iter().find(|cause| effect["cause"] == cause.kind)?;
                let values: Vec<f64> =
                    cause.parameters.iter().map(|p| effect["params"][p.name].as_f64().unwrap()).collect();
                MachinabilityEffect::from_parameters(cause, &values)
            })
            .collect();
        let count = file["measurements"].as_array().unwrap().len() as f64;
        let allowed = 3.0 / (2.0 * count).sqrt();
        let with = scatter(name, &hidden);
        if is_enough {
            assert!((with / sigma - 1.0).abs() < allowed, "{name}: {with}, made with {sigma}");
        } else {
            // Nothing in the catalogue stands for it: the rest is larger than the measurement's scatter.
            assert!(hidden.is_empty() && with > sigma * (1.0 + allowed), "{name}: {with} {sigma}");
        }
        if !hidden.is_empty() {
            assert!(scatter(name, &[]) > 1.3 * with, "{name}");
        }
    }
}
