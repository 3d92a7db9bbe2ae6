//! The same program on exponential cones, for the general solver Clarabel (`feed/6.2`): the independent way.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use super::{Affines, Objective, Program, Solution};

/// Why the conic solver gave no optimum: its own word.
#[derive(Debug, Clone, PartialEq)]
pub struct NotSolved(pub String);

/// Entries and constant of an exponent, and the variable that stands for its exponential.
type Term = (Vec<(usize, f64)>, f64, usize);

/// K_exp = {(a, b, c): b > 0, b exp(a/b) <= c}: Σ exp(v_k) <= 1 becomes (v_k, 1, p_k) in K_exp, Σ p_k <= 1.
struct Cones {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
    right: Vec<f64>,
    variables: usize,
    /// Linear rows come first.
    exponential: Vec<Term>,
}

impl Cones {
    /// b - A x >= 0 for a form a·y + c <= 0.
    fn linear(&mut self, entries: impl Iterator<Item = (usize, f64)>, constant: f64) -> usize {
        let row = self.right.len();
        for (column, value) in entries {
            self.entry(row, column, value);
        }
        self.right.push(-constant);
        row
    }

    fn entry(&mut self, row: usize, column: usize, value: f64) {
        self.rows.push(row);
        self.columns.push(column);
        self.values.push(value);
    }

    /// Σ exp(term) <= 1, every term less `epigraph`; the row whose multiplier is the sum's.
    fn sum(&mut self, terms: &Affines, epigraph: Option<usize>) -> usize {
        let below = epigraph.map(|g| (g, -1.0));
        if terms.len() == 1 {
            return self.linear(terms.entries(0).chain(below), terms.constant(0));
        }
        let first = self.variables;
        self.variables += terms.len();
        for row in 0..terms.len() {
            let entries: Vec<(usize, f64)> = terms.entries(row).chain(below).collect();
            self.exponential.push((entries, terms.constant(row), first + row));
        }
        self.linear((first..self.variables).map(|p| (p, 1.0)), -1.0)
    }
}

/// Solves a program with Clarabel to a tolerance.
///
/// # Errors
/// The solver's status where it is not solved.
pub fn minimise(program: &Program, tolerance: f64) -> Result<Solution, NotSolved> {
    let n = program.variables();
    let mut cones = Cones {
        rows: Vec::new(),
        columns: Vec::new(),
        values: Vec::new(),
        right: Vec::new(),
        variables: n,
        exponential: Vec::new(),
    };
    let mut cost: Vec<(usize, f64)> = Vec::new();
    for row in 0..program.rows.len() {
        cones.linear(program.rows.entries(row), program.rows.constant(row));
    }
    match &program.objective {
        Objective::Linear(form) => cost.extend(form.entries(0)),
        Objective::Sum(terms) => {
            let g = cones.variables;
            cones.variables += 1;
            cost.push((g, 1.0));
            cones.sum(terms, Some(g));
        }
    }
    let of_sums: Vec<usize> = program.sums.iter().map(|terms| cones.sum(terms, None)).collect();
    let linear = cones.right.len();
    let exponential = std::mem::take(&mut cones.exponential);
    for (entries, constant, share) in &exponential {
        let row = cones.right.len();
        for &(column, value) in entries {
            cones.entry(row, column, -value);
        }
        cones.entry(row + 2, *share, -1.0);
        cones.right.extend([*constant, 1.0, 0.0]);
    }
    let mut kinds = vec![SupportedConeT::NonnegativeConeT(linear)];
    kinds.extend(exponential.iter().map(|_| SupportedConeT::ExponentialConeT()));
    let mut q = vec![0.0; cones.variables];
    for (column, value) in cost {
        q[column] += value;
    }
    let size = (cones.right.len(), cones.variables);
    let a = CscMatrix::new_from_triplets(size.0, size.1, cones.rows, cones.columns, cones.values);
    let p = CscMatrix::zeros((size.1, size.1));
    let settings = DefaultSettings {
        verbose: false,
        max_iter: 200,
        tol_gap_abs: tolerance,
        tol_gap_rel: tolerance,
        tol_feas: tolerance,
        ..DefaultSettings::default()
    };
    let mut solver =
        DefaultSolver::new(&p, &q, &a, &cones.right, &kinds, settings).map_err(|error| NotSolved(error.to_string()))?;
    solver.solve();
    let found = &solver.solution;
    if !matches!(found.status, SolverStatus::Solved | SolverStatus::AlmostSolved) {
        return Err(NotSolved(format!("{:?}", found.status)));
    }
    let y = found.x[..n].to_vec();
    Ok(Solution {
        objective: program.objective_at(&y),
        row_multipliers: found.z[..program.rows.len()].to_vec(),
        row_slacks: found.s[..program.rows.len()].to_vec(),
        sum_multipliers: of_sums.iter().map(|&row| found.z[row]).collect(),
        gap: (found.obj_val - found.obj_val_dual).abs(),
        primal_residual: found.r_prim,
        dual_residual: found.r_dual,
        iterations: found.iterations,
        y,
    })
}
