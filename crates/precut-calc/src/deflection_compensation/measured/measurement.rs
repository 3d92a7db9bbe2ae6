//! A measured row of a turned shaft.

use crate::deflection_compensation::DeflectionCompensation;

/// Rows of diameters along turned work: one type for each model that predicts them.
macro_rules! measured_diameters {
    ($(#[$doc:meta])* $name:ident, $model:ty) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            /// Number of the run that turned it, from 1 in the order of `runs`.
            #[serde(default = "crate::deflection_compensation::first")]
            #[schema(minimum = 1, maximum = 10_000, default = 1, example = 1, extensions(("x-symbol" = json!("i")), ("x-unit" = json!("1"))))]
            pub run: u32,
            /// Number of the sweep over this run's shaft; rows of one sweep stand in measuring order.
            #[serde(default = "crate::deflection_compensation::first")]
            #[schema(minimum = 1, maximum = 10_000, default = 1, example = 1, extensions(("x-symbol" = json!("j")), ("x-unit" = json!("1"))))]
            pub trace: u32,
            /// Station from the headstock end.
            #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 500.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
            pub z_mm: f64,
            /// Measured minus nominal diameter; positive is oversize.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = -1e6, maximum = 1e6, example = 12.5, extensions(("x-symbol" = json!("dD")), ("x-unit" = json!("um"))))]
            pub diameter_deviation_um: Option<f64>,
            /// Measured minus nominal radius; positive is oversize.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = -1e6, maximum = 1e6, example = 6.25, extensions(("x-symbol" = json!("dR")), ("x-unit" = json!("um"))))]
            pub radius_deviation_um: Option<f64>,
            /// Measured diameter.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = 0.0, maximum = 10_000.0, example = 90.012, extensions(("x-symbol" = json!("D")), ("x-unit" = json!("mm"))))]
            pub diameter_mm: Option<f64>,
            /// Standard uncertainty of the value.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = 1e-9, maximum = 1e6, example = 0.8, extensions(("x-symbol" = json!("u")), ("x-unit" = json!("um"))))]
            pub uncertainty_um: Option<f64>,
            /// Whether the row is set aside: listed, not used.
            #[serde(default, skip_serializing_if = "std::ops::Not::not")]
            #[schema(default = false, example = false)]
            pub excluded: bool,
        }

        impl $crate::calculator::MeasuredRow for $name {
            const MAX_ROWS: usize = 20_000;
            const MEASURED: &'static [&'static str] = &["diameter_deviation_um", "radius_deviation_um", "diameter_mm"];
        }

        impl $crate::calculator::Measurement for $name {
            type Model = $model;

            fn run(&self) -> u32 {
                self.run
            }

            fn trace(&self) -> u32 {
                self.trace
            }

            fn point(&self) -> $crate::deflection_compensation::DeflectionPoint {
                $crate::deflection_compensation::DeflectionPoint { z_mm: self.z_mm }
            }

            fn value(&self, quantity: &str) -> Option<f64> {
                match quantity {
                    "diameter_deviation_um" => self.diameter_deviation_um,
                    "radius_deviation_um" => self.radius_deviation_um,
                    "diameter_mm" => self.diameter_mm,
                    _ => None,
                }
            }

            fn uncertainty(&self) -> Option<f64> {
                // Of a diameter in mm the uncertainty is in um, too: nobody states it otherwise.
                self.uncertainty_um.map(|u| if self.diameter_mm.is_some() { u / 1000.0 } else { u })
            }

            fn excluded(&self) -> bool {
                self.excluded
            }
        }
    };
}
pub(crate) use measured_diameters;

/// Runs and sweeps count from this.
pub(crate) fn first() -> u32 {
    1
}

measured_diameters! {
    /// A diameter or a radius, measured at a station of the finished shaft.
    DeflectionMeasurement, DeflectionCompensation
}
