//! How probable it is that what a program leaves keeps the limits of the drawing (`program/10`).
//!
//! The parts are those of the program that is given back, or of the given one where there is none: read and driven again with draws
//! of what is uncertain, and held against what is meant.

use crate::calculator::{Failure, Monitor};
use crate::certainty::Conformance;
use crate::diameters::{Draw, Judged, Parts, Places};
use crate::effects::DeflectionEffect;

use super::job::Job;
use super::made::Made;
use super::model::correction::{Corrected, Transition};
use super::model::stock::{Part, outline};
use super::model::yielding::{ContourError, Yielded, against, between, radius_at};

const UM_PER_MM: f64 = 1e3;
/// Places at which errors are told, about, beside the ends and the extremes of every stretch.
const PLACES: usize = 120;
/// A stretch goes on to a place that is no farther from the one before it, mm.
const GOES_ON_MM: f64 = 2.5;

/// Parts as a program leaves them.
pub(super) struct Leaves<'a> {
    made: Made,
    /// What is meant.
    meant: Vec<Part>,
    places: Places,
    monitor: &'a dyn Monitor,
}

/// How probable it is that a part keeps its limits; `given` is what the given program means. `None` where nothing is limited, or
/// nothing uncertain.
pub(super) fn conformance(
    job: &Job,
    corrected: Option<&Corrected>,
    given: &[Part],
    monitor: &dyn Monitor,
) -> Result<Option<Conformance>, Failure> {
    if job.tolerance.is_none() {
        return Ok(None);
    }
    let leaves = Leaves::of(job, corrected, given, monitor)?;
    Judged::of(job.asked(), &leaves, monitor)?.map(|judged| judged.conformance(0.0)).transpose()
}

impl<'a> Leaves<'a> {
    /// Of a job, with the program that is given back for it where there is one.
    pub(super) fn of(
        job: &Job,
        corrected: Option<&Corrected>,
        given: &[Part],
        monitor: &'a dyn Monitor,
    ) -> Result<Self, Failure> {
        let mut run = job.clone();
        if let Some(corrected) = corrected {
            run.nc_program.clone_from(&corrected.text);
            run.support_lines.clone_from(&corrected.support_lines);
        }
        let made = Made::of(run, monitor)?;
        let meant =
            if job.drawing.is_empty() { given.to_vec() } else { against(&outline(&job.drawing).parts(), given) };
        let proof = corrected.and_then(|corrected| corrected.proof.as_ref());
        let places = places(&between(&meant, &made.base.real), proof.map_or(&[], |proof| &proof.transitions));
        Ok(Self { made, meant, places, monitor })
    }

    /// Largest and smallest error of the diameter of a part that is cut with effects beside those of its job, um.
    pub(super) fn extremes_um(&self, effects: &[DeflectionEffect]) -> Result<[f64; 2], Failure> {
        // Its places lie so close where the error bends that there is none between them.
        let errors = self.errors_of(&self.made.with_effects(effects, self.monitor)?, 0.0);
        let ends = |[high, low]: [f64; 2], error: &f64| [high.max(*error), low.min(*error)];
        Ok(errors.iter().fold([f64::NEG_INFINITY, f64::INFINITY], ends))
    }

    /// Errors of the diameter of what is left, with so much more of it on the radius, um.
    fn errors_of(&self, yielded: &Yielded, more_mm: f64) -> Vec<f64> {
        let error = |&z_mm: &f64| {
            let [left, meant] = [&yielded.real, &self.meant].map(|parts| radius_at(parts, z_mm));
            2.0 * (left + more_mm - meant) * UM_PER_MM
        };
        self.places.z_mm.iter().map(error).collect()
    }
}

impl Parts for Leaves<'_> {
    fn places(&self) -> &Places {
        &self.places
    }

    fn errors_um(&self, draw: &Draw, shift_um: f64) -> Result<Vec<f64>, Failure> {
        let yielded = self.made.with_draw(draw, 0.5 * shift_um / UM_PER_MM, self.monitor)?;
        Ok(self.errors_of(&yielded, draw.scatter_mm))
    }

    fn cost_much(&self) -> bool {
        true
    }
}

/// Places of the contour outside transitions: of every stretch that one line makes the ends, the extremes, and some evenly.
fn places(errors: &[ContourError], transitions: &[Transition]) -> Places {
    let is_judged =
        |error: &&ContourError| !transitions.iter().any(|one| one.from_mm <= error.z_mm && error.z_mm <= one.to_mm);
    let judged: Vec<&ContourError> = errors.iter().filter(is_judged).collect();
    let stride = judged.len().div_ceil(PLACES).max(1);
    let mut places = Places::default();
    let goes_on = |a: &&ContourError, b: &&ContourError| a.line == b.line && b.z_mm - a.z_mm <= GOES_ON_MM;
    for stretch in judged.chunk_by(goes_on) {
        let error = |i: &usize| stretch[*i].error_um;
        let by_error = |a: &usize, b: &usize| error(a).total_cmp(&error(b));
        let ends = [(0..stretch.len()).max_by(by_error), (0..stretch.len()).min_by(by_error)];
        let first = places.z_mm.len();
        let last = stretch.len() - 1;
        let is_chosen = |i: &usize| i.is_multiple_of(stride) || *i == last || ends.contains(&Some(*i));
        places.z_mm.extend((0..stretch.len()).filter(is_chosen).map(|i| stretch[i].z_mm));
        places.zones.push(first..places.z_mm.len());
    }
    places
}
