//! Errors that are new at every place along a part, and alike at places that are near each other (`certainty/1.4`).
//!
//! A normal error of mean 0 and standard deviation u along z, correlated as rho(r) = (1 + q) exp(-q), q = sqrt(3) r/l (Matern 3/2), is
//! u times the sum over k of a_k(z) g_k, g_k independent standard normal scores: the modes of its correlation at evenly spaced nodes
//! (Karhunen and Loeve), between them as the nodes let it be expected.

use nalgebra::{DMatrix, DVector};

/// Nodes over the part.
const NODES: usize = 65;
/// Share of the variance that the modes have together, and how many there are at most.
const SHARE: f64 = 0.999;
const MOST_MODES: usize = 32;

/// Shortest correlation length of errors along a part of this length: of shorter ones the modes leave out more than a fiftieth of the
/// variance. The density of rho falls as (3/l^2 + w^2)^-2; with x = 32 pi l/(sqrt(3) L) the waves up to 32 half waves over L have
/// 2/pi (arctan x + x/(1 + x^2)) of it, 0.985 at L = 20 l.
pub(super) fn least_length_mm(part_mm: f64) -> f64 {
    part_mm / 20.0
}

fn correlation(apart_mm: f64, length_mm: f64) -> f64 {
    let q = 3.0_f64.sqrt() * apart_mm.abs() / length_mm;
    (1.0 + q) * (-q).exp()
}

/// Of every mode what it is at these places, for an error of standard deviation 1.
pub(super) fn modes(z_mm: &[f64], length_mm: f64) -> Vec<Vec<f64>> {
    let (from, to) = z_mm.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(from, to), z| (from.min(*z), to.max(*z)));
    if z_mm.is_empty() || to - from <= 0.0 {
        return z_mm.iter().take(1).map(|_| vec![1.0; z_mm.len()]).collect();
    }
    let node = |i: usize| from + (to - from) * i as f64 / (NODES - 1) as f64;
    let of_nodes = DMatrix::from_fn(NODES, NODES, |i, j| correlation(node(i) - node(j), length_mm));
    let found = of_nodes.symmetric_eigen();
    let mut order: Vec<usize> = (0..NODES).collect();
    order.sort_by(|a, b| found.eigenvalues[*b].total_cmp(&found.eigenvalues[*a]));
    let mut told = 0.0;
    let mut modes = Vec::new();
    for mode in order.into_iter().take(MOST_MODES) {
        let value = found.eigenvalues[mode];
        if told >= SHARE * NODES as f64 || value <= 0.0 {
            break;
        }
        told += value;
        let along: DVector<f64> = found.eigenvectors.column(mode) / value.sqrt();
        let at = |z: &f64| (0..NODES).map(|i| correlation(z - node(i), length_mm) * along[i]).sum();
        modes.push(z_mm.iter().map(at).collect());
    }
    modes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_have_the_correlation() {
        let z_mm: Vec<f64> = (0..=30).map(|i| 20.0 * f64::from(i)).collect();
        for (length_mm, within) in [(600.0, 2e-3), (150.0, 4e-3), (60.0, 0.03), (least_length_mm(600.0), 0.05)] {
            let modes = modes(&z_mm, length_mm);
            for (i, a) in z_mm.iter().enumerate() {
                for (j, b) in z_mm.iter().enumerate() {
                    let found: f64 = modes.iter().map(|mode| mode[i] * mode[j]).sum();
                    let exact = correlation(a - b, length_mm);
                    assert!((found - exact).abs() < within, "{length_mm} mm, {a} and {b}: {found}, {exact}");
                }
            }
        }
    }
}
