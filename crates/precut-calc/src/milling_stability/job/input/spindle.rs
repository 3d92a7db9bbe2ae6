//! What the spindle gives, and how its speed varies.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::fixture_stability::{Spindle, SpindlePoint};

/// What the spindle can give. What is stated for all speeds and what the table says both hold: the least counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MillSpindle {
    /// Power of the motor, at every speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 10_000.0, example = 15.0, extensions(("x-unit" = json!("kW")), ("x-symbol" = json!("P_max"))))]
    pub power_kw: Option<f64>,
    /// Torque at the spindle, at every speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e7, example = 40.0, extensions(("x-unit" = json!("N m")), ("x-symbol" = json!("M_max"))))]
    pub torque_n_m: Option<f64>,
    /// Share of the motor's power that reaches the cutter.
    #[serde(default = "whole_power")]
    #[schema(exclusive_minimum = 0.0, maximum = 1.0, default = 1.0, example = 0.85, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("eta"))))]
    pub efficiency: f64,
    /// Power and torque over the spindle speed, by rising speed, straight lines between; nothing is known of speeds outside.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 200)]
    pub characteristic: Vec<SpindlePoint>,
    /// Lowest speed that is looked at for better ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 3000.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_min"))))]
    pub speed_min_rpm: Option<f64>,
    /// Highest speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 16_000.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_max"))))]
    pub speed_max_rpm: Option<f64>,
    /// Moment of inertia of all that turns; without it no varying speed is proposed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-9, maximum = 1e6, example = 0.02, extensions(("x-unit" = json!("kg m2")), ("x-symbol" = json!("J"))))]
    pub inertia_kg_m2: Option<f64>,
    /// Largest angular acceleration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 1e9, example = 2000.0, extensions(("x-unit" = json!("rad/s2")), ("x-symbol" = json!("alpha_max"))))]
    pub acceleration_max_rad_per_s2: Option<f64>,
}

fn whole_power() -> f64 {
    1.0
}

impl MillSpindle {
    /// What it gives, as the calculator of fixture stability asks for it.
    pub(in crate::milling_stability) fn drive(&self) -> Spindle {
        Spindle {
            power_kw: self.power_kw,
            torque_n_m: self.torque_n_m,
            efficiency: self.efficiency,
            characteristic: self.characteristic.clone(),
        }
    }
}

/// A spindle speed that goes up and down as a sine (`milling/4.18`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SpeedVariation {
    /// Largest change over the mean speed.
    #[schema(exclusive_minimum = 0.0, exclusive_maximum = 0.5, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("A"))))]
    pub amplitude: f64,
    /// How often it goes up and down.
    #[schema(minimum = 0.01, maximum = 1000.0, example = 50.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_m"))))]
    pub frequency_hz: f64,
}
