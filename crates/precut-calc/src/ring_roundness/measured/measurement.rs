//! A measured row of a turned ring.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{MeasuredRow, Measurement};
use crate::ring_roundness::RingRoundness;
use crate::ring_roundness::measured::forward::RingPoint;

/// A radius of the finished ring, or its deviation, at a body angle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RingMeasurement {
    /// Number of the ring that was turned, from 1 in the order of `runs`.
    #[serde(default = "one")]
    #[schema(minimum = 1, maximum = 10_000, default = 1, example = 1, extensions(("x-symbol" = json!("i")), ("x-unit" = json!("1"))))]
    pub run: u32,
    /// Number of the trace round this ring; rows of one trace stand in measuring order.
    #[serde(default = "one")]
    #[schema(minimum = 1, maximum = 10_000, default = 1, example = 1, extensions(("x-symbol" = json!("j")), ("x-unit" = json!("1"))))]
    pub trace: u32,
    /// Body angle, counter-clockwise; 0 points to the right at the start of the run.
    #[schema(minimum = -720.0, maximum = 720.0, example = 12.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("theta"))))]
    pub angle_deg: f64,
    /// Measured radius minus that of the least-squares circle, about its centre; positive is outward. Unfiltered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -1e6, maximum = 1e6, example = 4.5, extensions(("x-symbol" = json!("dr")), ("x-unit" = json!("um"))))]
    pub radial_deviation_um: Option<f64>,
    /// Measured radius about the axis of the instrument. Unfiltered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 100_000.0, example = 149.412, extensions(("x-symbol" = json!("r")), ("x-unit" = json!("mm"))))]
    pub radius_mm: Option<f64>,
    /// Standard uncertainty of the value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-9, maximum = 1e6, example = 0.5, extensions(("x-symbol" = json!("u")), ("x-unit" = json!("um"))))]
    pub uncertainty_um: Option<f64>,
    /// Whether the row is set aside: listed, not used.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schema(default = false, example = false)]
    pub excluded: bool,
}

fn one() -> u32 {
    1
}

impl MeasuredRow for RingMeasurement {
    const MAX_ROWS: usize = 20_000;
    const MEASURED: &'static [&'static str] = &["radial_deviation_um", "radius_mm"];
}

impl Measurement for RingMeasurement {
    type Model = RingRoundness;

    fn run(&self) -> u32 {
        self.run
    }

    fn trace(&self) -> u32 {
        self.trace
    }

    fn point(&self) -> RingPoint {
        RingPoint { angle_deg: self.angle_deg }
    }

    fn value(&self, quantity: &str) -> Option<f64> {
        match quantity {
            "radial_deviation_um" => self.radial_deviation_um,
            "radius_mm" => self.radius_mm,
            _ => None,
        }
    }

    fn uncertainty(&self) -> Option<f64> {
        // Of a radius in mm the uncertainty is in um, too.
        self.uncertainty_um.map(|u| if self.radius_mm.is_some() { u / 1000.0 } else { u })
    }

    fn excluded(&self) -> bool {
        self.excluded
    }
}
