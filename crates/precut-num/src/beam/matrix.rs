//! Small symmetric matrices and the elimination of the redundants.

/// A pivot below this share of the diagonal entry it came from is rounding: the redundant hangs on supports that are
/// already rigid there, and does nothing.
pub(super) const VANISHING: f64 = 64.0 * f64::EPSILON;

/// A full symmetric matrix.
#[derive(Debug, Clone, Default)]
pub(super) struct Symmetric {
    pub(super) order: usize,
    entries: Vec<f64>,
}

impl Symmetric {
    pub(super) fn zeros(order: usize) -> Self {
        Self { order, entries: vec![0.0; order * order] }
    }

    pub(super) fn clear(&mut self) {
        self.entries.fill(0.0);
    }

    pub(super) fn at(&self, i: usize, j: usize) -> f64 {
        self.entries[i * self.order + j]
    }

    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.entries[i * self.order..(i + 1) * self.order]
    }

    /// Adds to an entry of the upper triangle, `i <= j`.
    pub(super) fn add(&mut self, i: usize, j: usize, value: f64) {
        self.entries[i * self.order + j] += value;
    }

    /// Copies the upper triangle into the lower one.
    pub(super) fn mirror(&mut self) {
        for i in 0..self.order {
            for j in 0..i {
                self.entries[i * self.order + j] = self.entries[j * self.order + i];
            }
        }
    }

    /// Eliminates the unknowns of `which` one after the other (Cholesky): what remains in the other rows is their
    /// matrix with these unknowns in place; the row of each eliminated one is left divided by the root of its pivot.
    /// In `pivots` the inverse root of each pivot, 0 where it vanishes.
    pub(super) fn eliminate(&mut self, which: &[usize], pivots: &mut Vec<f64>) {
        pivots.clear();
        let order = self.order;
        pivots.extend(which.iter().map(|&e| self.at(e, e)));
        for (step, &e) in which.iter().enumerate() {
            let pivot = self.at(e, e);
            let original = pivots[step];
            if pivot <= VANISHING * original {
                pivots[step] = 0.0;
                self.entries[e * order..(e + 1) * order].fill(0.0);
                for i in 0..order {
                    self.entries[i * order + e] = 0.0;
                }
                continue;
            }
            let inverse = 1.0 / pivot.sqrt();
            pivots[step] = inverse;
            for entry in &mut self.entries[e * order..(e + 1) * order] {
                *entry *= inverse;
            }
            for i in 0..order {
                if which[..=step].contains(&i) {
                    continue;
                }
                let factor = self.entries[e * order + i];
                for j in 0..order {
                    let product = factor * self.entries[e * order + j];
                    self.entries[i * order + j] -= product;
                }
            }
        }
    }

    /// After [`Self::eliminate`]: the forces in the eliminated unknowns that a unit load of row `load` raises; each in
    /// the direction of the load.
    pub(super) fn back_substitute(&self, which: &[usize], pivots: &[f64], load: usize) -> Vec<f64> {
        let mut forces = vec![0.0; which.len()];
        for step in (0..which.len()).rev() {
            let row = self.row(which[step]);
            let mut rest = row[load];
            for later in step + 1..which.len() {
                rest -= row[which[later]] * forces[later];
            }
            forces[step] = rest * pivots[step];
        }
        forces
    }

    /// After [`Self::eliminate`]: a further column with the eliminated unknowns in place, as if it had been a column of
    /// the matrix. Of each unknown of `which` the value divided by the root of its pivot is left, and returned.
    pub(super) fn reduce_column(&self, which: &[usize], pivots: &[f64], column: &mut [f64]) -> Vec<f64> {
        let mut eliminated = Vec::with_capacity(which.len());
        for (&e, &inverse) in which.iter().zip(pivots) {
            let value = column[e] * inverse;
            for (entry, factor) in column.iter_mut().zip(self.row(e)) {
                *entry -= factor * value;
            }
            eliminated.push(value);
        }
        eliminated
    }
}
