//! Solves a case: once, over whole numbers of parts per edge, or by successive linearisation (`feed/6.3`, `feed/6.4`).

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::num::gp::{self, Failed, Layout, Objective, Program, Settings, Solution, Verdict};

use crate::feed_schedule::job::acting::Bend;
use crate::feed_schedule::job::case::{Case, Margin};
use crate::feed_schedule::job::input::Goal;
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::model::edges::MOST_PARTS;
use crate::feed_schedule::model::infeasible::{self, Infeasibility};
use crate::feed_schedule::model::program::{Built, EdgeLimits, Label, Rates, Variation, build, second_objective};
use crate::feed_schedule::model::whole;

/// The schedule of a case with its certificate.
#[derive(Debug, Clone)]
#[allow(clippy::struct_excessive_bools, reason = "facts of a solution, none a state of another")]
pub(in crate::feed_schedule) struct Solved {
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
    /// What it comes to with one part more per edge, where that was tried and has an answer.
    pub one_part_more: Option<f64>,
    /// With whole edges: the limits of the edges, and what no plan comes below.
    pub whole: Option<(EdgeLimits, f64)>,
    /// Successive linearisations; 0 where none was needed.
    pub linearisations: u32,
    /// Whether only a local optimum is claimed.
    pub local: bool,
    /// Found by the conic solver, where the interior-point method stalled.
    pub conic: bool,
    /// A joint risk was shared out: its limits give by a multiplier that they have in common.
    pub shares_risk: bool,
}

/// Why a case has no schedule.
#[derive(Debug, Clone)]
pub(in crate::feed_schedule) enum Unsolved {
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

/// Solves a case; `why` decides whether an infeasible one is analysed.
pub(in crate::feed_schedule) fn solve(case: &Case, why: bool, monitor: &dyn Monitor) -> Result<Solved, Unsolved> {
    if case.limits.whole_edges {
        return whole::edges(case, why, monitor);
    }
    if case.limits.whole_parts_per_edge {
        return whole_parts(case, why, monitor);
    }
    solve_as(case, &Variation::default(), why, monitor)
}

/// Solves a case with a number of parts per edge or with edges that are given, or as it stands.
pub(in crate::feed_schedule) fn solve_as(
    case: &Case,
    variation: &Variation<'_>,
    why: bool,
    monitor: &dyn Monitor,
) -> Result<Solved, Unsolved> {
    checkpoint(monitor)?;
    if case.bends() {
        return linearised(case, variation, why, monitor);
    }
    once(case, variation, why)
}

/// Scans whole numbers of parts per edge upward: the objective over ln m is convex, so the first rise ends it.
fn whole_parts(case: &Case, why: bool, monitor: &dyn Monitor) -> Result<Solved, Unsolved> {
    let mut best: Option<Solved> = None;
    for m in 1..=MOST_PARTS {
        let variation = Variation { parts_per_edge: Some(m), ..Variation::default() };
        match solve_as(case, &variation, why && m == 1, monitor) {
            Ok(next) => {
                if let Some(best) = best.as_mut().filter(|best| next.objective >= best.objective) {
                    best.one_part_more = Some(next.objective);
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
        Err(_) => match safer(&built.program)? {
            Some(found) => found,
            None => return Err(infeasible()),
        },
    };
    let flat = Rates::of(case).is_none()
        || layout.as_ref().is_some_and(|layout| !conic && layout.has_flat_direction(&certificate));
    let second = if flat { broken_tie(case, &built, &certificate) } else { None };
    let y = second.as_ref().unwrap_or(&certificate.y);
    let at = (0..case.zones.len()).map(|i| (built.speed[i].at(y), built.feed[i].at(y))).collect();
    Ok(finish(case, built, certificate, at, second.is_some(), variation, conic))
}

pub(in crate::feed_schedule) fn finish(
    case: &Case,
    built: Built,
    certificate: Solution,
    at: Vec<(f64, f64)>,
    tie_broken: bool,
    variation: &Variation<'_>,
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
        parts_per_edge: variation.parts_per_edge,
        one_part_more: None,
        whole: None,
        linearisations: 0,
        local: false,
        conic,
        shares_risk: false,
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
    Ok(finish(case, built, certificate, at, false, variation, false))
}

/// Slower ways, where the interior-point method from the middle of the bounds gave nothing: from a point inside all limits,
/// then the general solver; and whether that found it. `None` where there is no point.
pub(in crate::feed_schedule) fn safer(program: &Program) -> Result<Option<(Solution, bool)>, Failure> {
    let rows: Vec<usize> = (0..program.rows.len()).collect();
    let sums: Vec<usize> = (0..program.sums.len()).collect();
    if matches!(gp::feasibility(program, &rows, &sums), Ok(Verdict::Infeasible { .. })) {
        return Ok(None);
    }
    if let Some(start) = gp::inside(program) {
        let from_inside = Program { start, ..program.clone() };
        let settings = Settings { inside: true, iterations: 300, ..Settings::default() };
        for gap in [settings.gap, 1e-8] {
            if let Ok(solution) =
                gp::minimise(&from_inside, &Settings { gap, dual: settings.dual.max(gap), ..settings })
            {
                return Ok(Some((solution, false)));
            }
        }
    }
    for tolerance in [1e-9, 1e-8, 1e-7] {
        match gp::conic::minimise(program, tolerance) {
            Ok(solution) if solution.y.iter().all(|y| y.is_finite()) => return Ok(Some((solution, true))),
            _ => {}
        }
    }
    Err(Failure::NotConverged { what: "the schedule", residual: f64::INFINITY, iterations: 200 })
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

/// Where in the range of the speeds the linearisations of a problem that is not convex begin, in turn.
const STARTS: [f64; 5] = [0.5, 0.9, 0.1, 0.7, 0.3];

/// Successive linearisation of the models that bend. Where the problem is convex one start tells all; otherwise the first
/// that leads to a schedule.
fn linearised(case: &Case, given: &Variation<'_>, why: bool, monitor: &dyn Monitor) -> Result<Solved, Unsolved> {
    let built = build(case, given);
    let y = &built.program.start;
    let middle: Vec<(f64, f64)> = (0..case.zones.len()).map(|i| (built.speed[i].at(y), built.feed[i].at(y))).collect();
    let range = (case.limits.speed_max_m_per_min / case.limits.speed_min_m_per_min).ln();
    let starts = if convex(case) { &STARTS[..1] } else { &STARTS[..] };
    let mut failed = None;
    for share in starts {
        let shift = |i: usize| if built.speed[i].variable.is_some() { (share - 0.5) * range } else { 0.0 };
        let at = middle.iter().enumerate().map(|(i, &(u, x))| (u + shift(i), x)).collect();
        let found = match from_start(case, given, at, monitor) {
            Err(Unsolved::Failed(Failure::NotConverged { .. })) if !case.models_bend() => {
                by_tangents(case, given, monitor)
            }
            found => found,
        };
        match found {
            Ok(solved) => return Ok(solved),
            Err(Unsolved::Failed(Failure::Cancelled)) => return Err(Failure::Cancelled.into()),
            // Not converged weighs more than infeasible: something may be there.
            Err(unsolved @ Unsolved::Failed(_)) => failed = Some(unsolved),
            Err(Unsolved::Infeasible(_)) => {}
        }
    }
    match failed {
        Some(failed) => Err(failed),
        // Infeasible as linearised about the middle, and from everywhere else.
        None => Err(once(case, given, why).err().unwrap_or_else(|| Unsolved::Infeasible(Box::default()))),
    }
}

/// Linearisations from one start, with a bound on the step that shrinks where steps turn back. The best point on the way
/// that keeps all limits stands in where they do not settle.
///
/// A fixed point satisfies the conditions of the optimum of the problem itself. Where every bend is convex in its limit
/// that problem is convex and the point its optimum; otherwise it is a local one.
fn from_start(
    case: &Case,
    given: &Variation<'_>,
    mut at: Vec<(f64, f64)>,
    monitor: &dyn Monitor,
) -> Result<Solved, Unsolved> {
    let mut radius = f64::INFINITY;
    let mut before: Option<Vec<(f64, f64)>> = None;
    let mut best: Option<(f64, Vec<(f64, f64)>)> = None;
    for round in 1..=LINEARISATIONS {
        checkpoint(monitor)?;
        let variation = Variation { about: Some((&at, radius)), ..given.clone() };
        let mut solved = match once(case, &variation, false) {
            Ok(solved) => solved,
            Err(Unsolved::Infeasible(_)) if round > 1 && radius.is_finite() => {
                // The step was too short to reach a feasible point of the new linearisation.
                radius *= 4.0;
                if radius > 50.0 {
                    radius = f64::INFINITY;
                }
                continue;
            }
            Err(Unsolved::Infeasible(_)) if best.is_some() => break,
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
        if best.as_ref().is_none_or(|(least, _)| solved.objective < *least) && keeps(case, given, &solved.at) {
            best = Some((solved.objective, solved.at.clone()));
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
    let stalled = || {
        Unsolved::Failed(Failure::NotConverged {
            what: "the successive linearisation of the models",
            residual: radius,
            iterations: LINEARISATIONS,
        })
    };
    let (_, kept) = best.ok_or_else(stalled)?;
    let mut solved = settled(case, given, &kept, LINEARISATIONS)?;
    solved.local = true;
    Ok(solved)
}

/// Most tangents of a limit.
const TANGENTS: u32 = 200;

/// The same where only margins bend, which is convex, by all tangents that were made (Kelley): each leaves out nothing that keeps the
/// limits, so that what they leave nothing to has no schedule.
fn by_tangents(case: &Case, given: &Variation<'_>, monitor: &dyn Monitor) -> Result<Solved, Unsolved> {
    let middle = build(case, given);
    let y = &middle.program.start;
    let mut points: Vec<Vec<(f64, f64)>> =
        vec![(0..case.zones.len()).map(|i| (middle.speed[i].at(y), middle.feed[i].at(y))).collect()];
    for round in 1..=TANGENTS {
        checkpoint(monitor)?;
        let Some((about, beside)) = points.split_last() else { break };
        let variation = Variation { about: Some((about, f64::INFINITY)), beside, ..given.clone() };
        let at = once(case, &variation, false)?.at;
        if keeps(case, given, &at) {
            return settled(case, given, &at, round);
        }
        points.push(at);
    }
    let what = "the tangents of limits that are moved in";
    Err(Unsolved::Failed(Failure::NotConverged { what, residual: f64::NAN, iterations: TANGENTS }))
}

/// A schedule itself, as the optimum of a program that may not leave it by more than a hair.
fn settled(case: &Case, given: &Variation<'_>, at: &[(f64, f64)], rounds: u32) -> Result<Solved, Unsolved> {
    let mut solved = once(case, &Variation { about: Some((at, 1e-5)), ..given.clone() }, false)?;
    solved.linearisations = rounds;
    Ok(solved)
}

/// Whether a schedule keeps all limits by the models themselves: a linearisation is exact where it is made.
fn keeps(case: &Case, given: &Variation<'_>, at: &[(f64, f64)]) -> bool {
    let built = build(case, &Variation { about: Some((at, f64::INFINITY)), ..given.clone() });
    let y = &built.program.start;
    let limits = |labels: &[Label]| labels.iter().map(|label| label.kind.is_limit()).collect::<Vec<_>>();
    let (of_rows, of_sums) = (limits(&built.rows), limits(&built.sums));
    let rows = (0..built.program.rows.len()).filter(|&k| of_rows[k]).map(|k| built.program.rows.value(k, y));
    let sums = built.program.sums.iter().zip(of_sums).filter(|(_, is)| *is).map(|(terms, _)| terms.log_sum_exp(y));
    // A spread's auxiliary variable starts above all of its rows, so that a spread counts as not kept.
    rows.chain(sums).all(|value| value <= 1e-7)
}

/// Whether every bent model stands only in limits that stay convex with it.
pub(in crate::feed_schedule) fn convex(case: &Case) -> bool {
    case.zones.iter().all(|zone| {
        let known = Output::ALL.into_iter().all(|output| {
            let bend = zone.model(output).map_or(Bend::Straight, crate::feed_schedule::job::acting::ActingModel::bends);
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
        known && custom && !zone.margins.iter().any(Margin::is_mixed)
    })
}
