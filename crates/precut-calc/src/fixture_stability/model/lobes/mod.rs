//! Stability over speed and depth: a point, the limiting depth at a speed, the lobe diagram.

mod boundary;
mod column;
mod map;

use crate::calculator::{Failure, Monitor};
use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::{Multiplier, SpeedPlan, Working};
use crate::fixture_stability::model::holding::{Closed, Holding, System};
use crate::fixture_stability::model::response::{Response, response};
use crate::fixture_stability::model::slow::{is_slow, slow_point};
use crate::num::dde::Rule;

pub(in crate::fixture_stability) use boundary::{BoundaryPoint, boundary};
use column::{COARSE_DEPTH, Column, SCAN, moduli_of};
pub(in crate::fixture_stability) use column::{ChatterLimit, critical_depth, moduli};
use map::POINTS_PER_LOOK;
pub(in crate::fixture_stability) use map::{Map, map};

/// Points of an element for maps: |mu| to 2e-5 near 1; and for single points: to about 1e-10.
const COARSE: usize = 8;
const FINE: usize = 12;
/// Between them, to estimate the error of a single point.
const CHECK: usize = 10;
/// Residual of the eigenvalue over its modulus, for maps and for single points.
const COARSE_RESIDUAL: f64 = 1e-5;
const FINE_RESIDUAL: f64 = 1e-9;

/// Calls a function with the length of the state as its first const parameter.
macro_rules! by_states {
    ($holding:expr, $function:ident ( $($argument:expr),* $(,)? )) => {
        match $holding.states() {
            2 => $function::<2>($($argument),*),
            4 => $function::<4>($($argument),*),
            _ => $function::<6>($($argument),*),
        }
    };
}

pub(in crate::fixture_stability) use by_states;

/// Stability of one working point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Point {
    pub multiplier: Multiplier,
    /// Estimated error of the modulus.
    pub error: f64,
}

/// The rules, made once per job.
pub(in crate::fixture_stability) struct Rules {
    coarse: Rule<COARSE>,
    check: Rule<CHECK>,
    fine: Rule<FINE>,
}

impl Rules {
    pub(in crate::fixture_stability) fn new() -> Self {
        Self { coarse: Rule::new(), check: Rule::new(), fine: Rule::new() }
    }
}

fn unsolved() -> Failure {
    Failure::NotConverged { what: "largest Floquet multiplier", residual: 1.0, iterations: 0 }
}

/// The multiplier of a working point, converged, with the joints `closed`: of what cuts, without what drifts freely when a
/// joint is open (the jaw by itself; jaw and workpiece as one body).
pub(in crate::fixture_stability) fn point(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    closed: Closed,
    monitor: &dyn Monitor,
) -> Result<Point, Failure> {
    let in_touch = Holding { jaw: holding.jaw.filter(|_| closed.left), ..holding.clone() };
    by_states!(in_touch, point_of(rules, &in_touch, cutting, working, closed, monitor))
}

fn point_of<const N: usize>(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    closed: Closed,
    monitor: &dyn Monitor,
) -> Result<Point, Failure> {
    if is_slow(holding, cutting, working.spindle_rpm) {
        let (multiplier, error) = slow_point::<N>(holding, cutting, working, closed, monitor)?;
        return Ok(Point { multiplier, error });
    }
    let system = holding.system::<N>(closed);
    let fine = at::<N, FINE>(&rules.fine, &system, holding, cutting, working, (closed, FINE_RESIDUAL), monitor)?;
    let check = at::<N, CHECK>(&rules.check, &system, holding, cutting, working, (closed, FINE_RESIDUAL), monitor)?;
    // Two more points per element gain two digits; the residual stands for a pair of close multipliers.
    let error = (fine.modulus - check.modulus).abs() + fine.residual * fine.modulus;
    Ok(Point { multiplier: fine, error })
}

fn at<const N: usize, const P: usize>(
    rule: &Rule<P>,
    system: &System<N>,
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    (closed, residual): (Closed, f64),
    monitor: &dyn Monitor,
) -> Result<Multiplier, Failure> {
    let hardening = holding.hardening_n_per_mm3(closed);
    let plan = if hardening > 0.0 && closed == Closed::BOTH {
        let forced = response::<N>(holding, cutting, working, monitor)?;
        about(rule, system, holding, cutting, working, &forced, monitor)?
    } else {
        SpeedPlan::new(rule, system, cutting, working, None, monitor)?
    };
    let level = cutting.level(working.depth_mm);
    let is_free = holding.jaw.is_some() && !closed.right;
    let found = if is_free {
        plan.multiplier_but_of_shift(level, residual, monitor)
    } else {
        plan.multiplier(level, residual, monitor)
    };
    found?.ok_or_else(unsolved)
}

/// The vise stiffened by the motion about which it is asked whether a small change decays.
fn about<const N: usize, const P: usize>(
    rule: &Rule<P>,
    system: &System<N>,
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    forced: &Response,
    monitor: &dyn Monitor,
) -> Result<SpeedPlan<N, P>, Failure> {
    let hardening = holding.hardening_n_per_mm3(Closed::BOTH);
    let stiffness = |t: f64| 3.0 * hardening * forced.x_at(t).powi(2);
    SpeedPlan::new(rule, system, cutting, working, Some(&stiffness), monitor)
}

/// Where the modulus crosses 1 over the depth, from the bottom, and how deep could be looked.
#[derive(Debug, Clone, PartialEq)]
struct Crossings {
    depths_mm: Vec<f64>,
    up_to_mm: f64,
}

/// The same with eigenvalues as exact as those of single points: what a small change makes of a modulus is that of the model, since the
/// error of the elements changes as smoothly as they do.
pub(in crate::fixture_stability) fn smooth_moduli(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    depths_mm: &[f64],
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, Failure> {
    by_states!(holding, moduli_of(rules, holding, cutting, working, (depths_mm, FINE_RESIDUAL), monitor))
}

/// The plane that is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Plane {
    pub from_rpm: f64,
    pub to_rpm: f64,
    pub speeds: usize,
    pub most_mm: f64,
    pub depths: usize,
    pub feed_mm: f64,
}

impl Plane {
    pub(in crate::fixture_stability) fn speed_rpm(&self, share: f64) -> f64 {
        self.from_rpm + (self.to_rpm - self.from_rpm) * share
    }

    fn working(&self, spindle_rpm: f64) -> Working {
        Working { spindle_rpm, feed_mm: self.feed_mm, depth_mm: self.most_mm }
    }
}

/// Map points of one column that belong together in one piece of work.
struct Block {
    column: usize,
    rows: std::ops::Range<usize>,
}
