//! What a control remembers from block to block.

use super::super::super::job::{Dialect, ProgramFeed, ProgramUnits, Reading, WordsOfX};
use super::codes::Path;
use super::moves::{Feed, Nose, Place, Speed};

/// Millimetres of an inch.
pub(super) const INCH_MM: f64 = 25.4;

/// The motion that an axis word alone asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Motion {
    Path(Path),
    Thread,
    /// A single cycle along the axis, or across it.
    Single {
        across: bool,
        words: SingleWords,
    },
    ThreadCycle,
    Drill,
    Nowhere,
}

/// What a single cycle keeps until it is said anew.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct SingleWords {
    /// Diameter to which it goes, mm.
    pub(super) x: Option<f64>,
    /// Place to which it goes, mm.
    pub(super) z: Option<f64>,
    /// Taper: on the radius along the axis, along the axis across, mm.
    pub(super) taper: f64,
}

/// What X means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Width {
    Diameter,
    Radius,
    /// Absolute words are diameters, relative ones radii.
    DiameterOfAbsolute,
}

/// What a program says once and then means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[allow(clippy::struct_excessive_bools)] // each is said on its own
pub(super) struct Said {
    pub(super) units: bool,
    pub(super) plane: bool,
    pub(super) feed_mode: bool,
    pub(super) width: bool,
}

/// The state of a control.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::struct_excessive_bools)] // modes of a control are independent
pub(super) struct State {
    pub(super) place: Place,
    pub(super) motion: Option<Motion>,
    /// What a Fanuc goes back to after drilling.
    pub(super) before_drill: Option<Motion>,
    pub(super) is_relative: bool,
    pub(super) inch: bool,
    pub(super) feed_inch: bool,
    pub(super) per_minute: bool,
    pub(super) feed: Option<Feed>,
    pub(super) is_surface: bool,
    pub(super) rpm: Option<f64>,
    pub(super) surface_m_per_min: Option<f64>,
    pub(super) limit_rpm: Option<f64>,
    pub(super) tool: Option<u32>,
    /// The tool that LinuxCNC takes at M6.
    pub(super) next_tool: Option<u32>,
    pub(super) nose: Nose,
    pub(super) width: Width,
    pub(super) centre_absolute: bool,
    pub(super) zero: Option<u32>,
    /// Depth of a pass on the radius and retract of roughing cycles, mm.
    pub(super) rough_depth: Option<f64>,
    pub(super) rough_retract: f64,
    /// Shifts and count of pattern cycles.
    pub(super) pattern: Option<[f64; 3]>,
    pub(super) said: Said,
}

/// Retract of a roughing cycle that names none, mm.
const RETRACT_MM: f64 = 0.5;

impl State {
    pub(super) fn new(dialect: Dialect, reading: &Reading) -> Self {
        let inch = reading.units == Some(ProgramUnits::Inch);
        // LinuxCNC begins with radii, every other lathe is set up for diameters.
        let own = if dialect == Dialect::LinuxCnc { WordsOfX::Radius } else { WordsOfX::Diameter };
        let width = match reading.x_words.unwrap_or(own) {
            WordsOfX::Diameter => Width::Diameter,
            WordsOfX::Radius => Width::Radius,
        };
        Self {
            place: reading.start.map_or(Place::default(), |start| Place::at(start.x_diameter_mm, start.z_mm)),
            motion: None,
            before_drill: None,
            is_relative: false,
            inch,
            feed_inch: inch,
            // LinuxCNC begins with feeds per minute, lathes with feeds per revolution.
            per_minute: match reading.feed_mode {
                Some(feed) => feed == ProgramFeed::PerMin,
                None => dialect == Dialect::LinuxCnc,
            },
            feed: None,
            is_surface: false,
            rpm: None,
            surface_m_per_min: None,
            limit_rpm: None,
            tool: None,
            next_tool: None,
            nose: Nose::Off,
            width,
            centre_absolute: false,
            zero: None,
            rough_depth: None,
            rough_retract: RETRACT_MM,
            pattern: None,
            said: Said {
                units: reading.units.is_some(),
                plane: false,
                feed_mode: reading.feed_mode.is_some(),
                width: dialect != Dialect::Siemens || reading.x_words.is_some(),
            },
        }
    }

    /// The speed of the spindle, where one is set.
    pub(super) fn speed(&self) -> Option<Speed> {
        if self.is_surface {
            self.surface_m_per_min.map(|speed| Speed::Surface(speed, self.limit_rpm))
        } else {
            self.rpm.map(Speed::Spindle)
        }
    }

    /// Factor from a word of X, absolute or relative, to a diameter.
    pub(super) fn to_diameter(&self, relative: bool) -> f64 {
        match self.width {
            Width::Diameter => 1.0,
            Width::DiameterOfAbsolute if !relative => 1.0,
            Width::Radius | Width::DiameterOfAbsolute => 2.0,
        }
    }
}
