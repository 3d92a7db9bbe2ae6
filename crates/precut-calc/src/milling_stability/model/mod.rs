//! The model: cutter and force, what yields, the map over a period and what follows from it.

mod cutter;
mod edge;
mod intervals;
mod map;
mod mesh;
mod multiplier;
mod rotation;
mod structure;
mod zeroth;

pub use cutter::{Law, Milling, Rubbing, Tensor, Tooth, Vector};
pub use edge::{Edges, Engagement, Entry};
pub use intervals::{Crossing, Unstable, crossings, unstable};
pub use map::{Cut, Map};
pub use multiplier::{Kind, Multiplier, Orders};
pub use rotation::Rotation;
pub use structure::{Mode, Side, Structure};
pub use zeroth::{Zeroth, mean_stiffness, zeroth};
