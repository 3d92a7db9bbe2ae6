//! How probable a quiet cut is: against a closed form, and against cuts that are drawn as the job states and solved one by one.
//! `PRECUT_CERTAINTY_CUTS` sets how many; the suite takes few.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::f64::consts::{SQRT_2, TAU};

use crate::draw::Draw;
use crate::milling_answers::{example, faults, merged, solve};
use precut_calc::certainty::Source;
use precut_calc::milling_stability::{MillingConformance, Outcome};
use serde_json::{Value, json};

pub(crate) fn conformance(job: &Value) -> MillingConformance {
    solve(job).outcome.conformance.unwrap()
}

fn lognormal(quantity: &str, log_standard_deviation: f64) -> Value {
    json!({ "quantity": quantity, "distribution": { "kind": "lognormal", "log_standard_deviation": log_standard_deviation } })
}

/// The example with other questions.
pub(crate) fn how_sure(patch: &Value) -> Value {
    merged(merged(example("how_sure"), &json!({ "analyses": ["certainty"] })), patch)
}

/// By Box and Muller.
fn normal(draw: &mut Draw) -> f64 {
    (-2.0 * draw.between(1e-12, 1.0).ln()).sqrt() * (TAU * draw.share()).cos()
}

/// The normal distribution function by the series of the error function.
fn below(score: f64) -> f64 {
    let x = score / SQRT_2;
    let (mut term, mut sum) = (x, x);
    for n in 1..200 {
        term *= -x * x / f64::from(n);
        sum += term / f64::from(2 * n + 1);
    }
    0.5 + sum / std::f64::consts::PI.sqrt()
}

/// Of straight teeth and a linear law the limit goes with one over the force.
#[test]
fn a_force_alone_has_a_closed_form() {
    let scatter = 0.2;
    let job = how_sure(&json!({
        "cutter": { "helix_angle_deg": 0 }, "spindle": null,
        "analyses": ["certainty", "intervals"],
        "uncertainty": { "quantities": [lognormal("cutting_force", scatter)], "defaults": false }
    }));
    let limit = solve(&job).outcome.first_limit_mm.unwrap();
    for score in [-1.0, 0.5, 2.0] {
        let job = merged(
            job.clone(),
            &json!({ "cut": { "depth_mm": limit * f64::exp(-scatter * score) }, "analyses": ["certainty"] }),
        );
        let found = conformance(&job);
        // What the job states in percent, as a material by name brings it, is the same.
        let in_percent = json!({ "uncertainty": { "quantities": null, "force_percent": 100.0 * scatter } });
        assert_eq!(conformance(&merged(job.clone(), &in_percent)), found);
        // The place along the line is found to 1e-4 of a standard deviation, the multiplier to that of a map.
        assert!((found.joint.probability - below(score)).abs() < 5e-4, "{score}: {:?}", found.joint);
        assert!((found.contributions[0].share_of_variance.unwrap() - 1.0).abs() < 1e-9);
        // With half of the width the score is twice as large.
        let halved = found.contributions[0].joint_probability_if_halved.unwrap();
        assert!((halved - below(2.0 * score)).abs() < 1e-3, "{score}: {halved}");
        let deep = found.depth_at_wanted_mm.unwrap();
        let exact = limit * f64::exp(-scatter * 1.644_854);
        assert!((deep / exact - 1.0).abs() < 0.01 * scatter + 1e-3, "{deep} {exact}");
    }
}

/// A cut with what a draw makes of it: numbers of the job times factors, nothing uncertain.
fn drawn(job: &Value, draw: &mut Draw) -> Value {
    let mut drawn = job.clone();
    let mut scale = |pointer: &str, factor: f64| {
        let value = drawn.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}"));
        *value = json!(value.as_f64().unwrap() * factor);
    };
    let factor = |draw: &mut Draw, width: f64| (width * normal(draw)).exp();
    for side in ["tool", "work"] {
        let modes = job[side]["modes"].as_array().map_or(0, Vec::len);
        for mode in 0..modes {
            let at = |field: &str| format!("/{side}/modes/{mode}/{field}");
            scale(&at("frequency_hz"), 1.0 + 0.02 * normal(draw));
            scale(&at("stiffness_n_per_mm"), factor(draw, 0.10));
            scale(&at("damping_ratio"), factor(draw, 0.30));
        }
    }
    let force = factor(draw, 0.10);
    for field in ["tangential_n_per_mm2", "radial_n_per_mm2", "axial_n_per_mm2"] {
        if job["force"][field].is_number() {
            scale(&format!("/force/{field}"), force);
        }
    }
    if job["clamping"].is_object() {
        let (clamp, friction) = (factor(draw, 0.15), factor(draw, 0.2));
        scale("/clamping/vise/clamp_force_n", clamp);
        for field in ["low", "value", "high"] {
            scale(&format!("/clamping/vise/friction/{field}"), friction);
        }
    }
    drawn
}

/// Whether everything holds that the verdict asks about, at the likely friction.
pub(crate) fn is_quiet(job: &Value, of: &Outcome) -> bool {
    let grows = of.multiplier.as_ref().is_some_and(|multiplier| multiplier.modulus >= 1.0);
    let overloaded = of.verdict.as_ref().unwrap().drive_margin.is_some_and(|margin| margin < 1.0);
    let most = job["limits"]["amplitude_max_um"].as_f64().unwrap_or(f64::INFINITY);
    let moves = most.is_finite() && of.motion.as_ref().is_none_or(|motion| motion.peak_to_peak_um > most);
    let force = job.pointer("/clamping/vise/clamp_force_n").and_then(Value::as_f64);
    let slips = force.is_some_and(|force| force < of.clamping.as_ref().unwrap().at_likely_friction_n.unwrap());
    !(grows || overloaded || moves || slips)
}

/// Cuts that are drawn as the job says that they may be are quiet as often as told; further depths are asked for where many are drawn.
fn are_quiet_as_often_as_told(job: &Value, analyses: &Value, [depths, further]: [&[f64]; 2], seed: u64) {
    let asked: Option<u32> = std::env::var("PRECUT_CERTAINTY_CUTS").ok().and_then(|count| count.parse().ok());
    let count = asked.unwrap_or(25);
    let further = further.iter().filter(|_| asked.is_some());
    let mut draw = Draw::new(seed);
    for &depth in depths.iter().chain(further) {
        let job = merged(job.clone(), &json!({ "cut": { "depth_mm": depth } }));
        let found = conformance(&job);
        let (told, error) = (found.joint.probability, found.joint.numerical_error);
        let plain = merged(job.clone(), &json!({ "analyses": analyses }));
        let quiet = (0..count).filter(|_| {
            let drawn = drawn(&plain, &mut draw);
            is_quiet(&drawn, &solve(&drawn).outcome)
        });
        let share = quiet.count() as f64 / f64::from(count);
        let limits: Vec<(&str, f64)> = found.limits.iter().map(|of| (&of.limit[..], of.probability)).collect();
        eprintln!(
            "{depth} mm: told {told:.4} +- {error:.4} (linear {:.3}), quiet {share:.4} of {count}; {limits:?}; {} lines",
            found.method.linear_probability, found.method.integrated_lines
        );
        for one in &found.contributions {
            eprintln!("    {} {:?} {:?}", one.quantity, one.share_of_variance, one.joint_probability_if_halved);
        }
        let deviation = (told.max(0.02) * (1.0 - told).max(0.02) / f64::from(count)).sqrt();
        assert!((share - told).abs() < 2.5 * deviation + error, "{depth}: {share}, told {told}");
    }
}

#[test]
fn cuts_of_a_yielding_tool_are_quiet_as_often_as_told() {
    let job = how_sure(&json!({ "uncertainty": null, "spindle": { "power_kw": 0.95 } }));
    are_quiet_as_often_as_told(&job, &json!(["verdict"]), [&[2.5, 3.2], &[3.5]], 11);
}

#[test]
fn cuts_of_tool_and_work_that_move_are_quiet_as_often_as_told() {
    let job = merged(
        example("wall"),
        &json!({
            "analyses": ["certainty"], "spindle": null, "cut": { "width_mm": 2.0 },
            "limits": { "surface_error_max_um": null, "amplitude_max_um": 70.0 }
        }),
    );
    are_quiet_as_often_as_told(&job, &json!(["verdict", "motion"]), [&[1.8], &[2.2]], 12);
}

#[test]
fn clamped_work_is_held_as_often_as_told() {
    let clamping = json!({ "vise": { "clamp_force_n": 1700 }, "stations": [{ "x_mm": 0, "y_mm": 20, "z_mm": 40 }] });
    let job = merged(
        example("clamped"),
        &json!({ "analyses": ["certainty"], "clamping": clamping, "force": { "kind": "mechanistic",
        "tangential_n_per_mm2": 1900, "radial_n_per_mm2": 800, "axial_n_per_mm2": 350 } }),
    );
    are_quiet_as_often_as_told(&job, &json!(["verdict", "clamping"]), [&[1.8, 2.5], &[3.2]], 13);
}

/// What is advised is done: the depth of the wanted probability has it, a half of a width makes of it what was told.
#[test]
fn what_is_told_is_so_when_it_is_done() {
    let job = how_sure(&json!({ "uncertainty": { "quantities": [
        lognormal("tool_mode_damping", 0.3), lognormal("mode_stiffness", 0.2), lognormal("cutting_force", 0.15)
    ], "defaults": false } }));
    let found = conformance(&job);
    let deep = found.depth_at_wanted_mm.unwrap();
    let there = conformance(&merged(job.clone(), &json!({ "cut": { "depth_mm": deep } }))).joint;
    assert!((there.probability - 0.95).abs() < there.numerical_error + 0.003, "{deep} mm: {there:?}");
    assert_eq!(found.contributions.len(), 3);
    let sum: f64 = found.contributions.iter().filter_map(|one| one.share_of_variance).sum();
    assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    for one in &found.contributions {
        assert_eq!(one.source, Source::Stated);
        let mut halved = job.clone();
        for stated in halved["uncertainty"]["quantities"].as_array_mut().unwrap() {
            // `mode_stiffness` is that of the tool here, whose modes alone yield.
            if one.quantity.ends_with(stated["quantity"].as_str().unwrap()) {
                let half = 0.5 * stated["distribution"]["log_standard_deviation"].as_f64().unwrap();
                stated["distribution"]["log_standard_deviation"] = json!(half);
            }
        }
        let then = conformance(&halved).joint;
        let told = one.joint_probability_if_halved.unwrap();
        // Few lines on which both are compared: as a vise's.
        assert!(
            (then.probability - told).abs() < 0.02 + then.numerical_error,
            "{}: {then:?}, told {told}",
            one.quantity
        );
    }
    let told = solve(&merged(job, &json!({ "cut": { "depth_mm": 3.0 } })));
    assert!(told.warns("improbable_cut") && told.says("probably_quiet_cut") && told.says("probably_quiet_depth"));
}

/// The more a quantity scatters the less probable is a cut that is kept by its middle, and nothing uncertain says nothing.
#[test]
fn width_lowers_what_is_kept_and_none_says_nothing() {
    let of = |width: f64| {
        let job = json!({ "cut": { "depth_mm": 1.2 }, "uncertainty": { "quantities": [lognormal("cutting_force", width)], "defaults": false } });
        solve(&how_sure(&merged(job, &json!({ "uncertainty": { "seed": 3 } })))).outcome.conformance
    };
    let kept = |width: f64| of(width).unwrap().joint.probability;
    let (narrow, middle, wide) = (kept(0.05), kept(0.3), kept(0.9));
    assert!(narrow > middle && middle > wide, "{narrow} {middle} {wide}");
    assert!(of(0.0).is_none());
}

/// The modes of a measured side are as uncertain as its fit says.
#[test]
fn measured_modes_bring_their_own_scatter() {
    let job = merged(example("measured"), &json!({ "analyses": ["certainty"], "spindle": null }));
    let found = conformance(&job);
    let source = |quantity: &str| found.contributions.iter().find(|one| one.quantity == quantity).unwrap().source;
    for part in ["frequency", "stiffness", "damping"] {
        assert_eq!(source(&format!("tool_mode_{part}")), Source::Measured);
        assert_eq!(source(&format!("work_mode_{part}")), Source::Default);
    }
}

/// What a diagnosis leaves open of the force counts in place of what is usual: the limit goes with one over a normal factor.
#[test]
fn what_a_model_leaves_open_counts() {
    let (factor, by) = (1.1, 0.1);
    let of = |depth_mm: f64, quantities: &Value, parameter: &str| {
        how_sure(&json!({
            "cutter": { "helix_angle_deg": 0 }, "spindle": null, "analyses": ["certainty", "intervals"],
            "cut": { "depth_mm": depth_mm }, "effects": [{ "kind": "force_coefficient", "factor": factor }],
            "uncertainty": { "quantities": quantities, "defaults": false,
                "effects": [{ "moves": [{ "effect": 1, "parameter": parameter, "by": by }] }] }
        }))
    };
    let limit = solve(&of(1.0, &json!([]), "factor")).outcome.first_limit_mm.unwrap();
    for score in [-1.0, 0.5, 2.0] {
        let found = conformance(&of(limit * factor / (factor + by * score), &json!([]), "factor"));
        // As of a factor that the job states.
        assert!((found.joint.probability - below(score)).abs() < 5e-4, "{score}: {:?}", found.joint);
        let [one] = &found.contributions[..] else { panic!("{:?}", found.contributions) };
        assert_eq!((one.quantity.as_str(), one.source), ("model:force_coefficient/factor", Source::Model));
        let halved = one.joint_probability_if_halved.unwrap();
        assert!((halved - below(2.0 * score)).abs() < 1e-3, "{score}: {halved}");
    }
    let refused = |quantities: &Value, parameter: &str| {
        let codes: Vec<_> = faults(&of(1.0, quantities, parameter)).into_iter().map(|fault| fault.code).collect();
        codes
    };
    assert_eq!(refused(&json!([lognormal("cutting_force", 0.1)]), "factor"), ["duplicate_quantity"]);
    assert_eq!(refused(&json!([]), "nothing"), ["unknown_parameter"]);
}

/// Of one mode a model tells in place of what is usual of this mode alone.
#[test]
fn what_a_model_tells_of_a_mode_is_of_that_mode() {
    let of = |quantities: &Value, modes: &[u32]| {
        let effects: Vec<Value> =
            modes.iter().map(|mode| json!({ "kind": "mode_damping", "mode": mode, "factor": 1.0 })).collect();
        let open: Vec<Value> = (1..=modes.len())
            .map(|effect| json!({ "moves": [{ "effect": effect, "parameter": "factor", "by": 0.1 }] }))
            .collect();
        merged(
            example("two_modes"),
            &json!({ "analyses": ["certainty"], "lobes": null, "cut": { "depth_mm": 0.6 }, "effects": effects,
                "uncertainty": { "quantities": quantities, "effects": open } }),
        )
    };
    let found = conformance(&of(&json!([]), &[1]));
    let names: Vec<&str> = found.contributions.iter().map(|one| one.quantity.as_str()).collect();
    for name in ["model:mode_damping/factor", "tool_mode_damping", "tool_mode_frequency"] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    let stated = json!([lognormal("mode_damping", 0.2)]);
    assert!(faults(&of(&stated, &[1])).is_empty());
    let count =
        ["tool", "work"].iter().map(|side| example("two_modes")[side]["modes"].as_array().map_or(0, Vec::len)).sum();
    let all: Vec<u32> = (1..).take(count).collect();
    let codes: Vec<_> = faults(&of(&stated, &all)).into_iter().map(|fault| fault.code).collect();
    assert_eq!(codes, ["duplicate_quantity"]);
}

#[test]
fn what_cannot_be_is_told_at_once() {
    let normal = |width: &str, value: f64| json!({ "kind": "normal", width: value });
    let job = how_sure(&json!({ "uncertainty": { "quantities": [
        { "quantity": "work_mode_damping", "distribution": normal("standard_uncertainty_percent", 10.0) },
        { "quantity": "mode_frequency", "distribution": normal("standard_uncertainty_um", 3.0) },
        { "quantity": "cutting_force", "distribution": normal("standard_uncertainty_percent", 40.0) },
        { "quantity": "cutting_force", "distribution": normal("standard_uncertainty_percent", 10.0) },
        { "quantity": "clamp_force", "distribution": normal("standard_uncertainty_percent", 10.0) },
        { "quantity": "runout", "distribution": normal("standard_uncertainty_percent", 10.0) }
    ], "correlations": [{ "between": ["cutting_force", "cutting_force"], "coefficient": 0.5 }] } }));
    let told: Vec<String> = faults(&job).into_iter().map(|fault| format!("{} {}", fault.code, fault.pointer)).collect();
    for expected in [
        "quantity_of_nothing /uncertainty/quantities/0/quantity",
        "unit_of_quantity /uncertainty/quantities/1/distribution",
        "normal_reaches_zero /uncertainty/quantities/2/distribution/standard_uncertainty_percent",
        "duplicate_quantity /uncertainty/quantities/3/quantity",
        "quantity_of_nothing /uncertainty/quantities/4/quantity",
        "quantity_of_nothing /uncertainty/quantities/5/quantity",
        "bad_correlation /uncertainty/correlations/0/between",
    ] {
        assert!(told.iter().any(|one| one == expected), "{expected}: {told:?}");
    }
    let pair =
        |one: &str, other: &str, coefficient: f64| json!({ "between": [one, other], "coefficient": coefficient });
    let against = json!({ "uncertainty": { "correlations": [
        pair("mode_frequency", "mode_stiffness", 0.9), pair("mode_stiffness", "cutting_force", 0.9),
        pair("mode_frequency", "cutting_force", -0.9)
    ] } });
    assert!(faults(&how_sure(&against)).iter().any(|fault| fault.code == "correlations_contradict"));
    let nothing = json!({ "tool": { "kind": "rigid" }, "spindle": null, "uncertainty": { "quantities": [] } });
    assert!(faults(&how_sure(&nothing)).iter().any(|fault| fault.code == "certainty_of_nothing"));
}

/// Within a mode quantities go together as stated, from mode to mode they do not: of two modes the same coefficient holds, however
/// large, and there are no shares.
#[test]
fn correlation_stays_within_a_mode() {
    let job = merged(
        example("two_modes"),
        &json!({ "analyses": ["certainty"], "lobes": null, "cut": { "depth_mm": 0.6 },
        "uncertainty": { "quantities": [lognormal("mode_stiffness", 0.1), lognormal("mode_damping", 0.3)], "defaults": false,
            "correlations": [{ "between": ["mode_stiffness", "mode_damping"], "coefficient": -0.9 }] } }),
    );
    assert!(faults(&job).is_empty(), "{:?}", faults(&job));
}
