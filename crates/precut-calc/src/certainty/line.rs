//! A line through independent scores: where along it limits are passed, and how probable it is that they are kept.

use crate::calculator::Failure;

use super::lines::{Margins, Together};
use super::normal_below;

/// Ends of a line: beyond them lies less than 1e-10.
const REACH: f64 = 6.5;
/// Intervals of a line at first.
const INTERVALS: usize = 13;
/// How closely a place is found at which a limit is passed.
const PLACE: f64 = 1e-4;
/// Most steps to a place.
const MOST_STEPS: usize = 24;

/// Beyond such a place of a line lies less than 1e-5: there a costly model is not asked.
const RARE: f64 = 4.5;
/// Half of the stretch of a line over which the slope of a near model is taken.
const SLOPE_STEP: f64 = 0.05;
/// Where a costly model passes a limit is looked for no farther from where the near one does than this, in so many steps, until a
/// step is this small: what is left then is the share of it by which the slope is off.
const NEAR_REACH: f64 = 1.5;
const NEAR_STEPS: usize = 6;
const NEAR_PLACE: f64 = 0.01;

/// Places along a line at which is looked first.
pub(super) fn places() -> impl Iterator<Item = f64> {
    let step = 2.0 * REACH / INTERVALS as f64;
    (0..=INTERVALS).map(move |index| step.mul_add(index as f64, -REACH))
}

/// Those of them beyond which lies less than 1e-5.
fn places_within() -> impl Iterator<Item = f64> {
    places().filter(|place| place.abs() <= RARE)
}

/// A line: which limits are kept between which places.
pub(super) struct Line<const K: usize> {
    /// Whether each is kept at the beginning.
    begins: [bool; K],
    /// Where each is passed, ascending.
    passed: [Vec<f64>; K],
}

impl<const K: usize> Line<K> {
    pub(super) fn scanned(margins: &mut dyn FnMut(f64) -> Result<Margins<K>, Failure>) -> Result<Self, Failure> {
        Self::scanned_at(&mut places(), margins)
    }

    /// The same without what is rare: beyond, limits are kept as they are at its beginning.
    pub(super) fn scanned_within(margins: &mut dyn FnMut(f64) -> Result<Margins<K>, Failure>) -> Result<Self, Failure> {
        Self::scanned_at(&mut places_within(), margins)
    }

    fn scanned_at(
        places: &mut dyn Iterator<Item = f64>,
        margins: &mut dyn FnMut(f64) -> Result<Margins<K>, Failure>,
    ) -> Result<Self, Failure> {
        let mut nodes = Vec::with_capacity(2 * INTERVALS);
        for place in places {
            nodes.push((place, margins(place)?));
        }
        // Between two nodes a limit may be kept that is passed at both.
        for limit in 0..K {
            for middle in (1..nodes.len() - 1).rev() {
                let [left, here, right] = [nodes[middle - 1], nodes[middle], nodes[middle + 1]];
                let [a, b, c] = [left.1[limit], here.1[limit], right.1[limit]];
                if b < 0.0 && a < 0.0 && c < 0.0 && b >= a && b >= c {
                    let place = vertex([left.0, here.0, right.0], [a, b, c]);
                    let at = if place < here.0 { middle } else { middle + 1 };
                    nodes.insert(at, (place, margins(place)?));
                }
            }
        }
        let mut passed: [Vec<f64>; K] = std::array::from_fn(|_| Vec::new());
        for pair in nodes.windows(2) {
            for (limit, places) in passed.iter_mut().enumerate() {
                let ends = [(pair[0].0, pair[0].1[limit]), (pair[1].0, pair[1].1[limit])];
                if (ends[0].1 >= 0.0) != (ends[1].1 >= 0.0) {
                    places.push(root(ends, &mut |place| Ok(margins(place)?[limit]))?);
                }
            }
        }
        Ok(Self { begins: nodes[0].1.map(|margin| margin >= 0.0), passed })
    }

    /// The same line of a model that is near: every place at which a limit is passed moves to where that model passes it. Where one is
    /// not found near, the whole line is scanned.
    pub(super) fn moved(
        mut self,
        real: &mut dyn FnMut(f64) -> Result<Margins<K>, Failure>,
        near: &mut dyn FnMut(f64) -> Result<Margins<K>, Failure>,
    ) -> Result<Self, Failure> {
        for limit in 0..K {
            for place in self.passed[limit].iter_mut().filter(|place| place.abs() < RARE) {
                let [before, after] = [near(*place - SLOPE_STEP)?[limit], near(*place + SLOPE_STEP)?[limit]];
                let slope = (after - before) / (2.0 * SLOPE_STEP);
                match near_root(*place, slope, &mut |place| Ok(real(place)?[limit]))? {
                    Some(moved) => *place = moved,
                    None => return Self::scanned(real),
                }
            }
            self.passed[limit].sort_by(f64::total_cmp);
        }
        Ok(self)
    }

    /// The probability that limits are kept together.
    pub(super) fn probability(&self, limits: Together) -> f64 {
        let mut kept = self.begins;
        let mut places: Vec<(f64, usize)> =
            limits.clone().flat_map(|limit| self.passed[limit].iter().map(move |&place| (place, limit))).collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let all = |kept: &[bool; K]| limits.clone().all(|limit| kept[limit]);
        let (mut from, mut sum) = (f64::NEG_INFINITY, 0.0);
        for (place, limit) in places {
            if all(&kept) {
                sum += between(from, place);
            }
            kept[limit] = !kept[limit];
            from = place;
        }
        if all(&kept) { sum + between(from, f64::INFINITY) } else { sum }
    }
}

/// Probability that a standard normal number lies between two: from the side on which the difference keeps its digits.
pub(super) fn between(from: f64, to: f64) -> f64 {
    if from > 0.0 { normal_below(-from) - normal_below(-to) } else { normal_below(to) - normal_below(from) }
}

/// Where the parabola through three points has its top, within them; the middle one where it has none.
fn vertex(x: [f64; 3], y: [f64; 3]) -> f64 {
    let (left, right) = (x[1] - x[0], x[2] - x[1]);
    let (down, up) = ((y[1] - y[0]) / left, (y[2] - y[1]) / right);
    let curvature = (up - down) / (left + right);
    let place = 0.5 * (x[0] + x[1]) - 0.5 * down / curvature;
    if place.is_finite() && place > x[0] && place < x[2] { place } else { x[1] }
}

/// Where a margin passes 0 between two places of different sign: false position with the weight of a stuck end halved
/// (Illinois).
fn root(ends: [(f64, f64); 2], margin: &mut dyn FnMut(f64) -> Result<f64, Failure>) -> Result<f64, Failure> {
    let [mut a, mut b] = ends;
    for _ in 0..MOST_STEPS {
        // An end without an answer is infinitely far from keeping the limit.
        let secant = (a.1 * b.0 - b.1 * a.0) / (a.1 - b.1);
        let place = if secant.is_finite() { secant } else { 0.5 * (a.0 + b.0) };
        if (b.0 - a.0).abs() < PLACE {
            return Ok(place);
        }
        let value = margin(place)?;
        if value.abs() <= 0.0 {
            return Ok(place);
        }
        if (value >= 0.0) == (b.1 >= 0.0) {
            let is_close = (place - b.0).abs() < PLACE;
            b = (place, value);
            a.1 *= 0.5;
            if is_close {
                return Ok(place);
            }
        } else {
            let is_close = (place - b.0).abs() < PLACE;
            a = b;
            b = (place, value);
            if is_close {
                return Ok(place);
            }
        }
    }
    Ok(b.0)
}

/// Where a margin passes 0 near a place, by secants that begin with a slope; `None` where that is not found.
fn near_root(
    place: f64,
    slope: f64,
    margin: &mut dyn FnMut(f64) -> Result<f64, Failure>,
) -> Result<Option<f64>, Failure> {
    let (mut from, mut slope) = ((place, margin(place)?), slope);
    for _ in 0..NEAR_STEPS {
        let step = -from.1 / slope;
        if !step.is_finite() || (from.0 + step - place).abs() > NEAR_REACH {
            return Ok(None);
        }
        let to = from.0 + step;
        if step.abs() < NEAR_PLACE {
            return Ok(Some(to));
        }
        let value = margin(to)?;
        slope = (value - from.1) / step;
        from = (to, value);
    }
    Ok(None)
}
