//! The multiplier of a slow cut (`milling/4.21`): hundreds of oscillations from tooth to tooth, over which the chips hardly change. Process
//! damping is left out, which is safe.

use std::cell::RefCell;
use std::f64::consts::TAU;

use nalgebra::Complex;

use crate::calculator::{Failure, Monitor, Pace};
use crate::num::dde::{SLOW_PHASES, SlowPeriod};
use crate::num::roots::aberth;

use super::cutter::Tensor;
use super::edge::{Entry, combined};
use super::map::Cut;
use super::multiplier::Multiplier;
use super::slow::in_a_tooth;
use super::structure::Mode;
use super::zeroth::{each_instant, projected};

/// What grows so many times between two teeth marks the surface although it dies out from tooth to tooth.
pub const GROWN: f64 = 50.0;
/// A growth beyond this, as a logarithm, is told as this.
const FAR: f64 = 690.0;
/// The error of the modulus is not told smaller than at so many factors of e.
const LEAST_DECAYS: f64 = 20.0;
/// Of several modes the shape of the disturbance turns on its way through the arc, which the form leaves out. That does not fade with
/// the time from tooth to tooth; against elements it changed the modulus by up to a tenth.
const SHAPES: f64 = 0.15;
/// Longest stretch and phases of the multiplier that are looked at usually; of the finer look that tells the error the stretch as a share
/// of arc and period.
const USUAL: (f64, usize) = (f64::INFINITY, SLOW_PHASES);
const FINER: f64 = 0.4;
const FINER_PHASES: usize = 2 * SLOW_PHASES + 1;
/// Starts lie so far beside the free roots, as a share of them.
const BESIDE: f64 = 0.02;
/// Multiplications of a mode at a trial of a root.
const PER_MODE: usize = 60;
const PER_TRIAL: usize = 200;
/// Trials of a root, about.
const TRIALS: usize = 6;

impl SlowMultiplier {
    /// The multiplier; where the growth between two teeth over fifty is larger, one of that size.
    pub fn counted(&self) -> Multiplier {
        let size = (self.within / GROWN / self.multiplier.modulus().max(f64::MIN_POSITIVE)).max(1.0);
        Multiplier { re: size * self.multiplier.re, im: size * self.multiplier.im, ..self.multiplier }
    }
}

/// A complex matrix in the directions of the motion.
type Square<const D: usize> = [[Complex<f64>; D]; D];

/// What one slow cut does at the places of its period, in D directions.
struct SlowCut<'a, const D: usize> {
    cut: Cut<'a>,
    modes: Vec<Swing<D>>,
    /// Stiffness of the chips, N/mm; `None` where nothing is cut.
    places: Vec<Option<[[f64; D]; D]>>,
    shares_s: Vec<f64>,
    phases: usize,
    scale_rad_per_s: f64,
    /// Roots without coupling, over the scale.
    free: Vec<Complex<f64>>,
    /// The roots last found at each place: near to the next ones.
    roots: RefCell<Vec<Vec<Complex<f64>>>>,
}

/// A mode over the scale of the frequencies.
#[derive(Clone, Copy)]
struct Swing<const D: usize> {
    along: [f64; D],
    natural: f64,
    /// 2 zeta w, and w^2 over the stiffness.
    damped: f64,
    gain: f64,
}

/// A slow multiplier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlowMultiplier {
    /// From tooth to tooth.
    pub multiplier: Multiplier,
    /// Estimated error of its modulus.
    pub modulus_error: f64,
    /// Largest growth between two teeth of what comes back unchanged from tooth to tooth.
    pub within: f64,
    /// Frequency where it grows most, Hz.
    pub frequency_hz: f64,
}

impl<'a, const D: usize> SlowCut<'a, D> {
    /// Sixteen places to a stretch between breaks, none longer than told.
    fn new(cut: Cut<'a>, (longest_rad, phases): (f64, usize)) -> Self {
        let structure = cut.structure;
        let period_s = cut.rotation.period_s(cut.milling.period_rad());
        let scale_rad_per_s = structure.fastest_rad_per_s();
        let (mut places, mut shares_s) = (Vec::new(), Vec::new());
        each_instant(cut.milling, cut.depth_mm, longest_rad, |_, share, instant| {
            let sum = |sum: Tensor, one: &Entry| combined(&sum, 1.0, &one.stiffness, 1.0);
            let whole = projected(structure, &instant.entries.iter().fold([[0.0; 3]; 3], sum));
            let reduced: [[f64; D]; D] = std::array::from_fn(|i| std::array::from_fn(|j| whole[(i, j)]));
            places.push((!instant.entries.is_empty()).then_some(reduced));
            shares_s.push(share * period_s);
        });
        let swing = |(mode, along): (&Mode, &Vec<f64>)| {
            let natural = mode.rad_per_s() / scale_rad_per_s;
            Swing {
                along: std::array::from_fn(|i| along[i]),
                natural,
                damped: 2.0 * mode.damping_ratio * natural,
                gain: natural * natural / mode.stiffness_n_per_mm(),
            }
        };
        let modes = structure.modes.iter().zip(&structure.directions).map(swing).collect();
        let pair = |mode: &Mode| {
            let pole = pole(mode, scale_rad_per_s);
            [pole, pole.conj()]
        };
        let free: Vec<Complex<f64>> = structure.modes.iter().flat_map(pair).collect();
        let roots = RefCell::new(vec![free.clone(); places.len()]);
        Self { cut, modes, places, shares_s, phases, scale_rad_per_s, free, roots }
    }

    /// The root with the largest real part at a place, 1/s.
    fn leading(&self, place: usize, coupling: Complex<f64>) -> Complex<f64> {
        let most = |roots: &[Complex<f64>]| roots.iter().copied().max_by(|a, b| a.re.total_cmp(&b.re));
        let stiffness = self.places[place].filter(|_| coupling.norm_sqr() > 0.0);
        let Some(stiffness) = stiffness else { return most(&self.free).unwrap_or_default() * self.scale_rad_per_s };
        let coupled: Square<D> = stiffness.map(|row| row.map(|value| coupling * value));
        let mut known = self.roots.borrow_mut();
        let roots = &mut known[place];
        // A root that was met at a free one must leave it: the receptance has its pole there.
        for root in roots.iter_mut() {
            if self.free.iter().any(|free| (*root - free).norm() < BESIDE * free.norm()) {
                *root *= Complex::new(1.0 + BESIDE, 0.6 * BESIDE);
            }
        }
        aberth(roots, |s| self.log_slope(&coupled, s));
        most(roots).unwrap_or_default() * self.scale_rad_per_s
    }

    /// P'/P of the polynomial P that is the product of all denominators times det(1 - G D).
    fn log_slope(&self, coupled: &Square<D>, s: Complex<f64>) -> Option<Complex<f64>> {
        let none: Square<D> = [[Complex::new(0.0, 0.0); D]; D];
        let (mut receptance, mut falling, mut slope) = (none, none, Complex::new(0.0, 0.0));
        for mode in &self.modes {
            let over = (s * (s + mode.damped) + mode.natural * mode.natural).inv();
            let rate = (s * 2.0 + mode.damped) * over;
            slope += rate;
            let flexible = over * mode.gain;
            let falls = flexible * rate;
            for i in 0..D {
                for j in 0..D {
                    let share = mode.along[i] * mode.along[j];
                    receptance[i][j] += flexible * share;
                    falling[i][j] += falls * share;
                }
            }
        }
        let (mut system, moved) = (product(&receptance, coupled), product(&falling, coupled));
        for (i, row) in system.iter_mut().enumerate() {
            for value in row.iter_mut() {
                *value = -*value;
            }
            row[i] += 1.0;
        }
        slope += trace_of_solved(system, moved)?;
        (slope.re.is_finite() && slope.im.is_finite()).then_some(slope)
    }

    /// Multiplications of one phase at all places.
    fn work(&self) -> usize {
        let modes = self.modes.len();
        self.places.len() * 2 * modes * TRIALS * (PER_TRIAL + PER_MODE * modes)
    }

    /// The leading multiplier.
    fn multiplier(&self, monitor: &dyn Monitor) -> Result<SlowMultiplier, Failure> {
        let mut pace = Pace::new(monitor);
        let leading = |place: usize, coupling: Complex<f64>| self.leading(place, coupling);
        let period = SlowPeriod { shares_s: &self.shares_s, phases: self.phases, leading: &leading };
        let found = period.multiplier(|| pace.work(self.work()))?;
        let modulus = found.ln_modulus.min(FAR).exp();
        let (re, im) = (modulus * found.angle_rad.cos(), modulus * found.angle_rad.sin());
        let (oscillations, decays) = in_a_tooth(&self.cut);
        let merged = TAU / (8.0_f64.sqrt() * decays.max(LEAST_DECAYS));
        let turned = if self.cut.structure.modes.len() > 1 { SHAPES } else { 0.0 };
        Ok(SlowMultiplier {
            multiplier: Multiplier { re, im, residual: 0.0 },
            modulus_error: (merged * merged + TAU.recip() / oscillations + turned) * modulus,
            within: found.ln_within.min(FAR).exp(),
            frequency_hz: found.rad_per_s / TAU,
        })
    }

    /// See [`slow_margin`].
    fn margin(&self, pace: &mut Pace<'_>) -> Result<(f64, f64), Failure> {
        let leading = |place: usize, coupling: Complex<f64>| self.leading(place, coupling);
        let period = SlowPeriod { shares_s: &self.shares_s, phases: self.phases, leading: &leading };
        let at_one = period.at_one(|| pace.work(self.work()))?;
        Ok((at_one.ln_whole.max(at_one.ln_within - GROWN.ln()), at_one.rad_per_s / TAU))
    }
}

/// The leading multiplier of a slow cut that repeats from tooth to tooth; with twice as many places and more where that is wanted.
pub(super) fn slow_multiplier(cut: &Cut<'_>, finer: bool, monitor: &dyn Monitor) -> Result<SlowMultiplier, Failure> {
    let arc_rad = (cut.milling.exit_rad - cut.milling.entry_rad).min(cut.milling.period_rad());
    let look = if finer { (FINER * arc_rad, FINER_PHASES) } else { USUAL };
    match cut.structure.basis.len() {
        1 => SlowCut::<1>::new(*cut, look).multiplier(monitor),
        2 => SlowCut::<2>::new(*cut, look).multiplier(monitor),
        _ => SlowCut::<3>::new(*cut, look).multiplier(monitor),
    }
}

/// How far a slow cut is from chatter, below 0 while it is stable: ln |mu| as it is without what came before, or the growth between
/// two teeth over fifty, whichever is larger; and the frequency, Hz.
pub(super) fn slow_margin(cut: &Cut<'_>, pace: &mut Pace<'_>) -> Result<(f64, f64), Failure> {
    match cut.structure.basis.len() {
        1 => SlowCut::<1>::new(*cut, USUAL).margin(pace),
        2 => SlowCut::<2>::new(*cut, USUAL).margin(pace),
        _ => SlowCut::<3>::new(*cut, USUAL).margin(pace),
    }
}

fn product<const D: usize>(a: &Square<D>, b: &Square<D>) -> Square<D> {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..D).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Trace of the inverse of a times b, by elimination; `None` where a is singular.
fn trace_of_solved<const D: usize>(mut a: Square<D>, mut b: Square<D>) -> Option<Complex<f64>> {
    for k in 0..D {
        let pivot = (k..D).max_by(|p, q| a[*p][k].norm_sqr().total_cmp(&a[*q][k].norm_sqr()))?;
        a.swap(k, pivot);
        b.swap(k, pivot);
        let over = a[k][k].inv();
        if !(over.re.is_finite() && over.im.is_finite()) {
            return None;
        }
        let (row, right) = (a[k].map(|value| value * over), b[k].map(|value| value * over));
        (a[k], b[k]) = (row, right);
        for i in (0..D).filter(|i| *i != k) {
            let factor = a[i][k];
            for j in 0..D {
                a[i][j] -= factor * row[j];
                b[i][j] -= factor * right[j];
            }
        }
    }
    Some((0..D).map(|i| b[i][i]).sum())
}

/// The free root of a mode in the upper half, over the scale.
fn pole(mode: &Mode, scale_rad_per_s: f64) -> Complex<f64> {
    let w = mode.rad_per_s() / scale_rad_per_s;
    let ratio = mode.damping_ratio.min(1.0 - 1e-9);
    Complex::new(-ratio * w, w * (1.0 - ratio * ratio).sqrt())
}
