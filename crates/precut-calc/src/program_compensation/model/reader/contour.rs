//! Cycles over a contour, roughing and finishing: what their words say, and the contour that they name (`program/2.4`).

use crate::calculator::{Dialect, Failure};

use super::block::Words;
use super::codes::Path;
use super::faults::{Notes, Spot};
use super::lexer;
use super::moves::{ContourCycle, CycleKind, Kind, Move, Place};
use super::passes::{Element, SAME_MM, Sight};
use super::words_of_line::says_way_alone;
use super::{Reader, whole};

/// What is done with the lines of a contour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    /// Passes along the axis up to it.
    RoughZ,
    /// Passes across the axis up to it.
    RoughX,
    /// Passes along it.
    Pattern,
    /// Run as they are.
    Finish,
}

/// Where a contour stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lines {
    from: usize,
    to: usize,
}

impl Lines {
    pub(super) fn of(from: usize, to: usize) -> Self {
        Self { from, to }
    }

    /// As they are told, from 1.
    pub(super) fn told(self) -> (usize, usize) {
        (self.from + 1, self.to + 1)
    }
}

impl<'a> Reader<'a> {
    /// A roughing cycle: the first of its two lines, or the one with the contour. Gives the line that comes next.
    pub(super) fn rough(
        &mut self,
        words: &mut Words<'_, 'a>,
        spot: Spot<'a>,
        by: Use,
    ) -> Result<Option<usize>, Failure> {
        if self.dialect == Dialect::LinuxCnc {
            return self.rough_sub(words, spot, by).map(|()| None);
        }
        if self.refuse_nested(words, spot) {
            return Ok(None);
        }
        let has_contour = words.look(b'P').is_some() && words.look(b'Q').is_some();
        if !has_contour {
            self.head(words, by);
            return Ok(None);
        }
        let Some(lines) = self.contour_lines(words, spot, by) else {
            return Ok(None);
        };
        let allowance_x = words.take(b'U').map_or(0.0, |word| self.length(word));
        let allowance_z = words.take(b'W').map_or(0.0, |word| self.length(word));
        if let Some(word) = words.take(b'D') {
            self.state.rough_depth = Some(self.length(word));
        }
        // Further allowances of the one-line form.
        words.take_all("IKR");
        let next = Some((lines.to + 1).max(spot.line));
        let Some(start) = self.state.place.known() else {
            self.lost(spot);
            return Ok(next);
        };
        if !self.may_cut(spot, Place::at(start[0], start[1])) {
            return Ok(next);
        }
        let Some((contour, sight)) = self.contour_of(lines, by, spot)? else {
            return Ok(next);
        };
        let kind = match by {
            Use::RoughZ => CycleKind::RoughZ,
            Use::RoughX => CycleKind::RoughX,
            Use::Pattern | Use::Finish => CycleKind::Pattern,
        };
        self.cycles.push(ContourCycle {
            line: spot.line,
            kind,
            from_line: lines.from + 1,
            to_line: lines.to + 1,
            allowance_x_diameter_mm: allowance_x,
            allowance_z_mm: allowance_z,
        });
        let allowance = [0.5 * allowance_x, allowance_z];
        match by {
            Use::Pattern => self.along_contour(&contour, spot, allowance),
            Use::RoughZ | Use::RoughX | Use::Finish => self.passes(&contour, sight, spot, allowance),
        }
        Ok(next)
    }

    /// The first line of a cycle of two: depth and retract, or shifts and count.
    fn head(&mut self, words: &mut Words<'_, 'a>, by: Use) {
        let [u, w, r] = [b'U', b'W', b'R'].map(|letter| words.take(letter));
        let mut length = |word: Option<lexer::Word<'a>>| word.map(|word| self.length(word));
        if by == Use::Pattern {
            let count = r.map_or(1.0, |word| word.number());
            let shifts = [length(u).unwrap_or(0.0), length(w).unwrap_or(0.0)];
            self.state.pattern = Some([shifts[0], shifts[1], count]);
        } else {
            // What a pass comes nearer by: along the radius, or along the axis.
            let (depth, other) = if by == Use::RoughX { (w, u) } else { (u, w) };
            let (depth, retract) = (length(depth), length(r));
            self.state.rough_depth = depth.or(self.state.rough_depth);
            self.state.rough_retract = retract.unwrap_or(self.state.rough_retract);
            if let Some(word) = other {
                self.notes.fault(word.spot, "word_not_used");
            }
        }
    }

    /// A finishing cycle. Gives the line that comes next.
    pub(super) fn finish(&mut self, words: &mut Words<'_, 'a>, spot: Spot<'a>) -> Result<Option<usize>, Failure> {
        if self.dialect == Dialect::LinuxCnc {
            return self.finish_sub(words, spot).map(|()| None);
        }
        if self.refuse_nested(words, spot) {
            return Ok(None);
        }
        let Some(lines) = self.contour_lines(words, spot, Use::Finish) else {
            return Ok(None);
        };
        words.take_all("UW");
        let Some([x, z]) = self.state.place.known() else {
            self.lost(spot);
            return Ok(None);
        };
        self.cycles.push(ContourCycle {
            line: spot.line,
            kind: CycleKind::Finishing,
            from_line: lines.from + 1,
            to_line: lines.to + 1,
            allowance_x_diameter_mm: 0.0,
            allowance_z_mm: 0.0,
        });
        let made = (self.moves.len(), self.state.speed());
        self.run_contour(lines, Use::Finish)?;
        self.go(spot.line, Kind::Rapid, Place::at(x, z), None);
        let is_plain = (lines.from..=lines.to)
            .all(|at| says_way_alone(&lexer::block(self.line(at), at + 1, self.dialect, &mut Notes::default())));
        if is_plain {
            self.keep_call(words, made, true);
        }
        Ok(None)
    }

    pub(super) fn refuse_nested(&mut self, words: &mut Words<'_, 'a>, spot: Spot<'a>) -> bool {
        if self.contour.is_some() {
            self.notes.fault(spot, "cycle_in_contour");
            words.take_rest();
        }
        self.contour.is_some()
    }

    /// The lines that P and Q name.
    fn contour_lines(&mut self, words: &mut Words<'_, 'a>, spot: Spot<'a>, by: Use) -> Option<Lines> {
        let (p, q) = (words.take(b'P'), words.take(b'Q'));
        let (Some(p), Some(q)) = (p, q) else {
            self.notes.fault(spot, "contour_not_found");
            words.take_rest();
            return None;
        };
        // Numbers may come twice: finishing takes the contour that was roughed.
        let known = self.contours.iter().rev().find(|(numbers, _)| *numbers == [whole(p.number()), whole(q.number())]);
        if let (Use::Finish, Some(&(_, lines))) = (by, known) {
            return Some(lines);
        }
        let from = self.line_of_number(p.number(), spot.line - 1);
        let to = from.and_then(|from| self.line_of_number(q.number(), from.saturating_sub(1)));
        let Some((from, to)) = from.zip(to).filter(|(from, to)| from <= to) else {
            let both = [p.spot.word, q.spot.word].join(" ");
            self.notes.fault(Spot { word: &both, ..spot }, "contour_not_found");
            words.take_rest();
            return None;
        };
        let lines = Lines { from, to };
        self.contours.push(([whole(p.number()), whole(q.number())], lines));
        Some(lines)
    }

    fn run_contour(&mut self, lines: Lines, by: Use) -> Result<(), Failure> {
        self.contour = Some(by);
        let mut at = lines.from;
        let mut outcome = Ok(());
        while at <= lines.to && outcome.is_ok() && !self.is_over {
            outcome = self.step(at).map(|next| at = next.max(at + 1));
        }
        self.contour = None;
        outcome
    }

    /// The contour that roughing goes to, without the way to it and without rapid moves behind it, and how its passes lie.
    pub(super) fn contour_of(
        &mut self,
        lines: Lines,
        by: Use,
        spot: Spot<'a>,
    ) -> Result<Option<(Vec<Element>, Sight)>, Failure> {
        let before = self.notes.count();
        let (state, moves) = (self.kept(), std::mem::take(&mut self.moves));
        let start = state.place;
        let ran = self.run_contour(lines, by);
        self.state = state;
        let along = std::mem::replace(&mut self.moves, moves);
        ran?;
        if self.notes.count() > before {
            return Ok(None);
        }
        // To LinuxCNC rapid moves are parts of the contour like any others.
        let last_cut = along.iter().rposition(|one| one.kind.is_feed()).map_or(0, |last| last + 1);
        let cut = if self.dialect == Dialect::LinuxCnc { along.len() } else { last_cut };
        let elements = elements(start, &along[..cut]);
        let Some((approach, contour)) = elements.split_first().filter(|(_, rest)| !rest.is_empty()) else {
            self.notes.fault(spot, "contour_not_found");
            return Ok(None);
        };
        let sight = match by {
            Use::RoughX => Sight::across(approach.start[1], approach.end[1]),
            Use::RoughZ | Use::Pattern | Use::Finish => Sight::Along,
        };
        let is_inside = match by {
            Use::RoughZ => approach.end[0] > approach.start[0] + SAME_MM,
            // Passes across the axis go inward.
            Use::RoughX => sight.direction(contour) > 0.0,
            Use::Pattern | Use::Finish => false,
        };
        if is_inside {
            self.notes.fault(spot, "inside_turning");
            return Ok(None);
        }
        let is_roughed = matches!(by, Use::RoughZ | Use::RoughX);
        if is_roughed && self.refuse_not_monotone(contour, sight) {
            return Ok(None);
        }
        Ok(Some((contour.to_vec(), sight)))
    }

    /// The first part of the contour that turns back is a fault.
    fn refuse_not_monotone(&mut self, contour: &[Element], sight: Sight) -> bool {
        let Some(at) = sight.turns_back(contour).map(|one| one.line - 1) else {
            return false;
        };
        let block = lexer::block(self.line(at), at + 1, self.dialect, &mut Notes::default());
        let word_of =
            |letters: &[u8]| block.words.iter().find(|word| letters.contains(&word.letter)).map(|word| word.spot);
        let whole = Spot { line: at + 1, column: 1, word: self.line(at) };
        let spot = word_of(b"XU").or_else(|| word_of(b"ZW")).unwrap_or(whole);
        self.notes.fault(spot, "contour_not_monotone");
        true
    }
}

/// Moves as parts; what does not begin and end at known places is none.
fn elements(start: Place, moves: &[Move]) -> Vec<Element> {
    let mut from = start;
    let mut found = Vec::new();
    for one in moves {
        if let (Some([x0, z0]), Some([x1, z1])) = (from.known(), one.end.known())
            && one.kind != Kind::Dwell
        {
            let path = if one.kind == Kind::ArcCw { Path::Clockwise } else { Path::CounterClockwise };
            found.push(Element {
                start: [0.5 * x0, z0],
                end: [0.5 * x1, z1],
                arc: one.centre.map(|[x, z]| ([0.5 * x, z], path)),
                line: one.line,
            });
        }
        from = one.end;
    }
    found
}
