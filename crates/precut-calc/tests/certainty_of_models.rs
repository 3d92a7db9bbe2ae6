//! What a diagnosis leaves open of effects, in the probability of good parts: against parts that are really cut with effects drawn
//! from it.
//!
//! `PRECUT_CERTAINTY` sets how many parts are drawn.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::deflection_uncertainty::cut_with;
use crate::draw::Draw;
use crate::fixture_support::{checked, outcome, with};
use crate::milling_answers::{merged, solve};
use crate::milling_certainty::{conformance as of_cut, how_sure, is_quiet as is_quiet_cut};
use crate::ring_support;
use crate::support::solved;
use precut_calc::fixture_stability::multiplier_modulus;
use serde_json::{Value, json};

/// A standard normal number.
fn normal(draw: &mut Draw) -> f64 {
    let share = draw.share().clamp(1e-10, 1.0 - 1e-10);
    -std::f64::consts::SQRT_2 * statrs::function::erf::erfc_inv(2.0 * share)
}

fn drawn(in_the_suite: usize) -> usize {
    std::env::var("PRECUT_CERTAINTY").ok().and_then(|text| text.parse().ok()).unwrap_or(in_the_suite)
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {value}"))
}

/// A move of a parameter at one standard deviation of its direction.
fn by(effect: u32, parameter: &str, by: f64) -> Value {
    json!({ "effect": effect, "parameter": parameter, "by": by })
}

/// Directions, each of some moves.
fn open(directions: &[&[Value]]) -> Value {
    directions.iter().map(|moves| json!({ "moves": moves })).collect()
}

/// A shaft between centres with effects and what is not known of them.
fn shaft(effects: &Value, open: &Value, tolerance: &Value) -> Value {
    json!({
        "shaft": { "segments": [{ "length_mm": 600, "diameter_mm": 40, "stock_diameter_mm": 41 }],
                   "youngs_modulus_n_per_mm2": 210_000.0 },
        "supports": [{ "kind": "centre", "z_mm": 0, "compliance_um_per_n": 0.03 },
                     { "kind": "centre", "z_mm": 600, "compliance_um_per_n": 0.06 }],
        "carriage": { "compliance_um_per_n": 0.02 },
        "force": { "kind": "power_law", "passive": { "coefficient": 1500, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": 0.0 } },
        "cut": { "feed_mm_per_rev": 0.2, "speed_m_per_min": 120 },
        "stations": { "kind": "per_zone", "count": 21 },
        "path": { "chord_tolerance_um": 0.0, "increment_um": 0.001 },
        "tolerance": tolerance,
        "effects": effects,
        "uncertainty": { "effects": open }
    })
}

/// The effects where the directions come to these scores.
fn off(effects: &Value, open: &Value, scores: &[f64]) -> Value {
    let mut effects = effects.clone();
    for (entry, score) in open.as_array().unwrap().iter().zip(scores) {
        for own in entry["moves"].as_array().unwrap() {
            let place = number(own, "/effect") - 1.0;
            let field = effects.pointer_mut(&format!("/{place}/{}", own["parameter"].as_str().unwrap())).unwrap();
            *field = (field.as_f64().unwrap() + score * number(own, "/by")).into();
        }
    }
    effects
}

/// Shafts that are cut along the commands of an answer, with effects drawn from what is not known of them: told and found.
fn of_the_posterior(job: &Value, [lower, upper]: [f64; 2], seed: u64) -> (f64, f64, f64) {
    let answer = serde_json::to_value(solved(job.clone())).unwrap();
    let numbers = |name: &str| -> Vec<f64> {
        answer["stations"][name].as_array().unwrap().iter().map(|one| one.as_f64().unwrap()).collect()
    };
    let (z, commands) = (numbers("z_mm"), numbers("commanded_diameter_mm"));
    let commands: Vec<Option<f64>> = commands.into_iter().map(Some).collect();
    let (effects, open) = (&job["effects"], &job["uncertainty"]["effects"]);
    let mut plain = job.clone();
    plain.as_object_mut().unwrap().remove("uncertainty");
    plain.as_object_mut().unwrap().remove("tolerance");
    let (count, mut draw) = (drawn(400), Draw::new(seed));
    let is_good = |draw: &mut Draw| {
        let scores: Vec<f64> = open.as_array().unwrap().iter().map(|_| normal(draw)).collect();
        plain["effects"] = off(effects, open, &scores);
        cut_with(&plain, &z, &commands).iter().all(|error| (lower..=upper).contains(error))
    };
    let mut is_good = is_good;
    let good = (0..count).filter(|_| is_good(&mut draw)).count();
    let told = number(&answer, "/conformance/joint/probability");
    (told, good as f64 / count as f64, (told * (1.0 - told) / count as f64).sqrt())
}

#[test]
fn shafts_of_a_posterior_are_good_as_often_as_said() {
    let effects = json!([
        { "kind": "headstock_compliance", "delta_um_per_n": 0.03 },
        { "kind": "force_level", "delta": 0.1 },
        { "kind": "size_offset", "offset_um": 1.5 }
    ]);
    // A headstock that is softer goes with a force that is smaller, as rows along a shaft leave it open.
    let open = open(&[
        &[by(1, "delta_um_per_n", 0.012), by(2, "delta", -0.07)],
        &[by(2, "delta", 0.06)],
        &[by(3, "offset_um", 1.0)],
    ]);
    for ends in [[-6.0, 6.0], [-10.0, 10.0], [-4.0, 9.0], [-16.0, 16.0]] {
        let tolerance = json!({ "diameter_lower_um": ends[0], "diameter_upper_um": ends[1] });
        let mut job = shaft(&effects, &open, &tolerance);
        // The tool stays as it stands: how it is set the next time is not drawn here.
        job["uncertainty"]["defaults"] = json!(false);
        let (told, found, deviation) = of_the_posterior(&job, ends, 17);
        eprintln!("{ends:?}: told {told:.4}, found {found:.4} +- {deviation:.4}");
        assert!(told > 0.05 && told < 0.995, "{told}");
        assert!((found - told).abs() < 3.0 * deviation + 0.005, "{ends:?}: told {told}, found {found}");
    }
}

/// What has no name is a list of places, which is one quantity; the shaft is looked at in its corners, too.
#[test]
fn shafts_of_a_profile_are_good_as_often_as_said() {
    let point = |z_mm: f64, error_um: f64| json!({ "z_mm": z_mm, "error_um": error_um });
    let effects = json!([
        { "kind": "size_offset", "offset_um": 1.0 },
        { "kind": "remainder", "profile": [point(0.0, 1.0), point(180.0, -2.0), point(420.0, 2.5), point(600.0, 0.0)] }
    ]);
    let at = |place: u32| format!("profile/{place}/error_um");
    let direction = |of: [f64; 4], offset: f64| -> Vec<Value> {
        let moves = (0..).zip(of).map(|(place, size)| by(2, &at(place), size));
        moves.chain([by(1, "offset_um", offset)]).collect()
    };
    let directions = [
        direction([1.5, 1.0, 0.5, -1.0], -0.4),
        direction([0.5, -1.5, -1.5, 0.5], 0.3),
        direction([0.0, 0.5, -0.5, 0.0], 0.8),
    ];
    let open = open(&directions.each_ref().map(Vec::as_slice));
    let tolerance = json!({ "diameter_um": 8.0, "form_um": 6.0 });
    let mut job = shaft(&effects, &open, &json!({ "diameter_um": 8.0 }));
    // What is usual of force and stiffness is not drawn here.
    job["uncertainty"]["defaults"] = json!(false);
    let (told, found, deviation) = of_the_posterior(&job, [-4.0, 4.0], 19);
    eprintln!("told {told:.4}, found {found:.4} +- {deviation:.4}");
    assert!((found - told).abs() < 3.0 * deviation + 0.005, "told {told}, found {found}");
    let answer = solved(shaft(&effects, &open, &tolerance));
    let contributions = answer.conformance.unwrap().contributions;
    let names: Vec<&str> = contributions.iter().map(|one| one.quantity.as_str()).collect();
    // Of force and stiffness nothing is told, and an offset says nothing of the next setting of the tool: those are as usual.
    for name in ["model:remainder/profile", "model:size_offset/offset_um", "force", "stiffness", "tool_setting"] {
        assert_eq!(names.iter().filter(|own| **own == name).count(), 1, "{names:?}");
    }
    assert_eq!(names.len(), 5, "{names:?}");
}

/// A quantity that is told of an effect takes the place of what is usual of the same.
#[test]
fn what_is_told_replaces_what_is_usual() {
    let effects = json!([{ "kind": "headstock_compliance", "delta_um_per_n": 0.03 }]);
    let tolerance = json!({ "diameter_um": 20.0 });
    let contributions = |open: &Value| {
        let answer = serde_json::to_value(solved(shaft(&effects, open, &tolerance))).unwrap();
        let all = answer["conformance"]["contributions"].as_array().unwrap().clone();
        let mut told: Vec<String> = all
            .iter()
            .map(|one| format!("{} {}", one["quantity"].as_str().unwrap(), one["source"].as_str().unwrap()))
            .collect();
        told.sort();
        (told, number(&answer, "/conformance/joint/probability"))
    };
    let (usual, before) = contributions(&json!([]));
    assert_eq!(usual, ["force default", "stiffness default", "tool_setting default"]);
    let (told, with) = contributions(&open(&[&[by(1, "delta_um_per_n", 0.004)]]));
    assert_eq!(told, ["force default", "model:headstock_compliance/delta_um_per_n model", "tool_setting default"]);
    assert!((with - before).abs() > 1e-3, "{with} {before}");
    // Without width it tells nothing, and all is as it was.
    assert_eq!(contributions(&open(&[&[by(1, "delta_um_per_n", 0.0)]])), (usual, before));
}

/// What is not known of the effects is in the uncertainty of the diameter along the shaft, by the cut itself.
#[test]
fn the_uncertainty_along_the_shaft_is_that_of_the_effects() {
    let effects =
        json!([{ "kind": "headstock_compliance", "delta_um_per_n": 0.03 }, { "kind": "force_level", "delta": 0.1 }]);
    // So little that what is not straight in it is a millionth of it.
    let open = open(&[&[by(1, "delta_um_per_n", 2e-4), by(2, "delta", -1e-3)], &[by(2, "delta", 5e-4)]]);
    let mut job = shaft(&effects, &open, &json!({ "diameter_um": 10.0 }));
    let told = solved(job.clone()).stations;
    job.as_object_mut().unwrap().remove("uncertainty");
    let mut at = |scores: [f64; 2]| {
        job["effects"] = off(&effects, &open, &scores);
        cut_with(&job, &told.z_mm, &told.commanded_diameter_mm)
    };
    let [up, down, up_more, down_more] = [at([1.0, 0.0]), at([-1.0, 0.0]), at([0.0, 1.0]), at([0.0, -1.0])];
    for (i, found) in told.diameter_uncertainty_um.unwrap().into_iter().enumerate() {
        let expected = (0.5 * (up[i] - down[i])).hypot(0.5 * (up_more[i] - down_more[i]));
        assert!((found - expected).abs() < 1e-3 * expected + 1e-6, "{i}: {found} {expected}");
    }
}

#[test]
fn what_is_halved_gives_the_probability_that_is_told() {
    let effects =
        json!([{ "kind": "force_level", "delta": 0.1 }, { "kind": "tailstock_compliance", "delta_um_per_n": 0.02 }]);
    let of = |force: f64, tailstock: f64| {
        let open = open(&[
            &[by(1, "delta", 0.1 * force), by(2, "delta_um_per_n", -0.01 * tailstock)],
            &[by(2, "delta_um_per_n", 0.02 * tailstock)],
        ]);
        serde_json::to_value(solved(shaft(&effects, &open, &json!({ "diameter_um": 10.0 })))).unwrap()
    };
    let whole = of(1.0, 1.0);
    for (name, then) in
        [("model:force_level/delta", of(0.5, 1.0)), ("model:tailstock_compliance/delta_um_per_n", of(1.0, 0.5))]
    {
        let all = whole["conformance"]["contributions"].as_array().unwrap();
        let told = all.iter().find(|one| one["quantity"] == name).unwrap();
        // They go together: none has a share of its own.
        assert!(told["share_of_variance"].is_null(), "{told}");
        let joint = &then["conformance"]["joint"];
        let off = number(told, "/joint_probability_if_halved") - number(joint, "/probability");
        assert!(off.abs() < 0.005 + number(joint, "/numerical_error"), "{name}: {off}");
        assert!(number(joint, "/probability") > number(&whole, "/conformance/joint/probability") + 0.01, "{name}");
    }
}

#[test]
fn what_cannot_be_is_told() {
    let effects = json!([
        { "kind": "force_level", "delta": 0.1 },
        { "kind": "steady_rest_offset", "station_mm": 300.0, "offset_um": 2.0 }
    ]);
    let open = open(&[&[by(1, "delta", 0.05), by(2, "station_mm", 1.0), by(3, "delta", 0.1), by(1, "factor", 0.1)]]);
    let mut job = shaft(&effects, &open, &json!({ "diameter_um": 10.0 }));
    job["supports"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "kind": "steady_rest", "z_mm": 300, "compliance_um_per_n": 0.02 }));
    let width = json!({ "kind": "lognormal", "log_standard_deviation": 0.1 });
    job["uncertainty"]["quantities"] =
        json!([{ "quantity": "stiffness", "distribution": width }, { "quantity": "force", "distribution": width }]);
    let found: Vec<String> =
        crate::deflection_faults::faults(job).iter().map(|fault| format!("{} {}", fault.code, fault.pointer)).collect();
    assert_eq!(
        found,
        [
            "unknown_parameter /uncertainty/effects/0/moves/1",
            "unknown_parameter /uncertainty/effects/0/moves/2",
            "unknown_parameter /uncertainty/effects/0/moves/3",
            "duplicate_quantity /uncertainty/quantities/1/quantity"
        ]
    );
}

/// A vise of which a diagnosis told stiffness, force and damping, drawn from what it leaves open and asked one by one.
#[test]
fn vises_of_a_posterior_stay_quiet_as_often_as_said() {
    let vises = std::env::var("PRECUT_CERTAINTY_VISES").map_or(40, |count| count.parse().unwrap());
    let effects = json!([
        { "kind": "stiffness", "factor": 1.05 },
        { "kind": "force_coefficient", "factor": 0.95 },
        { "kind": "damping", "factor": 1.1 }
    ]);
    let open = open(&[
        &[by(1, "factor", 0.09), by(2, "factor", 0.07)],
        &[by(2, "factor", 0.06)],
        &[by(3, "factor", 0.2), by(1, "factor", -0.03)],
    ]);
    let path = format!("{}/reference/certainty/x2-joints-and-slip.json", env!("CARGO_MANIFEST_DIR"));
    let case: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut job = case["job"].clone();
    let friction = job["fixture"]["clamp"]["friction"].clone();
    job["fixture"]["clamp"]["friction"] = json!({ "low": friction, "value": friction, "high": friction });
    job["effects"] = effects.clone();
    let mut draw = Draw::new(29);
    for depth in [3.0, 3.5, 4.1] {
        job["cut"]["depth_mm"] = json!(depth);
        job["uncertainty"] = json!({ "defaults": false, "effects": open });
        let joint = outcome(&job).conformance.unwrap().joint;
        job["uncertainty"] = json!({ "defaults": false });
        let quiet = (0..vises).filter(|_| {
            let scores: Vec<f64> = (0..3).map(|_| normal(&mut draw)).collect();
            is_quiet(&with(&job, "/effects", off(&effects, &open, &scores)))
        });
        let share = quiet.count() as f64 / f64::from(vises);
        let deviation = (joint.probability * (1.0 - joint.probability) / f64::from(vises)).sqrt();
        eprintln!("{depth} mm: told {} +- {}, quiet {share} of {vises}", joint.probability, joint.numerical_error);
        let slack = 2.5 * deviation + joint.numerical_error;
        assert!((share - joint.probability).abs() < slack, "{depth}: {share}, told {}", joint.probability);
    }
    // Of stiffness, damping and force what is usual has gone; what is usual of clamp force and friction stays.
    job["uncertainty"] = json!({ "effects": open });
    let contributions = outcome(&job).conformance.unwrap().contributions;
    let mut names: Vec<&str> = contributions.iter().map(|one| one.quantity.as_str()).collect();
    names.sort_unstable();
    let told = ["model:damping/factor", "model:force_coefficient/factor", "model:stiffness/factor"];
    assert_eq!(names, ["clamp_force", "friction", told[0], told[1], told[2]]);
}

fn is_quiet(job: &Value) -> bool {
    let job = with(job, "/analyses", json!(["clamp_force"]));
    let (modulus, _) = multiplier_modulus(&checked(&job).unwrap()).unwrap();
    let clamp = outcome(&job).clamp.unwrap();
    let given = number(&job, "/fixture/clamp_force_n");
    modulus < 1.0 && given >= clamp.least_n.unwrap() && clamp.slip.unwrap().holds.unwrap()
}

/// Cuts of which a diagnosis told frequency, damping and force, drawn from what it leaves open and solved one by one.
#[test]
fn cuts_of_a_posterior_stay_quiet_as_often_as_said() {
    let cuts = std::env::var("PRECUT_CERTAINTY_CUTS").map_or(40, |count| count.parse().unwrap());
    let effects = json!([
        { "kind": "mode_frequency", "mode": 1, "factor": 1.01 },
        { "kind": "mode_damping", "mode": 1, "factor": 1.2 },
        { "kind": "force_coefficient", "factor": 1.05 }
    ]);
    // A mode that is damped more goes with a larger force, as a log of classes leaves it open.
    let open = open(&[
        &[by(2, "factor", 0.15), by(3, "factor", 0.12)],
        &[by(1, "factor", 0.012), by(3, "factor", -0.03)],
        &[by(2, "factor", 0.1)],
    ]);
    let mut draw = Draw::new(41);
    for depth in [2.8, 3.2] {
        let job = how_sure(&json!({ "cut": { "depth_mm": depth }, "spindle": { "power_kw": 0.9 }, "effects": effects,
            "uncertainty": { "quantities": [], "defaults": false, "effects": open } }));
        let found = of_cut(&job);
        let (told, error) = (found.joint.probability, found.joint.numerical_error);
        let plain = merged(job, &json!({ "analyses": ["verdict"], "uncertainty": null }));
        let quiet = (0..cuts).filter(|_| {
            let scores: Vec<f64> = (0..3).map(|_| normal(&mut draw)).collect();
            let drawn = with(&plain, "/effects", off(&effects, &open, &scores));
            is_quiet_cut(&drawn, &solve(&drawn).outcome)
        });
        let share = quiet.count() as f64 / f64::from(cuts);
        eprintln!("{depth} mm: told {told:.4} +- {error:.4}, quiet {share:.4} of {cuts}");
        assert!(told > 0.05 && told < 0.995, "{depth}: {told}");
        let deviation = (told * (1.0 - told) / f64::from(cuts)).sqrt();
        assert!((share - told).abs() < 2.5 * deviation + error, "{depth}: {share}, told {told}");
        let mut names: Vec<&str> = found.contributions.iter().map(|one| one.quantity.as_str()).collect();
        names.sort_unstable();
        assert_eq!(
            names,
            ["model:force_coefficient/factor", "model:mode_damping/factor", "model:mode_frequency/factor"]
        );
    }
}

/// Rings of which a diagnosis told push-off, a wave of the blank and a roller, turned one by one.
#[test]
fn rings_of_a_posterior_are_good_as_often_as_said() {
    let count = drawn(60);
    let effects = json!([
        { "kind": "tool_push_off", "push_off_ratio": 0.3 },
        { "kind": "initial_harmonic", "order": 4, "amplitude_mm": 0.006, "phase_rad": 0.4 },
        { "kind": "roller_runout", "amplitude_mm": 0.0005, "ratio": 4.5, "phase_rad": 0.3 }
    ]);
    let open = open(&[
        &[by(1, "push_off_ratio", 0.12), by(2, "amplitude_mm", -0.001)],
        &[by(2, "amplitude_mm", 0.002)],
        &[by(3, "amplitude_mm", 0.000_2)],
    ]);
    let reach: f64 = 54.9;
    let (half_angle, tool) = (25.0_f64.to_radians(), 74.0_f64.to_radians());
    let job = json!({
        "ring": { "radius_mm": 45.0, "harmonics": [{ "order": 3, "amplitude_um": 6.0, "angle_of_max_deg": 20.0 }] },
        "supports": { "distance_mm": 2.0 * reach * half_angle.sin(), "depth_mm": reach * half_angle.cos(), "roller_radius_mm": 10.0 },
        "tool": { "x_mm": 45.06 * tool.cos(), "y_mm": 45.06 * tool.sin(), "feed_direction_deg": 254.0,
            "feed_mm_per_rev": 0.01, "revolutions": 16.0, "spark_out_revolutions": 2.0 },
        "effects": effects, "filter": "upr_15", "samples": 360
    });
    let mut draw = Draw::new(37);
    let mut turned: Vec<f64> = (0..count)
        .map(|_| {
            let scores: Vec<f64> = (0..3).map(|_| normal(&mut draw)).collect();
            let mut own = off(&effects, &open, &scores);
            // How blank and roller stand when the ring begins to turn is anything.
            let [blank, roller] = [draw.share(), draw.share()];
            own[1]["phase_rad"] = json!(0.4 - 4.0 * std::f64::consts::TAU * blank);
            own[2]["phase_rad"] = json!(0.3 + std::f64::consts::TAU * roller);
            let mut job = job.clone();
            job["ring"]["harmonics"][0]["angle_of_max_deg"] = json!((20.0 + 360.0 * blank) % 360.0);
            job["effects"] = own;
            ring_support::run(&job).output.roundness_um.unwrap()
        })
        .collect();
    turned.sort_by(f64::total_cmp);
    for place in [0.3, 0.8] {
        let tolerance_um = turned[(place * count as f64) as usize];
        let mut job = job.clone();
        job["analyses"] = json!(["certainty"]);
        job["tolerance"] = json!({ "roundness_um": tolerance_um });
        job["uncertainty"] = json!({ "defaults": false, "effects": open });
        let found = ring_support::run(&job).output.conformance.unwrap();
        let (told, error) = (found.joint.probability, found.joint.numerical_error);
        let share = turned.iter().filter(|own| **own <= tolerance_um).count() as f64 / count as f64;
        eprintln!("{tolerance_um:.3} um: told {told:.3} +- {error:.3}, good {share:.3} of {count}");
        let deviation = (told.max(0.02) * (1.0 - told).max(0.02) / count as f64).sqrt();
        assert!((told - share).abs() < 2.5 * deviation + error, "{told} {share}");
        assert!(found.contributions.iter().any(|one| one.quantity == "model:initial_harmonic/amplitude_mm"));
    }
}
