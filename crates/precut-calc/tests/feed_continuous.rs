//! Zones that are found under a limit on the feed's gradient: steps below the continuous schedule, against a dynamic
//! program of the test's own.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::feed_support::{multipliers, near, reference, solved, translate};
use precut_calc::feed_schedule::Outcome;
use serde_json::{Value, json};

const LENGTH_MM: f64 = 1000.0;
const DIAMETER_MM: f64 = 40.0;
const SPEED_M_PER_MIN: f64 = 100.0;
const DEFLECTION_MAX_UM: f64 = 60.0;
const FEED_MAX_MM_PER_REV: f64 = 0.4;
const FEED_EXPONENT: f64 = 0.6;
const GRADIENT_PER_MM: f64 = 0.0005;

/// A uniform shaft between rigid centres at one speed.
fn uniform(gradient_per_mm: f64) -> Value {
    json!({
        "shaft": { "youngs_modulus_n_per_mm2": 210_000.0, "segments": [{ "length_mm": LENGTH_MM, "diameter_mm": DIAMETER_MM }] },
        "supports": [{ "kind": "centre", "z_mm": 0.0 }, { "kind": "centre", "z_mm": LENGTH_MM }],
        "zones": [{ "id": "a", "z_start_mm": 0.0, "z_end_mm": LENGTH_MM, "diameter_mm": DIAMETER_MM, "depth_mm": 1.0, "deflection_max_um": DEFLECTION_MAX_UM }],
        "models": {},
        "force": { "kind": "power_law", "passive": { "coefficient": 2430.0, "depth_exponent": 0.9, "feed_exponent": FEED_EXPONENT, "speed_exponent": -0.3 } },
        "limits": { "feed_min_mm_per_rev": 0.01, "feed_max_mm_per_rev": FEED_MAX_MM_PER_REV, "speed_min_m_per_min": 50.0, "speed_max_m_per_min": 200.0 },
        "variables": { "speed": "fixed", "fixed_speed_m_per_min": SPEED_M_PER_MIN },
        "method": { "kind": "continuous", "grid_points": 601, "loss_percent": 5.0, "feed_gradient_per_mm": gradient_per_mm },
        "objective": { "kind": "time" },
    })
}

/// ln of the largest feed under all limits at a place: C = z^2 (l - z)^2/(3 E J l).
fn ln_limit(z: f64, deflection_max_um: f64) -> f64 {
    let inertia = std::f64::consts::PI * DIAMETER_MM.powi(4) / 64.0;
    let compliance = 1000.0 * (z * (LENGTH_MM - z)).powi(2) / (3.0 * 210_000.0 * inertia * LENGTH_MM);
    let force = 2430.0 * SPEED_M_PER_MIN.powf(-0.3);
    ((deflection_max_um / (compliance * force)).ln() / FEED_EXPONENT).min(FEED_MAX_MM_PER_REV.ln())
}

/// The largest feed that is nowhere above the limits and nowhere steeper than the gradient: least over all other places.
fn smooth(z: &[f64], gradient_per_mm: f64, deflection_max_um: f64) -> Vec<f64> {
    let limits: Vec<f64> = z.iter().map(|z| ln_limit(*z, deflection_max_um)).collect();
    let at = |here: &f64| {
        let reached = z.iter().zip(&limits).map(|(there, limit)| limit + gradient_per_mm * (here - there).abs());
        reached.fold(f64::INFINITY, f64::min).exp()
    };
    z.iter().map(at).collect()
}

/// Minutes per mm at a feed.
fn pace(feed: f64) -> f64 {
    std::f64::consts::PI * DIAMETER_MM / 1000.0 / (SPEED_M_PER_MIN * feed)
}

/// Least time of 1, 2, ... `most` steps below a feed, by dynamic programming over all pairs of points.
fn least_times(z: &[f64], feed: &[f64], most: usize) -> Vec<f64> {
    let mut best = vec![f64::INFINITY; z.len()];
    best[0] = 0.0;
    let mut times = Vec::new();
    for _ in 0..most {
        let mut next = vec![f64::INFINITY; z.len()];
        for from in 0..z.len() {
            let mut least = feed[from];
            for to in from + 1..z.len() {
                least = least.min(feed[to]);
                next[to] = next[to].min(best[from] + pace(least) * (z[to] - z[from]));
            }
        }
        best = next;
        times.push(best[z.len() - 1]);
    }
    times
}

/// No zone is above the continuous schedule inside it, and all together are no faster: both but for the millionth by which
/// a zone's ceiling stands above it.
fn keeps_below(outcome: &Outcome) {
    let found = outcome.continuous.as_ref().unwrap();
    for zone in &outcome.zones {
        for (z, feed) in found.z_mm.iter().zip(&found.feed_mm_per_rev) {
            let inside = *z > zone.z_start_mm + 1e-9 && *z < zone.z_end_mm - 1e-9;
            assert!(!inside || zone.feed_mm_per_rev <= feed * (1.0 + 2e-6), "{}: above {feed} at {z}", zone.id);
        }
    }
    assert!(outcome.cutting_time_min >= found.cutting_time_min * (1.0 - 2e-6), "{}", outcome.cutting_time_min);
    assert!(found.by_segments.iter().all(|one| one.cutting_time_min >= found.cutting_time_min * (1.0 - 2e-6)));
}

#[test]
fn zones_under_a_gradient_are_the_best_steps_below_the_smooth_schedule() {
    let outcome = solved(uniform(GRADIENT_PER_MM));
    let found = outcome.continuous.as_ref().unwrap();
    let feed = smooth(&found.z_mm, GRADIENT_PER_MM, DEFLECTION_MAX_UM);
    let cells = found.z_mm.windows(2).zip(feed.windows(2));
    let time: f64 = cells.map(|(z, feed)| 0.5 * (pace(feed[0]) + pace(feed[1])) * (z[1] - z[0])).sum();
    // The same trapezoidal rule on the same points; the beam's compliance is the closed form to some 1e-12.
    near("continuous", found.cutting_time_min, time, 1e-9, 0.0);
    near("continuous", time, 35.98, 0.0, 5e-3);
    let times = least_times(&found.z_mm, &feed, 8);
    for (own, least) in found.by_segments.iter().zip(&times) {
        near(&format!("{} zones", own.segments), own.cutting_time_min, *least, 1e-9, 0.0);
    }
    for (least, printed) in times.iter().zip([40.475, 39.328, 38.180, 37.808, 37.436]) {
        near("printed", *least, printed, 0.0, 5e-4);
    }
    // The zones answered are a program of their own: its gap is 1e-9, their ceilings stand 1e-6 higher.
    let answered = found.by_segments.iter().find(|one| one.segments == found.segments).unwrap();
    assert!(answered.loss_percent <= 5.0 && found.loss_reached && found.segments > 1);
    near("zones", outcome.cutting_time_min, answered.cutting_time_min, 2e-6, 0.0);
    keeps_below(&outcome);
}

/// The fall of the time with one percent is shared among the limits: what a zone owes to its own limits is not told as a
/// price of the gradient.
#[test]
fn prices_under_a_gradient_are_those_of_what_binds() {
    let outcome = solved(uniform(GRADIENT_PER_MM));
    let prices = multipliers(&outcome);
    let time = outcome.cutting_time_min;
    let middle = LENGTH_MM / 2.0;
    for zone in &outcome.zones {
        let of = |limit: &str| prices.get(&format!("{limit}@{}", zone.id)).copied().unwrap_or(0.0);
        // Time falls with the zone's share of it; the feed with the deflection limit's power 1/0.6. What the list of prices
        // leaves out is below 1e-4.
        let share = zone.cutting_time_min / time;
        near(&zone.id, of("deflection") * FEED_EXPONENT + of("feed_gradient"), share, 0.0, 2e-4);
        let holds_middle = zone.z_start_mm <= middle && zone.z_end_mm >= middle;
        assert_eq!(of("deflection") > 0.0, holds_middle, "{}", zone.id);
        assert_eq!(of("feed_gradient") > 0.0, !holds_middle, "{}", zone.id);
    }
    // A single feed has no gradient: it is what the weakest place allows, 1e-9 of the compliance and the program's gap.
    let single = outcome.comparison.constant_feed.unwrap();
    near("single feed", single.feed_mm_per_rev, ln_limit(middle, DEFLECTION_MAX_UM).exp(), 1e-7, 0.0);
}

/// With another tolerance the gradient starts from other limits: the same zones below the schedule that these have.
#[test]
fn a_trade_off_under_a_gradient_smooths_anew() {
    let mut job = uniform(GRADIENT_PER_MM);
    job["trade_off"] = json!({ "limit": "deflection", "factor_from": 0.6, "factor_to": 2.0, "count": 3 });
    let outcome = solved(job);
    let z = &outcome.continuous.as_ref().unwrap().z_mm;
    assert_eq!(outcome.trade_off.len(), 3);
    for point in &outcome.trade_off {
        let feed = smooth(z, GRADIENT_PER_MM, point.factor * DEFLECTION_MAX_UM);
        let of_zone = |from: f64, to: f64| {
            let within = z.iter().zip(&feed).filter(|(z, _)| **z >= from - 1e-9 && **z <= to + 1e-9);
            pace(within.map(|(_, feed)| *feed).fold(f64::INFINITY, f64::min)) * (to - from)
        };
        let time: f64 = outcome.zones.iter().map(|zone| of_zone(zone.z_start_mm, zone.z_end_mm)).sum();
        near(&format!("{}", point.factor), point.cutting_time_min.unwrap(), time, 2e-6, 0.0);
    }
}

/// Six zones of different diameters, depths and limits, in every mode of the speed, with what couples them.
#[test]
fn zones_under_a_gradient_are_never_faster_than_the_continuous_schedule() {
    let mut base = translate(&reference("multi-zone-time.json")["input"]);
    for (zone, depth_mm) in base["zones"].as_array_mut().unwrap().iter_mut().zip([0.2, 0.5, 0.3, 0.4, 0.2, 0.5]) {
        zone["depth_mm"] = json!(depth_mm);
        zone["deflection_max_um"] = json!(30.0);
    }
    base["method"] = json!({ "kind": "continuous", "grid_points": 121, "loss_percent": 1.0, "segments_max": 12 });
    let fixed = json!({ "speed": "fixed", "fixed_speed_m_per_min": 40.0 });
    for variables in [json!({}), json!({ "speed": "constant_speed" }), json!({ "speed": "constant_rpm" }), fixed] {
        for usage in [0.4, 4.0] {
            for change_min in [0.0, 2.0] {
                let mut job = base.clone();
                job["variables"] = variables.clone();
                job["limits"]["tool_usage_max"] = json!(usage);
                job["objective"] = json!({ "kind": "time", "tool_change_time_min": change_min });
                let free = solved(job.clone()).continuous.unwrap().cutting_time_min;
                job["method"]["feed_gradient_per_mm"] = json!(0.0008);
                let outcome = solved(job);
                keeps_below(&outcome);
                let smooth = outcome.continuous.unwrap().cutting_time_min;
                // Without a price on the edge the gradient can only cost; both are solved to 1e-8.
                assert!(change_min > 0.0 || smooth >= free * (1.0 - 1e-7), "{variables} {usage}: {smooth} < {free}");
            }
        }
    }
}

/// One usage limit over two depths has no one cap on the feed: then the points are a program. Nothing else varies along
/// the zones, so two zones lose nothing, and the optimum over the given zones is the same.
#[test]
fn a_usage_limit_over_several_depths_has_a_continuous_schedule() {
    let zone = |id: &str, z: f64, depth: f64| json!({ "id": id, "z_start_mm": z, "z_end_mm": z + 200.0, "diameter_mm": 60.0, "depth_mm": depth, "roughness_max_um": 20.0 });
    let mut job = json!({
        "zones": [zone("a", 0.0, 0.5), zone("b", 200.0, 2.0)],
        "models": {
            "tool_life": { "form": "log_log", "constant": 14.0, "speed_exponent": -2.5, "feed_exponent": -1.6, "depth_exponent": -0.7 },
            "roughness": { "form": "log_log", "constant": 4.0, "feed_exponent": 0.9 },
        },
        "limits": { "feed_min_mm_per_rev": 0.01, "feed_max_mm_per_rev": 2.0, "speed_min_m_per_min": 50.0, "speed_max_m_per_min": 200.0, "tool_usage_max": 0.02 },
        "variables": { "speed": "fixed", "fixed_speed_m_per_min": 100.0 },
        "objective": { "kind": "time" },
    });
    let given = solved(job.clone());
    assert!(
        given.tool_usage.unwrap() > 0.02 * (1.0 - 1e-6)
            && given.zones[0].feed_mm_per_rev > given.zones[1].feed_mm_per_rev * 1.1
    );
    job["method"] = json!({ "kind": "continuous", "grid_points": 41 });
    let outcome = solved(job);
    let found = outcome.continuous.as_ref().unwrap();
    assert_eq!(found.segments, 2);
    // Both programs are solved to a gap of 1e-9.
    near("continuous", found.cutting_time_min, given.cutting_time_min, 1e-7, 0.0);
    near("zones", outcome.cutting_time_min, given.cutting_time_min, 1e-7, 0.0);
}
