//! How well the parameters are known.

use super::Fit;
use crate::dense::{Columns, Qr};

/// Where the size of the residuals' noise comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// Residuals came in units of their known standard deviation.
    Known,
    /// From the residuals' own scatter: sum of squares over degrees of freedom.
    FromResiduals,
}

/// Covariance of the parameters in the linear approximation at the minimum.
#[derive(Debug, Clone, PartialEq)]
pub struct Covariance {
    /// Standard deviation of a residual, in its own units.
    pub residual_sd: f64,
    /// Residuals and priors less free parameters.
    pub degrees_of_freedom: usize,
    /// Standard deviations; `None` for what is held, lies at a bound or is not determined.
    pub standard_deviations: Vec<Option<f64>>,
    /// The whole matrix, 0 where there is no standard deviation.
    pub matrix: Columns,
    /// 1/sqrt of the smallest eigenvalue of the Gram matrix of unit columns; above 20 parameters can hardly be told
    /// apart (Brun and Reichert).
    pub collinearity: f64,
}

impl Fit {
    /// Covariance of the parameters. With a robust loss the weighted equations stand for the plain ones.
    pub fn covariance(&self, noise: Noise) -> Covariance {
        let count = self.parameters.len();
        let known: Vec<usize> = (0..count).filter(|j| !self.at_bound[*j] && !self.undetermined.contains(j)).collect();
        let mut columns = self.jacobian.take_columns(&known);
        let lengths = columns.lengths();
        for (j, length) in lengths.iter().enumerate() {
            for entry in columns.column_mut(j) {
                *entry /= length;
            }
        }
        let rows = self.weighted.len();
        let degrees_of_freedom = rows.saturating_sub(known.len());
        let squares: f64 = self.weighted.iter().map(|r| r * r).sum();
        let residual_sd = match noise {
            Noise::Known => 1.0,
            Noise::FromResiduals => (squares / degrees_of_freedom.max(1) as f64).sqrt(),
        };
        let inverse = Qr::pivoted(columns).inverse_gram();
        let mut matrix = Columns::zeros(count, count);
        let mut standard_deviations = vec![None; count];
        for (a, &i) in known.iter().enumerate() {
            for (b, &j) in known.iter().enumerate() {
                let entry = residual_sd * residual_sd * inverse.at(a, b) / (lengths[a] * lengths[b]);
                matrix.set(i, j, entry);
            }
            standard_deviations[i] = Some(residual_sd * inverse.at(a, a).max(0.0).sqrt() / lengths[a]);
        }
        let (values, _) = crate::dense::symmetric_eigen(&inverse);
        let collinearity = values.last().copied().unwrap_or(1.0).max(1.0).sqrt();
        Covariance { residual_sd, degrees_of_freedom, standard_deviations, matrix, collinearity }
    }

    /// Weighted derivatives of the data rows at the minimum, column by column.
    pub fn jacobian(&self) -> Columns {
        self.jacobian.take_rows(&(0..self.data_count).collect::<Vec<_>>())
    }
}
