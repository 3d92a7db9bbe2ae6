//! The forced motion while both joints stay closed: exact.
//!
//! Any motion of the tooth period leaves every chip as it is, so the stable forced motion is the periodic solution of
//! the plain linear system under the smooth-feed force (`fixture/5.2`). Where the force answers to the motion, it is first
//! found with it (`answering`), and the curves are those of the linear system under it.

use nalgebra::{DMatrix, DVector};

use crate::calculator::{Failure, Finding, Monitor, Pace};
use crate::num::dde::{Matrix, Propagator, Rule, norm, times};

use crate::fixture_stability::model::answering::{AnsweringMotion, Effort, NoMotion, answering_motion};
use crate::fixture_stability::model::cutting::{Cutting, Stretch};
use crate::fixture_stability::model::floquet::{MULTIPLICATIONS_PER_CHIP, Working, damped};
use crate::fixture_stability::model::holding::{Closed, Holding, System, eigenvalues};
use crate::fixture_stability::model::settled::settled;
use crate::fixture_stability::model::slow::is_slow;

/// Points of an element; with elements of a fiftieth of the fastest oscillation their error is round-off.
const POINTS: usize = 4;
/// Elements per tooth period at least: what the curves are drawn with.
const LEAST_ELEMENTS: f64 = 240.0;
/// Elements per period of the fastest oscillation.
const PER_OSCILLATION: f64 = 48.0;
/// Factors of e by which what an entry or exit sets off has fallen before a slow cut goes on as its force does, to 1e-8.
const SETTLED: f64 = 18.5;
/// norm(A) h up to which an element is followed exactly.
const FOLLOWED: f64 = 8.0;
/// Change of the place at which the slope of a polynomial is taken, elements.
const BESIDE: f64 = 1e-4;

/// Largest and smallest value of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Range {
    pub low: f64,
    pub high: f64,
}

impl Range {
    const NONE: Self = Self { low: f64::INFINITY, high: f64::NEG_INFINITY };

    pub(in crate::fixture_stability) fn span(&self) -> f64 {
        self.high - self.low
    }

    fn take(&mut self, value: f64) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }

    /// The cubic through two values and slopes.
    pub(in crate::fixture_stability) fn take_cubic(&mut self, step: f64, values: (f64, f64), slopes: (f64, f64)) {
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
pub(in crate::fixture_stability) struct Moment {
    pub time_s: f64,
    /// Angle of the tooth that entered last, since its entry.
    pub since_entry_rad: f64,
    pub x_mm: f64,
    pub velocity_mm_per_s: f64,
    pub force_n: f64,
    /// What the motion takes from the normal forces of both joints together, N.
    pub unloading_n: f64,
}

/// The forced periodic motion.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::fixture_stability) struct Response {
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
    pub(in crate::fixture_stability) fn x_at(&self, time_s: f64) -> f64 {
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

/// Forces at a moment, N.
#[derive(Debug, Clone, Copy)]
pub(in crate::fixture_stability) struct Forces {
    /// Of all teeth in cut.
    pub chips_n: f64,
    /// With what joints that harden take away: what drives the linear vise.
    pub acting_n: f64,
}

struct Piece<const N: usize> {
    propagator: usize,
    stretch: Stretch,
    from_rad: f64,
    /// What acts at the points, N, and all forces at both ends.
    acting_n: [f64; POINTS],
    ends: (Forces, Forces),
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
    monitor: &'a dyn Monitor,
}

pub(in crate::fixture_stability) fn response<const N: usize>(
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    monitor: &dyn Monitor,
) -> Result<Response, Failure> {
    let system = holding.system::<N>(Closed::BOTH);
    let level = cutting.direction * cutting.level(working.depth_mm);
    let smooth = |stretch: &Stretch, since: f64, phase: usize| {
        let chips_n = level * cutting.smooth_force(stretch, since, phase, working.feed_mm);
        Forces { chips_n, acting_n: chips_n }
    };
    let under_smooth = || Elements::new(&system, holding, cutting, working, smooth, monitor)?.response();
    if is_slow(holding, cutting, working.spindle_rpm) {
        return under_smooth();
    }
    let why = match answering::<N>(&system, holding, cutting, working, Effort::Asked, monitor)? {
        Ok(motion) => {
            let response = if cutting.uneven() || holding.hardening_per_mm2 > 0.0 {
                let forces = |stretch: &Stretch, since: f64, phase: usize| motion.forces_n(stretch, since, phase);
                Elements::new(&system, holding, cutting, working, forces, monitor)?.response()?
            } else {
                under_smooth()?
            };
            return Ok(Response { x_mm: motion.range_mm(), ..response });
        }
        Err(why) => why,
    };
    if cutting.uneven()
        && let Some(settled) = settled::<N>(holding, cutting, working, monitor)?
    {
        return Ok(settled);
    }
    match why {
        NoMotion::Unsettled { residual_mm, steps } if holding.hardening_per_mm2 > 0.0 => {
            let what = "forced motion with hardening joints";
            Err(Failure::NotConverged { what, residual: residual_mm, iterations: steps })
        }
        NoMotion::Unsettled { .. } | NoMotion::CutLost => under_smooth(),
    }
}

/// The forced motion of a cut that no tooth loses; `None` where none is found.
pub(in crate::fixture_stability) fn unbroken<const N: usize>(
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    monitor: &dyn Monitor,
) -> Result<Option<Response>, Failure> {
    if is_slow(holding, cutting, working.spindle_rpm) {
        return unless_cancelled(response::<N>(holding, cutting, working, monitor));
    }
    let system = holding.system::<N>(Closed::BOTH);
    let found = answering::<N>(&system, holding, cutting, working, Effort::Looked, monitor);
    let Some(motion) = unless_cancelled(found)?.and_then(Result::ok) else { return Ok(None) };
    let forces = |stretch: &Stretch, since: f64, phase: usize| motion.forces_n(stretch, since, phase);
    let response = Elements::new(&system, holding, cutting, working, forces, monitor)?.response();
    Ok(unless_cancelled(response)?.map(|response| Response { x_mm: motion.range_mm(), ..response }))
}

/// What is not found is none, but for want of anybody who waits for it.
fn unless_cancelled<T>(found: Result<T, Failure>) -> Result<Option<T>, Failure> {
    match found {
        Err(Failure::Cancelled) => Err(Failure::Cancelled),
        found => Ok(found.ok()),
    }
}

/// Largest less smallest x of the forced motion, mm: that of [`response`], without its curves.
pub(in crate::fixture_stability) fn span_mm<const N: usize>(
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    monitor: &dyn Monitor,
) -> Result<f64, Failure> {
    if is_slow(holding, cutting, working.spindle_rpm) {
        return Ok(response::<N>(holding, cutting, working, monitor)?.x_mm.span());
    }
    match answering::<N>(&holding.system(Closed::BOTH), holding, cutting, working, Effort::Asked, monitor)? {
        Ok(motion) => Ok(motion.range_mm().span()),
        Err(_) => Ok(response::<N>(holding, cutting, working, monitor)?.x_mm.span()),
    }
}

fn answering<'a, const N: usize>(
    system: &System<N>,
    holding: &Holding,
    cutting: &'a Cutting,
    working: Working,
    effort: Effort,
    monitor: &'a dyn Monitor,
) -> Result<Result<AnsweringMotion<'a, N>, NoMotion>, Failure> {
    answering_motion(system, cutting, working, holding.hardening_n_per_mm3(Closed::BOTH), effort, monitor)
}

/// The teeth excite a mode without damping exactly.
fn undamped() -> Failure {
    Failure::OutOfModel(Finding::new("undamped_resonance", "/cut/spindle_speed_rpm"))
}

/// The slowest decay of a free vibration, 1/s.
fn slowest_decay<const N: usize>(a: &Matrix<N>) -> f64 {
    eigenvalues(a).into_iter().map(|(re, _)| -re).fold(f64::INFINITY, f64::min).max(0.0)
}

/// A propagator that forgets how an element began: q = -A^-1 b F - A^-2 b F', what follows a force that hardly changes during an
/// oscillation (`fixture/5.9`). `None` where nothing ties the masses.
fn following<const N: usize>(
    rule: &Rule<POINTS>,
    a: &Matrix<N>,
    b: &[f64; N],
    h: f64,
) -> Option<Propagator<N, POINTS>> {
    let factors = DMatrix::from_fn(N, N, |i, j| a[i][j]).lu();
    let by_force = factors.solve(&DVector::from_column_slice(b))?;
    let by_slope = factors.solve(&by_force)?;
    let (at, beyond, before) = (rule.weights_at(1.0), rule.weights_at(1.0 + BESIDE), rule.weights_at(1.0 - BESIDE));
    let end_by_force = std::array::from_fn(|point| {
        let slope = (beyond[point] - before[point]) / (2.0 * BESIDE * h);
        std::array::from_fn(|k| -by_force[k] * at[point] - by_slope[k] * slope)
    });
    let none = [[0.0; N]; N];
    Some(Propagator {
        whole: none,
        at_points: [[0.0; N]; POINTS],
        points_by_force: [[0.0; POINTS]; POINTS],
        end_by_force,
    })
}

impl<'a, const N: usize> Elements<'a, N> {
    fn new(
        system: &'a System<N>,
        holding: &'a Holding,
        cutting: &Cutting,
        working: Working,
        forces: impl Fn(&Stretch, f64, usize) -> Forces,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, Failure> {
        let mut pace = Pace::new(monitor);
        let rule = Rule::<POINTS>::new();
        let tau = cutting.tooth_period_s(working.spindle_rpm);
        let seconds_per_rad = tau / cutting.pitch_rad();
        let per_period = LEAST_ELEMENTS.max(PER_OSCILLATION * system.radius_rad_per_s * tau / std::f64::consts::TAU);
        let stretches = cutting.stretches();
        let is_slow = is_slow(holding, cutting, working.spindle_rpm);
        let (mut propagators, mut matrices, mut pieces) = (Vec::new(), Vec::new(), Vec::new());
        // Of every stretch: where elements of one length begin, their propagator, and how many there are.
        let mut runs: Vec<Vec<(f64, usize, usize)>> = Vec::new();
        for stretch in &stretches {
            let a = damped(system, cutting, &working, stretch.teeth);
            let whole = stretch.length_rad();
            let transient = if is_slow { (SETTLED / slowest_decay(&a) / seconds_per_rad).min(whole) } else { whole };
            let mut of_stretch = Vec::new();
            // What damps so fast that no element follows it leaves no vibration behind either.
            let is_followed = cutting.pitch_rad() / per_period * seconds_per_rad * norm(&a) <= FOLLOWED;
            let followed = if is_slow && !is_followed { 0.0 } else { transient };
            for (from, to, is_exact) in [(0.0, followed, true), (followed, whole, false)] {
                if to - from <= 1e-12 * whole {
                    continue;
                }
                let per = if is_exact { per_period } else { LEAST_ELEMENTS };
                let elements = (per * (to - from) / cutting.pitch_rad()).ceil().max(4.0);
                let length = (to - from) / elements;
                let propagator = if is_exact {
                    Propagator::new(&rule, &a, &system.b, length * seconds_per_rad)
                } else {
                    following(&rule, &a, &system.b, length * seconds_per_rad).ok_or_else(undamped)?
                };
                propagators.push(propagator);
                matrices.push((a, length));
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole, from 4 to some thousands
                let count = elements as usize;
                of_stretch.push((stretch.from_rad + from, propagators.len() - 1, count));
            }
            runs.push(of_stretch);
        }
        for phase in 0..cutting.phases() {
            for (stretch, of_stretch) in stretches.iter().zip(&runs) {
                let force = |since: f64| forces(stretch, since, phase);
                let mut end = force(stretch.from_rad);
                for &(begins_rad, kind, count) in of_stretch {
                    let length = matrices[kind].1;
                    for i in 0..count {
                        pace.work(MULTIPLICATIONS_PER_CHIP * (POINTS + 1) * (1 + stretch.teeth))?;
                        let from_rad = begins_rad + i as f64 * length;
                        let start = end;
                        end = force(from_rad + length);
                        pieces.push(Piece {
                            propagator: kind,
                            stretch: *stretch,
                            from_rad,
                            acting_n: std::array::from_fn(|j| force(from_rad + rule.points[j] * length).acting_n),
                            ends: (start, end),
                        });
                    }
                }
            }
        }
        Ok(Self { system, holding, propagators, matrices, pieces, seconds_per_rad, monitor })
    }

    /// The motion that comes back after a period.
    fn response(&self) -> Result<Response, Failure> {
        let forced = self.sweep(&[0.0; N], 1.0)?;
        let mut matrix = DMatrix::<f64>::identity(N, N);
        for column in 0..N {
            let mut unit = [0.0; N];
            unit[column] = 1.0;
            let end = self.sweep(&unit, 0.0)?;
            for row in 0..N {
                matrix[(row, column)] -= end[row];
            }
        }
        let right = DVector::from_column_slice(&forced);
        let solution = matrix.lu().solve(&right).filter(|s| s.iter().all(|value| value.is_finite()));
        let start = solution.ok_or_else(undamped)?;
        self.record(&std::array::from_fn(|i| start[i]))
    }

    /// State at the end of an element from that at its start. `driven` is 1, or 0 for what the start alone does.
    fn step(&self, piece: &Piece<N>, q: &[f64; N], driven: f64) -> [f64; N] {
        let propagator = &self.propagators[piece.propagator];
        let mut end = times(&propagator.whole, q);
        for (force, by_force) in piece.acting_n.iter().zip(&propagator.end_by_force) {
            for k in 0..N {
                end[k] += by_force[k] * driven * force;
            }
        }
        end
    }

    fn sweep(&self, start: &[f64; N], driven: f64) -> Result<[f64; N], Failure> {
        let mut pace = Pace::new(self.monitor);
        self.pieces.iter().try_fold(*start, |q, piece| {
            pace.work(N * (N + POINTS))?;
            Ok(self.step(piece, &q, driven))
        })
    }

    fn moment(&self, time_s: f64, since_entry_rad: f64, q: &[f64; N], force_n: f64) -> Moment {
        let [left_n, right_n, ..] = demands(self.system, self.holding, q);
        Moment {
            time_s,
            since_entry_rad,
            x_mm: q[0],
            velocity_mm_per_s: self.system.velocity(q, 0),
            force_n,
            unloading_n: left_n + right_n,
        }
    }

    fn record(&self, start: &[f64; N]) -> Result<Response, Failure> {
        let mut pace = Pace::new(self.monitor);
        let mut moments = Vec::with_capacity(self.pieces.len() + 1);
        let (mut x, mut demand) = (Range::NONE, [Range::NONE; 4]);
        let (mut q, mut time) = (*start, 0.0);
        let mut at_exit = start[0];
        let mut before: Option<usize> = None;
        for (index, piece) in self.pieces.iter().enumerate() {
            pace.work(100 * N)?;
            moments.push(self.moment(time, piece.from_rad, &q, piece.ends.0.chips_n));
            if before.is_some_and(|teeth| teeth > piece.stretch.teeth) {
                at_exit = q[0];
            }
            before = Some(piece.stretch.teeth);
            let end = self.step(piece, &q, 1.0);
            let (a, length) = &self.matrices[piece.propagator];
            let step = length * self.seconds_per_rad;
            let rate = |q: &[f64; N], force: f64| -> [f64; N] {
                let mut rate = times(a, q);
                #[allow(clippy::needless_range_loop)] // indices as in the formula
                for k in 0..N {
                    rate[k] += self.system.b[k] * force;
                }
                rate
            };
            let (r0, r1) = (rate(&q, piece.ends.0.acting_n), rate(&end, piece.ends.1.acting_n));
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
                moments.push(self.moment(time, piece.from_rad + length, &q, piece.ends.1.chips_n));
            }
        }
        // A slot whose last tooth leaves where the next one enters has its exit at the period's end.
        let stretches = self.pieces.iter().map(|p| p.stretch.teeth).collect::<std::collections::BTreeSet<_>>();
        if stretches.len() < 2 {
            at_exit = start[0];
        }
        Ok(Response {
            moments,
            x_mm: x,
            left_n: demand[0],
            right_n: demand[1],
            left_elastic_n: demand[2],
            right_elastic_n: demand[3],
            x_at_entry_mm: start[0],
            x_at_exit_mm: at_exit,
            period_s: time,
        })
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
pub(in crate::fixture_stability) fn demands<const N: usize>(
    system: &System<N>,
    holding: &Holding,
    q: &[f64; N],
) -> [f64; 4] {
    let (x, v) = (q[0], system.velocity(q, 0));
    let (jaw_x, jaw_v) = system.jaw.map_or((0.0, 0.0), |jaw| (q[jaw], system.velocity(q, jaw / 2)));
    let hard = 1.0 + holding.hardening_per_mm2 * x * x;
    let left_hard = if system.jaw.is_some() { 1.0 } else { hard };
    let left = -holding.left.stiffness_n_per_mm * (x - jaw_x) * left_hard;
    let right = holding.right.stiffness_n_per_mm * x * hard;
    [left - holding.left.damping_n_s_per_mm * (v - jaw_v), right + holding.right.damping_n_s_per_mm * v, left, right]
}
