//! The source paper's own algorithm, for comparison (`ring/9.1`): a ring of sampled points, located by the points nearest to
//! the supports, cut by moving the point nearest to the tip onto the tip.
//!
//! Two nearest samples do not locate a body: each is off the support by up to half the spacing along the surface, and as
//! the normals of the supports are nearly at right angles, what is tangential at one is normal at the other. The error
//! of location is of first order in the spacing, and what comes out depends on the number of samples, not on the geometry.

use std::f64::consts::TAU;

use super::plane::{Vec2, add, norm, scaled, sub};
use super::{Revolution, Setting};

/// Rounds of the location at most; the indices settle after a few.
const MOST_ROUNDS: u32 = 100;
/// A shift below this ends the location, mm.
const SETTLED_MM: f64 = 1e-7;
/// The points are torn apart when a radius is beyond so many times the largest at the start.
const TORN: f64 = 2.0;

/// What came out.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sampled {
    /// Final points in the body frame, mm.
    pub points_mm: Vec<Vec2>,
    /// Steps taken.
    pub steps: u64,
    /// The points flew apart before the end.
    pub torn: bool,
}

/// Turns the points `points_mm` (body frame) by the paper's algorithm, one angular step per sample; `after` hears of every
/// revolution, `work` of the multiplications on the way; both may end the run. Only the geometry of point supports and a tip is known to it.
pub(crate) fn turn_sampled<E>(
    points_mm: &[Vec2],
    setting: &Setting,
    after: &mut dyn FnMut(&Revolution) -> Result<(), E>,
    work: &mut dyn FnMut(usize) -> Result<(), E>,
) -> Result<Sampled, E> {
    let n = points_mm.len();
    let mut points = points_mm.to_vec();
    let largest = points.iter().map(|p| norm(*p)).fold(0.0, f64::max);
    let mut shift = [0.0; 2];
    let mut turned = Sampled { points_mm: Vec::new(), steps: 0, torn: false };
    let step_rad = TAU / n as f64;
    while !turned.torn {
        for _ in 0..n {
            let phi = turned.steps as f64 * step_rad;
            if phi > TAU * (setting.revolutions + setting.spark_out_revolutions) {
                turned.points_mm = points;
                return Ok(turned);
            }
            // In the frame of the body: its points stay, the machine turns the other way.
            let (sin, cos) = phi.sin_cos();
            let into_body = |p: Vec2| [cos * p[0] + sin * p[1], -sin * p[0] + cos * p[1]];
            work(2 * n)?;
            for _ in 0..MOST_ROUNDS {
                work(4 * n)?;
                let (a, b) = (into_body(sub(setting.support_a_mm, shift)), into_body(sub(setting.support_b_mm, shift)));
                let (at_a, at_b) = (points[nearest(&points, a)], points[nearest(&points, b)]);
                // The printed formula gives the increment of the shift, not its value.
                let mean = scaled(add(sub(a, at_a), sub(b, at_b)), 0.5);
                shift = add(shift, [cos * mean[0] - sin * mean[1], sin * mean[0] + cos * mean[1]]);
                if norm(mean) < SETTLED_MM {
                    break;
                }
            }
            let fed = setting.feed_mm_per_rev * phi.min(TAU * setting.revolutions) / TAU;
            let tip = add(setting.tip_start_mm, scaled(setting.feed_direction, fed));
            let tip = into_body(sub(tip, shift));
            let cut = nearest(&points, tip);
            points[cut] = tip;
            turned.steps += 1;
            if norm(tip) > TORN * largest || !norm(tip).is_finite() {
                turned.torn = true;
                break;
            }
        }
        after(&Revolution {
            turned_revolutions: turned.steps as f64 / n as f64,
            deepest_cut_mm: 0.0,
            cutting_share: 1.0,
        })?;
    }
    turned.points_mm = points;
    Ok(turned)
}

fn nearest(points: &[Vec2], to: Vec2) -> usize {
    let mut best = (0, f64::INFINITY);
    for (i, p) in points.iter().enumerate() {
        let d = [p[0] - to[0], p[1] - to[1]];
        let square = d[0] * d[0] + d[1] * d[1];
        if square < best.1 {
            best = (i, square);
        }
    }
    best.0
}
