//! A part that a program made, and how it would come out were something not quite as it is stated.

use crate::calculator::{Failure, Finding, Monitor, Unwatched};
use crate::deflection_compensation::{Holding, Theory};
use crate::diameters::Draw;
use crate::effects::DeflectionEffect;

use super::job::{Job, ProgramStock};
use super::model::reader::{self, Program};
use super::model::stock::{lines_that_finish, turned};
use super::model::yielding::{Driven, Yielded, yielding};

/// A part and its program.
pub(super) struct Made {
    pub(super) job: Job,
    pub(super) program: Program,
    /// Lines that make the contour.
    finishing: Vec<usize>,
    /// As it is stated: moves are looked at where they were then.
    pub(super) base: Yielded,
}

impl Made {
    /// Reads and drives a program once.
    pub(super) fn of(job: Job, monitor: &dyn Monitor) -> Result<Self, Failure> {
        let program = reader::read(&job.nc_program, job.dialect, &job.reading, monitor)?;
        let finishing = lines_that_finish(&turned(&program, &job, blank(&job)?, monitor)?);
        let mut made = Self { job, program, finishing, base: Yielded::default() };
        made.base = made.driven(blank(&made.job)?, &made.holding()?, Driven::as_it_is(&made.finishing), monitor)?;
        Ok(made)
    }

    /// What it leaves with effects beside those of the job.
    pub(super) fn with_effects(&self, effects: &[DeflectionEffect], monitor: &dyn Monitor) -> Result<Yielded, Failure> {
        let mut holding = self.holding()?;
        holding.effects.extend_from_slice(effects);
        self.driven(blank(&self.job)?, &holding, self.again(), monitor)
    }

    /// The same of a beam of another theory.
    pub(super) fn with_theory(
        &self,
        theory: Theory,
        effects: &[DeflectionEffect],
        monitor: &dyn Monitor,
    ) -> Result<Yielded, Failure> {
        let mut holding = self.holding()?;
        holding.effects.extend_from_slice(effects);
        holding.shaft.theory = Some(theory);
        self.driven(blank(&self.job)?, &holding, self.again(), monitor)
    }

    /// What it leaves with a draw of what is uncertain, and the tool farther out by `finishing_mm` on lines that make the contour.
    pub(super) fn with_draw(&self, draw: &Draw, finishing_mm: f64, monitor: &dyn Monitor) -> Result<Yielded, Failure> {
        let (given, zero) = blank(&self.job)?;
        let mut stock = given.clone();
        stock.profile.iter_mut().for_each(|row| row.diameter_mm += 2.0 * draw.stock_mm);
        let set_out_mm = [draw.tool_setting_mm + finishing_mm, draw.tool_setting_mm];
        let driven = Driven { set_out_mm, ..self.again() };
        self.driven((&stock, zero), &self.holding()?.drawn(draw), driven, monitor)
    }

    fn holding(&self) -> Result<Holding, Failure> {
        self.job.holding().ok_or_else(without_force)
    }

    /// At the places at which the moves are known.
    fn again(&self) -> Driven<'_> {
        Driven { places_of: Some(&self.base), ..Driven::as_it_is(&self.finishing) }
    }

    fn driven(
        &self,
        blank: (&ProgramStock, f64),
        holding: &Holding,
        driven: Driven<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Yielded, Failure> {
        yielding(&self.program, &self.job, holding, blank, driven, monitor)
    }
}

/// Blank and program zero.
fn blank(job: &Job) -> Result<(&ProgramStock, f64), Failure> {
    job.stock.as_ref().zip(job.program_zero_z_mm).ok_or_else(without_force)
}

/// Nothing is predicted of work that nothing bends.
fn without_force() -> Failure {
    Failure::OutOfModel(Finding::new("prediction_without_force", "/job/force"))
}

/// Time of one drive of a program over work that yields, ms: of each move at the feed what it costs to hold the work and to take it
/// away, and its places, which cost more where many moves have left their marks (measured: 0.8 ms for 10 moves of 200 mm, 26 ms for
/// 315 and 1160 ms for 10,300 short ones, 93 ms for 100 of 380 mm).
pub(super) fn drive_ms(program: &Program, job: &Job) -> f64 {
    const MOVE_MS: f64 = 0.05;
    // Ends and what is beside them, then every 5 mm and in between.
    let places = |length_mm: f64| 9.0 + 0.44 * length_mm.min(2000.0);
    let mut from = job.reading.start.map(|start| [start.x_diameter_mm, start.z_mm]);
    let (mut moves, mut looked_at) = (0.0, 0.0);
    for one in &program.moves {
        let begin = std::mem::replace(&mut from, one.end.known());
        if let Some((a, b)) = begin.zip(one.end.known()).filter(|_| one.kind.is_feed()) {
            moves += 1.0;
            looked_at += places((0.5 * (b[0] - a[0])).hypot(b[1] - a[1]));
        }
    }
    let place_ms = 0.001 + 0.003 * moves / (moves + 60.0);
    // Where all of the outline bends by itself, every move bends all of it.
    let bends_whole = job.include.weight || job.stock.as_ref().is_some_and(|s| s.theory == Some(Theory::Timoshenko));
    let times = if bends_whole { 3.0 } else { 1.0 };
    times * (MOVE_MS * moves + place_ms * looked_at)
}

/// The same of a job; nothing of a program that is not read.
pub(super) fn drive_ms_of(job: &Job) -> f64 {
    let read = reader::read(&job.nc_program, job.dialect, &job.reading, &Unwatched);
    read.map_or(0.0, |program| drive_ms(&program, job))
}
