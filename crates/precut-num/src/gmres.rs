//! Large linear systems whose matrix can only be applied: GMRES (Saad and Schultz 1986) without restart.

use super::dense::{add_scaled, dot, length};

/// What a solve gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The vector.
    pub x: Vec<f64>,
    /// Length of the residual over that of the right-hand side.
    pub residual: f64,
    /// Applications of the matrix.
    pub steps: usize,
}

/// Solves A x = `right` from x = 0 until the residual is below `tolerance` of the right-hand side, or after `most` applications.
///
/// The residual falls fast where A is the identity and few directions more. A zero right-hand side gives 0.
///
/// # Errors
/// Those of `apply`, with which it ends.
pub fn gmres<E>(
    right: &[f64],
    tolerance: f64,
    most: usize,
    mut apply: impl FnMut(&[f64]) -> Result<Vec<f64>, E>,
) -> Result<Solution, E> {
    let whole = length(right);
    if whole <= 0.0 || !whole.is_finite() {
        return Ok(Solution { x: vec![0.0; right.len()], residual: 0.0, steps: 0 });
    }
    let mut basis = vec![scaled(right, 1.0 / whole)];
    // The Hessenberg matrix turned triangular column by column, the rotations that did it, and the right-hand side turned along.
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let mut turns: Vec<(f64, f64)> = Vec::new();
    let mut turned = vec![whole];
    while columns.len() < most {
        let steps = columns.len();
        if turned[steps].abs() <= tolerance * whole {
            break;
        }
        let mut next = apply(&basis[steps])?;
        let before = length(&next);
        let mut column = Vec::with_capacity(steps + 2);
        for vector in &basis {
            let along = dot(vector, &next);
            add_scaled(&mut next, -along, vector);
            column.push(along);
        }
        let below = length(&next);
        for (k, &(cos, sin)) in turns.iter().enumerate() {
            let (above, under) = (column[k], column[k + 1]);
            (column[k], column[k + 1]) = (cos * above + sin * under, cos * under - sin * above);
        }
        let diagonal = column[steps].hypot(below);
        // The space is exhausted where nothing new is left of a vector: what it holds is exact, unless A is singular in it.
        let exhausted = below <= f64::EPSILON * before;
        if diagonal <= f64::EPSILON * before {
            break;
        }
        let (cos, sin) = (column[steps] / diagonal, below / diagonal);
        column[steps] = diagonal;
        turned.push(-sin * turned[steps]);
        turned[steps] *= cos;
        turns.push((cos, sin));
        columns.push(column);
        if exhausted {
            break;
        }
        basis.push(scaled(&next, 1.0 / below));
    }
    let mut x = vec![0.0; right.len()];
    let mut factors = vec![0.0; columns.len()];
    for k in (0..columns.len()).rev() {
        let known: f64 = (k + 1..columns.len()).map(|later| columns[later][k] * factors[later]).sum();
        factors[k] = (turned[k] - known) / columns[k][k];
    }
    for (vector, factor) in basis.iter().zip(&factors) {
        add_scaled(&mut x, *factor, vector);
    }
    Ok(Solution { x, residual: turned[columns.len()].abs() / whole, steps: columns.len() })
}

fn scaled(vector: &[f64], factor: f64) -> Vec<f64> {
    vector.iter().map(|value| factor * value).collect()
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::{Solution, length};

    fn gmres(right: &[f64], tolerance: f64, most: usize, mut apply: impl FnMut(&[f64]) -> Vec<f64>) -> Solution {
        super::gmres(right, tolerance, most, |v| Ok::<_, Infallible>(apply(v))).unwrap_or_else(|never| match never {})
    }

    #[test]
    fn an_error_ends_it() {
        let mut applied = 0;
        let apply = |v: &[f64]| {
            applied += 1;
            if applied < 2 { Ok(v.iter().rev().copied().collect()) } else { Err("no more") }
        };
        assert_eq!(super::gmres(&[1.0, 2.0, 4.0, 8.0], 1e-12, 9, apply), Err("no more"));
        assert_eq!(applied, 2);
    }

    /// The identity and a rank-2 part that is not symmetric.
    fn few_directions_more(vector: &[f64]) -> Vec<f64> {
        let (first, second) = (vector.iter().sum::<f64>(), vector[0] - vector[3]);
        vector
            .iter()
            .enumerate()
            .map(|(i, v)| v + 0.3 * first * (i as f64).cos() - 2.0 * second / (1.0 + i as f64))
            .collect()
    }

    #[test]
    fn few_directions_take_as_many_steps() {
        let wanted: Vec<f64> = (0..40).map(|i| (0.7 * f64::from(i)).sin()).collect();
        let found = gmres(&few_directions_more(&wanted), 1e-13, 10, few_directions_more);
        assert!(found.steps <= 3, "{}", found.steps);
        for (x, y) in found.x.iter().zip(&wanted) {
            assert!((x - y).abs() < 1e-11, "{x} {y}");
        }
    }

    #[test]
    fn the_residual_is_what_is_left() {
        let right: Vec<f64> = (0..12).map(|i| 1.0 + f64::from(i * i % 7)).collect();
        let apply = |v: &[f64]| -> Vec<f64> {
            (0..v.len()).map(|i| (1.0 + i as f64) * v[i] + 0.5 * v[(i + 1) % v.len()]).collect()
        };
        let found = gmres(&right, 1e-12, 4, apply);
        let left: Vec<f64> = apply(&found.x).iter().zip(&right).map(|(a, b)| b - a).collect();
        assert_eq!(found.steps, 4);
        assert!((length(&left) / length(&right) - found.residual).abs() < 1e-12);
        assert!(found.residual < 0.2);
    }

    #[test]
    fn nothing_asked_gives_nothing_and_a_singular_matrix_ends() {
        assert_eq!(gmres(&[0.0; 3], 1e-12, 5, <[f64]>::to_vec).x, [0.0; 3]);
        let found = gmres(&[1.0, 1.0], 1e-12, 5, |v| vec![v[0], 0.0]);
        assert!(found.residual > 0.5 && found.x.iter().all(|x| x.is_finite()));
    }
}
