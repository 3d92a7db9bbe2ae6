//! What is refused: the remedy that the message names works, and a neighbour by a rounding is treated alike.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::draw::Draw;
use crate::ring_support::{faults, trials, try_run};
use precut_calc::calculator::{Failure, Finding};
use serde_json::{Value, json};

/// A set-up of which most are impossible in some way.
fn wild(seed: u64) -> Value {
    let mut draw = Draw::new(60_000 + seed);
    let radius = 10.0_f64.powf(draw.between(0.8, 2.6));
    let roller = if draw.share() < 0.5 { 0.0 } else { radius * draw.between(0.02, 0.5) };
    let (beta, tool) = (draw.between(5.0, 100.0).to_radians(), draw.between(-60.0, 240.0));
    let reach = radius + roller;
    let tip = radius * (1.0 + draw.between(-0.12, 0.03));
    let toward = if draw.share() < 0.7 { 180.0 } else { draw.between(0.0, 360.0) };
    json!({
        "ring": { "radius_mm": radius, "ellipticity_mm": radius * 10.0_f64.powf(draw.between(-5.0, -0.9)) },
        "supports": { "distance_mm": 2.0 * reach * draw.between(0.1, 1.05), "depth_mm": reach * beta.cos(), "roller_radius_mm": roller },
        "tool": {
            "x_mm": tip * tool.to_radians().cos(), "y_mm": tip * tool.to_radians().sin(),
            "feed_direction_deg": (tool + toward).rem_euclid(360.0), "feed_mm_per_rev": radius * 10.0_f64.powf(draw.between(-6.0, -2.0)),
            "revolutions": draw.between(1.0, 30.0).round(), "spark_out_revolutions": 1
        },
        "samples": ([358, 360, 720, 200_000][(draw.share() * 3.99) as usize])
    })
}

fn number(job: &Value, place: &str) -> f64 {
    job.pointer(place).unwrap().as_f64().unwrap()
}

fn set(job: &mut Value, place: &str, value: f64) {
    *job.pointer_mut(place).unwrap() = json!(value);
}

/// The job with the remedy of a fault taken; `None` where the message names no change of one number.
fn mended(job: &Value, fault: &Finding) -> Option<Value> {
    let mut job = job.clone();
    let (radius, roller) = (number(&job, "/ring/radius_mm"), number(&job, "/supports/roller_radius_mm"));
    let feed = number(&job, "/tool/feed_mm_per_rev");
    match fault.code {
        // "bring the supports closer together or cut less"
        "ring_falls_through" | "ring_jams" if fault.pointer == "/supports/distance_mm" => {
            set(&mut job, "/supports/distance_mm", 1.2 * (radius + roller));
        }
        "ring_falls_through" | "ring_jams" | "feed_too_deep" => set(&mut job, "/tool/revolutions", 1e-2),
        "deviation_too_large" => set(&mut job, "/ring/ellipticity_mm", 0.09 * radius),
        // "multiples of 4 from 360"
        "bad_samples" => job["samples"] = json!(360),
        "run_too_long" => set(&mut job, "/tool/revolutions", 1.0),
        // "start further back": along the feed.
        "tool_too_deep" => {
            // More than the depth where the feed is askew.
            let back = 6.0 * fault.value.unwrap();
            let direction = number(&job, "/tool/feed_direction_deg").to_radians();
            let (x, y) = (number(&job, "/tool/x_mm"), number(&job, "/tool/y_mm"));
            set(&mut job, "/tool/x_mm", x - back * direction.cos());
            set(&mut job, "/tool/y_mm", y - back * direction.sin());
        }
        // "or give more revolutions or feed"
        "tool_out_of_reach" => set(&mut job, "/tool/revolutions", 1.05 * fault.value.unwrap() / feed + 1.0),
        _ => return None,
    }
    Some(job)
}

#[test]
fn the_remedy_of_a_refusal_works() {
    let mut tried = std::collections::BTreeMap::new();
    for seed in 0..trials(60).max(60) {
        let job = wild(seed);
        for fault in faults(&job) {
            let Some(mended) = mended(&job, &fault) else { continue };
            // A feed askew goes past the ring whatever the start.
            let askew =
                fault.code == "tool_too_deep" && faults(&mended).iter().any(|f| f.code == "feed_away_from_ring");
            let left = faults(&mended);
            let same = left.iter().any(|found| found.code == fault.code && found.pointer == fault.pointer);
            assert!(!same || askew, "{seed}: {fault:?} is left of {job}: {left:?}");
            *tried.entry(fault.code).or_insert(0) += 1;
        }
    }
    assert!(tried.len() >= 5, "{tried:?}");
}

#[test]
fn a_neighbour_by_a_rounding_is_treated_alike() {
    const LENGTHS: [&str; 5] =
        ["/ring/radius_mm", "/supports/distance_mm", "/supports/depth_mm", "/tool/x_mm", "/tool/y_mm"];
    let codes = |job: &Value| faults(job).iter().map(|fault| fault.code).collect::<Vec<_>>();
    for seed in 0..trials(60) {
        let job = wild(seed);
        let expected = codes(&job);
        for place in LENGTHS {
            let value = number(&job, place);
            for next in [value.next_up(), value.next_down(), (value * 1e9).round() / 1e9] {
                let mut beside = job.clone();
                set(&mut beside, place, next);
                assert_eq!(codes(&beside), expected, "{seed}: {place} {value} {next}");
            }
        }
    }
}

/// A run that ends without an answer names the way out, and that way has an answer.
#[test]
fn a_run_that_fails_is_mended_as_its_message_says() {
    let mut mended = 0;
    for seed in 0..trials(40).max(40) {
        let mut draw = Draw::new(70_000 + seed);
        let radius = draw.between(20.0, 150.0);
        let beta = draw.between(25.0, 50.0).to_radians();
        let gap = draw.between(0.01, 0.3);
        let travel = gap * draw.between(0.2, 0.95);
        let job = json!({
            "ring": { "radius_mm": radius, "ellipticity_mm": 0.002 * gap },
            "supports": { "distance_mm": 2.0 * radius * beta.sin(), "depth_mm": radius * beta.cos() },
            "tool": { "x_mm": 0, "y_mm": radius + gap, "feed_mm_per_rev": travel / 10.0, "revolutions": 10, "spark_out_revolutions": 1 },
            "samples": 720
        });
        assert!(faults(&job).is_empty(), "{seed}");
        let Err(Failure::Infeasible(finding)) = try_run(&job) else { panic!("{seed}: {job}") };
        assert_eq!(finding.code, "nothing_cut");
        // "start nearer": by the smallest gap left.
        let mut nearer = job.clone();
        set(&mut nearer, "/tool/y_mm", radius + gap - 1.001e-3 * finding.value.unwrap());
        assert!(try_run(&nearer).is_ok(), "{seed}: {finding:?}");
        // "or give more revolutions": as many as the gap asks for.
        let mut longer = job;
        set(&mut longer, "/tool/revolutions", 10.0 * (1.0 + 1.01e-3 * finding.value.unwrap() / travel));
        assert!(try_run(&longer).is_ok(), "{seed}: {finding:?}");
        mended += 1;
    }
    assert!(mended >= 40);
}
