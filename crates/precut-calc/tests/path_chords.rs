//! The fewest-chord path against the plain search, the reference cases and its own promise.
#![allow(clippy::unwrap_used, clippy::cast_precision_loss, missing_docs)]

use precut_calc::calculator::{Failure, Message, Monitor, Unwatched};
use precut_calc::path::{
    achieved_deviation, deviation_budget, fewest_chords, fewest_chords_watched, round_to_increment, simplified,
};
use proptest::prelude::*;
use serde_json::Value;

fn reference() -> Value {
    let path =
        format!("{}/tests/reference/deflection-compensation/path.json", concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The profile of `path.json`: radius of the tool over the shaft.
fn papers_profile(count: usize) -> (Vec<f64>, Vec<f64>) {
    let (length, diameter, modulus, force) = (2000.0_f64, 90.0_f64, 210_000.0, 194.514_761_116_527_07);
    let second_moment = std::f64::consts::PI * diameter.powi(4) / 64.0;
    let (headstock, tailstock) = (5e-5 / 1.75, 1e-4 / 1.75);
    let z: Vec<f64> = (0..count).map(|i| length * i as f64 / (count - 1) as f64).collect();
    let r = z.iter().map(|&x| {
        let beam = (x * (length - x)).powi(2) / (3.0 * modulus * second_moment * length);
        let springs = (1.0 - x / length).powi(2) * headstock + (x / length).powi(2) * tailstock + headstock;
        0.5 * diameter - force * (beam + springs)
    });
    let r = r.collect();
    (z, r)
}

/// Largest deviation of the unrounded chords, station by station.
fn deviation(z: &[f64], r: &[f64], vertices: &[usize]) -> f64 {
    let diameters: Vec<f64> = vertices.iter().map(|&vertex| 2.0 * r[vertex]).collect();
    achieved_deviation(z, r, vertices, &diameters)
}

/// The yardstick: every pair of stations tried by its own deviations, level by level.
fn fewest_by_every_pair(z: &[f64], r: &[f64], tolerance: f64) -> usize {
    let last = z.len() - 1;
    let mut chords = vec![usize::MAX; z.len()];
    chords[0] = 0;
    for to in 1..=last {
        for from in 0..to {
            if chords[from] < chords[to].saturating_sub(1) && deviation(z, r, &[from, to]) <= tolerance {
                chords[to] = chords[from] + 1;
            }
        }
    }
    chords[last]
}

/// The plain breadth-first search with cones of slopes, for longer profiles.
fn fewest_by_plain_search(z: &[f64], r: &[f64], tolerance: f64) -> usize {
    let last = z.len() - 1;
    let mut chords = vec![usize::MAX; z.len()];
    chords[0] = 0;
    let mut level = vec![0];
    while chords[last] == usize::MAX {
        let mut next = Vec::new();
        for &from in &level {
            let (mut least, mut largest) = (f64::NEG_INFINITY, f64::INFINITY);
            for to in from + 1..=last {
                let (run, rise) = (z[to] - z[from], r[to] - r[from]);
                if chords[to] == usize::MAX && least <= rise / run && rise / run <= largest {
                    chords[to] = chords[from] + 1;
                    next.push(to);
                }
                least = least.max((rise - tolerance) / run);
                largest = largest.min((rise + tolerance) / run);
                if least > largest {
                    break;
                }
            }
        }
        level = next;
    }
    chords[last]
}

#[test]
fn every_reference_count_is_met() {
    let cases = reference();
    for case in cases["cases"].as_array().unwrap() {
        let count = usize::try_from(case["stations"].as_u64().unwrap()).unwrap();
        let tolerance = case["tolerance_radial"].as_f64().unwrap();
        let (z, r) = papers_profile(count);
        let vertices = fewest_chords(&z, &r, tolerance);
        assert_eq!(vertices.len() as u64 - 1, case["fewest_segments"].as_u64().unwrap(), "{count}, {tolerance}");
        assert!(deviation(&z, &r, &vertices) <= tolerance * (1.0 + 1e-9));
    }
}

#[test]
fn ten_thousand_stations_have_the_count_of_the_plain_search() {
    let (z, r) = papers_profile(10_000);
    for (tolerance, expected) in [(1e-4, 26), (5e-4, 11), (2e-3, 6)] {
        let vertices = fewest_chords(&z, &r, tolerance);
        assert_eq!(vertices.len() - 1, expected);
        assert_eq!(fewest_by_plain_search(&z, &r, tolerance), expected);
        assert!(deviation(&z, &r, &vertices) <= tolerance * (1.0 + 1e-9));
    }
}

#[test]
fn a_straight_line_is_one_chord_at_no_tolerance() {
    for count in [2, 3, 100, 20_000] {
        let z: Vec<f64> = (0..count).map(|i| 0.1 * f64::from(i)).collect();
        let r: Vec<f64> = z.iter().map(|z| 45.0 + 0.003 * z).collect();
        assert_eq!(fewest_chords(&z, &r, 0.0), vec![0, z.len() - 1]);
    }
}

#[test]
fn at_no_tolerance_every_corner_is_a_vertex() {
    let z: Vec<f64> = (0..300).map(f64::from).collect();
    let zigzag: Vec<f64> = (0..300).map(|i| f64::from(i % 2)).collect();
    assert_eq!(fewest_chords(&z, &zigzag, 0.0).len(), 300);
    // Runs of equal slope, a corner every ten stations.
    let roof: Vec<f64> = (0..300).map(|i| f64::from((i % 20 - 10_i32).abs())).collect();
    let corners: Vec<usize> = (0..300).filter(|i| i % 10 == 0).chain([299]).collect();
    assert_eq!(fewest_chords(&z, &roof, 0.0), corners);
}

#[test]
fn out_of_tolerance_and_back_in_is_found() {
    // From the first station no chord reaches 2 to 4, but one reaches 5: the cone stays open while
    // stations lie outside of it. A walk that stops at the first one out of reach would miss it.
    let z: Vec<f64> = (0..6).map(f64::from).collect();
    let r = [0.0, 0.9, -0.9, 0.9, -0.9, 0.0];
    assert_eq!(fewest_chords(&z, &r, 1.0), vec![0, 5]);
    assert!(deviation(&z, &r, &[0, 2]) > 1.0);
}

#[test]
fn few_stations_and_odd_ones_are_welcome() {
    assert!(fewest_chords(&[], &[], 0.1).is_empty());
    assert_eq!(fewest_chords(&[1.0], &[2.0], 0.1), vec![0]);
    assert_eq!(fewest_chords(&[1.0, 2.0], &[2.0, 9.0], 0.0), vec![0, 1]);
    // Coinciding stations, no numbers, a negative tolerance: an answer from end to end, no panic.
    let z = [0.0, 1.0, 1.0, 1.0, 2.0, 3.0];
    for r in [[1.0, 2.0, 2.0, 3.0, 1.0, 1.0], [1.0, f64::NAN, 1.0, f64::INFINITY, 1.0, 1.0]] {
        let vertices = fewest_chords(&z, &r, -1.0);
        assert_eq!((vertices[0], *vertices.last().unwrap()), (0, 5));
        assert!(vertices.is_sorted());
    }
}

#[test]
fn two_hundred_thousand_stations_are_followed_within_tolerance() {
    let (z, r) = papers_profile(200_000);
    let vertices = fewest_chords(&z, &r, 1e-4);
    assert_eq!(vertices.len() - 1, 26);
    assert!(deviation(&z, &r, &vertices) <= 1e-4 * (1.0 + 1e-9));
}

#[test]
fn the_search_is_cancelled_when_nobody_waits() {
    struct Gone;
    impl Monitor for Gone {
        fn cancelled(&self) -> bool {
            true
        }
        fn progress(&self, _fraction: f64, _stage: Message) {}
    }
    let (z, r) = papers_profile(100);
    assert_eq!(fewest_chords_watched(&z, &r, 1e-4, &Gone), Err(Failure::Cancelled));
}

#[test]
fn rounding_is_half_away_from_zero_in_decimals() {
    for (value, expected) in [
        (89.977_769, 89.978),
        (89.884_68, 89.885),
        (89.966_654, 89.967),
        (0.000_5, 0.001),
        (-0.000_5, -0.001),
        (1.000_5, 1.001),
        (2.675_5, 2.676),
        (89.999_499, 89.999),
        (0.0, 0.0),
    ] {
        let rounded = round_to_increment(value, 0.001);
        assert!((rounded - expected).abs() < 1e-15, "{value}: {rounded:?}");
        assert_eq!(format!("{rounded}"), format!("{expected}"), "the nearest double");
    }
    assert!((round_to_increment(10.000_26, 0.000_5) - 10.000_5).abs() < 1e-15);
    assert!((round_to_increment(10.3, 2.5) - 10.0).abs() < 1e-15);
    for increment in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!((round_to_increment(1.234, increment) - 1.234).abs() < 1e-15);
    }
    assert!(round_to_increment(f64::NAN, 0.001).is_nan());
}

#[test]
fn rounded_paths_stay_within_the_budget_and_say_what_they_reach() {
    let (z, r) = papers_profile(1001);
    for (tolerance, increment) in [(5e-4, 1e-3), (1e-4, 1e-2), (0.0, 1e-3)] {
        let path = simplified(&z, &r, tolerance, increment, &Unwatched).unwrap();
        assert!(path.deviation_mm <= deviation_budget(tolerance, increment) + 1e-12);
        // By hand: interpolate between the rounded ends at every station.
        let mut worst = 0.0_f64;
        for (ends, diameters) in path.vertices.windows(2).zip(path.diameters_mm.windows(2)) {
            for k in ends[0]..=ends[1] {
                let share = (z[k] - z[ends[0]]) / (z[ends[1]] - z[ends[0]]);
                let radius = 0.5 * (diameters[0] + share * (diameters[1] - diameters[0]));
                worst = worst.max((radius - r[k]).abs());
            }
        }
        assert!((worst - path.deviation_mm).abs() < 1e-12, "{worst} {}", path.deviation_mm);
        assert!(worst > 0.0);
    }
}

#[test]
fn a_single_station_is_a_path() {
    let path = simplified(&[3.0], &[10.000_3], 0.01, 0.001, &Unwatched).unwrap();
    assert_eq!(path.vertices, vec![0]);
    assert!((path.diameters_mm[0] - 20.001).abs() < 1e-12);
    assert!((path.deviation_mm - 0.000_2).abs() < 1e-12);
}

/// Steps between stations, and radii of several tempers: noise, waves, few distinct values.
fn profiles() -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    let noise = prop::collection::vec(-1.0..1.0_f64, 3..260);
    let grid = prop::collection::vec((-3..4_i32).prop_map(f64::from), 3..260);
    let walk = prop::collection::vec(-0.2..0.2_f64, 3..260).prop_map(|steps| {
        steps
            .iter()
            .scan(0.0, |sum, step| {
                *sum += step;
                Some(*sum)
            })
            .collect::<Vec<f64>>()
    });
    let wave = (3..260_usize, 0.01..0.5_f64, 0.0..3.0_f64)
        .prop_map(|(count, rate, slope)| (0..count).map(|i| (rate * i as f64).sin() + slope * i as f64).collect());
    prop_oneof![noise, grid, walk, wave].prop_flat_map(|r: Vec<f64>| {
        let count = r.len();
        (prop::collection::vec(0.05..2.0_f64, count), Just(r)).prop_map(|(steps, r)| {
            (
                steps
                    .iter()
                    .scan(0.0, |z, step| {
                        *z += step;
                        Some(*z)
                    })
                    .collect(),
                r,
            )
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn the_count_is_the_least_and_the_chords_hold((z, r) in profiles(), tolerance in 0.001..1.5_f64) {
        let vertices = fewest_chords(&z, &r, tolerance);
        prop_assert_eq!(vertices[0], 0);
        prop_assert_eq!(*vertices.last().unwrap(), z.len() - 1);
        prop_assert!(vertices.windows(2).all(|pair| pair[0] < pair[1]));
        prop_assert!(deviation(&z, &r, &vertices) <= tolerance * (1.0 + 1e-9) + 1e-12);
        let expected = fewest_by_every_pair(&z, &r, tolerance * (1.0 + 1e-12) + 1e-13);
        prop_assert_eq!(vertices.len() - 1, expected);
    }

    #[test]
    fn long_profiles_agree_with_the_plain_search(
        seed in prop::collection::vec(-1.0..1.0_f64, 12),
        noise in 0.0..0.3_f64,
        tolerance in 0.02..0.5_f64,
    ) {
        let z: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.5).collect();
        let r: Vec<f64> = z.iter().enumerate().map(|(i, z)| {
            let wave = |k: usize| seed[k] * (z * 0.004 * (k + 1) as f64 + seed[11 - k]).sin();
            let jitter = ((i * 7919 % 1009) as f64 / 504.5 - 1.0) * noise;
            45.0 + (0..6).map(wave).sum::<f64>() + jitter
        }).collect();
        let vertices = fewest_chords(&z, &r, tolerance);
        prop_assert_eq!(vertices.len() - 1, fewest_by_plain_search(&z, &r, tolerance));
        prop_assert!(deviation(&z, &r, &vertices) <= tolerance * (1.0 + 1e-9));
    }

    #[test]
    fn rounding_moves_by_half_an_increment_at_most(value in -200.0..200.0_f64, step in 1..50_u32) {
        let increment = f64::from(step) * 1e-4;
        let rounded = round_to_increment(value, increment);
        prop_assert!((rounded - value).abs() <= 0.5 * increment + 1e-12);
        let count = rounded / increment;
        prop_assert!((count - count.round()).abs() < 1e-9);
    }
}
