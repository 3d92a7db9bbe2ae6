//! The path as programmed, and what it gives: at the stations of the answer and between them.
//!
//! The stations say where an answer is wanted. The path must hold the drawing everywhere, so it goes through stations of
//! its own where those of the answer are few ([`Grid::refined`]), and what it leaves is looked for at all of them.

use crate::calculator::{Failure, Message, Monitor};

use super::acting::Acting;
use super::columns::errors_um;
use super::form::Form;
use super::grid::{Grid, Refined};
use super::input::Job;
use super::output::Path;
use super::stage::{Stage, all_cuts, in_reach};
use super::toolpath;

/// The path as programmed and what it gives.
pub(super) struct Driven {
    pub path: Path,
    /// Radius that it produces at the stations of the answer, mm.
    pub produced_mm: Vec<Option<f64>>,
    /// Form and size of all that it produces.
    pub after: Form,
}

/// A monitor of a part that is computed once more: it may be cancelled, its stages have been told already.
pub(super) struct Again<'m>(pub &'m dyn Monitor);

impl Monitor for Again<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}

/// Cuts the command into straight moves and predicts what they give.
pub(super) fn drive(
    job: &Job,
    grid: &Grid,
    acting: &Acting,
    stage: &mut Stage,
    monitor: &dyn Monitor,
) -> Result<Driven, Failure> {
    let Some(Refined { grid: fine, own }) = grid.refined(job) else { return follow(job, grid, stage, monitor) };
    let (mut along, _) = all_cuts(job, &fine, acting, &mut |_, _| (), &Again(monitor))?;
    in_reach(&along)?;
    let driven = follow(job, &fine, &mut along, monitor)?;
    stage.cut.note(along.cut.residual_mm);
    let produced_mm = own.iter().map(|&i| driven.produced_mm[i]).collect();
    Ok(Driven { produced_mm, ..driven })
}

fn follow(job: &Job, grid: &Grid, stage: &mut Stage, monitor: &dyn Monitor) -> Result<Driven, Failure> {
    let cut = &mut stage.cut;
    let programmed = toolpath::programmed(job, grid, &cut.command_mm, &cut.status_compensated, monitor)?;
    let produced_mm = cut.produced_mm(&stage.line, &stage.radii, &programmed.command_mm, monitor)?;
    let after = Form::of(&grid.z_mm, &errors_um(&produced_mm, &stage.radii));
    Ok(Driven { path: programmed.path, produced_mm, after })
}
