//! Programs of turned shafts: written so that no rapid motion comes near the work, and driven over the work as it yields.
//!
//! A calculator says which stretches are cut with which corners (`Stretch`) and what a command leaves of what stands
//! (`Yielding`); `write` makes the program, `drive` turns the blank with the finished program, pass by pass on what
//! the last one really left. The proof of an answer is what the drive finds.

mod drive;
mod shoulder;
mod surface;
mod write;

pub(crate) use drive::{Driven, Limits, drive};
pub use drive::{Proof, ProofPlace};
pub(crate) use shoulder::{EDGE_MEETS_SHOULDER, Finished, edge_meets_shoulders};
pub(crate) use surface::{Point, Surface};
pub(crate) use write::{Rest, Setting, Speed, Stretch, Written, write};

/// What a command leaves of the work, which yields.
pub(crate) trait Yielding {
    /// Radius that is left at a point of the surface of the radius that stands there, mm, when cut number `cut` commands
    /// a radius. `station` is the point's own number in the calculator.
    fn left_mm(&mut self, cut: usize, station: usize, stands_mm: f64, command_mm: f64) -> f64;
}

/// Work that does not yield.
#[cfg(test)]
pub(crate) struct Rigid;

#[cfg(test)]
impl Yielding for Rigid {
    fn left_mm(&mut self, _cut: usize, _station: usize, stands_mm: f64, command_mm: f64) -> f64 {
        stands_mm.min(command_mm)
    }
}
