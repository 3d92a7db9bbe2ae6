//! A rigid part on springs, some of which only press: the displacement of least energy.

use nalgebra::{Matrix6, Vector6};

use super::{Unheld, Wrench};

/// A spring that presses and cannot pull.
pub(super) struct Pressing {
    /// Its direction, as the motion of the part moves it.
    pub along: Wrench,
    /// N/mm.
    pub stiffness_n_per_mm: f64,
    /// What it presses with before the part moves.
    pub before_n: f64,
}

impl Pressing {
    /// What it presses with; below 0 it has come off by that over its stiffness.
    pub(super) fn force_n(&self, motion: &Vector6<f64>) -> f64 {
        self.before_n - self.stiffness_n_per_mm * self.along.dot(motion)
    }
}

/// Springs that hold both ways, as their stiffness, and those that press.
pub(super) struct Springs {
    pub bound: Matrix6<f64>,
    pub pressing: Vec<Pressing>,
}

/// Most steps: each closes or opens contacts.
const MOST_STEPS: usize = 200;
/// Share of the load that may stay out of balance.
const BALANCED: f64 = 1e-11;
/// Share of the stiffness that stands for none, where nothing holds.
const FREE: f64 = 1e-11;

impl Springs {
    /// Where the part goes under a load. A direction in which nothing holds is left where nothing pushes.
    pub(super) fn displaced(&self, load: &Wrench) -> Result<Vector6<f64>, Unheld> {
        let before: Wrench = self.pressing.iter().map(|one| one.along * one.before_n).sum();
        let size = load.norm() + self.pressing.iter().map(|one| one.before_n).sum::<f64>();
        let mut motion = Vector6::zeros();
        let mut slope = self.slope(&motion, &before, load);
        if load.norm() == 0.0 {
            return Ok(motion);
        }
        for _ in 0..MOST_STEPS {
            if slope.norm() <= BALANCED * size {
                return Ok(motion);
            }
            let mut stiffness = self.bound;
            for one in self.pressing.iter().filter(|one| one.force_n(&motion) >= 0.0) {
                stiffness += one.along * one.along.transpose() * one.stiffness_n_per_mm;
            }
            let whole: f64 = self.pressing.iter().map(|one| one.stiffness_n_per_mm).sum::<f64>() + self.bound.trace();
            let held = stiffness + Matrix6::identity() * (FREE * whole);
            let Some(step) = held.cholesky().map(|factors| -factors.solve(&slope)) else { break };
            let Some(far) = self.along(&motion, &step, &slope) else { break };
            motion += step * far;
            slope = self.slope(&motion, &before, load);
        }
        let norm = slope.norm();
        if norm <= 1e3 * BALANCED * size {
            return Ok(motion);
        }
        let free: Vec<f64> = slope.iter().map(|x| -x / norm).collect();
        Err(Unheld::Free(std::array::from_fn(|i| free[i])))
    }

    /// Slope of the energy: what is out of balance, reversed.
    fn slope(&self, motion: &Vector6<f64>, before: &Wrench, load: &Wrench) -> Wrench {
        let pressed: Wrench = self.pressing.iter().map(|one| one.along * one.force_n(motion).max(0.0)).sum();
        self.bound * motion - pressed + before - load
    }

    /// How far along a step the energy is least; `None` where it falls without end.
    fn along(&self, motion: &Vector6<f64>, step: &Vector6<f64>, slope: &Wrench) -> Option<f64> {
        // The slope along the step rises piece by piece: linear between the places where a contact closes or opens.
        let mut breaks: Vec<f64> = self
            .pressing
            .iter()
            .map(|one| one.force_n(motion) / (one.stiffness_n_per_mm * one.along.dot(step)))
            .filter(|far| far.is_finite() && *far > 0.0)
            .collect();
        breaks.sort_by(f64::total_cmp);
        let mut from = 0.0;
        let mut value = slope.dot(step);
        for end in breaks.into_iter().map(Some).chain([None]) {
            let middle = end.map_or(from + 1.0, |end| 0.5 * (from + end));
            let at = motion + step * middle;
            let closed = self.pressing.iter().filter(|one| one.force_n(&at) > 0.0);
            let rate = step.dot(&(self.bound * step))
                + closed.map(|one| one.stiffness_n_per_mm * one.along.dot(step).powi(2)).sum::<f64>();
            let reached = from - value / rate;
            match end {
                Some(end) if rate <= 0.0 || reached > end => {
                    value += rate * (end - from);
                    from = end;
                }
                _ => return (reached.is_finite() && rate > 0.0).then_some(reached),
            }
        }
        None
    }
}
