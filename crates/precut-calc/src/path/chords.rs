//! The polyline with the fewest chords within a tolerance.

use super::blocks::{Blocks, LEAF_BITS};
use crate::calculator::{Failure, Monitor, Unwatched, checkpoint};

/// Vertices searched between two looks at the monitor: a few milliseconds.
const VERTICES_PER_LOOK: usize = 4096;

/// Slopes of the lines through a vertex that pass all stations so far within the tolerance, and the two stations that
/// bound them.
#[derive(Clone, Copy)]
struct Cone {
    least: f64,
    largest: f64,
    bounds: [usize; 2],
}

impl Cone {
    const ALL: Self = Self { least: f64::NEG_INFINITY, largest: f64::INFINITY, bounds: [0; 2] };

    fn is_empty(self) -> bool {
        self.least > self.largest
    }

    /// With the slopes at a station no less than this. A slope that is no number bounds nothing.
    fn raise(&mut self, least: f64, station: usize) {
        if least > self.least {
            (self.least, self.bounds[0]) = (least, station);
        }
    }

    /// With the slopes at a station no larger than this.
    fn lower(&mut self, largest: f64, station: usize) {
        if largest < self.largest {
            (self.largest, self.bounds[1]) = (largest, station);
        }
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
/// are passed at the cost of two tangents to their hulls. The two stations that stopped one vertex mostly
/// stop the next one, too, before anything that is new: only what they leave is searched. The result is exact: the
/// count is the least one, up to a few units in the last place of the radii that are added to the tolerance.
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
    /// The first station not reached yet.
    unreached: usize,
    /// The stations that bounded the last cone which became empty.
    stoppers: [usize; 2],
}

impl<'a> Search<'a> {
    fn new(z: &'a [f64], r: &'a [f64], tolerance_mm: f64) -> Self {
        // Radii on a straight line are so only within their rounding.
        let size = r.iter().fold(0.0, |size: f64, radius| size.max(radius.abs()));
        let tolerance = tolerance_mm.max(0.0) * (1.0 + 4.0 * f64::EPSILON) + 16.0 * f64::EPSILON * size;
        let from = (0..z.len()).collect();
        Self { z, r, tolerance, blocks: Blocks::new(z, r), from, unreached: 1, stoppers: [0; 2] }
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
        while self.from[self.unreached] < self.unreached {
            self.unreached += 1;
        }
        let (found, start) = (next.len(), self.unreached.max(vertex + 1));
        // A cone that only few stations bound is too wide: what it doesn't find is not there.
        let wide = self.bounded_by_stoppers(vertex, start);
        let is_bounded = wide.least.is_finite() || wide.largest.is_finite();
        let mut cone = if is_bounded { self.walk(vertex, wide, start, next) } else { wide };
        if !is_bounded || next.len() > found {
            next.truncate(found);
            cone = self.walk(vertex, Cone::ALL, vertex + 1, next);
        }
        if cone.is_empty() {
            self.stoppers = cone.bounds;
        }
        for &station in &next[found..] {
            self.from[station] = vertex;
            self.blocks.visit(station);
        }
    }

    /// The cone as far as the stoppers bound it that stand before `start`.
    fn bounded_by_stoppers(&self, vertex: usize, start: usize) -> Cone {
        let mut cone = Cone::ALL;
        let [low, high] = self.stoppers;
        if vertex < low && low < start {
            cone.raise(self.slope(vertex, low, -self.tolerance), low);
        }
        if vertex < high && high < start {
            cone.lower(self.slope(vertex, high, self.tolerance), high);
        }
        cone
    }

    /// Adds to `found` every station from `start` on that was not reached before and lies in the cone, which narrows
    /// on the way; the cone at the end.
    fn walk(&self, vertex: usize, mut cone: Cone, start: usize, found: &mut Vec<usize>) -> Cone {
        let mut station = start;
        while station < self.z.len() && !cone.is_empty() {
            let passable = self.blocks.beginning_at(station).find(|&block| self.holds_no_target(vertex, cone, block));
            if let Some(block) = passable {
                cone = self.narrowed(vertex, cone, block);
                station = self.blocks.end(block);
            } else {
                let end = ((station >> LEAF_BITS) + 1) << LEAF_BITS;
                let end = end.min(self.z.len());
                cone = self.scan(vertex, cone, station..end, found);
                station = end;
            }
        }
        cone
    }

    fn slope(&self, vertex: usize, station: usize, shift: f64) -> f64 {
        (self.r[station] - self.r[vertex] + shift) / (self.z[station] - self.z[vertex])
    }

    /// Station by station.
    fn scan(&self, vertex: usize, mut cone: Cone, stations: std::ops::Range<usize>, found: &mut Vec<usize>) -> Cone {
        let (z, r, tolerance) = (self.z[vertex], self.r[vertex], self.tolerance);
        for station in stations {
            let per_length = 1.0 / (self.z[station] - z);
            let rise = self.r[station] - r;
            // The neighbour is always in reach, also where two stations coincide.
            let reaches = station == vertex + 1 || cone.holds(rise * per_length);
            if reaches && self.from[station] == station {
                found.push(station);
            }
            cone.raise((rise - tolerance) * per_length, station);
            cone.lower((rise + tolerance) * per_length, station);
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
    fn narrowed(&self, vertex: usize, mut cone: Cone, block: (usize, usize)) -> Cone {
        let (z, r) = (self.z[vertex], self.r[vertex]);
        let steepest = self.blocks.steepest(self.z, self.r, block, (z, r + self.tolerance));
        let flattest = self.blocks.flattest(self.z, self.r, block, (z, r - self.tolerance));
        cone.raise(self.slope(vertex, steepest, -self.tolerance), steepest);
        cone.lower(self.slope(vertex, flattest, self.tolerance), flattest);
        cone
    }
}
