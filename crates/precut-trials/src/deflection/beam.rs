//! A shear-flexible beam on springs by finite elements.

use super::Lathe;

pub(crate) const YOUNGS_MODULUS_N_PER_MM2: f64 = 210_000.0;
const POISSON_RATIO: f64 = 0.3;
/// Shear coefficient of a full circle, after Cowper.
const SHEAR_COEFFICIENT: f64 = 0.886;
const ELEMENTS: usize = 24;

/// Displacement under a unit force at `z`, um/N: one node of the mesh is put there.
pub(crate) fn compliance_um_per_n(lathe: &Lathe, z: f64, bending: f64, rotation_n_mm_per_rad: Option<f64>) -> f64 {
    let nodes = mesh(lathe.length_mm, z);
    let count = 2 * nodes.len();
    let mut k = vec![vec![0.0; count]; count];
    let second_moment = std::f64::consts::PI * lathe.diameter_mm.powi(4) / 64.0;
    let area = std::f64::consts::PI * lathe.diameter_mm.powi(2) / 4.0;
    let ei = YOUNGS_MODULUS_N_PER_MM2 * second_moment / bending;
    let shear = SHEAR_COEFFICIENT * area * YOUNGS_MODULUS_N_PER_MM2 / (2.0 * (1.0 + POISSON_RATIO)) / bending;
    for (e, pair) in nodes.windows(2).enumerate() {
        let l = pair[1] - pair[0];
        let phi = 12.0 * ei / (shear * l * l);
        let f = ei / (l * l * l * (1.0 + phi));
        let own = [
            [12.0, 6.0 * l, -12.0, 6.0 * l],
            [6.0 * l, (4.0 + phi) * l * l, -6.0 * l, (2.0 - phi) * l * l],
            [-12.0, -6.0 * l, 12.0, -6.0 * l],
            [6.0 * l, (2.0 - phi) * l * l, -6.0 * l, (4.0 + phi) * l * l],
        ];
        for (i, row) in own.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                k[2 * e + i][2 * e + j] += f * value;
            }
        }
    }
    k[0][0] += 1e3 / lathe.headstock_um_per_n;
    k[count - 2][count - 2] += 1e3 / lathe.tailstock_um_per_n;
    k[1][1] += rotation_n_mm_per_rad.unwrap_or(0.0);
    let loaded = nodes.iter().position(|node| (node - z).abs() < 1e-9).map_or(0, |node| 2 * node);
    let mut load = vec![0.0; count];
    load[loaded] = 1.0;
    1e3 * solved(k, load)[loaded]
}

/// Evenly spaced nodes, the nearest inner one moved to `z`.
fn mesh(length: f64, z: f64) -> Vec<f64> {
    let mut nodes: Vec<f64> = (0..=ELEMENTS).map(|i| length * i as f64 / ELEMENTS as f64).collect();
    if nodes.iter().all(|node| (node - z).abs() > 1e-9) {
        let gap = length / ELEMENTS as f64;
        let nearest = (1..ELEMENTS).find(|&i| (nodes[i] - z).abs() <= 0.5 * gap);
        match nearest {
            Some(i) => nodes[i] = z,
            None if z < 0.5 * gap => nodes.insert(1, z),
            None => nodes.insert(ELEMENTS, z),
        }
    }
    nodes
}

/// Banded Gauss elimination; the matrix is symmetric and positive definite.
fn solved(mut k: Vec<Vec<f64>>, mut right: Vec<f64>) -> Vec<f64> {
    const BAND: usize = 4;
    let count = right.len();
    for i in 0..count {
        for j in i + 1..(i + BAND).min(count) {
            let factor = k[j][i] / k[i][i];
            let (above, below) = k.split_at_mut(j);
            let columns = i..(i + BAND).min(count);
            below[0][columns.clone()].iter_mut().zip(&above[i][columns]).for_each(|(b, a)| *b -= factor * a);
            right[j] -= factor * right[i];
        }
    }
    for i in (0..count).rev() {
        let done: f64 = (i + 1..(i + BAND).min(count)).map(|j| k[i][j] * right[j]).sum();
        right[i] = (right[i] - done) / k[i][i];
    }
    right
}
