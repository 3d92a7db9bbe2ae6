//! From the text of a program to its moves (`program/2`).
//!
//! `lines` -> `lexer` (words with their places) -> `block` (modal state, one block after another) with `values` (speeds, feeds, lengths)
//! -> `act` (what a block does) -> `moves`; `codes` has what
//! each control means by its words, `cycles`, `contour`, `subs` and `passes` expand what stands for many moves, `arcs` finds centres. Nothing is
//! guessed: what is not understood is a fault with its place, or, where it leaves the position known, passed with a warning.

mod act;
mod arcs;
mod block;
mod codes;
mod contour;
mod cycles;
mod faults;
mod hints;
mod lexer;
mod lines;
mod moves;
mod passes;
mod state;
mod subs;
mod values;
mod words_of_line;

use std::collections::BTreeMap;
use std::ops::Range;

use crate::calculator::{Failure, Finding, Monitor, checkpoint};

use super::super::job::{Dialect, Reading};
use faults::{Notes, Spot};
use lexer::Block;
use lines::Extent;
use moves::{Move, Place};
use state::State;

pub(crate) use arcs::centre_of_short_arc;
pub(crate) use lines::lines as lines_of_text;
pub use moves::{ContourCycle, CycleKind, Kind, Nose};
pub(crate) use moves::{Feed, Move as ProgramMove, Speed};
pub(crate) use words_of_line::{Call, FeedOfLine, NumberInText, WordsOfLine};

/// Most lines of a program.
pub const MAX_LINES: usize = 200_000;
/// Most moves after cycles are expanded.
pub const MAX_MOVES: usize = 1_000_000;
/// Most characters of a line.
const MAX_LINE: usize = 4096;
/// Lines between two looks at whether anybody waits.
const LINES_PER_LOOK: usize = 500;

/// Faults of a program.
pub(crate) const FAULT_CODES: &[&str] = &[
    "too_many_lines",
    "too_many_moves",
    "nul_byte",
    "line_too_long",
    "comment_not_closed",
    "text_not_closed",
    "word_without_number",
    "stray_text",
    "number_too_large",
    "block_delete_inside",
    "decimal_point_unclear",
    "variable_in_program",
    "expression_in_program",
    "jump_in_program",
    "subprogram",
    "macro_call",
    "cycle_not_read",
    "drawing_dimension",
    "unknown_g",
    "unknown_word",
    "modal_group_twice",
    "word_twice",
    "word_not_used",
    "axis_not_turned",
    "wrong_plane",
    "polar_or_cylinder",
    "offset_change",
    "frame_turned",
    "inverse_time_feed",
    "spline",
    "probing",
    "arc_form_not_read",
    "arc_radius_mismatch",
    "arc_radius_too_small",
    "arc_not_defined",
    "motion_not_said",
    "position_unknown",
    "feed_missing",
    "cycle_word_missing",
    "contour_not_found",
    "contour_not_monotone",
    "cycle_in_contour",
    "inside_turning",
    "nothing_in_program",
    "dialect_looks_like",
];

/// What is said of a program that is read.
pub(crate) const WARNING_CODES: &[&str] = &[
    "mode_assumed",
    "thread_passed",
    "cycle_passed",
    "unknown_m",
    "feed_unit_not_switched",
    "text_beside_program",
    "lines_after_end",
];

/// A program that is read.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Program {
    /// How many lines it has.
    pub(crate) lines: usize,
    /// Its moves in the order of execution.
    pub(crate) moves: Vec<Move>,
    /// Its tools, as it calls them.
    pub(crate) tools: Vec<String>,
    /// The cycles that were expanded.
    pub(crate) cycles: Vec<ContourCycle>,
    /// The words of the lines that make one move along a path; none of a line that makes several.
    pub(crate) words_of_lines: BTreeMap<usize, Option<WordsOfLine>>,
    /// Where lines say their feed.
    pub(crate) feeds_of_lines: BTreeMap<usize, FeedOfLine>,
    /// The single cycles and finishing cycles, in the order of execution.
    pub(crate) calls: Vec<Call>,
    /// What is to be said of it.
    pub(crate) warnings: Vec<Finding>,
}

/// Reads a program.
pub(crate) fn read(text: &str, dialect: Dialect, reading: &Reading, monitor: &dyn Monitor) -> Result<Program, Failure> {
    let lines = lines::lines(text);
    let mut notes = Notes::default();
    if lines.len() > MAX_LINES {
        let spot = Spot { line: MAX_LINES + 1, column: 1, word: "" };
        notes.fault_with(spot, "too_many_lines", |finding| finding.measured(lines.len() as f64, MAX_LINES as f64, "1"));
        return Err(refused(notes));
    }
    for (i, line) in lines.iter().enumerate() {
        let line = &text[line.clone()];
        let first = |end: usize| Spot { line: i + 1, column: end, word: "" };
        if line.len() > MAX_LINE && line.chars().count() > MAX_LINE {
            notes.fault(first(MAX_LINE + 1), "line_too_long");
        }
        if let Some(before) = line.split('\0').next().filter(|before| before.len() < line.len()) {
            notes.fault(first(before.chars().count() + 1), "nul_byte");
        }
    }
    if notes.count() > 0 {
        return Err(refused(notes));
    }
    let extent = Extent::of(text, &lines, dialect);
    let mut reader = Reader {
        text,
        lines: &lines,
        subs: subs::called(text, &lines, &extent, dialect),
        extent,
        dialect,
        reading,
        notes,
        state: State::new(dialect, reading),
        moves: Vec::new(),
        tools: Vec::new(),
        cycles: Vec::new(),
        words_of_lines: BTreeMap::new(),
        feeds_of_lines: BTreeMap::new(),
        calls: Vec::new(),
        numbers: None,
        contour: None,
        contours: Vec::new(),
        blocks: 0,
        is_over: false,
        is_doubtful: false,
        is_unclear: false,
        unknown_functions: Vec::new(),
    };
    reader.run(monitor)?;
    let Reader { mut notes, moves, tools, cycles, words_of_lines, feeds_of_lines, calls, .. } = reader;
    if notes.count() == 0 && moves.is_empty() {
        notes.fault(Spot { line: 1, column: 1, word: "" }, "nothing_in_program");
    }
    if notes.count() > 0 {
        return Err(refused_with(notes, hints::other_dialect(text, &lines, dialect)));
    }
    let (_, _, warnings) = notes.into_parts();
    Ok(Program { lines: lines.len(), moves, tools, cycles, words_of_lines, feeds_of_lines, calls, warnings })
}

impl Program {
    /// The line at which a move is executed: of the lines of a contour that of the cycle that runs them.
    pub(crate) fn executed_at(&self, index: usize) -> usize {
        let behind = self.calls.partition_point(|call| call.moves.start <= index);
        let call = behind.checked_sub(1).and_then(|at| self.calls.get(at)).filter(|call| call.moves.contains(&index));
        call.map_or_else(|| self.moves.get(index).map_or(0, |one| one.line), |call| call.line)
    }
}

fn refused(notes: Notes) -> Failure {
    refused_with(notes, None)
}

fn refused_with(notes: Notes, hint: Option<Finding>) -> Failure {
    let (mut findings, total, _) = notes.into_parts();
    let total = total + usize::from(hint.is_some());
    findings.extend(hint);
    Failure::NotRead { findings, total }
}

/// A program while it is read.
struct Reader<'a> {
    text: &'a str,
    lines: &'a [Range<usize>],
    extent: Extent,
    dialect: Dialect,
    reading: &'a Reading,
    notes: Notes,
    state: State,
    moves: Vec<Move>,
    tools: Vec<String>,
    cycles: Vec<ContourCycle>,
    words_of_lines: BTreeMap<usize, Option<WordsOfLine>>,
    feeds_of_lines: BTreeMap<usize, FeedOfLine>,
    calls: Vec<Call>,
    /// Lines by the numbers of their blocks, once they are asked for.
    numbers: Option<Vec<(u64, usize)>>,
    /// What is done with the contour whose lines are run.
    contour: Option<contour::Use>,
    /// Contours that were asked for, by the numbers of their blocks.
    contours: Vec<([Option<u64>; 2], contour::Lines)>,
    /// Subprograms that are the contour of a cycle.
    subs: Vec<subs::Sub>,
    /// Blocks that were run, contours each time.
    blocks: usize,
    /// Whether the program has ended.
    is_over: bool,
    /// Whether something was not read, so that what follows from it is not blamed on other words.
    is_doubtful: bool,
    /// Whether a word without a decimal point was told.
    is_unclear: bool,
    /// M codes that are not known and were told.
    unknown_functions: Vec<u64>,
}

impl<'a> Reader<'a> {
    fn run(&mut self, monitor: &dyn Monitor) -> Result<(), Failure> {
        checkpoint(monitor)?;
        if let Some(line) = self.extent.beside {
            self.notes.warn(Spot { line: line + 1, column: 1, word: self.line(line) }, "text_beside_program");
        }
        let mut at = self.extent.start;
        while at < self.extent.end {
            if at.is_multiple_of(LINES_PER_LOOK) {
                checkpoint(monitor)?;
            }
            if self.is_over {
                self.after_end(at);
                break;
            }
            // A contour is run by its cycles.
            let sub = self.subs.iter().find(|sub| sub.from == at).map(|sub| sub.to + 1);
            at = match sub {
                Some(behind) => behind,
                None => self.step(at)?.max(at + 1),
            };
        }
        Ok(())
    }

    /// Runs a line; gives the line that comes next.
    fn step(&mut self, at: usize) -> Result<usize, Failure> {
        self.blocks += 1;
        if self.blocks > MAX_MOVES || self.moves.len() > MAX_MOVES {
            let spot = Spot { line: at + 1, column: 1, word: "" };
            self.notes.fault_with(spot, "too_many_moves", |finding| finding.with("limit_moves", MAX_MOVES));
            return Err(refused(std::mem::take(&mut self.notes)));
        }
        let block = self.block(at);
        let next = if block.has_stroke && self.reading.block_delete { None } else { self.execute(&block)? };
        Ok(next.unwrap_or(at + 1))
    }

    fn line(&self, at: usize) -> &'a str {
        &self.text[self.lines[at].clone()]
    }

    fn block(&mut self, at: usize) -> Block<'a> {
        lexer::block(self.line(at), at + 1, self.dialect, &mut self.notes)
    }

    /// Says that something stands behind the end of the program.
    fn after_end(&mut self, from: usize) {
        if let Some(at) = (from..self.extent.end).find(|&at| self.says_something(at)) {
            self.notes.warn(Spot { line: at + 1, column: 1, word: self.line(at) }, "lines_after_end");
        }
    }

    /// Whether more than blanks or a comment stands on a line.
    fn says_something(&self, at: usize) -> bool {
        !matches!(self.line(at).trim().chars().next(), None | Some('(' | ';'))
    }

    /// A move from where the tool is, which is then at its end.
    fn go(&mut self, line: usize, kind: Kind, end: Place, centre: Option<[f64; 2]>) {
        let state = &self.state;
        // A cycle that is passed cuts at the feed as well.
        let feed = if kind.is_feed() || kind == Kind::Opaque { state.feed } else { None };
        self.moves.push(Move {
            line,
            kind,
            end,
            centre,
            feed,
            speed: state.speed(),
            tool: state.tool,
            nose: state.nose,
        });
        self.state.place = end;
    }

    /// Lines of the blocks with this number: the next one behind a line, else the first.
    fn line_of_number(&mut self, number: f64, behind: usize) -> Option<usize> {
        let wanted = whole(number)?;
        if self.numbers.is_none() {
            let mut found = Vec::new();
            for at in self.extent.start..self.extent.end {
                // Its faults are told when it is run.
                let block = lexer::block(self.line(at), at + 1, self.dialect, &mut Notes::default());
                found.extend(block.number.and_then(whole).map(|number| (number, at)));
            }
            found.sort_unstable();
            self.numbers = Some(found);
        }
        let numbers = self.numbers.as_deref().unwrap_or_default();
        let from = numbers.partition_point(|&(number, at)| (number, at) <= (wanted, behind));
        let first = numbers.partition_point(|&(number, _)| number < wanted);
        [from, first]
            .into_iter()
            .filter_map(|i| numbers.get(i))
            .find(|(number, _)| *number == wanted)
            .map(|&(_, at)| at)
    }
}

/// A whole number, not negative.
fn whole(number: f64) -> Option<u64> {
    // Numbers of words are below 10^9.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    ((0.0..1e12).contains(&number) && number.fract().abs() < 1e-9).then_some(number as u64)
}
