//! The reference cases of the feed schedule, in full.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::feed_support;
use crate::feed_support::{conflict, multipliers, near, of_zone, reference, solve, solved, translate};
use precut_calc::calculator::{Failure, Unwatched};
use precut_calc::feed_schedule::{Outcome, zone_compliances};
use serde_json::{Value, json};

/// Objective, totals, zones and multipliers of a file with its own tolerances.
fn compare(name: &str, outcome: &Outcome, expected: &Value, tolerance: &Value) {
    let of = |key: &str| tolerance[key].as_f64().unwrap();
    let (objective, relative, absolute) = (of("objective_relative"), of("relative"), of("absolute"));
    near(name, outcome.objective, expected["objective"].as_f64().unwrap(), objective, 0.0);
    if let Some(time) = expected["cutting_time_min"].as_f64() {
        near(&format!("{name} time"), outcome.cutting_time_min, time, 2.0 * objective, 0.0);
    }
    if let Some(usage) = expected["tool_usage"].as_f64() {
        near(&format!("{name} usage"), outcome.tool_usage.unwrap(), usage, relative, absolute);
    }
    if let Some(parts) = expected["parts_per_edge"].as_u64() {
        assert_eq!(u64::from(outcome.parts_per_edge.unwrap()), parts);
    }
    for zone in expected["zones"].as_array().into_iter().flatten() {
        let id = zone["id"].as_str().unwrap();
        for (key, value) in zone.as_object().unwrap().iter().filter(|(key, _)| *key != "id") {
            near(&format!("{name} {id} {key}"), of_zone(outcome, id, key), value.as_f64().unwrap(), relative, absolute);
        }
    }
    let Some(wanted) = expected["multipliers"].as_object() else { return };
    let allowed = of("multiplier_absolute");
    let found = multipliers(outcome);
    for (key, value) in wanted {
        let value = value.as_f64().unwrap();
        // Semi-log multipliers are per unit and large: the file's tolerance is meant for elasticities of order one.
        near(&format!("{name} {key}"), found.get(key).copied().unwrap_or(0.0), value, allowed, allowed);
    }
    for (key, value) in &found {
        assert!(wanted.contains_key(key) || *value < 1e-4 + allowed, "{name}: {key} = {value} is not expected");
    }
}

fn multi_zone(name: &str) -> Outcome {
    let case = reference(name);
    let outcome = solved(translate(&case["input"]));
    compare(name, &outcome, &case["expected"], &case["tolerance"]);
    // A point with these residuals and multipliers is the optimum within the gap.
    assert!(outcome.certificate.duality_gap <= 1e-9, "{name}: {:?}", outcome.certificate);
    assert!(outcome.certificate.kkt_residual <= 1e-6, "{name}: {:?}", outcome.certificate);
    assert!(!outcome.certificate.local);
    outcome
}

#[test]
fn six_zones_least_time() {
    multi_zone("multi-zone-time.json");
}

#[test]
fn six_zones_with_feed_steps() {
    multi_zone("multi-zone-feed-step.json");
}

#[test]
fn six_zones_at_one_spindle_speed() {
    multi_zone("multi-zone-constant-rpm.json");
}

#[test]
fn six_zones_least_cost() {
    multi_zone("multi-zone-cost.json");
}

#[test]
fn six_zones_whole_parts_per_edge() {
    multi_zone("multi-zone-whole-parts-per-edge.json");
}

#[test]
fn six_zones_nickel_alloy() {
    multi_zone("multi-zone-nickel-tool-life.json");
}

#[test]
fn six_zones_with_a_compensated_path() {
    multi_zone("multi-zone-compensated.json");
}

#[test]
fn six_zones_many_kinds_of_limit() {
    multi_zone("multi-zone-mixed-limits.json");
}

#[test]
fn six_zones_least_worst_deflection() {
    assert!(multi_zone("multi-zone-min-max-deflection.json").certificate.tie_broken);
}

#[test]
fn six_zones_least_worst_roughness() {
    multi_zone("multi-zone-min-max-roughness.json");
}

#[test]
fn six_zones_least_worst_hardening() {
    multi_zone("multi-zone-min-max-hardening.json");
}

#[test]
fn thirty_zones() {
    multi_zone("thirty-zones.json");
}

#[test]
fn single_zones_in_closed_form() {
    let file = reference("single-zone-closed-form.json");
    for case in file["cases"].as_array().unwrap() {
        let name = case["name"].as_str().unwrap();
        let outcome = solved(translate(&case["input"]));
        for (key, value) in case["expected"].as_object().unwrap() {
            match key.as_str() {
                "multipliers" => {
                    let found = multipliers(&outcome);
                    for (limit, value) in value.as_object().unwrap() {
                        near(&format!("{name} {limit}"), found[limit], value.as_f64().unwrap(), 0.0, 1e-5);
                    }
                    assert_eq!(found.len(), value.as_object().unwrap().len(), "{name}: {found:?}");
                }
                "objective" => near(name, outcome.objective, value.as_f64().unwrap(), 1e-6, 0.0),
                "cutting_time_min" => near(name, outcome.cutting_time_min, value.as_f64().unwrap(), 1e-6, 0.0),
                other => {
                    near(
                        &format!("{name} {other}"),
                        of_zone(&outcome, "z1", other),
                        value.as_f64().unwrap(),
                        1e-6,
                        0.0,
                    );
                }
            }
        }
    }
}

/// Compliance at a single place: a zone so short that its largest compliance is that of the place.
#[test]
fn beam_compliances() {
    let file = reference("single-zone-closed-form.json");
    let beam = &file["beam"];
    let stepped = reference("multi-zone-time.json")["input"]["shaft"].clone();
    for case in beam["cases"].as_array().unwrap() {
        let mut shaft = json!({
            "E_N_per_mm2": beam["E_N_per_mm2"],
            "support": case["support"],
            "segments": [{ "length_mm": beam["length_mm"], "outer_diameter_mm": beam["outer_diameter_mm"] }],
        });
        for key in ["headstock_compliance_um_per_N", "tailstock_compliance_um_per_N", "carriage_compliance_um_per_N"] {
            if let Some(value) = case.get(key) {
                shaft[key] = value.clone();
            }
        }
        if case["support"].as_str().unwrap().starts_with("stepped") {
            shaft = stepped.clone();
        }
        let z = case["z_mm"].as_f64().unwrap();
        // The compliance changes by at most 3/l relative per mm there, so 1e-7 mm are far below 1e-6.
        let input = json!({
            "shaft": shaft,
            "zones": [{ "id": "z1", "z_start_mm": z - 1e-7, "z_end_mm": z, "diameter_mm": 40.0, "depth_mm": 1.0 }],
            "models": {},
            "limits": { "feed_min_mm_per_rev": 0.1, "feed_max_mm_per_rev": 0.2, "speed_min_m_per_min": 10.0, "speed_max_m_per_min": 20.0 },
            "objective": { "kind": "time" },
        });
        let expected = case["compliance_um_per_N"].as_f64().unwrap();
        near("C", of_zone(&solved(translate(&input)), "z1", "compliance_um_per_N"), expected, 1e-6, 0.0);
    }
}

fn pairs(set: &Value) -> Vec<(String, String)> {
    let text = |v: &Value| v.as_str().unwrap().to_owned();
    let mut all: Vec<_> = set.as_array().unwrap().iter().map(|m| (text(&m["constraint"]), text(&m["zone"]))).collect();
    all.sort();
    all
}

/// The job with only some of its limits: what is not in the set is taken away or made so wide that it cannot bind.
fn only(job: &Value, set: &[(String, String)]) -> Value {
    let mut job = job.clone();
    let has = |constraint: &str, zone: &str| set.iter().any(|(c, z)| c == constraint && z == zone);
    for zone in job["zones"].as_array_mut().unwrap() {
        let id = zone["id"].as_str().unwrap().to_owned();
        let fields = zone.as_object_mut().unwrap();
        for (constraint, field) in [
            ("deflection", "deflection_max_um"),
            ("roughness", "roughness_max_um"),
            ("hardening", "hardening_max_percent"),
            ("hardening_depth", "hardening_depth_max_um"),
        ] {
            if !has(constraint, &id) {
                fields.remove(field);
            }
        }
    }
    for (constraint, field) in [("tool_usage", "tool_usage_max"), ("time_max", "time_max_min")] {
        if !has(constraint, "part") {
            job["limits"].as_object_mut().unwrap().remove(field);
        }
    }
    job["machine"] = json!({});
    // Bounds that are not in the set are moved out by e^9; those in it stay, as custom limits.
    let limits = job["limits"].clone();
    let e9 = 9.0_f64.exp();
    let mut custom = Vec::new();
    let zones: Vec<String> =
        job["zones"].as_array().unwrap().iter().map(|z| z["id"].as_str().unwrap().to_owned()).collect();
    for (constraint, field, v, s, lower) in [
        ("feed_min", "feed_min_mm_per_rev", 0.0, 1.0, true),
        ("feed_max", "feed_max_mm_per_rev", 0.0, 1.0, false),
        ("speed_min", "speed_min_m_per_min", 1.0, 0.0, true),
        ("speed_max", "speed_max_m_per_min", 1.0, 0.0, false),
    ] {
        let bound = limits[field].as_f64().unwrap();
        for zone in &zones {
            if has(constraint, zone) {
                let side = if lower { "min" } else { "max" };
                custom.push(json!({ "name": format!("{constraint}_{zone}"), "zone": zone, "speed_exponent": v, "feed_exponent": s, side: bound }));
            }
        }
        job["limits"][field] = json!(if lower { bound / e9 } else { bound * e9 });
    }
    job["custom"] = Value::Array(custom);
    job
}

/// Total relaxation, and both properties of the conflict set, by solving anew with the set's limits alone. The schema's
/// ranges do not hold for these jobs: they go straight to the calculator.
fn infeasible(name: &str) {
    let case = reference(name);
    let job = translate(&case["input"]);
    let found = conflict(job.clone());
    near(name, found.elastic_total, case["expected"]["elastic_log_total"].as_f64().unwrap(), 1e-4, 1e-4);
    let mut set: Vec<(String, String)> =
        found.conflict_set.iter().map(|m| (m.constraint.clone(), m.zone.clone())).collect();
    set.sort();
    if case["conflict_set_unique"] == json!(true) {
        assert_eq!(set, pairs(&case["expected"]["conflict_set"]));
    }
    assert!(matches!(solve(only(&job, &set)), Err(Failure::Conflicting(_))), "{name}: {set:?} do not conflict");
    for left_out in 0..set.len() {
        let mut rest = set.clone();
        let one = rest.remove(left_out);
        let outcome = solve(only(&job, &rest));
        assert!(outcome.is_ok(), "{name}: without {one:?} still {:?}", outcome.err());
    }
    // The relaxations make it feasible: their logarithms add up to the total.
    let total: f64 = found
        .relaxations
        .iter()
        .map(|r| if r.constraint.starts_with("hardening") { r.factor - 1.0 } else { r.factor.ln().abs() })
        .sum();
    near(&format!("{name} relaxations"), total, found.elastic_total, 1e-4, 1e-5);
}

#[test]
fn infeasible_by_deflection() {
    infeasible("infeasible-deflection.json");
}

#[test]
fn infeasible_by_hardening_and_time() {
    infeasible("infeasible-hardening-time.json");
}

#[test]
fn infeasible_by_time_and_tool_life() {
    infeasible("infeasible-time-life.json");
}

#[test]
fn ermer_and_rao() {
    let file = reference("benchmark-ermer-rao.json");
    for case in file["cases"].as_array().unwrap() {
        let name = case["name"].as_str().unwrap();
        let outcome = solved(translate(&case["input"]));
        let expected = &case["expected"];
        near(name, outcome.objective, expected["objective"].as_f64().unwrap(), 1e-6, 0.0);
        for key in ["speed_m_per_min", "feed_mm_per_rev"] {
            near(name, of_zone(&outcome, "z1", key), expected[key].as_f64().unwrap(), 1e-5, 0.0);
        }
        let found = multipliers(&outcome);
        for (limit, value) in expected["multipliers"].as_object().unwrap() {
            near(&format!("{name} {limit}"), found[limit], value.as_f64().unwrap(), 0.0, 1e-5);
        }
        // The textbook's printed figures: rounded, so half a unit of the last digit, doubled for its slide-rule work.
        let published = &case["published"];
        near(name, outcome.objective, published["cost_usd"].as_f64().unwrap(), 0.0, 0.01);
        let feet = of_zone(&outcome, "z1", "speed_m_per_min") / 0.3048;
        near(name, feet, published["speed_ft_per_min"].as_f64().unwrap(), 0.0, 1.0);
    }
}

#[test]
fn chen_and_tsai_per_pass_wear() {
    let file = reference("benchmark-chen-tsai-1996.json");
    for case in file["per_pass_wear"]["cases"].as_array().unwrap() {
        let outcome = solved(translate(&case["input"]));
        let expected = &case["expected"];
        near("cost", outcome.objective, expected["objective"].as_f64().unwrap(), 1e-5, 0.0);
        for zone in expected["zones"].as_array().unwrap() {
            let id = zone["id"].as_str().unwrap();
            for (key, value) in zone.as_object().unwrap().iter().filter(|(key, _)| *key != "id") {
                near(&format!("{id} {key}"), of_zone(&outcome, id, key), value.as_f64().unwrap(), 1e-5, 0.0);
            }
        }
        let found = multipliers(&outcome);
        for (limit, value) in expected["multipliers"].as_object().unwrap() {
            near(limit, found[limit], value.as_f64().unwrap(), 1e-5, 1e-5);
        }
    }
}

/// The published vector is feasible and costs what was published, with the weighted tool life of the source; wear that
/// adds up pass by pass costs more.
#[test]
fn chen_and_tsai_published_vector() {
    let file = reference("benchmark-chen-tsai-1996.json");
    for case in file["weighted_tool_life"].as_object().unwrap().values() {
        let vector = &case["vector"];
        let of = |key: &str| vector[key].as_f64().unwrap();
        let (vr, fr, vs, fs, d) = (of("V_r"), of("f_r"), of("V_s"), of("f_s"), 3.0_f64);
        let theta = case["theta"].as_f64().unwrap();
        let life = |v: f64, f: f64| 6e11 / (v.powi(5) * f.powf(1.75) * d.powf(0.75));
        let mean = theta * life(vr, fr) + (1.0 - theta) * life(vs, fs);
        let area = std::f64::consts::PI * 50.0 * 300.0 / 1000.0;
        let time = area / (vr * fr) + area / (vs * fs);
        let cost = 0.5 * time + 0.5 * (0.75 + (0.0007 * 300.0 + 0.3) * 2.0) + (0.5 * 1.5 + 2.5) * time / mean;
        near("unit cost", cost, case["unit_cost"].as_f64().unwrap(), 1e-5, 0.0);
    }
}

/// The split into passes is found, not given: the optimum of the enumeration is that of the file.
#[test]
fn chen_and_tsai_passes_found() {
    for (total, roughing, finishing, cost) in [(6.0, 1, 3.0, 2.082_560_79), (8.0, 2, 8.0 / 3.0, 2.587_310_45)] {
        let mut job: Value = serde_json::from_str(include_str!("../src/feed_schedule/examples/passes.json")).unwrap();
        job["passes"]["total_depth_mm"] = json!(total);
        let outcome = solved(job);
        let passes = outcome.passes.as_ref().unwrap();
        assert_eq!(passes.roughing_passes, roughing);
        near("finishing depth", passes.finishing_depth_mm, finishing, 1e-6, 0.0);
        near("cost", outcome.objective, cost, 1e-5, 0.0);
    }
}

#[test]
fn continuous_feed() {
    let file = reference("continuous-feed.json");
    let mut job = translate(&file["input"]);
    job["variables"] = json!({ "speed": "fixed", "fixed_speed_m_per_min": file["fixed_speed_m_per_min"] });
    job["method"] = json!({ "kind": "continuous", "grid_points": 601, "loss_percent": 1.0, "segments_max": 24 });
    let at = |outcome: &Outcome, z: f64| {
        let found = outcome.continuous.as_ref().unwrap();
        let k = found.z_mm.iter().position(|own| (own - z).abs() < 1e-9).unwrap();
        found.feed_mm_per_rev[k]
    };
    let outcome = solved(job.clone());
    let found = outcome.continuous.as_ref().unwrap();
    near("time", found.cutting_time_min, file["continuous"]["time_min"].as_f64().unwrap(), 2e-4, 0.0);
    for point in file["continuous"]["at"].as_array().unwrap() {
        let z = point["z_mm"].as_f64().unwrap();
        near("feed", at(&outcome, z), point["feed_mm_per_rev"].as_f64().unwrap(), 1e-6, 0.0);
    }
    assert_eq!(u64::from(found.segments), file["piecewise_constant"]["smallest_within_1_percent"].as_u64().unwrap());
    assert!(found.loss_reached);
    let expected = file["piecewise_constant"]["by_segments"].as_array().unwrap();
    assert_eq!(found.by_segments.len(), expected.len());
    for (own, expected) in found.by_segments.iter().zip(expected) {
        assert_eq!(u64::from(own.segments), expected["segments"].as_u64().unwrap());
        near("segment time", own.cutting_time_min, expected["time_min"].as_f64().unwrap(), 2e-3, 0.0);
    }
    // The zones found are solved once more as a program of their own: it can only agree.
    near("zones", outcome.cutting_time_min, found.by_segments[17].cutting_time_min, 2e-3, 0.0);
    let gradient = &file["gradient_limited"];
    job["method"]["feed_gradient_per_mm"] = gradient["max_abs_dlnS_dz_per_mm"].clone();
    let outcome = solved(job);
    let found = outcome.continuous.as_ref().unwrap();
    near("smooth time", found.cutting_time_min, gradient["time_min"].as_f64().unwrap(), 2e-4, 0.0);
    for point in gradient["at"].as_array().unwrap() {
        let z = point["z_mm"].as_f64().unwrap();
        near("smooth feed", at(&outcome, z), point["feed_mm_per_rev"].as_f64().unwrap(), 1e-6, 0.0);
    }
    let _ = Unwatched;
}

/// Largest compliance of zones that begin anywhere: the middle of a uniform shaft between rigid centres has l^3/(48 E J),
/// whether a point that is looked at falls on it or not. Promised is 1e-9.
#[test]
fn the_largest_compliance_of_a_zone_is_found_wherever_the_zone_begins() {
    let (length, diameter, modulus) = (1000.0, 40.0, 210_000.0);
    let inertia = std::f64::consts::PI * f64::powi(diameter, 4) / 64.0;
    let of = |from: f64, to: f64| {
        let job = feed_support::job(json!({
            "shaft": { "youngs_modulus_n_per_mm2": modulus, "segments": [{ "length_mm": length, "diameter_mm": diameter }] },
            "supports": [{ "kind": "centre", "z_mm": 0.0 }, { "kind": "centre", "z_mm": length }],
            "zones": [{ "id": "z1", "z_start_mm": from, "z_end_mm": to, "diameter_mm": diameter, "depth_mm": 1.0 }],
            "models": {},
            "limits": { "feed_min_mm_per_rev": 0.1, "feed_max_mm_per_rev": 0.2, "speed_min_m_per_min": 10.0, "speed_max_m_per_min": 20.0 },
            "objective": { "kind": "time" },
        }));
        zone_compliances(&job).unwrap()[0]
    };
    let exact = |z: f64| 1000.0 * (z * (length - z)).powi(2) / (3.0 * modulus * inertia * length);
    for step in 0..=99 {
        let from = 5.0 * f64::from(step);
        near(&format!("from {from}"), of(from, length), exact(500.0), 1e-9, 0.0);
        near(&format!("to {}", length - from), of(0.0, length - from), exact(500.0), 1e-9, 0.0);
    }
    // The maximum so near to an end that a point beside the end is beyond it; and ends that are the maximum.
    for beside in [1e-9, 1e-6, 1e-4, 3e-4, 1e-3, 0.1] {
        near(&format!("{beside} beside"), of(500.0 - beside, length), exact(500.0), 1e-9, 0.0);
    }
    near("falling", of(500.0 + 0.1, length), exact(500.1), 1e-9, 0.0);
    near("rising", of(0.0, 250.0), exact(250.0), 1e-9, 0.0);
}

/// A steady rest leaves a maximum on either side of it, a follow rest a jump where it leaves the shaft; the highest counts,
/// found against short zones.
#[test]
fn the_highest_of_several_maxima_of_the_compliance_counts() {
    let zone = |from: f64, to: f64| json!({ "id": format!("z{from}"), "z_start_mm": from, "z_end_mm": to, "diameter_mm": 40.0, "depth_mm": 1.0 });
    let steady = |z: f64| json!({ "kind": "steady_rest", "z_mm": z, "compliance_um_per_n": 0.05 });
    let follow = |offset: f64| json!({ "kind": "follow_rest", "offset_mm": offset, "compliance_um_per_n": 0.1 });
    let with = |zones: Vec<Value>, rest: &Value| {
        let job = feed_support::job(json!({
            "shaft": { "youngs_modulus_n_per_mm2": 210_000.0, "segments": [{ "length_mm": 400.0, "diameter_mm": 40.0 }, { "length_mm": 600.0, "diameter_mm": 50.0 }] },
            "supports": [{ "kind": "centre", "z_mm": 0.0 }, rest, { "kind": "centre", "z_mm": 1000.0 }],
            "zones": zones,
            "models": {},
            "limits": { "feed_min_mm_per_rev": 0.1, "feed_max_mm_per_rev": 0.2, "speed_min_m_per_min": 10.0, "speed_max_m_per_min": 20.0 },
            "objective": { "kind": "time" },
        }));
        zone_compliances(&job).unwrap()
    };
    for rest in [steady(300.0), steady(470.0), steady(640.0), follow(15.0), follow(-70.0)] {
        // The maximum over 400 zones of 2.5 mm must be that over the whole.
        let place = |k: u32| 2.5 * f64::from(k);
        let fine = with((0..400).map(|k| zone(place(k), place(k + 1))).collect(), &rest);
        for from in [0, 28, 112, 176, 208] {
            let expected = fine[from as usize..].iter().copied().fold(0.0, f64::max);
            let found = with(vec![zone(place(from), 1000.0)], &rest)[0];
            near(&format!("{rest}, from {from}"), found, expected, 1e-9, 0.0);
        }
    }
}
