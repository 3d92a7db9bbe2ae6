//! The clamp force that a milled part asks for: what is told of it is done, against cuts put together here.
#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, missing_docs)]

use std::f64::consts::TAU;

use precut_calc::calculator::Value as Said;
use precut_calc::clamping::{Contact, Fixture, Load, Rest, Vector, Vise};
use precut_calc::milling_stability::{ClampRemedyKind, ClampingStatus, MillingState};
use precut_calc::num::stats::Resampler;
use serde_json::{Value, json};

use crate::milling_answers::{Told, example, faults, merged, solve, trials};

fn number(job: &Value, pointer: &str) -> f64 {
    job.pointer(pointer).and_then(Value::as_f64).unwrap_or(0.0)
}

fn with_force(job: &Value, force_n: f64) -> Value {
    merged(job.clone(), &json!({ "clamping": { "vise": { "clamp_force_n": force_n } } }))
}

fn status(job: &Value) -> ClampingStatus {
    solve(job).outcome.clamping.unwrap().status
}

fn said(told: &Told, code: &str, name: &str) -> f64 {
    let message = told.said.iter().find(|message| message.code == code).unwrap();
    match message.values.get(name) {
        Some(Said::Number(number)) => *number,
        other => panic!("{code} {name}: {other:?}"),
    }
}

fn close(have: f64, want: f64, within: f64, what: &str) {
    assert!((have / want - 1.0).abs() < within, "{what}: {have}, expected {want}");
}

/// A slot without radial force pushes across the feed alone on average, with K H f z/4: by hand friction mu of two jaws holds a
/// force T along them at their middle from T/(2 mu) on.
#[test]
fn the_mean_force_across_the_feed_is_held_as_by_hand() {
    let job = json!({
        "cutter": { "diameter_mm": 20, "teeth": 2 },
        "force": { "kind": "mechanistic", "tangential_n_per_mm2": 2030 },
        "cut": { "spindle_speed_rpm": 3000, "depth_mm": 2, "width_mm": 20, "feed_mm_per_tooth": 0.2, "feed_direction_deg": 90 },
        "tool": { "kind": "rigid" }, "work": { "kind": "rigid" },
        "clamping": { "vise": { "jaw_length_mm": 100, "jaw_height_mm": 30, "part_width_mm": 60,
                                "friction": { "low": 0.2, "value": 0.25, "high": 0.4 } },
                      "cut_point_mm": [0, 0, 15], "stations": [{ "x_mm": 0, "y_mm": 0, "z_mm": 15 }] },
        "analyses": ["clamping"]
    });
    let told = solve(&job);
    close(told.outcome.force.work.y_mean_n.abs(), 406.0, 1e-9, "across the feed");
    let clamping = told.outcome.clamping.as_ref().unwrap();
    close(clamping.against_mean_n.unwrap(), 1015.0, 1e-9, "by the mean");
    assert!(clamping.certain_slip_by_mean_n.unwrap() <= 1015.0 * (1.0 + 1e-7));
    close(clamping.dynamic_factor.unwrap(), 1.0, 1e-15, "rigid");
    assert_eq!(clamping.status, ClampingStatus::NoForceGiven);
    close(said(&told, "clamping_holds_from", "by_mean_n"), 1015.0, 1e-9, "said");
    // Twice the safety, twice the force, and as a mean along the jaws at half the friction.
    let safe = merged(job.clone(), &json!({ "clamping": { "safety": 2 } }));
    let twice = solve(&safe).outcome.clamping.unwrap();
    close(twice.against_mean_n.unwrap(), 2030.0, 1e-9, "safety");
    close(twice.clamp_force_min_n.unwrap(), 2.0 * clamping.clamp_force_min_n.unwrap(), 1e-9, "safety");
    // At any speed, however slow.
    let slow = merged(job, &json!({ "cut": { "spindle_speed_rpm": 0.1 } }));
    let slow = solve(&slow).outcome.clamping.unwrap();
    close(slow.clamp_force_min_n.unwrap(), clamping.clamp_force_min_n.unwrap(), 1e-9, "slow");
}

/// Force on the workpiece at a rotation, in the axes of the cut: slices of every edge, by its angle and chip.
fn on_work(job: &Value, rotation: f64) -> Vector {
    const SLICES: u32 = 400;
    let of = |name: &str| number(job, &format!("/force/{name}"));
    let (teeth, radius) = (number(job, "/cutter/teeth"), 0.5 * number(job, "/cutter/diameter_mm"));
    let (entry, exit) = (number(job, "/cut/entry_deg").to_radians(), number(job, "/cut/exit_deg").to_radians());
    let (depth, feed) = (number(job, "/cut/depth_mm"), number(job, "/cut/feed_mm_per_tooth"));
    let lag = number(job, "/cutter/helix_angle_deg").to_radians().tan() / radius;
    let law = ["tangential", "radial", "axial"]
        .map(|name| [of(&format!("{name}_edge_n_per_mm")), of(&format!("{name}_n_per_mm2"))]);
    let mut sum = [0.0; 3];
    let mut tooth = 0.0;
    while tooth < teeth {
        for slice in 0..SLICES {
            let height = depth * (f64::from(slice) + 0.5) / f64::from(SLICES);
            let phi = (rotation - tooth * TAU / teeth - lag * height).rem_euclid(TAU);
            if phi > entry && phi < exit {
                let (s, c) = phi.sin_cos();
                let [t, r, a] = law.map(|[edge, cutting]| (edge + cutting * feed * s) * depth / f64::from(SLICES));
                // The tool is pushed by -t e_t - r e_r, the workpiece the other way; a lifts it.
                sum[0] += t * c + r * s;
                sum[1] += r * c - t * s;
                sum[2] += a;
            }
        }
        tooth += 1.0;
    }
    sum
}

/// The vise of a job, its friction, and the loads of many instants at every place of the cut.
fn held_and_loads(job: &Value, instants: u32) -> (Fixture, f64, Vec<Load>) {
    let of = |name: &str| number(job, &format!("/clamping/vise/{name}"));
    let flag = |name: &str| job.pointer(&format!("/clamping/vise/{name}")).and_then(Value::as_bool);
    let fixture = Vise {
        jaw_length_mm: of("jaw_length_mm"),
        jaw_height_mm: of("jaw_height_mm"),
        part_width_mm: of("part_width_mm"),
        parallels: flag("parallels").unwrap_or(true),
        friction: 0.0,
        constant_force: flag("constant_force").unwrap_or(false),
        weight_n: 9.806_65 * number(job, "/clamping/part_mass_kg"),
        centre_of_mass_mm: [0, 1, 2].map(|i| number(job, &format!("/clamping/centre_of_mass_mm/{i}"))),
    }
    .fixture();
    let mut points = vec![[0, 1, 2].map(|i| number(job, &format!("/clamping/cut_point_mm/{i}")))];
    for station in job["clamping"]["stations"].as_array().unwrap_or(&Vec::new()) {
        points.push(["x_mm", "y_mm", "z_mm"].map(|name| station[name].as_f64().unwrap()));
    }
    let (sin, cos) = number(job, "/cut/feed_direction_deg").to_radians().sin_cos();
    let pitch = TAU / number(job, "/cutter/teeth");
    let loads = (0..instants).flat_map(|k| {
        let [x, y, z] = on_work(job, pitch * f64::from(k) / f64::from(instants));
        let force_n = [x * cos - y * sin, x * sin + y * cos, z];
        points.iter().map(move |point| Load { force_n, point_mm: *point }).collect::<Vec<_>>()
    });
    let loads = loads.collect();
    (fixture, number(job, "/clamping/vise/friction/low"), loads)
}

/// How much more friction than there is a contact uses at most under a clamp force; infinite where one opens.
fn overused(fixture: &Fixture, friction: f64, loads: &[Load], force_n: f64) -> f64 {
    let rest = Rest::of(fixture).unwrap();
    let mut most: f64 = 0.0;
    for of in rest.loaded(fixture, loads, 1.0).unwrap() {
        for (i, share) in rest.shares.iter().enumerate().filter(|(_, share)| **share > 0.0) {
            let normal = share * force_n + rest.by_weight_n[i] + of.normal_n[i];
            let along = of.tangential[i].iter().map(|t| t * t).sum::<f64>().sqrt();
            most = most.max(if normal > 0.0 { along / (friction * normal) } else { f64::INFINITY });
        }
    }
    most
}

/// A clamped cut drawn at random.
fn drawn(seed: u64) -> Value {
    let mut draw = Resampler::new(seed, 21);
    let mut next = |low: f64, high: f64| low + (high - low) * draw.uniform();
    let teeth = next(1.0, 6.99).floor();
    let entry = next(0.0, 120.0);
    let (length, height, width) = (next(60.0, 150.0), next(12.0, 50.0), next(25.0, 120.0));
    let low = next(0.08, 0.3);
    let mut place = || json!([next(-0.5, 0.5) * length, next(-0.5, 0.5) * width, height + next(-5.0, 30.0)]);
    let (first, second) = (place(), place());
    json!({
        "cutter": { "diameter_mm": next(8.0, 50.0), "teeth": teeth as u32, "helix_angle_deg": next(0.0, 45.0) },
        "force": { "kind": "mechanistic", "tangential_n_per_mm2": next(500.0, 2500.0), "radial_n_per_mm2": next(100.0, 1200.0),
                   "axial_n_per_mm2": next(-200.0, 600.0), "tangential_edge_n_per_mm": next(0.0, 30.0) },
        "cut": { "entry_deg": entry, "exit_deg": entry + next(15.0, 60.0), "depth_mm": next(0.5, 8.0), "spindle_speed_rpm": 4000,
                 "feed_mm_per_tooth": next(0.03, 0.25), "feed_direction_deg": next(-180.0, 180.0) },
        "tool": { "kind": "rigid" }, "work": { "kind": "rigid" },
        "clamping": {
            "vise": { "jaw_length_mm": length, "jaw_height_mm": height, "part_width_mm": width,
                      "parallels": next(0.0, 1.0) < 0.7, "constant_force": next(0.0, 1.0) < 0.5,
                      "friction": { "low": low, "value": 1.2 * low, "high": 1.5 * low } },
            "cut_point_mm": first, "stations": [{ "x_mm": second[0], "y_mm": second[1], "z_mm": second[2] }],
            "part_mass_kg": next(0.0, 8.0), "centre_of_mass_mm": [0.0, 0.0, 0.5 * height]
        },
        "analyses": ["clamping"]
    })
}

/// Clamped with the force that is told no contact uses more than its friction at any instant; with a hundredth less one does.
#[test]
fn the_clamp_force_that_is_told_holds_and_a_hundredth_less_does_not() {
    for seed in 0..trials(5) as u64 {
        let job = drawn(seed);
        let told = solve(&job);
        let clamping = told.outcome.clamping.as_ref().unwrap();
        let least = clamping.clamp_force_min_n.unwrap();
        let (fixture, friction, loads) = held_and_loads(&job, 180);
        let (at, short) =
            (overused(&fixture, friction, &loads, least), overused(&fixture, friction, &loads, 0.99 * least));
        // Slices miss an entry by one of 400, instants a maximum by one of 180.
        assert!(at < 1.0 + 4e-3 && short > 1.0 + 1e-4, "{seed}: {at} {short} at {least} N of {job}");
        // What is printed is enough, too, and what is told of a force at hand is so.
        let printed = said(&told, "clamping_holds_from", "least_n");
        assert!(printed >= least && printed < 1.002 * least, "{printed} {least}");
        for (force, holds) in [(least, true), (printed, true), (0.99 * least, false)] {
            let told = solve(&with_force(&job, force));
            let clamping = told.outcome.clamping.as_ref().unwrap();
            assert_eq!(clamping.status == ClampingStatus::Holds, holds, "{seed} {force}: {:?}", clamping.status);
            assert_eq!(told.warns("clamp_force_short"), !holds);
            let safety = clamping.clamp_safety.unwrap();
            assert!(if holds { safety > 1.0 - 1e-6 } else { safety < 1.0 }, "{seed}: {safety}");
            if let Some(certain) = clamping.certain_slip_below_n {
                assert!(certain <= least * (1.0 + 1e-6), "{seed}: {certain} {least}");
            }
        }
        // The friction that is needed at a force holds it, everywhere, and hardly less does not.
        let needed = solve(&with_force(&job, 1.5 * least)).outcome.clamping.unwrap().friction_needed.unwrap();
        let rough = |mu: f64| {
            let friction = json!({ "low": mu, "value": mu, "high": mu });
            status(&with_force(
                &merged(job.clone(), &json!({ "clamping": { "vise": { "friction": friction } } })),
                1.5 * least,
            ))
        };
        assert!(
            needed < 2.0
                && rough(1.001 * needed) == ClampingStatus::Holds
                && rough(0.99 * needed) != ClampingStatus::Holds
        );
    }
}

/// What the spring and damper of a work carry is that of the cut in time.
#[test]
fn the_force_on_a_work_that_swings_is_that_of_the_cut_in_time() {
    let straight = json!({
        "cutter": { "diameter_mm": 20, "teeth": 3, "helix_angle_deg": 0 },
        "force": { "tangential_n_per_mm2": 1500, "radial_n_per_mm2": 600, "axial_n_per_mm2": 200, "tangential_edge_n_per_mm": 20 },
        "cut": { "entry_deg": 30, "exit_deg": 85, "depth_mm": 1, "feed_mm_per_tooth": 0.1, "feed_direction_deg": 0 }
    });
    let mut job = merged(drawn(3), &straight);
    for (frequency, ratio, direction) in
        [(90.0, 0.05, [0.0, 1.0, 0.0]), (700.0, 0.04, [0.6, 0.8, 0.0]), (5000.0, 0.1, [1.0, 0.0, 0.0])]
    {
        let (stiffness, teeth) = (40_000.0, number(&job, "/cutter/teeth"));
        job["work"] = json!({ "kind": "modes", "modes": [
            { "direction": direction, "frequency_hz": frequency, "damping_ratio": ratio, "stiffness_n_per_mm": stiffness }] });
        let told = solve(&job).outcome.clamping.unwrap();
        let (w, period) = (TAU * frequency, 60.0 / (4000.0 * teeth));
        let push = |t: f64| {
            let force = on_work(&job, TAU * 4000.0 / 60.0 * t);
            (0..3).map(|q| force[q] * direction[q]).sum::<f64>()
        };
        // q in the unit of a force: its stiffness times the displacement.
        let (mut q, mut v): (f64, f64) = (0.0, 0.0);
        let steps = 3000;
        let h = period / f64::from(steps);
        let rate = |q: f64, v: f64, f: f64| w * w * (f - q) - 2.0 * ratio * w * v;
        let table: Vec<f64> = (0..=2 * steps).map(|k| push(0.5 * h * f64::from(k))).collect();
        // Largest just inside an entry or exit, where no step falls.
        let [entry, exit] = ["/cut/entry_deg", "/cut/exit_deg"].map(|name| number(&job, name).to_radians());
        let inside = [entry + 1e-9, exit - 1e-9].map(|angle| push(angle / (TAU * 4000.0 / 60.0)).abs());
        let (mut peak, mut still) = (0.0_f64, inside[0].max(inside[1]));
        let periods = (20.0 / (ratio * w * period)).ceil() as u32 + 1;
        for round in 0..periods {
            for k in 0..steps as usize {
                let [a, b, c] = [table[2 * k], table[2 * k + 1], table[2 * k + 2]];
                let (k1, l1) = (v, rate(q, v, a));
                let (k2, l2) = (v + 0.5 * h * l1, rate(q + 0.5 * h * k1, v + 0.5 * h * l1, b));
                let (k3, l3) = (v + 0.5 * h * l2, rate(q + 0.5 * h * k2, v + 0.5 * h * l2, b));
                let (k4, l4) = (v + h * l3, rate(q + h * k3, v + h * l3, c));
                q += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
                v += h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
                if round + 1 == periods {
                    peak = peak.max((q + 2.0 * ratio / w * v).abs());
                    still = still.max(a.abs());
                }
            }
        }
        // Steps meet an entry to one of 3000.
        close(told.dynamic_factor.unwrap(), peak / still, 4e-3, "dynamic factor");
    }
    // A stiff work carries the static force, and a rigid one of the same job asks as much.
    job["work"]["modes"][0]["frequency_hz"] = json!(19_000);
    job["work"]["modes"][0]["damping_ratio"] = json!(0.7);
    let stiff = solve(&job).outcome.clamping.unwrap();
    job["work"] = json!({ "kind": "rigid" });
    close(
        stiff.clamp_force_min_n.unwrap(),
        solve(&job).outcome.clamping.unwrap().clamp_force_min_n.unwrap(),
        0.1,
        "stiff",
    );
}

#[test]
fn a_part_that_no_force_holds_is_told_with_what_would_and_that_is_done() {
    let point = |side: f64, share: f64| json!({ "position_mm": [0, 30.0 * side, 0], "normal": [0, -side, 0], "clamp_share": share });
    let job = merged(
        example("clamped"),
        &json!({
            "clamping": { "vise": null, "cut_point_mm": [0, 0, 25], "stations": null, "part_mass_kg": 0, "contacts": {
                "points": [point(1.0, 1.0), point(-1.0, 0.0)], "friction": { "low": 0.2, "value": 0.25, "high": 0.3 } } }
        }),
    );
    let told = solve(&job);
    let clamping = told.outcome.clamping.as_ref().unwrap();
    assert_eq!((clamping.status, clamping.clamp_force_min_n), (ClampingStatus::CannotHold, None));
    assert_eq!(told.outcome.verdict.as_ref().unwrap().state, MillingState::Slips);
    assert!(told.says("clamping_cannot_hold") && told.says("milling_slips") && !told.says("clamping_holds_from"));
    let remedy = clamping.remedy.unwrap();
    let (at, normal) = ([remedy.x_mm, remedy.y_mm, remedy.z_mm], [remedy.normal_x, remedy.normal_y, remedy.normal_z]);
    let mut mended = job.clone();
    let points = mended["clamping"]["contacts"]["points"].as_array_mut().unwrap();
    let share = f64::from(u8::from(remedy.kind == ClampRemedyKind::SecondPair));
    points.push(json!({ "position_mm": at, "normal": normal, "clamp_share": share }));
    if let Some(apart) = remedy.apart_mm {
        let opposite: Vector = std::array::from_fn(|q| at[q] + apart * normal[q]);
        points.push(json!({ "position_mm": opposite, "normal": normal.map(|x| -x) }));
    }
    let done = solve(&mended).outcome.clamping.unwrap();
    close(done.clamp_force_min_n.unwrap(), remedy.clamp_force_min_n, 1e-6, "with the remedy");
    mended["clamping"]["contacts"]["clamp_force_n"] = json!(said(&told, "clamping_cannot_hold", "least_n"));
    assert_eq!(status(&mended), ClampingStatus::Holds);
}

/// States by what hurts first: chatter, then what slips or opens, then what lifts; never chatter of a multiplier below 1.
#[test]
fn the_state_is_what_hurts_first() {
    let job = example("clamped");
    let told = solve(&job);
    let clamping = told.outcome.clamping.as_ref().unwrap();
    let (least, certain) = (clamping.clamp_force_min_n.unwrap(), clamping.certain_slip_below_n.unwrap());
    assert!(certain < 0.99 * least && told.says("clamping_certain_slip"), "{certain} {least}");
    let state = |job: &Value| {
        let outcome = solve(job).outcome;
        (outcome.verdict.unwrap().state, outcome.clamping.unwrap().status)
    };
    let heavy = merged(job.clone(), &json!({ "clamping": { "part_mass_kg": 500 } }));
    assert_eq!(state(&with_force(&heavy, 1e5)), (MillingState::Stable, ClampingStatus::Holds));
    assert_eq!(state(&with_force(&job, 0.5 * (least + certain))), (MillingState::Slips, ClampingStatus::Creeps));
    assert_eq!(state(&with_force(&job, 0.98 * certain)), (MillingState::Slips, ClampingStatus::Slips));
    let chatters = merged(with_force(&job, 0.9 * certain), &json!({ "cut": { "depth_mm": 60 } }));
    let (first, _) = state(&chatters);
    let modulus = solve(&chatters).outcome.multiplier.unwrap().modulus;
    assert!(first == MillingState::Chatter && modulus > 1.0, "{first:?} {modulus}");
    // Much axial force over the middle of a light part: it comes off its parallels, a heavy one stays.
    let lifting = |mass: f64| {
        let light = json!({
            "force": { "tangential_n_per_mm2": 300, "radial_n_per_mm2": 0, "axial_n_per_mm2": 900, "radial_edge_n_per_mm": 0 },
            "clamping": { "vise": { "clamp_force_n": 1e5 }, "cut_point_mm": [0, 0, 15],
                          "stations": [{ "x_mm": 0, "y_mm": 0, "z_mm": 15 }], "part_mass_kg": mass,
                          "centre_of_mass_mm": [0, 0, 15] }
        });
        solve(&merged(job.clone(), &light))
    };
    let (light, held) = (lifting(0.0), lifting(300.0));
    let comes_off = light.outcome.clamping.as_ref().unwrap().comes_off_n.unwrap();
    assert_eq!(light.outcome.verdict.as_ref().unwrap().state, MillingState::Lifts);
    close(said(&light, "milling_comes_off", "off_n"), light.outcome.force.work.z_max_n, 1e-3, "upward force");
    assert!(comes_off > 0.0 && light.outcome.clamping.as_ref().unwrap().lifts.len() == 4);
    assert_eq!(held.outcome.verdict.unwrap().state, MillingState::Stable);
    // Rough jaws open before friction as a whole gives out: told so where a contact that is pressed at rest has no force left.
    let rough = json!({ "clamping": { "vise": { "friction": { "low": 1.5, "value": 1.5, "high": 1.5 } }, "part_mass_kg": 0 },
                        "cut": { "feed_direction_deg": 90 } });
    let rough = merged(job, &rough);
    let told = solve(&rough).outcome.clamping.unwrap();
    let (least, certain) = (told.clamp_force_min_n.unwrap(), told.certain_slip_below_n.unwrap());
    let mut states = Vec::new();
    for step in 1..8 {
        let outcome = solve(&with_force(&rough, certain + (least - certain) * f64::from(step) / 8.0)).outcome;
        let jaws = &outcome.clamping.as_ref().unwrap().contacts[..8];
        let opens = jaws.iter().any(|contact| contact.least_normal_n <= 0.0);
        let state = outcome.verdict.unwrap().state;
        assert_eq!(state, if opens { MillingState::Opens } else { MillingState::Slips }, "{jaws:?}");
        states.push(state);
    }
    assert!(states.contains(&MillingState::Opens), "{states:?} {certain} {least}");
}

#[test]
fn every_fault_of_a_clamping_is_named_at_its_field_and_its_neighbour_is_none() {
    let job = example("clamped");
    let named = |patch: Value| {
        let found = faults(&merged(job.clone(), &patch));
        found.iter().map(|fault| (fault.code, fault.pointer.clone())).collect::<Vec<_>>()
    };
    let point = |normal: [f64; 3], share: f64| json!({ "position_mm": [0.0, -30.0 * normal[1], 0.0], "normal": normal, "clamp_share": share });
    let contacts = |points: Value| json!({ "clamping": { "vise": null, "contacts": { "points": points } } });
    let expected = |code, pointer: &str| vec![(code, pointer.to_owned())];
    assert_eq!(named(json!({ "clamping": null })), expected("clamping_missing", "/clamping"));
    assert!(named(json!({ "clamping": null, "analyses": ["verdict"] })).is_empty());
    assert_eq!(named(json!({ "clamping": { "vise": null } })), expected("vise_or_contacts", "/clamping"));
    let both = json!({ "clamping": { "contacts": { "points": [point([0.0, 1.0, 0.0], 1.0)] } } });
    assert_eq!(named(both), expected("vise_or_contacts", "/clamping"));
    let unordered = json!({ "clamping": { "vise": { "friction": { "low": 0.3 } } } });
    assert_eq!(named(unordered), expected("frictions_unordered", "/clamping/vise/friction"));
    let opposite = [point([0.0, -1.0, 0.0], 1.0), point([0.0, 1.0, 0.0], 0.0)];
    assert!(named(contacts(json!(opposite))).is_empty());
    let loose = [point([0.0, -1.0, 0.0], 0.0), point([0.0, 1.0, 0.0], 0.0)];
    assert_eq!(named(contacts(json!(loose))), expected("nothing_clamped", "/clamping/contacts/points"));
    let alone = [point([0.0, -1.0, 0.0], 1.0), point([1.0, 0.0, 0.0], 0.0)];
    let found = faults(&merged(job.clone(), &contacts(json!(alone))));
    assert_eq!((found.len(), found[0].code), (1, "clamping_unbalanced"));
    assert_eq!(found[0].values.get("way"), Some(&Said::from("-y")), "{found:?}");
    let flat = [point([0.0, -1.0, 0.0], 1.0), point([0.0, 0.0, 0.0], 0.0)];
    assert_eq!(named(contacts(json!(flat))), expected("direction_zero", "/clamping/contacts/points/1/normal"));
}

#[test]
fn an_unlikely_clamp_force_and_a_friction_that_is_not_stated_are_warned_of() {
    let unlikely = |force: f64| {
        let told = solve(&with_force(&merged(example("clamped"), &json!({ "analyses": ["clamping"] })), force));
        told.warnings.into_iter().find(|warning| warning.code == "implausible_unit")
    };
    assert!(unlikely(5400.0).is_none());
    let found = unlikely(5.4).unwrap();
    assert_eq!(found.pointer, "/clamping/vise/clamp_force_n");
    assert_eq!(found.values.get("likely"), Some(&Said::from("force_kn")));
    let warns = |friction: Value| {
        let job = merged(
            example("clamped"),
            &json!({ "analyses": ["clamping"], "clamping": { "vise": { "friction": friction } } }),
        );
        solve(&job).warns("jaw_friction_assumed")
    };
    assert!(warns(Value::Null) && !warns(json!({ "low": 0.1, "value": 0.15, "high": 0.21 })));
}

/// A job that states one place of the cut is that of the way along the feed through it: as stated, what each place asks for is what
/// it asks alone, and the largest is the least that holds.
#[test]
fn a_cut_without_stations_goes_along_the_feed() {
    let free = |patch: Value| {
        let mut job = merged(example("clamped"), &merged(json!({ "analyses": ["clamping"] }), &patch));
        job["clamping"].as_object_mut().unwrap().remove("stations");
        job
    };
    let contacts: Vec<Value> = [(-40.0, -30.0), (40.0, -30.0), (-40.0, 30.0), (40.0, 30.0)]
        .iter()
        .map(|(x, y): &(f64, f64)| json!({ "position_mm": [x, y, 10.0], "normal": [0.0, -y.signum(), 0.0], "clamp_share": 0.5 }))
        .collect();
    for (patch, ways) in [
        // Over the length of the jaws, between them, slantwise to the nearer side, between contacts.
        (json!({ "clamping": { "cut_point_mm": [0, 20, 40] } }), [[-50.0, 20.0], [0.0, 20.0], [50.0, 20.0]]),
        (
            json!({ "clamping": { "cut_point_mm": [10, 0, 40] }, "cut": { "feed_direction_deg": -90 } }),
            [[10.0, 30.0], [10.0, 0.0], [10.0, -30.0]],
        ),
        (
            json!({ "clamping": { "cut_point_mm": [0, 0, 40] }, "cut": { "feed_direction_deg": 45 } }),
            [[-30.0, -30.0], [0.0, 0.0], [30.0, 30.0]],
        ),
        (
            json!({ "clamping": { "vise": null, "contacts": { "points": contacts, "clamp_force_n": 9000 }, "cut_point_mm": [5, 0, 15] } }),
            [[-40.0, 0.0], [0.0, 0.0], [40.0, 0.0]],
        ),
    ] {
        let job = free(patch);
        let told = solve(&job);
        let clamping = told.outcome.clamping.as_ref().unwrap();
        assert!(clamping.stations_assumed && told.says("clamping_along_the_feed"));
        let has = |way: &[f64; 2]| {
            let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
            clamping.stations.iter().any(|at| near(at.x_mm, way[0]) && near(at.y_mm, way[1]))
        };
        assert!(ways.iter().all(has), "{ways:?} {:?}", clamping.stations);
        let mut stated = job.clone();
        let place = |at: &precut_calc::milling_stability::ClampStation| json!({ "x_mm": at.x_mm, "y_mm": at.y_mm, "z_mm": at.z_mm });
        stated["clamping"]["stations"] = clamping.stations.iter().map(place).collect();
        let other = solve(&stated);
        assert!(!other.outcome.clamping.as_ref().unwrap().stations_assumed && !other.says("clamping_along_the_feed"));
        let least = clamping.clamp_force_min_n.unwrap();
        close(other.outcome.clamping.unwrap().clamp_force_min_n.unwrap(), least, 1e-12, "stated");
        let mut most: f64 = 0.0;
        for at in &clamping.stations {
            let mut alone = job.clone();
            alone["clamping"]["cut_point_mm"] = json!([at.x_mm, at.y_mm, at.z_mm]);
            alone["clamping"]["stations"] = json!([place(at)]);
            let asked = solve(&alone).outcome.clamping.unwrap().clamp_force_min_n.unwrap();
            // One place has its own instants, between which the force asked for has its maximum.
            close(at.clamp_force_min_n.unwrap(), asked, 1e-3, "alone");
            most = most.max(at.clamp_force_min_n.unwrap());
        }
        close(most, least, 1e-9, "largest");
    }
    // A place beside the jaws: nothing tells the way.
    let beside = solve(&free(json!({ "clamping": { "cut_point_mm": [0, 60, 40] } })));
    assert_eq!(beside.outcome.clamping.as_ref().unwrap().stations.len(), 1);
    assert!(beside.says("clamping_along_the_feed"));
}

/// A friction by its standard deviation is that of the ends between which nine of ten lie; by its likely value alone it is known; the
/// force goes as its inverse.
#[test]
fn a_friction_may_be_stated_by_its_standard_deviation() {
    let job = merged(example("clamped"), &json!({ "analyses": ["clamping"], "clamping": { "part_mass_kg": 0 } }));
    let with = |friction: Value| {
        let mut other = job.clone();
        other["clamping"]["vise"]["friction"] = friction;
        other
    };
    let forces = |friction: Value| {
        let clamping = solve(&with(friction)).outcome.clamping.unwrap();
        [clamping.clamp_force_min_n, clamping.at_likely_friction_n, clamping.at_high_friction_n].map(Option::unwrap)
    };
    let (value, sd): (f64, f64) = (0.2, 0.04);
    let [low, likely, high] = forces(json!({ "value": value, "sd": sd }));
    // Lognormal of that deviation: 1.644854 standard deviations of the logarithm to either side.
    let off = (1.644_853_627 * (1.0 + (sd / value).powi(2)).ln().sqrt()).exp();
    let [by_low, by_likely, by_high] = forces(json!({ "low": value / off, "value": value, "high": value * off }));
    for (a, b) in [(low, by_low), (likely, by_likely), (high, by_high)] {
        close(a, b, 1e-8, "standard deviation");
    }
    assert!(low > likely && likely > high);
    let [low, likely, high] = forces(json!({ "value": value }));
    assert!(low == likely && likely == high && !solve(&with(json!({ "value": value }))).warns("jaw_friction_assumed"));
    let found = faults(&with(json!({ "value": value, "low": 0.1, "sd": sd })));
    let named: Vec<_> = found.iter().map(|fault| (fault.code, fault.pointer.as_str())).collect();
    assert_eq!(named, [("friction_range_or_sd", "/clamping/vise/friction/sd")]);
}

/// Better speeds keep within the clamp force at hand: done as printed it holds.
#[test]
fn a_better_speed_is_one_that_the_clamp_force_holds() {
    let job = merged(
        example("two_modes"),
        &json!({
            "analyses": ["speeds", "clamping"], "lobes": { "speeds": 20, "map": false }, "spindle": { "speed_min_rpm": 8000 },
            "clamping": { "vise": { "jaw_length_mm": 100, "jaw_height_mm": 30, "part_width_mm": 60,
                                    "friction": { "low": 0.15, "value": 0.2, "high": 0.25 } }, "cut_point_mm": [0, 0, 40] }
        }),
    );
    // As much as 1.5 mm ask for: where chatter would allow more it binds.
    let at = merged(job.clone(), &json!({ "cut": { "depth_mm": 1.5 }, "analyses": ["clamping"] }));
    let job = with_force(&job, solve(&at).outcome.clamping.unwrap().clamp_force_min_n.unwrap());
    let outcome = solve(&job).outcome;
    let speeds = &outcome.speeds;
    assert!(!speeds.is_empty());
    for pocket in speeds {
        let cut = json!({ "spindle_speed_rpm": pocket.spindle_speed_rpm, "depth_mm": pocket.depth_mm });
        let mut done = merged(job.clone(), &json!({ "cut": cut, "analyses": ["clamping"] }));
        assert_eq!(status(&done), ClampingStatus::Holds, "{pocket:?}");
        if pocket.binds.name() == "clamp_force" {
            // The depth was halved down to a hundredth of its first bound, and printed to three digits.
            done["cut"]["depth_mm"] = json!(1.1 * pocket.depth_mm);
            assert_ne!(status(&done), ClampingStatus::Holds, "{pocket:?}");
        }
    }
    let curve = outcome.speed_curve.as_ref().unwrap();
    assert!(curve.binds.iter().flatten().any(|binds| binds.name() == "clamp_force"), "{:?}", curve.binds);
}

/// Contacts that are the corners of a vise are that vise.
#[test]
fn contacts_at_the_corners_of_a_vise_are_that_vise() {
    let mut job = drawn(2);
    job["clamping"]["part_mass_kg"] = json!(0);
    let by_vise = solve(&job).outcome.clamping.unwrap();
    let (fixture, ..) = held_and_loads(&job, 1);
    let point = |contact: &Contact| {
        json!({ "position_mm": contact.position_mm, "normal": contact.normal, "clamp_share": contact.clamp_share,
                "constant_force": contact.constant_force, "normal_stiffness_n_per_mm": contact.normal_stiffness_n_per_mm,
                "tangential_stiffness_n_per_mm": contact.tangential_stiffness_n_per_mm })
    };
    let points: Vec<Value> = fixture.contacts.iter().map(point).collect();
    let friction = job["clamping"]["vise"]["friction"].clone();
    job["clamping"]["contacts"] = json!({ "points": points, "friction": friction });
    job["clamping"].as_object_mut().unwrap().remove("vise");
    let by_contacts = solve(&job).outcome.clamping.unwrap();
    close(by_contacts.clamp_force_min_n.unwrap(), by_vise.clamp_force_min_n.unwrap(), 1e-9, "least");
    close(by_contacts.certain_slip_below_n.unwrap(), by_vise.certain_slip_below_n.unwrap(), 1e-6, "certain");
    assert_eq!(by_contacts.contacts.len(), by_vise.contacts.len());
}

/// Every place of the map of the clamp force is the job there: what it asks for in the forced motion, at rest and by the mean, and nothing
/// where it chatters.
#[test]
fn the_map_of_the_clamp_force_is_the_job_at_every_place() {
    let job = merged(
        example("clamped"),
        &json!({
            "work": { "kind": "modes", "modes": [
                { "direction": [0, 1, 0], "frequency_hz": 700, "damping_ratio": 0.05, "stiffness_n_per_mm": 60_000 }
            ] },
            "lobes": { "from_rpm": 3000, "to_rpm": 9000, "speeds": 4, "depths": 3, "map": true },
            "limits": { "depth_max_mm": 3 },
            "analyses": ["lobes", "clamping"]
        }),
    );
    let map = solve(&job).outcome.lobes.unwrap().clamp_map.unwrap();
    assert_eq!((map.spindle_speed_rpm.len(), map.depth_mm.len(), map.clamp_force_n.len()), (4, 3, 12));
    let (mut held, mut quiet, mut dynamic) = (0, 0, 0.0_f64);
    for (row, depth_mm) in map.depth_mm.iter().enumerate() {
        for (column, rpm) in map.spindle_speed_rpm.iter().enumerate() {
            let there = merged(
                job.clone(),
                &json!({ "cut": { "spindle_speed_rpm": rpm, "depth_mm": depth_mm }, "analyses": ["verdict", "clamping"] }),
            );
            let got = solve(&there).outcome;
            let (asked, of_map) = (got.clamping.as_ref().unwrap(), map.clamp_force_n[row * 4 + column]);
            close(map.mean_n[row].unwrap(), asked.against_mean_n.unwrap(), 1e-9, "mean");
            quiet += i32::from(got.verdict.unwrap().state != MillingState::Chatter);
            if let Some(force) = of_map {
                held += 1;
                close(force, asked.clamp_force_min_n.unwrap(), 1e-9, "in motion");
                dynamic = dynamic.max((force / map.static_n[row].unwrap() - 1.0).abs());
            }
        }
        let rigid = merged(
            job.clone(),
            &json!({ "work": { "kind": "rigid" }, "cut": { "depth_mm": depth_mm }, "analyses": ["clamping"] }),
        );
        let still = solve(&rigid).outcome.clamping.unwrap().clamp_force_min_n.unwrap();
        close(map.static_n[row].unwrap(), still, 1e-9, "at rest");
    }
    assert!(held == quiet && (4..12).contains(&held), "{held} of {quiet}");
    assert!(dynamic > 0.05, "{dynamic}");
}
