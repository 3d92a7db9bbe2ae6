//! Information criteria of least-squares fits.

/// Criteria of a fit with Gaussian noise of unknown size; smaller is better. Only differences between fits of the same
/// observations in the same scale mean anything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Minus twice the greatest log likelihood, constants included.
    pub deviance: f64,
    /// Akaike's, corrected for small samples (Hurvich and Tsai 1989); `None` with too few observations.
    pub aicc: Option<f64>,
    /// Schwarz's.
    pub bic: f64,
}

impl Criteria {
    /// Of `count` observations with sum of squared residuals `rss` after fitting `parameters` coefficients; the noise is
    /// one parameter more. `offset` is added to the deviance: twice the sum of ln y brings a fit of ln y to the scale of y.
    pub fn of(count: usize, parameters: usize, rss: f64, offset: f64) -> Self {
        let n = count as f64;
        let k = parameters as f64 + 1.0;
        let deviance = n * (2.0 * std::f64::consts::PI * rss / n).ln() + n + offset;
        let room = n - k - 1.0;
        let aicc = (room > 0.0).then(|| deviance + 2.0 * k * n / room);
        Self { deviance, aicc, bic: deviance + k * n.ln() }
    }
}
