//! The cylinder with the least sum of squared distances.

use nalgebra::{SMatrix, SVector};

use super::axis::{Axis, gradient, moved, seen};
use super::{CylinderError, Point};

const MOST_STEPS: u32 = 200;
/// A smallest eigenvalue below this share of the largest leaves a direction open.
const OPEN: f64 = 1e-12;

/// The least-squares cylinder.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquares {
    /// Its axis; height 0 is the middle of the points.
    pub axis: Axis,
    /// Half the length of the points along it, mm.
    pub half_mm: f64,
    /// Its radius: the mean distance, mm.
    pub radius_mm: f64,
    /// Root mean square of the distances about the radius, mm.
    pub rms_mm: f64,
    /// Largest and smallest distance, mm.
    pub farthest_mm: f64,
    /// See above.
    pub nearest_mm: f64,
}

/// Minimises the sum of (d - R)² over the axis and R by Gauss-Newton steps about the axis reached, each halved until the
/// sum falls. The axis starts along z.
pub fn least_squares(points: &[Point]) -> Result<LeastSquares, CylinderError> {
    if points.len() < 6 {
        return Err(CylinderError::Undetermined);
    }
    let mut axis = start(points)?;
    let mut last = spread(axis, points);
    for step in 0..MOST_STEPS {
        let (here, locals, half_mm) = seen(axis, points);
        let radius = locals.iter().map(|l| l.distance_mm).sum::<f64>() / number(points.len());
        if half_mm <= 1e-9 * radius {
            return Err(CylinderError::Undetermined);
        }
        let mut normal = SMatrix::<f64, 5, 5>::zeros();
        let mut right = SVector::<f64, 5>::zeros();
        for local in &locals {
            let g = gradient(local, half_mm);
            let row = SVector::<f64, 5>::from([g[0], g[1], g[2], g[3], -1.0]);
            normal += row * row.transpose();
            right -= row * (local.distance_mm - radius);
        }
        let eigen = normal.symmetric_eigenvalues();
        if eigen.min() <= OPEN * eigen.max() {
            return Err(CylinderError::Undetermined);
        }
        let full = normal.cholesky().ok_or(CylinderError::Undetermined)?.solve(&right);
        let mut share = 1.0;
        let size = (0..4).map(|k| full[k].abs()).fold(0.0, f64::max);
        let reached = loop {
            let to = moved(here, half_mm, [0, 1, 2, 3].map(|k| share * full[k]));
            let sum = spread(to, points);
            if sum < last {
                last = sum;
                break Some(to);
            }
            share *= 0.5;
            if share * size <= 1e-15 * radius {
                break None;
            }
        };
        match reached {
            Some(to) => axis = to,
            None => return Ok(outcome(here, points)),
        }
        if share * size <= 1e-14 * radius {
            return Ok(outcome(axis, points));
        }
        if step + 1 == MOST_STEPS {
            return Err(CylinderError::NotConverged { iterations: MOST_STEPS, left_mm: share * size });
        }
    }
    Err(CylinderError::Undetermined)
}

/// Along z through the centre of the algebraic circle of all points.
fn start(points: &[Point]) -> Result<Axis, CylinderError> {
    let n = number(points.len());
    let mean: Point = std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / n);
    let mut normal = SMatrix::<f64, 3, 3>::zeros();
    let mut right = SVector::<f64, 3>::zeros();
    for point in points {
        let (x, y) = (point[0] - mean[0], point[1] - mean[1]);
        let row = SVector::<f64, 3>::from([2.0 * x, 2.0 * y, 1.0]);
        normal += row * row.transpose();
        right += row * (x * x + y * y);
    }
    let found = normal.cholesky().ok_or(CylinderError::Undetermined)?.solve(&right);
    let place = [mean[0] + found[0], mean[1] + found[1], mean[2]];
    Ok(Axis::through([place[0], place[1], place[2] - 1.0], [place[0], place[1], place[2] + 1.0]))
}

/// Sum of squares about the mean distance.
fn spread(axis: Axis, points: &[Point]) -> f64 {
    let distances: Vec<f64> = points.iter().map(|p| axis.local(*p).distance_mm).collect();
    let mean = distances.iter().sum::<f64>() / number(points.len());
    distances.iter().map(|d| (d - mean) * (d - mean)).sum()
}

fn outcome(axis: Axis, points: &[Point]) -> LeastSquares {
    let (axis, locals, half_mm) = seen(axis, points);
    let distances = || locals.iter().map(|local| local.distance_mm);
    let n = number(points.len());
    let radius_mm = distances().sum::<f64>() / n;
    LeastSquares {
        axis,
        half_mm,
        radius_mm,
        rms_mm: (distances().map(|d| (d - radius_mm) * (d - radius_mm)).sum::<f64>() / n).sqrt(),
        farthest_mm: distances().fold(0.0, f64::max),
        nearest_mm: distances().fold(f64::INFINITY, f64::min),
    }
}

pub(super) fn number(count: usize) -> f64 {
    // Lists of 2^53 points do not fit into memory.
    #[allow(clippy::cast_precision_loss)]
    let number = count as f64;
    number
}
