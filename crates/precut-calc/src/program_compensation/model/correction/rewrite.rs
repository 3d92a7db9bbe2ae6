//! Shifts written into a program: numbers of X, and lines for further pieces. Nothing else changes (`program/6`).

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::ops::Range;

use super::super::super::job::{Dialect, Mode};
use super::super::reader::{Kind, NumberInText, Program, ProgramMove, WordsOfLine, centre_of_short_arc, lines_of_text};
use super::calls::Calls;
use super::plan::Shifts;

/// Lengths that are no different, mm.
const SAME_MM: f64 = 1e-7;
/// Least step of an inch that controls have, inch.
const INCH_STEP: f64 = 1e-4;
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

/// Where the tool is after a move: diameter and z, mm.
pub(super) type Point = [f64; 2];

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

/// The least step of X as it is written, in its unit.
pub(super) fn step(unit_mm: f64, mode: &Mode) -> f64 {
    if unit_mm > 1.0 { INCH_STEP } else { mode.increment_um * MM_PER_UM }
}

/// A piece of a move: its end and the shift of the radius there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    pub(super) end: Point,
    share: f64,
    pub(super) shift_mm: f64,
}

/// A line that makes one move.
pub(super) struct Line<'a> {
    pub(super) text: &'a str,
    pub(super) range: Range<usize>,
    pub(super) words: &'a WordsOfLine,
    pub(super) dialect: Dialect,
    pub(super) one: &'a ProgramMove,
    pub(super) step: f64,
}

/// Pieces without those that go on as straight as the ones before them.
fn without_straight(first: Piece, pieces: Vec<Piece>, within_mm: f64) -> Vec<Piece> {
    let mut kept: Vec<Piece> = vec![first];
    for piece in pieces {
        if let [.., before, middle] = kept[..] {
            let share = (middle.share - before.share) / (piece.share - before.share);
            let straight = before.shift_mm + share * (piece.shift_mm - before.shift_mm);
            if (straight - middle.shift_mm).abs() <= within_mm {
                kept.pop();
            }
        }
        kept.push(piece);
    }
    kept.split_off(1)
}

/// Nearest whole multiple, halves away from zero.
fn rounded(value: f64, grid: f64) -> f64 {
    (value / grid).round() * grid
}

impl Line<'_> {
    /// Where the pieces of the move end, rounded as they can be written.
    pub(super) fn pieces(&self, shifts: &Shifts, index: usize, from: Option<Point>, end: Point) -> Vec<Piece> {
        let unit = self.words.x.as_ref().map_or(self.words.unit_x_mm, |x| x.unit_mm.max(self.words.unit_x_mm));
        let grid = [unit * self.step, self.words.unit_z_mm * self.step];
        let at = |share: f64, shift_mm: f64| {
            let (share, meant) =
                if share >= 1.0 { (1.0, end) } else { self.at_step(from.unwrap_or(end), end, share, grid[1]) };
            let x = if shift_mm.abs() > 0.0 { rounded(meant[0] + 2.0 * shift_mm, grid[0]) } else { meant[0] };
            let x = if (x - meant[0]).abs() < 0.5 * grid[0] { meant[0] } else { x };
            let z = if share >= 1.0 { end[1] } else { rounded(meant[1], grid[1]) };
            Piece { end: [x, z], share, shift_mm: 0.5 * (x - meant[0]) }
        };
        let knots = shifts.programmed.get(&index).or_else(|| shifts.knots.get(&index));
        match (knots, shifts.ends.get(&index)) {
            (Some(knots), _) => {
                let first =
                    Piece { end: from.unwrap_or(end), share: 0.0, shift_mm: knots.first().map_or(0.0, |knot| knot[1]) };
                let pieces = knots.iter().skip(1).map(|&[share, shift]| at(share, shift));
                without_straight(first, pieces.collect(), 0.125 * grid[0])
            }
            (None, Some(&shift)) => vec![at(1.0, shift)],
            (None, None) => vec![Piece { end, share: 1.0, shift_mm: 0.0 }],
        }
    }

    /// A place of the move as it is meant, near a share of it, where z can be written: its share, diameter and z.
    fn at_step(&self, from: Point, to: Point, share: f64, grid_mm: f64) -> (f64, Point) {
        let about = self.at(from, to, share);
        let small = 1e-4 * (1.0 - share).min(1.0);
        let slope = (self.at(from, to, share + small)[1] - about[1]) / small;
        let off = rounded(about[1], grid_mm) - about[1];
        // Along a wall z says nothing of the place.
        if slope.abs() < 1e3 * grid_mm {
            return (share, about);
        }
        let share = share + off / slope;
        (share, self.at(from, to, share))
    }

    /// A place of the move as it is meant: diameter and z.
    fn at(&self, from: Point, to: Point, share: f64) -> Point {
        let Some([cx, cz]) = self.one.centre else {
            return [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])];
        };
        let angle = |point: Point| (0.5 * (point[0] - cx)).atan2(point[1] - cz);
        let radius = (0.5 * (from[0] - cx)).hypot(from[1] - cz);
        let full = std::f64::consts::TAU;
        let turn = if self.one.kind == Kind::ArcCcw {
            (angle(to) - angle(from)).rem_euclid(full)
        } else {
            -(angle(from) - angle(to)).rem_euclid(full)
        };
        let angle = angle(from) + share * turn;
        [cx + 2.0 * radius * angle.sin(), cz + radius * angle.cos()]
    }

    /// The lines, and where the tool is after them; none where the line stays as it is.
    fn rewritten(&self, pieces: &[Piece], from: Option<Point>, meant: Option<Point>) -> Option<(Vec<String>, Point)> {
        let (first, rest) = pieces.split_first()?;
        let is_moved = from.zip(meant).is_some_and(|(from, meant)| (from[0] - meant[0]).abs() > SAME_MM);
        let stays = |piece: &Piece| piece.shift_mm.abs() <= SAME_MM;
        // A relative word, or none, ends elsewhere if the tool begins elsewhere.
        let hangs = self.words.x.as_ref().is_none_or(|x| x.is_relative);
        if rest.is_empty() && stays(first) && !(is_moved && hangs) {
            return None;
        }
        let mut edits: Vec<(Range<usize>, String)> = Vec::new();
        match &self.words.x {
            Some(x) => {
                let length = first.end[0] - if x.is_relative { from?[0] } else { 0.0 };
                edits.push((x.range.clone(), self.number(length, x)));
            }
            None if from.is_some_and(|from| (from[0] - first.end[0]).abs() <= SAME_MM) => {}
            None => {
                let length = first.end[0] - if self.words.is_relative { from?[0] } else { 0.0 };
                edits.push((self.words.put_in_at..self.words.put_in_at, self.put_in(length)));
            }
        }
        if !rest.is_empty() {
            let z = self.words.z.as_ref()?;
            let length = first.end[1] - if z.is_relative { from?[1] } else { 0.0 };
            edits.push((z.range.clone(), self.number(length, z)));
        }
        self.edit_centre(from.or(meant).map(|from| (from, first.end)), &mut edits);
        // What acts at the end of the block goes to the last one.
        let at_end: &[Range<usize>] = if rest.is_empty() { &[] } else { &self.words.at_end };
        edits.extend(at_end.iter().map(|range| (self.with_blank(range), String::new())));
        edits.sort_by_key(|(range, _)| range.start);
        let (mut line, mut at) = (String::new(), self.range.start);
        for (range, new) in edits {
            line.push_str(&self.text[at..range.start]);
            line.push_str(&new);
            at = range.end;
        }
        line.push_str(&self.text[at..self.range.end]);
        let mut lines = Vec::with_capacity(pieces.len());
        let is_same = line == self.text[self.range.clone()];
        lines.push(line);
        let mut last = first.end;
        for piece in rest {
            lines.push(self.further(last, piece.end));
            last = piece.end;
        }
        if let Some(line) = lines.last_mut() {
            let blank = if self.has_blanks() { " " } else { "" };
            for range in at_end {
                let _ = write!(line, "{blank}{}", &self.text[range.clone()]);
            }
        }
        (!(is_same && rest.is_empty())).then_some((lines, last))
    }

    /// A word with the blanks before it.
    fn with_blank(&self, range: &Range<usize>) -> Range<usize> {
        let before = &self.text[self.range.start..range.start];
        self.range.start + before.trim_end_matches([' ', '\t']).len()..range.end
    }

    /// Centre of a piece of an arc that is told by a centre, in numbers that can be written: as near as may be to where it is as far
    /// from both ends as before.
    fn centre(&self, from: Point, to: Point) -> Option<Point> {
        let [cx, cz] = self.one.centre.filter(|_| self.words.centre.iter().any(Option::is_some))?;
        let end = self.one.end.known()?;
        let radius = (0.5 * (end[0] - cx)).hypot(end[1] - cz);
        let point = |[x, z]: Point| [0.5 * x, z];
        let exact = centre_of_short_arc(point(from), point(to), radius, self.one.kind == Kind::ArcCw)?;
        let grid = self.words.unit_z_mm * self.step;
        let base = self.centre_base(from);
        let near = [-1.0, 0.0, 1.0].map(|by| by * grid);
        let told = [0, 1].map(|axis| rounded(exact[axis] - base[axis], grid));
        let off = |centre: &Point| {
            let of = |[r, z]: Point| ((r - centre[0]).hypot(z - centre[1]) - radius).abs();
            of(point(from)).max(of(point(to)))
        };
        let all = near.iter().flat_map(|i| near.iter().map(move |k| [base[0] + told[0] + i, base[1] + told[1] + k]));
        all.min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// Where its words count a centre from: radius and z.
    fn centre_base(&self, from: Point) -> Point {
        let is_relative =
            self.words.centre.iter().flatten().next().map_or(!self.words.is_centre_absolute, |word| word.is_relative);
        if is_relative { [0.5 * from[0], from[1]] } else { [0.0; 2] }
    }

    /// Words of the centre for the first piece.
    fn edit_centre(&self, piece: Option<(Point, Point)>, edits: &mut Vec<(Range<usize>, String)>) {
        let Some((from, centre)) = piece.and_then(|(from, to)| self.centre(from, to).map(|centre| (from, centre)))
        else {
            return;
        };
        let base = self.centre_base(from);
        for (axis, letter) in ['I', 'K'].into_iter().enumerate() {
            let length = centre[axis] - base[axis];
            match &self.words.centre[axis] {
                Some(old) => {
                    let number = self.number(length, old);
                    let is_same = self.text[old.range.clone()].parse::<f64>().ok() == number.parse::<f64>().ok();
                    if !is_same {
                        edits.push((old.range.clone(), number));
                    }
                }
                None if length.abs() < 0.5 * self.words.unit_z_mm * self.step => {}
                None => {
                    let at = self.words.centre.iter().flatten().map(|word| word.range.end).max();
                    let blank = if self.has_blanks() { " " } else { "" };
                    edits.extend(
                        at.map(|at| (at..at, blank.to_owned() + &self.word(letter, length, self.words.unit_z_mm))),
                    );
                }
            }
        }
    }

    /// Whether its words have small letters; comments say nothing of that.
    pub(super) fn is_small(&self) -> bool {
        let number = self.words.z.as_ref().or(self.words.x.as_ref());
        let before = number.map_or("", |number| &self.text[self.range.start..number.range.start]);
        before.bytes().rev().find(u8::is_ascii_alphabetic).is_some_and(|letter| letter.is_ascii_lowercase())
    }

    pub(super) fn has_blanks(&self) -> bool {
        self.text[self.range.clone()].trim().contains(' ')
    }

    /// A word of X for a line that has none, and what parts it from its neighbour.
    fn put_in(&self, length_mm: f64) -> String {
        let word = self.word('X', length_mm, self.words.unit_x_mm);
        let is_before_z = self.words.z.is_some();
        match (self.has_blanks(), is_before_z) {
            (true, true) => word + " ",
            (true, false) => format!(" {word}"),
            (false, _) => word,
        }
    }

    pub(super) fn word(&self, letter: char, length_mm: f64, unit_mm: f64) -> String {
        let letter = if self.is_small() { letter.to_ascii_lowercase() } else { letter };
        format!("{letter}{}", decimal(length_mm / unit_mm, self.step))
    }

    /// A word of the centre of a further piece; where Siemens says a place by `AC`, so does it.
    fn centre_word(&self, letter: char, axis: usize, length_mm: f64) -> String {
        let is_said =
            self.words.centre[axis].as_ref().is_some_and(|word| word.is_relative == self.words.is_centre_absolute);
        let word = self.word(letter, length_mm, self.words.unit_z_mm);
        if !is_said || self.dialect != Dialect::Siemens {
            return word;
        }
        let way = if self.words.is_centre_absolute { "IC" } else { "AC" };
        format!("{}={way}({})", &word[..1], &word[1..])
    }

    /// A line of its own for a further piece.
    fn further(&self, from: Point, to: Point) -> String {
        let base = if self.words.is_relative { from } else { [0.0; 2] };
        let blank = if self.has_blanks() { " " } else { "" };
        let mut line = self.word('X', to[0] - base[0], self.words.unit_x_mm);
        let _ = write!(line, "{blank}{}", self.word('Z', to[1] - base[1], self.words.unit_z_mm));
        if let Some(radius) = &self.words.radius {
            let is_name = self.dialect == Dialect::Siemens;
            let parted = if is_name { " " } else { blank };
            let _ = write!(line, "{parted}{}", &self.text[radius.clone()]);
        }
        if let Some(centre) = self.centre(from, to) {
            let base = self.centre_base(from);
            for (axis, letter) in ['I', 'K'].into_iter().enumerate() {
                let word = self.centre_word(letter, axis, centre[axis] - base[axis]);
                let _ = write!(line, "{blank}{word}");
            }
        }
        line
    }

    /// A number in the form of the one that it replaces.
    fn number(&self, length_mm: f64, old: &NumberInText) -> String {
        number_like(&self.text[old.range.clone()], length_mm, old, self.step)
    }
}

/// A number in the form of the one that it replaces, with no more decimals than a step has or it had.
pub(crate) fn number_like(before: &str, length_mm: f64, old: &NumberInText, step: f64) -> String {
    if let Some(step_mm) = old.step_mm {
        let steps = length_mm / step_mm;
        if (steps - steps.round()).abs() < 1e-6 {
            return format!("{:.0}", steps.round() + 0.0);
        }
    }
    let value = length_mm / old.unit_mm;
    let mut number = decimal(value, step);
    // As many decimals as there were.
    if let Some((_, decimals)) = before.split_once('.') {
        let kept = decimals.chars().filter(char::is_ascii_digit).count();
        let now = number.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        number.extend(std::iter::repeat_n('0', kept.saturating_sub(now)));
    }
    let bare = before.trim_start_matches(['+', '-']);
    if bare.starts_with('.') {
        number = number.replacen("0.", ".", 1);
    }
    if before.starts_with('+') && !number.starts_with('-') {
        number.insert(0, '+');
    }
    number
}

/// A number with a decimal point and no more decimals than it needs.
pub(crate) fn decimal(value: f64, step: f64) -> String {
    // A step has six decimals at the most.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let decimals = (-step.log10() - 1e-9).ceil().clamp(1.0, 6.0) as usize;
    let value = rounded(value, step) + 0.0;
    let mut text = format!("{value:.decimals$}");
    text.truncate(text.trim_end_matches('0').len());
    if text.starts_with("-0.") && value.abs() < 0.5 * step {
        text.remove(0);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_decimals_that_they_need() {
        let written = [21.995, 22.0, -0.0004, 0.5, -3.1].map(|value| decimal(value, 1e-3));
        assert_eq!(written, ["21.995", "22.", "0.", "0.5", "-3.1"]);
    }
}
