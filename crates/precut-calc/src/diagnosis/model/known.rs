//! Effects that the base holds already: what is known of them, and how unsurely.

use std::f64::consts::TAU;

use nalgebra::{Cholesky, DMatrix};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::Value;

use crate::calculator::{Failure, Prediction};
use crate::diagnosis::causes::ranking::SetWeight;
use crate::diagnosis::causes::subject::Belief;
use crate::diagnosis::verdict::weigh::Weighing;
use crate::effects::{JointUncertainty, ParameterMove, with_changed};

/// The field that is the same a turn further.
const PHASE: &str = "phase_rad";
/// Share of a standard deviation by which parameters are moved for a divided difference.
const STEP: f64 = 0.01;

/// The effects of a base, and what is not known of them.
#[derive(Debug, Clone)]
pub struct Known<E> {
    /// What acts in the base.
    pub effects: Vec<E>,
    /// How unsure that is.
    pub unsure: Vec<JointUncertainty>,
}

impl<E> Default for Known<E> {
    fn default() -> Self {
        Self { effects: Vec::new(), unsure: Vec::new() }
    }
}

impl<E: Serialize + DeserializeOwned> Known<E> {
    /// The effects, off by so many standard deviations of one entry.
    fn off_by(&self, entry: &JointUncertainty, deviations: f64) -> Result<Vec<E>, Failure> {
        let moved = |(place, effect): (usize, &E)| {
            let own = entry.moves.iter().filter(|own| own.place() == Some(place));
            with_changed(effect, own.map(|own| (own.parameter.as_str(), |value: f64| value + deviations * own.by)))
        };
        self.effects.iter().enumerate().map(moved).collect()
    }

    /// What one standard deviation of every entry does to what is predicted with the effects.
    pub(in crate::diagnosis) fn columns(
        &self,
        predict: impl Fn(&[E]) -> Result<Vec<Prediction>, Failure>,
    ) -> Result<Vec<Vec<f64>>, Failure> {
        let column = |entry: &JointUncertainty| {
            let (below, above) = (predict(&self.off_by(entry, -STEP)?)?, predict(&self.off_by(entry, STEP)?)?);
            let slope = |pair: (&Prediction, &Prediction)| match pair {
                (Ok(below), Ok(above)) => (above - below) / (2.0 * STEP),
                _ => 0.0,
            };
            Ok(below.iter().zip(&above).map(slope).collect())
        };
        self.unsure.iter().map(column).collect()
    }
}

/// One standard deviation of something that is open.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::diagnosis) struct Direction {
    /// How far it moves values of settings, each by its setting and its variable.
    pub(in crate::diagnosis) of_settings: Vec<((usize, usize), f64)>,
    /// How far it moves the sizes of what has no name; empty where it moves none.
    pub(in crate::diagnosis) of_form: Vec<f64>,
}

impl Direction {
    /// What is believed, so many standard deviations along it.
    pub(in crate::diagnosis) fn moved(&self, believed: &Belief, deviations: f64) -> Belief {
        let mut moved = believed.clone();
        for ((member, variable), by) in &self.of_settings {
            moved.settings[*member].values[*variable] += deviations * by;
        }
        if let Some(form) = &mut moved.form {
            form.sizes.iter_mut().zip(&self.of_form).for_each(|(size, by)| *size += deviations * by);
        }
        moved
    }
}

/// An effect with other numbers in some of its fields.
pub(in crate::diagnosis) fn with_numbers<E: Serialize + DeserializeOwned>(
    effect: &E,
    numbers: impl Iterator<Item = (&'static str, f64)>,
) -> Option<E> {
    let mut fields = serde_json::to_value(effect).ok()?;
    for (name, number) in numbers {
        *fields.get_mut(name)? = number.into();
    }
    serde_json::from_value(fields).ok()
}

/// What independent directions leave open of the effects that are believed, in their own parameters. Where an effect
/// ends at a bound it is looked at from one side.
pub(in crate::diagnosis) fn left_open<E: Serialize>(
    believed: &Belief,
    directions: &[Direction],
    effects_of: impl Fn(&Belief) -> Result<Vec<E>, Failure>,
) -> Result<Vec<JointUncertainty>, Failure> {
    let numbers = |deviations: f64, direction: &Direction| {
        effects_of(&direction.moved(believed, deviations)).map(|effects| effects.iter().map(fields).collect::<Vec<_>>())
    };
    let mut open = Vec::new();
    for direction in directions {
        let (below, above, between) = match (numbers(-STEP, direction), numbers(STEP, direction)) {
            (Ok(below), Ok(above)) => (below, above, 2.0 * STEP),
            (Ok(below), Err(_)) => (below, numbers(0.0, direction)?, STEP),
            (Err(_), above) => (numbers(0.0, direction)?, above?, STEP),
        };
        open.extend(moved_between(&below, &above, between));
    }
    Ok(open)
}

/// How far the numbers of effects move with one standard deviation, where they were looked at so many of them apart; nothing where
/// none moves.
pub(crate) fn moves_between<E: Serialize>(below: &[E], above: &[E], apart: f64) -> Option<JointUncertainty> {
    let numbers = |effects: &[E]| effects.iter().map(fields).collect::<Vec<_>>();
    moved_between(&numbers(below), &numbers(above), apart)
}

fn moved_between(below: &[Vec<(String, f64)>], above: &[Vec<(String, f64)>], apart: f64) -> Option<JointUncertainty> {
    let mut moves = Vec::new();
    for (index, (below, above)) in below.iter().zip(above).enumerate() {
        for ((parameter, low), (_, high)) in below.iter().zip(above) {
            let turns = if parameter == PHASE { ((high - low) / TAU).round() } else { 0.0 };
            let by = (high - low - TAU * turns) / apart;
            if by.abs() > 0.0 {
                let effect = u32::try_from(index + 1).unwrap_or(u32::MAX);
                moves.push(ParameterMove { effect, parameter: parameter.clone(), by });
            }
        }
    }
    (!moves.is_empty()).then_some(JointUncertainty { moves })
}

/// Numbers of an effect by where they stand in it.
fn fields(effect: &impl Serialize) -> Vec<(String, f64)> {
    fn collect(value: &Value, name: &str, found: &mut Vec<(String, f64)>) {
        let inner = |own: &str| if name.is_empty() { own.to_owned() } else { format!("{name}/{own}") };
        match value {
            Value::Object(fields) => fields.iter().for_each(|(own, value)| collect(value, &inner(own), found)),
            Value::Array(list) => {
                list.iter().enumerate().for_each(|(index, value)| collect(value, &inner(&index.to_string()), found));
            }
            _ => found.extend(value.as_f64().filter(|_| value.is_f64()).map(|number| (name.to_owned(), number))),
        }
    }
    let mut found = Vec::new();
    collect(&serde_json::to_value(effect).unwrap_or_default(), "", &mut found);
    found
}

/// Independent directions of one standard deviation each of what the rows leave open of a set. What a grid of shapes widens is
/// wider here, too.
pub(in crate::diagnosis) fn directions(weighing: &Weighing<'_>, set: &SetWeight) -> Vec<Direction> {
    let deviations = &set.standard_deviations;
    let free: Vec<(usize, usize)> = (0..set.settings.len())
        .flat_map(|member| (0..deviations[member].len()).map(move |variable| (member, variable)))
        .filter(|&(member, variable)| deviations[member][variable] > 0.0)
        .collect();
    let deviation = |k: usize| deviations[free[k].0][free[k].1];
    let fit = weighing.fit(&set.members);
    let place = |k: usize| fit.and_then(|fit| fit.free.iter().position(|of| *of == free[k]));
    let correlation = |i: usize, j: usize| match (fit, place(i), place(j)) {
        _ if i == j => 1.0,
        (Some(fit), Some(a), Some(b)) => {
            let c = &fit.covariance;
            c[(a, b)] / (c[(a, a)] * c[(b, b)]).sqrt()
        }
        _ => 0.0,
    };
    let covariance = DMatrix::from_fn(free.len(), free.len(), |i, j| correlation(i, j) * deviation(i) * deviation(j));
    let alone = || DMatrix::from_fn(free.len(), free.len(), |i, j| if i == j { deviation(i) } else { 0.0 });
    let columns = Cholesky::new(covariance).map_or_else(alone, Cholesky::unpack);
    let direction = |of_settings| Direction { of_settings, of_form: Vec::new() };
    columns.column_iter().map(|column| direction(free.iter().copied().zip(column.iter().copied()).collect())).collect()
}
