//! Cycles of LinuxCNC over a contour (G70, G71, G72): it stands in a subprogram, and Q has its number (`program/2.4`).
//!
//! Of its blocks the ways alone count. They are run before anything else of the cycle; the control passes over them where they stand.

use std::ops::Range;

use crate::calculator::{Dialect, Failure};

use super::super::stock::{Way, path_beside};
use super::block::Words;
use super::codes::Path;
use super::contour::{Lines, Use};
use super::faults::{Notes, Spot};
use super::lexer;
use super::lines::Extent;
use super::moves::{ContourCycle, CycleKind, Kind, Nose, Place};
use super::passes::{Element, Sight, hits};
use super::state::INCH_MM;
use super::{Reader, whole};

/// Infeed and retract of a cycle that names none, in the unit of the program.
const INFEED: f64 = 1.0;
const RETRACT: f64 = 0.5;
/// Most passes of a finishing cycle.
const MOST_PASSES: f64 = 100.0;

/// A subprogram that a cycle calls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sub {
    number: u64,
    /// The lines that begin and end it.
    pub(super) from: usize,
    pub(super) to: usize,
}

/// Subprograms of a program for LinuxCNC that cycles over a contour call.
pub(super) fn called(text: &str, lines: &[Range<usize>], extent: &Extent, dialect: Dialect) -> Vec<Sub> {
    if dialect != Dialect::LinuxCnc {
        return Vec::new();
    }
    let of_line = |at: usize| &text[lines[at].clone()];
    let mut subs = Vec::new();
    let mut open: Option<(u64, usize)> = None;
    for at in extent.start..extent.end {
        match (named(of_line(at)), open) {
            (Some((number, true)), None) => open = Some((number, at)),
            (Some((number, false)), Some((begun, from))) if number == begun => {
                subs.push(Sub { number, from, to: at });
                open = None;
            }
            // What is nested is no contour.
            (Some(_), _) => open = None,
            (None, _) => {}
        }
    }
    if subs.is_empty() {
        return subs;
    }
    let mut calls = Vec::new();
    for at in extent.start..extent.end {
        let block = lexer::block(of_line(at), at + 1, dialect, &mut Notes::default());
        let is_cycle = block.words.iter().any(|word| word.letter == b'G' && (70.0..73.0).contains(&word.number()));
        let number = block.words.iter().find(|word| word.letter == b'Q').and_then(|word| whole(word.number()));
        calls.extend(number.filter(|_| is_cycle));
    }
    subs.retain(|sub| calls.contains(&sub.number));
    subs
}

/// The number of a subprogram that a line begins (`O100 SUB`) or ends (`O100 ENDSUB`), and which of both it does.
fn named(line: &str) -> Option<(u64, bool)> {
    let mut plain = String::new();
    let mut is_comment = false;
    for c in line.chars().take_while(|c| *c != ';') {
        match c {
            '(' => is_comment = true,
            ')' => is_comment = false,
            _ if is_comment || c.is_whitespace() => {}
            _ => plain.push(c.to_ascii_lowercase()),
        }
    }
    let rest = plain.strip_prefix('o')?;
    let digits = rest.find(|c: char| !c.is_ascii_digit())?;
    let number = rest[..digits].parse().ok()?;
    match &rest[digits..] {
        "sub" => Some((number, true)),
        "endsub" => Some((number, false)),
        _ => None,
    }
}

impl<'a> Reader<'a> {
    /// G71 and G72: passes down to the contour, then one along it, all beside it by D. The tool stays where that ends.
    pub(super) fn rough_sub(&mut self, words: &mut Words<'_, 'a>, spot: Spot<'a>, by: Use) -> Result<(), Failure> {
        let Some((lines, start)) = self.called(words, spot) else { return Ok(()) };
        let unit = if self.state.inch { INCH_MM } else { 1.0 };
        let [beside_mm, infeed_mm, retract_mm] =
            [(b'D', 0.0), (b'I', INFEED * unit), (b'R', RETRACT * unit)].map(|(letter, usual)| {
                let word = words.take(letter);
                word.map_or(usual, |word| self.length(word))
            });
        if self.state.nose != Nose::Off {
            self.notes.fault(spot, "cycle_not_read");
            return Ok(());
        }
        self.go(spot.line, Kind::Rapid, start, None);
        let Some((contour, sight)) = self.contour_of(lines, by, spot)? else { return Ok(()) };
        let Some(contour) = self.beside(contour, beside_mm, spot) else { return Ok(()) };
        let kind = if by == Use::RoughX { CycleKind::RoughX } else { CycleKind::RoughZ };
        self.keep_cycle(kind, lines, spot, beside_mm);
        if infeed_mm > 0.0 {
            self.passes_of_sub((&contour, sight), spot, [infeed_mm, retract_mm]);
        } else {
            self.notes.fault(spot, "cycle_word_missing");
        }
        self.state.motion = None;
        Ok(())
    }

    /// Passes as LinuxCNC makes them: each begins on the straight way from the start to the contour and goes back rapidly. At last it
    /// goes along the contour, and out to the level of the start.
    fn passes_of_sub(&mut self, (contour, sight): (&[Element], Sight), spot: Spot<'a>, by_mm: [f64; 2]) {
        let [infeed_mm, retract_mm] = by_mm;
        let seen: Vec<Element> = contour.iter().map(|one| one.with(|point| sight.of(point))).collect();
        let (Some([x, z]), Some(first), Some(last)) = (self.state.place.known(), seen.first(), seen.last()) else {
            return;
        };
        let ([top, begin], direction) = (sight.of([0.5 * x, z]), sight.direction(contour));
        let Some(levels) = self.levels(top, first.start[0], infeed_mm, spot) else { return };
        let line = spot.line;
        for (&level, hit) in levels.iter().zip(hits(&levels, &seen)) {
            let begins = begin + (top - level) / (top - first.start[0]) * (first.start[1] - begin);
            // A pass that begins behind where it would end cuts nothing.
            let length = (hit - begins) * direction;
            if length.is_nan() || length <= 0.0 {
                continue;
            }
            let out = retract_mm.min(0.5 * length);
            self.go(line, Kind::Rapid, sight.place([level, begins]), None);
            self.go(line, Kind::Line, sight.place([level, hit]), None);
            self.go(line, Kind::Rapid, sight.place([level + out, hit - out * direction]), None);
            self.go(line, Kind::Rapid, sight.place([level + out, begins + out * direction]), None);
            self.go(line, Kind::Rapid, sight.place([level, begins]), None);
        }
        self.go(line, Kind::Rapid, sight.place(first.start), None);
        self.along(Some(line), contour);
        self.go(line, Kind::Line, sight.place([top.max(last.end[0]), last.end[1]]), None);
    }

    /// G70: so many passes along the contour, the first one beside it by D, the last one by E.
    pub(super) fn finish_sub(&mut self, words: &mut Words<'_, 'a>, spot: Spot<'a>) -> Result<(), Failure> {
        let Some((lines, start)) = self.called(words, spot) else { return Ok(()) };
        let [first_mm, last_mm] = [b'D', b'E'].map(|letter| words.take(letter).map_or(0.0, |word| self.length(word)));
        let count = words.take(b'P').map_or(1.0, |word| word.number());
        if !(1.0..=MOST_PASSES).contains(&count) {
            self.notes.fault(spot, "cycle_word_missing");
            return Ok(());
        }
        let made = (self.moves.len(), self.state.speed());
        self.go(spot.line, Kind::Rapid, start, None);
        let Some((contour, _)) = self.contour_of(lines, Use::Finish, spot)? else { return Ok(()) };
        self.keep_cycle(CycleKind::Finishing, lines, spot, last_mm);
        // At most MOST_PASSES.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        for pass in (0..count as usize).rev() {
            let beside_mm = pass as f64 * (first_mm - last_mm) / count + last_mm;
            let Some(along) = self.beside(contour.clone(), beside_mm, spot) else { return Ok(()) };
            self.go(spot.line, Kind::Rapid, start, None);
            if let Some(first) = along.first() {
                self.go(spot.line, Kind::Rapid, Place::at(2.0 * first.start[0], first.start[1]), None);
            }
            self.along(None, &along);
        }
        self.keep_call(words, made, true);
        self.state.motion = None;
        Ok(())
    }

    /// The lines of the contour that Q names, and where the cycle begins: at X and Z, or where the tool is.
    fn called(&mut self, words: &mut Words<'_, 'a>, spot: Spot<'a>) -> Option<(Lines, Place)> {
        if self.refuse_nested(words, spot) {
            return None;
        }
        let q = words.take(b'Q');
        let number = q.and_then(|q| whole(q.number()));
        let sub = self.subs.iter().find(|sub| Some(sub.number) == number).copied();
        // The control runs it with absolute words alone.
        let (Some(sub), false) = (sub.filter(|sub| sub.to > sub.from + 1), self.state.is_relative) else {
            let code = if self.state.is_relative { "cycle_not_read" } else { "contour_not_found" };
            self.notes.fault(q.map_or(spot, |q| q.spot), code);
            words.take_rest();
            return None;
        };
        let start = self.target(words);
        self.may_cut(spot, start).then_some((Lines::of(sub.from + 1, sub.to - 1), start))
    }

    fn keep_cycle(&mut self, kind: CycleKind, lines: Lines, spot: Spot<'a>, beside_mm: f64) {
        let (from_line, to_line) = lines.told();
        self.cycles.push(ContourCycle {
            line: spot.line,
            kind,
            from_line,
            to_line,
            allowance_x_diameter_mm: 2.0 * beside_mm,
            allowance_z_mm: beside_mm,
        });
    }

    /// A contour at a distance to the side of the stock.
    fn beside(&mut self, contour: Vec<Element>, by_mm: f64, spot: Spot<'a>) -> Option<Vec<Element>> {
        if by_mm.abs() <= 0.0 {
            return Some(contour);
        }
        let ends = contour.first().zip(contour.last())?;
        let (goes_on, line) = (ends.1.end[1] > ends.0.start[1], ends.0.line);
        // The stock lies farther off the axis: to the right of a contour toward the headstock.
        let nose = if goes_on == (by_mm > 0.0) { Nose::Left } else { Nose::Right };
        let ways: Vec<Way> = contour.iter().map(Element::way).collect();
        let found = path_beside(&ways, nose, by_mm.abs());
        if found.is_none() {
            self.notes.fault(spot, "contour_not_monotone");
        }
        Some(found?.into_iter().map(|way| Element::of(way, line)).collect())
    }
}

impl Element {
    /// The same as a way over the axis.
    fn way(&self) -> Way {
        let point = |[r, z]: [f64; 2]| [z, r];
        let (start, end) = (point(self.start), point(self.end));
        let Some((centre, path)) = self.arc else { return Way::Line(start, end) };
        let centre = point(centre);
        let angle = |point: [f64; 2]| (point[1] - centre[1]).atan2(point[0] - centre[0]);
        let by = angle(end) - angle(start);
        let turn = match path {
            Path::Clockwise => -(-by).rem_euclid(std::f64::consts::TAU),
            _ => by.rem_euclid(std::f64::consts::TAU),
        };
        let radius = (start[0] - centre[0]).hypot(start[1] - centre[1]);
        Way::Arc { centre, radius, from: angle(start), turn }
    }

    fn of(way: Way, line: usize) -> Self {
        let point = |[z, r]: [f64; 2]| [r, z];
        let arc = match way {
            Way::Line(..) => None,
            Way::Arc { centre, turn, .. } => {
                Some((point(centre), if turn < 0.0 { Path::Clockwise } else { Path::CounterClockwise }))
            }
        };
        let [start, end] = way.ends().map(point);
        Self { start, end, arc, line }
    }
}
