//! The one catalogue of named physical effects.
//!
//! An effect is an optional term of a calculator's own model: a job switches it on with its
//! parameters, a diagnosis chooses and fits it. Texts (what it looks like, what tells it apart) are
//! worded outside, under `cause.{kind}`.

mod deflection;
mod expression;
mod fixture;
mod machinability;
mod milling;
mod open;
mod ring;

pub use deflection::{CAUSES as DEFLECTION_CAUSES, DeflectionConditions, DeflectionEffect, ErrorPoint};
pub use expression::Expression;
pub(crate) use expression::{NUMBERS as FORMULA_NUMBERS, UserFormula};
pub use fixture::{CAUSES as FIXTURE_CAUSES, FixtureConditions, FixtureEffect};
pub use machinability::{
    CAUSES as MACHINABILITY_CAUSES, FactorLevel, MachinabilityConditions, MachinabilityEffect, RemainderPoint,
};
pub use milling::{CAUSES as MILLING_CAUSES, MillingEffect};
pub(crate) use open::{Catalogued, has_parameter, with_changed};
pub use open::{JointUncertainty, ParameterMove};
pub(crate) use ring::whole;
pub use ring::{CAUSES as RING_CAUSES, RingConditions, RingEffect};

/// How much of a remainder acts as it was found.
fn as_found() -> f64 {
    1.0
}

/// An entry of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cause {
    /// The `kind` of the effect object.
    pub kind: &'static str,
    /// Number of its equation in the documentation.
    pub equation: &'static str,
    /// Its parameters: the fields of the effect object.
    pub parameters: &'static [Parameter],
    /// Fields of `conditions` that it cannot do without.
    pub conditions: &'static [&'static str],
    /// Kinds that some experiments cannot tell from it.
    pub confounded_with: &'static [&'static str],
    /// Whether it moves the mean of what is measured; a pure scatter does not.
    pub moves_mean: bool,
}

/// A parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Field of the effect object, unit in its name.
    pub name: &'static str,
    /// Unit as in the contract.
    pub unit: &'static str,
    /// How a diagnosis treats it.
    pub fit: Fit,
    /// Standard deviation of its Gaussian prior about 0 (amplitudes) or about the default (shapes), in its unit.
    pub prior_sd: f64,
    /// Least value.
    pub lower: f64,
    /// Largest value.
    pub upper: f64,
}

/// How a diagnosis treats a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fit {
    /// Linear size of the effect, 0 = absent.
    Amplitude,
    /// Multiplies what the job states, 1 = absent; the prior is on its logarithm.
    Factor,
    /// Its form; tried on a grid first.
    Shape {
        /// Values of the grid.
        grid: &'static [f64],
    },
    /// Stated, not fitted, unless asked for: its default.
    Fixed {
        /// Value where none is given.
        default: f64,
    },
    /// Read off the job (where a rest stands), not fitted.
    OfJob,
}
