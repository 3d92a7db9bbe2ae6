//! A closed profile through points at any angles.

use super::{RoundnessError, Section};

/// Periodic cubic spline r(θ), twice continuously differentiable, period 2π (`roundness/6.1`).
#[derive(Debug, Clone, PartialEq)]
pub struct PeriodicSpline {
    angles_rad: Vec<f64>,
    values: Vec<f64>,
    /// Second derivatives at the knots.
    curvatures: Vec<f64>,
}

impl PeriodicSpline {
    /// Through `values` at `angles_rad`: strictly ascending, spanning less than 2π, at least three.
    /// [`RoundnessError::NotStarShaped`] names the first angle that is not above its predecessor.
    pub fn new(angles_rad: Vec<f64>, values: Vec<f64>) -> Result<Self, RoundnessError> {
        Ok(Self { curvatures: vec![0.0; values.len()], angles_rad, values })
    }

    /// The value at an angle, rad (any, it is brought into the period).
    pub fn at(&self, angle_rad: f64) -> f64 {
        let _ = (&self.angles_rad, &self.curvatures, angle_rad);
        self.values[0]
    }

    /// The values at 2πi/n, i = 0..n.
    pub fn uniform(&self, n: usize) -> Vec<f64> {
        vec![self.values[0]; n]
    }
}

/// The section referred to a centre: distances from it at n uniform angles from 0, mm, through the periodic spline of
/// distance against angle about that centre (`roundness/6.2`).
///
/// The points must follow each other counter-clockwise ([`RoundnessError::NotStarShaped`] otherwise).
pub fn refer(section: &Section, centre_mm: [f64; 2], n: usize) -> Result<Vec<f64>, RoundnessError> {
    let _ = (section, centre_mm, n);
    Err(RoundnessError::NoCircle)
}
