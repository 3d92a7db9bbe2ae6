//! Uniform angles: filter and spectrum by the fast Fourier transform.

use std::f64::consts::TAU;
use std::sync::Arc;

use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlannerScalar};

use super::section::{count, in_range, mean};
use super::{RoundnessError, Section};

/// What a filter lets pass. Harmonic 0, the mean radius, always passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Filter {
    /// Everything.
    None,
    /// Long waves: 2^-(k/f)² of harmonic k, half of harmonic f (Gaussian filter of closed profiles, ISO 16610-21).
    LowPass {
        /// Cut-off f, undulations per revolution, > 0.
        cutoff_upr: f64,
    },
    /// Short waves: what the low pass of the same cut-off holds back.
    HighPass {
        /// Cut-off, undulations per revolution, > 0.
        cutoff_upr: f64,
    },
    /// Both in turn.
    BandPass {
        /// Cut-off of the high pass, undulations per revolution, > 0.
        from_upr: f64,
        /// Cut-off of the low pass, undulations per revolution, > 0.
        to_upr: f64,
    },
}

impl Filter {
    /// Share of harmonic `k` that passes (`roundness/7.1`).
    pub fn transmission(self, k: usize) -> f64 {
        if k == 0 {
            return 1.0;
        }
        let long = |cutoff: f64| (-(count(k) / cutoff) * (count(k) / cutoff)).exp2();
        // Not 1 − 2^x, which has no digits left where the wave is long beside the cut-off.
        let short = |cutoff: f64| -(-(count(k) / cutoff) * (count(k) / cutoff) * std::f64::consts::LN_2).exp_m1();
        match self {
            Self::None => 1.0,
            Self::LowPass { cutoff_upr } => long(cutoff_upr),
            Self::HighPass { cutoff_upr } => short(cutoff_upr),
            Self::BandPass { from_upr, to_upr } => short(from_upr) * long(to_upr),
        }
    }
}

/// One harmonic of a closed profile: amplitude·cos(k(θ − angle of maximum)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Harmonic {
    /// Undulations per revolution, k.
    pub order: usize,
    /// Amplitude, mm (half of the peak to valley of this harmonic alone).
    pub amplitude_mm: f64,
    /// First angle of a maximum, rad, 0 ≤ angle < 2π/k.
    pub angle_of_max_rad: f64,
}

/// n uniform angles 2πi/n: their directions and the plan of the transform, made once and used for many profiles.
///
/// The transform uses no instruction that only some processors have: the same profile gives the same bits everywhere.
#[derive(Clone)]
pub struct Grid {
    cosines: Vec<f64>,
    sines: Vec<f64>,
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
}

impl std::fmt::Debug for Grid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Grid").field("n", &self.len()).finish_non_exhaustive()
    }
}

impl Grid {
    /// A grid of n angles, at least three.
    pub fn new(n: usize) -> Result<Self, RoundnessError> {
        if n < 3 {
            return Err(RoundnessError::TooFewPoints { count: n, needed: 3 });
        }
        let (sines, cosines) = (0..n).map(|i| (TAU * (count(i) / count(n))).sin_cos()).unzip();
        let mut planner = FftPlannerScalar::new();
        Ok(Self { cosines, sines, forward: planner.plan_fft_forward(n), inverse: planner.plan_fft_inverse(n) })
    }

    /// Number of angles.
    pub fn len(&self) -> usize {
        self.cosines.len()
    }

    /// Whether there are none; a grid has at least three.
    pub fn is_empty(&self) -> bool {
        self.cosines.is_empty()
    }

    /// The section with these radii, one per angle, about the origin, mm.
    pub fn section(&self, radii_mm: &[f64]) -> Result<Section, RoundnessError> {
        let on = |directions: &[f64]| radii_mm.iter().zip(directions).map(|(radius, along)| radius * along).collect();
        self.check(radii_mm)?;
        Ok(Section { origin_mm: [0.0; 2], x_mm: on(&self.cosines), y_mm: on(&self.sines) })
    }

    /// The profile after the filter, mm. Refer it to its least-squares centre first ([`super::refer`]): the
    /// eccentricity is a harmonic like any other, and a low pass with a small cut-off damps it.
    pub fn filtered(&self, radii_mm: &[f64], filter: Filter) -> Result<Vec<f64>, RoundnessError> {
        self.check(radii_mm)?;
        if filter == Filter::None {
            return Ok(radii_mm.to_vec());
        }
        self.resampled(radii_mm, filter, self)
    }

    /// The profile after the filter on the angles of another grid, mm: the trigonometric polynomial through it, read there.
    /// The other grid is at least as fine.
    pub fn resampled(&self, radii_mm: &[f64], filter: Filter, onto: &Self) -> Result<Vec<f64>, RoundnessError> {
        let (n, fine) = (self.len(), onto.len());
        if fine < n {
            return Err(RoundnessError::TooFewPoints { count: fine, needed: n });
        }
        let (middle, transform) = self.transform(radii_mm)?;
        let mut spread = vec![Complex64::new(0.0, 0.0); fine];
        for k in 1..=n / 2 {
            let share = filter.transmission(k) / count(n);
            if 2 * k == n {
                // The highest harmonic of an even grid has half of itself on either side.
                let half = if fine == n { 1.0 } else { 0.5 };
                spread[k] += transform[k] * (share * half);
                if fine > n {
                    spread[fine - k] += transform[k].conj() * (share * half);
                }
            } else {
                spread[k] = transform[k] * share;
                spread[fine - k] = transform[n - k] * share;
            }
        }
        onto.inverse.process(&mut spread);
        Ok(spread.into_iter().map(|value| middle + value.re).collect())
    }

    /// Harmonics 1 up to `highest` (at most half of the angles), in order (`roundness/8.1`).
    pub fn spectrum(&self, radii_mm: &[f64], highest: usize) -> Result<Vec<Harmonic>, RoundnessError> {
        let (_, transform) = self.transform(radii_mm)?;
        let n = self.len();
        Ok((1..=highest.min(n / 2))
            .map(|order| {
                let value = transform[order];
                let share = if 2 * order == n { 1.0 } else { 2.0 };
                let k = count(order);
                let angle = (-value.arg() / k).rem_euclid(TAU / k);
                Harmonic {
                    order,
                    amplitude_mm: share * value.norm() / count(n),
                    // Round-off can bring the remainder up to the period itself.
                    angle_of_max_rad: if angle >= TAU / k { 0.0 } else { angle },
                }
            })
            .collect())
    }

    /// Mean radius, and the transform of the deviations from it: their digits are not spent on the radius.
    fn transform(&self, radii_mm: &[f64]) -> Result<(f64, Vec<Complex64>), RoundnessError> {
        self.check(radii_mm)?;
        let middle = mean(radii_mm);
        let mut buffer: Vec<Complex64> = radii_mm.iter().map(|radius| Complex64::new(radius - middle, 0.0)).collect();
        self.forward.process(&mut buffer);
        Ok((middle, buffer))
    }

    fn check(&self, radii_mm: &[f64]) -> Result<(), RoundnessError> {
        if radii_mm.len() != self.len() {
            return Err(RoundnessError::LengthsDiffer { first: radii_mm.len(), second: self.len() });
        }
        let bad = radii_mm.iter().position(|&radius| !in_range(radius));
        bad.map_or(Ok(()), |index| Err(RoundnessError::NotFinite { index }))
    }
}
