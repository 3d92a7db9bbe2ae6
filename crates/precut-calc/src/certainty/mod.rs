//! How sure: from what is uncertain in a job to the probability that every limit is kept (`certainty/1` to `certainty/3`).
//!
//! A quantity is a factor on what the job states, or an addition to it, drawn from a [`Distribution`] by its standard normal
//! score. Scores are correlated as the job says (`scores`). The probability is integrated over the real model, exactly
//! along one line through the scores and by scrambled Sobol points over the others (`lines`).

mod answer;
pub(crate) mod around;
pub(crate) mod block;
pub(crate) mod bounds;
pub(crate) mod deepest;
mod distribution;
pub(crate) mod judging;
mod line;
pub(crate) mod lines;
pub(crate) mod open;
pub(crate) mod picture;
mod quantities;
mod regression;
mod scores;
mod surface;

pub use answer::{
    Acceptance, Conformance, ConformanceMethod, Contribution, Improvement, ImprovingAction, IntervalSearch,
    JointlyKept, LimitKept, SeveralParts,
};
pub(crate) use answer::{improbable, probably, with_largest, with_most};
pub use block::ProbabilityCheck;
pub(crate) use block::{Block, uncertainty_block};
pub(crate) use distribution::{CODES as DISTRIBUTION_CODES, WidthUnit};
pub use distribution::{Distribution, Level, Source};
pub(crate) use open::OpenEffects;
pub(crate) use quantities::{
    CODES as QUANTITY_CODES, MISSING_CODES, Pair, Quantity, Uncertain, Uncertainties, check_brought,
    check_correlations, check_presence, check_quantities,
};
pub(crate) use scores::{Contradiction, Scores};
pub(crate) use surface::Surface;

/// A probability is told between these.
const LEAST: f64 = 1e-6;

/// A probability as it is told: never 0 or 1.
pub(crate) fn bounded(probability: f64) -> f64 {
    probability.clamp(LEAST, 1.0 - LEAST)
}

/// Probability that a standard normal number is below `x`.
pub(crate) fn normal_below(x: f64) -> f64 {
    0.5 * statrs::function::erf::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}

/// The number that a standard normal one is below with probability `p`.
pub(crate) fn normal_quantile(p: f64) -> f64 {
    -std::f64::consts::SQRT_2 * statrs::function::erf::erfc_inv(2.0 * p)
}
