//! The multiplier over speed and depth.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::holding::{Closed, Holding};

use super::{Block, COARSE, COARSE_RESIDUAL, Column, Plane, Rules, by_states};

/// Multiplier evaluations between two looks whether anybody still waits.
pub(super) const POINTS_PER_LOOK: usize = 256;

/// |mu| over speed and depth, row by row (a row is a depth; NaN where no forced motion is found about which to ask), and
/// points of the boundary where the map was refined.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::fixture_stability) struct Map {
    pub speeds_rpm: Vec<f64>,
    pub depths_mm: Vec<f64>,
    pub modulus: Vec<f64>,
    pub refined: Vec<(f64, f64)>,
}

pub(in crate::fixture_stability) fn map(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    plane: &Plane,
    refinement: u32,
    monitor: &dyn Monitor,
    shown: &mut dyn FnMut(f64, &Map),
) -> Result<Map, Failure> {
    by_states!(holding, map_of(rules, holding, cutting, plane, refinement, monitor, shown))
}

fn map_of<const N: usize>(
    rules: &Rules,
    holding: &Holding,
    cutting: &Cutting,
    plane: &Plane,
    refinement: u32,
    monitor: &dyn Monitor,
    shown: &mut dyn FnMut(f64, &Map),
) -> Result<Map, Failure> {
    let system = holding.system::<N>(Closed::BOTH);
    let last = plane.speeds.saturating_sub(1).max(1) as f64;
    let speeds_rpm: Vec<f64> = (0..plane.speeds).map(|i| plane.speed_rpm(i as f64 / last)).collect();
    let depths_mm: Vec<f64> = (1..=plane.depths).map(|i| plane.most_mm * i as f64 / plane.depths as f64).collect();
    let (columns, rows) = (speeds_rpm.len(), depths_mm.len());
    let mut map = Map { modulus: vec![0.0; columns * rows], refined: Vec::new(), speeds_rpm, depths_mm };
    // The exponentials of a speed are worth some points: at most so few blocks per column as a look allows.
    let height = rows.min(POINTS_PER_LOOK);
    let blocks: Vec<Block> = (0..columns)
        .flat_map(|column| {
            (0..rows).step_by(height).map(move |from| Block { column, rows: from..(from + height).min(rows) })
        })
        .collect();
    let per_chunk = (POINTS_PER_LOOK / height).max(4);
    let share = if refinement > 0 { 0.7 } else { 1.0 };
    for (number, chunk) in blocks.chunks(per_chunk).enumerate() {
        checkpoint(monitor)?;
        let found: Result<Vec<Vec<f64>>, Failure> = chunk
            .par_iter()
            .map(|block| {
                let working = plane.working(map.speeds_rpm[block.column]);
                let column = Column::new(&rules.coarse, &system, holding, cutting, working, COARSE_RESIDUAL, monitor)?;
                map.depths_mm[block.rows.clone()].iter().map(|&depth| column.on_map(depth)).collect()
            })
            .collect();
        for (block, values) in chunk.iter().zip(found?) {
            for (row, value) in block.rows.clone().zip(values) {
                map.modulus[row * columns + block.column] = value;
            }
        }
        shown(share * ((number + 1) * per_chunk).min(blocks.len()) as f64 / blocks.len() as f64, &map);
    }
    if refinement > 0 {
        let column = |spindle_rpm: f64| {
            Column::new(&rules.coarse, &system, holding, cutting, plane.working(spindle_rpm), COARSE_RESIDUAL, monitor)
        };
        map.refined = refine(&map, refinement, &column, monitor)?;
        shown(1.0, &map);
    }
    Ok(map)
}

/// Bisection of the plane: cells whose corners disagree are halved both ways, `levels` times; then the crossings of
/// the edges of the last cells, linear in ln |mu|.
fn refine<'a, const N: usize>(
    map: &Map,
    levels: u32,
    column: &(dyn Fn(f64) -> Result<Column<'a, N, COARSE>, Failure> + Sync),
    monitor: &dyn Monitor,
) -> Result<Vec<(f64, f64)>, Failure> {
    let (columns, rows) = (map.speeds_rpm.len(), map.depths_mm.len());
    if columns < 2 || rows < 2 {
        return Ok(Vec::new());
    }
    let unit = 1_usize << levels;
    let mut known: BTreeMap<(usize, usize), f64> = BTreeMap::new();
    for i in 0..columns {
        for j in 0..rows {
            known.insert((i * unit, j * unit), map.modulus[j * columns + i]);
        }
    }
    let place = |values: &[f64], at: usize| {
        let (index, part) = (at / unit, (at % unit) as f64 / unit as f64);
        if part > 0.0 { values[index] + part * (values[index + 1] - values[index]) } else { values[index] }
    };
    let mut size = unit;
    let mut cells: Vec<(usize, usize)> =
        (0..columns - 1).flat_map(|i| (0..rows - 1).map(move |j| (i * unit, j * unit))).collect();
    loop {
        let straddles = |&(i, j): &(usize, usize)| {
            let stable = |i, j| known.get(&(i, j)).is_some_and(|m| *m < 1.0);
            let first = stable(i, j);
            [(i + size, j), (i, j + size), (i + size, j + size)].iter().any(|&(p, q)| stable(p, q) != first)
        };
        cells.retain(straddles);
        if size == 1 {
            break;
        }
        let half = size / 2;
        let mut wanted: BTreeSet<(usize, usize)> = BTreeSet::new();
        let mut next = Vec::with_capacity(4 * cells.len());
        for &(i, j) in &cells {
            for (di, dj) in [(0, 0), (half, 0), (0, half), (half, half)] {
                next.push((i + di, j + dj));
            }
            for (di, dj) in [(half, 0), (0, half), (half, half), (size, half), (half, size)] {
                wanted.insert((i + di, j + dj));
            }
        }
        wanted.retain(|at| !known.contains_key(at));
        let mut by_speed: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (i, j) in wanted {
            by_speed.entry(i).or_default().push(j);
        }
        let work: Vec<(usize, Vec<usize>)> = by_speed.into_iter().collect();
        for chunk in work.chunks(16) {
            checkpoint(monitor)?;
            let found: Result<Vec<Vec<f64>>, Failure> = chunk
                .par_iter()
                .map(|(i, rows)| {
                    let column = column(place(&map.speeds_rpm, *i))?;
                    rows.iter().map(|&j| column.on_map(place(&map.depths_mm, j))).collect()
                })
                .collect();
            for ((i, rows), values) in chunk.iter().zip(found?) {
                known.extend(rows.iter().zip(values).map(|(&j, value)| ((*i, j), value)));
            }
        }
        cells = next;
        size = half;
    }
    let mut points: BTreeMap<(usize, usize, bool), (f64, f64)> = BTreeMap::new();
    for &(i, j) in &cells {
        for (p, q, along_speed) in [
            ((i, j), (i + 1, j), true),
            ((i, j + 1), (i + 1, j + 1), true),
            ((i, j), (i, j + 1), false),
            ((i + 1, j), (i + 1, j + 1), false),
        ] {
            let (a, b) = (known[&p].ln(), known[&q].ln());
            if (a < 0.0) != (b < 0.0) && (a - b).is_finite() {
                let share = a / (a - b);
                let between = |values: &[f64], from: usize, to: usize| {
                    let (from, to) = (place(values, from), place(values, to));
                    from + share * (to - from)
                };
                points.insert(
                    (p.0, p.1, along_speed),
                    (between(&map.speeds_rpm, p.0, q.0), between(&map.depths_mm, p.1, q.1)),
                );
            }
        }
    }
    Ok(points.into_values().collect())
}
