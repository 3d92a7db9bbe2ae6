//! Pictures as data: what to draw, not how. Drawn as SVG and by the workbench.

use super::Message;
use serde::Serialize;

/// Panels over one common abscissa.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// Name for `?figure=`.
    pub id: &'static str,
    /// Code of the title.
    pub title: Message,
    /// How abscissa and ordinates become a place on the paper.
    pub frame: Frame,
    /// The common horizontal axis.
    pub x: Axis,
    /// From top to bottom.
    pub panels: Vec<Panel>,
}

/// How abscissa and ordinates become a place on the paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Frame {
    /// Panels under each other, the abscissa to the right.
    Stacked,
    /// Roundness chart: the abscissa is an angle in degrees, counter-clockwise from the right; the
    /// ordinate a deviation, drawn magnified outward from a base circle. A curve that goes once round
    /// closes; two points 360 degrees apart are a circle. One panel.
    Polar,
}

/// What an axis shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Axis {
    /// Code of the label.
    pub label: &'static str,
    /// Unit as in the contract: `mm`, `um`, `um/N`, `1`.
    pub unit: &'static str,
    /// How its numbers are spaced.
    pub scale: Spacing,
}

impl Axis {
    /// An axis with even spacing.
    pub const fn linear(label: &'static str, unit: &'static str) -> Self {
        Self { label, unit, scale: Spacing::Linear }
    }

    /// A logarithmic axis; what is not positive is a gap on it.
    pub const fn logarithmic(label: &'static str, unit: &'static str) -> Self {
        Self { label, unit, scale: Spacing::Logarithmic }
    }
}

/// How the numbers of an axis are spaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Spacing {
    /// Equal steps, equal distances.
    Linear,
    /// Equal ratios, equal distances.
    Logarithmic,
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
    /// A bar from zero to each ordinate; those of several names over one abscissa stand side by side.
    Bars {
        /// Code of the entry in the legend.
        name: &'static str,
        /// Middles of the bars.
        x: Vec<f64>,
        /// Ordinates.
        y: Vec<Option<f64>>,
        /// What they stand for.
        role: Role,
    },
    /// A number over the plane as colour, with its scale beside the panel. One per panel.
    HeatMap {
        /// What the colour shows.
        value: Axis,
        /// Middles of the columns, ascending.
        x: Vec<f64>,
        /// Middles of the rows, ascending.
        y: Vec<f64>,
        /// Row by row; `None` is left blank.
        values: Vec<Option<f64>>,
        /// Whether the colours part at zero (growth and decay; at one, if `value` is logarithmic) or run
        /// from low to high.
        diverging: bool,
    },
    /// What holds along stretches of the abscissa: a coloured and lettered ribbon as high as its panel. Where several
    /// names hold over one stretch, they share its height by weight. A panel of ribbons alone has no numbers at its side.
    Ribbon {
        /// Code of the entry in the legend: what holds.
        name: &'static str,
        /// Where the stretches begin.
        x: Vec<f64>,
        /// Where they end.
        x_end: Vec<f64>,
        /// How much it weighs on each, above zero, in the unit of the panel's axis.
        weight: Vec<f64>,
        /// What each stretch is called.
        places: Vec<String>,
        /// What it stands for.
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
    /// A place that can be taken hold of where the picture is a live one; a printed picture does not have it.
    Handle(Handle),
    /// The place that the setting of the job has in the picture; a printed picture does not have it.
    Setting(Setting),
}

/// A place of a picture that numbers of the job follow when it is moved along one axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Handle {
    /// Code of what it is called.
    pub name: &'static str,
    /// Where it is.
    pub x: f64,
    /// Where it is.
    pub y: f64,
    /// The axis along which it goes.
    pub along: Along,
    /// How far it goes: its least and its largest place on that axis.
    pub reach: [f64; 2],
    /// Places at which it stops when it comes near them.
    pub stops: Vec<f64>,
    /// The numbers that follow it.
    pub moves: Vec<Move>,
}

/// Where the job stands in a picture. Every other place is another job: [`Calculator::at_place`] says which.
///
/// [`Calculator::at_place`]: super::Calculator::at_place
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Setting {
    /// Code of what it is called.
    pub name: &'static str,
    /// Where it is.
    pub x: f64,
    /// Where it is. Along a curve, and round a polar picture, the abscissa alone counts.
    pub y: f64,
    /// The figure of the other job that shows what a place would give before it is taken; `None` where it is taken at
    /// once.
    pub tried_in: Option<&'static str>,
    /// What stays as it is, and what goes along, when it is put elsewhere.
    pub about: Option<Said>,
}

/// Something that is said beside a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Said {
    /// Code of the sentence.
    pub label: &'static str,
}

/// A place in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place<'a> {
    /// `id` of the figure.
    pub figure: &'a str,
    /// Code of the setting that is put there.
    pub setting: &'a str,
    /// Abscissa.
    pub x: f64,
    /// Ordinate.
    pub y: f64,
}

/// An axis of a panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Along {
    /// The abscissa.
    X,
    /// The ordinate.
    Y,
}

/// A number of the job that follows a handle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Move {
    /// Its place in the job.
    pub pointer: String,
    /// By how much it changes when the handle goes on by one.
    pub per_unit: f64,
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
    /// A limit that must not be crossed.
    Limit,
    /// Where it is stable, holds, is allowed.
    Stable,
    /// Where it is not.
    Unstable,
    /// The n-th of a family of like curves, from 0.
    Series(u8),
    /// A neutral curve.
    Plain,
}

impl Role {
    /// The letter in a ribbon of this role: that of its number in the family, `A` for a single one.
    pub fn letter(self) -> char {
        match self {
            Self::Series(n) => char::from(b'A' + n % 26),
            _ => 'A',
        }
    }
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
