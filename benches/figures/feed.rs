//! What feed schedules cost: the solver alone beside a general one, conflicts, zones that are found.

use precut_calc::calculator::{Calculator, Failure, Unwatched};
use precut_calc::feed_schedule::{FeedSchedule, Job, geometric_program, zone_compliances};
use precut_calc::num::gp::{self, Layout, Settings};
use serde_json::{Value, json};

use crate::measure::{Measured, cpu_time};

/// Zones of equal length on a hollow shaft between centres, tolerances that change from zone to zone, one edge for the
/// part and a limit on the step of feed.
fn job(zones: u32, changes: &Value) -> Result<Job, String> {
    let length = 1200.0 / f64::from(zones);
    let list: Vec<Value> = (0..zones)
        .map(|i| {
            json!({
                "id": format!("z{i}"), "z_start_mm": length * f64::from(i), "z_end_mm": length * f64::from(i + 1),
                "diameter_mm": 90.0, "depth_mm": 0.3, "deflection_max_um": 8.0 + f64::from(i % 5),
                "roughness_max_um": 3.0 + 0.3 * f64::from(i % 4)
            })
        })
        .collect();
    let mut job = json!({
        "shaft": { "youngs_modulus_n_per_mm2": 115_000, "segments": [{ "length_mm": 1200, "diameter_mm": 90, "bore_diameter_mm": 70 }] },
        "supports": [{ "kind": "centre", "z_mm": 0, "compliance_um_per_n": 0.01 }, { "kind": "centre", "z_mm": 1200, "compliance_um_per_n": 0.025 }],
        "zones": list,
        "models": {
            "library": "vt9_tk20",
            "force_y": { "form": "log_log", "constant": 7.795_646_54, "speed_exponent": -0.3, "feed_exponent": 0.6, "depth_exponent": 0.9 },
            "force_z": { "form": "log_log", "constant": 8.006_367_57, "speed_exponent": -0.15, "feed_exponent": 0.75, "depth_exponent": 1.0 }
        },
        "cutting_edge_angle_deg": 75,
        "machine": { "power_kw": 10, "efficiency": 0.8, "spindle_speed_min_rpm": 20, "spindle_speed_max_rpm": 2000, "feed_rate_max_mm_per_min": 2000 },
        "limits": {
            "feed_min_mm_per_rev": 0.02, "feed_max_mm_per_rev": 0.4, "speed_min_m_per_min": 10, "speed_max_m_per_min": 80,
            "tool_usage_max": 1.0, "feed_step_ratio_max": 1.1
        }
    });
    for (at, value) in changes.as_object().into_iter().flatten() {
        let (parent, key) = at.rsplit_once('/').ok_or("a pointer")?;
        job.pointer_mut(parent).ok_or_else(|| format!("no {parent}"))?[key] = value.clone();
    }
    let mut job: Job = serde_json::from_value(job).map_err(|error| error.to_string())?;
    FeedSchedule::fill(&mut job);
    Ok(job)
}

fn program(zones: u32) -> Result<gp::Program, String> {
    geometric_program(&job(zones, &json!({}))?).map_err(|failure| format!("{failure:?}"))
}

/// The interior-point method from the program to the certificate.
pub(crate) fn solver(zones: u32) -> Result<Measured, String> {
    let program = program(zones)?;
    let layout = Layout::new(&program).ok_or("no chain")?;
    layout.minimise(&Settings::default()).map_err(|failed| format!("{failed:?}"))?;
    cpu_time(|| layout.minimise(&Settings::default()))
}

/// The same program on exponential cones.
pub(crate) fn conic(zones: u32) -> Result<Measured, String> {
    let program = program(zones)?;
    gp::conic::minimise(&program, 1e-8).map_err(|failed| failed.0)?;
    cpu_time(|| gp::conic::minimise(&program, 1e-8))
}

pub(crate) fn compliances() -> Result<Measured, String> {
    let job = job(30, &json!({}))?;
    cpu_time(|| zone_compliances(&job))
}

/// Thirty zones in less time than their tolerances allow.
pub(crate) fn conflict() -> Result<Measured, String> {
    let job = job(30, &json!({ "/limits/time_max_min": 20.0 }))?;
    let Err(Failure::Conflicting(_)) = FeedSchedule::run(&job, &Unwatched) else {
        return Err("no conflict".to_owned());
    };
    cpu_time(|| FeedSchedule::run(&job, &Unwatched))
}

pub(crate) fn continuous() -> Result<Measured, String> {
    let zone = json!([{ "id": "a", "z_start_mm": 20, "z_end_mm": 1180, "diameter_mm": 90, "depth_mm": 0.3, "deflection_max_um": 9, "roughness_max_um": 3.5 }]);
    let job = job(
        1,
        &json!({
            "/zones": zone,
            "/limits/tool_usage_max": null,
            "/limits/feed_step_ratio_max": null,
            "/variables": { "speed": "fixed", "fixed_speed_m_per_min": 60 },
            "/method": { "kind": "continuous", "grid_points": 600, "segments_max": 24 }
        }),
    )?;
    FeedSchedule::run(&job, &Unwatched).map_err(|failure| format!("{failure:?}"))?;
    cpu_time(|| FeedSchedule::run(&job, &Unwatched))
}

/// Programs of one zone, one after the other.
pub(crate) fn single_zones() -> Result<Measured, String> {
    let program = program(1)?;
    cpu_time(|| (0..1000).filter(|_| gp::minimise(&program, &Settings::default()).is_ok()).count())
}

pub(crate) fn answer() -> Result<Measured, String> {
    let job = job(6, &json!({}))?;
    FeedSchedule::run(&job, &Unwatched).map_err(|failure| format!("{failure:?}"))?;
    cpu_time(|| FeedSchedule::run(&job, &Unwatched))
}

/// Thirty zones at a risk, over the same without one: complete answers.
pub(crate) fn at_risk(kind: &str) -> Result<Measured, String> {
    let of = |risk: Value| -> Result<Measured, String> {
        let mut job = job(30, &json!({ "/risk": risk }))?;
        for (model, scatter) in
            [(&mut job.models.roughness, 0.05), (&mut job.models.force_y, 0.1), (&mut job.models.tool_life, 0.3)]
        {
            model.as_mut().ok_or("no model")?.residual_scatter = Some(scatter);
        }
        FeedSchedule::run(&job, &Unwatched).map_err(|failure| format!("{failure:?}"))?;
        cpu_time(|| FeedSchedule::run(&job, &Unwatched))
    };
    let plain = of(json!({ "kind": "none" }))?;
    let at_risk = of(json!({ "kind": kind, "risk_percent": 5, "edge_risk_percent": 5 }))?;
    let over = |time: f64| time / plain.median;
    Ok(Measured { median: over(at_risk.median), low: over(at_risk.low), high: over(at_risk.high) })
}
