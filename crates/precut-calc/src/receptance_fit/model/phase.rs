//! Whether real modes suffice: phases of residues that may be complex (`receptance/3.4`).
//!
//! (a + i w b/w_k)/(w_k^2 - w^2 + 2 i zeta w_k w) is a mode with the residue R = b/(2 w_k) + i (b zeta - a)/(2 w_d): of a real
//! mode b = 0 and R is imaginary. Frequencies and dampings move along, as those of the real modes make up for a phase.

use nalgebra::{Complex, DMatrix, DVector};

use super::poles::Pole;
use super::refine::{Refined, receptance};
use super::select::{Normal, normal, poles_of};
use super::{Group, Lines};

/// Steps of Gauss and Newton from the real modes.
const STEPS: usize = 6;
/// Largest relative change of frequency, and of damping, in one of them.
const LARGEST: [f64; 2] = [0.02, 0.3];

/// A mode with a complex residue.
#[derive(Clone, Copy)]
struct Twisted {
    pole: Pole,
    a: f64,
    b: f64,
}

/// Phase of each mode, degrees from that of a real one, and its standard error, by the function that shows the mode best.
pub(super) fn phases(group: &Group, refined: &Refined) -> Vec<[f64; 2]> {
    let poles = poles_of(refined);
    let mut found = vec![[0.0, 0.0]; poles.len()];
    let mut best = vec![0.0; poles.len()];
    for lines in &group.lines {
        let Some((modes, errors)) = twisted(group, lines, &poles) else { continue };
        for (k, (mode, error)) in modes.iter().zip(errors).enumerate() {
            let damped = (1.0 - mode.pole.zeta * mode.pole.zeta).max(0.0).sqrt();
            let imaginary = ((mode.b * mode.pole.zeta - mode.a) / damped).abs();
            let seen = imaginary / error;
            if seen > best[k] {
                best[k] = seen;
                found[k] = [(mode.b / imaginary).atan().abs().to_degrees(), (error / imaginary).to_degrees()];
            }
        }
    }
    found
}

/// The modes of a function with complex residues, and the standard errors of their b.
fn twisted(group: &Group, lines: &Lines, poles: &[Pole]) -> Option<(Vec<Twisted>, Vec<f64>)> {
    let residues = |omega: f64, into: &mut [Complex<f64>]| {
        for (entries, pole) in into.chunks_exact_mut(2).zip(poles) {
            let h = receptance(*pole, omega);
            entries[0] = h;
            entries[1] = h * Complex::new(0.0, omega / pole.omega);
        }
    };
    let (start, _) = solved(&normal(group, lines, 2 * poles.len(), &residues), lines)?;
    let mode = |(k, pole): (usize, &Pole)| Twisted { pole: *pole, a: start[2 * k], b: start[2 * k + 1] };
    let mut modes: Vec<Twisted> = poles.iter().enumerate().map(mode).collect();
    let mut errors = Vec::new();
    for _ in 0..STEPS {
        let row = |omega: f64, into: &mut [Complex<f64>]| {
            for (entries, mode) in into.chunks_exact_mut(4).zip(&modes) {
                let (w, zeta) = (mode.pole.omega, mode.pole.zeta);
                let h = receptance(mode.pole, omega);
                let turned = Complex::new(0.0, omega / w);
                let square = -h * h * (mode.a + turned * mode.b);
                entries[0] = h;
                entries[1] = h * turned;
                entries[2] = square * Complex::new(2.0 * w * w, 2.0 * zeta * w * omega);
                entries[3] = square * Complex::new(0.0, 2.0 * w * omega);
            }
        };
        let (numbers, deviations) = solved(&normal(group, lines, 4 * modes.len(), &row), lines)?;
        for (k, mode) in modes.iter_mut().enumerate() {
            let of = &numbers.as_slice()[4 * k..4 * k + 4];
            (mode.a, mode.b) = (of[0], of[1]);
            mode.pole.omega *= 1.0 + of[2].clamp(-LARGEST[0], LARGEST[0]);
            let most = LARGEST[1] * mode.pole.zeta;
            mode.pole.zeta += of[3].clamp(-most, most);
        }
        errors = (0..modes.len()).map(|k| deviations[4 * k + 1]).collect();
    }
    Some((modes, errors))
}

/// The numbers of normal equations and their standard errors; `None` where the lines do not tell them apart.
fn solved(normal: &Normal, lines: &Lines) -> Option<(DVector<f64>, Vec<f64>)> {
    let size = normal.right.len();
    let scale = normal.gram.diagonal().map(|entry| entry.sqrt().max(f64::MIN_POSITIVE));
    let unit = DMatrix::from_fn(size, size, |i, j| normal.gram[(i, j)] / (scale[i] * scale[j]));
    let inverse = unit.cholesky()?.inverse();
    let scaled = &inverse * normal.right.component_div(&scale);
    let spare = (2 * lines.values.len()).saturating_sub(size).max(1) as f64;
    let left = (normal.square - scaled.dot(&normal.right.component_div(&scale))).max(0.0);
    let error = |i: usize| (left / spare * inverse[(i, i)].max(0.0)).sqrt() / scale[i];
    Some((scaled.component_div(&scale), (0..size).map(error).collect()))
}
