//! The forced motion while both joints stay closed: exact.
//!
//! Any motion of the tooth period leaves every chip as it is, so the stable forced motion is the periodic solution of
//! the plain linear system under the smooth-feed force (`fixture/5.2`). With joints that harden it is found by Newton's
//! method on the same elements.

use crate::calculator::{Failure, Unwatched};
use crate::num::dde::{Matrix, Propagator, Rule, times};

use super::cutting::{Cutting, Stretch};
use super::floquet::{Working, damped};
use super::holding::{Closed, Holding, System};
use super::march::{Marched, Plan, Surface, march};
use super::simulate::count;

/// Points of an element; with elements of a fiftieth of the fastest oscillation their error is round-off.
const POINTS: usize = 4;
/// Elements per tooth period at least: what the curves are drawn with.
const LEAST_ELEMENTS: f64 = 240.0;
/// Elements per period of the fastest oscillation.
const PER_OSCILLATION: f64 = 48.0;
/// Relative change at which Newton's method ends, and its steps.
const SETTLED: f64 = 1e-10;
const NEWTON_STEPS: u32 = 40;

/// Largest and smallest value of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    pub low: f64,
    pub high: f64,
}

impl Range {
    const NONE: Self = Self { low: f64::INFINITY, high: f64::NEG_INFINITY };

    pub(super) fn span(&self) -> f64 {
        self.high - self.low
    }

    fn take(&mut self, value: f64) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }

    /// The cubic through two values and slopes.
    pub(super) fn take_cubic(&mut self, step: f64, values: (f64, f64), slopes: (f64, f64)) {
        self.take(values.0);
        self.take(values.1);
        if slopes.0 * slopes.1 < 0.0 {
            let (d0, d1) = (slopes.0 * step, slopes.1 * step);
            let rise = values.1 - values.0;
            // Slope of the cubic: d0 + 2 b s + 3 c s^2.
            let (b, c) = (3.0 * rise - 2.0 * d0 - d1, d0 + d1 - 2.0 * rise);
            let root = (b * b - 3.0 * c * d0).max(0.0).sqrt();
            let q = -(b + root.copysign(b));
            for s in [q / (3.0 * c), d0 / q] {
                if s > 0.0 && s < 1.0 {
                    self.take(values.0 + s * (d0 + s * (b + s * c)));
                }
            }
        }
    }
}

/// A moment of the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moment {
    pub time_s: f64,
    /// Angle of the tooth that entered last, since its entry.
    pub since_entry_rad: f64,
    pub x_mm: f64,
    pub velocity_mm_per_s: f64,
    pub force_n: f64,
}

/// The forced periodic motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Response {
    pub moments: Vec<Moment>,
    pub x_mm: Range,
    /// What the joints ask of the clamp force, with and without their damping.
    pub left_n: Range,
    pub right_n: Range,
    pub left_elastic_n: Range,
    pub right_elastic_n: Range,
    /// x where a tooth enters and where one leaves.
    pub x_at_entry_mm: f64,
    pub x_at_exit_mm: f64,
    pub period_s: f64,
}

impl Response {
    /// x at a time, by cubic interpolation between the moments.
    pub(super) fn x_at(&self, time_s: f64) -> f64 {
        let time = time_s.rem_euclid(self.period_s);
        let after = self.moments.partition_point(|m| m.time_s <= time).clamp(1, self.moments.len() - 1);
        let (p, q) = (&self.moments[after - 1], &self.moments[after]);
        let step = q.time_s - p.time_s;
        if step <= 0.0 {
            return p.x_mm;
        }
        let s = (time - p.time_s) / step;
        let (d0, d1, rise) = (p.velocity_mm_per_s * step, q.velocity_mm_per_s * step, q.x_mm - p.x_mm);
        p.x_mm + s * (d0 + s * ((3.0 * rise - 2.0 * d0 - d1) + s * (d0 + d1 - 2.0 * rise)))
    }
}

struct Piece<const N: usize> {
    propagator: usize,
    stretch: Stretch,
    from_rad: f64,
    /// Force at the points, and at the two ends, N.
    force_n: [f64; POINTS],
    ends_n: (f64, f64),
}

/// The elements of a whole period of the force.
struct Elements<'a, const N: usize> {
    system: &'a System<N>,
    holding: &'a Holding,
    propagators: Vec<Propagator<N, POINTS>>,
    /// A and length of every propagator.
    matrices: Vec<(Matrix<N>, f64)>,
    pieces: Vec<Piece<N>>,
    seconds_per_rad: f64,
}

/// x at the points of every element of the last sweep: what Newton's method linearises about.
type Known = Vec<[f64; POINTS]>;

pub(super) fn response<const N: usize>(
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
) -> Result<Response, Failure> {
    if cutting.uneven()
        && let Some(settled) = settled::<N>(holding, cutting, working)?
    {
        return Ok(settled);
    }
    let system = holding.system::<N>(Closed::BOTH);
    let elements = Elements::new(&system, holding, cutting, working);
    let hardening = holding.hardening_n_per_mm3(Closed::BOTH);
    let mut known: Known = vec![[0.0; POINTS]; elements.pieces.len()];
    let mut start = elements.periodic(&known, hardening)?;
    if hardening > 0.0 {
        let mut change = f64::INFINITY;
        for _ in 0..NEWTON_STEPS {
            let next = elements.points(&start, &known, hardening);
            let size = next.iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
            change = next.iter().flatten().zip(known.iter().flatten()).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
            known = next;
            start = elements.periodic(&known, hardening)?;
            if change <= SETTLED * size {
                break;
            }
        }
        if !change.is_finite() || change > 1e-6 {
            let what = "forced motion with hardening joints";
            return Err(Failure::NotConverged { what, residual: change, iterations: NEWTON_STEPS });
        }
    }
    Ok(elements.record(&start, &known, hardening))
}

/// Steps per tooth pitch, first and most tooth periods of a run that is to settle, and how well. A run that has not come to rest
/// says by its decay how long the next must be.
const SETTLING_STEPS: f64 = 400.0;
const FIRST_PERIODS: usize = 160;
const MOST_PERIODS: usize = 5120;
const AT_REST: f64 = 1e-6;

/// The forced motion of uneven teeth: its period is a revolution, in which x(t) and x(t - tau) differ, so the chips do
/// answer to it. It is the run in time that has settled; `None` where it does not (chatter), for which the motion
/// with undisturbed chips stands.
fn settled<const N: usize>(
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
) -> Result<Option<Response>, Failure> {
    let highest = holding.modes().last().map_or(0.0, |mode| mode.natural_hz);
    let steps = count((80.0 * highest * cutting.tooth_period_s(working.spindle_rpm)).clamp(SETTLING_STEPS, 8000.0));
    let mut periods = FIRST_PERIODS;
    let mut decayed = true;
    while periods <= MOST_PERIODS {
        let whole = periods.div_ceil(cutting.teeth).max(3) * cutting.teeth;
        let plan = Plan {
            working,
            steps_per_tooth: steps,
            tooth_periods: whole,
            steady_periods: cutting.teeth,
            surface: Surface::Multiple,
            gradual: false,
            unilateral: false,
            keep_first: 0,
            keep_last: cutting.teeth,
        };
        let run = march::<N>(holding, cutting, &plan, &Unwatched)?;
        if run.diverged {
            return Ok(None);
        }
        // From one revolution to the next, after so many.
        let change = |revolutions: usize| {
            let (last, before) = ((revolutions - 1) * cutting.teeth, (revolutions - 2) * cutting.teeth);
            (0..cutting.teeth)
                .map(|i| (run.samples_mm[last + i] - run.samples_mm[before + i]).abs())
                .fold(0.0, f64::max)
        };
        let revolutions = whole / cutting.teeth;
        let (half, now, rest) = ((revolutions / 2).max(2), change(revolutions), AT_REST * working.feed_mm);
        if now <= rest {
            return Ok(Some(of_run(cutting, working, &run)));
        }
        let decay = (change(half) / now).ln() / (revolutions - half).max(1) as f64;
        if decay > SLOWEST_DECAY {
            decayed = true;
            // A tenth more: two modes may beat.
            periods = whole + count(1.1 * (now / rest).ln() / decay + 2.0) * cutting.teeth;
        } else if decayed {
            // A hard entry may hide it once.
            decayed = false;
            periods *= 4;
        } else {
            break;
        }
    }
    Ok(None)
}

/// Decay per revolution below which a run settles in no reasonable time: a factor of e in a thousand revolutions.
const SLOWEST_DECAY: f64 = 1e-3;

/// The last revolution of a settled run.
fn of_run(cutting: &Cutting, working: Working, run: &Marched) -> Response {
    let tau = cutting.tooth_period_s(working.spindle_rpm);
    let start = run.last.first().map_or(0.0, |step| step.time_s);
    let rad_per_s = cutting.pitch_rad() / tau;
    let mut moments: Vec<Moment> = run
        .last
        .iter()
        .map(|step| Moment {
            time_s: step.time_s - start,
            since_entry_rad: ((step.time_s - start) % tau) * rad_per_s,
            x_mm: step.x_mm,
            velocity_mm_per_s: step.velocity_mm_per_s,
            force_n: step.force_n,
        })
        .collect();
    let period_s = tau * cutting.teeth as f64;
    moments.extend(moments.first().map(|first| Moment { time_s: period_s, ..*first }));
    let first = moments.first().map_or(0.0, |moment| moment.x_mm);
    let mut response = Response {
        moments,
        x_mm: run.x_mm,
        left_n: run.left_n,
        right_n: run.right_n,
        left_elastic_n: run.left_elastic_n,
        right_elastic_n: run.right_elastic_n,
        x_at_entry_mm: first,
        x_at_exit_mm: first,
        period_s,
    };
    if let [before, _] = cutting.stretches()[..] {
        response.x_at_exit_mm = response.x_at(before.length_rad() / rad_per_s);
    }
    response
}

impl<'a, const N: usize> Elements<'a, N> {
    fn new(system: &'a System<N>, holding: &'a Holding, cutting: &Cutting, working: Working) -> Self {
        let rule = Rule::<POINTS>::new();
        let tau = cutting.tooth_period_s(working.spindle_rpm);
        let seconds_per_rad = tau / cutting.pitch_rad();
        let per_period = LEAST_ELEMENTS.max(PER_OSCILLATION * system.radius_rad_per_s * tau / std::f64::consts::TAU);
        let level = cutting.direction * cutting.level(working.depth_mm);
        let stretches = cutting.stretches();
        let (mut propagators, mut matrices, mut pieces) = (Vec::new(), Vec::new(), Vec::new());
        let counts: Vec<(f64, usize)> = stretches
            .iter()
            .map(|stretch| {
                let a = damped(system, cutting, &working, stretch.teeth);
                let count = (per_period * stretch.length_rad() / cutting.pitch_rad()).ceil().max(4.0);
                let length = stretch.length_rad() / count;
                propagators.push(Propagator::new(&rule, &a, &system.b, length * seconds_per_rad));
                matrices.push((a, length));
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole, from 4 to some thousands
                let count = count as usize;
                (length, count)
            })
            .collect();
        for phase in 0..cutting.phases() {
            for (kind, (stretch, &(length, count))) in stretches.iter().zip(&counts).enumerate() {
                let force = |since: f64| level * cutting.smooth_force(stretch, since, phase, working.feed_mm);
                let mut end = force(stretch.from_rad);
                for i in 0..count {
                    let from_rad = stretch.from_rad + i as f64 * length;
                    let start = end;
                    end = force(from_rad + length);
                    pieces.push(Piece {
                        propagator: kind,
                        stretch: *stretch,
                        from_rad,
                        force_n: std::array::from_fn(|j| force(from_rad + rule.points[j] * length)),
                        ends_n: (start, end),
                    });
                }
            }
        }
        Self { system, holding, propagators, matrices, pieces, seconds_per_rad }
    }

    /// Points and end of an element from its start; `known` is linearised about, with the cubic stiffness `hardening`.
    fn step(
        &self,
        index: usize,
        q: &[f64; N],
        force_share: f64,
        known: &[f64; POINTS],
        hardening: f64,
    ) -> ([f64; POINTS], [f64; N]) {
        let piece = &self.pieces[index];
        let propagator = &self.propagators[piece.propagator];
        let mut x: [f64; POINTS] = std::array::from_fn(|i| {
            let mut sum = 0.0;
            #[allow(clippy::needless_range_loop)] // indices as in the formula
            for k in 0..N {
                sum += propagator.at_points[i][k] * q[k];
            }
            #[allow(clippy::needless_range_loop)] // indices as in the formula
            for j in 0..POINTS {
                let fixed = force_share * (piece.force_n[j] + 2.0 * hardening * known[j].powi(3));
                sum += propagator.points_by_force[i][j] * fixed;
            }
            sum
        });
        if hardening > 0.0 {
            // (1 + K s) x = what stands there: the elements are so short that a few fixed-point steps are exact.
            let right = x;
            for _ in 0..12 {
                x = std::array::from_fn(|i| {
                    let mut sum = right[i];
                    for j in 0..POINTS {
                        sum -= propagator.points_by_force[i][j] * 3.0 * hardening * known[j] * known[j] * x[j];
                    }
                    sum
                });
            }
        }
        let mut end = times(&propagator.whole, q);
        for j in 0..POINTS {
            let own = 3.0 * hardening * known[j] * known[j] * x[j];
            let force = force_share * (piece.force_n[j] + 2.0 * hardening * known[j].powi(3)) - own;
            #[allow(clippy::needless_range_loop)] // indices as in the formula
            for k in 0..N {
                end[k] += propagator.end_by_force[j][k] * force;
            }
        }
        (x, end)
    }

    fn sweep(&self, start: &[f64; N], force_share: f64, known: &Known, hardening: f64) -> [f64; N] {
        let mut q = *start;
        #[allow(clippy::needless_range_loop)] // indices as in the formula
        for index in 0..self.pieces.len() {
            q = self.step(index, &q, force_share, &known[index], hardening).1;
        }
        q
    }

    /// The state that comes back after a period.
    fn periodic(&self, known: &Known, hardening: f64) -> Result<[f64; N], Failure> {
        let forced = self.sweep(&[0.0; N], 1.0, known, hardening);
        let mut matrix = nalgebra::DMatrix::<f64>::identity(N, N);
        for column in 0..N {
            let mut unit = [0.0; N];
            unit[column] = 1.0;
            let end = self.sweep(&unit, 0.0, known, hardening);
            for row in 0..N {
                matrix[(row, column)] -= end[row];
            }
        }
        let right = nalgebra::DVector::from_column_slice(&forced);
        let solution = matrix.lu().solve(&right).filter(|s| s.iter().all(|value| value.is_finite()));
        let solution = solution.ok_or_else(|| {
            Failure::OutOfModel(crate::calculator::Finding::new("undamped_resonance", "/cut/spindle_speed_rpm"))
        })?;
        Ok(std::array::from_fn(|i| solution[i]))
    }

    fn points(&self, start: &[f64; N], known: &Known, hardening: f64) -> Known {
        let mut q = *start;
        (0..self.pieces.len())
            .map(|index| {
                let (x, end) = self.step(index, &q, 1.0, &known[index], hardening);
                q = end;
                x
            })
            .collect()
    }

    fn moment(&self, time_s: f64, since_entry_rad: f64, q: &[f64; N], force_n: f64) -> Moment {
        Moment { time_s, since_entry_rad, x_mm: q[0], velocity_mm_per_s: self.system.velocity(q, 0), force_n }
    }

    fn record(&self, start: &[f64; N], known: &Known, hardening: f64) -> Response {
        let mut moments = Vec::with_capacity(self.pieces.len() + 1);
        let (mut x, mut demand) = (Range::NONE, [Range::NONE; 4]);
        let (mut q, mut time) = (*start, 0.0);
        let mut at_exit = start[0];
        let mut before: Option<usize> = None;
        for (index, piece) in self.pieces.iter().enumerate() {
            moments.push(self.moment(time, piece.from_rad, &q, piece.ends_n.0));
            if before.is_some_and(|teeth| teeth > piece.stretch.teeth) {
                at_exit = q[0];
            }
            before = Some(piece.stretch.teeth);
            let (_, end) = self.step(index, &q, 1.0, &known[index], hardening);
            let (a, length) = &self.matrices[piece.propagator];
            let step = length * self.seconds_per_rad;
            let rate = |q: &[f64; N], force: f64| -> [f64; N] {
                let mut rate = times(a, q);
                let spring = hardening * q[0].powi(3);
                #[allow(clippy::needless_range_loop)] // indices as in the formula
                for k in 0..N {
                    rate[k] += self.system.b[k] * (force - spring);
                }
                rate
            };
            let (r0, r1) = (rate(&q, piece.ends_n.0), rate(&end, piece.ends_n.1));
            x.take_cubic(step, (q[0], end[0]), (r0[0], r1[0]));
            for (which, range) in demand.iter_mut().enumerate() {
                let (f0, f1) = (self.demand(which, &q), self.demand(which, &end));
                // The slope of a demand is the same functional of the rate (its cubic part by the chain rule).
                let (s0, s1) = (self.demand_slope(which, &q, &r0), self.demand_slope(which, &end, &r1));
                range.take_cubic(step, (f0, f1), (s0, s1));
            }
            q = end;
            time += step;
            if index + 1 == self.pieces.len() {
                moments.push(self.moment(time, piece.from_rad + length, &q, piece.ends_n.1));
            }
        }
        // A slot whose last tooth leaves where the next one enters has its exit at the period's end.
        let stretches = self.pieces.iter().map(|p| p.stretch.teeth).collect::<std::collections::BTreeSet<_>>();
        if stretches.len() < 2 {
            at_exit = start[0];
        }
        Response {
            moments,
            x_mm: x,
            left_n: demand[0],
            right_n: demand[1],
            left_elastic_n: demand[2],
            right_elastic_n: demand[3],
            x_at_entry_mm: start[0],
            x_at_exit_mm: at_exit,
            period_s: time,
        }
    }

    /// Demands on the clamp force: left, right, and both without damping.
    fn demand(&self, which: usize, q: &[f64; N]) -> f64 {
        demands(self.system, self.holding, q)[which]
    }

    fn demand_slope(&self, which: usize, q: &[f64; N], rate: &[f64; N]) -> f64 {
        let step = 1e-6;
        let at = |s: f64| {
            let moved: [f64; N] = std::array::from_fn(|k| q[k] + s * rate[k]);
            self.demand(which, &moved)
        };
        // Linear but for the cubic of a hardening joint, for which a small central step is enough.
        let scale = step / (1.0 + rate.iter().fold(0.0, |m: f64, r| m.max(r.abs())));
        (at(scale) - at(-scale)) / (2.0 * scale)
    }
}

/// What the joints ask of the clamp force, N: left and right with damping, left and right without (`fixture/5.6`).
#[inline]
pub(super) fn demands<const N: usize>(system: &System<N>, holding: &Holding, q: &[f64; N]) -> [f64; 4] {
    let (x, v) = (q[0], system.velocity(q, 0));
    let (jaw_x, jaw_v) = system.jaw.map_or((0.0, 0.0), |jaw| (q[jaw], system.velocity(q, jaw / 2)));
    let hard = 1.0 + holding.hardening_per_mm2 * x * x;
    let left_hard = if system.jaw.is_some() { 1.0 } else { hard };
    let left = -holding.left.stiffness_n_per_mm * (x - jaw_x) * left_hard;
    let right = holding.right.stiffness_n_per_mm * x * hard;
    [left - holding.left.damping_n_s_per_mm * (v - jaw_v), right + holding.right.damping_n_s_per_mm * v, left, right]
}
