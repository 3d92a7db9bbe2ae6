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
    let loaded = freedom(&nodes, z);
    let mut load = vec![0.0; 2 * nodes.len()];
    load[loaded] = 1.0;
    1e3 * solved(stiffness(lathe, &nodes, bending, rotation_n_mm_per_rad), load)[loaded]
}

/// Displacement at `z` when the tailstock moves by one: its spring pulls the end of the shaft along. Of the shaft as it
/// is drawn: a flexibility that is off by its allowance changes the shape by less than a thousandth.
pub(crate) fn carried_by_tailstock(lathe: &Lathe, z: f64, rotation_n_mm_per_rad: Option<f64>) -> f64 {
    let nodes = mesh(lathe.length_mm, z);
    let mut load = vec![0.0; 2 * nodes.len()];
    load[2 * nodes.len() - 2] = 1e3 / lathe.tailstock_um_per_n;
    solved(stiffness(lathe, &nodes, 1.0, rotation_n_mm_per_rad), load)[freedom(&nodes, z)]
}

/// Of the displacement of the node at `z`.
fn freedom(nodes: &[f64], z: f64) -> usize {
    nodes.iter().position(|node| (node - z).abs() < 1e-9).map_or(0, |node| 2 * node)
}

/// Displacement and rotation of every node, N/mm and so on.
fn stiffness(lathe: &Lathe, nodes: &[f64], bending: f64, rotation_n_mm_per_rad: Option<f64>) -> Vec<Vec<f64>> {
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
    k
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tailstock_carries_the_shaft_along() {
        let lathe = Lathe {
            length_mm: 600.0,
            diameter_mm: 40.0,
            headstock_um_per_n: 0.02,
            tailstock_um_per_n: 0.05,
            carriage_um_per_n: 0.03,
            force_n: 300.0,
            exponents: (0.9, 0.6, -0.15),
        };
        let l = lathe.length_mm;
        let ei = YOUNGS_MODULUS_N_PER_MM2 * std::f64::consts::PI * 40.0_f64.powi(4) / 64.0;
        let area = std::f64::consts::PI * 40.0_f64.powi(2) / 4.0;
        let shear = 2.0 * (1.0 + POISSON_RATIO) / (SHEAR_COEFFICIENT * area * YOUNGS_MODULUS_N_PER_MM2);
        let rotation = 3.0e7;
        for z in [0.0, 37.0, 150.0, 412.5, 600.0] {
            // Condition of the mesh about (24 l/d)^2 of the rounding: 1e-10.
            assert!((carried_by_tailstock(&lathe, z, None) - z / l).abs() < 1e-9, "{z}");
            // The force at the tailstock bends a cantilever on springs: w_h + z l/k + z²(3l - z)/6EI + z/kGA per force.
            let moved = |x: f64| 2e-5 + x * l / rotation + x * x * (3.0 * l - x) / (6.0 * ei) + x * shear;
            let expected = moved(z) / (moved(l) + 5e-5);
            let found = carried_by_tailstock(&lathe, z, Some(rotation));
            assert!((found - expected).abs() < 1e-9, "{z}: {found} instead of {expected}");
        }
    }
}
