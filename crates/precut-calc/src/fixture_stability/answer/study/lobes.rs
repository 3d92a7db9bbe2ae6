//! The lobe diagram.

use rayon::prelude::*;

use crate::calculator::{Failure, Message, checkpoint};
use crate::fixture_stability::answer::output::{LobeBoundary, LobeDiagram, LobeMap, SpeedLimit};
use crate::fixture_stability::answer::parts::plane_of;
use crate::fixture_stability::answer::picture::lobes_so_far;
use crate::fixture_stability::answer::speeds::{ForcedLimits, better_speeds, forced_limits};
use crate::fixture_stability::model::drive::DriveDepths;
use crate::fixture_stability::model::lobes::{ChatterLimit, Plane, boundary, map};
use crate::fixture_stability::model::zeroth::{at_speed, depth_mm};

use super::Study;

pub(super) fn lobes(study: &Study<'_>) -> Result<LobeDiagram, Failure> {
    let case = &study.case;
    let settings = &study.job.lobes;
    let working = case.working;
    let plane = plane_of(study.job, case, study.asked_mm);
    let monitor = study.monitor;
    let (from, share) = (0.4, if settings.map { 0.2 } else { 0.5 });
    let points = boundary(&study.rules, &case.holding, &case.cutting, &plane, monitor, &mut |part, points| {
        monitor.progress(from + share * part, Message::new("stage_boundary"));
        let known: Vec<_> = points.iter().map(|p| (p.spindle_rpm, p.crossings_mm.first().copied())).collect();
        monitor.interim(lobes_so_far(&known, None, working));
    })?;
    let known: Vec<_> = points.iter().map(|p| (p.spindle_rpm, p.crossings_mm.first().copied())).collect();
    let map = if settings.map {
        let full = map(
            &study.rules,
            &case.holding,
            &case.cutting,
            &plane,
            settings.refinement,
            monitor,
            &mut |part, so_far| {
                monitor.progress(0.6 + 0.3 * part, Message::new("stage_map"));
                monitor.interim(lobes_so_far(&known, Some(so_far), working));
            },
        )?;
        Some(LobeMap::of(full))
    } else {
        None
    };
    let boundary = beside(study, &plane, &points)?;
    let limits: Vec<SpeedLimit> = boundary
        .spindle_speed_rpm
        .iter()
        .enumerate()
        .map(|(i, &spindle_speed_rpm)| SpeedLimit {
            spindle_speed_rpm,
            depth_examined_mm: boundary.depth_examined_mm[i],
            chatter_mm: boundary.chatter_mm[i],
            amplitude_mm: boundary.amplitude_mm[i],
            movable_opens_mm: boundary.movable_opens_mm[i],
            fixed_opens_mm: boundary.fixed_opens_mm[i],
            slips_mm: boundary.slips_mm[i],
            drive_mm: study.drive_depths(spindle_speed_rpm).least_mm(),
        })
        .collect();
    let lowest = limits
        .iter()
        .filter_map(|limit| limit.chatter_mm.map(|depth| (depth, *limit)))
        .reduce(|best, next| if next.0 < best.0 { next } else { best })
        .map(|(_, limit)| whole_limit(study, limit))
        .transpose()?;
    let better_speeds = better_speeds(study, &limits, plane.most_mm)?;
    Ok(LobeDiagram { boundary, lowest, better_speeds, map })
}

/// The boundary with the other limits over the same speeds.
fn beside(
    study: &Study<'_>,
    plane: &Plane,
    points: &[crate::fixture_stability::model::lobes::BoundaryPoint],
) -> Result<LobeBoundary, Failure> {
    let case = &study.case;
    let factor = case.cutting.mean_factor();
    let one = |point: &crate::fixture_stability::model::lobes::BoundaryPoint| -> Result<(ForcedLimits, Option<f64>), Failure> {
        let kappa = at_speed(&case.holding, &case.cutting, point.spindle_rpm);
        let zeroth = kappa.map(|k| depth_mm(&case.cutting, factor, k, plane.feed_mm)).filter(|h| *h <= plane.most_mm);
        if !case.is_linear() {
            return Ok((ForcedLimits::default(), zeroth));
        }
        let limit_mm = point.crossings_mm.first().copied().unwrap_or(point.examined_mm);
        Ok((forced_limits(case, point.spindle_rpm, limit_mm, study.monitor)?, zeroth))
    };
    let mut rows = Vec::with_capacity(points.len());
    for (number, chunk) in points.chunks(32).enumerate() {
        checkpoint(study.monitor)?;
        let part: Result<Vec<_>, Failure> = chunk.par_iter().map(one).collect();
        rows.extend(part?);
        let done = ((number + 1) * 32).min(points.len()) as f64 / points.len().max(1) as f64;
        study.monitor.progress(0.9 + 0.09 * done, Message::new("stage_boundary"));
    }
    let column = |of: fn(&ForcedLimits) -> Option<f64>| rows.iter().map(|row| of(&row.0)).collect::<Vec<_>>();
    let drive: Vec<DriveDepths> = points.iter().map(|p| study.drive_depths(p.spindle_rpm)).collect();
    let shown = |depth: Option<f64>| depth.filter(|depth| *depth <= plane.most_mm);
    Ok(LobeBoundary {
        spindle_speed_rpm: points.iter().map(|p| p.spindle_rpm).collect(),
        depth_examined_mm: points.iter().map(|p| p.examined_mm).collect(),
        chatter_mm: points.iter().map(|p| p.limit().depth_mm).collect(),
        stable_again_mm: points.iter().map(|p| p.crossings_mm.get(1).copied()).collect(),
        amplitude_mm: column(|of| of.amplitude_mm),
        movable_opens_mm: column(|of| of.movable_opens_mm),
        fixed_opens_mm: column(|of| of.fixed_opens_mm),
        slips_mm: column(|of| of.slips_mm),
        power_mm: drive.iter().map(|of| shown(of.power_mm)).collect(),
        torque_mm: drive.iter().map(|of| shown(of.torque_mm)).collect(),
        zeroth_order_mm: rows.iter().map(|row| row.1).collect(),
    })
}

/// With the limits that the diagram does not trace where the forced motion does not go with H^(1-mu).
fn whole_limit(study: &Study<'_>, limit: SpeedLimit) -> Result<SpeedLimit, Failure> {
    if study.case.is_linear() {
        return Ok(limit);
    }
    let chatter = ChatterLimit { depth_mm: limit.chatter_mm, examined_mm: limit.depth_examined_mm };
    study.speed_limit(limit.spindle_speed_rpm, chatter)
}
