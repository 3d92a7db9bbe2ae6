//! Other cuts that make a good part more probable (`certainty/4.4`). Each is planned and judged as a job of its own.

use std::sync::LazyLock;

use utoipa::openapi::schema::{Array, Object};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{Number, PartialSchema};

use crate::calculator::{Failure, Monitor};
use crate::certainty::lines::Estimate;
use crate::certainty::{Improvement, ImprovingAction, JointlyKept};
use crate::diameters::Judged;

use crate::deflection_compensation::answer::advice::held_more;
use crate::deflection_compensation::answer::aimed::rehearsed_at_aim;
use crate::deflection_compensation::answer::auto::settled;
use crate::deflection_compensation::answer::driven::Again;
use crate::deflection_compensation::answer::output::{AddedSupport, OneMoreRest};
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{Job, Pass};

/// Share of the feed that is tried.
const SLOWER: f64 = 0.7;
/// Share of its depth that a shallower last pass keeps.
const SHALLOWER: f64 = 0.5;
/// Least feed and most passes of a job: they stand in its schema. Nothing keeps what would have no bound there.
static LEAST_FEED_MM_PER_REV: LazyLock<f64> = LazyLock::new(|| match field(Pass::schema(), "feed_mm_per_rev") {
    Some(Schema::Object(Object { minimum: Some(Number::Float(least)), .. })) => least,
    _ => f64::INFINITY,
});
static MOST_PASSES: LazyLock<usize> = LazyLock::new(|| match field(Job::schema(), "passes") {
    Some(Schema::Array(Array { max_items, .. })) => max_items.unwrap_or(0),
    _ => 0,
});

/// The schema of a field.
fn field(schema: RefOr<Schema>, name: &str) -> Option<Schema> {
    let RefOr::T(Schema::Object(object)) = schema else { return None };
    match object.properties.get(name)?.clone() {
        RefOr::T(schema) => Some(schema),
        RefOr::Ref(_) => None,
    }
}

/// Another cut, and what is done for it.
struct OtherCut {
    job: Job,
    action: ImprovingAction,
}

/// The other cuts that raise the probability by more than both errors. None is tried where the job has the probability that it wants; one
/// more rest is tried where the ordinary answer has tried it.
pub(in crate::deflection_compensation) fn improvements(
    job: &Job,
    now: &JointlyKept,
    rest: Option<&OneMoreRest>,
    monitor: &dyn Monitor,
) -> Result<Vec<Improvement>, Failure> {
    let mut found = Vec::new();
    if now.met {
        return Ok(found);
    }
    let others = [slower(job), shallower(job), rest.map(|rest| held(job, rest))];
    let now = Estimate { probability: now.probability, error: now.numerical_error };
    for OtherCut { job, action } in others.into_iter().flatten() {
        let then = estimate(&job, monitor)?;
        found.extend(then.and_then(|then| Improvement::of(action, now, then)));
    }
    Ok(found)
}

/// The probability of another job, aimed as that says; `None` where it cannot be cut.
fn estimate(job: &Job, monitor: &dyn Monitor) -> Result<Option<Estimate>, Failure> {
    let judged = || -> Result<Option<Estimate>, Failure> {
        let (job, _) = settled(job, monitor)?;
        let acting = Acting::of(&job.effects, &job.conditions, job.cut.feed_direction);
        let Some(rehearsal) = rehearsed_at_aim(&job, &Grid::of(&job), &acting, &Again(monitor))? else {
            return Ok(None);
        };
        Judged::of(job.asked(), &rehearsal, monitor)?.map(|judged| judged.least_found(0.0)).transpose()
    };
    match judged() {
        Err(Failure::OutOfModel(_)) => Ok(None),
        found => found,
    }
}

/// The last pass with a smaller feed.
fn slower(job: &Job) -> Option<OtherCut> {
    let mut slower = job.clone();
    let feed = match slower.passes.last_mut() {
        Some(pass) => pass.feed_mm_per_rev.get_or_insert(job.cut.feed_mm_per_rev),
        None => &mut slower.cut.feed_mm_per_rev,
    };
    *feed = in_three_digits(SLOWER * *feed);
    let feed_mm_per_rev = *feed;
    (feed_mm_per_rev >= *LEAST_FEED_MM_PER_REV)
        .then(|| OtherCut { job: slower, action: ImprovingAction::LowerFeed { feed_mm_per_rev } })
}

/// As it is told and typed in.
fn in_three_digits(value: f64) -> f64 {
    let steps = 10_f64.powf(2.0 - value.log10().floor());
    (value * steps).round() / steps
}

/// A compensated pass before the last one that leaves half of its depth. Of a shaft that is turned to several diameters in one pass no one
/// diameter does that.
fn shallower(job: &Job) -> Option<OtherCut> {
    let mut shallower = job.clone();
    let diameter_mm = match shallower.passes[..] {
        [] => {
            let turned = job.shaft.segments.iter().filter(|segment| segment.stock_mm() > segment.diameter_mm);
            let mut diameters: Vec<[f64; 2]> = turned.map(|of| [of.diameter_mm, of.stock_mm()]).collect();
            diameters.dedup();
            let [[last_mm, stock_mm]] = diameters[..] else { return None };
            let diameter_mm = last_mm + SHALLOWER * (stock_mm - last_mm);
            shallower.passes = vec![pass(diameter_mm), pass(last_mm)];
            diameter_mm
        }
        [.., ref before, ref last] => {
            let diameter_mm = last.diameter_mm + SHALLOWER * (before.diameter_mm - last.diameter_mm);
            let place = shallower.passes.len() - 1;
            shallower.passes.insert(place, pass(diameter_mm));
            diameter_mm
        }
        [_] => return None,
    };
    (shallower.passes.len() <= *MOST_PASSES)
        .then(|| OtherCut { job: shallower, action: ImprovingAction::ShallowerLastPass { diameter_mm } })
}

fn pass(diameter_mm: f64) -> Pass {
    Pass { diameter_mm, feed_mm_per_rev: None, speed_m_per_min: None, spindle_speed_rpm: None, compensated: true }
}

/// One more support, as the ordinary answer advises it.
fn held(job: &Job, rest: &OneMoreRest) -> OtherCut {
    let OneMoreRest { kind, z_mm, compliance_um_per_n, .. } = *rest;
    OtherCut {
        job: held_more(job, (kind, z_mm, compliance_um_per_n)),
        action: match kind {
            AddedSupport::SteadyRest => ImprovingAction::AddSteadyRest { z_mm, compliance_um_per_n },
            AddedSupport::Centre => ImprovingAction::AddCentre { z_mm, compliance_um_per_n },
        },
    }
}
