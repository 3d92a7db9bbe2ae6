//! Roughing cycles over a contour as moves: passes along the axis or across it, or along the contour (`program/2.4`).

use super::Reader;
use super::arcs;
use super::codes::Path;
use super::faults::Spot;
use super::moves::{Kind, Nose, Place};

/// Lengths that are no different, mm.
pub(super) const SAME_MM: f64 = 1e-9;
/// Most passes of one cycle.
const MAX_PASSES: usize = 20_000;

/// A part of a contour: radius and z of its ends, mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Element {
    pub(super) start: [f64; 2],
    pub(super) end: [f64; 2],
    pub(super) arc: Option<([f64; 2], Path)>,
    pub(super) line: usize,
}

impl Element {
    fn shifted(self, [r, z]: [f64; 2]) -> Self {
        self.with(|point| [point[0] + r, point[1] + z])
    }

    pub(super) fn with(self, to: impl Fn([f64; 2]) -> [f64; 2]) -> Self {
        let arc = self.arc.map(|(centre, path)| (to(centre), path));
        Self { start: to(self.start), end: to(self.end), arc, line: self.line }
    }

    /// Its second coordinate where it has this first one.
    fn second_at(&self, first: f64) -> f64 {
        if let Some((centre, _)) = self.arc {
            return arcs::z_at(self.start, self.end, centre, first);
        }
        let rise = self.end[0] - self.start[0];
        let share = if rise.abs() <= SAME_MM { 1.0 } else { ((first - self.start[0]) / rise).clamp(0.0, 1.0) };
        self.start[1] + share * (self.end[1] - self.start[1])
    }
}

/// How passes lie in the plane of radius and z. Seen so, a place has two coordinates: the first one falls from pass to pass, the
/// second one goes along them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sight {
    /// Passes along the axis.
    Along,
    /// Passes across it, from pass to pass with or against z.
    Across {
        /// -1 where z rises from pass to pass.
        sign: f64,
    },
}

impl Sight {
    /// Of passes across the axis from a place to the begin of a contour.
    pub(super) fn across(from_z: f64, to_z: f64) -> Self {
        Self::Across { sign: if to_z > from_z { -1.0 } else { 1.0 } }
    }

    /// Coordinates of a place of radius and z.
    pub(super) fn of(self, [r, z]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Along => [r, z],
            Self::Across { sign } => [sign * z, r],
        }
    }

    /// The place with these coordinates.
    pub(super) fn place(self, [first, second]: [f64; 2]) -> Place {
        match self {
            Self::Along => Place::at(2.0 * first, second),
            Self::Across { sign } => Place::at(2.0 * second, sign * first),
        }
    }

    /// Which way a contour goes along the passes.
    pub(super) fn direction(self, contour: &[Element]) -> f64 {
        let ends = contour.first().zip(contour.last());
        if ends.is_some_and(|(first, last)| self.of(last.end)[1] > self.of(first.start)[1]) { 1.0 } else { -1.0 }
    }

    /// The first part of a contour that turns back: its first coordinate never falls, its second one goes one way.
    pub(super) fn turns_back(self, contour: &[Element]) -> Option<&Element> {
        let direction = self.direction(contour);
        contour.iter().find(|one| {
            let ([first, second], [to_first, to_second]) = (self.of(one.start), self.of(one.end));
            to_first < first - SAME_MM
                || (to_second - second) * direction < -SAME_MM
                || one.arc.is_some_and(|(centre, path)| arcs::turns_back(one.start, one.end, centre, path))
        })
    }
}

/// How far passes at levels that fall reach along a contour that is seen so: to the first part that is as high as they.
pub(super) fn hits(levels: &[f64], seen: &[Element]) -> Vec<f64> {
    let Some(last) = seen.last() else { return Vec::new() };
    let mut part = 0;
    let mut hits: Vec<f64> = Vec::with_capacity(levels.len());
    for &level in levels.iter().rev() {
        while part + 1 < seen.len() && seen[part].end[0] < level {
            part += 1;
        }
        let one = &seen[part];
        hits.push(if one.end[0] < level { last.end[1] } else { one.second_at(level) });
    }
    hits.reverse();
    hits
}

impl<'a> Reader<'a> {
    /// Passes down to the contour, then one along it; all of it leaves the allowances.
    pub(super) fn passes(&mut self, contour: &[Element], sight: Sight, spot: Spot<'a>, allowance: [f64; 2]) {
        let line = spot.line;
        let Some([x0, z0]) = self.state.place.known() else {
            return;
        };
        let Some(depth) = self.state.rough_depth.filter(|depth| *depth > 0.0) else {
            self.notes.fault(spot, "cycle_word_missing");
            return;
        };
        let contour: Vec<Element> = contour.iter().map(|one| one.shifted(allowance)).collect();
        let seen: Vec<Element> = contour.iter().map(|one| one.with(|point| sight.of(point))).collect();
        let (Some(first), Some(last)) = (seen.first(), seen.last()) else {
            return;
        };
        let ([start, begin], direction) = (sight.of([0.5 * x0, z0]), sight.direction(&contour));
        let retract = self.state.rough_retract;
        let Some(levels) = self.levels(start, first.start[0], depth, spot) else {
            return;
        };
        let levels = &levels[1..];
        // Controls rough without compensation of the nose.
        let nose = std::mem::replace(&mut self.state.nose, Nose::Off);
        for (&level, hit) in levels.iter().zip(hits(levels, &seen)) {
            // What begins behind the start finds nothing to cut.
            if (hit - begin) * direction <= 0.0 {
                continue;
            }
            let out = level + retract;
            self.go(line, Kind::Rapid, sight.place([level, begin]), None);
            self.go(line, Kind::Line, sight.place([level, hit]), None);
            self.go(line, Kind::Line, sight.place([out, hit - retract * direction]), None);
            self.go(line, Kind::Rapid, sight.place([out, begin]), None);
        }
        self.go(line, Kind::Rapid, sight.place([first.start[0], begin]), None);
        self.follow(line, &contour);
        self.go(line, Kind::Rapid, sight.place([start, last.end[1]]), None);
        self.go(line, Kind::Rapid, Place::at(x0, z0), None);
        self.state.nose = nose;
    }

    /// Levels of passes down to a contour, the one at which they begin first; a fault where there are too many.
    pub(super) fn levels(&mut self, start: f64, to: f64, depth: f64, spot: Spot<'a>) -> Option<Vec<f64>> {
        let count = ((start - to - SAME_MM) / depth).ceil() - 1.0;
        if count > MAX_PASSES as f64 {
            self.notes.fault_with(spot, "too_many_moves", |finding| finding.with("limit_moves", 4 * MAX_PASSES));
            return None;
        }
        // Below MAX_PASSES.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = count.max(0.0) as usize;
        Some((0..=count).map(|i| start - depth * i as f64).collect())
    }

    /// Passes along the contour, each nearer to it; the last one leaves the allowances.
    pub(super) fn along_contour(&mut self, contour: &[Element], spot: Spot<'a>, allowance: [f64; 2]) {
        let line = spot.line;
        let Some([x0, z0]) = self.state.place.known() else {
            return;
        };
        let [shift_r, shift_z, count] = self.state.pattern.unwrap_or([0.0, 0.0, 1.0]);
        let passes = count.round().max(1.0);
        if passes * contour.len() as f64 > MAX_PASSES as f64 {
            self.notes.fault_with(spot, "too_many_moves", |finding| finding.with("limit_moves", MAX_PASSES));
            return;
        }
        // Below MAX_PASSES.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let passes = passes as usize;
        let nose = std::mem::replace(&mut self.state.nose, Nose::Off);
        for pass in 0..passes {
            let left = if passes > 1 { 1.0 - pass as f64 / (passes - 1) as f64 } else { 0.0 };
            let shift = [allowance[0] + left * shift_r, allowance[1] + left * shift_z];
            let shifted: Vec<Element> = contour.iter().map(|one| one.shifted(shift)).collect();
            let (Some(first), Some(last)) = (shifted.first(), shifted.last()) else {
                break;
            };
            let out = (2.0 * last.end[0]).max(x0);
            self.go(line, Kind::Rapid, Place::at(2.0 * first.start[0], z0), None);
            self.follow(line, &shifted);
            self.go(line, Kind::Rapid, Place::at(out, last.end[1]), None);
            self.go(line, Kind::Rapid, Place::at(out, z0), None);
        }
        self.go(line, Kind::Rapid, Place::at(x0, z0), None);
        self.state.nose = nose;
    }

    /// At the feed to the beginning of a contour and along it.
    fn follow(&mut self, line: usize, contour: &[Element]) {
        let point = |[r, z]: [f64; 2]| Place::at(2.0 * r, z);
        if let Some(first) = contour.first() {
            self.go(line, Kind::Line, point(first.start), None);
        }
        self.along(Some(line), contour);
    }

    /// Along a contour, in one line or in its own ones.
    pub(super) fn along(&mut self, line: Option<usize>, contour: &[Element]) {
        let point = |[r, z]: [f64; 2]| Place::at(2.0 * r, z);
        for one in contour {
            let line = line.unwrap_or(one.line);
            match one.arc {
                None => self.go(line, Kind::Line, point(one.end), None),
                Some((centre, path)) => {
                    let kind = if path == Path::Clockwise { Kind::ArcCw } else { Kind::ArcCcw };
                    self.go(line, kind, point(one.end), Some([2.0 * centre[0], centre[1]]));
                }
            }
        }
    }
}
