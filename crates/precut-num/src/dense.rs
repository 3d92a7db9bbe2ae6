//! Tall matrices by columns and their orthogonal factorisation (Householder).
//!
//! Least squares never forms A'A: that would halve the digits. Equations of a fit with a condition
//! number k lose about log10 k digits here, 2 log10 k there.

/// A matrix stored column by column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Columns {
    rows: usize,
    data: Vec<f64>,
}

impl Columns {
    /// Zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self { rows, data: vec![0.0; rows * columns] }
    }
    /// Of columns that all have `rows` entries; what is missing is 0, what is too much is cut.
    pub fn of<'a>(rows: usize, columns: impl IntoIterator<Item = &'a [f64]>) -> Self {
        let mut data = Vec::new();
        for (index, column) in columns.into_iter().enumerate() {
            data.extend(column.iter().take(rows));
            data.resize((index + 1) * rows, 0.0);
        }
        Self { rows, data }
    }
    /// Height.
    pub fn rows(&self) -> usize {
        self.rows
    }
    /// Width.
    pub fn count(&self) -> usize {
        self.data.len().checked_div(self.rows).unwrap_or(0)
    }
    /// A column.
    pub fn column(&self, j: usize) -> &[f64] {
        &self.data[j * self.rows..(j + 1) * self.rows]
    }
    /// A column, to write.
    pub fn column_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.data[j * self.rows..(j + 1) * self.rows]
    }
    /// An entry.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.data[j * self.rows + i]
    }
    /// Sets an entry.
    pub fn set(&mut self, i: usize, j: usize, value: f64) {
        self.data[j * self.rows + i] = value;
    }
    /// Appends a column; what is missing is 0.
    pub fn push(&mut self, column: &[f64]) {
        let end = self.data.len() + self.rows;
        self.data.extend(column.iter().take(self.rows));
        self.data.resize(end, 0.0);
    }
    /// A row.
    pub fn row(&self, i: usize) -> Vec<f64> {
        (0..self.count()).map(|j| self.at(i, j)).collect()
    }
    /// The rows of `which`, in that order.
    #[must_use]
    pub fn take_rows(&self, which: &[usize]) -> Self {
        let data = (0..self.count()).flat_map(|j| which.iter().map(move |&i| self.at(i, j))).collect();
        Self { rows: which.len(), data }
    }
    /// The columns of `which`, in that order.
    #[must_use]
    pub fn take_columns(&self, which: &[usize]) -> Self {
        Self { rows: self.rows, data: which.iter().flat_map(|&j| self.column(j)).copied().collect() }
    }
    /// The same with row i multiplied by `factors[i]`.
    #[must_use]
    pub fn scaled_rows(mut self, factors: &[f64]) -> Self {
        for column in self.data.chunks_exact_mut(self.rows.max(1)) {
            for (entry, factor) in column.iter_mut().zip(factors) {
                *entry *= factor;
            }
        }
        self
    }
    /// A x.
    pub fn times(&self, x: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; self.rows];
        for (j, &factor) in x.iter().enumerate().take(self.count()) {
            add_scaled(&mut product, factor, self.column(j));
        }
        product
    }
    /// A' y.
    pub fn transposed_times(&self, y: &[f64]) -> Vec<f64> {
        (0..self.count()).map(|j| dot(self.column(j), y)).collect()
    }
    /// Euclidean lengths of the columns.
    pub fn lengths(&self) -> Vec<f64> {
        (0..self.count()).map(|j| length(self.column(j))).collect()
    }
}

/// Sum of products, in four interleaved parts that are added in a fixed order.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut parts = [0.0; 4];
    let (fours_a, rest_a) = a.as_chunks::<4>();
    let (fours_b, rest_b) = b[..a.len()].as_chunks::<4>();
    for (x, y) in fours_a.iter().zip(fours_b) {
        for k in 0..4 {
            parts[k] += x[k] * y[k];
        }
    }
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(x, y)| x * y).sum();
    (parts[0] + parts[2]) + (parts[1] + parts[3]) + rest
}

/// `y += factor x`.
pub fn add_scaled(y: &mut [f64], factor: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}

/// Euclidean length, without overflow or underflow on the way.
pub fn length(v: &[f64]) -> f64 {
    let squares = dot(v, v);
    if squares.is_finite() && squares > f64::MIN_POSITIVE / f64::EPSILON {
        return squares.sqrt();
    }
    let largest = v.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    largest * v.iter().map(|x| (x / largest) * (x / largest)).sum::<f64>().sqrt()
}

/// A sum that carries its own rounding along (Neumaier): as if in twice the digits, rounded once.
pub fn compensated_sum(terms: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut lost) = (0.0_f64, 0.0);
    for term in terms {
        let next = sum + term;
        lost += if sum.abs() >= term.abs() { (sum - next) + term } else { (term - next) + sum };
        sum = next;
    }
    sum + lost
}

/// A = Q R with reflections; with pivoting A P = Q R, the diagonal of R falling.
#[derive(Debug, Clone)]
pub struct Qr {
    /// Above the diagonal R; on it and below the reflections' vectors.
    factors: Columns,
    /// Diagonal of R.
    diagonal: Vec<f64>,
    /// 2/v'v of each reflection; 0 where there is none.
    weights: Vec<f64>,
    /// Column k of R stands for this column of A.
    order: Vec<usize>,
}

impl Qr {
    /// Without pivoting.
    pub fn new(matrix: Columns) -> Self {
        Self::factorise(matrix, false)
    }

    /// With pivoting: at every step the longest remaining column.
    pub fn pivoted(matrix: Columns) -> Self {
        Self::factorise(matrix, true)
    }

    fn factorise(mut a: Columns, pivoting: bool) -> Self {
        let (rows, count) = (a.rows(), a.count());
        let steps = rows.min(count);
        let mut order: Vec<usize> = (0..count).collect();
        let (mut diagonal, mut weights) = (vec![0.0; count], vec![0.0; count]);
        for k in 0..steps {
            if pivoting {
                let tail = |j: usize| length(&a.column(j)[k..]);
                // The first of equal lengths, so that the order is defined.
                let longest = (k..count).fold((k, -1.0), |best, j| {
                    let now = tail(j);
                    if now > best.1 { (j, now) } else { best }
                });
                a.swap(k, longest.0);
                order.swap(k, longest.0);
            }
            let column = &mut a.column_mut(k)[k..];
            let size = length(column);
            let head = column[0];
            let reflected = if head > 0.0 { -size } else { size };
            diagonal[k] = reflected;
            if size == 0.0 {
                continue;
            }
            column[0] = head - reflected;
            // v'v = -2 reflected v_0
            weights[k] = -1.0 / (reflected * column[0]);
            let (done, rest) = a.data.split_at_mut((k + 1) * rows);
            let v = &done[k * rows + k..];
            for other in rest.chunks_exact_mut(rows) {
                let tail = &mut other[k..];
                let factor = -weights[k] * dot(v, tail);
                add_scaled(tail, factor, v);
            }
        }
        Self { factors: a, diagonal, weights, order }
    }

    /// Number of columns.
    pub fn count(&self) -> usize {
        self.diagonal.len()
    }
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.factors.rows()
    }
    /// Column k of R stands for this column of A.
    pub fn order(&self) -> &[usize] {
        &self.order
    }
    /// Entry of R, `i <= j`.
    pub fn r(&self, i: usize, j: usize) -> f64 {
        if i == j { self.diagonal[i] } else { self.factors.at(i, j) }
    }
    /// How many diagonal entries are above `share` of the largest.
    pub fn rank(&self, share: f64) -> usize {
        let largest = self.diagonal.iter().fold(0.0_f64, |most, d| most.max(d.abs()));
        self.diagonal.iter().filter(|d| d.abs() > share * largest).count()
    }

    /// y becomes Q' y.
    pub fn to_factors(&self, y: &mut [f64]) {
        for k in 0..self.count().min(self.rows()) {
            self.reflect(k, y);
        }
    }

    /// y becomes Q y.
    pub fn from_factors(&self, y: &mut [f64]) {
        for k in (0..self.count().min(self.rows())).rev() {
            self.reflect(k, y);
        }
    }

    fn reflect(&self, k: usize, y: &mut [f64]) {
        if self.weights[k] != 0.0 {
            let v = &self.factors.column(k)[k..];
            let factor = -self.weights[k] * dot(v, &y[k..]);
            add_scaled(&mut y[k..], factor, v);
        }
    }

    /// x of R x = y over the first `y.len()` columns, in the order of R. A zero on the diagonal gives x = 0 there.
    pub fn solve_upper(&self, y: &mut [f64]) {
        for k in (0..y.len()).rev() {
            y[k] = quotient(y[k], self.diagonal[k]);
            let (head, solved) = y.split_at_mut(k);
            add_scaled(head, -solved[0], &self.factors.column(k)[..k]);
        }
    }

    /// x of R' x = y over the first `y.len()` columns, in the order of R.
    pub fn solve_lower(&self, y: &mut [f64]) {
        for k in 0..y.len() {
            let (solved, rest) = y.split_at_mut(k);
            rest[0] = quotient(rest[0] - dot(solved, &self.factors.column(k)[..k]), self.diagonal[k]);
        }
    }

    /// R x, for x in the order of R.
    pub fn times_upper(&self, x: &[f64]) -> Vec<f64> {
        (0..x.len()).map(|i| (i..x.len()).map(|j| self.r(i, j) * x[j]).sum()).collect()
    }

    /// Coefficients of A that come nearest to `y`, in the order of A. Full rank assumed.
    pub fn solve(&self, y: &[f64]) -> Vec<f64> {
        let mut rotated = y.to_vec();
        self.to_factors(&mut rotated);
        rotated.truncate(self.count());
        self.solve_upper(&mut rotated);
        let mut x = vec![0.0; self.count()];
        for (&place, value) in self.order.iter().zip(rotated) {
            x[place] = value;
        }
        x
    }

    /// (A'A)^-1 in the order of A, row by row. Full rank assumed.
    pub fn inverse_gram(&self) -> Columns {
        let count = self.count();
        let mut inverse = Columns::zeros(count, count);
        for k in 0..count {
            // Row k of R^-1 R^-T: solve R' u = e_k, then R x = u.
            let mut x = vec![0.0; count];
            x[k] = 1.0;
            self.solve_lower(&mut x);
            self.solve_upper(&mut x);
            for (i, value) in x.into_iter().enumerate() {
                inverse.set(self.order[i], self.order[k], value);
            }
        }
        inverse
    }

    /// Squared lengths of the rows of Q: the leverages, in [0, 1].
    pub fn leverages(&self) -> Vec<f64> {
        let (rows, count) = (self.rows(), self.count().min(self.rows()));
        let mut sums = vec![0.0; rows];
        for k in 0..count {
            if self.weights[k] == 0.0 {
                continue;
            }
            let mut unit = vec![0.0; rows];
            unit[k] = 1.0;
            self.from_factors(&mut unit);
            for (sum, q) in sums.iter_mut().zip(unit) {
                *sum += q * q;
            }
        }
        sums.iter().map(|h| h.min(1.0)).collect()
    }
}

fn quotient(value: f64, by: f64) -> f64 {
    if by == 0.0 { 0.0 } else { value / by }
}

impl Columns {
    fn swap(&mut self, a: usize, b: usize) {
        if a != b {
            let (low, high) = (a.min(b), a.max(b));
            let (left, right) = self.data.split_at_mut(high * self.rows);
            left[low * self.rows..(low + 1) * self.rows].swap_with_slice(&mut right[..self.rows]);
        }
    }
}

/// Eigenvalues of a symmetric matrix, ascending, with their vectors as columns (Jacobi's rotations: slow for large
/// ones, accurate for all).
pub fn symmetric_eigen(matrix: &Columns) -> (Vec<f64>, Columns) {
    let count = matrix.count();
    let mut a = matrix.clone();
    let mut vectors = Columns::zeros(count, count);
    for k in 0..count {
        vectors.set(k, k, 1.0);
    }
    let size = length(&a.data);
    // Off-diagonal parts shrink quadratically; some 8 sweeps do, 60 are a guard.
    for _ in 0..60 {
        let off: f64 = (0..count).flat_map(|j| (0..j).map(move |i| (i, j))).map(|(i, j)| a.at(i, j).abs()).sum();
        if off <= f64::EPSILON * f64::EPSILON * size {
            break;
        }
        for q in 1..count {
            for p in 0..q {
                rotate(&mut a, &mut vectors, p, q);
            }
        }
    }
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&i, &j| a.at(i, i).total_cmp(&a.at(j, j)));
    (order.iter().map(|&i| a.at(i, i)).collect(), vectors.take_columns(&order))
}

/// Makes the entry (p, q) zero.
fn rotate(a: &mut Columns, vectors: &mut Columns, p: usize, q: usize) {
    let apq = a.at(p, q);
    if apq == 0.0 {
        return;
    }
    let theta = (a.at(q, q) - a.at(p, p)) / (2.0 * apq);
    let t = if theta >= 0.0 { 1.0 } else { -1.0 } / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for k in 0..a.count() {
        let (x, y) = (a.at(k, p), a.at(k, q));
        a.set(k, p, c * x - s * y);
        a.set(k, q, s * x + c * y);
    }
    for k in 0..a.count() {
        let (x, y) = (a.at(p, k), a.at(q, k));
        a.set(p, k, c * x - s * y);
        a.set(q, k, s * x + c * y);
    }
    for k in 0..a.count() {
        let (x, y) = (vectors.at(k, p), vectors.at(k, q));
        vectors.set(k, p, c * x - s * y);
        vectors.set(k, q, s * x + c * y);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Numbers without pattern, repeatable.
    fn noise(index: u32) -> f64 {
        (f64::from(index) * 12.9898).sin() * 43_758.547 % 1.0
    }

    fn matrix(rows: u32, count: u32) -> Columns {
        let columns: Vec<Vec<f64>> =
            (0..count).map(|j| (0..rows).map(|i| noise(i * count + j) * f64::from(1 + 10 * j)).collect()).collect();
        Columns::of(rows as usize, columns.iter().map(Vec::as_slice))
    }

    #[test]
    fn factors_multiply_to_the_matrix() {
        let a = matrix(17, 5);
        for qr in [Qr::new(a.clone()), Qr::pivoted(a.clone())] {
            for (k, &place) in qr.order().iter().enumerate() {
                let mut column: Vec<f64> = (0..17).map(|i| if i <= k { qr.r(i, k) } else { 0.0 }).collect();
                qr.from_factors(&mut column);
                for (got, expected) in column.iter().zip(a.column(place)) {
                    // Rounding of five reflections of numbers up to 50.
                    assert!((got - expected).abs() < 1e-13, "{got} {expected}");
                }
            }
        }
        let qr = Qr::pivoted(a);
        assert!((1..5).all(|k| qr.r(k, k).abs() <= qr.r(k - 1, k - 1).abs() * (1.0 + 1e-12)));
    }

    #[test]
    fn a_solution_of_exact_data_is_exact_and_leverages_sum_to_the_columns() {
        let a = matrix(12, 4);
        let truth = [0.5, -2.0, 3.0, 0.25];
        let qr = Qr::pivoted(a.clone());
        let found = qr.solve(&a.times(&truth));
        assert!(found.iter().zip(truth).all(|(x, t)| (x - t).abs() < 1e-13), "{found:?}");
        assert!((qr.leverages().iter().sum::<f64>() - 4.0).abs() < 1e-12);
        let inverse = qr.inverse_gram();
        for i in 0..4 {
            let column = a.transposed_times(&a.times(inverse.column(i)));
            assert!((0..4).all(|k| (column[k] - f64::from(u8::from(k == i))).abs() < 1e-10));
        }
    }

    #[test]
    fn a_dependent_column_lowers_the_rank() {
        let mut a = matrix(9, 3);
        let sum: Vec<f64> = (0..9).map(|i| a.at(i, 0) - 2.0 * a.at(i, 2)).collect();
        a.push(&sum);
        assert_eq!(Qr::pivoted(a).rank(1e-12), 3);
    }

    #[test]
    fn eigenvalues_of_the_second_difference_are_known() {
        let count = 6_u32;
        let mut a = Columns::zeros(6, 6);
        for k in 0..6 {
            a.set(k, k, 2.0);
            if k > 0 {
                a.set(k, k - 1, -1.0);
                a.set(k - 1, k, -1.0);
            }
        }
        let (values, vectors) = symmetric_eigen(&a);
        for (k, value) in (1..=count).zip(&values) {
            let exact = 2.0 - 2.0 * (std::f64::consts::PI * f64::from(k) / f64::from(count + 1)).cos();
            assert!((value - exact).abs() < 1e-14, "{value} {exact}");
        }
        let image = a.times(vectors.column(0));
        assert!(image.iter().zip(vectors.column(0)).all(|(i, v)| (i - values[0] * v).abs() < 1e-14));
    }

    #[test]
    fn lengths_and_sums_survive_extremes() {
        assert!((length(&[3e200, 4e200]) / 5e200 - 1.0).abs() < 1e-15);
        assert!((length(&[3e-200, 4e-200]) / 5e-200 - 1.0).abs() < 1e-15);
        let sum = compensated_sum([1.0, 1e100, 1.0, -1e100]);
        assert!((sum - 2.0).abs() < 1e-15, "{sum}");
    }
}
