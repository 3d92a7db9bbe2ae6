//! The work while it is turned, on work and machine that do not yield (`program/3`).
//!
//! `curve` (radii over the axis) -> `chain` (the outline, and who made which part) <- `sweep` (what a tool covers on its way) and
//! `edges` (where its edges end); `take` is both together. `nose` is where a tool goes whose nose is compensated; `rigid` drives a
//! program over a blank.

mod chain;
mod curve;
mod edges;
mod nose;
mod rigid;
mod sweep;
mod take;

pub(crate) use chain::{Chain, Part, Sums};
pub(crate) use curve::{Curve, Piece, SAME_MM};
pub(crate) use nose::path_beside;
pub(crate) use rigid::{
    Doubt, FAILURE_CODES, FINISHES_MM, Stroke, Turned, blank, doubt, implausible_mm, lines_that_finish, outline,
    strokes, turned, zero_that_fits,
};
pub(crate) use sweep::{Shape, Way};
