//! The path as programmed, and what it gives: at the stations of the answer and between them.
//!
//! The stations say where an answer is wanted. The path must hold the drawing everywhere, so it goes through stations of
//! its own where those of the answer are few or see only one side of a jump ([`Grid::refined`]), every pass on what the
//! moves of the one before have left, and what the last one leaves is looked for at all of them.

use crate::calculator::{Failure, Message, Monitor};
use crate::turning::Proof;

use crate::deflection_compensation::answer::columns::errors_um;
use crate::deflection_compensation::answer::output::{PassOutcome, Path};
use crate::deflection_compensation::answer::toolpath::{Drawn, drawn};
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::{Grid, Refined};
use crate::deflection_compensation::job::input::Job;
use crate::deflection_compensation::model::form::Form;
use crate::deflection_compensation::model::rehearsal::Rehearsal;
use crate::deflection_compensation::model::stage::{Along, Cuts, Stage, in_reach};
use crate::deflection_compensation::model::yielding::Radii;

const UM_PER_MM: f64 = 1e3;

/// The paths as programmed and what they give.
pub(in crate::deflection_compensation) struct Driven<'a> {
    /// The path of the last cut.
    pub path: Path,
    /// Every pass of several, at the stations of the answer.
    pub passes: Vec<PassOutcome>,
    /// The last cut at the stations of the answer.
    pub stage: Stage,
    /// Radius that is left at the stations of the answer, mm.
    pub produced_mm: Vec<Option<f64>>,
    /// Form and size of all that is left.
    pub after: Form,
    /// The program, where every station has a command.
    pub drawn: Option<Drawn>,
    /// What the program was seen to do.
    pub proof: Option<Proof>,
    /// The same cuts again with what is uncertain; where the job sets limits, and every path is whole.
    pub rehearsal: Option<Rehearsal<'a>>,
}

/// A monitor of a part that is computed once more: it may be cancelled, its stages have been told already.
pub(in crate::deflection_compensation) struct Again<'m>(pub &'m dyn Monitor);

impl Monitor for Again<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}

/// Cuts the commands into straight moves, predicts what they give, and drives the program of them over the blank.
///
/// The last cut's commanded diameter is larger than the exact one by `aim_um`.
pub(in crate::deflection_compensation) fn drive<'a>(
    job: &'a Job,
    grid: &Grid,
    acting: &'a Acting,
    aim_um: f64,
    look: &mut dyn FnMut(&Grid, &Stage, usize),
    monitor: &dyn Monitor,
) -> Result<Driven<'a>, Failure> {
    let Refined { grid: fine, own } = grid.refined(job);
    let aim_mm = 0.5 * aim_um / UM_PER_MM;
    let cuts = along_moves(job, &fine, acting, aim_mm, look, monitor)?;
    let rehearsal = rehearsal(job, acting, &fine, &cuts)?;
    let Cuts { stages, passes, paths, produced_mm, .. } = cuts;
    let (Some(last), Some(path)) = (stages.last(), paths.last()) else {
        return Err(Failure::Internal("no cut was computed".to_owned()));
    };
    let at = |values: &[f64]| own.iter().map(|&i| values[i]).collect::<Vec<f64>>();
    let radii = Radii {
        target: at(&last.radii.target),
        stock: at(&last.radii.stock),
        planned: last.radii.planned.as_deref().map(at),
        idle: if last.radii.idle.is_empty() { Vec::new() } else { own.iter().map(|&i| last.radii.idle[i]).collect() },
    };
    let mut stage = Stage::of(job, grid, acting, last.regime, last.step, radii, monitor)?;
    stage.cut.note(last.cut.residual_mm);
    stage.cut.aim(aim_mm);
    let after = Form::of(&fine.z_mm, &errors_um(&produced_mm, &last.radii));
    let complete = paths.iter().all(|path| path.complete);
    let (drawn, proof) = if complete {
        let (drawn, driven) = drawn(job, &fine, &stages, &paths);
        let proof = driven.proof(|i| last.radii.target[i], |i| produced_mm[i]);
        (Some(drawn), proof)
    } else {
        (None, None)
    };
    Ok(Driven {
        path: path.clone(),
        passes: passes.into_iter().map(|pass| at_stations(pass, &own)).collect(),
        stage,
        produced_mm: own.iter().map(|&i| produced_mm[i]).collect(),
        after,
        drawn,
        proof,
        rehearsal,
    })
}

/// The same cuts again with what is uncertain, without a program of them; see [`Driven::rehearsal`].
pub(in crate::deflection_compensation) fn rehearsed<'a>(
    job: &'a Job,
    grid: &Grid,
    acting: &'a Acting,
    aim_um: f64,
    monitor: &dyn Monitor,
) -> Result<Option<Rehearsal<'a>>, Failure> {
    let fine = grid.refined(job).grid;
    let cuts = along_moves(job, &fine, acting, 0.5 * aim_um / UM_PER_MM, &mut |_, _, _| (), monitor)?;
    rehearsal(job, acting, &fine, &cuts)
}

fn along_moves(
    job: &Job,
    fine: &Grid,
    acting: &Acting,
    aim_mm: f64,
    look: &mut dyn FnMut(&Grid, &Stage, usize),
    monitor: &dyn Monitor,
) -> Result<Cuts, Failure> {
    let cuts = Cuts::of(job, fine, acting, Along::Moves { aim_mm }, look, monitor)?;
    cuts.stages.last().map_or(Ok(()), in_reach)?;
    Ok(cuts)
}

fn rehearsal<'a>(job: &'a Job, acting: &'a Acting, fine: &Grid, cuts: &Cuts) -> Result<Option<Rehearsal<'a>>, Failure> {
    if job.tolerance.is_none() {
        return Ok(None);
    }
    Rehearsal::of(job, acting, fine, &cuts.stages, &cuts.commands)
}

/// A pass at some of its stations; its form error stays that of all.
fn at_stations(pass: PassOutcome, own: &[usize]) -> PassOutcome {
    let at = |values: Vec<f64>| own.iter().map(|&i| values[i]).collect();
    let some = |values: Vec<Option<f64>>| own.iter().map(|&i| values[i]).collect();
    PassOutcome {
        produced_diameter_mm: at(pass.produced_diameter_mm),
        diameter_error_um: at(pass.diameter_error_um),
        commanded_diameter_mm: some(pass.commanded_diameter_mm),
        copying_factor: some(pass.copying_factor),
        copied_so_far: some(pass.copied_so_far),
        ..pass
    }
}
