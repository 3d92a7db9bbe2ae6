//! Limits on outputs that scatter: which share of the parts, or of the edges, passes them (`feed/10.1`).

use crate::calculator::Finding;
use crate::machinability::ModelForm;
use crate::num::stats::normal_tail;

use super::case::{Case, ZoneCase};
use super::input::Job;
use super::models::Output;
use super::output::{Outcome, ZoneOutcome};

/// A share below this is not told.
const LEAST_SHARE: f64 = 0.01;

type Of = fn(&ZoneOutcome) -> Option<f64>;
type Most<'a> = &'a dyn Fn(&ZoneCase) -> Option<f64>;

/// The worst place of every limit whose model states a scatter, where more than one in a hundred passes it.
pub(super) fn warnings(job: &Job, case: &Case, outcome: &Outcome) -> Vec<Finding> {
    let limits = &case.limits;
    let upper: [(Output, Of, Most<'_>); 6] = [
        (Output::ForceY, |zone| zone.deflection_um, &|zone| {
            Some(zone.deflection_max_um? / limits.deflection_residual_fraction)
        }),
        (Output::ForceY, |zone| zone.force_y_n, &|_| limits.force_y_max_n),
        (Output::ForceZ, |zone| zone.force_z_n, &|_| limits.force_z_max_n),
        (Output::Roughness, |zone| zone.roughness_um, &|zone| zone.roughness_max_um),
        (Output::Hardening, |zone| zone.hardening_percent, &|zone| zone.hardening_max_percent),
        (Output::HardeningDepth, |zone| zone.hardening_depth_um, &|zone| zone.hardening_depth_max_um),
    ];
    let mut found = Vec::new();
    for (output, of, most) in upper {
        let Some((scatter, log_log)) = scatter(job, output) else { continue };
        let zones = case.zones.iter().zip(&outcome.zones).filter_map(|(zone, given)| {
            let (value, limit) = (of(given)?, most(zone)?);
            let beyond = if log_log { (limit / value).ln() } else { limit - value };
            Some((normal_tail(beyond / scatter), given.id.as_str(), value, limit))
        });
        found.extend(told(output, "limit", zones));
    }
    let Some((scatter, _)) = scatter(job, Output::ToolLife) else { return found };
    let lives = outcome.zones.iter().filter_map(|zone| {
        let (life, least) = (zone.tool_life_min?, limits.tool_life_min_min?);
        Some((normal_tail((life / least).ln() / scatter), zone.id.as_str(), life, least))
    });
    found.extend(told(Output::ToolLife, "limit", lives));
    // Life scatters from edge to edge: one that is to be used to U is worn out before with this probability.
    let edges = outcome.tool_changes.iter().map(|change| {
        (normal_tail(-change.tool_usage.ln() / scatter), change.after_zone.as_str(), change.tool_usage, 1.0)
    });
    found.extend(told(Output::ToolLife, "edge", edges));
    found
}

/// Standard deviation of single results about an output's model, and whether of their logarithms.
fn scatter(job: &Job, output: Output) -> Option<(f64, bool)> {
    let model = job.models.get(output)?;
    Some((model.residual_scatter.filter(|scatter| *scatter > 0.0)?, model.form == ModelForm::LogLog))
}

fn told<'z>(
    output: Output,
    of: &'static str,
    places: impl Iterator<Item = (f64, &'z str, f64, f64)>,
) -> Option<Finding> {
    let (share, zone, value, limit) = places.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let unit = match (output, of) {
        (_, "edge") => "1",
        _ => output.unit(),
    };
    (share > LEAST_SHARE).then(|| {
        Finding::new("half_fail", format!("/models/{}/residual_scatter", output.name()))
            .measured(value, limit, unit)
            .with("share", share)
            .with("model", output.name())
            .with("of", of)
            .with("zone", zone.to_owned())
    })
}
