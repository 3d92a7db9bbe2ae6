//! Columns without their zeros: what acts on the rows of one run, or of one level, and on no others.

use std::cmp::Ordering;

/// A column of which only what is not 0 is kept.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sparse {
    /// Rows that are not 0, ascending.
    rows: Vec<usize>,
    values: Vec<f64>,
    /// Number of rows with those that are 0.
    length: usize,
}

impl Sparse {
    /// Of rows in ascending order.
    pub(in crate::diagnosis) fn new(length: usize, entries: impl IntoIterator<Item = (usize, f64)>) -> Self {
        let (rows, values) = entries.into_iter().filter(|(_, value)| *value != 0.0).unzip();
        Self { rows, values, length }
    }

    pub(crate) fn of(dense: &[f64]) -> Self {
        Self::new(dense.len(), dense.iter().copied().enumerate())
    }

    pub(in crate::diagnosis) fn dense(&self) -> Vec<f64> {
        let mut dense = vec![0.0; self.length];
        self.entries().for_each(|(row, value)| dense[row] = value);
        dense
    }

    pub(in crate::diagnosis) fn entries(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.rows.iter().copied().zip(self.values.iter().copied())
    }

    /// Number of rows with those that are 0.
    pub(in crate::diagnosis) fn length(&self) -> usize {
        self.length
    }

    /// Rows that are not 0.
    pub(in crate::diagnosis) fn rows(&self) -> &[usize] {
        &self.rows
    }

    /// The value of a row.
    pub(in crate::diagnosis) fn at(&self, row: usize) -> f64 {
        self.rows.binary_search(&row).map_or(0.0, |place| self.values[place])
    }

    /// The same of the rows that are kept.
    pub(in crate::diagnosis) fn of_rows(&self, keep: &[bool]) -> Self {
        Self::new(self.length, self.entries().filter(|(row, _)| keep[*row]))
    }

    /// Adds it, times a factor.
    pub(crate) fn add_to(&self, sum: &mut [f64], factor: f64) {
        self.entries().for_each(|(row, value)| sum[row] += factor * value);
    }

    /// [`crate::diagnosis::rows::basis::dot`], to the last bit.
    pub(in crate::diagnosis) fn dot(&self, dense: &[f64]) -> f64 {
        self.sum(self.entries().map(|(row, value)| (row, value * dense[row])))
    }

    /// The same of two.
    pub(in crate::diagnosis) fn inner(&self, other: &Self) -> f64 {
        let start =
            |of: &Self, first: Option<&usize>| first.map_or(0, |first| of.rows.partition_point(|row| row < first));
        let (mut i, mut j) = (start(self, other.rows.first()), start(other, self.rows.first()));
        let products = std::iter::from_fn(|| {
            loop {
                let row = *self.rows.get(i)?;
                let order = row.cmp(other.rows.get(j)?);
                i += usize::from(order != Ordering::Greater);
                j += usize::from(order != Ordering::Less);
                if order == Ordering::Equal {
                    return Some((row, self.values[i - 1] * other.values[j - 1]));
                }
            }
        });
        self.sum(products)
    }

    /// In the order and in the sums in which a whole column is summed.
    fn sum(&self, products: impl Iterator<Item = (usize, f64)>) -> f64 {
        let fours = self.length / 4 * 4;
        let (mut sums, mut rest) = ([0.0_f64; 4], 0.0);
        for (row, product) in products {
            if row < fours {
                sums[row % 4] += product;
            } else {
                rest += product;
            }
        }
        (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnosis::rows::basis::dot;

    #[test]
    fn products_are_those_of_whole_columns() {
        let column = |from: usize, to: usize, phase: f64| -> Vec<f64> {
            (0..23).map(|row| if (from..to).contains(&row) { (row as f64 + phase).sin() } else { 0.0 }).collect()
        };
        let columns =
            [column(0, 23, 0.1), column(3, 9, 0.2), column(7, 22, 0.3), column(20, 23, 0.4), column(0, 0, 0.0)];
        for a in &columns {
            let few = Sparse::of(a);
            assert_eq!(&few.dense(), a);
            assert!((0..23).all(|row| few.at(row).to_bits() == a[row].to_bits()));
            for b in &columns {
                assert_eq!(few.dot(b).to_bits(), dot(a, b).to_bits());
                assert_eq!(few.inner(&Sparse::of(b)).to_bits(), dot(a, b).to_bits());
            }
        }
    }
}
