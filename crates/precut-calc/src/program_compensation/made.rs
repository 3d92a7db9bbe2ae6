//! A part that a program made, and how it would come out were something not quite as it is stated.

use crate::calculator::{Failure, Finding, Monitor};
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

/// Time of one drive of a program of so many lines, ms (measured).
pub(super) fn drive_ms(lines: usize) -> f64 {
    0.1 * lines as f64
}
