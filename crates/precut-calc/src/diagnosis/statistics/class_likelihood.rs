//! Classes on either side of a margin: their likelihood, its mode and its evidence (`diagnosis/3.11`).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::diagnosis::rows::basis::dot;
use crate::diagnosis::rows::link;
use crate::diagnosis::rows::noise::Noise;
use crate::diagnosis::rows::sparse::Sparse;
use crate::diagnosis::statistics::evidence::{Evidence, Normal, Side, log_det, one_sided};
use crate::diagnosis::statistics::whiten::White;

/// Newton steps to the mode. But for the far tails the log-posterior is concave: a dozen suffice, halvings included.
const STEPS: usize = 60;
/// Halvings of a step that overshoots.
const HALVINGS: usize = 40;
/// Twice what a further Newton step would gain: far below what changes a probability.
const SETTLED: f64 = 1e-12;

/// Rows of which only the side of zero is known on which their margin lay, and rows beside them that were measured to stand at zero.
///
/// P(side s) = F(s (f + N d)/sigma), d ~ N(0, I), F as in `link`. A column is in units of sigma; "what is left" is minus the margin, as
/// if every row had been measured to stand on the boundary: then what is left of any linear model is read as for values.
pub(in crate::diagnosis) struct ClassLikelihood {
    /// Rows that count.
    rows: Vec<usize>,
    /// +1 or -1; 0 of a value.
    sides: Vec<f64>,
    sigma: Vec<f64>,
    nuisances: Vec<Vec<f64>>,
}

/// The most probable sizes.
struct Mode {
    /// Of all columns, those of the allowances last.
    size: DVector<f64>,
    /// I + D'WD there.
    factor: Cholesky<f64, Dyn>,
    log_likelihood: f64,
    /// Slope and curvature of the log-likelihood of every row.
    slope: Vec<f64>,
    weight: Vec<f64>,
}

impl ClassLikelihood {
    pub(in crate::diagnosis) fn new(sides: &[f64], noise: &Noise, nuisances: &[Sparse], keep: &[bool]) -> Self {
        let rows: Vec<usize> = (0..keep.len()).filter(|&row| keep[row]).collect();
        let sigma = rows.iter().map(|&row| noise.per_row.as_ref().map_or(noise.sigma, |own| own[row])).collect();
        let sides = rows.iter().map(|&row| sides[row]).collect();
        let mut likelihood = Self { rows, sides, sigma, nuisances: Vec::new() };
        likelihood.nuisances = nuisances
            .iter()
            .map(|column| likelihood.scaled(&column.dense()))
            .filter(|column| column.iter().any(|v| v.abs() > 0.0))
            .collect();
        likelihood
    }

    fn scaled(&self, column: &[f64]) -> Vec<f64> {
        self.rows.iter().zip(&self.sigma).map(|(&row, sigma)| column[row] / sigma).collect()
    }

    pub(in crate::diagnosis) fn white(&self, column: &[f64]) -> White {
        White::plain(self.scaled(column))
    }

    /// Laplace's approximation about the mode of sizes t and allowances d together:
    ///
    /// log Z = l(t, d) - |t|^2/2 - |d|^2/2 - 1/2 log|I + D'WD|, D = [X N], W the curvatures of the rows.
    pub(in crate::diagnosis) fn evidence(
        &self,
        columns: &[&White],
        residual: &White,
        sides: &[Side],
    ) -> Option<Evidence> {
        let Mode { size, factor, log_likelihood, .. } = self.mode(columns, residual)?;
        let count = columns.len();
        let covariance = factor.inverse().view((0, 0), (count, count)).into_owned();
        let t: Vec<f64> = size.iter().copied().take(count).collect();
        let square = size.dot(&size);
        let log_z = log_likelihood - 0.5 * square - 0.5 * log_det(&factor) + one_sided(sides, &t, &covariance);
        Some(Evidence { log_z, t, covariance, q: square - 2.0 * log_likelihood })
    }

    /// Working weights and responses in the form of a Gaussian's normal equations, allowances at their most probable.
    pub(in crate::diagnosis) fn normal(&self, columns: &[&White], residual: &White) -> Option<Normal> {
        let Mode { slope, weight, factor, log_likelihood, size } = self.mode(&[], residual)?;
        let weighted = |column: &[f64]| -> Vec<f64> { column.iter().zip(&weight).map(|(c, w)| c * w).collect() };
        let own: Vec<Vec<f64>> = columns.iter().map(|column| weighted(column.own())).collect();
        // What the allowances follow of a column.
        let along: Vec<DVector<f64>> = own
            .iter()
            .map(|own| {
                let inner = self.nuisances.iter().map(|nuisance| dot(nuisance, own));
                DVector::from_iterator(self.nuisances.len(), inner)
            })
            .collect();
        let followed: Vec<DVector<f64>> = along.iter().map(|along| factor.solve(along)).collect();
        let count = columns.len();
        let gram = DMatrix::from_fn(count, count, |i, j| dot(columns[i].own(), &own[j]) - along[i].dot(&followed[j]));
        let right = DVector::from_iterator(count, columns.iter().map(|column| dot(column.own(), &slope)));
        Some(Normal { gram, right, square: size.dot(&size) - 2.0 * log_likelihood })
    }

    pub(in crate::diagnosis) fn misfit(&self, residual: &White) -> f64 {
        self.mode(&[], residual).map_or(f64::INFINITY, |mode| mode.size.dot(&mode.size) - 2.0 * mode.log_likelihood)
    }

    /// Newton's method with halved steps on the log-posterior of the sizes of these columns and of the allowances. It is
    /// concave where no class stands far on the wrong side; what bends it there is left out of the curvature.
    fn mode(&self, columns: &[&White], residual: &White) -> Option<Mode> {
        let design: Vec<&[f64]> =
            columns.iter().map(|column| column.own()).chain(self.nuisances.iter().map(Vec::as_slice)).collect();
        let count = design.len();
        let margin = |size: &DVector<f64>| -> Vec<f64> {
            let mut margin: Vec<f64> = residual.own().iter().map(|r| -r).collect();
            for (t, column) in size.iter().zip(&design) {
                margin.iter_mut().zip(*column).for_each(|(m, c)| *m += t * c);
            }
            margin
        };
        let log_likelihood = |margin: &[f64]| -> f64 {
            margin.iter().zip(&self.sides).map(|(margin, side)| link::log_likelihood(*side, *margin)).sum()
        };
        let mut size = DVector::zeros(count);
        let mut here = margin(&size);
        let mut value = log_likelihood(&here);
        for step in 0.. {
            let (slope, weight): (Vec<f64>, Vec<f64>) =
                here.iter().zip(&self.sides).map(|(margin, side)| link::bend(*side, *margin)).unzip();
            let mut curvature = DMatrix::identity(count, count);
            for i in 0..count {
                let weighted: Vec<f64> = design[i].iter().zip(&weight).map(|(c, w)| c * w).collect();
                for j in 0..=i {
                    let product = dot(&weighted, design[j]);
                    curvature[(i, j)] += product;
                    if i != j {
                        curvature[(j, i)] += product;
                    }
                }
            }
            let factor = Cholesky::new(curvature)?;
            let gradient = DVector::from_fn(count, |i, _| dot(design[i], &slope) - size[i]);
            let move_by = factor.solve(&gradient);
            let gain = gradient.dot(&move_by);
            let moved = if gain < SETTLED || step >= STEPS {
                None
            } else {
                let posterior = value - 0.5 * size.dot(&size);
                (0..HALVINGS).map(|k| 0.5_f64.powi(i32::try_from(k).unwrap_or(i32::MAX))).find_map(|share| {
                    let next = &size + share * &move_by;
                    let there = margin(&next);
                    let reached = log_likelihood(&there);
                    (reached - 0.5 * next.dot(&next) >= posterior + 1e-4 * share * gain)
                        .then_some((next, there, reached))
                })
            };
            match moved {
                Some(moved) => (size, here, value) = moved,
                // At the mode, or no nearer to it within round-off.
                None => return Some(Mode { size, factor, log_likelihood: value, slope, weight }),
            }
        }
        None
    }
}
