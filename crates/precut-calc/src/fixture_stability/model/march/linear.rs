//! The plain cut under the linear force law, one to three teeth in cut: the case of searches, curves and verdicts.
//!
//! A step needs the force of the step before, which needs the position, which needs the force: what a processor waits
//! for is this chain, not the number of operations. So everything that does not depend on the last force is computed
//! before it is known. With q = begun + end F1 at the end of a step, the next one begins with
//! `begun' = (phi begun + shift) + (phi end + start) F1`, and the position that its feed is taken at is the same with
//! `phi end + start + end`: two operations from one force to the next feed instead of seven (`fixture/3.2`).

use crate::fixture_stability::model::response::demands;

use super::state::{State, index};
use super::{Cell, Record, Surface, take};
use crate::num::dde::times;

use crate::fixture_stability::model::holding::Closed;

/// One range of steps.
#[derive(Clone, Copy)]
pub(super) struct Stretch {
    pub(super) first: usize,
    pub(super) steps: usize,
    /// 0 before the last tooth leaves, 1 after it.
    pub(super) after: usize,
}

impl<const N: usize> State<'_, N> {
    /// Runs through a stretch with `K` teeth in cut. `STEADY`: extremes are taken.
    pub(super) fn linear<const K: usize, const STEADY: bool>(&mut self, stretch: Stretch, record: &mut Record) {
        let Stretch { first, steps, after } = stretch;
        let (feed_mm, direction, level) = (self.feed_mm, self.direction, self.level);
        let multiple = self.plan.surface == Surface::Multiple;
        let (kept, period) = (record.keeps(self.tooth_period), self.tooth_period);
        let (pitch, step_s) = (self.grid.steps, self.grid.step_s[after]);
        let flow = &self.flows[4 * after + index(Closed::BOTH)];
        let (phi, shift, end) = (flow.phi, flow.shift, flow.end);
        // What the last force adds to the state at the end of the next step, without the force there.
        let carried = times(&phi, &end);
        let of_last: [f64; N] = std::array::from_fn(|i| carried[i] + flow.start[i]);
        let feed_of_last = -direction * (of_last[0] + end[0]);

        let mut q = self.q;
        let mut cut = 0.0;
        for force in &self.of_tooth[..K] {
            cut += force;
        }
        // The first step begins with a state instead.
        let moved = times(&phi, &q);
        let mut drift: [f64; N] = std::array::from_fn(|i| moved[i] + shift[i]);
        let (mut of_force, mut feed_of_force) = (flow.start, -direction * (flow.start[0] + end[0]));

        let mut chips: [f64; K] = std::array::from_fn(|j| self.cells[j * pitch + first].chip);
        let mut forces = [0.0; K];
        let rows: [_; K] = rows(&mut self.cells[first + 1..], pitch, steps);
        let mut entry = record.entry;
        let (mut x_mm, mut x_early_mm, mut force_n) = (record.x_mm, record.x_early_mm, record.force_n);
        let (mut feeds_mm, mut asked) = (record.feed_mm, record.demand);
        let (mut time_s, mut steady_s, mut lost) = (record.time_s, record.steady_s, record.lost);
        #[allow(clippy::needless_range_loop)] // the same place in the row of every tooth
        for s in 0..steps {
            let demand = demands(&self.system, self.holding, &q);
            let velocity = self.system.velocity(&q, 0);
            for (most, value) in entry.iter_mut().zip(demand) {
                if value > *most {
                    *most = value;
                }
            }
            if STEADY {
                take(&mut x_mm, q[0]);
                take(&mut force_n, cut);
                for (range, value) in asked.iter_mut().zip(demand) {
                    take(range, value);
                }
                steady_s += step_s;
            } else {
                take(&mut x_early_mm, q[0]);
            }
            if kept {
                record.keep(period, self.system.step(&q, time_s, cut, chips.first().copied(), demand));
            }
            let begun: [f64; N] = std::array::from_fn(|i| drift[i] + of_force[i] * cut);
            let mut to = 0.0;
            for j in 0..K {
                let next = &rows[j][s];
                let apart = -direction * drift[0] - (next.surface - feed_mm);
                let feed = apart + feed_of_force * cut;
                let force = if feed <= 0.0 { 0.0 } else { level * next.share * feed };
                to += force;
                forces[j] = force;
            }
            (of_force, feed_of_force) = (of_last, feed_of_last);
            let moved = times(&phi, &begun);
            drift = std::array::from_fn(|i| moved[i] + shift[i]);
            let x_before = q[0];
            q = std::array::from_fn(|i| begun[i] + end[i] * to);
            cut = to;
            if STEADY {
                let velocity_now = self.system.velocity(&q, 0);
                if velocity * velocity_now < 0.0 {
                    x_mm.take_cubic(step_s, (x_before, q[0]), (velocity, velocity_now));
                }
            }
            for j in 0..K {
                if chips[j] <= 0.0 && record.first_lost.is_none() {
                    record.first_lost = Some(time_s);
                }
                if STEADY {
                    take(&mut feeds_mm, chips[j]);
                    lost += usize::from(chips[j] <= 0.0);
                }
                let next = &mut rows[j][s];
                let older = next.surface - feed_mm;
                let feed = -direction * q[0] - older;
                let chip = feed.max(0.0);
                next.chip = chip;
                next.surface = older + if multiple { chip } else { feed };
                chips[j] = chip;
            }
            time_s += step_s;
        }
        record.steps += steps;
        if STEADY {
            record.tooth_steps += K * steps;
        }
        record.entry = entry;
        (record.x_mm, record.x_early_mm, record.force_n) = (x_mm, x_early_mm, force_n);
        (record.feed_mm, record.demand) = (feeds_mm, asked);
        (record.time_s, record.steady_s, record.lost) = (time_s, steady_s, lost);
        self.of_tooth[..K].copy_from_slice(&forces);
        self.q = q;
    }
}

/// The next cells of `K` teeth: those of a tooth end where those of the tooth before it begin.
fn rows<const K: usize>(mut cells: &mut [Cell], pitch: usize, steps: usize) -> [&mut [Cell]; K] {
    std::array::from_fn(|_| {
        let row = cells.len().min(pitch);
        let (row, after) = std::mem::take(&mut cells).split_at_mut(row);
        cells = after;
        &mut row[..steps]
    })
}
