//! Scores of quantities that are correlated (`certainty/1.3`).

use nalgebra::{DMatrix, DVector};

/// Least eigenvalue of a correlation.
const LEAST_EIGENVALUE: f64 = 1e-9;
/// By how much a repaired coefficient stays away from what just does not hold.
const REPAIR_MARGIN: f64 = 1e-4;

/// Correlated standard normal scores z = L g of independent ones g, L L' = R.
#[derive(Debug, Clone)]
pub(crate) struct Scores {
    lower: DMatrix<f64>,
    is_independent: bool,
}

/// Coefficients that no quantities can have together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Contradiction {
    /// All coefficients multiplied by this hold.
    pub largest_factor: f64,
}

impl Scores {
    /// Of so many quantities, with the coefficients between pairs of them.
    pub(crate) fn new(count: usize, pairs: &[(usize, usize, f64)]) -> Result<Self, Contradiction> {
        let correlation = |factor: f64| {
            let mut matrix = DMatrix::identity(count, count);
            for &(one, other, coefficient) in pairs {
                matrix[(one, other)] = factor * coefficient;
                matrix[(other, one)] = factor * coefficient;
            }
            matrix
        };
        let least = |matrix: &DMatrix<f64>| matrix.clone().symmetric_eigenvalues().min();
        let matrix = correlation(1.0);
        if count > 0 && least(&matrix) < LEAST_EIGENVALUE {
            // The eigenvalues of 1 + factor (R - 1) are straight in the factor: the least of R - 1 decides.
            let off = least(&matrix) - 1.0;
            return Err(Contradiction { largest_factor: (1.0 - REPAIR_MARGIN) / -off });
        }
        let lower = matrix.cholesky().map_or_else(|| DMatrix::identity(count, count), |found| found.l());
        Ok(Self { lower, is_independent: pairs.is_empty() })
    }

    /// Whether no quantity tells of another.
    pub(crate) fn is_independent(&self) -> bool {
        self.is_independent
    }

    /// The scores of independent ones.
    pub(crate) fn of(&self, independent: &[f64]) -> Vec<f64> {
        if self.is_independent {
            return independent.to_vec();
        }
        (&self.lower * DVector::from_column_slice(independent)).as_slice().to_vec()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_contradiction_tells_what_holds() {
        let pairs = [(0, 1, 0.9), (1, 2, 0.9), (0, 2, -0.9)];
        let Contradiction { largest_factor } = Scores::new(3, &pairs).unwrap_err();
        let repaired = pairs.map(|(a, b, r)| (a, b, r * largest_factor));
        assert!(Scores::new(3, &repaired).is_ok());
        let beyond = pairs.map(|(a, b, r)| (a, b, r * largest_factor * 1.001));
        assert!(Scores::new(3, &beyond).is_err());
    }

    #[test]
    fn scores_have_the_stated_correlation() {
        let scores = Scores::new(2, &[(0, 1, 0.6)]).unwrap();
        let z = scores.of(&[1.0, 1.0]);
        assert!((z[0] - 1.0).abs() < 1e-12 && (z[1] - 1.4).abs() < 1e-12);
    }
}
