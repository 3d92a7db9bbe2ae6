//! Why no schedule exists: the least relaxation, and a smallest set of limits that conflict (`feed/6.5`).

use crate::calculator::{ConstraintName, Failure};
use crate::num::gp::{self, Affines, Objective, Program, Verdict};

use crate::feed_schedule::job::case::Case;
use crate::feed_schedule::job::input::Goal;
use crate::feed_schedule::model::program::{Built, Kind, Label, Variation, build};

/// What stands against a schedule.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::feed_schedule) struct Infeasibility {
    /// Least sum of relaxations in logarithms.
    pub elastic_total: f64,
    /// Whether limits of machine and data had to give, too.
    pub all_elastic: bool,
    /// Limits that give, with the factor on each.
    pub relaxations: Vec<(ConstraintName, f64)>,
    /// Limits that cannot hold together; without any one of them the rest can.
    pub conflict: Vec<ConstraintName>,
}

/// A relaxation below this is none.
const NONE: f64 = 1e-6;

/// Analyses a case without a solution.
pub(in crate::feed_schedule) fn analyse(case: &Case, variation: &Variation<'_>) -> Result<Infeasibility, Failure> {
    // What is least plays no part; a least-of-the-largest objective would only bring an idle variable in.
    let mut case = case.clone();
    case.goal = Goal::default();
    let built = build(&case, variation);
    let (elastic_total, all_elastic, relaxations) = relax(&case, &built)?;
    let conflict = conflict(&case, &built)?;
    Ok(Infeasibility { elastic_total, all_elastic, relaxations, conflict })
}

type Relaxed = (f64, bool, Vec<(ConstraintName, f64)>);

/// Tolerances of the general solver, tried in turn.
const TOLERANCES: [f64; 4] = [1e-9, 1e-8, 1e-7, 1e-6];
/// What a user gives beyond what is told, in logarithms; half of it has to be enough.
const BEYOND: f64 = 1e-3;

fn relax(case: &Case, built: &Built) -> Result<Relaxed, Failure> {
    let stalled = || Failure::NotConverged { what: "the least relaxation", residual: f64::INFINITY, iterations: 200 };
    // Requirements give first; machine and data only where they alone leave nothing.
    let hard = |labels: &[Label]| -> Vec<usize> {
        let is_hard = |label: &Label| label.kind.is_limit() && !label.kind.is_requirement();
        labels.iter().enumerate().filter(|(_, label)| is_hard(label)).map(|(k, _)| k).collect()
    };
    let verdict = gp::feasibility(&built.program, &hard(&built.rows), &hard(&built.sums)).map_err(|_| stalled())?;
    let all = verdict != Verdict::Feasible;
    let (program, labels) = elastic(built, all);
    let first = built.program.variables();
    let solution = TOLERANCES
        .iter()
        .find_map(|&tolerance| gp::conic::minimise(&program, tolerance).ok())
        .or_else(|| gp::minimise(&program, &gp::Settings { iterations: 200, ..gp::Settings::default() }).ok())
        .ok_or_else(stalled)?;
    let rho = &solution.y[first..];
    // What is told is tried: small relaxations are left out only where the others are enough without them.
    let mut told: Vec<f64> = rho.to_vec();
    for (least, more) in [(NONE, 0.0), (1e-9, 0.0), (1e-9, BEYOND), (0.0, 10.0 * BEYOND)] {
        told = rho.iter().map(|rho| if *rho > least { rho + more } else { 0.0 }).collect();
        if is_enough(built, all, &told) {
            break;
        }
    }
    Ok((solution.objective, all, named(case, &labels, &told)))
}

/// Relaxations with names and factors, the largest first.
fn named(case: &Case, labels: &[Label], rho: &[f64]) -> Vec<(ConstraintName, f64)> {
    let mut relaxations: Vec<(ConstraintName, f64)> = Vec::new();
    // A spread stands between any two zones: the one ratio gives by both largest shares.
    let mut spread = [0.0_f64; 2];
    let mut before: Option<&Label> = None;
    for (label, &rho) in labels.iter().zip(rho) {
        if label.kind == Kind::Spread {
            let upper = usize::from(before == Some(label));
            spread[upper] = spread[upper].max(rho);
        } else if rho > 0.0 {
            relaxations.push((label.name(case), factor(label, rho)));
        }
        before = Some(label);
    }
    if spread[0] + spread[1] > 0.0 {
        let name = ConstraintName { constraint: Kind::Spread.name().into_owned(), zone: "part".to_owned() };
        relaxations.push((name, (spread[0] + spread[1]).exp()));
    }
    relaxations.sort_by(|a, b| b.1.ln().abs().total_cmp(&a.1.ln().abs()));
    relaxations
}

/// By what a limit is multiplied.
fn factor(label: &Label, rho: f64) -> f64 {
    match (label.plain, label.lower) {
        (true, false) => 1.0 + rho,
        (true, true) => 1.0 - rho,
        (false, false) => rho.exp(),
        (false, true) => (-rho).exp(),
    }
}

/// Whether a limit may give.
fn is_elastic(label: &Label, all: bool) -> bool {
    label.kind.is_limit() && (all || label.kind.is_requirement())
}

/// Whether a schedule exists with these relaxations, each that is not nothing taken a little further.
fn is_enough(built: &Built, all: bool, rho: &[f64]) -> bool {
    let mut program = built.program.clone();
    let mut next = rho.iter();
    let mut give = |label: &Label| {
        let rho = if is_elastic(label, all) { next.next().copied().unwrap_or(0.0) } else { 0.0 };
        let scale = if label.plain { label.limit.abs() } else { 1.0 };
        if rho > 0.0 { -scale * (rho + 0.5 * BEYOND) } else { 0.0 }
    };
    for (row, label) in built.rows.iter().enumerate() {
        program.rows.shift(row, give(label));
    }
    for (sum, label) in built.sums.iter().enumerate() {
        let by = give(label);
        (0..program.sums[sum].len()).for_each(|term| program.sums[sum].shift(term, by));
    }
    let rows: Vec<usize> = (0..program.rows.len()).collect();
    let sums: Vec<usize> = (0..program.sums.len()).collect();
    matches!(gp::feasibility(&program, &rows, &sums), Ok(Verdict::Feasible))
}

/// Every elastic limit with a relaxation of its own; their sum is least.
fn elastic(built: &Built, all: bool) -> (Program, Vec<Label>) {
    let base = &built.program;
    let mut labels = Vec::new();
    let mut next = base.variables();
    let mut rows = Affines::new();
    for (row, label) in built.rows.iter().enumerate() {
        let mut entries: Vec<(usize, f64)> = base.rows.entries(row).collect();
        if is_elastic(label, all) {
            let scale = if label.plain { label.limit.abs() } else { 1.0 };
            entries.push((next, -scale));
            labels.push(label.clone());
            next += 1;
        }
        rows.push(&entries, base.rows.constant(row));
    }
    let mut sums = Vec::new();
    for (terms, label) in base.sums.iter().zip(&built.sums) {
        if is_elastic(label, all) {
            sums.push(terms.with_entry(next, -1.0));
            labels.push(label.clone());
            next += 1;
        } else {
            sums.push(terms.clone());
        }
    }
    let of_rho: Vec<(usize, f64)> = (base.variables()..next).map(|rho| (rho, 1.0)).collect();
    for &(rho, _) in &of_rho {
        rows.push(&[(rho, -1.0)], 0.0);
    }
    let mut total = Affines::new();
    total.push(&of_rho, 0.0);
    let mut start = base.start.clone();
    start.resize(next, 0.0);
    let program = Program {
        local: base.local,
        common: next - base.local,
        objective: Objective::Linear(total),
        rows,
        sums,
        start,
    };
    (program, labels)
}

/// Names of a smallest set of limits that conflict; none where they nearly hold together.
fn conflict(case: &Case, built: &Built) -> Result<Vec<ConstraintName>, Failure> {
    let stalled = || Failure::NotConverged { what: "the test of feasibility", residual: f64::NAN, iterations: 120 };
    let labels: Vec<&Label> = built.rows.iter().chain(&built.sums).collect();
    let limits: Vec<usize> = (0..labels.len()).filter(|&k| labels[k].kind.is_limit()).collect();
    let mut members = gp::conflict(&built.program, &limits).map_err(|_| stalled())?;
    members.sort_unstable();
    let mut names: Vec<ConstraintName> = members.into_iter().map(|k| labels[k].name(case)).collect();
    names.dedup();
    Ok(names)
}
