//! A ring under radial forces, wave by wave (`clamping/3.1`).

use std::f64::consts::{PI, TAU};

/// Angles at which a profile is given: contacts at whole and half degrees stand on one.
pub(super) const ANGLES: usize = 720;
/// Highest order of a displacement: the rest is below a thousandth of shear's part.
const HIGHEST: usize = 6_000;
/// Shear correction of a rectangle.
const SHEAR_SHAPE: f64 = 1.2;

/// Section and material of a ring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ring {
    /// Mean radius, wall, width, mm.
    pub(super) radius_mm: f64,
    pub(super) wall_mm: f64,
    pub(super) width_mm: f64,
    pub(super) modulus_n_per_mm2: f64,
    pub(super) poisson: f64,
}

/// A radial force, inward positive, spread evenly over an angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Press {
    pub(super) angle_rad: f64,
    pub(super) force_n: f64,
    pub(super) over_rad: f64,
}

/// A wave a cos kθ + b sin kθ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wave {
    pub(super) order: usize,
    pub(super) cos: f64,
    pub(super) sin: f64,
}

impl Ring {
    fn inertia_mm4(&self) -> f64 {
        self.width_mm * self.wall_mm.powi(3) / 12.0
    }

    /// Part of stretching: I/(A R²).
    fn stretch(&self) -> f64 {
        (self.wall_mm / self.radius_mm).powi(2) / 12.0
    }

    /// Part of shear: k E I/(G A R²).
    fn shear(&self) -> f64 {
        SHEAR_SHAPE * 2.0 * (1.0 + self.poisson) * self.stretch()
    }

    /// Inward displacement of the wall under an even load of the contacts, mm.
    pub(super) fn shrink_mm(&self, presses: &[Press]) -> f64 {
        let sum: f64 = presses.iter().map(|press| press.force_n).sum();
        sum * self.radius_mm / (TAU * self.modulus_n_per_mm2 * self.width_mm * self.wall_mm)
    }

    /// Waves of the wall while it is held, inward positive, mm.
    pub(super) fn waves(&self, presses: &[Press]) -> Vec<Wave> {
        let (stretch, shear) = (self.stretch(), self.shear());
        let unit = self.radius_mm.powi(3) / (PI * self.modulus_n_per_mm2 * self.inertia_mm4());
        Self::load(presses, |k| {
            let kk = k * k;
            unit * (1.0 - stretch + kk * shear) / ((kk - 1.0) * (kk - 1.0))
        })
    }

    /// Bending moment along the ring, N mm.
    pub(super) fn moment_n_mm(&self, presses: &[Press]) -> Vec<f64> {
        profile(&Self::load(presses, |k| self.radius_mm / PI / (k * k - 1.0)))
    }

    /// Largest bending stress, N/mm².
    pub(super) fn stress_n_per_mm2(&self, presses: &[Press]) -> f64 {
        let moment = self.moment_n_mm(presses).into_iter().fold(0.0_f64, |most, m| most.max(m.abs()));
        moment * 0.5 * self.wall_mm / self.inertia_mm4()
    }

    /// The waves of the load from the second order on, each times its factor.
    fn load(presses: &[Press], factor: impl Fn(f64) -> f64) -> Vec<Wave> {
        (2..=HIGHEST)
            .filter_map(|order| {
                let k = order as f64;
                let (mut cos, mut sin) = (0.0, 0.0);
                for press in presses {
                    let half = 0.5 * k * press.over_rad;
                    let force = press.force_n * if half > 0.0 { half.sin() / half } else { 1.0 };
                    let (s, c) = (k * press.angle_rad).sin_cos();
                    cos += force * c;
                    sin += force * s;
                }
                // Of equal jaws all but every n-th are rounding.
                let all: f64 = presses.iter().map(|press| press.force_n.abs()).sum();
                let acts = cos.hypot(sin) > 1e-9 * all;
                acts.then(|| Wave { order, cos: cos * factor(k), sin: sin * factor(k) })
            })
            .collect()
    }
}

/// The sum of waves at uniform angles.
pub(super) fn profile(waves: &[Wave]) -> Vec<f64> {
    let table: Vec<(f64, f64)> = (0..ANGLES).map(|i| (TAU * i as f64 / ANGLES as f64).sin_cos()).collect();
    let at = |i: usize| {
        let of = |wave: &Wave| {
            let (sin, cos) = table[wave.order * i % ANGLES];
            wave.cos * cos + wave.sin * sin
        };
        waves.iter().map(of).sum()
    };
    (0..ANGLES).map(at).collect()
}
