//! Whether multipliers are the only ones: what holds at an optimum, and which sums of prices it settles (`feed/6.6`).

use crate::num::gp::Affines;

use crate::feed_schedule::model::solve::Solved;

/// A limit nearer than this, in logarithms, holds: within ten steps of a number that is solved anew it may begin to bind.
pub(in crate::feed_schedule) const NEAR: f64 = 10.0 * crate::feed_schedule::model::prices::STEP;
/// More limits than this are not examined: the work grows with the third power.
const MOST: usize = 150;
/// What is left of a direction that lies in the range, relative.
const ROUNDING: f64 = 1e-7;

/// The limits that hold at an optimum: rows, then sums.
pub(in crate::feed_schedule) struct Active {
    /// Number of every limit among those that hold.
    place: Vec<Option<usize>>,
    count: usize,
    /// Orthonormal basis of all changes of what holds that a step of the variables can make.
    basis: Option<Vec<Vec<f64>>>,
}

impl Active {
    pub(in crate::feed_schedule) fn of(solved: &Solved) -> Self {
        let program = &solved.built.program;
        let solution = &solved.certificate;
        let rows = program.rows.len();
        let holds = |k: usize| {
            if k < rows {
                // Of slack and multiplier one is of the order of the gap.
                solution.row_slacks[k] <= NEAR.max(solution.row_multipliers[k].min(1e-3))
            } else {
                solution.y.len() == program.variables() && program.sums[k - rows].log_sum_exp(&solution.y) >= -NEAR
            }
        };
        let mut place = vec![None; rows + program.sums.len()];
        let mut count = 0;
        for (k, place) in place.iter_mut().enumerate() {
            if holds(k) {
                *place = Some(count);
                count += 1;
            }
        }
        let mut active = Self { place, count, basis: None };
        if count > 0 && count <= MOST && !solution.y.is_empty() {
            active.basis = Some(active.basis_of(solved));
        }
        active
    }

    fn basis_of(&self, solved: &Solved) -> Vec<Vec<f64>> {
        let program = &solved.built.program;
        let mut columns: std::collections::BTreeMap<usize, Vec<f64>> = std::collections::BTreeMap::new();
        let mut put = |limit: usize, variable: usize, value: f64| {
            columns.entry(variable).or_insert_with(|| vec![0.0; self.count])[limit] += value;
        };
        let rows = program.rows.len();
        for (k, place) in self.place.iter().enumerate() {
            let Some(limit) = *place else { continue };
            if k < rows {
                program.rows.entries(k).for_each(|(variable, a)| put(limit, variable, a));
            } else {
                gradient(&program.sums[k - rows], &solved.certificate.y, |variable, a| put(limit, variable, a));
            }
        }
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for mut column in columns.into_values() {
            let before = norm(&column);
            remove(&mut column, &basis);
            // Twice: once leaves rounding of what was nearly all removed.
            remove(&mut column, &basis);
            let left = norm(&column);
            if left > 1e-9 * before.max(1e-300) {
                for value in &mut column {
                    *value /= left;
                }
                basis.push(column);
            }
            if basis.len() == self.count {
                break;
            }
        }
        basis
    }

    /// Whether it was examined.
    pub(in crate::feed_schedule) fn is_known(&self) -> bool {
        self.basis.is_some()
    }

    /// Whether a limit holds.
    pub(in crate::feed_schedule) fn holds(&self, limit: usize) -> bool {
        self.place[limit].is_some()
    }

    /// Whether all multipliers of the optimum give the same sum over these limits with these weights: then the sum is the
    /// price of moving them together, both ways.
    pub(in crate::feed_schedule) fn settles(&self, weights: &[(usize, f64)]) -> bool {
        let Some(basis) = &self.basis else { return false };
        if basis.len() == self.count {
            return true;
        }
        let mut direction = vec![0.0; self.count];
        for &(limit, weight) in weights {
            if let Some(place) = self.place[limit] {
                direction[place] += weight;
            }
        }
        let before = norm(&direction);
        remove(&mut direction, basis);
        norm(&direction) <= ROUNDING * before
    }
}

fn gradient(terms: &Affines, y: &[f64], mut put: impl FnMut(usize, f64)) {
    let total = terms.log_sum_exp(y);
    for row in 0..terms.len() {
        let share = (terms.value(row, y) - total).exp();
        terms.entries(row).for_each(|(variable, a)| put(variable, share * a));
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn remove(x: &mut [f64], basis: &[Vec<f64>]) {
    for direction in basis {
        let along: f64 = x.iter().zip(direction).map(|(x, d)| x * d).sum();
        x.iter_mut().zip(direction).for_each(|(x, d)| *x -= along * d);
    }
}
