//! The model: cutter and force, what yields, the map over a period and what follows from it.

mod carried;
mod cutter;
mod direct;
mod edge;
mod forced;
mod intervals;
mod map;
mod mesh;
mod multiplier;
mod rotation;
mod shares;
mod slow;
mod slow_period;
mod statics;
mod structure;
mod zeroth;

pub use carried::{Carried, Instant, Sampling};
pub use cutter::{About, Law, Milling, Rubbing, Tensor, Tooth, Turn, Vector};
pub use direct::{Direct, DirectLimit, MeasuredPair, NotDirect};
pub use edge::{Edges, Engagement, Entry};
pub use forced::{Forced, Roughness, Wall};
pub use intervals::{Crossing, Scan, Search, Unstable, scan, unstable};
pub use map::{Cut, Map};
pub use multiplier::{Kind, Multiplier, Orders};
pub use rotation::Rotation;
pub use shares::{Alias, Shares};
pub use slow::{MOST_OSCILLATIONS, slow_limit};
pub use slow_period::{GROWN, SlowMultiplier};
pub use statics::{Statics, statics};
pub use structure::{Mode, Side, Structure};
pub use zeroth::{Zeroth, mean_stiffness, zeroth};
