//! The straightness of a line of centres: the thinnest cylinder that holds them.

use super::program::{Plane, Sides, solve};
use super::{CylinderError, Point};

const MOST_ROUNDS: u32 = 500;
/// Directions in which every centre is held at the start.
const DIRECTIONS: u32 = 8;
/// The bound and the value meet to this share of the value, or to rounding.
const MEET: f64 = 1e-9;

/// The thinnest cylinder round centres.
#[derive(Debug, Clone, PartialEq)]
pub struct Median {
    /// Its diameter, mm.
    pub diameter_mm: f64,
    /// No cylinder is thinner by more than this, mm.
    pub gap_mm: f64,
    /// Where its axis passes the highest and the lowest centre, mm.
    pub ends_mm: [[f64; 2]; 2],
    /// Distance of each centre from it, mm.
    pub off_mm: Vec<f64>,
}

/// Centres as offsets square to an axis nearly along theirs, with their heights along it, mm.
///
/// The largest distance is convex in the two ends; planes that touch it from below are added where the last line of
/// centres fits worst, until the least of the planes and the true distance meet.
pub fn median_line(centres: &[Point]) -> Result<Median, CylinderError> {
    let heights = || centres.iter().map(|c| c[2]);
    let (low, high) = heights().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
    let half = 0.5 * (high - low);
    if centres.len() < 2 || half <= 0.0 {
        return Err(CylinderError::Undetermined);
    }
    let share = |centre: &Point| 0.5 * (1.0 + (centre[2] - 0.5 * (low + high)) / half);
    let plane = |centre: &Point, [x, y]: [f64; 2]| {
        let up = share(centre);
        Plane { rise: [-up * x, -up * y, (up - 1.0) * x, (up - 1.0) * y], value: centre[0] * x + centre[1] * y }
    };
    let directions = (0..DIRECTIONS).map(|k| std::f64::consts::TAU * f64::from(k) / f64::from(DIRECTIONS));
    let mut planes: Vec<Plane> =
        directions.flat_map(|angle| centres.iter().map(move |c| plane(c, [angle.cos(), angle.sin()]))).collect();
    let reach = centres.iter().map(|c| c[0].abs().max(c[1].abs())).fold(0.0, f64::max);
    let rounding = 64.0 * f64::EPSILON * reach;
    let mut best: Option<(f64, [f64; 4])> = None;
    for _ in 0..MOST_ROUNDS {
        let box_mm = 4.0 * reach + f64::MIN_POSITIVE;
        let sides = Sides { above: true, below: false };
        let solved = solve(&planes, sides, [-box_mm; 4], [box_mm; 4]).ok_or(CylinderError::Undetermined)?;
        let off = |centre: &Point, s: &[f64; 4]| {
            let up = share(centre);
            [centre[0] - up * s[0] - (1.0 - up) * s[2], centre[1] - up * s[1] - (1.0 - up) * s[3]]
        };
        let mut radius = 0.0_f64;
        for centre in centres {
            let [x, y] = off(centre, &solved.step);
            let distance = x.hypot(y);
            radius = radius.max(distance);
            if distance > solved.least {
                planes.push(plane(centre, [x / distance, y / distance]));
            }
        }
        if best.is_none_or(|(least, _)| radius < least) {
            best = Some((radius, solved.step));
        }
        let Some((radius, step)) = best else { break };
        let gap = radius - solved.least;
        if gap <= rounding + MEET * radius {
            return Ok(Median {
                diameter_mm: 2.0 * radius,
                gap_mm: 2.0 * (gap.max(0.0) + rounding),
                ends_mm: [[step[0], step[1]], [step[2], step[3]]],
                off_mm: centres.iter().map(|c| off(c, &step)).map(|[x, y]| x.hypot(y)).collect(),
            });
        }
    }
    Err(CylinderError::NotConverged { iterations: MOST_ROUNDS, left_mm: reach })
}
