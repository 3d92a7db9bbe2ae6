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
    side: Side,
    width: usize,
    /// Work of the functionals with each other, `00`, `01`, `11`, by break point in the order of the integration.
    gram: Vec<[f64; 3]>,
    /// Work of the functionals with each fixed diagram; by break point likewise.
    columns: Vec<[f64; 2]>,
    /// Work of the fixed diagrams with each other; by break point likewise.
    pairs: Vec<f64>,
}

impl Tables {
    /// From the left with the sections in force left of the tool, or from the right with the others.
    pub(super) fn new(frame: &Frame, side: Side) -> Self {
        let count = frame.intervals.len();
        let width = frame.width();
        let mut march = March {
            frame,
            side,
            gram: Vec::with_capacity(count + 1),
            columns: Vec::with_capacity((count + 1) * width),
            pairs: Vec::with_capacity((count + 1) * width * width),
        };
        march.gram.push([0.0; 3]);
        march.columns.resize(width, [0.0; 2]);
        march.pairs.resize(width * width, 0.0);
        let interval = |step: usize| if side == Side::Left { step } else { count - 1 - step };
        let in_span = |step: usize| step < count && frame.intervals[interval(step)].zone == Zone::Span;
        for step in 0..count {
            march.advance(interval(step));
            if in_span(step) && !in_span(step + 1) {
                march.leave_the_span();
            }
        }
        let March { gram, columns, pairs, .. } = march;
        Self { side, width, gram, columns, pairs }
    }

    /// Where the entry of a break point stands: they are in the order of the integration.
    fn step(&self, node: usize) -> usize {
        if self.side == Side::Left { node } else { self.gram.len() - 1 - node }
    }

    pub(super) fn gram(&self, node: usize) -> [f64; 3] {
        self.gram[self.step(node)]
    }

    /// Functionals with a fixed diagram; the index after the last load is the weight.
    pub(super) fn column(&self, node: usize, column: usize) -> [f64; 2] {
        self.columns[self.step(node) * self.width + column]
    }

    /// Work of two fixed diagrams; that of the weight with itself is not meant.
    pub(super) fn pair(&self, node: usize, i: usize, j: usize) -> f64 {
        self.pairs[(self.step(node) * self.width + i) * self.width + j]
    }
}

/// The integration: the entries up to the break point that it has come to.
struct March<'a> {
    frame: &'a Frame,
    side: Side,
    gram: Vec<[f64; 3]>,
    columns: Vec<[f64; 2]>,
    pairs: Vec<f64>,
}

impl March<'_> {
    /// At the far support of the base: from the functional of the span to force and couple there. The force goes into
    /// the support, the couple turns the span with the reactions of a couple.
    fn leave_the_span(&mut self) {
        let inverse = self.frame.base.inverse_span;
        let turn = if self.side == Side::Left { -inverse } else { inverse };
        if let Some(gram) = self.gram.last_mut() {
            *gram = [0.0, 0.0, gram[0] * inverse * inverse];
        }
        for column in self.columns.iter_mut().rev().take(self.frame.width()) {
            *column = [0.0, column[0] * turn];
        }
    }

    /// Over one interval.
    fn advance(&mut self, k: usize) {
        let interval = &self.frame.intervals[k];
        let base = &self.frame.base;
        let work = Work::new(interval.length, interval.section(self.side));
        let (functionals, shift) = match (interval.zone, self.side) {
            (Zone::Span, Side::Left) => {
                let first = Ordinates::linear([interval.start - base.p, interval.end - base.p], 1.0);
                ([first, Ordinates::default()], 0.0)
            }
            (Zone::Span, Side::Right) => {
                let first = Ordinates::linear([base.q - interval.start, base.q - interval.end], -1.0);
                ([first, Ordinates::default()], 0.0)
            }
            (Zone::Right, Side::Left) => {
                let first = Ordinates::linear([-interval.length, 0.0], 1.0);
                ([first, Ordinates::linear([-1.0; 2], 0.0)], interval.length)
            }
            (Zone::Left, Side::Right) => {
                let first = Ordinates::linear([0.0, -interval.length], -1.0);
                ([first, Ordinates::linear([1.0; 2], 0.0)], -interval.length)
            }
            (Zone::Left, Side::Left) | (Zone::Right, Side::Right) => ([Ordinates::default(); 2], 0.0),
        };
        let [first, second] = &functionals;
        // Force and couple are those at the next break point.
        let [vv, vt, tt] = self.gram.last().copied().unwrap_or_default();
        self.gram.push([
            vv + shift * (2.0 * vt + shift * tt) + work.of(first, first),
            vt + shift * tt + work.of(first, second),
            tt + work.of(second, second),
        ]);
        let width = self.frame.width();
        let (columns, pairs) = (self.columns.len(), self.pairs.len());
        self.columns.extend_from_within(columns - width..);
        self.pairs.extend_from_within(pairs - width * width..);
        for i in 0..width {
            let diagram = self.frame.diagram(k, i, self.side).whole();
            let [by_first, by_second] = &mut self.columns[columns + i];
            *by_first += shift * *by_second + work.of(first, &diagram);
            *by_second += work.of(second, &diagram);
            for j in i..width {
                let pair = work.of(&diagram, &self.frame.diagram(k, j, self.side).whole());
                self.pairs[pairs + i * width + j] += pair;
                if i != j {
                    self.pairs[pairs + j * width + i] += pair;
                }
            }
        }
    }
}
