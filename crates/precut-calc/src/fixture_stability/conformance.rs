//! How probable it is that a cut stays quiet, closed and held (`certainty/6.1`).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Finding, Message, Monitor};
use crate::certainty::lines::{Effort, Found, Margins, Question, Together};
use crate::certainty::{
    ConformanceMethod, Contribution, JointlyKept, LimitKept, Quantity, Surface, Uncertainties, bounded, normal_quantile,
};

use super::acting::Case;
use super::answer::{forced, has_motion};
use super::floquet::Working;
use super::input::FixtureJob;
use super::lobes::{Rules, moduli};
use super::slip::Pushing;
use super::uncertain::{Drawn, FixtureQuantity, drawn, uncertainties};

/// What may give out.
const LIMITS: usize = 3;
const STABLE: usize = 0;
const CLOSED: usize = 1;
const HELD: usize = 2;
/// Their names, and the fields of the job that set them.
const NAMES: [(&str, &str); LIMITS] =
    [("stable", "/cut/depth_mm"), ("closed", "/fixture/clamp_force_n"), ("held", "/fixture/clamp")];
/// Sets of them of which the probability is asked: each alone, then all.
const SETS: [Together; 4] = [STABLE..=STABLE, CLOSED..=CLOSED, HELD..=HELD, STABLE..=HELD];
const ALL: usize = 3;
/// Most lines of one scrambling.
const MOST_LINES: usize = 16;
/// Lines of one scrambling on which vises are compared.
const COMPARED_LINES: usize = 4;
/// A margin beyond this, of a logarithm, is as good as without end.
const FAR: f64 = 50.0;
/// Steps toward the depth of a probability, and how near to it is enough, in standard normal scores.
const DEPTH_STEPS: usize = 12;
const NEAR_ENOUGH: f64 = 0.01;
/// Change of the logarithm of the depth by which the way to the wanted probability is begun.
const FIRST_STEP: f64 = 0.1;

/// Codes of what is said here.
pub(super) const EXPLANATION_CODES: &[&str] = &["probably_quiet", "probably_quiet_depth"];
/// Codes of the warnings made here.
pub(super) const WARNING_CODES: &[&str] = &["improbable_cut"];

/// How probable it is that the cut stays quiet, and what makes that uncertain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FixtureConformance {
    /// Every limit alone: `stable` (no chatter), `closed` (no joint opens in the forced motion; where a clamp force is given),
    /// `held` (nothing slips along the jaws in it; where their grip is given, too).
    pub limits: Vec<LimitKept>,
    /// All limits together.
    pub joint: JointlyKept,
    /// What the doubt is made of, the largest share first.
    pub contributions: Vec<Contribution>,
    /// Deepest cut of this speed that is quiet with the probability that is wanted; null where none is. Only with the analysis
    /// `certainty`.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_at_wanted_mm: Option<f64>,
    /// How the numbers were found.
    pub method: ConformanceMethod,
}

/// A vise that is judged by what may give out in it.
pub(super) struct Judged<'a> {
    job: &'a FixtureJob,
    case: &'a Case,
    rules: &'a Rules,
    monitor: &'a dyn Monitor,
    uncertainties: Uncertainties<FixtureQuantity>,
    /// Which limits there are.
    limits: Vec<usize>,
}

/// The same at one working point, with a response surface about it.
struct There<'a> {
    of: &'a Judged<'a>,
    working: Working,
    surface: Surface,
    /// Standard deviation of the logarithm of every quantity.
    scales: Vec<f64>,
    /// Change of every limit with every independent score.
    slopes: Vec<Vec<f64>>,
    deciding: usize,
    /// Along which limits change together, each as much as it is near.
    axis: Vec<f64>,
}

impl<'a> Judged<'a> {
    /// Of a checked job; `None` where nothing is uncertain.
    pub(super) fn of(
        job: &'a FixtureJob,
        case: &'a Case,
        rules: &'a Rules,
        monitor: &'a dyn Monitor,
    ) -> Result<Option<Self>, Failure> {
        let uncertainties = uncertainties(job)
            .map_err(|_| Failure::Internal("correlations of a checked job contradict each other".to_owned()))?;
        if uncertainties.of.is_empty() {
            return Ok(None);
        }
        let clamped = case.holding.clamp_force_n.is_some_and(|force| force > 0.0);
        let mut limits = vec![STABLE];
        limits.extend(clamped.then_some(CLOSED));
        limits.extend((clamped && case.grip.is_some()).then_some(HELD));
        Ok(Some(Self { job, case, rules, monitor, uncertainties, limits }))
    }

    pub(super) fn uncertainties(&self) -> &Uncertainties<FixtureQuantity> {
        &self.uncertainties
    }

    /// By how much the limits are kept, as logarithms.
    fn margins(&self, Drawn { case, friction }: &Drawn, working: Working) -> Result<Margins<LIMITS>, Failure> {
        let mut margins = [f64::INFINITY; LIMITS];
        if !has_motion(case, working, self.monitor)? {
            return Ok([f64::NEG_INFINITY; LIMITS]);
        }
        let modulus = moduli(self.rules, &case.holding, &case.cutting, working, &[working.depth_mm], self.monitor)?;
        let modulus = modulus.first().copied().unwrap_or(f64::NAN);
        margins[STABLE] = if modulus.is_nan() { f64::NEG_INFINITY } else { far(-modulus.ln()) };
        let Some(clamp_force_n) = case.holding.clamp_force_n.filter(|_| self.limits.contains(&CLOSED)) else {
            return Ok(margins);
        };
        let motion = forced(case, working, self.monitor)?;
        let over = |asked_n: f64| far((clamp_force_n / asked_n.max(0.0)).ln());
        margins[CLOSED] = over(motion.left_n.high.max(motion.right_n.high));
        if let Some(grip) = &case.grip {
            margins[HELD] = over(Pushing::new(case, working, &motion, grip).least_n(*friction));
        }
        Ok(margins)
    }

    /// Margins at what quantities come to; of a vise without an answer none is kept.
    fn tried(&self, factors: &[f64], working: Working) -> Result<Margins<LIMITS>, Failure> {
        match self.margins(&drawn(self.case, &self.uncertainties, factors), working) {
            Err(Failure::OutOfModel(_) | Failure::NotConverged { .. }) => Ok([f64::NEG_INFINITY; LIMITS]),
            found => found,
        }
    }

    /// The block of the answer. `deepest_mm` where a depth is looked for, too, and how deep.
    pub(super) fn conformance(&self, deepest_mm: Option<f64>) -> Result<FixtureConformance, Failure> {
        let there = There::new(self, self.case.working)?;
        let found = there.found()?;
        let joint = found.of[ALL];
        let wanted = self.job.uncertainty.wanted_probability;
        let probability = bounded(joint.probability);
        let kept = |&limit: &usize| {
            let (name, pointer) = NAMES[limit];
            LimitKept {
                limit: name.to_owned(),
                pointer: pointer.to_owned(),
                probability: bounded(found.of[limit].probability),
                numerical_error: found.of[limit].error,
                probability_above: None,
                probability_below: None,
            }
        };
        Ok(FixtureConformance {
            limits: self.limits.iter().map(kept).collect(),
            joint: JointlyKept { probability, numerical_error: joint.error, wanted, met: probability >= wanted },
            contributions: there.contributions(joint.probability, deepest_mm.is_some())?,
            depth_at_wanted_mm: match deepest_mm {
                Some(deepest_mm) => self.depth_mm(self.case.working, wanted, deepest_mm)?,
                None => None,
            },
            method: ConformanceMethod {
                integrated_lines: u32::try_from(found.lines).unwrap_or(u32::MAX),
                linear_probability: bounded(there.linear_probability()?),
                seed: self.job.uncertainty.seed,
            },
        })
    }

    /// The probability that all limits are kept at another working point.
    pub(super) fn probability(&self, working: Working) -> Result<f64, Failure> {
        Ok(bounded(There::new(self, working)?.found()?.of[ALL].probability))
    }

    /// Deepest cut up to `deepest_mm` with which all limits are kept with a probability: what is wanted of the standard normal
    /// score is nearly straight over the logarithm of the depth. `None` where not even a thousandth of it is.
    pub(super) fn depth_mm(&self, working: Working, wanted: f64, deepest_mm: f64) -> Result<Option<f64>, Failure> {
        let over = |depth_mm: f64| -> Result<f64, Failure> {
            let probability = self.probability(Working { depth_mm, ..working })?;
            // From the side on which the probability is kept.
            Ok(normal_quantile(probability) - normal_quantile(wanted) - 0.5 * NEAR_ENOUGH)
        };
        let (mut low, mut high) = (None, None);
        let least_mm = 1e-3 * deepest_mm;
        let mut depth_mm = working.depth_mm.clamp(least_mm, deepest_mm);
        let mut step = FIRST_STEP;
        for _ in 0..2 * DEPTH_STEPS {
            let here = over(depth_mm)?;
            if here.abs() < 0.5 * NEAR_ENOUGH {
                return Ok(Some(depth_mm));
            }
            if here > 0.0 {
                low = Some((depth_mm, here));
            } else {
                high = Some((depth_mm, here));
            }
            depth_mm = match (low, high) {
                (Some((from, above)), Some((to, below))) => {
                    let share: f64 = above / (above - below);
                    from * (to / from).powf(share.clamp(0.1, 0.9))
                }
                (Some((from, _)), None) if from >= deepest_mm => return Ok(Some(deepest_mm)),
                (None, Some((to, _))) if to <= least_mm => return Ok(None),
                (Some((from, _)), None) => (from * step.exp()).min(deepest_mm),
                (None, Some((to, _))) => (to * (-step).exp()).max(least_mm),
                (None, None) => return Ok(None),
            };
            step *= 2.0;
        }
        Ok(low.map(|(depth_mm, _)| depth_mm))
    }
}

/// A margin as it may be counted with.
fn far(margin: f64) -> f64 {
    margin.clamp(-FAR, FAR)
}

impl<'a> There<'a> {
    fn new(of: &'a Judged<'a>, working: Working) -> Result<Self, Failure> {
        let scale = |(_, one): (usize, &crate::certainty::Uncertain<FixtureQuantity>)| {
            0.5 * (one.distribution.at(1.0) / one.distribution.at(-1.0)).ln()
        };
        let scales: Vec<f64> = of.uncertainties.of.iter().enumerate().map(scale).collect();
        let medians: Vec<f64> = of.uncertainties.of.iter().map(|one| one.distribution.at(0.0)).collect();
        let surface = Surface::of(&vec![true; scales.len()], &mut |x| {
            let factor = |i: usize| medians[i] * (scales[i] * x[i]).exp();
            let margins = of.tried(&(0..x.len()).map(factor).collect::<Vec<_>>(), working)?;
            Ok(of.limits.iter().map(|&limit| margins[limit].max(-FAR)).collect())
        })?;
        let mut there = Self { of, working, surface, scales, slopes: Vec::new(), deciding: 0, axis: Vec::new() };
        there.set_slopes();
        Ok(there)
    }

    /// Margins by the response surface; infinite where there is no limit.
    fn near(&self, of: &Uncertainties<FixtureQuantity>, independent: &[f64], is_bent: bool) -> Margins<LIMITS> {
        let medians = self.of.uncertainties.of.iter().map(|one| one.distribution.at(0.0));
        let values = of.values(independent);
        let x: Vec<f64> = values
            .iter()
            .zip(medians)
            .zip(&self.scales)
            .map(|((value, median), scale)| (value / median).ln() / scale)
            .collect();
        let found = if is_bent { self.surface.at(&x) } else { self.surface.linear_at(&x) };
        let mut margins = [f64::INFINITY; LIMITS];
        self.of.limits.iter().zip(found).for_each(|(&limit, margin)| margins[limit] = margin);
        margins
    }

    /// Sets how the limits change with independent scores, and which is nearest by them.
    fn set_slopes(&mut self) {
        let count = self.scales.len();
        let uncertainties = &self.of.uncertainties;
        let change = |index: usize, limit: usize| {
            let at = |score: f64| {
                let mut independent = vec![0.0; count];
                independent[index] = score;
                self.near(uncertainties, &independent, true)[limit]
            };
            at(0.5) - at(-0.5)
        };
        let slopes: Vec<Vec<f64>> =
            self.of.limits.iter().map(|&limit| (0..count).map(|index| change(index, limit)).collect()).collect();
        let lengths: Vec<f64> =
            slopes.iter().map(|of| of.iter().map(|s| s * s).sum::<f64>().sqrt().max(1e-12)).collect();
        let distances: Vec<f64> =
            self.surface.at_point().iter().zip(&lengths).map(|(margin, length)| margin / length).collect();
        self.deciding = (0..distances.len()).min_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap_or(0);
        // A limit that lies across the lines would leave a step from line to line; one that is far away does not matter.
        let weight = |limit: usize| {
            let beyond = distances[limit] - distances[self.deciding].max(0.0);
            (-0.5 * beyond * beyond).exp() / lengths[limit]
        };
        let along = |index: usize| (0..slopes.len()).map(|limit| weight(limit) * slopes[limit][index]).sum();
        self.axis = (0..count).map(along).collect();
        self.slopes = slopes;
    }

    fn question(&self, most_lines: usize) -> Question<'_, { SETS.len() }> {
        let effort = Effort { seed: self.of.job.uncertainty.seed, most_lines };
        Question { axis: &self.axis, sets: SETS, effort, monitor: self.of.monitor }
    }

    fn found(&self) -> Result<Found<{ SETS.len() }>, Failure> {
        let of = &self.of.uncertainties;
        let mut real = |g: &[f64]| self.of.tried(&of.values(g), self.working);
        self.question(MOST_LINES).of_real(&mut real, &mut |g: &[f64]| Ok(self.near(of, g, true)))
    }

    /// The probability of all limits by a straight model.
    fn linear_probability(&self) -> Result<f64, Failure> {
        let of = &self.of.uncertainties;
        Ok(self.question(MOST_LINES).of(&mut |g: &[f64]| Ok(self.near(of, g, false)))?.of[ALL].probability)
    }

    /// What the doubt is made of; where it is asked, what half of a width makes of it: by how much the vises differ from those of
    /// the whole width on the same few lines.
    fn contributions(&self, probability: f64, asks: bool) -> Result<Vec<Contribution>, Failure> {
        let of = &self.of.uncertainties;
        let slopes = &self.slopes[self.deciding];
        let variance: f64 = slopes.iter().map(|s| s * s).sum();
        let on_few = |of: &Uncertainties<FixtureQuantity>| -> Result<f64, Failure> {
            let mut real = |g: &[f64]| self.of.tried(&of.values(g), self.working);
            Ok(self.question(COMPARED_LINES).of(&mut real)?.of[ALL].probability)
        };
        let now = if asks { Some(on_few(of)?) } else { None };
        let mut all = Vec::new();
        for (index, one) in of.of.iter().enumerate() {
            let share = if variance > 0.0 { slopes[index] * slopes[index] / variance } else { 0.0 };
            let halved = match now {
                Some(now) => Some(bounded(probability + on_few(&of.halved(index))? - now)),
                None => None,
            };
            all.push(Contribution {
                quantity: one.quantity.name().to_owned(),
                source: one.source,
                level: one.level,
                share_of_variance: of.scores.is_independent().then_some(share),
                joint_probability_if_halved: halved,
            });
        }
        Contribution::sort(&mut all);
        Ok(all)
    }
}

/// What is said of it.
pub(super) fn said(conformance: &FixtureConformance) -> Vec<Message> {
    let joint = &conformance.joint;
    let mut first = Message::new("probably_quiet")
        .with("percent", 100.0 * joint.probability)
        .with("wanted_percent", 100.0 * joint.wanted)
        .with("met", if joint.met { "yes" } else { "no" });
    let least = conformance.limits.iter().min_by(|a, b| a.probability.total_cmp(&b.probability));
    if let Some(least) = least {
        first = first.with("limit", least.limit.clone()).with("limit_percent", 100.0 * least.probability);
    }
    if let Some(largest) = conformance.contributions.iter().find(|one| one.share_of_variance.is_some()) {
        first = first
            .with("quantity", largest.quantity.clone())
            .with("share_percent", 100.0 * largest.share_of_variance.unwrap_or(0.0));
    }
    let deep = conformance.depth_at_wanted_mm.map(|depth_mm| {
        Message::new("probably_quiet_depth").with("depth_mm", depth_mm).with("wanted_percent", 100.0 * joint.wanted)
    });
    std::iter::once(first).chain(deep).collect()
}

/// What is warned of.
pub(super) fn warnings(conformance: &FixtureConformance) -> Option<Finding> {
    let joint = &conformance.joint;
    (!joint.met).then(|| {
        Finding::new("improbable_cut", "/uncertainty/wanted_probability")
            .measured(joint.probability, joint.wanted, "1")
            .with("percent", 100.0 * joint.probability)
            .with("wanted_percent", 100.0 * joint.wanted)
    })
}
