//! What a program leaves of its blank where work and machine yield (`program/4`).
//!
//! `near` (the stock about a move) -> `outline` (how much of the tool is in it) and `sections` (what bends, of the moves that do
//! `together`) -> `cut` (the equilibrium at a place) -> `along` (the places of a move) -> `drive` (along every move, on what the moves
//! before have left) -> `yielded` (what is found) -> `contour` (what comes out against what was meant). `aim` is the drawing, where that is
//! meant. Beam, forces and effects are those of deflection compensation.

mod aim;
mod along;
mod contour;
mod cut;
mod drive;
mod near;
mod outline;
mod sections;
mod together;
mod yielded;

pub(crate) use aim::{FARTHEST_MM, against};
pub(crate) use contour::{ContourError, between, contour, radius_at};
pub(crate) use cut::{AXIS_MM, CutPlace, Load, Pace};
pub(crate) use drive::{Driven, FAILURE_CODES, Instead, yielding};
pub(crate) use yielded::{CLOSE_MM, CutMove, PlaceOfMove, Yielded};
