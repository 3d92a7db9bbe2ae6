//! How probable it is that what a program leaves keeps the limits of the drawing (`program/10`).
//!
//! The parts are those of the program that is given back, or of the given one where there is none: read and driven again with draws
//! of what is uncertain, and held against what is meant.

use crate::calculator::{Failure, Monitor};
use crate::certainty::Conformance;
use crate::diameters::{Draw, Judged, Parts, Places};

use super::job::Job;
use super::made::Made;
use super::model::correction::{Corrected, Transition};
use super::model::stock::{Part, outline};
use super::model::yielding::{ContourError, against, between, radius_at};

const UM_PER_MM: f64 = 1e3;
/// Places at which errors are told, about, beside the ends and the extremes of every stretch.
const PLACES: usize = 120;
/// A stretch goes on to a place that is no farther from the one before it, mm.
const GOES_ON_MM: f64 = 2.5;

/// Parts as a program leaves them.
struct Leaves<'a> {
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
    let mut run = job.clone();
    if let Some(corrected) = corrected {
        run.nc_program.clone_from(&corrected.text);
        run.support_lines.clone_from(&corrected.support_lines);
    }
    let made = Made::of(run, monitor)?;
    let meant = if job.drawing.is_empty() { given.to_vec() } else { against(&outline(&job.drawing).parts(), given) };
    let proof = corrected.and_then(|corrected| corrected.proof.as_ref());
    let places = places(&between(&meant, &made.base.real), proof.map_or(&[], |proof| &proof.transitions));
    let leaves = Leaves { made, meant, places, monitor };
    Judged::of(job.asked(), &leaves, monitor)?.map(|judged| judged.conformance(0.0)).transpose()
}

impl Parts for Leaves<'_> {
    fn places(&self) -> &Places {
        &self.places
    }

    fn errors_um(&self, draw: &Draw, shift_um: f64) -> Result<Vec<f64>, Failure> {
        let yielded = self.made.with_draw(draw, 0.5 * shift_um / UM_PER_MM, self.monitor)?;
        let error = |&z_mm: &f64| {
            let [left, meant] = [&yielded.real, &self.meant].map(|parts| radius_at(parts, z_mm));
            2.0 * (left + draw.scatter_mm - meant) * UM_PER_MM
        };
        Ok(self.places.z_mm.iter().map(error).collect())
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
