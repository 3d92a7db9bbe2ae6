//! What a schedule warns of, and the conflict where it has no answer.
#![allow(clippy::unwrap_used, clippy::panic)]

use precut_calc::calculator::{Calculator, Finding, Unwatched};
use precut_calc::feed_schedule::FeedSchedule;
use serde_json::{Value, json};

use crate::feed_support;

fn job() -> Value {
    let zone = |id: &str, from: f64, compliance: f64| {
        json!({ "id": id, "z_start_mm": from, "z_end_mm": from + 100.0, "diameter_mm": 50, "depth_mm": 0.5,
            "compliance_um_per_n": compliance, "surface": id })
    };
    json!({
        "zones": [zone("a", 0.0, 0.03), zone("b", 100.0, 0.25)],
        "models": {
            "force_y": { "constant": 7.8, "speed_exponent": -0.3, "feed_exponent": 0.6, "depth_exponent": 0.9 }
        },
        "limits": {
            "feed_min_mm_per_rev": 0.03, "feed_max_mm_per_rev": 0.4, "speed_min_m_per_min": 15, "speed_max_m_per_min": 150
        },
        "objective": { "kind": "time" },
    })
}

fn warnings(job: Value) -> Vec<Finding> {
    FeedSchedule::run(&feed_support::job(job), &Unwatched).unwrap().warnings
}

fn of<'w>(warnings: &'w [Finding], code: &str) -> Vec<&'w str> {
    warnings.iter().filter(|warning| warning.code == code).map(|warning| warning.pointer.as_str()).collect()
}

/// With one feed and one speed for both zones nothing can bring their deflections together.
#[test]
fn a_spread_that_cannot_hold_is_named_whatever_is_common() {
    for feed in ["constant", "per_zone"] {
        for speed in ["constant_speed", "constant_rpm", "per_zone"] {
            let mut job = job();
            job["limits"]["deflection_spread_ratio_max"] = json!(if feed == "constant" { 1.88 } else { 1.05 });
            job["variables"] = json!({ "feed": feed, "speed": speed });
            if feed == "per_zone" {
                job["limits"]["feed_min_mm_per_rev"] = json!(0.3);
                job["limits"]["speed_min_m_per_min"] = json!(140);
            }
            let conflict = feed_support::conflict(job);
            let named = conflict.conflict_set.iter().any(|limit| limit.constraint == "deflection_spread");
            assert!(named, "{feed} {speed}: {:?}", conflict.conflict_set);
        }
    }
}

#[test]
fn the_trials_of_a_force_law_bound_its_model_and_a_law_without_a_say_is_told() {
    let mut given = job();
    given["force"] = json!({ "kind": "power_law",
        "passive": { "coefficient": 2430, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.3 },
        "measured_range": { "least_depth_mm": 2, "largest_depth_mm": 4, "least_feed_mm_per_rev": 0.01,
            "largest_feed_mm_per_rev": 1, "least_speed_m_per_min": 10, "largest_speed_m_per_min": 500 } });
    assert_eq!(of(&warnings(given.clone()), "unused_input"), ["/force"]);
    given["models"] = json!({});
    given["zones"][0]["deflection_max_um"] = json!(100);
    let warned = warnings(given);
    assert!(of(&warned, "unused_input").is_empty());
    assert_eq!(of(&warned, "outside_data_range"), ["/models/force_y"]);
}

#[test]
fn a_surface_that_needs_more_than_one_edge_is_told() {
    let mut worn = job();
    worn["models"]["tool_life"] = json!({ "form": "log_log", "constant": 1.0, "speed_exponent": -0.5 });
    assert_eq!(of(&warnings(worn), "surface_wears_out_its_edge").len(), 2);
}

/// Constant cutting speed on a thin zone asks more of the spindle than the program lets it.
#[test]
fn a_spindle_limit_that_slows_the_cut_is_told() {
    let mut thin = job();
    for zone in thin["zones"].as_array_mut().unwrap() {
        zone["diameter_mm"] = json!(8);
    }
    thin["variables"] = json!({ "speed": "constant_speed" });
    assert_eq!(of(&warnings(thin.clone()), "spindle_limit_binds"), ["/program/spindle_limit_rpm"]);
    thin["program"] = json!({ "spindle_limit_rpm": 10_000 });
    assert!(of(&warnings(thin), "spindle_limit_binds").is_empty());
}
