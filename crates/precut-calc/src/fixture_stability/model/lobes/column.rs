//! One spindle speed: where chatter begins over the depth.

use crate::calculator::{Failure, Monitor};
use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::{SpeedPlan, Working};
use crate::fixture_stability::model::holding::{Closed, Holding, System};
use crate::fixture_stability::model::response::unbroken;
use crate::fixture_stability::model::slow::{SlowCut, is_slow};
use crate::num::dde::Rule;

use super::{COARSE_RESIDUAL, Crossings, FINE_RESIDUAL, Rules, about, by_states, unsolved};

/// Steps of the upward scan of a column.
pub(super) const SCAN: u32 = 24;
/// ln |mu| below which a cut is stable: without any damping it is 0 to round-off.
const STABLE: f64 = 1e-9;
/// Steps to the top of a peak between depths of the scan, each this share of the larger side: to 2 % of it.
const PEAK: u32 = 8;
const GOLDEN: f64 = 0.381_966_011_250_105;
/// Relative accuracy of a limiting depth on a map and of one that is asked for by itself.
pub(super) const COARSE_DEPTH: f64 = 1e-4;
const FINE_DEPTH: f64 = 1e-8;
/// Halvings of the depth up to which there is a forced motion: from the deepest down to one that has one, and back up.
const DOWN: u32 = 30;
const UP: u32 = 5;

/// Where chatter begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct ChatterLimit {
    /// `None` where it does not up to the depth examined.
    pub depth_mm: Option<f64>,
    /// How deep was looked: less than was asked where joints harden and a deeper cut has no forced motion that could be found.
    pub examined_mm: f64,
}

/// The modulus over the depth at one speed.
pub(super) struct Column<'a, const N: usize, const P: usize> {
    pub(in crate::fixture_stability::model) rule: &'a Rule<P>,
    pub(in crate::fixture_stability::model) system: &'a System<N>,
    pub(in crate::fixture_stability::model) holding: &'a Holding,
    pub(in crate::fixture_stability::model) cutting: &'a Cutting,
    pub(in crate::fixture_stability::model) working: Working,
    /// Shared by all depths where nothing but the level depends on the depth.
    pub(in crate::fixture_stability::model) plan: Option<SpeedPlan<N, P>>,
    pub(in crate::fixture_stability::model) is_slow: bool,
    slow: Option<SlowCut<N>>,
    pub(in crate::fixture_stability::model) residual: f64,
    pub(in crate::fixture_stability::model) monitor: &'a dyn Monitor,
}

impl<'a, const N: usize, const P: usize> Column<'a, N, P> {
    pub(in crate::fixture_stability::model) fn new(
        rule: &'a Rule<P>,
        system: &'a System<N>,
        holding: &'a Holding,
        cutting: &'a Cutting,
        working: Working,
        residual: f64,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, Failure> {
        let shared = cutting.process_damping_n_per_mm <= 0.0 && holding.hardening_per_mm2 <= 0.0;
        let is_slow = is_slow(holding, cutting, working.spindle_rpm);
        let planned = shared && !is_slow;
        let plan = planned.then(|| SpeedPlan::new(rule, system, cutting, working, None, monitor)).transpose()?;
        let slow = (shared && is_slow).then(|| SlowCut::new(system, holding, cutting, working));
        Ok(Self { rule, system, holding, cutting, working, plan, is_slow, slow, residual, monitor })
    }

    /// `None` where joints harden and no forced motion is found about which to ask.
    pub(in crate::fixture_stability::model) fn modulus(&self, depth_mm: f64) -> Result<Option<f64>, Failure> {
        let level = self.cutting.level(depth_mm);
        if self.is_slow {
            let there = || SlowCut::new(self.system, self.holding, self.cutting, Working { depth_mm, ..self.working });
            let found = self
                .slow
                .as_ref()
                .map_or_else(|| there().multiplier(level, self.monitor), |slow| slow.multiplier(level, self.monitor));
            return Ok(Some(found?.0.counted()));
        }
        let found = if let Some(plan) = &self.plan {
            plan.multiplier(level, self.residual, self.monitor)?
        } else {
            let working = Working { depth_mm, ..self.working };
            let plan = if self.hardens() {
                let found = unbroken::<N>(self.holding, self.cutting, working, self.monitor)?;
                let Some(forced) = found else { return Ok(None) };
                about(self.rule, self.system, self.holding, self.cutting, working, &forced, self.monitor)?
            } else {
                SpeedPlan::new(self.rule, self.system, self.cutting, working, None, self.monitor)?
            };
            plan.multiplier(level, self.residual, self.monitor)?
        };
        Ok(Some(found.ok_or_else(unsolved)?.modulus))
    }

    pub(in crate::fixture_stability::model) fn on_map(&self, depth_mm: f64) -> Result<f64, Failure> {
        Ok(self.modulus(depth_mm)?.unwrap_or(f64::NAN))
    }

    fn hardens(&self) -> bool {
        self.holding.hardening_per_mm2 > 0.0
    }

    /// Depth up to which there is a forced motion: `most`, or less where joints harden.
    fn reach_mm(&self, most_mm: f64) -> Result<f64, Failure> {
        if !self.hardens() || self.has_motion(most_mm)? {
            return Ok(most_mm);
        }
        let (mut low, mut high) = (0.5 * most_mm, most_mm);
        for _ in 0..DOWN {
            if self.has_motion(low)? {
                break;
            }
            (low, high) = (0.5 * low, low);
        }
        self.last_motion_mm(low, high)
    }

    fn has_motion(&self, depth_mm: f64) -> Result<bool, Failure> {
        let working = Working { depth_mm, ..self.working };
        Ok(unbroken::<N>(self.holding, self.cutting, working, self.monitor)?.is_some())
    }

    /// How far beyond a depth with a forced motion there still is one, short of a depth without.
    fn last_motion_mm(&self, mut with_mm: f64, mut without_mm: f64) -> Result<f64, Failure> {
        for _ in 0..UP {
            let middle = 0.5 * (with_mm + without_mm);
            if self.has_motion(middle)? { with_mm = middle } else { without_mm = middle }
        }
        Ok(with_mm)
    }

    /// Depths at which the modulus crosses 1 up to `most`, from the bottom: a scan, then bracketing.
    pub(in crate::fixture_stability::model) fn crossings(
        &self,
        most_mm: f64,
        relative: f64,
        only_first: bool,
    ) -> Result<Crossings, Failure> {
        let reach_mm = self.reach_mm(most_mm)?;
        let mut found = Crossings { depths_mm: Vec::new(), up_to_mm: 0.0 };
        let Some(free) = self.modulus(0.0)? else { return Ok(found) };
        let mut before = (0.0, free.ln());
        let mut earlier = before;
        for step in 1..=SCAN {
            let mut depth = reach_mm * f64::from(step) / f64::from(SCAN);
            let mut modulus = self.modulus(depth)?;
            // A motion that comes back deeper down is another one: between both nothing crosses 1.
            let is_last = modulus.is_none();
            if is_last {
                depth = self.last_motion_mm(before.0, depth)?;
                modulus = self.modulus(depth)?;
            }
            let Some(modulus) = modulus else { break };
            let here = (depth, modulus.ln());
            found.up_to_mm = depth;
            if let Some(top) = self.peak(earlier, before, here)? {
                found.depths_mm.push(self.root(earlier, top, relative)?);
                if only_first {
                    found.up_to_mm = reach_mm;
                    break;
                }
                found.depths_mm.push(self.root(top, here, relative)?);
            }
            // The free vise decays; without any damping its modulus is 1 to round-off and counts as stable.
            if (before.1 < STABLE) != (here.1 < STABLE) {
                found.depths_mm.push(self.root(before, here, relative)?);
                if only_first {
                    found.up_to_mm = reach_mm;
                    break;
                }
            }
            if is_last {
                break;
            }
            (earlier, before) = (before, here);
        }
        Ok(found)
    }

    /// Where ln |mu| is above 0 between three depths at which it is not: an island that is thinner than a step of the scan.
    /// It is looked for where the slope beside the middle one would lead there.
    fn peak(&self, a: (f64, f64), b: (f64, f64), c: (f64, f64)) -> Result<Option<(f64, f64)>, Failure> {
        let is_peak = b.0 > a.0 && b.1 < STABLE && b.1 >= a.1 && b.1 >= c.1;
        if !is_peak || b.1 + (b.1 - a.1).max(b.1 - c.1) < STABLE {
            return Ok(None);
        }
        let (mut low, mut top, mut high) = (a.0, b, c.0);
        for _ in 0..PEAK {
            let is_left = top.0 - low > high - top.0;
            let end = if is_left { low } else { high };
            let depth = top.0 + GOLDEN * (end - top.0);
            let Some(modulus) = self.modulus(depth)? else { return Ok(None) };
            let here = (depth, modulus.ln());
            if here.1 >= STABLE {
                return Ok(Some(here));
            }
            match (here.1 > top.1, is_left) {
                (true, true) => (high, top) = (top.0, here),
                (true, false) => (low, top) = (top.0, here),
                (false, true) => low = depth,
                (false, false) => high = depth,
            }
        }
        Ok(None)
    }

    /// Where ln |mu| is 0 between two depths of different sign: regula falsi with the Illinois weight.
    fn root(&self, mut a: (f64, f64), mut b: (f64, f64), relative: f64) -> Result<f64, Failure> {
        let mut side = 0;
        for _ in 0..80 {
            if (b.0 - a.0).abs() <= relative * b.0.abs().max(a.0.abs()) {
                break;
            }
            let mut middle = (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1);
            let (low, high) = (a.0.min(b.0), a.0.max(b.0));
            if !(middle > low && middle < high) {
                middle = 0.5 * (low + high);
            }
            let Some(modulus) = self.modulus(middle)? else { break };
            let value = modulus.ln();
            if value.abs() < 0.1 * relative {
                return Ok(middle);
            }
            if (value < 0.0) == (a.1 < 0.0) {
                a = (middle, value);
                if side == -1 {
                    b.1 *= 0.5;
                }
                side = -1;
            } else {
                b = (middle, value);
                if side == 1 {
                    a.1 *= 0.5;
                }
                side = 1;
            }
        }
        Ok(if a.1.abs() < b.1.abs() { a.0 } else { b.0 })
    }
}

/// Depth at which chatter begins at a speed, looking up to `most_mm`.
pub(in crate::fixture_stability) fn critical_depth(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    most_mm: f64,
    monitor: &dyn Monitor,
) -> Result<ChatterLimit, Failure> {
    by_states!(holding, critical_of(rules, holding, cutting, working, most_mm, monitor))
}

fn critical_of<const N: usize>(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    most_mm: f64,
    monitor: &dyn Monitor,
) -> Result<ChatterLimit, Failure> {
    let system = holding.system::<N>(Closed::BOTH);
    let column = Column::new(&rules.fine, &system, holding, cutting, working, FINE_RESIDUAL, monitor)?;
    let Crossings { depths_mm, up_to_mm } = column.crossings(most_mm, FINE_DEPTH, true)?;
    Ok(ChatterLimit { depth_mm: depths_mm.first().copied(), examined_mm: up_to_mm })
}

/// |mu| at several depths of one speed, to the accuracy of maps; NaN where no forced motion is found about which to ask.
pub(in crate::fixture_stability) fn moduli(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    depths_mm: &[f64],
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, Failure> {
    by_states!(holding, moduli_of(rules, holding, cutting, working, (depths_mm, COARSE_RESIDUAL), monitor))
}

pub(super) fn moduli_of<const N: usize>(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    (depths_mm, residual): (&[f64], f64),
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, Failure> {
    let system = holding.system::<N>(Closed::BOTH);
    let column = Column::new(&rules.coarse, &system, holding, cutting, working, residual, monitor)?;
    depths_mm.iter().map(|&depth| column.on_map(depth)).collect()
}
