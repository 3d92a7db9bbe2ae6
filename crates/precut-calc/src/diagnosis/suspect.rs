//! Blunders in the data, looked for before any physics is blamed (`diagnosis/8`).

use super::data::Data;

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

/// Traces of one run that repeat each other digit for digit: copied, not measured again.
pub fn copied_traces(data: &Data) -> Vec<(usize, usize)> {
    let traces = &data.layout.traces;
    let same = |a: &[usize], b: &[usize]| {
        a.len() > 2
            && a.len() == b.len()
            && a.iter().zip(b).all(|(&i, &j)| {
                data.value[i].to_bits() == data.value[j].to_bits()
                    && data.layout.design.cell[i] == data.layout.design.cell[j]
            })
    };
    let mut copied = Vec::new();
    for (i, first) in traces.iter().enumerate() {
        for (j, second) in traces.iter().enumerate().skip(i + 1) {
            if same(first, second) {
                copied.push((i, j));
            }
        }
    }
    copied
}
