//! Blunders in the data, looked for before any physics is blamed (`diagnosis/8`).

use crate::calculator::{Quantity, Smooth};
use crate::diagnosis::rows::data::Data;

/// Factors that a wrong unit, a wrong sign or a radius for a diameter leaves.
const FACTORS: [f64; 11] = [2.0, 0.5, -1.0, -2.0, -0.5, 1000.0, 0.001, 25.4, 1.0 / 25.4, 39.37, 1.0 / 39.37];
/// How near the fitted factor has to be, relative.
const NEAR: f64 = 0.12;
/// How far from one it has to be.
const FAR: f64 = 0.3;
/// How much of the variance it has to explain.
const EXPLAINED: f64 = 0.8;

/// The rows look like the base times a factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SuspectedFactor {
    /// The factor that a blunder would leave: measured = factor x true.
    pub factor: f64,
    /// The factor fitted.
    pub fitted: f64,
    /// Share of the variance explained by base times fitted factor plus a constant.
    pub explained: f64,
}

/// Fits measured = k base + c, and names the blunder that leaves such a k.
///
/// The margins were chosen so that true causes do not look like blunders: a force twice as high as
/// assumed lies outside what the causes of the catalogue may explain.
pub fn suspected_factor(measured: &[f64], base: &[f64], keep: &[bool]) -> Option<SuspectedFactor> {
    let kept = || measured.iter().zip(base).zip(keep).filter(|(_, keep)| **keep).map(|(pair, _)| pair);
    let count = kept().count() as f64;
    if count < 3.0 {
        return None;
    }
    let (sum_y, sum_f) = kept().fold((0.0, 0.0), |(y, f), (a, b)| (y + a, f + b));
    let (mean_y, mean_f) = (sum_y / count, sum_f / count);
    let (mut yy, mut yf, mut ff) = (0.0, 0.0, 0.0);
    for (y, f) in kept() {
        let (y, f) = (y - mean_y, f - mean_f);
        yy += y * y;
        yf += y * f;
        ff += f * f;
    }
    if ff <= 0.0 || yy <= 0.0 {
        return None;
    }
    let fitted = yf / ff;
    let explained = yf * yf / (ff * yy);
    if explained <= EXPLAINED || (fitted - 1.0).abs() <= FAR {
        return None;
    }
    let near = |factor: &&f64| (fitted / **factor - 1.0).abs() < NEAR;
    FACTORS.iter().find(near).map(|&factor| SuspectedFactor { factor, fitted, explained })
}

/// Factors that a wrong unit leaves in what is compared by its logarithm: mm or inches for um, microinches, inches for mm.
const UNITS: [f64; 6] = [1000.0, 0.001, 25.4, 1.0 / 25.4, 39.37, 1.0 / 39.37];
/// The same in forces: kilogram-force, kilonewton, pound-force.
const FORCE_UNITS: [f64; 6] = [9.80665, 1.0 / 9.80665, 1000.0, 0.001, 4.44822, 1.0 / 4.44822];
/// The same in amplitudes, where half of the peak-to-peak is given for the whole.
const AMPLITUDES: [f64; 8] = [2.0, 0.5, 1000.0, 0.001, 25.4, 1.0 / 25.4, 39.37, 1.0 / 39.37];

/// Factors that a wrong unit leaves in the values of a quantity.
pub(in crate::diagnosis) fn factors_of(quantity: &Quantity) -> &'static [f64] {
    match quantity {
        Quantity { logarithmic: false, .. } => &FACTORS,
        Quantity { unit: "N", .. } => &FORCE_UNITS,
        Quantity { name, .. } if name.contains("peak_to_peak") => &AMPLITUDES,
        Quantity { unit: "um" | "mm", .. } => &UNITS,
        _ => &[],
    }
}

/// The same of what is compared by its logarithm: a wrong unit shifts all rows by ln q, and leaves exponents alone.
///
/// The shift is looked for where it explains four fifths of the mean square of the residuals. Twice or half is a blunder of
/// amplitudes only: a surface twice as rough as expected is no wrong unit.
pub fn suspected_offset(quantity: &Quantity, measured: &[f64], base: &[f64], keep: &[bool]) -> Option<SuspectedFactor> {
    if !quantity.logarithmic {
        return None;
    }
    let rows = measured.iter().zip(base).zip(keep).filter(|(_, keep)| **keep);
    let gaps: Vec<f64> = rows.map(|((y, f), _)| y - f).collect();
    let count = gaps.len() as f64;
    let (sum, square) = gaps.iter().fold((0.0, 0.0), |(sum, square), gap| (sum + gap, square + gap * gap));
    let mean = sum / count;
    if gaps.len() < 3 || square <= 0.0 || count * mean * mean <= EXPLAINED * square {
        return None;
    }
    // As a share of the variance about the mean of the rows, which is what causes are held against.
    let centre = measured.iter().zip(keep).filter(|(_, keep)| **keep).map(|(y, _)| y).sum::<f64>() / count;
    let spread: f64 =
        measured.iter().zip(keep).filter(|(_, keep)| **keep).map(|(y, _)| (y - centre) * (y - centre)).sum();
    let left: f64 = gaps.iter().map(|gap| (gap - mean) * (gap - mean)).sum();
    let explained = if spread > 0.0 { 1.0 - left / spread } else { 0.0 };
    let near = |factor: &&f64| (mean.exp() / **factor - 1.0).abs() < NEAR;
    factors_of(quantity).iter().find(near).map(|&factor| SuspectedFactor { factor, fitted: mean.exp(), explained })
}

/// Whether every sweep has values that go one way from row to row, and places that do not.
pub fn swapped_columns(data: &Data) -> bool {
    let Smooth::Along(places) = &data.layout.design.smooth else { return false };
    let goes_one_way = |of: &dyn Fn(usize) -> f64, rows: &[usize]| {
        let steps = || rows.windows(2).map(|pair| of(pair[1]) - of(pair[0]));
        steps().all(|step| step > 0.0) || steps().all(|step| step < 0.0)
    };
    let mut sweeps = data.layout.traces.iter().filter(|rows| rows.len() > 4).peekable();
    sweeps.peek().is_some()
        && sweeps.all(|rows| goes_one_way(&|row| data.value[row], rows) && !goes_one_way(&|row| places[row], rows))
}
