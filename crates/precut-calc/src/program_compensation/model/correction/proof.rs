//! The corrected program read and driven again (`program/7`): a program that fails is not given back.

use std::collections::BTreeMap;

use crate::calculator::{Failure, Finding, Monitor};
use crate::deflection_compensation::Holding;

use super::super::super::job::{Job, ProgramStock, SupportLines};
use super::super::reader::{self, Feed, Program, ProgramMove, Speed};
use super::super::stock::{Part, Turned, lines_that_finish, turned};
use super::super::yielding::{ContourError, Driven, Yielded, contour, yielding};
use super::compare::{Off, differences};
use super::plan::Jump;
use super::rewrite::Written;

/// Why a corrected program is not given back.
pub(crate) const FAILURE_CODES: &[&str] = &["proof_failed"];

/// Places that should be one differ by less, mm.
const SAME_MM: f64 = 1e-6;
/// Feeds and speeds differ by a smaller share.
const SAME_SHARE: f64 = 1e-9;
/// A rapid move is deeper in the stock than before by more, mm.
const DEEPER_MM: f64 = 1e-3;
/// Rapid moves keep so far off the work, or as far as they did, mm.
const KEEP_OFF_MM: f64 = 0.1;
/// A stretch that is thick begins no farther before the first place that is, mm.
const BESIDE_MM: f64 = 0.1;
const MM_PER_UM: f64 = 1e-3;
const UM_PER_MM: f64 = 1e3;

/// A program that is to be corrected.
pub(crate) struct Task<'a> {
    pub(crate) program: &'a Program,
    pub(crate) job: &'a Job,
    pub(crate) holding: &'a Holding,
    pub(crate) blank: (&'a ProgramStock, f64),
    pub(crate) turned: &'a Turned,
    /// The given program as it is driven, and with its moves as they should come out.
    pub(crate) before: &'a Yielded,
    pub(crate) planned: &'a Yielded,
}

/// A stretch over which the work stays thick, because the shift jumps there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Transition {
    pub(crate) line: usize,
    pub(crate) from_mm: f64,
    pub(crate) to_mm: f64,
    /// By how much the diameter is thick there at the most, um.
    pub(crate) leaves_um: f64,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Proof {
    /// Error of the diameter along the contour outside transitions, um: before and after.
    pub(crate) before_um: [f64; 2],
    pub(crate) after_um: [f64; 2],
    /// How far the radius is off what the corrected moves should leave, outside transitions, at the most, um, and where.
    pub(crate) residual_um: f64,
    pub(crate) residual_at_mm: f64,
    /// How near rapid moves come to the work that yields, where they come within 1 mm, mm: before and after.
    pub(crate) clearance_mm: [Option<f64>; 2],
    pub(crate) transitions: Vec<Transition>,
    /// Lines that are as they were, and moves that were read again as they were.
    pub(crate) lines_compared: usize,
    pub(crate) moves_compared: usize,
    /// The error along the contour after it.
    pub(crate) contour: Vec<ContourError>,
}

/// What a corrected program failed in.
pub(crate) enum Failed {
    /// It could not be driven.
    Else(Failure),
    /// A part of the proof, in a line of the given program.
    Part { part: &'static str, line: usize, off_um: f64 },
    /// The work comes out too thin beside jumps of the shift: a chord that climbs is pushed off by less.
    Thin(Vec<Off>),
}

impl From<Failure> for Failed {
    fn from(failure: Failure) -> Self {
        Self::Else(failure)
    }
}

impl From<Failed> for Failure {
    fn from(failed: Failed) -> Self {
        match failed {
            Failed::Else(failure) => failure,
            Failed::Part { part, line, off_um } => Self::OutOfModel(
                Finding::new("proof_failed", "/nc_program")
                    .with("part", part)
                    .with("line", line)
                    .with("off_um", off_um),
            ),
            Failed::Thin(places) => {
                let worst = places.iter().copied().min_by(|a, b| a.by_mm.total_cmp(&b.by_mm));
                let (line, off_mm) = worst.map_or((1, 0.0), |off| (off.line.unwrap_or(1), off.by_mm));
                Failed::Part { part: "contour", line, off_um: UM_PER_MM * off_mm }.into()
            }
        }
    }
}

/// Reads and drives the corrected program.
pub(crate) fn proved(
    task: &Task<'_>,
    written: &Written,
    jumps: &[Jump],
    monitor: &dyn Monitor,
) -> Result<Proof, Failed> {
    let Task { program, job, holding, blank, .. } = *task;
    let mut again = job.clone();
    again.nc_program.clone_from(&written.text);
    again.support_lines = moved_supports(job, written);
    let read = reader::read(&written.text, again.dialect, &again.reading, monitor)?;
    let moves_compared = compare(program, &read, written)?;
    let driven_rigid = turned(&read, &again, blank, monitor)?;
    for one in &driven_rigid.in_stock {
        let line = written.given_line(one.line);
        let old = task.turned.in_stock.iter().find(|old| old.line == line).map_or(0.0, |old| old.depth_mm);
        if one.depth_mm > old + DEEPER_MM {
            return Err(Failed::Part { part: "rapid", line, off_um: UM_PER_MM * (one.depth_mm - old) });
        }
    }
    // A program that comes there as it is was not corrected.
    if let Some(hit) = driven_rigid.hits.first() {
        let line = written.given_line(hit.line);
        return Err(Failed::Part { part: "keep_out", line, off_um: UM_PER_MM * hit.depth_mm });
    }
    let finishing = lines_that_finish(&driven_rigid);
    let of = written.moves();
    // What comes before the first line that makes the contour is driven again where it is not what it was.
    let same = task.before.moves_before_contour();
    let is_same = program.moves.get(..same) == read.moves.get(..same)
        && read.moves.iter().take(same).all(|one| finishing.binary_search(&one.line).is_err());
    let goes_on = is_same.then_some(task.before);
    let driven = Driven { goes_on, ..Driven::as_it_is(&finishing) };
    let mut after = yielding(&read, &again, holding, blank, driven, monitor)?;
    // What was meant is what the given program means.
    after.nominal.clone_from(&task.before.nominal);
    let residual_mm = (job.mode.chord_tolerance_um + job.mode.increment_um) * MM_PER_UM;
    keep_off(task.before, &after, (&of, program), residual_mm)?;
    let Compared { residual_um, residual_at_mm, transitions } =
        outlines(&task.planned.real, &after.real, jumps, residual_mm)?;
    let errors = contour(&after);
    // Transitions follow each other along the work.
    let is_counted = |error: &&ContourError| {
        let next = transitions.partition_point(|one| one.to_mm + SAME_MM < error.z_mm);
        !transitions.get(next).is_some_and(|one| one.from_mm - SAME_MM <= error.z_mm)
    };
    let ends = |errors: &[ContourError]| {
        let counted = errors.iter().filter(is_counted).map(|error| error.error_um);
        counted.fold([0.0_f64, 0.0_f64], |[low, high], error| [low.min(error), high.max(error)])
    };
    let nearest = |yielded: &Yielded| yielded.rapids.iter().map(|one| one.gap_mm).reduce(f64::min);
    Ok(Proof {
        before_um: ends(&contour(task.before)),
        after_um: ends(&errors),
        residual_um,
        residual_at_mm,
        clearance_mm: [nearest(task.before), nearest(&after)],
        transitions,
        lines_compared: program.lines - written.changed.len(),
        moves_compared,
        contour: errors,
    })
}

/// The lines of the new text in which supports act.
pub(crate) fn moved_supports(job: &Job, written: &Written) -> Vec<SupportLines> {
    let moved = |line: u32| u32::try_from(written.line(line as usize)).unwrap_or(line);
    // The first piece of a line stands where the line stood.
    let of = |lines: &SupportLines| SupportLines {
        from_line: lines.from_line.map(|from| moved(from.saturating_sub(1)) + 1),
        to_line: lines.to_line.map(moved),
        ..*lines
    };
    job.support_lines.iter().map(of).collect()
}

/// No rapid move comes nearer to the work than before, but for those that keep well off.
fn keep_off(before: &Yielded, after: &Yielded, (of, program): (&[usize], &Program), by_mm: f64) -> Result<(), Failed> {
    let old: BTreeMap<usize, f64> = before.rapids.iter().map(|one| (one.mv, one.gap_mm)).collect();
    for one in &after.rapids {
        let Some(&mv) = of.get(one.mv) else { continue };
        let was = old.get(&mv).copied().unwrap_or(f64::INFINITY);
        // One that begins where a cut ended stands in the work that comes back: rigid work says what is to be said of it.
        if was > 0.0 && one.gap_mm < was.min(KEEP_OFF_MM) - by_mm {
            let line = program.moves.get(mv).map_or(1, |one| one.line);
            return Err(Failed::Part { part: "rapid", line, off_um: UM_PER_MM * (was - one.gap_mm) });
        }
    }
    Ok(())
}

/// What is left against what should be.
struct Compared {
    residual_um: f64,
    residual_at_mm: f64,
    transitions: Vec<Transition>,
}

/// Nowhere thinner than it should be, and thicker only where the shift jumps.
fn outlines(planned: &[Part], real: &[Part], jumps: &[Jump], residual_mm: f64) -> Result<Compared, Failed> {
    let mut compared = Compared { residual_um: 0.0, residual_at_mm: 0.0, transitions: Vec::new() };
    let (mut thin, mut before_mm, mut is_open): (Vec<Off>, f64, bool) = (Vec::new(), f64::NEG_INFINITY, false);
    let mut over = Over::of(jumps);
    for off in differences(planned, real) {
        let Off { z_mm, by_mm: off_mm, line } = off;
        let off_um = UM_PER_MM * off_mm;
        let jump = over.first_at(z_mm);
        let is_thick = off_mm > residual_mm;
        if off_mm < -residual_mm {
            thin.push(off);
        } else if !is_thick && off_um.abs() > compared.residual_um {
            (compared.residual_um, compared.residual_at_mm) = (off_um.abs(), z_mm);
        } else if is_thick && jump.is_none() && !is_open {
            return Err(Failed::Part { part: "contour", line: line.unwrap_or(1), off_um });
        }
        // A stretch reaches from the last place before it to the first one behind it.
        match compared.transitions.last_mut().filter(|_| is_open) {
            Some(last) => {
                last.to_mm = z_mm;
                last.leaves_um = last.leaves_um.max(2.0 * off_um);
            }
            None if is_thick => compared.transitions.push(Transition {
                line: jump.map_or(1, |jump| jump.line),
                from_mm: before_mm.max(z_mm - BESIDE_MM),
                to_mm: z_mm,
                leaves_um: 2.0 * off_um,
            }),
            None => {}
        }
        (is_open, before_mm) = (is_thick, z_mm);
    }
    if thin.is_empty() { Ok(compared) } else { Err(Failed::Thin(thin)) }
}

/// Jumps over places that follow each other along the work: a program of many short blocks has as many of them.
struct Over<'a> {
    jumps: &'a [Jump],
    /// In the order in which they begin; how many have begun, and which of them go on.
    order: Vec<usize>,
    begun: usize,
    open: Vec<usize>,
}

impl<'a> Over<'a> {
    fn of(jumps: &'a [Jump]) -> Self {
        let mut order: Vec<usize> = (0..jumps.len()).collect();
        order.sort_by(|&a, &b| jumps[a].from_mm.total_cmp(&jumps[b].from_mm));
        Self { jumps, order, begun: 0, open: Vec::new() }
    }

    /// The first of them over a place that is no nearer to the headstock than the one before.
    fn first_at(&mut self, z_mm: f64) -> Option<&'a Jump> {
        while let Some(&next) = self.order.get(self.begun).filter(|&&next| self.jumps[next].from_mm <= z_mm) {
            self.open.push(next);
            self.begun += 1;
        }
        self.open.retain(|&jump| self.jumps[jump].to_mm >= z_mm);
        self.open.iter().min().map(|&jump| &self.jumps[jump])
    }
}

/// Every move is as it was, but for the places at which corrected ones end.
fn compare(old: &Program, new: &Program, written: &Written) -> Result<usize, Failed> {
    let mut found = new.moves.iter();
    let mut compared = 0;
    let failed = |line: usize| Failed::Part { part: "read_again", line, off_um: 0.0 };
    for (index, (one, &pieces)) in old.moves.iter().zip(&written.pieces).enumerate() {
        let own: Vec<&ProgramMove> = found.by_ref().take(pieces).collect();
        let is_same = own.len() == pieces
            && own.iter().all(|piece| {
                (piece.kind, piece.tool, piece.nose) == (one.kind, one.tool, one.nose) && is_as_fast(piece, one)
            })
            && own.last().is_some_and(|last| ends_where(one, last, written.shift_mm[index]));
        if !is_same {
            return Err(failed(one.line));
        }
        compared += usize::from(pieces == 1);
    }
    match found.next() {
        Some(more) => Err(failed(written.given_line(more.line))),
        None => Ok(compared),
    }
}

/// Whether feed and speed are the same, however they are written.
fn is_as_fast(a: &ProgramMove, b: &ProgramMove) -> bool {
    let same = |a: f64, b: f64| (a - b).abs() <= SAME_SHARE * a.abs();
    let same_feed = match (a.feed, b.feed) {
        (Some(Feed::PerRev(a)), Some(Feed::PerRev(b))) | (Some(Feed::PerMinute(a)), Some(Feed::PerMinute(b))) => {
            same(a, b)
        }
        (a, b) => a == b,
    };
    let same_speed = match (a.speed, b.speed) {
        (Some(Speed::Spindle(a)), Some(Speed::Spindle(b))) => same(a, b),
        (Some(Speed::Surface(a, limit)), Some(Speed::Surface(b, other))) => same(a, b) && limit == other,
        (a, b) => a == b,
    };
    same_feed && same_speed
}

/// Whether a move ends where it did, or, where it was corrected, at the same place along the axis.
fn ends_where(old: &ProgramMove, new: &ProgramMove, shift_mm: f64) -> bool {
    let same = |a: Option<f64>, b: Option<f64>, within: f64| match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() <= within,
        (a, b) => a == b,
    };
    same(old.end.z, new.end.z, SAME_MM) && same(old.end.x, new.end.x, shift_mm + SAME_MM)
}
