//! The block `conformance` of an answer (`certainty/2`).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Finding, Message};

use super::lines::Estimate;
use super::{Level, Quantity, Source, Uncertain, bounded, open};

/// How probable it is that a part is good, what makes that uncertain and what would help.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Conformance {
    /// Every limit alone.
    pub limits: Vec<LimitKept>,
    /// All limits together.
    pub joint: JointlyKept,
    /// What that means for several parts of one set-up.
    pub setup: SeveralParts,
    /// What the doubt is made of, the largest share first.
    pub contributions: Vec<Contribution>,
    /// What would raise the probability, the largest gain first; each was computed. Nothing is listed that gains less than
    /// its error.
    pub advice: Vec<Improvement>,
    /// Which readings to accept; null where the job says nothing of the measurement, without limits of size, and where these leave no
    /// reading that can be accepted.
    pub acceptance: Option<Acceptance>,
    /// How the numbers were found.
    pub method: ConformanceMethod,
}

/// Which readings to accept, by the guard band of ISO 14253-1:2017, and what that risks (JCGM 106:2012).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Acceptance {
    /// Standard uncertainty of a reading.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub measuring_uncertainty_um: f64,
    /// By how much the limits of acceptance lie within those of size: 1.65 times that, so that a part that is just out of them is
    /// accepted with 5 %.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub guard_band_um: f64,
    /// Largest deviation that is accepted; null where there is no upper limit.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub upper_um: Option<f64>,
    /// Smallest deviation that is accepted; null where there is no lower limit.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub lower_um: Option<f64>,
    /// Probability that a part is accepted.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub accepted: f64,
    /// Share of the accepted parts that are really out of their limits of size: the consumer's risk.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub bad_among_accepted: f64,
    /// Probability that a part is within its limits of size and is rejected: the producer's risk.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub good_and_rejected: f64,
    /// Twice the standard error of the probability that a part is good and accepted.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub numerical_error: f64,
}

/// The probability that a limit is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LimitKept {
    /// Which: `size` or `form`.
    #[schema(example = "size")]
    pub limit: String,
    /// The field of the job that sets it.
    #[schema(example = "/tolerance/diameter_um")]
    pub pointer: String,
    /// Probability that it is kept, between 1e-6 and 1 - 1e-6.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub probability: f64,
    /// Twice the standard error of the probability.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub numerical_error: f64,
    /// Probability that it is passed upward; null where there is no upper limit.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub probability_above: Option<f64>,
    /// Probability that it is passed downward; null where there is no lower limit.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub probability_below: Option<f64>,
}

/// The probability that all limits are kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JointlyKept {
    /// Probability that a part is good, between 1e-6 and 1 - 1e-6. Where bounds alone are known of a quantity it is the least within
    /// them, as is every other probability of the answer.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub probability: f64,
    /// Largest probability within the bounds; null where every quantity has a distribution.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub probability_most: Option<f64>,
    /// How least and most were looked for within the bounds; null where every quantity has a distribution.
    pub interval_search: Option<IntervalSearch>,
    /// Twice the standard error of the probability. Where nobody has checked it by the real model (`method`), what the bends of the
    /// response surface make of it, where that is more.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub numerical_error: f64,
    /// The probability that the job wants.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub wanted: f64,
    /// Whether it is reached.
    pub met: bool,
}

/// How the least and the largest probability within bounds were looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum IntervalSearch {
    /// At the ends alone: on every line that was looked at the probability rises or falls all along with each of the quantities.
    Ends,
    /// From several starts, along one quantity after the other: within the bounds, too. It may miss a narrow stretch.
    MultiStart,
}

/// Several parts of one set-up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SeveralParts {
    /// How many.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub count: u32,
    /// Probability that all of them are good.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub probability_all_good: f64,
    /// How many are good on average.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub expected_good: f64,
    /// Share of the doubt that is the same for all of them, to first order: measuring the first part tells of it.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub share_common_to_all: f64,
}

/// What a quantity adds to the doubt.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Contribution {
    /// Its name; `model:`, the effect and its parameter, where it is what a diagnosis leaves open of that.
    #[schema(example = "force")]
    pub quantity: String,
    /// Where its distribution is from.
    pub source: Source,
    /// Among what it varies.
    pub level: Level,
    /// Share of the variance of what decides, to first order; null where quantities are correlated, and where bounds alone are known.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub share_of_variance: Option<f64>,
    /// Probability of all limits with half of its width, all else equal; null where that would take long and nobody asked.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub joint_probability_if_halved: Option<f64>,
}

impl LimitKept {
    /// One that is passed in one way alone.
    pub(crate) fn of((limit, pointer): (&str, &str), found: Estimate) -> Self {
        Self {
            limit: limit.to_owned(),
            pointer: pointer.to_owned(),
            probability: bounded(found.probability),
            numerical_error: found.error,
            probability_above: None,
            probability_below: None,
        }
    }
}

impl JointlyKept {
    /// The same as the least within bounds.
    pub(crate) fn least(self, most: f64, search: IntervalSearch) -> Self {
        let most = bounded(most).max(self.probability);
        Self { probability_most: Some(most), interval_search: Some(search), ..self }
    }

    /// Against the probability that is wanted.
    pub(crate) fn of(found: Estimate, wanted: f64) -> Self {
        let probability = bounded(found.probability);
        Self {
            probability,
            probability_most: None,
            interval_search: None,
            numerical_error: found.error,
            wanted,
            met: probability >= wanted,
        }
    }
}

/// What is said of a probability: what it is, the limit that is passed most often, and what makes most of the doubt.
pub(crate) fn probably(
    code: &'static str,
    joint: &JointlyKept,
    limits: &[LimitKept],
    contributions: &[Contribution],
) -> Message {
    let mut said = Message::new(code)
        .with("percent", 100.0 * joint.probability)
        .with("wanted_percent", 100.0 * joint.wanted)
        .with("met", if joint.met { "yes" } else { "no" });
    said = with_most(said, joint);
    if let Some(least) = limits.iter().min_by(|a, b| a.probability.total_cmp(&b.probability)) {
        said = said.with("limit", least.limit.clone()).with("limit_percent", 100.0 * least.probability);
    }
    with_largest(said, contributions)
}

/// A sentence that tells the largest probability, too, where bounds alone are known of a quantity.
pub(crate) fn with_most(said: Message, joint: &JointlyKept) -> Message {
    match joint.probability_most {
        Some(most) => said.with("most_percent", 100.0 * most),
        None => said,
    }
}

/// A sentence that names what makes most of the doubt: a quantity, or an effect of which something is not known. Where quantities go
/// together none has a share of its own.
pub(crate) fn with_largest(said: Message, contributions: &[Contribution]) -> Message {
    let largest = contributions.iter().find_map(|one| Some((one, one.share_of_variance?)));
    let Some((largest, share)) = largest else { return said };
    let said = said.with("share_percent", 100.0 * share);
    match open::effect_of(&largest.quantity) {
        Some(kind) => said.with("effect", kind.to_owned()),
        None => said.with("quantity", largest.quantity.clone()),
    }
}

/// The warning where a probability is less than wanted.
pub(crate) fn improbable(code: &'static str, joint: &JointlyKept) -> Option<Finding> {
    if joint.met {
        return None;
    }
    let said = Finding::new(code, "/uncertainty/wanted_probability")
        .measured(joint.probability, joint.wanted, "1")
        .with("percent", 100.0 * joint.probability)
        .with("wanted_percent", 100.0 * joint.wanted);
    Some(match joint.probability_most {
        Some(most) => said.with("most_percent", 100.0 * most),
        None => said,
    })
}

impl Contribution {
    /// That of a quantity of which bounds alone are known: it has no share of a variance.
    pub(crate) fn within<Q: Quantity>(of: &Uncertain<Q>, halved: f64) -> Self {
        Self {
            quantity: of.quantity.name().to_owned(),
            source: of.source,
            level: of.level,
            share_of_variance: None,
            joint_probability_if_halved: Some(halved),
        }
    }

    /// The largest share first; where none has a share, what would help most.
    pub(crate) fn sort(all: &mut [Self]) {
        let of = |one: &Self| one.share_of_variance.or(one.joint_probability_if_halved);
        all.sort_by(|a, b| of(b).partial_cmp(&of(a)).unwrap_or(std::cmp::Ordering::Equal));
    }
}

/// Something that would raise the probability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Improvement {
    /// What to do.
    pub action: ImprovingAction,
    /// Probability that a part is good then; of a measured first part that a later one is, on average over the readings.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub joint_probability: f64,
    /// By how much that is more.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub gain: f64,
}

/// Something to do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ImprovingAction {
    /// Command all diameters larger by so much: `aim` does it.
    ShiftAim {
        /// By how much.
        #[schema(extensions(("x-unit" = json!("um"))))]
        shift_um: f64,
    },
    /// Measure the diameter of the first part at one place, and shift the command by what the model makes of it.
    MeasureFirstPart {
        /// Where.
        #[schema(extensions(("x-unit" = json!("mm"))))]
        z_mm: f64,
        /// Standard uncertainty of the gauge that is reckoned with.
        #[schema(extensions(("x-unit" = json!("um"))))]
        gauge_um: f64,
        /// The diameter error that is expected; without any other no shift is needed.
        #[schema(extensions(("x-unit" = json!("um"))))]
        expected_um: f64,
        /// Shift of the commanded diameter when the reading is as expected.
        #[schema(extensions(("x-unit" = json!("um"))))]
        shift_as_expected_um: f64,
        /// Further shift for every micrometre that the reading is larger.
        #[schema(extensions(("x-unit" = json!("1"))))]
        shift_um_per_um: f64,
    },
    /// Take the last pass with a smaller feed.
    LowerFeed {
        /// Feed of the last pass.
        #[schema(extensions(("x-unit" = json!("mm/rev"))))]
        feed_mm_per_rev: f64,
    },
    /// Leave less for the last pass: a compensated pass before it turns down to this diameter.
    ShallowerLastPass {
        /// Diameter that the pass before the last turns down to.
        #[schema(extensions(("x-unit" = json!("mm"))))]
        diameter_mm: f64,
    },
    /// Hold the part by one more steady rest.
    AddSteadyRest {
        /// Where.
        #[schema(extensions(("x-unit" = json!("mm"))))]
        z_mm: f64,
        /// How compliant it is taken to be.
        #[schema(extensions(("x-unit" = json!("um/N"))))]
        compliance_um_per_n: f64,
    },
    /// Hold the free end by a centre.
    AddCentre {
        /// Where.
        #[schema(extensions(("x-unit" = json!("mm"))))]
        z_mm: f64,
        /// How compliant it is taken to be.
        #[schema(extensions(("x-unit" = json!("um/N"))))]
        compliance_um_per_n: f64,
    },
}

impl Improvement {
    /// Of a probability to another one; `None` where it gains no more than both errors.
    pub(crate) fn of(action: ImprovingAction, now: Estimate, then: Estimate) -> Option<Self> {
        let gain = then.probability - now.probability;
        let told = Self { action, joint_probability: bounded(then.probability), gain };
        (gain > now.error + then.error).then_some(told)
    }

    /// The largest gain first.
    pub(crate) fn sort(all: &mut [Self]) {
        all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    }
}

impl Conformance {
    /// With more that would raise the probability.
    pub(crate) fn advise(&mut self, more: Vec<Improvement>) {
        self.advice.extend(more);
        Improvement::sort(&mut self.advice);
    }
}

/// How probabilities were found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ConformanceMethod {
    /// Lines through the scores that were integrated over the real model; 0 where a response surface about the stated values tells
    /// the probability, and nobody has checked that.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub integrated_lines: u32,
    /// Joint probability of the model that is linear about the stated values.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub linear_probability: f64,
    /// Seed of the points.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub seed: u32,
}

impl ConformanceMethod {
    /// Whether the real model was asked.
    pub(crate) fn is_checked(&self) -> bool {
        self.integrated_lines > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_within_bounds_tells_the_most_as_well() {
        let estimate = Estimate { probability: 0.7, error: 0.001 };
        let joint = JointlyKept::of(estimate, 0.9);
        let most =
            |joint: &JointlyKept| improbable("improbable", joint).map(|said| said.values.get("most_percent").cloned());
        assert_eq!(most(&joint), Some(None));
        let within = joint.least(0.99, IntervalSearch::Ends);
        assert_eq!(most(&within), Some(Some(99.0.into())));
        assert_eq!(most(&JointlyKept { met: true, ..within }), None);
    }
}
