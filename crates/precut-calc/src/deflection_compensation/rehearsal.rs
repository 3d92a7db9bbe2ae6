//! The shaft cut again along the path that is programmed, with forces, compliances, blank and tool that are not quite those
//! that the job states.

use std::borrow::Cow;
use std::ops::Range;

use crate::calculator::Failure;
use crate::shaft::elastic::ends;

use super::acting::Acting;
use super::grid::Grid;
use super::input::Job;
use super::model::{Line, Radii};
use super::regime::{Regime, Step};
use super::stage::{Stage, line_of};

const UM_PER_MM: f64 = 1e3;
/// Stations of all zones together, about.
const STATIONS: usize = 100;
/// Most stations of one zone, and least.
const OF_ZONE: [usize; 2] = [33, 5];

/// How what is cut with differs from what the job states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Draw {
    /// Factor on all cutting forces.
    pub force: f64,
    /// All compliances are divided by it.
    pub stiffness: f64,
    /// Factor on Young's modulus.
    pub youngs_modulus: f64,
    /// Factors on compliances.
    pub headstock: f64,
    pub tailstock: f64,
    pub rests: f64,
    pub carriage: f64,
    /// Added to the gaps of one-sided rests, mm.
    pub rest_gap_mm: f64,
    /// Added to the radius that the tool is set to, mm.
    pub tool_setting_mm: f64,
    /// Added to the radius of the blank, mm.
    pub stock_mm: f64,
    /// Added to the radius that is left, mm.
    pub scatter_mm: f64,
}

impl Draw {
    /// As the job states.
    pub(super) const STATED: Self = Self {
        force: 1.0,
        stiffness: 1.0,
        youngs_modulus: 1.0,
        headstock: 1.0,
        tailstock: 1.0,
        rests: 1.0,
        carriage: 1.0,
        rest_gap_mm: 0.0,
        tool_setting_mm: 0.0,
        stock_mm: 0.0,
        scatter_mm: 0.0,
    };

    /// Whether it differs by more than loads that are all multiplied by one number.
    #[allow(clippy::float_cmp)] // what is stated is stated exactly
    fn changes_structure(&self) -> bool {
        let Self { youngs_modulus, headstock, tailstock, rests, carriage, rest_gap_mm, .. } = *self;
        [youngs_modulus, headstock, tailstock, rests, carriage] != [1.0; 5] || rest_gap_mm != 0.0
    }
}

/// A cut of the job at some of its stations.
struct PlannedCut {
    regime: Regime,
    step: Step,
    /// The blank in it is that of the first cut; a later one is cut on what is left.
    radii: Radii,
    command_mm: Vec<f64>,
    line: Line,
}

/// All cuts of a job along the paths that are programmed.
pub(super) struct Rehearsal<'a> {
    job: &'a Job,
    acting: &'a Acting,
    grid: Grid,
    zones: Vec<Range<usize>>,
    cuts: Vec<PlannedCut>,
}

impl<'a> Rehearsal<'a> {
    /// Of stages along the stations of the paths, with the command of every one; `None` where a path has gaps.
    pub(super) fn of(
        job: &'a Job,
        acting: &'a Acting,
        fine: &Grid,
        stages: &[Stage],
        commands: &[Vec<Option<f64>>],
    ) -> Result<Option<Self>, Failure> {
        let (chosen, zones) = chosen(fine);
        let grid = fine.at(&chosen);
        let at = |values: &[f64]| chosen.iter().map(|&i| values[i]).collect::<Vec<f64>>();
        let mut cuts = Vec::new();
        for (stage, commands) in stages.iter().zip(commands) {
            // Where the tool does not come there is no command either, nor one needed.
            let command = |i: usize| if stage.radii.is_idle(i) { Some(stage.radii.target[i]) } else { commands[i] };
            let Some(command_mm) = chosen.iter().map(|&i| command(i)).collect::<Option<Vec<f64>>>() else {
                return Ok(None);
            };
            let idle = &stage.radii.idle;
            let radii = Radii {
                target: at(&stage.radii.target),
                stock: at(&stage.radii.stock),
                planned: Some(at(stage.radii.planned())),
                idle: if idle.is_empty() { Vec::new() } else { chosen.iter().map(|&i| idle[i]).collect() },
            };
            let (_, line) = line_of(job, &grid, acting, &stage.regime, &stage.step, &radii)?;
            cuts.push(PlannedCut { regime: stage.regime, step: stage.step, radii, command_mm, line });
        }
        Ok(Some(Self { job, acting, grid, zones, cuts }))
    }

    /// Stations at which errors are told, mm.
    pub(super) fn z_mm(&self) -> &[f64] {
        &self.grid.z_mm
    }

    /// Diameter errors of the part that is left, um; with the last cut's commanded diameter larger by `shift_um`.
    pub(super) fn errors_um(&self, draw: &Draw, shift_um: f64) -> Result<Vec<f64>, Failure> {
        let Some(first) = self.cuts.first() else { return Ok(Vec::new()) };
        let mut left: Vec<f64> = first.radii.stock.iter().map(|stock| stock + draw.stock_mm).collect();
        for (number, cut) in self.cuts.iter().enumerate() {
            let is_last = number + 1 == self.cuts.len();
            let aim_mm = if is_last { 0.5 * shift_um / UM_PER_MM } else { 0.0 };
            let line = self.line(cut, draw)?;
            let mut solver = line.solver();
            for (i, (left, command)) in left.iter_mut().zip(&cut.command_mm).enumerate() {
                if !cut.radii.is_idle(i) {
                    let command = command + draw.tool_setting_mm + aim_mm;
                    *left -= solver.engage(i, *left, command, *left - cut.radii.target[i]).depth_mm();
                }
            }
        }
        let targets = self.cuts.last().map_or(&[][..], |last| &last.radii.target[..]);
        Ok(left.iter().zip(targets).map(|(r, target)| 2.0 * (r + draw.scatter_mm - target) * UM_PER_MM).collect())
    }

    /// Largest and smallest error, between the stations, too: there by the parabola through three neighbours.
    pub(super) fn extremes_um(&self, errors_um: &[f64]) -> [f64; 2] {
        let mut most = [f64::NEG_INFINITY, f64::INFINITY];
        for zone in &self.zones {
            for (i, &error) in errors_um[zone.clone()].iter().enumerate() {
                most = [most[0].max(error), most[1].min(error)];
                let here = zone.start + i;
                if here > zone.start && here + 1 < zone.end {
                    let around = here - 1..here + 2;
                    if let Some(top) = top(&self.grid.z_mm[around.clone()], &errors_um[around]) {
                        most = [most[0].max(top), most[1].min(top)];
                    }
                }
            }
        }
        most
    }

    fn line<'l>(&self, cut: &'l PlannedCut, draw: &Draw) -> Result<Cow<'l, Line>, Failure> {
        if *draw == (Draw { tool_setting_mm: draw.tool_setting_mm, stock_mm: draw.stock_mm, ..Draw::STATED }) {
            return Ok(Cow::Borrowed(&cut.line));
        }
        // All compliances smaller by one factor move the shaft as loads that are smaller by it.
        let (load, weight) = (draw.force / draw.stiffness, 1.0 / draw.stiffness);
        if !draw.changes_structure() {
            return Ok(Cow::Owned(cut.line.under(load, weight)));
        }
        let mut job = self.job.clone();
        let (head, tail) = ends(&job.supports);
        for (i, support) in job.supports.iter_mut().enumerate() {
            let factor = if !support.carries() {
                draw.rests
            } else if Some(i) == head {
                draw.headstock
            } else if Some(i) == tail {
                draw.tailstock
            } else {
                1.0
            };
            support.yield_times(factor);
        }
        job.carriage.compliance_um_per_n *= draw.carriage;
        job.carriage.tangential_compliance_um_per_n *= draw.carriage;
        let mut acting = self.acting.clone();
        acting.structure.flexibility /= draw.youngs_modulus;
        let (_, mut line) = line_of(&job, &self.grid, &acting, &cut.regime, &cut.step, &cut.radii)?;
        line.widen_gaps(draw.rest_gap_mm);
        Ok(Cow::Owned(line.under(load, weight)))
    }
}

/// Some stations of every zone, evenly and with its ends, and where the zones lie among them.
fn chosen(fine: &Grid) -> (Vec<usize>, Vec<Range<usize>>) {
    let of_zone = (STATIONS / fine.zones.len().max(1)).clamp(OF_ZONE[1], OF_ZONE[0]);
    let (mut chosen, mut zones) = (Vec::new(), Vec::new());
    for zone in &fine.zones {
        let (first, count) = (chosen.len(), zone.end - zone.first);
        let steps = (of_zone - 1).min(count.saturating_sub(1)).max(1);
        chosen.extend((0..=steps).map(|step| zone.first + step * (count - 1) / steps));
        chosen.dedup();
        zones.push(first..chosen.len());
    }
    (chosen, zones)
}

/// The value at the top or bottom of the parabola through three points, where that lies within them.
fn top(z: &[f64], e: &[f64]) -> Option<f64> {
    let [z, e]: [[f64; 3]; 2] = [z.try_into().ok()?, e.try_into().ok()?];
    if (e[1] - e[0]) * (e[2] - e[1]) >= 0.0 {
        return None;
    }
    let (before, after) = (z[1] - z[0], z[2] - z[1]);
    let (left, right) = ((e[1] - e[0]) / before, (e[2] - e[1]) / after);
    let curvature = (right - left) / (before + after);
    let slope = (left * after + right * before) / (before + after);
    Some(e[1] - 0.25 * slope * slope / curvature)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_has_its_top() {
        let e = |z: f64| 7.0 - 0.5 * (z - 1.3).powi(2);
        let z = [0.0, 1.0, 2.5];
        assert!(top(&z, &z.map(e)).is_some_and(|top| (top - 7.0).abs() < 1e-12));
        assert_eq!(top(&z, &[1.0, 2.0, 3.0]), None);
    }
}
