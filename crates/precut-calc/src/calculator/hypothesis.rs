//! Causes as they stand for a job and its measured rows: what a diagnosis fits.

use crate::effects::{Cause, Fit, Parameter};

/// The catalogue, sorted by whether these rows can speak about a cause at all.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Hypotheses {
    /// Those that can be fitted.
    pub applicable: Vec<Hypothesis>,
    /// Those that cannot, and why.
    pub inapplicable: Vec<Inapplicable>,
}

/// A cause that these rows cannot speak about.
#[derive(Debug, Clone, PartialEq)]
pub struct Inapplicable {
    /// Its entry in the catalogue.
    pub cause: &'static Cause,
    /// Why.
    pub reason: Inapplicability,
}

/// Why rows cannot speak about a cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Inapplicability {
    /// This field of the runs' conditions is not given everywhere.
    ConditionAbsent(&'static str),
    /// This condition is the same in all runs.
    ConditionConstant(&'static str),
    /// This condition has two levels: a bend cannot be told from a slope.
    ConditionAtTwoLevels(&'static str),
    /// The job has nothing that it could act on (no steady rest, no tailstock).
    NothingToActOn,
    /// The job holds it already, and nothing of it can change.
    InJob,
    /// The user asked for other causes.
    NotAskedFor,
    /// It scatters, but moves no mean: it is part of the noise.
    ScatterOnly,
}

/// A cause as it stands for a base model and its rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    /// Its entry in the catalogue.
    pub cause: &'static Cause,
    /// Which of several effects of one kind: a batch, a harmonic's order; empty where there is one.
    pub label: String,
    /// What is fitted or stated, in the order of the cause's parameters.
    pub variables: Vec<Variable>,
    /// Prior weight relative to the other causes.
    pub prior_weight: f64,
    /// The effect of the base that it is a change of; none where the base has no such effect.
    pub held: Option<Held>,
}

/// An effect that the base holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Held {
    /// Which of the effects of the base.
    pub effect: usize,
    /// Values of the hypothesis' variables at which it is that effect.
    pub values: Vec<f64>,
}

impl Hypothesis {
    /// The same as a change of an effect that the base holds: its sizes count from there, its shapes stay as they are. Of an
    /// effect without a size its shapes change. `None` where nothing of it can.
    pub fn change_of(mut self, held: Held) -> Option<Self> {
        let has_sizes = self.has_amplitude();
        for (variable, &from) in self.variables.iter_mut().zip(&held.values) {
            let prior_sd = match &variable.treatment {
                Treatment::Amplitude { prior_sd } => Some(*prior_sd),
                Treatment::Shape { prior: Some(prior), .. } if !has_sizes => {
                    Some(if prior.logarithmic { prior.sd * from.abs() } else { prior.sd })
                }
                _ => None,
            };
            let Range { lower, upper } = variable.range;
            match prior_sd {
                Some(prior_sd) => {
                    variable.treatment = Treatment::Amplitude { prior_sd };
                    // No change is always within.
                    variable.range = Range { lower: (lower - from).min(0.0), upper: (upper - from).max(0.0) };
                }
                None => variable.treatment = Treatment::Stated { value: from },
            }
        }
        self.held = Some(held);
        self.has_amplitude().then_some(self)
    }

    /// Where the sizes of a variable count from: 0, or what the base holds.
    pub fn counted_from(&self, variable: usize) -> f64 {
        match (&self.held, &self.variables[variable].treatment) {
            (Some(held), Treatment::Amplitude { .. }) => held.values[variable],
            _ => 0.0,
        }
    }

    /// Whether it has a size of its own, rather than being there or not.
    pub fn has_amplitude(&self) -> bool {
        self.amplitudes().next().is_some()
    }

    /// Its sizes: index of the variable and standard deviation of its prior.
    pub fn amplitudes(&self) -> impl Iterator<Item = (usize, f64)> {
        self.variables.iter().enumerate().filter_map(|(index, variable)| match variable.treatment {
            Treatment::Amplitude { prior_sd } => Some((index, prior_sd)),
            _ => None,
        })
    }

    /// Indices of the shapes that are fitted beyond their grid, with the spacing of the grid.
    pub fn fitted_shapes(&self) -> impl Iterator<Item = (usize, f64)> {
        self.variables.iter().enumerate().filter_map(|(index, variable)| match &variable.treatment {
            Treatment::Shape { grid, prior: Some(_) } => {
                let ends = grid.first().zip(grid.last()).map_or(0.0, |(first, last)| last - first);
                Some((index, ends / (grid.len().saturating_sub(1).max(1)) as f64))
            }
            _ => None,
        })
    }
}

/// Sizes of a hypothesis about which the model is linearised, too, beside 0: where what it does is far from proportional to
/// them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Expansions {
    /// One value for every size of the hypothesis, in the order of its variables; at every point of the grid of its shapes.
    pub places: Vec<Vec<f64>>,
    /// How many of all of them are used: those where the model comes nearest to the rows.
    pub nearest: usize,
    /// Into how many parts a step of the grid of a fitted shape is divided where the nearest are looked for.
    pub parts: u32,
}

impl Expansions {
    /// All of these values of a hypothesis' only size.
    pub fn along(values: impl IntoIterator<Item = f64>) -> Self {
        Self { places: values.into_iter().map(|value| vec![value]).collect(), nearest: usize::MAX, parts: 1 }
    }

    /// A size at these multiples of its prior standard deviation, on both sides and within its range. Nothing of a shape.
    pub fn either_way(variable: &Variable, deviations: &[f64]) -> Self {
        let Treatment::Amplitude { prior_sd } = variable.treatment else { return Self::default() };
        let sizes = deviations.iter().flat_map(|share| [share * prior_sd, -share * prior_sd]);
        Self::along(sizes.filter(|size| (variable.range.lower..=variable.range.upper).contains(size)))
    }

    /// About so many of the places that lie farthest from 0, spread over their order.
    pub fn outermost(&self, count: usize) -> Vec<Vec<f64>> {
        let rim = self.beyond(0.999);
        rim.iter().step_by((rim.len() / count.max(1)).max(1)).cloned().collect()
    }

    /// The places farther from 0 than a share of the farthest.
    pub fn beyond(&self, share: f64) -> Vec<Vec<f64>> {
        let distance = |place: &[f64]| place.iter().map(|value| value * value).sum::<f64>().sqrt();
        let farthest = self.places.iter().map(|place| distance(place)).fold(0.0, f64::max);
        self.places.iter().filter(|place| distance(place) > share * farthest).cloned().collect()
    }
}

/// A parameter in the coordinate in which it is fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name with its unit.
    pub name: &'static str,
    /// Unit as in the contract.
    pub unit: &'static str,
    /// How it is treated.
    pub treatment: Treatment,
    /// Where it may lie.
    pub range: Range,
}

impl Variable {
    /// A parameter of the catalogue within these bounds. A factor is fitted by its logarithm, which is 0 where the factor is
    /// absent, and as far for 2 as for 1/2.
    pub fn of(parameter: &Parameter, range: Range) -> Self {
        let treatment = match parameter.fit {
            Fit::Amplitude | Fit::Factor => Treatment::Amplitude { prior_sd: parameter.prior_sd },
            Fit::Shape { grid } => Treatment::Shape { grid: grid.to_vec(), prior: None },
            Fit::Fixed { default } => Treatment::Stated { value: default },
            Fit::OfJob => Treatment::Stated { value: 0.0 },
        };
        match parameter.fit {
            Fit::Factor => {
                let range = Range { lower: range.lower.ln(), upper: range.upper.ln() };
                Self { name: "ln_factor", unit: "1", treatment, range }
            }
            _ => Self { name: parameter.name, unit: parameter.unit, treatment, range },
        }
    }
}

/// Bounds of a variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Least value.
    pub lower: f64,
    /// Largest value.
    pub upper: f64,
}

impl Range {
    /// The value itself, or the bound that it passes.
    pub fn clamp(self, value: f64) -> f64 {
        value.clamp(self.lower, self.upper)
    }
}

/// How a variable is treated.
#[derive(Debug, Clone, PartialEq)]
pub enum Treatment {
    /// Size of the effect, absent at 0; Gaussian prior about 0, cut at a bound that is 0.
    Amplitude {
        /// Standard deviation of the prior, in the unit of the variable.
        prior_sd: f64,
    },
    /// Form of the effect: tried on a grid, then fitted where a prior is given.
    Shape {
        /// Values tried, of equal weight.
        grid: Vec<f64>,
        /// Prior of the fit.
        prior: Option<Shape>,
    },
    /// Stated, not fitted.
    Stated {
        /// Its value.
        value: f64,
    },
}

/// Gaussian prior of a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Mean, of the logarithm where it is logarithmic.
    pub mean: f64,
    /// Standard deviation, of the logarithm where it is logarithmic.
    pub sd: f64,
    /// Whether the prior is on the logarithm.
    pub logarithmic: bool,
}
