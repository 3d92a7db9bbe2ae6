//! Work materials of the handbook and their correction factor K_m, tables 9 and 10.

use super::Triple;
use super::rows::{self, HandbookRow};
use crate::force::ToolMaterial;
use crate::material::Certainty;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Classes of work material that the handbook distinguishes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WorkMaterial {
    /// Constructional steel and steel castings; needs the tensile strength.
    Steel,
    /// Stainless and heat-resistant steel 12Kh18N9T, HB 141.
    #[serde(rename = "stainless_12kh18n9t")]
    Stainless,
    /// Grey cast iron; needs the hardness.
    GreyIron,
    /// Malleable cast iron; needs the hardness.
    MalleableIron,
    /// Multiphase copper alloy of HB 120.
    CopperMultiphase,
    /// Multiphase copper alloy harder than HB 120.
    CopperMultiphaseHard,
    /// Leaded multiphase copper alloy; K_m 0.65 to 0.70 is to be stated.
    CopperLeadedMultiphase,
    /// Single-phase copper alloy; K_m 1.8 to 2.2 is to be stated.
    CopperSinglePhase,
    /// Copper; K_m 1.7 to 2.1 is to be stated.
    Copper,
    /// Copper alloy with more than 15 % lead; K_m 0.25 to 0.45 is to be stated.
    CopperHighLead,
    /// Aluminium and silumin.
    Aluminium,
    /// Duralumin of 250 MPa tensile strength.
    #[serde(rename = "duralumin_250")]
    Duralumin250,
    /// Duralumin of 350 MPa tensile strength.
    #[serde(rename = "duralumin_350")]
    Duralumin350,
    /// Duralumin of more than 350 MPa tensile strength.
    #[serde(rename = "duralumin_above_350")]
    DuraluminAbove350,
}

/// What decides K_m of a class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Rule {
    /// (sigma/750 MPa)^n
    Strength,
    /// (HB/reference)^n
    Hardness { reference: f64 },
    /// A number.
    Fixed { factor: f64, certainty: Certainty },
    /// A range, from which the user has to choose.
    Stated { least: f64, largest: f64 },
}

impl WorkMaterial {
    /// The rows of table 22 for this class, before K_m.
    pub fn rows(self) -> &'static [HandbookRow] {
        match self {
            Self::Steel => &rows::STEEL,
            Self::Stainless => &rows::STAINLESS,
            Self::GreyIron => &rows::GREY_IRON,
            Self::MalleableIron => &rows::MALLEABLE_IRON,
            Self::CopperMultiphase
            | Self::CopperMultiphaseHard
            | Self::CopperLeadedMultiphase
            | Self::CopperSinglePhase
            | Self::Copper
            | Self::CopperHighLead => &rows::COPPER,
            Self::Aluminium | Self::Duralumin250 | Self::Duralumin350 | Self::DuraluminAbove350 => &rows::ALUMINIUM,
        }
    }

    pub(super) fn rule(self) -> Rule {
        let reference = |certainty| Rule::Fixed { factor: 1.0, certainty };
        let to_be_checked = |factor| Rule::Fixed { factor, certainty: Certainty::ToBeChecked };
        let stated = |least, largest| Rule::Stated { least, largest };
        match self {
            Self::Steel => Rule::Strength,
            Self::GreyIron => Rule::Hardness { reference: 190.0 },
            Self::MalleableIron => Rule::Hardness { reference: 150.0 },
            Self::Stainless => reference(Certainty::Likely),
            Self::CopperMultiphase | Self::Aluminium => reference(Certainty::ToBeChecked),
            Self::CopperMultiphaseHard => to_be_checked(0.75),
            Self::CopperLeadedMultiphase => stated(0.65, 0.70),
            Self::CopperSinglePhase => stated(1.8, 2.2),
            Self::Copper => stated(1.7, 2.1),
            Self::CopperHighLead => stated(0.25, 0.45),
            Self::Duralumin250 => to_be_checked(1.5),
            Self::Duralumin350 => to_be_checked(2.0),
            Self::DuraluminAbove350 => to_be_checked(2.75),
        }
    }
}

/// Up to this tensile strength, N/mm², the main force under high-speed steel follows another exponent.
const SOFT_STEEL_N_PER_MM2: f64 = 600.0;

/// K_m of steel of `strength` N/mm². With high-speed steel P_z jumps at 600 N/mm², as printed.
pub(super) fn of_strength(strength: f64, tool: ToolMaterial) -> Triple {
    let exponents = match tool {
        ToolMaterial::Carbide => Triple::of(0.75, 1.35, 1.0),
        ToolMaterial::Hss if strength <= SOFT_STEEL_N_PER_MM2 => Triple::of(0.35, 2.0, 1.5),
        ToolMaterial::Hss => Triple::of(0.75, 2.0, 1.5),
    };
    raised(strength / 750.0, exponents)
}

/// K_m of grey and malleable iron whose hardness is `ratio` times that of the row.
pub(super) fn of_hardness(ratio: f64, tool: ToolMaterial) -> Triple {
    let exponents = match tool {
        ToolMaterial::Carbide => Triple::of(0.4, 1.0, 0.8),
        ToolMaterial::Hss => Triple::of(0.55, 1.3, 1.1),
    };
    raised(ratio, exponents)
}

fn raised(base: f64, exponents: Triple) -> Triple {
    Triple::of(base.powf(exponents.main), base.powf(exponents.passive), base.powf(exponents.feed))
}
