//! What limits the depth at a speed, and speeds at which more can be removed.

use crate::calculator::{Failure, Monitor, checkpoint};

use crate::fixture_stability::answer::output::{BetterSpeed, FirstLimit, SpeedLimit};
use crate::fixture_stability::answer::study::{
    NEAR_LIMIT, Study, WITHIN, forced, forced_span_mm, has_motion, removal_rate,
};
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::SimulationSettings;
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::holding::Closed;
use crate::fixture_stability::model::lobes::{ChatterLimit, critical_depth, point};
use crate::fixture_stability::model::march::Plan;
use crate::fixture_stability::model::simulate::{plan, run, scatter};
use crate::fixture_stability::model::slip::Pushing;
use crate::fixture_stability::model::slow::is_slow;

/// Halvings of the depth at which a vise that is not linear reaches a limit: to a 16 000 000th of the depth.
const HALVINGS: u32 = 24;
/// Better speeds that are told, and peaks that are tried for them at most.
const BETTER_SPEEDS: usize = 3;
const TRIED: usize = 6;
/// So often chatter is looked for again at the depth that is told.
const LOOKED_AGAIN: usize = 4;
/// A better speed removes more by at least this share.
const WORTH: f64 = 0.02;

/// Depths at which the forced motion at a speed reaches a limit, mm.
#[allow(clippy::struct_field_names)] // the unit
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::fixture_stability) struct ForcedLimits {
    /// It exceeds the feed per tooth.
    pub amplitude_mm: Option<f64>,
    /// It opens the joint at the movable jaw, that at the fixed jaw.
    pub movable_opens_mm: Option<f64>,
    pub fixed_opens_mm: Option<f64>,
    /// The workpiece slips along the jaws at the lowest friction.
    pub slips_mm: Option<f64>,
}

/// Limits up to `limit_mm`.
pub(in crate::fixture_stability) fn forced_limits(
    case: &Case,
    spindle_rpm: f64,
    limit_mm: f64,
    monitor: &dyn Monitor,
) -> Result<ForcedLimits, Failure> {
    let force = case.holding.clamp_force_n;
    let most = [Some(case.working.feed_mm), force, force, force.filter(|_| case.grip.is_some())];
    let at = |depth_mm: f64| -> Result<[f64; 4], Failure> {
        let working = Working { spindle_rpm, depth_mm, ..case.working };
        if !has_motion(case, working, monitor)? {
            return Ok([f64::INFINITY; 4]);
        }
        match forced(case, working, monitor) {
            Ok(of) => {
                let slips = |grip| Pushing::new(case, working, &of, grip).least_n(grip.friction.low);
                let slips_n = case.grip.as_ref().map_or(0.0, slips);
                Ok([of.x_mm.span(), of.left_elastic_n.high, of.right_elastic_n.high, slips_n])
            }
            // No motion that repeats itself: it grows without end.
            Err(Failure::OutOfModel(_) | Failure::NotConverged { .. }) => Ok([f64::INFINITY; 4]),
            Err(why) => Err(why),
        }
    };
    let mut reached = [None; 4];
    if case.is_linear() {
        // At 1 mm; the forced motion goes with H^(1-mu).
        let (power, at_1_mm) = (1.0 / (1.0 - case.cutting.depth_exponent), at(1.0)?);
        for (depth, (most, value)) in reached.iter_mut().zip(most.into_iter().zip(at_1_mm)) {
            *depth = most.filter(|_| value > 0.0).map(|most| (most / value).powf(power)).filter(|d| *d <= limit_mm);
        }
    } else {
        let deepest = at(limit_mm)?;
        for (which, depth) in reached.iter_mut().enumerate() {
            let Some(most) = most[which].filter(|most| deepest[which] > *most) else { continue };
            let (mut low, mut high) = (0.0, limit_mm);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                if at(middle)?[which] > most { high = middle } else { low = middle }
            }
            *depth = Some(low);
        }
    }
    let [amplitude_mm, movable_opens_mm, fixed_opens_mm, slips_mm] = reached;
    Ok(ForcedLimits { amplitude_mm, movable_opens_mm, fixed_opens_mm, slips_mm })
}

impl SpeedLimit {
    /// What one may cut: the least of the limits, and no deeper than was looked.
    fn allowed_mm(&self) -> f64 {
        let limits = [
            self.chatter_mm,
            self.amplitude_mm,
            self.movable_opens_mm,
            self.fixed_opens_mm,
            self.slips_mm,
            self.drive_mm,
        ];
        limits.into_iter().flatten().fold(self.depth_examined_mm, f64::min)
    }

    /// What one may cut not near chatter, an opening joint or slip, and within the other limits.
    fn safe_mm(&self) -> f64 {
        let short_of = [self.chatter_mm, self.movable_opens_mm, self.fixed_opens_mm, self.slips_mm];
        let depths = short_of.into_iter().flatten().map(|depth| NEAR_LIMIT * depth);
        let within = [self.amplitude_mm, self.drive_mm].into_iter().flatten().map(|depth| WITHIN * depth);
        depths.chain(within).fold(self.depth_examined_mm, f64::min)
    }
}

/// What gives out first: at one depth the earlier of the list is the cause of the later.
pub(in crate::fixture_stability) fn first_of(
    limits: impl IntoIterator<Item = (FirstLimit, Option<f64>)>,
) -> Option<(FirstLimit, f64)> {
    let known = limits.into_iter().filter_map(|(what, depth)| depth.map(|depth| (what, depth)));
    known.reduce(|best, next| if next.1 < best.1 * (1.0 - 1e-6) { next } else { best })
}

/// Peaks of the removal rate over the speeds that lie above what can be removed at the working speed, each tried, the highest
/// first. The ends of the range are no peaks: what lies beyond them is not known. `limits` were looked for up to `most_mm`.
pub(in crate::fixture_stability) fn better_speeds(
    study: &Study<'_>,
    limits: &[SpeedLimit],
    most_mm: f64,
) -> Result<Vec<BetterSpeed>, Failure> {
    let case = &study.case;
    let rate = |limit: &SpeedLimit| {
        let (spindle_rpm, depth_mm) = (limit.spindle_speed_rpm, limit.safe_mm());
        removal_rate(case, Working { spindle_rpm, depth_mm, ..case.working })
    };
    let least = (1.0 + WORTH) * removed_here(study, most_mm)?;
    let rates: Vec<f64> = limits.iter().map(rate).collect();
    let mut peaks: Vec<(f64, &SpeedLimit)> = rates
        .windows(3)
        .zip(&limits[1..])
        .filter(|(three, _)| three[0] < three[1] && three[2] <= three[1] && three[1] > least)
        .map(|(three, limit)| (three[1], limit))
        .collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut better = Vec::new();
    for (_, peak) in peaks.into_iter().take(TRIED) {
        checkpoint(study.monitor)?;
        better.extend(tried(study, peak.spindle_speed_rpm, most_mm)?.filter(|of| of.removal_rate_cm3_per_min > least));
        if better.len() == BETTER_SPEEDS {
            break;
        }
    }
    better.sort_by(|a, b| b.removal_rate_cm3_per_min.total_cmp(&a.removal_rate_cm3_per_min));
    Ok(better)
}

/// What can be removed at the working speed, cm3/min: as deep as is safe there, or as deep as the job cuts where that is allowed.
fn removed_here(study: &Study<'_>, most_mm: f64) -> Result<f64, Failure> {
    let Study { case, rules, .. } = study;
    // Elsewhere was looked no deeper than here.
    let chatter = match study.chatter() {
        known if known.depth_mm.is_some() || known.examined_mm >= most_mm => known,
        _ => critical_depth(rules, &case.holding, &case.cutting, case.working, most_mm, study.monitor)?,
    };
    let limit = study.speed_limit(case.working.spindle_rpm, chatter)?;
    let safe = removal_rate(case, Working { depth_mm: limit.safe_mm(), ..case.working });
    let as_asked = (case.working.depth_mm <= limit.allowed_mm()).then(|| removal_rate(case, case.working));
    Ok(as_asked.map_or(safe, |asked| asked.max(safe)))
}

/// The limits at a speed with the depth that keeps off them, as it is read. Chatter is looked for again up to where that depth is
/// near it: a scan over a smaller range finds thinner islands.
fn kept_off(study: &Study<'_>, there: Working, mut limit: SpeedLimit) -> Result<Option<(SpeedLimit, f64)>, Failure> {
    let case = &study.case;
    for _ in 0..LOOKED_AGAIN {
        let safe_mm = limit.safe_mm();
        if safe_mm <= 0.0 {
            return Ok(None);
        }
        let depth_mm = said(safe_mm, 3, f64::floor);
        let near_mm = depth_mm / NEAR_LIMIT;
        let again = critical_depth(&study.rules, &case.holding, &case.cutting, there, near_mm, study.monitor)?;
        match again.depth_mm.filter(|chatter_mm| *chatter_mm < near_mm * (1.0 - 1e-6)) {
            None => return Ok(Some((limit, depth_mm))),
            nearer => limit.chatter_mm = nearer,
        }
    }
    Ok(None)
}

/// A better speed, tried before it is told: not near chatter, an opening joint or slip, within the other limits, as it is read.
/// `None` where the cut then does not hold still after all (a large motion may stand beside the stable one, and the entry asks
/// more of a joint than the steady cut).
fn tried(study: &Study<'_>, spindle_speed_rpm: f64, most_mm: f64) -> Result<Option<BetterSpeed>, Failure> {
    let case = &study.case;
    // The peaks of lobes are sharp: the limits are those of the speed that is read.
    let spindle_rpm = said(spindle_speed_rpm, 4, f64::round);
    let there = Working { spindle_rpm, ..case.working };
    let chatter: ChatterLimit =
        critical_depth(&study.rules, &case.holding, &case.cutting, there, most_mm, study.monitor)?;
    let Some((limit, depth_mm)) = kept_off(study, there, study.speed_limit(spindle_rpm, chatter)?)? else {
        return Ok(None);
    };
    let working = Working { depth_mm, ..there };
    if !has_motion(case, working, study.monitor)? {
        return Ok(None);
    }
    let found = point(&study.rules, &case.holding, &case.cutting, working, Closed::BOTH, study.monitor)?;
    if found.multiplier.grows() {
        return Ok(None);
    }
    match forced_span_mm(case, working, study.monitor) {
        Ok(span_mm) if span_mm <= working.feed_mm => {}
        Err(Failure::Cancelled) => return Err(Failure::Cancelled),
        _ => return Ok(None),
    }
    let motion = forced(case, working, study.monitor)?;
    let opens_n = case.above_round_off_n(motion.left_n.high.max(motion.right_n.high));
    let slips_n = case.grip.as_ref().map(|grip| Pushing::new(case, working, &motion, grip).least_n(grip.friction.low));
    let clamp_n = slips_n.map_or(opens_n, |slips| slips.max(opens_n));
    if case.holding.clamp_force_n.is_some_and(|given| given < clamp_n) {
        return Ok(None);
    }
    let SimulationSettings { regeneration, entry, .. } = study.job.simulation;
    let settings = SimulationSettings { regeneration, entry, ..SimulationSettings::default() };
    if !is_slow(&case.holding, &case.cutting, spindle_rpm) {
        let modulus = found.multiplier.modulus;
        let plan = Plan { unilateral: case.holding.clamp_force_n.is_some(), ..plan(case, &settings, working, modulus) };
        let run = run(case, &plan, study.monitor)?;
        let opened = run.first_open_left_s.or(run.first_open_right_s).is_some();
        if run.diverged || opened || run.lost_cut > 0.0 || !scatter(case, &plan, &run).settled {
            return Ok(None);
        }
    }
    let drive = study.drive_depths(spindle_rpm);
    let first = first_of([
        (FirstLimit::Chatter, limit.chatter_mm),
        (FirstLimit::MovableOpens, limit.movable_opens_mm),
        (FirstLimit::FixedOpens, limit.fixed_opens_mm),
        (FirstLimit::Slips, limit.slips_mm),
        (FirstLimit::Amplitude, limit.amplitude_mm),
        (FirstLimit::Power, drive.power_mm),
        (FirstLimit::Torque, drive.torque_mm),
    ]);
    Ok(Some(BetterSpeed {
        spindle_speed_rpm: spindle_rpm,
        depth_mm: working.depth_mm,
        removal_rate_cm3_per_min: removal_rate(case, working),
        clamp_force_n: clamp_n,
        first: first.map(|(what, _)| what),
        first_mm: first.map(|(_, depth)| depth),
    }))
}

/// A positive number with as many digits as a sentence says of it.
pub(in crate::fixture_stability) fn said(value: f64, digits: i32, rounded: fn(f64) -> f64) -> f64 {
    let scale = 10.0_f64.powf(f64::from(digits) - 1.0 - value.log10().floor());
    rounded(value * scale) / scale
}
