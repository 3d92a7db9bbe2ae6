//! A machine's program: as blocks, whose text is made outside, or the text that a job brought along.

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

/// Where the program of an answer comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProgramOrigin {
    /// The calculator makes it, in blocks.
    Made,
    /// The job brought it along, and it is given back.
    Brought,
}

/// A program that a job brought along, as it is given back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReturnedProgram {
    /// All of it.
    pub text: String,
    /// What changed, as a unified diff; empty where nothing did.
    pub diff: String,
    /// Which bytes its characters are.
    pub encoding: ProgramEncoding,
    /// The control that it is for.
    pub dialect: Dialect,
}

/// Which bytes the characters of a program are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProgramEncoding {
    /// UTF-8, which plain ASCII is, too.
    #[default]
    #[serde(rename = "utf_8")]
    Utf8,
    /// ISO 8859-1: every byte is a character.
    #[serde(rename = "latin_1")]
    Latin1,
}

impl ProgramEncoding {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Utf8 => "utf_8",
            Self::Latin1 => "latin_1",
        }
    }

    /// The encoding with that name.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Utf8, Self::Latin1].into_iter().find(|encoding| encoding.name() == name)
    }

    /// What bytes are read as: UTF-8 where they are that, else Latin-1.
    pub fn of(bytes: &[u8]) -> Self {
        if std::str::from_utf8(bytes).is_ok() { Self::Utf8 } else { Self::Latin1 }
    }

    /// The text of bytes; `None` where they are no text in this encoding.
    pub fn decoded(self, bytes: &[u8]) -> Option<String> {
        match self {
            Self::Utf8 => std::str::from_utf8(bytes).ok().map(str::to_owned),
            Self::Latin1 => Some(bytes.iter().copied().map(char::from).collect()),
        }
    }

    /// Whether it has a character.
    pub fn has(self, character: char) -> bool {
        match self {
            Self::Utf8 => true,
            Self::Latin1 => u8::try_from(character).is_ok(),
        }
    }

    /// The bytes of a text; `None` where it has characters that this encoding has not.
    pub fn encoded(self, text: &str) -> Option<Vec<u8>> {
        match self {
            Self::Utf8 => Some(text.as_bytes().to_vec()),
            Self::Latin1 => text.chars().map(|character| u8::try_from(character).ok()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back_as_they_were() {
        for bytes in [&b"G1 X20. (K\xF6rper)\r\n"[..], "G1 X20. (Körper)\n".as_bytes(), b"\xEF\xBB\xBFG0\r"] {
            let encoding = ProgramEncoding::of(bytes);
            let text = encoding.decoded(bytes).unwrap_or_default();
            assert_eq!(encoding.encoded(&text).as_deref(), Some(bytes));
            assert_eq!(ProgramEncoding::named(encoding.name()), Some(encoding));
        }
        assert_eq!(ProgramEncoding::Utf8.decoded(b"\xF6"), None);
        assert_eq!(ProgramEncoding::Latin1.encoded("Вал"), None);
    }
}
