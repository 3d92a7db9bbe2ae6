//! Effects on the deflection model.
//!
//! The base solves y = C(z) F(t - y - e) for the radial error y + e. Every effect adds to the
//! compliance C, multiplies or adds to the force F, or adds an extra radial error e that opens the
//! gap and so lightens the cut (`diagnosis/4`). Here z runs along the shaft from the headstock end,
//! L is its length, u = z/L.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::expression::{Expression, NUMBERS, UserFormula};
use super::{Cause, Fit, Parameter};

/// A named physical effect on the deflection of a shaft in the lathe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum DeflectionEffect {
    /// Headstock softer or stiffer than stated: C += dw (1-u)².
    HeadstockCompliance {
        /// Added compliance of the headstock.
        #[schema(minimum = -1.0, maximum = 10.0, example = 0.022, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("dw"))))]
        delta_um_per_n: f64,
    },
    /// Tailstock softer or stiffer than stated: C += dw u².
    TailstockCompliance {
        /// Added compliance of the tailstock.
        #[schema(minimum = -1.0, maximum = 10.0, example = 0.01, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("dw"))))]
        delta_um_per_n: f64,
    },
    /// Carriage and tool softer or stiffer than stated: C += dw.
    CarriageCompliance {
        /// Added compliance of the carriage with the tool.
        #[schema(minimum = -1.0, maximum = 10.0, example = 0.01, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("dw"))))]
        delta_um_per_n: f64,
    },
    /// The shaft bends more or less than its drawing says (modulus, diameter): bending term times 1 + k.
    BendingScale {
        /// Relative change of the bending compliance.
        #[schema(minimum = -0.9, maximum = 5.0, example = 0.12, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k"))))]
        delta: f64,
    },
    /// Tailstock set off the axis away from the tool: e += a u between centres, a taper; else as the held shaft bends.
    TailstockOffset {
        /// Offset of the tailstock, positive away from the tool: thick at the tailstock.
        #[schema(minimum = -1000.0, maximum = 1000.0, example = 5.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("a"))))]
        offset_um: f64,
    },
    /// Bowed guideway: e += 4 b u(1-u).
    GuidewayBow {
        /// Radial error at the middle of the shaft.
        #[schema(minimum = -1000.0, maximum = 1000.0, example = 4.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("b"))))]
        bow_um: f64,
    },
    /// Wear of the tool along its path s: e += `u_w` (1 - exp(-s/s_0)) + k s/1000.
    ToolWear {
        /// Steady wear rate, radial.
        #[schema(minimum = 0.0, maximum = 1000.0, example = 3.2, extensions(("x-unit" = json!("um/km")), ("x-symbol" = json!("k"))))]
        rate_um_per_km: f64,
        /// Wear-in of a fresh edge, radial.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 300.0, default = 0.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("u_w"))))]
        wear_in_um: f64,
        /// Path over which the edge wears in.
        #[serde(default = "wear_in_path_m")]
        #[schema(minimum = 1.0, maximum = 100_000.0, default = 400.0, example = 400.0, extensions(("x-unit" = json!("m")), ("x-symbol" = json!("s_0"))))]
        wear_in_path_m: f64,
    },
    /// Machine and tool grow while warming: e -= g (1 - exp(-tau/T)), tau since the cold start.
    ThermalGrowth {
        /// Growth of the tool toward the work when warm.
        #[schema(minimum = 0.0, maximum = 600.0, example = 9.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("g"))))]
        growth_um: f64,
        /// Time constant of the warming.
        #[schema(minimum = 0.05, maximum = 1000.0, example = 7.5, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("T"))))]
        time_constant_min: f64,
    },
    /// The workpiece warms in the cut, pass after pass, and is gauged cold: e -= (d/2) alpha q (1 - exp(-`tau_c`/T)).
    WorkpieceHeating {
        /// Temperature rise of the work when warm.
        #[schema(minimum = 0.0, maximum = 500.0, example = 6.0, extensions(("x-unit" = json!("K")), ("x-symbol" = json!("q"))))]
        temperature_rise_k: f64,
        /// Time constant of the warming.
        #[schema(minimum = 0.05, maximum = 1000.0, example = 6.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("T"))))]
        time_constant_min: f64,
        /// Thermal expansion of the work.
        #[serde(default = "expansion_um_per_m_k")]
        #[schema(minimum = 0.1, maximum = 50.0, default = 11.5, example = 11.5, extensions(("x-unit" = json!("um/(m K)")), ("x-symbol" = json!("alpha"))))]
        expansion_um_per_m_k: f64,
    },
    /// All forces higher or lower than the law says: F times 1 + k.
    ForceLevel {
        /// Relative change of the force.
        #[schema(minimum = -0.95, maximum = 10.0, example = -0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k"))))]
        delta: f64,
    },
    /// Depth exponent other than the law's: F times (t/t_ref)^dx, t the engaged depth.
    DepthExponent {
        /// Change of the exponent.
        #[schema(minimum = -0.9, maximum = 3.0, example = 0.05, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("dx"))))]
        delta: f64,
        /// Depth at which the force stays as the law says.
        #[schema(minimum = 0.001, maximum = 100.0, example = 1.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_ref"))))]
        reference_depth_mm: f64,
    },
    /// Feed exponent other than the law's: F times (S/S_ref)^dp.
    FeedExponent {
        /// Change of the exponent.
        #[schema(minimum = -3.0, maximum = 3.0, example = 0.05, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("dp"))))]
        delta: f64,
        /// Feed at which the force stays as the law says.
        #[schema(minimum = 0.001, maximum = 10.0, example = 0.3, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_ref"))))]
        reference_feed_mm_per_rev: f64,
    },
    /// Speed exponent other than the law's: F times (V/V_ref)^dn.
    SpeedExponent {
        /// Change of the exponent.
        #[schema(minimum = -3.0, maximum = 3.0, example = -0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("dn"))))]
        delta: f64,
        /// Speed at which the force stays as the law says.
        #[schema(minimum = 0.1, maximum = 10_000.0, example = 100.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_ref"))))]
        reference_speed_m_per_min: f64,
    },
    /// Hardness that changes along the blank: F times 1 + h (u - 1/2).
    HardnessGradient {
        /// Relative difference of force between the two ends.
        #[schema(minimum = -1.9, maximum = 1.9, example = 0.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("h"))))]
        gradient: f64,
    },
    /// Force dip of a built-up edge at low speed: F times 1 - b exp(-((V - `V_b`)/w)²).
    BuiltUpEdge {
        /// Depth of the dip.
        #[schema(minimum = 0.0, maximum = 0.95, example = 0.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("b"))))]
        drop: f64,
        /// Speed of the deepest dip.
        #[schema(minimum = 0.1, maximum = 1000.0, example = 38.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_b"))))]
        centre_m_per_min: f64,
        /// Width of the dip.
        #[schema(minimum = 0.1, maximum = 1000.0, example = 18.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("w"))))]
        width_m_per_min: f64,
    },
    /// Ploughing or flank-wear force that does not vanish with the depth: passive force + F_0.
    PloughingForce {
        /// The added passive force.
        #[schema(minimum = 0.0, maximum = 10_000.0, example = 20.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F_0"))))]
        force_n: f64,
    },
    /// Backlash of the cross slide that turns with the feed: e += ± B/2, plus toward the headstock.
    ReversalBacklash {
        /// Jump of the radius between the two feed directions.
        #[schema(minimum = -1000.0, maximum = 1000.0, example = 4.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("B"))))]
        backlash_um: f64,
    },
    /// The tool is set off: e += c.
    SizeOffset {
        /// Radial error, the same everywhere.
        #[schema(minimum = -1000.0, maximum = 1000.0, example = 5.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("c"))))]
        offset_um: f64,
    },
    /// The headstock holds the shaft also against rotation, as a chuck of this stiffness does.
    ChuckRotationalStiffness {
        /// Rotational stiffness of the clamping.
        #[schema(minimum = 1.0, maximum = 1e15, example = 2.4e6, extensions(("x-unit" = json!("N mm/rad")), ("x-symbol" = json!("k_th"))))]
        ktheta_n_mm_per_rad: f64,
    },
    /// A steady rest set off the axis bends the shaft: e += delta phi(z), phi = 1 at the rest.
    SteadyRestOffset {
        /// Where the steady rest stands; one of the job's supports.
        #[schema(minimum = 0.0, maximum = 100_000.0, example = 310.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z_s"))))]
        station_mm: f64,
        /// How far the rest holds the shaft off its axis while nothing is cut, positive away from the tool.
        #[schema(minimum = -1000.0, maximum = 1000.0, example = 8.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("delta"))))]
        offset_um: f64,
    },
    /// The side not yet cut bends with the diameter of the blank (`section: mixed`).
    UncutSideStiffness {},
    /// Scatter of the spindle from trace to trace: no mean, adds to the uncertainty.
    SpindleScatter {
        /// Standard deviation, radial.
        #[schema(minimum = 0.0, maximum = 1000.0, example = 0.8, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("sigma_s"))))]
        sd_um: f64,
    },
    /// What no cause explains, as a diagnosis found it along the shaft or as it was measured: e += s r(z), straight between the
    /// places, beyond them as at the ends.
    Remainder {
        /// What the user calls it.
        #[serde(default, skip_serializing_if = "String::is_empty")]
        #[schema(max_length = 64, example = "guideway of lathe 7")]
        name: String,
        /// How much of it acts: 1 as it was found.
        #[serde(default = "super::as_found")]
        #[schema(minimum = -10.0, maximum = 10.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s"))))]
        scale: f64,
        /// Radial error along the shaft, by ascending places.
        #[schema(min_items = 2, max_items = 65)]
        profile: Vec<ErrorPoint>,
    },
    /// A formula of the user over place and conditions of the cut: e += its value.
    Formula {
        /// What the user calls it.
        #[serde(default, skip_serializing_if = "String::is_empty")]
        #[schema(max_length = 64, example = "ways of lathe 7")]
        name: String,
        /// Numbers, place and conditions of the cut by their fields, `k1`, `k2`, `k3`; + - * / ^ ( ), exp, ln, sqrt, abs, sin, cos, tanh,
        /// min, max. A unit stands in square brackets behind its number; the value is a length.
        #[schema(value_type = String, min_length = 1, max_length = 256, example = "k1*1[um]*sin(z_mm/40[mm])")]
        expression: Expression,
        /// Its number `k1`.
        #[serde(default)]
        #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k1"))))]
        k1: f64,
        /// How far it may lie from that before anything is measured, one standard deviation: a diagnosis fits it. 0: it is as stated.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1e6, default = 0.0, example = 0.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_k1"))))]
        k1_deviation: f64,
        /// Its number `k2`.
        #[serde(default)]
        #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k2"))))]
        k2: f64,
        /// How far it may lie from that before anything is measured, one standard deviation: a diagnosis fits it. 0: it is as stated.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1e6, default = 0.0, example = 0.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_k2"))))]
        k2_deviation: f64,
        /// Its number `k3`.
        #[serde(default)]
        #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k3"))))]
        k3: f64,
        /// How far it may lie from that before anything is measured, one standard deviation: a diagnosis fits it. 0: it is as stated.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1e6, default = 0.0, example = 0.2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_k3"))))]
        k3_deviation: f64,
    },
}

/// A radial error at a place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ErrorPoint {
    /// Station from the headstock end.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 120.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
    pub z_mm: f64,
    /// Radial error there, positive = oversize.
    #[schema(minimum = -1000.0, maximum = 1000.0, example = 3.5, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("r"))))]
    pub error_um: f64,
}

fn wear_in_path_m() -> f64 {
    400.0
}

fn expansion_um_per_m_k() -> f64 {
    11.5
}

impl DeflectionEffect {
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
            Self::HeadstockCompliance { .. } => 0,
            Self::TailstockCompliance { .. } => 1,
            Self::CarriageCompliance { .. } => 2,
            Self::BendingScale { .. } => 3,
            Self::TailstockOffset { .. } => 4,
            Self::GuidewayBow { .. } => 5,
            Self::ToolWear { .. } => 6,
            Self::ThermalGrowth { .. } => 7,
            Self::WorkpieceHeating { .. } => 8,
            Self::ForceLevel { .. } => 9,
            Self::DepthExponent { .. } => 10,
            Self::FeedExponent { .. } => 11,
            Self::SpeedExponent { .. } => 12,
            Self::HardnessGradient { .. } => 13,
            Self::BuiltUpEdge { .. } => 14,
            Self::PloughingForce { .. } => 15,
            Self::ReversalBacklash { .. } => 16,
            Self::SizeOffset { .. } => 17,
            Self::ChuckRotationalStiffness { .. } => 18,
            Self::SteadyRestOffset { .. } => 19,
            Self::UncutSideStiffness {} => 20,
            Self::SpindleScatter { .. } => 21,
            Self::Remainder { .. } => 22,
            Self::Formula { .. } => 23,
        }
    }

    /// It as a formula of the user, where it is one.
    pub(crate) fn formula(&self) -> Option<UserFormula<'_>> {
        let Self::Formula { name, expression, k1, k1_deviation, k2, k2_deviation, k3, k3_deviation } = self else {
            return None;
        };
        let (numbers, deviations) = ([*k1, *k2, *k3], [*k1_deviation, *k2_deviation, *k3_deviation]);
        Some(UserFormula { name, expression, numbers, deviations })
    }

    /// The effect of a cause with the values of its parameters, in the order of the catalogue. A remainder and a formula have
    /// none: shape and text are no numbers.
    pub fn from_parameters(cause: &Cause, values: &[f64]) -> Option<Self> {
        Some(match (cause.kind, values) {
            ("headstock_compliance", &[delta_um_per_n]) => Self::HeadstockCompliance { delta_um_per_n },
            ("tailstock_compliance", &[delta_um_per_n]) => Self::TailstockCompliance { delta_um_per_n },
            ("carriage_compliance", &[delta_um_per_n]) => Self::CarriageCompliance { delta_um_per_n },
            ("bending_scale", &[delta]) => Self::BendingScale { delta },
            ("tailstock_offset", &[offset_um]) => Self::TailstockOffset { offset_um },
            ("guideway_bow", &[bow_um]) => Self::GuidewayBow { bow_um },
            ("tool_wear", &[rate_um_per_km, wear_in_um, wear_in_path_m]) => {
                Self::ToolWear { rate_um_per_km, wear_in_um, wear_in_path_m }
            }
            ("thermal_growth", &[growth_um, time_constant_min]) => Self::ThermalGrowth { growth_um, time_constant_min },
            ("workpiece_heating", &[temperature_rise_k, time_constant_min, expansion_um_per_m_k]) => {
                Self::WorkpieceHeating { temperature_rise_k, time_constant_min, expansion_um_per_m_k }
            }
            ("force_level", &[delta]) => Self::ForceLevel { delta },
            ("depth_exponent", &[delta, reference_depth_mm]) => Self::DepthExponent { delta, reference_depth_mm },
            ("feed_exponent", &[delta, reference_feed_mm_per_rev]) => {
                Self::FeedExponent { delta, reference_feed_mm_per_rev }
            }
            ("speed_exponent", &[delta, reference_speed_m_per_min]) => {
                Self::SpeedExponent { delta, reference_speed_m_per_min }
            }
            ("hardness_gradient", &[gradient]) => Self::HardnessGradient { gradient },
            ("built_up_edge", &[drop, centre_m_per_min, width_m_per_min]) => {
                Self::BuiltUpEdge { drop, centre_m_per_min, width_m_per_min }
            }
            ("ploughing_force", &[force_n]) => Self::PloughingForce { force_n },
            ("reversal_backlash", &[backlash_um]) => Self::ReversalBacklash { backlash_um },
            ("size_offset", &[offset_um]) => Self::SizeOffset { offset_um },
            ("chuck_rotational_stiffness", &[ktheta_n_mm_per_rad]) => {
                Self::ChuckRotationalStiffness { ktheta_n_mm_per_rad }
            }
            ("steady_rest_offset", &[offset_um, station_mm]) => Self::SteadyRestOffset { station_mm, offset_um },
            ("uncut_side_stiffness", &[]) => Self::UncutSideStiffness {},
            ("spindle_scatter", &[sd_um]) => Self::SpindleScatter { sd_um },
            _ => return None,
        })
    }
}

/// The state that deflection effects depend on.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeflectionConditions {
    /// Path that this edge has cut when the job begins, before its first pass; needed by `tool_wear`.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1e6, example = 120.0, extensions(("x-unit" = json!("m")), ("x-symbol" = json!("s")), ("x-group" = json!("effects"))))]
    pub tool_path_at_start_m: Option<f64>,
    /// Time since the machine was cold when the job begins, before its first pass; needed by `thermal_growth`.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1e5, example = 15.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("tau")), ("x-group" = json!("effects"))))]
    pub warm_time_at_start_min: Option<f64>,
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

const fn fixed(name: &'static str, unit: &'static str, default: f64, lower: f64, upper: f64) -> Parameter {
    Parameter { name, unit, fit: Fit::Fixed { default }, prior_sd: 0.0, lower, upper }
}

const fn cause(
    kind: &'static str,
    equation: &'static str,
    parameters: &'static [Parameter],
    confounded_with: &'static [&'static str],
) -> Cause {
    Cause { kind, equation, parameters, conditions: &[], confounded_with, moves_mean: true }
}

/// The catalogue of the deflection model (`diagnosis/4`): prior standard deviations and bounds in
/// physical units. Bounds that depend on the job (a compliance cannot fall below zero) are narrowed there.
pub const CAUSES: &[Cause] = &[
    cause(
        "headstock_compliance",
        "diagnosis/4.1",
        &[amplitude("delta_um_per_n", "um/N", 0.010, -1.0, 0.15)],
        &["tailstock_offset", "hardness_gradient"],
    ),
    cause(
        "tailstock_compliance",
        "diagnosis/4.2",
        &[amplitude("delta_um_per_n", "um/N", 0.015, -1.0, 0.15)],
        &["tailstock_offset", "hardness_gradient"],
    ),
    cause(
        "carriage_compliance",
        "diagnosis/4.3",
        &[amplitude("delta_um_per_n", "um/N", 0.010, -1.0, 0.15)],
        &["size_offset", "ploughing_force"],
    ),
    cause(
        "bending_scale",
        "diagnosis/4.4",
        &[amplitude("delta", "1", 0.2, -0.6, 0.6)],
        &["guideway_bow", "force_level", "chuck_rotational_stiffness"],
    ),
    cause(
        "tailstock_offset",
        "diagnosis/4.5",
        &[amplitude("offset_um", "um", 10.0, -200.0, 200.0)],
        &["headstock_compliance", "tailstock_compliance", "tool_wear"],
    ),
    cause("guideway_bow", "diagnosis/4.6", &[amplitude("bow_um", "um", 8.0, -100.0, 100.0)], &["bending_scale"]),
    Cause {
        conditions: &["tool_path_at_start_m"],
        ..cause(
            "tool_wear",
            "diagnosis/4.7",
            &[
                amplitude("rate_um_per_km", "um/km", 5.0, 0.0, 100.0),
                amplitude("wear_in_um", "um", 4.0, 0.0, 30.0),
                fixed("wear_in_path_m", "m", 400.0, 1.0, 100_000.0),
            ],
            &["tailstock_offset", "thermal_growth", "size_offset"],
        )
    },
    Cause {
        conditions: &["warm_time_at_start_min"],
        ..cause(
            "thermal_growth",
            "diagnosis/4.8",
            &[
                amplitude("growth_um", "um", 8.0, 0.0, 60.0),
                shape("time_constant_min", "min", &[3.0, 6.0, 12.0, 24.0], 5.6, 0.5, 240.0),
            ],
            &["tool_wear"],
        )
    },
    cause(
        "workpiece_heating",
        "diagnosis/4.9",
        &[
            amplitude("temperature_rise_k", "K", 5.0, 0.0, 60.0),
            shape("time_constant_min", "min", &[3.0, 6.0, 12.0, 24.0], 5.6, 0.5, 240.0),
            fixed("expansion_um_per_m_k", "um/(m K)", 11.5, 0.1, 50.0),
        ],
        &["thermal_growth"],
    ),
    cause("force_level", "diagnosis/4.10", &[amplitude("delta", "1", 0.2, -0.6, 0.6)], &["bending_scale"]),
    cause(
        "depth_exponent",
        "diagnosis/4.11",
        &[amplitude("delta", "1", 0.15, -0.6, 0.6), fixed("reference_depth_mm", "mm", 1.0, 0.001, 100.0)],
        &["ploughing_force"],
    ),
    cause(
        "feed_exponent",
        "diagnosis/4.12",
        &[amplitude("delta", "1", 0.15, -0.6, 0.6), fixed("reference_feed_mm_per_rev", "mm/rev", 0.3, 0.001, 10.0)],
        &["tool_wear"],
    ),
    cause(
        "speed_exponent",
        "diagnosis/4.13",
        &[amplitude("delta", "1", 0.15, -0.8, 0.8), fixed("reference_speed_m_per_min", "m/min", 100.0, 0.1, 10_000.0)],
        &["built_up_edge", "thermal_growth"],
    ),
    cause(
        "hardness_gradient",
        "diagnosis/4.14",
        &[amplitude("gradient", "1", 0.3, -1.2, 1.2)],
        &["headstock_compliance", "tailstock_compliance"],
    ),
    cause(
        "built_up_edge",
        "diagnosis/4.15",
        &[
            amplitude("drop", "1", 0.3, 0.0, 0.7),
            shape("centre_m_per_min", "m/min", &[30.0, 42.0, 55.0], 12.0, 5.0, 150.0),
            shape("width_m_per_min", "m/min", &[15.0, 27.0], 8.0, 3.0, 100.0),
        ],
        &["speed_exponent"],
    ),
    cause(
        "ploughing_force",
        "diagnosis/4.16",
        &[amplitude("force_n", "N", 30.0, 0.0, 400.0)],
        &["depth_exponent", "carriage_compliance"],
    ),
    cause("reversal_backlash", "diagnosis/4.17", &[amplitude("backlash_um", "um", 8.0, -60.0, 60.0)], &["size_offset"]),
    cause(
        "size_offset",
        "diagnosis/4.18",
        &[amplitude("offset_um", "um", 8.0, -200.0, 200.0)],
        &["carriage_compliance"],
    ),
    cause(
        "chuck_rotational_stiffness",
        "diagnosis/4.19",
        // A diagnosis fits kappa = k/(k + 3EI/L) in [0, 1) instead, in which C is almost linear: it sets this field.
        &[shape("ktheta_n_mm_per_rad", "N mm/rad", &[], 0.5, 1.0, 1e15)],
        &["bending_scale", "force_level"],
    ),
    cause(
        "steady_rest_offset",
        "diagnosis/4.20",
        &[
            amplitude("offset_um", "um", 10.0, -200.0, 200.0),
            Parameter { name: "station_mm", unit: "mm", fit: Fit::OfJob, prior_sd: 0.0, lower: 0.0, upper: 100_000.0 },
        ],
        &["guideway_bow"],
    ),
    cause("uncut_side_stiffness", "diagnosis/4.21", &[], &["bending_scale"]),
    Cause {
        moves_mean: false,
        ..cause("spindle_scatter", "diagnosis/4.22", &[amplitude("sd_um", "um", 2.0, 0.0, 1000.0)], &[])
    },
    cause("remainder", "diagnosis/4.23", &[amplitude("scale", "1", 1.0, -3.0, 3.0)], &[]),
    cause("formula", "diagnosis/4.24", &NUMBERS, &[]),
];
