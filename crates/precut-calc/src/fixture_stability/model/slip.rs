//! Whether friction at the jaws holds the workpiece against what pushes it along them (`certainty/6.1`).
//!
//! The jaws press along the feed. Across the feed and upward the cut is held by friction alone:
//! sqrt(P_y^2 (1 + (h/r_e)^2) + P_z^2) <= mu (N_1 + N_2) at every instant, with the normal forces of the moment,
//! N_1 + N_2 = 2 F less what the motion takes from both joints. (h/r_e)^2 is the couple of a force at the height h over the
//! middle of the jaws, by the ellipsoid that bounds force and couple of a face that is pressed evenly.

use crate::clamping::{against_slip_n, friction_needed};

use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::{FrictionRange, JawGrip};
use crate::fixture_stability::model::cutting::{Cutting, Stretch};
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::response::{Moment, Response};

/// Jaws that press with the clamp force each: N_1 + N_2 is so many times it.
const JAWS: f64 = 2.0;
/// Angles that differ by less than this, rad, are one.
const SAME_ANGLE_RAD: f64 = 1e-9;

/// How the jaws hold what pushes along them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Grip {
    pub friction: FrictionRange,
    /// 1 + (h/r_e)^2.
    pub couple: f64,
}

impl Grip {
    /// Of a checked job: a height of the force comes with a face.
    pub(in crate::fixture_stability) fn new(grip: &JawGrip) -> Self {
        let face = grip.jaw_length_mm.zip(grip.jaw_height_mm);
        let lever = face.map_or(0.0, |(length, height)| grip.force_height_mm / mean_distance_mm(length, height));
        Self { friction: grip.friction.range(), couple: 1.0 + lever * lever }
    }
}

/// Mean distance of the points of a rectangle from its middle, mm: r_e. In polar coordinates, one triangle after the other.
fn mean_distance_mm(length_mm: f64, height_mm: f64) -> f64 {
    let (p, q) = (0.5 * length_mm, 0.5 * height_mm);
    let corner = f64::hypot(p, q);
    corner / 3.0 + (p * p / q * (q / p).asinh() + q * q / p * (p / q).asinh()) / 6.0
}

/// A force on the workpiece over a period, N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Load {
    pub mean_n: f64,
    /// The largest, either way across the feed, upward along the axis.
    pub peak_n: f64,
}

/// What friction has to hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Along {
    pub across: Load,
    pub upward: Load,
}

/// The loads with smooth chips, which every stable cut leaves.
pub(in crate::fixture_stability) fn along(case: &Case, working: Working) -> Along {
    let cutting = &case.cutting;
    let level = cutting.level(working.depth_mm);
    let teeth: f64 = (0..cutting.teeth).map(|j| cutting.chip_power(cutting.chip_mm(working.feed_mm, j))).sum();
    let per_tooth = level * teeth / cutting.teeth as f64;
    let mean = |shape: &dyn Fn(f64) -> f64| per_tooth * cutting.mean_of(shape);
    let peak = |shape: &dyn Fn(f64) -> f64| {
        let (high, low) = cutting.extremes_of(working.feed_mm, shape);
        (level * high, level * low)
    };
    let (high, low) = peak(&|angle| cutting.across(angle));
    let (most, least) = peak(&|angle| cutting.tangential(angle));
    let axial = cutting.axial_ratio;
    Along {
        across: Load { mean_n: mean(&|angle| cutting.across(angle)).abs(), peak_n: high.abs().max(low.abs()) },
        upward: Load {
            mean_n: (axial * mean(&|angle| cutting.tangential(angle))).max(0.0),
            peak_n: (axial * most).max(axial * least).max(0.0),
        },
    }
}

/// Least clamp force, N, that holds steady loads by a friction: the mean ones, without vibration.
pub(in crate::fixture_stability) fn steady_n(loads: &Along, grip: &Grip, friction: f64) -> f64 {
    against_slip_n(pushed_n(grip, loads.across.mean_n, loads.upward.mean_n), friction, JAWS, 0.0)
}

fn pushed_n(grip: &Grip, across_n: f64, upward_n: f64) -> f64 {
    (across_n * across_n * grip.couple + upward_n * upward_n).sqrt()
}

/// A moment of a load on friction.
#[derive(Debug, Clone, Copy)]
struct Instant {
    pushed_n: f64,
    /// What the motion takes from the normal forces of both joints.
    unloading_n: f64,
}

/// Everything that friction sees over a period of the forced motion: smooth runs, one-sided limits at entries and exits
/// included.
pub(in crate::fixture_stability) struct Pushing {
    runs: Vec<Vec<Instant>>,
}

impl Pushing {
    pub(in crate::fixture_stability) fn new(case: &Case, working: Working, motion: &Response, grip: &Grip) -> Self {
        let cutting = &case.cutting;
        let tau_s = cutting.tooth_period_s(working.spindle_rpm);
        let level = cutting.level(working.depth_mm);
        let stretches = cutting.stretches();
        let (mut runs, mut current): (Vec<Vec<Instant>>, Vec<Instant>) = (Vec::new(), Vec::new());
        let mut in_stretch = None;
        for pair in motion.moments.windows(2) {
            let (from, to) = (&pair[0], &pair[1]);
            let Some(which) = stretches.iter().position(|s| from.since_entry_rad < s.to_rad - SAME_ANGLE_RAD) else {
                continue;
            };
            let stretch = &stretches[which];
            let phase = phase_of(cutting, from, tau_s);
            let turned_rad = (to.time_s - from.time_s) / tau_s * cutting.pitch_rad();
            let at = |moment: &Moment, since_rad: f64| {
                let moved_mm = if cutting.uneven() {
                    cutting.direction * (moment.x_mm - motion.x_at(moment.time_s - tau_s))
                } else {
                    0.0
                };
                let (across_n, tangential_n) = pushes(cutting, stretch, since_rad, phase, working.feed_mm, moved_mm);
                let upward_n = (level * cutting.axial_ratio * tangential_n).max(0.0);
                Instant { pushed_n: pushed_n(grip, level * across_n, upward_n), unloading_n: moment.unloading_n }
            };
            if in_stretch != Some((which, phase)) {
                in_stretch = Some((which, phase));
                runs.push(std::mem::take(&mut current));
                current.push(at(from, from.since_entry_rad));
            }
            current.push(at(to, from.since_entry_rad + turned_rad));
        }
        runs.push(current);
        Self { runs }
    }

    /// The largest value of a functional, refined by a parabola within every smooth run.
    fn largest(&self, value: impl Fn(&Instant) -> f64) -> f64 {
        let mut largest = f64::NEG_INFINITY;
        for run in &self.runs {
            let values: Vec<f64> = run.iter().map(&value).collect();
            largest = values.iter().copied().fold(largest, f64::max);
            for three in values.windows(3) {
                let (before, here, after) = (three[0], three[1], three[2]);
                let (slope, curvature) = (0.5 * (after - before), before - 2.0 * here + after);
                if here >= before && here >= after && curvature < 0.0 {
                    largest = largest.max(here - 0.5 * slope * slope / curvature);
                }
            }
        }
        largest
    }

    /// Least clamp force, N, that holds at every instant with a friction.
    pub(in crate::fixture_stability) fn least_n(&self, friction: f64) -> f64 {
        self.largest(|at| against_slip_n(at.pushed_n, friction, JAWS, -at.unloading_n)).max(0.0)
    }

    /// Least friction with which a clamp force holds at every instant; `None` where a moment leaves no normal force.
    pub(in crate::fixture_stability) fn friction_needed(&self, clamp_force_n: f64) -> Option<f64> {
        let needed = self
            .largest(|at| friction_needed(at.pushed_n, JAWS * clamp_force_n - at.unloading_n).unwrap_or(f64::INFINITY));
        needed.is_finite().then_some(needed)
    }
}

/// Which tooth period of the force a moment lies in.
fn phase_of(cutting: &Cutting, moment: &Moment, tau_s: f64) -> usize {
    let since_s = moment.since_entry_rad / cutting.pitch_rad() * tau_s;
    let whole = ((moment.time_s - since_s) / tau_s).round();
    (0..cutting.phases()).find(|&phase| (phase as f64 - whole).abs() < 0.5).unwrap_or(0)
}

/// Sums over the teeth in cut of force over level: across the feed, and tangential. `moved_mm` the work went along with the feed.
fn pushes(
    cutting: &Cutting,
    stretch: &Stretch,
    since_rad: f64,
    phase: usize,
    feed_mm: f64,
    moved_mm: f64,
) -> (f64, f64) {
    (0..stretch.teeth).fold((0.0, 0.0), |(across, tangential), j| {
        let angle = cutting.angle_rad(since_rad, j);
        let chip = cutting.chip_power(cutting.chip_mm(feed_mm, cutting.tooth_number(phase, j)) - moved_mm);
        (across + chip * cutting.across(angle), tangential + chip * cutting.tangential(angle))
    })
}

#[cfg(test)]
mod tests {
    use super::mean_distance_mm;

    #[test]
    fn the_mean_distance_is_that_of_a_sum_over_the_face() {
        for (length, height) in [(100.0, 40.0), (30.0, 30.0), (10.0, 200.0)] {
            let n = 400;
            let place = |i: usize, whole: f64| ((i as f64 + 0.5) / f64::from(n) - 0.5) * whole;
            let mut sum = 0.0;
            for i in 0..400 {
                for j in 0..400 {
                    sum += f64::hypot(place(i, length), place(j, height));
                }
            }
            let mean = sum / f64::from(n * n);
            // The midpoint rule is off by some (1/400)^2.
            assert!((mean_distance_mm(length, height) / mean - 1.0).abs() < 1e-5, "{length} x {height}");
        }
        // A square of side 2: (sqrt 2 + asinh 1) / 3.
        let square = (2.0_f64.sqrt() + 1.0_f64.asinh()) / 3.0;
        assert!((mean_distance_mm(2.0, 2.0) - square).abs() < 1e-14);
    }
}
