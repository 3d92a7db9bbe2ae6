//! Spikes: recognised, listed, left out where that is asked for; and what is said of them, done.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::f64::consts::TAU;

use crate::draw::Draw;
use precut_calc::calculator::{Answer, Calculator, Check, Unwatched, Violations};
use precut_calc::ring_roundness::evaluation::{Job, Outcome, RepairKind, RoundnessEvaluation};
use serde_json::{Value, json};

fn solve(job: &Value) -> Answer<Outcome> {
    let mut job: Job = serde_json::from_value(job.clone()).unwrap();
    RoundnessEvaluation::fill(&mut job);
    RoundnessEvaluation::run(&job, &Unwatched).unwrap()
}

fn codes(job: &Value) -> Vec<&'static str> {
    let job: Job = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec().iter().map(|fault| fault.code).collect()
}

/// Form and roughness of a turned section, mm.
fn section(seed: u64, n: usize) -> Vec<f64> {
    let mut draw = Draw::new(seed);
    let waves: Vec<(f64, f64, f64)> =
        (0..4).map(|_| (draw.between(2.0, 9.0).floor(), draw.between(0.0, 0.004), draw.between(0.0, TAU))).collect();
    let roughness = 10.0_f64.powf(draw.between(-5.0, -3.3));
    let mut normal = move || roughness * ((0..12).map(|_| draw.share()).sum::<f64>() - 6.0);
    (0..n)
        .map(|i| {
            let angle = TAU * i as f64 / n as f64;
            25.0 + waves.iter().map(|(k, mm, at)| mm * (k * angle - at).cos()).sum::<f64>() + normal()
        })
        .collect()
}

fn radii(section: &[f64]) -> Value {
    let n = section.len() as f64;
    let row = |(i, r): (usize, &f64)| json!({ "angle_deg": 360.0 * i as f64 / n, "radius_mm": r });
    section.iter().enumerate().map(row).collect()
}

#[test]
fn a_surface_without_spikes_has_none() {
    let sizes = [60, 180, 720, 3600];
    for seed in 0..60 {
        let n = sizes[usize::try_from(seed).unwrap() % 4];
        let found = solve(&json!({ "radii": radii(&section(seed, n)) })).output;
        assert!(found.data.spikes.is_empty(), "{seed} {n}: {:?}", found.data.spikes);
    }
}

#[test]
fn spikes_are_listed_with_place_and_height_and_left_out_where_asked() {
    for seed in 0..40 {
        let n = [180, 720, 3600][usize::try_from(seed).unwrap() % 3];
        let clean = section(seed, n);
        let mut draw = Draw::new(900 + seed);
        let mut dirty = clean.clone();
        let mut put: Vec<(usize, f64)> = (0..3)
            .map(|third| {
                let at = (draw.between(0.05, 0.28) * n as f64) as usize + third * n / 3;
                (at, draw.between(0.02, 0.06) * if draw.share() < 0.3 { -1.0 } else { 1.0 })
            })
            .collect();
        for (at, mm) in &put {
            dirty[*at] += mm;
        }
        put.sort_by_key(|(at, _)| *at);
        let mut job = json!({ "radii": radii(&dirty) });
        let kept = solve(&job);
        let mut spikes = kept.output.data.spikes.clone();
        spikes.sort_by_key(|spike| spike.row);
        let rows: Vec<usize> = spikes.iter().map(|spike| spike.row).collect();
        assert_eq!(rows, put.iter().map(|(at, _)| *at).collect::<Vec<_>>(), "{seed} {n}: {spikes:?}");
        for (spike, (_, mm)) in spikes.iter().zip(&put) {
            // The line between the readings beside it is off by form and roughness.
            assert!((spike.height_um - 1e3 * mm).abs() < 6.0, "{seed}: {spike:?} {mm}");
        }
        let warning = kept.warnings.iter().find(|warning| warning.code == "spike_suspected").unwrap();
        assert_eq!(warning.pointer, "/radii");
        // What is said to come without them comes.
        job["spikes"] = json!("remove");
        let without = solve(&job);
        assert_eq!(kept.output.data.roundness_without_spikes_um, Some(without.output.roundness_um));
        assert!(without.warnings.iter().all(|warning| warning.code != "spike_suspected"));
        let repair =
            without.output.data.repairs.iter().find(|repair| repair.kind == RepairKind::SpikesLeftOut).unwrap();
        assert_eq!(repair.count, 3);
        assert_eq!(without.output.data.points, n - 3);
        // And is what the clean section gives, but for the three readings.
        let clean = solve(&json!({ "radii": radii(&clean) })).output.roundness_um;
        assert!((without.output.roundness_um - clean).abs() < 0.05 + 0.1 * clean, "{seed}: {clean}");
    }
}

/// A scratch anywhere beside a keyway, of few readings: each by itself. One that touches the keyway is part of it.
#[test]
fn a_scratch_in_the_shadow_of_a_keyway_is_told_apart() {
    let (mut apart, mut named) = (0, 0);
    for seed in 0..72 {
        let mut draw = Draw::new(5000 + seed);
        let mut section = section(seed, 120);
        let start = draw.between(0.0, 120.0) as usize;
        (start..start + 6).for_each(|at| section[at % 120] -= 0.8);
        // From one side of the keyway round to the other.
        let after = usize::try_from(seed).unwrap() * 113 / 71;
        let at = (start + 6 + after) % 120;
        section[at] -= draw.between(0.02, 0.06);
        let spikes = solve(&json!({ "radii": radii(&section) })).output.data.spikes;
        let keyways = spikes.iter().filter(|spike| spike.points >= 6 && spike.height_um < -700.0).count();
        assert!(keyways == 1 && spikes.len() <= 2, "{seed}: {spikes:?}");
        if (1..113).contains(&after) {
            apart += 1;
            named += usize::from(spikes.iter().any(|spike| spike.row == at && spike.points == 1));
        }
    }
    assert!(apart >= 68 && named + 2 >= apart, "{named} of {apart}");
}

/// A keyway into which the probe dips: refused as no round section, with the remedy, which works.
#[test]
fn a_keyway_is_left_out_where_asked() {
    let mut section = section(3, 720);
    (100..130).for_each(|at| section[at] -= 3.5);
    let mut job = json!({ "radii": radii(&section) });
    assert_eq!(codes(&job), ["not_round"]);
    job["spikes"] = json!("remove");
    assert_eq!(codes(&job), Vec::<&str>::new());
    let found = solve(&job).output;
    assert_eq!(found.data.spikes.len(), 1, "{:?}", found.data.spikes);
    assert!((found.data.spikes[0].height_um + 3500.0).abs() < 20.0 && found.data.spikes[0].points == 30);
    assert!(found.roundness_um < 20.0, "{}", found.roundness_um);
}
