//! The last cut aimed as the job says, and how sure it is to come out well.

use crate::calculator::{Failure, Monitor};
use crate::certainty::Conformance;
use crate::diameters::{Aim, Judged};

use crate::deflection_compensation::answer::driven::{Driven, drive, rehearsed};
use crate::deflection_compensation::answer::output::ErrorFan;
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::Job;
use crate::deflection_compensation::model::rehearsal::Rehearsal;
use crate::deflection_compensation::model::stage::Stage;

/// Where the last cut is aimed at, and how sure it is to come out well.
#[derive(Default)]
pub(in crate::deflection_compensation) struct Sure {
    pub aim_um: f64,
    pub conformance: Option<Conformance>,
    pub fan: Option<ErrorFan>,
}

/// The cuts of a job, the last one aimed as the job says, and how sure they are to come out well.
pub(in crate::deflection_compensation) fn aimed<'a>(
    job: &'a Job,
    grid: &Grid,
    acting: &'a Acting,
    look: &mut dyn FnMut(&Grid, &Stage, usize),
    monitor: &dyn Monitor,
) -> Result<(Driven<'a>, Sure), Failure> {
    let aim_um = aim_um(job, grid, acting, monitor)?;
    let driven = drive(job, grid, acting, aim_um, look, monitor)?;
    let mut sure = Sure { aim_um, ..Sure::default() };
    if let Some(rehearsal) = &driven.rehearsal {
        // The path of the rehearsal is aimed already.
        if let Some(judged) = Judged::of(job.asked(), rehearsal, monitor)? {
            sure.conformance = Some(judged.conformance(0.0)?);
            sure.fan = Some(judged.fan(0.0)?);
        }
    }
    Ok((driven, sure))
}

/// The last cut of a job, aimed as that says, as it may come out; no program is made of it.
pub(in crate::deflection_compensation) fn rehearsed_at_aim<'a>(
    job: &'a Job,
    grid: &Grid,
    acting: &'a Acting,
    monitor: &dyn Monitor,
) -> Result<Option<Rehearsal<'a>>, Failure> {
    rehearsed(job, grid, acting, aim_um(job, grid, acting, monitor)?, monitor)
}

/// By how much the aim of a job shifts the command of its last cut, um.
fn aim_um(job: &Job, grid: &Grid, acting: &Acting, monitor: &dyn Monitor) -> Result<f64, Failure> {
    if job.aim == (Aim::Nominal {}) {
        return Ok(0.0);
    }
    let rehearsal = rehearsed(job, grid, acting, 0.0, monitor)?;
    let judged = match &rehearsal {
        Some(rehearsal) => Judged::of(job.asked(), rehearsal, monitor)?,
        None => None,
    };
    match judged {
        Some(judged) => judged.aim_um(&job.aim),
        None => Ok(job.tolerance.size().middle_um().unwrap_or(0.0)),
    }
}
