//! The shaft cut again along the path that is programmed, with forces, compliances, blank and tool that are not quite those
//! that the job states.

use std::borrow::Cow;
use std::ops::Range;

use crate::calculator::Failure;
use crate::diameters::{Draw, Parts, Places};

use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::Job;
use crate::deflection_compensation::model::regime::{Regime, Step};
use crate::deflection_compensation::model::stage::{Stage, line_of};
use crate::deflection_compensation::model::yielding::{Line, Radii};

const UM_PER_MM: f64 = 1e3;
/// Stations of all zones together, about.
const STATIONS: usize = 100;
/// Most stations of one zone, and least.
const OF_ZONE: [usize; 2] = [33, 5];

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
pub(in crate::deflection_compensation) struct Rehearsal<'a> {
    job: &'a Job,
    acting: &'a Acting,
    grid: Grid,
    places: Places,
    cuts: Vec<PlannedCut>,
}

impl<'a> Rehearsal<'a> {
    /// Of stages along the stations of the paths, with the command of every one; `None` where a path has gaps.
    pub(in crate::deflection_compensation) fn of(
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
        let places = Places { z_mm: grid.z_mm.clone(), zones };
        Ok(Some(Self { job, acting, grid, places, cuts }))
    }

    fn line<'l>(&self, cut: &'l PlannedCut, draw: &Draw) -> Result<Cow<'l, Line>, Failure> {
        let [load, weight] = draw.loads();
        #[allow(clippy::float_cmp)] // what is stated is stated exactly
        if !draw.changes_structure() && [load, weight] == [1.0; 2] {
            return Ok(Cow::Borrowed(&cut.line));
        }
        if !draw.changes_structure() {
            return Ok(Cow::Owned(cut.line.under(load, weight)));
        }
        let mut job = self.job.clone();
        draw.yield_in(&mut job.supports, &mut job.carriage);
        let mut acting = match &draw.effects {
            Some(effects) => Acting::of(effects, &job.conditions, job.cut.feed_direction),
            None => self.acting.clone(),
        };
        acting.structure.flexibility /= draw.youngs_modulus;
        let (_, mut line) = line_of(&job, &self.grid, &acting, &cut.regime, &cut.step, &cut.radii)?;
        line.widen_gaps(draw.rest_gap_mm);
        Ok(Cow::Owned(line.under(load, weight)))
    }
}

impl Parts for Rehearsal<'_> {
    fn places(&self) -> &Places {
        &self.places
    }

    /// Diameter errors of the part that is left, um; with the last cut's commanded diameter larger by `shift_um`.
    fn errors_um(&self, draw: &Draw, shift_um: f64) -> Result<Vec<f64>, Failure> {
        let Some(first) = self.cuts.first() else { return Ok(Vec::new()) };
        let added: Vec<[f64; 3]> = (0..first.radii.stock.len()).map(|place| draw.added_mm(place)).collect();
        let mut left: Vec<f64> =
            first.radii.stock.iter().zip(&added).map(|(stock, [_, of_stock, _])| stock + of_stock).collect();
        for (number, cut) in self.cuts.iter().enumerate() {
            let is_last = number + 1 == self.cuts.len();
            let aim_mm = if is_last { 0.5 * shift_um / UM_PER_MM } else { 0.0 };
            let line = self.line(cut, draw)?;
            let mut solver = line.solver();
            for (i, (left, command)) in left.iter_mut().zip(&cut.command_mm).enumerate() {
                if !cut.radii.is_idle(i) {
                    let command = command + added[i][0] + aim_mm;
                    *left -= solver.engage(i, *left, command, *left - cut.radii.target[i]).depth_mm();
                }
            }
        }
        let targets = self.cuts.last().map_or(&[][..], |last| &last.radii.target[..]);
        let error =
            |((r, target), [_, _, scatter]): ((&f64, &f64), &[f64; 3])| 2.0 * (r + scatter - target) * UM_PER_MM;
        Ok(left.iter().zip(targets).zip(&added).map(error).collect())
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
