//! Stability over speed and depth: a point, the limiting depth at a speed, the lobe diagram.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::num::dde::Rule;

use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::{Multiplier, SpeedPlan, Working};
use crate::fixture_stability::model::holding::{Closed, Holding, System};
use crate::fixture_stability::model::response::{Response, response, unbroken};
use crate::fixture_stability::model::slow::{SlowCut, is_slow, slow_point};

/// Points of an element for maps: |mu| to 2e-5 near 1; and for single points: to about 1e-10.
const COARSE: usize = 8;
const FINE: usize = 12;
/// Between them, to estimate the error of a single point.
const CHECK: usize = 10;
/// Residual of the eigenvalue over its modulus, for maps and for single points.
const COARSE_RESIDUAL: f64 = 1e-5;
const FINE_RESIDUAL: f64 = 1e-9;
/// Steps of the upward scan of a column.
const SCAN: u32 = 24;
/// ln |mu| below which a cut is stable: without any damping it is 0 to round-off.
const STABLE: f64 = 1e-9;
/// Steps to the top of a peak between depths of the scan, each this share of the larger side: to 2 % of it.
const PEAK: u32 = 8;
const GOLDEN: f64 = 0.381_966_011_250_105;
/// Relative accuracy of a limiting depth on a map and of one that is asked for by itself.
const COARSE_DEPTH: f64 = 1e-4;
const FINE_DEPTH: f64 = 1e-8;
/// Neighbours on the boundary that differ by more than this share are looked at more closely, so often at most.
const NEIGHBOURS: f64 = 0.05;
const ROUNDS: u32 = 3;
/// Halvings of the depth up to which there is a forced motion: from the deepest down to one that has one, and back up.
const DOWN: u32 = 30;
const UP: u32 = 5;
/// Multiplier evaluations between two looks whether anybody still waits.
const POINTS_PER_LOOK: usize = 256;

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

/// Where chatter begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct ChatterLimit {
    /// `None` where it does not up to the depth examined.
    pub depth_mm: Option<f64>,
    /// How deep was looked: less than was asked where joints harden and a deeper cut has no forced motion that could be found.
    pub examined_mm: f64,
}

/// The modulus over the depth at one speed.
struct Column<'a, const N: usize, const P: usize> {
    rule: &'a Rule<P>,
    system: &'a System<N>,
    holding: &'a Holding,
    cutting: &'a Cutting,
    working: Working,
    /// Shared by all depths where nothing but the level depends on the depth.
    plan: Option<SpeedPlan<N, P>>,
    is_slow: bool,
    slow: Option<SlowCut<N>>,
    residual: f64,
    monitor: &'a dyn Monitor,
}

impl<'a, const N: usize, const P: usize> Column<'a, N, P> {
    fn new(
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
    fn modulus(&self, depth_mm: f64) -> Result<Option<f64>, Failure> {
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

    fn on_map(&self, depth_mm: f64) -> Result<f64, Failure> {
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
    fn crossings(&self, most_mm: f64, relative: f64, only_first: bool) -> Result<Crossings, Failure> {
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

fn moduli_of<const N: usize>(
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

/// A speed on the boundary.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::fixture_stability) struct BoundaryPoint {
    pub spindle_rpm: f64,
    /// Where |mu| crosses 1, from the bottom; the first is the limit.
    pub crossings_mm: Vec<f64>,
    /// How deep was looked.
    pub examined_mm: f64,
}

impl BoundaryPoint {
    pub(in crate::fixture_stability) fn limit(&self) -> ChatterLimit {
        ChatterLimit { depth_mm: self.crossings_mm.first().copied(), examined_mm: self.examined_mm }
    }
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

/// The boundary traced: evenly spaced speeds, and more where neighbours differ. `shown` gets what is there so far.
pub(in crate::fixture_stability) fn boundary(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    plane: &Plane,
    monitor: &dyn Monitor,
    shown: &mut dyn FnMut(f64, &[BoundaryPoint]),
) -> Result<Vec<BoundaryPoint>, Failure> {
    by_states!(holding, boundary_of(rules, holding, cutting, plane, monitor, shown))
}

fn boundary_of<const N: usize>(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    plane: &Plane,
    monitor: &dyn Monitor,
    shown: &mut dyn FnMut(f64, &[BoundaryPoint]),
) -> Result<Vec<BoundaryPoint>, Failure> {
    let system = holding.system::<N>(Closed::BOTH);
    let at = |spindle_rpm: f64| -> Result<BoundaryPoint, Failure> {
        let working = plane.working(spindle_rpm);
        let column = Column::new(&rules.coarse, &system, holding, cutting, working, COARSE_RESIDUAL, monitor)?;
        let Crossings { depths_mm, up_to_mm } = column.crossings(plane.most_mm, COARSE_DEPTH, false)?;
        Ok(BoundaryPoint { spindle_rpm, crossings_mm: depths_mm, examined_mm: up_to_mm })
    };
    let last = plane.speeds.saturating_sub(1).max(1) as f64;
    let mut wanted: Vec<f64> = (0..plane.speeds).map(|i| plane.speed_rpm(i as f64 / last)).collect();
    let mut points: Vec<BoundaryPoint> = Vec::new();
    for round in 0..=ROUNDS {
        let all = wanted.len();
        let mut done = 0;
        for speeds in wanted.chunks(POINTS_PER_LOOK / SCAN as usize + 1) {
            checkpoint(monitor)?;
            let found: Result<Vec<_>, _> = speeds.par_iter().map(|&n| at(n)).collect();
            points.extend(found?);
            done += speeds.len();
            let part = done as f64 / all as f64;
            shown((f64::from(round) + part) / f64::from(ROUNDS + 1), &points);
        }
        points.sort_by(|a, b| a.spindle_rpm.total_cmp(&b.spindle_rpm));
        wanted = points
            .windows(2)
            .filter(|pair| differ(&pair[0], &pair[1]))
            .map(|pair| 0.5 * (pair[0].spindle_rpm + pair[1].spindle_rpm))
            .collect();
        if wanted.is_empty() || points.len() + wanted.len() > 4 * plane.speeds.max(50) {
            break;
        }
    }
    shown(1.0, &points);
    Ok(points)
}

/// Whether the limit changes too much between neighbours for a straight line.
fn differ(a: &BoundaryPoint, b: &BoundaryPoint) -> bool {
    match (a.crossings_mm.first(), b.crossings_mm.first()) {
        (Some(p), Some(q)) => (p - q).abs() > NEIGHBOURS * p.min(*q),
        (None, None) => false,
        _ => true,
    }
}

/// |mu| over speed and depth, row by row (a row is a depth; NaN where no forced motion is found about which to ask), and
/// points of the boundary where the map was refined.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::fixture_stability) struct Map {
    pub speeds_rpm: Vec<f64>,
    pub depths_mm: Vec<f64>,
    pub modulus: Vec<f64>,
    pub refined: Vec<(f64, f64)>,
}

pub(in crate::fixture_stability) fn map(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    plane: &Plane,
    refinement: u32,
    monitor: &dyn Monitor,
    shown: &mut dyn FnMut(f64, &Map),
) -> Result<Map, Failure> {
    by_states!(holding, map_of(rules, holding, cutting, plane, refinement, monitor, shown))
}

/// Map points of one column that belong together in one piece of work.
struct Block {
    column: usize,
    rows: std::ops::Range<usize>,
}

fn map_of<const N: usize>(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    plane: &Plane,
    refinement: u32,
    monitor: &dyn Monitor,
    shown: &mut dyn FnMut(f64, &Map),
) -> Result<Map, Failure> {
    let system = holding.system::<N>(Closed::BOTH);
    let last = plane.speeds.saturating_sub(1).max(1) as f64;
    let speeds_rpm: Vec<f64> = (0..plane.speeds).map(|i| plane.speed_rpm(i as f64 / last)).collect();
    let depths_mm: Vec<f64> = (1..=plane.depths).map(|i| plane.most_mm * i as f64 / plane.depths as f64).collect();
    let (columns, rows) = (speeds_rpm.len(), depths_mm.len());
    let mut map = Map { modulus: vec![0.0; columns * rows], refined: Vec::new(), speeds_rpm, depths_mm };
    // The exponentials of a speed are worth some points: at most so few blocks per column as a look allows.
    let height = rows.min(POINTS_PER_LOOK);
    let blocks: Vec<Block> = (0..columns)
        .flat_map(|column| {
            (0..rows).step_by(height).map(move |from| Block { column, rows: from..(from + height).min(rows) })
        })
        .collect();
    let per_chunk = (POINTS_PER_LOOK / height).max(4);
    let share = if refinement > 0 { 0.7 } else { 1.0 };
    for (number, chunk) in blocks.chunks(per_chunk).enumerate() {
        checkpoint(monitor)?;
        let found: Result<Vec<Vec<f64>>, Failure> = chunk
            .par_iter()
            .map(|block| {
                let working = plane.working(map.speeds_rpm[block.column]);
                let column = Column::new(&rules.coarse, &system, holding, cutting, working, COARSE_RESIDUAL, monitor)?;
                map.depths_mm[block.rows.clone()].iter().map(|&depth| column.on_map(depth)).collect()
            })
            .collect();
        for (block, values) in chunk.iter().zip(found?) {
            for (row, value) in block.rows.clone().zip(values) {
                map.modulus[row * columns + block.column] = value;
            }
        }
        shown(share * ((number + 1) * per_chunk).min(blocks.len()) as f64 / blocks.len() as f64, &map);
    }
    if refinement > 0 {
        let column = |spindle_rpm: f64| {
            Column::new(&rules.coarse, &system, holding, cutting, plane.working(spindle_rpm), COARSE_RESIDUAL, monitor)
        };
        map.refined = refine(&map, refinement, &column, monitor)?;
        shown(1.0, &map);
    }
    Ok(map)
}

/// Bisection of the plane: cells whose corners disagree are halved both ways, `levels` times; then the crossings of
/// the edges of the last cells, linear in ln |mu|.
fn refine<'a, const N: usize>(
    map: &Map,
    levels: u32,
    column: &(dyn Fn(f64) -> Result<Column<'a, N, COARSE>, Failure> + Sync),
    monitor: &dyn Monitor,
) -> Result<Vec<(f64, f64)>, Failure> {
    let (columns, rows) = (map.speeds_rpm.len(), map.depths_mm.len());
    if columns < 2 || rows < 2 {
        return Ok(Vec::new());
    }
    let unit = 1_usize << levels;
    let mut known: BTreeMap<(usize, usize), f64> = BTreeMap::new();
    for i in 0..columns {
        for j in 0..rows {
            known.insert((i * unit, j * unit), map.modulus[j * columns + i]);
        }
    }
    let place = |values: &[f64], at: usize| {
        let (index, part) = (at / unit, (at % unit) as f64 / unit as f64);
        if part > 0.0 { values[index] + part * (values[index + 1] - values[index]) } else { values[index] }
    };
    let mut size = unit;
    let mut cells: Vec<(usize, usize)> =
        (0..columns - 1).flat_map(|i| (0..rows - 1).map(move |j| (i * unit, j * unit))).collect();
    loop {
        let straddles = |&(i, j): &(usize, usize)| {
            let stable = |i, j| known.get(&(i, j)).is_some_and(|m| *m < 1.0);
            let first = stable(i, j);
            [(i + size, j), (i, j + size), (i + size, j + size)].iter().any(|&(p, q)| stable(p, q) != first)
        };
        cells.retain(straddles);
        if size == 1 {
            break;
        }
        let half = size / 2;
        let mut wanted: BTreeSet<(usize, usize)> = BTreeSet::new();
        let mut next = Vec::with_capacity(4 * cells.len());
        for &(i, j) in &cells {
            for (di, dj) in [(0, 0), (half, 0), (0, half), (half, half)] {
                next.push((i + di, j + dj));
            }
            for (di, dj) in [(half, 0), (0, half), (half, half), (size, half), (half, size)] {
                wanted.insert((i + di, j + dj));
            }
        }
        wanted.retain(|at| !known.contains_key(at));
        let mut by_speed: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (i, j) in wanted {
            by_speed.entry(i).or_default().push(j);
        }
        let work: Vec<(usize, Vec<usize>)> = by_speed.into_iter().collect();
        for chunk in work.chunks(16) {
            checkpoint(monitor)?;
            let found: Result<Vec<Vec<f64>>, Failure> = chunk
                .par_iter()
                .map(|(i, rows)| {
                    let column = column(place(&map.speeds_rpm, *i))?;
                    rows.iter().map(|&j| column.on_map(place(&map.depths_mm, j))).collect()
                })
                .collect();
            for ((i, rows), values) in chunk.iter().zip(found?) {
                known.extend(rows.iter().zip(values).map(|(&j, value)| ((*i, j), value)));
            }
        }
        cells = next;
        size = half;
    }
    let mut points: BTreeMap<(usize, usize, bool), (f64, f64)> = BTreeMap::new();
    for &(i, j) in &cells {
        for (p, q, along_speed) in [
            ((i, j), (i + 1, j), true),
            ((i, j + 1), (i + 1, j + 1), true),
            ((i, j), (i, j + 1), false),
            ((i + 1, j), (i + 1, j + 1), false),
        ] {
            let (a, b) = (known[&p].ln(), known[&q].ln());
            if (a < 0.0) != (b < 0.0) && (a - b).is_finite() {
                let share = a / (a - b);
                let between = |values: &[f64], from: usize, to: usize| {
                    let (from, to) = (place(values, from), place(values, to));
                    from + share * (to - from)
                };
                points.insert(
                    (p.0, p.1, along_speed),
                    (between(&map.speeds_rpm, p.0, q.0), between(&map.depths_mm, p.1, q.1)),
                );
            }
        }
    }
    Ok(points.into_values().collect())
}
