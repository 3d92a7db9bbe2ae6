//! Where modes may be: least-squares complex frequency (`receptance/3.1`).
//!
//! H_o = B_o(z)/A(z), z = e^(-i w T), with one denominator of real coefficients for all functions of a group:
//! sum of |B_o - H_o A|^2 is least squares in the coefficients, its normal equations are sums over z^k, and the numerators are
//! eliminated. The orders rise; poles that stay are kept.

use nalgebra::{Complex, DMatrix, DVector};

use super::super::input::MAX_MODES;
use super::{Group, Lines};

/// A pole in the upper half plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pole {
    /// Natural angular frequency, rad/s.
    pub omega: f64,
    /// Share of critical damping.
    pub zeta: f64,
}

/// Relative change of frequency and damping from one order to the next within which a pole stays.
const SAME_FREQUENCY: f64 = 0.01;
const SAME_DAMPING: f64 = 0.2;
/// Poles of more damping than this are no modes.
const MOST_DAMPING: f64 = 0.5;
/// Steps of the iteration for the roots of a polynomial.
const ROOT_STEPS: usize = 100;
/// Step of a root, relative to 1, at which it has converged.
const ROOT_CONVERGED: f64 = 1e-13;

/// Sums over the lines of a function: of z^k, of H z^k for k from -n to n, of |H|^2 z^k. Real parts, as coefficients are.
struct Sums {
    ones: Vec<f64>,
    /// k from -n on.
    values: Vec<f64>,
    squares: Vec<f64>,
}

fn sums(lines: &Lines, period: f64, most: usize) -> Sums {
    let mut found = Sums { ones: vec![0.0; most + 1], values: vec![0.0; 2 * most + 1], squares: vec![0.0; most + 1] };
    for ((omega, value), weight) in lines.omega.iter().zip(&lines.values).zip(&lines.weights) {
        let weight = weight * weight;
        let step = Complex::from_polar(1.0, -omega * period);
        let (h, square) = (value * weight, value.norm_sqr() * weight);
        let mut z = Complex::new(1.0, 0.0);
        for k in 0..=most {
            found.ones[k] += weight * z.re;
            found.squares[k] += square * z.re;
            found.values[most + k] += h.re * z.re - h.im * z.im;
            if k > 0 {
                found.values[most - k] += h.re * z.re + h.im * z.im;
            }
            z *= step;
        }
    }
    found
}

/// Coefficients of the denominator of an order, from the constant on; the last is 1.
fn denominator(sums: &[Sums], most: usize, order: usize) -> Option<Vec<f64>> {
    let size = order + 1;
    let mut normal = DMatrix::<f64>::zeros(size, size);
    for of in sums {
        let ones = DMatrix::from_fn(size, size, |i, j| of.ones[i.abs_diff(j)]);
        let mixed = DMatrix::from_fn(size, size, |i, j| -of.values[most + j - i]);
        let squares = DMatrix::from_fn(size, size, |i, j| of.squares[i.abs_diff(j)]);
        let reduced = ones.cholesky()?.l().solve_lower_triangular(&mixed)?;
        normal += squares - reduced.transpose() * &reduced;
    }
    let inner = normal.view((0, 0), (order, order)).into_owned();
    let right: DVector<f64> = -normal.view((0, order), (order, 1)).column(0).into_owned();
    let found = inner.clone().cholesky().map(|c| c.solve(&right)).or_else(|| inner.lu().solve(&right))?;
    let coefficients: Vec<f64> = found.iter().copied().chain([1.0]).collect();
    coefficients.iter().all(|c| c.is_finite()).then_some(coefficients)
}

/// Roots of a polynomial, all at once (Aberth, Ehrlich).
fn roots(coefficients: &[f64]) -> Vec<Complex<f64>> {
    let degree = coefficients.len() - 1;
    let radius = (coefficients[0].abs() / coefficients[degree].abs()).powf(1.0 / degree as f64).clamp(1e-3, 1e3);
    let start = |k: usize| Complex::from_polar(radius, std::f64::consts::TAU * (k as f64 + 0.25) / degree as f64);
    let mut found: Vec<Complex<f64>> = (0..degree).map(start).collect();
    for _ in 0..ROOT_STEPS {
        let mut largest: f64 = 0.0;
        for k in 0..degree {
            let x = found[k];
            let (mut value, mut slope) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
            for c in coefficients.iter().rev() {
                slope = slope * x + value;
                value = value * x + c;
            }
            let newton = value / slope;
            let others: Complex<f64> = (0..degree).filter(|j| *j != k).map(|j| (x - found[j]).inv()).sum();
            let step = newton / (Complex::new(1.0, 0.0) - newton * others);
            if step.is_finite() {
                found[k] -= step;
                largest = largest.max(step.norm() / x.norm().max(1e-3));
            }
        }
        if largest < ROOT_CONVERGED {
            break;
        }
    }
    found
}

/// The poles inside the band of an order.
fn poles(coefficients: &[f64], period: f64, band: [f64; 2]) -> Vec<Pole> {
    let pole = |root: Complex<f64>| {
        let lambda = -root.ln() / period;
        let omega = lambda.norm();
        Pole { omega, zeta: -lambda.re / omega }
    };
    let is_mode =
        |pole: &Pole| pole.zeta > 0.0 && pole.zeta < MOST_DAMPING && (band[0]..=band[1]).contains(&pole.omega);
    // z = e^(-s T): a pole above the axis has a root below it.
    roots(coefficients).into_iter().filter(|root| root.im < 0.0).map(pole).filter(is_mode).collect()
}

fn is_same(a: &Pole, b: &Pole) -> bool {
    (a.omega / b.omega - 1.0).abs() < SAME_FREQUENCY && (a.zeta / b.zeta - 1.0).abs() < SAME_DAMPING
}

/// Poles that stay over the orders, the steadiest first.
pub(super) fn candidates(group: &Group, stop: &dyn Fn() -> bool) -> Option<Vec<Pole>> {
    let band = group.band();
    let period = std::f64::consts::PI / band[1];
    let fewest = group.lines.iter().map(|lines| lines.values.len()).min().unwrap_or(0);
    // A numerator and the denominator take 2 (n + 1) numbers of 2 N.
    let most = (2 * MAX_MODES).min(fewest.saturating_sub(2) / 2 * 2);
    let sums: Vec<Sums> = group.lines.iter().map(|lines| sums(lines, period, most)).collect();
    let mut clusters: Vec<(Pole, usize)> = Vec::new();
    let mut before: Vec<Pole> = Vec::new();
    for order in (2..=most).step_by(2) {
        if stop() {
            return None;
        }
        let Some(coefficients) = denominator(&sums, most, order) else { continue };
        let found = poles(&coefficients, period, band);
        for pole in &found {
            if !before.iter().any(|other| is_same(pole, other)) {
                continue;
            }
            match clusters.iter_mut().find(|(other, _)| is_same(pole, other)) {
                Some(cluster) => *cluster = (*pole, cluster.1 + 1),
                None => clusters.push((*pole, 1)),
            }
        }
        before = found;
    }
    clusters.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.omega.total_cmp(&b.0.omega)));
    Some(clusters.into_iter().map(|(pole, _)| pole).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_of_a_product_are_its_factors() {
        let wanted = [
            Complex::new(0.6, 0.8),
            Complex::new(0.6, -0.8),
            Complex::new(-1.2, 0.1),
            Complex::new(-1.2, -0.1),
            Complex::new(0.5, 0.0),
        ];
        let mut coefficients = vec![Complex::new(1.0, 0.0)];
        for root in wanted {
            let shifted = coefficients.iter().map(|c| -c * root).chain([Complex::new(0.0, 0.0)]);
            let raised = [Complex::new(0.0, 0.0)].into_iter().chain(coefficients.iter().copied());
            coefficients = shifted.zip(raised).map(|(a, b)| a + b).collect();
        }
        let real: Vec<f64> = coefficients.iter().map(|c| c.re).collect();
        let found = roots(&real);
        for root in wanted {
            assert!(found.iter().any(|one| (one - root).norm() < 1e-12), "{root}: {found:?}");
        }
    }
}
