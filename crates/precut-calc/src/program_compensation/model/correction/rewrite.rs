//! Shifts written into a program: numbers of X, and lines for further pieces. Nothing else changes (`program/6`).

use std::collections::BTreeSet;
use std::ops::Range;

use super::super::super::job::{Dialect, Mode};
use super::super::reader::{Program, lines_of_text};
use super::calls::Calls;
use super::line::{Line, Piece, Point, step};
use super::plan::Shifts;

const MM_PER_UM: f64 = 1e-3;

/// A line that becomes others.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChangedLine {
    /// Line of the given program, from 1.
    pub(crate) line: usize,
    /// Without its end.
    pub(crate) old: String,
    pub(crate) new: Vec<String>,
    /// Least and largest shift along it, on the diameter, um.
    pub(crate) smallest_shift_um: f64,
    pub(crate) largest_shift_um: f64,
}

/// A program with its shifts.
#[derive(Debug, Clone)]
pub(crate) struct Written {
    pub(crate) text: String,
    pub(crate) changed: Vec<ChangedLine>,
    /// How many moves stand for each of the program's, and how far off it may end, on the diameter, mm.
    pub(crate) pieces: Vec<usize>,
    pub(crate) shift_mm: Vec<f64>,
    /// The moves whose text became another.
    pub(crate) moved: BTreeSet<usize>,
}

impl Written {
    /// The line of the given program of which a line of the new one came.
    pub(crate) fn given_line(&self, line: usize) -> usize {
        let mut added = 0;
        for changed in &self.changed {
            if changed.line + added >= line {
                break;
            }
            added += (changed.new.len() - 1).min(line - changed.line - added);
        }
        line - added
    }

    /// Of which move of the given program every move of the new one is a piece.
    pub(crate) fn moves(&self) -> Vec<usize> {
        self.pieces.iter().enumerate().flat_map(|(mv, &pieces)| std::iter::repeat_n(mv, pieces)).collect()
    }

    /// The line of the new program that a line of the old one became; of several the last one.
    pub(crate) fn line(&self, line: usize) -> usize {
        let added = |changed: &&ChangedLine| changed.line <= line;
        line + self.changed.iter().filter(added).map(|changed| changed.new.len().saturating_sub(1)).sum::<usize>()
    }
}

/// Writes the shifts into the text.
pub(crate) fn rewritten(
    text: &str,
    dialect: Dialect,
    (program, calls): (&Program, &Calls<'_>),
    shifts: &Shifts,
    mode: &Mode,
) -> Written {
    let lines = lines_of_text(text);
    let count = program.moves.len();
    let mut written = Written {
        text: String::new(),
        changed: Vec::new(),
        pieces: vec![1; count],
        shift_mm: vec![0.0; count],
        moved: BTreeSet::new(),
    };
    // Where the tool really is, and where the program means it to be.
    let (mut real, mut meant): (Option<Point>, Option<Point>) = (None, None);
    let mut index = 0;
    while let Some(one) = program.moves.get(index) {
        if let Some(call) = calls.of_move(index).filter(|call| call.moves.start == index)
            && let Some(line) = lines.get(call.line - 1)
            && written.write_out(text, line.clone(), dialect, (program, call), meant, shifts, mode)
        {
            index = call.moves.end;
            meant = program.moves[index - 1].end.known();
            real = meant;
            continue;
        }
        let end = one.end.known();
        let words = program.words_of_lines.get(&one.line).and_then(Option::as_ref).filter(|words| words.mv == index);
        let mut arrived = end;
        if let (Some(words), Some(end), Some(range)) = (words, end, lines.get(one.line - 1)) {
            let line = Line { text, range: range.clone(), words, dialect, one, step: step(words.unit_z_mm, mode) };
            let pieces = line.pieces(shifts, index, meant, end);
            // A place that nobody knows is not shifted.
            let from = real.or(meant);
            if let Some((new, last)) = line.rewritten(&pieces, from, meant) {
                written.keep(index, &pieces);
                written.changed.push(changed_line(one.line, &text[range.clone()], new, &pieces));
                arrived = Some(last);
            } else if let (Some(from), Some(meant), None) = (from, meant, &words.x) {
                // Without a word of X the tool stays where it is.
                arrived = Some([from[0] + end[0] - meant[0], end[1]]);
            }
        }
        (real, meant) = (arrived, end);
        index += 1;
    }
    written.changed.sort_by_key(|one| one.line);
    written.text = applied(text, &lines, &written.changed);
    written
}

/// A line that became others, with the shifts of all that stands in it.
pub(super) fn changed_line(line: usize, old: &str, new: Vec<String>, pieces: &[Piece]) -> ChangedLine {
    let shift = |piece: &Piece| 2.0 * piece.shift_mm / MM_PER_UM;
    ChangedLine {
        line,
        old: old.to_owned(),
        new,
        smallest_shift_um: pieces.iter().map(shift).fold(f64::INFINITY, f64::min),
        largest_shift_um: pieces.iter().map(shift).fold(f64::NEG_INFINITY, f64::max),
    }
}

impl Written {
    /// Keeps that a move became these pieces.
    pub(super) fn keep(&mut self, index: usize, pieces: &[Piece]) {
        self.pieces[index] = pieces.len();
        self.shift_mm[index] = pieces.iter().map(|piece| 2.0 * piece.shift_mm.abs()).fold(0.0, f64::max);
        self.moved.insert(index);
    }
}

/// The text with lines replaced, each with its own line end.
pub(crate) fn applied(text: &str, lines: &[Range<usize>], changed: &[ChangedLine]) -> String {
    let mut out = String::with_capacity(text.len() + 64 * changed.len());
    let mut at = 0;
    for one in changed {
        let Some(range) = lines.get(one.line - 1) else { continue };
        let behind = lines.get(one.line).map_or(text.len(), |next| next.start);
        let own = &text[range.end..behind];
        let end = if own.is_empty() { "\n" } else { own };
        out.push_str(&text[at..range.start]);
        out.push_str(&one.new.join(end));
        at = range.end;
    }
    out.push_str(&text[at..]);
    out
}
