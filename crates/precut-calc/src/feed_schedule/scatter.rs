//! Limits on outputs that scatter: with which probability the parts, and the edges, keep them (`feed/10.1`, `certainty/5`).

use crate::calculator::Finding;
use crate::certainty::normal_quantile;
use crate::machinability::ModelForm;
use crate::num::stats::normal_tail;

use super::case::{Case, ZoneCase};
use super::input::Job;
use super::models::Output;
use super::output::{Outcome, ScheduleConformance, ScheduledLimitKept, ZoneOutcome};

/// A share below this is not told.
const LEAST_SHARE: f64 = 0.01;
/// A share that was asked for may be passed by this, relative: what a schedule is solved to.
const SOLVED: f64 = 1e-3;
/// A probability is told between this and what is left of 1.
const LEAST: f64 = 1e-6;

type Of = fn(&ZoneOutcome) -> Option<f64>;
/// A limit that a zone has.
pub(super) type LimitOf = fn(&Case, &ZoneCase) -> Option<f64>;

/// A limit on an output of every zone.
pub(super) struct OutputLimit {
    pub output: Output,
    /// As answers name it.
    pub name: &'static str,
    of: Of,
    pub limit: LimitOf,
}

/// Upper limits on outputs.
pub(super) const OUTPUT_LIMITS: [OutputLimit; 6] = [
    OutputLimit {
        output: Output::ForceY,
        name: "deflection",
        of: |zone| zone.deflection_um,
        limit: |case, zone| {
            zone.yields()?;
            Some(zone.deflection_max_um? / case.limits.deflection_residual_fraction)
        },
    },
    OutputLimit {
        output: Output::ForceY,
        name: "force_y",
        of: |zone| zone.force_y_n,
        limit: |case, _| case.limits.force_y_max_n,
    },
    OutputLimit {
        output: Output::ForceZ,
        name: "force_z",
        of: |zone| zone.force_z_n,
        limit: |case, _| case.limits.force_z_max_n,
    },
    OutputLimit {
        output: Output::Roughness,
        name: "roughness",
        of: |zone| zone.roughness_um,
        limit: |_, zone| zone.roughness_max_um,
    },
    OutputLimit {
        output: Output::Hardening,
        name: "hardening",
        of: |zone| zone.hardening_percent,
        limit: |_, zone| zone.hardening_max_percent,
    },
    OutputLimit {
        output: Output::HardeningDepth,
        name: "hardening_depth",
        of: |zone| zone.hardening_depth_um,
        limit: |_, zone| zone.hardening_depth_max_um,
    },
];

/// A limit in a zone, or of an edge, that a result passes with some probability.
struct Kept {
    output: Output,
    name: &'static str,
    zone: String,
    value: f64,
    limit: f64,
    /// The probability that it is passed.
    passed: f64,
}

/// Every limit of a part whose output scatters, in every zone.
fn of_part(job: &Job, case: &Case, outcome: &Outcome) -> Vec<Kept> {
    let mut all = Vec::new();
    for OutputLimit { output, name, of, limit } in &OUTPUT_LIMITS {
        let Some((scatter, log_log)) = scatter(job, *output) else { continue };
        all.extend(case.zones.iter().zip(&outcome.zones).filter_map(|(zone, given)| {
            let (value, limit) = (of(given)?, limit(case, zone)?);
            let beyond = if log_log { (limit / value).ln() } else { limit - value };
            let passed = normal_tail(beyond / scatter);
            Some(Kept { output: *output, name, zone: given.id.clone(), value, limit, passed })
        }));
    }
    all
}

/// Every limit on the life of an edge: the least one of a zone, and what is used of each edge before it is changed.
fn of_edges(job: &Job, case: &Case, outcome: &Outcome) -> (Vec<Kept>, Vec<Kept>) {
    let Some((scatter, _)) = scatter(job, Output::ToolLife) else { return (Vec::new(), Vec::new()) };
    let kept = |name, zone: &str, value: f64, limit: f64, beyond: f64| Kept {
        output: Output::ToolLife,
        name,
        zone: zone.to_owned(),
        value,
        limit,
        passed: normal_tail(beyond / scatter),
    };
    let lives = outcome.zones.iter().filter_map(|zone| {
        let (life, least) = (zone.tool_life_min?, case.limits.tool_life_min_min?);
        Some(kept("tool_life_min", &zone.id, life, least, (life / least).ln()))
    });
    // Life scatters from edge to edge: one that is to be used to U is worn out before with this probability.
    let edges = outcome
        .tool_changes
        .iter()
        .map(|change| kept("edge", &change.after_zone, change.tool_usage, 1.0, -change.tool_usage.ln()));
    (lives.collect(), edges.collect())
}

/// The worst place of every limit whose model states a scatter, where more pass it than the risk that is asked for, or, where
/// none is, than one in a hundred.
pub(super) fn warnings(job: &Job, case: &Case, outcome: &Outcome) -> Vec<Finding> {
    let part = of_part(job, case, outcome);
    let mut found = Vec::new();
    for OutputLimit { name, .. } in &OUTPUT_LIMITS {
        let least = job.risk.of_part().map_or(LEAST_SHARE, |risk| risk * (1.0 + SOLVED));
        found.extend(told("limit", least, part.iter().filter(|kept| kept.name == *name)));
    }
    let (lives, edges) = of_edges(job, case, outcome);
    let least = job.risk.of_edges().map_or(LEAST_SHARE, |risk| risk * (1.0 + SOLVED));
    found.extend(told("limit", least, lives.iter()));
    found.extend(told("edge", least, edges.iter()));
    found
}

/// Limited outputs whose models state no scatter, where a risk is asked for: their limits are not moved in.
pub(super) fn without(job: &Job, case: &Case) -> Vec<Finding> {
    let is_limited = |output: Output| {
        let of_output = OUTPUT_LIMITS.iter().filter(|limit| limit.output == output);
        let any = |limit: &OutputLimit| case.zones.iter().any(|zone| (limit.limit)(case, zone).is_some());
        job.risk.of_part().is_some() && of_output.into_iter().any(any)
    };
    let of_edges = job.risk.of_edges().is_some();
    let mut found = Vec::new();
    for output in Output::ALL {
        let is_asked = if output == Output::ToolLife { of_edges } else { is_limited(output) };
        if is_asked && job.models.get(output).is_some() && scatter(job, output).is_none() {
            let at = format!("/models/{}/residual_scatter", output.name());
            found.push(Finding::new("no_scatter_given", at).with("model", output.name()));
        }
    }
    found
}

/// Standard deviation of single results about an output's model, and whether of their logarithms.
pub(super) fn scatter(job: &Job, output: Output) -> Option<(f64, bool)> {
    let model = job.models.get(output)?;
    Some((model.residual_scatter.filter(|scatter| *scatter > 0.0)?, model.form == ModelForm::LogLog))
}

fn told<'k>(of: &'static str, least: f64, places: impl Iterator<Item = &'k Kept>) -> Option<Finding> {
    let worst = places.max_by(|a, b| a.passed.total_cmp(&b.passed)).filter(|worst| worst.passed > least)?;
    let unit = if of == "edge" { "1" } else { worst.output.unit() };
    Some(
        Finding::new("half_fail", format!("/models/{}/residual_scatter", worst.output.name()))
            .measured(worst.value, worst.limit, unit)
            .with("share", worst.passed)
            .with("model", worst.output.name())
            .with("of", of)
            .with("zone", worst.zone.clone()),
    )
}

/// With which probability the limits are kept; `None` where no model of a limited output states a scatter.
pub(super) fn conformance(job: &Job, case: &Case, outcome: &Outcome) -> Option<ScheduleConformance> {
    let part = of_part(job, case, outcome);
    let (lives, edges) = of_edges(job, case, outcome);
    let worst = |name: &'static str, among: &[Kept]| {
        let of_name = among.iter().filter(|kept| kept.name == name);
        of_name.max_by(|a, b| a.passed.total_cmp(&b.passed)).map(|kept| ScheduledLimitKept {
            limit: name.to_owned(),
            zone: kept.zone.clone(),
            probability: bounded(1.0 - kept.passed),
        })
    };
    let mut limits: Vec<ScheduledLimitKept> =
        OUTPUT_LIMITS.iter().filter_map(|limit| worst(limit.name, &part)).collect();
    limits.extend(worst("tool_life_min", &lives));
    limits.extend(worst("edge", &edges));
    if limits.is_empty() {
        return None;
    }
    limits.sort_by(|a, b| a.probability.total_cmp(&b.probability));
    let joint: f64 = part.iter().map(|kept| (-kept.passed).ln_1p()).sum();
    Some(ScheduleConformance {
        limits,
        joint_probability: (!part.is_empty()).then(|| bounded(joint.exp())),
        gain_percent_per_percent_of_risk: None,
        risk_percent: None,
    })
}

fn bounded(probability: f64) -> f64 {
    probability.clamp(LEAST, 1.0 - LEAST)
}

/// How many standard deviations lie between what is expected and a limit that is passed with this probability.
pub(super) fn deviations(risk: f64) -> f64 {
    -normal_quantile(risk)
}
