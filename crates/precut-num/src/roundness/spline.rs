//! A closed profile through points at any angles.

use std::f64::consts::TAU;

use super::section::count;
use super::{RoundnessError, Section};

/// Periodic cubic spline r(θ), twice continuously differentiable, period 2π (`roundness/6.1`).
#[derive(Debug, Clone, PartialEq)]
pub struct PeriodicSpline {
    /// Knots, and the first again one period later.
    angles_rad: Vec<f64>,
    values: Vec<f64>,
    /// Second derivatives at the knots.
    curvatures: Vec<f64>,
}

impl PeriodicSpline {
    /// Through `values` at `angles_rad`: strictly ascending, spanning less than 2π, at least three.
    /// [`RoundnessError::NotStarShaped`] names the first angle that is not above its predecessor.
    pub fn new(angles_rad: Vec<f64>, values: Vec<f64>) -> Result<Self, RoundnessError> {
        let (n, m) = (angles_rad.len(), values.len());
        if n != m {
            return Err(RoundnessError::LengthsDiffer { first: n, second: m });
        }
        if n < 3 {
            return Err(RoundnessError::TooFewPoints { count: n, needed: 3 });
        }
        let not_finite = angles_rad.iter().zip(&values).position(|(a, v)| !(a.is_finite() && v.is_finite()));
        if let Some(index) = not_finite {
            return Err(RoundnessError::NotFinite { index });
        }
        let (mut angles_rad, mut values) = (angles_rad, values);
        angles_rad.push(angles_rad[0] + TAU);
        if let Some(before) = angles_rad.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(RoundnessError::NotStarShaped { index: (before + 1) % n });
        }
        values.push(values[0]);
        let steps: Vec<f64> = angles_rad.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mut curvatures = curvatures(&steps, &values);
        curvatures.push(curvatures[0]);
        Ok(Self { angles_rad, values, curvatures })
    }

    /// The value at an angle, rad (any, it is brought into the period).
    pub fn at(&self, angle_rad: f64) -> f64 {
        let first = self.angles_rad[0];
        // Round-off can bring the remainder up to the period itself, which the last piece still holds.
        let angle = first + (angle_rad - first).rem_euclid(TAU);
        let piece = self.angles_rad.partition_point(|&knot| knot <= angle).clamp(1, self.angles_rad.len() - 1) - 1;
        self.on(piece, angle)
    }

    /// The values at 2πi/n, i = 0..n.
    pub fn uniform(&self, n: usize) -> Vec<f64> {
        let (first, last) = (self.angles_rad[0], self.angles_rad.len() - 2);
        let mut piece = None;
        (0..n)
            .map(|i| {
                let angle = first + (TAU * (count(i) / count(n)) - first).rem_euclid(TAU);
                let near = piece.filter(|&p: &usize| angle >= self.angles_rad[p]).map(|mut p: usize| {
                    while p < last && angle >= self.angles_rad[p + 1] {
                        p += 1;
                    }
                    p
                });
                let found = near
                    .unwrap_or_else(|| self.angles_rad.partition_point(|&knot| knot <= angle).clamp(1, last + 1) - 1);
                piece = Some(found);
                self.on(found, angle)
            })
            .collect()
    }

    /// The value on a piece.
    fn on(&self, piece: usize, angle: f64) -> f64 {
        let (left, right) = (self.angles_rad[piece], self.angles_rad[piece + 1]);
        let step = right - left;
        let (a, b) = ((right - angle) / step, (angle - left) / step);
        let chord = a * self.values[piece] + b * self.values[piece + 1];
        let (before, after) = (self.curvatures[piece], self.curvatures[piece + 1]);
        chord + (a * (a * a - 1.0) * before + b * (b * b - 1.0) * after) * step * step / 6.0
    }
}

/// Second derivatives at the knots: a cyclic tridiagonal system with dominant diagonal. The first unknown is carried along
/// as a parameter: M_i = p_i + q_i M_0, eliminated forward, substituted backward.
fn curvatures(steps: &[f64], values: &[f64]) -> Vec<f64> {
    let n = steps.len();
    let before = |i: usize| steps[(i + n - 1) % n];
    let slope = |i: usize| (values[i + 1] - values[i]) / steps[i];
    let load = |i: usize| 6.0 * (slope(i) - slope((i + n - 1) % n));
    // Row i (from 1): M_i = offset − next·M_{i+1} + carry·M_0.
    let (mut offset, mut next, mut carry) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for i in 1..n {
        let low = before(i);
        let (o, x, c) = if i == 1 { (0.0, 0.0, 1.0) } else { (offset[i - 1], next[i - 1], carry[i - 1]) };
        let pivot = 2.0 * (low + steps[i]) - low * x;
        offset[i] = (load(i) - low * o) / pivot;
        carry[i] = -low * c / pivot;
        next[i] = steps[i] / pivot;
    }
    // The row after the last is M_0 again.
    let (mut constant, mut factor) = (vec![0.0; n], vec![1.0; n]);
    for i in (1..n).rev() {
        let (c, f) = if i + 1 == n { (0.0, 1.0) } else { (constant[i + 1], factor[i + 1]) };
        constant[i] = offset[i] - next[i] * c;
        factor[i] = carry[i] - next[i] * f;
    }
    let low = before(0);
    let diagonal = 2.0 * (low + steps[0]) + steps[0] * factor[1] + low * factor[n - 1];
    let first = (load(0) - steps[0] * constant[1] - low * constant[n - 1]) / diagonal;
    let mut result: Vec<f64> = constant.iter().zip(&factor).map(|(c, f)| c + f * first).collect();
    result[0] = first;
    result
}

/// The section referred to a centre: distances from it at n uniform angles from 0, mm, through the periodic spline of
/// distance against angle about that centre (`roundness/6.2`).
///
/// The points must follow each other counter-clockwise ([`RoundnessError::NotStarShaped`] otherwise).
pub fn refer(section: &Section, centre_mm: [f64; 2], n: usize) -> Result<Vec<f64>, RoundnessError> {
    let (angles, distances, first) = polar(section, centre_mm);
    let spline = PeriodicSpline::new(angles, distances).map_err(|error| match error {
        // Counted from the first angle: back to the order of the points.
        RoundnessError::NotStarShaped { index } => {
            RoundnessError::NotStarShaped { index: (index + first) % section.len() }
        }
        other => other,
    })?;
    Ok(spline.uniform(n))
}

/// Angles (0 ≤ θ < 2π, beginning with the smallest) and distances about a centre, and which point came first.
fn polar(section: &Section, centre_mm: [f64; 2]) -> (Vec<f64>, Vec<f64>, usize) {
    let centre = section.inside(centre_mm);
    let mut angles: Vec<f64> = (0..section.len())
        .map(|index| {
            let [x, y] = section.from(centre, index);
            let angle = y.atan2(x);
            if angle < 0.0 { angle + TAU } else { angle }
        })
        // Of a tiny negative angle nothing is left beside 2π.
        .map(|angle| if angle >= TAU { 0.0 } else { angle })
        .collect();
    let mut distances = section.distances_mm(centre_mm);
    let first = (0..angles.len()).min_by(|&a, &b| angles[a].total_cmp(&angles[b])).unwrap_or(0);
    angles.rotate_left(first);
    distances.rotate_left(first);
    (angles, distances, first)
}
