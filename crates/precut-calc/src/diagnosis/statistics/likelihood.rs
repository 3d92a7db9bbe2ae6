//! What rows say about a prediction: values that scatter about it, or classes on either side of a margin
//! (`diagnosis/3.4`, `diagnosis/3.11`). The one place where a diagnosis knows the difference.

use crate::diagnosis::rows::data::Data;
use crate::diagnosis::rows::noise::Noise;
use crate::diagnosis::rows::sparse::Sparse;
use crate::diagnosis::statistics::class_likelihood::ClassLikelihood;
use crate::diagnosis::statistics::evidence::{Evidence, Normal, Scale, Side};
use crate::diagnosis::statistics::whiten::{White, Whitener};

/// How well a prediction explains the rows.
pub(in crate::diagnosis) enum Likelihood {
    /// Values: C = sigma^2 R(rho) + N N'.
    Gaussian {
        /// C^-1 as an inner product.
        whitener: Whitener,
        /// How sure sigma is.
        scale: Scale,
    },
    /// Classes: the probability of each is that of a scattering margin on its side of zero.
    Classes(ClassLikelihood),
}

impl Likelihood {
    /// Of the rows that are kept; `nuisances` at one standard deviation of every allowance, in the unit of the rows.
    pub(in crate::diagnosis) fn of(data: &Data, noise: &Noise, nuisances: &[Sparse], keep: &[bool]) -> Self {
        match &data.sides {
            None => Self::Gaussian { whitener: Whitener::new(data, noise, nuisances, keep), scale: Scale::of(noise) },
            Some(sides) => Self::Classes(ClassLikelihood::new(sides, noise, nuisances, keep)),
        }
    }

    /// A column of all rows in the coordinates of [`Self::evidence`].
    pub(in crate::diagnosis) fn white(&self, column: &[f64]) -> White {
        match self {
            Self::Gaussian { whitener, .. } => whitener.white(column),
            Self::Classes(classes) => classes.white(column),
        }
    }

    /// Evidence of causes with these columns for what is left without them.
    pub(in crate::diagnosis) fn evidence(
        &self,
        columns: &[&White],
        residual: &White,
        sides: &[Side],
    ) -> Option<Evidence> {
        match self {
            Self::Gaussian { whitener, scale } => {
                Normal::of(columns, residual).evidence(sides, *scale, whitener.rows())
            }
            Self::Classes(classes) => classes.evidence(columns, residual, sides),
        }
    }

    /// The quadratic about what is left: curvature and slope of the log-likelihood along the columns.
    pub(in crate::diagnosis) fn normal(&self, columns: &[&White], residual: &White) -> Option<Normal> {
        match self {
            Self::Gaussian { .. } => Some(Normal::of(columns, residual)),
            Self::Classes(classes) => classes.normal(columns, residual),
        }
    }

    /// Minus twice the log-likelihood of what is left, allowances at their most probable, up to a constant.
    pub(in crate::diagnosis) fn misfit(&self, residual: &White) -> f64 {
        match self {
            Self::Gaussian { .. } => residual.inner(residual),
            Self::Classes(classes) => classes.misfit(residual),
        }
    }

    /// What the logarithm of an evidence gains where the least of |r - X t|^2 + |t|^2 is another.
    pub(in crate::diagnosis) fn gain(&self, from: f64, to: f64) -> f64 {
        match self {
            Self::Gaussian { whitener, scale } => {
                scale.log_likelihood(to, whitener.rows()) - scale.log_likelihood(from, whitener.rows())
            }
            Self::Classes(_) => 0.5 * (from - to),
        }
    }
}
