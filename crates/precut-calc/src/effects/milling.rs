//! Effects on a cut in three directions, tool and workpiece yielding by modes.
//!
//! A factor multiplies what the job states; the rest are added terms.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{Cause, Fit, Parameter};

/// A named physical effect on the model of milling.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum MillingEffect {
    /// Natural frequency of one mode higher or lower than stated, its stiffness as it is.
    ModeFrequency {
        /// Number of the mode: those of the tool first, each in the order of the job.
        #[schema(minimum = 1, maximum = 40, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("i"))))]
        mode: u32,
        /// Factor on the natural frequency.
        #[schema(minimum = 0.05, maximum = 20.0, example = 0.95, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f"))))]
        factor: f64,
    },
    /// Damping of one mode higher or lower than stated.
    ModeDamping {
        /// Number of the mode: those of the tool first, each in the order of the job.
        #[schema(minimum = 1, maximum = 40, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("i"))))]
        mode: u32,
        /// Factor on the damping ratio.
        #[schema(minimum = 0.05, maximum = 20.0, example = 1.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f"))))]
        factor: f64,
    },
    /// One mode stiffer or softer at the cut than stated, its natural frequency as it is.
    ModeStiffness {
        /// Number of the mode: those of the tool first, each in the order of the job.
        #[schema(minimum = 1, maximum = 40, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("i"))))]
        mode: u32,
        /// Factor on the modal stiffness.
        #[schema(minimum = 0.05, maximum = 20.0, example = 0.9, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f"))))]
        factor: f64,
    },
    /// Forces of the edges higher or lower than the law says, in all directions alike.
    ForceCoefficient {
        /// Factor on all forces.
        #[schema(minimum = 0.05, maximum = 20.0, example = 1.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f"))))]
        factor: f64,
    },
    /// Radial forces of the edges higher or lower than the law says, the others as they are.
    RadialRatio {
        /// Factor on the radial force.
        #[schema(minimum = 0.05, maximum = 20.0, example = 1.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f"))))]
        factor: f64,
    },
    /// The first tooth stands out more than stated: its own chip is thicker by so much, that of the tooth behind it thinner.
    ToothRunout {
        /// How far it stands out.
        #[schema(minimum = -1.0, maximum = 1.0, example = 0.01, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r"))))]
        runout_mm: f64,
    },
    /// The flank rubs in the wave that it left more than stated, which damps slow cuts.
    ProcessDamping {
        /// Added to K_w.
        #[schema(minimum = 0.0, maximum = 1e6, example = 100.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_w"))))]
        coefficient_n_per_mm: f64,
    },
}

impl MillingEffect {
    /// The name of its kind, as in the contract.
    pub fn kind(&self) -> &'static str {
        self.cause().kind
    }

    /// Its entry in the catalogue.
    pub fn cause(&self) -> &'static Cause {
        &CAUSES[self.index()]
    }

    /// Position in [`CAUSES`]; a test holds that each kind stands where this says.
    const fn index(&self) -> usize {
        match self {
            Self::ModeFrequency { .. } => 0,
            Self::ModeDamping { .. } => 1,
            Self::ModeStiffness { .. } => 2,
            Self::ForceCoefficient { .. } => 3,
            Self::RadialRatio { .. } => 4,
            Self::ToothRunout { .. } => 5,
            Self::ProcessDamping { .. } => 6,
        }
    }

    /// Number of the mode that it is about, where it is about one: a kind may recur with another.
    pub(crate) fn mode(&self) -> Option<u32> {
        match *self {
            Self::ModeFrequency { mode, .. } | Self::ModeDamping { mode, .. } | Self::ModeStiffness { mode, .. } => {
                Some(mode)
            }
            _ => None,
        }
    }

    /// The factor that it is, where it is one.
    pub(crate) fn factor(&self) -> Option<f64> {
        match *self {
            Self::ModeFrequency { factor, .. }
            | Self::ModeDamping { factor, .. }
            | Self::ModeStiffness { factor, .. }
            | Self::ForceCoefficient { factor }
            | Self::RadialRatio { factor } => Some(factor),
            Self::ToothRunout { .. } | Self::ProcessDamping { .. } => None,
        }
    }

    /// The effect of a cause with the values of its parameters, in the order of the catalogue.
    pub fn from_parameters(cause: &Cause, values: &[f64]) -> Option<Self> {
        // At most forty.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let number = |mode: f64| mode.round().clamp(1.0, 1e6) as u32;
        Some(match (cause.kind, values) {
            ("mode_frequency", &[mode, factor]) => Self::ModeFrequency { mode: number(mode), factor },
            ("mode_damping", &[mode, factor]) => Self::ModeDamping { mode: number(mode), factor },
            ("mode_stiffness", &[mode, factor]) => Self::ModeStiffness { mode: number(mode), factor },
            ("force_coefficient", &[factor]) => Self::ForceCoefficient { factor },
            ("radial_ratio", &[factor]) => Self::RadialRatio { factor },
            ("tooth_runout", &[runout_mm]) => Self::ToothRunout { runout_mm },
            ("process_damping", &[coefficient_n_per_mm]) => Self::ProcessDamping { coefficient_n_per_mm },
            _ => return None,
        })
    }
}

const fn factor(prior_sd: f64) -> Parameter {
    Parameter { name: "factor", unit: "1", fit: Fit::Factor, prior_sd, lower: 0.3, upper: 3.0 }
}

const MODE: Parameter = Parameter { name: "mode", unit: "1", fit: Fit::OfJob, prior_sd: 1.0, lower: 1.0, upper: 40.0 };

const fn amplitude(name: &'static str, unit: &'static str, prior_sd: f64, lower: f64, upper: f64) -> Parameter {
    Parameter { name, unit, fit: Fit::Amplitude, prior_sd, lower, upper }
}

const fn cause(
    kind: &'static str,
    equation: &'static str,
    parameters: &'static [Parameter],
    confounded_with: &'static [&'static str],
) -> Cause {
    Cause { kind, equation, parameters, conditions: &[], confounded_with, moves_mean: true }
}

/// The catalogue of the model of milling.
pub const CAUSES: &[Cause] = &[
    cause("mode_frequency", "diagnosis/6.32", &[MODE, factor(0.05)], &[]),
    cause("mode_damping", "diagnosis/6.33", &[MODE, factor(0.3)], &["mode_stiffness", "process_damping"]),
    cause("mode_stiffness", "diagnosis/6.34", &[MODE, factor(0.2)], &["mode_damping", "force_coefficient"]),
    cause("force_coefficient", "diagnosis/6.35", &[factor(0.2)], &["mode_stiffness"]),
    cause("radial_ratio", "diagnosis/6.36", &[factor(0.2)], &["force_coefficient"]),
    cause("tooth_runout", "diagnosis/6.37", &[amplitude("runout_mm", "mm", 0.02, -0.2, 0.2)], &["force_coefficient"]),
    cause(
        "process_damping",
        "diagnosis/6.38",
        &[amplitude("coefficient_n_per_mm", "N/mm", 100.0, 0.0, 5000.0)],
        &["mode_damping"],
    ),
];
