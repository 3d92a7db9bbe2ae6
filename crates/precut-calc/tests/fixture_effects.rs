//! Effects on the fixture model and the model as a diagnosis sees it.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::path::Path;

use crate::fixture_support::{checked, outcome, reference_job, solve, with};
use precut_calc::calculator::{ForwardModel, Missing, Rows, Unwatched};
use precut_calc::effects::{FIXTURE_CAUSES, FixtureEffect};
use precut_calc::fixture_stability::{FixtureAllowances, FixturePoint, FixtureRun, FixtureStability, LobeBoundary};
use serde_json::{Value, json};

#[allow(clippy::needless_pass_by_value)] // called with `json!`
fn under(job: &Value, effect: Value) -> Value {
    with(job, "/effects", json!([effect]))
}

#[test]
fn a_factor_is_the_job_with_another_number() {
    let base = reference_job(2);
    for (effect, pointers) in [
        ("stiffness", &["/fixture/movable_joint/stiffness_n_per_mm", "/fixture/fixed_joint/stiffness_n_per_mm"][..]),
        ("damping", &["/fixture/movable_joint/damping_n_s_per_mm", "/fixture/fixed_joint/damping_n_s_per_mm"]),
        ("mass", &["/fixture/workpiece_mass_kg"]),
        ("jaw_mass", &["/fixture/jaw_mass_kg"]),
        ("force_coefficient", &["/force/coefficient"]),
    ] {
        let by_effect = outcome(&under(&base, json!({ "kind": effect, "factor": 1.25 })));
        let mut stated = base.clone();
        for pointer in pointers {
            *stated.pointer_mut(pointer).unwrap() = json!(1.25 * base.pointer(pointer).unwrap().as_f64().unwrap());
        }
        let stated = outcome(&stated);
        assert_eq!(by_effect, stated, "{effect}");
        assert_ne!(by_effect.forced, outcome(&base).forced, "{effect} changes nothing");
    }
    for (effect, pointer) in
        [("chip_thickness_exponent", "/force/chip_thickness_exponent"), ("depth_exponent", "/force/depth_exponent")]
    {
        let by_effect = outcome(&under(&base, json!({ "kind": effect, "delta": 0.0625 })));
        let stated = base.pointer(pointer).unwrap().as_f64().unwrap() + 0.0625;
        assert_eq!(by_effect, outcome(&with(&base, pointer, json!(stated))), "{effect}");
    }
}

/// k = 0: the forced motion is linear in the run-out, its mean over the teeth stays.
#[test]
fn one_tooth_that_stands_out_makes_a_revolution_of_the_period() {
    let base = with(&reference_job(1), "/force/chip_thickness_exponent", json!(0));
    let job = under(&base, json!({ "kind": "tooth_runout", "runout_mm": 0.01 }));
    let (even, uneven) = (outcome(&base), outcome(&job));
    assert_eq!(uneven.multiplier.tooth_periods, 8);
    // With a linear law the cutting stiffness does not know the chip: the same multiplier.
    assert!((even.multiplier.modulus - uneven.multiplier.modulus).abs() < 1e-8, "{:?}", uneven.multiplier);
    // The tooth with the thicker chip has the largest force: (S_z + r)/S_z of the even one at its entry, where it is
    // alone with one of an even chip.
    assert!(uneven.quasi_static.force_max_n > even.quasi_static.force_max_n);
    assert!(uneven.quasi_static.force_min_n < even.quasi_static.force_min_n);
    // The period is a revolution, so the chips answer to the motion: a quarter more force on one tooth (r/S_z) moves the
    // workpiece by a quarter of its 20 um, 5 um, and a little more near the onset of chatter.
    let (exact, run) = (uneven.forced.peak_to_peak_um, uneven.simulation.as_ref().unwrap().peak_to_peak_um);
    assert!((run / exact - 1.0).abs() < 2e-3, "{run} {exact}");
    let chips = (
        uneven.simulation.as_ref().unwrap().effective_feed_min_mm,
        uneven.simulation.as_ref().unwrap().effective_feed_max_mm,
    );
    assert!((chips.0 - 0.0293).abs() < 6e-3 && (chips.1 - 0.0493).abs() < 6e-3, "{chips:?}");
}

/// Where the force answers to the motion it is found as a periodic solution; the run in time comes to it with the square of its
/// step, with one mode and two, uneven teeth, joints that harden, and both.
#[test]
fn the_run_in_time_comes_to_the_motion_to_which_the_force_answers() {
    let runout = json!({ "kind": "tooth_runout", "runout_mm": 0.008 });
    let hardening = json!({ "kind": "contact_hardening", "cubic_per_mm2": 800.0 });
    let cases = [
        (1, json!([runout])),
        (2, json!([runout])),
        (1, json!([hardening])),
        (2, json!([hardening])),
        (1, json!([runout, hardening])),
    ];
    for (kind, effects) in cases {
        let base = with(&reference_job(kind), "/effects", effects.clone());
        let limits = json!({ "depth_max_mm": 1.5 });
        let job = with(&with(&base, "/cut/depth_mm", json!(1.0)), "/limits", limits);
        let error = |steps: u32| {
            let settings = json!({ "steps_per_tooth": steps, "tooth_periods": 240, "steady_tooth_periods": 16 });
            let got = outcome(&with(&job, "/simulation", settings));
            (got.simulation.as_ref().unwrap().peak_to_peak_um / got.forced.peak_to_peak_um - 1.0).abs()
        };
        let (coarse, fine) = (error(200), error(800));
        // Of order 2 with four times the steps: 16 times less; half of that leaves room for the next order.
        assert!(coarse < 5e-3, "{kind} {effects}: {coarse}");
        assert!(fine < coarse / 8.0 + 1e-6, "{kind} {effects}: {coarse} {fine}");
    }
}

/// k = 0: what a tooth that stands out adds to the motion is proportional to how far it does. The largest displacement is where
/// the motion turns, so its place moves and adds the square of the run-out: 1e-3 of it between 1 and 2 um.
#[test]
fn with_a_linear_law_the_motion_is_linear_in_the_run_out() {
    let base = with(&reference_job(2), "/force/chip_thickness_exponent", json!(0));
    let at = |runout_mm: f64| {
        let job = with(&base, "/cut/depth_mm", json!(0.8));
        outcome(&under(&job, json!({ "kind": "tooth_runout", "runout_mm": runout_mm }))).forced.displacement_max_um
    };
    let (none, small, large) = (at(0.0), at(0.001), at(0.002));
    assert!((small - none).abs() > 0.05, "{none} {small}");
    assert!(((large - none) / (small - none) - 2.0).abs() < 5e-3, "{none} {small} {large}");
}

#[test]
fn process_damping_raises_the_limit_at_low_speed_more() {
    let base = reference_job(1);
    let gain = |rpm: f64| {
        let mut at = with(&base, "/cut/spindle_speed_rpm", json!(rpm));
        at["limits"] = json!({ "depth_max_mm": 40 });
        let damped = under(&at, json!({ "kind": "process_damping", "coefficient_n_per_mm": 60.0 }));
        outcome(&damped).chatter_depth_mm.unwrap() / outcome(&at).chatter_depth_mm.unwrap()
    };
    let (slow, fast) = (gain(100.0), gain(400.0));
    assert!(slow > fast && fast > 1.0, "{slow} {fast}");
    // Marching sees the same damping: just below the limit it settles.
    let damped = under(&base, json!({ "kind": "process_damping", "coefficient_n_per_mm": 60.0 }));
    let got = outcome(&damped);
    assert!(
        got.simulation.as_ref().unwrap().settled
            && (got.simulation.as_ref().unwrap().peak_to_peak_um / got.forced.peak_to_peak_um - 1.0).abs() < 2e-3
    );
}

#[test]
fn joints_that_harden_move_less_and_both_ways_of_computing_agree() {
    let base = reference_job(1);
    let got = outcome(&under(&base, json!({ "kind": "contact_hardening", "cubic_per_mm2": 2000.0 })));
    let soft = outcome(&base);
    assert!(got.forced.displacement_max_um < 0.95 * soft.forced.displacement_max_um, "{:?}", got.forced);
    // Newton's periodic solution against marching, whose step is 80 to an oscillation.
    assert!(
        (got.simulation.as_ref().unwrap().peak_to_peak_um / got.forced.peak_to_peak_um - 1.0).abs() < 3e-3,
        "{got:?}"
    );
    // Growth about a motion that stiffens is slower.
    assert!(got.multiplier.modulus < soft.multiplier.modulus);
}

/// A depth that nobody cuts has no forced motion on joints that harden: what is asked about has its answer all the same, and
/// how deep limits could be looked for is said. With uneven teeth the search would take minutes if it had to end.
#[test]
fn a_cut_on_hardening_joints_is_answered_whatever_a_deeper_one_does() {
    let mut job = reference_job(1);
    job["cutter"] = json!({ "diameter_mm": 63.34, "teeth": 1 });
    job["force"] =
        json!({ "coefficient": 1521.9, "chip_thickness_exponent": 0.4, "depth_exponent": 0, "radial_ratio": 0 });
    job["cut"] = json!({
        "width_mm": 54.23, "offset_mm": 4.554, "depth_mm": 2.67, "spindle_speed_rpm": 7179.4, "feed_mm_per_tooth": 0.0265,
        "feed_toward": "fixed_jaw"
    });
    job["fixture"] = json!({
        "kind": "self_locking", "workpiece_mass_kg": 3.818, "clamp_force_n": 1e7,
        "movable_joint": { "stiffness_n_per_mm": 3280.8, "damping_n_s_per_mm": 0.38416 },
        "fixed_joint": { "stiffness_n_per_mm": 9913.4, "damping_n_s_per_mm": 0.40823 }
    });
    job["analyses"] = json!(["verdict"]);
    let hardening = json!({ "kind": "contact_hardening", "cubic_per_mm2": 318.76 });
    let milled = with(&job, "/effects", json!([hardening, { "kind": "tooth_runout", "runout_mm": 0.01325 }]));
    let mut slow = with(&milled, "/cutter", json!({ "diameter_mm": 59.87, "teeth": 20 }));
    slow["cut"] = json!({
        "width_mm": 25.384, "offset_mm": -15.8044, "depth_mm": 0.84, "spindle_speed_rpm": 318.87,
        "feed_mm_per_tooth": 0.19354, "feed_toward": "fixed_jaw"
    });
    slow["force"]["radial_ratio"] = json!(0.6);
    slow["fixture"]["workpiece_mass_kg"] = json!(0.38566);
    slow["effects"][0]["cubic_per_mm2"] = json!(2514.1);
    slow["effects"][1]["runout_mm"] = json!(0.0967);
    for job in [milled, slow.clone()] {
        let far = solve(&job);
        assert!(far.warnings.iter().any(|said| said.code == "no_forced_motion_beyond"), "{:?}", far.warnings);
        // Where the motion ends is no limit of chatter.
        assert_eq!(far.output.chatter_depth_mm, None);
        let near = outcome(&with(&job, "/limits/depth_max_mm", json!(1.05 * job["cut"]["depth_mm"].as_f64().unwrap())));
        assert!(far.output.depth_examined_mm >= near.depth_examined_mm);
        assert_eq!((far.output.multiplier, far.output.forced), (near.multiplier, near.forced));
    }
    // The diagram says for every speed how deep it looked.
    let speed_rpm = slow["cut"]["spindle_speed_rpm"].as_f64().unwrap();
    let verdict = outcome(&slow);
    slow["analyses"] = json!(["lobes"]);
    slow["lobes"] = json!({ "from_rpm": 0.9 * speed_rpm, "to_rpm": 1.1 * speed_rpm, "speeds": 3, "map": false });
    let LobeBoundary { depth_examined_mm, chatter_mm, .. } = outcome(&slow).lobes.unwrap().boundary;
    assert_eq!((chatter_mm, depth_examined_mm.len()), (vec![None; 3], 3));
    assert!(depth_examined_mm[1].total_cmp(&verdict.depth_examined_mm).is_eq(), "{depth_examined_mm:?}");
    assert!(depth_examined_mm.iter().all(|depth| *depth < 1.0), "{depth_examined_mm:?}");
}

#[test]
fn a_mass_that_is_hung_on_adds_a_mode() {
    let effect = json!({ "kind": "second_mode", "mass_kg": 0.6, "frequency_hz": 700.0, "damping_ratio": 0.04 });
    for kind in [1, 2] {
        let got = outcome(&under(&reference_job(kind), effect.clone()));
        assert_eq!(got.modes.len(), usize::from(kind) + 1);
        assert!(
            (got.simulation.as_ref().unwrap().peak_to_peak_um / got.forced.peak_to_peak_um - 1.0).abs() < 3e-3,
            "{kind}"
        );
    }
    // Undamped frequencies by the determinant of two masses: m m4 w^4 - (k4 (m + m4) + C m4) w^2 + C k4 = 0.
    let mut free = under(
        &reference_job(1),
        json!({ "kind": "second_mode", "mass_kg": 0.6, "frequency_hz": 700.0, "damping_ratio": 0.0 }),
    );
    for joint in ["movable_joint", "fixed_joint"] {
        free["fixture"][joint]["damping_n_s_per_mm"] = json!(0);
    }
    let modes = outcome(&free).modes;
    let (m, m4, c) = (5.0, 0.6, 36e6);
    let k4 = m4 * (std::f64::consts::TAU * 700.0_f64).powi(2);
    let (a, b, d) = (m * m4, k4 * (m + m4) + c * m4, c * k4);
    let root = (b * b - 4.0 * a * d).sqrt();
    for (mode, square) in modes.iter().zip([(b - root) / (2.0 * a), (b + root) / (2.0 * a)]) {
        let want = square.sqrt() / std::f64::consts::TAU;
        assert!((mode.natural_frequency_hz / want - 1.0).abs() < 1e-9, "{mode:?} {want}");
    }
}

#[test]
fn a_clamp_that_loosens_opens_the_joint() {
    let mut job = with(&reference_job(1), "/fixture/clamp_force_n", json!(800));
    job["conditions"] = json!({ "time_since_clamping_min": 0 });
    let effect = json!({ "kind": "preload_loss", "share": 0.5, "time_constant_min": 5.0 });
    assert!(outcome(&under(&job, effect.clone())).verdict.joint.is_none());
    job["conditions"] = json!({ "time_since_clamping_min": 60 });
    assert!(outcome(&under(&job, effect)).verdict.joint.is_some());
}

#[test]
fn effects_that_the_job_cannot_carry_are_refused_all_at_once() {
    let mut job = reference_job(1);
    job["effects"] = json!([
        { "kind": "jaw_mass", "factor": 1.1 },
        { "kind": "preload_loss", "share": 0.2, "time_constant_min": 5.0 },
        { "kind": "chip_thickness_exponent", "delta": -0.2 },
        { "kind": "tooth_runout", "runout_mm": 0.05 },
        { "kind": "jaw_mass", "factor": 1.2 },
    ]);
    let faults = checked(&job).unwrap_err();
    for (code, pointer) in [
        ("effect_without_jaw", "/effects/0"),
        ("condition_missing", "/conditions/time_since_clamping_min"),
        ("effect_without_clamp_force", "/effects/1"),
        ("exponent_beyond_law", "/effects/2/delta"),
        ("runout_beyond_feed", "/effects/3/runout_mm"),
        ("duplicate_effect", "/effects/4/kind"),
    ] {
        assert!(faults.contains(&(code.to_owned(), pointer.to_owned())), "{code} at {pointer}: {faults:?}");
    }
}

#[test]
fn every_cause_makes_its_own_effect() {
    for cause in FIXTURE_CAUSES {
        let values: Vec<f64> = cause.parameters.iter().map(|p| 0.5 * (p.lower + p.upper)).collect();
        let effect = FixtureEffect::from_parameters(cause, &values).unwrap();
        assert_eq!((effect.kind(), effect.cause().kind), (cause.kind, cause.kind));
        let object = serde_json::to_value(&effect).unwrap();
        for parameter in cause.parameters {
            assert!(object[parameter.name].is_number(), "{}: {}", cause.kind, parameter.name);
        }
        assert_eq!(serde_json::from_value::<FixtureEffect>(object).unwrap(), effect);
    }
    // As the contract prints them.
    let printed = json!([
        { "kind": "stiffness", "factor": 0.9 }, { "kind": "damping", "factor": 0.9 }, { "kind": "mass", "factor": 0.9 },
        { "kind": "force_coefficient", "factor": 0.9 }, { "kind": "chip_thickness_exponent", "delta": 0.05 },
        { "kind": "depth_exponent", "delta": 0.05 }, { "kind": "tooth_runout", "runout_mm": 0.01 },
        { "kind": "process_damping", "coefficient_n_per_mm": 1.0 }, { "kind": "contact_hardening", "cubic_per_mm2": 5000.0 },
        { "kind": "preload_loss", "share": 0.2, "time_constant_min": 5.0 },
        { "kind": "second_mode", "mass_kg": 0.6, "frequency_hz": 700.0, "damping_ratio": 0.04 },
        { "kind": "jaw_mass", "factor": 1.1 }
    ]);
    assert_eq!(serde_json::from_value::<Vec<FixtureEffect>>(printed).unwrap().len(), FIXTURE_CAUSES.len());
}

fn rows(runs: &[f64], depths: &[f64]) -> Rows<FixtureRun, FixturePoint> {
    Rows {
        runs: runs.iter().map(|&n| FixtureRun { spindle_speed_rpm: Some(n), ..FixtureRun::default() }).collect(),
        points: (0..runs.len())
            .flat_map(|run| {
                depths.iter().map(move |&h| (run, FixturePoint { depth_mm: Some(h), ..FixturePoint::default() }))
            })
            .collect(),
    }
}

#[test]
fn the_forward_model_is_the_calculator() {
    let job = checked(&reference_job(1)).unwrap();
    let rows = rows(&[318.31, 400.0], &[1.0, 3.0, 8.0]);
    let prepared = FixtureStability::prepare(&job, &rows, "peak_to_peak_um", &Unwatched).unwrap();
    let effect = FixtureEffect::Stiffness { factor: 0.9 };
    let predicted = FixtureStability::predict(&prepared, std::slice::from_ref(&effect), &Unwatched).unwrap();
    for ((run, point), prediction) in rows.points.iter().zip(&predicted) {
        let mut job = reference_job(1);
        job["cut"]["spindle_speed_rpm"] = json!(rows.runs[*run].spindle_speed_rpm);
        job["cut"]["depth_mm"] = json!(point.depth_mm);
        let got = outcome(&under(&job, json!({ "kind": "stiffness", "factor": 0.9 })));
        match prediction {
            Ok(value) => {
                assert!((value / got.forced.peak_to_peak_um - 1.0).abs() < 1e-9 && got.multiplier.modulus < 1.0);
            }
            Err(missing) => assert!(*missing == Missing::Unstable && got.multiplier.modulus >= 1.0),
        }
    }
    assert!(predicted[2].is_err() && predicted[1].is_ok());
    let column =
        FixtureStability::nuisances(&prepared, &[], &FixtureAllowances::default(), &Unwatched).unwrap().remove(0);
    // Statistics work on the logarithm of an amplitude: a level moves it by the same everywhere.
    assert!(column.iter().all(|moved| (moved - 0.005).abs() < 1e-12));
    let limits = FixtureStability::prepare(&job, &rows, "depth_limit_mm", &Unwatched).unwrap();
    let limit = FixtureStability::predict(&limits, &[], &Unwatched).unwrap()[0].unwrap();
    assert!((limit / 4.099_269_45 - 1.0).abs() < 1e-6, "{limit}");
    let margins = FixtureStability::prepare(&job, &rows, "regime", &Unwatched).unwrap();
    let margin = FixtureStability::predict(&margins, &[], &Unwatched).unwrap();
    assert!(margin[1].unwrap() > 0.0 && margin[2].unwrap() < 0.0, "{margin:?}");
    let unknown = FixtureStability::prepare(&job, &rows, "amplitude", &Unwatched);
    assert!(unknown.is_err());
}

#[test]
fn a_displacement_is_that_of_the_run_in_time() {
    let job = checked(&reference_job(1)).unwrap();
    let at = |time_s: f64| Rows {
        runs: vec![FixtureRun::default()],
        points: vec![(0, FixturePoint { time_s: Some(time_s), ..FixturePoint::default() })],
    };
    let predict = |time_s: f64| {
        let prepared = FixtureStability::prepare(&job, &at(time_s), "displacement_um", &Unwatched).unwrap();
        FixtureStability::predict(&prepared, &[], &Unwatched).unwrap()[0].unwrap()
    };
    assert!(predict(0.0).abs() < 1e-9);
    // Late in the run and long after it: the same periodic motion, a whole number of tooth periods apart.
    let tau = 60.0 / (318.31 * 8.0);
    let (early, late) = (predict(100.25 * tau), predict(5000.25 * tau));
    assert!((early / late - 1.0).abs() < 2e-3, "{early} {late}");
}

/// The published synthetic example: its hidden effect, a stiffness of 0.9575, fits better than none, to its own scatter.
#[test]
fn the_synthetic_example_hides_a_softer_joint() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .join("tests/reference/fixture-stability/example-fixture-stiffness.json");
    let example: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let of = |name: &str| example["job"][name].as_f64().unwrap();
    // The short job states the sums; the amplitude of a screw vise depends on nothing else.
    let joint = json!({
        "stiffness_n_per_mm": 0.5 * of("stiffness_n_per_mm"), "damping_n_s_per_mm": 0.5e-3 * of("damping_n_s_per_m"),
    });
    let job = checked(&json!({
        "cutter": { "diameter_mm": of("cutter_diameter_mm"), "teeth": 6 },
        "force": {
            "coefficient": of("force_coefficient"), "chip_thickness_exponent": of("chip_exponent_k"),
            "depth_exponent": of("depth_exponent_mu"), "radial_ratio": of("radial_ratio"),
        },
        "cut": {
            "width_mm": of("workpiece_width_mm"), "depth_mm": 1, "spindle_speed_rpm": 300,
            "feed_mm_per_tooth": of("feed_mm_per_tooth"),
        },
        "fixture": {
            "kind": "self_locking", "workpiece_mass_kg": of("workpiece_mass_kg"), "movable_joint": joint, "fixed_joint": joint,
        },
    }))
    .unwrap();
    let measured = example["measurements"].as_array().unwrap();
    let rows = Rows {
        runs: measured
            .iter()
            .map(|m| FixtureRun { spindle_speed_rpm: m["speed_rpm"].as_f64(), ..FixtureRun::default() })
            .collect(),
        points: measured
            .iter()
            .enumerate()
            .map(|(i, m)| (i, FixturePoint { depth_mm: m["depth_mm"].as_f64(), ..FixturePoint::default() }))
            .collect(),
    };
    let prepared = FixtureStability::prepare(&job, &rows, "peak_to_peak_um", &Unwatched).unwrap();
    let scatter = |effects: &[FixtureEffect]| {
        let predicted = FixtureStability::predict(&prepared, effects, &Unwatched).unwrap();
        let square: f64 = predicted
            .iter()
            .zip(measured)
            .map(|(p, m)| (m["peak_to_peak_um"].as_f64().unwrap() / p.unwrap()).ln().powi(2))
            .sum();
        (square / measured.len() as f64).sqrt()
    };
    let factor = example["answer"]["effects"][0]["params"]["factor"].as_f64().unwrap();
    let (without, hidden) = (scatter(&[]), scatter(&[FixtureEffect::Stiffness { factor }]));
    let sigma = example["answer"]["sigma_ln"].as_f64().unwrap();
    // 48 readings: the scatter of a right model is sigma within 4/sqrt(96) of it. A joint 4 % off is told from it.
    assert!(hidden < 1.41 * sigma && without > 1.5 * hidden, "{without} {hidden} {sigma}");
    for off in [0.96, 1.04] {
        assert!(scatter(&[FixtureEffect::Stiffness { factor: off * factor }]) > hidden, "{off}");
    }
}
