//! How probable it is that the ring comes out within its tolerance (`certainty/7.1`).

use std::borrow::Cow;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Finding, Message, checkpoint};
use crate::certainty::lines::{Effort, Estimate, Question, SCRAMBLINGS, Sampled};
use crate::certainty::{
    Contribution, JointlyKept, Level, LimitKept, Quantity, Source, Surface, Uncertainties, WidthUnit, bounded,
    improbable, normal_below, probably,
};
use crate::effects::RingEffect;

use crate::ring_roundness::job::input::Job;
use crate::ring_roundness::job::uncertain::{PHASES, RingQuantity, drawn, uncertainties};
use crate::ring_roundness::model::causes::nodes;
use crate::ring_roundness::model::scene::Scene;
use crate::ring_roundness::model::search_wide::turned_nodes;
use crate::ring_roundness::model::simulate::{Share, or_none, side_by_side};
use crate::ring_roundness::model::stance::Stance;
use crate::ring_roundness::model::surface::{roundness_um, unevaluable};
use crate::ring_roundness::model::turning::turn;

/// The field that sets the limit.
pub(in crate::ring_roundness) const POINTER: &str = "/tolerance/roundness_um";
/// Most lines of one scrambling, of the response surface.
const MOST_LINES: usize = 64;
/// Most rings of one scrambling, and the error of the probability below which there are no more.
const MOST_RINGS: usize = 32;
const MOST_CUT: f64 = (SCRAMBLINGS * MOST_RINGS) as f64;
const ENOUGH: f64 = 0.01;
/// Rings that are cut one after the other for an answer, as a rule: those of the surface, and half of all others.
pub(in crate::ring_roundness) const RINGS: f64 = 130.0;
/// Rings that are cut at once between two looks at the monitor.
const AT_ONCE: usize = 16;
/// A margin beyond this, of a logarithm, is as good as without end.
const FAR: f64 = 10.0;
/// Share of the time that the response surface is expected to take.
const SURFACE_SHARE: f64 = 0.2;
/// Halvings in which a roundness of a probability is found: from e^10 to a thousandth of it.
const HALVINGS: usize = 16;
/// What no quantity stands for: phases of blank and rollers, and what bends.
const PHASES_NAME: &str = "phases";

/// Codes of what is said here.
pub(in crate::ring_roundness) const EXPLANATION_CODES: &[&str] = &["probably_round"];
/// Codes of the warnings made here.
pub(in crate::ring_roundness) const WARNING_CODES: &[&str] = &["improbable_roundness"];

/// How probable it is that the ring comes out within its tolerance, and what makes that uncertain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RingConformance {
    /// The tolerance of roundness.
    pub limits: Vec<LimitKept>,
    /// All limits together.
    pub joint: JointlyKept,
    /// Roundness deviation that one ring in twenty is below.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_low_um: f64,
    /// Roundness deviation that half of the rings are below.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_median_um: f64,
    /// Roundness deviation that nineteen rings in twenty are below.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_high_um: f64,
    /// Roundness deviation that a ring is below with the probability that is wanted: the tolerance that this setting holds.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_at_wanted_um: f64,
    /// Share of the doubt that is the same for all rings of the set-up, to first order: measuring the first tells of it.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub share_common_to_all: f64,
    /// What the doubt is made of, the largest share first; `phases` is what the quantities do not explain: how blank and rollers
    /// stand when the ring begins to turn.
    pub contributions: Vec<Contribution>,
    /// Rings that were cut for it.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rings_cut: u32,
    /// Joint probability of the model that is linear about the stated values.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub linear_probability: f64,
}

/// The setting of a ring, judged by its roundness.
struct Judged<'a> {
    job: &'a Job,
    scene: &'a Scene,
    end: &'a Stance,
    blank_mm: Vec<f64>,
    limit_um: f64,
    of: Uncertainties<RingQuantity>,
    share: Share<'a>,
    /// Rings that were cut beside those of the surface.
    cut: AtomicUsize,
}

/// The block of the answer, of a checked job with a tolerance.
pub(in crate::ring_roundness) fn conformance(
    job: &Job,
    scene: &Scene,
    end: &Stance,
    limit_um: f64,
    share: Share<'_>,
) -> Result<RingConformance, Failure> {
    let of = uncertainties(job)
        .map_err(|_| Failure::Internal("correlations of a checked job contradict each other".to_owned()))?;
    let blank_mm = scene.blank_mm(job, nodes(job) as usize).map_err(unevaluable)?;
    let mut judged = Judged { job, scene, end, blank_mm, limit_um, of, share, cut: AtomicUsize::new(0) };
    let surface = judged.surface()?;
    let extremes = judged.of.extremes(&mut |of| judged.by_surface(&surface, of, 0.0))?;
    let most = match &extremes {
        Some(extremes) => {
            judged.of = judged.of.held(&extremes.most);
            let most = judged.found(&surface)?.1.probability;
            judged.of = judged.of.held(&extremes.least);
            Some((most, extremes.search))
        }
        None => None,
    };
    let (sampled, found) = judged.found(&surface)?;
    let own = |g: &[f64]| judged.near(&surface, &judged.of, g);
    let nearly = |least: f64| judged.by_surface(&surface, &judged.of, least);
    let below = |um: f64| Ok(sampled.kept((limit_um / um).ln(), &own, &nearly)?.probability);
    let off = sampled.variance_off(&own);
    let now = nearly(0.0)?;
    let halved = |places: &[usize]| {
        let halved = places.iter().fold(judged.of.clone(), |of, &place| of.halved(place));
        Ok(bounded(found.probability + judged.by_surface(&surface, &halved, 0.0)? - now))
    };
    let slopes = judged.slopes(&surface, &judged.of);
    let mut contributions = judged.contributions(&slopes, off, halved)?;
    let by_surface = &mut |of: &Uncertainties<RingQuantity>| judged.by_surface(&surface, of, 0.0);
    contributions.extend(judged.of.contributions_within(found.probability, by_surface)?);
    let is_common = |one: &&Contribution| one.level == Level::Setup;
    let length = slopes.iter().map(|s| s * s).sum::<f64>().sqrt();
    let wanted = job.uncertainty.wanted_probability;
    let joint = JointlyKept::of(found, wanted);
    let stated = judged.near(&surface, &judged.of, &vec![0.0; slopes.len() + PHASES]);
    Ok(RingConformance {
        limits: vec![LimitKept::of(("roundness", POINTER), found)],
        joint: match most {
            Some((most, search)) => joint.least(most, search),
            None => joint,
        },
        roundness_low_um: judged.roundness_um(0.05, &below)?,
        roundness_median_um: judged.roundness_um(0.5, &below)?,
        roundness_high_um: judged.roundness_um(0.95, &below)?,
        roundness_at_wanted_um: judged.roundness_um(wanted, &below)?,
        share_common_to_all: contributions.iter().filter(is_common).filter_map(|one| one.share_of_variance).sum(),
        contributions,
        rings_cut: u32::try_from(sampled.asked()).unwrap_or(u32::MAX),
        linear_probability: bounded(normal_below(stated / length.max(1e-9))),
    })
}

/// Where a ring is turned, and of what.
struct Stage<'a> {
    scene: Cow<'a, Scene>,
    end: Cow<'a, Stance>,
    blank_mm: Cow<'a, [f64]>,
}

impl Judged<'_> {
    /// The response surface of the margin over the quantities, phases as the job states them; those between bounds come last.
    fn surface(&self) -> Result<Surface, Failure> {
        let with_distribution = self.of.count();
        let count = with_distribution + self.of.within.len();
        let mut cut = 0.0;
        let all = (1 + 2 * count + count * count.saturating_sub(1) / 2) as f64;
        Surface::of(&vec![true; count], &mut |x| {
            let (x, places) = x.split_at(with_distribution);
            // Effects are off by multiples of their standard deviation.
            let value = |(place, x): (usize, &f64)| {
                self.of.of.get(place).map_or(*x, |one| value_at(one.quantity, &one.distribution, *x))
            };
            let values: Vec<f64> = x.iter().enumerate().map(value).collect();
            // At phases as the job states them.
            let margin = self.margin(&self.of.held(places), &values, [f64::NEG_INFINITY; PHASES])?;
            cut += 1.0;
            self.report(SURFACE_SHARE * cut / all);
            Ok(vec![margin])
        })
    }

    /// Coordinates of the surface at independent scores.
    fn coordinates(&self, of: &Uncertainties<RingQuantity>, g: &[f64]) -> Vec<f64> {
        let values = of.values(&g[..self.of.dimensions()]);
        let one = |(place, value): (usize, f64)| {
            self.of.of.get(place).map_or(value, |one| coordinate(one.quantity, &one.distribution, value))
        };
        values.into_iter().enumerate().map(one).chain(of.places()).collect()
    }

    /// The margin by the response surface.
    fn near(&self, surface: &Surface, of: &Uncertainties<RingQuantity>, g: &[f64]) -> f64 {
        surface.at(&self.coordinates(of, g)).first().copied().unwrap_or(-FAR)
    }

    /// Change of that with every independent score.
    fn slopes(&self, surface: &Surface, of: &Uncertainties<RingQuantity>) -> Vec<f64> {
        let count = of.dimensions();
        let change = |index: usize| {
            let at = |score: f64| {
                let mut g = vec![0.0; count + PHASES];
                g[index] = score;
                self.near(surface, of, &g)
            };
            at(0.5) - at(-0.5)
        };
        (0..count).map(change).collect()
    }

    fn effort(&self) -> Effort {
        Effort { seed: self.job.uncertainty.seed, most_lines: MOST_LINES }
    }

    /// The probability that the margin is above `least`, by the response surface alone.
    fn by_surface(&self, surface: &Surface, of: &Uncertainties<RingQuantity>, least: f64) -> Result<f64, Failure> {
        // Lines run as about the stated widths, so that those of other widths are compared on the same.
        let slopes = self.slopes(surface, &self.of.held(&of.places()));
        let axis: Vec<f64> = slopes.into_iter().chain([0.0; PHASES]).collect();
        let question = Question { axis: &axis, sets: [0..=0], effort: self.effort(), monitor: self.share.monitor };
        Ok(question.of(&mut |g: &[f64]| Ok([self.near(surface, of, g) - least]))?.of[0].probability)
    }

    /// The probability that the tolerance is kept, and the rings that were turned for it.
    fn found(&self, surface: &Surface) -> Result<(Sampled, Estimate), Failure> {
        let own = |g: &[f64]| self.near(surface, &self.of, g);
        let nearly = |least: f64| self.by_surface(surface, &self.of, least);
        let mut real = |points: &[Vec<f64>]| self.margins(points);
        let dimensions = self.of.dimensions() + PHASES;
        let how = (dimensions, self.effort());
        let sampled = Sampled::until((ENOUGH, MOST_RINGS), how, (&own, &nearly), &mut real)?;
        let found = sampled.kept(0.0, &own, &nearly)?;
        Ok((sampled, found))
    }

    /// Margins at many points of independent scores.
    fn margins(&self, points: &[Vec<f64>]) -> Result<Vec<f64>, Failure> {
        let mut all = Vec::with_capacity(points.len());
        for some in points.chunks(AT_ONCE) {
            checkpoint(self.share.monitor)?;
            let count = self.of.dimensions();
            all.extend(side_by_side(some, |g| {
                let values = self.of.values(&g[..count]);
                self.margin(&self.of, &values, std::array::from_fn(|phase| g[count + phase]))
            })?);
            let cut = self.cut.fetch_add(some.len(), Ordering::Relaxed) + some.len();
            self.report(SURFACE_SHARE + (1.0 - SURFACE_SHARE) * (cut as f64 / MOST_CUT).min(1.0));
        }
        Ok(all)
    }

    fn report(&self, done: f64) {
        self.share.report(done, Message::new("stage_roundness_certainty"));
    }

    /// By how much the limit is kept, as a logarithm; of a ring that does not rest or is not touched it is not.
    fn margin(&self, of: &Uncertainties<RingQuantity>, values: &[f64], phases: [f64; PHASES]) -> Result<f64, Failure> {
        let effects = of.effects.effects(&self.job.effects, of.of_effects(values))?;
        let Some(stage) = self.stage(effects.as_deref())? else { return Ok(-FAR) };
        let Some(drawn) = drawn(&stage.scene, &stage.end, of, values, phases) else { return Ok(-FAR) };
        let mean = stage.blank_mm.iter().sum::<f64>() / stage.blank_mm.len() as f64;
        let mut blank: Vec<f64> = stage.blank_mm.iter().map(|radius| mean + drawn.waves * (radius - mean)).collect();
        let count = blank.len();
        blank.rotate_left(turned_nodes(drawn.turned, count));
        let monitor = self.share.monitor;
        let turned = or_none(turn::<Failure>(&blank, &drawn.setting, &mut |_, _| checkpoint(monitor)))?;
        let Some(turned) = turned.filter(|turned| turned.first_contact_rev.is_some()) else { return Ok(-FAR) };
        let found = or_none(roundness_um(&turned.radii_mm, self.job.filter, monitor))?;
        Ok(found.map_or(-FAR, |(um, _)| (self.limit_um / um).ln().clamp(-FAR, FAR)))
    }

    /// Setting and blank, with effects that are not quite those that are stated; `None` where the ring does not rest so.
    fn stage(&self, effects: Option<&[RingEffect]>) -> Result<Option<Stage<'_>>, Failure> {
        let Some(effects) = effects else {
            let (scene, end) = (Cow::Borrowed(self.scene), Cow::Borrowed(self.end));
            return Ok(Some(Stage { scene, end, blank_mm: Cow::Borrowed(&self.blank_mm) }));
        };
        let scene = Scene::of(self.job, effects);
        let Some(end) = scene.end() else { return Ok(None) };
        let blank_mm = or_none(scene.blank_mm(self.job, self.blank_mm.len()).map_err(unevaluable))?;
        let Some(blank_mm) = blank_mm else { return Ok(None) };
        Ok(Some(Stage { scene: Cow::Owned(scene), end: Cow::Owned(end), blank_mm: Cow::Owned(blank_mm) }))
    }

    /// Roundness deviation that a ring is below with a probability, um.
    fn roundness_um(&self, wanted: f64, below: &dyn Fn(f64) -> Result<f64, Failure>) -> Result<f64, Failure> {
        let (mut low, mut high) = (-FAR, FAR);
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            let is_enough = below(self.limit_um * f64::exp(middle))? >= wanted;
            (low, high) = if is_enough { (low, middle) } else { (middle, high) };
        }
        Ok(self.limit_um * f64::midpoint(low, high).exp())
    }

    /// What the doubt is made of; `off` is the variance that no quantity explains.
    fn contributions(
        &self,
        slopes: &[f64],
        off: f64,
        halved: impl Fn(&[usize]) -> Result<f64, Failure>,
    ) -> Result<Vec<Contribution>, Failure> {
        let variance = slopes.iter().map(|s| s * s).sum::<f64>() + off;
        let share = |own: f64| {
            let share = if variance > 0.0 { own / variance } else { 0.0 };
            self.of.is_independent().then_some(share)
        };
        let mut all = Vec::with_capacity(slopes.len() + 1);
        for (one, places) in self.of.named() {
            // Each has the score of its own place, where they are independent.
            let own = places.iter().filter_map(|&place| slopes.get(place)).map(|slope| slope * slope).sum();
            all.push(Contribution {
                quantity: one.name.to_owned(),
                source: one.source,
                level: one.level,
                share_of_variance: share(own),
                joint_probability_if_halved: Some(halved(&places)?),
            });
        }
        all.push(Contribution {
            quantity: PHASES_NAME.to_owned(),
            source: Source::Default,
            level: Level::Part,
            share_of_variance: share(off),
            joint_probability_if_halved: None,
        });
        Contribution::sort(&mut all);
        Ok(all)
    }
}

/// Half of what lies between scores of -1 and 1, of a factor as a logarithm, and the middle.
fn scale(quantity: RingQuantity, distribution: &crate::certainty::Distribution) -> (f64, f64) {
    let [low, middle, high] = [-1.0, 0.0, 1.0].map(|score| along(quantity, distribution.at(score)));
    (middle, 0.5 * (high - low))
}

fn along(quantity: RingQuantity, value: f64) -> f64 {
    if quantity.unit() == WidthUnit::Percent { value.ln() } else { value }
}

fn coordinate(quantity: RingQuantity, distribution: &crate::certainty::Distribution, value: f64) -> f64 {
    let (middle, half) = scale(quantity, distribution);
    (along(quantity, value) - middle) / half
}

fn value_at(quantity: RingQuantity, distribution: &crate::certainty::Distribution, x: f64) -> f64 {
    let (middle, half) = scale(quantity, distribution);
    let place = middle + half * x;
    if quantity.unit() == WidthUnit::Percent { place.exp() } else { place }
}

/// What the answer says of it.
pub(in crate::ring_roundness) fn said(found: &RingConformance) -> Message {
    probably("probably_round", &found.joint, &[], &found.contributions)
        .with("low_um", found.roundness_low_um)
        .with("high_um", found.roundness_high_um)
        .with("at_wanted_um", found.roundness_at_wanted_um)
}

/// The warning where it is less probable than wanted.
pub(in crate::ring_roundness) fn warning(found: &RingConformance) -> Option<Finding> {
    Some(improbable("improbable_roundness", &found.joint)?.with("at_wanted_um", found.roundness_at_wanted_um))
}
