//! Whether any point satisfies the limits: phase 1 and its certificate.

use super::interior::{Failed, Settings};
use super::{Affines, Layout, Objective, Program, conic};

/// What phase 1 found.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// A point that satisfies every limit, within `excess` (at most the tolerance).
    Feasible,
    /// None does. The limits that say so, with their weights in the certificate: rows, then sums.
    Infeasible {
        /// Least common relaxation that makes it feasible.
        excess: f64,
        /// Weight of every row.
        rows: Vec<f64>,
        /// Weight of every sum.
        sums: Vec<f64>,
    },
}

/// A common relaxation up to this counts as none.
pub(super) const TOLERANCE: f64 = 1e-7;
/// Half-width of the box that keeps every variable bounded when bounds are left out, in logarithms.
const BOX: f64 = 12.0;

/// Minimises the common relaxation t >= -0.5 of the chosen rows and sums (`feed/6.5`); the others are left out. Where the
/// program's own method comes to nothing, by the general conic solver.
///
/// # Errors
/// [`Failed::Stalled`] where both came to nothing.
pub fn feasibility(program: &Program, rows: &[usize], sums: &[usize]) -> Result<Verdict, Failed> {
    let relaxed = relaxed(&part(program, rows, sums).0, true);
    let settings = Settings { gap: 1e-9, enough: Some(-1e-6), iterations: 120, ..Settings::default() };
    let own = Layout::new(&relaxed).ok_or(Failed::NotChained).and_then(|layout| layout.minimise(&settings));
    let solution = own.or_else(|failed| conic::minimise(&relaxed, settings.gap).map_err(|_| failed))?;
    if solution.objective <= TOLERANCE {
        return Ok(Verdict::Feasible);
    }
    let mut weights = vec![0.0; program.rows.len()];
    for (k, &row) in rows.iter().enumerate() {
        weights[row] = solution.row_multipliers[k];
    }
    let mut of_sums = vec![0.0; program.sums.len()];
    for (k, &sum) in sums.iter().enumerate() {
        of_sums[sum] = solution.sum_multipliers[k];
    }
    Ok(Verdict::Infeasible { excess: solution.objective, rows: weights, sums: of_sums })
}

/// A point that satisfies all limits, with as much room as they leave up to a thousandth; `None` where none was found.
pub fn inside(program: &Program) -> Option<Vec<f64>> {
    let relaxed = relaxed(program, true);
    let settings = Settings { gap: 1e-9, enough: Some(-1e-3), iterations: 200, ..Settings::default() };
    let own = Layout::new(&relaxed).ok_or(Failed::NotChained).and_then(|layout| layout.minimise(&settings));
    let solution = own.ok().or_else(|| conic::minimise(&relaxed, settings.gap).ok())?;
    let mut y = solution.y;
    y.truncate(program.variables());
    (program.violation(&y) <= TOLERANCE).then_some(y)
}

/// The point that keeps the chosen rows and comes nearest to the chosen sums; `None` where none was found, or without sums.
pub(super) fn nearest(program: &Program, rows: &[usize], sums: &[usize]) -> Option<Vec<f64>> {
    if sums.is_empty() {
        return None;
    }
    let (part, variables) = part(program, rows, sums);
    let settings = Settings { gap: 1e-9, iterations: 120, ..Settings::default() };
    let solution = Layout::new(&relaxed(&part, false))?.minimise(&settings).ok()?;
    let mut y = program.start.clone();
    for (&variable, &value) in variables.iter().zip(&solution.y) {
        y[variable] = value;
    }
    Some(y)
}

/// Some of the limits, with nothing to minimise, over the variables that these touch; and which those are.
fn part(program: &Program, rows: &[usize], sums: &[usize]) -> (Program, Vec<usize>) {
    let mut is_touched = vec![false; program.variables()];
    rows.iter().flat_map(|&row| program.rows.entries(row)).for_each(|(i, _)| is_touched[i] = true);
    for terms in sums.iter().map(|&sum| &program.sums[sum]) {
        (0..terms.len()).flat_map(|row| terms.entries(row)).for_each(|(i, _)| is_touched[i] = true);
    }
    let variables: Vec<usize> = (0..program.variables()).filter(|&i| is_touched[i]).collect();
    let mut place = vec![0; program.variables()];
    for (at, &variable) in variables.iter().enumerate() {
        place[variable] = at;
    }
    let mut nothing = Affines::new();
    nothing.push(&[], 0.0);
    let local = variables.iter().filter(|&&i| i < program.local).count();
    let renumbered = |terms: &Affines| terms.renumbered(0..terms.len(), &place);
    let part = Program {
        local,
        common: variables.len() - local,
        objective: Objective::Linear(nothing),
        rows: program.rows.renumbered(rows.iter().copied(), &place),
        sums: sums.iter().map(|&sum| renumbered(&program.sums[sum])).collect(),
        start: variables.iter().map(|&i| program.start[i]).collect(),
    };
    (part, variables)
}

/// The program with one relaxation t for all its sums, and for its rows where they give, too; t is least.
fn relaxed(program: &Program, rows_give: bool) -> Program {
    let t = program.variables();
    let mut all = if rows_give { program.rows.with_entry(t, -1.0) } else { program.rows.clone() };
    for (i, start) in program.start.iter().enumerate() {
        all.push(&[(i, 1.0)], -(start + BOX));
        all.push(&[(i, -1.0)], start - BOX);
    }
    all.push(&[(t, -1.0)], -0.5);
    let mut least = Affines::new();
    least.push(&[(t, 1.0)], 0.0);
    let mut relaxed = Program {
        local: program.local,
        common: program.common + 1,
        objective: Objective::Linear(least),
        rows: all,
        sums: program.sums.iter().map(|sum| sum.with_entry(t, -1.0)).collect(),
        start: program.start.clone(),
    };
    relaxed.start.push(0.0);
    let worst = relaxed.violation(&relaxed.start);
    relaxed.start[t] = worst.max(-0.4) + 0.5;
    relaxed
}
