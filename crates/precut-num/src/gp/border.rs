//! A banded symmetric matrix with a border: the chain's block by L D Lᵀ, the small rest by LU.

use super::layout::BAND;

/// The matrix [B R; Rᵀ K] with B banded and positive definite, K small and symmetric, not definite.
#[derive(Debug, Clone, Default)]
pub(super) struct Bordered {
    /// Order of B.
    pub n: usize,
    /// Columns of the border.
    pub m: usize,
    /// Diagonal and `BAND` subdiagonals: `band[i][k]` is B(i, i-k).
    pub band: Vec<[f64; BAND + 1]>,
    /// R by columns.
    pub border: Vec<f64>,
    /// K by rows.
    pub corner: Vec<f64>,
    inverse: Vec<f64>,
    pivots: Vec<usize>,
    solved: Vec<f64>,
    small: Vec<f64>,
}

/// A pivot below this share of its diagonal is a direction in which nothing is determined.
const VANISHED: f64 = 1e-13;

impl Bordered {
    /// Empties the matrix and gives it its size.
    pub(super) fn reset(&mut self, n: usize, m: usize) {
        (self.n, self.m) = (n, m);
        self.band.clear();
        self.band.resize(n, [0.0; BAND + 1]);
        self.border.clear();
        self.border.resize(n * m, 0.0);
        self.corner.clear();
        self.corner.resize(m * m, 0.0);
    }

    /// Factors in place. Returns the smallest pivot of B relative to its diagonal.
    pub(super) fn factor(&mut self) -> f64 {
        let n = self.n;
        self.inverse.clear();
        self.inverse.resize(n, 0.0);
        let mut least = f64::INFINITY;
        for i in 0..n {
            let reach = i.min(BAND);
            let mut row = self.band[i];
            let diagonal = row[0];
            // row[k] holds B(i, i-k); turned into L(i, i-k) D(i-k), then into L.
            for k in (1..=reach).rev() {
                let j = i - k;
                let other = self.band[j];
                let mut sum = row[k];
                for q in 1..=BAND - k {
                    if k + q <= reach {
                        sum -= row[k + q] * other[q];
                    }
                }
                row[k] = sum;
            }
            let mut pivot = diagonal;
            for (k, entry) in row.iter_mut().enumerate().take(reach + 1).skip(1) {
                let lower = *entry * self.inverse[i - k];
                pivot -= *entry * lower;
                *entry = lower;
            }
            let relative = pivot / diagonal;
            least = least.min(if relative.is_nan() { 0.0 } else { relative });
            self.inverse[i] = if pivot > VANISHED * diagonal { 1.0 / pivot } else { 0.0 };
            self.band[i] = row;
        }
        self.factor_border();
        least
    }

    fn factor_border(&mut self) {
        let (n, m) = (self.n, self.m);
        self.solved.clear();
        self.solved.extend_from_slice(&self.border);
        let mut solved = std::mem::take(&mut self.solved);
        for column in solved.chunks_exact_mut(n.max(1)).take(m) {
            self.solve_band(column);
        }
        self.solved = solved;
        for i in 0..m {
            for j in i..m {
                let dot: f64 = self.border[i * n..(i + 1) * n]
                    .iter()
                    .zip(&self.solved[j * n..(j + 1) * n])
                    .map(|(a, b)| a * b)
                    .sum();
                self.corner[i * m + j] -= dot;
                if i != j {
                    self.corner[j * m + i] -= dot;
                }
            }
        }
        self.pivots.clear();
        for k in 0..m {
            let pivot = (k..m)
                .max_by(|&a, &b| self.corner[a * m + k].abs().total_cmp(&self.corner[b * m + k].abs()))
                .unwrap_or(k);
            self.pivots.push(pivot);
            if pivot != k {
                for j in 0..m {
                    self.corner.swap(k * m + j, pivot * m + j);
                }
            }
            let head = self.corner[k * m + k];
            if head == 0.0 {
                continue;
            }
            for i in k + 1..m {
                let factor = self.corner[i * m + k] / head;
                self.corner[i * m + k] = factor;
                for j in k + 1..m {
                    self.corner[i * m + j] -= factor * self.corner[k * m + j];
                }
            }
        }
    }

    fn solve_band(&self, x: &mut [f64]) {
        let n = self.n;
        for i in 0..n {
            let row = &self.band[i];
            let mut sum = x[i];
            for k in 1..=i.min(BAND) {
                sum -= row[k] * x[i - k];
            }
            x[i] = sum;
        }
        for (x, inverse) in x.iter_mut().zip(&self.inverse) {
            *x *= inverse;
        }
        for i in (0..n).rev() {
            let value = x[i];
            for k in 1..=i.min(BAND) {
                x[i - k] -= self.band[i][k] * value;
            }
        }
    }

    /// Solves in place: `x` holds the chain's part, `rest` the border's.
    pub(super) fn solve(&mut self, x: &mut [f64], rest: &mut [f64]) {
        let (n, m) = (self.n, self.m);
        self.solve_band(x);
        let mut small = std::mem::take(&mut self.small);
        small.clear();
        for (c, r) in rest.iter().enumerate() {
            let dot: f64 = self.border[c * n..(c + 1) * n].iter().zip(x.iter()).map(|(a, b)| a * b).sum();
            small.push(r - dot);
        }
        for (k, &pivot) in self.pivots.iter().enumerate() {
            small.swap(k, pivot);
        }
        for k in 0..m {
            let value = small[k];
            for (i, later) in small.iter_mut().enumerate().skip(k + 1) {
                *later -= self.corner[i * m + k] * value;
            }
        }
        for k in (0..m).rev() {
            let mut sum = small[k];
            for (j, later) in small.iter().enumerate().skip(k + 1) {
                sum -= self.corner[k * m + j] * later;
            }
            let head = self.corner[k * m + k];
            small[k] = if head == 0.0 { 0.0 } else { sum / head };
        }
        for (c, q) in small.iter().enumerate() {
            for (x, column) in x.iter_mut().zip(&self.solved[c * n..(c + 1) * n]) {
                *x -= column * q;
            }
        }
        rest.copy_from_slice(&small);
        self.small = small;
    }
}

impl Bordered {
    /// Whether the positive semidefinite matrix is singular, to a pivot of `least` relative to its diagonal. The first
    /// `definite` rows of the corner are variables, the others hold -1 for a rank-one term each.
    pub(super) fn singular(&mut self, definite: usize, least: f64) -> bool {
        // Few variables stand in the corner; with it empty the band decides.
        if self.m == 0 {
            return self.factor() < least;
        }
        // A dense elimination of the whole would be O(n³); instead the chain's null space must be met by the border, and
        // a tiny ridge on the chain makes the Schur complement show it.
        let ridge = least;
        for row in &mut self.band {
            row[0] += ridge;
        }
        let diagonal: Vec<f64> = (0..definite).map(|i| self.corner[i * self.m + i]).collect();
        let weak_before = self.factor() < 10.0 * least;
        let weak_corner = (0..definite).any(|i| {
            let pivot = self.corner[i * self.m + i].abs();
            pivot < least * diagonal[i].max(1.0)
        });
        weak_before || weak_corner
    }
}
