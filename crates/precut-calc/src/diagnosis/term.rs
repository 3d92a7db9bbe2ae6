//! What no cause explains as a term of the extended model, where the model has an effect for it (`diagnosis/3.8`).

use super::basis::cosine;
use super::discrepancy::{Kind, Remainder};
use super::known::Direction;
use super::subject::{Belief, Waves};
use super::weigh::{SetWeight, UNNAMED, Verdict, Weighing};
use crate::calculator::{Failure, Smooth};

/// Places between which the term is straight: the fewest of these ...
const PLACES: [usize; 4] = [9, 17, 33, 65];
/// ... that miss it by less than this share of the scatter, root mean square.
const MISSED: f64 = 0.05;
/// Places at which that is looked at, evenly.
const LOOKED_AT: usize = 260;

/// A set of causes with a remainder that the model has an effect for, beside what `kind` makes of the rows.
pub(super) struct Term<'a> {
    weighing: &'a Weighing<'a>,
    pub(super) set: &'a SetWeight,
    remainder: &'a Remainder,
    kind: &'a Kind,
    /// What one unit of the effect does to the rows.
    per_unit: f64,
}

impl<'a> Term<'a> {
    /// Where something acts that has no name: the heaviest set with a remainder, if the model has an effect for that.
    pub(super) fn of(weighing: &'a Weighing<'a>) -> Option<Self> {
        if !matches!(weighing.verdict, Verdict::Unknown(_)) || weighing.unnamed < UNNAMED {
            return None;
        }
        let set = weighing.sets.iter().find(|set| set.remainder.is_some())?;
        let remainder = set.remainder.as_ref()?;
        let kind = &weighing.kinds[remainder.kind];
        // What a set leaves open beside it is known of its fit.
        let is_fitted = set.members.is_empty() || weighing.fit(&set.members).is_some();
        let per_unit = kind.per_unit.filter(|_| is_fitted)?;
        Some(Self { weighing, set, remainder, kind, per_unit })
    }

    /// What is predicted of every row, linear in the remainder.
    pub(super) fn prediction(&self) -> Result<Vec<f64>, Failure> {
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
    pub(super) fn belief(&self) -> Option<Belief> {
        let Smooth::Along(place) = &self.weighing.foundation.data.layout.design.smooth else { return None };
        let kept = || place.iter().zip(&self.weighing.keep).filter(|(_, keep)| **keep).map(|(u, _)| *u);
        let ends = [kept().fold(1.0, f64::min), kept().fold(0.0, f64::max)];
        let sizes = self.remainder.amplitudes.iter().map(|amplitude| amplitude / self.per_unit).collect();
        let mut waves = Waves { ends, sizes, places: 2 };
        if ends[1] <= ends[0] {
            return None;
        }
        let least = MISSED * self.weighing.noise.sigma / self.per_unit.abs();
        waves.places = PLACES.into_iter().find(|&places| missed(&waves, places) < least).unwrap_or(PLACES[3]);
        Some(Belief { settings: self.set.settings.clone(), waves: Some(waves) })
    }

    /// Independent directions of one standard deviation each of what the rows leave open of [`Self::belief`].
    pub(super) fn directions(&self) -> Vec<Direction> {
        let fit = self.weighing.fit(&self.set.members);
        let of = |direction: &Vec<f64>| {
            let (of_causes, of_waves) = direction.split_at(self.remainder.of_causes.len());
            let of_settings = fit.map_or_else(Vec::new, |fit| {
                let value = |(member, variable): (usize, usize)| self.set.settings[member].values[variable];
                let free = fit.free.iter().zip(&fit.coordinates).zip(of_causes);
                free.map(|((place, coordinate), t)| (*place, t * coordinate.slope(value(*place)))).collect()
            });
            Direction { of_settings, of_waves: of_waves.iter().map(|size| size / self.per_unit).collect() }
        };
        self.remainder.directions.iter().map(of).collect()
    }

    /// What each of [`Self::directions`] does to the rows.
    pub(super) fn on_rows(&self) -> Vec<Vec<f64>> {
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
    pub(super) fn deviation(&self) -> Vec<f64> {
        let columns = self.on_rows();
        let open = |row: usize| columns.iter().map(|column| column[row] * column[row]).sum::<f64>();
        (0..self.weighing.keep.len()).map(|row| (self.weighing.own_variance(row) + open(row)).sqrt()).collect()
    }
}

/// By how much the waves are missed by straight lines between so many places, root mean square.
fn missed(waves: &Waves, places: usize) -> f64 {
    let [from, to] = waves.ends;
    let place = |share: f64| from + (to - from) * share;
    let at: Vec<f64> = (0..places).map(|k| waves.at(place(k as f64 / (places - 1) as f64))).collect();
    let squares = (0..=LOOKED_AT).map(|k| {
        let share = k as f64 / LOOKED_AT as f64;
        let along = share * (places - 1) as f64;
        let before = (0..places - 1).rev().find(|&k| k as f64 <= along).unwrap_or(0);
        let straight = at[before] + (along - before as f64) * (at[before + 1] - at[before]);
        (waves.at(place(share)) - straight).powi(2)
    });
    (squares.sum::<f64>() / (LOOKED_AT + 1) as f64).sqrt()
}

impl Waves {
    /// The size at a place, a share of the length.
    pub(super) fn at(&self, place: f64) -> f64 {
        self.sizes.iter().enumerate().map(|(order, size)| size * cosine(order, place)).sum()
    }
}
