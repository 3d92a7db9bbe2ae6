//! What to measure next, and what it would decide (`process/5`).

use std::sync::Arc;

use crate::calculator::{Calculator, Failure, Measurement, Monitor, Ranges, Rows, Watched};
use crate::process::answer::next::measured_over;
use crate::process::answer::output::{ChangedCause, Measure};
use crate::process::change::null::Gram;
use crate::process::history::memory::Memory;
use crate::process::history::watch::Watch;
use crate::process::part::check::MOST_ROWS;
use crate::process::part::document::PartOf;
use crate::process::part::sight::{COSINES, GAUGE};

/// Standard uncertainty of a reading of a master, where none was stated, um.
const MASTER_UM: f64 = 0.5;
/// Of a Bayes factor beyond this nobody asks how large it is.
const MOST: f64 = 1e6;

/// Candidates by what one of them tells of the two likeliest causes of the last change, the best first.
pub(in crate::process) fn ranked<M: Watched>(
    watch: &mut Watch<M>,
    last: &PartOf<M>,
    monitor: &dyn Monitor,
) -> Result<Vec<Measure>, Failure> {
    let Some([one, other]) = watch.memory.rivals() else { return Ok(Vec::new()) };
    let decides = [one.kind.clone(), other.kind.clone()];
    let mut found = Vec::new();
    let plain = |code, squared: f64| Measure {
        code,
        part_type: None,
        condition: None,
        value: None,
        stations: None,
        decides: decides.clone(),
        expected_bayes_factor: (0.5 * squared).exp().min(MOST),
    };
    if let Some(gauge) = [&one, &other].into_iter().find(|cause| cause.kind == GAUGE) {
        found.push(plain("master_on_gauge", (2.0 * gauge.delta / MASTER_UM).powi(2)));
    }
    for (name, of_type) in watch.eye.document.part_types.keys().zip(0..) {
        let seen = watch.memory.parts.iter().rev().find(|(part, _)| part.kind == of_type && !part.odd);
        if let Some(gram) = seen.and_then(|(_, gram)| gram.as_ref()) {
            let is_last = *name == last.part_type;
            let code = if is_last { "another_part" } else { "other_part_type" };
            let measure = plain(code, watch.memory.apart(gram, &one, &other));
            found.push(Measure { part_type: (!is_last).then(|| name.clone()), ..measure });
        }
    }
    let job = watch.eye.document.part_types[&last.part_type].job.clone();
    if let Some((stations, gram)) = denser(watch, last, &job, monitor)? {
        let measure = plain("more_stations", watch.memory.apart(&gram, &one, &other));
        found.push(Measure { stations: Some(stations), ..measure });
    }
    let points = last.measurements.iter().map(|row| (0, row.point())).collect();
    let rows = Rows { runs: vec![last.conditions.clone()], points };
    let usual = M::next_runs(&job, &rows, Ranges(&[]), monitor)?.into_iter().map(|next| {
        // A fresh edge has cut nothing; all others are conditions as they are called.
        let is_edge = M::path_m(&next.run) == Some(0.0) && M::path_m(&last.conditions) != Some(0.0);
        (if is_edge { "new_edge" } else { "other_condition" }, next.changes, None, next.run)
    });
    let telling = M::telling_runs(&job, &last.conditions).into_iter();
    let telling = telling.map(|own| (own.code, own.condition.0, Some(own.condition.1), own.run));
    for (code, condition, value, run) in usual.chain(telling) {
        let part = PartOf::<M> { conditions: run, ..last.clone() };
        let Some(gram) = gram_of(watch, &part, monitor)? else { continue };
        let measure = plain(code, watch.memory.apart(&gram, &one, &other));
        found.push(Measure { condition: Some(condition), value, ..measure });
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

/// How many stations between and beside those of the last part, and what they would tell.
fn denser<M: Watched>(
    watch: &Watch<M>,
    last: &PartOf<M>,
    job: &<M as Calculator>::Input,
    monitor: &dyn Monitor,
) -> Result<Option<(usize, Gram)>, Failure> {
    let Some([from, to]) = measured_over::<M>(job, &last.measurements) else { return Ok(None) };
    let count = (2 * last.measurements.len() - 1).min(MOST_ROWS);
    if count <= last.measurements.len() {
        return Ok(None);
    }
    let share = |k: usize| from + (to - from) * k as f64 / (count - 1) as f64;
    let points = (0..count).map(|k| M::point_along(job, share(k))).collect();
    let mut catalogue = watch.memory.catalogue.clone();
    let signs = watch.eye.signs_at(&last.part_type, &last.conditions, points, &mut catalogue, monitor)?;
    let Some(scatter) = &watch.memory.scatter else { return Ok(None) };
    let sighting = Arc::new(signs).unmeasured(last.number, watch.eye.kind(last)?);
    Ok(Some((count, Gram::of(&sighting, scatter, &catalogue))))
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
    pub(in crate::process) fn place(&self, cause: &ChangedCause) -> Option<(usize, f64)> {
        let is_it = |variant: &usize| {
            let own = &self.catalogue.variants[*variant];
            let name = &self.catalogue.names[own.name];
            name.kind == cause.kind && name.label == cause.label && own.parameter == cause.parameter
        };
        let variant = (0..self.catalogue.variants.len()).find(is_it)?;
        Some((variant, cause.delta / self.catalogue.variants[variant].prior_sd))
    }
}
