//! Limits over the spindle speed: the boundary with its islands, and the multiplier over the plane.

use rayon::prelude::*;

use crate::calculator::{Failure, Message, checkpoint};

use super::super::job::{Held, range_rpm};
use super::super::model::MOST_OSCILLATIONS;
use super::super::model::{Cut, Rotation, Scan, Search, scan};
use super::clamping::yields;
use super::output::{LobeIntervals, MillingBoundary, MillingClampMap, MillingLobes, MillingMap, SpeedStatus};
use super::{Study, intervals};

/// Speeds or columns between two looks whether anybody still waits; every multiplier looks for itself besides.
const PER_LOOK: usize = 16;
/// Speeds and depths of the map of the clamp force at most: every place takes a forced motion and its loads.
pub(in crate::milling_stability) const CLAMP_MAP_SPEEDS: u32 = 24;
pub(in crate::milling_stability) const CLAMP_MAP_DEPTHS: u32 = 10;
/// Neighbours on the boundary that differ by more than this share are looked at more closely, so often at most.
const NEIGHBOURS: f64 = 0.08;
const ROUNDS: u32 = 2;
/// Progress at which the boundary begins, is traced, and the map is filled.
const BEGUN: f64 = 0.45;
const TRACED: f64 = 0.6;
const FILLED: f64 = 0.78;

/// A speed that was looked at.
#[derive(Debug, Clone)]
pub(super) struct Row {
    pub spindle_rpm: f64,
    pub status: SpeedStatus,
    pub scan: Scan,
}

impl Row {
    pub(super) fn limit_mm(&self) -> Option<f64> {
        self.scan.first_mm()
    }
}

/// The spindle at a speed, unless it is not answered.
pub(super) fn rotation_at(study: &Study<'_>, spindle_rpm: f64) -> Result<Rotation, SpeedStatus> {
    let rotation = study.case.at_speed(spindle_rpm).ok_or(SpeedStatus::Incommensurate)?;
    let cut = Cut { rotation, ..study.cut() };
    let is_told = cut.oscillations() <= MOST_OSCILLATIONS || (cut.is_slow() && cut.repeats());
    if is_told { Ok(rotation) } else { Err(SpeedStatus::TooSlow) }
}

/// One speed, to the accuracy of maps.
pub(super) fn row(study: &Study<'_>, spindle_rpm: f64) -> Result<Row, Failure> {
    let rotation = match rotation_at(study, spindle_rpm) {
        Ok(rotation) => rotation,
        Err(status) => return Ok(Row { spindle_rpm, status, scan: Scan::default() }),
    };
    let cut = Cut { rotation, ..study.cut() };
    if cut.is_slow() {
        let scan = study.slow_limit(&cut)?.map_or_else(Scan::default, |limit| Scan::from_limit(limit.depth_mm));
        return Ok(Row { spindle_rpm, status: SpeedStatus::Answered, scan });
    }
    let search =
        Search { depth_max_mm: study.examined_mm, steps: study.job.limits.depths, only_first: false, on_map: true };
    let scan = scan(&study.orders, &cut, &search, study.monitor)?;
    Ok(Row { spindle_rpm, status: SpeedStatus::Answered, scan })
}

/// Even speeds, and more where neighbours differ.
pub(super) fn rows(study: &Study<'_>) -> Result<Vec<Row>, Failure> {
    let (from_rpm, to_rpm) = range_rpm(study.job, study.case.rotation.spindle_rpm);
    let count = study.job.lobes.speeds;
    let at = |k: u32| from_rpm + (to_rpm - from_rpm) * f64::from(k) / f64::from(count - 1);
    let mut wanted: Vec<f64> = (0..count).map(at).collect();
    let mut found: Vec<Row> = Vec::new();
    for round in 0..=ROUNDS {
        let all = wanted.len() as f64;
        for (done, speeds) in wanted.chunks(PER_LOOK).enumerate() {
            checkpoint(study.monitor)?;
            let part = (f64::from(round) + (done * PER_LOOK) as f64 / all) / f64::from(ROUNDS + 1);
            study.monitor.progress(BEGUN + (TRACED - BEGUN) * part, Message::new("stage_boundary"));
            let more: Result<Vec<Row>, Failure> = speeds.par_iter().map(|&speed| row(study, speed)).collect();
            found.extend(more?);
        }
        found.sort_by(|a, b| a.spindle_rpm.total_cmp(&b.spindle_rpm));
        wanted = found
            .windows(2)
            .filter(|pair| differ(&pair[0], &pair[1]))
            .map(|pair| 0.5 * (pair[0].spindle_rpm + pair[1].spindle_rpm))
            .collect();
        if wanted.is_empty() || round == ROUNDS {
            break;
        }
    }
    Ok(found)
}

/// Whether the limit changes too much between neighbours for a straight line.
fn differ(a: &Row, b: &Row) -> bool {
    if a.status != SpeedStatus::Answered || b.status != SpeedStatus::Answered {
        return false;
    }
    match (a.limit_mm(), b.limit_mm()) {
        (Some(p), Some(q)) => (p - q).abs() > NEIGHBOURS * p.min(q),
        (None, None) => false,
        _ => true,
    }
}

/// Where a crossing was first met by the accurate search, for a speed that is told.
pub(super) fn first_mm(study: &Study<'_>, rotation: Rotation) -> Result<Option<f64>, Failure> {
    study.first_limit_mm(&Cut { rotation, ..study.cut() })
}

pub(super) fn lobes(study: &Study<'_>, rows: &[Row]) -> Result<MillingLobes, Failure> {
    let map = if study.job.lobes.map { Some(map(study)?) } else { None };
    let clamp_map = match &study.held {
        Some(held) if study.job.lobes.map => Some(clamp_map(study, held)?),
        _ => None,
    };
    let mut boundary = MillingBoundary::default();
    let mut stretches = LobeIntervals::default();
    for row in rows {
        let [power, torque] = study.drive_depths_mm(row.spindle_rpm);
        boundary.spindle_speed_rpm.push(row.spindle_rpm);
        boundary.chatter_mm.push(row.limit_mm());
        boundary.power_mm.push(power);
        boundary.torque_mm.push(torque);
        boundary.status.push(row.status);
        for stretch in intervals(&row.scan) {
            stretches.spindle_speed_rpm.push(row.spindle_rpm);
            stretches.from_mm.push(stretch.from_mm.unwrap_or(0.0));
            stretches.to_mm.push(stretch.to_mm);
            stretches.kind.push(stretch.kind);
        }
    }
    Ok(MillingLobes { boundary, intervals: stretches, map, clamp_map, examined_to_mm: study.examined_mm })
}

/// Even speeds and depths of the plane, so many of each.
fn places(study: &Study<'_>, speeds: u32, depths: u32) -> (Vec<f64>, Vec<f64>) {
    let (from_rpm, to_rpm) = range_rpm(study.job, study.case.rotation.spindle_rpm);
    let speed = |k: u32| from_rpm + (to_rpm - from_rpm) * f64::from(k) / f64::from(speeds - 1);
    let depth = |k: u32| study.examined_mm * f64::from(k) / f64::from(depths);
    ((0..speeds).map(speed).collect(), (1..=depths).map(depth).collect())
}

/// What cuts ask of the clamping.
fn clamp_map(study: &Study<'_>, held: &Held) -> Result<MillingClampMap, Failure> {
    let plane = &study.job.lobes;
    let (speeds, depths) = places(study, plane.speeds.min(CLAMP_MAP_SPEEDS), plane.depths.min(CLAMP_MAP_DEPTHS));
    let still: Vec<[Option<f64>; 2]> =
        depths.par_iter().map(|&depth_mm| study.static_clamp_n(held, depth_mm)).collect::<Result<_, Failure>>()?;
    let all: Vec<(usize, f64)> = (0..depths.len()).flat_map(|row| speeds.iter().map(move |&rpm| (row, rpm))).collect();
    let at = |&(row, spindle_rpm): &(usize, f64)| -> Result<Option<f64>, Failure> {
        let Ok(rotation) = rotation_at(study, spindle_rpm) else { return Ok(None) };
        let cut = Cut { rotation, depth_mm: depths[row], ..study.cut() };
        let chatters = study.orders.on_map(&cut, study.monitor)?.is_none_or(|found| found.modulus() >= 1.0);
        match (chatters, yields(&cut)) {
            (true, _) => Ok(None),
            // What does not yield carries the static force.
            (false, false) => Ok(still[row][0]),
            (false, true) => Ok(study.clamp_asked_n(held, &cut)?.map(|force| force.max(0.0))),
        }
    };
    let mut clamp_force_n = Vec::with_capacity(all.len());
    for chunk in all.chunks(PER_LOOK) {
        checkpoint(study.monitor)?;
        clamp_force_n.extend(chunk.par_iter().map(at).collect::<Result<Vec<_>, Failure>>()?);
    }
    let [static_n, mean_n] = [0, 1].map(|which| still.iter().map(|both| both[which]).collect());
    Ok(MillingClampMap { spindle_speed_rpm: speeds, depth_mm: depths, clamp_force_n, static_n, mean_n })
}

fn map(study: &Study<'_>) -> Result<MillingMap, Failure> {
    let plane = &study.job.lobes;
    let (speeds, depths) = places(study, plane.speeds, plane.depths);
    let mut columns: Vec<Vec<Option<f64>>> = Vec::with_capacity(speeds.len());
    for chunk in speeds.chunks(PER_LOOK) {
        checkpoint(study.monitor)?;
        let part = columns.len() as f64 / speeds.len() as f64;
        study.monitor.progress(TRACED + (FILLED - TRACED) * part, Message::new("stage_map"));
        let more: Result<Vec<_>, Failure> = chunk.par_iter().map(|&speed| column(study, speed, &depths)).collect();
        columns.extend(more?);
    }
    let per_tooth = (0..depths.len()).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
    Ok(MillingMap { spindle_speed_rpm: speeds, depth_mm: depths, per_tooth })
}

fn column(study: &Study<'_>, spindle_rpm: f64, depths_mm: &[f64]) -> Result<Vec<Option<f64>>, Failure> {
    let Ok(rotation) = rotation_at(study, spindle_rpm) else { return Ok(vec![None; depths_mm.len()]) };
    let teeth = study.teeth_per_period(&rotation);
    let at = |&depth_mm: &f64| {
        let cut = Cut { rotation, depth_mm, ..study.cut() };
        Ok(study.orders.on_map(&cut, study.monitor)?.map(|found| (found.growth() / teeth).exp()))
    };
    depths_mm.iter().map(at).collect()
}
