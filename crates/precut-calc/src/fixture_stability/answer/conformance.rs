//! How probable it is that a cut stays quiet, closed and held (`certainty/6.1`).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Finding, Message, Monitor};
use crate::certainty::around::{Asked, Real, far};
use crate::certainty::deepest::deepest_mm;
use crate::certainty::judging::{Checking, Judging, Told};
use crate::certainty::lines::{Margins, Together};
use crate::certainty::{ConformanceMethod, Contribution, JointlyKept, LimitKept, Uncertainties, improbable, probably};

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
const SETS: [Together; LIMITS + 1] = [STABLE..=STABLE, CLOSED..=CLOSED, HELD..=HELD, STABLE..=HELD];
/// Lines of one scrambling on which vises are compared.
const COMPARED_LINES: usize = 4;

/// Codes of what is said here.
pub(in crate::fixture_stability) const EXPLANATION_CODES: &[&str] =
    &["probably_quiet", "probably_quiet_depth", "probability_unchecked"];
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

    /// The block of the answer, with the depth of the wanted probability up to `deepest_mm`.
    pub(in crate::fixture_stability) fn asked_for(&self, deepest_mm: f64) -> Result<FixtureConformance, Failure> {
        let (working, wanted) = (self.case.working, self.job.uncertainty.wanted_probability);
        let conformance = self.conformance(Checking::WithHalves(COMPARED_LINES))?;
        Ok(FixtureConformance { depth_at_wanted_mm: self.depth_mm(working, wanted, deepest_mm)?, ..conformance })
    }

    /// The block of the answer without that depth.
    pub(in crate::fixture_stability) fn conformance(&self, check: Checking) -> Result<FixtureConformance, Failure> {
        let wanted = self.job.uncertainty.wanted_probability;
        let Told { limits, joint, contributions, method } = self.told(self.case.working, wanted, check)?;
        Ok(FixtureConformance { limits, joint, contributions, depth_at_wanted_mm: None, method })
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

impl Judging<LIMITS, { LIMITS + 1 }> for Judged<'_> {
    type Of = FixtureQuantity;
    type At = Working;

    const NAMES: [(&'static str, &'static str); LIMITS] = NAMES;
    const MOST_LINES: [usize; 2] = [512, 16];
    const MOST_LINES_TRIED: [usize; 2] = Self::MOST_LINES;

    fn uncertainties(&self) -> &Uncertainties<FixtureQuantity> {
        &self.uncertainties
    }

    fn with(&self, uncertainties: Uncertainties<FixtureQuantity>) -> Self {
        Self { uncertainties, ..self.clone() }
    }

    fn real(&self, working: Working) -> Result<impl Fn(&[f64]) -> Result<Margins<LIMITS>, Failure>, Failure> {
        Ok(move |factors: &[f64]| self.margins(&drawn(self.job, self.case, &self.uncertainties, factors)?, working))
    }

    fn asked<'b>(
        &'b self,
        real: &'b Real<'b, LIMITS>,
        most_lines: [usize; 2],
    ) -> Asked<'b, FixtureQuantity, LIMITS, { LIMITS + 1 }> {
        Asked {
            uncertainties: &self.uncertainties,
            limits: &self.limits,
            sets: SETS,
            seed: self.job.uncertainty.seed,
            most_lines,
            monitor: self.monitor,
            real,
        }
    }
}

/// What is said of it.
pub(in crate::fixture_stability) fn said(conformance: &FixtureConformance) -> Vec<Message> {
    let FixtureConformance { limits, joint, contributions, method, .. } = conformance;
    let first = probably("probably_quiet", joint, limits, contributions);
    let deep = conformance.depth_at_wanted_mm.map(|depth_mm| quiet_to(depth_mm, joint));
    let unchecked = (!method.is_checked())
        .then(|| Message::new("probability_unchecked").with("error_percent", 100.0 * joint.numerical_error));
    std::iter::once(first).chain(unchecked).chain(deep).collect()
}

/// How deep one may cut with the wanted probability.
pub(crate) fn quiet_to(depth_mm: f64, joint: &JointlyKept) -> Message {
    Message::new("probably_quiet_depth").with("depth_mm", depth_mm).with("wanted_percent", 100.0 * joint.wanted)
}

/// What is warned of.
pub(in crate::fixture_stability) fn warnings(conformance: &FixtureConformance) -> Option<Finding> {
    improbable("improbable_cut", &conformance.joint)
}
