//! The shaft, its supports and what yields with them: one description for every calculator that bends it.

pub(crate) mod check;
pub(crate) mod elastic;
pub(crate) mod handles;
mod input;
pub(crate) mod places;

pub(crate) use input::DIAMETER_MM;
pub use input::{Carriage, FeedDirection, Section, Segment, Shaft, Support, Theory};
