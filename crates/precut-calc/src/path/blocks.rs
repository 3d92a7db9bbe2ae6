//! Convex hulls over blocks of stations, in sizes that double.

/// Stations in a block of the lowest level, as a power of two. Of 8 to 64 stations 16 were fastest.
pub(super) const LEAF_BITS: u32 = 4;

/// Blocks of 16 stations, of 32 and so on, each with the hulls of its points and with the number of
/// its stations that the search has not reached.
pub(super) struct Blocks {
    levels: Vec<Level>,
}

struct Level {
    bits: u32,
    upper: Hulls,
    lower: Hulls,
    unvisited: Vec<usize>,
}

/// The hulls of all blocks of a level, one behind the other.
struct Hulls {
    stations: Vec<u32>,
    starts: Vec<usize>,
}

/// A point (z, r).
pub(super) type Point = (f64, f64);

/// Twice the area of the triangle: positive if c lies above the line from a to b, seen along z.
fn turn(a: Point, b: Point, c: Point) -> f64 {
    (b.0 - a.0) * (c.1 - a.1) - (c.0 - a.0) * (b.1 - a.1)
}

impl Hulls {
    /// Hulls of the blocks given by their candidate stations; `side` is 1 for upper, -1 for lower.
    fn new<'a>(z: &[f64], r: &[f64], side: f64, blocks: impl Iterator<Item = (&'a [u32], &'a [u32])>) -> Self {
        let mut hulls = Self { stations: Vec::new(), starts: vec![0] };
        let at = |station: u32| (z[station as usize], side * r[station as usize]);
        for (left, right) in blocks {
            let start = hulls.stations.len();
            // The left candidates are a hull already.
            hulls.stations.extend_from_slice(left);
            for &station in right {
                while let [.., before, last] = hulls.stations[start..] {
                    if turn(at(before), at(last), at(station)) < 0.0 {
                        break;
                    }
                    hulls.stations.pop();
                }
                hulls.stations.push(station);
            }
            hulls.starts.push(hulls.stations.len());
        }
        hulls
    }

    fn of(&self, block: usize) -> &[u32] {
        &self.stations[self.starts[block]..self.starts[block + 1]]
    }

    fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// Hulls of pairs of these blocks.
    fn doubled(&self, z: &[f64], r: &[f64], side: f64) -> Self {
        let pairs = (0..self.count()).step_by(2).map(|left| {
            let right = if left + 1 < self.count() { self.of(left + 1) } else { &[] };
            (self.of(left), right)
        });
        Self::new(z, r, side, pairs)
    }
}

impl Blocks {
    /// Of all stations; none reached yet. Without blocks where there are few stations or more than
    /// 32 bits can count.
    pub(super) fn new(z: &[f64], r: &[f64]) -> Self {
        let count = z.len();
        let mut levels: Vec<Level> = Vec::new();
        let Ok(end) = u32::try_from(count) else { return Self { levels } };
        let stations: Vec<u32> = (0..end).collect();
        let leaf = 1 << LEAF_BITS;
        let mut bits = LEAF_BITS;
        // A block of more than a quarter of all would rarely be used.
        while count >> bits >= 4 {
            let hulls = |side| match levels.last() {
                None => Hulls::new(z, r, side, stations.chunks(leaf).map(|block| (&[][..], block))),
                Some(below) if side > 0.0 => below.upper.doubled(z, r, side),
                Some(below) => below.lower.doubled(z, r, side),
            };
            let (upper, lower) = (hulls(1.0), hulls(-1.0));
            let size = 1_usize << bits;
            let unvisited = (0..upper.count()).map(|block| size.min(count - block * size)).collect();
            levels.push(Level { bits, upper, lower, unvisited });
            bits += 1;
        }
        Self { levels }
    }

    /// Notes that the search has reached `station`.
    pub(super) fn visit(&mut self, station: usize) {
        for level in &mut self.levels {
            level.unvisited[station >> level.bits] -= 1;
        }
    }

    /// The blocks that begin at `station`, largest first: as (level, block).
    pub(super) fn beginning_at(&self, station: usize) -> impl Iterator<Item = (usize, usize)> {
        let levels = self.levels.len();
        let aligned = (station.trailing_zeros() + 1).saturating_sub(LEAF_BITS) as usize;
        (0..levels.min(aligned)).rev().map(move |level| (level, station >> self.levels[level].bits))
    }

    /// First station behind a block.
    pub(super) fn end(&self, (level, block): (usize, usize)) -> usize {
        (block + 1) << self.levels[level].bits
    }

    /// Whether a block holds a station that the search has not reached.
    pub(super) fn has_unvisited(&self, (level, block): (usize, usize)) -> bool {
        self.levels[level].unvisited[block] > 0
    }

    /// Station of a block that is seen at the steepest slope from `eye`, which lies before it.
    pub(super) fn steepest(&self, z: &[f64], r: &[f64], (level, block): (usize, usize), eye: Point) -> usize {
        tangent(z, r, 1.0, self.levels[level].upper.of(block), eye)
    }

    /// Station of a block that is seen at the least slope from `eye`, which lies before it.
    pub(super) fn flattest(&self, z: &[f64], r: &[f64], (level, block): (usize, usize), eye: Point) -> usize {
        tangent(z, r, -1.0, self.levels[level].lower.of(block), eye)
    }
}

/// The point of a hull, by its station, where the line from `eye` touches it: slopes seen from before
/// the hull rise up to there and fall beyond.
fn tangent(z: &[f64], r: &[f64], side: f64, hull: &[u32], eye: Point) -> usize {
    let at = |station: u32| (z[station as usize], r[station as usize]);
    let (mut low, mut high) = (0, hull.len() - 1);
    while low < high {
        let middle = usize::midpoint(low, high);
        if side * turn(eye, at(hull[middle]), at(hull[middle + 1])) > 0.0 {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    hull[low] as usize
}
