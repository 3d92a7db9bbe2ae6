//! Limits of the depth.

use rayon::prelude::*;

use crate::calculator::{Failure, Message, checkpoint};
use crate::fixture_stability::answer::output::{AmplitudeCurve, DepthLimits, FirstLimit};
use crate::fixture_stability::answer::speeds::{first_of, forced_limits};
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::holding::Closed;
use crate::fixture_stability::model::lobes::{critical_depth, point};
use crate::fixture_stability::model::simulate::{observed, plan};

use super::{Study, UM_PER_MM, forced, has_motion, removal_rate};

/// Steps of the bracketing of a limit that only simulation gives: to 1/256 of a step of the curve.
const BRACKETING: u32 = 8;

/// What one depth gives with joints that stay closed.
#[derive(Clone, Copy)]
struct AtDepth {
    pub(in crate::fixture_stability::answer) modulus: f64,
    pub(in crate::fixture_stability::answer) span_mm: f64,
    pub(in crate::fixture_stability::answer) left_n: f64,
    pub(in crate::fixture_stability::answer) right_n: f64,
    lost: f64,
}

/// `None` where joints harden and no forced motion is found.
fn at_depth(study: &Study<'_>, depth: f64) -> Result<Option<AtDepth>, Failure> {
    let case = &study.case;
    let working = case.at_depth(depth);
    if !has_motion(case, working, study.monitor)? {
        return Ok(None);
    }
    let found = point(&study.rules, &case.holding, &case.cutting, working, Closed::BOTH, study.monitor)?;
    let modulus = found.multiplier.modulus;
    if study.is_slow || modulus < 1.0 {
        let forced = forced(case, working, study.monitor)?;
        return Ok(Some(AtDepth {
            modulus,
            span_mm: forced.x_mm.span(),
            left_n: forced.left_elastic_n.high.max(0.0),
            right_n: forced.right_elastic_n.high.max(0.0),
            lost: 0.0,
        }));
    }
    let plan = plan(case, &study.job.simulation, working, modulus);
    let run = observed(case, &plan, study.monitor)?.run;
    Ok(Some(AtDepth {
        modulus,
        span_mm: run.x_mm.span(),
        left_n: run.left_elastic_n.high.max(0.0),
        right_n: run.right_elastic_n.high.max(0.0),
        lost: run.lost_cut,
    }))
}

pub(super) fn limits(study: &Study<'_>) -> Result<DepthLimits, Failure> {
    let case = &study.case;
    let wanted = study.job.limits.depths;
    let mut depths: Vec<f64> = (1..=wanted).map(|i| study.examined_mm * f64::from(i) / f64::from(wanted)).collect();
    let mut found: Vec<AtDepth> = Vec::with_capacity(depths.len());
    let mut looked_at = 0;
    for chunk in depths.chunks(8) {
        checkpoint(study.monitor)?;
        let part: Result<Vec<_>, Failure> = chunk.par_iter().map(|&depth| at_depth(study, depth)).collect();
        found.extend(part?.into_iter().map_while(std::convert::identity));
        looked_at += chunk.len();
        if found.len() < looked_at {
            // What lies beyond a depth without a motion is no part of the curve.
            break;
        }
        let done = found.len() as f64 / depths.len() as f64;
        study.monitor.progress(0.2 + 0.2 * done, Message::new("stage_limits"));
    }
    depths.truncate(found.len());
    let force = case.holding.clamp_force_n;
    let reach = |of: &(dyn Fn(&AtDepth) -> f64 + Sync), limit: f64| first_reached(study, &depths, &found, of, limit);
    let amplitude_mm = reach(&|at| at.span_mm, case.working.feed_mm)?;
    let movable_opens_mm = force.map(|force| reach(&|at| at.left_n, force)).transpose()?.flatten();
    let fixed_opens_mm = force.map(|force| reach(&|at| at.right_n, force)).transpose()?.flatten();
    let stable_to_mm = study.chatter_mm.unwrap_or(study.examined_mm);
    let slips_mm = forced_limits(case, case.working.spindle_rpm, stable_to_mm, study.monitor)?.slips_mm;
    let drive = study.drive_depths(case.working.spindle_rpm);
    let first = first_of([
        (FirstLimit::Chatter, study.chatter_mm),
        (FirstLimit::MovableOpens, movable_opens_mm),
        (FirstLimit::FixedOpens, fixed_opens_mm),
        (FirstLimit::Slips, slips_mm),
        (FirstLimit::Amplitude, amplitude_mm),
        (FirstLimit::Power, drive.power_mm),
        (FirstLimit::Torque, drive.torque_mm),
    ]);
    let mut at_speeds = Vec::with_capacity(study.job.limits.speeds_rpm.len());
    for speed in &study.job.limits.speeds_rpm {
        checkpoint(study.monitor)?;
        let working = Working { spindle_rpm: speed.0, ..case.working };
        let chatter =
            critical_depth(&study.rules, &case.holding, &case.cutting, working, study.asked_mm, study.monitor)?;
        at_speeds.push(study.speed_limit(speed.0, chatter)?);
    }
    let column = |of: &dyn Fn(&AtDepth) -> f64| found.iter().map(of).collect::<Vec<f64>>();
    Ok(DepthLimits {
        chatter_mm: study.chatter_mm,
        amplitude_mm,
        movable_opens_mm,
        fixed_opens_mm,
        slips_mm,
        power_mm: drive.power_mm,
        torque_mm: drive.torque_mm,
        first: first.map(|(what, _)| what),
        first_mm: first.map(|(_, depth)| depth),
        removal_rate_cm3_per_min: first.map(|(_, depth)| removal_rate(case, case.at_depth(depth))),
        at_speeds,
        curve: AmplitudeCurve {
            modulus: column(&|at| at.modulus),
            peak_to_peak_um: column(&|at| at.span_mm * UM_PER_MM),
            clamp_movable_n: column(&|at| at.left_n),
            clamp_fixed_n: column(&|at| at.right_n),
            lost_cut_share: column(&|at| at.lost),
            depth_mm: depths,
        },
    })
}

/// Smallest depth at which a quantity exceeds its limit: bracketed on the curve, split at the chatter limit where the
/// quantity jumps, then bisected.
fn first_reached(
    study: &Study<'_>,
    depths: &[f64],
    found: &[AtDepth],
    of: &(dyn Fn(&AtDepth) -> f64 + Sync),
    limit: f64,
) -> Result<Option<f64>, Failure> {
    let Some(above) = found.iter().position(|at| of(at) > limit) else { return Ok(None) };
    let (mut low, mut high) = (if above == 0 { 0.0 } else { depths[above - 1] }, depths[above]);
    let exceeds =
        |depth: f64| Ok::<_, Failure>(at_depth(study, depth)?.as_ref().is_none_or(|reached| of(reached) > limit));
    if let Some(chatter) = study.chatter_mm.filter(|chatter| *chatter > low && *chatter < high) {
        if exceeds(chatter * (1.0 - 1e-7))? { high = chatter } else { low = chatter }
    }
    // Proportional to H^(1-mu) where the motion is the forced one.
    if study.case.is_linear() && study.chatter_mm.is_none_or(|chatter| high <= chatter) {
        let value = at_depth(study, high * (1.0 - 1e-7))?.as_ref().map_or(0.0, of);
        let power = 1.0 / (1.0 - study.case.cutting.depth_exponent);
        return Ok((value > 0.0).then(|| high * (limit / value).powf(power)));
    }
    for _ in 0..BRACKETING {
        checkpoint(study.monitor)?;
        let middle = 0.5 * (low + high);
        if exceeds(middle)? { high = middle } else { low = middle }
    }
    // A jump at the onset of chatter is at the onset.
    let onset =
        study.chatter_mm.filter(|chatter| (high - chatter) < (depths[above] - chatter) / 200.0 && high >= *chatter);
    Ok(Some(onset.unwrap_or(high)))
}
