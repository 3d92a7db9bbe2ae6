//! Tables of an element: Gauss points, and moments of the Lagrange polynomials on them.

use crate::quadrature::gauss_legendre;

/// Terms of the Taylor series of the matrix exponential over one element. With norm(A) h up to 8 the last is below
/// 8^48/48! = 2e-18 of the first.
pub(super) const TERMS: usize = 48;

/// What all elements with P points share.
///
/// `moment[m][i][j]` is the integral from 0 to c_i of (c_i - s)^m/m! l_j(s) ds, with c_P = 1: with it the integrals
/// of exp(A (c_i h - s)) b l_j over an element are sums of A^m b h^(m+1), for any matrix A, defective or not.
#[derive(Debug, Clone)]
pub struct Rule<const P: usize> {
    /// The Gauss points on 0..1.
    pub points: [f64; P],
    moment: Vec<[[f64; P]; P]>,
    moment_end: Vec<[f64; P]>,
    basis: Lagrange<P>,
}

impl<const P: usize> Rule<P> {
    /// The tables: some 230 000 products for P = 12, to be made once per job.
    pub fn new() -> Self {
        let (gauss, _) = gauss_legendre(P);
        let mut points = [0.0; P];
        points.copy_from_slice(&gauss);
        let basis = Lagrange::new(points);
        // Of degree TERMS + P - 1 at most: exact on so many points.
        let (fine, weight) = gauss_legendre(usize::midpoint(TERMS, P) + 1);
        let mut moment = vec![[[0.0; P]; P]; TERMS];
        let mut moment_end = vec![[0.0; P]; TERMS];
        // Integrals from 0 to `end`: one row of P for every m.
        let integrals = |end: f64, add: &mut dyn FnMut(usize, &[f64; P])| {
            for (c, w) in fine.iter().zip(&weight) {
                let s = c * end;
                let mut row = basis.at(s).map(|l| l * w * end);
                for m in 0..TERMS {
                    add(m, &row);
                    let factor = (end - s) / (m + 1) as f64;
                    row = row.map(|value| value * factor);
                }
            }
        };
        let sum = |into: &mut [f64; P], row: &[f64; P]| {
            for (total, value) in into.iter_mut().zip(row) {
                *total += value;
            }
        };
        for (i, &c) in points.iter().enumerate() {
            integrals(c, &mut |m, row| sum(&mut moment[m][i], row));
        }
        integrals(1.0, &mut |m, row| sum(&mut moment_end[m], row));
        Self { points, moment, moment_end, basis }
    }

    /// Weights of the values at the points that make the value of their polynomial elsewhere, 0..1 inside the element.
    pub fn weights_at(&self, share: f64) -> [f64; P] {
        self.basis.at(share)
    }
}

/// The Lagrange polynomials on the points, all at once.
#[derive(Debug, Clone)]
struct Lagrange<const P: usize> {
    points: [f64; P],
    /// Over the product of the distances of each point from the others.
    inverse: [f64; P],
}

impl<const P: usize> Lagrange<P> {
    fn new(points: [f64; P]) -> Self {
        let distances = |j: usize| -> f64 { (0..P).filter(|&k| k != j).map(|k| points[j] - points[k]).product() };
        Self { points, inverse: std::array::from_fn(|j| 1.0 / distances(j)) }
    }

    /// l_j(x): products of the distances to the points before and after the j-th.
    fn at(&self, x: f64) -> [f64; P] {
        let mut values = self.inverse;
        let (mut before, mut after) = (1.0, 1.0);
        for j in 0..P {
            values[j] *= before;
            before *= x - self.points[j];
            values[P - 1 - j] *= after;
            after *= x - self.points[P - 1 - j];
        }
        values
    }
}

impl<const P: usize> Default for Rule<P> {
    fn default() -> Self {
        Self::new()
    }
}

/// A square matrix.
pub type Matrix<const N: usize> = [[f64; N]; N];

/// Matrix times vector.
#[inline]
pub fn times<const N: usize>(a: &Matrix<N>, v: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| {
        let mut sum = 0.0;
        for k in 0..N {
            sum += a[i][k] * v[k];
        }
        sum
    })
}

/// Matrix times matrix.
pub fn product<const N: usize>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let mut sum = 0.0;
            for k in 0..N {
                sum += a[i][k] * b[k][j];
            }
            sum
        })
    })
}

/// Largest row sum.
pub fn norm<const N: usize>(a: &Matrix<N>) -> f64 {
    a.iter().map(|row| row.iter().map(|x| x.abs()).sum()).fold(0.0, f64::max)
}

/// exp(A t): Taylor series of A t/2^s with norm below 1, squared s times. Relative error some units of the last
/// place times 2^s for oscillating systems.
pub fn exponential<const N: usize>(a: &Matrix<N>, t: f64) -> Matrix<N> {
    let (mut halvings, mut scale) = (0, t);
    while norm(a) * scale.abs() > 1.0 && halvings < 60 {
        scale *= 0.5;
        halvings += 1;
    }
    let mut term: Matrix<N> = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    let mut sum = term;
    for m in 1..=20 {
        term = product(&term, a);
        for i in 0..N {
            for j in 0..N {
                term[i][j] *= scale / f64::from(m);
                sum[i][j] += term[i][j];
            }
        }
    }
    for _ in 0..halvings {
        sum = product(&sum, &sum);
    }
    sum
}

/// The linear system q' = A q + b F over an element of length h, with F a polynomial on the Gauss points; x = q_0.
#[derive(Debug, Clone)]
pub struct Propagator<const N: usize, const P: usize> {
    /// exp(A h).
    pub whole: Matrix<N>,
    /// Row i: first row of exp(A c_i h).
    pub at_points: [[f64; N]; P],
    /// x at point i by a force 1 at point j.
    pub points_by_force: [[f64; P]; P],
    /// q at the end by a force 1 at point j, transposed: one row per point.
    pub end_by_force: [[f64; N]; P],
}

impl<const N: usize, const P: usize> Propagator<N, P> {
    /// For an element of length `h`. norm(A) h is to be 8 at most.
    pub fn new(rule: &Rule<P>, a: &Matrix<N>, b: &[f64; N], h: f64) -> Self {
        let mut at_points = [[0.0; N]; P];
        let mut points_by_force = [[0.0; P]; P];
        let mut end_by_force = [[0.0; N]; P];
        // A^m b h^(m+1) and e_0 A^m h^m/m!.
        let mut force: [f64; N] = std::array::from_fn(|i| b[i] * h);
        let mut row: [f64; N] = std::array::from_fn(|i| f64::from(u8::from(i == 0)));
        let mut powers = [1.0; P];
        let mut fall = 1.0;
        let small = 1e-18 * (b.iter().map(|x| x.abs()).fold(0.0, f64::max) * h);
        for m in 0..TERMS {
            for i in 0..P {
                for k in 0..N {
                    at_points[i][k] += powers[i] * row[k];
                }
                powers[i] *= rule.points[i];
                #[allow(clippy::needless_range_loop)] // indices as in the formula
                for j in 0..P {
                    points_by_force[i][j] += force[0] * rule.moment[m][i][j];
                }
                for k in 0..N {
                    end_by_force[i][k] += force[k] * rule.moment_end[m][i];
                }
            }
            force = times(a, &force);
            row = std::array::from_fn(|j| {
                let mut sum = 0.0;
                for k in 0..N {
                    sum += row[k] * a[k][j];
                }
                sum * h / (m + 1) as f64
            });
            for value in &mut force {
                *value *= h;
            }
            // Moments fall as 1/(m+1)!.
            let left = force.iter().map(|x| x.abs()).fold(0.0, f64::max);
            fall *= (m + 1) as f64;
            if left / fall < small && row.iter().all(|x| x.abs() < 1e-18) {
                break;
            }
        }
        Self { whole: exponential(a, h), at_points, points_by_force, end_by_force }
    }
}
