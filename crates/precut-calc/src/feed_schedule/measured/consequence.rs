//! What comes of a schedule that was made with a model, where other effects act (`diagnosis/3.9`).

use crate::calculator::{Allowed, Calculator, Consequence, Failure, ForwardModel, Monitor, Quiet, Rows};
use crate::effects::MachinabilityEffect;

use crate::feed_schedule::FeedSchedule;
use crate::feed_schedule::job::input::{Job, Zone};
use crate::feed_schedule::measured::forward::{MachinabilityPoint, MachinabilityRun};

/// The measured output in the zone, given or found, where it comes closest to its limit, as a share of the limit, for each of `acting`.
/// Empty where the job has no zones, no limit of that output, or no schedule with `believed`.
pub(in crate::feed_schedule) fn consequences(
    job: &Job,
    quantity: &str,
    runs: &[MachinabilityRun],
    believed: &[MachinabilityEffect],
    acting: &[Vec<MachinabilityEffect>],
    monitor: &dyn Monitor,
) -> Result<Vec<Consequence>, Failure> {
    if !job.zones.iter().any(|zone| limit_of(job, zone, quantity).is_some()) {
        return Ok(Vec::new());
    }
    let mut scheduled = job.clone();
    scheduled.effects.extend_from_slice(believed);
    if let Some(first) = runs.first() {
        let of_job = &mut scheduled.conditions;
        of_job.flank_wear_mm = of_job.flank_wear_mm.or(first.flank_wear_mm);
        of_job.nose_radius_mm = of_job.nose_radius_mm.or(first.nose_radius_mm);
        of_job.time_min = of_job.time_min.or(first.time_min);
    }
    let zones = match FeedSchedule::run(&scheduled, &Quiet(monitor)) {
        Ok(answer) => answer.output.zones,
        Err(failure @ (Failure::Internal(_) | Failure::Cancelled)) => return Err(failure),
        // A model that no schedule satisfies decides nothing.
        Err(_) => return Ok(Vec::new()),
    };
    let place = |zone: &crate::feed_schedule::ZoneOutcome| MachinabilityPoint {
        speed_m_per_min: Some(zone.speed_m_per_min),
        feed_mm_per_rev: Some(zone.feed_mm_per_rev),
        depth_mm: Some(zone.depth_mm),
        ..MachinabilityPoint::default()
    };
    // What the job does not state of the edge, the batch and other conditions is as in the first run.
    let conditions = MachinabilityRun {
        speed_m_per_min: None,
        feed_mm_per_rev: None,
        depth_mm: None,
        ..runs.first().cloned().unwrap_or_default()
    };
    let rows = Rows { runs: vec![conditions], points: zones.iter().map(|zone| (0, place(zone))).collect() };
    let Ok(prepared) = FeedSchedule::prepare(job, &rows, quantity, monitor) else { return Ok(Vec::new()) };
    let limits: Vec<Option<Limit>> = zones
        .iter()
        .map(|cut| {
            let zone = cut.zone_of(job)?;
            if cut.is_rough(zone) { general_limit(job, quantity) } else { limit_of(job, zone, quantity) }
        })
        .collect();
    let values = acting
        .iter()
        .map(|effects| {
            let predicted = FeedSchedule::predict(&prepared, effects, monitor)?;
            let shares = predicted.iter().zip(&limits).filter_map(|(value, limit)| Some((value, (*limit)?)));
            let shares: Option<Vec<f64>> = shares.map(|(value, limit)| Some(limit.share(value.ok()?))).collect();
            Ok(shares.and_then(|shares| shares.into_iter().reduce(f64::max)))
        })
        .collect::<Result<_, Failure>>()?;
    Ok(vec![Consequence { name: "limit_use", unit: "1", allowed: Some(Allowed::AtMost(1.0)), values }])
}

/// A limit of an output.
#[derive(Debug, Clone, Copy)]
enum Limit {
    Upper(f64),
    Lower(f64),
}

impl Limit {
    fn share(self, value: f64) -> f64 {
        match self {
            Self::Upper(limit) => value / limit,
            Self::Lower(limit) => limit / value,
        }
    }
}

fn limit_of(job: &Job, zone: &Zone, quantity: &str) -> Option<Limit> {
    match quantity {
        "roughness_um" => zone.roughness_max_um.map(Limit::Upper),
        "hardening_percent" => zone.hardening_max_percent.map(Limit::Upper),
        "hardening_depth_um" => zone.hardening_depth_max_um.map(Limit::Upper),
        _ => general_limit(job, quantity),
    }
}

/// Limits that hold for every cut; those of a zone's surface hold for the last one.
fn general_limit(job: &Job, quantity: &str) -> Option<Limit> {
    let general = job.limits.as_ref()?;
    match quantity {
        "force_z_n" => general.force_z_max_n.map(Limit::Upper),
        "force_y_n" => general.force_y_max_n.map(Limit::Upper),
        "tool_life_min" => general.tool_life_min_min.map(Limit::Lower),
        _ => None,
    }
}
