//! Reference circles: certificates checked from outside, brute force on small sets, invariance, refusals.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    missing_docs
)]

use std::f64::consts::{PI, TAU};

use precut_calc::num::roundness::{
    Circles, Grid, RoundnessError, Section, circles, least_squares, maximum_inscribed, minimum_circumscribed,
    minimum_zone,
};
use proptest::prelude::*;

type Point = [f64; 2];

fn section(points: &[Point]) -> Section {
    let (x, y): (Vec<f64>, Vec<f64>) = points.iter().map(|p| (p[0], p[1])).unzip();
    Section::from_points(&x, &y).unwrap()
}

fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Round-off between two ways to the same number: a few dozen units of the last place of the largest coordinate.
fn slack(points: &[Point]) -> f64 {
    points.iter().flatten().fold(1e-300, |most, v| v.abs().max(most)) * 64.0 * f64::EPSILON
}

/// The place equally far from a and b and from c and d, by Cramer's rule.
fn equidistant(a: Point, b: Point, c: Point, d: Point) -> Option<Point> {
    let half = |p: Point, q: Point| 0.5 * (q[0] * q[0] + q[1] * q[1] - p[0] * p[0] - p[1] * p[1]);
    let (m, n) = ([b[0] - a[0], b[1] - a[1]], [d[0] - c[0], d[1] - c[1]]);
    let det = m[0] * n[1] - m[1] * n[0];
    let (p, q) = (half(a, b), half(c, d));
    (det.abs() > 1e-9).then(|| [(p * n[1] - q * m[1]) / det, (m[0] * q - n[0] * p) / det])
}

fn extremes(points: &[Point], centre: Point) -> (f64, f64) {
    points.iter().map(|&p| distance(p, centre)).fold((f64::INFINITY, 0.0), |(low, high), d| (low.min(d), high.max(d)))
}

/// Narrowest zone about any centre at which two points are farthest and two nearest.
fn brute_zone(points: &[Point]) -> f64 {
    let n = points.len();
    let mut best = f64::INFINITY;
    for (i, j) in pairs(n) {
        for (k, l) in pairs(n) {
            if [k, l].contains(&i) || [k, l].contains(&j) {
                continue;
            }
            if let Some(c) = equidistant(points[i], points[j], points[k], points[l]) {
                let (low, high) = extremes(points, c);
                let touches = |index: usize, at: f64| (distance(points[index], c) - at).abs() < 1e-9;
                if touches(i, high) && touches(k, low) {
                    best = best.min(high - low);
                }
            }
        }
    }
    best
}

/// Largest empty circle about a centre that three points hold between them.
fn brute_inscribed(points: &[Point]) -> f64 {
    let n = points.len();
    let mut best = 0.0_f64;
    for (i, j) in pairs(n) {
        for k in j + 1..n {
            if let Some(c) = equidistant(points[i], points[j], points[i], points[k]) {
                let (low, _) = extremes(points, c);
                let spokes = [i, j, k].map(|index| points[index]);
                if (distance(points[i], c) - low).abs() < 1e-9 && holds(c, &spokes) {
                    best = best.max(low);
                }
            }
        }
    }
    best
}

/// Smallest circle through two or three points that holds all.
fn brute_circumscribed(points: &[Point]) -> f64 {
    let n = points.len();
    let mut best = f64::INFINITY;
    for (i, j) in pairs(n) {
        let [a, b] = [points[i], points[j]];
        let mut centres = vec![[f64::midpoint(a[0], b[0]), f64::midpoint(a[1], b[1])]];
        centres.extend((j + 1..n).filter_map(|k| equidistant(a, b, a, points[k])));
        for c in centres {
            let (_, high) = extremes(points, c);
            if (high - distance(a, c)).abs() < 1e-9 {
                best = best.min(high);
            }
        }
    }
    best
}

fn pairs(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |i| (i + 1..n).map(move |j| (i, j)))
}

/// Whether points surround a centre: no gap between neighbouring directions of half a turn or more.
fn holds(centre: Point, points: &[Point]) -> bool {
    largest_gap(centre, points) < PI
}

fn largest_gap(centre: Point, points: &[Point]) -> f64 {
    let mut angles: Vec<f64> = points.iter().map(|p| (p[1] - centre[1]).atan2(p[0] - centre[0])).collect();
    angles.sort_by(f64::total_cmp);
    let around = angles[0] + TAU - angles[angles.len() - 1];
    angles.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f64::max)
}

/// Verifies every certificate with nothing but distances and angles.
fn verify(points: &[Point], found: &Circles) {
    let slack = slack(points);
    let mz = &found.minimum_zone;
    let zone = extremes(points, mz.centre_mm);
    assert!((zone.0 - mz.inner_radius_mm).abs() <= slack && (zone.1 - mz.outer_radius_mm).abs() <= slack);
    let on = |indices: &[usize], centre: Point, radius: f64| {
        indices.iter().all(|&i| (distance(points[i], centre) - radius).abs() <= slack)
    };
    assert!(on(&mz.outer_contacts, mz.centre_mm, mz.outer_radius_mm), "outer contacts: {mz:?}");
    assert!(on(&mz.inner_contacts, mz.centre_mm, mz.inner_radius_mm), "inner contacts: {mz:?}");
    let angle = |&i: &usize| (points[i][1] - mz.centre_mm[1]).atan2(points[i][0] - mz.centre_mm[0]);
    let mut around: Vec<(f64, bool)> = mz.outer_contacts.iter().map(|i| (angle(i), true)).collect();
    around.extend(mz.inner_contacts.iter().map(|i| (angle(i), false)));
    around.sort_by(|a, b| a.0.total_cmp(&b.0));
    if mz.width_mm() > slack {
        assert!(around[0].1 != around[1].1 && around[1].1 != around[2].1 && around[2].1 != around[3].1, "{around:?}");
    }
    let mi = &found.inscribed;
    assert!(extremes(points, mi.circle.centre_mm).0 >= mi.circle.radius_mm - slack);
    assert!(on(&mi.contacts, mi.circle.centre_mm, mi.circle.radius_mm), "{mi:?}");
    assert!(largest_gap(mi.circle.centre_mm, &mi.contacts.map(|i| points[i])) <= PI + 1e-6, "{mi:?}");
    for other in &mi.others {
        assert!(on(&other.contacts, other.circle.centre_mm, other.circle.radius_mm));
        assert!(extremes(points, other.circle.centre_mm).0 >= mi.circle.radius_mm - slack);
    }
    let mc = &found.circumscribed;
    assert!(extremes(points, mc.circle.centre_mm).1 <= mc.circle.radius_mm + slack);
    let (i, j, k) = mc.contacts;
    let contacts: Vec<usize> = [Some(i), Some(j), k].into_iter().flatten().collect();
    assert!(on(&contacts, mc.circle.centre_mm, mc.circle.radius_mm), "{mc:?}");
    let contacts: Vec<Point> = contacts.into_iter().map(|i| points[i]).collect();
    assert!(largest_gap(mc.circle.centre_mm, &contacts) <= PI + 1e-6, "{mc:?}");
    // The order that the definitions demand.
    let width = mz.width_mm();
    for other in [found.least_squares.span, mi.span, mc.span] {
        assert!(width <= other.width_mm() + slack, "{width} > {}", other.width_mm());
    }
    assert!(mc.circle.radius_mm <= mz.outer_radius_mm + slack);
    if mi.is_global {
        assert!(mi.circle.radius_mm >= mz.inner_radius_mm - slack);
    }
}

/// Centres round the certified one, near and far within the disc of the proof, are not better.
fn probe(points: &[Point], found: &Circles) {
    let slack = slack(points);
    for i in 0..40 {
        let direction = TAU * f64::from(i) / 40.0;
        for share in [1e-6, 1e-3, 0.1, 0.9] {
            let mz = &found.minimum_zone;
            let moved = |centre: Point, by: f64| [centre[0] + by * direction.cos(), centre[1] + by * direction.sin()];
            let zone = extremes(points, moved(mz.centre_mm, share * mz.certified_within_mm));
            assert!(zone.1 - zone.0 >= mz.lower_bound_mm - slack, "a narrower zone: {:e}", zone.1 - zone.0);
            let mi = &found.inscribed;
            let reached = extremes(points, moved(mi.circle.centre_mm, share * mi.certified_within_mm)).0;
            assert!(reached <= mi.circle.radius_mm + slack, "a larger circle: {reached}");
            let mc = &found.circumscribed;
            let reached = extremes(points, moved(mc.circle.centre_mm, share * mc.circle.radius_mm)).1;
            assert!(reached >= mc.circle.radius_mm - slack, "a smaller circle: {reached}");
        }
    }
}

/// Points at increasing angles all the way round, radii within a share of the mean.
fn ring(sizes: std::ops::Range<usize>, share: f64) -> impl Strategy<Value = Vec<Point>> {
    (prop::collection::vec((0.05_f64..0.95, -1.0_f64..1.0), sizes), 1.0_f64..200.0).prop_map(move |(draws, radius)| {
        let n = draws.len() as f64;
        let point = |(i, (jitter, deviation)): (usize, (f64, f64))| {
            let (angle, r) = (TAU * (i as f64 + jitter) / n, radius * (1.0 + share * deviation));
            [r * angle.cos(), r * angle.sin()]
        };
        draws.into_iter().enumerate().map(point).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Small sets: no other quadruple, triple or pair does better.
    #[test]
    fn no_circle_found_by_trial_is_better(points in ring(6..12, 0.02)) {
        let Ok(found) = circles(&section(&points), &|| true) else {
            // Six points at the ends of their sectors may leave half a turn free.
            return Ok(());
        };
        verify(&points, &found);
        probe(&points, &found);
        let slack = slack(&points).max(1e-12);
        let zone = brute_zone(&points);
        if found.minimum_zone.is_global {
            prop_assert!((zone - found.minimum_zone.width_mm()).abs() < slack, "{zone} {:?}", found.minimum_zone);
        } else {
            prop_assert!(zone <= found.minimum_zone.width_mm() + slack);
        }
        let inscribed = brute_inscribed(&points);
        let got = found.inscribed.circle.radius_mm;
        prop_assert!(got <= inscribed + slack, "{got} > {inscribed}");
        prop_assert!(inscribed <= got + found.inscribed.radius_gap_mm + slack, "{inscribed} {:?}", found.inscribed);
        let circumscribed = brute_circumscribed(&points);
        prop_assert!((circumscribed - found.circumscribed.circle.radius_mm).abs() < slack);
    }

    /// Deviations of the order of the radius, far from any roundness: still the right answer or an honest refusal.
    #[test]
    fn stars_are_answered_too(points in ring(8..16, 0.5)) {
        let section = section(&points);
        let start = least_squares(&section, &|| true).unwrap().circle.centre_mm;
        let mc = minimum_circumscribed(&section, start, &|| true).unwrap();
        prop_assert!((brute_circumscribed(&points) - mc.circle.radius_mm).abs() < slack(&points).max(1e-12));
        if let Ok(mi) = maximum_inscribed(&section, start, &|| true) {
            let best = brute_inscribed(&points);
            prop_assert!(mi.circle.radius_mm <= best + slack(&points));
            prop_assert!(!mi.is_global || mi.circle.radius_mm >= best - 1e-9, "{best} {mi:?}");
        }
        if let Ok(mz) = minimum_zone(&section, start, &|| true) {
            prop_assert!(!mz.is_global || mz.width_mm() <= brute_zone(&points) + 1e-9);
        }
    }

    /// Profiles of a usual size: certificates hold, and probing about them finds nothing better.
    #[test]
    fn certificates_hold(points in ring(30..120, 0.001)) {
        let found = circles(&section(&points), &|| true).unwrap();
        verify(&points, &found);
        probe(&points, &found);
        prop_assert!(found.minimum_zone.is_global, "{:?}", found.minimum_zone);
        prop_assert!(found.inscribed.is_global, "{:?}", found.inscribed);
    }

    /// Turning, shifting and scaling a section turns, shifts and scales its circles, and nothing else.
    #[test]
    fn circles_move_with_the_section(
        points in ring(20..60, 0.005),
        angle in 0.0..TAU,
        shift in (-500.0_f64..500.0, -500.0_f64..500.0),
        scale in 0.01_f64..100.0,
    ) {
        let found = circles(&section(&points), &|| true).unwrap();
        let (sin, cos) = angle.sin_cos();
        let map = |[x, y]: Point| [scale * (cos * x - sin * y) + shift.0, scale * (sin * x + cos * y) + shift.1];
        let moved: Vec<Point> = points.iter().map(|&p| map(p)).collect();
        let there = circles(&section(&moved), &|| true).unwrap();
        // The points themselves are rounded when they are moved.
        let slack = slack(&moved) + scale * slack(&points);
        let same = |a: f64, b: f64| (scale * a - b).abs() <= slack;
        prop_assert!(same(found.minimum_zone.width_mm(), there.minimum_zone.width_mm()));
        prop_assert!(same(found.inscribed.circle.radius_mm, there.inscribed.circle.radius_mm));
        prop_assert!(same(found.circumscribed.circle.radius_mm, there.circumscribed.circle.radius_mm));
        prop_assert!(same(found.least_squares.circle.radius_mm, there.least_squares.circle.radius_mm));
        prop_assert!(same(found.least_squares.rms_mm, there.least_squares.rms_mm));
        prop_assert!(same(found.least_squares.peak_mm, there.least_squares.peak_mm));
        prop_assert!(same(found.least_squares.valley_mm, there.least_squares.valley_mm));
        let ls = map(found.least_squares.circle.centre_mm);
        prop_assert!(distance(ls, there.least_squares.circle.centre_mm) <= 4.0 * slack);
        let mz = map(found.minimum_zone.centre_mm);
        let allowed = slack / found.minimum_zone.stiffness;
        prop_assert!(distance(mz, there.minimum_zone.centre_mm) <= 4.0 * allowed);
        // The order of the points says nothing.
        let mut turned = points.clone();
        turned.reverse();
        turned.rotate_left(points.len() / 3);
        let again = circles(&section(&turned), &|| true).unwrap();
        prop_assert!((again.minimum_zone.width_mm() - found.minimum_zone.width_mm()).abs() <= slack / scale);
    }

    /// The least-squares circle is where the derivative of the sum of squares vanishes, arcs included.
    #[test]
    fn the_sum_of_squares_is_least(points in ring(12..60, 0.01), part in 0.3_f64..1.0) {
        let kept: Vec<Point> = points[..((points.len() as f64 * part) as usize).max(6)].to_vec();
        let found = least_squares(&section(&kept), &|| true).unwrap();
        let sum = |centre: Point| {
            let d: Vec<f64> = kept.iter().map(|&p| distance(p, centre)).collect();
            let mean = d.iter().sum::<f64>() / d.len() as f64;
            d.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>()
        };
        let [x, y] = found.circle.centre_mm;
        let least = sum([x, y]);
        for i in 0..16 {
            let (sin, cos) = (TAU * f64::from(i) / 16.0).sin_cos();
            for by in [1e-5, 1e-3, 0.05] {
                let radius = found.circle.radius_mm;
                prop_assert!(sum([x + by * radius * cos, y + by * radius * sin]) >= least * (1.0 - 1e-12));
            }
        }
        prop_assert!((found.rms_mm * found.rms_mm * kept.len() as f64 - least).abs() <= 1e-9 * least);
    }
}

#[test]
fn an_eccentric_true_circle_has_no_error() {
    // A circle 2 mm off its origin: the limaçon would leave 2²/(2·25) = 0.08 mm.
    let points: Vec<Point> =
        (0..360).map(|i| f64::from(i).to_radians()).map(|a| [2.0 + 25.0 * a.cos(), 1.0 + 25.0 * a.sin()]).collect();
    let found = circles(&section(&points), &|| true).unwrap();
    for width in [found.least_squares.span.width_mm(), found.minimum_zone.width_mm(), found.inscribed.span.width_mm()] {
        assert!(width < slack(&points), "{width:e}");
    }
    assert!(distance(found.least_squares.circle.centre_mm, [2.0, 1.0]) < slack(&points));
}

/// A regular three-lobed and four-lobed figure by closed form, and the ties of the latter.
#[test]
fn lobed_figures_in_closed_form() {
    let grid = Grid::new(3600).unwrap();
    for (lobes, amplitude) in [(3.0, 0.005), (4.0, 0.02), (7.0, 0.001)] {
        let radii: Vec<f64> =
            (0..3600).map(|i| 20.0 + amplitude * (lobes * f64::from(i).to_radians() / 10.0).cos()).collect();
        let found = circles(&grid.section(&radii).unwrap(), &|| true).unwrap();
        // A peak or valley lies between two of the angles at most half a step off: short of the full by A(kh/2)²/2.
        let between = amplitude * (lobes * PI / 3600.0).powi(2) / 2.0 + 1e-13;
        assert!((found.minimum_zone.width_mm() - 2.0 * amplitude).abs() <= 2.0 * between, "{lobes}");
        assert!((found.inscribed.circle.radius_mm - (20.0 - amplitude)).abs() <= between, "{lobes}");
        assert!((found.circumscribed.circle.radius_mm - (20.0 + amplitude)).abs() <= between, "{lobes}");
        assert!((found.least_squares.rms_mm - amplitude / 2.0_f64.sqrt()).abs() < 1e-12);
    }
}

#[test]
fn what_has_no_circle_is_refused() {
    let line: Vec<Point> = (0..20).map(|i| [f64::from(i), 2.0 * f64::from(i)]).collect();
    assert_eq!(least_squares(&section(&line), &|| true), Err(RoundnessError::NoCircle));
    assert_eq!(least_squares(&section(&[[1.0, 1.0]; 8]), &|| true), Err(RoundnessError::NoCircle));
    assert_eq!(minimum_circumscribed(&section(&[[1.0, 1.0]; 8]), [1.0, 1.0], &|| true), Err(RoundnessError::NoCircle));
    let few = least_squares(&section(&[[0.0, 0.0], [1.0, 0.0]]), &|| true);
    assert_eq!(few, Err(RoundnessError::TooFewPoints { count: 2, needed: 3 }));
    let arc: Vec<Point> =
        (0..30).map(|i| f64::from(i).to_radians() * 3.0).map(|a| [9.0 * a.cos(), 9.0 * a.sin()]).collect();
    assert_eq!(maximum_inscribed(&section(&arc), [0.0, 0.0], &|| true), Err(RoundnessError::NotSurrounding));
    // A quarter still has its least-squares circle and its zone.
    let ls = least_squares(&section(&arc), &|| true).unwrap();
    assert!(distance(ls.circle.centre_mm, [0.0, 0.0]) < 1e-12);
    assert!(minimum_zone(&section(&arc), ls.circle.centre_mm, &|| true).unwrap().width_mm() < 1e-13);
    assert_eq!(Section::from_points(&[0.0, f64::NAN], &[0.0, 1.0]), Err(RoundnessError::NotFinite { index: 1 }));
    assert_eq!(Section::from_points(&[0.0, 1.0], &[0.0]), Err(RoundnessError::LengthsDiffer { first: 2, second: 1 }));
    assert_eq!(Section::from_points(&[], &[]), Err(RoundnessError::TooFewPoints { count: 0, needed: 1 }));
}
