//! The points of a section.

use super::RoundnessError;

/// Points of a closed section in its plane, mm, at least one and all finite.
///
/// Kept as two lists about a shifted origin: distances from a centre near the middle then carry the
/// round-off of the radius, not that of the distance from the machine's origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Where the coordinates below are measured from, mm.
    pub(super) origin_mm: [f64; 2],
    /// Coordinates from [`Self::origin_mm`], mm.
    pub(super) x_mm: Vec<f64>,
    pub(super) y_mm: Vec<f64>,
}

/// A circle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Centre in the coordinates of the section, mm.
    pub centre_mm: [f64; 2],
    /// Radius, mm.
    pub radius_mm: f64,
}

/// Nearest and farthest point of a section as seen from a centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Smallest distance, mm.
    pub nearest_mm: f64,
    /// Largest distance, mm.
    pub farthest_mm: f64,
    /// Index of the nearest point (the first of equals).
    pub nearest: usize,
    /// Index of the farthest point (the first of equals).
    pub farthest: usize,
}

impl Span {
    /// Peak to valley, RONt about that centre, mm.
    pub fn width_mm(&self) -> f64 {
        self.farthest_mm - self.nearest_mm
    }
}

impl Section {
    /// A section of points in any order, mm. Coordinates beyond 1e150 mm count as not finite.
    pub fn from_points(x_mm: &[f64], y_mm: &[f64]) -> Result<Self, RoundnessError> {
        let _ = (x_mm, y_mm);
        Err(RoundnessError::NoCircle)
    }

    /// A section of points at any angles, rad, with their distances from the origin, mm.
    pub fn from_polar(angles_rad: &[f64], radii_mm: &[f64]) -> Result<Self, RoundnessError> {
        let _ = (angles_rad, radii_mm);
        Err(RoundnessError::NoCircle)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.x_mm.len()
    }

    /// Whether there are none; a section has at least one.
    pub fn is_empty(&self) -> bool {
        self.x_mm.is_empty()
    }

    /// A point, mm.
    pub fn point_mm(&self, index: usize) -> [f64; 2] {
        [self.origin_mm[0] + self.x_mm[index], self.origin_mm[1] + self.y_mm[index]]
    }

    /// Distances of all points from a centre, mm.
    pub fn distances_mm(&self, centre_mm: [f64; 2]) -> Vec<f64> {
        let _ = centre_mm;
        Vec::new()
    }

    /// Nearest and farthest point as seen from a centre (`roundness/2.1`).
    pub fn span(&self, centre_mm: [f64; 2]) -> Span {
        let _ = centre_mm;
        Span { nearest_mm: 0.0, farthest_mm: 0.0, nearest: 0, farthest: 0 }
    }
}
