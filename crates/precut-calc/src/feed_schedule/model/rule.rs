//! The source paper's rule: the same deflection in every zone by feed alone (`feed/4.1`).

use crate::feed_schedule::answer::output::EqualDeflection;
use crate::feed_schedule::job::case::Case;
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::plan::EqualTarget;
use crate::feed_schedule::model::assess;

/// What the rule aims at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::feed_schedule) enum Target {
    Minimum,
    Tolerance,
    Um(f64),
}

impl Target {
    pub(in crate::feed_schedule) fn of(target: EqualTarget, um: Option<f64>) -> Self {
        match (um, target) {
            (Some(um), _) => Self::Um(um),
            (None, EqualTarget::Minimum) => Self::Minimum,
            (None, EqualTarget::Tolerance) => Self::Tolerance,
        }
    }
}

/// The rule's schedule: ln V and ln S by zone, and what is to be said of it. `None` where no zone bends.
///
/// S_i = S_0 (delta_0/delta_i)^(1/s_y), then cut off at the feed bounds. The force's feed exponent is taken at the
/// reference feed.
pub(in crate::feed_schedule) fn equal_deflection(
    case: &Case,
    speed_m_per_min: &[f64],
    feed_mm_per_rev: f64,
    target: Target,
) -> Option<(Vec<(f64, f64)>, EqualDeflection)> {
    let x0 = feed_mm_per_rev.ln();
    let u: Vec<f64> = speed_m_per_min.iter().map(|v| v.ln()).collect();
    let at_reference: Vec<(f64, f64)> = u.iter().map(|&u| (u, x0)).collect();
    let deflection = |at: &[(f64, f64)]| -> Vec<Option<f64>> {
        case.zones
            .iter()
            .zip(at)
            .map(|(zone, &(u, x))| {
                assess::deflection_um(zone, zone.model(Output::ForceY).map(|model| model.output(u, x)))
            })
            .collect()
    };
    let before = deflection(&at_reference);
    let least = before.iter().flatten().copied().filter(|d| *d > 0.0).reduce(f64::min)?;
    let (mut at, mut rule, mut clamped) = (Vec::new(), Vec::new(), Vec::new());
    for (i, zone) in case.zones.iter().enumerate() {
        let aim = match target {
            Target::Minimum => Some(least),
            Target::Um(um) => Some(um),
            Target::Tolerance => zone.deflection_max_um,
        };
        let slope = zone.model(Output::ForceY).map_or(0.0, |model| model.evaluate(u[i], x0).2);
        let feed = match (aim, before[i]) {
            (Some(aim), Some(own)) if own > 0.0 && slope > 0.0 => feed_mm_per_rev * (aim / own).powf(1.0 / slope),
            _ => feed_mm_per_rev,
        };
        let kept = feed.clamp(case.limits.feed_min_mm_per_rev, zone.feed_max_mm_per_rev);
        if (kept - feed).abs() > 1e-12 * feed {
            clamped.push(zone.id.clone());
        }
        rule.push(feed);
        at.push((u[i], kept.ln()));
    }
    let said = EqualDeflection {
        reference_feed_mm_per_rev: feed_mm_per_rev,
        target_um: match target {
            Target::Minimum => Some(least),
            Target::Um(um) => Some(um),
            Target::Tolerance => None,
        },
        largest_before_um: assess::largest(before.into_iter())?,
        cutting_time_before_min: assess::cutting_time_min(case, &at_reference),
        cutting_time_min: assess::cutting_time_min(case, &at),
        largest_deflection_um: assess::largest(deflection(&at).into_iter())?,
        rule_feed_mm_per_rev: rule,
        clamped,
    };
    Some((at, said))
}
