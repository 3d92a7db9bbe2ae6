//! Effects on machinability models (`diagnosis/5`).
//!
//! The base is L = c_0 + a_V ln V + ..., the output exp(L) or L itself. An effect adds to L, or turns the
//! output into a sum with something else. What feed schedules can do with each: `docs/physics/effects-machinability.md`.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::expression::{Expression, NUMBERS, UserFormula};
use super::{Cause, Fit, Parameter};

/// A named physical effect on an output of the cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum MachinabilityEffect {
    /// The whole output lies higher or lower: L += c.
    LevelShift {
        /// What is added: to the logarithm of the output, or to the output itself where its model is `semi_log`.
        #[schema(minimum = -1000.0, maximum = 1000.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("b"))))]
        delta_ln: f64,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// A batch of material lies higher or lower: L += b where the batch is this one.
    BatchShift {
        /// The batch.
        #[schema(min_length = 1, max_length = 64, example = "B")]
        batch: String,
        /// What is added: to the logarithm of the output, or to the output itself where its model is `semi_log`.
        #[schema(minimum = -1000.0, maximum = 1000.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("b"))))]
        delta_ln: f64,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// A level of a named factor lies higher or lower: L += b.
    FactorShift {
        /// The factor.
        #[schema(min_length = 1, max_length = 64, example = "coolant")]
        factor: String,
        /// Its level.
        #[schema(min_length = 1, max_length = 64, example = "off")]
        level: String,
        /// What is added: to the logarithm of the output, or to the output itself where its model is `semi_log`.
        #[schema(minimum = -1000.0, maximum = 1000.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("b"))))]
        delta_ln: f64,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Speed exponent other than the model's: L += delta ln(V/`V_r`).
    SpeedExponent {
        /// Change of the exponent.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("delta"))))]
        delta: f64,
        /// Speed about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.01, maximum = 20_000.0, example = 60.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_r"))))]
        reference_speed_m_per_min: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Feed exponent other than the model's: L += delta ln(S/`S_r`).
    FeedExponent {
        /// Change of the exponent.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("delta"))))]
        delta: f64,
        /// Feed about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-4, maximum = 20.0, example = 0.2, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_r"))))]
        reference_feed_mm_per_rev: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Depth exponent other than the model's: L += delta ln(t/`t_r`).
    DepthExponent {
        /// Change of the exponent.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("delta"))))]
        delta: f64,
        /// Depth about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-4, maximum = 1000.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_r"))))]
        reference_depth_mm: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Angle exponent other than the model's: L += delta ln(phi/`phi_r`).
    AngleExponent {
        /// Change of the exponent.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("delta"))))]
        delta: f64,
        /// Edge angle about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1.0, maximum = 179.0, example = 75.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi_r"))))]
        reference_angle_deg: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Curvature in the logarithm of the speed: L += q ln(V/`V_r`)².
    SpeedCurvature {
        /// Its coefficient.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("q"))))]
        coef: f64,
        /// Speed about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.01, maximum = 20_000.0, example = 60.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_r"))))]
        reference_speed_m_per_min: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Curvature in the logarithm of the feed: L += q ln(S/`S_r`)².
    FeedCurvature {
        /// Its coefficient.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("q"))))]
        coef: f64,
        /// Feed about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-4, maximum = 20.0, example = 0.2, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_r"))))]
        reference_feed_mm_per_rev: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Curvature in the logarithm of the depth: L += q ln(t/`t_r`)².
    DepthCurvature {
        /// Its coefficient.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("q"))))]
        coef: f64,
        /// Depth about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-4, maximum = 1000.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_r"))))]
        reference_depth_mm: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Speed and feed act together: L += q times the product of their logarithms about the reference.
    SpeedFeedInteraction {
        /// Its coefficient.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("q"))))]
        coef: f64,
        /// Speed about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.01, maximum = 20_000.0, example = 60.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_r"))))]
        reference_speed_m_per_min: Option<f64>,
        /// Feed about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-4, maximum = 20.0, example = 0.2, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_r"))))]
        reference_feed_mm_per_rev: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Feed and depth act together: L += q times the product of their logarithms about the reference.
    FeedDepthInteraction {
        /// Its coefficient.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("q"))))]
        coef: f64,
        /// Feed about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-4, maximum = 20.0, example = 0.2, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_r"))))]
        reference_feed_mm_per_rev: Option<f64>,
        /// Depth about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-4, maximum = 1000.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_r"))))]
        reference_depth_mm: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Speed and depth act together: L += q times the product of their logarithms about the reference.
    SpeedDepthInteraction {
        /// Its coefficient.
        #[schema(minimum = -100.0, maximum = 100.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("q"))))]
        coef: f64,
        /// Speed about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.01, maximum = 20_000.0, example = 60.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_r"))))]
        reference_speed_m_per_min: Option<f64>,
        /// Depth about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-4, maximum = 1000.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_r"))))]
        reference_depth_mm: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Two factors act together: L += b where both have these levels.
    FactorInteraction {
        /// One factor.
        #[schema(min_length = 1, max_length = 64, example = "shaft")]
        factor_1: String,
        /// Its level.
        #[schema(min_length = 1, max_length = 64, example = "slender")]
        level_1: String,
        /// The other.
        #[schema(min_length = 1, max_length = 64, example = "end")]
        factor_2: String,
        /// Its level.
        #[schema(min_length = 1, max_length = 64, example = "live_centre")]
        level_2: String,
        /// What is added: to the logarithm of the output, or to the output itself where its model is `semi_log`.
        #[schema(minimum = -1000.0, maximum = 1000.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("b"))))]
        delta_ln: f64,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Built-up edge at low speed: L += h exp(-((V-`V_b`)/w)²).
    BuiltUpEdge {
        /// Height of the hump.
        #[schema(minimum = 0.0, maximum = 1000.0, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("h"))))]
        hump_ln: f64,
        /// Speed of its top.
        #[schema(minimum = 0.1, maximum = 1000.0, example = 35.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_b"))))]
        centre_m_per_min: f64,
        /// Its width.
        #[schema(minimum = 0.1, maximum = 1000.0, example = 18.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("w"))))]
        width_m_per_min: f64,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Roughness cannot fall below the feed marks: Y = (Y⁸ + R⁸)^(1/8), R = k 1000 S²/(32 r).
    NoseRadiusFloor {
        /// Size of the marks relative to the geometric ones.
        #[schema(minimum = 0.0, maximum = 100.0, example = 1.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k"))))]
        k: f64,
        /// Nose radius of the insert.
        #[schema(minimum = 0.01, maximum = 100.0, example = 0.8, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r"))))]
        nose_radius_mm: f64,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Force of the edge radius that does not vanish with the chip: Y = `Y_0` + `F_0`.
    EdgeForceOffset {
        /// The added force.
        #[schema(minimum = 0.0, maximum = 1e6, example = 40.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F_0"))))]
        offset_n: f64,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Wear scales the output: L += k VB.
    WearMultiplicative {
        /// Rise per mm of flank wear.
        #[schema(minimum = 0.0, maximum = 1000.0, example = 1.0, extensions(("x-unit" = json!("1/mm")), ("x-symbol" = json!("k"))))]
        per_mm: f64,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Force of the worn flank: Y = `Y_0` + `K_w` VB (t/`t_r`)^q.
    WearForceAdditive {
        /// Force per mm of flank wear at the reference depth.
        #[schema(minimum = 0.0, maximum = 1e6, example = 480.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_w"))))]
        n_per_mm: f64,
        /// How it grows with the depth.
        #[serde(default)]
        #[schema(minimum = -3.0, maximum = 3.0, default = 0.0, example = 0.25, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("q"))))]
        depth_power: f64,
        /// Depth about which it turns; of the job's `reference` where left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-4, maximum = 1000.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_r"))))]
        reference_depth_mm: Option<f64>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// Wear-in of a fresh edge: VB = `VB_0` (1 - exp(-T/`T_0`)) + r T in place of the model.
    WearIn {
        /// Wear of the wear-in.
        #[schema(minimum = 0.0, maximum = 10.0, example = 0.07, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("VB_0"))))]
        wear_in_mm: f64,
        /// Its time constant.
        #[schema(minimum = 0.01, maximum = 1e4, example = 4.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("T_0"))))]
        time_constant_min: f64,
        /// Steady rate.
        #[schema(minimum = 0.0, maximum = 10.0, example = 0.01, extensions(("x-unit" = json!("mm/min")), ("x-symbol" = json!("r"))))]
        rate_mm_per_min: f64,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// What no cause explains, as a diagnosis found it over one or two conditions of the cut: L += s r, straight between the
    /// places (of speed, feed and depth in their logarithms), beyond them as at the ends.
    Remainder {
        /// What the user calls it.
        #[serde(default, skip_serializing_if = "String::is_empty")]
        #[schema(max_length = 64, example = "island of lathe 7")]
        name: String,
        /// How much of it acts: 1 as it was found.
        #[serde(default = "super::as_found")]
        #[schema(minimum = -10.0, maximum = 10.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s"))))]
        scale: f64,
        /// Its places: each states the same one or two conditions; ascending by the first of them, then by the second, each value
        /// of one with each of the other.
        #[schema(min_items = 2, max_items = 128)]
        profile: Vec<RemainderPoint>,
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
    /// A formula of the user over the conditions of the cut: L += its value.
    Formula {
        /// What the user calls it.
        #[serde(default, skip_serializing_if = "String::is_empty")]
        #[schema(max_length = 64, example = "island of lathe 7")]
        name: String,
        /// Numbers, conditions of the cut by their fields, `k1`, `k2`, `k3`; + - * / ^ ( ), exp, ln, sqrt, abs, sin, cos, tanh, min, max. A
        /// unit stands in square brackets behind its number; the value has none.
        #[schema(value_type = String, min_length = 1, max_length = 256, example = "k1*ln(speed_m_per_min/60[m/min])^2")]
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
        /// Output of `models` that it acts on; may be left out where only one can be meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(max_length = 64, example = "roughness")]
        output: Option<String>,
    },
}

/// What is added where a cut has these conditions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RemainderPoint {
    /// Cutting speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-2, maximum = 20_000.0, example = 60.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V"))))]
    pub speed_m_per_min: Option<f64>,
    /// Feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-4, maximum = 20.0, example = 0.2, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S"))))]
    pub feed_mm_per_rev: Option<f64>,
    /// Depth of cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-4, maximum = 1000.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t"))))]
    pub depth_mm: Option<f64>,
    /// Major cutting edge angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1.0, maximum = 179.0, example = 75.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi"))))]
    pub cutting_edge_angle_deg: Option<f64>,
    /// Nose radius of the insert.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 100.0, example = 0.8, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r"))))]
    pub nose_radius_mm: Option<f64>,
    /// Flank wear of the edge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 10.0, example = 0.2, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("VB"))))]
    pub flank_wear_mm: Option<f64>,
    /// Time that the edge had been in the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 5.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("T"))))]
    pub time_min: Option<f64>,
    /// What is added: to the logarithm of the output, or to the output itself where its model is `semi_log`.
    #[schema(minimum = -1000.0, maximum = 1000.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("b"))))]
    pub delta_ln: f64,
}

impl MachinabilityEffect {
    /// The name of its kind, as in the contract.
    pub fn kind(&self) -> &'static str {
        self.cause().kind
    }

    /// Its entry in the catalogue.
    pub fn cause(&self) -> &'static Cause {
        &CAUSES[self.index()]
    }

    /// The output that it names.
    pub fn output(&self) -> Option<&str> {
        match self {
            Self::LevelShift { output, .. }
            | Self::BatchShift { output, .. }
            | Self::FactorShift { output, .. }
            | Self::SpeedExponent { output, .. }
            | Self::FeedExponent { output, .. }
            | Self::DepthExponent { output, .. }
            | Self::AngleExponent { output, .. }
            | Self::SpeedCurvature { output, .. }
            | Self::FeedCurvature { output, .. }
            | Self::DepthCurvature { output, .. }
            | Self::SpeedFeedInteraction { output, .. }
            | Self::FeedDepthInteraction { output, .. }
            | Self::SpeedDepthInteraction { output, .. }
            | Self::FactorInteraction { output, .. }
            | Self::BuiltUpEdge { output, .. }
            | Self::NoseRadiusFloor { output, .. }
            | Self::EdgeForceOffset { output, .. }
            | Self::WearMultiplicative { output, .. }
            | Self::WearForceAdditive { output, .. }
            | Self::WearIn { output, .. }
            | Self::Remainder { output, .. }
            | Self::Formula { output, .. } => output.as_deref(),
        }
    }

    /// Names the output that it acts on.
    pub fn set_output(&mut self, name: Option<String>) {
        match self {
            Self::LevelShift { output, .. }
            | Self::BatchShift { output, .. }
            | Self::FactorShift { output, .. }
            | Self::SpeedExponent { output, .. }
            | Self::FeedExponent { output, .. }
            | Self::DepthExponent { output, .. }
            | Self::AngleExponent { output, .. }
            | Self::SpeedCurvature { output, .. }
            | Self::FeedCurvature { output, .. }
            | Self::DepthCurvature { output, .. }
            | Self::SpeedFeedInteraction { output, .. }
            | Self::FeedDepthInteraction { output, .. }
            | Self::SpeedDepthInteraction { output, .. }
            | Self::FactorInteraction { output, .. }
            | Self::BuiltUpEdge { output, .. }
            | Self::NoseRadiusFloor { output, .. }
            | Self::EdgeForceOffset { output, .. }
            | Self::WearMultiplicative { output, .. }
            | Self::WearForceAdditive { output, .. }
            | Self::WearIn { output, .. }
            | Self::Remainder { output, .. }
            | Self::Formula { output, .. } => *output = name,
        }
    }

    /// It as a formula of the user, where it is one.
    pub(crate) fn formula(&self) -> Option<UserFormula<'_>> {
        let Self::Formula { name, expression, k1, k1_deviation, k2, k2_deviation, k3, k3_deviation, .. } = self else {
            return None;
        };
        let (numbers, deviations) = ([*k1, *k2, *k3], [*k1_deviation, *k2_deviation, *k3_deviation]);
        Some(UserFormula { name, expression, numbers, deviations })
    }

    /// Position in [`CAUSES`]; a test holds that each kind stands where this says.
    const fn index(&self) -> usize {
        match self {
            Self::LevelShift { .. } => 0,
            Self::BatchShift { .. } => 1,
            Self::FactorShift { .. } => 2,
            Self::SpeedExponent { .. } => 3,
            Self::FeedExponent { .. } => 4,
            Self::DepthExponent { .. } => 5,
            Self::AngleExponent { .. } => 6,
            Self::SpeedCurvature { .. } => 7,
            Self::FeedCurvature { .. } => 8,
            Self::DepthCurvature { .. } => 9,
            Self::SpeedFeedInteraction { .. } => 10,
            Self::FeedDepthInteraction { .. } => 11,
            Self::SpeedDepthInteraction { .. } => 12,
            Self::FactorInteraction { .. } => 13,
            Self::BuiltUpEdge { .. } => 14,
            Self::NoseRadiusFloor { .. } => 15,
            Self::EdgeForceOffset { .. } => 16,
            Self::WearMultiplicative { .. } => 17,
            Self::WearForceAdditive { .. } => 18,
            Self::WearIn { .. } => 19,
            Self::Remainder { .. } => 20,
            Self::Formula { .. } => 21,
        }
    }

    /// The effect of a cause with the values of its parameters, in the order of the catalogue, on whatever output is
    /// asked for. Effects on named levels have none, nor have a remainder and a formula: batch, factor, level, shape and
    /// text are no numbers.
    pub fn from_parameters(cause: &Cause, values: &[f64]) -> Option<Self> {
        let output = None;
        Some(match (cause.kind, values) {
            ("level_shift", &[delta_ln]) => Self::LevelShift { delta_ln, output },
            ("speed_exponent", &[delta, reference_speed_m_per_min]) => {
                Self::SpeedExponent { delta, reference_speed_m_per_min: Some(reference_speed_m_per_min), output }
            }
            ("feed_exponent", &[delta, reference_feed_mm_per_rev]) => {
                Self::FeedExponent { delta, reference_feed_mm_per_rev: Some(reference_feed_mm_per_rev), output }
            }
            ("depth_exponent", &[delta, reference_depth_mm]) => {
                Self::DepthExponent { delta, reference_depth_mm: Some(reference_depth_mm), output }
            }
            ("angle_exponent", &[delta, reference_angle_deg]) => {
                Self::AngleExponent { delta, reference_angle_deg: Some(reference_angle_deg), output }
            }
            ("speed_curvature", &[coef, reference_speed_m_per_min]) => {
                Self::SpeedCurvature { coef, reference_speed_m_per_min: Some(reference_speed_m_per_min), output }
            }
            ("feed_curvature", &[coef, reference_feed_mm_per_rev]) => {
                Self::FeedCurvature { coef, reference_feed_mm_per_rev: Some(reference_feed_mm_per_rev), output }
            }
            ("depth_curvature", &[coef, reference_depth_mm]) => {
                Self::DepthCurvature { coef, reference_depth_mm: Some(reference_depth_mm), output }
            }
            ("speed_feed_interaction", &[coef, reference_speed_m_per_min, reference_feed_mm_per_rev]) => {
                Self::SpeedFeedInteraction {
                    coef,
                    reference_speed_m_per_min: Some(reference_speed_m_per_min),
                    reference_feed_mm_per_rev: Some(reference_feed_mm_per_rev),
                    output,
                }
            }
            ("feed_depth_interaction", &[coef, reference_feed_mm_per_rev, reference_depth_mm]) => {
                Self::FeedDepthInteraction {
                    coef,
                    reference_feed_mm_per_rev: Some(reference_feed_mm_per_rev),
                    reference_depth_mm: Some(reference_depth_mm),
                    output,
                }
            }
            ("speed_depth_interaction", &[coef, reference_speed_m_per_min, reference_depth_mm]) => {
                Self::SpeedDepthInteraction {
                    coef,
                    reference_speed_m_per_min: Some(reference_speed_m_per_min),
                    reference_depth_mm: Some(reference_depth_mm),
                    output,
                }
            }
            ("built_up_edge", &[hump_ln, centre_m_per_min, width_m_per_min]) => {
                Self::BuiltUpEdge { hump_ln, centre_m_per_min, width_m_per_min, output }
            }
            ("nose_radius_floor", &[k, nose_radius_mm]) => Self::NoseRadiusFloor { k, nose_radius_mm, output },
            ("edge_force_offset", &[offset_n]) => Self::EdgeForceOffset { offset_n, output },
            ("wear_multiplicative", &[per_mm]) => Self::WearMultiplicative { per_mm, output },
            ("wear_force_additive", &[n_per_mm, depth_power, reference_depth_mm]) => {
                Self::WearForceAdditive { n_per_mm, depth_power, reference_depth_mm: Some(reference_depth_mm), output }
            }
            ("wear_in", &[wear_in_mm, time_constant_min, rate_mm_per_min]) => {
                Self::WearIn { wear_in_mm, time_constant_min, rate_mm_per_min, output }
            }
            _ => return None,
        })
    }
}

/// The state that machinability effects depend on.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MachinabilityConditions {
    /// Flank wear of the edge; needed by the wear effects.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 10.0, example = 0.2, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("VB")), ("x-group" = json!("effects"))))]
    pub flank_wear_mm: Option<f64>,
    /// Batch of the material; needed by `batch_shift`.
    #[serde(default)]
    #[schema(max_length = 64, example = "B")]
    pub batch: Option<String>,
    /// Levels of named factors; needed by `factor_shift` and `factor_interaction`.
    #[serde(default)]
    #[schema(max_items = 20)]
    pub factors: Vec<FactorLevel>,
    /// Nose radius of the insert; needed by a `remainder` over it.
    #[serde(default)]
    #[schema(minimum = 0.01, maximum = 100.0, example = 0.8, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r")), ("x-group" = json!("effects"))))]
    pub nose_radius_mm: Option<f64>,
    /// Time that the edge has been in the cut; needed by `wear_in`.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1e6, example = 5.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("T")), ("x-group" = json!("effects"))))]
    pub time_min: Option<f64>,
}

impl MachinabilityConditions {
    /// The level of a factor.
    pub fn level(&self, factor: &str) -> Option<&str> {
        self.factors.iter().find(|known| known.factor == factor).map(|known| known.level.as_str())
    }
}

/// A named factor at one of its levels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FactorLevel {
    /// The factor.
    #[schema(min_length = 1, max_length = 64, example = "coolant")]
    pub factor: String,
    /// Its level.
    #[schema(min_length = 1, max_length = 64, example = "off")]
    pub level: String,
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

const fn of_job(name: &'static str, unit: &'static str, lower: f64, upper: f64) -> Parameter {
    Parameter { name, unit, fit: Fit::OfJob, prior_sd: 0.0, lower, upper }
}

const REFERENCE_SPEED: Parameter = of_job("reference_speed_m_per_min", "m/min", 0.01, 20_000.0);
const REFERENCE_FEED: Parameter = of_job("reference_feed_mm_per_rev", "mm/rev", 1e-4, 20.0);
const REFERENCE_DEPTH: Parameter = of_job("reference_depth_mm", "mm", 1e-4, 1000.0);
const REFERENCE_ANGLE: Parameter = of_job("reference_angle_deg", "deg", 1.0, 179.0);

const fn cause(
    kind: &'static str,
    equation: &'static str,
    parameters: &'static [Parameter],
    conditions: &'static [&'static str],
    confounded_with: &'static [&'static str],
) -> Cause {
    Cause { kind, equation, parameters, conditions, confounded_with, moves_mean: true }
}

/// The catalogue of the machinability models (`diagnosis/5`): prior standard deviations and bounds on L, which is
/// the logarithm of the output, or with `semi_log` the output in its unit.
pub const CAUSES: &[Cause] = &[
    cause("level_shift", "diagnosis/5.1", &[amplitude("delta_ln", "1", 0.2, -3.0, 3.0)], &[], &[]),
    cause(
        "batch_shift",
        "diagnosis/5.2",
        &[amplitude("delta_ln", "1", 0.15, -3.0, 3.0)],
        &["batch"],
        &["wear_multiplicative"],
    ),
    cause(
        "factor_shift",
        "diagnosis/5.3",
        &[amplitude("delta_ln", "1", 0.15, -3.0, 3.0)],
        &["factors"],
        &["batch_shift"],
    ),
    cause(
        "speed_exponent",
        "diagnosis/5.4",
        &[amplitude("delta", "1", 0.15, -3.0, 3.0), REFERENCE_SPEED],
        &[],
        &["speed_curvature"],
    ),
    cause(
        "feed_exponent",
        "diagnosis/5.5",
        &[amplitude("delta", "1", 0.15, -3.0, 3.0), REFERENCE_FEED],
        &[],
        &["feed_curvature"],
    ),
    cause(
        "depth_exponent",
        "diagnosis/5.6",
        &[amplitude("delta", "1", 0.15, -3.0, 3.0), REFERENCE_DEPTH],
        &[],
        &["depth_curvature"],
    ),
    cause("angle_exponent", "diagnosis/5.7", &[amplitude("delta", "1", 0.15, -3.0, 3.0), REFERENCE_ANGLE], &[], &[]),
    cause(
        "speed_curvature",
        "diagnosis/5.8",
        &[amplitude("coef", "1", 0.1, -3.0, 3.0), REFERENCE_SPEED],
        &[],
        &["speed_exponent"],
    ),
    cause(
        "feed_curvature",
        "diagnosis/5.9",
        &[amplitude("coef", "1", 0.1, -3.0, 3.0), REFERENCE_FEED],
        &[],
        &["feed_exponent"],
    ),
    cause(
        "depth_curvature",
        "diagnosis/5.10",
        &[amplitude("coef", "1", 0.1, -3.0, 3.0), REFERENCE_DEPTH],
        &[],
        &["depth_exponent"],
    ),
    cause(
        "speed_feed_interaction",
        "diagnosis/5.11",
        &[amplitude("coef", "1", 0.1, -3.0, 3.0), REFERENCE_SPEED, REFERENCE_FEED],
        &[],
        &["speed_exponent", "feed_exponent"],
    ),
    cause(
        "feed_depth_interaction",
        "diagnosis/5.12",
        &[amplitude("coef", "1", 0.1, -3.0, 3.0), REFERENCE_FEED, REFERENCE_DEPTH],
        &[],
        &["feed_exponent", "depth_exponent"],
    ),
    cause(
        "speed_depth_interaction",
        "diagnosis/5.13",
        &[amplitude("coef", "1", 0.1, -3.0, 3.0), REFERENCE_SPEED, REFERENCE_DEPTH],
        &[],
        &["speed_exponent", "depth_exponent"],
    ),
    cause("factor_interaction", "diagnosis/5.14", &[amplitude("delta_ln", "1", 0.3, -3.0, 3.0)], &["factors"], &[]),
    cause(
        "built_up_edge",
        "diagnosis/5.15",
        &[
            amplitude("hump_ln", "1", 0.5, 0.0, 3.0),
            shape("centre_m_per_min", "m/min", &[25.0, 35.0, 45.0, 55.0], 10.0, 5.0, 150.0),
            shape("width_m_per_min", "m/min", &[12.0, 20.0, 30.0], 7.0, 3.0, 100.0),
        ],
        &[],
        &["speed_curvature"],
    ),
    cause(
        "nose_radius_floor",
        "diagnosis/5.16",
        &[
            shape("k", "1", &[0.5, 0.75, 1.0, 1.5, 2.0, 3.0], 1.0, 0.0, 10.0),
            of_job("nose_radius_mm", "mm", 0.01, 100.0),
        ],
        &[],
        &["feed_curvature", "feed_exponent"],
    ),
    cause(
        "edge_force_offset",
        "diagnosis/5.17",
        &[amplitude("offset_n", "N", 30.0, 0.0, 10_000.0)],
        &[],
        &["feed_exponent", "depth_exponent"],
    ),
    cause(
        "wear_multiplicative",
        "diagnosis/5.18",
        &[amplitude("per_mm", "1/mm", 1.0, 0.0, 20.0)],
        &["flank_wear_mm"],
        &["batch_shift"],
    ),
    cause(
        "wear_force_additive",
        "diagnosis/5.19",
        &[
            amplitude("n_per_mm", "N/mm", 300.0, 0.0, 100_000.0),
            shape("depth_power", "1", &[0.0, 0.25, 0.5, 1.0], 0.5, -1.0, 2.0),
            REFERENCE_DEPTH,
        ],
        &["flank_wear_mm"],
        &["wear_multiplicative"],
    ),
    cause(
        "wear_in",
        "diagnosis/5.20",
        &[
            amplitude("wear_in_mm", "mm", 0.1, 0.0, 1.0),
            shape("time_constant_min", "min", &[2.0, 4.0, 8.0, 16.0], 4.0, 0.1, 200.0),
            amplitude("rate_mm_per_min", "mm/min", 0.02, 0.0, 1.0),
        ],
        &["time_min"],
        &[],
    ),
    cause("remainder", "diagnosis/5.21", &[amplitude("scale", "1", 1.0, -3.0, 3.0)], &[], &[]),
    cause("formula", "diagnosis/5.22", &NUMBERS, &[], &[]),
];
