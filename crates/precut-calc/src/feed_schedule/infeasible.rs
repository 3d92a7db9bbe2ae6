//! Why no schedule exists: the least relaxation, and a smallest set of limits that conflict (`feed/6.5`).

use crate::calculator::{ConstraintName, Failure};
use crate::num::gp::{self, Affines, Objective, Program, Verdict};

use super::case::Case;
use super::input::Goal;
use super::program::{Built, Label, Variation, build};

/// What stands against a schedule.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Infeasibility {
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
pub(super) fn analyse(case: &Case, variation: &Variation<'_>) -> Result<Infeasibility, Failure> {
    // What is least plays no part; a least-of-the-largest objective would only bring an idle variable in.
    let mut case = case.clone();
    case.goal = Goal::default();
    let built = build(&case, variation);
    let (elastic_total, all_elastic, relaxations) = relax(&case, &built)?;
    let conflict = conflict(&case, &built)?;
    Ok(Infeasibility { elastic_total, all_elastic, relaxations, conflict })
}

type Relaxed = (f64, bool, Vec<(ConstraintName, f64)>);

fn relax(case: &Case, built: &Built) -> Result<Relaxed, Failure> {
    for all in [false, true] {
        let (program, labels) = elastic(built, all);
        let Ok(solution) = gp::conic::minimise(&program, 1e-9) else { continue };
        let first = built.program.variables();
        let mut relaxations: Vec<(ConstraintName, f64)> = labels
            .iter()
            .zip(&solution.y[first..])
            .filter(|(_, rho)| **rho > NONE)
            .map(|(label, rho)| {
                let factor = match (label.plain, label.lower) {
                    (true, false) => 1.0 + rho,
                    (true, true) => 1.0 - rho,
                    (false, false) => rho.exp(),
                    (false, true) => (-rho).exp(),
                };
                (label.name(case), factor)
            })
            .collect();
        relaxations.sort_by(|a, b| b.1.ln().abs().total_cmp(&a.1.ln().abs()));
        return Ok((solution.objective, all, relaxations));
    }
    Err(Failure::NotConverged { what: "the least relaxation", residual: f64::INFINITY, iterations: 200 })
}

/// Every elastic limit with a relaxation of its own; their sum is least.
fn elastic(built: &Built, all: bool) -> (Program, Vec<Label>) {
    let base = &built.program;
    let mut labels = Vec::new();
    let mut next = base.variables();
    let mut rows = Affines::new();
    let elastic = |label: &Label| label.kind.is_limit() && (all || label.kind.is_requirement());
    for (row, label) in built.rows.iter().enumerate() {
        let mut entries: Vec<(usize, f64)> = base.rows.entries(row).collect();
        if elastic(label) {
            let scale = if label.plain { label.limit.abs() } else { 1.0 };
            entries.push((next, -scale));
            labels.push(label.clone());
            next += 1;
        }
        rows.push(&entries, base.rows.constant(row));
    }
    let mut sums = Vec::new();
    for (terms, label) in base.sums.iter().zip(&built.sums) {
        if elastic(label) {
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

/// Deletion filter over the support of the certificate of infeasibility.
fn conflict(case: &Case, built: &Built) -> Result<Vec<ConstraintName>, Failure> {
    let program = &built.program;
    let stalled = || Failure::NotConverged { what: "the test of feasibility", residual: f64::NAN, iterations: 120 };
    let test = |members: &[usize]| -> Result<Verdict, Failure> {
        let (rows, sums) = split(members, program.rows.len());
        gp::feasibility(program, &rows, &sums).map_err(|_| stalled())
    };
    let count = program.rows.len() + program.sums.len();
    let limits = built.rows.iter().chain(&built.sums);
    let everything: Vec<usize> =
        limits.enumerate().filter(|(_, label)| label.kind.is_limit()).map(|(k, _)| k).collect();
    let Verdict::Infeasible { rows, sums, .. } = test(&everything)? else {
        // Nearly feasible: nothing to name.
        return Ok(Vec::new());
    };
    let mut members = supported(&everything, &rows, &sums, count);
    if test(&members)? == Verdict::Feasible {
        members = everything;
    }
    let mut k = 0;
    while k < members.len() {
        let mut without = members.clone();
        without.remove(k);
        match test(&without)? {
            Verdict::Feasible => k += 1,
            Verdict::Infeasible { rows, sums, .. } => {
                // The new certificate may leave out others behind this one as well; those before are needed.
                let kept = supported(&without, &rows, &sums, count);
                let still: Vec<usize> =
                    without.iter().enumerate().filter(|(at, m)| *at < k || kept.contains(m)).map(|(_, m)| *m).collect();
                let shrunk = still.len() < without.len() && matches!(test(&still)?, Verdict::Infeasible { .. });
                members = if shrunk { still } else { without };
            }
        }
    }
    let label = |k: usize| if k < program.rows.len() { &built.rows[k] } else { &built.sums[k - program.rows.len()] };
    members.sort_unstable();
    Ok(members.into_iter().map(|k| label(k).name(case)).collect())
}

fn split(members: &[usize], rows: usize) -> (Vec<usize>, Vec<usize>) {
    let of_rows = members.iter().copied().filter(|&k| k < rows).collect();
    let of_sums = members.iter().copied().filter(|&k| k >= rows).map(|k| k - rows).collect();
    (of_rows, of_sums)
}

/// Members whose weight in the certificate is above rounding.
fn supported(members: &[usize], rows: &[f64], sums: &[f64], count: usize) -> Vec<usize> {
    let weight = |k: usize| if k < rows.len() { rows[k] } else { sums[k - rows.len()] };
    let most = (0..count).map(weight).fold(0.0, f64::max);
    members.iter().copied().filter(|&k| weight(k) > 1e-6 * most).collect()
}
