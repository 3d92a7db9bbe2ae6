//! What a measured value is.

use crate::calculator::{Finding, PrepareError, Quantity};

const UM_PER_MM: f64 = 1e3;

/// What the measured value is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Measure {
    DiameterDeviation,
    RadiusDeviation,
    Diameter,
}

pub(crate) const QUANTITIES: &[Quantity] = &[
    Quantity { name: "diameter_deviation_um", unit: "um", logarithmic: false },
    Quantity { name: "radius_deviation_um", unit: "um", logarithmic: false },
    Quantity { name: "diameter_mm", unit: "mm", logarithmic: false },
];

impl Measure {
    /// What rows are asked for.
    pub(crate) fn asked(quantity: &str) -> Result<Self, PrepareError> {
        Self::named(quantity).ok_or_else(|| {
            let known: Vec<&'static str> = QUANTITIES.iter().map(|q| q.name).collect();
            PrepareError::Invalid(vec![
                Finding::new("unknown_quantity", "/quantity")
                    .with("quantity", quantity.to_owned())
                    .with("known", known),
            ])
        })
    }

    pub(in crate::deflection_compensation) fn named(name: &str) -> Option<Self> {
        match name {
            "diameter_deviation_um" => Some(Self::DiameterDeviation),
            "radius_deviation_um" => Some(Self::RadiusDeviation),
            "diameter_mm" => Some(Self::Diameter),
            _ => None,
        }
    }

    /// Of radii that are produced and wanted.
    pub(crate) fn of(self, produced_mm: f64, target_mm: f64) -> f64 {
        match self {
            Self::DiameterDeviation => 2.0 * (produced_mm - target_mm) * UM_PER_MM,
            Self::RadiusDeviation => (produced_mm - target_mm) * UM_PER_MM,
            Self::Diameter => 2.0 * produced_mm,
        }
    }

    /// What a change of the diameter by 1 um makes in the quantity.
    pub(in crate::deflection_compensation) fn per_diameter_um(self) -> f64 {
        match self {
            Self::DiameterDeviation => 1.0,
            Self::RadiusDeviation => 0.5,
            Self::Diameter => 1.0 / UM_PER_MM,
        }
    }
}
