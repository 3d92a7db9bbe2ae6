//! Stability of the forced motion: the largest Floquet multiplier over a tooth period.
//!
//! Linearised about the periodic motion, q' = A q - b W(t) (x - x(t - tau)) with the cutting stiffness W
//! (`fixture/5.1`). The tooth period is cut at every entry and exit into elements of at most 0.6 period of the
//! fastest oscillation; where sin^(1-k) has a root in the arc (a tooth that enters or leaves tangentially) the
//! elements shrink toward it. All integrals depend on the speed alone and serve all depths.

use std::f64::consts::TAU;

use crate::calculator::{Failure, Monitor, Pace, checkpoint};
use crate::num::dde::{Matrix, PeriodMap, Propagator, Rule, exponential, largest_paced};

use crate::fixture_stability::model::cutting::{Cutting, Stretch};
use crate::fixture_stability::model::holding::System;
use crate::fixture_stability::model::slow::Slowly;

/// Longest element times the largest eigenvalue of A.
const LONGEST: f64 = 3.5;
/// Longest element as an angle of the cutter, rad: the coefficient turns with it.
const LONGEST_RAD: f64 = 0.8;
/// Ratio of neighbouring elements toward a root of sin^(1-k), and how many there are at most.
const GRADING: f64 = 0.15;
const GRADES: u32 = 4;

/// What a chip of one tooth at one place is worth: a sine and a power.
pub(in crate::fixture_stability) const MULTIPLICATIONS_PER_CHIP: usize = 40;

/// The largest multiplier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Multiplier {
    /// Of the map over `phases` tooth periods.
    pub re: f64,
    pub im: f64,
    /// Over one tooth period.
    pub modulus: f64,
    /// Tooth periods in the map.
    pub phases: usize,
    /// Residual of the eigenvalue over its modulus.
    pub residual: f64,
    /// Of a slow cut.
    pub slow: Option<Slowly>,
}

/// Stiffness over time that the forced motion itself brings (hardening joints), N/mm: at a time in s since a period of the force began.
pub(in crate::fixture_stability) type Stiffening<'a> = &'a dyn Fn(f64) -> f64;

/// What one spindle speed shares among all depths.
pub(in crate::fixture_stability) struct SpeedPlan<const N: usize, const P: usize> {
    kinds: Vec<Propagator<N, P>>,
    spans: Vec<Span<N, P>>,
    phases: usize,
}

enum Span<const N: usize, const P: usize> {
    Free(Matrix<N>),
    Element {
        kind: usize,
        /// Slope of the force over the level at the points, one row per phase.
        slope: Vec<[f64; P]>,
        /// Stiffening at the points, one row per phase, where there is one.
        stiffening: Vec<[f64; P]>,
    },
}

/// What a plan is made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Working {
    pub spindle_rpm: f64,
    pub feed_mm: f64,
    /// Enters the plan only where the process damps.
    pub depth_mm: f64,
}

impl<const N: usize, const P: usize> SpeedPlan<N, P> {
    pub(in crate::fixture_stability) fn new(
        rule: &Rule<P>,
        system: &System<N>,
        cutting: &Cutting,
        working: Working,
        stiffening: Option<Stiffening<'_>>,
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
        let mut pace = Pace::new(monitor);
        let tau = cutting.tooth_period_s(working.spindle_rpm);
        let seconds_per_rad = tau / cutting.pitch_rad();
        let phases = cutting.phases();
        let mut plan = Self { kinds: Vec::new(), spans: Vec::new(), phases };
        let mut lengths: Vec<(f64, usize)> = Vec::new();
        for stretch in cutting.stretches() {
            let a = damped(system, cutting, &working, stretch.teeth);
            if stretch.teeth == 0 && stiffening.is_none() {
                plan.spans.push(Span::Free(exponential(&a, stretch.length_rad() * seconds_per_rad)));
                continue;
            }
            let mut from = stretch.from_rad;
            for length in elements(cutting, &stretch, seconds_per_rad, system.radius_rad_per_s) {
                pace.work(MULTIPLICATIONS_PER_CHIP * phases * P * stretch.teeth)?;
                let known = lengths
                    .iter()
                    .position(|(l, teeth)| (l - length).abs() <= 1e-12 * length && *teeth == stretch.teeth);
                let kind = known.unwrap_or_else(|| {
                    lengths.push((length, stretch.teeth));
                    plan.kinds.push(Propagator::new(rule, &a, &system.b, length * seconds_per_rad));
                    plan.kinds.len() - 1
                });
                let at = |i: usize| from + rule.points[i] * length;
                let slope = (0..phases)
                    .map(|phase| std::array::from_fn(|i| cutting.chip_slope(&stretch, at(i), phase, working.feed_mm)))
                    .collect();
                let stiffening = stiffening.map_or_else(Vec::new, |stiffness| {
                    (0..phases)
                        .map(|phase| std::array::from_fn(|i| stiffness(at(i) * seconds_per_rad + phase as f64 * tau)))
                        .collect()
                });
                plan.spans.push(Span::Element { kind, slope, stiffening });
                from += length;
            }
        }
        Ok(plan)
    }

    /// The period map at the level Cp H^(1-mu); `None` when its equations are singular.
    fn map(&self, level: f64, monitor: &dyn Monitor) -> Result<Option<PeriodMap<N, P>>, Failure> {
        let mut pace = Pace::new(monitor);
        let mut map = PeriodMap::new();
        for phase in 0..self.phases {
            let mut history = 0;
            for span in &self.spans {
                match span {
                    Span::Free(whole) => map.free(*whole),
                    Span::Element { kind, slope, stiffening } => {
                        let own = stiffening.get(phase).copied().unwrap_or([0.0; P]);
                        let present = std::array::from_fn(|i| level * slope[phase][i] + own[i]);
                        let delayed = std::array::from_fn(|i| -level * slope[phase][i]);
                        pace.work(2 * P * P * (P + N))?;
                        if map.element(&self.kinds[*kind], &present, &delayed, history).is_none() {
                            return Ok(None);
                        }
                        history += 1;
                    }
                }
            }
        }
        Ok(Some(map))
    }

    /// The largest multiplier at the level, to `tolerance` in its residual.
    pub(in crate::fixture_stability) fn multiplier(
        &self,
        level: f64,
        tolerance: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Multiplier>, Failure> {
        self.largest(level, tolerance, monitor, |_| {})
    }

    /// The same of masses that no spring ties to the ground, without their shift as one body. That shift leaves every chip
    /// as it is, so its multiplier is 1 in any cut and says nothing of this one.
    pub(in crate::fixture_stability) fn multiplier_but_of_shift(
        &self,
        level: f64,
        tolerance: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Multiplier>, Failure> {
        // After every period everything is shifted back to x = 0: of the multipliers that one becomes 0, the others stay.
        self.largest(level, tolerance, monitor, |vector| {
            let shift = vector[0];
            for (i, value) in vector.iter_mut().enumerate() {
                let is_velocity = i < N && i % 2 == 1;
                if !is_velocity {
                    *value -= shift;
                }
            }
        })
    }

    /// The largest multiplier of the period map with something done after it.
    fn largest(
        &self,
        level: f64,
        tolerance: f64,
        monitor: &dyn Monitor,
        after: impl Fn(&mut [f64]),
    ) -> Result<Option<Multiplier>, Failure> {
        checkpoint(monitor)?;
        let Some(map) = self.map(level, monitor)? else { return Ok(None) };
        let apply = |vector: &mut [f64]| {
            map.apply(vector);
            after(vector);
            checkpoint(monitor)
        };
        let mut pace = Pace::new(monitor);
        let found = largest_paced(map.dimension(), 8, tolerance, apply, |done| pace.work(done))?;
        let modulus = if self.phases == 1 { found.modulus() } else { found.modulus().powf(1.0 / self.phases as f64) };
        Ok(modulus.is_finite().then_some(Multiplier {
            re: found.re,
            im: found.im,
            modulus,
            phases: self.phases,
            residual: found.residual,
            slow: None,
        }))
    }
}

/// A with the process damping of so many teeth in cut.
pub(in crate::fixture_stability) fn damped<const N: usize>(
    system: &System<N>,
    cutting: &Cutting,
    working: &Working,
    teeth: usize,
) -> Matrix<N> {
    let mut a = system.a;
    a[1][1] -= system.b[1] * system.scale[1] * process_damping(cutting, working) * teeth as f64;
    a
}

/// K_pd H/V of one tooth, N s/mm (`diagnosis/6.27`).
pub(in crate::fixture_stability) fn process_damping(cutting: &Cutting, working: &Working) -> f64 {
    let speed_mm_per_s = TAU * cutting.radius_mm * working.spindle_rpm / 60.0;
    cutting.process_damping_n_per_mm * working.depth_mm / speed_mm_per_s
}

/// Lengths of the elements of a stretch, rad, in order.
pub(in crate::fixture_stability) fn elements(
    cutting: &Cutting,
    stretch: &Stretch,
    seconds_per_rad: f64,
    radius_rad_per_s: f64,
) -> Vec<f64> {
    let length = stretch.length_rad();
    let longest = (LONGEST / (radius_rad_per_s * seconds_per_rad)).min(LONGEST_RAD);
    let count = (length / longest).ceil().max(1.0);
    let even = length / count;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole, from 1 to some thousands
    let count = count as u32;
    let mut lengths: Vec<f64> = (0..count).map(|_| even).collect();
    if cutting.chip_exponent > 0.0 && stretch.teeth > 0 {
        let (start, end) = cutting.distance_from_root_rad(stretch);
        let graded = |distance: f64| -> Vec<f64> {
            let mut pieces = Vec::new();
            let mut left = even;
            for _ in 0..GRADES {
                if distance > left {
                    break;
                }
                pieces.push(left * (1.0 - GRADING));
                left *= GRADING;
            }
            pieces.push(left);
            pieces
        };
        let tail = graded(end);
        let mut head = graded(start);
        head.reverse();
        if count == 1 && head.len() > 1 && tail.len() > 1 {
            // One element with a root at either end: half of it for each.
            let half = |pieces: &[f64]| pieces.iter().map(|p| 0.5 * p).collect::<Vec<_>>();
            return [half(&head), half(&tail)].concat();
        }
        if tail.len() > 1 {
            lengths.pop();
            lengths.extend(tail);
        }
        if head.len() > 1 {
            lengths.splice(0..1, head);
        }
    }
    lengths
}
