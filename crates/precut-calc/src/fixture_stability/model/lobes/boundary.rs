//! The limit over the spindle speed.

use rayon::prelude::*;

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::holding::{Closed, Holding};

use super::{
    COARSE_DEPTH, COARSE_RESIDUAL, ChatterLimit, Column, Crossings, POINTS_PER_LOOK, Plane, Rules, SCAN, by_states,
};

/// Neighbours on the boundary that differ by more than this share are looked at more closely, so often at most.
const NEIGHBOURS: f64 = 0.05;
const ROUNDS: u32 = 3;

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
