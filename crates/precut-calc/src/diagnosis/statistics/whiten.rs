//! Scatter and allowances as one covariance: C = sigma^2 R(rho) + N N' (`diagnosis/3.2`).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::diagnosis::rows::basis::dot;
use crate::diagnosis::rows::data::Data;
use crate::diagnosis::rows::noise::{Noise, decorrelated};
use crate::diagnosis::rows::sparse::Sparse;
use crate::diagnosis::statistics::evidence::log_det;

/// C^-1 as an inner product, without ever forming C: rows are decorrelated and divided by sigma, the few
/// columns of N are then taken out by the identity (I + N N')^-1 = I - N (I + N'N)^-1 N'.
#[derive(Debug, Clone)]
pub(crate) struct Whitener {
    traces: Vec<Vec<usize>>,
    /// Trace of every row that counts.
    trace_of: Vec<Option<usize>>,
    /// Where every trace begins among the whitened rows.
    starts: Vec<usize>,
    sigma: Vec<f64>,
    rho: f64,
    nuisances: Vec<Sparse>,
    factor: Option<Cholesky<f64, Dyn>>,
    rows: usize,
}

/// A column in whitened coordinates.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct White {
    own: Vec<f64>,
    /// What the allowances can explain of it.
    allowed: Vec<f64>,
}

impl White {
    /// Without correlation and allowances.
    pub(in crate::diagnosis) fn plain(own: Vec<f64>) -> Self {
        Self { own, allowed: Vec::new() }
    }

    /// Row by row.
    pub(crate) fn own(&self) -> &[f64] {
        &self.own
    }

    pub(in crate::diagnosis) fn times(&self, factor: f64) -> Self {
        let of = |values: &[f64]| values.iter().map(|v| factor * v).collect();
        Self { own: of(&self.own), allowed: of(&self.allowed) }
    }

    /// a' C^-1 b.
    pub(crate) fn inner(&self, other: &Self) -> f64 {
        dot(&self.own, &other.own) - dot(&self.allowed, &other.allowed)
    }

    pub(in crate::diagnosis) fn minus(&self, other: &Self) -> Self {
        let less = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
        Self { own: less(&self.own, &other.own), allowed: less(&self.allowed, &other.allowed) }
    }
}

impl Whitener {
    /// `nuisances`: one standard deviation of every allowance, in the unit of the rows.
    pub(crate) fn new(data: &Data, noise: &Noise, nuisances: &[Sparse], keep: &[bool]) -> Self {
        let traces: Vec<Vec<usize>> = data.layout.kept_traces(keep).into_iter().map(|(_, rows)| rows).collect();
        let sigma = noise.per_row.clone().unwrap_or_else(|| vec![noise.sigma; data.value.len()]);
        let mut trace_of = vec![None; data.value.len()];
        let mut starts = Vec::with_capacity(traces.len());
        let mut rows = 0;
        for (trace, of_trace) in traces.iter().enumerate() {
            for &row in of_trace {
                trace_of[row] = Some(trace);
            }
            starts.push(rows);
            rows += of_trace.len();
        }
        let rho = noise.rho;
        let mut whitener = Self { traces, trace_of, starts, sigma, rho, nuisances: Vec::new(), factor: None, rows };
        let white = nuisances.iter().map(|column| whitener.sparse(column));
        let white: Vec<Sparse> = white.filter(|column| column.inner(column) > 0.0).collect();
        if !white.is_empty() {
            let count = white.len();
            let mut gram = DMatrix::identity(count, count);
            for i in 0..count {
                for j in 0..=i {
                    gram[(i, j)] += white[i].inner(&white[j]);
                    gram[(j, i)] = gram[(i, j)];
                }
            }
            whitener.factor = Cholesky::new(gram);
            whitener.nuisances = white;
        }
        whitener
    }

    /// The allowances, decorrelated and in units of the scatter.
    pub(in crate::diagnosis) fn nuisances(&self) -> &[Sparse] {
        &self.nuisances
    }

    /// ln |I + N'N|; `None` where it has no factor.
    pub(in crate::diagnosis) fn log_det_allowances(&self) -> Option<f64> {
        if self.nuisances.is_empty() { Some(0.0) } else { self.factor.as_ref().map(log_det) }
    }

    /// ln |C| over the rows that count.
    pub(crate) fn log_det(&self) -> f64 {
        let of_scatter: f64 = self.traces.iter().flatten().map(|&row| 2.0 * self.sigma[row].ln()).sum();
        // Of a sweep of n rows |R| = (1 - rho^2)^(n - 1).
        let pairs: usize = self.traces.iter().map(|rows| rows.len().saturating_sub(1)).sum();
        of_scatter + pairs as f64 * (1.0 - self.rho * self.rho).ln() + self.log_det_allowances().unwrap_or(0.0)
    }

    /// Number of rows that count.
    pub(crate) fn rows(&self) -> f64 {
        self.rows as f64
    }

    fn decorrelate(&self, column: &[f64]) -> Vec<f64> {
        self.traces
            .iter()
            .flat_map(|rows| {
                let scaled: Vec<f64> = rows.iter().map(|&row| column[row] / self.sigma[row]).collect();
                decorrelated(&scaled, self.rho)
            })
            .collect()
    }

    /// The same of a column that is 0 on most rows: other traces are not looked at.
    pub(in crate::diagnosis) fn sparse(&self, column: &Sparse) -> Sparse {
        let mut touched: Vec<usize> = column.rows().iter().filter_map(|&row| self.trace_of[row]).collect();
        touched.sort_unstable();
        touched.dedup();
        let of_trace = |trace: usize| {
            let scaled: Vec<f64> = self.traces[trace].iter().map(|&row| column.at(row) / self.sigma[row]).collect();
            (self.starts[trace]..).zip(decorrelated(&scaled, self.rho))
        };
        Sparse::new(self.rows, touched.into_iter().flat_map(of_trace))
    }

    /// A column trace by trace, in units of the scatter, less what the allowances most probably explain of it.
    pub(in crate::diagnosis) fn beyond_allowances(&self, column: &[f64]) -> Vec<Vec<f64>> {
        let White { mut own, allowed } = self.white(column);
        if let Some(factor) = &self.factor {
            let along = factor.l_dirty().tr_solve_lower_triangular(&DVector::from_vec(allowed));
            for (size, nuisance) in along.iter().flat_map(|v| v.iter()).zip(&self.nuisances) {
                nuisance.add_to(&mut own, -size);
            }
        }
        let mut rest = own.into_iter();
        self.traces.iter().map(|rows| rest.by_ref().take(rows.len()).collect()).collect()
    }

    pub(crate) fn white(&self, column: &[f64]) -> White {
        let own = self.decorrelate(column);
        let along =
            DVector::from_iterator(self.nuisances.len(), self.nuisances.iter().map(|nuisance| nuisance.dot(&own)));
        let allowed = self.factor.as_ref().map_or_else(Vec::new, |factor| {
            factor.l_dirty().solve_lower_triangular(&along).map_or_else(Vec::new, |p| p.as_slice().to_vec())
        });
        White { own, allowed }
    }
}
