//! Nonlinear least squares with bounds, priors, robust loss and covariance.
//!
//! Wanted: the parameters b within their bounds that make
//! `sum_i rho(r_i(b)^2) + sum_k ((b_k - m_k)/s_k)^2` smallest, r the residuals of a model in units of their
//! standard deviation, m and s Gaussian priors where given, rho(u) = u unless a robust loss is asked for.
//!
//! One default setting for every problem, in two stages. **Descent** (`descent`): Levenberg-Marquardt in the
//! coordinates of the columns' lengths with a second-order correction along the step (geodesic
//! acceleration, Transtrum and Sethna, arXiv:1201.5885), which also refuses steps that bend too much;
//! bounds by an active set and projection. **Polish** (`polish`): near the end the sum of squares is flat
//! to the last digit while the parameters still move in the eighth, so steps are judged by their
//! length, with derivatives by Romberg extrapolation over steps chosen from the data. A descent that runs
//! into a place where the data say nothing about some parameter is tried once more with shorter steps.
//!
//! A fit says how it ended ([`Ending`]); nothing that did not converge passes as converged. The measure is
//! the relative offset of Bates and Watts (Technometrics 23 (1981) 179): how far the residuals still lean on
//! the tangent plane, in standard errors of the parameters.

mod bounds;
mod covariance;
mod descent;
mod differences;
mod loss;
mod polish;
mod profile;
mod system;

pub use covariance::{Covariance, Noise};
pub use loss::Loss;
pub use profile::{Side, profile_interval};

use super::dense::Columns;
use system::System;

/// Residuals as a function of parameters.
pub trait Model {
    /// How many residuals there are.
    fn residual_count(&self) -> usize;
    /// The residuals at `parameters`, in units of their standard deviation. What is not finite says that the model is
    /// not defined there.
    fn residuals(&self, parameters: &[f64], into: &mut [f64]);
    /// d residual / d parameter, column by column; `false` where there is none: differences are taken then.
    fn jacobian(&self, _parameters: &[f64], _into: &mut Columns) -> bool {
        false
    }
}

/// A function as a model.
#[derive(Debug, Clone, Copy)]
pub struct FromFn<F> {
    count: usize,
    function: F,
}

/// The model of `count` residuals that `function(parameters, into)` writes.
pub fn from_fn<F: Fn(&[f64], &mut [f64])>(count: usize, function: F) -> FromFn<F> {
    FromFn { count, function }
}

impl<F: Fn(&[f64], &mut [f64])> Model for FromFn<F> {
    fn residual_count(&self) -> usize {
        self.count
    }
    fn residuals(&self, parameters: &[f64], into: &mut [f64]) {
        (self.function)(parameters, into);
    }
}

/// What is known of a parameter beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Where to start.
    pub start: f64,
    /// Least value; minus infinity for none.
    pub lower: f64,
    /// Largest value; equal to the least one it holds the parameter.
    pub upper: f64,
    /// Gaussian prior: mean and standard deviation.
    pub prior: Option<(f64, f64)>,
}

impl Parameter {
    /// Without bounds or prior.
    pub const fn free(start: f64) -> Self {
        Self { start, lower: f64::NEG_INFINITY, upper: f64::INFINITY, prior: None }
    }
    /// The same within bounds.
    #[must_use]
    pub const fn within(mut self, lower: f64, upper: f64) -> Self {
        self.lower = lower;
        self.upper = upper;
        self
    }
    /// The same with a Gaussian prior.
    #[must_use]
    pub const fn with_prior(mut self, mean: f64, sd: f64) -> Self {
        self.prior = Some((mean, sd));
        self
    }
    /// The same held at a value.
    #[must_use]
    pub const fn held(mut self, value: f64) -> Self {
        self.start = value;
        self.lower = value;
        self.upper = value;
        self
    }
    /// Size against which changes are measured: of the prior or the start; 1 if both are 0.
    fn scale(&self) -> f64 {
        let size = self.prior.map_or(self.start.abs(), |(_, sd)| sd.abs());
        if size > 0.0 && size.is_finite() { size } else { 1.0 }
    }
}

/// How to fit. The default serves every problem.
#[derive(Clone, Copy)]
pub struct Settings<'a> {
    /// What a residual costs.
    pub loss: Loss,
    /// Most steps of the descent.
    pub max_iterations: u32,
    /// Asked at every step: whether to give up.
    pub stop: Option<&'a dyn Fn() -> bool>,
}

impl Default for Settings<'_> {
    fn default() -> Self {
        Self { loss: Loss::Squared, max_iterations: 5000, stop: None }
    }
}

/// How a fit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// At a minimum: the parameters are those of the minimum to 1e-6 of their standard errors, or to nine digits.
    Converged,
    /// Lower cannot be reached, but some parameter is not determined by the data: its value means nothing
    /// ([`Fit::undetermined`]).
    Undetermined,
    /// The steps allowed were used up.
    IterationLimit,
    /// No step lowers the sum, though the slope does not vanish: the model is not smooth there, or not defined.
    Stalled,
    /// Told to stop.
    Stopped,
}

/// Why there was nothing to fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoFit {
    /// A start, bound, prior or scale is not a number, or the start lies outside its bounds.
    #[error("parameter {0} has no valid start, bounds or prior")]
    BadParameter(usize),
    /// The model is not defined at the start.
    #[error("residual {0} is not finite at the start")]
    UndefinedAtStart(usize),
    /// Fewer residuals (priors counted) than free parameters.
    #[error("{residuals} residuals for {parameters} parameters")]
    TooFewResiduals {
        /// Residuals and priors.
        residuals: usize,
        /// Parameters that are not held.
        parameters: usize,
    },
}

/// Where a fit ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The parameters.
    pub parameters: Vec<f64>,
    /// What was made small.
    pub objective: f64,
    /// Sum of the squared residuals alone, without priors and loss.
    pub sum_of_squares: f64,
    /// The residuals.
    pub residuals: Vec<f64>,
    /// How it ended.
    pub ending: Ending,
    /// Distance from the minimum in standard errors of the parameters, as the tangent plane shows it.
    pub relative_offset: f64,
    /// Which parameters lie at a bound that holds them back.
    pub at_bound: Vec<bool>,
    /// Parameters that the data do not determine: a change of a million times their size stays within the noise.
    pub undetermined: Vec<usize>,
    /// Steps of the descent.
    pub iterations: u32,
    /// Calls of the model.
    pub evaluations: u32,
    /// Derivatives of residuals and priors at the parameters, weighted by the loss.
    pub(crate) jacobian: Columns,
    /// Residuals and priors, weighted by the loss.
    pub(crate) weighted: Vec<f64>,
    /// Residuals without the priors.
    pub(crate) data_count: usize,
}

/// Fits a model.
pub fn fit(model: &dyn Model, parameters: &[Parameter], settings: &Settings<'_>) -> Result<Fit, NoFit> {
    let mut system = System::new(model, parameters, settings.loss)?;
    let mut best: Option<Fit> = None;
    let mut spent = 0;
    for damping in [descent::FIRST_DAMPING, descent::SECOND_DAMPING] {
        let descended = descent::descend(&mut system, settings, damping);
        spent += descended.iterations;
        let stopped = descended.stopped;
        let mut found = polish::polish(&mut system, descended);
        found.iterations = spent;
        found.evaluations = system.evaluations();
        let better = best.as_ref().is_none_or(|before| rank(&found) < rank(before) || lower(&found, before));
        if better {
            best = Some(found);
        }
        if stopped || best.as_ref().is_some_and(|fit| fit.ending == Ending::Converged) {
            break;
        }
    }
    // The loop runs at least once.
    let mut best = best.unwrap_or_else(|| polish::at_start(&mut system));
    (best.iterations, best.evaluations) = (spent, system.evaluations());
    Ok(best)
}

fn rank(fit: &Fit) -> u8 {
    match fit.ending {
        Ending::Converged => 0,
        Ending::Undetermined => 1,
        Ending::IterationLimit | Ending::Stalled | Ending::Stopped => 2,
    }
}

fn lower(fit: &Fit, other: &Fit) -> bool {
    rank(fit) == rank(other) && fit.objective < other.objective
}
