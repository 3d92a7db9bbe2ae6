//! What to measure next, and what it would decide (`process/5`).

use super::memory::Memory;
use super::null::Gram;
use super::sight::{COSINES, GAUGE};
use super::state::{ChangedCause, Measure};
use super::watch::{PartOf, Watch};
use crate::calculator::{Failure, Measurement, Monitor, Ranges, Rows, Watched};

/// Standard uncertainty of a reading of a master, where none was stated, um.
const MASTER_UM: f64 = 0.5;
/// Of a Bayes factor beyond this nobody asks how large it is.
const MOST: f64 = 1e6;

/// Candidates by what one of them tells of the two likeliest causes of the last change, the best first.
pub(super) fn ranked<M: Watched>(
    watch: &mut Watch<M>,
    last: &PartOf<M>,
    monitor: &dyn Monitor,
) -> Result<Vec<Measure>, Failure> {
    let Some([one, other]) = watch.memory.rivals() else { return Ok(Vec::new()) };
    let decides = [one.kind.clone(), other.kind.clone()];
    let mut found = Vec::new();
    let mut add = |code, part_type, condition, squared: f64| {
        let expected_bayes_factor = (0.5 * squared).exp().min(MOST);
        found.push(Measure { code, part_type, condition, decides: decides.clone(), expected_bayes_factor });
    };
    if let Some(gauge) = [&one, &other].into_iter().find(|cause| cause.kind == GAUGE) {
        add("master_on_gauge", None, None, (2.0 * gauge.delta / MASTER_UM).powi(2));
    }
    for (name, of_type) in watch.eye.document.part_types.keys().zip(0..) {
        let seen = watch.memory.parts.iter().rev().find(|(part, _)| part.kind == of_type && !part.odd);
        if let Some(gram) = seen.and_then(|(_, gram)| gram.as_ref()) {
            let is_last = *name == last.part_type;
            let code = if is_last { "another_part" } else { "other_part_type" };
            add(code, (!is_last).then(|| name.clone()), None, watch.memory.apart(gram, &one, &other));
        }
    }
    let job = watch.eye.document.part_types[&last.part_type].job.clone();
    let points = last.measurements.iter().map(|row| (0, row.point())).collect();
    let rows = Rows { runs: vec![last.conditions.clone()], points };
    for next in M::next_runs(&job, &rows, Ranges(&[])) {
        let part = PartOf::<M> { conditions: next.run, ..last.clone() };
        let Some(gram) = gram_of(watch, &part, monitor)? else { continue };
        add("other_condition", None, Some(next.changes), watch.memory.apart(&gram, &one, &other));
    }
    found.sort_by(|a, b| b.expected_bayes_factor.total_cmp(&a.expected_bayes_factor));
    // Of one condition the better end.
    let mut ranked: Vec<Measure> = Vec::new();
    for measure in found {
        let is_known = |own: &Measure| {
            own.code == measure.code && own.condition == measure.condition && own.part_type == measure.part_type
        };
        if !ranked.iter().any(is_known) {
            ranked.push(measure);
        }
    }
    Ok(ranked)
}

/// What a part would tell that was cut otherwise; nothing where the model does not go there.
fn gram_of<M: Watched>(watch: &mut Watch<M>, part: &PartOf<M>, monitor: &dyn Monitor) -> Result<Option<Gram>, Failure> {
    let mut catalogue = watch.memory.catalogue.clone();
    let signs = match watch.eye.signs(part, &mut catalogue, monitor) {
        Ok(signs) => signs,
        Err(Failure::Cancelled) => return Err(Failure::Cancelled),
        Err(_) => return Ok(None),
    };
    let Some(scatter) = &watch.memory.scatter else { return Ok(None) };
    let sighting = signs.unmeasured(part.number, watch.eye.kind(part)?);
    Ok(Some(Gram::of(&sighting, scatter, &catalogue)))
}

impl Memory {
    /// The two likeliest named causes of the last change that one measurement could still tell apart.
    fn rivals(&self) -> Option<[ChangedCause; 2]> {
        let mut named = self.changes.last()?.causes.iter().filter(|cause| cause.kind != "unnamed");
        Some([named.next()?.clone(), named.next()?.clone()])
    }

    /// d^2 of one cause at its size from the other at whatever size, on one part.
    fn apart(&self, gram: &Gram, one: &ChangedCause, other: &ChangedCause) -> f64 {
        let (Some((a, size)), Some((b, _))) = (self.place(one), self.place(other)) else { return 0.0 };
        let g = |i: usize, j: usize| gram.inner[(COSINES + i, COSINES + j)];
        let shared = if g(b, b) > 0.0 { g(a, b).powi(2) / g(b, b) } else { 0.0 };
        size * size * (g(a, a) - shared).max(0.0)
    }

    /// Variant of a cause, and its size in prior standard deviations.
    pub(super) fn place(&self, cause: &ChangedCause) -> Option<(usize, f64)> {
        let is_it = |variant: &usize| {
            let own = &self.catalogue.variants[*variant];
            let name = &self.catalogue.names[own.name];
            name.kind == cause.kind && name.label == cause.label && own.parameter == cause.parameter
        };
        let variant = (0..self.catalogue.variants.len()).find(is_it)?;
        Some((variant, cause.delta / self.catalogue.variants[variant].prior_sd))
    }
}
