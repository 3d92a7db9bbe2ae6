//! Parts that are judged by the limits of their diameters (`certainty/4`).

use std::rc::Rc;

use crate::calculator::{Failure, Monitor};
use crate::certainty::bounds::Extremes;
use crate::certainty::lines::{Effort, Estimate, Found, Margins, Question, Together, Values};
use crate::certainty::{
    Conformance, ConformanceMethod, Contribution, Improvement, JointlyKept, Level, LimitKept, SeveralParts, Surface,
    Uncertainties, bounded, normal_below,
};

use super::limits::SizeLimits;
use super::quantities::{Modes, OneQuantity, draw_of, uncertainties};
use super::{Asked, Parts, Places};

/// Upper and lower limit of size, and form.
pub(super) const LIMITS: usize = 3;
pub(super) const ABOVE: usize = 0;
pub(super) const BELOW: usize = 1;
const FORM: usize = 2;
/// Sets of them of which the probability is asked: each alone, both of size, all.
pub(super) const SETS: [Together; 5] = [ABOVE..=ABOVE, BELOW..=BELOW, FORM..=FORM, ABOVE..=BELOW, ABOVE..=FORM];
const SIZE: usize = 3;
pub(super) const JOINT: usize = 4;
/// Most lines of one scrambling: for a probability, for what something else would make of it on the same lines, and for what a
/// measured part would make of it.
pub(super) const MOST_LINES: [usize; 3] = [128, 8, 32];
/// Standard uncertainty of the gauge with which a first part is measured where none is stated, um.
const GAUGE_UM: f64 = 1.0;
/// Step of a shift of the command, where no limits of size say what matters, um.
const SHIFT_STEP_UM: f64 = 10.0;

/// Parts that are judged by their limits.
#[derive(Clone)]
pub(crate) struct Judged<'a> {
    pub(super) asked: Asked<'a>,
    pub(super) parts: &'a dyn Parts,
    pub(super) uncertainties: Uncertainties<OneQuantity>,
    pub(super) limits: SizeLimits,
    modes: Rc<Modes>,
    near: Rc<Near>,
    /// Errors by station at the medians, of the command as it is.
    stated_um: Vec<f64>,
    /// Independent scores along which what decides changes fastest.
    pub(super) axis: Vec<f64>,
    pub(super) slopes: Slopes,
    pub(super) monitor: &'a dyn Monitor,
}

/// By what a part is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum By {
    /// As the model cuts it.
    Model,
    /// A response surface of that.
    Surface,
}

/// Errors by station as a response surface of what the quantities come to, of the places between bounds, and of the shift of the
/// command.
struct Near {
    surface: Surface,
    /// What every quantity comes to at its median and how far off it is taken; then the places, the shift last.
    scales: Vec<(f64, f64)>,
}

impl Near {
    fn of(
        asked: &Asked<'_>,
        parts: &dyn Parts,
        (uncertainties, modes): (&Uncertainties<OneQuantity>, &Modes),
        shift_step_um: f64,
    ) -> Result<Self, Failure> {
        let mut scales = uncertainties.scales();
        let with_distribution = scales.len();
        scales.extend(uncertainties.within.iter().map(|_| (0.0, 1.0)));
        scales.push((0.0, shift_step_um));
        let acts: Vec<bool> = scales.iter().map(|(_, scale)| *scale > 0.0).collect();
        let count = scales.len() - 1;
        // Errors along the part add to each other.
        let is_mode = |i: usize| uncertainties.of.get(i).is_some_and(|one| one.quantity.is_mode());
        let surface = Surface::crossed(&acts, &|i, j| !(is_mode(i) && is_mode(j)), &mut |x| {
            let at = |i: usize| scales[i].0 + scales[i].1 * x[i];
            let values: Vec<f64> = (0..with_distribution).map(at).collect();
            let held = uncertainties.held(&(with_distribution..count).map(at).collect::<Vec<_>>());
            parts.errors_um(&draw_of((&held, modes), asked.effects, &values)?, at(count))
        })?;
        Ok(Self { surface, scales })
    }

    fn coordinates(&self, of: &Uncertainties<OneQuantity>, values: &[f64], shift_um: f64) -> Vec<f64> {
        let places = of.places();
        let one =
            |(value, (median, scale)): (f64, &(f64, f64))| if *scale > 0.0 { (value - median) / scale } else { 0.0 };
        values.iter().copied().chain(places).chain([shift_um]).zip(&self.scales).map(one).collect()
    }
}

/// Errors as they change with independent scores near the stated values.
#[derive(Clone)]
pub(super) struct Slopes {
    /// By station, um.
    pub(super) of_um: Vec<Vec<f64>>,
    /// The station at which it is decided.
    deciding: usize,
}

impl<'a> Judged<'a> {
    /// Of parts with at least one limit and one uncertain quantity; `None` of any others.
    pub(crate) fn of(
        asked: Asked<'a>,
        parts: &'a dyn Parts,
        monitor: &'a dyn Monitor,
    ) -> Result<Option<Self>, Failure> {
        let (uncertainties, modes) = uncertainties(&asked, &parts.places().z_mm)
            .map_err(|_| Failure::Internal("correlations of a checked job contradict each other".to_owned()))?;
        if uncertainties.is_empty() || parts.places().z_mm.is_empty() {
            return Ok(None);
        }
        let limits = asked.tolerance.size();
        let step_um = limits.half_width_um().unwrap_or(SHIFT_STEP_UM);
        let near = Near::of(&asked, parts, (&uncertainties, &modes), step_um)?;
        let slopes = Slopes { of_um: Vec::new(), deciding: 0 };
        let (modes, near, stated_um, axis) = (Rc::new(modes), Rc::new(near), Vec::new(), Vec::new());
        let judged = Self { asked, parts, uncertainties, limits, modes, near, stated_um, axis, slopes, monitor };
        judged.with(judged.uncertainties.clone()).map(Some)
    }

    /// The same with the quantities between bounds where they are held there.
    pub(super) fn with(&self, uncertainties: Uncertainties<OneQuantity>) -> Result<Self, Failure> {
        let mut judged = Self { uncertainties, ..self.clone() };
        let medians = vec![0.0; judged.uncertainties.dimensions()];
        judged.stated_um = judged.errors_um(By::Surface, &judged.uncertainties, &medians, 0.0)?;
        judged.slopes.of_um = judged.slopes_um()?;
        judged.axis = judged.deciding();
        Ok(judged)
    }

    /// Change of the errors with every independent score, by station.
    fn slopes_um(&self) -> Result<Vec<Vec<f64>>, Failure> {
        let count = self.uncertainties.dimensions();
        let mut slopes_um = vec![vec![0.0; count]; self.parts.places().z_mm.len()];
        for index in 0..count {
            let at = |score: f64| {
                let mut independent = vec![0.0; count];
                independent[index] = score;
                self.errors_um(By::Surface, &self.uncertainties, &independent, 0.0)
            };
            for ((slopes, up), down) in slopes_um.iter_mut().zip(at(0.5)?).zip(at(-0.5)?) {
                slopes[index] = up - down;
            }
        }
        Ok(slopes_um)
    }

    /// Independent scores of a part, the seed of points among them, and where its errors are told.
    pub(crate) fn dimensions(&self) -> usize {
        self.axis.len()
    }

    pub(crate) fn seed(&self) -> u32 {
        self.asked.uncertainty.seed
    }

    pub(crate) fn places(&self) -> &Places {
        self.parts.places()
    }

    pub(crate) fn monitor(&self) -> &dyn Monitor {
        self.monitor
    }

    /// Errors by station as the model cuts a part.
    pub(crate) fn model_errors_um(&self, independent: &[f64], shift_um: f64) -> Result<Vec<f64>, Failure> {
        self.errors_um(By::Model, &self.uncertainties, independent, shift_um)
    }

    /// Errors by station of a part that is cut as independent scores come to.
    pub(super) fn errors_um(
        &self,
        by: By,
        of: &Uncertainties<OneQuantity>,
        independent: &[f64],
        shift_um: f64,
    ) -> Result<Vec<f64>, Failure> {
        let values = of.values(independent);
        match by {
            By::Model => self.parts.errors_um(&draw_of((of, &self.modes), self.asked.effects, &values)?, shift_um),
            By::Surface => Ok(self.near.surface.at(&self.near.coordinates(of, &values, shift_um))),
        }
    }

    /// Largest and smallest error of a part; `None` of one that cannot be cut.
    pub(super) fn ends_um(&self, by: By, independent: &[f64], shift_um: f64) -> Result<Option<[f64; 2]>, Failure> {
        match self.errors_um(by, &self.uncertainties, independent, shift_um) {
            Ok(errors_um) => Ok(Some(self.parts.places().extremes_um(&errors_um))),
            Err(Failure::OutOfModel(_)) => Ok(None),
            Err(failure) => Err(failure),
        }
    }

    /// Standard uncertainty of the gauge, um.
    pub(super) fn gauge_um(&self) -> f64 {
        self.asked.uncertainty.measurement.map_or(GAUGE_UM, |gauge| gauge.standard_uncertainty_um)
    }

    /// Errors by station as they are stated.
    pub(super) fn stated_um(&self) -> &[f64] {
        &self.stated_um
    }

    /// By how much the limits are kept, um.
    pub(super) fn margins(&self, [largest, smallest]: [f64; 2]) -> Margins<LIMITS> {
        let mut margins = [f64::INFINITY; LIMITS];
        margins[ABOVE] = self.limits.upper_um.map_or(f64::INFINITY, |upper| upper - largest);
        margins[BELOW] = self.limits.lower_um.map_or(f64::INFINITY, |lower| smallest - lower);
        margins[FORM] = self.asked.tolerance.form_um.map_or(f64::INFINITY, |form| form - (largest - smallest));
        margins
    }

    /// Margins of a part that is cut; of one that cannot be cut none is kept.
    pub(super) fn cut(
        &self,
        by: By,
        of: &Uncertainties<OneQuantity>,
        independent: &[f64],
        shift_um: f64,
    ) -> Result<Margins<LIMITS>, Failure> {
        match self.errors_um(by, of, independent, shift_um) {
            Ok(errors_um) => Ok(self.margins(self.parts.places().extremes_um(&errors_um))),
            Err(Failure::OutOfModel(_)) => Ok([f64::NEG_INFINITY; LIMITS]),
            Err(failure) => Err(failure),
        }
    }

    pub(super) fn question<'q>(&'q self, axis: &'q [f64], most_lines: usize) -> Question<'q, { SETS.len() }> {
        Question { axis, sets: SETS, effort: self.effort(most_lines), monitor: self.monitor }
    }

    pub(super) fn effort(&self, most_lines: usize) -> Effort {
        Effort { seed: self.asked.uncertainty.seed, most_lines }
    }

    /// The probabilities of a question by the model itself, most lines of which the response surface answers.
    pub(super) fn really<const S: usize, const K: usize>(
        &self,
        question: &Question<'_, S>,
        model: &mut Values<'_, K>,
        surface: &mut Values<'_, K>,
    ) -> Result<Found<S>, Failure> {
        if self.parts.cost_much() {
            question.of_costly(model, surface)
        } else {
            question.of_real(question.effort.most_lines, model, surface)
        }
    }

    /// The probabilities of a part that is really cut.
    pub(super) fn found(&self, shift_um: f64) -> Result<Found<{ SETS.len() }>, Failure> {
        let by = |by: By| move |g: &[f64]| self.cut(by, &self.uncertainties, g, shift_um);
        self.really(&self.question(&self.axis, MOST_LINES[0]), &mut by(By::Model), &mut by(By::Surface))
    }

    /// The probabilities by the response surface alone, on few lines: for comparisons on the same ones.
    pub(super) fn nearly(&self, of: &Uncertainties<OneQuantity>, shift_um: f64) -> Result<[f64; SETS.len()], Failure> {
        let question = self.question(&self.axis, MOST_LINES[1]);
        let found = question.of(&mut |g: &[f64]| self.cut(By::Surface, of, g, shift_um))?;
        Ok(found.of.map(|one| one.probability))
    }

    fn linear_probability(&self) -> Result<f64, Failure> {
        let found = self.question(&self.axis, MOST_LINES[1]).of(&mut |g: &[f64]| {
            let of = &self.uncertainties;
            let coordinates = self.near.coordinates(of, &of.values(g), 0.0);
            Ok(self.margins(self.parts.places().extremes_um(&self.near.surface.linear_at(&coordinates))))
        })?;
        Ok(found.of[JOINT].probability)
    }

    /// The direction in which the limit that is likeliest passed changes fastest; of form that of the difference of the two
    /// places that move most against each other. Sets where it is decided.
    fn deciding(&mut self) -> Vec<f64> {
        let (errors_um, slopes_um) = (self.stated_um(), &self.slopes.of_um);
        let size = |slopes: &[f64]| slopes.iter().map(|s| s * s).sum::<f64>().sqrt();
        let (mut nearest, mut axis, mut deciding) = (f64::INFINITY, slopes_um[0].clone(), 0);
        let mut meet = |margin: f64, slopes: Vec<f64>, station: usize| {
            let distance = margin / size(&slopes).max(1e-12);
            if distance < nearest {
                (nearest, axis, deciding) = (distance, slopes, station);
            }
        };
        for (i, (error, slopes)) in errors_um.iter().zip(slopes_um).enumerate() {
            if let Some(upper) = self.limits.upper_um {
                meet(upper - error, slopes.clone(), i);
            }
            if let Some(lower) = self.limits.lower_um {
                meet(error - lower, slopes.clone(), i);
            }
        }
        if let Some(form) = self.asked.tolerance.form_um {
            for (i, (e, slopes)) in errors_um.iter().zip(slopes_um).enumerate() {
                for (other, others) in errors_um.iter().zip(slopes_um).take(i) {
                    let against = slopes.iter().zip(others).map(|(a, b)| a - b).collect();
                    meet(form - (e - other).abs(), against, i);
                }
            }
        }
        self.slopes.deciding = deciding;
        axis
    }

    /// Where within bounds the probability is least and most, of a command that is larger by `shift_um`; `None` where there are none.
    fn extremes(&self, shift_um: f64) -> Result<Option<Extremes>, Failure> {
        self.uncertainties.extremes(&mut |of| Ok(self.with(of.clone())?.nearly(of, shift_um)?[JOINT]))
    }

    /// What the probabilities of the response surface are worth, within bounds the least.
    pub(super) fn worth_nearly(&self, shift_um: f64, worth: &dyn Fn([f64; SETS.len()]) -> f64) -> Result<f64, Failure> {
        let at = |of: &Uncertainties<OneQuantity>| Ok(worth(self.with(of.clone())?.nearly(of, shift_um)?));
        match self.uncertainties.extremes(&mut { at })? {
            Some(extremes) => at(&self.uncertainties.held(&extremes.least)),
            None => Ok(worth(self.nearly(&self.uncertainties, shift_um)?)),
        }
    }

    /// The probability of all limits, within bounds the least.
    pub(crate) fn least_found(&self, shift_um: f64) -> Result<Estimate, Failure> {
        match self.extremes(shift_um)? {
            Some(extremes) => Ok(self.with(self.uncertainties.held(&extremes.least))?.found(shift_um)?.of[JOINT]),
            None => Ok(self.found(shift_um)?.of[JOINT]),
        }
    }

    /// The whole block, of a command that is larger by `shift_um` than the exact one.
    pub(crate) fn conformance(&self, shift_um: f64) -> Result<Conformance, Failure> {
        let Some(Extremes { least, most, search }) = self.extremes(shift_um)? else { return self.told(shift_um) };
        let [least, most] = [least, most].map(|places| self.with(self.uncertainties.held(&places)));
        let mut told = least?.told(shift_um)?;
        told.joint = told.joint.least(most?.found(shift_um)?.of[JOINT].probability, search);
        Ok(told)
    }

    /// The block with the quantities between bounds where they are.
    fn told(&self, shift_um: f64) -> Result<Conformance, Failure> {
        let uncertainty = self.asked.uncertainty;
        let found = self.found(shift_um)?;
        let joint = found.of[JOINT];
        // What something else makes of it is compared on the same lines.
        let now = self.nearly(&self.uncertainties, shift_um)?[JOINT];
        let told = |of: &Uncertainties<OneQuantity>| -> Result<f64, Failure> {
            Ok(bounded(joint.probability + self.nearly(of, shift_um)?[JOINT] - now))
        };
        let mut advice: Vec<Improvement> = Vec::new();
        advice.extend(self.shifted(shift_um, joint)?);
        advice.extend(self.first_part(shift_um, joint)?);
        Improvement::sort(&mut advice);
        let slopes = &self.slopes.of_um[self.slopes.deciding];
        let variance: f64 = slopes.iter().map(|s| s * s).sum();
        let is_independent = self.uncertainties.is_independent();
        let share = |index: usize| if variance > 0.0 { slopes[index] * slopes[index] / variance } else { 0.0 };
        let mut contributions = Vec::new();
        for (one, places) in self.uncertainties.named() {
            let halved = places.iter().fold(self.uncertainties.clone(), |of, &place| of.halved(place));
            contributions.push(Contribution {
                quantity: one.name.to_owned(),
                source: one.source,
                level: one.level,
                share_of_variance: is_independent.then(|| places.iter().map(|&place| share(place)).sum()),
                joint_probability_if_halved: Some(told(&halved)?),
            });
        }
        contributions.extend(
            self.uncertainties
                .contributions_within(joint.probability, &mut |of| Ok(self.nearly(of, shift_um)?[JOINT]))?,
        );
        Contribution::sort(&mut contributions);
        let common = self.common_share();
        let probability = bounded(joint.probability);
        Ok(Conformance {
            limits: self.limits_kept(&found),
            joint: JointlyKept::of(joint, uncertainty.wanted_probability),
            setup: SeveralParts {
                count: uncertainty.parts_per_setup,
                probability_all_good: self.all_good(probability),
                expected_good: probability * f64::from(uncertainty.parts_per_setup),
                share_common_to_all: common,
            },
            contributions,
            advice,
            acceptance: match uncertainty.measurement {
                Some(gauge) => self.acceptance(gauge.standard_uncertainty_um, shift_um)?,
                None => None,
            },
            method: ConformanceMethod {
                integrated_lines: u32::try_from(found.lines).unwrap_or(u32::MAX),
                linear_probability: bounded(self.linear_probability()?),
                seed: uncertainty.seed,
            },
        })
    }

    fn limits_kept(&self, found: &Found<{ SETS.len() }>) -> Vec<LimitKept> {
        let passed = |limit: usize| bounded(1.0 - found.of[limit].probability);
        let mut kept = Vec::new();
        if let Some(pointer) = self.asked.tolerance.size_pointer() {
            kept.push(LimitKept {
                limit: "size".to_owned(),
                pointer: pointer.to_owned(),
                probability: bounded(found.of[SIZE].probability),
                numerical_error: found.of[SIZE].error,
                probability_above: self.limits.upper_um.map(|_| passed(ABOVE)),
                probability_below: self.limits.lower_um.map(|_| passed(BELOW)),
            });
        }
        if self.asked.tolerance.form_um.is_some() {
            kept.push(LimitKept {
                limit: "form".to_owned(),
                pointer: "/tolerance/form_um".to_owned(),
                probability: bounded(found.of[FORM].probability),
                numerical_error: found.of[FORM].error,
                probability_above: Some(passed(FORM)),
                probability_below: None,
            });
        }
        kept
    }

    /// Share of the variance of what decides that is the same for all parts of a set-up.
    fn common_share(&self) -> f64 {
        let slopes = &self.slopes.of_um[self.slopes.deciding];
        let of = |level: Option<Level>| {
            let is_of = |one: Level| level.is_none_or(|level| level == one);
            let scores = slopes.iter().enumerate().filter(|(score, _)| is_of(self.uncertainties.level(*score)));
            scores.map(|(_, s)| s * s).sum()
        };
        let all: f64 = of(None);
        if all > 0.0 { of(Some(Level::Setup)) / all } else { 1.0 }
    }

    /// Probability that all parts of a set-up are good: that of one where nothing changes from part to part, else by the
    /// linear share of what does, over scores that are common to all.
    fn all_good(&self, probability: f64) -> f64 {
        let common = self.common_share();
        if common >= 1.0 {
            return probability;
        }
        all_good(probability, common, self.asked.uncertainty.parts_per_setup)
    }
}

impl Slopes {
    /// Largest standard deviation of an error, um.
    pub(super) fn largest_deviation_um(&self) -> f64 {
        let variance = |slopes: &Vec<f64>| slopes.iter().map(|s| s * s).sum::<f64>();
        self.of_um.iter().map(variance).fold(0.0, f64::max).sqrt()
    }
}

/// Probability that all of several parts are good whose margin is normal, with this share of its variance common to all and
/// with one of them good as often as said: the mean over the common score of what is left to the power of the count.
fn all_good(probability: f64, common: f64, parts: u32) -> f64 {
    let margin = crate::certainty::normal_quantile(probability);
    let (shared, own) = (common.sqrt(), (1.0 - common).sqrt());
    let steps = 400;
    let reach = 8.0;
    let (mut sum, mut weights) = (0.0, 0.0);
    for step in 0..=steps {
        let score = reach * (2.0 * f64::from(step) / f64::from(steps) - 1.0);
        let weight = (-0.5 * score * score).exp();
        sum += weight * normal_below((margin - shared * score) / own).powf(f64::from(parts));
        weights += weight;
    }
    sum / weights
}
