//! What a diagnosis sees of a base model: hypotheses that can be switched on, and predictions with them.

use crate::calculator::{Expansions, Failure, Hypothesis, JacobianColumn, Over, Prediction};
use crate::diagnosis::rows::basis::cosine;

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

    /// The same with numerics that do no more than to say where it comes near to the rows.
    fn predict_roughly(&self, effects: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        self.predict_coarsely(effects)
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
pub(in crate::diagnosis) struct Belief {
    /// Causes with their values.
    pub(in crate::diagnosis) settings: Vec<Setting>,
    /// What has no name.
    pub(in crate::diagnosis) form: Option<Form>,
}

/// Something without a name over what it goes with.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnosis) struct Form {
    /// What it goes with, and where it is given.
    pub(in crate::diagnosis) over: Vec<Over>,
    /// What its sizes are of.
    pub(in crate::diagnosis) basis: Basis,
    /// In the unit of the effect that stands for it.
    pub(in crate::diagnosis) sizes: Vec<f64>,
}

/// What sizes are of.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnosis) enum Basis {
    /// Products of half waves over the range of each axis: so many orders of each from 0, those of the last first.
    Waves(Vec<usize>),
    /// Levels: which of the sizes at which place, those of the last axis first; none where nothing was measured.
    Levels(Vec<Option<usize>>),
}

impl Form {
    /// The size at a place of every axis; of levels at the nearest one.
    pub(in crate::diagnosis) fn at(&self, place: &[f64]) -> f64 {
        match &self.basis {
            Basis::Waves(orders) => {
                let wave = |index: usize| (0..orders.len()).map(move |k| cosine(digit(index, orders, k), place[k]));
                self.sizes.iter().enumerate().map(|(index, size)| size * wave(index).product::<f64>()).sum()
            }
            Basis::Levels(sizes) => {
                let index = self.over.iter().zip(place).fold(0, |index, (axis, place)| {
                    let near = |k: &usize| (axis.at[*k] - place).abs();
                    let own = (0..axis.at.len()).min_by(|a, b| near(a).total_cmp(&near(b)));
                    index * axis.at.len() + own.unwrap_or(0)
                });
                sizes[index].map_or(0.0, |size| self.sizes[size])
            }
        }
    }
}

/// The digit of an axis in a number that counts through all axes, the last one first.
pub(in crate::diagnosis) fn digit(index: usize, counts: &[usize], axis: usize) -> usize {
    index / counts[axis + 1..].iter().product::<usize>() % counts[axis]
}

impl Belief {
    /// Causes alone.
    pub(in crate::diagnosis) fn of(settings: &[Setting]) -> Self {
        Self { settings: settings.to_vec(), form: None }
    }
}
