//! How probable it is that several limits are kept, where all quantities are factors: a response surface about the stated values,
//! lines through it, and the real model on some of them (`certainty/3.2`).

use crate::calculator::{Failure, Monitor};

use super::lines::{Effort, Found, Margins, Question, Together, points};
use super::{Contribution, Quantity, Surface, Uncertain, Uncertainties, bounded};

/// A margin beyond this, of a logarithm, is as good as without end.
const FAR: f64 = 50.0;

/// Draws by which it is seen which limits are passed, steps to each side over a quantity in standard deviations, and the share of a
/// limit's variance by which the response surface may be off over one.
const TRIED: usize = 64;
const STEPS: i32 = 5;
const STEP: f64 = 0.5;
const ASTRAY: f64 = 0.05;

/// A margin as it may be counted with.
pub(crate) fn far(margin: f64) -> f64 {
    margin.clamp(-FAR, FAR)
}

/// The real model: by how much limits are kept, as logarithms, at what quantities come to.
pub(crate) type Real<'a, const K: usize> = dyn Fn(&[f64]) -> Result<Margins<K>, Failure> + 'a;

/// What is uncertain, and of what limits the probability is asked.
pub(crate) struct Asked<'a, Q, const K: usize, const S: usize> {
    pub uncertainties: &'a Uncertainties<Q>,
    /// Which of the limits there are.
    pub limits: &'a [usize],
    /// Sets of limits of which the probability is asked; the last one is all.
    pub sets: [Together; S],
    pub seed: u32,
    /// Most lines of one scrambling: of the response surface, and of the real model.
    pub most_lines: [usize; 2],
    pub monitor: &'a dyn Monitor,
    pub real: &'a Real<'a, K>,
}

/// The same with a response surface about the stated values.
pub(crate) struct Around<'a, Q, const K: usize, const S: usize> {
    asked: Asked<'a, Q, K, S>,
    surface: Surface,
    /// Median of every factor, and the standard deviation of its logarithm.
    scales: Vec<(f64, f64)>,
    /// Change of every limit with every independent score.
    slopes: Vec<Vec<f64>>,
    /// How far away the limits are by them, in standard deviations.
    distances: Vec<f64>,
    /// Along which limits change together, each as much as it is near.
    axis: Vec<f64>,
}

impl<'a, Q: Quantity, const K: usize, const S: usize> Around<'a, Q, K, S> {
    /// Quantities between bounds are held where they are.
    pub(crate) fn of(asked: Asked<'a, Q, K, S>) -> Result<Self, Failure> {
        let scale = |one: &Uncertain<Q>| 0.5 * (one.distribution.at(1.0) / one.distribution.at(-1.0)).ln();
        let scales: Vec<(f64, f64)> =
            asked.uncertainties.of.iter().map(|one| (one.distribution.at(0.0), scale(one))).collect();
        let surface = Surface::of(&vec![true; asked.uncertainties.count()], &mut |x| {
            // Effects are off by multiples of their standard deviation.
            let value = |i: usize| scales.get(i).map_or(x[i], |(median, scale)| median * (scale * x[i]).exp());
            let margins = asked.tried(&(0..x.len()).map(value).collect::<Vec<_>>())?;
            Ok(asked.limits.iter().map(|&limit| margins[limit].max(-FAR)).collect())
        })?;
        let mut around = Self { asked, surface, scales, slopes: Vec::new(), distances: Vec::new(), axis: Vec::new() };
        around.set_slopes();
        Ok(around)
    }

    /// Margins by the response surface; infinite where there is no limit.
    fn near(&self, of: &Uncertainties<Q>, independent: &[f64], is_bent: bool) -> Margins<K> {
        let x = |(i, value): (usize, f64)| {
            self.scales.get(i).map_or(value, |(median, scale)| (value / median).ln() / scale)
        };
        let x: Vec<f64> = of.values(independent).into_iter().enumerate().map(x).collect();
        let found = if is_bent { self.surface.at(&x) } else { self.surface.linear_at(&x) };
        let mut margins = [f64::INFINITY; K];
        self.asked.limits.iter().zip(found).for_each(|(&limit, margin)| margins[limit] = margin);
        margins
    }

    /// Sets how the limits change with independent scores, and how far away they are by that.
    fn set_slopes(&mut self) {
        let count = self.asked.uncertainties.dimensions();
        let uncertainties = self.asked.uncertainties;
        let change = |index: usize, limit: usize| {
            let at = |score: f64| {
                let mut independent = vec![0.0; count];
                independent[index] = score;
                self.near(uncertainties, &independent, true)[limit]
            };
            at(0.5) - at(-0.5)
        };
        let slopes: Vec<Vec<f64>> =
            self.asked.limits.iter().map(|&limit| (0..count).map(|index| change(index, limit)).collect()).collect();
        let lengths: Vec<f64> =
            slopes.iter().map(|of| of.iter().map(|s| s * s).sum::<f64>().sqrt().max(1e-12)).collect();
        let distances: Vec<f64> =
            self.surface.at_point().iter().zip(&lengths).map(|(margin, length)| margin / length).collect();
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        // A limit that lies across the lines would leave a step from line to line; one that is far away does not matter.
        let weight = |limit: usize| {
            let beyond = distances[limit] - nearest.max(0.0);
            (-0.5 * beyond * beyond).exp() / lengths[limit]
        };
        let along = |index: usize| (0..slopes.len()).map(|limit| weight(limit) * slopes[limit][index]).sum();
        self.axis = (0..count).map(along).collect();
        (self.slopes, self.distances) = (slopes, distances);
    }

    /// Along which the lines of the real model run. Where a limit that is passed changes otherwise than the response surface says, over the
    /// quantity over which it does so most: all of that then lies along the lines. Elsewhere as limits change together.
    fn along(&self) -> Result<Vec<f64>, Failure> {
        let of = self.asked.uncertainties;
        let count = of.dimensions();
        let at = |scores: &[f64]| -> Result<Vec<f64>, Failure> {
            let margins = self.asked.tried(&of.values(scores))?;
            Ok(self.asked.limits.iter().map(|&limit| margins[limit].max(-FAR)).collect())
        };
        let drawn =
            points(TRIED, count, self.asked.seed).map(|scores| at(&scores)).collect::<Result<Vec<_>, Failure>>()?;
        let variance = |limit: usize| {
            let mean = drawn.iter().map(|one| one[limit]).sum::<f64>() / TRIED as f64;
            drawn.iter().map(|one| (one[limit] - mean).powi(2)).sum::<f64>() / TRIED as f64
        };
        let is_passed = |limit: &usize| drawn.iter().any(|one| one[*limit] < 0.0);
        let passed: Vec<usize> = (0..self.asked.limits.len()).filter(is_passed).collect();
        let mut axis = self.axis.clone();
        let mut largest = ASTRAY;
        for score in (0..count).filter(|_| !passed.is_empty() && count > 1) {
            let mut off = vec![0.0; self.asked.limits.len()];
            for step in -STEPS..=STEPS {
                let mut scores = vec![0.0; count];
                scores[score] = STEP * f64::from(step);
                let density = (-0.5 * scores[score] * scores[score]).exp() / (2.0 * std::f64::consts::PI).sqrt();
                let near = self.near(of, &scores, true);
                for ((off, real), limit) in off.iter_mut().zip(at(&scores)?).zip(self.asked.limits) {
                    *off += STEP * density * (real - near[*limit]).powi(2);
                }
            }
            let share =
                passed.iter().map(|&limit| off[limit] / variance(limit).max(f64::MIN_POSITIVE)).fold(0.0, f64::max);
            if share > largest {
                largest = share;
                axis = (0..count).map(|other| f64::from(u8::from(other == score))).collect();
            }
        }
        Ok(axis)
    }

    fn question(&self, most_lines: usize) -> Question<'_, S> {
        let effort = Effort { seed: self.asked.seed, most_lines };
        Question { axis: &self.axis, sets: self.asked.sets.clone(), effort, monitor: self.asked.monitor }
    }

    /// The probability of every set; that of a single limit is no less than that of all, which decides how far to go.
    pub(crate) fn found(&self) -> Result<Found<S>, Failure> {
        let of = self.asked.uncertainties;
        let [most, most_real] = self.asked.most_lines;
        let mut real = |g: &[f64]| self.asked.tried(&of.values(g));
        let near = &mut |g: &[f64]| Ok(self.near(of, g, true));
        let axis = self.along()?;
        let mut found = Question { axis: &axis, ..self.question(most) }.of_regressed(most_real, &mut real, near)?;
        let all = found.of[S - 1].probability;
        found.of.iter_mut().for_each(|of| of.probability = of.probability.max(all));
        Ok(found)
    }

    /// The same by the response surface alone. How far off that is nobody has tried: as its error stands what its bends make of the
    /// probability, the last order that it has, where that is more than the error of the lines.
    pub(crate) fn by_surface(&self) -> Result<Found<S>, Failure> {
        let (mut found, straight) = (self.by_model(true)?, self.by_model(false)?);
        for (one, straight) in found.of.iter_mut().zip(straight.of) {
            one.error = one.error.max((one.probability - straight.probability).abs());
        }
        Ok(Found { lines: 0, ..found })
    }

    fn by_model(&self, is_bent: bool) -> Result<Found<S>, Failure> {
        let of = self.asked.uncertainties;
        self.question(self.asked.most_lines[0]).of(&mut |g: &[f64]| Ok(self.near(of, g, is_bent)))
    }

    /// The probability of all limits by the response surface alone.
    pub(crate) fn nearly(&self) -> Result<f64, Failure> {
        Ok(self.by_model(true)?.of[S - 1].probability)
    }

    /// The probability of all limits by a straight model.
    pub(crate) fn linear_probability(&self) -> Result<f64, Failure> {
        Ok(self.by_model(false)?.of[S - 1].probability)
    }

    /// The probability of all limits by the real model alone, on so many lines of a scrambling.
    fn on_few(&self, of: &Uncertainties<Q>, lines: usize) -> Result<f64, Failure> {
        let mut real = |g: &[f64]| self.asked.tried(&of.values(g));
        Ok(self.question(lines).of(&mut real)?.of[S - 1].probability)
    }

    /// The limit that fails most often, of those that fail as often the nearest.
    fn failing(&self, found: &Found<S>) -> usize {
        let probability = |place: usize| found.of[self.asked.limits[place]].probability;
        let order = |a: &usize, b: &usize| {
            probability(*a).total_cmp(&probability(*b)).then(self.distances[*a].total_cmp(&self.distances[*b]))
        };
        (0..self.slopes.len()).min_by(order).unwrap_or(0)
    }

    /// The share that each quantity has in the doubt about the limit that fails most often; quantities of one name count together.
    /// With `lines`, so many of a scrambling, also the probability with half of its width: both widths are tried on the same lines,
    /// and their difference is added to the probability found.
    pub(crate) fn contributions(&self, found: &Found<S>, lines: Option<usize>) -> Result<Vec<Contribution>, Failure> {
        let of = self.asked.uncertainties;
        let probability = found.of[S - 1].probability;
        let slopes = &self.slopes[self.failing(found)];
        let variance: f64 = slopes.iter().map(|s| s * s).sum();
        let now = lines.map(|lines| self.on_few(of, lines)).transpose()?;
        let mut all: Vec<Contribution> = Vec::new();
        for (one, own) in of.named() {
            // Each has the score of its own place, where they are independent.
            let of_own = || own.iter().map(|&index| slopes[index] * slopes[index]).sum::<f64>();
            let share = || if variance > 0.0 { of_own() / variance } else { 0.0 };
            let halved = match lines.zip(now) {
                Some((lines, now)) => {
                    let halved = own.iter().fold(of.clone(), |of, &index| of.halved(index));
                    Some(bounded(probability + self.on_few(&halved, lines)? - now))
                }
                None => None,
            };
            all.push(Contribution {
                quantity: one.name.to_owned(),
                source: one.source,
                level: one.level,
                share_of_variance: of.is_independent().then(share),
                joint_probability_if_halved: halved,
            });
        }
        Contribution::sort(&mut all);
        Ok(all)
    }
}

impl<Q, const K: usize, const S: usize> Asked<'_, Q, K, S> {
    /// Margins at what quantities come to; where there is no answer none is kept.
    fn tried(&self, values: &[f64]) -> Result<Margins<K>, Failure> {
        match (self.real)(values) {
            Err(Failure::OutOfModel(_) | Failure::NotConverged { .. }) => Ok([f64::NEG_INFINITY; K]),
            found => found,
        }
    }
}
