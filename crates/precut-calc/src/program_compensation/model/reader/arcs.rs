//! Centres of arcs (`program/2.3`): from I and K, or from a radius.

use super::codes::Path;

/// Radii at both ends may differ by this, mm, or by this share.
const MISMATCH_MM: f64 = 0.01;
const MISMATCH_SHARE: f64 = 0.0005;
/// A chord may be longer than the diameter by this, mm.
const CHORD_MM: f64 = 0.01;

/// A point: radius and z, mm.
pub(super) type Point = [f64; 2];

fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Whether two points are not one.
pub(super) fn are_apart(a: Point, b: Point) -> bool {
    distance(a, b) > 0.0
}

/// Whether a centre is as far from both ends as a control asks for.
pub(super) fn fits(start: Point, end: Point, centre: Point) -> bool {
    let (first, last) = (distance(start, centre), distance(end, centre));
    (first - last).abs() <= MISMATCH_MM.max(MISMATCH_SHARE * first.max(last))
}

/// Centre of an arc of this radius: above 0 the shorter of both, below 0 the longer one. `None` where the ends are farther
/// apart than any circle of this radius is wide.
pub(super) fn centre_of_radius(start: Point, end: Point, radius: f64, path: Path) -> Option<Point> {
    let chord = distance(start, end);
    if chord > 2.0 * radius.abs() + CHORD_MM {
        return None;
    }
    let height = (radius * radius - 0.25 * chord * chord).max(0.0).sqrt();
    // Unit vector along the chord in (z, r); its left has the centre of a short arc that turns counter-clockwise.
    let (along_z, along_r) = ((end[1] - start[1]) / chord, (end[0] - start[0]) / chord);
    let is_left = (path == Path::CounterClockwise) == (radius > 0.0);
    let side = if is_left { height } else { -height };
    let middle = [0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])];
    Some([middle[0] + side * along_z, middle[1] - side * along_r])
}

/// Centre of an arc of less than half a turn.
pub(crate) fn centre_of_short_arc(start: [f64; 2], end: [f64; 2], radius: f64, is_clockwise: bool) -> Option<[f64; 2]> {
    let path = if is_clockwise { Path::Clockwise } else { Path::CounterClockwise };
    if are_apart(start, end) { centre_of_radius(start, end, radius.abs(), path) } else { None }
}

/// Whether an arc turns back on an axis between its ends: radius or z has an extreme there.
pub(super) fn turns_back(start: Point, end: Point, centre: Point, path: Path) -> bool {
    let angle = |point: Point| (point[0] - centre[0]).atan2(point[1] - centre[1]);
    let (from, to) = if path == Path::CounterClockwise { (start, end) } else { (end, start) };
    let turn = (angle(to) - angle(from)).rem_euclid(std::f64::consts::TAU);
    // An extreme stands at every quarter; one at an end is none.
    let tolerance = 1e-7;
    (0..4).any(|quarter| {
        let at = (f64::from(quarter) * std::f64::consts::FRAC_PI_2 - angle(from)).rem_euclid(std::f64::consts::TAU);
        at > tolerance && at < turn - tolerance
    })
}

/// Where an arc between its ends has this radius from the axis: its z.
pub(super) fn z_at(start: Point, end: Point, centre: Point, r: f64) -> f64 {
    let radius = distance(start, centre);
    let half = (radius * radius - (r - centre[0]).powi(2)).max(0.0).sqrt();
    let (least, most) = (start[1].min(end[1]), start[1].max(end[1]));
    let beside = |z: f64| (least - z).max(z - most).max(0.0);
    let (left, right) = (centre[1] - half, centre[1] + half);
    if beside(left) <= beside(right) { left } else { right }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarters_by_their_radius() {
        let near = |found: Option<Point>, r: f64, z: f64| {
            let centre = found.unwrap_or([f64::NAN; 2]);
            assert!(distance(centre, [r, z]) < 1e-12, "{centre:?}");
        };
        near(centre_of_radius([10.0, 0.0], [20.0, -10.0], 10.0, Path::CounterClockwise), 10.0, -10.0);
        near(centre_of_radius([20.0, -10.0], [30.0, -20.0], 10.0, Path::Clockwise), 30.0, -10.0);
        near(centre_of_radius([10.0, 0.0], [20.0, -10.0], -10.0, Path::CounterClockwise), 20.0, 0.0);
        assert_eq!(centre_of_radius([0.0, 0.0], [20.0, 0.0], 9.0, Path::Clockwise), None);
    }

    #[test]
    fn an_arc_turns_back_where_a_quarter_lies_inside() {
        assert!(!turns_back([10.0, 0.0], [20.0, -10.0], [10.0, -10.0], Path::CounterClockwise));
        assert!(turns_back([10.0, 0.0], [20.0, -10.0], [10.0, -10.0], Path::Clockwise));
        let tilted = [10.0 - 50.0_f64.sqrt(), -10.0 + 50.0_f64.sqrt()];
        assert!(turns_back(tilted, [20.0, -10.0], [10.0, -10.0], Path::CounterClockwise));
    }
}
