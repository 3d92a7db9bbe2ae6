//! The last cut aimed as the job says, and how sure it is to come out well.

use crate::calculator::{Failure, Monitor};
use crate::certainty::Conformance;
use crate::diameters::{Aim, Judged};

use crate::deflection_compensation::answer::driven::{Driven, drive};
use crate::deflection_compensation::answer::output::ErrorFan;
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::Job;
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
    let (driven, aim_um) = cuts_at_aim(job, grid, acting, look, monitor)?;
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

/// The cuts of a job, the last one aimed as the job says, and by how much that shifts its command, um.
pub(in crate::deflection_compensation) fn cuts_at_aim<'a>(
    job: &'a Job,
    grid: &Grid,
    acting: &'a Acting,
    look: &mut dyn FnMut(&Grid, &Stage, usize),
    monitor: &dyn Monitor,
) -> Result<(Driven<'a>, f64), Failure> {
    let driven = drive(job, grid, acting, 0.0, look, monitor)?;
    if job.aim == (Aim::Nominal {}) {
        return Ok((driven, 0.0));
    }
    let judged = match &driven.rehearsal {
        Some(rehearsal) => Judged::of(job.asked(), rehearsal, monitor)?,
        None => None,
    };
    let aim_um = match judged {
        Some(judged) => judged.aim_um(&job.aim)?,
        None => job.tolerance.size().middle_um().unwrap_or(0.0),
    };
    Ok((drive(job, grid, acting, aim_um, &mut |_, _, _| (), monitor)?, aim_um))
}
