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

    /// What one unit of something without a name, of the same size everywhere, does to the prediction; `None` where the model
    /// has no effect for that.
    fn unnamed(&self) -> Result<Option<JacobianColumn>, Failure> {
        Ok(None)
    }
}

/// A hypothesis with a value for each of its variables.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// Index into [`Subject::hypotheses`].
    pub hypothesis: usize,
    /// In the order of [`Hypothesis::variables`].
    pub values: Vec<f64>,
}

/// What is believed to act beside the base.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Belief {
    /// Causes with their values.
    pub(super) settings: Vec<Setting>,
    /// What has no name.
    pub(super) waves: Option<Waves>,
}

/// Half waves over the length of a part, by ascending order from 0.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Waves {
    /// Between which places they are known, shares of the length.
    pub(super) ends: [f64; 2],
    /// Their sizes, in the unit of the effect that stands for them.
    pub(super) sizes: Vec<f64>,
    /// At so many places they are given well enough.
    pub(super) places: usize,
}

impl Belief {
    /// Causes alone.
    pub(super) fn of(settings: &[Setting]) -> Self {
        Self { settings: settings.to_vec(), waves: None }
    }
}
