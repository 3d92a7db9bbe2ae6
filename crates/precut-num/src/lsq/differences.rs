//! Derivatives by differences, extrapolated (Romberg) over steps that halve.
//!
//! A step that suits one parameter does not suit another: what matters is over which change of the
//! parameter the model bends. So once (and again for the polish) every parameter is probed over fourteen
//! halvings of the step; of the neighbouring orders of extrapolation the step is kept where they agree best.
//! With eight points per column the derivative is then good to some 1e-13 of its size, with two to 1e-10.
//! Next to a bound the points lie on one side.

use super::Parameter;
use super::system::{Point, Quality, System};
use crate::dense::Columns;

/// Halvings of the step that are probed.
const LEVELS: usize = 14;
/// Largest step, as a share of the parameter's scale.
const WIDEST: f64 = 0.25;
/// Steps of the best derivative.
const BEST: usize = 4;
/// After so many sets of plain derivatives the steps are looked for anew.
const FRESH: u32 = 30;

#[derive(Debug, Default)]
pub(super) struct Differences {
    /// Per parameter: the finest level of the plain and of the best derivative.
    levels: Vec<Option<(usize, usize)>>,
    used: u32,
}

impl Differences {
    pub(super) fn new(parameters: &[Parameter]) -> Self {
        Self { levels: vec![None; parameters.len()], used: 0 }
    }

    /// Writes the derivatives of the data rows; `false` where the model is defined on neither side.
    pub(super) fn columns(
        &mut self,
        system: &mut System<'_>,
        point: &Point,
        quality: Quality,
        columns: &mut Columns,
    ) -> bool {
        self.used += 1;
        if self.used.is_multiple_of(FRESH) {
            self.levels.fill(None);
        }
        for j in 0..self.levels.len() {
            if system.parameters[j].lower >= system.parameters[j].upper {
                continue;
            }
            let Some(stencil) = Stencil::new(system, point, j) else { return false };
            let Some(column) = self.column(system, point, &stencil, quality) else { return false };
            let data = system.data_count();
            columns.column_mut(j)[..data].copy_from_slice(&column[..data]);
        }
        true
    }

    /// For the polish: look for the steps anew.
    pub(super) fn forget(&mut self) {
        self.levels.fill(None);
    }

    fn column(
        &mut self,
        system: &mut System<'_>,
        point: &Point,
        stencil: &Stencil,
        quality: Quality,
    ) -> Option<Vec<f64>> {
        if let Some((plain, best)) = self.levels[stencil.index] {
            let (finest, count) = if quality == Quality::Plain { (plain, 1) } else { (best, BEST) };
            let coarsest = (finest + 1).saturating_sub(count);
            let ladder: Vec<_> = (coarsest..=finest).map(|level| stencil.quotient(system, point, level)).collect();
            if let Some(ladder) = ladder.into_iter().collect::<Option<Vec<_>>>() {
                return Some(stencil.extrapolated(&ladder));
            }
        }
        // Probe.
        let ladder: Vec<Option<Vec<f64>>> = (0..LEVELS).map(|level| stencil.quotient(system, point, level)).collect();
        let plain = stencil.agreement(&ladder, 1)?;
        let best = stencil.agreement(&ladder, BEST - 1).or_else(|| stencil.agreement(&ladder, 1))?;
        self.levels[stencil.index] = Some((plain.finest, best.finest));
        Some(if quality == Quality::Plain { plain.value } else { best.value })
    }
}

/// A derivative and where it came from.
struct Agreement {
    finest: usize,
    value: Vec<f64>,
}

/// Where to take differences for one parameter.
struct Stencil {
    index: usize,
    widest: f64,
    /// +1 or -1 next to a bound, 0 where both sides are open.
    side: f64,
}

impl Stencil {
    fn new(system: &System<'_>, point: &Point, index: usize) -> Option<Self> {
        let parameter = &system.parameters[index];
        let value = point.at[index];
        let scale = system.scale(&point.at, index);
        let (below, above) = (value - parameter.lower, parameter.upper - value);
        let widest = WIDEST * scale;
        // Both sides unless a bound is so near that the steps would be lost in rounding.
        let near = 1e-3 * widest;
        let (widest, side) = if below.min(above) >= near {
            (widest.min(below).min(above), 0.0)
        } else if above >= below {
            (widest.min(above), 1.0)
        } else {
            (widest.min(below), -1.0)
        };
        (widest > 0.0).then_some(Self { index, widest, side })
    }

    /// Difference quotient with the step of a level; `None` where the model is not defined.
    fn quotient(&self, system: &mut System<'_>, point: &Point, level: usize) -> Option<Vec<f64>> {
        let step = self.widest * 0.5_f64.powi(i32::try_from(level).unwrap_or(i32::MAX));
        let value = point.at[self.index];
        let mut at = point.at.clone();
        let mut look = |to: f64| {
            at[self.index] = to;
            let raw = system.raw(&at);
            raw.iter().all(|r| r.is_finite()).then_some(raw)
        };
        // What was really added, after rounding.
        let (low, high, width) = if self.side == 0.0 {
            let (down, up) = (value - step, value + step);
            (look(down)?, look(up)?, up - down)
        } else {
            let to = value + self.side * step;
            let moved = look(to)?;
            if self.side > 0.0 {
                (point.raw.clone(), moved, to - value)
            } else {
                (moved, point.raw.clone(), value - to)
            }
        };
        (width > 0.0).then(|| low.iter().zip(&high).map(|(l, h)| (h - l) / width).collect())
    }

    /// Extrapolates quotients of steps that halve, coarsest first: central ones err in even powers of the step,
    /// one-sided ones in all.
    fn extrapolated(&self, ladder: &[Vec<f64>]) -> Vec<f64> {
        let mut table = ladder.to_vec();
        let base: f64 = if self.side == 0.0 { 4.0 } else { 2.0 };
        let mut power = 1.0;
        while table.len() > 1 {
            power *= base;
            table = table
                .windows(2)
                .map(|pair| {
                    pair[0].iter().zip(&pair[1]).map(|(coarse, fine)| fine + (fine - coarse) / (power - 1.0)).collect()
                })
                .collect();
        }
        table.pop().unwrap_or_default()
    }

    /// The level at which extrapolation over `count` steps and over one step more agree best; the value is that of
    /// more steps.
    fn agreement(&self, ladder: &[Option<Vec<f64>>], count: usize) -> Option<Agreement> {
        let mut best: Option<(f64, Agreement)> = None;
        for finest in count..ladder.len() {
            let steps: Option<Vec<Vec<f64>>> = ladder[finest - count..=finest].iter().cloned().collect();
            let Some(steps) = steps else { continue };
            let more = self.extrapolated(&steps);
            let fewer = self.extrapolated(&steps[1..]);
            let apart: f64 = more.iter().zip(&fewer).map(|(a, b)| (a - b) * (a - b)).sum();
            if apart.is_finite() && best.as_ref().is_none_or(|(least, _)| apart < *least) {
                best = Some((apart, Agreement { finest, value: more }));
            }
        }
        best.map(|(_, agreement)| agreement)
    }
}
