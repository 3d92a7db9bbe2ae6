//! Rules between fields. What one field alone may hold stands in its schema.

use crate::calculator::{Check, Finding, Violations};
use crate::certainty::open;
use crate::machinability::{self, CoefficientCovariance, MachinabilityModel, ModelCoefficient, ModelForm};
use crate::shaft::{self, Support};

use crate::feed_schedule::job::case::TOUCHING_MM;
use crate::feed_schedule::job::effects;
use crate::feed_schedule::job::input::{FeedMode, Goal, Job, Limits, SpeedMode, UsageScope, Zone};
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::plan::{Method, PassPlan};
use crate::feed_schedule::model::risk;

/// Codes of the faults found here.
pub(in crate::feed_schedule) const CODES: &[&str] = &[
    "one_sided_rest",
    "limits_missing",
    "bad_zone",
    "zones_overlap",
    "zone_outside_shaft",
    "duplicate_zone",
    "contradictory_limits",
    "model_missing",
    "compliance_missing",
    "model_not_convex",
    "edge_angle_missing",
    "unknown_model_set",
    "duplicate_model_output",
    "fixed_value_missing",
    "whole_parts_per_surface",
    "usage_above_an_edge",
    "nothing_to_minimise",
    "limit_without_bound",
    "unknown_zone",
    "unknown_output",
    "force_not_a_power_law",
    "bad_pass_depths",
    "method_not_together",
    "absurd_exponent",
    "bad_covariance",
    "bad_diameter",
    "negative_compliance",
];

/// An eigenvalue of a covariance below 0 by no more than this share of the largest is round-off of what was printed.
const ROUNDED: f64 = 1e-6;

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        check_shaft(self, violations);
        check_models(self, violations);
        effects::check(self, violations);
        open::check(&self.effects, &self.uncertainty.effects, violations);
        if let Some(force) = &self.force {
            force.check("/force", violations);
        }
        // Without zones the job is a set of models for a diagnosis; a schedule of it is refused when it is asked for.
        if self.zones.is_empty() {
            return;
        }
        check_zones(self, violations);
        match &self.limits {
            Some(limits) => check_limits(self, limits, violations),
            None => violations.add(Finding::new("limits_missing", "/limits")),
        }
        check_needs(self, violations);
        check_named(self, violations);
        check_method(self, violations);
        risk::check(self, violations);
    }
}

fn check_shaft(job: &Job, violations: &mut Violations) {
    let Some(shaft) = &job.shaft else { return };
    shaft::check::shaft(shaft, violations);
    shaft::check::supports(shaft, &job.supports, violations);
    for (i, support) in job.supports.iter().enumerate() {
        let one_sided = matches!(
            support,
            Support::SteadyRest { one_sided: true, .. } | Support::FollowRest { one_sided: true, .. }
        );
        violations.require(!one_sided, || Finding::new("one_sided_rest", format!("/supports/{i}")).with("rest", i));
    }
}

fn check_models(job: &Job, violations: &mut Violations) {
    if let Some(id) = &job.models.library {
        violations.require(machinability::find_set(id).is_some(), || {
            let known: Vec<&'static str> = machinability::sets().iter().map(|set| set.id).collect();
            Finding::new("unknown_model_set", "/models/library").with("id", id.clone()).with("known", known)
        });
    }
    for output in Output::ALL {
        let Some(model) = job.models.acting(output, job.force.as_ref()) else { continue };
        let at = format!("/models/{}", output.name());
        check_model(job, &model, &at, violations);
        violations.require(!output.is_power_law() || model.form == ModelForm::LogLog, || {
            Finding::new("model_not_convex", at.clone()).with("output", output.name()).with("reason", "semi_log")
        });
    }
    let mut names: Vec<&str> = Output::ALL.iter().map(|output| output.name()).collect();
    for (k, further) in job.models.further.iter().enumerate() {
        check_model(job, &further.model, &format!("/models/further/{k}/model"), violations);
        violations.require(!names.contains(&further.name.as_str()), || {
            Finding::new("duplicate_model_output", format!("/models/further/{k}/name"))
                .with("name", further.name.clone())
        });
        names.push(&further.name);
    }
}

fn check_model(job: &Job, model: &MachinabilityModel, at: &str, violations: &mut Violations) {
    violations.require(!model.needs_angle() || job.cutting_edge_angle_deg.is_some(), || {
        Finding::new("edge_angle_missing", "/cutting_edge_angle_deg").with("model", at.to_owned())
    });
    if let Some(covariance) = &model.coefficient_covariance {
        check_covariance(job, covariance, &format!("{at}/coefficient_covariance"), violations);
    }
}

/// A covariance has a row and a column for every coefficient, is symmetric, and lets no combination of them vary by less than
/// nothing.
fn check_covariance(job: &Job, covariance: &CoefficientCovariance, at: &str, violations: &mut Violations) {
    let order = &covariance.order;
    let is_named_once = order.iter().enumerate().all(|(i, one)| !order[..i].contains(one));
    violations.require(is_named_once, || {
        Finding::new("bad_covariance", format!("{at}/order")).with("reason", "order").with("count", order.len())
    });
    let has_angle = order.contains(&ModelCoefficient::AngleExponent);
    violations.require(!has_angle || job.cutting_edge_angle_deg.is_some(), || {
        Finding::new("edge_angle_missing", "/cutting_edge_angle_deg").with("model", at.to_owned())
    });
    let bad = |reason: &'static str| {
        Finding::new("bad_covariance", format!("{at}/matrix")).with("reason", reason).with("count", order.len())
    };
    let Some(matrix) = covariance.as_matrix() else {
        violations.add(bad("symmetric"));
        return;
    };
    let eigenvalues = matrix.symmetric_eigenvalues();
    let (least, largest) = (eigenvalues.min(), eigenvalues.max());
    violations.require(least >= -ROUNDED * largest.abs(), || bad("negative").with("least", least));
}

fn check_zones(job: &Job, violations: &mut Violations) {
    // Beside a shaft of no possible length stands nothing.
    let length = job.shaft.as_ref().and_then(shaft::Shaft::known_length_mm).unwrap_or(f64::INFINITY);
    let mut seen: Vec<&str> = Vec::new();
    let mut before: Option<&Zone> = None;
    for (i, zone) in job.zones.iter().enumerate() {
        let at = format!("/zones/{i}");
        violations.require(!seen.contains(&zone.id.as_str()), || {
            Finding::new("duplicate_zone", format!("{at}/id")).with("zone", zone.id.clone())
        });
        seen.push(&zone.id);
        // Where a zone lies at no possible place nobody knows what it overlaps.
        if !zone.has_place() {
            before = None;
            continue;
        }
        violations.require(zone.z_end_mm > zone.z_start_mm, || {
            Finding::new("bad_zone", at.clone())
                .measured(zone.z_end_mm, zone.z_start_mm, "mm")
                .with("zone", zone.id.clone())
        });
        if let Some(before) = before {
            violations.require(zone.z_start_mm >= before.z_end_mm - TOUCHING_MM, || {
                Finding::new("zones_overlap", at.clone())
                    .measured(zone.z_start_mm, before.z_end_mm, "mm")
                    .with("zone", zone.id.clone())
                    .with("other", before.id.clone())
            });
        }
        violations.require(zone.z_end_mm <= length + TOUCHING_MM, || {
            Finding::new("zone_outside_shaft", at.clone())
                .measured(zone.z_end_mm, length, "mm")
                .with("zone", zone.id.clone())
        });
        before = Some(zone);
    }
}

fn check_limits(job: &Job, limits: &Limits, violations: &mut Violations) {
    let mut order = |low: f64, high: f64, at: &str, unit: &'static str| {
        violations
            .require(low <= high, || Finding::new("contradictory_limits", at.to_owned()).measured(low, high, unit));
    };
    order(limits.feed_min_mm_per_rev, limits.feed_max_mm_per_rev, "/limits/feed_min_mm_per_rev", "mm/rev");
    order(limits.speed_min_m_per_min, limits.speed_max_m_per_min, "/limits/speed_min_m_per_min", "m/min");
    if let (Some(low), Some(high)) = (job.machine.spindle_speed_min_rpm, job.machine.spindle_speed_max_rpm) {
        order(low, high, "/machine/spindle_speed_min_rpm", "rev/min");
    }
    for (i, zone) in job.zones.iter().enumerate() {
        if let Some(own) = zone.feed_max_mm_per_rev {
            order(limits.feed_min_mm_per_rev, own, &format!("/zones/{i}/feed_max_mm_per_rev"), "mm/rev");
        }
    }
    violations.require(!(limits.whole_edges && limits.whole_parts_per_edge), || {
        Finding::new("method_not_together", "/limits/whole_edges").with("other", "whole parts per edge")
    });
    violations.require(!(limits.batch_parts.is_some() && limits.whole_parts_per_edge), || {
        Finding::new("method_not_together", "/limits/batch_parts").with("other", "whole parts per edge")
    });
    let share = limits.tool_usage_max.filter(|share| limits.whole_edges && *share > 1.0);
    violations.require(share.is_none(), || {
        Finding::new("usage_above_an_edge", "/limits/tool_usage_max").measured(share.unwrap_or(1.0), 1.0, "1")
    });
    violations.require(!(limits.whole_parts_per_edge && limits.tool_usage_scope == UsageScope::Surface), || {
        Finding::new("whole_parts_per_surface", "/limits/whole_parts_per_edge")
    });
}

/// Every limit and objective has the models that it needs.
fn check_needs(job: &Job, violations: &mut Violations) {
    let mut missing: Vec<(Output, &'static str)> = Vec::new();
    let mut need = |wanted: bool, output: Output, by: &'static str| {
        if wanted && !job.models.has(output, job.force.as_ref()) && !missing.iter().any(|(known, _)| *known == output) {
            missing.push((output, by));
        }
    };
    let any = |has: fn(&Zone) -> bool| job.zones.iter().any(has);
    need(any(|zone| zone.deflection_max_um.is_some()), Output::ForceY, "deflection_max_um");
    need(any(|zone| zone.roughness_max_um.is_some()), Output::Roughness, "roughness_max_um");
    need(any(|zone| zone.hardening_max_percent.is_some()), Output::Hardening, "hardening_max_percent");
    need(any(|zone| zone.hardening_depth_max_um.is_some()), Output::HardeningDepth, "hardening_depth_max_um");
    need(job.machine.power_kw.is_some(), Output::ForceZ, "power_kw");
    need(job.machine.torque_n_m.is_some(), Output::ForceZ, "torque_n_m");
    need(matches!(job.method, Method::EqualDeflection { .. }), Output::ForceY, "equal_deflection");
    need(job.compensation.is_some(), Output::ForceY, "compensation");
    if let Some(limits) = &job.limits {
        need(limits.force_z_max_n.is_some(), Output::ForceZ, "force_z_max_n");
        need(limits.force_y_max_n.is_some(), Output::ForceY, "force_y_max_n");
        need(limits.tool_usage_max.is_some(), Output::ToolLife, "tool_usage_max");
        need(limits.whole_parts_per_edge, Output::ToolLife, "whole_parts_per_edge");
        need(limits.whole_edges, Output::ToolLife, "whole_edges");
        need(limits.batch_parts.is_some(), Output::ToolLife, "batch_parts");
        need(limits.tool_life_min_min.is_some(), Output::ToolLife, "tool_life_min_min");
        need(limits.deflection_spread_ratio_max.is_some(), Output::ForceY, "deflection_spread_ratio_max");
    }
    match &job.objective {
        Goal::Time { tool_change_time_min, .. } => {
            need(*tool_change_time_min > 0.0, Output::ToolLife, "tool_change_time_min");
        }
        Goal::Cost { tool_change_time_min, edge_cost, .. } => {
            need(*tool_change_time_min > 0.0 || *edge_cost > 0.0, Output::ToolLife, "edge_cost");
            need(job.risk.cost_per_edge() > 0.0, Output::ToolLife, "edge_failure_cost");
        }
        Goal::Deflection {} => need(true, Output::ForceY, "objective"),
        Goal::Roughness {} => need(true, Output::Roughness, "objective"),
        Goal::Hardening {} => need(true, Output::Hardening, "objective"),
    }
    for (output, by) in missing {
        let forced = matches!(output, Output::ForceY | Output::ForceZ) && job.force.is_some();
        let finding = if forced {
            Finding::new("force_not_a_power_law", "/force").with("output", output.name())
        } else {
            Finding::new("model_missing", format!("/models/{}", output.name()))
        };
        violations.add(finding.with("needed_by", by).with("model", output.name()));
    }
    check_compliance(job, violations);
    let has_limit = match job.objective {
        Goal::Deflection {} => any(|zone| zone.deflection_max_um.is_some()),
        Goal::Roughness {} => any(|zone| zone.roughness_max_um.is_some()),
        _ => true,
    };
    violations.require(has_limit, || {
        Finding::new("nothing_to_minimise", "/objective").with("objective", job.objective.name())
    });
}

fn check_compliance(job: &Job, violations: &mut Violations) {
    let spread = job.limits.as_ref().is_some_and(|limits| limits.deflection_spread_ratio_max.is_some());
    let all = spread || job.compensation.is_some() || matches!(job.method, Method::EqualDeflection { .. });
    let wanting = job
        .zones
        .iter()
        .position(|zone| (all || zone.deflection_max_um.is_some()) && zone.compliance_um_per_n.is_none());
    let continuous = matches!(job.method, Method::Continuous { .. }) && job.compensation.is_some();
    if let (Some(i), None) = (wanting, &job.shaft) {
        violations.add(Finding::new("compliance_missing", "/shaft").with("zone", job.zones[i].id.clone()));
    } else if job.compensation.is_some() || continuous {
        violations.require(job.shaft.is_some(), || {
            Finding::new("compliance_missing", "/shaft").with("zone", job.zones[0].id.clone())
        });
    }
}

/// Customs, couplings and fixed values name what exists.
fn check_named(job: &Job, violations: &mut Violations) {
    let known = |name: &str| {
        let bare = name.strip_suffix(":rough").or_else(|| name.strip_suffix(":finish"));
        job.zones.iter().any(|zone| zone.id == name)
            || (job.passes.is_some() && bare.is_some_and(|bare| job.zones.iter().any(|zone| zone.id == bare)))
    };
    for (k, custom) in job.custom.iter().enumerate() {
        let at = format!("/custom/{k}");
        violations.require(custom.min.is_some() || custom.max.is_some(), || {
            Finding::new("limit_without_bound", at.clone()).with("name", custom.name.clone())
        });
        if let (Some(low), Some(high)) = (custom.min, custom.max) {
            violations.require(low <= high, || {
                Finding::new("contradictory_limits", format!("{at}/min")).measured(low, high, "1")
            });
        }
        violations.require(custom.zone == "all" || known(&custom.zone), || {
            Finding::new("unknown_zone", format!("{at}/zone")).with("zone", custom.zone.clone())
        });
        let Some(output) = &custom.output else { continue };
        let found = job.models.further.iter().find(|further| &further.name == output);
        let of_library = job
            .models
            .library
            .as_deref()
            .and_then(machinability::find_set)
            .and_then(|set| set.models.iter().find(|model| model.output == output));
        let form = found.map(|further| further.model.form).or(of_library.map(|model| model.form));
        match form {
            None => {
                violations.add(Finding::new("unknown_output", format!("{at}/output")).with("output", output.clone()));
            }
            Some(ModelForm::SemiLog) => {
                let plain = custom.constant == 0.0
                    && custom.speed_exponent == 0.0
                    && custom.feed_exponent == 0.0
                    && custom.depth_exponent == 0.0;
                violations.require(plain, || {
                    Finding::new("model_not_convex", at.clone())
                        .with("output", output.clone())
                        .with("reason", "product")
                });
            }
            Some(ModelForm::LogLog) => {}
        }
    }
    for (k, coupling) in job.couplings.iter().enumerate() {
        for (t, term) in coupling.terms.iter().enumerate() {
            violations.require(known(&term.zone), || {
                Finding::new("unknown_zone", format!("/couplings/{k}/terms/{t}/zone")).with("zone", term.zone.clone())
            });
        }
    }
    let v = &job.variables;
    violations.require(v.feed != FeedMode::Fixed || v.fixed_feed_mm_per_rev.is_some(), || {
        Finding::new("fixed_value_missing", "/variables/fixed_feed_mm_per_rev")
    });
    violations.require(v.speed != SpeedMode::Fixed || v.fixed_speed_m_per_min.is_some(), || {
        Finding::new("fixed_value_missing", "/variables/fixed_speed_m_per_min")
    });
}

fn check_method(job: &Job, violations: &mut Violations) {
    let together = |other: &'static str| Finding::new("method_not_together", "/method").with("other", other);
    if let Some(plan) = &job.passes {
        check_passes(plan, violations);
        violations.require(job.method == Method::Optimal, || together("passes"));
        violations.require(job.compensation.is_none(), || together("passes and compensation"));
        violations
            .require(job.zones.iter().all(|zone| zone.repeat == 1), || together("passes and a zone's own repeat"));
    }
    // What is left by the first of several passes is not what the next one is to correct.
    let repeats = job.zones.iter().any(|zone| zone.repeat > 1);
    violations.require(!(repeats && job.compensation.is_some()), || together("compensation and a zone's repeat"));
    // The path follows the beam of shaft and supports: it would correct something else than what the schedule counts.
    let stated = job.zones.iter().any(|zone| zone.compliance_um_per_n.is_some());
    violations
        .require(!(stated && job.compensation.is_some()), || together("compensation and a zone's own compliance"));
    if matches!(job.method, Method::Continuous { .. }) {
        violations.require(matches!(job.objective, Goal::Time { .. }), || together("another objective than time"));
        violations.require(job.variables.feed == FeedMode::PerZone, || together("a common feed"));
        violations
            .require(job.custom.iter().all(|custom| custom.zone == "all"), || together("custom limits of one zone"));
        violations.require(job.couplings.is_empty(), || together("couplings"));
        let whole = job.limits.as_ref().is_some_and(|limits| limits.whole_parts_per_edge);
        violations.require(!whole, || together("whole parts per edge"));
        let whole = job.limits.as_ref().is_some_and(|limits| limits.whole_edges);
        violations.require(!whole, || together("whole edges"));
    }
}

/// The depths and the number of passes leave at least one split of the stock.
fn check_passes(plan: &PassPlan, violations: &mut Violations) {
    let fault = |field: &str, value: f64, limit: f64| {
        Finding::new("bad_pass_depths", format!("/passes/{field}")).measured(value, limit, "mm")
    };
    if plan.depth_min_mm > plan.depth_max_mm {
        let fault = fault("depth_min_mm", plan.depth_min_mm, plan.depth_max_mm);
        violations.add(fault.with("maximum", plan.depth_max_mm));
        return;
    }
    let (thinnest, thickest) = plan.finishing_mm();
    if thinnest > thickest {
        let named = plan.finishing_depth_min_mm.is_some();
        let (field, value, limit) = if named {
            ("finishing_depth_min_mm", thinnest, thickest)
        } else {
            ("finishing_depth_max_mm", thickest, thinnest)
        };
        let fault = fault(field, value, limit);
        violations.add(if named { fault.with("maximum", limit) } else { fault.with("minimum", limit) });
        return;
    }
    let total = plan.total_depth_mm;
    let most = plan.depth_max_mm * f64::from(plan.roughing_passes_max) + thickest;
    let limit = if total < thinnest { thinnest } else { most };
    violations.require(total >= thinnest && total <= most * (1.0 + 1e-12), || {
        fault("total_depth_mm", total, limit).within(thinnest, most)
    });
}
