//! Roundness of a closed section: reference circles with Euclidean distances, the Gaussian filter of
//! closed profiles, the harmonic spectrum.
//!
//! ```text
//! points, or angles and radii ─► Section ─► least_squares ─► centre
//!                                   │            │
//!                                   │            ├─► minimum_zone, maximum_inscribed, minimum_circumscribed
//!                                   └────────────┴─► refer (uniform angles about that centre) ─► Grid: filter, spectrum
//! ```
//! [`circles`] does the four circles at once; [`evaluate`] does all of it in the order of the standard
//! (ISO 12181-2): refer to the least-squares centre, filter, fit the circles to the filtered profile.
//! What passes over the points again and again asks `goes_on` before each pass, and ends where that says no.
//! Lengths are mm, angles rad, harmonics are counted in undulations per revolution (UPR).
//!
//! Equation numbers are those of `docs/physics/roundness-evaluation.md`.

mod circumscribed;
mod contact;
mod evaluation;
mod grid;
mod inscribed;
mod least_squares;
mod minimum_zone;
mod section;
mod spline;
mod triangle;

pub use circumscribed::{MinimumCircumscribed, minimum_circumscribed};
pub use evaluation::{Circles, Evaluation, circles, evaluate};
pub use grid::{Filter, Grid, Harmonic};
pub use inscribed::{MaximumInscribed, OtherInscribed, maximum_inscribed};
pub use least_squares::{LeastSquares, least_squares};
pub use minimum_zone::{MinimumZone, minimum_zone};
pub use section::{Circle, Section, Span};
pub use spline::{PeriodicSpline, refer};

/// Why a section has no answer.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RoundnessError {
    /// Fewer points than the question needs.
    #[error("{count} points, at least {needed} are needed")]
    TooFewPoints {
        /// Points given.
        count: usize,
        /// Points needed.
        needed: usize,
    },
    /// Lists of one section differ in length.
    #[error("{first} values beside {second}")]
    LengthsDiffer {
        /// Length of the first list.
        first: usize,
        /// Length of the second.
        second: usize,
    },
    /// A coordinate is not a finite number, or its square is none.
    #[error("point {index} is not finite")]
    NotFinite {
        /// Which point, from 0.
        index: usize,
    },
    /// All points coincide or lie on a straight line: no circle is nearest.
    #[error("the points determine no circle")]
    NoCircle,
    /// The points surround no centre (an arc up to 180°): inscribed circles grow without limit.
    #[error("the points do not surround a centre")]
    NotSurrounding,
    /// Seen from the centre the points do not follow each other with rising angle.
    #[error("point {index} lies behind its predecessor as seen from the centre")]
    NotStarShaped {
        /// Which point, from 0.
        index: usize,
    },
    /// Nobody waits for the answer any more.
    #[error("stopped")]
    Stopped,
    /// The iteration ended without reaching its tolerance.
    #[error("no convergence after {iterations} iterations, {left_mm:e} mm left")]
    NotConverged {
        /// Steps taken.
        iterations: u32,
        /// Last step or gap, mm.
        left_mm: f64,
    },
}

/// `Err` once nobody waits for the answer any more.
fn look(goes_on: &dyn Fn() -> bool) -> Result<(), RoundnessError> {
    if goes_on() { Ok(()) } else { Err(RoundnessError::Stopped) }
}
