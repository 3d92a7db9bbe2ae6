//! What is uncertain in a job of a vise: its quantities, and what a draw of them changes (`certainty/1.4`).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::Violations;
use crate::certainty::{
    Block, Contradiction, Distribution, Level, Quantity, Uncertainties, WidthUnit, uncertainty_block,
};

use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::{FixtureJob, Vise};
use crate::fixture_stability::job::usual_scatter::{
    CUTTING_FORCE, DAMPING, FRICTION, JOINT_STIFFNESS, SET_BY_HAND, SET_BY_PRESSURE,
};
use crate::fixture_stability::model::holding::Joint;

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
pub(in crate::fixture_stability) struct Drawn {
    pub case: Case,
    /// Between jaws and workpiece; of no meaning where the job says nothing of the grip.
    pub friction: f64,
}

uncertainty_block! {
    /// What is uncertain, and which probability is wanted.
    FixtureUncertainty {
        quantities: FixtureUncertainQuantity of FixtureQuantity (max_items = 8, extensions(("x-advanced" = json!(true)))), such as "damping";
        correlations: FixtureCorrelation (28), such as ["joint_stiffness", "damping"];
        /// Whether what is usual is uncertain, too, where nothing is said of it: stiffness and damping of the joints, cutting force,
        /// clamp force, friction.
        defaults;
        /// Probability of a quiet cut that is wanted; below it the answer warns.
        wanted_probability;
    }
}

/// All quantities of a checked job that are uncertain, and how they go together: those that it states, then the usual ones.
pub(in crate::fixture_stability) fn uncertainties(
    job: &FixtureJob,
) -> Result<Uncertainties<FixtureQuantity>, Contradiction> {
    let block = &job.uncertainty;
    let stated: Vec<FixtureQuantity> = block.quantities.iter().map(|one| one.quantity).collect();
    let usual = usual(job);
    let is_left = |quantity: &FixtureQuantity| {
        let has_parts = *quantity == FixtureQuantity::JointStiffness && stated.iter().any(|one| one.is_of_joints());
        !has_parts && !stated.contains(quantity)
    };
    let of_usual = |quantity: FixtureQuantity| {
        let own = usual.iter().find(|(usual, _)| *usual == quantity);
        own.map(|&(_, log_standard_deviation)| Distribution::Lognormal { log_standard_deviation })
    };
    let left = usual.iter().map(|(quantity, _)| *quantity).filter(is_left);
    let of = |quantity| block.uncertain(quantity, Level::Setup, of_usual(quantity));
    Uncertainties::new(stated.iter().copied().chain(left).filter_map(of).collect(), block.pairs())
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
pub(in crate::fixture_stability) fn drawn(case: &Case, of: &Uncertainties<FixtureQuantity>, factors: &[f64]) -> Drawn {
    let friction = case.grip.as_ref().map_or(1.0, |grip| grip.friction.value);
    let mut draw = Drawn { case: case.clone(), friction };
    for (one, factor) in of.of.iter().zip(factors) {
        one.quantity.put(*factor, &mut draw);
    }
    draw
}

/// Finds what cannot be.
pub(in crate::fixture_stability) fn check(job: &FixtureJob, violations: &mut Violations) {
    job.uncertainty.check(|| uncertainties(job).err(), |quantity| quantity.missing_in(job), violations);
}
