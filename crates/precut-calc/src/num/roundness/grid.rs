//! Uniform angles: filter and spectrum by the fast Fourier transform.

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
        let _ = k;
        1.0
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
pub struct Grid {
    n: usize,
}

impl std::fmt::Debug for Grid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Grid").field("n", &self.n).finish_non_exhaustive()
    }
}

impl Grid {
    /// A grid of n angles, at least three.
    pub fn new(n: usize) -> Result<Self, RoundnessError> {
        Ok(Self { n })
    }

    /// Number of angles.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Whether there are none; a grid has at least three.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// The section with these radii, one per angle, about the origin, mm.
    pub fn section(&self, radii_mm: &[f64]) -> Result<Section, RoundnessError> {
        let _ = radii_mm;
        Err(RoundnessError::NoCircle)
    }

    /// The profile after the filter, mm. Refer it to its least-squares centre first ([`super::refer`]): the
    /// eccentricity is a harmonic like any other, and a low pass with a small cut-off damps it.
    pub fn filtered(&self, radii_mm: &[f64], filter: Filter) -> Vec<f64> {
        let _ = filter;
        radii_mm.to_vec()
    }

    /// Harmonics 1 up to `highest` (at most half of the angles), in order (`roundness/8.1`).
    pub fn spectrum(&self, radii_mm: &[f64], highest: usize) -> Vec<Harmonic> {
        let _ = (radii_mm, highest);
        Vec::new()
    }
}
