//! What no cause explains, found in rows as an effect over one or two conditions of the cut (`diagnosis/5.21`).

use crate::calculator::{Over, Unnamed};
use crate::effects::{MachinabilityEffect as Effect, RemainderPoint};
use crate::num::table::straight;

use crate::feed_schedule::job::remainder::{Known, over, width};
use crate::feed_schedule::measured::forward::{PreparedMachinability, Row};

/// Places of the table of an effect, at most.
const MOST_PLACES: usize = 128;

impl Row {
    /// Where it stands in a condition; `None` where it does not state it.
    pub(in crate::feed_schedule) fn place(&self, known: &Known) -> Option<f64> {
        let row = self;
        match known.name {
            "speed" => Some(row.u),
            "feed" => Some(row.x),
            "depth" => Some(row.depth_mm.ln()),
            "edge_angle" => row.angle_deg,
            "nose_radius" => row.nose_radius_mm,
            "flank_wear" => row.conditions.flank_wear_mm,
            _ => row.conditions.time_min,
        }
    }
}

impl PreparedMachinability {
    /// Remainders that act on this output.
    pub(in crate::feed_schedule) fn remainders<'a>(
        &'a self,
        held: &'a [Effect],
    ) -> impl Iterator<Item = (&'a str, f64, &'a [RemainderPoint])> {
        held.iter().filter(|effect| effect.output().is_none_or(|output| output == self.output)).filter_map(|effect| {
            match effect {
                Effect::Remainder { name, scale, profile, .. } => Some((name.as_str(), *scale, profile.as_slice())),
                _ => None,
            }
        })
    }

    /// What was found as an effect; what was known before over the same conditions is part of it, over all places of either.
    pub(in crate::feed_schedule) fn remainder(&self, held: &[Effect], found: &Unnamed<'_>) -> Option<Effect> {
        let known: Vec<&'static Known> =
            found.over.iter().map(|axis| Known::named(axis.name)).collect::<Option<_>>()?;
        let places = |(known, axis): (&&'static Known, &Over)| -> Option<Vec<f64>> {
            let all = self.rows.iter().map(|row| row.place(known)).collect::<Option<Vec<f64>>>()?;
            let (low, high) = (all.iter().copied().reduce(f64::min)?, all.iter().copied().reduce(f64::max)?);
            Some(axis.at.iter().map(|share| low + (high - low) * share).collect())
        };
        let places = known.iter().zip(found.over).map(places).collect::<Option<Vec<_>>>()?;
        let own = Grid { known: &known, places: &places };
        let shares = Grid { known: &known, places: &found.over.iter().map(|axis| axis.at.clone()).collect::<Vec<_>>() };
        let values: Vec<f64> = shares.pairs().map(|place| (found.size)(&place)).collect();
        let before = self
            .remainders(held)
            .find(|(_, _, profile)| over(profile).iter().map(|own| own.name).eq(known.iter().map(|own| own.name)));
        let (name, profile) = match before {
            None => (String::new(), own.points(&|place| own.at(place, &values))),
            Some((name, scale, profile)) => {
                let width = width(profile, &known);
                let of = |k: usize| -> Vec<f64> {
                    let along = if k == 0 {
                        profile.iter().step_by(width).collect::<Vec<_>>()
                    } else {
                        profile.iter().take(width).collect()
                    };
                    along.into_iter().map(|point| known[k].place(point)).collect()
                };
                let before: Vec<Vec<f64>> = (0..known.len()).map(of).collect();
                let before = Grid { known: &known, places: &before };
                let was: Vec<f64> = profile.iter().map(|point| scale * point.delta_ln).collect();
                let both = Grid { known: &known, places: &own.with(&before) };
                (name.to_owned(), both.points(&|place| own.at(place, &values) + before.at(place, &was)))
            }
        };
        Some(Effect::Remainder { name, scale: 1.0, profile, output: Some(self.output.clone()) })
    }
}

/// Places of one or two conditions.
struct Grid<'a> {
    known: &'a [&'static Known],
    places: &'a [Vec<f64>],
}

impl Grid<'_> {
    /// All places of the first with all of the second, those of the second first.
    fn pairs(&self) -> impl Iterator<Item = Vec<f64>> {
        let second = self.places.get(1);
        self.places[0].iter().flat_map(move |&first| match second {
            None => vec![vec![first]],
            Some(second) => second.iter().map(|&second| vec![first, second]).collect(),
        })
    }

    fn at(&self, place: &[f64], values: &[f64]) -> f64 {
        let asked = |k: usize| Some((self.places.get(k)?.as_slice(), *place.get(k)?));
        asked(0).map_or(0.0, |first| straight(first, asked(1), values).value)
    }

    fn points(&self, value: &dyn Fn(&[f64]) -> f64) -> Vec<RemainderPoint> {
        let point = |place: Vec<f64>| {
            let mut point = RemainderPoint { delta_ln: value(&place), ..RemainderPoint::default() };
            self.known.iter().zip(place).for_each(|(known, place)| (known.set)(&mut point, known.value(place)));
            point
        };
        self.pairs().map(point).collect()
    }

    /// The places of both, each once; its own alone with the ends of both where that were too many.
    fn with(&self, other: &Grid<'_>) -> Vec<Vec<f64>> {
        let joined = |more: &dyn Fn(&[f64]) -> Vec<f64>| -> Vec<Vec<f64>> {
            let of = |(own, other): (&Vec<f64>, &Vec<f64>)| {
                let mut all = [own.as_slice(), &more(other)].concat();
                all.sort_by(f64::total_cmp);
                let near = 1e-6 * (all[all.len() - 1] - all[0]);
                all.dedup_by(|a, b| (*a - *b).abs() <= near);
                all
            };
            self.places.iter().zip(other.places).map(of).collect()
        };
        let all = joined(&<[f64]>::to_vec);
        if all.iter().map(Vec::len).product::<usize>() <= MOST_PLACES {
            return all;
        }
        let ends = joined(&|other| vec![other[0], other[other.len() - 1]]);
        if ends.iter().map(Vec::len).product::<usize>() <= MOST_PLACES { ends } else { self.places.to_vec() }
    }
}
