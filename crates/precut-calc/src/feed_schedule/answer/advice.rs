//! What binds, what would help, where not to trust: codes with numbers.

use crate::calculator::{Basis, Finding, Message};
use crate::machinability::{Conditions, MachinabilityModel, ModelForm};
use crate::turning::EDGE_MEETS_SHOULDER;

use crate::feed_schedule::answer::output::{ChangePlace, Looser, Outcome, Price, ZoneOutcome};
use crate::feed_schedule::answer::run::broken;
use crate::feed_schedule::answer::toolpath::Made;
use crate::feed_schedule::job::case::Case;
use crate::feed_schedule::job::input::{FeedMode, Goal, Job, SpeedMode};
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::of_fit;
use crate::feed_schedule::job::plan::Method;
use crate::feed_schedule::job::scatter;
use crate::feed_schedule::model::risk;

/// Codes of the warnings made here.
pub(in crate::feed_schedule) const WARNING_CODES: &[&str] = &[
    "outside_data_range",
    "tool_life_extrapolated",
    "zone_straddles_diameter_step",
    "thin_wall_local_deflection",
    "feed_below_edge_radius",
    "degenerate",
    "unused_input",
    "limit_not_kept",
    "local_optimum",
    "loss_not_reached",
    "compensation_needed",
    "unconfirmed_model",
    "plunge_at_shoulder",
    EDGE_MEETS_SHOULDER,
    "pass_thicker_than_counted",
    "surface_wears_out_its_edge",
    "shares_of_edges_priced",
    "half_fail",
    "no_scatter_given",
    "risk_at_its_end",
    "spindle_limit_binds",
    "tool_passes_support",
    "tool_reaches_support",
    "tool_hits_chuck",
    "no_program",
];

/// Codes of the explanations made here.
pub(in crate::feed_schedule) const EXPLANATION_CODES: &[&str] = &[
    "scheduled",
    "limits_kept",
    "limit_costs_most",
    "nothing_binds",
    "against_constant_feed",
    "against_equal_deflection",
    "edge_used",
    "whole_parts",
    "edge_changes",
    "batch_edges",
    "fewest_zones",
    "passes_found",
    "equal_deflection_clamped",
    "path_leaves",
    "optimum_within",
    "optimum_of_shares",
    "whole_edges_within",
    "rule_has_no_optimum",
];

/// What a percent of the risk takes off is not told below this, percent.
const LEAST_GAIN_PERCENT: f64 = 1e-4;
/// Tool lives that trials cover as a rule, min.
const USUAL_LIFE_MIN: (f64, f64) = (2.0, 240.0);
/// Wall over radius below which the shell yields locally.
const THIN_WALL: f64 = 0.1;
/// Feed below which the edge's radius rules the chip, mm/rev.
const LEAST_FEED_MM_PER_REV: f64 = 0.03;

/// All warnings.
pub(in crate::feed_schedule) fn warnings(
    job: &Job,
    case: &Case,
    outcome: &Outcome,
    at: &[(f64, f64)],
    made: Option<&Made>,
) -> Vec<Finding> {
    let mut out = Vec::new();
    ranges(job, case, outcome, &mut out);
    lives(outcome, &mut out);
    shapes(job, &mut out);
    let slow = outcome.zones.iter().filter(|zone| zone.feed_mm_per_rev < LEAST_FEED_MM_PER_REV);
    if let Some(zone) = slow.clone().min_by(|a, b| a.feed_mm_per_rev.total_cmp(&b.feed_mm_per_rev)) {
        out.push(
            Finding::new("feed_below_edge_radius", "/limits/feed_min_mm_per_rev")
                .measured(zone.feed_mm_per_rev, LEAST_FEED_MM_PER_REV, "mm/rev")
                .with("zones", slow.count()),
        );
    }
    if let Some(first) = outcome.binding.iter().find(|binding| binding.degenerate) {
        out.push(
            Finding::new("degenerate", "/limits")
                .with("constraint", first.constraint.clone())
                .with("zone", first.zone.clone()),
        );
    }
    unused(job, &mut out);
    out.extend(made.iter().flat_map(|made| made.encounters(job, outcome)));
    worn_out_inside(case, outcome, &mut out);
    out.extend(scatter::warnings(job, case, outcome));
    out.extend(scatter::without(job, case));
    let found = outcome.conformance.as_ref().and_then(|conformance| conformance.risk_percent);
    if let Some(percent) = found.filter(|percent| risk::is_at_an_end(*percent)) {
        out.push(Finding::new("risk_at_its_end", "/risk/scrap_cost").value(percent, "percent"));
    }
    if let (Some(whole), false) = (outcome.whole_edge_objective, is_of_whole_edges(job))
        && whole > 1.01 * outcome.objective
    {
        let found = Finding::new("shares_of_edges_priced", "/limits/whole_edges")
            .measured(whole, outcome.objective, job.objective.unit())
            .with("objective", job.objective.name())
            .with("edges", outcome.edges_per_part.unwrap_or(0.0));
        // Whole edges do not go together with a joint risk: they are not offered there.
        out.push(if job.risk.name() == "joint" { found.with("risk", "joint") } else { found });
    }
    if matches!(job.method, Method::EqualDeflection { .. }) {
        for (name, factor) in broken(case, at).into_iter().take(20) {
            out.push(
                Finding::new("limit_not_kept", "/method")
                    .with("constraint", name.constraint)
                    .with("zone", name.zone)
                    .with("factor", factor),
            );
        }
    }
    if outcome.certificate.local && !matches!(job.method, Method::EqualDeflection { .. }) {
        out.push(
            Finding::new("local_optimum", "/effects")
                .with("linearisations", f64::from(outcome.certificate.linearisations)),
        );
    }
    if let (Some(found), Method::Continuous { loss_percent, .. }) = (&outcome.continuous, &job.method)
        && !found.loss_reached
    {
        out.push(Finding::new("loss_not_reached", "/method/segments_max").measured(
            found.loss_percent,
            *loss_percent,
            "percent",
        ));
    }
    let kappa = job.limits.as_ref().map_or(1.0, |limits| limits.deflection_residual_fraction);
    if kappa < 1.0 && job.zones.iter().any(|zone| zone.deflection_max_um.is_some()) {
        out.push(Finding::new("compensation_needed", "/limits/deflection_residual_fraction").value(kappa, "1"));
    }
    out
}

/// Whether edges are counted in wholes by the job's own wish.
fn is_of_whole_edges(job: &Job) -> bool {
    job.limits.as_ref().is_some_and(|limits| limits.whole_parts_per_edge || limits.whole_edges)
}

/// Surfaces, and zones of none, inside which the tool has to be changed: they alone use more than an edge.
fn worn_out_inside(case: &Case, outcome: &Outcome, out: &mut Vec<Finding>) {
    let find = |id: &str| case.zones.iter().position(|zone| zone.id == id);
    let mut told: Vec<(usize, bool)> = Vec::new();
    for change in &outcome.tool_changes {
        let (Some(after), Some(before)) = (find(&change.after_zone), find(&change.before_zone)) else { continue };
        let (zone, other) = (&case.zones[before], &case.zones[after]);
        let same = zone.names_surface && other.names_surface && zone.surface == other.surface;
        let inside = match change.place {
            ChangePlace::InsideZone => true,
            ChangePlace::BetweenZones => same,
            ChangePlace::BetweenParts => false,
        };
        let of = if zone.names_surface { (zone.surface, true) } else { (before, false) };
        if !inside || told.contains(&of) || told.len() >= 20 {
            continue;
        }
        told.push(of);
        let is_of =
            |i: &usize| if of.1 { case.zones[*i].names_surface && case.zones[*i].surface == of.0 } else { *i == of.0 };
        let usage: f64 = (0..case.zones.len()).filter(is_of).filter_map(|i| outcome.zones[i].tool_usage).sum();
        let name = if of.1 { &case.surfaces[of.0] } else { &zone.id };
        out.push(
            Finding::new("surface_wears_out_its_edge", "/limits/tool_usage_max")
                .measured(usage, 1.0, "1")
                .with("surface", name.clone()),
        );
    }
}

/// Variables that leave the range of the trials behind a model, the worst zone of each.
fn ranges(job: &Job, case: &Case, outcome: &Outcome, out: &mut Vec<Finding>) {
    let named = Output::ALL.iter().filter_map(|output| {
        job.models.get(*output).map(|model| (format!("/models/{}", output.name()), output.name().to_owned(), model))
    });
    let further = job
        .models
        .further
        .iter()
        .enumerate()
        .map(|(k, further)| (format!("/models/further/{k}/model"), further.name.clone(), &further.model));
    let mut unsure = 0;
    for (pointer, name, model) in named.chain(further) {
        one_range(job, case, outcome, &pointer, &name, model, out);
        unsure += usize::from(model.certainty.is_some_and(crate::material::Certainty::needs_check));
    }
    if unsure > 0 {
        out.push(Finding::new("unconfirmed_model", "/models").with("models", unsure));
    }
}

fn one_range(
    job: &Job,
    case: &Case,
    outcome: &Outcome,
    pointer: &str,
    name: &str,
    model: &MachinabilityModel,
    out: &mut Vec<Finding>,
) {
    let mut worst: Vec<(crate::machinability::Variable, f64, f64, String)> = Vec::new();
    for (zone, given) in case.zones.iter().zip(&outcome.zones) {
        let at = Conditions {
            speed_m_per_min: given.speed_m_per_min,
            feed_mm_per_rev: given.feed_mm_per_rev,
            depth_mm: zone.depth_mm,
            cutting_edge_angle_deg: job.cutting_edge_angle_deg,
        };
        for (variable, value, end) in model.outside_range(&at) {
            let further = |(_, v, e, _): &(crate::machinability::Variable, f64, f64, String)| {
                (value / end).ln().abs() > (v / e).ln().abs()
            };
            match worst.iter_mut().find(|known| known.0 == variable) {
                Some(known) if further(known) => *known = (variable, value, end, given.id.clone()),
                Some(_) => {}
                None => worst.push((variable, value, end, given.id.clone())),
            }
        }
    }
    for (variable, value, end, zone) in worst {
        out.push(
            Finding::new("outside_data_range", pointer)
                .measured(value, end, variable.unit())
                .with("variable", variable.field())
                .with("model", name.to_owned())
                .with("zone", zone),
        );
    }
}

fn lives(outcome: &Outcome, out: &mut Vec<Finding>) {
    let (least, most) = USUAL_LIFE_MIN;
    let far = |life: f64| if life < least { least / life } else { life / most };
    let worst = outcome
        .zones
        .iter()
        .filter_map(|zone| zone.tool_life_min.map(|life| (zone, life)))
        .filter(|(_, life)| *life < least || *life > most)
        .max_by(|a, b| far(a.1).total_cmp(&far(b.1)));
    if let Some((zone, life)) = worst {
        let limit = if life < least { least } else { most };
        out.push(
            Finding::new("tool_life_extrapolated", "/models/tool_life")
                .measured(life, limit, "min")
                .with("zone", zone.id.clone()),
        );
    }
}

/// Zones over a diameter step, and walls so thin that the beam is not all that yields.
fn shapes(job: &Job, out: &mut Vec<Finding>) {
    let Some(shaft) = &job.shaft else { return };
    for (i, zone) in job.zones.iter().enumerate() {
        let mut left = 0.0;
        let mut diameters: Vec<f64> = Vec::new();
        let mut thinnest: Option<f64> = None;
        for segment in &shaft.segments {
            let right = left + segment.length_mm;
            if right > zone.z_start_mm + 1e-6 && left < zone.z_end_mm - 1e-6 {
                diameters.push(segment.diameter_mm);
                if segment.bore_diameter_mm > 0.0 {
                    let ratio = (segment.diameter_mm - segment.bore_diameter_mm) / segment.diameter_mm;
                    thinnest = Some(thinnest.map_or(ratio, |least: f64| least.min(ratio)));
                }
            }
            left = right;
        }
        if diameters.windows(2).any(|pair| (pair[1] - pair[0]).abs() > 1e-9) {
            out.push(Finding::new("zone_straddles_diameter_step", format!("/zones/{i}")).with("zone", zone.id.clone()));
        }
        if let Some(ratio) = thinnest.filter(|ratio| *ratio < THIN_WALL)
            && zone.compliance_um_per_n.is_none()
        {
            out.push(
                Finding::new("thin_wall_local_deflection", format!("/zones/{i}/compliance_um_per_n"))
                    .measured(ratio, THIN_WALL, "1")
                    .with("zone", zone.id.clone()),
            );
        }
    }
}

/// Inputs that change nothing.
fn unused(job: &Job, out: &mut Vec<Finding>) {
    let mut idle = |condition: bool, pointer: &str| {
        if condition {
            out.push(Finding::new("unused_input", pointer));
        }
    };
    idle(job.shaft.is_none() && !job.supports.is_empty(), "/supports");
    idle(job.force.as_ref().is_some_and(|force| job.models.ignore(force)), "/force");
    idle(
        job.variables.fixed_feed_mm_per_rev.is_some() && job.variables.feed != FeedMode::Fixed,
        "/variables/fixed_feed_mm_per_rev",
    );
    idle(
        job.variables.fixed_speed_m_per_min.is_some() && job.variables.speed != SpeedMode::Fixed,
        "/variables/fixed_speed_m_per_min",
    );
    let is_rule = matches!(job.method, Method::EqualDeflection { .. });
    idle(is_rule && job.variables.feed != FeedMode::PerZone, "/variables/feed");
    let of_speed = matches!(job.variables.speed, SpeedMode::ConstantRpm | SpeedMode::Fixed);
    idle(is_rule && of_speed, "/variables/speed");
    let limits = job.limits.as_ref();
    idle(
        limits.is_some_and(|limits| limits.feed_step_ratio_max.is_some()) && job.zones.len() < 2,
        "/limits/feed_step_ratio_max",
    );
}

/// How probably the limits are kept, where that is known.
fn limits_kept(job: &Job, outcome: &Outcome) -> Option<Message> {
    let conformance = outcome.conformance.as_ref()?;
    let worst = conformance.limits.first()?;
    let mut said = Message::new("limits_kept")
        .with("limit", worst.limit.clone())
        .with("zone", worst.zone.clone())
        .with("percent", 100.0 * worst.probability)
        .with("risk", job.risk.name());
    if let Some(joint) = conformance.joint_probability {
        said = said.with("joint_percent", 100.0 * joint);
    }
    if job.uncertainty.is_open() {
        said = said.with("open", "yes");
        let replaced: Vec<&str> = of_fit::replaced(job).into_iter().map(Output::name).collect();
        if !replaced.is_empty() {
            said = said.with("replaced", replaced);
        }
    }
    if let Some(found) = conformance.risk_percent.filter(|found| !risk::is_at_an_end(*found)) {
        said = said.with("found_percent", found);
    }
    if let Some(gain) = conformance.gain_percent_per_percent_of_risk.filter(|gain| *gain > LEAST_GAIN_PERCENT) {
        said = said.with("gain_percent", gain).with("objective", job.objective.name());
    }
    Some(said)
}

/// What is to be said of the answer, the most important first.
pub(in crate::feed_schedule) fn explanation(job: &Job, outcome: &Outcome) -> Vec<Message> {
    let mut out = vec![scheduled(outcome)];
    out.extend(limits_kept(job, outcome));
    out.extend(costliest(job, outcome));
    if let Some(constant) = &outcome.comparison.constant_feed {
        out.push(
            Message::new("against_constant_feed")
                .with("feed_mm_per_rev", constant.feed_mm_per_rev)
                .with("constant_min", constant.cutting_time_min)
                .with("time_min", outcome.cutting_time_min)
                .with("saved_percent", constant.time_saved_percent),
        );
    }
    if let Some(rule) = &outcome.comparison.equal_deflection {
        let least = rule.rule_feed_mm_per_rev.iter().copied().fold(f64::INFINITY, f64::min);
        out.push(
            Message::new("against_equal_deflection")
                .with("least_feed_mm_per_rev", least)
                .with("clamped", rule.clamped.len())
                .with("rule_min", rule.cutting_time_min)
                .with("time_min", outcome.cutting_time_min),
        );
    }
    if let Some(rule) = &outcome.equal_deflection {
        out.push(
            Message::new("equal_deflection_clamped")
                .with("clamped", rule.clamped.len())
                .with("zones", outcome.zones.len())
                .with("before_um", rule.largest_before_um)
                .with("after_um", rule.largest_deflection_um)
                .with("before_min", rule.cutting_time_before_min)
                .with("after_min", rule.cutting_time_min),
        );
    }
    if let (Some(usage), None) = (outcome.tool_usage, outcome.parts_per_edge) {
        out.push(Message::new("edge_used").with("usage", usage));
    }
    if let (Some(parts), Some(usage)) = (outcome.parts_per_edge, outcome.tool_usage) {
        out.push(Message::new("whole_parts").with("parts", f64::from(parts)).with("usage", usage));
    }
    if let Some(edges) = outcome.edges_per_part.filter(|edges| *edges > 1.0) {
        let inside = outcome.tool_changes.iter().filter(|change| change.place == ChangePlace::InsideZone).count();
        out.push(Message::new("edge_changes").with("edges", edges).with("inside", inside));
    }
    out.extend(batch(job, outcome));
    if let Some(found) = &outcome.continuous {
        out.push(
            Message::new("fewest_zones")
                .with("segments", f64::from(found.segments))
                .with("loss_percent", found.loss_percent)
                .with("continuous_min", found.cutting_time_min),
        );
    }
    if let Some(passes) = &outcome.passes {
        out.push(
            Message::new("passes_found")
                .with("roughing", f64::from(passes.roughing_passes))
                .with("finishing_mm", passes.finishing_depth_mm),
        );
    }
    if let Some(path) = &outcome.compensated_path {
        out.push(
            Message::new("path_leaves")
                .with("before_um", path.largest_uncompensated_um)
                .with("after_um", path.largest_compensated_um),
        );
    }
    out.push(certified(job, outcome));
    out
}

/// What was asked for: the time, the feeds and the speeds.
fn scheduled(outcome: &Outcome) -> Message {
    let over = |of: fn(&ZoneOutcome) -> f64| {
        let values = || outcome.zones.iter().map(of);
        (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max))
    };
    let (least_feed, most_feed) = over(|zone| zone.feed_mm_per_rev);
    let (least_speed, most_speed) = over(|zone| zone.speed_m_per_min);
    Message::new("scheduled")
        .with("time_min", outcome.cutting_time_min)
        .with("least_feed_mm_per_rev", least_feed)
        .with("most_feed_mm_per_rev", most_feed)
        .with("least_speed_m_per_min", least_speed)
        .with("most_speed_m_per_min", most_speed)
}

/// What a batch takes of edges that serve one or more whole parts.
fn batch(job: &Job, outcome: &Outcome) -> Option<Message> {
    let parts = f64::from(job.limits.as_ref()?.batch_parts?);
    let per_part = outcome.edges_per_part.filter(|edges| *edges <= 1.0)?;
    let after = outcome.tool_changes.last()?;
    let edges = (per_part * parts).round();
    Some(
        Message::new("batch_edges")
            .with("parts", parts)
            .with("edges", edges)
            .with("every", f64::from(after.every_parts)),
    )
}

/// The limit that costs most, or that none binds.
fn costliest(job: &Job, outcome: &Outcome) -> Option<Message> {
    // What the objective is measured by is no limit that binds, though it has its price.
    let measures = |price: &Price| {
        let mut binding = outcome.binding.iter();
        price.constraint == job.objective.name()
            && !binding.any(|bound| bound.constraint == price.constraint && bound.zone == price.zone)
    };
    let prices: Vec<&Price> = outcome.prices.iter().filter(|price| !measures(price)).collect();
    let Some((first, gain_percent)) = prices.iter().find_map(|price| Some((price, price.gain_percent?))) else {
        let nothing = outcome.equal_deflection.is_none() && outcome.binding.is_empty();
        return nothing.then(|| Message::new("nothing_binds"));
    };
    let percent = if matches!(job.objective, Goal::Hardening {}) { "percentage points" } else { "percent" };
    Some(
        Message::new("limit_costs_most")
            .with("looser", if first.looser == Looser::Less { "less" } else { "more" })
            .with("constraint", first.constraint.clone())
            .with("zone", first.zone.clone())
            .with("gain_percent", gain_percent)
            .with("gain_unit", percent)
            .with("objective", job.objective.name())
            .with("others", prices.len() - 1),
    )
}

/// How near the optimum the answer is known to be, and what of.
fn certified(job: &Job, outcome: &Outcome) -> Message {
    if outcome.equal_deflection.is_some() {
        return Message::new("rule_has_no_optimum");
    }
    if let Some(bound) = outcome.certificate.lower_bound {
        return Message::new("whole_edges_within")
            .with("objective", outcome.objective)
            .with("bound", bound)
            .with("unit", job.objective.unit())
            .with("gap_percent", 100.0 * (1.0 - bound / outcome.objective).max(0.0));
    }
    // A semi-log objective is minimised as it stands.
    let plain = matches!(job.objective, Goal::Hardening {})
        && job.models.get(Output::Hardening).is_some_and(|model| model.form == ModelForm::SemiLog);
    let shares = outcome
        .whole_edge_objective
        .filter(|whole| !is_of_whole_edges(job) && (whole - outcome.objective).abs() > 1e-6 * outcome.objective.abs());
    Message::new(if shares.is_some() { "optimum_of_shares" } else { "optimum_within" })
        .with("whole", shares.unwrap_or(outcome.objective))
        .with("unit", job.objective.unit())
        .with("gap", outcome.certificate.duality_gap.max(1e-16))
        .with("gap_of", if plain { "objective" } else { "logarithm" })
        .with("iterations", f64::from(outcome.certificate.iterations))
}

/// The equations that acted.
pub(in crate::feed_schedule) fn basis(job: &Job) -> Vec<Basis> {
    let mut used = vec![
        Basis { equation: "feed/2.1", source: "machinability models of the job" },
        Basis { equation: "feed/6.1", source: "geometric program in ln V, ln S" },
        Basis {
            equation: "feed/6.3",
            source: "primal-dual interior-point method (Mehrotra), optimality by its multipliers",
        },
    ];
    if job.shaft.is_some() {
        used.push(Basis { equation: "feed/3.1", source: "beam of the deflection calculator" });
    }
    match job.method {
        Method::EqualDeflection { .. } => {
            used.push(Basis { equation: "feed/4.1", source: "turning of gas-turbine shafts of variable stiffness" });
        }
        Method::Continuous { .. } => {
            used.push(Basis { equation: "feed/8.3", source: "dynamic programming over the grid" });
        }
        Method::Optimal => {}
    }
    if job.passes.is_some() {
        used.push(Basis { equation: "feed/7.1", source: "enumeration of passes" });
    }
    if job.compensation.is_some() {
        used.push(Basis { equation: "feed/9.1", source: "deflection calculator" });
    }
    used.extend(
        job.effects.iter().map(|effect| Basis { equation: effect.cause().equation, source: "catalogue of effects" }),
    );
    used
}
