//! Directions of contacts as seen from a centre: whether they hold it, and how stiffly.

use super::section::{Section, square};

/// u×v.
pub(super) fn cross([ux, uy]: [f64; 2], [vx, vy]: [f64; 2]) -> f64 {
    ux * vy - uy * vx
}

/// u·v.
pub(super) fn dot([ux, uy]: [f64; 2], [vx, vy]: [f64; 2]) -> f64 {
    ux * vx + uy * vy
}

/// v/|v|; of the zero vector the zero vector.
pub(super) fn unit([x, y]: [f64; 2]) -> [f64; 2] {
    let length = square([x, y]).sqrt();
    if length > 0.0 { [x / length, y / length] } else { [0.0; 2] }
}

/// a − b.
pub(super) fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Smallest, over all unit directions e, of the largest u·e of three unit vectors: the distance of the origin from the
/// sides of their triangle, negative where it lies outside (`roundness/5.2`).
pub(super) fn hold_of_three(directions: [[f64; 2]; 3]) -> f64 {
    let [u, v, w] = directions;
    let turn = cross(minus(v, u), minus(w, u));
    let side = |a: [f64; 2], b: [f64; 2]| {
        let along = minus(b, a);
        let length = square(along).sqrt();
        // Coincident directions: no triangle.
        if length > 0.0 { cross(a, along) / length } else { f64::NEG_INFINITY }
    };
    let sides = [side(u, v), side(v, w), side(w, u)];
    let inward = if turn >= 0.0 { sides } else { sides.map(|s| if s.is_finite() { -s } else { s }) };
    inward.into_iter().fold(f64::INFINITY, f64::min)
}

/// How far outside its triangle the centre may lie by round-off alone: three of four contacts at right angles hold it
/// with the fourth.
pub(super) const FLAT: f64 = 1e-13;

/// The same of all points that are as near to a centre as `radius_mm` (`roundness/5.6`): the cosine of half the widest
/// angle between neighbours of them. Made profiles touch their circle at more than three points, of which no three need
/// hold it. With how many they are.
pub(super) fn hold_of_ties(section: &Section, centre: [f64; 2], radius_mm: f64) -> (f64, usize) {
    let slack = 2.0 * resolution_mm(radius_mm);
    let mut angles: Vec<f64> = (0..section.len())
        .map(|index| section.from(centre, index))
        .filter(|v| (square(*v).sqrt() - radius_mm).abs() <= slack)
        .map(|[x, y]| y.atan2(x))
        .collect();
    angles.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (angles.first(), angles.last()) else { return (-1.0, 0) };
    let around = first + std::f64::consts::TAU - last;
    let gap = angles.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f64::max);
    ((0.5 * gap).cos(), angles.len())
}

/// Smallest, over all unit directions e, of the largest (u − v)·e over inner contacts u and outer contacts v: the
/// distance of the origin from the sides of the parallelogram of the four differences, negative where it lies outside
/// (`roundness/4.3`). Positive exactly where the two chords cross, that is, where the contacts alternate.
pub(super) fn hold_of_zone(inner: [[f64; 2]; 2], outer: [[f64; 2]; 2]) -> f64 {
    let [u, w] = inner;
    let [v, z] = outer;
    // Two opposite sides are parallel to u − w and pass v and z; the others are parallel to v − z and pass u and w.
    let pair = |along: [f64; 2], first: [f64; 2], second: [f64; 2]| {
        let along = unit(along);
        let (a, b) = (cross(along, first), cross(along, second));
        if a * b < 0.0 { a.abs().min(b.abs()) } else { -a.abs().min(b.abs()) }
    };
    pair(minus(u, w), minus(u, v), minus(u, z)).min(pair(minus(v, z), minus(u, v), minus(w, v)))
}

/// Sectors of 22.5° that are looked at first.
const SECTORS: u32 = 16;
/// Points looked at before all of them are.
const SAMPLE: usize = 96;

/// Cosine of half the largest angle between neighbouring points as seen from a centre, or a smaller one; `None` where
/// the points leave half a turn free (`roundness/4.5`).
pub(super) fn half_gap_cosine(section: &Section, centre: [f64; 2]) -> Option<f64> {
    let step = (section.len() / SAMPLE).max(1);
    if fills_sectors(section, centre, step) || (step > 1 && fills_sectors(section, centre, 1)) {
        // A point in every sector: neighbours are less than two sectors apart.
        return Some((std::f64::consts::TAU / f64::from(SECTORS)).cos());
    }
    let mut angles: Vec<f64> = (0..section.len())
        .map(|i| {
            let [x, y] = section.from(centre, i);
            y.atan2(x)
        })
        .collect();
    angles.sort_by(f64::total_cmp);
    let (first, last) = (*angles.first()?, *angles.last()?);
    let around = first + std::f64::consts::TAU - last;
    let gap = angles.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f64::max);
    (gap < std::f64::consts::PI).then(|| (0.5 * gap).cos())
}

/// Whether every sector has a point among every `step`th.
fn fills_sectors(section: &Section, centre: [f64; 2], step: usize) -> bool {
    let mut seen = 0_u32;
    for index in (0..section.len()).step_by(step) {
        seen |= 1 << sector(section.from(centre, index));
        if seen == (1 << SECTORS) - 1 {
            return true;
        }
    }
    false
}

/// Which of the sixteen sectors of 22.5° a direction is in; its last three bits are the eighth of a turn. The order of
/// the numbers is of no matter.
pub(super) fn sector([x, y]: [f64; 2]) -> usize {
    const TAN_22_5: f64 = std::f64::consts::SQRT_2 - 1.0;
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = (ax.min(ay), ax.max(ay));
    usize::from(x < 0.0)
        | usize::from(y < 0.0) << 1
        | usize::from(ay > ax) << 2
        | usize::from(low > TAN_22_5 * high) << 3
}

/// Sine of the angle between two bisectors below which their crossing has no digits left.
const PARALLEL: f64 = 1e-12;

/// The place from which two pairs of points are each equally far: the crossing of their perpendicular bisectors.
/// `None` where these are parallel as far as numbers tell.
pub(super) fn equidistant(
    section: &Section,
    near: [f64; 2],
    first: [usize; 2],
    second: [usize; 2],
) -> Option<[f64; 2]> {
    // Solved for the shift from `near`, so that the round-off is that of the shift.
    let row = |[i, j]: [usize; 2]| {
        let (a, b) = (section.from(near, i), section.from(near, j));
        let along = minus(b, a);
        // (|b|² − |a|²)/2 without the cancellation of the squares.
        (along, 0.5 * dot(along, [a[0] + b[0], a[1] + b[1]]))
    };
    let ((a, p), (b, q)) = (row(first), row(second));
    let determinant = cross(a, b);
    let scale = (square(a) * square(b)).sqrt();
    // Also refuses what is no number.
    let crosses = determinant.abs() > PARALLEL * scale;
    if !crosses {
        return None;
    }
    Some([near[0] + (p * b[1] - q * a[1]) / determinant, near[1] + (q * a[0] - p * b[0]) / determinant])
}

/// Round-off of one distance from a centre in units of the last place: coordinates, two squares, sum, root, and the
/// same again in the comparison.
pub(super) const DISTANCE_ULPS: f64 = 8.0;

/// Bound of the round-off of distances up to `distance_mm`, mm.
pub(super) fn resolution_mm(distance_mm: f64) -> f64 {
    DISTANCE_ULPS * f64::EPSILON * distance_mm
}

/// All points by angle, counter-clockwise, beginning after the largest gap between neighbours.
pub(super) fn order_from_gap(section: &Section, centre: [f64; 2]) -> Vec<usize> {
    let mut angles: Vec<(f64, usize)> = (0..section.len())
        .map(|index| {
            let [x, y] = section.from(centre, index);
            (y.atan2(x), index)
        })
        .collect();
    angles.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let gap_after = |at: usize| {
        let next = angles.get(at + 1).map_or(angles[0].0 + std::f64::consts::TAU, |next| next.0);
        next - angles[at].0
    };
    let widest = (0..angles.len()).max_by(|&a, &b| gap_after(a).total_cmp(&gap_after(b)));
    let first = widest.map_or(0, |at| at + 1) % angles.len();
    angles.rotate_left(first);
    angles.into_iter().map(|(_, index)| index).collect()
}

/// How far a proof of first order reaches: a contact at `distance_mm` recedes by at most s²/(2(distance − s)) more than
/// its direction says when the centre moves by s, and `hold`·s outweighs that up to here (`roundness/4.4`).
pub(super) fn reach_mm(hold: f64, distance_mm: f64) -> f64 {
    2.0 * hold * distance_mm / (1.0 + 2.0 * hold)
}
