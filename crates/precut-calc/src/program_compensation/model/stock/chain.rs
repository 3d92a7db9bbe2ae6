//! The outline of the work: radii end to end, with steps between them (`program/3`).

use super::curve::{Curve, Piece, SAME_MM};

/// What a tool comes to within this is its own, mm.
pub(super) const CONTACT_MM: f64 = 1e-3;

/// A part of the outline, and the line of the program that made it; none of the blank.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Part {
    pub(super) piece: Piece,
    pub(super) owner: Option<usize>,
    /// Who made the step at its left end.
    pub(super) step_owner: Option<usize>,
}

/// The outline.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chain {
    parts: Vec<Part>,
}

impl Chain {
    /// Of a blank: rows of place and radius, places never falling.
    pub(super) fn of(rows: &[[f64; 2]]) -> Self {
        let parts = rows.windows(2).filter(|pair| pair[1][0] > pair[0][0]).map(|pair| Part {
            piece: Piece { x0: pair[0][0], x1: pair[1][0], curve: Curve::through(pair[0], pair[1]) },
            owner: None,
            step_owner: None,
        });
        Self { parts: parts.collect() }
    }

    pub(super) fn parts(&self) -> &[Part] {
        &self.parts
    }

    fn overlapping(&self, piece: &Piece) -> std::ops::Range<usize> {
        let from = self.parts.partition_point(|part| part.piece.x1 <= piece.x0 + SAME_MM);
        let to = self.parts.partition_point(|part| part.piece.x0 < piece.x1 - SAME_MM);
        from..to.max(from)
    }

    /// How deep a curve lies in the work at the most, mm; below 0 it stays clear by so much.
    pub(super) fn depth(&self, piece: &Piece) -> f64 {
        let mut deepest = f64::NEG_INFINITY;
        for part in &self.parts[self.overlapping(piece)] {
            let (a, b) = (part.piece.x0.max(piece.x0), part.piece.x1.min(piece.x1));
            for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
                let at = a + share * (b - a);
                deepest = deepest.max(part.piece.curve.at(at) - piece.curve.at(at).max(0.0));
            }
        }
        deepest
    }

    /// Takes away what stands above a curve.
    pub(super) fn cut(&mut self, piece: &Piece, owner: usize) {
        let range = self.overlapping(piece);
        let mut made: Vec<Part> = Vec::new();
        let mut is_changed = false;
        let mut at = Vec::new();
        for part in &self.parts[range.clone()] {
            let [x0, x1] = [part.piece.x0, part.piece.x1];
            let (a, b) = (x0.max(piece.x0), x1.min(piece.x1));
            at.clear();
            at.extend([x0, x1]);
            at.extend([a, b].into_iter().filter(|&end| end > x0 + SAME_MM && end < x1 - SAME_MM));
            for raised in [0.0, CONTACT_MM] {
                piece.curve.crossings(part.piece.curve, raised, [a, b], &mut at);
            }
            at.sort_by(f64::total_cmp);
            for (i, ends) in at.windows(2).enumerate() {
                let [from, to] = [ends[0], ends[1]];
                if to - from <= SAME_MM {
                    continue;
                }
                let middle = 0.5 * (from + to);
                let mut own = Part { piece: Piece { x0: from, x1: to, curve: part.piece.curve }, ..*part };
                if i > 0 {
                    own.step_owner = None;
                }
                if middle > a && middle < b {
                    let over = part.piece.curve.at(middle) - piece.curve.at(middle);
                    if over > 0.0 {
                        own.piece.curve = piece.curve;
                    }
                    if over > -CONTACT_MM {
                        own.owner = Some(owner);
                        is_changed = true;
                    }
                }
                made.push(own);
            }
        }
        if is_changed {
            self.replace(range, &made);
        }
    }

    /// Puts parts in the place of others; those that are one with their neighbour become one.
    fn replace(&mut self, range: std::ops::Range<usize>, made: &[Part]) {
        let around = range.start.saturating_sub(1)..(range.end + 1).min(self.parts.len());
        let before = &self.parts[around.start..range.start];
        let behind = &self.parts[range.end..around.end];
        let mut joined: Vec<Part> = Vec::with_capacity(made.len() + 2);
        for part in before.iter().chain(made).chain(behind) {
            match joined.last_mut() {
                Some(last)
                    if last.owner == part.owner
                        && last.piece.curve == part.piece.curve
                        && part.step_owner.is_none() =>
                {
                    last.piece.x1 = part.piece.x1;
                }
                _ => joined.push(*part),
            }
        }
        self.parts.splice(around, joined);
    }

    /// Who made the step at the left end of a part: who touched it last, else who made its lower side.
    pub(super) fn step_owner(&self, i: usize) -> Option<usize> {
        let (left, right) = (self.parts.get(i.checked_sub(1)?)?, self.parts.get(i)?);
        let at = right.piece.x0;
        let low = if left.piece.curve.at(at) < right.piece.curve.at(at) { left } else { right };
        right.step_owner.or(low.owner)
    }

    /// A wall that stands at a place from a radius on: the step there is then its owner's.
    pub(super) fn touch_wall(&mut self, x: f64, from: f64, owner: usize) {
        let near = self.parts.partition_point(|part| part.piece.x0 < x - CONTACT_MM).max(1);
        for i in near..self.parts.len() {
            let at = self.parts[i].piece.x0;
            if at > x + CONTACT_MM {
                break;
            }
            let (left, right) = (self.parts[i - 1].piece.curve.at(at), self.parts[i].piece.curve.at(at));
            if (left - right).abs() > CONTACT_MM && left.max(right) > from + CONTACT_MM {
                self.parts[i].step_owner = Some(owner);
            }
        }
    }
}
