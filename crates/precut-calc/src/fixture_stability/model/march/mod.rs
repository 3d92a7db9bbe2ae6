//! The cut in time: teeth that lose the cut, older surfaces, joints that open.
//!
//! The step divides both parts of the tooth period (with and without the last tooth), so teeth enter and leave on
//! steps. Between steps the linear system is propagated exactly, with the force linear over the step; where a joint
//! opens or closes inside a step, the moment is solved for and the step is continued with the other system. Second
//! order in the step; the surface is stored where teeth stand at the steps (`fixture/3.2`).

mod flow;
mod grid;
mod linear;
mod record;
mod state;

use crate::calculator::{Failure, Monitor, Pace};
use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::holding::Holding;
use crate::fixture_stability::model::response::Range;

use flow::Flow;
use grid::Grid;
use record::{Record, take};
use state::State;

/// A displacement beyond this, mm, ends a run: the force law has left everything real.
const DIVERGED_MM: f64 = 10.0;
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
