//! What the reader makes of a program: a list of moves. Every later step works on it alone.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a move is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = MoveKind)]
pub enum Kind {
    /// As fast as the axes go.
    Rapid,
    /// A straight line at the feed.
    Line,
    /// An arc at the feed, clockwise with Z to the right and X up.
    ArcCw,
    /// The same counter-clockwise.
    ArcCcw,
    /// A thread: passed, its way is not read.
    Thread,
    /// A cycle that is passed: only where it ends is known.
    Opaque,
    /// To a place of the machine: where the axes are then is not known.
    Home,
    /// No motion for a time.
    Dwell,
}

impl Kind {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rapid => "rapid",
            Self::Line => "line",
            Self::ArcCw => "arc_cw",
            Self::ArcCcw => "arc_ccw",
            Self::Thread => "thread",
            Self::Opaque => "opaque",
            Self::Home => "home",
            Self::Dwell => "dwell",
        }
    }

    /// Whether the tool cuts along a known path.
    pub fn is_feed(self) -> bool {
        matches!(self, Self::Line | Self::ArcCw | Self::ArcCcw)
    }
}

/// Where the control lays the nose of the tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = NoseCompensation)]
pub enum Nose {
    /// The imaginary tip runs along the path.
    Off,
    /// The nose runs to the left of the path.
    Left,
    /// The nose runs to the right of the path.
    Right,
}

impl Nose {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// A feed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Feed {
    /// mm per revolution.
    PerRev(f64),
    /// mm per minute.
    PerMinute(f64),
}

/// A speed of the spindle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Speed {
    /// Revolutions per minute.
    Spindle(f64),
    /// Constant surface speed, m/min, and the limit of the spindle, rev/min, where one is set.
    Surface(f64, Option<f64>),
}

/// A place of the programmed point, by axis; unknown where the control alone knows it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Place {
    /// Diameter, mm.
    pub(crate) x: Option<f64>,
    /// mm from program zero.
    pub(crate) z: Option<f64>,
}

impl Place {
    /// Both axes, where they are known.
    pub(crate) fn known(self) -> Option<[f64; 2]> {
        self.x.zip(self.z).map(|(x, z)| [x, z])
    }

    /// Of a place that is known.
    pub(crate) fn at(x: f64, z: f64) -> Self {
        Self { x: Some(x), z: Some(z) }
    }
}

/// A move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Move {
    /// Line that asks for it, from 1; of a cycle the line of its call.
    pub(crate) line: usize,
    /// What it is.
    pub(crate) kind: Kind,
    /// Where it ends.
    pub(crate) end: Place,
    /// Centre of an arc: diameter and z, mm.
    pub(crate) centre: Option<[f64; 2]>,
    /// Feed of a move that cuts, and of a cycle that is passed.
    pub(crate) feed: Option<Feed>,
    /// Speed, where one is set.
    pub(crate) speed: Option<Speed>,
    /// Which of the tools.
    pub(crate) tool: Option<u32>,
    /// Where the nose runs.
    pub(crate) nose: Nose,
}

/// What a cycle does that is expanded into moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = ContourCycleKind)]
pub enum CycleKind {
    /// Roughing in passes along the axis.
    RoughZ,
    /// Roughing in passes across the axis.
    RoughX,
    /// Passes along the contour.
    Pattern,
    /// Finishing along the contour.
    Finishing,
}

/// A cycle that was expanded into moves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ContourCycle {
    /// Line of the call.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: usize,
    /// What it does.
    pub kind: CycleKind,
    /// First line of its contour.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub from_line: usize,
    /// Last line of its contour.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub to_line: usize,
    /// What it leaves on the diameter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub allowance_x_diameter_mm: f64,
    /// What it leaves along the axis.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub allowance_z_mm: f64,
}
