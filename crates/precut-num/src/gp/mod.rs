//! Geometric programs in log variables: minimise ln of a posynomial, or a linear form, under linear rows and
//! posynomial limits. Equations `feed/6.1` to `feed/6.3`.
//!
//! Convex, so a point with small residuals and a small complementarity gap is the optimum within that gap,
//! and its multipliers are the certificate. Two ways to it, each the check of the other: `interior`, a
//! primal-dual method that uses the chain structure of the variables, and [`conic`], the same program on
//! exponential cones for a general solver.

mod affine;
mod border;
mod conflict;
pub mod conic;
mod feasibility;
mod interior;
mod layout;
mod newton;

pub use affine::Affines;
pub use conflict::conflict;
pub use feasibility::{Verdict, feasibility, inside};
pub use interior::{Failed, Settings, minimise};
pub use layout::Layout;

/// What is minimised.
#[derive(Debug, Clone, PartialEq)]
pub enum Objective {
    /// ln Σ exp(term).
    Sum(Affines),
    /// A linear form: entries and constant of the one row.
    Linear(Affines),
}

/// Minimise the objective over y subject to row(y) <= 0 for every row and ln Σ exp(term(y)) <= 0 for every sum.
///
/// The first `local` variables form a chain: rows and terms should touch neighbours in it. The `common` ones behind
/// them may stand anywhere. Every variable must be bounded by rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    /// Variables of the chain.
    pub local: usize,
    /// Variables behind the chain.
    pub common: usize,
    /// What is minimised.
    pub objective: Objective,
    /// Linear limits.
    pub rows: Affines,
    /// Limits on sums of exponentials.
    pub sums: Vec<Affines>,
    /// Where to start; need not be feasible.
    pub start: Vec<f64>,
}

impl Program {
    /// Variables.
    pub fn variables(&self) -> usize {
        self.local + self.common
    }

    /// The objective at y.
    pub fn objective_at(&self, y: &[f64]) -> f64 {
        match &self.objective {
            Objective::Sum(terms) => terms.log_sum_exp(y),
            Objective::Linear(form) => form.value(0, y),
        }
    }

    /// Largest value of a row or sum at y: how far y is from feasible, at most 0 where it is.
    pub fn violation(&self, y: &[f64]) -> f64 {
        let rows = (0..self.rows.len()).map(|row| self.rows.value(row, y)).fold(f64::NEG_INFINITY, f64::max);
        self.sums.iter().map(|sum| sum.log_sum_exp(y)).fold(rows, f64::max)
    }
}

/// A solved program.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The optimum.
    pub y: Vec<f64>,
    /// The objective there.
    pub objective: f64,
    /// Multiplier of every row: how fast the objective falls as the row's limit rises.
    pub row_multipliers: Vec<f64>,
    /// The same of every sum.
    pub sum_multipliers: Vec<f64>,
    /// Slack of every row.
    pub row_slacks: Vec<f64>,
    /// Complementarity gap Σ s z: the objective is at most so much above the least.
    pub gap: f64,
    /// Largest violation of a row or sum.
    pub primal_residual: f64,
    /// Largest component of the gradient of the Lagrangian.
    pub dual_residual: f64,
    /// Steps taken.
    pub iterations: u32,
}
