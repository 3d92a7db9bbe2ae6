//! How well a table fixes its parameters: standard deviations, correlations, combinations (`fixture/6.3`).

use crate::calculator::{Failure, checkpoint};
use crate::num::dense::{Columns, dot, symmetric_eigen};

use super::problem::{HUBER, Law, Predicted, Problem};

/// Change of a parameter's logarithm (or of the value of what is searched plainly) for a difference.
const STEP: f64 = 0.01;
/// Modulus up to which a chattering row has no slope: its oscillation starts from nothing so slowly that what a run sees
/// of it says more of the length of the run.
const STEEP: f64 = 1.02;
/// An eigenvalue below this share of the largest says that the table does not see the combination.
const UNSEEN: f64 = 1e-10;

/// Uncertainty of the parameters, in their logarithms or of themselves.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Certainty {
    /// Per unknown; none where the table does not fix it.
    pub sd: Vec<Option<f64>>,
    /// Per pair of unknowns, first below second.
    pub correlations: Vec<(usize, usize, f64)>,
    /// Combinations of unknowns that are known independently of one another, the best known first: standard deviation
    /// (none where the table does not see it) and the share of each unknown.
    pub combinations: Vec<(Option<f64>, Vec<f64>)>,
    /// Scatter of the residuals over what they were taken for, at least 1.
    pub scatter: f64,
}

pub(super) fn certainty(problem: &Problem<'_>, law: Law, at: &[f64], base: &[Predicted]) -> Result<Certainty, Failure> {
    let rows: Vec<usize> = (0..base.len()).filter(|&row| problem.sigma(row).is_some()).collect();
    let residuals: Vec<f64> = rows.iter().map(|&row| problem.residual(row, base[row].amplitude_mm)).collect();
    let weights: Vec<f64> = residuals.iter().map(|r| (HUBER / r.abs().max(HUBER)).sqrt()).collect();
    let count = problem.unknowns.len();
    let mut jacobian = Columns::zeros(rows.len(), count);
    for (j, unknown) in problem.unknowns.iter().enumerate() {
        checkpoint(problem.monitor)?;
        let step = STEP * unknown.coordinate_per_unit();
        let side = |sign: f64| -> Result<(f64, Vec<Predicted>), Failure> {
            let mut moved = at.to_vec();
            moved[j] = (at[j] + sign * step).clamp(0.0, 1.0);
            Ok((moved[j], problem.predict(&problem.values(&moved), law, 1)?))
        };
        let ((from, low), (to, high)) = (side(-1.0)?, side(1.0)?);
        let width = (to - from) / unknown.coordinate_per_unit();
        for (i, &row) in rows.iter().enumerate() {
            // A row that passes the limit of chatter jumps, and just above it the amplitude rises like a wall.
            let stable = |of: &Predicted| of.modulus < 1.0;
            if [&low[row], &base[row], &high[row]].iter().any(|of| (1.0..STEEP).contains(&of.modulus)) {
                continue;
            }
            if width > 0.0 && stable(&low[row]) == stable(&high[row]) {
                let change =
                    problem.residual(row, high[row].amplitude_mm) - problem.residual(row, low[row].amplitude_mm);
                jacobian.set(i, j, weights[i] * change / width);
            }
        }
    }
    let squares: f64 = residuals.iter().zip(&weights).map(|(r, w)| (w * r).powi(2)).sum();
    let scatter = (squares / rows.len().saturating_sub(count).max(1) as f64).sqrt().max(1.0);
    Ok(of_jacobian(&jacobian, scatter))
}

/// From the weighted derivatives of the residuals.
fn of_jacobian(jacobian: &Columns, scatter: f64) -> Certainty {
    let count = jacobian.count();
    let mut gram = Columns::zeros(count, count);
    for i in 0..count {
        for j in 0..count {
            gram.set(i, j, dot(jacobian.column(i), jacobian.column(j)));
        }
    }
    let (values, vectors) = symmetric_eigen(&gram);
    let largest = values.last().copied().unwrap_or(0.0);
    let seen = |value: f64| value > UNSEEN * largest && value > 0.0;
    let mut combinations: Vec<(Option<f64>, Vec<f64>)> = Vec::with_capacity(count);
    let mut covariance = Columns::zeros(count, count);
    let mut fixed = vec![true; count];
    for (k, &value) in values.iter().enumerate().rev() {
        let vector = vectors.column(k);
        combinations.push((seen(value).then(|| scatter / value.sqrt()), vector.to_vec()));
        for i in 0..count {
            if seen(value) {
                for j in 0..count {
                    covariance.set(i, j, covariance.at(i, j) + scatter * scatter * vector[i] * vector[j] / value);
                }
            } else if vector[i].abs() > 1e-3 {
                fixed[i] = false;
            }
        }
    }
    let sd: Vec<Option<f64>> = (0..count).map(|i| fixed[i].then(|| covariance.at(i, i).max(0.0).sqrt())).collect();
    let mut correlations = Vec::new();
    for i in 0..count {
        for j in i + 1..count {
            if let (Some(a), Some(b)) = (sd[i], sd[j])
                && a * b > 0.0
            {
                correlations.push((i, j, (covariance.at(i, j) / (a * b)).clamp(-1.0, 1.0)));
            }
        }
    }
    Certainty { sd, correlations, combinations, scatter }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn two_columns_that_move_together_are_known_by_their_sum() {
        // r = (a + b) x + c: three rows, the columns of a and b equal.
        let x = [1.0, 2.0, 3.0];
        let jacobian = Columns::of(3, [&x[..], &x[..], &[1.0, 1.0, 1.0][..]]);
        let found = of_jacobian(&jacobian, 1.0);
        assert!(found.sd[0].is_none() && found.sd[1].is_none() && found.sd[2].is_some(), "{found:?}");
        let unseen = found.combinations.last().unwrap();
        assert!(unseen.0.is_none() && (unseen.1[0] + unseen.1[1]).abs() < 1e-9, "{unseen:?}");
        // Orthogonal columns of lengths 2 and 5: deviations 1/2 and 1/5, no correlation, the better known first.
        let jacobian = Columns::of(2, [&[2.0, 0.0][..], &[0.0, 5.0][..]]);
        let found = of_jacobian(&jacobian, 3.0);
        assert!((found.sd[0].unwrap() - 1.5).abs() < 1e-12 && (found.sd[1].unwrap() - 0.6).abs() < 1e-12);
        assert!(found.correlations[0].2.abs() < 1e-12 && (found.combinations[0].0.unwrap() - 0.6).abs() < 1e-12);
    }
}
