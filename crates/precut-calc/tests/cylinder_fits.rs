//! Cylinders through points: closed forms, and proofs that an independent search cannot break.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use std::f64::consts::TAU;

use precut_calc::num::cylinder::{Axis, CylinderError, Envelope, Kind, Point, envelope, least_squares, median_line};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const KINDS: [Kind; 3] = [Kind::MinimumZone, Kind::Inscribed, Kind::Circumscribed];
const HEIGHTS_MM: [f64; 5] = [0.0, 25.0, 50.0, 75.0, 100.0];

/// A body of radius r(angle, height) whose sections' centres lie off the axis, inclined and away from the origin.
fn body(
    radius: impl Fn(f64, f64) -> f64,
    centre: impl Fn(f64) -> [f64; 2],
    heights: &[f64],
    count: usize,
    tilt: [f64; 2],
) -> Vec<Point> {
    let frame = Axis::through([3.0, 7.0, 0.0], [3.0 + tilt[0], 7.0 + tilt[1], 1.0]);
    let mut points = Vec::new();
    for &z in heights {
        for k in 0..count {
            let angle = TAU * k as f64 / count as f64;
            let [x, y] = centre(z);
            points.push(frame.place_mm([x + radius(angle, z) * angle.cos(), y + radius(angle, z) * angle.sin()], z));
        }
    }
    points
}

fn straight(_z: f64) -> [f64; 2] {
    [0.0; 2]
}

fn fits(points: &[Point]) -> [Envelope; 3] {
    let axis = least_squares(points).unwrap().axis;
    KINDS.map(|kind| envelope(kind, points, axis, &|| true).unwrap())
}

/// What the kind makes small, about any axis.
fn value_mm(kind: Kind, axis: &Axis, points: &[Point]) -> f64 {
    let distances = points.iter().map(|point| axis.local(*point).distance_mm);
    let (low, high) = distances.fold((f64::INFINITY, 0.0_f64), |(l, h), d| (l.min(d), h.max(d)));
    match kind {
        Kind::MinimumZone => high - low,
        Kind::Inscribed => -low,
        Kind::Circumscribed => high,
    }
}

#[test]
fn a_perfect_cylinder_anywhere_has_none() {
    for tilt in [[0.0, 0.0], [0.02, -0.01], [0.3, 0.2]] {
        let points = body(|_, _| 25.0, straight, &HEIGHTS_MM, 36, tilt);
        let least = least_squares(&points).unwrap();
        assert!(least.farthest_mm - least.nearest_mm < 1e-12, "{tilt:?}: {least:?}");
        assert!((least.radius_mm - 25.0).abs() < 1e-12);
        for found in fits(&points) {
            assert!(found.width_mm() < 1e-12, "{tilt:?}: {}", found.width_mm());
            assert!(found.proof.gap_mm < 1e-12);
        }
    }
}

#[test]
fn cone_barrel_bend_and_lobes_have_their_closed_forms() {
    let tilt = [0.002, -0.001];
    // Cone: no axis does better than its own; half of what the diameter changes.
    let cone = body(|_, z| 25.0 + 1e-4 * z, straight, &HEIGHTS_MM, 36, tilt);
    // Barrel: the middle against the ends.
    let barrel = body(|_, z| 25.0 - 0.01 * ((z - 50.0) / 50.0).powi(2), straight, &HEIGHTS_MM, 36, tilt);
    // Bent: the axis goes half way between the ends and the middle, each off it by half of the bend.
    let bent = body(|_, _| 25.0, |z| [0.01 * ((z - 50.0) / 50.0).powi(2), 0.0], &HEIGHTS_MM, 36, tilt);
    // Lobes that go straight along the axis: the roundness of any section.
    let lobed = body(|angle, _| 25.0 + 0.005 * (3.0 * angle).cos(), straight, &HEIGHTS_MM, 360, tilt);
    for (name, points) in [("cone", &cone), ("barrel", &barrel), ("bent", &bent), ("lobed", &lobed)] {
        let zone = &fits(points)[0];
        // Of the bend a distance across its plane knows the square: 0.005²/2/25 mm.
        assert!((zone.width_mm() - 0.01).abs() < 1e-6, "{name}: {}", zone.width_mm());
        assert!(zone.proof.gap_mm < 1e-6, "{name}: {:?}", zone.proof);
    }
    assert!((fits(&barrel)[1].inner_mm - 24.99).abs() < 1e-6);
    assert!((fits(&lobed)[2].outer_mm - 25.005).abs() < 1e-6);
}

/// No axis among thousands, and no search from anywhere, is better than the proof allows; and the search comes as far.
#[test]
fn no_search_finds_a_cylinder_that_the_proof_excludes() {
    let mut random = Pcg64::seed_from_u64(25);
    let mut come_near = 0;
    for trial in 0..40 {
        let mut any = || random.random_range(-1.0..1.0_f64);
        let radius = 10f64.powf(1.3 + any());
        let length = radius * 10f64.powf(0.3 + 0.6 * any());
        let width = radius.min(25.0) * 10f64.powf(-3.7 + any());
        let shape: [f64; 4] = std::array::from_fn(|_| any());
        let tilt = [0.1 * any(), 0.1 * any()];
        let sections = 2 + trial % 5;
        let heights: Vec<f64> = (0..sections).map(|k| length * k as f64 / (sections - 1) as f64).collect();
        let form = |angle: f64, z: f64| {
            let q = z / length;
            let lobes = shape[0] * (2.0 * angle + 1.0).cos() + shape[1] * (3.0 * angle + 2.0 * q).cos();
            radius + width * (lobes + shape[2] * q + shape[3] * q * q)
        };
        let bend = |z: f64| [width * shape[3] * (z / length).powi(2), 0.3 * width * shape[1] * z / length];
        let rough = |point: Point| [point[0] + 0.5 * width * any(), point[1] + 0.5 * width * any(), point[2]];
        let points: Vec<Point> = body(form, bend, &heights, 8 + trial, tilt).into_iter().map(rough).collect();
        for (kind, found) in KINDS.into_iter().zip(fits(&points)) {
            let now = value_mm(kind, &found.axis, &points);
            let within = found.proof.within_mm;
            assert!(within > found.width_mm(), "trial {trial} {kind:?}: {:?}", found.proof);
            let half = found.half_mm;
            let moved = |ends: [f64; 4]| {
                let low = found.axis.place_mm([ends[2], ends[3]], -half);
                Axis::through(low, found.axis.place_mm([ends[0], ends[1]], half))
            };
            let mut least = now;
            for _ in 0..100 {
                let size = within * 10f64.powf(-3.0 + 3.0 * random.random_range(-1.0..1.0_f64));
                let ends = std::array::from_fn(|_| size.min(within) * random.random_range(-1.0..1.0_f64));
                least = least.min(value_mm(kind, &moved(ends), &points));
            }
            // A search of its own: random steps that shrink where none is better.
            let mut size = (4.0 * found.width_mm()).min(0.2 * within);
            let mut at: [f64; 4] = std::array::from_fn(|_| size * random.random_range(-1.0..1.0_f64));
            let mut best = value_mm(kind, &moved(at), &points);
            while size > 1e-8 * radius {
                let mut gained = false;
                for _ in 0..24 {
                    let to = at.map(|end| end + size * random.random_range(-1.0..1.0_f64));
                    let there = value_mm(kind, &moved(to), &points);
                    if there < best && to.iter().all(|end| end.abs() <= within) {
                        (best, at, gained) = (there, to, true);
                    }
                }
                size *= if gained { 1.0 } else { 0.6 };
            }
            least = least.min(best);
            assert!(
                least >= now - found.proof.gap_mm,
                "trial {trial} {kind:?}: {least} below {now}: {:?}",
                found.proof
            );
            come_near += usize::from(best - now < 0.02 * found.width_mm());
        }
    }
    // A search that never comes near would prove nothing.
    assert!(come_near > 100, "{come_near} of 120");
}

/// On cylinders as they are turned the bound and the value meet.
#[test]
fn the_proof_is_tight_on_usual_proportions() {
    let mut random = Pcg64::seed_from_u64(26);
    for trial in 0..40 {
        let (radius, share) = (5.0 + 5.0 * f64::from(trial), 0.5 + 0.1 * f64::from(trial));
        let heights: Vec<f64> = (0..4).map(|k| f64::from(k) / 3.0 * share * radius).collect();
        let mut points = body(|_, _| radius, straight, &heights, 40, [0.001, 0.002]);
        points.iter_mut().flatten().for_each(|v| *v += 0.003 * random.random_range(-1.0..1.0_f64));
        let zone = &fits(&points)[0];
        assert!(zone.proof.gap_mm < 1e-3 * zone.width_mm(), "trial {trial}: {:?} of {}", zone.proof, zone.width_mm());
        assert!(zone.contacts.len() <= 6, "{:?}", zone.contacts);
    }
}

#[test]
fn a_fit_that_nobody_waits_for_stops() {
    let points = body(|angle, _| 25.0 + 0.01 * (2.0 * angle).cos(), straight, &HEIGHTS_MM, 36, [0.0, 0.0]);
    let axis = least_squares(&points).unwrap().axis;
    assert_eq!(envelope(Kind::MinimumZone, &points, axis, &|| false), Err(CylinderError::Stopped));
}

#[test]
fn what_determines_no_cylinder_is_refused() {
    let plane = body(|_, _| 25.0, straight, &[10.0], 36, [0.0, 0.0]);
    assert_eq!(least_squares(&plane), Err(CylinderError::Undetermined));
    let few = body(|_, _| 25.0, straight, &[0.0, 10.0], 2, [0.0, 0.0]);
    assert_eq!(least_squares(&few), Err(CylinderError::Undetermined));
}

#[test]
fn the_straightness_of_centres_has_its_closed_forms() {
    // Three centres: the middle one off the line of the ends is met half way.
    let bow = median_line(&[[0.0, 0.0, 0.0], [0.01, 0.0, 50.0], [0.0, 0.0, 100.0]]).unwrap();
    assert!((bow.diameter_mm - 0.01).abs() < 1e-10, "{bow:?}");
    // Centres on a helix of whole turns about a straight line: its diameter.
    let helix: Vec<Point> = (0..=200)
        .map(|k| {
            [5.0 + 0.01 * (TAU * f64::from(k) / 40.0).cos(), 0.01 * (TAU * f64::from(k) / 40.0).sin(), f64::from(k)]
        })
        .collect();
    let thin = median_line(&helix).unwrap();
    assert!((thin.diameter_mm - 0.02).abs() < 1e-9, "{}", thin.diameter_mm);
    // Two centres are straight.
    assert!(median_line(&[[1.0, 2.0, 0.0], [3.0, 4.0, 10.0]]).unwrap().diameter_mm < 1e-12);
}

#[test]
fn no_line_holds_centres_closer_than_the_bound() {
    let mut random = Pcg64::seed_from_u64(27);
    for _ in 0..20 {
        let mut any = || random.random_range(-0.01..0.01_f64);
        let centres: Vec<Point> = (0..8).map(|k| [any(), any(), f64::from(k)]).collect();
        let found = median_line(&centres).unwrap();
        let radius = |ends: [f64; 4]| {
            let off = |c: &Point| {
                let up = c[2] / 7.0;
                (c[0] - up * ends[0] - (1.0 - up) * ends[2]).hypot(c[1] - up * ends[1] - (1.0 - up) * ends[3])
            };
            centres.iter().map(off).fold(0.0, f64::max)
        };
        let [high, low] = found.ends_mm;
        let at = [high[0], high[1], low[0], low[1]];
        assert!((2.0 * radius(at) - found.diameter_mm).abs() < 1e-12);
        for size in [1e-5, 1e-4, 1e-3, 1e-2] {
            for _ in 0..200 {
                let there = radius(at.map(|end| end + size * random.random_range(-1.0..1.0_f64)));
                assert!(2.0 * there >= found.diameter_mm - found.gap_mm);
            }
        }
    }
}
