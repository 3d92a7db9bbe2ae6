//! What a diagnosis sees of a base model: hypotheses that can be switched on, and predictions with them.

use crate::calculator::{Expansions, Failure, Hypothesis, JacobianColumn, Prediction};

/// A base model under measured rows.
pub trait Subject: Sync {
    /// The causes that these rows can speak about, each in the coordinates of its fit.
    fn hypotheses(&self) -> &[Hypothesis];

    /// One value per row with these effects, in the unit in which residuals are taken (a logarithm
    /// where the quantity is logarithmic).
    fn predict(&self, effects: &[Setting]) -> Result<Vec<Prediction>, Failure>;

    /// The same with the numerics of divided differences.
    fn predict_coarsely(&self, effects: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        self.predict(effects)
    }

    /// Sizes of a hypothesis about which the model is linearised, too, beside 0.
    fn expansions(&self, _hypothesis: usize) -> Expansions {
        Expansions::default()
    }

    /// d predict / d variable: one column per entry of `of`, which names an entry of `effects` and one of its variables.
    fn jacobian(&self, effects: &[Setting], of: &[(usize, usize)]) -> Result<Vec<JacobianColumn>, Failure>;

    /// What one standard deviation of every allowance does to the prediction.
    fn nuisances(&self) -> Result<Vec<JacobianColumn>, Failure>;
}

/// A hypothesis with a value for each of its variables.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// Index into [`Subject::hypotheses`].
    pub hypothesis: usize,
    /// In the order of [`Hypothesis::variables`].
    pub values: Vec<f64>,
}
