//! How deep one may cut with a probability, over the spindle speed (`certainty/6.2`).
//!
//! With one mode, a linear cut and even teeth the limit (1-k) Cp H^(1-mu) S_z^-k / (C1 + C2) depends on two numbers alone: the
//! speed over the natural frequency, and the damping ratio. What is uncertain in stiffness and mass shifts the speed, in damping
//! moves from one boundary to its neighbour, in stiffness and force scales the depth: a handful of boundaries serves all draws.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Message, checkpoint};
use crate::certainty::Uncertainties;
use crate::certainty::judging::Judging;
use crate::certainty::lines::points;

use crate::fixture_stability::answer::conformance::Judged;
use crate::fixture_stability::answer::parts::plane_of;
use crate::fixture_stability::answer::speeds::said;
use crate::fixture_stability::answer::study::{Study, WITHIN, removal_rate};
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::FixtureJob;
use crate::fixture_stability::job::uncertain::{Drawn, FixtureQuantity, drawn, scales_alone};
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::holding::Holding;
use crate::fixture_stability::model::lobes::{BoundaryPoint, Plane, boundary};

/// Draws of the vise.
const DRAWS: usize = 1024;
/// Boundaries, of damping ratios that lie evenly by their logarithm.
pub(in crate::fixture_stability) const BOUNDARIES: usize = 7;
/// Least number of speeds of a boundary before it is refined.
pub(in crate::fixture_stability) const LEAST_SPEEDS: usize = 100;
/// Boundaries are followed so many times as deep as the diagram: a stiffer vise or a softer material brings deeper limits into it.
const DEEPER: f64 = 2.0;
/// Probabilities of the contours.
const CONTOURS: [f64; 3] = [0.9, 0.5, 0.1];
/// By how much the speed is varied beside the one that is named.
const BESIDE: f64 = 0.02;
/// Speeds that are tried for the one that is named.
const TRIED: usize = 4;

/// Codes of what is said here.
pub(in crate::fixture_stability) const EXPLANATION_CODES: &[&str] = &["robust_speed_is", "no_probable_depths"];

/// How deep one may cut before chatter, with a probability.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ProbableDepths {
    /// Spindle speeds.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Depth up to which nine of ten such vises are stable; null where it lies deeper than the diagram.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub stable_90_percent_mm: Vec<Option<f64>>,
    /// Depth up to which half of them are.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub stable_50_percent_mm: Vec<Option<f64>>,
    /// Depth up to which one of ten is.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub stable_10_percent_mm: Vec<Option<f64>>,
    /// Depth up to which as many are as is wanted.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub stable_wanted_mm: Vec<Option<f64>>,
    /// The speed at which most is removed with the wanted probability of all limits, within power and torque; tried.
    pub robust_speed: Option<RobustSpeed>,
}

/// A speed that holds over what is uncertain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RobustSpeed {
    /// The speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: f64,
    /// The depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: f64,
    /// What is removed there.
    #[schema(extensions(("x-unit" = json!("cm3/min"))))]
    pub removal_rate_cm3_per_min: f64,
    /// Probability that the cut is quiet, no joint opens and nothing slips, as far as the job tells of clamp force and grip.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub joint_probability: f64,
    /// The same 2 % slower, at the same depth.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub joint_probability_slower: f64,
    /// The same 2 % faster.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub joint_probability_faster: f64,
    /// Most that is removed at the stated values, with half of such vises chattering: what certainty costs.
    #[schema(extensions(("x-unit" = json!("cm3/min"))))]
    pub removal_rate_at_even_odds_cm3_per_min: f64,
}

/// What a draw does to the boundary.
struct Scaling {
    /// Factor on the natural frequency.
    frequency: f64,
    /// Logarithm of the factor on the damping ratio.
    damping: f64,
    /// Factor on H^(1-mu).
    depth: f64,
}

impl Scaling {
    fn of(case: &Case, Drawn { case: there, .. }: &Drawn) -> Self {
        let stiffness = there.holding.static_stiffness_n_per_mm() / case.holding.static_stiffness_n_per_mm();
        let mass = there.holding.mass_kg / case.holding.mass_kg;
        let of = |holding: &Holding| holding.left.damping_n_s_per_mm + holding.right.damping_n_s_per_mm;
        Self {
            frequency: (stiffness / mass).sqrt(),
            damping: (of(&there.holding) / of(&case.holding) / (stiffness * mass).sqrt()).ln(),
            depth: stiffness * case.cutting.coefficient / there.cutting.coefficient,
        }
    }
}

/// Boundaries of the vise at several dampings, which hold for every draw.
struct Net {
    /// Logarithm of the first factor on the damping ratio, and the step to the next.
    first: f64,
    step: f64,
    boundaries: Vec<Vec<BoundaryPoint>>,
    /// Limits are followed up to here.
    most_mm: f64,
}

impl Net {
    /// The first limit at a speed and a damping; `most_mm` where none was met.
    fn limit_mm(&self, spindle_rpm: f64, damping: f64) -> f64 {
        let last = self.boundaries.len() - 1;
        let at = |index: usize| self.on(&self.boundaries[index], spindle_rpm);
        if last == 0 {
            return at(0);
        }
        let place = ((damping - self.first) / self.step).clamp(0.0, last as f64);
        let Some(below) = (0..last).rev().find(|&index| index as f64 <= place) else { return at(0) };
        let share = place - below as f64;
        at(below).powf(1.0 - share) * at(below + 1).powf(share)
    }

    fn on(&self, points: &[BoundaryPoint], spindle_rpm: f64) -> f64 {
        let limit = |point: &BoundaryPoint| point.crossings_mm.first().copied().unwrap_or(self.most_mm);
        let after = points.partition_point(|point| point.spindle_rpm <= spindle_rpm);
        match (after.checked_sub(1).map(|before| &points[before]), points.get(after)) {
            (Some(before), Some(after)) => {
                let share = (spindle_rpm - before.spindle_rpm) / (after.spindle_rpm - before.spindle_rpm);
                limit(before) + share * (limit(after) - limit(before))
            }
            (Some(one), None) | (None, Some(one)) => limit(one),
            (None, None) => self.most_mm,
        }
    }
}

/// Whether two numbers tell the limit.
pub(in crate::fixture_stability) fn scales(case: &Case) -> bool {
    let damped = case.holding.left.damping_n_s_per_mm + case.holding.right.damping_n_s_per_mm > 0.0;
    case.holding.states() == 2 && case.is_linear() && damped
}

/// The depths over the speeds of the job's lobe diagram; `None` where two numbers do not tell the limit.
pub(in crate::fixture_stability) fn probable_depths(
    study: &Study<'_>,
    judged: &Judged<'_>,
) -> Result<Option<ProbableDepths>, Failure> {
    let case = &study.case;
    if !scales(case) || !scales_alone(study.job) {
        return Ok(None);
    }
    let plane = plane_of(study.job, case, study.examined_mm);
    let scalings = scalings(study.job, case, judged.uncertainties())?;
    let net = net(study, &plane, &scalings)?;
    let last = plane.speeds.saturating_sub(1).max(1) as f64;
    let speeds: Vec<f64> = (0..plane.speeds).map(|index| plane.speed_rpm(index as f64 / last)).collect();
    let wanted = study.job.uncertainty.wanted_probability;
    let mut contours: Vec<Vec<Option<f64>>> = vec![Vec::with_capacity(speeds.len()); CONTOURS.len() + 1];
    for &speed in &speeds {
        checkpoint(study.monitor)?;
        let limits = limits_mm(case, &net, &scalings, speed);
        for (contour, probability) in contours.iter_mut().zip(CONTOURS.into_iter().chain([wanted])) {
            contour.push(stable_to_mm(&limits, probability).filter(|depth| *depth <= plane.most_mm));
        }
    }
    let robust_speed = robust_speed(study, judged, &plane, &speeds, [&contours[CONTOURS.len()], &contours[1]])?;
    let mut contours = contours.into_iter();
    let mut next = || contours.next().unwrap_or_default();
    Ok(Some(ProbableDepths {
        spindle_speed_rpm: speeds,
        stable_90_percent_mm: next(),
        stable_50_percent_mm: next(),
        stable_10_percent_mm: next(),
        stable_wanted_mm: next(),
        robust_speed,
    }))
}

fn scalings(
    job: &FixtureJob,
    case: &Case,
    uncertainties: &Uncertainties<FixtureQuantity>,
) -> Result<Vec<Scaling>, Failure> {
    let of = |point: Vec<f64>| {
        let there = drawn(job, case, uncertainties, &uncertainties.values(&point))?;
        Ok(Scaling::of(case, &there))
    };
    points(DRAWS, uncertainties.dimensions(), job.uncertainty.seed).map(of).collect()
}

fn net(study: &Study<'_>, plane: &Plane, scalings: &[Scaling]) -> Result<Net, Failure> {
    let case = &study.case;
    let range = |of: &dyn Fn(&Scaling) -> f64| {
        scalings.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    };
    let (lowest, highest) = range(&|of| of.frequency);
    let (first, end) = range(&|of| of.damping);
    let count = if end - first > 1e-9 { BOUNDARIES } else { 1 };
    let step = (end - first) / (count.saturating_sub(1).max(1)) as f64;
    let wide = Plane {
        from_rpm: plane.from_rpm / highest,
        to_rpm: plane.to_rpm / lowest,
        speeds: plane.speeds.max(LEAST_SPEEDS),
        most_mm: DEEPER * plane.most_mm,
        ..*plane
    };
    let of = |index: usize| {
        let mut holding = case.holding.clone();
        let factor = (step.mul_add(index as f64, first)).exp();
        holding.left.damping_n_s_per_mm *= factor;
        holding.right.damping_n_s_per_mm *= factor;
        boundary(&study.rules, &holding, &case.cutting, &wide, study.monitor, &mut |_, _| {})
    };
    let boundaries = (0..count).map(of).collect::<Result<Vec<_>, _>>()?;
    Ok(Net { first, step, boundaries, most_mm: wide.most_mm })
}

/// Limits of all draws at a speed, rising; infinite where none was met.
fn limits_mm(case: &Case, net: &Net, scalings: &[Scaling], spindle_rpm: f64) -> Vec<f64> {
    let power = 1.0 / (1.0 - case.cutting.depth_exponent);
    let of = |scaling: &Scaling| {
        let limit = net.limit_mm(spindle_rpm / scaling.frequency, scaling.damping);
        if limit < net.most_mm { limit * scaling.depth.powf(power) } else { f64::INFINITY }
    };
    let mut limits: Vec<f64> = scalings.iter().map(of).collect();
    limits.sort_by(f64::total_cmp);
    limits
}

/// Depth up to which that share of the draws is stable.
fn stable_to_mm(rising: &[f64], probability: f64) -> Option<f64> {
    let place = ((1.0 - probability) * rising.len() as f64 - 0.5).clamp(0.0, (rising.len() - 1) as f64);
    let below = (0..rising.len()).rev().find(|&index| index as f64 <= place)?;
    let above = rising[(below + 1).min(rising.len() - 1)];
    let depth = rising[below] + (place - below as f64) * (above - rising[below]);
    depth.is_finite().then_some(depth)
}

/// Of the speeds at which most is removed with the wanted probability the best that holds when it is tried with all limits.
fn robust_speed(
    study: &Study<'_>,
    judged: &Judged<'_>,
    plane: &Plane,
    speeds: &[f64],
    [wanted_mm, even_mm]: [&[Option<f64>]; 2],
) -> Result<Option<RobustSpeed>, Failure> {
    let case = &study.case;
    let removed = |spindle_rpm: f64, stable_mm: Option<f64>| {
        let drive_mm = study.drive_depths(spindle_rpm).least_mm().map_or(f64::INFINITY, |depth| WITHIN * depth);
        let depth_mm = stable_mm.unwrap_or(plane.most_mm).min(drive_mm);
        let working = Working { spindle_rpm, depth_mm, ..case.working };
        (removal_rate(case, working), working)
    };
    let all = |depths: &[Option<f64>]| -> Vec<(f64, Working)> {
        let mut all: Vec<_> = speeds.iter().zip(depths).map(|(n, depth)| removed(*n, *depth)).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        all
    };
    let even = all(even_mm).first().map_or(0.0, |best| best.0);
    let wanted = study.job.uncertainty.wanted_probability;
    let mut best: Option<RobustSpeed> = None;
    for (rate, working) in all(wanted_mm).into_iter().take(TRIED) {
        if best.as_ref().is_some_and(|best| best.removal_rate_cm3_per_min >= rate) {
            break;
        }
        let spindle_rpm = said(working.spindle_rpm, 4, f64::round);
        let there = Working { spindle_rpm, ..working };
        let Some(depth_mm) = judged.depth_mm(there, wanted, there.depth_mm)? else { continue };
        let working = Working { depth_mm: said(depth_mm, 3, f64::floor), ..there };
        let probability =
            |factor: f64| judged.probability(Working { spindle_rpm: factor * working.spindle_rpm, ..working });
        let found = RobustSpeed {
            spindle_speed_rpm: working.spindle_rpm,
            depth_mm: working.depth_mm,
            removal_rate_cm3_per_min: removal_rate(case, working),
            joint_probability: probability(1.0)?,
            joint_probability_slower: probability(1.0 - BESIDE)?,
            joint_probability_faster: probability(1.0 + BESIDE)?,
            removal_rate_at_even_odds_cm3_per_min: even,
        };
        if best.as_ref().is_none_or(|best| found.removal_rate_cm3_per_min > best.removal_rate_cm3_per_min) {
            best = Some(found);
        }
    }
    Ok(best)
}

/// What is said of it.
pub(in crate::fixture_stability) fn said_of(depths: Option<&ProbableDepths>, wanted: f64) -> Option<Message> {
    let Some(depths) = depths else { return Some(Message::new("no_probable_depths")) };
    let robust = depths.robust_speed.as_ref()?;
    let rate = robust.removal_rate_cm3_per_min;
    Some(
        Message::new("robust_speed_is")
            .with("spindle_speed_rpm", robust.spindle_speed_rpm)
            .with("depth_mm", robust.depth_mm)
            .with("percent", 100.0 * robust.joint_probability)
            .with("wanted_percent", 100.0 * wanted)
            .with("slower_percent", 100.0 * robust.joint_probability_slower)
            .with("faster_percent", 100.0 * robust.joint_probability_faster)
            .with("removal_rate_cm3_per_min", rate)
            .with("even_cm3_per_min", robust.removal_rate_at_even_odds_cm3_per_min.max(rate)),
    )
}
