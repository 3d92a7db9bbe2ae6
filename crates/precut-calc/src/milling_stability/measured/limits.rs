//! Depths at which chatter begins or ends at a speed, and how steep the multiplier is there.

use std::f64::consts::TAU;

use crate::calculator::{Failure, Monitor};
use crate::fixture_stability::{FLATTEST, steepness};

use super::super::job::Case;
use super::super::model::{Cut, MOST_OSCILLATIONS, Orders, Rotation, Search, scan};

/// Depths that are looked at beyond the rows of a speed, each this times the one before, and how many of them either way.
const NEXT_DEPTH: f64 = 1.5;
const DEPTHS_BEYOND: usize = 6;
/// First step from a depth toward a limit near it.
const FIRST_STEP: f64 = 1.08;
/// A limit is found to this share: its slope changes by far less over it.
const FOUND: f64 = 0.01;
const STEPS: usize = 12;
/// Even steps in which depths are looked at for the first limit.
const DEPTHS: u32 = 12;

/// Depth at which chatter first begins at a speed.
pub(super) fn first_limit_mm(
    orders: &Orders,
    case: &Case,
    spindle_rpm: f64,
    depth_max_mm: f64,
    monitor: &dyn Monitor,
) -> Result<Option<f64>, Failure> {
    let Some(cut) = cut_at(case, spindle_rpm, depth_max_mm) else { return Ok(None) };
    let search = Search { depth_max_mm, steps: DEPTHS, only_first: true, on_map: true };
    match scan(orders, &cut, &search, monitor) {
        Ok(seen) => Ok(seen.first_mm().filter(|limit| *limit > 0.0)),
        Err(Failure::NotConverged { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}

/// Depth at which chatter begins or ends next to one, by the secant through the logarithm of the depth; `None` where it is farther than
/// a factor of [`NEXT_DEPTH`]^[`DEPTHS_BEYOND`].
pub(super) fn limit_near_mm(
    orders: &Orders,
    case: &Case,
    spindle_rpm: f64,
    near_mm: f64,
    monitor: &dyn Monitor,
) -> Result<Option<f64>, Failure> {
    let look = Look { orders, case, spindle_rpm, monitor };
    let found = || -> Result<Option<f64>, Failure> {
        let mut here = (near_mm, look.growth(near_mm)?);
        let factor = if here.1 < 0.0 { FIRST_STEP } else { 1.0 / FIRST_STEP };
        let mut times = factor;
        for _ in 0..STEPS {
            let next = here.0 * times;
            let there = (next, look.growth(next)?);
            if (there.1 < 0.0) != (here.1 < 0.0) {
                let (low, high) = if factor > 1.0 { (here, there) } else { (there, here) };
                return look.crossing(low, high).map(Some);
            }
            here = there;
            times = (times * times).clamp(1.0 / NEXT_DEPTH, NEXT_DEPTH);
        }
        Ok(None)
    };
    match found() {
        Err(Failure::NotConverged { .. }) => Ok(None),
        found => found,
    }
}

/// A cut at a speed and a depth; `None` of one that is not computed: its period is too long, or fits no modulation.
pub(super) fn cut_at(case: &Case, spindle_rpm: f64, depth_mm: f64) -> Option<Cut<'_>> {
    let rotation = case.at_speed(spindle_rpm)?;
    let cut = Cut { rotation, depth_mm, ..case.cut() };
    (cut.oscillations() <= MOST_OSCILLATIONS || (cut.is_slow() && cut.repeats())).then_some(cut)
}

/// How many teeth pass in a period of the map.
pub(super) fn teeth_per_period(cut: &Cut<'_>) -> f64 {
    let rotation: &Rotation = &cut.rotation;
    let turned = rotation.rotation_rad(rotation.period_s(cut.milling.period_rad()));
    turned / TAU * cut.milling.teeth.len() as f64
}

/// One speed of the base at any depth.
pub(super) struct Look<'a> {
    pub orders: &'a Orders,
    pub case: &'a Case,
    pub spindle_rpm: f64,
    pub monitor: &'a dyn Monitor,
}

impl Look<'_> {
    /// ln|mu| from tooth to tooth.
    fn growth(&self, depth_mm: f64) -> Result<f64, Failure> {
        let unsolved = || Failure::NotConverged { what: "multiplier", residual: f64::NAN, iterations: 0 };
        let cut = cut_at(self.case, self.spindle_rpm, depth_mm).ok_or_else(unsolved)?;
        let found = self.orders.on_map(&cut, self.monitor)?.ok_or_else(unsolved)?;
        Ok(found.growth() / teeth_per_period(&cut))
    }

    /// Depths near those of the rows at which chatter begins or ends, rising, each with the steepness of ln|mu| there.
    pub(super) fn limits(&self, depths_mm: &[f64]) -> Result<Vec<(f64, f64)>, Failure> {
        let mut depths = depths_mm.to_vec();
        depths.sort_by(f64::total_cmp);
        depths.dedup();
        match self.crossings(&depths) {
            Err(Failure::NotConverged { .. }) => Ok(Vec::new()),
            found => found,
        }
    }

    fn crossings(&self, depths_mm: &[f64]) -> Result<Vec<(f64, f64)>, Failure> {
        let mut known: Vec<(f64, f64)> = Vec::with_capacity(depths_mm.len());
        for &depth_mm in depths_mm {
            known.push((depth_mm, self.growth(depth_mm)?));
        }
        for _ in 0..DEPTHS_BEYOND {
            let (depth_mm, growth) = known[0];
            if growth < 0.0 {
                break;
            }
            let below = depth_mm / NEXT_DEPTH;
            known.insert(0, (below, self.growth(below)?));
        }
        for _ in 0..DEPTHS_BEYOND {
            let (depth_mm, growth) = known[known.len() - 1];
            if growth >= 0.0 {
                break;
            }
            let above = depth_mm * NEXT_DEPTH;
            known.push((above, self.growth(above)?));
        }
        let mut found = Vec::new();
        for pair in known.windows(2).filter(|pair| (pair[0].1 < 0.0) != (pair[1].1 < 0.0)) {
            let limit_mm = self.crossing(pair[0], pair[1])?;
            let steepness = steepness(limit_mm, |depth_mm| self.growth(depth_mm))?;
            found.push((limit_mm, steepness.abs().max(FLATTEST * self.decay())));
        }
        Ok(found)
    }

    /// By halving the logarithm between two depths of different sign.
    fn crossing(&self, from: (f64, f64), to: (f64, f64)) -> Result<f64, Failure> {
        let (mut low, mut high) = (from, to);
        for _ in 0..STEPS {
            if high.0 <= low.0 * (1.0 + FOUND) {
                break;
            }
            // Where both ends are alike steep regula falsi is there at once; it never goes nearer to an end than a tenth.
            let share = (low.1 / (low.1 - high.1)).clamp(0.1, 0.9);
            let middle = low.0 * (high.0 / low.0).powf(share);
            let growth = self.growth(middle)?;
            if growth.abs() < 1e-4 {
                return Ok(middle);
            }
            if (growth < 0.0) == (low.1 < 0.0) { low = (middle, growth) } else { high = (middle, growth) }
        }
        Ok((low.0 * high.0).sqrt())
    }

    /// By how many factors of e the slowest free vibration falls from tooth to tooth, 1 at most: so steep is ln|mu| on average.
    fn decay(&self) -> f64 {
        let tooth_s = 60.0 / (self.spindle_rpm * self.case.milling.teeth.len() as f64);
        let slowest = self.case.structure.modes.iter().map(|mode| mode.damping_ratio * mode.rad_per_s());
        (slowest.fold(f64::INFINITY, f64::min) * tooth_s).min(1.0)
    }
}
