//! Running integrals over the base structure, from the left and from the right (`deflection/3.3`).
//!
//! A load beyond a break point acts on the part before it through two numbers: in the span through the reaction of the
//! near support, on an overhang as a force and a couple at the break point. So two functionals per break point,
//! their mutual work and their work with every fixed diagram are all that a moving load ever needs.

use super::frame::{Frame, Ordinates, Work, Zone};
use super::model::Side;

/// Integrals over everything on one side of each break point.
///
/// Functionals at a break point, from the left: in the span `s - p` (the second one is 0); on the right overhang a unit
/// force and a unit couple at the break point; on the left overhang none. From the right: mirrored.
/// The entry at a break point is written for the interval that follows it in the direction of the integration, so the
/// one at the far end for an overhang of no length.
#[derive(Debug, Clone)]
pub(super) struct Tables {
    width: usize,
    /// Work of the functionals with each other: `00`, `01`, `11`.
    gram: Vec<[f64; 3]>,
    /// Work of the functionals with each fixed diagram; by break point.
    columns: Vec<[f64; 2]>,
    /// Work of the fixed diagrams with each other; by break point.
    pairs: Vec<f64>,
}

impl Tables {
    /// From the left with the sections in force left of the tool, or from the right with the others.
    pub(super) fn new(frame: &Frame, side: Side) -> Self {
        let count = frame.intervals.len();
        let width = frame.columns() + 1;
        let mut march =
            March { frame, side, gram: [0.0; 3], columns: vec![[0.0; 2]; width], pairs: vec![0.0; width * width] };
        let mut tables = Self {
            width,
            gram: vec![[0.0; 3]; count + 1],
            columns: vec![[0.0; 2]; (count + 1) * width],
            pairs: vec![0.0; (count + 1) * width * width],
        };
        let mut inside = false;
        for step in 0..count {
            let (k, node) = if side == Side::Left { (step, step) } else { (count - 1 - step, count - step) };
            let zone = frame.intervals[k].zone;
            if inside && zone != Zone::Span {
                march.leave_the_span();
            }
            inside = zone == Zone::Span;
            tables.store(node, &march);
            march.advance(k);
        }
        if inside {
            march.leave_the_span();
        }
        tables.store(if side == Side::Left { count } else { 0 }, &march);
        tables
    }

    fn store(&mut self, node: usize, march: &March<'_>) {
        let width = self.width;
        self.gram[node] = march.gram;
        self.columns[node * width..(node + 1) * width].copy_from_slice(&march.columns);
        self.pairs[node * width * width..(node + 1) * width * width].copy_from_slice(&march.pairs);
    }

    pub(super) fn gram(&self, node: usize) -> [f64; 3] {
        self.gram[node]
    }

    /// Functionals with a fixed diagram; the index after the last load is the weight.
    pub(super) fn column(&self, node: usize, column: usize) -> [f64; 2] {
        self.columns[node * self.width + column]
    }

    /// Work of two fixed diagrams; that of the weight with itself is not meant.
    pub(super) fn pair(&self, node: usize, i: usize, j: usize) -> f64 {
        self.pairs[(node * self.width + i) * self.width + j]
    }
}

/// The state of the integration at a break point.
struct March<'a> {
    frame: &'a Frame,
    side: Side,
    gram: [f64; 3],
    columns: Vec<[f64; 2]>,
    pairs: Vec<f64>,
}

impl March<'_> {
    /// At the far support of the base: from the functional of the span to force and couple there. The force goes into
    /// the support, the couple turns the span with the reactions of a couple.
    fn leave_the_span(&mut self) {
        let inverse = self.frame.base.inverse_span;
        let turn = if self.side == Side::Left { -inverse } else { inverse };
        self.gram = [0.0, 0.0, self.gram[0] * inverse * inverse];
        for column in &mut self.columns {
            *column = [0.0, column[0] * turn];
        }
    }

    /// Over one interval.
    fn advance(&mut self, k: usize) {
        let interval = &self.frame.intervals[k];
        let base = &self.frame.base;
        let work = Work::new(interval.length, interval.section(self.side));
        let functionals = match (interval.zone, self.side) {
            (Zone::Span, Side::Left) => {
                [Ordinates::linear([interval.start - base.p, interval.end - base.p], 1.0), Ordinates::default()]
            }
            (Zone::Span, Side::Right) => {
                [Ordinates::linear([base.q - interval.start, base.q - interval.end], -1.0), Ordinates::default()]
            }
            (Zone::Right, Side::Left) => {
                self.shift(interval.length);
                [Ordinates::linear([-interval.length, 0.0], 1.0), Ordinates::linear([-1.0; 2], 0.0)]
            }
            (Zone::Left, Side::Right) => {
                self.shift(-interval.length);
                [Ordinates::linear([0.0, -interval.length], -1.0), Ordinates::linear([1.0; 2], 0.0)]
            }
            (Zone::Left, Side::Left) | (Zone::Right, Side::Right) => [Ordinates::default(); 2],
        };
        let [first, second] = &functionals;
        self.gram[0] += work.of(first, first);
        self.gram[1] += work.of(first, second);
        self.gram[2] += work.of(second, second);
        let width = self.columns.len();
        for i in 0..width {
            let diagram = self.frame.diagram(k, i, self.side).whole();
            self.columns[i][0] += work.of(first, &diagram);
            self.columns[i][1] += work.of(second, &diagram);
            for j in i..width {
                let pair = work.of(&diagram, &self.frame.diagram(k, j, self.side).whole());
                self.pairs[i * width + j] += pair;
                if i != j {
                    self.pairs[j * width + i] += pair;
                }
            }
        }
    }

    /// Force and couple at the next break point, seen from this one.
    fn shift(&mut self, by: f64) {
        let [vv, vt, tt] = self.gram;
        self.gram = [vv + by * (2.0 * vt + by * tt), vt + by * tt, tt];
        for column in &mut self.columns {
            column[0] += by * column[1];
        }
    }
}
