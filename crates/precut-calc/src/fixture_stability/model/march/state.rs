//! The vise on its way.

use std::f64::consts::PI;

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::process_damping;
use crate::fixture_stability::model::holding::{Closed, Holding, System};
use crate::fixture_stability::model::response::demands;

use super::linear::Stretch;
use super::{Cell, Flow, Grid, Plan, Record, Surface};

/// Events in one step at most: a joint does not open and close oftener in a hundredth of an oscillation.
const EVENTS_PER_STEP: u32 = 16;

/// Everything that moves.
pub(super) struct State<'a, const N: usize> {
    pub(super) cutting: &'a Cutting,
    pub(super) holding: &'a Holding,
    pub(super) system: System<N>,
    pub(super) plan: &'a Plan,
    pub(super) grid: Grid,
    pub(super) cells: Vec<Cell>,
    /// Force of the teeth in cut, by their place.
    pub(super) of_tooth: Vec<f64>,
    /// Flows by stretch and by what is closed.
    pub(super) flows: Vec<Flow<N>>,
    pub(super) level: f64,
    pub(super) damping: f64,
    pub(super) hardening: f64,
    /// What each step asks of the job, at hand.
    pub(super) feed_mm: f64,
    pub(super) direction: f64,
    pub(super) clamp_force_n: f64,
    pub(super) uneven: bool,
    pub(super) closed: Closed,
    pub(super) q: [f64; N],
    pub(super) tooth_period: usize,
    pub(super) reached: usize,
}

pub(super) fn index(closed: Closed) -> usize {
    usize::from(closed.left) + 2 * usize::from(closed.right)
}

impl<'a, const N: usize> State<'a, N> {
    pub(super) fn new(
        holding: &'a Holding,
        cutting: &'a Cutting,
        plan: &'a Plan,
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
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
    pub(super) fn enter(&mut self) {
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
    pub(super) fn leave(&mut self, cell: usize, feed: f64) {
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
    pub(super) fn advance(&mut self, i: usize, record: &mut Record) {
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
    pub(super) fn enter_next(&mut self) {
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
    pub(super) fn is_plain(&self) -> bool {
        let alone = self.damping <= 0.0 && self.hardening <= 0.0;
        alone && !self.plan.unilateral && !self.uneven && self.reached == self.grid.cells
    }

    /// The steps of a stretch of a plain tooth period.
    pub(super) fn sweep(&mut self, range: std::ops::Range<usize>, record: &mut Record) {
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
