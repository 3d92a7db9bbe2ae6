//! Machinability models: what comes out of a cut as a function of speed, feed, depth and edge angle.
//!
//! A [`MachinabilityModel`] is data: the coefficients of named variables, the form in which they act
//! (`feed/2.1`), the ranges of the trials behind them, where they come from, and how far single
//! trials scatter about them. A schedule takes a set of them, a fit makes one, a diagnosis doubts one.

mod library;
mod model;

pub use library::{LibraryModel, ModelSet, find_set, sets};
pub use model::{
    CoefficientCovariance, Conditions, FurtherVariable, MachinabilityModel, ModelCoefficient, ModelForm, ModelRange,
    Variable,
};
