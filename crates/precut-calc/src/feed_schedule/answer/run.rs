//! From a job to its answer.

use std::borrow::Cow;
use std::collections::HashMap;

use crate::calculator::{Answer, Failure, Finding, Message, Monitor, checkpoint};

use crate::feed_schedule::answer::advice;
use crate::feed_schedule::answer::output::{
    Certificate, Comparison, ConstantFeed, Continuous, EqualDeflection, Outcome, PassesOutcome, Solver, TradePoint,
    ZoneOutcome,
};
use crate::feed_schedule::answer::toolpath::Made;
use crate::feed_schedule::job::case::{Case, PassSplit};
use crate::feed_schedule::job::compliance::Held;
use crate::feed_schedule::job::input::{FeedMode, Goal, Job};
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::plan::{Method, TradeOff, TradedLimit};
use crate::feed_schedule::job::scatter;
use crate::feed_schedule::model::assess;
use crate::feed_schedule::model::binding::binding;
use crate::feed_schedule::model::compensated;
use crate::feed_schedule::model::continuous::{self, Asked, Smooth};
use crate::feed_schedule::model::edges;
use crate::feed_schedule::model::passes;
use crate::feed_schedule::model::prices::{self, Again};
use crate::feed_schedule::model::program::{Rates, Variation, build};
use crate::feed_schedule::model::refusal::worded;
use crate::feed_schedule::model::risk;
use crate::feed_schedule::model::rule::{self, Target};
use crate::feed_schedule::model::solve::{Solved, Unsolved, solve};

/// What the chosen method gave.
struct Found {
    case: Case,
    solved: Option<Solved>,
    at: Vec<(f64, f64)>,
    rule: Option<EqualDeflection>,
    continuous: Option<Continuous>,
    smooth: Option<Smooth>,
    passes: Option<PassesOutcome>,
    /// What a percent of the risk asked for is worth, percent.
    worth_of_risk: Option<f64>,
}

/// The answer of a checked and filled job.
pub(in crate::feed_schedule) fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
    checkpoint(monitor)?;
    if job.zones.is_empty() {
        return Err(Failure::OutOfModel(Finding::new("no_zones", "/zones")));
    }
    let held = Held::of(job)?;
    let is_wanted = |unsolved| worded(unsolved, job);
    let acting = risk::acting(job, held.as_ref(), monitor).map_err(is_wanted)?;
    let is_found = matches!(acting, Cow::Owned(_));
    let job: &Job = &acting;
    let found = by_method(job, held.as_ref(), monitor).map_err(|unsolved| worded(unsolved, job))?;
    monitor.progress(0.7, Message::new("stage_comparison"));
    let zones: Vec<ZoneOutcome> =
        found.at.iter().enumerate().map(|(i, &at)| assess::zone_outcome(&found.case, job, i, at)).collect();
    if !in_reach(&zones) {
        return Err(Failure::OutOfModel(Finding::new("schedule_out_of_reach", "/models")));
    }
    let mut outcome = outcome(job, &found, zones);
    edges::recount(&found.case, &mut outcome);
    outcome.conformance = scatter::conformance(job, &found.case, &outcome)?;
    if let Some(conformance) = &mut outcome.conformance {
        conformance.gain_percent_per_percent_of_risk = found.worth_of_risk;
        conformance.risk_percent = job.risk.of_part().filter(|_| is_found).map(|risk| 100.0 * risk);
    }
    if let Some(solved) = &found.solved {
        let split = found.passes.as_ref().map(|passes| PassSplit {
            roughing_passes: passes.roughing_passes,
            roughing_mm: passes.roughing_depth_mm.unwrap_or(0.0),
            finishing_mm: passes.finishing_depth_mm,
        });
        let again = Again { job, held: held.as_ref(), split, is_possible: found.continuous.is_none() };
        outcome.prices = prices::prices(&found.case, solved, &again, monitor)?;
    }
    outcome.comparison = comparison(&found, outcome.cutting_time_min, monitor)?;
    if let Some(wanted) = &job.trade_off {
        outcome.trade_off = trade_off(&found, wanted, held.as_ref(), monitor)?;
    }
    if let Some(wanted) = &job.compensation {
        monitor.progress(0.9, Message::new("stage_path"));
        outcome.compensated_path = compensated::path(job, &found.case, &found.at, wanted, monitor)?;
    }
    let (made, unwritten) = written(Made::of(job, &outcome))?;
    outcome.proof = made.as_ref().and_then(Made::proof);
    let mut warnings = advice::warnings(job, &found.case, &outcome, &found.at, made.as_ref());
    warnings.extend(unwritten);
    let explanation = advice::explanation(job, &outcome);
    monitor.progress(1.0, Message::new("stage_done"));
    Ok(Answer { output: outcome, warnings, explanation, basis: advice::basis(job) })
}

/// The program, or why there is none: the schedule itself stands without it.
fn written<T>(made: Result<T, Failure>) -> Result<(Option<T>, Option<Finding>), Failure> {
    match made {
        Ok(made) => Ok((Some(made), None)),
        Err(Failure::Cancelled) => Err(Failure::Cancelled),
        Err(failure) => Ok((None, Some(Finding::new("no_program", "/program").with("reason", failure.to_string())))),
    }
}

fn by_method(job: &Job, held: Option<&Held>, monitor: &dyn Monitor) -> Result<Found, Unsolved> {
    if let Some(plan) = &job.passes {
        let (case, solved, passes) = passes::best(job, plan, held, monitor)?;
        let at = solved.at.clone();
        return Ok(Found {
            case,
            solved: Some(solved),
            at,
            rule: None,
            continuous: None,
            smooth: None,
            passes: Some(passes),
            worth_of_risk: None,
        });
    }
    match &job.method {
        Method::Optimal => {
            let (case, solved, worth_of_risk) = risk::solved(Case::of(job, held, None)?, job, held, monitor)?;
            let at = solved.at.clone();
            Ok(Found {
                case,
                solved: Some(solved),
                at,
                rule: None,
                continuous: None,
                smooth: None,
                passes: None,
                worth_of_risk,
            })
        }
        Method::EqualDeflection { target, target_um, reference_feed_mm_per_rev, speed_m_per_min } => {
            let case = Case::of(job, held, None)?;
            let speeds = vec![*speed_m_per_min; case.zones.len()];
            let target = Target::of(*target, *target_um);
            let (at, rule) = rule::equal_deflection(&case, &speeds, *reference_feed_mm_per_rev, target)
                .ok_or_else(|| Failure::OutOfModel(Finding::new("nothing_bends", "/zones")))?;
            Ok(Found {
                case,
                solved: None,
                at,
                rule: Some(rule),
                continuous: None,
                smooth: None,
                passes: None,
                worth_of_risk: None,
            })
        }
        Method::Continuous { grid_points, loss_percent, segments_max, feed_gradient_per_mm } => {
            let asked = Asked {
                grid_points: *grid_points as usize,
                loss_percent: *loss_percent,
                segments_max: *segments_max as usize,
                gradient_per_mm: *feed_gradient_per_mm,
            };
            let zoned = continuous::find(job, &asked, held, monitor)?;
            Ok(Found {
                case: zoned.case,
                at: zoned.solved.at.clone(),
                solved: Some(zoned.solved),
                rule: None,
                continuous: Some(zoned.outcome),
                smooth: zoned.smooth,
                passes: None,
                worth_of_risk: None,
            })
        }
    }
}

fn in_reach(zones: &[ZoneOutcome]) -> bool {
    zones.iter().all(|zone| {
        let optional = [
            zone.force_y_n,
            zone.force_z_n,
            zone.power_kw,
            zone.torque_n_m,
            zone.deflection_um,
            zone.diameter_error_um,
            zone.roughness_um,
            zone.hardening_percent,
            zone.hardening_depth_um,
            zone.tool_life_min,
            zone.tool_usage,
        ];
        let always = [zone.feed_mm_per_rev, zone.speed_m_per_min, zone.spindle_speed_rpm, zone.cutting_time_min];
        optional.iter().flatten().chain(&always).all(|value| value.is_finite())
            && zone.further.iter().all(|further| further.value.is_finite())
    })
}

fn outcome(job: &Job, found: &Found, mut zones: Vec<ZoneOutcome>) -> Outcome {
    let case = &found.case;
    let bound = found.solved.as_ref().map(|solved| binding(case, solved)).unwrap_or_default();
    let mut active: HashMap<&str, Vec<String>> = HashMap::new();
    for limit in &bound {
        for part in limit.zone.split('|') {
            active.entry(part).or_default().push(limit.constraint.clone());
        }
    }
    for zone in &mut zones {
        zone.active = active.remove(zone.id.as_str()).unwrap_or_default();
    }
    let by_surface = assess::usage_by_surface(case, &zones);
    let usage = zones.iter().map(|zone| zone.tool_usage).sum::<Option<f64>>();
    let deflections = || zones.iter().map(|zone| zone.deflection_um);
    let roughnesses = || zones.iter().map(|zone| zone.roughness_um);
    Outcome {
        objective: found.solved.as_ref().map_or_else(|| objective_at(case, &zones), |solved| solved.objective),
        objective_kind: job.objective.name().to_owned(),
        objective_unit: job.objective.unit().to_owned(),
        cutting_time_min: zones.iter().map(|zone| zone.cutting_time_min).sum(),
        tool_usage: usage,
        edges: Vec::new(),
        edges_per_part: None,
        tool_changes: Vec::new(),
        whole_edge_objective: None,
        tool_usage_by_surface: by_surface,
        parts_per_edge: found.solved.as_ref().and_then(|solved| solved.parts_per_edge),
        largest_deflection_um: assess::largest(deflections()),
        deflection_spread: assess::spread(deflections()),
        largest_roughness_um: assess::largest(roughnesses()),
        roughness_spread: assess::spread(roughnesses()),
        binding: bound,
        prices: Vec::new(),
        conformance: None,
        certificate: certificate(found.solved.as_ref()),
        comparison: Comparison { constant_feed: None, equal_deflection: None },
        equal_deflection: found.rule.clone(),
        continuous: found.continuous.clone(),
        passes: found.passes.clone(),
        trade_off: Vec::new(),
        compensated_path: None,
        proof: None,
        zones,
    }
}

/// The objective of a schedule that no program made.
fn objective_at(case: &Case, zones: &[ZoneOutcome]) -> f64 {
    if let Some(rates) = Rates::of(case) {
        return rates.fixed
            + zones
                .iter()
                .map(|zone| rates.per_minute * zone.cutting_time_min + rates.per_edge * zone.tool_usage.unwrap_or(0.0))
                .sum::<f64>();
    }
    let relative = |value: Option<f64>, limit: Option<f64>| Some(value? / limit?);
    let values = case.zones.iter().zip(zones).map(|(zone, given)| match case.goal {
        Goal::Roughness {} => relative(given.roughness_um, zone.roughness_max_um),
        Goal::Hardening {} => given.hardening_percent,
        _ => relative(given.deflection_um, zone.deflection_max_um),
    });
    assess::largest(values).unwrap_or(0.0)
}

fn certificate(solved: Option<&Solved>) -> Certificate {
    let Some(solved) = solved else {
        return Certificate {
            duality_gap: 0.0,
            kkt_residual: 0.0,
            primal_residual: 0.0,
            lower_bound: None,
            iterations: 0,
            solver: Solver::Rule,
            linearisations: 0,
            local: true,
            tie_broken: false,
        };
    };
    let found = &solved.certificate;
    Certificate {
        duality_gap: found.gap,
        kkt_residual: found.dual_residual,
        primal_residual: found.primal_residual,
        lower_bound: solved.whole.as_ref().map(|(_, bound)| *bound),
        iterations: found.iterations,
        solver: if solved.conic { Solver::Conic } else { Solver::InteriorPoint },
        linearisations: solved.linearisations,
        local: solved.local,
        tie_broken: solved.tie_broken,
    }
}

/// The best single feed, and the source paper's rule from it.
fn comparison(found: &Found, time_min: f64, monitor: &dyn Monitor) -> Result<Comparison, Failure> {
    // With one feed a joint risk would be shared otherwise, and what is not the best is nothing to compare with.
    if found.solved.as_ref().is_some_and(|solved| solved.shares_risk) {
        return Ok(Comparison { constant_feed: None, equal_deflection: None });
    }
    let mut case = found.case.clone();
    let mut constant_feed = None;
    if case.variables.feed != FeedMode::Fixed {
        case.variables.feed = FeedMode::Constant;
        // A single feed has no gradient.
        case.zones.iter_mut().for_each(|zone| zone.ceiling = None);
        match solve(&case, false, monitor) {
            Ok(solved) => {
                let time = assess::cutting_time_min(&case, &solved.at);
                constant_feed = Some((
                    solved.at.clone(),
                    ConstantFeed {
                        feed_mm_per_rev: solved.at[0].1.exp(),
                        cutting_time_min: time,
                        objective: solved.objective,
                        time_saved_percent: 100.0 * (1.0 - time_min / time),
                    },
                ));
            }
            Err(Unsolved::Failed(Failure::Cancelled)) => return Err(Failure::Cancelled),
            // No single feed meets all limits, or none was found: there is nothing to compare with.
            Err(_) => {}
        }
    }
    let bends = found.case.zones.iter().any(|zone| zone.yields().is_some() && zone.model(Output::ForceY).is_some());
    let equal_deflection = match (&constant_feed, found.rule.is_none() && bends) {
        (Some((at, constant)), true) => {
            let speeds: Vec<f64> = at.iter().map(|(u, _)| u.exp()).collect();
            rule::equal_deflection(&found.case, &speeds, constant.feed_mm_per_rev, Target::Minimum).map(|rule| rule.1)
        }
        _ => None,
    };
    Ok(Comparison { constant_feed: constant_feed.map(|(_, constant)| constant), equal_deflection })
}

/// The same zones with all limits of one kind multiplied by a factor that runs over a range.
fn trade_off(
    found: &Found,
    wanted: &TradeOff,
    held: Option<&Held>,
    monitor: &dyn Monitor,
) -> Result<Vec<TradePoint>, Failure> {
    let last = f64::from(wanted.count - 1);
    (0..wanted.count)
        .map(|k| {
            checkpoint(monitor)?;
            let share = f64::from(k) / last;
            let factor = (wanted.factor_from.ln() * (1.0 - share) + wanted.factor_to.ln() * share).exp();
            let none = TradePoint { factor, objective: None, cutting_time_min: None, tool_usage: None };
            let Some(scaled) = scaled(found, wanted.limit, factor, held, monitor)? else { return Ok(none) };
            match solve(&scaled, false, monitor) {
                Ok(solved) => {
                    let usage: Option<f64> = scaled
                        .zones
                        .iter()
                        .zip(&solved.at)
                        .map(|(zone, &(u, x))| {
                            Some(zone.work() * (-u - x).exp() / zone.model(Output::ToolLife)?.output(u, x))
                        })
                        .sum();
                    Ok(TradePoint {
                        factor,
                        objective: Some(solved.objective),
                        cutting_time_min: Some(assess::cutting_time_min(&scaled, &solved.at)),
                        tool_usage: usage,
                    })
                }
                Err(Unsolved::Failed(Failure::Cancelled)) => Err(Failure::Cancelled),
                Err(_) => Ok(none),
            }
        })
        .collect()
}

/// The found zones with all limits of one kind multiplied by a factor; `None` where they then have no schedule.
fn scaled(
    found: &Found,
    limit: TradedLimit,
    factor: f64,
    held: Option<&Held>,
    monitor: &dyn Monitor,
) -> Result<Option<Case>, Failure> {
    let change = |case: &mut Case| {
        let times = |limit: &mut Option<f64>| {
            if let Some(limit) = limit {
                *limit *= factor;
            }
        };
        match limit {
            TradedLimit::Deflection => case.zones.iter_mut().for_each(|zone| times(&mut zone.deflection_max_um)),
            TradedLimit::Roughness => case.zones.iter_mut().for_each(|zone| times(&mut zone.roughness_max_um)),
            TradedLimit::ToolUsage => times(&mut case.limits.tool_usage_max),
            TradedLimit::Time => times(&mut case.limits.time_max_min),
        }
    };
    let Some(smooth) = &found.smooth else {
        let mut case = found.case.clone();
        change(&mut case);
        return Ok(Some(case));
    };
    match smooth.changed(&change, held, monitor) {
        Ok(case) => Ok(case),
        Err(Failure::Cancelled) => Err(Failure::Cancelled),
        // As where the zones' own program finds nothing: the point stays empty.
        Err(_) => Ok(None),
    }
}

/// Limits that a schedule breaks, with what it reaches: for schedules that no program made.
pub(in crate::feed_schedule) fn broken(
    case: &Case,
    at: &[(f64, f64)],
) -> Vec<(crate::calculator::ConstraintName, f64)> {
    let mut free = case.clone();
    free.variables = crate::feed_schedule::job::input::Variables::default();
    let built = build(&free, &Variation { about: Some((at, f64::INFINITY)), ..Variation::default() });
    let mut y = built.program.start.clone();
    for (i, &(u, x)) in at.iter().enumerate() {
        for (source, value) in [(built.speed[i], u), (built.feed[i], x)] {
            if let Some(variable) = source.variable {
                y[variable] = value;
            }
        }
    }
    let rows = built.rows.iter().enumerate().map(|(row, label)| (label, built.program.rows.value(row, &y)));
    let sums = built.sums.iter().zip(&built.program.sums).map(|(label, terms)| (label, terms.log_sum_exp(&y)));
    rows.chain(sums)
        .filter(|(label, value)| {
            label.kind.is_limit() && label.kind != crate::feed_schedule::model::program::Kind::Spread && *value > 1e-9
        })
        .map(|(label, value)| {
            let factor = if label.plain { 1.0 + value / label.limit } else { value.exp() };
            (label.name(case), factor)
        })
        .collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_cannot_be_written_takes_no_schedule_away() {
        assert_eq!(written(Ok(1)).unwrap(), (Some(1), None));
        let (made, why) = written::<u8>(Err(Failure::Internal("a zone lies nowhere".to_owned()))).unwrap();
        assert_eq!((made, why.map(|why| why.code)), (None, Some("no_program")));
        assert!(matches!(written::<u8>(Err(Failure::Cancelled)), Err(Failure::Cancelled)));
    }
}
