//! Cycles over a contour: roughing in passes along the axis, passes along the contour, and finishing (`program/2.4`).

use crate::calculator::Failure;

use super::arcs;
use super::block::Words;
use super::codes::Path;
use super::faults::{Notes, Spot};
use super::lexer;
use super::moves::{ContourCycle, CycleKind, Kind, Move, Place};
use super::words_of_line::says_way_alone;
use super::{Reader, whole};

/// Lengths that are no different, mm.
const SAME_MM: f64 = 1e-9;
/// Most passes of one cycle.
const MAX_PASSES: usize = 20_000;

/// What is done with the lines of a contour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    /// Passes along the axis up to it.
    RoughZ,
    /// Passes along it.
    Pattern,
    /// Run as they are.
    Finish,
}

/// A part of a contour: radius and z of its ends, mm.
#[derive(Debug, Clone, Copy)]
struct Element {
    start: [f64; 2],
    end: [f64; 2],
    arc: Option<([f64; 2], Path)>,
    line: usize,
}

impl Element {
    fn shifted(self, [r, z]: [f64; 2]) -> Self {
        let by = |point: [f64; 2]| [point[0] + r, point[1] + z];
        let arc = self.arc.map(|(centre, path)| (by(centre), path));
        Self { start: by(self.start), end: by(self.end), arc, line: self.line }
    }

    /// Its z where it has this radius.
    fn z_at(&self, r: f64) -> f64 {
        if let Some((centre, _)) = self.arc {
            return arcs::z_at(self.start, self.end, centre, r);
        }
        let rise = self.end[0] - self.start[0];
        let share = if rise.abs() <= SAME_MM { 1.0 } else { ((r - self.start[0]) / rise).clamp(0.0, 1.0) };
        self.start[1] + share * (self.end[1] - self.start[1])
    }
}

/// Where a contour stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lines {
    from: usize,
    to: usize,
}

impl<'a> Reader<'a> {
    /// A roughing cycle: the first of its two lines, or the one with the contour. Gives the line that comes next.
    pub(super) fn rough(
        &mut self,
        words: &mut Words<'_, 'a>,
        spot: Spot<'a>,
        by: Use,
    ) -> Result<Option<usize>, Failure> {
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
        let Some(contour) = self.contour_of(lines, by, spot)? else {
            return Ok(next);
        };
        let kind = if by == Use::RoughZ { CycleKind::RoughZ } else { CycleKind::Pattern };
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
            Use::RoughZ | Use::Finish => self.passes(&contour, spot, allowance),
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
            let (depth, retract) = (length(u), length(r));
            self.state.rough_depth = depth.or(self.state.rough_depth);
            self.state.rough_retract = retract.unwrap_or(self.state.rough_retract);
            if let Some(word) = w {
                self.notes.fault(word.spot, "word_not_used");
            }
        }
    }

    /// A finishing cycle. Gives the line that comes next.
    pub(super) fn finish(&mut self, words: &mut Words<'_, 'a>, spot: Spot<'a>) -> Result<Option<usize>, Failure> {
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

    fn refuse_nested(&mut self, words: &mut Words<'_, 'a>, spot: Spot<'a>) -> bool {
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

    /// The contour that roughing goes to, without the way to it and without rapid moves behind it.
    fn contour_of(&mut self, lines: Lines, by: Use, spot: Spot<'a>) -> Result<Option<Vec<Element>>, Failure> {
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
        let cut = along.iter().rposition(|one| one.kind.is_feed()).map_or(0, |last| last + 1);
        let elements = elements(start, &along[..cut]);
        let Some((approach, contour)) = elements.split_first().filter(|(_, rest)| !rest.is_empty()) else {
            self.notes.fault(spot, "contour_not_found");
            return Ok(None);
        };
        if by == Use::RoughZ && approach.end[0] > approach.start[0] + SAME_MM {
            self.notes.fault(spot, "inside_turning");
            return Ok(None);
        }
        if by == Use::RoughZ && self.refuse_not_monotone(contour) {
            return Ok(None);
        }
        Ok(Some(contour.to_vec()))
    }

    /// The radius never falls and z goes one way: the first part that does otherwise is a fault.
    fn refuse_not_monotone(&mut self, contour: &[Element]) -> bool {
        let direction = direction(contour);
        let turns = |one: &Element| {
            one.end[0] < one.start[0] - SAME_MM
                || (one.end[1] - one.start[1]) * direction < -SAME_MM
                || one.arc.is_some_and(|(centre, path)| arcs::turns_back(one.start, one.end, centre, path))
        };
        let Some(at) = contour.iter().find(|one| turns(one)).map(|one| one.line - 1) else {
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

    /// Passes along the axis down to the contour, then one along it; all of it leaves the allowances.
    fn passes(&mut self, contour: &[Element], spot: Spot<'a>, allowance: [f64; 2]) {
        let line = spot.line;
        let Some([x0, z0]) = self.state.place.known() else {
            return;
        };
        let Some(depth) = self.state.rough_depth.filter(|depth| *depth > 0.0) else {
            self.notes.fault(spot, "cycle_word_missing");
            return;
        };
        let contour: Vec<Element> = contour.iter().map(|one| one.shifted(allowance)).collect();
        let (Some(first), Some(last)) = (contour.first(), contour.last()) else {
            return;
        };
        let (r0, direction, retract) = (0.5 * x0, direction(&contour), self.state.rough_retract);
        let count = ((r0 - first.start[0] - SAME_MM) / depth).ceil() - 1.0;
        if count > MAX_PASSES as f64 {
            self.notes.fault_with(spot, "too_many_moves", |finding| finding.with("limit_moves", 4 * MAX_PASSES));
            return;
        }
        // A pass reaches the first part that is as high as it.
        let mut part = 0;
        let mut hits = Vec::new();
        // Below MAX_PASSES.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = count.max(0.0) as usize;
        let radii: Vec<f64> = (1..=count).map(|i| r0 - depth * i as f64).collect();
        for &r in radii.iter().rev() {
            while part + 1 < contour.len() && contour[part].end[0] < r {
                part += 1;
            }
            let one = &contour[part];
            hits.push(if one.end[0] < r { last.end[1] } else { one.z_at(r) });
        }
        for (&r, &z) in radii.iter().zip(hits.iter().rev()) {
            // What begins behind the start finds nothing to cut.
            if (z - z0) * direction <= 0.0 {
                continue;
            }
            let out = r + retract;
            self.go(line, Kind::Rapid, Place::at(2.0 * r, z0), None);
            self.go(line, Kind::Line, Place::at(2.0 * r, z), None);
            self.go(line, Kind::Line, Place::at(2.0 * out, z - retract * direction), None);
            self.go(line, Kind::Rapid, Place::at(2.0 * out, z0), None);
        }
        self.go(line, Kind::Rapid, Place::at(2.0 * first.start[0], z0), None);
        self.follow(line, &contour);
        self.go(line, Kind::Rapid, Place::at(x0, last.end[1]), None);
        self.go(line, Kind::Rapid, Place::at(x0, z0), None);
    }

    /// Passes along the contour, each nearer to it; the last one leaves the allowances.
    fn along_contour(&mut self, contour: &[Element], spot: Spot<'a>, allowance: [f64; 2]) {
        let line = spot.line;
        let Some([x0, z0]) = self.state.place.known() else {
            return;
        };
        let [shift_r, shift_z, count] = self.state.pattern.unwrap_or([0.0, 0.0, 1.0]);
        let passes = count.round().max(1.0);
        if passes * contour.len() as f64 > MAX_PASSES as f64 {
            self.notes.fault_with(spot, "too_many_moves", |finding| finding.with("limit_moves", MAX_PASSES));
            return;
        }
        // Below MAX_PASSES.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let passes = passes as usize;
        for pass in 0..passes {
            let left = if passes > 1 { 1.0 - pass as f64 / (passes - 1) as f64 } else { 0.0 };
            let shift = [allowance[0] + left * shift_r, allowance[1] + left * shift_z];
            let shifted: Vec<Element> = contour.iter().map(|one| one.shifted(shift)).collect();
            let (Some(first), Some(last)) = (shifted.first(), shifted.last()) else {
                return;
            };
            let out = (2.0 * last.end[0]).max(x0);
            self.go(line, Kind::Rapid, Place::at(2.0 * first.start[0], z0), None);
            self.follow(line, &shifted);
            self.go(line, Kind::Rapid, Place::at(out, last.end[1]), None);
            self.go(line, Kind::Rapid, Place::at(out, z0), None);
        }
        self.go(line, Kind::Rapid, Place::at(x0, z0), None);
    }

    /// At the feed to the beginning of a contour and along it.
    fn follow(&mut self, line: usize, contour: &[Element]) {
        let point = |[r, z]: [f64; 2]| Place::at(2.0 * r, z);
        if let Some(first) = contour.first() {
            self.go(line, Kind::Line, point(first.start), None);
        }
        for one in contour {
            match one.arc {
                None => self.go(line, Kind::Line, point(one.end), None),
                Some((centre, path)) => {
                    let kind = if path == Path::Clockwise { Kind::ArcCw } else { Kind::ArcCcw };
                    self.go(line, kind, point(one.end), Some([2.0 * centre[0], centre[1]]));
                }
            }
        }
    }
}

/// Which way a contour goes along the axis.
fn direction(contour: &[Element]) -> f64 {
    let ends = contour.first().zip(contour.last());
    if ends.is_some_and(|(first, last)| last.end[1] > first.start[1]) { 1.0 } else { -1.0 }
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
