//! Effects on the ring that is turned on two supports (`diagnosis/6`).
//!
//! θ is the body angle, φ the rotation of the machine since the start, the origin that of the machine.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{Cause, Fit, Parameter};

/// A named physical effect on a ring in its supports.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum RingEffect {
    /// The blank has one more wave: radius += A cos(k θ + ph). May recur with another order.
    InitialHarmonic {
        /// Waves per revolution.
        #[schema(minimum = 2, maximum = 500, example = 3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k"))))]
        order: u32,
        /// Amplitude.
        #[schema(minimum = -10.0, maximum = 10.0, example = 0.02, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("A"))))]
        amplitude_mm: f64,
        /// Phase.
        #[schema(minimum = -100.0, maximum = 100.0, example = 1.0, extensions(("x-unit" = json!("rad")), ("x-symbol" = json!("ph"))))]
        phase_rad: f64,
    },
    /// The tip stands off its line: moved across the direction from the origin, positive counter-clockwise.
    ToolOffLine {
        /// Displacement.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("dx"))))]
        tangential_offset_mm: f64,
    },
    /// The right support stands elsewhere: moved in x.
    SupportPosition {
        /// Displacement.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.3, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("dx"))))]
        support_b_shift_mm: f64,
    },
    /// Both supports wear: they recede from the origin.
    SupportWear {
        /// Recession per revolution.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("um/rev")), ("x-symbol" = json!("w"))))]
        recession_um_per_rev: f64,
    },
    /// The left roller runs out: it moves by A cos(rho φ + ph) towards the origin. May recur with another ratio.
    RollerRunout {
        /// Amplitude.
        #[schema(minimum = -1.0, maximum = 1.0, example = 0.005, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("A"))))]
        amplitude_mm: f64,
        /// Diameter of the ring over that of the roller.
        #[schema(minimum = 0.01, maximum = 1000.0, example = 5.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho"))))]
        ratio: f64,
        /// Phase.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.3, extensions(("x-unit" = json!("rad")), ("x-symbol" = json!("ph"))))]
        phase_rad: f64,
    },
    /// The tool is pushed off: of a demanded depth 1/(1+k) is removed. Added to the job's compliance ratio.
    ToolPushOff {
        /// Compliance ratio.
        #[schema(minimum = 0.0, maximum = 1000.0, example = 0.4, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k"))))]
        push_off_ratio: f64,
    },
    /// The spark-out was left out, or shorter than stated.
    SparkOutMissing {
        /// Revolutions of spark-out that took place.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1e6, default = 0.0, example = 0.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_s"))))]
        spark_out_revolutions: f64,
    },
    /// The tool vibrates once per wave: it moves by A cos(m φ) towards the origin. May recur with another order.
    ChatterHarmonic {
        /// Amplitude.
        #[schema(minimum = -1.0, maximum = 1.0, example = 0.001, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("A"))))]
        amplitude_mm: f64,
        /// Waves per revolution of the machine.
        #[schema(minimum = 1, maximum = 1000, example = 23, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m"))))]
        waves_per_revolution: u32,
    },
    /// The ring slips on its drive and loses an angle per revolution of the machine.
    WorkSlip {
        /// Angle lost per revolution.
        #[schema(minimum = -90.0, maximum = 90.0, example = 0.5, extensions(("x-unit" = json!("deg/rev")), ("x-symbol" = json!("d"))))]
        slip_deg_per_rev: f64,
    },
}

/// The state that ring effects depend on: none.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RingConditions {}

impl RingEffect {
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
            Self::InitialHarmonic { .. } => 0,
            Self::ToolOffLine { .. } => 1,
            Self::SupportPosition { .. } => 2,
            Self::SupportWear { .. } => 3,
            Self::RollerRunout { .. } => 4,
            Self::ToolPushOff { .. } => 5,
            Self::SparkOutMissing { .. } => 6,
            Self::ChatterHarmonic { .. } => 7,
            Self::WorkSlip { .. } => 8,
        }
    }

    /// What tells two effects of one kind apart where a kind may recur.
    pub(crate) fn recurs_by(&self) -> Option<f64> {
        match self {
            Self::InitialHarmonic { order, .. } => Some(f64::from(*order)),
            Self::RollerRunout { ratio, .. } => Some(*ratio),
            Self::ChatterHarmonic { waves_per_revolution, .. } => Some(f64::from(*waves_per_revolution)),
            _ => None,
        }
    }

    /// The effect of a cause with the values of its parameters, in the order of the catalogue. Orders are rounded.
    pub fn from_parameters(cause: &Cause, values: &[f64]) -> Option<Self> {
        Some(match (cause.kind, values) {
            ("initial_harmonic", &[amplitude_mm, phase_rad, order]) => {
                Self::InitialHarmonic { order: whole(order), amplitude_mm, phase_rad }
            }
            ("tool_off_line", &[tangential_offset_mm]) => Self::ToolOffLine { tangential_offset_mm },
            ("support_position", &[support_b_shift_mm]) => Self::SupportPosition { support_b_shift_mm },
            ("support_wear", &[recession_um_per_rev]) => Self::SupportWear { recession_um_per_rev },
            ("roller_runout", &[amplitude_mm, phase_rad, ratio]) => {
                Self::RollerRunout { amplitude_mm, ratio, phase_rad }
            }
            ("tool_push_off", &[push_off_ratio]) => Self::ToolPushOff { push_off_ratio },
            ("spark_out_missing", &[spark_out_revolutions]) => Self::SparkOutMissing { spark_out_revolutions },
            ("chatter_harmonic", &[amplitude_mm, waves]) => {
                Self::ChatterHarmonic { amplitude_mm, waves_per_revolution: whole(waves) }
            }
            ("work_slip", &[slip_deg_per_rev]) => Self::WorkSlip { slip_deg_per_rev },
            _ => return None,
        })
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the range of an order")]
pub(crate) fn whole(order: f64) -> u32 {
    order.round().clamp(1.0, 1000.0) as u32
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

/// Phases on which a wave is tried first; amplitude and phase together are two linear sizes.
const PHASES: &[f64] = &[0.0, std::f64::consts::FRAC_PI_2];
/// Orders of a wave of the blank that are tried.
const ORDERS: &[f64] = &[2.0, 3.0, 4.0, 5.0, 6.0];
/// Ratios of ring to roller that are tried first.
const RATIOS: &[f64] = &[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0];
/// Orders of chatter that are tried.
const WAVES: &[f64] = &[
    8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0, 20.0, 21.0, 22.0, 23.0, 24.0, 25.0, 26.0,
    27.0, 28.0, 29.0, 30.0, 31.0, 32.0, 33.0, 34.0, 35.0, 36.0, 37.0, 38.0, 39.0, 40.0, 41.0, 42.0, 43.0, 44.0, 45.0,
    46.0, 47.0, 48.0,
];

/// The catalogue of the ring model (`diagnosis/6`).
pub const CAUSES: &[Cause] = &[
    cause(
        "initial_harmonic",
        "diagnosis/6.1",
        &[
            amplitude("amplitude_mm", "mm", 0.02, -1.0, 1.0),
            shape("phase_rad", "rad", PHASES, 1.0, -100.0, 100.0),
            shape("order", "1", ORDERS, 1.0, 2.0, 500.0),
        ],
        &["roller_runout"],
    ),
    cause(
        "tool_off_line",
        "diagnosis/6.2",
        &[amplitude("tangential_offset_mm", "mm", 0.5, -20.0, 20.0)],
        &["support_position"],
    ),
    cause(
        "support_position",
        "diagnosis/6.3",
        &[amplitude("support_b_shift_mm", "mm", 0.5, -20.0, 20.0)],
        &["tool_off_line"],
    ),
    cause(
        "support_wear",
        "diagnosis/6.4",
        &[amplitude("recession_um_per_rev", "um/rev", 0.2, 0.0, 20.0)],
        &["spark_out_missing"],
    ),
    cause(
        "roller_runout",
        "diagnosis/6.5",
        &[
            amplitude("amplitude_mm", "mm", 0.005, -0.5, 0.5),
            shape("phase_rad", "rad", PHASES, 1.0, -100.0, 100.0),
            shape("ratio", "1", RATIOS, 1.0, 0.5, 100.0),
        ],
        &["chatter_harmonic", "initial_harmonic"],
    ),
    cause("tool_push_off", "diagnosis/6.6", &[amplitude("push_off_ratio", "1", 0.3, 0.0, 20.0)], &[]),
    cause(
        "spark_out_missing",
        "diagnosis/6.7",
        &[Parameter {
            name: "spark_out_revolutions",
            unit: "1",
            fit: Fit::Fixed { default: 0.0 },
            prior_sd: 0.0,
            lower: 0.0,
            upper: 1e6,
        }],
        &["support_wear"],
    ),
    cause(
        "chatter_harmonic",
        "diagnosis/6.8",
        &[
            amplitude("amplitude_mm", "mm", 0.002, -0.1, 0.1),
            shape("waves_per_revolution", "1", WAVES, 4.0, 1.0, 1000.0),
        ],
        &["roller_runout"],
    ),
    cause("work_slip", "diagnosis/6.9", &[amplitude("slip_deg_per_rev", "deg/rev", 0.5, -20.0, 20.0)], &[]),
];
