//! Effects on a workpiece held in a vise under face milling.
//!
//! A factor multiplies what the job states; the rest are added terms.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{Cause, Fit, Parameter};

/// A named physical effect on the fixture model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum FixtureEffect {
    /// Joints stiffer or softer than stated: C1 and C2 times a factor.
    Stiffness {
        /// Factor on both stiffnesses.
        #[schema(minimum = 0.05, maximum = 20.0, example = 0.9, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f"))))]
        factor: f64,
    },
    /// More or less damping than stated: lambda1 and lambda2 times a factor.
    Damping {
        /// Factor on both dampings.
        #[schema(minimum = 0.05, maximum = 20.0, example = 1.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f"))))]
        factor: f64,
    },
    /// The workpiece with what moves with it heavier or lighter than stated.
    Mass {
        /// Factor on the mass.
        #[schema(minimum = 0.05, maximum = 20.0, example = 1.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f"))))]
        factor: f64,
    },
    /// Forces higher or lower than the law says: Cp times a factor.
    ForceCoefficient {
        /// Factor on the coefficient.
        #[schema(minimum = 0.05, maximum = 20.0, example = 1.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f"))))]
        factor: f64,
    },
    /// Another power of the chip thickness: k + delta, the force goes with h^(1-k).
    ChipThicknessExponent {
        /// Added to k.
        #[schema(minimum = -0.9, maximum = 0.9, example = 0.05, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("dk"))))]
        delta: f64,
    },
    /// Another power of the depth: mu + delta, the force goes with H^(1-mu).
    DepthExponent {
        /// Added to mu.
        #[schema(minimum = -0.9, maximum = 0.9, example = 0.05, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("dmu"))))]
        delta: f64,
    },
    /// One tooth stands out: its own chip is thicker by so much, that of the tooth behind it thinner.
    ToothRunout {
        /// How far it stands out.
        #[schema(minimum = -1.0, maximum = 1.0, example = 0.01, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r"))))]
        runout_mm: f64,
    },
    /// Flank contact damps at low speed: force -K H x'/V per tooth in cut.
    ProcessDamping {
        /// K.
        #[schema(minimum = 0.0, maximum = 1e6, example = 1.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_pd"))))]
        coefficient_n_per_mm: f64,
    },
    /// Joints stiffen as they are compressed: C (1 + c x²) of the joints that x alone compresses.
    ContactHardening {
        /// c.
        #[schema(minimum = 0.0, maximum = 1e6, example = 5000.0, extensions(("x-unit" = json!("1/mm2")), ("x-symbol" = json!("c"))))]
        cubic_per_mm2: f64,
    },
    /// The clamp force falls after clamping: F (1 - b (1 - exp(-t/T))).
    PreloadLoss {
        /// Share that is lost in the end.
        #[schema(minimum = 0.0, maximum = 1.0, example = 0.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("b"))))]
        share: f64,
        /// Time constant of the loss.
        #[schema(minimum = 0.001, maximum = 1e6, example = 5.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("T"))))]
        time_constant_min: f64,
    },
    /// A second mass hung on the workpiece by a spring and a damper.
    SecondMode {
        /// The mass.
        #[schema(minimum = 0.0001, maximum = 10_000.0, example = 0.6, extensions(("x-unit" = json!("kg")), ("x-symbol" = json!("m_4"))))]
        mass_kg: f64,
        /// Its own frequency on a workpiece that stands still.
        #[schema(minimum = 0.1, maximum = 100_000.0, example = 700.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_4"))))]
        frequency_hz: f64,
        /// Its damping ratio there.
        #[schema(minimum = 0.0, maximum = 2.0, example = 0.04, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("zeta_4"))))]
        damping_ratio: f64,
    },
    /// The movable jaw of a vise with constant clamp force heavier or lighter than stated.
    JawMass {
        /// Factor on the mass.
        #[schema(minimum = 0.05, maximum = 20.0, example = 1.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f"))))]
        factor: f64,
    },
}

impl FixtureEffect {
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
            Self::Stiffness { .. } => 0,
            Self::Damping { .. } => 1,
            Self::Mass { .. } => 2,
            Self::ForceCoefficient { .. } => 3,
            Self::ChipThicknessExponent { .. } => 4,
            Self::DepthExponent { .. } => 5,
            Self::ToothRunout { .. } => 6,
            Self::ProcessDamping { .. } => 7,
            Self::ContactHardening { .. } => 8,
            Self::PreloadLoss { .. } => 9,
            Self::SecondMode { .. } => 10,
            Self::JawMass { .. } => 11,
        }
    }

    /// The effect of a cause with the values of its parameters, in the order of the catalogue.
    pub fn from_parameters(cause: &Cause, values: &[f64]) -> Option<Self> {
        Some(match (cause.kind, values) {
            ("stiffness", &[factor]) => Self::Stiffness { factor },
            ("damping", &[factor]) => Self::Damping { factor },
            ("mass", &[factor]) => Self::Mass { factor },
            ("force_coefficient", &[factor]) => Self::ForceCoefficient { factor },
            ("chip_thickness_exponent", &[delta]) => Self::ChipThicknessExponent { delta },
            ("depth_exponent", &[delta]) => Self::DepthExponent { delta },
            ("tooth_runout", &[runout_mm]) => Self::ToothRunout { runout_mm },
            ("process_damping", &[coefficient_n_per_mm]) => Self::ProcessDamping { coefficient_n_per_mm },
            ("contact_hardening", &[cubic_per_mm2]) => Self::ContactHardening { cubic_per_mm2 },
            ("preload_loss", &[share, time_constant_min]) => Self::PreloadLoss { share, time_constant_min },
            ("second_mode", &[mass_kg, frequency_hz, damping_ratio]) => {
                Self::SecondMode { mass_kg, frequency_hz, damping_ratio }
            }
            ("jaw_mass", &[factor]) => Self::JawMass { factor },
            _ => return None,
        })
    }
}

/// The state that fixture effects depend on.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FixtureConditions {
    /// Time since the workpiece was clamped; needed by `preload_loss`.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1e6, example = 10.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("t")), ("x-group" = json!("effects"))))]
    pub time_since_clamping_min: Option<f64>,
}

const fn factor(prior_sd: f64) -> Parameter {
    Parameter { name: "factor", unit: "1", fit: Fit::Factor, prior_sd, lower: 0.3, upper: 3.0 }
}

const fn amplitude(name: &'static str, unit: &'static str, prior_sd: f64, lower: f64, upper: f64) -> Parameter {
    Parameter { name, unit, fit: Fit::Amplitude, prior_sd, lower, upper }
}

const fn shape(
    name: &'static str,
    unit: &'static str,
    grid: &'static [f64],
    prior_sd: f64,
    lower: f64,
    upper: f64,
) -> Parameter {
    Parameter { name, unit, fit: Fit::Shape { grid }, prior_sd, lower, upper }
}

const fn cause(
    kind: &'static str,
    equation: &'static str,
    parameters: &'static [Parameter],
    confounded_with: &'static [&'static str],
) -> Cause {
    Cause { kind, equation, parameters, conditions: &[], confounded_with, moves_mean: true }
}

/// The catalogue of the fixture model.
pub const CAUSES: &[Cause] = &[
    cause("stiffness", "diagnosis/6.20", &[factor(0.2)], &["force_coefficient", "mass"]),
    cause("damping", "diagnosis/6.21", &[factor(0.2)], &["process_damping"]),
    cause("mass", "diagnosis/6.22", &[factor(0.2)], &["stiffness"]),
    cause("force_coefficient", "diagnosis/6.23", &[factor(0.2)], &["stiffness", "depth_exponent"]),
    cause(
        "chip_thickness_exponent",
        "diagnosis/6.24",
        &[amplitude("delta", "1", 0.1, -0.4, 0.4)],
        &["force_coefficient"],
    ),
    cause("depth_exponent", "diagnosis/6.25", &[amplitude("delta", "1", 0.1, -0.4, 0.4)], &["contact_hardening"]),
    cause("tooth_runout", "diagnosis/6.26", &[amplitude("runout_mm", "mm", 0.01, -0.1, 0.1)], &["stiffness"]),
    cause(
        "process_damping",
        "diagnosis/6.27",
        &[amplitude("coefficient_n_per_mm", "N/mm", 100.0, 0.0, 5000.0)],
        &["damping"],
    ),
    cause(
        "contact_hardening",
        "diagnosis/6.28",
        &[amplitude("cubic_per_mm2", "1/mm2", 1000.0, 0.0, 50_000.0)],
        &["depth_exponent"],
    ),
    Cause {
        conditions: &["time_since_clamping_min"],
        ..cause(
            "preload_loss",
            "diagnosis/6.29",
            &[
                amplitude("share", "1", 0.2, 0.0, 0.9),
                shape("time_constant_min", "min", &[1.0, 3.0, 10.0, 30.0], 10.0, 0.01, 1000.0),
            ],
            &["stiffness"],
        )
    },
    cause(
        "second_mode",
        "diagnosis/6.30",
        &[
            amplitude("mass_kg", "kg", 0.5, 0.001, 50.0),
            shape("frequency_hz", "Hz", &[200.0, 350.0, 500.0, 700.0, 1000.0, 1400.0], 300.0, 10.0, 10_000.0),
            shape("damping_ratio", "1", &[0.02, 0.05], 0.03, 0.001, 1.0),
        ],
        &["mass", "stiffness"],
    ),
    cause("jaw_mass", "diagnosis/6.31", &[factor(0.2)], &["mass"]),
];
