//! What acts by default (`certainty/4.3`): effects that the job's own numbers allow to be computed, where they matter.
//!
//! A bias that is known is computed, not left in the uncertainty. What the job says of a switch holds; what it leaves open
//! is tried on a sample of the stations, and what changes the diameter by more than a tenth of the tolerance acts.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Message, Monitor};

use super::acting::Acting;
use super::columns::uncertainty_um;
use super::driven::Again;
use super::grid::Grid;
use super::input::{IncludeMode, Job, Section, Theory};
use super::output::SecondOrder;
use super::second_order::second_order;
use super::stage::{Stage, all_cuts};

/// Share of the tolerance, or of the uncertainty, above which an effect acts.
const SHARE: f64 = 0.1;
/// Stations at which the effects are tried.
const SAMPLES: usize = 33;
/// Tolerances to either side take half of that of size.
const HALF: f64 = 0.5;

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
    pub(super) fn said(&self, job: &Job) -> Message {
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

    fn size_um(self, sizes: &SecondOrder) -> Option<f64> {
        match self {
            Self::AxialMoment => sizes.axial_moment_um,
            Self::Tangential => sizes.tangential_um,
            Self::PartlyTurned => sizes.partly_turned_um,
            Self::Shear => sizes.shear_um,
        }
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
pub(super) fn settled<'a>(job: &'a Job, monitor: &dyn Monitor) -> Result<(Cow<'a, Job>, Vec<Automatic>), Failure> {
    let acting = Acting::of(&job.effects, &job.conditions, job.cut.feed_direction);
    let open = |job: &Job| Switch::ALL.into_iter().filter(|switch| switch.is_open(job, &acting)).collect::<Vec<_>>();
    if job.include.mode == IncludeMode::AsStated || open(job).is_empty() {
        return Ok((Cow::Borrowed(job), Vec::new()));
    }
    let grid = Grid::of(job);
    let sampled = grid.at(&grid.sample(SAMPLES));
    let (mut job, mut on) = (Cow::Borrowed(job), Vec::new());
    loop {
        let still_open = open(&job);
        let (stage, _) = all_cuts(&job, &sampled, &acting, &mut |_, _, _| (), &Again(monitor))?;
        let sizes = second_order(&job, &sampled, &acting, &stage)?;
        let limit_um = limit_um(&job, &acting, &stage);
        let matter = |switch: Switch| {
            let change_um = switch.size_um(&sizes).filter(|size| *size > limit_um)?;
            Some((switch, Automatic { effect: switch.name().to_owned(), change_um, limit_um }))
        };
        let found: Vec<(Switch, Automatic)> = still_open.into_iter().filter_map(matter).collect();
        if found.is_empty() {
            return Ok((job, on));
        }
        for (switch, automatic) in found {
            switch.turn_on(job.to_mut());
            on.push(automatic);
        }
    }
}

/// The smaller of the tolerances of form and size, um.
fn tolerance_um(job: &Job) -> Option<f64> {
    let size = job.tolerance.diameter_um.map(|whole| HALF * whole);
    [job.tolerance.form_um, size].into_iter().flatten().reduce(f64::min)
}

/// Change of the diameter from which on an effect acts, um; less than a tenth of a step of the control never matters.
fn limit_um(job: &Job, acting: &Acting, stage: &Stage) -> f64 {
    let measure_um =
        tolerance_um(job).unwrap_or_else(|| uncertainty_um(job, acting, stage).into_iter().fold(0.0, f64::max));
    SHARE * measure_um.max(job.path.increment_um)
}
