//! The points of a section, and the scan for its nearest and farthest point.

use super::RoundnessError;

/// Coordinates beyond this are refused: their squares would leave the range of numbers, mm.
const LARGEST_MM: f64 = 1e150;
/// Points scanned as one block; the place of an extremum is looked up afterwards in its block alone.
const BLOCK: usize = 128;
/// Independent extrema within a block, so that the scan is not one chain of comparisons.
const LANES: usize = 4;

/// Points of a section in its plane, mm, at least one and all finite.
///
/// Kept as two lists about a shifted origin: distances from a centre near the middle then carry the
/// round-off of the radius, not that of the distance from the machine's origin.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::struct_field_names, reason = "units stand in the name")]
pub struct Section {
    /// Where the coordinates below are measured from, mm.
    pub(super) origin_mm: [f64; 2],
    /// Coordinates from [`Self::origin_mm`], mm.
    pub(super) x_mm: Vec<f64>,
    /// As `x_mm`, and as many.
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
        check(x_mm, y_mm)?;
        // Not more than a place near the middle: x - origin is exact to the last digit of the difference.
        let origin_mm = [mean(x_mm), mean(y_mm)];
        let about = |values: &[f64], origin: f64| values.iter().map(|value| value - origin).collect();
        Ok(Self { origin_mm, x_mm: about(x_mm, origin_mm[0]), y_mm: about(y_mm, origin_mm[1]) })
    }

    /// A section of points at any angles, rad, with their distances from the origin, mm.
    pub fn from_polar(angles_rad: &[f64], radii_mm: &[f64]) -> Result<Self, RoundnessError> {
        check(angles_rad, radii_mm)?;
        let directions = angles_rad.iter().map(|angle| angle.sin_cos());
        let (x_mm, y_mm) = directions.zip(radii_mm).map(|((sin, cos), radius)| (radius * cos, radius * sin)).unzip();
        Ok(Self { origin_mm: [0.0; 2], x_mm, y_mm })
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
        self.outside(self.at(index))
    }

    /// Distances of all points from a centre, mm.
    pub fn distances_mm(&self, centre_mm: [f64; 2]) -> Vec<f64> {
        let [cx, cy] = self.inside(centre_mm);
        let square = |(x, y): (&f64, &f64)| (x - cx) * (x - cx) + (y - cy) * (y - cy);
        self.x_mm.iter().zip(&self.y_mm).map(|point| square(point).sqrt()).collect()
    }

    /// Nearest and farthest point as seen from a centre (`roundness/2.1`).
    pub fn span(&self, centre_mm: [f64; 2]) -> Span {
        self.span_inside(self.inside(centre_mm))
    }

    /// A place as the lists have it.
    pub(super) fn inside(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x - self.origin_mm[0], y - self.origin_mm[1]]
    }

    /// A place as the caller has it.
    pub(super) fn outside(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x + self.origin_mm[0], y + self.origin_mm[1]]
    }

    /// A point as the lists have it.
    pub(super) fn at(&self, index: usize) -> [f64; 2] {
        [self.x_mm[index], self.y_mm[index]]
    }

    /// From a centre (as the lists have it) to a point.
    pub(super) fn from(&self, [cx, cy]: [f64; 2], index: usize) -> [f64; 2] {
        [self.x_mm[index] - cx, self.y_mm[index] - cy]
    }

    /// Some of the points.
    pub(super) fn part(&self, indices: &[usize]) -> Self {
        let of = |values: &[f64]| indices.iter().map(|&index| values[index]).collect();
        Self { origin_mm: self.origin_mm, x_mm: of(&self.x_mm), y_mm: of(&self.y_mm) }
    }

    /// [`Self::span`] about a centre as the lists have it. Compares squares: their order is that of the distances.
    pub(super) fn span_inside(&self, centre: [f64; 2]) -> Span {
        let mut nearest = Extremum { square: f64::INFINITY, block: 0 };
        let mut farthest = Extremum { square: f64::NEG_INFINITY, block: 0 };
        for (block, (x, y)) in self.x_mm.chunks(BLOCK).zip(self.y_mm.chunks(BLOCK)).enumerate() {
            let (low, high) = block_extrema(centre, x, y);
            if low < nearest.square {
                nearest = Extremum { square: low, block };
            }
            if high > farthest.square {
                farthest = Extremum { square: high, block };
            }
        }
        Span {
            nearest_mm: nearest.square.sqrt(),
            farthest_mm: farthest.square.sqrt(),
            nearest: self.place_of(centre, &nearest),
            farthest: self.place_of(centre, &farthest),
        }
    }

    /// Index of the point with that squared distance.
    fn place_of(&self, centre: [f64; 2], extremum: &Extremum) -> usize {
        let first = extremum.block * BLOCK;
        let last = (first + BLOCK).min(self.len());
        // The same arithmetic gives the same bits, so the point is found again.
        (first..last).find(|&i| square(self.from(centre, i)).to_bits() == extremum.square.to_bits()).unwrap_or(first)
    }
}

/// Extreme square of a distance, and the block that holds it.
struct Extremum {
    square: f64,
    block: usize,
}

/// |v|².
pub(super) fn square([x, y]: [f64; 2]) -> f64 {
    x * x + y * y
}

/// Smallest and largest squared distance within a block.
fn block_extrema([cx, cy]: [f64; 2], x: &[f64], y: &[f64]) -> (f64, f64) {
    let mut low = [f64::INFINITY; LANES];
    let mut high = [f64::NEG_INFINITY; LANES];
    let (x_lanes, x_rest) = x.as_chunks::<LANES>();
    let (y_lanes, y_rest) = y.as_chunks::<LANES>();
    for (x, y) in x_lanes.iter().zip(y_lanes) {
        for lane in 0..LANES {
            let d = square([x[lane] - cx, y[lane] - cy]);
            low[lane] = if d < low[lane] { d } else { low[lane] };
            high[lane] = if d > high[lane] { d } else { high[lane] };
        }
    }
    for (x, y) in x_rest.iter().zip(y_rest) {
        let d = square([x - cx, y - cy]);
        low[0] = low[0].min(d);
        high[0] = high[0].max(d);
    }
    (low.into_iter().fold(f64::INFINITY, f64::min), high.into_iter().fold(f64::NEG_INFINITY, f64::max))
}

fn check(first: &[f64], second: &[f64]) -> Result<(), RoundnessError> {
    if first.len() != second.len() {
        return Err(RoundnessError::LengthsDiffer { first: first.len(), second: second.len() });
    }
    if first.is_empty() {
        return Err(RoundnessError::TooFewPoints { count: 0, needed: 1 });
    }
    let bad = first.iter().zip(second).position(|(a, b)| !(in_range(*a) && in_range(*b)));
    bad.map_or(Ok(()), |index| Err(RoundnessError::NotFinite { index }))
}

/// Whether a number is finite and its square too.
pub(super) fn in_range(value: f64) -> bool {
    value.abs() <= LARGEST_MM
}

/// Mean of numbers, at least one.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / count(values.len())
}

/// A count as a number.
pub(super) fn count(n: usize) -> f64 {
    // Lists of 2^53 points do not fit into memory.
    #[allow(clippy::cast_precision_loss)]
    let number = n as f64;
    number
}
