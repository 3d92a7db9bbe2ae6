//! The zeroth order: the cutting stiffness replaced by its mean (`milling/4.16`; Altintas, Budak 1995).

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};

use crate::num::quadrature::gauss_legendre;

use super::cutter::{Milling, Tensor};
use super::edge::{Edges, Engagement, combined};
use super::structure::Structure;

/// Frequencies of the search between two refinements.
const FREQUENCIES: u32 = 3000;
/// Gauss points of a smooth stretch of the mean.
const POINTS: usize = 16;
/// 1 minus the golden ratio's inverse squared.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// The least depth of all speeds by the mean stiffness, and the frequency of its chatter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zeroth {
    /// mm. Never a bound: the true limit may lie below.
    pub depth_mm: f64,
    /// Hz.
    pub frequency_hz: f64,
}

/// W: mean of the cutting stiffness per mm of depth, N/mm2. The helix does not matter for it.
pub fn mean_stiffness(milling: &Milling) -> Tensor {
    let straight = Milling {
        teeth: milling.teeth.iter().map(|t| super::cutter::Tooth { lag_rad_per_mm: 0.0, ..*t }).collect(),
        depth_exponent: 0.0,
        ..milling.clone()
    };
    let mut mean = [[0.0; 3]; 3];
    each_instant(&straight, 1.0, f64::INFINITY, |_, share, instant| {
        for entry in &instant.entries {
            mean = combined(&mean, 1.0, &entry.stiffness, share);
        }
    });
    mean
}

/// Calls with Gauss points of a period of the cut: rotation, share of the period, what the edges do there. Pieces lie between breaks
/// and are no longer than `longest_rad`.
pub(super) fn each_instant(
    milling: &Milling,
    depth_mm: f64,
    longest_rad: f64,
    mut call: impl FnMut(f64, f64, &Engagement),
) {
    let edges = Edges::new(milling, depth_mm);
    let period = milling.period_rad();
    let mut breaks = edges.rotations();
    breaks.extend([0.0, period]);
    breaks.sort_by(f64::total_cmp);
    let (points, weights) = gauss_legendre(POINTS);
    for pair in breaks.windows(2) {
        let count = ((pair[1] - pair[0]) / longest_rad).ceil().max(1.0);
        let length = (pair[1] - pair[0]) / count;
        let mut piece = 0.0;
        while piece < count {
            for (c, w) in points.iter().zip(&weights) {
                let rotation = pair[0] + (piece + c) * length;
                call(rotation, w * length / period, &edges.at(rotation));
            }
            piece += 1.0;
        }
    }
}

/// The least depth over all speeds; `None` where the mean drives nothing.
pub fn zeroth(milling: &Milling, structure: &Structure) -> Option<Zeroth> {
    let mean = mean_stiffness(milling);
    let (linear, frequency_hz) = least(structure, &projected(structure, &mean), FREQUENCIES)?;
    Some(Zeroth { depth_mm: linear.powf(1.0 / (1.0 - milling.depth_exponent)), frequency_hz })
}

/// A stiffness in the directions in which anything yields.
pub(super) fn projected(structure: &Structure, stiffness: &Tensor) -> DMatrix<f64> {
    let d = structure.basis.len();
    DMatrix::from_fn(d, d, |a, b| {
        let (left, right) = (structure.basis[a], structure.basis[b]);
        (0..3).flat_map(|i| (0..3).map(move |j| left[i] * stiffness[i][j] * right[j])).sum::<f64>()
    })
}

/// How many times a steady stiffness until a disturbance grows at some speed, and at which frequency, Hz.
pub(super) fn least(structure: &Structure, w: &DMatrix<f64>, frequencies: u32) -> Option<(f64, f64)> {
    let low = structure.modes.iter().map(|m| m.frequency_hz).fold(f64::INFINITY, f64::min) * 0.3;
    let high = structure.modes.iter().map(|m| m.frequency_hz).fold(0.0, f64::max) * 3.0;
    let at = |step: f64| low * (high / low).powf(step / f64::from(frequencies));
    let depth = |hz: f64| largest_real_part(structure, w, TAU * hz).map(|re| 0.5 / re);
    let of = |step: f64| depth(at(step)).unwrap_or(f64::INFINITY);
    let best = (0..=frequencies).map(f64::from).min_by(|a, b| of(*a).total_cmp(&of(*b)))?;
    let (mut a, mut b) = (best - 1.0, best + 1.0);
    for _ in 0..60 {
        let (p, q) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
        if of(p) < of(q) { b = q } else { a = p }
    }
    Some((depth(at(0.5 * (a + b)))?, at(0.5 * (a + b))))
}

/// The largest positive real part of an eigenvalue of G W.
fn largest_real_part(structure: &Structure, w: &DMatrix<f64>, rad_per_s: f64) -> Option<f64> {
    let product = modal(structure, rad_per_s) * w.map(|x| Complex::new(x, 0.0));
    let values = product.schur().eigenvalues()?;
    values.iter().map(|value| value.re).filter(|re| *re > 0.0).max_by(f64::total_cmp)
}

/// Receptance of all modes in the basis of the motion, mm/N.
pub(super) fn modal(structure: &Structure, rad_per_s: f64) -> DMatrix<Complex<f64>> {
    let d = structure.basis.len();
    let mut g: DMatrix<Complex<f64>> = DMatrix::zeros(d, d);
    for (mode, along) in structure.modes.iter().zip(&structure.directions) {
        let receptance = mode.receptance_at(Complex::new(0.0, rad_per_s));
        for a in 0..d {
            for b in 0..d {
                g[(a, b)] += receptance * (along[a] * along[b]);
            }
        }
    }
    g
}
