//! What a schedule gives in every zone: forces, deflection, surface, wear.

use std::f64::consts::PI;

use crate::feed_schedule::answer::output::{NamedValue, SurfaceUsage, ZoneOutcome};
use crate::feed_schedule::job::case::{Case, ZoneCase};
use crate::feed_schedule::job::input::Job;
use crate::feed_schedule::job::models::Output;

/// What a zone gives at ln V, ln S.
pub(in crate::feed_schedule) fn zone_outcome(case: &Case, job: &Job, i: usize, (u, x): (f64, f64)) -> ZoneOutcome {
    let zone = &case.zones[i];
    let output = |output: Output| zone.model(output).map(|model| model.output(u, x));
    let (speed, feed) = (u.exp(), x.exp());
    let time = zone.work() / (speed * feed);
    let (force_y, force_z) = (output(Output::ForceY), output(Output::ForceZ));
    let deflection = deflection_um(zone, force_y);
    let life = output(Output::ToolLife);
    ZoneOutcome {
        id: zone.id.clone(),
        z_start_mm: zone.from_mm,
        z_end_mm: zone.to_mm,
        diameter_mm: zone.diameter_mm,
        depth_mm: zone.depth_mm,
        passes: zone.repeat,
        feed_mm_per_rev: feed,
        speed_m_per_min: speed,
        spindle_speed_rpm: 1000.0 * speed / (PI * zone.diameter_mm),
        cutting_time_min: time,
        compliance_um_per_n: zone.compliance_um_per_n,
        force_y_n: force_y,
        force_z_n: force_z,
        power_kw: force_z.map(|f| f * speed / (60_000.0 * case.machine.efficiency)),
        torque_n_m: force_z.map(|f| f * zone.diameter_mm / 2000.0),
        deflection_um: deflection,
        diameter_error_um: deflection.map(|d| 2.0 * d),
        roughness_um: output(Output::Roughness),
        hardening_percent: output(Output::Hardening),
        hardening_depth_um: output(Output::HardeningDepth),
        tool_life_min: life,
        tool_usage: life.map(|life| time / life),
        further: job
            .models
            .further
            .iter()
            .zip(&zone.further)
            .map(|(named, model)| NamedValue {
                name: named.name.clone(),
                value: model.output(u, x),
                unit: named.unit.clone(),
            })
            .collect(),
        active: Vec::new(),
    }
}

/// delta = C P_y, um.
pub(in crate::feed_schedule) fn deflection_um(zone: &ZoneCase, force_y_n: Option<f64>) -> Option<f64> {
    Some(zone.compliance_um_per_n? * force_y_n?)
}

/// Time in the cut, min.
pub(in crate::feed_schedule) fn cutting_time_min(case: &Case, at: &[(f64, f64)]) -> f64 {
    case.zones.iter().zip(at).map(|(zone, (u, x))| zone.work() * (-u - x).exp()).sum()
}

/// Use of an edge by surface, in the order of the part.
pub(in crate::feed_schedule) fn usage_by_surface(case: &Case, zones: &[ZoneOutcome]) -> Vec<SurfaceUsage> {
    case.surfaces
        .iter()
        .enumerate()
        .filter_map(|(s, surface)| {
            let of = || case.zones.iter().zip(zones).filter(|(zone, _)| zone.surface == s).map(|(_, z)| z.tool_usage);
            let usage: Option<f64> = of().sum();
            usage.map(|tool_usage| SurfaceUsage { surface: surface.clone(), tool_usage })
        })
        .collect()
}

/// Largest of the values that are there.
pub(in crate::feed_schedule) fn largest(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    values.flatten().reduce(f64::max)
}

/// Largest over least of the values that are there and positive.
pub(in crate::feed_schedule) fn spread(values: impl Iterator<Item = Option<f64>> + Clone) -> Option<f64> {
    let least = values.clone().flatten().filter(|v| *v > 0.0).reduce(f64::min)?;
    Some(largest(values)? / least)
}
