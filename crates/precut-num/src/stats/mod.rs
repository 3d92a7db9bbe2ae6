//! Statistics of fits: linear regression with its diagnostics, cross-validation in closed form, tests, bootstrap.

mod bootstrap;
mod criteria;
mod distributions;
mod folds;
mod linear;
mod residual_tests;

pub use bootstrap::{GENERATOR, Resampler, percentile_interval, quantile};
pub use criteria::Criteria;
pub use distributions::{
    chi_squared_quantile, chi_squared_tail, f_quantile, f_tail, normal_tail, t_quantile, t_two_sided,
};
pub use folds::{group_out, leave_one_out};
pub use linear::{Collinearity, Deficient, Linear, collinearity, regress};
pub use residual_tests::{Test, anderson_darling, breusch_pagan, holm, lack_of_fit, ljung_box, nested_f, runs_test};
