//! The program that leaves no error: the radius of finishing moves shifted against the opening (`program/5`), written into the
//! program as it is (`program/6`), and proved by reading and driving it again (`program/7`).
//!
//! `plan` (shifts along the moves) with `chords` (the fewest straight ones) -> `rewrite` (words and lines) -> `proof`; `diff`
//! shows what has changed.

mod calls;
mod chords;
mod compare;
mod diff;
mod line;
mod numbers;
mod plan;
mod proof;
mod rewrite;
mod write_out;

use std::collections::{BTreeMap, BTreeSet};

use crate::calculator::{Failure, Monitor};
use crate::deflection_compensation::Holding;

use super::super::job::{Job, ProgramStock, SupportLines};
use super::reader::Program;
use super::stock::{Part, Stroke, Turned, lines_that_finish, strokes};
use super::yielding::{Driven, Instead, Yielded, yielding};

use calls::Calls;
pub(crate) use diff::unified;
pub(crate) use numbers::{decimal, number_like};
pub(crate) use plan::LeftAlone;
pub use plan::WhyLeftAlone;
pub(crate) use proof::{FAILURE_CODES, Proof, Transition};
use proof::{Failed, Task};
use rewrite::Written;
pub(crate) use rewrite::{ChangedLine, applied};

/// How often jumps of the shift are laid over twice the stretch because the work came out thin beside them.
const MOST_TRIALS: usize = 3;
/// How often the shifts are laid anew for the section that they leave, and what need not be, mm.
const MOST_SECTIONS: usize = 6;
const SECTION_MM: f64 = 5e-5;
/// A surface that is less too small is not told, mm on the radius.
const UNDERSIZE_MM: f64 = 1.5e-3;

/// A program with its correction.
#[derive(Debug, Clone)]
pub(crate) struct Corrected {
    /// The text that is given back.
    pub(crate) text: String,
    /// Lines of the given program that became others.
    pub(crate) changed: Vec<ChangedLine>,
    /// Finishing lines that stay as they are, and why.
    pub(crate) left_alone: Vec<LeftAlone>,
    /// Lines of the new text in which supports act.
    pub(crate) support_lines: Vec<SupportLines>,
    /// A unified diff; empty where nothing changes.
    pub(crate) diff: String,
    /// Lines whose surface comes out too small whatever their shift.
    pub(crate) undersize: Vec<Undersize>,
    /// What came of it when it was driven; none where nothing changes.
    pub(crate) proof: Option<Proof>,
}

/// A line whose surface comes out too small, because other moves cut deeper there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Undersize {
    pub(crate) line: usize,
    pub(crate) z_mm: f64,
    /// Below 0, on the diameter, um.
    pub(crate) error_um: f64,
}

/// Corrects a program that has been driven as it is.
pub(crate) fn corrected(
    program: &Program,
    job: &Job,
    holding: &Holding,
    (stock, zero): (&ProgramStock, f64),
    (turned, before): (&Turned, &Yielded),
    monitor: &dyn Monitor,
) -> Result<Corrected, Failure> {
    let finishing = lines_that_finish(turned);
    let feeds = strokes(program, job, zero).filter(|stroke| stroke.one.kind.is_feed());
    let ways: BTreeMap<usize, Stroke<'_>> = feeds.map(|stroke| (stroke.index, stroke)).collect();
    let calls = Calls::of(program, &ways);
    let (mut eligible, mut left_alone) = plan::eligible(program, &ways, &calls, (&finishing, &job.mode), before);
    let found = loop {
        if eligible.is_empty() {
            break None;
        }
        let drive = |bends_as: Option<&Instead>| {
            let goes_on = Some(before);
            let driven = Driven { corrected: &eligible, bends_as, goes_on, ..Driven::as_it_is(&finishing) };
            yielding(program, job, holding, (stock, zero), driven, monitor)
        };
        let planned = planned((program, job), (&ways, &calls), &eligible, drive)?;
        let task = Task { program, job, holding, blank: (stock, zero), turned, before, planned: &planned };
        match laid(&task, (&ways, &calls), &eligible, monitor) {
            Ok(found) => break found.map(|found| (found, planned)),
            // The line that comes out thin whatever is done stays as it is, and the rest is planned anew.
            Err(Failed::Thin(places)) => {
                let lines: BTreeSet<usize> = places.iter().filter_map(|off| off.line).collect();
                let count = eligible.len();
                eligible.retain(|index| !lines.contains(&program.moves[*index].line));
                if eligible.len() == count {
                    return Err(Failed::Thin(places).into());
                }
                let why = WhyLeftAlone::NotSupportedByModel;
                left_alone.extend(lines.into_iter().map(|line| LeftAlone { line, why }));
            }
            Err(failed) => return Err(failed.into()),
        }
    };
    let none = BTreeSet::new();
    let changed = found.as_ref().map_or(&none, |((written, _), _)| &written.moved);
    let lines: BTreeSet<usize> = changed.iter().map(|&index| program.moves[index].line).collect();
    left_alone.extend(plan::below_resolution(program, &eligible, changed));
    // The faces of a cycle that is written out stand in its line.
    left_alone.retain(|left| left.why != WhyLeftAlone::Face || !lines.contains(&left.line));
    left_alone.sort_by_key(|left| left.line);
    left_alone.dedup_by_key(|left| left.line);
    let Some(((written, proof), planned)) = found else {
        let text = job.nc_program.clone();
        return Ok(Corrected {
            text,
            changed: Vec::new(),
            support_lines: job.support_lines.clone(),
            left_alone,
            diff: String::new(),
            undersize: Vec::new(),
            proof: None,
        });
    };
    let diff = unified(&job.nc_program, &written.changed);
    let undersize = undersize(&before.nominal, &planned.real, &lines);
    let support_lines = proof::moved_supports(job, &written);
    let Written { text, changed, .. } = written;
    Ok(Corrected { text, changed, support_lines, left_alone, diff, undersize, proof: Some(proof) })
}

/// The finishing moves as they should come out, on work that bends as the corrected program by itself leaves it: the shifts
/// are in its section, and the section in the shifts.
fn planned(
    (program, job): (&Program, &Job),
    (ways, calls): (&BTreeMap<usize, Stroke<'_>>, &Calls<'_>),
    eligible: &BTreeSet<usize>,
    drive: impl Fn(Option<&Instead>) -> Result<Yielded, Failure>,
) -> Result<Yielded, Failure> {
    let mut planned = drive(None)?;
    let mut left_mm = f64::INFINITY;
    for _ in 0..MOST_SECTIONS {
        let shifts = plan::Plan::of(program, (ways, calls), &planned, eligible, &job.mode).shifts();
        // What the section still changes is a share of what it has changed.
        let share = shifts.largest_share(ways);
        left_mm = share * left_mm.min(shifts.largest_mm());
        if left_mm <= SECTION_MM {
            break;
        }
        planned = drive(Some(&shifts.ways(ways)))?;
    }
    Ok(planned)
}

/// The shifts written and proved; none where no line changes.
fn laid(
    task: &Task<'_>,
    (ways, calls): (&BTreeMap<usize, Stroke<'_>>, &Calls<'_>),
    eligible: &BTreeSet<usize>,
    monitor: &dyn Monitor,
) -> Result<Option<(Written, Proof)>, Failed> {
    let mut plan = plan::Plan::of(task.program, (ways, calls), task.planned, eligible, &task.job.mode);
    let mut trials = 0;
    loop {
        let shifts = plan.shifts();
        let written =
            rewrite::rewritten(&task.job.nc_program, task.job.dialect, (task.program, calls), &shifts, &task.job.mode);
        if written.changed.is_empty() {
            return Ok(None);
        }
        match proof::proved(task, &written, &shifts.jumps, monitor) {
            Ok(proof) => return Ok(Some((written, proof))),
            Err(Failed::Thin(_)) if trials < MOST_TRIALS => {
                trials += 1;
                plan.lay_gentler();
            }
            Err(failed) => return Err(failed),
        }
    }
}

/// The place of every changed line at which it is most too small.
fn undersize(wanted: &[Part], planned: &[Part], changed: &BTreeSet<usize>) -> Vec<Undersize> {
    let mut found: BTreeMap<usize, Undersize> = BTreeMap::new();
    for off in compare::differences(wanted, planned) {
        let line = off.line.filter(|line| changed.contains(line));
        if let Some(line) = line.filter(|_| off.by_mm < -UNDERSIZE_MM) {
            let one = Undersize { line, z_mm: off.z_mm, error_um: 2e3 * off.by_mm };
            let worst = found.entry(line).or_insert(one);
            if one.error_um < worst.error_um {
                *worst = one;
            }
        }
    }
    found.into_values().collect()
}
