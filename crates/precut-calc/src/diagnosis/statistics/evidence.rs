//! Evidence of a linear Gaussian hypothesis (`diagnosis/3.4`).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::distribution::{self, ContinuousCDF, StudentsT};

use crate::diagnosis::rows::noise::{Noise, NoiseSource};
use crate::diagnosis::statistics::whiten::White;

/// How sure the scatter is: decides what the quadratic form costs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::diagnosis) enum Scale {
    /// Stated: -Q/2.
    Known,
    /// Estimated from these same rows: -(n/2) ln Q; every row counts once.
    SameRows,
}

impl Scale {
    pub(in crate::diagnosis) fn of(noise: &Noise) -> Self {
        match noise.source {
            NoiseSource::Stated { .. } | NoiseSource::Spread => Self::Known,
            _ => Self::SameRows,
        }
    }

    pub(in crate::diagnosis) fn log_likelihood(self, q: f64, rows: f64) -> f64 {
        match self {
            Self::Known => -0.5 * q,
            Self::SameRows => -0.5 * rows * q.max(f64::MIN_POSITIVE).ln(),
        }
    }
}

/// On which side of zero an amplitude may lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::diagnosis) enum Side {
    Both,
    Positive,
    Negative,
}

impl Side {
    pub(in crate::diagnosis) fn of(range: crate::calculator::Range) -> Self {
        if range.lower >= 0.0 {
            Self::Positive
        } else if range.upper <= 0.0 {
            Self::Negative
        } else {
            Self::Both
        }
    }

    pub(in crate::diagnosis) fn sign(self) -> Option<f64> {
        match self {
            Self::Both => None,
            Self::Positive => Some(1.0),
            Self::Negative => Some(-1.0),
        }
    }
}

/// The fit of a hypothesis in units of its priors, and how well it explains the rows.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnosis) struct Evidence {
    pub(in crate::diagnosis) log_z: f64,
    /// Posterior means in units of the prior standard deviations.
    pub(in crate::diagnosis) t: Vec<f64>,
    /// Their covariance.
    pub(in crate::diagnosis) covariance: DMatrix<f64>,
    /// min over t of |r - X t|^2 + |t|^2.
    pub(in crate::diagnosis) q: f64,
}

/// Inner products of the columns X of a hypothesis and of the residual r, in whitened coordinates.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnosis) struct Normal {
    /// X'X.
    pub(in crate::diagnosis) gram: DMatrix<f64>,
    /// X'r.
    pub(in crate::diagnosis) right: DVector<f64>,
    /// r'r.
    pub(in crate::diagnosis) square: f64,
}

impl Normal {
    pub(in crate::diagnosis) fn of(columns: &[&White], residual: &White) -> Self {
        let count = columns.len();
        let mut gram = DMatrix::zeros(count, count);
        for i in 0..count {
            for j in 0..=i {
                let product = columns[i].inner(columns[j]);
                gram[(i, j)] = product;
                gram[(j, i)] = product;
            }
        }
        let right = DVector::from_iterator(count, columns.iter().map(|column| column.inner(residual)));
        Self { gram, right, square: residual.inner(residual) }
    }

    /// Where |r - X t|^2 is least, without priors; `None` where columns depend on each other.
    pub(in crate::diagnosis) fn least_squares(&self) -> Option<DVector<f64>> {
        Cholesky::new(self.gram.clone()).map(|factor| factor.solve(&self.right))
    }

    /// Least of |r - X t|^2 over all t, without priors.
    pub(in crate::diagnosis) fn misfit(&self) -> f64 {
        (self.square - self.explained().iter().sum::<f64>()).max(0.0)
    }

    /// Number of directions among the columns that rows see.
    pub(in crate::diagnosis) fn rank(&self) -> usize {
        self.explained().len()
    }

    /// What is explained along every principal direction of the columns, each of length one, that rows see.
    fn explained(&self) -> Vec<f64> {
        let length: Vec<f64> = self.gram.diagonal().iter().map(|square| square.sqrt()).collect();
        let seen: Vec<usize> = (0..length.len()).filter(|&i| length[i] > 0.0).collect();
        if seen.is_empty() {
            return Vec::new();
        }
        let unit = |i: usize, j: usize| self.gram[(seen[i], seen[j])] / (length[seen[i]] * length[seen[j]]);
        let eigen = DMatrix::from_fn(seen.len(), seen.len(), unit).symmetric_eigen();
        let right = DVector::from_iterator(seen.len(), seen.iter().map(|&i| self.right[i] / length[i]));
        let along = eigen.eigenvectors.tr_mul(&right);
        let parts = along.iter().zip(eigen.eigenvalues.iter());
        // Directions that no row sees explain nothing: round-off of a product of n terms stays far below this.
        parts.filter(|(_, value)| **value > 1e-12).map(|(part, value)| part * part / value).collect()
    }

    /// log Z = -1/2 log|A| + l(Q) + sum of ln 2 Phi(s_i t_i / sd_i), A = X'X + I.
    ///
    /// r ~ N(X t, I) and t ~ N(0, I) give r ~ N(0, I + X X'), whose determinant is |A| and whose quadratic
    /// form is Q. A prior doubled on the allowed side multiplies Z by twice the posterior probability of
    /// that side: exact for one constrained amplitude, an approximation for several.
    pub(in crate::diagnosis) fn evidence(&self, sides: &[Side], scale: Scale, rows: f64) -> Option<Evidence> {
        let count = self.right.len();
        let mut a = self.gram.clone();
        for i in 0..count {
            a[(i, i)] += 1.0;
        }
        let factor = Cholesky::new(a)?;
        let t = factor.solve(&self.right);
        let q = (self.square - self.right.dot(&t)).max(0.0);
        let covariance = factor.inverse();
        let log_z =
            -0.5 * log_det(&factor) + scale.log_likelihood(q, rows) + one_sided(sides, t.as_slice(), &covariance);
        Some(Evidence { log_z, t: t.as_slice().to_vec(), covariance, q })
    }
}

/// ln |A|, by the factor of A.
pub(in crate::diagnosis) fn log_det(factor: &Cholesky<f64, Dyn>) -> f64 {
    factor.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum()
}

/// Sum of ln 2 Phi(s_i t_i / sd_i) over the sizes that lie on one side of zero only.
pub(in crate::diagnosis) fn one_sided(sides: &[Side], t: &[f64], covariance: &DMatrix<f64>) -> f64 {
    sides
        .iter()
        .enumerate()
        .filter_map(|(i, side)| side.sign().map(|s| s * t[i] / covariance[(i, i)].sqrt()))
        .map(|z| std::f64::consts::LN_2 + log_normal_cdf(z))
        .sum()
}

/// ln Phi(z), also far down the lower tail where Phi underflows.
///
/// Below -10 by four terms of Mills' ratio: relative error of Phi below 105/z^8, 1e-6.
pub(in crate::diagnosis) fn log_normal_cdf(z: f64) -> f64 {
    if z > -10.0 {
        (0.5 * statrs::function::erf::erfc(-z * std::f64::consts::FRAC_1_SQRT_2)).ln()
    } else {
        let w = 1.0 / (z * z);
        let series = 1.0 - w * (1.0 - w * (3.0 - 15.0 * w));
        -0.5 * z * z - 0.5 * (2.0 * std::f64::consts::PI).ln() - (-z).ln() + series.ln()
    }
}

/// ln of the mean of exponentials.
pub(in crate::diagnosis) fn log_mean_exp(values: &[f64]) -> f64 {
    log_sum_exp(values) - (values.len() as f64).ln()
}

/// ln of the sum of exponentials.
pub(crate) fn log_sum_exp(values: &[f64]) -> f64 {
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return most;
    }
    most + values.iter().map(|v| (v - most).exp()).sum::<f64>().ln()
}

/// Two-sided quantile of Student's t, or of the normal distribution where the scatter is known.
pub(in crate::diagnosis) fn quantile(share: f64, dof: f64) -> f64 {
    let p = f64::midpoint(1.0, share);
    match StudentsT::new(0.0, 1.0, dof) {
        Ok(student) if dof.is_finite() => student.inverse_cdf(p),
        _ => distribution::Normal::standard().inverse_cdf(p),
    }
}
