//! The least and the largest probability while some quantities are anywhere within bounds (`certainty/1.2`).
//!
//! The search evaluates the middle, and the ends of every quantity with all others in the middle. From the best of these it goes to
//! the best of the three places of every quantity until none is better, once for the least and once for the most, and evaluates a
//! tenth before the ends that it found. A probability that rises or falls all along on each of these lines has its extremes at the
//! ends. Where it turns, a golden section goes on from the places that were found.

use crate::calculator::Failure;

use super::quantities::Within;
use super::{Contribution, IntervalSearch, Quantity, Uncertainties, bounded};

/// Changes of a probability that may be the error of its numbers.
const ALIKE: f64 = 0.004;
/// How far out it is looked whether a probability turns before the end, and a change on the same lines that tells it.
const BEFORE_END: f64 = 0.9;
const EVEN: f64 = 1e-5;
/// Most rounds over all quantities.
const ROUNDS: usize = 4;
/// Steps of a golden section over a quantity: to a fortieth of its interval.
const STEPS: usize = 8;

/// The probability while quantities are held at places between -1 and 1.
type At<'a> = dyn FnMut(&[f64]) -> Result<f64, Failure> + 'a;

/// Where it is least and most.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Extremes {
    pub least: Vec<f64>,
    pub most: Vec<f64>,
    pub search: IntervalSearch,
}

impl<Q: Quantity> Uncertainties<Q> {
    /// Where a probability is least and most within the bounds; `None` where every quantity has a distribution.
    pub(crate) fn extremes(
        &self,
        at: &mut dyn FnMut(&Self) -> Result<f64, Failure>,
    ) -> Result<Option<Extremes>, Failure> {
        let count = self.within.len();
        if count == 0 {
            return Ok(None);
        }
        extremes(count, &mut |places| at(&self.held(places))).map(Some)
    }

    /// What each quantity between bounds adds to the doubt: the probability (`at`) with half of its interval, all others where they
    /// are held. Quantities of one name count as one.
    pub(crate) fn contributions_within(
        &self,
        probability: f64,
        at: &mut dyn FnMut(&Self) -> Result<f64, Failure>,
    ) -> Result<Vec<Contribution>, Failure> {
        if self.within.is_empty() {
            return Ok(Vec::new());
        }
        let (places, now) = (self.places(), at(self)?);
        let mut all: Vec<Contribution> = Vec::new();
        for one in &self.within {
            let is_own = |other: &Within<Q>| other.of.quantity.name() == one.of.quantity.name();
            if all.iter().any(|told| told.quantity == one.of.quantity.name()) {
                continue;
            }
            let half = |(place, other): (&f64, &Within<Q>)| if is_own(other) { place.clamp(-0.5, 0.5) } else { *place };
            let halved: Vec<f64> = places.iter().zip(&self.within).map(half).collect();
            all.push(Contribution::within(&one.of, bounded(probability + at(&self.held(&halved))? - now)));
        }
        Ok(all)
    }
}

/// The places that were evaluated.
struct Looked<'a, 'f> {
    at: &'a mut At<'f>,
    known: Vec<(Vec<f64>, f64)>,
    /// Whether the probability rose, and whether it fell, with each quantity.
    turns: Vec<[bool; 2]>,
}

/// The extremes over `count` quantities, which is not 0.
fn extremes(count: usize, at: &mut At<'_>) -> Result<Extremes, Failure> {
    let mut looked = Looked { at, known: Vec::new(), turns: vec![[false; 2]; count] };
    let middle = vec![0.0; count];
    for index in 0..count {
        looked.along(&middle, index)?;
    }
    let mut ends = Vec::new();
    for sign in [-1.0, 1.0] {
        let best = looked.best(sign);
        let guess = (0..count).map(|index| looked.end(&middle, index, sign)).collect::<Result<Vec<f64>, Failure>>()?;
        let mut place = if sign * looked.of(&guess)? > sign * looked.of(&best)? { guess } else { best };
        for _ in 0..ROUNDS {
            let before = place.clone();
            for index in 0..count {
                let [low, here, high] = looked.along(&place, index)?;
                let best = [(-1.0, low), (1.0, high)]
                    .into_iter()
                    .fold((place[index], here), |best, end| if sign * end.1 > sign * best.1 { end } else { best });
                place[index] = best.0;
            }
            if place == before {
                break;
            }
        }
        let best = looked.best(sign);
        for index in 0..count {
            looked.before_the_end(&best, index, sign)?;
        }
        ends.push(best);
    }
    let is_monotone = looked.turns.iter().all(|turns| *turns != [true; 2]);
    if !is_monotone {
        for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
            for start in [end.clone(), middle.clone()] {
                looked.climb(start, sign)?;
            }
            *end = looked.best(sign);
        }
    }
    let [least, most] = <[Vec<f64>; 2]>::try_from(ends).unwrap_or_else(|_| [middle.clone(), middle]);
    let search = if is_monotone { IntervalSearch::Ends } else { IntervalSearch::MultiStart };
    Ok(Extremes { least, most, search })
}

impl Looked<'_, '_> {
    fn of(&mut self, place: &[f64]) -> Result<f64, Failure> {
        let is_here = |known: &&(Vec<f64>, f64)| known.0.iter().zip(place).all(|(a, b)| (a - b).abs() < 1e-9);
        if let Some((_, probability)) = self.known.iter().find(is_here) {
            return Ok(*probability);
        }
        let probability = (self.at)(place)?;
        self.known.push((place.to_vec(), probability));
        Ok(probability)
    }

    fn with(&mut self, place: &[f64], index: usize, own: f64) -> Result<f64, Failure> {
        let mut moved = place.to_vec();
        moved[index] = own;
        self.of(&moved)
    }

    /// With one quantity at its lower end, where the place has it, and at its upper end; sees whether it turns between.
    fn along(&mut self, place: &[f64], index: usize) -> Result<[f64; 3], Failure> {
        let [low, middle, high] =
            [self.with(place, index, -1.0)?, self.with(place, index, 0.0)?, self.with(place, index, 1.0)?];
        for (from, to) in [(low, middle), (middle, high)] {
            self.turns[index][0] |= to - from > ALIKE;
            self.turns[index][1] |= from - to > ALIKE;
        }
        Ok([low, self.of(place)?, high])
    }

    /// Sees whether the probability turns before the end of a quantity, where a place is the best so far.
    fn before_the_end(&mut self, place: &[f64], index: usize, sign: f64) -> Result<(), Failure> {
        let is_before = sign * self.with(place, index, BEFORE_END * place[index])? > sign * self.of(place)? + EVEN;
        if is_before {
            self.turns[index] = [true; 2];
        }
        Ok(())
    }

    /// The end of a quantity at which the probability is larger (`sign` 1) or smaller.
    fn end(&mut self, place: &[f64], index: usize, sign: f64) -> Result<f64, Failure> {
        let [low, _, high] = self.along(place, index)?;
        Ok(if sign * high >= sign * low { 1.0 } else { -1.0 })
    }

    /// The place with the largest (`sign` 1) or smallest probability so far.
    fn best(&self, sign: f64) -> Vec<f64> {
        let order = |a: &&(Vec<f64>, f64), b: &&(Vec<f64>, f64)| (sign * a.1).total_cmp(&(sign * b.1));
        self.known.iter().max_by(order).map_or_else(Vec::new, |(place, _)| place.clone())
    }

    /// Goes to a largest or smallest probability, along one quantity after the other.
    fn climb(&mut self, mut place: Vec<f64>, sign: f64) -> Result<(), Failure> {
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        for index in 0..place.len() {
            let [low, here, high] = [self.with(&place, index, -1.0)?, self.of(&place)?, self.with(&place, index, 1.0)?];
            let mut best = (place[index], here);
            for end in [(-1.0, low), (1.0, high)] {
                best = if sign * end.1 > sign * best.1 { end } else { best };
            }
            let (mut from, mut to) = (f64::max(best.0 - 1.0, -1.0), f64::min(best.0 + 1.0, 1.0));
            let mut inner = (to - golden * (to - from), 0.0);
            let mut outer = (from + golden * (to - from), 0.0);
            inner.1 = self.with(&place, index, inner.0)?;
            outer.1 = self.with(&place, index, outer.0)?;
            for _ in 0..STEPS {
                if sign * inner.1 >= sign * outer.1 {
                    (to, outer) = (outer.0, inner);
                    inner.0 = to - golden * (to - from);
                    inner.1 = self.with(&place, index, inner.0)?;
                } else {
                    (from, inner) = (inner.0, outer);
                    outer.0 = from + golden * (to - from);
                    outer.1 = self.with(&place, index, outer.0)?;
                }
            }
            for found in [inner, outer] {
                best = if sign * found.1 > sign * best.1 { found } else { best };
            }
            place[index] = best.0;
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn what_rises_and_falls_all_along_has_its_extremes_at_the_ends() {
        let mut asked = 0;
        let found = extremes(3, &mut |x| {
            asked += 1;
            Ok(0.5 + 0.2 * x[0] - 0.1 * x[1] * (1.0 + 0.3 * x[0]) + 0.05 * x[2])
        })
        .unwrap();
        assert_eq!(found.search, IntervalSearch::Ends);
        assert_eq!((found.least, found.most), (vec![-1.0, 1.0, -1.0], vec![1.0, -1.0, 1.0]));
        assert!(asked <= 27, "{asked}");
    }

    #[test]
    fn what_turns_is_searched_within() {
        // Most at (0.3, 1), least at the far corner; a saddle in the middle of nothing.
        let found = extremes(2, &mut |x| Ok(0.6 - 0.4 * (x[0] - 0.3).powi(2) + 0.1 * x[1])).unwrap();
        assert_eq!(found.search, IntervalSearch::MultiStart);
        assert!((found.most[0] - 0.3).abs() < 0.05 && (found.most[1] - 1.0).abs() < 1e-9, "{found:?}");
        assert_eq!(found.least, vec![-1.0, -1.0]);
    }
}
