//! Other cuts that make a good part more probable (`certainty/4.4`). Each is planned and judged as a job of its own.

use crate::calculator::{Failure, Monitor};
use crate::certainty::lines::Estimate;
use crate::certainty::{Improvement, JointlyKept};
use crate::diameters::Judged;

use crate::deflection_compensation::answer::advice::held_more;
use crate::deflection_compensation::answer::aimed::cuts_at_aim;
use crate::deflection_compensation::answer::auto::settled;
use crate::deflection_compensation::answer::driven::Again;
use crate::deflection_compensation::answer::output::{AddedSupport, OneMoreRest};
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{Job, Pass};

/// Share of the feed that is tried.
const SLOWER: f64 = 0.7;
/// Least feed of a job, mm/rev.
const LEAST_FEED: f64 = 1e-4;
/// Share of its depth that a shallower last pass keeps.
const SHALLOWER: f64 = 0.5;
/// Most passes of a job.
const MOST_PASSES: usize = 20;

/// Another cut, and how it is told.
struct OtherCut {
    job: Job,
    /// Makes the advice from the probability of a good part and its gain.
    told: Box<dyn FnOnce(f64, f64) -> Improvement>,
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
    for OtherCut { job, told } in others.into_iter().flatten() {
        let Some(then) = estimate(&job, monitor)? else { continue };
        let gain = then.probability - now.probability;
        if gain > now.numerical_error + then.error {
            found.push(told(crate::certainty::bounded(then.probability), gain));
        }
    }
    Ok(found)
}

/// The probability of another job, aimed as that says; `None` where it cannot be cut.
fn estimate(job: &Job, monitor: &dyn Monitor) -> Result<Option<Estimate>, Failure> {
    let judged = || -> Result<Option<Estimate>, Failure> {
        let (job, _) = settled(job, monitor)?;
        let acting = Acting::of(&job.effects, &job.conditions, job.cut.feed_direction);
        let (driven, _) = cuts_at_aim(&job, &Grid::of(&job), &acting, &mut |_, _, _| (), &Again(monitor))?;
        let Some(rehearsal) = &driven.rehearsal else { return Ok(None) };
        Judged::of(job.asked(), rehearsal, monitor)?.map(|judged| judged.least_found(0.0)).transpose()
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
    *feed *= SLOWER;
    let feed_mm_per_rev = *feed;
    (feed_mm_per_rev >= LEAST_FEED).then(|| OtherCut {
        job: slower,
        told: Box::new(move |joint_probability, gain| Improvement::LowerFeed {
            feed_mm_per_rev,
            joint_probability,
            gain,
        }),
    })
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
    (shallower.passes.len() <= MOST_PASSES).then(|| OtherCut {
        job: shallower,
        told: Box::new(move |joint_probability, gain| Improvement::ShallowerLastPass {
            diameter_mm,
            joint_probability,
            gain,
        }),
    })
}

fn pass(diameter_mm: f64) -> Pass {
    Pass { diameter_mm, feed_mm_per_rev: None, speed_m_per_min: None, spindle_speed_rpm: None, compensated: true }
}

/// One more support, as the ordinary answer advises it.
fn held(job: &Job, rest: &OneMoreRest) -> OtherCut {
    let OneMoreRest { kind, z_mm, compliance_um_per_n, .. } = *rest;
    OtherCut {
        job: held_more(job, (kind, z_mm, compliance_um_per_n)),
        told: Box::new(move |joint_probability, gain| match kind {
            AddedSupport::SteadyRest => {
                Improvement::AddSteadyRest { z_mm, compliance_um_per_n, joint_probability, gain }
            }
            AddedSupport::Centre => Improvement::AddCentre { z_mm, compliance_um_per_n, joint_probability, gain },
        }),
    }
}
