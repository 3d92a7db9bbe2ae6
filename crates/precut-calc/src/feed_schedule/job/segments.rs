//! A course of cost per length cut into pieces of one level each, at the least total (`feed/8.3`).

use crate::calculator::{Failure, Monitor, checkpoint};

/// Points over stretches that no piece may cross.
#[derive(Debug, Clone)]
pub(in crate::feed_schedule) struct Grid {
    /// Ascending; a border of stretches occurs twice.
    pub z_mm: Vec<f64>,
    /// Zone of every point.
    pub zone: Vec<usize>,
    /// First point of every stretch, and the end.
    pub stretches: Vec<(usize, usize)>,
}

impl Grid {
    /// About `count` points over stretches (zone, from, to), by their length, ends included.
    pub(in crate::feed_schedule) fn new(stretches: &[(usize, f64, f64)], count: usize) -> Self {
        let total: f64 = stretches.iter().map(|(_, from, to)| to - from).sum();
        let mut grid = Self { z_mm: Vec::new(), zone: Vec::new(), stretches: Vec::new() };
        let cells = (count - 1) as f64;
        for &(zone, from, to) in stretches {
            let own = nearest(((to - from) / total * cells).max(1.0));
            let first = grid.z_mm.len();
            let step = (to - from) / own as f64;
            for k in 0..=own {
                grid.z_mm.push(if k == own { to } else { from + step * k as f64 });
                grid.zone.push(zone);
            }
            grid.stretches.push((first, grid.z_mm.len()));
        }
        grid
    }

    /// Whether a point begins a stretch: it has no cell with the one before.
    pub(in crate::feed_schedule) fn zone_break(&self, point: usize) -> bool {
        self.stretches.iter().any(|(first, _)| *first == point)
    }

    /// Whether two neighbouring points have no gap between them that is not cut.
    pub(in crate::feed_schedule) fn touches(&self, a: usize, b: usize) -> bool {
        !self.zone_break(b) || (self.z_mm[b] - self.z_mm[a]).abs() <= crate::feed_schedule::job::case::TOUCHING_MM
    }

    /// Integral of a density along all stretches, by the trapezoidal rule.
    pub(in crate::feed_schedule) fn integral(&self, density: &[f64]) -> f64 {
        self.stretches
            .iter()
            .map(|&(first, end)| {
                (first + 1..end)
                    .map(|k| 0.5 * (density[k - 1] + density[k]) * (self.z_mm[k] - self.z_mm[k - 1]))
                    .sum::<f64>()
            })
            .sum()
    }
}

/// The whole number nearest to a count of at most some thousand.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 1 and the grid's few thousand")]
fn nearest(count: f64) -> usize {
    count.round() as usize
}

/// A way to cut the course into so many pieces.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) struct Cut {
    pub segments: usize,
    pub cost: f64,
    /// First and last point of every piece.
    pub pieces: Vec<(usize, usize)>,
}

/// The cheapest cuts into 1, 2, ... `most` pieces, as far as the stretches allow; a piece costs its length times the
/// largest cost per length in it.
pub(in crate::feed_schedule) fn cut(
    grid: &Grid,
    cost: &[f64],
    most: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<Cut>, Failure> {
    let n = cost.len();
    // best[k][p]: least cost of all up to point p in k pieces; from[k][p]: where the last piece begins.
    let mut best: Vec<Vec<f64>> = vec![vec![f64::INFINITY; n]];
    let mut from: Vec<Vec<u32>> = vec![vec![0; n]];
    best[0][0] = 0.0;
    let starts: Vec<usize> = stretch_of(grid, n);
    for k in 1..=most {
        checkpoint(monitor)?;
        let previous = &best[k - 1];
        let (mut row, mut origin) = (vec![f64::INFINITY; n], vec![0_u32; n]);
        for p in 0..n {
            let first = starts[p];
            let mut largest = cost[p];
            let mut least = f64::INFINITY;
            let mut q = p;
            while q > first {
                q -= 1;
                largest = largest.max(cost[q]);
                let piece = (grid.z_mm[p] - grid.z_mm[q]) * largest;
                // The piece grows with every step back: past the best known there is nothing to gain.
                if piece >= least {
                    break;
                }
                let total = previous[q] + piece;
                if total < least {
                    least = total;
                    origin[p] = u32::try_from(q).unwrap_or(u32::MAX);
                }
            }
            row[p] = least;
        }
        // The next stretch begins where this one ends, at no cost.
        for &(_, end) in &grid.stretches {
            if end < n {
                row[end] = row[end - 1];
                origin[end] = u32::MAX;
            }
        }
        best.push(row);
        from.push(origin);
    }
    Ok((1..=most).filter(|&k| best[k][n - 1].is_finite()).map(|k| trace(&best, &from, k, n)).collect())
}

/// First point of the stretch of every point.
fn stretch_of(grid: &Grid, n: usize) -> Vec<usize> {
    let mut starts = vec![0; n];
    for &(first, end) in &grid.stretches {
        starts[first..end].fill(first);
    }
    starts
}

fn trace(best: &[Vec<f64>], from: &[Vec<u32>], segments: usize, n: usize) -> Cut {
    let (mut pieces, mut p) = (Vec::with_capacity(segments), n - 1);
    for k in (1..=segments).rev() {
        if from[k][p] == u32::MAX {
            p -= 1;
        }
        let q = from[k][p] as usize;
        pieces.push((q, p));
        p = q;
    }
    pieces.reverse();
    Cut { segments, cost: best[segments][n - 1], pieces }
}

/// Ends of the pieces, each once.
pub(in crate::feed_schedule) fn boundaries(grid: &Grid, cut: &Cut) -> Vec<f64> {
    let mut ends: Vec<f64> = Vec::with_capacity(cut.pieces.len() + 1);
    for &(a, b) in &cut.pieces {
        if ends.last().is_none_or(|last| (grid.z_mm[a] - last).abs() > crate::feed_schedule::job::case::TOUCHING_MM) {
            ends.push(grid.z_mm[a]);
        }
        ends.push(grid.z_mm[b]);
    }
    ends
}
