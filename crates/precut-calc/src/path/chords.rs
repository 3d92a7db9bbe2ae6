//! The polyline with the fewest chords within a tolerance.

use super::blocks::{Blocks, LEAF_BITS};
use crate::calculator::{Failure, Monitor, Unwatched, checkpoint};

/// Vertices searched between two looks at the monitor: a few milliseconds.
const VERTICES_PER_LOOK: usize = 4096;

/// Slopes of the lines through a vertex that pass all stations so far within the tolerance.
#[derive(Clone, Copy)]
struct Cone {
    least: f64,
    largest: f64,
}

impl Cone {
    const ALL: Self = Self { least: f64::NEG_INFINITY, largest: f64::INFINITY };

    fn is_empty(self) -> bool {
        self.least > self.largest
    }

    fn holds(self, slope: f64) -> bool {
        self.least <= slope && slope <= self.largest
    }
}

/// Stations that become the vertices of the polyline with the fewest chords whose radial distance
/// from the radii `r_mm` is at most `tolerance_mm` at each of the ascending stations `z_mm`:
/// `deflection/7`, simplification.
///
/// Shortest path by breadth-first search over the number of chords: a chord may be out of tolerance
/// to one station and within it again to a farther one, so that the farthest jump is not always
/// best. A level is searched from its farthest vertex back; blocks of stations that hold no target
/// are passed at the cost of two tangents to their hulls. The result is exact: the count is the
/// least one, up to a few units in the last place of the radii that are added to the tolerance.
/// About n log n steps for smooth profiles.
///
/// The first and the last station are always vertices; none come back for no stations. Only as many
/// stations count as both lists have. A negative tolerance counts as 0.
pub fn fewest_chords(z_mm: &[f64], r_mm: &[f64], tolerance_mm: f64) -> Vec<usize> {
    // Nobody cancels, so the fallback, every station a vertex, is never taken.
    fewest_chords_watched(z_mm, r_mm, tolerance_mm, &Unwatched).unwrap_or_else(|_| (0..z_mm.len()).collect())
}

/// [`fewest_chords`], given up with [`Failure::Cancelled`] once nobody waits for it any more.
pub fn fewest_chords_watched(
    z_mm: &[f64],
    r_mm: &[f64],
    tolerance_mm: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<usize>, Failure> {
    let count = z_mm.len().min(r_mm.len());
    if count <= 2 {
        return Ok((0..count).collect());
    }
    Search::new(&z_mm[..count], &r_mm[..count], tolerance_mm).run(monitor)
}

struct Search<'a> {
    z: &'a [f64],
    r: &'a [f64],
    tolerance: f64,
    blocks: Blocks,
    /// The vertex from which each station was first reached; itself where it was not yet.
    from: Vec<usize>,
}

impl<'a> Search<'a> {
    fn new(z: &'a [f64], r: &'a [f64], tolerance_mm: f64) -> Self {
        // Radii on a straight line are so only within their rounding.
        let size = r.iter().fold(0.0, |size: f64, radius| size.max(radius.abs()));
        let tolerance = tolerance_mm.max(0.0) * (1.0 + 4.0 * f64::EPSILON) + 16.0 * f64::EPSILON * size;
        Self { z, r, tolerance, blocks: Blocks::new(z, r), from: (0..z.len()).collect() }
    }

    fn run(mut self, monitor: &dyn Monitor) -> Result<Vec<usize>, Failure> {
        let last = self.z.len() - 1;
        self.blocks.visit(0);
        let mut level = vec![0];
        let mut next = Vec::new();
        let mut searched = 0_usize;
        while self.from[last] == last {
            // Every vertex reaches its neighbour, so no level is empty before the last station.
            level.sort_unstable();
            while let Some(vertex) = level.pop() {
                if searched.is_multiple_of(VERTICES_PER_LOOK) {
                    checkpoint(monitor)?;
                }
                searched += 1;
                self.search_from(vertex, &mut next);
                if self.from[last] != last {
                    break;
                }
            }
            level.clear();
            std::mem::swap(&mut level, &mut next);
        }
        Ok(self.vertices(last))
    }

    fn vertices(&self, last: usize) -> Vec<usize> {
        let mut vertices = vec![last];
        let mut vertex = last;
        while vertex > 0 {
            vertex = self.from[vertex];
            vertices.push(vertex);
        }
        vertices.reverse();
        vertices
    }

    /// Adds to `next` every station not reached before to which a chord from `vertex` is in tolerance.
    fn search_from(&mut self, vertex: usize, next: &mut Vec<usize>) {
        let mut cone = Cone::ALL;
        let mut station = vertex + 1;
        while station < self.z.len() && !cone.is_empty() {
            let passable = self.blocks.beginning_at(station).find(|&block| self.holds_no_target(vertex, cone, block));
            if let Some(block) = passable {
                cone = self.narrowed(vertex, cone, block);
                station = self.blocks.end(block);
            } else {
                let end = ((station >> LEAF_BITS) + 1) << LEAF_BITS;
                let end = end.min(self.z.len());
                cone = self.scan(vertex, cone, station..end, next);
                station = end;
            }
        }
    }

    fn slope(&self, vertex: usize, station: usize, shift: f64) -> f64 {
        (self.r[station] - self.r[vertex] + shift) / (self.z[station] - self.z[vertex])
    }

    /// Station by station.
    fn scan(&mut self, vertex: usize, mut cone: Cone, stations: std::ops::Range<usize>, next: &mut Vec<usize>) -> Cone {
        let (z, r, tolerance) = (self.z[vertex], self.r[vertex], self.tolerance);
        for station in stations {
            let per_length = 1.0 / (self.z[station] - z);
            let rise = self.r[station] - r;
            // The neighbour is always in reach, also where two stations coincide.
            let reaches = station == vertex + 1 || cone.holds(rise * per_length);
            if reaches && self.from[station] == station {
                self.from[station] = vertex;
                self.blocks.visit(station);
                next.push(station);
            }
            cone.least = cone.least.max((rise - tolerance) * per_length);
            cone.largest = cone.largest.min((rise + tolerance) * per_length);
            if cone.is_empty() {
                break;
            }
        }
        cone
    }

    /// Whether no station of the block can be reached for the first time.
    fn holds_no_target(&self, vertex: usize, cone: Cone, block: (usize, usize)) -> bool {
        if !self.blocks.has_unvisited(block) {
            return true;
        }
        let eye = (self.z[vertex], self.r[vertex]);
        let steepest = self.blocks.steepest(self.z, self.r, block, eye);
        if self.slope(vertex, steepest, 0.0) < cone.least {
            return true;
        }
        let flattest = self.blocks.flattest(self.z, self.r, block, eye);
        self.slope(vertex, flattest, 0.0) > cone.largest
    }

    /// The cone behind a whole block.
    fn narrowed(&self, vertex: usize, cone: Cone, block: (usize, usize)) -> Cone {
        let (z, r) = (self.z[vertex], self.r[vertex]);
        let steepest = self.blocks.steepest(self.z, self.r, block, (z, r + self.tolerance));
        let flattest = self.blocks.flattest(self.z, self.r, block, (z, r - self.tolerance));
        Cone {
            least: cone.least.max(self.slope(vertex, steepest, -self.tolerance)),
            largest: cone.largest.min(self.slope(vertex, flattest, self.tolerance)),
        }
    }
}
