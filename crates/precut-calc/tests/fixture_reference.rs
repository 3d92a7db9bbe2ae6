//! The reference cases, closed forms, the published benchmark and the source paper's tables.
#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, missing_docs)]

use crate::fixture_support;
use crate::fixture_support::{checked, outcome, reference, translate, with};
use precut_calc::fixture_stability::FixtureOutcome;
use serde_json::{Value, json};

/// A number of the answer by its name in the reference, in the reference's unit.
fn number(case: &Value, name: &str, got: &FixtureOutcome) -> Option<f64> {
    let kind = case["kind"].as_str().unwrap();
    let (sim, forced, quasi) = (got.simulation.as_ref().unwrap(), &got.forced, &got.quasi_static);
    let clamp = got.clamp.as_ref();
    let of = |forced: f64, simulated: f64| if kind == "time_domain" { simulated } else { forced };
    Some(match name {
        "Px_max_N" => of(quasi.force_max_n, sim.force_max_n),
        "Px_min_N" => of(quasi.force_min_n, sim.force_min_n),
        "stiffness_N_mm" => quasi.stiffness_n_per_mm,
        "x_max_mm" if kind == "static" => quasi.displacement_max_um / 1e3,
        "x_min_mm" if kind == "static" => quasi.displacement_min_um / 1e3,
        "x_max_mm" => of(forced.displacement_max_um, sim.displacement_max_um) / 1e3,
        "x_min_mm" => of(forced.displacement_min_um, sim.displacement_min_um) / 1e3,
        "peak_to_peak_mm" if kind == "periodic" => forced.peak_to_peak_um / 1e3,
        "peak_to_peak_mm" => sim.peak_to_peak_um / 1e3,
        "amplitude_abs_mm" => sim.displacement_max_um.abs().max(sim.displacement_min_um.abs()) / 1e3,
        "clamp_right_N" if kind == "static" => clamp?.static_fixed_n,
        "clamp_left_N" if kind == "static" => clamp?.static_movable_n,
        "clamp_right_N" if kind == "periodic" => forced.clamp_fixed_n,
        "clamp_left_N" if kind == "periodic" => forced.clamp_movable_n,
        "static_right_N" => clamp?.static_fixed_n,
        "static_left_N" => clamp?.static_movable_n,
        "clamp_right_N" => clamp?.fixed_n?,
        "clamp_left_N" => clamp?.movable_n?,
        "clamp_min_N" => clamp?.least_n?,
        "clamp_right_steady_N" => sim.clamp_fixed_n,
        "clamp_left_steady_N" => sim.clamp_movable_n,
        "clamp_right_entry_N" => sim.clamp_fixed_entry_n,
        "clamp_left_entry_N" => sim.clamp_movable_entry_n,
        "feed_eff_max_mm" => sim.effective_feed_max_mm,
        "arc_deg" => got.engagement.arc_deg,
        "teeth_mean" => got.engagement.teeth_in_cut_mean,
        "Sz_mm" => got.engagement.feed_mm_per_tooth,
        "n_rpm" => got.engagement.spindle_speed_rpm,
        "tooth_Hz" => got.engagement.tooth_frequency_hz,
        "multiplier_abs" => got.multiplier.modulus,
        "multiplier_re" => got.multiplier.real,
        "multiplier_im_abs" => got.multiplier.imaginary,
        "mean_directional_factor" => got.zeroth_order.mean_directional_factor,
        "H_min_mm" => got.zeroth_order.depth_min_mm?,
        "H_at_speed_mm" => got.zeroth_order.depth_at_speed_mm?,
        _ => return None,
    })
}

fn tolerance(case: &Value, name: &str, expected: f64) -> f64 {
    let given = &case["tolerance"];
    if let Some(abs) = given["abs"].as_f64() {
        return abs;
    }
    let rel = given["rel_by_field"][name].as_f64().or(given["rel"].as_f64());
    // A quantity whose reference is 0 is 0 to a millionth of a newton or a millimetre.
    let rel = if expected == 0.0 { Some(rel.unwrap_or(0.0)) } else { rel };
    rel.unwrap_or_else(|| panic!("no tolerance for {name}")) * expected.abs() + 1e-6
}

/// Zero or not: sample counts are compared in no other way.
fn flags(name: &str, got: &FixtureOutcome) -> Option<bool> {
    let sim = got.simulation.as_ref().unwrap();
    Some(match name {
        "lost_cut_samples" => sim.lost_cut_share > 0.0,
        "open_right_samples" => sim.open_fixed_share > 0.0,
        "open_left_samples" => sim.open_movable_share > 0.0,
        "open_both_samples" => sim.open_both_share > 0.0,
        "diverged" => sim.diverged,
        "stable" => got.multiplier.modulus < 1.0,
        _ => return None,
    })
}

fn job_of(case: &Value) -> Value {
    let mut job = translate(&case["input"]);
    job["analyses"] = json!(["clamp_force"]);
    if let Some(n) = case["options"]["N"].as_u64() {
        let (periods, steady) = if case["kind"] == "clamp_force" { (400, 200) } else { (200, 50) };
        job["simulation"] = json!({ "steps_per_tooth": n, "tooth_periods": periods, "steady_tooth_periods": steady });
    }
    if case["kind"] == "critical_depth" {
        job["analyses"] = json!(["limits"]);
        job["limits"] = json!({ "depth_max_mm": case["H_max_mm"], "depths": 2, "speeds_rpm": case["speeds_rpm"] });
    }
    job
}

#[test]
fn every_reference_case_is_met() {
    let cases = reference("cases.json");
    let mut compared = 0;
    for case in cases.as_array().unwrap() {
        let id = case["id"].as_str().unwrap();
        let expected = &case["answer"];
        if !expected["error"].is_null() {
            continue;
        }
        let got = outcome(&job_of(case));
        for (name, value) in expected.as_object().unwrap() {
            match value {
                Value::Number(n) if flags(name, &got).is_none() => {
                    let (want, have) = (n.as_f64().unwrap(), number(case, name, &got));
                    let have = have.unwrap_or_else(|| panic!("{id}: no {name}"));
                    let within = tolerance(case, name, want);
                    assert!((have - want).abs() <= within, "{id} {name}: {have}, reference {want} +- {within}");
                    compared += 1;
                }
                Value::Number(n) => {
                    assert_eq!(flags(name, &got).unwrap(), n.as_f64().unwrap() > 0.0, "{id} {name}");
                    compared += 1;
                }
                Value::Bool(flag) => {
                    assert_eq!(flags(name, &got).unwrap(), *flag, "{id} {name}");
                    compared += 1;
                }
                Value::String(regime) => {
                    assert_eq!(got.multiplier.modulus < 1.0, regime == "stable", "{id}");
                    compared += 1;
                }
                Value::Array(items) if name == "natural" => {
                    assert_eq!(items.len(), got.modes.len(), "{id}");
                    for (want, have) in items.iter().zip(&got.modes) {
                        let pairs = [
                            ("fn_Hz", have.natural_frequency_hz),
                            ("fd_Hz", have.damped_frequency_hz),
                            ("zeta", have.damping_ratio),
                        ];
                        for (field, have) in pairs {
                            let want = want[field].as_f64().unwrap();
                            assert!((have - want).abs() < 1e-6 * want, "{id} {field}: {have}, reference {want}");
                            compared += 1;
                        }
                    }
                }
                Value::Array(limits) => {
                    let have = &got.limits.as_ref().unwrap().at_speeds;
                    assert_eq!(limits.len(), have.len(), "{id}");
                    for (want, have) in limits.iter().zip(have) {
                        let (want, have) = (want["H_crit_mm"].as_f64().unwrap(), have.chatter_mm.unwrap());
                        assert!((have / want - 1.0).abs() < 1e-4, "{id}: {have}, reference {want}");
                        compared += 1;
                    }
                }
                other => panic!("{id} {name}: {other}"),
            }
        }
    }
    // 21 cases with some 150 numbers: a walk that skips them would be worth nothing.
    assert!(compared > 140, "{compared}");
}

#[test]
fn a_strip_beside_the_cutter_is_refused() {
    let cases = reference("cases.json");
    let case = cases.as_array().unwrap().iter().find(|c| c["id"] == "S23").unwrap();
    let faults = checked(&translate(&case["input"])).unwrap_err();
    assert_eq!(faults, [("strip_misses_cutter".to_owned(), "/cut/offset_mm".to_owned())]);
}

fn benchmark_job(immersion: f64, rpm: f64, depth: f64) -> Value {
    let benchmark = reference("benchmark.json");
    let mut input = benchmark["as_fixture_input"].clone();
    input["regime"] = json!({
        "width_mm": 10.0 * immersion, "offset_mm": 5.0 * (immersion - 1.0), "spindle_rpm": rpm,
        "feed_per_tooth_mm": 0.1, "depth_mm": depth,
    });
    let mut job = translate(&input);
    // The multiplier alone is compared: as short a run in time as there is.
    job["simulation"] = json!({ "tooth_periods": 20, "steps_per_tooth": 32 });
    job["limits"] = json!({ "depth_max_mm": 1.2 });
    job
}

#[test]
fn the_published_benchmark_is_met_to_a_millionth() {
    let benchmark = reference("benchmark.json");
    for row in benchmark["multipliers"].as_array().unwrap() {
        let of = |name: &str| row[name].as_f64().unwrap();
        let got = outcome(&benchmark_job(of("radial_immersion"), of("spindle_rpm"), of("depth_mm"))).multiplier;
        let want = of("multiplier_abs");
        assert!((got.modulus - want).abs() < 1e-6, "{row}: {}", got.modulus);
        // The stated error is no promise that is broken, and no empty one.
        assert!((got.modulus - want).abs() < 2e-10 + got.modulus_error && got.modulus_error < 1e-5, "{row}: {got:?}");
    }
}

#[test]
fn the_closed_forms_are_met() {
    let forms = reference("closed-forms.json");
    let form = |id: &str| forms.as_array().unwrap().iter().find(|f| f["id"] == id).unwrap().clone();
    let base = fixture_support::reference_job(1);
    let got = outcome(&base);
    let two = outcome(&fixture_support::reference_job(2));
    let close = |have: f64, want: &Value, rel: f64| {
        let want = want.as_f64().unwrap();
        assert!((have - want).abs() <= rel * want.abs(), "{have}, closed form {want}");
    };
    close(got.modes[0].natural_frequency_hz, &form("CF1")["answer"]["fn_Hz"], 1e-9);
    close(got.modes[0].damping_ratio, &form("CF1")["answer"]["zeta"], 1e-9);
    // Type 2 without damping.
    let mut undamped = fixture_support::reference_job(2);
    for joint in ["movable_joint", "fixed_joint"] {
        undamped["fixture"][joint]["damping_n_s_per_mm"] = json!(0);
    }
    let modes = outcome(&undamped).modes;
    for (mode, want) in modes.iter().zip(form("CF2")["answer"]["fn_Hz"].as_array().unwrap()) {
        close(mode.natural_frequency_hz, want, 1e-9);
    }
    let deflection = |got: &FixtureOutcome| 500.0 / got.quasi_static.stiffness_n_per_mm;
    close(deflection(&got), &form("CF3")["answer"]["type1_mm"], 1e-12);
    close(deflection(&two), &form("CF3")["answer"]["type2_mm"], 1e-12);
    close(got.zeroth_order.mean_directional_factor, &form("CF4")["answer"]["a0"], 1e-9);
    close(got.zeroth_order.depth_min_mm.unwrap(), &form("CF4")["answer"]["H_min_mm"], 1e-6);
    let arc = &got.engagement;
    let symmetric = &form("CF5")["answer"];
    close(arc.entry_angle_deg, &symmetric["phi_st_deg"], 1e-12);
    close(arc.exit_angle_deg, &symmetric["phi_ex_deg"], 1e-12);
    close(arc.teeth_in_cut_mean, &symmetric["teeth_mean_z8"], 1e-12);
    assert_eq!((arc.teeth_in_cut_max, arc.teeth_in_cut_min), (2, 1));
    // Feed per tooth of table feed and cutting speed.
    let mut fed = base.clone();
    fed["cut"].as_object_mut().unwrap().retain(|name, _| name != "feed_mm_per_tooth" && name != "spindle_speed_rpm");
    fed["cut"]["feed_mm_per_min"] = json!(100);
    fed["cut"]["speed_m_per_min"] = json!(100);
    close(outcome(&fed).engagement.feed_mm_per_tooth, &form("CF6")["answer"]["Sz_mm"], 1e-9);
    // The force of one tooth at an angle is the extreme of a strip that ends there: it rises up to 60.5 degrees and
    // falls from there on. Twelve teeth in 30 degrees: one at a time.
    let force_n = |from_deg: f64, to_deg: f64| {
        let (from, to) = (50.0 * from_deg.to_radians().cos(), 50.0 * to_deg.to_radians().cos());
        let job = json!({
            "cutter": { "diameter_mm": 100, "teeth": 12 },
            "force": { "coefficient": 2000 },
            "cut": {
                "width_mm": from - to, "offset_mm": 0.5 * (from + to), "depth_mm": 2, "spindle_speed_rpm": 100,
                "feed_mm_per_tooth": 0.1,
            },
            "fixture": base["fixture"],
        });
        outcome(&job).quasi_static
    };
    close(force_n(30.0, 60.0).force_max_n, &form("CF7")["answer"]["phi60_N"], 1e-9);
    close(force_n(90.0, 120.0).force_max_n, &form("CF7")["answer"]["phi90_N"], 1e-9);
    close(force_n(90.0, 120.0).force_min_n, &form("CF7")["answer"]["phi120_N"], 1e-9);
    let textbook = &form("CF9")["answer"];
    let static_of = |job: &Value, toward: &str| {
        let mut job = with(job, "/cut/feed_toward", json!(toward));
        job["analyses"] = json!(["clamp_force"]);
        let got = outcome(&job);
        let peak = got.quasi_static.force_max_n.abs().max(got.quasi_static.force_min_n.abs());
        let clamp = got.clamp.unwrap();
        500.0 / peak * clamp.static_movable_n.max(clamp.static_fixed_n)
    };
    close(static_of(&base, "movable_jaw"), &textbook["type1_to_movable_N"], 1e-9);
    close(static_of(&base, "fixed_jaw"), &textbook["type1_to_fixed_N"], 1e-9);
    let two = fixture_support::reference_job(2);
    close(static_of(&two, "movable_jaw"), &textbook["type2_to_movable_N"], 1e-9);
    assert_eq!(static_of(&two, "fixed_jaw"), 0.0);
}
