//! A line that makes one move, and the lines that it becomes with its shifts (`program/6`).

use std::fmt::Write as _;
use std::ops::Range;

use super::super::super::job::{Dialect, Mode};
use super::super::reader::{Kind, NumberInText, ProgramMove, WordsOfLine, centre_of_short_arc};
use super::numbers::{decimal, number_like, rounded};
use super::plan::Shifts;

/// Lengths that are no different, mm.
const SAME_MM: f64 = 1e-7;
/// Least step of an inch that controls have, inch.
const INCH_STEP: f64 = 1e-4;
const MM_PER_UM: f64 = 1e-3;

/// Where the tool is after a move: diameter and z, mm.
pub(super) type Point = [f64; 2];

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
    pub(super) fn rewritten(
        &self,
        pieces: &[Piece],
        from: Option<Point>,
        meant: Option<Point>,
    ) -> Option<(Vec<String>, Point)> {
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
