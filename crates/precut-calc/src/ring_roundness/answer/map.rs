//! The analysis `setup_map`: the worst wave over the angles of tool and supports, in how many revolutions the best of them
//! come to a target, and, where that is asked, what the job's cut gives in every cell (`ring/7.3`).

use rayon::prelude::*;

use crate::calculator::{Failure, Message, checkpoint};
use crate::num::roundness::Grid;

use crate::ring_roundness::answer::output_settings::{CutCell, MapCell, MapOutcome};
use crate::ring_roundness::answer::picture;
use crate::ring_roundness::job::input::{DEFAULT_SAMPLES, Job, LongWave};
use crate::ring_roundness::job::input_ranges::MapRange;
use crate::ring_roundness::model::linear::{NEUTRAL, grows, worst_of};
use crate::ring_roundness::model::lobing::{Root, of_order};
use crate::ring_roundness::model::place::{Angles, Placed, touched_mm};
use crate::ring_roundness::model::scene::{Scene, mirrored_rad};
use crate::ring_roundness::model::simulate::{Share, or_none, side_by_side};
use crate::ring_roundness::model::stance::{Stance, TOOL_CLEARANCE_RAD};
use crate::ring_roundness::model::surface::{UM_PER_MM, roundness_um, unevaluable};
use crate::ring_roundness::model::turning::{Setting, turn};

/// Rows of the map between two looks at the monitor: some milliseconds each.
const ROWS_AT_ONCE: usize = 4;
/// Cells simulated between two looks at the monitor.
const CELLS_AT_ONCE: usize = 16;
/// Share of the map's progress that the theory takes.
const THEORY_SHARE: f64 = 0.2;
/// Fewest nodes of a simulated cell.
const LEAST_MAP_NODES: u32 = 720;
/// Most revolutions of a simulated cell.
const MOST_MAP_REVOLUTIONS: f64 = 5000.0;
/// Distance from the blank at the start, and least depth below it at the end, mm.
const CLEAR_MM: f64 = 0.01;
/// Share of the target that a simulated cell keeps to, for what the number of nodes does.
const SURELY: f64 = 0.95;
/// Cells that are looked at again in full before the mildest is named.
const CONFIRMED: usize = 20;
/// A wave of the blank below this is rounding, mm.
const NOTHING_MM: f64 = 1e-9;
/// Pictures of the cut that are shown while it is computed.
const PICTURES: usize = 40;

/// Worst root of a cell, and revolutions to the target.
type CellInTheory = (Option<Root>, Option<f64>);

/// Waves of the blank that must come down: order and the factor still allowed.
fn wanted(job: &Job, scene: &Scene) -> Result<Vec<(u32, f64)>, Failure> {
    let n = DEFAULT_SAMPLES as usize;
    let blank = scene.blank_mm(job, n).map_err(unevaluable)?;
    let spectrum = Grid::new(n)
        .and_then(|grid| grid.spectrum(&blank, job.setup_map.highest_order as usize))
        .map_err(unevaluable)?;
    let target_mm = job.setup_map.target_um / UM_PER_MM;
    let mut waves = Vec::new();
    for order in 2..=job.setup_map.highest_order {
        let height = spectrum.iter().find(|h| h.order == order as usize).map_or(0.0, |h| 2.0 * h.amplitude_mm);
        if height > target_mm.max(NOTHING_MM) {
            waves.push((order, target_mm / height));
        }
    }
    Ok(waves)
}

/// One cell: worst root, and revolutions to the target.
fn cell(scene: &Scene, angles: Angles, range: &MapRange, wanted: &[(u32, f64)]) -> CellInTheory {
    let copying = angles.copying();
    if nearest_support_rad(copying.delay_a_rad, copying.delay_b_rad) < TOOL_CLEARANCE_RAD {
        return (None, None);
    }
    let roots = scene.lobing(copying).near_neutral(1.5, f64::from(range.highest_order) + 0.5);
    let revolutions = wanted.iter().try_fold(0.0_f64, |most, (order, factor)| {
        match of_order(&roots, f64::from(*order)) {
            // Gone within a revolution.
            None => Some(most.max(1.0)),
            Some(root) if root.factor_per_revolution() < 1.0 - NEUTRAL => {
                Some(most.max(factor.ln() / (std::f64::consts::TAU * root.growth_per_rad)))
            }
            Some(_) => None,
        }
    });
    let worst = worst_of(&roots);
    // A wave that the blank does not have yet grows out of the feed all the same.
    (worst, revolutions.filter(|_| worst.is_none_or(|root| !grows(&root))))
}

/// Nodes of the simulations of a map: a filtered value is good to some nm with them.
fn map_nodes(filter: LongWave) -> u32 {
    filter.cutoff_upr().map_or(DEFAULT_SAMPLES, |cutoff| (8 * cutoff).next_multiple_of(4).max(LEAST_MAP_NODES))
}

/// The grid of a map, and what its cells are simulated with.
struct Mapper<'a> {
    job: &'a Job,
    scene: &'a Scene,
    blank: Vec<f64>,
    tool_angle_deg: Vec<f64>,
    support_half_angle_deg: Vec<f64>,
    share: Share<'a>,
}

impl Mapper<'_> {
    fn count(&self) -> usize {
        self.tool_angle_deg.len() * self.support_half_angle_deg.len()
    }

    /// Tool angle and support half angle of a cell, deg.
    fn at_deg(&self, cell: usize) -> (f64, f64) {
        let columns = self.tool_angle_deg.len();
        (self.tool_angle_deg[cell % columns], self.support_half_angle_deg[cell / columns])
    }

    fn angles(&self, cell: usize) -> Angles {
        let (tool, half) = self.at_deg(cell);
        // Seen in the mirror, the tool is on the other side.
        Angles { half_angle_rad: half.to_radians(), tool_rad: mirrored_rad(tool.to_radians(), self.scene.mirrored) }
    }

    fn report(&self, done: f64) {
        self.share.report(done, Message::new("stage_setup_map").with("percent", (100.0 * done).round()));
    }

    /// The job's setting with the give that the machine has at other angles.
    fn base(&self, angles: Angles) -> Setting {
        Setting { compliance_ratio: self.scene.softness.ratio(&angles.copying()), ..self.scene.setting.clone() }
    }

    /// A cut from just clear of the blank to the radius that `to_mm` gives of the radius lost per mm of feed.
    fn placed(&self, angles: Angles, to_mm: impl Fn(f64) -> f64) -> Option<Placed> {
        let (_, first_mm) = touched_mm(&self.blank, &angles.copying());
        let placed = |per_feed: f64| Placed::new(&self.base(angles), angles, first_mm + CLEAR_MM, to_mm(per_feed));
        // How the radius goes with the feed depends little on where it ends.
        placed(1.0).and_then(|guess| placed(guess.radius_per_feed))
    }

    /// Roundness after a cut, um; `None` where the ring falls through or its profile has no circles.
    fn cut_um(&self, setting: &Setting) -> Result<Option<f64>, Failure> {
        let watch = &mut |_: Option<&_>, _: &[f64]| checkpoint(self.share.monitor);
        let Some(turned) = or_none(turn::<Failure>(&self.blank, setting, watch))? else { return Ok(None) };
        Ok(or_none(roundness_um(&turned.radii_mm, self.job.filter, self.share.monitor))?
            .map(|(roundness_um, _)| roundness_um))
    }

    /// Simulates a cell with the revolutions of the theory after the last touch of the blank, and with twice as many: how
    /// many revolutions in all, where they reach the target, and the roundness.
    fn to_target(&self, angles: Angles, theory: f64) -> Result<Option<(Option<f64>, f64)>, Failure> {
        let (last_mm, _) = touched_mm(&self.blank, &angles.copying());
        let feed = self.scene.setting.feed_mm_per_rev;
        let mut found = None;
        for times in [1.0, 2.0] {
            let to_mm = |per_feed: f64| (last_mm - times * theory * feed * per_feed).min(last_mm - CLEAR_MM);
            let Some(placed) = self.placed(angles, to_mm) else { return Ok(None) };
            let revolutions = (placed.travel_mm / feed).ceil();
            if revolutions > MOST_MAP_REVOLUTIONS {
                break;
            }
            let Some(roundness_um) = self.cut_um(&placed.in_revolutions(revolutions))? else { return Ok(None) };
            if roundness_um <= SURELY * self.job.setup_map.target_um {
                return Ok(Some((Some(revolutions), roundness_um)));
            }
            found = Some((None, roundness_um));
        }
        Ok(found)
    }

    /// Roundness that the job's own feed, revolutions and spark-out give in a cell, from just clear of the blank, um.
    fn as_the_job_cuts_um(&self, angles: Angles) -> Result<Option<f64>, Failure> {
        let copying = angles.copying();
        if nearest_support_rad(copying.delay_a_rad, copying.delay_b_rad) < TOOL_CLEARANCE_RAD {
            return Ok(None);
        }
        let setting = &self.scene.setting;
        let (_, first_mm) = touched_mm(&self.blank, &copying);
        let travel_mm = setting.feed_mm_per_rev * setting.revolutions;
        let placed = self.placed(angles, |per_feed| first_mm + CLEAR_MM - travel_mm * per_feed);
        let Some(placed) = placed else { return Ok(None) };
        self.cut_um(&Setting { feed_mm_per_rev: setting.feed_mm_per_rev, ..placed.in_revolutions(setting.revolutions) })
    }

    /// The cells by the theory: worst root, and revolutions to the target.
    fn by_theory(&self, wanted: &[(u32, f64)]) -> Result<Vec<CellInTheory>, Failure> {
        let columns = self.tool_angle_deg.len();
        let rows: Vec<usize> = (0..self.support_half_angle_deg.len()).collect();
        let mut cells = Vec::with_capacity(self.count());
        for (done, some) in rows.chunks(ROWS_AT_ONCE).enumerate() {
            checkpoint(self.share.monitor)?;
            self.report(THEORY_SHARE * (done * ROWS_AT_ONCE) as f64 / rows.len() as f64);
            let row = |row: &usize| {
                let of = |i: usize| cell(self.scene, self.angles(row * columns + i), &self.job.setup_map, wanted);
                (0..columns).map(of).collect::<Vec<_>>()
            };
            cells.extend(some.par_iter().map(row).collect::<Vec<_>>().into_iter().flatten());
        }
        Ok(cells)
    }

    /// Every cell cut as the job cuts, in an order that shows the whole map early; with its picture on the way.
    fn cut_everywhere(&self, from: f64) -> Result<Vec<Option<f64>>, Failure> {
        let order = scattered(self.count());
        let mut roundness_um = vec![None; order.len()];
        let between = order.len().div_ceil(PICTURES).max(CELLS_AT_ONCE);
        let mut pictured = 0;
        for (done, some) in order.chunks(CELLS_AT_ONCE).enumerate() {
            checkpoint(self.share.monitor)?;
            let done = done * CELLS_AT_ONCE;
            self.report(from + (1.0 - from) * done as f64 / order.len() as f64);
            for (cell, um) in side_by_side(some, |&cell| Ok((cell, self.as_the_job_cuts_um(self.angles(cell))?)))? {
                roundness_um[cell] = um;
            }
            if done >= pictured + between {
                pictured = done;
                let angles = (&self.tool_angle_deg[..], &self.support_half_angle_deg[..]);
                self.share.monitor.interim(picture::cut_map_so_far(angles, &roundness_um));
            }
        }
        Ok(roundness_um)
    }
}

/// Rotation between tool and nearest support, rad.
fn nearest_support_rad(delay_a_rad: f64, delay_b_rad: f64) -> f64 {
    let near = |delay: f64| delay.min(std::f64::consts::TAU - delay);
    near(delay_a_rad).min(near(delay_b_rad))
}

/// The numbers below `count`, each once, neighbours far apart.
fn scattered(count: usize) -> Vec<usize> {
    fn common(a: usize, b: usize) -> usize {
        if b == 0 { a } else { common(b, a % b) }
    }
    // Near the golden section of the count, and prime to it.
    let mut step = (count * 382 / 1000).max(1);
    while common(step, count) > 1 {
        step += 1;
    }
    (0..count).map(|i| i * step % count).collect()
}

/// The map; rows side by side, in fixed order.
pub(in crate::ring_roundness) fn map(
    job: &Job,
    scene: &Scene,
    end: &Stance,
    share: Share<'_>,
) -> Result<MapOutcome, Failure> {
    let range = &job.setup_map;
    let spread = |from: f64, to: f64, count: u32| -> Vec<f64> {
        (0..count).map(|i| from + (to - from) * f64::from(i) / f64::from(count - 1)).collect()
    };
    let mapper = Mapper {
        job,
        scene,
        blank: scene.blank_mm(job, map_nodes(job.filter) as usize).map_err(unevaluable)?,
        tool_angle_deg: spread(range.tool_angle_from_deg, range.tool_angle_to_deg, range.tool_angles),
        support_half_angle_deg: spread(range.support_angle_from_deg, range.support_angle_to_deg, range.support_angles),
        share,
    };
    let wanted = wanted(job, scene)?;
    let cells = mapper.by_theory(&wanted)?;
    let mut candidates: Vec<(usize, f64)> =
        cells.iter().enumerate().filter_map(|(i, (_, revolutions))| Some((i, (*revolutions)?))).collect();
    candidates.sort_by(|p, q| p.1.total_cmp(&q.1).then(p.0.cmp(&q.0)));
    candidates.truncate(range.simulated_cells as usize);
    let cut_from = if range.cut_everywhere { 0.5 } else { 1.0 };
    let mut revolutions_to_target = vec![None; cells.len()];
    let mut simulated_roundness_um = vec![None; cells.len()];
    for (done, some) in candidates.chunks(CELLS_AT_ONCE).enumerate() {
        checkpoint(share.monitor)?;
        mapper
            .report(THEORY_SHARE + (cut_from - THEORY_SHARE) * (done * CELLS_AT_ONCE) as f64 / candidates.len() as f64);
        let of = |&(i, theory): &(usize, f64)| Ok((i, mapper.to_target(mapper.angles(i), theory)?));
        for (i, found) in side_by_side(some, of)? {
            if let Some((revolutions, roundness_um)) = found {
                (revolutions_to_target[i], simulated_roundness_um[i]) = (revolutions, Some(roundness_um));
            }
        }
    }
    let cut_roundness_um = if range.cut_everywhere { mapper.cut_everywhere(cut_from)? } else { Vec::new() };
    let here = cell(scene, Angles { half_angle_rad: end.half_angle_rad, tool_rad: end.tool_rad() }, range, &wanted);
    Ok(MapOutcome {
        worst_factor_per_revolution: cells.iter().map(worst).collect(),
        worst_lobes: cells.iter().map(|(root, _)| root.map(|root| root.lobes)).collect(),
        revolutions_to_target,
        simulated_roundness_um,
        best: mildest(&mapper, &cells),
        here: MapCell {
            tool_angle_deg: mirrored_rad(end.tool_rad(), scene.mirrored).to_degrees(),
            support_half_angle_deg: end.half_angle_rad.to_degrees(),
            worst_factor_per_revolution: worst(&here),
        },
        roundest: roundest(&mapper, &cut_roundness_um),
        cut_roundness_um,
        tool_angle_deg: mapper.tool_angle_deg,
        support_half_angle_deg: mapper.support_half_angle_deg,
    })
}

fn worst((root, _): &(Option<Root>, Option<f64>)) -> Option<f64> {
    root.map(|root| root.factor_per_revolution())
}

/// The cell whose worst wave decays most. There a root that the quick search missed would show: it needs the full one.
fn mildest(mapper: &Mapper<'_>, cells: &[(Option<Root>, Option<f64>)]) -> Option<MapCell> {
    let mut order: Vec<(usize, f64)> =
        cells.iter().enumerate().filter_map(|(i, cell)| Some((i, worst(cell)?))).collect();
    order.sort_by(|p, q| p.1.total_cmp(&q.1));
    let confirmed = |&(i, factor): &(usize, f64)| {
        let lobing = mapper.scene.lobing(mapper.angles(i).copying());
        let (roots, complete) = lobing.roots(1.5, f64::from(mapper.job.setup_map.highest_order) + 0.5);
        let full = worst_of(&roots).map_or(0.0, |root| root.factor_per_revolution());
        complete && full <= factor * (1.0 + NEUTRAL)
    };
    let (i, factor) = order.into_iter().take(CONFIRMED).find(confirmed)?;
    let (tool_angle_deg, support_half_angle_deg) = mapper.at_deg(i);
    Some(MapCell { tool_angle_deg, support_half_angle_deg, worst_factor_per_revolution: Some(factor) })
}

/// The cell that comes out roundest.
fn roundest(mapper: &Mapper<'_>, roundness_um: &[Option<f64>]) -> Option<CutCell> {
    let cut = roundness_um.iter().enumerate().filter_map(|(i, um)| Some((i, (*um)?)));
    let (i, roundness_um) = cut.min_by(|p, q| p.1.total_cmp(&q.1))?;
    let (tool_angle_deg, support_half_angle_deg) = mapper.at_deg(i);
    Some(CutCell { tool_angle_deg, support_half_angle_deg, roundness_um })
}
