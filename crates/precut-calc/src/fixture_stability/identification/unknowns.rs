//! Parameters to be found: their names, ranges and coordinates, and the cut and vise that values of them make.

use std::f64::consts::TAU;

use super::input::{IdentificationJob, Unknowns};
use crate::fixture_stability::job::input::{ConstantForce, FeedToward, MillingForce, SelfLocking, Vise, ViseJoint};
use crate::fixture_stability::model::cutting::{Cutting, engagement_rad};
use crate::fixture_stability::model::holding::{Holding, Jaw, Joint, MM_PER_S2};

/// A parameter that may be found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Parameter {
    Stiffness,
    Mass,
    NaturalFrequency,
    Damping,
    DampingRatio,
    StiffnessShare,
    DampingShare,
    JawMass,
    ForceCoefficient,
    ChipExponent,
    DepthExponent,
    SpindleSpeed,
}

impl Parameter {
    pub(super) const ALL: [Self; 12] = [
        Self::Stiffness,
        Self::Mass,
        Self::NaturalFrequency,
        Self::Damping,
        Self::DampingRatio,
        Self::StiffnessShare,
        Self::DampingShare,
        Self::JawMass,
        Self::ForceCoefficient,
        Self::ChipExponent,
        Self::DepthExponent,
        Self::SpindleSpeed,
    ];

    /// Field of `unknowns`.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Stiffness => "stiffness_n_per_mm",
            Self::Mass => "mass_kg",
            Self::NaturalFrequency => "natural_frequency_hz",
            Self::Damping => "damping_n_s_per_mm",
            Self::DampingRatio => "damping_ratio",
            Self::StiffnessShare => "movable_stiffness_share",
            Self::DampingShare => "movable_damping_share",
            Self::JawMass => "jaw_mass_kg",
            Self::ForceCoefficient => "force_coefficient",
            Self::ChipExponent => "chip_thickness_exponent",
            Self::DepthExponent => "depth_exponent",
            Self::SpindleSpeed => "spindle_speed_rpm",
        }
    }

    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::Stiffness => "N/mm",
            Self::Mass | Self::JawMass => "kg",
            Self::NaturalFrequency => "Hz",
            Self::Damping => "N s/mm",
            Self::ForceCoefficient => "N/mm2",
            Self::SpindleSpeed => "rev/min",
            Self::DampingRatio
            | Self::StiffnessShare
            | Self::DampingShare
            | Self::ChipExponent
            | Self::DepthExponent => "1",
        }
    }

    pub(super) fn range(self, of: &Unknowns) -> Option<[f64; 2]> {
        match self {
            Self::Stiffness => of.stiffness_n_per_mm,
            Self::Mass => of.mass_kg,
            Self::NaturalFrequency => of.natural_frequency_hz,
            Self::Damping => of.damping_n_s_per_mm,
            Self::DampingRatio => of.damping_ratio,
            Self::StiffnessShare => of.movable_stiffness_share,
            Self::DampingShare => of.movable_damping_share,
            Self::JawMass => of.jaw_mass_kg,
            Self::ForceCoefficient => of.force_coefficient,
            Self::ChipExponent => of.chip_thickness_exponent,
            Self::DepthExponent => of.depth_exponent,
            Self::SpindleSpeed => of.spindle_speed_rpm,
        }
    }

    /// Whether a ratio of it matters, not a difference: it is searched in its logarithm.
    pub(super) fn is_logarithmic(self) -> bool {
        !matches!(self, Self::StiffnessShare | Self::DampingShare | Self::ChipExponent | Self::DepthExponent)
    }
}

/// A parameter to be found, with its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Unknown {
    pub parameter: Parameter,
    pub from: f64,
    pub to: f64,
}

impl Unknown {
    pub(super) fn all(job: &IdentificationJob) -> Vec<Self> {
        let of = |parameter: Parameter| parameter.range(&job.unknowns).map(|[from, to]| Self { parameter, from, to });
        Parameter::ALL.into_iter().filter_map(of).collect()
    }

    /// Value at a coordinate from 0 to 1.
    pub(super) fn value(&self, at: f64) -> f64 {
        if self.parameter.is_logarithmic() {
            self.from * (self.to / self.from).powf(at)
        } else {
            self.from + (self.to - self.from) * at
        }
    }

    pub(super) fn coordinate(&self, value: f64) -> f64 {
        let at = if self.parameter.is_logarithmic() {
            (value / self.from).ln() / (self.to / self.from).ln()
        } else {
            (value - self.from) / (self.to - self.from)
        };
        at.clamp(0.0, 1.0)
    }

    /// Change of the coordinate that changes the logarithm, or the value of what is none, by 1.
    pub(super) fn coordinate_per_unit(&self) -> f64 {
        1.0 / if self.parameter.is_logarithmic() { (self.to / self.from).ln() } else { self.to - self.from }
    }
}

/// Everything that may be found, with values.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Values {
    pub force: MillingForce,
    stiffness_n_per_mm: f64,
    stiffness_share: f64,
    damping_n_s_per_mm: f64,
    damping_share: f64,
    mass_kg: f64,
    jaw: Option<Jaw>,
    pub spindle_rpm: Option<f64>,
}

impl Values {
    /// What the job states.
    pub(super) fn stated(job: &IdentificationJob) -> Self {
        let (mass_kg, left, right, _) = job.fixture.common();
        let stiffness_n_per_mm = left.stiffness_n_per_mm + right.stiffness_n_per_mm;
        let damping_n_s_per_mm = left.damping_n_s_per_mm + right.damping_n_s_per_mm;
        let damped = damping_n_s_per_mm > 0.0;
        Self {
            force: job.force.clone(),
            stiffness_n_per_mm,
            stiffness_share: left.stiffness_n_per_mm / stiffness_n_per_mm,
            damping_n_s_per_mm,
            damping_share: if damped { left.damping_n_s_per_mm / damping_n_s_per_mm } else { 0.5 },
            mass_kg,
            jaw: match &job.fixture {
                Vise::SelfLocking(_) => None,
                Vise::ConstantForce(v) => {
                    Some(Jaw { mass_kg: v.jaw_mass_kg, damping_n_s_per_mm: v.jaw_damping_n_s_per_mm })
                }
            },
            spindle_rpm: job.cut.spindle_speed_rpm,
        }
    }

    /// rad/s of the workpiece on both joints with the jaw held.
    fn rate(&self) -> f64 {
        (MM_PER_S2 * self.stiffness_n_per_mm / self.mass_kg).sqrt()
    }

    pub(super) fn get(&self, parameter: Parameter) -> f64 {
        match parameter {
            Parameter::Stiffness => self.stiffness_n_per_mm,
            Parameter::Mass => self.mass_kg,
            Parameter::NaturalFrequency => self.rate() / TAU,
            Parameter::Damping => self.damping_n_s_per_mm,
            Parameter::DampingRatio => MM_PER_S2 * self.damping_n_s_per_mm / (2.0 * self.mass_kg * self.rate()),
            Parameter::StiffnessShare => self.stiffness_share,
            Parameter::DampingShare => self.damping_share,
            Parameter::JawMass => self.jaw.map_or(0.0, |jaw| jaw.mass_kg),
            Parameter::ForceCoefficient => self.force.coefficient,
            Parameter::ChipExponent => self.force.chip_thickness_exponent,
            Parameter::DepthExponent => self.force.depth_exponent,
            Parameter::SpindleSpeed => self.spindle_rpm.unwrap_or(0.0),
        }
    }

    /// With values in the order of [`Parameter::ALL`], in which what follows from others comes after them.
    pub(super) fn set(&mut self, parameter: Parameter, value: f64) {
        match parameter {
            Parameter::Stiffness => self.stiffness_n_per_mm = value,
            Parameter::Mass => self.mass_kg = value,
            Parameter::NaturalFrequency => {
                self.mass_kg = MM_PER_S2 * self.stiffness_n_per_mm / (TAU * value).powi(2);
            }
            Parameter::Damping => self.damping_n_s_per_mm = value,
            Parameter::DampingRatio => {
                self.damping_n_s_per_mm = 2.0 * value * self.mass_kg * self.rate() / MM_PER_S2;
            }
            Parameter::StiffnessShare => self.stiffness_share = value,
            Parameter::DampingShare => self.damping_share = value,
            Parameter::JawMass => {
                if let Some(jaw) = &mut self.jaw {
                    jaw.mass_kg = value;
                }
            }
            Parameter::ForceCoefficient => self.force.coefficient = value,
            Parameter::ChipExponent => self.force.chip_thickness_exponent = value,
            Parameter::DepthExponent => self.force.depth_exponent = value,
            Parameter::SpindleSpeed => self.spindle_rpm = Some(value),
        }
    }

    /// At coordinates of the unknowns; the coefficient such that a measured force comes out.
    pub(super) fn at(job: &IdentificationJob, unknowns: &[Unknown], at: &[f64]) -> Self {
        let mut values = Self::stated(job);
        for (unknown, &at) in unknowns.iter().zip(at) {
            values.set(unknown.parameter, unknown.value(at));
        }
        if let Some(peak) = &job.peak_force
            && let Some(mut cutting) = values.cutting(job, peak.teeth)
        {
            cutting.coefficient = 1.0;
            let (high, low) = cutting.static_extremes_n(peak.feed_mm_per_tooth, peak.depth_mm);
            values.force.coefficient = peak.force_n / high.abs().max(low.abs()).max(f64::MIN_POSITIVE);
        }
        values
    }

    fn joints(&self) -> (Joint, Joint) {
        let joint = |stiffness_share: f64, damping_share: f64| Joint {
            stiffness_n_per_mm: stiffness_share * self.stiffness_n_per_mm,
            damping_n_s_per_mm: damping_share * self.damping_n_s_per_mm,
        };
        (joint(self.stiffness_share, self.damping_share), joint(1.0 - self.stiffness_share, 1.0 - self.damping_share))
    }

    pub(super) fn holding(&self) -> Holding {
        let (left, right) = self.joints();
        Holding {
            mass_kg: self.mass_kg,
            left,
            right,
            jaw: self.jaw,
            hung: None,
            hardening_per_mm2: 0.0,
            // Runs are bonded: what a joint asks of the clamp does not depend on it.
            clamp_force_n: None,
        }
    }

    /// `None` when the strip misses the cutter, which the check refuses.
    pub(super) fn cutting(&self, job: &IdentificationJob, teeth: u32) -> Option<Cutting> {
        let radius_mm = 0.5 * job.cutter.diameter_mm;
        let (entry_rad, exit_rad) = engagement_rad(radius_mm, job.cut.width_mm, job.cut.offset_mm)?;
        Some(Cutting {
            teeth: usize::try_from(teeth).ok()?,
            radius_mm,
            entry_rad,
            exit_rad,
            coefficient: self.force.coefficient,
            chip_exponent: self.force.chip_thickness_exponent,
            depth_exponent: self.force.depth_exponent,
            radial_ratio: self.force.radial_ratio,
            axial_ratio: self.force.axial_ratio,
            direction: match job.cut.feed_toward {
                FeedToward::MovableJaw => 1.0,
                FeedToward::FixedJaw => -1.0,
            },
            runout_mm: 0.0,
            process_damping_n_per_mm: 0.0,
        })
    }

    /// The vise as a job of fixture stability takes it.
    pub(super) fn vise(&self, clamp_force_n: Option<f64>) -> Vise {
        let (left, right) = self.joints();
        let joint =
            |j: Joint| ViseJoint { stiffness_n_per_mm: j.stiffness_n_per_mm, damping_n_s_per_mm: j.damping_n_s_per_mm };
        match self.jaw {
            None => Vise::SelfLocking(SelfLocking {
                workpiece_mass_kg: self.mass_kg,
                movable_joint: joint(left),
                fixed_joint: joint(right),
                clamp_force_n,
                clamp: None,
            }),
            Some(jaw) => Vise::ConstantForce(ConstantForce {
                workpiece_mass_kg: self.mass_kg,
                jaw_mass_kg: jaw.mass_kg,
                jaw_damping_n_s_per_mm: jaw.damping_n_s_per_mm,
                movable_joint: joint(left),
                fixed_joint: joint(right),
                clamp_force_n,
                clamp: None,
            }),
        }
    }
}
