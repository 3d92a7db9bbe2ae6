//! What is uncertain in a job of a vise: its quantities, and what a draw of them changes (`certainty/1.4`).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::Violations;
use crate::certainty::{
    Contradiction, Distribution, Level, Pair, Quantity, Source, Uncertain, Uncertainties, WidthUnit,
    check_correlations, check_presence, check_quantities,
};

use super::acting::Case;
use super::holding::Joint;
use super::input::{FixtureJob, Vise};

/// Standard deviation of the logarithm of what nobody states.
const JOINT_STIFFNESS: f64 = 0.10;
const DAMPING: f64 = 0.30;
const CUTTING_FORCE: f64 = 0.10;
const SET_BY_HAND: f64 = 0.15;
const SET_BY_PRESSURE: f64 = 0.05;
const FRICTION: f64 = 0.20;

/// A quantity that is not known exactly; all are factors on what the job states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FixtureQuantity {
    /// On the stiffness of both joints.
    JointStiffness,
    /// On the stiffness of the joint at the movable jaw.
    MovableJointStiffness,
    /// On the stiffness of the joint at the fixed jaw.
    FixedJointStiffness,
    /// On the damping of both joints.
    Damping,
    /// On the mass of the workpiece.
    WorkpieceMass,
    /// On all cutting forces.
    CuttingForce,
    /// On the clamp force.
    ClampForce,
    /// On the likely friction at the jaws.
    Friction,
}

impl Quantity for FixtureQuantity {
    fn name(self) -> &'static str {
        match self {
            Self::JointStiffness => "joint_stiffness",
            Self::MovableJointStiffness => "movable_joint_stiffness",
            Self::FixedJointStiffness => "fixed_joint_stiffness",
            Self::Damping => "damping",
            Self::WorkpieceMass => "workpiece_mass",
            Self::CuttingForce => "cutting_force",
            Self::ClampForce => "clamp_force",
            Self::Friction => "friction",
        }
    }

    fn unit(self) -> WidthUnit {
        WidthUnit::Percent
    }
}

impl FixtureQuantity {
    /// Puts its value into a case.
    fn put(self, factor: f64, draw: &mut Drawn) {
        let Case { holding, cutting, .. } = &mut draw.case;
        let stiffen = |joint: &mut Joint| joint.stiffness_n_per_mm *= factor;
        match self {
            Self::JointStiffness => [&mut holding.left, &mut holding.right].into_iter().for_each(stiffen),
            Self::MovableJointStiffness => stiffen(&mut holding.left),
            Self::FixedJointStiffness => stiffen(&mut holding.right),
            Self::Damping => {
                for joint in [&mut holding.left, &mut holding.right] {
                    joint.damping_n_s_per_mm *= factor;
                }
            }
            Self::WorkpieceMass => holding.mass_kg *= factor,
            Self::CuttingForce => cutting.coefficient *= factor,
            Self::ClampForce => holding.clamp_force_n = holding.clamp_force_n.map(|force| force * factor),
            Self::Friction => draw.friction *= factor,
        }
    }

    /// The field of the job without which there is nothing of that kind, where it is not there.
    fn missing_in(self, job: &FixtureJob) -> Option<&'static str> {
        match self {
            Self::ClampForce if job.fixture.common().3.is_none() => Some("/fixture/clamp_force_n"),
            Self::Friction if job.fixture.grip().is_none() => Some("/fixture/clamp"),
            _ => None,
        }
    }

    /// Whether it is a part of what `joint_stiffness` stands for.
    fn is_of_joints(self) -> bool {
        matches!(self, Self::MovableJointStiffness | Self::FixedJointStiffness)
    }
}

/// A vise as it may be.
#[derive(Debug, Clone)]
pub(super) struct Drawn {
    pub case: Case,
    /// Between jaws and workpiece; of no meaning where the job says nothing of the grip.
    pub friction: f64,
}

/// What is uncertain, and which probability is wanted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FixtureUncertainty {
    /// What is uncertain, in place of what is usual or beside it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 8, extensions(("x-advanced" = json!(true))))]
    pub quantities: Vec<FixtureUncertainQuantity>,
    /// Which of them go together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 28, extensions(("x-advanced" = json!(true))))]
    pub correlations: Vec<FixtureCorrelation>,
    /// Whether what is usual is uncertain, too, where nothing is said of it: stiffness and damping of the joints, cutting force,
    /// clamp force, friction.
    #[serde(default = "yes")]
    #[schema(default = true, example = true)]
    pub defaults: bool,
    /// Probability of a quiet cut that is wanted; below it the answer warns.
    #[serde(default = "nineteen_of_twenty")]
    #[schema(exclusive_minimum = 0.0, exclusive_maximum = 1.0, default = 0.95, example = 0.95, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("P"))))]
    pub wanted_probability: f64,
    /// Seed of the points over which probabilities are integrated.
    #[serde(default = "one")]
    #[schema(minimum = 0, maximum = 100_000_000, default = 1, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("seed"))))]
    pub seed: u32,
}

fn yes() -> bool {
    true
}

fn nineteen_of_twenty() -> f64 {
    0.95
}

fn one() -> u32 {
    1
}

impl Default for FixtureUncertainty {
    fn default() -> Self {
        Self {
            quantities: Vec::new(),
            correlations: Vec::new(),
            defaults: yes(),
            wanted_probability: nineteen_of_twenty(),
            seed: one(),
        }
    }
}

/// How a quantity is distributed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FixtureUncertainQuantity {
    /// Which.
    #[schema(example = "damping")]
    pub quantity: FixtureQuantity,
    /// How it is distributed about what the job states.
    pub distribution: Distribution,
}

/// How two quantities go together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FixtureCorrelation {
    /// Which two.
    #[schema(min_items = 2, max_items = 2, example = json!(["joint_stiffness", "damping"]))]
    pub between: Vec<FixtureQuantity>,
    /// Correlation of their standard normal scores.
    #[schema(exclusive_minimum = -1.0, exclusive_maximum = 1.0, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho"))))]
    pub coefficient: f64,
}

/// All quantities of a checked job that are uncertain, and how they go together.
pub(super) fn uncertainties(job: &FixtureJob) -> Result<Uncertainties<FixtureQuantity>, Contradiction> {
    let stated = &job.uncertainty;
    let of = |quantity, distribution, source| Uncertain { quantity, distribution, level: Level::Setup, source };
    let mut all: Vec<_> = stated
        .quantities
        .iter()
        .map(|one| of(one.quantity, one.distribution.clone(), Source::Stated))
        .filter(|one| one.distribution.relative() > 0.0)
        .collect();
    let names = |quantity: FixtureQuantity| stated.quantities.iter().any(|one| one.quantity == quantity);
    let parts_are_stated = stated.quantities.iter().any(|one| one.quantity.is_of_joints());
    for (quantity, log_standard_deviation) in usual(job) {
        let is_stated = names(quantity) || quantity == FixtureQuantity::JointStiffness && parts_are_stated;
        if stated.defaults && !is_stated {
            all.push(of(quantity, Distribution::Lognormal { log_standard_deviation }, Source::Default));
        }
    }
    Uncertainties::new(all, pairs(stated))
}

fn pairs(stated: &FixtureUncertainty) -> Vec<Pair<'_, FixtureQuantity>> {
    stated.correlations.iter().map(|pair| (&pair.between[..], pair.coefficient)).collect()
}

/// What is uncertain in every job that has it: quantities and the standard deviation of their logarithm.
fn usual(job: &FixtureJob) -> Vec<(FixtureQuantity, f64)> {
    use FixtureQuantity::{ClampForce, CuttingForce, Damping, Friction, JointStiffness};
    let set = if matches!(job.fixture, Vise::SelfLocking(_)) { SET_BY_HAND } else { SET_BY_PRESSURE };
    let friction = job.fixture.grip().and_then(|grip| grip.friction.range().scatter()).unwrap_or(FRICTION);
    let mut all =
        vec![(JointStiffness, JOINT_STIFFNESS), (Damping, DAMPING), (CuttingForce, CUTTING_FORCE), (ClampForce, set)];
    all.push((Friction, friction));
    all.retain(|(quantity, _)| quantity.missing_in(job).is_none());
    all
}

/// The vise where the quantities come to this.
pub(super) fn drawn(case: &Case, of: &Uncertainties<FixtureQuantity>, factors: &[f64]) -> Drawn {
    let friction = case.grip.as_ref().map_or(1.0, |grip| grip.friction.value);
    let mut draw = Drawn { case: case.clone(), friction };
    for (one, factor) in of.of.iter().zip(factors) {
        one.quantity.put(*factor, &mut draw);
    }
    draw
}

/// Finds what cannot be.
pub(super) fn check(job: &FixtureJob, violations: &mut Violations) {
    let stated = &job.uncertainty;
    let quantities: Vec<_> = stated.quantities.iter().map(|one| (one.quantity, &one.distribution)).collect();
    check_quantities(&quantities, violations);
    check_correlations(&pairs(stated), || uncertainties(job).err(), violations);
    check_presence(stated.quantities.iter().map(|one| one.quantity), |quantity| quantity.missing_in(job), violations);
}
