//! What the work is corrected to where that is the drawing, and not what the program itself means (`program/5`).

use std::collections::BTreeMap;

use super::super::super::job::{CorrectTo, Job};
use super::super::stock::{Part, Piece, Shape, Stroke, Way, outline};

/// A surface that is farther off the drawing is another shape, which no shift of a cut should make, mm on the radius.
pub(crate) const FARTHEST_MM: f64 = 0.25;

/// A move makes a surface that it leaves so near to what it passes over, mm.
const MAKES_MM: f64 = 1e-3;
/// So far inside its ends a move is held against the drawing, mm.
const INSIDE_MM: f64 = 1e-6;

/// The outline that is meant: what a program leaves on rigid work, and the drawing where it comes near to that.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Aim {
    /// The drawing, what the program leaves on rigid work, and what is meant.
    drawn: Vec<Part>,
    nominal: Vec<Part>,
    meant: Vec<Part>,
    /// Ends of the parts that a line makes, by the lines.
    made: BTreeMap<usize, Vec<[f64; 2]>>,
}

/// The part at a place; none beside all of them.
fn at(parts: &[Part], x: f64) -> Option<&Part> {
    let at = parts.partition_point(|part| part.piece.x1 < x);
    parts.get(at).filter(|part| part.piece.x0 <= x)
}

impl Aim {
    /// Of a job that is to be corrected to its drawing, by what the program leaves on rigid work.
    pub(crate) fn of(job: &Job, nominal: impl FnOnce() -> Vec<Part>) -> Option<Self> {
        let drawn = outline(&job.drawing).parts();
        if job.mode.correct_to != CorrectTo::Drawing || drawn.is_empty() {
            return None;
        }
        let nominal = nominal();
        let meant = against(&drawn, &nominal);
        let mut made: BTreeMap<usize, Vec<[f64; 2]>> = BTreeMap::new();
        for part in &nominal {
            if let Some(line) = part.owner {
                made.entry(line).or_default().push([part.piece.x0, part.piece.x1]);
            }
        }
        Some(Self { drawn, nominal, meant, made })
    }

    /// What is meant.
    pub(crate) fn into_meant(self) -> Vec<Part> {
        self.meant
    }

    /// How far a tool has to stand off its path at a share of it for its surface to be that of the drawing, mm; 0 where the drawing
    /// says nothing, or asks for another shape.
    pub(crate) fn off_mm(&self, stroke: &Stroke<'_>, share: f64) -> f64 {
        // At a corner of the contour the move makes what lies on its side of it.
        let least = INSIDE_MM / stroke.way.length_mm();
        let share = if least < 0.5 { share.clamp(least, 1.0 - least) } else { share };
        let made = stroke.way.direction(share).and_then(|direction| stroke.shape.makes(direction));
        let Some([by_x, by_r]) = made else { return 0.0 };
        let [x, r] = stroke.way.at(share);
        let radius = |parts: &[Part], x: f64| at(parts, x).map(|part| part.piece.curve.at(x));
        // Where another move makes the surface, this one goes on as it is to where it makes one itself.
        let is_made =
            |x: f64, made_mm: f64| radius(&self.nominal, x).is_some_and(|left| (left - made_mm).abs() <= MAKES_MM);
        let mut place = [x + by_x, r + by_r];
        if !is_made(place[0], place[1])
            && let (Way::Line(from, to), Some(beside)) = (stroke.way, self.nearest(stroke.one.line, place[0]))
        {
            place = [beside, place[1] + (beside - place[0]) * (to[1] - from[1]) / (to[0] - from[0])];
        }
        let drawn = radius(&self.drawn, place[0]).filter(|_| is_made(place[0], place[1]));
        let drawn = drawn.map_or(0.0, |drawn| drawn - place[1]);
        let off = if drawn.abs() <= FARTHEST_MM { drawn } else { 0.0 };
        off.max(self.clear_mm(&stroke.shape, [x, r]))
    }

    /// The place nearest to another one at which a line makes the surface.
    fn nearest(&self, line: usize, x: f64) -> Option<f64> {
        let inside = |&[from, to]: &[f64; 2]| {
            let least = INSIDE_MM.min(0.5 * (to - from));
            x.clamp(from + least, to - least)
        };
        let places = self.made.get(&line)?.iter().map(inside);
        places.min_by(|a, b| (a - x).abs().total_cmp(&(b - x).abs()))
    }

    /// By how much a tool at a place stands too deep for what is meant beside the place that it makes: there a step of the drawing comes
    /// up to its nose or its edges.
    fn clear_mm(&self, shape: &Shape, [x, r]: [f64; 2]) -> f64 {
        let [from, to] = shape.extent_mm(FARTHEST_MM).map(|by| x + by);
        let first = self.meant.partition_point(|part| part.piece.x1 < from);
        let parts = self.meant[first..].iter().take_while(|part| part.piece.x0 <= to);
        let corners = parts.flat_map(|part| [part.piece.x0, part.piece.x1].map(|x| [x, part.piece.curve.at(x)]));
        let deep = corners.filter_map(|[at, radius]| shape.height_mm(at - x).map(|height| radius - r - height));
        deep.filter(|deep| *deep <= FARTHEST_MM).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Shares of a straight way along the axis at which the drawing has a corner or a step.
    pub(crate) fn breaks(&self, stroke: &Stroke<'_>) -> Vec<f64> {
        let (Way::Line(from, to), Some(direction)) = (stroke.way, stroke.way.direction(0.5)) else { return Vec::new() };
        let Some([by_x, _]) = stroke.shape.makes(direction) else { return Vec::new() };
        let corners = self.drawn.iter().flat_map(|part| [part.piece.x0, part.piece.x1]);
        corners.map(|x| (x - by_x - from[0]) / (to[0] - from[0])).filter(|share| (0.0..=1.0).contains(share)).collect()
    }
}

/// What a program leaves, with the drawing in its place where it comes near to that.
pub(crate) fn against(drawn: &[Part], nominal: &[Part]) -> Vec<Part> {
    let mut meant = Vec::with_capacity(nominal.len());
    for part in nominal {
        let Piece { x0, x1, curve } = part.piece;
        let inside = drawn.iter().flat_map(|drawn| [drawn.piece.x0, drawn.piece.x1]);
        let mut cuts: Vec<f64> = inside.filter(|x| x0 < *x && *x < x1).chain([x0, x1]).collect();
        cuts.sort_by(f64::total_cmp);
        for ends in cuts.windows(2).filter(|ends| ends[1] - ends[0] > 0.0) {
            let middle = 0.5 * (ends[0] + ends[1]);
            let near = |drawn: &&Part| (drawn.piece.curve.at(middle) - curve.at(middle)).abs() <= FARTHEST_MM;
            let drawn = at(drawn, middle).filter(|_| part.owner.is_some()).filter(near);
            let curve = drawn.map_or(curve, |drawn| drawn.piece.curve);
            meant.push(Part { piece: Piece { x0: ends[0], x1: ends[1], curve }, ..*part });
        }
    }
    meant
}
