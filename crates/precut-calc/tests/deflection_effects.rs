//! Every effect of the deflection model against the equation of the catalogue, written down again here
//! for a uniform shaft between centres and solved by bisection.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::f64::consts::PI;

use crate::support::prepared;
use precut_calc::calculator::{Calculator, Check, Failure, ForwardModel, Prediction, Rows, Unwatched, Violations};
use precut_calc::deflection_compensation::{
    DeflectionCompensation, DeflectionPoint, DeflectionRun, Detail, FeedDirection, Job,
};
use precut_calc::effects::{DEFLECTION_CAUSES, DeflectionEffect, Fit};
use serde_json::{Value, json};

const L: f64 = 660.0;
const D: f64 = 40.0;
const E: f64 = 210_000.0;
const W_H: f64 = 1.2e-5;
const W_T: f64 = 4.7e-5;
const W_C: f64 = 3.1e-5;
const C_P: f64 = 447.0;
const X: f64 = 0.9;
const P: f64 = 0.6;
const N: f64 = -0.15;

/// A run of the independent model.
#[derive(Clone, Copy)]
struct Run {
    depth: f64,
    feed: f64,
    speed: f64,
    to_headstock: bool,
    path_at_start: f64,
    warm_at_start: f64,
}

const RUN: Run =
    Run { depth: 0.8, feed: 0.2, speed: 60.0, to_headstock: true, path_at_start: 500.0, warm_at_start: 4.0 };

/// The catalogue's equations: changes of C, F and e at a station.
#[derive(Default)]
struct Change {
    compliance: Option<Box<dyn Fn(f64) -> f64>>,
    bending: Option<f64>,
    factor: Option<Box<dyn Fn(f64, f64) -> f64>>,
    added_n: f64,
    error_mm: Option<Box<dyn Fn(f64) -> f64>>,
}

fn flexural() -> f64 {
    E * PI * D.powi(4) / 64.0
}

/// Diameter deviation, um: y = C F(t - y - e), bisection on the engaged depth.
fn deviation_um(run: &Run, change: &Change, z: f64) -> f64 {
    let u = z / L;
    let bend = z * z * (L - z).powi(2) / (3.0 * flexural() * L) * (1.0 + change.bending.unwrap_or(0.0));
    let mut c = bend + (1.0 - u).powi(2) * W_H + u * u * W_T + W_C;
    c += change.compliance.as_ref().map_or(0.0, |f| f(z));
    let e = change.error_mm.as_ref().map_or(0.0, |f| f(z));
    let force = |t: f64| {
        let base = C_P * t.powf(X) * run.feed.powf(P) * run.speed.powf(N);
        base * change.factor.as_ref().map_or(1.0, |f| f(z, t)) + change.added_n
    };
    let (mut low, mut high) = (0.0, 2.0 * run.depth);
    for _ in 0..200 {
        let t = 0.5 * (low + high);
        if t + c * force(t) + e < run.depth { low = t } else { high = t }
    }
    2.0 * (run.depth - 0.5 * (low + high)) * 1e3
}

fn job(effects: &Value) -> Job {
    prepared(json!({
        "shaft": { "segments": [{ "length_mm": L, "diameter_mm": D, "stock_diameter_mm": D + 2.0 }], "youngs_modulus_n_per_mm2": E },
        "supports": [
            { "kind": "centre", "z_mm": 0.0, "compliance_um_per_n": 1e3 * W_H },
            { "kind": "centre", "z_mm": L, "compliance_um_per_n": 1e3 * W_T }
        ],
        "carriage": { "compliance_um_per_n": 1e3 * W_C },
        "force": { "kind": "power_law", "passive": { "coefficient": C_P, "depth_exponent": X, "feed_exponent": P, "speed_exponent": N } },
        "cut": { "feed_mm_per_rev": 0.3, "speed_m_per_min": 100.0 },
        "effects": effects,
        "conditions": { "tool_path_at_start_m": 0.0, "warm_time_at_start_min": 0.0 }
    }))
}

fn as_run(run: &Run) -> DeflectionRun {
    DeflectionRun {
        depth_mm: Some(run.depth),
        feed_mm_per_rev: Some(run.feed),
        speed_m_per_min: Some(run.speed),
        feed_direction: Some(if run.to_headstock { FeedDirection::ToHeadstock } else { FeedDirection::ToTailstock }),
        tool_path_at_start_m: Some(run.path_at_start),
        warm_time_at_start_min: Some(run.warm_at_start),
        ..DeflectionRun::default()
    }
}

fn stations() -> Vec<f64> {
    // Not in order, to see that rows keep theirs.
    vec![600.0, 20.0, 330.0, 150.0, 480.0]
}

fn predict(job: &Job, runs: &[Run], effects: &[DeflectionEffect]) -> Vec<Prediction> {
    let points =
        (0..runs.len()).flat_map(|k| stations().into_iter().map(move |z_mm| (k, DeflectionPoint { z_mm }))).collect();
    let rows = Rows { runs: runs.iter().map(as_run).collect(), points };
    let prepared = DeflectionCompensation::prepare(job, &rows, "diameter_deviation_um", &Unwatched).unwrap();
    DeflectionCompensation::predict(&prepared, effects, &Unwatched).unwrap()
}

/// The effect as parameter and as part of the base job, in both feed directions, against the equation.
fn check(effect: &Value, change: &dyn Fn(&Run) -> Change) {
    let typed: DeflectionEffect = serde_json::from_value(effect.clone()).unwrap();
    let other = Run { to_headstock: false, depth: 0.3, feed: 0.35, speed: 130.0, ..RUN };
    let runs = [RUN, other];
    let as_parameter = predict(&job(&json!([])), &runs, &[typed]);
    let as_base = predict(&job(&json!([effect])), &runs, &[]);
    assert_eq!(as_parameter, as_base, "{effect}");
    let base = predict(&job(&json!([])), &runs, &[]);
    let mut moved = false;
    for (k, run) in runs.iter().enumerate() {
        for (i, z) in stations().into_iter().enumerate() {
            let row = k * stations().len() + i;
            let expected = deviation_um(run, &change(run), z);
            let found = as_parameter[row].unwrap();
            // Both solve to a few units in the last place of 40 mm: 1e-11 um each; a margin of a hundred.
            assert!((found - expected).abs() < 1e-8, "{effect}: run {k}, z {z}: {found} instead of {expected}");
            moved |= (found - base[row].unwrap()).abs() > 1e-3;
        }
    }
    assert!(moved, "{effect} moves nothing");
}

fn compliance(f: impl Fn(f64) -> f64 + 'static) -> Change {
    Change { compliance: Some(Box::new(f)), ..Change::default() }
}

fn factor(f: impl Fn(f64, f64) -> f64 + 'static) -> Change {
    Change { factor: Some(Box::new(f)), ..Change::default() }
}

fn error_um(f: impl Fn(f64) -> f64 + 'static) -> Change {
    Change { error_mm: Some(Box::new(move |z| f(z) * 1e-3)), ..Change::default() }
}

/// Way of the tool in this cut before z, mm.
fn way(run: &Run, z: f64) -> f64 {
    if run.to_headstock { L - z } else { z }
}

fn path_m(run: &Run, z: f64) -> f64 {
    PI * D * way(run, z) / (1000.0 * run.feed)
}

#[test]
fn the_base_is_the_closed_form() {
    let job = job(&json!([]));
    let found = predict(&job, &[RUN], &[]);
    for (z, value) in stations().into_iter().zip(found) {
        assert!((value.unwrap() - deviation_um(&RUN, &Change::default(), z)).abs() < 1e-8);
    }
}

#[test]
fn compliances_add_to_the_machine() {
    check(&json!({ "kind": "headstock_compliance", "delta_um_per_n": 0.022 }), &|_| {
        compliance(|z| 2.2e-5 * (1.0 - z / L).powi(2))
    });
    check(&json!({ "kind": "tailstock_compliance", "delta_um_per_n": 0.01 }), &|_| {
        compliance(|z| 1e-5 * (z / L).powi(2))
    });
    check(&json!({ "kind": "tailstock_compliance", "delta_um_per_n": -0.03 }), &|_| {
        compliance(|z| -3e-5 * (z / L).powi(2))
    });
    check(&json!({ "kind": "carriage_compliance", "delta_um_per_n": 0.01 }), &|_| compliance(|_| 1e-5));
    check(&json!({ "kind": "bending_scale", "delta": 0.12 }), &|_| Change { bending: Some(0.12), ..Change::default() });
}

#[test]
fn a_headstock_that_clamps_is_the_force_method_with_a_chuck() {
    let k = 2.4e6;
    check(&json!({ "kind": "chuck_rotational_stiffness", "ktheta_n_mm_per_rad": k }), &|_| {
        compliance(move |z| {
            let u = z / L;
            let theta = z * (L - z) * (2.0 * L - z) / (6.0 * flexural() * L) + (u * W_T - (1.0 - u) * W_H) / L;
            -theta * theta / (1.0 / k + L / (3.0 * flexural()) + (W_H + W_T) / (L * L))
        })
    });
}

#[test]
fn the_uncut_side_bends_with_the_blank() {
    check(&json!({ "kind": "uncut_side_stiffness" }), &|run| {
        let run = *run;
        compliance(move |z| {
            let stock = E * PI * (D + 2.0 * run.depth).powi(4) / 64.0;
            let u = z / L;
            let (left, right) = if run.to_headstock { (stock, flexural()) } else { (flexural(), stock) };
            L.powi(3) / 3.0 * (u * (1.0 - u)).powi(2) * (u / left + (1.0 - u) / right - 1.0 / flexural())
        })
    });
}

#[test]
fn forces_are_scaled_and_added_to() {
    check(&json!({ "kind": "force_level", "delta": -0.1 }), &|_| factor(|_, _| 0.9));
    check(&json!({ "kind": "depth_exponent", "delta": 0.05, "reference_depth_mm": 1.5 }), &|_| {
        factor(|_, t| (t / 1.5_f64).powf(0.05))
    });
    check(&json!({ "kind": "feed_exponent", "delta": 0.05, "reference_feed_mm_per_rev": 0.3 }), &|run| {
        let feed = run.feed;
        factor(move |_, _| (feed / 0.3).powf(0.05))
    });
    check(&json!({ "kind": "speed_exponent", "delta": -0.1, "reference_speed_m_per_min": 100.0 }), &|run| {
        let speed = run.speed;
        factor(move |_, _| (speed / 100.0).powf(-0.1))
    });
    check(&json!({ "kind": "hardness_gradient", "gradient": 0.2 }), &|_| factor(|z, _| 1.0 + 0.2 * (z / L - 0.5)));
    check(
        &json!({ "kind": "built_up_edge", "drop": 0.2, "centre_m_per_min": 38.0, "width_m_per_min": 18.0 }),
        &|run| {
            let speed = run.speed;
            factor(move |_, _| 1.0 - 0.2 * (-((speed - 38.0) / 18.0).powi(2)).exp())
        },
    );
    check(&json!({ "kind": "ploughing_force", "force_n": 20.0 }), &|_| Change { added_n: 20.0, ..Change::default() });
}

#[test]
fn errors_open_the_gap() {
    check(&json!({ "kind": "tailstock_offset", "offset_um": 5.0 }), &|_| error_um(|z| 5.0 * z / L));
    check(&json!({ "kind": "guideway_bow", "bow_um": 4.0 }), &|_| error_um(|z| 16.0 * z / L * (1.0 - z / L)));
    check(&json!({ "kind": "size_offset", "offset_um": -5.0 }), &|_| error_um(|_| -5.0));
    check(&json!({ "kind": "reversal_backlash", "backlash_um": 4.0 }), &|run| {
        let sign = if run.to_headstock { 1.0 } else { -1.0 };
        error_um(move |_| sign * 2.0)
    });
    check(&json!({ "kind": "tool_wear", "rate_um_per_km": 3.2, "wear_in_um": 1.0 }), &|run| {
        let run = *run;
        error_um(move |z| {
            let s = run.path_at_start + path_m(&run, z);
            1.0 - (-s / 400.0).exp() + 3.2 * s / 1000.0
        })
    });
    check(&json!({ "kind": "thermal_growth", "growth_um": 9.0, "time_constant_min": 7.5 }), &|run| {
        let run = *run;
        error_um(move |z| {
            let tau = run.warm_at_start + path_m(&run, z) / run.speed;
            -9.0 * (1.0 - (-tau / 7.5).exp())
        })
    });
    check(&json!({ "kind": "workpiece_heating", "temperature_rise_k": 6.0, "time_constant_min": 6.0 }), &|run| {
        let run = *run;
        error_um(move |z| {
            let tau = path_m(&run, z) / run.speed;
            -D / 2.0 * 11.5e-6 * 6.0 * (1.0 - (-tau / 6.0).exp()) * 1e3
        })
    });
}

/// A formula of the user is its arithmetic over where, when and how the tool passes, in whatever units.
#[test]
fn a_formula_is_its_arithmetic() {
    check(&json!({ "kind": "formula", "expression": "k1*1[um]*sin(z_mm/40[mm])", "k1": 5.0 }), &|_| {
        error_um(|z| 5.0 * (z / 40.0).sin())
    });
    let all = "k1*1[um]*ln(diameter_mm/0.02[m])*(depth_mm/500[um])^k2 + feed_mm_per_rev/100 - \
               k3*0.001[mm]*speed_m_per_min/1[m/s] + 2[um]*tool_path_m/1[km] + 0.3[um/min]*max(warm_time_min, 1[min])";
    check(&json!({ "kind": "formula", "expression": all, "k1": 2.0, "k2": 0.7, "k3": 0.5 }), &|run| {
        let run = *run;
        error_um(move |z| {
            let path = run.path_at_start + path_m(&run, z);
            let warm = run.warm_at_start + path_m(&run, z) / run.speed;
            2.0 * 2.0_f64.ln() * (run.depth / 0.5).powf(0.7) + 1e3 * run.feed / 100.0 - 0.5 * run.speed / 60.0
                + 2.0 * path / 1000.0
                + 0.3 * warm.max(1.0)
        })
    });
}

fn faults(effects: &Value, conditions: &Value) -> Vec<(&'static str, String)> {
    let mut job = job(&json!([]));
    job.effects = serde_json::from_value(effects.clone()).unwrap();
    job.conditions = serde_json::from_value(conditions.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec().into_iter().map(|fault| (fault.code, fault.pointer)).collect()
}

#[test]
fn a_formula_that_cannot_act_is_a_fault() {
    let of = |expression: &str| json!([{ "kind": "formula", "expression": expression, "k1": 1.0 }]);
    for wrong in ["k1*z_mm/1[mm]", "k1", "k1*1[N]", "k4*1[um]", "k1*", "k1*1[um]*sin(z_mm)", "k1*1[inch]", "force_y"] {
        let found = faults(&of(wrong), &json!({}));
        assert_eq!(found, [("formula_unreadable", "/effects/0/expression".to_owned())], "{wrong}");
    }
    for (condition, expression) in [
        ("tool_path_at_start_m", "k1*1[um]*tool_path_m/1[km]"),
        ("warm_time_at_start_min", "k1*1[um]*warm_time_min/1[min]"),
    ] {
        let missing = ("condition_missing", format!("/conditions/{condition}"));
        assert_eq!(faults(&of(expression), &json!({})), [missing]);
        assert_eq!(faults(&of(expression), &json!({ condition: 0.0 })), []);
    }
    // Two of them have two names, or say two things.
    let two = |one: &str, other: &str, expression: &str| {
        json!([{ "kind": "formula", "name": one, "expression": "1[um]" },
               { "kind": "formula", "name": other, "expression": expression }])
    };
    assert_eq!(faults(&two("a", "b", "1[um]"), &json!({})), []);
    assert_eq!(faults(&two("", "", "2[um]"), &json!({})), []);
    assert_eq!(faults(&two("a", "a", "2[um]"), &json!({})), [("duplicate_effect", "/effects/1/kind".to_owned())]);
}

/// Where a formula has no value nothing is predicted and no path is told; what the refusal says to do is done.
#[test]
fn a_formula_without_a_value_is_no_answer() {
    let root =
        |inside: &str| json!([{ "kind": "formula", "name": "root", "expression": format!("4[um]*sqrt({inside})") }]);
    let of = |inside: &str| job(&root(inside));
    let short = of("z_mm/300[mm] - 1");
    let found = predict(&short, &[RUN], &[]);
    for (z, found) in stations().into_iter().zip(found) {
        assert_eq!(found.is_ok(), z >= 300.0, "{z}: {found:?}");
    }
    let refused = DeflectionCompensation::run(&short, &Unwatched);
    let Err(Failure::OutOfModel(finding)) = refused else { panic!() };
    assert_eq!(finding.code, "formula_without_value");
    assert!(DeflectionCompensation::run(&of("max(z_mm - 300[mm], 0[mm])/300[mm]"), &Unwatched).is_ok());
    let far = job(&json!([{ "kind": "formula", "expression": "20[mm]*z_mm/660[mm]" }]));
    assert!(matches!(DeflectionCompensation::run(&far, &Unwatched), Err(Failure::OutOfModel(_))));
}

/// The path that is compensated with a formula, cut by the equations of this file: what the formula says is taken out of the shaft.
#[test]
fn a_path_takes_out_what_a_formula_says() {
    let effects = json!([{ "kind": "formula", "k1": 6.0, "k2": 5.0,
        "expression": "k1*1[um]*sin(z_mm/60[mm]) - k2*1[um]*(1 - exp(-tool_path_m/200[m]))" }]);
    let left_um = |effects: &Value| -> Vec<f64> {
        let mut job = job(effects);
        job.detail = Detail::Full;
        job.path = serde_json::from_value(json!({ "chord_tolerance_um": 0.1, "increment_um": 0.1 })).unwrap();
        job.stations = serde_json::from_value(json!({ "kind": "per_zone", "count": 129 })).unwrap();
        let path = DeflectionCompensation::run(&job, &Unwatched).unwrap().output.path.unwrap();
        let corners = path.zones.iter().flat_map(|zone| zone.z_mm.iter().zip(&zone.commanded_diameter_mm));
        let corners: Vec<(f64, f64)> = corners.map(|(z, d)| (*z, *d)).collect();
        let share = |k: u32| f64::from(k) / 8.0;
        let places = corners.windows(2).flat_map(|pair| {
            let [(z, d), (next_z, next_d)] = [pair[0], pair[1]];
            (0..8).map(move |k| (z + share(k) * (next_z - z), d + share(k) * (next_d - d)))
        });
        let left = |(z, commanded): (f64, f64)| {
            let depth = 0.5 * (D + 2.0 - commanded);
            let run =
                Run { depth, feed: 0.3, speed: 100.0, to_headstock: true, path_at_start: 0.0, warm_at_start: 0.0 };
            let error = error_um(move |z| 6.0 * (z / 60.0).sin() - 5.0 * (1.0 - (-path_m(&run, z) / 200.0).exp()));
            commanded - D + 1e-3 * deviation_um(&run, &error, z)
        };
        places.map(|place| 1e3 * left(place)).collect()
    };
    let form_um = |left: &[f64]| {
        left.iter().copied().fold(f64::NEG_INFINITY, f64::max) - left.iter().copied().fold(f64::INFINITY, f64::min)
    };
    let [with, without] = [&effects, &json!([])].map(|effects| form_um(&left_um(effects)));
    // The moves miss the path by 0.1 um on the radius, rounding takes half of that.
    assert!(with < 0.7 && without > 20.0, "{with} {without}");
}

#[test]
fn a_displaced_rest_bends_the_shaft() {
    // Rigid centres: the shape under a force at z_s, phi = G(z, z_s)/G(z_s, z_s) of a simple beam.
    let z_s = 300.0;
    let base = |effects: Value| {
        let mut job = job(&json!([]));
        job.effects = serde_json::from_value(effects).unwrap();
        let rest = json!([
            { "kind": "centre", "z_mm": 0.0 },
            { "kind": "steady_rest", "z_mm": z_s, "compliance_um_per_n": 0.02 },
            { "kind": "centre", "z_mm": L }
        ]);
        job.supports = serde_json::from_value(rest).unwrap();
        job
    };
    let effect = json!({ "kind": "steady_rest_offset", "station_mm": z_s, "offset_um": 8.0 });
    // A force that does not depend on the depth leaves e as it is.
    let constant = |mut job: Job| {
        job.force = serde_json::from_value(json!({ "kind": "constant", "passive_n": 100.0 })).unwrap();
        job
    };
    let with = predict(&constant(base(json!([effect]))), &[RUN], &[]);
    let without = predict(&constant(base(json!([]))), &[RUN], &[]);
    let green = |z: f64, a: f64| {
        let (z, a) = if z <= a { (z, a) } else { (L - z, L - a) };
        let b = L - a;
        b * z * (L * L - b * b - z * z) / (6.0 * flexural() * L)
    };
    for (i, z) in stations().into_iter().enumerate() {
        let phi = green(z, z_s) / green(z_s, z_s);
        let found = with[i].unwrap() - without[i].unwrap();
        assert!((found - 2.0 * 8.0 * phi).abs() < 1e-7, "z {z}: {found} instead of {}", 16.0 * phi);
    }
}

#[test]
fn the_catalogue_and_the_effect_objects_agree() {
    // The shape of a remainder and the text of a formula are no numbers.
    let has_text = |kind: &str| ["remainder", "formula"].contains(&kind);
    for (i, cause) in DEFLECTION_CAUSES.iter().enumerate().filter(|(_, cause)| !has_text(cause.kind)) {
        let values: Vec<f64> = cause
            .parameters
            .iter()
            .map(|p| match p.fit {
                Fit::Amplitude => 0.5 * p.prior_sd,
                Fit::Factor => 1.0 + 0.5 * p.prior_sd,
                Fit::Shape { grid } => grid.first().copied().unwrap_or(1e6),
                Fit::Fixed { default } => default,
                Fit::OfJob => 100.0,
            })
            .collect();
        let effect = DeflectionEffect::from_parameters(cause, &values).unwrap_or_else(|| panic!("{}", cause.kind));
        assert_eq!(effect.cause(), cause, "entry {i}");
        let object = serde_json::to_value(&effect).unwrap();
        assert_eq!(object["kind"], cause.kind);
        assert_eq!(object.as_object().unwrap().len(), 1 + cause.parameters.len(), "{object}");
        for (parameter, value) in cause.parameters.iter().zip(&values) {
            assert_eq!(object[parameter.name], json!(value), "{}: {}", cause.kind, parameter.name);
        }
        for other in cause.confounded_with {
            assert!(DEFLECTION_CAUSES.iter().any(|c| c.kind == *other), "{}: {other}", cause.kind);
        }
    }
}

#[test]
fn divided_differences_follow_the_prediction() {
    let job = job(&json!([]));
    let points = stations().into_iter().map(|z_mm| (0, DeflectionPoint { z_mm })).collect();
    let rows = Rows { runs: vec![as_run(&RUN)], points };
    let prepared = DeflectionCompensation::prepare(&job, &rows, "diameter_deviation_um", &Unwatched).unwrap();
    let cause = |kind: &str| DEFLECTION_CAUSES.iter().find(|c| c.kind == kind).unwrap();
    let at = [(cause("size_offset"), vec![0.0]), (cause("force_level"), vec![0.0])];
    let columns = DeflectionCompensation::jacobian(&prepared, &at, &[(0, 0), (1, 0)]).unwrap();
    for (i, z) in stations().into_iter().enumerate() {
        // Closed form: e opens the gap, the cut gets lighter: 2/(1 + C F').
        let step = 1e-4;
        let by_offset = (deviation_um(&RUN, &error_um(move |_| step), z)
            - deviation_um(&RUN, &error_um(move |_| -step), z))
            / (2.0 * step);
        assert!((columns[0][i] - by_offset).abs() < 1e-6, "{} {by_offset}", columns[0][i]);
        let by_level = (deviation_um(&RUN, &factor(move |_, _| 1.0 + step), z)
            - deviation_um(&RUN, &factor(move |_, _| 1.0 - step), z))
            / (2.0 * step);
        assert!((columns[1][i] - by_level).abs() < 1e-5 * by_level.abs(), "{} {by_level}", columns[1][i]);
    }
}

#[test]
fn a_run_cut_along_a_corrected_path_is_measured_against_the_drawing() {
    let job = job(&json!([]));
    let run = DeflectionRun {
        commanded_path: serde_json::from_value(
            json!([{ "z_mm": 0.0, "diameter_mm": D - 0.1 }, { "z_mm": L, "diameter_mm": D - 0.1 }]),
        )
        .unwrap(),
        ..as_run(&RUN)
    };
    let points = stations().into_iter().map(|z_mm| (0, DeflectionPoint { z_mm })).collect();
    let rows = Rows { runs: vec![run], points };
    let prepared = DeflectionCompensation::prepare(&job, &rows, "diameter_deviation_um", &Unwatched).unwrap();
    let found = DeflectionCompensation::predict(&prepared, &[], &Unwatched).unwrap();
    for (z, value) in stations().into_iter().zip(found) {
        // t = t_c and deviation 2 (y + e) - 2 (t_c - a): the same cut with 0.05 mm more depth.
        let deeper = Run { depth: RUN.depth + 0.05, ..RUN };
        let expected = deviation_um(&deeper, &Change::default(), z) - 100.0;
        assert!((value.unwrap() - expected).abs() < 1e-8);
    }
}
