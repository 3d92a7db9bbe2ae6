//! Where the error at the end comes from: first order (`ring/6.1`), and by switching every term of the job that makes
//! waves off in turn (`ring/6.2`).

use crate::calculator::{Failure, Monitor, checkpoint};

use crate::ring_roundness::answer::output::{CauseKind, CauseOutcome, CausesOutcome};
use crate::ring_roundness::job::input::{DEFAULT_SAMPLES, Job};
use crate::ring_roundness::job::sampling::samples_of;
use crate::ring_roundness::model::linear::grows;
use crate::ring_roundness::model::lobing::of_order;
use crate::ring_roundness::model::scene::Scene;
use crate::ring_roundness::model::simulate::{Run, or_none, side_by_side};
use crate::ring_roundness::model::stance::back_off_mm;
use crate::ring_roundness::model::stance::{Stance, through_tip};
use crate::ring_roundness::model::surface::{UM_PER_MM, odd_waves_mm, roundness_um, unevaluable};
use crate::ring_roundness::model::turning::plane::{Vec2, add, angle, direction, norm, scaled, sub};
use crate::ring_roundness::model::turning::{Setting, turn};

/// Nodes of the runs of a cause where a filter hides the teeth: good to some nm.
const LEAST_NODES: u32 = 720;
/// Revolutions of spark-out that are added where it is asked whether more of them would help.
const MORE_SPARK_OUT: f64 = 3.0;
/// A term whose absence takes more revolutions than so many times those of the job is left out: a tool that starts clear
/// of the blank comes to it at its own feed.
pub(in crate::ring_roundness) const MOST_LONGER: f64 = 4.0;
/// A blank rounder than this makes no waves, um.
const ROUND_UM: f64 = 1e-3;
/// |a| + |b| above 1 by less than this is the rounding of a drawing's decimals.
const ON_LINE: f64 = 1e-9;

/// Where the error comes from; `switched_off` is what the run is without its terms.
pub(in crate::ring_roundness) fn causes(
    job: &Job,
    scene: &Scene,
    end: &Stance,
    run: &Run,
    switched_off: Vec<CauseOutcome>,
    monitor: &dyn Monitor,
) -> Result<CausesOutcome, Failure> {
    let setting = &scene.setting;
    let teeth_mm = end.radius_per_feed(setting.feed_direction) * setting.feed_mm_per_rev;
    let (roots, _) = scene.lobing(end.copying()).roots(1.5, f64::from(job.highest_order) + 0.45);
    let growing_lobes_um = (2..=job.highest_order)
        .filter(|order| of_order(&roots, f64::from(*order)).is_some_and(|root| grows(&root)))
        .filter_map(|order| run.surface.harmonic(order))
        .map(|harmonic| 2.0 * harmonic.amplitude_mm * UM_PER_MM)
        .fold(0.0, f64::max);
    // The step is even waves, which spark-out multiplies by (K/(1+K))² per revolution; a rigid tool needs half a one.
    let (k, dwell) = (setting.compliance_ratio, setting.spark_out_revolutions);
    let step_left = match (k > 0.0, dwell >= 0.5) {
        (true, _) => (k / (1.0 + k)).powf(2.0 * dwell),
        (false, true) => 0.0,
        (false, false) => 1.0,
    };
    let odd = if end.copying().is_diametral() { Some(odd_causes(job, run, teeth_mm, k, monitor)?) } else { None };
    Ok(CausesOutcome {
        feed_step_um: step_left * teeth_mm * UM_PER_MM,
        teeth_um: teeth_mm * UM_PER_MM,
        first_bite_um: odd.as_ref().map(|odd| odd.first_bite_um),
        odd_lobes_um: odd.as_ref().map(|odd| odd.blank_um),
        growing_lobes_um,
        samples: nodes(job),
        switched_off,
    })
}

/// What stays as odd waves with a tool opposite to a support, which makes the diameter and sees no others. Everywhere
/// else every wave grows or decays by a factor of its own.
struct OddCauses {
    /// Of the largest bite.
    first_bite_um: f64,
    /// Of the blank.
    blank_um: f64,
}

fn odd_causes(
    job: &Job,
    run: &Run,
    teeth_mm: f64,
    compliance_ratio: f64,
    monitor: &dyn Monitor,
) -> Result<OddCauses, Failure> {
    let excess_mm = (run.turned.largest_bite_mm - teeth_mm).max(0.0);
    Ok(OddCauses {
        first_bite_um: one_sided_mm(excess_mm, compliance_ratio) * UM_PER_MM,
        blank_um: roundness_um(&odd_waves_mm(&run.blank_mm), job.filter, monitor)?.0,
    })
}

/// What a bite leaves as odd waves, mm. A soft tool takes b/(1+K) of it, half a revolution later q = K/(1+K) times as
/// much from the other end of the diameter, then q² times from this one: together b, in the ratio of 1 to q. Half of the
/// difference, b (1-q)/(1+q)/2 = b/(1+2K)/2, is odd.
fn one_sided_mm(bite_mm: f64, compliance_ratio: f64) -> f64 {
    0.5 * bite_mm / (1.0 + 2.0 * compliance_ratio)
}

/// Nodes of the runs with a term off, and of the run beside them with all terms on.
pub(in crate::ring_roundness) fn nodes(job: &Job) -> u32 {
    let enough = job.filter.cutoff_upr().map(|cutoff| (8 * cutoff).next_multiple_of(4).max(LEAST_NODES));
    let own = match job.method {
        crate::ring_roundness::job::input::Method::ExactContact => samples_of(job),
        crate::ring_roundness::job::input::Method::NearestSamples => DEFAULT_SAMPLES,
    };
    enough.unwrap_or((own / 2).next_multiple_of(4)).min(own)
}

/// A run with a term off.
struct Variant {
    cause: CauseKind,
    effect: Option<usize>,
    setting: Setting,
    blank: Vec<f64>,
}

/// What the ring is without each of the terms that make waves.
pub(in crate::ring_roundness) fn switched_off(
    job: &Job,
    scene: &Scene,
    end: &Stance,
    monitor: &dyn Monitor,
) -> Result<Vec<CauseOutcome>, Failure> {
    let blank = scene.blank_mm(job, nodes(job) as usize).map_err(unevaluable)?;
    let run = |setting: &Setting, blank: &[f64]| {
        let turned = turn::<Failure>(blank, setting, &mut |_, _| checkpoint(monitor))?;
        Ok::<f64, Failure>(roundness_um(&turned.radii_mm, job.filter, monitor)?.0)
    };
    let variants = variants(job, scene, end, &blank, monitor)?;
    // With all terms first; a setting that cannot be is no alternative.
    let cases: Vec<Option<&Variant>> = std::iter::once(None).chain(variants.iter().map(Some)).collect();
    let mut found = side_by_side(&cases, |case| match case {
        None => run(&scene.setting, &blank).map(Some),
        Some(variant) => or_none(run(&variant.setting, &variant.blank)),
    })?
    .into_iter();
    let with_all = found.next().flatten().unwrap_or(0.0);
    let mut told: Vec<CauseOutcome> = variants
        .iter()
        .zip(found)
        .filter_map(|(variant, without)| {
            let roundness_without_um = without?;
            let share = if with_all > 0.0 { 1.0 - roundness_without_um / with_all } else { 0.0 };
            Some(CauseOutcome { cause: variant.cause, effect: variant.effect, roundness_without_um, share })
        })
        .collect();
    told.sort_by(|p, q| q.share.total_cmp(&p.share));
    Ok(told)
}

fn variants(
    job: &Job,
    scene: &Scene,
    end: &Stance,
    blank: &[f64],
    monitor: &dyn Monitor,
) -> Result<Vec<Variant>, Failure> {
    let setting = &scene.setting;
    let mut found = Vec::new();
    let mut add_one = |cause, effect, setting: Setting, blank: Vec<f64>| {
        found.push(Variant { cause, effect, setting, blank });
    };
    let odd = odd_waves_mm(blank);
    let mean = blank.iter().sum::<f64>() / blank.len() as f64;
    let even: Vec<f64> = blank.iter().zip(&odd).map(|(radius, odd)| radius - (odd - mean)).collect();
    if roundness_um(&odd, job.filter, monitor)?.0 > ROUND_UM {
        add_one(CauseKind::BlankOddWaves, None, setting.clone(), even.clone());
    }
    if roundness_um(&even, job.filter, monitor)?.0 > ROUND_UM {
        add_one(CauseKind::BlankEvenWaves, None, setting.clone(), odd);
    }
    if let Some(back_mm) = back_off_mm(setting, blank) {
        let mut clear = setting.clone();
        clear.tip_start_mm = add(setting.tip_start_mm, scaled(setting.feed_direction, -back_mm));
        clear.revolutions += back_mm / setting.feed_mm_per_rev;
        if clear.revolutions <= MOST_LONGER * setting.revolutions {
            add_one(CauseKind::FirstBite, None, clear, blank.to_vec());
        }
    }
    let finer = Setting {
        feed_mm_per_rev: 0.5 * setting.feed_mm_per_rev,
        revolutions: 2.0 * setting.revolutions,
        ..setting.clone()
    };
    add_one(CauseKind::Feed, None, finer, blank.to_vec());
    let longer = Setting { spark_out_revolutions: setting.spark_out_revolutions + MORE_SPARK_OUT, ..setting.clone() };
    add_one(CauseKind::SparkOutMissing, None, longer, blank.to_vec());
    if setting.compliance_ratio > 0.0 {
        add_one(CauseKind::Compliance, None, Setting { compliance_ratio: 0.0, ..setting.clone() }, blank.to_vec());
    }
    if end.copying().gain() > 1.0 + ON_LINE
        && let Some(opposite) = opposite(setting, end)
    {
        add_one(CauseKind::ToolOffLine, None, opposite, blank.to_vec());
    }
    for (i, _) in job.effects.iter().enumerate() {
        let mut others = job.effects.clone();
        others.remove(i);
        let without = Scene::of(job, &others);
        let blank = without.blank_mm(job, blank.len()).map_err(unevaluable)?;
        add_one(CauseKind::Effect, Some(i), without.setting, blank);
    }
    Ok(found)
}

/// The tool turned about the ring's centre to the nearest place opposite to a support, with its feed.
fn opposite(setting: &Setting, end: &Stance) -> Option<Setting> {
    let off = |to: Vec2| {
        let across = angle(scaled(to, -1.0)) - angle(end.to_tip);
        across.sin().atan2(across.cos())
    };
    let by = [off(end.to_a), off(end.to_b)].into_iter().min_by(|p, q| p.abs().total_cmp(&q.abs()))?;
    let about = |v: Vec2| scaled(direction(angle(v) + by), norm(v));
    let travel = setting.feed_mm_per_rev * setting.revolutions;
    let feed_direction = direction(angle(setting.feed_direction) + by);
    let tip_end = add(end.centre_mm, about(sub(setting.tip_end_mm(), end.centre_mm)));
    let turned =
        Setting { feed_direction, tip_start_mm: add(tip_end, scaled(feed_direction, -travel)), ..setting.clone() };
    through_tip(&turned, turned.tip_end_mm()).map(|_| turned)
}
