//! What fixture stability decides, done: random cuts followed in time by a programme of its own, which knows nothing of multipliers,
//! forced motions or exact steps. `PRECUT_TRIALS` of them, a few where that is not said.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole numbers of some hundreds

use std::f64::consts::TAU;

use precut_calc::fixture_stability::{FixtureOutcome, FixtureState};
use precut_calc::num::stats::Resampler;
use serde_json::{Value, json};

use crate::fixture_support::{outcome, with};
use crate::milling_answers::trials;

/// Moduli so near to 1 take more teeth to decide than are followed.
const UNDECIDED: f64 = 0.03;
/// Steps of an oscillation, and of a tooth at least: the arc is cut off at whole steps.
const STEPS: f64 = 600.0;
const STEPS_OF_TOOTH: f64 = 2400.0;

fn number(job: &Value, pointer: &str) -> f64 {
    job.pointer(pointer).and_then(Value::as_f64).unwrap_or(0.0)
}

/// A cut of any size, near its limit on either side.
fn drawn(seed: u64) -> Value {
    let mut draw = Resampler::new(seed, 34);
    let mut between = |low: f64, high: f64| low + (high - low) * draw.uniform();
    let diameter = between(20.0, 120.0);
    let width = diameter * between(0.2, 0.95);
    let [movable, fixed] = [0, 1].map(|_| between(3e3, 3e4));
    let mass = between(1.0, 8.0);
    let teeth = between(2.0, 9.0).floor();
    let is_pneumatic = between(0.0, 1.0) < 0.35;
    let rate = (1e3 * (movable + fixed) / mass).sqrt();
    let damping = between(0.02, 0.16) * mass * rate / 1e3;
    let share = between(0.3, 0.7);
    let oscillations = between(0.7, 9.0);
    let exponent = if between(0.0, 1.0) < 0.5 { 0.0 } else { between(0.1, 0.35) };
    let mut fixture = json!({
        "kind": if is_pneumatic { "constant_force" } else { "self_locking" },
        "workpiece_mass_kg": mass,
        "movable_joint": { "stiffness_n_per_mm": movable, "damping_n_s_per_mm": share * damping },
        "fixed_joint": { "stiffness_n_per_mm": fixed, "damping_n_s_per_mm": (1.0 - share) * damping },
    });
    if is_pneumatic {
        fixture["jaw_mass_kg"] = json!(mass * between(0.1, 0.6));
    }
    let job = json!({
        "cutter": { "diameter_mm": diameter, "teeth": teeth as u32 },
        "force": { "coefficient": between(500.0, 2500.0), "chip_thickness_exponent": exponent, "radial_ratio": between(0.2, 0.8) },
        "cut": {
            "width_mm": width, "offset_mm": 0.5 * (diameter - width) * between(-1.0, 1.0), "depth_mm": 0.01,
            "spindle_speed_rpm": 60.0 * rate / TAU / (oscillations * teeth), "feed_mm_per_tooth": between(0.05, 0.2),
            "feed_toward": if between(0.0, 1.0) < 0.5 { "movable_jaw" } else { "fixed_jaw" },
        },
        "fixture": fixture,
    });
    let near = between(0.4, 1.6);
    let known = outcome(&job);
    let limit = known.chatter_depth_mm.unwrap_or(0.5 * known.depth_examined_mm);
    with(&job, "/cut/depth_mm", json!(near * limit))
}

/// What a cut does, followed step by step over what every tooth leaves.
struct Followed {
    /// Scatter of the displacement from tooth to tooth over the last quarter, over the feed per tooth.
    scatter: f64,
    /// What the joints ask of the clamp force in the last quarter, with their damping.
    asked_n: f64,
    /// Whether a joint lost its elastic force at any time.
    opened: bool,
}

/// Follows a job for so many teeth, its joints bonded or pressed with a clamp force.
fn followed(job: &Value, clamp_force_n: Option<f64>, periods: usize) -> Followed {
    let [diameter, teeth, width, offset] =
        ["/cutter/diameter_mm", "/cutter/teeth", "/cut/width_mm", "/cut/offset_mm"].map(|at| number(job, at));
    let [level, k, rho] =
        ["/force/coefficient", "/force/chip_thickness_exponent", "/force/radial_ratio"].map(|at| number(job, at));
    let [depth, rpm, feed] =
        ["/cut/depth_mm", "/cut/spindle_speed_rpm", "/cut/feed_mm_per_tooth"].map(|at| number(job, at));
    let toward = if job["cut"]["feed_toward"] == "movable_jaw" { 1.0 } else { -1.0 };
    let joint = |name: &str| {
        ["stiffness_n_per_mm", "damping_n_s_per_mm"].map(|what| number(job, &format!("/fixture/{name}_joint/{what}")))
    };
    let ([c1, l1], [c2, l2]) = (joint("movable"), joint("fixed"));
    // Inside N, mm, s: masses in t.
    let [mass, jaw] = ["/fixture/workpiece_mass_kg", "/fixture/jaw_mass_kg"].map(|at| number(job, at) / 1e3);
    let fastest = ((c1 + c2) / mass).max(if jaw > 0.0 { (c1 / jaw) + c1 / mass } else { 0.0 }).sqrt();
    let period = 60.0 / (rpm * teeth);
    let steps = (STEPS * fastest * period / TAU).ceil().max(STEPS_OF_TOOTH) as usize;
    let dt = period / steps as f64;
    let (entry, exit) =
        (((2.0 * offset + width) / diameter).min(1.0).acos(), ((2.0 * offset - width) / diameter).max(-1.0).acos());
    let step_rad = TAU / teeth / steps as f64;
    let arc = ((exit - entry) / step_rad).round() as usize;
    let shape: Vec<f64> = (0..arc)
        .map(|i| entry + i as f64 * step_rad)
        .map(|angle| level * depth * angle.sin().max(0.0).powf(1.0 - k) * (angle.cos() + rho * angle.sin()))
        .collect();
    // How far material is removed at every angle, mm along the feed.
    let mut removed: Vec<f64> = (0..arc).map(|i| feed * ((i % steps) as f64 / steps as f64 - 1.0)).collect();
    let (mut x, mut v, mut x3, mut v3) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let mut seen = Followed { scatter: 0.0, asked_n: f64::NEG_INFINITY, opened: false };
    let mut samples = Vec::with_capacity(periods);
    let late = periods - periods / 4;
    let pressed = |elastic: f64, viscous: f64| match clamp_force_n {
        None => elastic + viscous,
        Some(force) if force + elastic <= 0.0 => -force,
        Some(force) => (elastic + viscous).max(-force),
    };
    for n in 0..periods {
        for step in 0..steps {
            let at_feed = feed * (n as f64 + step as f64 / steps as f64) - toward * x;
            let mut force = 0.0;
            let mut place = step;
            while place < arc {
                let chip = at_feed - removed[place];
                if chip > 0.0 {
                    force += shape[place] * chip.powf(1.0 - k);
                    removed[place] = at_feed;
                }
                place += steps;
            }
            // What the motion adds to the force of either joint.
            let joints =
                |x: f64, v: f64, x3: f64, v3: f64| (pressed(c1 * (x - x3), l1 * (v - v3)), pressed(-c2 * x, -l2 * v));
            let rates = |x: f64, v: f64, x3: f64, v3: f64| {
                let (left, right) = joints(x, v, x3, v3);
                ((toward * force - left + right) / mass, if jaw > 0.0 { left / jaw } else { 0.0 })
            };
            if clamp_force_n.is_some_and(|force| force + c1 * (x - x3) <= 0.0 || force - c2 * x <= 0.0) {
                seen.opened = true;
            }
            if n >= late {
                let (left, right) = joints(x, v, x3, v3);
                seen.asked_n = seen.asked_n.max(-left).max(-right);
            }
            // The middle of a step by half a step, the whole by the middle.
            let (a, a3) = rates(x, v, x3, v3);
            let (xm, vm, x3m, v3m) = (x + 0.5 * dt * v, v + 0.5 * dt * a, x3 + 0.5 * dt * v3, v3 + 0.5 * dt * a3);
            let (am, a3m) = rates(xm, vm, x3m, v3m);
            (x, v, x3, v3) = (x + dt * vm, v + dt * am, x3 + dt * v3m, v3 + dt * a3m);
        }
        samples.push(x);
        if x.abs() > 20.0 {
            seen.scatter = f64::INFINITY;
            return seen;
        }
    }
    let last = &samples[late..];
    let mean = last.iter().sum::<f64>() / last.len() as f64;
    seen.scatter = last.iter().map(|x| (x - mean).abs()).fold(0.0, f64::max) / feed;
    seen
}

/// Teeth after which a disturbance has decayed or grown by e^12.
fn teeth(got: &FixtureOutcome) -> usize {
    ((12.0 / got.multiplier.modulus.ln().abs()).ceil() as usize).clamp(60, 4000)
}

/// Stable cuts settle in time, chattering ones do not; a clamp force one percent above what is told holds both joints, and the steady
/// motion asks for more than one percent less.
#[test]
fn verdicts_and_clamp_forces_are_those_of_the_cut_in_time() {
    let (mut judged, mut clamped) = (0, 0);
    for seed in 0..trials(6) as u64 {
        let mut job = drawn(seed);
        job["analyses"] = json!(["verdict", "clamp_force"]);
        let got = outcome(&job);
        let modulus = got.multiplier.modulus;
        if (modulus - 1.0).abs() < UNDECIDED {
            continue;
        }
        let periods = teeth(&got);
        let run = followed(&job, None, periods);
        let (settled, is_stable) = (run.scatter < 0.02, got.verdict.state != FixtureState::Chatter);
        assert_eq!(settled, is_stable, "{seed}: scatter {} with {modulus}, {:?}: {job}", run.scatter, got.verdict);
        judged += 1;
        let clamp = got.clamp.unwrap();
        let Some(least) = clamp.least_n.filter(|least| is_stable && *least > 1.0) else { continue };
        assert!(run.asked_n < 1.01 * least && run.asked_n > 0.99 * least, "{seed}: {} {least}: {job}", run.asked_n);
        let entry = clamp.least_with_entry_n.unwrap();
        let held = followed(&job, Some(1.01 * entry), periods);
        assert!(!held.opened && held.scatter < 0.02, "{seed}: {entry}: {job}");
        clamped += 1;
    }
    assert!(judged > 0 && clamped > 0, "{judged} {clamped}");
    println!("{judged} verdicts and {clamped} clamp forces followed in time");
}

/// A better speed, set as it is read: the cut is stable there and a tenth short of chatter, moves by no more than it is fed, removes
/// what is told, and settles in time.
#[test]
fn better_speeds_hold_where_they_are_set() {
    let mut tried = 0;
    for seed in 0..trials(3) as u64 {
        let mut job = drawn(1000 + seed);
        job["analyses"] = json!(["lobes"]);
        job["lobes"] = json!({ "speeds": 24 });
        let lobes = outcome(&job).lobes.unwrap();
        for better in &lobes.better_speeds {
            let mut there = with(&job, "/cut/spindle_speed_rpm", json!(better.spindle_speed_rpm));
            there["cut"]["depth_mm"] = json!(better.depth_mm);
            there["analyses"] = json!(["verdict"]);
            let got = outcome(&there);
            assert_eq!(got.verdict.state, FixtureState::Stable, "{seed}: {better:?}: {there}");
            let limit = got.chatter_depth_mm.unwrap_or(f64::INFINITY);
            assert!(better.depth_mm <= 0.9 * limit * (1.0 + 1e-6), "{seed}: {better:?} {limit}: {there}");
            assert!(got.verdict.peak_to_peak_over_feed <= 1.0, "{seed}: {:?}", got.verdict);
            let removed = got.engagement.removal_rate_cm3_per_min;
            assert!((removed / better.removal_rate_cm3_per_min - 1.0).abs() < 1e-9, "{seed}: {removed} {better:?}");
            let run = followed(&there, None, teeth(&got));
            assert!(run.scatter < 0.02, "{seed}: {} {better:?}: {there}", run.scatter);
            // What has not settled yet moves by the scatter, and the joints with it.
            let stiffest =
                ["movable", "fixed"].map(|at| number(&job, &format!("/fixture/{at}_joint/stiffness_n_per_mm")));
            let unsettled_n = run.scatter * number(&job, "/cut/feed_mm_per_tooth") * stiffest[0].max(stiffest[1]);
            let most_n = 1.01 * better.clamp_force_n + 1.0 + unsettled_n;
            assert!(run.asked_n < most_n, "{seed}: {} {most_n} {}: {better:?}: {there}", run.asked_n, run.scatter);
            tried += 1;
        }
    }
    println!("{tried} better speeds tried");
    assert!(tried > 0);
}
