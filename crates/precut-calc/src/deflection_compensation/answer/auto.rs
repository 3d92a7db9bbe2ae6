//! What acts by default (`certainty/4.3`): effects that the job's own numbers allow to be computed, where they matter.
//!
//! A bias that is known is computed, not left in the uncertainty. What the job says of a switch holds; what it leaves open
//! is tried on a sample of the stations, and what changes the diameter by more than a tenth of the tolerance acts.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Message, Monitor};
use crate::num::beam::Wanted;

use crate::deflection_compensation::answer::columns::uncertainty_um;
use crate::deflection_compensation::answer::driven::Again;
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{IncludeMode, Job, Section, Theory};
use crate::deflection_compensation::model::second_order::Estimates;
use crate::deflection_compensation::model::stage::{Stage, all_cuts};
use crate::deflection_compensation::model::yielding::wanted;

/// Share of the tolerance, or of the uncertainty, above which an effect acts.
const SHARE: f64 = 0.1;
/// Stations at which the effects are tried.
pub(in crate::deflection_compensation) const SAMPLES: usize = 33;

/// An effect that acts although the job does not say so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Automatic {
    /// Which: `axial_moment`, `tangential`, `partly_turned` or `shear`.
    #[schema(example = "axial_moment")]
    pub effect: String,
    /// Largest change of the diameter by it.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub change_um: f64,
    /// Change from which on it acts: a tenth of the tolerance, without one of the standard uncertainty.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub limit_um: f64,
}

impl Automatic {
    /// Why it acts, in words.
    pub(in crate::deflection_compensation) fn said(&self, job: &Job) -> Message {
        let of = if tolerance_um(job).is_some() { "tolerance" } else { "uncertainty" };
        Message::new("effect_acts_by_default")
            .with("effect", self.effect.clone())
            .with("change_um", self.change_um)
            .with("limit_um", self.limit_um)
            .with("of", of)
    }
}

/// A switch that a job may leave open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Switch {
    AxialMoment,
    Tangential,
    PartlyTurned,
    Shear,
}

impl Switch {
    const ALL: [Self; 4] = [Self::AxialMoment, Self::Tangential, Self::PartlyTurned, Self::Shear];

    fn name(self) -> &'static str {
        match self {
            Self::AxialMoment => "axial_moment",
            Self::Tangential => "tangential",
            Self::PartlyTurned => "partly_turned",
            Self::Shear => "shear",
        }
    }

    /// Whether the job leaves it open and has what it needs. Passes bend with the section of the pass.
    fn is_open(self, job: &Job, acting: &Acting) -> bool {
        match self {
            Self::AxialMoment => job.include.axial_moment.is_none() && job.force.has_feed(),
            Self::Tangential => job.include.tangential.is_none() && job.force.has_main(),
            Self::PartlyTurned => job.shaft.section.is_none() && job.passes.is_empty() && !acting.structure.uncut_side,
            Self::Shear => job.shaft.theory.is_none(),
        }
    }

    /// Largest change of the diameter by it, where that is more than the limit.
    fn above_um(self, limit_um: f64, estimates: &Estimates<'_>) -> Result<Option<f64>, Failure> {
        let size_um = match self {
            Self::AxialMoment => estimates.axial_moment_um(),
            Self::Tangential => estimates.tangential_um(),
            Self::PartlyTurned if estimates.partly_turned_at_most_um().is_some_and(|most_um| most_um <= limit_um) => {
                0.0
            }
            Self::PartlyTurned => estimates.partly_turned_um()?,
            Self::Shear => estimates.shear_um()?,
        };
        Ok((size_um > limit_um).then_some(size_um))
    }

    fn turn_on(self, job: &mut Job) {
        match self {
            Self::AxialMoment => job.include.axial_moment = Some(true),
            Self::Tangential => job.include.tangential = Some(true),
            Self::PartlyTurned => job.shaft.section = Some(Section::Mixed),
            Self::Shear => job.shaft.theory = Some(Theory::Timoshenko),
        }
    }
}

/// The job with what acts by default switched on, and what that is.
///
/// One effect changes the size of another, so all that are still open are tried again with those that act.
pub(in crate::deflection_compensation) fn settled<'a>(
    job: &'a Job,
    monitor: &dyn Monitor,
) -> Result<(Cow<'a, Job>, Vec<Automatic>), Failure> {
    let acting = Acting::of(&job.effects, &job.conditions, job.cut.feed_direction);
    if open(job, &acting).next().is_none() {
        return Ok((Cow::Borrowed(job), Vec::new()));
    }
    let grid = Grid::of(job);
    let sampled = grid.at(&grid.sample(SAMPLES));
    let (mut job, mut on) = (Cow::Borrowed(job), Vec::new());
    loop {
        let (stage, _) = all_cuts(&job, &sampled, &acting, &mut |_, _, _| (), &Again(monitor))?;
        let still_open = || open(&job, &acting);
        let of_job = wanted(&job);
        let wanted = Wanted {
            tangential: of_job.tangential || still_open().any(|switch| switch == Switch::Tangential),
            couple: of_job.couple || still_open().any(|switch| switch == Switch::AxialMoment),
            weight: of_job.weight,
        };
        let estimates = Estimates::of(&job, &sampled, &acting, &stage, wanted)?;
        let limit_um = limit_um(&job, &sampled, &acting, &stage)?;
        let mut found = Vec::new();
        for switch in still_open() {
            if let Some(change_um) = switch.above_um(limit_um, &estimates)? {
                found.push((switch, Automatic { effect: switch.name().to_owned(), change_um, limit_um }));
            }
        }
        let turned_on = found.len();
        for (switch, automatic) in found {
            switch.turn_on(job.to_mut());
            on.push(automatic);
        }
        if turned_on == 0 || open(&job, &acting).next().is_none() {
            return Ok((job, on));
        }
    }
}

/// The switches that a job leaves open.
fn open(job: &Job, acting: &Acting) -> impl Iterator<Item = Switch> {
    let is_left_to_us = job.include.mode == IncludeMode::Auto;
    Switch::ALL.into_iter().filter(move |switch| is_left_to_us && switch.is_open(job, acting))
}

/// About how many cuts at [`SAMPLES`] stations are computed at most to see what acts: in every round all passes, and
/// each effect that is still open.
pub(in crate::deflection_compensation) fn cuts_tried(job: &Job) -> usize {
    let acting = Acting::of(&job.effects, &job.conditions, job.cut.feed_direction);
    let open = open(job, &acting).count();
    (1..=open).map(|still_open| job.passes.len().max(1) + 1 + still_open).sum()
}

/// The smaller of the tolerances of form and size, um.
fn tolerance_um(job: &Job) -> Option<f64> {
    let size = job.tolerance.size().half_width_um();
    [job.tolerance.form_um, size].into_iter().flatten().reduce(f64::min)
}

/// Change of the diameter from which on an effect acts, um; less than a tenth of a step of the control never matters.
fn limit_um(job: &Job, grid: &Grid, acting: &Acting, stage: &Stage) -> Result<f64, Failure> {
    let measure_um = match tolerance_um(job) {
        Some(tolerance_um) => tolerance_um,
        None => uncertainty_um(job, grid, acting, stage)?.into_iter().fold(0.0, f64::max),
    };
    Ok(SHARE * measure_um.max(job.path.increment_um))
}
