//! What every step and every fold of a diagnosis stands on: base prediction, residuals, signatures.

use crate::calculator::{Failure, Monitor};
use crate::diagnosis::causes::signatures::Signatures;
use crate::diagnosis::causes::subject::Subject;
use crate::diagnosis::rows::data::Data;
use crate::diagnosis::rows::outlier::{Outliers, outliers};
use crate::diagnosis::rows::sparse::Sparse;

/// A subject with its rows, and all that does not depend on which rows are kept.
pub struct Foundation<'a> {
    /// The base model.
    pub subject: &'a dyn Subject,
    /// The rows.
    pub data: &'a Data,
    /// Prediction of the base, 0 where it has none.
    pub base: Vec<f64>,
    /// Whether the base predicts a row.
    pub predicted: Vec<bool>,
    /// Measured minus base, 0 where the base predicts nothing.
    pub residual: Vec<f64>,
    /// Standard deviation of every row, where the scatter has heavy tails.
    pub heavy_tails: Option<Vec<f64>>,
    /// Rows that belong to a narrow structure for certain: what they are off is no scatter.
    pub structure: Vec<usize>,
    pub(in crate::diagnosis) signatures: Signatures,
    /// One standard deviation of every allowance; most act in one run only.
    pub(in crate::diagnosis) nuisances: Vec<Sparse>,
    /// Variance of every row by all allowances.
    pub(in crate::diagnosis) allowed: Vec<f64>,
    /// What one unit of something without a name does to the rows, where the model has an effect for that.
    pub(in crate::diagnosis) unnamed: Option<Vec<f64>>,
}

impl<'a> Foundation<'a> {
    /// Runs the base and one divided difference for every size of every hypothesis.
    pub fn of(subject: &'a dyn Subject, data: &'a Data, monitor: &dyn Monitor) -> Result<Self, Failure> {
        let base = subject.predict(&[])?;
        let predicted: Vec<bool> = base.iter().map(Result::is_ok).collect();
        let base: Vec<f64> = base.into_iter().map(|f| f.unwrap_or(0.0)).collect();
        let rows = data.value.iter().zip(&base).zip(&predicted);
        let residual: Vec<f64> = rows.map(|((y, f), ok)| if *ok { y - f } else { 0.0 }).collect();
        let signatures = Signatures::of(subject, &base, &residual, monitor)?;
        let nuisances: Vec<Sparse> = subject.nuisances()?.iter().map(|column| Sparse::of(column)).collect();
        let mut allowed = vec![0.0; data.value.len()];
        for column in &nuisances {
            column.entries().for_each(|(row, value)| allowed[row] += value * value);
        }
        let unnamed = subject.unnamed()?;
        Ok(Self {
            subject,
            data,
            base,
            predicted,
            residual,
            heavy_tails: None,
            structure: Vec::new(),
            signatures,
            nuisances,
            allowed,
            unnamed,
        })
    }

    /// One more allowance.
    pub(in crate::diagnosis) fn allow(&mut self, column: Sparse) {
        column.entries().for_each(|(row, value)| self.allowed[row] += value * value);
        self.nuisances.push(column);
    }

    /// Rows that stand alone.
    pub fn outliers(&self, monitor: &dyn Monitor) -> Result<Outliers, Failure> {
        if self.data.sides.is_some() {
            // A class stands on one of two sides: none stands alone.
            return Ok(Outliers::default());
        }
        outliers(self.data, &self.residual, None, monitor)
    }

    /// What was found of single rows, from here on; the rows that are kept.
    pub(in crate::diagnosis) fn heed(&mut self, found: &Outliers, leave_outliers_out: bool) -> Vec<bool> {
        self.structure.clone_from(&found.structure);
        if !leave_outliers_out {
            return self.predicted.clone();
        }
        self.heavy_tails.clone_from(&found.heavy_tails);
        self.keep(found)
    }

    /// Of the rows that are kept, those that tell of the scatter.
    pub(in crate::diagnosis) fn scattering(&self, keep: &[bool]) -> Vec<bool> {
        let mut scattering = keep.to_vec();
        self.structure.iter().for_each(|&row| scattering[row] = false);
        scattering
    }

    /// Rows that the base predicts and that are not set aside.
    pub fn keep(&self, outliers: &Outliers) -> Vec<bool> {
        outliers.keep(self.residual.len()).iter().zip(&self.predicted).map(|(a, b)| *a && *b).collect()
    }
}
