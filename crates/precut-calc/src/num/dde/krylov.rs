//! The eigenvalue of largest modulus of a map that can only be applied.

/// Largest Krylov space before a restart.
const LARGEST: usize = 64;

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
/// not suffice, it starts again from the last vector a few times; the residual then says how far it got. The zero
/// map gives 0.
pub fn largest(dimension: usize, power_steps: usize, tolerance: f64, mut apply: impl FnMut(&mut [f64])) -> Eigenvalue {
    let mut start = start_vector(dimension);
    let mut best = Eigenvalue { re: 0.0, im: 0.0, residual: 1.0 };
    let mut workspace = Workspace::new(dimension);
    for round in 0..5 {
        for _ in 0..power_steps * (1 + 2 * round) {
            apply(&mut start);
            if normalise(&mut start) <= 0.0 {
                return Eigenvalue { re: 0.0, im: 0.0, residual: 0.0 };
            }
        }
        let found = workspace.arnoldi(&mut start, tolerance, &mut apply);
        if found.residual < best.residual || round == 0 {
            best = found;
        }
        if best.residual <= tolerance {
            break;
        }
    }
    best
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

struct Workspace {
    basis: Vec<Vec<f64>>,
    /// Column by column.
    hessenberg: Vec<f64>,
}

impl Workspace {
    fn new(dimension: usize) -> Self {
        let vectors = LARGEST.min(dimension) + 1;
        Self { basis: vec![vec![0.0; dimension]; vectors], hessenberg: vec![0.0; vectors * vectors] }
    }

    /// Builds the Krylov space of `start` until its largest Ritz value has converged; leaves the last vector in `start`.
    fn arnoldi(&mut self, start: &mut [f64], tolerance: f64, apply: &mut impl FnMut(&mut [f64])) -> Eigenvalue {
        let dimension = start.len();
        let limit = LARGEST.min(dimension);
        let ld = self.basis.len();
        self.basis[0].copy_from_slice(start);
        let mut last = Eigenvalue { re: 0.0, im: 0.0, residual: 1.0 };
        for k in 0..limit {
            let (known, rest) = self.basis.split_at_mut(k + 1);
            let next = &mut rest[0];
            next.copy_from_slice(&known[k]);
            apply(next);
            let before = dot(next, next).sqrt();
            for (i, v) in known.iter().enumerate() {
                let h = dot(v, next);
                self.hessenberg[k * ld + i] = h;
                subtract(next, h, v);
            }
            // A second pass where most of the vector was taken away keeps the basis orthogonal to round-off.
            if dot(next, next).sqrt() < 0.7 * before {
                for (i, v) in known.iter().enumerate() {
                    let h = dot(v, next);
                    self.hessenberg[k * ld + i] += h;
                    subtract(next, h, v);
                }
            }
            let mut below = dot(next, next).sqrt();
            if below <= 1e-14 * before || k + 1 == dimension {
                below = 0.0;
            } else {
                normalise(next);
            }
            self.hessenberg[k * ld + k + 1] = below;
            let size = k + 1;
            if below <= 0.0 || (size >= 5 && size % 2 == 1) || size == limit {
                let found = ritz(&self.hessenberg, ld, size, below);
                let settled =
                    (found.modulus() - last.modulus()).abs() <= tolerance.sqrt().max(tolerance) * found.modulus();
                if below <= 0.0 || (found.residual <= tolerance && settled) || size == limit {
                    start.copy_from_slice(&self.basis[k]);
                    return found;
                }
                last = found;
            }
        }
        last
    }
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
        // Block diagonal rotations of slightly different modulus: the hard case of close complex pairs.
        let rotations = |count: u32| {
            let blocks: Vec<(f64, f64)> =
                (0..count).map(|k| (0.9 - 0.002 * f64::from(k), 0.1 + 0.07 * f64::from(k))).collect();
            largest(2 * blocks.len(), 12, 1e-9, move |v| {
                for (k, (r, angle)) in blocks.iter().enumerate() {
                    let (x, y) = (v[2 * k], v[2 * k + 1]);
                    (v[2 * k], v[2 * k + 1]) =
                        (r * (angle.cos() * x - angle.sin() * y), r * (angle.sin() * x + angle.cos() * y));
                }
            })
        };
        // Inside the largest space they are found to the tolerance.
        let found = rotations(24);
        assert!((found.modulus() - 0.9).abs() < 1e-8, "{found:?}");
        assert!((found.im.atan2(found.re) - 0.1).abs() < 1e-7, "{found:?}");
        // Where the space is too small for so slow a decay, the residual says so and bounds the error.
        let lost = rotations(40);
        assert!(lost.residual > 1e-9 && (lost.modulus() - 0.9).abs() <= lost.residual, "{lost:?}");
    }
}
