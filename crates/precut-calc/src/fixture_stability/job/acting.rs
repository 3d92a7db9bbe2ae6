//! A job with its effects, digested into numbers.

use std::f64::consts::TAU;

use crate::effects::{FixtureConditions, FixtureEffect as Effect};

use crate::fixture_stability::job::input::{FeedToward, FixtureJob, Vise, ViseJoint};
use crate::fixture_stability::model::cutting::{Cutting, engagement_rad};
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::holding::{Holding, Hung, Jaw, Joint, MM_PER_S2};
use crate::fixture_stability::model::slip::Grip;

/// Share of the forces of all teeth that is round-off where they cancel: a sum of some thousand steps and harmonics.
const CANCELLED: f64 = 1e-12;

/// Everything that the physics needs of a job.
#[derive(Debug, Clone)]
pub(in crate::fixture_stability) struct Case {
    pub holding: Holding,
    pub cutting: Cutting,
    pub working: Working,
    /// How the jaws hold what pushes along them, where the job says it.
    pub grip: Option<Grip>,
}

impl Case {
    /// Of a checked and filled job. `None` when the strip misses the cutter or a speed is absent, which the check refuses.
    pub(in crate::fixture_stability) fn of(job: &FixtureJob) -> Option<Self> {
        Self::with(job, &job.effects, &job.conditions)
    }

    pub(in crate::fixture_stability) fn with(
        job: &FixtureJob,
        effects: &[Effect],
        conditions: &FixtureConditions,
    ) -> Option<Self> {
        let radius_mm = 0.5 * job.cutter.diameter_mm;
        let (entry_rad, exit_rad) = engagement_rad(radius_mm, job.cut.width_mm, job.cut.offset_mm)?;
        let (mass_kg, movable, fixed, clamp_force_n) = job.fixture.common();
        let joint =
            |j: ViseJoint| Joint { stiffness_n_per_mm: j.stiffness_n_per_mm, damping_n_s_per_mm: j.damping_n_s_per_mm };
        let jaw = match &job.fixture {
            Vise::SelfLocking(_) => None,
            Vise::ConstantForce(v) => {
                Some(Jaw { mass_kg: v.jaw_mass_kg, damping_n_s_per_mm: v.jaw_damping_n_s_per_mm })
            }
        };
        let mut case = Self {
            holding: Holding {
                mass_kg,
                left: joint(movable),
                right: joint(fixed),
                jaw,
                hung: None,
                hardening_per_mm2: 0.0,
                clamp_force_n,
            },
            cutting: Cutting {
                teeth: usize::try_from(job.cutter.teeth).ok()?,
                radius_mm,
                entry_rad,
                exit_rad,
                coefficient: job.force.coefficient,
                chip_exponent: job.force.chip_thickness_exponent,
                depth_exponent: job.force.depth_exponent,
                radial_ratio: job.force.radial_ratio,
                axial_ratio: job.force.axial_ratio,
                direction: match job.cut.feed_toward {
                    FeedToward::MovableJaw => 1.0,
                    FeedToward::FixedJaw => -1.0,
                },
                runout_mm: 0.0,
                process_damping_n_per_mm: 0.0,
            },
            working: Working { spindle_rpm: job.spindle_rpm()?, feed_mm: job.feed_mm()?, depth_mm: job.cut.depth_mm },
            grip: job.fixture.grip().map(Grip::new),
        };
        for effect in effects {
            case.add(effect, conditions);
        }
        Some(case)
    }

    fn add(&mut self, effect: &Effect, conditions: &FixtureConditions) {
        let (holding, cutting) = (&mut self.holding, &mut self.cutting);
        match *effect {
            Effect::Stiffness { factor } => {
                holding.left.stiffness_n_per_mm *= factor;
                holding.right.stiffness_n_per_mm *= factor;
            }
            Effect::Damping { factor } => {
                holding.left.damping_n_s_per_mm *= factor;
                holding.right.damping_n_s_per_mm *= factor;
            }
            Effect::Mass { factor } => holding.mass_kg *= factor,
            Effect::ForceCoefficient { factor } => cutting.coefficient *= factor,
            Effect::ChipThicknessExponent { delta } => cutting.chip_exponent += delta,
            Effect::DepthExponent { delta } => cutting.depth_exponent += delta,
            Effect::ToothRunout { runout_mm } => cutting.runout_mm += runout_mm,
            Effect::ProcessDamping { coefficient_n_per_mm } => {
                cutting.process_damping_n_per_mm += coefficient_n_per_mm;
            }
            Effect::ContactHardening { cubic_per_mm2 } => holding.hardening_per_mm2 += cubic_per_mm2,
            Effect::PreloadLoss { share, time_constant_min } => {
                let time = conditions.time_since_clamping_min.unwrap_or(0.0);
                let left = 1.0 + share * (-time / time_constant_min).exp_m1();
                holding.clamp_force_n = holding.clamp_force_n.map(|force| force * left);
            }
            Effect::SecondMode { mass_kg, frequency_hz, damping_ratio } => {
                let rate = TAU * frequency_hz;
                holding.hung = Some(Hung {
                    mass_kg,
                    joint: Joint {
                        stiffness_n_per_mm: mass_kg * rate * rate / MM_PER_S2,
                        damping_n_s_per_mm: 2.0 * damping_ratio * mass_kg * rate / MM_PER_S2,
                    },
                });
            }
            Effect::JawMass { factor } => {
                if let Some(jaw) = &mut holding.jaw {
                    jaw.mass_kg *= factor;
                }
            }
        }
    }

    /// A force on a joint, N: 0 where it is negative, or no more than the forces of teeth that cancel leave by round-off.
    pub(in crate::fixture_stability) fn above_round_off_n(&self, force_n: f64) -> f64 {
        let Working { feed_mm, depth_mm, .. } = self.working;
        let teeth_n = self.cutting.teeth as f64 * self.cutting.level(depth_mm) * self.cutting.chip_power(feed_mm);
        if force_n > CANCELLED * teeth_n { force_n } else { 0.0 }
    }

    /// The same at another depth.
    pub(in crate::fixture_stability) fn at_depth(&self, depth_mm: f64) -> Working {
        Working { depth_mm, ..self.working }
    }

    /// Whether the forced motion is proportional to H^(1-mu).
    pub(in crate::fixture_stability) fn is_linear(&self) -> bool {
        !self.cutting.uneven() && self.holding.hardening_per_mm2 <= 0.0 && self.cutting.process_damping_n_per_mm <= 0.0
    }
}
