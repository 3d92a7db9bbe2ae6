//! What is uncertain in a job of a vise: its quantities, and what a draw of them changes (`certainty/1.4`).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Violations};
use crate::certainty::{
    Block, Contradiction, Distribution, Level, OpenEffects, ProbabilityCheck, Quantity, Uncertainties, WidthUnit,
    check_brought, open, uncertainty_block,
};
use crate::effects::{FixtureEffect, JointUncertainty};

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

    /// The effect that is the same quantity, as a diagnosis finds it; `None` where there is none.
    fn effect(self) -> Option<&'static str> {
        match self {
            Self::JointStiffness => Some("stiffness"),
            Self::Damping => Some("damping"),
            Self::WorkpieceMass => Some("mass"),
            Self::CuttingForce => Some("force_coefficient"),
            Self::MovableJointStiffness | Self::FixedJointStiffness | Self::ClampForce | Self::Friction => None,
        }
    }

    /// Whether what is not known of the effects of the job tells of it.
    fn is_brought(self, job: &FixtureJob) -> bool {
        self.effect().is_some_and(|kind| open::tells_of(&job.effects, &job.uncertainty.effects, kind))
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
        force_percent: Option<f64>, of CuttingForce;
        quantities: FixtureUncertainQuantity of FixtureQuantity (max_items = 8, extensions(("x-advanced" = json!(true)))), such as "damping";
        correlations: FixtureCorrelation (28), such as ["joint_stiffness", "damping"];
        effects: Vec<JointUncertainty>;
        /// Whether what is usual is uncertain, too, where nothing is said of it: stiffness and damping of the joints, cutting force,
        /// clamp force, friction.
        defaults;
        /// Probability of a quiet cut that is wanted; below it the answer warns.
        wanted_probability;
        check: ProbabilityCheck;
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
        !has_parts && !stated.contains(quantity) && !quantity.is_brought(job)
    };
    let of_usual = |quantity: FixtureQuantity| {
        let own = usual.iter().find(|(usual, _)| *usual == quantity);
        own.map(|&(_, log_standard_deviation)| Distribution::Lognormal { log_standard_deviation })
    };
    let left = usual.iter().map(|(quantity, _)| *quantity).filter(is_left);
    let of = |quantity| block.uncertain(quantity, Level::Setup, of_usual(quantity));
    let of = stated.iter().copied().chain(left).filter_map(of).collect();
    Ok(Uncertainties::new(of, block.pairs())?.beside(OpenEffects::of(&job.effects, &block.effects)))
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

/// Effects of which anything may be unknown while two numbers tell the limit: factors on stiffness, mass, damping and force, and what
/// acts on the clamp force alone.
const SCALING: [&str; 5] = ["stiffness", "damping", "mass", "force_coefficient", "preload_loss"];

/// Whether what is not known of the effects of a job is of those alone, and every quantity has a distribution.
pub(in crate::fixture_stability) fn scales_alone(job: &FixtureJob) -> bool {
    let is_open = |kind: &str| open::tells_of(&job.effects, &job.uncertainty.effects, kind);
    job.effects.iter().map(FixtureEffect::kind).all(|kind| SCALING.contains(&kind) || !is_open(kind))
        && !job.uncertainty.quantities.iter().any(|one| one.distribution.is_interval())
}

/// The vise where the quantities come to these values.
pub(in crate::fixture_stability) fn drawn(
    job: &FixtureJob,
    case: &Case,
    of: &Uncertainties<FixtureQuantity>,
    values: &[f64],
) -> Result<Drawn, Failure> {
    let case = match of.effects.effects(&job.effects, of.of_effects(values))? {
        Some(effects) => {
            let moved = Case::with(job, &effects, &job.conditions);
            let moved = moved.ok_or_else(|| Failure::Internal("a job that the check refuses".to_owned()))?;
            Case { working: case.working, ..moved }
        }
        None => case.clone(),
    };
    let friction = case.grip.as_ref().map_or(1.0, |grip| grip.friction.value);
    let mut draw = Drawn { case, friction };
    for (quantity, factor) in of.drawn(values) {
        quantity.put(factor, &mut draw);
    }
    Ok(draw)
}

/// Finds what cannot be.
pub(in crate::fixture_stability) fn check(job: &FixtureJob, violations: &mut Violations) {
    let block = &job.uncertainty;
    block.check(|| uncertainties(job).err(), |quantity| quantity.missing_in(job), violations);
    open::check(&job.effects, &block.effects, violations);
    check_brought(block.quantities.iter().map(|one| one.quantity), |one| one.is_brought(job), violations);
}
