//! Pictures as data: what to draw, not how. Drawn as SVG and by the workbench.

use super::Message;
use serde::Serialize;

/// Panels stacked over one common horizontal axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// Name for `?figure=`.
    pub id: &'static str,
    /// Code of the title.
    pub title: Message,
    /// The common horizontal axis.
    pub x: Axis,
    /// From top to bottom.
    pub panels: Vec<Panel>,
}

/// What an axis shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Axis {
    /// Code of the label.
    pub label: &'static str,
    /// Unit as in the contract: `mm`, `um`, `um/N`, `1`.
    pub unit: &'static str,
}

/// One drawing area with its vertical axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Panel {
    /// The vertical axis.
    pub y: Axis,
    /// Share of the height relative to the other panels.
    pub height: f64,
    /// Drawn in this order, later over earlier.
    pub items: Vec<Item>,
}

/// Something to draw in a panel. `None` in a series is a gap.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Item {
    /// A curve through points.
    Line {
        /// Code of the entry in the legend.
        name: &'static str,
        /// Abscissae, ascending or in the order of drawing.
        x: Vec<f64>,
        /// Ordinates.
        y: Vec<Option<f64>>,
        /// What it stands for.
        role: Role,
    },
    /// The area between two curves.
    Band {
        /// Code of the entry in the legend.
        name: &'static str,
        /// Abscissae.
        x: Vec<f64>,
        /// Lower edge.
        lower: Vec<f64>,
        /// Upper edge.
        upper: Vec<f64>,
        /// What it stands for.
        role: Role,
    },
    /// Single points.
    Points {
        /// Code of the entry in the legend.
        name: &'static str,
        /// Abscissae.
        x: Vec<f64>,
        /// Ordinates.
        y: Vec<f64>,
        /// What they stand for.
        role: Role,
    },
    /// A closed, filled outline (the section of a part), in the units of the axes.
    Outline {
        /// Code of the entry in the legend.
        name: &'static str,
        /// Corners.
        x: Vec<f64>,
        /// Corners.
        y: Vec<f64>,
        /// What it stands for.
        role: Role,
    },
    /// A symbol whose tip touches the point.
    Glyph {
        /// Which symbol.
        glyph: Glyph,
        /// Where its tip is.
        x: f64,
        /// Where its tip is.
        y: f64,
    },
}

/// What a thing in a picture stands for; the renderer chooses colour and stroke, never colour alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// The drawing's wish.
    Nominal,
    /// Without compensation.
    Before,
    /// With it.
    After,
    /// What the machine is told.
    Command,
    /// A comparison: the source paper's formula, a textbook's.
    Comparison,
    /// The workpiece.
    Part,
    /// Blank, material to be removed.
    Stock,
    /// Allowed range.
    Tolerance,
    /// Uncertainty.
    Uncertainty,
    /// A neutral curve.
    Plain,
}

/// Symbols of workholding and tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Glyph {
    /// Live or dead centre that presses toward +x (at the left end).
    CentreLeft,
    /// The same toward -x (at the right end).
    CentreRight,
    /// Chuck jaws.
    Chuck,
    /// Steady rest.
    SteadyRest,
    /// Follow rest.
    FollowRest,
    /// Turning tool, its tip on the part.
    Tool,
}
