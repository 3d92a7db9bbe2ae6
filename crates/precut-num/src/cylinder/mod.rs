//! Cylinders through measured points: least squares, minimum zone, maximum inscribed, minimum circumscribed, each of the
//! last three with a bound on how much better any other could be; and the straightness of a line of centres.
//!
//! ```text
//! points ─► least_squares ─► frame about its axis ─► envelope (linear programs, one after the other) ─► its proof
//! ```
//! Lengths are mm. Equation numbers are those of `docs/physics/cylindricity-evaluation.md`.

mod axis;
mod envelope;
mod least_squares;
mod median;
mod program;
mod proof;

pub use axis::{Axis, Local};
pub use envelope::{Contact, Envelope, Kind, envelope};
pub use least_squares::{LeastSquares, least_squares};
pub use median::{Median, median_line};
pub use proof::Proof;

/// A point, mm.
pub type Point = [f64; 3];

/// Why points have no cylinder.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CylinderError {
    /// Fewer points than a cylinder has numbers, or all in one plane, or on lines: no axis is nearest.
    #[error("the points determine no cylinder")]
    Undetermined,
    /// Nobody waits for the answer any more.
    #[error("stopped")]
    Stopped,
    /// The iteration ended without reaching its tolerance.
    #[error("no convergence after {iterations} iterations, {left_mm:e} mm left")]
    NotConverged {
        /// Steps taken.
        iterations: u32,
        /// Last gain, mm.
        left_mm: f64,
    },
}
