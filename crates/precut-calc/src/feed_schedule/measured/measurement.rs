//! A measured row of a cutting trial.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{MeasuredRow, Measurement};
use crate::effects::FactorLevel;
use crate::feed_schedule::FeedSchedule;
use crate::feed_schedule::measured::conditions::with_conditions;
use crate::feed_schedule::measured::forward::MachinabilityPoint;

with_conditions! {
    /// What was measured in a cut, with the cut; what the row leaves out is taken from its run, then from the job.
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
    #[serde(deny_unknown_fields)]
    MachinabilityMeasurement, wear: "Flank wear of the edge: a condition of the cut, or, as the quantity, what was measured.", {
        /// Number of the run whose conditions it shares, from 1 in the order of `runs`.
        #[serde(default = "one")]
        #[schema(minimum = 1, maximum = 10_000, default = 1, example = 1, extensions(("x-symbol" = json!("i")), ("x-unit" = json!("1"))))]
        pub run: u32,
    } conditions {
        /// Measured main (tangential) force.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-9, maximum = 1e9, example = 480.0, extensions(("x-symbol" = json!("F_z")), ("x-unit" = json!("N"))))]
        pub force_z_n: Option<f64>,
        /// Measured passive (radial) force.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-9, maximum = 1e9, example = 210.0, extensions(("x-symbol" = json!("F_y")), ("x-unit" = json!("N"))))]
        pub force_y_n: Option<f64>,
        /// Measured tool life.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-9, maximum = 1e9, example = 42.0, extensions(("x-symbol" = json!("T")), ("x-unit" = json!("min"))))]
        pub tool_life_min: Option<f64>,
        /// Measured roughness.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-9, maximum = 1e6, example = 1.6, extensions(("x-symbol" = json!("Ra")), ("x-unit" = json!("um"))))]
        pub roughness_um: Option<f64>,
        /// Measured degree of hardening.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-9, maximum = 1e6, example = 25.0, extensions(("x-symbol" = json!("N")), ("x-unit" = json!("percent"))))]
        pub hardening_percent: Option<f64>,
        /// Measured depth of hardening.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-9, maximum = 1e6, example = 80.0, extensions(("x-symbol" = json!("h_c")), ("x-unit" = json!("um"))))]
        pub hardening_depth_um: Option<f64>,
        /// Standard uncertainty of the values of this row, as a share of them.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 1e-9, maximum = 10.0, example = 0.05, extensions(("x-symbol" = json!("u")), ("x-unit" = json!("1"))))]
        pub uncertainty_rel: Option<f64>,
        /// Whether the row is set aside: listed, not used.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        #[schema(default = false, example = false)]
        pub excluded: bool,
    }
}

fn one() -> u32 {
    1
}

impl MeasuredRow for MachinabilityMeasurement {
    const MAX_ROWS: usize = 20_000;
    const MEASURED: &'static [&'static str] =
        &["force_z_n", "force_y_n", "tool_life_min", "roughness_um", "hardening_percent", "hardening_depth_um"];
}

impl Measurement for MachinabilityMeasurement {
    type Model = FeedSchedule;

    fn run(&self) -> u32 {
        self.run
    }

    fn trace(&self) -> u32 {
        1
    }

    fn point(&self) -> MachinabilityPoint {
        MachinabilityPoint {
            speed_m_per_min: self.speed_m_per_min,
            feed_mm_per_rev: self.feed_mm_per_rev,
            depth_mm: self.depth_mm,
            cutting_edge_angle_deg: self.cutting_edge_angle_deg,
            nose_radius_mm: self.nose_radius_mm,
            flank_wear_mm: self.flank_wear_mm,
            batch: self.batch.clone(),
            factors: self.factors.clone(),
            test: self.test,
            time_min: self.time_min,
        }
    }

    fn value(&self, quantity: &str) -> Option<f64> {
        let value = match quantity {
            "force_z_n" => self.force_z_n,
            "force_y_n" => self.force_y_n,
            "tool_life_min" => self.tool_life_min,
            "roughness_um" => self.roughness_um,
            "hardening_percent" => self.hardening_percent,
            "hardening_depth_um" => self.hardening_depth_um,
            "flank_wear_mm" => self.flank_wear_mm,
            _ => None,
        };
        // A fresh edge has no wear to compare: its logarithm is none.
        value.filter(|value| *value > 0.0)
    }

    fn uncertainty(&self) -> Option<f64> {
        None
    }

    fn uncertainty_of(&self, quantity: &str) -> Option<f64> {
        Some(self.uncertainty_rel? * self.value(quantity)?)
    }

    fn excluded(&self) -> bool {
        self.excluded
    }
}
