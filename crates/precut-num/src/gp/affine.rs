//! Sparse affine forms side by side.

/// Affine forms a·y + c in compressed rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Affines {
    start: Vec<u32>,
    index: Vec<u32>,
    coefficient: Vec<f64>,
    constant: Vec<f64>,
}

impl Default for Affines {
    fn default() -> Self {
        Self { start: vec![0], index: Vec::new(), coefficient: Vec::new(), constant: Vec::new() }
    }
}

impl Affines {
    /// None yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// None yet, with room.
    pub fn with_capacity(rows: usize, entries: usize) -> Self {
        let mut start = Vec::with_capacity(rows + 1);
        start.push(0);
        Self {
            start,
            index: Vec::with_capacity(entries),
            coefficient: Vec::with_capacity(entries),
            constant: Vec::with_capacity(rows),
        }
    }

    /// One more form. Entries of coefficient 0 are left out; an index that occurs twice is added up.
    pub fn push(&mut self, entries: &[(usize, f64)], constant: f64) {
        let first = self.index.len();
        for &(index, coefficient) in entries {
            if coefficient == 0.0 {
                continue;
            }
            let index = narrow(index);
            if let Some(at) = self.index[first..].iter().position(|&known| known == index) {
                self.coefficient[first + at] += coefficient;
            } else {
                self.index.push(index);
                self.coefficient.push(coefficient);
            }
        }
        self.start.push(narrow(self.index.len()));
        self.constant.push(constant);
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.constant.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.constant.is_empty()
    }

    /// Entries of a form.
    pub fn entries(&self, row: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.start[row] as usize..self.start[row + 1] as usize;
        self.index[range.clone()].iter().map(|&i| i as usize).zip(self.coefficient[range].iter().copied())
    }

    /// Constant of a form.
    pub fn constant(&self, row: usize) -> f64 {
        self.constant[row]
    }

    /// Adds to the constant of a form.
    pub fn shift(&mut self, row: usize, by: f64) {
        self.constant[row] += by;
    }

    /// a·d of a form.
    pub fn slope(&self, row: usize, d: &[f64]) -> f64 {
        let range = self.start[row] as usize..self.start[row + 1] as usize;
        let mut sum = 0.0;
        for (i, c) in self.index[range.clone()].iter().zip(&self.coefficient[range]) {
            sum += c * d[*i as usize];
        }
        sum
    }

    /// a·y + c of a form.
    pub fn value(&self, row: usize, y: &[f64]) -> f64 {
        self.slope(row, y) + self.constant[row]
    }

    /// ln Σ exp over all forms; of none minus infinity.
    pub fn log_sum_exp(&self, y: &[f64]) -> f64 {
        let values: Vec<f64> = (0..self.len()).map(|row| self.value(row, y)).collect();
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if largest == f64::NEG_INFINITY {
            return largest;
        }
        largest + values.iter().map(|v| (v - largest).exp()).sum::<f64>().ln()
    }

    /// The same forms, each with one more entry.
    #[must_use]
    pub fn with_entry(&self, index: usize, coefficient: f64) -> Self {
        let mut out = Self::with_capacity(self.len(), self.index.len() + self.len());
        let mut entries: Vec<(usize, f64)> = Vec::with_capacity(8);
        for row in 0..self.len() {
            entries.clear();
            entries.extend(self.entries(row));
            entries.push((index, coefficient));
            out.push(&entries, self.constant[row]);
        }
        out
    }

    /// Some of the forms, in the order of `rows`.
    #[must_use]
    pub fn chosen(&self, rows: &[usize]) -> Self {
        let mut out = Self::with_capacity(rows.len(), 3 * rows.len());
        let mut entries: Vec<(usize, f64)> = Vec::with_capacity(8);
        for &row in rows {
            entries.clear();
            entries.extend(self.entries(row));
            out.push(&entries, self.constant[row]);
        }
        out
    }

    /// Some of the forms, in the order of `rows`, over variables that are numbered anew.
    #[must_use]
    pub fn renumbered(&self, rows: impl Iterator<Item = usize>, place: &[usize]) -> Self {
        let mut out = Self::new();
        let mut entries: Vec<(usize, f64)> = Vec::with_capacity(8);
        for row in rows {
            entries.clear();
            entries.extend(self.entries(row).map(|(index, coefficient)| (place[index], coefficient)));
            out.push(&entries, self.constant[row]);
        }
        out
    }
}

fn narrow(index: usize) -> u32 {
    // Programs have some thousand variables; a larger one than 2^32 would not fit into memory.
    u32::try_from(index).unwrap_or(u32::MAX)
}
