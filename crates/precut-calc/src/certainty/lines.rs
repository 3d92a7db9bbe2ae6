//! The probability that limits are kept, exact along lines and by scrambled Sobol points across them (`certainty/3.2`).
//!
//! Independent scores are turned so that the first axis is the direction in which the limit that decides changes fastest.
//! Along a line in that direction every interval is found in which the limits are kept, and the probability of the line is a
//! sum of differences of the normal distribution function. What is left over the other directions is smooth: few points give
//! it, and small risks come out with a small relative error. Scrambled nets: A. Owen, Ann. Statist. 25 (1997) 1541-1562;
//! points by B. Burley, J. Comput. Graph. Tech. 9 (2020) no. 4.

use crate::calculator::{Failure, Monitor, checkpoint};

use super::{normal_below, normal_quantile};

/// Independent scramblings; their spread is the error.
const SCRAMBLINGS: u32 = 8;
/// Lines of a scrambling at first.
const FIRST_LINES: u32 = 8;
/// Ends of a line: beyond them lies less than 1e-10.
const REACH: f64 = 6.5;
/// Intervals of a line at first.
const INTERVALS: usize = 13;
/// How closely a place is found at which a limit is passed.
const PLACE: f64 = 1e-5;
/// Most steps to a place.
const MOST_STEPS: usize = 24;

/// By how much limits are kept, negative where one is not; infinite where there is none.
pub(crate) type Margins<const K: usize> = [f64; K];

/// Numbers of independent standard normal scores.
pub(crate) type Values<'a, const N: usize> = dyn FnMut(&[f64]) -> Result<[f64; N], Failure> + 'a;

/// A probability and twice its standard error over the scramblings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Estimate {
    pub probability: f64,
    pub error: f64,
}

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Found<const K: usize> {
    /// Of every limit alone.
    pub each: [Estimate; K],
    /// Of all together.
    pub joint: Estimate,
    pub lines: u32,
}

/// How far to go.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    pub seed: u32,
    /// Most lines of one scrambling; a power of two.
    pub most_lines: u32,
}

impl Effort {
    fn scrambled(self, scrambling: u32) -> u32 {
        self.seed.wrapping_mul(SCRAMBLINGS).wrapping_add(scrambling)
    }
}

/// Values along the first lines of every scrambling, straight between the nodes: what is asked of them again and again costs
/// nothing more, and is right to the curvature of the values over one standard deviation.
pub(crate) struct Sketch<const N: usize> {
    lines: Vec<Vec<(f64, [f64; N])>>,
}

impl<const N: usize> Sketch<N> {
    /// Of `values` of independent standard normal scores, lines along `axis`.
    pub(crate) fn of(
        axis: &[f64],
        effort: Effort,
        monitor: &dyn Monitor,
        values: &mut Values<'_, N>,
    ) -> Result<Self, Failure> {
        let frame = Frame::along(axis);
        let mut lines = Vec::new();
        for scrambling in 0..SCRAMBLINGS {
            for index in 0..FIRST_LINES.min(effort.most_lines) {
                checkpoint(monitor)?;
                let start = frame.across(index, effort.scrambled(scrambling));
                let node = |place: f64| Ok((place, values(&frame.at(&start, place))?));
                lines.push(places().map(node).collect::<Result<Vec<_>, Failure>>()?);
            }
        }
        Ok(Self { lines })
    }

    /// The probability that each limit is kept, and that all are, by `margins` of the values.
    pub(crate) fn kept<const K: usize>(
        &self,
        margins: &dyn Fn([f64; N]) -> Margins<K>,
    ) -> Result<([f64; K], f64), Failure> {
        let mut sums = ([0.0; K], 0.0);
        for nodes in &self.lines {
            let line = Line::scanned(&mut |place| Ok(margins(between_nodes(nodes, place))))?;
            for (limit, sum) in sums.0.iter_mut().enumerate() {
                *sum += line.probability(limit..=limit);
            }
            sums.1 += line.probability(0..=K - 1);
        }
        let count = self.lines.len().max(1) as f64;
        Ok((sums.0.map(|sum| sum / count), sums.1 / count))
    }
}

/// Places along a line at which is looked first.
fn places() -> impl Iterator<Item = f64> {
    let step = 2.0 * REACH / INTERVALS as f64;
    (0..=INTERVALS).map(move |index| step.mul_add(index as f64, -REACH))
}

fn between_nodes<const N: usize>(nodes: &[(f64, [f64; N])], place: f64) -> [f64; N] {
    let after = nodes.partition_point(|node| node.0 <= place).clamp(1, nodes.len() - 1);
    let [(from, before), (to, behind)] = [nodes[after - 1], nodes[after]];
    let share = (place - from) / (to - from);
    std::array::from_fn(|index| before[index] + share * (behind[index] - before[index]))
}

/// The probability that all limits are kept: `margins` of independent standard normal scores, lines along `axis`.
pub(crate) fn integrate<const K: usize>(
    axis: &[f64],
    effort: Effort,
    monitor: &dyn Monitor,
    margins: &mut Values<'_, K>,
) -> Result<Found<K>, Failure> {
    let frame = Frame::along(axis);
    let most_lines = if frame.is_a_line() { 1 } else { effort.most_lines };
    let mut sums = [[0.0; 2]; SCRAMBLINGS as usize].map(|_| (vec![0.0; K], 0.0));
    let (mut done, mut wanted) = (0, FIRST_LINES.min(most_lines));
    loop {
        for (scrambling, (each, joint)) in (0..SCRAMBLINGS).zip(&mut sums) {
            for index in done..wanted {
                checkpoint(monitor)?;
                let start = frame.across(index, effort.scrambled(scrambling));
                let line = Line::scanned(&mut |place| margins(&frame.at(&start, place)))?;
                for (limit, sum) in each.iter_mut().enumerate() {
                    *sum += line.probability(limit..=limit);
                }
                *joint += line.probability(0..=K - 1);
            }
        }
        done = wanted;
        let found = Found {
            each: std::array::from_fn(|limit| estimate(sums.iter().map(|(each, _)| each[limit] / f64::from(done)))),
            joint: estimate(sums.iter().map(|(_, joint)| joint / f64::from(done))),
            lines: SCRAMBLINGS * done,
        };
        let Estimate { probability, error } = found.joint;
        let is_enough = error <= f64::min(0.002, 0.1 * probability.min(1.0 - probability));
        if is_enough || done >= most_lines {
            return Ok(found);
        }
        wanted = (2 * done).min(most_lines);
    }
}

/// So many points of independent standard normal scores, evenly scattered.
pub(crate) fn points(count: u32, dimensions: usize, seed: u32) -> impl Iterator<Item = Vec<f64>> {
    (0..count).map(move |index| (0..).take(dimensions).map(|dimension| score(index, dimension, seed)).collect())
}

/// The score of a point of a scrambled Sobol sequence.
fn score(index: u32, dimension: u32, seed: u32) -> f64 {
    let sample = f64::from(sobol_burley::sample(index, dimension, seed));
    // In the middle of the cells of a number of 24 bits: never 0.
    normal_quantile(sample + 0.5 / f64::from(1 << 24))
}

fn estimate(means: impl Iterator<Item = f64> + Clone) -> Estimate {
    let count = f64::from(SCRAMBLINGS);
    let mean = means.clone().sum::<f64>() / count;
    let variance = means.map(|one| (one - mean).powi(2)).sum::<f64>() / (count - 1.0);
    Estimate { probability: mean.clamp(0.0, 1.0), error: 2.0 * (variance / count).sqrt() }
}

/// An orthonormal frame whose first axis is given: the reflection that takes the first unit vector there.
struct Frame {
    axis: Vec<f64>,
    /// The reflection is 1 - 2 v v'/v'v.
    mirror: Vec<f64>,
}

impl Frame {
    fn along(axis: &[f64]) -> Self {
        let length = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
        let mut axis: Vec<f64> = axis.iter().map(|a| a / length).collect();
        if length.is_nan() || length <= 0.0 {
            axis.fill(0.0);
            axis[0] = 1.0;
        }
        let mut mirror = axis.clone();
        mirror[0] -= 1.0;
        Self { axis, mirror }
    }

    /// Whether there is nothing across the axis.
    fn is_a_line(&self) -> bool {
        self.axis.len() == 1
    }

    /// Where the line of that index crosses the plane across the axis.
    fn across(&self, index: u32, seed: u32) -> Vec<f64> {
        let mut point = vec![0.0; self.axis.len()];
        for (dimension, place) in (0..).zip(point.iter_mut().skip(1)) {
            *place = score(index, dimension, seed);
        }
        let size: f64 = self.mirror.iter().map(|v| v * v).sum();
        if size > 0.0 {
            let along: f64 = self.mirror.iter().zip(&point).map(|(v, p)| v * p).sum();
            for (place, v) in point.iter_mut().zip(&self.mirror) {
                *place -= 2.0 * along / size * v;
            }
        }
        point
    }

    fn at(&self, start: &[f64], place: f64) -> Vec<f64> {
        start.iter().zip(&self.axis).map(|(start, axis)| start + place * axis).collect()
    }
}

/// A line: which limits are kept between which places.
struct Line<const K: usize> {
    /// Whether each is kept at the beginning.
    begins: [bool; K],
    /// Where each is passed, ascending.
    passed: [Vec<f64>; K],
}

impl<const K: usize> Line<K> {
    fn scanned(margins: &mut dyn FnMut(f64) -> Result<Margins<K>, Failure>) -> Result<Self, Failure> {
        let mut nodes = Vec::with_capacity(2 * INTERVALS);
        for place in places() {
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

    /// The probability that limits are kept together.
    fn probability(&self, limits: std::ops::RangeInclusive<usize>) -> f64 {
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
fn between(from: f64, to: f64) -> f64 {
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::calculator::Unwatched;

    const EFFORT: Effort = Effort { seed: 1, most_lines: 256 };

    fn found<const K: usize>(axis: &[f64], mut margins: impl FnMut(&[f64]) -> Margins<K>) -> Found<K> {
        integrate(axis, EFFORT, &Unwatched, &mut |g| Ok(margins(g))).unwrap()
    }

    #[test]
    fn a_plane_has_the_probability_of_its_distance() {
        for distance in [-1.0, 0.5, 3.5] {
            let found = found(&[3.0, 4.0, 0.0], |g| [distance - (0.6 * g[0] + 0.8 * g[1])]);
            let risk = normal_below(-distance);
            assert!((1.0 - found.joint.probability - risk).abs() < 1e-5 * risk.max(1e-4), "{found:?}");
        }
    }

    #[test]
    fn a_wrong_axis_gives_the_same_with_a_larger_error() {
        let exact = normal_below(1.0) - normal_below(-0.5);
        let found = found(&[1.0, 0.2], |g| {
            let x = 0.6 * g[0] + 0.8 * g[1];
            [1.0 - x, x + 0.5]
        });
        assert!((found.joint.probability - exact).abs() < 2.0 * found.joint.error + 1e-4, "{found:?} {exact}");
        assert!((found.each[0].probability - normal_below(1.0)).abs() < 2.0 * found.each[0].error + 1e-4);
    }

    #[test]
    fn a_disk_is_found_between_the_nodes() {
        // Inside a circle of radius r: 1 - exp(-r²/2); the smaller one lies between two nodes of every line.
        for radius in [2.0_f64, 0.3] {
            let found = found(&[1.0, 0.0], |g| [radius * radius - g[0] * g[0] - g[1] * g[1]]);
            let exact = -(-0.5 * radius * radius).exp_m1();
            assert!((found.joint.probability - exact).abs() < 2.0 * found.joint.error + 1e-4, "{found:?} {exact}");
        }
    }

    #[test]
    fn one_quantity_is_one_line() {
        let found = found(&[-2.0], |g| [1.0 + g[0], 2.0 - g[0] * g[0]]);
        let exact = between(-1.0, std::f64::consts::SQRT_2);
        assert!((found.joint.probability - exact).abs() < 1e-6, "{found:?}");
    }
}
