//! Elements of a period in time: no coefficient breaks inside one, and none is longer than half an oscillation.

use super::cutter::Milling;
use super::edge::Edges;
use super::rotation::Rotation;

/// Longest element times the fastest angular frequency.
const LONGEST: f64 = 3.5;
/// Longest element as an angle of the cutter, rad: the coefficient turns with it.
const LONGEST_RAD: f64 = 0.8;
/// Rotations closer than this are one.
const SAME_RAD: f64 = 1e-10;

/// Ends of the elements in time, rising, from 0 to the period.
pub(super) fn times_s(milling: &Milling, edges: &Edges<'_>, rotation: &Rotation, fastest_rad_per_s: f64) -> Vec<f64> {
    let period = milling.period_rad();
    let own = edges.rotations();
    let mut breaks = own.clone();
    // What a break left in the motion comes back behind every delay; behind a whole period it meets itself.
    for delay in edges.delays_rad().into_iter().filter(|delay| rotation.varies() || (delay - period).abs() > SAME_RAD) {
        breaks.extend(own.iter().map(|at| (at + delay).rem_euclid(period)));
    }
    breaks.sort_by(f64::total_cmp);
    let whole = rotation.rotation_rad(rotation.period_s(period));
    let mut rotations = vec![0.0];
    let mut start = 0.0;
    while start < whole - SAME_RAD {
        rotations.extend(breaks.iter().map(|at| start + at));
        start += period;
        rotations.push(start);
    }
    rotations.sort_by(f64::total_cmp);
    rotations.dedup_by(|a, b| (*a - *b).abs() < SAME_RAD);
    if let Some(last) = rotations.last_mut() {
        *last = whole;
    }
    let mut times = vec![0.0];
    for pair in rotations.windows(2) {
        let (from, to) = (rotation.time_s(pair[0]), rotation.time_s(pair[1]));
        let count = (fastest_rad_per_s * (to - from) / LONGEST).max((pair[1] - pair[0]) / LONGEST_RAD).ceil().max(1.0);
        let mut k = 1.0;
        while k < count {
            times.push(from + (to - from) * k / count);
            k += 1.0;
        }
        times.push(to);
    }
    times
}
