//! Where within its limits a diameter is best aimed at (`certainty/4.2`).

use crate::calculator::Failure;
use crate::certainty::lines::{Estimate, Sketch};
use crate::certainty::{Improvement, ImprovingAction};

use super::judged::{ABOVE, BELOW, By, JOINT, Judged, MOST_LINES, SETS};
use super::limits::Aim;

/// Steps in which the best aim is bracketed, and by which it is narrowed down.
const AIM_STEPS: [usize; 2] = [16, 16];

impl Judged<'_> {
    /// The shift of the commanded diameter that an aim asks for, um.
    pub(crate) fn aim_um(&self, aim: &Aim) -> Result<f64, Failure> {
        match *aim {
            Aim::Nominal {} => Ok(0.0),
            Aim::Middle {} => Ok(self.limits.middle_um().unwrap_or(0.0)),
            Aim::MostProbable {} => self.best_shift_um(&|kept| kept[JOINT]),
            Aim::LeastLoss { oversize_cost, undersize_cost } => self.best_shift_um(&|kept| {
                let lost = |limit: usize, cost: f64| cost * (1.0 - kept[limit]);
                -lost(ABOVE, oversize_cost) - lost(BELOW, undersize_cost)
            }),
        }
    }

    /// The shift at which `worth`, of the probabilities of the sets of limits, is largest: by steps over what may matter, then
    /// by golden section, on common points of the response surface. Errors follow a shift as they do about the stated values.
    fn best_shift_um(&self, worth: &dyn Fn([f64; SETS.len()]) -> f64) -> Result<f64, Failure> {
        let extremes = |scores: &[f64], shift_um: f64| -> Result<[f64; 2], Failure> {
            Ok(self.parts.places().extremes_um(&self.errors_um(By::Surface, &self.uncertainties, scores, shift_um)?))
        };
        let effort = self.effort(MOST_LINES[1]);
        let sketch = Sketch::of(&self.axis, effort, self.monitor, &mut |scores| extremes(scores, 0.0))?;
        let stated = vec![0.0; self.axis.len()];
        let [up, down] = [extremes(&stated, 1.0)?, extremes(&stated, -1.0)?];
        let follows: [f64; 2] = std::array::from_fn(|end| 0.5 * (up[end] - down[end]));
        let has_bounds = !self.uncertainties.within.is_empty();
        let at = |shift: f64| -> Result<f64, Failure> {
            if has_bounds {
                return self.worth_nearly(shift, worth);
            }
            let shifted = |ends: [f64; 2]| std::array::from_fn(|end| ends[end] + follows[end] * shift);
            Ok(worth(sketch.kept(&SETS, &|ends| self.margins(shifted(ends)))?))
        };
        let middle = self.limits.middle_um().unwrap_or(0.0);
        let room = self.limits.half_width_um().unwrap_or(0.0) + 3.0 * self.slopes.largest_deviation_um();
        let step = 2.0 * room / AIM_STEPS[0] as f64;
        let mut best = (0.0, at(0.0)?);
        for index in 0..=AIM_STEPS[0] {
            let shift = step.mul_add(index as f64, middle - room);
            let here = at(shift)?;
            if here > best.1 {
                best = (shift, here);
            }
        }
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let (mut low, mut high) = (best.0 - step, best.0 + step);
        let (mut inner, mut outer) = (high - golden * (high - low), low + golden * (high - low));
        let (mut at_inner, mut at_outer) = (at(inner)?, at(outer)?);
        for _ in 0..AIM_STEPS[1] {
            if at_inner >= at_outer {
                (high, outer, at_outer) = (outer, inner, at_inner);
                inner = high - golden * (high - low);
                at_inner = at(inner)?;
            } else {
                (low, inner, at_inner) = (inner, outer, at_outer);
                outer = low + golden * (high - low);
                at_outer = at(outer)?;
            }
        }
        let found = if at_inner >= at_outer { (inner, at_inner) } else { (outer, at_outer) };
        let near = if found.1 > best.1 { found.0 } else { best.0 };
        // The top is flat, and the lines are bent: what is left is found by parabolas.
        let bent = |shift: f64| self.worth_nearly(shift, worth);
        let mut top = near;
        for width in [0.5 * step, 0.25 * step] {
            let [left, here, right] = [bent(top - width)?, bent(top)?, bent(top + width)?];
            let curvature = left - 2.0 * here + right;
            let move_by = if curvature < 0.0 { 0.5 * width * (left - right) / curvature } else { 0.0 };
            top += move_by.clamp(-width, width);
        }
        Ok(top)
    }

    /// What another aim would make of it.
    pub(super) fn shifted(&self, shift_um: f64, now: Estimate) -> Result<Option<Improvement>, Failure> {
        let (Some(least_um), Some(_)) = (self.asked.open_aim_um, self.limits.middle_um()) else { return Ok(None) };
        let best_um = self.aim_um(&Aim::MostProbable {})?;
        let then = self.least_found(best_um)?;
        Ok(Improvement::of(ImprovingAction::ShiftAim { shift_um: best_um }, now, then)
            .filter(|_| (best_um - shift_um).abs() > least_um))
    }
}
