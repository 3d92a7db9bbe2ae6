//! A machine's program as blocks. The text of a dialect is made outside.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How a control wants its words spelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Dialect {
    /// Fanuc lathe with G-code system B: `G90` absolute, `G95` per revolution, `G92 S` limits the spindle. X is a diameter
    /// by default.
    #[default]
    Fanuc,
    /// The same with G-code system A, where `G90` is a cycle: X and Z are absolute by their letters, `G99` per
    /// revolution, `G50 S` limits the spindle.
    FanucA,
    /// The same with G-code system C, as B but that `G71` is millimetres and roughing is `G73`.
    FanucC,
    /// Siemens: `DIAMON` switches X to diameters.
    Siemens,
    /// LinuxCNC: `G7` switches X to diameters.
    #[serde(rename = "linuxcnc")]
    LinuxCnc,
}

impl Dialect {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fanuc => "fanuc",
            Self::FanucA => "fanuc_a",
            Self::FanucC => "fanuc_c",
            Self::Siemens => "siemens",
            Self::LinuxCnc => "linuxcnc",
        }
    }
}

/// How a program ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProgramEnd {
    /// `M30`: end and rewind.
    M30,
    /// `M2`: end.
    M2,
    /// Back to the program that called this one: `M99`, at Siemens `M17`.
    Return,
}

/// A program for a turning centre, in diameters, absolute, feed per revolution.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    /// Spelling.
    pub dialect: Dialect,
    /// Smallest step of X on the diameter and of Z, mm: how many decimals are written.
    pub increment_mm: f64,
    /// In the order of execution.
    pub blocks: Vec<Block>,
}

/// One step of a program. Coordinates are already rounded to the machine's increment.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// Metric, XZ plane, no cutter radius compensation, absolute, feed per revolution, diameters.
    Modes,
    /// A comment.
    Note(String),
    /// Constant spindle speed, spindle on.
    SpindleSpeed {
        /// rev/min.
        rpm: f64,
    },
    /// Constant surface speed with its limit of spindle speed, spindle on.
    SurfaceSpeed {
        /// m/min.
        speed_m_per_min: f64,
        /// rev/min.
        limit_rpm: f64,
    },
    /// Rapid motion; an axis left out stands still.
    Rapid {
        /// Diameter, mm.
        x_diameter_mm: Option<f64>,
        /// mm from program zero.
        z_mm: Option<f64>,
    },
    /// Cutting motion in a straight line; a feed left out stays as it was.
    Cut {
        /// Diameter, mm.
        x_diameter_mm: f64,
        /// mm from program zero.
        z_mm: f64,
        /// mm/rev.
        feed_mm_per_rev: Option<f64>,
    },
    /// Calls a tool with the offset of its number.
    Tool {
        /// Its number.
        number: u32,
    },
    /// Coolant on or off.
    Coolant {
        /// Whether it flows from here on.
        on: bool,
    },
    /// Spindle off, and the program waits for the operator.
    Stop {
        /// What the operator has to do before the program goes on.
        reason: String,
    },
    /// Spindle off, end of program, as the dialect has it or as asked for.
    End(Option<ProgramEnd>),
}
