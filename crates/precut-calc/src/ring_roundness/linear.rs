//! The analyses `linear_theory` and `setup_map`.

use rayon::prelude::*;

use crate::calculator::{Failure, Message, Monitor, checkpoint};
use crate::num::roundness::Grid;

use super::input::{DEFAULT_SAMPLES, Job, LongWave, MapRange};
use super::lobing::{Lobing, Root, of_order};
use super::output::{Fate, LinearOutcome, MapCell, MapOutcome, OrderOutcome, RootOutcome};
use super::place::{Angles, Placed, touched_mm};
use super::scene::Scene;
use super::simulate::{Share, or_none, side_by_side};
use super::stance::{Copying, Stance, TOOL_CLEARANCE_RAD};
use super::surface::{UM_PER_MM, roundness_um, unevaluable};
use super::turning::turn;

/// A factor per revolution nearer to 1 than this stays: rounding of the angles makes about 1e-12, and a thousandth of a
/// degree in the setting 1e-5.
pub(super) const NEUTRAL: f64 = 1e-6;
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

/// Whether a wave grows.
pub(super) fn grows(root: &Root) -> bool {
    root.factor_per_revolution() > 1.0 + NEUTRAL
}

fn outcome(root: &Root) -> RootOutcome {
    RootOutcome { lobes: root.lobes, factor_per_revolution: root.factor_per_revolution() }
}

/// The equation of a job at the end of its feed.
pub(super) fn lobing(scene: &Scene, end: &Stance) -> Lobing {
    Lobing { copying: end.copying(), compliance_ratio: scene.setting.compliance_ratio }
}

/// Growth or decay of every order.
pub(super) fn theory(job: &Job, scene: &Scene, end: &Stance) -> LinearOutcome {
    let lobing = lobing(scene, end);
    let (roots, complete) = lobing.roots(0.5, f64::from(job.highest_order) + 0.45);
    let orders = (2..=job.highest_order)
        .map(|order| {
            let k = f64::from(order);
            let (visibility_real, visibility_imaginary) = lobing.visibility(k);
            let root = of_order(&roots, k);
            let fate = match &root {
                None => Fate::Gone,
                Some(root) if grows(root) => Fate::Grows,
                Some(root) if root.factor_per_revolution() > 1.0 - NEUTRAL => Fate::Stays,
                Some(_) => Fate::Decays,
            };
            OrderOutcome {
                order,
                visibility_real,
                visibility_imaginary,
                factor_per_revolution: root.map(|root| root.factor_per_revolution()),
                fate,
            }
        })
        .collect();
    LinearOutcome {
        orders,
        worst: worst_of(&roots).as_ref().map(outcome),
        roots: roots.iter().map(outcome).collect(),
        complete,
    }
}

/// The worst of the waves from 1.5 lobes on: one lobe is the eccentricity, which is no error.
pub(super) fn worst_of(roots: &[Root]) -> Option<Root> {
    roots.iter().filter(|root| root.lobes > 1.5).copied().max_by(|p, q| p.growth_per_rad.total_cmp(&q.growth_per_rad))
}

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
fn cell(
    half_angle_rad: f64,
    tool_rad: f64,
    compliance_ratio: f64,
    range: &MapRange,
    wanted: &[(u32, f64)],
) -> (Option<Root>, Option<f64>) {
    let copying = Copying::of_angles(half_angle_rad, tool_rad);
    let turn = std::f64::consts::TAU;
    let near = |delay: f64| delay.min(turn - delay);
    if near(copying.delay_a_rad).min(near(copying.delay_b_rad)) < TOOL_CLEARANCE_RAD {
        return (None, None);
    }
    let lobing = Lobing { copying, compliance_ratio };
    let roots = lobing.near_neutral(1.5, f64::from(range.highest_order) + 0.5);
    let revolutions = wanted.iter().try_fold(0.0_f64, |most, (order, factor)| {
        match of_order(&roots, f64::from(*order)) {
            // Gone within a revolution.
            None => Some(most.max(1.0)),
            Some(root) if root.factor_per_revolution() < 1.0 - NEUTRAL => {
                Some(most.max(factor.ln() / (turn * root.growth_per_rad)))
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

/// Simulates a cell with the revolutions of the theory after the last touch of the blank, and with twice as many: how many
/// revolutions in all, where they reach the target, and the roundness.
fn simulated(
    job: &Job,
    scene: &Scene,
    blank: &[f64],
    angles: Angles,
    theory: f64,
    monitor: &dyn Monitor,
) -> Result<Option<(Option<f64>, f64)>, Failure> {
    let copying = Copying::of_angles(angles.half_angle_rad, angles.tool_rad);
    let (last_mm, first_mm) = touched_mm(blank, &copying);
    let mut found = None;
    for times in [1.0, 2.0] {
        let feed = scene.setting.feed_mm_per_rev;
        let start_mm = first_mm + CLEAR_MM;
        // How the radius goes with the feed depends little on where it ends.
        let to_mm = |per_feed: f64| last_mm - times * theory * feed * per_feed;
        let placed =
            |per_feed: f64| Placed::new(&scene.setting, angles, start_mm, to_mm(per_feed).min(last_mm - CLEAR_MM));
        let Some(placed) = placed(1.0).and_then(|guess| placed(guess.radius_per_feed)) else { return Ok(None) };
        let revolutions = (placed.travel_mm / feed).ceil();
        if revolutions > MOST_MAP_REVOLUTIONS {
            break;
        }
        let setting = placed.in_revolutions(revolutions);
        let turned = or_none(turn::<Failure>(blank, &setting, &mut |_, _| checkpoint(monitor)))?;
        let Some(turned) = turned else { return Ok(None) };
        let Some((roundness_um, _)) = or_none(roundness_um(&turned.radii_mm, job.filter))? else { return Ok(None) };
        if roundness_um <= SURELY * job.setup_map.target_um {
            return Ok(Some((Some(revolutions), roundness_um)));
        }
        found = Some((None, roundness_um));
    }
    Ok(found)
}

/// The map; rows side by side, in fixed order.
pub(super) fn map(job: &Job, scene: &Scene, end: &Stance, share: Share<'_>) -> Result<MapOutcome, Failure> {
    let range = &job.setup_map;
    let spread = |from: f64, to: f64, count: u32| -> Vec<f64> {
        (0..count).map(|i| from + (to - from) * f64::from(i) / f64::from(count - 1)).collect()
    };
    let tool_angle_deg = spread(range.tool_angle_from_deg, range.tool_angle_to_deg, range.tool_angles);
    let support_half_angle_deg = spread(range.support_angle_from_deg, range.support_angle_to_deg, range.support_angles);
    let wanted = wanted(job, scene)?;
    let k = scene.setting.compliance_ratio;
    // Seen in the mirror, the tool is on the other side.
    let tool_rad = |deg: f64| super::scene::mirrored_rad(deg.to_radians(), scene.mirrored);
    let mut cells = Vec::new();
    for (done, rows) in support_half_angle_deg.chunks(ROWS_AT_ONCE).enumerate() {
        checkpoint(share.monitor)?;
        let share_done = THEORY_SHARE * (done * ROWS_AT_ONCE) as f64 / support_half_angle_deg.len() as f64;
        share.report(share_done, Message::new("stage_setup_map").with("percent", (100.0 * share_done).round()));
        let row = |beta: &f64| {
            let of = |tool: &f64| cell(beta.to_radians(), tool_rad(*tool), k, range, &wanted);
            tool_angle_deg.iter().map(of).collect::<Vec<_>>()
        };
        cells.extend(rows.par_iter().map(row).collect::<Vec<_>>().into_iter().flatten());
    }
    let tools = tool_angle_deg.len();
    let mut candidates: Vec<(usize, f64)> =
        cells.iter().enumerate().filter_map(|(i, (_, revolutions))| Some((i, (*revolutions)?))).collect();
    candidates.sort_by(|p, q| p.1.total_cmp(&q.1).then(p.0.cmp(&q.0)));
    candidates.truncate(range.simulated_cells as usize);
    let blank = scene.blank_mm(job, map_nodes(job.filter) as usize).map_err(unevaluable)?;
    let mut revolutions_to_target = vec![None; cells.len()];
    let mut simulated_roundness_um = vec![None; cells.len()];
    for (done, some) in candidates.chunks(CELLS_AT_ONCE).enumerate() {
        checkpoint(share.monitor)?;
        let share_done = THEORY_SHARE + (1.0 - THEORY_SHARE) * (done * CELLS_AT_ONCE) as f64 / candidates.len() as f64;
        share.report(share_done, Message::new("stage_setup_map").with("percent", (100.0 * share_done).round()));
        let of = |&(i, theory): &(usize, f64)| {
            let angles = Angles {
                half_angle_rad: support_half_angle_deg[i / tools].to_radians(),
                tool_rad: tool_rad(tool_angle_deg[i % tools]),
            };
            Ok((i, simulated(job, scene, &blank, angles, theory, share.monitor)?))
        };
        for (i, found) in side_by_side(some, of)? {
            if let Some((revolutions, roundness_um)) = found {
                (revolutions_to_target[i], simulated_roundness_um[i]) = (revolutions, Some(roundness_um));
            }
        }
    }
    let worst = |(root, _): &(Option<Root>, Option<f64>)| root.map(|root| root.factor_per_revolution());
    let at = |i: usize| MapCell {
        tool_angle_deg: tool_angle_deg[i % tool_angle_deg.len()],
        support_half_angle_deg: support_half_angle_deg[i / tool_angle_deg.len()],
        worst_factor_per_revolution: worst(&cells[i]),
    };
    let mut order: Vec<usize> = (0..cells.len()).filter(|i| worst(&cells[*i]).is_some()).collect();
    order.sort_by(|i, j| worst(&cells[*i]).unwrap_or(f64::MAX).total_cmp(&worst(&cells[*j]).unwrap_or(f64::MAX)));
    // The mildest cell is where a root that the quick search missed would show: it needs the full one.
    let confirmed = |i: &usize| {
        let cell = at(*i);
        let (beta, tool) = (cell.support_half_angle_deg.to_radians(), tool_rad(cell.tool_angle_deg));
        let lobing = Lobing { copying: Copying::of_angles(beta, tool), compliance_ratio: k };
        let (roots, complete) = lobing.roots(1.5, f64::from(range.highest_order) + 0.5);
        let full = worst_of(&roots).map_or(0.0, |root| root.factor_per_revolution());
        complete && full <= worst(&cells[*i]).unwrap_or(0.0) * (1.0 + NEUTRAL)
    };
    let best = order.into_iter().take(CONFIRMED).find(confirmed).map(at);
    let here = cell(end.half_angle_rad, end.tool_rad(), k, range, &wanted);
    let here = MapCell {
        tool_angle_deg: super::scene::mirrored_rad(end.tool_rad(), scene.mirrored).to_degrees(),
        support_half_angle_deg: end.half_angle_rad.to_degrees(),
        worst_factor_per_revolution: worst(&here),
    };
    Ok(MapOutcome {
        worst_factor_per_revolution: cells.iter().map(worst).collect(),
        worst_lobes: cells.iter().map(|(root, _)| root.map(|root| root.lobes)).collect(),
        revolutions_to_target,
        simulated_roundness_um,
        tool_angle_deg,
        support_half_angle_deg,
        best,
        here,
    })
}
