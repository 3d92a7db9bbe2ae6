//! How probable it is that a cut stays quiet, closed and held (`certainty/6.1`).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Finding, Message, Monitor};
use crate::certainty::around::{Around, Asked, Real, far};
use crate::certainty::bounds::Extremes;
use crate::certainty::deepest::deepest_mm;
use crate::certainty::lines::{Margins, Together};
use crate::certainty::{
    ConformanceMethod, Contribution, JointlyKept, LimitKept, Uncertainties, bounded, improbable, probably,
};

use crate::fixture_stability::answer::study::{forced, has_motion};
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::FixtureJob;
use crate::fixture_stability::job::uncertain::{Drawn, FixtureQuantity, drawn, uncertainties};
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::lobes::{Rules, moduli};
use crate::fixture_stability::model::slip::Pushing;

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
/// Most lines of one scrambling: of the response surface, and of vises.
const MOST_LINES: [usize; 2] = [16; 2];
/// Lines of one scrambling on which vises are compared.
const COMPARED_LINES: usize = 4;

/// Codes of what is said here.
pub(in crate::fixture_stability) const EXPLANATION_CODES: &[&str] = &["probably_quiet", "probably_quiet_depth"];
/// Codes of the warnings made here.
pub(crate) const WARNING_CODES: &[&str] = &["improbable_cut"];

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
#[derive(Clone)]
pub(in crate::fixture_stability) struct Judged<'a> {
    job: &'a FixtureJob,
    case: &'a Case,
    rules: &'a Rules,
    monitor: &'a dyn Monitor,
    uncertainties: Uncertainties<FixtureQuantity>,
    /// Which limits there are.
    limits: Vec<usize>,
}

impl<'a> Judged<'a> {
    /// Of a checked job; `None` where nothing is uncertain.
    pub(in crate::fixture_stability) fn of(
        job: &'a FixtureJob,
        case: &'a Case,
        rules: &'a Rules,
        monitor: &'a dyn Monitor,
    ) -> Result<Option<Self>, Failure> {
        let uncertainties = uncertainties(job)
            .map_err(|_| Failure::Internal("correlations of a checked job contradict each other".to_owned()))?;
        if uncertainties.is_empty() {
            return Ok(None);
        }
        let clamped = case.holding.clamp_force_n.is_some_and(|force| force > 0.0);
        let mut limits = vec![STABLE];
        limits.extend(clamped.then_some(CLOSED));
        limits.extend((clamped && case.grip.is_some()).then_some(HELD));
        Ok(Some(Self { job, case, rules, monitor, uncertainties, limits }))
    }

    pub(in crate::fixture_stability) fn uncertainties(&self) -> &Uncertainties<FixtureQuantity> {
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

    /// About a working point; `real` are the margins there.
    fn around<'b>(&'b self, real: &'b Real<'b, LIMITS>) -> Result<Around<'b, FixtureQuantity, LIMITS, 4>, Failure> {
        Around::of(Asked {
            uncertainties: &self.uncertainties,
            limits: &self.limits,
            sets: SETS,
            seed: self.job.uncertainty.seed,
            most_lines: MOST_LINES,
            monitor: self.monitor,
            real,
        })
    }

    fn tried(&self, factors: &[f64], working: Working) -> Result<Margins<LIMITS>, Failure> {
        self.margins(&drawn(self.job, self.case, &self.uncertainties, factors)?, working)
    }

    /// The same with the quantities between bounds where they are held there.
    fn with(&self, uncertainties: Uncertainties<FixtureQuantity>) -> Self {
        Self { uncertainties, ..self.clone() }
    }

    /// Where within bounds the probability is least and most; `None` where there are none.
    fn extremes(&self, working: Working) -> Result<Option<Extremes>, Failure> {
        self.uncertainties.extremes(&mut |of| self.with(of.clone()).nearly(working))
    }

    /// The probability that all limits are kept, by a response surface alone.
    fn nearly(&self, working: Working) -> Result<f64, Failure> {
        let real = |factors: &[f64]| self.tried(factors, working);
        self.around(&real)?.nearly()
    }

    /// The block of the answer. `deepest_mm` where a depth is looked for, too, and how deep.
    pub(in crate::fixture_stability) fn conformance(
        &self,
        deepest_mm: Option<f64>,
    ) -> Result<FixtureConformance, Failure> {
        let working = self.case.working;
        let extremes = self.extremes(working)?;
        let mut told = match &extremes {
            Some(extremes) => self.with(self.uncertainties.held(&extremes.least)).told(deepest_mm.is_some())?,
            None => self.told(deepest_mm.is_some())?,
        };
        if let Some(Extremes { most, search, .. }) = &extremes {
            let most = self.with(self.uncertainties.held(most)).alone(working)?;
            told.joint = told.joint.least(most, *search);
        }
        if let Some(deepest_mm) = deepest_mm {
            told.depth_at_wanted_mm = self.depth_mm(working, told.joint.wanted, deepest_mm)?;
        }
        Ok(told)
    }

    /// The block with the quantities between bounds where they are, but for the depth.
    fn told(&self, is_compared: bool) -> Result<FixtureConformance, Failure> {
        let working = self.case.working;
        let real = |factors: &[f64]| self.tried(factors, working);
        let around = self.around(&real)?;
        let found = around.found()?;
        let joint = JointlyKept::of(found.of[ALL], self.job.uncertainty.wanted_probability);
        let mut contributions = around.contributions(&found, is_compared.then_some(COMPARED_LINES))?;
        contributions.extend(
            self.uncertainties
                .contributions_within(joint.probability, &mut |of| self.with(of.clone()).nearly(working))?,
        );
        Ok(FixtureConformance {
            limits: self.limits.iter().map(|&limit| LimitKept::of(NAMES[limit], found.of[limit])).collect(),
            joint,
            contributions,
            depth_at_wanted_mm: None,
            method: ConformanceMethod {
                integrated_lines: u32::try_from(found.lines).unwrap_or(u32::MAX),
                linear_probability: bounded(around.linear_probability()?),
                seed: self.job.uncertainty.seed,
            },
        })
    }

    /// The probability that all limits are kept at another working point, within bounds the least.
    pub(in crate::fixture_stability) fn probability(&self, working: Working) -> Result<f64, Failure> {
        match self.extremes(working)? {
            Some(extremes) => self.with(self.uncertainties.held(&extremes.least)).alone(working),
            None => self.alone(working),
        }
    }

    /// The same with the quantities between bounds where they are.
    fn alone(&self, working: Working) -> Result<f64, Failure> {
        let real = |factors: &[f64]| self.tried(factors, working);
        Ok(bounded(self.around(&real)?.found()?.of[ALL].probability))
    }

    /// Deepest cut up to `most_mm` with which all limits are kept with a probability; `None` where not even a thousandth of it is.
    pub(in crate::fixture_stability) fn depth_mm(
        &self,
        working: Working,
        wanted: f64,
        most_mm: f64,
    ) -> Result<Option<f64>, Failure> {
        deepest_mm(working.depth_mm, most_mm, wanted, &mut |depth_mm| self.probability(Working { depth_mm, ..working }))
    }
}

/// What is said of it.
pub(in crate::fixture_stability) fn said(conformance: &FixtureConformance) -> Vec<Message> {
    let FixtureConformance { limits, joint, contributions, .. } = conformance;
    let first = probably("probably_quiet", joint, limits, contributions);
    let deep = conformance.depth_at_wanted_mm.map(|depth_mm| quiet_to(depth_mm, joint));
    std::iter::once(first).chain(deep).collect()
}

/// How deep one may cut with the wanted probability.
pub(crate) fn quiet_to(depth_mm: f64, joint: &JointlyKept) -> Message {
    Message::new("probably_quiet_depth").with("depth_mm", depth_mm).with("wanted_percent", 100.0 * joint.wanted)
}

/// What is warned of.
pub(in crate::fixture_stability) fn warnings(conformance: &FixtureConformance) -> Option<Finding> {
    improbable("improbable_cut", &conformance.joint)
}
