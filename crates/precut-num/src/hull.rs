//! How far a point lies outside the convex hull of others.

use super::dense::{Columns, Qr, dot, length};

/// A gain below this share of the points' squared size is rounding.
const ROUNDING: f64 = 1e-13;

/// Distance from `target` to the convex hull of `points`, 0 inside (to 1e-6 of the points' spread), by Wolfe's algorithm
/// (Mathematical Programming 11 (1976) 128): finite, exact but for rounding. `None` without points.
pub fn distance_to_hull(points: &[Vec<f64>], target: &[f64]) -> Option<f64> {
    let shifted: Vec<Vec<f64>> =
        points.iter().map(|point| point.iter().zip(target).map(|(p, t)| p - t).collect()).collect();
    let size = shifted.iter().map(|p| dot(p, p)).fold(0.0, f64::max);
    let nearest = (0..shifted.len()).min_by(|&a, &b| length(&shifted[a]).total_cmp(&length(&shifted[b])))?;
    let mut corral = Corral { members: vec![nearest], weights: vec![1.0] };
    let mut x = shifted[nearest].clone();
    // Every round lowers the distance and no corral comes twice; the bound only guards against rounding.
    for _ in 0..100 + 10 * shifted.len() {
        let reach = |i: usize| dot(&x, &shifted[i]);
        let Some(next) = (0..shifted.len()).min_by(|&a, &b| reach(a).total_cmp(&reach(b))) else { break };
        if dot(&x, &x) - reach(next) <= ROUNDING * size || corral.members.contains(&next) {
            break;
        }
        corral.members.push(next);
        corral.weights.push(0.0);
        corral.settle(&shifted);
        x = corral.point(&shifted, target.len());
    }
    let distance = length(&x);
    Some(if distance <= 1e-6 * size.sqrt() { 0.0 } else { distance })
}

/// Points whose convex combination is the nearest so far.
struct Corral {
    members: Vec<usize>,
    weights: Vec<f64>,
}

impl Corral {
    fn point(&self, points: &[Vec<f64>], dimension: usize) -> Vec<f64> {
        let mut x = vec![0.0; dimension];
        for (&member, &weight) in self.members.iter().zip(&self.weights) {
            super::dense::add_scaled(&mut x, weight, &points[member]);
        }
        x
    }

    /// Moves to the nearest point of the affine hull of the members, dropping members until it lies between them.
    fn settle(&mut self, points: &[Vec<f64>]) {
        loop {
            let affine = self.affine(points);
            if affine.iter().all(|weight| *weight > 1e-12) || self.members.len() == 1 {
                self.weights = affine;
                return;
            }
            let share = self
                .weights
                .iter()
                .zip(&affine)
                .filter(|(_, to)| **to <= 1e-12)
                .map(|(from, to)| if from > to { from / (from - to) } else { 0.0 })
                .fold(1.0, f64::min);
            let mut least = (0, f64::INFINITY);
            for (k, (from, to)) in self.weights.iter_mut().zip(&affine).enumerate() {
                *from += share * (to - *from);
                if *to <= 1e-12 && *from < least.1 {
                    least = (k, *from);
                }
            }
            self.members.remove(least.0);
            self.weights.remove(least.0);
            let sum: f64 = self.weights.iter().sum();
            self.weights.iter_mut().for_each(|weight| *weight /= sum);
        }
    }

    /// Weights of the point of the affine hull nearest to the origin: (G + 1 1') u = 1, normalised.
    fn affine(&self, points: &[Vec<f64>]) -> Vec<f64> {
        let count = self.members.len();
        let scale = self.members.iter().map(|&i| dot(&points[i], &points[i])).fold(0.0, f64::max).max(1e-300);
        let mut matrix = Columns::zeros(count, count);
        for (a, &i) in self.members.iter().enumerate() {
            for (b, &j) in self.members.iter().enumerate() {
                matrix.set(a, b, 1.0 + dot(&points[i], &points[j]) / scale);
            }
        }
        let mut weights = Qr::pivoted(matrix).solve(&vec![1.0; count]);
        let sum: f64 = weights.iter().sum();
        for weight in &mut weights {
            *weight /= sum;
        }
        weights
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn cube() -> Vec<Vec<f64>> {
        (0..8_u8).map(|k| (0..3).map(|d| f64::from(k >> d & 1)).collect()).collect()
    }

    #[test]
    fn distances_to_a_cube_are_known() {
        for (target, exact) in [
            ([0.5, 0.5, 0.5], 0.0),
            ([0.0, 1.0, 0.3], 0.0),
            ([1.5, 0.5, 0.2], 0.5),
            ([1.3, 1.4, 0.5], 0.5),
            ([2.0, 3.0, 3.0], 3.0),
            ([-1e-3, 0.5, 0.5], 1e-3),
        ] {
            let found = distance_to_hull(&cube(), &target).unwrap();
            assert!((found - exact).abs() < 1e-9, "{target:?}: {found}");
        }
    }

    #[test]
    fn a_simplex_cuts_the_corner_that_a_box_has() {
        // (0.9, 0.9) lies in the box of the corner points, but 0.8/sqrt 2 beyond the line between them.
        let points = [vec![0.0, 0.0], vec![1.0, 0.0], vec![0.0, 1.0], vec![0.2, 0.2]];
        let found = distance_to_hull(&points, &[0.9, 0.9]).unwrap();
        assert!((found - 0.8 / 2.0_f64.sqrt()).abs() < 1e-9, "{found}");
        assert_eq!(distance_to_hull(&points, &[0.4, 0.5]), Some(0.0));
    }

    #[test]
    fn flat_and_repeated_points_do_no_harm() {
        let line: Vec<Vec<f64>> = (0..5).flat_map(|k| vec![vec![f64::from(k), f64::from(k)]; 3]).collect();
        assert!((distance_to_hull(&line, &[2.0, 0.0]).unwrap() - 2.0_f64.sqrt()).abs() < 1e-9);
        assert_eq!(distance_to_hull(&line, &[3.5, 3.5]), Some(0.0));
        assert_eq!(distance_to_hull(&[], &[1.0]), None);
        assert_eq!(distance_to_hull(&[vec![1.0]], &[3.0]), Some(2.0));
    }
}
