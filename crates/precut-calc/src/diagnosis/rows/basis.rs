//! Smooth columns along a part, round it, or over the order of testing.

use std::f64::consts::PI;

use crate::calculator::Smooth;

/// cos(k pi u).
pub(crate) fn cosine(order: usize, u: f64) -> f64 {
    (order as f64 * PI * u).cos()
}

/// The first columns of a complete set over these rows: `count` cosines along a part; round it, the
/// constant and the Fourier pairs up to order `count`.
pub(in crate::diagnosis) fn smooth_columns(smooth: &Smooth, rows: &[usize], count: usize) -> Vec<Vec<f64>> {
    match smooth {
        Smooth::Along(u) => (0..count).map(|k| rows.iter().map(|&row| cosine(k, u[row])).collect()).collect(),
        Smooth::Around(angle) => {
            let mut columns = vec![vec![1.0; rows.len()]];
            for k in 1..=count {
                columns.push(rows.iter().map(|&row| (k as f64 * angle[row]).cos()).collect());
                columns.push(rows.iter().map(|&row| (k as f64 * angle[row]).sin()).collect());
            }
            columns
        }
        Smooth::None => Vec::new(),
    }
}

/// Orthonormal columns with the same span; what depends on earlier ones is left out.
///
/// Gram-Schmidt, each column twice: after the second pass the loss of orthogonality is of the order of
/// round-off whatever the condition of the input.
pub(in crate::diagnosis) fn orthonormal(columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    const DEPENDENT: f64 = 1e-9;
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
    for mut column in columns {
        let before = dot(&column, &column).sqrt();
        for _ in 0..2 {
            for done in &basis {
                let along = dot(done, &column);
                column.iter_mut().zip(done).for_each(|(c, d)| *c -= along * d);
            }
        }
        let after = dot(&column, &column).sqrt();
        if after > DEPENDENT * before {
            for c in &mut column {
                *c /= after;
            }
            basis.push(column);
        }
    }
    basis
}

/// Inner product in four interleaved sums: the same bits on every machine, and short sums round less.
pub(in crate::diagnosis) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0_f64; 4];
    let (fours_a, fours_b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = fours_a.remainder().iter().zip(fours_b.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in fours_a.zip(fours_b) {
        for lane in 0..4 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}
