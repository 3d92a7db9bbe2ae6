//! Depths at which a cut is unstable: a set of intervals, each end with a bracket that holds for its error (`milling/4.17`).

use std::f64::consts::TAU;

use crate::calculator::{Failure, Monitor};

use super::map::Cut;
use super::multiplier::{Kind, Multiplier, Orders};

/// A step is not halved below this share of the depth looked at.
const FINEST: f64 = 0.002;
const ON_MAP_FINEST: f64 = 0.01;
/// A crossing is found to this share of itself, and told between ends this share to either side.
const FOUND: f64 = 1e-9;
const ON_MAP_FOUND: f64 = 1e-4;
const BRACKET: f64 = 4e-5;
/// Steps of a search.
const STEPS: u32 = 80;
/// A zero may hide where |ln|mu|| is below a step times so many of the slopes seen near it.
const SLOPES: f64 = 2.0;

/// A depth at which the leading multiplier passes the unit circle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// mm.
    pub depth_mm: f64,
    /// Whether it is unstable above.
    pub enters: bool,
    /// How.
    pub kind: Kind,
    /// The multiplier there.
    pub multiplier: Multiplier,
    /// Ends between which it lies, mm: on one the modulus with its error is below 1, on the other above.
    pub bracket_mm: [f64; 2],
    /// Whether both ends hold for the error.
    pub certified: bool,
}

/// A stretch of depths at which the cut is unstable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unstable {
    /// Where it begins; `None` at the least depth looked at.
    pub from: Option<Crossing>,
    /// Where it ends; `None` at the largest.
    pub to: Option<Crossing>,
}

/// How crossings are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// Up to this depth, mm.
    pub depth_max_mm: f64,
    /// Even steps; between them it is refined where a crossing may hide.
    pub steps: u32,
    /// Whether no crossing beyond the first is wanted.
    pub only_first: bool,
    /// Whether the accuracy of maps does: 1e-4 of the depth, not certified.
    pub on_map: bool,
}

/// What was seen over the depth.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scan {
    /// By depth.
    pub crossings: Vec<Crossing>,
    /// Depths that were looked at, mm, and ln |mu| there.
    pub curve: Vec<(f64, f64)>,
}

impl Scan {
    /// Of a cut that a closed form calls unstable from a depth on.
    pub fn from_limit(depth_mm: f64) -> Self {
        let multiplier = Multiplier { re: 0.0, im: 1.0, residual: 0.0 };
        let bracket_mm = [depth_mm; 2];
        let crossing = Crossing { depth_mm, enters: true, kind: Kind::Hopf, multiplier, bracket_mm, certified: false };
        Self { crossings: vec![crossing], curve: Vec::new() }
    }

    /// Depth at which it first becomes unstable, mm; 0 where it never was stable.
    pub fn first_mm(&self) -> Option<f64> {
        match self.crossings.first() {
            Some(first) if first.enters => Some(first.depth_mm),
            Some(_) => Some(0.0),
            None => self.curve.first().filter(|(_, growth)| *growth >= 0.0).map(|_| 0.0),
        }
    }
}

/// Looks for crossings of one cut over the depth.
pub fn scan(orders: &Orders, cut: &Cut<'_>, search: &Search, monitor: &dyn Monitor) -> Result<Scan, Failure> {
    let Search { depth_max_mm, steps, .. } = *search;
    let look = Look { orders, cut, monitor, on_map: search.on_map };
    let mut depths: Vec<f64> = (1..=steps).map(|k| depth_max_mm * f64::from(k) / f64::from(steps)).collect();
    depths.insert(0, 0.02 * depths[0]);
    depths.extend(helix_pitches(cut, depth_max_mm));
    depths.sort_by(f64::total_cmp);
    depths.dedup_by(|a, b| *a - *b < 1e-6 * depth_max_mm);
    let mut known: Vec<(f64, f64)> = Vec::with_capacity(depths.len());
    for depth in depths {
        let growth = look.growth(depth)?;
        known.push((depth, growth));
        // What lies beyond does not matter; an island before it may still hide.
        if search.only_first && growth >= 0.0 {
            break;
        }
    }
    let finest = if search.on_map { ON_MAP_FINEST } else { FINEST };
    refine(&look, &mut known, finest * depth_max_mm)?;
    let mut found = Vec::new();
    for pair in known.windows(2) {
        if (pair[0].1 < 0.0) != (pair[1].1 < 0.0) {
            found.push(look.crossing(pair[0], pair[1])?);
            if search.only_first {
                break;
            }
        }
    }
    Ok(Scan { crossings: found, curve: known })
}

/// The stretches that crossings bound.
pub fn unstable(crossings: &[Crossing]) -> Vec<Unstable> {
    let mut found: Vec<Unstable> = Vec::new();
    for crossing in crossings {
        match found.last_mut() {
            Some(last) if !crossing.enters && last.to.is_none() => last.to = Some(*crossing),
            _ if crossing.enters => found.push(Unstable { from: Some(*crossing), to: None }),
            _ => found.push(Unstable { from: None, to: Some(*crossing) }),
        }
    }
    found
}

/// Multiples of the helix pitch and their middles: flip lobes are islands between them.
fn helix_pitches(cut: &Cut<'_>, depth_max_mm: f64) -> Vec<f64> {
    let teeth = &cut.milling.teeth;
    let lag = teeth[0].lag_rad_per_mm.abs();
    if lag <= 0.0 || !cut.milling.has_one_helix() {
        return Vec::new();
    }
    let half = 0.5 * TAU / (teeth.len() as f64 * lag);
    // Of a fine pitch the even steps are as good.
    (1..=40).map(|k| half * f64::from(k)).filter(|depth| *depth < depth_max_mm).collect()
}

/// Halves steps in which the sign may change twice.
fn refine(look: &Look<'_>, known: &mut Vec<(f64, f64)>, finest_mm: f64) -> Result<(), Failure> {
    let mut at = 0;
    while at + 1 < known.len() {
        let (from, to) = (known[at], known[at + 1]);
        let step = to.0 - from.0;
        let slope = |a: (f64, f64), b: (f64, f64)| ((b.1 - a.1) / (b.0 - a.0)).abs();
        let mut steepest = slope(from, to);
        if at > 0 {
            steepest = steepest.max(slope(known[at - 1], from));
        }
        if at + 2 < known.len() {
            steepest = steepest.max(slope(to, known[at + 2]));
        }
        let same_side = (from.1 < 0.0) == (to.1 < 0.0);
        let may_hide = same_side && from.1.abs().min(to.1.abs()) < SLOPES * step * steepest;
        // Where it falls toward the far end and rises again beyond, the nearest point is what counts.
        if may_hide && step > 2.0 * finest_mm && turns(known, at) {
            let middle = 0.5 * (from.0 + to.0);
            known.insert(at + 1, (middle, look.growth(middle)?));
            at = at.saturating_sub(1);
        } else {
            at += 1;
        }
    }
    Ok(())
}

/// Whether the growth comes nearer to zero and turns in the step or beside it.
fn turns(known: &[(f64, f64)], at: usize) -> bool {
    let near = |k: usize| known[k].1.abs();
    let before = at == 0 || near(at) <= near(at - 1);
    let behind = at + 2 >= known.len() || near(at + 1) <= near(at + 2);
    before || behind
}

/// One cut at any depth.
struct Look<'a> {
    orders: &'a Orders,
    cut: &'a Cut<'a>,
    monitor: &'a dyn Monitor,
    on_map: bool,
}

impl Look<'_> {
    fn at(&self, depth_mm: f64) -> Cut<'_> {
        Cut { depth_mm, ..*self.cut }
    }

    fn multiplier(&self, depth_mm: f64) -> Result<Multiplier, Failure> {
        let cut = self.at(depth_mm);
        let found = if self.on_map {
            self.orders.on_map(&cut, self.monitor)?
        } else {
            self.orders.multiplier(&cut, self.monitor)?
        };
        found.ok_or(Failure::NotConverged { what: "multiplier", residual: f64::NAN, iterations: 0 })
    }

    fn growth(&self, depth_mm: f64) -> Result<f64, Failure> {
        Ok(self.multiplier(depth_mm)?.growth())
    }

    /// By the Illinois rule, inside the bracket only: the growth has kinks where pairs change places.
    fn crossing(&self, from: (f64, f64), to: (f64, f64)) -> Result<Crossing, Failure> {
        let (mut a, mut b) = (from, to);
        let enters = from.1 < 0.0;
        let mut last_was_a = None;
        let found = if self.on_map { ON_MAP_FOUND } else { FOUND };
        for _ in 0..STEPS {
            if (b.0 - a.0) <= found * b.0 {
                break;
            }
            let share = (a.1 / (a.1 - b.1)).clamp(1e-3, 1.0 - 1e-3);
            let depth = a.0 + share * (b.0 - a.0);
            let growth = self.growth(depth)?;
            if growth.abs() < 1e-3 * found {
                (a, b) = ((depth, growth), (depth, growth));
                break;
            }
            if (growth < 0.0) == (a.1 < 0.0) {
                a = (depth, growth);
                if last_was_a == Some(true) {
                    b.1 *= 0.5;
                }
                last_was_a = Some(true);
            } else {
                b = (depth, growth);
                if last_was_a == Some(false) {
                    a.1 *= 0.5;
                }
                last_was_a = Some(false);
            }
        }
        let depth_mm = if a.1.abs() < b.1.abs() { a.0 } else { b.0 };
        let multiplier = self.multiplier(depth_mm)?;
        let bracket_mm = [depth_mm * (1.0 - BRACKET), depth_mm * (1.0 + BRACKET)];
        let mut certified = !self.on_map;
        for (depth, is_above) in bracket_mm.into_iter().zip([false, true]).filter(|_| !self.on_map) {
            let held = self.orders.with_error(&self.at(depth), self.monitor)?.is_some_and(|(found, error)| {
                let modulus = found.modulus();
                if is_above == enters { modulus - error > 1.0 } else { modulus + error < 1.0 }
            });
            certified = certified && held;
        }
        Ok(Crossing { depth_mm, enters, kind: multiplier.kind(), multiplier, bracket_mm, certified })
    }
}
