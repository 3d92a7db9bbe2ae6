//! What yields: modes of tool and workpiece, each along a direction in space (`milling/3.10`).

use std::f64::consts::TAU;

use nalgebra::Complex;

use crate::num::dde::{Matrix, Propagator, Rule};

use super::cutter::Vector;

/// m x'' in kg mm/s2 over the force in N.
const MM_PER_S2: f64 = 1000.0;
/// No mode is damped more than this share of critical.
const MOST_DAMPED: f64 = 0.99;

/// Whose mode it is. Force and counter-force make both enter alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Of the tool in the spindle.
    Tool,
    /// Of the workpiece in its fixture.
    Work,
}

/// A mode at the cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// Whose.
    pub side: Side,
    /// Direction of length 1.
    pub direction: Vector,
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Share of critical damping.
    pub damping_ratio: f64,
    /// Modal mass at the cut, kg.
    pub mass_kg: f64,
}

impl Mode {
    /// Natural angular frequency, rad/s.
    pub fn rad_per_s(&self) -> f64 {
        TAU * self.frequency_hz
    }

    /// Modal stiffness at the cut, N/mm.
    pub fn stiffness_n_per_mm(&self) -> f64 {
        self.mass_kg * self.rad_per_s().powi(2) / MM_PER_S2
    }

    /// The natural frequency times a factor, at the same stiffness.
    pub fn tune(&mut self, factor: f64) {
        self.frequency_hz *= factor;
        self.mass_kg /= factor * factor;
    }

    /// The stiffness times a factor, at the same frequency.
    pub fn stiffen(&mut self, factor: f64) {
        self.mass_kg *= factor;
    }

    /// The damping times a factor.
    pub fn damp(&mut self, factor: f64) {
        self.damping_ratio = (self.damping_ratio * factor).min(MOST_DAMPED);
    }

    /// q' = A q + b F of (x, x'/w).
    fn system(&self) -> (Matrix<2>, [f64; 2]) {
        let w = self.rad_per_s();
        ([[0.0, w], [-w, -2.0 * self.damping_ratio * w]], [0.0, MM_PER_S2 / (self.mass_kg * w)])
    }

    /// x over a force of 1 N along the mode that goes as exp(s t), mm/N; s in 1/s.
    pub fn receptance_at(&self, s: Complex<f64>) -> Complex<f64> {
        let w = self.rad_per_s();
        (s * s + s * (2.0 * self.damping_ratio * w) + w * w).inv() * (MM_PER_S2 / self.mass_kg)
    }
}

/// Tool and workpiece together.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// Of both sides.
    pub modes: Vec<Mode>,
    /// Orthonormal directions that span the motion, one to three.
    pub basis: Vec<Vector>,
    /// Directions of the modes in that basis.
    pub directions: Vec<Vec<f64>>,
}

impl Structure {
    /// Of modes with directions of length 1.
    pub fn new(modes: Vec<Mode>) -> Self {
        let mut basis: Vec<Vector> = Vec::new();
        for mode in &modes {
            let mut rest = mode.direction;
            for known in &basis {
                let along = dot(known, &rest);
                rest = std::array::from_fn(|i| rest[i] - along * known[i]);
            }
            let length = dot(&rest, &rest).sqrt();
            if length > 1e-6 {
                basis.push(rest.map(|x| x / length));
            }
        }
        let directions = modes.iter().map(|mode| basis.iter().map(|b| dot(b, &mode.direction)).collect()).collect();
        Self { modes, basis, directions }
    }

    /// Length of the state.
    pub fn states(&self) -> usize {
        2 * self.modes.len()
    }

    /// The fastest oscillation, rad/s.
    pub fn fastest_rad_per_s(&self) -> f64 {
        self.modes.iter().map(Mode::rad_per_s).fold(0.0, f64::max)
    }

    /// What an element of so many seconds does to each mode.
    pub(super) fn propagators<const P: usize>(&self, rule: &Rule<P>, length_s: f64) -> Vec<Propagator<2, P>> {
        let of = |mode: &Mode| {
            let (a, b) = mode.system();
            Propagator::new(rule, &a, &b, length_s)
        };
        self.modes.iter().map(of).collect()
    }

    /// What the springs and dampers of the work are pressed by at the points of an element, sum of d (x + c/k x') over its modes,
    /// in the basis; by the force at the points and the state at the beginning.
    pub(super) fn pressed<const P: usize>(
        &self,
        rule: &Rule<P>,
        length_s: f64,
        force: &[f64],
        state: &[f64],
    ) -> Vec<f64> {
        let d = self.basis.len();
        let mut pressed = vec![0.0; P * d];
        let (still, moving) = (self.propagators(rule, length_s), self.velocities(rule, length_s));
        for (k, mode) in self.modes.iter().enumerate().filter(|(_, mode)| mode.side == Side::Work) {
            let (along, w) = (&self.directions[k], mode.rad_per_s());
            let pushed: [f64; P] =
                std::array::from_fn(|j| along.iter().zip(&force[j * d..]).map(|(a, f)| a * f).sum::<f64>());
            let (x, v) = (state[2 * k], state[2 * k + 1]);
            for i in 0..P {
                let by_force = |row: &[f64; P]| row.iter().zip(&pushed).map(|(a, f)| a * f).sum::<f64>();
                let (at, rate) = (still[k].at_points[i], moving[k].at_points[i]);
                let moved = at[0] * x + at[1] * v + by_force(&still[k].points_by_force[i]);
                // The state of velocities is (x', x w), of which q = (x, x'/w).
                let speed = rate[0] * v * w + rate[1] * x * w + by_force(&moving[k].points_by_force[i]);
                let value = moved + 2.0 * mode.damping_ratio / w * speed;
                for (sum, a) in pressed[i * d..].iter_mut().zip(along) {
                    *sum += a * value;
                }
            }
        }
        pressed
    }

    /// What an element of so many seconds does to each mode, with the velocities in front.
    pub(super) fn velocities<const P: usize>(&self, rule: &Rule<P>, length_s: f64) -> Vec<Propagator<2, P>> {
        let of = |mode: &Mode| {
            let ([[_, up], [down, damped]], [_, push]) = mode.system();
            // Of (x', x w): x' itself in mm/s.
            Propagator::new(rule, &[[damped, down], [up, 0.0]], &[push * mode.rad_per_s(), 0.0], length_s)
        };
        self.modes.iter().map(of).collect()
    }
}

/// Scalar product.
pub(super) fn dot(a: &Vector, b: &Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
