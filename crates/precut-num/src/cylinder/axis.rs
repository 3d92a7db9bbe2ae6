//! An axis in space, and points as seen from it.

use super::Point;

/// A straight line with directions square to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// The place that counts as height 0, mm.
    pub origin_mm: Point,
    /// Unit vector along the line.
    pub along: Point,
    /// Unit vectors square to it, right-handed.
    across: [Point; 2],
}

/// A point as seen from an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Local {
    /// Distance from the axis, mm.
    pub distance_mm: f64,
    /// Unit vector from the axis to the point, in the directions square to it.
    pub towards: [f64; 2],
    /// Height along the axis, mm.
    pub height_mm: f64,
}

impl Axis {
    /// The line through two places; height 0 in the middle between them. The first direction square to it is as near to
    /// the x axis as it can be.
    pub fn through(low_mm: Point, high_mm: Point) -> Self {
        let along = unit(minus(high_mm, low_mm));
        // Of lines along x the second direction leads.
        let helper = if along[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let first = unit(minus(helper, times(dot(helper, along), along)));
        let second = cross(along, first);
        Self { origin_mm: times(0.5, plus(low_mm, high_mm)), along, across: [first, second] }
    }

    /// A place at a height, off the axis by so much in the two directions square to it.
    pub fn place_mm(&self, off_mm: [f64; 2], height_mm: f64) -> Point {
        let off = plus(times(off_mm[0], self.across[0]), times(off_mm[1], self.across[1]));
        plus(self.origin_mm, plus(off, times(height_mm, self.along)))
    }

    /// Coordinates of a point: in the two directions square to the axis, and along it, mm.
    pub fn coordinates_mm(&self, point: Point) -> Point {
        let from = minus(point, self.origin_mm);
        [dot(from, self.across[0]), dot(from, self.across[1]), dot(from, self.along)]
    }

    /// A point as seen from here.
    pub fn local(&self, point: Point) -> Local {
        let [x, y, height_mm] = self.coordinates_mm(point);
        let distance_mm = x.hypot(y);
        let towards = if distance_mm > 0.0 { [x / distance_mm, y / distance_mm] } else { [1.0, 0.0] };
        Local { distance_mm, towards, height_mm }
    }
}

/// Points as seen from an axis whose height 0 was moved to the middle of them, and half their length along it, mm.
pub(super) fn seen(axis: Axis, points: &[Point]) -> (Axis, Vec<Local>, f64) {
    let mut seen: Vec<Local> = points.iter().map(|point| axis.local(*point)).collect();
    let heights = seen.iter().map(|local| local.height_mm);
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
    let middle_mm = 0.5 * (low + high);
    for local in &mut seen {
        local.height_mm -= middle_mm;
    }
    (Axis { origin_mm: axis.place_mm([0.0; 2], middle_mm), ..axis }, seen, 0.5 * (high - low))
}

/// The axis after its ends moved: `[x, y]` at the height `half_mm`, then at `-half_mm`.
pub(super) fn moved(axis: Axis, half_mm: f64, [hx, hy, lx, ly]: [f64; 4]) -> Axis {
    Axis::through(axis.place_mm([lx, ly], -half_mm), axis.place_mm([hx, hy], half_mm))
}

/// How the distance of a point changes with the four numbers of [`moved`]: exact at 0.
pub(super) fn gradient(local: &Local, half_mm: f64) -> [f64; 4] {
    let high = 0.5 * (1.0 + local.height_mm / half_mm);
    let [x, y] = local.towards;
    [-high * x, -high * y, (high - 1.0) * x, (high - 1.0) * y]
}

fn plus(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn times(factor: f64, a: Point) -> Point {
    a.map(|v| factor * v)
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: Point) -> Point {
    times(1.0 / dot(a, a).sqrt(), a)
}
