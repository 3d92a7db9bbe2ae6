//! What acts at a depth of cut acts at that of each zone and pass: Kienzle's force, and the depths of roughing and finishing.
#![allow(clippy::unwrap_used, missing_docs)]

use crate::feed_support::{near, solved};
use serde_json::{Value, json};

const KAPPA_DEG: f64 = 75.0;
const CUTTING: (f64, f64) = (2100.0, 0.26);
const NORMAL: (f64, f64) = (900.0, 0.35);

/// Main and passive force along the nose and the straight edge by the formula itself: k h^(1-m) over every piece of the edge,
/// h = s sin(angle); the passive one is the normal's part across the shaft.
fn kienzle(radius_mm: f64, depth_mm: f64, feed_mm_per_rev: f64) -> (f64, f64) {
    let kappa = KAPPA_DEG.to_radians();
    let nose_mm = radius_mm * (1.0 - kappa.cos());
    let end = if depth_mm >= nose_mm { kappa } else { (1.0 - depth_mm / radius_mm).acos() };
    let straight_mm = (depth_mm - nose_mm).max(0.0) / kappa.sin();
    let chip = |(force, exponent): (f64, f64), angle: f64| force * (feed_mm_per_rev * angle.sin()).powf(1.0 - exponent);
    let pieces = 20_000;
    let width = end / f64::from(pieces);
    let (mut main, mut passive) = (0.0, 0.0);
    for k in 0..pieces {
        let angle = (f64::from(k) + 0.5) * width;
        main += chip(CUTTING, angle) * radius_mm * width;
        passive += chip(NORMAL, angle) * angle.cos() * radius_mm * width;
    }
    (main + chip(CUTTING, kappa) * straight_mm, passive + chip(NORMAL, kappa) * kappa.cos() * straight_mm)
}

#[test]
fn kienzle_acts_at_the_depth_of_every_zone() {
    for radius_mm in [0.0, 0.8] {
        let zone = |(k, depth_mm): (usize, f64)| {
            json!({ "id": format!("z{k}"), "z_start_mm": 50.0 * k as f64, "z_end_mm": 50.0 * (k + 1) as f64, "diameter_mm": 60.0,
                "depth_mm": depth_mm, "compliance_um_per_n": 0.05, "deflection_max_um": 8.0 })
        };
        // A nose of 0.8 mm ends at a depth of 0.593 mm.
        let depths_mm = [0.2, 0.5, 1.5, 3.0];
        let zones: Vec<Value> = depths_mm.into_iter().enumerate().map(zone).collect();
        let outcome = solved(json!({
            "zones": zones,
            "force": { "kind": "kienzle", "cutting_edge_angle_deg": KAPPA_DEG, "nose_radius_mm": radius_mm,
                "specific_cutting_force_n_per_mm2": CUTTING.0, "cutting_exponent": CUTTING.1,
                "specific_normal_force_n_per_mm2": NORMAL.0, "normal_exponent": NORMAL.1 },
            "machine": { "power_kw": 15.0, "efficiency": 1.0 },
            "limits": { "feed_min_mm_per_rev": 0.02, "feed_max_mm_per_rev": 0.6, "speed_min_m_per_min": 50.0, "speed_max_m_per_min": 150.0 },
            "objective": { "kind": "time" },
        }));
        let mut bent = 0;
        for (zone, depth_mm) in outcome.zones.iter().zip(depths_mm) {
            let (main, passive) = kienzle(radius_mm, depth_mm, zone.feed_mm_per_rev);
            let what = format!("radius {radius_mm}, depth {depth_mm}");
            near(&format!("{what}: main force"), zone.force_z_n.unwrap(), main, 1e-6, 0.0);
            near(&format!("{what}: passive force"), zone.force_y_n.unwrap(), passive, 1e-6, 0.0);
            near(&format!("{what}: deflection"), zone.deflection_um.unwrap(), 0.05 * passive, 1e-6, 0.0);
            assert!(0.05 * passive <= 8.0 * (1.0 + 1e-6), "{what}: {passive}");
            bent += usize::from(zone.active.iter().any(|limit| limit == "deflection"));
        }
        assert!(bent > 0, "no feed was found by the force");
    }
}

/// The finishing pass has a range of depths of its own: kept, and the best in it is found.
#[test]
fn finishing_is_as_thin_as_it_may_be_beside_thick_roughing() {
    let base: Value = serde_json::from_str(include_str!("../src/feed_schedule/examples/passes.json")).unwrap();
    assert!(solved(base.clone()).passes.unwrap().finishing_depth_mm >= 1.0);
    let apart = |least_mm: f64, most_mm: f64| {
        let mut job = base.clone();
        job["passes"]["finishing_depth_min_mm"] = json!(least_mm);
        job["passes"]["finishing_depth_max_mm"] = json!(most_mm);
        solved(job)
    };
    let outcome = apart(0.3, 0.6);
    let passes = outcome.passes.clone().unwrap();
    let (finishing_mm, roughing_mm) = (passes.finishing_depth_mm, passes.roughing_depth_mm.unwrap());
    assert!((0.3 - 1e-9..=0.6 + 1e-9).contains(&finishing_mm), "{finishing_mm}");
    assert!((1.0 - 1e-9..=3.0 + 1e-9).contains(&roughing_mm), "{roughing_mm}");
    near("depth of all passes", finishing_mm + f64::from(passes.roughing_passes) * roughing_mm, 6.0, 1e-9, 0.0);
    for given_mm in [0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6] {
        let given = apart(given_mm, given_mm);
        near("given depth", given.passes.as_ref().unwrap().finishing_depth_mm, given_mm, 1e-9, 0.0);
        assert!(outcome.objective <= given.objective * (1.0 + 1e-6), "{given_mm}: {}", given.objective);
    }
}
