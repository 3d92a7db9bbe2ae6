//! What is remembered of a run.

use crate::fixture_stability::model::response::{Range, demands};

use super::{Marched, Open, Plan, State, Step};

/// What is kept of a run.
pub(super) struct Record {
    pub(super) time_s: f64,
    pub(super) diverged: bool,
    pub(super) steady_from: usize,
    pub(super) keep_first: usize,
    pub(super) keep_from: usize,
    pub(super) x_mm: Range,
    /// Before the steady periods.
    pub(super) x_early_mm: Range,
    pub(super) force_n: Range,
    pub(super) feed_mm: Range,
    pub(super) demand: [Range; 4],
    pub(super) entry: [f64; 2],
    pub(super) tooth_steps: usize,
    pub(super) lost: usize,
    pub(super) open: [f64; 3],
    pub(super) steady_s: f64,
    pub(super) first_open: [Option<f64>; 2],
    pub(super) first_lost: Option<f64>,
    pub(super) samples_mm: Vec<f64>,
    pub(super) first: Vec<Step>,
    pub(super) last: Vec<Step>,
    pub(super) steps: usize,
}

const NOTHING: Range = Range { low: f64::INFINITY, high: f64::NEG_INFINITY };

#[inline]
pub(super) fn take(range: &mut Range, value: f64) {
    // Plain comparisons: the library's minimum asks each time whether a value is a number. What is none ends the run.
    if value < range.low {
        range.low = value;
    }
    if value > range.high {
        range.high = value;
    }
}

impl Record {
    pub(super) fn new(plan: &Plan) -> Self {
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
    pub(super) fn seen(&mut self, x_mm: f64, demand: [f64; 4], cut_n: f64, steady: bool, step_s: f64) {
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
    pub(super) fn tooth(&mut self, feed_mm: f64, steady: bool) {
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
    pub(super) fn take<const N: usize>(
        &mut self,
        state: &State<'_, N>,
        i: usize,
        teeth: usize,
        cut_n: f64,
        step_s: f64,
    ) {
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
    pub(super) fn keeps(&self, period: usize) -> bool {
        period < self.keep_first || period >= self.keep_from
    }

    pub(super) fn keep(&mut self, period: usize, step: Step) {
        if period < self.keep_first { self.first.push(step) } else { self.last.push(step) }
    }

    /// A turn of the motion between two steps, by the cubic through them.
    #[inline]
    pub(super) fn between<const N: usize>(&mut self, state: &State<'_, N>, before: (f64, f64), step_s: f64) {
        let velocity = state.system.velocity(&state.q, 0);
        if state.tooth_period >= self.steady_from && before.1 * velocity < 0.0 {
            self.x_mm.take_cubic(step_s, (before.0, state.q[0]), (before.1, velocity));
        }
    }

    /// Largest displacement either way so far.
    pub(super) fn farthest_mm(&self) -> f64 {
        let of = |range: &Range| if range.low <= range.high { range.high.max(-range.low) } else { 0.0 };
        of(&self.x_mm).max(of(&self.x_early_mm))
    }

    /// A joint has opened or closed inside a step, at `done` after its start.
    pub(super) fn event<const N: usize>(&mut self, state: &State<'_, N>, done: f64) {
        let force = state.clamp_force_n;
        let [_, _, left, right] = demands(&state.system, state.holding, &state.q);
        for (side, elastic) in [left, right].into_iter().enumerate() {
            if elastic >= force && self.first_open[side].is_none() {
                self.first_open[side] = Some(self.time_s + done);
            }
        }
    }

    pub(super) fn finish<const N: usize>(self, state: &State<'_, N>) -> Marched {
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
