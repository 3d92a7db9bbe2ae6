//! What pushes a workpiece along its jaws, and the clamp force by which friction holds it; when a cut is said to chatter.
#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, missing_docs)]

use std::f64::consts::TAU;

use crate::fixture_support::{checked, example, outcome, reference_job, said, solve, with};
use precut_calc::fixture_stability::{FixtureOutcome, FixtureState};
use serde_json::{Value, json};

fn close(have: f64, want: f64, within: f64) {
    assert!((have / want - 1.0).abs() < within, "{have}, expected {want}");
}

fn gripping(job: &Value, clamp: Value) -> Value {
    with(&with(job, "/fixture/clamp", clamp), "/analyses", json!(["clamp_force"]))
}

fn friction(low: f64) -> Value {
    json!({ "friction": { "low": low, "value": 1.5 * low, "high": 2.0 * low } })
}

/// A linear force in a full slot pushes across the feed with C H f z/4 on average, whatever the radial share is; the friction
/// of two jaws holds a steady force T from T/(2 mu) on.
#[test]
fn a_slot_pushes_across_the_feed_with_a_closed_form() {
    let mut job = reference_job(1);
    job["force"] = json!({ "coefficient": 1800, "radial_ratio": 0.4, "axial_ratio": 0.25 });
    job["cut"]["width_mm"] = job["cutter"]["diameter_mm"].clone();
    job["cut"]["offset_mm"] = json!(0);
    let got = outcome(&gripping(&job, friction(0.2)));
    let number = |pointer: &str| job.pointer(pointer).unwrap().as_f64().unwrap();
    let (teeth, depth, feed) = (number("/cutter/teeth"), number("/cut/depth_mm"), number("/cut/feed_mm_per_tooth"));
    let clamp = got.clamp.unwrap();
    let across = 1800.0 * depth * feed * teeth / 4.0;
    close(clamp.along.across_mean_n, across, 1e-9);
    // The mean of sin over the half turn is 2/pi.
    let upward = 0.25 * 1800.0 * depth * feed * teeth / TAU * 2.0;
    close(clamp.along.upward_mean_n, upward, 1e-9);
    close(clamp.slip.unwrap().against_mean_n, f64::hypot(across, upward) / 0.4, 1e-9);
}

/// Least clamp force by the cut in time: its own oscillogram of the joints, and the force across the feed of every tooth by
/// its angle.
fn by_the_cut_in_time(job: &Value, got: &FixtureOutcome, low: f64, couple: f64) -> f64 {
    let number = |pointer: &str| job.pointer(pointer).and_then(Value::as_f64).unwrap_or(0.0);
    let (teeth, depth, feed) = (number("/cutter/teeth"), number("/cut/depth_mm"), number("/cut/feed_mm_per_tooth"));
    let (k, mu) = (number("/force/chip_thickness_exponent"), number("/force/depth_exponent"));
    let (rho, axial) = (number("/force/radial_ratio"), number("/force/axial_ratio"));
    let level = number("/force/coefficient") * depth.powf(1.0 - mu) * feed.powf(1.0 - k);
    let (entry, exit) = (got.engagement.entry_angle_deg.to_radians(), got.engagement.exit_angle_deg.to_radians());
    let rad_per_s = TAU / 60.0 * got.engagement.spindle_speed_rpm;
    let steady = &got.history.as_ref().unwrap().steady;
    let direction = if job["cut"]["feed_toward"] == "fixed_jaw" { -1.0 } else { 1.0 };
    let (mut least, mut largest_off) = (0.0_f64, 0.0_f64);
    for (i, time) in steady.time_s.iter().enumerate() {
        // A tooth enters at time 0. A moment at an entry or exit belongs to either side.
        let turned = rad_per_s * time % (TAU / teeth);
        let (mut along, mut across, mut tangential) = (0.0, 0.0, 0.0);
        let mut at_an_end = false;
        let mut angle = entry + turned;
        at_an_end |= turned < 1e-6 || TAU / teeth - turned < 1e-6;
        while angle < exit + 1e-6 {
            at_an_end |= (angle - exit).abs() < 2e-2;
            let share = angle.sin().max(0.0).powf(1.0 - k);
            along += share * (angle.cos() + rho * angle.sin());
            across += share * (rho * angle.cos() - angle.sin());
            tangential += share;
            angle += TAU / teeth;
        }
        if at_an_end {
            continue;
        }
        // The angles are right: the force along the feed is the one that the cut in time has.
        largest_off = largest_off.max((direction * level * along - steady.force_n[i]).abs() / level);
        let upward = (axial * level * tangential).max(0.0);
        let pushed = (couple * (level * across).powi(2) + upward * upward).sqrt();
        least = least.max(0.5 * (pushed / low + steady.clamp_movable_n[i] + steady.clamp_fixed_n[i]));
    }
    assert!(largest_off < 5e-3, "{largest_off}");
    least
}

#[test]
fn the_force_against_slip_is_that_of_the_cut_in_time() {
    for kind in [1, 2] {
        for (low, width, offset, axial) in [(0.1, 50.0, 0.0, 0.0), (0.3, 30.0, -20.0, 0.5), (0.15, 60.0, 10.0, -0.4)] {
            let mut job = reference_job(kind);
            job["cut"]["width_mm"] = json!(width);
            job["cut"]["offset_mm"] = json!(offset);
            job["cut"]["depth_mm"] = json!(0.5 * job["cut"]["depth_mm"].as_f64().unwrap());
            job["force"]["axial_ratio"] = json!(axial);
            let mut grip = friction(low);
            grip["force_height_mm"] = json!(12.0);
            grip["jaw_length_mm"] = json!(100.0);
            grip["jaw_height_mm"] = json!(100.0);
            job = with(&gripping(&job, grip), "/analyses", json!(["clamp_force", "history"]));
            let got = outcome(&job);
            assert!(got.clamp.as_ref().unwrap().stable, "{kind} {width}");
            // A square of side s: r_e = s (sqrt 2 + asinh 1)/6.
            let r_e = 100.0 * (2.0_f64.sqrt() + 1.0_f64.asinh()) / 6.0;
            let want = by_the_cut_in_time(&job, &got, low, 1.0 + (12.0 / r_e).powi(2));
            let slip = got.clamp.unwrap().slip.unwrap();
            // The oscillogram misses the moments at entries and exits: it asks no more, and hardly less.
            assert!(slip.clamp_force_min_n > 0.995 * want, "{kind} {width}: {} {want}", slip.clamp_force_min_n);
            assert!(slip.clamp_force_min_n < 1.12 * want, "{kind} {width}: {} {want}", slip.clamp_force_min_n);
            assert!(slip.at_likely_friction_n < slip.clamp_force_min_n);
            assert!(slip.at_high_friction_n < slip.at_likely_friction_n);
        }
    }
}

/// The force that is told holds, a thousandth less does not; the friction that is needed at a force is the one at which that
/// force is the least; twice the cutting force asks twice as much.
#[test]
fn the_force_that_is_told_is_the_least() {
    for kind in [1, 2] {
        let job = gripping(&reference_job(kind), friction(0.12));
        let slip = |job: &Value| outcome(job).clamp.unwrap().slip.unwrap();
        let told = slip(&job).clamp_force_min_n;
        let at = |force: f64| solve(&with(&job, "/fixture/clamp_force_n", json!(force)));
        for (force, holds) in [(told * 1.001, true), (told * 0.999, false)] {
            let answer = at(force);
            let found = answer.output.clamp.as_ref().unwrap().slip.clone().unwrap();
            assert_eq!(found.holds, Some(holds));
            assert_eq!(answer.warnings.iter().any(|warning| warning.code == "clamp_slips"), !holds);
            let needed = found.friction_needed.unwrap();
            assert_eq!(needed < 0.12, holds, "{needed}");
            close(slip(&gripping(&job, friction(needed))).clamp_force_min_n, force, 1e-6);
        }
        let mut twice = job.clone();
        twice["force"]["coefficient"] = json!(2.0 * job["force"]["coefficient"].as_f64().unwrap());
        // Twice the force and the same speed: the multiplier changes, the forced motion is proportional.
        if let Some(slip) = outcome(&twice).clamp.unwrap().slip {
            close(slip.clamp_force_min_n, 2.0 * told, 1e-9);
        }
        // The depth at which the given force slips is the one that asks for it.
        let given = with(&job, "/fixture/clamp_force_n", json!(0.4 * told));
        let limits = outcome(&with(&given, "/analyses", json!(["limits"]))).limits.unwrap();
        let depth = limits.slips_mm.unwrap();
        let there = with(&given, "/cut/depth_mm", json!(depth));
        close(slip(&there).clamp_force_min_n, 0.4 * told, 1e-6);
    }
}

#[test]
fn what_is_said_of_friction_fits_what_is_known_of_it() {
    let without = solve(&with(&reference_job(1), "/analyses", json!(["clamp_force"])));
    assert!(
        said(&without, "clamp_force_slip_unknown").is_some() && said(&without, "clamp_force_against_slip").is_none()
    );
    assert!(without.output.clamp.as_ref().unwrap().slip.is_none());
    let stated = solve(&gripping(&reference_job(1), friction(0.12)));
    assert!(said(&stated, "clamp_force_slip_unknown").is_none() && said(&stated, "clamp_force_against_slip").is_some());
    let warned = |answer: &precut_calc::calculator::Answer<FixtureOutcome>| {
        answer.warnings.iter().any(|warning| warning.code == "friction_assumed")
    };
    assert!(!warned(&stated) && !warned(&without));
    assert!(warned(&solve(&gripping(&reference_job(1), json!({})))));
    let faults = |clamp: Value| checked(&gripping(&reference_job(1), clamp)).unwrap_err();
    assert_eq!(faults(json!({ "friction": { "low": 0.2, "value": 0.1, "high": 0.3 } }))[0].0, "frictions_unordered");
    let (code, pointer) = &faults(json!({ "force_height_mm": 5, "jaw_length_mm": 80 }))[0];
    assert_eq!((code.as_str(), pointer.as_str()), ("jaw_face_missing", "/fixture/clamp/jaw_height_mm"));
}

/// A cut whose disturbances decay is stable however slowly they do, and says how long it takes; one whose disturbances grow
/// chatters.
#[test]
fn chatter_is_said_where_a_disturbance_grows() {
    for kind in [1, 2] {
        let job = reference_job(kind);
        let limit = outcome(&job).chatter_depth_mm.unwrap();
        for (share, state) in [(0.9995, FixtureState::Stable), (1.002, FixtureState::Chatter)] {
            let mut near = with(&job, "/cut/depth_mm", json!(share * limit));
            near["fixture"].as_object_mut().unwrap().remove("clamp_force_n");
            let answer = solve(&near);
            let got = &answer.output;
            let modulus = got.multiplier.modulus;
            assert_eq!(got.verdict.state, state, "{kind} {share}: {modulus}");
            let tau = 1.0 / got.engagement.tooth_frequency_hz;
            let settles = (modulus < 1.0).then(|| 1e-3_f64.ln() / modulus.ln() * tau);
            assert_eq!(got.multiplier.settling_time_s.is_some(), settles.is_some());
            if let (Some(have), Some(want)) = (got.multiplier.settling_time_s, settles) {
                close(have, want, 1e-9);
                let slowly = said(&answer, "fixture_settles_slowly").is_some();
                assert_eq!(slowly, !got.simulation.as_ref().unwrap().settled, "{kind} {share}: {modulus}");
            }
            let code = if state == FixtureState::Stable { "fixture_stable" } else { "fixture_chatters" };
            assert_eq!(answer.explanation[0].code, code);
        }
    }
}

/// A number in another unit is warned of with the unit that was likely meant; the job as it was meant is not.
#[test]
fn another_unit_is_likely_meant() {
    let likely = |job: &Value| -> Vec<String> {
        let answer = solve(job);
        let found = answer.warnings.iter().filter(|warning| warning.code == "implausible_unit");
        found.map(|warning| format!("{:?}", warning.values.get("likely"))).collect()
    };
    let scaled = |pointers: &[&str], factor: f64| {
        let mut job = with(&example("paper"), "/analyses", json!(["verdict"]));
        for pointer in pointers {
            let value = job.pointer(pointer).unwrap().as_f64().unwrap();
            job = with(&job, pointer, json!(value * factor));
        }
        job
    };
    assert_eq!(likely(&scaled(&[], 1.0)), [""; 0]);
    let stiffness = ["/fixture/movable_joint/stiffness_n_per_mm", "/fixture/fixed_joint/stiffness_n_per_mm"];
    let damping = ["/fixture/movable_joint/damping_n_s_per_mm", "/fixture/fixed_joint/damping_n_s_per_mm"];
    for (pointers, factor, meant) in [
        (&stiffness[..], 1e-3, "stiffness_n_per_um"),
        (&damping[..], 1e3, "damping_n_s_per_m"),
        (&["/force/coefficient"][..], 1e-3, "coefficient_gpa"),
        (&["/cut/feed_mm_per_tooth"][..], 1e3 / 4.0, "feed_um"),
        (&["/fixture/clamp_force_n"][..], 1e-3, "force_kn"),
    ] {
        let found = likely(&scaled(pointers, factor));
        assert!(found.iter().any(|found| found.contains(meant)), "{meant}: {found:?}");
    }
}

/// A workpiece that swings further than the engagement stays the same is no number to act on.
#[test]
fn a_motion_beyond_the_model_is_no_fact() {
    let soft = with(&example("paper"), "/analyses", json!(["verdict"]));
    let beyond = |job: &Value| {
        let answer = solve(job);
        let warned = answer.warnings.iter().any(|warning| warning.code == "motion_beyond_model");
        let told = answer.explanation[0].values.get("peak_to_peak_um").is_some();
        let swing_mm = 1e-3 * answer.output.verdict.peak_to_peak_um;
        (warned, told, swing_mm)
    };
    let (warned, told, swing_mm) = beyond(&soft);
    assert!(!warned && told && swing_mm < 10.0);
    let mut soft = soft;
    for joint in ["movable_joint", "fixed_joint"] {
        soft["fixture"][joint] = json!({ "stiffness_n_per_mm": 10.0, "damping_n_s_per_mm": 0.5 });
    }
    soft["fixture"].as_object_mut().unwrap().remove("clamp_force_n");
    let (warned, told, swing_mm) = beyond(&soft);
    assert_eq!((warned, told), (swing_mm > 10.0, swing_mm <= 10.0), "{swing_mm}");
}
