//! The zeroth-order approximation: the cutting stiffness replaced by its mean (Altintas and Budak), in one direction.
//!
//! Closed form but for the search over the chatter frequency: kappa = -1/(2 Re G) where it has the sign of the mean
//! factor a0, tooth period from exp(-i w tau) = -conj(G)/G (`fixture/5.4`). Beside the multiplier it is a check and a
//! starting guess; it misses what the time dependence does (flip lobes at small immersion).

use std::f64::consts::{PI, TAU};

use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::holding::Holding;

/// Frequencies of the search. Doubling them moves the limits by less than 1e-6.
const FREQUENCIES: u32 = 6000;

/// The limits of the approximation, in terms of the mean cutting stiffness kappa, N/mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Zeroth {
    /// a0.
    pub mean_factor: f64,
    /// Lowest |kappa| over all speeds, where there is one, and its frequency.
    pub least: Option<(f64, f64)>,
}

/// |kappa| at a frequency where the sign fits.
fn stiffness(holding: &Holding, sign: f64, rad_per_s: f64) -> Option<f64> {
    let (re, _) = holding.receptance(rad_per_s);
    let kappa = -1.0 / (2.0 * re);
    (kappa * sign > 0.0 && kappa.is_finite()).then_some(kappa.abs())
}

fn band(holding: &Holding) -> (f64, f64) {
    let modes = holding.modes();
    let low = modes.iter().map(|m| m.natural_hz).fold(f64::INFINITY, f64::min);
    let high = modes.iter().map(|m| m.natural_hz).fold(0.0, f64::max);
    (TAU * low * 0.02, TAU * high * 4.0)
}

fn frequency(low: f64, high: f64, step: f64) -> f64 {
    low * (high / low).powf(step / f64::from(FREQUENCIES))
}

pub(in crate::fixture_stability) fn zeroth(holding: &Holding, cutting: &Cutting) -> Zeroth {
    let mean_factor = cutting.mean_factor();
    let (low, high) = band(holding);
    let at = |step: f64| frequency(low, high, step);
    let mut least: Option<(f64, f64)> = None;
    if mean_factor.abs() > 0.0 {
        for step in 0..=FREQUENCIES {
            let step = f64::from(step);
            if let Some(kappa) = stiffness(holding, mean_factor, at(step))
                && least.is_none_or(|(best, _)| kappa < best)
            {
                least = Some((kappa, step));
            }
        }
    }
    // Golden section between the neighbours of the best.
    let least = least.map(|(_, step)| {
        let ratio = 0.618_033_988_749_894_9;
        let of = |s: f64| stiffness(holding, mean_factor, at(s)).unwrap_or(f64::INFINITY);
        let (mut a, mut b) = (step - 1.0, step + 1.0);
        for _ in 0..60 {
            let (p, q) = (b - ratio * (b - a), a + ratio * (b - a));
            if of(p) < of(q) { b = q } else { a = p }
        }
        let s = 0.5 * (a + b);
        (of(s), at(s) / TAU)
    });
    Zeroth { mean_factor, least }
}

/// Lowest |kappa| of all lobes at a speed, N/mm.
pub(in crate::fixture_stability) fn at_speed(holding: &Holding, cutting: &Cutting, spindle_rpm: f64) -> Option<f64> {
    let sign = cutting.mean_factor();
    if sign.abs() <= 0.0 {
        return None;
    }
    let tau = cutting.tooth_period_s(spindle_rpm);
    let (low, high) = band(holding);
    let steps = FREQUENCIES;
    // Lobe number: an integer where w tau = 2 arg G + pi + 2 pi l.
    let lobe = |w: f64| {
        let (re, im) = holding.receptance(w);
        (w * tau - 2.0 * im.atan2(re) - PI) / TAU
    };
    let mut best: Option<f64> = None;
    let mut before = lobe(low);
    let mut w_before = low;
    for step in 1..=steps {
        let w = frequency(low, high, f64::from(step));
        let here = lobe(w);
        // A jump of arg G by 2 pi moves the lobe number by 2: no crossing in between.
        if (here - before).abs() < 1.5 {
            let first = before.min(here).ceil();
            let mut number = first;
            while number <= before.max(here) {
                let (mut a, mut b) = (w_before, w);
                let rising = here > before;
                for _ in 0..60 {
                    let middle = 0.5 * (a + b);
                    if (lobe(middle) < number) == rising { a = middle } else { b = middle }
                }
                if let Some(kappa) = stiffness(holding, sign, 0.5 * (a + b)) {
                    best = Some(best.map_or(kappa, |k| k.min(kappa)));
                }
                number += 1.0;
            }
        } else {
            // Many lobes between two frequencies (low speed): the lobes have merged into their lower envelope.
            for s in [w_before, w] {
                if let Some(kappa) = stiffness(holding, sign, s) {
                    best = Some(best.map_or(kappa, |k| k.min(kappa)));
                }
            }
        }
        (before, w_before) = (here, w);
    }
    best
}

/// Depth at which the mean cutting stiffness (1-k) Cp H^(1-mu) Sz^(-k) |a0| reaches kappa.
pub(in crate::fixture_stability) fn depth_mm(
    cutting: &Cutting,
    mean_factor: f64,
    kappa_n_per_mm: f64,
    feed_mm: f64,
) -> f64 {
    let k = cutting.chip_exponent;
    let per_power = (1.0 - k) * cutting.coefficient * feed_mm.powf(-k) * mean_factor.abs();
    (kappa_n_per_mm / per_power).powf(1.0 / (1.0 - cutting.depth_exponent))
}
