//! Solves a case: once, over whole numbers of parts per edge, or by successive linearisation (`feed/6.3`, `feed/6.4`).

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::num::gp::{self, Failed, Layout, Objective, Program, Settings, Solution, Verdict};

use super::acting::Bend;
use super::case::Case;
use super::infeasible::{self, Infeasibility};
use super::input::Goal;
use super::models::Output;
use super::program::{Built, Rates, Variation, build, second_objective};

/// The schedule of a case with its certificate.
#[derive(Debug, Clone)]
pub(super) struct Solved {
    pub built: Built,
    /// ln V and ln S of every zone.
    pub at: Vec<(f64, f64)>,
    /// The objective, fixed parts included.
    pub objective: f64,
    /// Multipliers, residuals and gap belong to this.
    pub certificate: Solution,
    /// What one unit of the program's multipliers is worth in the whole objective's elasticity; with the objective
    /// `hardening` in percentage points.
    pub elasticity: f64,
    /// What it is worth where a limit gives by one percent, in percent of the objective or percentage points.
    pub gain: f64,
    pub tie_broken: bool,
    pub parts_per_edge: Option<u32>,
    /// Successive linearisations; 0 where none was needed.
    pub linearisations: u32,
    /// Whether only a local optimum is claimed.
    pub local: bool,
    /// Found by the conic solver, where the interior-point method stalled.
    pub conic: bool,
}

/// Why a case has no schedule.
#[derive(Debug, Clone)]
pub(super) enum Unsolved {
    /// Its limits conflict.
    Infeasible(Box<Infeasibility>),
    /// Anything else.
    Failed(Failure),
}

impl From<Failure> for Unsolved {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

/// Relative slack in which the second solve holds the objective: so little that totals keep seven digits.
const HELD: f64 = 2e-8;
/// Most linearisations.
const LINEARISATIONS: u32 = 60;
/// Steps of ln V, ln S below this end the linearisations.
const SETTLED: f64 = 1e-9;
/// Most parts per edge tried.
const MOST_PARTS: u32 = 10_000;

/// Solves a case; `why` decides whether an infeasible one is analysed.
pub(super) fn solve(case: &Case, why: bool, monitor: &dyn Monitor) -> Result<Solved, Unsolved> {
    if case.limits.whole_parts_per_edge {
        return whole_parts(case, why, monitor);
    }
    solve_with(case, None, why, monitor)
}

fn solve_with(case: &Case, parts: Option<u32>, why: bool, monitor: &dyn Monitor) -> Result<Solved, Unsolved> {
    checkpoint(monitor)?;
    if case.bends() {
        return linearised(case, parts, why, monitor);
    }
    once(case, &Variation { parts_per_edge: parts, about: None }, why)
}

/// Scans whole numbers of parts per edge upward: the objective over ln m is convex, so the first rise ends it.
fn whole_parts(case: &Case, why: bool, monitor: &dyn Monitor) -> Result<Solved, Unsolved> {
    let mut best: Option<Solved> = None;
    for m in 1..=MOST_PARTS {
        match solve_with(case, Some(m), why && m == 1, monitor) {
            Ok(next) => {
                if best.as_ref().is_some_and(|best| next.objective >= best.objective) {
                    break;
                }
                best = Some(next);
            }
            Err(unsolved) if best.is_none() => return Err(unsolved),
            Err(Unsolved::Infeasible(_)) => break,
            Err(failed) => return Err(failed),
        }
    }
    best.ok_or_else(|| Unsolved::Failed(Failure::Internal("no number of parts per edge was tried".to_owned())))
}

/// Solves the program of a case as it stands, or as linearised.
fn once(case: &Case, variation: &Variation<'_>, why: bool) -> Result<Solved, Unsolved> {
    let built = build(case, variation);
    let infeasible = || {
        if why {
            match infeasible::analyse(case, variation) {
                Ok(found) => Unsolved::Infeasible(Box::new(found)),
                Err(failure) => Unsolved::Failed(failure),
            }
        } else {
            Unsolved::Infeasible(Box::default())
        }
    };
    if built.program.variables() == 0 {
        return fixed(case, built, variation, &infeasible);
    }
    let layout = Layout::new(&built.program);
    let found = layout.as_ref().ok_or(Failed::NotChained).and_then(|layout| layout.minimise(&Settings::default()));
    let (certificate, conic) = match found {
        Ok(solution) => (solution, false),
        Err(_) => match by_cones(&built.program) {
            Ok(Some(solution)) => (solution, true),
            Ok(None) => return Err(infeasible()),
            Err(failure) => return Err(failure.into()),
        },
    };
    let flat = Rates::of(case).is_none()
        || layout.as_ref().is_some_and(|layout| !conic && layout.has_flat_direction(&certificate));
    let second = if flat { broken_tie(case, &built, &certificate) } else { None };
    let y = second.as_ref().unwrap_or(&certificate.y);
    let at = (0..case.zones.len()).map(|i| (built.speed[i].at(y), built.feed[i].at(y))).collect();
    Ok(finish(case, built, certificate, at, second.is_some(), variation.parts_per_edge, conic))
}

fn finish(
    case: &Case,
    built: Built,
    certificate: Solution,
    at: Vec<(f64, f64)>,
    tie_broken: bool,
    parts_per_edge: Option<u32>,
    conic: bool,
) -> Solved {
    let (objective, elasticity, gain) = match case.goal {
        Goal::Time { .. } | Goal::Cost { .. } => {
            let varying = certificate.objective.exp();
            let share = varying / (varying + built.fixed);
            (varying + built.fixed, share, share)
        }
        Goal::Deflection {} | Goal::Roughness {} => (certificate.objective.exp(), 1.0, 1.0),
        Goal::Hardening {} => {
            let plain =
                case.zones.iter().filter_map(|zone| zone.model(Output::Hardening)).all(|m| !m.form(0.0, 0.0).log_log);
            // Prices are in percentage points whichever way it is minimised.
            let (percent, points) = match certificate.objective {
                degree if plain => (degree, 1.0),
                logarithm => (logarithm.exp(), logarithm.exp()),
            };
            (percent, points, points / 100.0)
        }
    };
    Solved {
        built,
        at,
        objective,
        certificate,
        elasticity,
        gain,
        tie_broken,
        parts_per_edge,
        linearisations: 0,
        local: false,
        conic,
    }
}

/// Everything given: the limits hold or they do not.
fn fixed(
    case: &Case,
    built: Built,
    variation: &Variation<'_>,
    infeasible: &dyn Fn() -> Unsolved,
) -> Result<Solved, Unsolved> {
    if built.program.violation(&[]) > 1e-9 {
        return Err(infeasible());
    }
    let at = (0..case.zones.len()).map(|i| (built.speed[i].constant, built.feed[i].constant)).collect();
    let rows = built.program.rows.len();
    let certificate = Solution {
        y: Vec::new(),
        objective: built.program.objective_at(&[]),
        row_multipliers: vec![0.0; rows],
        sum_multipliers: vec![0.0; built.program.sums.len()],
        row_slacks: (0..rows).map(|row| -built.program.rows.constant(row)).collect(),
        gap: 0.0,
        primal_residual: 0.0,
        dual_residual: 0.0,
        iterations: 0,
    };
    Ok(finish(case, built, certificate, at, false, variation.parts_per_edge, false))
}

/// The general solver, where the interior-point method gave nothing: the optimum, or `None` where there is no point.
fn by_cones(program: &Program) -> Result<Option<Solution>, Failure> {
    let rows: Vec<usize> = (0..program.rows.len()).collect();
    let sums: Vec<usize> = (0..program.sums.len()).collect();
    if matches!(gp::feasibility(program, &rows, &sums), Ok(Verdict::Infeasible { .. })) {
        return Ok(None);
    }
    match gp::conic::minimise(program, 1e-9) {
        Ok(solution) if solution.y.iter().all(|y| y.is_finite()) => Ok(Some(solution)),
        Err(status) if status.0.contains("Infeasible") => Ok(None),
        _ => Err(Failure::NotConverged { what: "the schedule", residual: f64::INFINITY, iterations: 200 }),
    }
}

/// The best of all points that share the optimum, by the second objective.
fn broken_tie(case: &Case, built: &Built, first: &Solution) -> Option<Vec<f64>> {
    let mut program = built.program.clone();
    match &built.program.objective {
        Objective::Sum(terms) => {
            let mut held = terms.clone();
            for row in 0..held.len() {
                held.shift(row, -(first.objective + HELD));
            }
            program.sums.push(held);
        }
        Objective::Linear(form) => {
            let slack = if matches!(case.goal, Goal::Hardening {}) { HELD * first.objective.abs() } else { HELD };
            let entries: Vec<(usize, f64)> = form.entries(0).collect();
            program.rows.push(&entries, -(first.objective + slack));
        }
    }
    program.objective = second_objective(case, built);
    program.start.clone_from(&first.y);
    let settings = Settings { gap: 1e-8, dual: 1e-6, iterations: 120, ..Settings::default() };
    gp::minimise(&program, &settings)
        .ok()
        .map(|solution| solution.y)
        .or_else(|| gp::conic::minimise(&program, 1e-8).ok().map(|solution| solution.y))
}

/// Successive linearisation of the models that bend, with a bound on the step that shrinks where steps turn back.
///
/// A fixed point satisfies the conditions of the optimum of the problem itself. Where every bend is convex in its limit
/// that problem is convex and the point its optimum; otherwise it is a local one.
fn linearised(case: &Case, parts: Option<u32>, why: bool, monitor: &dyn Monitor) -> Result<Solved, Unsolved> {
    let start = build(case, &Variation { parts_per_edge: parts, about: None });
    let y = &start.program.start;
    let mut at: Vec<(f64, f64)> = (0..case.zones.len()).map(|i| (start.speed[i].at(y), start.feed[i].at(y))).collect();
    let mut radius = f64::INFINITY;
    let mut before: Option<Vec<(f64, f64)>> = None;
    for round in 1..=LINEARISATIONS {
        checkpoint(monitor)?;
        // The first program has no bound on its step: an infeasible one is infeasible as linearised about the middle.
        let variation = Variation { parts_per_edge: parts, about: Some((&at, radius)) };
        let mut solved = match once(case, &variation, why && round == 1) {
            Ok(solved) => solved,
            Err(Unsolved::Infeasible(_)) if round > 1 && radius.is_finite() => {
                // The step was too short to reach a feasible point of the new linearisation.
                radius *= 4.0;
                if radius > 50.0 {
                    return once(case, &Variation { parts_per_edge: parts, about: Some((&at, f64::INFINITY)) }, why);
                }
                continue;
            }
            Err(unsolved) => return Err(unsolved),
        };
        let step: Vec<(f64, f64)> =
            solved.at.iter().zip(&at).map(|(new, old)| (new.0 - old.0, new.1 - old.1)).collect();
        let length = step.iter().map(|d| d.0.abs().max(d.1.abs())).fold(0.0, f64::max);
        if length < SETTLED || (round == LINEARISATIONS && length < 1e-6) {
            solved.linearisations = round;
            solved.local = !convex(case);
            return Ok(solved);
        }
        let turned = before
            .as_ref()
            .is_some_and(|before| before.iter().zip(&step).map(|(a, b)| a.0 * b.0 + a.1 * b.1).sum::<f64>() < 0.0);
        radius = if !radius.is_finite() {
            1.0
        } else if turned {
            0.5 * length.min(radius)
        } else {
            radius
        };
        at.clone_from(&solved.at);
        before = Some(step);
    }
    Err(Unsolved::Failed(Failure::NotConverged {
        what: "the successive linearisation of the models",
        residual: radius,
        iterations: LINEARISATIONS,
    }))
}

/// Whether every bent model stands only in limits that stay convex with it.
fn convex(case: &Case) -> bool {
    case.zones.iter().all(|zone| {
        let known = Output::ALL.into_iter().all(|output| {
            let bend = zone.model(output).map_or(Bend::Straight, super::acting::ActingModel::bends);
            match output {
                Output::ToolLife => matches!(bend, Bend::Straight | Bend::Concave),
                Output::ForceY if case.limits.deflection_spread_ratio_max.is_some() => bend == Bend::Straight,
                _ => matches!(bend, Bend::Straight | Bend::Convex),
            }
        });
        let custom = case.custom.iter().filter(|custom| case.zones[custom.zone].id == zone.id).all(|custom| {
            let bend = custom.further.map_or(Bend::Straight, |k| zone.further[k].bends());
            match bend {
                Bend::Straight => true,
                Bend::Convex => custom.min.is_none(),
                Bend::Concave => custom.max.is_none(),
                Bend::Mixed => false,
            }
        });
        known && custom
    })
}
