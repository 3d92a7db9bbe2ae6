//! What no cause explains as a term of the extended model, where the model has an effect for it (`diagnosis/3.8`).

use crate::calculator::{Design, Failure, Over, Smooth};
use crate::diagnosis::causes::ranking::SetWeight;
use crate::diagnosis::causes::subject::{Basis, Belief, Form, digit};
use crate::diagnosis::model::known::Direction;
use crate::diagnosis::statistics::discrepancy::{Kind, OfBasis, OfEffect, Remainder};
use crate::diagnosis::verdict::judge::{UNNAMED, Verdict};
use crate::diagnosis::verdict::weigh::Weighing;
use crate::num::table::straight;

/// Places between which the term is straight, along a part or over a condition: the fewest of these ...
const PLACES: [usize; 4] = [9, 17, 33, 65];
/// ... and over each of two conditions ...
const PLACES_OF_EACH: [usize; 4] = [5, 7, 9, 11];
/// ... that miss it by less than this share of the scatter, root mean square.
const MISSED: f64 = 0.05;
/// Places at which that is looked at, evenly; of each of two conditions.
const LOOKED_AT: usize = 260;
const LOOKED_AT_OF_EACH: usize = 40;

/// A set of causes with a remainder that the model has an effect for, beside what `kind` makes of the rows.
pub(in crate::diagnosis) struct Term<'a> {
    weighing: &'a Weighing<'a>,
    pub(in crate::diagnosis) set: &'a SetWeight,
    remainder: &'a Remainder,
    kind: &'a Kind,
    effect: &'a OfEffect,
}

impl<'a> Term<'a> {
    /// Where something acts that has no name: the heaviest set with a remainder, if the model has an effect for that.
    pub(in crate::diagnosis) fn of(weighing: &'a Weighing<'a>) -> Option<Self> {
        if !matches!(weighing.verdict, Verdict::Unknown(_)) || weighing.unnamed < UNNAMED {
            return None;
        }
        let set = weighing.sets.iter().find(|set| set.remainder.is_some())?;
        let remainder = set.remainder.as_ref()?;
        let kind = &weighing.kinds[remainder.kind];
        // What a set leaves open beside it is known of its fit.
        let is_fitted = set.members.is_empty() || weighing.fit(&set.members).is_some();
        let effect = kind.effect.as_ref().filter(|_| is_fitted)?;
        Some(Self { weighing, set, remainder, kind, effect })
    }

    /// What is predicted of every row, linear in the remainder.
    pub(in crate::diagnosis) fn prediction(&self) -> Result<Vec<f64>, Failure> {
        let foundation = self.weighing.foundation;
        let with = foundation.subject.predict(&self.set.settings)?;
        let mut predicted: Vec<f64> =
            with.iter().zip(&foundation.base).map(|(with, base)| with.unwrap_or(*base)).collect();
        for (column, amplitude) in self.kind.columns.iter().zip(&self.remainder.amplitudes) {
            column.add_to(&mut predicted, *amplitude);
        }
        Ok(predicted)
    }

    /// The causes beside it, and the remainder over the places that were measured.
    pub(in crate::diagnosis) fn belief(&self) -> Option<Belief> {
        let sizes = self.remainder.amplitudes.iter().map(|amplitude| amplitude / self.effect.per_unit).collect();
        let form = match &self.effect.basis {
            OfBasis::Waves(orders) => self.of_waves(orders, sizes)?,
            OfBasis::Levels(group) => self.of_levels(group, sizes)?,
        };
        Some(Belief { settings: self.set.settings.clone(), form: Some(form) })
    }

    fn of_waves(&self, orders: &[usize], sizes: Vec<f64>) -> Option<Form> {
        let design = &self.weighing.foundation.data.layout.design;
        let mut ends = Vec::with_capacity(orders.len());
        for &name in &self.effect.over {
            let place = places(design, name)?;
            let kept = || place.iter().zip(&self.weighing.keep).filter(|(_, keep)| **keep).map(|(u, _)| *u);
            let (from, to) = (kept().fold(1.0, f64::min), kept().fold(0.0, f64::max));
            ends.push((name, from, to));
            if to <= from {
                return None;
            }
        }
        let over = |places: usize| -> Vec<Over> {
            let at = |from: f64, to: f64| even(places).map(|share| from + (to - from) * share).collect();
            ends.iter().map(|&(name, from, to)| Over { name, at: at(from, to) }).collect()
        };
        let tried = if ends.len() == 1 { PLACES } else { PLACES_OF_EACH };
        let mut form = Form { over: over(tried[3]), basis: Basis::Waves(orders.to_vec()), sizes };
        let least = MISSED * self.weighing.noise.sigma / self.effect.per_unit.abs();
        for places in tried {
            form.over = over(places);
            if missed(&form) < least {
                break;
            }
        }
        Some(form)
    }

    fn of_levels(&self, group: &[usize], sizes: Vec<f64>) -> Option<Form> {
        let (design, keep) = (&self.weighing.foundation.data.layout.design, &self.weighing.keep);
        let conditions = self.effect.over.iter().map(|name| design.conditions.iter().find(|own| own.name == *name));
        let conditions = conditions.collect::<Option<Vec<_>>>()?;
        let over = conditions.iter().map(|own| Over { name: own.name, at: own.values(|row| keep[row]) });
        let over: Vec<Over> = over.collect();
        let mut levels = vec![None; over.iter().map(|axis| axis.at.len()).product()];
        for row in (0..keep.len()).filter(|&row| keep[row]) {
            let index = over.iter().zip(&conditions).fold(0, |index, (axis, own)| {
                // The place of a value is the last that is not above it.
                index * axis.at.len() + axis.at.partition_point(|at| *at <= own.place[row]).saturating_sub(1)
            });
            levels[index] = Some(group[row]);
        }
        Some(Form { over, basis: Basis::Levels(levels), sizes })
    }

    /// Independent directions of one standard deviation each of what the rows leave open of [`Self::belief`].
    pub(in crate::diagnosis) fn directions(&self) -> Vec<Direction> {
        let fit = self.weighing.fit(&self.set.members);
        let of = |direction: &Vec<f64>| {
            let (of_causes, of_form) = direction.split_at(self.remainder.of_causes.len());
            let of_settings = fit.map_or_else(Vec::new, |fit| {
                let value = |(member, variable): (usize, usize)| self.set.settings[member].values[variable];
                let free = fit.free.iter().zip(&fit.coordinates).zip(of_causes);
                free.map(|((place, coordinate), t)| (*place, t * coordinate.slope(value(*place)))).collect()
            });
            Direction { of_settings, of_form: of_form.iter().map(|size| size / self.effect.per_unit).collect() }
        };
        self.remainder.directions.iter().map(of).collect()
    }

    /// What each of [`Self::directions`] does to the rows.
    pub(in crate::diagnosis) fn on_rows(&self) -> Vec<Vec<f64>> {
        let fit = self.weighing.fit(&self.set.members);
        let rows = self.weighing.keep.len();
        let of = |direction: &Vec<f64>, own: Direction| {
            let mut column = vec![0.0; rows];
            for (column_of_kind, size) in self.kind.columns.iter().zip(&direction[self.remainder.of_causes.len()..]) {
                column_of_kind.add_to(&mut column, *size);
            }
            let slopes = fit.map_or(&[][..], |fit| fit.slopes.as_slice());
            for ((_, by), slope) in own.of_settings.iter().zip(slopes) {
                column.iter_mut().zip(slope).for_each(|(sum, slope)| *sum += by * slope);
            }
            column
        };
        self.remainder.directions.iter().zip(self.directions()).map(|(direction, own)| of(direction, own)).collect()
    }

    /// Standard deviation of a measured row about the prediction.
    pub(in crate::diagnosis) fn deviation(&self) -> Vec<f64> {
        let columns = self.on_rows();
        let open = |row: usize| columns.iter().map(|column| column[row] * column[row]).sum::<f64>();
        (0..self.weighing.keep.len()).map(|row| (self.weighing.own_variance(row) + open(row)).sqrt()).collect()
    }
}

/// Where every row stands in what something goes with.
fn places<'a>(design: &'a Design, name: &str) -> Option<&'a [f64]> {
    match &design.smooth {
        Smooth::Along(place) if name == Over::ALONG => Some(place),
        _ => design.conditions.iter().find(|own| own.name == name).map(|own| own.place.as_slice()),
    }
}

/// So many shares from 0 to 1.
fn even(count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| k as f64 / (count - 1) as f64)
}

/// By how much straight lines between the places of its axes miss it, root mean square.
fn missed(form: &Form) -> f64 {
    let axes = &form.over;
    let counts: Vec<usize> = axes.iter().map(|axis| axis.at.len()).collect();
    let at_places = (0..counts.iter().product()).map(|index| {
        let place: Vec<f64> = axes.iter().enumerate().map(|(k, axis)| axis.at[digit(index, &counts, k)]).collect();
        form.at(&place)
    });
    let values: Vec<f64> = at_places.collect();
    let looked_at = vec![1 + if axes.len() == 1 { LOOKED_AT } else { LOOKED_AT_OF_EACH }; axes.len()];
    let count: usize = looked_at.iter().product();
    let squares = (0..count).map(|index| {
        let share = |k: usize| digit(index, &looked_at, k) as f64 / (looked_at[k] - 1) as f64;
        let at = |k: usize, axis: &Over| axis.at[0] + (axis.at[axis.at.len() - 1] - axis.at[0]) * share(k);
        let place: Vec<f64> = axes.iter().enumerate().map(|(k, axis)| at(k, axis)).collect();
        let asked = |k: usize| axes.get(k).map(|axis| (axis.at.as_slice(), place[k]));
        let between = asked(0).map_or(0.0, |first| straight(first, asked(1), &values).value);
        (form.at(&place) - between).powi(2)
    });
    (squares.sum::<f64>() / count as f64).sqrt()
}
