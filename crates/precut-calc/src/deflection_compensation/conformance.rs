//! How probable it is that the shaft is good, and what would raise that (`certainty/4`).

use crate::calculator::{Failure, Finding, Message, Monitor, checkpoint};
use crate::certainty::lines::{Effort, Estimate, Found, Margins, Question, Sketch, Together, points};
use crate::certainty::{
    Conformance, ConformanceMethod, Contribution, Improvement, JointlyKept, Level, LimitKept, Quantity, SeveralParts,
    Surface, Uncertainties, bounded, normal_below,
};

use super::acceptance;
use super::input::{Aim, Job, SizeLimits};
use super::output::ErrorFan;
use super::rehearsal::Rehearsal;
use super::uncertain::{DeflectionQuantity, draw_of, uncertainties};

/// Upper and lower limit of size, and form.
const LIMITS: usize = 3;
const ABOVE: usize = 0;
const BELOW: usize = 1;
const FORM: usize = 2;
/// Sets of them of which the probability is asked: each alone, both of size, all.
const SETS: [Together; 5] = [ABOVE..=ABOVE, BELOW..=BELOW, FORM..=FORM, ABOVE..=BELOW, ABOVE..=FORM];
const SIZE: usize = 3;
const JOINT: usize = 4;
/// Most lines of one scrambling: for a probability, for what something else would make of it on the same lines, and for what a
/// measured part would make of it.
const MOST_LINES: [usize; 3] = [128, 8, 32];
/// Standard uncertainty of the gauge with which a first part is measured where none is stated, um.
const GAUGE_UM: f64 = 1.0;
/// Parts of which a fan is made.
const FAN_PARTS: usize = 256;
/// Steps in which the best aim is bracketed, and by which it is narrowed down.
const AIM_STEPS: [usize; 2] = [16, 16];

/// Step of a shift of the command, where no limits of size say what matters, um.
const SHIFT_STEP_UM: f64 = 10.0;

/// Codes of what is said here.
pub(super) const EXPLANATION_CODES: &[&str] = &["probably_good", "first_part_tells", "aim_tells"];
/// Codes of the warnings made here.
pub(super) const WARNING_CODES: &[&str] = &["improbable"];

/// A shaft that is judged by its limits.
pub(super) struct Judged<'a> {
    job: &'a Job,
    rehearsal: &'a Rehearsal<'a>,
    uncertainties: Uncertainties<DeflectionQuantity>,
    limits: SizeLimits,
    near: Near,
    /// Independent scores along which what decides changes fastest.
    axis: Vec<f64>,
    slopes: Slopes,
    monitor: &'a dyn Monitor,
}

/// By what a part is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum By {
    /// Station by station along the path.
    Rehearsal,
    /// A response surface of that.
    Surface,
}

/// Errors by station as a response surface of what the quantities come to and of the shift of the command.
struct Near {
    surface: Surface,
    /// What every quantity comes to at its median and how far off it is taken, the shift last.
    scales: Vec<(f64, f64)>,
}

impl Near {
    fn of(
        rehearsal: &Rehearsal<'_>,
        uncertainties: &Uncertainties<DeflectionQuantity>,
        shift_step_um: f64,
    ) -> Result<Self, Failure> {
        let mut scales = uncertainties.scales();
        scales.push((0.0, shift_step_um));
        let acts: Vec<bool> = scales.iter().map(|(_, scale)| *scale > 0.0).collect();
        let count = scales.len() - 1;
        let surface = Surface::of(&acts, &mut |x| {
            let at = |i: usize| scales[i].0 + scales[i].1 * x[i];
            let values: Vec<f64> = (0..count).map(at).collect();
            rehearsal.errors_um(&draw_of(uncertainties, &values), at(count))
        })?;
        Ok(Self { surface, scales })
    }

    fn coordinates(&self, values: &[f64], shift_um: f64) -> Vec<f64> {
        let of =
            |(value, (median, scale)): (f64, &(f64, f64))| if *scale > 0.0 { (value - median) / scale } else { 0.0 };
        values.iter().copied().chain([shift_um]).zip(&self.scales).map(of).collect()
    }
}

/// Errors as they change with independent scores near the stated values.
struct Slopes {
    /// By station, um.
    of_um: Vec<Vec<f64>>,
    /// The station at which it is decided.
    deciding: usize,
}

impl<'a> Judged<'a> {
    /// Of a shaft with at least one limit and one uncertain quantity; `None` of any other.
    pub(super) fn of(
        job: &'a Job,
        rehearsal: &'a Rehearsal<'a>,
        monitor: &'a dyn Monitor,
    ) -> Result<Option<Self>, Failure> {
        let uncertainties = uncertainties(job)
            .map_err(|_| Failure::Internal("correlations of a checked job contradict each other".to_owned()))?;
        if uncertainties.of.is_empty() || rehearsal.z_mm().is_empty() {
            return Ok(None);
        }
        let limits = job.tolerance.size();
        let step_um = limits.half_width_um().unwrap_or(SHIFT_STEP_UM);
        let near = Near::of(rehearsal, &uncertainties, step_um)?;
        let slopes = Slopes { of_um: Vec::new(), deciding: 0 };
        let mut judged = Self { job, rehearsal, uncertainties, limits, near, axis: Vec::new(), slopes, monitor };
        judged.slopes.of_um = judged.slopes_um()?;
        judged.axis = judged.deciding();
        Ok(Some(judged))
    }

    /// Change of the errors with every independent score, by station.
    fn slopes_um(&self) -> Result<Vec<Vec<f64>>, Failure> {
        let count = self.uncertainties.of.len();
        let mut slopes_um = vec![vec![0.0; count]; self.rehearsal.z_mm().len()];
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

    /// Errors by station of a part that is cut as independent scores come to.
    fn errors_um(
        &self,
        by: By,
        of: &Uncertainties<DeflectionQuantity>,
        independent: &[f64],
        shift_um: f64,
    ) -> Result<Vec<f64>, Failure> {
        let values = of.values(independent);
        match by {
            By::Rehearsal => self.rehearsal.errors_um(&draw_of(of, &values), shift_um),
            By::Surface => Ok(self.near.surface.at(&self.near.coordinates(&values, shift_um))),
        }
    }

    pub(super) fn limits(&self) -> SizeLimits {
        self.limits
    }

    pub(super) fn axis(&self) -> &[f64] {
        &self.axis
    }

    pub(super) fn monitor(&self) -> &dyn Monitor {
        self.monitor
    }

    /// Largest and smallest error of a part; `None` of one that cannot be cut.
    pub(super) fn ends_um(&self, by: By, independent: &[f64], shift_um: f64) -> Result<Option<[f64; 2]>, Failure> {
        match self.errors_um(by, &self.uncertainties, independent, shift_um) {
            Ok(errors_um) => Ok(Some(self.rehearsal.extremes_um(&errors_um))),
            Err(Failure::OutOfModel(_)) => Ok(None),
            Err(failure) => Err(failure),
        }
    }

    /// Standard uncertainty of the gauge, um.
    fn gauge_um(&self) -> f64 {
        self.job.uncertainty.measurement.map_or(GAUGE_UM, |gauge| gauge.standard_uncertainty_um)
    }

    /// Errors by station as they are stated.
    fn stated_um(&self) -> &[f64] {
        self.near.surface.at_point()
    }

    /// By how much the limits are kept, um.
    fn margins(&self, [largest, smallest]: [f64; 2]) -> Margins<LIMITS> {
        let mut margins = [f64::INFINITY; LIMITS];
        margins[ABOVE] = self.limits.upper_um.map_or(f64::INFINITY, |upper| upper - largest);
        margins[BELOW] = self.limits.lower_um.map_or(f64::INFINITY, |lower| smallest - lower);
        margins[FORM] = self.job.tolerance.form_um.map_or(f64::INFINITY, |form| form - (largest - smallest));
        margins
    }

    /// Margins of a part that is cut; of one that cannot be cut none is kept.
    fn cut(
        &self,
        by: By,
        of: &Uncertainties<DeflectionQuantity>,
        independent: &[f64],
        shift_um: f64,
    ) -> Result<Margins<LIMITS>, Failure> {
        match self.errors_um(by, of, independent, shift_um) {
            Ok(errors_um) => Ok(self.margins(self.rehearsal.extremes_um(&errors_um))),
            Err(Failure::OutOfModel(_)) => Ok([f64::NEG_INFINITY; LIMITS]),
            Err(failure) => Err(failure),
        }
    }

    fn question<'q>(&'q self, axis: &'q [f64], most_lines: usize) -> Question<'q, { SETS.len() }> {
        Question { axis, sets: SETS, effort: self.effort(most_lines), monitor: self.monitor }
    }

    pub(super) fn effort(&self, most_lines: usize) -> Effort {
        Effort { seed: self.job.uncertainty.seed, most_lines }
    }

    /// The probabilities of a part that is really cut.
    fn found(&self, shift_um: f64) -> Result<Found<{ SETS.len() }>, Failure> {
        let by = |by: By| move |g: &[f64]| self.cut(by, &self.uncertainties, g, shift_um);
        self.question(&self.axis, MOST_LINES[0]).of_real(MOST_LINES[0], &mut by(By::Rehearsal), &mut by(By::Surface))
    }

    /// The probabilities by the response surface alone, on few lines: for comparisons on the same ones.
    fn nearly(&self, of: &Uncertainties<DeflectionQuantity>, shift_um: f64) -> Result<[f64; SETS.len()], Failure> {
        let question = self.question(&self.axis, MOST_LINES[1]);
        let found = question.of(&mut |g: &[f64]| self.cut(By::Surface, of, g, shift_um))?;
        Ok(found.of.map(|one| one.probability))
    }

    fn linear_probability(&self) -> Result<f64, Failure> {
        let found = self.question(&self.axis, MOST_LINES[1]).of(&mut |g: &[f64]| {
            let coordinates = self.near.coordinates(&self.uncertainties.values(g), 0.0);
            Ok(self.margins(self.rehearsal.extremes_um(&self.near.surface.linear_at(&coordinates))))
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
        if let Some(form) = self.job.tolerance.form_um {
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

    /// The shift of the commanded diameter that an aim asks for, um.
    pub(super) fn aim_um(&self, aim: &Aim) -> Result<f64, Failure> {
        match *aim {
            Aim::Nominal {} => Ok(0.0),
            Aim::Middle {} => Ok(self.limits.middle_um().unwrap_or(0.0)),
            Aim::MostProbable {} => self.best_shift_um(&|kept| kept[JOINT]),
            Aim::LeastLoss { oversize_cost, undersize_cost } => self.best_shift_um(&|kept| {
                let lost = |limit: usize, cost: f64| cost * (1.0 - kept[limit]);
                -lost(ABOVE, oversize_cost) - lost(BELOW, undersize_cost)
            }),
        }
    }

    /// The shift at which `worth`, of the probabilities of the sets of limits, is largest: by steps over what may matter, then
    /// by golden section, on common points of the response surface. Errors follow a shift as they do about the stated values.
    fn best_shift_um(&self, worth: &dyn Fn([f64; SETS.len()]) -> f64) -> Result<f64, Failure> {
        let extremes = |scores: &[f64], shift_um: f64| -> Result<[f64; 2], Failure> {
            Ok(self.rehearsal.extremes_um(&self.errors_um(By::Surface, &self.uncertainties, scores, shift_um)?))
        };
        let effort = self.effort(MOST_LINES[1]);
        let sketch = Sketch::of(&self.axis, effort, self.monitor, &mut |scores| extremes(scores, 0.0))?;
        let stated = vec![0.0; self.axis.len()];
        let [up, down] = [extremes(&stated, 1.0)?, extremes(&stated, -1.0)?];
        let follows: [f64; 2] = std::array::from_fn(|end| 0.5 * (up[end] - down[end]));
        let at = |shift: f64| -> Result<f64, Failure> {
            let shifted = |ends: [f64; 2]| std::array::from_fn(|end| ends[end] + follows[end] * shift);
            Ok(worth(sketch.kept(&SETS, &|ends| self.margins(shifted(ends)))?))
        };
        let middle = self.limits.middle_um().unwrap_or(0.0);
        let room = self.limits.half_width_um().unwrap_or(0.0) + 3.0 * self.slopes.largest_deviation_um();
        let step = 2.0 * room / AIM_STEPS[0] as f64;
        let mut best = (0.0, at(0.0)?);
        for index in 0..=AIM_STEPS[0] {
            let shift = step.mul_add(index as f64, middle - room);
            let here = at(shift)?;
            if here > best.1 {
                best = (shift, here);
            }
        }
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let (mut low, mut high) = (best.0 - step, best.0 + step);
        let (mut inner, mut outer) = (high - golden * (high - low), low + golden * (high - low));
        let (mut at_inner, mut at_outer) = (at(inner)?, at(outer)?);
        for _ in 0..AIM_STEPS[1] {
            if at_inner >= at_outer {
                (high, outer, at_outer) = (outer, inner, at_inner);
                inner = high - golden * (high - low);
                at_inner = at(inner)?;
            } else {
                (low, inner, at_inner) = (inner, outer, at_outer);
                outer = low + golden * (high - low);
                at_outer = at(outer)?;
            }
        }
        let found = if at_inner >= at_outer { (inner, at_inner) } else { (outer, at_outer) };
        let near = if found.1 > best.1 { found.0 } else { best.0 };
        // The top is flat, and the lines are bent: what is left is found by parabolas.
        let bent = |shift: f64| -> Result<f64, Failure> { Ok(worth(self.nearly(&self.uncertainties, shift)?)) };
        let mut top = near;
        for width in [0.5 * step, 0.25 * step] {
            let [left, here, right] = [bent(top - width)?, bent(top)?, bent(top + width)?];
            let curvature = left - 2.0 * here + right;
            let move_by = if curvature < 0.0 { 0.5 * width * (left - right) / curvature } else { 0.0 };
            top += move_by.clamp(-width, width);
        }
        Ok(top)
    }

    /// How the errors of single parts lie along the shaft: by station, what so many percent of them stay below.
    pub(super) fn fan(&self, shift_um: f64) -> Result<ErrorFan, Failure> {
        let mut by_station = vec![Vec::with_capacity(FAN_PARTS); self.rehearsal.z_mm().len()];
        for point in points(FAN_PARTS, self.axis.len(), self.job.uncertainty.seed) {
            checkpoint(self.monitor)?;
            match self.errors_um(By::Rehearsal, &self.uncertainties, &point, shift_um) {
                Ok(errors) => by_station.iter_mut().zip(errors).for_each(|(all, error)| all.push(error)),
                Err(Failure::OutOfModel(_)) => {}
                Err(failure) => return Err(failure),
            }
        }
        for errors in &mut by_station {
            errors.sort_by(f64::total_cmp);
        }
        let below = |percent: f64| by_station.iter().map(|errors| quantile(errors, percent / 100.0)).collect();
        Ok(ErrorFan {
            z_mm: self.rehearsal.z_mm().to_vec(),
            below_5_percent_um: below(5.0),
            below_25_percent_um: below(25.0),
            below_50_percent_um: below(50.0),
            below_75_percent_um: below(75.0),
            below_95_percent_um: below(95.0),
        })
    }

    /// The whole block, of a command that is larger by `shift_um` than the exact one.
    pub(super) fn conformance(&self, shift_um: f64) -> Result<Conformance, Failure> {
        let uncertainty = &self.job.uncertainty;
        let found = self.found(shift_um)?;
        let joint = found.of[JOINT];
        // What something else makes of it is compared on the same lines.
        let now = self.nearly(&self.uncertainties, shift_um)?[JOINT];
        let told = |of: &Uncertainties<DeflectionQuantity>| -> Result<f64, Failure> {
            Ok(bounded(joint.probability + self.nearly(of, shift_um)?[JOINT] - now))
        };
        let mut advice: Vec<Improvement> = Vec::new();
        advice.extend(self.shifted(shift_um, joint)?);
        advice.extend(self.first_part(shift_um, joint)?);
        advice.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
        let slopes = &self.slopes.of_um[self.slopes.deciding];
        let variance: f64 = slopes.iter().map(|s| s * s).sum();
        let is_independent = self.uncertainties.scores.is_independent();
        let share = |index: usize| if variance > 0.0 { slopes[index] * slopes[index] / variance } else { 0.0 };
        let mut contributions = Vec::new();
        for (index, one) in self.uncertainties.of.iter().enumerate() {
            contributions.push(Contribution {
                quantity: one.quantity.name().to_owned(),
                source: one.source,
                level: one.level,
                share_of_variance: is_independent.then(|| share(index)),
                joint_probability_if_halved: Some(told(&self.uncertainties.halved(index))?),
            });
        }
        Contribution::sort(&mut contributions);
        let common = self.common_share();
        let probability = bounded(joint.probability);
        Ok(Conformance {
            limits: self.limits_kept(&found),
            joint: JointlyKept {
                probability,
                numerical_error: joint.error,
                wanted: uncertainty.wanted_probability,
                met: probability >= uncertainty.wanted_probability,
            },
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
        if let Some(pointer) = self.job.tolerance.size_pointer() {
            kept.push(LimitKept {
                limit: "size".to_owned(),
                pointer: pointer.to_owned(),
                probability: bounded(found.of[SIZE].probability),
                numerical_error: found.of[SIZE].error,
                probability_above: self.limits.upper_um.map(|_| passed(ABOVE)),
                probability_below: self.limits.lower_um.map(|_| passed(BELOW)),
            });
        }
        if self.job.tolerance.form_um.is_some() {
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
            slopes.iter().zip(&self.uncertainties.of).filter(|(_, one)| is_of(one.level)).map(|(s, _)| s * s).sum()
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
        all_good(probability, common, self.job.uncertainty.parts_per_setup)
    }

    /// What another aim would make of it.
    fn shifted(&self, shift_um: f64, now: Estimate) -> Result<Option<Improvement>, Failure> {
        let is_open = matches!(self.job.aim, Aim::Nominal {} | Aim::Middle {});
        if !is_open || self.limits.middle_um().is_none() {
            return Ok(None);
        }
        let best_um = self.aim_um(&Aim::MostProbable {})?;
        let then = self.found(best_um)?.of[JOINT];
        let gain = then.probability - now.probability;
        Ok((gain > now.error + then.error && (best_um - shift_um).abs() > self.job.path.increment_um)
            .then(|| Improvement::ShiftAim { shift_um: best_um, joint_probability: bounded(then.probability), gain }))
    }

    /// What a measured first part would make of it: the command is shifted by what the scores that all parts share are to be
    /// expected at, given the reading, to first order; that is tried on the real model (`certainty/4.4`).
    fn first_part(&self, shift_um: f64, now: Estimate) -> Result<Option<Improvement>, Failure> {
        let gauge = self.gauge_um();
        let (errors_um, slopes_um) = (self.stated_um(), &self.slopes.of_um);
        let is_common = |index: usize| self.uncertainties.of[index].level == Level::Setup;
        // Scores of one level that are correlated with the other have no conditional distribution of that form.
        let (true, Some(middle)) = (self.uncertainties.scores.is_independent(), self.limits.middle_um()) else {
            return Ok(None);
        };
        let split = |slopes: &[f64]| {
            let of = |common: bool| {
                let chosen = slopes.iter().enumerate().filter(move |(i, _)| is_common(*i) == common);
                chosen.map(|(_, s)| s * s).sum::<f64>()
            };
            (of(true), of(false))
        };
        let told = |station: usize| {
            let (common, own) = split(&slopes_um[station]);
            (common, common + own + gauge * gauge)
        };
        // Where a reading tells most of what all parts share.
        let station = (0..slopes_um.len())
            .max_by(|&a, &b| {
                let share = |i: usize| told(i).0 * told(i).0 / told(i).1;
                share(a).total_cmp(&share(b))
            })
            .unwrap_or(0);
        let (common, total) = told(station);
        if common <= 0.0 {
            return Ok(None);
        }
        let h: Vec<f64> =
            slopes_um[station].iter().enumerate().map(|(i, s)| if is_common(i) { *s } else { 0.0 }).collect();
        // Scores that a reading lets expect: along h, as far as it is not scatter.
        let expected = |reading: f64| -> Vec<f64> { h.iter().map(|h| h * reading / total.sqrt()).collect() };
        let centred = |reading: f64| -> Result<f64, Failure> {
            let errors = self.errors_um(By::Rehearsal, &self.uncertainties, &expected(reading), 0.0)?;
            let [largest, smallest] = self.rehearsal.extremes_um(&errors);
            Ok(middle - 0.5 * (largest + smallest))
        };
        let slope = (centred(0.5)? - centred(-0.5)?) / total.sqrt();
        let as_expected = centred(0.0)?;
        // What is advised is tried: on a first part with its own scatter and a gauge with its own, then on a later one.
        let own: Vec<usize> = (0..h.len()).filter(|index| !is_common(*index)).collect();
        let later = |by: By, scores: &[f64]| -> Result<Margins<LIMITS>, Failure> {
            let mut first = scores[..h.len()].to_vec();
            own.iter().zip(&scores[h.len()..]).for_each(|(&index, score)| first[index] = *score);
            let gauge_um = gauge * scores[h.len() + own.len()];
            match self.errors_um(by, &self.uncertainties, &first, shift_um) {
                Ok(errors) => {
                    let shift = as_expected + slope * (errors[station] + gauge_um - errors_um[station]);
                    self.cut(by, &self.uncertainties, &scores[..h.len()], shift)
                }
                Err(Failure::OutOfModel(_)) => Ok([f64::NEG_INFINITY; LIMITS]),
                Err(failure) => Err(failure),
            }
        };
        let count = h.len() + own.len() + 1;
        let change = |index: usize| -> Result<f64, Failure> {
            let at = |score: f64| -> Result<f64, Failure> {
                let mut scores = vec![0.0; count];
                scores[index] = score;
                Ok(later(By::Surface, &scores)?[ABOVE])
            };
            Ok(at(0.5)? - at(-0.5)?)
        };
        let axis = (0..count).map(change).collect::<Result<Vec<f64>, Failure>>()?;
        let question = self.question(&axis, MOST_LINES[2]);
        let by = |by: By| move |scores: &[f64]| later(by, scores);
        let then = question.of_real(MOST_LINES[2], &mut by(By::Rehearsal), &mut by(By::Surface))?.of[JOINT];
        let gain = then.probability - now.probability;
        let error = now.error + then.error;
        Ok((gain > error).then(|| Improvement::MeasureFirstPart {
            z_mm: self.rehearsal.z_mm()[station],
            gauge_um: gauge,
            expected_um: errors_um[station],
            shift_as_expected_um: as_expected - shift_um,
            shift_um_per_um: slope,
            joint_probability: bounded(then.probability),
            gain,
        }))
    }
}

impl Slopes {
    /// Largest standard deviation of an error, um.
    fn largest_deviation_um(&self) -> f64 {
        let variance = |slopes: &Vec<f64>| slopes.iter().map(|s| s * s).sum::<f64>();
        self.of_um.iter().map(variance).fold(0.0, f64::max).sqrt()
    }
}

/// What a share of ascending values stays below; straight between neighbours.
fn quantile(ascending: &[f64], share: f64) -> f64 {
    let Some(last) = ascending.len().checked_sub(1) else { return 0.0 };
    let place = (share * ascending.len() as f64 - 0.5).clamp(0.0, last as f64);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and the last
    let before = place as usize;
    let after = (before + 1).min(last);
    ascending[before] + (place - before as f64) * (ascending[after] - ascending[before])
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

/// What is said of it, most important first.
pub(super) fn said(conformance: &Conformance) -> Vec<Message> {
    let joint = &conformance.joint;
    let mut first = Message::new("probably_good")
        .with("percent", 100.0 * joint.probability)
        .with("wanted_percent", 100.0 * joint.wanted)
        .with("met", if joint.met { "yes" } else { "no" })
        .with("common_percent", 100.0 * conformance.setup.share_common_to_all);
    // Where quantities go together none has a share of its own.
    if let Some(largest) = conformance.contributions.iter().find(|one| one.share_of_variance.is_some()) {
        first = first
            .with("quantity", largest.quantity.clone())
            .with("share_percent", 100.0 * largest.share_of_variance.unwrap_or(0.0));
    }
    let advised = conformance.advice.iter().map(|advice| match *advice {
        Improvement::ShiftAim { shift_um, joint_probability, .. } => {
            Message::new("aim_tells").with("shift_um", shift_um).with("percent", 100.0 * joint_probability)
        }
        Improvement::MeasureFirstPart {
            z_mm,
            expected_um,
            shift_as_expected_um,
            shift_um_per_um,
            joint_probability,
            ..
        } => Message::new("first_part_tells")
            .with("z_mm", z_mm)
            .with("expected_um", expected_um)
            .with("shift_um", shift_as_expected_um)
            .with("shift_um_per_um", shift_um_per_um)
            .with("percent", 100.0 * joint_probability),
    });
    let accepted = conformance.acceptance.as_ref().map(acceptance::said);
    std::iter::once(first).chain(advised).chain(accepted).collect()
}

/// What is warned of.
pub(super) fn warnings(job: &Job, conformance: &Conformance) -> Vec<Finding> {
    let joint = &conformance.joint;
    let mut found = Vec::new();
    let width_um = job.tolerance.size().half_width_um().map(|half| 2.0 * half);
    if let (Some(gauge), Some(width_um), None) = (&job.uncertainty.measurement, width_um, &conformance.acceptance) {
        found.push(acceptance::none_left(gauge.standard_uncertainty_um, width_um));
    }
    if !joint.met {
        found.push(
            Finding::new("improbable", "/uncertainty/wanted_probability")
                .measured(joint.probability, joint.wanted, "1")
                .with("percent", 100.0 * joint.probability)
                .with("wanted_percent", 100.0 * joint.wanted),
        );
    }
    found
}
