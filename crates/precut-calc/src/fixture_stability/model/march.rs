//! The cut in time: teeth that lose the cut, older surfaces, joints that open.
//!
//! The step divides both parts of the tooth period (with and without the last tooth), so teeth enter and leave on
//! steps. Between steps the linear system is propagated exactly, with the force linear over the step; where a joint
//! opens or closes inside a step, the moment is solved for and the step is continued with the other system. Second
//! order in the step; the surface is stored where teeth stand at the steps (`fixture/3.2`).

mod linear;

use std::f64::consts::PI;

use crate::calculator::{Failure, Monitor, Pace, checkpoint};
use crate::num::dde::{Matrix, exponential, times};

use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::{Working, process_damping};
use crate::fixture_stability::model::holding::{Closed, Holding, System};
use crate::fixture_stability::model::response::{Range, demands};
use linear::Stretch;

/// A displacement beyond this, mm, ends a run: the force law has left everything real.
const DIVERGED_MM: f64 = 10.0;
/// Events in one step at most: a joint does not open and close oftener in a hundredth of an oscillation.
const EVENTS_PER_STEP: u32 = 16;
/// What a step is worth without a tooth, and what a tooth adds to it, in multiplications.
const MULTIPLICATIONS_PER_STEP: usize = 60;
/// Steps that are gone through without a look, by all teeth together.
const STEPS_AT_ONCE: usize = 400_000;

/// How older surfaces are remembered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::fixture_stability) enum Surface {
    /// What a tooth leaves uncut meets the next one.
    Multiple,
    /// Every tooth overwrites the surface with its own path.
    Single,
}

/// A run.
#[derive(Debug, Clone, Copy)]
pub(in crate::fixture_stability) struct Plan {
    pub working: Working,
    pub steps_per_tooth: usize,
    pub tooth_periods: usize,
    /// Tooth periods at the end over which steady values are taken.
    pub steady_periods: usize,
    pub surface: Surface,
    /// The engaged arc grows over the first revolution.
    pub gradual: bool,
    /// Joints can open at the clamp force; otherwise they are bonded.
    pub unilateral: bool,
    /// Tooth periods whose every step is kept: at the start, and at the end.
    pub keep_first: usize,
    pub keep_last: usize,
}

/// A kept step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Step {
    pub time_s: f64,
    pub x_mm: f64,
    pub velocity_mm_per_s: f64,
    pub jaw_mm: Option<f64>,
    pub force_n: f64,
    /// Effective feed of the tooth that entered last; none where no tooth is in the arc.
    pub feed_mm: Option<f64>,
    pub left_demand_n: f64,
    pub right_demand_n: f64,
}

/// Share of time in which a joint is open.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::fixture_stability) struct Open {
    pub left: f64,
    pub right: f64,
    pub both: f64,
}

/// What a run gave.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::fixture_stability) struct Marched {
    pub diverged: bool,
    /// Largest displacement either way from the start on.
    pub farthest_mm: f64,
    /// Over the steady periods.
    pub x_mm: Range,
    pub force_n: Range,
    pub feed_mm: Range,
    pub left_n: Range,
    pub right_n: Range,
    pub left_elastic_n: Range,
    pub right_elastic_n: Range,
    /// From the start on.
    pub left_entry_n: f64,
    pub right_entry_n: f64,
    /// Share of tooth-steps in the arc without a chip, over the steady periods.
    pub lost_cut: f64,
    pub open: Open,
    /// When a joint first opened, and which.
    pub first_open_left_s: Option<f64>,
    pub first_open_right_s: Option<f64>,
    pub first_lost_s: Option<f64>,
    /// x once per tooth.
    pub samples_mm: Vec<f64>,
    pub first: Vec<Step>,
    pub last: Vec<Step>,
    /// Angle, rad, and effective feed, mm, of the last pass over every place of the arc.
    pub arc: Vec<(f64, f64)>,
    pub steps: usize,
}

impl<const N: usize> System<N> {
    /// A state as it is kept.
    fn step(&self, q: &[f64; N], time_s: f64, force_n: f64, feed_mm: Option<f64>, demand: [f64; 4]) -> Step {
        Step {
            time_s,
            x_mm: q[0],
            velocity_mm_per_s: self.velocity(q, 0),
            jaw_mm: self.jaw.map(|jaw| q[jaw]),
            force_n,
            feed_mm,
            left_demand_n: demand[0],
            right_demand_n: demand[1],
        }
    }
}

/// Propagation over one step: q -> phi q + shift + start F0 + end F1.
#[derive(Clone)]
struct Flow<const N: usize> {
    a: Matrix<N>,
    constant: [f64; N],
    phi: Matrix<N>,
    shift: [f64; N],
    start: [f64; N],
    end: [f64; N],
}

impl<const N: usize> Flow<N> {
    fn new(system: &System<N>, constant: [f64; N], h: f64) -> Self {
        // Integrals of exp(A (h-s)) times 1 and s/h by their series, on a step short enough for it.
        let mut parts: u32 = 1;
        while crate::num::dde::norm(&system.a) * h / f64::from(parts) > 2.0 && parts < 1 << 20 {
            parts *= 2;
        }
        let sub = h / f64::from(parts);
        let phi_sub = exponential(&system.a, sub);
        let integrals = |v: &[f64; N]| -> ([f64; N], [f64; N]) {
            let (mut one, mut ramp) = ([0.0; N], [0.0; N]);
            let mut term: [f64; N] = std::array::from_fn(|i| v[i] * sub);
            let mut factorial = 1.0;
            for m in 0..40_u32 {
                factorial *= f64::from(m + 1);
                for i in 0..N {
                    one[i] += term[i] / factorial;
                    ramp[i] += term[i] / (factorial * f64::from(m + 2));
                }
                term = times(&system.a, &term);
                for value in &mut term {
                    *value *= sub;
                }
            }
            (one, ramp)
        };
        let (one, ramp) = integrals(&system.b);
        let (shift_sub, _) = integrals(&constant);
        let (mut start, mut end, mut shift) = ([0.0; N], [0.0; N], [0.0; N]);
        for part in 0..parts {
            let (from, width) = (f64::from(part) / f64::from(parts), 1.0 / f64::from(parts));
            let (start_before, end_before, shift_before) =
                (times(&phi_sub, &start), times(&phi_sub, &end), times(&phi_sub, &shift));
            for i in 0..N {
                // F = F0 (1-u) + F1 u with u = from + width s/sub.
                end[i] = end_before[i] + from * one[i] + width * ramp[i];
                start[i] = start_before[i] + (1.0 - from) * one[i] - width * ramp[i];
                shift[i] = shift_before[i] + shift_sub[i];
            }
        }
        Self { a: system.a, constant, phi: exponential(&system.a, h), shift, start, end }
    }

    /// What a step is without the force at its end, which is added by [`Self::ended`].
    #[inline]
    fn begun(&self, q: &[f64; N], from_n: f64) -> [f64; N] {
        let moved = times(&self.phi, q);
        std::array::from_fn(|i| moved[i] + self.shift[i] + self.start[i] * from_n)
    }

    #[inline]
    fn ended(&self, begun: &[f64; N], to_n: f64) -> [f64; N] {
        std::array::from_fn(|i| begun[i] + self.end[i] * to_n)
    }

    /// The same over a part t of the step, the force rising with `slope`: the Taylor series to round-off.
    fn part(&self, b: &[f64; N], q: &[f64; N], from_n: f64, slope_n_per_s: f64, t: f64) -> [f64; N] {
        let mut sum = *q;
        let mut term = *q;
        for m in 1..60_u32 {
            let mut next = times(&self.a, &term);
            for i in 0..N {
                next[i] *= t / f64::from(m);
                match m {
                    1 => next[i] += (self.constant[i] + b[i] * from_n) * t,
                    2 => next[i] += b[i] * slope_n_per_s * 0.5 * t * t,
                    _ => {}
                }
            }
            let size = next.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            for i in 0..N {
                sum[i] += next[i];
            }
            term = next;
            if m > 2 && size <= 1e-17 * sum.iter().fold(0.0, |m: f64, v| m.max(v.abs())) {
                break;
            }
        }
        sum
    }
}

/// The grid of the tooth period: steps with and without the tooth that leaves last.
struct Grid {
    steps: usize,
    /// Step at which the last tooth leaves.
    leave: usize,
    teeth_before: usize,
    teeth_after: usize,
    /// s, before and after.
    step_s: [f64; 2],
    cells: usize,
}

impl Grid {
    fn of(cutting: &Cutting, working: &Working, steps: usize) -> Self {
        let stretches = cutting.stretches();
        let seconds = cutting.tooth_period_s(working.spindle_rpm) / cutting.pitch_rad();
        let first = stretches[0];
        let Some(second) = stretches.get(1) else {
            let step = first.length_rad() * seconds / steps as f64;
            return Self {
                steps,
                leave: steps,
                teeth_before: first.teeth,
                teeth_after: first.teeth,
                step_s: [step; 2],
                cells: first.teeth * steps + 1,
            };
        };
        let share = first.length_rad() / cutting.pitch_rad();
        let wanted = (share * steps as f64).round();
        let leave = (1..steps).take_while(|&n| n as f64 <= wanted).last().unwrap_or(1);
        let step = |stretch: f64, count: usize| stretch * seconds / count as f64;
        Self {
            steps,
            leave,
            teeth_before: first.teeth,
            teeth_after: second.teeth,
            step_s: [step(first.length_rad(), leave), step(second.length_rad(), steps - leave)],
            cells: second.teeth * steps + leave + 1,
        }
    }

    /// Angle of a cell since the entry, rad.
    fn angle_rad(&self, cutting: &Cutting, cell: usize) -> f64 {
        let (row, i) = (cell / self.steps, cell % self.steps);
        let stretches = cutting.stretches();
        let first = stretches[0].length_rad();
        let within = if i <= self.leave {
            first * i as f64 / self.leave as f64
        } else {
            first + (cutting.pitch_rad() - first) * (i - self.leave) as f64 / (self.steps - self.leave) as f64
        };
        row as f64 * cutting.pitch_rad() + within
    }
}

/// A place of the arc at which teeth stand at a step.
#[derive(Clone, Copy)]
struct Cell {
    /// Share of a tooth in the force over its chip's power.
    share: f64,
    /// Along the feed, as the last tooth left it (its own passing being 0).
    surface: f64,
    /// Effective feed of the last pass.
    chip: f64,
}

/// Everything that moves.
struct State<'a, const N: usize> {
    cutting: &'a Cutting,
    holding: &'a Holding,
    system: System<N>,
    plan: &'a Plan,
    grid: Grid,
    cells: Vec<Cell>,
    /// Force of the teeth in cut, by their place.
    of_tooth: Vec<f64>,
    /// Flows by stretch and by what is closed.
    flows: Vec<Flow<N>>,
    level: f64,
    damping: f64,
    hardening: f64,
    /// What each step asks of the job, at hand.
    feed_mm: f64,
    direction: f64,
    clamp_force_n: f64,
    uneven: bool,
    closed: Closed,
    q: [f64; N],
    tooth_period: usize,
    reached: usize,
}

fn index(closed: Closed) -> usize {
    usize::from(closed.left) + 2 * usize::from(closed.right)
}

pub(in crate::fixture_stability) fn march<const N: usize>(
    holding: &Holding,
    cutting: &Cutting,
    plan: &Plan,
    monitor: &dyn Monitor,
) -> Result<Marched, Failure> {
    let mut state = State::<N>::new(holding, cutting, plan, monitor)?;
    let mut record = Record::new(plan);
    let mut pace = Pace::new(monitor);
    // As deep as the process of a tooth is, as many teeth are in cut.
    let per_step = MULTIPLICATIONS_PER_STEP * (1 + state.grid.teeth_before);
    let at_once = (STEPS_AT_ONCE / (1 + state.grid.teeth_before)).max(1);
    state.enter();
    for period in 0..plan.tooth_periods {
        state.tooth_period = period;
        record.samples_mm.push(state.q[0]);
        if state.is_plain() {
            let (leave, steps) = (state.grid.leave, state.grid.steps);
            for (from, to) in [(0, leave), (leave, steps)] {
                for first in (from..to).step_by(at_once) {
                    let range = first..to.min(first + at_once);
                    pace.work(per_step * range.len())?;
                    state.sweep(range, &mut record);
                }
            }
            state.enter_next();
        } else {
            for i in 0..state.grid.steps {
                pace.work(per_step)?;
                state.advance(i, &mut record);
            }
        }
        // What swings may be near the middle as the period ends: every step counts.
        let farthest_mm = record.farthest_mm().max(state.q[0].abs());
        if !state.q.iter().all(|v| v.is_finite()) || farthest_mm > DIVERGED_MM {
            record.diverged = true;
            break;
        }
    }
    Ok(record.finish(&state))
}

impl<'a, const N: usize> State<'a, N> {
    fn new(holding: &'a Holding, cutting: &'a Cutting, plan: &'a Plan, monitor: &dyn Monitor) -> Result<Self, Failure> {
        let grid = Grid::of(cutting, &plan.working, plan.steps_per_tooth);
        let system = holding.system::<N>(Closed::BOTH);
        let force = holding.clamp_force_n.unwrap_or(0.0);
        let flows = grid
            .step_s
            .iter()
            .flat_map(|&h| (0..4).map(move |which| (h, Closed { left: which % 2 == 1, right: which / 2 == 1 })))
            .map(|(h, closed)| {
                checkpoint(monitor)?;
                if !plan.unilateral && closed != Closed::BOTH {
                    // Never used: a bonded run has one system.
                    return Ok(Flow::new(&system, [0.0; N], h));
                }
                let of = holding.system::<N>(closed);
                let (left, right) = (f64::from(u8::from(closed.left)), f64::from(u8::from(closed.right)));
                let mut constant = [0.0; N];
                constant[1] = system.push[1] * force * (right - left);
                if let Some(jaw) = system.jaw {
                    constant[jaw + 1] = system.push[jaw + 1] * force * (left - 1.0);
                }
                Ok(Flow::new(&of, constant, h))
            })
            .collect::<Result<_, Failure>>()?;
        let share = |cell| cutting.shape((cutting.entry_rad + grid.angle_rad(cutting, cell)).min(PI));
        let cells = (0..grid.cells).map(|cell| Cell { share: share(cell), surface: 0.0, chip: 0.0 }).collect();
        Ok(Self {
            cutting,
            holding,
            plan,
            cells,
            of_tooth: vec![0.0; grid.teeth_before + 1],
            flows,
            level: cutting.direction * cutting.level(plan.working.depth_mm),
            damping: process_damping(cutting, &plan.working),
            hardening: holding.hardening_per_mm2,
            feed_mm: plan.working.feed_mm,
            direction: cutting.direction,
            clamp_force_n: holding.clamp_force_n.unwrap_or(0.0),
            uneven: cutting.uneven(),
            closed: Closed::BOTH,
            q: [0.0; N],
            tooth_period: 0,
            reached: grid.cells,
            grid,
            system,
        })
    }

    /// All teeth that stand in the arc at the start cut at once.
    fn enter(&mut self) {
        self.limit_arc();
        for j in 0..self.grid.teeth_before {
            self.of_tooth[j] = self.cut(j, j * self.grid.steps, 0.0);
        }
    }

    /// How far the engaged arc reaches, in cells.
    fn limit_arc(&mut self) {
        if self.plan.gradual {
            let share = (self.tooth_period + 1) as f64 / self.cutting.teeth as f64;
            let whole = self.grid.cells as f64;
            self.reached = if share >= 1.0 {
                self.grid.cells
            } else {
                (0..self.grid.cells).take_while(|&c| (c as f64) < share * whole).count()
            };
        }
    }

    /// Effective feed of tooth j at a cell when the workpiece is at x (`fixture/3.2`).
    #[inline]
    fn feed(&self, j: usize, cell: usize, x_mm: f64) -> f64 {
        let stands_out = if self.uneven && self.cutting.tooth_number(self.tooth_period, j) == 0 {
            self.cutting.runout_mm
        } else {
            0.0
        };
        let tip = stands_out - self.direction * x_mm;
        tip - (self.cells[cell].surface - self.feed_mm)
    }

    #[inline]
    fn tooth_force(&self, cell: usize, feed: f64) -> f64 {
        if feed <= 0.0 {
            return 0.0;
        }
        let power = if self.cutting.chip_exponent > 0.0 { feed.powf(1.0 - self.cutting.chip_exponent) } else { feed };
        self.level * self.cells[cell].share * power
    }

    /// Leaves the surface that tooth j makes at a cell and gives its force.
    fn cut(&mut self, j: usize, cell: usize, x_mm: f64) -> f64 {
        if cell >= self.reached {
            return 0.0;
        }
        let feed = self.feed(j, cell, x_mm);
        self.leave(cell, feed);
        self.tooth_force(cell, feed)
    }

    #[inline]
    fn leave(&mut self, cell: usize, feed: f64) {
        // Seen from the next tooth, which is one feed further on.
        let before = self.cells[cell].surface - self.feed_mm;
        self.cells[cell].surface = match self.plan.surface {
            Surface::Multiple => before + feed.max(0.0),
            Surface::Single => before + feed,
        };
        self.cells[cell].chip = feed.max(0.0);
    }

    /// Forces that depend on the motion itself: process damping of the cutting teeth, hardening of closed joints.
    #[inline]
    fn own_force(&self, cutting_teeth: f64, q: &[f64; N]) -> f64 {
        let mut force = 0.0;
        if self.damping > 0.0 {
            force -= self.damping * cutting_teeth * self.system.velocity(q, 0);
        }
        if self.hardening > 0.0 {
            force -= self.holding.hardening_n_per_mm3(self.closed) * q[0].powi(3);
        }
        force
    }

    fn cutting_teeth(&self, teeth: usize) -> f64 {
        self.of_tooth[..teeth].iter().filter(|f| f.abs() > 0.0).count() as f64
    }

    /// One step of the tooth period.
    #[inline]
    fn advance(&mut self, i: usize, record: &mut Record) {
        let after = usize::from(i >= self.grid.leave);
        let teeth = if after == 0 { self.grid.teeth_before } else { self.grid.teeth_after };
        let step_s = self.grid.step_s[after];
        let cut: f64 = self.of_tooth[..teeth].iter().sum();
        let alone = self.damping <= 0.0 && self.hardening <= 0.0;
        let from = if alone { cut } else { cut + self.own_force(self.cutting_teeth(teeth), &self.q) };
        record.take(self, i, teeth, cut, step_s);
        let before = (self.q[0], self.system.velocity(&self.q, 0));
        let which = 4 * after + index(self.closed);
        // The force at the end from the position that the force at the start gives: wrong by the fifth power of the step.
        let begun = self.flows[which].begun(&self.q, from);
        let guess = self.flows[which].ended(&begun, from);
        let mut to = 0.0;
        let mut cutting = 0.0;
        for j in 0..teeth {
            let cell = j * self.grid.steps + i + 1;
            let feed = if cell < self.reached { self.feed(j, cell, guess[0]) } else { 0.0 };
            let force = self.tooth_force(cell, feed);
            cutting += f64::from(u8::from(feed > 0.0));
            to += force;
            self.of_tooth[j] = force;
        }
        if !alone {
            to += self.own_force(cutting, &guess);
        }
        let moved = self.flows[which].ended(&begun, to);
        if self.plan.unilateral && self.carrying(&moved) != self.closed {
            self.switch(4 * after, from, to, step_s, record);
        } else {
            self.q = moved;
        }
        let x = self.q[0];
        record.between(self, before, step_s);
        for j in 0..teeth {
            let cell = j * self.grid.steps + i + 1;
            if cell < self.reached {
                let feed = self.feed(j, cell, x);
                self.leave(cell, feed);
            }
        }
        record.time_s += step_s;
        if i + 1 == self.grid.steps {
            self.enter_next();
        }
    }

    /// The teeth move up by a pitch, and a new one enters.
    fn enter_next(&mut self) {
        self.tooth_period += 1;
        self.limit_arc();
        for j in (1..self.grid.teeth_before).rev() {
            self.of_tooth[j] = self.of_tooth[j - 1];
        }
        if self.grid.teeth_before > 0 {
            self.of_tooth[0] = self.cut(0, 0, self.q[0]);
        }
    }

    /// Whether nothing acts in this tooth period but even teeth on a bonded, linear vise: the case of searches and curves,
    /// which [`Self::sweep`] runs through without asking at every step.
    fn is_plain(&self) -> bool {
        let alone = self.damping <= 0.0 && self.hardening <= 0.0;
        alone && !self.plan.unilateral && !self.uneven && self.reached == self.grid.cells
    }

    /// The steps of a stretch of a plain tooth period.
    fn sweep(&mut self, range: std::ops::Range<usize>, record: &mut Record) {
        let after = usize::from(range.start >= self.grid.leave);
        let teeth = if after == 0 { self.grid.teeth_before } else { self.grid.teeth_after };
        let (steps, step_s) = (self.grid.steps, self.grid.step_s[after]);
        let steady = self.tooth_period >= record.steady_from;
        let (linear, power) = (self.cutting.chip_exponent <= 0.0, 1.0 - self.cutting.chip_exponent);
        if linear {
            let stretch = Stretch { first: range.start, steps: range.len(), after };
            match (teeth, steady) {
                (1, false) => return self.linear::<1, false>(stretch, record),
                (1, true) => return self.linear::<1, true>(stretch, record),
                (2, false) => return self.linear::<2, false>(stretch, record),
                (2, true) => return self.linear::<2, true>(stretch, record),
                (3, false) => return self.linear::<3, false>(stretch, record),
                (3, true) => return self.linear::<3, true>(stretch, record),
                _ => {}
            }
        }
        let multiple = self.plan.surface == Surface::Multiple;
        let (kept, period) = (record.keeps(self.tooth_period), self.tooth_period);
        let (feed_mm, direction, level) = (self.feed_mm, self.direction, self.level);
        let flow = &self.flows[4 * after + index(Closed::BOTH)];
        let mut q = self.q;
        for i in range {
            let mut cut = 0.0;
            for force in &self.of_tooth[..teeth] {
                cut += force;
            }
            let demand = demands(&self.system, self.holding, &q);
            record.seen(q[0], demand, cut, steady, step_s);
            if kept {
                let chip = (teeth > 0).then(|| self.cells[i].chip);
                record.keep(period, self.system.step(&q, record.time_s, cut, chip, demand));
            }
            let before = (q[0], self.system.velocity(&q, 0));
            let begun = flow.begun(&q, cut);
            let guess = begun[0] + flow.end[0] * cut;
            let mut to = 0.0;
            for j in 0..teeth {
                let [here, next] = &self.cells[j * steps + i..][..2] else { break };
                record.tooth(here.chip, steady);
                let feed = -direction * guess - (next.surface - feed_mm);
                let force =
                    if feed <= 0.0 { 0.0 } else { level * next.share * if linear { feed } else { feed.powf(power) } };
                to += force;
                self.of_tooth[j] = force;
            }
            q = flow.ended(&begun, to);
            let velocity = self.system.velocity(&q, 0);
            if steady && before.1 * velocity < 0.0 {
                record.x_mm.take_cubic(step_s, (before.0, q[0]), (before.1, velocity));
            }
            for j in 0..teeth {
                let next = &mut self.cells[j * steps + i + 1];
                let older = next.surface - feed_mm;
                let feed = -direction * q[0] - older;
                next.chip = feed.max(0.0);
                next.surface = older + if multiple { next.chip } else { feed };
            }
            record.time_s += step_s;
        }
        self.q = q;
    }

    /// Which joints carry in a state: compressed, and not pulled apart by their damping.
    fn carrying(&self, q: &[f64; N]) -> Closed {
        let force = self.clamp_force_n;
        let [left, right, left_elastic, right_elastic] = demands(&self.system, self.holding, q);
        Closed { left: force > left.max(left_elastic), right: force > right.max(right_elastic) }
    }

    /// A step in which joints open or close: every such moment is solved for.
    fn switch(&mut self, stretch: usize, from: f64, to: f64, step_s: f64, record: &mut Record) {
        let slope = (to - from) / step_s;
        let (mut done, mut force) = (0.0, from);
        for _ in 0..EVENTS_PER_STEP {
            let flow = &self.flows[stretch + index(self.closed)];
            let left = step_s - done;
            let at = |t: f64| flow.part(&self.system.b, &self.q, force, slope, t);
            let end = at(left);
            if self.carrying(&end) == self.closed {
                self.q = end;
                return;
            }
            // The first moment at which what carries is no longer what was assumed.
            let (mut low, mut high) = (0.0, left);
            while high - low > 1e-10 * step_s {
                let middle = 0.5 * (low + high);
                if self.carrying(&at(middle)) == self.closed { low = middle } else { high = middle }
            }
            self.q = at(high);
            self.closed = self.carrying(&self.q);
            done += high;
            force += slope * high;
            record.event(self, done);
        }
        // So many events in one step are a joint that slides on its own limit: the rest of the step as it stands.
        let flow = &self.flows[stretch + index(self.closed)];
        self.q = flow.part(&self.system.b, &self.q, force, slope, step_s - done);
    }
}

/// What is kept of a run.
struct Record {
    time_s: f64,
    diverged: bool,
    steady_from: usize,
    keep_first: usize,
    keep_from: usize,
    x_mm: Range,
    /// Before the steady periods.
    x_early_mm: Range,
    force_n: Range,
    feed_mm: Range,
    demand: [Range; 4],
    entry: [f64; 2],
    tooth_steps: usize,
    lost: usize,
    open: [f64; 3],
    steady_s: f64,
    first_open: [Option<f64>; 2],
    first_lost: Option<f64>,
    samples_mm: Vec<f64>,
    first: Vec<Step>,
    last: Vec<Step>,
    steps: usize,
}

const NOTHING: Range = Range { low: f64::INFINITY, high: f64::NEG_INFINITY };

#[inline]
fn take(range: &mut Range, value: f64) {
    // Plain comparisons: the library's minimum asks each time whether a value is a number. What is none ends the run.
    if value < range.low {
        range.low = value;
    }
    if value > range.high {
        range.high = value;
    }
}

impl Record {
    fn new(plan: &Plan) -> Self {
        Self {
            time_s: 0.0,
            diverged: false,
            steady_from: plan.tooth_periods.saturating_sub(plan.steady_periods),
            keep_first: plan.keep_first,
            keep_from: plan.tooth_periods.saturating_sub(plan.keep_last),
            x_mm: NOTHING,
            x_early_mm: NOTHING,
            force_n: NOTHING,
            feed_mm: NOTHING,
            demand: [NOTHING; 4],
            entry: [f64::NEG_INFINITY; 2],
            tooth_steps: 0,
            lost: 0,
            open: [0.0; 3],
            steady_s: 0.0,
            first_open: [None; 2],
            first_lost: None,
            samples_mm: Vec::new(),
            first: Vec::new(),
            last: Vec::new(),
            steps: 0,
        }
    }

    /// Position, demands on the clamp force and force before a step.
    #[inline]
    fn seen(&mut self, x_mm: f64, demand: [f64; 4], cut_n: f64, steady: bool, step_s: f64) {
        self.steps += 1;
        for (most, value) in self.entry.iter_mut().zip(demand) {
            if value > *most {
                *most = value;
            }
        }
        if steady {
            take(&mut self.x_mm, x_mm);
            take(&mut self.force_n, cut_n);
            for (range, value) in self.demand.iter_mut().zip(demand) {
                take(range, value);
            }
            self.steady_s += step_s;
        } else {
            take(&mut self.x_early_mm, x_mm);
        }
    }

    /// The effective feed of a tooth in the arc.
    #[inline]
    fn tooth(&mut self, feed_mm: f64, steady: bool) {
        if feed_mm <= 0.0 && self.first_lost.is_none() {
            self.first_lost = Some(self.time_s);
        }
        if steady {
            take(&mut self.feed_mm, feed_mm);
            self.tooth_steps += 1;
            self.lost += usize::from(feed_mm <= 0.0);
        }
    }

    /// The state before a step.
    #[inline]
    fn take<const N: usize>(&mut self, state: &State<'_, N>, i: usize, teeth: usize, cut_n: f64, step_s: f64) {
        let demand = demands(&state.system, state.holding, &state.q);
        let steady = state.tooth_period >= self.steady_from;
        self.seen(state.q[0], demand, cut_n, steady, step_s);
        if state.plan.unilateral {
            let force = state.clamp_force_n;
            for (side, elastic) in [demand[2], demand[3]].into_iter().enumerate() {
                if elastic >= force && self.first_open[side].is_none() {
                    self.first_open[side] = Some(self.time_s);
                }
            }
            if steady {
                let (left, right) = (demand[2] >= force, demand[3] >= force);
                self.open[0] += if left { step_s } else { 0.0 };
                self.open[1] += if right { step_s } else { 0.0 };
                self.open[2] += if left && right { step_s } else { 0.0 };
            }
        }
        for j in 0..teeth {
            let cell = j * state.grid.steps + i;
            if cell < state.reached {
                self.tooth(state.cells[cell].chip, steady);
            }
        }
        if self.keeps(state.tooth_period) {
            let chip = (teeth > 0).then(|| state.cells[i].chip);
            self.keep(state.tooth_period, state.system.step(&state.q, self.time_s, cut_n, chip, demand));
        }
    }

    /// Whether every step of a tooth period is kept.
    fn keeps(&self, period: usize) -> bool {
        period < self.keep_first || period >= self.keep_from
    }

    fn keep(&mut self, period: usize, step: Step) {
        if period < self.keep_first { self.first.push(step) } else { self.last.push(step) }
    }

    /// A turn of the motion between two steps, by the cubic through them.
    #[inline]
    fn between<const N: usize>(&mut self, state: &State<'_, N>, before: (f64, f64), step_s: f64) {
        let velocity = state.system.velocity(&state.q, 0);
        if state.tooth_period >= self.steady_from && before.1 * velocity < 0.0 {
            self.x_mm.take_cubic(step_s, (before.0, state.q[0]), (before.1, velocity));
        }
    }

    /// Largest displacement either way so far.
    fn farthest_mm(&self) -> f64 {
        let of = |range: &Range| if range.low <= range.high { range.high.max(-range.low) } else { 0.0 };
        of(&self.x_mm).max(of(&self.x_early_mm))
    }

    /// A joint has opened or closed inside a step, at `done` after its start.
    fn event<const N: usize>(&mut self, state: &State<'_, N>, done: f64) {
        let force = state.clamp_force_n;
        let [_, _, left, right] = demands(&state.system, state.holding, &state.q);
        for (side, elastic) in [left, right].into_iter().enumerate() {
            if elastic >= force && self.first_open[side].is_none() {
                self.first_open[side] = Some(self.time_s + done);
            }
        }
    }

    fn finish<const N: usize>(self, state: &State<'_, N>) -> Marched {
        let share = |part: f64| if self.steady_s > 0.0 { part / self.steady_s } else { 0.0 };
        let arc = (0..state.grid.cells)
            .map(|cell| (state.cutting.entry_rad + state.grid.angle_rad(state.cutting, cell), state.cells[cell].chip))
            .collect();
        // A run that ended early has no steady part: what it did until then stands for it.
        let or_early = |range: Range, early: Range| if range.low <= range.high { range } else { early };
        let zero = Range { low: 0.0, high: 0.0 };
        // The elastic parts are not kept from the start on; those with damping stand for them.
        let asked = |side: usize| Range { low: self.entry[side], high: self.entry[side] };
        Marched {
            diverged: self.diverged,
            farthest_mm: self.farthest_mm(),
            x_mm: or_early(self.x_mm, self.x_early_mm),
            force_n: or_early(self.force_n, zero),
            feed_mm: or_early(self.feed_mm, zero),
            left_n: or_early(self.demand[0], asked(0)),
            right_n: or_early(self.demand[1], asked(1)),
            left_elastic_n: or_early(self.demand[2], asked(0)),
            right_elastic_n: or_early(self.demand[3], asked(1)),
            left_entry_n: self.entry[0],
            right_entry_n: self.entry[1],
            lost_cut: if self.tooth_steps > 0 { self.lost as f64 / self.tooth_steps as f64 } else { 0.0 },
            open: Open { left: share(self.open[0]), right: share(self.open[1]), both: share(self.open[2]) },
            first_open_left_s: self.first_open[0],
            first_open_right_s: self.first_open[1],
            first_lost_s: self.first_lost,
            samples_mm: self.samples_mm,
            first: self.first,
            last: self.last,
            arc,
            steps: self.steps,
        }
    }
}
