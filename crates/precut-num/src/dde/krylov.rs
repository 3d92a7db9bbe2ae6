//! The eigenvalue of largest modulus of a map that can only be applied.
//!
//! Arnoldi's method; where a space of 64 vectors does not suffice (many oscillations to a period: dozens of complex pairs of
//! nearly one modulus) it is restarted with the Ritz vectors of largest modulus (thick restart, Wu and Simon 2000; Stewart's
//! Krylov-Schur decomposition, 2001, with any orthonormal basis of the kept invariant subspace in place of Schur vectors).

use std::convert::Infallible;

use nalgebra::{Complex, DMatrix, DVector};

/// Largest Krylov space before a restart.
const LARGEST: usize = 64;
/// Vectors kept over a restart, and how often it is restarted at most.
const KEPT: usize = 24;
const RESTARTS: u32 = 40;
/// Steps between two tests after a restart: a test there is a dense eigenvalue problem.
const TEST_EVERY: usize = 8;
/// A direction that is so far contained in those kept already is left out.
const CONTAINED: f64 = 1e-8;

/// An eigenvalue and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eigenvalue {
    /// Real part.
    pub re: f64,
    /// Imaginary part; of a conjugate pair the positive one.
    pub im: f64,
    /// Residual of the eigenpair over the modulus.
    pub residual: f64,
}

impl Eigenvalue {
    /// Modulus.
    pub fn modulus(&self) -> f64 {
        self.re.hypot(self.im)
    }
}

/// The eigenvalue of largest modulus of `apply`, by Arnoldi's method after `power_steps` plain applications, until the
/// residual is below `tolerance` of the modulus (and the modulus settled in two successive tests).
///
/// Deterministic: the start vector is a fixed pseudo-random sequence. When a Krylov space of 64 vectors does
/// not suffice, it is restarted from its leading Ritz vectors, 40 times at most; the residual says how far it got. The zero
/// map gives 0.
pub fn largest(dimension: usize, power_steps: usize, tolerance: f64, mut apply: impl FnMut(&mut [f64])) -> Eigenvalue {
    let apply = |vector: &mut [f64]| {
        apply(vector);
        Ok::<(), Infallible>(())
    };
    match largest_paced(dimension, power_steps, tolerance, apply, |_| Ok(())) {
        Ok(found) => found,
        Err(never) => match never {},
    }
}

/// [`largest`] of a map that may fail, telling `work` how many multiplications it has done beside those of the map: it ends
/// with the first error of either.
pub fn largest_paced<E>(
    dimension: usize,
    power_steps: usize,
    tolerance: f64,
    apply: impl FnMut(&mut [f64]) -> Result<(), E>,
    work: impl FnMut(usize) -> Result<(), E>,
) -> Result<Eigenvalue, E> {
    Ok(search(dimension, power_steps, tolerance, apply, work)?.0)
}

/// [`largest_paced`] with real and imaginary part of its eigenvector; no parts where there is none to be had.
#[allow(clippy::type_complexity)]
pub fn largest_pair_paced<E>(
    dimension: usize,
    power_steps: usize,
    tolerance: f64,
    apply: impl FnMut(&mut [f64]) -> Result<(), E>,
    work: impl FnMut(usize) -> Result<(), E>,
) -> Result<(Eigenvalue, Option<(Vec<f64>, Vec<f64>)>), E> {
    let (found, space) = search(dimension, power_steps, tolerance, apply, work)?;
    let vector = space.and_then(|space| space.vector(&found));
    Ok((found, vector))
}

/// The largest eigenvalue and the space in which it was found; none where the map comes to nothing.
fn search<E>(
    dimension: usize,
    power_steps: usize,
    tolerance: f64,
    mut apply: impl FnMut(&mut [f64]) -> Result<(), E>,
    mut work: impl FnMut(usize) -> Result<(), E>,
) -> Result<(Eigenvalue, Option<Krylov>), E> {
    let mut start = start_vector(dimension);
    for _ in 0..power_steps {
        apply(&mut start)?;
        if normalise(&mut start) <= 0.0 {
            return Ok((Eigenvalue { re: 0.0, im: 0.0, residual: 0.0 }, None));
        }
    }
    let mut space = Krylov::new(&start);
    let mut found = space.extend(tolerance, &mut apply, &mut work)?;
    for _ in 0..RESTARTS {
        if found.residual <= tolerance {
            break;
        }
        // Where the kept vectors are no longer what they were taken for, it begins again with the best of them.
        if !space.sound || !space.restart(&mut work)? {
            space = Krylov::new(&space.leader);
        }
        found = space.extend(tolerance, &mut apply, &mut work)?;
        space.verify(&mut found, &mut apply)?;
    }
    Ok((found, Some(space)))
}

/// A fixed sequence between -1 and 1 (a linear congruential generator), normalised.
fn start_vector(dimension: usize) -> Vec<f64> {
    let mut seed: u64 = 0x2545_f491_4f6c_dd1d;
    let mut vector: Vec<f64> = (0..dimension)
        .map(|_| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        })
        .collect();
    normalise(&mut vector);
    vector
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums side by side: the compiler may not reorder one.
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a4.zip(b4) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Divides by the length and returns it; a vector of length 0 (or not finite) is left alone.
fn normalise(vector: &mut [f64]) -> f64 {
    let length = dot(vector, vector).sqrt();
    if length > 0.0 && length.is_finite() {
        for value in vector.iter_mut() {
            *value /= length;
        }
        length
    } else {
        0.0
    }
}

/// A Krylov decomposition A V = V T + v b': V has orthonormal columns, v is the next vector. Without a restart T is the
/// Hessenberg matrix of Arnoldi's method and b' has its last entry alone; after one the leading block of T is full.
struct Krylov {
    basis: Vec<Vec<f64>>,
    /// T and, in the row below it, b'; column by column.
    projected: Vec<f64>,
    /// Vectors kept over the last restart.
    kept: usize,
    /// Columns of T.
    size: usize,
    /// The best Ritz vector (its real part) when it was last looked at, and whether its residual is what T says of it.
    leader: Vec<f64>,
    sound: bool,
}

impl Krylov {
    fn new(start: &[f64]) -> Self {
        let vectors = LARGEST.min(start.len()) + 1;
        let mut basis = vec![vec![0.0; start.len()]; vectors];
        basis[0].copy_from_slice(start);
        let projected = vec![0.0; vectors * vectors];
        Self { basis, projected, kept: 0, size: 0, leader: start.to_vec(), sound: true }
    }

    /// Adds vectors until the largest Ritz value has converged or the space is full.
    fn extend<E>(
        &mut self,
        tolerance: f64,
        apply: &mut impl FnMut(&mut [f64]) -> Result<(), E>,
        work: &mut impl FnMut(usize) -> Result<(), E>,
    ) -> Result<Eigenvalue, E> {
        let dimension = self.basis[0].len();
        let limit = LARGEST.min(dimension);
        let ld = self.basis.len();
        let mut last = Eigenvalue { re: 0.0, im: 0.0, residual: 1.0 };
        for k in self.kept..limit {
            let (known, rest) = self.basis.split_at_mut(k + 1);
            let next = &mut rest[0];
            next.copy_from_slice(&known[k]);
            apply(next)?;
            let before = dot(next, next).sqrt();
            for (i, v) in known.iter().enumerate() {
                work(2 * dimension)?;
                let h = dot(v, next);
                self.projected[k * ld + i] = h;
                subtract(next, h, v);
            }
            // A second pass where most of the vector was taken away keeps the basis orthogonal to round-off.
            if dot(next, next).sqrt() < 0.7 * before {
                for (i, v) in known.iter().enumerate() {
                    work(2 * dimension)?;
                    let h = dot(v, next);
                    self.projected[k * ld + i] += h;
                    subtract(next, h, v);
                }
            }
            let mut below = dot(next, next).sqrt();
            if below <= 1e-14 * before || k + 1 == dimension {
                below = 0.0;
            } else {
                normalise(next);
            }
            self.projected[k * ld + k + 1] = below;
            self.size = k + 1;
            let tested =
                if self.kept > 0 { self.size.is_multiple_of(TEST_EVERY) } else { self.size >= 5 && self.size % 2 == 1 };
            if below <= 0.0 || tested || self.size == limit {
                // An eigenvalue problem of so many rows.
                work(10 * self.size.pow(3))?;
                let found = self.ritz(below);
                let settled =
                    (found.modulus() - last.modulus()).abs() <= tolerance.sqrt().max(tolerance) * found.modulus();
                if below <= 0.0 || (found.residual <= tolerance && settled) || self.size == limit {
                    return Ok(found);
                }
                last = found;
            }
        }
        Ok(last)
    }

    /// The largest Ritz value and the residual of its pair over its modulus.
    fn ritz(&self, below: f64) -> Eigenvalue {
        if self.kept == 0 {
            return ritz(&self.projected, self.basis.len(), self.size, below);
        }
        let square = self.square();
        let Some(&(re, im)) = by_modulus(&square).first() else {
            return Eigenvalue { re: 0.0, im: 0.0, residual: 1.0 };
        };
        let modulus = f64::hypot(re, im);
        if below <= 0.0 || modulus <= 0.0 {
            return Eigenvalue { re, im, residual: 0.0 };
        }
        let share = ritz_vector(&square, re, im).map_or(1.0, |y| y[self.size - 1].norm());
        Eigenvalue { re, im, residual: below * share / modulus }
    }

    /// T.
    fn square(&self) -> DMatrix<f64> {
        let ld = self.basis.len();
        // Below the diagonal of columns added by Arnoldi's method stands one entry; the full block has its row of b'.
        DMatrix::from_fn(self.size, self.size, |i, j| {
            let holds = if j < self.kept { i <= self.kept } else { i <= j + 1 };
            if holds { self.projected[j * ld + i] } else { 0.0 }
        })
    }

    /// Real and imaginary part of the Ritz vector.
    fn vector(&self, found: &Eigenvalue) -> Option<(Vec<f64>, Vec<f64>)> {
        let y = ritz_vector(&self.square(), found.re, found.im)?;
        let part = |of: fn(&Complex<f64>) -> f64| -> Vec<f64> {
            let mut sum = vec![0.0; self.basis[0].len()];
            for (vector, factor) in self.basis.iter().zip(y.iter().map(of)) {
                subtract(&mut sum, -factor, vector);
            }
            sum
        };
        Some((part(|c| c.re), part(|c| c.im)))
    }

    /// Puts in place of the residual that of the vector itself, by applying the map to it. Kept Ritz vectors of a map that is
    /// far from normal are nearly dependent, and T is then not what the map does to them.
    fn verify<E>(
        &mut self,
        found: &mut Eigenvalue,
        apply: &mut impl FnMut(&mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let Some((re, im)) = self.vector(found) else { return Ok(()) };
        let (mut moved_re, mut moved_im) = (re.clone(), im.clone());
        apply(&mut moved_re)?;
        apply(&mut moved_im)?;
        for p in 0..re.len() {
            moved_re[p] -= found.re * re[p] - found.im * im[p];
            moved_im[p] -= found.re * im[p] + found.im * re[p];
        }
        let residual = (dot(&moved_re, &moved_re) + dot(&moved_im, &moved_im)).sqrt() / found.modulus();
        // Round-off of a product of some dozen elements.
        self.sound = residual <= 2.0 * found.residual + 1e-12;
        if residual.is_finite() {
            found.residual = found.residual.max(residual);
        }
        self.leader = re;
        normalise(&mut self.leader);
        Ok(())
    }

    /// Keeps the Ritz vectors of largest modulus and the next vector; `false` where there is nothing to gain.
    fn restart<E>(&mut self, work: &mut impl FnMut(usize) -> Result<(), E>) -> Result<bool, E> {
        let (size, ld) = (self.size, self.basis.len());
        if size + 1 > ld || size <= KEPT {
            return Ok(false);
        }
        let square = self.square();
        let below = self.projected[(size - 1) * ld + size];
        let mut kept: Vec<DVector<f64>> = Vec::with_capacity(KEPT + 1);
        for (re, im) in by_modulus(&square) {
            if kept.len() >= KEPT {
                break;
            }
            let Some(y) = ritz_vector(&square, re, im) else { continue };
            // Real and imaginary part of a vector of a pair span what belongs to both of it.
            for part in [y.map(|c| c.re), y.map(|c| c.im)] {
                let mut rest = part;
                for _ in 0..2 {
                    for known in &kept {
                        let h = known.dot(&rest);
                        rest.axpy(-h, known, 1.0);
                    }
                }
                let length = rest.norm();
                if length > CONTAINED {
                    kept.push(rest / length);
                }
            }
        }
        if kept.is_empty() || kept.len() + 1 >= size {
            return Ok(false);
        }
        let q = DMatrix::from_columns(&kept);
        let inside = q.transpose() * &square * &q;
        let count = kept.len();
        let dimension = self.basis[0].len();
        let mut row = vec![0.0; count];
        for place in 0..dimension {
            work(size * count)?;
            row.fill(0.0);
            for (i, vector) in self.basis[..size].iter().enumerate() {
                for (j, sum) in row.iter_mut().enumerate() {
                    *sum += vector[place] * q[(i, j)];
                }
            }
            for (j, sum) in row.iter().enumerate() {
                self.basis[j][place] = *sum;
            }
        }
        self.basis.swap(count, size);
        self.projected.fill(0.0);
        for j in 0..count {
            for i in 0..count {
                self.projected[j * ld + i] = inside[(i, j)];
            }
            self.projected[j * ld + count] = below * q[(size - 1, j)];
        }
        (self.kept, self.size) = (count, count);
        Ok(true)
    }
}

/// Eigenvalues by falling modulus, of every pair the one with the positive imaginary part.
fn by_modulus(square: &DMatrix<f64>) -> Vec<(f64, f64)> {
    let n = square.nrows();
    let hessenberg = square.clone().hessenberg().unpack_h();
    let mut rows: Vec<f64> = (0..n * n).map(|at| hessenberg[(at / n, at % n)]).collect();
    let mut values: Vec<(f64, f64)> =
        hessenberg_eigenvalues(&mut rows, n).into_iter().filter(|(_, im)| *im >= 0.0).collect();
    values.sort_by(|a, b| f64::hypot(b.0, b.1).total_cmp(&f64::hypot(a.0, a.1)).then(a.1.total_cmp(&b.1)));
    values
}

/// The eigenvector of unit length by inverse iteration, next to an eigenvalue that is known to round-off.
fn ritz_vector(square: &DMatrix<f64>, re: f64, im: f64) -> Option<DVector<Complex<f64>>> {
    let n = square.nrows();
    // A hair beside it: the matrix is then as good as singular, not singular.
    let shift = Complex::new(re, im) * (1.0 + 1e-13);
    let mut shifted = square.map(|value| Complex::new(value, 0.0));
    for i in 0..n {
        shifted[(i, i)] -= shift;
    }
    let factors = shifted.lu();
    let mut y = DVector::from_element(n, Complex::new(1.0, 0.0));
    for _ in 0..3 {
        y = factors.solve(&y)?;
        let length = y.norm();
        if !length.is_finite() || length <= 0.0 {
            return None;
        }
        y.unscale_mut(length);
    }
    Some(y)
}

fn subtract(from: &mut [f64], factor: f64, vector: &[f64]) {
    for (x, v) in from.iter_mut().zip(vector) {
        *x -= factor * v;
    }
}

/// The largest Ritz value of the leading Hessenberg matrix and the residual of its pair over its modulus.
fn ritz(hessenberg: &[f64], ld: usize, size: usize, below: f64) -> Eigenvalue {
    let mut matrix = vec![0.0; size * size];
    for j in 0..size {
        for i in 0..size.min(j + 2) {
            matrix[i * size + j] = hessenberg[j * ld + i];
        }
    }
    let values = hessenberg_eigenvalues(&mut matrix, size);
    let mut best = (0.0, 0.0);
    for (re, im) in values {
        if f64::hypot(re, im) > f64::hypot(best.0, best.1) {
            best = (re, im.abs());
        }
    }
    let modulus = f64::hypot(best.0, best.1);
    if below <= 0.0 || modulus <= 0.0 {
        return Eigenvalue { re: best.0, im: best.1, residual: 0.0 };
    }
    let share = last_component(hessenberg, ld, size, best);
    Eigenvalue { re: best.0, im: best.1, residual: below * share / modulus }
}

/// Modulus of the last component of the normalised eigenvector of a Hessenberg matrix: from the bottom row upward.
fn last_component(hessenberg: &[f64], ld: usize, size: usize, (re, im): (f64, f64)) -> f64 {
    let h = |i: usize, j: usize| hessenberg[j * ld + i];
    let mut y = vec![(0.0, 0.0); size];
    y[size - 1] = (1.0, 0.0);
    let mut square = 1.0;
    for row in (1..size).rev() {
        // (H - theta) y = 0 in this row gives the component before.
        let (mut sum_re, mut sum_im) = (-re * y[row].0 + im * y[row].1, -re * y[row].1 - im * y[row].0);
        #[allow(clippy::needless_range_loop)] // indices as in the formula
        for j in row..size {
            sum_re += h(row, j) * y[j].0;
            sum_im += h(row, j) * y[j].1;
        }
        let sub = h(row, row - 1);
        y[row - 1] = (-sum_re / sub, -sum_im / sub);
        square += y[row - 1].0 * y[row - 1].0 + y[row - 1].1 * y[row - 1].1;
    }
    if square.is_finite() { 1.0 / square.sqrt() } else { 0.0 }
}

/// Eigenvalues of a real upper Hessenberg matrix (row-major, destroyed) by the implicitly double-shifted QR method.
pub(super) fn hessenberg_eigenvalues(a: &mut [f64], n: usize) -> Vec<(f64, f64)> {
    let mut values = Vec::with_capacity(n);
    let mut high = n;
    let mut steps = 0;
    while high > 0 {
        let at = |i: usize, j: usize| i * n + j;
        // Start of the unreduced block that ends at `high`.
        let mut low = high - 1;
        while low > 0 {
            let scale = a[at(low, low)].abs() + a[at(low - 1, low - 1)].abs();
            if a[at(low, low - 1)].abs() <= f64::EPSILON * scale {
                a[at(low, low - 1)] = 0.0;
                break;
            }
            low -= 1;
        }
        if low + 1 == high {
            values.push((a[at(low, low)], 0.0));
            high -= 1;
            steps = 0;
            continue;
        }
        if low + 2 == high || steps > 120 {
            // After so many steps without deflation the last two are taken as they stand; the residual tells.
            let (p, q) = (high - 2, high - 1);
            values.extend(two(a[at(p, p)], a[at(p, q)], a[at(q, p)], a[at(q, q)]));
            high -= 2;
            steps = 0;
            continue;
        }
        steps += 1;
        francis(a, n, low, high, steps % 11 == 10);
    }
    values
}

/// Eigenvalues of a 2 x 2 matrix.
fn two(a: f64, b: f64, c: f64, d: f64) -> [(f64, f64); 2] {
    let half = 0.5 * (a - d);
    let middle = 0.5 * (a + d);
    let square = half * half + b * c;
    if square >= 0.0 {
        let root = half + if half >= 0.0 { square.sqrt() } else { -square.sqrt() };
        // The larger by sum, the smaller by product: no cancellation.
        let first = d + root;
        let second = if root.abs() > 0.0 { d - b * c / root } else { d };
        [(first, 0.0), (second, 0.0)]
    } else {
        let im = (-square).sqrt();
        [(middle, im), (middle, -im)]
    }
}

/// One double-shift QR step on the block low..high of size 3 at least.
fn francis(a: &mut [f64], n: usize, low: usize, high: usize, exceptional: bool) {
    let at = |i: usize, j: usize| i * n + j;
    let (p, q) = (high - 2, high - 1);
    let (mut sum, mut product) = (a[at(p, p)] + a[at(q, q)], a[at(p, p)] * a[at(q, q)] - a[at(p, q)] * a[at(q, p)]);
    if exceptional {
        let s = a[at(q, p)].abs() + a[at(p, p - 1)].abs();
        (sum, product) = (1.5 * s, s * s);
    }
    let (a00, a01, a10, a11) = (a[at(low, low)], a[at(low, low + 1)], a[at(low + 1, low)], a[at(low + 1, low + 1)]);
    let mut x = a00 * a00 + a01 * a10 - sum * a00 + product;
    let mut y = a10 * (a00 + a11 - sum);
    let mut z = a10 * a[at(low + 2, low + 1)];
    for k in low..high - 1 {
        let three = k + 2 < high;
        if k > low {
            x = a[at(k, k - 1)];
            y = a[at(k + 1, k - 1)];
            z = if three { a[at(k + 2, k - 1)] } else { 0.0 };
        } else if !three {
            z = 0.0;
        }
        // Householder vector of (x, y, z).
        let length = (x * x + y * y + z * z).sqrt();
        if length <= 0.0 {
            continue;
        }
        let alpha = if x > 0.0 { -length } else { length };
        let (v0, v1, v2) = (x - alpha, y, z);
        let beta = 2.0 / (v0 * v0 + v1 * v1 + v2 * v2);
        let first = if k > low { k - 1 } else { low };
        for j in first..high {
            let mut s = v0 * a[at(k, j)] + v1 * a[at(k + 1, j)];
            if three {
                s += v2 * a[at(k + 2, j)];
            }
            s *= beta;
            a[at(k, j)] -= s * v0;
            a[at(k + 1, j)] -= s * v1;
            if three {
                a[at(k + 2, j)] -= s * v2;
            }
        }
        for i in low..high.min(k + 4) {
            let mut s = v0 * a[at(i, k)] + v1 * a[at(i, k + 1)];
            if three {
                s += v2 * a[at(i, k + 2)];
            }
            s *= beta;
            a[at(i, k)] -= s * v0;
            a[at(i, k + 1)] -= s * v1;
            if three {
                a[at(i, k + 2)] -= s * v2;
            }
        }
    }
    // What the reflections left below the subdiagonal is zero.
    for j in low..high {
        for i in j + 2..high {
            a[at(i, j)] = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A companion matrix: its eigenvalues are the roots of a polynomial that is written down by its roots.
    #[test]
    fn eigenvalues_of_a_companion_matrix_are_its_roots() {
        // (x^2 - 2 x + 5)(x + 3)(x - 0.5)(x^2 + 0.81), roots 1 +- 2i, -3, 0.5, +-0.9i.
        let factors: [&[f64]; 4] = [&[5.0, -2.0, 1.0], &[3.0, 1.0], &[-0.5, 1.0], &[0.81, 0.0, 1.0]];
        let mut polynomial = vec![1.0];
        for factor in factors {
            let mut next = vec![0.0; polynomial.len() + factor.len() - 1];
            for (i, a) in polynomial.iter().enumerate() {
                for (j, b) in factor.iter().enumerate() {
                    next[i + j] += a * b;
                }
            }
            polynomial = next;
        }
        let n = polynomial.len() - 1;
        let mut matrix = vec![0.0; n * n];
        for j in 0..n {
            matrix[j] = -polynomial[n - 1 - j];
        }
        for i in 1..n {
            matrix[i * n + i - 1] = 1.0;
        }
        let mut found = hessenberg_eigenvalues(&mut matrix, n);
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let expected = [(-3.0, 0.0), (0.0, -0.9), (0.0, 0.9), (0.5, 0.0), (1.0, -2.0), (1.0, 2.0)];
        for (f, e) in found.iter().zip(expected) {
            // Conditioned to some 1e2 units of the last place.
            assert!((f.0 - e.0).abs() < 1e-12 && (f.1 - e.1).abs() < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn the_largest_of_many_rotations_is_found() {
        // Block diagonal rotations of slightly different modulus: the hard case of close complex pairs. Inside the largest
        // space, and where it is too small for so slow a decay and has to be restarted.
        for (count, apart) in [(24, 0.002), (40, 0.002), (60, 0.0005), (120, 0.002), (300, 0.002)] {
            let blocks: Vec<(f64, f64)> =
                (0..count).map(|k| (0.9 - apart * f64::from(k), 0.1 + 0.07 * f64::from(k))).collect();
            let found = largest(2 * blocks.len(), 12, 1e-9, move |v| {
                for (k, (r, angle)) in blocks.iter().enumerate() {
                    let (x, y) = (v[2 * k], v[2 * k + 1]);
                    (v[2 * k], v[2 * k + 1]) =
                        (r * (angle.cos() * x - angle.sin() * y), r * (angle.sin() * x + angle.cos() * y));
                }
            });
            assert!(found.residual <= 1e-9, "{count}: {found:?}");
            // The map is normal: an eigenvalue lies within the residual.
            assert!((found.modulus() - 0.9).abs() < 1e-8, "{count}: {found:?}");
            assert!((found.im.atan2(found.re) - 0.1).abs() < 1e-7, "{count}: {found:?}");
        }
    }

    fn sure<T>(result: Result<T, Infallible>) -> T {
        result.unwrap_or_else(|never| match never {})
    }

    /// A bidiagonal map is far from normal. The residual is always that of the vector, and where the eigenvalues can be told
    /// from what round-off makes of them the largest is found.
    #[test]
    fn a_map_far_from_normal_has_an_honest_residual() {
        let map = |coupling: f64| {
            move |v: &mut [f64]| {
                for i in 0..v.len() {
                    let next = v.get(i + 1).map_or(0.0, |next| coupling * next);
                    v[i] = (0.95 - 0.004 * i as f64) * v[i] + next;
                }
            }
        };
        // Neighbours 0.004 apart, coupled by as much: condition of the largest eigenvalue about the sum of 1/k!.
        let found = largest(150, 8, 1e-9, map(0.004));
        assert!(found.residual <= 1e-9 && (found.modulus() - 0.95).abs() < 1e-7, "{found:?}");
        // Coupled 25 times as strongly it has pseudo-eigenvalues all around: T alone would call them converged.
        let map = map(0.1);
        let mut apply = |v: &mut [f64]| {
            map(v);
            Ok(())
        };
        let mut space = Krylov::new(&start_vector(150));
        let mut found = sure(space.extend(1e-9, &mut apply, &mut |_| Ok(())));
        for _ in 0..4 {
            let told = found;
            sure(space.verify(&mut found, &mut apply));
            assert!(space.sound || found.residual > told.residual, "{told:?} {found:?}");
            if !sure(space.restart(&mut |_| Ok(()))) {
                break;
            }
            found = sure(space.extend(1e-9, &mut apply, &mut |_| Ok(())));
        }
    }

    #[test]
    fn an_error_of_the_map_or_of_who_is_told_of_the_work_ends_it() {
        let mut left = 20;
        // All of its eigenvalues have one modulus: it would go on.
        let apply = |v: &mut [f64]| {
            v.rotate_right(1);
            left -= 1;
            if left > 0 { Ok(()) } else { Err("map") }
        };
        assert_eq!(largest_paced(200, 8, 1e-9, apply, |_| Ok(())), Err("map"));
        let mut done = 0;
        let work = |more| {
            done += more;
            if done < 1_000_000 { Ok(()) } else { Err("work") }
        };
        let slow = |v: &mut [f64]| {
            let last = v.len() - 1;
            v.rotate_right(1);
            v[last] *= 0.5;
            Ok(())
        };
        assert_eq!(largest_paced(2000, 8, 1e-12, slow, work), Err("work"));
        assert!(done < 1_000_000 + 300_000, "{done}");
    }
}
