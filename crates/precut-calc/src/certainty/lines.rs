//! The probability that limits are kept, exact along lines and by scrambled Sobol points across them (`certainty/3.2`).
//!
//! Independent scores are turned so that the first axis is the direction in which the limit that decides changes fastest.
//! Along a line in that direction every interval is found in which the limits are kept, and the probability of the line is a
//! sum of differences of the normal distribution function. What is left over the other directions is smooth: few points give
//! it, and small risks come out with a small relative error. Scrambled nets: A. Owen, Ann. Statist. 25 (1997) 1541-1562;
//! points by B. Burley, J. Comput. Graph. Tech. 9 (2020) no. 4.
//!
//! Most lines ask a model that is near the real one and costs little; what the real one makes of some of them is added as a
//! difference, so that the expectation is that of the real one alone (two levels of M. Giles, Oper. Res. 56 (2008) 607-617).

use std::ops::RangeInclusive;

use crate::calculator::{Failure, Monitor, checkpoint};

use super::line::{Line, places};
use super::normal_quantile;
use super::regression::slopes;

/// Independent scramblings; their spread is the error.
pub(crate) const SCRAMBLINGS: usize = 8;
/// Lines of a scrambling at first: of the near model, and of the real one.
const FIRST_LINES: [usize; 2] = [8, 2];
/// Lines of a scrambling at first, of the real model beside a near one that may be far off.
const FIRST_REGRESSED: usize = 4;
/// A probability no nearer to 0 or 1 than this is told without the far ends of lines.
const NOT_RARE: f64 = 0.002;
/// Points of a scrambling at which a model is asked at first that costs much.
const FIRST_POINTS: usize = 16;
/// Largest error, of the probability and relative to the smaller of it and its complement.
const LARGEST_ERROR: [f64; 2] = [0.002, 0.1];
/// Share of the error that the near model may take of itself.
const NEAR_SHARE: f64 = 0.5;
/// An error no larger than this times that of the near model comes of the lines alone.
const NEAR_IS_ALL: f64 = 1.2;
/// Most lines of a scrambling on which a costly model is asked.
const MOST_COSTLY: usize = 4;

/// By how much limits are kept, negative where one is not; infinite where there is none.
pub(crate) type Margins<const K: usize> = [f64; K];

/// Numbers of independent standard normal scores.
pub(crate) type Values<'a, const N: usize> = dyn FnMut(&[f64]) -> Result<[f64; N], Failure> + 'a;

/// The scores at a place of a line.
type PlacesOfLine<'a> = dyn Fn(f64) -> Vec<f64> + 'a;

/// A line of the real model, made with the near one.
type RealLine<'a, const K: usize> = dyn FnMut(&mut Values<'_, K>, &PlacesOfLine<'_>) -> Result<Line<K>, Failure> + 'a;

/// Limits that are kept together, by their places among the margins.
pub(crate) type Together = RangeInclusive<usize>;

/// A probability and twice its standard error over the scramblings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Estimate {
    pub probability: f64,
    pub error: f64,
}

impl Estimate {
    fn of(means: [f64; SCRAMBLINGS]) -> Self {
        let count = SCRAMBLINGS as f64;
        let mean = means.iter().sum::<f64>() / count;
        let variance = means.map(|one| (one - mean).powi(2)).iter().sum::<f64>() / (count - 1.0);
        Self { probability: mean.clamp(0.0, 1.0), error: 2.0 * (variance / count).sqrt() }
    }

    /// Whether its error takes no more than a share of what it may be.
    fn is_enough(self, share: f64) -> bool {
        let Self { probability, error } = self;
        error <= share * LARGEST_ERROR[0].min(LARGEST_ERROR[1] * probability.min(1.0 - probability))
    }
}

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Found<const S: usize> {
    /// The probability of every set of limits.
    pub of: [Estimate; S],
    /// Lines on which the real model was asked.
    pub lines: usize,
}

/// How far to go.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    pub seed: u32,
    /// Most lines of one scrambling; a power of two.
    pub most_lines: usize,
}

/// Where and of what probabilities are wanted: lines along `axis`, sets of limits of which the last decides how far to go.
pub(crate) struct Question<'a, const S: usize> {
    pub axis: &'a [f64],
    pub sets: [Together; S],
    pub effort: Effort,
    pub monitor: &'a dyn Monitor,
}

impl<const S: usize> Question<'_, S> {
    /// The probabilities by the margins of one model alone.
    pub(crate) fn of<const K: usize>(&self, margins: &mut Values<'_, K>) -> Result<Found<S>, Failure> {
        let mut lines = Lines::of(self);
        lines.until(1.0, margins)?;
        Ok(lines.found(lines.done()))
    }

    /// The probabilities by the real model, asked on no more than `most_real` lines of a scrambling; most lines are those of one that is
    /// near.
    pub(crate) fn of_real<const K: usize>(
        &self,
        most_real: usize,
        real: &mut Values<'_, K>,
        near: &mut Values<'_, K>,
    ) -> Result<Found<S>, Failure> {
        self.of_both(most_real, near, &mut |_, at| Line::scanned(&mut |place| real(&at(place))))
    }

    /// The same beside a near model that may be far off. Of what that says of every set on a line so much counts as tells of the real model on
    /// the lines of the other scramblings (control variates by regression): where it tells nothing it does no harm, and the expectation is
    /// that of the real model all the same.
    pub(crate) fn of_regressed<const K: usize>(
        &self,
        most_real: usize,
        real: &mut Values<'_, K>,
        near: &mut Values<'_, K>,
    ) -> Result<Found<S>, Failure> {
        let mut nearly = Lines::of(self);
        nearly.until(NEAR_SHARE, near)?;
        let mut really = Lines::of(self);
        let most = most_real.min(nearly.done());
        let about = nearly.found(nearly.done()).of[S - 1].probability;
        let is_rare = about.min(1.0 - about) < NOT_RARE;
        let mut count = FIRST_REGRESSED.min(most);
        loop {
            really.extend_by(count, &mut |at| {
                let mut margins = |place: f64| real(&at(place));
                if is_rare { Line::scanned(&mut margins) } else { Line::scanned_within(&mut margins) }
            })?;
            let found = Found {
                of: std::array::from_fn(|set| Estimate::of(regressed(&nearly, &really, set))),
                lines: SCRAMBLINGS * count,
            };
            if found.of[S - 1].is_enough(1.0) || count >= most {
                return Ok(found);
            }
            count = (2 * count).min(most);
        }
    }

    /// The same of a real model that costs much. On its lines it is asked only near the places where the near model passes a limit: it
    /// is taken to pass each limit as often as that does, as two models do that differ by little.
    pub(crate) fn of_costly<const K: usize>(
        &self,
        real: &mut Values<'_, K>,
        near: &mut Values<'_, K>,
    ) -> Result<Found<S>, Failure> {
        self.of_both(MOST_COSTLY, near, &mut |near, at| {
            let mut nearly = |place: f64| near(&at(place));
            let line = Line::scanned(&mut nearly)?;
            line.moved(&mut |place| real(&at(place)), &mut nearly)
        })
    }

    /// Most lines by the near model; `line` makes some of them by the real one, `most` of a scrambling.
    fn of_both<const K: usize>(
        &self,
        most: usize,
        near: &mut Values<'_, K>,
        line: &mut RealLine<'_, K>,
    ) -> Result<Found<S>, Failure> {
        let mut nearly = Lines::of(self);
        nearly.until(NEAR_SHARE, near)?;
        let near_error = nearly.found(nearly.done()).of[S - 1].error;
        let mut really = Lines::of(self);
        let most = most.min(nearly.done());
        let mut count = FIRST_LINES[1].min(most);
        loop {
            really.extend_by(count, &mut |at| line(near, at))?;
            let found = Found {
                of: std::array::from_fn(|set| {
                    let (all, asked, more) =
                        (nearly.means(set, nearly.done()), really.means(set, count), nearly.means(set, count));
                    Estimate::of(std::array::from_fn(|one| all[one] + asked[one] - more[one]))
                }),
                lines: SCRAMBLINGS * count,
            };
            let last = found.of[S - 1];
            // More lines of the real model would not lower an error that both models share.
            if last.is_enough(1.0) || last.error <= NEAR_IS_ALL * near_error || count >= most {
                return Ok(found);
            }
            count = (2 * count).min(most);
        }
    }
}

/// Probabilities of lines, by scrambling.
struct Lines<'a, const S: usize> {
    question: &'a Question<'a, S>,
    frame: Frame,
    most: usize,
    of: [Vec<[f64; S]>; SCRAMBLINGS],
}

impl<'a, const S: usize> Lines<'a, S> {
    fn of(question: &'a Question<'a, S>) -> Self {
        let frame = Frame::along(question.axis);
        let most = if frame.is_a_line() { 1 } else { question.effort.most_lines };
        Self { question, frame, most, of: std::array::from_fn(|_| Vec::new()) }
    }

    fn done(&self) -> usize {
        self.of[0].len()
    }

    /// Asks up to so many lines of every scrambling.
    fn extend<const K: usize>(&mut self, count: usize, margins: &mut Values<'_, K>) -> Result<(), Failure> {
        self.extend_by(count, &mut |at| Line::scanned(&mut |place| margins(&at(place))))
    }

    fn extend_by<const K: usize>(
        &mut self,
        count: usize,
        line: &mut dyn FnMut(&PlacesOfLine<'_>) -> Result<Line<K>, Failure>,
    ) -> Result<(), Failure> {
        let Question { sets, effort, monitor, .. } = self.question;
        for (scrambling, lines) in self.of.iter_mut().enumerate() {
            for index in lines.len()..count {
                checkpoint(*monitor)?;
                let start = self.frame.across(index, effort.scrambled(scrambling));
                let line = line(&|place| self.frame.at(&start, place))?;
                lines.push(sets.clone().map(|set| line.probability(set)));
            }
        }
        Ok(())
    }

    /// Asks lines until the last set is known to a share of the largest error.
    fn until<const K: usize>(&mut self, share: f64, margins: &mut Values<'_, K>) -> Result<(), Failure> {
        let mut count = FIRST_LINES[0].min(self.most);
        loop {
            self.extend(count, margins)?;
            if self.found(count).of[S - 1].is_enough(share) || count >= self.most {
                return Ok(());
            }
            count = (2 * count).min(self.most);
        }
    }

    /// Means of a set over the first lines of every scrambling.
    fn means(&self, set: usize, count: usize) -> [f64; SCRAMBLINGS] {
        std::array::from_fn(|one| self.of[one][..count].iter().map(|line| line[set]).sum::<f64>() / count.max(1) as f64)
    }

    /// Means of all sets over the first lines of a scrambling.
    fn means_of(&self, scrambling: usize, count: usize) -> [f64; S] {
        let lines = &self.of[scrambling][..count];
        std::array::from_fn(|set| lines.iter().map(|line| line[set]).sum::<f64>() / count.max(1) as f64)
    }

    fn found(&self, count: usize) -> Found<S> {
        let of = std::array::from_fn(|set| Estimate::of(self.means(set, count)));
        Found { of, lines: SCRAMBLINGS * count }
    }
}

/// Means of a set by the real model over its lines of every scrambling, moved by what the near model is off on the same lines.
fn regressed<const S: usize>(nearly: &Lines<'_, S>, really: &Lines<'_, S>, set: usize) -> [f64; SCRAMBLINGS] {
    let count = really.done();
    let means = really.means(set, count);
    // Of limits that do not go together a set changes with each of them as with a factor.
    let mean = |lines: &Lines<'_, S>, set: usize| lines.found(lines.done()).of[set].probability;
    let whole = mean(nearly, S - 1);
    let expected = std::array::from_fn(|k| match (set == S - 1, k == S - 1) {
        (true, false) => whole / mean(nearly, k).max(NOT_RARE),
        (false, _) if k == set => 1.0,
        _ => 0.0,
    });
    std::array::from_fn(|own| {
        let others = (0..SCRAMBLINGS).filter(|one| *one != own);
        let lines = others.flat_map(|one| nearly.of[one][..count].iter().zip(&really.of[one]));
        let by = slopes(&lines.map(|(near, real)| (*near, real[set])).collect::<Vec<_>>(), expected);
        let [all, asked] = [nearly.done(), count].map(|count| nearly.means_of(own, count));
        means[own] + (0..S).map(|k| by[k] * (all[k] - asked[k])).sum::<f64>()
    })
}

impl Effort {
    #[allow(clippy::cast_possible_truncation)] // fewer than ten
    fn scrambled(self, scrambling: usize) -> u32 {
        self.seed.wrapping_mul(SCRAMBLINGS as u32).wrapping_add(scrambling as u32)
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
            for index in 0..FIRST_LINES[0].min(effort.most_lines) {
                checkpoint(monitor)?;
                let start = frame.across(index, effort.scrambled(scrambling));
                let node = |place: f64| Ok((place, values(&frame.at(&start, place))?));
                lines.push(places().map(node).collect::<Result<Vec<_>, Failure>>()?);
            }
        }
        Ok(Self { lines })
    }

    /// The probability of every set of limits, by `margins` of the values.
    pub(crate) fn kept<const K: usize, const S: usize>(
        &self,
        sets: &[Together; S],
        margins: &dyn Fn([f64; N]) -> Margins<K>,
    ) -> Result<[f64; S], Failure> {
        let mut sums = [0.0; S];
        for nodes in &self.lines {
            let line = Line::scanned(&mut |place| Ok(margins(between_nodes(nodes, place))))?;
            for (sum, set) in sums.iter_mut().zip(sets) {
                *sum += line.probability(set.clone());
            }
        }
        Ok(sums.map(|sum| sum / self.lines.len().max(1) as f64))
    }
}

/// A model that costs much, asked at scattered points; what they tell is corrected by what a near model, which is known on all
/// lines, is off at the same points (`certainty/7.1`).
pub(crate) struct Sampled {
    /// Margins by the real model, by scrambling.
    points: [Vec<(Vec<f64>, f64)>; SCRAMBLINGS],
}

/// Margins of the real model at many points at once.
pub(crate) type Real<'a> = dyn FnMut(&[Vec<f64>]) -> Result<Vec<f64>, Failure> + 'a;

/// The margin by a near model.
pub(crate) type NearMargin<'a> = dyn Fn(&[f64]) -> f64 + 'a;

/// The probability that the margin of a near model is above a number.
pub(crate) type NearlyKept<'a> = dyn Fn(f64) -> Result<f64, Failure> + 'a;

impl Sampled {
    /// Up to `most` points of every scrambling, twice as many until the margin is kept with a probability that is known to `enough`.
    pub(crate) fn until(
        (enough, most): (f64, usize),
        (dimensions, effort): (usize, Effort),
        (near, nearly): (&NearMargin<'_>, &NearlyKept<'_>),
        real: &mut Real<'_>,
    ) -> Result<Self, Failure> {
        let mut sampled = Self { points: std::array::from_fn(|_| Vec::new()) };
        let mut count = FIRST_POINTS.min(most);
        loop {
            let mut asked = Vec::new();
            for (scrambling, known) in sampled.points.iter().enumerate() {
                asked.extend(points(count, dimensions, effort.scrambled(scrambling)).skip(known.len()));
            }
            let margins = real(&asked)?;
            let more = count - sampled.points[0].len();
            for (known, some) in
                sampled.points.iter_mut().zip(asked.into_iter().zip(margins).collect::<Vec<_>>().chunks(more))
            {
                known.extend_from_slice(some);
            }
            if sampled.kept(0.0, near, nearly)?.error <= enough || count >= most {
                return Ok(sampled);
            }
            count = (2 * count).min(most);
        }
    }

    /// The probability that the margin is above `least`; `nearly` is that of the near model.
    pub(crate) fn kept(&self, least: f64, near: &NearMargin<'_>, nearly: &NearlyKept<'_>) -> Result<Estimate, Failure> {
        let is = |kept: bool| f64::from(u8::from(kept));
        let both: Vec<Vec<(f64, f64)>> = self
            .points
            .iter()
            .map(|own| own.iter().map(|(g, margin)| (is(*margin >= least), is(near(g) >= least))).collect())
            .collect();
        let all: Vec<(f64, f64)> = both.iter().flatten().copied().collect();
        let count = all.len().max(1) as f64;
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| all.iter().map(of).sum::<f64>() / count;
        let (real, nearby, together) = (mean(&|one| one.0), mean(&|one| one.1), mean(&|one| one.0 * one.1));
        // As much of the correction as lowers the scatter most.
        let variance = nearby * (1.0 - nearby);
        let share = if variance > 0.0 { ((together - real * nearby) / variance).clamp(0.0, 1.0) } else { 0.0 };
        let exact = if share > 0.0 { nearly(least)? } else { 0.0 };
        let means = std::array::from_fn(|one| {
            let own = &both[one];
            own.iter().map(|(real, near)| real + share * (exact - near)).sum::<f64>() / own.len().max(1) as f64
        });
        // Where no point of so few was otherwise than expected one of the next may be (Laplace's rule).
        let expected = |near: f64| if share > 0.0 { near } else { real.round() };
        let otherwise = all.iter().filter(|(real, near)| (real - expected(*near)).abs() > 0.5).count();
        let chance = (otherwise as f64 + 1.0) / (count + 2.0);
        let found = Estimate::of(means);
        Ok(Estimate { error: found.error.max(2.0 * (chance * (1.0 - chance) / count).sqrt()), ..found })
    }

    /// How often the real model was asked.
    pub(crate) fn asked(&self) -> usize {
        self.points.iter().map(Vec::len).sum()
    }

    /// Variance of what the real margin is off the near one.
    pub(crate) fn variance_off(&self, near: &NearMargin<'_>) -> f64 {
        let off: Vec<f64> = self.points.iter().flatten().map(|(g, margin)| margin - near(g)).collect();
        let mean = off.iter().sum::<f64>() / off.len().max(1) as f64;
        off.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / off.len().max(1) as f64
    }
}

fn between_nodes<const N: usize>(nodes: &[(f64, [f64; N])], place: f64) -> [f64; N] {
    let after = nodes.partition_point(|node| node.0 <= place).clamp(1, nodes.len() - 1);
    let [(from, before), (to, behind)] = [nodes[after - 1], nodes[after]];
    let share = (place - from) / (to - from);
    std::array::from_fn(|index| before[index] + share * (behind[index] - before[index]))
}

/// So many points of independent standard normal scores, evenly scattered.
pub(crate) fn points(count: usize, dimensions: usize, seed: u32) -> impl Iterator<Item = Vec<f64>> {
    (0..count).map(move |index| (0..).take(dimensions).map(|dimension| score(index, dimension, seed)).collect())
}

/// The score of a point of a scrambled Sobol sequence.
#[allow(clippy::cast_possible_truncation)] // far fewer than 2^32
fn score(index: usize, dimension: u32, seed: u32) -> f64 {
    let index = index as u32;
    let sample = f64::from(sobol_burley::sample(index, dimension, seed));
    // In the middle of the cells of a number of 24 bits: never 0.
    normal_quantile(sample + 0.5 / f64::from(1 << 24))
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
            axis.iter_mut().take(1).for_each(|first| *first = 1.0);
        }
        let mut mirror = axis.clone();
        mirror.iter_mut().take(1).for_each(|first| *first -= 1.0);
        Self { axis, mirror }
    }

    /// Whether there is nothing across the axis.
    fn is_a_line(&self) -> bool {
        self.axis.len() <= 1
    }

    /// Where the line of that index crosses the plane across the axis.
    fn across(&self, index: usize, seed: u32) -> Vec<f64> {
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::line::between;
    use super::super::normal_below;
    use super::*;
    use crate::calculator::Unwatched;

    const EFFORT: Effort = Effort { seed: 1, most_lines: 256 };

    /// Probabilities of every limit and, last, of all.
    fn found<const K: usize>(axis: &[f64], mut margins: impl FnMut(&[f64]) -> Margins<K>) -> Found<2> {
        let question = Question { axis, sets: [0..=0, 0..=K - 1], effort: EFFORT, monitor: &Unwatched };
        question.of(&mut |g| Ok(margins(g))).unwrap()
    }

    #[test]
    fn a_plane_has_the_probability_of_its_distance() {
        for distance in [-1.0, 0.5, 3.5] {
            let found = found(&[3.0, 4.0, 0.0], |g| [distance - (0.6 * g[0] + 0.8 * g[1])]);
            let risk = normal_below(-distance);
            assert!((1.0 - found.of[1].probability - risk).abs() < 1e-5 * risk.max(1e-4), "{found:?}");
        }
    }

    #[test]
    fn a_wrong_axis_gives_the_same_with_a_larger_error() {
        let exact = normal_below(1.0) - normal_below(-0.5);
        let found = found(&[1.0, 0.2], |g| {
            let x = 0.6 * g[0] + 0.8 * g[1];
            [1.0 - x, x + 0.5]
        });
        assert!((found.of[1].probability - exact).abs() < 2.0 * found.of[1].error + 1e-4, "{found:?} {exact}");
        assert!((found.of[0].probability - normal_below(1.0)).abs() < 2.0 * found.of[0].error + 1e-4);
    }

    #[test]
    fn a_disk_is_found_between_the_nodes() {
        // Inside a circle of radius r: 1 - exp(-r²/2); the smaller one lies between two nodes of every line.
        for radius in [2.0_f64, 0.3] {
            let found = found(&[1.0, 0.0], |g| [radius * radius - g[0] * g[0] - g[1] * g[1]]);
            let exact = -(-0.5 * radius * radius).exp_m1();
            assert!((found.of[1].probability - exact).abs() < 2.0 * found.of[1].error + 1e-4, "{found:?} {exact}");
        }
    }

    #[test]
    fn the_real_model_alone_decides() {
        // The near model is a plane that is somewhat off; the real one is bent.
        let real = |g: &[f64]| [1.0 - g[0] - 0.1 * g[1] * g[1] + 0.2 * g[2]];
        let question = Question { axis: &[1.0, 0.0, -0.2], sets: [0..=0], effort: EFFORT, monitor: &Unwatched };
        let alone = question.of(&mut |g| Ok(real(g))).unwrap();
        for offset in [0.0, 0.5, -3.0] {
            let beside =
                question.of_real(256, &mut |g| Ok(real(g)), &mut |g| Ok([1.0 + offset - g[0] + 0.2 * g[2]])).unwrap();
            let [alone, beside] = [alone.of[0], beside.of[0]];
            let error = alone.error.hypot(beside.error);
            assert!((alone.probability - beside.probability).abs() < 1.5 * error + 1e-5, "{alone:?} {beside:?}");
        }
    }

    #[test]
    fn a_costly_model_is_asked_little_and_decides_alone() {
        // The near model has another curvature, and is somewhat off.
        let real = |g: &[f64]| [1.0 - g[0] - 0.1 * g[1] * g[1] + 0.05 * g[0] * g[0], 2.0 + g[0] + 0.1 * g[1]];
        let near = |g: &[f64]| [1.1 - 1.05 * g[0] - 0.08 * g[1] * g[1], 2.1 + 0.95 * g[0]];
        let question = Question { axis: &[1.0, 0.1], sets: [0..=0, 0..=1], effort: EFFORT, monitor: &Unwatched };
        let alone = question.of(&mut |g| Ok(real(g))).unwrap();
        let mut asked = 0;
        let mut counted = |g: &[f64]| {
            asked += 1;
            Ok(real(g))
        };
        let beside = question.of_costly(&mut counted, &mut |g| Ok(near(g))).unwrap();
        for (alone, beside) in alone.of.into_iter().zip(beside.of) {
            let error = alone.error.hypot(beside.error);
            assert!((alone.probability - beside.probability).abs() < 1.5 * error + 2e-4, "{alone:?} {beside:?}");
        }
        // Two limits on a line, each found in three steps.
        assert!(asked <= 6 * beside.lines, "{asked} {}", beside.lines);
    }

    #[test]
    fn a_model_that_is_right_leaves_few_lines_to_the_real_one() {
        let plane = |g: &[f64]| [1.0 - 0.6 * g[0] - 0.8 * g[1]];
        let question = Question { axis: &[3.0, 4.0], sets: [0..=0], effort: EFFORT, monitor: &Unwatched };
        let found = question.of_real(256, &mut |g| Ok(plane(g)), &mut |g| Ok(plane(g))).unwrap();
        assert_eq!(found.lines, SCRAMBLINGS * FIRST_LINES[1]);
    }

    #[test]
    fn a_near_model_that_is_far_off_does_no_harm() {
        // The real model has a second limit that the near one has elsewhere, and bends.
        let real = |g: &[f64]| [1.0 - g[0] - 0.1 * g[1] * g[1], 4.0 + g[1] + 0.2 * g[2]];
        let near = |g: &[f64]| [1.0 - g[0], 0.5 + g[2] - g[1]];
        let question = Question { axis: &[1.0, 0.0, 0.0], sets: [0..=0, 0..=1], effort: EFFORT, monitor: &Unwatched };
        let alone = question.of(&mut |g| Ok(real(g))).unwrap();
        let found = question.of_regressed(32, &mut |g| Ok(real(g)), &mut |g| Ok(near(g))).unwrap();
        let added = question.of_real(32, &mut |g| Ok(real(g)), &mut |g| Ok(near(g))).unwrap();
        for (alone, found) in alone.of.into_iter().zip(found.of) {
            let error = alone.error.hypot(found.error);
            assert!((alone.probability - found.probability).abs() < 1.5 * error + 1e-4, "{alone:?} {found:?}");
        }
        assert!(found.of[1].error < 0.3 * added.of[1].error, "{found:?} {added:?}");
    }

    #[test]
    fn one_quantity_is_one_line() {
        let found = found(&[-2.0], |g| [1.0 + g[0], 2.0 - g[0] * g[0]]);
        let exact = between(-1.0, std::f64::consts::SQRT_2);
        assert!((found.of[1].probability - exact).abs() < 1e-6, "{found:?}");
    }
}
