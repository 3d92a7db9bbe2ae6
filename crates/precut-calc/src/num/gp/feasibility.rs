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
const TOLERANCE: f64 = 1e-7;
/// Half-width of the box that keeps every variable bounded when bounds are left out, in logarithms.
const BOX: f64 = 12.0;

/// Minimises the common relaxation t >= -0.5 of the chosen rows and sums (`feed/6.5`); the others are left out. Where the
/// program's own method comes to nothing, by the general conic solver.
///
/// # Errors
/// [`Failed::Stalled`] where both came to nothing.
pub fn feasibility(program: &Program, rows: &[usize], sums: &[usize]) -> Result<Verdict, Failed> {
    let relaxed = relaxed(program, rows, sums);
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
    let rows: Vec<usize> = (0..program.rows.len()).collect();
    let sums: Vec<usize> = (0..program.sums.len()).collect();
    let relaxed = relaxed(program, &rows, &sums);
    let settings = Settings { gap: 1e-9, enough: Some(-1e-3), iterations: 200, ..Settings::default() };
    let own = Layout::new(&relaxed).ok_or(Failed::NotChained).and_then(|layout| layout.minimise(&settings));
    let solution = own.ok().or_else(|| conic::minimise(&relaxed, settings.gap).ok())?;
    let mut y = solution.y;
    y.truncate(program.variables());
    (program.violation(&y) <= TOLERANCE).then_some(y)
}

fn relaxed(program: &Program, rows: &[usize], sums: &[usize]) -> Program {
    let t = program.variables();
    let mut all = program.rows.chosen(rows).with_entry(t, -1.0);
    for (i, start) in program.start.iter().enumerate() {
        all.push(&[(i, 1.0)], -(start + BOX));
        all.push(&[(i, -1.0)], start - BOX);
    }
    all.push(&[(t, -1.0)], -0.5);
    let sums: Vec<Affines> = sums.iter().map(|&sum| program.sums[sum].with_entry(t, -1.0)).collect();
    let mut least = Affines::new();
    least.push(&[(t, 1.0)], 0.0);
    let mut relaxed = Program {
        local: program.local,
        common: program.common + 1,
        objective: Objective::Linear(least),
        rows: all,
        sums,
        start: program.start.clone(),
    };
    relaxed.start.push(0.0);
    let worst = relaxed.violation(&relaxed.start);
    relaxed.start[t] = worst.max(-0.4) + 0.5;
    relaxed
}
