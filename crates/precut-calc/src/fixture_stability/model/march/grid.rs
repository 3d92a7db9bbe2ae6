//! Teeth over the steps of a pitch.

use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::Working;

/// The grid of the tooth period: steps with and without the tooth that leaves last.
pub(super) struct Grid {
    pub(super) steps: usize,
    /// Step at which the last tooth leaves.
    pub(super) leave: usize,
    pub(super) teeth_before: usize,
    pub(super) teeth_after: usize,
    /// s, before and after.
    pub(super) step_s: [f64; 2],
    pub(super) cells: usize,
}

impl Grid {
    pub(super) fn of(cutting: &Cutting, working: &Working, steps: usize) -> Self {
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
    pub(super) fn angle_rad(&self, cutting: &Cutting, cell: usize) -> f64 {
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
