//! What the evaluation of roundness costs.

use precut_calc::calculator::{Calculator, Unwatched};
use precut_calc::num::roundness::{Grid, Section, circles, least_squares, minimum_zone};
use precut_calc::ring_roundness::evaluation::{Job, RoundnessEvaluation};
use serde_json::json;

use crate::measure::{Measured, cpu_time};

/// A ring of 150 mm radius, 50 µm off the axis: lobes, and a roughness that puts no contact where a formula would.
fn radii_mm(count: u32) -> Vec<f64> {
    let mut state = 1_u64;
    (0..count)
        .map(|k| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // The top 32 bits of a linear congruence, 0 to 1.
            let roughness = f64::from(u32::try_from(state >> 32).unwrap_or(0)) / f64::from(u32::MAX);
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(count);
            let lobes = 0.002 * (2.0 * angle).cos() + 0.005 * (3.0 * angle).cos() + 0.003 * (5.0 * angle + 0.3).cos();
            150.0 + 0.05 * angle.cos() + lobes + 0.002 * roughness
        })
        .collect()
}

fn ring(count: u32) -> Result<Section, String> {
    let angles = usize::try_from(count).map_err(|error| error.to_string())?;
    let grid = Grid::new(angles).map_err(|error| error.to_string())?;
    grid.section(&radii_mm(count)).map_err(|error| error.to_string())
}

/// The minimum zone with its proof, from the points alone: least-squares start included.
pub(crate) fn zone(count: u32) -> Result<Measured, String> {
    let section = ring(count)?;
    let certified = || {
        let start = least_squares(&section, &|| true).map_err(|error| error.to_string())?;
        minimum_zone(&section, start.circle.centre_mm, &|| true).map_err(|error| error.to_string())
    };
    if !certified()?.is_global {
        return Err("the zone is not certified".to_owned());
    }
    cpu_time(certified)
}

/// All four circles with their proofs.
pub(crate) fn four(count: u32) -> Result<Measured, String> {
    let section = ring(count)?;
    cpu_time(|| circles(&section, &|| true))
}

/// The whole answer of a job, each circle also of the profile read four times as densely.
pub(crate) fn answer(count: u32) -> Result<Measured, String> {
    let rows: Vec<_> = radii_mm(count)
        .iter()
        .zip(0_u32..)
        .map(|(radius, k)| json!({ "angle_deg": 360.0 * f64::from(k) / f64::from(count), "radius_mm": radius }))
        .collect();
    let mut job: Job = serde_json::from_value(json!({ "radii": rows })).map_err(|error| error.to_string())?;
    RoundnessEvaluation::fill(&mut job);
    cpu_time(|| RoundnessEvaluation::run(&job, &Unwatched))
}
