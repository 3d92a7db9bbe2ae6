//! A cycle written out as its moves, with their shifts; the line that called it stays as a comment (`program/6`).

use std::fmt::Write as _;
use std::ops::Range;

use super::super::super::job::{Dialect, Mode};
use super::super::reader::{Call, Feed, Kind, Program, ProgramMove, Speed, WordsOfLine};
use super::line::{Line, Piece, Point, step};
use super::numbers::decimal;
use super::plan::Shifts;
use super::rewrite::{Written, changed_line};

/// Least step of a feed and of a speed as they are written.
const STEP_OF_FEED: f64 = 1e-6;

impl Written {
    /// Writes a cycle out, where that changes any of its moves.
    #[allow(clippy::too_many_arguments)] // text, program and shifts belong to each other in pairs
    pub(super) fn write_out(
        &mut self,
        text: &str,
        range: Range<usize>,
        dialect: Dialect,
        (program, call): (&Program, &Call),
        from: Option<Point>,
        shifts: &Shifts,
        mode: &Mode,
    ) -> bool {
        let words = WordsOfLine {
            mv: call.moves.start,
            x: None,
            z: None,
            radius: None,
            centre: [None, None],
            is_centre_absolute: false,
            put_in_at: range.start,
            is_relative: false,
            unit_x_mm: call.unit_x_mm,
            unit_z_mm: call.unit_z_mm,
            at_end: Vec::new(),
            names_motion: true,
        };
        let mut from = from;
        let mut all: Vec<(usize, Vec<Piece>)> = Vec::new();
        for index in call.moves.clone() {
            let one = &program.moves[index];
            let Some(end) = one.end.known() else { return false };
            let line =
                Line { text, range: range.clone(), words: &words, dialect, one, step: step(call.unit_z_mm, mode) };
            all.push((index, line.pieces(shifts, index, from, end)));
            from = Some(end);
        }
        let is_shifted = |(_, pieces): &(usize, Vec<Piece>)| pieces.iter().any(|piece| piece.shift_mm.abs() > 0.0);
        if !all.iter().any(is_shifted) {
            return false;
        }
        let old = &text[range.clone()];
        let mut new = vec![format!("({})", old.trim().replace('(', "[").replace(')', "]"))];
        let mut last = Last { kind: None, at: None, feed: None, speed: call.speed_before };
        for (index, pieces) in &all {
            let one = &program.moves[*index];
            let line =
                Line { text, range: range.clone(), words: &words, dialect, one, step: step(call.unit_z_mm, mode) };
            for piece in pieces {
                new.push(last.block(&line, call, piece.end));
            }
            self.keep(*index, pieces);
        }
        let pieces: Vec<Piece> = all.iter().flat_map(|(_, pieces)| pieces.iter().copied()).collect();
        self.changed.push(changed_line(call.line, old, new, &pieces));
        true
    }
}

/// What the blocks before have said.
struct Last {
    kind: Option<Kind>,
    at: Option<Point>,
    feed: Option<Feed>,
    speed: Option<Speed>,
}

impl Last {
    /// A block with what it has to say.
    fn block(&mut self, line: &Line<'_>, call: &Call, end: Point) -> String {
        let mut words: Vec<String> = Vec::new();
        let one = line.one;
        if self.kind != Some(one.kind) {
            let code = match one.kind {
                Kind::Line => 1,
                Kind::ArcCw => 2,
                Kind::ArcCcw => 3,
                _ => 0,
            };
            words.push(format!("G{code}"));
        }
        let moves = |axis: usize| self.at.is_none_or(|at| (at[axis] - end[axis]).abs() > 1e-9);
        if moves(0) || !moves(1) {
            words.push(line.word('X', end[0], call.unit_x_mm));
        }
        if moves(1) {
            words.push(line.word('Z', end[1], call.unit_z_mm));
        }
        if let Some(radius_mm) = radius_mm(one) {
            words.push(line.word('R', radius_mm, call.unit_z_mm));
        }
        if one.kind.is_feed() && self.feed != one.feed {
            let (Some(Feed::PerRev(feed) | Feed::PerMinute(feed)), of) = (one.feed, call.unit_of_feed) else {
                return words.concat();
            };
            words.push(format!("F{}", decimal(feed / of, STEP_OF_FEED)));
            self.feed = one.feed;
        }
        if let Some(speed) = one.speed.filter(|speed| self.speed != Some(*speed)) {
            let told = match speed {
                Speed::Spindle(rpm) => rpm,
                Speed::Surface(speed, _) => speed / call.unit_of_speed,
            };
            // A speed is written as it is usual: without a point where it needs none.
            words.push(format!("S{}", decimal(told, STEP_OF_FEED).trim_end_matches('.')));
            self.speed = Some(speed);
        }
        (self.kind, self.at) = (Some(one.kind), Some(end));
        let words = words.iter().map(|word| if line.is_small() { word.to_ascii_lowercase() } else { word.clone() });
        let blank = if line.has_blanks() { " " } else { "" };
        let mut block = String::new();
        for (i, word) in words.enumerate() {
            let _ = write!(block, "{}{word}", if i > 0 { blank } else { "" });
        }
        block
    }
}

/// Radius of an arc of less than half a turn, mm.
fn radius_mm(one: &ProgramMove) -> Option<f64> {
    let ([cx, cz], [x, z]) = (one.centre?, one.end.known()?);
    Some((0.5 * (x - cx)).hypot(z - cz))
}
