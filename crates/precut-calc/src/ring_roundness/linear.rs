//! The analyses `linear_theory` and `setup_map`.

use rayon::prelude::*;

use crate::calculator::{Failure, Message, checkpoint};
use crate::num::roundness::Grid;

use super::input::{Job, MapRange};
use super::lobing::{Lobing, Root, of_order};
use super::output::{Fate, LinearOutcome, MapCell, MapOutcome, OrderOutcome, RootOutcome};
use super::scene::Scene;
use super::simulate::Share;
use super::stance::{Copying, Stance, TOOL_CLEARANCE_RAD};
use super::surface::{UM_PER_MM, unevaluable};

/// A factor per revolution nearer to 1 than this stays: rounding of the angles makes about 1e-12, and a thousandth of a
/// degree in the setting 1e-5.
pub(super) const NEUTRAL: f64 = 1e-6;
/// Rows of the map between two looks at the monitor: some milliseconds each.
const ROWS_AT_ONCE: usize = 4;
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
    let n = super::input::DEFAULT_SAMPLES as usize;
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
    (worst_of(&roots), revolutions)
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
        let share_done = (done * ROWS_AT_ONCE) as f64 / support_half_angle_deg.len() as f64;
        share.report(share_done, Message::new("stage_setup_map").with("percent", (100.0 * share_done).round()));
        let row = |beta: &f64| {
            let of = |tool: &f64| cell(beta.to_radians(), tool_rad(*tool), k, range, &wanted);
            tool_angle_deg.iter().map(of).collect::<Vec<_>>()
        };
        cells.extend(rows.par_iter().map(row).collect::<Vec<_>>().into_iter().flatten());
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
        revolutions_to_target: cells.iter().map(|(_, revolutions)| *revolutions).collect(),
        tool_angle_deg,
        support_half_angle_deg,
        best,
        here,
    })
}
