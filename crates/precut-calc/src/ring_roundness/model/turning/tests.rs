#![allow(clippy::unwrap_used)]

use super::*;
use std::f64::consts::TAU;

fn ellipse(n: u32) -> Vec<f64> {
    let (a, b) = (150.25_f64, 149.75_f64);
    (0..n)
        .map(|i| {
            let t = TAU * f64::from(i) / f64::from(n);
            a * b / ((b * t.cos()).powi(2) + (a * t.sin()).powi(2)).sqrt()
        })
        .collect()
}

fn seed(tip_y_mm: f64, feed: f64, revolutions: f64, spark_out: f64) -> Setting {
    Setting {
        support_a_mm: [-100.0, -111.0],
        support_b_mm: [100.0, -111.0],
        roller_radius_mm: 0.0,
        tip_start_mm: [100.0, tip_y_mm],
        feed_direction: [0.0, -1.0],
        feed_mm_per_rev: feed,
        revolutions,
        spark_out_revolutions: spark_out,
        compliance_ratio: 0.0,
        wheel_radius_mm: None,
        motion: Motion::default(),
    }
}

fn run(profile: &[f64], setting: &Setting) -> Turned {
    turn::<Stuck>(profile, setting, &mut |_, _| Ok(())).unwrap()
}

#[test]
fn steps_side_by_side_find_what_single_steps_find() {
    // A wheel far larger than the ring's roughness forbids the lanes and cuts like a tip, up to its sides: of 1e9 mm it
    // has none. The error of the location is 1e-9 mm in both.
    let tip = run(&ellipse(1440), &seed(113.5, 0.08, 30.5, 0.75));
    let mut setting = seed(113.5, 0.08, 30.5, 0.75);
    setting.motion.runout_a.push(Oscillation { amplitude_mm: 0.0, ratio: 3.0, phase_rad: 0.1 });
    let moving = run(&ellipse(1440), &setting);
    assert_eq!(tip.steps, moving.steps);
    for (p, q) in tip.radii_mm.iter().zip(&moving.radii_mm) {
        assert!((p - q).abs() < 1e-8, "{p} {q}");
    }
}

#[test]
fn location_leaves_less_than_a_nanometre() {
    let profile = ellipse(3600);
    let setting = seed(113.5, 0.02, 20.0, 0.0);
    let turned = run(&profile, &setting);
    // Nothing was cut on the first revolutions, so the ring there still is the ellipse: the exact one, not the nodes.
    let exact = |theta: f64| 150.25 * 149.75 / ((149.75 * theta.cos()).powi(2) + (150.25 * theta.sin()).powi(2)).sqrt();
    assert!(turned.first_contact_rev.unwrap() > 2.0);
    let short = run(&profile, &seed(113.5, 0.02, 2.0, 0.0));
    assert_eq!(short.radii_mm, profile);
    for place in &short.path {
        for support in [setting.support_a_mm, setting.support_b_mm] {
            let arm = plane::sub(support, place.centre_mm);
            let left = plane::norm(arm) - exact(plane::angle(arm) - place.turned_rad);
            assert!(left.abs() < 1e-9, "{left}");
        }
    }
}

/// What the algorithm as published gives, peak to valley about the least-squares circle: a property of the number of
/// samples. Figures of an independent implementation.
#[test]
fn nearest_samples_give_what_their_number_gives() {
    for (n, feed, turns, expected_um) in [
        (90_u32, 1.5 / 256.0, 256.0, 39.0),
        (180, 1.5 / 256.0, 256.0, 49.0),
        (360, 1.5 / 256.0, 256.0, 54.0),
        (380, 1.5 / 256.0, 256.0, 7.2),
        (440, 1.5 / 256.0, 256.0, 3.9),
        (500, 1.5 / 256.0, 256.0, 4.3),
        (500, 1.5 / 64.0, 64.0, 18.5),
        (500, 1.5 / 32.0, 32.0, 37.0),
    ] {
        let points: Vec<[f64; 2]> = (0..n)
            .map(|i| {
                let t = TAU * f64::from(i) / f64::from(n);
                [150.25 * t.cos(), 149.75 * t.sin()]
            })
            .collect();
        let sampled =
            turn_sampled::<Stuck>(&points, &seed(112.5, feed, turns, 0.0), &mut |_| Ok(()), &mut |_| Ok(())).unwrap();
        assert!(!sampled.torn);
        let (x, y): (Vec<f64>, Vec<f64>) = sampled.points_mm.iter().map(|p| (p[0], p[1])).unzip();
        let section = crate::num::roundness::Section::from_points(&x, &y).unwrap();
        let found = crate::num::roundness::least_squares(&section, &|| true).unwrap().span.width_mm() * 1e3;
        // Printed to two digits.
        assert!((found - expected_um).abs() < 0.02 * expected_um, "{n}: {found} {expected_um}");
    }
    let points: Vec<[f64; 2]> = (0..400_u32).map(|i| plane::direction(TAU * f64::from(i) / 400.0)).collect();
    let points: Vec<[f64; 2]> = points.iter().map(|p| [150.25 * p[0], 149.75 * p[1]]).collect();
    let sampled =
        turn_sampled::<Stuck>(&points, &seed(112.5, 1.5 / 256.0, 256.0, 0.0), &mut |_| Ok(()), &mut |_| Ok(()))
            .unwrap();
    assert!(sampled.torn);
}

#[test]
fn a_large_wheel_leaves_what_a_tip_leaves_but_for_the_teeth() {
    let tip = run(&ellipse(1440), &seed(113.5, 0.05, 50.0, 1.0));
    let mut setting = seed(113.5, 0.05, 50.0, 1.0);
    setting.wheel_radius_mm = Some(100.0);
    let wheel = run(&ellipse(1440), &setting);
    let range = |turned: &Turned| {
        turned.radii_mm.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), r| (low.min(*r), high.max(*r)))
    };
    let ((tip_low, tip_high), (low, high)) = (range(&tip), range(&wheel));
    // The wheel's sides take the flanks of the teeth: never higher than the tip leaves, never below the feed's end.
    assert!(high <= tip_high + 1e-6 && low >= tip_low - 0.02, "{low} {high} {tip_low} {tip_high}");
    assert!(high - low > 1e-4);
}

/// Where nodes are narrow, the flank that the tip leaves at its first bite is a wall to a support that comes by.
#[test]
fn a_support_climbs_a_flank_that_is_steeper_than_a_node_is_wide() {
    let setting = seed(112.5, 0.005_859_375, 256.0, 0.0);
    let (coarse, fine) = (run(&ellipse(18_000), &setting), run(&ellipse(36_000), &setting));
    // At a flank the radius jumps by the feed, and its place is known to a node; between the flanks they agree.
    let mut apart: Vec<f64> =
        coarse.radii_mm.iter().zip(fine.radii_mm.iter().step_by(2)).map(|(p, q)| (p - q).abs()).collect();
    apart.sort_by(f64::total_cmp);
    assert!(apart[9000] < 0.01 * setting.feed_mm_per_rev, "{} mm in the middle", apart[9000]);
    assert!(apart[17_999] < 2.0 * setting.feed_mm_per_rev, "{} mm at most", apart[17_999]);
}
