//! Slow cuts: hundreds of oscillations from tooth to tooth (`fixture/5.9`).

use std::f64::consts::TAU;

use nalgebra::Complex;

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::num::dde::{Matrix, SLOW_PHASES, SlowPeriod, product};
use crate::num::quadrature::gauss_legendre;
use crate::num::roots::aberth;

use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::{Multiplier, Working, damped};
use crate::fixture_stability::model::holding::{Closed, Holding, System, eigenvalues};

/// A cut is slow from so many oscillations of the fastest mode in a tooth period on, in which a free vibration falls by so many
/// factors of e. Below, spectral elements take milliseconds.
const OSCILLATIONS: f64 = 120.0;
const DECAYS: f64 = 40.0;
/// From so many oscillations on in any case.
const ALWAYS: f64 = 2000.0;
/// Places of a part of a stretch of the tooth period.
const PLACES: usize = 16;
/// Parts of a stretch and phases of the multiplier: usually, and of the finer look that tells the error.
const USUAL: (u32, usize) = (1, SLOW_PHASES);
const FINER: (u32, usize) = (3, 2 * SLOW_PHASES + 1);
/// What grows so many times inside a tooth period marks the surface although it dies out from tooth to tooth.
pub(in crate::fixture_stability) const GROWN: f64 = 50.0;
/// A growth beyond this, as a logarithm, is told as this.
const FAR: f64 = 690.0;

/// Whether a cut is slow at a spindle speed. Joints that harden answer to the motion: they are not.
pub(in crate::fixture_stability) fn is_slow(holding: &Holding, cutting: &Cutting, spindle_rpm: f64) -> bool {
    if holding.hardening_per_mm2 > 0.0 {
        return false;
    }
    let (oscillations, decays) = in_a_period(holding, cutting, spindle_rpm);
    oscillations >= ALWAYS || (oscillations >= OSCILLATIONS && decays >= DECAYS)
}

/// Oscillations of the fastest mode in a tooth period, and how many factors of e the slowest free vibration falls by.
pub(in crate::fixture_stability) fn in_a_period(holding: &Holding, cutting: &Cutting, spindle_rpm: f64) -> (f64, f64) {
    let tau = cutting.tooth_period_s(spindle_rpm);
    let modes = holding.modes();
    let slowest = modes.iter().map(|mode| mode.damping_ratio * TAU * mode.natural_hz).fold(f64::INFINITY, f64::min);
    (modes.last().map_or(0.0, |mode| mode.natural_hz) * tau, slowest * tau)
}

/// det(s - A + c b e_0') = s^N + sum of (own_j + c coupled_j) s^j, s over the largest eigenvalue of A.
struct Characteristic<const N: usize> {
    own: [f64; N],
    coupled: [f64; N],
    /// Roots without coupling.
    free: [Complex<f64>; N],
    scale_rad_per_s: f64,
}

impl<const N: usize> Characteristic<N> {
    fn new(a: &Matrix<N>, b: &[f64; N]) -> Self {
        let scale = eigenvalues(a).into_iter().map(|(re, im)| f64::hypot(re, im)).fold(1e-300, f64::max);
        let a: Matrix<N> = a.map(|row| row.map(|value| value / scale));
        let b: [f64; N] = b.map(|value| value / scale);
        // Faddeev and LeVerrier: adj(s - A) = sum of M_k s^(N-k).
        let mut m: Matrix<N> = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
        let (mut own, mut coupled) = ([0.0; N], [0.0; N]);
        for (k, power) in (0..N).rev().enumerate() {
            coupled[power] = (0..N).map(|j| m[0][j] * b[j]).sum();
            m = product(&a, &m);
            own[power] = -(0..N).map(|i| m[i][i]).sum::<f64>() / (k + 1) as f64;
            for (i, row) in m.iter_mut().enumerate() {
                row[i] += own[power];
            }
        }
        let mut found = Self { own, coupled, free: [Complex::new(0.0, 0.0); N], scale_rad_per_s: scale };
        // Any start that is not symmetric about an axis.
        let start = std::array::from_fn(|j| Complex::from_polar(0.9, 0.4 + TAU * j as f64 / N as f64));
        found.free = found.roots(Complex::new(0.0, 0.0), start);
        found
    }

    /// All roots at once.
    fn roots(&self, coupling: Complex<f64>, mut at: [Complex<f64>; N]) -> [Complex<f64>; N] {
        let coefficients: [Complex<f64>; N] =
            std::array::from_fn(|j| Complex::new(self.own[j], 0.0) + coupling * self.coupled[j]);
        aberth(&mut at, |s| {
            let (mut value, mut slope) = (Complex::new(1.0, 0.0), Complex::new(0.0, 0.0));
            for coefficient in coefficients.iter().rev() {
                slope = slope * s + value;
                value = value * s + coefficient;
            }
            (value.norm_sqr() > 0.0).then(|| slope / value)
        });
        at
    }

    fn leading(&self, coupling: Complex<f64>) -> Complex<f64> {
        let roots = self.roots(coupling, self.free);
        let most = roots.into_iter().max_by(|a, b| a.re.total_cmp(&b.re));
        most.unwrap_or_default() * self.scale_rad_per_s
    }
}

/// What one spindle speed shares among all depths.
pub(in crate::fixture_stability) struct SlowCut<const N: usize> {
    stretches: Vec<Characteristic<N>>,
    /// Stretch and slope of the force over the level.
    places: Vec<(usize, f64)>,
    shares_s: Vec<f64>,
    phases: usize,
    /// Error over the modulus of the form itself.
    error: f64,
}

impl<const N: usize> SlowCut<N> {
    /// Of uneven teeth every angle counts with the one whose chip is stiffest there.
    pub(in crate::fixture_stability) fn new(
        system: &System<N>,
        holding: &Holding,
        cutting: &Cutting,
        working: Working,
    ) -> Self {
        Self::looked_at(system, holding, cutting, working, USUAL)
    }

    fn looked_at(
        system: &System<N>,
        holding: &Holding,
        cutting: &Cutting,
        working: Working,
        (parts, phases): (u32, usize),
    ) -> Self {
        let seconds_per_rad = cutting.tooth_period_s(working.spindle_rpm) / cutting.pitch_rad();
        let (points, weights) = gauss_legendre(PLACES);
        let (mut stretches, mut places, mut shares_s) = (Vec::new(), Vec::new(), Vec::new());
        for (number, stretch) in cutting.stretches().iter().enumerate() {
            stretches.push(Characteristic::new(&damped(system, cutting, &working, stretch.teeth), &system.b));
            let part_rad = stretch.length_rad() / f64::from(parts);
            let of_part =
                |part: u32| points.iter().zip(&weights).map(move |(c, w)| ((f64::from(part) + c) * part_rad, w));
            for (since_rad, weight) in (0..parts).flat_map(of_part) {
                let angle = stretch.from_rad + since_rad;
                let slopes =
                    (0..cutting.phases()).map(|phase| cutting.chip_slope(stretch, angle, phase, working.feed_mm));
                let slope = slopes.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
                places.push((number, slope));
                shares_s.push(weight * part_rad * seconds_per_rad);
            }
        }
        let (oscillations, decays) = in_a_period(holding, cutting, working.spindle_rpm);
        let merged = TAU / (8.0_f64.sqrt() * decays.max(DECAYS / 2.0));
        Self { stretches, places, shares_s, phases, error: merged * merged + TAU.recip() / oscillations }
    }

    /// The largest multiplier at the level Cp H^(1-mu), and the error of the form itself.
    pub(in crate::fixture_stability) fn multiplier(
        &self,
        level: f64,
        monitor: &dyn Monitor,
    ) -> Result<(Multiplier, f64), Failure> {
        let leading = |place: usize, coupling: Complex<f64>| {
            let (stretch, slope) = self.places[place];
            self.stretches[stretch].leading(coupling * (level * slope))
        };
        let period = SlowPeriod { shares_s: &self.shares_s, phases: self.phases, leading: &leading };
        let found = period.multiplier(|| checkpoint(monitor))?;
        let modulus = found.ln_modulus.min(FAR).exp();
        let multiplier = Multiplier {
            re: modulus * found.angle_rad.cos(),
            im: modulus * found.angle_rad.sin(),
            modulus,
            phases: 1,
            residual: 0.0,
            slow: Some(Slowly { within: found.ln_within.min(FAR).exp(), frequency_hz: found.rad_per_s / TAU }),
        };
        Ok((multiplier, self.error * modulus))
    }
}

/// What is known of the multiplier of a slow cut beside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Slowly {
    /// Largest growth inside a tooth period of what comes back unchanged from tooth to tooth.
    pub within: f64,
    /// Frequency where it grows most.
    pub frequency_hz: f64,
}

impl Multiplier {
    /// Whether a disturbance grows: from tooth to tooth, or in a slow cut fifty times before the next tooth comes.
    pub(in crate::fixture_stability) fn grows(&self) -> bool {
        self.counted() >= 1.0
    }

    /// The modulus; of a slow cut, where it is larger, the growth inside a tooth period over fifty.
    pub(in crate::fixture_stability) fn counted(&self) -> f64 {
        self.slow.map_or(self.modulus, |slow| self.modulus.max(slow.within / GROWN))
    }
}

/// The multiplier of a slow working point, with the joints `closed`. Its error is that of the form, and what three times as many places and
/// twice as many phases change: the fastest root passes from one to another with a bend, and the fastest phase from one to the next.
pub(in crate::fixture_stability) fn slow_point<const N: usize>(
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    closed: Closed,
    monitor: &dyn Monitor,
) -> Result<(Multiplier, f64), Failure> {
    let system = holding.system::<N>(closed);
    let level = cutting.level(working.depth_mm);
    let looked_at = |look| SlowCut::looked_at(&system, holding, cutting, working, look).multiplier(level, monitor);
    let (usual, _) = looked_at(USUAL)?;
    let (finer, of_form) = looked_at(FINER)?;
    Ok((finer, of_form + (finer.modulus - usual.modulus).abs()))
}
