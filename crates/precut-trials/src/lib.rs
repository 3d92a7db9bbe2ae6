//! Blind trials: jobs and measurements in which an effect is hidden, for testing a diagnosis.
//!
//! Nothing here is shared with the calculators: another discretisation (a shear-flexible finite-element
//! beam on springs; a ring turned in even steps that know no nodes; a cut in a vise by Runge-Kutta steps, one of an end mill by even ones; cuts as
//! products of powers), another solver (bisection, fixed point), another noise law (Student-t with six degrees of freedom,
//! uneven and correlated), nuisances drawn uniformly inside the allowances, and errors of the machine that
//! are not fed back into the depth of cut. A test that refits its own generator proves nothing.

pub mod deflection;
pub mod fixture;
pub mod machinability;
pub mod milling;
mod observer;
mod random;
pub mod ring;
pub mod score;

pub use random::Random;

use serde_json::Value;

/// A request to diagnose, and what is hidden in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// The body of a request; it never names the cause.
    pub request: Value,
    /// What is hidden.
    pub truth: Truth,
    /// Standard deviation of the scatter, in the unit of the quantity.
    pub sigma: f64,
    /// What was measured afterwards under other conditions, on the same machine with the same that is hidden; not of
    /// simulations, which are dear.
    pub later: Option<Later>,
}

/// Rows that no diagnosis has seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Later {
    /// The body of a request with these rows.
    pub request: Value,
    /// What a model would predict in every row that knows what is hidden, as residuals are taken (a logarithm where the
    /// quantity has one).
    pub best: Vec<f64>,
}

/// What is hidden in a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Which class of trial.
    pub class: Class,
    /// The causes that act, by kind; of class [`Class::Outside`] one that no catalogue holds.
    pub causes: Vec<Hidden>,
    /// What they change in every row together, as a [signature](Hidden::signature).
    pub together: Vec<f64>,
}

/// Classes of trials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Nothing is hidden.
    Nothing,
    /// One cause of the catalogue.
    One,
    /// Two causes of the catalogue.
    Two,
    /// Something that the catalogue does not hold.
    Outside,
}

/// How single rows scatter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scatter {
    /// Student's t with six degrees of freedom, uneven; along a part a moving average over neighbours, correlated by 0.19.
    Student,
    /// The same as a normal distribution.
    Normal,
    /// As [`Self::Student`], and rounded to what a shop's gauge shows: 1 um; of cuts two digits.
    Rounded,
    /// Normal; along a part every row holds 0.4 of its neighbour's deviation.
    Correlated,
}

impl Scatter {
    /// One number of unit variance.
    pub(crate) fn next(self, random: &mut Random) -> f64 {
        match self {
            Self::Student | Self::Rounded => random.student_6(),
            Self::Normal | Self::Correlated => random.normal(),
        }
    }
}

/// A hidden cause.
#[derive(Debug, Clone, PartialEq)]
pub struct Hidden {
    /// Its kind.
    pub kind: &'static str,
    /// Its first parameter, in the catalogue's unit.
    pub size: f64,
    /// Its other parameters, by their names in the catalogue, as far as it has such and they are known.
    pub shapes: Vec<(&'static str, f64)>,
    /// Root mean square of its signature over the rows, standard deviations of the scatter.
    pub snr: f64,
    /// Its signature: what it alone changes in every row, in the unit of residuals (a logarithm where the quantity has
    /// one). Empty where rows are classes.
    pub signature: Vec<f64>,
}
